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
#include "solver/island_matrix.h"
#include "solver/island_packs.h"
#include "solver/island_pair.h"
#include "solver/island_triple.h"

#define ROW_MADDS 300    /* to assemble, solve and check a row, in multiply-adds */
#define PACKED_MADDS 800 /* the same of four contacts in a pack */
#define SETTLED 0.25     /* of what may be left: islands add up, and rows say it one by one */
#define MADDS_PER_ROW 36 /* multiply-adds in the time of one row update */

/* ---- rows ---- */

/* Sums over an inspection. */
typedef struct inspection {
  double largest;
  double sum;
  double energy2;
  double opening;
  uint32_t free;
  uint32_t used;
  bool sticking;
  bool changed;
  bool outside;
} inspection;

/* wanted: what its error asks for, N s. */
static inline void row_classify(const hapi_row *rows, hapi_row *row, double wanted, double lo,
                                double hi, inspection *io)
{
  const uint8_t before = row->state;
  const bool may_tie = row->normal >= 0 && hi > 0.0;
  uint8_t state = HAPI_ROW_FIXED;
  if ((wanted > lo && wanted < hi) || (io->sticking && may_tie)) {
    state = HAPI_ROW_FREE;
  } else if (may_tie && rows[row->normal].state == HAPI_ROW_FREE &&
             hapi_friction_follows(rows, row)) {
    state = HAPI_ROW_TIED;
    io->changed |= wanted * row->impulse < 0.0;
  }
  row->state = state;
  io->changed |= state != before;
  io->free += state == HAPI_ROW_FREE;
  io->used += state != HAPI_ROW_FIXED;
}

static inline void row_inspect(const hapi_row *rows, hapi_row *row, double error, double lo,
                               double hi, inspection *io)
{
  const double p = row->impulse;
  const double wanted = p + error * row->inverse;
  const double change = fabs(hapi_clamp(wanted, lo, hi) - p);
  const double due = change * row->response;
  io->outside |= (p < lo) | (p > hi);
  io->largest = hapi_max(due, io->largest);
  io->energy2 += change * due;
  io->sum += due + error;
  row_classify(rows, row, wanted, lo, hi, io);
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
static void ball_inspect(hapi_island *is, uint32_t first, inspection *io)
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
  io->largest = due <= io->largest ? io->largest : due;
  for (uint32_t i = 0; i < row->ball; ++i) {
    double change = wanted[i] - row[i].impulse;
    io->energy2 += change * change * row[i].response;
  }
  for (uint32_t i = 0; i < row->ball && radius > 0.0 && (!slides || io->sticking); ++i) {
    row[i].state = HAPI_ROW_FREE;
    ++io->free;
  }
  if (radius > 0.0 && row->state == HAPI_ROW_FIXED) {
    slide_ball(is, first, radius, wanted);
  }
  io->used += row->state != HAPI_ROW_FIXED ? row->ball : 0;
}

/* Of a normal and its two frictions. */
static void triple_inspect(hapi_island *is, uint32_t first, inspection *io)
{
  hapi_row *rows = is->solver->rows;
  hapi_row *r = &rows[first];
  double *error = is->error + first;
  inspection sums = *io;
  double e[3];
  hapi_triple_errors(is->solver, r, e);
  row_inspect(rows, r, e[0], r->lo, r->hi, &sums);
  const double load = hapi_friction_load(rows, &r[1]);
  for (int i = 1; i < 3; ++i) {
    const double most = hapi_friction_most(&r[i], load);
    row_inspect(rows, &r[i], e[i], -most, most, &sums);
  }
  hapi_v3_copy(e, error);
  *io = sums;
}

/* Of any other. */
static void other_inspect(hapi_island *is, uint32_t index, inspection *io)
{
  hapi_row *row = &is->solver->rows[index];
  double lo;
  double hi;
  hapi_row_bounds(is->solver->rows, row, &lo, &hi);
  const double p = row->impulse;
  is->error[index] = hapi_row_error(is->solver, row);
  row_inspect(is->solver->rows, row, is->error[index], lo, hi, io);
  if (lo == -HUGE_VAL && hi == HUGE_VAL) {
    io->opening =
        hapi_max(fabs(p + is->error[index] * row->inverse - p) * row->response, io->opening);
  }
}

double hapi_island_inspect(hapi_island *is, bool sticking)
{
  const hapi_solver *solver = is->solver;
  inspection sums = {.sticking = sticking};
  if (is->packed.packs != NULL) {
    hapi_pack_look look;
    hapi_packed_inspect(is, sticking, &look);
    sums.largest = look.largest;
    sums.energy2 = look.energy2;
    sums.sum = look.sum;
    sums.free = look.free;
    sums.changed = look.changed;
    sums.outside = look.outside;
  }
  for (uint32_t i = is->first; i != HAPI_NO_SOLVER_ROW; i = solver->rows[i].next) {
    const hapi_row *row = &solver->rows[i];
    if (row->triple) {
      triple_inspect(is, i, &sums);
      i += 2; /* its frictions */
    } else if (row->ball > 0 || row->round > 0) {
      sums.changed = sums.outside = true; /* what slides there turns */
      if (row->ball > 0) {
        ball_inspect(is, i, &sums);
      }
    } else {
      other_inspect(is, i, &sums);
    }
  }
  is->free_rows = sums.free;
  is->used_rows = sums.used;
  is->look.changed = sums.changed;
  is->look.outside = sums.outside;
  is->look.settled = sums.largest < solver->coarse.largest &&
                     sums.opening <= solver->coarse.opening &&
                     sums.energy2 < SETTLED * solver->coarse.energy2;
  return sums.largest + 0.0 * sums.sum; /* NaN if one was: comparisons and cuts at bounds lose it */
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
  hapi_set_add(&is->link[is->count], is->count);
  is->body[is->count] = (uint16_t)body;
  is->local[body] = (uint16_t)is->count++;
  return true;
}

static void link_bodies(hapi_island *is, uint32_t a, uint32_t b)
{
  const uint16_t i = is->local[a];
  const uint16_t k = is->local[b];
  if (i != HAPI_NO_BODY && k != HAPI_NO_BODY) {
    hapi_set_add(&is->link[i], k);
    hapi_set_add(&is->link[k], i);
  }
}

static bool gather_packed(hapi_island *is, const hapi_packs *packs)
{
  for (uint32_t i = 0; i < packs->unit_count; ++i) {
    const hapi_pack_unit *unit = &packs->units[i];
    const hapi_packable *first = &packs->packables[unit->first];
    if (first->place == HAPI_NO_PLACE) {
      continue;
    }
    if (!add_body(is, first->a) || (unit->paired && !add_body(is, first->b))) {
      return false;
    }
    if (unit->paired) {
      link_bodies(is, first->a, first->b);
    }
  }
  return true;
}

/* Also of rows that do not push now: a later round may take them up. */
bool hapi_island_gather(hapi_island *is)
{
  const hapi_row *rows = is->solver->rows;
  const hapi_row *last = NULL;
  is->count = 0;
  memset(is->local, 0xff, is->solver->body_count * sizeof is->local[0]);
  if (is->packed.packs != NULL && !gather_packed(is, is->packed.packs)) {
    return false;
  }
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
    if (!hapi_row_ties_same(&rows[i], last)) {
      last = &rows[i];
      link_bodies(is, rows[i].a, rows[i].b);
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
    hapi_body_set links = hapi_set_both(&is->link[i], left);
    uint32_t degree = hapi_set_has(left, i) ? hapi_set_count(&links) : UINT32_MAX;
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
  madds += is->packed.packs != NULL ? is->packed.packs->contact_count * PACKED_MADDS : 0;
  for (uint32_t i = 0; i < is->count; ++i) {
    hapi_set_add(&left, i);
  }
  for (uint32_t k = 0; k < is->count; ++k) {
    uint32_t p = least_linked(is, &left);
    hapi_set_drop(&left, p);
    is->pivot[k] = (uint16_t)p;
    is->rest[p] = hapi_set_both(&is->link[p], &left);
    uint32_t degree = hapi_set_count(&is->rest[p]);
    madds += 216 * (1 + degree + degree * degree);
    for (uint32_t i = hapi_set_next(&is->rest[p], 0); i < HAPI_ISLAND_BODIES;
         i = hapi_set_next(&is->rest[p], i + 1)) {
      hapi_set_add_all(&is->link[i], &is->rest[p]);
    }
  }
  is->block_count = 0;
  for (uint32_t i = 0; i < is->count; ++i) {
    for (uint32_t j = hapi_set_next(&is->link[i], 0); j < HAPI_ISLAND_BODIES;
         j = hapi_set_next(&is->link[i], j + 1)) {
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

static void add_to(hapi_island *is, uint32_t body, double s, const double b[6])
{
  if (is->local[body] != HAPI_NO_BODY) {
    hapi_madd6(is->dv[body], s, b);
  }
}

static inline void add_drive(hapi_island *is, const hapi_row *row, drive d)
{
  add_row(is, is->local[row->a], d.gain, row->ba, d.from);
  add_to(is, row->a, d.gain * d.error, row->ba);
  if (hapi_row_moves_b(row)) {
    add_row(is, is->local[row->b], d.gain, row->bb, d.from);
    add_to(is, row->b, d.gain * d.error, row->bb);
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
  hapi_island_rest(is);
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
  if (is->packed.packs != NULL) {
    hapi_packed_assemble(is);
  }
}

/* ---- one round ---- */

static double row_moved(const hapi_island *is, uint32_t body, const double j[6])
{
  return is->local[body] == HAPI_NO_BODY ? 0.0 : hapi_dot6(j, is->dv[body]);
}

static void restore_velocities(hapi_island *is)
{
  for (uint32_t i = 0; i < is->count; ++i) {
    memcpy(is->solver->v[is->body[i]], is->saved_v[i], sizeof is->saved_v[i]);
  }
}

static inline double drive_answer(const hapi_island *is, drive d)
{
  double w = row_moved(is, d.from->a, d.from->ja);
  if (hapi_row_moves_b(d.from)) {
    w += row_moved(is, d.from->b, d.from->jb);
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

/* none: zeros, for a body that stands; what is written there is lost. */
static double *dv_of(const hapi_island *is, uint32_t body, double none[6])
{
  memset(none, 0, 6 * sizeof *none);
  return is->local[body] == HAPI_NO_BODY ? none : is->dv[body];
}

/* The three rows of a contact, which answer to their own errors or to the normal's. */
static void push_triple(hapi_island *is, uint32_t first)
{
  const hapi_solver *solver = is->solver;
  hapi_row *r = &solver->rows[first];
  const double *saved = is->saved_impulse + first;
  const double *gain = is->gain + first;
  const double *error = is->error + first;
  double w[3];
  double change[3];
  double none[2][6];
  hapi_triple_speeds(r, dv_of(is, r->a, none[0]), dv_of(is, r->b, none[1]), w);
  for (int i = 0; i < 3; ++i) {
    const int from = r[i].state == HAPI_ROW_TIED ? 0 : i;
    const double asked = gain[i] * (error[from] - w[from]);
    const double p = r[i].state == HAPI_ROW_FIXED ? r[i].impulse : r[i].impulse + asked;
    change[i] = p - saved[i];
    r[i].impulse = p;
  }
  hapi_triple_push(r, change, solver->v[r->a], solver->v[r->b]);
}

/* What the rows of dv ask for: a normal comes before its frictions. The velocities are those of the
 * impulses as they are now, from the saved ones, and not kept along: a set of active rows that
 * cannot be gives impulses so large that nothing of the velocities would be left. */
static void push_rows(hapi_island *is)
{
  const hapi_row *rows = is->solver->rows;
  restore_velocities(is);
  for (uint32_t i = is->first; i != HAPI_NO_SOLVER_ROW; i = rows[i].next) {
    if (rows[i].triple) {
      push_triple(is, i);
      i += 2; /* its frictions */
    } else if (rows[i].ball > 0) {
      push_ball(is, i);
    } else if (rows[i].round == 0) {
      push_to(is, i, row_asked(is, i));
    }
  }
  hubs_hold(is);
  if (is->packed.packs != NULL) {
    hapi_packed_answer(is);
  }
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
  if (is->packed.packs != NULL) {
    hapi_packed_save(is);
  }
}

void hapi_island_restore(hapi_island *is)
{
  for (uint32_t i = is->first; i != HAPI_NO_SOLVER_ROW; i = is->solver->rows[i].next) {
    is->solver->rows[i].impulse = is->saved_impulse[i];
  }
  restore_velocities(is);
  if (is->packed.packs != NULL) {
    hapi_packed_restore(is);
  }
}

void hapi_island_begin(hapi_island *is, hapi_solver *solver)
{
  const uint32_t rows = solver->row_count;
  is->solver = solver;
  is->held = NULL;
  is->packed.packs = NULL;
  is->softening = HAPI_SOFTENING;
  is->gain = solver->work;
  is->error = is->gain + rows;
  is->saved_error = is->error + rows;
  is->saved_impulse = is->saved_error + rows;
  is->kept.error = is->saved_impulse + rows;
  is->kept.impulse = is->kept.error + rows;
  is->kept.v = (double(*)[6])(is->kept.impulse + rows);
  is->free_work = (double *)(is->kept.v + solver->body_count);
}

/* Packs look at the lanes that they do not use, too. */
void hapi_island_rest(hapi_island *is)
{
  if (is->packed.packs != NULL) {
    memset(is->dv, 0, is->solver->body_count * sizeof *is->dv);
    return;
  }
  for (uint32_t i = 0; i < is->count; ++i) {
    memset(is->dv[is->body[i]], 0, sizeof *is->dv);
  }
}

bool hapi_island_place(hapi_island *is)
{
  size_t before = (size_t)(is->free_work - is->solver->work);
  size_t need = 6 * ((size_t)is->count + is->solver->body_count) + 36 * (size_t)is->block_count;
  is->saved_v = (double(*)[6])is->free_work;
  is->dv = is->saved_v + is->count;
  is->blocks = (double(*)[36])(is->dv + is->solver->body_count);
  return before + need <= is->solver->work_count;
}

void hapi_island_factor(hapi_island *is)
{
  matrix_assemble(is);
  hapi_island_decompose(is);
}

void hapi_island_solve(hapi_island *is)
{
  hapi_island_factor(is);
  hapi_island_substitute(is);
  push_rows(is);
}

/* What the errors of a contact ask for. */
static void ask_triple(hapi_island *is, uint32_t first)
{
  const hapi_row *r = &is->solver->rows[first];
  const double *gain = is->gain + first;
  const double *error = is->error + first;
  double asked[3];
  double none[2][6];
  for (int i = 0; i < 3; ++i) {
    const int from = r[i].state == HAPI_ROW_TIED ? 0 : i;
    asked[i] = r[i].state == HAPI_ROW_FIXED ? 0.0 : gain[i] * error[from];
  }
  hapi_triple_push(r, asked, dv_of(is, r->a, none[0]), dv_of(is, r->b, none[1]));
}

void hapi_island_solve_again(hapi_island *is)
{
  const hapi_row *rows = is->solver->rows;
  hapi_island_rest(is);
  for (uint32_t i = is->first; i != HAPI_NO_SOLVER_ROW; i = rows[i].next) {
    HAPI_ASSERT(rows[i].state != HAPI_ROW_SLIDING);
    if (rows[i].triple) {
      ask_triple(is, i);
      i += 2; /* its frictions */
    } else if (rows[i].state != HAPI_ROW_FIXED) {
      const drive d = drive_of(is, &rows[i], i);
      add_to(is, rows[i].a, d.gain * d.error, rows[i].ba);
      if (hapi_row_moves_b(&rows[i])) {
        add_to(is, rows[i].b, d.gain * d.error, rows[i].bb);
      }
    }
  }
  if (is->packed.packs != NULL) {
    hapi_packed_ask(is);
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
  if (is->packed.packs != NULL) {
    hapi_packed_gains(is);
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
  if (is->packed.packs != NULL) {
    moved = hapi_packed_bound(is) || moved;
  }
  for (uint32_t i = is->first; moved && i != HAPI_NO_SOLVER_ROW; i = rows[i].next) {
    if (rows[i].triple) {
      hapi_triple_errors(is->solver, &rows[i], is->error + i);
      i += 2; /* its frictions */
    } else {
      is->error[i] = rows[i].inverse != 0.0 ? hapi_row_error(is->solver, &rows[i]) : 0.0;
    }
  }
  if (moved && is->packed.packs != NULL) {
    hapi_packed_miss(is);
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
  if (is->packed.packs != NULL) {
    hapi_packed_cut(is);
  }
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
