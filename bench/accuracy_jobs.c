/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The groups of a run, each in a process of its own: no session exists yet, so that a process can be
 * split, and what one leaves behind in ODE does not matter to the next. A finished row goes into the
 * file at once; a pipe says so to the parent, which shows how far it is. */

#include <errno.h>
#include <math.h>
#include <poll.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "bench/accuracy.h"

#define LOOK_MS 200
#define LINE_EVERY_S 30.0 /* where stderr is no terminal */

/* From a process to its parent; shorter than PIPE_BUF, so that it arrives in one piece. */
typedef struct news {
  hap_status status; /* below 0: why the process ends */
  double cost;       /* of the row that is finished */
  hap_detail detail;
} news;

typedef struct progress {
  bool terminal;
  size_t rows;
  size_t finished;
  double cost; /* of what was to be done in this run */
  double done;
  double began;  /* s */
  double spoken; /* s, of the newest line */
} progress;

/* ---- how far ---- */

static double now_s(void)
{
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void write_left(double seconds)
{
  if (seconds < 90.0) {
    fprintf(stderr, "about %.0f s left", seconds);
  } else if (seconds < 5400.0) {
    fprintf(stderr, "about %.0f min left", seconds / 60.0);
  } else {
    fprintf(stderr, "about %.1f h left", seconds / 3600.0);
  }
}

static void show(progress *p)
{
  double now = now_s();
  if (p->finished == p->rows || (!p->terminal && now - p->spoken < LINE_EVERY_S)) {
    return;
  }
  p->spoken = now;
  fprintf(stderr, "%saccuracy: %zu of %zu rows", p->terminal ? "\r" : "", p->finished, p->rows);
  if (p->done > 0.0) {
    fputs(", ", stderr);
    write_left((now - p->began) * (p->cost - p->done) / p->done);
  }
  fputs(p->terminal ? "\033[K" : "\n", stderr);
}

static void end_progress(const progress *p)
{
  if (p->terminal) {
    fputs("\r\033[K", stderr);
  }
}

/* ---- in a process of its own ---- */

typedef struct worker {
  bench *bench;
  const accuracy_work *work;
  const accuracy_group *group;
  int to; /* the pipe */
} worker;

/* The parent is gone when nobody reads any more. */
static bool tell(const worker *w, const news *n)
{
  return write(w->to, n, sizeof *n) == (ssize_t)sizeof *n;
}

static hap_status take_row(void *user, size_t point, const accuracy_row *row)
{
  const worker *w = user;
  const accuracy_plan *plan = w->work->plan;
  news n = {.status = accuracy_rows_append(w->bench, w->work->file, row)};
  n.cost = accuracy_point_cost(plan, w->group, &plan->points[point]);
  if (n.status >= HAP_OK && !tell(w, &n)) {
    return bench_fail(w->bench, HAP_ERROR_SYSTEM, "the run was ended");
  }
  return n.status;
}

/* It leaves without a look at the buffers that it has inherited. */
static void work_on(worker *w)
{
  news n;
  memset(&n, 0, sizeof n);
  prctl(PR_SET_PDEATHSIG, SIGKILL); /* a run that is killed ends as a whole */
  n.status = accuracy_sweep(w->bench, w->work->plan, w->group, w->work->have, take_row, w);
  n.detail = w->bench->detail;
  _exit(n.status >= HAP_OK || tell(w, &n) ? 0 : 1);
}

/* ---- in the parent ---- */

static bool is_due(const accuracy_work *work, size_t group)
{
  const accuracy_group *g = &work->plan->groups[group];
  for (size_t i = g->first; i < g->first + g->count && work->shard_of[group] == work->shard; ++i) {
    if (work->have[i].scene[0] == '\0') {
      return true;
    }
  }
  return false;
}

static progress count_rows(const accuracy_work *work)
{
  progress p = {.terminal = isatty(STDERR_FILENO) == 1, .began = now_s()};
  p.spoken = p.began;
  for (size_t k = 0; k < work->plan->group_count; ++k) {
    const accuracy_group *g = &work->plan->groups[k];
    for (size_t i = g->first; i < g->first + g->count && work->shard_of[k] == work->shard; ++i) {
      bool there = work->have[i].scene[0] != '\0';
      ++p.rows;
      p.finished += there;
      p.cost += there ? 0.0 : accuracy_point_cost(work->plan, g, &work->plan->points[i]);
    }
  }
  return p;
}

static void read_news(bench *b, int from, progress *p, hap_status *io)
{
  struct pollfd wait = {.fd = from, .events = POLLIN};
  news n;
  while (poll(&wait, 1, 0) == 1 && read(from, &n, sizeof n) == (ssize_t)sizeof n) {
    if (n.status >= HAP_OK) {
      ++p->finished;
      p->done += n.cost;
    } else if (*io >= HAP_OK) {
      *io = n.status;
      b->detail = n.detail;
    }
  }
}

/* The dearest group of those that are due; group_count: none. */
static size_t next_group(const accuracy_work *work, const bool *begun)
{
  const accuracy_plan *plan = work->plan;
  size_t next = plan->group_count;
  for (size_t i = 0; i < plan->group_count; ++i) {
    bool dearer = next == plan->group_count || plan->groups[i].cost > plan->groups[next].cost;
    next = !begun[i] && dearer && is_due(work, i) ? i : next;
  }
  return next;
}

static hap_status begin_process(bench *b, const accuracy_work *work, size_t group, int to)
{
  worker w = {.bench = b, .work = work, .group = &work->plan->groups[group], .to = to};
  pid_t child = fork();
  if (child == 0) {
    work_on(&w);
  }
  return child > 0 ? HAP_OK
                   : bench_fail(b, HAP_ERROR_SYSTEM, "no process for a scene: %s", strerror(errno));
}

/* Until one has ended. */
static void wait_for_one(bench *b, int from, progress *p, hap_status *io)
{
  int result = 0;
  struct pollfd wait = {.fd = from, .events = POLLIN};
  pid_t child = 0;
  while (child == 0) {
    (void)poll(&wait, 1, LOOK_MS);
    child = waitpid(-1, &result, WNOHANG);
    read_news(b, from, p, io);
    show(p);
  }
  if ((!WIFEXITED(result) || WEXITSTATUS(result) != 0) && *io >= HAP_OK) {
    *io = bench_fail(b, HAP_ERROR_SYSTEM, "a scene's process did not end well");
  }
}

/* Of one that fails the others finish what they have begun. */
static hap_status run_all(bench *b, const accuracy_work *work, const int pipe_ends[2], bool *begun)
{
  progress p = count_rows(work);
  size_t running = 0;
  hap_status status = HAP_OK;
  for (;;) {
    size_t next = status >= HAP_OK ? next_group(work, begun) : work->plan->group_count;
    if (next < work->plan->group_count && running < work->processes) {
      status = begin_process(b, work, next, pipe_ends[1]);
      begun[next] = true;
      running += status >= HAP_OK;
    } else if (running > 0) {
      wait_for_one(b, pipe_ends[0], &p, &status);
      --running;
    } else {
      break;
    }
  }
  end_progress(&p);
  return status;
}

hap_status accuracy_jobs(bench *b, const accuracy_work *work)
{
  int ends[2];
  bool *begun = calloc(work->plan->group_count + 1, sizeof *begun);
  if (begun == NULL || pipe(ends) != 0) {
    free(begun);
    return bench_fail(b, HAP_ERROR_MEMORY, "no memory for the processes");
  }
  hap_status status = run_all(b, work, ends, begun);
  close(ends[0]);
  close(ends[1]);
  free(begun);
  return status;
}
