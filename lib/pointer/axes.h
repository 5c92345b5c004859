/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_POINTER_AXES_H
#define HAPODE_POINTER_AXES_H

/* What the end effector of a pointer measures beyond its pose, such as the opening of a gripper. In
 * the units of the device: no scale of a pointer acts on an axis. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/device.h>

/* Of the range of a gripper, unless the application sets others. */
#define HAPI_GRIPPER_CLOSED 0.25
#define HAPI_GRIPPER_OPEN 0.35

/* Another value than the one that is believed, and values that go on from there. */
typedef struct hapi_axis_elsewhere {
  bool known;
  double at;
  double seconds;
} hapi_axis_elsewhere;

typedef struct hapi_axis {
  hap_axis_kind kind;
  double low; /* of its values, low < high */
  double high;
  double max_force;
  double at;   /* believed: finite, and from low to high */
  double rate; /* likewise; 0 where the device is not believed */
  bool jumped; /* in this tick: it is believed to be where nobody saw it go */
  hapi_axis_elsewhere elsewhere;
} hapi_axis;

/* Zeroed: there is none. */
typedef struct hapi_axes {
  uint32_t count;
  bool known;      /* they were read before */
  int64_t read_ns; /* then */
  hapi_axis of[HAP_AXES_MAX];
} hapi_axes;

/* infos: count of them. Nothing is known of their values. */
void hapi_axes_begin(hapi_axes *axes, const hap_axis_info *infos, uint32_t count);

/* Of what the device told at now_ns, leaves what is believed. False: some of it is not. */
bool hapi_axes_judge(hapi_axes *axes, const double *at, const double *rates, int64_t now_ns);

#endif
