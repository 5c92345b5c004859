/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_VIRTUAL_VIRTUAL_H
#define HAPODE_PLUGINS_VIRTUAL_VIRTUAL_H

/* What only a simulated device can tell: the truth behind its measurements. For tests, bench and
 * programs that move the hand themselves. */

#include "plugins/virtual/hand.h"

typedef struct hapi_virtual_port {
  double work;         /* J that the force which really acted gave to hand and device since start */
  double force[3];     /* N that acts now */
  double position[3];  /* m, not rounded */
  double velocity[3];  /* m/s */
  double mass;         /* kg of hand and device; 0: a rigid hand */
  double torque[3];    /* N m that acts now */
  double turn[3];      /* rad, rotation vector from the spec's orientation on */
  double turn_rate[3]; /* rad/s */
  double inertia;      /* kg m^2, as mass */
} hapi_virtual_port;

/* self: hapi_device_self of a device "virtual". At the time of its newest read; by the thread that
 * reads it. */
void hapi_virtual_get_port(const void *self, hapi_virtual_port *out);

/* The hand with its mechanism. A hand that does not yield, and self NULL, give a relaxed one. */
void hapi_virtual_get_hand(const void *self, hapi_hand_def *out);

#endif
