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

/* Z-width: the stiffest wall that a device holds without a hand, for each damper of the wall. A
 * constant force leans the device against the wall, so that the wall is a spring both ways; it is
 * kicked, and what is left of that must die away. As long as the wall is not left this is a linear
 * sampled-data loop, which is computed as well, exactly, and gives the limit that must be found. */

#define WALLS_MAX 10  /* dampers of the wall */
#define DEPTH 1e-4    /* m, how far the device leans in */
#define LEAN_M 1000.0 /* m, away is the end of the weak spring that leans */
#define LEAN_S 0.8    /* s, in which the lean begins */
#define KICK_S 1.0
#define KICK_SHARE 0.1 /* of the depth */
#define WINDOW_TICKS 500
#define EARLY_TICK 1100
#define LATE_TICK 4100
#define STILL 1e-9 /* of the depth, rms: nothing is left */
#define STIFFNESS_LEAST 1.0
#define STIFFNESS_MOST 1e6
#define STIFFNESS_STEP 1.003 /* how well a limit is found */
#define COUPLING_STEP 1.01   /* the same between couplings */
#define HAND_MASS 1e-3       /* kg, of the weak spring's end: the least that the device takes */
#define LINEAR_BOUND 0.01
#define STATES 4 /* of the loop: place, velocity, the forces of two ticks */

typedef struct zwidth_device {
  const char *name;
  const char *title;
  double mass;    /* kg */
  double damping; /* N s/m */
  double delay;   /* s */
} zwidth_device;

static const zwidth_device devices[] = {
    {"stylus", "desktop stylus: 0.075 kg, 0.3 N s/m", 0.075, 0.3, 0.0},
    {"stylus_late", "the same, 0.5 ms late", 0.075, 0.3, 0.0005},
    {"parallel", "parallel device: 0.25 kg, 2.5 N s/m", 0.25, 2.5, 0.0},
    {"strings", "strings: 0.05 kg, 0.5 N s/m, 1 ms late", 0.05, 0.5, 0.001},
};
#define DEVICES BENCH_COUNT(devices)

/* Dampers of the walls in units of mass over tick: at 2 the damper alone is unstable. */
static const double walls[WALLS_MAX] = {0.0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0, 1.5};

typedef struct zwidth_row {
  double damping; /* N s/m, of the wall */
  double direct;  /* N/m, largest stable; 0: none */
  double linear;  /* N/m, the same of the computed loop */
  double passive; /* N/m, b > K (T/2 + delay) + B */
  double proxy;   /* N/m, up to which every wall that was tried is stable behind the proxy */
  double felt;    /* N/m, of that wall and the coupling in series */
} zwidth_row;

typedef struct zwidth_table {
  size_t walls;
  zwidth_row rows[DEVICES][WALLS_MAX];
  double coupling[DEVICES]; /* N/m */
} zwidth_table;

/* ---- the loop, computed ---- */

typedef struct matrix {
  double v[STATES][STATES];
} matrix;

/* Mass and damper under a held force, place and velocity after a time: x += p v + q f, v = r v +
 * s f. */
typedef struct motion {
  double p, q, r, s;
} motion;

static motion motion_of(const zwidth_device *d, double seconds)
{
  double rate = d->damping / d->mass;
  double decay = -expm1(-rate * seconds);
  return (motion){decay / rate, (seconds - decay / rate) / d->damping, 1.0 - decay,
                  decay / d->damping};
}

/* One tick. States: place, velocity, the forces of the last ticks, newest first. The force of a
 * tick is -K x - B v of its start, and acts after the delay: after whole ticks and a part of
 * one. */
static matrix loop_of(const zwidth_device *d, double k, double b)
{
  matrix m = {{{0.0}}};
  int whole = (int)floor(d->delay / PORT_TICK_S + 1e-9);
  double part = d->delay - whole * PORT_TICK_S;
  motion before = motion_of(d, part);
  motion after = motion_of(d, PORT_TICK_S - part);
  const double force[2] = {-k, -b};
  double old[2] = {before.q + after.p * before.s, after.r * before.s};
  double new[2] = {after.q, after.s};
  m.v[0][0] = 1.0;
  m.v[0][1] = before.p + after.p * before.r;
  m.v[1][1] = after.r * before.r;
  for (int i = 0; i < 2; ++i) {
    m.v[i][2 + whole] += old[i]; /* force of whole + 1 ticks ago */
    if (whole > 0) {
      m.v[i][1 + whole] += new[i];
    } else {
      m.v[i][0] += new[i] * force[0];
      m.v[i][1] += new[i] * force[1];
    }
  }
  m.v[2][0] = force[0];
  m.v[2][1] = force[1];
  for (int i = 3; i < STATES; ++i) {
    m.v[i][i - 1] = 1.0;
  }
  return m;
}

static double matrix_square(matrix *m)
{
  matrix out;
  double norm = 0.0;
  for (int i = 0; i < STATES; ++i) {
    for (int j = 0; j < STATES; ++j) {
      double sum = 0.0;
      for (int k = 0; k < STATES; ++k) {
        sum += m->v[i][k] * m->v[k][j];
      }
      out.v[i][j] = sum;
      norm = fmax(norm, fabs(sum));
    }
  }
  for (int i = 0; i < STATES && norm > 0.0; ++i) {
    for (int j = 0; j < STATES; ++j) {
      out.v[i][j] /= norm;
    }
  }
  *m = out;
  return norm;
}

/* Whether all eigenvalues are within the unit circle: by the norm of the 2^40th power. */
static bool loop_is_stable(const zwidth_device *d, double k, double b)
{
  matrix m = loop_of(d, k, b);
  double log_norm = 0.0;
  for (int i = 0; i < 40; ++i) {
    log_norm = 2.0 * log_norm + log(matrix_square(&m));
  }
  return log_norm < 0.0;
}

/* ---- the loop, as it is ---- */

/* The trace of a run: rms about the mean of two windows after the kick. */
typedef struct swing {
  double from[2]; /* m, first place: what is left may be picometres */
  double sum[2];
  double square[2];
  size_t apart; /* ticks of the late window without contact */
} swing;

static void take_tick(swing *s, size_t tick, const hap_pointer_state *state)
{
  bool early = tick >= EARLY_TICK && tick < EARLY_TICK + WINDOW_TICKS;
  bool late = tick >= LATE_TICK;
  double z = state->device.position[2] + PORT_RADIUS;
  if (early || late) {
    s->from[late] = tick == EARLY_TICK || tick == LATE_TICK ? z : s->from[late];
    z -= s->from[late];
    s->sum[late] += z;
    s->square[late] += z * z;
    s->apart += late && state->contacts == 0;
  }
}

static double rms_of(const swing *s, int window)
{
  double mean = s->sum[window] / WINDOW_TICKS;
  return sqrt(fmax(0.0, s->square[window] / WINDOW_TICKS - mean * mean));
}

typedef struct trial {
  const zwidth_device *device;
  hap_coupling coupling;
  double k; /* of the wall */
  double b;
  double coupling_stiffness; /* N/m, known from an earlier run, or */
  bool given;                /* told to the library */
  bool stable;
} trial;

static double felt_stiffness(const trial *t)
{
  double c = t->coupling_stiffness;
  return t->coupling == HAP_COUPLING_DIRECT  ? t->k
         : t->coupling == HAP_COUPLING_PROXY ? t->k * c / (t->k + c)
                                             : c;
}

static void spell_device(const trial *t, char *out, size_t size)
{
  const zwidth_device *d = t->device;
  double k = felt_stiffness(t);
  snprintf(out, size,
           "virtual:path=0:0/0/%.17g;%.17g:0/0/%.17g,hand=relaxed,mass=%.17g,damping=0,"
           "stiffness=%.17g,device_mass=%.17g,device_damping=%.17g,delay=%.17g,"
           "kick=%.17g:0/0/%.17g,max_force=" PORT_FORCE_MAX,
           -PORT_RADIUS, LEAN_S, LEAN_M, HAND_MASS, DEPTH * k / LEAN_M, d->mass - HAND_MASS,
           d->damping, d->delay, KICK_S, KICK_SHARE * DEPTH * sqrt(k / d->mass));
}

static hap_status run_trial(bench *b, trial *t)
{
  port p;
  swing s = {{0.0}, {0.0}, {0.0}, 0};
  char device[512];
  port_def def = {.body = PORT_WALL,
                  .device = device,
                  .model = HAP_MODEL_CONTACT,
                  .coupling = t->coupling,
                  .stiffness = t->k,
                  .damping = t->b,
                  .coupling_stiffness = t->given ? t->coupling_stiffness : 0.0};
  spell_device(t, device, sizeof device);
  hap_status status = port_open(b, &def, &p);
  if (status < HAP_OK) {
    return status;
  }
  for (size_t i = 0; i < LATE_TICK + WINDOW_TICKS && status >= HAP_OK; ++i) {
    status = port_advance(b, &p);
    take_tick(&s, i, &p.state);
  }
  port_close(&p);
  double left = rms_of(&s, 1);
  t->stable = s.apart == 0 && (left < rms_of(&s, 0) || left < STILL * DEPTH);
  return status;
}

/* ---- limits ---- */

static double linear_limit(const zwidth_device *d, double b)
{
  double low = STIFFNESS_LEAST;
  double high = STIFFNESS_MOST;
  if (!loop_is_stable(d, low, b)) {
    return 0.0;
  }
  while (high > low * 1.00001) {
    double middle = sqrt(low * high);
    *(loop_is_stable(d, middle, b) ? &low : &high) = middle;
  }
  return low;
}

/* The stiffest that is stable, by halving between least and the most; 0: none. */
static hap_status stiffest_find(bench *b, trial *t, double least, double step, double *out)
{
  double low = least;
  double high = STIFFNESS_MOST;
  hap_status status = HAP_OK;
  *out = 0.0;
  for (double k = low; status >= HAP_OK && high > low * step; k = sqrt(low * high)) {
    *(t->given ? &t->coupling_stiffness : &t->k) = k;
    status = run_trial(b, t);
    *(t->stable ? &low : &high) = k;
    *out = t->stable ? felt_stiffness(t) : *out;
  }
  return status;
}

hap_status zwidth_of_coupling(bench *b, hap_coupling coupling, double *out)
{
  trial t = {.device = &devices[0],
             .k = STIFFNESS_MOST,
             .coupling = coupling,
             .given = coupling != HAP_COUPLING_DIRECT};
  return stiffest_find(b, &t, 10.0 * STIFFNESS_LEAST, COUPLING_STEP, out);
}

/* Behind a proxy every wall is to be stable: tried from soft to stiff, up to the first that is
 * not. */
static hap_status find_proxy(bench *b, const zwidth_device *d, double coupling, zwidth_row *row)
{
  static const double tried[] = {30.0, 100.0, 300.0, 1e3, 3e3, 1e4, 1e5, STIFFNESS_MOST};
  trial t = {.device = d, .b = row->damping, .coupling_stiffness = coupling};
  hap_status status = HAP_OK;
  t.coupling = HAP_COUPLING_PROXY;
  row->proxy = row->felt = 0.0;
  for (size_t i = 0; i < BENCH_COUNT(tried) && status >= HAP_OK; ++i) {
    t.k = tried[i];
    status = run_trial(b, &t);
    if (!t.stable) {
      break;
    }
    row->proxy = t.k;
    row->felt = felt_stiffness(&t);
  }
  return status;
}

/* What the library makes of the device's figures. */
static hap_status ask_coupling(bench *b, const zwidth_device *d, double *out)
{
  port p;
  char device[512];
  trial t = {.device = d, .k = 100.0};
  port_def def = {.body = PORT_WALL,
                  .device = device,
                  .model = HAP_MODEL_CONTACT,
                  .coupling = HAP_COUPLING_PROXY,
                  .stiffness = t.k};
  spell_device(&t, device, sizeof device);
  hap_status status = port_open(b, &def, &p);
  if (status >= HAP_OK) {
    status = port_advance(b, &p);
    *out = p.state.coupling_stiffness;
    port_close(&p);
  }
  return status;
}

static hap_status measure_device(bench *b, size_t device, zwidth_table *table)
{
  const zwidth_device *d = &devices[device];
  double late = 0.5 * PORT_TICK_S + d->delay;
  hap_status status = ask_coupling(b, d, &table->coupling[device]);
  for (size_t i = 0; i < table->walls && status >= HAP_OK; ++i) {
    zwidth_row *row = &table->rows[device][i];
    size_t wall = b->quick ? 3 * i : i;
    row->damping = walls[wall] * d->mass / PORT_TICK_S;
    row->linear = linear_limit(d, row->damping);
    row->passive = fmax(0.0, (d->damping - row->damping) / late);
    trial t = {.device = d, .b = row->damping, .coupling = HAP_COUPLING_DIRECT};
    status = stiffest_find(b, &t, STIFFNESS_LEAST, STIFFNESS_STEP, &row->direct);
    if (status >= HAP_OK) {
      status = find_proxy(b, d, table->coupling[device], row);
    }
  }
  return status;
}

/* ---- output ---- */

static hap_status zwidth_write_table(bench *b, const zwidth_table *table)
{
  FILE *csv = bench_csv_open(b, "zwidth",
                             "device,mass,damping,delay,wall_damping,direct_stiffness,"
                             "linear_stiffness,passive_stiffness,coupling_stiffness,"
                             "proxy_stiffness,proxy_felt");
  for (size_t d = 0; d < DEVICES && csv != NULL; ++d) {
    for (size_t i = 0; i < table->walls; ++i) {
      const zwidth_row *r = &table->rows[d][i];
      fprintf(csv, "%s,%g,%g,%g,%g,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g\n", devices[d].name,
              devices[d].mass, devices[d].damping, devices[d].delay, r->damping, r->direct,
              r->linear, r->passive, table->coupling[d], r->proxy, r->felt);
    }
  }
  return bench_csv_close(b, csv, HAP_OK);
}

static void report_row(bench *b, size_t device, const zwidth_row *r)
{
  const char *name = devices[device].name;
  bool passive = r->direct >= r->passive / STIFFNESS_STEP;
  bool linear =
      r->linear > 0.0 ? bench_within(r->direct, r->linear, LINEAR_BOUND) : r->direct == 0.0;
  bench_check(b, passive && linear,
              "%s, wall of %.3g N s/m, direct: stable up to %.5g N/m, computed %.5g N/m "
              "(bound %g %%), passive up to %.5g N/m",
              name, r->damping, r->direct, r->linear, 100.0 * LINEAR_BOUND, r->passive);
  bench_check(b, r->proxy == STIFFNESS_MOST,
              "%s, wall of %.3g N s/m, proxy: stable up to %.5g N/m, felt as %.5g N/m", name,
              r->damping, r->proxy, r->felt);
}

static void draw_device(FILE *script, const zwidth_table *table, size_t device)
{
  const zwidth_device *d = &devices[device];
  const double most = d->damping + walls[WALLS_MAX - 1] * d->mass / PORT_TICK_S;
  fprintf(script, "$d << EOD\n");
  for (size_t i = 0; i < table->walls; ++i) {
    const zwidth_row *r = &table->rows[device][i];
    fprintf(script, "%.6g %.6g %.6g\n", d->damping + r->damping, r->direct, r->felt);
  }
  fprintf(script, "EOD\n$l << EOD\n");
  for (int i = 0; i <= 100; ++i) {
    double total = d->damping * pow(most / d->damping, i / 100.0);
    fprintf(script, "%.6g %.6g\n", total, linear_limit(d, total - d->damping));
  }
  fprintf(script, "EOD\nset title '%s'\nset xrange [%g:%g]\n", d->title, 0.9 * d->damping,
          1.1 * most);
  fprintf(
      script,
      "plot $l using 1:2 with lines lc rgb '#000000' title 'linear loop, computed', "
      "(2 * %.9g - x) / %.9g with lines lc rgb '#909090' dt 2 title 'passive: b > K (T/2 + delay) "
      "+ B', "
      "$d using 1:2 with points lt 1 pt 6 title 'direct: stiffest stable wall', "

      "$d using 1:3 with points lt 2 pt 4 title 'proxy: felt of 1 MN/m'\n",
      d->damping, 0.5 * PORT_TICK_S + d->delay);
}

static void zwidth_draw(FILE *script, const void *data)
{
  const zwidth_table *table = data;
  fprintf(
      script,
      "set multiplot layout 2,2 title 'Z-width: the stiffest wall that each device holds, "
      "alone'\nset xlabel 'damping of device and wall b + B [N s/m]'\nset ylabel 'stiffness "
      "[N/m]'\n"
      "set logscale xy\nset yrange [1:1e6]\nset samples 1000\nset key bottom right font ',8'\n");
  for (size_t d = 0; d < DEVICES; ++d) {
    draw_device(script, table, d);
  }
  fprintf(script, "unset multiplot\n");
}

static hap_status zwidth_run(bench *b)
{
  zwidth_table table;
  memset(&table, 0, sizeof table);
  table.walls = b->quick ? (WALLS_MAX + 2) / 3 : WALLS_MAX;
  for (size_t d = 0; d < DEVICES; ++d) {
    hap_status status = measure_device(b, d, &table);
    if (status < HAP_OK) {
      return status;
    }
    for (size_t i = 0; i < table.walls; ++i) {
      report_row(b, d, &table.rows[d][i]);
    }
  }
  hap_status status = zwidth_write_table(b, &table);
  return status >= HAP_OK ? bench_draw(b, "zwidth", 1000, 760, zwidth_draw, &table) : status;
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
