/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_VIEW_VIEW_H
#define HAPODE_VIEW_VIEW_H

/* Pictures of a scene by OpenGL, without a display. The viewer knows public headers without ODE's
 * types alone: a scene as hapode/scene.h lists it, and a frame that the caller fills in. One thread
 * uses a view. */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <hapode/scene.h>
#include <hapode/touches.h>

#define VIEW_POINTERS_MAX 16
#define VIEW_TOUCHES_MAX 32
#define VIEW_BINS 480 /* of a strip */
#define VIEW_PIXELS_MIN 64
#define VIEW_PIXELS_MAX 8192

typedef struct view view;

/* What the hand holds. A sphere where half_edges are 0, else a box that radius rounds. */
typedef struct view_pointer {
  hap_pose proxy;  /* in the world */
  hap_pose device; /* likewise; where it is the same, it is not drawn */
  double force[3]; /* N, on the hand, world */
  double radius;   /* m */
  double half_edges[3];
} view_pointer;

typedef struct view_touch {
  double point[3];  /* m, world */
  double normal[3]; /* unit, out of the body */
} view_touch;

/* A moment. */
typedef struct view_frame {
  double t;             /* s */
  hap_pose *bodies;     /* body_count, by their numbers in the scene; the caller's */
  hap_body_role *roles; /* likewise */
  size_t body_count;
  view_pointer pointers[VIEW_POINTERS_MAX];
  size_t pointer_count;
  view_touch touches[VIEW_TOUCHES_MAX];
  size_t touch_count;
  double force_error; /* share of the force, by looking back; 0: unknown */
} view_frame;

/* Force and time of ticks over a run. Bins that are not reached have negative values. */
typedef struct view_strips {
  double seconds;           /* whole length */
  float force[VIEW_BINS];   /* N, strongest in the bin, of the strongest hand */
  float tick_us[VIEW_BINS]; /* us, mean */
  float tick_weight[VIEW_BINS];
} view_strips;

/* What stands in the picture's upper left corner. */
typedef struct view_labels {
  char title[96];
  char subtitle[128];
} view_labels;

/* Opens a context by EGL, without a display, and makes all that pictures of this size need. Pixels:
 * VIEW_PIXELS_MIN..VIEW_PIXELS_MAX each way. HAP_ERROR_UNSUPPORTED: there is no EGL, or it has no
 * OpenGL 3.3; detail says it in a sentence. HAP_ERROR_MEMORY, HAP_ERROR_ARGUMENT. */
hap_status view_create(int width, int height, view **out, hap_detail *detail);
void view_destroy(view *v); /* NULL allowed */

/* Reads what is to be drawn: shapes, sizes, colours, joints. The scene is not needed afterwards. */
hap_status view_take_scene(view *v, const hap_scene *scene, hap_detail *detail);

/* Where the eye is and what it looks at, m, world. Before: the view frames what moves by itself. */
void view_set_camera(view *v, const double eye[3], const double target[3]);

/* For moving pictures: share of the last picture's framing that the next ones keep, 0 (default) to
 * 1, so that the eye follows calmly. Without effect after view_set_camera. */
void view_set_calm(view *v, double share);

/* Draws a picture; strips and labels may be NULL. Of the pixels the view's: rows from the top, 3
 * bytes each. Until the next call. */
const uint8_t *view_draw(view *v, const view_frame *frame, const view_strips *strips,
                         const view_labels *labels);

/* Where a point of the world is in the newest picture, pixels from the upper left corner. False:
 * behind the eye. */
bool view_project(const view *v, const double point[3], double out_xy[2]);

/* The colour by which bodies of a role are told, sRGB 0..1. */
void view_role_colour(hap_body_role role, float out_rgb[3]);

/* The arrow of a force: from where to where, m, world. */
void view_arrow(const view *v, const view_pointer *pointer, double out_from[3], double out_to[3]);

void view_strips_init(view_strips *strips, double seconds);
/* Of a tick at t: the strongest hand's force, N, and what the tick took, us. */
void view_strips_add(view_strips *strips, double t, double force_n, double tick_us);

/* Writes rows of 3 bytes a pixel into a PNG file. The file is open for writing, and stays open.
 * HAP_ERROR_IO with the reason, HAP_ERROR_MEMORY. */
hap_status view_png_write(void *file, const uint8_t *pixels, int width, int height,
                          hap_detail *detail);

#endif
