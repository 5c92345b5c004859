/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "solver/contact_solver.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "base/assert.h"
#include "base/vec.h"
#include "solver/aggregate.h"
#include "solver/sweep_trend.h"

/* A direct solve follows each of so many sweeps, then only each so-many-th: where the active sets
 * go in circles, sweeps lead out. */
#define DIRECT_ROUNDS 8
#define DEAR_RUNS 32u
#define CALM_UPDATES 4000u /* row updates of hapi_solver_sweep_on, and two sweeps */

/* A direct solve that costs more than this, or makes a run longer than enough, is in vain when it
 * leads to nothing better. After so many such runs, one after the other, direct solves rest, and
 * all of the budget is for sweeps. Of costly ones the rest doubles each time that the next one is
 * in vain as well. */
#define VAIN_COST 4000u /* row updates */
#define VAIN_SWEEPS 8u  /* until the next one: from the same rows it would be in vain as well */
#define VAIN_RUNS 4u
#define VAIN_REST 16u
#define VAIN_REST_MOST 256u

/* A direct solve is made where so many sweeps will not do. It costs 15 to 20; with more than 13 a
 * stack of 30 cubes under a hand gains energy. */
#define DIRECT_SWEEPS 10u
#define DIRECT_FROM 2u  /* sweeps before the first one */
#define PAIRS_EACH 4u   /* sweeps, of steps of all pairs */
#define PAIRS_FALL 0.25 /* of what sweeps correct, from one such step to the next */

/* A run that has taken enough may leave so many times `coarse`, which is four times the drift of
 * the force. It makes no direct solve where so many times the sweeps that one costs will do: the
 * next runs make them. */
#define LEAVE 16.0
#define LEAVE_SWEEPS 3u
#define CHEAP_COST 1000u /* row updates, of such a direct solve */
#define LEAVE_LIGHT 10.0 /* times the largest correction, of things so light that no hand tells */
/* Levels. A higher stack is solved at once, and one by one (packs.c): of eight cubes that a hand
 * leans on, what is left says which of them slide, and the force is off by 0.2 to 6 %. */
#define SPREAD_HEIGHT 7u
/* So is what has more rows, is higher and has no step for all pairs: of a wall of eight levels that
 * is pushed a tick took a sixth longer, as the next runs had more to do. */
#define SPREAD_ROWS 300u
#define SPREAD_LOW 5u

/* ---- preparation ---- */

static bool same_bodies(const hapi_row *row, const hapi_row *other)
{
  return row->a == other->a && row->b == other->b;
}

static bool row_is_valid(const hapi_solver *solver, const hapi_row *row, double d)
{
  return d > 1e-200 && d < 1e200 && hapi_finite(&row->target, 1) && hapi_finite(&row->impulse, 1) &&
         row->softness >= 0.0 && row->a < solver->body_count && row->b < solver->body_count;
}

static bool has_bounds(const hapi_solver *solver, uint32_t index)
{
  const hapi_row *row = &solver->rows[index];
  if (row->normal < 0) {
    return row->lo <= row->hi;
  }
  return row->mu >= 0.0 && row->hi >= 0.0 && row->hi < HUGE_VAL && (uint32_t)row->normal < index &&
         same_bodies(row, &solver->rows[row->normal]);
}

/* A row left out keeps no impulse: its normal's frictions get none either. */
static void row_prepare(hapi_solver *solver, uint32_t index)
{
  hapi_row *row = &solver->rows[index];
  double of_a = hapi_dot6(row->ja, row->ba); /* j A j^T */
  double of_b = row->single ? 0.0 : hapi_dot6(row->jb, row->bb);
  double d = of_a + of_b + row->softness;
  row->inverse = 0.0;
  row->triple = 0;
  row->moves = (uint8_t)((of_a != 0.0 ? HAPI_MOVES_A : 0u) | (of_b != 0.0 ? HAPI_MOVES_B : 0u));
  if (!row_is_valid(solver, row, d) || !has_bounds(solver, index)) {
    row->impulse = 0.0;
    return;
  }
  row->inverse = 1.0 / d;
  row->response = d;
  bool moved = !hapi_row_moves_b(row) && !row->single; /* by a partner that does not respond */
  row->drive = row->target - (moved ? hapi_dot6(row->jb, solver->v[row->b]) : 0.0);
}

static double rows_couple(const hapi_row *row, const hapi_row *other)
{
  double k = hapi_dot6(row->ja, other->ba);
  return hapi_row_moves_b(row) ? k + hapi_dot6(row->jb, other->bb) : k;
}

/* A normal and its two frictions: one update takes all three. `last` is the second friction. */
static void join_triple(hapi_solver *solver, uint32_t last)
{
  int32_t normal = solver->rows[last].normal;
  if (normal < 0 || (uint32_t)normal + 2 != last) {
    return;
  }
  hapi_row *r = &solver->rows[normal];
  bool joins = r[0].inverse != 0.0 && r[0].normal < 0 && r[1].normal == normal && r[1].ball == 0 &&
               r[1].inverse != 0.0 && r[2].inverse != 0.0;
  if (joins) {
    r->triple = HAPI_TRIPLE_ANY;
    r->made = ++solver->packs.known.made;
    r[1].coupling[0] = rows_couple(&r[1], &r[0]);
    r[2].coupling[0] = rows_couple(&r[2], &r[0]);
    r[2].coupling[1] = rows_couple(&r[2], &r[1]);
  }
}

static void impulse_bound(const hapi_solver *solver, hapi_row *row)
{
  double lo;
  double hi;
  hapi_row_bounds(solver->rows, row, &lo, &hi);
  row->impulse = hapi_clamp(row->impulse, lo, hi);
}

static void warm_start(hapi_solver *solver, hapi_row *row)
{
  impulse_bound(solver, row);
  if (row->impulse == 0.0) {
    return;
  }
  hapi_madd6(solver->v[row->a], row->impulse, row->ba);
  if (hapi_row_moves_b(row)) {
    hapi_madd6(solver->v[row->b], row->impulse, row->bb);
  }
}

void hapi_row_ready(hapi_solver *solver, uint32_t index)
{
  row_prepare(solver, index);
  join_triple(solver, index);
  if (solver->rows[index].inverse != 0.0) {
    warm_start(solver, &solver->rows[index]);
  }
}

void hapi_single_ready(hapi_solver *solver, uint32_t index, double response)
{
  hapi_row *row = &solver->rows[index];
  double d = response + row->softness;
  row->inverse = 0.0;
  row->triple = 0;
  row->moves = response != 0.0 ? HAPI_MOVES_A : 0;
  if (!row_is_valid(solver, row, d) || !(row->lo <= row->hi)) {
    row->impulse = 0.0;
    return;
  }
  row->inverse = 1.0 / d;
  row->response = d;
  row->drive = row->target;
  row->impulse = hapi_clamp(row->impulse, row->lo, row->hi);
  if (row->impulse != 0.0) {
    hapi_madd6(solver->v[row->a], row->impulse, row->ba);
  }
}

void hapi_contact_ready(hapi_solver *solver, uint32_t first, uint32_t count, bool by_mass)
{
  hapi_row *r = &solver->rows[first];
  bool may_join = count == 3 && r[1].normal == (int32_t)first && r[2].normal == (int32_t)first;
  for (uint32_t i = 0; i < count; ++i) {
    row_prepare(solver, first + i);
  }
  if (may_join) {
    join_triple(solver, first + 2);
    bool packable = by_mass && hapi_row_moves_a(r) && r[0].lo == 0.0 && r[0].hi == HUGE_VAL &&
                    r[1].mu + r[2].mu < HUGE_VAL;
    r->triple = r->triple && packable ? HAPI_TRIPLE_BY_MASS : r->triple;
    if (r->triple == HAPI_TRIPLE_BY_MASS) {
      hapi_packs_note(&solver->packs, first, true);
    }
  }
  for (uint32_t i = 0; i < count; ++i) {
    if (r->triple) {
      impulse_bound(solver, &r[i]);
    } else if (r[i].inverse != 0.0) {
      warm_start(solver, &r[i]);
    }
  }
  solver->owes = solver->owes || r->triple;
}

/* ---- sweeps ---- */

/* Returns its size, m/s. */
static inline double correction_note(const hapi_row *row, double change, hapi_corrections *io)
{
  double correction = change * row->response;
  double size = fabs(correction);
  io->largest = size > io->largest ? size : io->largest;
  io->energy2 += change * correction;
  return size;
}

/* The rows of a body wait for each other, so that the way from v to v counts: the change is cut by
 * itself and not taken as the difference of two impulses. */
static void row_update(hapi_solver *solver, hapi_row *row, hapi_corrections *io)
{
  if (row->inverse == 0.0) {
    return;
  }
  double lo;
  double hi;
  hapi_row_bounds(solver->rows, row, &lo, &hi);
  double old = row->impulse;
  if (hi == 0.0 && lo == 0.0 && old == 0.0) {
    return; /* friction of a contact that does not push */
  }
  double wanted = hapi_row_error(solver, row) * row->inverse;
  double change = hapi_clamp(wanted, lo - old, hi - old);
  hapi_row_push(solver, row, change);
  row->impulse = hapi_clamp(old + wanted, lo, hi); /* exactly at its bound */
  double size = correction_note(row, change, io);
  if (lo == -HUGE_VAL && hi == HUGE_VAL) {
    io->opening = size > io->opening ? size : io->opening;
  }
}

/* The change of a row's impulse, cut at its bounds. */
static double row_change(hapi_row *row, double error, double lo, double hi)
{
  double old = row->impulse;
  double wanted = error * row->inverse;
  row->impulse = hapi_clamp(old + wanted, lo, hi);
  return hapi_clamp(wanted, lo - old, hi - old);
}

/* v += b0 d0 + b1 d1 + b2 d2 */
static void push_triple(double v[6], const double d[3], const double b0[6], const double b1[6],
                        const double b2[6])
{
  const hapi_two share[3] = {hapi_two_all(d[0]), hapi_two_all(d[1]), hapi_two_all(d[2])};
  for (int k = 0; k < 6; k += 2) {
    hapi_two sum = hapi_two_mul(share[0], hapi_two_load(b0 + k));
    sum = hapi_two_madd(sum, share[1], hapi_two_load(b1 + k));
    sum = hapi_two_madd(sum, share[2], hapi_two_load(b2 + k));
    hapi_two_store(v + k, hapi_two_add(hapi_two_load(v + k), sum));
  }
}

/* As three updates, but the velocities are read and written once: what the first changes do to the
 * later rows comes from the couplings. So the three do not wait for each other's way through v. */
static void update_triple(hapi_solver *solver, hapi_row *r, hapi_corrections *io)
{
  double e[3];
  double d[3];
  for (int i = 0; i < 3; ++i) {
    e[i] = hapi_row_error(solver, &r[i]);
  }
  d[0] = row_change(&r[0], e[0], r[0].lo, r[0].hi);
  if (d[0] == 0.0 && r[0].impulse <= 0.0 && r[1].impulse == 0.0 && r[2].impulse == 0.0 &&
      r[1].hi <= 0.0) {
    return; /* a contact that does not push */
  }
  double load = hapi_max(r[0].impulse, r[1].hi);
  double most = hapi_friction_most(&r[1], load);
  d[1] = row_change(&r[1], e[1] - r[1].coupling[0] * d[0], -most, most);
  most = hapi_friction_most(&r[2], load);
  d[2] = row_change(&r[2], e[2] - r[2].coupling[0] * d[0] - r[2].coupling[1] * d[1], -most, most);
  push_triple(solver->v[r->a], d, r[0].ba, r[1].ba, r[2].ba);
  if (hapi_row_moves_b(r)) {
    push_triple(solver->v[r->b], d, r[0].bb, r[1].bb, r[2].bb);
  }
  for (int i = 0; i < 3; ++i) {
    (void)correction_note(&r[i], d[i], io);
  }
}

/* As three warm starts, but the velocities are read and written once. */
static void triple_start(hapi_solver *solver, const hapi_row *r)
{
  double d[3] = {r[0].impulse, r[1].impulse, r[2].impulse};
  if (d[0] == 0.0 && d[1] == 0.0 && d[2] == 0.0) {
    return;
  }
  push_triple(solver->v[r->a], d, r[0].ba, r[1].ba, r[2].ba);
  if (hapi_row_moves_b(r)) {
    push_triple(solver->v[r->b], d, r[0].bb, r[1].bb, r[2].bb);
  }
}

/* The impulses of triples to v: of packs all at once. */
static void triples_start(hapi_solver *solver)
{
  if (solver->packs.in_use) {
    solver->packs.work->push(&solver->packs, solver->v);
  }
  for (uint32_t i = 0; i < hapi_loose_count(solver); ++i) {
    hapi_loose_rows at = hapi_loose_at(solver, i);
    for (uint32_t k = at.first; k < at.end; k += solver->rows[k].triple ? 3 : 1) {
      if (solver->rows[k].triple) {
        triple_start(solver, &solver->rows[k]);
      }
    }
  }
  solver->owes = false;
}

void hapi_contact_again(hapi_solver *solver, uint32_t first, uint32_t count)
{
  hapi_row *r = &solver->rows[first];
  bool moved = !hapi_row_moves_b(r) && !r->single; /* by a partner that does not respond */
  HAPI_ASSERT(r->inverse != 0.0 && r->a < solver->body_count);
  for (uint32_t i = 0; moved && i < count; ++i) {
    r[i].drive = r[i].target - hapi_dot6(r[i].jb, solver->v[r[i].b]);
  }
  r->drive = moved ? r->drive : r->target;
  if (r->triple) {
    if (r->triple == HAPI_TRIPLE_BY_MASS) {
      hapi_packs_note(&solver->packs, first, false);
    }
    solver->owes = true;
    return;
  }
  for (uint32_t i = 0; i < count; ++i) {
    warm_start(solver, &r[i]);
  }
}

double hapi_ball_wanted(const hapi_row *first, double radius, const double errors[3], double out[3],
                        bool *out_slides)
{
  double norm2 = 0.0;
  double d = 0.0;
  double largest = 0.0;
  for (int i = 0; i < first->ball; ++i) {
    out[i] = first[i].impulse + errors[i] * first[i].inverse;
    norm2 += out[i] * out[i];
    d = fmax(d, first[i].inverse != 0.0 ? first[i].response : 0.0);
  }
  *out_slides = norm2 > radius * radius;
  if (*out_slides) { /* one step for all, or the direction would be that of the easiest row */
    norm2 = 0.0;
    for (int i = 0; i < first->ball; ++i) {
      out[i] = first[i].inverse != 0.0 ? first[i].impulse + errors[i] / d : 0.0;
      norm2 += out[i] * out[i];
    }
    double share = norm2 > radius * radius ? radius / sqrt(norm2) : 1.0;
    for (int i = 0; i < first->ball; ++i) {
      out[i] *= share;
    }
  }
  for (int i = 0; i < first->ball; ++i) {
    double response = *out_slides ? d : first[i].response;
    largest = fmax(largest, fabs(out[i] - first[i].impulse) * response);
  }
  return largest;
}

static void set_ball(hapi_solver *solver, hapi_row *first, const double impulses[3])
{
  for (int i = 0; i < first->ball; ++i) {
    if (impulses[i] != first[i].impulse) {
      hapi_row_push(solver, &first[i], impulses[i] - first[i].impulse);
      first[i].impulse = impulses[i];
    }
  }
}

/* First as if it stuck, row by row. */
double hapi_ball_update(hapi_solver *solver, hapi_row *first)
{
  double radius = hapi_ball_radius(solver->rows, first);
  double old[3] = {0.0};
  double errors[3] = {0.0};
  double wanted[3] = {0.0};
  double norm2 = 0.0;
  double largest = 0.0;
  bool slides = false;
  for (int i = 0; i < first->ball; ++i) {
    hapi_row *row = &first[i];
    old[i] = row->impulse;
    errors[i] = row->inverse != 0.0 ? hapi_row_error(solver, row) : 0.0;
  }
  for (int i = 0; i < first->ball && radius > 0.0; ++i) {
    hapi_row *row = &first[i];
    double error = row->inverse != 0.0 ? hapi_row_error(solver, row) : 0.0;
    hapi_row_push(solver, row, error * row->inverse);
    norm2 += row->impulse * row->impulse;
    largest = fmax(largest, fabs(error));
  }
  if (radius > 0.0 && norm2 <= radius * radius) {
    return largest;
  }
  set_ball(solver, first, old);
  largest = hapi_ball_wanted(first, radius, errors, wanted, &slides);
  set_ball(solver, first, wanted);
  return largest;
}

static void update_ball(hapi_solver *solver, hapi_row *first, hapi_corrections *io)
{
  double old[3] = {0.0};
  for (int i = 0; i < first->ball; ++i) {
    old[i] = first[i].impulse;
  }
  io->largest = fmax(io->largest, hapi_ball_update(solver, first));
  for (int i = 0; i < first->ball; ++i) {
    double change = first[i].impulse - old[i];
    io->energy2 += change * change * first[i].response;
  }
}

static void update_group(hapi_solver *solver, uint32_t first, uint32_t end, hapi_corrections *io)
{
  hapi_corrections sum = *io;
  for (uint32_t i = first; i < end; ++i) {
    hapi_row *row = &solver->rows[i];
    if (row->triple) {
      update_triple(solver, row, &sum);
      i += 2;
    } else if (row->ball > 0) {
      update_ball(solver, row, &sum);
      i += row->ball - 1u;
    } else {
      row_update(solver, row, &sum);
    }
  }
  *io = sum;
}

/* Backwards contact by contact, but with each normal before its frictions: they then end inside the
 * bounds that it sets. */
static void sweep_back(hapi_solver *solver, uint32_t begin, uint32_t end, hapi_corrections *io)
{
  while (end > begin) {
    uint32_t first = end - 1;
    while (first > begin && solver->rows[first].normal >= 0) {
      --first;
    }
    update_group(solver, first, end, io);
    end = first;
  }
}

/* Forward, the loose rows first; they begin with those of the hand. */
static void rows_sweep(hapi_solver *solver)
{
  hapi_corrections sum = {0};
  uint32_t runs = hapi_loose_count(solver);
  bool forward = solver->sweeps++ % 2 == 0;
  for (uint32_t i = 0; forward && i < runs; ++i) {
    hapi_loose_rows at = hapi_loose_at(solver, i);
    update_group(solver, at.first, at.end, &sum);
  }
  if (solver->packs.in_use) {
    solver->packs.work->sweep(&solver->packs, solver->v, forward, &sum);
  }
  for (uint32_t i = runs; !forward && i > 0; --i) {
    hapi_loose_rows at = hapi_loose_at(solver, i - 1);
    sweep_back(solver, at.first, at.end, &sum);
  }
  solver->residual = sum.largest;
  solver->swept = sum;
}

uint32_t hapi_solver_sweep_cost(const hapi_solver *solver)
{
  return solver->packs.in_use ? solver->packs.loose_rows + 6 * solver->packs.contact_count
                              : solver->row_count;
}

static void updates_spend(hapi_solver *solver, uint64_t *io_left, uint64_t cost)
{
  solver->updates += cost;
  *io_left -= cost < *io_left ? cost : *io_left;
}

/* ---- sweeps that look ahead ---- */

/* Many bodies in touch hand an impulse on by one or two of them a sweep, so plain sweeps take as
 * many as the square of a row's length. Conjugate directions take about as many as its length: what
 * a sweep changes is taken as the negative gradient of what the rows minimise, and the next sweep
 * begins farther along the way of the last ones,
 *
 *   d_k = sweep(x_k) - x_k,   s = |d_k|^2 / |d_k-1|^2
 *   s <= 1:  p_k = s p_k-1 + d_k,   x_k+1 = x_k + d_k + s p_k-1
 *   s > 1:   p_k = d_k,             x_k+1 = x_k + d_k
 *
 * with |d| in the energy of each row. This is the nonsmooth nonlinear conjugate gradient method of
 * Silcowitz-Hansen, Niebe and Erleben (The Visual Computer 26, 2010). Velocities are linear in the
 * impulses and go along. Every way ends with a sweep, so the impulses end within their bounds. */
typedef struct sweep_way {
  const hapi_pack_work *work;
  size_t packed; /* impulses in packs: they come first, then those of the loose rows */
  double *x;     /* impulses at the begin of the sweep */
  double *p;
  double *vx; /* of all bodies: the same of the velocities */
  double *vp;
  double size2; /* J, of the last d; 0: none yet */
  bool begun;
} sweep_way;

/* The memory is that of direct solves: a way ends where one of them is made. */
static bool way_place(const hapi_solver *solver, sweep_way *out)
{
  size_t packed = solver->packs.in_use ? (size_t)3 * HAPI_LANES * solver->packs.contact_count : 0;
  size_t rows = packed + (solver->packs.in_use ? solver->packs.loose_rows : solver->row_count);
  size_t bodies = solver->body_count;
  out->work = solver->packs.work != NULL ? solver->packs.work : &hapi_pack_work_pairs;
  out->packed = packed;
  out->begun = false;
  out->x = solver->work;
  if (solver->work_count < 2 * rows + 12 * bodies) {
    return false;
  }
  out->p = out->x + rows;
  out->vx = out->p + rows;
  out->vp = out->vx + 6 * bodies;
  return true;
}

static void way_begin(const hapi_solver *solver, sweep_way *way)
{
  size_t at = way->packed;
  size_t bodies = 6 * (size_t)solver->body_count;
  if (at > 0) {
    memcpy(way->x, solver->packs.impulse, at * sizeof *way->x);
  }
  for (uint32_t i = 0; i < hapi_loose_count(solver); ++i) {
    hapi_loose_rows run = hapi_loose_at(solver, i);
    for (uint32_t k = run.first; k < run.end; ++k) {
      way->x[at++] = solver->rows[k].impulse;
    }
  }
  memcpy(way->vx, solver->v, bodies * sizeof *way->vx);
  memset(way->p, 0, at * sizeof *way->p);
  memset(way->vp, 0, bodies * sizeof *way->vp);
  way->size2 = 0.0;
  way->begun = true;
}

/* As hapi_pack_work.way_go_on, of one number. */
static void number_go_on(double *now, double *x, double *p, double share)
{
  double d = *now - *x;
  double more = share * *p;
  *x = *now += more;
  *p = more + d;
}

/* From the end of one sweep to the begin of the next one. */
static void way_go_on(hapi_solver *solver, sweep_way *way)
{
  double size2 = solver->swept.energy2; /* of each row's change since the begin */
  bool ahead = size2 <= way->size2 && way->size2 > 0.0 && way->size2 < HUGE_VAL;
  double share = ahead ? size2 / way->size2 : 0.0;
  size_t at = way->packed;
  size_t bodies = 6 * (size_t)solver->body_count;
  size_t whole = bodies / HAPI_LANES * HAPI_LANES;
  double *v = solver->v[0];
  if (!ahead && way->size2 > 0.0) { /* what is no number would stay so */
    memset(way->p, 0, (size_t)(way->vx - way->p) * sizeof *way->p);
    memset(way->vp, 0, bodies * sizeof *way->vp);
  }
  if (at > 0) {
    way->work->way_go_on(&solver->packs.impulse[0][0][0], way->x, way->p, share, at);
  }
  for (uint32_t i = 0; i < hapi_loose_count(solver); ++i) {
    hapi_loose_rows run = hapi_loose_at(solver, i);
    for (uint32_t k = run.first; k < run.end; ++k) {
      number_go_on(&solver->rows[k].impulse, &way->x[at], &way->p[at], share);
      ++at;
    }
  }
  way->work->way_go_on(v, way->vx, way->vp, share, whole);
  for (size_t i = whole; i < bodies; ++i) {
    number_go_on(&v[i], &way->vx[i], &way->vp[i], share);
  }
  way->size2 = size2;
}

/* Non-finite velocities must not pass for a solution. */
static void check_finite(hapi_solver *solver)
{
  const hapi_two zero = hapi_two_all(0.0);
  hapi_two sum[3] = {zero, zero, zero}; /* of x - x, which is 0 for numbers only */
  for (uint32_t i = 0; i < solver->body_count; ++i) {
    for (int k = 0; k < 3; ++k) {
      hapi_two x = hapi_two_load(solver->v[i] + 2 * k);
      sum[k] = hapi_two_add(sum[k], hapi_two_sub(x, x));
    }
  }
  double all = hapi_two_sum(hapi_two_add(hapi_two_add(sum[0], sum[1]), sum[2]));
  if (!(all == 0.0)) {
    solver->residual = HUGE_VAL;
  }
}

/* The first one of the run was too dear for what its sweeps have left. */
static void note_dear(hapi_solver *solver, uint32_t rows)
{
  solver->rest.rows = rows;
  solver->rest.runs = DEAR_RUNS;
}

/* dearest: the cost of the run's direct solves; 0: there were none. */
static void note_vain(hapi_solver *solver, uint32_t dearest)
{
  if (dearest == 0) {
    return;
  }
  bool costly = dearest > VAIN_COST;
  bool over = solver->enough > 0 && solver->updates > solver->enough;
  if (solver->direct_solves > 0 || (!costly && !over)) {
    solver->rest.vain = 0;
    return;
  }
  if (++solver->rest.vain >= VAIN_RUNS && solver->rest.rows == 0) {
    uint32_t again = costly ? solver->rest.vain - VAIN_RUNS : 0;
    uint32_t rest = again < 8 ? VAIN_REST << again : VAIN_REST_MOST;
    solver->rest.rows = solver->row_count;
    solver->rest.runs = rest < VAIN_REST_MOST ? rest : VAIN_REST_MOST;
  }
}

/* What was too dear or in vain in the last runs will be so in this one: finding out costs as much
 * as two sweeps. */
static bool stays_dear(hapi_solver *solver)
{
  bool alike =
      solver->rest.rows > 0 && 10 * (uint64_t)solver->row_count >= 9 * (uint64_t)solver->rest.rows;
  if (!alike || --solver->rest.runs == 0) {
    solver->rest.rows = 0;
    return false;
  }
  return true;
}

void hapi_solver_rebuild(hapi_solver *solver)
{
  memcpy(solver->v, solver->free, solver->body_count * sizeof *solver->v);
  if (solver->packs.in_use) {
    solver->packs.work->push(&solver->packs, solver->v);
  }
  for (uint32_t i = 0; i < hapi_loose_count(solver); ++i) {
    hapi_loose_rows at = hapi_loose_at(solver, i);
    for (uint32_t k = at.first; k < at.end; ++k) {
      hapi_row *row = &solver->rows[k];
      double impulse = row->impulse;
      if (row->inverse != 0.0 && impulse != 0.0) {
        row->impulse = 0.0;
        hapi_row_push(solver, row, impulse);
      }
    }
  }
}

void hapi_solver_sweep_on(hapi_solver *solver)
{
  for (uint32_t i = 0; i < 2 + CALM_UPDATES / solver->row_count; ++i) {
    rows_sweep(solver);
    solver->updates += hapi_solver_sweep_cost(solver);
  }
  check_finite(solver);
}

/* Each row has its bodies to itself: what is due after its update is rounding. */
static void run_apart(hapi_solver *solver)
{
  solver->packs.known.alike = false;
  for (uint32_t i = 0; i < solver->row_count; ++i) {
    hapi_row *row = &solver->rows[i];
    double old = row->impulse;
    if (row->inverse == 0.0) {
      continue;
    }
    double *v = solver->v[row->a];
    double wanted = (row->drive - row->softness * old - hapi_dot6(row->ja, v)) * row->inverse;
    hapi_madd6(v, hapi_clamp(wanted, row->lo - old, row->hi - old), row->ba);
    row->impulse = hapi_clamp(old + wanted, row->lo, row->hi);
  }
  solver->sweeps = 1;
  solver->updates = solver->row_count;
  solver->residual = 0.0;
  check_finite(solver);
}

/* Whether what is still due may be left to the next run. */
static bool is_settled(const hapi_solver *solver)
{
  return solver->residual < solver->tolerance || (solver->residual < solver->coarse.largest &&
                                                  solver->swept.opening <= solver->coarse.opening &&
                                                  solver->swept.energy2 < solver->coarse.energy2);
}

/* Whether so many times the sweeps that a direct solve costs will do, where something may stay
 * undone. */
static bool sweeps_suffice(const hapi_solver *solver, double rate, uint32_t times)
{
  double share = 1.0;
  uint32_t sweeps = times * DIRECT_SWEEPS * solver->row_count / hapi_solver_sweep_cost(solver);
  if (solver->max_sweeps > 0) {
    uint32_t left = solver->max_sweeps > solver->sweeps ? solver->max_sweeps - solver->sweeps : 0;
    sweeps = sweeps < left ? sweeps : left;
  }
  for (uint32_t i = 0; i < sweeps; ++i) {
    share *= rate;
  }
  return share * solver->residual < solver->coarse.largest &&
         share * solver->swept.opening <= solver->coarse.opening &&
         share * share * solver->swept.energy2 < solver->coarse.energy2;
}

/* All pairs of bodies are solved at once (aggregate.h) after two sweeps, then after each four more,
 * while four sweeps reduce the energy of a sweep's corrections to a quarter or less. */
static bool pairs_are_due(const hapi_solver *solver, double corrected)
{
  return solver->packs.in_use && solver->packs.aggregate != NULL && solver->sweeps >= 2 &&
         (solver->sweeps - 2) % PAIRS_EACH == 0 && solver->swept.energy2 < PAIRS_FALL * corrected;
}

/* Its cost in row updates, of `left`; 0: there is none. */
static uint32_t pairs_solve(hapi_solver *solver, uint64_t left)
{
  const hapi_aggregate *all = solver->packs.aggregate;
  if (solver->packs.known.anew) {
    hapi_aggregate_plan(&solver->packs);
    solver->packs.known.anew = false;
  }
  if (all->count == 0 || left < (uint64_t)all->cost + hapi_solver_sweep_cost(solver)) {
    return 0;
  }
  (void)hapi_aggregate_step(&solver->packs, solver->v);
  return all->cost;
}

/* Whether a run may leave something to the next one. */
static bool may_spread(const hapi_solver *solver)
{
  const hapi_packs *packs = &solver->packs;
  bool steps = packs->in_use && packs->aggregate != NULL && packs->aggregate->wide.units == 0;
  return packs->height <= SPREAD_HEIGHT &&
         (solver->row_count <= SPREAD_ROWS || packs->height <= SPREAD_LOW || steps);
}

/* Whether what is due is little enough for the next run. tried: direct solves lead to nothing
 * better now. */
static bool may_leave(const hapi_solver *solver, bool tried)
{
  const hapi_coarse *coarse = &solver->coarse;
  double due = solver->swept.energy2;
  bool small = solver->residual < coarse->largest && (tried || due < LEAVE * coarse->energy2);
  bool light = solver->residual < LEAVE_LIGHT * coarse->largest && due < coarse->energy2;
  return solver->enough > 0 && coarse->energy2 > 0.0 && (small || light);
}

/* Whether one more direct solve is worth its cost. */
static bool direct_pays(const hapi_solver *solver, double rate, bool first, bool tried)
{
  bool fits = solver->updates + solver->direct.cost <= solver->enough;
  bool cheap = solver->direct.cost <= CHEAP_COST;
  return !sweeps_suffice(solver, rate, 1) &&
         (fits || !may_leave(solver, tried) ||
          (first && cheap && !sweeps_suffice(solver, rate, LEAVE_SWEEPS)));
}

void hapi_solver_run(hapi_solver *solver)
{
  HAPI_ASSERT(solver->hub_count <= solver->body_count);
  HAPI_ASSERT(solver->tolerance >= 0.0);
  uint32_t rows = solver->row_count;
  uint64_t left = solver->update_budget;
  solver->sweeps = 0;
  solver->updates = 0;
  solver->direct_solves = 0;
  solver->direct.runs = 0;
  solver->residual = 0.0;
  bool may = solver->direct_rows > 0;
  bool dear = may && stays_dear(solver);
  bool direct = may && !dear;
  bool tried = dear;
  uint32_t dearest = 0;
  sweep_way way = {0};
  solver->packs.in_use = false;
  for (uint32_t i = 0; i < rows && !solver->ready; ++i) {
    hapi_row_ready(solver, i);
  }
  if (solver->apart && rows > 0) {
    run_apart(solver);
    return;
  }
  solver->packs.in_use = hapi_packs_begin(&solver->packs, solver->rows, rows, solver->body_count);
  if (!may_spread(solver)) {
    solver->enough = 0;
  }
  if (solver->owes) {
    triples_start(solver);
  }
  bool ahead = way_place(solver, &way);
  uint32_t cost = hapi_solver_sweep_cost(solver);
  uint32_t direct_from = DIRECT_FROM; /* sweeps */
  double before[2] = {0.0, 0.0};      /* corrected, after the last sweep and the one before */
  double at_pairs = HUGE_VAL;         /* corrected, before the last step of all pairs */
  hapi_sweep_trend trend;
  hapi_trend_begin(&trend);
  for (uint32_t rounds = 0; rows > 0;) {
    if (ahead && solver->sweeps >= 2) {
      updates_spend(solver, &left, cost / 4);
      if (way.begun) {
        way_go_on(solver, &way);
      } else {
        way_begin(solver, &way);
      }
    }
    rows_sweep(solver);
    updates_spend(solver, &left, cost);
    double rate = hapi_sweeps_rate(before[1], before[0], solver->swept.energy2);
    before[1] = before[0];
    before[0] = solver->swept.energy2;
    bool ends = hapi_trend_ends(&trend, &solver->swept) && solver->enough > 0 && (tried || !direct);
    bool enough = solver->updates >= solver->enough && may_leave(solver, tried);
    if (is_settled(solver) || (solver->sweeps >= 2 && (enough || ends || left < cost ||
                                                       solver->sweeps == solver->max_sweeps))) {
      break;
    }
    uint32_t of_pairs = pairs_are_due(solver, at_pairs) ? pairs_solve(solver, left) : 0;
    if (of_pairs > 0) {
      at_pairs = before[0];
      updates_spend(solver, &left, of_pairs);
      way.begun = false;
      hapi_trend_begin(&trend);
    }
    /* Direct solves may have one half of the budget: where they lead in circles between two sets of
     * active rows, sweeps from the second half still come near, and the next tick starts from
     * there. */
    if (direct && solver->sweeps >= direct_from && 2 * left > solver->update_budget &&
        direct_pays(solver, rate, dearest == 0, tried) &&
        (rounds < DIRECT_ROUNDS || rounds % DIRECT_ROUNDS == 0)) {
      uint32_t accepted = solver->direct_solves;
      uint32_t spent = hapi_direct_run(solver, (uint32_t)left - cost);
      updates_spend(solver, &left, spent);
      solver->direct.cost = spent;
      ++solver->direct.runs;
      tried = tried || solver->direct_solves == accepted;
      if (solver->direct_solves == accepted && solver->coarse.energy2 > 0.0) {
        direct_from = solver->sweeps + VAIN_SWEEPS;
      }
      way.begun = false;
      before[0] = before[1] = 0.0;
      hapi_trend_begin(&trend);
      bool first = dearest == 0;
      dearest = spent > dearest ? spent : dearest;
      direct = solver->direct.end != HAPI_DIRECT_DEAR; /* now, and so in the next round */
      const bool reduced = solver->direct.end == HAPI_DIRECT_REDUCED;
      if (direct && solver->direct.residual < (reduced ? HAPI_UNSOLVED : solver->tolerance)) {
        solver->residual = solver->direct.residual;
        break;
      }
      if (!direct && first) {
        note_dear(solver, rows);
      }
    }
    rounds += solver->sweeps >= direct_from;
  }
  if (solver->packs.in_use) {
    hapi_packs_end(&solver->packs, solver->rows);
  }
  note_vain(solver, dearest);
  check_finite(solver);
}
