/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "base/alloc.h"
#include "base/log.h"
#include "scene/scene_internal.h"

/* Pairs of bodies that pass through each other, in rising order. */

/* The first one that is not before it. */
static uint32_t pass_place(const hap_scene *scene, hapi_scene_pass pair)
{
  uint32_t low = 0;
  uint32_t high = scene->pass_count;
  while (low < high) {
    uint32_t middle = low + (high - low) / 2;
    const hapi_scene_pass *at = &scene->passes[middle];
    if (at->a < pair.a || (at->a == pair.a && at->b < pair.b)) {
      low = middle + 1;
    } else {
      high = middle;
    }
  }
  return low;
}

static bool pass_is_at(const hap_scene *scene, uint32_t place, hapi_scene_pass pair)
{
  return place < scene->pass_count && scene->passes[place].a == pair.a &&
         scene->passes[place].b == pair.b;
}

static hapi_scene_pass pass_of(uint32_t a, uint32_t b)
{
  return a < b ? (hapi_scene_pass){a, b} : (hapi_scene_pass){b, a};
}

bool hapi_scene_passes(const hap_scene *scene, dBodyID a, dBodyID b)
{
  if (scene->pass_count == 0 || a == NULL || b == NULL) {
    return false;
  }
  uintptr_t of_a = (uintptr_t)dBodyGetData(a); /* plus one */
  uintptr_t of_b = (uintptr_t)dBodyGetData(b);
  if (of_a == 0 || of_b == 0 || of_a > scene->body_count || of_b > scene->body_count) {
    return false;
  }
  hapi_scene_pass pair = pass_of((uint32_t)of_a - 1, (uint32_t)of_b - 1);
  return pass_is_at(scene, pass_place(scene, pair), pair);
}

hap_status hap_scene_let_pass(hap_scene *scene, uint32_t body_a, uint32_t body_b,
                              hap_detail *detail)
{
  if (scene == NULL) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "scene is NULL");
  }
  const bool has_a = hapi_scene_body_at(scene, body_a) != NULL;
  if (!has_a || hapi_scene_body_at(scene, body_b) == NULL) {
    return hapi_fail(detail, HAP_ERROR_NOT_FOUND, "body_%c: there is no body of that number",
                     has_a ? 'b' : 'a');
  }
  if (body_a == body_b) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "body_a and body_b are the same");
  }
  if (scene->built_in != NULL) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "the scene is a built-in one");
  }
  HAPI_TRY(hapi_scene_may_edit(scene, detail));
  hapi_scene_pass pair = pass_of(body_a, body_b);
  uint32_t place = pass_place(scene, pair);
  if (pass_is_at(scene, place, pair)) {
    return HAP_OK;
  }
  if (!hapi_reserve((void **)&scene->passes, &scene->pass_capacity, scene->pass_count, 1,
                    sizeof *scene->passes)) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for a pair that passes");
  }
  memmove(&scene->passes[place + 1], &scene->passes[place],
          (scene->pass_count - place) * sizeof *scene->passes);
  scene->passes[place] = pair;
  ++scene->pass_count;
  return HAP_OK;
}
