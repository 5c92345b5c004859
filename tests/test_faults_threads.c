/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* What the hand feels when a thread or the process stands still for real. HAPODE_RUN: path of the
 * program hapode-run. */

#include "tests/tap.h"

#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/felt.h"

extern char **environ;

#define PRESSING "hand=relaxed,device_mass=0.1,device_damping=2,path=0:-0.08/0/0;0.5:-0.02/0/0"

static felt_stage f;
static atomic_int hangs; /* physics does not come back */

static void step_hang(stage *s)
{
  (void)s;
  while (atomic_load(&hangs) != 0) {
    sleep_ms(1);
  }
}

static bool begin_threads(void)
{
  atomic_store(&hangs, 0);
  felt_init(&f, HAP_DRIVE_THREADS, false);
  f.s.in_step = step_hang;
  return felt_begin(&f, PRESSING);
}

/* False: not for long. */
static bool wait_until(bool (*condition)(void))
{
  for (int i = 0; i < 20000; ++i) {
    if (condition()) {
      return true;
    }
    sleep_ms(1);
  }
  return false;
}

static bool hand_presses(void)
{
  return felt_guard(&f) == 0 && fabs(hapi_v3_norm(f.state.wrench.force) - 5.217) < 0.05;
}

/* Where a busy machine holds up the loop meanwhile, that is a standstill, too. */
static bool hand_presses_again(void)
{
  uint32_t fault = stats_of(&f.s).faults.fault;
  if (fault == HAP_FAULT_BLOCKED || fault == HAP_FAULT_LATE) {
    CHECK(hap_session_reset_fault(f.s.session) == HAP_OK);
  }
  return hand_presses();
}

static bool lets_go(void)
{
  return atomic_load(&felt.holds) == 0;
}

/* ---- threads ---- */

static void *session_stop(void *arg)
{
  (void)arg;
  CHECK(hap_session_stop(f.s.session) == HAP_OK);
  return NULL;
}

TEST(a_stop_lets_go_of_the_hand_though_physics_does_not_come_back)
{
  pthread_t stopper;
  REQUIRE(begin_threads());
  CHECK(wait_until(hand_presses_again));
  atomic_store(&hangs, 1);
  REQUIRE(pthread_create(&stopper, NULL, session_stop, NULL) == 0);
  CHECK(wait_until(lets_go));
  uint64_t ticks = stats_of(&f.s).loop.ticks;
  sleep_ms(20);
  CHECK(stats_of(&f.s).loop.ticks == ticks && lets_go()); /* the loop has ended, stop waits */
  atomic_store(&hangs, 0);
  pthread_join(stopper, NULL);
  felt_end(&f);
}

TEST(a_device_whose_read_takes_300_ms_is_zeroed_and_felt_again_after_a_reset)
{
  REQUIRE(begin_threads());
  CHECK(wait_until(hand_presses_again));
  uint64_t missed = stats_of(&f.s).loop.missed_ticks;
  for (int i = 0; i < 3; ++i) {
    atomic_store(&felt.block_ms, 300);
    CHECK(wait_until(lets_go)); /* while it is in the read */
    sleep_ms(400);
    CHECK(lets_go() && stats_of(&f.s).faults.fault == HAP_FAULT_BLOCKED);
    CHECK(wait_until(hand_presses_again));
  }
  CHECK(stats_of(&f.s).loop.missed_ticks >=
        missed + 3 * 290); /* they are passed over, not caught up */
  CHECK(stats_of(&f.s).faults.count >= 3);
  CHECK(hap_session_stop(f.s.session) == HAP_OK);
  felt_end(&f);
}

static void *look_often(void *wrong)
{
  while (atomic_load(&hangs) == 0) {
    hap_pointer_state state;
    if (hap_pointer_get(f.s.session, f.hand, &state, sizeof state) != HAP_OK) {
      atomic_fetch_add((atomic_int *)wrong, 1);
    }
  }
  return NULL;
}

/* Beside the loop, and others that look at the pointer. */
TEST(a_lost_device_is_restarted_while_the_loop_runs)
{
  pthread_t looker;
  atomic_int wrong;
  atomic_init(&wrong, 0);
  REQUIRE(begin_threads());
  CHECK(wait_until(hand_presses_again));
  REQUIRE(pthread_create(&looker, NULL, look_often, &wrong) == 0);
  for (int i = 0; i < 5; ++i) {
    atomic_store(&felt.lost, 1);
    CHECK(wait_until(lets_go));
    atomic_store(&felt.fail_start, 1);
    CHECK(hap_pointer_restart(f.s.session, f.hand) == HAP_ERROR_DEVICE);
    atomic_store(&felt.fail_start, 0);
    CHECK(hap_pointer_restart(f.s.session, f.hand) == HAP_OK);
    sleep_ms(20);
    CHECK(lets_go());
    CHECK(hap_session_reset_fault(f.s.session) == HAP_OK);
    CHECK(wait_until(hand_presses_again));
  }
  atomic_store(&hangs, 1);
  pthread_join(looker, NULL);
  atomic_store(&hangs, 0);
  CHECK(hap_session_stop(f.s.session) == HAP_OK);
  CHECK(atomic_load(&wrong) == 0);
  felt_end(&f);
}

TEST(a_device_that_blocks_and_then_fails_is_zeroed)
{
  REQUIRE(begin_threads());
  CHECK(wait_until(hand_presses_again));
  atomic_store(&felt.fail_read, 1);
  atomic_store(&felt.block_ms, 100);
  CHECK(wait_until(lets_go));
  sleep_ms(120); /* it may have been before that read */
  atomic_store(&felt.ever_holds, 0);
  sleep_ms(50);
  CHECK(atomic_load(&felt.ever_holds) == 0 && stats_of(&f.s).faults.fault == HAP_FAULT_DEVICE_READ);
  atomic_store(&felt.fail_read, 0);
  sleep_ms(20);
  CHECK(lets_go());
  CHECK(hap_session_reset_fault(f.s.session) == HAP_OK);
  CHECK(wait_until(hand_presses_again));
  felt_end(&f);
}

/* ---- the process ---- */

#define TICK_S 1e-3
#define STOPPED_S 0.1    /* of gaps, only the one of the stop is as long */
#define STIFFNESS 1000.0 /* N/m, the scene's */

static char trace_path[] = "/tmp/hapode-faults-XXXXXX";

#define RUN_ARGUMENTS                                                                \
  "hapode-run --scene wedge --no-realtime --seconds 3 --device "                     \
  "virtual:hand=relaxed,device_mass=0.1,path=0:-0.2/0/0.05;1:0/0/0.05,max_force=10 " \
  "--trace %s"

static pid_t start_run(void)
{
  char words[400];
  char *argv[12] = {NULL};
  size_t count = 0;
  snprintf(words, sizeof words, RUN_ARGUMENTS, trace_path);
  for (char *rest = NULL, *word = strtok_r(words, " ", &rest); word != NULL && count < 11;
       word = strtok_r(NULL, " ", &rest)) {
    argv[count++] = word;
  }
  const char *program = getenv("HAPODE_RUN");
  posix_spawn_file_actions_t actions;
  pid_t child = -1;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  if (program == NULL || posix_spawn(&child, program, &actions, NULL, argv, environ) != 0) {
    child = -1;
  }
  posix_spawn_file_actions_destroy(&actions);
  return child;
}

typedef struct traced {
  int rows;
  double last;     /* s, the newest tick's time */
  double longest;  /* s, between two ticks */
  double steepest; /* N, between two ticks */
  double peak;     /* N */
  double work;     /* J on the hand, without what was held over the longest gap */
  double work_most;
  double held; /* J: a force that is held over a way d is off a spring's by k d^2 / 2 */
} traced;

static traced read_trace(void)
{
  traced out = {0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
  char line[4000];
  double before[7] = {0.0};
  FILE *file = fopen(trace_path, "r");
  while (file != NULL && fgets(line, sizeof line, file) != NULL) {
    double v[7];
    if (sscanf(line, "%lf,%lf,%lf,%lf,%lf,%lf,%lf", &v[0], &v[1], &v[2], &v[3], &v[4], &v[5],
               &v[6]) != 7) {
      continue; /* the header */
    }
    double way[3];
    double change[3];
    hapi_v3_sub(v + 1, before + 1, way);
    hapi_v3_sub(v + 4, before + 4, change);
    if (out.rows++ > 0) {
      out.longest = fmax(out.longest, v[0] - before[0]);
      out.steepest = fmax(out.steepest, hapi_v3_norm(change));
      double gap = v[0] - before[0];
      bool late = gap > 1.5 * TICK_S && gap < STOPPED_S; /* as on a busy machine */
      out.work += gap < STOPPED_S ? hapi_v3_dot(before + 4, way) : 0.0;
      out.held += late ? 0.5 * STIFFNESS * hapi_v3_dot(way, way) : 0.0;
      out.work_most = fmax(out.work_most, out.work);
    }
    out.peak = fmax(out.peak, hapi_v3_norm(v + 4));
    memcpy(before, v, sizeof v);
    out.last = v[0];
  }
  if (file != NULL) {
    fclose(file);
  }
  return out;
}

/* The program writes its trace as it runs. On a busy machine it begins late. */
static bool hand_is_in_contact(void)
{
  return read_trace().last > 1.5;
}

TEST(a_process_that_is_stopped_and_continued_gives_no_burst)
{
  int status = 0;
  int file = mkstemp(trace_path);
  REQUIRE(file >= 0);
  close(file);
  pid_t child = start_run();
  REQUIRE(child > 0);
  CHECK(wait_until(hand_is_in_contact));
  kill(child, SIGSTOP);
  sleep_ms(400);
  kill(child, SIGCONT);
  CHECK(waitpid(child, &status, 0) == child && WIFEXITED(status));
  CHECK(WEXITSTATUS(status) == 0 || WEXITSTATUS(status) == 1); /* under force it is a fault */
  traced t = read_trace();
  printf("# %d ticks, a gap of %.3g s, force to %.3g N, %.3g N a tick, %.3g J, late ticks %.3g J\n",
         t.rows, t.longest, t.peak, t.steepest, t.work_most, t.held);
  CHECK(t.rows > 100 && t.longest > 0.3);
  CHECK(t.peak > 0.1 && t.peak <= 10.0 * (1.0 + 1e-6)); /* digits of the file */
  CHECK(t.steepest <= 5.0 * (1.0 + 1e-6));
  CHECK(t.work_most <= 0.01 * 0.5 * t.peak * t.peak / STIFFNESS + 1e-3 + t.held);
  unlink(trace_path);
}
