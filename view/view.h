/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_VIEW_VIEW_H
#define HAPODE_VIEW_VIEW_H

/* Pictures of a scene by OpenGL: without a display, or in a window of the caller's. The viewer
 * knows public headers without ODE's types alone: a scene as hapode/scene.h lists it, and a frame
 * that the caller fills in. One thread uses a view. */

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
#define VIEW_PANEL_ROWS 40
#define VIEW_PANELS 2

typedef struct view view;

/* What the hand holds. A sphere where half_edges are 0, else a box that radius rounds. */
typedef struct view_pointer {
  hap_pose proxy;  /* in the world */
  hap_pose device; /* likewise; where it is the same, it is not drawn */
  double force[3]; /* N, on the hand, world */
  double radius;   /* m */
  double half_edges[3];
  bool is_pulled; /* by a string, to pull */
  double pull[3]; /* m, world */
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
  double begin;             /* s */
  double seconds;           /* whole length */
  float force[VIEW_BINS];   /* N, strongest in the bin, of the strongest hand */
  float tick_us[VIEW_BINS]; /* us, mean */
  float tick_weight[VIEW_BINS];
} view_strips;

/* A table over the picture: left, with a title. */
typedef struct view_panel {
  char title[48];
  char rows[VIEW_PANEL_ROWS][2][72];
  size_t row_count; /* 0: it is not shown */
} view_panel;

/* What stands in the picture's upper left corner, and over the picture. */
typedef struct view_labels {
  char title[96];
  char subtitle[128];
  char notice[256];               /* lines that a newline parts, over the strips; "": none */
  view_panel panels[VIEW_PANELS]; /* beside the labels, and in the middle */
  bool has_slider;
  double slider[2]; /* shares of its length: where it is, and how far it is filled */
} view_labels;

/* Opens a context by EGL, without a display, and makes all that pictures of this size need. Pixels:
 * VIEW_PIXELS_MIN..VIEW_PIXELS_MAX each way. HAP_ERROR_UNSUPPORTED: there is no EGL, or it has no
 * OpenGL 3.3; detail says it in a sentence. HAP_ERROR_MEMORY, HAP_ERROR_ARGUMENT. */
hap_status view_create(int width, int height, view **out, hap_detail *detail);

/* The same in the OpenGL 3.3 context that is current to the thread, and stays so: for a window. */
hap_status view_create_here(int width, int height, view **out, hap_detail *detail);

/* Another size, with the errors of view_create; after one only view_destroy. */
hap_status view_resize(view *v, int width, int height, hap_detail *detail);
void view_destroy(view *v); /* NULL allowed */

/* Reads what is to be drawn: shapes, sizes, colours, joints. The scene is not needed afterwards. */
hap_status view_take_scene(view *v, const hap_scene *scene, hap_detail *detail);

/* Where the eye is and what it looks at, m, world. Before: the view frames what moves by itself. */
void view_set_camera(view *v, const double eye[3], const double target[3]);

void view_get_camera(const view *v, double out_eye[3], double out_target[3]);

/* The view frames what moves by itself again. */
void view_free_camera(view *v);

/* For moving pictures: share of the last picture's framing that the next ones keep, 0 (default) to
 * 1, so that the eye follows calmly; after view_set_camera of the size of marks alone. */
void view_set_calm(view *v, double share);

/* Draws a picture; strips and labels may be NULL. Of the pixels the view's: rows from the top, 3
 * bytes each. Until the next call. */
const uint8_t *view_draw(view *v, const view_frame *frame, const view_strips *strips,
                         const view_labels *labels);

/* Draws a picture into the window of the context. */
void view_show(view *v, const view_frame *frame, const view_strips *strips,
               const view_labels *labels);

/* The line of sight through a pixel of the newest picture: unit, from the eye. */
void view_ray(const view *v, const double xy[2], double out_eye[3], double out_way[3]);

/* The body of the frame that is seen at a pixel, and where its surface is, m, world; boxes around
 * shapes are enough. HAP_SCENE_WORLD: none that moves. */
uint32_t view_pick(const view *v, const view_frame *frame, const double xy[2], double out_point[3]);

/* Share of the slider's length at a pixel; false: the pixel is not on the slider. */
bool view_slider_at(const view *v, const double xy[2], double *out_share);

/* Where a point of the world is in the newest picture, pixels from the upper left corner. False:
 * behind the eye. */
bool view_project(const view *v, const double point[3], double out_xy[2]);

/* The colour by which bodies of a role are told, sRGB 0..1. */
void view_role_colour(hap_body_role role, float out_rgb[3]);

/* The arrow of a force: from where to where, m, world. */
void view_arrow(const view *v, const view_pointer *pointer, double out_from[3], double out_to[3]);

void view_strips_init(view_strips *strips, double seconds);
/* Of a tick at t: the strongest hand's force, N, and what the tick took, us. What is beyond the end
 * moves the strips on: the oldest bins are forgotten. */
void view_strips_add(view_strips *strips, double t, double force_n, double tick_us);

/* Writes rows of 3 bytes a pixel into a PNG file. The file is open for writing, and stays open.
 * HAP_ERROR_IO with the reason, HAP_ERROR_MEMORY. */
hap_status view_png_write(void *file, const uint8_t *pixels, int width, int height,
                          hap_detail *detail);

#endif
