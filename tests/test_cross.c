/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Options of model accelerance: cross accelerance and probes about the operating point, against
 * closed forms; what they do in the loop and at the sync. */

#include <tests/tap.h>

#include <tests/physics_world.h>

#include "haptic/haptic_internal.h"
#include "tests/owned_rig.h"

#define EDGE 0.05     /* m */
#define APART 0.03    /* m, from a body's centre to the joint: no contact between them */
#define OVERLAP 1e-6  /* m: touching, within the layer where nothing is pushed out */
#define GAP 5e-4      /* m, from the pointer to the body */
#define GRAVITY 9.81  /* m/s^2 */
#define RADIUS 0.01   /* m */
#define BIG_RADIUS 1. /* m: a pointer above that is near to all of them */

static void blocks_measure(const test_world *w)
{
  world_measure(w);
}

/* The block of a pointer's contact with one body and of another body; NULL: none. */
static const hapi_cross_block *block_of(const test_world *w, dBodyID pushed, dBodyID other)
{
  const hapi_physics *physics = world_physics(w);
  const hapi_contact_slot *contact = world_contact(w, pushed, 0);
  const hapi_body_slot *body = world_slot(w, other);
  for (uint32_t i = 0; i < physics->cross.block_count; ++i) {
    const hapi_cross_block *cross = &physics->cross.blocks[i];
    if (&physics->near.slots.contacts[cross->contact] == contact &&
        &physics->near.slots.bodies[cross->body] == body) {
      return cross;
    }
  }
  return NULL;
}

static void check_block(const hapi_cross_block *cross, double expected[6][3])
{
  double most = 0.0;
  for (int i = 0; i < 6; ++i) {
    for (int k = 0; k < 3; ++k) {
      double unit = i < 3 ? 1.0 : 1.0 / APART;
      most = fmax(most, fabs(cross->a[i][k] - expected[i][k]) / unit);
      CHECK_NEAR(cross->a[i][k], expected[i][k], 1e-6 * unit);
    }
  }
  printf("# off by %.2g at most\n", most);
}

static void start_above(test_world *w, double x)
{
  world_create_session(w, NULL);
  world_add_pointer(w, BIG_RADIUS, x, 0.004, BIG_RADIUS + EDGE / 2 + 0.005);
  REQUIRE(hap_session_start(w->session) == HAP_OK);
}

/* Two cubes along x, their joint in the origin. */
static test_world *open_pair(hap_effect_wish cross, double mass_a, double mass_b)
{
  test_world *w = world_new(0.0, 1000);
  expert_wish(&w->expert, HAP_EFFECT_CROSS, cross);
  world_add_cube(w, EDGE, mass_a, -APART, 0, 0);
  world_add_cube(w, EDGE, mass_b, APART, 0, 0);
  return w;
}

static void join_fixed(test_world *w)
{
  dJointID joint = dJointCreateFixed(w->world, NULL);
  dJointAttach(joint, w->bodies[0], w->bodies[1]);
  dJointSetFixed(joint);
}

static void join_hinge(test_world *w)
{
  dJointID joint = dJointCreateHinge(w->world, NULL);
  dJointAttach(joint, w->bodies[0], w->bodies[1]);
  dJointSetHingeAnchor(joint, 0, 0, 0);
  dJointSetHingeAxis(joint, 0, 0, 1);
}

/* ---- closed forms ---- */

/* One rigid body of both: acceleration of the second one's centre by a force at p. */
static void expect_rigid(const double mass[2], const double p[3], double out[6][3])
{
  double whole = mass[0] + mass[1];
  double centre = APART * (mass[1] - mass[0]) / whole;
  double own = whole * EDGE * EDGE / 6.0;
  double ways[2] = {-APART - centre, APART - centre};
  double across = own + mass[0] * ways[0] * ways[0] + mass[1] * ways[1] * ways[1];
  const double arm[3] = {p[0] - centre, p[1], p[2]};
  for (int k = 0; k < 3; ++k) {
    double force[3] = {0.0, 0.0, 0.0};
    double moment[3];
    force[k] = 1.0;
    hapi_v3_cross(arm, force, moment);
    const double turn[3] = {moment[0] / own, moment[1] / across, moment[2] / across};
    const double way[3] = {0.0, turn[2] * ways[1], -turn[1] * ways[1]};
    for (int i = 0; i < 3; ++i) {
      out[i][k] = force[i] / whole + way[i];
      out[3 + i][k] = turn[i];
    }
  }
}

TEST(a_fixed_pair_answers_as_one_body)
{
  const double mass[2] = {0.5, 0.2};
  double expected[6][3];
  test_world *w = open_pair(HAP_EFFECT_ON, mass[0], mass[1]);
  join_fixed(w);
  start_above(w, -0.02);
  blocks_measure(w);
  const hapi_cross_block *cross = block_of(w, w->bodies[0], w->bodies[1]);
  const hapi_contact_slot *contact = world_contact(w, w->bodies[0], 0);
  REQUIRE(cross != NULL && contact != NULL);
  expect_rigid(mass, contact->point_world, expected);
  check_block(cross, expected);
  CHECK(block_of(w, w->bodies[1], w->bodies[0]) != NULL);
  CHECK(world_physics(w)->cross.block_count == 2);
  CHECK(world_physics(w)->probe.counts.clipped == 0 && world_physics(w)->cross.counts.clipped == 0);
}

/* Cubes alike, a hinge along z between them: about x and y they turn as one body, about z each by
 * itself, with the hinge's force r across. */
static void expect_hinged(double mass, const double p[3], double out[6][3])
{
  const double inertia = mass * EDGE * EDGE / 6.0;
  const double bent = inertia + mass * APART * APART;
  const double arm[3] = {p[0] + APART, p[1], p[2]};
  memset(out, 0, 18 * sizeof(double));
  for (int k = 0; k < 2; ++k) { /* force along x, along y */
    double turn = k == 0 ? -arm[1] : arm[0];
    double direct = k == 0 ? 0.0 : 1.0 / mass;
    double r = (direct + APART * turn / inertia) / (2.0 * bent / (mass * inertia));
    out[1][k] = r / mass;
    out[5][k] = -APART * r / inertia;
  }
  out[0][0] = 0.5 / mass;
  out[4][0] = 0.5 * p[2] / bent;
  out[2][0] = -APART * out[4][0];
  out[3][1] = -0.5 * p[2] / inertia;
  out[2][2] = 0.5 / mass;
  out[3][2] = 0.5 * p[1] / inertia;
  out[4][2] = -0.5 * p[0] / bent;
  out[2][2] -= APART * out[4][2];
}

TEST(a_hinged_pair_has_its_closed_form)
{
  double expected[6][3];
  test_world *w = open_pair(HAP_EFFECT_ON, 0.4, 0.4);
  join_hinge(w);
  start_above(w, -0.02);
  blocks_measure(w);
  const hapi_cross_block *cross = block_of(w, w->bodies[0], w->bodies[1]);
  const hapi_contact_slot *contact = world_contact(w, w->bodies[0], 0);
  REQUIRE(cross != NULL && contact != NULL);
  expect_hinged(0.4, contact->point_world, expected);
  check_block(cross, expected);
}

TEST(what_nothing_ties_has_no_block_and_no_probe_is_added)
{
  uint64_t probes[2];
  for (int joined = 0; joined < 2; ++joined) {
    test_world *w = open_pair(HAP_EFFECT_ON, 0.4, 0.4);
    if (joined != 0) {
      join_fixed(w);
    }
    start_above(w, -0.02);
    const uint64_t *made = &world_physics(w)->probe.test.steps;
    uint64_t before = *made;
    blocks_measure(w);
    probes[joined] = *made - before;
    CHECK(world_count_contacts(w) == 2);
    CHECK(world_physics(w)->cross.block_count == (joined != 0 ? 2u : 0u));
  }
  CHECK(probes[0] == 1 + 3 && probes[1] == 1 + 6);
}

/* Of the pairs of a glued row those with the largest answers have the places. */
TEST(with_too_few_places_the_largest_stay)
{
  hapi_cross_block all[6];
  test_world *w = world_new(0.0, 200);
  expert_wish(&w->expert, HAP_EFFECT_CROSS, HAP_EFFECT_ON);
  for (int i = 0; i < 3; ++i) {
    world_add_cube(w, EDGE, 0.2 + 0.3 * i, 2 * APART * i, 0, 0);
  }
  for (int i = 0; i < 2; ++i) {
    dJointID joint = dJointCreateFixed(w->world, NULL);
    dJointAttach(joint, w->bodies[i], w->bodies[i + 1]);
    dJointSetFixed(joint);
  }
  start_above(w, 2 * APART);
  hapi_physics *physics = world_physics(w);
  CHECK(physics->config.capacity.crosses == 8 * (uint32_t)w->def.max_bodies);
  blocks_measure(w);
  REQUIRE(physics->cross.block_count == 6);
  CHECK(physics->cross.counts.dropped == 0);
  memcpy(all, physics->cross.blocks, sizeof all);
  physics->config.capacity.crosses = 4;
  blocks_measure(w);
  REQUIRE(physics->cross.block_count == 4);
  CHECK(physics->cross.counts.dropped == 2);
  for (int i = 0; i < 6; ++i) {
    int larger = 0;
    bool kept = false;
    for (int k = 0; k < 6; ++k) {
      larger += all[k].response > all[i].response;
    }
    for (uint32_t k = 0; k < 4; ++k) {
      kept = kept || memcmp(physics->cross.blocks[k].a, all[i].a, sizeof all[i].a) == 0;
    }
    CHECK(kept == (larger < 4));
  }
}

/* A perturbation of nothing, as of a body without weight, divides nothing by nothing. */
TEST(a_block_that_is_no_number_is_left_out)
{
  test_world *w = open_pair(HAP_EFFECT_ON, 0.5, 0.2);
  join_fixed(w);
  start_above(w, -0.02);
  const hapi_probe_counts *counts = &world_physics(w)->probe.counts;
  const hapi_cross_counts *blocks = &world_physics(w)->cross.counts;
  world_slot(w, w->bodies[0])->mass = 0.0;
  blocks_measure(w);
  CHECK(counts->singular == 1 && counts->clipped == 0); /* A of the contact ... */
  CHECK(blocks->singular == 1 && blocks->clipped == 0); /* ... and its block */
  CHECK(block_of(w, w->bodies[0], w->bodies[1]) == NULL);
  CHECK(block_of(w, w->bodies[1], w->bodies[0]) != NULL);
  CHECK(world_contact_answer(w, world_contact(w, w->bodies[0], 0))->a[0][0] >
        0.1); /* the last good one */
}

/* ---- in the loop ---- */

static const hapi_local_body *local_of(const test_world *w, int body)
{
  const hapi_body_slot *slot = world_slot(w, w->bodies[body]);
  return &w->session->haptic->tick.bodies.of[slot - world_physics(w)->near.slots.bodies];
}

/* A smooth row in empty space, pushed along; another pointer hovers over the second cube, so
 * that the loop knows it. */
static test_world *open_row(hap_effect_wish cross)
{
  test_world *w = world_new(0.0, 1000);
  w->mu = 0.0;
  expert_wish(&w->expert, HAP_EFFECT_CROSS, cross);
  w->research.guard = HAP_GUARD_MEASURE;
  for (int i = 0; i < 3; ++i) {
    world_add_cube(w, EDGE, 0.5, EDGE / 2 + i * (EDGE - OVERLAP), 0, 0);
  }
  world_create_session(w, NULL);
  world_add_pointer(w, RADIUS, -RADIUS - GAP, 0, 0);
  world_add_pointer(w, RADIUS, 1.5 * EDGE, 0, EDGE / 2 + RADIUS + 0.005);
  session_run(w->session);
  CHECK(hap_session_advance(w->session, 2) == HAP_OK);
  world_move_pointer(w, 0, (const double[3]){-RADIUS + 0.002, 0, 0}, NULL);
  return w;
}

TEST(the_second_cube_of_a_row_moves_between_syncs)
{
  for (int cross = HAP_EFFECT_OFF; cross <= HAP_EFFECT_ON; ++cross) {
    test_world *w = open_row((hap_effect_wish)cross);
    CHECK(hap_session_advance(w->session, 40) == HAP_OK); /* the first sync is at 50 */
    double first = local_of(w, 0)->twist.linear[0];
    double second = local_of(w, 1)->twist.linear[0];
    CHECK(first > 0.005);
    CHECK_NEAR(second, cross == HAP_EFFECT_ON ? first : 0.0, 1e-6 * first);
    CHECK(dBodyGetLinearVel(w->bodies[1])[0] == 0.0);
    CHECK(hap_session_advance(w->session, 10) == HAP_OK); /* the step of the sync, not yet in use */
    double world = dBodyGetLinearVel(w->bodies[1])[0];
    double missed = world_account(w, w->bodies[1])->residual[0]; /* eq. 14 */
    CHECK(world > 0.005);
    CHECK_NEAR(missed, cross == HAP_EFFECT_ON ? 0.0 : world, 1e-5 * world);
  }
}

/* What the hand gave is in the world once, and the loop's bodies go where the world's do. */
TEST(an_impulse_counts_once_and_what_answers_follows_the_world)
{
  test_world *w = open_row(HAP_EFFECT_ON);
  CHECK(hap_session_advance(w->session, 60) == HAP_OK);
  CHECK((local_of(w, 1)->given.flags & HAPI_BODY_FOLLOWS) != 0);
  CHECK((local_of(w, 0)->given.flags & HAPI_BODY_FOLLOWS) == 0);
  CHECK(local_of(w, 1)->account.impulse[0] == 0.0);
  world_move_pointer(w, 0, (const double[3]){-0.1, 0, 0}, NULL);
  CHECK(hap_session_advance(w->session, 101) == HAP_OK);
  hap_stats stats = world_stats(w);
  double momentum = 0.0;
  for (int i = 0; i < 3; ++i) {
    momentum += 0.5 * dBodyGetLinearVel(w->bodies[i])[0];
  }
  CHECK(stats.hand.impulse_ns > 0.01);
  CHECK_NEAR(stats.hand.momentum_ratio, 1.0, 1e-9);
  CHECK_NEAR(momentum / stats.hand.impulse_ns, 1.0, 1e-6);
}

/* A hand on each of two jointed cubes: each force moves both, and eq. 14 finds nothing left. */
TEST(two_hands_on_a_pair_leave_no_residual)
{
  double missed[2];
  for (int cross = HAP_EFFECT_OFF; cross <= HAP_EFFECT_ON; ++cross) {
    test_world *w = open_pair((hap_effect_wish)cross, 0.5, 0.3);
    w->research.guard = HAP_GUARD_MEASURE;
    join_fixed(w);
    world_create_session(w, NULL);
    world_add_pointer(w, RADIUS, -APART, 0, EDGE / 2 + RADIUS + GAP);
    world_add_pointer(w, RADIUS, APART, 0, EDGE / 2 + RADIUS + GAP);
    REQUIRE(hap_session_start(w->session) == HAP_OK);
    CHECK(hap_session_advance(w->session, 2) == HAP_OK);
    world_move_pointer(w, 0, (const double[3]){-APART, 0, EDGE / 2 + RADIUS - 0.001}, NULL);
    world_move_pointer(w, 1, (const double[3]){APART, 0, EDGE / 2 + RADIUS - 0.0005}, NULL);
    CHECK(hap_session_advance(w->session, 50) == HAP_OK);
    const hapi_body_slot *slots[2] = {world_slot(w, w->bodies[0]), world_slot(w, w->bodies[1])};
    CHECK(slots[0]->pushed && slots[1]->pushed);
    missed[cross - HAP_EFFECT_OFF] = fmax(fabs(world_account(w, w->bodies[0])->residual[2]),
                                          fabs(world_account(w, w->bodies[1])->residual[2]));
    hap_stats stats = world_stats(w);
    CHECK_NEAR(stats.hand.momentum_ratio, 1.0, 1e-9);
  }
  printf("# eq. 14: %g m/s without, %g m/s with cross accelerance\n", missed[0], missed[1]);
  CHECK(missed[0] > 1e-3 && missed[1] < 0.02 * missed[0]);
}

static uint64_t hash_of(const char *scene_name, hap_probe probe, hap_effect_wish cross)
{
  rig_options options;
  hap_stats stats;
  memset(&stats, 0, sizeof stats);
  rig_options_init(&options);
  options.scene = scene_name;
  options.def.drive = HAP_DRIVE_LOCKSTEP;
  options.def.physics_hz = 20.0;
  options.def.model = HAP_MODEL_ACCELERANCE;
  options.research.probe = probe;
  expert_wish(&options.expert, HAP_EFFECT_CROSS, cross);
  rig *r = rig_own(&options);
  CHECK(hap_session_start(r->session) == HAP_OK);
  CHECK(hap_session_advance(r->session, 700) == HAP_OK);
  CHECK(hap_session_stats(r->session, &stats, sizeof stats) == HAP_OK);
  CHECK(stats.loop.contact_ticks > 0);
  tap_release(r);
  return stats.loop.trace_hash;
}

TEST(a_body_alone_does_not_feel_the_switch)
{
  CHECK(hash_of("slide", HAP_PROBE_SHARED, HAP_EFFECT_OFF) ==
        hash_of("slide", HAP_PROBE_SHARED, HAP_EFFECT_ON));
  CHECK(hash_of("stack", HAP_PROBE_SHARED, HAP_EFFECT_OFF) !=
        hash_of("stack", HAP_PROBE_SHARED, HAP_EFFECT_ON));
  CHECK(hash_of("slide", HAP_PROBE_SHARED, HAP_EFFECT_OFF) !=
        hash_of("slide", HAP_PROBE_OPERATING, HAP_EFFECT_OFF));
}

/* ---- operating point ---- */

#define MASS 0.5
#define MU 0.5
#define LIMIT (MU * MASS * GRAVITY) /* N, of friction */

typedef struct on_floor {
  test_world w;
  hapi_contact_slot *contact;
  hapi_body_slot *slot;
} on_floor;

/* A cube on a floor, a pointer at its left side, or right side. */
static void open_floor(on_floor *f, hap_probe probe, double side)
{
  test_world *w = &f->w;
  world_open(w, GRAVITY, 1000);
  w->mu = MU;
  w->research.probe = probe;
  expert_wish(&w->expert, HAP_EFFECT_CROSS, HAP_EFFECT_ON);
  dCreatePlane(w->space, 0, 0, 1, 0);
  dBodyID cube = world_add_cube(w, EDGE, MASS, 0, 0, EDGE / 2 - OVERLAP);
  world_create_session(w, NULL);
  world_add_pointer(w, RADIUS, side * (-EDGE / 2 - RADIUS - GAP), 0, EDGE / 2);
  bool good = hap_session_start(w->session) == HAP_OK;
  f->contact = good ? world_contact(w, cube, 0) : NULL;
  f->slot = good ? world_slot(w, cube) : NULL;
  REQUIRE(f->contact != NULL && f->slot != NULL);
}

static void measure_with(on_floor *f, double x, double z, double speed)
{
  hapi_v3_set(f->contact->last_touch.force, x, 0.0, z);
  f->contact->speed = speed;
  blocks_measure(&f->w);
}

/* b + A f: what the loop comes to with the force of the operating point. */
static double with_force(const on_floor *f, int row)
{
  return world_answer(&f->w, f->slot)->b[row] +
         hapi_v3_dot(world_contact_answer(&f->w, f->contact)->a[row], f->contact->last_touch.force);
}

TEST(a_cube_that_friction_holds_gives_no_way)
{
  const struct {
    double x;
    double z;
    double speed;
  } cases[] = {
      {0.5 * LIMIT, 0.0, 0.0},                   /* pushed with half of what would move it */
      {0.5 * LIMIT, -2.0 * MASS * GRAVITY, 0.0}, /* and pressed: eq. 4 pushes with all of that */
      {0.0, 0.0, 3.0},                           /* before a fast touch: with v sqrt(k m) */
  };
  for (size_t i = 0; i < 3; ++i) {
    on_floor f;
    open_floor(&f, HAP_PROBE_OPERATING, 1.0);
    measure_with(&f, cases[i].x, cases[i].z, cases[i].speed);
    CHECK_NEAR(world_contact_answer(&f.w, f.contact)->a[0][0], 0.0, 1e-6);
    CHECK_NEAR(with_force(&f, 0), 0.0, 1e-6);
    world_close(&f.w);
    open_floor(&f, HAP_PROBE_SHARED, 1.0);
    measure_with(&f, cases[i].x, cases[i].z, cases[i].speed);
    if (i > 0) {
      CHECK(world_contact_answer(&f.w, f.contact)->a[0][0] > 0.5);
    }
    world_close(&f.w);
  }
}

TEST(a_cube_that_slides_answers_with_its_mass)
{
  for (int side = -1; side <= 1; side += 2) {
    on_floor f;
    double force = side * 2.0 * LIMIT;
    open_floor(&f, HAP_PROBE_OPERATING, side);
    measure_with(&f, force, 0.0, 0.0);
    CHECK_NEAR(world_contact_answer(&f.w, f.contact)->a[0][0], 1.0 / MASS, 1e-3 / MASS);
    CHECK_NEAR(world_answer(&f.w, f.slot)->b[0], -side * MU * GRAVITY, 5e-3 * GRAVITY);
    CHECK_NEAR(with_force(&f, 0), force / MASS - side * MU * GRAVITY, 1e-3 * GRAVITY);
    CHECK_NEAR(f.contact->last_touch.force[0], force, 0.0);
    world_close(&f.w);
  }
}

/* What the base probe came to is what b, A f and the blocks make together, of every body. */
TEST(b_and_the_forces_make_the_base_again)
{
  double base[3];
  double wanted = 3.0 / 1.5;
  test_world *w = open_row(HAP_EFFECT_ON);
  hapi_physics *physics = world_physics(w);
  physics->cycle.settings.probe = HAP_PROBE_OPERATING;
  hapi_contact_slot *contact = world_contact(w, w->bodies[0], 0);
  REQUIRE(contact != NULL && block_of(w, w->bodies[0], w->bodies[1]) != NULL);
  hapi_v3_set(contact->last_touch.force, 3.0, 0.0, 0.0);
  blocks_measure(w);
  base[0] = world_answer(w, world_slot(w, w->bodies[0]))->b[0] +
            3.0 * world_contact_answer(w, contact)->a[0][0];
  base[1] = world_answer(w, world_slot(w, w->bodies[1]))->b[0] +
            3.0 * block_of(w, w->bodies[0], w->bodies[1])->a[0][0];
  CHECK_NEAR(base[0], wanted, 1e-6);
  CHECK_NEAR(base[1], wanted, 1e-6);
  CHECK_NEAR(world_answer(w, world_slot(w, w->bodies[1]))->b[0], 0.0, 1e-6);
  physics->config.capacity.crosses = 0; /* off: the force of the last tick is held in b */
  blocks_measure(w);
  CHECK_NEAR(world_answer(w, world_slot(w, w->bodies[0]))->b[0], 0.0, 1e-6);
  CHECK_NEAR(world_answer(w, world_slot(w, w->bodies[1]))->b[0], wanted, 1e-6);
}

/* Two cubes side by side on the floor are one island; friction holds both. */
TEST(what_does_not_answer_has_no_block)
{
  for (int pushed = 0; pushed < 2; ++pushed) {
    on_floor f;
    test_world *w = &f.w;
    double force = pushed != 0 ? 4.0 * LIMIT : 0.0;
    world_open(w, GRAVITY, 1000);
    w->mu = MU;
    w->research.probe = HAP_PROBE_OPERATING;
    expert_wish(&w->expert, HAP_EFFECT_CROSS, HAP_EFFECT_ON);
    dCreatePlane(w->space, 0, 0, 1, 0);
    for (int i = 0; i < 2; ++i) {
      world_add_cube(w, EDGE, MASS, i * (EDGE - OVERLAP), 0, EDGE / 2 - OVERLAP);
    }
    world_create_session(w, NULL);
    world_add_pointer(w, RADIUS, -EDGE / 2 - RADIUS - GAP, 0, EDGE / 2);
    world_add_pointer(w, RADIUS, EDGE, 0, EDGE + RADIUS + 0.005);
    REQUIRE(hap_session_start(w->session) == HAP_OK);
    f.contact = world_contact(w, w->bodies[0], 0);
    REQUIRE(f.contact != NULL && world_slot(w, w->bodies[1]) != NULL);
    measure_with(&f, force, 0.0, 0.0);
    printf("# pushed with %g N: %u blocks\n", force, world_physics(w)->cross.block_count);
    CHECK((block_of(w, w->bodies[0], w->bodies[1]) != NULL) == (pushed != 0));
    world_close(w);
  }
}

/* Not yet touched: a perturbation away from the row would find the cube alone. */
TEST(perturbations_go_into_the_body)
{
  for (int side = -1; side <= 1; side += 2) {
    test_world *w = world_new(0.0, 1000);
    w->mu = 0.0;
    w->research.probe = HAP_PROBE_OPERATING;
    for (int i = 0; i < 2; ++i) {
      world_add_cube(w, EDGE, 0.5, side * (EDGE / 2 + i * (EDGE - OVERLAP)), 0, 0);
    }
    world_start(w, RADIUS, side * (-RADIUS - GAP), 0, 0);
    const hapi_contact_slot *contact = world_contact(w, w->bodies[0], 0);
    REQUIRE(contact != NULL);
    CHECK_NEAR(world_contact_answer(w, contact)->a[0][0], 1.0, 1e-6);
    world_close(w);
  }
}

TEST(operating_probes_are_as_many_as_shared_ones)
{
  uint64_t steps[2];
  for (int k = 0; k < 2; ++k) {
    test_world *w = open_pair(HAP_EFFECT_OFF, 0.4, 0.4);
    w->research.probe = k == 0 ? HAP_PROBE_SHARED : HAP_PROBE_OPERATING;
    join_fixed(w);
    start_above(w, -0.02);
    const uint64_t *made = &world_physics(w)->probe.test.steps;
    uint64_t before = *made;
    blocks_measure(w);
    steps[k] = *made - before;
  }
  CHECK(steps[0] == 7 && steps[1] == 7);
}
