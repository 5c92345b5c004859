/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_POINTER_VELOCITY_H
#define HAPODE_POINTER_VELOCITY_H

/* Velocity of a device that measures rounded positions only. For each axis the longest window is
 * taken over which a straight line stays within a quantum of every sample: short when the motion is
 * fast or turns, long when it is slow, where a difference of two samples would jump by a quantum
 * per tick. First-order adaptive windowing: Janabi-Sharifi, Hayward, Chen, "Discrete-time adaptive
 * windowing for velocity estimation", IEEE Trans. Control Systems Technology 8(6), 2000, with the
 * window of the end-fit and the slope of the best fit. Times are those of the samples, so missed
 * ticks do no harm. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/spatial.h>

#define HAPI_VELOCITY_SAMPLES 32

/* The angular velocity, whose quantum no device tells, is a mean over at most this many
 * intervals.*/
#define HAPI_VELOCITY_TURN 7

typedef struct hapi_velocity_sample {
  int64_t time_ns;
  hap_pose pose;
} hapi_velocity_sample;

typedef struct hapi_velocity {
  double quantum; /* m */
  uint32_t newest;
  uint32_t count;                                      /* of valid samples */
  bool again;                                          /* the newest one was told before it, too */
  hapi_velocity_sample samples[HAPI_VELOCITY_SAMPLES]; /* a ring */
} hapi_velocity;

/* Forgets all samples. quantum in m, >= 0; 0 makes the estimate a plain difference. */
void hapi_velocity_reset(hapi_velocity *velocity, double quantum);

/* Takes the pose at time_ns and gives the twist there, in the frame of the pose; zero after the
 * first sample. A pose at the time of the one before takes its place. A pose that is not plausible,
 * and a time that goes back, make it begin anew. gap: s between two positions of a device that
 * tells each of them for several ticks; 0: it tells a new one at every tick. Samples are then as
 * far apart: the same position told again says nothing before another one is due. */
void hapi_velocity_update(hapi_velocity *velocity, int64_t time_ns, const hap_pose *pose,
                          double gap, hap_twist *out);

#endif
