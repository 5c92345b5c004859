/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Model contact where something runs out or starts again: capacities, restarts, the application's
 * own will. */

#include "tests/tap.h"

#include <math.h>
#include <string.h>

#include "haptic/haptic_internal.h"
#include "session/session_internal.h"
#include "tests/contact_world.h"
#include "tests/solids.h"
#include "tests/unknown_shape.h"

static double cube_height(const contact_world *w)
{
  return dBodyGetPosition(w->bodies[0])[2];
}

/* A cube on the floor and the hand above it, not in touch. */
static contact_world *open_cube(void)
{
  contact_world *w = cw_new(CW_GRAVITY);
  cw_add_floor(w);
  (void)cw_add_box(w, 0.5, (const double[3]){0.05, 0.05, 0.05}, 0.0, 0.0, 0.025);
  return w;
}

TEST(a_session_that_starts_again_owns_what_it_owned)
{
  contact_world *w = open_cube();
  cw_start(w, 0.0, 0.0, 0.065);
  for (int round = 0; round < 4; ++round) {
    CHECK(hap_session_advance(w->session, round == 1 ? 51 : 120) == HAP_OK);
    CHECK(cw_stats(w).model.range_bodies == 1);
    CHECK_NEAR(cube_height(w), 0.025, 3e-4);
    CHECK(hap_session_stop(w->session) == HAP_OK);
    CHECK(hap_session_start(w->session) >= HAP_OK);
    cw_put_hand(w, 0.0, 0.0, 0.0);
    CHECK(cw_stats(w).faults.count == 0);
  }
}

/* Of these the loop would have no contacts: ODE keeps them. */
TEST(a_convex_body_without_room_for_its_points_stays_on_the_floor)
{
  static box_arrays box;
  for (int room = 0; room < 2; ++room) {
    dMass mass;
    contact_world *w = cw_new(CW_GRAVITY);
    cw_add_floor(w);
    dMassSetBoxTotal(&mass, 0.5, 0.05, 0.05, 0.05);
    w->expert.max_hull_points = room != 0 ? 64 : 0;
    cw_add(w, convex_box(w->space, &box, AT(0.025, 0.025, 0.025)), &mass, 0.0, 0.0, 0.0249);
    cw_start(w, 0.0, 0.0, 0.065);
    CHECK(hap_session_advance(w->session, 1000) == HAP_OK);
    CHECK(cw_stats(w).model.range_bodies == (room != 0 ? 1u : 0u));
    CHECK_NEAR(cube_height(w), 0.025, 1e-3);
    cw_close(w);
  }
}

/* Four cubes a millimetre apart: the floor's sixteen contacts have room, not those to the sides,
 * which come before them in the list. */
TEST(where_contacts_find_no_room_those_that_touch_are_kept)
{
  contact_world *w = cw_new(CW_GRAVITY);
  cw_add_floor(w);
  for (int i = 0; i < 4; ++i) {
    (void)cw_add_cube(w, 0.5, 0.05, 0.051 * (i % 2), 0.051 * (i / 2), 0.025);
  }
  w->def.max_contacts = 18;
  cw_start(w, 0.0, 0.0, 0.065);
  for (int i = 0; i < 300; ++i) {
    cw_tick(w);
    for (int k = 0; k < 4 && i > 50; ++k) {
      CHECK_NEAR(w->position[k][2], 0.025, 3e-4);
    }
  }
  CHECK(w->seen.range_max == 4);
  CHECK(cw_stats(w).model.capacity_dropped > 0);
}

/* Without Approx1 friction is a force of its own: there must be none before the touch. */
/* A block of cubes that touch on all sides. */
TEST(the_most_places_hold_the_contacts_of_a_block)
{
  enum {
    ALONG = 6,
    ACROSS = 6,
    LAYERS = 5 /* with six it stays whole or not by how soon contacts open at the begin */
  };
  const double pitch = 0.05 - 1e-5;
  contact_world *w = cw_new(CW_GRAVITY);
  cw_add_floor(w);
  for (int i = 0; i < ALONG * ACROSS * LAYERS; ++i) {
    dMass mass;
    dBodyID body = dBodyCreate(w->world); /* more of them than w keeps */
    dMassSetBoxTotal(&mass, 0.1, 0.05, 0.05, 0.05);
    dBodySetMass(body, &mass);
    dGeomSetBody(dCreateBox(w->space, 0.05, 0.05, 0.05), body);
    dBodySetPosition(body, 0.025 + pitch * (i % ALONG), pitch * (i / ALONG % ACROSS),
                     0.025 - 1e-5 + pitch * (i / ALONG / ACROSS));
  }
  w->def.max_bodies = ALONG * ACROSS * LAYERS;
  w->def.max_contacts = 8192;
  w->def.physics_hz = 100.0;
  w->def.haptic_hz = 500.0; /* a tick has time for all */
  w->hand_def.radius = 0.01;
  cw_start(w, -0.012, 0.0, 0.025);
  CHECK(hap_session_advance(w->session, 50) == HAP_OK);
  hap_stats stats = cw_stats(w);
  CHECK(stats.model.range_bodies == ALONG * ACROSS * LAYERS && stats.room.range_cut == 0);
  CHECK(stats.model.capacity_dropped == 0);
  CHECK(w->session->haptic->tick.contacts.memory_count > 4096);
  CHECK(stats.faults.count == 0);
}

TEST(a_box_falls_beside_a_wall_that_it_does_not_touch)
{
  contact_world *w = cw_new(CW_GRAVITY);
  w->surface = (dSurfaceParameters){.mode = 0, .mu = dInfinity};
  (void)cw_add_box(w, 0.5, (const double[3]){0.05, 0.05, 0.05}, 0.0, 0.0, 0.0);
  dGeomID wall = dCreateBox(w->space, 0.1, 1.0, 10.0);
  dGeomSetPosition(wall, 0.0755, 0.0, 0.0); /* 0.5 mm away */
  cw_start(w, -0.037, 0.0, 0.0);
  CHECK(hap_session_advance(w->session, 101) == HAP_OK);
  CHECK(cw_stats(w).model.range_bodies == 1);
  CHECK_NEAR(dBodyGetLinearVel(w->bodies[0])[2], -CW_GRAVITY * 0.1, 0.02);
}

TEST(a_body_that_the_application_puts_to_sleep_stays_so)
{
  contact_world *w = open_cube();
  cw_start(w, 0.0, 0.0, 0.065);
  CHECK(hap_session_advance(w->session, 120) == HAP_OK);
  REQUIRE(hap_session_lock(w->session) == HAP_OK);
  dBodyDisable(w->bodies[0]);
  CHECK(hap_session_unlock(w->session) == HAP_OK);
  CHECK(hap_session_advance(w->session, 200) == HAP_OK);
  CHECK(!dBodyIsEnabled(w->bodies[0]));
}

/* A row as one of its bodies has it. */
typedef struct row_side {
  const double *j;
  const double *b;
} row_side;

static bool find_side(const hapi_tick *tick, uint32_t index, uint32_t slot, row_side *out)
{
  const hapi_row *row = &tick->rows.solver.rows[index];
  const hapi_row_source *source = &tick->rows.sources[index];
  bool is_a = source->body_a == slot;
  *out = is_a ? (row_side){row->ja, row->ba} : (row_side){row->jb, row->bb};
  return is_a || (!source->pointer && source->body_b == slot);
}

/* How many rows act on the body beside one of a pointer. What an N s of one makes of the other
 * is what one of the other makes of it. */
static int check_body(const hapi_tick *tick, uint32_t slot)
{
  int met = 0;
  for (uint32_t i = 0; i < tick->rows.solver.row_count; ++i) {
    for (uint32_t k = i + 1; k < tick->rows.solver.row_count; ++k) {
      row_side one;
      row_side other;
      if (tick->rows.sources[i].pointer && find_side(tick, i, slot, &one) &&
          find_side(tick, k, slot, &other)) {
        double size = sqrt(hapi_dot6(one.j, one.b) * hapi_dot6(other.j, other.b));
        CHECK_NEAR(hapi_dot6(one.j, other.b), hapi_dot6(other.j, one.b), 1e-9 * size);
        ++met;
      }
    }
  }
  return met;
}

static int check_measured(const contact_world *w)
{
  const hapi_tick *tick = &w->session->haptic->tick;
  int met = 0;
  for (uint32_t i = 0; i < tick->bodies.live_count; ++i) {
    if ((tick->bodies.of[tick->bodies.live[i]].flags & HAPI_BODY_MEASURED) != 0) {
      met += check_body(tick, tick->bodies.live[i]);
    }
  }
  return met;
}

/* A cube with a shape that the loop does not know, between the hand and another cube: rows that
 * answered each by a measurement of its own would make energy. */
TEST(a_measured_body_answers_all_that_touch_it_alike)
{
  int met = 0;
  contact_world *w = cw_new(CW_GRAVITY);
  cw_add_floor(w);
  dBodyID cube = cw_add_cube(w, 0.2, 0.05, 0.025, 0.0, 0.025);
  add_unknown_shape(w->space, cube);
  (void)cw_add_cube(w, 0.2, 0.05, 0.0755, 0.0, 0.025);
  cw_start(w, -0.012, 0.003, 0.035);
  cw_move_hand(w, 0.1, 0.0, 0.0);
  bool both = false; /* pushed from behind they turn, sooner or later, and lie apart */
  for (int i = 0; i < 300; ++i) {
    cw_tick(w);
    met += check_measured(w);
    both = both || (met > 0 && cw_stats(w).model.measured_bodies == 1 &&
                    cw_stats(w).model.range_bodies == 1);
  }
  CHECK(both);
  CHECK(met > 100);
  CHECK(w->position[1][0] > 0.08); /* it was pushed on */
}

/* The same of a cube that only two hands touch. */
TEST(a_measured_body_answers_two_hands_alike)
{
  const hap_pose pose = {{-0.008, -0.012, 0.0}, {1.0, 0.0, 0.0, 0.0}};
  hap_pointer_id other;
  int met = 0;
  contact_world *w = cw_new(CW_GRAVITY);
  cw_add_floor(w);
  dBodyID cube = cw_add_cube(w, 2.0, 0.05, 0.025, 0.0, 0.025);
  add_unknown_shape(w->space, cube);
  cw_start(w, -0.012, 0.01, 0.03);
  CHECK(hap_pointer_add(w->session, &w->hand_def, &other) == HAP_OK);
  CHECK(hap_pointer_set_target(w->session, other, &pose, NULL) == HAP_OK);
  cw_move_hand(w, 0.02, 0.0, 0.0);
  for (int i = 0; i < 200; ++i) {
    cw_tick(w);
    met += check_measured(w);
  }
  CHECK(cw_stats(w).model.measured_bodies == 1);
  CHECK(met > 10);
}

/* The rest of the row answers with no more than one body's own mass. */
TEST(the_range_ends_after_so_many_contacts)
{
  static const int hops[] = {0, 1, 4, 5, HAP_RANGE_ALL};
  static const uint32_t bodies[] = {1, 2, 5, 6, 6};
  for (size_t i = 0; i < sizeof hops / sizeof hops[0]; ++i) {
    contact_world *w = cw_new(CW_GRAVITY);
    w->def.physics_hz = 100.0;
    w->expert.range_hops = hops[i];
    cw_add_floor(w);
    for (int k = 0; k < 6; ++k) {
      cw_add_cube(w, 1.0, 0.05, 0.05 * k, 0.0, 0.0249);
    }
    cw_start(w, -0.036, 0.0, 0.025);
    cw_run(w, 200);
    CHECK(w->seen.range_min == bodies[i] && w->seen.range_max == bodies[i]);
    CHECK(cw_stats(w).model.edge_bodies == (bodies[i] < 6 ? 1u : 0u));
    cw_close(w);
  }
}

/* Three cubes on a string of hinges, then a free one: one contact away from the first. */
TEST(what_hangs_together_is_one_hop)
{
  for (int hops = 0; hops < 2; ++hops) {
    contact_world *w = cw_new(0.0);
    w->def.physics_hz = 100.0;
    w->expert.range_hops = hops;
    for (int k = 0; k < 4; ++k) {
      cw_add_cube(w, 1.0, 0.05, 0.051 * k, 0.0, 0.0);
    }
    for (int k = 0; k < 2; ++k) {
      dJointID hinge = dJointCreateHinge(w->world, 0);
      dJointAttach(hinge, w->bodies[k], w->bodies[k + 1]);
      dJointSetHingeAnchor(hinge, 0.0255 + 0.051 * k, 0.0, 0.0);
      dJointSetHingeAxis(hinge, 0.0, 0.0, 1.0);
    }
    cw_start(w, -0.036, 0.0, 0.0);
    cw_run(w, 100);
    CHECK(w->seen.range_min == 3u + (uint32_t)hops && w->seen.range_max == 3u + (uint32_t)hops);
    cw_close(w);
  }
}

/* A tower under a hand. A tick has two solves at most; two sweeps alone, without the direct
 * solve that comes next, leave it undone. */
TEST(sweeps_are_no_more_than_asked)
{
  static const int32_t most[] = {0, 2, 3, 10000};
  double sweeps[4];
  double undone[4];
  for (int i = 0; i < 4; ++i) {
    contact_world *w = cw_new(CW_GRAVITY);
    w->expert.max_sweeps = most[i];
    cw_add_floor(w);
    for (int k = 0; k < 6; ++k) {
      cw_add_cube(w, 1.0, 0.05, 0.0, 0.0, 0.0249 + 0.0499 * k);
    }
    cw_start(w, 0.0, 0.0, 0.308);
    cw_run(w, 300);
    hap_stats stats = cw_stats(w);
    CHECK(w->seen.range_max == 6 && fabs(w->force[2]) > 1.0);
    sweeps[i] = (double)stats.contact.sweeps / (double)stats.loop.ticks;
    undone[i] = stats.contact.residual_max;
    cw_close(w);
  }
  printf("# sweeps a tick %.2f %.2f %.2f %.2f, undone %.2g %.2g %.2g %.2g m/s\n", sweeps[0],
         sweeps[1], sweeps[2], sweeps[3], undone[0], undone[1], undone[2], undone[3]);
  CHECK(sweeps[1] <= 4.0 && sweeps[2] <= 6.0);
  CHECK(undone[1] > 10.0 * undone[0]);
  CHECK(sweeps[3] == sweeps[0] && undone[3] == undone[0]);
}
