/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* What takes minutes of the stability tests: 1e7 ticks in contact, and sweeps of stiffness, mass
 * and number of contacts. Argument: a seed for the hands and devices of the last sweep. */

#include "tests/tap.h"

#include "bench/stability.h"
#include "tests/stability/run.h"

#define SWEEP_SECONDS 0.5

static uint64_t seed = 1;

static unsigned random_draw(unsigned below)
{
  seed = seed * 6364136223846793005u + 1442695040888963407u;
  return (unsigned)(seed >> 33) % below;
}

/* A hand that presses, rests and lets go, 20000 times. */
TEST(ten_million_ticks_on_a_stack)
{
  const case_row row = {.name = "stack of 3, 1e7 ticks",
                        .build = build_press,
                        .n = 3,
                        .mass = 0.2,
                        .k = 2e3,
                        .hand = RELAXED,
                        .seconds = 1e4,
                        .room = 0.01};
  CHECK(case_holds(&row, HAP_MODEL_CONTACT, ""));
}

static void sweep_case(world_build_fn build, const char *what, case_hand hand)
{
  char name[96];
  for (int i = 0; i <= 6; ++i) {
    for (int j = -3; j <= 3; ++j) {
      const case_row row = {.name = name,
                            .build = build,
                            .n = 1,
                            .mass = pow(10.0, j),
                            .size = 0.2, /* the softest lets the hand in by 50 mm */
                            .k = pow(10.0, i),
                            .hand = hand,
                            .seconds = 2.0,
                            .room = 4.0};
      (void)snprintf(name, sizeof name, "%s, %g kg, %g N/m", what, row.mass, row.k);
      CHECK(case_holds(&row, HAP_MODEL_CONTACT, ""));
    }
  }
}

TEST(sweep_of_a_cube_pressed)
{
  sweep_case(build_press, "pressed", RELAXED);
}

TEST(sweep_of_a_cube_pushed)
{
  sweep_case(build_push, "pushed", TENSE);
}

static bench unused; /* takes the text of an error */

/* Hand, device and layout by chance. */
static stability_point case_choose(double k, double mass, int contacts, bool cubes)
{
  stability_point p = {.integration = HAP_INTEGRATION_AUTO, .coupling = HAP_COUPLING_AUTO};
  p.stiffness = k;
  p.mass = mass;
  p.contacts = contacts;
  p.cubes = cubes;
  p.layout = contacts == 1 ? (stability_layout)random_draw(2) : (stability_layout)random_draw(3);
  p.hand = (stability_hand)random_draw(3);
  if (random_draw(2) == 0) {
    p.integration = HAP_INTEGRATION_IMPLICIT;
    p.coupling = HAP_COUPLING_PROXY;
  }
  p.delay_ticks = 0.5 * random_draw(5);
  p.quantum = random_draw(2) == 0 ? 0.0 : 3e-5;
  p.missed = random_draw(2) == 0;
  return p;
}

static void sweep_point(const stability_point *p)
{
  stability_result result;
  REQUIRE(stability_run(&unused, p, SWEEP_SECONDS, &result) >= HAP_OK);
  if (!result.stable) {
    printf(
        "# %g N/m, %g kg, %d %s, layout %d, hand %s, %s, delay %g ticks, quantum %g, missed %d: "
        "energy ratio %.4f\n",
        p->stiffness, p->mass, p->contacts, p->cubes ? "cubes" : "balls", p->layout,
        stability_hand_word(p->hand), p->coupling == HAP_COUPLING_PROXY ? "proxy" : "auto",
        p->delay_ticks, p->quantum, p->missed, result.energy_ratio);
  }
  CHECK(result.stable);
}

static void sweep_many(bool cubes)
{
  printf("# seed %llu\n", (unsigned long long)seed);
  for (int n = 1; n <= 64; n *= 2) {
    for (int i = 0; i <= 6; ++i) {
      for (int j = -3; j <= 3; ++j) {
        const stability_point p = case_choose(pow(10.0, i), pow(10.0, j), n, cubes);
        sweep_point(&p);
      }
    }
  }
}

TEST(sweep_of_many_balls)
{
  sweep_many(false);
}

TEST(sweep_of_many_cubes)
{
  sweep_many(true);
}

SET_UP
{
  seed = *tap_argument != '\0' ? strtoull(tap_argument, NULL, 10) : seed;
  return true;
}
