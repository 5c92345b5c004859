/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_VIEW_GPU_H
#define HAPODE_VIEW_GPU_H

/* A context without a display, programs, buffers and the surfaces that are drawn on. */

#include <epoxy/gl.h>

#include <hapode/status.h>

#include "view/shapes.h"

#define GPU_SHADOW_SMALL 1024 /* of the sun's map */
#define GPU_SHADOW_LARGE 2048 /* where the picture has more pixels than that */

/* The context by EGL; current to the calling thread. */
typedef struct gpu_context {
  void *display;
  void *context;
} gpu_context;

hap_status gpu_context_open(gpu_context *out, hap_detail *detail);
void gpu_context_close(gpu_context *context); /* zeroed allowed */

/* Surfaces of one size. */
typedef struct gpu_surfaces {
  GLuint many; /* framebuffer with several samples a pixel */
  GLuint one;  /* framebuffer that is read */
  GLuint shadow;
  GLuint shadow_map;
  int shadow_pixels;
  GLuint buffers[3];
} gpu_surfaces;

hap_status gpu_surfaces_make(int width, int height, gpu_surfaces *out, hap_detail *detail);
void gpu_surfaces_free(gpu_surfaces *surfaces);

/* 0, with a text: it does not compile. */
GLuint gpu_program(const char *vertex, const char *pixel, hap_detail *detail);

/* What an instance of a mesh is, as shaders.c reads it. */
typedef struct gpu_instance {
  float place[3];
  float bevel;
  float turn[4];
  float extent[3];
  float gloss;
  float colour[4];
} gpu_instance;

/* A mesh on the GPU, with room for instances that grows. */
typedef struct gpu_mesh {
  GLuint array;
  GLuint buffers[3]; /* vertices, indices, instances */
  GLsizei index_count;
  GLsizei capacity; /* instances that there is room for */
} gpu_mesh;

void gpu_mesh_make(const shape_mesh *mesh, gpu_mesh *out);
void gpu_mesh_free(gpu_mesh *mesh);
void gpu_mesh_load(gpu_mesh *mesh, const gpu_instance *instances, size_t count);
/* Of what was loaded, count from first on. */
void gpu_mesh_draw(const gpu_mesh *mesh, size_t first, size_t count);

#endif
