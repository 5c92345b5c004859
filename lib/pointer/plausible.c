/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "pointer/plausible.h"

#include <string.h>

#include "base/plausible.h"
#include "base/safety.h"
#include "base/vec.h"

/* A hand has a bounded acceleration. So a device is near the line from where it was to where it
 * would be at its velocity: within what the largest change of velocity makes in the time since the
 * newest position. At high rates the line begins some ticks ago: the bound of 1 ms is not one for
 * each tick. What is farther off is false, or the device really jumped: an encoder slipped,
 * somebody pushed it. The two differ by what comes next.
 *
 *   false  The next positions are where the line is. Meanwhile the device is carried on, then held.
 *   jump   The next positions go on from the new place, by the same bound, for a few ms. Then they
 *          are believed, and contacts begin anew: nobody felt the way there (coupling.c).
 *   noise  Neither. Doubt adds up, as it does while the device itself says that it does not believe
 *          what it measures. Force fades with it and then a fault is latched. Noise within the
 *          bound of a hand makes energy of a spring, which the observer takes; where that takes
 *          much of the force, to and fro, it counts as doubt, too.
 *
 * Time between positions is what counts, not the tick: some devices tell the same position for
 * several ticks. They are known by the time before each change of more than some quanta
 * (device_pace.h).
 *
 * Such a device tells another position when the next one is due. Of several that come within half
 * of that time, one is right at most. Each is judged by the way before the first of them; the one
 * that is told for the longer time is believed. Of two as long it is the older one, until half of
 * the time is over. So a false one that comes when one is due costs the right one about as many
 * ticks as it lasted. It is hardly felt: what is off the line comes in once it is told again. */

#define HIT_MOST \
  (HAPI_SAFETY_ACCELERATION_LIMIT * HAPI_SAFETY_JUDGE_S * HAPI_SAFETY_JUDGE_S) /* m */
#define GAP_TICKS 1.5 /* ticks between two positions, from which on the device is slow */

static double seconds_between(int64_t from_ns, int64_t to_ns)
{
  return 1e-9 * (double)(to_ns - from_ns);
}

static bool pointer_turns(const hapi_pointer *p)
{
  return p->shape.hull != NULL && !p->device.three_dof;
}

/* rad, to the third order of a small angle */
static double turn_between(const double a[4], const double b[4])
{
  double dot = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
  return 2.0 * sqrt(hapi_max(1.0 - dot * dot, 0.0));
}

/* Off the line, after some time without another pose. In a ms a hand may hit something; for longer
 * it is the hand alone that accelerates. The acceleration may have begun at any time since the pose
 * before, but what had begun was seen: the newest pose was off its own line already. */
static double way_most(const hapi_pointer *p, double seconds, double off_before)
{
  double swing = HAPI_SAFETY_SWING_LIMIT * seconds * seconds;
  double begun = sqrt(off_before + p->velocity.quantum) + sqrt(0.5 * swing);
  return hapi_max(HIT_MOST, hapi_min(begun * begun, swing)) +
         HAPI_SAFETY_QUANTA * p->velocity.quantum;
}

/* To a place, from the nearest one on the way that begins at from and takes so long. */
static double off_way(const double from[3], const double velocity[3], double seconds,
                      const double at[3], double out[3])
{
  double along = 0.0;
  double speed2 = hapi_v3_dot(velocity, velocity);
  hapi_v3_sub(at, from, out);
  if (speed2 > 0.0) {
    along = hapi_max(hapi_min(hapi_v3_dot(out, velocity) / speed2, seconds), 0.0);
  }
  hapi_v3_madd(out, -along, velocity, out);
  return hapi_v3_norm(out);
}

static double gap_or_tick(const hapi_pointer_belief *b)
{
  return hapi_max(b->way.pace.gap, HAPI_SAFETY_JUDGE_S);
}

static bool pose_is_plausible(const hapi_pointer *p, const hapi_believed_way *w, int64_t now_ns)
{
  const hap_pose *pose = &p->device.pose;
  double passed = seconds_between(w->line_ns, now_ns);
  double tick = seconds_between(p->belief.read_ns, now_ns);
  double time = hapi_min(passed, hapi_max(w->pace.gap, tick));
  double way[3];
  double from_way[3];
  hapi_v3_sub(pose->position, w->line.position, way);
  /* What is told now may be of any time in the last tick. */
  bool off = off_way(w->line.position, w->velocity, passed + tick, pose->position, from_way) >
             way_most(p, time, w->off);
  if (hapi_v3_norm(way) > HAPI_SAFETY_SPEED_LIMIT * hapi_max(passed, HAPI_SAFETY_JUDGE_S)) {
    return false;
  }
  bool turned = pointer_turns(p) && turn_between(pose->quat_wxyz, w->line.quat_wxyz) >
                                        w->spin * passed + HAPI_SAFETY_SPIN_CHANGE *
                                                               hapi_max(time, HAPI_SAFETY_JUDGE_S);
  return !p->belief.paced || (!off && !turned);
}

static bool is_news(const hapi_pointer *p, const hap_pose *told)
{
  const hap_pose *pose = &p->device.pose;
  return memcmp(pose->position, told->position, sizeof pose->position) != 0 ||
         (pointer_turns(p) &&
          memcmp(pose->quat_wxyz, told->quat_wxyz, sizeof pose->quat_wxyz) != 0);
}

/* Whether the pose goes on from those elsewhere. */
static bool goes_on(const hapi_pointer *p, const double way[3], double tick)
{
  const hapi_elsewhere *e = &p->belief.elsewhere;
  const hap_pose *pose = &p->device.pose;
  double time = hapi_max(e->since, HAPI_SAFETY_JUDGE_S);
  double off[3];
  bool near = e->moved
                  ? off_way(e->pose.position, e->velocity, e->since + tick, pose->position, off) <=
                        way_most(p, e->since, e->since * e->since * HAPI_SAFETY_SWING_LIMIT)
                  : hapi_v3_norm(way) <= HAPI_SAFETY_SPEED_LIMIT * time;
  return near && (!pointer_turns(p) || turn_between(pose->quat_wxyz, e->pose.quat_wxyz) <=
                                           HAPI_SAFETY_SPIN_LIMIT * time);
}

/* A new place, and then no other for some ticks: the device may be slow. Of one no more than twice
 * what was known is learned, as it may have jumped as well. */
static void tell_seldom(hapi_pointer_belief *b, int64_t now_ns)
{
  double since = b->elsewhere.since;
  double before = seconds_between(b->way.sample_ns, now_ns) - since;
  hapi_device_pace_set(&b->way.pace, hapi_max(hapi_min(2.0 * b->way.pace.gap, before), since));
}

/* A pose that is not plausible. True: poses have gone on from there for long enough. */
static bool follow_elsewhere(hapi_pointer *p, double seconds, int64_t now_ns)
{
  hapi_elsewhere *e = &p->belief.elsewhere;
  const hap_pose *pose = &p->device.pose;
  double way[3];
  hapi_v3_sub(pose->position, e->pose.position, way);
  e->since += seconds;
  if (!e->known || !goes_on(p, way, seconds)) {
    *e = (hapi_elsewhere){.known = true, .pose = *pose};
    return false;
  }
  e->seconds += seconds;
  if (!e->moved && hapi_v3_norm(way) > way_most(p, e->since, 0.0)) {
    e->seconds = 0.0; /* a second place so far away as well: which is it? */
  }
  if (hapi_v3_norm(way) > 0.0 && e->since > 0.0) {
    hapi_v3_scale(1.0 / e->since, way, e->velocity);
    hapi_device_pace_note(&p->belief.way.pace, e->since);
    e->moved = true;
    e->since = 0.0;
  }
  e->pose = *pose;
  if (e->seconds < HAPI_SAFETY_CONFIRM_S - 1e-9) {
    return false;
  }
  if (!e->moved) {
    tell_seldom(&p->belief, now_ns);
  }
  return true;
}

/* A pose that is believed. The share of time decides between two places that are told in turn: a
 * false pose that agrees with the line for a moment does not make the others begin anew. */
static void elsewhere_fade(hapi_elsewhere *e, double seconds)
{
  e->since += seconds;
  e->seconds -= seconds;
  if (e->seconds <= 0.0) {
    *e = (hapi_elsewhere){.known = false};
  }
}

/* The line goes on from here; leapt: from where the poses went elsewhere. */
static void line_take(hapi_pointer *p, int64_t now_ns, bool leapt)
{
  hapi_pointer_belief *b = &p->belief;
  hapi_believed_way *w = &b->way;
  double passed = seconds_between(w->line_ns, now_ns);
  double way[3];
  hapi_v3_sub(p->device.pose.position, w->line.position, way);
  hapi_v3_copy(w->velocity, w->velocity_before);
  if (leapt) {
    hapi_v3_copy(b->elsewhere.velocity, w->velocity);
    w->off = HAPI_SAFETY_SWING_LIMIT * HAPI_SAFETY_GAP_MOST_S * HAPI_SAFETY_GAP_MOST_S;
  } else if (passed > 0.0) {
    double off[3];
    hapi_v3_madd(way, -passed, w->velocity, off);
    w->off = hapi_v3_norm(off);
    hapi_v3_scale(1.0 / passed, way, w->velocity);
    w->spin =
        pointer_turns(p) ? turn_between(p->device.pose.quat_wxyz, w->line.quat_wxyz) / passed : 0.0;
  }
  w->line = p->device.pose;
  w->line_ns = now_ns;
  b->paced = true;
}

/* At a new place, which the device told after so long. The line is made of poses that are not too
 * near in time: else its velocity would be noise, and the bound another one at each rate. */
static void sample_take(hapi_pointer *p, int64_t now_ns, int64_t due_ns, bool leapt)
{
  hapi_believed_way *w = &p->belief.way;
  double step[3];
  hapi_v3_sub(p->device.pose.position, w->told.position, step);
  double least = hapi_max(HAPI_SAFETY_QUANTA * p->velocity.quantum, HAPI_SAFETY_STEP_LEAST);
  if (!leapt && hapi_v3_norm(step) > least) {
    hapi_device_pace_note(&w->pace, seconds_between(w->sample_ns, due_ns));
  }
  if (leapt || seconds_between(w->line_ns, now_ns) > 0.5 * HAPI_SAFETY_JUDGE_S) {
    line_take(p, now_ns, leapt);
  }
  w->told = p->device.pose;
  w->sample_ns = due_ns;
}

/* From where it was felt last: what is nearer comes in as it is, a little late. */
static bool is_far(const hapi_pointer *p)
{
  double way[3];
  hapi_v3_sub(p->device.pose.position, p->device.good.position, way);
  return hapi_v3_norm(way) > HAPI_SAFETY_JUMP_LEAST ||
         (pointer_turns(p) && turn_between(p->device.pose.quat_wxyz, p->device.good.quat_wxyz) >
                                  HAPI_SAFETY_SPIN_CHANGE * HAPI_SAFETY_JUDGE_S);
}

static double shorter_of(double a, double b)
{
  return a * b > 0.0 ? (fabs(a) < fabs(b) ? a : b) : 0.0;
}

/* On as it went, no faster than a hand is sure to, and then not at all. Of the newest two
 * velocities the smaller counts: the last pose before may have been false, too. */
static void pose_carry(hapi_pointer *p, int64_t now_ns)
{
  const hapi_believed_way *w = &p->belief.way;
  double passed = seconds_between(p->belief.believe_ns, now_ns);
  double velocity[3];
  for (int i = 0; i < 3; ++i) {
    velocity[i] = shorter_of(w->velocity[i], w->velocity_before[i]);
  }
  (void)hapi_v3_shorten(velocity, HAPI_SAFETY_CARRY_SPEED);
  p->device.pose = w->told;
  hapi_v3_madd(w->told.position, hapi_min(passed, HAPI_SAFETY_CARRY_S), velocity,
               p->device.pose.position);
  memset(&p->device.twist, 0, sizeof p->device.twist);
  if (passed <= HAPI_SAFETY_CARRY_S) {
    hapi_v3_copy(velocity, p->device.twist.linear);
  }
}

/* What doubt takes of the force, and how it goes away. A device that is doubted before it pushes
 * comes in later: its strings are being wound in. */
static void doubt_follow(hapi_pointer *p, bool doubted, double seconds)
{
  hapi_pointer_belief *b = &p->belief;
  bool pushes = p->guard.share > 0.0;
  b->doubted = doubted;
  b->doubt_s += b->shakes ? HAPI_SAFETY_SHAKE_S : 0.0;
  b->doubt_s = doubted  ? b->doubt_s + seconds
               : pushes ? hapi_max(b->doubt_s - HAPI_SAFETY_DOUBT_FORGET * seconds, 0.0)
                        : 0.0;
  double most = pushes ? HAPI_SAFETY_DOUBT_FADE_S : HAPI_SAFETY_MISFIT_S;
  double loss = (b->doubt_s - HAPI_SAFETY_CARRY_S) / most;
  double back = b->loss - seconds / HAPI_SAFETY_RAMP_IN_S;
  b->loss = hapi_min(hapi_max(hapi_max(loss, back), 0.0), 1.0);
}

/* A device that tells seldom went its way in all of the gap, and tells it at once. What it is off
 * its line by comes in as of a device that tells at every ms: else it would be a step of the force.
 */
static void late_take(hapi_pointer *p, int64_t now_ns, double tick)
{
  hapi_believed_way *w = &p->belief.way;
  double passed = seconds_between(w->line_ns, now_ns) + tick;
  double off[3];
  if (!(hapi_input_gap(p, tick) > 0.0) || p->belief.jumped) {
    hapi_v3_set(w->late, 0.0, 0.0, 0.0);
    return;
  }
  double way = off_way(w->line.position, w->velocity, passed, p->device.pose.position, off);
  double most = HAPI_SAFETY_QUANTA * p->velocity.quantum;
  if (way > most) {
    hapi_v3_madd(w->late, 1.0 - most / way, off, w->late);
  }
}

static void late_follow(hapi_believed_way *w, double seconds)
{
  double comes = HIT_MOST / HAPI_SAFETY_JUDGE_S * seconds;
  (void)hapi_v3_shorten(w->late, hapi_max(hapi_v3_norm(w->late) - comes, 0.0));
}

/* It stands still. */
static void rest_take(hapi_believed_way *w)
{
  hapi_v3_set(w->velocity, 0.0, 0.0, 0.0);
  hapi_v3_set(w->velocity_before, 0.0, 0.0, 0.0);
  w->spin = w->off = 0.0;
}

/* Too early for another position of a device that tells each for some time. */
static bool is_soon(const hapi_believed_way *w, int64_t now_ns, double tick)
{
  return w->pace.gap > HAPI_SAFETY_VOTE_TICKS * tick &&
         seconds_between(w->sample_ns, now_ns) < HAPI_SAFETY_SOON_SHARE * w->pace.gap;
}

/* Whether the pose that came last has to give way to the one that is told now. Soon after it this
 * one is a vote against it; a later one counts as long as the last one has no votes. */
static bool votes_turn(hapi_pointer *p, bool soon, int64_t now_ns, double tick)
{
  hapi_pointer_belief *b = &p->belief;
  bool back = !is_news(p, &b->before.told);
  b->votes -= soon ? tick : 0.0;
  double least = soon && !back ? -0.5 * tick : 0.5 * tick;
  return b->votes < least && (back || !b->paced || pose_is_plausible(p, &b->before, now_ns));
}

/* s that a pose has to be told before a velocity is made of it: a damper makes force of it at
 * once. */
static double sure_after(const hapi_pointer_belief *b)
{
  return hapi_min(HAPI_SAFETY_JUDGE_S, HAPI_SAFETY_SURE_SHARE * b->way.pace.gap);
}

/* The pose that is told stays, though the device tells another one. */
static void pose_keep(hapi_pointer *p)
{
  const hapi_believed_way *w = &p->belief.way;
  p->device.pose = w->told;
  hapi_v3_copy(w->velocity, p->device.twist.linear);
}

static void way_begin(hapi_pointer_belief *b, const hap_pose *pose, int64_t now_ns)
{
  b->known = true;
  b->paced = false;
  b->way =
      (hapi_believed_way){.sample_ns = now_ns, .told = *pose, .line_ns = now_ns, .line = *pose};
  b->before = b->way;
  b->elsewhere.known = false;
  b->votes = 0.0;
  b->sure = true;
}

bool hapi_input_judge(hapi_pointer *pointer, int64_t now_ns, bool doubted)
{
  hapi_pointer *p = pointer;
  hapi_pointer_belief *b = &p->belief;
  double seconds = seconds_between(b->read_ns, now_ns);
  b->jumped = false;
  if (!(p->device.speed_limit > 0.0) || !hapi_plausible(p->device.pose.position, 3) ||
      !hapi_plausible(p->device.pose.quat_wxyz, 4)) {
    b->known = false;
    return true;
  }
  if (!b->known || seconds < 0.0 || seconds > HAPI_SAFETY_UNREAD_S) {
    seconds = 0.0;
    way_begin(b, &p->device.pose, now_ns);
  }
  bool news = is_news(p, &b->way.told);
  bool soon = news && is_soon(&b->way, now_ns, seconds);
  bool torn = soon && !pose_is_plausible(p, &b->way, now_ns);
  bool turns = news && votes_turn(p, soon, now_ns, seconds);
  int64_t due_ns = turns ? b->way.sample_ns : now_ns;
  if (turns) {
    b->way = b->before;
    b->votes = 0.0;
    b->sure = soon = false;
    news = is_news(p, &b->way.told);
  }
  if (!news) {
    b->votes += seconds;
    b->sure = b->sure || turns || b->votes > sure_after(b) - 0.5 * seconds;
  }
  if (!soon && !turns) {
    late_follow(&b->way, seconds);
  }
  bool believed = !news || pose_is_plausible(p, &b->way, now_ns);
  bool leapt = false;
  if (!believed) {
    believed = leapt = follow_elsewhere(p, seconds, now_ns);
    b->jumped = leapt && is_far(p);
  } else {
    elsewhere_fade(&b->elsewhere, seconds);
  }
  double stood = seconds_between(b->way.sample_ns, now_ns);
  b->paced = b->paced || stood > HAPI_SAFETY_GAP_MOST_S;
  if (believed && soon && !leapt) {
    pose_keep(p);
  } else if (believed && news) {
    b->before = b->way;
    b->votes = seconds;
    b->sure = false;
    late_take(p, now_ns, seconds);
    sample_take(p, now_ns, due_ns, leapt);
    b->before = leapt ? b->way : b->before;
  } else if (believed && stood > HAPI_SAFETY_REST_GAPS * gap_or_tick(b)) {
    rest_take(&b->way);
  }
  if (believed) {
    b->elsewhere.known = b->elsewhere.known && !leapt;
    b->believe_ns = now_ns;
  } else {
    pose_carry(p, now_ns);
  }
  hapi_v3_sub(p->device.pose.position, b->way.late, p->device.pose.position);
  b->read_ns = now_ns;
  doubt_follow(p, doubted || torn || !believed, seconds);
  return believed;
}

double hapi_input_gap(const hapi_pointer *pointer, double period)
{
  double gap = pointer->belief.way.pace.gap;
  return gap > GAP_TICKS * period ? gap : 0.0;
}

const hap_pose *hapi_input_told(const hapi_pointer *pointer)
{
  const hapi_pointer_belief *b = &pointer->belief;
  return b->sure ? &b->way.told : &b->before.told;
}

void hapi_input_judge_twist(hapi_pointer *pointer)
{
  hapi_pointer *p = pointer;
  const hapi_pointer_belief *b = &p->belief;
  double *v = p->device.twist.linear;
  double off[3];
  double most = HAPI_SAFETY_ACCELERATION_LIMIT * HAPI_SAFETY_JUDGE_S +
                HAPI_SAFETY_QUANTA * p->velocity.quantum / HAPI_SAFETY_JUDGE_S;
  if (!b->known || !b->paced || !hapi_plausible(v, 3)) {
    return;
  }
  if (!p->device.estimates) { /* it may be newer than the line by a gap and a half */
    most += 1.5 * HAPI_SAFETY_SWING_LIMIT * b->way.pace.gap;
  }
  hapi_v3_sub(v, b->way.velocity, off);
  if (hapi_v3_dot(off, off) > most * most) {
    (void)hapi_v3_shorten(off, most);
    hapi_v3_add(b->way.velocity, off, v);
  }
}

void hapi_input_forgive(hapi_pointer *pointer)
{
  pointer->belief.doubt_s = pointer->belief.loss = 0.0;
}
