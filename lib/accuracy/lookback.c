/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "accuracy/lookback.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"
#include "base/vec.h"
#include "sync/exchange.h"

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

static bool lookback_is_wanted(const hapi_cycle *cycle)
{
  return cycle->config->lookback_share > 0.0 && cycle->model != HAP_MODEL_SINGLE;
}

void hapi_lookback_reset(hapi_lookback *w)
{
  w->phase = HAPI_LOOKBACK_IDLE;
  w->end_ns = 0;
  w->touches.count = 0;
  w->lean = false;
  w->sums.right2_all = w->sums.wrong2_all = 0.0;
  w->seconds = 0.0;
  w->counts = (hapi_lookback_counts){0};
}

void hapi_lookback_unchain(hapi_lookback *w)
{
  w->end_ns = 0;
}

void hapi_lookback_finish(hapi_lookback *w)
{
  hapi_free(w->bodies.list);
  hapi_free(w->bodies.states);
  hapi_free(w->pairs.list);
  hapi_free(w->touches.list);
  hapi_free(w->springs.list);
  hapi_free(w->ended.list);
  hapi_free(w->ended.states);
  hapi_lookback_hand_finish(&w->hand);
  hapi_test_finish(&w->test);
  hapi_free(w->rows.times_ns);
  hapi_free(w->rows.path);
  hapi_index_finish(&w->pairs.index);
  hapi_index_finish(&w->geoms);
  memset(w, 0, sizeof *w);
}

/* ---- what is near ---- */

static bool window_has(const hapi_lookback *w, uint32_t known)
{
  for (uint32_t i = 0; i < w->bodies.count; ++i) {
    if (w->bodies.list[i].known == known) {
      return true;
    }
  }
  return false;
}

static uint64_t pair_key(dGeomID a, dGeomID b)
{
  uint64_t x = hapi_index_address(a);
  uint64_t y = hapi_index_address(b);
  return hapi_index_mix(x < y ? x : y) ^ (x < y ? y : x);
}

void hapi_lookback_ask(hapi_lookback *w, const hapi_body_table *bodies, dGeomID a, dGeomID b,
                       const dSurfaceParameters *surface)
{
  if (w->phase != HAPI_LOOKBACK_OPEN || w->spoilt) {
    return;
  }
  uint32_t body_a = hapi_bodies_find(bodies, dGeomGetBody(a));
  uint32_t body_b = hapi_bodies_find(bodies, dGeomGetBody(b));
  if (!(body_a != HAPI_NONE && window_has(w, body_a)) &&
      !(body_b != HAPI_NONE && window_has(w, body_b))) {
    return;
  }
  uint32_t at = hapi_index_get(&w->pairs.index, pair_key(a, b));
  if (at == HAPI_INDEX_NONE) {
    if (!hapi_reserve((void **)&w->pairs.list, &w->pairs.capacity, w->pairs.count, 1,
                      sizeof *w->pairs.list) ||
        !hapi_index_reserve(&w->pairs.index, w->pairs.count + 1)) {
      w->spoilt = true;
      return;
    }
    at = w->pairs.count++;
    hapi_index_put(&w->pairs.index, pair_key(a, b), at);
  }
  w->pairs.list[at] = (hapi_lookback_pair){.a = a, .b = b, .surface = *surface};
  w->pairs.list[at].surface.mode &=
      ~dContactFDir1; /* a direction is the application's, at each step */
}

/* A window in which the geom takes part is spoilt: a new one may have its address. */
void hapi_lookback_forget_geom(hapi_lookback *w, dGeomID geom)
{
  for (uint32_t i = 0; i < w->pairs.count && w->phase != HAPI_LOOKBACK_IDLE; ++i) {
    w->spoilt = w->spoilt || w->pairs.list[i].a == geom || w->pairs.list[i].b == geom;
  }
  for (uint32_t i = 0; i < w->touches.count; ++i) {
    if (w->touches.list[i].geom == geom) {
      w->touches.list[i].geom = NULL;
      w->touches.list[i].noted = false;
      w->spoilt = true;
    }
  }
}

/* The pair's place; HAPI_NONE: none left. */
static uint32_t touch_place(hapi_lookback *w, uint32_t most, const hapi_lookback_touch *touch)
{
  uint32_t free = HAPI_NONE;
  for (uint32_t i = 0; i < w->touches.count; ++i) {
    const hapi_lookback_touch *t = &w->touches.list[i];
    if (t->geom == touch->geom && t->pointer == touch->pointer &&
        t->generation == touch->generation) {
      return i;
    }
    free = t->geom == NULL ? i : free;
  }
  if (free == HAPI_NONE && w->touches.count < most &&
      hapi_reserve((void **)&w->touches.list, &w->touches.capacity, w->touches.count, 1,
                   sizeof *w->touches.list)) {
    free = w->touches.count++;
    memset(&w->touches.list[free], 0, sizeof w->touches.list[free]);
  }
  return free;
}

static void window_note_touch(hapi_lookback *w, uint32_t most, const hapi_lookback_touch *touch)
{
  uint32_t at = touch_place(w, most, touch);
  if (at == HAPI_NONE) {
    w->spoilt = true;
    return;
  }
  hapi_lookback_touch *t = &w->touches.list[at];
  if (t->geom == NULL) {
    uint32_t generation = t->contact_generation;
    *t = *touch;
    t->contact_generation = generation + 1;
    t->key = touch->is_tool ? w->asker.key(w->asker.user, touch->geom, touch->pointer) : 0;
  }
  t->mu = touch->mu;
  t->noted = true;
}

static void window_note_slots(hapi_lookback *w, const hapi_slots *slots, uint32_t most)
{
  for (uint32_t i = 0; i < slots->contact_high; ++i) {
    const hapi_contact_slot *slot = &slots->contacts[i];
    const hapi_lookback_touch touch = {.geom = slot->geom,
                                       .pointer = slot->pointer,
                                       .generation = slot->pointer_generation,
                                       .is_tool = slot->is_tool,
                                       .mu = slot->mu};
    if (slot->phase == HAPI_SLOT_LIVE) {
      window_note_touch(w, most, &touch);
    }
  }
}

/* Of model CONTACT, whose points of hulls have no slots. */
static void window_note_hits(hapi_lookback *w, const hapi_cycle *cycle, const hapi_neighbors *hood)
{
  uint32_t most = cycle->config->capacity.contacts;
  for (uint32_t i = 0; i < hood->hit_count; ++i) {
    const hapi_hit *hit = &hood->hits[i];
    const hapi_state_pointer *pointer = &hapi_state_pointers(cycle->state)[hit->pointer];
    const hapi_lookback_touch touch = {.geom = hit->geom,
                                       .pointer = hit->pointer,
                                       .generation = pointer->generation,
                                       .is_tool = true,
                                       .mu = hit->mu};
    if (hit->tool_count > 0) {
      window_note_touch(w, most, &touch);
    }
  }
}

void hapi_lookback_note(hapi_lookback *w, const hapi_cycle *cycle, const hapi_slots *slots,
                        const hapi_neighbors *neighbors)
{
  if (w->phase != HAPI_LOOKBACK_OPEN) {
    return;
  }
  window_note_slots(w, slots, cycle->config->capacity.contacts);
  if (cycle->model == HAP_MODEL_CONTACT) {
    window_note_hits(w, cycle, neighbors);
  }
}

/* The place of the pair whose contact the spring is of; HAPI_NONE: none that is near. */
static uint32_t spring_touch(const hapi_lookback *w, const hapi_slots *slots,
                             const hapi_state_spring *spring)
{
  const hapi_contact_slot *slot =
      spring->slot != HAPI_SLOT_NONE ? &slots->contacts[spring->slot] : NULL;
  for (uint32_t i = 0; i < w->touches.count; ++i) {
    const hapi_lookback_touch *t = &w->touches.list[i];
    bool same = slot != NULL ? t->geom == slot->geom && t->pointer == slot->pointer &&
                                   t->generation == slot->pointer_generation
                             : t->is_tool && t->key == spring->key;
    if (t->geom != NULL && same) {
      return i;
    }
  }
  return HAPI_NONE;
}

static void window_take_springs(hapi_lookback *w, const hapi_cycle *cycle, const hapi_slots *slots)
{
  const hapi_state_spring *in = hapi_state_springs(cycle->state);
  w->springs.count = 0;
  if (!hapi_reserve((void **)&w->springs.list, &w->springs.capacity, 0, cycle->state->spring_count,
                    sizeof *w->springs.list)) {
    w->spoilt = true;
    return;
  }
  for (uint32_t i = 0; i < cycle->state->spring_count; ++i) {
    uint32_t touch = spring_touch(w, slots, &in[i]);
    if (touch != HAPI_NONE && hapi_finite(in[i].stretch_body, 3) && hapi_finite(&in[i].turn, 1)) {
      w->springs.list[w->springs.count++] = (hapi_lookback_spring){.touch = touch, .in = in[i]};
    }
  }
}

/* ---- opening ---- */

static bool window_add_body(hapi_lookback *w, const hapi_body_table *bodies, uint32_t known)
{
  HAPI_ASSERT_INDEX(known, bodies->high);
  const hapi_known_body *entry = &bodies->entries[known];
  if (w->bodies.count == HAPI_LOOKBACK_BODIES ||
      !hapi_reserve((void **)&w->bodies.list, &w->bodies.capacity, w->bodies.count, 1,
                    sizeof *w->bodies.list)) {
    return false;
  }
  hapi_lookback_body *body = &w->bodies.list[w->bodies.count++];
  memset(body, 0, sizeof *body);
  body->known = known;
  body->birth = entry->rest->birth;
  hapi_v3_copy(entry->rest->user_force, body->wrench);
  hapi_v3_copy(entry->rest->user_torque, body->wrench + 3);
  return true;
}

/* m, from the nearest pointer's surface to the body's */
static double body_apart(const hapi_cycle *cycle, const hapi_known_body *known)
{
  const hapi_state_pointer *pointers = hapi_state_pointers(cycle->state);
  double least = HUGE_VAL;
  for (uint32_t i = 0; i < cycle->state->pointer_count; ++i) {
    if (pointers[i].generation != 0) {
      double d[3];
      hapi_v3_sub(dBodyGetPosition(known->body), pointers[i].pose.position, d);
      least = fmin(least, hapi_v3_norm(d) - pointers[i].extent - known->extent);
    }
  }
  return least;
}

/* Within a distance that takes no more than there is room for. */
static bool window_add_near(hapi_lookback *w, const hapi_cycle *cycle,
                            const hapi_body_table *bodies)
{
  double reach = NEAR_M;
  for (int i = 0; i < REACHES; ++i, reach *= 0.7) {
    uint32_t count = 0;
    w->bodies.count = 0;
    bool good = true;
    for (uint32_t k = 0; k < bodies->high && count <= BODIES_MAX && good; ++k) {
      const hapi_known_body *known = &bodies->entries[k];
      if (known->body != NULL && body_apart(cycle, known) < reach) {
        good = ++count > BODIES_MAX || window_add_body(w, bodies, k);
      }
    }
    if (!good || count <= BODIES_MAX) {
      return good;
    }
  }
  return false;
}

static bool window_add_jointed(hapi_lookback *w, const hapi_body_table *bodies)
{
  for (uint32_t i = 0; i < w->bodies.count; ++i) {
    dBodyID body = bodies->entries[w->bodies.list[i].known].body;
    int joints = dBodyGetNumJoints(body);
    for (int k = 0; k < joints; ++k) {
      dJointID joint = dBodyGetJoint(body, k);
      for (int side = 0; side < 2 && dJointGetType(joint) != dJointTypeContact; ++side) {
        uint32_t other = hapi_bodies_find(bodies, dJointGetBody(joint, side));
        if (other != HAPI_NONE && !window_has(w, other) && !window_add_body(w, bodies, other)) {
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

static int64_t ticks_ns(const hapi_cycle *cycle, double ticks)
{
  return (int64_t)(1e9 * ticks / cycle->config->haptic_hz);
}

/* The loop's newest state is what its tick came to: the one after that goes on from it. */
static int64_t window_first_row(const hapi_cycle *cycle, int64_t now_ns)
{
  return cycle->model == HAP_MODEL_IMPULSE ? now_ns - ticks_ns(cycle, 0.5)
                                           : cycle->state->now_ns + ticks_ns(cycle, 0.5);
}

/* A body of the loop is where the loop has it, any other where the world's step has left it. */
static void window_note_times(hapi_lookback *w, const hapi_cycle *cycle,
                              const hapi_body_table *bodies, const hapi_slots *slots,
                              int64_t now_ns)
{
  for (uint32_t i = 0; i < w->bodies.count; ++i) {
    uint32_t index = bodies->entries[w->bodies.list[i].known].slot;
    const hapi_body_slot *slot = index != HAPI_NONE ? &slots->bodies[index] : NULL;
    bool loops = slot != NULL && cycle->model != HAP_MODEL_IMPULSE &&
                 (slot->loop_owned || (cycle->model == HAP_MODEL_ACCELERANCE && slot->pushed));
    w->bodies.list[i].lag_ns = loops ? -cycle->state->now_ns - ticks_ns(cycle, 1.0)
                                     : -now_ns; /* and the first row's time */
  }
}

/* What the last window had is kept beside what this one will have. */
static void window_turn_over(hapi_lookback *w)
{
  hapi_lookback_bodies ended = w->ended;
  w->ended = w->bodies;
  w->bodies = ended;
  w->bodies.count = 0;
}

/* Places of pairs that were not near while the last window was open are free again. */
static void window_begin_touches(hapi_lookback *w)
{
  for (uint32_t i = 0; i < w->touches.count; ++i) {
    if (!w->touches.list[i].noted) {
      w->touches.list[i].geom = NULL;
    }
    w->touches.list[i].noted = false;
  }
}

void hapi_lookback_open(hapi_lookback *w, const hapi_cycle *cycle, const hapi_world *world,
                        const hapi_slots *slots, const hapi_neighbors *neighbors, int64_t now_ns)
{
  const hapi_body_table *bodies = &world->bodies;
  double physics_hz = cycle->config->physics_hz;
  if (!lookback_is_wanted(cycle) || w->phase != HAPI_LOOKBACK_IDLE || cycle->state == NULL) {
    return;
  }
  double most = fmax(WINDOW_S, WINDOW_STEPS / physics_hz);
  w->seconds = w->seconds > 0.0 ? fmin(2.0 * w->seconds, most) : FIRST_STEPS / physics_hz;
  window_turn_over(w);
  window_begin_touches(w);
  memset(w->hand.hull_of, 0, sizeof w->hand.hull_of);
  w->pairs.count = w->rows.count = w->rows.next = w->sums.touched = 0;
  w->rows.pointers = cycle->config->capacity.pointers;
  hapi_index_clear(&w->pairs.index);
  w->sums.wrong2 = w->sums.right2 = w->spent_s = 0.0;
  w->from_ns = window_first_row(cycle, now_ns);
  w->to_ns = now_ns + (int64_t)(1e9 * w->seconds);
  w->spoilt = !hapi_lookback_hand_ready(&w->hand, &cycle->config->capacity) ||
              !window_add_near(w, cycle, bodies) || !window_add_jointed(w, bodies) ||
              !hapi_reserve((void **)&w->bodies.states, &w->bodies.state_capacity, 0,
                            w->bodies.count, sizeof *w->bodies.states);
  if (!w->spoilt) {
    hapi_lookback_keep(w, bodies);
    window_note_times(w, cycle, bodies, slots, now_ns);
  }
  w->phase = HAPI_LOOKBACK_OPEN;
  hapi_lookback_note(w, cycle, slots, neighbors);
  window_take_springs(w, cycle, slots);
}

/* ---- while it is open ---- */

static void window_set_lags(hapi_lookback *w, int64_t first_ns)
{
  for (uint32_t i = 0; i < w->bodies.count; ++i) {
    w->bodies.list[i].lag_ns += first_ns;
  }
}

/* False: what it would feel is not reckoned here. */
static bool window_takes_kind(hapi_lookback *w, const hapi_cycle *cycle, uint32_t index,
                              const hapi_path_pointer *in)
{
  bool pushes = hapi_v3_dot(in->wrench.force, in->wrench.force) > 0.0;
  return in->generation == 0 || (!(in->rigid != 0 && pushes) &&
                                 (in->is_tool == 0 || hapi_lookback_hand_take_hull(
                                                          &w->hand, cycle, index, in->generation)));
}

static void window_take_row(hapi_lookback *w, const hapi_cycle *cycle, int64_t time_ns,
                            const hapi_path_pointer *pointers)
{
  uint32_t count = w->rows.pointers;
  if (w->phase != HAPI_LOOKBACK_OPEN || w->spoilt || time_ns < w->from_ns) {
    return;
  }
  if (!hapi_reserve((void **)&w->rows.times_ns, &w->rows.time_capacity, w->rows.count, 1,
                    sizeof *w->rows.times_ns) ||
      !hapi_reserve((void **)&w->rows.path, &w->rows.path_capacity, w->rows.count * count, count,
                    sizeof *w->rows.path)) {
    w->spoilt = true;
    return;
  }
  if (w->rows.count == 0) {
    window_set_lags(w, time_ns);
  }
  for (uint32_t i = 0; i < count; ++i) {
    w->spoilt = w->spoilt || !window_takes_kind(w, cycle, i, &pointers[i]);
  }
  w->rows.times_ns[w->rows.count] = time_ns;
  memcpy(&w->rows.path[w->rows.count * count], pointers, count * sizeof *w->rows.path);
  ++w->rows.count;
}

static void window_take_rows(hapi_lookback *w, const hapi_cycle *cycle)
{
  hapi_path *path = hapi_exchange_path(cycle->config->exchange);
  int64_t time_ns;
  const hapi_path_pointer *pointers;
  while (hapi_path_look(path, &time_ns, &pointers)) {
    window_take_row(w, cycle, time_ns, pointers);
    hapi_path_let_go(path);
  }
}

/* All bodies are those that they were, and nobody else has moved one. */
static bool window_is_still_there(const hapi_lookback *w, const hapi_body_table *bodies,
                                  const hapi_slots *slots)
{
  for (uint32_t i = 0; i < w->bodies.count; ++i) {
    const hapi_known_body *known = &bodies->entries[w->bodies.list[i].known];
    if (known->body == NULL || known->rest->birth != w->bodies.list[i].birth) {
      return false;
    }
    if (w->phase == HAPI_LOOKBACK_OPEN && known->slot != HAPI_NONE) {
      const hapi_body_slot *slot = &slots->bodies[known->slot];
      if (slot->pose_changed || slot->velocity_changed) {
        return false;
      }
    }
  }
  return true;
}

/* ---- what comes out ---- */

/* The next window may go on where this one's reference has ended. */
static void window_link_up(hapi_lookback *w, const hapi_cycle *cycle)
{
  w->chain_s += 1e-9 * (double)(w->to_ns - w->from_ns);
  if (w->rows.count > 0 && w->chain_s < CHAIN_S) {
    w->end_ns = w->rows.times_ns[w->rows.count - 1] + ticks_ns(cycle, 1.0);
  }
}

/* True: *out is what the window says. */
static bool window_end(hapi_lookback *w, const hapi_cycle *cycle, hapi_lookback_verdict *out)
{
  hapi_lookback_sums *sums = &w->sums;
  w->phase = HAPI_LOOKBACK_IDLE;
  w->end_ns = 0;
  if (w->spoilt) {
    ++w->counts.spoilt;
    return false;
  }
  window_link_up(w, cycle);
  double keep = exp(-1e-9 * (double)(w->to_ns - w->from_ns) / MEMORY_S);
  ++w->counts.windows;
  if (sums->touched == 0) {
    return false;
  }
  sums->wrong2_all = keep * sums->wrong2_all + sums->wrong2;
  sums->right2_all = keep * sums->right2_all + sums->right2;
  w->counts.force_error =
      sums->right2_all > 0.0 ? sqrt(sums->wrong2_all / sums->right2_all) : HUGE_VAL;
  w->counts.force_error_n = sqrt(sums->wrong2 / sums->touched);
  out->error = sums->right2 > 0.0 ? sqrt(sums->wrong2 / sums->right2) : HUGE_VAL;
  out->seconds = w->seconds;
  return true;
}

/* s, for this cycle's share; negative: as long as it takes. */
static double window_budget(const hapi_physics_config *config, double spare_s)
{
  return config->lockstep ? -1.0 : fmin(config->lookback_share / config->physics_hz, spare_s);
}

/* A world in which one step takes all of the time that there is: the figure would be long out of
 * date, and physics late. The next windows make do with less. */
static bool window_is_too_costly(hapi_lookback *w, const hapi_physics_config *config,
                                 double spare_s)
{
  bool dear = !config->lockstep && w->rows.next > 0 &&
              w->spent_s > DEAR * window_budget(config, spare_s) * (double)w->rows.next;
  w->lean = w->lean || dear;
  return dear;
}

bool hapi_lookback_follow(hapi_lookback *w, const hapi_cycle *cycle, const hapi_world *world,
                          const hapi_slots *slots, const hapi_lookback_time *time,
                          hapi_lookback_verdict *out)
{
  if (cycle->config->lookback_share <= 0.0) {
    return false;
  }
  window_take_rows(w, cycle);
  if (w->phase == HAPI_LOOKBACK_IDLE) {
    return false;
  }
  w->spoilt =
      w->spoilt || !lookback_is_wanted(cycle) || !window_is_still_there(w, &world->bodies, slots);
  if (w->phase == HAPI_LOOKBACK_OPEN && time->now_ns >= w->to_ns) {
    w->phase = HAPI_LOOKBACK_GOING;
  }
  if (w->phase == HAPI_LOOKBACK_GOING && !w->spoilt) {
    double seconds = window_budget(cycle->config, time->spare_s);
    w->spoilt = hapi_lookback_run(w, cycle, world, time->own_iterations, seconds) < HAP_OK ||
                window_is_too_costly(w, cycle->config, time->spare_s);
  }
  return w->phase == HAPI_LOOKBACK_GOING && (w->spoilt || w->rows.next >= w->rows.count) &&
         window_end(w, cycle, out);
}
