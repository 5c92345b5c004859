/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* What a tick has time for: the decisions with loads that are made up, and lockstep sessions, in
 * which work counts and no clock. */

#include "tests/tap.h"

#include "accuracy/room.h"
#include "base/vec.h"
#include "record/cell.h"
#include "tests/contact_world.h"

#define PERIOD 1e-3
#define EDGE 0.05
#define RADIUS 0.01

/* ---- the size of the range ---- */

/* Of a pile whose bodies have so many rows each. */
static uint32_t range_settles(uint32_t bodies, uint32_t pile, double rows_each, double most_rows,
                              uint32_t *out_moves)
{
  *out_moves = 0;
  for (int i = 0; i < 200; ++i) {
    uint32_t owned = bodies < pile ? bodies : pile;
    uint32_t next = hapi_room_bodies(bodies, owned, rows_each * owned, most_rows, owned < pile);
    uint32_t least = owned < bodies ? owned : bodies;
    CHECK(next >= bodies || next + 1 >= least - least / 8); /* a few bodies a cycle */
    CHECK(next <= bodies + 1 + bodies / 16);
    *out_moves = next != bodies ? (uint32_t)i + 1 : *out_moves;
    bodies = next;
  }
  return bodies;
}

TEST(the_range_shrinks_to_what_a_tick_has_time_for_and_stays_there)
{
  uint32_t moves;
  uint32_t bodies = range_settles(256, 300, 30.0, 3000.0, &moves);
  CHECK(bodies <= 100 && bodies > 90 && moves < 20);
}

TEST(the_range_grows_while_there_is_room_and_stays_there)
{
  uint32_t moves;
  uint32_t bodies = range_settles(20, 300, 30.0, 3000.0, &moves);
  CHECK(bodies >= 75 && bodies <= 100 && moves < 60);
}

TEST(a_range_that_holds_all_does_not_grow)
{
  uint32_t moves;
  CHECK(range_settles(128, 100, 1.0, 3000.0, &moves) == 128 && moves == 0);
}

TEST(between_full_and_airy_nothing_moves)
{
  CHECK(hapi_room_bodies(100, 100, 2999.0, 3000.0, true) == 100);
  CHECK(hapi_room_bodies(100, 100, 2251.0, 3000.0, true) == 100);
  CHECK(hapi_room_bodies(100, 100, 2249.0, 3000.0, true) > 100);
  CHECK(hapi_room_bodies(100, 100, 3001.0, 3000.0, true) < 100);
}

TEST(some_bodies_stay_however_little_there_is_room_for)
{
  uint32_t moves;
  CHECK(range_settles(256, 300, 30.0, 0.0, &moves) == 16);
  CHECK(hapi_room_bodies(128, 3, 300.0, 100.0, false) == 128); /* three cannot be fewer */
}

/* ---- the pace ---- */

/* So many ticks of so many row updates, each in ns. */
static int pace_after(hapi_turn *turn, int pace, uint64_t ticks, double updates, double ns)
{
  const hapi_tick_work told = {.ticks = ticks,
                               .done = (uint64_t)(updates * (double)ticks),
                               .spent_ns = updates * ns * (double)ticks};
  return hapi_room_pace(turn, pace, &told, PERIOD);
}

TEST(a_slow_machine_is_noted_at_once)
{
  hapi_turn turn = {0};
  int pace = pace_after(&turn, 0, 100, 80000.0, 7.5);
  CHECK(pace == 1);
  CHECK(pace_after(&turn, pace, 100, 80000.0, 7.5) == pace);
  CHECK(pace_after(&turn, 0, 100, 80000.0, 20.0) == 3);
  CHECK(hapi_room_update_ns(2) > 1.99 * hapi_room_update_ns(0));
  CHECK(hapi_room_work(2, 1000.0) < 0.51 * (double)hapi_room_work(0, 1000.0));
}

TEST(late_ticks_leave_a_margin_although_the_mean_is_good)
{
  hapi_turn turn = {0};
  hapi_tick_work told = {.ticks = 500, .late = 4};
  CHECK(hapi_room_margin(&turn, 0, &told, PERIOD) == 0);
  told.late = 5;
  CHECK(hapi_room_margin(&turn, 0, &told, PERIOD) == 1);
  told.late = 500; /* one step at a time, and no more than some: a core may be taken away */
  int margin = 0;
  for (int i = 0; i < 50; ++i) {
    margin = hapi_room_margin(&turn, margin, &told, PERIOD);
    CHECK(margin <= i + 1);
  }
  CHECK(margin == HAPI_MARGIN_MOST);
  told = (hapi_tick_work){.ticks = 1000};
  for (int i = 0; i < 200; ++i) {
    margin = hapi_room_margin(&turn, margin, &told, PERIOD);
  }
  CHECK(margin == 0);
}

/* A tick with little to do says little about the pace; one that is over nonetheless says enough. */
TEST(idle_ticks_change_nothing)
{
  hapi_turn turn = {0};
  for (int i = 0; i < 100; ++i) {
    CHECK(pace_after(&turn, 0, 1000, 100.0, 100.0) == 0);
    CHECK(pace_after(&turn, 2, 1000, 100.0, 1.0) == 2);
  }
  CHECK(pace_after(&turn, 0, 100, 10000.0, 100.0) == 3);
}

TEST(a_fast_machine_is_believed_after_a_while)
{
  hapi_turn turn = {0};
  CHECK(pace_after(&turn, 0, 999, 80000.0, 2.5) == 0);
  int pace = 0;
  for (int i = 0; i < 60; ++i) {
    pace = pace_after(&turn, pace, 1000, 80000.0, 2.5);
  }
  CHECK(pace < 0 && pace >= HAPI_PACE_LEAST);
  CHECK(pace_after(&turn, pace, 1000, 80000.0, 2.5) == pace); /* 3 ns: no more */
}

TEST(the_pace_has_bounds)
{
  hapi_turn turn = {0};
  int pace = 0;
  for (int i = 0; i < 20; ++i) {
    pace = pace_after(&turn, pace, 100, 40000.0, 1e6);
  }
  CHECK(pace == HAPI_PACE_MOST);
  for (int p = HAPI_PACE_LEAST; p <= HAPI_PACE_MOST; ++p) {
    int margin = HAPI_MARGIN_MOST;
    hapi_cell_pace(hapi_pace_cell(p, margin) | UINT32_MAX, &pace, &margin);
    CHECK(pace == p && margin == HAPI_MARGIN_MOST);
  }
  for (int i = 0; i < 2; ++i) { /* of a file without them, or with what is neither */
    int margin = 1;
    hapi_cell_pace(i == 0 ? 0 : UINT64_MAX, &pace, &margin);
    CHECK(pace == 0 && margin == 0);
  }
}

/* ---- the most of a solve ---- */

static uint32_t updates_at(int pace, uint32_t rows, int percent)
{
  const hapi_knobs knobs = {.range_hops = HAP_BY_ACCURACY, .iterations = HAP_BY_ACCURACY};
  const hapi_physics_config config = {.haptic_hz = 1.0 / PERIOD};
  const hapi_room room = {.pace = pace};
  hapi_state state = {.work = {.ticks = 1, .rows = rows}};
  const hapi_cycle cycle = {.config = &config, .state = &state};
  hapi_settings settings;
  hapi_dial_settings(&knobs, percent, percent, PERIOD, &settings);
  return hapi_room_updates(&room, &cycle, &settings);
}

/* Two sweeps of 20000 rows are 40000 updates: with no more than 20000, what is due stays due. */
TEST(many_rows_get_as_many_updates_each_as_few)
{
  uint32_t most = (uint32_t)hapi_room_work(0, 1.0 / PERIOD);
  CHECK(updates_at(0, 3000, HAPI_DIAL_DEFAULT) == updates_at(0, 0, HAPI_DIAL_DEFAULT));
  CHECK(updates_at(0, 16000, HAPI_DIAL_DEFAULT) == 6 * 16000);
  CHECK(updates_at(0, 60000, HAPI_DIAL_DEFAULT) < most); /* of a second solve */
  CHECK(updates_at(0, 60000, HAPI_DIAL_DEFAULT) > most / 2);
  CHECK(updates_at(2, 60000, HAPI_DIAL_DEFAULT) < most / 2);
  CHECK(updates_at(0, 60000, 100) == updates_at(0, 60000, HAPI_DIAL_DEFAULT));
  CHECK(updates_at(0, 60000, 0) == 600); /* who gives accuracy up has it so */
}

/* ---- sessions ---- */

/* Three layers of cubes, the lowest of side x side. */
static contact_world *pile_new(int side, double haptic_hz)
{
  contact_world *w = cw_new(CW_GRAVITY);
  const double pitch = EDGE + 0.002;
  dWorldSetContactSurfaceLayer(w->world, 1e-3);
  cw_add_floor(w);
  for (int layer = 0; layer < 3; ++layer) {
    for (int i = 0; i < (side - layer) * (side - layer); ++i) {
      int width = side - layer;
      int along = i / width;
      int aside = i % width - side / 2;
      cw_add_cube(w, 0.2, EDGE, pitch * (along + 0.5 * layer), pitch * (aside + 0.5 * layer),
                  (layer + 0.5) * (EDGE - 1e-3));
    }
  }
  w->def.haptic_hz = haptic_hz;
  w->def.physics_hz = 60.0;
  w->hand_def.radius = RADIUS;
  w->hand_velocity[0] = 0.02;
  return w;
}

typedef struct pile_end {
  hap_stats stats;
  double jump; /* N, largest change of the force in a tick */
  double peak; /* N */
  uint32_t range_least;
} pile_end;

static pile_end pile_push(contact_world *w, double seconds)
{
  pile_end end = {.range_least = UINT32_MAX};
  double before[3] = {0.0, 0.0, 0.0};
  cw_start(w, -0.5 * EDGE - RADIUS - 1e-3, 0.0, 0.5 * EDGE);
  for (int i = 0; i < (int)(seconds * w->def.haptic_hz); ++i) {
    double change[3];
    cw_run(w, 1);
    hapi_v3_sub(w->force, before, change);
    end.jump = fmax(end.jump, hapi_v3_norm(change));
    end.peak = fmax(end.peak, hapi_v3_norm(w->force));
    hapi_v3_copy(w->force, before);
    end.range_least = w->seen.range_max > 0 && cw_stats(w).model.range_bodies < end.range_least
                          ? cw_stats(w).model.range_bodies
                          : end.range_least;
  }
  end.stats = cw_stats(w);
  return end;
}

TEST(a_tick_that_has_time_for_all_has_all)
{
  contact_world *w = pile_new(6, 1000.0);
  pile_end end = pile_push(w, 0.3);
  CHECK(end.stats.model.range_bodies == 77 && end.stats.room.range_cut == 0);
  CHECK(end.stats.room.range_most == 138 && end.stats.room.turns == 0);
  CHECK_NEAR(end.stats.room.update_ns, 6.0, 1e-12);
  CHECK(end.stats.room.tick_work == 133333);
}

/* A tick of an eighth of the time. The force goes on without a step, and no body is thrown. */
TEST(a_tick_without_time_for_all_has_as_many_as_it_can)
{
  contact_world *w = pile_new(6, 8000.0);
  pile_end end = pile_push(w, 0.4);
  printf("# range %u, least %u, jump %g N, peak %g N, residual %g m/s\n",
         end.stats.model.range_bodies, end.range_least, end.jump, end.peak,
         end.stats.contact.residual_max);
  CHECK(end.stats.model.range_bodies < 70 && end.stats.model.range_bodies >= 16);
  CHECK(end.stats.room.range_cut == 1);
  CHECK(end.peak > 1.0 && end.jump < 0.5);
  CHECK(end.stats.contact.residual_max < 2.0);
}

/* A border of more bodies than are probed is not probed at all: half of it was thrown out. */
TEST(a_pile_with_a_border_stays_a_pile)
{
  contact_world *w = pile_new(7, 1000.0);
  w->def.max_bodies = 64;
  w->hand_def.damping = 5.0;
  w->hand_velocity[0] = 0.04;
  pile_end end = pile_push(w, 0.6);
  printf("# residual %g m/s, %llu probes\n", end.stats.contact.residual_max,
         (unsigned long long)end.stats.probes.steps);
  CHECK(end.stats.model.range_bodies == 64 && end.stats.room.range_cut == 0);
  CHECK(end.stats.contact.residual_max < 1.0);
  for (int i = 0; i < w->body_count; ++i) {
    CHECK(hapi_v3_norm(dBodyGetLinearVel(w->bodies[i])) < 0.3);
  }
}

/* At a low rate of physics a body is near many more than it touches. */
TEST(a_pile_at_a_low_rate_has_places_for_its_pairs)
{
  contact_world *w = pile_new(7, 1000.0);
  w->def.physics_hz = 20.0;
  w->def.max_contacts = 1536;
  pile_end end = pile_push(w, 0.2);
  CHECK(end.stats.model.range_bodies >= 77);
}
