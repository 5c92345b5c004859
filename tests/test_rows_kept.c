/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Rows of contacts whose bodies hardly move are kept from tick to tick. What they ask for must be
 * what the poses of the tick say, by closed form, and whatever else rows depend on makes them
 * anew. */

#include <string.h>

#include "local/body_stay.h"
#include "tests/tick_world.h"

#define OPEN 5e-4 /* m, of the corners over the floor at the begin */
#define MASS 0.5

static const double corner[3] = {0.1, 0.08, -0.05}; /* half edges */

static hapi_model_body *box_of(uint32_t slot, double mass)
{
  hapi_model_body *body = add_body(slot);
  body->flags = HAPI_BODY_OWNED;
  body->mass = mass;
  for (int i = 0; i < 3; ++i) {
    body->inertia[4 * i] = 0.004 * mass;
    body->inverse_inertia[4 * i] = 1.0 / body->inertia[4 * i];
  }
  body->linear_keep = body->angular_keep = 1.0;
  body->max_angular_speed = HUGE_VAL;
  body->pose.position[2] = OPEN - corner[2];
  return body;
}

/* The only body, so far. */
static hapi_model_body *box_add(double mass)
{
  f.model->model = HAP_MODEL_CONTACT;
  begin_model();
  return box_of(0, mass);
}

/* The four lower corners of the box on the floor, whose face is fixed. The message is written where
 * the one before was, as by a contact thread that has it back. */
static void patches_fill(hapi_patches *patches, double mu, uint64_t first_number)
{
  patches->contact_count = 4;
  patches->surface_count = 1;
  patches->tool_count = 0;
  patches->model_number = f.model->number;
  for (int i = 0; i < 4; ++i) {
    hapi_patch_contact *c = &hapi_patches_contacts(patches)[i];
    memset(c, 0, sizeof *c);
    c->key = 1;
    c->number = first_number > 0 ? first_number + (uint64_t)i : 0;
    c->generation_a = 1;
    c->body_b = HAPI_SLOT_NONE;
    c->touch = HAPI_TOUCH_FACE_B;
    hapi_v3_set(c->core_a, (i & 1 ? 1.0 : -1.0) * corner[0], (i & 2 ? 1.0 : -1.0) * corner[1],
                corner[2]);
    hapi_v3_set(c->core_b, c->core_a[0], c->core_a[1], 0.0);
    hapi_v3_set(c->normal, 0.0, 0.0, 1.0);
  }
  hapi_surface *s = hapi_patches_surfaces(patches);
  *s = (hapi_surface){.flags = HAPI_SURFACE_APPROX1_1 | HAPI_SURFACE_APPROX1_2,
                      .mu = mu,
                      .mu2 = mu,
                      .erp = 0.2,
                      .max_push = HUGE_VAL};
}

static double ball;    /* m, radius of the box's corners */
static bool swapped;   /* the box is the second body of its contacts, the floor the first */
static bool on_box;    /* points of the floor on the face of the box */
static bool on_second; /* the floor is the second box's upper face */

static void contact_swap(hapi_patch_contact *io)
{
  const hapi_patch_contact was = *io;
  io->body_a = was.body_b;
  io->body_b = was.body_a;
  io->generation_a = was.generation_b;
  io->generation_b = was.generation_a;
  io->touch = HAPI_TOUCH_FACE_A;
  hapi_v3_copy(was.core_b, io->core_a);
  hapi_v3_copy(was.core_a, io->core_b);
  hapi_v3_scale(-1.0, was.normal, io->normal);
}

static void contacts_adopt(double mu, uint64_t first_number)
{
  hapi_patches *patches = hapi_exchange_patches_back(f.exchange);
  patches->contents = 0;
  patches_fill(patches, mu, first_number);
  for (uint32_t i = 0; i < patches->contact_count; ++i) {
    hapi_patch_contact *c = &hapi_patches_contacts(patches)[i];
    c->ball_a = ball;
    c->touch = on_box ? HAPI_TOUCH_FACE_A : c->touch;
    if (on_second) {
      c->body_b = 1;
      c->generation_b = 1;
      c->core_b[2] = -corner[2];
    }
    if (swapped) {
      contact_swap(c);
    }
  }
  hapi_tick_adopt_patches(&f.tick, patches);
}

/* New contacts, whatever was before. */
static void floor_adopt(double mu)
{
  contacts_adopt(mu, 0);
}

/* Height of a corner of the box, of a unit quaternion: the third row of its matrix. */
static double corner_height(const hap_pose *pose, int i)
{
  const double *q = pose->quat_wxyz;
  double x = (i & 1 ? 1.0 : -1.0) * corner[0];
  double y = (i & 2 ? 1.0 : -1.0) * corner[1];
  return pose->position[2] + 2.0 * (q[1] * q[3] - q[0] * q[2]) * x +
         2.0 * (q[2] * q[3] + q[0] * q[1]) * y +
         (1.0 - 2.0 * (q[1] * q[1] + q[2] * q[2])) * corner[2];
}

typedef struct follow_result {
  double error; /* m, the largest by which a gap counts as wider */
  double least; /* m, the same, the smallest */
  int kept;     /* ticks in which the rows were those of the tick before */
  int anew;
} follow_result;

/* Free of forces over the floor: an open row asks for -gap / T, whatever the others ask for. */
static follow_result gap_follow(const double twist[6], double drift, int ticks)
{
  follow_result r = {0.0, 0.0, 0, 0};
  set_up();
  f.tick.hashing = false;
  hapi_model_body *body = box_add(MASS);
  hapi_v3_copy(twist, body->twist.linear);
  hapi_v3_copy(twist + 3, body->twist.angular);
  f.model->force_drift = drift;
  model_adopt();
  floor_adopt(0.5);
  for (int k = 0; k < ticks; ++k) {
    const hap_pose before = f.bodies[0].pose;
    ticks_run(1);
    REQUIRE(f.tick.rows.solver.row_count == 12);
    for (int i = 0; i < 4; ++i) {
      double wider = -T * f.rows[3 * i].target - (corner_height(&before, i) - ball);
      r.error = fmax(r.error, wider);
      r.least = fmin(r.least, wider);
    }
    bool kept = f.tick.rows.kept == f.tick.rows.solver.row_count;
    r.kept += kept;
    r.anew += !kept;
  }
  return r;
}

TEST(gaps_follow_bodies_that_tilt_and_creep)
{
  static const struct {
    double drift; /* of hapi_rows */
    double error; /* m */
    double twist[6];
  } ways[] = {
      {0.0, 3e-9, {0.0, 0.0, 1e-7, 0.0, 0.0, 0.0}},         /* creeps upwards */
      {0.0, 3e-9, {0.0, 0.0, 0.0, 1e-3, 0.0, 0.0}},         /* tilts: 1e-6 rad a tick */
      {0.0, 3e-9, {0.0, 0.0, 0.0, 0.0, 2e-3, 5e-4}},        /* and spins */
      {0.0, 3e-9, {5e-5, -3e-5, 8e-5, 7e-4, -5e-4, 1e-3}},  /* all of them */
      {0.0, 3e-9, {1e-4, 0.0, 0.0, 0.0, 1e-4 / 0.05, 0.0}}, /* rolls over its lower edge */
      {0.03, 3e-9, {0.0, 0.0, 1e-7, 0.0, 0.0, 0.0}},
      {0.03, 1e-8, {0.0, 0.0, 0.0, 1e-2, 0.0, 0.0}}, /* ten times as fast */
      {0.03, 1e-8, {5e-4, -3e-4, 0.0, 5e-3, -4e-3, 1e-2}},
      {0.03, 1e-8, {3e-4, 0.0, 0.0, 0.0, 3e-4 / 0.05, 0.0}},
  };
  for (size_t n = 0; n < 2 * sizeof ways / sizeof ways[0]; ++n) {
    size_t i = n / 2;
    swapped = n % 2 != 0;
    follow_result r = gap_follow(ways[i].twist, ways[i].drift, 600);
    bool creeps = ways[i].twist[3] == 0.0 && ways[i].twist[4] == 0.0;
    printf("# %zu: wider by %.2g to %.2g m; rows kept in %d ticks, made in %d\n", i, r.least,
           r.error, r.kept, r.anew);
    CHECK(r.error < ways[i].error);
    CHECK(r.least >
          (ways[i].drift == 0.0 ? -1e-15 : -1e-8)); /* so that what rests stays in touch */
    CHECK(r.kept > 400);
    CHECK(creeps || r.anew > 10);
  }
  swapped = false;
}

/* ---- an edge that slides on the border of a face ---- */

#define BORDER_WAY 0.002 /* m, from the corner of the box to the border, along x */

/* One contact: where the edge of the box that rises from its first corner along x is over the
 * border of the floor, which ends there. */
static void edge_adopt(const double edge[3])
{
  hapi_patches *patches = hapi_exchange_patches_back(f.exchange);
  patches->contents = 0;
  patches_fill(patches, 0.5, 0);
  patches->contact_count = 1;
  hapi_patch_contact *c = &hapi_patches_contacts(patches)[0];
  c->slide = HAPI_SLIDE_EDGE;
  hapi_v3_copy(edge, c->edge_a);
  hapi_v3_set(c->edge_b, 1.0, 0.0, 0.0);
  hapi_v3_set(c->core_b, c->core_a[0] + BORDER_WAY, c->core_a[1], 0.0);
  hapi_tick_adopt_patches(&f.tick, patches);
}

/* m, of the edge over the floor where it crosses the border: a line and a plane. */
static double edge_height(const hap_pose *pose, const double edge[3])
{
  double point[3];
  double along[3];
  double first[3] = {-corner[0], -corner[1], corner[2]};
  hapi_quat_rotate(pose->quat_wxyz, first, point);
  hapi_quat_rotate(pose->quat_wxyz, edge, along);
  hapi_v3_add(point, pose->position, point);
  return point[2] + along[2] / along[0] * (first[0] + BORDER_WAY - point[0]);
}

/* Without the slope the gap would be off by a tenth of the way that rows are kept for: 3 um. */
TEST(gaps_follow_an_edge_that_slides_over_a_border)
{
  static const double twists[][6] = {{1e-3, 0.0, 0.0, 0.0, 0.0, 0.0},
                                     {-7e-4, 3e-4, 1e-5, 1e-3, 0.0, 2e-3},
                                     {5e-4, 0.0, 0.0, -2e-3, 3e-3, 5e-3}};
  static const double slopes[] = {0.15, -0.1, 1e-3};
  for (size_t i = 0; i < sizeof twists / sizeof twists[0]; ++i) {
    double edge[3] = {cos(slopes[i]), 0.0, sin(slopes[i])};
    double was[6] = {0.0};
    double error = 0.0;
    int kept = 0;
    set_up();
    f.tick.hashing = false;
    hapi_model_body *body = box_add(MASS);
    memcpy(&body->twist, twists[i], sizeof body->twist);
    f.model->force_drift = 0.03;
    model_adopt();
    edge_adopt(edge);
    for (int k = 0; k < 500; ++k) {
      const hap_pose before = f.bodies[0].pose;
      ticks_run(1);
      REQUIRE(f.tick.rows.solver.row_count == 3);
      error = fmax(error, fabs(-T * f.rows[0].target - edge_height(&before, edge)));
      kept += memcmp(was, f.rows[0].ja, sizeof was) == 0;
      memcpy(was, f.rows[0].ja, sizeof was);
    }
    CHECK_SAY(error < 2e-8, "%zu: %g m", i, error);
    CHECK_SAY(kept > 400 && kept < 499, "%zu: %d", i, kept);
  }
}

TEST(a_body_that_goes_far_in_a_tick_is_placed_in_each)
{
  static const double twist[6] = {0.0, 0.0, 1e-3, 0.0, 0.02, 0.0};
  static const double fast[6] = {0.0, 0.0, 0.0, 0.0, 0.0, 0.31};
  follow_result r = gap_follow(twist, 0.0, 100);
  CHECK(r.kept == 0);
  CHECK(r.error < 1e-15 && r.least > -1e-15);
  r = gap_follow(fast, 0.03, 100);
  CHECK(r.kept == 0);
  CHECK(r.error < 1e-15 && r.least > -1e-15);
}

/* m, of a contact of the box that is flat. */
static double flat_way(void)
{
  double radius = hapi_v3_norm(corner) / sqrt(3.0); /* of a box, by its half edges */
  return fmax(HAPI_STAY_WAY, fmin(HAPI_STAY_FLAT_SHARE * radius, HAPI_STAY_FLAT_WAY));
}

/* Ticks with rows made anew, of so many: the first, and each in which the way is past the most. */
static int anew_expected(double way, double speed, int ticks)
{
  int each = (int)(way / (T * speed)) + 1;
  return (ticks + each - 1) / each;
}

/* A corner goes on flat ground as far as it likes, a point of the ground on the box past 1e-4 m, or
 * what is 4e-3 of the body's radius of gyration, and a round corner past 3e-5 m. */
TEST(what_is_flat_goes_farther_than_what_is_curved)
{
  static const double twist[6] = {4.5e-3, 0.0, 0.0, 0.0, 0.0, 0.0};
  static const double fast[6] = {0.3, -0.4, 0.0, 0.0, 0.0, 0.0};
  follow_result r = gap_follow(twist, 0.03, 600);
  CHECK_SAY(r.anew == 1, "%d", r.anew);
  r = gap_follow(fast, 0.03, 600);
  CHECK_SAY(r.anew == 1, "%d", r.anew);
  CHECK_SAY(r.error < 3e-9 && r.least > -1e-15, "%g %g", r.error, r.least);
  for (int round = 0; round < 2; ++round) {
    on_box = round == 0;
    ball = on_box ? 0.0 : 0.5 * OPEN;
    int anew = anew_expected(on_box ? flat_way() : HAPI_STAY_WAY, twist[0], 600);
    r = gap_follow(twist, 0.03, 600);
    CHECK_SAY(r.anew == anew, "%d of %d", r.anew, anew);
    CHECK_SAY(r.error < 3e-9 && r.least > -1e-15, "%g %g", r.error, r.least);
  }
  on_box = false;
  ball = 0.0;
}

/* Ticks with rows made anew, of a box over another one that also goes. */
static int anew_on_second(const double twist[6], const double second[6], int ticks)
{
  int anew = 0;
  set_up();
  f.tick.hashing = false;
  hapi_model_body *upper = box_add(MASS);
  memcpy(&upper->twist, twist, sizeof upper->twist);
  hapi_model_body *lower = box_of(1, MASS);
  lower->pose.position[2] = corner[2];
  memcpy(&lower->twist, second, sizeof lower->twist);
  f.model->force_drift = 0.03;
  on_second = true;
  model_adopt();
  floor_adopt(0.5);
  for (int k = 0; k < ticks; ++k) {
    double open = f.bodies[0].pose.position[2] - f.bodies[1].pose.position[2] + 2.0 * corner[2];
    ticks_run(1);
    REQUIRE(f.tick.rows.solver.row_count == 12);
    CHECK_NEAR(-T * f.rows[0].target, open, 3e-9);
    anew += f.tick.rows.kept != f.tick.rows.solver.row_count;
  }
  on_second = false;
  return anew;
}

/* As bricks that a hand shoves: the way counts between the two. */
TEST(bodies_that_go_together_keep_their_rows)
{
  static const double fast[6] = {0.3, -0.4, 0.2, 0.0, 0.0, 0.0};
  double slips[6] = {fast[0], fast[1] + 4.5e-3, fast[2], 0.0, 0.0, 0.0};
  double closes[6] = {fast[0], fast[1], fast[2] - 4.5e-4, 0.0, 0.0, 0.0};
  double turns[6] = {fast[0], fast[1], fast[2], 0.0, 0.0, 0.01};
  CHECK(anew_on_second(fast, fast, 600) == 1);
  int anew = anew_on_second(slips, fast, 600);
  CHECK_SAY(anew == anew_expected(flat_way(), 4.5e-3, 600), "%d", anew);
  CHECK(anew_on_second(fast, slips, 600) == anew);
  anew = anew_on_second(closes, fast, 600);
  CHECK_SAY(anew == anew_expected(flat_way(), 4.5e-4, 600), "%d", anew);
  anew = anew_on_second(turns, fast, 600);
  CHECK_SAY(anew > 20, "%d", anew);
}

TEST(the_way_goes_by_the_size_of_the_body)
{
  CHECK(hapi_stay_flat_way(0.0) == HAPI_STAY_WAY); /* not known */
  CHECK(hapi_stay_flat_way(1e-3) == HAPI_STAY_WAY);
  CHECK_NEAR(hapi_stay_flat_way(0.015), 1.2e-4, 1e-18);
  CHECK(hapi_stay_flat_way(10.0) == HAPI_STAY_FLAT_WAY);
}

/* What is slow, and may come to rest, keeps to the short way. */
TEST(a_slow_body_is_placed_as_often_as_at_accuracy_1)
{
  static const double slow[6] = {0.0, 0.0, 0.0, 0.0, 0.0, 0.9 * HAPI_STAY_SPIN};
  static const double not_slow[6] = {0.0, 0.0, 0.0, 0.0, 0.0, 1.1 * HAPI_STAY_SPIN};
  follow_result r = gap_follow(slow, 0.03, 1000);
  follow_result exact = gap_follow(slow, 0.0, 1000);
  CHECK_SAY(r.anew == exact.anew && r.anew > 8, "%d and %d", r.anew, exact.anew);
  r = gap_follow(not_slow, 0.03, 1000);
  CHECK_SAY(r.anew == 1, "%d", r.anew); /* the first tick */
  static const double slips[6] = {0.8 * HAPI_STAY_SPEED, 0.0, 0.0, 0.0, 0.0, 0.0};
  on_box = true;
  r = gap_follow(slips, 0.03, 1000);
  CHECK_SAY(r.anew == anew_expected(HAPI_STAY_SLOW_WAY, slips[0], 1000), "%d", r.anew);
  on_box = false;
}

/* A box of edges a, b, c: the mean square of the distance from its centre is
 * (a^2 + b^2 + c^2) / 12, however it has turned. */
TEST(large_bodies_turn_less_before_they_are_placed_anew)
{
  static const double edges[][3] = {{0.03, 0.05, 0.2}, {0.4, 1.0, 3.0}, {20.0, 30.0, 60.0}};
  const double q[4] = {0.5, -0.1, 0.7, 0.5};
  for (size_t i = 0; i < sizeof edges / sizeof edges[0]; ++i) {
    const double *e = edges[i];
    double axes[9];
    hapi_local_body body = {.inverse_mass = 1.0 / 7.0};
    hapi_quat_to_matrix(q, axes);
    for (int k = 0; k < 9; ++k) {
      for (int n = 0; n < 3; ++n) {
        double along =
            7.0 / 12.0 * (e[(n + 1) % 3] * e[(n + 1) % 3] + e[(n + 2) % 3] * e[(n + 2) % 3]);
        body.inverse_inertia[k] += axes[3 * (k / 3) + n] * axes[3 * (k % 3) + n] / along;
      }
    }
    double radius = sqrt((e[0] * e[0] + e[1] * e[1] + e[2] * e[2]) / 12.0);
    double turn = sqrt(2.0 * HAPI_STAY_BEND / radius);
    turn = fmax(HAPI_STAY_SLOW_TURN, fmin(turn, HAPI_STAY_TURN));
    CHECK_NEAR(hapi_stay_radius(&body), radius, 1e-9 * radius);
    CHECK_NEAR(hapi_stay_turn(radius), turn, 1e-9 * turn);
  }
  hapi_local_body none = {.inverse_mass = 0.0};
  CHECK(hapi_stay_radius(&none) == 0.0);
  CHECK(hapi_stay_turn(0.0) == HAPI_STAY_SLOW_TURN);
}

/* At rest on the floor, pressed by its weight. */
static void box_rest(void)
{
  set_up();
  f.tick.hashing = false;
  hapi_model_body *body = box_add(MASS);
  body->pose.position[2] = -corner[2];
  body->gravity[2] = -9.81;
  model_adopt();
  floor_adopt(0.5);
  ticks_run(20);
}

static double load_on_floor(void)
{
  double sum = 0.0;
  for (int i = 0; i < 4; ++i) {
    sum += f.rows[3 * i].impulse / T;
  }
  return sum;
}

/* As fast as a hand may shove it. Each tick takes mu g T of its speed, and its rows are those of
 * the first tick. */
TEST(a_box_that_slides_on_the_floor_is_slowed_by_friction_and_keeps_its_rows)
{
  const double mu = 0.5;
  const double speed = 3.0;
  const int ticks = 500;
  double way = 0.0;
  set_up();
  f.tick.hashing = false;
  hapi_model_body *body = box_add(MASS);
  body->pose.position[2] = -corner[2];
  body->gravity[2] = -9.81;
  body->twist.linear[0] = speed;
  f.model->force_drift = 0.03;
  model_adopt();
  floor_adopt(mu);
  for (int k = 1; k <= ticks; ++k) {
    ticks_run(1);
    way += T * (speed - k * mu * 9.81 * T);
    CHECK(k == 1 || f.tick.rows.kept == f.tick.rows.solver.row_count);
  }
  const double *at = f.bodies[0].pose.position;
  CHECK_NEAR(at[0], way, 1e-6);
  CHECK_NEAR(at[1], 0.0, 1e-9);
  CHECK_NEAR(at[2], -corner[2], 1e-8);
  CHECK_NEAR(load_on_floor(), 9.81 * MASS, 1e-6);
}

TEST(another_mass_or_friction_makes_rows_anew)
{
  box_rest();
  CHECK_NEAR(load_on_floor(), 9.81 * MASS, 1e-6);
  CHECK_NEAR(f.rows[0].ba[2], 1.0 / MASS, 1e-12);
  CHECK_NEAR(f.rows[1].mu, 0.5, 0.0);
  box_add(2.0 * MASS)->gravity[2] = -9.81;
  model_adopt();
  ticks_run(1);
  CHECK_NEAR(f.rows[0].ba[2], 0.5 / MASS, 1e-12);
  ticks_run(20);
  CHECK_NEAR(load_on_floor(), 9.81 * 2.0 * MASS, 1e-6);
  floor_adopt(0.2);
  ticks_run(1);
  CHECK_NEAR(f.rows[1].mu, 0.2, 0.0);
}

TEST(the_same_contact_with_another_friction_has_rows_anew)
{
  box_rest();
  contacts_adopt(0.5, 7);
  ticks_run(2);
  const uint64_t made = f.rows[0].made;
  contacts_adopt(0.5, 7);
  ticks_run(2);
  CHECK(f.rows[0].made == made); /* the rows went on */
  contacts_adopt(0.2, 7);
  ticks_run(1);
  CHECK(f.rows[0].made != made);
  CHECK_NEAR(f.rows[1].mu, 0.2, 0.0);
  CHECK_NEAR(load_on_floor(), 9.81 * MASS, 1e-6); /* from the impulses that it had */
}

/* The rows of pointers come first: contacts move up and down the list as a pointer comes and
 * goes. */
TEST(rows_of_a_pointer_move_the_kept_ones)
{
  box_rest();
  f.tick.bodies.never_still = true; /* it has rows throughout */
  hapi_pointer *p = add_pointer(0, -corner[0] - 0.0095, 0.0, -corner[2]);
  for (int k = 0; k < 40; ++k) {
    bool touches = k % 8 < 4;
    box_add(MASS)->gravity[2] = -9.81;
    if (touches) {
      hapi_v3_set(add_contact(0, 0, 0)->point_body, -corner[0], 0.0, 0.0);
    }
    model_adopt();
    ticks_run(3);
    uint32_t first = f.tick.rows.solver.row_count - 12;
    double sum = 0.0;
    CHECK((first > 0) == touches);
    for (uint32_t i = first; i < first + 12; i += 3) {
      sum += f.rows[i].impulse / T;
      CHECK(f.rows[i + 1].normal == (int32_t)i && f.rows[i + 2].normal == (int32_t)i);
    }
    CHECK_NEAR(sum, 9.81 * MASS, 1e-2);
  }
  CHECK(p->generation != 0 && f.tick.guard.latch.fault == HAP_FAULT_NONE);
}

/* A pointer's row is written over the first one of the first contact. That contact has rows made
 * anew, and the others go up by one. */
TEST(a_row_that_comes_first_leaves_the_others_kept)
{
  box_rest();
  add_pointer(0, -corner[0] - 0.0095, 0.0, -corner[2]);
  box_add(MASS)->gravity[2] = -9.81;
  hapi_v3_set(add_contact(0, 0, 0)->point_body, -corner[0], 0.0, 0.0);
  model_adopt();
  for (int k = 0; k < 5 && f.tick.rows.solver.row_count == 12; ++k) {
    ticks_run(1);
  }
  CHECK(f.tick.rows.solver.row_count == 13 && f.sources[0].pointer);
  CHECK_SAY(f.tick.rows.kept == 9, "%u", f.tick.rows.kept);
}

/* Each row is that of its corner: of a force f on it the moment is corner x f. */
static void rows_check(uint32_t first, int which)
{
  double place[3];
  double moment[3];
  hapi_v3_set(place, (which & 1 ? 1.0 : -1.0) * corner[0], (which & 2 ? 1.0 : -1.0) * corner[1],
              corner[2]);
  CHECK(f.rows[first + 1].normal == (int32_t)first && f.rows[first + 2].normal == (int32_t)first);
  for (uint32_t i = first; i < first + 3; ++i) {
    hapi_v3_cross(place, f.rows[i].ja, moment);
    CHECK(f.sources[i].part == i - first);
    CHECK_NEAR(hapi_v3_norm(f.rows[i].ja), 1.0, 1e-12);
    for (int k = 0; k < 3; ++k) {
      CHECK_NEAR(f.rows[i].ja[3 + k], moment[k], 1e-6);
    }
  }
}

/* The message has so many new contacts behind the second corner: of other geoms, at the third. */
static void corners_adopt(uint32_t more)
{
  hapi_patches *patches = hapi_exchange_patches_back(f.exchange);
  patches->contents = 0;
  patches_fill(patches, 0.5, 1);
  hapi_patch_contact *c = hapi_patches_contacts(patches);
  memmove(&c[2 + more], &c[2], 2 * sizeof *c);
  for (uint32_t i = 0; i < more; ++i) {
    c[2 + i] = c[2 + more];
    c[2 + i].key = 2 + i;
    c[2 + i].number = 5 + i;
  }
  patches->contact_count = 4 + more;
  hapi_tick_adopt_patches(&f.tick, patches);
}

TEST(contacts_that_come_between_leave_the_others_kept)
{
  for (uint32_t more = 1; more <= 5; ++more) {
    box_rest();
    corners_adopt(0);
    ticks_run(3);
    REQUIRE(f.tick.rows.kept == 12);
    uint64_t made = f.rows[6].made;
    corners_adopt(more);
    ticks_run(1);
    REQUIRE(f.tick.rows.solver.row_count == 12 + 3 * more);
    CHECK_SAY(f.tick.rows.kept == 12, "%u: %u", more, f.tick.rows.kept);
    CHECK(f.rows[6 + 3 * more].made == made);
    for (uint32_t i = 0; i < 4 + more; ++i) {
      rows_check(3 * i, i < 2 ? (int)i : i < 2 + more ? 2 : (int)(i - more));
    }
    double load = 0.0;
    for (uint32_t i = 0; i < 4 + more; ++i) {
      load += f.tick.contacts.memory[i].impulse[0] / T;
    }
    CHECK_NEAR(load, 9.81 * MASS, 1e-5);
    ticks_run(1);
    CHECK(f.tick.rows.kept == 12 + 3 * more);
  }
}

/* So that what opens and closes does not move the rows of others in each tick. */
TEST(a_contact_keeps_its_rows_for_longer_than_it_waits_for_them)
{
  for (int comes = 0; comes < 2; ++comes) {
    set_up();
    f.tick.hashing = false;
    hapi_model_body *body = box_add(MASS);
    body->pose.position[2] = (comes ? 2.5e-3 : OPEN) - corner[2];
    body->twist.linear[2] = comes ? -0.05 : 0.05;
    model_adopt();
    floor_adopt(0.5);
    ticks_run(20); /* 1.5 mm open */
    CHECK(f.tick.rows.solver.row_count == (comes ? 0 : 12));
    CHECK(f.tick.rows.kept == (comes ? 0 : 12));
    ticks_run(20);
    CHECK(f.tick.rows.solver.row_count == (comes ? 12 : 0));
  }
}

/* A pointer that is in touch at the tick's end, and not at its middle, begins a row and takes it
 * back, where contacts had theirs. */
TEST(a_pointer_that_comes_leaves_the_kept_rows_whole)
{
  const double way = 7e-6; /* m a tick */
  box_rest();
  hapi_pointer *p = add_pointer(0, -corner[0] - 0.01 - 71.7 * way, 0.0, -corner[2]);
  box_add(MASS)->gravity[2] = -9.81;
  hapi_v3_set(add_contact(0, 0, 0)->point_body, -corner[0], 0.0, 0.0);
  model_adopt();
  bool pushed = false;
  for (int k = 0; k < 200; ++k) {
    p->device.pose.position[0] += way;
    p->device.twist.linear[0] = way / T;
    ticks_run(1);
    uint32_t first = f.tick.rows.solver.row_count - 12;
    pushed = pushed || first > 0;
    for (uint32_t i = first; i < first + 12; i += 3) {
      CHECK(!f.sources[i].pointer && f.sources[i].part == 0);
      CHECK_NEAR(f.rows[i].ja[2], 1.0, 1e-3);
      CHECK_NEAR(f.rows[i].ba[2], 1.0 / MASS, 1e-3);
    }
  }
  CHECK(pushed);
}

/* What rests for long stays: errors of the gap do not add up. */
TEST(a_box_at_rest_does_not_creep_in_30_s)
{
  box_rest();
  hap_pose before = f.bodies[0].pose;
  ticks_run(30000);
  double way[3];
  hapi_v3_sub(f.bodies[0].pose.position, before.position, way);
  printf("# %.2g m\n", hapi_v3_norm(way));
  CHECK(hapi_v3_norm(way) < 1e-6);
  CHECK_NEAR(load_on_floor(), 9.81 * MASS, 1e-6);
}

/* N m: the box rests, rocks from edge to edge, and rests again. */
static double sway_of(int k)
{
  return k % 1000 < 500 ? 0.0 : 0.45 * sin(0.02 * k);
}

typedef struct sway_tick {
  hap_pose pose;
  double impulse[4][3];
  uint32_t rows;
  uint32_t kept;
} sway_tick;

/* looks: all contacts, as no run is left of the tick before. Returns ticks that began with one. */
static int sway_run(bool looks, sway_tick *out, int ticks)
{
  int with_run = 0;
  box_rest();
  f.bodies[0].pose.position[2] -= 5e-7; /* as deep as bodies rest in the world */
  for (int k = 0; k < ticks; ++k) {
    uint8_t *lengths = f.tick.contacts.run_lengths;
    f.bodies[0].forced = true;
    f.bodies[0].given.user_wrench[3] = sway_of(k);
    with_run += lengths[0] > 1 || lengths[1] > 1 || lengths[2] > 1;
    if (looks) {
      memset(lengths, 0, 4);
    }
    if (k % 5 == 0) {
      contacts_adopt(0.5, k % 100 == 0 ? 1 + (uint64_t)k : 1 + (uint64_t)(k - k % 100));
    }
    ticks_run(1);
    memset(&out[k], 0, sizeof out[k]);
    out[k].pose = f.bodies[0].pose;
    out[k].rows = f.tick.rows.solver.row_count;
    out[k].kept = f.tick.rows.kept;
    for (int i = 0; i < 4; ++i) {
      memcpy(out[k].impulse[i], f.tick.contacts.memory[i].impulse, sizeof out[k].impulse[i]);
    }
  }
  return with_run;
}

TEST(contacts_that_are_passed_over_would_have_stayed_to_the_last_bit)
{
  enum {
    TICKS = 8000
  };
  static sway_tick passed[2 * TICKS];
  int with_run = sway_run(false, passed, TICKS);
  (void)sway_run(true, passed + TICKS, TICKS);
  CHECK(memcmp(passed, passed + TICKS, TICKS * sizeof *passed) == 0);
  double most = 0.0;
  for (int k = 0; k < TICKS; ++k) {
    most = fmax(most, fabs(passed[k].pose.quat_wxyz[1]));
  }
  tap_say("%d ticks of %d with a run, turned by up to %.3g", with_run, (int)TICKS, 2.0 * most);
  CHECK(with_run > TICKS / 4 && with_run < TICKS - 200);
  CHECK(most > 1e-3);
}

/* The body stops where it is. */
TEST(impulses_that_are_no_numbers_end_with_the_tick_that_had_them)
{
  static const double pushes[] = {NAN, INFINITY, -INFINITY};
  for (int k = 0; k < 3; ++k) {
    box_rest();
    f.bodies[0].pose.position[2] -= 5e-7;
    f.bodies[0].forced = true;
    ticks_run(100);
    REQUIRE(f.tick.contacts.run_lengths[0] == 4);
    f.bodies[0].given.user_wrench[2] = pushes[k];
    ticks_run(1);
    f.bodies[0].given.user_wrench[2] = 0.0;
    ticks_run(100);
    for (int i = 0; i < 4; ++i) {
      CHECK(isfinite(f.tick.contacts.memory[i].impulse[0]));
    }
    CHECK_NEAR(load_on_floor(), 9.81 * MASS, 1e-6);
  }
}
