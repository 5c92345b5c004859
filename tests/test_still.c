/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Islands that stand still: they have no rows, and whatever their rows would depend on wakes them
 * in the tick in which it is another. What is expected is by closed form: the weight that a floor
 * carries, the way of a body that falls. */

#include <string.h>

#include "local/body_still.h"
#include "tests/tick_world.h"
#include "tick/telling.h"

#define MASS 0.5
#define G 9.81
#define HALF 0.05 /* m, edge */
#define SETTLE 300

/* Cubes in a stack, the lowest one on the floor. */
typedef struct stack {
  int bodies;
  int contacts;      /* with the floor; 4: all corners */
  double mass;       /* of each */
  double gravity;    /* m/s^2, downwards */
  double mu;         /* of all surfaces */
  double over_z;     /* m, the height of one more cube that flies; 0: there is none */
  double over_speed; /* m/s, its own, downwards */
  uint64_t first;    /* number of the contacts; 0: they are new in each message */
} stack;

static const stack two = {2, 4, MASS, G, 0.5, 0.0, 0.0, 7};

static hapi_model_body *cube_add(const stack *s, uint32_t slot, double z)
{
  hapi_model_body *body = add_body(slot);
  body->flags = HAPI_BODY_OWNED;
  body->mass = s->mass;
  for (int i = 0; i < 3; ++i) {
    body->inertia[4 * i] = s->mass * 4.0 * HALF * HALF / 6.0;
    body->inverse_inertia[4 * i] = 1.0 / body->inertia[4 * i];
  }
  body->linear_keep = body->angular_keep = 1.0;
  body->max_angular_speed = HUGE_VAL;
  body->pose.position[2] = z;
  body->gravity[2] = -s->gravity;
  return body;
}

static void stack_begin(const stack *s)
{
  f.model->model = HAP_MODEL_CONTACT;
  begin_model();
  for (int i = 0; i < s->bodies; ++i) {
    (void)cube_add(s, (uint32_t)i, HALF + 2.0 * HALF * i);
  }
  if (s->over_z > 0.0) {
    hapi_model_body *over = cube_add(s, (uint32_t)s->bodies, s->over_z);
    over->gravity[2] = 0.0;
    over->twist.linear[2] = -s->over_speed;
  }
}

/* A lower corner of cube a on what is below. */
static void corner_add(hapi_patches *patches, uint32_t a, uint32_t b, int corner, uint64_t number)
{
  hapi_patch_contact *c = &hapi_patches_contacts(patches)[patches->contact_count++];
  memset(c, 0, sizeof *c);
  c->key = 1 + a;
  c->number = number;
  c->body_a = a;
  c->body_b = b;
  c->generation_a = c->generation_b = 1;
  c->touch = HAPI_TOUCH_FACE_B;
  hapi_v3_set(c->core_a, (corner & 1 ? 1.0 : -1.0) * HALF, (corner & 2 ? 1.0 : -1.0) * HALF, -HALF);
  hapi_v3_set(c->core_b, c->core_a[0], c->core_a[1], b == HAPI_SLOT_NONE ? 0.0 : HALF);
  hapi_v3_set(c->normal, 0.0, 0.0, 1.0);
}

static void contacts_adopt(const stack *s)
{
  hapi_patches *patches = hapi_exchange_patches_back(f.exchange);
  int cubes = s->bodies + (s->over_z > 0.0);
  patches->contact_count = 0;
  patches->surface_count = 1;
  patches->tool_count = 0;
  patches->model_number = f.model->number;
  for (int i = 0; i < cubes; ++i) {
    for (int k = 0; k < (i == 0 ? s->contacts : 4); ++k) {
      uint32_t below = i == 0 ? HAPI_SLOT_NONE : (uint32_t)i - 1;
      corner_add(patches, (uint32_t)i, below, k,
                 s->first > 0 ? s->first + (uint64_t)(4 * i + k) : 0);
    }
  }
  *hapi_patches_surfaces(patches) =
      (hapi_surface){.flags = HAPI_SURFACE_APPROX1_1 | HAPI_SURFACE_APPROX1_2,
                     .mu = s->mu,
                     .mu2 = s->mu,
                     .erp = 0.2,
                     .max_push = HUGE_VAL,
                     .layer = 1e-4};
  hapi_tick_adopt_patches(&f.tick, patches);
}

static void stack_rest(const stack *s)
{
  set_up();
  f.tick.hashing = false;
  stack_begin(s);
  model_adopt();
  contacts_adopt(s);
  ticks_run(SETTLE);
  REQUIRE(f.tick.bodies.still == (uint32_t)s->bodies);
  REQUIRE(f.tick.rows.solver.row_count == 0);
}

/* Messages of this stack, which stood still as `two`, and a tick. */
static void stack_change(const stack *s)
{
  stack_begin(s);
  model_adopt();
  contacts_adopt(s);
  ticks_run(1);
}

/* N, of the floor. */
static double load_on_floor(void)
{
  double sum = 0.0;
  for (int i = 0; i < 4; ++i) {
    sum += f.tick.contacts.memory[i].impulse[0] / T;
  }
  return sum;
}

static uint32_t contacts_pushing(void)
{
  uint32_t count = 0;
  for (uint32_t i = 0; i < f.tick.contacts.memory_count; ++i) {
    count += f.tick.contacts.memory[i].impulse[0] > 0.0;
  }
  return count;
}

TEST(what_stands_still_has_no_rows_and_is_carried)
{
  stack_rest(&two);
  const hap_pose before = f.bodies[1].pose;
  const uint32_t active = contacts_pushing();
  CHECK(f.tick.contacts.active == active && active >= 6);
  ticks_run(1000);
  CHECK(f.tick.bodies.still == 2 && f.tick.rows.solver.row_count == 0);
  CHECK(memcmp(&before, &f.bodies[1].pose, sizeof before) == 0);
  CHECK_NEAR(load_on_floor(), 2.0 * MASS * G, 1e-6);
  CHECK(f.tick.contacts.active == active);
  CHECK((f.bodies[0].flags & HAPI_BODY_TOUCHED) != 0);
}

TEST(the_same_messages_again_wake_nothing)
{
  stack_rest(&two);
  for (int k = 0; k < 50; ++k) {
    stack_change(&two);
    CHECK(f.tick.bodies.still == 2 && f.tick.rows.solver.row_count == 0);
  }
}

/* The weight is told as while the island was awake. */
TEST(contacts_are_told_while_they_have_no_rows)
{
  hap_body_contact told[4];
  stack_rest(&two);
  uint32_t count = hapi_telling_contacts(&f.tick, told, 4);
  double sum = 0.0;
  for (uint32_t i = 0; i < count; ++i) {
    sum += told[i].force[2];
    CHECK_NEAR(told[i].normal[2], 1.0, 1e-9);
  }
  CHECK(count > 0);
  CHECK_NEAR(sum, 3.0 * MASS * G, 1e-6); /* one cube on the other, both on the floor */
}

TEST(another_weight_wakes_all_of_the_island)
{
  stack heavy = two;
  stack_rest(&two);
  heavy.gravity = 2.0 * G;
  stack_change(&heavy);
  CHECK(f.tick.bodies.still == 0 && f.tick.rows.solver.row_count == 24);
  ticks_run(30);
  CHECK_NEAR(load_on_floor(), 4.0 * MASS * G, 1e-4);
  heavy.gravity = -G;
  stack_change(&heavy);
  CHECK(f.tick.bodies.still == 0);
  CHECK_NEAR(f.bodies[1].twist.linear[2], G * T, 1e-7);
}

TEST(another_mass_wakes)
{
  stack heavy = two;
  stack_rest(&two);
  heavy.mass = 2.0 * MASS;
  stack_change(&heavy);
  CHECK(f.tick.bodies.still == 0 && f.tick.rows.solver.row_count == 24);
  ticks_run(30);
  CHECK_NEAR(load_on_floor(), 4.0 * MASS * G, 1e-4);
}

TEST(another_friction_wakes)
{
  stack slippery = two;
  stack_rest(&two);
  slippery.mu = 0.1;
  stack_change(&slippery);
  CHECK(f.tick.bodies.still == 0 && f.tick.rows.solver.row_count == 24);
}

/* A floor of which nothing is left; and new contacts in the place of the old ones. */
TEST(contacts_that_go_or_come_wake)
{
  stack changed = two;
  stack_rest(&two);
  changed.first = 100;
  stack_change(&changed);
  CHECK(f.tick.bodies.still == 0 && f.tick.rows.solver.row_count == 24);
  stack_rest(&two);
  changed = two;
  changed.contacts = 0;
  stack_change(&changed);
  CHECK(f.tick.bodies.still == 0);
  CHECK_NEAR(f.bodies[0].twist.linear[2], -G * T, 1e-7);
}

TEST(an_applications_force_wakes)
{
  stack_rest(&two);
  stack_begin(&two);
  hapi_model_bodies(f.model)[1].user_wrench[2] = 2.0 * MASS * G;
  model_adopt();
  ticks_run(1);
  CHECK(f.tick.bodies.still == 0);
  CHECK_NEAR(f.bodies[1].twist.linear[2], G * T, 1e-7);
}

TEST(a_body_that_is_put_elsewhere_or_leaves_wakes_the_rest)
{
  stack_rest(&two);
  stack_begin(&two);
  hapi_model_bodies(f.model)[1].epoch = 1;
  hapi_model_bodies(f.model)[1].pose.position[2] += 0.2;
  model_adopt();
  contacts_adopt(&two);
  ticks_run(1);
  CHECK(f.tick.bodies.still == 0);
  CHECK(f.bodies[1].twist.linear[2] < -0.5 * G * T);
  stack_rest(&two);
  stack one = two;
  one.bodies = 1;
  stack_begin(&one);
  model_adopt(); /* the contacts are those of before */
  ticks_run(1);
  CHECK(f.tick.bodies.still == 0);
  ticks_run(20);
  CHECK_NEAR(load_on_floor(), MASS * G, 1e-4);
}

TEST(a_pointer_wakes_what_it_touches)
{
  stack_rest(&two);
  hapi_pointer *p = add_pointer(0, -HALF - 0.0095, 0.0, 3.0 * HALF);
  stack_begin(&two);
  hapi_v3_set(add_contact(0, 1, 0)->point_body, -HALF, 0.0, 0.0);
  model_adopt();
  ticks_run(3); /* what is deep when it is first seen comes in slowly */
  CHECK(f.tick.bodies.still == 0 && f.tick.rows.solver.row_count == 25);
  CHECK(p->wrench.force[0] < 0.0);
}

/* It flies at 1 m/s on top, and is stopped by the stack, which was awake before: the two above
 * each other end at the velocity of one body, and the floor takes what is left. */
TEST(what_flies_onto_a_stack_wakes_it_before_it_touches)
{
  stack shot = {2, 4, MASS, G, 0.5, 6.0 * HALF, 1.0, 7};
  bool woke = false;
  shot.over_z = 5.0 * HALF + 0.5;
  set_up();
  f.tick.hashing = false;
  stack_begin(&shot);
  model_adopt();
  contacts_adopt(&shot);
  ticks_run(SETTLE);
  REQUIRE(f.tick.bodies.still == 2 && f.tick.rows.solver.row_count == 0);
  for (int k = 0; k < 300; ++k) {
    const double gap = f.bodies[2].pose.position[2] - 5.0 * HALF;
    CHECK(gap > -1e-5);
    ticks_run(1);
    if (!woke && f.tick.bodies.still == 0) {
      woke = true;
      CHECK(gap > 0.0 && gap < 6e-3);
    }
    CHECK(woke || f.tick.rows.solver.row_count == 0);
  }
  CHECK(woke);
  CHECK(fabs(f.bodies[2].twist.linear[2]) < 1e-3);
  ticks_run(300);
  CHECK(f.tick.bodies.still == 3);
}

/* Of two stacks only the one that is pushed has rows. */
TEST(an_island_beside_one_that_moves_stands_still)
{
  stack_rest(&two);
  stack both = two;
  stack_begin(&both);
  hapi_model_body *slides = cube_add(&both, 2, HALF);
  slides->pose.position[0] = 1.0;
  slides->gravity[2] = 0.0;
  slides->twist.linear[0] = 0.1;
  model_adopt();
  contacts_adopt(&both);
  ticks_run(500);
  CHECK(f.tick.bodies.still == 2);
  CHECK(f.bodies[2].pose.position[0] > 1.04);
  CHECK_NEAR(load_on_floor(), 2.0 * MASS * G, 1e-6);
}

/* Balanced on an edge it falls over, however slowly that begins. */
TEST(what_falls_over_is_never_still)
{
  const double tilt = 1e-10;
  stack one = {1, 4, MASS, G, 0.5, 0.0, 0.0, 7};
  set_up();
  f.tick.hashing = false;
  stack_begin(&one);
  hapi_model_body *body = &hapi_model_bodies(f.model)[0];
  double half = 0.5 * (M_PI / 4.0 + tilt);
  body->pose.quat_wxyz[0] = cos(half);
  body->pose.quat_wxyz[2] = sin(half);
  body->pose.position[2] = sqrt(2.0) * HALF;
  model_adopt();
  contacts_adopt(&one);
  for (int k = 0; k < 5000; ++k) {
    ticks_run(1);
    REQUIRE(f.tick.bodies.still == 0);
  }
  CHECK(fabs(f.bodies[0].twist.angular[1]) > 10.0 * HAPI_STILL_SPEED);
}

TEST(the_limits_are_these)
{
  CHECK_NEAR(HAPI_STILL_SPEED, 2e-9, 0.0); /* m/s */
  CHECK_NEAR(HAPI_STILL_TIME, 0.1, 0.0);   /* s */
  CHECK_NEAR(HAPI_STILL_GROWTH, 1.01, 0.0);
}
