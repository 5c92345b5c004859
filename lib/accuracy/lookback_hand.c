/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "accuracy/lookback.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"
#include "base/pose.h"
#include "base/vec.h"
#include "local/pointer_friction.h"
#include "local/tool_place.h"
#include "paper/local_dynamics.h"
#include "paper/render.h"
#include "tick/tick.h"
#include "world/world.h"

/* The hands of a window: a tick of the loop in model SINGLE that nobody feels. What of it is
 * near comes as a message of physics, as in a session of that model; so hulls, friction and soft
 * fingers are the loop's own code. */

typedef struct part {
  void **array;
  size_t count;
  size_t size;
} part;

#define PARTS 12

/* Of all that a tick of model SINGLE uses. */
static void tick_list_parts(hapi_tick *t, part out[PARTS])
{
  const hapi_capacity *c = &t->capacity;
  size_t tools = (size_t)2 * c->tool_points;
  const part all[PARTS] = {
      {(void **)&t->bodies.of, c->bodies, sizeof *t->bodies.of},
      {(void **)&t->bodies.courses, c->bodies, sizeof *t->bodies.courses},
      {(void **)&t->bodies.live, c->bodies, sizeof *t->bodies.live},
      {(void **)&t->touches.of, c->contacts + tools, sizeof *t->touches.of},
      {(void **)&t->touches.kept, c->contacts, sizeof *t->touches.kept},
      {(void **)&t->touches.frictions, c->contacts, sizeof *t->touches.frictions},
      {(void **)&t->pointers.of, c->pointers, sizeof *t->pointers.of},
      {(void **)&t->touches.tool.tools, tools, sizeof *t->touches.tool.tools},
      {(void **)&t->touches.tool.old_tools, tools, sizeof *t->touches.tool.old_tools},
      {(void **)&t->touches.tool.old_contacts, tools, sizeof *t->touches.tool.old_contacts},
      {(void **)&t->touches.tool.pairs, HAPI_TOOL_PAIRS(c), sizeof *t->touches.tool.pairs},
      {(void **)&t->pointers.hulls, c->pointers, sizeof *t->pointers.hulls},
  };
  memcpy(out, all, sizeof all);
}

static bool hand_create_tick(hapi_lookback_hand *hand, const hapi_capacity *capacity)
{
  part parts[PARTS];
  bool good = true;
  hand->tick = hapi_alloc(sizeof *hand->tick);
  if (hand->tick == NULL) {
    return false;
  }
  memset(hand->tick, 0, sizeof *hand->tick);
  hand->tick->capacity = *capacity;
  hand->tick->pointers.high = capacity->pointers;
  hand->tick->touches.tool.capacity = capacity->tool_points;
  tick_list_parts(hand->tick, parts);
  for (int i = 0; i < PARTS; ++i) {
    *parts[i].array = hapi_alloc_array(parts[i].count, parts[i].size);
    good = good && *parts[i].array != NULL;
  }
  return good;
}

static bool hand_create_model(hapi_lookback_hand *hand, const hapi_capacity *c)
{
  size_t bodies = sizeof(hapi_model);
  size_t contacts = bodies + c->bodies * sizeof(hapi_model_body);
  size_t tools = contacts + (c->contacts + c->tool_points) * sizeof(hapi_model_contact);
  size_t size = tools + c->tool_points * sizeof(hapi_tool_point);
  hand->model = hapi_alloc(size);
  if (hand->model == NULL) {
    return false;
  }
  memset(hand->model, 0, size);
  hand->model->model = HAP_MODEL_SINGLE;
  hand->model->bodies_offset = (uint32_t)bodies;
  hand->model->contacts_offset = (uint32_t)contacts;
  hand->model->tools_offset = (uint32_t)tools;
  return true;
}

void hapi_lookback_hand_finish(hapi_lookback_hand *hand)
{
  part parts[PARTS];
  if (hand->tick != NULL) {
    tick_list_parts(hand->tick, parts);
    for (int i = 0; i < PARTS; ++i) {
      hapi_free(*parts[i].array);
    }
  }
  hapi_free(hand->tick);
  hapi_free(hand->model);
  hapi_free(hand->told);
  memset(hand, 0, sizeof *hand);
}

bool hapi_lookback_hand_ready(hapi_lookback_hand *hand, const hapi_capacity *all)
{
  const hapi_capacity capacity = {.bodies = HAPI_LOOKBACK_BODIES,
                                  .contacts = all->contacts,
                                  .pointers = all->pointers,
                                  .tool_points = all->tool_points};
  if (hand->ready) {
    return true;
  }
  hand->told = hapi_alloc_array(capacity.pointers, sizeof *hand->told);
  hand->ready =
      hand->told != NULL && hand_create_tick(hand, &capacity) && hand_create_model(hand, &capacity);
  if (!hand->ready) {
    hapi_lookback_hand_finish(hand);
    return false;
  }
  hapi_lookback_hand_begin(hand);
  return true;
}

void hapi_lookback_hand_begin(hapi_lookback_hand *hand)
{
  hapi_tick *t = hand->tick;
  part parts[PARTS];
  tick_list_parts(t, parts);
  for (int i = 0; i < PARTS - 1; ++i) { /* the hulls stay */
    memset(*parts[i].array, 0, parts[i].count * parts[i].size);
  }
  t->bodies.live_count = t->touches.count = t->bodies.high = 0;
  t->touches.tool.count = t->touches.tool.pair_count = 0;
  t->facts.tick = 1;
  memset(hand->told, 0, t->capacity.pointers * sizeof *hand->told);
  hand->begun = false;
}

bool hapi_lookback_hand_take_hull(hapi_lookback_hand *hand, const hapi_cycle *cycle,
                                  uint32_t pointer, uint32_t generation)
{
  HAPI_ASSERT_INDEX(pointer, hand->tick->capacity.pointers);
  const hapi_state_pointer *in = &hapi_state_pointers(cycle->state)[pointer];
  if (hand->hull_of[pointer] == 0 && in->generation == generation) {
    hand->tick->pointers.hulls[pointer] = hapi_state_hulls(cycle->state)[pointer];
    hand->hull_of[pointer] = generation;
  }
  return hand->hull_of[pointer] == generation;
}

/* ---- what is near ---- */

static void vector_blend(const double a[3], const double b[3], double share, double out[3])
{
  for (int i = 0; i < 3; ++i) {
    out[i] = a[i] + share * (b[i] - a[i]);
  }
}

static double hull_extent(const hapi_tool_hull *hull, double radius)
{
  double farthest = 0.0;
  for (uint32_t i = 0; i < hull->count; ++i) {
    farthest = fmax(farthest, hapi_v3_norm(hull->points[i]));
  }
  return farthest + radius;
}

static void hand_take_pointers(hapi_tick *t, const hapi_lookback_moment *at)
{
  for (uint32_t i = 0; i < t->capacity.pointers; ++i) {
    const hapi_path_pointer *in = &at->row[i];
    hapi_pointer *p = &t->pointers.of[i];
    if (p->generation != in->generation) {
      memset(p, 0, sizeof *p);
      p->generation = in->generation;
      p->shape.hull = in->is_tool != 0 ? &t->pointers.hulls[i] : NULL;
      p->shape.extent = p->shape.hull != NULL ? hull_extent(p->shape.hull, in->radius) : in->radius;
    }
    p->shape.radius = in->radius;
    p->surface.stiffness = in->stiffness;
    p->surface.damping = in->damping;
    p->surface.finger_radius = in->finger_radius;
    p->device.turns = in->turns != 0;
    p->device.three_dof = in->three_dof != 0;
    if (p->generation != 0) {
      /* Where the pointer was then: on the way from a row to the next one, or straight on from the
       * last. */
      const hapi_path_pointer *next = at->next != NULL ? &at->next[i] : NULL;
      p->pose = in->pose;
      p->twist = in->twist;
      if (next != NULL && next->generation == in->generation) {
        hapi_pose_blend(&in->pose, &next->pose, at->share, &p->pose);
        vector_blend(in->twist.linear, next->twist.linear, at->share, p->twist.linear);
        vector_blend(in->twist.angular, next->twist.angular, at->share, p->twist.angular);
      } else {
        hapi_pose_move(&p->pose, &p->twist, at->later_s);
      }
    }
  }
}

/* What physics knows of the pointers when it looks for what is near: those of the tick before,
 * of new ones those of now. */
static void hand_tell(hapi_lookback_hand *hand)
{
  for (uint32_t i = 0; i < hand->tick->capacity.pointers; ++i) {
    const hapi_pointer *p = &hand->tick->pointers.of[i];
    hand->told[i] = (hapi_state_pointer){.generation = p->generation,
                                         .radius = p->shape.radius,
                                         .stiffness = p->surface.stiffness,
                                         .finger_radius = p->surface.finger_radius,
                                         .pose = p->pose,
                                         .twist = p->twist,
                                         .is_tool = p->shape.hull != NULL,
                                         .extent = p->shape.extent};
  }
}

static bool hand_all_are_told(const hapi_lookback_hand *hand)
{
  for (uint32_t i = 0; i < hand->tick->capacity.pointers; ++i) {
    if (hand->told[i].generation != hand->tick->pointers.of[i].generation) {
      return false;
    }
  }
  return true;
}

/* Its place among the window's bodies; HAPI_SLOT_NONE: the static world. False: one that is not
 * among them. */
static bool geom_body(const hapi_test_set *test, dGeomID geom, uint32_t *out)
{
  dBodyID body = dGeomGetBody(geom);
  uint32_t known = hapi_bodies_find(&test->world->bodies, body);
  bool found = known != HAPI_NONE && hapi_test_has(test, known);
  *out = found ? test->places[known].member : HAPI_SLOT_NONE;
  return found || body == NULL;
}

static hapi_model_contact *model_add_contact(hapi_lookback *w, const hapi_lookback_touch *t,
                                             uint32_t body)
{
  hapi_model *m = w->hand.model;
  hapi_model_contact *out = &hapi_model_contacts(m)[m->contact_count++];
  memset(out, 0, sizeof *out);
  out->slot = (uint32_t)(t - w->touches.list);
  out->generation = t->contact_generation;
  out->body = body;
  out->pointer = t->pointer;
  out->pointer_generation = t->generation;
  out->mu = t->mu;
  return out;
}

/* A pointer whose centre is in the geom, or behind it, is asked for from where it would be if it
 * could not enter it: on the side of the last plane. */
static void touch_place(const hapi_lookback_touch *t, const hapi_state_pointer *p, double out[3])
{
  dBodyID body = dGeomGetBody(t->geom);
  double normal[3];
  double point[3];
  double apart[3];
  hapi_v3_copy(p->pose.position, out);
  if (!t->placed) {
    return;
  }
  hapi_v3_copy(t->normal_body, normal);
  hapi_v3_copy(t->point_body, point);
  if (body != NULL) {
    hapi_quat_rotate(dBodyGetQuaternion(body), t->normal_body, normal);
    hapi_pose_point(dBodyGetPosition(body), dBodyGetQuaternion(body), t->point_body, point);
  }
  hapi_v3_sub(out, point, apart);
  double height = hapi_v3_dot(apart, normal);
  if (height <= 0.0) {
    hapi_v3_madd(out, p->radius - height, normal, out);
  }
}

static void model_add_sphere(hapi_lookback *w, hapi_lookback_touch *t, uint32_t body,
                             const hapi_state_pointer *p, double period)
{
  hapi_nearest at;
  double normal[3];
  double center[3];
  touch_place(t, p, center);
  double reach = hapi_neighbors_reach(hapi_neighbors_speed(w->near, t->geom, p, center), period);
  if (!hapi_geom_nearest(w->near, t->geom, center, p->radius, reach, &at)) {
    t->placed = false;
    ++t->contact_generation;
    return;
  }
  hapi_v3_copy(at.normal, normal);
  if (body != HAPI_SLOT_NONE) {
    hapi_quat_unrotate(dBodyGetQuaternion(dGeomGetBody(t->geom)), at.normal, normal);
  }
  t->placed = true;
  hapi_v3_copy(normal, t->normal_body);
  hapi_model_contact *out = model_add_contact(w, t, body);
  hapi_v3_copy(normal, out->normal_body);
  hapi_v3_copy(at.point_b, out->point_body);
  if (body != HAPI_SLOT_NONE) {
    dBodyID of = dGeomGetBody(t->geom);
    hapi_pose_unpoint(dBodyGetPosition(of), dBodyGetQuaternion(of), at.point_b, out->point_body);
  }
  hapi_v3_copy(out->point_body, t->point_body);
}

/* The side that the reference's hand touches. */
static const hapi_tool_side *tool_side(const hapi_tick *tick, const hapi_lookback_touch *t)
{
  const hapi_tool_world *tools = &tick->touches.tool;
  for (uint32_t i = 0; i < tools->pair_count; ++i) {
    const hapi_tool_pair *pair = &tools->pairs[i];
    if (pair->key == t->key && pair->pointer == t->pointer && pair->sided) {
      return &pair->side;
    }
  }
  return NULL;
}

/* False: no memory. */
static bool look_tool(const hapi_lookback *w, const hapi_lookback_touch *t,
                      const hapi_state_pointer *p, double period, uint32_t found)
{
  const hapi_lookback_hand *hand = &w->hand;
  double spin = p->extent * hapi_v3_norm(p->twist.angular);
  double speed = hapi_neighbors_speed(w->near, t->geom, p, p->pose.position) + spin +
                 hapi_neighbors_spin(w->near, t->geom, p->extent);
  const hapi_tool_at at = {.geom = t->geom,
                           .index = t->pointer,
                           .pointer = p,
                           .hull = &hand->tick->pointers.hulls[t->pointer],
                           .key = t->key,
                           .reach = hapi_neighbors_reach(speed, period),
                           .horizon = period,
                           .side = tool_side(hand->tick, t)};
  return hapi_tool_look(w->near, &at, found);
}

/* False: there are more points than the loop has room for. */
static bool model_add_tool(hapi_lookback *w, const hapi_lookback_touch *t, uint32_t body,
                           const hapi_tool_found *found)
{
  hapi_model *m = w->hand.model;
  const hapi_found_point *points = &w->near->tools.points[found->first];
  if (m->tool_count + found->count > w->hand.tick->capacity.tool_points) {
    return false;
  }
  for (uint32_t i = 0; i < found->count; ++i) {
    hapi_tool_point *to = &hapi_model_tools(m)[m->tool_count];
    *to = points[i].tool;
    to->mu = t->mu;
    to->at.body_b = body;
    to->at.generation_b = body != HAPI_SLOT_NONE ? 1 : 0;
    model_add_contact(w, t, body)->tool = ++m->tool_count;
  }
  return true;
}

/* The pointer that touches; NULL: it does no more. */
static const hapi_pointer *touch_pointer(const hapi_lookback *w, const hapi_lookback_touch *t)
{
  const hapi_pointer *of = &w->hand.tick->pointers.of[t->pointer];
  return t->there && of->generation != 0 && t->generation == of->generation ? of : NULL;
}

/* False: something is touched that the window does not know. */
static bool model_add_touches(hapi_lookback *w, double period)
{
  uint32_t found = 0;
  w->near->tools.count = 0; /* of the cycle's points nothing is needed any more */
  for (uint32_t i = 0; i < w->touches.count; ++i) {
    hapi_lookback_touch *t = &w->touches.list[i];
    const hapi_pointer *of = touch_pointer(w, t);
    const hapi_state_pointer *p = &w->hand.told[t->pointer];
    uint32_t body;
    if (of == NULL) {
      continue;
    }
    if (!geom_body(&w->test, t->geom, &body)) {
      return false;
    }
    if (of->shape.hull == NULL) {
      model_add_sphere(w, t, body, p, period);
    } else if (!look_tool(w, t, p, period, found++)) {
      return false;
    }
  }
  hapi_tool_join(w->near, found);
  found = 0;
  for (uint32_t i = 0; i < w->touches.count; ++i) {
    const hapi_lookback_touch *t = &w->touches.list[i];
    const hapi_pointer *of = touch_pointer(w, t);
    uint32_t body;
    if (of != NULL && of->shape.hull != NULL && geom_body(&w->test, t->geom, &body) &&
        !model_add_tool(w, t, body, &w->near->tools.found[found++])) {
      return false;
    }
  }
  return true;
}

/* ---- the first tick ---- */

static void ramp_resume(hapi_ramp *ramp, bool *seen)
{
  *seen = true; /* what is deep then was so before */
  ramp->share = 1.0;
  ramp->depth = HUGE_VAL;
}

static void spring_resume(hapi_tick *t, const hapi_local_contact *c,
                          const hapi_state_spring *spring)
{
  double normal[3];
  double point[3];
  double foot[3];
  hapi_v3_copy(c->normal_now, normal);
  hapi_v3_copy(c->point_now, point);
  if (c->tool == 0) {
    const hap_pose *pose = c->body != HAPI_SLOT_NONE ? &t->bodies.of[c->body].pose : NULL;
    hapi_v3_copy(c->normal_body, normal);
    hapi_v3_copy(c->point_body, point);
    if (pose != NULL) {
      hapi_quat_rotate(pose->quat_wxyz, c->normal_body, normal);
      hapi_pose_point(pose->position, pose->quat_wxyz, c->point_body, point);
    }
  }
  const hapi_rub_place place = {&t->pointers.of[c->pointer], hapi_bodies_at(&t->bodies, c->body),
                                normal, foot};
  hapi_friction_foot(place.pointer, normal, point, foot);
  hapi_friction_resume(hapi_friction_of(&t->touches, c), t->facts.tick, c, &place,
                       spring->stretch_body, spring->turn);
}

static bool spring_is_of(const hapi_tick *t, const hapi_local_contact *c,
                         const hapi_lookback_spring *spring)
{
  return c->tool == 0 ? c->slot == spring->touch
                      : spring->in.slot == HAPI_SLOT_NONE &&
                            t->touches.tool.tools[c->tool - 1].in.at.key == spring->in.key;
}

/* The one that the contact had: of a hull's points the nearest. */
static const hapi_state_spring *hand_find_spring(const hapi_lookback *w,
                                                 const hapi_local_contact *c)
{
  const hapi_tick *t = w->hand.tick;
  const hapi_state_spring *found = NULL;
  double least = HUGE_VAL;
  for (uint32_t i = 0; i < w->springs.count; ++i) {
    double way[3];
    double far = 0.0;
    if (!spring_is_of(t, c, &w->springs.list[i])) {
      continue;
    }
    if (c->tool != 0) {
      hapi_v3_sub(w->springs.list[i].in.place, t->touches.tool.tools[c->tool - 1].in.at.core_a,
                  way);
      far = hapi_v3_norm(way);
    }
    if (far < least && (c->tool == 0 || far < t->touches.tool.tools[c->tool - 1].in.same_within)) {
      least = far;
      found = &w->springs.list[i].in;
    }
  }
  return found;
}

/* The window begins in the midst of what the loop does: nothing comes in slowly, and springs
 * along a surface are as long as they were. */
static void hand_resume(hapi_lookback *w)
{
  hapi_tick *t = w->hand.tick;
  for (uint32_t i = 0; i < t->touches.tool.pair_count; ++i) {
    ramp_resume(&t->touches.tool.pairs[i].ramp, &t->touches.tool.pairs[i].seen);
  }
  /* Says where the points of hulls are. */
  hapi_tool_place(&t->touches, &t->pointers, &t->bodies, &t->facts);
  for (uint32_t i = 0; i < t->touches.count; ++i) {
    hapi_local_contact *c = &t->touches.of[i];
    const hapi_state_spring *spring = c->feel.rubs ? hand_find_spring(w, c) : NULL;
    ramp_resume(&c->ramp, &c->seen);
    if (spring != NULL && (c->tool == 0 || t->touches.tool.tools[c->tool - 1].placed)) {
      spring_resume(t, c, spring);
    }
  }
}

/* ---- the tick ---- */

bool hapi_lookback_feel(hapi_lookback *w, uint32_t wishes, const hapi_lookback_moment *at)
{
  hapi_tick *t = w->hand.tick;
  hapi_model *m = w->hand.model;
  m->body_count = m->contact_count = m->tool_count = 0;
  m->wishes = hapi_wish_set(wishes, HAP_EFFECT_OBSERVER, HAP_EFFECT_OFF);
  ++m->number;
  m->tick = t->facts.tick;
  hand_take_pointers(t, at);
  if (!hand_all_are_told(&w->hand)) {
    hand_tell(&w->hand);
  }
  for (uint32_t i = 0; i < w->bodies.count; ++i) {
    dBodyID body = w->test.world->bodies.entries[w->bodies.list[i].known].body;
    hapi_model_body *out = &hapi_model_bodies(m)[m->body_count++];
    memset(out, 0, sizeof *out);
    out->slot = i;
    out->generation = 1;
    out->flags = dBodyIsKinematic(body) ? HAPI_BODY_DRIVEN : 0;
    hapi_pose_read(body, &out->pose);
    hapi_twist_read(body, &out->twist);
  }
  if (!model_add_touches(w, at->period)) {
    return false;
  }
  t->facts.period = at->period;
  hapi_tick_adopt(t, m, t->facts.now_ns);
  hapi_local_place(&t->bodies, &t->facts);
  for (uint32_t i = 0; i < w->bodies.count; ++i) {
    hapi_v3_set(t->bodies.of[i].account.impulse, 0.0, 0.0, 0.0);
    hapi_v3_set(t->bodies.of[i].account.angular_impulse, 0.0, 0.0, 0.0);
    t->bodies.of[i].pushed = false;
  }
  if (!w->hand.begun) {
    hand_resume(w);
    w->hand.begun = true;
  }
  hapi_render(&t->facts, &t->pointers, &t->bodies, &t->touches, &t->sample);
  ++t->facts.tick;
  hand_tell(&w->hand);
  double period = at->period;
  for (uint32_t i = 0; i < w->bodies.count; ++i) {
    hapi_local_body *from = &w->hand.tick->bodies.of[i];
    dBodyID body = w->test.world->bodies.entries[w->bodies.list[i].known].body;
    const double *force = from->account.impulse;
    const double *moment = from->account.angular_impulse;
    if (from->pushed && !dBodyIsKinematic(body)) {
      dBodyEnable(body);
      dBodyAddForce(body, force[0] / period, force[1] / period, force[2] / period);
      dBodyAddTorque(body, moment[0] / period, moment[1] / period, moment[2] / period);
    }
  }
  return true;
}

const double *hapi_lookback_felt(const hapi_lookback *w, uint32_t pointer)
{
  return w->hand.tick->pointers.of[pointer].wrench.force;
}
