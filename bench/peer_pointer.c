/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The hand of hapode-bench peers: a sphere on a path, and eq. 7 at the nearest points of boxes. */

#include <math.h>
#include <string.h>

#include "bench/peer.h"

#define REACH 0.03 /* m, beyond the hand's path and its sphere */

void peer_hand_at(const peer_hand *hand, double t, double out_position[3], double out_velocity[3])
{
  double u = fmin(fmax((t - hand->settle_s) / hand->seconds, 0.0), 1.0);
  memcpy(out_position, hand->from, 3 * sizeof *out_position);
  memset(out_velocity, 0, 3 * sizeof *out_velocity);
  out_position[0] += hand->way * u * u * u * (10.0 + u * (6.0 * u - 15.0));
  out_velocity[0] = hand->way * 30.0 * u * u * (1.0 - u) * (1.0 - u) / hand->seconds;
}

void peer_reach_find(const peer_world *world, peer_reach *out)
{
  const peer_hand *hand = &world->hand;
  double most = hand->way + hand->radius + REACH;
  out->count = 0;
  for (size_t i = 0; i < world->count && out->count < PEER_REACH_MAX; ++i) {
    const peer_box *box = &world->boxes[i];
    double sum = 0.0;
    for (int k = 0; k < 3; ++k) {
      double off = fmax(0.0, fabs(hand->from[k] - box->at[k]) - 0.5 * box->edges[k]);
      sum += off * off;
    }
    if (sum <= most * most) {
      out->boxes[out->count++] = i;
    }
  }
}

static void quat_rows(const double q[4], double out[3][3])
{
  double w = q[0];
  double x = q[1];
  double y = q[2];
  double z = q[3];
  out[0][0] = 1.0 - 2.0 * (y * y + z * z);
  out[0][1] = 2.0 * (x * y - w * z);
  out[0][2] = 2.0 * (x * z + w * y);
  out[1][0] = 2.0 * (x * y + w * z);
  out[1][1] = 1.0 - 2.0 * (x * x + z * z);
  out[1][2] = 2.0 * (y * z - w * x);
  out[2][0] = 2.0 * (x * z - w * y);
  out[2][1] = 2.0 * (y * z + w * x);
  out[2][2] = 1.0 - 2.0 * (x * x + y * y);
}

/* Nearest point and outward normal in the box's frame; the distance, below 0 inside. */
static double box_nearest(const peer_box *box, const double c[3], double point[3], double normal[3])
{
  double sum = 0.0;
  int face = 0;
  for (int k = 0; k < 3; ++k) {
    double h = 0.5 * box->edges[k];
    point[k] = fmin(fmax(c[k], -h), h);
    normal[k] = c[k] - point[k];
    sum += normal[k] * normal[k];
    if (fabs(c[k]) - h > fabs(c[face]) - 0.5 * box->edges[face]) {
      face = k;
    }
  }
  if (sum > 0.0) {
    double distance = sqrt(sum);
    for (int k = 0; k < 3; ++k) {
      normal[k] /= distance;
    }
    return distance;
  }
  double side = c[face] < 0.0 ? -1.0 : 1.0;
  normal[face] = side;
  point[face] = side * 0.5 * box->edges[face];
  return fabs(c[face]) - 0.5 * box->edges[face];
}

static bool box_push(const peer_world *world, size_t number, const peer_motion *m,
                     const double centre[3], const double velocity[3], peer_push *out)
{
  double rows[3][3];
  double c[3];
  double near[3];
  double outward[3];
  double normal[3];
  double arm[3];
  const peer_box *box = &world->boxes[number];
  quat_rows(m->quat_wxyz, rows);
  for (int k = 0; k < 3; ++k) {
    c[k] = 0.0;
    for (int i = 0; i < 3; ++i) {
      c[k] += rows[i][k] * (centre[i] - m->position[i]);
    }
  }
  double depth = world->hand.radius - box_nearest(box, c, near, outward);
  if (depth <= 0.0) {
    return false;
  }
  for (int i = 0; i < 3; ++i) {
    normal[i] = rows[i][0] * outward[0] + rows[i][1] * outward[1] + rows[i][2] * outward[2];
    arm[i] = rows[i][0] * near[0] + rows[i][1] * near[1] + rows[i][2] * near[2];
    out->point[i] = m->position[i] + arm[i];
  }
  double leaves = 0.0; /* of the hand, along the normal */
  for (int i = 0; i < 3; ++i) {
    int j = (i + 1) % 3;
    int k = (i + 2) % 3;
    double v = m->linear[i] + m->angular[j] * arm[k] - m->angular[k] * arm[j];
    leaves += normal[i] * (velocity[i] - v);
  }
  double push = fmax(0.0, world->hand.stiffness * depth - world->hand.damping * leaves);
  out->box = number;
  for (int i = 0; i < 3; ++i) {
    out->force[i] = -push * normal[i];
  }
  return true;
}

size_t peer_hand_push(const peer_world *world, const peer_reach *reach, const peer_motion *motions,
                      double t, peer_push *out_pushes, double out_force[3])
{
  double centre[3];
  double velocity[3];
  size_t count = 0;
  peer_hand_at(&world->hand, t, centre, velocity);
  memset(out_force, 0, 3 * sizeof *out_force);
  for (size_t i = 0; i < reach->count; ++i) {
    peer_push *push = &out_pushes[count];
    if (box_push(world, reach->boxes[i], &motions[i], centre, velocity, push)) {
      for (int k = 0; k < 3; ++k) {
        out_force[k] -= push->force[k];
      }
      ++count;
    }
  }
  return count;
}
