/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "remote/bound.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/vec.h"

#define SAVED_S 0.1  /* for which the hand's power is saved up */
#define HELD_S 1.0   /* for which its force is */
#define FADE_S 1.0   /* in which lost energy is forgotten, beside the time that messages take */
#define SLACK_M 0.1  /* that a body may be elsewhere without speed: pushed out of another one */
#define ARM_M 1.0    /* of a push that turns */
#define HITS 2.0     /* of a driven body on the others, between two models */
#define ROUND_J 1e-6 /* of rounded numbers */

bool hapi_bound_create(hapi_bound *bound, uint32_t capacity, double late_s)
{
  bound->of = hapi_alloc_array(capacity, sizeof *bound->of);
  bound->capacity = bound->of != NULL ? capacity : 0;
  bound->late_s = late_s;
  return bound->of != NULL;
}

void hapi_bound_finish(hapi_bound *bound)
{
  hapi_free(bound->of);
  bound->of = NULL;
  bound->capacity = 0;
}

void hapi_bound_reset(hapi_bound *bound, int64_t now_ns)
{
  memset(bound->of, 0, bound->capacity * sizeof *bound->of);
  bound->limits = (hapi_limits){0.0, 0.0};
  bound->hand = bound->lost = bound->push = bound->power = bound->rest = 0.0;
  bound->now_ns = bound->taken_ns = now_ns;
}

/* They only grow: else a client could have the saved part again and again. */
void hapi_bound_allow(hapi_bound *bound, const hapi_limits *limits)
{
  const hapi_limits before = bound->limits;
  bound->limits.force = hapi_max(before.force, hapi_min(limits->force, bound->most.force));
  bound->limits.speed = hapi_max(before.speed, hapi_min(limits->speed, bound->most.speed));
  bound->hand +=
      SAVED_S * (bound->limits.force * bound->limits.speed - before.force * before.speed);
  bound->push += HELD_S * (bound->limits.force - before.force);
}

/* ---- energy ---- */

static double energy_moving(const hapi_bound_body *b, const hap_pose *pose, const hap_twist *twist)
{
  double spin[3];
  double momentum[3];
  hapi_quat_unrotate(pose->quat_wxyz, twist->angular, spin);
  hapi_m3_apply(b->inertia, spin, momentum);
  return 0.5 * b->mass * hapi_v3_dot(twist->linear, twist->linear) +
         0.5 * hapi_v3_dot(spin, momentum);
}

static double energy_of(const hapi_bound_body *b, const hap_pose *pose, const hap_twist *twist)
{
  return energy_moving(b, pose, twist) - b->mass * hapi_v3_dot(b->gravity, pose->position);
}

/* Change of velocity by an impulse and its moment. */
static void twist_push(const hapi_bound_body *b, const double push[6], const hap_pose *pose,
                       hap_twist *io)
{
  double turn[3];
  double spin[3];
  hapi_v3_madd(io->linear, 1.0 / b->mass, push, io->linear);
  hapi_quat_unrotate(pose->quat_wxyz, push + 3, turn);
  hapi_m3_apply(b->inverse_inertia, turn, spin);
  hapi_quat_rotate(pose->quat_wxyz, spin, turn);
  hapi_v3_add(io->angular, turn, io->angular);
}

/* ---- what the client is told ---- */

static void twist_scale(double scale, hap_twist *io)
{
  hapi_v3_scale(scale, io->linear, io->linear);
  hapi_v3_scale(scale, io->angular, io->angular);
}

/* A model is in the hand's time, in which masses are larger and speeds are lower. */
static void body_read(const hapi_model_body *in, double scale, hapi_bound_body *out)
{
  bool copy = (in->flags & HAPI_BODY_SHARED) != 0; /* the client is not asked about it */
  out->flags = copy ? (uint32_t)HAPI_BODY_DRIVEN : in->flags;
  out->epoch = in->epoch;
  out->mass = in->mass * scale * scale;
  hapi_v3_scale(1.0 / (scale * scale), in->gravity, out->gravity);
  for (int i = 0; i < 9; ++i) {
    out->inertia[i] = in->inertia[i] * scale * scale;
    out->inverse_inertia[i] = in->inverse_inertia[i] / (scale * scale);
  }
  out->pose = in->pose;
  out->twist = in->twist;
  twist_scale(1.0 / scale, &out->twist);
  memcpy(out->taken, in->impulse_taken, sizeof out->taken);
}

static double speed_of(const hap_twist *twist)
{
  return hapi_v3_norm(twist->linear) + ARM_M * hapi_v3_norm(twist->angular);
}

/* W, of the application's force on a body, which makes the body faster for as long as the loop has
 * not heard of it. */
static double power_of_body(const hapi_bound *bound, const hapi_model_body *in,
                            const hapi_bound_body *b)
{
  double force = hapi_v3_norm(in->user_wrench) + hapi_v3_norm(in->user_wrench + 3) / ARM_M;
  return force * (1.0 + speed_of(&b->twist) + 2.0 * bound->late_s * force / b->mass);
}

static double power_of_joint(const hapi_model_joint *joint)
{
  double power = hapi_v3_norm(joint->measured.given) + hapi_v3_norm(joint->measured.given + 3);
  for (int i = 0; i < HAPI_JOINT_LIMITS; ++i) {
    const hapi_model_limit *limit = &joint->limits[i];
    if ((limit->flags & HAPI_LIMIT_MOTOR) != 0) {
      power += limit->force * fabs(limit->speed);
    }
    if ((limit->flags & HAPI_LIMIT_SPRING) !=
        0) { /* all that it holds in a stretch of 1, a second */
      power += 0.5 * limit->spring.stiffness;
    }
  }
  return isfinite(power) ? power : HUGE_VAL;
}

/* m/s, of the fastest surface that moves under a body, as conveyors do. World's time. */
static double belt_speed(hapi_near *near, double scale)
{
  double fastest = 0.0;
  for (uint32_t i = 0; near != NULL && i < near->pair_count; ++i) {
    fastest = hapi_max(fastest, hapi_v3_norm(hapi_near_pairs(near)[i].surface.motion));
  }
  return fastest / scale;
}

void hapi_bound_note(hapi_bound *bound, hapi_model *model, hapi_near *near)
{
  double scale = model->time_scale;
  double mass = 0.0;
  double fastest = 0.0;
  double driven = 0.0;
  if (!(scale > 0.0)) { /* a pause: all stays as it is known */
    return;
  }
  const double power = bound->power; /* of bodies that have left, too, until the loop knows */
  bound->power = bound->rest = 0.0;
  for (uint32_t i = 0; i < model->body_count; ++i) {
    const hapi_model_body *in = &hapi_model_bodies(model)[i];
    hapi_bound_body *b = &bound->of[in->slot];
    double before = b->generation == in->generation && b->epoch == in->epoch
                        ? energy_of(b, &b->pose, &b->twist)
                        : (double)NAN;
    if (b->generation != in->generation) {
      *b = (hapi_bound_body){.generation = in->generation};
    }
    body_read(in, scale, b);
    if ((b->flags & HAPI_BODY_DRIVEN) != 0) {
      driven = hapi_max(driven, speed_of(&b->twist));
      continue;
    }
    double lost = before - energy_of(b, &b->pose, &b->twist);
    bound->lost += lost > 0.0 ? lost : 0.0;
    bound->power += b->mass > 0.0 ? power_of_body(bound, in, b) : 0.0;
    bound->rest += b->mass * hapi_v3_norm(b->gravity);
    mass += b->mass;
    fastest = hapi_max(fastest, speed_of(&b->twist));
  }
  for (uint32_t i = 0; i < model->joint_count; ++i) {
    bound->power += power_of_joint(&hapi_model_joints(model)[i]);
  }
  double belt = belt_speed(near, scale);
  bound->power += bound->rest * hapi_max(driven, belt);
  if (model->period_s > 0.0) { /* friction that takes bodies along: p v with p at most m (u + v) */
    bound->power += mass * belt * (belt + fastest) / model->period_s;
  }
  if (model->period_s > 0.0) { /* a wall that moves: p (u + v) with p at most 2 m (u + v) */
    bound->power += HITS * 2.0 * mass * driven * (driven + fastest) / model->period_s;
  }
  bound->power = hapi_max(bound->power, power * exp(-model->period_s / (FADE_S + bound->late_s)));
}

/* ---- what the client tells ---- */

/* What a state comes to. */
typedef struct bound_sum {
  double gain;   /* J, of bodies that the loop moves itself */
  double pushed; /* J, of others */
  double push;   /* N s, on others */
  double moving; /* J, before and after */
} bound_sum;

/* A body as it would be in the world. */
typedef struct bound_claim {
  bool moves; /* the loop says where it is */
  bool placed;
  double push[6];
  hap_pose pose;
  hap_twist twist;
} bound_claim;

static void claim_read(const hapi_bound_body *b, const hapi_state_body *in, double scale,
                       bound_claim *out)
{
  bool owned = (in->flags & HAPI_BODY_OWNED) != 0 && in->epoch == b->epoch;
  bool left = !owned && in->owned_until_ns > b->owned_until_ns && in->epoch == b->epoch;
  for (int k = 0; k < 3; ++k) {
    out->push[k] = scale * (in->impulse[k] - b->taken[k]);
    out->push[3 + k] = scale * (in->angular_impulse[k] - b->taken[3 + k]);
  }
  bool pushes = hapi_v3_norm(out->push) != 0.0 || hapi_v3_norm(out->push + 3) != 0.0; /* NaN does */
  out->moves = owned || left;
  out->placed = out->moves || pushes;
  out->pose = left ? in->owned_pose : owned || pushes ? in->pose : b->pose;
  out->twist = left ? in->owned_twist : owned ? in->twist : b->twist;
  if (owned) {
    twist_scale(1.0 / scale, &out->twist);
  }
}

static void claim_add(const hapi_bound_body *b, const bound_claim *claim, bound_sum *io)
{
  const hap_pose *at = claim->moves ? &claim->pose : &b->pose;
  hap_twist after = claim->twist;
  double given = energy_of(b, at, &after);
  if (claim->moves) {
    io->gain += given - energy_of(b, &b->pose, &b->twist);
  }
  twist_push(b, claim->push, at, &after);
  io->pushed += energy_of(b, at, &after) - given;
  io->push += hapi_v3_norm(claim->push) + hapi_v3_norm(claim->push + 3) / ARM_M;
  io->moving += energy_moving(b, &b->pose, &b->twist) + energy_moving(b, at, &after);
}

/* The claim of a record; NULL: of a body that nothing is taken for. */
static const hapi_bound_body *claim_at(const hapi_bound *bound, hapi_state *state, uint32_t slot,
                                       bound_claim *out)
{
  const hapi_state_body *in = &hapi_state_bodies(state)[slot];
  const hapi_bound_body *b = &bound->of[slot];
  double scale = state->time_scale > 0.0 ? state->time_scale : 1.0;
  if (in->generation == 0 || (b->flags & HAPI_BODY_DRIVEN) != 0 || !(b->mass > 0.0)) {
    return NULL;
  }
  claim_read(b, in, scale, out);
  return b;
}

/* Whether a body is farther than it may be; NaN is. */
static bool is_too_far(const hapi_bound *bound, const hapi_bound_body *b, const bound_claim *claim,
                       double most, double seconds)
{
  double way[3];
  double fast = hapi_max(hapi_v3_norm(b->twist.linear), hapi_v3_norm(claim->twist.linear));
  double speed = hapi_max(fast, sqrt(2.0 * most / b->mass));
  hapi_v3_sub(claim->pose.position, b->pose.position, way);
  return claim->placed && !(hapi_v3_norm(way) <= SLACK_M + speed * (seconds + bound->late_s));
}

static void bound_accrue(hapi_bound *bound, int64_t now_ns)
{
  double seconds = 1e-9 * (double)(now_ns - bound->now_ns);
  double hand = bound->limits.force * bound->limits.speed + bound->power;
  bound->now_ns = now_ns;
  if (seconds > 0.0) {
    bound->hand = hapi_min(bound->hand + hand * seconds, SAVED_S * hand);
    bound->lost *= exp(-seconds / (FADE_S + bound->late_s));
    bound->push += (bound->limits.force + bound->rest) * seconds;
  }
}

/* A push that was allowed for its time alone has no energy to lose. */
static void claims_keep(hapi_bound *bound, hapi_state *state, bool by_time)
{
  for (uint32_t i = 0; i < state->body_high; ++i) {
    bound_claim claim;
    hapi_bound_body *b = &bound->of[i];
    const hapi_state_body *in = &hapi_state_bodies(state)[i];
    if (claim_at(bound, state, i, &claim) == NULL) {
      continue;
    }
    b->pose = claim.moves ? claim.pose : b->pose;
    if (!by_time) {
      twist_push(b, claim.push, &b->pose, &claim.twist);
    }
    b->twist = claim.twist;
    b->owned_until_ns = in->owned_until_ns;
    hapi_v3_copy(in->impulse, b->taken);
    hapi_v3_copy(in->angular_impulse, b->taken + 3);
  }
}

/* Of those that move; NULL: all are near enough. */
static const hapi_bound_body *claims_too_far(const hapi_bound *bound, hapi_state *state,
                                             double most, double seconds)
{
  for (uint32_t i = 0; i < state->body_high; ++i) {
    bound_claim claim;
    const hapi_bound_body *b = claim_at(bound, state, i, &claim);
    if (b != NULL && is_too_far(bound, b, &claim, most, seconds)) {
      return b;
    }
  }
  return NULL;
}

bool hapi_bound_take(hapi_bound *bound, int64_t now_ns, hapi_state *io, hap_detail *why)
{
  bound_sum sum = {0};
  bound_claim claim;
  bound_accrue(bound, now_ns);
  for (uint32_t i = 0; i < io->body_high; ++i) {
    hapi_state_body *in = &hapi_state_bodies(io)[i];
    if (in->generation != bound->of[i].generation) {
      in->generation = 0;
    }
    const hapi_bound_body *b = claim_at(bound, io, i, &claim);
    if (b != NULL) {
      claim_add(b, &claim, &sum);
    }
  }
  double most = bound->hand + bound->lost + ROUND_J;
  bool by_time = sum.gain + sum.pushed > most && sum.push <= bound->push;
  double gain = by_time ? sum.gain : sum.gain + sum.pushed;
  if (!(gain <= most)) {
    snprintf(why->text, sizeof why->text,
             "the hand's session gives its bodies %.4g J and %.4g N s, and its device can give "
             "%.4g J and %.4g N s now: its state is not taken",
             sum.gain + sum.pushed, sum.push, most, bound->push);
    return false;
  }
  double seconds = 1e-9 * (double)(now_ns - bound->taken_ns);
  const hapi_bound_body *far = claims_too_far(bound, io, most + sum.moving, seconds);
  if (far != NULL) {
    snprintf(why->text, sizeof why->text,
             "the hand's session puts the body of slot %u farther than its device can: its state "
             "is not taken",
             (unsigned)(far - bound->of));
    return false;
  }
  claims_keep(bound, io, by_time);
  bound->taken_ns = now_ns;
  bound->push = hapi_min(by_time ? bound->push - sum.push : bound->push,
                         HELD_S * (bound->limits.force + bound->rest));
  double from_lost = hapi_min(hapi_max(gain, 0.0), bound->lost);
  bound->lost += gain < 0.0 ? -gain : -from_lost;
  bound->hand -= hapi_max(gain, 0.0) - from_lost;
  return true;
}
