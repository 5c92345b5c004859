/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "accuracy/lookback.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/vec.h"
#include "physics/physics_internal.h"

/* The life of a window: what it keeps, what is noted while it is open, what comes out. */

#define WINDOW_S 0.25
#define WINDOW_STEPS 4.0 /* of physics, at least */
#define FIRST_STEPS \
  2.0 /* of the first one, so that there is a figure soon; the next are twice as long each */
#define MEMORY_S 10.0   /* older windows fade from the figures */
#define CHAIN_S 10.0    /* for so long a reference goes on from window to window */
#define NEAR_M 0.5      /* from a pointer, that may take part */
#define BODIES_MAX 128u /* nearer ones first */
#define REACHES 18      /* 0.5 m to 1 mm */
#define DEAR 2.0        /* times the budget, for one step */

static bool asked_for(const hapi_physics *physics)
{
  return physics->config.lookback_share > 0.0 && physics->cycle.model != HAP_MODEL_SINGLE;
}

void hapi_lookback_reset(hapi_physics *physics)
{
  hapi_lookback *w = &physics->lookback;
  w->phase = HAPI_LOOKBACK_IDLE;
  w->end_ns = 0;
  w->touch_count = 0;
  w->lean = false;
  w->right2_sum = w->wrong2_sum = 0.0;
  w->seconds = 0.0;
}

void hapi_lookback_finish(hapi_lookback *w)
{
  hapi_free(w->bodies);
  hapi_free(w->states);
  hapi_free(w->pairs);
  hapi_free(w->touches);
  hapi_free(w->springs);
  hapi_free(w->ended);
  hapi_free(w->ends);
  hapi_lookback_hand_finish(&w->hand);
  hapi_test_finish(&w->test);
  hapi_free(w->times_ns);
  hapi_free(w->path);
  hapi_index_finish(&w->pair_of);
  hapi_index_finish(&w->geoms);
  memset(w, 0, sizeof *w);
}

/* ---- what is near ---- */

static bool has(const hapi_lookback *w, uint32_t known)
{
  for (uint32_t i = 0; i < w->body_count; ++i) {
    if (w->bodies[i].known == known) {
      return true;
    }
  }
  return false;
}

static uint64_t key_of(dGeomID a, dGeomID b)
{
  uint64_t x = hapi_index_address(a);
  uint64_t y = hapi_index_address(b);
  return hapi_index_mix(x < y ? x : y) ^ (x < y ? y : x);
}

void hapi_lookback_ask(hapi_physics *physics, dGeomID a, dGeomID b,
                       const dSurfaceParameters *surface)
{
  hapi_lookback *w = &physics->lookback;
  if (w->phase != HAPI_LOOKBACK_OPEN || w->spoilt) {
    return;
  }
  uint32_t body_a = hapi_bodies_find(&physics->world.bodies, dGeomGetBody(a));
  uint32_t body_b = hapi_bodies_find(&physics->world.bodies, dGeomGetBody(b));
  if (!(body_a != HAPI_NONE && has(w, body_a)) && !(body_b != HAPI_NONE && has(w, body_b))) {
    return;
  }
  uint32_t at = hapi_index_get(&w->pair_of, key_of(a, b));
  if (at == HAPI_INDEX_NONE) {
    if (!hapi_reserve((void **)&w->pairs, &w->pair_capacity, w->pair_count, 1, sizeof *w->pairs) ||
        !hapi_index_reserve(&w->pair_of, w->pair_count + 1)) {
      w->spoilt = true;
      return;
    }
    at = w->pair_count++;
    hapi_index_put(&w->pair_of, key_of(a, b), at);
  }
  w->pairs[at] = (hapi_lookback_pair){.a = a, .b = b, .surface = *surface};
  w->pairs[at].surface.mode &= ~dContactFDir1; /* a direction is the application's, at each step */
}

/* A window in which the geom takes part is spoilt: a new one may have its address. */
void hapi_lookback_forget_geom(hapi_lookback *w, dGeomID geom)
{
  for (uint32_t i = 0; i < w->pair_count && w->phase != HAPI_LOOKBACK_IDLE; ++i) {
    w->spoilt = w->spoilt || w->pairs[i].a == geom || w->pairs[i].b == geom;
  }
  for (uint32_t i = 0; i < w->touch_count; ++i) {
    if (w->touches[i].geom == geom) {
      w->touches[i].geom = NULL;
      w->touches[i].noted = false;
      w->spoilt = true;
    }
  }
}

/* The pair's place; HAPI_NONE: none left. */
static uint32_t place_of(hapi_lookback *w, uint32_t most, const hapi_lookback_touch *touch)
{
  uint32_t free = HAPI_NONE;
  for (uint32_t i = 0; i < w->touch_count; ++i) {
    const hapi_lookback_touch *t = &w->touches[i];
    if (t->geom == touch->geom && t->pointer == touch->pointer &&
        t->generation == touch->generation) {
      return i;
    }
    free = t->geom == NULL ? i : free;
  }
  if (free == HAPI_NONE && w->touch_count < most &&
      hapi_reserve((void **)&w->touches, &w->touch_capacity, w->touch_count, 1,
                   sizeof *w->touches)) {
    free = w->touch_count++;
    memset(&w->touches[free], 0, sizeof w->touches[free]);
  }
  return free;
}

static void note_touch(hapi_physics *physics, const hapi_lookback_touch *touch)
{
  hapi_lookback *w = &physics->lookback;
  uint32_t at = place_of(w, physics->config.capacity.contacts, touch);
  if (at == HAPI_NONE) {
    w->spoilt = true;
    return;
  }
  hapi_lookback_touch *t = &w->touches[at];
  if (t->geom == NULL) {
    uint32_t generation = t->contact_generation;
    *t = *touch;
    t->contact_generation = generation + 1;
    t->key = touch->is_tool ? hapi_tool_geom_key(physics, touch->geom, touch->pointer) : 0;
  }
  t->mu = touch->mu;
  t->noted = true;
}

static void note_slots(hapi_physics *physics)
{
  for (uint32_t i = 0; i < physics->near.slots.contact_high; ++i) {
    const hapi_contact_slot *slot = &physics->near.slots.contacts[i];
    const hapi_lookback_touch touch = {.geom = slot->geom,
                                       .pointer = slot->pointer,
                                       .generation = slot->pointer_generation,
                                       .is_tool = slot->is_tool,
                                       .mu = slot->mu};
    if (slot->phase == HAPI_SLOT_LIVE) {
      note_touch(physics, &touch);
    }
  }
}

/* Of model CONTACT, whose points of hulls have no slots. */
static void note_hits(hapi_physics *physics)
{
  const hapi_neighbors *hood = &physics->near.neighbors;
  for (uint32_t i = 0; i < hood->hit_count; ++i) {
    const hapi_hit *hit = &hood->hits[i];
    const hapi_state_pointer *pointer = &hapi_state_pointers(physics->cycle.state)[hit->pointer];
    const hapi_lookback_touch touch = {.geom = hit->geom,
                                       .pointer = hit->pointer,
                                       .generation = pointer->generation,
                                       .is_tool = true,
                                       .mu = hit->mu};
    if (hit->tool_count > 0) {
      note_touch(physics, &touch);
    }
  }
}

void hapi_lookback_note(hapi_physics *physics)
{
  if (physics->lookback.phase != HAPI_LOOKBACK_OPEN) {
    return;
  }
  note_slots(physics);
  if (physics->cycle.model == HAP_MODEL_CONTACT) {
    note_hits(physics);
  }
}

/* The place of the pair whose contact the spring is of; HAPI_NONE: none that is near. */
static uint32_t touch_of(const hapi_physics *physics, const hapi_state_spring *spring)
{
  const hapi_lookback *w = &physics->lookback;
  const hapi_contact_slot *slot =
      spring->slot != HAPI_SLOT_NONE ? &physics->near.slots.contacts[spring->slot] : NULL;
  for (uint32_t i = 0; i < w->touch_count; ++i) {
    const hapi_lookback_touch *t = &w->touches[i];
    bool same = slot != NULL ? t->geom == slot->geom && t->pointer == slot->pointer &&
                                   t->generation == slot->pointer_generation
                             : t->is_tool && t->key == spring->key;
    if (t->geom != NULL && same) {
      return i;
    }
  }
  return HAPI_NONE;
}

static void take_springs(hapi_physics *physics)
{
  hapi_lookback *w = &physics->lookback;
  const hapi_state_spring *in = hapi_state_springs(physics->cycle.state);
  w->spring_count = 0;
  if (!hapi_reserve((void **)&w->springs, &w->spring_capacity, 0,
                    physics->cycle.state->spring_count, sizeof *w->springs)) {
    w->spoilt = true;
    return;
  }
  for (uint32_t i = 0; i < physics->cycle.state->spring_count; ++i) {
    uint32_t touch = touch_of(physics, &in[i]);
    if (touch != HAPI_NONE && hapi_finite(in[i].stretch_body, 3) && hapi_finite(&in[i].turn, 1)) {
      w->springs[w->spring_count++] = (hapi_lookback_spring){.touch = touch, .in = in[i]};
    }
  }
}

/* ---- opening ---- */

static bool add_body(hapi_physics *physics, uint32_t known)
{
  hapi_lookback *w = &physics->lookback;
  const hapi_known_body *entry = &physics->world.bodies.entries[known];
  if (w->body_count == HAPI_LOOKBACK_BODIES ||
      !hapi_reserve((void **)&w->bodies, &w->body_capacity, w->body_count, 1, sizeof *w->bodies)) {
    return false;
  }
  hapi_lookback_body *body = &w->bodies[w->body_count++];
  memset(body, 0, sizeof *body);
  body->known = known;
  body->birth = entry->rest->birth;
  hapi_v3_copy(entry->rest->user_force, body->wrench);
  hapi_v3_copy(entry->rest->user_torque, body->wrench + 3);
  return true;
}

/* m, from the nearest pointer's surface to the body's */
static double apart(const hapi_physics *physics, const hapi_known_body *known)
{
  const hapi_state_pointer *pointers = hapi_state_pointers(physics->cycle.state);
  double least = HUGE_VAL;
  for (uint32_t i = 0; i < physics->cycle.state->pointer_count; ++i) {
    if (pointers[i].generation != 0) {
      double d[3];
      hapi_v3_sub(dBodyGetPosition(known->body), pointers[i].pose.position, d);
      least = fmin(least, hapi_v3_norm(d) - pointers[i].extent - known->extent);
    }
  }
  return least;
}

/* Within a distance that takes no more than there is room for. */
static bool add_near(hapi_physics *physics)
{
  hapi_lookback *w = &physics->lookback;
  double reach = NEAR_M;
  for (int i = 0; i < REACHES; ++i, reach *= 0.7) {
    uint32_t count = 0;
    w->body_count = 0;
    bool good = true;
    for (uint32_t k = 0; k < physics->world.bodies.high && count <= BODIES_MAX && good; ++k) {
      const hapi_known_body *known = &physics->world.bodies.entries[k];
      if (known->body != NULL && apart(physics, known) < reach) {
        good = ++count > BODIES_MAX || add_body(physics, k);
      }
    }
    if (!good || count <= BODIES_MAX) {
      return good;
    }
  }
  return false;
}

static bool add_jointed(hapi_physics *physics)
{
  hapi_lookback *w = &physics->lookback;
  for (uint32_t i = 0; i < w->body_count; ++i) {
    dBodyID body = physics->world.bodies.entries[w->bodies[i].known].body;
    int joints = dBodyGetNumJoints(body);
    for (int k = 0; k < joints; ++k) {
      dJointID joint = dBodyGetJoint(body, k);
      for (int side = 0; side < 2 && dJointGetType(joint) != dJointTypeContact; ++side) {
        uint32_t other = hapi_bodies_find(&physics->world.bodies, dJointGetBody(joint, side));
        if (other != HAPI_NONE && !has(w, other) && !add_body(physics, other)) {
          return false;
        }
      }
      if (dJointGetType(joint) == dJointTypeTransmission) {
        return false; /* its phase cannot be put back */
      }
    }
  }
  return true;
}

static int64_t ticks_ns(const hapi_physics *physics, double ticks)
{
  return (int64_t)(1e9 * ticks / physics->config.haptic_hz);
}

/* The loop's newest state is what its tick came to: the one after that goes on from it. */
static int64_t first_row(const hapi_physics *physics, int64_t now_ns)
{
  return physics->cycle.model == HAP_MODEL_IMPULSE
             ? now_ns - ticks_ns(physics, 0.5)
             : physics->cycle.state->now_ns + ticks_ns(physics, 0.5);
}

/* A body of the loop is where the loop has it, any other where the world's step has left it. */
static void note_times(hapi_physics *physics, int64_t now_ns)
{
  hapi_lookback *w = &physics->lookback;
  for (uint32_t i = 0; i < w->body_count; ++i) {
    uint32_t index = physics->world.bodies.entries[w->bodies[i].known].slot;
    const hapi_body_slot *slot = index != HAPI_NONE ? &physics->near.slots.bodies[index] : NULL;
    bool loops =
        slot != NULL && physics->cycle.model != HAP_MODEL_IMPULSE &&
        (slot->loop_owned || (physics->cycle.model == HAP_MODEL_ACCELERANCE && slot->pushed));
    w->bodies[i].lag_ns = loops ? -physics->cycle.state->now_ns - ticks_ns(physics, 1.0)
                                : -now_ns; /* and the first row's time */
  }
}

/* What the last window had is kept beside what this one will have. */
static void turn_over(hapi_lookback *w)
{
  hapi_lookback_body *bodies = w->ended;
  hapi_body_state *states = w->ends;
  uint32_t body_capacity = w->ended_capacity;
  uint32_t state_capacity = w->ends_capacity;
  w->ended = w->bodies;
  w->ended_count = w->body_count;
  w->ended_capacity = w->body_capacity;
  w->ends = w->states;
  w->ends_capacity = w->state_capacity;
  w->bodies = bodies;
  w->body_capacity = body_capacity;
  w->states = states;
  w->state_capacity = state_capacity;
  w->body_count = 0;
}

/* Places of pairs that were not near while the last window was open are free again. */
static void begin_touches(hapi_lookback *w)
{
  for (uint32_t i = 0; i < w->touch_count; ++i) {
    if (!w->touches[i].noted) {
      w->touches[i].geom = NULL;
    }
    w->touches[i].noted = false;
  }
}

void hapi_lookback_open(hapi_physics *physics, int64_t now_ns)
{
  hapi_lookback *w = &physics->lookback;
  if (!asked_for(physics) || w->phase != HAPI_LOOKBACK_IDLE || physics->cycle.state == NULL) {
    return;
  }
  double most = fmax(WINDOW_S, WINDOW_STEPS / physics->config.physics_hz);
  w->seconds =
      w->seconds > 0.0 ? fmin(2.0 * w->seconds, most) : FIRST_STEPS / physics->config.physics_hz;
  turn_over(w);
  begin_touches(w);
  memset(w->hand.hull_of, 0, sizeof w->hand.hull_of);
  w->pair_count = w->row_count = w->next = w->touched = 0;
  hapi_index_clear(&w->pair_of);
  w->wrong2 = w->right2 = w->spent_s = 0.0;
  w->from_ns = first_row(physics, now_ns);
  w->to_ns = now_ns + (int64_t)(1e9 * w->seconds);
  w->spoilt =
      !hapi_lookback_hand_ready(physics) || !add_near(physics) || !add_jointed(physics) ||
      !hapi_reserve((void **)&w->states, &w->state_capacity, 0, w->body_count, sizeof *w->states);
  if (!w->spoilt) {
    hapi_lookback_keep(physics);
    note_times(physics, now_ns);
  }
  w->phase = HAPI_LOOKBACK_OPEN;
  hapi_lookback_note(physics);
  take_springs(physics);
}

/* ---- while it is open ---- */

static void set_lags(hapi_lookback *w, int64_t first_ns)
{
  for (uint32_t i = 0; i < w->body_count; ++i) {
    w->bodies[i].lag_ns += first_ns;
  }
}

/* False: what it would feel is not reckoned here. */
static bool take_kind(hapi_physics *physics, uint32_t index, const hapi_path_pointer *in)
{
  bool pushes = hapi_v3_dot(in->wrench.force, in->wrench.force) > 0.0;
  return in->generation == 0 ||
         (!(in->rigid != 0 && pushes) &&
          (in->is_tool == 0 || hapi_lookback_hand_take_hull(physics, index, in->generation)));
}

static void take_row(hapi_physics *physics, int64_t time_ns, const hapi_path_pointer *pointers)
{
  hapi_lookback *w = &physics->lookback;
  uint32_t count = physics->config.capacity.pointers;
  if (w->phase != HAPI_LOOKBACK_OPEN || w->spoilt || time_ns < w->from_ns) {
    return;
  }
  if (!hapi_reserve((void **)&w->times_ns, &w->time_capacity, w->row_count, 1,
                    sizeof *w->times_ns) ||
      !hapi_reserve((void **)&w->path, &w->path_capacity, w->row_count * count, count,
                    sizeof *w->path)) {
    w->spoilt = true;
    return;
  }
  if (w->row_count == 0) {
    set_lags(w, time_ns);
  }
  for (uint32_t i = 0; i < count; ++i) {
    w->spoilt = w->spoilt || !take_kind(physics, i, &pointers[i]);
  }
  w->times_ns[w->row_count] = time_ns;
  memcpy(&w->path[w->row_count * count], pointers, count * sizeof *w->path);
  ++w->row_count;
}

static void take_rows(hapi_physics *physics)
{
  hapi_path *path = hapi_exchange_path(physics->config.exchange);
  int64_t time_ns;
  const hapi_path_pointer *pointers;
  while (hapi_path_look(path, &time_ns, &pointers)) {
    take_row(physics, time_ns, pointers);
    hapi_path_let_go(path);
  }
}

/* All bodies are those that they were, and nobody else has moved one. */
static bool still_there(const hapi_physics *physics)
{
  const hapi_lookback *w = &physics->lookback;
  for (uint32_t i = 0; i < w->body_count; ++i) {
    const hapi_known_body *known = &physics->world.bodies.entries[w->bodies[i].known];
    if (known->body == NULL || known->rest->birth != w->bodies[i].birth) {
      return false;
    }
    if (w->phase == HAPI_LOOKBACK_OPEN && known->slot != HAPI_NONE) {
      const hapi_body_slot *slot = &physics->near.slots.bodies[known->slot];
      if (slot->pose_changed || slot->velocity_changed) {
        return false;
      }
    }
  }
  return true;
}

/* ---- what comes out ---- */

/* The next window may go on where this one's reference has ended. */
static void link_up(hapi_physics *physics)
{
  hapi_lookback *w = &physics->lookback;
  w->chain_s += 1e-9 * (double)(w->to_ns - w->from_ns);
  if (w->row_count > 0 && w->chain_s < CHAIN_S) {
    w->end_ns = w->times_ns[w->row_count - 1] + ticks_ns(physics, 1.0);
  }
}

static void end(hapi_physics *physics)
{
  hapi_lookback *w = &physics->lookback;
  hap_stats *s = &physics->counts.own.stats;
  w->phase = HAPI_LOOKBACK_IDLE;
  w->end_ns = 0;
  if (w->spoilt) {
    ++s->error.spoilt;
    return;
  }
  link_up(physics);
  double keep = exp(-1e-9 * (double)(w->to_ns - w->from_ns) / MEMORY_S);
  ++s->error.lookbacks;
  if (w->touched > 0) {
    w->wrong2_sum = keep * w->wrong2_sum + w->wrong2;
    w->right2_sum = keep * w->right2_sum + w->right2;
    s->error.force_error = w->right2_sum > 0.0 ? sqrt(w->wrong2_sum / w->right2_sum) : HUGE_VAL;
    s->error.force_error_n = sqrt(w->wrong2 / w->touched);
    hapi_dial_note_error(physics, w->right2 > 0.0 ? sqrt(w->wrong2 / w->right2) : HUGE_VAL,
                         w->seconds);
  }
}

static double budget(const hapi_physics *physics)
{
  return physics->config.lockstep
             ? -1.0
             : fmin(physics->config.lookback_share / physics->config.physics_hz,
                    hapi_dial_spare(physics));
}

/* A world in which one step takes all of the time that there is: the figure would be long out of date, and
 * physics late. The next windows make do with less. */
static bool too_dear(hapi_physics *physics)
{
  hapi_lookback *w = &physics->lookback;
  bool dear = !physics->config.lockstep && w->next > 0 &&
              w->spent_s > DEAR * budget(physics) * (double)w->next;
  w->lean = w->lean || dear;
  return dear;
}

void hapi_lookback_follow(hapi_physics *physics, int64_t now_ns)
{
  hapi_lookback *w = &physics->lookback;
  if (physics->config.lookback_share <= 0.0) {
    return;
  }
  take_rows(physics);
  if (w->phase == HAPI_LOOKBACK_IDLE) {
    return;
  }
  w->spoilt = w->spoilt || !asked_for(physics) || !still_there(physics);
  if (w->phase == HAPI_LOOKBACK_OPEN && now_ns >= w->to_ns) {
    w->phase = HAPI_LOOKBACK_GOING;
  }
  if (w->phase == HAPI_LOOKBACK_GOING && !w->spoilt) {
    w->spoilt = hapi_lookback_run(physics, budget(physics)) < HAP_OK || too_dear(physics);
  }
  if (w->phase == HAPI_LOOKBACK_GOING && (w->spoilt || w->next >= w->row_count)) {
    end(physics);
  }
}
