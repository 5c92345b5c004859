/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "bench/tick_contact.h"

#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "bench/bare.h"
#include "bench/cycles.h"
#include "contact/contact.h"
#include "haptic/haptic_internal.h"
#include "session/session_internal.h"
#include "tools/rig.h"

/* The tick of model CONTACT, which carries the contacts between the bodies itself: cubes that touch
 * each other, at rest and pushed. A session runs in lockstep. A tick's time is that of a loop with
 * its own thread: messages, device and report are part of it, a hash is not. The session runs once
 * more, and after each tick plain ODE finds the contacts of the same scene in the same state and
 * steps it with 10 iterations: in the first run it would throw the loop's data out of the caches,
 * which of a loop's own core it does not. Times are medians over the ticks. */

#define CONTACT_WARM_TICKS 300
#define PASSES 401
#define BARE_ITERATIONS 10
#define BARE_SHARE 0.75   /* of ten bodies, of plain ODE's time */
#define LARGE_NS 200000.0 /* 64 bodies and about 700 contacts */
#define PILE_REST_NS 10000.0
#define PILE_PUSHED_NS 60000.0
#define ROW_PUSHED_NS 13000.0
#define MIDDLE_NS 100000.0 /* 64 bodies and 400 contacts */
#define JOINED 37 /* of 64 in a row: 4 contacts each with the floor, 36 times 4 between them */
#define JOINED_PUSHED 30 /* as many on the way: gaps close before the hand */
#define APART 0.01       /* m */
#define PASS_NS 25000.0  /* ten bodies */
#define TOOL_NS 60000.0  /* a tool in three contacts and more with a stand of four bodies */

/* 2 mm in front of the first cube, and through it from there. */
static const char *const at_rest = "virtual:path=0:-0.012/0/0.025,hand=rigid";
static const char *const pushed =
    "virtual:path=0:-0.012/0/0.025;2:0.188/0/0.025,blend=linear,hand=rigid";

/* A tool flat on the head of the stand, which turns and slides there. */
static const char *const tool_pressed =
    "virtual:dof=6,path=0:0.092/0/0.275;0.2:0.092/0/0.2688;2:0.097/0.003/0.2686,"
    "turn=0:0/0/0;0.2:0/0/0;2:0/0/0.3,hand=rigid";

#define TOOL_ROUNDING 1e-3 /* m */
#define HANDS_MAX 16
#define HAND_PITCH 0.01 /* m, of four by four in front of a face */

typedef struct tick_case {
  const char *name;
  const char *scene;
  int count;
  int block[3]; /* cubes along x, y, z that touch; 0: as the scene builds them */
  bool push;
  double bound_ns; /* 0: none */
  int hands;       /* 0: one */
  double tool[3];  /* m, edges of a box that is the pointer; 0: a sphere */
  double friction; /* of the pointer; 0: the scene's */
  double finger;   /* m, likewise */
  int joined;      /* of a block, so many columns touch in x, the others stand APART; 0: all */
} tick_case;

static const tick_case cases[] = {
    {"cube", "slide", 0, {0, 0, 0}, false, 0.0},
    {"cube", "slide", 0, {0, 0, 0}, true, 0.0},
    {"stack", "stack", 0, {0, 0, 0}, false, 0.0},
    {"stack", "stack", 0, {0, 0, 0}, true, 0.0},
    {"row10", "row10", 10, {0, 0, 0}, false, 0.0},
    {"row10", "row10", 10, {0, 0, 0}, true, ROW_PUSHED_NS},
    {"pile64", "pile", 64, {0, 0, 0}, false, PILE_REST_NS},
    {"pile64", "pile", 64, {0, 0, 0}, true, PILE_PUSHED_NS},
    {"row64", "row10", 64, {0, 0, 0}, false, 0.0},
    {"row64", "row10", 64, {0, 0, 0}, true, 0.0},
    {"row400", "row10", 64, {64, 1, 1}, false, MIDDLE_NS, .joined = JOINED},
    {"row400", "row10", 64, {64, 1, 1}, true, MIDDLE_NS, .joined = JOINED_PUSHED},
    {"wall32x2", "row10", 64, {32, 1, 2}, false, LARGE_NS},
    {"wall32x2", "row10", 64, {32, 1, 2}, true, LARGE_NS},
    {"wall8x8", "row10", 64, {8, 1, 8}, false, 0.0},
    {"wall8x8", "row10", 64, {8, 1, 8}, true, 0.0},
    {"block4x4x4", "row10", 64, {4, 4, 4}, false, 0.0},
    {"block4x4x4", "row10", 64, {4, 4, 4}, true, 0.0},
    {"hands16", "row10", 10, {0, 0, 0}, true, 0.0, HANDS_MAX, {0.0}},
    {"tool", "lightstand", 0, {0, 0, 0}, true, TOOL_NS, 0, {0.04, 0.04, 0.02}},
    {"tool_rubs", "lightstand", 0, {0, 0, 0}, true, TOOL_NS, 0, {0.04, 0.04, 0.02}, 0.5},
    {"tool_twists", "lightstand", 0, {0, 0, 0}, true, TOOL_NS, 0, {0.04, 0.04, 0.02}, 0.5, 0.006},
};

/* What a tick is measured by. */
enum {
  TICK_NS,
  ODE_NS,
  ODE_CONTACTS,
  CONTACTS, /* that have rows */
  ROWS,
  SWEEPS,
  FIGURES
};

typedef struct tick_bed {
  const tick_case *what;
  scene_parameters parameters;
  rig rig;
  bare bare;
  size_t ticks;            /* to contact_measure */
  double *values[FIGURES]; /* of the ticks */
  double p99_ns;
  double pass_ns;
} tick_bed;

static void session_close(tick_bed *t)
{
  bare_destroy(&t->bare);
  rig_destroy(&t->rig);
  memset(&t->bare, 0, sizeof t->bare);
  memset(&t->rig, 0, sizeof t->rig);
}

static void contact_close(tick_bed *t)
{
  session_close(t);
  free(t->values[0]);
}

/* In columns of z; the first cube stays in front of the hand. */
static void cubes_arrange(const scene *s, const tick_case *what)
{
  const int *block = what->block;
  const scene_parameters *p = &s->parameters;
  double pitch = p->size + p->gap;
  for (int i = 0; block[0] > 0 && i < s->count; ++i) {
    int x = i / (block[1] * block[2]);
    int y = i / block[2] % block[1];
    int z = i % block[2];
    y -= y >= (block[1] + 1) / 2 ? block[1] : 0;
    double apart = what->joined > 0 ? APART * fmax(0.0, x - what->joined + 1) : 0.0;
    dBodySetPosition(s->bodies[i], p->size / 2 + pitch * x + apart, pitch * y,
                     p->size / 2 - p->layer + z * (p->size - p->layer));
  }
}

static void hands_put(const tick_case *what, char specs[HANDS_MAX][160], rig_options *out)
{
  out->devices[0] = what->tool[0] > 0.0 ? tool_pressed : what->push ? pushed : at_rest;
  out->device_count = 1;
  for (int i = 0; i < what->hands; ++i) {
    const int place[2] = {i % 4, i / 4};
    double y = HAND_PITCH * (place[0] - 1.5);
    double z = 0.025 + HAND_PITCH * (place[1] - 1.5);
    snprintf(specs[i], sizeof specs[i],
             "virtual:path=0:-0.012/%g/%g;2:0.188/%g/%g,blend=linear,hand=rigid", y, z, y, z);
    out->devices[i] = specs[i];
    out->device_count = (size_t)i + 1;
  }
}

static hap_status contact_open(bench *b, const tick_case *what, tick_bed *t)
{
  rig_options options;
  char specs[HANDS_MAX][160];
  rig_options_init(&options);
  t->parameters = *cycles_scene(what->scene);
  memcpy(t->parameters.tool, what->tool, sizeof t->parameters.tool);
  t->parameters.radius = what->tool[0] > 0.0 ? TOOL_ROUNDING : t->parameters.radius;
  t->parameters.friction = what->friction > 0.0 ? what->friction : t->parameters.friction;
  t->parameters.finger_radius = what->finger > 0.0 ? what->finger : t->parameters.finger_radius;
  options.parameters = &t->parameters;
  options.count = what->count;
  hands_put(what, specs, &options);
  options.def.drive = HAP_DRIVE_LOCKSTEP;
  options.def.model = HAP_MODEL_CONTACT;
  hap_status status = rig_create(&options, &t->rig, &b->detail);
  if (status >= HAP_OK) {
    status = bare_create(options.parameters, what->count, &t->bare, &b->detail);
  }
  if (status < HAP_OK) {
    return status;
  }
  dWorldSetQuickStepNumIterations(t->bare.scene->world, BARE_ITERATIONS);
  cubes_arrange(t->rig.scene, what);
  return hap_session_start(t->rig.session);
}

/* ---- measuring ---- */

/* Of one tick. The loop takes its messages where it takes them in a thread of its own. */
static hap_status tick_measure(const tick_bed *t, size_t i)
{
  hap_session *session = t->rig.session;
  hapi_haptic *haptic = session->haptic;
  hapi_rows *rows = &haptic->tick.rows;
  uint64_t sweeps = rows->sweeps;
  haptic->tick.hashing = false; /* only lockstep does */
  int64_t begin_ns = hapi_clock_now();
  hapi_haptic_receive(haptic, hap_session_now(session));
  double receive_ns = (double)(hapi_clock_now() - begin_ns);
  hap_status status = hap_session_advance(session, 1);
  t->values[TICK_NS][i] = receive_ns + 1e3 * haptic->time.last_tick_us;
  t->values[SWEEPS][i] = (double)(rows->sweeps - sweeps);
  t->values[ROWS][i] = rows->solver.row_count;
  for (uint32_t row = 0; row < rows->solver.row_count; ++row) {
    t->values[CONTACTS][i] += rows->sources[row].part == 0;
  }
  return status;
}

static void bare_measure(tick_bed *t, size_t i)
{
  bare_follow(&t->bare, t->rig.scene); /* as it was at the last sync */
  double seconds = bare_cycle(&t->bare, t->rig.session->haptic->tick.facts.period, false);
  t->values[ODE_NS][i] = 1e9 * seconds;
  t->values[ODE_CONTACTS][i] = (double)t->bare.contact_count;
}

/* Contact passes one after another, from the newest poses. */
static double measure_passes(tick_bed *t)
{
  double passes[PASSES];
  int64_t now_ns = hap_session_now(t->rig.session);
  for (int i = 0; i < PASSES; ++i) {
    int64_t begin_ns = hapi_clock_now();
    hapi_contact_pass(t->rig.session->contact, now_ns);
    passes[i] = (double)(hapi_clock_now() - begin_ns);
  }
  return bench_median(passes, PASSES);
}

static hap_status values_place(bench *b, tick_bed *t)
{
  double *values = calloc(FIGURES * t->ticks, sizeof *values);
  for (int i = 0; i < FIGURES; ++i) {
    t->values[i] = values + (size_t)i * t->ticks;
  }
  return values != NULL ? HAP_OK : bench_fail(b, HAP_ERROR_MEMORY, "no memory for the ticks");
}

/* One of the two runs. */
static hap_status contact_run(bench *b, const tick_case *what, bool of_ode, tick_bed *t)
{
  hap_status status = contact_open(b, what, t);
  if (status >= HAP_OK) {
    status = hap_session_advance(t->rig.session, CONTACT_WARM_TICKS);
  }
  for (size_t i = 0; i < t->ticks && status == HAP_OK; ++i) {
    status = of_ode ? hap_session_advance(t->rig.session, 1) : tick_measure(t, i);
    if (of_ode) {
      bare_measure(t, i);
    }
  }
  return status <= HAP_OK ? status
                          : bench_fail(b, HAP_ERROR_STATE, "%s: a fault in the loop", what->name);
}

static hap_status contact_measure(bench *b, const tick_case *what, tick_bed *t)
{
  memset(t, 0, sizeof *t);
  t->what = what;
  t->ticks = b->quick ? 200 : 1000;
  hap_status status = values_place(b, t);
  if (status >= HAP_OK) {
    status = contact_run(b, what, true, t);
  }
  if (status >= HAP_OK) {
    session_close(t);
    status = contact_run(b, what, false, t);
  }
  if (status < HAP_OK) {
    return status;
  }
  t->pass_ns = measure_passes(t);
  for (int figure = 0; figure < FIGURES; ++figure) {
    (void)bench_median(t->values[figure], t->ticks); /* sorts */
  }
  t->p99_ns = bench_quantile(t->values[TICK_NS], t->ticks, 0.99);
  return HAP_OK;
}

/* ---- saying ---- */

static double tick_middle(const tick_bed *t, int figure)
{
  return bench_quantile(t->values[figure], t->ticks, 0.5);
}

static void contact_report(bench *b, const tick_bed *t)
{
  size_t bodies = t->rig.scene->body_count;
  const char *name = t->what->name;
  const char *phase = t->what->push ? "pushed" : "at rest";
  double ns = tick_middle(t, TICK_NS);
  double ode_ns = tick_middle(t, ODE_NS);
  double contacts = tick_middle(t, CONTACTS);
  bench_say(
      "contact, %s %s: %zu bodies, %g contacts, %g rows: tick %.1f us, p99 %.1f, plain ODE "
      "%.1f (%g contacts), contact pass %.1f",
      name, phase, bodies, contacts, tick_middle(t, ROWS), 1e-3 * ns, 1e-3 * t->p99_ns,
      1e-3 * ode_ns, tick_middle(t, ODE_CONTACTS), 1e-3 * t->pass_ns);
  if (t->what->hands > 0) {
    return; /* nothing to compare it with */
  }
  if (bodies == 10) {
    bench_check(b, ns <= BARE_SHARE * ode_ns,
                "contact, %s %s: tick / (dSpaceCollide + dWorldQuickStep of 10 iterations) = %.1f "
                "us / %.1f us = %.3f (bound %.2f)",
                name, phase, 1e-3 * ns, 1e-3 * ode_ns, ns / ode_ns, BARE_SHARE);
    bench_check(b, t->pass_ns <= PASS_NS, "contact, %s %s: a contact pass %.1f us (bound %.0f)",
                name, phase, 1e-3 * t->pass_ns, 1e-3 * PASS_NS);
  }
  if (t->what->bound_ns > 0.0) {
    bench_check(b, ns <= t->what->bound_ns,
                "contact, %s %s: %g contacts, tick %.1f us (bound %.0f)", name, phase, contacts,
                1e-3 * ns, 1e-3 * t->what->bound_ns);
  }
}

static void contact_write(FILE *csv, const tick_bed *t)
{
  size_t bodies = t->rig.scene->body_count;
  double ns = tick_middle(t, TICK_NS);
  fprintf(csv, "contact,%zu,%g,%.1f,%.2f,%.1f,%s,%s,%g,%g,%.1f,%.1f\n", bodies,
          tick_middle(t, CONTACTS), ns, ns / (double)bodies, t->p99_ns, t->what->name,
          t->what->push ? "pushed" : "rest", tick_middle(t, ROWS), tick_middle(t, SWEEPS),
          tick_middle(t, ODE_NS), t->pass_ns);
}

hap_status bench_tick_contact(bench *b, FILE *csv)
{
  hap_status status = HAP_OK;
  for (size_t i = 0; i < BENCH_COUNT(cases) && status >= HAP_OK; ++i) {
    if (b->scene != NULL && strcmp(b->scene, cases[i].name) != 0) {
      continue;
    }
    tick_bed t;
    status = contact_measure(b, &cases[i], &t);
    if (status >= HAP_OK) {
      contact_write(csv, &t);
      contact_report(b, &t);
    }
    contact_close(&t);
  }
  return status;
}

size_t bench_tick_case_count(void)
{
  return BENCH_COUNT(cases);
}

const char *bench_tick_case(size_t index)
{
  return cases[index].name;
}
