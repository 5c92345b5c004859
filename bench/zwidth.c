/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

#include <math.h>
#include <string.h>

#include "bench/impedance.h"

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
#define WINDOW_S 0.5
#define EARLY_S 1.1
#define LATE_S 4.1
#define STILL 1e-9 /* of the depth, rms: nothing is left */
#define STIFFNESS_LEAST 1.0
#define STIFFNESS_MOST 1e6
#define STIFFNESS_STEP 1.003 /* how well a limit is found */
#define COUPLING_STEP 1.01   /* the same between couplings */
#define HAND_MASS 1e-3       /* kg, of the weak spring's end: the least that the device takes */
#define LINEAR_BOUND 0.01
#define DELAY_TICKS 11           /* at most, rounded up, with one more for a part */
#define STATES (2 + DELAY_TICKS) /* of the loop: place, velocity, the forces of ticks */
#define RATES 3

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

static const double rates[RATES] = {1000.0, 4000.0, 10000.0};

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

/* Of one rate. */
typedef struct zwidth_table {
  double tick_s;
  size_t walls;
  zwidth_row rows[DEVICES][WALLS_MAX];
  double coupling[DEVICES]; /* N/m */
} zwidth_table;

typedef struct zwidth_tables {
  size_t count;
  zwidth_table of[RATES];
} zwidth_tables;

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
static matrix loop_of(const zwidth_device *d, double tick_s, double k, double b)
{
  matrix m = {{{0.0}}};
  int whole = (int)floor(d->delay / tick_s + 1e-9);
  double part = d->delay - whole * tick_s;
  motion before = motion_of(d, part);
  motion after = motion_of(d, tick_s - part);
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
static bool loop_is_stable(const zwidth_device *d, double tick_s, double k, double b)
{
  matrix m = loop_of(d, tick_s, k, b);
  double log_norm = 0.0;
  for (int i = 0; i < 40; ++i) {
    log_norm = 2.0 * log_norm + log(matrix_square(&m));
  }
  return log_norm < 0.0;
}

/* ---- the loop, as it is ---- */

/* The trace of a run: rms about the mean of two windows after the kick. */
typedef struct swing {
  size_t begin[2]; /* ticks */
  size_t ticks;    /* of a window */
  double from[2];  /* m, first place: what is left may be picometres */
  double sum[2];
  double square[2];
  size_t apart; /* ticks of the late window without contact */
} swing;

static void take_tick(swing *s, size_t tick, const hap_pointer_state *state)
{
  bool early = tick >= s->begin[0] && tick < s->begin[0] + s->ticks;
  bool late = tick >= s->begin[1];
  double z = state->device.position[2] + PORT_RADIUS;
  if (early || late) {
    s->from[late] = tick == s->begin[late] ? z : s->from[late];
    z -= s->from[late];
    s->sum[late] += z;
    s->square[late] += z * z;
    s->apart += late && state->contacts == 0;
  }
}

static double rms_of(const swing *s, int window)
{
  double mean = s->sum[window] / (double)s->ticks;
  return sqrt(fmax(0.0, s->square[window] / (double)s->ticks - mean * mean));
}

typedef struct trial {
  const zwidth_device *device;
  double tick_s;
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
  swing s = {.begin = {(size_t)lround(EARLY_S / t->tick_s), (size_t)lround(LATE_S / t->tick_s)},
             .ticks = (size_t)lround(WINDOW_S / t->tick_s)};
  char device[512];
  port_def def = {.body = PORT_WALL,
                  .haptic_hz = 1.0 / t->tick_s,
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
  for (size_t i = 0; i < s.begin[1] + s.ticks && status >= HAP_OK; ++i) {
    status = port_advance(b, &p);
    take_tick(&s, i, &p.state);
  }
  port_close(&p);
  double left = rms_of(&s, 1);
  t->stable = s.apart == 0 && (left < rms_of(&s, 0) || left < STILL * DEPTH);
  return status;
}

/* ---- limits ---- */

static double linear_limit(const zwidth_device *d, double tick_s, double b)
{
  double low = STIFFNESS_LEAST;
  double high = STIFFNESS_MOST;
  if (!loop_is_stable(d, tick_s, low, b)) {
    return 0.0;
  }
  while (high > low * 1.00001) {
    double middle = sqrt(low * high);
    *(loop_is_stable(d, tick_s, middle, b) ? &low : &high) = middle;
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
             .tick_s = PORT_TICK_S,
             .k = STIFFNESS_MOST,
             .coupling = coupling,
             .given = coupling != HAP_COUPLING_DIRECT};
  return stiffest_find(b, &t, 10.0 * STIFFNESS_LEAST, COUPLING_STEP, out);
}

/* Behind a proxy every wall is to be stable: tried from soft to stiff, up to the first that is
 * not. */
static hap_status find_proxy(bench *b, const zwidth_table *table, size_t device, zwidth_row *row)
{
  static const double tried[] = {30.0, 100.0, 300.0, 1e3, 3e3, 1e4, 1e5, STIFFNESS_MOST};
  trial t = {.device = &devices[device],
             .tick_s = table->tick_s,
             .b = row->damping,
             .coupling_stiffness = table->coupling[device]};
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
static hap_status ask_coupling(bench *b, const zwidth_device *d, double tick_s, double *out)
{
  port p;
  char device[512];
  trial t = {.device = d, .tick_s = tick_s, .k = 100.0};
  port_def def = {.body = PORT_WALL,
                  .haptic_hz = 1.0 / tick_s,
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
  double late = 0.5 * table->tick_s + d->delay;
  hap_status status = ask_coupling(b, d, table->tick_s, &table->coupling[device]);
  for (size_t i = 0; i < table->walls && status >= HAP_OK; ++i) {
    zwidth_row *row = &table->rows[device][i];
    size_t wall = b->quick ? 3 * i : i;
    row->damping = walls[wall] * d->mass / table->tick_s;
    row->linear = linear_limit(d, table->tick_s, row->damping);
    row->passive = fmax(0.0, (d->damping - row->damping) / late);
    trial t = {
        .device = d, .tick_s = table->tick_s, .b = row->damping, .coupling = HAP_COUPLING_DIRECT};
    status = stiffest_find(b, &t, STIFFNESS_LEAST, STIFFNESS_STEP, &row->direct);
    if (status >= HAP_OK) {
      status = find_proxy(b, table, device, row);
    }
  }
  return status;
}

/* ---- output ---- */

static void table_write(FILE *csv, const zwidth_table *table)
{
  for (size_t d = 0; d < DEVICES; ++d) {
    for (size_t i = 0; i < table->walls; ++i) {
      const zwidth_row *r = &table->rows[d][i];
      fprintf(csv, "%s,%g,%g,%g,%g,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g,%g\n", devices[d].name,
              devices[d].mass, devices[d].damping, devices[d].delay, r->damping, r->direct,
              r->linear, r->passive, table->coupling[d], r->proxy, r->felt, 1.0 / table->tick_s);
    }
  }
}

static hap_status tables_write(bench *b, const zwidth_tables *tables)
{
  FILE *csv = bench_csv_open(b, "zwidth",
                             "device,mass,damping,delay,wall_damping,direct_stiffness,"
                             "linear_stiffness,passive_stiffness,coupling_stiffness,"
                             "proxy_stiffness,proxy_felt,haptic_hz");
  for (size_t i = 0; i < tables->count && csv != NULL; ++i) {
    table_write(csv, &tables->of[i]);
  }
  return bench_csv_close(b, csv, HAP_OK);
}

static void report_row(bench *b, const zwidth_table *table, size_t device, const zwidth_row *r)
{
  const char *name = devices[device].name;
  double khz = 1e-3 / table->tick_s;
  bool passive = r->direct >= r->passive / STIFFNESS_STEP;
  bool linear =
      r->linear > 0.0 ? bench_within(r->direct, r->linear, LINEAR_BOUND) : r->direct == 0.0;
  bench_check(b, passive && linear,
              "%s, %g kHz, wall of %.3g N s/m, direct: stable up to %.5g N/m, computed %.5g N/m "
              "(bound %g %%), passive up to %.5g N/m",
              name, khz, r->damping, r->direct, r->linear, 100.0 * LINEAR_BOUND, r->passive);
  bench_check(b, r->proxy == STIFFNESS_MOST,
              "%s, %g kHz, wall of %.3g N s/m, proxy: stable up to %.5g N/m, felt as %.5g N/m",
              name, khz, r->damping, r->proxy, r->felt);
}

/* Points of a rate, and the computed line. */
static void rate_data(FILE *script, const zwidth_table *table, size_t device)
{
  const zwidth_device *d = &devices[device];
  const double most = d->damping + walls[WALLS_MAX - 1] * d->mass / table->tick_s;
  fprintf(script, "$d%g << EOD\n", 1.0 / table->tick_s);
  for (size_t i = 0; i < table->walls; ++i) {
    const zwidth_row *r = &table->rows[device][i];
    fprintf(script, "%.6g %.6g %.6g\n", d->damping + r->damping, r->direct, r->felt);
  }
  fprintf(script, "EOD\n$l%g << EOD\n", 1.0 / table->tick_s);
  for (int i = 0; i <= 100; ++i) {
    double total = d->damping * pow(most / d->damping, i / 100.0);
    fprintf(script, "%.6g %.6g\n", total, linear_limit(d, table->tick_s, total - d->damping));
  }
  fprintf(script, "EOD\n");
}

static void device_draw(FILE *script, const zwidth_tables *tables, size_t device)
{
  const zwidth_device *d = &devices[device];
  const zwidth_table *fastest = &tables->of[tables->count - 1];
  const double most = d->damping + walls[WALLS_MAX - 1] * d->mass / fastest->tick_s;
  for (size_t i = 0; i < tables->count; ++i) {
    rate_data(script, &tables->of[i], device);
  }
  fprintf(script, "set title '%s'\nset xrange [%g:%g]\nplot", d->title, 0.9 * d->damping,
          1.1 * most);
  for (size_t i = 0; i < tables->count; ++i) {
    const zwidth_table *table = &tables->of[i];
    double hz = 1.0 / table->tick_s;
    size_t color = i + 1;
    fprintf(script,
            " $l%g using 1:2 with lines lt %zu title '%g kHz: linear loop, computed', "
            "(2 * %.9g - x) / %.9g with lines lt %zu dt 2 notitle, "
            "$d%g using 1:2 with points lt %zu pt 6 notitle, "
            "$d%g using 1:3 with points lt %zu pt 4 notitle,",
            hz, color, 1e-3 * hz, d->damping, 0.5 * table->tick_s + d->delay, color, hz, color, hz,
            color);
  }
  fprintf(script,
          " NaN with lines lc rgb '#606060' dt 2 title 'passive: b > K (T/2 + delay) + B', "
          "NaN with points lc rgb '#606060' pt 6 title 'direct: stiffest stable wall', "
          "NaN with points lc rgb '#606060' pt 4 title 'proxy: felt of 1 MN/m'");
  fprintf(script, "\n");
}

static void zwidth_draw(FILE *script, const void *data)
{
  const zwidth_tables *tables = data;
  fprintf(
      script,
      "set multiplot layout 2,2 title 'Z-width: the stiffest wall that each device holds, "
      "alone'\nset xlabel 'damping of device and wall b + B [N s/m]'\nset ylabel 'stiffness "
      "[N/m]'\n"
      "set logscale xy\nset yrange [0.1:2e6]\nset samples 1000\nset key bottom right font ',8'\n");
  for (size_t d = 0; d < DEVICES; ++d) {
    device_draw(script, tables, d);
  }
  fprintf(script, "unset multiplot\n");
}

static hap_status rate_run(bench *b, zwidth_table *table)
{
  for (size_t d = 0; d < DEVICES; ++d) {
    hap_status status = measure_device(b, d, table);
    if (status < HAP_OK) {
      return status;
    }
    for (size_t i = 0; i < table->walls; ++i) {
      report_row(b, table, d, &table->rows[d][i]);
    }
  }
  return HAP_OK;
}

hap_status zwidth_run(bench *b)
{
  zwidth_tables tables;
  hap_status status = HAP_OK;
  const size_t count = b->quick ? 1 : RATES;
  memset(&tables, 0, sizeof tables);
  tables.count = count;
  for (size_t i = 0; i < count && status >= HAP_OK; ++i) {
    tables.of[i].tick_s = 1.0 / rates[i];
    tables.of[i].walls = b->quick ? (WALLS_MAX + 2) / 3 : WALLS_MAX;
    status = rate_run(b, &tables.of[i]);
  }
  status = status >= HAP_OK ? tables_write(b, &tables) : status;
  return status >= HAP_OK ? bench_draw(b, "zwidth", 1000, 760, zwidth_draw, &tables) : status;
}
