/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "physics/course.h"

#include <math.h>
#include <string.h>

#include "base/vec.h"

/* A kinematic body is at a sync where the application has put it, or where its velocity has brought
 * it. Until the next one the loop has to guess. Two guesses are at hand: the velocity that the body
 * has now, and a polynomial through the places of the last syncs, of an order from 0 (it stands) to
 * HAPI_COURSE_ORDER. Which of them is good depends on the application. So each is tried at every
 * sync on the way that the body has really made, and what has missed least of late is used, the
 * simplest of those that are about as good. A motion without rhyme is followed by a low order, a
 * smooth one by a high one, and one that was put elsewhere stands. */

#define ORDERS (HAPI_COURSE_ORDER + 1) /* with that of standing */
#define FORGET 0.5                     /* of a miss, at each sync */
#define AS_GOOD 1.5                    /* times the least miss */
#define MISS_LEAST 1e-9                /* m, rad: rounding */
#define JUMP 4.0      /* times the longest of the last ways, that all have missed: put elsewhere */
#define PUT_BACK 0.01 /* of the way that its velocity makes expect */
#define BETTER 0.5    /* of the miss of the order below: one more is taken on trust */
#define TURN_SHOWN 1.57 /* rad in a step, from which on poses alone do not say how far it turned */

static double part_norm(const double v[6], int part)
{
  return hapi_v3_norm(v + 3 * part);
}

static double part_apart(const double a[6], const double b[6], int part)
{
  double off[3];
  hapi_v3_sub(a + 3 * part, b + 3 * part, off);
  return hapi_v3_norm(off);
}

/* Backward differences of the ways, (-1)^j C(order, j + 1). */
static void way_foretold(double ways[][6], int order, double out[6])
{
  double share = 1.0;
  memset(out, 0, 6 * sizeof *out);
  for (int j = 0; j < order; ++j) {
    share *= (double)(order - j) / (double)(j + 1);
    for (int k = 0; k < 6; ++k) {
      out[k] += (j % 2 == 0 ? share : -share) * ways[j][k];
    }
  }
}

/* q = turn about a vector. */
static void turn_quat(const double turn[3], double out[4])
{
  double angle = hapi_v3_norm(turn);
  double scale = angle > 1e-9 ? sin(0.5 * angle) / angle : 0.5;
  out[0] = cos(0.5 * angle);
  hapi_v3_scale(scale, turn, out + 1);
}

static void quat_turn(const double q[4], double out[3])
{
  double sine = hapi_v3_norm(q + 1);
  double angle = 2.0 * atan2(sine, fabs(q[0]));
  hapi_v3_scale(sine > 0.0 ? (q[0] < 0.0 ? -angle : angle) / sine : 0.0, q + 1, out);
}

/* A fast turn is more than poses show: the rest beside what its velocity makes of it. */
static void way_between(const hap_pose *from, const hap_pose *to, const double set[6],
                        double out[6])
{
  const double back[4] = {from->quat_wxyz[0], -from->quat_wxyz[1], -from->quat_wxyz[2],
                          -from->quat_wxyz[3]};
  double turn[4];
  hapi_v3_sub(to->position, from->position, out);
  hapi_quat_multiply(to->quat_wxyz, back, turn);
  if (part_norm(set, 1) <= TURN_SHOWN) {
    quat_turn(turn, out + 3);
    return;
  }
  double known[4];
  hapi_v3_scale(-1.0, set + 3, out + 3);
  turn_quat(out + 3, known);
  hapi_quat_multiply(turn, known, turn);
  quat_turn(turn, out + 3);
  hapi_v3_add(out + 3, set + 3, out + 3);
}

static void way_of_twist(const hap_twist *twist, double seconds, double out[6])
{
  hapi_v3_scale(seconds, twist->linear, out);
  hapi_v3_scale(seconds, twist->angular, out + 3);
}

static double miss_fold(double before, double now)
{
  return fmax(now, FORGET * before);
}

/* Tries all guesses on the newest way. True: it moved, and went on in no way that lets expect. */
static bool guesses_try(hapi_course_past *past, const double way[6], int part)
{
  double least = past->moves ? part_apart(past->set, way, part) : HUGE_VAL;
  double longest = 0.0;
  past->missed_set[part] = miss_fold(past->missed_set[part], past->moves ? least : 0.0);
  for (uint32_t order = 0; order < ORDERS && order <= past->count; ++order) {
    double guess[6];
    way_foretold(past->ways, (int)order, guess);
    double miss = part_apart(guess, way, part);
    past->missed[part][order] = miss_fold(past->missed[part][order], miss);
    least = fmin(least, miss);
  }
  for (uint32_t i = 0; i < past->count; ++i) {
    longest = fmax(longest, part_norm(past->ways[i], part));
  }
  return longest > MISS_LEAST && least > JUMP * longest;
}

static void past_forget(hapi_course_past *past)
{
  past->count = 0;
  memset(past->missed, 0, sizeof past->missed);
  memset(past->missed_set, 0, sizeof past->missed_set);
}

/* The steps have become longer or shorter: about what it would have gone in such ones. */
static void past_stretch(hapi_course_past *past, double ratio)
{
  for (uint32_t i = 0; i < past->count; ++i) {
    hapi_v3_scale(ratio, past->ways[i], past->ways[i]);
    hapi_v3_scale(ratio, past->ways[i] + 3, past->ways[i] + 3);
  }
  for (int i = 0; i < ORDERS; ++i) {
    past->missed[0][i] *= ratio;
    past->missed[1][i] *= ratio;
  }
}

void hapi_course_set(hapi_course_past *past, const hap_twist *twist, double seconds)
{
  way_of_twist(twist, seconds, past->set);
  past->moves = part_norm(past->set, 0) + part_norm(past->set, 1) > 0.0;
}

void hapi_course_note(hapi_course_past *past, const hap_pose *pose, const hap_twist *twist,
                      double seconds)
{
  double now[6];
  way_of_twist(twist, seconds, now);
  if (seconds > 0.0 && past->known) {
    double way[6];
    way_between(&past->place, pose, now, way);
    if (past->seconds > 0.0 && seconds != past->seconds) {
      past_stretch(past, seconds / past->seconds);
    }
    bool jumps = guesses_try(past, way, 0);
    jumps = guesses_try(past, way, 1) || jumps;
    if (jumps) {
      past_forget(past);
    } else {
      memmove(past->ways[1], past->ways[0], (ORDERS - 1) * sizeof past->ways[0]);
      memcpy(past->ways[0], way, sizeof way);
      past->count += past->count < ORDERS;
    }
    past->seconds = seconds;
  }
  if (seconds > 0.0 || !past->known) {
    past->known = true;
    past->place = *pose;
  }
  hapi_course_set(past, twist, seconds);
}

void hapi_course_stand(hapi_course_past *past, const hap_pose *pose, double seconds, uint32_t syncs)
{
  *past = (hapi_course_past){
      .known = true, .count = syncs < ORDERS ? syncs : ORDERS, .seconds = seconds, .place = *pose};
}

/* The lowest order, beginning with one, that has missed about as little as the best. */
static int order_choose(const hapi_course_past *past, int part, int from, double best)
{
  const double *missed = past->missed[part];
  int tried = past->count > 0 ? (int)past->count - 1 : 0;
  int order = from;
  while (order < tried && missed[order] > AS_GOOD * best + MISS_LEAST) {
    ++order;
  }
  bool helps = order > 0 && order == tried && tried < HAPI_COURSE_ORDER &&
               missed[order] + MISS_LEAST < BETTER * missed[order - 1];
  return helps ? order + 1 : order;
}

static double least_missed(const hapi_course_past *past, int part, int from)
{
  int tried = past->count > 0 ? (int)past->count - 1 : 0;
  double best = past->missed[part][from < tried ? from : tried];
  for (int order = from; order <= tried; ++order) {
    best = fmin(best, past->missed[part][order]);
  }
  return best;
}

/* Newton's polynomial in s through the last places: sum of the k-th backward difference of them
 * times s (s + 1) ... (s + k - 1) / k!. first: the time of the newest of them, 0, or 1 where the
 * next one is known. Its way since s = 0, as powers of s. */
static void newton_expand(double ways[][6], int order, double first, int part,
                          hapi_model_course *out)
{
  double differences[ORDERS][6];
  double basis[ORDERS + 1] = {1.0};
  memcpy(differences, ways, (size_t)order * sizeof differences[0]);
  for (int k = 1; k <= order; ++k) {
    double at = first - (double)(k - 1); /* a place: the next factor is s - at, over k */
    for (int i = k; i >= 0; --i) {
      basis[i] = ((i > 0 ? basis[i - 1] : 0.0) - at * basis[i]) / (double)k;
    }
    for (int i = 1; i <= k; ++i) { /* the constant is what is left at s = 0 */
      hapi_v3_madd(out->ways[i - 1] + 3 * part, basis[i], differences[0] + 3 * part,
                   out->ways[i - 1] + 3 * part);
    }
    for (int j = 0; j + 1 < order; ++j) {
      for (int i = 0; i < 6; ++i) {
        differences[j][i] -= differences[j + 1][i];
      }
    }
  }
}

static void part_find(const hapi_course_past *past, const double set[6], int part,
                      hapi_model_course *out)
{
  bool given = part_norm(set, part) > 0.0;
  double best = least_missed(past, part, given ? 1 : 0);
  double ways[ORDERS + 1][6];
  if (given && (past->count == 0 || past->missed_set[part] <= AS_GOOD * best + MISS_LEAST)) {
    int order = past->count > 1 ? order_choose(past, part, 1, best) : 1;
    memcpy(ways[0], set, sizeof ways[0]);
    memcpy(ways[1], past->ways, ORDERS * sizeof ways[0]);
    newton_expand(ways, order, 1.0, part, out);
    return;
  }
  memcpy(ways, past->ways, ORDERS * sizeof ways[0]);
  newton_expand(ways, order_choose(past, part, given ? 1 : 0, best), 0.0, part, out);
}

/* Its velocity is that of its surface: a belt. */
static bool is_put_back(const hapi_course_past *past, const double set[6])
{
  if (past->count == 0) {
    return false;
  }
  for (int part = 0; part < 2; ++part) {
    if (part_norm(past->ways[0], part) > PUT_BACK * part_norm(set, part)) {
      return false;
    }
  }
  return part_norm(set, 0) + part_norm(set, 1) > 0.0;
}

void hapi_course_find(const hapi_course_past *past, const hap_twist *twist, double period_s,
                      hapi_model_course *out)
{
  double set[6];
  memset(out, 0, sizeof *out);
  out->period_s = period_s;
  way_of_twist(twist, period_s, set);
  if (is_put_back(past, set)) {
    out->leaps = 1;
    memcpy(out->ways[0], twist, sizeof out->ways[0]);
    return;
  }
  part_find(past, set, 0, out);
  part_find(past, set, 1, out);
  double scale = 1.0;
  for (int k = 0; k < HAPI_COURSE_ORDER; ++k) { /* s = t / period */
    scale /= period_s;
    for (int i = 0; i < 6; ++i) {
      out->ways[k][i] *= scale;
    }
  }
}

void hapi_course_mean(const hapi_model_course *course, hap_twist *out)
{
  double rate[6] = {0.0};
  for (int k = HAPI_COURSE_ORDER - 1; k >= 0; --k) {
    for (int i = 0; i < 6; ++i) {
      rate[i] = rate[i] * course->period_s + course->ways[k][i];
    }
  }
  hapi_v3_copy(rate, out->linear);
  hapi_v3_copy(rate + 3, out->angular);
}

void hapi_course_scale(double scale, hapi_model_course *io)
{
  double power = 1.0;
  if (scale == 1.0) {
    return;
  }
  io->period_s /= scale;
  for (int k = 0; k < HAPI_COURSE_ORDER; ++k) {
    power *= scale;
    for (int i = 0; i < 6; ++i) {
      io->ways[k][i] *= power;
    }
  }
}
