/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SOLVER_CONTACT_SOLVER_H
#define HAPODE_SOLVER_CONTACT_SOLVER_H

/* Impulses of contacts, by ODE's friction pyramid or within a ball: the box LCP on the level of
 * velocities.
 *
 *   w = ja.v[a] + jb.v[b],   v = free velocity + sum over rows of (ba, bb) impulse
 *   lo < impulse < hi:  w + softness impulse = target
 *   impulse == lo:      w + softness impulse >= target
 *   impulse == hi:      w + softness impulse <= target
 *
 * Sweeps of projected Gauss-Seidel, forward and backward by turns, find which rows push, stick and
 * slide; a direct solve over the bodies of an island (direct_solver.c) then gives their impulses,
 * and sweeps again check it. The same input gives the same bits. */

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/six.h"
#include "base/vec.h"
#include "solver/packs.h"
#include "solver/row.h"

/* Direct solves that were too dear, or in vain, are left out for some runs. */
typedef struct hapi_direct_rest {
  uint32_t rows; /* they were for so many; 0: nothing rests */
  uint32_t runs; /* for so many more */
  uint32_t vain; /* runs one after the other in which no direct solve was any better */
} hapi_direct_rest;

/* How a direct run has ended. */
typedef enum hapi_direct_end {
  HAPI_DIRECT_DONE = 0,
  HAPI_DIRECT_REDUCED, /* of a mechanism less than HAPI_UNSOLVED is left undone, which plain sweeps
                          would only spoil */
  HAPI_DIRECT_DEAR     /* an island was too large or too dear for the budget */
} hapi_direct_end;

/* The last direct run. */
typedef struct hapi_direct_last {
  hapi_direct_end end;
  uint32_t cost;   /* row updates */
  uint32_t runs;   /* before it, of the same run of the solver */
  double residual; /* the largest correction due after it, m/s */
} hapi_direct_last;

/* A run is done also when the corrections of a sweep are small enough. */
typedef struct hapi_coarse {
  double energy2; /* J: their sum of impulse^2 x response is below; 0: never done so */
  double largest; /* m/s: so are all of them; the next run goes on from its impulses */
  double opening; /* m/s: none of a row without bounds, as of a joint, is above */
} hapi_coarse;

typedef struct hapi_solver {
  hapi_row *rows;
  double (*v)[6];    /* in: free velocities, without any row's impulse; out: with all */
  double (*free)[6]; /* in: the same again, stays; for hubs and hapi_solver_calm */
  uint32_t row_count;
  uint32_t body_count;
  /* The last bodies of all, always b in their rows: each may touch many others, as light pointers
   * do. An island about them is solved part by part. */
  uint32_t hub_count;
  double tolerance;       /* m/s: done when the largest correction of a sweep is below */
  hapi_coarse coarse;     /* what may stay undone */
  uint32_t update_budget; /* row updates in all sweeps and direct solves, these counted by their
                             cost; two sweeps are made in any case */
  uint32_t enough;      /* row updates, counted likewise: where `coarse` is above 0 and what is due
                           is little, the rest is for the next run; 0: until it is settled */
  uint32_t max_sweeps;  /* beyond two; 0: what update_budget allows */
  uint32_t direct_rows; /* islands of at most this many free rows are solved directly; 0: none */
  double *work;         /* for direct solves; an island that does not fit is left to sweeps */
  size_t work_count;    /* doubles, see HAPI_SOLVER_WORK */
  hapi_packs packs;     /* its arrays; work NULL: rows are updated one by one */

  bool ready; /* in: every row is (hapi_row_ready), or the rows are those of the last run, with
                         its impulses in v, but for hapi_row_retarget */
  bool owes;  /* in: impulses of triples are not in v yet */
  bool apart; /* in: all rows are single, and no two have a body in common: one sweep solves them */
  hapi_direct_rest rest;   /* inner */
  hapi_direct_last direct; /* inner */
  uint32_t sweeps;         /* out */
  uint64_t updates;        /* out: row updates, direct solves counted by their cost */
  uint32_t direct_solves;  /* out: that were accepted */
  double residual;         /* out, m/s: the largest correction still due; HUGE_VAL: v not finite */
  hapi_corrections swept;  /* inner: of the last sweep */
} hapi_solver;

/* m/s: what is left undone and may add energy; below, asking costs too much */
#define HAPI_UNSOLVED 3e-3

#define HAPI_COARSE 1e-4 /* m/s, that a run of few rows may leave undone */

/* Doubles of work for stacks, chains and flat piles: 16 blocks of 6x6 for each body. A dense island
 * of n bodies takes n. */
#define HAPI_SOLVER_WORK(rows, bodies) ((size_t)(rows)*6 + (size_t)(bodies)*600)

/* [haptic] Works in rows, v and work only, with 56 kB of stack; bounded by update_budget whatever
 * the input. A row that cannot be used (not finite, index out of range) gets no impulse. Impulses
 * of packed contacts stay in the packs: hapi_packs_impulses tells them, hapi_packs_store brings
 * them to the rows. */
void hapi_solver_run(hapi_solver *solver);

/* [haptic] After a run. Impulses of an island that could not be solved within the budget may leave
 * more energy than none at all, and as warm start more again from tick to tick: such are shortened
 * to where they leave least, and swept again. What then still leaves more is shortened again, to
 * none where the impulses are no numbers: whatever the run has found, beyond what the rows' targets
 * give it adds no energy. Costs two sweeps where nothing is to be done, and nothing where the run
 * has ended well. */
void hapi_solver_calm(hapi_solver *solver);

/* No rows; the next ones are made or made ready again one after the other. */
static inline void hapi_solver_clear(hapi_solver *solver)
{
  solver->row_count = 0;
  solver->packs.known.ready = solver->packs.known.news = 0;
  solver->owes = false;
}

/* Prepares a row and adds its warm start to v. Where rows are made one by one this is done best as
 * soon as one is filled in, while it is at hand: there are more of them than fit into a near cache.
 * In their order; v, row_count and body_count are set before. */
void hapi_row_ready(hapi_solver *solver, uint32_t index);

/* The same of a single row without another one's bounds, of which ja.ba is known. */
void hapi_single_ready(hapi_solver *solver, uint32_t index, double response);

/* The same of the 1 to 3 rows of a contact, of the same two bodies: its normal, then its
 * frictions. by_mass: linear parts are those of one direction a row, of length 1 and at right
 * angles, b's opposite to a's; moments are those of one point; and what responds does so by its
 * mass and packs.inverse_inertia. */
void hapi_contact_ready(hapi_solver *solver, uint32_t first, uint32_t count, bool by_mass);

/* The same of rows that were ready in the last run, all of use, with the impulses of that run; the
 * normal has another target. Rows that were in another place then have their impulses, see
 * hapi_packs_begin. */
void hapi_contact_again(hapi_solver *solver, uint32_t first, uint32_t count);

/* The same of triples of which the targets are those of that run as well, and which move both
 * bodies or are single: nothing of their rows is looked at. by_mass: how many are, see
 * hapi_contact_ready. */
static inline void hapi_contact_stands(hapi_solver *solver, uint32_t by_mass)
{
  solver->packs.known.ready += by_mass;
  solver->owes = true;
}

/* [haptic] Rows of the last run are in another place than there. */
static inline void hapi_contact_moved(hapi_solver *solver)
{
  ++solver->packs.known.made;
  solver->packs.known.alike = false;
}

/* ---- inner: between contact_solver.c, direct_solver.c and solver_calm.c ---- */

/* Of a sweep, in row updates: those of all lanes of a pack take as long as two. */
uint32_t hapi_solver_sweep_cost(const hapi_solver *solver);

/* A few sweeps more, two at least, from the impulses at hand. */
void hapi_solver_sweep_on(hapi_solver *solver);

/* The velocities that the impulses make, of rows and packs alike: what was kept along is off by the
 * rounding of the largest impulse that there ever was. */
void hapi_solver_rebuild(hapi_solver *solver);

/* The rows that are in no pack. */
static inline uint32_t hapi_loose_count(const hapi_solver *solver)
{
  return solver->packs.in_use ? solver->packs.loose_count : 1;
}

static inline hapi_loose_rows hapi_loose_at(const hapi_solver *solver, uint32_t i)
{
  return solver->packs.in_use ? solver->packs.loose[i] : (hapi_loose_rows){0, solver->row_count};
}

/* N s, the largest impulse of a friction under a load; of a ball the radius. */
static inline double hapi_friction_most(const hapi_row *friction, double load)
{
  return load > 0.0 ? friction->mu * load : 0.0; /* mu may be infinite: no 0 x infinity */
}

/* N s, of a normal: one that sticks holds its friction, too. */
static inline double hapi_row_load(const hapi_row *normal)
{
  return normal->impulse - normal->lo;
}

/* N s, that a friction goes by. */
static inline double hapi_friction_load(const hapi_row *rows, const hapi_row *friction)
{
  return hapi_max(hapi_row_load(&rows[friction->normal]), friction->hi);
}

/* Whether it grows and shrinks with its normal. */
static inline bool hapi_friction_follows(const hapi_row *rows, const hapi_row *friction)
{
  return hapi_row_load(&rows[friction->normal]) >= friction->hi;
}

static inline double hapi_ball_radius(const hapi_row *rows, const hapi_row *first)
{
  return hapi_friction_most(first, hapi_friction_load(rows, first));
}

/* The nearest impulses of the ball to what the errors of its rows ask for, and whether that is out
 * of it, where the friction slides against the motion; returns the correction, m/s. */
double hapi_ball_wanted(const hapi_row *first, double radius, const double errors[3], double out[3],
                        bool *out_slides);

/* One update of the ball that begins with the row; returns the correction, m/s. */
double hapi_ball_update(hapi_solver *solver, hapi_row *first);

/* Solves the islands that still need it, for at most `budget` row updates; returns the cost in row
 * updates. Sets end and residual of `direct`. Rows are prepared, v has the impulses. */
uint32_t hapi_direct_run(hapi_solver *solver, uint32_t budget);

static inline double hapi_clamp(double x, double lo, double hi)
{
  double y = x > lo ? x : lo;
  return y < hi ? y : hi;
}

/* N s, what the frictions before it leave of the ball's radius */
static inline double hapi_row_left(const hapi_row *row, double radius)
{
  double left = radius * radius;
  for (int i = 1; i <= row->round; ++i) {
    left -= row[-i].impulse * row[-i].impulse;
  }
  return left > 0.0 ? sqrt(left) : 0.0;
}

static inline void hapi_row_bounds(const hapi_row *rows, const hapi_row *row, double *out_lo,
                                   double *out_hi)
{
  *out_lo = row->lo;
  *out_hi = row->hi;
  if (row->normal >= 0) {
    *out_hi = hapi_friction_most(row, hapi_friction_load(rows, row));
    if (row->round > 0) {
      *out_hi = hapi_row_left(row, *out_hi);
    }
    *out_lo = -*out_hi;
  }
}

/* m/s, what is missing to w + softness impulse = target */
static inline double hapi_row_error(const hapi_solver *solver, const hapi_row *row)
{
  double rest = row->drive - row->softness * row->impulse;
  double w = hapi_dot6(row->ja, solver->v[row->a]);
  if (hapi_row_moves_b(row)) {
    w += hapi_dot6(row->jb, solver->v[row->b]);
  }
  return rest - w;
}

/* Another target between two runs, of a row in no pack or of a packable contact's normal. */
static inline void hapi_row_retarget(hapi_row *row, double target)
{
  row->drive += target - row->target;
  row->target = target;
}

static inline void hapi_row_push(hapi_solver *solver, hapi_row *row, double change)
{
  row->impulse += change;
  hapi_madd6(solver->v[row->a], change, row->ba);
  if (hapi_row_moves_b(row)) {
    hapi_madd6(solver->v[row->b], change, row->bb);
  }
}

#endif
