/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* hapode-bench scaling, model CONTACT: what the local model costs that physics hands to the loop and
 * to the contact thread. The walk goes from the neighbours of the pointers over what touches, until
 * the loop's capacity is used. Pointers rest 2 mm above cubes of a row. After each physics cycle
 * plain ODE finds the contacts of the same scene in the same state and makes one global step. */

#include "bench/scaling_contact.h"

#include <stdlib.h>
#include <string.h>

#include "bench/bare.h"
#include "bench/cycles.h"
#include "tools/rig.h"

#define PHYSICS_HZ 20.0
#define LARGE_WORLD 1000
#define FAR_WORLD 4000 /* bodies, one or two of them near */
#define FAR_GAP 0.5    /* m: nothing but the floor comes into the range of the near one */
#define FAR_SHARE 0.05 /* of one global step: what the library does for all of them */
#define WARM_CYCLES 4
#define CYCLES_MAX 100
#define BUILD_SHARE 0.35 /* of one global step, ten cubes that touch */

typedef struct world_case {
  const char *scene;
  int bodies;
  int pointers;
  int range;
  double gap; /* m, between the bodies; 0: the scene's */
} world_case;

static const world_case cases[] = {
    {"fig7", 1, 1, 64},     {"fig7", 10, 1, 64},        {"fig7", 100, 1, 64},
    {"fig7", 1000, 1, 64},  {"fig7", FAR_WORLD, 1, 64}, {"row10", 1, 1, 64},
    {"row10", 10, 1, 64},   {"row10", 100, 1, 64},      {"row10", 1000, 1, 1},
    {"row10", 1000, 1, 4},  {"row10", 1000, 1, 16},     {"row10", 1000, 1, 64},
    {"row10", 1000, 4, 64}, {"row10", 1000, 16, 64},    {"fig7", FAR_WORLD, 1, 64, FAR_GAP},
};

/* Figures of a cycle; times in ms. */
enum {
  NEIGHBOUR, /* neighbours, nearest points, range */
  RANGE,     /* of that, the walk */
  PUBLISH,   /* reconcile, messages, poses */
  TESTING,
  STEP,
  BARE_STEP, /* dWorldQuickStep alone */
  FIGURES
};

typedef struct world_bed {
  const world_case *what;
  scene_parameters parameters;
  rig rig;
  bare bare;
  size_t cycles;
  double values[FIGURES][CYCLES_MAX];
  hap_stats stats; /* at the end */
  uint64_t probes; /* testing simulations of the cycles that were measured */
  char specs[RIG_POINTERS_MAX][64];
} world_bed;

static hap_status open_bed(bench *b, const world_case *what, world_bed *w)
{
  rig_options options;
  memset(w, 0, sizeof *w);
  w->what = what;
  w->cycles = what->bodies >= LARGE_WORLD ? (b->quick ? 6 : 20) : (b->quick ? 20 : CYCLES_MAX);
  rig_options_init(&options);
  scene_parameters *p = &w->parameters;
  *p = *cycles_scene(what->scene);
  p->gap = what->gap > 0.0 ? what->gap : p->gap;
  options.parameters = p;
  options.count = what->bodies;
  for (int i = 0; i < what->pointers; ++i) {
    double x = p->size / 2 + 4 * i * (p->size + p->gap);
    snprintf(w->specs[i], sizeof w->specs[i], "virtual:path=0:%.6f/0/%.6f,hand=rigid", x,
             p->size + p->radius + 0.002);
    options.devices[i] = w->specs[i];
  }
  options.device_count = (size_t)what->pointers;
  options.def.drive = HAP_DRIVE_LOCKSTEP;
  options.def.model = HAP_MODEL_CONTACT;
  options.def.physics_hz = PHYSICS_HZ;
  options.def.max_bodies = what->range;
  hap_status status = rig_create(&options, &w->rig, &b->detail);
  if (status >= HAP_OK) {
    status = bare_create(p, what->bodies, &w->bare, &b->detail);
  }
  return status >= HAP_OK ? hap_session_start(w->rig.session) : status;
}

static void close_bed(world_bed *w)
{
  bare_destroy(&w->bare);
  rig_destroy(&w->rig);
}

static double bare_step(world_bed *w)
{
  bare_follow(&w->bare, w->rig.scene);
  return 1e3 * bare_global_step(&w->bare, 1.0 / PHYSICS_HZ);
}

/* Who goes first, the library or plain ODE, finds colder caches: they take turns. */
static hap_status measure_cycle(world_bed *w, size_t i, uint64_t ticks)
{
  bool bare_first = i % 2 != 0;
  if (bare_first) {
    w->values[BARE_STEP][i] = bare_step(w);
  }
  hap_status status = hap_session_advance(w->rig.session, ticks);
  if (!bare_first) {
    w->values[BARE_STEP][i] = bare_step(w);
  }
  if (status >= HAP_OK) {
    status = hap_session_stats(w->rig.session, &w->stats, sizeof w->stats);
  }
  w->values[NEIGHBOUR][i] = w->stats.last_neighbour_ms;
  w->values[RANGE][i] = w->stats.last_range_ms;
  w->values[PUBLISH][i] = w->stats.last_publish_ms;
  w->values[TESTING][i] = w->stats.last_testing_ms;
  w->values[STEP][i] = w->stats.last_step_ms;
  return status;
}

/* Cycles begin at whole periods: the first tick of each period is its last here, so that plain ODE
 * comes next to the cycle. */
static hap_status measure(bench *b, const world_case *what, world_bed *w)
{
  const uint64_t ticks = (uint64_t)(CYCLES_HAPTIC_HZ / PHYSICS_HZ);
  hap_status status = open_bed(b, what, w);
  if (status >= HAP_OK) {
    status = hap_session_advance(w->rig.session, WARM_CYCLES * ticks + 1);
  }
  if (status >= HAP_OK) {
    status = hap_session_stats(w->rig.session, &w->stats, sizeof w->stats);
  }
  uint64_t before = w->stats.probe_steps;
  for (size_t i = 0; i < w->cycles && status >= HAP_OK; ++i) {
    status = measure_cycle(w, i, ticks);
  }
  w->probes = w->stats.probe_steps - before;
  for (int figure = 0; figure < FIGURES; ++figure) {
    (void)bench_median(w->values[figure], w->cycles); /* sorts */
  }
  return status;
}

static double middle(const world_bed *w, int figure)
{
  return bench_quantile(w->values[figure], w->cycles, 0.5);
}

static double build_ms(const world_bed *w)
{
  return middle(w, NEIGHBOUR) + middle(w, PUBLISH) + middle(w, TESTING);
}

static void write_row(FILE *csv, const world_bed *w)
{
  double probes = (double)w->probes / (double)w->cycles;
  double library = build_ms(w) - middle(w, TESTING);
  fprintf(csv, "%d,%u,contact,%.6g,%.6g,%.4g,%g,%.6g,%.6g,%.6g,%s,%d,%u,%.6g,%.6g,%g\n",
          w->what->bodies, w->stats.neighbours, build_ms(w), middle(w, STEP), w->stats.tick_us_p50,
          probes, middle(w, TESTING), middle(w, BARE_STEP), library, w->what->scene, w->what->range,
          w->stats.range_bodies, middle(w, RANGE), middle(w, PUBLISH), w->parameters.gap);
}

/* The bound is for bodies that are separate; where they are not, the range is as full as it can be. */
static void report_far(bench *b, const world_bed *w, double own, double step)
{
  hap_detail text;
  snprintf(text.text, sizeof text.text,
           "contact, %d cubes %g m apart, %u near, %u in the loop: library / global step = %.4f ms "
           "/ %.4f ms = %.2f %%, %.0f ns a body",
           w->what->bodies, w->parameters.gap, w->stats.neighbours, w->stats.range_bodies, own,
           step, 100.0 * own / step, 1e6 * own / w->what->bodies);
  if (w->what->gap > 0.0) {
    bench_check(b, own <= FAR_SHARE * step, "%s (bound 5 %%)", text.text);
  } else {
    bench_say("%s", text.text);
  }
}

static void report(bench *b, const world_bed *w)
{
  const world_case *what = w->what;
  double build = build_ms(w);
  double step = middle(w, BARE_STEP);
  bench_say(
      "contact, %s:%d, gap %g m, %u neighbours, %u of at most %d bodies in the loop: local model "
      "%.4f ms (neighbours %.4f, of it range %.4f, publish %.4f, testing %.4f), global step %.4f "
      "ms",
      what->scene, what->bodies, w->parameters.gap, w->stats.neighbours, w->stats.range_bodies,
      what->range, build, middle(w, NEIGHBOUR), middle(w, RANGE), middle(w, PUBLISH),
      middle(w, TESTING), step);
  if (what->bodies == 10 && strcmp(what->scene, "row10") == 0) {
    bench_check(b, build <= BUILD_SHARE * step && w->probes == 0,
                "contact, ten cubes that touch: local model / global step = %.4f ms / %.4f ms = "
                "%.3f (bound %.2f), %llu testing simulations (bound 0)",
                build, step, build / step, BUILD_SHARE, (unsigned long long)w->probes);
  }
  if (what->bodies == FAR_WORLD) {
    report_far(b, w, build - middle(w, TESTING), step);
  }
}

hap_status bench_scaling_contact(bench *b, FILE *csv)
{
  hap_status status = HAP_OK;
  world_bed *w = calloc(1, sizeof *w);
  if (w == NULL) {
    return bench_fail(b, HAP_ERROR_MEMORY, "no memory for the cycles");
  }
  for (size_t i = 0; i < sizeof cases / sizeof cases[0] && status >= HAP_OK; ++i) {
    status = measure(b, &cases[i], w);
    if (status >= HAP_OK) {
      write_row(csv, w);
      report(b, w);
    }
    close_bed(w);
  }
  free(w);
  return status;
}
