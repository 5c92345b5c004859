/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* What the guard costs: all of its steps and a row of the black box, for one pointer in touch with
 * cubes that the loop owns (model CONTACT), whose energies the observer follows. A time is the median
 * of many short runs. */

#include "bench/tick_guard.h"

#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/vec.h"
#include "bench/tick_contact.h"
#include "haptic/rt/black_box.h"
#include "haptic/tick_memory.h"
#include "sync/exchange.h"

#define RUNS_QUICK 201
#define RUNS 1001
#define TICK_NS 1000000
#define BOUND_NS 100.0

static const double mass = 0.15;       /* kg */
static const double radius = 0.01;     /* m, pointer */
static const double half_edge = 0.025; /* m, cubes */
static const double stiffness = 2000.0;
static const double depth = 1e-4; /* m, at rest */

typedef struct guard_bed {
  hapi_tick tick;
  hapi_exchange *exchange;
  hapi_black_box box;
} guard_bed;

static void close_bed(guard_bed *g)
{
  hapi_tick_memory_destroy(&g->tick);
  hapi_exchange_destroy(g->exchange);
  hapi_free(g->box.rows);
  hapi_free(g->box.counts);
}

static bool allocate(guard_bed *g, uint32_t count)
{
  const hapi_capacity capacity = {count, count, 1, 1, 1, 0, 0, 1};
  g->box.pointers = 1;
  g->box.rows = hapi_alloc_array(HAP_BLACK_BOX_TICKS, sizeof *g->box.rows);
  g->box.counts = hapi_alloc_array(HAP_BLACK_BOX_TICKS, sizeof *g->box.counts);
  g->tick.period = 1e-9 * TICK_NS;
  return hapi_tick_memory_create(&g->tick, &capacity) && g->box.rows != NULL &&
         g->box.counts != NULL && hapi_exchange_create(&capacity, &g->exchange) >= HAP_OK;
}

static void put_pointer(hapi_tick_pointer *p)
{
  memset(p, 0, sizeof *p);
  p->generation = 1;
  p->radius = radius;
  p->stiffness = stiffness;
  p->damping = 5.0;
  p->motion_scale = p->force_scale = 1.0;
  p->max_force = p->max_torque = 20.0;
  p->slew_force = p->slew_torque = 10000.0;
  p->pose_world_device.quat_wxyz[0] = 1.0;
  p->device_pose.quat_wxyz[0] = 1.0;
}

/* All cubes in one place, where they press the pointer towards +x: only their number counts. */
static void put_body(hapi_model_body *body, hapi_model_contact *contact, uint32_t index)
{
  memset(body, 0, sizeof *body);
  memset(contact, 0, sizeof *contact);
  body->slot = contact->slot = contact->body = index;
  body->generation = contact->generation = contact->pointer_generation = 1;
  body->flags = HAPI_BODY_OWNED | HAPI_BODY_GYROSCOPIC;
  body->mass = mass;
  body->linear_keep = body->angular_keep = 1.0;
  body->max_angular_speed = HUGE_VAL;
  for (int i = 0; i < 3; ++i) {
    body->inertia[4 * i] = mass * 4.0 * half_edge * half_edge / 6.0;
    body->inverse_inertia[4 * i] = 1.0 / body->inertia[4 * i];
  }
  body->pose.quat_wxyz[0] = 1.0;
  body->pose.position[0] = -(radius - depth + half_edge);
  body->user_wrench[0] = stiffness * depth;
  body->twist.angular[0] = 1.0; /* about the contact's normal: it stays so */
  contact->point_body[0] = half_edge;
  contact->normal_body[0] = 1.0;
}

static bool open_bed(guard_bed *g, uint32_t count)
{
  memset(g, 0, sizeof *g);
  if (!allocate(g, count)) {
    return false;
  }
  hapi_tick_reset(&g->tick);
  hapi_black_box_reset(&g->box);
  put_pointer(&g->tick.pointers[0]);
  hapi_model *message = hapi_exchange_model_back(g->exchange);
  hapi_patches *patches = hapi_exchange_patches_back(g->exchange);
  message->number = patches->model_number = 1;
  message->model = HAP_MODEL_CONTACT;
  message->body_count = message->contact_count = count;
  patches->contact_count = 0;
  for (uint32_t i = 0; i < count; ++i) {
    put_body(&hapi_model_bodies(message)[i], &hapi_model_contacts(message)[i], i);
  }
  hapi_tick_adopt(&g->tick, message, 0);
  hapi_tick_adopt_patches(&g->tick, patches);
  return true;
}

/* ns a tick, of the guard alone. */
static void measure(guard_bed *g, int runs, uint32_t ticks, double *out_ns)
{
  double values[RUNS];
  for (int warm = 0; warm < 2000; ++warm) {
    hapi_tick_run(&g->tick, g->tick.now_ns + TICK_NS);
  }
  for (int i = 0; i < runs; ++i) {
    int64_t begin_ns = hapi_clock_now();
    for (uint32_t k = 0; k < ticks; ++k) {
      hapi_guard(&g->tick);
      hapi_black_box_record(&g->box, &g->tick);
    }
    values[i] = (double)(hapi_clock_now() - begin_ns) / ticks;
  }
  *out_ns = bench_median(values, (size_t)runs);
}

hap_status bench_tick_guard(bench *b, FILE *csv)
{
  static const uint32_t sizes[] = {1, 8, 64};
  for (int i = 0; i < 3; ++i) {
    guard_bed g;
    double ns = 0.0;
    bool opened = open_bed(&g, sizes[i]);
    if (opened) {
      measure(&g, b->quick ? RUNS_QUICK : RUNS, 4000u / (sizes[i] + 4u), &ns);
    }
    bool works = opened && g.tick.pushing == sizes[i] && g.tick.guard.energy_ticks == 0 &&
                 g.tick.fault == HAP_FAULT_NONE && g.tick.guard.stored_max > 0.0;
    close_bed(&g);
    if (!works) {
      return bench_fail(b, opened ? HAP_ERROR_STATE : HAP_ERROR_MEMORY,
                        "guard, %u bodies: not as it should be", sizes[i]);
    }
    fprintf(csv, "guard,%u,%u,%.1f,%.2f," TICK_CONTACT_EMPTY "\n", sizes[i], sizes[i], ns,
            ns / sizes[i]);
    const char *text = "guard and black box, one pointer, %u bodies: %.1f ns a tick%s";
    if (sizes[i] == 1) {
      bench_check(b, ns <= BOUND_NS, text, sizes[i], ns, " (bound 100)");
    } else {
      bench_say(text, sizes[i], ns, "");
    }
  }
  return HAP_OK;
}
