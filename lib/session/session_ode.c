/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include <hapode/ode.h>

#include "base/alloc.h"
#include "base/log.h"
#include "base/plausible.h"
#include "session/session_internal.h"
#include "world/contact_call.h"

/* What is kept of the last ticks for drawing: as long as poses.c may lie behind and more, in rows
 * of at most 16 MB, which are some ticks apart where that is not enough for all. */
#define TRAIL_STEPS 8.0
#define TRAIL_ROWS_MOST 256u
#define TRAIL_ROWS_LEAST 64u
#define TRAIL_PLACES 262144u
#define TRAIL_SPARE 16u

/* What of the session has ODE types: create. The other calls of hapode/ode.h end in
 * lib/physics/adopt.c, through the session's physics. */

static const hap_ode_def ode_defaults = {
    .cookie = 0x484f4431u, .max_contacts_per_pair = 8, .island_threads = 1};
static const hapi_def_type ode_type = HAPI_DEF_TYPE(hap_ode_def, ode_defaults);

void hap_ode_def_init(hap_ode_def *def, size_t size_of_def)
{
  hapi_def_init(&ode_type, def, size_of_def);
}

static hap_status ode_check(const hap_ode_def *def, hap_detail *detail)
{
  const hapi_number_rule rules[] = {
      HAPI_RULE(def, max_contacts_per_pair, 1, 64),
      HAPI_RULE(def, magnet_reach, 0.0, 0.1),
      HAPI_RULE(def, island_threads, 0, 64),
  };
  if (def->world == NULL || def->space == NULL) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "%s is NULL",
                     def->world == NULL ? "world" : "space");
  }
  if (dCheckConfiguration("ODE_double_precision") == 0) {
    return hapi_fail(detail, HAP_ERROR_UNSUPPORTED, "the ODE library loaded is single precision");
  }
  return hapi_numbers_check(rules, sizeof rules / sizeof rules[0], detail);
}

static void world_report(void *user, hap_fault fault, const char *text)
{
  hap_session *session = user;
  if (fault != HAP_FAULT_NONE) {
    hapi_haptic_fault(session->haptic, fault);
  }
  (void)hapi_session_fail(session, HAP_ERROR_WORLD, "%s", text);
}

static hap_status create_physics(hap_session *session, const hap_ode_def *ode,
                                 const hapi_capacity *capacity, hap_detail *detail)
{
  const hap_session_def *def = &session->def;
  hapi_physics_config config = {
      .capacity = *capacity,
      .max_bodies = (uint32_t)def->max_bodies,
      .substeps = (uint32_t)def->expert->substeps,
      .model = def->model,
      .impulse_pose = def->research->impulse_pose,
      .knobs = {.contact_hz = def->expert->contact_hz,
                .probe = def->research->probe,
                .max_sweeps = def->expert->max_sweeps,
                .range_hops = def->expert->range_hops,
                .iterations = def->expert->iterations,
                .reuse = def->expert->reuse},
      .accuracy = def->accuracy,
      .force_error_wanted = def->expert->force_error_wanted,
      .tick_share = hapi_session_share(def, def->expert->tick_share),
      .physics_share = hapi_session_share(def, def->expert->physics_share),
      .effects = hapi_session_pack_effects(def->expert),
      .physics_hz = def->physics_hz,
      .look_ahead_s = def->expert->look_ahead,
      .lookback_share = def->expert->lookback,
      .haptic_hz = def->haptic_hz,
      .lockstep = def->drive == HAP_DRIVE_LOCKSTEP,
      .frame = def->drive == HAP_DRIVE_FRAME,
      .rt_priority = def->rt_priority,
      .exchange = session->exchange,
      .textures = session->textures,
      .report = world_report,
      .user = session,
  };
  hap_status status = hapi_physics_create(&config, ode, &session->physics, detail);
  if (status >= HAP_OK && def->drive == HAP_DRIVE_LOCKSTEP &&
      def->research->physics_latency_ticks >= 0) {
    hapi_physics_set_latency(session->physics,
                             (double)def->research->physics_latency_ticks / def->haptic_hz);
  }
  return status;
}

static hap_status create_contact(hap_session *session, const hapi_capacity *capacity,
                                 hap_detail *detail)
{
  const hapi_contact_caller *caller = hapi_physics_caller(session->physics);
  const hapi_contact_config config = {
      .capacity = *capacity,
      .haptic_hz = session->def.haptic_hz,
      .rt_priority = session->def.rt_priority,
      .exchange = session->exchange,
      .ask = caller->call != NULL ? hapi_contact_call : NULL,
      .ask_of = caller,
  };
  return hapi_contact_create(&config, &session->contact) >= HAP_OK
             ? HAP_OK
             : hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for the contact thread");
}

#define TRIANGLES 2048u  /* near all pointers that are spheres */
#define TOOL_POINTS 256u /* of all pointers that are hulls: a few dozen touches */
#define FEELS 128u       /* geoms with a surface of their own, near pointers */

/* At a low rate of physics a body in a pile is near thirty others, and touches eight. */
#define PAIRS_PER_CONTACT 3u

/* Slots for the range, as many again for what stands around it, and some for those that have left
 * and that the loop has not let go of. Geoms: a few a body. Joints: a chain has one a body, a truss
 * two. */
static hapi_capacity capacity_of(const hap_session_def *def, const hap_ode_def *ode)
{
  bool looks_back = def->expert->lookback > 0.0;
  hapi_capacity capacity = {
      .bodies = 2 * (uint32_t)def->max_bodies + 16,
      .contacts = (uint32_t)def->max_contacts,
      .pairs = PAIRS_PER_CONTACT * (uint32_t)def->max_contacts,
      .pointers = (uint32_t)def->max_pointers,
      .geoms = 8 * (uint32_t)def->max_bodies + 1024,
      .hull_points = (uint32_t)def->expert->max_hull_points,
      .trail_rows = TRAIL_ROWS_MOST,
      .joints = 2 * (uint32_t)def->max_bodies + 16,
      .tool_points = TOOL_POINTS,
      .path_rows = looks_back ? (uint32_t)(4.0 * def->haptic_hz / def->physics_hz) + 64 : 0,
      .springs = looks_back ? (uint32_t)def->max_contacts + 2 * TOOL_POINTS : 0,
      .crosses = 8 * (uint32_t)def->max_bodies,
      .triangles = TRIANGLES,
      .feels = FEELS,
      .saids = ode->contact != NULL ? PAIRS_PER_CONTACT * (uint32_t)def->max_contacts : 0,
  };
  while (capacity.trail_rows > TRAIL_ROWS_LEAST &&
         capacity.trail_rows * capacity.bodies > TRAIL_PLACES) {
    capacity.trail_rows /= 2;
  }
  double ticks = TRAIL_STEPS * def->haptic_hz / def->physics_hz;
  capacity.trail_stride = (uint32_t)ceil(ticks / (double)(capacity.trail_rows - TRAIL_SPARE));
  return capacity;
}

static hap_status create_parts(hap_session *session, const hap_ode_def *ode, hap_detail *detail)
{
  const hap_session_def *def = &session->def;
  hapi_capacity capacity = capacity_of(def, ode);
  session->textures = hapi_textures_create();
  hap_status status = session->textures != NULL
                          ? hapi_exchange_create(&capacity, &session->exchange)
                          : HAP_ERROR_MEMORY;
  if (status >= HAP_OK) {
    hapi_haptic_config config = {
        .capacity = capacity,
        .haptic_hz = def->haptic_hz,
        .lockstep = def->drive == HAP_DRIVE_LOCKSTEP,
        .rt_priority = def->rt_priority,
        .trace_rows = (uint32_t)def->expert->trace_rows,
        .guard = def->research->guard,
        .exchange = session->exchange,
        .textures = session->textures,
    };
    status = hapi_haptic_create(&config, &session->haptic);
  }
  if (status < HAP_OK) {
    return hapi_fail(detail, status, "no memory for a session of %d bodies and %d contacts",
                     def->max_bodies, def->max_contacts);
  }
  HAPI_TRY(create_physics(session, ode, &capacity, detail));
  return create_contact(session, &capacity, detail);
}

static hap_status session_init(hap_session *session, const hap_session_def *def,
                               const hap_ode_def *ode, hap_detail *detail)
{
  hap_ode_def checked_ode;
  HAPI_TRY(hapi_session_read_def(def, session, detail));
  HAPI_TRY(hapi_def_read(&ode_type, ode, &checked_ode, detail));
  HAPI_TRY(ode_check(&checked_ode, detail));
  return create_parts(session, &checked_ode, detail);
}

hap_status hap_session_create(const hap_session_def *def, const hap_ode_def *ode, hap_session **out,
                              hap_detail *detail)
{
  if (out == NULL) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "out is NULL");
  }
  *out = NULL;
  hap_session *session = hapi_alloc(sizeof *session);
  if (session == NULL) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for a session");
  }
  pthread_mutex_init(&session->detail_lock, NULL);
  hap_status status = session_init(session, def, ode, detail);
  if (status < HAP_OK) {
    hapi_session_free(session);
    return status;
  }
  *out = session;
  return HAP_OK;
}

/* ---- the application's bodies ---- */

static hap_status may_edit(hap_session *session, const void *object)
{
  if (session == NULL || object == NULL) {
    return hapi_session_say(session, HAP_ERROR_ARGUMENT, __func__);
  }
  if (!hapi_physics_may_edit(session->physics)) {
    return hapi_session_fail(session, HAP_ERROR_THREAD, "%s",
                             hapi_physics_in_callback(session->physics)
                                 ? "not in a surface, direction or moved callback: post an edit, "
                                   "or do it in before_step or after_step"
                                 : "take hap_session_lock first, or do it in a posted edit");
  }
  return HAP_OK;
}

hap_status hap_session_adopt_body(hap_session *session, dBodyID body)
{
  HAPI_TRY(may_edit(session, body));
  return hapi_session_say(session, hapi_physics_adopt(session->physics, body), __func__);
}

hap_status hap_session_forget_body(hap_session *session, dBodyID body)
{
  HAPI_TRY(may_edit(session, body));
  return hapi_session_say(session, hapi_physics_forget(session->physics, body), __func__);
}

hap_status hap_session_teleport_body(hap_session *session, dBodyID body, const hap_pose *pose)
{
  HAPI_TRY(may_edit(session, body));
  if (pose == NULL || !hapi_plausible_pose(pose)) {
    return hapi_session_fail(session, HAP_ERROR_ARGUMENT,
                             "the pose is NULL, its position is not finite or beyond 1000 km, or "
                             "its quaternion is not unit; the body stays where it was");
  }
  return hapi_session_say(session, hapi_physics_teleport(session->physics, body, pose), __func__);
}

hap_status hap_session_forget_geom(hap_session *session, dGeomID geom)
{
  HAPI_TRY(may_edit(session, geom));
  hapi_physics_forget_geom(session->physics, geom);
  return HAP_OK;
}

hap_status hap_session_add_space(hap_session *session, dSpaceID space, uint32_t pairs)
{
  const uint32_t known = HAP_SPACE_INSIDE | HAP_SPACE_OTHERS;
  HAPI_TRY(may_edit(session, space));
  if (!dGeomIsSpace((dGeomID)space) || pairs == 0 || (pairs & ~known) != 0) {
    return hapi_session_fail(
        session, HAP_ERROR_ARGUMENT,
        "it is no space, or pairs is %u: HAP_SPACE_INSIDE, HAP_SPACE_OTHERS or "
        "both",
        (unsigned)pairs);
  }
  hap_status status = hapi_physics_add_space(session->physics, space, pairs);
  switch (status) {
    case HAP_ERROR_STATE:
      return hapi_session_fail(session, status,
                               "the space already has a session: this one, or another one");
    case HAP_ERROR_ARGUMENT:
      return hapi_session_fail(session, status,
                               "the space is inside another one, or the first space is inside it: "
                               "add the outermost space alone");
    case HAP_ERROR_CAPACITY:
      return hapi_session_fail(session, status, "%d spaces were added already", HAP_SPACES_MAX);
    default:
      return hapi_session_say(session, status, __func__);
  }
}

hap_status hap_session_remove_space(hap_session *session, dSpaceID space)
{
  HAPI_TRY(may_edit(session, space));
  hap_status status = hapi_physics_remove_space(session->physics, space);
  return status == HAP_ERROR_NOT_FOUND
             ? hapi_session_fail(session, status,
                                 "the space was not added, it was destroyed, or it is the first "
                                 "one of the session, which stays")
             : hapi_session_say(session, status, __func__);
}

hap_status hap_session_surface_changed(hap_session *session, dGeomID geom)
{
  HAPI_TRY(may_edit(session, session));
  hapi_physics_surface_changed(session->physics, geom);
  return HAP_OK;
}

hap_status hap_session_set_moved_callback(hap_session *session, dBodyID body,
                                          void (*callback)(dBodyID))
{
  HAPI_TRY(may_edit(session, body));
  return hapi_session_say(
      session, hapi_physics_set_moved_callback(session->physics, body, callback), __func__);
}

/* Of a call for count bodies that returned status. */
static hap_status say_who_is_unknown(hap_session *session, hap_status status, size_t unknown,
                                     size_t count, const char *function)
{
  if (status != HAP_ERROR_NOT_FOUND) {
    return hapi_session_say(session, status, function);
  }
  return hapi_session_fail(
      session, status,
      "%s: bodies[%zu] of %zu is not known to the session: it was destroyed or "
      "forgotten, the session has not started, or it has neither geom nor "
      "joint and was not adopted (hap_session_adopt_body)",
      function, unknown, count);
}

hap_status hap_session_poses(hap_session *session, int64_t time_ns, const dBodyID *bodies,
                             size_t count, hap_pose *out)
{
  size_t unknown = 0;
  if (session == NULL || (count > 0 && (bodies == NULL || out == NULL))) {
    return hapi_session_say(session, HAP_ERROR_ARGUMENT, __func__);
  }
  hap_status status = hapi_physics_poses(session->physics, time_ns, bodies, count, out, &unknown);
  return say_who_is_unknown(session, status, unknown, count, __func__);
}

hap_status hap_session_poses_now(hap_session *session, const dBodyID *bodies, size_t count,
                                 hap_pose *out)
{
  size_t unknown = 0;
  if (session == NULL || (count > 0 && (bodies == NULL || out == NULL))) {
    return hapi_session_say(session, HAP_ERROR_ARGUMENT, __func__);
  }
  hap_status status = hapi_physics_poses_now(session->physics, bodies, count, out, &unknown);
  return say_who_is_unknown(session, status, unknown, count, __func__);
}

hap_status hap_session_roles(hap_session *session, const dBodyID *bodies, size_t count,
                             hap_body_role *out)
{
  size_t unknown = 0;
  if (session == NULL || (count > 0 && (bodies == NULL || out == NULL))) {
    return hapi_session_say(session, HAP_ERROR_ARGUMENT, __func__);
  }
  hap_status status = hapi_physics_roles(session->physics, bodies, count, out, &unknown);
  return say_who_is_unknown(session, status, unknown, count, __func__);
}

hap_status hap_session_trace_bodies(hap_session *session, const dBodyID *bodies, size_t count)
{
  HAPI_TRY(may_edit(session, bodies));
  return hapi_session_say(session, hapi_physics_trace_bodies(session->physics, bodies, count),
                          __func__);
}
