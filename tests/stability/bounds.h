/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_STABILITY_BOUNDS_H
#define HAPODE_TESTS_STABILITY_BOUNDS_H

/* The common bounds of all stability cases, looked at after every tick.
 *
 *   finite     forces, pointers, devices, bodies in the loop and in ODE; no fault
 *   force      on the hand <= limit of the device
 *   energy     W - D + E(t) - E(0) <= 1 % of the largest stored energy
 *   depth      of a pointer in a body <= F/k + v H
 *   momentum   residual of the audit <= impulse of the hands in one interval
 *   unit      | |q| - 1 | of the bodies' orientations < 1e-12
 *   room       way of a body from where it started
 *
 * Energy. W is the work of the force that really acted on the hands (the virtual device keeps it),
 * D what the damping of the devices took of it, E the kinetic and potential energy of the bodies.
 * So it says: a hand gets no more than it put in and the bodies lost. Stored are the bodies'
 * kinetic energy, that of the hands, and the springs of contacts and couplings.
 * Gain. Stricter, where the loop moves what is touched: with the springs' energy added, the left
 * side never rises by more than that above what it was at any earlier time. So what was lost
 * before, to friction or the devices' damping, does not hide what is made later.
 * Times. All of it is taken at the time of the hands' work, which is that of the newest tick. The
 * loop's bodies are then half a tick ahead with their velocities and a whole one with their poses:
 * what the forces of the springs and the weight do on them in that half is taken back. A spring
 * that is integrated implicitly is a tick ahead of a hand that it is coupled to directly:
 * likewise.
 * Late. Where ODE moves what is touched, in all models but contact and for jointed bodies, it
 * hears of the hand at the end of an interval: what the hand gave in the last interval is not held
 * against it.
 * Depth. Not of tools. By ODE's collider, between a ball at the pointer and the body's shape where
 * the loop has it. v is the speed of pointer and body together.
 * Momentum. The interval is a physics step and the tick in which its result is taken; model
 * impulse takes it a step later. */

#include "plugins/virtual/virtual.h"
#include "tests/stability/cases.h"

#define BOUNDS_ENERGY 0.01
#define BOUNDS_UNIT 1e-12
#define BOUNDS_INTERVAL_MAX 2064 /* ticks: two steps at 1 Hz, and some */

typedef struct bounds {
  const case_row *row;
  world *w;
  hap_model model;
  hapi_virtual_port ports[WORLD_HANDS_MAX];
  double loss;     /* J, to the devices' damping */
  double given;    /* J, of the world at its start */
  double cut;      /* J, less than 0: what the hands were spared by the devices' limits */
  double made_max; /* J */
  double least;    /* J */
  double gain;
  double stored_max;
  double work[BOUNDS_INTERVAL_MAX];
  double impulse[BOUNDS_INTERVAL_MAX];
  uint64_t ticks;
  uint64_t interval; /* ticks */
  dGeomID clones[WORLD_BODIES_MAX];
  dGeomID balls[WORLD_HANDS_MAX];

  struct { /* of all ticks */
    bool finite;
    double force;    /* N */
    double depth;    /* m */
    double deeper;   /* of what is allowed, as a ratio */
    double residual; /* of what is allowed, as a ratio */
    double unit;
    double way; /* m */
    uint64_t contact_ticks;
    uint32_t fault;
  } worst;
} bounds;

void bounds_begin(bounds *b, const case_row *row, world *w, hap_model model);
void bounds_look(bounds *b); /* after each tick */
void bounds_end(bounds *b);

double bounds_energy(const bounds *b); /* what was made, of the largest stored energy */
double bounds_gain(const bounds *b);   /* what was made from any moment on, likewise */
bool bounds_hold(const bounds *b, char *out_broken, size_t size);

#endif
