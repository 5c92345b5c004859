/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/run_shot.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "base/log.h"
#include "base/regular.h"
#include "tools/run_summary.h"

#ifdef HAPODE_VIEW

#include "view/view.h"

#define FRAMES_HZ 30.0
#define FRAMES_CALM 0.92 /* of the framing, from frame to frame */

struct run_shot {
  const run_options *options;
  const rig *rig;
  view *view;
  FILE *file; /* of --shot; NULL: not wanted */
  size_t pointers;
  view_labels labels;
  view_strips strips;
  view_frame now;
  view_frame kept; /* for --shot */
  double kept_force;
  hap_trace_row row; /* the newest */
  size_t frames;     /* written */
  hap_detail failed; /* the first picture that could not be written; "": none */
};

/* ---- opening ---- */

static FILE *picture_open(const char *option, const char *path, hap_detail *detail)
{
  const char *why;
  FILE *file = hapi_regular_create_stream(path, O_TRUNC, &why);
  if (file == NULL) {
    snprintf(detail->text, sizeof detail->text, "%s %.300s: cannot be written: %s", option, path,
             why);
  }
  return file;
}

static hap_status folder_open(const char *path, hap_detail *detail)
{
  struct stat about;
  if (mkdir(path, 0777) == 0) {
    return HAP_OK;
  }
  int why = errno;
  if (why == EEXIST && stat(path, &about) == 0 && S_ISDIR(about.st_mode)) {
    return HAP_OK;
  }
  return hapi_fail(detail, HAP_ERROR_IO, "--frames %.300s: cannot be a folder: %s", path,
                   strerror(why == EEXIST ? ENOTDIR : why));
}

static bool frame_reserve(view_frame *out, size_t bodies)
{
  out->bodies = calloc(bodies + 1, sizeof *out->bodies);
  out->roles = calloc(bodies + 1, sizeof *out->roles);
  out->body_count = bodies;
  return out->bodies != NULL && out->roles != NULL;
}

/* Size and form of the pointers: what the scene's hands have, and further ones what the first
 * has. */
static void pointers_describe(const hap_scene *from, run_shot *shot)
{
  for (size_t i = 0; i < VIEW_POINTERS_MAX; ++i) {
    view_pointer *p = &shot->now.pointers[i];
    hap_pointer_def def;
    const char *spec;
    hap_pointer_def_init(&def, sizeof def);
    if (hap_scene_hand(from, (uint32_t)i, &def, &spec) < HAP_OK) {
      (void)hap_scene_hand(from, 0, &def, &spec);
    }
    p->radius = def.radius;
    for (size_t k = 0; k < 3 * def.hull_points; ++k) {
      p->half_edges[k % 3] = fmax(p->half_edges[k % 3], fabs(def.hull_xyz[k]));
    }
  }
}

static void labels_fill(const run_options *options, view_labels *out)
{
  char devices[80];
  run_summary_devices(&options->rig, devices, sizeof devices);
  snprintf(out->title, sizeof out->title, "%.90s", options->rig.scene);
  snprintf(out->subtitle, sizeof out->subtitle, "model %s, physics %g Hz, haptic %g Hz, %.*s",
           hap_model_name(options->rig.def.model), run_summary_physics_hz(options),
           options->rig.def.haptic_hz, (int)strcspn(devices, ":"), devices);
}

static hap_status scene_describe(const char *spec, run_shot *shot, hap_detail *detail)
{
  hap_scene *other;
  HAPI_TRY(hap_scene_load(spec, &other, detail)); /* one more, to be read */
  hap_status status = view_take_scene(shot->view, other, detail);
  pointers_describe(other, shot);
  (void)hap_scene_destroy(other);
  return status;
}

static hap_status shot_make(run_shot *shot, double seconds, hap_detail *detail)
{
  const run_options *o = shot->options;
  const size_t bodies = shot->rig->scene->body_count;
  if (!frame_reserve(&shot->now, bodies) || !frame_reserve(&shot->kept, bodies)) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for a picture");
  }
  HAPI_TRY(view_create(o->shot.size[0], o->shot.size[1], &shot->view, detail));
  HAPI_TRY(scene_describe(o->rig.scene, shot, detail));
  if (o->shot.camera_given) {
    view_set_camera(shot->view, o->shot.camera, &o->shot.camera[3]);
  }
  shot->kept.t = -1.0; /* none yet */
  labels_fill(o, &shot->labels);
  view_strips_init(&shot->strips, seconds);
  if (o->shot.frames != NULL) {
    HAPI_TRY(folder_open(o->shot.frames, detail));
  }
  if (o->shot.path != NULL) {
    shot->file = picture_open("--shot", o->shot.path, detail);
  }
  return o->shot.path == NULL || shot->file != NULL ? HAP_OK : HAP_ERROR_IO;
}

static void shot_free(run_shot *shot)
{
  view_destroy(shot->view);
  free(shot->now.bodies);
  free(shot->now.roles);
  free(shot->kept.bodies);
  free(shot->kept.roles);
  if (shot->file != NULL) {
    fclose(shot->file);
  }
  free(shot);
}

hap_status run_shot_open(const run_options *options, const rig *r, double seconds, size_t pointers,
                         run_shot **out, hap_detail *detail)
{
  *out = NULL;
  if (options->shot.path == NULL && options->shot.frames == NULL) {
    return HAP_OK;
  }
  run_shot *shot = calloc(1, sizeof *shot);
  if (shot == NULL) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for a picture");
  }
  *shot = (run_shot){.options = options,
                     .rig = r,
                     .pointers = pointers < VIEW_POINTERS_MAX ? pointers : VIEW_POINTERS_MAX};
  hap_status status = shot_make(shot, seconds, detail);
  if (status < HAP_OK) {
    shot_free(shot);
    return status;
  }
  *out = shot;
  return HAP_OK;
}

/* ---- on the way ---- */

static double vector_length(const double v[3])
{
  return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

void run_shot_add_row(run_shot *shot, const hap_trace_row *row)
{
  double strongest = 0.0;
  if (shot == NULL) {
    return;
  }
  for (size_t i = 0; i < row->pointer_count && i < HAP_TRACE_POINTERS_MAX; ++i) {
    strongest = fmax(strongest, vector_length(row->pointers[i].force));
  }
  view_strips_add(&shot->strips, row->t, strongest, row->tick_us);
  shot->row = *row;
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

static void frame_read(run_shot *shot, double t)
{
  const rig *r = shot->rig;
  view_frame *f = &shot->now;
  hap_stats stats;
  f->t = t;
  f->touch_count = 0;
  (void)hap_session_poses_now(r->session, r->scene->bodies, f->body_count, f->bodies);
  (void)hap_session_roles(r->session, r->scene->bodies, f->body_count, f->roles);
  f->pointer_count = shot->pointers;
  for (size_t i = 0; i < shot->pointers; ++i) {
    if (r->pointer_count > 0) {
      pointer_read(r->session, r->pointers[i], &f->pointers[i]);
      touches_read(r->session, r->pointers[i], f);
    } else {
      pointer_from_row(&shot->row.pointers[i], &f->pointers[i]);
    }
  }
  if (hap_session_stats(r->session, &stats, sizeof stats) >= HAP_OK) {
    f->force_error = stats.error.force_error;
  }
}

static void frame_keep(run_shot *shot)
{
  view_frame *to = &shot->kept;
  hap_pose *bodies = to->bodies;
  hap_body_role *roles = to->roles;
  memcpy(bodies, shot->now.bodies, shot->now.body_count * sizeof *bodies);
  memcpy(roles, shot->now.roles, shot->now.body_count * sizeof *roles);
  *to = shot->now;
  to->bodies = bodies;
  to->roles = roles;
}

static bool picture_write(run_shot *shot, const view_frame *frame, FILE *file, hap_detail *detail)
{
  const int *size = shot->options->shot.size;
  const uint8_t *pixels = view_draw(shot->view, frame, &shot->strips, &shot->labels);
  return view_png_write(file, pixels, size[0], size[1], detail) >= HAP_OK;
}

static void frame_write(run_shot *shot)
{
  char path[4096];
  hap_detail why = {""};
  snprintf(path, sizeof path, "%.4000s/frame_%05zu.png", shot->options->shot.frames, shot->frames);
  ++shot->frames;
  FILE *file = picture_open("--frames", path, &why);
  view_set_calm(shot->view, FRAMES_CALM);
  bool good = file != NULL && picture_write(shot, &shot->now, file, &why);
  if (file != NULL && fclose(file) != 0 && good) {
    snprintf(why.text, sizeof why.text, "cannot be written: %s", strerror(errno));
    good = false;
  }
  if (!good && shot->failed.text[0] == '\0') {
    snprintf(shot->failed.text, sizeof shot->failed.text, "%s%.480s",
             file != NULL ? "--frames: " : "", why.text);
  }
}

void run_shot_look(run_shot *shot, double t)
{
  if (shot == NULL) {
    return;
  }
  const double at = shot->options->shot.at;
  double force = 0.0;
  frame_read(shot, t);
  for (size_t i = 0; i < shot->now.pointer_count; ++i) {
    force += vector_length(shot->now.pointers[i].force);
  }
  bool better = at >= 0.0 ? shot->kept.t < at : force >= shot->kept_force;
  if (shot->file != NULL && better) {
    frame_keep(shot);
    shot->kept_force = force;
  }
  if (shot->options->shot.frames != NULL && t >= (double)shot->frames / FRAMES_HZ) {
    frame_write(shot);
  }
}

hap_status run_shot_close(run_shot *shot, hap_detail *detail)
{
  hap_detail why = {""};
  if (shot == NULL) {
    return HAP_OK;
  }
  bool good = shot->failed.text[0] == '\0';
  if (!good) {
    *detail = shot->failed;
  }
  if (shot->file != NULL) {
    view_set_calm(shot->view, 0.0);
    bool written = picture_write(shot, &shot->kept, shot->file, &why);
    if (fclose(shot->file) != 0 && written) {
      snprintf(why.text, sizeof why.text, "cannot be written: %s", strerror(errno));
      written = false;
    }
    shot->file = NULL;
    if (!written) {
      snprintf(detail->text, sizeof detail->text, "--shot %.200s: %.250s", shot->options->shot.path,
               why.text);
    }
    good = good && written;
  }
  shot_free(shot);
  return good ? HAP_OK : HAP_ERROR_IO;
}

void run_shot_drop(run_shot *shot)
{
  if (shot != NULL) {
    shot_free(shot);
  }
}

#else /* a build without pictures */

hap_status run_shot_open(const run_options *options, const rig *r, double seconds, size_t pointers,
                         run_shot **out, hap_detail *detail)
{
  (void)r;
  (void)seconds;
  (void)pointers;
  *out = NULL;
  return options->shot.path == NULL && options->shot.frames == NULL
             ? HAP_OK
             : hapi_fail(detail, HAP_ERROR_UNSUPPORTED,
                         "--shot and --frames: this build draws no pictures (meson option view; "
                         "Debian: libepoxy-dev libegl-dev libpng-dev)");
}

void run_shot_add_row(run_shot *shot, const hap_trace_row *row)
{
  (void)shot;
  (void)row;
}

void run_shot_look(run_shot *shot, double t)
{
  (void)shot;
  (void)t;
}

hap_status run_shot_close(run_shot *shot, hap_detail *detail)
{
  (void)shot;
  (void)detail;
  return HAP_OK;
}

void run_shot_drop(run_shot *shot)
{
  (void)shot;
}

#endif
