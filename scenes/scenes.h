/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SCENES_SCENES_H
#define HAPODE_SCENES_SCENES_H

/* Scenes shared by tests, bench and programs: plain ODE calls, no hapode types but spatial. */

#include <stdbool.h>
#include <stddef.h>

#include <ode/ode.h>

#include <hapode/status.h>

#define SCENE_POINTERS_MAX 2
#define SCENE_FIELD_SIDE 25
#define SCENE_FRICTIONS_MAX 8

/* The row of the parameter table that a scene is built from. SI units. */
typedef struct scene_parameters {
  const char *name;
  const char *text;  /* one line: what happens */
  int count_default; /* N of "name:N"; 0: the scene has no N */
  double mass;       /* kg, of the bodies that are pushed */
  double size;       /* m, edge of the cubes or the like */
  double mu;         /* friction, 0 or more, dInfinity allowed */
  double gravity;    /* m/s^2, downwards along -z */
  double gap;        /* m, between bodies at the start (fig5: to the pointer,
                                            wedge: to the wall); slightly negative: they touch */
  double radius;     /* m, of the pointer; of a tool: of its rounding */
  double tool[3];    /* m, edges of the box that the pointer is, its rounding not
                                            counted; 0: it is a sphere */
  double stiffness;  /* N/m, pointer contact */
  double damping;    /* N s/m, pointer contact */
  double duration;   /* s, a run that shows the scene */
  int iterations;    /* QuickStep */
  int pointers;      /* 1 .. SCENE_POINTERS_MAX */
  const char *hands[SCENE_POINTERS_MAX]; /* specs of the virtual device for a simulated hand, in
                                            world coordinates; borrowed */
  double hinge_torque;                   /* N m, friction of each hinge; 0: none */
  double shift[3]; /* m, by which the bodies stand beside where the scene has them, at the start;
                      the hands and what never moves stay; joints to the world come along. */
  double friction; /* of the pointers; 0: none */
  double finger_radius; /* m, of the pointers; 0: no soft fingers */
  double layer; /* m, ODE's contact surface layer: what rests lies this deep, so that a contact is
                   not lost to a gap of micrometres */
} scene_parameters;

/* A field of heights along z, which never moves. */
typedef struct scene_field {
  dGeomID geom; /* NULL: the scene has none */
  dHeightfieldDataID data;
  double edge;                                        /* m, of the square that it covers */
  double heights[SCENE_FIELD_SIDE][SCENE_FIELD_SIDE]; /* m, rows along y, columns along x */
  double as_ode[SCENE_FIELD_SIDE][SCENE_FIELD_SIDE];  /* the same, rows turned round */
} scene_field;

/* A geom whose friction is not mu. */
typedef struct scene_friction {
  dGeomID geom;
  double mu;
} scene_friction;

typedef struct scene {
  scene_parameters parameters; /* as used, N and overrides applied */
  int count;                   /* N as used; 0: the scene has no N */
  dWorldID world;
  dSpaceID space;
  dBodyID *bodies; /* in the order of interest: the first is what is pushed */
  size_t body_count;
  scene_field field;
  scene_friction frictions[SCENE_FRICTIONS_MAX];
  size_t friction_count;
} scene;

/* The table. NULL past its end. */
const scene_parameters *scene_table_at(size_t index);

/* Builds "name" or "name:N". dInitODE2 was called. detail may be NULL. On failure a detail text
 * that lists what exists, nothing is built and *out is NULL. HAP_ERROR_NOT_FOUND (no such scene),
 * HAP_ERROR_ARGUMENT (bad N, N where there is none, NULL), HAP_ERROR_MEMORY. */
hap_status scene_create(const char *spec, scene **out, hap_detail *detail);

/* Builds from changed parameters (a row that was copied and edited; the name tells which scene) and
 * N; 0: count_default of the parameters, and the only N of a scene that has none. Fails as
 * scene_create does; HAP_ERROR_ARGUMENT also for a parameter that cannot be built, named in
 * detail. */
hap_status scene_create_from(const scene_parameters *parameters, int count, scene **out,
                             hap_detail *detail);

void scene_destroy(scene *s); /* NULL allowed */

/* Of a geom of the scene. */
double scene_friction_of(const scene *s, dGeomID geom);

/* Shape of hap_surface_fn; user is the scene. Friction of a pair is the geometric mean. False for
 * two static geoms and for bodies that a joint connects. */
bool scene_surface(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io);

#endif
