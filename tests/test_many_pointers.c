/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Sixteen pointers on one body and on many. */

#include "tests/tap.h"

#include "base/vec.h"
#include "tests/stage.h"

#define HANDS 16
#define EDGE 0.05    /* m, of cubes */
#define RADIUS 0.004 /* m, of pointers */

typedef struct crowd {
  stage s;
  hap_pointer_id hands[HANDS];
  double at[HANDS][3];
  double stiffness[HANDS];
  double damping;
  double speed; /* m/s, along x */
  int count;
} crowd;

/* No body yet. */
static void crowd_init(crowd *c, hap_model model, double gravity)
{
  memset(c, 0, sizeof *c);
  stage_init(&c->s, HAP_DRIVE_LOCKSTEP);
  dGeomDestroy(c->s.geom);
  dBodyDestroy(c->s.cube);
  c->s.cube = NULL;
  c->s.def.model = model;
  c->s.def.max_pointers = HANDS;
  c->count = HANDS;
  dWorldSetGravity(c->s.world, 0.0, 0.0, -gravity);
  for (int i = 0; i < HANDS; ++i) {
    c->stiffness[i] = 1000.0;
  }
}

static dBodyID add_box(crowd *c, const double edges[3], double mass, const double at[3])
{
  dMass m;
  dBodyID body = dBodyCreate(c->s.world);
  dGeomSetBody(dCreateBox(c->s.space, edges[0], edges[1], edges[2]), body);
  dMassSetBoxTotal(&m, mass, edges[0], edges[1], edges[2]);
  dBodySetMass(body, &m);
  dBodySetPosition(body, at[0], at[1], at[2]);
  return body;
}

static void move_hands(crowd *c, double seconds)
{
  for (int i = 0; i < c->count; ++i) {
    const double *at = c->at[i];
    hap_pose pose = {{at[0] + c->speed * seconds, at[1], at[2]}, {1.0, 0.0, 0.0, 0.0}};
    hap_twist twist = {{c->speed, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    CHECK(c->hands[i].v == 0 ||
          hap_pointer_set_target(c->s.session, c->hands[i], &pose, &twist) == HAP_OK);
  }
}

static hap_pointer_id add_hand(crowd *c, int index)
{
  hap_pointer_def def;
  hap_pointer_id id = {0};
  hap_pointer_def_init(&def, sizeof def);
  def.radius = RADIUS;
  def.stiffness = c->stiffness[index];
  def.damping = c->damping;
  CHECK(hap_pointer_add(c->s.session, &def, &id) == HAP_OK);
  return id;
}

static bool crowd_begin(crowd *c)
{
  if (stage_create(&c->s) != HAP_OK) {
    printf("# %s\n", c->s.detail.text);
    return false;
  }
  for (int i = 0; i < c->count; ++i) {
    c->hands[i] = add_hand(c, i);
  }
  move_hands(c, 0.0);
  return hap_session_start(c->s.session) == HAP_OK;
}

static void crowd_forward(crowd *c, int ticks)
{
  for (int i = 0; i < ticks; ++i) {
    move_hands(c, 1e-9 * (double)hap_session_now(c->s.session));
    CHECK(hap_session_advance(c->s.session, 1) == HAP_OK);
  }
}

static void force_of(crowd *c, int index, double out[3])
{
  hap_pointer_state state;
  CHECK(hap_pointer_get(c->s.session, c->hands[index], &state, sizeof state) == HAP_OK);
  hapi_v3_copy(state.wrench.force, out);
}

static void check_audit(crowd *c, double tolerance)
{
  hap_stats stats = stats_of(&c->s);
  CHECK_NEAR(stats.hand.momentum_ratio, 1.0, tolerance);
  CHECK(stats.faults.count == 0 && stats.model.capacity_dropped == 0 &&
        stats.hand.impulse_abs_ns > 0.0);
}

/* ---- one body ---- */

static const double bar_edges[3] = {0.85, EDGE, EDGE};
#define BAR_MASS 2.0

/* Under the bar, in two rows; stiffnesses are those of their mirror images. */
static void place_under_bar(crowd *c)
{
  for (int i = 0; i < HANDS; ++i) {
    int column = i % 8;
    int from_end = column < 4 ? column : 7 - column;
    hapi_v3_set(c->at[i], 0.1 * (column - 3.5), i < 8 ? -0.02 : 0.02, -0.5 * EDGE - RADIUS - 1e-4);
    c->stiffness[i] = 300.0 * (1 + from_end);
  }
}

static double sum_of_stiffness(const crowd *c)
{
  double sum = 0.0;
  for (int i = 0; i < HANDS; ++i) {
    sum += c->stiffness[i];
  }
  return sum;
}

/* Springs side by side: each carries its part of the weight. Nothing holds the bar sideways:
 * left alone long enough it slides off. Model impulse, whose force is late, throws it. */
static void check_held_bar(hap_model model, bool jointed)
{
  crowd c;
  crowd_init(&c, model, 9.81);
  dBodyID bar = add_box(&c, bar_edges, BAR_MASS, (const double[3]){0.0, 0.0, 0.0});
  if (jointed) {
    dJointID slider = dJointCreateSlider(c.s.world, NULL);
    dJointAttach(slider, bar, NULL);
    dJointSetSliderAxis(slider, 0.0, 0.0, 1.0);
  }
  place_under_bar(&c);
  c.damping = 10.0;
  REQUIRE(crowd_begin(&c));
  crowd_forward(&c, jointed ? 4000 : 2000);
  double weight = BAR_MASS * 9.81;
  double sum = 0.0;
  double worst = 0.0;
  for (int i = 0; i < HANDS; ++i) {
    double force[3];
    double share = -weight * c.stiffness[i] / sum_of_stiffness(&c);
    force_of(&c, i, force);
    worst = fmax(worst, fabs(force[2] / share - 1.0));
    CHECK(fabs(force[0]) + fabs(force[1]) < 1e-3 * weight);
    sum += force[2];
  }
  printf("# %s%s: sum %.6f of %.6f N, a share off by %.2g\n", hap_model_name(model),
         jointed ? ", on a slider" : "", -sum, weight, worst);
  CHECK_NEAR(sum, -weight, 1e-4 * weight);
  CHECK(worst < 1e-3);
  check_audit(&c, 1e-9);
  stage_end(&c.s);
}

TEST(sixteen_hold_a_bar_each_with_its_share)
{
  for (int i = 0; i < 4; ++i) {
    if (all_models[i] != HAP_MODEL_IMPULSE) {
      check_held_bar(all_models[i], false);
      check_held_bar(all_models[i], true);
    }
  }
}

/* A body that nothing moves: a spring does not know of the others. */
TEST(one_that_leaves_changes_nothing_for_the_others)
{
  crowd c;
  double before[HANDS][3];
  crowd_init(&c, HAP_MODEL_CONTACT, 0.0);
  dBodySetKinematic(add_box(&c, bar_edges, BAR_MASS, (const double[3]){0.0, 0.0, 0.0}));
  place_under_bar(&c);
  for (int i = 0; i < HANDS; ++i) {
    c.at[i][2] += 1e-3 + 1e-4 * i;
  }
  REQUIRE(crowd_begin(&c));
  crowd_forward(&c, 100);
  for (int i = 0; i < HANDS; ++i) {
    force_of(&c, i, before[i]);
    CHECK_NEAR(before[i][2], -c.stiffness[i] * (9e-4 + 1e-4 * i), 1e-9);
  }
  for (int gone = HANDS - 1; gone >= 0; gone -= 3) {
    hap_pointer_id id = c.hands[gone];
    CHECK(hap_pointer_remove(c.s.session, id) == HAP_OK);
    c.hands[gone].v = 0;
    crowd_forward(&c, 1);
    for (int i = 0; i < HANDS; ++i) {
      double force[3];
      if (c.hands[i].v != 0) {
        force_of(&c, i, force);
        CHECK(memcmp(force, before[i], sizeof force) == 0);
      }
    }
    c.hands[gone] = add_hand(&c, gone);
    CHECK(c.hands[gone].v != id.v);
    move_hands(&c, 0.0);
    crowd_forward(&c, 100);
    double again[3];
    force_of(&c, gone, again);
    CHECK_NEAR(again[2], before[gone][2], 1e-9);
  }
  stage_end(&c.s);
}

/* ---- many bodies ---- */

static double push_apart(hap_model model, int count)
{
  crowd c;
  crowd_init(&c, model, 0.0);
  c.count = count;
  c.speed = 0.2;
  double force[3];
  double sum = 0.0;
  for (int i = 0; i < count; ++i) {
    const double at[3] = {0.5 * EDGE, 0.3 * i, 0.0};
    (void)add_box(&c, (const double[3]){EDGE, EDGE, EDGE}, 0.2, at);
    hapi_v3_set(c.at[i], -RADIUS - 0.005, 0.3 * i, 0.0);
  }
  if (!crowd_begin(&c)) {
    CHECK(false);
    stage_end(&c.s);
    return 0.0;
  }
  crowd_forward(&c, 50);
  for (int i = 0; i < count; ++i) {
    force_of(&c, i, force);
    CHECK(force[0] < 0.0);
  }
  crowd_forward(&c, 350);
  sum = stats_of(&c.s).hand.impulse_ns;
  check_audit(&c, 1e-9);
  stage_end(&c.s);
  return sum;
}

TEST(sixteen_push_sixteen_cubes_as_one_pushes_one)
{
  for (int i = 0; i < 4; ++i) {
    double one = push_apart(all_models[i], 1);
    double all = push_apart(all_models[i], HANDS);
    printf("# %s: %.9f N s, %.9f each of sixteen\n", hap_model_name(all_models[i]), one,
           all / HANDS);
    CHECK_NEAR(all / HANDS, one, 1e-9 * one);
    CHECK(all_models[i] == HAP_MODEL_IMPULSE || fabs(one / (2 * 0.2 * 0.2) - 1.0) < 0.03);
  }
}

/* Cubes on a floor; the hands push them along x. */
static void build_row(crowd *c, bool abreast)
{
  (void)dCreatePlane(c->s.space, 0.0, 0.0, 1.0, 0.0);
  dWorldSetCFM(c->s.world, 1e-9);
  dWorldSetContactSurfaceLayer(c->s.world, 1e-4);
  for (int i = 0; i < HANDS; ++i) {
    const double at[3] = {abreast ? 0.5 * EDGE : EDGE * (i + 0.5), abreast ? EDGE * i : 0.0,
                          0.5 * EDGE};
    (void)add_box(c, (const double[3]){EDGE, EDGE, EDGE}, 0.1, at);
    hapi_v3_set(c->at[i], -RADIUS - 0.001, abreast ? EDGE * i : 0.01 * (i % 4 - 1.5),
                abreast ? 0.5 * EDGE : 0.025 + 0.01 * (i / 4 - 1.5));
  }
}

static bool surface_slippery(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  (void)user;
  (void)a;
  (void)b;
  io->mu = 0.3;
  return true;
}

static void check_row(hap_model model, bool abreast)
{
  crowd c;
  crowd_init(&c, model, 9.81);
  c.s.ode.surface = surface_slippery;
  build_row(&c, abreast);
  c.speed = 0.05;
  c.damping = 2.0;
  REQUIRE(crowd_begin(&c));
  crowd_forward(&c, 1000);
  double sum = 0.0;
  double least = HUGE_VAL;
  double most = 0.0;
  for (int i = 0; i < 100; ++i) {
    crowd_forward(&c, 1);
    for (int k = 0; k < HANDS; ++k) {
      double force[3];
      force_of(&c, k, force);
      sum -= 0.01 * force[0];
      least = fmin(least, -force[0]);
      most = fmax(most, -force[0]);
    }
  }
  double friction = 0.3 * HANDS * 0.1 * 9.81;
  printf("# %s, %s: sum %.4f of %.4f N, one %.3f .. %.3f N\n", hap_model_name(model),
         abreast ? "abreast" : "in a row", sum, friction, least, most);
  check_audit(&c, 1e-9);
  if (model == HAP_MODEL_CONTACT || model == HAP_MODEL_SINGLE) {
    CHECK_NEAR(sum, friction, 0.02 * friction);
    CHECK(least > 0.5 * friction / HANDS && most < 2.0 * friction / HANDS);
  }
  stage_end(&c.s);
}

TEST(sixteen_push_sixteen_cubes_that_touch)
{
  for (int i = 0; i < 4; ++i) {
    check_row(all_models[i], true);
    check_row(all_models[i], false);
  }
}

/* ---- the same bits ---- */

static uint64_t hash_of_run(hap_model model)
{
  crowd c;
  uint64_t hash = 0;
  crowd_init(&c, model, 9.81);
  c.s.ode.surface = surface_slippery;
  build_row(&c, false);
  c.speed = 0.1;
  if (crowd_begin(&c)) {
    for (int i = 0; i < 40; ++i) { /* they come and go */
      int index = i * 7 % HANDS;
      CHECK(hap_pointer_remove(c.s.session, c.hands[index]) == HAP_OK);
      c.hands[index].v = 0;
      crowd_forward(&c, 3 + i % 5);
      c.hands[index] = add_hand(&c, index);
      crowd_forward(&c, 2);
    }
    hash = stats_of(&c.s).loop.trace_hash;
  }
  stage_end(&c.s);
  return hash;
}

TEST(sixteen_pointers_have_the_same_bits_in_every_run)
{
  for (int i = 0; i < 4; ++i) {
    uint64_t first = hash_of_run(all_models[i]);
    void *shift = malloc(123456);
    CHECK(first != 0 && first == hash_of_run(all_models[i]));
    free(shift);
  }
}

TEST(a_seventeenth_is_refused_and_says_why)
{
  crowd c;
  hap_pointer_def def;
  hap_pointer_id id;
  crowd_init(&c, HAP_MODEL_CONTACT, 0.0);
  REQUIRE(crowd_begin(&c));
  hap_pointer_def_init(&def, sizeof def);
  CHECK(hap_pointer_add(c.s.session, &def, &id) == HAP_ERROR_CAPACITY && id.v == 0);
  CHECK(text_has(detail_of(&c.s), "max_pointers"));
  CHECK(hap_pointer_remove(c.s.session, c.hands[3]) == HAP_OK);
  CHECK(hap_pointer_add(c.s.session, &def, &id) == HAP_OK && id.v != c.hands[3].v);
  CHECK(hap_pointer_remove(c.s.session, c.hands[3]) == HAP_ERROR_NOT_FOUND);
  CHECK(text_has(detail_of(&c.s), "it was removed"));
  c.hands[3].v = 0;
  stage_end(&c.s);
}
