/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>

#include "base/alloc.h"
#include "base/vec.h"
#include "sync/mesh_filter.h"
#include "wire/block.h"
#include "wire/world.h"

static hapi_model *model_block(const hapi_capacity *c)
{
  hapi_model head = {0};
  size_t size = sizeof head;
  head.bodies_offset = hapi_wire_block_array(&size, c->bodies, sizeof(hapi_model_body));
  head.contacts_offset = hapi_wire_block_array(&size, c->contacts, sizeof(hapi_model_contact));
  head.joints_offset = hapi_wire_block_array(&size, c->joints, sizeof(hapi_model_joint));
  head.courses_offset = hapi_wire_block_array(&size, c->bodies, sizeof(hapi_model_course));
  head.triangles_offset = hapi_wire_block_array(&size, c->triangles, sizeof(hapi_triangle));
  head.feels_offset = hapi_wire_block_array(&size, c->feels, sizeof(hapi_model_feel));
  head.hands_offset = hapi_wire_block_array(&size, c->pointers, sizeof(hapi_model_hand));
  hapi_model *model = hapi_alloc(size);
  if (model != NULL) {
    *model = head;
  }
  return model;
}

static hapi_near *near_block(const hapi_capacity *c)
{
  hapi_near head = {0};
  size_t size = sizeof head;
  head.bodies_offset = hapi_wire_block_array(&size, c->bodies, sizeof(hapi_near_body));
  head.geoms_offset = hapi_wire_block_array(&size, c->geoms, sizeof(hapi_near_geom));
  head.pairs_offset = hapi_wire_block_array(&size, c->pairs, sizeof(hapi_near_pair));
  head.points_offset = hapi_wire_block_array(&size, c->hull_points, sizeof(double[3]));
  head.tools_offset = hapi_wire_block_array(&size, c->pointers, sizeof(hapi_near_tool));
  head.tool_pairs_offset = hapi_wire_block_array(&size, c->contacts, sizeof(hapi_near_tool_pair));
  hapi_near *near = hapi_alloc(size);
  if (near != NULL) {
    *near = head;
  }
  return near;
}

bool hapi_wire_world_in_create(hapi_wire_world_in *world, const hapi_wire_shape *shape,
                               const hapi_capacity *capacity)
{
  uint32_t slots = capacity->joints > capacity->contacts ? capacity->joints : capacity->contacts;
  world->shape = shape;
  world->capacity = *capacity;
  world->model = model_block(capacity);
  world->near = near_block(capacity);
  world->bodies = hapi_alloc_array(capacity->bodies, sizeof *world->bodies);
  world->seen = hapi_alloc_array(slots, sizeof *world->seen);
  return world->model != NULL && world->near != NULL && world->bodies != NULL &&
         world->seen != NULL;
}

void hapi_wire_world_in_finish(hapi_wire_world_in *world)
{
  hapi_free(world->model);
  hapi_free(world->near);
  hapi_free(world->bodies);
  hapi_free(world->seen);
  memset(world, 0, sizeof *world);
}

/* ---- cells to structs ---- */

typedef struct accepting {
  hapi_wire_world_in *world;
  const hapi_wire_frame *frame;
} accepting;

#define NO_INDEX HAPI_WIRE_NOWHERE

static uint32_t index_of(const void *of, hapi_wire_kind kind, uint64_t cell)
{
  const accepting *a = of;
  return cell != 0 && cell <= a->world->shape->labels[kind]
             ? hapi_wire_place(a->frame, kind, (uint32_t)(cell - 1))
             : NO_INDEX;
}

static const uint64_t *cells_of(const accepting *a, hapi_wire_kind kind, uint32_t place)
{
  return hapi_wire_cells_at(a->frame, a->world->shape, kind, place);
}

static void world_unpack(const accepting *a, hapi_wire_kind kind, uint32_t place, void *out)
{
  hapi_wire_unpack(kind, cells_of(a, kind, place), index_of, a, out);
}

/* ---- whether they can be ---- */

static bool is_unit(const double *v, int n)
{
  double sum = 0.0;
  for (int i = 0; i < n; ++i) {
    sum += v[i] * v[i];
  }
  return fabs(sum - 1.0) <= 1e-6;
}

static bool shape_is_sound(const hapi_shape *shape)
{
  return (uint32_t)shape->kind <= HAPI_SHAPE_HULL && shape->radius >= 0.0 &&
         shape->half[0] >= 0.0 && shape->half[1] >= 0.0 && shape->half[2] >= 0.0 &&
         shape->rounding >= 0.0;
}

static const char *body_accept(const accepting *a, uint32_t place)
{
  hapi_model_body *body = &hapi_model_bodies(a->world->model)[place];
  world_unpack(a, HAPI_WIRE_BODY, place, body);
  body->course = 0;
  body->tag = body->tag != NULL ? (hapi_tag)(uintptr_t)body->birth : NULL;
  memset(body->response, 0, sizeof body->response);
  if (body->slot >= a->world->capacity.bodies || a->world->bodies[body->slot] != 0) {
    return "a body's slot is out of range, or two have it";
  }
  bool moves = (body->flags & HAPI_BODY_DRIVEN) == 0;
  if (body->generation == 0 || body->held_mass < 0.0 || (moves && !(body->mass > 0.0))) {
    return "a body's mass is not above 0, or its generation is 0";
  }
  for (int i = 0; moves && i < 9; i += 4) {
    if (!(body->inertia[i] > 0.0) || !(body->inverse_inertia[i] > 0.0)) {
      return "a body's inertia is not above 0";
    }
  }
  if (!(body->linear_keep >= 0.0 && body->linear_keep <= 1.0 && body->angular_keep >= 0.0 &&
        body->angular_keep <= 1.0)) {
    return "a body's damping is out of range";
  }
  a->world->bodies[body->slot] = place + 1;
  return NULL;
}

static const char *bodies_accept(const accepting *a)
{
  hapi_model *model = a->world->model;
  const char *bad = NULL;
  memset(a->world->bodies, 0, a->world->capacity.bodies * sizeof *a->world->bodies);
  for (uint32_t i = 0; i < model->body_count && bad == NULL; ++i) {
    bad = body_accept(a, i);
  }
  for (uint32_t i = 0; i < a->frame->counts[HAPI_WIRE_RESPONSE] && bad == NULL; ++i) {
    uint32_t of = index_of(a, HAPI_WIRE_BODY, cells_of(a, HAPI_WIRE_RESPONSE, i)[0]);
    bad = of == NO_INDEX ? "the response of a body that is not there" : NULL;
    if (bad == NULL) {
      world_unpack(a, HAPI_WIRE_RESPONSE, i, &hapi_model_bodies(model)[of]);
    }
  }
  for (uint32_t i = 0; i < model->course_count && bad == NULL; ++i) {
    uint32_t of = index_of(a, HAPI_WIRE_BODY, cells_of(a, HAPI_WIRE_COURSE, i)[0]);
    bad = of == NO_INDEX ? "the course of a body that is not there" : NULL;
    if (bad == NULL) {
      world_unpack(a, HAPI_WIRE_COURSE, i, &hapi_model_courses(model)[i]);
      hapi_model_bodies(model)[of].course = i + 1;
    }
  }
  return bad;
}

static bool body_is_there(const accepting *a, uint32_t slot)
{
  return slot == HAPI_SLOT_NONE ||
         (slot < a->world->capacity.bodies && a->world->bodies[slot] != 0);
}

/* The client's own, or one of the hands of others. */
static bool pointer_is_there(const accepting *a, uint32_t pointer)
{
  return pointer < 2 * a->world->capacity.pointers;
}

static const char *contact_accept(const accepting *a, uint32_t place)
{
  hapi_model_contact *c = &hapi_model_contacts(a->world->model)[place];
  world_unpack(a, HAPI_WIRE_CONTACT, place, c);
  c->tool = 0;
  c->told.first = c->told.count == 0 ? 0 : c->told.first;
  if (c->slot >= a->world->capacity.contacts || a->world->seen[c->slot] != 0 ||
      !pointer_is_there(a, c->pointer) || !body_is_there(a, c->body)) {
    return "a contact's slot, pointer or body is not there, or two have one slot";
  }
  if (c->told.first > a->world->model->triangle_count ||
      c->told.count > a->world->model->triangle_count - c->told.first) {
    return "a contact's triangles are not there";
  }
  if (!shape_is_sound(&c->shape) ||
      (c->has_shape != 0 && c->told.count == 0 && !is_unit(c->shape_pose.quat_wxyz, 4))) {
    return "a contact's shape cannot be";
  }
  a->world->seen[c->slot] = 1;
  return NULL;
}

static const char *joint_accept(const accepting *a, uint32_t place)
{
  hapi_model_joint *j = &hapi_model_joints(a->world->model)[place];
  world_unpack(a, HAPI_WIRE_JOINT, place, j);
  memset(&j->measured, 0, sizeof j->measured);
  if (j->slot >= a->world->capacity.joints || a->world->seen[j->slot] != 0 ||
      (uint32_t)j->kind > HAPI_JOINT_MEASURED) {
    return "a joint's slot or kind is out of range, or two have one slot";
  }
  if (j->body_a == HAPI_SLOT_NONE || !body_is_there(a, j->body_a) || !body_is_there(a, j->body_b)) {
    return "a joint's body is not there";
  }
  a->world->seen[j->slot] = 1;
  return NULL;
}

static const char *measured_accept(const accepting *a, uint32_t place)
{
  uint32_t of = index_of(a, HAPI_WIRE_JOINT, cells_of(a, HAPI_WIRE_MEASURED, place)[0]);
  if (of == NO_INDEX) {
    return "the measurement of a joint that is not there";
  }
  hapi_measured_joint *m = &hapi_model_joints(a->world->model)[of].measured;
  world_unpack(a, HAPI_WIRE_MEASURED, place, m);
  bool good = m->row_count <= HAPI_MEASURED_ROWS && m->carrier <= HAPI_CARRIER_SECOND;
  for (int i = 0; i < HAPI_JOINT_LIMITS; ++i) {
    good = good && m->axes[i].carrier <= HAPI_CARRIER_WORLD;
  }
  return good ? NULL : "a joint's measurement is out of range";
}

static const char *head_accept(const accepting *a)
{
  hapi_model *m = a->world->model;
  if (a->frame->counts[HAPI_WIRE_MODEL] != 1 || a->frame->counts[HAPI_WIRE_NEAR] != 1) {
    return "it has no head";
  }
  world_unpack(a, HAPI_WIRE_MODEL, 0, m);
  world_unpack(a, HAPI_WIRE_NEAR, 0, a->world->near);
  bool good = m->model == HAP_MODEL_CONTACT && (uint32_t)m->impulse_pose <= HAP_IMPULSE_HELD &&
              m->number != 0 && m->period_s > 0.0 && m->time_scale >= 0.0 && m->blend_s >= 0.0 &&
              m->watch_count <= HAP_TRACE_BODIES_MAX && a->world->near->contact_hz > 0.0;
  for (uint32_t i = 0; i < HAP_TRACE_BODIES_MAX && good; ++i) {
    good = i >= m->watch_count || m->watch_slot[i] == HAPI_SLOT_NONE ||
           m->watch_slot[i] < a->world->capacity.bodies;
  }
  return good ? NULL : "its head is out of range";
}

static void counts_take(const accepting *a)
{
  const uint32_t *counts = a->frame->counts;
  hapi_model *model = a->world->model;
  hapi_near *near = a->world->near;
  model->body_count = counts[HAPI_WIRE_BODY];
  model->contact_count = counts[HAPI_WIRE_CONTACT];
  model->joint_count = counts[HAPI_WIRE_JOINT];
  model->course_count = counts[HAPI_WIRE_COURSE];
  model->triangle_count = counts[HAPI_WIRE_TRIANGLE];
  model->feel_count = counts[HAPI_WIRE_FEEL];
  model->hand_count = counts[HAPI_WIRE_HAND];
  model->tool_count = model->cross_count = 0;
  near->body_count = counts[HAPI_WIRE_PLACED];
  near->geom_count = counts[HAPI_WIRE_GEOM];
  near->pair_count = counts[HAPI_WIRE_PAIR];
  near->point_count = counts[HAPI_WIRE_VERTEX];
  near->tool_count = counts[HAPI_WIRE_TOOL];
  near->tool_pair_count = counts[HAPI_WIRE_TOOL_PAIR];
  near->said_count = 0;
}

static void triangles_take(const accepting *a)
{
  for (uint32_t i = 0; i < a->world->model->triangle_count; ++i) {
    hapi_triangle *out = &hapi_model_triangles(a->world->model)[i];
    double corners[9];
    world_unpack(a, HAPI_WIRE_TRIANGLE, i, out);
    memcpy(corners, out->corners, sizeof corners);
    hapi_triangle_set(corners, out);
  }
}

static const char *feel_accept(const accepting *a, uint32_t place)
{
  hapi_model_feel *f = &hapi_model_feels(a->world->model)[place];
  memset(f, 0, sizeof *f);
  world_unpack(a, HAPI_WIRE_FEEL, place, f);
  return !pointer_is_there(a, f->pointer) || (f->feel.more & HAPI_FEEL_TEXTURE) != 0
             ? "how a pointer feels a geom is out of range"
             : NULL;
}

static const char *hand_accept(const accepting *a, uint32_t place)
{
  hapi_model_hand *h = &hapi_model_hands(a->world->model)[place];
  world_unpack(a, HAPI_WIRE_HAND, place, h);
  bool good = h->number < a->world->capacity.pointers && h->generation != 0 && h->radius >= 0.0 &&
              h->stiffness > 0.0 && h->damping >= 0.0 && h->friction >= 0.0 &&
              h->finger_radius >= 0.0 && h->hull.count <= HAPI_TOOL_POINTS_MAX;
  for (uint32_t i = 0; i < place && good; ++i) {
    good = hapi_model_hands(a->world->model)[i].number != h->number;
  }
  return good ? NULL : "the hand of another client is out of range, or two have one number";
}

static const char *model_accept(const accepting *a)
{
  const hapi_wire_world_in *w = a->world;
  const char *bad = head_accept(a);
  counts_take(a);
  triangles_take(a);
  bad = bad == NULL ? bodies_accept(a) : bad;
  memset(w->seen, 0, w->capacity.contacts);
  for (uint32_t i = 0; i < w->model->contact_count && bad == NULL; ++i) {
    bad = contact_accept(a, i);
  }
  memset(w->seen, 0, w->capacity.joints);
  for (uint32_t i = 0; i < w->model->joint_count && bad == NULL; ++i) {
    bad = joint_accept(a, i);
  }
  for (uint32_t i = 0; i < a->frame->counts[HAPI_WIRE_MEASURED] && bad == NULL; ++i) {
    bad = measured_accept(a, i);
  }
  for (uint32_t i = 0; i < w->model->feel_count && bad == NULL; ++i) {
    bad = feel_accept(a, i);
  }
  for (uint32_t i = 0; i < w->model->hand_count && bad == NULL; ++i) {
    bad = hand_accept(a, i);
  }
  return bad;
}

/* ---- the near message ---- */

static const char *placed_accept(const accepting *a, uint32_t place)
{
  hapi_near_body *body = &hapi_near_bodies(a->world->near)[place];
  world_unpack(a, HAPI_WIRE_PLACED, place, body);
  uint64_t same = cells_of(a, HAPI_WIRE_PLACED, place)[0];
  if (body->slot >= a->world->capacity.bodies || same > 1) {
    return "a body's slot is out of range";
  }
  uint32_t index = a->world->bodies[body->slot];
  if (same == 1) {
    const hapi_model_body *of = index != 0 ? &hapi_model_bodies(a->world->model)[index - 1] : NULL;
    if (of == NULL || of->generation != body->generation) {
      return "a body is placed as one that is not there";
    }
    body->pose = of->pose;
    body->twist = of->twist;
  }
  return is_unit(body->pose.quat_wxyz, 4) ? NULL : "a body's orientation is no unit quaternion";
}

static const char *geom_accept(const accepting *a, uint32_t place)
{
  hapi_near_geom *geom = &hapi_near_geoms(a->world->near)[place];
  world_unpack(a, HAPI_WIRE_GEOM, place, geom);
  geom->shape.hull = NULL;
  uint32_t points = a->world->near->point_count;
  bool hull = geom->shape.kind == HAPI_SHAPE_HULL;
  geom->hull_first = hull ? geom->hull_first : 0;
  if (geom->body != HAPI_SLOT_NONE && geom->body >= a->world->capacity.bodies) {
    return "a geom's body is out of range";
  }
  if (!shape_is_sound(&geom->shape) || !(geom->extent >= 0.0) ||
      !is_unit(geom->pose.quat_wxyz, 4)) {
    return "a geom's shape cannot be";
  }
  if (hull && (geom->shape.hull_count == 0 || geom->hull_first > points ||
               geom->shape.hull_count > points - geom->hull_first)) {
    return "a geom's points are not there";
  }
  if (geom->open_edges != 0 && !(hull && geom->shape.hull_count == 3)) {
    return "a geom has edges of a triangle and is none";
  }
  if ((geom->open_edges & ~HAPI_TRIANGLE_BITS) != 0) {
    return "a triangle has edges that cannot be";
  }
  return NULL;
}

static const char *pair_accept(const accepting *a, uint32_t place)
{
  hapi_near *near = a->world->near;
  hapi_near_pair *pair = &hapi_near_pairs(near)[place];
  world_unpack(a, HAPI_WIRE_PAIR, place, pair);
  return pair->geom_a < near->geom_count && pair->geom_b < near->geom_count
             ? NULL
             : "a geom of a pair is not there";
}

static const char *tool_accept(const accepting *a, uint32_t place)
{
  hapi_near_tool *tool = &hapi_near_tools(a->world->near)[place];
  world_unpack(a, HAPI_WIRE_TOOL, place, tool);
  return pointer_is_there(a, tool->pointer) && tool->hull.count > 0 &&
                 tool->hull.count <= HAPI_TOOL_POINTS_MAX && tool->radius >= 0.0 &&
                 tool->extent >= 0.0
             ? NULL
             : "a tool is out of range";
}

static const char *tool_pair_accept(const accepting *a, uint32_t place)
{
  hapi_near *near = a->world->near;
  hapi_near_tool_pair *pair = &hapi_near_tool_pairs(near)[place];
  world_unpack(a, HAPI_WIRE_TOOL_PAIR, place, pair);
  return pair->tool < near->tool_count && pair->geom < near->geom_count
             ? NULL
             : "a tool or geom of a pair is not there";
}

static const char *near_accept(const accepting *a)
{
  hapi_near *near = a->world->near;
  const char *bad = NULL;
  for (uint32_t i = 0; i < near->body_count && bad == NULL; ++i) {
    bad = placed_accept(a, i);
  }
  for (uint32_t i = 0; i < near->point_count; ++i) {
    world_unpack(a, HAPI_WIRE_VERTEX, i, hapi_near_points(near) + (size_t)3 * i);
  }
  for (uint32_t i = 0; i < near->geom_count && bad == NULL; ++i) {
    bad = geom_accept(a, i);
  }
  for (uint32_t i = 0; i < near->pair_count && bad == NULL; ++i) {
    bad = pair_accept(a, i);
  }
  for (uint32_t i = 0; i < near->tool_count && bad == NULL; ++i) {
    bad = tool_accept(a, i);
  }
  for (uint32_t i = 0; i < near->tool_pair_count && bad == NULL; ++i) {
    bad = tool_pair_accept(a, i);
  }
  return bad;
}

const char *hapi_wire_world_accept(void *of, const hapi_wire_frame *frame)
{
  hapi_wire_world_in *world = of;
  const accepting a = {world, frame};
  const char *bad = model_accept(&a);
  bad = bad == NULL ? near_accept(&a) : bad;
  world->fresh = bad == NULL; /* what was there before was given, or is overwritten */
  return bad;
}

/* ---- to whom it is for ---- */

static void model_give(hapi_model *from, hapi_model *out)
{
  hapi_model head = *from;
  head.bodies_offset = out->bodies_offset;
  head.contacts_offset = out->contacts_offset;
  head.joints_offset = out->joints_offset;
  head.tools_offset = out->tools_offset;
  head.crosses_offset = out->crosses_offset;
  head.courses_offset = out->courses_offset;
  head.triangles_offset = out->triangles_offset;
  head.feels_offset = out->feels_offset;
  head.hands_offset = out->hands_offset;
  *out = head;
#define GIVE(array, count) \
  hapi_wire_block_copy(array(out), array(from), from->count, sizeof *array(out))
  GIVE(hapi_model_bodies, body_count);
  GIVE(hapi_model_contacts, contact_count);
  GIVE(hapi_model_joints, joint_count);
  GIVE(hapi_model_courses, course_count);
  GIVE(hapi_model_triangles, triangle_count);
  GIVE(hapi_model_feels, feel_count);
  GIVE(hapi_model_hands, hand_count);
}

static void near_give(hapi_near *from, hapi_near *out)
{
  hapi_near head = *from;
  head.bodies_offset = out->bodies_offset;
  head.geoms_offset = out->geoms_offset;
  head.pairs_offset = out->pairs_offset;
  head.points_offset = out->points_offset;
  head.tools_offset = out->tools_offset;
  head.tool_pairs_offset = out->tool_pairs_offset;
  head.saids_offset = out->saids_offset;
  *out = head;
  GIVE(hapi_near_bodies, body_count);
  GIVE(hapi_near_geoms, geom_count);
  GIVE(hapi_near_pairs, pair_count);
  hapi_wire_block_copy(hapi_near_points(out), hapi_near_points(from), from->point_count,
                       sizeof(double[3]));
  GIVE(hapi_near_tools, tool_count);
  GIVE(hapi_near_tool_pairs, tool_pair_count);
}

bool hapi_wire_world_give(hapi_wire_world_in *world, hapi_model *out_model, hapi_near *out_near)
{
  if (!world->fresh) {
    return false;
  }
  world->fresh = false;
  model_give(world->model, out_model);
  near_give(world->near, out_near);
  return true;
}
