/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The paper's Fig. 5: a cube of 60 kg runs into a fixed pointer and rebounds; the force over time.
 * Contact begins and ends between ticks: both ends are extrapolated from the two samples next to
 * them, which is as good as exact, as the cube moves nearly straight there. The peak is the
 * largest sample, at 1 kHz at most 2e-5 below that between the samples. */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench.h"
#include "bench/cycles.h"
#include "tools/rig.h"

#define TICKS 1200 /* 1.2 s at 1 kHz: the longest contact and some more */
#define TICK_S 1e-3
#define FORCE_MAX "200" /* N: nothing may be cut */
#define ORACLE_TEXT_MAX 4096

static const double speed = 0.017; /* m/s, of the scene; the paper's section 7.2 */
static const double stiffnesses[] = {1000.0, 3000.0, 10000.0};
#define STIFFNESS_COUNT BENCH_COUNT(stiffnesses)

typedef struct variant {
  const char *name;
  hap_model model;
  hap_impulse_pose pose;
  double physics_hz; /* as written; model SINGLE steps the world at the haptic rate */
  const char *title;
  const char *line; /* gnuplot's */
} variant;

static const variant variants[] = {
    {"single", HAP_MODEL_SINGLE, HAP_IMPULSE_HELD, 1000.0, "1: single, 1 ms",
     "lc rgb '#b8b8b8' lw 6"},
    {"accelerance", HAP_MODEL_ACCELERANCE, HAP_IMPULSE_HELD, 20.0, "2: accelerance, 50 ms", "lt 1"},
    {"impulse_held", HAP_MODEL_IMPULSE, HAP_IMPULSE_HELD, 20.0, "3: impulse, held, 50 ms",
     "lt 3 dt (6,3)"},
    {"impulse_held", HAP_MODEL_IMPULSE, HAP_IMPULSE_HELD, 50.0, "3: impulse, held, 20 ms",
     "lt 6 dt (6,3)"},
    {"impulse_interpolated", HAP_MODEL_IMPULSE, HAP_IMPULSE_INTERPOLATED, 20.0,
     "3: impulse, interpolated, 50 ms", "lt 2 lw 1.8"},
    {"impulse_interpolated", HAP_MODEL_IMPULSE, HAP_IMPULSE_INTERPOLATED, 50.0,
     "3: impulse, interpolated, 20 ms", "lt 5 lw 1.8"},
    {"contact", HAP_MODEL_CONTACT, HAP_IMPULSE_HELD, 20.0, "contact, 50 ms",
     "lc rgb '#000000' dt (2,5)"},
};
#define VARIANT_COUNT BENCH_COUNT(variants)

typedef struct summary {
  double contact_s;
  double peak_n;
  double impulse_ns;
} summary;

typedef struct curve {
  double force[TICKS];
  summary sum;
} curve;

typedef struct figure {
  double mass;
  curve curves[STIFFNESS_COUNT][VARIANT_COUNT];
} figure;

/* ---- the runs ---- */

static hap_status follow_force(rig *r, double force[TICKS])
{
  hap_pointer_state state;
  hap_status status = hap_session_start(r->session);
  for (int i = 0; i < TICKS && status >= HAP_OK; ++i) {
    status = hap_session_advance(r->session, 1);
    if (status >= HAP_OK) {
      status = hap_pointer_get(r->session, r->pointers[0], &state, sizeof state);
    }
    const double *f = state.wrench.force;
    force[i] = status >= HAP_OK ? sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]) : 0.0;
  }
  return status;
}

static hap_status run_variant(bench *b, const variant *v, const scene_parameters *parameters,
                              double force[TICKS])
{
  rig_options options;
  rig r;
  rig_options_init(&options);
  options.parameters = parameters;
  options.devices[0] = "virtual:path=0:0/0/0,hand=rigid,max_force=" FORCE_MAX;
  options.device_count = 1;
  options.max_force = strtod(FORCE_MAX, NULL);
  options.def.drive = HAP_DRIVE_LOCKSTEP;
  options.research.guard = HAP_GUARD_MEASURE;
  options.def.model = v->model;
  options.research.impulse_pose = v->pose;
  options.def.physics_hz = v->model == HAP_MODEL_SINGLE ? 20.0 : v->physics_hz;
  options.def.haptic_hz = 1.0 / TICK_S;
  hap_status status = rig_create(&options, &r, &b->detail);
  if (status < HAP_OK) {
    return status;
  }
  status = bench_explain(b, r.session, follow_force(&r, force));
  rig_destroy(&r);
  return status;
}

/* ---- what a curve amounts to ---- */

/* Time from the first sample to where the line through it and its inner neighbour meets zero. */
static double end_overhang(double outer, double inner)
{
  return inner > outer ? TICK_S * outer / (inner - outer) : 0.0;
}

static summary curve_summarise(const double *force)
{
  summary s = {0.0, 0.0, 0.0};
  int first = -1;
  int last = -1;
  int top = 0;
  for (int i = 0; i < TICKS; ++i) {
    if (force[i] > 0.0) {
      first = first < 0 ? i : first;
      last = i;
    }
    top = force[i] > force[top] ? i : top;
    s.impulse_ns += TICK_S * force[i];
  }
  if (last - first >= 3) {
    s.contact_s = TICK_S * (last - first) + end_overhang(force[first], force[first + 1]) +
                  end_overhang(force[last], force[last - 1]);
  }
  s.peak_n = force[top];
  return s;
}

/* ---- output ---- */

static hap_status write_curves(bench *b, const figure *f)
{
  FILE *csv = bench_csv_open(b, "fig5", "model,t,force_n,stiffness,physics_hz");
  for (size_t k = 0; k < STIFFNESS_COUNT && csv != NULL; ++k) {
    for (size_t v = 0; v < VARIANT_COUNT; ++v) {
      for (int i = 0; i < TICKS; ++i) {
        fprintf(csv, "%s,%.3f,%.9g,%g,%g\n", variants[v].name, TICK_S * i, f->curves[k][v].force[i],
                stiffnesses[k], variants[v].physics_hz);
      }
    }
  }
  return bench_csv_close(b, csv, HAP_OK);
}

static hap_status write_summary(bench *b, const figure *f)
{
  FILE *csv =
      bench_csv_open(b, "fig5_summary", "model,physics_hz,stiffness,contact_s,peak_n,impulse_ns");
  for (size_t k = 0; k < STIFFNESS_COUNT && csv != NULL; ++k) {
    for (size_t v = 0; v < VARIANT_COUNT; ++v) {
      const summary *s = &f->curves[k][v].sum;
      fprintf(csv, "%s,%g,%g,%.7f,%.7f,%.7f\n", variants[v].name, variants[v].physics_hz,
              stiffnesses[k], s->contact_s, s->peak_n, s->impulse_ns);
    }
  }
  return bench_csv_close(b, csv, HAP_OK);
}

static void draw_panel(FILE *script, const figure *f, size_t k)
{
  for (size_t v = 0; v < VARIANT_COUNT; ++v) {
    fprintf(script, "$c%zu << EOD\n", v);
    for (int i = 0; i < TICKS; ++i) {
      fprintf(script, "%.3f %.6g\n", TICK_S * i, f->curves[k][v].force[i]);
    }
    fprintf(script, "EOD\n");
  }
  fprintf(script, "set title 'k = %g kN/m'\n%s\nplot ", 1e-3 * stiffnesses[k],
          k + 1 == STIFFNESS_COUNT ? "set key top right" : "unset key");
  for (size_t v = 0; v < VARIANT_COUNT; ++v) {
    fprintf(script, "%s$c%zu using 1:2 with lines %s title '%s'", v > 0 ? ", " : "", v,
            variants[v].line, variants[v].title);
  }
  fprintf(script, "\n");
}

static void fig5_draw(FILE *script, const void *data)
{
  const figure *f = data;
  fprintf(script,
          "set multiplot layout 3,1\nset xlabel 'time [s]'\n"
          "set ylabel 'force on the cube [N]'\nset xrange [0:1.2]\nset yrange [0:*]\n");
  for (size_t k = 0; k < STIFFNESS_COUNT; ++k) {
    draw_panel(script, f, k);
  }
  fprintf(script, "unset multiplot\n");
}

/* ---- --verify ---- */

static summary closed_form(double mass, double k)
{
  return (summary){3.14159265358979323846 * sqrt(mass / k), speed * sqrt(k * mass),
                   2.0 * mass * speed};
}

/* single, accelerance and contact */
static void check_exact(bench *b, const figure *f, size_t k, size_t v)
{
  const summary *s = &f->curves[k][v].sum;
  summary want = closed_form(f->mass, stiffnesses[k]);
  const struct {
    const char *name;
    double value;
    double wanted;
  } rows[] = {
      {"contact [s]", s->contact_s, want.contact_s},
      {"peak [N]", s->peak_n, want.peak_n},
      {"impulse [N s]", s->impulse_ns, want.impulse_ns},
  };
  /* The spring of model contact shows the ends of a contact over two ticks. */
  double bound = variants[v].model == HAP_MODEL_CONTACT ? 1e-3 : 5e-4;
  for (size_t i = 0; i < BENCH_COUNT(rows); ++i) {
    bench_check(b, bench_within(rows[i].value, rows[i].wanted, bound),
                "k = %5g N/m, %s, %s: %.6f, closed form %.6f (%+.4f %%, bound %g %%)",
                stiffnesses[k], variants[v].name, rows[i].name, rows[i].value, rows[i].wanted,
                bench_percent(rows[i].value, rows[i].wanted), 100.0 * bound);
  }
}

/* The paper's claim for the conventional method, in the form in which poses move between steps. */
static void check_impulse(bench *b, const figure *f, size_t k, size_t v)
{
  const summary *s = &f->curves[k][v].sum;
  const summary *one = &f->curves[k][0].sum;
  double longer = bench_percent(s->contact_s, one->contact_s);
  double larger = bench_percent(s->impulse_ns, one->impulse_ns);
  double higher = bench_percent(s->peak_n, one->peak_n);
  const char *text =
      "k = %5g N/m, %s at %g Hz against single: contact %+.2f %%, impulse %+.2f %%, "
      "peak %+.2f %%%s";
  if (variants[v].pose == HAP_IMPULSE_INTERPOLATED) {
    bench_check(b, longer > 0.0 && larger > 0.0 && higher > 0.0, text, stiffnesses[k],
                variants[v].name, variants[v].physics_hz, longer, larger, higher,
                " (longer and larger)");
  } else if (!b->verify) {
    bench_say(text, stiffnesses[k], variants[v].name, variants[v].physics_hz, longer, larger,
              higher, "");
  }
}

/* Column of a text "a,b,c", from 0; NAN when there is none. */
static double column_of(const char *text, int index)
{
  for (; index > 0 && text != NULL; --index) {
    text = strchr(text, ',');
    text = text != NULL ? text + 1 : NULL;
  }
  return text != NULL && *text != '\0' ? strtod(text, NULL) : (double)NAN;
}

static bool quantity_of(const char *line, const summary *s, double *out)
{
  const char *name = strchr(line, ',');
  if (name == NULL) {
    return false;
  }
  *out = strncmp(name, ",contact_s,", 11) == 0    ? s->contact_s
         : strncmp(name, ",peak_n,", 8) == 0      ? s->peak_n
         : strncmp(name, ",impulse_ns,", 12) == 0 ? s->impulse_ns
                                                  : (double)NAN;
  return isfinite(*out);
}

/* One line of the oracle: columns 5 and 6 are the interpolated form at 20 and at 50 ms. */
static void check_line(bench *b, const figure *f, const char *line)
{
  for (size_t k = 0; k < STIFFNESS_COUNT; ++k) {
    for (size_t v = 0; v < VARIANT_COUNT && column_of(line, 0) == stiffnesses[k]; ++v) {
      double value = 0.0;
      double wanted = column_of(line, variants[v].physics_hz == 50.0 ? 5 : 6);
      if (variants[v].model == HAP_MODEL_IMPULSE && variants[v].pose == HAP_IMPULSE_INTERPOLATED &&
          quantity_of(line, &f->curves[k][v].sum, &value)) {
        int length = (int)strcspn(strchr(line, ',') + 1, ",");
        bench_check(b, bench_within(value, wanted, 0.05),
                    "k = %5g N/m, impulse_interpolated at %g Hz, %.*s: %.4f, oracle %.4f "
                    "(%+.2f %%, bound 5 %%)",
                    stiffnesses[k], variants[v].physics_hz, length, strchr(line, ',') + 1, value,
                    wanted, bench_percent(value, wanted));
      }
    }
  }
}

static void check_oracle(bench *b, const figure *f)
{
  char line[ORACLE_TEXT_MAX];
  const char *shared = getenv("HAPODE_SHARED");
  snprintf(line, sizeof line, "%s/oracles/fig5.csv", shared != NULL ? shared : "../shared");
  FILE *oracle = fopen(line, "r");
  if (oracle == NULL) {
    bench_skip(b, "impulse_interpolated: no oracle (HAPODE_SHARED/oracles/fig5.csv)");
    return;
  }
  while (fgets(line, sizeof line, oracle) != NULL) {
    check_line(b, f, line);
  }
  fclose(oracle);
}

static void fig5_report(bench *b, const figure *f)
{
  for (size_t k = 0; k < STIFFNESS_COUNT; ++k) {
    for (size_t v = 0; v < VARIANT_COUNT; ++v) {
      if (variants[v].model == HAP_MODEL_IMPULSE) {
        check_impulse(b, f, k, v);
      } else {
        check_exact(b, f, k, v);
      }
    }
  }
  check_oracle(b, f);
}

static hap_status fig5_measure(bench *b, figure *f)
{
  scene_parameters parameters = *cycles_scene("fig5");
  f->mass = parameters.mass;
  for (size_t k = 0; k < STIFFNESS_COUNT; ++k) {
    parameters.stiffness = stiffnesses[k];
    for (size_t v = 0; v < VARIANT_COUNT; ++v) {
      curve *c = &f->curves[k][v];
      hap_status status = run_variant(b, &variants[v], &parameters, c->force);
      if (status < HAP_OK) {
        return status;
      }
      c->sum = curve_summarise(c->force);
    }
  }
  return HAP_OK;
}

hap_status bench_fig5(bench *b)
{
  figure *f = calloc(1, sizeof *f);
  if (f == NULL) {
    return bench_fail(b, HAP_ERROR_MEMORY, "no memory for the curves");
  }
  hap_status status = fig5_measure(b, f);
  if (status >= HAP_OK) {
    status = write_curves(b, f);
  }
  if (status >= HAP_OK) {
    status = write_summary(b, f);
  }
  if (status >= HAP_OK) {
    fig5_report(b, f);
    status = bench_draw(b, "fig5", 900, 1000, fig5_draw, f);
  }
  free(f);
  return status;
}
