/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The haptic loop alone: the pure tick and its report to physics, without devices and threads. Cubes
 * all around a pointer are pulled against it and every one of them pushes it; each has one contact.
 * A time is the median of many runs, a run the mean of some ticks: shorter than what a busy machine lets
 * a program work without a break. */

#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/vec.h"
#include "bench/bench.h"
#include "bench/tick_contact.h"
#include "bench/tick_guard.h"
#include "bench/tick_message.h"
#include "bench/tick_rate.h"
#include "haptic/rt/tick.h"
#include "haptic/tick_memory.h"
#include "sync/exchange.h"

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
  tick->period = 1e-9 * PERIOD_NS;
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

static void put_pointer(hapi_tick_pointer *p)
{
  memset(p, 0, sizeof *p);
  p->generation = 1;
  p->collide_bits = ~0u;
  p->radius = radius;
  p->stiffness = stiffness;
  p->damping = damping;
  p->motion_scale = p->force_scale = 1.0;
  p->max_force = p->max_torque = 1e6;
  p->slew_force = p->slew_torque = 5e8;
  p->pose_world_device.quat_wxyz[0] = 1.0;
  p->device_pose.quat_wxyz[0] = 1.0;
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
  put_pointer(&out->tick.pointers[0]);
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
    hapi_tick_run(&t->tick, t->tick.now_ns + PERIOD_NS);
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
  if (t.tick.pushing != count || t.tick.fault != HAP_FAULT_NONE) {
    status = bench_fail(b, HAP_ERROR_STATE, "only %u of %u neighbours push", t.tick.pushing, count);
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
