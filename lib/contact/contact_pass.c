/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/clock.h"
#include "base/thread.h"
#include "base/vec.h"
#include "contact/contact_internal.h"
#include "sync/mesh_filter.h"

/* One pass: pairs and poses in, contacts out, each with what the tick needs to place it anew. */

#define MARGIN_FLOOR 0.002 /* m */
#define MARGIN_SPEED 1.5   /* of the way that the bodies' speed makes until the next pass */
#define MARGIN_GRAVITY 9.81
#define AGE_TICKS 2.0 /* from the poses of a pass to the use of its contacts */
#define LINGER_PASSES 20u
#define LIMIT_STEPS 40 /* halvings: a metre to a picometre */

typedef struct placed_pair {
  hapi_placed_geom a;
  hapi_placed_geom b;
  double margin;
  hapi_patch patch;
} placed_pair;

static void take_poses(hapi_contact *contact)
{
  hapi_poses *poses = hapi_exchange_poses_take(contact->config.exchange);
  contact->poses = poses != NULL ? poses : contact->poses;
}

bool hapi_contact_has_news(hapi_contact *contact)
{
  take_poses(contact);
  return contact->poses != NULL && contact->poses->model_number != 0 &&
         (contact->near == NULL || contact->poses->model_number > contact->near->model_number);
}

/* Pairs that the loop is not ready for stay in the mailbox: those it goes on with would lose their
 * contacts. */
static void take_near(hapi_contact *contact)
{
  if (hapi_contact_has_news(contact)) {
    hapi_near *near = hapi_exchange_near_take(contact->config.exchange);
    contact->near = near != NULL ? near : contact->near;
  }
}

/* The loop's poses; for a body that it does not have yet, physics'. */
static void place_bodies(hapi_contact *contact)
{
  const hapi_near_body *near = hapi_near_bodies(contact->near);
  for (uint32_t i = 0; i < contact->config.capacity.bodies; ++i) {
    contact->bodies[i].known = false;
  }
  for (uint32_t i = 0; i < contact->near->body_count; ++i) {
    contact->bodies[near[i].slot] =
        (hapi_pass_body){near[i].generation, true, near[i].pose, near[i].twist};
  }
  const hapi_poses_body *loop = hapi_poses_bodies(contact->poses);
  for (uint32_t i = 0; i < contact->poses->body_count; ++i) {
    hapi_pass_body *body = &contact->bodies[loop[i].slot];
    if (body->known && body->generation == loop[i].generation) {
      body->pose = loop[i].pose;
      body->twist = loop[i].twist;
    }
  }
}

bool hapi_pass_place_geom(const hapi_contact *contact, uint32_t index, hapi_placed_geom *out)
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
  const hapi_pass_body *body = &contact->bodies[in->body];
  out->body = body;
  hapi_pose_point(body->pose.position, body->pose.quat_wxyz, in->pose.position, out->pose.position);
  hapi_quat_multiply(body->pose.quat_wxyz, in->pose.quat_wxyz, out->pose.quat_wxyz);
  return body->known && body->generation == in->generation;
}

double hapi_pass_extent(const hapi_placed_geom *geom)
{
  const hapi_shape *s = &geom->shape;
  double offset = geom->body != NULL ? hapi_v3_norm(geom->in->pose.position) : 0.0;
  return offset + hapi_v3_norm(s->half) + s->radius + geom->in->extent;
}

double hapi_pass_margin(const hapi_contact *contact, double speed)
{
  double seconds = hapi_contact_period(contact) + AGE_TICKS / contact->config.haptic_hz;
  return MARGIN_FLOOR + MARGIN_SPEED * speed * seconds + 0.5 * MARGIN_GRAVITY * seconds * seconds;
}

/* Along the normal. */
static double margin_of(const hapi_contact *contact, const hapi_placed_geom *a,
                        const hapi_placed_geom *b)
{
  const hapi_placed_geom *geoms[2] = {a, b};
  double apart[3] = {0.0, 0.0, 0.0};
  double speed = 0.0;
  for (int i = 0; i < 2; ++i) {
    const hapi_pass_body *body = geoms[i]->body;
    if (body != NULL) {
      hapi_v3_madd(apart, i == 0 ? 1.0 : -1.0, body->twist.linear, apart);
      speed += hapi_v3_norm(body->twist.angular) * hapi_pass_extent(geoms[i]);
    }
  }
  return hapi_pass_margin(contact, speed + hapi_v3_norm(apart));
}

hapi_touch_side hapi_pass_side_of(const hapi_placed_geom *geom)
{
  return (hapi_touch_side){.body = geom->body != NULL ? &geom->body->pose : NULL,
                           .pose = geom->pose,
                           .shape = geom->shape,
                           .shape_pose = geom->in->pose};
}

static void fill_contact(const hapi_placed_geom *a, const hapi_placed_geom *b,
                         const hapi_patch_point *in, hapi_patch_contact *out)
{
  const hapi_touch_side side_a = hapi_pass_side_of(a);
  const hapi_touch_side side_b = hapi_pass_side_of(b);
  out->body_a = a->in->body;
  out->generation_a = a->in->generation;
  out->body_b = b->in->body;
  out->generation_b = b->in->generation;
  hapi_touch_localise(&side_a, &side_b, in, out);
}

/* A triangle's neighbours in the mesh hide its edges. */
static bool point_is_allowed(const hapi_placed_geom *a, const hapi_placed_geom *b,
                             const hapi_patch_point *point)
{
  double into[3];
  hapi_v3_scale(-1.0, point->normal, into);
  return (a->in->open_edges == 0 || hapi_mesh_allows(a->in->open_edges, a->shape.hull, into)) &&
         (b->in->open_edges == 0 ||
          hapi_mesh_allows(b->in->open_edges, b->shape.hull, point->normal));
}

/* The points of a pair, deepest first, that count; false: none. */
static bool find_pair(const hapi_contact *contact, uint32_t index, placed_pair *out)
{
  const hapi_near_pair *pair = &hapi_near_pairs(contact->near)[index];
  hapi_patch *patch = &out->patch;
  int count = 0;
  patch->count = 0;
  if (!hapi_pass_place_geom(contact, pair->geom_a, &out->a) ||
      !hapi_pass_place_geom(contact, pair->geom_b, &out->b)) {
    return false;
  }
  out->margin = margin_of(contact, &out->a, &out->b);
  if (!hapi_patch_find(&out->a.shape, &out->a.pose, &out->b.shape, &out->b.pose, out->margin,
                       patch)) {
    return false;
  }
  for (int i = 0; i < patch->count; ++i) {
    if (!point_is_allowed(&out->a, &out->b, &patch->points[i])) {
      continue;
    }
    if (count < i) {
      patch->points[count] = patch->points[i];
    }
    ++count;
  }
  patch->count = count;
  return count > 0;
}

static void fill_pair(const placed_pair *found, const hapi_near_pair *pair, hapi_patches *out)
{
  for (int i = 0; i < found->patch.count; ++i) {
    hapi_patch_contact *c = &hapi_patches_contacts(out)[out->contact_count++];
    fill_contact(&found->a, &found->b, &found->patch.points[i], c);
    c->key = pair->key;
    c->surface = out->surface_count;
  }
  hapi_patches_surfaces(out)[out->surface_count++] = pair->surface;
}

/* Contacts of the pairs that count; false: there is no room for all of them. */
static bool fill_pairs(hapi_contact *contact, hapi_patches *out)
{
  const uint32_t room = contact->config.capacity.contacts;
  uint64_t wanted = 0;
  out->contact_count = 0;
  out->surface_count = 0;
  for (uint32_t i = 0; i < contact->near->pair_count; ++i) {
    hapi_pass_pair *pair = &contact->pairs[i];
    placed_pair found;
    if (pair->left_out || !find_pair(contact, i, &found)) {
      pair->count = 0;
      continue;
    }
    pair->count = (uint32_t)found.patch.count;
    pair->spare = found.patch.points[0].gap - found.margin;
    wanted += pair->count;
    if (wanted <= room) {
      fill_pair(&found, &hapi_near_pairs(contact->near)[i], out);
    }
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
    hapi_pass_pair *pair = &contact->pairs[i];
    if (pair->count == 0 || pair->spare <= below) {
      continue;
    }
    bool fits = pair->spare <= above && used + pair->count <= contact->config.capacity.contacts;
    used += fits ? pair->count : 0;
    pair->left_out = !fits;
    atomic_fetch_add_explicit(&contact->left_out, !fits, memory_order_relaxed);
  }
}

/* Without the keys, which are counted through all runs of a session. */
static uint64_t hash_patches(hapi_patches *patches)
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
static void follow_tape(hapi_contact *contact, hapi_patches *out)
{
  const hapi_exchange *exchange = contact->config.exchange;
  if (hapi_tape_records(contact->tape)) {
    hapi_tape_open(contact->tape);
    hapi_cell *cell = hapi_tape_put(contact->tape, HAPI_CELL_PASS, 0);
    cell->u[HAPI_PASS_NUMBER] = out->number;
    cell->u[HAPI_PASS_POSES] = hapi_exchange_taken(exchange, HAPI_CHANNEL_POSES);
    cell->u[HAPI_PASS_NEAR] = hapi_exchange_taken(exchange, HAPI_CHANNEL_NEAR);
    cell->i[HAPI_PASS_VALID] = out->valid_from_ns;
    cell->u[HAPI_PASS_HASH] = hash_patches(out);
    hapi_tape_commit(contact->tape);
  } else if (hapi_tape_plays(contact->tape)) {
    const hapi_cell *cell = hapi_tape_get(contact->tape, HAPI_CELL_PASS, 0);
    const hapi_difference difference = {.what = HAPI_DIFFERS_PASS, .number = out->number};
    if (cell->u[HAPI_PASS_HASH] != hash_patches(out)) {
      hapi_tape_differ(contact->tape, &difference);
    }
  }
}

static void pass_make(hapi_contact *contact, int64_t valid_from_ns)
{
  place_bodies(contact);
  hapi_patches *out = hapi_exchange_patches_back(contact->config.exchange);
  for (uint32_t i = 0; i < contact->near->pair_count; ++i) {
    contact->pairs[i].left_out = false;
  }
  if (!fill_pairs(contact, out)) {
    leave_out_farthest(contact);
    (void)fill_pairs(contact, out);
  }
  hapi_tool_pass(contact, out);
  out->number = ++contact->number;
  bool found = out->contact_count + out->tool_count > 0;
  contact->lingers = found ? LINGER_PASSES : contact->lingers - (contact->lingers > 0);
  out->model_number = contact->near->model_number;
  out->valid_from_ns = valid_from_ns;
  follow_tape(contact, out);
  hapi_exchange_patches_publish(contact->config.exchange);
}

/* What was found last is taken back where there is nothing any more; points of hulls go slowly. */
bool hapi_contact_has_work(const hapi_contact *contact)
{
  const hapi_near *near = contact->near;
  return near != NULL && contact->poses != NULL &&
         (near->pair_count + near->tool_pair_count > 0 || contact->lingers > 0 ||
          near->always != 0);
}

void hapi_contact_pass(hapi_contact *contact, int64_t valid_from_ns)
{
  int64_t begin_ns = hapi_clock_now();
  bool news = hapi_contact_has_news(contact) || hapi_tape_plays(contact->tape);
  take_near(contact);
  if (!hapi_contact_has_work(contact) || (!news && contact->near->between == 0)) {
    return;
  }
  unsigned before = hapi_denormals_flush();
  pass_make(contact, valid_from_ns);
  hapi_denormals_restore(before);
  hapi_histogram_add(&contact->pass_ns, hapi_clock_now() - begin_ns);
}
