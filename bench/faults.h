/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_FAULTS_H
#define HAPODE_BENCH_FAULTS_H

/* hapode-bench faults: the felt force against a reference that shares nothing with the library.
 * Worlds and hand motions (faults_scenes.c, faults_scenes_many.c), the reference
 * (faults_reference.c), the session by public headers alone (faults_session.c), the verdicts
 * (faults.c), random worlds (faults_random.c). */

#include <stdbool.h>
#include <stddef.h>

#include <ode/ode.h>

#include "bench/bench.h"

#define FAULTS_BODIES_MAX 1100
#define FAULTS_HINGES_MAX 16
#define FAULTS_HULL_MAX 8
#define FAULTS_TICK_S 0.001

struct faults_scene;

/* A surface of triangles that does not move, for the reference's pointer. */
typedef struct faults_mesh {
  double *vertices; /* x y z each, world frame */
  dTriIndex *indices;
  size_t vertex_count;
  size_t triangle_count;
  dGeomID geom; /* whose surface it is */
} faults_mesh;

/* One copy of a scene's world. */
typedef struct faults_world {
  const struct faults_scene *scene;
  dWorldID world;
  dSpaceID space;
  dJointGroupID own_contacts;
  dBodyID bodies[FAULTS_BODIES_MAX];
  size_t body_count;
  double mu; /* of all pairs */
  bool is_reference;
  faults_mesh mesh;
  dTriMeshDataID mesh_data;
  dHeightfieldDataID field_data;
  double *field; /* heights, the application's copy */
  dJointFeedback feedback;
  dJointID hinges[FAULTS_HINGES_MAX]; /* that have to hold */
  size_t hinge_count;
  double told; /* what an application reads of body 0 after a step: force of a joint, height */
} faults_world;

/* What a scene is judged by. */
typedef enum faults_kind {
  FAULTS_FORCE,    /* RMS error of the force, and its largest change in a tick */
  FAULTS_HOLD,     /* the force at which the hand falls through */
  FAULTS_STEPS,    /* as FORCE, but the change in a tick has a bound in newton */
  FAULTS_FEEDBACK, /* dJointFeedback */
  FAULTS_ARRIVAL,  /* time, peak and impulse of the first contact */
  FAULTS_CAPACITY, /* as FORCE, or said and counted */
  FAULTS_DUTY,     /* share of a period that physics takes */
  FAULTS_DUTY_OWN  /* the same without what a plain loop of ODE would take */
} faults_kind;

/* A way along an axis, from begin to end. */
typedef struct faults_glide {
  enum {
    X,
    Y,
    Z
  } axis;
  double begin; /* s */
  double end;
  double way; /* m */
} faults_glide;

#define FAULTS_GLIDES 3

typedef struct faults_path {
  double from[3];                     /* m */
  faults_glide glides[FAULTS_GLIDES]; /* the first without a way ends them */
} faults_path;

/* Changes the hand's position [m] and velocity [m/s] at a time [s]. */
typedef void (*faults_hand_fn)(double t, double io_position[3], double io_velocity[3]);

/* What an application does before and after a step of its world from begin to end [s]. */
typedef void (*faults_drive_fn)(faults_world *w, double begin, double end);

typedef struct faults_motion {
  const faults_path *path; /* NULL: it rests at the origin */
  faults_hand_fn hand;     /* after the path; may be NULL */
  double radius;           /* m */
  double stiffness;        /* N/m */
  double damping;          /* N s/m */
  double friction;         /* of the pointer */
  double max_force;        /* N; 0: the library's default */
  bool cube_tool;          /* a hull, a cube of edge 2 radius, in the place of a sphere */
  const char *through;     /* name of a coupling; NULL: the library's default */
} faults_motion;

typedef struct faults_check {
  faults_kind kind;
  double bound;        /* of the error */
  double bound_20;     /* of the error at 20 Hz; 0: the same */
  double begin_s;      /* from when on it is judged */
  double reference_hz; /* 0: 2 kHz */
  const char *model;   /* name of the session's; NULL: contact */
  int iterations;      /* of QuickStep in the reference; 0: dWorldStep */
  /* statically indeterminate: the floor is also that of the other order of bodies, and of twice the
   * iterations */
  bool spreads;
  /* pushes hard from its first touch, which is somewhere between two ticks: the floor is also that
   * of the reference at the tick's rate, and the session is compared with that one too */
  bool begins_hard;
} faults_check;

typedef struct faults_scene {
  int item; /* 0: a control, which has to be good at all times */
  const char *name;
  void (*build)(faults_world *w);
  faults_motion motion;
  double seconds;
  faults_check check;
  faults_drive_fn before; /* may be NULL */
  faults_drive_fn after;  /* may be NULL */
  bool has_own_contacts;  /* the application makes the contact joints, in before */
  int count;              /* of bodies, where the scene has a choice */
  double size;            /* m, likewise */
  /* Slow motion: share of the hand's time that passes for the bodies. Such a session is in drive
   * FRAME, in real time. 0: no slow motion, in drive LOCKSTEP */
  double slow;
  bool turned; /* bodies are made in the other order: of a reference, for its floor */
  bool alike;  /* the session has the shapes of the reference: how exact the bench is */
} faults_scene;

/* Forces on the hand at the begin of each tick. */
typedef struct faults_run {
  double (*force)[3]; /* N */
  double *told;       /* N, what the feedback said */
  size_t count;
  double joint_open; /* m, the widest hinge */
  double energy_off; /* J, largest of bodies and spring beside the work of the hand; reference */
  unsigned long dropped; /* session: stats.model.capacity_dropped */
  unsigned long said;    /* session: lines of log of warnings and errors */
  double duty;           /* session: of physics */
  double duty_own;
} faults_run;

extern const faults_scene faults_table[];
extern const size_t faults_table_count;
extern const faults_scene faults_moving_table[];
extern const size_t faults_moving_count;

const faults_scene *faults_scene_at(size_t index); /* of all; NULL past the end */

/* m, between the anchors of the hinge that is widest open. */
double faults_world_open(const faults_world *w);

/* False: no memory. */
bool faults_world_create(const faults_scene *scene, bool is_reference, faults_world *out);
void faults_world_destroy(faults_world *w); /* zeroed allowed */

/* As a classic near callback does: the contact joints of all pairs into own_contacts. */
void faults_world_collide(faults_world *w);

/* Where the hand is at a time, and its velocity. */
void faults_hand(const faults_motion *motion, double t, double out_position[3],
                 double out_velocity[3]);

bool faults_run_create(const faults_scene *scene, faults_run *out);
void faults_run_free(faults_run *r); /* zeroed allowed */

/* A plain ODE loop at that rate with a spring as pointer. */
bool faults_reference_run(const faults_scene *scene, double rate_hz, faults_run *out);

/* A lockstep session. */
hap_status faults_session_run(bench *b, const faults_scene *scene, double physics_hz,
                              faults_run *out);

/* Worlds of random bodies, a process for each block; the number of processes that did not end. */
hap_status faults_random_run(bench *b, long worlds);

#endif
