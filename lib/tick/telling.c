/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tick/telling.h"

#include <math.h>
#include <string.h>

#include "base/assert.h"
#include "base/pointer_id.h"
#include "base/pose.h"
#include "base/vec.h"
#include "local/body_still.h"
#include "local/touch_place.h"

#define RELEASE_NS 5000000 /* without force: a touch is over, and not a bounce of noise */
#define STICK_NS 10000000  /* without sliding */
#define STRIKE_NS 20000000 /* longest blow */
#define STRIKE_SPEED 0.02  /* m/s, of the slowest blow that is told */
#define SLIDE_SPEED 1e-3   /* m/s, where there is no friction that would hold */

void hapi_telling_reset(hapi_telling *telling, uint32_t pointers)
{
  memset(telling->lists, 0, pointers * sizeof *telling->lists);
  memset(telling->events.rows, 0, telling->events.capacity * sizeof *telling->events.rows);
  telling->faults = telling->textures_out = 0;
  atomic_store(&telling->events.written, 0);
  atomic_store(&telling->events.read, 0);
  atomic_store(&telling->events.dropped, 0);
}

/* ---- events ---- */

static void events_drop(hapi_event_ring *ring)
{
  uint64_t dropped = atomic_load_explicit(&ring->dropped, memory_order_relaxed);
  atomic_store_explicit(&ring->dropped, dropped + 1, memory_order_relaxed);
}

static void event_put(hapi_event_ring *ring, const hap_event *event)
{
  uint64_t written = atomic_load_explicit(&ring->written, memory_order_relaxed);
  uint64_t read = atomic_load_explicit(&ring->read, memory_order_acquire);
  if (written - read >= ring->capacity) {
    events_drop(ring);
    return;
  }
  ring->rows[written % ring->capacity] = *event;
  atomic_store_explicit(&ring->written, written + 1, memory_order_release);
}

size_t hapi_events_read(hapi_event_ring *ring, hap_event *events, size_t capacity,
                        size_t size_of_event)
{
  size_t size = size_of_event < sizeof *events ? size_of_event : sizeof *events;
  uint64_t read = atomic_load_explicit(&ring->read, memory_order_relaxed);
  uint64_t written = atomic_load_explicit(&ring->written, memory_order_acquire);
  size_t count = 0;
  while (read < written && count < capacity) {
    memcpy((char *)events + count++ * size_of_event, &ring->rows[read++ % ring->capacity], size);
  }
  atomic_store_explicit(&ring->read, read, memory_order_release);
  return count;
}

/* ---- touches ---- */

/* A pointer of the tick, with what is told of it. ring NULL: events are not asked for. */
typedef struct listening {
  const hapi_tick *tick;
  const hapi_pointer *pointer;
  hapi_felt_list *list;
  hapi_event_ring *ring;
  uint32_t index;
} listening;

static void felt_say(const listening *at, const hapi_felt *felt, hap_event_kind kind, double speed,
                     double impulse)
{
  if (at->ring == NULL) {
    return;
  }
  hap_event event = {.kind = (uint32_t)kind,
                     .time_ns = at->tick->facts.now_ns,
                     .pointer.v = hapi_pointer_id_of(at->list->generation, at->index + 1),
                     .geom = felt->told.geom,
                     .body = felt->told.body,
                     .speed = speed,
                     .impulse = impulse};
  hapi_v3_copy(felt->told.point, event.point);
  hapi_v3_copy(felt->told.normal, event.normal);
  event_put(at->ring, &event);
}

/* NULL: there is no room. */
static hapi_felt *felt_of(const listening *at, const hapi_local_contact *c)
{
  hapi_felt_list *list = at->list;
  for (uint32_t i = 0; i < list->count; ++i) {
    if (list->of[i].told.geom == c->asked.geom && list->of[i].number == c->asked.number) {
      return &list->of[i];
    }
  }
  if (list->count == HAP_TOUCHES_MAX) {
    return NULL;
  }
  hapi_felt *felt = &list->of[list->count++];
  memset(felt, 0, sizeof *felt);
  felt->told.geom = c->asked.geom;
  felt->number = c->asked.number;
  return felt;
}

/* Where it pushes, and its normal, in the world. */
static void contact_spot(const hapi_tick *tick, const hapi_local_contact *c, double point[3],
                         double normal[3])
{
  const hapi_local_body *body = hapi_bodies_at(&tick->bodies, c->body);
  if (tick->facts.model == HAP_MODEL_CONTACT || c->tool != 0) {
    hapi_v3_copy(c->point_now, point);
    hapi_v3_copy(c->normal_now, normal);
  } else if (body == NULL) {
    hapi_v3_copy(c->point_body, point);
    hapi_v3_copy(c->normal_body, normal);
  } else {
    hapi_pose_point(body->pose.position, body->pose.quat_wxyz, c->point_body, point);
    hapi_quat_rotate(body->pose.quat_wxyz, c->normal_body, normal);
  }
}

/* Whether friction lets the contact slide in this tick. */
static bool contact_slips(const hapi_tick *tick, const hapi_local_contact *c)
{
  const hapi_friction *f = hapi_friction_of(&tick->touches, c);
  return f->tick + 1 == tick->facts.tick && (f->rigid ? f->slid : f->left < 1.0);
}

/* The sums are divided in felt_finish. */
static void felt_add(const hapi_tick *tick, const hapi_local_contact *c, hapi_felt *felt)
{
  double point[3];
  double normal[3];
  hap_touch *told = &felt->told;
  if (!felt->pushes) {
    felt->pushes = true;
    felt->rubs = felt->slips = false;
    felt->weight = 0.0;
    told->points = 0;
    memset(told->point, 0, sizeof told->point);
    memset(told->normal, 0, sizeof told->normal);
    memset(told->force, 0, sizeof told->force);
  }
  contact_spot(tick, c, point, normal);
  double weight = hapi_v3_norm(c->force);
  hapi_v3_madd(told->point, weight, point, told->point);
  hapi_v3_madd(told->normal, weight, normal, told->normal);
  hapi_v3_sub(told->force, c->force, told->force);
  felt->weight += weight;
  felt->slot = c->body;
  felt->rubs |= c->feel.rubs;
  felt->slips |= c->feel.rubs && contact_slips(tick, c);
  ++told->points;
}

static void point_velocity(const double position[3], const hap_twist *twist, const double point[3],
                           double out[3])
{
  double arm[3];
  hapi_v3_sub(point, position, arm);
  hapi_v3_cross(twist->angular, arm, out);
  hapi_v3_add(twist->linear, out, out);
}

/* Of the pointer at the point, as the body sees it. before: as the body was before this tick. */
static void felt_velocity(const listening *at, const hapi_felt *felt, bool before, double out[3])
{
  const hapi_pointer *p = at->pointer;
  const hapi_local_body *body = hapi_bodies_at(&at->tick->bodies, felt->slot);
  double of_body[3];
  if (p->shape.hull != NULL || p->device.turns) {
    point_velocity(p->pose.position, &p->twist, felt->told.point, out);
  } else {
    hapi_v3_copy(p->twist.linear, out);
  }
  if (body == NULL) {
    return;
  }
  hap_twist twist = body->twist;
  if (before && at->tick->facts.model == HAP_MODEL_CONTACT) {
    memcpy(&twist, body->start_twist, sizeof twist);
  }
  point_velocity(body->pose.position, &twist, felt->told.point, of_body);
  hapi_v3_sub(out, of_body, out);
}

/* The blow of a touch that has just begun is followed to its end. */
static void felt_strike(const listening *at, hapi_felt *felt, double closing)
{
  int64_t now_ns = at->tick->facts.now_ns;
  if (felt->strikes && (closing <= 0.0 || now_ns - felt->told.since_ns >= STRIKE_NS)) {
    felt->strikes = false;
    felt_say(at, felt, HAP_EVENT_IMPACT, felt->speed, felt->impulse);
  }
}

static void felt_slide(const listening *at, hapi_felt *felt)
{
  int64_t now_ns = at->tick->facts.now_ns;
  double slip = hapi_v3_norm(felt->told.slip);
  if (felt->rubs ? felt->slips : slip > SLIDE_SPEED) {
    felt->slid_ns = now_ns;
    if (felt->told.is_sliding == 0) {
      felt->told.is_sliding = 1;
      felt_say(at, felt, HAP_EVENT_SLIDE, slip, 0.0);
    }
  } else if (felt->told.is_sliding != 0 && now_ns - felt->slid_ns >= STICK_NS) {
    felt->told.is_sliding = 0;
    felt_say(at, felt, HAP_EVENT_STICK, 0.0, 0.0);
  }
}

/* A touch that pushes in this tick. */
static void felt_finish(const listening *at, hapi_felt *felt)
{
  const hapi_tick_facts *facts = &at->tick->facts;
  const hapi_local_body *body = hapi_bodies_at(&at->tick->bodies, felt->slot);
  hap_touch *told = &felt->told;
  double relative[3];
  hapi_v3_scale(1.0 / felt->weight, told->point, told->point);
  double length = hapi_v3_norm(told->normal);
  if (length > 0.0) { /* else its points push against each other */
    hapi_v3_scale(1.0 / length, told->normal, told->normal);
  }
  told->body = body != NULL ? body->given.tag : NULL;
  felt->impulse += facts->period * hapi_v3_dot(told->force, told->normal);
  bool begins = !felt->begun;
  felt->begun = true;
  felt_velocity(at, felt, begins, relative);
  double closing = -hapi_v3_dot(relative, told->normal);
  hapi_v3_madd(relative, closing, told->normal, told->slip);
  felt->pushed_ns = facts->now_ns;
  if (begins) {
    told->since_ns = facts->now_ns;
    felt->speed = hapi_max(closing, 0.0);
    felt->strikes = felt->speed >= STRIKE_SPEED;
    felt_say(at, felt, HAP_EVENT_TOUCH, felt->speed, 0.0);
  }
  felt_strike(at, felt, closing);
  felt_slide(at, felt);
}

static void felt_release(const listening *at, hapi_felt *felt)
{
  if (felt->strikes) {
    felt_say(at, felt, HAP_EVENT_IMPACT, felt->speed, felt->impulse);
  }
  felt_say(at, felt, HAP_EVENT_RELEASE, 0.0, felt->impulse);
}

static void list_follow(const listening *at)
{
  hapi_felt_list *list = at->list;
  uint32_t kept = 0;
  for (uint32_t i = 0; i < list->count; ++i) {
    hapi_felt *felt = &list->of[i];
    if (felt->pushes) {
      felt_finish(at, felt);
    } else if (at->tick->facts.now_ns - felt->pushed_ns >= RELEASE_NS) {
      felt_release(at, felt);
      continue;
    }
    list->of[kept++] = *felt;
  }
  list->count = kept;
}

static void buttons_follow(const listening *at)
{
  uint32_t changed = at->pointer->device.buttons ^ at->list->buttons;
  at->list->buttons = at->pointer->device.buttons;
  for (uint32_t i = 0; at->ring != NULL && i < 32; ++i) {
    if ((changed >> i & 1u) != 0) {
      event_put(at->ring,
                &(hap_event){.kind = HAP_EVENT_BUTTON,
                             .number = i,
                             .time_ns = at->tick->facts.now_ns,
                             .pointer.v = hapi_pointer_id_of(at->list->generation, at->index + 1),
                             .is_down = at->list->buttons >> i & 1u});
    }
  }
}

/* Of those that drive nothing the thresholds are those of hap_pointer_outputs_init. */
static bool gripper_closes(const listening *at, const hapi_axis *axis, bool closed)
{
  const hap_pointer_outputs *set = &at->tick->outputs[at->index].wanted;
  double bound = closed ? HAPI_GRIPPER_OPEN : HAPI_GRIPPER_CLOSED;
  if (at->pointer->drives) {
    bound = closed ? set->gripper_open : set->gripper_closed;
  }
  double share = (axis->at - axis->low) / (axis->high - axis->low);
  return closed ? share < bound : share <= bound;
}

static void grippers_follow(const listening *at)
{
  const hapi_axes *axes = &at->tick->axes[at->index];
  for (uint32_t i = 0; i < axes->count; ++i) {
    const hapi_axis *axis = &axes->of[i];
    bool closed = (at->list->closed >> i & 1u) != 0;
    bool closes = axis->kind == HAP_AXIS_GRIPPER && gripper_closes(at, axis, closed);
    if (closes == closed) {
      continue;
    }
    at->list->closed ^= 1u << i;
    if (at->ring != NULL) {
      event_put(at->ring,
                &(hap_event){.kind = HAP_EVENT_GRIPPER,
                             .number = i,
                             .time_ns = at->tick->facts.now_ns,
                             .pointer.v = hapi_pointer_id_of(at->list->generation, at->index + 1),
                             .speed = axis->rate,
                             .is_down = closes});
    }
  }
}

static void forces_follow(const listening *at)
{
  const hapi_own_force *own = &at->tick->own[(size_t)at->index * HAP_FORCES_MAX];
  uint32_t before = at->list->forces_out;
  at->list->forces_out = 0;
  for (uint32_t i = 0; at->pointer->own && i < HAP_FORCES_MAX; ++i) {
    if (own[i].setup.serial == 0 || own[i].out == HAP_FORCE_IN) {
      continue;
    }
    at->list->forces_out |= 1u << i;
    if (at->ring != NULL && (before >> i & 1u) == 0) {
      event_put(at->ring,
                &(hap_event){.kind = HAP_EVENT_FORCE_OUT,
                             .number = own[i].out,
                             .time_ns = at->tick->facts.now_ns,
                             .pointer.v = hapi_pointer_id_of(at->list->generation, at->index + 1),
                             .force = hapi_own_force_id(own[i].setup.serial, i)});
    }
  }
}

static void textures_follow(hapi_telling *telling, const hapi_tick *tick, hapi_event_ring *ring)
{
  uint64_t newly = tick->touches.textures.out & ~telling->textures_out;
  telling->textures_out = tick->touches.textures.out;
  for (uint32_t i = 0; ring != NULL && newly >> i != 0; ++i) {
    if ((newly >> i & 1u) != 0) {
      event_put(ring,
                &(hap_event){
                    .kind = HAP_EVENT_TEXTURE_OUT, .number = i + 1, .time_ns = tick->facts.now_ns});
    }
  }
}

static void fault_follow(hapi_telling *telling, const hapi_tick *tick, hapi_event_ring *ring)
{
  const hapi_fault_latch *latch = &tick->guard.latch;
  bool is_new = latch->fault != HAP_FAULT_NONE && latch->count != telling->faults;
  telling->faults = latch->count;
  if (is_new && ring != NULL) {
    event_put(ring,
              &(hap_event){.kind = HAP_EVENT_FAULT,
                           .number = (uint32_t)latch->fault,
                           .time_ns = tick->facts.now_ns,
                           .pointer.v = hapi_pointer_id_of(latch->generation, latch->pointer)});
  }
}

static void grab_say(const listening *at, hap_event_kind kind, uint32_t number)
{
  if (at->ring == NULL) {
    return;
  }
  hap_event event = {.kind = (uint32_t)kind,
                     .number = number,
                     .time_ns = at->tick->facts.now_ns,
                     .pointer.v = hapi_pointer_id_of(at->list->generation, at->index + 1),
                     .body = at->list->held};
  hapi_v3_copy(at->pointer->pose.position, event.point);
  event_put(at->ring, &event);
}

/* Before the list is of another pointer. */
static void grab_follow(const listening *at)
{
  const hapi_grab *grab = &at->pointer->grab;
  hapi_felt_list *list = at->list;
  bool here = at->pointer->generation != 0;
  uint32_t holding = here && hapi_grab_acts(grab) ? grab->holds : 0;
  if (holding == list->holding) {
    return;
  }
  if (list->holding != 0) {
    grab_say(at, HAP_EVENT_LET_GO, here ? grab->ended : (uint32_t)HAP_GRAB_GONE);
  }
  list->holding = holding;
  list->held = grab->tag;
  if (holding != 0) {
    grab_say(at, HAP_EVENT_HOLD, 0);
  }
}

/* The pointer has left: what it touched is let go. */
static void list_leave(const listening *at)
{
  for (uint32_t i = 0; i < at->list->count; ++i) {
    felt_release(at, &at->list->of[i]);
  }
  at->list->count = 0;
  at->list->buttons = at->list->closed = 0;
  at->list->forces_out = 0;
}

/* False for NaN and infinity, too, which the guard makes a fault of. */
static bool contact_pushes(const hapi_local_contact *c)
{
  double force2 = hapi_v3_dot(c->force, c->force);
  return force2 > 0.0 && force2 < HUGE_VAL;
}

static void lists_gather(hapi_telling *telling, const hapi_tick *tick, hapi_event_ring *ring)
{
  const hapi_touches *touches = &tick->touches;
  for (uint32_t i = 0; touches->pushing > 0 && i < touches->count; ++i) {
    const hapi_local_contact *c = &touches->of[i];
    const listening at = {.tick = tick,
                          .pointer = &tick->pointers.of[c->pointer],
                          .list = &telling->lists[c->pointer],
                          .ring = ring};
    if (!contact_pushes(c) || at.pointer->generation != at.list->generation) {
      continue;
    }
    hapi_felt *felt = felt_of(&at, c);
    if (felt != NULL) {
      felt_add(tick, c, felt);
    } else if (ring != NULL) {
      events_drop(ring);
    }
  }
}

void hapi_telling_follow(hapi_telling *telling, const hapi_tick *tick, bool events)
{
  hapi_event_ring *ring = events ? &telling->events : NULL;
  for (uint32_t i = 0; i < tick->pointers.high; ++i) {
    listening at = {tick, &tick->pointers.of[i], &telling->lists[i], ring, i};
    if (at.pointer->generation == 0) {
      grab_follow(&at);
    }
    uint32_t generation = at.pointer->handle.foreign ? 0 : at.pointer->generation;
    if (at.list->generation != generation) {
      list_leave(&at);
      at.list->generation = generation;
    }
    for (uint32_t k = 0; k < at.list->count; ++k) {
      at.list->of[k].pushes = false;
    }
  }
  lists_gather(telling, tick, ring);
  for (uint32_t i = 0; i < tick->pointers.high; ++i) {
    listening at = {tick, &tick->pointers.of[i], &telling->lists[i], ring, i};
    if (at.list->generation != 0) {
      list_follow(&at);
      buttons_follow(&at);
      if (at.pointer->has_axes) {
        grippers_follow(&at);
      }
      forces_follow(&at);
      grab_follow(&at);
    }
  }
  textures_follow(telling, tick, ring);
  fault_follow(telling, tick, ring);
}

uint32_t hapi_telling_touches(const hapi_telling *telling, uint32_t pointer, hap_touch *out)
{
  const hapi_felt_list *list = &telling->lists[pointer];
  uint32_t count = 0;
  for (uint32_t i = 0; i < list->count; ++i) {
    if (list->of[i].pushes) {
      out[count++] = list->of[i].told;
    }
  }
  return count;
}

uint32_t hapi_telling_point(const hapi_telling *telling, uint32_t pointer, const hap_touch **out)
{
  const hapi_felt_list *list = &telling->lists[pointer];
  uint32_t count = 0;
  for (uint32_t i = 0; i < list->count; ++i) {
    if (list->of[i].pushes) {
      out[count++] = &list->of[i].told;
    }
  }
  return count;
}

/* ---- contacts of bodies ---- */

static hapi_tag tag_of(const hapi_tick *tick, uint32_t slot)
{
  const hapi_local_body *body = hapi_bodies_at(&tick->bodies, slot);
  return body != NULL ? body->given.tag : NULL;
}

/* rotation: room for the body's. */
static hapi_touch_frame frame_now(const hapi_tick *tick, uint32_t slot, double rotation[9])
{
  const hapi_local_body *body = hapi_bodies_at(&tick->bodies, slot);
  if (body == NULL) {
    return (hapi_touch_frame){NULL, NULL};
  }
  hapi_quat_to_matrix(body->pose.quat_wxyz, rotation); /* it has moved in this tick */
  return (hapi_touch_frame){&body->pose, rotation};
}

/* The points of two geoms; the sums are divided in pair_finish. */
typedef struct pressing_pair {
  hap_body_contact told;
  double weight; /* N */
} pressing_pair;

static void pair_begin(const hapi_tick *tick, const hapi_patch_contact *in, pressing_pair *out)
{
  const hapi_pair_tags *geoms = &hapi_patches_pairs(tick->contacts.patches)[in->surface];
  *out = (pressing_pair){.told = {.geom_a = geoms->geom_a,
                                  .geom_b = geoms->geom_b,
                                  .body_a = tag_of(tick, in->body_a),
                                  .body_b = tag_of(tick, in->body_b)}};
}

/* force: on a. */
static void pair_add(const hapi_tick *tick, const hapi_patch_contact *in, const double force[3],
                     pressing_pair *io)
{
  double rotation_a[9];
  double rotation_b[9];
  const hapi_touch_frame a = frame_now(tick, in->body_a, rotation_a);
  const hapi_touch_frame b = frame_now(tick, in->body_b, rotation_b);
  hapi_touch_spot spot;
  double weight = hapi_v3_norm(force);
  if (weight > 0.0 && hapi_touch_place(in, &a, &b, &spot)) {
    hapi_v3_madd(io->told.point, weight, spot.point, io->told.point);
    hapi_v3_madd(io->told.normal, weight, spot.normal, io->told.normal);
    hapi_v3_add(io->told.force, force, io->told.force);
    io->weight += weight;
    ++io->told.points;
  }
}

/* False: no point of it presses. */
static bool pair_finish(const pressing_pair *pair, hap_body_contact *out)
{
  if (pair->told.points == 0) {
    return false;
  }
  *out = pair->told;
  hapi_v3_scale(1.0 / pair->weight, out->point, out->point);
  double length = hapi_v3_norm(out->normal);
  if (length > 0.0) {
    hapi_v3_scale(1.0 / length, out->normal, out->normal);
  }
  return true;
}

/* N, on the first body of the contact of that index: of its rows, which begin at *io_row or behind
 * it, or while it is still of those that it had. False: it has none. */
static bool contact_force(const hapi_tick *tick, uint32_t index, uint32_t *io_row, double out[3])
{
  const hapi_solver *solver = &tick->rows.solver;
  const hapi_row_source *sources = tick->rows.sources;
  const hapi_contact_memory *memory = &tick->contacts.memory[index];
  double per_s = 1.0 / tick->facts.period;
  uint32_t i = *io_row;
  while (i < solver->row_count && (sources[i].pointer || sources[i].joint)) {
    ++i;
  }
  *io_row = i;
  hapi_v3_set(out, 0.0, 0.0, 0.0);
  if (i < solver->row_count && sources[i].contact == index) {
    for (; i < solver->row_count && sources[i].contact == index; ++i) {
      double impulse = memory->impulse[sources[i].part];
      hapi_v3_madd(out, per_s * impulse, solver->rows[i].ja, out);
    }
    *io_row = i;
    return true;
  }
  if (memory->kept.what != HAPI_KEPT_ROWS ||
      !hapi_contact_is_still(&memory->kept, hapi_bodies_at(&tick->bodies, memory->kept.body_a),
                             hapi_bodies_at(&tick->bodies, memory->kept.body_b))) {
    return false;
  }
  hapi_v3_scale(per_s, memory->held, out);
  return true;
}

/* The rows of contacts are in the order of these, and the contacts of a pair follow each other. */
uint32_t hapi_telling_contacts(const hapi_tick *tick, hap_body_contact *out, uint32_t capacity)
{
  const hapi_patches *patches = tick->contacts.patches;
  pressing_pair pair = {.weight = 0.0};
  uint32_t surface = HAPI_SLOT_NONE;
  uint32_t count = 0;
  uint32_t row = 0;
  if (patches == NULL || tick->facts.model != HAP_MODEL_CONTACT) {
    return 0;
  }
  for (uint32_t i = 0; i < patches->contact_count && count < capacity; ++i) {
    const hapi_patch_contact *in = &hapi_patches_contacts(tick->contacts.patches)[i];
    double force[3];
    if (!contact_force(tick, i, &row, force)) {
      continue;
    }
    if (in->surface != surface) {
      count += pair_finish(&pair, &out[count]);
      pair_begin(tick, in, &pair);
      surface = in->surface;
    }
    pair_add(tick, in, force, &pair);
  }
  return count < capacity ? count + pair_finish(&pair, &out[count]) : count;
}
