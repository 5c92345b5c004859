/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_OSCILLATION_H
#define HAPODE_BENCH_OSCILLATION_H

/* A plain device: a mass with damping, a hand on it, old positions, coarse positions, an axis of
 * the wrong sign. In lockstep against a wall or against what moves. */

#include <stdbool.h>
#include <stdint.h>

#include "bench/bench.h"

typedef enum osc_world {
  OSC_WALL,   /* its face at x = 0, met along +x */
  OSC_EDGES,  /* a square bar that turns about z under the finger, driven */
  OSC_PLATE,  /* a driven plate that shakes along x */
  OSC_BUMPS,  /* ridges along z, one beside the other along y */
  OSC_CUBES,  /* five free cubes in a row before the wall */
  OSC_DROPPED /* a ball that is kept bouncing between finger and floor */
} osc_world;

typedef enum osc_motion {
  OSC_PRESS, /* to amplitude behind the face in 0.3 s, and there */
  OSC_SHAKE, /* the same, and then to and fro by half of it */
  OSC_TAP,   /* from amplitude before the face to as much behind it, and back */
  OSC_HIT,   /* at once, at speed, and there */
  OSC_SLIDE  /* pressed in by amplitude, along y at speed */
} osc_motion;

/* World axes; x is the one of the normal. */
typedef struct osc_plant {
  double mass;    /* kg, of all that moves; 0: on its target whatever the force */
  double damping; /* N s/m, to the ground */
  double hand_stiffness;
  double hand_damping;
  double push;    /* N, along +x, constant after 0.1 s */
  double delay_s; /* age of the positions that are told */
  double quantum; /* m */
  int flipped;    /* 1 + axis whose motor has the wrong sign; 0: none */
} osc_plant;

typedef struct osc_def {
  const char *name;
  osc_plant plant;
  double stiffness; /* N/m, of the pointer */
  double haptic_hz;
  osc_world world;
  osc_motion motion;
  double amplitude; /* m */
  double speed;     /* m/s */
  double hz;        /* of the hand */
  double world_hz;  /* of what moves */
  double tremor;    /* m, at 10 Hz, on top of the motion */
  double max_force; /* N */
  double seconds;
  bool unguarded;    /* HAP_GUARD_MEASURE */
  double (*path)[3]; /* m, a recorded hand at haptic_hz in place of the motion */
  int path_count;
} osc_def;

#define OSC_TICKS_MAX 40000

typedef struct osc_result {
  int ticks;
  double touched_s; /* first force; < 0: none */
  double derated_s; /* first tick with less force; < 0: none */
  double latched_s; /* fault; < 0: none */
  uint32_t fault;
  uint64_t derated; /* ticks with less force */
  double peak;      /* N */
  double swing;     /* N, of the largest force component, last 0.3 s before anything was done */
  double hz;        /* of its swings, over the last 0.3 s before a fault */
  double after;     /* N, largest in the 0.2 s from 0.2 s after the first derating */
  double force[OSC_TICKS_MAX]; /* N, along the normal, on the hand */
  double way[OSC_TICKS_MAX];   /* m, of the mass, along the normal */
} osc_result;

void osc_init(osc_def *def);
hap_status osc_run(const osc_def *def, osc_result *out, hap_detail *detail);

/* The same spring, mass and delay in a few lines of their own, without session and world: force and
 * way as of osc_result. */
void osc_plain(const osc_def *def, osc_result *out);

#endif
