/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "guard/lateness.h"

#include "base/safety.h"
#include "base/vec.h"

/* A force that is held over a gap between two ticks acts as a spring that is late by half of the
 * gap. A device with damping b holds a stiffness k only while
 *
 *   k t / 2 < b                                 (Colgate and Schenkel 1997, without delay)
 *
 * for a time t between two writes. So what a device holds falls with 1 / t. While ticks come late,
 * the force of a pointer is multiplied by t_held / t, where t is the longest of the last gaps, and
 * t_held the time between two writes for which the device holds what it touches now:
 *
 *   t_held = T max(hold / k, 1)    where the device says what it holds at T (coupling_gains.c)
 *   t_held = T                     where it does not: it may hold just what it touches
 *
 * Damping is multiplied as the spring is: d t / m is bounded likewise.
 *
 * Bodies of the loop go on by T a tick, however long the gap was. In the gap they stood still, and
 * no force of the hand acted on them. That is slow motion, and takes energy: a hand that pushes
 * them gives its whole work to the port, and they get a part of it. Stepping them through the gap
 * would cost a late loop more time in each tick, and would need to know where the hand was.
 *
 * Time that is lost counts only while a force is on: without one nothing is held. */

void hapi_lateness_forgive(hapi_lateness *late)
{
  late->lost_s = 0.0;
}

static bool force_is_on(const hapi_pointers *pointers)
{
  for (uint32_t i = 0; i < pointers->high; ++i) {
    const hapi_pointer *p = &pointers->of[i];
    const hap_wrench *w = &p->guard.written;
    if (p->generation != 0 &&
        (hapi_v3_dot(w->force, w->force) > 0.0 || hapi_v3_dot(w->torque, w->torque) > 0.0)) {
      return true;
    }
  }
  return false;
}

/* s, the longest time between two writes for which the device holds what it touches, or may touch
 * next. */
static double pointer_holds_for(const hapi_pointer *p, double period)
{
  double k = p->proxied ? p->coupling.stiffness
                        : hapi_max(p->coupling.contact_stiffness, hapi_pointer_stiffest(p));
  if (!p->coupling.hold_known || !(k > 0.0)) {
    return period;
  }
  return period * hapi_max(p->coupling.hold / k, 1.0);
}

static void lateness_note(hapi_lateness *late, double period, bool force)
{
  double lost = late->elapsed_s - period;
  double few = late->few_s + lost - HAPI_SAFETY_LATE_FEW_SHARE * late->elapsed_s;
  double much = late->lost_s + (force ? lost : 0.0) - HAPI_SAFETY_LATE_SHARE * late->elapsed_s;
  late->few_s = hapi_min(hapi_max(few, 0.0), 2.0 * HAPI_SAFETY_LATE_FEW_S);
  late->lost_s = hapi_max(much, 0.0);
  late->gap_s *= hapi_max(1.0 - late->elapsed_s / HAPI_SAFETY_LATE_GAP_DECAY_S, 0.0);
  late->hold_s -= late->elapsed_s;
  late->slew_s = hapi_max(late->slew_s - period, 0.0);
  if (lost > HAPI_SAFETY_LATE_GAP_S ||
      (lost > 0.5 * period && late->few_s > HAPI_SAFETY_LATE_FEW_S)) {
    late->in_touch = true;
    late->slew_s = HAPI_SAFETY_LATE_SLEW_S;
    late->gap_s = hapi_max(late->gap_s, late->elapsed_s);
    late->hold_s = HAPI_SAFETY_LATE_HOLD_S;
  }
}

/* Down in a few ticks and not in one: the change is felt, too. */
static void pointer_derate(const hapi_lateness *late, double period, hapi_pointer *p)
{
  double held = pointer_holds_for(p, period);
  double loss = late->hold_s > 0.0 && late->gap_s > held ? 1.0 - held / late->gap_s : 0.0;
  double *now = &p->guard.late_loss;
  *now = loss > *now ? hapi_min(*now + period / HAPI_SAFETY_LATE_DOWN_S, loss)
                     : hapi_max(*now - period / HAPI_SAFETY_LATE_BACK_S, loss);
}

void hapi_lateness_tell(const hapi_guard *guard, const hapi_tick_facts *facts,
                        hapi_coupling_late *out)
{
  double lost = facts->elapsed - facts->period;
  out->elapsed = facts->elapsed;
  out->slow = lost + guard->late.few_s > HAPI_SAFETY_LATE_GAP_S;
  out->stood = out->slow && lost > 0.5 * facts->period ? 1.0 - facts->period / facts->elapsed : 0.0;
}

bool hapi_lateness_follow(hapi_guard *guard, const hapi_tick_facts *facts,
                          const hapi_pointers *pointers)
{
  hapi_lateness *late = &guard->late;
  late->elapsed_s = hapi_max(facts->elapsed, facts->period);
  if (guard->mode == HAP_GUARD_MEASURE) {
    return false;
  }
  bool force = force_is_on(pointers);
  bool derated = false;
  lateness_note(late, facts->period, force);
  for (uint32_t i = 0; i < pointers->high; ++i) {
    hapi_pointer *p = &pointers->of[i];
    if (p->generation != 0) {
      pointer_derate(late, facts->period, p);
      derated = derated || p->guard.late_loss > 0.0;
    }
  }
  late->derated_ticks += derated;
  return (force && late->elapsed_s > HAPI_SAFETY_LATE_GAP_MOST_S) ||
         late->lost_s > HAPI_SAFETY_LATE_LOST_S;
}

void hapi_lateness_fade(hapi_lateness *late, bool begins)
{
  late->fade_s = begins ? HAPI_SAFETY_FADE_S : late->fade_s;
  late->fade = late->fade_s > late->elapsed_s ? 1.0 - late->elapsed_s / late->fade_s : 0.0;
  late->fade_s = hapi_max(late->fade_s - late->elapsed_s, 0.0);
}
