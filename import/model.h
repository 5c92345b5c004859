/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_IMPORT_MODEL_H
#define HAPODE_IMPORT_MODEL_H

/* What a file says, whatever its format: a tree of bodies with joints and geoms. SI units, radians,
 * angles and lengths of joints from the pose in which the bodies are described. */

#include <stdint.h>

#include <hapode/spatial.h>

#include "import/notes.h"

typedef enum import_shape {
  IMPORT_PLANE = 0,
  IMPORT_SPHERE,    /* size[0]: radius */
  IMPORT_CAPSULE,   /* radius; half of the length without caps, along z */
  IMPORT_CYLINDER,  /* radius; half of the length, along z */
  IMPORT_BOX,       /* half edges */
  IMPORT_ELLIPSOID, /* half axes */
  IMPORT_MESH,
  IMPORT_FIELD /* half edges along x and y; of what never moves */
} import_shape;

/* A closed convex surface, triangles counter-clockwise as seen from outside. */
typedef struct import_mesh {
  const double *vertices_xyz;
  const uint32_t *triangles;
  size_t vertex_count;
  size_t triangle_count;
} import_mesh;

/* Heights over x and y, m: rows along y, columns along x, both from the lower end. */
typedef struct import_field {
  double *heights;
  uint32_t columns;
  uint32_t rows;
} import_field;

/* About the centre of mass, in the axes of the frame it is told in. */
typedef struct import_mass {
  double mass;
  double centre[3];
  double inertia[9];
} import_mass;

typedef struct import_geom {
  import_place at;
  const char *name; /* "": none */
  import_shape shape;
  hap_pose pose; /* in its body */
  double size[3];
  const import_mesh *mesh;
  const import_field *field;
  import_mass mass; /* in its body's frame; mass 0: it counts for none */
  bool collides;
  double friction;
  uint32_t category_bits;
  uint32_t collide_bits;
  float colour_rgba[4];
  struct import_geom *next;
} import_geom;

typedef enum import_joint_kind {
  IMPORT_FREE = 0,
  IMPORT_BALL,
  IMPORT_HINGE,
  IMPORT_SLIDER
} import_joint_kind;

typedef struct import_joint {
  import_place at;
  const char *name;
  import_joint_kind kind;
  double anchor[3]; /* in the body's frame */
  double axis[3];   /* unit, likewise */
  double low;       /* -infinity: none */
  double high;
  double friction; /* N or N m */
  double armature; /* kg or kg m^2 */
  double stiffness;
  double rest; /* of the spring, as low and high */
  double damping;
  struct import_joint *next;
} import_joint;

typedef struct import_body {
  import_place at;
  const char *name;
  struct import_body *parent; /* NULL: the world itself */
  hap_pose pose;              /* in the parent */
  hap_pose pose_world;
  import_mass mass; /* in the body's frame */
  bool mass_given;  /* geoms do not count */
  import_joint *joints;
  import_geom *geoms;
  struct import_body *carrier; /* it is rigid with: itself where it has joints, or the world */
  import_mass whole;           /* of a carrier: with all that is rigid with it, in its frame */
  uint32_t number;             /* of a carrier: in the scene */
  struct import_body *next;    /* a parent comes before its children */
} import_body;

/* Two bodies that do not touch. */
typedef struct import_pass {
  const import_body *a;
  const import_body *b;
  struct import_pass *next;
} import_pass;

/* Two bodies that hold each other: at a point, or as they are. */
typedef struct import_hold {
  import_place at;
  const import_body *a;
  const import_body *b;
  bool is_fixed;
  double anchor[3]; /* in a's frame */
  struct import_hold *next;
} import_hold;

typedef struct import_model {
  const char *name;
  double gravity[3];
  import_body *bodies; /* the first is the world */
  import_pass *passes;
  import_hold *holds;
} import_model;

/* NULL: there is none. */
import_body *import_find_body(const import_model *model, const char *name);

/* out = b as seen in the frame in which a is told; out may be a or b. */
void import_pose_join(const hap_pose *a, const hap_pose *b, hap_pose *out);
/* Of a pose's frame into the frame that the pose is told in. */
void import_mass_place(const hap_pose *pose, const import_mass *mass, import_mass *out);
/* io and more as one rigid thing. */
void import_mass_add(import_mass *io, const import_mass *more);
void import_mass_scale(import_mass *io, double factor);

/* Of a shape of uniform density, in its own frame; a plane and a mesh have none. */
void import_shape_mass(import_shape shape, const double size[3], double density, import_mass *out);

/* Poses in the world, masses of bodies from their geoms. */
void import_model_settle(import_model *model);
/* Carriers and what is rigid with them; after the masses are as they stay. */
void import_model_join(import_model *model);

#endif
