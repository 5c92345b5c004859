/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Model contact where something runs out or starts again: capacities, restarts, the application's
 * own will. */

#include "tests/tap.h"

#include <math.h>
#include <string.h>

#include "tests/contact_world.h"

static double height(const contact_world *w)
{
  return dBodyGetPosition(w->bodies[0])[2];
}

/* A cube on the floor and the hand above it, not in touch. */
static void open_cube(contact_world *w)
{
  cw_open(w, CW_GRAVITY);
  cw_add_floor(w);
  (void)cw_add_box(w, 0.5, (const double[3]){0.05, 0.05, 0.05}, 0.0, 0.0, 0.025);
}

TEST(a_session_that_starts_again_owns_what_it_owned)
{
  contact_world w;
  open_cube(&w);
  REQUIRE(cw_start(&w, 0.0, 0.0, 0.065));
  for (int round = 0; round < 4; ++round) {
    CHECK(hap_session_advance(w.session, round == 1 ? 51 : 120) == HAP_OK);
    CHECK(cw_stats(&w).range_bodies == 1);
    CHECK_NEAR(height(&w), 0.025, 3e-4);
    CHECK(hap_session_stop(w.session) == HAP_OK);
    CHECK(hap_session_start(w.session) >= HAP_OK);
    cw_put_hand(&w, 0.0, 0.0, 0.0);
    CHECK(cw_stats(&w).faults == 0);
  }
  cw_close(&w);
}

/* Of these the loop would have no contacts: ODE keeps them. */
TEST(a_convex_body_without_room_for_its_points_stays_on_the_floor)
{
  static const dReal planes[] = {1,  0, 0, 0.025, 0, 1,  0, 0.025, 0, 0, 1,  0.025,
                                 -1, 0, 0, 0.025, 0, -1, 0, 0.025, 0, 0, -1, 0.025};
  static const dReal points[] = {.025,  .025,  .025,  .025, -.025, .025,  -.025, .025,
                                 .025,  -.025, -.025, .025, .025,  .025,  -.025, .025,
                                 -.025, -.025, -.025, .025, -.025, -.025, -.025, -.025};
  static const unsigned polygons[] = {4, 0, 2, 3, 1, 4, 0, 1, 5, 4, 4, 0, 4, 6, 2,
                                      4, 7, 5, 1, 3, 4, 7, 3, 2, 6, 4, 7, 6, 4, 5};
  for (int room = 0; room < 2; ++room) {
    contact_world w;
    dMass mass;
    cw_open(&w, CW_GRAVITY);
    cw_add_floor(&w);
    dMassSetBoxTotal(&mass, 0.5, 0.05, 0.05, 0.05);
    w.def.max_hull_points = room != 0 ? 64 : 0;
    cw_add(&w, dCreateConvex(w.space, planes, 6, points, 8, polygons), &mass, 0.0, 0.0, 0.0249);
    REQUIRE(cw_start(&w, 0.0, 0.0, 0.065));
    CHECK(hap_session_advance(w.session, 1000) == HAP_OK);
    CHECK(cw_stats(&w).range_bodies == (room != 0 ? 1u : 0u));
    CHECK_NEAR(height(&w), 0.025, 1e-3);
    cw_close(&w);
  }
}

/* Four cubes a millimetre apart: the floor's sixteen contacts have room, not those to the sides, which
 * come before them in the list. */
TEST(where_contacts_find_no_room_those_that_touch_are_kept)
{
  contact_world w;
  cw_open(&w, CW_GRAVITY);
  cw_add_floor(&w);
  for (int i = 0; i < 4; ++i) {
    (void)cw_add_cube(&w, 0.5, 0.05, 0.051 * (i % 2), 0.051 * (i / 2), 0.025);
  }
  w.def.max_contacts = 18;
  REQUIRE(cw_start(&w, 0.0, 0.0, 0.065));
  for (int i = 0; i < 300; ++i) {
    cw_tick(&w);
    for (int k = 0; k < 4 && i > 50; ++k) {
      CHECK_NEAR(w.position[k][2], 0.025, 3e-4);
    }
  }
  CHECK(w.range_max == 4);
  CHECK(cw_stats(&w).capacity_dropped > 0);
  cw_close(&w);
}

/* Without Approx1 friction is a force of its own: there must be none before the touch. */
TEST(a_box_falls_beside_a_wall_that_it_does_not_touch)
{
  contact_world w;
  cw_open(&w, CW_GRAVITY);
  w.surface = (dSurfaceParameters){.mode = 0, .mu = dInfinity};
  (void)cw_add_box(&w, 0.5, (const double[3]){0.05, 0.05, 0.05}, 0.0, 0.0, 0.0);
  dGeomID wall = dCreateBox(w.space, 0.1, 1.0, 10.0);
  dGeomSetPosition(wall, 0.0755, 0.0, 0.0); /* 0.5 mm away */
  REQUIRE(cw_start(&w, -0.037, 0.0, 0.0));
  CHECK(hap_session_advance(w.session, 101) == HAP_OK);
  CHECK(cw_stats(&w).range_bodies == 1);
  CHECK_NEAR(dBodyGetLinearVel(w.bodies[0])[2], -CW_GRAVITY * 0.1, 0.02);
  cw_close(&w);
}

TEST(a_body_that_the_application_puts_to_sleep_stays_so)
{
  contact_world w;
  open_cube(&w);
  REQUIRE(cw_start(&w, 0.0, 0.0, 0.065));
  CHECK(hap_session_advance(w.session, 120) == HAP_OK);
  REQUIRE(hap_session_lock(w.session) == HAP_OK);
  dBodyDisable(w.bodies[0]);
  CHECK(hap_session_unlock(w.session) == HAP_OK);
  CHECK(hap_session_advance(w.session, 200) == HAP_OK);
  CHECK(!dBodyIsEnabled(w.bodies[0]));
  cw_close(&w);
}

int main(void)
{
  dInitODE2(0);
  RUN(a_session_that_starts_again_owns_what_it_owned);
  RUN(a_convex_body_without_room_for_its_points_stays_on_the_floor);
  RUN(where_contacts_find_no_room_those_that_touch_are_kept);
  RUN(a_box_falls_beside_a_wall_that_it_does_not_touch);
  RUN(a_body_that_the_application_puts_to_sleep_stays_so);
  dCloseODE();
  return tap_done();
}
