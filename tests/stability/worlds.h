/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_STABILITY_WORLDS_H
#define HAPODE_TESTS_STABILITY_WORLDS_H

/* The worlds of the stability cases: an ODE world, the simulated hands in it, and a lockstep
 * session over both. A builder fills the world in, world_start starts it. */

#include <hapode/hapode.h>
#include <hapode/ode.h>

#include "scenes/scenes.h"
#include "tools/session_defs.h"

#define WORLD_BODIES_MAX 128
#define WORLD_HANDS_MAX 8
#define WORLD_EDGE 0.05  /* m, of a cube; diameter of a ball */
#define WORLD_LAYER 1e-4 /* m, ODE's surface layer: what rests lies so deep */

typedef enum case_hand {
  RELAXED,
  TENSE,
  RIGID,
  ALONE /* the device alone */
} case_hand;

struct case_row;

typedef struct world {
  dWorldID world;
  dSpaceID space;
  scene *scene;                     /* NULL: the builder made the world itself */
  dBodyID bodies[WORLD_BODIES_MAX]; /* NULL: destroyed */
  double start[WORLD_BODIES_MAX][3];
  int body_count;
  double origin[3]; /* m, of all that a builder places */
  dSurfaceParameters surface;
  hap_session_def def;
  hap_expert_def expert;
  hap_research_def research;
  hap_pointer_def pointer;
  hap_pointer_expert_def pointer_expert;
  hap_pointer_research_def pointer_research;
  char motions[WORLD_HANDS_MAX][320]; /* arguments of the virtual device */
  int hand_count;
  double device_damping; /* N s/m */
  double max_force;      /* N, of the device */
  void (*before_step)(struct world *w);
  uint64_t steps; /* of physics */

  hap_session *session;
  hap_device *devices[WORLD_HANDS_MAX];
  hap_pointer_id pointers[WORLD_HANDS_MAX];
  hap_detail detail; /* why it could not be started */
} world;

typedef void (*world_build_fn)(world *w, const struct case_row *row);

void world_open(world *w);
bool world_start(world *w, const struct case_row *row, hap_model model);
void world_close(world *w);

/* What moves and what the hand does. Lengths in m, the hand's device is at the world's origin. */
void build_press(world *w, const struct case_row *row);      /* n cubes on each other, from above */
void build_tool_press(world *w, const struct case_row *row); /* the same with a tool, which turns */
void build_tool_wedge(world *w, const struct case_row *row); /* ... between two walls */
void build_press_unequal(world *w, const struct case_row *row); /* two cubes; size: upper / lower */
void build_push(world *w, const struct case_row *row); /* a cube, of edge size, along the floor */
void build_push_sliding(world *w, const struct case_row *row);  /* mu = 0 */
void build_push_rough(world *w, const struct case_row *row);    /* mu = infinity */
void build_row(world *w, const struct case_row *row);           /* n cubes between guides */
void build_row_reversing(world *w, const struct case_row *row); /* every 100 ms, hand holds on */
void build_row_ends(world *w, const struct case_row *row);      /* a hand at each end */
void build_walls(world *w, const struct case_row *row);         /* a cube that two walls hold */
void build_groove(world *w, const struct case_row *row);        /* a ball pressed into a V */
void build_funnel(world *w, const struct case_row *row);        /* n balls */
void build_stop(world *w, const struct case_row *row);   /* a flap against the stops of its hinge */
void build_loop(world *w, const struct case_row *row);   /* four bars, four hinges */
void build_chain(world *w, const struct case_row *row);  /* n links on ball joints */
void build_weight(world *w, const struct case_row *row); /* n links, a weight of size below */
void build_play(world *w, const struct case_row *row);   /* a cube on a rail between stops */
void build_lightstand(world *w, const struct case_row *row);
void build_top(world *w, const struct case_row *row);   /* size: rad/s */
void build_plate(world *w, const struct case_row *row); /* at its corner, on a floor */
void build_plate_free(world *w, const struct case_row *row);
void build_speck(world *w, const struct case_row *row);   /* a cube as small as size */
void build_block(world *w, const struct case_row *row);   /* a cube as large as size */
void build_inside(world *w, const struct case_row *row);  /* the hand starts size deep in a cube */
void build_chatter(world *w, const struct case_row *row); /* size: amplitude at 100 Hz */
void build_stick_slip(world *w, const struct case_row *row);
void build_brush(world *w, const struct case_row *row);     /* over n balls, fast */
void build_flicker(world *w, const struct case_row *row);   /* a neighbour at every other step */
void build_destroyed(world *w, const struct case_row *row); /* under the hand */
void build_many(world *w, const struct case_row *row);      /* n balls under one pointer */
void build_bar(world *w, const struct case_row *row);       /* under n pointers */
void build_squeeze(world *w, const struct case_row *row);   /* between two hands */
void build_fixed(world *w, const struct case_row *row);     /* a fixed joint to the world */
void build_asleep(world *w, const struct case_row *row);
void build_impacts(world *w, const struct case_row *row); /* n balls, one after the other */
void build_rub(world *w, const struct case_row *row); /* n cubes on each other, across the top */
void build_rub_sliding(world *w, const struct case_row *row); /* the floor has mu = 0 */
void build_rub_ball(world *w, const struct case_row *row);    /* rolled along the floor */
void build_rub_top(world *w, const struct case_row *row);     /* size: rad/s */
void build_pinch(world *w, const struct case_row *row);       /* lifted between two hands */
void build_tool_rub(world *w, const struct case_row *row);    /* a tool across the top, and round */
void build_tool_pinch(world *w, const struct case_row *row);  /* lifted between two flat fingers */

#endif
