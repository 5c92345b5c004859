/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "contact/contact.h"

#include <math.h>
#include <stdatomic.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/histogram.h"
#include "base/thread.h"
#include "base/vec.h"
#include "contact/asking.h"
#include "contact/flat_areas.h"
#include "sync/mesh_filter.h"
#include "sync/tool_seams.h"
#include "sync/tool_side.h"
#include "sync/touch_local.h"

/* One pass: pairs and poses in, contacts out, each with what the tick needs to place it anew. Then
 * the life of the contact thread, and its pace. */

#define MARGIN_FLOOR 0.002 /* m */
#define MARGIN_SPEED 1.5   /* of the way that the bodies' speed makes until the next pass */
#define MARGIN_GRAVITY 9.81
#define AGE_TICKS 2.0 /* from the poses of a pass to the use of its contacts */
#define LINGER_PASSES 20u
#define LIMIT_STEPS 40   /* halvings: a metre to a picometre */
#define TOOL_ROOM 2u     /* points of hulls in a pass: those found anew at seams count twice */
#define CONTACT_HZ 200.0 /* until the first message says more */

/* Where a body of the pass is. By slot. */
typedef struct pass_body {
  uint32_t generation;
  bool known;
  hap_pose pose;
  hap_twist twist;
} pass_body;

/* What a pass found between the geoms of a pair. */
typedef struct pass_pair {
  double spare;   /* m, gap less margin: how near to a touch, beside what speed and age may make */
  uint32_t count; /* contacts */
  bool left_out;  /* for want of room */
} pass_pair;

typedef struct tool_geom tool_geom;

/* What a pass finds for the hulls. */
typedef struct tool_memory {
  tool_geom *geoms; /* capacity.tool_points, as the parts */
  hapi_tool_part *parts;
  hapi_tool_point *points; /* TOOL_ROOM times that, as the marks */
  hapi_tool_mark *marks;
  uint32_t count;
} tool_memory;

/* Points of the pairs of one key. */
typedef struct pair_group {
  hapi_flat_areas flat;
  hapi_patch_contact contacts[HAPI_FLAT_POINTS];
  hapi_contact_spot spots[HAPI_FLAT_POINTS]; /* where somebody is asked about them */
} pair_group;

struct hapi_contact {
  hapi_contact_config config;
  pair_group *group;
  hapi_near *near; /* newest one that the loop is ready for; NULL: none yet */
  hapi_poses *poses;
  pass_body *bodies; /* capacity.bodies */
  pass_pair *pairs;  /* capacity.pairs */
  tool_memory tools;
  hapi_asking asking;
  uint64_t number;
  uint32_t lingers;          /* passes that are made although nothing is left to find */
  _Atomic uint64_t left_out; /* pairs without room for their contacts, sum over the passes */
  hapi_histogram pass_ns;
  hapi_thread thread;
  _Atomic int stop;
  int64_t start_ns;
  hapi_tape *tape; /* of a recording or a replay; NULL: none */
};

/* ---- where things are now ---- */

typedef struct placed_geom {
  const hapi_near_geom *in;
  const pass_body *body; /* NULL: static world */
  hapi_shape shape;
  hap_pose pose;
} placed_geom;

bool hapi_contact_has_news(hapi_contact *contact)
{
  HAPI_ASSERT(hapi_thread_is_mine(&contact->thread));
  hapi_poses *poses = hapi_exchange_poses_take(contact->config.exchange);
  contact->poses = poses != NULL ? poses : contact->poses;
  return contact->poses != NULL && contact->poses->model_number != 0 &&
         (contact->near == NULL || contact->poses->model_number > contact->near->model_number);
}

/* The loop's poses; for a body that it does not have yet, physics'. */
static void bodies_place(hapi_contact *contact)
{
  const hapi_near_body *near = hapi_near_bodies(contact->near);
  for (uint32_t i = 0; i < contact->config.capacity.bodies; ++i) {
    contact->bodies[i].known = false;
  }
  for (uint32_t i = 0; i < contact->near->body_count; ++i) {
    contact->bodies[near[i].slot] =
        (pass_body){near[i].generation, true, near[i].pose, near[i].twist};
  }
  const hapi_poses_body *loop = hapi_poses_bodies(contact->poses);
  for (uint32_t i = 0; i < contact->poses->body_count; ++i) {
    pass_body *body = &contact->bodies[loop[i].slot];
    if (body->known && body->generation == loop[i].generation) {
      body->pose = loop[i].pose;
      body->twist = loop[i].twist;
    }
  }
}

/* False: of a body that is not where the pass knows. */
static bool geom_place(const hapi_contact *contact, uint32_t index, placed_geom *out)
{
  const hapi_near_geom *in = &hapi_near_geoms(contact->near)[index];
  out->in = in;
  out->shape = in->shape;
  out->pose = in->pose;
  out->body = NULL;
  if (in->shape.kind == HAPI_SHAPE_HULL) {
    out->shape.hull = hapi_near_points(contact->near) + (size_t)3 * in->hull_first;
  }
  if (in->body == HAPI_SLOT_NONE) {
    return true;
  }
  const pass_body *body = &contact->bodies[in->body];
  out->body = body;
  hapi_pose_point(body->pose.position, body->pose.quat_wxyz, in->pose.position, out->pose.position);
  hapi_quat_multiply(body->pose.quat_wxyz, in->pose.quat_wxyz, out->pose.quat_wxyz);
  return body->known && body->generation == in->generation;
}

static hapi_touch_side geom_side(const placed_geom *geom)
{
  return (hapi_touch_side){.body = geom->body != NULL ? &geom->body->pose : NULL,
                           .pose = geom->pose,
                           .shape = geom->shape,
                           .shape_pose = geom->in->pose};
}

/* What moves, and how far it reaches about the origin of its body; of the static world nothing. */
typedef struct mover {
  const hap_twist *twist;
  double extent; /* m */
} mover;

static mover geom_mover(const placed_geom *geom)
{
  static const hap_twist still;
  const hapi_shape *s = &geom->shape;
  if (geom->body == NULL) {
    return (mover){&still, 0.0};
  }
  return (mover){&geom->body->twist, hapi_v3_norm(geom->in->pose.position) + hapi_v3_norm(s->half) +
                                         s->radius + geom->in->extent};
}

/* m, along the normal: how far surfaces may come nearer until the contacts are found anew. */
static double margin_between(const hapi_contact *contact, mover a, mover b)
{
  double apart[3];
  double seconds = hapi_contact_period(contact) + AGE_TICKS / contact->config.haptic_hz;
  hapi_v3_sub(a.twist->linear, b.twist->linear, apart);
  double speed = hapi_v3_norm(a.twist->angular) * a.extent +
                 hapi_v3_norm(b.twist->angular) * b.extent + hapi_v3_norm(apart);
  return MARGIN_FLOOR + MARGIN_SPEED * speed * seconds + 0.5 * MARGIN_GRAVITY * seconds * seconds;
}

/* ---- pairs of geoms ---- */

typedef struct placed_pair {
  placed_geom a;
  placed_geom b;
  double margin;
  hapi_patch patch;
} placed_pair;

/* A triangle's neighbours in the mesh hide its edges. out: of the triangle. */
static bool triangle_allows(const placed_geom *geom, const double out[3])
{
  double own[3];
  if (geom->in->open_edges == 0) {
    return true;
  }
  hapi_quat_unrotate(geom->pose.quat_wxyz, out, own);
  return hapi_mesh_allows(geom->in->open_edges, geom->shape.hull, own);
}

static bool point_is_allowed(const placed_geom *a, const placed_geom *b,
                             const hapi_patch_point *point)
{
  double into[3];
  hapi_v3_scale(-1.0, point->normal, into);
  return triangle_allows(a, into) && triangle_allows(b, point->normal);
}

/* The points of a pair, deepest first, that count; false: none. */
static bool find_pair(const hapi_contact *contact, uint32_t index, placed_pair *out)
{
  const hapi_near_pair *pair = &hapi_near_pairs(contact->near)[index];
  hapi_patch *patch = &out->patch;
  int count = 0;
  patch->count = 0;
  if (!geom_place(contact, pair->geom_a, &out->a) || !geom_place(contact, pair->geom_b, &out->b)) {
    return false;
  }
  out->margin = margin_between(contact, geom_mover(&out->a), geom_mover(&out->b));
  if (!hapi_patch_find(&out->a.shape, &out->a.pose, &out->b.shape, &out->b.pose, out->margin,
                       patch)) {
    return false;
  }
  for (int i = 0; i < patch->count; ++i) {
    if (point_is_allowed(&out->a, &out->b, &patch->points[i])) {
      patch->points[count++] = patch->points[i];
    }
  }
  patch->count = count;
  return count > 0;
}

static void pair_contact(const placed_pair *found, const hapi_near_pair *pair, int point,
                         hapi_patch_contact *out)
{
  const hapi_touch_side side_a = geom_side(&found->a);
  const hapi_touch_side side_b = geom_side(&found->b);
  out->body_a = found->a.in->body;
  out->generation_a = found->a.in->generation;
  out->body_b = found->b.in->body;
  out->generation_b = found->b.in->generation;
  hapi_touch_localise(&side_a, &side_b, &found->patch.points[point], out);
  out->key = pair->key;
}

static void placed_velocity(const placed_geom *geom, const double point[3], double out[3])
{
  hapi_v3_set(out, 0.0, 0.0, 0.0);
  if (geom->body != NULL) {
    double arm[3];
    hapi_v3_sub(point, geom->body->pose.position, arm);
    hapi_v3_cross(geom->body->twist.angular, arm, out);
    hapi_v3_add(out, geom->body->twist.linear, out);
  }
}

/* Of side a, or of side b. */
static void surface_point(const placed_geom *geom, const hapi_patch_point *p, bool of_b,
                          double out[3])
{
  static const double along[3] = {0.0, 0.0, 1.0};
  double side = of_b ? 1.0 : -1.0;
  double rim = of_b ? p->rim_b : p->rim_a;
  hapi_v3_madd(of_b ? p->core_b : p->core_a, side * (of_b ? p->ball_b : p->ball_a), p->normal, out);
  if (rim > 0.0) {
    double axis[3];
    double across[3];
    hapi_quat_rotate(geom->pose.quat_wxyz, along, axis);
    hapi_v3_madd(p->normal, -hapi_v3_dot(p->normal, axis), axis, across);
    double length = hapi_v3_norm(across);
    if (length > 1e-12) {
      hapi_v3_madd(out, side * rim / length, across, out);
    }
  }
}

/* What the application is told of a point. */
static void pair_spot(const placed_pair *found, int point, hapi_contact_spot *out)
{
  const hapi_patch_point *p = &found->patch.points[point];
  double ends[2][3];
  double velocity[3];
  surface_point(&found->a, p, false, ends[0]);
  surface_point(&found->b, p, true, ends[1]);
  hapi_v3_add(ends[0], ends[1], out->point);
  hapi_v3_scale(0.5, out->point, out->point);
  hapi_v3_copy(p->normal, out->normal);
  out->gap = p->gap;
  placed_velocity(&found->a, out->point, out->velocity);
  placed_velocity(&found->b, out->point, velocity);
  hapi_v3_sub(out->velocity, velocity, out->velocity);
}

/* What its contacts have in common; their points are there. */
static void patches_add_pair(hapi_contact *contact, const hapi_near_pair *pair, hapi_patches *out)
{
  if (contact->near->said_count > 0) {
    contact->asking.pairs[out->surface_count] = (uint32_t)(pair - hapi_near_pairs(contact->near));
  }
  hapi_patches_pairs(out)[out->surface_count] = pair->tags;
  hapi_patches_surfaces(out)[out->surface_count++] = pair->surface;
}

static void fill_pair(hapi_contact *contact, const placed_pair *found, const hapi_near_pair *pair,
                      hapi_patches *out)
{
  for (int i = 0; i < found->patch.count; ++i) {
    if (contact->near->said_count > 0) {
      pair_spot(found, i, &contact->asking.spots[out->contact_count]);
    }
    hapi_patch_contact *c = &hapi_patches_contacts(out)[out->contact_count++];
    pair_contact(found, pair, i, c);
    c->surface = out->surface_count;
  }
  patches_add_pair(contact, pair, out);
}

/* Neighbours in a mesh share their corners and edges, and each of them finds the point there.
 * False: there is no room for all points. */
static bool group_add(pair_group *group, const placed_pair *found, const hapi_near_pair *pair,
                      bool asks)
{
  uint32_t first = HAPI_SLOT_NONE;
  for (int i = 0; i < found->patch.count; ++i) {
    const hapi_patch_point *point = &found->patch.points[i];
    uint32_t at = hapi_flat_find(&group->flat, point->core_a, point->normal);
    if (at == HAPI_FLAT_POINTS) {
      return false;
    }
    if (at == group->flat.count) {
      (void)hapi_flat_add(&group->flat, point->core_a, point->normal, point->gap);
      pair_contact(found, pair, i, &group->contacts[at]);
      if (asks) {
        pair_spot(found, i, &group->spots[at]);
      }
    }
    first = first == HAPI_SLOT_NONE ? at : first;
    hapi_flat_join(&group->flat, first, at);
  }
  return true;
}

/* Contacts of the pairs of one key, which are those of two geoms of which one or both are made of
 * triangles. Returns the first pair behind them. */
static uint32_t fill_group(hapi_contact *contact, uint32_t first, uint64_t *io_wanted,
                           hapi_patches *out)
{
  const hapi_near_pair *pairs = hapi_near_pairs(contact->near);
  pair_group *group = contact->group;
  pass_pair *pass = &contact->pairs[first];
  uint32_t end = first;
  bool all = true;
  bool asks = contact->near->said_count > 0;
  group->flat.count = 0;
  pass->spare = HUGE_VAL;
  for (; end < contact->near->pair_count && pairs[end].key == pairs[first].key; ++end) {
    placed_pair found;
    contact->pairs[end].count = 0;
    if (!pass->left_out && find_pair(contact, end, &found)) {
      pass->spare = fmin(pass->spare, found.patch.points[0].gap - found.margin);
      all = group_add(group, &found, &pairs[end], asks) && all;
    }
  }
  atomic_fetch_add_explicit(&contact->left_out, !all, memory_order_relaxed);
  pass->count = hapi_flat_reduce(&group->flat);
  *io_wanted += pass->count;
  if (pass->count > 0 && *io_wanted <= contact->config.capacity.contacts) {
    for (uint32_t i = 0; i < group->flat.count; ++i) {
      if (!group->flat.points[i].spare) {
        if (asks) {
          contact->asking.spots[out->contact_count] = group->spots[i];
        }
        hapi_patch_contact *c = &hapi_patches_contacts(out)[out->contact_count++];
        *c = group->contacts[i];
        c->surface = out->surface_count;
      }
    }
    patches_add_pair(contact, &pairs[first], out);
  }
  return end;
}

/* Contacts of the pairs that count; false: there is no room for all of them. */
static bool fill_pairs(hapi_contact *contact, hapi_patches *out)
{
  const uint32_t room = contact->config.capacity.contacts;
  const hapi_near_pair *pairs = hapi_near_pairs(contact->near);
  uint64_t wanted = 0;
  out->contact_count = 0;
  out->surface_count = 0;
  for (uint32_t i = 0; i < contact->near->pair_count;) {
    pass_pair *pair = &contact->pairs[i];
    placed_pair found;
    if (i + 1 < contact->near->pair_count && pairs[i + 1].key == pairs[i].key) {
      i = fill_group(contact, i, &wanted, out);
      continue;
    }
    if (pair->left_out || !find_pair(contact, i, &found)) {
      pair->count = 0;
      ++i;
      continue;
    }
    pair->count = (uint32_t)found.patch.count;
    pair->spare = found.patch.points[0].gap - found.margin;
    wanted += pair->count;
    if (wanted <= room) {
      fill_pair(contact, &found, &pairs[i], out);
    }
    ++i;
  }
  return wanted <= room;
}

/* ---- more than there is room for ---- */

static uint64_t count_up_to(const hapi_contact *contact, double spare)
{
  uint64_t count = 0;
  for (uint32_t i = 0; i < contact->near->pair_count; ++i) {
    count += contact->pairs[i].spare <= spare ? contact->pairs[i].count : 0;
  }
  return count;
}

/* The largest spare up to which there is room for all, from below and from above. */
static void find_limit(const hapi_contact *contact, double *out_below, double *out_above)
{
  double least = 0.0; /* no spare is larger: a gap is within its margin */
  for (uint32_t i = 0; i < contact->near->pair_count; ++i) {
    bool counts = contact->pairs[i].count > 0;
    least = counts && contact->pairs[i].spare < least ? contact->pairs[i].spare : least;
  }
  *out_below = 2.0 * least - 1.0;
  *out_above = 0.0;
  for (int i = 0; i < LIMIT_STEPS; ++i) {
    double middle = 0.5 * (*out_below + *out_above);
    bool fits = count_up_to(contact, middle) <= contact->config.capacity.contacts;
    *(fits ? out_below : out_above) = middle;
  }
}

/* Whoever comes last in the list must not lose the ground under it to pairs that do not touch:
 * first those go that would need to come nearest in order to. */
static void leave_out_farthest(hapi_contact *contact)
{
  double below;
  double above;
  find_limit(contact, &below, &above);
  uint64_t used = count_up_to(contact, below);
  for (uint32_t i = 0; i < contact->near->pair_count; ++i) {
    pass_pair *pair = &contact->pairs[i];
    if (pair->count == 0 || pair->spare <= below) {
      continue;
    }
    bool fits = pair->spare <= above && used + pair->count <= contact->config.capacity.contacts;
    used += fits ? pair->count : 0;
    pair->left_out = !fits;
    atomic_fetch_add_explicit(&contact->left_out, !fits, memory_order_relaxed);
  }
}

/* ---- pointers that are hulls: as pairs of bodies, with the pointer as the first one ---- */

typedef struct placed_tool {
  const hapi_near_tool *in;
  hap_pose pose;
  hap_twist twist;
} placed_tool;

/* The points of one key: of a mesh with many triangles there are many. */
typedef struct tool_group {
  hapi_tool_point points[HAPI_TOOL_SPOTS];
  hapi_tool_spots spots;
  uint32_t pairs;
} tool_group;

static bool point_counts(const placed_geom *geom, hapi_patch_point *io)
{
  double corners[9]; /* of the triangle in the world */
  if (geom->in->open_edges == 0) {
    return true;
  }
  for (int k = 0; k < 9; k += 3) {
    hapi_pose_point(geom->pose.position, geom->pose.quat_wxyz, geom->shape.hull + k, corners + k);
  }
  hapi_mesh_straighten(corners, io);
  return hapi_mesh_allows(geom->in->open_edges, corners, io->normal);
}

static hapi_touch_side tool_side_at(const placed_tool *tool, const hap_pose *pose)
{
  return (hapi_touch_side){.body = pose,
                           .pose = *pose,
                           .shape = {.kind = HAPI_SHAPE_HULL,
                                     .rounding = tool->in->radius,
                                     .hull = &tool->in->hull.points[0][0],
                                     .hull_count = tool->in->hull.count},
                           .shape_pose = {.quat_wxyz = {1.0, 0.0, 0.0, 0.0}}};
}

/* m: a shape of that extent is not nearer to the geom than this. */
static double least_distance(const placed_geom *geom, const hapi_touch_side *from, double extent)
{
  const hapi_shape *s = &geom->shape;
  double middle[3] = {0.0, 0.0, 0.0}; /* in the geom's frame */
  double reach = hapi_v3_norm(s->half) + s->radius;
  if (s->kind == HAPI_SHAPE_PLANE) {
    return -HUGE_VAL;
  }
  if (s->kind == HAPI_SHAPE_HULL) {
    double side[3];
    hapi_v3_copy(s->hull, middle);
    for (size_t i = 1; i < s->hull_count; ++i) {
      hapi_v3_sub(s->hull + 3 * i, s->hull, side);
      reach = fmax(reach, hapi_v3_norm(side));
    }
  }
  hapi_pose_point(geom->pose.position, geom->pose.quat_wxyz, middle, middle);
  hapi_v3_sub(middle, from->pose.position, middle);
  return hapi_v3_norm(middle) - extent - reach;
}

/* The points where the hull would touch if it were there, away from where it is. */
static void tool_pair_add(const hapi_contact *contact, const placed_tool *tool,
                          const hapi_near_tool_pair *pair, const double away[3], tool_group *io)
{
  placed_geom geom;
  hapi_patch patch;
  hap_pose pose = tool->pose;
  hapi_v3_add(pose.position, away, pose.position);
  if (!geom_place(contact, pair->geom, &geom)) {
    return;
  }
  const mover self = {&tool->twist, tool->in->extent};
  const hapi_touch_side a = tool_side_at(tool, &pose);
  const hapi_touch_side b = geom_side(&geom);
  double margin = margin_between(contact, self, geom_mover(&geom)) + pair->reach;
  if (least_distance(&geom, &a, tool->in->extent) > margin) {
    ++io->pairs;
    return;
  }
  if (!hapi_tool_patch(&a, &b, margin, tool->in->extent, &patch)) {
    return;
  }
  for (int i = 0; i < patch.count && io->spots.count < HAPI_TOOL_SPOTS; ++i) {
    if (!point_counts(&geom, &patch.points[i])) {
      continue;
    }
    uint32_t at = io->spots.count++;
    hapi_tool_point *out = &io->points[at];
    memset(out, 0, sizeof *out);
    out->pointer = tool->in->pointer;
    out->pointer_generation = tool->in->generation;
    out->same_within = hapi_tool_same_within(tool->in->extent);
    out->mu = pair->mu;
    out->feel = pair->feel;
    out->geom = pair->tag;
    hapi_touch_localise(&a, &b, &patch.points[i], &out->at);
    out->at.key = pair->key;
    out->at.body_a = HAPI_SLOT_NONE;
    out->at.body_b = geom.in->body;
    out->at.generation_b = geom.in->generation;
    hapi_v3_copy(out->at.core_a, io->spots.places[at]);
    hapi_v3_copy(patch.points[i].normal, io->spots.normals[at]);
    hapi_touch_on_shape(&b, &patch.points[i], io->spots.on_geom[at]);
    io->spots.gaps[at] = patch.points[i].gap - hapi_v3_dot(patch.points[i].normal, away);
  }
  ++io->pairs;
}

/* The pairs of one key, which follow each other. */
struct tool_geom {
  placed_tool tool;
  const hapi_near_tool_pair *pairs;
  uint32_t count;
};

/* For calls back. */
typedef struct tool_pass {
  hapi_contact *contact;
  const tool_geom *geom;
} tool_pass;

static void tool_geom_find(const hapi_contact *contact, const tool_geom *g, const double away[3],
                           tool_group *out)
{
  out->spots.count = out->pairs = 0;
  for (uint32_t i = 0; i < g->count; ++i) {
    tool_pair_add(contact, &g->tool, &g->pairs[i], away, out);
  }
}

/* From a shape of that extent; false: it is not nearer than *io_distance. */
static bool tool_geom_distance(const hapi_contact *contact, const tool_geom *g,
                               const hapi_touch_side *from, double extent, double *io_distance,
                               double out_normal[3])
{
  bool found = false;
  for (uint32_t i = 0; i < g->count; ++i) {
    placed_geom geom;
    double distance;
    double normal[3];
    if (geom_place(contact, g->pairs[i].geom, &geom) &&
        least_distance(&geom, from, extent) < *io_distance &&
        hapi_patch_distance(&from->shape, &from->pose, &geom.shape, &geom.pose, &distance,
                            normal) &&
        distance < *io_distance) {
      found = true;
      *io_distance = distance;
      hapi_v3_copy(normal, out_normal);
    }
  }
  return found;
}

/* As hapi_tool_distance. */
static bool tool_pass_distance(void *of, const hap_pose *hull, double *out_distance,
                               double out_normal[3])
{
  const tool_pass *pass = of;
  const placed_tool *tool = &pass->geom->tool;
  const hapi_touch_side a = tool_side_at(tool, hull);
  *out_distance = HUGE_VAL;
  return tool_geom_distance(pass->contact, pass->geom, &a, tool->in->extent, out_distance,
                            out_normal);
}

/* Where the hull is deep in the geom, or behind it, the points of the side that it touches. */
static void tool_geom_keep_side(hapi_contact *contact, const tool_geom *g, tool_group *io)
{
  placed_geom geom;
  double away[3];
  tool_pass pass = {contact, g};
  const hapi_tool_side *told =
      hapi_tool_side_find(hapi_poses_sides(contact->poses), contact->poses->side_count,
                          g->pairs->key, g->tool.in->pointer);
  if (told == NULL || !geom_place(contact, g->pairs->geom, &geom)) {
    return;
  }
  const hapi_tool_seek seek = {.told = told,
                               .body = geom.body != NULL ? &geom.body->pose : NULL,
                               .hull = &g->tool.pose,
                               .extent = g->tool.in->extent,
                               .distance = tool_pass_distance,
                               .geom = &pass};
  if (hapi_tool_side_seek(&seek, &io->spots, away)) {
    tool_geom_find(contact, g, away, io);
  }
}

/* Nearest first is the order of the pairs: what finds no room is the farthest. */
static void part_take(hapi_contact *contact, uint32_t part, const tool_group *in)
{
  tool_memory *m = &contact->tools;
  uint32_t kept[HAPI_TOOL_PAIR_POINTS];
  uint32_t count = in->spots.count;
  if (in->pairs > 1) {
    count = hapi_tool_reduce(&in->spots, kept);
  }
  m->parts[part].first = m->count;
  m->parts[part].count = 0;
  if (m->count + count > TOOL_ROOM * contact->config.capacity.tool_points) {
    atomic_fetch_add_explicit(&contact->left_out, 1, memory_order_relaxed);
    return;
  }
  for (uint32_t i = 0; i < count; ++i) {
    uint32_t from = in->pairs > 1 ? kept[i] : i;
    hapi_tool_mark *mark = &m->marks[m->count];
    m->points[m->count++] = in->points[from];
    *mark = (hapi_tool_mark){.gap = in->spots.gaps[from],
                             .border = in->points[from].at.slide != HAPI_SLIDE_NONE};
    hapi_v3_copy(in->spots.on_geom[from], mark->at);
    hapi_v3_copy(in->spots.places[from], mark->place);
    hapi_v3_copy(in->spots.normals[from], mark->normal);
  }
  m->parts[part].count = count;
}

/* ---- where geoms adjoin, as tool_seams.h asks ---- */

static bool part_holds(void *of, uint32_t part, const double point[3], double within)
{
  const hapi_contact *contact = of;
  double normal[3];
  hapi_touch_side ball = {.pose = {.quat_wxyz = {1.0, 0.0, 0.0, 0.0}},
                          .shape = {.kind = HAPI_SHAPE_SPHERE}};
  hapi_v3_copy(point, ball.pose.position);
  return tool_geom_distance(contact, &contact->tools.geoms[part], &ball, 0.0, &within, normal);
}

static double part_depth(void *of, uint32_t part, const double away[3])
{
  const hapi_contact *contact = of;
  const tool_geom *g = &contact->tools.geoms[part];
  double distance = HUGE_VAL;
  double normal[3];
  hap_pose pose = g->tool.pose;
  hapi_v3_add(pose.position, away, pose.position);
  const hapi_touch_side a = tool_side_at(&g->tool, &pose);
  bool found = tool_geom_distance(contact, g, &a, g->tool.in->extent, &distance, normal);
  return found ? -distance : -HUGE_VAL;
}

static void part_look(void *of, uint32_t part, const double away[3])
{
  hapi_contact *contact = of;
  tool_group found;
  tool_geom_find(contact, &contact->tools.geoms[part], away, &found);
  part_take(contact, part, &found);
}

/* Those that are left, in the order of the parts. */
static void parts_fill(hapi_contact *contact, uint32_t count, hapi_patches *out)
{
  const tool_memory *m = &contact->tools;
  out->tool_count = 0;
  for (uint32_t i = 0; i < count; ++i) {
    const hapi_tool_part *part = &m->parts[i];
    if (out->tool_count + part->count > contact->config.capacity.tool_points) {
      atomic_fetch_add_explicit(&contact->left_out, 1, memory_order_relaxed);
      continue;
    }
    for (uint32_t k = part->first; k < part->first + part->count; ++k) {
      if (!m->marks[k].dropped) {
        hapi_tool_point *point = &hapi_patches_tools(out)[out->tool_count++];
        *point = m->points[k];
        point->group = part->group;
      }
    }
  }
}

static void tools_fill(hapi_contact *contact, hapi_patches *out)
{
  static const double here[3] = {0.0, 0.0, 0.0};
  const hapi_near_tool_pair *pairs = hapi_near_tool_pairs(contact->near);
  tool_memory *m = &contact->tools;
  uint32_t parts = 0;
  tool_group found;
  m->count = 0;
  for (uint32_t i = 0; i < contact->near->tool_pair_count;) {
    uint64_t key = pairs[i].key;
    const hapi_near_tool *in = &hapi_near_tools(contact->near)[pairs[i].tool];
    const hapi_poses_pointer *loop = &hapi_poses_pointers(contact->poses)[in->pointer];
    bool told = loop->generation == in->generation; /* the loop's pose; if it told none, physics' */
    tool_geom geom = {.tool = {in, told ? loop->pose : in->pose, told ? loop->twist : in->twist},
                      .pairs = &pairs[i]};
    for (; i < contact->near->tool_pair_count && pairs[i].key == key; ++i) {
      ++geom.count;
    }
    tool_geom_find(contact, &geom, here, &found);
    if (told) {
      tool_geom_keep_side(contact, &geom, &found);
    }
    if (found.spots.count > 0 && parts < contact->config.capacity.tool_points) {
      m->geoms[parts] = geom;
      m->parts[parts] =
          (hapi_tool_part){.key = key, .hull = geom.pairs->tool, .extent = in->extent};
      part_take(contact, parts++, &found);
    } else {
      atomic_fetch_add_explicit(&contact->left_out, found.spots.count > 0, memory_order_relaxed);
    }
  }
  hapi_tool_seams seams = {.of = contact,
                           .parts = m->parts,
                           .count = parts,
                           .marks = m->marks,
                           .holds = part_holds,
                           .depth = part_depth,
                           .look = part_look};
  hapi_tool_seams_join(&seams);
  parts_fill(contact, parts, out);
}

/* ---- a pass ---- */

/* Without the keys, which are counted through all runs of a session. */
static uint64_t patches_hash(hapi_patches *patches)
{
  const hapi_patch_contact *c = hapi_patches_contacts(patches);
  uint64_t hash = hapi_hash_word(HAPI_HASH_BEGIN, patches->model_number);
  for (uint32_t i = 0; i < patches->contact_count; ++i) {
    hash = hapi_hash_word(hash, ((uint64_t)c[i].body_a << 32) | c[i].body_b);
    hash = hapi_hash_doubles(hash, c[i].core_a, 3);
    hash = hapi_hash_doubles(hash, c[i].core_b, 3);
    hash = hapi_hash_doubles(hash, c[i].normal, 3);
  }
  const hapi_tool_point *tools = hapi_patches_tools(patches);
  for (uint32_t i = 0; i < patches->tool_count; ++i) {
    hash = hapi_hash_word(hash, ((uint64_t)tools[i].pointer << 32) | tools[i].at.body_b);
    hash = hapi_hash_doubles(hash, tools[i].at.core_a, 3);
    hash = hapi_hash_doubles(hash, tools[i].at.core_b, 3);
    hash = hapi_hash_doubles(hash, tools[i].at.normal, 3);
  }
  return hash;
}

/* The pass's part of a recording: what it was made from, and a hash of what it found. */
static void tape_follow(hapi_contact *contact, hapi_patches *out)
{
  const hapi_exchange *exchange = contact->config.exchange;
  if (hapi_tape_records(contact->tape)) {
    hapi_tape_open(contact->tape);
    hapi_cell *cell = hapi_tape_put(contact->tape, HAPI_CELL_PASS, 0);
    cell->u[HAPI_PASS_NUMBER] = out->number;
    cell->u[HAPI_PASS_POSES] = hapi_exchange_taken(exchange, HAPI_CHANNEL_POSES);
    cell->u[HAPI_PASS_NEAR] = hapi_exchange_taken(exchange, HAPI_CHANNEL_NEAR);
    cell->i[HAPI_PASS_VALID] = out->valid_from_ns;
    cell->u[HAPI_PASS_HASH] = patches_hash(out);
    hapi_verdicts_put(&contact->asking.verdicts, contact->tape, cell);
    hapi_tape_commit(contact->tape);
  } else if (hapi_tape_plays(contact->tape)) {
    const hapi_cell *cell = contact->asking.played;
    const hapi_difference difference = {.what = HAPI_DIFFERS_PASS, .number = out->number};
    if (cell->u[HAPI_PASS_HASH] != patches_hash(out)) {
      hapi_tape_differ(contact->tape, &difference);
    }
  }
}

/* What was found last is taken back where there is nothing any more; points of hulls go slowly. */
static bool work_is_left(const hapi_contact *contact)
{
  const hapi_near *near = contact->near;
  return near != NULL && contact->poses != NULL &&
         (near->pair_count + near->tool_pair_count > 0 || contact->lingers > 0 ||
          near->always != 0);
}

static void pass_make(hapi_contact *contact, int64_t valid_from_ns)
{
  hapi_patches *out = hapi_exchange_patches_back(contact->config.exchange);
  hapi_asking_begin(&contact->asking, contact->tape, contact->config.capacity.contacts);
  bodies_place(contact);
  for (uint32_t i = 0; i < contact->near->pair_count; ++i) {
    contact->pairs[i].left_out = false;
  }
  if (!fill_pairs(contact, out)) {
    leave_out_farthest(contact);
    (void)fill_pairs(contact, out);
  }
  hapi_asking_run(&contact->asking, contact->near, contact->tape, out);
  tools_fill(contact, out);
  out->number = ++contact->number;
  bool found = out->contact_count + out->tool_count > 0;
  contact->lingers = found ? LINGER_PASSES : contact->lingers - (contact->lingers > 0);
  out->model_number = contact->near->model_number;
  out->tick = contact->poses->tick;
  out->valid_from_ns = valid_from_ns;
  tape_follow(contact, out);
  hapi_exchange_patches_publish(contact->config.exchange);
}

void hapi_contact_pass(hapi_contact *contact, int64_t valid_from_ns)
{
  int64_t begin_ns = hapi_clock_now();
  bool news = hapi_contact_has_news(contact);
  /* Pairs that the loop is not ready for stay in the mailbox: those that it goes on with would lose
   * their contacts. */
  if (news) {
    hapi_near *near = hapi_exchange_near_take(contact->config.exchange);
    contact->near = near != NULL ? near : contact->near;
  }
  news = news || hapi_tape_plays(contact->tape);
  if (!work_is_left(contact) || (!news && contact->near->between == 0)) {
    return;
  }
  unsigned before = hapi_denormals_flush();
  pass_make(contact, valid_from_ns);
  hapi_denormals_restore(before);
  hapi_histogram_add(&contact->pass_ns, hapi_clock_now() - begin_ns);
}

/* ---- the thread ---- */

hap_status hapi_contact_create(const hapi_contact_config *config, hapi_contact **out)
{
  *out = NULL;
  hapi_contact *contact = hapi_alloc(sizeof *contact);
  if (contact == NULL) {
    return HAP_ERROR_MEMORY;
  }
  contact->config = *config;
  contact->asking.ask = config->ask;
  contact->asking.of = config->ask_of;
  contact->bodies = hapi_alloc_array(config->capacity.bodies, sizeof *contact->bodies);
  contact->pairs = hapi_alloc_array(config->capacity.pairs, sizeof *contact->pairs);
  tool_memory *tools = &contact->tools;
  const uint32_t most = config->capacity.tool_points;
  tools->geoms = hapi_alloc_array(most, sizeof *tools->geoms);
  tools->parts = hapi_alloc_array(most, sizeof *tools->parts);
  tools->points = hapi_alloc_array((size_t)TOOL_ROOM * most, sizeof *tools->points);
  tools->marks = hapi_alloc_array((size_t)TOOL_ROOM * most, sizeof *tools->marks);
  contact->group = hapi_alloc(sizeof *contact->group);
  if (contact->bodies == NULL || contact->pairs == NULL || contact->group == NULL ||
      tools->geoms == NULL || tools->parts == NULL || tools->points == NULL ||
      tools->marks == NULL ||
      (config->ask != NULL && !hapi_asking_create(&contact->asking, config->capacity.contacts))) {
    hapi_contact_destroy(contact);
    return HAP_ERROR_MEMORY;
  }
  *out = contact;
  return HAP_OK;
}

void hapi_contact_destroy(hapi_contact *contact)
{
  if (contact == NULL) {
    return;
  }
  hapi_contact_stop_thread(contact);
  hapi_free(contact->bodies);
  hapi_free(contact->pairs);
  hapi_free(contact->tools.geoms);
  hapi_free(contact->tools.parts);
  hapi_free(contact->tools.points);
  hapi_free(contact->tools.marks);
  hapi_free(contact->group);
  hapi_asking_finish(&contact->asking);
  hapi_free(contact);
}

void hapi_contact_set_tape(hapi_contact *contact, hapi_tape *tape)
{
  contact->tape = tape;
}

void hapi_contact_begin(hapi_contact *contact, int64_t start_ns)
{
  contact->near = NULL;
  contact->poses = NULL;
  contact->number = 0;
  contact->lingers = 0;
  atomic_store(&contact->left_out, 0);
  contact->start_ns = start_ns;
  hapi_histogram_reset(&contact->pass_ns);
}

double hapi_contact_period(const hapi_contact *contact)
{
  return 1.0 / (contact->near != NULL ? contact->near->contact_hz : CONTACT_HZ);
}

/* Between two passes the thread looks once a millisecond whether there is a body that waits for its
 * first contacts. Where nothing can touch anything it sleeps until physics says otherwise. */
static void *contact_main(void *arg)
{
  const int64_t look_ns = 1000000;
  hapi_contact *contact = arg;
  hapi_thread_claim(&contact->thread);
  int64_t due = contact->start_ns;
  while (atomic_load_explicit(&contact->stop, memory_order_acquire) == 0) {
    int64_t now = hapi_clock_now();
    int64_t period = (int64_t)llround(1e9 * hapi_contact_period(contact));
    int64_t pause = period < look_ns ? period : look_ns;
    if (now >= due || hapi_contact_has_news(contact)) {
      hapi_contact_pass(contact, 0); /* due at once */
      due =
          now >= due ? due + ((now - due) / period + 1) * period : due; /* late ones are left out */
    }
    if (work_is_left(contact)) {
      hapi_clock_sleep_until(now + pause < due ? now + pause : due);
    } else {
      hapi_clock_sleep_until(now + pause);
      hapi_exchange_near_wait(contact->config.exchange);
    }
  }
  return NULL;
}

hap_status hapi_contact_start_thread(hapi_contact *contact)
{
  atomic_store(&contact->stop, 0);
  return hapi_thread_start(&contact->thread, contact_main, contact, "hapode-contact",
                           3 * contact->config.rt_priority / 4);
}

void hapi_contact_stop_thread(hapi_contact *contact)
{
  atomic_store(&contact->stop, 1);
  hapi_exchange_near_ring(contact->config.exchange);
  hapi_thread_join(&contact->thread);
}

void hapi_contact_effects(const hapi_contact *contact, hap_effect_info *out)
{
  double mean = 1e-3 * hapi_histogram_mean_ns(&contact->pass_ns);
  out[HAP_EFFECT_CONTACTS].contact_us = out[HAP_EFFECT_PASSES].contact_us = mean;
}

void hapi_contact_stats(const hapi_contact *contact, hap_stats *out)
{
  out->model.capacity_dropped += atomic_load_explicit(&contact->left_out, memory_order_relaxed);
  out->contact.us_mean = 1e-3 * hapi_histogram_mean_ns(&contact->pass_ns);
  out->contact.us_max = 1e-3 * (double)hapi_histogram_max_ns(&contact->pass_ns);
}
