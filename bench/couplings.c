/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bench/accuracy.h"
#include "bench/cycles.h"
#include "bench/impedance.h"

/* hapode-bench couplings: the library's own couplings and the two that the literature knows,
 * side by side. In the scenes the coupling's spring and damper are those of the scene's
 * contacts, so that the hand feels a wall as the reference has it, but through a proxy half as
 * stiff. */

#define COUPLINGS 4
#define COUPLINGS_SCENES 4

static const hap_coupling couplings_compared[COUPLINGS] = {
    HAP_COUPLING_DIRECT, HAP_COUPLING_PROXY, HAP_COUPLING_VIRTUAL, HAP_COUPLING_GOD_OBJECT};
static const char *const couplings_scenes[COUPLINGS_SCENES] = {"slide", "row10", "wedge", "peg"};

typedef struct couplings_cell {
  accuracy_errors errors; /* against model single without a coupling */
  double deepest;         /* m, of the pointer in bodies */
  double tick_us;
} couplings_cell;

typedef struct couplings_column {
  couplings_cell scenes[COUPLINGS_SCENES];
  double stiffness; /* N/m, the most that a desktop stylus holds and feels */
  double mass;      /* kg, felt in the air */
  double damping;   /* N s/m, likewise */
} couplings_column;

typedef struct couplings_table {
  couplings_column columns[COUPLINGS];
  accuracy_motion reference; /* of the first scene, and with the couplings: for the picture */
  accuracy_motion motions[COUPLINGS];
} couplings_table;

#define DEPTH_LEAST 1e-6 /* mm, where the axis ends */

static void put_force(FILE *script, const accuracy_motion *m)
{
  for (size_t t = 0; t < m->count; t += 4) {
    const double *f = m->frames[t].force[0];
    fprintf(script, "%.4g %.5g\n", (double)t / ACCURACY_HAPTIC_HZ,
            sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]));
  }
  fprintf(script, "EOD\n");
}

static void draw_forces(FILE *script, const couplings_table *table)
{
  fprintf(script, "$r << EOD\n");
  put_force(script, &table->reference);
  for (size_t c = 0; c < COUPLINGS; ++c) {
    fprintf(script, "$f%zu << EOD\n", c);
    put_force(script, &table->motions[c]);
  }
  fprintf(script,
          "set title 'scene %s: force on the hand'\nset xlabel 't [s]'\nset ylabel '[N]'\n"
          "set key bottom right\nplot $r with lines lc rgb '#a0a0a0' lw 4 title 'single, direct'",
          couplings_scenes[0]);
  for (size_t c = 0; c < COUPLINGS; ++c) {
    fprintf(script, ", $f%zu with lines lt %zu title '%s'", c, c + 1,
            hap_coupling_name(couplings_compared[c]));
  }
  fprintf(script, "\n");
}

/* Bars, a group for each scene. */
static void draw_scenes(FILE *script, const couplings_table *table, bool depths)
{
  fprintf(script, "$s << EOD\n");
  for (size_t i = 0; i < COUPLINGS_SCENES; ++i) {
    fprintf(script, "%s", couplings_scenes[i]);
    for (size_t c = 0; c < COUPLINGS; ++c) {
      const couplings_cell *cell = &table->columns[c].scenes[i];
      double depth = fmax(1e3 * cell->deepest, 1.2 * DEPTH_LEAST);
      fprintf(script, " %.6g", depths ? depth : 100.0 * cell->errors.force);
    }
    fprintf(script, "\n");
  }
  fprintf(script,
          "EOD\nset style data histograms\nset style fill solid 0.8\nset xlabel ''\n"
          "set logscale y\nset format y '10^{%%L}'\nset key top right\n");
  if (depths) {
    fprintf(
        script,
        "set title 'deepest of the pointer in bodies'\nset ylabel '[mm]'\nset yrange [%g:1e4]\n",
        DEPTH_LEAST);
  } else {
    fprintf(script,
            "set title 'force error against single'\nset ylabel '[%%]'\n"
            "set yrange [0.001:1e5]\n");
  }
  fprintf(script, "plot ");
  for (size_t c = 0; c < COUPLINGS; ++c) {
    fprintf(script, "%s$s using %zu:xtic(1) lt %zu title '%s'", c > 0 ? ", " : "", c + 2, c + 1,
            hap_coupling_name(couplings_compared[c]));
  }
  fprintf(script, "\nunset logscale y\nset format y '%%g'\nset yrange [*:*]\n");
}

static void draw_device(FILE *script, const couplings_table *table)
{
  fprintf(script, "$d << EOD\n");
  for (size_t c = 0; c < COUPLINGS; ++c) {
    const couplings_column *column = &table->columns[c];
    fprintf(script, "\"%s\\n%.0f g in the air\" %.6g\n", hap_coupling_name(couplings_compared[c]),
            fabs(1e3 * column->mass), column->stiffness);
  }
  fprintf(script,
          "EOD\nset title 'stiffest wall that a desktop stylus holds and feels'\n"
          "set ylabel '[N/m]'\nset yrange [0:800]\nset bmargin 4\n"
          "plot $d using 2:xtic(1) lt 2 notitle, $d using 0:2:(sprintf('%%.0f', $2)) with labels "
          "offset 0,0.7 notitle\n");
}

static void couplings_draw(FILE *script, const void *data)
{
  const couplings_table *table = data;
  fprintf(script, "set multiplot layout 2,2\n");
  draw_forces(script, table);
  draw_scenes(script, table, false);
  draw_scenes(script, table, true);
  draw_device(script, table);
  fprintf(script, "unset multiplot\n");
}

#define PHYSICS_HZ 60.0
#define ITERATIONS 1000 /* of the reference */
#define ITERATIONS_QUICK 200
#define SHIFT 1e-5   /* m, against the hand: nothing touches by luck */
#define AIR_HZ 2.0   /* well below the resonance of tool and spring */
#define AIR_WAY 0.01 /* m */
#define AIR_STIFFNESS 2000.0
#define AIR_DAMPING 5.0
#define AIR_SETTLE 2000 /* ticks */
#define AIR_TICKS 1000  /* two periods */
#define TOOL_MASS 0.1   /* kg, the library's default */
#define MASS_BOUND 0.02
#define DEPTH_SHARE 0.01 /* of a pointer that does not give, of that of a direct one */

/* ---- scenes ---- */

static hap_status scene_run(bench *b, const scene_parameters *which, hap_model model,
                            hap_coupling coupling, accuracy_motion *out)
{
  accuracy_run_def def;
  scene_parameters parameters = *which;
  char hand[ACCURACY_SPEC_MAX];
  if (!accuracy_hand(which->hands[0], 1.0, hand, sizeof hand)) {
    return bench_fail(b, HAP_ERROR_ARGUMENT, "%s: no hand can be made of \"%s\"", which->name,
                      which->hands[0]);
  }
  accuracy_run_def_init(&def);
  parameters.shift[0] = -SHIFT;
  if (model == HAP_MODEL_SINGLE) {
    parameters.iterations = b->quick ? ITERATIONS_QUICK : ITERATIONS;
  }
  def.parameters = &parameters;
  def.hands[0] = hand;
  def.seconds = which->duration;
  def.session.model = model;
  def.session.physics_hz = PHYSICS_HZ;
  def.coupling = coupling;
  if (coupling != HAP_COUPLING_DIRECT) {
    def.coupling_stiffness = which->stiffness;
    def.coupling_damping = which->damping;
  }
  return accuracy_run(b, &def, out);
}

static hap_status measure_scene(bench *b, size_t index, couplings_table *table)
{
  const scene_parameters *which = cycles_scene(couplings_scenes[index]);
  accuracy_motion reference = {.count = 0};
  hap_status status = scene_run(b, which, HAP_MODEL_SINGLE, HAP_COUPLING_DIRECT, &reference);
  for (size_t c = 0; c < COUPLINGS && status >= HAP_OK; ++c) {
    couplings_cell *cell = &table->columns[c].scenes[index];
    accuracy_motion motion = {.count = 0};
    status = scene_run(b, which, HAP_MODEL_CONTACT, couplings_compared[c], &motion);
    if (status >= HAP_OK &&
        !accuracy_compare(&reference, &motion, NULL, PHYSICS_HZ, &cell->errors)) {
      status = bench_fail(b, HAP_ERROR_STATE, "%s: the hand touches nothing", which->name);
    }
    cell->deepest = motion.deepest;
    cell->tick_us = motion.stats.loop.tick_us_mean;
    if (index == 0) {
      table->motions[c] = motion;
    } else {
      accuracy_motion_free(&motion);
    }
  }
  if (index == 0) {
    table->reference = reference;
  } else {
    accuracy_motion_free(&reference);
  }
  return status;
}

/* ---- in the air ---- */

static hap_status measure_air(bench *b, hap_coupling coupling, couplings_column *out)
{
  port p;
  char device[256];
  const double w = 2.0 * M_PI * AIR_HZ;
  port_def def = {.body = PORT_WALL,
                  .device = device,
                  .model = HAP_MODEL_CONTACT,
                  .coupling = coupling,
                  .stiffness = AIR_STIFFNESS};
  if (coupling != HAP_COUPLING_DIRECT) {
    def.coupling_stiffness = AIR_STIFFNESS;
    def.coupling_damping = AIR_DAMPING;
  }
  snprintf(device, sizeof device,
           "virtual:path=0:0/0/-0.2,sine=0/0/%g,hz=%g,hand=rigid,max_force=" PORT_FORCE_MAX,
           AIR_WAY, AIR_HZ);
  hap_status status = port_open(b, &def, &p);
  if (status < HAP_OK) {
    return status;
  }
  impedance_sums s = {.ticks = AIR_TICKS, .periods = AIR_HZ * PORT_TICK_S * AIR_TICKS};
  status = impedance_listen(b, &p, AIR_SETTLE, &s);
  out->mass = -creal(s.force / s.motion) / (w * w);
  out->damping = cimag(s.force / s.motion) / w;
  port_close(&p);
  return status;
}

/* ---- all ---- */

static hap_status table_write(bench *b, const couplings_table *table)
{
  FILE *csv = bench_csv_open(b, "couplings",
                             "coupling,scene,force_rel_rms,torque_rel_rms,peak_ratio,"
                             "penetration_mm,tick_us,stable_stiffness,mass_felt,damping_felt");
  for (size_t c = 0; c < COUPLINGS && csv != NULL; ++c) {
    const couplings_column *column = &table->columns[c];
    const char *name = hap_coupling_name(couplings_compared[c]);
    for (size_t i = 0; i < COUPLINGS_SCENES; ++i) {
      const couplings_cell *cell = &column->scenes[i];
      fprintf(csv, "%s,%s,%.6g,%.6g,%.6g,%.6g,%.4g,,,\n", name, couplings_scenes[i],
              cell->errors.force, cell->errors.torque, cell->errors.peak_ratio, 1e3 * cell->deepest,
              cell->tick_us);
    }
    fprintf(csv, "%s,stylus,,,,,,%.6g,,\n", name, column->stiffness);
    fprintf(csv, "%s,air,,,,,,,%.6g,%.6g\n", name, column->mass, column->damping);
  }
  return bench_csv_close(b, csv, HAP_OK);
}

static void couplings_report(bench *b, const couplings_table *table)
{
  for (size_t c = 0; c < COUPLINGS; ++c) {
    const couplings_column *column = &table->columns[c];
    const char *name = hap_coupling_name(couplings_compared[c]);
    bool rigid = couplings_compared[c] == HAP_COUPLING_VIRTUAL ||
                 couplings_compared[c] == HAP_COUPLING_GOD_OBJECT;
    for (size_t i = 0; i < COUPLINGS_SCENES; ++i) {
      const couplings_cell *cell = &column->scenes[i];
      double most = rigid ? DEPTH_SHARE * table->columns[0].scenes[i].deepest : HUGE_VAL;
      bench_check(
          b, cell->deepest <= most,
          "%s, %s: force error %.3g %%, peak ratio %.3f, %.4g mm in the bodies, tick %.2f us", name,
          couplings_scenes[i], 100.0 * cell->errors.force, cell->errors.peak_ratio,
          1e3 * cell->deepest, cell->tick_us);
    }
    double mass = couplings_compared[c] == HAP_COUPLING_VIRTUAL ? TOOL_MASS : 0.0;
    bench_check(b, fabs(column->mass - mass) <= MASS_BOUND * TOOL_MASS,
                "%s: in the air %.4f kg and %.4f N s/m", name, column->mass, column->damping);
    bench_say("%s: a desktop stylus holds %.4g N/m", name, column->stiffness);
  }
}

hap_status bench_couplings(bench *b)
{
  couplings_table table;
  hap_status status = HAP_OK;
  memset(&table, 0, sizeof table);
  for (size_t i = 0; i < COUPLINGS_SCENES && status >= HAP_OK; ++i) {
    status = measure_scene(b, i, &table);
  }
  for (size_t c = 0; c < COUPLINGS && status >= HAP_OK; ++c) {
    couplings_column *column = &table.columns[c];
    status = zwidth_of_coupling(b, couplings_compared[c], &column->stiffness);
    if (status >= HAP_OK) {
      status = measure_air(b, couplings_compared[c], column);
    }
  }
  status = status >= HAP_OK ? table_write(b, &table) : status;
  if (status >= HAP_OK) {
    couplings_report(b, &table);
    status = bench_draw(b, "couplings", 1100, 800, couplings_draw, &table);
  }
  accuracy_motion_free(&table.reference);
  for (size_t c = 0; c < COUPLINGS; ++c) {
    accuracy_motion_free(&table.motions[c]);
  }
  return status;
}
