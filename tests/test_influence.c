/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* What hapode-bench influence compares: bodies that answer otherwise do so by closed forms, and
 * with none of them the world is plain ODE. HAPODE_BENCH: path of the program. */

#include "bench/influence_sim.h"
#include "bench/peers_run.h"
#include "tests/program.h"
#include "tests/tap.h"

#define CUBES 4
#define ITERATIONS 50
#define STEPS 10
#define SETTLED_S 0.2

typedef struct influence_case {
  peer_world world;
  influence_sim sim;
  influence_motion motions[CUBES];
} influence_case;

static void case_begin(influence_case *c)
{
  REQUIRE(peer_world_create("row", CUBES, &c->world));
  REQUIRE(influence_sim_init(&c->sim, &c->world, ITERATIONS));
  influence_sim_save(&c->sim, c->motions);
}

static void case_end(influence_case *c)
{
  influence_sim_finish(&c->sim);
  peer_world_destroy(&c->world);
}

static void case_run(influence_case *c, int steps)
{
  double force[3];
  for (int i = 0; i < steps; ++i) {
    influence_sim_step(&c->sim, 0.0, force); /* the hand rests */
  }
}

static double speed_of(const influence_case *c, size_t box)
{
  return dBodyGetLinearVel(c->sim.ode.bodies[box])[0];
}

TEST(with_all_in_it_is_plain_ode)
{
  bench b = {.quick = true};
  influence_case c;
  peers_run ode;
  const peer_setting setting = {INFLUENCE_TICK_S, ITERATIONS, false, false};
  case_begin(&c);
  REQUIRE(peers_run_engine(&b, &peer_ode, &c.world, &setting, &ode) >= HAP_OK);
  size_t settle = (size_t)lround(c.world.hand.settle_s / INFLUENCE_TICK_S);
  double peak = 0.0;
  dRandSetSeed(1); /* as the other one began */
  for (size_t i = 0; i < settle + 200; ++i) {
    double force[3];
    influence_sim_step(&c.sim, INFLUENCE_TICK_S * (double)i, force);
    if (i >= settle) {
      CHECK_NEAR(force[0], ode.force[i - settle][0], 1e-12);
      peak = fmax(peak, fabs(force[0]));
    }
  }
  CHECK(peak > 1.0);
  peers_run_free(&ode);
  case_end(&c);
}

TEST(pairs_carry_the_weight_and_are_equal_and_opposite)
{
  influence_case c;
  influence_pair *pairs;
  double weight = 0.0;
  size_t between = 0;
  case_begin(&c);
  case_run(&c, (int)lround(SETTLED_S / INFLUENCE_TICK_S));
  pairs = calloc(c.sim.contact_count, sizeof *pairs);
  REQUIRE(pairs != NULL && c.sim.contacts_lost == 0);
  size_t count = influence_sim_pairs(&c.sim, pairs);
  for (size_t i = 0; i < count; ++i) {
    weight += pairs[i].a < 0 ? pairs[i].on_b[2] : 0.0;
    CHECK(pairs[i].a < pairs[i].b);
    between += pairs[i].a >= 0;
    for (int k = 0; k < 3 && pairs[i].a >= 0; ++k) {
      CHECK_NEAR(pairs[i].on_a[k], -pairs[i].on_b[k], 1e-9);
    }
  }
  CHECK(between == CUBES - 1);
  CHECK_NEAR(weight, peer_world_mass(&c.world) * c.world.gravity, 0.01);
  free(pairs);
  case_end(&c);
}

typedef struct answer_row {
  const char *name;
  influence_role role;
  double share; /* of a brace */
  double gets;  /* of what a free body gets */
} answer_row;

static const answer_row answer_rows[] = {
    {"by_its_mass", INFLUENCE_MASS, 0.0, 1.0},     {"keeps_its_twist", INFLUENCE_STAYS, 0.0, 0.0},
    {"braced_by_all", INFLUENCE_BRACED, 1.0, 0.0}, {"braced_by_half", INFLUENCE_BRACED, 0.5, 0.5},
    {"absent", INFLUENCE_ABSENT, 0.0, 0.0},
};

/* The last cube is drawn away from the others, and does not fall. */
TEST_EACH(answer_rows, const answer_row *row)
{
  const double push[6] = {0.5, 0.0, 0.0, 0.0, 0.0, 0.0};
  const size_t last = CUBES - 1;
  influence_case c;
  case_begin(&c);
  influence_sim_set(&c.sim, last - 1, INFLUENCE_ABSENT); /* else it is in contact */
  if (row->role == INFLUENCE_BRACED) {
    influence_sim_brace(&c.sim, last, push, row->share);
  } else {
    influence_sim_set(&c.sim, last, row->role);
  }
  memcpy(c.sim.given[last], push, sizeof push);
  case_run(&c, STEPS);
  double free_speed = STEPS * INFLUENCE_TICK_S * push[0] / c.world.boxes[last].mass;
  CHECK_NEAR(speed_of(&c, last), row->gets * free_speed, 1e-6 * free_speed);
  CHECK_NEAR(dBodyGetLinearVel(c.sim.ode.bodies[last])[2], 0.0, 1e-12);
  influence_sim_restore(&c.sim, c.motions);
  CHECK(speed_of(&c, last) == 0.0);
  case_run(&c, 1);
  CHECK(fabs(speed_of(&c, last)) < 0.1 * free_speed); /* nothing is left of the push */
  case_end(&c);
}

TEST(the_program_knows_its_worlds)
{
  CHECK(run("influence --scene row:3 --out %s", test_folder) == 1);
  CHECK(run("influence --scene pile --out %s", test_folder) == 1);
}

SET_UP
{
  return program_use("HAPODE_BENCH");
}
