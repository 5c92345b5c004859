/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_POINTER_HOLDS_H
#define HAPODE_POINTER_HOLDS_H

/* What the device holds of own forces, as felt in the world. Without a device there is no bound. */
typedef struct hapi_pointer_holds {
  double stiffness; /* N/m; HUGE_VAL: there is no bound */
  double damping;   /* N s/m, likewise */
  double mass;      /* kg, of the device: what an own force moves at the hand */
} hapi_pointer_holds;

#endif
