/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* hapode-bench accuracy: what accuracy costs in time. Every scene with a prescribed motion of the
 * hand, in every model, against model SINGLE at 1 kHz with 1000 iterations. Columns:
 *
 *   knob, value    what differs from the library's defaults; default: nothing, the worst of ten
 *                  starts that are 1 um to 1 mm apart. operating, operating_cross: probes about the
 *                  operating point, without and with cross accelerance; also the worst start, with
 *                  --quick the first one, and eq4 the default from there
 *                  proxy, god-object, virtual (--coupling): through that, value N/m, all starts
 *   force_rel_rms  RMS of the difference / RMS of the reference, while either is in contact
 *   duty           computing time of all threads / simulated time
 *   noise_floor    the same error between references at 1 and 2 kHz, at the first start and at the
 *                  worst one of model contact, or 1 um apart
 *   estimate       0, reserved
 *   pose_*_mm      distance of the bodies that the loop moves from their reference
 *   sync_line_n    largest line of the difference at the physics rate and 5 harmonics, above what
 *                  is half way to the next ones and, in rows "default" of model contact, above what a
 *                  run at 1.3 times that rate has there; 0 when contact is shorter than 4 steps
 *   rest_share     of the ticks with contact, those in which no hand moves
 *   start_um       the worst start
 *   torque_*       as force_rel_rms and noise_floor, of the torque; 0: the hands feel none
 *   joint_*        the widest any joint opens at any tick, from anchor to anchor, and of those that slide
 *                  across the axis; 0: no joints. open: between bodies that the loop moves, in the loop;
 *                  world: of the same in ODE's world; left: there, of the others, which ODE alone
 *                  moves; floor: in the world of the references; turn: of axes, or of bodies that
 *                  cannot turn, the largest of open and world */

#include <math.h>
#include <string.h>

#include "bench/accuracy.h"

#define REST_BOUND 0.3
#define PEAK_BOUND 1.05
#define POSE_MEDIAN_BOUND 1e-3
#define POSE_MAX_BOUND 5e-3
#define LINE_BOUND_N 5e-3
#define LINE_BOUND 0.002 /* of the force */
#define JOINT_BOUND 1e-4
#define DEGREES (180.0 / M_PI)

static const char header[] =
    "scene,model,physics_hz,knob,value,force_rel_rms,impulse_ratio,peak_ratio,tick_us,physics_ms,"
    "duty,haptic_hz,noise_floor,estimate,hand,pose_error_mm,sync_line_n,hand_speed,pose_median_mm,"
    "force_rms_n,rest_share,start_um,torque_rel_rms,torque_floor,"
    "joint_open_mm,joint_world_mm,joint_left_mm,joint_floor_mm,joint_turn_deg";

static bool is_default(const accuracy_row *row)
{
  return strcmp(row->knob, "default") == 0;
}

static bool is_way_of_testing(const accuracy_row *row)
{
  return strcmp(row->knob, ACCURACY_EQ4) == 0 || strcmp(row->knob, ACCURACY_OPERATING) == 0 ||
         strcmp(row->knob, ACCURACY_CROSS) == 0;
}

static bool is_coupling(const accuracy_row *row)
{
  hap_coupling coupling;
  return bench_find_coupling(row->knob, &coupling);
}

static void write_row(FILE *csv, const accuracy_row *r)
{
  const accuracy_errors *e = &r->errors;
  fprintf(csv, "%s,%s,%g,%s,%g,%.6g,%.6g,%.6g,", r->scene, hap_model_name(r->model), r->physics_hz,
          r->knob, r->value, e->force, e->impulse_ratio, e->peak_ratio);
  fprintf(csv, "%.4g,%.4g,%.4g,%g,%.6g,0,%s,", r->tick_us, r->physics_ms, r->duty, r->haptic_hz,
          r->noise_floor, r->hand);
  fprintf(csv, "%.5g,%.5g,%.4g,%.5g,%.4g,%.3g,%g,%.6g,%.6g,", 1e3 * e->pose_max, e->line_n,
          r->hand_speed, 1e3 * e->pose_median, e->force_rms, r->rest_share, r->start_um, e->torque,
          r->torque_floor);
  fprintf(csv, "%.4g,%.4g,%.4g,%.4g,%.4g\n", 1e3 * e->joint_loop, 1e3 * e->joint_world,
          1e3 * e->joint_left, 1e3 * r->joint_floor, DEGREES * e->joint_turn);
}

static hap_status write_table(bench *b, const accuracy_table *table)
{
  FILE *csv = bench_csv_open(b, "accuracy", header);
  for (size_t i = 0; i < table->count && csv != NULL; ++i) {
    write_row(csv, &table->rows[i]);
  }
  return bench_csv_close(b, csv);
}

/* ---- numbers ---- */

/* A scene cannot be followed more closely than it follows itself. */
static void check_error(bench *b, const accuracy_row *r, const char *what, double error,
                        double floor)
{
  double bound = fmax(r->bound, 2.0 * floor);
  bench_check(b, error <= bound,
              "%s at %g Hz: %s error %.3f %% (bound %.3f %%%s; noise floor %.3f %%)", r->scene,
              r->physics_hz, what, 100.0 * error, 100.0 * bound,
              bound > r->bound ? ", twice the noise floor" : "", 100.0 * floor);
}

static void check_row(bench *b, const accuracy_row *r)
{
  const accuracy_errors *e = &r->errors;
  double line = fmax(LINE_BOUND_N, LINE_BOUND * e->force_rms);
  if (r->bound > 0.0) {
    check_error(b, r, "force", e->force, r->noise_floor);
  }
  if (r->bound > 0.0 && e->torque > 0.0) {
    check_error(b, r, "torque", e->torque, r->torque_floor);
  }
  bench_check(b, e->peak_ratio <= PEAK_BOUND, "%s at %g Hz: peak ratio %.4f (bound %g)", r->scene,
              r->physics_hz, e->peak_ratio, PEAK_BOUND);
  bench_check(b, e->pose_median <= POSE_MEDIAN_BOUND && e->pose_max <= POSE_MAX_BOUND,
              "%s at %g Hz: local pose %.3f mm, at most %.3f mm (bounds %g and %g mm)", r->scene,
              r->physics_hz, 1e3 * e->pose_median, 1e3 * e->pose_max, 1e3 * POSE_MEDIAN_BOUND,
              1e3 * POSE_MAX_BOUND);
  if (e->lines) {
    bench_check(b, e->line_n <= line, "%s at %g Hz: line %.2f mN (bound %.2f mN)", r->scene,
                r->physics_hz, 1e3 * e->line_n, 1e3 * line);
  } else {
    bench_skip(b, "%s at %g Hz: line: contact is shorter than 4 steps", r->scene, r->physics_hz);
  }
}

static void check_joints(bench *b, const accuracy_row *r)
{
  const accuracy_errors *e = &r->errors;
  bench_check(b, e->joint_loop <= JOINT_BOUND && e->joint_world <= JOINT_BOUND,
              "%s at %g Hz: joints open by %.3g mm in the loop, %.3g mm in the world (bound %g mm; "
              "reference %.3g mm, left to ODE alone %.3g mm), and turn by %.2g degrees",
              r->scene, r->physics_hz, 1e3 * e->joint_loop, 1e3 * e->joint_world, 1e3 * JOINT_BOUND,
              1e3 * r->joint_floor, 1e3 * e->joint_left, DEGREES * e->joint_turn);
}

static void check_rest(bench *b, const accuracy_row *r)
{
  bench_check(b, r->rest_share <= REST_BOUND,
              "%s: the hand rests in %.1f %% of the contact (%g %%)", r->scene,
              100.0 * r->rest_share, 100.0 * REST_BOUND);
}

static void report(bench *b, const accuracy_table *table)
{
  const char *before = "";
  for (size_t i = 0; i < table->count; ++i) {
    const accuracy_row *r = &table->rows[i];
    bool bounded = r->physics_hz == 20.0 || r->physics_hz == 60.0;
    if (is_default(r) && strcmp(before, r->scene) != 0) {
      before = r->scene;
      check_rest(b, r);
    }
    if (is_default(r) && r->model == HAP_MODEL_CONTACT && bounded) {
      check_row(b, r);
      if (r->joints > 0) {
        check_joints(b, r);
      }
    } else if (is_default(r) && bounded) {
      bench_say("%s at %g Hz: %s: force error %.3g %%, peak ratio %.3f", r->scene, r->physics_hz,
                hap_model_name(r->model), 100.0 * r->errors.force, r->errors.peak_ratio);
    } else if ((is_way_of_testing(r) || is_coupling(r)) && bounded) {
      bench_say("%s at %g Hz: %s, %s: force error %.3g %%, peak ratio %.3f", r->scene,
                r->physics_hz, hap_model_name(r->model), r->knob, 100.0 * r->errors.force,
                r->errors.peak_ratio);
    }
  }
}

/* ---- the program ---- */

/* The recording may be absent: then its scene is left out, and a line says so. */
static bool can_run(bench *b, const accuracy_scene *which)
{
  char spec[ACCURACY_SPEC_MAX];
  if (which->recording == NULL || accuracy_recorded_hand(b, which, spec, sizeof spec) >= HAP_OK) {
    return true;
  }
  bench_skip(b, "%s: %s", which->name, b->detail.text);
  return false;
}

static size_t choose_scenes(bench *b, const accuracy_scene **out)
{
  size_t count = 0;
  for (size_t i = 0; accuracy_scene_at(i) != NULL && count < ACCURACY_SCENES_MAX; ++i) {
    const accuracy_scene *which = accuracy_scene_at(i);
    bool asked = b->scene == NULL || strcmp(b->scene, which->name) == 0;
    if (asked && can_run(b, which)) {
      out[count] = which;
      ++count;
    }
  }
  return count;
}

hap_status bench_accuracy(bench *b)
{
  const accuracy_scene *scenes[ACCURACY_SCENES_MAX];
  accuracy_table table = {0};
  size_t count = choose_scenes(b, scenes);
  if (count == 0) {
    return bench_fail(b, HAP_ERROR_NOT_FOUND, "no scene \"%s\"", b->scene != NULL ? b->scene : "");
  }
  hap_status status = accuracy_jobs(b, scenes, count, &table);
  if (status >= HAP_OK) {
    status = write_table(b, &table);
  }
  if (status >= HAP_OK) {
    report(b, &table);
    status = b->scene == NULL || strcmp(b->scene, "hold") == 0 ? accuracy_check_hold(b) : HAP_OK;
  }
  if (status >= HAP_OK) {
    status = accuracy_draw(b, &table);
  }
  accuracy_table_free(&table);
  return status;
}
