/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include <hapode/ode.h>

#include "base/alloc.h"
#include "base/log.h"
#include "base/vec.h"
#include "scene/scene_internal.h"
#include "session/session_internal.h"

/* The life of a scene, and its session. */

#define ERP 0.2
#define CFM 1e-10    /* more shows in measured accelerances */
#define PUSH_OUT 0.5 /* m/s, of bodies that penetrate */

static const hap_scene_def scene_defaults = {
    .cookie = 0x48534345u,
    .gravity = {0.0, 0.0, -9.81},
    .iterations = 50,
    .layer = 1e-4,
};

static const hapi_def_type scene_def_type = HAPI_DEF_TYPE(hap_scene_def, scene_defaults);

void hap_scene_def_init(hap_scene_def *def, size_t size_of_def)
{
  hapi_def_init(&scene_def_type, def, size_of_def);
}

hap_status hap_scene_create(const hap_scene_def *given, hap_scene **out, hap_detail *detail)
{
  hap_scene_def def;
  if (out == NULL) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "out is NULL");
  }
  *out = NULL;
  HAPI_TRY(hapi_def_read_optional(&scene_def_type, given, &def, detail));
  const hapi_number_rule rules[] = {
      {"gravity[0]", def.gravity[0], -1e6, 1e6, NULL, 0.0},
      {"gravity[1]", def.gravity[1], -1e6, 1e6, NULL, 0.0},
      {"gravity[2]", def.gravity[2], -1e6, 1e6, NULL, 0.0},
      HAPI_RULE(&def, iterations, 1, 10000),
      HAPI_RULE(&def, layer, 0.0, 1.0),
  };
  HAPI_TRY(hapi_numbers_check(rules, sizeof rules / sizeof rules[0], detail));
  hap_scene *scene = NULL;
  HAPI_TRY(hapi_scene_make(&scene, detail));
  scene->world = dWorldCreate();
  scene->space = dHashSpaceCreate(NULL);
  dWorldSetGravity(scene->world, def.gravity[0], def.gravity[1], def.gravity[2]);
  dWorldSetERP(scene->world, ERP);
  dWorldSetCFM(scene->world, CFM);
  dWorldSetQuickStepNumIterations(scene->world, def.iterations);
  dWorldSetContactMaxCorrectingVel(scene->world, PUSH_OUT);
  dWorldSetContactSurfaceLayer(scene->world, def.layer);
  dWorldSetAutoDisableFlag(scene->world, 0);
  *out = scene;
  return HAP_OK;
}

/* ---- the session ---- */

static const hapi_scene_geom *geom_of(const hap_scene *scene, dGeomID geom)
{
  uintptr_t number = (uintptr_t)dGeomGetData(geom); /* plus one */
  return number > 0 && number <= scene->geom_count ? &scene->geoms[number - 1] : NULL;
}

static bool surface_of(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  const hap_scene *scene = user;
  const hapi_scene_geom *of_a = geom_of(scene, a);
  const hapi_scene_geom *of_b = geom_of(scene, b);
  dBodyID body_a = dGeomGetBody(a);
  dBodyID body_b = dGeomGetBody(b);
  if (of_a == NULL || of_b == NULL || body_a == body_b ||
      (body_a != NULL && body_b != NULL &&
       dAreConnectedExcluding(body_a, body_b, dJointTypeContact)) ||
      hapi_scene_passes(scene, body_a, body_b)) {
    return false;
  }
  io->mode = dContactApprox1;
  io->mu =
      of_a->friction == of_b->friction ? of_a->friction : sqrt(of_a->friction * of_b->friction);
  if (of_a->bounce > 0.0 || of_b->bounce > 0.0) {
    io->mode |= dContactBounce;
    io->bounce = fmax(of_a->bounce, of_b->bounce);
    io->bounce_vel = 0.01;
  }
  return true;
}

static void step_before(void *user, double step_s)
{
  hap_scene *scene = user;
  scene->before(scene->user, step_s);
}

static void step_after(void *user, double step_s)
{
  hap_scene *scene = user;
  scene->after(scene->user, step_s);
}

hap_status hap_scene_set_steps(hap_scene *scene, hap_scene_step_fn before, hap_scene_step_fn after,
                               void *user)
{
  if (scene == NULL) {
    return HAP_ERROR_ARGUMENT;
  }
  if (scene->session != NULL) {
    return hapi_session_fail(scene->session, HAP_ERROR_STATE,
                             "step functions are set before the session is created");
  }
  scene->before = before;
  scene->after = after;
  scene->user = user;
  return HAP_OK;
}

/* A geom that the scene does not have feels as the pointer says. */
static void surface_felt(void *user, hap_pointer_id pointer, dGeomID geom, hap_surface *io)
{
  hap_scene *scene = user;
  uintptr_t number = (uintptr_t)dGeomGetData(geom); /* plus one */
  if (geom_of(scene, geom) != NULL) {
    scene->surface(scene->surface_user, (uint32_t)(number - 1), pointer, io);
  }
}

hap_status hap_scene_set_surface(hap_scene *scene, hap_scene_surface_fn surface,
                                 double magnet_reach, void *user)
{
  if (scene == NULL || !(magnet_reach >= 0.0 && magnet_reach <= 0.1)) {
    return HAP_ERROR_ARGUMENT;
  }
  if (scene->session != NULL) {
    return hapi_session_fail(scene->session, HAP_ERROR_STATE,
                             "the surface function is set before the session is created");
  }
  scene->surface = surface;
  scene->magnet_reach = magnet_reach;
  scene->surface_user = user;
  return HAP_OK;
}

static void session_gone(void *arg)
{
  hap_scene *scene = arg;
  scene->session = NULL;
}

/* A body without geoms is known by nothing else, unless a joint ties it to one that has some. */
static hap_status geomless_adopt(const hap_scene *scene, hap_session *session)
{
  for (uint32_t i = 0; i < scene->body_count; ++i) {
    dBodyID body = scene->bodies[i].body;
    if (body != NULL && dBodyGetFirstGeom(body) == NULL) {
      HAPI_TRY(hap_session_adopt_body(session, body));
    }
  }
  return HAP_OK;
}

/* Bodies that were removed have no place. */
static hap_status first_trace(const hap_scene *scene, hap_session *session)
{
  dBodyID bodies[HAP_TRACE_BODIES_MAX];
  size_t count = 0;
  for (uint32_t i = 0; i < scene->body_count && count < HAP_TRACE_BODIES_MAX; ++i) {
    if (scene->bodies[i].body != NULL) {
      bodies[count++] = scene->bodies[i].body;
    }
  }
  return hap_session_trace_bodies(session, bodies, count);
}

hap_status hap_scene_session(hap_scene *scene, const hap_session_def *def, hap_session **out,
                             hap_detail *detail)
{
  hap_ode_def ode;
  if (scene == NULL || out == NULL) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "%s is NULL", scene == NULL ? "scene" : "out");
  }
  hap_ode_def_init(&ode, sizeof ode);
  ode.world = scene->world;
  ode.space = scene->space;
  ode.surface = surface_of;
  ode.before_step = scene->before != NULL ? step_before : NULL;
  ode.after_step = scene->after != NULL ? step_after : NULL;
  ode.pointer_surface = scene->surface != NULL ? surface_felt : NULL;
  ode.magnet_reach = scene->magnet_reach;
  ode.user = scene;
  HAPI_TRY(hap_session_create(def, &ode, out, detail));
  hap_status status = geomless_adopt(scene, *out);
  status = status >= HAP_OK ? first_trace(scene, *out) : status;
  if (status < HAP_OK) {
    (void)hap_session_detail(*out, detail);
    hap_session_destroy(*out);
    *out = NULL;
    return status;
  }
  hapi_physics_set_springs((*out)->physics, &scene->springs);
  scene->session = *out;
  (*out)->gone = (hapi_session_gone){session_gone, scene};
  return HAP_OK;
}

hap_status hap_scene_poses(hap_scene *scene, int64_t time_ns, uint32_t first, size_t count,
                           hap_pose *out)
{
  enum {
    AT_ONCE = 64
  };
  hap_status worst = HAP_OK;
  if (scene == NULL || (count > 0 && out == NULL)) {
    return HAP_ERROR_ARGUMENT;
  }
  if (scene->session == NULL) {
    return HAP_ERROR_STATE;
  }
  if (first > scene->body_count || count > scene->body_count - first) {
    return hapi_session_fail(scene->session, HAP_ERROR_NOT_FOUND,
                             "bodies %u to %llu of %u: so many were never made", first,
                             (unsigned long long)first + count - 1, scene->body_count);
  }
  for (size_t begin = 0; begin < count;) {
    dBodyID bodies[AT_ONCE];
    hap_pose poses[AT_ONCE];
    size_t numbers[AT_ONCE];
    size_t used = 0;
    for (; begin < count && used < AT_ONCE; ++begin) {
      dBodyID body = scene->bodies[first + begin].body;
      if (body != NULL) {
        bodies[used] = body;
        numbers[used++] = begin;
      }
    }
    hap_status status = hap_session_poses(scene->session, time_ns, bodies, used, poses);
    if (status < HAP_OK) {
      return status;
    }
    worst = status != HAP_OK ? status : worst;
    for (size_t i = 0; i < used; ++i) {
      const double *centre = scene->bodies[first + numbers[i]].centre;
      hap_pose *to = &out[numbers[i]];
      double off[3];
      *to = poses[i];
      hapi_quat_rotate(to->quat_wxyz, centre, off);
      hapi_v3_sub(to->position, off, to->position);
    }
  }
  return worst;
}
