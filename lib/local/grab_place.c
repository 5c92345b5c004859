/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "local/grab_place.h"

#include <math.h>
#include <string.h>

#include "base/assert.h"
#include "base/pose.h"
#include "base/safety.h"
#include "base/vec.h"
#include "pointer/coupling.h"
#include "pointer/proxy.h"

/* A grab is a spring and damper between the pointer and a place of the body: to all sides, and
 * where the device gives torque also against turning. The place is where the pointer was when it
 * took hold. Nothing of it may leap:
 *
 *   share   of the spring, from 0 to 1 in RAMP_IN_S; likewise back
 *   place   of a pose that was asked for: it begins at the pointer and goes there at GRAB_SPEED
 *   leaps   of pointer or body, by no motion: the place goes with them, the force stays as it was,
 *           and the place comes back at GRAB_SPEED
 *   gaps    between ticks, in which a device went on and bodies did not: likewise
 *   grip    a spring goes no farther than to max_force; what is more slips, and comes back */

#define STIFFER_THAN_PROXY 100.0 /* times the coupling's: 1 % softer in series */

static const hapi_local_body *grab_find_body(const hapi_bodies *bodies, uint64_t birth,
                                             uint32_t *out)
{
  for (uint32_t i = 0; i < bodies->live_count; ++i) {
    if (bodies->of[bodies->live[i]].given.birth == birth) {
      *out = bodies->live[i];
      return &bodies->of[bodies->live[i]];
    }
  }
  return NULL;
}

/* Whether its body is in the model, perhaps by another number. */
static bool grab_has_body(const hapi_bodies *bodies, hapi_grab *g)
{
  hapi_grab_hold *hold = &g->hold;
  const hapi_local_body *body = &bodies->of[hold->body];
  if (body->live && body->generation == hold->generation && body->given.birth == g->setup.birth) {
    return true;
  }
  body = grab_find_body(bodies, g->setup.birth, &hold->body);
  if (body != NULL) {
    hold->generation = body->generation;
    hold->epoch = body->epoch + 1; /* as one that was put there */
  }
  return body != NULL;
}

/* Contacts with the body come in again as deep ones do. */
static void grab_free_contacts(const hapi_touches *touches, uint32_t pointer, uint32_t body)
{
  for (uint32_t i = 0; i < touches->count; ++i) {
    hapi_local_contact *c = &touches->of[i];
    if (c->pointer != pointer || c->body != body) {
      continue;
    }
    c->seen = c->ball.known = false;
    if (c->tool != 0) {
      hapi_tool_pair *pair = &touches->tool.pairs[touches->tool.tools[c->tool - 1].pair];
      pair->seen = pair->sided = false;
      pair->found = 0;
    }
  }
}

static void grab_end(hapi_pointer *p, const hapi_touches *touches, uint32_t index,
                     hap_grab_end reason)
{
  hapi_grab *g = &p->grab;
  if (hapi_grab_acts(g)) {
    grab_free_contacts(touches, index, g->hold.body);
  }
  g->phase = HAPI_GRAB_NONE;
  g->ended = (uint32_t)reason;
  g->share = 0.0;
  memset(&g->pull, 0, sizeof g->pull);
}

static void turn_into_body(const hapi_local_body *body, const double quat[4], double out[4])
{
  const double *q = body->pose.quat_wxyz;
  const double back[4] = {q[0], -q[1], -q[2], -q[3]};
  hapi_quat_multiply(back, quat, out);
  hapi_quat_normalize(out);
}

static void grab_begin(hapi_pointer *p, const hapi_local_body *body, uint32_t slot)
{
  hapi_grab *g = &p->grab;
  hapi_grab_hold *hold = &g->hold;
  memset(hold, 0, sizeof *hold);
  memset(&g->ledger, 0, sizeof g->ledger);
  hold->body = slot;
  hold->generation = body->generation;
  hold->epoch = body->epoch;
  hapi_pose_unpoint(body->pose.position, body->pose.quat_wxyz, p->pose.position, hold->place);
  turn_into_body(body, p->pose.quat_wxyz, hold->turn);
  hapi_v3_copy(g->setup.at_pose != 0 ? g->setup.place : hold->place, hold->asked);
  memcpy(hold->asked_turn, g->setup.at_pose != 0 ? g->setup.turn : hold->turn,
         sizeof hold->asked_turn);
  hapi_v3_copy(p->pose.position, hold->at);
  memcpy(hold->at_turn, p->pose.quat_wxyz, sizeof hold->at_turn);
  g->tag = body->given.tag;
  ++g->holds;
  g->phase = HAPI_GRAB_HOLDS;
  g->share = 0.0;
}

/* Whether the application has asked once more for what is held. */
static bool grab_is_same(const hapi_grab *g)
{
  hapi_grab_setup wanted = g->wanted;
  wanted.serial = g->setup.serial;
  return memcmp(&wanted, &g->setup, sizeof wanted) == 0;
}

/* False: it holds nothing in this tick. */
static bool grab_step(hapi_pointer *p, const hapi_bodies *bodies, const hapi_touches *touches,
                      const hapi_tick_facts *facts, uint32_t index)
{
  hapi_grab *g = &p->grab;
  double step = facts->period / HAPI_SAFETY_RAMP_IN_S;
  uint32_t slot = HAPI_SLOT_NONE;
  if (g->setup.serial != g->wanted.serial && g->phase != HAPI_GRAB_LEAVES) {
    if (hapi_grab_acts(g) && grab_is_same(g)) {
      g->setup.serial = g->wanted.serial;
    } else if (hapi_grab_acts(g)) {
      g->phase = HAPI_GRAB_LEAVES;
    } else {
      g->setup = g->wanted;
      g->phase = g->setup.birth != 0 ? HAPI_GRAB_WAITS : HAPI_GRAB_NONE;
      g->waited_s = 0.0;
    }
  }
  if (g->phase == HAPI_GRAB_WAITS) {
    const hapi_local_body *body = grab_find_body(bodies, g->setup.birth, &slot);
    g->waited_s += facts->period;
    if (body != NULL) {
      grab_begin(p, body, slot);
    } else if (g->waited_s > HAPI_SAFETY_GRAB_WAIT_S) {
      grab_end(p, touches, index, HAP_GRAB_GONE);
    }
  }
  if (hapi_grab_acts(g) && !grab_has_body(bodies, g)) {
    grab_end(p, touches, index, HAP_GRAB_GONE);
  }
  if (g->phase == HAPI_GRAB_HOLDS) {
    g->share = fmin(g->share + step, 1.0);
  } else if (g->phase == HAPI_GRAB_LEAVES) {
    g->share -= step;
    if (g->share <= 0.0) {
      grab_end(p, touches, index, HAP_GRAB_RELEASED);
    }
  }
  return hapi_grab_acts(g);
}

/* ---- the place ---- */

/* The world moved by no motion: the spring is as it was. */
static void place_keep(hapi_grab_hold *hold, const hapi_pointer *p, const hapi_local_body *body)
{
  double at[3];
  hapi_v3_sub(p->pose.position, hold->way, at);
  hapi_pose_unpoint(body->pose.position, body->pose.quat_wxyz, at, hold->place);
  turn_into_body(body, p->pose.quat_wxyz, hold->turn);
}

/* As over missed ticks the springs of proxies do. */
static void place_catch_up(hapi_grab_hold *hold, const hapi_pointer *p, const hapi_local_body *body)
{
  double way[3];
  double turn[3];
  hapi_v3_sub(p->pose.position, hold->at, way);
  hapi_quat_unrotate(body->pose.quat_wxyz, way, way);
  hapi_v3_madd(hold->place, p->device.stood, way, hold->place);
  hapi_proxy_turn_between(hold->at_turn, p->pose.quat_wxyz, turn);
  hapi_quat_unrotate(body->pose.quat_wxyz, turn, turn);
  hapi_proxy_turn_by(hold->turn, turn, p->device.stood);
}

static void place_return(hapi_grab_hold *hold, double seconds)
{
  double way[3];
  double turn[3];
  hapi_v3_sub(hold->asked, hold->place, way);
  double far = hapi_v3_norm(way);
  double share = far > 0.0 ? fmin(HAPI_SAFETY_GRAB_SPEED * seconds / far, 1.0) : 0.0;
  hapi_v3_madd(hold->place, share, way, hold->place);
  hapi_proxy_turn_between(hold->turn, hold->asked_turn, turn);
  double angle = hapi_v3_norm(turn);
  if (angle > HAPI_SAFETY_GRAB_SPIN * seconds) {
    hapi_v3_scale(HAPI_SAFETY_GRAB_SPIN / angle, turn, turn);
    hapi_proxy_turn_by(hold->turn, turn, seconds);
  } else {
    memcpy(hold->turn, hold->asked_turn, sizeof hold->turn);
  }
}

/* From the body's place to the pointer. */
static void place_measure(const hapi_grab_hold *hold, const hapi_pointer *p,
                          const hapi_local_body *body, double way[3], double turn[3])
{
  double point[3];
  double quat[4];
  hapi_pose_point(body->pose.position, body->pose.quat_wxyz, hold->place, point);
  hapi_v3_sub(p->pose.position, point, way);
  hapi_quat_multiply(body->pose.quat_wxyz, hold->turn, quat);
  hapi_proxy_turn_between(quat, p->pose.quat_wxyz, turn);
}

/* ---- the spring ---- */

static double or_else(double asked, double otherwise)
{
  return asked > 0.0 ? asked : otherwise;
}

/* As stiff as the coupling allows. */
static double stiffness_rigid(const hapi_pointer *p)
{
  if (p->coupling.kind == HAP_COUPLING_PROXY && p->coupling.stiffness > 0.0) {
    return STIFFER_THAN_PROXY * p->coupling.stiffness; /* which is in series */
  }
  return p->coupling.hold_known ? p->coupling.hold : p->surface.stiffness;
}

/* Half of the critical one: what hangs on a hand that stands comes to rest soon. */
static double damping_of(double asked, double most, double stiffness, double inertia)
{
  return fmin(or_else(asked, sqrt(stiffness * inertia)), most);
}

/* A driven body has a damping of k T / 2. This makes the force that of the middle of the tick in
 * which it is held. An undamped spring gives k (v T)^2 / 2 too much in each tick. */
static void pull_stiffen(hapi_pointer *p, const hapi_local_body *body, double period)
{
  hapi_grab *g = &p->grab;
  hapi_grab_pull *pull = &g->pull;
  const hapi_grab_setup *setup = &g->setup;
  const double *i = body->given.inertia;
  double arm = HAPI_GRIP_ARM * p->device.motion_scale;
  bool driven = (body->flags & HAPI_BODY_DRIVEN) != 0;
  bool turns = setup->turns == HAP_GRAB_TURNS && p->device.turns && p->device.feels_torque;
  double mass = fmax(body->given.mass, body->given.held_mass);
  double inertia = (i[0] + i[4] + i[8]) / 3.0 + mass * hapi_v3_dot(g->hold.place, g->hold.place);
  pull->stiffness = or_else(setup->stiffness, stiffness_rigid(p));
  pull->turn_stiffness = turns ? or_else(setup->turn_stiffness, arm * arm * pull->stiffness) : 0.0;
  double half = 0.5 * period;
  if (driven) {
    mass = half * half * pull->stiffness;
    inertia = half * half * pull->turn_stiffness;
  }
  pull->damping = damping_of(setup->damping, setup->damping_most, pull->stiffness, mass);
  pull->turn_damping = turns ? damping_of(setup->turn_damping, arm * arm * setup->damping_most,
                                          pull->turn_stiffness, inertia)
                             : 0.0;
}

/* Of a spring that may not pull harder than most. */
static void way_shorten(double stiffness, double most, double io[3])
{
  if (stiffness > 0.0) {
    (void)hapi_v3_shorten(io, most / stiffness);
  }
}

/* World: what the hand can be given. */
static void pull_bound(hapi_pointer *p)
{
  hapi_grab *g = &p->grab;
  double scale = p->device.force_scale;
  double turn_scale = p->device.motion_scale > 0.0 ? scale / p->device.motion_scale : 0.0;
  double force = scale > 0.0 ? p->device.limits.max_force / scale : p->device.limits.max_force;
  double torque =
      turn_scale > 0.0 ? p->device.limits.max_torque / turn_scale : p->device.limits.max_torque;
  way_shorten(g->pull.stiffness, or_else(g->setup.max_force, force), g->pull.way);
  way_shorten(g->pull.turn_stiffness, or_else(g->setup.max_torque, torque), g->pull.turn);
}

static double pull_energy(const hapi_grab_pull *pull)
{
  return 0.5 * (pull->stiffness * hapi_v3_dot(pull->way, pull->way) +
                pull->turn_stiffness * hapi_v3_dot(pull->turn, pull->turn));
}

static void grab_place(hapi_pointer *p, const hapi_local_body *body, const hapi_tick_facts *facts)
{
  hapi_grab *g = &p->grab;
  hapi_grab_hold *hold = &g->hold;
  hapi_grab_pull *pull = &g->pull;
  if (body->epoch != hold->epoch || p->device.jumped) {
    place_keep(hold, p, body);
    hold->epoch = body->epoch;
  } else if (p->device.stood > 0.0 && !p->proxied) {
    place_catch_up(hold, p, body);
  }
  pull_stiffen(p, body, facts->period);
  place_measure(hold, p, body, pull->way, pull->turn);
  pull_bound(p);
  double before = pull_energy(pull);
  place_return(hold, facts->period);
  place_measure(hold, p, body, pull->way, pull->turn);
  hapi_v3_copy(pull->way, hold->way);
  hapi_v3_copy(p->pose.position, hold->at);
  memcpy(hold->at_turn, p->pose.quat_wxyz, sizeof hold->at_turn);
  pull_bound(p);
  g->ledger.moved = g->share * (pull_energy(pull) - before);
  hapi_pose_point(body->pose.position, body->pose.quat_wxyz, hold->place, pull->point);
  pull->stiffness *= g->share;
  pull->damping *= g->share;
  pull->turn_stiffness *= g->share;
  pull->turn_damping *= g->share;
}

void hapi_grabs_place(hapi_pointers *pointers, const hapi_bodies *bodies,
                      const hapi_touches *touches, const hapi_tick_facts *facts)
{
  bool has_rows = facts->model == HAP_MODEL_CONTACT || facts->model == HAP_MODEL_SINGLE;
  pointers->grabs = false;
  for (uint32_t i = 0; i < pointers->high; ++i) {
    hapi_pointer *p = &pointers->of[i];
    hapi_grab *g = &p->grab;
    if (!g->any || p->generation == 0) {
      continue;
    }
    bool refused = p->rigid || !has_rows;
    if (facts->faulted || refused) {
      g->setup = g->wanted;
      if (g->phase != HAPI_GRAB_NONE) {
        grab_end(p, touches, i, refused ? HAP_GRAB_REFUSED : HAP_GRAB_FAULT);
      }
    } else if (grab_step(p, bodies, touches, facts, i)) {
      hapi_pointer_feel(p, hapi_wish(facts->wishes, HAP_EFFECT_TORQUE), false);
      grab_place(p, &bodies->of[g->hold.body], facts);
    }
    g->any = g->phase != HAPI_GRAB_NONE || g->setup.serial != g->wanted.serial;
    pointers->grabs = pointers->grabs || g->any;
  }
}
