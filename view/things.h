/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_VIEW_THINGS_H
#define HAPODE_VIEW_THINGS_H

/* What is in a scene, as things to draw, and the instances of a frame. */

#include "view/camera.h"
#include "view/gpu.h"
#include "view/view.h"

/* Meshes that all scenes share; those behind belong to one geom each. */
typedef enum thing_mesh {
  THING_BOX = 0,
  THING_ROUND, /* sphere, capsule */
  THING_CYLINDER,
  THING_CONE,
  THING_FLOOR,
  THING_MESHES
} thing_mesh;

typedef struct thing {
  uint32_t mesh;
  uint32_t body; /* HAP_SCENE_WORLD: it never moves */
  hap_pose pose; /* in the body's frame */
  gpu_instance instance;
  float extent; /* m, from its middle to its farthest point; 0: a plane */
} thing;

/* A joint's axis, in the frame of body a. */
typedef struct thing_axis {
  uint32_t body;
  double anchor[3];
  double direction[3];
  float extent; /* m, of the body's largest thing; 0: it has none */
} thing_axis;

/* Instances of a mesh in a frame: what throws shadows, then marks, then what one sees through. */
typedef struct thing_batch {
  gpu_mesh mesh;
  gpu_instance *list;
  size_t capacity;
  size_t solid; /* of them */
  size_t marked;
  size_t count;
} thing_batch;

typedef struct things {
  thing *list;
  size_t count;
  thing_axis *axes;
  size_t axis_count;
  thing_batch *batches; /* THING_MESHES and further ones */
  size_t batch_count;
  camera_ball *balls; /* of a frame */
} things;

/* An empty scene has the shared meshes. */
hap_status things_read(const hap_scene *scene, things *out, hap_detail *detail);
void things_free(things *of);

/* What is to be in the picture. *out_size: of the scene without arrows, m: from the middle to the
 * corners. */
size_t things_balls(const things *of, const view_frame *frame, float *out_size);
/* Fills the batches; size: of the scene, m. */
void things_place(things *io, const view_frame *frame, float size);
/* The first body that a line of sight meets, boxes around shapes counting as shapes, and how far
 * from the eye, m; HAP_SCENE_WORLD where there is none or one that never moves. */
uint32_t things_hit(const things *of, const view_frame *frame, const double eye[3],
                    const double way[3], double *out_depth);
/* The arrow of a pointer's force. False: there is next to none. */
bool things_arrow(const view_pointer *pointer, float size, float out_from[3], float out_to[3]);

#endif
