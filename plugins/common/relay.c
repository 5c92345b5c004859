/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The tick's side, and what any thread may do: part of the library of the pure tick, whose symbols
 * a test looks at. */

#include <string.h>

#include "base/pose.h"
#include "base/safety.h"
#include "base/vec.h"
#include "plugins/common/relay.h"

_Static_assert(ATOMIC_BOOL_LOCK_FREE == 2, "zero is called from signal handlers");
_Static_assert(ATOMIC_INT_LOCK_FREE == 2, "a tick must not lock");

static atomic_bool process_leaves;

bool hapi_relay_is_leaving(void)
{
  return atomic_load(&process_leaves);
}

void hapi_relay_leave(void)
{
  atomic_store(&process_leaves, true);
}

bool hapi_relay_is_zero(const hap_wrench *wrench)
{
  bool zero = true;
  for (int i = 0; i < 3; ++i) {
    zero = zero && wrench->force[i] == 0.0 && wrench->torque[i] == 0.0;
  }
  return zero;
}

/* ---- causes ---- */

void hapi_relay_set_cause(hapi_relay *relay, int cause)
{
  atomic_store(&relay->cause, cause);
  if (cause != HAPI_RELAY_WELL) {
    atomic_store(&relay->last, cause);
  }
}

void hapi_relay_set_doubt(hapi_relay *relay, int cause)
{
  atomic_store(&relay->doubt, cause);
}

int hapi_relay_cause_now(const hapi_relay *relay)
{
  return atomic_load(&relay->cause);
}

int hapi_relay_cause_last(const hapi_relay *relay)
{
  return atomic_load(&relay->last);
}

bool hapi_relay_is_resting(const hapi_relay *relay)
{
  return atomic_load(&relay->resting);
}

/* ---- read ---- */

/* As it was, carried on from the age on at which it is doubted. */
static void sample_tell(const hapi_relay *relay, const hapi_relay_told *told, double age,
                        hap_device_input *out)
{
  hap_twist twist = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  double carried = hapi_min(hapi_max(age - relay->settings.stale, 0.0), HAPI_SAFETY_CARRY_S);
  hapi_v3_copy(told->sample.velocity, twist.linear);
  hapi_v3_copy(told->spin, twist.angular);
  out->pose = told->sample.pose;
  if (carried > 0.0) {
    hapi_pose_move(&out->pose, &twist, carried);
  }
  out->twist = twist;
  out->buttons = told->sample.buttons;
}

static void note_silence(hapi_relay *relay)
{
  int doubt = atomic_load(&relay->doubt);
  atomic_store(&relay->last, doubt != HAPI_RELAY_WELL ? doubt : HAPI_RELAY_SILENT);
}

hap_status hapi_relay_read(hapi_relay *relay, int64_t time_ns, hap_device_input *out)
{
  hapi_relay_tick *tick = &relay->tick;
  if (!tick->running) {
    return HAP_ERROR_STATE;
  }
  tick->begun = hapi_triple_take(&relay->sample_places) || tick->begun;
  if (atomic_load(&relay->cause) != HAPI_RELAY_WELL) {
    return HAP_ERROR_DEVICE;
  }
  const hapi_relay_told *told = &relay->samples[hapi_triple_front(&relay->sample_places)];
  double age = 1e-9 * (double)(time_ns - (tick->begun ? told->sample.stamp_ns : tick->start_ns));
  if (!tick->begun || age > relay->settings.lost) {
    note_silence(relay);
    return HAP_ERROR_DEVICE;
  }
  sample_tell(relay, told, age, out);
  if (age > relay->settings.stale) {
    note_silence(relay);
    return HAP_STALE;
  }
  return HAP_OK;
}

/* ---- write ---- */

hap_status hapi_relay_write(hapi_relay *relay, const hap_wrench *wanted, hap_wrench *reached)
{
  if (!relay->tick.running) {
    return HAP_ERROR_STATE;
  }
  if (!hapi_finite(wanted->force, 3) || !hapi_finite(wanted->torque, 3)) {
    hapi_relay_zero(relay);
    return HAP_ERROR_ARGUMENT;
  }
  if (atomic_load(&relay->cause) != HAPI_RELAY_WELL) {
    return HAP_ERROR_DEVICE;
  }
  hap_wrench *command = &relay->commands[hapi_triple_back(&relay->command_places)];
  *command = *wanted;
  bool shortened = hapi_v3_shorten(command->force, relay->settings.max_force);
  bool eased = hapi_v3_shorten(command->torque, relay->settings.max_torque);
  relay->tick.held = *command;
  *reached = *command;
  hapi_triple_publish(&relay->command_places);
  /* Last, so that a zero that comes in between is taken as one from before this write. */
  atomic_store(&relay->zeroed, hapi_relay_is_leaving());
  return shortened || (eased && relay->settings.max_torque > 0.0) ? HAP_SATURATED : HAP_OK;
}

void hapi_relay_zero(hapi_relay *relay)
{
  atomic_store(&relay->zeroed, true);
}

void hapi_relay_held(const hapi_relay *relay, hap_wrench *out)
{
  memset(out, 0, sizeof *out);
  if (!relay->tick.running) {
    *out = relay->carrier.sent;
  } else if (!atomic_load(&relay->zeroed)) {
    *out = relay->tick.held;
  }
}
