/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Sweeps and active sets by turns. From the set that sweeps lead to, the impulses go towards the
 * solution of its equations until the first row meets its bound. That row leaves the set, and so
 * on, until the solution is inside all bounds: without friction the energy only falls, and the
 * solution is found. Frictions that slide go with their normals in one turn, and keep the bounds
 * that their normals had before in the next ones: each of the two goes in circles where the other
 * does not. */

#include "solver/bounded.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "solver/contact_solver.h"

#define TURNS 20
#define SWEEPS_OF_TURN 4
#define STEPS_MOST 40  /* from a set: rows that leave it one by one */
#define SOFTENING 1e-7 /* of a row's own response: where contacts hold a thing more than once */

/* The rows inside their bounds, and the frictions that slide along with their normal. */
typedef struct active_set {
  bool lagged; /* frictions have the bounds of when the set was found, and none slides along */
  uint32_t count;
  uint32_t free[HAPI_BOUNDED_MOST];
  double share[HAPI_BOUNDED_MOST]; /* +-mu of a friction that slides along; 0: it does not */
  double lo[HAPI_BOUNDED_MOST];    /* when the set was found */
  double hi[HAPI_BOUNDED_MOST];
} active_set;

/* Impulses and errors to go back to. */
typedef struct bounded_state {
  double impulse[HAPI_BOUNDED_MOST];
  double error[HAPI_BOUNDED_MOST];
} bounded_state;

static hapi_row *bounded_row(const hapi_bounded *b, uint32_t k)
{
  return &b->rows[b->row[k]];
}

static double bounded_response(const hapi_bounded *b, uint32_t k)
{
  return b->answers[(size_t)k * b->count + k];
}

static double bounded_wanted(const hapi_bounded *b, uint32_t k)
{
  const double p = bounded_row(b, k)->impulse;
  const double response = bounded_response(b, k);
  return response > 0.0 ? p + b->error[k] / response : p;
}

static void bounded_push(hapi_bounded *b, uint32_t k, double change)
{
  const double *answers = b->answers + (size_t)k * b->count;
  bounded_row(b, k)->impulse += change;
  for (uint32_t i = 0; i < b->count; ++i) {
    b->error[i] -= change * answers[i];
  }
}

/* The largest correction, m/s. */
static double bounded_sweep(hapi_bounded *b)
{
  double largest = 0.0;
  for (uint32_t k = 0; k < b->count; ++k) {
    double lo;
    double hi;
    hapi_row_bounds(b->rows, bounded_row(b, k), &lo, &hi);
    const double change = hapi_clamp(bounded_wanted(b, k), lo, hi) - bounded_row(b, k)->impulse;
    if (change != 0.0) {
      bounded_push(b, k, change);
    }
    largest = fmax(largest, fabs(change) * bounded_response(b, k));
  }
  return largest;
}

static void state_save(const hapi_bounded *b, bounded_state *out)
{
  for (uint32_t k = 0; k < b->count; ++k) {
    out->impulse[k] = bounded_row(b, k)->impulse;
    out->error[k] = b->error[k];
  }
}

static void state_restore(hapi_bounded *b, const bounded_state *from)
{
  for (uint32_t k = 0; k < b->count; ++k) {
    bounded_row(b, k)->impulse = from->impulse[k];
    b->error[k] = from->error[k];
  }
}

/* ---- active sets ---- */

static bool is_friction(const hapi_bounded *b, uint32_t k)
{
  return b->normal[k] != k;
}

static void limits_of(const hapi_bounded *b, const active_set *s, uint32_t k, double *out_lo,
                      double *out_hi)
{
  if (s->lagged) {
    *out_lo = s->lo[k];
    *out_hi = s->hi[k];
  } else {
    hapi_row_bounds(b->rows, bounded_row(b, k), out_lo, out_hi);
  }
}

static void set_find(const hapi_bounded *b, bool lagged, active_set *out)
{
  bool inside[HAPI_BOUNDED_MOST];
  out->lagged = lagged;
  out->count = 0;
  for (uint32_t k = 0; k < b->count; ++k) {
    const hapi_row *row = bounded_row(b, k);
    hapi_row_bounds(b->rows, row, &out->lo[k], &out->hi[k]);
    const double lo = out->lo[k];
    const double hi = out->hi[k];
    const double wanted = bounded_wanted(b, k);
    inside[k] = (row->impulse > lo && row->impulse < hi) || (wanted > lo && wanted < hi);
    out->share[k] = 0.0;
    if (inside[k]) {
      out->free[out->count++] = k;
    } else if (!lagged && is_friction(b, k) && inside[b->normal[k]] && hi > 0.0 &&
               isfinite(row->mu) && hapi_friction_follows(b->rows, row)) {
      out->share[k] = row->impulse > 0.0 ? row->mu : -row->mu;
    }
  }
}

/* Row k leaves the set at a bound; its frictions go with it, a friction slides along. */
static void set_drop(const hapi_bounded *b, active_set *s, uint32_t k, double change)
{
  uint32_t kept = 0;
  bool pushes = false;
  for (uint32_t i = 0; i < s->count; ++i) {
    const uint32_t other = s->free[i];
    pushes = pushes || other == b->normal[k];
    if (other != k && (s->lagged || b->normal[other] != k)) {
      s->free[kept++] = other;
    }
  }
  s->count = kept;
  for (uint32_t i = 0; i < b->count; ++i) {
    s->share[i] = b->normal[i] == k ? 0.0 : s->share[i];
  }
  if (is_friction(b, k) && pushes && !s->lagged &&
      hapi_friction_follows(b->rows, bounded_row(b, k))) {
    s->share[k] = change > 0.0 ? bounded_row(b, k)->mu : -bounded_row(b, k)->mu;
  }
}

/* Gauss, with pivots of columns. x: in right side, out solution, which is not finite where there is
 * none. */
static void equations_solve(double *a, uint32_t n, double *x)
{
  for (uint32_t k = 0; k < n; ++k) {
    uint32_t best = k;
    for (uint32_t i = k + 1; i < n; ++i) {
      best = fabs(a[(size_t)i * n + k]) > fabs(a[(size_t)best * n + k]) ? i : best;
    }
    for (uint32_t c = k; c < n && best != k; ++c) {
      const double swapped = a[(size_t)k * n + c];
      a[(size_t)k * n + c] = a[(size_t)best * n + c];
      a[(size_t)best * n + c] = swapped;
    }
    const double swapped = x[k];
    x[k] = x[best];
    x[best] = swapped;
    const double inverse = 1.0 / a[(size_t)k * n + k];
    for (uint32_t i = k + 1; i < n; ++i) {
      const double share = a[(size_t)i * n + k] * inverse;
      for (uint32_t c = k + 1; c < n; ++c) {
        a[(size_t)i * n + c] -= share * a[(size_t)k * n + c];
      }
      x[i] -= share * x[k];
    }
  }
  for (uint32_t k = n; k-- > 0;) {
    for (uint32_t c = k + 1; c < n; ++c) {
      x[k] -= a[(size_t)k * n + c] * x[c];
    }
    x[k] /= a[(size_t)k * n + k];
  }
}

/* The changes of all impulses that the set asks for; false: it has no solution. */
static bool set_solve(const hapi_bounded *b, const active_set *s, double out[HAPI_BOUNDED_MOST])
{
  const uint32_t n = s->count;
  uint32_t place[HAPI_BOUNDED_MOST]; /* of a free row */
  double x[HAPI_BOUNDED_MOST];
  double sum = 0.0;
  for (uint32_t c = 0; c < n; ++c) {
    const double *answers = b->answers + (size_t)s->free[c] * b->count;
    place[s->free[c]] = c;
    x[c] = b->error[s->free[c]];
    for (uint32_t i = 0; i < n; ++i) {
      b->set[(size_t)i * n + c] = answers[s->free[i]];
    }
    b->set[(size_t)c * n + c] += SOFTENING * bounded_response(b, s->free[c]);
  }
  for (uint32_t k = 0; k < b->count; ++k) {
    const double *answers = b->answers + (size_t)k * b->count;
    for (uint32_t i = 0; i < n && s->share[k] != 0.0; ++i) {
      b->set[(size_t)i * n + place[b->normal[k]]] += s->share[k] * answers[s->free[i]];
    }
  }
  equations_solve(b->set, n, x);
  memset(out, 0, b->count * sizeof *out);
  for (uint32_t i = 0; i < n; ++i) {
    out[s->free[i]] = x[i];
    sum += x[i] - x[i]; /* 0 for numbers only */
  }
  for (uint32_t k = 0; k < b->count; ++k) {
    out[k] = s->share[k] != 0.0 ? s->share[k] * out[b->normal[k]] : out[k];
  }
  return sum == 0.0;
}

/* How far it may go that way, 0 to 1, and the row that stops it; count: none does. */
static double set_reach(const hapi_bounded *b, const active_set *s, const double *change,
                        uint32_t *out_stop)
{
  double reach = 1.0;
  *out_stop = b->count;
  for (uint32_t k = 0; k < b->count; ++k) {
    const hapi_row *row = bounded_row(b, k);
    const bool widens =
        !s->lagged && is_friction(b, k) && isfinite(row->mu) && hapi_friction_follows(b->rows, row);
    const double wider = widens ? row->mu * change[b->normal[k]] : 0.0;
    const double up = change[k] - wider;
    const double down = -change[k] - wider;
    double lo;
    double hi;
    if (s->share[k] != 0.0 || change[k] == 0.0) {
      continue;
    }
    limits_of(b, s, k, &lo, &hi);
    if (up > 0.0 && hi - row->impulse < reach * up) {
      reach = fmax((hi - row->impulse) / up, 0.0);
      *out_stop = k;
    }
    if (down > 0.0 && row->impulse - lo < reach * down) {
      reach = fmax((row->impulse - lo) / down, 0.0);
      *out_stop = k;
    }
  }
  return reach;
}

/* That far, and onto the bounds where rounding has led beyond. */
static void set_go(hapi_bounded *b, const active_set *s, const double *change, double reach)
{
  for (uint32_t k = 0; k < b->count; ++k) {
    double lo;
    double hi;
    limits_of(b, s, k, &lo, &hi);
    const double before = bounded_row(b, k)->impulse;
    const double step = hapi_clamp(before + reach * change[k], lo, hi) - before;
    if (step != 0.0) {
      bounded_push(b, k, step);
    }
  }
}

static uint32_t set_run(hapi_bounded *b, bool lagged, uint32_t budget)
{
  active_set s;
  double change[HAPI_BOUNDED_MOST];
  uint32_t stop = 0;
  uint32_t cost = 0;
  set_find(b, lagged, &s);
  for (int i = 0; i < STEPS_MOST && s.count > 0 && stop < b->count; ++i) {
    const uint32_t step =
        hapi_bounded_sweep_cost(b) + s.count * s.count * s.count / (3 * HAPI_MADDS_PER_ROW);
    if (step > budget - cost || !set_solve(b, &s, change)) {
      break;
    }
    cost += step;
    const double reach = set_reach(b, &s, change, &stop);
    set_go(b, &s, change, reach);
    if (stop < b->count) {
      set_drop(b, &s, stop, change[stop]);
    }
  }
  return cost;
}

uint32_t hapi_bounded_solve(hapi_bounded *b, uint32_t budget)
{
  const uint32_t sweep = hapi_bounded_sweep_cost(b);
  bounded_state best;
  double least = HUGE_VAL;
  uint32_t cost = 0;
  state_save(b, &best);
  for (int turn = 0; turn < TURNS && sweep <= budget - cost; ++turn) {
    for (int i = 0; i < SWEEPS_OF_TURN && !(least < b->enough) && sweep <= budget - cost; ++i) {
      const double due = bounded_sweep(b);
      cost += sweep;
      if (due < least) {
        least = due;
        state_save(b, &best);
      }
    }
    if (least < b->enough) {
      break;
    }
    cost += set_run(b, turn > 1 && turn % 4 != 3, budget - cost);
  }
  state_restore(b, &best);
  return cost;
}
