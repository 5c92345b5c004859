/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/vec.h"
#include "bench/bare.h"
#include "bench/bench.h"
#include "bench/cycles.h"
#include "contact/contact.h"
#include "haptic/haptic_internal.h"
#include "haptic/tick_memory.h"
#include "local/contact_rows.h"
#include "local/pointer_rows.h"
#include "local/tool_place.h"
#include "session/session_internal.h"
#include "sync/exchange.h"
#include "tick/black_box.h"
#include "tick/report.h"
#include "tick/tick.h"
#include "tools/rig.h"

/* Columns of tick.csv behind those of every model; empty there. */
#define TICK_CONTACT_COLUMNS "p99_ns,scene,phase,rows,sweeps,ode_ns,pass_ns"
#define TICK_CONTACT_EMPTY ",,,,,,"

/* A running session's tick, copied so that it can be run by itself: what the haptic loop computes
 * from the same state, without devices, messages and threads, and without a trace in the session. */

/* The parts of a tick of model CONTACT, ns. */
typedef struct tick_parts {
  double rows;   /* contacts placed anew, their Jacobians and responses */
  double solve;  /* the first solve */
  double again;  /* the second one, without push-out; 0: not needed */
  double update; /* one row update of a sweep, mean over many sweeps */
} tick_parts;

#define UPDATE_SWEEPS 20u

/* Memory for copies of ticks like this one; false without memory: destroy all the same. */
static bool tick_copy_create(hapi_tick *copy, const hapi_tick *like)
{
  memset(copy, 0, sizeof *copy);
  bool room = hapi_tick_memory_create(copy, &like->capacity);
  if (room) {
    hapi_tick_reset(copy);
  }
  return room;
}

/* zeroed allowed */
static void tick_copy_destroy(hapi_tick *copy)
{
  hapi_tick_memory_destroy(copy);
  memset(copy, 0, sizeof *copy);
}

static void copy_pointers(hapi_pointers *copy, const hapi_pointers *from, uint32_t capacity)
{
  memcpy(copy->of, from->of, capacity * sizeof *copy->of);
  copy->high = from->high; /* the hulls themselves stay where they are: nobody writes to them */
  copy->proxies = from->proxies;
}

static void copy_bodies(hapi_bodies *copy, const hapi_bodies *from)
{
  hapi_bodies own = *copy;
  *copy = *from;
  copy->of = own.of;
  copy->live = own.live;
  memcpy(copy->of, from->of, from->high * sizeof *copy->of);
  memcpy(copy->live, from->live, from->live_count * sizeof *copy->live);
}

static void copy_tools(hapi_tool_world *copy, const hapi_tool_world *from)
{
  copy->count = from->count;
  copy->pair_count = from->pair_count;
  memcpy(copy->tools, from->tools, from->count * sizeof *copy->tools);
  memcpy(copy->pairs, from->pairs, from->pair_count * sizeof *copy->pairs);
}

static void copy_touches(hapi_touches *copy, const hapi_touches *from, uint32_t contacts)
{
  copy->count = from->count;
  copy->pushing = from->pushing;
  copy->contact_ticks = from->contact_ticks;
  copy->hand_impulse_abs = from->hand_impulse_abs;
  memcpy(copy->hand_impulse, from->hand_impulse, sizeof copy->hand_impulse);
  copy->rubs = from->rubs;
  memcpy(copy->of, from->of, from->count * sizeof *copy->of);
  memcpy(copy->ramps, from->ramps, contacts * sizeof *copy->ramps);
  memcpy(copy->ramp_generations, from->ramp_generations, contacts * sizeof *copy->ramp_generations);
  for (uint32_t i = 0; i < from->count; ++i) { /* not all there is room for: caches */
    uint32_t slot = from->of[i].slot;
    if (slot != HAPI_SLOT_NONE) {
      copy->frictions[slot] = from->frictions[slot];
    }
  }
  copy_tools(&copy->tool, &from->tool);
}

static void copy_contacts(hapi_body_contacts *copy, const hapi_body_contacts *from)
{
  copy->patches = from->patches;
  copy->memory_count = from->memory_count;
  copy->active = from->active;
  memcpy(copy->memory, from->memory, from->memory_count * sizeof *copy->memory);
}

static void copy_joints(hapi_joints *copy, const hapi_joints *from, uint32_t capacity)
{
  copy->count = from->count;
  memcpy(copy->of, from->of, from->count * sizeof *copy->of);
  memcpy(copy->memory, from->memory, capacity * sizeof *copy->memory);
}

static void copy_rows(hapi_rows *copy, const hapi_rows *from)
{
  hapi_solver own = copy->solver;
  copy->residual_max = from->residual_max;
  copy->sweeps = from->sweeps;
  copy->solver = from->solver;
  copy->solver.rows = own.rows;
  copy->solver.v = own.v;
  copy->solver.free = own.free;
  copy->solver.work = own.work;
}

static void tick_copy_take(hapi_tick *copy, const hapi_tick *from)
{
  const hapi_capacity *c = &from->capacity;
  copy->facts = from->facts;
  copy->guard = from->guard;
  copy->sample = from->sample;
  copy->watch = from->watch;
  copy->hashing = false; /* only lockstep does */
  copy_pointers(&copy->pointers, &from->pointers, c->pointers);
  copy_bodies(&copy->bodies, &from->bodies);
  copy_touches(&copy->touches, &from->touches, c->contacts);
  copy->touches.crosses.count = from->touches.crosses.count;
  memcpy(copy->touches.crosses.of, from->touches.crosses.of,
         from->touches.crosses.count * sizeof *copy->touches.crosses.of);
  copy_contacts(&copy->contacts, &from->contacts);
  copy_joints(&copy->joints, &from->joints, c->joints);
  copy_rows(&copy->rows, &from->rows);
}

static double since(int64_t begin_ns)
{
  return (double)(hapi_clock_now() - begin_ns);
}

/* The next tick of the copy, timed [ns]. */
static double tick_copy_run(hapi_tick *copy)
{
  int64_t now_ns = copy->facts.now_ns + (int64_t)llround(1e9 * copy->facts.period);
  int64_t begin_ns = hapi_clock_now();
  hapi_tick_run(copy, now_ns);
  return since(begin_ns);
}

/* As hapi_bodies_begin. */
static void begin(hapi_tick *tick)
{
  tick->rows.solver.row_count = 0;
  for (uint32_t i = 0; i < tick->bodies.live_count; ++i) {
    hapi_local_body *body = &tick->bodies.of[tick->bodies.live[i]];
    hapi_quat_to_matrix(body->pose.quat_wxyz, body->rotation);
    hapi_v3_copy(body->twist.linear, body->start_twist);
    hapi_v3_copy(body->twist.angular, body->start_twist + 3);
  }
}

static void set_free_velocities(hapi_tick *tick)
{
  for (uint32_t i = 0; i < tick->bodies.live_count; ++i) {
    const hapi_local_body *body = &tick->bodies.of[tick->bodies.live[i]];
    double *v = tick->rows.solver.v[body->row];
    memcpy(v, body->start_twist, sizeof body->start_twist);
    if (hapi_body_responds(body)) {
      hapi_v3_madd(v, tick->facts.period, body->given.gravity, v);
    }
  }
}

static double solve(hapi_tick *tick)
{
  int64_t begin_ns = hapi_clock_now();
  hapi_solver_run(&tick->rows.solver);
  return since(begin_ns);
}

/* Whether anything is pushed out; then as the second solve wants the rows. */
static bool stop_push_out(hapi_tick *tick)
{
  hapi_solver *solver = &tick->rows.solver;
  bool any = false;
  for (uint32_t i = 0; i < solver->row_count; ++i) {
    const hapi_row_source *source = &tick->rows.sources[i];
    any = any || (source->pushes_out && (source->joint || solver->rows[i].impulse > 0.0));
  }
  for (uint32_t i = 0; any && i < solver->row_count; ++i) {
    if (tick->rows.sources[i].pushes_out) {
      hapi_row_retarget(&solver->rows[i], tick->rows.sources[i].stays);
    }
  }
  return any;
}

/* Sweeps alone: with and without one lot more of them, so that what comes before falls out. */
static double time_update(hapi_tick *tick)
{
  hapi_solver *solver = &tick->rows.solver;
  double spent[2];
  if (solver->row_count == 0) {
    return 0.0;
  }
  solver->direct_rows = 0;
  solver->tolerance = 0.0;
  solver->ready = false;
  for (uint32_t lot = 0; lot < 2; ++lot) {
    solver->update_budget = (2 + lot * UPDATE_SWEEPS) * solver->row_count;
    set_free_velocities(tick);
    spent[lot] = solve(tick);
  }
  return (spent[1] - spent[0]) / (UPDATE_SWEEPS * solver->row_count);
}

/* The next tick of a copy that has just been run, part by part. It cannot be run on after that. */
static void tick_copy_parts(hapi_tick *copy, tick_parts *out)
{
  begin(copy);
  set_free_velocities(copy);
  int64_t begin_ns = hapi_clock_now();
  hapi_tool_place(&copy->touches, &copy->pointers, &copy->bodies, copy->facts.period);
  hapi_pointer_rows(&copy->facts, &copy->pointers, &copy->bodies, &copy->touches, &copy->rows,
                    &copy->sample);
  hapi_joint_rows(&copy->joints, &copy->bodies, &copy->rows, &copy->facts);
  hapi_contact_rows(&copy->contacts, &copy->bodies, &copy->rows, &copy->facts, &copy->sample);
  out->rows = since(begin_ns);
  out->solve = solve(copy);
  out->again = stop_push_out(copy) ? solve(copy) : 0.0;
  out->update = time_update(copy);
}

/* The tick of model CONTACT, which carries the contacts between the bodies itself: cubes that touch
 * each other, at rest and pushed. A session runs in lockstep; after each of its ticks the next one
 * is run alone on a copy, by turns with plain ODE, which finds the contacts of the same scene in the
 * same state and steps it with 10 iterations. Times are medians over the ticks. */

#define CONTACT_WARM_TICKS 300
#define PASSES 401
#define BARE_ITERATIONS 10
#define BARE_SHARE 0.75    /* of ten bodies, of plain ODE's time */
#define LARGE_NS 200000.0  /* 64 bodies and about 700 contacts */
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
  double bound_ns; /* 0: none, or that of ten bodies */
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
    {"row10", "row10", 10, {0, 0, 0}, true, 0.0},
    {"pile64", "pile", 64, {0, 0, 0}, false, LARGE_NS},
    {"pile64", "pile", 64, {0, 0, 0}, true, LARGE_NS},
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
  DIRECT_SOLVES, /* of the last solve */
  PART_ROWS,
  PART_SOLVE,
  PART_AGAIN,
  PART_UPDATE,
  FIGURES
};

typedef struct tick_bed {
  const tick_case *what;
  scene_parameters parameters;
  rig rig;
  bare bare;
  hapi_tick copy;
  size_t ticks;            /* to contact_measure */
  double *values[FIGURES]; /* of the ticks */
  double p99_ns;
  double pass_ns;
} tick_bed;

static void contact_close_bed(tick_bed *t)
{
  tick_copy_destroy(&t->copy);
  bare_destroy(&t->bare);
  rig_destroy(&t->rig);
  free(t->values[0]);
}

/* In columns of z; the first cube stays in front of the hand. */
static void arrange(const scene *s, const tick_case *what)
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

static void put_hands(const tick_case *what, char specs[HANDS_MAX][160], rig_options *out)
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

static hap_status contact_open_bed(bench *b, const tick_case *what, tick_bed *t)
{
  rig_options options;
  char specs[HANDS_MAX][160];
  memset(t, 0, sizeof *t);
  t->what = what;
  t->ticks = b->quick ? 200 : 1000;
  rig_options_init(&options);
  t->parameters = *cycles_scene(what->scene);
  memcpy(t->parameters.tool, what->tool, sizeof t->parameters.tool);
  t->parameters.radius = what->tool[0] > 0.0 ? TOOL_ROUNDING : t->parameters.radius;
  t->parameters.friction = what->friction > 0.0 ? what->friction : t->parameters.friction;
  t->parameters.finger_radius = what->finger > 0.0 ? what->finger : t->parameters.finger_radius;
  options.parameters = &t->parameters;
  options.count = what->count;
  put_hands(what, specs, &options);
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
  arrange(t->rig.scene, what);
  double *values = calloc(FIGURES * t->ticks, sizeof *values);
  for (int i = 0; i < FIGURES; ++i) {
    t->values[i] = values + (size_t)i * t->ticks;
  }
  if (!tick_copy_create(&t->copy, &t->rig.session->haptic->tick) || values == NULL) {
    return bench_fail(b, HAP_ERROR_MEMORY, "no memory for a copy of the tick");
  }
  return hap_session_start(t->rig.session);
}

/* ---- measuring ---- */

static void measure_copy(tick_bed *t, size_t i)
{
  const hapi_solver *solver = &t->copy.rows.solver;
  tick_parts parts;
  uint64_t sweeps = t->copy.rows.sweeps;
  t->values[TICK_NS][i] = tick_copy_run(&t->copy);
  t->values[SWEEPS][i] = (double)(t->copy.rows.sweeps - sweeps);
  t->values[ROWS][i] = solver->row_count;
  t->values[DIRECT_SOLVES][i] = solver->direct_solves;
  for (uint32_t row = 0; row < solver->row_count; ++row) {
    t->values[CONTACTS][i] += t->copy.rows.sources[row].part == 0;
  }
  tick_copy_parts(&t->copy, &parts);
  t->values[PART_ROWS][i] = parts.rows;
  t->values[PART_SOLVE][i] = parts.solve;
  t->values[PART_AGAIN][i] = parts.again;
  t->values[PART_UPDATE][i] = parts.update;
}

static double bare_tick(tick_bed *t)
{
  bare_follow(&t->bare, t->rig.scene); /* as it was at the last sync */
  return 1e9 * bare_cycle(&t->bare, t->rig.session->haptic->tick.facts.period);
}

static void measure_tick(tick_bed *t, size_t i)
{
  if (i % 2 == 0) {
    t->values[ODE_NS][i] = bare_tick(t);
  }
  t->values[ODE_CONTACTS][i] = (double)t->bare.contact_count;
  tick_copy_take(&t->copy, &t->rig.session->haptic->tick);
  measure_copy(t, i);
  if (i % 2 != 0) {
    t->values[ODE_NS][i] = bare_tick(t);
  }
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

static hap_status contact_measure(bench *b, const tick_case *what, tick_bed *t)
{
  hap_status status = contact_open_bed(b, what, t);
  if (status >= HAP_OK) {
    status = hap_session_advance(t->rig.session, CONTACT_WARM_TICKS);
  }
  for (size_t i = 0; i < t->ticks && status == HAP_OK; ++i) {
    status = hap_session_advance(t->rig.session, 1);
    measure_tick(t, i);
  }
  if (status != HAP_OK) {
    return status < HAP_OK ? status
                           : bench_fail(b, HAP_ERROR_STATE, "%s: a fault in the loop", what->name);
  }
  t->pass_ns = measure_passes(t);
  for (int figure = 0; figure < FIGURES; ++figure) {
    (void)bench_median(t->values[figure], t->ticks); /* sorts */
  }
  t->p99_ns = bench_quantile(t->values[TICK_NS], t->ticks, 0.99);
  return HAP_OK;
}

/* ---- saying ---- */

static double middle(const tick_bed *t, int figure)
{
  return bench_quantile(t->values[figure], t->ticks, 0.5);
}

static void check(bench *b, const tick_bed *t)
{
  size_t bodies = t->rig.scene->body_count;
  const char *name = t->what->name;
  const char *phase = t->what->push ? "pushed" : "at rest";
  double ns = middle(t, TICK_NS);
  double ode_ns = middle(t, ODE_NS);
  if (bodies == 10) {
    bench_check(b, ns <= BARE_SHARE * ode_ns,
                "contact, %s %s: tick / (dSpaceCollide + dWorldQuickStep of 10 iterations) = %.1f "
                "us / %.1f us = %.3f (bound %.2f)",
                name, phase, 1e-3 * ns, 1e-3 * ode_ns, ns / ode_ns, BARE_SHARE);
    bench_check(b, t->pass_ns <= PASS_NS, "contact, %s %s: a contact pass %.1f us (bound %.0f)",
                name, phase, 1e-3 * t->pass_ns, 1e-3 * PASS_NS);
  } else if (t->what->bound_ns > 0.0) {
    bench_check(b, ns <= t->what->bound_ns,
                "contact, %s %s: %g contacts, tick %.1f us (bound %.0f)", name, phase,
                middle(t, CONTACTS), 1e-3 * ns, 1e-3 * t->what->bound_ns);
  }
}

static void contact_report(bench *b, const tick_bed *t)
{
  double ns = middle(t, TICK_NS);
  double solve = middle(t, PART_SOLVE) + middle(t, PART_AGAIN);
  const char *phase = t->what->push ? "pushed" : "at rest";
  bench_say(
      "contact, %s %s: %zu bodies, %g contacts, %g rows: tick %.1f us, p99 %.1f, plain ODE "
      "%.1f (%g contacts), contact pass %.1f",
      t->what->name, phase, t->rig.scene->body_count, middle(t, CONTACTS), middle(t, ROWS),
      1e-3 * ns, 1e-3 * t->p99_ns, 1e-3 * middle(t, ODE_NS), middle(t, ODE_CONTACTS),
      1e-3 * t->pass_ns);
  if (t->what->hands > 0) {
    return; /* nothing to compare it with */
  }
  bench_say(
      "  rows %.1f %%, solve %.1f %% (the second one %.1f), rest %.1f %%; %g sweeps, "
      "%g direct solves in the last solve; a row update %.1f ns",
      100.0 * middle(t, PART_ROWS) / ns, 100.0 * solve / ns, 100.0 * middle(t, PART_AGAIN) / ns,
      100.0 * (1.0 - (middle(t, PART_ROWS) + solve) / ns), middle(t, SWEEPS),
      middle(t, DIRECT_SOLVES), middle(t, PART_UPDATE));
  check(b, t);
}

static void write_row(FILE *csv, const tick_bed *t)
{
  size_t bodies = t->rig.scene->body_count;
  double ns = middle(t, TICK_NS);
  fprintf(csv, "contact,%zu,%g,%.1f,%.2f,%.1f,%s,%s,%g,%g,%.1f,%.1f\n", bodies, middle(t, CONTACTS),
          ns, ns / (double)bodies, t->p99_ns, t->what->name, t->what->push ? "pushed" : "rest",
          middle(t, ROWS), middle(t, SWEEPS), middle(t, ODE_NS), t->pass_ns);
}

/* that there is such a case */
static bool tick_contact_has(const char *name)
{
  bool has = false;
  for (size_t i = 0; i < sizeof cases / sizeof cases[0]; ++i) {
    has = has || strcmp(cases[i].name, name) == 0;
  }
  return has;
}

/* " cube stack ..." */
static const char *tick_contact_names(void)
{
  static char names[400];
  size_t used = 0;
  for (size_t i = 0; i < sizeof cases / sizeof cases[0]; ++i) {
    if (i == 0 || strcmp(cases[i - 1].name, cases[i].name) != 0) {
      used += (size_t)snprintf(names + used, sizeof names - used, " %s", cases[i].name);
    }
  }
  return names;
}

/* The rows of model CONTACT. Neighbours are the bodies that the loop moves. */
static hap_status bench_tick_contact(bench *b, FILE *csv)
{
  hap_status status = HAP_OK;
  for (size_t i = 0; i < sizeof cases / sizeof cases[0] && status >= HAP_OK; ++i) {
    if (b->scene != NULL && strcmp(b->scene, cases[i].name) != 0) {
      continue;
    }
    tick_bed t;
    status = contact_measure(b, &cases[i], &t);
    if (status >= HAP_OK) {
      write_row(csv, &t);
      contact_report(b, &t);
    }
    contact_close_bed(&t);
  }
  return status;
}

/* What the guard costs: all of its steps and a row of the black box, for one pointer in touch with
 * cubes that the loop owns (model CONTACT), whose energies the observer follows. A time is the median
 * of many short runs. */

#define GUARD_RUNS_QUICK 201
#define GUARD_RUNS 1001
#define TICK_NS 1000000
#define GUARD_BOUND_NS 100.0

static const double guard_mass = 0.15;       /* kg */
static const double guard_radius = 0.01;     /* m, pointer */
static const double guard_half_edge = 0.025; /* m, cubes */
static const double guard_stiffness = 2000.0;
static const double guard_depth = 1e-4; /* m, at rest */

typedef struct guard_bed {
  hapi_tick tick;
  hapi_exchange *exchange;
  hapi_black_box box;
} guard_bed;

static void guard_close_bed(guard_bed *g)
{
  hapi_tick_memory_destroy(&g->tick);
  hapi_exchange_destroy(g->exchange);
  hapi_free(g->box.rows);
  hapi_free(g->box.counts);
}

static bool guard_allocate(guard_bed *g, uint32_t count)
{
  const hapi_capacity capacity = {count, count, 1, 1, 1, 0, 0, 1};
  g->box.pointers = 1;
  g->box.rows = hapi_alloc_array(HAP_BLACK_BOX_TICKS, sizeof *g->box.rows);
  g->box.counts = hapi_alloc_array(HAP_BLACK_BOX_TICKS, sizeof *g->box.counts);
  g->tick.facts.period = 1e-9 * TICK_NS;
  return hapi_tick_memory_create(&g->tick, &capacity) && g->box.rows != NULL &&
         g->box.counts != NULL && hapi_exchange_create(&capacity, &g->exchange) >= HAP_OK;
}

static void guard_put_pointer(hapi_pointer *p)
{
  memset(p, 0, sizeof *p);
  p->generation = 1;
  p->shape.radius = guard_radius;
  p->surface.stiffness = guard_stiffness;
  p->surface.damping = 5.0;
  p->device.motion_scale = p->device.force_scale = 1.0;
  p->device.limits.max_force = p->device.limits.max_torque = 20.0;
  p->device.limits.slew_force = p->device.limits.slew_torque = 10000.0;
  p->device.pose_world_device.quat_wxyz[0] = 1.0;
  p->device.pose.quat_wxyz[0] = 1.0;
}

/* All cubes in one place, where they press the pointer towards +x: only their number counts. */
static void guard_put_body(hapi_model_body *body, hapi_model_contact *contact, uint32_t index)
{
  memset(body, 0, sizeof *body);
  memset(contact, 0, sizeof *contact);
  body->slot = contact->slot = contact->body = index;
  body->generation = contact->generation = contact->pointer_generation = 1;
  body->flags = HAPI_BODY_OWNED | HAPI_BODY_GYROSCOPIC;
  body->mass = guard_mass;
  body->linear_keep = body->angular_keep = 1.0;
  body->max_angular_speed = HUGE_VAL;
  for (int i = 0; i < 3; ++i) {
    body->inertia[4 * i] = guard_mass * 4.0 * guard_half_edge * guard_half_edge / 6.0;
    body->inverse_inertia[4 * i] = 1.0 / body->inertia[4 * i];
  }
  body->pose.quat_wxyz[0] = 1.0;
  body->pose.position[0] = -(guard_radius - guard_depth + guard_half_edge);
  body->user_wrench[0] = guard_stiffness * guard_depth;
  body->twist.angular[0] = 1.0; /* about the contact's normal: it stays so */
  contact->point_body[0] = guard_half_edge;
  contact->normal_body[0] = 1.0;
}

static bool guard_open_bed(guard_bed *g, uint32_t count)
{
  memset(g, 0, sizeof *g);
  if (!guard_allocate(g, count)) {
    return false;
  }
  hapi_tick_reset(&g->tick);
  hapi_black_box_reset(&g->box);
  guard_put_pointer(&g->tick.pointers.of[0]);
  hapi_model *message = hapi_exchange_model_back(g->exchange);
  hapi_patches *patches = hapi_exchange_patches_back(g->exchange);
  message->number = patches->model_number = 1;
  message->model = HAP_MODEL_CONTACT;
  message->body_count = message->contact_count = count;
  patches->contact_count = 0;
  for (uint32_t i = 0; i < count; ++i) {
    guard_put_body(&hapi_model_bodies(message)[i], &hapi_model_contacts(message)[i], i);
  }
  hapi_tick_adopt(&g->tick, message, 0);
  hapi_tick_adopt_patches(&g->tick, patches);
  return true;
}

/* ns a tick, of the guard alone. */
static void guard_measure(guard_bed *g, int runs, uint32_t ticks, double *out_ns)
{
  double values[GUARD_RUNS];
  for (int warm = 0; warm < 2000; ++warm) {
    hapi_tick_run(&g->tick, g->tick.facts.now_ns + TICK_NS);
  }
  for (int i = 0; i < runs; ++i) {
    int64_t begin_ns = hapi_clock_now();
    for (uint32_t k = 0; k < ticks; ++k) {
      hapi_tick_guard(&g->tick);
      hapi_black_box_record(&g->box, &g->tick);
    }
    values[i] = (double)(hapi_clock_now() - begin_ns) / ticks;
  }
  *out_ns = bench_median(values, (size_t)runs);
}

/* The guard's part of a tick, with its black box: rows of tick.csv, model "guard". */
static hap_status bench_tick_guard(bench *b, FILE *csv)
{
  static const uint32_t sizes[] = {1, 8, 64};
  for (int i = 0; i < 3; ++i) {
    guard_bed g;
    double ns = 0.0;
    bool opened = guard_open_bed(&g, sizes[i]);
    if (opened) {
      guard_measure(&g, b->quick ? GUARD_RUNS_QUICK : GUARD_RUNS, 4000u / (sizes[i] + 4u), &ns);
    }
    bool works = opened && g.tick.touches.pushing == sizes[i] && g.tick.guard.energy_ticks == 0 &&
                 g.tick.guard.latch.fault == HAP_FAULT_NONE && g.tick.guard.stored_max > 0.0;
    guard_close_bed(&g);
    if (!works) {
      return bench_fail(b, opened ? HAP_ERROR_STATE : HAP_ERROR_MEMORY,
                        "guard, %u bodies: not as it should be", sizes[i]);
    }
    fprintf(csv, "guard,%u,%u,%.1f,%.2f," TICK_CONTACT_EMPTY "\n", sizes[i], sizes[i], ns,
            ns / sizes[i]);
    const char *text = "guard and black box, one pointer, %u bodies: %.1f ns a tick%s";
    if (sizes[i] == 1) {
      bench_check(b, ns <= GUARD_BOUND_NS, text, sizes[i], ns, " (bound 100)");
    } else {
      bench_say(text, sizes[i], ns, "");
    }
  }
  return HAP_OK;
}

/* What a message costs the loop: 64 bodies with a pointer contact each, and 512 contacts between them,
 * 4 a pair. hand-over: publish, by the other thread, and take; nothing is copied there. bodies,
 * contacts: what the tick does with what it has taken, model CONTACT, all of it known before. A time is
 * the median of 5 runs. */

#define MESSAGE_RUNS 5
#define BODIES 64u
#define CONTACTS 512u
#define POINTS 4u /* of a pair */
#define MESSAGE_BOUND_NS 5000.0

typedef struct message_bed {
  hapi_tick tick;
  hapi_exchange *exchange;
  uint64_t number;
} message_bed;

static void fill_body(hapi_model_body *body, hapi_model_contact *contact, uint32_t index)
{
  memset(body, 0, sizeof *body);
  memset(contact, 0, sizeof *contact);
  body->slot = contact->slot = contact->body = index;
  body->generation = contact->generation = contact->pointer_generation = 1;
  body->flags = HAPI_BODY_OWNED;
  body->mass = body->linear_keep = body->angular_keep = 1.0;
  body->max_angular_speed = HUGE_VAL;
  body->pose.quat_wxyz[0] = 1.0;
  body->pose.position[0] = index;
  for (int i = 0; i < 3; ++i) {
    body->inertia[4 * i] = body->inverse_inertia[4 * i] = 1.0;
  }
  contact->normal_body[0] = 1.0;
}

static void publish_model(message_bed *m)
{
  hapi_model *model = hapi_exchange_model_back(m->exchange);
  model->number = ++m->number;
  model->model = HAP_MODEL_CONTACT;
  model->body_count = model->contact_count = BODIES;
  for (uint32_t i = 0; i < BODIES; ++i) {
    fill_body(&hapi_model_bodies(model)[i], &hapi_model_contacts(model)[i], i);
  }
  hapi_exchange_model_publish(m->exchange);
}

static void publish_patches(message_bed *m)
{
  hapi_patches *patches = hapi_exchange_patches_back(m->exchange);
  patches->model_number = m->number;
  patches->contact_count = CONTACTS;
  for (uint32_t i = 0; i < CONTACTS; ++i) {
    hapi_patch_contact *c = &hapi_patches_contacts(patches)[i];
    memset(c, 0, sizeof *c);
    c->key = i / POINTS + 1;
    c->body_a = i / POINTS % BODIES;
    c->body_b = (c->body_a + 1 + i / POINTS / BODIES) % BODIES;
    c->generation_a = c->generation_b = 1;
    c->core_a[0] = (i & 1u) != 0 ? 0.025 : -0.025;
    c->core_a[1] = (i & 2u) != 0 ? 0.025 : -0.025;
  }
  hapi_exchange_patches_publish(m->exchange);
}

static bool message_open_bed(message_bed *m)
{
  const hapi_capacity capacity = {BODIES, CONTACTS, 1, 1, 1};
  memset(m, 0, sizeof *m);
  m->tick.facts.period = 1e-3;
  if (!hapi_tick_memory_create(&m->tick, &capacity) ||
      hapi_exchange_create(&capacity, &m->exchange) < HAP_OK) {
    return false;
  }
  hapi_tick_reset(&m->tick);
  hapi_pointer *p = &m->tick.pointers.of[0];
  p->generation = 1;
  p->shape.radius = 0.01;
  p->pose.quat_wxyz[0] = p->device.pose_world_device.quat_wxyz[0] = p->device.pose.quat_wxyz[0] =
      1.0;
  return true;
}

static void message_close_bed(message_bed *m)
{
  hapi_tick_memory_destroy(&m->tick);
  hapi_exchange_destroy(m->exchange);
}

typedef struct message_times {
  double hand_over[MESSAGE_RUNS];
  double bodies[MESSAGE_RUNS];
  double contacts[MESSAGE_RUNS];
} message_times;

/* Writing a message is the other threads' time. False: a message did not arrive whole. */
static bool message_measure(message_bed *m, int repeats, int run, message_times *out)
{
  int64_t spent[3] = {0, 0, 0};
  bool whole = true;
  for (int i = 0; i < repeats; ++i) {
    publish_model(m);
    publish_patches(m);
    int64_t begin_ns = hapi_clock_now();
    hapi_model *model = hapi_exchange_model_take(m->exchange);
    hapi_patches *patches = hapi_exchange_patches_take(m->exchange);
    int64_t taken_ns = hapi_clock_now();
    hapi_tick_adopt(&m->tick, model, m->tick.facts.now_ns);
    int64_t bodies_ns = hapi_clock_now();
    hapi_tick_adopt_patches(&m->tick, patches);
    int64_t end_ns = hapi_clock_now();
    spent[0] += taken_ns - begin_ns;
    spent[1] += bodies_ns - taken_ns;
    spent[2] += end_ns - bodies_ns;
    whole = whole && m->tick.bodies.live_count == BODIES && m->tick.touches.count == BODIES &&
            m->tick.contacts.memory_count == CONTACTS;
  }
  out->hand_over[run] = (double)spent[0] / repeats;
  out->bodies[run] = (double)spent[1] / repeats;
  out->contacts[run] = (double)spent[2] / repeats;
  return whole;
}

/* Part of hapode-bench tick: what it costs the loop to take a message in. */
static hap_status bench_tick_message(bench *b, FILE *csv)
{
  message_bed m;
  message_times times;
  bool good = message_open_bed(&m);
  for (int run = 0; run < MESSAGE_RUNS && good; ++run) {
    good = message_measure(&m, b->quick ? 2000 : 20000, run, &times);
  }
  message_close_bed(&m);
  if (!good) {
    return bench_fail(b, HAP_ERROR_STATE, "messages: they do not arrive as they were sent");
  }
  double hand_over = bench_median(times.hand_over, MESSAGE_RUNS);
  double bodies = bench_median(times.bodies, MESSAGE_RUNS);
  double contacts = bench_median(times.contacts, MESSAGE_RUNS);
  fprintf(csv, "message,%u,%u,%.1f,%.2f," TICK_CONTACT_EMPTY "\n", BODIES, CONTACTS,
          hand_over + bodies + contacts, (bodies + contacts) / BODIES);
  bench_check(
      b, hand_over <= MESSAGE_BOUND_NS,
      "message of %u bodies and %u contacts: hand-over, without a copy, %.0f ns (bound 5000)",
      BODIES, CONTACTS, hand_over);
  bench_say("  taken in by a tick: bodies %.0f ns, contacts %.0f ns", bodies, contacts);
  return HAP_OK;
}

/* Eight cubes at one hand, in real time: device, tick and messages of a session with its threads, at 1, 4
 * and 10 kHz. "free": they fall up against the hand and touch nothing else. "floor": the hand presses them
 * down on it, so model CONTACT carries 4 contacts of each as well. The duty is that of the median tick: on a
 * machine that others use the mean counts their work as well; it stands beside it. */

#define CUBES 8
#define SETTLED_S 0.5
#define FAST_HZ 10000.0
#define DUTY_BOUND 0.05 /* free, at FAST_HZ */
#define DAMPING 4.0     /* N s/m: soon at rest on the scene's 100 N/m */

static const double rates[] = {1000.0, 4000.0, FAST_HZ};
static const hap_model rate_models[] = {HAP_MODEL_IMPULSE, HAP_MODEL_ACCELERANCE,
                                        HAP_MODEL_CONTACT};

#define COUNT(array) (sizeof(array) / sizeof((array)[0]))

typedef struct rate_case {
  hap_model model;
  double haptic_hz;
  bool free;
} rate_case;

/* A cube on one point would roll off within a moment: these are hard to turn. */
static void turn_over(const scene *s)
{
  dWorldSetGravity(s->world, 0.0, 0.0, s->parameters.gravity);
  for (int i = 0; i < s->count; ++i) {
    dMass mass;
    dBodyGetMass(s->bodies[i], &mass);
    for (int axis = 0; axis < 3; ++axis) {
      mass.I[5 * axis] *= 1e6;
    }
    dBodySetMass(s->bodies[i], &mass);
  }
}

static hap_status open_rig(bench *b, const rate_case *what, rig *out)
{
  static scene_parameters field; /* the session keeps no copy */
  rig_options options;
  field = *cycles_scene("field");
  field.damping = DAMPING;
  rig_options_init(&options);
  options.parameters = &field;
  options.count = CUBES;
  options.devices[0] = what->free ? "virtual:path=0:0/0/80.051,hand=rigid" : field.hands[0];
  options.device_count = 1;
  options.max_force = 200.0;
  options.def.drive = HAP_DRIVE_THREADS;
  options.def.model = what->model;
  options.def.haptic_hz = what->haptic_hz;
  hap_status status = rig_create(&options, out, &b->detail);
  if (status >= HAP_OK && what->free) {
    turn_over(out->scene);
  }
  return status >= HAP_OK ? hap_session_start(out->session) : status;
}

static void wait(double seconds)
{
  hapi_clock_sleep_until(hapi_clock_now() + (int64_t)(1e9 * seconds));
}

static hap_status all_push(bench *b, const rig *r)
{
  hap_pointer_state state;
  hap_status status = hap_pointer_get(r->session, r->pointers[0], &state, sizeof state);
  return status < HAP_OK || state.contacts == CUBES
             ? status
             : bench_fail(b, HAP_ERROR_STATE, "%u of %d cubes push the hand", state.contacts,
                          CUBES);
}

static hap_status rate_measure(bench *b, const rate_case *what, hap_stats *out)
{
  rig r;
  memset(&r, 0, sizeof r);
  hap_status status = open_rig(b, what, &r);
  if (status >= HAP_OK) {
    wait(SETTLED_S);
    wait(b->quick ? 0.5 : 2.0);
    (void)hap_session_stats(r.session, out, sizeof *out);
    status = all_push(b, &r);
  } else if (r.session != NULL) {
    (void)hap_session_detail(r.session, &b->detail);
  }
  rig_destroy(&r);
  return status;
}

static void rate_report(bench *b, const rate_case *what, const hap_stats *s, FILE *csv)
{
  double duty = 1e-6 * s->loop.tick_us_p50 * what->haptic_hz;
  const char *name = hap_model_name(what->model);
  const char *layout = what->free ? "free" : "floor";
  const char *text =
      "%s, %d neighbours, %s, %g kHz: the loop takes %.2f us a cycle, %.2f %% of a "
      "core (mean %.2f %%)%s";
  double mean = 100.0 * s->loop.duty;
  if (what->free && what->haptic_hz == FAST_HZ) {
    bench_check(b, duty <= DUTY_BOUND, text, name, CUBES, layout, 1e-3 * what->haptic_hz,
                s->loop.tick_us_p50, 100.0 * duty, mean, " (bound 5 %)");
  } else {
    bench_say(text, name, CUBES, layout, 1e-3 * what->haptic_hz, s->loop.tick_us_p50, 100.0 * duty,
              mean, "");
  }
  fprintf(csv, "%s,%d,,%.1f,%.2f,%.1f,field_%s,%gkHz,,,,\n", name, CUBES, 1e3 * s->loop.tick_us_p50,
          1e3 * s->loop.tick_us_p50 / CUBES, 1e3 * s->loop.tick_us_p99, layout,
          1e-3 * what->haptic_hz);
}

/* Part of hapode-bench tick: the share of a core that a whole session's loop takes at 1, 4 and 10 kHz. */
static hap_status bench_tick_rate(bench *b, FILE *csv)
{
  hap_status status = HAP_OK;
  for (size_t i = 0; i < COUNT(rate_models) * COUNT(rates) * 2 && status >= HAP_OK; ++i) {
    hap_stats stats;
    rate_case what = {rate_models[i / 2 / COUNT(rates)], rates[i / 2 % COUNT(rates)], i % 2 == 0};
    if (!b->quick || what.haptic_hz == FAST_HZ) {
      status = rate_measure(b, &what, &stats);
      if (status >= HAP_OK) {
        rate_report(b, &what, &stats, csv);
      }
    }
  }
  return status;
}

/* The haptic loop alone: the pure tick and its report to physics, without devices and threads. Cubes
 * all around a pointer are pulled against it and every one of them pushes it; each has one contact.
 * A time is the median of many runs, a run the mean of some ticks: shorter than what a busy machine lets
 * a program work without a break. */

#define NEIGHBOURS_MAX 256
#define RUNS_QUICK 201
#define RUNS 1001
#define WARM_TICKS 2000 /* two seconds: the cubes have come to rest */
#define PERIOD_NS 1000000
#define BOUND_NS 60.0 /* a neighbour */

static const uint32_t sizes[] = {1, 8, 64, NEIGHBOURS_MAX};
#define SIZE_COUNT (sizeof sizes / sizeof sizes[0])

#define MANY_NS 30000.0 /* NEIGHBOURS_MAX at once, models that move bodies */

static const hap_model models[] = {HAP_MODEL_SINGLE, HAP_MODEL_IMPULSE, HAP_MODEL_ACCELERANCE,
                                   HAP_MODEL_CONTACT};
#define MODEL_COUNT (sizeof models / sizeof models[0])

static const double radius = 0.01;     /* m, pointer */
static const double half_edge = 0.025; /* m, cubes */
static const double mass = 0.15;       /* kg */
static const double stiffness = 2000.0;
static const double damping = 5.0;
static const double depth = 1e-4; /* m, at rest */

typedef struct bed {
  hapi_tick tick;
  hapi_exchange *exchange;
} bed;

static void close_bed(bed *t)
{
  hapi_tick_memory_destroy(&t->tick);
  hapi_exchange_destroy(t->exchange);
}

static bool allocate(hapi_tick *tick, uint32_t count)
{
  const hapi_capacity capacity = {count, count, 1, 1, 1, 0, 0, 1};
  tick->facts.period = 1e-9 * PERIOD_NS;
  return hapi_tick_memory_create(tick, &capacity);
}

/* Directions spread over the sphere. */
static void direction(uint32_t index, uint32_t count, double out[3])
{
  const double golden = 2.39996322972865332; /* rad */
  double z = 1.0 - (2.0 * index + 1.0) / count;
  double ring = sqrt(1.0 - z * z);
  hapi_v3_set(out, ring * cos(golden * index), ring * sin(golden * index), z);
}

static void put_body(hapi_model_body *body, hapi_model_contact *contact, uint32_t index,
                     uint32_t count)
{
  double away[3];
  direction(index, count, away);
  memset(body, 0, sizeof *body);
  memset(contact, 0, sizeof *contact);
  body->slot = contact->slot = contact->body = index;
  body->generation = contact->generation = contact->pointer_generation = 1;
  body->pose.quat_wxyz[0] = 1.0;
  hapi_v3_scale(radius - depth + half_edge, away, body->pose.position);
  hapi_v3_scale(-stiffness * depth / mass, away, body->b);
  hapi_v3_scale(-half_edge, away, contact->point_body);
  hapi_v3_scale(-1.0, away, contact->normal_body);
  for (int axis = 0; axis < 3; ++axis) { /* a free cube: [I/m; J^-1 [r]x] */
    double unit[3] = {0.0, 0.0, 0.0};
    double turn[3];
    double inertia = mass * 4.0 * half_edge * half_edge / 6.0;
    unit[axis] = 1.0;
    hapi_v3_cross(contact->point_body, unit, turn);
    contact->a[axis][axis] = 1.0 / mass;
    for (int i = 0; i < 3; ++i) {
      contact->a[3 + i][axis] = turn[i] / inertia;
    }
  }
}

/* Model CONTACT moves it by its own mass. */
static void own_body(hapi_model_body *body)
{
  double inertia = mass * 4.0 * half_edge * half_edge / 6.0;
  body->flags = HAPI_BODY_OWNED;
  body->mass = mass;
  hapi_v3_copy(body->b, body->gravity);
  body->linear_keep = body->angular_keep = 1.0;
  body->max_angular_speed = 1e3;
  for (int i = 0; i < 9; i += 4) {
    body->inertia[i] = inertia;
    body->inverse_inertia[i] = 1.0 / inertia;
  }
}

static void put_pointer(hapi_pointer *p)
{
  memset(p, 0, sizeof *p);
  p->generation = 1;
  p->shape.collide_bits = ~0u;
  p->shape.radius = radius;
  p->surface.stiffness = stiffness;
  p->surface.damping = damping;
  p->device.motion_scale = p->device.force_scale = 1.0;
  p->device.limits.max_force = p->device.limits.max_torque = 1e6;
  p->device.limits.slew_force = p->device.limits.slew_torque = 5e8;
  p->device.pose_world_device.quat_wxyz[0] = 1.0;
  p->device.pose.quat_wxyz[0] = 1.0;
}

static hap_status open_bed(bench *b, hap_model model, uint32_t count, bed *out)
{
  memset(out, 0, sizeof *out);
  if (!allocate(&out->tick, count) ||
      hapi_exchange_create(&out->tick.capacity, &out->exchange) < HAP_OK) {
    close_bed(out);
    return bench_fail(b, HAP_ERROR_MEMORY, "no memory for %u neighbours", count);
  }
  hapi_tick_reset(&out->tick);
  put_pointer(&out->tick.pointers.of[0]);
  hapi_model *message = hapi_exchange_model_back(out->exchange);
  message->number = 1;
  message->model = model;
  message->impulse_pose = HAP_IMPULSE_INTERPOLATED;
  message->blend_s = 0.05;
  message->body_count = message->contact_count = count;
  for (uint32_t i = 0; i < count; ++i) {
    put_body(&hapi_model_bodies(message)[i], &hapi_model_contacts(message)[i], i, count);
  }
  for (uint32_t i = 0; model == HAP_MODEL_CONTACT && i < count; ++i) {
    own_body(&hapi_model_bodies(message)[i]);
  }
  hapi_tick_adopt(&out->tick, message, 0);
  hapi_patches *patches = hapi_exchange_patches_back(out->exchange); /* they touch nothing else */
  patches->model_number = message->number;
  hapi_tick_adopt_patches(&out->tick, patches);
  return HAP_OK;
}

static void run_ticks(bed *t, uint32_t count)
{
  for (uint32_t i = 0; i < count; ++i) {
    hapi_tick_run(&t->tick, t->tick.facts.now_ns + PERIOD_NS);
    hapi_tick_report(&t->tick, hapi_exchange_state_back(t->exchange));
    hapi_exchange_state_publish(t->exchange);
  }
}

static hap_status measure(bench *b, hap_model model, uint32_t count, double *out_ns)
{
  bed t;
  double values[RUNS];
  int runs = b->quick ? RUNS_QUICK : RUNS;
  uint32_t ticks = 1 + 2000u / (count + 4u);
  hap_status status = open_bed(b, model, count, &t);
  if (status < HAP_OK) {
    return status;
  }
  run_ticks(&t, WARM_TICKS);
  for (int i = 0; i < runs; ++i) {
    int64_t begin_ns = hapi_clock_now();
    run_ticks(&t, ticks);
    values[i] = (double)(hapi_clock_now() - begin_ns) / ticks;
  }
  *out_ns = bench_median(values, (size_t)runs);
  if (t.tick.touches.pushing != count || t.tick.guard.latch.fault != HAP_FAULT_NONE) {
    status = bench_fail(b, HAP_ERROR_STATE, "only %u of %u neighbours push", t.tick.touches.pushing,
                        count);
  }
  close_bed(&t);
  return status;
}

static hap_status draw(bench *b, double ns[MODEL_COUNT][SIZE_COUNT])
{
  FILE *script = bench_picture_begin(b, "tick", 800, 500);
  if (script != NULL) {
    for (size_t m = 0; m < MODEL_COUNT; ++m) {
      fprintf(script, "$m%zu << EOD\n", m);
      for (size_t i = 0; i < SIZE_COUNT; ++i) {
        fprintf(script, "%u %g\n", sizes[i], ns[m][i] / sizes[i]);
      }
      fprintf(script, "EOD\n");
    }
    fprintf(script,
            "set title 'One tick with its report, without device'\nset logscale x 2\n"
            "set xrange [0.8:320]\nset yrange [0:*]\nset xlabel 'neighbours'\n"
            "set ylabel 'time of a tick per neighbour [ns]'\nplot ");
    for (size_t m = 0; m < MODEL_COUNT; ++m) {
      fprintf(script, "$m%zu with linespoints lt %zu pt 7 ps 0.6 title '%s', ", m, m + 1,
              hap_model_name(models[m]));
    }
    fprintf(script, "%g with lines lc rgb '#606060' dt 2 title 'bound at 8 and 64'\n", BOUND_NS);
  }
  return bench_picture_end(b, "tick", script);
}

static void report(bench *b, hap_model model, uint32_t count, double ns)
{
  const char *text = "%s, %u neighbours, %u contacts: %.1f ns a tick, %.1f ns a neighbour%s";
  const char *name = hap_model_name(model);
  bool moves = model == HAP_MODEL_ACCELERANCE || model == HAP_MODEL_CONTACT;
  if (count == NEIGHBOURS_MAX && moves) {
    bench_check(b, ns <= MANY_NS, text, name, count, count, ns, ns / count,
                " (bound 30 us a tick)");
  } else if ((count == 8 || count == 64) && model != HAP_MODEL_CONTACT) {
    bench_check(b, ns / count <= BOUND_NS, text, name, count, count, ns, ns / count, " (bound 60)");
  } else {
    bench_say(text, name, count, count, ns, ns / count, "");
  }
}

static const char *const parts[] = {"neighbours", "guard", "message", "rates"};
#define PART_COUNT (sizeof parts / sizeof parts[0])

static bool asked(const bench *b, const char *part)
{
  return b->scene == NULL || strcmp(b->scene, part) == 0;
}

static hap_status check_scene(bench *b)
{
  bool found = b->scene == NULL || tick_contact_has(b->scene);
  for (size_t i = 0; i < PART_COUNT; ++i) {
    found = found || strcmp(b->scene, parts[i]) == 0;
  }
  return found ? HAP_OK
               : bench_fail(
                     b, HAP_ERROR_NOT_FOUND,
                     "--scene: there is no \"%s\"; neighbours, guard, message, rates, or one of%s",
                     b->scene, tick_contact_names());
}

hap_status bench_tick(bench *b)
{
  hap_status status = check_scene(b);
  if (status < HAP_OK) {
    return status;
  }
  double ns[MODEL_COUNT][SIZE_COUNT] = {{0.0}};
  FILE *csv = bench_csv_open(
      b, "tick", "model,neighbours,contacts,tick_ns,ns_per_neighbour," TICK_CONTACT_COLUMNS);
  status = csv != NULL ? HAP_OK : HAP_ERROR_IO;
  for (size_t m = 0; m < MODEL_COUNT && asked(b, "neighbours"); ++m) {
    for (size_t i = 0; i < SIZE_COUNT && status >= HAP_OK; ++i) {
      status = measure(b, models[m], sizes[i], &ns[m][i]);
      if (status >= HAP_OK) {
        fprintf(csv, "%s,%u,%u,%.1f,%.2f," TICK_CONTACT_EMPTY "\n", hap_model_name(models[m]),
                sizes[i], sizes[i], ns[m][i], ns[m][i] / sizes[i]);
        report(b, models[m], sizes[i], ns[m][i]);
      }
    }
  }
  status = status >= HAP_OK && asked(b, "guard") ? bench_tick_guard(b, csv) : status;
  status = status >= HAP_OK && asked(b, "message") ? bench_tick_message(b, csv) : status;
  status = status >= HAP_OK ? bench_tick_contact(b, csv) : status;
  status = status >= HAP_OK && asked(b, "rates") ? bench_tick_rate(b, csv) : status;
  hap_status closed = bench_csv_close(b, csv);
  status = status >= HAP_OK ? closed : status;
  return status >= HAP_OK && b->scene == NULL ? draw(b, ns) : status;
}
