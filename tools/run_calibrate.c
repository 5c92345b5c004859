/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/run_calibrate.h"

#include <math.h>
#include <poll.h>
#include <string.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/log.h"
#include "base/vec.h"
#include "device/device.h"
#include "device/one_effector.h"
#include "plugins/spidar/spidar.h"
#include "tools/run_loop.h"

#define TICK_NS 1000000
#define SAMPLE_S 0.02
#define SAY_S 2.0
#define SWEEP_S 60.0 /* unless --seconds says another time */
#define EVEN 1.01    /* of the least tension, at most */
#define LOST_S 1.0   /* without an answer of the boards */
#define GAIN 0.7     /* of the residual: what motor points that were found must bring */
#define DEGREES 57.29577951308232087679815481410517

typedef enum word {
  WORD_NONE,
  WORD_ENTER,
  WORD_HOME,
  WORD_END
} word;

typedef struct session {
  const run_options *options;
  hap_device *device;
  const hap_device_ops *ops;
  hapi_spidar_device *spidar;
  FILE *out;
  hap_detail *detail;
  char line[32]; /* of stdin, so far */
  size_t used;
  hapi_spidar_sample *samples;
  size_t count;
  size_t room;
  double least[3]; /* m, of the sweep */
  double most[3];
  double turned; /* rad */
} session;

/* ---- what the person says ---- */

static word word_of(session *s)
{
  s->line[s->used] = '\0';
  s->used = 0;
  return strcmp(s->line, "home") == 0 ? WORD_HOME : WORD_ENTER;
}

/* Without waiting longer than that. Byte by byte: what comes behind a line is for the next
 * question. */
static word person_listen(session *s, int wait_ms)
{
  struct pollfd input = {STDIN_FILENO, POLLIN, 0};
  char byte = '\0';
  while (poll(&input, 1, wait_ms) > 0) {
    if (read(STDIN_FILENO, &byte, 1) <= 0) {
      return WORD_END;
    }
    if (byte == '\n') {
      return word_of(s);
    }
    if (s->used + 1 < sizeof s->line) {
      s->line[s->used++] = byte;
    }
  }
  return WORD_NONE;
}

static hap_status ask_for_home(session *s)
{
  word said = WORD_NONE;
  fputs(
      "hapode-run: hold the grip at home: at its marked place, not turned\n"
      "hapode-run: the motors are going to pull its strings taut with little force\n"
      "hapode-run: press Enter, and hold it still until the next line\n",
      stderr);
  while (said == WORD_NONE && !run_loop_stop_wanted()) {
    said = person_listen(s, 100);
  }
  return said == WORD_ENTER || said == WORD_HOME ? HAP_OK : HAP_END;
}

/* ---- the strings are kept taut, whatever the person does ---- */

static bool is_lost(const session *s)
{
  int cause = atomic_load(&s->spidar->cause);
  const hapi_spidar_line *line = &s->spidar->line;
  return cause == HAPI_SPIDAR_HUNG_UP || cause == HAPI_SPIDAR_JUMPED ||
         cause == HAPI_SPIDAR_STALLED || hapi_spidar_line_silence(line) > LOST_S;
}

/* A tick with the least tensions; lengths that fit no pose are what a calibration is for. False: it
 * is lost. */
static bool hold_taut(const session *s)
{
  const hap_wrench none = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  hap_wrench reached;
  hap_pose pose;
  hap_twist twist;
  uint32_t buttons;
  int64_t now_ns = hapi_clock_now();
  (void)hapi_one_read(s->ops, s->spidar, now_ns, &pose, &twist, &buttons);
  (void)hapi_one_write(s->ops, s->spidar, &none, &reached);
  hapi_clock_sleep_until(now_ns + TICK_NS);
  return !is_lost(s);
}

static hap_status fail_device(const session *s)
{
  hapi_device_explain(s->ops, s->spidar, s->detail);
  return HAP_ERROR_DEVICE;
}

/* Whether there is to be a sweep. */
static hap_status ask_for_sweep(session *s, bool *out_sweep)
{
  word said = WORD_NONE;
  fputs(
      "hapode-run: home is known. To find the lengths, and where the motors are, better: press "
      "Enter, then move\n"
      "hapode-run: the grip slowly all over its workspace and turn it about all axes; or write "
      "home and Enter, and\n"
      "hapode-run: it stays with that\n",
      stderr);
  while (said == WORD_NONE && !run_loop_stop_wanted()) {
    if (!hold_taut(s)) {
      return fail_device(s);
    }
    said = person_listen(s, 0);
  }
  *out_sweep = said == WORD_ENTER;
  return run_loop_stop_wanted() ? HAP_END : HAP_OK;
}

/* ---- the sweep ---- */

static void range_widen(session *s)
{
  const hap_pose *pose = &s->spidar->belief.trial.pose;
  for (int k = 0; k < 3; ++k) {
    s->least[k] = fmin(s->least[k], pose->position[k]);
    s->most[k] = fmax(s->most[k], pose->position[k]);
  }
  s->turned = fmax(s->turned, 2.0 * acos(fmin(fabs(pose->quat_wxyz[0]), 1.0)));
}

static void sample_record(session *s)
{
  hapi_spidar_sample *sample = &s->samples[s->count++];
  memset(sample, 0, sizeof *sample);
  for (int i = 0; i < s->spidar->model.strings; ++i) {
    sample->counts[i] = s->spidar->line.counts.counts[i];
  }
  range_widen(s);
}

static void say_range(const session *s, double left)
{
  fprintf(stderr,
          "hapode-run: moved over %.0f x %.0f x %.0f mm, turned by %.0f degrees; %.0f s left, or "
          "Enter\n",
          1e3 * (s->most[0] - s->least[0]), 1e3 * (s->most[1] - s->least[1]),
          1e3 * (s->most[2] - s->least[2]), DEGREES * s->turned, left);
}

/* An answer of its own for each sample. */
static hap_status sweep_for(session *s, double seconds)
{
  double begin = 1e-9 * (double)hapi_clock_now();
  double now = begin;
  double taken = -1.0;
  double said = begin;
  bool more = true; /* of stdin */
  while (now < begin + seconds && s->count < s->room && !run_loop_stop_wanted()) {
    if (!hold_taut(s)) {
      return fail_device(s);
    }
    now = 1e-9 * (double)hapi_clock_now();
    if (s->spidar->line.taken > taken && now >= begin + SAMPLE_S * (double)s->count) {
      taken = s->spidar->line.taken;
      sample_record(s);
    }
    if (now > said + SAY_S) {
      said = now;
      say_range(s, begin + seconds - now);
    }
    word heard = more ? person_listen(s, 0) : WORD_NONE;
    more = heard != WORD_END;
    if (heard == WORD_ENTER || heard == WORD_HOME) {
      break;
    }
  }
  return run_loop_stop_wanted() ? HAP_END : HAP_OK;
}

/* ---- what is found ---- */

static void print_found(const session *s, const hapi_spidar_calibration *found, bool motors)
{
  double offset = 0.0;
  double motor = 0.0;
  for (int i = 0; i < found->model.strings; ++i) {
    offset = fmax(offset, found->offset_deviation[i]);
    motor = fmax(motor, found->motor_deviation[i]);
  }
  fprintf(s->out, "samples: %zu\nresidual_um: %.1f\nworst_um: %.1f\noffset_deviation_um: %.1f\n",
          s->count, 1e6 * found->residual, 1e6 * found->worst, 1e6 * offset);
  if (motors) {
    fprintf(s->out, "motor_deviation_um: %.1f\n", 1e6 * motor);
  }
}

/* Motor points are found where the samples tell them and they explain what offsets alone do not. */
static hap_status session_fit(session *s)
{
  hapi_spidar_calibration simple;
  hapi_spidar_calibration full;
  hap_detail why_not = {""};
  const hapi_spidar_model *model = &s->spidar->model;
  hap_status status = hapi_spidar_calibrate(model, s->samples, s->count, 0, &simple, s->detail);
  hap_status more =
      hapi_spidar_calibrate(model, s->samples, s->count, HAPI_SPIDAR_FIND_MOTORS, &full, &why_not);
  bool motors = more >= HAP_OK && (status < HAP_OK || full.residual < GAIN * simple.residual);
  if (!motors && status < HAP_OK) {
    return status;
  }
  fprintf(s->out, "found: %s\n", motors ? "offsets and motor points" : "offsets");
  if (!motors) {
    fprintf(s->out, "motor_points: %s\n",
            more >= HAP_OK ? "those of the model explain the lengths" : why_not.text);
  }
  print_found(s, motors ? &full : &simple, motors);
  s->spidar->model = motors ? full.model : simple.model;
  return HAP_OK;
}

static hap_status session_sweep(session *s)
{
  double seconds = s->options->seconds > 0.0 ? s->options->seconds : SWEEP_S;
  double room = seconds / SAMPLE_S + 1.0;
  s->room = room < HAPI_SPIDAR_SAMPLES_MAX ? (size_t)room : HAPI_SPIDAR_SAMPLES_MAX;
  s->samples = hapi_alloc_array(s->room, sizeof *s->samples);
  if (s->samples == NULL) {
    return hapi_fail(s->detail, HAP_ERROR_MEMORY, "--calibrate: no memory for %zu samples",
                     s->room);
  }
  /* The same tension on all strings everywhere: then what stretches them is a part of the
   * offsets. */
  double most = s->spidar->model.max_tension;
  s->spidar->model.max_tension = EVEN * s->spidar->model.min_tension;
  hap_status status = sweep_for(s, seconds);
  s->ops->stop(s->spidar);
  s->spidar->model.max_tension = most;
  if (status == HAP_OK) {
    say_range(s, 0.0);
    status = session_fit(s);
  }
  hapi_free(s->samples);
  return status;
}

static void result_print(const session *s)
{
  const hapi_spidar_model *model = &s->spidar->model;
  fprintf(s->out, "model: %s\noffsets_m:", model->name);
  for (int i = 0; i < model->strings; ++i) {
    fprintf(s->out, " %.5f", model->offset[i]);
  }
  fprintf(s->out, "\nuse: --device spidar:PORT,model=%s until the boards are switched off\n",
          s->options->calibrate_path);
}

static hap_status session_calibrate(session *s)
{
  bool more = false;
  hap_status status = ask_for_home(s);
  if (status != HAP_OK) {
    return status;
  }
  hapi_spidar_forget_home(s->spidar);
  status = s->ops->start(s->spidar);
  if (status < HAP_OK) {
    return fail_device(s);
  }
  status = ask_for_sweep(s, &more);
  if (status == HAP_OK && more) {
    status = session_sweep(s);
  }
  s->ops->stop(s->spidar);
  if (status == HAP_OK) {
    status = hapi_spidar_model_write(s->options->calibrate_path, &s->spidar->model, s->detail);
  }
  if (status == HAP_OK) {
    result_print(s);
  }
  return status;
}

hap_status run_calibrate(const run_options *options, FILE *out, hap_detail *detail)
{
  session s = {.options = options, .out = out, .detail = detail};
  hap_status status = hap_device_open(options->rig.devices[0], &s.device, detail);
  if (status < HAP_OK) {
    return status;
  }
  s.ops = hapi_device_ops(s.device);
  if (s.ops == &hapi_spidar_ops) {
    s.spidar = hapi_device_self(s.device);
    status = session_calibrate(&s);
  } else {
    (void)snprintf(detail->text, sizeof detail->text,
                   "--calibrate: the device %.60s has no home to be told; spidar has", s.ops->name);
    status = HAP_ERROR_ARGUMENT;
  }
  hap_device_close(s.device);
  return status;
}
