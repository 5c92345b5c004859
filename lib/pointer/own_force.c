/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "pointer/own_force.h"

#include <math.h>

#include "base/assert.h"
#include "base/vec.h"

/* The forces that a hand can be given without contact. x is the way from the target to where the
 * force acts on the pointer, v the velocity along it, s the length of x.
 *
 *   spring     -k x - d v
 *   viscous    -b v. A device of mass m stands still under it for b up to about m / age, where age
 *              is how old the velocity is when the force acts: HAPI_SAFETY_OWN_DAMPING of that is
 *              what a setup may have (lib/haptic/own_list.c).
 *   magnet     from the potential -U (1 - u^2)^2, u = s / range: the force U 4 u (1 - u^2) / range
 *              begins at 0, is greatest at u = 1 / sqrt(3), and ends at 0 without an edge. On a
 *              closed way it does no work.
 *   detents    from the potential -strength pitch / (2 pi) cos(2 pi s / pitch)
 *   vibration  strength x envelope x sine, of the time alone: a late tick does not shift it
 *   call       what the application said in this tick */

/* Of x whole turns, to 1e-12. The tick has no mathematics library: a replay on another machine has
 * the same digits. */
static double sine_of_turns(double x)
{
  double r = x - floor(x + 0.5);
  r = r > 0.25 ? 0.5 - r : r < -0.25 ? -0.5 - r : r;
  double a = 2.0 * M_PI * r;
  double a2 = a * a;
  double sum = 1.0;
  for (int k = 17; k > 1; k -= 2) {
    sum = 1.0 - sum * a2 / (double)(k * (k - 1));
  }
  return a * sum;
}

/* ---- where it is ---- */

/* The way from the target, or a velocity: what the target makes of it. */
static void target_part(const hapi_force_setup *setup, const double axis[3], double v[3])
{
  double along = hapi_v3_dot(v, axis);
  if (setup->target == HAP_FORCE_LINE) {
    hapi_v3_madd(v, -along, axis, v);
  } else if (setup->target == HAP_FORCE_PLANE) {
    hapi_v3_scale(along, axis, v);
  }
}

/* Arm, way from the origin and velocity of the point on which it acts; world axes. */
typedef struct own_place {
  double axis[3];
  double arm[3];
  double way[3];
  double velocity[3];
} own_place;

void hapi_own_force_arm(const hapi_force_setup *setup, const hapi_pointer *pointer, double out[3])
{
  hapi_quat_rotate(pointer->handle.quat, setup->point, out);
}

/* As a body sees it that the force is bound to: the target goes with the body. */
static void own_find_from(const hapi_force_setup *setup, const hapi_own_frame *body,
                          const double point[3], own_place *io)
{
  const double *q = body->pose.quat_wxyz;
  double origin[3];
  double arm[3];
  double swing[3];
  hapi_quat_rotate(q, setup->axis, io->axis);
  hapi_quat_rotate(q, setup->origin, origin);
  hapi_v3_sub(point, body->pose.position, arm);
  hapi_v3_sub(arm, origin, io->way);
  hapi_v3_cross(body->twist.angular, arm, swing);
  hapi_v3_sub(io->velocity, swing, io->velocity);
  hapi_v3_sub(io->velocity, body->twist.linear, io->velocity);
}

static void own_find(const hapi_own_source *source, const hapi_pointer *p, own_place *out)
{
  const hapi_force_setup *setup = source->setup;
  const hapi_pointer_handle *hand = &p->handle;
  double point[3];
  double swing[3];
  hapi_own_force_arm(setup, p, out->arm);
  hapi_v3_add(hand->position, out->arm, point);
  hapi_v3_cross(hand->spin, out->arm, swing);
  hapi_v3_add(hand->velocity, swing, out->velocity);
  if (source->body != NULL) {
    own_find_from(setup, source->body, point, out);
    return;
  }
  hapi_v3_copy(setup->axis, out->axis);
  hapi_v3_sub(point, setup->origin, out->way);
}

/* ---- kinds ---- */

static void magnet_force(const hapi_force_setup *setup, const double way[3], double out[3])
{
  double share = hapi_magnet_share(hapi_v3_dot(way, way), setup->range);
  hapi_v3_scale(-setup->strength * share, way, out);
}

static double vibration_envelope(const hapi_force_setup *setup, double seconds)
{
  if (seconds < setup->wave.attack_s) {
    return seconds / setup->wave.attack_s;
  }
  double held = seconds - setup->wave.attack_s;
  if (held <= setup->wave.hold_s) {
    return 1.0;
  }
  double left = setup->wave.hold_s + setup->wave.decay_s - held;
  return left > 0.0 ? left / setup->wave.decay_s : 0.0;
}

/* Straight lines between the samples, and from the last one to the first. */
static double sample_at(const hapi_force_setup *setup, const float *samples, double seconds)
{
  double count = setup->wave.sample_count;
  double turns = seconds * setup->wave.sample_hz / count;
  double at = (turns - floor(turns)) * count;
  uint32_t first = (uint32_t)at;
  first = first < setup->wave.sample_count ? first : 0;
  uint32_t next = first + 1 < setup->wave.sample_count ? first + 1 : 0;
  double share = at - floor(at);
  return (1.0 - share) * (double)samples[first] + share * (double)samples[next];
}

static double vibration_force(const hapi_force_setup *setup, const float *samples, double seconds)
{
  double wave = samples != NULL && setup->wave.sample_count > 0
                    ? sample_at(setup, samples, seconds)
                    : sine_of_turns(setup->wave.hz * seconds);
  return setup->strength * vibration_envelope(setup, seconds) * wave;
}

static void axes_of_hand(const hapi_force_setup *setup, const hapi_pointer *p, hap_wrench *io)
{
  if (setup->frame == HAP_FORCE_POINTER) {
    const double *q = p->handle.quat;
    const hap_wrench w = *io;
    hapi_quat_rotate(q, w.force, io->force);
    hapi_quat_rotate(q, w.torque, io->torque);
  }
}

void hapi_own_force_value(const hapi_own_source *source, const hapi_pointer *pointer,
                          double seconds, hap_wrench *out)
{
  const hapi_force_setup *setup = source->setup;
  own_place at;
  double moment[3];
  *out = (hap_wrench){{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  own_find(source, pointer, &at);
  target_part(setup, at.axis, at.velocity);
  double along = hapi_v3_dot(at.way, at.axis);
  target_part(setup, at.axis, at.way);
  switch ((hap_force_kind)setup->kind) {
    case HAP_FORCE_CONSTANT:
      hapi_v3_copy(setup->force, out->force);
      hapi_v3_copy(setup->torque, out->torque);
      axes_of_hand(setup, pointer, out);
      break;
    case HAP_FORCE_WEIGHT:
      hapi_v3_copy(setup->force, out->force);
      break;
    case HAP_FORCE_SPRING:
      hapi_v3_scale(-setup->stiffness, at.way, out->force);
      hapi_v3_madd(out->force, -setup->damping, at.velocity, out->force);
      break;
    case HAP_FORCE_VISCOUS:
      hapi_v3_scale(-setup->damping, at.velocity, out->force);
      break;
    case HAP_FORCE_MAGNET:
      magnet_force(setup, at.way, out->force);
      break;
    case HAP_FORCE_DETENTS:
      hapi_v3_scale(-setup->strength * sine_of_turns(along / setup->pitch), at.axis, out->force);
      break;
    case HAP_FORCE_VIBRATION:
      hapi_v3_scale(vibration_force(setup, source->samples, seconds), setup->axis, out->force);
      axes_of_hand(setup, pointer, out);
      break;
    case HAP_FORCE_CALL:
      *out = *source->called;
      break;
  }
  hapi_v3_cross(at.arm, out->force, moment);
  hapi_v3_add(out->torque, moment, out->torque);
}

bool hapi_own_force_follows(const hapi_force_setup *setup)
{
  return setup->kind == HAP_FORCE_SPRING || setup->kind == HAP_FORCE_VISCOUS ||
         setup->kind == HAP_FORCE_MAGNET || setup->kind == HAP_FORCE_DETENTS ||
         (setup->kind == HAP_FORCE_CALL && setup->stiffness > 0.0);
}

double hapi_own_force_damping(const hapi_force_setup *setup)
{
  bool damps = setup->kind == HAP_FORCE_SPRING || setup->kind == HAP_FORCE_VISCOUS;
  return damps ? setup->damping : 0.0;
}

double hapi_own_force_stiffness(const hapi_force_setup *setup)
{
  switch ((hap_force_kind)setup->kind) {
    case HAP_FORCE_SPRING:
    case HAP_FORCE_CALL:
      return setup->stiffness;
    case HAP_FORCE_MAGNET: /* at its middle */
      return HAPI_MAGNET_PEAK * setup->strength / setup->range;
    case HAP_FORCE_DETENTS:
      return 2.0 * M_PI * setup->strength / setup->pitch;
    case HAP_FORCE_CONSTANT:
    case HAP_FORCE_VISCOUS:
    case HAP_FORCE_WEIGHT:
    case HAP_FORCE_VIBRATION:
      return 0.0;
  }
  return 0.0;
}
