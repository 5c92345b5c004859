/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The program: one scene, one session, one summary. */

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/regular.h"
#include "tools/plot.h"
#include "tools/rig.h"
#include "tools/run_black_box.h"
#include "tools/run_calibrate.h"
#include "tools/run_doctor.h"
#include "tools/run_hand_over.h"
#include "tools/run_identify.h"
#include "tools/run_list.h"
#include "tools/run_loop.h"
#include "tools/run_options.h"
#include "tools/run_recording.h"
#include "tools/run_scene_file.h"
#include "tools/run_summary.h"
#include "tools/run_window.h"

enum exit_code {
  EXIT_GOOD = 0,
  EXIT_FAILED = 1,
  EXIT_USAGE = 2
};

static int usage_complain(int code, const char *text)
{
  fprintf(stderr, "hapode-run: %s\n", text);
  if (code == EXIT_USAGE) {
    fputs("hapode-run --help says what there is, --list which scenes, models and devices\n",
          stderr);
  }
  return code;
}

/* What cannot be written must be known before the hand has moved. */
static FILE *output_open(const char *option, const char *path, int how, hap_detail *detail)
{
  const char *why;
  FILE *file = hapi_regular_create_stream(path, how, &why);
  if (file == NULL) {
    snprintf(detail->text, sizeof detail->text, "%s %.300s: cannot be written: %s", option, path,
             why);
  }
  return file;
}

static bool open_trace(const run_options *options, run_loop *loop, hap_detail *detail)
{
  if (options->trace_path == NULL) {
    return true;
  }
  loop->trace.file = output_open("--trace", options->trace_path, O_TRUNC, detail);
  loop->trace.pointers = loop->pointers;
  size_t bodies = loop->rig->scene->body_count;
  loop->trace.bodies = bodies < HAP_TRACE_BODIES_MAX ? bodies : HAP_TRACE_BODIES_MAX;
  return loop->trace.file != NULL;
}

static bool open_black_box(const run_options *options, run_loop *loop, hap_detail *detail)
{
  if (options->black_box_path == NULL) {
    return true;
  }
  loop->black_box = output_open("--black-box", options->black_box_path, O_TRUNC, detail);
  return loop->black_box != NULL;
}

/* The file has its rows when there was a fault; of a run without one only the header. */
static bool close_black_box(run_loop *loop, hap_detail *detail)
{
  FILE *file = loop->black_box;
  const char *path = loop->options->black_box_path;
  loop->black_box = NULL;
  if (file == NULL) {
    return true;
  }
  size_t ticks = run_black_box_write(loop->rig->session, file);
  bool good = ferror(file) == 0;
  if (fclose(file) != 0 || !good) {
    snprintf(detail->text, sizeof detail->text, "--black-box %.300s: cannot be written: %s", path,
             strerror(errno));
    return false;
  }
  if (ticks > 0) {
    fprintf(stderr, "hapode-run: last %zu ticks before the fault: %s\n", ticks, path);
  }
  return true;
}

static bool open_picture(const run_options *options, run_loop *loop, hap_detail *detail)
{
  if (options->plot_path == NULL) {
    return true;
  }
  struct stat before;
  bool made = lstat(options->plot_path, &before) != 0;
  FILE *file = output_open("--plot", options->plot_path, O_APPEND, detail);
  if (file == NULL) {
    return false;
  }
  fclose(file);
  if (made) {
    (void)unlink(options->plot_path); /* gnuplot makes it again, if it comes to that */
  }
  if (!plot_available()) {
    fputs("hapode-run: " PLOT_ABSENT_TEXT "\n", stderr);
    return true;
  }
  loop->picture = run_picture_create(loop->seconds, loop->pointers, options->rig.def.haptic_hz);
  if (loop->picture == NULL) {
    snprintf(detail->text, sizeof detail->text, "no memory for the picture");
  }
  return loop->picture != NULL;
}

/* What draws no pictures is asked for wrongly. */
static int open_shot(const run_options *options, run_loop *loop, hap_detail *detail)
{
  hap_status status =
      run_shot_open(options, loop->rig, loop->seconds, loop->pointers, &loop->shot, detail);
  if (status >= HAP_OK) {
    return EXIT_GOOD;
  }
  return status == HAP_ERROR_UNSUPPORTED ? EXIT_USAGE : EXIT_FAILED;
}

static bool close_trace(run_loop *loop, hap_detail *detail)
{
  FILE *file = loop->trace.file;
  loop->trace.file = NULL;
  if (file == NULL || (fclose(file) == 0 && loop->trace_errno == 0)) {
    return true;
  }
  snprintf(detail->text, sizeof detail->text, "--trace %.300s: cannot be written: %s",
           loop->options->trace_path, strerror(loop->trace_errno != 0 ? loop->trace_errno : errno));
  return false;
}

static hap_status picture_draw(const run_loop *loop, hap_detail *detail)
{
  const run_options *o = loop->options;
  char devices[80];
  char title[256];
  if (loop->picture == NULL) {
    return HAP_OK;
  }
  run_summary_devices(&o->rig, devices, sizeof devices);
  snprintf(title, sizeof title, "%.60s, model %s, physics %g Hz, haptic %g Hz, device %.*s",
           o->rig.scene, hap_model_name(o->rig.def.model), run_summary_physics_hz(o),
           o->rig.def.haptic_hz, (int)strcspn(devices, ":"), devices);
  return run_picture_draw(loop->picture, o->plot_path, title, detail);
}

static void status_tell(const run_options *options, hap_status status, const hap_stats *stats)
{
  if (status == HAP_END && !options->window.wanted) {
    fprintf(stderr, "hapode-run: stopped early, after %.3f s\n",
            (double)stats->loop.ticks / options->rig.def.haptic_hz);
  }
  if (stats->physics.duty > 1.0 && options->rig.def.drive != HAP_DRIVE_LOCKSTEP) {
    fprintf(stderr,
            "hapode-run: physics took %.2g times the time it had: the world ran slowly; lower "
            "--physics-hz or take a smaller scene\n",
            stats->physics.duty);
  }
  if (stats->loop.trace_dropped > 0) {
    fprintf(stderr, "hapode-run: %" PRIu64 " rows of the trace were dropped\n",
            stats->loop.trace_dropped);
  }
}

/* Runs and reports; the files are open. */
static int run_and_report(run_loop *loop, const run_recording *recording)
{
  hap_stats stats;
  hap_detail detail = {""};
  hap_status status = run_loop_run(loop, &stats, &detail);
  int code = EXIT_GOOD;
  if (status < HAP_OK) {
    code =
        usage_complain(EXIT_FAILED, detail.text[0] != '\0' ? detail.text : hap_status_text(status));
  }
  if (!close_trace(loop, &detail)) {
    code = usage_complain(EXIT_FAILED, detail.text);
  }
  if (!close_black_box(loop, &detail)) {
    code = usage_complain(EXIT_FAILED, detail.text);
  }
  if (run_shot_close(loop->shot, &detail) < HAP_OK) {
    code = usage_complain(EXIT_FAILED, detail.text);
  }
  loop->shot = NULL;
  if (run_html_close(loop->html, &detail) < HAP_OK) {
    code = usage_complain(EXIT_FAILED, detail.text);
  }
  loop->html = NULL;
  if (picture_draw(loop, &detail) < HAP_OK) {
    code = usage_complain(EXIT_FAILED, detail.text);
  }
  if (stats.size > 0) { /* it was started */
    status_tell(loop->options, status, &stats);
    hap_effect_info effects[HAP_EFFECTS];
    (void)hap_session_effects(loop->rig->session, effects, HAP_EFFECTS, sizeof effects[0]);
    run_summary_print(loop->options, &stats, effects, stdout);
    hap_accuracy_info accuracy;
    if (hap_session_accuracy(loop->rig->session, &accuracy, sizeof accuracy) >= HAP_OK) {
      run_summary_accuracy(&accuracy, stdout);
    }
    if (recording->player == NULL) {
      run_coupling_print(loop->coupling, loop->rig->pointer_count, stdout);
    }
    if (loop->rig->effectors_left > 0) {
      printf("effectors_left: %zu (the scene has no more hands)\n", loop->rig->effectors_left);
    }
    if (loop->options->effects_table) {
      run_effects_table(effects, stdout);
    }
    run_far_print(loop->far, stdout);
    if (!run_recording_print(recording, loop->options, loop->rig->session, stdout, &detail)) {
      code = usage_complain(EXIT_FAILED, detail.text);
    }
  }
  if (fflush(stdout) != 0 || ferror(stdout) != 0) {
    code = usage_complain(EXIT_FAILED, "the summary cannot be written to stdout");
  }
  return code;
}

#define ENDLESS_S 1e6 /* of a window */

/* Of a replay: the whole recording. */
static double seconds_of(const run_options *options, const rig *r, const run_recording *recording)
{
  if (options->seconds > 0.0) {
    return options->seconds;
  }
  return recording->player != NULL
             ? (double)recording->info.ticks / options->rig.def.haptic_hz + 1.0
         : options->window.wanted     ? ENDLESS_S
         : options->far.serve != NULL ? ENDLESS_S
                                      : r->scene->parameters.duration;
}

static size_t pointers_of(const rig *r, const run_recording *recording)
{
  if (recording->player == NULL) {
    return r->pointer_count;
  }
  return recording->info.pointers > 0 ? recording->info.pointers : 1;
}

/* The window's strips are of a whole recording, else they move on. */
static double strips_of(const run_options *options, const run_recording *recording)
{
  return recording->player != NULL ? (double)recording->info.ticks / options->rig.def.haptic_hz
                                   : 0.0;
}

static int run_in(const run_options *options, rig *r, run_far *far, const run_recording *recording)
{
  hap_detail detail = {""};
  run_coupling coupling = {0};
  run_loop loop = {.options = options,
                   .rig = r,
                   .seconds = seconds_of(options, r, recording),
                   .far = far,
                   .coupling = &coupling,
                   .stage = options->window.stage,
                   .pointers = pointers_of(r, recording)};
  run_progress_init(&loop.progress, options->rig.max_force > 0.0 ? options->rig.max_force : 20.0);
  int code = open_shot(options, &loop, &detail);
  if (code == EXIT_GOOD && run_html_open(options, r, loop.pointers, &loop.html, &detail) < HAP_OK) {
    code = EXIT_FAILED;
  }
  if (code == EXIT_GOOD && run_stage_enter(loop.stage, options, r, loop.pointers,
                                           strips_of(options, recording), &detail) < HAP_OK) {
    code = EXIT_FAILED;
  }
  if (code == EXIT_GOOD &&
      !(open_trace(options, &loop, &detail) && open_black_box(options, &loop, &detail) &&
        open_picture(options, &loop, &detail))) {
    code = EXIT_FAILED;
  }
  if (code == EXIT_GOOD) {
    code = run_and_report(&loop, recording);
  } else {
    fprintf(stderr, "hapode-run: %s\n", detail.text);
    run_shot_drop(loop.shot);
    run_html_drop(loop.html);
    (void)close_trace(&loop, &detail);
    (void)close_black_box(&loop, &detail);
  }
  run_picture_destroy(loop.picture);
  run_stage_leave(loop.stage);
  return code;
}

/* A name or argument that cannot be is wrong usage, all else a failure. */
static int run_refuse(const rig *r, hap_status status, const hap_detail *detail)
{
  static const char *const parts[] = {[RIG_SCENE] = "--scene: ",
                                      [RIG_SESSION] = "",
                                      [RIG_POINTER] = "--device: ",
                                      [RIG_RECORDING] = "--record: "};
  hap_detail whole;
  snprintf(whole.text, sizeof whole.text, "%s%.490s", parts[r->failed],
           detail->text[0] != '\0' ? detail->text : hap_status_text(status));
  bool usage = status == HAP_ERROR_NOT_FOUND || status == HAP_ERROR_ARGUMENT;
  return usage_complain(usage ? EXIT_USAGE : EXIT_FAILED, whole.text);
}

/* A device that cannot be opened as asked for is wrong usage. */
static int run_alone(const run_options *options,
                     hap_status (*run)(const run_options *options, FILE *out, hap_detail *detail))
{
  hap_detail detail = {""};
  run_loop_catch_signals();
  hap_status status = run(options, stdout, &detail);
  if (status == HAP_OK) {
    return EXIT_GOOD;
  }
  bool usage = status == HAP_ERROR_NOT_FOUND || status == HAP_ERROR_ARGUMENT;
  return usage_complain(usage ? EXIT_USAGE : EXIT_FAILED,
                        detail.text[0] != '\0' ? detail.text : hap_status_text(status));
}

static int check_device(run_options *options)
{
  run_loop_catch_signals();
  options->check.rate_hz = options->rig.def.haptic_hz;
  options->check.stop = run_loop_stop_wanted;
  return conform_run(&options->check, stdout) ? EXIT_GOOD : EXIT_FAILED;
}

static int run_world(run_options *options, const run_recording *recording)
{
  rig r = {.failed = RIG_SCENE};
  run_scene_file file;
  hap_detail detail = {""};
  dInitODE2(0);
  run_stage_prepare(options->window.stage, options);
  hap_status status = run_scene_file_open(options, &file, &detail);
  status = status >= HAP_OK ? rig_create(&options->rig, &r, &detail) : status;
  bool made = status >= HAP_OK;
  run_far far = {0};
  if (made) {
    r.failed = RIG_SESSION; /* what follows says which option it is about */
    status = run_far_open(options, &r, &far, &detail);
  }
  int code =
      status < HAP_OK ? run_refuse(&r, status, &detail) : run_in(options, &r, &far, recording);
  if (made) {
    rig_destroy(&r);
  }
  run_far_close(&far);
  run_scene_file_close(&file);
  dCloseODE();
  return code;
}

static int run_session(run_options *options)
{
  hap_detail detail = {""};
  run_recording recording;
  run_loop_catch_signals();
  int code = run_recording_open(options, &recording, &detail) < HAP_OK
                 ? usage_complain(EXIT_FAILED, detail.text)
                 : EXIT_GOOD;
  if (code == EXIT_GOOD) {
    options->rig.expert.trace_rows = run_loop_trace_rows(options);
    code = run_world(options, &recording);
  }
  run_recording_close(&recording);
  return code;
}

/* All runs of a window; their thread draws nothing. */
static int run_sessions(run_options *options)
{
  int code;
  do {
    code = run_session(options);
  } while (run_stage_goes_on(options->window.stage, options) && code == EXIT_GOOD);
  return code;
}

static int run_shown(run_options *options)
{
  hap_detail detail = {""};
  int code = EXIT_GOOD;
  hap_status status = run_window(options, run_sessions, &code, &detail);
  if (status >= HAP_OK) {
    return code;
  }
  fprintf(stderr, "hapode-run: %s\n", detail.text);
  return status == HAP_ERROR_UNSUPPORTED ? EXIT_USAGE : EXIT_FAILED;
}

/* Any thread but the haptic. */
static void log_show(hap_log_level level, const char *text, void *user)
{
  (void)user;
  if (level <= HAP_LOG_WARNING) {
    fprintf(stderr, "hapode-run: %s\n", text);
  }
}

/* The environment's root is for tests. */
static int doctor_run(bool json)
{
  const char *root = getenv("HAPODE_DOCTOR_ROOT");
  bool good = run_doctor(stdout, root != NULL ? root : "", json);
  if (fflush(stdout) != 0 || ferror(stdout) != 0) {
    return usage_complain(EXIT_FAILED, "the findings cannot be written to stdout");
  }
  return good ? EXIT_GOOD : EXIT_FAILED;
}

int main(int argc, char **argv)
{
  run_options options;
  hap_detail detail = {""};
  hap_hooks hooks;
  hap_hooks_init(&hooks, sizeof hooks);
  hooks.log = log_show;
  (void)hap_hooks_set(&hooks);
  if (run_options_parse(argc, argv, &options, &detail) < HAP_OK) {
    return usage_complain(EXIT_USAGE, detail.text);
  }
  switch (options.action) {
    case RUN_LIST:
      run_list_print(stdout, false);
      break;
    case RUN_PROBE:
      fputs("hapode-run: bytes are sent to the serial ports of all USB adapters\n", stderr);
      run_list_print(stdout, true);
      break;
    case RUN_DOCTOR:
      return doctor_run(options.json);
    case RUN_HELP:
      run_options_help(stdout);
      break;
    case RUN_VERSION:
      printf("hapode-run %s\n", hap_version());
      break;
    case RUN_SESSION:
      if (run_hand_over(&options, argv, &detail) < HAP_OK) {
        return usage_complain(EXIT_USAGE, detail.text);
      }
      if (options.check.spec != NULL) {
        return check_device(&options);
      }
      if (options.calibrate_path != NULL) {
        return run_alone(&options, run_calibrate);
      }
      if (options.identify_path != NULL) {
        return run_alone(&options, run_identify);
      }
      return options.window.wanted ? run_shown(&options) : run_session(&options);
  }
  return EXIT_GOOD;
}
