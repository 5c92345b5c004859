/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tick/own_forces.h"

#include <string.h>

#include "base/assert.h"
#include "base/safety.h"
#include "base/vec.h"
#include "pointer/own_force.h"

/* A force that is added comes in with a share that grows. One that is changed or removed must not
 * leap: the difference between what it gave in the last tick and what it gives now is added, less
 * and less, whatever is changed again meanwhile. So an application may move a spring at each of its
 * frames. */

/* What is given from now on is another thing. */
static void own_part(hapi_own_force *own)
{
  own->changed = true;
  own->before = (hapi_promise){.force = hapi_v3_norm(own->gives.force),
                               .torque = hapi_v3_norm(own->gives.torque)};
}

bool hapi_own_force_calls(const hapi_own_force *own)
{
  return own->setup.serial != 0 && own->setup.kind == HAP_FORCE_CALL && !own->leaves &&
         own->out == HAP_FORCE_IN;
}

void hapi_own_force_called(hapi_own_force *own, const hap_wrench *wrench, uint32_t out)
{
  HAPI_ASSERT(hapi_own_force_calls(own));
  own->called = *wrench;
  own->out = out;
  if (out != HAP_FORCE_IN) {
    own_part(own);
  }
}

void hapi_own_force_change(hapi_own_force *own, const hapi_force_setup *setup, const float *samples,
                           int64_t now_ns)
{
  bool other = setup->serial != own->setup.serial;
  own_part(own);
  own->changed = own->setup.serial != 0; /* what comes to an empty place fades in by its share */
  if (setup->serial == 0) {
    own->leaves = true;
    own->samples = NULL;
    return;
  }
  const hapi_promise promise = {setup->max_force, setup->max_torque, setup->max_power};
  if (other) {
    hapi_purse_fill(&own->purse, &promise);
    own->share = 0.0;
  }
  own->begin_ns = other || setup->wave.restart != own->setup.wave.restart ? now_ns : own->begin_ns;
  own->setup = *setup;
  own->samples = samples;
  own->leaves = false;
  own->out = HAP_FORCE_IN;
}

/* What the setup comes to, without what a change has left. True: a call gave more than is
 * promised. */
static bool own_value(hapi_own_force *own, const hapi_pointer *p, int64_t now_ns, double seconds,
                      hap_wrench *out)
{
  const hapi_force_setup *setup = &own->setup;
  if (own->leaves || own->out != HAP_FORCE_IN) {
    *out = (hap_wrench){{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    return false;
  }
  double in = setup->fade_in_s > 0.0 ? seconds / setup->fade_in_s : 1.0;
  own->share = hapi_min(own->share + in, 1.0);
  const hapi_own_source source = {setup, own->samples, &own->called};
  hapi_own_force_value(&source, p, 1e-9 * (double)(now_ns - own->begin_ns), out);
  hapi_v3_scale(own->share, out->force, out->force);
  hapi_v3_scale(own->share, out->torque, out->torque);
  bool force = hapi_v3_shorten(out->force, setup->max_force);
  bool torque = hapi_v3_shorten(out->torque, setup->max_torque);
  return (force || torque) && setup->kind == HAP_FORCE_CALL;
}

/* True: it was more than is promised. */
static bool own_run(hapi_own_force *own, const hapi_pointer *p, int64_t now_ns, double seconds,
                    hap_wrench *out)
{
  const hapi_force_setup *setup = &own->setup;
  bool beyond = own_value(own, p, now_ns, seconds, out);
  if (own->changed) {
    hapi_v3_sub(own->gives.force, out->force, own->offset.force);
    hapi_v3_sub(own->gives.torque, out->torque, own->offset.torque);
    own->offset_left = 1.0;
    own->changed = false;
  } else {
    own->offset_left = hapi_max(own->offset_left - seconds / HAPI_SAFETY_RAMP_IN_S, 0.0);
  }
  double left = own->offset_left;
  hapi_v3_madd(out->force, left, own->offset.force, out->force);
  hapi_v3_madd(out->torque, left, own->offset.torque, out->torque);
  /* What was promised before holds as long as something of it is left. */
  const hapi_promise promise = {hapi_max(setup->max_force, left * own->before.force),
                                hapi_max(setup->max_torque, left * own->before.torque),
                                setup->max_power};
  bool more = hapi_promise_keep(&promise, &own->purse, &p->declared, seconds, out);
  own->gives = *out;
  return more || beyond;
}

void hapi_own_forces_declare(hapi_own_force *forces, hapi_pointer *pointer, int64_t now_ns,
                             double seconds)
{
  for (uint32_t i = 0; i < HAP_FORCES_MAX; ++i) {
    hapi_own_force *own = &forces[i];
    hap_wrench wrench;
    if (own->setup.serial == 0) {
      continue;
    }
    bool more = own_run(own, pointer, now_ns, seconds, &wrench);
    pointer->declared.held = pointer->declared.held || more;
    if (hapi_own_force_follows(&own->setup)) {
      hapi_declare_following(&pointer->declared, &wrench, hapi_own_force_stiffness(&own->setup));
    } else {
      hapi_declare_driven(&pointer->declared, &wrench);
    }
    if (own->leaves && own->offset_left <= 0.0) {
      *own = (hapi_own_force){.leaves = false};
    }
  }
}

void hapi_own_forces_rest(hapi_own_force *forces)
{
  for (uint32_t i = 0; i < HAP_FORCES_MAX; ++i) {
    hapi_own_force *own = &forces[i];
    if (own->leaves) {
      *own = (hapi_own_force){.leaves = false};
    }
    memset(&own->gives, 0, sizeof own->gives);
    memset(&own->purse.last, 0, sizeof own->purse.last);
    own->offset_left = 0.0;
  }
}

bool hapi_own_forces_any(const hapi_own_force *forces)
{
  for (uint32_t i = 0; i < HAP_FORCES_MAX; ++i) {
    if (forces[i].setup.serial != 0) {
      return true;
    }
  }
  return false;
}
