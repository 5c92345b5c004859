/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include <hapode/ode.h>

#include "base/alloc.h"
#include "base/log.h"
#include "scene/scene_internal.h"
#include "session/session_internal.h"

/* The life of a scene, and the numbers in it. */

hap_status hapi_scene_make(hap_scene **out, hap_detail *detail)
{
  *out = hapi_alloc(sizeof **out);
  if (*out == NULL) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for a scene");
  }
  dInitODE2(0);
  return HAP_OK;
}

void hapi_scene_geom_end(hapi_scene_geom *geom)
{
  if (geom->geom != NULL) {
    dGeomDestroy(geom->geom);
  }
  if (geom->mesh != NULL) {
    dGeomTriMeshDataDestroy(geom->mesh);
  }
  if (geom->field != NULL) {
    dGeomHeightfieldDataDestroy(geom->field);
  }
  hapi_free(geom->vertices);
  hapi_free(geom->triangles);
  hapi_free(geom->heights);
  memset(geom, 0, sizeof *geom);
}

hap_status hap_scene_destroy(hap_scene *scene)
{
  if (scene == NULL) {
    return HAP_OK;
  }
  if (scene->session != NULL) {
    return hapi_session_fail(scene->session, HAP_ERROR_STATE,
                             "the scene has this session still: destroy the session first");
  }
  for (uint32_t i = 0; i < scene->geom_count; ++i) {
    hapi_scene_geom_end(&scene->geoms[i]);
  }
  if (scene->end_world != NULL) {
    scene->end_world(scene);
  } else {
    dSpaceDestroy(scene->space);
    dWorldDestroy(scene->world);
  }
  hapi_free(scene->bodies);
  hapi_free(scene->geoms);
  hapi_free(scene->joints);
  hapi_free(scene->springs.of);
  hapi_free(scene->passes);
  hapi_free(scene);
  dCloseODE();
  return HAP_OK;
}

/* ---- numbers ---- */

hapi_scene_body *hapi_scene_body_at(const hap_scene *scene, uint32_t body)
{
  bool there = body < scene->body_count && scene->bodies[body].body != NULL;
  return there ? &scene->bodies[body] : NULL;
}

hapi_scene_geom *hapi_scene_geom_at(const hap_scene *scene, uint32_t geom)
{
  bool there = geom < scene->geom_count && scene->geoms[geom].geom != NULL;
  return there ? &scene->geoms[geom] : NULL;
}

hapi_scene_joint *hapi_scene_joint_at(const hap_scene *scene, uint32_t joint)
{
  bool there = joint < scene->joint_count && scene->joints[joint].joint != NULL;
  return there ? &scene->joints[joint] : NULL;
}

hap_status hapi_scene_may_edit(const hap_scene *scene, hap_detail *detail)
{
  if (scene->session == NULL || hapi_physics_may_edit(scene->session->physics)) {
    return HAP_OK;
  }
  (void)hapi_session_fail(scene->session, HAP_ERROR_THREAD,
                          "the scene's session runs: take hap_session_lock first, or do it in a "
                          "posted edit or a step function");
  return hapi_fail(detail, HAP_ERROR_THREAD, "%s", scene->session->detail.text);
}

/* By comparison alone: what is asked for may be gone. */
uint32_t hap_scene_find_geom(const hap_scene *scene, const void *geom)
{
  for (uint32_t i = 0; scene != NULL && geom != NULL && i < scene->geom_count; ++i) {
    if (scene->geoms[i].geom == geom) {
      return i;
    }
  }
  return HAP_SCENE_WORLD;
}

uint32_t hap_scene_find_body(const hap_scene *scene, const void *body)
{
  for (uint32_t i = 0; scene != NULL && body != NULL && i < scene->body_count; ++i) {
    if (scene->bodies[i].body == body) {
      return i;
    }
  }
  return HAP_SCENE_WORLD;
}
