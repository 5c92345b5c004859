/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* What a frame of the viewer must not cost: memory, and a call for each body. The program has a
 * malloc of its own, which counts the calls that come from its own code; the driver's are the
 * driver's. */

#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include <epoxy/gl.h>

#include <hapode/scene.h>

#include "tests/tap.h"
#include "view/view.h"

#if TAP_ADDRESS_SANITIZER || TAP_THREAD_SANITIZER
#define OWN_MALLOC 0
#else
#define OWN_MALLOC 1
#endif

static _Atomic unsigned own_calls;

#if OWN_MALLOC
extern void *__libc_malloc(size_t size);
extern void *__libc_calloc(size_t count, size_t size);
extern void *__libc_realloc(void *old, size_t size);
extern char __executable_start;
extern char etext;

static void caller_count(const void *caller)
{
  const char *at = caller;
  if (at >= &__executable_start && at < &etext) {
    ++own_calls;
  }
}

void *malloc(size_t size)
{
  caller_count(__builtin_return_address(0));
  return __libc_malloc(size);
}

void *calloc(size_t count, size_t size)
{
  caller_count(__builtin_return_address(0));
  return __libc_calloc(count, size);
}

void *realloc(void *old, size_t size)
{
  caller_count(__builtin_return_address(0));
  return __libc_realloc(old, size);
}
#endif

/* A pile that stands in front of the view. */
typedef struct gallery {
  view *view;
  hap_scene *scene;
  view_frame frame;
  view_strips strips;
  view_labels labels;
} gallery;

static void gallery_finish(void *owned)
{
  gallery *g = owned;
  view_destroy(g->view);
  (void)hap_scene_destroy(g->scene);
  free(g->frame.bodies);
  free(g->frame.roles);
}

static gallery *gallery_make(const char *spec)
{
  hap_detail why = {""};
  hap_scene_counts counts = {0};
  gallery *g = tap_own(sizeof *g, gallery_finish);
  hap_status status = view_create(640, 360, &g->view, &why);
  if (status == HAP_ERROR_UNSUPPORTED) {
    SKIP("%s", why.text);
  }
  REQUIRE(status == HAP_OK);
  REQUIRE(hap_scene_load(spec, &g->scene, &why) == HAP_OK);
  REQUIRE(view_take_scene(g->view, g->scene, &why) == HAP_OK);
  REQUIRE(hap_scene_count(g->scene, &counts, sizeof counts) == HAP_OK);
  g->frame.body_count = counts.bodies;
  g->frame.bodies = calloc(counts.bodies, sizeof *g->frame.bodies);
  g->frame.roles = calloc(counts.bodies, sizeof *g->frame.roles);
  REQUIRE(g->frame.bodies != NULL && g->frame.roles != NULL);
  for (uint32_t i = 0; i < counts.bodies; ++i) {
    hap_scene_body body;
    REQUIRE(hap_scene_get_body(g->scene, i, &body, sizeof body) == HAP_OK);
    g->frame.bodies[i] = body.pose;
    g->frame.roles[i] = (hap_body_role)(i % 6);
  }
  view_strips_init(&g->strips, 1.0);
  return g;
}

/* Frame k: more of everything from frame to frame. */
static void gallery_draw(gallery *g, int k)
{
  view_frame *f = &g->frame;
  f->t = 0.1 * k;
  f->pointer_count = 1 + (size_t)k % 2;
  f->touch_count = (size_t)k % 8;
  for (size_t i = 0; i < f->pointer_count; ++i) {
    view_pointer *p = &f->pointers[i];
    *p = (view_pointer){.proxy = f->bodies[0], .device = f->bodies[0], .radius = 0.01};
    p->device.position[0] -= 0.02;
    p->force[0] = -3.0 * k;
    p->is_pulled = true;
  }
  for (size_t i = 0; i < f->touch_count; ++i) {
    f->touches[i].normal[2] = 1.0;
  }
  f->bodies[1].position[2] += 0.01;
  view_strips_add(&g->strips, f->t, 2.0 * k, 20.0);
  snprintf(g->labels.title, sizeof g->labels.title, "frame %d", k);
  g->labels.panels[0].row_count = (size_t)k;
  g->labels.has_slider = k % 2 == 0;
  REQUIRE(view_draw(g->view, f, &g->strips, &g->labels) != NULL);
}

TEST(a_frame_takes_no_memory)
{
  if (!OWN_MALLOC) {
    SKIP("the sanitizer has the program's malloc");
  }
  gallery *g = gallery_make("pile:80");
  own_calls = 0;
  void *volatile own = malloc(10);
  CHECK(own_calls == 1); /* it counts */
  free(own);
  gallery_draw(g, 1);
  own_calls = 0;
  for (int k = 2; k < 14; ++k) {
    gallery_draw(g, k);
  }
  CHECK_SAY(own_calls == 0, "%u calls", own_calls);
}

static PFNGLDRAWELEMENTSINSTANCEDPROC real_draw;
static int draw_calls;
static int draw_instances;

static void draw_count(GLenum mode, GLsizei count, GLenum type, const void *indices,
                       GLsizei instances)
{
  ++draw_calls;
  draw_instances += instances;
  real_draw(mode, count, type, indices, instances);
}

TEST(a_thousand_bodies_are_as_many_calls_as_ten)
{
  static const char *const specs[] = {"pile:10", "pile:1000"};
  int calls[2];
  int instances[2];
  for (int i = 0; i < 2; ++i) {
    gallery *g = gallery_make(specs[i]);
    gallery_draw(g, 1);
    real_draw = epoxy_glDrawElementsInstanced;
    epoxy_glDrawElementsInstanced = draw_count;
    draw_calls = draw_instances = 0;
    gallery_draw(g, 1);
    epoxy_glDrawElementsInstanced = real_draw;
    calls[i] = draw_calls;
    instances[i] = draw_instances;
    tap_release(g);
  }
  CHECK_SAY(calls[0] == calls[1], "%d and %d", calls[0], calls[1]);
  CHECK_SAY(instances[1] - instances[0] >= 2 * 990, "%d and %d", instances[0], instances[1]);
}
