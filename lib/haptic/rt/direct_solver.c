/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* One round of an active-set method for each island of bodies that rows tie together. The impulses
 * at hand say which rows are free (inside their bounds) and which frictions slide (tied to their
 * normal); all others stay as they are. With e the errors of the free rows and R small,
 *
 *   dv = sum of b_i dp_i,   dp_i = (e_i - j_i dv) / (softness_i + R_i)
 *   (I + sum of b_i j_i / (softness_i + R_i)) dv = sum of b_i e_i / (softness_i + R_i)
 *
 * has six unknowns per body whatever the number of rows, and one 6x6 block per touching pair. R
 * makes redundant contacts (four of a box on a floor) well behaved: only the change is regularised,
 * so that what the null space holds from the warm start stays, and the next round takes what R has
 * left of the errors (method of multipliers). */

#include <stdbool.h>
#include <string.h>

#include "haptic/rt/contact_solver.h"

#define BODIES_MAX 512   /* with more in the solver, sweeps only */
#define ISLAND_MAX 128   /* bodies; one bit each */
#define NONE UINT16_MAX  /* local index of a body that does not respond */
#define SOFTENING 1e-8   /* R, relative to the row's own response */
#define INNER_ROUNDS 2   /* active sets tried from one state */
#define WORSE 30.0       /* how much the largest correction may grow in a round */
#define ROW_MADDS 300    /* to assemble, solve and check a row, in multiply-adds */
#define MADDS_PER_ROW 36 /* multiply-adds in the time of one row update */
#define NO_ROW UINT32_MAX
#define ROW_ARRAYS 4u /* of doubles, by row */

enum {
  FIXED,
  FREE,
  TIED
};

typedef struct body_set {
  uint64_t bits[2];
} body_set;

typedef struct island {
  hapi_solver *solver;
  uint32_t first; /* row; the others by hapi_row.next, in their order */
  uint32_t free_rows;
  uint32_t used_rows; /* free or tied */
  uint32_t count;     /* bodies */
  uint32_t block_count;
  uint16_t local[BODIES_MAX]; /* body -> index in the island */
  uint16_t body[ISLAND_MAX];
  uint16_t pivot[ISLAND_MAX]; /* order of elimination */
  body_set link[ISLAND_MAX];  /* the blocks of a body's row, fill included */
  body_set rest[ISLAND_MAX];  /* link when the body is eliminated, of bodies still to come */
  uint16_t block[ISLAND_MAX][ISLAND_MAX];
  double *gain;        /* by row: impulse per error */
  double *error;       /* by row: when last inspected */
  double *saved_error; /* by row, as the next */
  double *saved_impulse;
  double (*saved_v)[6]; /* by local index, as the next */
  double (*dv)[6];
  double (*blocks)[36];
} island;

/* ---- sets of bodies ---- */

static bool has(const body_set *set, uint32_t i)
{
  return (set->bits[i / 64] >> i % 64 & 1) != 0;
}

static void add(body_set *set, uint32_t i)
{
  set->bits[i / 64] |= (uint64_t)1 << i % 64;
}

static void drop(body_set *set, uint32_t i)
{
  set->bits[i / 64] &= ~((uint64_t)1 << i % 64);
}

static body_set both(const body_set *a, const body_set *b)
{
  return (body_set){{a->bits[0] & b->bits[0], a->bits[1] & b->bits[1]}};
}

static void add_all(body_set *set, const body_set *more)
{
  set->bits[0] |= more->bits[0];
  set->bits[1] |= more->bits[1];
}

static uint32_t count_of(const body_set *set)
{
  uint32_t count = 0;
  for (int i = 0; i < 2; ++i) {
    for (uint64_t bits = set->bits[i]; bits != 0; bits &= bits - 1) {
      ++count;
    }
  }
  return count;
}

/* ---- islands ---- */

static uint16_t root(uint16_t *parent, uint16_t i)
{
  while (parent[i] != i) {
    parent[i] = parent[parent[i]];
    i = parent[i];
  }
  return i;
}

/* Lists of the rows of each island, by the island's lowest body. */
static void split(hapi_solver *solver, uint32_t head[BODIES_MAX])
{
  uint16_t parent[BODIES_MAX];
  for (uint32_t i = 0; i < solver->body_count; ++i) {
    parent[i] = (uint16_t)i;
    head[i] = NO_ROW;
  }
  for (uint32_t i = 0; i < solver->row_count; ++i) {
    const hapi_row *row = &solver->rows[i];
    if (row->inverse != 0.0 && row->paired && row->moves_a) {
      uint16_t a = root(parent, (uint16_t)row->a);
      uint16_t b = root(parent, (uint16_t)row->b);
      parent[a > b ? a : b] = a > b ? b : a;
    }
  }
  for (uint32_t i = solver->row_count; i-- > 0;) {
    hapi_row *row = &solver->rows[i];
    if (row->inverse != 0.0) {
      uint16_t r = root(parent, (uint16_t)(row->moves_a ? row->a : row->b));
      row->next = head[r];
      head[r] = i;
    }
  }
}

/* `sticking` takes the friction of all contacts that push for free. `at_bound`: it wants to stay. */
static void classify(island *is, uint32_t i, bool at_bound, double hi, bool sticking)
{
  hapi_row *rows = is->solver->rows;
  hapi_row *row = &rows[i];
  row->state = FIXED;
  if (!at_bound || (sticking && row->normal >= 0 && hi > 0.0)) {
    row->state = FREE;
    is->gain[i] = 1.0 / (row->softness + SOFTENING * row->response);
  } else if (row->normal >= 0 && hi > 0.0 && rows[row->normal].state == FREE) {
    row->state = TIED;
    is->gain[i] = (row->impulse > 0.0 ? row->mu : -row->mu) * is->gain[row->normal];
  }
  is->free_rows += row->state == FREE;
  is->used_rows += row->state != FIXED;
}

/* The states of the rows, for the next round; returns the largest correction due, m/s. */
static double inspect(island *is, bool sticking)
{
  const hapi_solver *solver = is->solver;
  double largest = 0.0;
  is->free_rows = 0;
  is->used_rows = 0;
  for (uint32_t i = is->first; i != NO_ROW; i = solver->rows[i].next) {
    const hapi_row *row = &solver->rows[i];
    double lo;
    double hi;
    hapi_row_bounds(solver->rows, row, &lo, &hi);
    double p = row->impulse;
    is->error[i] = hapi_row_error(solver, row);
    double wanted = p + is->error[i] * row->inverse;
    bool inside = (p > lo && p < hi) || (wanted > lo && wanted < hi);
    double due = fabs(hapi_clamp(wanted, lo, hi) - p) * row->response;
    largest = due <= largest ? largest : due; /* NaN stays, unless the next row hides it */
    classify(is, i, !inside, hi, sticking);
  }
  return largest;
}

/* The row whose error drives this row's impulse. */
static const hapi_row *source(const island *is, const hapi_row *row)
{
  return row->state == TIED ? &is->solver->rows[row->normal] : row;
}

/* ---- structure of the matrix ---- */

static bool add_body(island *is, uint32_t body)
{
  if (is->local[body] != NONE) {
    return true;
  }
  if (is->count == ISLAND_MAX) {
    return false;
  }
  is->link[is->count] = (body_set){{0, 0}};
  add(&is->link[is->count], is->count);
  is->body[is->count] = (uint16_t)body;
  is->local[body] = (uint16_t)is->count++;
  return true;
}

/* Also of rows that do not push now: a later round may take them up. */
static bool gather(island *is)
{
  const hapi_row *rows = is->solver->rows;
  is->count = 0;
  memset(is->local, 0xff, is->solver->body_count * sizeof is->local[0]);
  for (uint32_t i = is->first; i != NO_ROW; i = rows[i].next) {
    if ((rows[i].moves_a && !add_body(is, rows[i].a)) ||
        (rows[i].paired && !add_body(is, rows[i].b))) {
      return false;
    }
  }
  for (uint32_t i = is->first; i != NO_ROW; i = rows[i].next) {
    uint16_t a = is->local[rows[i].a];
    uint16_t b = is->local[rows[i].b];
    if (a != NONE && b != NONE) { /* a body on rails may answer to some of its rows only */
      add(&is->link[a], b);
      add(&is->link[b], a);
    }
  }
  return true;
}

/* Body of least degree among those left: chains and trees get no fill at all. */
static uint32_t least_linked(const island *is, const body_set *left)
{
  uint32_t best = 0;
  uint32_t best_degree = UINT32_MAX;
  for (uint32_t i = 0; i < is->count; ++i) {
    body_set links = both(&is->link[i], left);
    uint32_t degree = has(left, i) ? count_of(&links) : UINT32_MAX;
    if (degree < best_degree) {
      best_degree = degree;
      best = i;
    }
  }
  return best;
}

/* Order, fill and places of the blocks; the cost in row updates. */
static uint32_t plan(island *is)
{
  body_set left = {{0, 0}};
  uint32_t madds = is->used_rows * ROW_MADDS;
  for (uint32_t i = 0; i < is->count; ++i) {
    add(&left, i);
  }
  for (uint32_t k = 0; k < is->count; ++k) {
    uint32_t p = least_linked(is, &left);
    drop(&left, p);
    is->pivot[k] = (uint16_t)p;
    is->rest[p] = both(&is->link[p], &left);
    uint32_t degree = count_of(&is->rest[p]);
    madds += 216 * (1 + degree + degree * degree);
    for (uint32_t i = 0; i < is->count; ++i) {
      if (has(&is->rest[p], i)) {
        add_all(&is->link[i], &is->rest[p]);
      }
    }
  }
  is->block_count = 0;
  for (uint32_t i = 0; i < is->count; ++i) {
    for (uint32_t j = 0; j < is->count; ++j) {
      is->block[i][j] = (uint16_t)is->block_count;
      is->block_count += has(&is->link[i], j);
    }
  }
  return INNER_ROUNDS * (madds / MADDS_PER_ROW);
}

/* ---- numbers ---- */

/* block += s b j^T */
static void add_outer(double *restrict block, double s, const double *restrict b,
                      const double *restrict j)
{
  for (int i = 0; i < 6; ++i) {
    double sb = s * b[i];
    for (int k = 0; k < 6; ++k) {
      block[6 * i + k] += sb * j[k];
    }
  }
}

static void add_row(island *is, uint16_t to, double s, const double b[6], const hapi_row *from)
{
  uint16_t a = is->local[from->a];
  uint16_t other = from->paired ? is->local[from->b] : NONE;
  if (to != NONE && a != NONE) {
    add_outer(is->blocks[is->block[to][a]], s, b, from->ja);
  }
  if (to != NONE && other != NONE) {
    add_outer(is->blocks[is->block[to][other]], s, b, from->jb);
  }
}

static void add_to(island *is, uint16_t local, double s, const double b[6])
{
  if (local != NONE) {
    hapi_madd6(is->dv[local], s, b);
  }
}

/* Matrix and right side, dv = sum of gain b e, with the errors of the last look. One walk for
 * both: the rows are more than fits into a near cache. */
static void assemble(island *is)
{
  const hapi_row *rows = is->solver->rows;
  memset(is->blocks, 0, is->block_count * sizeof *is->blocks);
  memset(is->dv, 0, is->count * sizeof *is->dv);
  for (uint32_t i = 0; i < is->count; ++i) {
    for (int k = 0; k < 36; k += 7) {
      is->blocks[is->block[i][i]][k] = 1.0;
    }
  }
  for (uint32_t i = is->first; i != NO_ROW; i = rows[i].next) {
    const hapi_row *row = &rows[i];
    if (row->state == FIXED) {
      continue;
    }
    const hapi_row *from = source(is, row);
    double push = is->gain[i] * is->error[from - rows];
    add_row(is, is->local[row->a], is->gain[i], row->ba, from);
    add_to(is, is->local[row->a], push, row->ba);
    if (row->paired) {
      add_row(is, is->local[row->b], is->gain[i], row->bb, from);
      add_to(is, is->local[row->b], push, row->bb);
    }
  }
}

/* One step of Gauss and Jordan: row k by the pivot, the others freed of column k, in which the
 * inverse grows. */
static void eliminate(double m[36], int k)
{
  double pivot = 1.0 / m[7 * k];
  m[7 * k] = 1.0;
  for (int c = 0; c < 6; ++c) {
    m[6 * k + c] *= pivot;
  }
  for (int i = 0; i < 6; ++i) {
    if (i != k) {
      double f = m[6 * i + k];
      m[6 * i + k] = 0.0;
      for (int c = 0; c < 6; ++c) {
        m[6 * i + c] -= f * m[6 * k + c];
      }
    }
  }
}

/* m = m^-1. No pivoting: such a block is 1 plus a product of positive definite matrices as long as
 * nothing slides, and what sliding spoils is not accepted. */
static void invert(double m[36])
{
  for (int k = 0; k < 6; ++k) {
    eliminate(m, k);
  }
}

/* out = out - a b */
static void multiply_sub(const double a[36], const double b[36], double out[36])
{
  for (int i = 0; i < 6; ++i) {
    double row[6];
    memcpy(row, out + 6 * i, sizeof row);
    for (int k = 0; k < 6; ++k) {
      for (int c = 0; c < 6; ++c) {
        row[c] -= a[6 * i + k] * b[6 * k + c];
      }
    }
    memcpy(out + 6 * i, row, sizeof row);
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
static void factor(island *is)
{
  for (uint32_t k = 0; k < is->count; ++k) {
    uint16_t p = is->pivot[k];
    double *diagonal = is->blocks[is->block[p][p]];
    invert(diagonal);
    for (uint32_t i = 0; i < is->count; ++i) {
      if (!has(&is->rest[p], i)) {
        continue;
      }
      double *below = is->blocks[is->block[i][p]];
      double l[36] = {0.0};
      multiply_sub(below, diagonal, l);
      for (int c = 0; c < 36; ++c) {
        below[c] = l[c] = -l[c];
      }
      for (uint32_t j = 0; j < is->count; ++j) {
        if (has(&is->rest[p], j)) {
          multiply_sub(l, is->blocks[is->block[p][j]], is->blocks[is->block[i][j]]);
        }
      }
    }
  }
}

/* dv: in right side, out solution */
static void substitute(island *is)
{
  for (uint32_t k = 0; k < is->count; ++k) {
    uint16_t p = is->pivot[k];
    for (uint32_t i = 0; i < is->count; ++i) {
      if (has(&is->rest[p], i)) {
        apply_sub(is->blocks[is->block[i][p]], is->dv[p], is->dv[i]);
      }
    }
  }
  for (uint32_t k = is->count; k-- > 0;) {
    uint16_t p = is->pivot[k];
    double y[6];
    memcpy(y, is->dv[p], sizeof y);
    for (uint32_t j = 0; j < is->count; ++j) {
      if (has(&is->rest[p], j)) {
        apply_sub(is->blocks[is->block[p][j]], is->dv[j], y);
      }
    }
    const double *inverse = is->blocks[is->block[p][p]];
    for (int i = 0; i < 6; ++i) {
      is->dv[p][i] = hapi_dot6(inverse + 6 * i, y);
    }
  }
}

/* ---- one round ---- */

static double moved(const island *is, uint16_t local, const double j[6])
{
  return local == NONE ? 0.0 : hapi_dot6(j, is->dv[local]);
}

static void restore_velocities(island *is)
{
  for (uint32_t i = 0; i < is->count; ++i) {
    memcpy(is->solver->v[is->body[i]], is->saved_v[i], sizeof is->saved_v[i]);
  }
}

/* What the rows of dv ask for, cut at the bounds: a normal comes before its frictions. The
 * velocities are those of the impulses as they are now, from the saved ones, and not kept along: a set
 * of active rows that cannot be gives impulses so large that nothing of the velocities would be left. */
static void push_rows(island *is)
{
  hapi_row *rows = is->solver->rows;
  restore_velocities(is);
  for (uint32_t i = is->first; i != NO_ROW; i = rows[i].next) {
    hapi_row *row = &rows[i];
    double p = row->impulse;
    double lo;
    double hi;
    if (row->state != FIXED) {
      const hapi_row *from = source(is, row);
      double w = moved(is, is->local[from->a], from->ja);
      if (from->paired) {
        w += moved(is, is->local[from->b], from->jb);
      }
      p += is->gain[i] * (is->error[from - rows] - w);
    }
    hapi_row_bounds(rows, row, &lo, &hi);
    p = hapi_clamp(p, lo, hi);
    hapi_row_push(is->solver, row, p - is->saved_impulse[i]);
    row->impulse = p;
  }
}

static void save(island *is)
{
  for (uint32_t i = is->first; i != NO_ROW; i = is->solver->rows[i].next) {
    is->saved_impulse[i] = is->solver->rows[i].impulse;
    is->saved_error[i] = is->error[i];
  }
  for (uint32_t i = 0; i < is->count; ++i) {
    memcpy(is->saved_v[i], is->solver->v[is->body[i]], sizeof is->saved_v[i]);
  }
}

static void restore(island *is)
{
  for (uint32_t i = is->first; i != NO_ROW; i = is->solver->rows[i].next) {
    is->solver->rows[i].impulse = is->saved_impulse[i];
  }
  restore_velocities(is);
}

/* Places the arrays in the work; false if they do not fit. */
static bool place(island *is)
{
  size_t rows = is->solver->row_count;
  size_t need = ROW_ARRAYS * rows + 12 * (size_t)is->count + 36 * (size_t)is->block_count;
  double *at = is->solver->work + ROW_ARRAYS * rows;
  is->saved_v = (double(*)[6])at;
  is->dv = is->saved_v + is->count;
  is->blocks = (double(*)[36])(at + 12 * is->count);
  return need <= is->solver->work_count;
}

/* Impulses of the rows that are free or tied now, cut at their bounds. */
static void solve(island *is)
{
  assemble(is);
  factor(is);
  substitute(is);
  push_rows(is);
}

/* One sweep: where a normal lets go, its frictions go as well, and that shows. */
static void settle(island *is)
{
  hapi_row *rows = is->solver->rows;
  for (uint32_t i = is->first; i != NO_ROW; i = rows[i].next) {
    hapi_row *row = &rows[i];
    double lo;
    double hi;
    hapi_row_bounds(rows, row, &lo, &hi);
    double wanted = row->impulse + hapi_row_error(is->solver, row) * row->inverse;
    hapi_row_push(is->solver, row, hapi_clamp(wanted, lo, hi) - row->impulse);
  }
}

/* J, how much more energy the impulses at hand leave than the saved ones did: what the rows minimise
 * when no friction slides, a square function of the impulses, whose slope is the error. */
static double rise(const island *is)
{
  double sum = 0.0;
  for (uint32_t i = is->first; i != NO_ROW; i = is->solver->rows[i].next) {
    double change = is->solver->rows[i].impulse - is->saved_impulse[i];
    sum -= 0.5 * change * (is->error[i] + is->saved_error[i]);
  }
  return sum;
}

/* Whether the state after a round is to be kept. The largest correction due, of one row at a bound, is a
 * poor measure of the whole: it may grow for a while where sweeps and further rounds follow. Where
 * there is no room for them, the last one, the round must leave less energy as well, or its impulses
 * blow up in the ticks to come. */
static bool is_better(const island *is, double due, double best, bool last)
{
  return last ? due < best && rise(is) < 0.0 : due < WORSE * best;
}

/* The best of some rounds is kept, each with the active set that the one before leads to. */
static bool improve(island *is, double before, bool last, double *out_due)
{
  double best = before;
  bool better = false;
  *out_due = before;
  save(is);
  for (int round = 0; round < INNER_ROUNDS; ++round) {
    solve(is);
    double due = inspect(is, false);
    if (last && !(due < is->solver->tolerance)) {
      settle(is);
      due = inspect(is, false);
    }
    if (due < is->solver->tolerance) {
      *out_due = due;
      return true; /* nothing to save, nothing to restore */
    }
    if (better ? due < best : is_better(is, due, best, last)) {
      *out_due = best = due;
      save(is);
      better = true;
    }
  }
  restore(is);
  return better;
}

uint32_t hapi_direct_run(hapi_solver *solver, uint32_t budget)
{
  island is;
  uint32_t head[BODIES_MAX];
  uint32_t spent = 0;
  /* With heavy bodies on light ones sweeps find far too small normal impulses and slide what should
   * stick; from sticking the set is found. Tried second, as the set from the warm start is mostly
   * right, and again where neither leads to the end. */
  bool sticking = solver->sweeps % 3 == 0;
  solver->too_dear = false;
  solver->direct_residual = HUGE_VAL;
  if (solver->body_count > BODIES_MAX ||
      solver->work_count < ROW_ARRAYS * (size_t)solver->row_count) {
    return 0;
  }
  split(solver, head);
  solver->direct_residual = 0.0;
  is.solver = solver;
  is.gain = solver->work;
  is.error = is.gain + solver->row_count;
  is.saved_error = is.error + solver->row_count;
  is.saved_impulse = is.saved_error + solver->row_count;
  for (uint32_t i = 0; i < solver->body_count; ++i) {
    is.first = head[i];
    if (is.first == NO_ROW) {
      continue;
    }
    double before = inspect(&is, sticking);
    double due = before;
    if (!(before >= solver->tolerance)) {
      solver->direct_residual = fmax(solver->direct_residual, before);
      continue;
    }
    if (is.free_rows == 0 || is.free_rows > solver->direct_rows || !gather(&is)) {
      solver->too_dear = solver->too_dear || is.free_rows > 0;
      solver->direct_residual = HUGE_VAL;
      continue;
    }
    uint32_t cost = plan(&is);
    if (cost <= budget - spent && place(&is)) {
      spent += cost;
      bool last = 2 * (uint64_t)(budget - spent) <= solver->update_budget;
      solver->direct_solves += improve(&is, before, last, &due);
    } else {
      solver->too_dear = true;
    }
    solver->direct_residual = fmax(solver->direct_residual, due);
  }
  return spent;
}
