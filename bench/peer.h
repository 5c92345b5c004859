/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_PEER_H
#define HAPODE_BENCH_PEER_H

/* Worlds that no engine owns, and what hapode-bench peers asks of an engine. An adapter builds its
 * world from the description alone, steps it, and says where the boxes are. The hand's sphere and
 * its force are the same code for all of them (peer_pointer.c). C and C++. */

#include <stdbool.h>
#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/* ---- the world ---- */

/* A homogeneous box, not turned at the begin. */
typedef struct peer_box {
  double edges[3]; /* m */
  double mass;     /* kg */
  double at[3];    /* m, its middle */
} peer_box;

typedef enum peer_joint_kind {
  PEER_BALL,
  PEER_HINGE
} peer_joint_kind;

/* Each box is the child of one joint at most, and its parent comes before it. */
typedef struct peer_joint {
  peer_joint_kind kind;
  int parent; /* box; -1: the world */
  int child;  /* box */
  double anchor[3];
  double axis[3]; /* unit; of a hinge */
} peer_joint;

/* A surface that does not move, over squares about the z axis, two triangles each. */
typedef struct peer_ground {
  int cells;         /* along x and along y; 0: there is none */
  double cell;       /* m */
  double begin;      /* m, x and y of the first corner */
  double *vertices;  /* x y z each, (cells + 1)^2 of them, x grows first */
  unsigned *indices; /* three of each triangle, seen from above against the clock */
  size_t vertex_count;
  size_t triangle_count;
} peer_ground;

/* The path of the hand: along x, with soft ends. */
typedef struct peer_hand {
  double from[3];
  double way;       /* m */
  double settle_s;  /* it rests so long first */
  double seconds;   /* of the way */
  double radius;    /* m, of the sphere */
  double stiffness; /* N/m, k of eq. 7 */
  double damping;   /* N s/m, d of eq. 7 */
} peer_hand;

typedef struct peer_world {
  peer_box *boxes;
  size_t count;
  peer_joint *joints;
  size_t joint_count;
  peer_ground ground;
  bool has_floor;  /* the plane z = 0 */
  bool boxes_pass; /* boxes collide with floor and ground alone */
  double mu;       /* of all pairs */
  double gravity;  /* m/s^2, along -z */
  double layer;    /* m: boxes that touch are so deep in each other, and stay there */
  peer_hand hand;
} peer_world;

/* False: no world of that name, no world of so many boxes, or no memory. */
bool peer_world_create(const char *name, int count, peer_world *out);
void peer_world_destroy(peer_world *world); /* zeroed allowed */
double peer_world_mass(const peer_world *world);

/* ---- the hand ---- */

typedef struct peer_motion {
  double position[3];
  double quat_wxyz[4];
  double linear[3];
  double angular[3];
} peer_motion;

/* A force on a box, at a point of the world. */
typedef struct peer_push {
  size_t box;
  double point[3];
  double force[3];
} peer_push;

#define PEER_REACH_MAX 64

/* Boxes that the hand may come to: those about the begin of its path. */
typedef struct peer_reach {
  size_t boxes[PEER_REACH_MAX];
  size_t count;
} peer_reach;

void peer_reach_find(const peer_world *world, peer_reach *out);

/* t: s since the begin of the run. */
void peer_hand_at(const peer_hand *hand, double t, double out_position[3], double out_velocity[3]);

/* Eq. 7 at the nearest point of each box in reach. motions: of reach->boxes. Returns the pushes on
 * boxes, at most reach->count; out_force: on the hand. */
size_t peer_hand_push(const peer_world *world, const peer_reach *reach, const peer_motion *motions,
                      double t, peer_push *out_pushes, double out_force[3]);

/* ---- an engine ---- */

typedef struct peer_setting {
  double step_s;
  int iterations;
  bool may_sleep;
  bool is_truth; /* by the solver of the engine that is most exact */
} peer_setting;

#define PEER_SLEEP_S 0.5 /* at rest so long, a box may sleep */

typedef struct peer_engine {
  const char *name;
  int iterations; /* of a step, as people run it at 1 kHz */
  int boxes_most; /* larger worlds take it too long */
  bool can_sleep;
  void *(*create)(const peer_world *world, const peer_setting *setting); /* NULL: it cannot */
  void (*destroy)(void *sim);
  void (*step)(void *sim, const peer_push *pushes, size_t count);
  void (*read)(const void *sim, size_t box, peer_motion *out);
  double (*mass)(const void *sim, size_t box);
  bool (*sleeps)(const void *sim, size_t box);
  size_t (*boxes)(const void *sim); /* those that move */
} peer_engine;

extern const peer_engine peer_ode;
extern const peer_engine peer_bullet;
extern const peer_engine peer_mujoco;
extern const peer_engine peer_jolt;

/* The engines of this build, NULL after the last. */
const peer_engine *peer_engine_at(size_t index);

/* Those that it does not have, and why; NULL after the last. */
const char *peer_missing_at(size_t index);

#ifdef __cplusplus
}
#endif

#endif
