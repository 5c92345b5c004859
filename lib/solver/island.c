/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* One round of Newton's method for each island of bodies that rows tie together. The impulses are
 * those where  p = what the bounds leave of  p + e / d,  with e the error of a row and d its
 * response. The right side has a kink at each bound, and on either side of it another derivative
 * (semismooth Newton, or primal-dual active sets: Hintermueller, Ito, Kunisch 2002): rows inside
 * their bounds are free, frictions outside slide, tied to their normal, all others are at a bound.
 * With e the errors of the free rows and R small,
 *
 *   dv = sum of b_i dp_i,   dp_i = (e_i - j_i dv) / (softness_i + R_i)
 *   (I + sum of b_i j_i / (softness_i + R_i)) dv = sum of b_i e_i / (softness_i + R_i)
 *
 * has six unknowns per body whatever the number of rows, and one 6x6 block per touching pair. R
 * makes redundant contacts (four of a box on a floor) well behaved: only the change is regularised,
 * so that what the null space holds from the warm start stays, and the next round takes what R has
 * left of the errors (method of multipliers). Nothing is cut on the way: of a set that cannot be,
 * impulses out of their bounds say which rows are to be others. */

#include "solver/island.h"

#include <string.h>

#include "base/assert.h"
#include "solver/island_pair.h"

#define ROW_MADDS 300    /* to assemble, solve and check a row, in multiply-adds */
#define SETTLED 0.25     /* of what may be left: islands add up, and rows say it one by one */
#define MADDS_PER_ROW 36 /* multiply-adds in the time of one row update */

/* ---- sets of bodies ---- */

static bool set_has(const hapi_body_set *set, uint32_t i)
{
  return (set->bits[i / 64] >> i % 64 & 1) != 0;
}

static void set_add(hapi_body_set *set, uint32_t i)
{
  HAPI_ASSERT_INDEX(i, HAPI_ISLAND_BODIES);
  set->bits[i / 64] |= (uint64_t)1 << i % 64;
}

static void set_drop(hapi_body_set *set, uint32_t i)
{
  set->bits[i / 64] &= ~((uint64_t)1 << i % 64);
}

static hapi_body_set set_both(const hapi_body_set *a, const hapi_body_set *b)
{
  return (hapi_body_set){{a->bits[0] & b->bits[0], a->bits[1] & b->bits[1]}};
}

static void add_all(hapi_body_set *set, const hapi_body_set *more)
{
  set->bits[0] |= more->bits[0];
  set->bits[1] |= more->bits[1];
}

/* The first that is at `from` or after it; HAPI_ISLAND_BODIES: none. */
static uint32_t next_in(const hapi_body_set *set, uint32_t from)
{
  for (uint32_t word = from / 64; word < 2; from = 64 * ++word) {
    for (uint64_t bits = set->bits[word] >> from % 64; bits != 0; bits >>= 1, ++from) {
      if ((bits & 1) != 0) {
        return from;
      }
    }
  }
  return HAPI_ISLAND_BODIES;
}

static uint32_t count_of(const hapi_body_set *set)
{
  uint32_t count = 0;
  for (int i = 0; i < 2; ++i) {
    for (uint64_t bits = set->bits[i]; bits != 0; bits &= bits - 1) {
      ++count;
    }
  }
  return count;
}

/* ---- rows ---- */

/* wanted: what its error asks for, N s. */
static void row_classify(hapi_island *is, hapi_row *row, double wanted, double lo, double hi,
                         bool sticking)
{
  const uint8_t state = row->state;
  const bool may_tie = row->normal >= 0 && hi > 0.0;
  row->state = HAPI_ROW_FIXED;
  if ((wanted > lo && wanted < hi) || (sticking && may_tie)) {
    row->state = HAPI_ROW_FREE;
  } else if (may_tie && is->solver->rows[row->normal].state == HAPI_ROW_FREE &&
             hapi_friction_follows(is->solver->rows, row)) {
    row->state = HAPI_ROW_TIED;
    is->look.changed |= wanted * row->impulse < 0.0;
  }
  is->look.changed |= row->state != state;
  is->free_rows += row->state == HAPI_ROW_FREE;
  is->used_rows += row->state != HAPI_ROW_FIXED;
}

/* What a row of a ball that slides has more of softness: across the force F it goes with the slip
 * e, as the two are parallel, e_t = (|e| / F) F_t. */
static double slip_softness(const hapi_row *row)
{
  return row->coupling[1];
}

static void slide_ball(const hapi_island *is, uint32_t first, double radius, const double wanted[3])
{
  hapi_row *row = &is->solver->rows[first];
  double slip = 0.0;
  for (uint32_t i = 0; i < row->ball; ++i) {
    row[i].coupling[0] = wanted[i] / radius;
    slip += is->error[first + i] * row[i].coupling[0];
  }
  for (uint32_t i = 0; i < row->ball; ++i) {
    row[i].state = HAPI_ROW_SLIDING;
    row[i].coupling[1] = fmax(slip, 0.0) / radius;
  }
}

/* The states of frictions that are one vector: free, or along the force and as large as the normal
 * lets it, while they turn with the slip. */
static double inspect_ball(hapi_island *is, uint32_t first, bool sticking, double *io_energy2)
{
  hapi_row *row = &is->solver->rows[first];
  double radius = hapi_ball_radius(is->solver->rows, row);
  double wanted[3];
  bool slides;
  for (uint32_t i = 0; i < row->ball; ++i) {
    is->error[first + i] = row[i].inverse != 0.0 ? hapi_row_error(is->solver, &row[i]) : 0.0;
    row[i].state = HAPI_ROW_FIXED;
  }
  double due = hapi_ball_wanted(row, radius, is->error + first, wanted, &slides);
  for (uint32_t i = 0; i < row->ball; ++i) {
    double change = wanted[i] - row[i].impulse;
    *io_energy2 += change * change * row[i].response;
  }
  for (uint32_t i = 0; i < row->ball && radius > 0.0 && (!slides || sticking); ++i) {
    row[i].state = HAPI_ROW_FREE;
    ++is->free_rows;
  }
  if (radius > 0.0 && row->state == HAPI_ROW_FIXED) {
    slide_ball(is, first, radius, wanted);
  }
  is->used_rows += row->state != HAPI_ROW_FIXED ? row->ball : 0;
  return due;
}

double hapi_island_inspect(hapi_island *is, bool sticking)
{
  const hapi_solver *solver = is->solver;
  double largest = 0.0;
  double sum = 0.0;
  double energy2 = 0.0;
  double opening = 0.0;
  is->free_rows = 0;
  is->used_rows = 0;
  is->look.changed = is->look.outside = false;
  for (uint32_t i = is->first; i != HAPI_NO_SOLVER_ROW; i = solver->rows[i].next) {
    hapi_row *row = &solver->rows[i];
    double lo;
    double hi;
    if (row->ball > 0 || row->round > 0) {
      is->look.changed = is->look.outside = true; /* what slides there turns */
      double due = row->ball > 0 ? inspect_ball(is, i, sticking, &energy2) : 0.0;
      largest = due <= largest ? largest : due;
      continue;
    }
    hapi_row_bounds(solver->rows, row, &lo, &hi);
    double p = row->impulse;
    is->error[i] = hapi_row_error(solver, row);
    double wanted = p + is->error[i] * row->inverse;
    double change = fabs(hapi_clamp(wanted, lo, hi) - p);
    double due = change * row->response;
    is->look.outside |= p < lo || p > hi;
    largest = due > largest ? due : largest;
    opening = lo == -HUGE_VAL && hi == HUGE_VAL && due > opening ? due : opening;
    energy2 += change * due;
    sum += due + is->error[i];
    row_classify(is, row, wanted, lo, hi, sticking);
  }
  is->look.settled = largest < solver->coarse.largest && opening <= solver->coarse.opening &&
                     energy2 < SETTLED * solver->coarse.energy2;
  return largest + 0.0 * sum; /* NaN if one was: comparisons and cuts at bounds lose it */
}

/* A row whose error drives another row's impulse, and how much. */
typedef struct drive {
  const hapi_row *from;
  double gain;
  double error;
} drive;

/* The one drive of a row that is free or tied: nearly all are, and this is in the innermost
 * loops. */
static inline drive drive_of(const hapi_island *is, const hapi_row *row, uint32_t index)
{
  const hapi_row *from = row->state == HAPI_ROW_TIED ? &is->solver->rows[row->normal] : row;
  return (drive){from, is->gain[index], is->error[from - is->solver->rows]};
}

#define SLIDING_DRIVES 4

/* Of a row of a ball that slides: its normal, and the ball's rows across the force; returns how
 * many. */
static int sliding_drives(const hapi_island *is, uint32_t index, drive out[SLIDING_DRIVES])
{
  const hapi_row *rows = is->solver->rows;
  const hapi_row *row = &rows[index];
  const hapi_row *first = row - row->round;
  uint32_t at = index - row->round;
  int32_t normal = row->normal;
  double along = 0.0;
  bool free = rows[normal].state == HAPI_ROW_FREE;
  double share = free ? row->mu * row->coupling[0] * is->gain[normal] : 0.0;
  out[0] = (drive){&rows[normal], share, is->error[normal]};
  for (int i = 0; i < first->ball; ++i) {
    along += first[i].impulse * first[i].coupling[0];
  }
  for (int i = 0; i < first->ball; ++i) {
    double across = first[i].impulse - along * first[i].coupling[0];
    double part = (&first[i] == row ? 1.0 : 0.0) - row->coupling[0] * first[i].coupling[0];
    double slip = slip_softness(&first[i]);
    out[1 + i] =
        (drive){&first[i], part * is->gain[index], is->error[at + (uint32_t)i] - slip * across};
  }
  return 1 + first->ball;
}

/* ---- structure of the matrix ---- */

static bool add_body(hapi_island *is, uint32_t body)
{
  HAPI_ASSERT_INDEX(body, is->solver->body_count);
  if (is->local[body] != HAPI_NO_BODY) {
    return true;
  }
  if (is->count == HAPI_ISLAND_BODIES) {
    return false;
  }
  is->link[is->count] = (hapi_body_set){{0, 0}};
  set_add(&is->link[is->count], is->count);
  is->body[is->count] = (uint16_t)body;
  is->local[body] = (uint16_t)is->count++;
  return true;
}

/* Also of rows that do not push now: a later round may take them up. */
bool hapi_island_gather(hapi_island *is)
{
  const hapi_row *rows = is->solver->rows;
  const hapi_row *last = NULL;
  is->count = 0;
  memset(is->local, 0xff, is->solver->body_count * sizeof is->local[0]);
  for (uint32_t i = is->first; i != HAPI_NO_SOLVER_ROW; i = rows[i].next) {
    if (hapi_row_ties_same(&rows[i], last)) {
      continue;
    }
    last = &rows[i];
    bool takes_b =
        hapi_row_moves_b(&rows[i]) && !(is->held != NULL && hapi_is_hub(is->solver, rows[i].b));
    if ((hapi_row_moves_a(&rows[i]) && !add_body(is, rows[i].a)) ||
        (takes_b && !add_body(is, rows[i].b))) {
      return false;
    }
  }
  last = NULL;
  for (uint32_t i = is->first; i != HAPI_NO_SOLVER_ROW; i = rows[i].next) {
    if (hapi_row_ties_same(&rows[i], last)) {
      continue;
    }
    last = &rows[i];
    uint16_t a = is->local[rows[i].a];
    uint16_t b = is->local[rows[i].b];
    if (a != HAPI_NO_BODY && b != HAPI_NO_BODY) {
      set_add(&is->link[a], b);
      set_add(&is->link[b], a);
    }
  }
  return true;
}

/* Body of least degree among those left: chains and trees get no fill at all. */
static uint32_t least_linked(const hapi_island *is, const hapi_body_set *left)
{
  uint32_t best = 0;
  uint32_t best_degree = UINT32_MAX;
  for (uint32_t i = 0; i < is->count; ++i) {
    hapi_body_set links = set_both(&is->link[i], left);
    uint32_t degree = set_has(left, i) ? count_of(&links) : UINT32_MAX;
    if (degree < best_degree) {
      best_degree = degree;
      best = i;
    }
    if (degree <= 2) {
      break; /* the end of a chain, or alone: none is better */
    }
  }
  return best;
}

/* Order, fill and places of the blocks; the cost in row updates. */
uint32_t hapi_island_plan(hapi_island *is)
{
  hapi_body_set left = {{0, 0}};
  uint32_t madds = is->used_rows * ROW_MADDS;
  for (uint32_t i = 0; i < is->count; ++i) {
    set_add(&left, i);
  }
  for (uint32_t k = 0; k < is->count; ++k) {
    uint32_t p = least_linked(is, &left);
    set_drop(&left, p);
    is->pivot[k] = (uint16_t)p;
    is->rest[p] = set_both(&is->link[p], &left);
    uint32_t degree = count_of(&is->rest[p]);
    madds += 216 * (1 + degree + degree * degree);
    for (uint32_t i = next_in(&is->rest[p], 0); i < HAPI_ISLAND_BODIES;
         i = next_in(&is->rest[p], i + 1)) {
      add_all(&is->link[i], &is->rest[p]);
    }
  }
  is->block_count = 0;
  for (uint32_t i = 0; i < is->count; ++i) {
    for (uint32_t j = next_in(&is->link[i], 0); j < HAPI_ISLAND_BODIES;
         j = next_in(&is->link[i], j + 1)) {
      is->block[i][j] = (uint16_t)is->block_count++;
    }
  }
  return madds / MADDS_PER_ROW;
}

/* ---- numbers ---- */

/* block += s b j^T */
static void add_outer(double block[36], double s, const double b[6], const double j[6])
{
  for (int i = 0; i < 6; ++i) {
    hapi_madd6(block + 6 * i, s * b[i], j);
  }
}

static void add_row(hapi_island *is, uint16_t to, double s, const double b[6], const hapi_row *from)
{
  uint16_t a = is->local[from->a];
  uint16_t other = hapi_row_moves_b(from) ? is->local[from->b] : HAPI_NO_BODY;
  if (to != HAPI_NO_BODY && a != HAPI_NO_BODY) {
    add_outer(is->blocks[is->block[to][a]], s, b, from->ja);
  }
  if (to != HAPI_NO_BODY && other != HAPI_NO_BODY) {
    add_outer(is->blocks[is->block[to][other]], s, b, from->jb);
  }
}

static void add_to(hapi_island *is, uint16_t local, double s, const double b[6])
{
  if (local != HAPI_NO_BODY) {
    hapi_madd6(is->dv[local], s, b);
  }
}

static inline void add_drive(hapi_island *is, const hapi_row *row, drive d)
{
  add_row(is, is->local[row->a], d.gain, row->ba, d.from);
  add_to(is, is->local[row->a], d.gain * d.error, row->ba);
  if (hapi_row_moves_b(row)) {
    add_row(is, is->local[row->b], d.gain, row->bb, d.from);
    add_to(is, is->local[row->b], d.gain * d.error, row->bb);
  }
}

static void add_sliding(hapi_island *is, uint32_t index)
{
  drive drives[SLIDING_DRIVES];
  int count = sliding_drives(is, index, drives);
  for (int k = 0; k < count; ++k) {
    add_drive(is, &is->solver->rows[index], drives[k]);
  }
}

/* Of a normal: it and its frictions. */
static void add_contact(hapi_island *is, uint32_t normal, hapi_pair_sum *io)
{
  const hapi_row *rows = &is->solver->rows[normal];
  hapi_pair_drive by[3];
  bool any = false;
  for (uint32_t i = 0; i < 3; ++i) {
    const bool used = rows[i].state != HAPI_ROW_FIXED;
    const drive d = drive_of(is, &rows[i], normal + i);
    by[i] = (hapi_pair_drive){d.from, used ? d.gain : 0.0, used ? d.error : 0.0};
    any = any || used;
  }
  if (!any) {
    return;
  }
  if (io->first == NULL || io->first->a != rows->a || io->first->b != rows->b ||
      !hapi_same_directions(io->first, rows)) {
    hapi_pair_enter(is, io);
    hapi_pair_begin(rows, io);
  }
  hapi_pair_add(io, rows, by);
}

/* Matrix and right side, dv = sum of gain b e, with the errors of the last look. One walk for
 * both: the rows are more than fits into a near cache. */
static void matrix_assemble(hapi_island *is)
{
  const hapi_row *rows = is->solver->rows;
  memset(is->blocks, 0, is->block_count * sizeof *is->blocks);
  memset(is->dv, 0, is->count * sizeof *is->dv);
  for (uint32_t i = 0; i < is->count; ++i) {
    for (int k = 0; k < 36; k += 7) {
      is->blocks[is->block[i][i]][k] = 1.0;
    }
  }
  hapi_pair_sum pair = {NULL};
  const bool by_pairs = is->solver->packs.work != NULL; /* then there are inverse inertias */
  for (uint32_t i = is->first; i != HAPI_NO_SOLVER_ROW; i = rows[i].next) {
    const hapi_row *row = &rows[i];
    if (by_pairs && row->triple == HAPI_TRIPLE_BY_MASS) {
      add_contact(is, i, &pair);
      i += 2; /* its frictions */
    } else if (row->state == HAPI_ROW_SLIDING) {
      add_sliding(is, i);
    } else if (row->state != HAPI_ROW_FIXED) {
      add_drive(is, row, drive_of(is, row, i));
    }
  }
  hapi_pair_enter(is, &pair);
}

/* m = m^-1, by steps of Gauss and Jordan: row k by the pivot, the others freed of column k, in
 * which the inverse grows. No pivoting: such a block is 1 plus a product of positive definite
 * matrices as long as nothing slides, and what sliding spoils is not accepted. */
static void block_invert(double m[36])
{
  for (int k = 0; k < 6; ++k) {
    double pivot = 1.0 / m[7 * k];
    m[7 * k] = 1.0;
    for (int c = 0; c < 6; ++c) {
      m[6 * k + c] *= pivot;
    }
    for (int i = 0; i < 6; ++i) {
      if (i != k) {
        double f = m[6 * i + k];
        m[6 * i + k] = 0.0;
        hapi_madd6(m + 6 * i, -f, m + 6 * k);
      }
    }
  }
}

/* out = out - a b */
static void multiply_sub(const double a[36], const double b[36], double out[36])
{
  for (int i = 0; i < 6; ++i) {
    double *row = out + 6 * i;
    hapi_two sums[3] = {hapi_two_load(row), hapi_two_load(row + 2), hapi_two_load(row + 4)};
    for (int k = 0; k < 6; ++k) {
      hapi_two share = hapi_two_all(-a[6 * i + k]);
      for (int c = 0; c < 3; ++c) {
        sums[c] = hapi_two_madd(sums[c], share, hapi_two_load(b + 6 * k + 2 * c));
      }
    }
    for (int c = 0; c < 3; ++c) {
      hapi_two_store(row + 2 * c, sums[c]);
    }
  }
}

/* y -= m x */
static void apply_sub(const double m[36], const double x[6], double y[6])
{
  for (int i = 0; i < 6; ++i) {
    y[i] -= hapi_dot6(m + 6 * i, x);
  }
}

/* Block LU: diagonal blocks become their inverses, blocks below factors. */
static void matrix_factor(hapi_island *is)
{
  for (uint32_t k = 0; k < is->count; ++k) {
    uint16_t p = is->pivot[k];
    const hapi_body_set *rest = &is->rest[p];
    double *diagonal = is->blocks[is->block[p][p]];
    block_invert(diagonal);
    for (uint32_t i = next_in(rest, 0); i < HAPI_ISLAND_BODIES; i = next_in(rest, i + 1)) {
      double *below = is->blocks[is->block[i][p]];
      double l[36] = {0.0};
      multiply_sub(below, diagonal, l);
      for (int c = 0; c < 36; ++c) {
        below[c] = l[c] = -l[c];
      }
      for (uint32_t j = next_in(rest, 0); j < HAPI_ISLAND_BODIES; j = next_in(rest, j + 1)) {
        multiply_sub(l, is->blocks[is->block[p][j]], is->blocks[is->block[i][j]]);
      }
    }
  }
}

/* dv: in right side, out solution */
void hapi_island_substitute(hapi_island *is)
{
  for (uint32_t k = 0; k < is->count; ++k) {
    uint16_t p = is->pivot[k];
    const hapi_body_set *rest = &is->rest[p];
    for (uint32_t i = next_in(rest, 0); i < HAPI_ISLAND_BODIES; i = next_in(rest, i + 1)) {
      apply_sub(is->blocks[is->block[i][p]], is->dv[p], is->dv[i]);
    }
  }
  for (uint32_t k = is->count; k-- > 0;) {
    uint16_t p = is->pivot[k];
    const hapi_body_set *rest = &is->rest[p];
    double y[6];
    memcpy(y, is->dv[p], sizeof y);
    for (uint32_t j = next_in(rest, 0); j < HAPI_ISLAND_BODIES; j = next_in(rest, j + 1)) {
      apply_sub(is->blocks[is->block[p][j]], is->dv[j], y);
    }
    const double *inverse = is->blocks[is->block[p][p]];
    for (int i = 0; i < 6; ++i) {
      is->dv[p][i] = hapi_dot6(inverse + 6 * i, y);
    }
  }
}

/* ---- one round ---- */

static double row_moved(const hapi_island *is, uint16_t local, const double j[6])
{
  return local == HAPI_NO_BODY ? 0.0 : hapi_dot6(j, is->dv[local]);
}

static void restore_velocities(hapi_island *is)
{
  for (uint32_t i = 0; i < is->count; ++i) {
    memcpy(is->solver->v[is->body[i]], is->saved_v[i], sizeof is->saved_v[i]);
  }
}

static inline double drive_answer(const hapi_island *is, drive d)
{
  double w = row_moved(is, is->local[d.from->a], d.from->ja);
  if (hapi_row_moves_b(d.from)) {
    w += row_moved(is, is->local[d.from->b], d.from->jb);
  }
  return d.gain * (d.error - w);
}

static double sliding_asked(const hapi_island *is, uint32_t index)
{
  drive drives[SLIDING_DRIVES];
  double p = is->solver->rows[index].impulse;
  int count = sliding_drives(is, index, drives);
  for (int k = 0; k < count; ++k) {
    p += drive_answer(is, drives[k]);
  }
  return p;
}

/* Impulse that dv asks for. */
static inline double row_asked(const hapi_island *is, uint32_t index)
{
  const hapi_row *row = &is->solver->rows[index];
  if (row->state == HAPI_ROW_SLIDING) {
    return sliding_asked(is, index);
  }
  return row->state == HAPI_ROW_FIXED ? row->impulse
                                      : row->impulse + drive_answer(is, drive_of(is, row, index));
}

static void push_to(hapi_island *is, uint32_t index, double p)
{
  hapi_row *row = &is->solver->rows[index];
  hapi_row_push(is->solver, row, p - is->saved_impulse[index]);
  row->impulse = p;
}

static void push_ball(hapi_island *is, uint32_t first)
{
  const hapi_row *row = &is->solver->rows[first];
  double radius = hapi_ball_radius(is->solver->rows, row);
  double p[3] = {0.0};
  for (uint32_t i = 0; i < row->ball; ++i) {
    p[i] = row_asked(is, first + i);
  }
  double norm = sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
  double share = norm > radius ? radius / norm : 1.0;
  for (uint32_t i = 0; i < row->ball; ++i) {
    push_to(is, first + i, share * p[i]);
  }
}

static void hubs_hold(const hapi_island *is)
{
  const hapi_solver *solver = is->solver;
  if (is->held != NULL) {
    memcpy(solver->v[solver->body_count - solver->hub_count], is->held,
           solver->hub_count * sizeof *is->held);
  }
}

/* What the rows of dv ask for: a normal comes before its frictions. The velocities are those of the
 * impulses as they are now, from the saved ones, and not kept along: a set of active rows that
 * cannot be gives impulses so large that nothing of the velocities would be left. */
static void push_rows(hapi_island *is)
{
  const hapi_row *rows = is->solver->rows;
  restore_velocities(is);
  for (uint32_t i = is->first; i != HAPI_NO_SOLVER_ROW; i = rows[i].next) {
    if (rows[i].ball > 0) {
      push_ball(is, i);
    } else if (rows[i].round == 0) {
      push_to(is, i, row_asked(is, i));
    }
  }
  hubs_hold(is);
}

void hapi_island_save(hapi_island *is)
{
  for (uint32_t i = is->first; i != HAPI_NO_SOLVER_ROW; i = is->solver->rows[i].next) {
    is->saved_impulse[i] = is->solver->rows[i].impulse;
    is->saved_error[i] = is->error[i];
  }
  for (uint32_t i = 0; i < is->count; ++i) {
    memcpy(is->saved_v[i], is->solver->v[is->body[i]], sizeof is->saved_v[i]);
  }
}

void hapi_island_restore(hapi_island *is)
{
  for (uint32_t i = is->first; i != HAPI_NO_SOLVER_ROW; i = is->solver->rows[i].next) {
    is->solver->rows[i].impulse = is->saved_impulse[i];
  }
  restore_velocities(is);
}

/* Places the arrays in the work; false if they do not fit. */
bool hapi_island_place(hapi_island *is)
{
  size_t rows = is->solver->row_count;
  size_t need = HAPI_ROW_ARRAYS * rows + 6 * (size_t)is->solver->body_count +
                12 * (size_t)is->count + 36 * (size_t)is->block_count;
  double *at = (double *)(is->kept_v + is->solver->body_count);
  is->saved_v = (double(*)[6])at;
  is->dv = is->saved_v + is->count;
  is->blocks = (double(*)[36])(at + 12 * is->count);
  return need <= is->solver->work_count;
}

void hapi_island_factor(hapi_island *is)
{
  matrix_assemble(is);
  matrix_factor(is);
}

void hapi_island_solve(hapi_island *is)
{
  hapi_island_factor(is);
  hapi_island_substitute(is);
  push_rows(is);
}

void hapi_island_solve_again(hapi_island *is)
{
  const hapi_row *rows = is->solver->rows;
  memset(is->dv, 0, is->count * sizeof *is->dv);
  for (uint32_t i = is->first; i != HAPI_NO_SOLVER_ROW; i = rows[i].next) {
    HAPI_ASSERT(rows[i].state != HAPI_ROW_SLIDING);
    if (rows[i].state != HAPI_ROW_FIXED) {
      const drive d = drive_of(is, &rows[i], i);
      add_to(is, is->local[rows[i].a], d.gain * d.error, rows[i].ba);
      if (hapi_row_moves_b(&rows[i])) {
        add_to(is, is->local[rows[i].b], d.gain * d.error, rows[i].bb);
      }
    }
  }
  hapi_island_substitute(is);
  push_rows(is);
}

/* Its impulse per error; wanted: as for its state. */
static double gain_of(const hapi_island *is, const hapi_row *row, double wanted)
{
  if (row->state == HAPI_ROW_TIED) {
    return (wanted > 0.0 ? row->mu : -row->mu) * is->gain[row->normal];
  }
  double softness = row->softness + (row->state == HAPI_ROW_SLIDING ? slip_softness(row) : 0.0);
  double r = hapi_row_is_bounded(row) ? is->softening : HAPI_FIRM;
  return 1.0 / (softness + r * row->response);
}

void hapi_island_gains(hapi_island *is)
{
  const hapi_row *rows = is->solver->rows;
  for (uint32_t i = is->first; i != HAPI_NO_SOLVER_ROW; i = rows[i].next) {
    if (rows[i].state != HAPI_ROW_FIXED) {
      is->gain[i] = gain_of(is, &rows[i], rows[i].impulse + is->error[i] * rows[i].inverse);
    }
  }
}

void hapi_island_bound(hapi_island *is)
{
  hapi_row *rows = is->solver->rows;
  bool moved = false;
  for (uint32_t i = is->first; i != HAPI_NO_SOLVER_ROW; i = rows[i].next) {
    hapi_row *row = &rows[i];
    double lo;
    double hi;
    if (row->state == HAPI_ROW_FREE || row->ball > 0 || row->round > 0) {
      continue;
    }
    hapi_row_bounds(rows, row, &lo, &hi);
    double at = hapi_clamp(row->impulse + is->error[i] * row->inverse, lo, hi);
    if (at != row->impulse) {
      hapi_row_push(is->solver, row, at - row->impulse);
      row->impulse = at;
      moved = true;
    }
  }
  hubs_hold(is);
  for (uint32_t i = is->first; moved && i != HAPI_NO_SOLVER_ROW; i = rows[i].next) {
    is->error[i] = rows[i].inverse != 0.0 ? hapi_row_error(is->solver, &rows[i]) : 0.0;
  }
}

static void cut_to(hapi_island *is, hapi_row *row, double p)
{
  if (p != row->impulse) {
    hapi_row_push(is->solver, row, p - row->impulse);
    row->impulse = p;
  }
}

static void cut_ball(hapi_island *is, hapi_row *first)
{
  double radius = hapi_ball_radius(is->solver->rows, first);
  double norm2 = 0.0;
  for (uint32_t i = 0; i < first->ball; ++i) {
    norm2 += first[i].impulse * first[i].impulse;
  }
  double share = norm2 > radius * radius ? radius / sqrt(norm2) : 1.0;
  for (uint32_t i = 0; share < 1.0 && i < first->ball; ++i) {
    cut_to(is, &first[i], share * first[i].impulse);
  }
}

void hapi_island_cut(hapi_island *is)
{
  hapi_row *rows = is->solver->rows;
  for (uint32_t i = is->first; i != HAPI_NO_SOLVER_ROW; i = rows[i].next) {
    double lo;
    double hi;
    if (rows[i].ball > 0) {
      cut_ball(is, &rows[i]);
    } else if (rows[i].round == 0) {
      hapi_row_bounds(rows, &rows[i], &lo, &hi);
      cut_to(is, &rows[i], hapi_clamp(rows[i].impulse, lo, hi));
    }
  }
  hubs_hold(is);
}

/* J, how much more energy the impulses at hand leave than these did: what the rows minimise
 * when no friction slides, a square function of the impulses, whose slope is the error. */
double hapi_island_rise(const hapi_island *is, const double *impulse, const double *error)
{
  double sum = 0.0;
  for (uint32_t i = is->first; i != HAPI_NO_SOLVER_ROW; i = is->solver->rows[i].next) {
    double change = is->solver->rows[i].impulse - impulse[i];
    sum -= 0.5 * change * (is->error[i] + error[i]);
  }
  return sum;
}
