/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Z-width: the stiffest wall that a device holds without a hand, for each damper of the wall. A
 * constant force leans the device against the wall, so that the wall is a spring both ways; it is
 * kicked, and what is left of that must die away. As long as the wall is not left this is a linear
 * sampled-data loop, which is computed as well, exactly, and gives the limit that must be found. */

#include <math.h>
#include <string.h>

#include "bench/impedance.h"

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
#define DEVICES (sizeof devices / sizeof devices[0])

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

/* Mass and damper under a held force, place and velocity after a time: x += p v + q f, v = r v + s f. */
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

/* One tick. States: place, velocity, the forces of the last ticks, newest first. The force of a tick
 * is -K x - B v of its start, and acts after the delay: after whole ticks and a part of one. */
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

static double square(matrix *m)
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
    log_norm = 2.0 * log_norm + log(square(&m));
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

static hap_status find_direct(bench *b, const zwidth_device *d, double damping, double *out)
{
  trial t = {.device = d, .k = STIFFNESS_LEAST, .b = damping};
  double low = STIFFNESS_LEAST;
  double high = STIFFNESS_MOST;
  t.coupling = HAP_COUPLING_DIRECT;
  hap_status status = run_trial(b, &t);
  bool any = t.stable;
  while (any && status >= HAP_OK && high > low * STIFFNESS_STEP) {
    t.k = sqrt(low * high);
    status = run_trial(b, &t);
    *(t.stable ? &low : &high) = t.k;
  }
  *out = any ? low : 0.0;
  return status;
}

hap_status zwidth_of_coupling(bench *b, hap_coupling coupling, double *out)
{
  trial t = {.device = &devices[0], .k = STIFFNESS_MOST, .coupling = coupling};
  double low = 10.0 * STIFFNESS_LEAST;
  double high = STIFFNESS_MOST;
  hap_status status = HAP_OK;
  t.given = coupling != HAP_COUPLING_DIRECT;
  *out = 0.0;
  for (double middle = low; status >= HAP_OK && high > low * COUPLING_STEP;
       middle = sqrt(low * high)) {
    *(t.given ? &t.coupling_stiffness : &t.k) = middle;
    status = run_trial(b, &t);
    *(t.stable ? &low : &high) = middle;
    *out = t.stable ? felt_stiffness(&t) : *out;
  }
  return status;
}

/* Behind a proxy every wall is to be stable: tried from soft to stiff, up to the first that is not. */
static hap_status find_proxy(bench *b, const zwidth_device *d, double coupling, zwidth_row *row)
{
  static const double tried[] = {30.0, 100.0, 300.0, 1e3, 3e3, 1e4, 1e5, STIFFNESS_MOST};
  trial t = {.device = d, .b = row->damping, .coupling_stiffness = coupling};
  hap_status status = HAP_OK;
  t.coupling = HAP_COUPLING_PROXY;
  row->proxy = row->felt = 0.0;
  for (size_t i = 0; i < sizeof tried / sizeof tried[0] && status >= HAP_OK; ++i) {
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
    status = find_direct(b, d, row->damping, &row->direct);
    if (status >= HAP_OK) {
      status = find_proxy(b, d, table->coupling[device], row);
    }
  }
  return status;
}

/* ---- output ---- */

static hap_status write_table(bench *b, const zwidth_table *table)
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
  return bench_csv_close(b, csv);
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

static hap_status draw(bench *b, const zwidth_table *table)
{
  FILE *script = bench_picture_begin(b, "zwidth", 1000, 760);
  if (script != NULL) {
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
  return bench_picture_end(b, "zwidth", script);
}

hap_status zwidth_run(bench *b)
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
  hap_status status = write_table(b, &table);
  return status >= HAP_OK ? draw(b, &table) : status;
}
