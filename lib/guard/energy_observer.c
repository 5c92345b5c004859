/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "guard/energy_observer.h"

#include <math.h>
#include <string.h>

#include "base/safety.h"
#include "base/vec.h"
#include "local/body_still.h"
#include "local/grab_rows.h"
#include "local/pointer_friction.h"
#include "local/touch_feel.h"

/* The ledger of what the hands may get back. It gains what a hand puts in, and what the world
 * loses; it pays what a hand is given:
 *
 *   port     minus the force that was written, held over a tick, times the way that the device
 *            went: exact, whatever the simulation thought. World units: a device's joule counts
 *            motion_scale / force_scale.
 *   bodies   of the loop: the fall of their kinetic energy within a tick, from mass and inertia,
 *            plus the work of gravity and of the application's wrench, plus the work of contacts
 *            with things that the loop does not own, moving surfaces and springs. A sync changes
 *            bodies between two ticks: that is the world's.
 *   others   all bodies of the other models, and static, driven and measured ones: their motion is
 *            given, and their work on a pointer's spring is the world's.
 *
 *   ramps    a contact that comes in slowly, and a force that fades or comes back, change the
 *            stiffness of a spring under load: the world's work, to either side. The energy in the
 *            spring of a contact that is no more is lost, as of one that stuck and has let go.
 *   grips    as the springs of contacts; a place that moves in the body is the world's work.
 *   base     the motion of a device's frame in the world, and a stiffness that is set, are the
 *            world's work: to either side.
 *   gaps     Over missed ticks the hand goes the whole way against the force that was held: that is
 *            booked at the port. The spring of a contact gets a part of the way, k (d - e)^2 / 2 at
 *            a depth d of which e is held back. A change of e is no entry, so the rest of what the
 *            hand paid stays in the ledger, and pays for e to come in: k (d^2 - (d - e)^2) / 2.
 *            What is not paid does not come in; in a touch that lasts, slowly, as the world's work.
 *
 *   shares   of a hull's points in its stiffness are no entry: the hand pays for their changes,
 *            which it made by tilting the hull.
 *
 * The springs of the pointer contacts and of the couplings are no entry: what is in them has been
 * put in and not yet been got back. An energy that an integrator makes shows when it reaches the
 * hand, or before that in the motion of an owned body. Of the other models only the port and the
 * springs are watched.
 *
 * Nothing is done before the ledger is overdrawn by nearly 1 % of the largest energy that was
 * stored. Then the part of the force that goes with the hand is cut to what remains; what resists
 * it stays. In a touch that a late loop has disturbed it is cut somewhat before that, as fast as
 * forces of a late loop change, so that it is not one step. While nothing is touched the
 * ledger stands still, and a surplus is forgotten: it must not pay for what a later touch makes of
 * nothing.
 *
 * What is declared (pointer/declared.h) is no entry: neither is it paid for, nor held back. It has
 * limits of its own.
 *
 * A torque is paid as a force is, for the turn that the device made; those of friction on a device
 * that does not turn a hull are left out: they are small beside its forces' work. */

#define MOVED_LEAST 1e-24 /* m^2: less is rest, and its square may be no number to divide by */

static double world_per_device(const hapi_pointer *p)
{
  return p->device.force_scale > 0.0 ? p->device.motion_scale / p->device.force_scale : 0.0;
}

/* J of the body's turning at w, in the orientation that it has (after) or had (before). */
static double spin_energy(const hapi_local_body *body, const double w[3], bool after)
{
  double local[3];
  double momentum[3];
  double w2 = hapi_v3_dot(w, w);
  if (body->round) {
    return 0.5 * body->given.inertia[0] * w2;
  }
  if (!(w2 > 0.0)) {
    return 0.0;
  }
  if (after) {
    hapi_quat_unrotate(body->pose.quat_wxyz, w, local);
  } else {
    hapi_m3_apply_transposed(body->rotation, w, local);
  }
  hapi_m3_apply(body->given.inertia, local, momentum);
  return 0.5 * hapi_v3_dot(local, momentum);
}

/* J that the body lost to contacts in this tick; its energy after it is added to *io_stored. With
 * the mean velocity the work of a constant force is exactly what it adds to the kinetic energy. */
static double body_loses(const hapi_local_body *body, double period, double *io_stored)
{
  const hapi_model_body *given = &body->given;
  const double *before = body->start_twist;
  const double *after = body->twist.linear;
  double mean[3];
  double turn[3];
  double pull[3];
  hapi_v3_add(before, after, mean);
  hapi_v3_add(before + 3, body->twist.angular, turn);
  hapi_v3_scale(given->mass, given->gravity, pull);
  hapi_v3_add(pull, given->user_wrench, pull);
  double work = hapi_v3_dot(pull, mean) + hapi_v3_dot(given->user_wrench + 3, turn);
  work *= body->waiting ? 0.0 : 0.5 * period; /* one that waits feels its contacts alone */
  double kinetic =
      0.5 * given->mass * hapi_v3_dot(after, after) + spin_energy(body, body->twist.angular, true);
  *io_stored += kinetic;
  return 0.5 * given->mass * hapi_v3_dot(before, before) + spin_energy(body, before + 3, false) -
         kinetic + work;
}

static double bodies_lose(const hapi_tick_facts *facts, const hapi_bodies *bodies,
                          double *io_stored)
{
  double sum = 0.0;
  if (facts->model != HAP_MODEL_CONTACT) {
    return 0.0;
  }
  for (uint32_t i = 0; i < bodies->live_count; ++i) {
    const hapi_local_body *body = &bodies->of[bodies->live[i]];
    if ((body->flags & HAPI_BODY_RESTING) == 0 && (body->flags & HAPI_BODY_OWNED) != 0 &&
        !hapi_body_is_still(body)) {
      sum += body_loses(body, facts->period, io_stored);
    }
  }
  return sum;
}

/* J that a contact does on a body in this tick: with the mean of its velocities. */
static double work_on(double period, const hapi_local_body *body, const hapi_local_contact *c)
{
  const double *force = c->force;
  double arm[3];
  double moment[3];
  hapi_v3_sub(c->point_now, body->pose.position, arm);
  hapi_v3_cross(arm, force, moment);
  hapi_v3_add(moment, c->couple, moment);
  double after = hapi_v3_dot(force, body->twist.linear) + hapi_v3_dot(moment, body->twist.angular);
  double before =
      hapi_v3_dot(force, body->start_twist) + hapi_v3_dot(moment, body->start_twist + 3);
  return 0.5 * period * (after + before);
}

/* J in the spring of a grip. */
static double grip_energy(const hapi_pointer *p)
{
  const hapi_grab_pull *pull = &p->grab.pull;
  return 0.5 * (pull->stiffness * hapi_v3_dot(pull->way, pull->way) +
                pull->turn_stiffness * hapi_v3_dot(pull->turn, pull->turn));
}

static double half_compliance(const hapi_pointer *p)
{
  return p->surface.stiffness > 0.0 ? 0.5 / p->surface.stiffness : 0.0;
}

/* 0..1, share of the force that is left by what lowers it and is no entry. */
static double hand_gets(const hapi_pointer *p)
{
  return (1.0 - p->guard.late_loss) * (1.0 - p->guard.swings.taken);
}

/* The same of the bodies that are held. */
static double held_give(const hapi_tick_facts *facts, const hapi_pointers *pointers,
                        const hapi_bodies *bodies, double *io_stored)
{
  double sum = 0.0;
  for (uint32_t i = 0; i < pointers->high; ++i) {
    const hapi_pointer *p = &pointers->of[i];
    const hapi_grab *g = &p->grab;
    if (p->generation == 0 || !hapi_grab_acts(g)) {
      continue;
    }
    const hapi_local_body *body = &bodies->of[g->hold.body];
    double felt = p->guard.felt * hand_gets(p);
    double power = hapi_grab_power(g, body, true);
    *io_stored += grip_energy(p);
    sum += facts->period * power * (hapi_body_is_owned(body) ? felt - 1.0 : 1.0);
  }
  return sum;
}

/* J that bodies of given motion do on the pointers' springs in this tick. */
static double surfaces_give(const hapi_tick_facts *facts, const hapi_pointers *pointers,
                            const hapi_bodies *bodies, const hapi_touches *touches,
                            double *io_stored)
{
  double sum = 0.0;
  if (facts->model != HAP_MODEL_CONTACT) { /* as hapi_render has noted it: another walk over the
                                              contacts would cost as much as a tenth of the tick */
    for (uint32_t i = 0; i < pointers->high; ++i) {
      const hapi_pointer *p = &pointers->of[i];
      if (p->generation != 0 && p->guard.force2 > 0.0) {
        *io_stored += half_compliance(p) * p->guard.force2;
        sum += facts->period * p->guard.power;
      }
    }
    return sum;
  }
  sum += pointers->grabs ? held_give(facts, pointers, bodies, io_stored) : 0.0;
  for (uint32_t i = 0; i < touches->count; ++i) {
    const hapi_local_contact *c = &touches->of[i];
    const hapi_pointer *p = &pointers->of[c->pointer];
    const hapi_local_body *body = hapi_bodies_at(bodies, c->body);
    double force2 = hapi_v3_dot(c->force, c->force);
    if (!(force2 > 0.0)) {
      continue;
    }
    double felt = p->guard.felt * hand_gets(p);
    *io_stored +=
        p->rigid ? 0.0 : half_compliance(p) * hapi_touch_softer(c, p) * force2 / c->weight;
    if (body != NULL && (body->flags & HAPI_BODY_OWNED) == 0) {
      sum -= work_on(facts->period, body, c);
    } else if (body != NULL && felt < 1.0) { /* it has the whole force, the hand a share */
      sum += (1.0 - felt) * work_on(facts->period, body, c);
    }
  }
  return sum;
}

/* J in the spring of a contact that goes no farther than to the limit of the force; k: N/m, depth:
 * m, also of a spring that pulls. */
static double spring_energy(const hapi_pointer *p, double k, double depth)
{
  double force = k * depth;
  if (!(depth > 0.0) || !(k > 0.0) || p->rigid) {
    return 0.0;
  }
  return force <= p->guard.limit ? 0.5 * force * depth
                                 : p->guard.limit * (depth - 0.5 * p->guard.limit / k);
}

/* J that fading, and places that move, added to the springs of grips in this tick. */
static double grips_give(hapi_guard *guard, const hapi_pointers *pointers, double *io_gone)
{
  double sum = 0.0;
  for (uint32_t i = 0; i < pointers->high; ++i) {
    const hapi_pointer *p = &pointers->of[i];
    hapi_grab_ledger *ledger = &pointers->of[i].grab.ledger;
    if (p->generation == 0 || !hapi_grab_acts(&p->grab)) {
      continue;
    }
    double felt = p->grab.share * p->guard.felt;
    double energy = p->guard.felt * grip_energy(p);
    *io_gone -= ledger->sprung;
    sum += p->guard.felt * ledger->moved;
    if (felt != ledger->felt) {
      sum += felt > 0.0 ? energy * (1.0 - ledger->felt / felt) : -ledger->sprung;
    }
    ledger->felt = felt;
    ledger->sprung = energy;
    guard->sprung += energy;
  }
  return sum;
}

/* J that ramps and fading added to the springs in this tick. */
static double ramps_give(hapi_guard *guard, const hapi_pointers *pointers,
                         const hapi_touches *touches, uint64_t tick)
{
  double gone = guard->sprung;
  double sum = 0.0;
  guard->sprung = 0.0;
  for (uint32_t i = 0; i < pointers->high; ++i) {
    hapi_pointer *p = &pointers->of[i];
    if (p->generation != 0) {
      double scale = p->device.force_scale;
      p->guard.limit = scale > 0.0 ? p->device.limits.max_force / scale : 0.0;
      p->guard.felt = p->guard.share * (1.0 - guard->age_loss) * (1.0 - p->belief.loss);
    }
  }
  for (uint32_t i = 0; i < touches->count; ++i) {
    hapi_local_contact *c = &touches->of[i];
    const hapi_pointer *p = &pointers->of[c->pointer];
    hapi_ramp *r = &c->ramp;
    double share = c->shown * r->share * p->guard.felt;
    double stiffness = hapi_touch_stiffness(c, p);
    double depth = r->depth + (c->feel.special ? c->feel.lift.height : 0.0);
    double strain = hapi_touch_strain(c, depth - r->excess);
    double energy = spring_energy(p, c->weight * share * stiffness, strain);
    double rubs = c->feel.mu > 0.0 ? hapi_friction_energy(touches, tick, c) : 0.0;
    gone -= r->sprung;
    if (r->drawn > 0.0 && !c->feel.sticks) {
      sum -= r->drawn;
    }
    r->drawn = c->feel.sticks && depth < r->excess ? energy : 0.0;
    if (share != r->felt_share || r->excess != r->felt_excess ||
        stiffness != r->felt_stiffness) { /* seldom */
      /* Over a jump the hand paid for no depth, so none of it is lost. */
      double excess = r->late || p->device.jumped ? r->excess : r->felt_excess;
      double before = c->weight * r->felt_share * r->felt_stiffness;
      sum += energy - spring_energy(p, before, hapi_touch_strain(c, depth - excess));
      double unpaid = hapi_touch_strain(c, depth - r->excess - r->given);
      sum += hand_gets(p) * (energy - spring_energy(p, c->weight * share * stiffness, unpaid));
      sum +=
          (p->guard.felt - r->felt) * rubs; /* a deep contact's friction comes in with its limit */
      sum += stiffness > 0.0 ? r->felt * rubs * (stiffness - r->felt_stiffness) / stiffness : 0.0;
      r->felt_share = share;
      r->felt_excess = r->excess;
      r->felt_stiffness = stiffness;
      r->felt = p->guard.felt;
    }
    r->sprung = energy + p->guard.felt * rubs;
    guard->sprung += r->sprung;
  }
  sum += pointers->grabs ? grips_give(guard, pointers, &gone) : 0.0;
  return sum - gone;
}

/* J in the springs between devices and proxies, and in the motion of proxies with mass. */
static double couplings_store(const hapi_pointers *pointers)
{
  double sum = 0.0;
  for (uint32_t i = 0; i < pointers->high; ++i) {
    const hapi_pointer *p = &pointers->of[i];
    if (p->generation != 0 && p->proxied) {
      sum += 0.5 * hapi_v3_dot(p->wrench.force, p->wrench.force) / p->coupling.stiffness;
      sum += 0.5 * p->coupling.mass * hapi_v3_dot(p->proxy.velocity, p->proxy.velocity);
      if (p->shape.hull != NULL) {
        sum += 0.5 * p->coupling.inertia * hapi_v3_dot(p->proxy.spin, p->proxy.spin);
        sum += 0.5 * hapi_v3_dot(p->wrench.torque, p->wrench.torque) / p->coupling.spin_stiffness;
      }
    }
  }
  return sum;
}

/* J that the written force of contacts gave to the hand in the seconds since the last tick. A way
 * that no hand goes in that time is a jump: nobody put in what it would have cost, and nobody got
 * more than at the fastest. */
static double port_gave(const hapi_pointer *p, double seconds)
{
  const hapi_guard_pointer *g = &p->guard;
  double gave = world_per_device(p) * (hapi_v3_dot(g->contact.force, g->moved) +
                                       hapi_v3_dot(g->contact.torque, g->turned));
  double way = hapi_v3_norm(g->moved);
  double farthest = p->device.speed_limit * seconds;
  if (!p->device.jumped) {
    return gave;
  }
  return way > farthest ? hapi_max(gave, 0.0) * farthest / way : hapi_max(gave, 0.0);
}

/* J that the base's motion did on the springs since the last tick, against the mean of the forces
 * on the hand before and after it. */
static double base_gave(const hapi_pointer *p)
{
  const hapi_pointer_frame *f = &p->frame;
  const double *turn = p->device.pose_world_device.quat_wxyz;
  double force[3];
  double torque[3];
  if (!f->used || !(p->device.force_scale > 0.0)) {
    return 0.0;
  }
  hapi_v3_add(p->guard.written.force, p->device.wrench.force, force);
  hapi_v3_add(p->guard.written.torque, p->device.wrench.torque, torque);
  hapi_quat_rotate(turn, force, force);
  hapi_quat_rotate(turn, torque, torque);
  return -0.5 *
         (hapi_v3_dot(force, f->step) + p->device.motion_scale * hapi_v3_dot(torque, f->turned)) /
         p->device.force_scale;
}

static bool is_any(const double v[3])
{
  return v[0] != 0.0 || v[1] != 0.0 || v[2] != 0.0;
}

/* Pays and takes at the ports; whether anything is felt. */
static bool settle_ports(hapi_guard *guard, const hapi_pointers *pointers, int64_t now_ns)
{
  bool felt = false;
  double seconds = 1e-9 * (double)(now_ns - guard->observed_ns);
  guard->observed_ns = now_ns;
  for (uint32_t i = 0; i < pointers->high; ++i) {
    hapi_pointer *p = &pointers->of[i];
    if (p->generation != 0) {
      felt = felt || is_any(p->device.wrench.force) || is_any(p->guard.contact.force) ||
             is_any(p->guard.contact.torque);
      guard->balance -= port_gave(p, seconds);
      guard->balance += base_gave(p);
    }
  }
  return felt;
}

/* J that a force on a way, or a torque on a turn, gives; world units. */
static double would_give(const hapi_pointer *p, const double force[3], const double way[3])
{
  return hapi_v3_dot(way, way) < MOVED_LEAST ? 0.0 : world_per_device(p) * hapi_v3_dot(force, way);
}

/* Leaves a share of the force's part along the motion, where it gives. */
static void hold_back(hapi_pointer *p, double force[3], const double way[3], double share)
{
  if (share < 1.0 && would_give(p, force, way) > 0.0) {
    double along = hapi_v3_dot(force, way) / hapi_v3_dot(way, way);
    hapi_v3_madd(force, -(1.0 - share) * along, way, force);
    p->guard.flags |= HAP_GUARD_ENERGY;
  }
}

/* A force that is to be cut by much, on a way that turned round in the last tick and in this one.
 * No hand goes so; positions with noise do, and the force would come and go with them. */
static void shake_note(hapi_pointer *p, double gives, double share)
{
  hapi_guard_pointer *g = &p->guard;
  double way = world_per_device(p) * hapi_v3_norm(g->moved);
  double most = HAPI_SAFETY_SHAKE_LARGE * p->device.limits.max_force;
  p->belief.shakes = gives > 0.0 && (1.0 - share) * gives > most * way && p->belief.turns >= 2;
}

#define EASED_MOST 1000.0 /* ticks */

/* N, most of a force along a way a tick that falls to zero by a rate a tick, and gives no more than
 * a budget meanwhile. Over m ticks m f - rate m (m - 1) / 2 is budget / way. */
static double eased_force(double budget, double way, double rate)
{
  double all = budget / way;
  double ticks = 0.5 * (sqrt(1.0 + 8.0 * all / rate) - 1.0);
  double m = 1.0 + (double)(int)hapi_min(ticks, EASED_MOST);
  return all / m + 0.5 * rate * (m - 1.0);
}

/* 0..1, share of a pointer's force along its way that can still go down slowly before its part of
 * the budget is spent. After a gap a debt may come in the middle of a press: taken at once when
 * nothing is left, all of the force would be one step. What is taken earlier is only ever less. A
 * spring that goes down faster by itself, as the hand draws back, sets the rate. */
static double eased_share(const hapi_pointer *p, double period, double budget)
{
  const hapi_guard_pointer *g = &p->guard;
  double way = hapi_v3_norm(g->moved);
  double along = hapi_v3_dot(p->device.wrench.force, g->moved) / way;
  double stiffness = g->change.explained.stiffness * p->device.motion_scale * p->device.force_scale;
  double rate =
      hapi_max(p->device.limits.max_force * period / HAPI_SAFETY_LATE_SLEW_S, stiffness * way);
  return hapi_min(eased_force(budget / world_per_device(p), way, rate) / along, 1.0);
}

static void pay_no_more_than(const hapi_pointers *pointers, double budget, double eased_period)
{
  double out = 0.0;
  double in = 0.0;
  for (uint32_t i = 0; i < pointers->high; ++i) {
    const hapi_pointer *p = &pointers->of[i];
    if (p->generation == 0) {
      continue;
    }
    double gives = would_give(p, p->device.wrench.force, p->guard.moved);
    double turns = would_give(p, p->device.wrench.torque, p->guard.turned);
    out += hapi_max(gives, 0.0) + hapi_max(turns, 0.0);
    in += hapi_max(-gives, 0.0) + hapi_max(-turns, 0.0);
  }
  bool hard = out - in > hapi_max(budget, 0.0);
  if (!hard && !(eased_period > 0.0 && out > 0.0)) {
    return;
  }
  double share = hard ? hapi_min(hapi_max((budget + in) / out, 0.0), 1.0) : 1.0;
  for (uint32_t i = 0; i < pointers->high; ++i) {
    hapi_pointer *p = &pointers->of[i];
    if (p->generation == 0) {
      continue;
    }
    double gives = would_give(p, p->device.wrench.force, p->guard.moved);
    double eased = eased_period > 0.0 && gives > 0.0 && budget + in > 0.0
                       ? eased_share(p, eased_period, (budget + in) * gives / out)
                       : 1.0;
    shake_note(p, gives, hapi_min(share, eased));
    hold_back(p, p->device.wrench.force, p->guard.moved, hapi_min(share, eased));
    hold_back(p, p->device.wrench.torque, p->guard.turned, share);
  }
}

void hapi_energy_pass(double period, const hapi_pointers *pointers)
{
  for (uint32_t i = 0; i < pointers->high; ++i) {
    pointers->of[i].guard.paid_way = HAPI_SAFETY_CONTACT_SPEED * period;
    pointers->of[i].guard.given_share = 0.0;
  }
}

/* After a fault nothing is known of where the devices were. */
static void ledger_forget(hapi_guard *guard, const hapi_pointers *pointers,
                          const hapi_touches *touches)
{
  guard->balance = 0.0;
  guard->sprung = guard->touch_s = 0.0;
  for (uint32_t i = 0; i < pointers->high; ++i) {
    pointers->of[i].guard.placed = false;
  }
  for (uint32_t i = 0; i < touches->count; ++i) {
    hapi_ramp *r = &touches->of[i].ramp;
    r->felt_share = r->felt = r->sprung = 0.0;
  }
}

/* What the devices did meanwhile nobody watched; what is owed is owed still. */
void hapi_energy_resume(hapi_guard *guard, const hapi_pointers *pointers, int64_t now_ns)
{
  guard->observed_ns = now_ns;
  for (uint32_t i = 0; i < pointers->high; ++i) {
    pointers->of[i].guard.placed = false;
  }
}

/* The depth that gaps held back comes in as far as the hand has paid more than the springs hold:
 * with a way w no spring gains more than its largest force times w. In a touch that lasts a share
 * of the rest comes in, as debts are forgiven. */
static void pointers_may_press(const hapi_guard *guard, double period,
                               const hapi_pointers *pointers)
{
  bool lasts = guard->touch_s > HAPI_SAFETY_DEBT_AFTER_S;
  double spare = hapi_max(guard->balance - guard->sprung, 0.0);
  double force = 0.0;
  for (uint32_t i = 0; i < pointers->high; ++i) {
    const hapi_pointer *p = &pointers->of[i];
    force += p->generation != 0 ? p->guard.limit * (double)p->contacts : 0.0;
  }
  double way = HAPI_SAFETY_CONTACT_SPEED * period;
  way = spare < way * force ? spare / force : way;
  for (uint32_t i = 0; i < pointers->high; ++i) {
    pointers->of[i].guard.paid_way = way;
    pointers->of[i].guard.given_share = lasts ? hapi_min(period / HAPI_SAFETY_DEBT_S, 1.0) : 0.0;
  }
}

void hapi_energy_observe(hapi_guard *guard, const hapi_tick_facts *facts,
                         const hapi_pointers *pointers, const hapi_bodies *bodies,
                         const hapi_touches *touches)
{
  if (guard->latch.fault != HAP_FAULT_NONE) {
    ledger_forget(guard, pointers, touches);
    return;
  }
  double given = bodies->given + ramps_give(guard, pointers, touches, facts->tick);
  if (!settle_ports(guard, pointers, facts->now_ns)) {
    guard->balance = hapi_min(guard->balance, 0.0);
    guard->touch_s = 0.0;
    guard->late.in_touch = false;
    pointers_may_press(guard, facts->period, pointers);
    return;
  }
  double stored = couplings_store(pointers);
  guard->balance += given + bodies_lose(facts, bodies, &stored) +
                    surfaces_give(facts, pointers, bodies, touches, &stored);
  guard->stored_max = hapi_max(stored, guard->stored_max);
  double overdraft =
      hapi_max(HAPI_SAFETY_OVERDRAFT * guard->stored_max, HAPI_SAFETY_OVERDRAFT_LEAST);
  /* A debt that comes all at once, after a time without the loop or when something vanished that
   * had been pressed, cannot be paid back by a hand that rests: its force would come and go for
   * ever. So in a touch that lasts, the ledger comes back to what is in the springs. */
  guard->touch_s += facts->elapsed;
  if (guard->touch_s > HAPI_SAFETY_DEBT_AFTER_S && guard->balance < guard->sprung) {
    guard->balance +=
        (guard->sprung - guard->balance) * hapi_min(facts->elapsed / HAPI_SAFETY_DEBT_S, 1.0);
  }
  pointers_may_press(guard, facts->period, pointers);
  pay_no_more_than(pointers, guard->balance + overdraft,
                   guard->late.in_touch ? facts->period : 0.0);
}
