/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "view/view.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "view/camera.h"
#include "view/gpu.h"
#include "view/ink.h"
#include "view/shaders.h"
#include "view/strips.h"
#include "view/things.h"

#define TEXT_SHARE 0.06F   /* of the height, for the labels */
#define HIDDEN_ALPHA 0.22F /* of marks behind bodies */

typedef struct view_programs {
  GLuint body;
  GLuint shadow;
  GLuint sky;
} view_programs;

struct view {
  int size[2];
  bool begun; /* there is a context */
  gpu_context context;
  gpu_surfaces surfaces;
  view_programs programs;
  GLuint nothing; /* vertex array of the sky */
  things things;
  view_camera camera;
  bool camera_given;
  bool framed; /* there was a picture */
  float calm;  /* share of the last framing that is kept */
  ink ink;
  uint8_t *pixels;
};

static const float sun[3] = {-0.6120F, -0.2318F, 0.7561F}; /* unit, towards it */

static hap_status view_make(view *v, bool here, hap_detail *detail)
{
  hap_status status = here ? HAP_OK : gpu_context_open(&v->context, detail);
  if (status < HAP_OK) {
    return status;
  }
  v->begun = true;
  status = gpu_surfaces_make(v->size[0], v->size[1], &v->surfaces, detail);
  if (status < HAP_OK) {
    return status;
  }
  v->programs.body = gpu_program(shader_body_vertex, shader_body_pixel, detail);
  v->programs.shadow = gpu_program(shader_shadow_vertex, shader_shadow_pixel, detail);
  v->programs.sky = gpu_program(shader_sky_vertex, shader_sky_pixel, detail);
  if (v->programs.body == 0 || v->programs.shadow == 0 || v->programs.sky == 0) {
    return HAP_ERROR_UNSUPPORTED;
  }
  glGenVertexArrays(1, &v->nothing);
  status = ink_make(&v->ink, detail);
  return status < HAP_OK ? status : things_read(NULL, &v->things, detail);
}

static bool size_is_good(int width, int height)
{
  return width >= VIEW_PIXELS_MIN && width <= VIEW_PIXELS_MAX && height >= VIEW_PIXELS_MIN &&
         height <= VIEW_PIXELS_MAX;
}

static hap_status view_begin(const int size[2], bool here, view **out, hap_detail *detail)
{
  *out = NULL;
  const int width = size[0];
  const int height = size[1];
  if (!size_is_good(width, height)) {
    return HAP_ERROR_ARGUMENT;
  }
  view *v = calloc(1, sizeof *v);
  if (v != NULL) {
    v->size[0] = width;
    v->size[1] = height;
    v->pixels = malloc(3 * (size_t)width * (size_t)height);
  }
  if (v == NULL || v->pixels == NULL) {
    free(v);
    return HAP_ERROR_MEMORY;
  }
  hap_status status = view_make(v, here, detail);
  if (status < HAP_OK) {
    view_destroy(v);
    return status;
  }
  *out = v;
  return HAP_OK;
}

hap_status view_create(int width, int height, view **out, hap_detail *detail)
{
  return view_begin((const int[2]){width, height}, false, out, detail);
}

hap_status view_create_here(int width, int height, view **out, hap_detail *detail)
{
  return view_begin((const int[2]){width, height}, true, out, detail);
}

hap_status view_resize(view *v, int width, int height, hap_detail *detail)
{
  if (!size_is_good(width, height)) {
    return HAP_ERROR_ARGUMENT;
  }
  uint8_t *pixels = malloc(3 * (size_t)width * (size_t)height);
  if (pixels == NULL) {
    return HAP_ERROR_MEMORY;
  }
  free(v->pixels);
  v->pixels = pixels;
  v->size[0] = width;
  v->size[1] = height;
  gpu_surfaces_free(&v->surfaces);
  return gpu_surfaces_make(width, height, &v->surfaces, detail);
}

void view_destroy(view *v)
{
  if (v == NULL) {
    return;
  }
  if (v->begun) {
    things_free(&v->things);
    ink_free(&v->ink);
    glDeleteProgram(v->programs.body);
    glDeleteProgram(v->programs.shadow);
    glDeleteProgram(v->programs.sky);
    glDeleteVertexArrays(1, &v->nothing);
    gpu_surfaces_free(&v->surfaces);
  }
  gpu_context_close(&v->context);
  free(v->pixels);
  free(v);
}

hap_status view_take_scene(view *v, const hap_scene *scene, hap_detail *detail)
{
  things_free(&v->things);
  return things_read(scene, &v->things, detail);
}

void view_set_camera(view *v, const double eye[3], const double target[3])
{
  for (int i = 0; i < 3; ++i) {
    v->camera.eye[i] = (float)eye[i];
    v->camera.target[i] = (float)target[i];
  }
  v->camera_given = true;
}

void view_get_camera(const view *v, double out_eye[3], double out_target[3])
{
  for (int i = 0; i < 3; ++i) {
    out_eye[i] = (double)v->camera.eye[i];
    out_target[i] = (double)v->camera.target[i];
  }
}

void view_free_camera(view *v)
{
  v->camera_given = v->framed = false;
}

void view_set_calm(view *v, double share)
{
  v->calm = (float)share;
}

/* ---- drawing ---- */

static float view_aspect(const view *v)
{
  return (float)v->size[0] / (float)v->size[1];
}

/* What a person counts in: 1, 2 or 5 of a decade, some eight to the scene. */
static float grid_cell(float size)
{
  float wanted = 0.16F * size;
  float decade = powf(10.0F, floorf(log10f(wanted)));
  float share = wanted / decade;
  return decade * (share < 2.0F ? 1.0F : share < 5.0F ? 2.0F : 5.0F);
}

static void vector_blend(const float old[3], float share, float io[3])
{
  for (int i = 0; i < 3; ++i) {
    io[i] += share * (old[i] - io[i]);
  }
}

static void camera_place(view *v, const view_frame *frame, bool strips)
{
  view_camera given = v->camera;
  size_t count = things_balls(&v->things, frame, &v->camera.size);
  const float below = strips ? strips_share(v->size[1]) : 0.0F;
  const float above = strips ? TEXT_SHARE : 0.0F;
  v->camera.up_share = below - above;
  v->camera.free_share = 1.0F - below - above;
  camera_frame(&v->camera, v->things.balls, count, view_aspect(v));
  if (v->framed) {
    v->camera.size += v->calm * (given.size - v->camera.size);
  }
  if (v->framed && !v->camera_given && v->calm > 0.0F) {
    vector_blend(given.eye, v->calm, v->camera.eye);
    vector_blend(given.target, v->calm, v->camera.target);
    camera_look(&v->camera, view_aspect(v));
  }
  v->framed = true;
  if (v->camera_given) {
    memcpy(v->camera.eye, given.eye, sizeof given.eye);
    memcpy(v->camera.target, given.target, sizeof given.target);
    camera_look(&v->camera, view_aspect(v));
  }
}

typedef enum draw_part {
  DRAW_SOLID = 0,
  DRAW_MARKS,
  DRAW_GHOSTS
} draw_part;

static void batches_draw(const view *v, draw_part part, bool floors)
{
  for (size_t i = 0; i < v->things.batch_count; ++i) {
    const thing_batch *b = &v->things.batches[i];
    const size_t ends[] = {0, b->solid, b->marked, b->count};
    if (i != THING_FLOOR || floors) {
      gpu_mesh_draw(&b->mesh, ends[part], ends[part + 1] - ends[part]);
    }
  }
}

static void matrix_set(GLuint program, const char *name, const view_matrix *matrix)
{
  glUniformMatrix4fv(glGetUniformLocation(program, name), 1, GL_FALSE, matrix->at);
}

static void shadow_draw(const view *v, const view_matrix *sun_map)
{
  glBindFramebuffer(GL_FRAMEBUFFER, v->surfaces.shadow);
  glViewport(0, 0, v->surfaces.shadow_pixels, v->surfaces.shadow_pixels);
  glClear(GL_DEPTH_BUFFER_BIT);
  glUseProgram(v->programs.shadow);
  matrix_set(v->programs.shadow, "camera", sun_map);
  glEnable(GL_POLYGON_OFFSET_FILL);
  glPolygonOffset(1.5F, 2.0F);
  batches_draw(v, DRAW_SOLID, false);
  glDisable(GL_POLYGON_OFFSET_FILL);
}

static void light_set(const view *v, const view_matrix *sun_map, float texel)
{
  const GLuint p = v->programs.body;
  const view_camera *c = &v->camera;
  glUseProgram(p);
  matrix_set(p, "camera", &c->look);
  matrix_set(p, "sun_map", sun_map);
  glUniform1f(glGetUniformLocation(p, "texel"), texel);
  glUniform3fv(glGetUniformLocation(p, "sun"), 1, sun);
  glUniform3fv(glGetUniformLocation(p, "eye"), 1, c->eye);
  glUniform4f(glGetUniformLocation(p, "ground"), c->target[0], c->target[1], c->target[2], c->size);
  glUniform1f(glGetUniformLocation(p, "cell"), grid_cell(c->size));
  glBindTexture(GL_TEXTURE_2D, v->surfaces.shadow_map);
}

static void sky_draw(const view *v)
{
  glUseProgram(v->programs.sky);
  matrix_set(v->programs.sky, "back", &v->camera.back);
  glBindVertexArray(v->nothing);
  glDepthFunc(GL_LEQUAL);
  glDisable(GL_CULL_FACE);
  glDepthMask(GL_FALSE);
  glDrawArrays(GL_TRIANGLE_STRIP, 0, 3);
  glDepthMask(GL_TRUE);
  glEnable(GL_CULL_FACE);
  glDepthFunc(GL_LESS);
}

static void world_draw(const view *v)
{
  batches_draw(v, DRAW_SOLID, true);
  batches_draw(v, DRAW_MARKS, true);
  sky_draw(v); /* where nothing is */
  glUseProgram(v->programs.body);
  glEnable(GL_BLEND); /* marks behind bodies, faintly; then what one sees through */
  glDepthMask(GL_FALSE);
  glDepthFunc(GL_GREATER);
  glBlendColor(0.0F, 0.0F, 0.0F, HIDDEN_ALPHA);
  glBlendFunc(GL_CONSTANT_ALPHA, GL_ONE_MINUS_CONSTANT_ALPHA);
  batches_draw(v, DRAW_MARKS, false);
  glDepthFunc(GL_LESS);
  glBlendFunc(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA);
  batches_draw(v, DRAW_GHOSTS, false);
  glDepthMask(GL_TRUE);
  glDisable(GL_BLEND);
}

static void arrow_labels_draw(view *v, const view_frame *frame)
{
  for (size_t i = 0; i < frame->pointer_count; ++i) {
    const view_pointer *p = &frame->pointers[i];
    double from[3];
    double to[3];
    double at[2];
    view_arrow(v, p, from, to);
    double force = hypot(hypot(p->force[0], p->force[1]), p->force[2]);
    if (force >= 0.05 && view_project(v, to, at)) {
      arrow_label_draw(&v->ink, (const float[2]){(float)at[0], (float)at[1]}, force, v->size);
    }
  }
}

static void text_draw(view *v, const view_frame *frame, const view_strips *strips,
                      const view_labels *labels)
{
  arrow_labels_draw(v, frame);
  if (v->things.batches[THING_FLOOR].count > 0 && (labels == NULL || !labels->has_slider)) {
    grid_label_draw(&v->ink, grid_cell(v->camera.size), strips != NULL, v->size);
  }
  if (labels != NULL) {
    labels_draw(&v->ink, labels, frame, v->size);
    legend_draw(&v->ink, frame, v->size);
  }
  if (strips != NULL) {
    strips_draw(&v->ink, strips, frame->t, v->size);
  }
  if (labels != NULL) {
    overlay_draw(&v->ink, labels, strips != NULL, v->size);
  }
  glDisable(GL_DEPTH_TEST);
  glDisable(GL_CULL_FACE);
  glEnable(GL_BLEND);
  glBlendFunc(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA);
  ink_draw(&v->ink, v->size[0], v->size[1]);
  glDisable(GL_BLEND);
}

/* OpenGL's rows begin at the bottom. */
static void pixels_flip(view *v)
{
  const size_t row = 3 * (size_t)v->size[0];
  for (int i = 0; i < v->size[1] / 2; ++i) {
    uint8_t *a = v->pixels + row * (size_t)i;
    uint8_t *b = v->pixels + row * (size_t)(v->size[1] - 1 - i);
    for (size_t k = 0; k < row; ++k) {
      uint8_t kept = a[k];
      a[k] = b[k];
      b[k] = kept;
    }
  }
}

/* Into the surface with one sample a pixel, which is bound then. */
static void picture_draw(view *v, const view_frame *frame, const view_strips *strips,
                         const view_labels *labels)
{
  view_matrix sun_map;
  camera_place(v, frame, strips != NULL);
  const float texel = camera_sun(&v->camera, sun, v->surfaces.shadow_pixels, &sun_map);
  things_place(&v->things, frame, v->camera.size);
  glEnable(GL_DEPTH_TEST);
  glEnable(GL_CULL_FACE);
  shadow_draw(v, &sun_map);
  glBindFramebuffer(GL_FRAMEBUFFER, v->surfaces.many);
  glViewport(0, 0, v->size[0], v->size[1]);
  glClear(GL_DEPTH_BUFFER_BIT);
  glDepthFunc(GL_LESS);
  light_set(v, &sun_map, texel);
  world_draw(v);
  glBindFramebuffer(GL_READ_FRAMEBUFFER, v->surfaces.many);
  glBindFramebuffer(GL_DRAW_FRAMEBUFFER, v->surfaces.one);
  glBlitFramebuffer(0, 0, v->size[0], v->size[1], 0, 0, v->size[0], v->size[1], GL_COLOR_BUFFER_BIT,
                    GL_NEAREST);
  glBindFramebuffer(GL_FRAMEBUFFER, v->surfaces.one);
  text_draw(v, frame, strips, labels);
}

void view_show(view *v, const view_frame *frame, const view_strips *strips,
               const view_labels *labels)
{
  picture_draw(v, frame, strips, labels);
  glBindFramebuffer(GL_DRAW_FRAMEBUFFER, 0);
  glBlitFramebuffer(0, 0, v->size[0], v->size[1], 0, 0, v->size[0], v->size[1], GL_COLOR_BUFFER_BIT,
                    GL_NEAREST);
  glBindFramebuffer(GL_DRAW_FRAMEBUFFER, v->surfaces.one);
}

const uint8_t *view_draw(view *v, const view_frame *frame, const view_strips *strips,
                         const view_labels *labels)
{
  picture_draw(v, frame, strips, labels);
  glPixelStorei(GL_PACK_ALIGNMENT, 1);
  glReadPixels(0, 0, v->size[0], v->size[1], GL_RGB, GL_UNSIGNED_BYTE, v->pixels);
  pixels_flip(v);
  return v->pixels;
}

bool view_project(const view *v, const double point[3], double out_xy[2])
{
  const float *m = v->camera.look.at;
  float clip[4];
  for (int r = 0; r < 4; ++r) {
    clip[r] = m[r] * (float)point[0] + m[4 + r] * (float)point[1] + m[8 + r] * (float)point[2] +
              m[12 + r];
  }
  if (clip[3] <= 0.0F) {
    return false;
  }
  out_xy[0] = 0.5 * (1.0 + (double)(clip[0] / clip[3])) * v->size[0];
  out_xy[1] = 0.5 * (1.0 - (double)(clip[1] / clip[3])) * v->size[1];
  return true;
}

void view_ray(const view *v, const double xy[2], double out_eye[3], double out_way[3])
{
  const float *m = v->camera.back.at;
  const float x = 2.0F * (float)xy[0] / (float)v->size[0] - 1.0F;
  const float y = 1.0F - 2.0F * (float)xy[1] / (float)v->size[1];
  float way[3];
  for (int i = 0; i < 3; ++i) {
    way[i] = m[i] * x + m[4 + i] * y + m[12 + i];
  }
  view_normalize(way);
  for (int i = 0; i < 3; ++i) {
    out_eye[i] = (double)v->camera.eye[i];
    out_way[i] = (double)way[i];
  }
}

uint32_t view_pick(const view *v, const view_frame *frame, const double xy[2], double out_point[3])
{
  double eye[3];
  double way[3];
  double depth = 0.0;
  view_ray(v, xy, eye, way);
  uint32_t body = things_hit(&v->things, frame, eye, way, &depth);
  for (int i = 0; i < 3; ++i) {
    out_point[i] = eye[i] + depth * way[i];
  }
  return body;
}

bool view_slider_at(const view *v, const double xy[2], double *out_share)
{
  return slider_share(v->size, xy, out_share);
}

void view_arrow(const view *v, const view_pointer *pointer, double out_from[3], double out_to[3])
{
  float from[3];
  float to[3];
  (void)things_arrow(pointer, v->camera.size, from, to);
  for (int i = 0; i < 3; ++i) {
    out_from[i] = (double)from[i];
    out_to[i] = (double)to[i];
  }
}
