/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* hapode-bench influence: which bodies matter for the felt force, and what a border of the range
 * costs. Plain ODE with many iterations is right; from states of it the next interval of physics is
 * run once more with some bodies answering otherwise. Sessions with a range that ends early say
 * what the border costs over the whole path. */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench.h"
#include "bench/influence_range.h"
#include "bench/influence_sim.h"

#define WINDOW 17 /* ticks: the interval of physics, 1 / 60 s */
#define SECONDS (1e-3 * WINDOW)
#define HOPS_MOST 64
#define HOPS_SAID 4
#define MOMENTS 3        /* windows that are run again */
#define ALONE_MOST 64    /* boxes of a world of which each is tried alone */
#define BIG 150          /* boxes: fewer iterations from there on */
#define FLOOR_MOST 0.005 /* a window again: contacts come in another order */
#define WANTED 0.01      /* error of the force */

static const double moments_s[MOMENTS] = {0.15, 0.25, 0.35}; /* of the way */

typedef struct influence_world {
  const char *name;
  int bodies;
  bool quick;
} influence_world;

static const influence_world worlds[] = {
    {"row", 30, true},   {"carpet", 49, true}, {"pile", 30, true},   {"pile", 64, false},
    {"row", 100, false}, {"pile", 100, false}, {"pile", 300, false}, {"pile", 1000, false},
};

/* The state at a sync, and what came then. */
typedef struct influence_moment {
  double at_s;
  influence_motion *motions;
  double *dv;             /* m/s, x y z of each box: since the sync before */
  influence_pair *pushes; /* means over the interval before */
  size_t push_count;
  influence_pair *next[WINDOW]; /* pairs of each tick that follows */
  size_t next_count[WINDOW];
  double force[WINDOW][3];
} influence_moment;

/* How the world beyond a border answers: of what free bodies would give way. */
typedef struct influence_answer {
  size_t windows;
  size_t grown;     /* since the window before, by more than a step can bear */
  size_t not_equal; /* to a tenth more of the push as to a tenth less */
  double least;
  double most;
  double last;
} influence_answer;

static const int answer_hops[] = {0, 1, 2, 4};
#define ANSWERS (sizeof answer_hops / sizeof answer_hops[0])

/* How long what was measured at a sync holds beyond each border. */
typedef struct influence_hold {
  size_t windows;
  size_t ticks;
  size_t valid[HOPS_MOST];   /* ticks with all pairs beyond as at the sync */
  double changed[HOPS_MOST]; /* of the pairs beyond, at the end of windows, the sum */
} influence_hold;

typedef struct influence_bed {
  bench *bench;
  const influence_world *of;
  peer_world world;
  influence_sim sim;
  int *hops; /* of each box, from the one that the hand meets */
  int hops_most;
  size_t *by_hops;                   /* boxes, nearest first */
  influence_moment window;           /* the one that runs */
  influence_moment moments[MOMENTS]; /* that are kept */
  influence_answer answers[ANSWERS];
  influence_hold rest;
  influence_hold pushed;
  influence_pair *now;
  const influence_pair *before; /* at the sync */
  influence_pair *sums;
  size_t before_count;
  size_t sum_count;
  FILE *bodies_csv;
  FILE *sets_csv;
  FILE *holds_csv;
  FILE *answers_csv;
  FILE *range_csv;
} influence_bed;

static int by_boxes(const void *x, const void *y)
{
  const influence_pair *a = x;
  const influence_pair *b = y;
  return a->a != b->a ? (a->a > b->a) - (a->a < b->a) : (a->b > b->b) - (a->b < b->b);
}

/* ---- pairs that touch ---- */

/* From the contacts of the last step. */
static void hops_find(influence_bed *bed)
{
  size_t count = influence_sim_pairs(&bed->sim, bed->now);
  size_t done = 1;
  for (size_t i = 0; i < bed->world.count; ++i) {
    bed->hops[i] = i == 0 ? 0 : HOPS_MOST - 1;
  }
  bed->by_hops[0] = 0;
  for (size_t next = 0; next < done; ++next) {
    int own = (int)bed->by_hops[next];
    for (size_t i = 0; i < count; ++i) {
      const influence_pair *p = &bed->now[i];
      int other = p->a == own ? p->b : p->b == own ? p->a : -1;
      if (other > 0 && bed->hops[other] == HOPS_MOST - 1 && bed->hops[own] < HOPS_MOST - 2) {
        bed->hops[other] = bed->hops[own] + 1;
        bed->by_hops[done++] = (size_t)other;
      }
    }
  }
  bed->hops_most = bed->hops[bed->by_hops[done - 1]];
  for (size_t i = 0; i < bed->world.count; ++i) {
    if (bed->hops[i] == HOPS_MOST - 1) {
      bed->by_hops[done++] = i;
    }
  }
}

static int pair_hops(const influence_bed *bed, const influence_pair *p)
{
  int b = bed->hops[p->b];
  return p->a < 0 || bed->hops[p->a] > b ? b : bed->hops[p->a];
}

/* Pairs that are not as they were, by the hops of the nearer of their bodies. */
static void changes_count(const influence_bed *bed, size_t count, size_t out_changed[HOPS_MOST],
                          size_t out_all[HOPS_MOST])
{
  const influence_pair none = {.normals = 0};
  size_t k = 0;
  for (size_t i = 0; i < count || k < bed->before_count;) {
    int order = i == count               ? 1
                : k == bed->before_count ? -1
                                         : by_boxes(&bed->now[i], &bed->before[k]);
    const influence_pair *x = order <= 0 ? &bed->now[i] : &none;
    const influence_pair *y = order >= 0 ? &bed->before[k] : &none;
    int hops = pair_hops(bed, order <= 0 ? x : y);
    out_changed[hops] += x->normals != y->normals || x->saturated != y->saturated;
    out_all[hops] += x->normals > 0 || y->normals > 0;
    i += order <= 0;
    k += order >= 0;
  }
}

static void hold_note(const influence_bed *bed, size_t count, bool last, influence_hold *io)
{
  size_t changed[HOPS_MOST] = {0};
  size_t all[HOPS_MOST] = {0};
  size_t changed_beyond = 0;
  size_t all_beyond = 0;
  changes_count(bed, count, changed, all);
  for (int h = HOPS_MOST - 2; h >= 0; --h) { /* the border is beyond the bodies of h hops */
    changed_beyond += changed[h + 1];
    all_beyond += all[h + 1];
    io->valid[h] += changed_beyond == 0;
    if (last && all_beyond > 0) {
      io->changed[h] += (double)changed_beyond / (double)all_beyond;
    }
  }
  ++io->ticks;
  io->windows += last;
}

static void sums_add(influence_bed *bed, size_t count)
{
  size_t old = bed->sum_count;
  for (size_t i = 0; i < count; ++i) {
    influence_pair *sum = bsearch(&bed->now[i], bed->sums, old, sizeof *sum, by_boxes);
    if (sum == NULL) {
      sum = &bed->sums[bed->sum_count++];
      memset(sum, 0, sizeof *sum);
      sum->a = bed->now[i].a;
      sum->b = bed->now[i].b;
    }
    for (int k = 0; k < 6; ++k) {
      sum->on_a[k] += bed->now[i].on_a[k] / WINDOW;
      sum->on_b[k] += bed->now[i].on_b[k] / WINDOW;
    }
  }
  qsort(bed->sums, bed->sum_count, sizeof *bed->sums, by_boxes);
}

static influence_pair *pairs_copy(const influence_pair *pairs, size_t count)
{
  influence_pair *copy = calloc(count + 1, sizeof *copy);
  if (copy != NULL && count > 0) {
    memcpy(copy, pairs, count * sizeof *copy);
  }
  return copy;
}

static bool moment_begin(influence_bed *bed, influence_moment *m, double t,
                         const influence_motion *last)
{
  m->at_s = t;
  m->motions = calloc(bed->world.count, sizeof *m->motions);
  m->dv = calloc(bed->world.count, 3 * sizeof *m->dv);
  m->pushes = pairs_copy(bed->sums, bed->sum_count);
  m->push_count = bed->sum_count;
  if (m->motions == NULL || m->dv == NULL || m->pushes == NULL) {
    return false;
  }
  influence_sim_save(&bed->sim, m->motions);
  for (size_t i = 0; i < 3 * bed->world.count; ++i) {
    m->dv[i] = m->motions[i / 3].linear[i % 3] - last[i / 3].linear[i % 3];
  }
  return true;
}

/* ---- a window once more ---- */

static const influence_role roles[] = {INFLUENCE_STAYS, INFLUENCE_MASS, INFLUENCE_BRACED};
#define ROLES (sizeof roles / sizeof roles[0])

/* N, N m: from bodies that are in, on the box. */
static void push_on(const influence_pair *pairs, size_t count, int box, const bool *in,
                    double out[6])
{
  memset(out, 0, 6 * sizeof *out);
  for (size_t i = 0; i < count; ++i) {
    const influence_pair *p = &pairs[i];
    const double *on = p->a == box && in[p->b]                ? p->on_a
                       : p->b == box && p->a >= 0 && in[p->a] ? p->on_b
                                                              : NULL;
    for (int k = 0; k < 6 && on != NULL; ++k) {
      out[k] += on[k];
    }
  }
}

/* As docs/decisions/border.md, along the force alone. */
static double brace_share(const influence_bed *bed, const influence_moment *m, size_t box,
                          const double push[6])
{
  double size = dCalcVectorDot3(push, push);
  double free_dv = SECONDS * size / bed->world.boxes[box].mass;
  return size == 0.0 ? 0.0
                     : fmin(1.0, fmax(0.0, 1.0 - dCalcVectorDot3(push, m->dv + 3 * box) / free_dv));
}

/* Sums of the squares of what the force is off by, and of the force. */
static void window_run(influence_bed *bed, const influence_moment *m, const bool *in,
                       influence_role role, double io_sums[2])
{
  influence_sim_restore(&bed->sim, m->motions);
  for (size_t i = 0; i < bed->world.count; ++i) {
    double push[6];
    if (in[i]) {
      continue;
    }
    if (role == INFLUENCE_BRACED) {
      push_on(m->pushes, m->push_count, (int)i, in, push);
      influence_sim_brace(&bed->sim, i, push, brace_share(bed, m, i, push));
    } else {
      influence_sim_set(&bed->sim, i, role);
    }
  }
  for (size_t tick = 0; tick < WINDOW; ++tick) {
    double force[3];
    influence_sim_step(&bed->sim, m->at_s + INFLUENCE_TICK_S * (double)tick, force);
    for (int k = 0; k < 3; ++k) {
      double off = force[k] - m->force[tick][k];
      io_sums[0] += off * off;
      io_sums[1] += m->force[tick][k] * m->force[tick][k];
    }
  }
}

static double set_error(influence_bed *bed, const bool *in, influence_role role)
{
  double sums[2] = {0.0, 0.0};
  for (size_t i = 0; i < MOMENTS; ++i) {
    window_run(bed, &bed->moments[i], in, role, sums);
  }
  return sqrt(sums[0] / sums[1]);
}

/* ---- one body alone ---- */

typedef struct influence_rank {
  size_t box;
  double error; /* of the force, where the box keeps its twist */
} influence_rank;

static int by_error(const void *x, const void *y)
{
  const influence_rank *a = x;
  const influence_rank *b = y;
  return (a->error < b->error) - (a->error > b->error);
}

static void alone_try(influence_bed *bed, bool *in, influence_rank *out)
{
  for (size_t n = 0; n < bed->world.count; ++n) {
    size_t i = bed->by_hops[n];
    in[i] = false;
    double stays = set_error(bed, in, INFLUENCE_STAYS);
    double braced = set_error(bed, in, INFLUENCE_BRACED);
    in[i] = true;
    out[n] = (influence_rank){i, i == 0 ? HUGE_VAL : stays};
    fprintf(bed->bodies_csv, "%s,%d,%zu,%d,%.4g,%.4g\n", bed->of->name, bed->of->bodies, i,
            bed->hops[i], stays, braced);
  }
}

/* ---- the first so many in, the others beyond a border ---- */

static const size_t set_sizes[] = {1, 2, 4, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256, 512};

static void sets_try(influence_bed *bed, const char *order, const influence_rank *ranks, bool *in)
{
  for (size_t n = 0; n < BENCH_COUNT(set_sizes) && set_sizes[n] < bed->world.count; ++n) {
    int hops = 0;
    double errors[ROLES];
    for (size_t i = 0; i < bed->world.count; ++i) {
      in[ranks[i].box] = i < set_sizes[n];
      hops = i < set_sizes[n] && bed->hops[ranks[i].box] > hops ? bed->hops[ranks[i].box] : hops;
    }
    for (size_t r = 0; r < ROLES; ++r) {
      errors[r] = set_error(bed, in, roles[r]);
    }
    fprintf(bed->sets_csv, "%s,%d,%s,%zu,%d,%.4g,%.4g,%.4g\n", bed->of->name, bed->of->bodies,
            order, set_sizes[n], hops, errors[0], errors[1], errors[2]);
    bench_say(
        "%s:%d, the first %3zu by %-9s (to %2d contacts): stays %7.2f %%, mass %7.2f %%, "
        "braced %7.2f %%",
        bed->of->name, bed->of->bodies, set_sizes[n], order, hops, 100.0 * errors[0],
        100.0 * errors[1], 100.0 * errors[2]);
  }
  for (size_t i = 0; i < bed->world.count; ++i) {
    in[i] = true;
  }
}

/* ---- how the world beyond a border answers ---- */

#define CHANGE 0.1             /* of the push */
#define GROWS_MOST (4.0 / 3.0) /* see docs/decisions/border.md */
#define ANSWER_LEAST 1e-3      /* below, all are held */
#define NOT_EQUAL (1.0 / 3.0)

/* m/s at the end of the window, x y z of each box: all beyond get what they got, times scale. */
static void answer_run(influence_bed *bed, const influence_moment *m, const bool *in, double scale,
                       double *out)
{
  double ignored[3];
  influence_sim_restore(&bed->sim, m->motions);
  for (size_t i = 0; i < bed->world.count; ++i) {
    if (in[i]) {
      influence_sim_set(&bed->sim, i, INFLUENCE_ABSENT);
    }
  }
  for (size_t tick = 0; tick < WINDOW; ++tick) {
    for (size_t i = 0; i < bed->world.count; ++i) {
      memset(bed->sim.given[i], 0, sizeof bed->sim.given[i]);
      if (!in[i]) {
        push_on(m->next[tick], m->next_count[tick], (int)i, in, bed->sim.given[i]);
      }
      for (int k = 0; k < 6; ++k) {
        bed->sim.given[i][k] *= scale;
      }
    }
    influence_sim_step(&bed->sim, m->at_s + INFLUENCE_TICK_S * (double)tick, ignored);
  }
  for (size_t i = 0; i < bed->world.count; ++i) {
    memcpy(out + 3 * i, dBodyGetLinearVel(bed->sim.ode.bodies[i]), 3 * sizeof *out);
  }
}

/* Of what free bodies would give way. */
static double answer_share(influence_bed *bed, const influence_moment *m, const bool *in,
                           const double *dv, double change)
{
  double way = 0.0;
  double free_way = 0.0;
  for (size_t i = 0; i < bed->world.count; ++i) {
    double mean[3] = {0.0, 0.0, 0.0};
    for (size_t tick = 0; tick < WINDOW && !in[i]; ++tick) {
      double push[6];
      push_on(m->next[tick], m->next_count[tick], (int)i, in, push);
      for (int k = 0; k < 3; ++k) {
        mean[k] += push[k] / WINDOW;
      }
    }
    way += dCalcVectorDot3(mean, dv + 3 * i);
    free_way += change * SECONDS * dCalcVectorDot3(mean, mean) / bed->world.boxes[i].mass;
  }
  return way / free_way;
}

static void answer_note(influence_bed *bed, size_t index, double at_s, const double shares[2])
{
  influence_answer *a = &bed->answers[index];
  double now = fmax(ANSWER_LEAST, 0.5 * (shares[0] + shares[1]));
  bool first = a->windows++ == 0;
  a->grown += !first && now > GROWS_MOST * a->last;
  a->not_equal += fabs(shares[0] - shares[1]) > NOT_EQUAL * now;
  a->least = first ? now : fmin(a->least, now);
  a->most = first ? now : fmax(a->most, now);
  a->last = now;
  fprintf(bed->answers_csv, "%s,%d,%d,%.3f,%.4g,%.4g\n", bed->of->name, bed->of->bodies,
          answer_hops[index], at_s, shares[0], shares[1]);
}

static bool answers_try(influence_bed *bed, const influence_moment *m)
{
  size_t size = 3 * bed->world.count;
  bool *in = calloc(bed->world.count, sizeof *in);
  double *base = calloc(size, sizeof *base);
  double *dv = calloc(size, sizeof *dv);
  bool good = in != NULL && base != NULL && dv != NULL;
  for (size_t h = 0; h < ANSWERS && answer_hops[h] < bed->hops_most && good; ++h) {
    double shares[2];
    for (size_t i = 0; i < bed->world.count; ++i) {
      in[i] = bed->hops[i] <= answer_hops[h];
    }
    answer_run(bed, m, in, 1.0, base);
    for (int c = 0; c < 2; ++c) {
      double change = c == 0 ? -CHANGE : CHANGE;
      answer_run(bed, m, in, 1.0 + change, dv);
      for (size_t i = 0; i < size; ++i) {
        dv[i] -= base[i];
      }
      shares[c] = answer_share(bed, m, in, dv, change);
    }
    answer_note(bed, h, m->at_s, shares);
  }
  free(in);
  free(base);
  free(dv);
  return good;
}

/* ---- the truth: the whole path ---- */

static void moment_free(influence_moment *m)
{
  free(m->motions);
  free(m->dv);
  free(m->pushes);
  for (size_t tick = 0; tick < WINDOW; ++tick) {
    free(m->next[tick]);
  }
  memset(m, 0, sizeof *m);
}

/* The hand was in touch all the time. */
static bool window_is_pushed(const influence_moment *m)
{
  for (size_t tick = 0; tick < WINDOW; ++tick) {
    if (m->force[tick][0] == 0.0) {
      return false;
    }
  }
  return true;
}

/* What the last window says, and a new one. It begins as when it is run again: with the same rows
 * in the same order. */
static bool window_next(influence_bed *bed, double t, size_t *io_kept)
{
  influence_moment done = bed->window;
  influence_motion *state = calloc(bed->world.count, sizeof *state);
  bool good = state != NULL;
  memset(&bed->window, 0, sizeof bed->window);
  if (good) {
    influence_sim_save(&bed->sim, state);
    good = !window_is_pushed(&done) || answers_try(bed, &done);
    influence_sim_restore(&bed->sim, state);
  }
  good = good && moment_begin(bed, &bed->window, t, done.motions != NULL ? done.motions : state);
  bed->sum_count = 0;
  bool keep = *io_kept < MOMENTS && done.motions != NULL &&
              done.at_s >= bed->world.hand.settle_s + moments_s[*io_kept];
  if (keep) {
    bed->moments[(*io_kept)++] = done;
  } else {
    moment_free(&done);
  }
  free(state);
  return good;
}

static bool truth_run(influence_bed *bed)
{
  size_t settle = (size_t)lround(bed->world.hand.settle_s / INFLUENCE_TICK_S);
  size_t ticks = settle + (size_t)lround(bed->world.hand.seconds / INFLUENCE_TICK_S);
  size_t first = settle % WINDOW; /* a window begins where the way begins */
  size_t kept = 0;
  bool good = true;
  for (size_t tick = 0; tick < ticks && good; ++tick) {
    double t = INFLUENCE_TICK_S * (double)tick;
    size_t in = (tick + WINDOW - first) % WINDOW;
    double *force = bed->window.force[in];
    if (tick == settle) {
      hops_find(bed);
    }
    if (in == 0) {
      good = window_next(bed, t, &kept);
    }
    influence_sim_step(&bed->sim, t, force);
    size_t count = influence_sim_pairs(&bed->sim, bed->now);
    sums_add(bed, count);
    free(bed->window.next[in]);
    bed->window.next[in] = pairs_copy(bed->now, count);
    bed->window.next_count[in] = count;
    good = good && bed->window.next[in] != NULL;
    if (good && in > 0 && tick > settle) {
      bed->before_count = bed->window.next_count[0];
      bed->before = bed->window.next[0];
      hold_note(bed, count, in == WINDOW - 1, force[0] != 0.0 ? &bed->pushed : &bed->rest);
    }
  }
  return good && kept == MOMENTS && bed->sim.contacts_lost == 0;
}

/* ---- a world ---- */

static void hold_write(const influence_bed *bed, const char *when, const influence_hold *hold)
{
  for (int h = 0; h < bed->hops_most && hold->windows > 0; ++h) {
    double valid = (double)hold->valid[h] / (double)hold->ticks;
    double changed = hold->changed[h] / (double)hold->windows;
    fprintf(bed->holds_csv, "%s,%d,%s,%d,%zu,%.4g,%.4g\n", bed->of->name, bed->of->bodies, when, h,
            hold->windows, valid, changed);
    if (h > HOPS_SAID) {
      continue;
    }
    bench_say(
        "%s:%d, %s, beyond %2d contacts: as at the sync in %5.1f %% of ticks; at the next "
        "sync %5.1f %% of pairs are not",
        bed->of->name, bed->of->bodies, when, h, 100.0 * valid, 100.0 * changed);
  }
}

static void answers_write(const influence_bed *bed)
{
  for (size_t h = 0; h < ANSWERS && bed->answers[h].windows > 0; ++h) {
    const influence_answer *a = &bed->answers[h];
    bench_say(
        "%s:%d, beyond %d contacts %.4f to %.4f of a free answer; grows by more than a third "
        "in %zu of %zu windows, in %zu not the same both ways",
        bed->of->name, bed->of->bodies, answer_hops[h], a->least, a->most, a->grown, a->windows,
        a->not_equal);
  }
}

static void world_finish(influence_bed *bed)
{
  for (size_t i = 0; i < MOMENTS; ++i) {
    moment_free(&bed->moments[i]);
  }
  moment_free(&bed->window);
  influence_sim_finish(&bed->sim);
  free(bed->hops);
  free(bed->by_hops);
  free(bed->now);
  free(bed->sums);
  peer_world_destroy(&bed->world);
}

static bool world_init(influence_bed *bed, const influence_world *of)
{
  bed->of = of;
  bed->hops = NULL;
  bed->by_hops = NULL;
  bed->now = bed->sums = NULL;
  bed->sum_count = bed->before_count = 0;
  memset(bed->answers, 0, sizeof bed->answers);
  memset(&bed->sim, 0, sizeof bed->sim);
  memset(&bed->rest, 0, sizeof bed->rest);
  memset(&bed->pushed, 0, sizeof bed->pushed);
  if (!peer_world_create(of->name, of->bodies, &bed->world) ||
      !influence_sim_init(&bed->sim, &bed->world, of->bodies < BIG ? 300 : 100)) {
    return false;
  }
  size_t pairs = bed->sim.contact_capacity;
  bed->hops = calloc(bed->world.count, sizeof *bed->hops);
  bed->by_hops = calloc(bed->world.count, sizeof *bed->by_hops);
  bed->now = calloc(pairs, sizeof *bed->now);
  bed->sums = calloc(WINDOW * pairs, sizeof *bed->sums);
  return bed->hops != NULL && bed->by_hops != NULL && bed->now != NULL && bed->sums != NULL;
}

static bool world_measure(influence_bed *bed)
{
  size_t count = bed->world.count;
  bool *in = calloc(count, sizeof *in);
  influence_rank *ranks = calloc(count, sizeof *ranks);
  bool good = in != NULL && ranks != NULL && truth_run(bed);
  if (good) {
    hold_write(bed, "rest", &bed->rest);
    hold_write(bed, "pushed", &bed->pushed);
    for (size_t i = 0; i < count; ++i) {
      in[i] = true;
      ranks[i].box = bed->by_hops[i];
    }
    double floor = set_error(bed, in, INFLUENCE_IN);
    bench_check(bed->bench, floor <= FLOOR_MOST, "%s:%d, all in: off by %.2g %% (bound %g %%)",
                bed->of->name, bed->of->bodies, 100.0 * floor, 100.0 * FLOOR_MOST);
    answers_write(bed);
  }
  if (good) {
    sets_try(bed, "hops", ranks, in);
  }
  if (good && count <= ALONE_MOST) {
    alone_try(bed, in, ranks);
    qsort(ranks, count, sizeof *ranks, by_error);
    size_t matter = 0;
    while (matter < count && ranks[matter].error > WANTED) {
      ++matter;
    }
    bench_say(
        "%s:%d: %zu bodies matter: the one that the hand meets, and those that alone change "
        "the force by more than %g %%",
        bed->of->name, bed->of->bodies, matter, 100.0 * WANTED);
    sets_try(bed, "influence", ranks, in);
  }
  free(in);
  free(ranks);
  return good;
}

static hap_status worlds_run(influence_bed *bed)
{
  bench *b = bed->bench;
  char name[64];
  hap_status status = HAP_OK;
  size_t done = 0;
  for (size_t i = 0; i < BENCH_COUNT(worlds) && status >= HAP_OK; ++i) {
    snprintf(name, sizeof name, "%s:%d", worlds[i].name, worlds[i].bodies);
    if (b->scene != NULL ? strcmp(b->scene, name) != 0 : b->quick && !worlds[i].quick) {
      continue;
    }
    ++done;
    if (!world_init(bed, &worlds[i])) {
      status = bench_fail(b, HAP_ERROR_MEMORY, "%s: no memory", name);
    } else {
      status = influence_range_try(b, worlds[i].name, &bed->world, bed->range_csv);
    }
    if (status >= HAP_OK && !world_measure(bed)) {
      status = bench_fail(b, HAP_ERROR_MEMORY, "%s: no memory, or too many contacts", name);
    }
    world_finish(bed);
  }
  return status >= HAP_OK && done == 0
             ? bench_fail(b, HAP_ERROR_NOT_FOUND, "--scene %s: there is no such world", b->scene)
             : status;
}

hap_status bench_influence(bench *b)
{
  influence_bed *bed = calloc(1, sizeof *bed);
  if (bed == NULL) {
    return bench_fail(b, HAP_ERROR_MEMORY, "no memory for the bodies");
  }
  bed->bench = b;
  bed->bodies_csv = bench_csv_open(b, "influence_bodies", "world,bodies,body,hops,stays,braced");
  bed->sets_csv = bench_csv_open(b, "influence", "world,bodies,order,owned,hops,stays,mass,braced");
  bed->holds_csv =
      bench_csv_open(b, "influence_holds", "world,bodies,when,hops,windows,valid,pairs_changed");
  bed->answers_csv =
      bench_csv_open(b, "influence_answers", "world,bodies,hops,at_s,answer_less,answer_more");
  bed->range_csv = bench_csv_open(b, "influence_range", INFLUENCE_RANGE_COLUMNS);
  hap_status status = bed->bodies_csv != NULL && bed->sets_csv != NULL && bed->holds_csv != NULL &&
                              bed->answers_csv != NULL && bed->range_csv != NULL
                          ? worlds_run(bed)
                          : HAP_ERROR_IO;
  status = bench_csv_close(b, bed->bodies_csv, status);
  status = bench_csv_close(b, bed->sets_csv, status);
  status = bench_csv_close(b, bed->holds_csv, status);
  status = bench_csv_close(b, bed->answers_csv, status);
  status = bench_csv_close(b, bed->range_csv, status);
  free(bed);
  return status;
}
