/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bench/impedance.h"

#define FREE_MASS 0.2  /* kg: resonates with the contact at 11 Hz */
#define FLAP_MASS 0.25 /* kg */
#define STUCK_MASS 1.0 /* kg: slips at 4.9 N */
#define PARAMETERS 3
#define FIT_STEPS 30
#define FIT_DONE 1e-10

const impedance_case impedance_cases[PORT_BODIES] = {
    [PORT_WALL] = {"wall", "static wall", 0.0, 2.0},
    [PORT_HELD] = {"held", "body held by a fixed joint", FREE_MASS, 2.0},
    [PORT_STUCK] = {"pushed", "cube on a floor, friction holds", STUCK_MASS, 2.0},
    [PORT_FREE] = {"free", "free body", FREE_MASS, FREE_MASS *PORT_GRAVITY},
    [PORT_SLIDER] = {"slider", "body on a slider", FREE_MASS, FREE_MASS *PORT_GRAVITY},
    [PORT_HINGE] = {"hinge", "flap on a hinge", FLAP_MASS,
                    FLAP_MASS *PORT_GRAVITY * 0.5 * PORT_FLAP_LENGTH / PORT_FLAP_ARM},
};

/* A flap that is turned by q about its level pose, p the pointer's height, r the arm and F0 the
 * preload: the contact is moved by p - r q, and
 *
 *   I q" = r dF - (F0 (radius - depth) - m g h) q
 *
 * as the lever from hinge to contact gets shorter while the flap rises and its centre of mass,
 * which is h above the hinge, comes nearer to the hinge's axis. */
static void set_flap(impedance_truth *truth)
{
  const double arm2 = PORT_FLAP_ARM * PORT_FLAP_ARM;
  const double half = PORT_FLAP_HALF;
  const double preload = impedance_cases[PORT_HINGE].preload;
  double inertia = FLAP_MASS * (PORT_FLAP_LENGTH * PORT_FLAP_LENGTH + 4.0 * half * half) / 3.0;
  double turning =
      preload * (PORT_RADIUS - preload / IMPEDANCE_STIFFNESS) - FLAP_MASS * PORT_GRAVITY * half;
  truth->mass = inertia / arm2;
  truth->body_stiffness = turning / arm2;
}

/* Without a coupling. */
static impedance_truth impedance_truth_of(port_body body)
{
  impedance_truth truth = {
      .grounded = body == PORT_WALL || body == PORT_HELD || body == PORT_STUCK,
      .mass = impedance_cases[body].mass,
      .stiffness = IMPEDANCE_STIFFNESS,
      .damping = IMPEDANCE_DAMPING,
  };
  if (body == PORT_HINGE) {
    set_flap(&truth);
  }
  return truth;
}

static double complex impedance_of(const impedance_truth *truth, double hz)
{
  double w = 2.0 * M_PI * hz;
  double complex compliance = 1.0 / (truth->stiffness + I * w * truth->damping);
  if (!truth->grounded) {
    compliance += 1.0 / (truth->body_stiffness - w * w * truth->mass);
  }
  if (truth->coupling_stiffness > 0.0) {
    compliance += 1.0 / (truth->coupling_stiffness + I * w * truth->coupling_damping);
  }
  return 1.0 / compliance;
}

/* What ticks make of the closed form, T a tick, z = exp(i w T) one tick ahead. A body moves by x' =
 * x + T v', v' = v + T F / m: its w^2 is that of the central difference. Direct, u the device's
 * place and x the body's: the midpoint rule takes the mean of x z, x, x, x / z, and the damper the
 * velocity from before the tick, x (1 - 1/z) / T, half a tick old. Through a proxy whose place
 * after the tick is p:
 *
 *   F = k (p - (x z - x + x / z)) + d (1 - 1/z) / T (p - x z)
 *   F = k_v (u - p) + d_v (i w u - (1 - 1/z) / T p) */
/* The same as model contact should render it, tick by tick. */
static double complex impedance_sampled(const impedance_truth *truth, double hz)
{
  double angle = 2.0 * M_PI * hz * PORT_TICK_S;
  double complex w = I * 2.0 * M_PI * hz;
  double complex ahead = cexp(I * angle);
  double complex rate = (1.0 - 1.0 / ahead) / PORT_TICK_S;
  double move = 2.0 * sin(0.5 * angle) / PORT_TICK_S;
  double body = truth->body_stiffness - move * move * truth->mass;
  double complex give = truth->grounded ? 0.0 : 1.0 / body;
  if (truth->coupling_stiffness > 0.0) {
    double complex contact = truth->stiffness + truth->damping * rate;
    double complex coupling = truth->coupling_stiffness + truth->coupling_damping * rate;
    double complex back =
        truth->stiffness * (ahead - 1.0 + 1.0 / ahead) + truth->damping * rate * ahead;
    return (truth->coupling_stiffness + truth->coupling_damping * w) /
           (1.0 + coupling / contact * (1.0 + back * give));
  }
  double mean = cos(0.5 * angle) * cos(0.5 * angle);
  return (truth->stiffness + truth->damping * w) /
         (1.0 + (truth->stiffness * mean + truth->damping * rate) * give);
}

/* ---- fit: Gauss and Newton, relative errors ---- */

static double *truth_parameter(impedance_truth *truth, int index)
{
  return index == 0 ? &truth->stiffness : index == 1 ? &truth->damping : &truth->mass;
}

typedef struct normal_equations {
  double a[PARAMETERS][PARAMETERS];
  double b[PARAMETERS];
} normal_equations;

static void add_point(normal_equations *n, const impedance_point *point, impedance_truth *at,
                      int count)
{
  double complex slope[PARAMETERS];
  double complex here = impedance_of(at, point->hz);
  for (int i = 0; i < count; ++i) {
    double *p = truth_parameter(at, i);
    double kept = *p;
    double step = 1e-6 * fmax(fabs(kept), 1e-3);
    *p = kept + step;
    slope[i] = (impedance_of(at, point->hz) - here) / (step * point->felt);
    *p = kept;
  }
  for (int i = 0; i < count; ++i) {
    n->b[i] += creal(conj(slope[i]) * (1.0 - here / point->felt));
    for (int j = 0; j < count; ++j) {
      n->a[i][j] += creal(conj(slope[i]) * slope[j]);
    }
  }
}

/* The matrix is that of least squares: positive definite, no pivots are needed. */
static bool equations_solve(normal_equations *n, int count)
{
  for (int i = 0; i < count; ++i) {
    if (!(n->a[i][i] > 0.0)) {
      return false;
    }
    for (int j = i + 1; j < count; ++j) {
      double factor = n->a[j][i] / n->a[i][i];
      for (int k = i; k < count; ++k) {
        n->a[j][k] -= factor * n->a[i][k];
      }
      n->b[j] -= factor * n->b[i];
    }
  }
  for (int i = count - 1; i >= 0; --i) {
    for (int k = i + 1; k < count; ++k) {
      n->b[i] -= n->a[i][k] * n->b[k];
    }
    n->b[i] /= n->a[i][i];
  }
  return true;
}

/* Mass, stiffness and damping of the contact that fit the felt values best, up to hz_max; all
 * else is taken from the truth. */
static bool impedance_fit(const impedance_point *points, size_t count, double hz_max,
                          const impedance_truth *truth, impedance_truth *out)
{
  int free_count = truth->grounded ? PARAMETERS - 1 : PARAMETERS;
  *out = *truth;
  for (int step = 0; step < FIT_STEPS; ++step) {
    normal_equations n = {{{0.0}}, {0.0}};
    double change = 0.0;
    for (size_t i = 0; i < count && points[i].hz <= hz_max; ++i) {
      add_point(&n, &points[i], out, free_count);
    }
    if (!equations_solve(&n, free_count)) {
      return false;
    }
    for (int i = 0; i < free_count; ++i) {
      double *p = truth_parameter(out, i);
      *p += n.b[i];
      change = fmax(change, fabs(n.b[i] / *p));
    }
    if (change < FIT_DONE) {
      return true;
    }
  }
  return false;
}

#define PANEL_WIDTH 430
#define PANEL_HEIGHT 250
#define TRUTH_POINTS 240

enum {
  MAGNITUDE = 2,
  STIFFNESS,
  MASS,
  DAMPING
};

static void put_value(FILE *script, double hz, double complex z)
{
  double w = 2.0 * M_PI * hz;
  fprintf(script, "%.6g %.6g %.6g %.6g %.6g\n", hz, cabs(z), creal(z), -creal(z) / (w * w),
          cimag(z) / w);
}

static void put_data(FILE *script, const impedance_table *table, int body)
{
  for (size_t v = 0; v < IMPEDANCE_VARIANTS; ++v) {
    const impedance_curve *c = &table->curves[body][v];
    fprintf(script, "$v%zu << EOD\n", v);
    for (size_t i = 0; i < table->points; ++i) {
      put_value(script, c->points[i].hz, c->points[i].felt);
    }
    fprintf(script, "EOD\n$t%zu << EOD\n", v);
    for (int i = 0; i <= TRUTH_POINTS && v < 2; ++i) {
      double hz = 0.5 * pow(400.0, (double)i / TRUTH_POINTS);
      put_value(script, hz, impedance_of(&c->truth, hz));
    }
    fprintf(script, "EOD\n");
  }
}

static void plot_column(FILE *script, int value)
{
  static const int order[IMPEDANCE_VARIANTS] = {3, 2, 4, 0, 1};
  static const int points[IMPEDANCE_VARIANTS] = {6, 4, 2, 8, 1};
  fprintf(script,
          "plot $t0 using 1:%d with lines lc rgb '#000000' lw 1 title 'truth', "
          "$t1 using 1:%d with lines lc rgb '#000000' dt 2 lw 1 title 'truth behind the proxy'",
          value, value);
  for (size_t i = 0; i < IMPEDANCE_VARIANTS; ++i) {
    int v = order[i];
    fprintf(script, ", $v%d using 1:%d with points lt %d pt %d ps 0.7 title '%s'", v, value, v + 1,
            points[v], impedance_variants[v].name);
  }
  fprintf(script, "\n");
}

/* What a hand takes the body for: a stiffness where it stands, a mass where it moves. */
static void draw_case(FILE *script, const impedance_table *table, int body)
{
  bool grounded = table->curves[body][0].truth.grounded;
  put_data(script, table, body);
  fprintf(script, "set title '%s'\nset logscale y\nset yrange [%s]\nset ylabel '|F/X| [N/m]'\n",
          impedance_cases[body].title, grounded ? "1:1e4" : "*:*");
  plot_column(script, MAGNITUDE);
  fprintf(script, "unset key\nset title ' '\nunset logscale y\nset yrange [%s]\nset ylabel '%s'\n",
          grounded ? "0:2000" : "-0.2:0.6",
          grounded ? "stiffness Re F/X [N/m]" : "mass -Re F/X / w^2 [kg]");
  plot_column(script, grounded ? STIFFNESS : MASS);
  fprintf(script, "set yrange [%s]\nset ylabel 'damping Im F/X / w [N s/m]'\n",
          grounded ? "-2:4" : "-5:10");
  plot_column(script, DAMPING);
}

static void impedance_draw(FILE *script, const void *data)
{
  const impedance_table *table = data;
  fprintf(script,
          "set multiplot layout %d,3 title 'Dynamic stiffness at the port: felt and true'\n"
          "set logscale x\nset xrange [0.4:250]\nset xlabel 'frequency [Hz]'\n"
          "set key bottom right font ',8'\n",
          (int)PORT_BODIES);
  for (int body = 0; body < PORT_BODIES; ++body) {
    draw_case(script, table, body);
  }
  fprintf(script, "unset multiplot\n");
}

/* A rigid hand moves the device by a sine, about a place at which the contact stays closed.
 * Force and motion are taken at the ticks, as the device reads and is given them, over whole
 * periods after all else has died away. Truth is the closed form in continuous time; what ticks
 * make of it is a second closed form, to which model contact is held closely. That a device
 * holds a force until the next tick is no part of it: the hand feels everything another half
 * tick later. */

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

/* Whole periods in whole ticks, near the wanted frequency. */
static double choose_window(double hz, impedance_sums *s)
{
  s->periods = fmax(PERIODS_LEAST, ceil(WINDOW_S * hz));
  s->ticks = (size_t)lround(s->periods / hz * PORT_HAPTIC_HZ);
  return s->periods / (double)s->ticks * PORT_HAPTIC_HZ;
}

hap_status impedance_listen(bench *b, port *p, int settle_ticks, impedance_sums *io)
{
  hap_status status = HAP_OK;
  for (int i = 0; i < settle_ticks && status >= HAP_OK; ++i) {
    status = port_advance(b, p);
  }
  for (size_t i = 0; i < io->ticks && status >= HAP_OK; ++i) {
    status = port_advance(b, p);
    double turns = fmod(io->periods * (double)i, (double)io->ticks) / (double)io->ticks;
    double complex wave = cexp(-2.0 * M_PI * I * turns);
    double force = -p->state.wrench.force[2];
    io->force += force * wave;
    io->motion += p->state.device.position[2] * wave;
    io->force_mean += force;
    io->force_square += force * force;
    io->touching += p->state.contacts > 0;
  }
  return status;
}

static void point_conclude(const impedance_sums *s, impedance_point *out)
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
  impedance_sums s = {0};
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
  status = impedance_listen(b, &p, SETTLE_TICKS, &s);
  if (status >= HAP_OK) {
    point_conclude(&s, out);
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

static hap_status table_write(bench *b, const impedance_table *table)
{
  FILE *csv = bench_csv_open(
      b, "impedance",
      "case,model,coupling,hz,amplitude_m,stiffness_felt,damping_felt,mass_felt,stiffness_true,"
      "damping_true,mass_true,magnitude_felt,magnitude_true,error,phase_error_deg,residual,"
      "contact_share,error_sampled");
  for (size_t row = 0; row < PORT_BODIES * IMPEDANCE_VARIANTS * table->points && csv != NULL;
       ++row) {
    size_t curve = row / table->points;
    size_t body = curve / IMPEDANCE_VARIANTS;
    const impedance_variant *v = &impedance_variants[curve % IMPEDANCE_VARIANTS];
    const impedance_point *p =
        &table->curves[body][curve % IMPEDANCE_VARIANTS].points[row % table->points];
    double w = 2.0 * M_PI * p->hz;
    fprintf(csv, "%s,%s,%s,%.6g,%.6g", impedance_cases[body].name, hap_model_name(v->model),
            hap_coupling_name(v->coupling), p->hz, p->amplitude);
    fprintf(csv, ",%.9g,%.9g,%.9g,%.9g,%.9g,%.9g", creal(p->felt), cimag(p->felt) / w,
            -creal(p->felt) / (w * w), creal(p->truth), cimag(p->truth) / w,
            -creal(p->truth) / (w * w));
    fprintf(csv, ",%.9g,%.9g,%.6g,%.6g,%.6g,%.6g,%.6g\n", cabs(p->felt), cabs(p->truth),
            error_of(p), phase_error(p), p->residual, p->contact_share, sampled_error(p));
  }
  return bench_csv_close(b, csv, HAP_OK);
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
    snprintf(mass, sizeof mass, "%.5f kg (%+.3f %%), ", f->mass, bench_percent(f->mass, t->mass));
  }
  snprintf(text, sizeof text, "%s%.2f N/m (%+.3f %%), %.4f N s/m (%+.3f %%)", mass, f->stiffness,
           bench_percent(f->stiffness, t->stiffness), f->damping,
           bench_percent(f->damping, t->damping));
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
  hap_status status = HAP_OK;
  table->points = b->quick ? POINTS_QUICK : IMPEDANCE_POINTS_MAX;
  for (int body = 0; body < PORT_BODIES; ++body) {
    for (size_t v = 0; v < IMPEDANCE_VARIANTS && status >= HAP_OK; ++v) {
      status = measure_curve(b, (port_body)body, v, table);
      if (status >= HAP_OK) {
        report_curve(b, body, v, table);
      }
    }
  }
  status = status >= HAP_OK ? table_write(b, table) : status;
  return status >= HAP_OK ? bench_draw(b, "impedance", 3 * PANEL_WIDTH,
                                       PORT_BODIES * PANEL_HEIGHT + 40, impedance_draw, table)
                          : status;
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
