/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* hapode-bench peers: the same worlds, hand and pointer in a session and in engines that are
 * stepped at the rate of the hand: 1 kHz, and in small worlds 4 and 10 kHz. Times are medians over
 * runs that are interleaved engine by engine. */

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include "bench/peers_run.h"
#include "bench/points.h"
#include "bench/progress.h"

#include "base/log.h"

#define PEERS_COLUMNS                                                                             \
  "engine,world,bodies,physics_hz,us_per_ms,p99_us,force_rel_rms,force_rel_ode"                   \
  ",iterations,peak_n,rest_mm,asleep,repeats,haptic_hz,tick_us,contact_us,physics_us,truth_floor" \
  ",force_rel_own"

#define REPEATS 5
#define REPEATS_QUICK 3
#define USUAL_HZ 1000.0
#define RATE_HZ_LEAST 100.0
#define RATE_HZ_MOST 20000.0
#define TRUTH_ITERATIONS 1000
#define PHYSICS_HZ_MOST 1000.0 /* of a session */
#define TRUTH_BOXES_MOST 100   /* larger worlds take a truth too long */
#define TRUTH_TICKS_MOST 40000 /* two seconds at RATE_HZ_MOST */
#define LARGE_ITERATIONS 50    /* of ODE's there: 150 boxes are 0.8 % off one of 200 */
#define LARGE_BOXES_MOST 400
#define NUDGE 1e-7           /* m: single precision at 1 m still tells it */
#define APART_TRUTH_BOXES 10 /* nothing but the floor touches the one that the hand meets */
#define SLEEP_SETTLE_S 0.8   /* until all sleep */
#define FIRST_WITHIN 0.1     /* of ODE's force while friction holds the box */
#define REST_MOST 5e-4       /* m, way of a box that nobody touches */
#define USUAL_PILE 100       /* boxes that a session has places for by default */
#define STANDING_PILE 200    /* boxes: friction holds the hand */
#define STANDING_WITHIN 0.005
#define BODIES_MOST 1024
#define CONTACTS_MOST 8192.0
#define BRICK_CONTACTS 24.0
#define CONTESTANTS_MOST 8
#define SIZES_MOST 8
#define ROWS_MOST 256
#define ONE_PANEL "1,1"
#define PEERS_KEYS "engine, world, bodies, physics_hz, haptic_hz"
#define ALL_PANELS "2,4" /* rows, columns: one of each world */

typedef struct world_plan {
  const char *name;
  int sizes[SIZES_MOST]; /* boxes; 0: end */
  int quick_most;        /* with --quick no larger world */
  double force_within;   /* error of a session's force against ODE's */
} world_plan;

static const world_plan plans[] = {
    {"apart", {10, 100, 1000, 3000}, 1000, 0.005},
    {"apart_sleep", {100, 1000, 3000}, 1000, 0.005},
    {"row", {10, 30, 64, 100}, 64, 0.02},
    {"pile", {10, 30, 64, 100, 300, 1000}, 64, 0.05},
    {"tower", {8}, 8, 0.02},
    {"chain", {10}, 10, 0.01},
    {"ragdoll", {10}, 10, 0.08},
    {"mesh", {1}, 1, 0.005},
};

/* A world, and the rate of the hand. */
typedef struct peers_case {
  const char *world;
  int bodies;
  double haptic_hz;
} peers_case;

/* What runs at higher rates, too: one small world of each kind where bodies touch. */
static const peers_case fast_cases[] = {
    {"row", 10, 4000.0},  {"pile", 10, 4000.0},  {"tower", 8, 4000.0},  {"mesh", 1, 4000.0},
    {"row", 10, 10000.0}, {"pile", 10, 10000.0}, {"tower", 8, 10000.0}, {"mesh", 1, 10000.0},
};

/* A session, or an engine, which is stepped at the rate of the hand. */
typedef struct contestant {
  const peer_engine *engine; /* NULL: a session */
  double physics_hz;         /* of a session */
} contestant;

typedef struct peers_row {
  const contestant *who;
  peers_case of;
  double us_per_ms; /* medians */
  double p99_us;
  double parts[3];  /* us a ms: ticks, contact passes, cycles; NaN: of an engine */
  double error;     /* NaN: not known */
  double error_ode; /* likewise */
  double error_own; /* likewise */
  double floor;     /* of the truth that error is against; NaN: not known */
  double first;     /* at the begin of the touch, of ODE's; NaN: not known */
  size_t asleep;
  int repeats;
  peers_run run; /* the first one */
} peers_row;

typedef struct peers_bed {
  bench *bench;
  contestant who[CONTESTANTS_MOST];
  size_t who_count;
  peers_row rows[ROWS_MOST];
  size_t row_count;
} peers_bed;

static const char *contestant_name(const contestant *who)
{
  return who->engine != NULL ? who->engine->name : "hapode";
}

static bool world_sleeps(const char *name)
{
  return strcmp(name, "apart_sleep") == 0;
}

static void contestants_find(peers_bed *bed)
{
  const peer_engine *engine;
  bed->who[bed->who_count++].physics_hz = 60.0;
  bed->who[bed->who_count++].physics_hz = 20.0;
  for (size_t i = 0; (engine = peer_engine_at(i)) != NULL; ++i) {
    bed->who[bed->who_count++].engine = engine;
  }
}

static bool contestant_takes(const contestant *who, const peers_case *of)
{
  const peer_engine *engine = who->engine;
  return engine == NULL || (of->bodies * of->haptic_hz <= engine->boxes_most * USUAL_HZ &&
                            (engine->can_sleep || !world_sleeps(of->world)));
}

static double row_physics_hz(const peers_row *row)
{
  return row->who->engine != NULL ? row->of.haptic_hz : row->who->physics_hz;
}

/* ---- a case ---- */

/* As an application would for a pile of more than a session has places for. Bricks touch on all
 * sides, at 20 points, and others are near. */
static void session_room(const peers_case *of, peers_session_setting *io)
{
  if (strcmp(of->world, "pile") == 0 && of->bodies > USUAL_PILE) {
    io->range_bodies = of->bodies < BODIES_MOST ? of->bodies : BODIES_MOST;
    io->contacts = (int)fmin(BRICK_CONTACTS * of->bodies, CONTACTS_MOST);
  }
}

static hap_status row_run(bench *b, const peers_row *row, const peer_world *world, peers_run *out)
{
  const peer_engine *engine = row->who->engine;
  bool may_sleep = world_sleeps(row->of.world);
  if (engine == NULL) {
    peers_session_setting setting = {
        .physics_hz = row->who->physics_hz, .haptic_hz = row->of.haptic_hz, .may_sleep = may_sleep};
    session_room(&row->of, &setting);
    return peers_run_session(b, world, &setting, out);
  }
  peer_setting setting = {1.0 / row->of.haptic_hz, engine->iterations, may_sleep, false};
  return peers_run_engine(b, engine, world, &setting, out);
}

static void world_nudge(peer_world *world, double way)
{
  for (size_t i = 0; i < world->count; ++i) {
    world->boxes[i].at[i % 2] += i / 2 % 2 == 0 ? way : -way;
  }
}

/* Iterations of a truth; 0: it takes too long. */
static int truth_iterations(const peer_engine *engine, const peers_case *of)
{
  bool large = of->bodies > TRUTH_BOXES_MOST && strncmp(of->world, "apart", 5) != 0;
  bool may = engine == &peer_ode && of->bodies <= LARGE_BOXES_MOST;
  return !large ? TRUTH_ITERATIONS : may ? LARGE_ITERATIONS : 0;
}

/* engine NULL: a session that does all that it can, with physics at the rate of the hand. Where a
 * truth takes too long there is no force. nudge: m, how far boxes are aside at the begin. */
static hap_status truth_run(bench *b, const peer_engine *engine, const peers_case *of, double nudge,
                            peers_run *out)
{
  peer_world world;
  bool apart = strncmp(of->world, "apart", 5) == 0;
  const peer_setting setting = {1.0 / of->haptic_hz, truth_iterations(engine, of), false, true};
  const peers_session_setting whole = {.physics_hz = fmin(of->haptic_hz, PHYSICS_HZ_MOST),
                                       .haptic_hz = of->haptic_hz,
                                       .to_the_end = true};
  memset(out, 0, sizeof *out);
  if (setting.iterations == 0) {
    return HAP_OK;
  }
  if (!peer_world_create(apart ? "apart" : of->world, apart ? APART_TRUTH_BOXES : of->bodies,
                         &world)) {
    return bench_fail(b, HAP_ERROR_MEMORY, "no memory for %s", of->world);
  }
  world_nudge(&world, nudge);
  hap_status status = engine != NULL ? peers_run_engine(b, engine, &world, &setting, out)
                                     : peers_run_session(b, &world, &whole, out);
  peer_world_destroy(&world);
  return status;
}

/* How far it is from itself where each box begins a little aside: no error below that says
 * anything. */
typedef struct peers_truth {
  peers_run run;
  double floor; /* of the force; NaN: not known */
} peers_truth;

/* A truth that a child process computes at the same time. */
typedef struct truth_apart {
  pid_t pid;
  double (*force)[3]; /* of all ticks, in memory that both see */
  size_t count;
} truth_apart;

static hap_status apart_begin(bench *b, const peer_engine *engine, const peers_case *of,
                              truth_apart *out)
{
  peers_run run;
  out->count = TRUTH_TICKS_MOST;
  out->force = mmap(NULL, out->count * sizeof *out->force, PROT_READ | PROT_WRITE,
                    MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (out->force == MAP_FAILED) {
    return bench_fail(b, HAP_ERROR_MEMORY, "no memory for the forces");
  }
  fflush(NULL); /* the child writes nothing that stands in a buffer */
  out->pid = fork();
  if (out->pid == 0) {
    hap_status status = truth_run(b, engine, of, NUDGE, &run);
    bool fits = status >= HAP_OK && run.count <= out->count;
    if (fits) {
      memcpy(out->force, run.force, run.count * sizeof *run.force);
    } else {
      fprintf(stderr, "second truth of %s: %s\n", of->world, b->detail.text);
    }
    _exit(fits ? EXIT_SUCCESS : EXIT_FAILURE);
  }
  return out->pid > 0 ? HAP_OK : bench_fail(b, HAP_ERROR_IO, "no process for a second truth");
}

/* io_floor: how far it is from the other one. */
static hap_status apart_end(bench *b, truth_apart *apart, const peers_run *truth, double *io_floor)
{
  int how = 0;
  bool ended = apart->pid > 0 && waitpid(apart->pid, &how, 0) == apart->pid && WIFEXITED(how) &&
               WEXITSTATUS(how) == EXIT_SUCCESS;
  if (ended && truth->force != NULL) {
    const peers_run aside = {.count = truth->count, .force = apart->force};
    *io_floor = peers_run_error(&aside, truth);
  }
  munmap(apart->force, apart->count * sizeof *apart->force);
  return ended ? HAP_OK : bench_fail(b, HAP_ERROR_STATE, "a second truth has failed");
}

static hap_status truth_find(bench *b, const peer_engine *engine, const peers_case *of,
                             peers_truth *out)
{
  truth_apart apart = {0};
  bool twice = truth_iterations(engine, of) == TRUTH_ITERATIONS;
  memset(out, 0, sizeof *out);
  out->floor = (double)NAN;
  if (twice) {
    HAPI_TRY(apart_begin(b, engine, of, &apart));
  }
  hap_status status = truth_run(b, engine, of, 0.0, &out->run);
  if (twice) {
    hap_status ended = apart_end(b, &apart, &out->run, &out->floor);
    status = status < HAP_OK ? status : ended;
  }
  return status;
}

/* session: of sessions, their own. */
static hap_status row_judge(bench *b, const peer_world *world, const peers_truth *ode,
                            const peers_run *session, peers_row *row)
{
  const peer_engine *engine = row->who->engine;
  peers_truth own = {{0}};
  hap_status status = HAP_OK;
  row->first = (double)NAN;
  if (ode->run.force != NULL) {
    row->first = peers_run_first(world, &row->run) / peers_run_first(world, &ode->run);
  }
  row->error = row->error_ode = peers_run_error(&row->run, &ode->run);
  row->floor = ode->floor;
  if (engine != NULL && engine != &peer_ode) {
    status = truth_find(b, engine, &row->of, &own);
    row->error = status >= HAP_OK ? peers_run_error(&row->run, &own.run) : (double)NAN;
    row->floor = own.floor;
    peers_run_free(&own.run);
  }
  row->error_own = engine == NULL ? peers_run_error(&row->run, session) : row->error;
  return status;
}

/* Of the medians of each tick over the repeats, which are alike: a disturbance of one of them does
 * not show. */
static double ticks_p99(const peers_run *runs, size_t repeats, double *out_mean)
{
  double values[REPEATS];
  double *ticks = calloc(runs[0].count, sizeof *ticks);
  *out_mean = (double)NAN;
  if (ticks == NULL) {
    return (double)NAN;
  }
  double sum = 0.0;
  for (size_t i = 0; i < runs[0].count; ++i) {
    for (size_t n = 0; n < repeats; ++n) {
      values[n] = runs[n].tick_us[i];
    }
    ticks[i] = bench_median(values, repeats);
    sum += ticks[i];
  }
  *out_mean = sum / (double)runs[0].count;
  (void)bench_median(ticks, runs[0].count); /* sorts */
  double p99 = bench_quantile(ticks, runs[0].count, 0.99);
  free(ticks);
  return p99;
}

static void row_note_times(peers_row *row, peers_run *runs, size_t repeats)
{
  double us[REPEATS];
  double parts[2][REPEATS];
  double mean;
  for (size_t n = 0; n < repeats; ++n) {
    us[n] = runs[n].us_per_ms;
    parts[0][n] = runs[n].parts.contact;
    parts[1][n] = runs[n].parts.physics;
  }
  row->repeats = (int)repeats;
  row->us_per_ms = bench_median(us, repeats);
  row->parts[1] = bench_median(parts[0], repeats);
  row->parts[2] = bench_median(parts[1], repeats);
  row->p99_us = ticks_p99(runs, repeats, &mean);
  row->parts[0] = row->who->engine == NULL ? 1e-3 * row->of.haptic_hz * mean : (double)NAN;
  row->run = runs[0];
  memset(&runs[0], 0, sizeof runs[0]);
}

/* Engine after engine, and that again. rows: one of each. */
static hap_status case_time(bench *b, const peer_world *world, peers_row *rows, size_t count)
{
  peers_run runs[CONTESTANTS_MOST][REPEATS] = {{{0}}};
  size_t repeats = b->quick ? REPEATS_QUICK : REPEATS;
  hap_status status = HAP_OK;
  for (size_t n = 0; n < repeats; ++n) {
    for (size_t i = 0; i < count && status >= HAP_OK; ++i) {
      status = row_run(b, &rows[i], world, &runs[i][n]);
    }
  }
  for (size_t i = 0; i < count; ++i) {
    if (status >= HAP_OK) {
      row_note_times(&rows[i], runs[i], repeats);
    }
    for (size_t n = 0; n < repeats; ++n) {
      peers_run_free(&runs[i][n]);
    }
  }
  return status;
}

static void number_write(FILE *csv, double value)
{
  if (isnan(value)) {
    fputc(',', csv);
  } else {
    fprintf(csv, ",%.5g", value);
  }
}

static void row_write(FILE *csv, const peers_row *r)
{
  int iterations = r->who->engine != NULL ? r->who->engine->iterations : peer_ode.iterations;
  fprintf(csv, "%s,%s,%d,%g,%.5g,%.5g", contestant_name(r->who), r->of.world, r->of.bodies,
          row_physics_hz(r), r->us_per_ms, r->p99_us);
  number_write(csv, r->error);
  number_write(csv, r->error_ode);
  fprintf(csv, ",%d,%.5g,%.4g,%zu,%d,%g", iterations, peers_run_peak(&r->run), 1e3 * r->run.rest,
          r->run.asleep, r->repeats, r->of.haptic_hz);
  for (int k = 0; k < 3; ++k) {
    number_write(csv, r->parts[k]);
  }
  number_write(csv, r->floor);
  number_write(csv, r->error_own);
  fputc('\n', csv);
}

static void error_text(double error, char *out, size_t size)
{
  if (isnan(error)) {
    snprintf(out, size, "-");
  } else {
    snprintf(out, size, "%.2f %%", 100.0 * error);
  }
}

/* Bricks that slip share their load as a solver finds it: a session is held against itself. Those
 * of larger piles stand, and their force is that of the hand's spring. */
static void force_check(bench *b, const peers_row *r, const char *name)
{
  /* A force that is no number, or none at all, has no error that could be too large. */
  bench_check(b, peers_run_error(&r->run, &r->run) == 0.0, "%s: a force that is a number", name);
  bool slips = strcmp(r->of.world, "pile") == 0 && r->of.bodies < STANDING_PILE;
  bool stands = strcmp(r->of.world, "pile") == 0 && !slips;
  double error = slips ? r->error_own : r->error_ode;
  for (size_t i = 0; i < BENCH_COUNT(plans) && r->who->engine == NULL && !isnan(error); ++i) {
    double within = stands ? STANDING_WITHIN : plans[i].force_within;
    if (strcmp(r->of.world, plans[i].name) == 0) {
      bench_check(b, error <= within, "%s: force %.2f %% off %s (bound %.1f)", name, 100.0 * error,
                  slips ? "its own solved to the end" : "ODE's", 100.0 * within);
    }
  }
}

static void row_report(bench *b, const peers_row *r)
{
  char error[32];
  char error_ode[32];
  char error_own[32];
  char floor[32];
  char name[64];
  size_t asleep = world_sleeps(r->of.world) ? (size_t)r->of.bodies : 0;
  error_text(r->error, error, sizeof error);
  error_text(r->error_ode, error_ode, sizeof error_ode);
  error_text(r->error_own, error_own, sizeof error_own);
  error_text(r->floor, floor, sizeof floor);
  snprintf(name, sizeof name, "%s:%d@%g, %s %g Hz", r->of.world, r->of.bodies, r->of.haptic_hz,
           contestant_name(r->who), row_physics_hz(r));
  bench_say("%-36s %8.1f us a ms, p99 %8.1f us, force %s (floor %s), of ODE's %s, of its own %s",
            name, r->us_per_ms, r->p99_us, error, floor, error_ode, error_own);
  if (r->run.cut) {
    bench_say("%-36s the range ends after %zu of %d boxes", name, r->run.owned, r->of.bodies);
  }
  if (b->verify) {
    bench_check(b, isnan(r->first) || fabs(r->first - 1.0) <= FIRST_WITHIN,
                "%s: first force %.3f of ODE's (bound %g)", name, r->first, FIRST_WITHIN);
    bench_check(b, r->run.rest <= REST_MOST, "%s: at rest a box goes %.3f mm (bound %.1f)", name,
                1e3 * r->run.rest, 1e3 * REST_MOST);
    bench_check(b, r->run.asleep == asleep, "%s: %zu boxes asleep (right: %zu)", name,
                r->run.asleep, asleep);
    force_check(b, r, name);
  }
}

/* What a case takes, roughly: bodies at a rate, and something for the rest. */
static double case_cost(const peers_case *of)
{
  return 10.0 + of->bodies * of->haptic_hz / USUAL_HZ;
}

/* Whether --only takes the row; else why not is said. */
static hap_status contestant_joins(bench *b, const contestant *who, const peers_case *of,
                                   bool *out_joins)
{
  const point_field fields[] = {
      {"engine", contestant_name(who), 0.0},
      {"world", of->world, 0.0},
      {"bodies", NULL, of->bodies},
      {"physics_hz", NULL, who->engine != NULL ? of->haptic_hz : who->physics_hz},
      {"haptic_hz", NULL, of->haptic_hz},
  };
  HAPI_TRY(points_filter(b, fields, BENCH_COUNT(fields), PEERS_KEYS, out_joins));
  if (*out_joins && !contestant_takes(who, of)) {
    bench_say("%s:%d@%g without %s, which %s", of->world, of->bodies, of->haptic_hz,
              contestant_name(who),
              world_sleeps(of->world) ? "does not sleep" : "would take too long");
    *out_joins = false;
  }
  return HAP_OK;
}

static hap_status case_run(peers_bed *bed, FILE *csv, const peers_case *of)
{
  bench *b = bed->bench;
  peer_world world;
  peers_truth ode_truth = {{0}};
  peers_run session_truth = {0};
  peers_row *rows = &bed->rows[bed->row_count];
  size_t count = 0;
  if (!peer_world_create(of->world, of->bodies, &world)) {
    return bench_fail(b, HAP_ERROR_ARGUMENT, "no world %s of %d boxes", of->world, of->bodies);
  }
  hap_status status = HAP_OK;
  for (size_t i = 0; i < bed->who_count && status >= HAP_OK; ++i) {
    bool joins = false;
    status = contestant_joins(b, &bed->who[i], of, &joins);
    if (joins) {
      rows[count++] = (peers_row){.who = &bed->who[i], .of = *of};
    }
  }
  if (world_sleeps(of->world)) {
    world.hand.settle_s = SLEEP_SETTLE_S;
  }
  bed->row_count += count;
  if (status >= HAP_OK) {
    status = case_time(b, &world, rows, count);
  }
  if (status >= HAP_OK && count > 0) {
    status = truth_find(b, &peer_ode, of, &ode_truth);
  }
  if (status >= HAP_OK && count > 0 && rows[0].who->engine == NULL) { /* sessions come first */
    status = truth_run(b, NULL, of, 0.0, &session_truth);
  }
  for (size_t i = 0; i < count && status >= HAP_OK; ++i) {
    status = row_judge(b, &world, &ode_truth, &session_truth, &rows[i]);
    row_write(csv, &rows[i]);
    row_report(b, &rows[i]);
  }
  peers_run_free(&ode_truth.run);
  peers_run_free(&session_truth);
  peer_world_destroy(&world);
  progress_add(1, case_cost(of));
  return status;
}

/* Forces of all ticks, where there are few worlds. */
static hap_status forces_write(const peers_bed *bed)
{
  FILE *csv = bench_csv_open(bed->bench, "peers_trace",
                             "engine,world,bodies,physics_hz,tick,fx,fy,fz,haptic_hz");
  for (size_t i = 0; csv != NULL && i < bed->row_count; ++i) {
    const peers_row *r = &bed->rows[i];
    for (size_t n = 0; n < r->run.count; ++n) {
      const double *f = r->run.force[n];
      fprintf(csv, "%s,%s,%d,%g,%zu,%.6g,%.6g,%.6g,%g\n", contestant_name(r->who), r->of.world,
              r->of.bodies, row_physics_hz(r), n, f[0], f[1], f[2], r->of.haptic_hz);
    }
  }
  return bench_csv_close(bed->bench, csv, HAP_OK);
}

/* ---- pictures ---- */

static double bed_hz(const peers_bed *bed)
{
  return bed->row_count > 0 ? bed->rows[0].of.haptic_hz : USUAL_HZ;
}

/* Of the rate of the first row: other rates are in the table alone. */
static bool row_is(const peers_bed *bed, const peers_row *r, size_t who, size_t plan)
{
  return r->who == &bed->who[who] && strcmp(r->of.world, plans[plan].name) == 0 &&
         r->of.haptic_hz == bed_hz(bed);
}

static void costs_data(FILE *script, const peers_bed *bed, size_t who, size_t plan)
{
  fprintf(script, "$c%zu_%zu << EOD\n", plan, who);
  for (size_t i = 0; i < bed->row_count; ++i) {
    const peers_row *r = &bed->rows[i];
    if (row_is(bed, r, who, plan)) {
      fprintf(script, "%d %g %g\n", r->of.bodies, r->us_per_ms, r->p99_us);
    }
  }
  fprintf(script, "EOD\n");
}

/* Of a world the cases of one contestant. */
static size_t costs_count(const peers_bed *bed, size_t who, size_t plan)
{
  size_t count = 0;
  for (size_t i = 0; i < bed->row_count; ++i) {
    count += row_is(bed, &bed->rows[i], who, plan);
  }
  return count;
}

static void costs_panel(FILE *script, const peers_bed *bed, size_t plan)
{
  bool any = false;
  fprintf(script, "set title '%s' noenhanced\n", plans[plan].name);
  for (size_t who = 0; who < bed->who_count; ++who) {
    if (costs_count(bed, who, plan) > 0) {
      fprintf(script, "%s $c%zu_%zu using 1:2 with linespoints lt %zu pt 7 ps 0.5 title '%s%s'",
              any ? "," : "plot", plan, who, who + 1, contestant_name(&bed->who[who]),
              bed->who[who].engine != NULL     ? ""
              : bed->who[who].physics_hz > 20. ? " 60 Hz"
                                               : " 20 Hz");
      any = true;
    }
  }
  fprintf(script, "\n");
}

static bool plan_was_run(const peers_bed *bed, size_t plan)
{
  size_t count = 0;
  for (size_t who = 0; who < bed->who_count; ++who) {
    count += costs_count(bed, who, plan);
  }
  return count > 0;
}

static void costs_draw(FILE *script, const void *data)
{
  const peers_bed *bed = data;
  for (size_t plan = 0; plan < BENCH_COUNT(plans); ++plan) {
    for (size_t who = 0; who < bed->who_count; ++who) {
      costs_data(script, bed, who, plan);
    }
  }
  fprintf(script,
          "set linetype 7 lc rgb '#000000' lw 1.5\nset logscale xy\nset format y '%%g'\n"
          "set xlabel 'bodies'\nset ylabel 'us a simulated ms'\n"
          "set key top left font ',9'\nset multiplot layout %s\n",
          bed->bench->scene != NULL ? ONE_PANEL : ALL_PANELS);
  for (size_t plan = 0; plan < BENCH_COUNT(plans); ++plan) {
    if (plan_was_run(bed, plan)) {
      costs_panel(script, bed, plan);
    }
  }
  fprintf(script, "unset multiplot\n");
}

/* The smallest world of each kind: force along the hand's path. */
static const peers_row *force_row(const peers_bed *bed, size_t who, size_t plan)
{
  for (size_t i = 0; i < bed->row_count; ++i) {
    if (row_is(bed, &bed->rows[i], who, plan)) {
      return &bed->rows[i];
    }
  }
  return NULL;
}

static void forces_draw(FILE *script, const void *data)
{
  const peers_bed *bed = data;
  for (size_t plan = 0; plan < BENCH_COUNT(plans); ++plan) {
    for (size_t who = 0; who < bed->who_count; ++who) {
      const peers_row *r = force_row(bed, who, plan);
      fprintf(script, "$f%zu_%zu << EOD\n", plan, who);
      for (size_t i = 0; r != NULL && i < r->run.count; ++i) {
        fprintf(script, "%g %g\n", 1e3 * r->run.tick_s * (double)i, -r->run.force[i][0]);
      }
      fprintf(script, "EOD\n");
    }
  }
  fprintf(script,
          "set linetype 7 lc rgb '#000000' lw 1.5\nset xlabel 'ms'\n"
          "set ylabel 'force along -x [N]'\nset key bottom right font ',9'\n"
          "set multiplot layout %s\n",
          bed->bench->scene != NULL ? ONE_PANEL : ALL_PANELS);
  for (size_t plan = 0; plan < BENCH_COUNT(plans); ++plan) {
    const peers_row *first = force_row(bed, 0, plan);
    bool any = false;
    if (first == NULL) {
      continue;
    }
    fprintf(script, "set title '%s:%d' noenhanced\n", first->of.world, first->of.bodies);
    for (size_t who = 0; who < bed->who_count; ++who) {
      if (force_row(bed, who, plan) != NULL) {
        fprintf(script, "%s $f%zu_%zu using 1:2 with lines lt %zu title '%s %g Hz'",
                any ? "," : "plot", plan, who, who + 1, contestant_name(&bed->who[who]),
                row_physics_hz(force_row(bed, who, plan)));
        any = true;
      }
    }
    fprintf(script, "\n");
  }
  fprintf(script, "unset multiplot\n");
}

/* ---- the program ---- */

static bool plan_takes(const bench *b, const world_plan *plan, int bodies)
{
  return !b->quick || bodies <= plan->quick_most;
}

static void cases_count(const bench *b)
{
  size_t cases = BENCH_COUNT(fast_cases);
  double cost = 0.0;
  for (size_t i = 0; i < BENCH_COUNT(fast_cases); ++i) {
    cost += case_cost(&fast_cases[i]);
  }
  for (size_t i = 0; i < BENCH_COUNT(plans); ++i) {
    for (int n = 0; n < SIZES_MOST && plans[i].sizes[n] > 0; ++n) {
      if (plan_takes(b, &plans[i], plans[i].sizes[n])) {
        ++cases;
        cost += case_cost(&(peers_case){plans[i].name, plans[i].sizes[n], USUAL_HZ});
      }
    }
  }
  progress_begin("peers", "worlds", cases, cost);
}

static hap_status plan_run(peers_bed *bed, FILE *csv, const world_plan *plan, double haptic_hz)
{
  hap_status status = HAP_OK;
  for (int i = 0; i < SIZES_MOST && plan->sizes[i] > 0 && status >= HAP_OK; ++i) {
    peers_case of = {plan->name, plan->sizes[i], haptic_hz};
    if (plan_takes(bed->bench, plan, plan->sizes[i])) {
      status = case_run(bed, csv, &of);
    }
  }
  return status;
}

/* What follows a mark in "NAME[:N][@HZ]"; false: it is no number of that range. */
static bool number_after(const char *text, char mark, double least, double most, double *io)
{
  const char *at = strchr(text, mark);
  char *end;
  if (at == NULL) {
    return true;
  }
  *io = strtod(at + 1, &end);
  return end > at + 1 && (*end == '\0' || *end == '@') && *io >= least && *io <= most;
}

/* A world of the plans, all sizes or one, at 1 kHz or another rate. */
static hap_status scene_run(peers_bed *bed, FILE *csv, const char *scene)
{
  size_t length = strcspn(scene, ":@");
  double bodies = 0.0;
  double haptic_hz = USUAL_HZ;
  if (!number_after(scene, ':', 1.0, 1e5, &bodies) ||
      !number_after(scene, '@', RATE_HZ_LEAST, RATE_HZ_MOST, &haptic_hz)) {
    return bench_fail(bed->bench, HAP_ERROR_ARGUMENT, "--scene %s: NAME[:N][@HZ], %g to %g Hz",
                      scene, RATE_HZ_LEAST, RATE_HZ_MOST);
  }
  for (size_t i = 0; i < BENCH_COUNT(plans); ++i) {
    const char *name = plans[i].name;
    if (strncmp(name, scene, length) == 0 && name[length] == '\0') {
      peers_case of = {name, (int)bodies, haptic_hz};
      return of.bodies > 0 ? case_run(bed, csv, &of) : plan_run(bed, csv, &plans[i], haptic_hz);
    }
  }
  return bench_fail(bed->bench, HAP_ERROR_ARGUMENT, "no world %s", scene);
}

static hap_status worlds_run(peers_bed *bed, FILE *csv)
{
  hap_status status = HAP_OK;
  if (bed->bench->scene != NULL) {
    return scene_run(bed, csv, bed->bench->scene);
  }
  cases_count(bed->bench);
  for (size_t i = 0; i < BENCH_COUNT(plans) && status >= HAP_OK; ++i) {
    status = plan_run(bed, csv, &plans[i], USUAL_HZ);
  }
  for (size_t i = 0; i < BENCH_COUNT(fast_cases) && status >= HAP_OK; ++i) {
    status = case_run(bed, csv, &fast_cases[i]);
  }
  progress_end();
  return status;
}

hap_status bench_peers(bench *b)
{
  const char *missing;
  peers_bed *bed = calloc(1, sizeof *bed);
  if (bed == NULL) {
    return bench_fail(b, HAP_ERROR_MEMORY, "no memory for the table");
  }
  bed->bench = b;
  contestants_find(bed);
  for (size_t i = 0; (missing = peer_missing_at(i)) != NULL; ++i) {
    bench_say("left out: %s", missing);
  }
  FILE *csv = bench_csv_open(b, "peers", PEERS_COLUMNS);
  hap_status status = csv != NULL ? worlds_run(bed, csv) : HAP_ERROR_IO;
  status = bench_csv_close(b, csv, status);
  if (status >= HAP_OK && bed->row_count == 0) {
    status = bench_fail(b, HAP_ERROR_NOT_FOUND, "--only %s: there is no such row", b->only);
  }
  if (status >= HAP_OK && b->scene != NULL) {
    status = forces_write(bed);
  }
  if (status >= HAP_OK) {
    status = bench_draw(b, "peers", 1400, 700, costs_draw, bed);
  }
  if (status >= HAP_OK) {
    status = bench_draw(b, "peers_force", 1400, 700, forces_draw, bed);
  }
  for (size_t i = 0; i < bed->row_count; ++i) {
    peers_run_free(&bed->rows[i].run);
  }
  free(bed);
  return status;
}
