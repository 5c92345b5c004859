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
#include "tools/run_frame.h"
#include "tools/run_scene_file.h"
#include "tools/run_summary.h"

#define FRAMES_HZ 30.0
#define FRAMES_CALM 0.92 /* of the framing, from frame to frame */

struct run_shot {
  const run_options *options;
  run_frame_source source;
  hap_scene *scene;
  view *view;
  FILE *file; /* of --shot; NULL: not wanted */
  view_labels labels;
  view_strips strips;
  view_frame now;
  view_frame kept; /* for --shot */
  double kept_force;
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

static hap_status scene_describe(run_shot *shot, hap_detail *detail)
{
  HAPI_TRY(run_scene_file_again(shot->options, &shot->scene, detail)); /* to be read */
  run_frame_pointers(shot->options, shot->scene, &shot->now);
  shot->source.scene = shot->scene;
  return view_take_scene(shot->view, shot->scene, detail);
}

static hap_status shot_make(run_shot *shot, double seconds, hap_detail *detail)
{
  const run_options *o = shot->options;
  const size_t bodies = shot->source.rig->scene->body_count;
  if (!run_frame_reserve(&shot->now, bodies) || !run_frame_reserve(&shot->kept, bodies)) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for a picture");
  }
  HAPI_TRY(view_create(o->shot.size[0], o->shot.size[1], &shot->view, detail));
  HAPI_TRY(scene_describe(shot, detail));
  if (o->shot.camera_given) {
    view_set_camera(shot->view, o->shot.camera, &o->shot.camera[3]);
  }
  shot->kept.t = -1.0; /* none yet */
  run_frame_labels(o, &shot->labels);
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
  (void)hap_scene_destroy(shot->scene);
  run_frame_free(&shot->now);
  run_frame_free(&shot->kept);
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
  *shot = (run_shot){
      .options = options,
      .source = {.rig = r,
                 .pointers = pointers < VIEW_POINTERS_MAX ? pointers : VIEW_POINTERS_MAX}};
  hap_status status = shot_make(shot, seconds, detail);
  if (status < HAP_OK) {
    shot_free(shot);
    return status;
  }
  *out = shot;
  return HAP_OK;
}

/* ---- on the way ---- */

void run_shot_add_row(run_shot *shot, const hap_trace_row *row)
{
  if (shot == NULL) {
    return;
  }
  view_strips_add(&shot->strips, row->t, run_frame_force(row), row->tick_us);
  shot->source.row = *row;
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
  run_frame_read(&shot->source, t, &shot->now);
  for (size_t i = 0; i < shot->now.pointer_count; ++i) {
    const double *f = shot->now.pointers[i].force;
    force += sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]);
  }
  bool better = at >= 0.0 ? shot->kept.t < at : force >= shot->kept_force;
  if (shot->file != NULL && better) {
    run_frame_copy(&shot->now, &shot->kept);
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
