/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "accuracy/room.h"

#include <math.h>

#include "base/assert.h"

/* A tick has a period, and no more. Its work is counted in row updates of the solver. What a row
 * update takes is assumed in drive LOCKSTEP, and measured otherwise: the pace. Two things follow.
 *
 * The solves of a tick share the work that its rows leave. The next tick goes on with what they
 * leave undone, so this costs little of the force.
 *
 * The range owns no more bodies than three quarters of the work are enough for with the fewest
 * sweeps. A smaller range costs much of the force: bodies at its border give way too easily. So it
 * moves a few bodies a cycle, and there is a gap between growing and shrinking, or the border would
 * move at each cycle.
 *
 * Ticks may still be late, as their times spread and cores are taken away. Then solves leave a
 * margin. The range does not: the force is worth more than a tick of a thousand. */

#define UPDATE_NS 6.0      /* of rows in packs 4 to 5, of joints 7 to 10; a processor of 2.6 GHz */
#define TICK_SHARE 0.8     /* of the period; the rest is for devices, messages and late wake-ups */
#define RANGE_SHARE 0.75   /* of that: sweeps beyond the fewest, and ticks that take longer */
#define SOLVE_SHARE 0.75   /* likewise: a tick may make a second solve */
#define ROWS_PER_BODY 40.0 /* at the start: of a body in a pile, with some room */
#define PLACED_ROWS_PER_BODY 60.0 /* at the start, for places: a brick with 20 contacts */
#define ROWS_PER_CONTACT 3.0
#define PLACES_SHARE 0.9 /* contacts that are near and do not touch need places too */
#define BODIES_LEAST 16u
#define FULL 1.0      /* above: the range shrinks */
#define AIRY 0.75     /* below: it may grow */
#define SHRINKS_BY 8u /* at most one of so many, in a cycle */
#define GROWS_BY 16u
#define LOOK_TICKS 100u
#define LONG_TICKS 1000u
#define LATE_MOST 4.0 /* ticks of LONG_TICKS that may be late */
#define FAR_LATE 1.5  /* one step at a time */
#define BUSY 0.25     /* of a tick's work: with less of it, its time says nothing about the pace */

double hapi_room_update_ns(int pace)
{
  HAPI_ASSERT(pace >= HAPI_PACE_LEAST && pace <= HAPI_PACE_MOST + HAPI_MARGIN_MOST);
  return UPDATE_NS * pow(2.0, 0.5 * pace);
}

uint64_t hapi_room_work(int pace, double haptic_hz)
{
  return (uint64_t)(1e9 * TICK_SHARE / haptic_hz / hapi_room_update_ns(pace));
}

uint32_t hapi_room_updates(const hapi_room *room, const hapi_cycle *cycle,
                           const hapi_settings *settings)
{
  double all = (double)hapi_room_work(room->pace + room->margin, cycle->config->haptic_hz);
  uint64_t most = (uint64_t)(SOLVE_SHARE * all);
  bool told = cycle->state != NULL && cycle->state->work.ticks > 0;
  uint64_t wanted = told ? settings->updates_per_row * (uint64_t)cycle->state->work.rows : most;
  wanted = settings->updates_per_row == 0 ? 0 : wanted < most ? wanted : most;
  return wanted > settings->row_updates ? (uint32_t)wanted : settings->row_updates;
}

/* That a tick has time for. */
static double rows_of_time(int pace, const hapi_physics_config *config)
{
  return RANGE_SHARE * (double)hapi_room_work(pace, config->haptic_hz) / HAPI_ROW_WORK;
}

/* That the messages have places for. */
static double rows_of_places(const hapi_physics_config *config)
{
  return PLACES_SHARE * ROWS_PER_CONTACT * config->capacity.contacts;
}

static double room_rows(int pace, const hapi_physics_config *config)
{
  return fmin(rows_of_time(pace, config), rows_of_places(config));
}

void hapi_room_reset(hapi_room *room, const hapi_physics_config *config)
{
  double bodies =
      fmin(rows_of_time(0, config) / ROWS_PER_BODY, rows_of_places(config) / PLACED_ROWS_PER_BODY);
  *room = (hapi_room){.pace = 0};
  room->bodies = bodies < config->max_bodies ? (uint32_t)bodies : config->max_bodies;
  room->bodies = room->bodies > BODIES_LEAST ? room->bodies : BODIES_LEAST;
}

int hapi_room_pace(hapi_turn *turn, int pace, const hapi_tick_work *told, double period_s)
{
  double ticks = (double)told->ticks;
  double room_ns = 1e9 * TICK_SHARE * period_s * ticks;
  double due_ns = hapi_room_update_ns(pace) * (double)told->done;
  bool busy = due_ns >= BUSY * room_ns;
  double load = told->spent_ns / fmax(due_ns, BUSY * room_ns);
  if (load <= 1.0 && (!busy || told->ticks < LONG_TICKS)) {
    return pace;
  }
  pace += hapi_turn_by(turn, load, ticks * period_s);
  return pace < HAPI_PACE_LEAST ? HAPI_PACE_LEAST : pace > HAPI_PACE_MOST ? HAPI_PACE_MOST : pace;
}

int hapi_room_margin(hapi_turn *turn, int margin, const hapi_tick_work *told, double period_s)
{
  double load = (double)told->late / LATE_MOST;
  if (load <= 1.0 && told->ticks < LONG_TICKS) {
    return margin;
  }
  margin += hapi_turn_by(turn, fmin(load, FAR_LATE), (double)told->ticks * period_s);
  return margin < 0 ? 0 : margin > HAPI_MARGIN_MOST ? HAPI_MARGIN_MOST : margin;
}

void hapi_room_time(hapi_room *room, const hapi_cycle *cycle)
{
  if (cycle->state == NULL || cycle->model != HAP_MODEL_CONTACT) {
    return;
  }
  const hapi_tick_work *all = &cycle->state->work;
  const hapi_tick_work since = {.ticks = all->ticks - room->seen.ticks,
                                .done = all->done - room->seen.done,
                                .spent_ns = all->spent_ns - room->seen.spent_ns,
                                .late = all->late - room->seen.late};
  if (since.ticks < LOOK_TICKS) {
    return;
  }
  double period_s = 1.0 / cycle->config->haptic_hz;
  int pace = hapi_room_pace(&room->turn, room->pace, &since, period_s);
  int margin = hapi_room_margin(&room->late_turn, room->margin, &since, period_s);
  bool turned = pace != room->pace || margin != room->margin;
  room->pace = pace;
  room->margin = margin;
  room->turns += turned;
  if (turned || since.ticks >= LONG_TICKS) {
    room->seen = *all;
  }
}

uint32_t hapi_room_bodies(uint32_t bodies, uint32_t owned, double rows, double most_rows, bool cut)
{
  if (owned > 0 && rows > FULL * most_rows) {
    uint32_t from = owned < bodies ? owned : bodies;
    uint32_t least = from - (from + SHRINKS_BY - 1) / SHRINKS_BY;
    double fits = (double)owned * most_rows / rows;
    least = fits > (double)least ? (uint32_t)fits : least;
    return least > BODIES_LEAST ? least : from < BODIES_LEAST ? bodies : BODIES_LEAST;
  }
  return cut && rows < AIRY * most_rows ? bodies + 1 + bodies / GROWS_BY : bodies;
}

void hapi_room_follow(hapi_room *room, const hapi_cycle *cycle, bool cut)
{
  uint32_t most = cycle->config->max_bodies;
  if (cycle->state == NULL || cycle->model != HAP_MODEL_CONTACT) {
    return;
  }
  /* What rests has no rows until it is woken: then it has as many as the others. */
  const hapi_tick_work *work = &cycle->state->work;
  if (work->awake > 0) {
    double rows = (double)work->rows * work->owned / work->awake;
    room->bodies = hapi_room_bodies(room->bodies, work->owned, rows,
                                    room_rows(room->pace, cycle->config), cut);
  }
  room->bodies = room->bodies < most ? room->bodies : most;
  room->crowded = rows_of_places(cycle->config) < rows_of_time(room->pace, cycle->config);
  room->cut_s = cut && room->bodies < most ? room->cut_s + cycle->probe_step_s : 0.0;
}
