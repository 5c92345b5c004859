/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/vec.h"
#include "bench/bench.h"
#include "bench/cycles.h"
#include "bench/tick_contact.h"
#include "haptic/haptic_internal.h"
#include "haptic/tick_memory.h"
#include "session/session_internal.h"
#include "sync/exchange.h"
#include "tick/black_box.h"
#include "tick/report.h"
#include "tick/tick.h"
#include "tools/rig.h"

/* The haptic loop alone: the pure tick and its report to physics, without devices and threads.
 * Cubes all around a pointer are pulled against it and every one of them pushes it; each has one
 * contact. A time is the median of many runs, a run the mean of some ticks: shorter than what a
 * busy machine lets a program work without a break. */

#define NEIGHBOURS_MAX 256
#define RUNS_QUICK 201
#define RUNS 1001
#define WARM_TICKS 2000 /* two seconds: the cubes have come to rest */
#define PERIOD_NS 1000000
#define BOUND_NS 60.0 /* a neighbour */

static const uint32_t loop_sizes[] = {1, 8, 64, NEIGHBOURS_MAX};
#define SIZE_COUNT BENCH_COUNT(loop_sizes)

#define MANY_NS 20000.0 /* NEIGHBOURS_MAX at once, models that move bodies; asked for */

static const hap_model loop_models[] = {HAP_MODEL_SINGLE, HAP_MODEL_IMPULSE, HAP_MODEL_ACCELERANCE,
                                        HAP_MODEL_CONTACT};
#define MODEL_COUNT BENCH_COUNT(loop_models)

static const double loop_radius = 0.01;     /* m, pointer */
static const double loop_half_edge = 0.025; /* m, cubes */
static const double loop_mass = 0.15;       /* kg */
static const double loop_stiffness = 2000.0;
static const double loop_depth = 1e-4; /* m, at rest */

typedef struct loop_bed {
  hapi_tick tick;
  hapi_exchange *exchange;
} loop_bed;

static void loop_close(loop_bed *l)
{
  hapi_tick_memory_destroy(&l->tick);
  hapi_exchange_destroy(l->exchange);
}

/* Directions spread over the sphere. */
static void direction_at(uint32_t index, uint32_t count, double out[3])
{
  const double golden = 2.39996322972865332; /* rad */
  double z = 1.0 - (2.0 * index + 1.0) / count;
  double ring = sqrt(1.0 - z * z);
  hapi_v3_set(out, ring * cos(golden * index), ring * sin(golden * index), z);
}

static void body_put(hapi_model_body *body, hapi_model_contact *contact, uint32_t index,
                     uint32_t count)
{
  double away[3];
  direction_at(index, count, away);
  memset(body, 0, sizeof *body);
  memset(contact, 0, sizeof *contact);
  body->slot = contact->slot = contact->body = index;
  body->generation = contact->generation = contact->pointer_generation = 1;
  body->pose.quat_wxyz[0] = 1.0;
  hapi_v3_scale(loop_radius - loop_depth + loop_half_edge, away, body->pose.position);
  hapi_v3_scale(-loop_stiffness * loop_depth / loop_mass, away, body->b);
  hapi_v3_scale(-loop_half_edge, away, contact->point_body);
  hapi_v3_scale(-1.0, away, contact->normal_body);
  for (int axis = 0; axis < 3; ++axis) { /* a free cube: [I/m; J^-1 [r]x] */
    double unit[3] = {0.0, 0.0, 0.0};
    double turn[3];
    double inertia = loop_mass * 4.0 * loop_half_edge * loop_half_edge / 6.0;
    unit[axis] = 1.0;
    hapi_v3_cross(contact->point_body, unit, turn);
    contact->a[axis][axis] = 1.0 / loop_mass;
    for (int i = 0; i < 3; ++i) {
      contact->a[3 + i][axis] = turn[i] / inertia;
    }
  }
}

/* Model CONTACT moves it by its own mass. */
static void body_own(hapi_model_body *body)
{
  double inertia = loop_mass * 4.0 * loop_half_edge * loop_half_edge / 6.0;
  body->flags = HAPI_BODY_OWNED;
  body->mass = loop_mass;
  hapi_v3_copy(body->b, body->gravity);
  body->linear_keep = body->angular_keep = 1.0;
  body->max_angular_speed = 1e3;
  for (int i = 0; i < 9; i += 4) {
    body->inertia[i] = inertia;
    body->inverse_inertia[i] = 1.0 / inertia;
  }
}

static void pointer_put(hapi_pointer *p)
{
  memset(p, 0, sizeof *p);
  p->generation = 1;
  p->shape.collide_bits = ~0u;
  p->shape.radius = loop_radius;
  p->surface.stiffness = loop_stiffness;
  p->surface.damping = 5.0;
  p->device.motion_scale = p->device.force_scale = 1.0;
  p->device.limits.max_force = p->device.limits.max_torque = 1e6;
  p->device.limits.slew_force = p->device.limits.slew_torque = 5e8;
  p->device.pose_world_device.quat_wxyz[0] = 1.0;
  p->device.pose.quat_wxyz[0] = 1.0;
}

/* The newest message of physics, of so many cubes. */
static hapi_model *model_write(loop_bed *l, hap_model model, uint32_t count)
{
  hapi_model *message = hapi_exchange_model_back(l->exchange);
  message->number = l->tick.facts.model_number + 1;
  message->model = model;
  message->impulse_pose = HAP_IMPULSE_INTERPOLATED;
  message->blend_s = 0.05;
  message->body_count = message->contact_count = count;
  for (uint32_t i = 0; i < count; ++i) {
    body_put(&hapi_model_bodies(message)[i], &hapi_model_contacts(message)[i], i, count);
    if (model == HAP_MODEL_CONTACT) {
      body_own(&hapi_model_bodies(message)[i]);
    }
  }
  return message;
}

/* contacts: that there is room for between cubes and pointer, and between the cubes. */
static hap_status loop_open(bench *b, hap_model model, uint32_t count, uint32_t contacts,
                            loop_bed *out)
{
  const hapi_capacity capacity = {count, contacts, 1, 1, 1, 0, 0, 1};
  memset(out, 0, sizeof *out);
  out->tick.facts.period = 1e-9 * PERIOD_NS;
  if (!hapi_tick_memory_create(&out->tick, &capacity) ||
      hapi_exchange_create(&capacity, &out->exchange) < HAP_OK) {
    loop_close(out);
    return bench_fail(b, HAP_ERROR_MEMORY, "no memory for %u neighbours", count);
  }
  hapi_tick_reset(&out->tick);
  pointer_put(&out->tick.pointers.of[0]);
  hapi_tick_adopt(&out->tick, model_write(out, model, count), 0);
  hapi_patches *patches = hapi_exchange_patches_back(out->exchange); /* they touch nothing else */
  patches->model_number = out->tick.facts.model_number;
  hapi_tick_adopt_patches(&out->tick, patches);
  return HAP_OK;
}

static void loop_run(loop_bed *l, uint32_t count)
{
  for (uint32_t i = 0; i < count; ++i) {
    hapi_tick_run(&l->tick, l->tick.facts.now_ns + PERIOD_NS);
    hapi_tick_report(&l->tick, hapi_exchange_state_back(l->exchange));
    hapi_exchange_state_publish(l->exchange);
  }
}

/* The guard's part of a tick and a row of the black box. */
static void guard_run(loop_bed *l, hapi_black_box *box, uint32_t count)
{
  for (uint32_t i = 0; i < count; ++i) {
    hapi_tick_guard(&l->tick);
    hapi_black_box_record(box, &l->tick);
  }
}

/* ns a tick, or with a black box ns of the guard in a tick. All is at rest at first. */
static hap_status loop_measure(bench *b, loop_bed *l, hapi_black_box *box, uint32_t ticks,
                               double *out_ns)
{
  double values[RUNS];
  int runs = b->quick ? RUNS_QUICK : RUNS;
  loop_run(l, WARM_TICKS);
  for (int i = 0; i < runs; ++i) {
    int64_t begin_ns = hapi_clock_now();
    if (box != NULL) {
      guard_run(l, box, ticks);
    } else {
      loop_run(l, ticks);
    }
    values[i] = (double)(hapi_clock_now() - begin_ns) / ticks;
  }
  *out_ns = bench_median(values, (size_t)runs);
  uint32_t count = l->tick.bodies.live_count;
  return l->tick.touches.pushing == count && l->tick.guard.latch.fault == HAP_FAULT_NONE
             ? HAP_OK
             : bench_fail(b, HAP_ERROR_STATE, "only %u of %u neighbours push",
                          l->tick.touches.pushing, count);
}

static void csv_row(FILE *csv, const char *name, uint32_t bodies, uint32_t contacts, double ns)
{
  fprintf(csv, "%s,%u,%u,%.1f,%.2f," TICK_CONTACT_EMPTY "\n", name, bodies, contacts, ns,
          ns / bodies);
}

static void loop_report(bench *b, hap_model model, uint32_t count, double ns)
{
  const char *text = "%s, %u neighbours, %u contacts: %.1f ns a tick, %.1f ns a neighbour%s";
  const char *name = hap_model_name(model);
  bool moves = model == HAP_MODEL_ACCELERANCE || model == HAP_MODEL_CONTACT;
  if (count == NEIGHBOURS_MAX && moves) {
    bench_check(b, ns <= MANY_NS, text, name, count, count, ns, ns / count,
                " (bound 20 us a tick)");
  } else if ((count == 8 || count == 64) && model != HAP_MODEL_CONTACT) {
    bench_check(b, ns / count <= BOUND_NS, text, name, count, count, ns, ns / count, " (bound 60)");
  } else {
    bench_say(text, name, count, count, ns, ns / count, "");
  }
}

typedef struct tick_times {
  double ns[MODEL_COUNT][SIZE_COUNT];
} tick_times;

static hap_status bench_tick_neighbours(bench *b, FILE *csv, tick_times *out)
{
  hap_status status = HAP_OK;
  for (size_t i = 0; i < MODEL_COUNT * SIZE_COUNT && status >= HAP_OK; ++i) {
    hap_model model = loop_models[i / SIZE_COUNT];
    uint32_t count = loop_sizes[i % SIZE_COUNT];
    double *out_ns = &out->ns[i / SIZE_COUNT][i % SIZE_COUNT];
    loop_bed l;
    status = loop_open(b, model, count, count, &l);
    if (status >= HAP_OK) {
      status = loop_measure(b, &l, NULL, 1 + 2000u / (count + 4u), out_ns);
      loop_close(&l);
    }
    if (status >= HAP_OK) {
      csv_row(csv, hap_model_name(model), count, count, *out_ns);
      loop_report(b, model, count, *out_ns);
    }
  }
  return status;
}

/* What the guard costs: all of its steps and a row of the black box, for one pointer in touch with
 * cubes that the loop owns (model CONTACT), whose energies the observer follows. */

#define GUARD_BOUND_NS 100.0

/* Rows of tick.csv, model "guard". */
static hap_status bench_tick_guard(bench *b, FILE *csv)
{
  static hap_black_box_row rows[HAP_BLACK_BOX_TICKS];
  static uint32_t counts[HAP_BLACK_BOX_TICKS];
  static const uint32_t sizes[] = {1, 8, 64};
  for (size_t i = 0; i < BENCH_COUNT(sizes); ++i) {
    hapi_black_box box = {.rows = rows, .counts = counts, .pointers = 1};
    loop_bed l;
    double ns = 0.0;
    hap_status status = loop_open(b, HAP_MODEL_CONTACT, sizes[i], sizes[i], &l);
    if (status >= HAP_OK) {
      hapi_black_box_reset(&box);
      status = loop_measure(b, &l, &box, 4000u / (sizes[i] + 4u), &ns);
      bool watched = l.tick.guard.energy_ticks == 0 && l.tick.guard.stored_max > 0.0;
      loop_close(&l);
      if (status >= HAP_OK && !watched) {
        status = bench_fail(b, HAP_ERROR_STATE, "guard, %u bodies: not as it should be", sizes[i]);
      }
    }
    if (status < HAP_OK) {
      return status;
    }
    csv_row(csv, "guard", sizes[i], sizes[i], ns);
    const char *text = "guard and black box, one pointer, %u bodies: %.1f ns a tick%s";
    if (sizes[i] == 1) {
      bench_check(b, ns <= GUARD_BOUND_NS, text, sizes[i], ns, " (bound 100)");
    } else {
      bench_say(text, sizes[i], ns, "");
    }
  }
  return HAP_OK;
}

/* What a message costs the loop: 64 bodies with a pointer contact each, and 512 contacts between
 * them, 4 a pair. hand-over: publish, by the other thread, and take; nothing is copied there.
 * bodies, contacts: what the tick does with what it has taken, model CONTACT, all of it known
 * before. A time is the median of 5 runs. */

#define MESSAGE_RUNS 5
#define MESSAGE_BODIES 64u
#define MESSAGE_CONTACTS 512u
#define MESSAGE_POINTS 4u /* of a pair */
#define MESSAGE_BOUND_NS 5000.0

static void patches_publish(loop_bed *l, uint64_t number)
{
  hapi_patches *patches = hapi_exchange_patches_back(l->exchange);
  patches->model_number = number;
  patches->contact_count = MESSAGE_CONTACTS;
  for (uint32_t i = 0; i < MESSAGE_CONTACTS; ++i) {
    hapi_patch_contact *c = &hapi_patches_contacts(patches)[i];
    memset(c, 0, sizeof *c);
    c->key = i / MESSAGE_POINTS + 1;
    c->body_a = i / MESSAGE_POINTS % MESSAGE_BODIES;
    c->body_b = (c->body_a + 1 + i / MESSAGE_POINTS / MESSAGE_BODIES) % MESSAGE_BODIES;
    c->generation_a = c->generation_b = 1;
    c->core_a[0] = (i & 1u) != 0 ? 0.025 : -0.025;
    c->core_a[1] = (i & 2u) != 0 ? 0.025 : -0.025;
  }
  hapi_exchange_patches_publish(l->exchange);
}

/* ns of hand-over, bodies and contacts. Writing a message is the other threads' time. False: a
 * message did not arrive whole. */
static bool message_measure(loop_bed *l, int repeats, double out_ns[3])
{
  int64_t spent[3] = {0, 0, 0};
  bool whole = true;
  for (int i = 0; i < repeats; ++i) {
    uint64_t number = model_write(l, HAP_MODEL_CONTACT, MESSAGE_BODIES)->number;
    hapi_exchange_model_publish(l->exchange);
    patches_publish(l, number);
    int64_t begin_ns = hapi_clock_now();
    hapi_model *model = hapi_exchange_model_take(l->exchange);
    hapi_patches *patches = hapi_exchange_patches_take(l->exchange);
    int64_t taken_ns = hapi_clock_now();
    hapi_tick_adopt(&l->tick, model, l->tick.facts.now_ns);
    int64_t bodies_ns = hapi_clock_now();
    hapi_tick_adopt_patches(&l->tick, patches);
    spent[0] += taken_ns - begin_ns;
    spent[1] += bodies_ns - taken_ns;
    spent[2] += hapi_clock_now() - bodies_ns;
    whole = whole && l->tick.bodies.live_count == MESSAGE_BODIES &&
            l->tick.touches.count == MESSAGE_BODIES &&
            l->tick.contacts.memory_count == MESSAGE_CONTACTS;
  }
  for (int k = 0; k < 3; ++k) {
    out_ns[k] = (double)spent[k] / repeats;
  }
  return whole;
}

/* Part of hapode-bench tick: what it costs the loop to take a message in. */
static hap_status bench_tick_message(bench *b, FILE *csv)
{
  loop_bed l;
  double ns[3];
  double values[3][MESSAGE_RUNS];
  hap_status status = loop_open(b, HAP_MODEL_CONTACT, MESSAGE_BODIES, MESSAGE_CONTACTS, &l);
  if (status < HAP_OK) {
    return status;
  }
  for (int run = 0; run < MESSAGE_RUNS && status >= HAP_OK; ++run) {
    if (!message_measure(&l, b->quick ? 2000 : 20000, ns)) {
      status = bench_fail(b, HAP_ERROR_STATE, "messages: they do not arrive as they were sent");
    }
    for (int k = 0; k < 3; ++k) {
      values[k][run] = ns[k];
    }
  }
  loop_close(&l);
  for (int k = 0; k < 3; ++k) {
    ns[k] = bench_median(values[k], MESSAGE_RUNS);
  }
  if (status < HAP_OK) {
    return status;
  }
  fprintf(csv, "message,%u,%u,%.1f,%.2f," TICK_CONTACT_EMPTY "\n", MESSAGE_BODIES, MESSAGE_CONTACTS,
          ns[0] + ns[1] + ns[2], (ns[1] + ns[2]) / MESSAGE_BODIES);
  bench_check(
      b, ns[0] <= MESSAGE_BOUND_NS,
      "message of %u bodies and %u contacts: hand-over, without a copy, %.0f ns (bound 5000)",
      MESSAGE_BODIES, MESSAGE_CONTACTS, ns[0]);
  bench_say("  taken in by a tick: bodies %.0f ns, contacts %.0f ns", ns[1], ns[2]);
  return HAP_OK;
}

/* Eight cubes at one hand, in real time: device, tick and messages of a session with its
 * threads, at 1, 4 and 10 kHz. "free": they fall up against the hand and touch nothing else.
 * "floor": the hand presses them down on it, so model CONTACT carries 4 contacts of each as
 * well. The duty is that of the median tick: on a machine that others use the mean counts their
 * work as well; it stands beside it. */

#define RATE_CUBES 8
#define SETTLE_S 0.5
#define FAST_HZ 10000.0
#define DUTY_BOUND 0.05  /* free, at FAST_HZ */
#define RATE_DAMPING 4.0 /* N s/m: soon at rest on the scene's 100 N/m */

static const double rate_hz[] = {1000.0, 4000.0, FAST_HZ};
static const hap_model rate_models[] = {HAP_MODEL_IMPULSE, HAP_MODEL_ACCELERANCE,
                                        HAP_MODEL_CONTACT};

typedef struct rate_case {
  hap_model model;
  double haptic_hz;
  bool free;
} rate_case;

/* A cube on one point would roll off within a moment: these are hard to turn. */
static void world_turn_over(const scene *s)
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

static hap_status rate_open(bench *b, const rate_case *what, rig *out)
{
  static scene_parameters field; /* the session keeps no copy */
  rig_options options;
  field = *cycles_scene("field");
  field.damping = RATE_DAMPING;
  rig_options_init(&options);
  options.parameters = &field;
  options.count = RATE_CUBES;
  options.devices[0] = what->free ? "virtual:path=0:0/0/80.051,hand=rigid" : field.hands[0];
  options.device_count = 1;
  options.max_force = 200.0;
  options.def.drive = HAP_DRIVE_THREADS;
  options.def.model = what->model;
  options.def.haptic_hz = what->haptic_hz;
  hap_status status = rig_create(&options, out, &b->detail);
  if (status < HAP_OK) {
    return status;
  }
  if (what->free) {
    world_turn_over(out->scene);
  }
  return bench_explain(b, out->session, hap_session_start(out->session));
}

static hap_status rate_measure(bench *b, const rate_case *what, hap_stats *out)
{
  rig r;
  hap_pointer_state state;
  hap_status status = rate_open(b, what, &r);
  if (status >= HAP_OK) {
    hapi_clock_sleep_until(hapi_clock_now() + (int64_t)(1e9 * (SETTLE_S + (b->quick ? 0.5 : 2.0))));
    (void)hap_session_stats(r.session, out, sizeof *out);
    status = hap_pointer_get(r.session, r.pointers[0], &state, sizeof state);
    if (status >= HAP_OK && state.contacts != RATE_CUBES) {
      status = bench_fail(b, HAP_ERROR_STATE, "%u of %d cubes push the hand", state.contacts,
                          RATE_CUBES);
    }
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
    bench_check(b, duty <= DUTY_BOUND, text, name, RATE_CUBES, layout, 1e-3 * what->haptic_hz,
                s->loop.tick_us_p50, 100.0 * duty, mean, " (bound 5 %)");
  } else {
    bench_say(text, name, RATE_CUBES, layout, 1e-3 * what->haptic_hz, s->loop.tick_us_p50,
              100.0 * duty, mean, "");
  }
  fprintf(csv, "%s,%d,,%.1f,%.2f,%.1f,field_%s,%gkHz,,,,\n", name, RATE_CUBES,
          1e3 * s->loop.tick_us_p50, 1e3 * s->loop.tick_us_p50 / RATE_CUBES,
          1e3 * s->loop.tick_us_p99, layout, 1e-3 * what->haptic_hz);
}

/* Part of hapode-bench tick: the share of a core that a whole session's loop takes at 1, 4 and
 * 10 kHz. */
static hap_status bench_tick_rate(bench *b, FILE *csv)
{
  hap_status status = HAP_OK;
  for (size_t i = 0; i < BENCH_COUNT(rate_models) * BENCH_COUNT(rate_hz) * 2 && status >= HAP_OK;
       ++i) {
    hap_stats stats;
    rate_case what = {rate_models[i / 2 / BENCH_COUNT(rate_hz)],
                      rate_hz[i / 2 % BENCH_COUNT(rate_hz)], i % 2 == 0};
    if (!b->quick || what.haptic_hz == FAST_HZ) {
      status = rate_measure(b, &what, &stats);
      if (status >= HAP_OK) {
        rate_report(b, &what, &stats, csv);
      }
    }
  }
  return status;
}

/* ---- the program ---- */

static void tick_draw(FILE *script, const void *data)
{
  const tick_times *times = data;
  for (size_t m = 0; m < MODEL_COUNT; ++m) {
    fprintf(script, "$m%zu << EOD\n", m);
    for (size_t i = 0; i < SIZE_COUNT; ++i) {
      fprintf(script, "%u %g\n", loop_sizes[i], times->ns[m][i] / loop_sizes[i]);
    }
    fprintf(script, "EOD\n");
  }
  fprintf(script,
          "set title 'One tick with its report, without device'\nset logscale x 2\n"
          "set xrange [0.8:320]\nset yrange [0:*]\nset xlabel 'neighbours'\n"
          "set ylabel 'time of a tick per neighbour [ns]'\nplot ");
  for (size_t m = 0; m < MODEL_COUNT; ++m) {
    fprintf(script, "$m%zu with linespoints lt %zu pt 7 ps 0.6 title '%s', ", m, m + 1,
            hap_model_name(loop_models[m]));
  }
  fprintf(script, "%g with lines lc rgb '#606060' dt 2 title 'bound at 8 and 64'\n", BOUND_NS);
}

static bool part_asked(const bench *b, const char *part)
{
  return b->scene == NULL || strcmp(b->scene, part) == 0;
}

static hap_status scene_check(bench *b)
{
  static const char *const parts[] = {"neighbours", "guard", "message", "rates"};
  hap_detail names = {""};
  size_t used = 0;
  bool found = false;
  for (size_t i = 0; i < BENCH_COUNT(parts); ++i) {
    found = found || part_asked(b, parts[i]);
  }
  for (size_t i = 0; i < bench_tick_case_count(); ++i) {
    found = found || part_asked(b, bench_tick_case(i));
    if (i == 0 || strcmp(bench_tick_case(i - 1), bench_tick_case(i)) != 0) {
      used +=
          (size_t)snprintf(names.text + used, sizeof names.text - used, " %s", bench_tick_case(i));
    }
  }
  return found ? HAP_OK
               : bench_fail(
                     b, HAP_ERROR_NOT_FOUND,
                     "--scene: there is no \"%s\"; neighbours, guard, message, rates, or one of%s",
                     b->scene, names.text);
}

hap_status bench_tick(bench *b)
{
  tick_times times = {{{0.0}}};
  hap_status status = scene_check(b);
  if (status < HAP_OK) {
    return status;
  }
  FILE *csv = bench_csv_open(
      b, "tick", "model,neighbours,contacts,tick_ns,ns_per_neighbour," TICK_CONTACT_COLUMNS);
  if (csv == NULL) {
    return HAP_ERROR_IO;
  }
  status = part_asked(b, "neighbours") ? bench_tick_neighbours(b, csv, &times) : HAP_OK;
  status = status >= HAP_OK && part_asked(b, "guard") ? bench_tick_guard(b, csv) : status;
  status = status >= HAP_OK && part_asked(b, "message") ? bench_tick_message(b, csv) : status;
  status = status >= HAP_OK ? bench_tick_contact(b, csv) : status;
  status = status >= HAP_OK && part_asked(b, "rates") ? bench_tick_rate(b, csv) : status;
  status = bench_csv_close(b, csv, status);
  return status >= HAP_OK && b->scene == NULL ? bench_draw(b, "tick", 800, 500, tick_draw, &times)
                                              : status;
}
