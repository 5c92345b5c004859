/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "record/grammar.h"

#include "base/assert.h"

#define TIME_MAX (INT64_MAX / 4)

static bool good_time(int64_t ns)
{
  return ns >= 0 && ns <= TIME_MAX;
}

static const char *take_head(hapi_grammar *g, const hapi_cell *cell)
{
  int64_t now = cell->i[HAPI_TICK_TIME];
  if (cell->kind != (g->begun[HAPI_STREAM_HAPTIC] ? HAPI_CELL_TICK : HAPI_CELL_BEGIN)) {
    return "another cell where a tick should begin";
  }
  if (cell->word >= HAPI_PACKET_MAX) {
    return "a tick of too many cells";
  }
  g->left = cell->word;
  if (cell->kind == HAPI_CELL_BEGIN) {
    return good_time(cell->i[0]) ? NULL : "a start at no time";
  }
  if (cell->u[HAPI_TICK_WINDOW] <= g->window && g->ticks > 0) {
    return "a tick that is not later than the one before";
  }
  if (cell->u[HAPI_TICK_WINDOW] > (uint64_t)TIME_MAX || !good_time(now) ||
      (g->ticks > 0 && now <= g->last_ns)) {
    return "a tick at a time that is not later than the one before";
  }
  g->first_ns = g->ticks == 0 ? now : g->first_ns;
  g->last_ns = now;
  g->window = cell->u[HAPI_TICK_WINDOW];
  ++g->ticks;
  return NULL;
}

static const char *take_haptic(hapi_grammar *g, const hapi_cell *cell)
{
  if (g->left == 0) {
    return take_head(g, cell);
  }
  --g->left;
  if (cell->kind == HAPI_CELL_JOIN && cell->index >= g->pointers) {
    g->pointers = cell->index + 1u;
  }
  bool of_tick = (cell->kind >= HAPI_CELL_LEAVE && cell->kind <= HAPI_CELL_GRAB) ||
                 (cell->kind >= HAPI_CELL_OUTPUTS && cell->kind <= HAPI_CELL_AXES);
  return !of_tick            ? "a cell that belongs in no tick"
         : cell->index >= 16 ? "a pointer beyond the 16 that there can be"
                             : NULL;
}

static const char *take_cycle(hapi_grammar *g, const hapi_cell *cell)
{
  uint64_t state = cell->u[HAPI_CYCLE_STATE];
  if (!good_time(cell->i[HAPI_CYCLE_TIME]) || !good_time(cell->i[HAPI_CYCLE_NEXT]) ||
      cell->i[HAPI_CYCLE_NEXT] < cell->i[HAPI_CYCLE_TIME]) {
    return "a physics step that goes back in time";
  }
  if (state != 0 && state <= g->state) {
    return "a physics step with a message that it had before";
  }
  g->state = state != 0 ? state : g->state;
  g->edits += cell->word + (cell->u[HAPI_CYCLE_LOCKS] & 0xffffffffu);
  g->cycling = true;
  return NULL;
}

static const char *take_cycled(hapi_grammar *g, const hapi_cell *cell)
{
  uint64_t model = cell->u[HAPI_CYCLED_MODEL];
  if (model != 0 && model != g->model + 1) {
    return "a physics step with another model than the next one";
  }
  if (!good_time(cell->i[HAPI_CYCLED_SENT])) {
    return "a physics step that told its model at no time";
  }
  g->model = model != 0 ? model : g->model;
  g->cycling = false;
  return NULL;
}

static const char *take_physics(hapi_grammar *g, const hapi_cell *cell)
{
  bool begun = g->begun[HAPI_STREAM_PHYSICS];
  hapi_cell_kind wanted = !begun       ? HAPI_CELL_WORLD
                          : g->cycling ? HAPI_CELL_CYCLED
                                       : HAPI_CELL_CYCLE;
  if (cell->kind != wanted) {
    return "another cell where a physics step should be";
  }
  if (begun) {
    return g->cycling ? take_cycled(g, cell) : take_cycle(g, cell);
  }
  g->model = 1;
  g->start_ns = cell->i[HAPI_WORLD_TIME];
  return good_time(cell->i[HAPI_WORLD_TIME]) ? NULL : "a start at no time";
}

static const char *take_contact(hapi_grammar *g, const hapi_cell *cell)
{
  if (cell->kind != HAPI_CELL_PASS) {
    return "another cell where a contact pass should be";
  }
  if (cell->u[HAPI_PASS_NUMBER] != g->pass + 1 || cell->u[HAPI_PASS_POSES] < g->poses ||
      cell->u[HAPI_PASS_NEAR] < g->near || !good_time(cell->i[HAPI_PASS_VALID])) {
    return "a contact pass with messages out of order";
  }
  g->pass = cell->u[HAPI_PASS_NUMBER];
  g->poses = cell->u[HAPI_PASS_POSES];
  g->near = cell->u[HAPI_PASS_NEAR];
  return NULL;
}

/* Behind a cell that verdicts follow. */
static bool verdicts_expected(const hapi_grammar *g, hapi_stream stream)
{
  return g->judged[stream] || g->verdicts[stream] > 0;
}

static const char *take_verdicts(hapi_grammar *g, hapi_stream stream, const hapi_cell *cell)
{
  if (cell->kind != (g->judged[stream] ? HAPI_CELL_VERDICTS : HAPI_CELL_VERDICT)) {
    return "another cell where a verdict should be";
  }
  if (g->judged[stream] && cell->word > HAPI_VERDICTS_MOST) {
    return "verdicts without end";
  }
  g->verdicts[stream] = g->judged[stream] ? cell->word : g->verdicts[stream] - 1;
  g->judged[stream] = false;
  return NULL;
}

static const char *take_first(hapi_grammar *g, hapi_stream stream, const hapi_cell *cell)
{
  if (stream == HAPI_STREAM_HAPTIC) {
    return take_haptic(g, cell);
  }
  g->judged[stream] = cell->kind != HAPI_CELL_CYCLE && cell->index == 1;
  return stream == HAPI_STREAM_PHYSICS ? take_physics(g, cell) : take_contact(g, cell);
}

const char *hapi_grammar_take(hapi_grammar *grammar, hapi_stream stream, const hapi_cell *cell)
{
  HAPI_ASSERT_INDEX(stream, HAPI_STREAMS);
  const char *wrong = verdicts_expected(grammar, stream) ? take_verdicts(grammar, stream, cell)
                                                         : take_first(grammar, stream, cell);
  grammar->begun[stream] = true;
  ++grammar->cells[stream];
  return wrong;
}
