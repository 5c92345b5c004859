/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

#include <stdlib.h>
#include <string.h>

#include "bench/bare.h"
#include "bench/bench.h"
#include "bench/cycles.h"
#include "tools/rig.h"

/* Columns of scaling.csv at its end. Scene: fig7 has cubes that lie apart, row10 cubes that touch.
 * Range: bodies that the loop may move itself, owned: those that it moves. */
#define SCALING_CONTACT_COLUMNS "scene,range,owned,range_ms,publish_ms,gap"

/* hapode-bench scaling, model CONTACT: what the local model costs that physics hands to the loop
 * and to the contact thread. The walk goes from the neighbours of the pointers over what
 * touches, until the loop's capacity is used. Pointers rest 2 mm above cubes of a row. After
 * each physics cycle plain ODE finds the contacts of the same scene in the same state and makes
 * one global step. */

#define CONTACT_PHYSICS_HZ 20.0
#define CONTACT_LARGE_WORLD 1000
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
  w->cycles =
      what->bodies >= CONTACT_LARGE_WORLD ? (b->quick ? 6 : 20) : (b->quick ? 20 : CYCLES_MAX);
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
  options.def.physics_hz = CONTACT_PHYSICS_HZ;
  options.def.max_bodies = what->range;
  hap_status status = rig_create(&options, &w->rig, &b->detail);
  if (status >= HAP_OK) {
    status = bare_create(p, what->bodies, &w->bare, &b->detail);
  }
  return status >= HAP_OK ? hap_session_start(w->rig.session) : status;
}

static double bare_step(world_bed *w)
{
  bare_follow(&w->bare, w->rig.scene);
  return 1e3 * bare_cycle(&w->bare, 1.0 / CONTACT_PHYSICS_HZ, true);
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
  w->values[NEIGHBOUR][i] = w->stats.physics.last.neighbour_ms;
  w->values[RANGE][i] = w->stats.physics.last.range_ms;
  w->values[PUBLISH][i] = w->stats.physics.last.publish_ms;
  w->values[TESTING][i] = w->stats.physics.last.testing_ms;
  w->values[STEP][i] = w->stats.physics.last.step_ms;
  return status;
}

/* Cycles begin at whole periods: the first tick of each period is its last here, so that plain ODE
 * comes next to the cycle. */
static hap_status contact_measure(bench *b, const world_case *what, world_bed *w)
{
  const uint64_t ticks = (uint64_t)(CYCLES_HAPTIC_HZ / CONTACT_PHYSICS_HZ);
  hap_status status = open_bed(b, what, w);
  if (status >= HAP_OK) {
    status = hap_session_advance(w->rig.session, WARM_CYCLES * ticks + 1);
  }
  if (status >= HAP_OK) {
    status = hap_session_stats(w->rig.session, &w->stats, sizeof w->stats);
  }
  uint64_t before = w->stats.probes.steps;
  for (size_t i = 0; i < w->cycles && status >= HAP_OK; ++i) {
    status = measure_cycle(w, i, ticks);
  }
  w->probes = w->stats.probes.steps - before;
  for (int figure = 0; figure < FIGURES; ++figure) {
    (void)bench_median(w->values[figure], w->cycles); /* sorts */
  }
  return status;
}

static double world_middle(const world_bed *w, int figure)
{
  return bench_quantile(w->values[figure], w->cycles, 0.5);
}

static double build_ms(const world_bed *w)
{
  return world_middle(w, NEIGHBOUR) + world_middle(w, PUBLISH) + world_middle(w, TESTING);
}

static void contact_write(FILE *csv, const world_bed *w)
{
  double probes = (double)w->probes / (double)w->cycles;
  double library = build_ms(w) - world_middle(w, TESTING);
  fprintf(csv, "%d,%u,contact,%.6g,%.6g,%.4g,%g,%.6g,%.6g,%.6g,%s,%d,%u,%.6g,%.6g,%g\n",
          w->what->bodies, w->stats.model.neighbours, build_ms(w), world_middle(w, STEP),
          w->stats.loop.tick_us_p50, probes, world_middle(w, TESTING), world_middle(w, BARE_STEP),
          library, w->what->scene, w->what->range, w->stats.model.range_bodies,
          world_middle(w, RANGE), world_middle(w, PUBLISH), w->parameters.gap);
}

static void contact_report(bench *b, const world_bed *w)
{
  const world_case *what = w->what;
  double build = build_ms(w);
  double step = world_middle(w, BARE_STEP);
  bench_say(
      "contact, %s:%d, gap %g m, %u neighbours, %u of at most %d bodies in the loop: local model "
      "%.4f ms (neighbours %.4f, of it range %.4f, publish %.4f, testing %.4f), global step %.4f "
      "ms",
      what->scene, what->bodies, w->parameters.gap, w->stats.model.neighbours,
      w->stats.model.range_bodies, what->range, build, world_middle(w, NEIGHBOUR),
      world_middle(w, RANGE), world_middle(w, PUBLISH), world_middle(w, TESTING), step);
  if (what->bodies == 10 && strcmp(what->scene, "row10") == 0) {
    bench_check(b, build <= BUILD_SHARE * step && w->probes == 0,
                "contact, ten cubes that touch: local model / global step = %.4f ms / %.4f ms = "
                "%.3f (bound %.2f), %llu testing simulations (bound 0)",
                build, step, build / step, BUILD_SHARE, (unsigned long long)w->probes);
  }
  if (what->bodies == FAR_WORLD) {
    double own = build - world_middle(w, TESTING);
    hap_detail text;
    snprintf(
        text.text, sizeof text.text,
        "contact, %d cubes %g m apart, %u near, %u in the loop: library / global step = %.4f ms "
        "/ %.4f ms = %.2f %%, %.0f ns a body",
        what->bodies, w->parameters.gap, w->stats.model.neighbours, w->stats.model.range_bodies,
        own, step, 100.0 * own / step, 1e6 * own / what->bodies);
    if (what->gap > 0.0) { /* of bodies that are not separate the range is as full as it can be */
      bench_check(b, own <= FAR_SHARE * step, "%s (bound 5 %%)", text.text);
    } else {
      bench_say("%s", text.text);
    }
  }
}

/* The rows of model CONTACT. */
static hap_status bench_scaling_contact(bench *b, FILE *csv)
{
  hap_status status = HAP_OK;
  world_bed *w = calloc(1, sizeof *w);
  if (w == NULL) {
    return bench_fail(b, HAP_ERROR_MEMORY, "no memory for the cycles");
  }
  for (size_t i = 0; i < BENCH_COUNT(cases) && status >= HAP_OK; ++i) {
    status = contact_measure(b, &cases[i], w);
    if (status >= HAP_OK) {
      contact_write(csv, w);
      contact_report(b, w);
    }
    bare_destroy(&w->bare);
    rig_destroy(&w->rig);
  }
  free(w);
  return status;
}

/* hapode-bench scaling: what a near body costs in a world that grows. Cubes lie apart on a floor, a
 * pointer rests 2 mm in front of the first one. Columns, medians over the physics cycles:
 *
 *   build_ms        the local model: neighbours, testing simulations, messages
 *   step_ms         the global step
 *   tick_us         a haptic tick
 *   probes          testing simulations a cycle, probe_ms all of them together
 *   island_step_ms  one step of the neighbour's island alone, by plain ODE calls
 *   library_ms      what is neither collision nor a step of ODE
 *
 * Model CONTACT has its own rows, see above. */

#define PROBES_PHYSICS_HZ 20.0
#define PROBES_LARGE_WORLD 1000

static const int sizes[] = {1, 10, 100, PROBES_LARGE_WORLD};
#define SIZE_COUNT BENCH_COUNT(sizes)

static const hap_model models[] = {HAP_MODEL_IMPULSE, HAP_MODEL_ACCELERANCE};
#define MODEL_COUNT BENCH_COUNT(models)

typedef struct world {
  double neighbours;
  double build_ms;
  double step_ms;
  double tick_us;
  double probes;
  double probe_ms;
  double island_step_ms;
  double library_ms;
  double probe_ratio;
} world;

static hap_status probes_measure(bench *b, int bodies, hap_model model, world *out)
{
  cycles c;
  cycles_def def = {
      .parameters = cycles_scene("fig7"),
      .count = bodies,
      .device = "virtual:path=0:-0.012/0/0.025,hand=rigid",
      .model = model,
      .physics_hz = PROBES_PHYSICS_HZ,
      .seconds = b->quick ? 1.0 : 3.0,
      .repeats = b->quick ? 3 : 5,
  };
  hap_status status = cycles_measure(b, &def, &c);
  if (status < HAP_OK) {
    return status;
  }
  double untested = cycles_median(&c, CYCLE_UNTESTED);
  double collide = cycles_median(&c, CYCLE_COLLIDE);
  out->neighbours = cycles_median(&c, CYCLE_NEIGHBOURS);
  out->step_ms = cycles_median(&c, CYCLE_STEP);
  out->tick_us = c.tick_us;
  out->probes = cycles_median(&c, CYCLE_PROBES);
  out->probe_ms = cycles_median(&c, CYCLE_TESTING);
  out->island_step_ms = cycles_median(&c, CYCLE_ISLAND);
  out->build_ms = untested - collide - out->step_ms + out->probe_ms;
  out->library_ms = out->build_ms - out->probes * out->island_step_ms;
  out->probe_ratio = cycles_probe_ratio(&c);
  cycles_free(&c);
  return HAP_OK;
}

static void probes_report(bench *b, int bodies, const world *w)
{
  bench_check(b, w->probe_ratio <= 1.1,
              "%d bodies, %g neighbour: %g testing simulations %.4f ms, / (%g x island step "
              "%.4f ms) = %.3f (bound 1.1)",
              bodies, w->neighbours, w->probes, w->probe_ms, w->probes, w->island_step_ms,
              w->probe_ratio);
  double share = w->probe_ms / w->step_ms;
  if (bodies == PROBES_LARGE_WORLD) {
    bench_check(b, share <= 0.08,
                "%d bodies, %g neighbour: testing simulations / global step = %.4f ms / %.4f ms = "
                "%.2f %% (bound 8 %%)",
                bodies, w->neighbours, w->probe_ms, w->step_ms, 100.0 * share);
  }
}

static void scaling_draw(FILE *script, const void *data)
{
  const world *worlds = data;
  fprintf(script, "$w << EOD\n");
  for (size_t i = 0; i < SIZE_COUNT; ++i) {
    fprintf(script, "%d %g %g %g %g\n", sizes[i], worlds[i].step_ms, worlds[i].probe_ms,
            worlds[i].island_step_ms, 1e-3 * worlds[i].tick_us);
  }
  fprintf(script,
          "EOD\nset title 'One neighbour among cubes that lie apart'\nset logscale xy\n"
          "set format y '%%g'\nset xlabel 'bodies in the world'\nset ylabel 'time [ms]'\n"
          "set key top left\n"
          "plot $w using 1:2 with linespoints lt 1 pt 7 ps 0.6 title 'global step', "
          "$w using 1:3 with linespoints lt 2 pt 7 ps 0.6 title 'all testing simulations', "
          "$w using 1:4 with linespoints lt 3 pt 5 ps 0.6 title 'one island step', "
          "$w using 1:5 with linespoints lt 4 pt 9 ps 0.6 title 'haptic tick'\n");
}

hap_status bench_scaling(bench *b)
{
  world worlds[MODEL_COUNT][SIZE_COUNT];
  FILE *csv = bench_csv_open(b, "scaling",
                             "bodies,neighbours,model,build_ms,step_ms,tick_us,probes,probe_ms,"
                             "island_step_ms,library_ms," SCALING_CONTACT_COLUMNS);
  hap_status status = csv != NULL ? HAP_OK : HAP_ERROR_IO;
  for (size_t i = 0; i < SIZE_COUNT && status >= HAP_OK; ++i) {
    for (size_t m = 0; m < MODEL_COUNT && status >= HAP_OK; ++m) {
      world *w = &worlds[m][i];
      status = probes_measure(b, sizes[i], models[m], w);
      if (status >= HAP_OK) {
        fprintf(csv, "%d,%g,%s,%.6g,%.6g,%.4g,%g,%.6g,%.6g,%.6g,fig7,0,0,,,\n", sizes[i],
                w->neighbours, hap_model_name(models[m]), w->build_ms, w->step_ms, w->tick_us,
                w->probes, w->probe_ms, w->island_step_ms, w->library_ms);
      }
    }
    if (status >= HAP_OK) {
      probes_report(b, sizes[i], &worlds[MODEL_COUNT - 1][i]);
    }
  }
  status = status >= HAP_OK ? bench_scaling_contact(b, csv) : status;
  status = bench_csv_close(b, csv, status);
  return status >= HAP_OK
             ? bench_draw(b, "scaling", 800, 500, scaling_draw, worlds[MODEL_COUNT - 1])
             : status;
}
