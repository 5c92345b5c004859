/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_NEAR_NEIGHBORS_H
#define HAPODE_NEAR_NEIGHBORS_H

/* Geoms near the pointers: which bodies and contacts a model has. */

#include <stdbool.h>
#include <stdint.h>

#include <ode/ode.h>

#include "near/cover.h"
#include "near/feels.h"
#include "near/relief.h"
#include "proximity/proximity.h"
#include "sync/messages.h"

typedef struct hapi_nearby hapi_nearby;

typedef struct hapi_candidate {
  dGeomID geom;
  uint32_t pointer;
  double reach; /* m, that it was found with */
} hapi_candidate;

typedef struct hapi_hit {
  dGeomID geom;
  uint32_t pointer;
  hapi_nearest nearest; /* a: pointer, b: geom */
  uint32_t tool_first;  /* of a hull: into the points of hapi_tool_search */
  uint32_t tool_count;  /* 0: a sphere */
  hap_pose tool_pose;   /* for which they were found */
  bool hidden;          /* of a sphere: by a nearer one, of the same surface */
  bool aside;           /* likewise: an edge, by what is beside it; see local/seams.h */
  bool seams;           /* it adjoins another one */
  double reach;         /* m, as far as the two may come until the next step */
  hapi_feels_said said; /* of the pair, by the application */
} hapi_hit;

typedef struct hapi_neighbors {
  dGeomID probe_geom;     /* private sphere, in no space */
  dGeomID plane_geom;     /* private plane, in no space */
  dGeomID ray_geom;       /* private ray, in no space */
  dContactGeom *vertices; /* HAPI_HULL_POINTS, of a convex geom */
  double *hull;           /* the same, x, y, z */
  hapi_candidate *candidates;
  uint32_t candidate_capacity;
  uint32_t candidate_count;
  struct hapi_hit *hits; /* candidate_capacity */
  uint32_t hit_count;    /* that the newest model has */
  hapi_cover cover;
  hapi_relief relief;
  hapi_feels feels;
  bool said_ahead;          /* that looking ahead finds no room, once a session */
  bool said_crowded;        /* of what is touched and finds no room, once a session */
  double fastest;           /* m/s, of all awake bodies' surfaces */
  uint32_t current_pointer; /* while ODE calls back */
  double current_reach;
} hapi_neighbors;

/* Part of hapi_nearby_create. False: no memory; finish is due all the same. */
bool hapi_neighbors_create(hapi_nearby *nearby);
void hapi_neighbors_finish(hapi_nearby *nearby);
void hapi_neighbors_reset(hapi_nearby *nearby); /* a session begins */

/* Of a geom, NULL of all: pointer_surface is asked again. */
void hapi_neighbors_forget_feel(hapi_nearby *nearby, dGeomID geom);
void hapi_neighbors_collect(hapi_nearby *nearby); /* before the global step */
void hapi_neighbors_find(hapi_nearby *nearby);    /* after it: bodies and contacts of the model */
double hapi_neighbors_speed(const hapi_nearby *nearby, dGeomID geom,
                            const hapi_state_pointer *pointer,
                            const double point[3]);                   /* m/s, relative */
double hapi_neighbors_reach(double relative_speed, double horizon_s); /* m */
/* m/s, at a distance from the centre of the geom's body, by its turning */
double hapi_neighbors_spin(const hapi_nearby *nearby, dGeomID geom, double distance);
/* Dynamic bodies that a pointer may touch, of the newest model. */
uint32_t hapi_neighbors_bodies(const hapi_nearby *nearby);

/* shapes.c: geoms as shapes for proximity */

#define HAPI_HULL_POINTS 4096u /* of a convex geom that are looked at */

/* The hull of a convex geom in world axes, its points in near.neighbors.hull. */
bool hapi_hull_of_convex(hapi_nearby *nearby, dGeomID geom, hapi_shape *shape, hap_pose *pose);
/* Shape and pose of a geom for proximity; false: of a class that only ODE's collider knows. */
bool hapi_shape_of_geom(dGeomID geom, hapi_shape *out_shape, hap_pose *out_pose);
/* Distance from a sphere's surface to the geom, within reach of it; false: farther. normal out of
 * the geom. */
bool hapi_geom_nearest(hapi_nearby *nearby, dGeomID geom, const double center[3], double radius,
                       double reach, hapi_nearest *out);

#endif
