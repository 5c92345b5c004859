/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Mechanisms that touch. Where contacts and stops of a mechanism are many, rounds of active sets go
 * in circles: a contact that is cut at its bound opens all joints, and their errors then say
 * nothing of which contacts push. Plain sweeps take long to close light parts between joints. Here
 * the joints, all rows without bounds, are met throughout. With R small, as in island.c, a unit of
 * impulse on a row with bounds moves the bodies by
 *
 *   x = (I + sum over joints of b_i j_i / (softness_i + R_i))^-1 b
 *
 * and so takes j x from the error of another row. The rows with bounds are solved with these
 * answers (bounded.c), then the impulses of the joints that go with theirs. What R and rounding
 * have left of the errors the next round takes. */

#include "solver/island_reduced.h"

#include <math.h>
#include <string.h>

#include "solver/bounded.h"

#define SOFTENING 1e-6 /* R, relative to the row's own response */
#define ROUNDS 6
#define ENOUGH 0.1 /* of the tolerance: the rows with bounds, as the joints are still to follow */

static uint16_t local_of_b(const hapi_island *is, const hapi_row *row)
{
  return hapi_row_moves_b(row) ? is->local[row->b] : HAPI_NO_BODY;
}

static void answer_push(hapi_island *is, const hapi_row *row, double impulse)
{
  const uint16_t a = is->local[row->a];
  const uint16_t b = local_of_b(is, row);
  if (a != HAPI_NO_BODY) {
    hapi_madd6(is->dv[row->a], impulse, row->ba);
  }
  if (b != HAPI_NO_BODY) {
    hapi_madd6(is->dv[row->b], impulse, row->bb);
  }
}

static double answer_along(const hapi_island *is, const hapi_row *row)
{
  const uint16_t a = is->local[row->a];
  const uint16_t b = local_of_b(is, row);
  return (a != HAPI_NO_BODY ? hapi_dot6(row->ja, is->dv[row->a]) : 0.0) +
         (b != HAPI_NO_BODY ? hapi_dot6(row->jb, is->dv[row->b]) : 0.0);
}

/* Joints are free, all other rows fixed. False: no mechanism, too many rows, or frictions that are
 * one vector. */
static bool bounded_find(hapi_island *is, hapi_bounded *out)
{
  hapi_row *rows = is->solver->rows;
  uint32_t joints = 0;
  out->count = 0;
  for (uint32_t i = is->first; i != HAPI_NO_SOLVER_ROW; i = rows[i].next) {
    const bool bounded = hapi_row_is_bounded(&rows[i]);
    if (rows[i].ball > 0 || rows[i].round > 0 || (bounded && out->count == HAPI_BOUNDED_MOST)) {
      return false;
    }
    rows[i].state = bounded ? HAPI_ROW_FIXED : HAPI_ROW_FREE;
    if (bounded) {
      uint32_t normal = out->count;
      out->row[out->count] = i;
      while (rows[i].normal >= 0 && out->row[normal] != (uint32_t)rows[i].normal) {
        if (normal-- == 0) {
          return false; /* its normal is left out, and so it may not push */
        }
      }
      out->normal[out->count++] = normal;
    } else {
      is->gain[i] = 1.0 / (rows[i].softness + SOFTENING * rows[i].response);
      ++joints;
    }
  }
  return joints > 0 && out->count > 0;
}

/* The answers are symmetric: one half is computed. */
static void answers_find(hapi_island *is, hapi_bounded *b)
{
  const uint32_t n = b->count;
  for (uint32_t k = 0; k < n; ++k) {
    hapi_island_rest(is);
    answer_push(is, &b->rows[b->row[k]], 1.0);
    hapi_island_substitute(is);
    for (uint32_t i = 0; i <= k; ++i) {
      const double answer = answer_along(is, &b->rows[b->row[i]]);
      b->answers[(size_t)k * n + i] = b->answers[(size_t)i * n + k] = answer;
    }
    b->answers[(size_t)k * n + k] += b->rows[b->row[k]].softness;
  }
}

/* What is due on the rows with bounds when the joints are met. */
static void errors_find(hapi_island *is, hapi_bounded *b)
{
  const hapi_row *rows = is->solver->rows;
  hapi_island_rest(is);
  for (uint32_t i = is->first; i != HAPI_NO_SOLVER_ROW; i = rows[i].next) {
    is->error[i] = hapi_row_error(is->solver, &rows[i]);
    if (rows[i].state == HAPI_ROW_FREE) {
      answer_push(is, &rows[i], is->gain[i] * is->error[i]);
    }
  }
  hapi_island_substitute(is);
  for (uint32_t k = 0; k < b->count; ++k) {
    b->error[k] = is->error[b->row[k]] - answer_along(is, &rows[b->row[k]]);
  }
}

/* The impulses of the joints that go with those of the rows with bounds, and all velocities. */
static void joints_close(hapi_island *is)
{
  hapi_row *rows = is->solver->rows;
  hapi_island_rest(is);
  for (uint32_t i = is->first; i != HAPI_NO_SOLVER_ROW; i = rows[i].next) {
    const bool joint = rows[i].state == HAPI_ROW_FREE;
    answer_push(is, &rows[i],
                joint ? is->gain[i] * is->error[i] : rows[i].impulse - is->saved_impulse[i]);
  }
  hapi_island_substitute(is);
  for (uint32_t i = is->first; i != HAPI_NO_SOLVER_ROW; i = rows[i].next) {
    const double change = rows[i].state == HAPI_ROW_FREE
                              ? is->gain[i] * (is->error[i] - answer_along(is, &rows[i]))
                              : rows[i].impulse - is->saved_impulse[i];
    rows[i].impulse = is->saved_impulse[i];
    hapi_row_push(is->solver, &rows[i], change);
  }
}

/* m/s */
static double island_due(const hapi_island *is)
{
  const hapi_row *rows = is->solver->rows;
  double largest = 0.0;
  for (uint32_t i = is->first; i != HAPI_NO_SOLVER_ROW; i = rows[i].next) {
    const double p = rows[i].impulse;
    double lo;
    double hi;
    hapi_row_bounds(rows, &rows[i], &lo, &hi);
    const double wanted = p + hapi_row_error(is->solver, &rows[i]) * rows[i].inverse;
    largest = fmax(largest, fabs(hapi_clamp(wanted, lo, hi) - p) * rows[i].response);
  }
  return largest;
}

uint32_t hapi_island_reduce(hapi_island *is, uint32_t step, uint32_t budget)
{
  const hapi_solver *solver = is->solver;
  hapi_bounded b = {.rows = solver->rows, .enough = ENOUGH * solver->tolerance};
  if (!bounded_find(is, &b)) {
    return 0;
  }
  const size_t square = (size_t)b.count * b.count;
  const uint32_t around = 2 * is->block_count + is->used_rows; /* of a round, beside the rows */
  uint32_t cost = step + b.count * is->block_count + 12 * hapi_bounded_sweep_cost(&b);
  b.answers = is->blocks[is->block_count];
  b.set = b.answers + square;
  if (cost + around >= budget || b.set + square > solver->work + solver->work_count) {
    return 0;
  }
  hapi_island_factor(is);
  answers_find(is, &b);
  for (int round = 0; round < ROUNDS && cost + around < budget; ++round) {
    hapi_island_save(is);
    errors_find(is, &b);
    cost += around + hapi_bounded_solve(&b, budget - cost - around);
    joints_close(is);
    if (island_due(is) < solver->tolerance) {
      break;
    }
  }
  return cost;
}
