/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_PORT_H
#define HAPODE_BENCH_PORT_H

/* The port at which a hand meets the world, for benches that measure there: one pointer below a
 * body whose lower face is the plane z = 0, in lockstep. The device moves along z; what comes
 * out is what it read and what it was given. */

#include <hapode/hapode.h>
#include <hapode/ode.h>

#include "bench/bench.h"

#define PORT_HAPTIC_HZ 1000
#define PORT_TICK_S (1.0 / PORT_HAPTIC_HZ)
#define PORT_PHYSICS_HZ 50   /* 20 whole ticks a step */
#define PORT_RADIUS 0.01     /* m, of the pointer */
#define PORT_EDGE 0.05       /* m, of the bodies that are cubes */
#define PORT_GRAVITY 9.81    /* m/s^2 */
#define PORT_FORCE_MAX "1e6" /* N: nothing may be cut */

typedef enum port_body {
  PORT_WALL = 0, /* a static geom */
  PORT_HELD,     /* a body that a fixed joint holds */
  PORT_STUCK,    /* a cube pushed along a floor, by less than its friction; gravity along -x */
  PORT_FREE,     /* a body in the air, lying on the pointer */
  PORT_SLIDER,   /* the same on a slider joint */
  PORT_HINGE,    /* a flap on a hinge, lying on the pointer */
  PORT_BODIES
} port_body;

/* Lever of the flap: the hinge is in its lower face, across x. */
#define PORT_FLAP_LENGTH 0.3 /* m */
#define PORT_FLAP_HALF 0.02  /* m, half of its thickness */
#define PORT_FLAP_ARM 0.2    /* m, from the hinge to the pointer */

typedef struct port_def {
  port_body body;
  double mass;        /* kg, of the body */
  const char *device; /* spec */
  double haptic_hz;   /* 0: PORT_HAPTIC_HZ */
  hap_model model;
  hap_coupling coupling;
  double coupling_stiffness; /* N/m; 0: from the device's figures */
  double coupling_damping;   /* N s/m */
  double virtual_mass;       /* kg; 0: the default */
  double stiffness;          /* N/m, of the contact */
  double damping;            /* N s/m, of the contact */
} port_def;

typedef struct port {
  dWorldID world;
  dSpaceID space;
  hap_session *session;
  hap_device *device;
  hap_pointer_id pointer;
  hap_pointer_state state; /* after the newest tick */
} port;

/* Makes the world and starts the session. On failure nothing is left behind. */
hap_status port_open(bench *b, const port_def *def, port *out);
void port_close(port *p);

/* One tick. */
hap_status port_advance(bench *b, port *p);

#endif
