/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A rigid hand moves the device by a sine, about a place at which the contact stays closed. Force and
 * motion are taken at the ticks, as the device reads and is given them, over whole periods after all
 * else has died away. Truth is the closed form in continuous time; what ticks make of it is a second
 * closed form, to which model contact is held closely. That a device holds a force until the next tick is no part of it: the hand feels
 * everything another half tick later. */

#include "bench/impedance.h"

#include <math.h>
#include <stdlib.h>

#define HZ_LEAST 0.5
#define HZ_MOST 200.0
#define POINTS_QUICK 10
#define SETTLE_TICKS 5000   /* 15 time constants of the free body behind contact and coupling */
#define WINDOW_S 1.0        /* measured, at least */
#define PERIODS_LEAST 2.0   /* measured, at least */
#define AMPLITUDE_MOST 1e-3 /* m */
#define FORCE_SHARE 0.3     /* of the preload: the contact stays closed */
#define COUPLING_STIFFNESS 3200.0
#define COUPLING_DAMPING 0.2
#define VARIANT_COUPLED 1
#define TOOL_MASS 0.1 /* kg, of a virtual tool: the library's default */
#define FIT_HZ 50.0
#define FIT_BOUND 0.01
#define FIT_BOUND_PROXY 0.02 /* its velocities are half a tick old */
#define SAMPLED_BOUND 1e-3
#define TURNING_BOUND 0.02 /* of a flap through a proxy */
#define STEADY 0.05        /* of the residual: above it the force is no sine, and Z says little */

impedance_variant impedance_variants[IMPEDANCE_VARIANTS] = {
    {"contact", HAP_MODEL_CONTACT, HAP_COUPLING_DIRECT},
    {"contact, proxy", HAP_MODEL_CONTACT, HAP_COUPLING_PROXY},
    {"accelerance", HAP_MODEL_ACCELERANCE, HAP_COUPLING_DIRECT},
    {"impulse", HAP_MODEL_IMPULSE, HAP_COUPLING_DIRECT},
    {"single", HAP_MODEL_SINGLE, HAP_COUPLING_DIRECT},
};

/* ---- one frequency ---- */

typedef struct sums {
  size_t ticks;
  double periods;
  double complex force;
  double complex motion;
  double force_mean;
  double force_square;
  size_t touching;
} sums;

/* Whole periods in whole ticks, near the wanted frequency. */
static double choose_window(double hz, sums *s)
{
  s->periods = fmax(PERIODS_LEAST, ceil(WINDOW_S * hz));
  s->ticks = (size_t)lround(s->periods / hz * PORT_HAPTIC_HZ);
  return s->periods / (double)s->ticks * PORT_HAPTIC_HZ;
}

static hap_status settle(bench *b, port *p)
{
  hap_status status = HAP_OK;
  for (int i = 0; i < SETTLE_TICKS && status >= HAP_OK; ++i) {
    status = port_advance(b, p);
  }
  return status;
}

static hap_status listen(bench *b, port *p, sums *s)
{
  hap_status status = HAP_OK;
  for (size_t i = 0; i < s->ticks && status >= HAP_OK; ++i) {
    status = port_advance(b, p);
    double turns = fmod(s->periods * (double)i, (double)s->ticks) / (double)s->ticks;
    double complex wave = cexp(-2.0 * M_PI * I * turns);
    double force = -p->state.wrench.force[2];
    s->force += force * wave;
    s->motion += p->state.device.position[2] * wave;
    s->force_mean += force;
    s->force_square += force * force;
    s->touching += p->state.contacts > 0;
  }
  return status;
}

static void conclude(const sums *s, impedance_point *out)
{
  double count = (double)s->ticks;
  double mean = s->force_mean / count;
  double all = s->force_square / count - mean * mean;
  double wave = 2.0 * cabs(s->force) * cabs(s->force) / (count * count);
  out->felt = s->force / s->motion;
  out->residual = wave > 0.0 ? sqrt(fmax(0.0, all - wave) / wave) : 0.0;
  out->contact_share = (double)s->touching / count;
}

static hap_status measure_point(bench *b, const port_def *common, double hz,
                                const impedance_truth *truth, impedance_point *out)
{
  port p;
  port_def def = *common;
  sums s = {0};
  char device[256];
  double preload = impedance_cases[def.body].preload;
  double depth = preload / IMPEDANCE_STIFFNESS;
  if (truth->coupling_stiffness > 0.0) {
    depth += preload / truth->coupling_stiffness;
  }
  out->hz = choose_window(hz, &s);
  out->amplitude = fmin(AMPLITUDE_MOST, FORCE_SHARE * preload / cabs(impedance_of(truth, out->hz)));
  snprintf(device, sizeof device,
           "virtual:path=0:0/0/%.17g,sine=0/0/%.17g,hz=%.17g,hand=rigid,max_force=" PORT_FORCE_MAX,
           depth - PORT_RADIUS, out->amplitude, out->hz);
  def.device = device;
  hap_status status = port_open(b, &def, &p);
  if (status < HAP_OK) {
    return status;
  }
  status = settle(b, &p);
  if (status >= HAP_OK) {
    status = listen(b, &p, &s);
  }
  if (status >= HAP_OK) {
    conclude(&s, out);
    out->truth = impedance_of(truth, out->hz);
    out->sampled = impedance_sampled(truth, out->hz);
  }
  port_close(&p);
  return status;
}

/* ---- all ---- */

static bool is_steady(const impedance_point *point)
{
  return point->contact_share == 1.0 && point->residual < STEADY;
}

static hap_status measure_curve(bench *b, port_body body, size_t variant, impedance_table *table)
{
  impedance_curve *c = &table->curves[body][variant];
  port_def def = {
      .body = body,
      .mass = impedance_cases[body].mass,
      .model = impedance_variants[variant].model,
      .coupling = impedance_variants[variant].coupling,
      .stiffness = IMPEDANCE_STIFFNESS,
      .damping = IMPEDANCE_DAMPING,
  };
  bool steady = true;
  c->truth = impedance_truth_of(body);
  if (def.coupling == HAP_COUPLING_GOD_OBJECT || def.coupling == HAP_COUPLING_VIRTUAL) {
    def.coupling_stiffness = IMPEDANCE_STIFFNESS; /* which is all that gives */
    def.coupling_damping = IMPEDANCE_DAMPING;
    c->truth.rigid = true;
    c->truth.mass += def.coupling == HAP_COUPLING_VIRTUAL ? TOOL_MASS : 0.0;
  }
  if (def.coupling == HAP_COUPLING_PROXY) {
    c->truth.coupling_stiffness = def.coupling_stiffness = COUPLING_STIFFNESS;
    c->truth.coupling_damping = def.coupling_damping = COUPLING_DAMPING;
  }
  for (size_t i = 0; i < table->points; ++i) {
    double share = (double)i / (double)(table->points - 1);
    impedance_point *point = &c->points[i];
    hap_status status =
        measure_point(b, &def, HZ_LEAST * pow(HZ_MOST / HZ_LEAST, share), &c->truth, point);
    if (status < HAP_OK) {
      return status;
    }
    steady = steady && (point->hz > FIT_HZ || is_steady(point));
  }
  c->fitted = steady && impedance_fit(c->points, table->points, FIT_HZ, &c->truth, &c->fit);
  return HAP_OK;
}

static hap_status measure(bench *b, impedance_table *table)
{
  table->points = b->quick ? POINTS_QUICK : IMPEDANCE_POINTS_MAX;
  for (int body = 0; body < PORT_BODIES; ++body) {
    for (size_t v = 0; v < IMPEDANCE_VARIANTS; ++v) {
      hap_status status = measure_curve(b, (port_body)body, v, table);
      if (status < HAP_OK) {
        return status;
      }
    }
  }
  return HAP_OK;
}

static double error_of(const impedance_point *p)
{
  return cabs(p->felt / p->truth - 1.0);
}

static double sampled_error(const impedance_point *p)
{
  return cabs(p->felt / p->sampled - 1.0);
}

static double phase_error(const impedance_point *p)
{
  return 180.0 / M_PI * carg(p->felt / p->truth);
}

static void write_point(FILE *csv, int body, size_t variant, const impedance_point *p)
{
  double w = 2.0 * M_PI * p->hz;
  const impedance_variant *v = &impedance_variants[variant];
  fprintf(csv, "%s,%s,%s,%.6g,%.6g", impedance_cases[body].name, hap_model_name(v->model),
          hap_coupling_name(v->coupling), p->hz, p->amplitude);
  fprintf(csv, ",%.9g,%.9g,%.9g,%.9g,%.9g,%.9g", creal(p->felt), cimag(p->felt) / w,
          -creal(p->felt) / (w * w), creal(p->truth), cimag(p->truth) / w,
          -creal(p->truth) / (w * w));
  fprintf(csv, ",%.9g,%.9g,%.6g,%.6g,%.6g,%.6g,%.6g\n", cabs(p->felt), cabs(p->truth), error_of(p),
          phase_error(p), p->residual, p->contact_share, sampled_error(p));
}

static hap_status write_table(bench *b, const impedance_table *table)
{
  FILE *csv = bench_csv_open(
      b, "impedance",
      "case,model,coupling,hz,amplitude_m,stiffness_felt,damping_felt,mass_felt,stiffness_true,"
      "damping_true,mass_true,magnitude_felt,magnitude_true,error,phase_error_deg,residual,"
      "contact_share,error_sampled");
  for (int body = 0; body < PORT_BODIES && csv != NULL; ++body) {
    for (size_t v = 0; v < IMPEDANCE_VARIANTS; ++v) {
      for (size_t i = 0; i < table->points; ++i) {
        write_point(csv, body, v, &table->curves[body][v].points[i]);
      }
    }
  }
  return bench_csv_close(b, csv);
}

/* ---- what is said ---- */

typedef struct worst {
  double error; /* against the truth */
  double hz;    /* where that is */
  double phase; /* degrees, there */
  double sampled;
  double residual;
  double contact_share;
} worst;

static worst find_worst(const impedance_curve *c, size_t points, double hz_most)
{
  worst w = {.contact_share = 1.0};
  for (size_t i = 0; i < points && c->points[i].hz <= hz_most; ++i) {
    const impedance_point *p = &c->points[i];
    if (error_of(p) >= w.error) {
      w.error = error_of(p);
      w.hz = p->hz;
      w.phase = phase_error(p);
    }
    w.sampled = fmax(w.sampled, sampled_error(p));
    w.residual = fmax(w.residual, p->residual);
    w.contact_share = fmin(w.contact_share, p->contact_share);
  }
  return w;
}

static double percent(double value, double wanted)
{
  return 100.0 * (value / wanted - 1.0);
}

/* What a hand takes the body for. */
static void report_fit(bench *b, const char *name, const impedance_curve *c, bool bound)
{
  const impedance_truth *t = &c->truth;
  const impedance_truth *f = &c->fit;
  bool moves = !t->grounded;
  if (!c->fitted) {
    bench_say("%s: no steady sine to fit mass, spring and damper to", name);
    return;
  }
  double most = t->coupling_stiffness > 0.0 ? FIT_BOUND_PROXY : FIT_BOUND;
  bool good = (!moves || bench_within(f->mass, t->mass, most)) &&
              bench_within(f->stiffness, t->stiffness, most) &&
              bench_within(f->damping, t->damping, most);
  char mass[64] = "";
  char text[160];
  if (moves) {
    snprintf(mass, sizeof mass, "%.5f kg (%+.3f %%), ", f->mass, percent(f->mass, t->mass));
  }
  snprintf(text, sizeof text, "%s%.2f N/m (%+.3f %%), %.4f N s/m (%+.3f %%)", mass, f->stiffness,
           percent(f->stiffness, t->stiffness), f->damping, percent(f->damping, t->damping));
  if (bound) {
    bench_check(b, good, "%s: felt up to 50 Hz: %s (bound %g %%)", name, text, 100.0 * most);
  } else {
    bench_say("%s: felt up to 50 Hz: %s", name, text);
  }
}

static void report_curve(bench *b, int body, size_t variant, const impedance_table *table)
{
  const impedance_curve *c = &table->curves[body][variant];
  /* What is felt through those of the literature is said only. */
  bool bound = impedance_variants[variant].model == HAP_MODEL_CONTACT && !c->truth.rigid;
  bool turns = body == PORT_HINGE && impedance_variants[variant].coupling == HAP_COUPLING_PROXY;
  double sampled_bound = turns ? TURNING_BOUND : SAMPLED_BOUND;
  worst low = find_worst(c, table->points, FIT_HZ);
  worst all = find_worst(c, table->points, HUGE_VAL);
  char name[64];
  snprintf(name, sizeof name, "%s, %s", impedance_cases[body].name,
           impedance_variants[variant].name);
  bench_say(
      "%s: off by %.3g %% at most up to 50 Hz (%.3g Hz, phase %+.2f deg), %.3g %% up to 200 Hz "
      "(%.3g Hz, phase %+.2f deg); in touch %.0f %%, residual %.2g",
      name, 100.0 * low.error, low.hz, low.phase, 100.0 * all.error, all.hz, all.phase,
      100.0 * all.contact_share, all.residual);
  if (bound) {
    bench_check(b, all.sampled <= sampled_bound && all.contact_share == 1.0,
                "%s: off the closed form at ticks by %.2g %% at most up to 200 Hz (bound %g %%)",
                name, 100.0 * all.sampled, 100.0 * sampled_bound);
  }
  report_fit(b, name, c, bound);
}

static hap_status run_impedance(bench *b, impedance_table *table)
{
  hap_status status = measure(b, table);
  if (status < HAP_OK) {
    return status;
  }
  for (int body = 0; body < PORT_BODIES; ++body) {
    for (size_t v = 0; v < IMPEDANCE_VARIANTS; ++v) {
      report_curve(b, body, v, table);
    }
  }
  status = write_table(b, table);
  return status >= HAP_OK ? impedance_draw(b, table) : status;
}

static void choose_coupling(const char *name)
{
  impedance_variant *v = &impedance_variants[VARIANT_COUPLED];
  if (bench_find_coupling(name, &v->coupling) && v->coupling != HAP_COUPLING_PROXY) {
    v->name = v->coupling == HAP_COUPLING_VIRTUAL ? "contact, virtual" : "contact, god-object";
  }
}

hap_status bench_impedance(bench *b)
{
  impedance_table *table = calloc(1, sizeof *table);
  if (table == NULL) {
    return bench_fail(b, HAP_ERROR_MEMORY, "no memory for the curves");
  }
  if (b->coupling != NULL) {
    choose_coupling(b->coupling);
  }
  hap_status status = run_impedance(b, table);
  free(table);
  return status >= HAP_OK ? zwidth_run(b) : status;
}
