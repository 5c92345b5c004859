/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_ORACLE_MODEL_H
#define HAPODE_TESTS_ORACLE_MODEL_H

/* What MuJoCo's compiler makes of a scene file: the arrays that scene_oracle.c compares, under
 * MuJoCo's names. They come from its library where hapode's tests were built with it, or from its
 * package for node, in HAPODE_MUJOCO_NODE/node_modules, which stands over the library. */

#include <stdbool.h>
#include <stddef.h>

/* As in the package and in every version of the library. */
typedef enum oracle_geom_type {
  ORACLE_PLANE = 0,
  ORACLE_FIELD,
  ORACLE_SPHERE,
  ORACLE_CAPSULE,
  ORACLE_ELLIPSOID,
  ORACLE_CYLINDER,
  ORACLE_BOX,
  ORACLE_MESH
} oracle_geom_type;

typedef enum oracle_joint_type {
  ORACLE_FREE = 0,
  ORACLE_BALL,
  ORACLE_SLIDE,
  ORACLE_HINGE
} oracle_joint_type;

typedef struct oracle_bodies {
  int count;
  const int *joint_at;
  const int *joint_count;
  const int *geom_at;
  const int *geom_count;
  const double *mass;
  const double *ipos;
  const double *iquat;
  const double *inertia;
  const double *xpos; /* in the pose of the file */
  const double *xquat;
  const char *const *names;
} oracle_bodies;

typedef struct oracle_joints {
  const int *type;
  const int *qpos_at;
  const int *dof_at;
  const int *limited;
  const double *pos;
  const double *axis;
  const double *range;
  const double *stiffness;
  const double *damping; /* this and the next two: of each degree of freedom */
  const double *armature;
  const double *friction;
  const double *qpos0;
  const double *qpos_spring;
} oracle_joints;

typedef struct oracle_geoms {
  const int *type;
  const int *contype;
  const int *conaffinity;
  const int *material; /* -1: none */
  const int *data;     /* of a field: which */
  const double *pos;
  const double *quat;
  const double *size;
  const double *box; /* of a mesh, in its body: least x, y, z, then most */
  const double *friction;
  const double *rgba;
  const double *material_rgba;
  const int *field_rows;
  const int *field_columns;
  const int *field_at;
  const double *field_size;
  const double *field_data;
} oracle_geoms;

typedef struct oracle_model {
  double gravity[3]; /* none where it is switched off */
  oracle_bodies bodies;
  oracle_joints joints;
  oracle_geoms geoms;
  void *memory; /* of all arrays */
} oracle_model;

/* One of the two is there. */
bool oracle_library_is_there(void);
bool oracle_node_is_there(void);
/* False: MuJoCo refuses the file, and why. */
bool oracle_library_read(const char *path, oracle_model *out, char *why, size_t size);
bool oracle_node_read(const char *path, oracle_model *out, char *why, size_t size);
void oracle_model_free(oracle_model *model);

#endif
