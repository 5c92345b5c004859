/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* What a measured accelerance can be, and what is done with one that it cannot be. */

#include "tests/tap.h"

#include "probe/admittance.h"
#include "tests/physics_world.h"
#include "tests/unknown_shape.h"

#define COUNT(array) (sizeof(array) / sizeof(array)[0])

static uint64_t random_state = 1;

static double random_number(void) /* -1 .. 1 */
{
  random_state = random_state * 6364136223846793005u + 1442695040888963407u;
  return (double)(int64_t)random_state / 9.3e18;
}

static void random_vector(double out[3])
{
  for (int i = 0; i < 3; ++i) {
    out[i] = random_number();
  }
}

/* Of a turned box, with inertias a hundred times apart, and a size of its own. */
static hapi_free_body random_body(double size)
{
  hapi_free_body body = {.inverse_mass = 1.0 / (size * size * size)};
  double q[4] = {random_number(), random_number(), random_number(), random_number()};
  double rotation[9];
  double diagonal[9] = {0.0};
  hapi_quat_normalize(q);
  hapi_quat_to_matrix(q, rotation);
  for (int i = 0; i < 3; ++i) {
    diagonal[4 * i] = pow(10.0, 2.0 + random_number()) * body.inverse_mass / (size * size);
  }
  hapi_m3_turn(rotation, diagonal, body.inverse_inertia);
  return body;
}

static void apply_free(const hapi_free_body *body, const double wrench[6], double out[6])
{
  hapi_v3_scale(body->inverse_mass, wrench, out);
  hapi_m3_apply(body->inverse_inertia, wrench + 3, out + 3);
}

/* The body's answer with what constraints leave of it: M^-1 without the part along each of them. */
static void constrained_body(const hapi_free_body *body, int constraints, double out[6][6])
{
  double axes[6][6];
  for (int k = 0; k < 6; ++k) {
    double unit[6] = {0.0};
    unit[k] = 1.0;
    apply_free(body, unit, axes[k]); /* M^-1 is symmetric: a row */
    memcpy(out[k], axes[k], sizeof axes[k]);
  }
  double length = sqrt(body->inverse_mass / body->inverse_inertia[0]); /* so that turns count */
  for (int c = 0; c < constraints; ++c) {
    double j[6];
    double answer[6] = {0.0};
    double size = 0.0;
    for (int i = 0; i < 6; ++i) {
      j[i] = random_number() * (i < 3 ? 1.0 : length);
    }
    for (int i = 0; i < 6; ++i) {
      for (int k = 0; k < 6; ++k) {
        answer[i] += out[i][k] * j[k];
      }
    }
    for (int i = 0; i < 6; ++i) {
      size += j[i] * answer[i];
    }
    for (int i = 0; i < 36; ++i) {
      out[i / 6][i % 6] -= answer[i / 6] * answer[i % 6] / size;
    }
  }
}

/* A = R J^T at an arm. */
static void at_arm(double r[6][6], const double arm[3], double out[6][3])
{
  for (int k = 0; k < 3; ++k) {
    double force[6] = {0.0};
    force[k] = 1.0;
    hapi_v3_cross(arm, force, force + 3);
    for (int i = 0; i < 6; ++i) {
      out[i][k] = 0.0;
      for (int m = 0; m < 6; ++m) {
        out[i][k] += r[i][m] * force[m];
      }
    }
  }
}

/* Acceleration along a direction of the point that is pushed along it. */
static double accelerance_along(double a[6][3], const double arm[3], const double n[3])
{
  double answer[6];
  double way[3];
  for (int i = 0; i < 6; ++i) {
    answer[i] = hapi_v3_dot(a[i], n);
  }
  hapi_v3_cross(answer + 3, arm, way);
  hapi_v3_add(way, answer, way);
  return hapi_v3_dot(way, n);
}

static double largest_difference(const double *a, const double *b, int count)
{
  double most = 0.0;
  for (int i = 0; i < count; ++i) {
    double d = fabs(a[i] - b[i]);
    most = d <= most ? most : d; /* also NaN */
  }
  return most;
}

static double largest_of(const double *a, int count)
{
  const double zero[36] = {0.0};
  return largest_difference(a, zero, count);
}

static const double sizes[] = {0.01, 0.1, 1.0, 100.0};

TEST(what_constraints_leave_of_a_body_is_left_alone)
{
  for (int round = 0; round < 400; ++round) {
    hapi_free_body body = random_body(sizes[round % 4]);
    double response[6][6];
    double before[6][6];
    double a[6][3];
    double a_before[6][3];
    double arm[3];
    double normal[3];
    random_vector(arm);
    random_vector(normal);
    hapi_v3_scale(sizes[round % 4], arm, arm);
    constrained_body(&body, round % 6, response);
    memcpy(before, response, sizeof before);
    at_arm(response, arm, a);
    memcpy(a_before, a, sizeof a);
    CHECK(hapi_admittance_tidy_point(&body, arm, normal, a) == HAPI_ADMITTANCE_GOOD);
    CHECK(memcmp(a, a_before, sizeof a) == 0);
    CHECK(hapi_admittance_tidy_body(&body, response) == HAPI_ADMITTANCE_GOOD);
    CHECK(largest_difference(&response[0][0], &before[0][0], 36) <=
          1e-12 * largest_of(&before[0][0], 36));
  }
}

/* share of the free body's answer: what it shall become; -1: not to be used */
static const struct {
  double share;
  double becomes;
  double angle; /* allowed beside it */
} shares[] = {{0.0, 0.0, 1e-12},  {0.5, 0.5, 1e-12},  {1.0, 1.0, 1e-12},   {1.2, 1.0, 1e-12},
              {1.45, 1.0, 1e-12}, {-0.1, 0.0, 1e-12}, {-0.45, 0.0, 1e-12}, {1.6, -1.0, 0.0},
              {-0.6, -1.0, 0.0},  {1e300, -1.0, 0.0}};

TEST(what_is_outside_is_brought_back_or_refused)
{
  for (size_t s = 0; s < COUNT(shares); ++s) {
    for (int round = 0; round < 50; ++round) {
      hapi_free_body body = random_body(sizes[round % 4]);
      double response[6][6];
      double before[6][6];
      double a[6][3];
      double a_before[6][3];
      double arm[3];
      double normal[3];
      random_vector(arm);
      random_vector(normal);
      hapi_v3_scale(sizes[round % 4], arm, arm);
      constrained_body(&body, 0, response);
      at_arm(response, arm, a);
      double whole = accelerance_along(a, arm, normal);
      double scale = response[0][0];
      for (int i = 0; i < 36; ++i) {
        response[i / 6][i % 6] *= shares[s].share;
        a[i / 6][i % 3] *= i % 6 < 3 ? shares[s].share : 1.0;
      }
      memcpy(before, response, sizeof before);
      memcpy(a_before, a, sizeof a);
      hapi_admittance point = hapi_admittance_tidy_point(&body, arm, normal, a);
      hapi_admittance all = hapi_admittance_tidy_body(&body, response);
      bool inside = shares[s].share >= 0.0 && shares[s].share <= 1.0;
      if (shares[s].becomes < 0.0) {
        CHECK(point == HAPI_ADMITTANCE_SINGULAR && all == HAPI_ADMITTANCE_SINGULAR);
        CHECK(memcmp(a, a_before, sizeof a) == 0 && memcmp(response, before, sizeof before) == 0);
        continue;
      }
      CHECK(point == (inside ? HAPI_ADMITTANCE_GOOD : HAPI_ADMITTANCE_CLIPPED));
      CHECK(all == (inside ? HAPI_ADMITTANCE_GOOD : HAPI_ADMITTANCE_CLIPPED));
      CHECK_NEAR(accelerance_along(a, arm, normal) / whole, shares[s].becomes, 1e-9);
      CHECK_NEAR(response[0][0] / scale, shares[s].becomes, 1e-9);
    }
  }
}

TEST(numbers_that_are_none_are_refused_and_nothing_is_changed)
{
  const double bad[] = {(double)NAN, (double)INFINITY, -(double)INFINITY, 1e300};
  const double arm[3] = {0.1, 0.2, -0.3};
  const double normal[3] = {0.0, 1.0, 0.0};
  for (size_t k = 0; k < COUNT(bad); ++k) {
    for (int place = 0; place < 36; ++place) {
      hapi_free_body body = random_body(1.0);
      double response[6][6];
      double a[6][3];
      constrained_body(&body, 2, response);
      at_arm(response, arm, a);
      a[place / 6][place % 3] = bad[k];
      response[place / 6][place % 6] = bad[k];
      double before[6][6];
      double a_before[6][3];
      memcpy(before, response, sizeof before);
      memcpy(a_before, a, sizeof a);
      CHECK(hapi_admittance_tidy_point(&body, arm, normal, a) == HAPI_ADMITTANCE_SINGULAR);
      CHECK(hapi_admittance_tidy_body(&body, response) == HAPI_ADMITTANCE_SINGULAR);
      CHECK(memcmp(a, a_before, sizeof a) == 0 && memcmp(response, before, sizeof before) == 0);
    }
  }
}

/* Noise of any size: what comes out obeys the bounds for every direction, and is not touched
 * again. */
TEST(the_bounds_hold_for_every_direction)
{
  int seen[3] = {0};
  for (int round = 0; round < 2000; ++round) {
    hapi_free_body body = random_body(sizes[round % 4]);
    double noise = pow(10.0, -3.0 * (round % 5) / 4.0);
    double length = sqrt(body.inverse_mass / body.inverse_inertia[0]);
    double response[6][6];
    constrained_body(&body, round % 7, response);
    for (int i = 0; i < 36; ++i) {
      double unit = body.inverse_mass / ((i / 6 < 3 ? 1.0 : length) * (i % 6 < 3 ? 1.0 : length));
      response[i / 6][i % 6] += 0.5 * noise * random_number() * unit;
    }
    hapi_admittance kind = hapi_admittance_tidy_body(&body, response);
    ++seen[kind];
    for (int trial = 0; kind != HAPI_ADMITTANCE_SINGULAR && trial < 50; ++trial) {
      double x[6];
      double free[6];
      double whole = 0.0;
      double got = 0.0;
      for (int i = 0; i < 6; ++i) {
        x[i] = random_number() * (i < 3 ? 1.0 : length);
      }
      apply_free(&body, x, free);
      for (int i = 0; i < 6; ++i) {
        whole += x[i] * free[i];
        for (int k = 0; k < 6; ++k) {
          got += x[i] * response[i][k] * x[k];
          CHECK(response[i][k] == response[k][i]);
        }
      }
      CHECK(got >= -1e-12 * whole && got <= (1.0 + 1e-12) * whole);
    }
    CHECK(kind == HAPI_ADMITTANCE_SINGULAR ||
          hapi_admittance_tidy_body(&body, response) == HAPI_ADMITTANCE_GOOD);
  }
  printf("# good %d, clipped %d, singular %d\n", seen[0], seen[1], seen[2]);
  CHECK(seen[0] > 50 && seen[1] > 50 && seen[2] > 50);
}

/* A cube that slides along x, mu 0.5: pressed upon it slows down, pushed along it does not
 * press. */
TEST(what_friction_does_is_kept)
{
  hapi_free_body body = {.inverse_mass = 2.0, .inverse_inertia = {3, 0, 0, 0, 3, 0, 0, 0, 3}};
  const double arm[3] = {0.0, 0.0, 0.0};
  const double normals[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  for (int n = 0; n < 3; ++n) {
    double a[6][3] = {{2, 0, 1}, {0, 2, 0}, {0, 0, 0}, {0, 0, 0}, {0, 0, 0}, {0, 0, 0}};
    double before[6][3];
    memcpy(before, a, sizeof a);
    CHECK(hapi_admittance_tidy_point(&body, arm, normals[n], a) == HAPI_ADMITTANCE_GOOD);
    CHECK(memcmp(a, before, sizeof a) == 0);
  }
}

/* ---- another body ---- */

/* Of two bodies that constraints tie together: what a force at an arm of the first does to the
 * second. */
static void bodies_tied(const hapi_free_body bodies[2], int constraints, const double arm[3],
                        double out[6][3])
{
  double r[12][12] = {{0.0}};
  double second[6][6];
  for (int b = 0; b < 2; ++b) {
    for (int i = 0; i < 3; ++i) {
      r[6 * b + i][6 * b + i] = bodies[b].inverse_mass;
      for (int k = 0; k < 3; ++k) {
        r[6 * b + 3 + i][6 * b + 3 + k] = bodies[b].inverse_inertia[3 * i + k];
      }
    }
  }
  for (int c = 0; c < constraints; ++c) {
    double j[12];
    double answer[12] = {0.0};
    double size = 0.0;
    for (int i = 0; i < 12; ++i) {
      const hapi_free_body *body = &bodies[i / 6];
      double length = sqrt(body->inverse_mass / body->inverse_inertia[0]);
      j[i] = random_number() * (i % 6 < 3 ? 1.0 : length);
    }
    for (int i = 0; i < 144; ++i) {
      answer[i / 12] += r[i / 12][i % 12] * j[i % 12];
    }
    for (int i = 0; i < 12; ++i) {
      size += j[i] * answer[i];
    }
    for (int i = 0; i < 144; ++i) {
      r[i / 12][i % 12] -= answer[i / 12] * answer[i % 12] / size;
    }
  }
  for (int i = 0; i < 6; ++i) {
    memcpy(second[i], r[6 + i], sizeof second[i]);
  }
  at_arm(second, arm, out);
}

TEST(what_ties_a_body_to_another_is_left_alone)
{
  double most = 0.0;
  for (int round = 0; round < 400; ++round) {
    double size = sizes[round % 4];
    const hapi_free_body bodies[2] = {random_body(size), random_body(size)};
    double a[6][3];
    double before[6][3];
    double arm[3];
    double share = -1.0;
    random_vector(arm);
    hapi_v3_scale(size, arm, arm);
    bodies_tied(bodies, round % 11, arm, a);
    memcpy(before, a, sizeof a);
    CHECK(hapi_admittance_tidy_cross(&bodies[0], arm, &bodies[1], a, &share) ==
          HAPI_ADMITTANCE_GOOD);
    CHECK(memcmp(a, before, sizeof a) == 0);
    CHECK((share > 1e-3) == (round % 11 > 0) && share <= 0.5 + 1e-9);
    most = fmax(most, share);
  }
  printf("# the largest share is %.4f\n", most);
  CHECK(most > 0.45);
}

TEST(a_block_that_cannot_be_is_cut_or_refused)
{
  const hapi_free_body cube = {.inverse_mass = 2.0, .inverse_inertia = {5, 0, 0, 0, 5, 0, 0, 0, 5}};
  const double arm[3] = {0.0, 0.0, 0.0};
  const struct {
    double share; /* of a cube glued to one like it: half */
    hapi_admittance kind;
    double left;
  } cases[] = {
      {0.5, HAPI_ADMITTANCE_GOOD, 0.5},         {0.74, HAPI_ADMITTANCE_GOOD, 0.74},
      {-0.74, HAPI_ADMITTANCE_GOOD, -0.74},     {0.8, HAPI_ADMITTANCE_CLIPPED, 0.75},
      {-5.0, HAPI_ADMITTANCE_CLIPPED, -0.75},   {11.0, HAPI_ADMITTANCE_SINGULAR, 11.0},
      {1e300, HAPI_ADMITTANCE_SINGULAR, 1e300},
  };
  for (size_t i = 0; i < sizeof cases / sizeof cases[0]; ++i) {
    double a[6][3] = {{0.0}};
    double share = -1.0;
    a[0][1] = 2.0 * cases[i].share;
    CHECK(hapi_admittance_tidy_cross(&cube, arm, &cube, a, &share) == cases[i].kind);
    CHECK_NEAR(a[0][1] / 2.0, cases[i].left, 1e-12 * fabs(cases[i].left));
    CHECK_NEAR(share, cases[i].kind == HAPI_ADMITTANCE_SINGULAR ? 0.0 : fabs(cases[i].left), 1e-9);
  }
  double a[6][3] = {{0.0}};
  double share = -1.0;
  a[5][2] = (double)NAN;
  CHECK(hapi_admittance_tidy_cross(&cube, arm, &cube, a, &share) == HAPI_ADMITTANCE_SINGULAR);
  CHECK(share == 0.0);
}

/* ---- in a world ---- */

/* A probe whose force is so small that it drowns in the rounding of the velocity: a cube at 1
 * m/s gets one unit in the last place where it should have got 0.6. */
TEST(a_singular_probe_keeps_the_last_good_one)
{
  test_world *w = world_new(0.0, 20);
  dBodyID cube = world_add_cube(w, 0.1, 1.0, 0.05, 0.0, 0.0);
  world_start(w, 0.01, -0.02, 0.0, 0.0);
  dBodySetLinearVel(cube, 1.0, 1.0, 1.0);
  hapi_physics *physics = world_physics(w);
  hapi_contact_slot *contact = world_contact(w, cube, 0);
  hapi_body_slot *slot = world_slot(w, cube);
  REQUIRE(contact != NULL && slot != NULL && world_contact_answer(w, contact)->probed);
  double good[6][3];
  memcpy(good, world_contact_answer(w, contact)->a, sizeof good);
  CHECK_NEAR(good[0][0], 1.0, 1e-9);
  for (int round = 0; round < 3; ++round) {
    slot->mass = round == 1 ? 1.35e-16 * w->def.physics_hz / 0.0981 : 1.0;
    contact->speed = 0.0;
    world_measure(w);
    CHECK(physics->probe.counts.singular == (round > 0));
    CHECK_NEAR(physics->probe.contacts.list[contact - physics->near.slots.contacts].measured[0][0],
               round == 1 ? 1.64 : 1.0, 0.05);
    CHECK_NEAR(world_contact_answer(w, contact)->a[0][0], 1.0, 1e-9);
    CHECK(round != 1 || memcmp(good, world_contact_answer(w, contact)->a, sizeof good) == 0);
    memcpy(good, world_contact_answer(w, contact)->a, sizeof good);
  }
}

/* Every contact's A obeys the bounds: tidied once more it stays. */
static void check_contacts(test_world *w)
{
  hapi_physics *physics = world_physics(w);
  for (uint32_t i = 0; i < physics->near.slots.contact_high; ++i) {
    const hapi_contact_slot *c = &physics->near.slots.contacts[i];
    const hapi_contact_answer *answer = world_contact_answer(w, c);
    if (c->phase != HAPI_SLOT_LIVE || !answer->probed || c->body == HAPI_SLOT_NONE) {
      continue;
    }
    dBodyID body = physics->world.bodies.entries[physics->near.slots.bodies[c->body].known].body;
    hapi_free_body free;
    double arm[3];
    double normal[3];
    double a[6][3];
    memcpy(a, answer->a, sizeof a);
    hapi_accelerance_free_body(body, dBodyGetRotation(body), &free);
    hapi_quat_rotate(dBodyGetQuaternion(body), c->point_body, arm);
    hapi_quat_rotate(dBodyGetQuaternion(body), c->normal_body, normal);
    CHECK(hapi_admittance_tidy_point(&free, arm, normal, a) == HAPI_ADMITTANCE_GOOD);
  }
}

/* The same of what a body of model CONTACT answers with. */
static void check_responses(test_world *w, int *measured)
{
  hapi_physics *physics = world_physics(w);
  for (uint32_t i = 0; i < physics->near.slots.body_high; ++i) {
    const hapi_body_slot *slot = &physics->near.slots.bodies[i];
    const hapi_body_answer *answer = world_answer(w, slot);
    if (slot->phase != HAPI_SLOT_LIVE || !answer->measured) {
      continue;
    }
    hapi_free_body free;
    dBodyID body = physics->world.bodies.entries[slot->known].body;
    double response[6][6];
    memcpy(response, answer->response, sizeof response);
    hapi_accelerance_free_body(body, dBodyGetRotation(body), &free);
    CHECK(hapi_admittance_tidy_body(&free, response) == HAPI_ADMITTANCE_GOOD);
    for (int k = 0; k < 36; ++k) {
      CHECK(answer->response[k / 6][k % 6] == answer->response[k % 6][k / 6]);
    }
    ++*measured;
  }
}

/* A cube pressed 0.2 mm into two walls and the floor, or one held by two hinges that are the
 * same and a fixed joint: more constraints than the body has ways to move, and CFM 0. */
static void build_overdetermined(test_world *w, bool walls)
{
  dBodyID cube = world_add_cube(w, 0.1, 1.0, 0.0, 0.0, 0.05);
  dWorldSetCFM(w->world, 0.0);
  dCreatePlane(w->space, 0.0, 0.0, 1.0, 0.0);
  if (walls) {
    dGeomSetPosition(dCreateBox(w->space, 0.1, 1.0, 1.0), 0.0998, 0.0, 0.5);
    dGeomSetPosition(dCreateBox(w->space, 1.0, 0.1, 1.0), 0.0, 0.0998, 0.5);
    dGeomSetPosition(dCreateBox(w->space, 1.0, 0.1, 1.0), 0.0, -0.0998, 0.5);
    return;
  }
  /* A free one beside it, for which model CONTACT probes it. */
  (void)world_add_cube(w, 0.1, 1.0, 0.0, 0.1, 0.05);
  for (int i = 0; i < 2; ++i) {
    dJointID hinge = dJointCreateHinge(w->world, NULL);
    dJointAttach(hinge, cube, NULL);
    dJointSetHingeAnchor(hinge, 0.05, 0.0, 0.05);
    dJointSetHingeAxis(hinge, 0.0, 0.0, 1.0);
  }
  dJointID fixed = dJointCreateFixed(w->world, NULL);
  dJointAttach(fixed, cube, NULL);
  dJointSetFixed(fixed);
  add_unknown_shape(w->space, cube); /* else the loop would own it */
}

TEST(an_overdetermined_body_stays_in_bounds)
{
  for (int i = 0; i < 8; ++i) {
    int iterations = i % 4 < 2 ? 5 : 50;
    test_world *w = world_new(9.81, iterations);
    w->def.model = i / 4 == 0 ? HAP_MODEL_ACCELERANCE : HAP_MODEL_CONTACT;
    build_overdetermined(w, i % 2 == 0);
    world_start(w, 0.01, -0.061, 0.02, 0.06);
    double most = 0.0;
    int measured = 0;
    for (int tick = 0; tick < 2000; ++tick) { /* 6 mm into it and out again */
      double x = -0.061 + 0.006 * sin(2.0 * 3.14159265358979 * tick / 1000.0);
      world_move_pointer(w, 0, (const double[3]){x, 0.02, 0.06}, NULL);
      CHECK(hap_session_advance(w->session, 1) == HAP_OK);
      hap_pointer_state state;
      CHECK(hap_pointer_get(w->session, w->pointers[0], &state, sizeof state) == HAP_OK);
      most = fmax(most, hapi_v3_norm(state.wrench.force));
      check_contacts(w);
      check_responses(w, &measured);
    }
    CHECK((measured > 0) == (i / 4 == 1 && i % 2 == 1)); /* the joints of model CONTACT */
    hap_stats stats = world_stats(w);
    printf("# %s, %s, %d iterations: force up to %.2f N, %llu clipped, %llu singular\n",
           hap_model_name(w->def.model), i % 2 == 0 ? "walls" : "joints", iterations, most,
           (unsigned long long)stats.probes.clipped, (unsigned long long)stats.probes.singular);
    /* 5 mm of 1000 N/m; ODE itself shakes the joints with so few iterations */
    CHECK(most > 1.0 && most < (iterations == 5 ? 15.0 : 6.5));
    CHECK(hapi_v3_norm(dBodyGetLinearVel(w->bodies[0])) < 0.5 && stats.faults.count == 0);
    world_close(w);
  }
}

/* ---- equations of a joint ---- */

static void random_spd(double out[6][6])
{
  double half[6][6];
  for (int i = 0; i < 36; ++i) {
    half[i / 6][i % 6] = random_number();
  }
  for (int i = 0; i < 6; ++i) {
    for (int k = 0; k < 6; ++k) {
      out[i][k] = i == k ? 0.1 : 0.0;
      for (int j = 0; j < 6; ++j) {
        out[i][k] += half[i][j] * half[k][j];
      }
    }
  }
}

/* held of rows w with softness c that do not meet each other: sum w w^T / (w free w + c), with
 * each made orthogonal to those before it. */
static void hold_by(const double free[6][6], double rows[6][6], const double softness[6], int count,
                    double out[6][6])
{
  memset(out, 0, 36 * sizeof **out);
  for (int r = 0; r < count; ++r) {
    double answer[6];
    for (int s = 0; s <= r; ++s) {
      for (int i = 0; i < 6; ++i) {
        answer[i] = 0.0;
        for (int k = 0; k < 6; ++k) {
          answer[i] += free[i][k] * rows[s][k];
        }
      }
      double size = 0.0;
      double along = 0.0;
      for (int i = 0; i < 6; ++i) {
        size += rows[s][i] * answer[i];
        along += rows[r][i] * answer[i];
      }
      for (int i = 0; i < 6 && s < r; ++i) {
        rows[r][i] -= along / size * rows[s][i];
      }
      for (int i = 0; i < 36 && s == r; ++i) {
        out[i / 6][i % 6] += rows[r][i / 6] * rows[r][i % 6] / (size + softness[r]);
      }
    }
  }
}

/* Whatever rows come out, together they answer as those that went in. */
TEST(rows_answer_as_the_joint_does)
{
  for (int round = 0; round < 200; ++round) {
    double free[6][6];
    double rows[6][6];
    double softness[6];
    double held[6][6];
    double again[6][6];
    hapi_constraint_row found[6];
    int count = round % 7;
    int out = -1;
    random_spd(free);
    for (int r = 0; r < 6; ++r) {
      softness[r] = round % 3 == 0 ? 0.0 : pow(10.0, 2.0 * random_number());
      for (int i = 0; i < 6; ++i) {
        rows[r][i] = random_number();
      }
    }
    hold_by((const double(*)[6])free, rows, softness, count, held);
    CHECK(hapi_admittance_rows((const double(*)[6])free, (const double(*)[6])held, found, &out) ==
          HAPI_ADMITTANCE_GOOD);
    CHECK(out == count);
    for (int r = 0; r < out; ++r) {
      memcpy(rows[r], found[r].wrench, sizeof rows[r]);
      softness[r] = found[r].softness;
      double size = fmax(hapi_v3_norm(rows[r]), hapi_v3_norm(rows[r] + 3));
      CHECK_NEAR(size, 1.0, 1e-12);
      CHECK(softness[r] >= 0.0 && (round % 3 != 0 || softness[r] < 1e-9));
    }
    hold_by((const double(*)[6])free, rows, softness, out, again);
    for (int i = 0; i < 36; ++i) {
      CHECK_NEAR(again[i / 6][i % 6], held[i / 6][i % 6], 1e-7);
    }
  }
}

TEST(rows_of_what_is_no_joint_are_refused)
{
  double free[6][6];
  double held[6][6] = {{0.0}};
  hapi_constraint_row found[6];
  int out = -1;
  random_spd(free);
  held[2][3] = NAN;
  CHECK(hapi_admittance_rows((const double(*)[6])free, (const double(*)[6])held, found, &out) ==
        HAPI_ADMITTANCE_SINGULAR);
  held[2][3] = 0.0;
  held[1][1] = 1e6; /* pushes back more than it was pushed */
  CHECK(hapi_admittance_rows((const double(*)[6])free, (const double(*)[6])held, found, &out) ==
        HAPI_ADMITTANCE_SINGULAR);
  CHECK(out == 0);
  held[1][1] = -0.1 / free[1][1]; /* draws on what gives way */
  CHECK(hapi_admittance_rows((const double(*)[6])free, (const double(*)[6])held, found, &out) ==
        HAPI_ADMITTANCE_CLIPPED);
  CHECK(out == 0);
}
