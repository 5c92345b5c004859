/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "accuracy/lookback.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"
#include "base/clock.h"
#include "base/vec.h"
#include "sync/exchange.h"

/* The life of a window: what it keeps, what is noted while it is open, what comes out.
 * In going over it the reference of a tick is what ODE and the loop's tick of model SINGLE make of
 * it, with the bodies where they are by that reckoning. */

#define ITERATIONS 2         /* times those of the world: what they leave undone shows as well */
#define ITERATIONS_LEAST 200 /* where there is time for them */
#define RATE_HZ 1000.0       /* at least, of its steps */
#define APART_M 0.5          /* from the session's body: it would not know what is there */

/* ---- which geoms there still are ---- */

static bool window_see_geoms(hapi_lookback *w, dSpaceID space, uint32_t *count)
{
  int geoms = dSpaceGetNumGeoms(space);
  if (!hapi_index_reserve(&w->geoms, *count + (uint32_t)geoms)) {
    return false;
  }
  for (int i = 0; i < geoms; ++i) {
    dGeomID geom = dSpaceGetGeom(space, i);
    hapi_index_put(&w->geoms, hapi_index_address(geom), 0);
    ++*count;
    if (dGeomIsSpace(geom) && !window_see_geoms(w, (dSpaceID)geom, count)) {
      return false;
    }
  }
  return true;
}

static bool geom_is_there(const hapi_lookback *w, dGeomID geom)
{
  return hapi_index_get(&w->geoms, hapi_index_address(geom)) != HAPI_INDEX_NONE;
}

static bool window_find_geoms(hapi_lookback *w)
{
  const hapi_spaces *spaces = &w->world->spaces;
  uint32_t count = 0;
  hapi_index_clear(&w->geoms);
  for (uint32_t i = 0; i < spaces->count; ++i) {
    if (!window_see_geoms(w, spaces->list[i].space, &count)) {
      return false;
    }
  }
  for (uint32_t i = 0; i < w->pairs.count; ++i) {
    w->pairs.list[i].there =
        geom_is_there(w, w->pairs.list[i].a) && geom_is_there(w, w->pairs.list[i].b);
  }
  for (uint32_t i = 0; i < w->touches.count; ++i) {
    w->touches.list[i].there =
        w->touches.list[i].geom != NULL && geom_is_there(w, w->touches.list[i].geom);
  }
  return true;
}

/* ---- contacts between bodies ---- */

static bool body_is_under_test(const hapi_test_set *test, dBodyID body)
{
  uint32_t known = hapi_bodies_find(&test->world->bodies, body);
  return known != HAPI_NONE && hapi_test_has(test, known);
}

/* What is not under test stands still. */
static void window_collide(hapi_lookback *w, const hapi_cycle *as_single)
{
  dJointGroupEmpty(w->test.world->contact_group);
  for (uint32_t i = 0; i < w->pairs.count; ++i) {
    const hapi_lookback_pair *pair = &w->pairs.list[i];
    if (!pair->there || !dGeomIsEnabled(pair->a) || !dGeomIsEnabled(pair->b)) {
      continue;
    }
    dReal boxes[2][6];
    dGeomGetAABB(pair->a, boxes[0]);
    dGeomGetAABB(pair->b, boxes[1]);
    if (!hapi_boxes_meet(boxes[0], boxes[1])) {
      continue;
    }
    dBodyID body_a = dGeomGetBody(pair->a);
    dBodyID body_b = dGeomGetBody(pair->b);
    body_a = body_is_under_test(&w->test, body_a) ? body_a : NULL;
    body_b = body_is_under_test(&w->test, body_b) ? body_b : NULL;
    bool awake =
        (body_a != NULL && dBodyIsEnabled(body_a)) || (body_b != NULL && dBodyIsEnabled(body_b));
    if (awake) {
      const hapi_touching touching = {{pair->a, pair->b}, {body_a, body_b}};
      dSurfaceParameters surface = pair->surface;
      w->counts.contacts_rejected +=
          hapi_world_make_contacts(w->test.world, as_single, &touching, &surface, false);
    }
  }
}

/* ---- steps ---- */

/* One that is no more is not to be stepped: ODE would abort the process. */
static bool window_is_sound(const hapi_lookback *w)
{
  for (uint32_t i = 0; i < w->bodies.count; ++i) {
    if (!hapi_pose_is_sound(w->test.world->bodies.entries[w->bodies.list[i].known].body)) {
      return false;
    }
  }
  return true;
}

/* Steps from a row to the next one. */
static int row_parts(double haptic_hz)
{
  return haptic_hz < RATE_HZ ? (int)ceil(RATE_HZ / haptic_hz - 1e-6) : 1;
}

/* as_single: the cycle as that of a session of model SINGLE at the reference's own rate. */
static bool row_go_over(hapi_lookback *w, const hapi_cycle *as_single, double haptic_hz,
                        uint32_t row)
{
  HAPI_ASSERT_INDEX(row, w->rows.count);
  uint32_t count = w->rows.pointers;
  int parts = row_parts(haptic_hz);
  double period =
      (row + 1 < w->rows.count ? 1e-9 * (double)(w->rows.times_ns[row + 1] - w->rows.times_ns[row])
                               : 1.0 / haptic_hz) /
      parts;
  for (int i = 0; i < parts; ++i) {
    const hapi_lookback_moment at = {
        .row = &w->rows.path[row * count],
        .next = row + 1 < w->rows.count ? &w->rows.path[(row + 1) * count] : NULL,
        .share = (double)i / parts,
        .later_s = i * period,
        .period = period};
    if (!hapi_lookback_feel(w, as_single->wishes, &at)) {
      return false;
    }
    /* What is felt is held until the next row. */
    for (uint32_t k = 0; k < w->rows.pointers; ++k) {
      double wrong[3];
      const double *felt = at.row[k].wrench.force;
      const double *right = hapi_lookback_felt(w, k);
      if (at.row[k].generation == 0) {
        continue;
      }
      hapi_v3_sub(felt, right, wrong);
      if (hapi_v3_dot(right, right) > 0.0 || hapi_v3_dot(felt, felt) > 0.0) {
        w->sums.wrong2 += hapi_v3_dot(wrong, wrong);
        w->sums.right2 += hapi_v3_dot(right, right);
        ++w->sums.touched;
      }
    }
    for (uint32_t k = 0; k < w->bodies.count; ++k) {
      dBodyID body = w->test.world->bodies.entries[w->bodies.list[k].known].body;
      const double *f = w->bodies.list[k].wrench;
      if (dBodyIsEnabled(body)) {
        dBodyAddForce(body, f[0], f[1], f[2]);
        dBodyAddTorque(body, f[3], f[4], f[5]);
      }
    }
    window_collide(w, as_single);
    ++w->counts.steps;
    hapi_springs_set(w->test.world->springs, period);
    dWorldQuickStep(w->test.world->ode.world, period);
    if (!window_is_sound(w)) {
      return false;
    }
  }
  return true;
}

static void window_put_states(hapi_lookback *w)
{
  hapi_snapshot states = {
      .bodies = w->bodies.states, .body_count = w->bodies.count, .seed = w->bodies.seed};
  hapi_snapshot_rewind(&states);
  for (uint32_t i = 0; i < w->bodies.count; ++i) {
    dBodySetForce(w->bodies.states[i].body, 0.0, 0.0, 0.0);
    dBodySetTorque(w->bodies.states[i].body, 0.0, 0.0, 0.0);
    if (w->bodies.states[i].enabled) {
      dBodyEnable(w->bodies.states[i].body);
    } else {
      dBodyDisable(w->bodies.states[i].body);
    }
  }
}

static void window_keep(hapi_lookback *w)
{
  hapi_snapshot states = {.bodies = w->bodies.states, .body_capacity = w->bodies.state_capacity};
  hapi_snapshot_clear(&states);
  for (uint32_t i = 0; i < w->bodies.count; ++i) {
    hapi_snapshot_add_body(&states, w->world->bodies.entries[w->bodies.list[i].known].body, NULL);
  }
  w->bodies.seed = states.seed;
}

static const hapi_body_state *window_end_of(const hapi_lookback *w, const hapi_lookback_body *body)
{
  for (uint32_t i = 0; i < w->ended.count; ++i) {
    if (w->ended.list[i].known == body->known && w->ended.list[i].birth == body->birth) {
      return &w->ended.states[i];
    }
  }
  return NULL;
}

/* Whether the reference of the window before ended when this one begins, and not too far from
 * where the session is. */
static bool window_can_chain(const hapi_lookback *w, double haptic_hz)
{
  double apart_s = 1e-9 * fabs((double)(w->rows.times_ns[0] - w->end_ns));
  bool good = w->end_ns != 0 && apart_s < 0.5 / haptic_hz;
  for (uint32_t i = 0; i < w->bodies.count && good; ++i) {
    const hapi_body_state *end = window_end_of(w, &w->bodies.list[i]);
    double apart[3] = {0.0};
    if (end != NULL) {
      hapi_v3_sub(end->position, w->bodies.states[i].position, apart);
    }
    good = hapi_v3_norm(apart) < APART_M;
  }
  return good;
}

/* Goes on from there; a body that was not part of it comes in as the session has it. */
static void window_chain(hapi_lookback *w, double haptic_hz)
{
  w->chained = window_can_chain(w, haptic_hz);
  w->chain_s = w->chained ? w->chain_s : 0.0;
  if (!w->chained) {
    hapi_lookback_hand_begin(&w->hand);
  }
  for (uint32_t i = 0; i < w->bodies.count && w->chained; ++i) {
    const hapi_body_state *end = window_end_of(w, &w->bodies.list[i]);
    if (end != NULL) {
      w->bodies.states[i] = *end;
      w->bodies.list[i].lag_ns = 0;
    }
  }
}

static bool window_go(hapi_lookback *w, int own_iterations, double seconds)
{
  const hapi_world *world = w->test.world;
  int64_t begin_ns = hapi_clock_now();
  int iterations = dWorldGetQuickStepNumIterations(world->ode.world);
  double haptic_hz = w->cycle->config->haptic_hz;
  bool good = true;
  hapi_physics_config config = *w->cycle->config;
  hapi_cycle as_single = *w->cycle;
  hapi_meant meant;
  config.haptic_hz = row_parts(haptic_hz) * haptic_hz;
  as_single.config = &config;
  as_single.model = HAP_MODEL_SINGLE; /* whose step this is */
  int more = ITERATIONS * own_iterations;
  more = !w->lean && more < ITERATIONS_LEAST ? ITERATIONS_LEAST : more;
  dWorldSetQuickStepNumIterations(world->ode.world, more);
  hapi_world_convert(world, hapi_step_ratio(&as_single), &meant);
  bool first = w->rows.next == 0;
  if (first) {
    window_chain(w, haptic_hz);
  }
  window_put_states(w);
  if (first) {
    /* Where the bodies were at the first row, of which some were kept a part of a tick before or
     * after. */
    for (uint32_t i = 0; i < w->bodies.count; ++i) {
      dBodyID body = w->bodies.states[i].body;
      double lag = 1e-9 * (double)w->bodies.list[i].lag_ns;
      const dReal *p = dBodyGetPosition(body);
      const dReal *v = dBodyGetLinearVel(body);
      dBodySetPosition(body, p[0] + lag * v[0], p[1] + lag * v[1], p[2] + lag * v[2]);
    }
  }
  while (good && w->rows.next < w->rows.count &&
         (seconds < 0.0 || 1e-9 * (double)(hapi_clock_now() - begin_ns) < seconds)) {
    good = row_go_over(w, &as_single, haptic_hz, w->rows.next++);
  }
  w->spent_s += 1e-9 * (double)(hapi_clock_now() - begin_ns);
  window_keep(w);
  dJointGroupEmpty(world->contact_group);
  hapi_world_restore(world, &meant);
  dWorldSetQuickStepNumIterations(world->ode.world, iterations);
  return good;
}

static hap_status window_enter(hapi_lookback *w, double step_s)
{
  hap_status status = hapi_test_begin(&w->test, w->world, step_s);
  for (uint32_t i = 0; i < w->bodies.count && status >= HAP_OK; ++i) {
    status = hapi_test_add_body(&w->test, w->bodies.list[i].known);
  }
  return status >= HAP_OK ? hapi_test_enter(&w->test) : status;
}

static hap_status window_run(hapi_lookback *w, int own_iterations, double seconds)
{
  if (!window_find_geoms(w)) {
    return HAP_ERROR_MEMORY;
  }
  hap_status status = window_enter(w, w->cycle->probe_step_s);
  if (status >= HAP_OK) {
    bool good = w->rows.count == 0 || window_go(w, own_iterations, seconds);
    status = good ? status : HAP_ERROR_STATE;
    hapi_test_leave(&w->test);
  }
  return status;
}

/* ---- the life of a window ---- */

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

static bool lookback_is_wanted(const hapi_lookback *w)
{
  return w->cycle->config->lookback_share > 0.0 && w->cycle->model != HAP_MODEL_SINGLE;
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

void hapi_lookback_ask(hapi_lookback *w, dGeomID a, dGeomID b, const dSurfaceParameters *surface)
{
  if (w->phase != HAPI_LOOKBACK_OPEN || w->spoilt) {
    return;
  }
  uint32_t body_a = hapi_bodies_find(&w->world->bodies, dGeomGetBody(a));
  uint32_t body_b = hapi_bodies_find(&w->world->bodies, dGeomGetBody(b));
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
    t->key = touch->is_tool ? hapi_tool_geom_key(w->near, touch->geom, touch->pointer) : 0;
  }
  t->mu = touch->mu;
  t->noted = true;
}

/* Of what is moved by its pose nobody knows any more where it was. */
static bool body_is_posed(const hapi_known_body *known)
{
  hap_twist rate;
  hapi_extent_twist(known, &rate);
  return known->posed && hapi_v3_norm(rate.linear) + hapi_v3_norm(rate.angular) > 0.0;
}

/* Of a geom without a body, which may have begun to move in the window. */
static bool geom_is_carried(const hapi_lookback *w, dGeomID geom)
{
  dBodyID carrier = hapi_carrier_of(&w->world->carriers, geom);
  uint32_t known = hapi_bodies_find(&w->world->bodies, carrier);
  return known != HAPI_NONE && body_is_posed(&w->world->bodies.entries[known]);
}

void hapi_lookback_note(hapi_lookback *w)
{
  if (w->phase != HAPI_LOOKBACK_OPEN) {
    return;
  }
  for (uint32_t i = 0; i < w->near->slots.contact_high; ++i) {
    const hapi_contact_slot *slot = &w->near->slots.contacts[i];
    const hapi_lookback_touch touch = {.geom = slot->geom,
                                       .pointer = slot->pointer,
                                       .generation = slot->pointer_generation,
                                       .is_tool = slot->is_tool,
                                       .mu = slot->said.mu};
    if (slot->phase == HAPI_SLOT_LIVE) {
      w->spoilt = w->spoilt || slot->said.feel != 0 || geom_is_carried(w, slot->geom);
      window_note_touch(w, w->cycle->config->capacity.contacts, &touch);
    }
  }
  if (w->cycle->model == HAP_MODEL_CONTACT) {
    /* Of model CONTACT, whose points of hulls have no slots. */
    uint32_t most = w->cycle->config->capacity.contacts;
    for (uint32_t i = 0; i < w->near->neighbors.hit_count; ++i) {
      const hapi_hit *hit = &w->near->neighbors.hits[i];
      const hapi_state_pointer *pointer = &hapi_state_pointers(w->cycle->state)[hit->pointer];
      const hapi_lookback_touch touch = {.geom = hit->geom,
                                         .pointer = hit->pointer,
                                         .generation = pointer->generation,
                                         .is_tool = true,
                                         .mu = hit->said.mu};
      w->spoilt = w->spoilt || hit->said.feel != 0;
      if (hit->tool_count > 0) {
        window_note_touch(w, most, &touch);
      }
    }
  }
}

/* The place of the pair whose contact the spring is of; HAPI_NONE: none that is near. */
static uint32_t spring_touch(const hapi_lookback *w, const hapi_state_spring *spring)
{
  const hapi_contact_slot *slot =
      spring->slot != HAPI_SLOT_NONE ? &w->near->slots.contacts[spring->slot] : NULL;
  if (slot != NULL && slot->generation != spring->generation) {
    return HAPI_NONE; /* another contact has its slot by now */
  }
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

static void window_take_springs(hapi_lookback *w)
{
  const hapi_state_spring *in = hapi_state_springs(w->cycle->state);
  w->springs.count = 0;
  if (!hapi_reserve((void **)&w->springs.list, &w->springs.capacity, 0,
                    w->cycle->state->spring_count, sizeof *w->springs.list)) {
    w->spoilt = true;
    return;
  }
  for (uint32_t i = 0; i < w->cycle->state->spring_count; ++i) {
    uint32_t touch = spring_touch(w, &in[i]);
    if (touch != HAPI_NONE && hapi_finite(in[i].stretch_body, 3) && hapi_finite(&in[i].turn, 1)) {
      w->springs.list[w->springs.count++] = (hapi_lookback_spring){.touch = touch, .in = in[i]};
    }
  }
}

/* ---- opening ---- */

static bool window_add_body(hapi_lookback *w, uint32_t known)
{
  HAPI_ASSERT_INDEX(known, w->world->bodies.high);
  const hapi_known_body *entry = &w->world->bodies.entries[known];
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
static double body_apart(const hapi_lookback *w, const hapi_known_body *known)
{
  const hapi_state_pointer *pointers = hapi_state_pointers(w->cycle->state);
  double least = HUGE_VAL;
  for (uint32_t i = 0; i < w->cycle->state->pointer_count; ++i) {
    if (pointers[i].generation != 0) {
      double d[3];
      hapi_v3_sub(dBodyGetPosition(known->body), pointers[i].pose.position, d);
      least = fmin(least, hapi_v3_norm(d) - pointers[i].extent - known->extent);
    }
  }
  return least;
}

/* Within a distance that takes no more than there is room for. */
static bool window_add_near(hapi_lookback *w)
{
  double reach = NEAR_M;
  for (int i = 0; i < REACHES; ++i, reach *= 0.7) {
    uint32_t count = 0;
    w->bodies.count = 0;
    bool good = true;
    for (uint32_t k = 0; k < w->world->bodies.high && count <= BODIES_MAX && good; ++k) {
      const hapi_known_body *known = &w->world->bodies.entries[k];
      if (known->body != NULL && body_apart(w, known) < reach) {
        good = !body_is_posed(known) && (++count > BODIES_MAX || window_add_body(w, k));
      }
    }
    if (!good || count <= BODIES_MAX) {
      return good;
    }
  }
  return false;
}

static bool window_add_jointed(hapi_lookback *w)
{
  for (uint32_t i = 0; i < w->bodies.count; ++i) {
    dBodyID body = w->world->bodies.entries[w->bodies.list[i].known].body;
    int joints = dBodyGetNumJoints(body);
    for (int k = 0; k < joints; ++k) {
      dJointID joint = dBodyGetJoint(body, k);
      for (int side = 0; side < 2 && dJointGetType(joint) != dJointTypeContact; ++side) {
        uint32_t other = hapi_bodies_find(&w->world->bodies, dJointGetBody(joint, side));
        if (other != HAPI_NONE && !window_has(w, other) && !window_add_body(w, other)) {
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

static int64_t ticks_ns(const hapi_lookback *w, double ticks)
{
  return (int64_t)(1e9 * ticks / w->cycle->config->haptic_hz);
}

void hapi_lookback_open(hapi_lookback *w, int64_t now_ns)
{
  double physics_hz = w->cycle->config->physics_hz;
  if (!lookback_is_wanted(w) || w->phase != HAPI_LOOKBACK_IDLE || w->cycle->state == NULL) {
    return;
  }
  double most = fmax(WINDOW_S, WINDOW_STEPS / physics_hz);
  w->seconds = w->seconds > 0.0 ? fmin(2.0 * w->seconds, most) : FIRST_STEPS / physics_hz;
  /* What the last window had is kept beside what this one will have. */
  hapi_lookback_bodies last = w->ended;
  w->ended = w->bodies;
  w->bodies = last;
  w->bodies.count = 0;
  /* Places of pairs that were not near while the last window was open are free again. */
  for (uint32_t i = 0; i < w->touches.count; ++i) {
    if (!w->touches.list[i].noted) {
      w->touches.list[i].geom = NULL;
    }
    w->touches.list[i].noted = false;
  }
  memset(w->hand.hull_of, 0, sizeof w->hand.hull_of);
  w->pairs.count = w->rows.count = w->rows.next = w->sums.touched = 0;
  w->rows.pointers = w->cycle->config->capacity.pointers;
  hapi_index_clear(&w->pairs.index);
  w->sums.wrong2 = w->sums.right2 = w->spent_s = 0.0;
  /* The loop's newest state is what its tick came to: the one after that goes on from it. */
  w->from_ns = w->cycle->model == HAP_MODEL_IMPULSE ? now_ns - ticks_ns(w, 0.5)
                                                    : w->cycle->state->now_ns + ticks_ns(w, 0.5);
  w->to_ns = now_ns + (int64_t)(1e9 * w->seconds);
  w->spoilt = !hapi_lookback_hand_ready(&w->hand, &w->cycle->config->capacity) ||
              !window_add_near(w) || !window_add_jointed(w) ||
              !hapi_reserve((void **)&w->bodies.states, &w->bodies.state_capacity, 0,
                            w->bodies.count, sizeof *w->bodies.states);
  if (!w->spoilt) {
    window_keep(w);
    /* A body of the loop is where the loop has it, any other where the world's step has left it. */
    for (uint32_t i = 0; i < w->bodies.count; ++i) {
      uint32_t index = w->world->bodies.entries[w->bodies.list[i].known].slot;
      const hapi_body_slot *slot = index != HAPI_NONE ? &w->near->slots.bodies[index] : NULL;
      bool loops = slot != NULL && w->cycle->model != HAP_MODEL_IMPULSE &&
                   (slot->loop_owned || (w->cycle->model == HAP_MODEL_ACCELERANCE && slot->pushed));
      w->bodies.list[i].lag_ns = loops ? -w->cycle->state->now_ns - ticks_ns(w, 1.0)
                                       : -now_ns; /* and the first row's time */
    }
  }
  w->phase = HAPI_LOOKBACK_OPEN;
  hapi_lookback_note(w);
  window_take_springs(w);
}

/* ---- while it is open ---- */

/* False: what it would feel is not reckoned here. */
static bool window_takes_kind(hapi_lookback *w, uint32_t index, const hapi_path_pointer *in)
{
  bool pushes = hapi_v3_dot(in->wrench.force, in->wrench.force) > 0.0;
  return in->generation == 0 ||
         (!(in->rigid != 0 && pushes) &&
          (in->is_tool == 0 ||
           hapi_lookback_hand_take_hull(&w->hand, w->cycle, index, in->generation)));
}

static void window_take_row(hapi_lookback *w, int64_t time_ns, const hapi_path_pointer *pointers)
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
    for (uint32_t i = 0; i < w->bodies.count; ++i) {
      w->bodies.list[i].lag_ns += time_ns;
    }
  }
  for (uint32_t i = 0; i < count; ++i) {
    w->spoilt = w->spoilt || !window_takes_kind(w, i, &pointers[i]);
  }
  w->rows.times_ns[w->rows.count] = time_ns;
  memcpy(&w->rows.path[w->rows.count * count], pointers, count * sizeof *w->rows.path);
  ++w->rows.count;
}

static void window_take_rows(hapi_lookback *w)
{
  hapi_path *path = hapi_exchange_path(w->cycle->config->exchange);
  int64_t time_ns;
  const hapi_path_pointer *pointers;
  while (hapi_path_look(path, &time_ns, &pointers)) {
    window_take_row(w, time_ns, pointers);
    hapi_path_let_go(path);
  }
}

/* All bodies are those that they were, and nobody else has moved one. */
static bool window_is_still_there(const hapi_lookback *w)
{
  for (uint32_t i = 0; i < w->bodies.count; ++i) {
    const hapi_known_body *known = &w->world->bodies.entries[w->bodies.list[i].known];
    if (known->body == NULL || known->rest->birth != w->bodies.list[i].birth) {
      return false;
    }
    if (w->phase == HAPI_LOOKBACK_OPEN && known->slot != HAPI_NONE) {
      const hapi_body_slot *slot = &w->near->slots.bodies[known->slot];
      if (slot->pose_changed || slot->velocity_changed) {
        return false;
      }
    }
  }
  return true;
}

/* ---- what comes out ---- */

/* True: *out is what the window says. */
static bool window_end(hapi_lookback *w, hapi_lookback_verdict *out)
{
  hapi_lookback_sums *sums = &w->sums;
  w->phase = HAPI_LOOKBACK_IDLE;
  w->end_ns = 0;
  if (w->spoilt) {
    ++w->counts.spoilt;
    return false;
  }
  /* The next window may go on where this one's reference has ended. */
  w->chain_s += 1e-9 * (double)(w->to_ns - w->from_ns);
  if (w->rows.count > 0 && w->chain_s < CHAIN_S) {
    w->end_ns = w->rows.times_ns[w->rows.count - 1] + ticks_ns(w, 1.0);
  }
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
static double window_budget(const hapi_lookback *w, double spare_s)
{
  const hapi_physics_config *config = w->cycle->config;
  return config->lockstep ? -1.0 : fmin(config->lookback_share / config->physics_hz, spare_s);
}

/* A world in which one step takes all of the time that there is: the figure would be long out of
 * date, and physics late. The next windows make do with less. */
static bool window_is_too_costly(hapi_lookback *w, double spare_s)
{
  bool dear = !w->cycle->config->lockstep && w->rows.next > 0 &&
              w->spent_s > DEAR * window_budget(w, spare_s) * (double)w->rows.next;
  w->lean = w->lean || dear;
  return dear;
}

bool hapi_lookback_follow(hapi_lookback *w, const hapi_lookback_time *time,
                          hapi_lookback_verdict *out)
{
  if (w->cycle->config->lookback_share <= 0.0) {
    return false;
  }
  window_take_rows(w);
  if (w->phase == HAPI_LOOKBACK_IDLE) {
    return false;
  }
  w->spoilt = w->spoilt || !lookback_is_wanted(w) || !window_is_still_there(w);
  if (w->phase == HAPI_LOOKBACK_OPEN && time->now_ns >= w->to_ns) {
    w->phase = HAPI_LOOKBACK_GOING;
  }
  if (w->phase == HAPI_LOOKBACK_GOING && !w->spoilt) {
    double seconds = window_budget(w, time->spare_s);
    w->spoilt = window_run(w, time->own_iterations, seconds) < HAP_OK ||
                window_is_too_costly(w, time->spare_s);
  }
  return w->phase == HAPI_LOOKBACK_GOING && (w->spoilt || w->rows.next >= w->rows.count) &&
         window_end(w, out);
}
