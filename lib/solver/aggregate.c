/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "solver/aggregate.h"

#include <math.h>
#include <string.h>

#include "base/assert.h"
#include "base/vec.h"
#include "solver/packs.h"

#define ROUNDS 3         /* of normals that would pull and are left out */
#define PIVOT_LEAST 1e-9 /* of the diagonal */
#define UPDATE_MADDS 12u /* that take as long as a row update */
/* The envelope's width, in the mean: of rows and trees of bodies. In piles more pairs share a load
 * than bodies can tell apart, and steps lead to other shares than sweeps: 30 bricks were 15 % off,
 * and 3 % without steps. */
#define WIDTH_MOST 4u
#define WIDE_PLANS \
  16u /* that are left out after one that came out too wide, while as many units are */
#define NONE UINT16_MAX

/* ---- plan ---- */

/* Which units a body has: two lists through all units, by side. */
typedef struct body_units {
  uint16_t head[HAPI_AGGREGATE_BODIES];
  uint16_t next[HAPI_AGGREGATE_SLOTS][2];
} body_units;

typedef struct unit_bodies {
  uint16_t count;
  uint16_t body[HAPI_AGGREGATE_SLOTS][2]; /* NONE: does not respond */
  uint16_t slot[HAPI_AGGREGATE_SLOTS];
} unit_bodies;

static void units_list(const hapi_packs *packs, unit_bodies *out)
{
  out->count = 0;
  for (uint32_t i = 0; i < packs->unit_count; ++i) {
    const hapi_pack_unit *unit = &packs->units[i];
    const hapi_packable *at = &packs->packables[unit->first];
    if (at->place == HAPI_NO_PLACE) {
      continue;
    }
    uint16_t u = out->count++;
    out->body[u][0] = (uint16_t)at->a;
    out->body[u][1] = unit->paired ? (uint16_t)at->b : NONE;
    out->slot[u] = (uint16_t)(at->pack * HAPI_LANES + at->place % HAPI_LANES);
  }
}

static void units_link(const unit_bodies *units, uint32_t body_count, body_units *out)
{
  memset(out->head, 0xff, body_count * sizeof *out->head);
  for (uint16_t u = units->count; u-- > 0;) {
    for (int side = 0; side < 2; ++side) {
      uint16_t body = units->body[u][side];
      if (body != NONE) {
        out->next[u][side] = out->head[body];
        out->head[body] = u;
      }
    }
  }
}

static int side_of(const unit_bodies *units, uint16_t unit, uint16_t body)
{
  return units->body[unit][0] == body ? 0 : 1;
}

/* Bodies by their distance from the first one; number: NONE where not yet reached. */
static uint16_t bodies_reach(const unit_bodies *units, const body_units *of, uint16_t start,
                             uint16_t base, uint16_t *number, uint16_t *queue)
{
  uint16_t count = 0;
  queue[count++] = start;
  number[start] = base;
  for (uint16_t i = 0; i < count; ++i) {
    uint16_t body = queue[i];
    for (uint16_t u = of->head[body]; u != NONE; u = of->next[u][side_of(units, u, body)]) {
      uint16_t other = units->body[u][1 - side_of(units, u, body)];
      if (other != NONE && number[other] == NONE) {
        number[other] = (uint16_t)(base + count);
        queue[count++] = other;
      }
    }
  }
  return count;
}

/* From one end of each island on: the last body that is reached from anywhere is one. */
static void bodies_number(const unit_bodies *units, const body_units *of, uint32_t body_count,
                          uint16_t *number)
{
  uint16_t queue[HAPI_AGGREGATE_BODIES];
  uint16_t base = 0;
  memset(number, 0xff, body_count * sizeof *number);
  for (uint16_t u = 0; u < units->count; ++u) {
    uint16_t start = units->body[u][0];
    if (number[start] != NONE) {
      continue;
    }
    uint16_t count = bodies_reach(units, of, start, base, number, queue);
    uint16_t end = queue[count - 1];
    for (uint16_t i = 0; i < count; ++i) {
      number[queue[i]] = NONE;
    }
    base = (uint16_t)(base + bodies_reach(units, of, end, base, number, queue));
  }
}

/* Units by the lower number of their bodies. */
static void units_sort(const unit_bodies *units, const uint16_t *number, uint16_t *out_order)
{
  uint16_t begins[HAPI_AGGREGATE_BODIES + 1] = {0};
  uint16_t key[HAPI_AGGREGATE_SLOTS];
  for (uint16_t u = 0; u < units->count; ++u) {
    uint16_t a = number[units->body[u][0]];
    uint16_t b = units->body[u][1] != NONE ? number[units->body[u][1]] : NONE;
    key[u] = a < b ? a : b;
    ++begins[key[u] + 1];
  }
  for (uint32_t k = 1; k <= HAPI_AGGREGATE_BODIES; ++k) {
    begins[k] = (uint16_t)(begins[k] + begins[k - 1]);
  }
  for (uint16_t u = 0; u < units->count; ++u) {
    out_order[begins[key[u]]++] = u;
  }
}

/* False: too many. */
static bool neighbours_find(hapi_aggregate *out, const unit_bodies *units, const body_units *of,
                            const uint16_t *order)
{
  uint16_t row[HAPI_AGGREGATE_SLOTS];
  for (uint16_t i = 0; i < units->count; ++i) {
    row[order[i]] = i;
  }
  for (uint16_t i = 0; i < units->count; ++i) {
    uint16_t u = order[i];
    out->first[i] = i;
    for (int side = 0; side < 2; ++side) {
      uint16_t body = units->body[u][side];
      for (uint16_t w = body != NONE ? of->head[body] : NONE; w != NONE;) {
        int other = side_of(units, w, body);
        if (row[w] < i) {
          if (out->neighbour_count == HAPI_AGGREGATE_NEIGHBOURS) {
            return false;
          }
          out->neighbours[out->neighbour_count++] =
              (hapi_aggregate_neighbours){i, row[w], (uint8_t)side, (uint8_t)other};
          out->first[i] = row[w] < out->first[i] ? row[w] : out->first[i];
        }
        w = of->next[w][other];
      }
    }
  }
  return true;
}

/* Places of the rows in the matrix; false: too large, or too wide. */
static bool rows_place(hapi_aggregate *out, uint32_t rows, uint32_t contacts)
{
  uint32_t at = 0;
  uint64_t madds = 6 * (uint64_t)(out->neighbour_count + 3 * rows);
  for (uint32_t i = 0; i < rows; ++i) {
    uint32_t width = i - out->first[i];
    out->begin[i] = at;
    at += width + 1;
    madds += (uint64_t)width * width / 2 + 3 * width;
  }
  uint64_t cost = 2 * contacts + madds / UPDATE_MADDS;
  out->cost = (uint32_t)cost;
  return at <= HAPI_AGGREGATE_MATRIX && at <= (WIDTH_MOST + 1) * rows;
}

/* False: too large or too wide. */
static bool plan_make(const hapi_packs *packs, hapi_aggregate *out)
{
  unit_bodies units;
  body_units of;
  uint16_t number[HAPI_AGGREGATE_BODIES];
  uint16_t order[HAPI_AGGREGATE_SLOTS];
  uint32_t bodies = packs->known.body_count;
  if (packs->count * HAPI_LANES > HAPI_AGGREGATE_SLOTS || bodies > HAPI_AGGREGATE_BODIES) {
    return false;
  }
  units_list(packs, &units);
  units_link(&units, bodies, &of);
  bodies_number(&units, &of, bodies, number);
  units_sort(&units, number, order);
  if (!neighbours_find(out, &units, &of, order) ||
      !rows_place(out, units.count, packs->contact_count)) {
    return false;
  }
  for (uint16_t i = 0; i < units.count; ++i) {
    out->slot[i] = units.slot[order[i]];
  }
  out->count = units.count;
  return true;
}

void hapi_aggregate_plan(hapi_packs *packs)
{
  hapi_aggregate *out = packs->aggregate;
  hapi_aggregate_wide *wide = &out->wide;
  out->count = out->neighbour_count = 0;
  if (wide->plans > 0 && 10 * packs->unit_count >= 9 * wide->units) {
    --wide->plans;
    return;
  }
  bool made = plan_make(packs, out);
  wide->plans = made ? 0 : WIDE_PLANS;
  wide->units = made ? 0 : packs->unit_count;
}

/* ---- step ---- */

/* m/s of the body's side in one row by an impulse of another row there. */
static double side_response(const hapi_aggregate_row *row, int side,
                            const hapi_aggregate_row *other, int other_side)
{
  double linear = row->mass[side] * hapi_v3_dot(row->linear, other->linear);
  return (side == other_side ? linear : -linear) +
         hapi_v3_dot(row->turn[side], other->spin[other_side]);
}

static void matrix_make(hapi_aggregate *w)
{
  uint32_t last = w->begin[w->count - 1] + w->count - 1 - w->first[w->count - 1];
  memset(w->matrix, 0, (last + 1) * sizeof *w->matrix);
  for (uint32_t i = 0; i < w->count; ++i) {
    const hapi_aggregate_row *row = &w->rows[w->slot[i]];
    w->matrix[w->begin[i] + i - w->first[i]] =
        side_response(row, 0, row, 0) + side_response(row, 1, row, 1) + row->softness;
    w->out[i] = !(row->sum > 0.0);
  }
  for (uint32_t n = 0; n < w->neighbour_count; ++n) {
    const hapi_aggregate_neighbours *at = &w->neighbours[n];
    w->matrix[w->begin[at->row] + at->before - w->first[at->row]] += side_response(
        &w->rows[w->slot[at->row]], at->side, &w->rows[w->slot[at->before]], at->side_before);
  }
}

/* L D L^T within the envelope, without the rows that are out. */
static void matrix_factor(hapi_aggregate *w)
{
  for (uint32_t i = 0; i < w->count; ++i) {
    uint32_t first = w->first[i];
    const double *in = &w->matrix[w->begin[i]];
    double *row = &w->factor[w->begin[i]];
    double pivot = in[i - first];
    if (w->out[i]) {
      memset(row, 0, (i - first) * sizeof *row);
      w->inverse[i] = 0.0;
      continue;
    }
    for (uint32_t j = first; j < i; ++j) {
      uint32_t from = first > w->first[j] ? first : w->first[j];
      const double *before = &w->factor[w->begin[j]];
      double sum = in[j - first];
      for (uint32_t k = from; k < j; ++k) {
        sum -= row[k - first] * before[k - w->first[j]];
      }
      row[j - first] = sum;
    }
    for (uint32_t j = first; j < i; ++j) {
      double l = row[j - first] * w->inverse[j];
      pivot -= l * row[j - first];
      row[j - first] = l;
    }
    bool sound = pivot > PIVOT_LEAST * in[i - first];
    w->out[i] = !sound;
    w->inverse[i] = sound ? 1.0 / pivot : 0.0;
    if (!sound) {
      memset(row, 0, (i - first) * sizeof *row);
    }
  }
}

static void matrix_solve(hapi_aggregate *w)
{
  double *x = w->change;
  for (uint32_t i = 0; i < w->count; ++i) {
    const double *row = &w->factor[w->begin[i]];
    x[i] = w->out[i] ? 0.0 : w->rows[w->slot[i]].error;
    for (uint32_t j = w->first[i]; j < i; ++j) {
      x[i] -= row[j - w->first[i]] * x[j];
    }
  }
  for (uint32_t i = 0; i < w->count; ++i) {
    x[i] *= w->inverse[i];
  }
  for (uint32_t i = w->count; i-- > 0;) {
    const double *row = &w->factor[w->begin[i]];
    for (uint32_t j = w->first[i]; j < i; ++j) {
      x[j] -= row[j - w->first[i]] * x[i];
    }
  }
}

/* Rows that would pull stay as they are; false: there are none. */
static bool pulling_leave(hapi_aggregate *w)
{
  bool any = false;
  for (uint32_t i = 0; i < w->count; ++i) {
    if (w->change[i] < -w->rows[w->slot[i]].sum) {
      w->out[i] = any = true;
    }
  }
  return any;
}

/* The part of the step that no row pulls with. */
static double step_length(const hapi_aggregate *w)
{
  double length = 1.0;
  for (uint32_t i = 0; i < w->count; ++i) {
    double sum = w->rows[w->slot[i]].sum;
    if (length * w->change[i] < -sum) {
      length = -sum / w->change[i];
    }
  }
  return length;
}

static void body_push(double *v, double impulse, const hapi_aggregate_row *row, int side)
{
  double linear = (side == 0 ? impulse : -impulse) * row->mass[side];
  hapi_v3_madd(v, linear, row->linear, v);
  hapi_v3_madd(v + 3, impulse, row->spin[side], v + 3);
}

double hapi_aggregate_step(hapi_packs *packs, double (*v)[6])
{
  hapi_aggregate *w = packs->aggregate;
  double slope = 0.0;
  HAPI_ASSERT(w->count > 0);
  packs->work->aggregate(packs, v, w->rows);
  matrix_make(w);
  matrix_factor(w);
  matrix_solve(w);
  for (int round = 1; round < ROUNDS && pulling_leave(w); ++round) {
    matrix_factor(w);
    matrix_solve(w);
  }
  double length = step_length(w);
  for (uint32_t i = 0; i < w->count; ++i) {
    slope += w->change[i] * w->rows[w->slot[i]].error;
  }
  double energy2 = length * (2.0 - length) * slope;
  if (!(energy2 > 0.0 && energy2 < HUGE_VAL)) {
    return 0.0;
  }
  memset(w->growth, 0, packs->count * HAPI_LANES * sizeof *w->growth);
  for (uint32_t i = 0; i < w->count; ++i) {
    const hapi_aggregate_row *row = &w->rows[w->slot[i]];
    const hapi_pack *pack = &packs->of[w->slot[i] / HAPI_LANES];
    uint32_t lane = w->slot[i] % HAPI_LANES;
    double change = length * w->change[i];
    if (change == 0.0) {
      continue;
    }
    w->growth[w->slot[i]] = change / row->sum;
    body_push(v[0] + pack->a[lane], change, row, 0);
    if (pack->paired) {
      body_push(v[0] + pack->b[lane], change, row, 1);
    }
  }
  for (uint32_t p = 0; p < packs->count; ++p) {
    const hapi_pack *pack = &packs->of[p];
    for (uint32_t i = pack->first; i < pack->first + pack->count; ++i) {
      for (uint32_t lane = 0; lane < HAPI_LANES; ++lane) {
        packs->impulse[i][0][lane] += packs->impulse[i][0][lane] * w->growth[p * HAPI_LANES + lane];
      }
    }
  }
  return energy2;
}
