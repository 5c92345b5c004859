/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SCENE_SCENE_INTERNAL_H
#define HAPODE_SCENE_SCENE_INTERNAL_H

/* Shared by the files of lib/scene. */

#include <stdbool.h>

#include <ode/ode.h>

#include <hapode/scene.h>

#include "base/def.h"
#include "world/springs.h"

struct scene;

typedef struct hapi_scene_body {
  dBodyID body;     /* NULL: it was removed */
  double centre[3]; /* m, of mass, in the frame of the body's def */
} hapi_scene_body;

/* What a geom was made of, and what ODE does not keep. */
typedef struct hapi_scene_geom {
  dGeomID geom;  /* NULL: it was removed */
  uint32_t body; /* HAP_SCENE_WORLD: it never moves */
  hap_shape shape;
  hap_pose pose; /* in the frame of the body's def, or the world */
  double edges[3];
  double radius;
  double length;
  double friction;
  double bounce;
  float colour[4];
  double *vertices; /* of a mesh or field, in the geom's frame */
  uint32_t *triangles;
  uint32_t vertex_count;
  uint32_t triangle_count;
  double *heights; /* as ODE wants them */
  dTriMeshDataID mesh;
  dHeightfieldDataID field;
} hapi_scene_geom;

typedef struct hapi_scene_joint {
  dJointID joint; /* NULL: it was removed */
  hap_joint_kind kind;
} hapi_scene_joint;

/* Two bodies that pass through each other, the smaller number first. */
typedef struct hapi_scene_pass {
  uint32_t a;
  uint32_t b;
} hapi_scene_pass;

struct hap_scene {
  dWorldID world;
  dSpaceID space;
  hapi_scene_body *bodies;
  hapi_scene_geom *geoms;
  hapi_scene_joint *joints;
  uint32_t body_count; /* with those that were removed, also below */
  uint32_t body_capacity;
  uint32_t geom_count;
  uint32_t geom_capacity;
  uint32_t joint_count;
  uint32_t joint_capacity;
  hapi_springs springs;    /* on axes of the joints */
  hapi_scene_pass *passes; /* rising by a, then b */
  uint32_t pass_count;
  uint32_t pass_capacity;
  struct scene *built_in;              /* owns world and space; NULL: they are ours */
  void (*end_world)(hap_scene *scene); /* of a built-in scene */
  double hull[8][3];                   /* of the hands of a built-in scene */
  hap_session *session;                /* over it; NULL: none */
  hap_scene_step_fn before;
  hap_scene_step_fn after;
  void *user;
  hap_scene_surface_fn surface; /* NULL: geoms feel as the pointers say */
  double magnet_reach;          /* m */
  void *surface_user;
};

/* life.c */
hap_status hapi_scene_make(hap_scene **out, hap_detail *detail);
/* HAP_ERROR_THREAD where the world may not be touched now. */
hap_status hapi_scene_may_edit(const hap_scene *scene, hap_detail *detail);
/* NULL: there is none of that number. */
hapi_scene_body *hapi_scene_body_at(const hap_scene *scene, uint32_t body);
hapi_scene_geom *hapi_scene_geom_at(const hap_scene *scene, uint32_t geom);
hapi_scene_joint *hapi_scene_joint_at(const hap_scene *scene, uint32_t joint);
void hapi_scene_geom_end(hapi_scene_geom *geom); /* with ODE's geom */

/* built_in.c */
uint32_t hapi_scene_hands(const hap_scene *of); /* that it was made for */

/* passes.c */
bool hapi_scene_passes(const hap_scene *scene, dBodyID a, dBodyID b);

/* shapes.c */
hap_status hapi_shape_check(const hap_geom_def *def, bool of_body, hap_detail *detail);
/* Vertices and triangles of a field as ODE has them. False: no memory. */
bool hapi_field_triangles(const hap_geom_def *def, hapi_scene_geom *out);
/* ODE's geom of a def that was checked, in no body. HAP_ERROR_MEMORY. */
hap_status hapi_shape_make(dSpaceID space, const hap_geom_def *def, hapi_scene_geom *out);
/* Of the geom where it is in its body's frame. False: it has no volume. */
bool hapi_shape_mass(const hapi_scene_geom *geom, double density, dMass *out);

/* build.c */
uint32_t hapi_scene_joint_axes(hap_joint_kind kind); /* that have stops and a motor */
void hapi_scene_joint_set(const hapi_scene_joint *joint, int parameter, uint32_t axis,
                          double value); /* one of dParam */

#endif
