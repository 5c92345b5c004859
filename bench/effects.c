/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "bench/bench.h"
#include "bench/cycles.h"
#include "tools/rig.h"

/* What each effect costs in a scene. Lockstep, the scene's own hand. */

#define EFFECTS_SCENES_MAX 40
#define EFFECTS_VARIANTS_MAX 32
#define EFFECTS_ROUNDS_MAX 101

typedef struct effects_run {
  const scene_parameters *parameters;
  hap_model model;
  int count;      /* N of the scene; 0: its own */
  double seconds; /* 0: as long as the scene says */
  double physics_hz;
  int rounds;      /* at least; each has every variant once */
  double budget_s; /* of the processor's time: more rounds while there is some */
} effects_run;

typedef struct effects_result {
  double tick_us; /* medians over the rounds; this and the next two by the clock */
  double physics_ms;
  double contact_us;   /* a pass */
  double total_ms;     /* processor's time of a simulated second, all threads' work */
  uint32_t neighbours; /* most at once, at the syncs that were looked at */
  hap_effect_info effects[HAP_EFFECTS]; /* in the middle of the contact, see states_look */
  double *force;                        /* N, of all pointers, tick by tick; owned */
  size_t count;
} effects_result;

/* A way to run the scene. */
typedef struct effects_variant {
  hap_effect_wish wishes[HAP_EFFECTS]; /* one that the model cannot fulfil is auto */
  double aside;                        /* m, by which the bodies stand aside */
  effects_result result;
} effects_variant;

/* What is drawn: time of an effect that is on less that of it off, of auto, and of all. */
typedef struct effects_column {
  char scene[32];
  double off;               /* ms a simulated second, nothing but what cannot be off */
  double cost[HAP_EFFECTS]; /* ms a simulated second of one that is on, less with it off */
  double automatic;
  double all;
  bool each; /* cost was measured */
} effects_column;

/* Instructions of a tick: effects-tick, which lies beside this program, under valgrind's
 * callgrind, which counts inside of one function alone. */

static bool program_beside(const char *name, char *out, size_t size)
{
  char self[PATH_MAX];
  ssize_t length = readlink("/proc/self/exe", self, sizeof self - 1);
  if (length <= 0) {
    return false;
  }
  self[length] = '\0';
  char *slash = strrchr(self, '/');
  int used = snprintf(out, size, "%.*s/%s", slash != NULL ? (int)(slash - self) : 0, self, name);
  return used > 0 && (size_t)used < size && access(out, X_OK) == 0;
}

static bool effects_can_count(const char **out_why_not)
{
  char path[PATH_MAX];
  *out_why_not = NULL;
  if (system("valgrind --version >/dev/null 2>&1") != 0) { /* NOLINT(cert-env33-c): a fixed text */
    *out_why_not = "there is no valgrind";
  } else if (!program_beside("effects-tick", path, sizeof path)) {
    *out_why_not = "there is no effects-tick beside this program (ninja effects-tick)";
  }
  return *out_why_not == NULL;
}

/* "refs: N" or "Collected : N" of what callgrind says. */
static double count_read(FILE *in)
{
  char line[256];
  double count = -1.0;
  while (fgets(line, sizeof line, in) != NULL) {
    const char *at = strstr(line, "Collected : ");
    count = at != NULL ? strtod(at + strlen("Collected : "), NULL) : count;
  }
  return count;
}

/* The loop calls the two halves of a tick. */
static const char inside_tick[] = "hapi_tick_read --toggle-collect=hapi_tick_answer";

/* Of a tick with effects as name=state, in the function inside with all that it calls; -1:
 * unknown. */
static double effects_count(const char *in_scene, const char *name, const char *state,
                            const char *inside, int ticks)
{
  char program[PATH_MAX];
  char command[2 * PATH_MAX];
  if (!program_beside("effects-tick", program, sizeof program)) {
    return -1.0;
  }
  snprintf(command, sizeof command,
           "valgrind --tool=callgrind --callgrind-out-file=/dev/null --toggle-collect=%s "
           "'%s' %s %s=%s %d 2>&1",
           inside, program, in_scene, name, state, ticks);
  FILE *in = popen(command, "r"); /* NOLINT(cert-env33-c): names of the library's own */
  if (in == NULL) {
    return -1.0;
  }
  double count = count_read(in);
  return pclose(in) == 0 && count > 0.0 ? count / ticks : -1.0;
}

/* Above: what all scenes cost with everything on and as the library decides. Below: what single
 * effects cost in some of them. */

typedef struct sweep {
  bench *bench;
  FILE *csv;
  effects_column columns[EFFECTS_SCENES_MAX];
  size_t count;
} sweep;

/* Behind the six of all pictures: as many effects are drawn side by side. */
static const char *const more_colours[] = {"#000000", "#f0e442", "#882255", "#999999",
                                           "#332288", "#88ccaa", "#661100", "#bbcc33"};

static void each_draw(FILE *script, const sweep *s)
{
  fprintf(script, "$e << EOD\n");
  for (size_t i = 0; i < s->count; ++i) {
    if (s->columns[i].each) {
      fprintf(script, "\"%s\"", s->columns[i].scene);
      for (int k = 0; k < HAP_EFFECTS; ++k) {
        fprintf(script, " %.6g", fmax(s->columns[i].cost[k], 0.01));
      }
      fprintf(script, "\n");
    }
  }
  fprintf(
      script,
      "EOD\nset title 'an effect that is on, less with it off (below 0.01: lost in the noise)'\n"
      "set yrange [0.01:*]\nset key outside right top noenhanced\n");
  for (size_t i = 0; i < BENCH_COUNT(more_colours); ++i) {
    fprintf(script, "set linetype %zu lc rgb '%s' lw 1.5\n", 7 + i, more_colours[i]);
  }
  fprintf(script, "plot ");
  for (int k = 0; k < HAP_EFFECTS; ++k) {
    if (k != HAP_EFFECT_CROSS && k != HAP_EFFECT_RECORDING) {
      fprintf(script, "%s$e using %d%s lt %d title '%s'", k > 0 ? ", " : "", k + 2,
              k > 0 ? "" : ":xtic(1)", k + 1, hap_effect_name((hap_effect)k));
    }
  }
  fprintf(script, "\n");
}

static void effects_draw(FILE *script, const void *data)
{
  const sweep *s = data;
  bool any = false;
  for (size_t i = 0; i < s->count; ++i) {
    any = any || s->columns[i].each;
  }
  fprintf(script, "set multiplot layout %d,1\n$w << EOD\n", any ? 2 : 1);
  for (size_t i = 0; i < s->count; ++i) {
    fprintf(script, "\"%s\" %.6g %.6g\n", s->columns[i].scene, s->columns[i].all,
            s->columns[i].automatic);
  }
  fprintf(script,
          "EOD\nset title 'all on, and as the library decides'\n"
          "set ylabel 'ms a simulated second'\nset logscale y\nset style data histograms\n"
          "set style fill solid 0.8\nset xtics rotate by -60 noenhanced\nset key top left\n"
          "plot $w using 2:xtic(1) lt 2 title 'all on', $w using 3 lt 1 title 'auto'\n");
  if (any) {
    each_draw(script, s);
  }
  fprintf(script, "unset multiplot\n");
}

#define HAPTIC_HZ 1000.0
#define BLOCK 8u

/* The times of a variant, round by round. */
typedef struct times {
  double total_ms[EFFECTS_ROUNDS_MAX];
  double tick_us[EFFECTS_ROUNDS_MAX];
  double physics_ms[EFFECTS_ROUNDS_MAX];
  double contact_us[EFFECTS_ROUNDS_MAX];
} times;

static hap_status open_rig(bench *b, const effects_run *run, const effects_variant *variant,
                           rig *out)
{
  rig_options options;
  scene_parameters moved = *run->parameters;
  moved.shift[0] += variant->aside;
  rig_options_init(&options);
  options.parameters = &moved;
  options.count = run->count;
  options.def.drive = HAP_DRIVE_LOCKSTEP;
  options.def.model = run->model;
  options.def.physics_hz = run->physics_hz;
  options.def.haptic_hz = HAPTIC_HZ;
  options.expert.trace_rows = 2 * BLOCK;
  for (int i = 0; i < HAP_EFFECTS; ++i) {
    hap_effect_wish wish = variant->wishes[i];
    bool can = hap_effect_check((hap_effect)i, wish, run->model, NULL) >= HAP_OK;
    expert_wish(&options.expert, i, (can ? wish : HAP_EFFECT_AUTO));
  }
  hap_status status = rig_create(&options, out, &b->detail);
  return status >= HAP_OK ? bench_explain(b, out->session, hap_session_start(out->session))
                          : status;
}

static void take_rows(rig *r, effects_result *io)
{
  hap_trace_row rows[BLOCK];
  size_t got = 0;
  (void)hap_session_trace_read(r->session, rows, BLOCK, sizeof(hap_trace_row), &got);
  for (size_t i = 0; i < got; ++i) {
    for (size_t p = 0; p < r->pointer_count; ++p) {
      memcpy(&io->force[3 * (r->pointer_count * io->count + p)], rows[i].pointers[p].force,
             3 * sizeof(double));
    }
    ++io->count;
  }
}

/* The states are those of the last sync at which something was touched. */
static void states_look(rig *r, uint64_t *io_touched, effects_result *io)
{
  hap_stats stats;
  (void)hap_session_stats(r->session, &stats, sizeof stats);
  if (*io_touched == 0 || stats.loop.contact_ticks > *io_touched) {
    (void)hap_session_effects(r->session, io->effects, HAP_EFFECTS, sizeof io->effects[0]);
  }
  *io_touched = stats.loop.contact_ticks;
  io->neighbours =
      stats.model.neighbours > io->neighbours ? stats.model.neighbours : io->neighbours;
}

static hap_status run_once(bench *b, const effects_run *run, size_t ticks, effects_variant *io,
                           size_t round, times *out)
{
  rig r;
  hap_stats stats;
  hap_status status = open_rig(b, run, io, &r);
  uint64_t touched = 0;
  double used = 0.0;
  io->result.count = 0;
  for (size_t t = 0; t < ticks && status >= HAP_OK; t += BLOCK) {
    double begin = bench_used_seconds();
    status = bench_explain(b, r.session, hap_session_advance(r.session, BLOCK));
    used += bench_used_seconds() - begin;
    take_rows(&r, &io->result);
    states_look(&r, &touched, &io->result);
  }
  if (status >= HAP_OK) {
    (void)hap_session_stats(r.session, &stats, sizeof stats);
    out->total_ms[round] = 1e3 * used / ((double)ticks / HAPTIC_HZ);
    out->tick_us[round] = stats.loop.tick_us_mean;
    out->physics_ms[round] = stats.physics.ms_mean;
    out->contact_us[round] = stats.contact.us_mean;
    io->result.count *= r.pointer_count;
  }
  rig_destroy(&r);
  return status;
}

static hap_status run_rounds(bench *b, const effects_run *run, size_t ticks,
                             effects_variant *variants, size_t count, times *all)
{
  hap_status status = HAP_OK;
  double begin = bench_used_seconds();
  size_t round = 0;
  for (bool more = true; more && status >= HAP_OK; ++round) {
    for (size_t i = 0; i < count && status >= HAP_OK; ++i) {
      size_t which = round % 2 == 0 ? i : count - 1 - i;
      status = run_once(b, run, ticks, &variants[which], round, &all[which]);
    }
    double spent = bench_used_seconds() - begin;
    bool room = spent * (double)(round + 2) / (double)(round + 1) < run->budget_s;
    more = round + 1 < EFFECTS_ROUNDS_MAX && (round + 1 < (size_t)run->rounds || room);
  }
  for (size_t i = 0; i < count && status >= HAP_OK; ++i) {
    effects_result *out = &variants[i].result;
    out->total_ms = bench_median(all[i].total_ms, round);
    out->tick_us = bench_median(all[i].tick_us, round);
    out->physics_ms = bench_median(all[i].physics_ms, round);
    out->contact_us = bench_median(all[i].contact_us, round);
  }
  return status;
}

/* All variants in turn, forwards and backwards, so that what slows the machine down slows all of
 * them. */
static hap_status effects_run_variants(bench *b, const effects_run *run, effects_variant *variants,
                                       size_t count)
{
  double seconds = run->seconds > 0.0 ? run->seconds : run->parameters->duration;
  size_t ticks = (size_t)(seconds * HAPTIC_HZ) / BLOCK * BLOCK;
  times *all = calloc(count, sizeof *all);
  bool room = all != NULL;
  for (size_t i = 0; i < count; ++i) {
    effects_result *result = &variants[i].result;
    memset(result, 0, sizeof *result);
    result->force = calloc(ticks * 3 * SCENE_POINTERS_MAX, sizeof *result->force);
    room = room && result->force != NULL;
  }
  hap_status status = room ? run_rounds(b, run, ticks, variants, count, all)
                           : bench_fail(b, HAP_ERROR_MEMORY, "no memory for the runs of a scene");
  free(all);
  return status;
}

/* zeroed allowed */
static void effects_variants_finish(effects_variant *variants, size_t count)
{
  for (size_t i = 0; i < count; ++i) {
    free(variants[i].result.force);
  }
  memset(variants, 0, count * sizeof *variants);
}

/* Root of the sum of squares of the difference over that of the first; 0 without force. */
static double effects_difference(const effects_result *a, const effects_result *b)
{
  double of2 = 0.0;
  double apart2 = 0.0;
  for (size_t i = 0; i < 3 * a->count && i < 3 * b->count; ++i) {
    double apart = b->force[i] - a->force[i];
    of2 += a->force[i] * a->force[i];
    apart2 += apart * apart;
  }
  return of2 > 0.0 ? sqrt(apart2 / of2) : 0.0;
}

/* hapode-bench effects: each effect on, off and as the library decides, all on against all left
 * to the library, in models contact and accelerance. effects.csv and effects.svg. */

#define FORCE_BOUND 1e-3
#define EFFECTS_BOUND 0.2 /* of fig5 */
#define PILE_BOUND 0.3
#define OFF_BOUND 0.005
#define ASIDE 1e-6       /* m */
#define COUNT_TICKS 500  /* whose instructions are counted */
#define WHOLE_TICKS 1200 /* of fig5: all of it */

/* Of which each effect is measured by itself. */
static const char *const detailed[] = {"fig5",  "slide",  "row10",      "stack", "door",
                                       "grasp", "clump8", "lightstand", "lever"};

/* Of these, where a tick is short enough to be counted by the simulated processor. */
static const char *const counted[] = {"fig5", "slide", "door", "grasp"};

/* Variants of a scene; the single effects stand behind them. */
enum {
  ALL_ON,
  ALL_AUTO,
  ALL_OFF,
  ALL_ASIDE, /* on, with bodies that stand a little aside: what a force is exact to */
  WHOLES
};

/* A scene under measurement. */
typedef struct subject {
  sweep *sweep;
  effects_run run;
  const char *model;
  char name[32];
  bool each;              /* every effect by itself */
  bool counts;            /* their instructions as well */
  effects_column *column; /* NULL: it is not drawn */
  effects_variant variants[EFFECTS_VARIANTS_MAX];
  size_t count;
} subject;

static bool is_among(const char *name, const char *const *list, size_t count)
{
  for (size_t i = 0; i < count; ++i) {
    if (strcmp(list[i], name) == 0) {
      return true;
    }
  }
  return false;
}

static const char *reason_of(const effects_result *r, int effect)
{
  return hap_effect_reason_text((hap_effect_reason)r->effects[effect].reason);
}

static bool effect_can(const subject *s, int effect, hap_effect_wish wish)
{
  return hap_effect_check((hap_effect)effect, wish, s->run.model, NULL) >= HAP_OK;
}

/* ---- the table ---- */

typedef struct row {
  const char *effect;
  const char *state;
  const char *reason;
  double instructions;        /* a tick; -1: not counted */
  double force;               /* difference, see effects_difference */
  const hap_effect_info *own; /* NULL: it is of all */
} row;

static void print_number(FILE *csv, const char *format, double value)
{
  if (isfinite(value)) {
    fprintf(csv, format, value);
  }
}

static void print_row(const subject *s, const row *of, const effects_result *r)
{
  FILE *csv = s->sweep->csv;
  fprintf(csv, "%s,%s,%s,%s,%.4f,%.5f,", s->name, of->effect, of->state, of->reason, r->tick_us,
          r->physics_ms);
  print_number(csv, "%.0f", of->instructions >= 0.0 ? of->instructions : (double)NAN);
  fprintf(csv, ",%.4f,%.4f,%.3g,%s,", r->contact_us, r->total_ms, of->force, s->model);
  print_number(csv, "%.4f", of->own != NULL ? of->own->tick_us : (double)NAN);
  fprintf(csv, ",");
  print_number(csv, "%.5f", of->own != NULL ? of->own->physics_ms : (double)NAN);
  fprintf(csv, ",");
  print_number(csv, "%.4f", of->own != NULL ? of->own->contact_us : (double)NAN);
  fprintf(csv, "\n");
}

/* ---- all against all ---- */

static void print_wholes(const subject *s)
{
  const effects_result *on = &s->variants[ALL_ON].result;
  static const char *const states[] = {"on", "auto", "off"};
  static const char *const reasons[] = {"asked for", "", "asked for"};
  for (int i = 0; i < ALL_ASIDE; ++i) {
    const effects_result *r = &s->variants[i].result;
    const effects_result *against = i == ALL_ON ? &s->variants[ALL_ASIDE].result : r;
    print_row(s, &(row){"all", states[i], reasons[i], -1.0, effects_difference(on, against), NULL},
              r);
  }
}

/* Most of what a scene of one free body costs is no effect: device, messages, the step of the
 * world. So it is told as well what the effects add to that: a tenth of a millisecond in a
 * second, so with many rounds. */
static hap_status check_fig5(const subject *s)
{
  bench *b = s->sweep->bench;
  static effects_variant v[ALL_ASIDE];
  effects_run run = s->run;
  run.rounds = EFFECTS_ROUNDS_MAX;
  memset(v, 0, sizeof v);
  for (int i = 0; i < ALL_ASIDE; ++i) {
    memcpy(v[i].wishes, s->variants[i].wishes, sizeof v[i].wishes);
  }
  hap_status status = effects_run_variants(b, &run, v, ALL_ASIDE);
  double on = v[ALL_ON].result.total_ms;
  double off = v[ALL_OFF].result.total_ms;
  double automatic = v[ALL_AUTO].result.total_ms;
  effects_variants_finish(v, ALL_ASIDE);
  const char *why = NULL;
  if (status < HAP_OK) {
    return status;
  }
  bench_check(b, automatic <= EFFECTS_BOUND * on,
              "%s, %s: %.3f ms a second, all on %.3f: %.3f x (bound %g; all off %.3f x)", s->name,
              s->model, automatic, on, automatic / on, EFFECTS_BOUND, off / on);
  bench_say("%s, %s: effects take %.3f ms a second against %.3f: %.3f x", s->name, s->model,
            automatic - off, on - off, (automatic - off) / (on - off));
  if (!b->quick && effects_can_count(&why)) {
    on = effects_count("fig5", "all", "on", "hap_session_advance", WHOLE_TICKS);
    off = effects_count("fig5", "all", "off", "hap_session_advance", WHOLE_TICKS);
    automatic = effects_count("fig5", "all", "auto", "hap_session_advance", WHOLE_TICKS);
    bench_say(
        "%s, %s: %.0f instructions a tick with all that belongs to it, all on %.0f, all off "
        "%.0f: %.3f x all on, effects %.3f x",
        s->name, s->model, automatic, on, off, automatic / on, (automatic - off) / (on - off));
  }
  return HAP_OK;
}

static hap_status check_wholes(const subject *s)
{
  bench *b = s->sweep->bench;
  const effects_result *on = &s->variants[ALL_ON].result;
  const effects_result *automatic = &s->variants[ALL_AUTO].result;
  double apart = effects_difference(on, automatic);
  double floor = effects_difference(on, &s->variants[ALL_ASIDE].result);
  double ratio = automatic->total_ms / on->total_ms;
  bench_check(b, apart <= FORCE_BOUND,
              "%s, %s: force of auto is %.3g %% off that of all on (1 um aside: %.3g %%)", s->name,
              s->model, 100.0 * apart, 100.0 * floor);
  if (strcmp(s->name, "fig5") == 0 && s->run.model == HAP_MODEL_CONTACT) {
    return check_fig5(s);
  }
  if (strcmp(s->name, "pile:1000") == 0) {
    bench_check(b, automatic->neighbours == 1 && ratio <= PILE_BOUND,
                "%s, %s, most neighbours %u: %.3f ms a second against %.3f: %.3f x (bound %g)",
                s->name, s->model, automatic->neighbours, automatic->total_ms, on->total_ms, ratio,
                PILE_BOUND);
  } else {
    bench_say("%s, %s: %.3f ms a simulated second, all on %.3f: %.3f x", s->name, s->model,
              automatic->total_ms, on->total_ms, ratio);
  }
  return HAP_OK;
}

/* ---- one by one ---- */

/* The variants of single effects stand in the order in which add_each put them. */
static void print_each(const subject *s)
{
  const effects_result *automatic = &s->variants[ALL_AUTO].result;
  size_t next = WHOLES;
  for (int i = 0; i < HAP_EFFECTS && s->each; ++i) {
    const char *name = hap_effect_name((hap_effect)i);
    double total_ms[3] = {0.0, 0.0, 0.0};
    if (!effect_can(s, i, HAP_EFFECT_ON)) {
      continue;
    }
    print_row(s, &(row){name, "auto", reason_of(automatic, i), -1.0, 0.0, &automatic->effects[i]},
              automatic);
    for (int w = HAP_EFFECT_OFF; w <= HAP_EFFECT_ON; ++w) {
      if (effect_can(s, i, (hap_effect_wish)w)) {
        const effects_result *r = &s->variants[next++].result;
        const char *state = hap_effect_wish_name((hap_effect_wish)w);
        double count =
            s->counts ? effects_count(s->name, name, state, inside_tick, COUNT_TICKS) : -1.0;
        print_row(s,
                  &(row){name, state, reason_of(r, i), count, effects_difference(automatic, r),
                         &r->effects[i]},
                  r);
        total_ms[w] = r->total_ms;
      }
    }
    if (s->column != NULL) {
      s->column->cost[i] = total_ms[HAP_EFFECT_ON] - total_ms[HAP_EFFECT_OFF];
    }
  }
}

static effects_variant *add_variant(subject *s, hap_effect_wish wish)
{
  effects_variant *v = &s->variants[s->count++];
  for (int i = 0; i < HAP_EFFECTS; ++i) {
    v->wishes[i] = wish;
  }
  /* In this model it is another model of the world, which auto leaves to who asks for it. */
  if (wish == HAP_EFFECT_ON && s->run.model == HAP_MODEL_ACCELERANCE) {
    v->wishes[HAP_EFFECT_CROSS] = HAP_EFFECT_AUTO;
  }
  return v;
}

/* Beside the others, which the library decides on. */
static void add_each(subject *s)
{
  for (int i = 0; i < HAP_EFFECTS; ++i) {
    for (int w = HAP_EFFECT_OFF; w <= HAP_EFFECT_ON; ++w) {
      if (effect_can(s, i, HAP_EFFECT_ON) && effect_can(s, i, (hap_effect_wish)w)) {
        add_variant(s, HAP_EFFECT_AUTO)->wishes[i] = (hap_effect_wish)w;
      }
    }
  }
}

static hap_status subject_measure(subject *s)
{
  s->count = 0;
  (void)add_variant(s, HAP_EFFECT_ON);
  (void)add_variant(s, HAP_EFFECT_AUTO);
  (void)add_variant(s, HAP_EFFECT_OFF);
  if (s->run.count == 0) { /* a world that is large for its rate takes long */
    add_variant(s, HAP_EFFECT_ON)->aside = ASIDE;
  }
  if (s->each) {
    add_each(s);
  }
  hap_status status = effects_run_variants(s->sweep->bench, &s->run, s->variants, s->count);
  if (status >= HAP_OK) {
    print_wholes(s);
    print_each(s);
    status = check_wholes(s);
  }
  if (status >= HAP_OK && s->column != NULL) {
    memcpy(s->column->scene, s->name, sizeof s->column->scene);
    s->column->off = s->variants[ALL_OFF].result.total_ms;
    s->column->automatic = s->variants[ALL_AUTO].result.total_ms;
    s->column->all = s->variants[ALL_ON].result.total_ms;
    s->column->each = s->each;
  }
  effects_variants_finish(s->variants, s->count);
  return status;
}

static void subject_init(subject *s, sweep *of, const scene_parameters *parameters,
                         const char *name, hap_model model)
{
  bool draws = model == HAP_MODEL_CONTACT && of->count < EFFECTS_SCENES_MAX;
  memset(s, 0, sizeof *s);
  s->sweep = of;
  s->model = hap_model_name(model);
  s->column = draws ? &of->columns[of->count++] : NULL;
  s->run = (effects_run){.parameters = parameters, .model = model, .rounds = 1, .physics_hz = 60.0};
  snprintf(s->name, sizeof s->name, "%s", name);
}

static hap_status measure_scene(sweep *of, const scene_parameters *parameters, hap_model model)
{
  static subject s; /* the variants are large */
  bool quick = of->bench->quick;
  const char *why = NULL;
  subject_init(&s, of, parameters, parameters->name, model);
  s.run.rounds = quick ? 1 : 3;
  s.run.budget_s = quick ? 0.3 : 2.0;
  s.each =
      is_among(s.name, detailed, BENCH_COUNT(detailed)) && !(quick && strcmp(s.name, "slide") != 0);
  s.counts = model == HAP_MODEL_CONTACT && is_among(s.name, counted, BENCH_COUNT(counted)) &&
             !quick && effects_can_count(&why);
  return subject_measure(&s);
}

/* A thousand cubes of which the hand touches one; a few steps. */
static hap_status measure_pile(sweep *of)
{
  static subject s;
  scene_parameters pile = *cycles_scene("pile");
  pile.hands[0] = "virtual:path=0:-0.0105/0/0.025;0.1:-0.007/0/0.025,blend=smooth,hand=tense";
  subject_init(&s, of, &pile, "pile:1000", HAP_MODEL_CONTACT);
  s.run.count = 1000;
  s.run.seconds = 0.1;
  return subject_measure(&s);
}

/* ---- effects that are off ---- */

/* A tick with an effect off, as the library decides, and on, in one build: an effect that is off
 * costs no more than one that is on. */
static void check_off(sweep *s)
{
  static const hap_effect effects[] = {
      HAP_EFFECT_GYRO,     HAP_EFFECT_CONTACTS, HAP_EFFECT_JOINTS,
      HAP_EFFECT_FRICTION, HAP_EFFECT_TORQUE,   HAP_EFFECT_RESTITUTION,
      HAP_EFFECT_SHAPE,    HAP_EFFECT_PROXY,    HAP_EFFECT_OBSERVER};
  const char *in = s->bench->scene != NULL ? s->bench->scene : "slide";
  const char *why = NULL;
  if (!effects_can_count(&why)) {
    bench_skip(s->bench, "instructions are not counted: %s", why);
    return;
  }
  for (size_t i = 0; i < (s->bench->quick ? 1 : BENCH_COUNT(effects)); ++i) {
    const char *name = hap_effect_name(effects[i]);
    double off = effects_count(in, name, "off", inside_tick, COUNT_TICKS);
    double automatic = effects_count(in, name, "auto", inside_tick, COUNT_TICKS);
    double on = effects_count(in, name, "on", inside_tick, COUNT_TICKS);
    if (!(off > 0.0) || !(automatic > 0.0) || !(on > 0.0)) {
      bench_skip(s->bench, "%s: its instructions could not be counted", name);
      continue;
    }
    bench_check(s->bench, off <= (1.0 + OFF_BOUND) * on,
                "%s: a tick takes %.1f instructions with %s off, %.1f with auto (off: %+.3f %%), "
                "%.1f with on (off: %+.3f %%, bound %+g %%)",
                in, off, name, automatic, bench_percent(off, automatic), on, bench_percent(off, on),
                100.0 * OFF_BOUND);
  }
}

static hap_status measure_all(sweep *s)
{
  static const hap_model models[] = {HAP_MODEL_CONTACT, HAP_MODEL_ACCELERANCE};
  const char *only = s->bench->scene;
  bool pile = only == NULL || strcmp(only, "pile:1000") == 0;
  bool found = pile;
  hap_status status = HAP_OK;
  for (size_t m = 0; m < BENCH_COUNT(models); ++m) {
    for (size_t i = 0; scene_table_at(i) != NULL && status >= HAP_OK; ++i) {
      if (only == NULL || strcmp(only, scene_table_at(i)->name) == 0) {
        found = true;
        status = measure_scene(s, scene_table_at(i), models[m]);
      }
    }
  }
  if (status >= HAP_OK && !found) {
    return bench_fail(s->bench, HAP_ERROR_NOT_FOUND,
                      "--scene: there is no scene \"%s\" (hapode-run --list says which there are), "
                      "and it is not pile:1000",
                      only);
  }
  return status >= HAP_OK && pile ? measure_pile(s) : status;
}

hap_status bench_effects(bench *b)
{
  static sweep s; /* the columns are large */
  memset(&s, 0, sizeof s);
  s.bench = b;
  s.csv = bench_csv_open(b, "effects",
                         "scene,effect,state,reason,tick_us,physics_ms,instructions,contact_us,"
                         "total_ms,force_rel,model,own_tick_us,own_physics_ms,own_contact_us");
  hap_status status = s.csv != NULL ? measure_all(&s) : HAP_ERROR_IO;
  if (status >= HAP_OK && (b->scene == NULL || strchr(b->scene, ':') == NULL)) {
    check_off(&s);
  }
  status = bench_csv_close(b, s.csv, status);
  return status >= HAP_OK ? bench_draw(b, "effects", 1300, 950, effects_draw, &s) : status;
}
