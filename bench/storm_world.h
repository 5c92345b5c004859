/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_STORM_WORLD_H
#define HAPODE_BENCH_STORM_WORLD_H

/* A small world in which everything is changed all the time: bodies, geoms, joints, masses, shapes,
 * offsets, flags, gravity, poses and velocities. The same seed makes the same edits. */

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include <hapode/ode.h>

#define STORM_THINGS 24
#define STORM_GEOMS 3 /* of a thing */
#define STORM_WALLS 4
#define STORM_SPOTS 16 /* places where hands are */

/* Whether the session is told before a body goes. */
typedef enum storm_telling {
  STORM_TELLS = 0,
  STORM_TELLS_NOT,
  STORM_TELLS_HALF
} storm_telling;

typedef struct storm_thing {
  dBodyID body; /* NULL: none */
  dGeomID geoms[STORM_GEOMS];
  int geom_count;
  dJointID joint;
  bool adopted;
} storm_thing;

typedef struct storm_world {
  dWorldID world;
  dSpaceID space;
  dSpaceID nested;
  storm_thing things[STORM_THINGS];
  dGeomID walls[STORM_WALLS];
  double spots[STORM_SPOTS][3]; /* m */
  int spot_count;
  uint64_t seed;
  hap_session *session;
  storm_telling telling;
  uint64_t edits;
  uint64_t untold;                      /* bodies destroyed without a word */
  uint64_t unexpected;                  /* answers of the session */
  _Atomic(dBodyID) shown[STORM_THINGS]; /* the bodies, for those who draw */
} storm_world;

void storm_world_open(storm_world *w, uint64_t seed);
void storm_world_close(storm_world *w); /* after its session */

/* That many edits; the caller may touch the world. */
void storm_world_edit(storm_world *w, int count);

double storm_uniform(uint64_t *seed, double low, double high);

#endif
