/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/run_frame.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/pointer_id.h"
#include "base/vec.h"
#include "scene/scene_internal.h"
#include "tools/run_summary.h"

bool run_frame_reserve(view_frame *out, size_t bodies)
{
  out->bodies = calloc(bodies + 1, sizeof *out->bodies);
  out->roles = calloc(bodies + 1, sizeof *out->roles);
  out->body_count = bodies;
  return out->bodies != NULL && out->roles != NULL;
}

void run_frame_free(view_frame *of)
{
  free(of->bodies);
  free(of->roles);
  of->bodies = NULL;
  of->roles = NULL;
}

void run_frame_copy(const view_frame *from, view_frame *to)
{
  hap_pose *bodies = to->bodies;
  hap_body_role *roles = to->roles;
  memcpy(bodies, from->bodies, from->body_count * sizeof *bodies);
  memcpy(roles, from->roles, from->body_count * sizeof *roles);
  *to = *from;
  to->bodies = bodies;
  to->roles = roles;
}

void run_frame_pointers(const run_options *options, const hap_scene *from, view_frame *io)
{
  const scene_parameters *given = options->rig.parameters;
  for (size_t i = 0; i < VIEW_POINTERS_MAX; ++i) {
    view_pointer *p = &io->pointers[i];
    hap_pointer_def def;
    const char *spec;
    hap_pointer_def_init(&def, sizeof def);
    def.radius = given != NULL ? given->radius : def.radius;
    if (given == NULL && hap_scene_hand(from, (uint32_t)i, &def, &spec) < HAP_OK) {
      (void)hap_scene_hand(from, 0, &def, &spec);
    }
    p->radius = def.radius;
    for (size_t k = 0; k < 3 * def.hull_points; ++k) {
      p->half_edges[k % 3] = fmax(p->half_edges[k % 3], fabs(def.hull_xyz[k]));
    }
  }
}

void run_frame_labels(const run_options *options, view_labels *out)
{
  char devices[80];
  run_summary_devices(&options->rig, devices, sizeof devices);
  const char *slash = strrchr(options->rig.scene, '/'); /* of a file its name alone */
  snprintf(out->title, sizeof out->title, "%.90s", slash != NULL ? slash + 1 : options->rig.scene);
  snprintf(out->subtitle, sizeof out->subtitle, "model %s, physics %g Hz, haptic %g Hz, %.*s",
           hap_model_name(options->rig.def.model), run_summary_physics_hz(options),
           options->rig.def.haptic_hz, (int)strcspn(devices, ":"), devices);
}

/* A pointer whose name nobody knows, of a recording: what the trace has of it. */
static void pointer_from_row(const hap_trace_pointer *from, view_pointer *out)
{
  static const double straight[4] = {1.0, 0.0, 0.0, 0.0};
  memcpy(out->proxy.position, from->position, sizeof from->position);
  memcpy(out->proxy.quat_wxyz, straight, sizeof straight);
  out->device = out->proxy;
  memcpy(out->force, from->force, sizeof from->force);
}

/* A replay has the pointers of its recording, and nobody was told their names: of the first
 * generation, as a run that is not edited has them. v 0: it is not there. */
static hap_pointer_id pointer_replayed(hap_session *session, size_t index)
{
  const hap_pointer_id id = {hapi_pointer_id_of(1, (uint32_t)index + 1)};
  hap_pointer_state state;
  return hap_pointer_get(session, id, &state, sizeof state) >= HAP_OK ? id : (hap_pointer_id){0};
}

/* The device is as far from the pointer as the newest drawn poses have it. */
static void pointer_read(hap_session *session, hap_pointer_id id, view_pointer *out)
{
  hap_pointer_state state;
  hap_pose proxy;
  hap_pose device;
  if (hap_pointer_get(session, id, &state, sizeof state) < HAP_OK) {
    return;
  }
  out->proxy = out->device = state.proxy;
  memcpy(out->force, state.wrench.force, sizeof out->force);
  if (hap_pointer_poses(session, id, hap_session_now(session), &proxy, &device) >= HAP_OK) {
    for (int i = 0; i < 3; ++i) {
      out->device.position[i] += device.position[i] - proxy.position[i];
    }
    memcpy(out->device.quat_wxyz, device.quat_wxyz, sizeof device.quat_wxyz);
  }
}

static void touches_read(hap_session *session, hap_pointer_id id, view_frame *io)
{
  hap_touch touches[VIEW_TOUCHES_MAX];
  size_t count = 0;
  if (hap_pointer_touches(session, id, touches, VIEW_TOUCHES_MAX, sizeof touches[0], &count) !=
      HAP_OK) {
    return;
  }
  for (size_t i = 0; i < count && io->touch_count < VIEW_TOUCHES_MAX; ++i) {
    view_touch *t = &io->touches[io->touch_count++];
    memcpy(t->point, touches[i].point, sizeof t->point);
    memcpy(t->normal, touches[i].normal, sizeof t->normal);
  }
}

/* The frame of a body of a scene may be beside its centre of mass. */
static void bodies_read(const run_frame_source *from, view_frame *io)
{
  const rig *r = from->rig;
  (void)hap_session_poses_now(r->session, r->scene->bodies, io->body_count, io->bodies);
  (void)hap_session_roles(r->session, r->scene->bodies, io->body_count, io->roles);
  for (size_t i = 0; i < io->body_count && i < from->scene->body_count; ++i) {
    double off[3];
    hap_pose *pose = &io->bodies[i];
    hapi_quat_rotate(pose->quat_wxyz, from->scene->bodies[i].centre, off);
    hapi_v3_sub(pose->position, off, pose->position);
  }
}

void run_frame_read(const run_frame_source *from, double t, view_frame *io)
{
  const rig *r = from->rig;
  hap_stats stats;
  io->t = t;
  io->touch_count = 0;
  bodies_read(from, io);
  io->pointer_count = from->pointers;
  for (size_t i = 0; i < from->pointers; ++i) {
    const hap_pointer_id id =
        r->pointer_count > 0 ? r->pointers[i] : pointer_replayed(r->session, i);
    if (id.v != 0) {
      pointer_read(r->session, id, &io->pointers[i]);
      touches_read(r->session, id, io);
    } else {
      pointer_from_row(&from->row.pointers[i], &io->pointers[i]);
    }
  }
  if (hap_session_stats(r->session, &stats, sizeof stats) >= HAP_OK) {
    io->force_error = stats.error.force_error;
  }
}

double run_frame_force(const hap_trace_row *row)
{
  double strongest = 0.0;
  for (size_t i = 0; i < row->pointer_count && i < HAP_TRACE_POINTERS_MAX; ++i) {
    const double *f = row->pointers[i].force;
    strongest = fmax(strongest, sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]));
  }
  return strongest;
}
