/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_STABILITY_H
#define HAPODE_BENCH_STABILITY_H

/* One point of the stability map: a device, a hand, a pointer and bodies that it touches all at
 * once, pushed by 1 mm in model CONTACT.
 *
 * Energy. The port is the grip: hand and moving part of the device are one mass there, and the
 * device's damping belongs to the device. With P the work of the force that really acted on that
 * mass (the virtual device keeps it), b the damping of the device and K the kinetic energy of the
 * bodies,
 *
 *   made(t)      = P(t) - integral of b v^2 + K(t) - K(0)
 *   energy_ratio = 1 + max made / max (K + energy of the springs, but no more than was taken
 *                                         + kinetic energy at the grip)
 *
 * The springs (of the contacts and of the coupling) are empty at the start: what they give was
 * taken before, so that made stays below 0 unless sampling, delay or integration make energy.
 * What the hand's own damping takes is not set off against it. A point is stable when all
 * numbers are finite, no fault was latched and energy_ratio <= 1.01. */

#include "bench/bench.h"

#include <hapode/hapode.h>

#include "plugins/virtual/virtual.h"
#include "pointer/pointer.h"

/* Of --only. */
#define STABILITY_KEYS                                                                         \
  "map, integrator, stiffness, mass, contacts, coupling, layout, hand, delay_ticks, quantum, " \
  "missed, body, field, bound, haptic_hz, guard"

#define STABILITY_DEVICE_MASS 0.1    /* kg */
#define STABILITY_DEVICE_DAMPING 0.2 /* N s/m */
#define STABILITY_HAPTIC_HZ 1000.0
#define STABILITY_RATIO 1.01
#define STABILITY_CONTACTS_MAX 64

typedef enum stability_layout {
  STABILITY_FREE,   /* side by side under the pointer */
  STABILITY_BACKED, /* the same, each on something fixed */
  STABILITY_CAGE    /* half of them above it, fixed at their backs: it cannot leave */
} stability_layout;

typedef enum stability_hand {
  STABILITY_NONE, /* the device alone, given a blow that moves it by 1 mm */
  STABILITY_RELAXED,
  STABILITY_TENSE
} stability_hand;

typedef struct stability_point {
  hap_integration integration;
  hap_coupling coupling;
  double stiffness; /* N/m of each contact */
  double mass;      /* kg of each body */
  int contacts;
  bool cubes; /* that stand on four points each; else balls */
  stability_layout layout;
  stability_hand hand;
  double delay_ticks;
  double quantum; /* m */
  bool missed;    /* one tick in a hundred */
} stability_point;

typedef struct stability_result {
  bool stable;
  double energy_ratio;
  double held;     /* N/m, what the device holds */
  double residual; /* m/s, of the solver */
  double way;      /* m, largest of the device along the push */
  double stored;   /* J, largest */
  int touched;     /* contacts that pushed at once */
  bool proxied;    /* at the end */
} stability_result;

/* The account above. Zeroed but for finite. */
typedef struct stability_account {
  double lost;   /* J, to the device's damping */
  double made;   /* J, largest */
  double stored; /* J, largest */
  bool finite;
} stability_account;

/* Once a tick, of this length. kinetic: J of the bodies; springs: J in them. */
void stability_account_tick(stability_account *io, const hapi_virtual_port *was,
                            const hapi_virtual_port *now, double period, double kinetic,
                            double springs);
double stability_account_ratio(const stability_account *account);

/* J, of the spring between device and proxy, with the device where it was measured last. */
double stability_coupling_energy(const hapi_pointer *p);

const char *stability_hand_word(stability_hand hand); /* as the virtual device spells it */
const char *stability_layout_word(stability_layout layout);
bool stability_is_rigid(hap_coupling coupling); /* contacts that do not give */

hap_status stability_run(bench *b, const stability_point *point, double seconds,
                         stability_result *out);

/* N/m, slope of the force that a rigid hand feels when it goes slowly into these bodies, backed. */
hap_status stability_feel(bench *b, const stability_point *point, double *out);

#endif
