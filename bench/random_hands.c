/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "bench/random_hands.h"

#include <math.h>
#include <string.h>

#include <hapode/grab.h>
#include <hapode/outputs.h>
#include <hapode/pointer.h>
#include <hapode/pointer_set.h>
#include <hapode/touches.h>

#include "bench/dice.h"

#define EVENTS 64

/* Up to most, and now and then what no call may take. */
static double dice_number(random_hands *h, double most)
{
  static const double odd[] = {-1.0, INFINITY, -INFINITY, NAN, 1e300, 1e-300, 0.0, -0.0};
  return dice_below(&h->dice, 64) == 0 ? odd[dice_below(&h->dice, 8)]
                                       : dice_between(&h->dice, 0.0, most);
}

static void pose_make(random_hands *h, double most, hap_pose *out)
{
  double angle = dice_between(&h->dice, -1.0, 1.0);
  dice_fill(&h->dice, -most, most, 3, out->position);
  memset(out->quat_wxyz, 0, sizeof out->quat_wxyz);
  out->quat_wxyz[0] = cos(angle);
  out->quat_wxyz[1 + dice_below(&h->dice, 3)] = sin(angle);
}

static void hash_word(random_hands *h, uint64_t word)
{
  uint64_t hash = (h->hash ^ word) * 0x9e3779b97f4a7c15u;
  h->hash = hash ^ (hash >> 29);
}

static void hash_doubles(random_hands *h, const double *values, int count)
{
  for (int i = 0; i < count; ++i) {
    uint64_t bits;
    memcpy(&bits, &values[i], sizeof bits);
    hash_word(h, bits);
  }
}

static void status_note(random_hands *h, hap_status status)
{
  hash_word(h, (uint64_t)(int64_t)status);
  h->bad += hap_status_name(status) == NULL;
}

void random_hands_begin(random_hands *h, uint64_t seed)
{
  memset(h, 0, sizeof *h);
  h->dice = (seed + 77) * 0x9e3779b97f4a7c15u;
  for (int i = 0; i < 8; ++i) {
    (void)dice_next(&h->dice);
  }
}

/* ---- own forces ---- */

/* Pushes against the way, turns a little, and is not finite where its user says so. */
static void hand_push(void *user, const hap_force_tick *tick, hap_wrench *out)
{
  const hap_force_hand *hand = tick->hands[tick->self];
  for (int i = 0; i < 3; ++i) {
    out->force[i] = user != NULL ? NAN : -2.0 * hand->twist.linear[i];
    out->torque[i] = 0.001 * (double)hand->touch_count;
  }
}

static void force_make(random_hands *h, dBodyID body, hap_force_def *out)
{
  static char wrong;
  hap_force_def_init(out, sizeof *out);
  out->kind = 1 + dice_below(&h->dice, HAP_FORCE_CALL);
  out->frame = dice_below(&h->dice, 3);
  out->target = dice_below(&h->dice, 3);
  out->body = out->frame == HAP_FORCE_BODY ? body : NULL;
  dice_fill(&h->dice, -0.1, 0.1, 3, out->origin);
  dice_fill(&h->dice, -1.0, 1.0, 3, out->axis);
  dice_fill(&h->dice, -0.02, 0.02, 3, out->point);
  dice_fill(&h->dice, -3.0, 3.0, 3, out->force);
  dice_fill(&h->dice, -0.05, 0.05, 3, out->torque);
  out->stiffness = dice_number(h, 2000.0);
  out->damping = dice_number(h, 10.0);
  out->mass = dice_number(h, 1.0);
  out->strength = dice_number(h, 5.0);
  out->range = dice_number(h, 0.1);
  out->pitch = dice_number(h, 0.02);
  out->vibration.hz = dice_number(h, 400.0);
  out->fade_in_s = dice_number(h, 0.1);
  out->max_power = dice_below(&h->dice, 2) == 0 ? HAP_FORCE_POWER_AUTO : dice_number(h, 2.0);
  if (out->kind == HAP_FORCE_CALL) {
    out->call = hand_push;
    out->user = dice_below(&h->dice, 16) == 0 ? &wrong : NULL;
    out->max_force = dice_number(h, 5.0);
  }
}

static void force_change(random_hands *h, hap_session *session, hap_pointer_id pointer,
                         dBodyID body)
{
  hap_force_def def;
  hap_force_state state;
  uint32_t at = dice_below(&h->dice, RANDOM_FORCES);
  force_make(h, body, &def);
  if (h->forces[at].id.v == 0) {
    h->forces[at].pointer = pointer;
    hap_status status = hap_pointer_force_add(session, pointer, &def, &h->forces[at].id);
    status_note(h, status);
    h->forces[at].id.v = status < HAP_OK ? 0 : h->forces[at].id.v;
    return;
  }
  pointer = h->forces[at].pointer; /* may have left: then the force is not found */
  switch (dice_below(&h->dice, 3)) {
    case 0:
      status_note(h, hap_pointer_force_set(session, pointer, h->forces[at].id, &def));
      break;
    case 1:
      status_note(h,
                  hap_pointer_force_get(session, pointer, h->forces[at].id, &state, sizeof state));
      break;
    default:
      status_note(h, hap_pointer_force_remove(session, pointer, h->forces[at].id));
      h->forces[at].id.v = 0;
      break;
  }
}

/* ---- the others ---- */

static void settings_change(random_hands *h, hap_session *session, hap_pointer_id pointer)
{
  static const double wedge[4][3] = {
      {0.01, 0.0, 0.0}, {-0.01, 0.01, 0.0}, {-0.01, -0.01, 0.0}, {0.0, 0.0, 0.015}};
  hap_pointer_settings s;
  hap_pointer_settings_init(&s, sizeof s);
  s.mask = 1u << dice_below(&h->dice, 13); /* one bit is unknown */
  s.mask |= 1u << dice_below(&h->dice, 13);
  pose_make(h, 0.1, &s.pose_world_device);
  dice_fill(&h->dice, -0.3, 0.3, 3, s.twist_world_device.linear);
  dice_fill(&h->dice, -1.0, 1.0, 3, s.twist_world_device.angular);
  s.motion_scale = dice_number(h, 3.0);
  s.force_scale = dice_number(h, 2.0);
  s.stiffness = dice_number(h, 3000.0);
  s.damping = dice_number(h, 5.0);
  s.friction = dice_number(h, 1.0);
  s.max_force = dice_number(h, 10.0);
  s.max_torque = dice_number(h, 1.0);
  s.radius = dice_number(h, 0.02);
  s.hull_xyz = dice_below(&h->dice, 2) == 0 ? &wedge[0][0] : NULL;
  s.hull_points = s.hull_xyz != NULL ? 4 : 0;
  s.collide_bits = dice_below(&h->dice, 4) == 0 ? 0u : ~0u;
  s.coupling = (hap_coupling)dice_below(&h->dice, 6);
  s.coupling_stiffness = dice_number(h, 1000.0);
  status_note(h, hap_pointer_set(session, pointer, &s));
}

static void grab_change(random_hands *h, hap_session *session, hap_pointer_id pointer, dBodyID body)
{
  hap_grab_def def;
  hap_grab_def_init(&def, sizeof def);
  def.place = dice_below(&h->dice, 2);
  def.turns = dice_below(&h->dice, 2);
  pose_make(h, 0.05, &def.pose_body_pointer);
  def.stiffness = dice_below(&h->dice, 2) == 0 ? 0.0 : dice_number(h, 5000.0);
  def.damping = dice_below(&h->dice, 2) == 0 ? 0.0 : dice_number(h, 20.0);
  def.max_force = dice_below(&h->dice, 2) == 0 ? 0.0 : dice_number(h, 20.0);
  status_note(h, dice_below(&h->dice, 3) == 0
                     ? hap_pointer_release(session, pointer)
                     : hap_pointer_attach(session, pointer, body,
                                          dice_below(&h->dice, 4) == 0 ? NULL : &def));
}

static void outputs_change(random_hands *h, hap_session *session, hap_pointer_id pointer)
{
  hap_pointer_outputs o;
  hap_pointer_outputs_init(&o, sizeof o);
  o.leds = dice_below(&h->dice, 4);
  o.vibrators[0].amplitude = dice_number(h, 1.0);
  o.vibrators[0].frequency = dice_number(h, 300.0);
  for (int i = 0; i < 2; ++i) {
    o.axes[i] = (hap_axis_push){.force = dice_number(h, 5.0),
                                .stiffness = dice_number(h, 500.0),
                                .target = dice_number(h, 0.1),
                                .damping = dice_number(h, 5.0),
                                .max_force = dice_number(h, 5.0),
                                .max_power = HAP_FORCE_POWER_AUTO};
  }
  status_note(h, hap_pointer_set_outputs(session, pointer, &o));
}

static void body_teleport(random_hands *h, hap_session *session, dBodyID body)
{
  hap_pose pose;
  pose_make(h, 0.3, &pose);
  if (body != NULL && hap_session_lock(session) == HAP_OK) {
    status_note(h, hap_session_teleport_body(session, body, &pose));
    (void)hap_session_unlock(session);
  }
}

void random_hands_change(random_hands *h, hap_session *session, hap_pointer_id pointer,
                         dBodyID body)
{
  switch (dice_below(&h->dice, 8)) {
    case 0:
    case 1:
      force_change(h, session, pointer, body);
      break;
    case 2:
      settings_change(h, session, pointer);
      break;
    case 3:
      status_note(h, hap_pointer_clutch(session, pointer, dice_below(&h->dice, 2) == 0));
      break;
    case 4:
    case 5:
      grab_change(h, session, pointer, body);
      break;
    case 6:
      outputs_change(h, session, pointer);
      break;
    default:
      body_teleport(h, session, body);
      break;
  }
}

void random_hands_ask(random_hands *h, hap_session *session, hap_pointer_id pointer)
{
  hap_touch touches[HAP_TOUCHES_MAX];
  hap_event events[EVENTS];
  hap_pointer_state state;
  size_t count = 0;
  status_note(
      h, hap_pointer_touches(session, pointer, touches, HAP_TOUCHES_MAX, sizeof *touches, &count));
  for (size_t i = 0; i < count; ++i) {
    hash_doubles(h, touches[i].force, 3);
  }
  count = 0;
  status_note(h, hap_session_events(session, events, EVENTS, sizeof *events, &count));
  for (size_t i = 0; i < count; ++i) {
    hash_word(h, events[i].kind);
    hash_doubles(h, &events[i].impulse, 1);
  }
  if (hap_pointer_get(session, pointer, &state, sizeof state) == HAP_OK) {
    const double *f = state.wrench.force;
    hash_doubles(h, f, 3);
    hash_word(h, state.held != NULL);
    h->bad += !(f[0] * f[0] + f[1] * f[1] + f[2] * f[2] < 1e12); /* N^2; not NaN */
  }
}
