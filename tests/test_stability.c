/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Hard points of the stability map, each a row: many contacts at once on a light device. The energy
 * that a point may not make is defined in bench/stability.h; the whole map is hapode-bench's. */

#include "tests/tap.h"

#include <ode/ode.h>

#include "bench/stability.h"
#include "bench/stability_own.h"

#define SECONDS 1.5

typedef struct hard_point {
  const char *what;
  stability_point point;
} hard_point;

#define PROXY .integration = HAP_INTEGRATION_IMPLICIT, .coupling = HAP_COUPLING_PROXY
#define AUTO .integration = HAP_INTEGRATION_AUTO, .coupling = HAP_COUPLING_AUTO
#define GOD .integration = HAP_INTEGRATION_AUTO, .coupling = HAP_COUPLING_GOD_OBJECT
#define VIRTUAL .integration = HAP_INTEGRATION_AUTO, .coupling = HAP_COUPLING_VIRTUAL

/* stiffness, mass, contacts, cubes, layout, hand, delay in ticks, quantum, missed ticks */
static const hard_point points[] = {
    {"as light and stiff as it gets, between two sides",
     {PROXY, 1e6, 1e-3, 64, false, STABILITY_CAGE, STABILITY_NONE, 0, 0, false}},
    {"heavy bodies, real device",
     {AUTO, 1e6, 1e3, 64, false, STABILITY_BACKED, STABILITY_TENSE, 2, 3e-5, true}},
    {"soft: the device holds them without a proxy",
     {AUTO, 1, 1e-3, 8, false, STABILITY_BACKED, STABILITY_RELAXED, 1, 3e-5, true}},
    {"pushed away", {AUTO, 1e6, 1e-3, 8, false, STABILITY_FREE, STABILITY_TENSE, 0.5, 3e-5, true}},
    {"16 light cubes on a floor",
     {PROXY, 1e3, 1e-3, 16, true, STABILITY_BACKED, STABILITY_RELAXED, 0, 0, false}},
    {"32 light cubes on a floor",
     {PROXY, 1e3, 1e-3, 32, true, STABILITY_BACKED, STABILITY_RELAXED, 0, 0, false}},
    {"64 cubes on a floor",
     {PROXY, 1e3, 0.1, 64, true, STABILITY_BACKED, STABILITY_TENSE, 0, 0, false}},
    {"64 light, stiff cubes between two sides",
     {AUTO, 1e6, 1e-3, 64, true, STABILITY_CAGE, STABILITY_NONE, 0, 0, false}},
    {"the same, behind an encoder: they are shaken until not all of them can be the loop's",
     {PROXY, 1e6, 1e-3, 64, true, STABILITY_CAGE, STABILITY_NONE, 0, 3e-5, false}},
    {"64 heavy, soft cubes between two sides, late device",
     {AUTO, 100, 10, 64, true, STABILITY_CAGE, STABILITY_RELAXED, 2, 3e-5, true}},
    {"the same, softer and without a hand",
     {PROXY, 10, 10, 64, true, STABILITY_CAGE, STABILITY_NONE, 1.5, 3e-5, false}},
    {"god-object, light bodies between two sides",
     {GOD, 1e3, 1e-3, 8, false, STABILITY_CAGE, STABILITY_NONE, 0, 0, false}},
    {"god-object, cubes on a floor, real device",
     {GOD, 1e3, 0.1, 8, true, STABILITY_BACKED, STABILITY_TENSE, 2, 3e-5, true}},
    {"god-object, pushed away",
     {GOD, 1e3, 1e-3, 8, false, STABILITY_FREE, STABILITY_TENSE, 0.5, 3e-5, true}},
    {"virtual, light bodies between two sides",
     {VIRTUAL, 1e3, 1e-3, 8, false, STABILITY_CAGE, STABILITY_NONE, 0, 0, false}},
    {"virtual, cubes on a floor, real device",
     {VIRTUAL, 1e3, 0.1, 8, true, STABILITY_BACKED, STABILITY_TENSE, 2, 3e-5, true}},
    {"virtual, pushed away",
     {VIRTUAL, 1e3, 1.0, 8, false, STABILITY_FREE, STABILITY_TENSE, 0.5, 3e-5, true}},
};

static bench unused; /* takes the text of an error */

TEST(hard_points_make_no_energy)
{
  for (size_t i = 0; i < sizeof points / sizeof points[0]; ++i) {
    const stability_point *p = &points[i].point;
    stability_result result;
    REQUIRE(stability_run(&unused, p, SECONDS, &result) >= HAP_OK);
    int pushing = p->layout == STABILITY_CAGE ? p->contacts / 2 : p->contacts;
    printf("# %s: energy ratio %.4f\n", points[i].what, result.energy_ratio);
    CHECK(result.stable);
    CHECK(result.way > 3e-4 && result.way < 3e-3); /* it was pushed, and held */
    CHECK(result.touched >= pushing);
  }
}

/* So that the points above are not stable whatever is done. */
TEST(without_proxy_they_are_unstable)
{
  stability_point point = {HAP_INTEGRATION_EXPLICIT, HAP_COUPLING_DIRECT, 1e3, 0.1, 8,    false,
                           STABILITY_CAGE,           STABILITY_NONE,      0,   0,   false};
  stability_result result;
  REQUIRE(stability_run(&unused, &point, SECONDS, &result) >= HAP_OK);
  CHECK(!result.stable && result.energy_ratio > 1.5);
  point.stiffness = 10.0; /* within what the device holds */
  REQUIRE(stability_run(&unused, &point, SECONDS, &result) >= HAP_OK);
  CHECK(result.stable);
}

TEST(coupling_is_not_softer_than_the_device_allows)
{
  for (int n = 1; n <= 64; n *= 8) {
    stability_point point = {.integration = HAP_INTEGRATION_IMPLICIT,
                             .coupling = HAP_COUPLING_PROXY,
                             .stiffness = 1e3,
                             .mass = 0.1,
                             .contacts = n};
    double felt = 0.0;
    REQUIRE(stability_feel(&unused, &point, &felt) >= HAP_OK);
    double held = 0.8 * STABILITY_DEVICE_DAMPING * STABILITY_HAPTIC_HZ / 0.5;
    double expected = held * 1e3 * n / (held + 1e3 * n);
    CHECK_NEAR(felt, expected, 0.01 * expected);
  }
}

/* The cubes are so near to each other that there is no room for all contacts that may come to
 * be, and only their supports hold them. */
TEST(many_light_cubes_are_all_felt)
{
  static const double masses[] = {1e-3, 1e-2, 0.1};
  for (size_t i = 0; i < sizeof masses / sizeof masses[0]; ++i) {
    stability_point point = {.integration = HAP_INTEGRATION_IMPLICIT,
                             .coupling = HAP_COUPLING_PROXY,
                             .stiffness = 1.0,
                             .mass = masses[i],
                             .contacts = 64,
                             .cubes = true};
    double felt = 0.0;
    REQUIRE(stability_feel(&unused, &point, &felt) >= HAP_OK);
    double held = 0.8 * STABILITY_DEVICE_DAMPING * STABILITY_HAPTIC_HZ / 0.5;
    double expected = held * 64.0 / (held + 64.0);
    printf("# 64 cubes of %g kg: %.4f of %.4f N/m\n", masses[i], felt, expected);
    CHECK_NEAR(felt, expected, 0.01 * expected);
  }
}

/* A sample of the map of own forces, textures and grabs: the steepest, the lightest, the latest. */
TEST(fields_textures_and_grabs_make_no_energy)
{
  int cut = 0;
  for (int field = 0; field < OWN_FIELDS; ++field) {
    for (int i = 0; i < 24; ++i) {
      const own_point p = {.field = (own_field)field,
                           .coupling = HAP_COUPLING_AUTO,
                           .stiffness = i % 2 == 0 ? 1e5 : 100.0,
                           .mass = i / 2 % 3 == 0   ? 0.01
                                   : i / 2 % 3 == 1 ? 0.3
                                                    : 10.0,
                           .haptic_hz = 1000.0,
                           .delay_ticks = i / 6 % 2 == 0 ? 0.0 : 2.0,
                           .floored = true,
                           .hand = i / 12 == 0 ? STABILITY_NONE : STABILITY_RELAXED};
      own_point bound = p;
      own_result result;
      bound.bound = own_field_binds(p.field);
      REQUIRE(own_run(&unused, &bound, 0.6, &result) >= HAP_OK);
      CHECK_SAY(result.bounded && result.stable,
                "%s, %g N/m, %g kg, late by %g, hand %s: ratio %.4f, %.3g N",
                own_field_word(p.field), p.stiffness, p.mass, p.delay_ticks,
                stability_hand_word(p.hand), result.energy_ratio, result.force);
      CHECK(result.refused || result.force > 0.0);
      cut += result.cut;
    }
  }
  CHECK(cut > 0);
}

/* So that the points above are not stable whatever is done: a function that hides how steep it is
 * swings, up to what it promises and no further. */
TEST(an_untold_spring_swings_within_its_promise)
{
  const own_point p = {.field = OWN_UNTOLD,
                       .coupling = HAP_COUPLING_AUTO,
                       .stiffness = 1e5,
                       .mass = 0.3,
                       .haptic_hz = 1000.0,
                       .hand = STABILITY_NONE};
  own_result result;
  REQUIRE(own_run(&unused, &p, 1.0, &result) >= HAP_OK);
  CHECK(result.bounded && result.energy_ratio > 1.1);
}
