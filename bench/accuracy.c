/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* hapode-bench accuracy: what accuracy costs in time. Every scene with a prescribed motion of the
 * hand, in every model, against model SINGLE at 1 kHz with 1000 iterations, twice the scene's at least. Columns:
 *
 *   knob, value    what differs from the library's defaults; default: nothing, the worst of ten
 *                  starts that are 1 um to 1 mm apart. operating, operating_cross: probes about the
 *                  operating point, without and with cross accelerance; also the worst start, with
 *                  --quick the first one, and eq4 the default from there
 *                  proxy, god-object, virtual (--coupling): through that, value N/m, all starts
 *   force_rel_rms  RMS of the difference / RMS of the reference, while either is in contact
 *   duty           processor time of physics, contact passes and loop / simulated time
 *   noise_floor    the same error between references at 1 and 2 kHz, at the first start and at the
 *                  worst one of model contact, or 1 um apart
 *   estimate       of force_rel_rms, by looking back in the worst start's session; 0: it has none, with
 *                  --quick beside the default alone, unless --estimates all
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

#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "bench/accuracy.h"

#define REST_BOUND 0.3
#define PEAK_BOUND 1.05
#define POSE_MEDIAN_BOUND 1e-3
#define POSE_MAX_BOUND 5e-3
#define LINE_BOUND_N 5e-3
#define LINE_BOUND 0.002 /* of the force */
#define JOINT_BOUND 1e-4
#define DIAL_ERROR 0.05
#define DIAL_SHARE 0.10
#define DIAL_SLACK 1.1
#define DIAL_ERRORS_APART 3.0
#define DIAL_TICKS_APART 0.9
#define ESTIMATE_FACTOR 3.0
#define ESTIMATE_SHARE 0.9
#define DEGREES (180.0 / M_PI)

static bool is_default(const accuracy_row *row)
{
  return strcmp(row->knob, ACCURACY_DEFAULT) == 0;
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

static hap_status write_table(bench *b, const accuracy_table *table)
{
  FILE *csv = bench_csv_open(b, "accuracy", NULL);
  if (csv != NULL) {
    accuracy_write_header(csv);
  }
  for (size_t i = 0; i < table->count && csv != NULL; ++i) {
    accuracy_write_row(csv, &table->rows[i]);
  }
  return bench_csv_close(b, csv);
}

/* ---- numbers ---- */

/* On errors.force and .torque; 0: none. */
static double bound_of(const accuracy_row *r)
{
  for (size_t i = 0; accuracy_scene_at(i) != NULL; ++i) {
    if (strcmp(accuracy_scene_at(i)->name, r->scene) == 0) {
      return (r->physics_hz == 60.0 ? 0.5 : 1.0) * accuracy_scene_at(i)->bound;
    }
  }
  return 0.0;
}

/* A scene cannot be followed more closely than it follows itself. */
static void check_error(bench *b, const accuracy_row *r, const char *what, double error,
                        double floor)
{
  double of_scene = bound_of(r);
  double bound = fmax(of_scene, 2.0 * floor);
  bench_check(b, error <= bound,
              "%s at %g Hz: %s error %.3f %% (bound %.3f %%%s; noise floor %.3f %%)", r->scene,
              r->physics_hz, what, 100.0 * error, 100.0 * bound,
              bound > of_scene ? ", twice the noise floor" : "", 100.0 * floor);
}

static void check_row(bench *b, const accuracy_row *r)
{
  const accuracy_errors *e = &r->errors;
  double of_scene = bound_of(r);
  double line = fmax(LINE_BOUND_N, LINE_BOUND * e->force_rms);
  if (of_scene > 0.0) {
    check_error(b, r, "force", e->force, r->noise_floor);
  }
  if (of_scene > 0.0 && e->torque > 0.0) {
    check_error(b, r, "torque", e->torque, r->torque_floor);
  }
  bench_check(b, e->peak_ratio <= PEAK_BOUND, "%s at %g Hz: peak ratio %.4f (bound %g)", r->scene,
              r->physics_hz, e->peak_ratio, PEAK_BOUND);
  bench_check(b, e->pose_median <= POSE_MEDIAN_BOUND && e->pose_max <= POSE_MAX_BOUND,
              "%s at %g Hz: local pose %.3f mm, at most %.3f mm (bounds %g and %g mm)", r->scene,
              r->physics_hz, 1e3 * e->pose_median, 1e3 * e->pose_max, 1e3 * POSE_MEDIAN_BOUND,
              1e3 * POSE_MAX_BOUND);
  if (e->lines > 0.0) {
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

/* Whether the session was asked for the row's error, where there is more to it than noise. */
static bool is_estimated(const bench *b, const accuracy_row *r)
{
  return strcmp(r->model, hap_model_name(HAP_MODEL_SINGLE)) != 0 &&
         (accuracy_estimates_all(b) || is_default(r)) && r->errors.force > r->noise_floor;
}

/* Whether what the session says of its error is right; nothing said is wrong. The bound is on the whole table. */
static void check_estimates(bench *b, const accuracy_table *table)
{
  size_t judged = 0;
  size_t good = 0;
  size_t without = 0;
  for (size_t i = 0; i < table->count; ++i) {
    const accuracy_row *r = &table->rows[i];
    if (is_estimated(b, r)) {
      double ratio = r->estimate / r->errors.force;
      ++judged;
      without += r->estimate == 0.0;
      good += ratio >= 1.0 / ESTIMATE_FACTOR && ratio <= ESTIMATE_FACTOR;
    }
  }
  static const char text[] =
      "estimate of the force error: %zu of %zu rows within a factor of %g (%g %% "
      "wanted of all scenes), %zu have none";
  if (b->scene != NULL) {
    bench_skip(b, text, good, judged, ESTIMATE_FACTOR, 100.0 * ESTIMATE_SHARE, without);
  } else {
    bench_check(b, (double)good >= ESTIMATE_SHARE * (double)judged, text, good, judged,
                ESTIMATE_FACTOR, 100.0 * ESTIMATE_SHARE, without);
  }
}

/* What the dial comes to at its default. The haptic thread's share of a core is that of its ticks by the clock,
 * or less where all that the session does takes less of the processor's time. */
static void check_dial(bench *b, const accuracy_row *r)
{
  double ticks = 1e-6 * r->tick_us * r->haptic_hz;
  double share = fmin(ticks, r->duty);
  bench_check(
      b, r->errors.force <= DIAL_ERROR && share <= DIAL_SHARE,
      "%s at %g Hz: the dial at its default: force error %.3g %% (%g %%), %.3g %% of a core "
      "(%g %%)",
      r->scene, r->physics_hz, 100.0 * r->errors.force, 100.0 * DIAL_ERROR, 100.0 * share,
      100.0 * DIAL_SHARE);
}

/* A row of the dial's path, of model contact at the paper's rate; NULL: it was not measured. */
static const accuracy_row *dial_row(const accuracy_table *table, const char *of, double position)
{
  for (size_t i = 0; i < table->count; ++i) {
    const accuracy_row *r = &table->rows[i];
    if (accuracy_row_is(r, HAP_MODEL_CONTACT, ACCURACY_DIAL) && strcmp(r->scene, of) == 0 &&
        r->physics_hz == ACCURACY_PAPER_HZ && r->value == position) {
      return r;
    }
  }
  return NULL;
}

/* Where it ends, of all scenes together. */
typedef struct dial_ends {
  double log_error; /* sums over the scenes: of the error at 0 over that at 1 */
  double log_tick;  /* and of the ticks */
  size_t scenes;
} dial_ends;

/* Turning it up makes no force worse. */
static void check_dial_ends(bench *b, const accuracy_table *table, const accuracy_row *middle,
                            dial_ends *io)
{
  const accuracy_row *least = dial_row(table, middle->scene, 0.0);
  const accuracy_row *most = dial_row(table, middle->scene, 1.0);
  if (least == NULL || most == NULL) {
    return; /* another hand's speed or coupling */
  }
  double floor = middle->noise_floor;
  double bound = fmax(DIAL_SLACK * middle->errors.force, 2.0 * floor);
  bench_check(
      b, most->errors.force <= bound,
      "%s at %g Hz: the dial at 0, its default, 1: force error %.3g, %.3g, %.3g %% (the last "
      "one at most %.3g %%); a tick %.3g, %.3g, %.3g us",
      middle->scene, middle->physics_hz, 100.0 * least->errors.force, 100.0 * middle->errors.force,
      100.0 * most->errors.force, 100.0 * bound, least->tick_us, middle->tick_us, most->tick_us);
  io->log_error += log(fmax(least->errors.force, floor) / fmax(most->errors.force, floor));
  io->log_tick += log(least->tick_us / most->tick_us);
  ++io->scenes;
}

/* That its ends are apart; times of one scene are too short to be judged. */
static void check_dial_apart(bench *b, const dial_ends *ends)
{
  double scenes = (double)ends->scenes;
  static const char text[] =
      "the dial at 0 against 1, geometric means of %zu scenes: force error %.3g x (at least %g in "
      "all scenes), a tick %.3g x (at most %g)";
  double error = exp(ends->log_error / scenes);
  double tick = exp(ends->log_tick / scenes);
  if (ends->scenes > 1) {
    bench_check(b, error >= DIAL_ERRORS_APART && tick <= DIAL_TICKS_APART, text, ends->scenes,
                error, DIAL_ERRORS_APART, tick, DIAL_TICKS_APART);
  } else if (ends->scenes == 1) {
    bench_skip(b, text, ends->scenes, error, DIAL_ERRORS_APART, tick, DIAL_TICKS_APART);
  }
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
  dial_ends ends = {0};
  for (size_t i = 0; i < table->count; ++i) {
    const accuracy_row *r = &table->rows[i];
    bool bounded = r->physics_hz == 20.0 || r->physics_hz == 60.0;
    if (is_default(r) && strcmp(before, r->scene) != 0) {
      before = r->scene;
      check_rest(b, r);
    }
    if (accuracy_row_is(r, HAP_MODEL_CONTACT, ACCURACY_DEFAULT) && bounded) {
      check_row(b, r);
      if (r->physics_hz == ACCURACY_PAPER_HZ) {
        check_dial(b, r);
        check_dial_ends(b, table, r, &ends);
      }
      if (r->joint_floor > 0.0) {
        check_joints(b, r);
      }
    } else if (is_default(r) && bounded) {
      bench_say("%s at %g Hz: %s: force error %.3g %%, peak ratio %.3f", r->scene, r->physics_hz,
                r->model, 100.0 * r->errors.force, r->errors.peak_ratio);
    } else if ((is_way_of_testing(r) || is_coupling(r)) && bounded) {
      bench_say("%s at %g Hz: %s, %s: force error %.3g %%, peak ratio %.3f", r->scene,
                r->physics_hz, r->model, r->knob, 100.0 * r->errors.force, r->errors.peak_ratio);
    }
  }
  check_dial_apart(b, &ends);
  check_estimates(b, table);
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

/* The rows that are there, in the order of the plan. */
static hap_status fill_table(bench *b, const accuracy_plan *plan, const accuracy_row *rows,
                             accuracy_table *out)
{
  hap_status status = HAP_OK;
  for (size_t i = 0; i < plan->count && status >= HAP_OK; ++i) {
    status = accuracy_table_add(b, out, &rows[i]);
  }
  for (size_t i = 0; i < out->count; i += accuracy_rows_of_scene(out, i)) {
    accuracy_mark_front(&out->rows[i], accuracy_rows_of_scene(out, i));
  }
  return status;
}

static hap_status finish(bench *b, const accuracy_plan *plan, const accuracy_row *rows)
{
  accuracy_table table = {0};
  hap_status status = fill_table(b, plan, rows, &table);
  if (status >= HAP_OK) {
    status = write_table(b, &table);
  }
  if (status >= HAP_OK) {
    report(b, &table);
    for (size_t i = 0; i < table.count; i += accuracy_rows_of_scene(&table, i)) {
      accuracy_report_front(&table.rows[i], accuracy_rows_of_scene(&table, i));
    }
    status = b->scene == NULL || strcmp(b->scene, "hold") == 0 ? accuracy_check_hold(b) : HAP_OK;
  }
  if (status >= HAP_OK) {
    status = accuracy_draw(b, &table);
  }
  accuracy_table_free(&table);
  return status;
}

static size_t processors(void)
{
  long count = sysconf(_SC_NPROCESSORS_ONLN);
  return count > 1 ? (size_t)count : 1;
}

static size_t rows_there(const accuracy_plan *plan, const accuracy_row *rows)
{
  size_t there = 0;
  for (size_t i = 0; i < plan->count; ++i) {
    there += rows[i].scene[0] != '\0';
  }
  return there;
}

/* A shard's processes are the scheduler's business: it has one. */
static hap_status measure(bench *b, const accuracy_plan *plan, const accuracy_identity *identity,
                          accuracy_row *rows)
{
  accuracy_work work = {.plan = plan, .shard = identity->shard - 1, .have = rows};
  size_t *shard_of = calloc(plan->group_count + 1, sizeof *shard_of);
  if (shard_of == NULL) {
    return bench_fail(b, HAP_ERROR_MEMORY, "no memory for the plan");
  }
  work.shard_of = shard_of;
  work.processes = b->shards > 0 ? 1 : processors();
  hap_status status = accuracy_deal(b, plan, identity->shards, shard_of);
  if (status >= HAP_OK) {
    status = accuracy_rows_open(b, plan, identity, rows, &work.file);
  }
  if (status >= HAP_OK) {
    size_t there = rows_there(plan, rows);
    if (there > 0) {
      fprintf(stderr, "accuracy: goes on from %zu finished rows; --fresh begins anew\n", there);
    }
    status = accuracy_jobs(b, &work);
    close(work.file);
  }
  free(shard_of);
  return status;
}

static hap_status run(bench *b, const accuracy_plan *plan, accuracy_row *rows)
{
  accuracy_identity identity;
  char path[PATH_MAX];
  hap_status status = accuracy_identify(b, plan, &identity);
  if (status >= HAP_OK) {
    status = measure(b, plan, &identity, rows);
  }
  if (status < HAP_OK || !accuracy_rows_path(b, &identity, path, sizeof path)) {
    return status;
  }
  if (b->shards > 0) {
    bench_say("shard %zu of %zu is done: %s; when all are, hapode-bench accuracy --merge FILE...",
              identity.shard, identity.shards, path);
    return HAP_OK;
  }
  memset(rows, 0, plan->count * sizeof *rows); /* the file has these as well */
  status = accuracy_rows_read(b, path, plan, rows);
  if (status >= HAP_OK) {
    status = finish(b, plan, rows);
  }
  if (status >= HAP_OK) {
    unlink(path); /* the next run measures anew */
  }
  return status;
}

static hap_status say_scenes(bench *b)
{
  char names[400] = "";
  for (size_t i = 0, used = 0; accuracy_scene_at(i) != NULL && used < sizeof names; ++i) {
    used += (size_t)snprintf(names + used, sizeof names - used, " %s", accuracy_scene_at(i)->name);
  }
  return bench_fail(b, HAP_ERROR_NOT_FOUND, "--scene: \"%s\" cannot be measured; of%s",
                    b->scene != NULL ? b->scene : "", names);
}

static hap_status run_or_merge(bench *b)
{
  const accuracy_scene *scenes[ACCURACY_SCENES_MAX];
  accuracy_plan plan = {0};
  size_t count = choose_scenes(b, scenes);
  if (count == 0) {
    return say_scenes(b);
  }
  hap_status status = accuracy_plan_make(b, scenes, count, &plan);
  if (status < HAP_OK) {
    return status;
  }
  accuracy_row *rows = calloc(plan.count + 1, sizeof *rows);
  if (rows == NULL) {
    status = bench_fail(b, HAP_ERROR_MEMORY, "no memory for the rows");
  } else if (b->merge != NULL) {
    status = accuracy_merge(b, &plan, rows);
    status = status >= HAP_OK ? finish(b, &plan, rows) : status;
  } else {
    status = run(b, &plan, rows);
  }
  free(rows);
  accuracy_plan_free(&plan);
  return status;
}

hap_status bench_accuracy(bench *b)
{
  accuracy_settings settings;
  bench merging = *b;
  if (b->merge == NULL) {
    return run_or_merge(b);
  }
  hap_status status = accuracy_merge_settings(b, &settings);
  if (status >= HAP_OK) { /* as the shards were run */
    merging.quick = settings.quick;
    merging.scene = strcmp(settings.scene, "all") != 0 ? settings.scene : NULL;
    merging.estimates = settings.estimates;
    merging.coupling = strcmp(settings.coupling, "none") != 0 ? settings.coupling : NULL;
    status = run_or_merge(&merging);
    b->off = merging.off;
    b->detail = merging.detail;
  }
  return status;
}
