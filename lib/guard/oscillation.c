/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "guard/oscillation.h"

#include "base/safety.h"
#include "base/vec.h"
#include "guard/force_guard.h"
#include "guard/runaway.h"
#include "local/grab_rows.h"
#include "pointer/coupling.h"

/* A spring whose force comes late by d makes the energy pi w d k X^2 in a cycle. Where device and
 * hand take less, the device swings up by itself, until a limit of the force ends that. The ledger
 * of the energy observer has no entry for a device that tells old positions: along the way that is
 * told, the force is that of a good spring.
 *
 * So a swing is known by what it is, along each axis of the world, from one turn of the force to
 * the next:
 *
 *   large      a share of the largest force
 *   sustained  cycle after cycle as large: what is struck dies down
 *   own        the force follows the way of the device from tick to tick, as that of a spring of
 *              the stiffness that is touched. A force from elsewhere is larger than that: such as
 *              that of a texture, an edge that turns under the finger, or a ball
 *   not given  neither bodies that move, nor the hand along another axis, feed it: a plate that
 *              shakes, a file under the finger
 *   not meant  it is faster than a hand goes to and fro at such a force, or the device is late
 *
 * The device is late: at 20 Hz and more no hand does any work, it has mass and damping alone. There
 * the work of the force on the way is that of the damping, above zero. Of old positions it is below
 * zero, by the sine of the delay's angle. So a hand that taps is told from a swing of its pace.
 *
 * Then the force of the pointer is halved with each further half of the swing. It stays down for
 * some time, and comes back slowly. If nothing has changed, the device swings again: a fault
 * latches after so many halves in all.
 *
 * What is judged is the force before the guard. It says how far the device swings at the stiffness
 * that was asked for, whatever has been taken. Of what is declared (pointer/declared.h), the part
 * that follows the hand is judged with the contacts; a part that goes by time feeds the device as a
 * moving body does, by the work that it does on it. */

#define AXES 3

/* What else takes force, or moves the device by what it has taken. */
#define OTHER_REASONS (HAP_GUARD_LATE | HAP_GUARD_INPUT | HAP_GUARD_RAMP_IN | HAP_GUARD_STALE)

/* J, by moving bodies at the pointers' contacts, and by what is meant as a vibration. */
static void note_given(const hapi_tick_facts *facts, const hapi_pointers *pointers,
                       const hapi_bodies *bodies, const hapi_touches *touches)
{
  for (uint32_t i = 0; i < pointers->high; ++i) {
    hapi_pointer *p = &pointers->of[i];
    if (facts->model != HAP_MODEL_CONTACT) {
      p->guard.swings.given += facts->period * p->guard.power;
    }
    p->guard.swings.given += p->declared.work;
    if (facts->model == HAP_MODEL_CONTACT && p->generation != 0 && hapi_grab_acts(&p->grab)) {
      const hapi_local_body *body = &bodies->of[p->grab.hold.body];
      p->guard.swings.given += facts->period * hapi_grab_power(&p->grab, body, false);
    }
  }
  for (uint32_t i = 0; facts->model == HAP_MODEL_CONTACT && i < touches->count; ++i) {
    const hapi_local_contact *c = &touches->of[i];
    const hapi_local_body *body = hapi_bodies_at(bodies, c->body);
    if (body != NULL) {
      double arm[3];
      double velocity[3];
      hapi_v3_sub(c->point_now, body->pose.position, arm);
      hapi_v3_cross(body->twist.angular, arm, velocity);
      hapi_v3_add(velocity, body->twist.linear, velocity);
      pointers->of[c->pointer].guard.swings.given -=
          facts->period * hapi_v3_dot(c->force, velocity);
    }
  }
}

/* ---- an axis ---- */

static void sums_note(hapi_swing_sums *sums, double force, double way)
{
  sums->both += force * way;
  sums->force2 += force * force;
  sums->way2 += way * way;
}

static void sums_add(hapi_swing_sums *sums, const hapi_swing_sums *more)
{
  sums->both += more->both;
  sums->force2 += more->force2;
  sums->way2 += more->way2;
}

/* Whether force and way go against each other, by a cosine. */
static bool sums_oppose(const hapi_swing_sums *sums, double cosine)
{
  return sums->both < -cosine * sqrt(sums->force2 * sums->way2);
}

/* What changes faster than some 20 Hz. */
static double fast_part(double slow[HAPI_SWING_STAGES], double value, double share)
{
  for (int i = 0; i < HAPI_SWING_STAGES; ++i) {
    slow[i] += share * (value - slow[i]);
    value -= slow[i];
  }
  return value;
}

/* How the force follows the way in a tick. */
typedef struct swing_tick {
  double stiffness; /* the most in any tick: N/m, or N m/rad */
  double acts;      /* 0..1, of it in this tick: a declared spring goes on beyond a contact */
  double seconds;
} swing_tick;

/* The force that was on since the last tick goes with the way meanwhile. */
static void axis_hear(hapi_swing_axis *s, double force, double way, const swing_tick *tick)
{
  double share = hapi_min(tick->seconds / HAPI_SAFETY_SWING_FAST_S, 1.0);
  double step = way - s->way;
  sums_note(&s->now.fast, fast_part(s->slow_force, s->force, share),
            fast_part(s->slow_way, step, share));
  if (force != s->force) {
    double sprung = tick->acts * step;
    sums_note(&s->now.ticks, force - s->force, sprung);
    s->now.felt += tick->stiffness * sprung * sprung;
  }
  s->work += s->force * step;
  s->force = force;
  s->way = way;
}

/* Whether the last halves are a swing that goes on by itself. */
static bool axis_swings(const hapi_swing_axis *s)
{
  hapi_half_swing all = {.force = 0.0};
  double early = 0.0;
  double late = 0.0;
  double longest = 0.0;
  if (s->count < HAPI_SWINGS) {
    return false;
  }
  for (uint32_t i = 0; i < HAPI_SWINGS; ++i) {
    const hapi_half_swing *half = &s->halves[(s->count + i) % HAPI_SWINGS];
    early += i < 2 ? half->force : 0.0;
    late += i >= HAPI_SWINGS - 2 ? half->force : 0.0;
    longest = i > 0 ? hapi_max(longest, all.seconds + half->seconds) : 0.0;
    all.seconds = half->seconds;
    all.energy += half->energy;
    all.work.given += half->work.given;
    all.work.own += half->work.own;
    all.work.other += half->work.other;
    all.felt += half->felt;
    sums_add(&all.ticks, &half->ticks);
    sums_add(&all.fast, &half->fast);
  }
  bool own = sums_oppose(&all.ticks, HAPI_SAFETY_SWING_OWN) &&
             -all.ticks.both <= HAPI_SAFETY_SWING_STIFFER * all.felt;
  double fed = hapi_max(all.work.given, hapi_min(all.work.own, -all.work.other));
  bool meant =
      longest > 1.0 / HAPI_SAFETY_SWING_HZ && !sums_oppose(&all.fast, HAPI_SAFETY_SWING_LATE);
  return own && !meant && late >= HAPI_SAFETY_SWING_KEPT * early &&
         fed <= HAPI_SAFETY_SWING_FED * all.energy;
}

/* The half that ended at the farthest point. */
static void axis_half(hapi_swing_axis *s, hapi_half_swing *out)
{
  const hapi_swing_end *from = &s->turn;
  const hapi_swing_end *to = &s->top;
  *out = s->now;
  out->force = fabs(to->force - from->force);
  out->energy = 0.125 * out->force * fabs(to->way - from->way);
  out->seconds = to->seconds - from->seconds;
  out->work.given = to->work.given - from->work.given;
  out->work.own = to->work.own - from->work.own;
  out->work.other = to->work.other - from->work.other;
  s->turn = s->top;
  s->now = (hapi_half_swing){.force = 0.0};
}

/* The force has turned. True: the axis swings. */
static bool axis_turns(hapi_swing_axis *s, double large)
{
  hapi_half_swing half;
  axis_half(s, &half);
  const hapi_half_swing *before = &s->halves[(s->count + HAPI_SWINGS - 1) % HAPI_SWINGS];
  bool goes_on = half.force >= HAPI_SAFETY_SWING_ALIKE * s->most &&
                 half.seconds + before->seconds <= 1.0 / HAPI_SAFETY_SWING_LEAST_HZ;
  s->count = half.force >= large && goes_on ? s->count : 0;
  if (half.force < large) {
    return false;
  }
  s->most = s->count > 0 ? hapi_max(s->most, half.force) : half.force;
  s->halves[s->count % HAPI_SWINGS] = half;
  ++s->count;
  return axis_swings(s);
}

/* Turns by less than half of what is large are none. */
static bool axis_follow(hapi_swing_axis *s, const hapi_swing_end *now, double large)
{
  if (s->rises ? now->force >= s->top.force : now->force <= s->top.force) {
    s->top = *now;
    return false;
  }
  if (fabs(now->force - s->top.force) < 0.5 * large) {
    return false;
  }
  bool swings = axis_turns(s, large);
  s->rises = !s->rises;
  s->top = *now;
  return swings;
}

/* ---- a pointer ---- */

/* N/m, no less than what turns a way of the device into force. */
static double stiffness_felt(const hapi_pointer *p)
{
  double touched = p->proxied ? p->coupling.stiffness
                              : hapi_pointer_stiffest(p) * hapi_max((double)p->contacts, 1.0);
  double held = p->proxied || !hapi_grab_acts(&p->grab) ? 0.0 : p->grab.pull.stiffness;
  return touched + held + p->declared.stiffness;
}

/* 0..1, of that stiffness: what acts in this tick. Where a device swings in and out of a contact
 * while a declared spring goes on, the force follows the way by two slopes. Taken for one, that is
 * a cosine of 0.95 at most. */
static double share_acting(const hapi_pointer *p, double stiffness)
{
  bool touches = p->proxied || p->contacts > 0;
  return touches || !(p->declared.stiffness > 0.0) ? 1.0 : p->declared.stiffness / stiffness;
}

/* N m/rad, likewise. touched: of what is touched with the hull. */
static double turn_stiffness_felt(const hapi_pointer *p, double touched)
{
  return p->proxied && p->shape.hull != NULL
             ? p->coupling.spin_stiffness
             : touched + (hapi_grab_turns(&p->grab) ? p->grab.pull.turn_stiffness : 0.0);
}

static bool axes_follow(hapi_swings *swings, hapi_swing_axis axes[AXES], const double force[3],
                        double limit)
{
  bool any = false;
  for (int i = 0; i < AXES; ++i) {
    const hapi_swing_end now = {
        force[i],
        axes[i].way,
        swings->seconds,
        {swings->given, axes[i].work, swings->work - axes[i].work},
    };
    any |= axis_follow(&axes[i], &now, HAPI_SAFETY_SWING_LARGE * limit);
  }
  return any;
}

static void axes_hear(hapi_swings *swings, hapi_swing_axis axes[AXES], const double force[3],
                      const double way[3], const swing_tick *tick)
{
  for (int i = 0; i < AXES; ++i) {
    double before = axes[i].work;
    axis_hear(&axes[i], force[i], way[i], tick);
    swings->work += axes[i].work - before;
  }
}

/* Whether the pointer swings in this tick. felt and its limits: world units. */
static bool pointer_swings(hapi_pointer *p, const hap_wrench *felt, const double limits[2],
                           double seconds)
{
  hapi_swings *s = &p->guard.swings;
  bool turns = (p->shape.hull != NULL && p->device.feels_torque) || hapi_grab_turns(&p->grab);
  double stiffness = stiffness_felt(p);
  const swing_tick tick = {stiffness, share_acting(p, stiffness), seconds};
  double arm2 = p->shape.extent * p->shape.extent; /* no contact has a longer one */
  double way[3];                                   /* of the hand in its base */
  double spin[3];
  s->seconds += seconds;
  hapi_v3_sub(p->handle.position, p->frame.carried, way);
  axes_hear(s, s->force, felt->force, way, &tick);
  if (turns) {
    hapi_v3_sub(p->handle.spin, p->frame.carries.angular, spin);
    hapi_v3_madd(s->turned, seconds, spin, s->turned);
    const swing_tick turns_by = {turn_stiffness_felt(p, arm2 * stiffness), 1.0, seconds};
    axes_hear(s, s->torque, felt->torque, s->turned, &turns_by);
  }
  if (p->device.jumped || (p->guard.flags & OTHER_REASONS) != 0) { /* the way is not the force's */
    for (int i = 0; i < AXES; ++i) {
      s->force[i].count = s->torque[i].count = 0;
    }
  }
  bool any = axes_follow(s, s->force, felt->force, limits[0]);
  return (turns && axes_follow(s, s->torque, felt->torque, limits[1])) || any;
}

/* World units, as the limits of the device shorten them. */
static void wrench_limited(const hapi_pointer *p, double limits[2], hap_wrench *out)
{
  double scale = hapi_coupling_torque_scale(p);
  limits[0] =
      p->device.force_scale > 0.0 ? p->device.limits.max_force / p->device.force_scale : 0.0;
  limits[1] = scale > 0.0 ? p->device.limits.max_torque / scale : 0.0;
  *out = p->wrench;
  if (p->declared.any) {
    hapi_wrench_add(out, &p->declared.follows);
  }
  (void)hapi_v3_shorten(out->force, limits[0]);
  (void)hapi_v3_shorten(out->torque, limits[1]);
}

/* Down with each half of a swing, back slowly. */
static void swings_derate(hapi_swings *s, bool swings, double seconds)
{
  s->counted = hapi_max(s->counted - HAPI_SAFETY_SWING_FORGET * seconds, 0.0);
  s->hold_s = hapi_max(s->hold_s - seconds, 0.0);
  if (swings) {
    s->counted += 1.0;
    s->hold_s = HAPI_SAFETY_SWING_HOLD_S;
    s->target = hapi_min(0.5 + 0.5 * s->target, 1.0 - HAPI_SAFETY_SWING_LEAST);
  } else if (s->hold_s <= 0.0) {
    s->target = hapi_max(s->target - seconds / HAPI_SAFETY_SWING_BACK_S, 0.0);
  }
  s->loss = hapi_min(s->loss + seconds / HAPI_SAFETY_SWING_DOWN_S, s->target);
}

void hapi_oscillation_follow(hapi_guard *guard, const hapi_tick_facts *facts,
                             const hapi_pointers *pointers, const hapi_bodies *bodies,
                             const hapi_touches *touches)
{
  bool lowered = false;
  if (guard->mode == HAP_GUARD_MEASURE || guard->latch.fault != HAP_FAULT_NONE) {
    return;
  }
  note_given(facts, pointers, bodies, touches);
  for (uint32_t i = 0; i < pointers->high; ++i) {
    hapi_pointer *p = &pointers->of[i];
    hapi_swings *s = &p->guard.swings;
    double limits[2];
    hap_wrench felt;
    if (p->generation == 0 || !hapi_guard_usable(&p->wrench)) {
      continue;
    }
    wrench_limited(p, limits, &felt);
    swings_derate(s, pointer_swings(p, &felt, limits, facts->elapsed), facts->elapsed);
    bool as_asked = (p->guard.flags & (OTHER_REASONS | HAP_GUARD_ENERGY)) == 0;
    if (p->declared.any) { /* a device runs away from all that it is given */
      hapi_v3_add(felt.force, p->declared.driven.force, felt.force);
      (void)hapi_v3_shorten(felt.force, limits[0]);
    }
    bool away = hapi_runaway_follow(&s->runaway, p, felt.force, stiffness_felt(p),
                                    as_asked ? limits[0] : 0.0, facts->elapsed);
    if (away || s->counted >= HAPI_SAFETY_SWING_HALVES) {
      hapi_fault_set(&guard->latch, HAP_FAULT_OSCILLATION, i + 1, p->generation);
    }
    s->taken = 1.0 - (1.0 - s->loss) * (1.0 - s->runaway.loss);
    lowered = lowered || s->taken > 0.0;
  }
  guard->oscillation_ticks += lowered;
}
