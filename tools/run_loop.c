/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/run_loop.h"

#include <errno.h>
#include <math.h>
#include <signal.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "base/log.h"
#include "tools/run_summary.h"

#define PAUSE_S 0.01 /* between two looks at the session */
#define PROGRESS_S 0.1
#define RECONNECT_S 0.5 /* between two tries */
#define DIE_S 1         /* for the zero of all devices, before a signal ends the process */
#define ROWS_AT_ONCE 64
#define ROWS_MIN 2000 /* the reader may be away for 2 s at 1 kHz */
#define ROWS_MAX 20000

static volatile sig_atomic_t stop_wanted;

/* Where a run stands. */
typedef struct watch {
  run_loop *loop;
  double next_sample;   /* s */
  double next_progress; /* s, wall clock */
  double next_try;      /* s, of a lost device */
  hap_detail *detail;
} watch;

static volatile sig_atomic_t dying_of;

/* A device's zero does not come back: the others have been let go. */
static void die_now(int number)
{
  sigset_t own;
  (void)number;
  signal(dying_of, SIG_DFL);
  sigemptyset(&own);
  sigaddset(&own, dying_of);
  sigprocmask(SIG_UNBLOCK, &own, NULL);
  raise(dying_of);
}

/* Ends the process by the signal, with the force gone. A tick that is under way may write once
 * more: hence twice, with 2 ms between. */
static void let_go_and_die(int number)
{
  const struct timespec tick = {0, 2000000};
  dying_of = number;
  signal(SIGALRM, die_now);
  alarm(DIE_S);
  hap_emergency_zero();
  (void)nanosleep(&tick, NULL);
  hap_emergency_zero();
  signal(number, SIG_DFL);
  raise(number);
}

static void want_stop(int number)
{
  if (stop_wanted != 0) {
    let_go_and_die(number); /* whoever asks twice does not wait for what hangs */
  }
  stop_wanted = 1;
  hap_emergency_zero(); /* here, as the program itself may wait for a device that hangs */
}

static void set_handler(const int *numbers, size_t count, void (*handler)(int), int flags)
{
  struct sigaction action;
  memset(&action, 0, sizeof action);
  action.sa_handler = handler;
  action.sa_flags = flags;
  sigemptyset(&action.sa_mask);
  for (size_t i = 0; i < count; ++i) {
    sigaction(numbers[i], &action, NULL);
  }
}

void run_loop_catch_signals(void)
{
  const int ending[] = {SIGINT, SIGTERM, SIGHUP};
  const int deadly[] = {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT};
  const int harmless[] = {SIGPIPE}; /* a reader that goes away must not end us with the force on */
  /* The second one may come while the first one's handler waits for a device that hangs. */
  set_handler(ending, sizeof ending / sizeof ending[0], want_stop, SA_NODEFER);
  set_handler(deadly, sizeof deadly / sizeof deadly[0], let_go_and_die, 0);
  set_handler(harmless, 1, SIG_IGN, 0);
}

bool run_loop_stop_wanted(void)
{
  return stop_wanted != 0;
}

int32_t run_loop_trace_rows(const run_options *options)
{
  if (options->trace_path == NULL && options->plot_path == NULL && options->shot.path == NULL &&
      options->shot.frames == NULL && options->html_path == NULL && !options->window.wanted) {
    return 0;
  }
  return (int32_t)fmin(fmax(options->rig.def.haptic_hz, ROWS_MIN), ROWS_MAX);
}

static double wall_clock(void)
{
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static void write_rows(run_loop *loop, const hap_trace_row *rows, size_t count)
{
  if (loop->trace.file == NULL || loop->trace_errno != 0) {
    return;
  }
  for (size_t i = 0; i < count; ++i) {
    trace_csv_row(&loop->trace, &rows[i]);
  }
  if (ferror(loop->trace.file) != 0) {
    loop->trace_errno = errno != 0 ? errno : EIO;
  }
}

/* Takes all rows that are there. */
static void trace_drain(run_loop *loop)
{
  hap_trace_row rows[ROWS_AT_ONCE];
  size_t count = 0;
  if (loop->trace.file == NULL && loop->picture == NULL && loop->shot == NULL &&
      loop->html == NULL && loop->stage == NULL) {
    return;
  }
  while (hap_session_trace_read(loop->rig->session, rows, ROWS_AT_ONCE, sizeof(hap_trace_row),
                                &count) == HAP_OK) {
    for (size_t i = 0; i < count && loop->picture != NULL; ++i) {
      run_picture_add_row(loop->picture, &rows[i]);
    }
    for (size_t i = 0; i < count; ++i) {
      run_shot_add_row(loop->shot, &rows[i]);
      run_html_add_row(loop->html, &rows[i]);
      run_stage_add_row(loop->stage, &rows[i]);
    }
    write_rows(loop, rows, count);
  }
}

static double strongest_force(const rig *r)
{
  double strongest = 0.0;
  for (size_t i = 0; i < r->pointer_count; ++i) {
    hap_pointer_state state;
    if (hap_pointer_get(r->session, r->pointers[i], &state, sizeof state) >= HAP_OK) {
      const double *f = state.wrench.force;
      strongest = fmax(strongest, sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]));
    }
  }
  return strongest;
}

static void show_progress(watch *w, double t, const hap_stats *stats)
{
  double now = wall_clock();
  if (now < w->next_progress || w->loop->stage != NULL) {
    return;
  }
  run_progress_show(&w->loop->progress, w->loop->seconds - t, strongest_force(w->loop->rig),
                    stats->loop.missed_ticks);
  w->next_progress = now + PROGRESS_S;
}

/* True: the fault is that of a lost device, which is being waited for. */
static bool device_reconnect(watch *w, double t, const hap_stats *stats)
{
  hap_session *session = w->loop->rig->session;
  const hap_pointer_id lost = {stats->faults.pointer};
  bool device =
      stats->faults.fault == HAP_FAULT_DEVICE_READ || stats->faults.fault == HAP_FAULT_DEVICE_WRITE;
  if (!w->loop->options->reconnect || !device || lost.v == 0) {
    return false;
  }
  if (t < w->next_try) {
    return true;
  }
  if (w->next_try == 0.0) {
    fputs("hapode-run: a device was lost; it is started again as soon as it answers\n", stderr);
  }
  w->next_try = t + RECONNECT_S;
  if (hap_pointer_restart(session, lost) >= HAP_OK) {
    (void)hap_session_reset_fault(session);
    fputs("hapode-run: the device is back\n", stderr);
    w->next_try = 0.0;
  }
  return true;
}

/* What is to be done between two stretches of the run, at time t of it. */
static hap_status watch_look(watch *w, double t)
{
  run_loop *loop = w->loop;
  hap_stats stats;
  trace_drain(loop);
  if (stop_wanted != 0) { /* the fault is its emergency */
    return HAP_END;
  }
  (void)hap_session_stats(loop->rig->session, &stats, sizeof stats);
  run_shot_look(loop->shot, t);
  run_html_look(loop->html, t);
  run_coupling_look(loop->coupling, loop->rig);
  if (loop->picture != NULL && t >= w->next_sample) {
    run_picture_add_stats(loop->picture, t, &stats, 1.0 / run_summary_physics_hz(loop->options));
    w->next_sample = t + run_picture_interval(loop->picture) - 0.5 * PAUSE_S;
  }
  show_progress(w, t, &stats);
  HAPI_TRY(run_far_look(loop->far, w->detail));
  hap_status shown = run_stage_look(loop->stage, t);
  if (shown != HAP_OK) {
    return shown;
  }
  bool stays = loop->options->play_path != NULL || loop->stage != NULL; /* the window shows it */
  if (stats.faults.fault != HAP_FAULT_NONE && !device_reconnect(w, t, &stats) && !stays) {
    (void)hap_session_detail(loop->rig->session, w->detail);
    return HAP_ERROR_DEVICE;
  }
  return HAP_OK;
}

static hap_status run_threads(watch *w)
{
  const struct timespec pause = {0, (long)(1e9 * PAUSE_S)};
  double start = wall_clock();
  double t = 0.0;
  hap_status status = HAP_OK;
  while (status == HAP_OK && t < w->loop->seconds) {
    if (stop_wanted != 0) {
      return HAP_END;
    }
    double left = w->loop->seconds - t;
    struct timespec last = {0, (long)(1e9 * fmin(left, PAUSE_S))};
    (void)nanosleep(left < PAUSE_S ? &last : &pause, NULL);
    t = wall_clock() - start;
    status = watch_look(w, t);
  }
  return status;
}

static hap_status run_lockstep(watch *w)
{
  hap_session *session = w->loop->rig->session;
  double hz = w->loop->options->rig.def.haptic_hz;
  bool plays = w->loop->options->play_path != NULL;
  uint64_t all = (uint64_t)llround(w->loop->seconds * hz);
  uint64_t stretch = (uint64_t)ceil(PAUSE_S * hz);
  hap_status status = HAP_OK;
  for (uint64_t done = 0; status == HAP_OK && done < all;) {
    if (stop_wanted != 0) {
      return HAP_END;
    }
    uint64_t next = all - done < stretch ? all - done : stretch;
    status = hap_session_advance(session, next);
    done += next;
    if (plays && status == HAP_END) {
      (void)watch_look(w, (double)done / hz);
      return HAP_OK;
    }
    if (status < HAP_OK) {
      (void)hap_session_detail(session, w->detail);
      return status;
    }
    status = watch_look(w, (double)done / hz);
    run_stage_pace(w->loop->stage, (double)done / hz);
  }
  return status;
}

hap_status run_loop_run(run_loop *loop, hap_stats *stats, hap_detail *detail)
{
  hap_session *session = loop->rig->session;
  watch w = {.loop = loop, .detail = detail};
  memset(stats, 0, sizeof *stats);
  if (loop->trace.file != NULL) {
    trace_csv_header(&loop->trace);
  }
  hap_status started = hap_session_start(session);
  if (started < HAP_OK) {
    (void)hap_session_detail(session, detail);
    return started;
  }
  bool lockstep = loop->options->rig.def.drive == HAP_DRIVE_LOCKSTEP;
  hap_status status = lockstep ? run_lockstep(&w) : run_threads(&w);
  hap_status stopped = hap_session_stop(session);
  run_progress_clear(&loop->progress);
  (void)hap_session_stats(session, stats, sizeof *stats);
  trace_drain(loop);
  if (stopped < HAP_OK) {
    (void)hap_session_detail(session, detail);
    return stopped;
  }
  if (status == HAP_OK && stop_wanted != 0) {
    return HAP_END;
  }
  bool plays = loop->options->play_path != NULL;
  if (status == HAP_OK && stats->faults.fault != HAP_FAULT_NONE &&
      !plays) { /* waited for to the end */
    (void)hap_session_detail(session, detail);
    return HAP_ERROR_DEVICE;
  }
  return status != HAP_OK ? status : started;
}
