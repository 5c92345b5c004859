/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_STABILITY_OWN_H
#define HAPODE_BENCH_STABILITY_OWN_H

/* One point of the map of own forces, textures and grabs: the device of stability.h with a field,
 * over a cube on a floor or in the air. Without a hand it gets a blow, down and across; a relaxed
 * hand presses by 1 mm and strokes to and fro by 4 mm.
 *
 * Energy is counted as in stability.h; the springs are contact, coupling, grip and field. A
 * vibration, and a function that does not tell what it does, may make as much as they promise:
 *
 *   bounded  all is finite, no force is above its promise or the pointer's limit, and no more
 *            energy is made than is promised
 *   stable   the same, no fault is latched, and of all others energy_ratio <= 1.01 */

#include "bench/bench.h"

#include <hapode/hapode.h>

#include "bench/stability.h"

typedef enum own_field {
  OWN_SPRING,
  OWN_VISCOUS,
  OWN_MAGNET,
  OWN_DETENTS,
  OWN_VIBRATION,
  OWN_CALL,   /* a spring that says its stiffness */
  OWN_UNTOLD, /* a function that says that it goes by time, and is a spring */
  OWN_TEXTURE,
  OWN_ADHESION,
  OWN_SNAP,      /* a surface that pulls from a distance */
  OWN_GRAB_SOFT, /* of the stiffness */
  OWN_GRAB_RIGID,
  OWN_FIELDS
} own_field;

typedef struct own_point {
  own_field field;
  bool bound; /* to the cube; else to the world */
  hap_coupling coupling;
  /* N/m: steepest slope of the field; of the contact under a texture or adhesion; VISCOUS: 100 1/s
   * of it; VIBRATION: of 0.1 mm, with hz = sqrt */
  double stiffness;
  double mass; /* kg of the cube */
  double haptic_hz;
  double delay_ticks;
  double quantum; /* m */
  bool floored;   /* the cube lies on a floor */
  stability_hand hand;
  bool guarded; /* HAP_GUARD_ON, else HAP_GUARD_MEASURE */
} own_point;

typedef struct own_result {
  bool refused; /* by the API, with HAP_ERROR_ARGUMENT: there was no such force */
  bool cut;     /* HAP_SATURATED */
  bool bounded;
  bool stable;
  double energy_ratio;
  double made;  /* J, largest */
  double force; /* N, largest on the hand */
  double own;   /* N, largest of the own force, as a share of its promise */
  double speed; /* m/s, fastest of device and cube in the last tenth */
  hap_fault fault;
} own_result;

const char *own_field_word(own_field field);
bool own_field_binds(own_field field);  /* can be bound to a body */
bool own_field_drives(own_field field); /* gives energy as it promises */

hap_status own_run(bench *b, const own_point *point, double seconds, own_result *out);

/* The map of them: how many points --only takes, and what they come to. */
hap_status own_points_count(bench *b, size_t *out);
hap_status own_points_measure(bench *b, size_t planned);

#endif
