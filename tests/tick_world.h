/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_TICK_WORLD_H
#define HAPODE_TESTS_TICK_WORLD_H

/* The pure tick with memory of its own, and local models made by hand. */

#include "base/vec.h"
#include "local/contact_run.h"
#include "sync/exchange.h"
#include "tests/tap.h"
#include "tick/report.h"
#include "tick/tick.h"

#define T 1e-3
#define TICK_NS 1000000LL
#define BODIES 8u
#define CONTACTS 16u
#define POINTERS 4u

#define JOINTS 6u
#define CROSSES 6u

#define ROWS (7u * CONTACTS + HAPI_JOINT_ROWS * JOINTS)
#define BUCKETS 32u

static const hapi_capacity capacity = {.bodies = BODIES,
                                       .contacts = CONTACTS,
                                       .pointers = POINTERS,
                                       .geoms = 16,
                                       .hull_points = 64,
                                       .joints = JOINTS,
                                       .crosses = CROSSES};

/* A tick with its memory, and a message to fill in. */
static struct {
  hapi_tick tick;
  hapi_local_body bodies[BODIES];
  hapi_body_course courses[BODIES];
  uint32_t live[BODIES];
  hapi_local_contact contacts[CONTACTS];
  hapi_kept_touch kept[CONTACTS];
  hapi_friction frictions[CONTACTS];
  hapi_pointer pointers[POINTERS];
  hapi_model_cross crosses[CROSSES];
  hapi_contact_memory memory[2][CONTACTS];
  hapi_contact_run runs[CONTACTS];
  uint8_t run_lengths[CONTACTS];
  uint32_t buckets[BUCKETS];
  hapi_model_joint joints[JOINTS];
  hapi_joint_memory joint_memory[JOINTS];
  hapi_row_source sources[ROWS];
  hapi_row rows[ROWS];
  double v[BODIES + POINTERS + 1][6];
  double free_v[BODIES + POINTERS + 1][6];
  double work[HAPI_SOLVER_WORK(ROWS, BODIES + POINTERS + 1)];
  hapi_exchange *exchange;
  hapi_model *model;
  int64_t now_ns;
} f;

static inline void set_up_rows(void)
{
  hapi_solver *solver = &f.tick.rows.solver;
  f.tick.rows.sources = f.sources;
  f.tick.rows.capacity = ROWS;
  solver->rows = f.rows;
  solver->v = f.v;
  solver->free = f.free_v;
  solver->work = f.work;
  solver->work_count = sizeof f.work / sizeof f.work[0];
  solver->tolerance = 1e-9;
  solver->update_budget = 100000;
  solver->direct_rows = 64;
}

static inline void tick_world_finish(void)
{
  hapi_exchange_destroy(f.exchange);
}

static inline void set_up(void)
{
  hapi_exchange_destroy(f.exchange);
  tap_at_end(tick_world_finish);
  memset(&f, 0, sizeof f);
  f.tick.capacity = capacity;
  f.tick.facts.period = T;
  f.tick.hashing = true;
  f.tick.guard.mode = HAP_GUARD_MEASURE; /* the tests of the guard switch it on */
  f.tick.bodies.of = f.bodies;
  f.tick.bodies.courses = f.courses;
  f.tick.bodies.live = f.live;
  f.tick.touches.of = f.contacts;
  f.tick.touches.kept = f.kept;
  f.tick.touches.frictions = f.frictions;
  f.tick.pointers.of = f.pointers;
  f.tick.touches.crosses.of = f.crosses;
  f.tick.contacts.memory = f.memory[0];
  f.tick.contacts.old_memory = f.memory[1];
  f.tick.contacts.runs = f.runs;
  f.tick.contacts.run_lengths = f.run_lengths;
  f.tick.contacts.buckets = f.buckets;
  f.tick.contacts.bucket_count = BUCKETS;
  f.tick.joints.of = f.joints;
  f.tick.joints.memory = f.joint_memory;
  set_up_rows();
  hapi_tick_reset(&f.tick);
  if (hapi_exchange_create(&capacity, &f.exchange) != HAP_OK) {
    abort();
  }
  f.model = hapi_exchange_model_back(f.exchange);
  f.model->model = HAP_MODEL_ACCELERANCE;
}

/* Radius 10 mm, 1000 N/m, no limit to speak of, at (x, y, z). */
static inline hapi_pointer *add_pointer(uint32_t index, double x, double y, double z)
{
  hapi_pointer *p = &f.pointers[index];
  memset(p, 0, sizeof *p);
  p->generation = 1;
  p->shape.radius = 0.01;
  p->surface.stiffness = 1000.0;
  p->device.motion_scale = 1.0;
  p->device.force_scale = 1.0;
  p->device.limits.max_force = 1e6;
  p->device.limits.max_torque = 1.0;
  p->device.pose_world_device.quat_wxyz[0] = 1.0;
  p->device.pose.quat_wxyz[0] = 1.0;
  hapi_v3_set(p->device.pose.position, x, y, z);
  return p;
}

static inline void begin_model(void)
{
  f.model->body_count = 0;
  f.model->contact_count = 0;
  f.model->touches = 1; /* a test may give forces by itself: the observer is to see them */
  f.model->joint_count = 0;
  f.model->cross_count = 0;
  ++f.model->number;
  f.model->state_ns = f.now_ns;
}

static inline hapi_model_body *add_body(uint32_t slot)
{
  hapi_model_body *body = &hapi_model_bodies(f.model)[f.model->body_count++];
  memset(body, 0, sizeof *body);
  body->slot = slot;
  body->generation = 1;
  body->pose.quat_wxyz[0] = 1.0;
  return body;
}

/* At point, normal -x: a pointer coming along +x meets it. A of a body that cannot move. */
static inline hapi_model_contact *add_contact(uint32_t slot, uint32_t body, uint32_t pointer)
{
  hapi_model_contact *contact = &hapi_model_contacts(f.model)[f.model->contact_count++];
  memset(contact, 0, sizeof *contact);
  contact->slot = slot;
  contact->generation = 1;
  contact->body = body;
  contact->pointer = pointer;
  contact->pointer_generation = 1;
  contact->normal_body[0] = -1.0;
  return contact;
}

/* Of the newest contact, to x of a body. */
static inline void add_cross(uint32_t body, double along_x)
{
  hapi_model_cross *cross = &hapi_model_crosses(f.model)[f.model->cross_count++];
  memset(cross, 0, sizeof *cross);
  cross->contact = f.model->contact_count - 1;
  cross->body = body;
  cross->a[0][0] = along_x;
}

/* A of a free body with inertia of a ball. */
static inline void set_free(hapi_model_contact *c, double mass, double inertia)
{
  const double *r = c->point_body;
  const double cross[3][3] = {{0.0, -r[2], r[1]}, {r[2], 0.0, -r[0]}, {-r[1], r[0], 0.0}};
  for (int i = 0; i < 3; ++i) {
    c->a[i][i] = 1.0 / mass;
    for (int k = 0; k < 3; ++k) {
      c->a[3 + i][k] = cross[i][k] / inertia;
    }
  }
}

static inline void model_adopt(void)
{
  hapi_tick_adopt(&f.tick, f.model, f.now_ns);
}

static inline void ticks_run(int ticks)
{
  for (int i = 0; i < ticks; ++i) {
    hapi_tick_run(&f.tick, f.now_ns);
    f.now_ns += TICK_NS;
  }
}

static inline hapi_state *tick_report(void)
{
  hapi_state *state = hapi_exchange_state_back(f.exchange);
  hapi_tick_report(&f.tick, state);
  return state;
}

static inline void check_v3(const double v[3], double x, double y, double z, double tolerance)
{
  CHECK_NEAR(v[0], x, tolerance);
  CHECK_NEAR(v[1], y, tolerance);
  CHECK_NEAR(v[2], z, tolerance);
}

/* One pointer at a contact that has been seen apart, so that there is no ramp. */
static inline hapi_pointer *pointer_before_wall(void)
{
  set_up();
  hapi_pointer *p = add_pointer(0, -0.1, 0.0, 0.0);
  begin_model();
  (void)add_contact(0, HAPI_SLOT_NONE, 0);
  model_adopt();
  ticks_run(1);
  return p;
}

#endif
