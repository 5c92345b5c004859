/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* hapode-bench poses: what is drawn at 90 Hz of scenes that a hand pushes, against where the
 * loop had hand and bodies at the time that is drawn; and what a call costs in a large world.
 * Columns of poses.csv in mm, see poses_run.h; of poses_cost.csv: bodies, us a call for all of
 * them. */

#include <string.h>

#include "base/clock.h"
#include "bench/bench.h"
#include "bench/poses_run.h"
#include "tools/rig.h"

#define FRAME_HZ 90.0
#define BOUND_MM 0.5
#define BACK_MM 0.01 /* a body that rests trembles by micrometres */

static const hap_model models[] = {HAP_MODEL_SINGLE, HAP_MODEL_IMPULSE, HAP_MODEL_ACCELERANCE,
                                   HAP_MODEL_CONTACT};
static const char *const scenes[] = {"row10", "stack"};
static const double rates[] = {20.0, 60.0, 90.0};

#define MODELS BENCH_COUNT(models)
#define SCENES BENCH_COUNT(scenes)
#define RATES BENCH_COUNT(rates)
#define ROWS (MODELS * SCENES * RATES)

typedef struct poses_row {
  poses_def def;
  poses_result result;
} poses_row;

typedef struct poses_table {
  poses_row rows[ROWS];
  size_t count;
} poses_table;

static hap_status poses_run(bench *b, poses_table *out)
{
  hap_status status = HAP_OK;
  for (size_t i = 0; i < ROWS && status >= HAP_OK; ++i) {
    poses_row *row = &out->rows[out->count];
    const poses_result *r = &row->result;
    row->def = (poses_def){.scene = scenes[i / (MODELS * RATES)],
                           .model = models[i / RATES % MODELS],
                           .physics_hz = rates[i % RATES],
                           .frame_hz = FRAME_HZ,
                           .seconds = i / (MODELS * RATES) == 0 ? 2.0 : 0.8};
    if (b->quick && i % RATES != 1) {
      continue;
    }
    status = poses_measure(&row->def, &row->result, &b->detail);
    if (status >= HAP_OK) {
      ++out->count;
      bench_check(
          b, r->gap_mm <= BOUND_MM && r->hand_mm <= BOUND_MM && r->back_mm <= BACK_MM,
          "%s, %s, physics %g Hz: %zu frames, gaps off by %.3g mm, hand on body by %.3g mm "
          "(bound %g mm; newest hand on drawn body %.3g mm), bodies off their path by %.3g mm, "
          "jumps %.3g mm, back %.3g mm",
          row->def.scene, hap_model_name(row->def.model), row->def.physics_hz, r->frames, r->gap_mm,
          r->hand_mm, BOUND_MM, r->undelayed_mm, r->path_mm, r->jump_mm, r->back_mm);
    }
  }
  return status;
}

static hap_status write_rows(bench *b, const poses_table *table)
{
  const poses_row *rows = table->rows;
  FILE *csv = bench_csv_open(b, "poses",
                             "scene,model,physics_hz,frame_hz,frames,moved_mm,gap_mm,hand_mm,"
                             "undelayed_hand_mm,path_mm,jump_mm,back_mm");
  for (size_t i = 0; i < table->count && csv != NULL; ++i) {
    const poses_result *r = &rows[i].result;
    fprintf(csv, "%s,%s,%g,%g,%zu,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g\n", rows[i].def.scene,
            hap_model_name(rows[i].def.model), rows[i].def.physics_hz, rows[i].def.frame_hz,
            r->frames, r->moved_mm, r->gap_mm, r->hand_mm, r->undelayed_mm, r->path_mm, r->jump_mm,
            r->back_mm);
  }
  return bench_csv_close(b, csv, HAP_OK);
}

static void plot_scene(FILE *script, const poses_table *table, const char *name)
{
  const poses_row *rows = table->rows;
  fprintf(script, "$d << EOD\n");
  for (size_t i = 0; i < table->count; ++i) {
    if (strcmp(rows[i].def.scene, name) == 0) {
      const poses_result *r = &rows[i].result;
      fprintf(script, "\"%s %g Hz\" %.6g %.6g %.6g\n", hap_model_name(rows[i].def.model),
              rows[i].def.physics_hz, r->gap_mm, r->hand_mm, r->undelayed_mm);
    }
  }
  fprintf(script,
          "EOD\nset title '%s'\nplot %g with lines lc rgb '#909090' dt 2 title 'bound', "
          "$d using 0:(floor_of($2)):xtic(1) with points pt 7 title 'gaps between bodies', "
          "$d using 0:(floor_of($3)) with points pt 5 title 'hand on body', "
          "$d using 0:(floor_of($4)) with points pt 8 title 'newest hand on drawn body'\n",
          name, BOUND_MM);
}

static void poses_draw(FILE *script, const void *data)
{
  fprintf(script,
          "set multiplot layout 2,1 title 'Drawn at 90 Hz against the loop at the same time'\n"
          "set logscale y\nset yrange [1e-6:100]\nset ylabel 'largest error [mm]'\n"
          "set format y '%%g'\nset offsets 0.5, 0.5, 0, 0\n"
          "set xtics rotate by -25 font ',8'\nset key outside right top font ',8'\n"
          "floor_of(x) = x < 1e-6 ? 1e-6 : x\n");
  for (size_t i = 0; i < SCENES; ++i) {
    plot_scene(script, data, scenes[i]);
  }
  fprintf(script, "unset multiplot\n");
}

/* ---- cost ---- */

#define COST_BODIES_MAX 4000

typedef struct crowd {
  dWorldID world;
  dSpaceID space;
  dBodyID bodies[COST_BODIES_MAX];
  hap_session *session;
} crowd;

/* Balls that fly apart from each other and turn: none is near the hand, all are interpolated. */
static hap_status crowd_open(bench *b, int count, crowd *c)
{
  hap_session_def def;
  hap_ode_def ode;
  hap_session_def_init(&def, sizeof def);
  hap_ode_def_init(&ode, sizeof ode);
  c->world = dWorldCreate();
  c->space = dHashSpaceCreate(NULL);
  for (int i = 0; i < count; ++i) {
    c->bodies[i] = dBodyCreate(c->world);
    dGeomSetBody(dCreateSphere(c->space, 0.01), c->bodies[i]);
    const int cell[3] = {i % 20, i / 20 % 20, i / 400};
    dBodySetPosition(c->bodies[i], 0.1 * cell[0], 0.1 * cell[1], 0.1 * cell[2]);
    dBodySetLinearVel(c->bodies[i], 0.0, 0.0, 0.2);
    dBodySetAngularVel(c->bodies[i], 1.0, 2.0, 3.0);
  }
  ode.world = c->world;
  ode.space = c->space;
  def.drive = HAP_DRIVE_LOCKSTEP;
  hap_status status = hap_session_create(&def, &ode, &c->session, &b->detail);
  status = status >= HAP_OK ? hap_session_start(c->session) : status;
  return status >= HAP_OK ? hap_session_advance(c->session, 101) : status;
}

static hap_status cost_of(bench *b, int count, double *out_us)
{
  static crowd c;
  static hap_pose poses[COST_BODIES_MAX];
  double times[101];
  memset(&c, 0, sizeof c);
  hap_status status = crowd_open(b, count, &c);
  for (size_t i = 0; i < 101 && status >= HAP_OK; ++i) {
    int64_t begin = hapi_clock_now();
    status = hap_session_poses(c.session, hap_session_now(c.session) + (int64_t)i * 10000, c.bodies,
                               (size_t)count, poses);
    times[i] = 1e-3 * (double)(hapi_clock_now() - begin);
  }
  *out_us = status >= HAP_OK ? bench_median(times, 101) : 0.0;
  hap_session_destroy(c.session);
  dSpaceDestroy(c.space);
  dWorldDestroy(c.world);
  return status;
}

static hap_status measure_cost(bench *b)
{
  static const int counts[] = {1, 10, 100, 1000, COST_BODIES_MAX};
  FILE *csv = bench_csv_open(b, "poses_cost", "bodies,call_us");
  hap_status status = csv != NULL ? HAP_OK : HAP_ERROR_IO;
  for (size_t i = 0; i < BENCH_COUNT(counts) && status >= HAP_OK; ++i) {
    double us = 0.0;
    status = cost_of(b, counts[i], &us);
    if (status >= HAP_OK) {
      bench_say("%d bodies that fly: %.1f us a call", counts[i], us);
      fprintf(csv, "%d,%.4g\n", counts[i], us);
    }
  }
  return bench_csv_close(b, csv, status);
}

hap_status bench_poses(bench *b)
{
  static poses_table table;
  memset(&table, 0, sizeof table);
  hap_status status = poses_run(b, &table);
  status = status >= HAP_OK ? measure_cost(b) : status;
  status = status >= HAP_OK ? write_rows(b, &table) : status;
  return status >= HAP_OK ? bench_draw(b, "poses", 1000, 760, poses_draw, &table) : status;
}
