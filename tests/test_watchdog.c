/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A loop that stands still: the watchdog of its device takes the force off, whatever the device
 * does. */

#include "tests/tap.h"

#include <dirent.h>
#include <sched.h>
#include <signal.h>
#include <stdatomic.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/safety.h"
#include "device/device.h"
#include "device/emergency.h"
#include "device/watchdog.h"
#include "haptic/haptic_internal.h"
#include "session/session_internal.h"
#include "tests/stage.h"

#define DEVICES 2
#define DEPTH_X (-0.057) /* m: 3 mm deep in the cube */
#define WAIT_MS 20000

typedef struct stuck_device {
  char name[16];
  /* What it shall do. */
  atomic_int block_read;  /* the next read waits until this is 0 */
  atomic_int block_write; /* likewise; the force is given when it ends */
  atomic_int block_zero;
  atomic_int read_ms; /* that each read takes */
  /* What happened. */
  atomic_int inside;  /* in a read or write that waits */
  atomic_int zeroing; /* calls of zero that wait */
  atomic_int holds;
  atomic_int forces; /* writes that were not zero */
  atomic_int stops;
  _Atomic int64_t blocked_ns; /* begin of the wait */
  _Atomic int64_t zeroed_ns;  /* first zero after it */
  _Atomic int64_t longest_ns; /* read that did not wait for the test */
} stuck_device;

static stuck_device devices[DEVICES];
static int opened;

static void wait_while(atomic_int *block, atomic_int *inside)
{
  atomic_fetch_add(inside, 1);
  while (atomic_load(block) != 0) {
    sleep_ms(1);
  }
  atomic_fetch_sub(inside, 1);
}

static void call_block(stuck_device *d, atomic_int *block)
{
  if (atomic_load(block) != 0) {
    atomic_store(&d->zeroed_ns, 0);
    atomic_store(&d->blocked_ns, hapi_clock_now());
    wait_while(block, &d->inside);
  }
}

static hap_status stuck_open(void *context, const char *args, void **self, hap_detail *detail)
{
  (void)context;
  stuck_device *d = &devices[opened++];
  (void)detail;
  memset(d, 0, sizeof *d);
  snprintf(d->name, sizeof d->name, "%s", args);
  *self = d;
  return HAP_OK;
}

static void stuck_describe(void *self, uint32_t effector, hap_device_info *out)
{
  (void)effector;
  const stuck_device *d = self;
  out->dof = 3;
  out->max_force = 12.0;
  snprintf(out->name, sizeof out->name, "%s", d->name);
}

static hap_status stuck_start(void *self)
{
  (void)self;
  return HAP_OK;
}

static hap_status stuck_read(void *self, int64_t time_ns, hap_device_input *const out[])
{
  hap_device_input *in = out[0];
  stuck_device *d = self;
  (void)time_ns;
  if (atomic_load(&d->read_ms) > 0) {
    int64_t begin_ns = hapi_clock_now();
    sleep_ms(atomic_load(&d->read_ms));
    int64_t spent_ns = hapi_clock_now() - begin_ns;
    atomic_store(&d->longest_ns, spent_ns > d->longest_ns ? spent_ns : d->longest_ns);
  }
  call_block(d, &d->block_read);
  in->pose = (hap_pose){{DEPTH_X, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
  memset(&in->twist, 0, sizeof in->twist);
  in->buttons = 0;
  return HAP_OK;
}

static hap_status stuck_write(void *self, const hap_device_output *const wanted[],
                              hap_device_output *const reached[])
{
  stuck_device *d = self;
  bool force = wanted[0]->wrench.force[0] != 0.0;
  if (force) {
    call_block(d, &d->block_write);
  }
  atomic_store(&d->holds, force);
  atomic_fetch_add(&d->forces, force);
  reached[0]->wrench = wanted[0]->wrench;
  return HAP_OK;
}

static void stuck_zero(void *self)
{
  stuck_device *d = self;
  if (atomic_load(&d->block_zero) != 0) {
    wait_while(&d->block_zero, &d->zeroing);
  }
  atomic_store(&d->holds, 0);
  int64_t none = 0;
  (void)atomic_compare_exchange_strong(&d->zeroed_ns, &none, hapi_clock_now());
}

static void stuck_stop(void *self)
{
  stuck_device *d = self;
  atomic_fetch_add(&d->stops, 1);
}

static void stuck_close(void *self)
{
  (void)self;
}

static hap_device_ops stuck_ops = {
    .abi = HAP_DEVICE_ABI,
    .size = sizeof(hap_device_ops),
    .name = "stuck",
    .help = "for tests",
    .pacing = HAP_PACING_HOST,
    .open = stuck_open,
    .describe = stuck_describe,
    .start = stuck_start,
    .read = stuck_read,
    .write = stuck_write,
    .zero = stuck_zero,
    .stop = stuck_stop,
    .close = stuck_close,
};

/* ---- a session with devices that can hang ---- */

static hap_device *handles[DEVICES];
static hap_pointer_id hands[DEVICES];

static hap_device *stuck_device_open(const char *name)
{
  hap_detail detail = {""};
  hap_device *device = NULL;
  REQUIRE_SAY(hapi_device_open_ops(&stuck_ops, NULL, name, &device, &detail) == HAP_OK, "%s",
              detail.text);
  return device;
}

static stage *stuck_begin(int count)
{
  static const char *const names[DEVICES] = {"first", "second"};
  stage *s = stage_new(HAP_DRIVE_THREADS);
  opened = 0;
  dBodySetKinematic(s->cube);
  REQUIRE(stage_create(s) == HAP_OK);
  for (int i = 0; i < count; ++i) {
    hap_pointer_def def;
    hap_pointer_expert_def expert;
    hap_pointer_def_init(&def, sizeof def);
    hap_pointer_expert_def_init(&expert, sizeof expert);
    expert.max_slew = 500.0; /* N/s: a fault alone would take six ticks to zero */
    def.expert = &expert;
    handles[i] = stuck_device_open(names[i]);
    def.device = handles[i];
    REQUIRE(hap_pointer_add(s->session, &def, &hands[i]) == HAP_OK);
  }
  REQUIRE(hap_session_start(s->session) >= HAP_OK);
  return s;
}

/* All of them have a force. A machine that holds the loop up before that latches a fault of its
 * own, which is reset. */
static bool stuck_hold(stage *s, int count)
{
  for (int ms = 0; ms < WAIT_MS; ++ms) {
    int holding = 0;
    for (int i = 0; i < count; ++i) {
      holding += atomic_load(&devices[i].holds);
    }
    if (holding == count) {
      return true;
    }
    uint32_t fault = stats_of(s).faults.fault;
    if (ms % 100 == 99 && (fault == HAP_FAULT_BLOCKED || fault == HAP_FAULT_LATE)) {
      CHECK(hap_session_reset_fault(s->session) == HAP_OK);
    }
    sleep_ms(1);
  }
  return false;
}

static void stuck_end(stage *s, int count)
{
  stage_end(s);
  for (int i = 0; i < count; ++i) {
    hap_device_close(handles[i]);
    CHECK(atomic_load(&devices[i].holds) == 0);
  }
}

/* False: it did not come for long. */
static bool await_value(atomic_int *value, int wanted)
{
  for (int i = 0; i < WAIT_MS && atomic_load(value) != wanted; ++i) {
    sleep_ms(1);
  }
  return atomic_load(value) == wanted;
}

static bool await_fault(stage *s, hap_fault wanted)
{
  for (int i = 0; i < WAIT_MS && stats_of(s).faults.fault != (uint32_t)wanted; ++i) {
    sleep_ms(1);
  }
  return stats_of(s).faults.fault == (uint32_t)wanted;
}

static void await_ticks(stage *s, uint64_t more)
{
  uint64_t end = stats_of(s).loop.ticks + more;
  for (int i = 0; i < WAIT_MS && stats_of(s).loop.ticks < end; ++i) {
    sleep_ms(1);
  }
}

/* ---- how long is too long ---- */

static int looks_until(hapi_phase phase, double rate_hz)
{
  hapi_pulse pulse = {0};
  hapi_looks watch = {0};
  hapi_pulse_beat(&pulse, phase, 3);
  int looks = 0;
  while (looks < 1000 && !hapi_watchdog_look(&watch, hapi_pulse_look(&pulse), rate_hz)) {
    ++looks;
  }
  return looks;
}

TEST(a_standstill_is_counted_in_looks)
{
  CHECK(HAPI_SAFETY_LOOK_S == 0.005 && HAPI_SAFETY_STOP_WAIT_S == 1.0);
  for (int phase = HAPI_PHASE_TICK; phase <= HAPI_PHASE_WRITE; ++phase) {
    CHECK(looks_until((hapi_phase)phase, 1000.0) == 7);
    CHECK(looks_until((hapi_phase)phase, 20000.0) == 7);
    CHECK(looks_until((hapi_phase)phase, 100.0) == 8); /* a device may take two ticks for a read */
  }
  CHECK(looks_until(HAPI_PHASE_WAIT, 1000.0) == 20);
  CHECK(looks_until(HAPI_PHASE_NONE, 1000.0) == 1000);
}

TEST(a_loop_that_moves_begins_the_count_anew)
{
  hapi_pulse pulse = {0};
  hapi_looks watch = {0};
  for (int i = 0; i < 140; ++i) {
    if (i % 7 == 0) {
      hapi_pulse_beat(&pulse, HAPI_PHASE_READ, 0); /* in the same call of the next tick */
    }
    CHECK(!hapi_watchdog_look(&watch, hapi_pulse_look(&pulse), 1000.0));
  }
  CHECK(hapi_watchdog_look(&watch, hapi_pulse_look(&pulse), 1000.0)); /* and it stays so */
  CHECK(hapi_watchdog_look(&watch, hapi_pulse_look(&pulse), 1000.0));
}

TEST(a_pulse_tells_where_the_loop_is)
{
  hapi_pulse pulse = {0};
  for (uint32_t i = 0; i < 16; ++i) {
    uint64_t before = hapi_pulse_look(&pulse);
    hapi_pulse_beat(&pulse, HAPI_PHASE_WRITE, i);
    CHECK(hapi_pulse_look(&pulse) != before);
    CHECK(hapi_pulse_phase(hapi_pulse_look(&pulse)) == HAPI_PHASE_WRITE);
    CHECK(hapi_pulse_index(hapi_pulse_look(&pulse)) == i);
  }
}

/* ---- where the loop stands still ---- */

static uint64_t word_of(hapi_phase phase, uint32_t index)
{
  hapi_pulse pulse = {0};
  hapi_pulse_beat(&pulse, phase, index);
  return hapi_pulse_look(&pulse);
}

TEST(a_standstill_is_told_by_where_the_loop_is)
{
  static const struct {
    hapi_phase phase;
    uint32_t index;
    uint64_t pointer; /* of the fault */
    const char *text;
  } rows[] = {{HAPI_PHASE_READ, 0, 1, "device  did not come back from read"},
              {HAPI_PHASE_WRITE, 1, 2, "device  did not come back from write"},
              {HAPI_PHASE_READ, 60, 0, "a tick did not come to its end"},
              {HAPI_PHASE_TICK, 0, 0, "a tick did not come to its end"},
              {HAPI_PHASE_WAIT, 0, 0, "was not woken"}};
  hap_detail text = {""};
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  REQUIRE(stage_create(s) == HAP_OK);
  hapi_haptic *haptic = s->session->haptic;
  hapi_haptic_where(haptic, &text);
  CHECK(strcmp(text.text, "a device did not come back from zero") == 0); /* of no standstill */
  for (size_t i = 0; i < sizeof rows / sizeof rows[0]; ++i) {
    hapi_loop_standstill taken;
    uint64_t word = word_of(rows[i].phase, rows[i].index);
    atomic_store(&haptic->standstill.happened, word);
    hapi_haptic_where(haptic, &text);
    CHECK_SAY(text_has(text.text, rows[i].text), "%s", text.text);
    CHECK(stats_of(s).faults.fault == HAP_FAULT_NONE && !hapi_standstill_pending(haptic));
    atomic_store(&haptic->standstill.blocked, word);
    hap_stats stats = stats_of(s);
    CHECK(stats.faults.fault == HAP_FAULT_BLOCKED && stats.faults.count == 1);
    CHECK((stats.faults.pointer & 0xffffffffu) == rows[i].pointer);
    stats.faults.fault = HAP_FAULT_WORLD; /* another one was first */
    stats.faults.pointer = 0;
    hapi_standstill_stats(haptic, &stats);
    CHECK(stats.faults.fault == HAP_FAULT_WORLD && stats.faults.count == 1);
    hapi_standstill_take(haptic, &taken);
    CHECK(taken.blocked && taken.pointer == rows[i].pointer && !hapi_standstill_pending(haptic));
    hapi_standstill_take(haptic, &taken);
    CHECK(!taken.blocked && taken.pointer == 0);
  }
  stage_end(s);
}

/* ---- a device that hangs ---- */

static char logged[600];
static atomic_int logs;

/* Several watchdogs may tell at the same time. */
static void log_keep(hap_log_level level, const char *text, void *user)
{
  static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
  (void)user;
  if (level == HAP_LOG_ERROR) {
    pthread_mutex_lock(&lock);
    snprintf(logged, sizeof logged, "%s", text);
    pthread_mutex_unlock(&lock);
    atomic_fetch_add(&logs, 1);
  }
}

static void log_catch(void)
{
  hap_hooks hooks;
  hap_hooks_init(&hooks, sizeof hooks);
  hooks.log = log_keep;
  atomic_store(&logs, 0);
  REQUIRE(hap_hooks_set(&hooks) == HAP_OK);
}

static void log_release(void)
{
  REQUIRE(hap_hooks_set(NULL) == HAP_OK);
}

static void hang_in(atomic_int *block, const char *call)
{
  stage *s = stuck_begin(1);
  stuck_device *d = &devices[0];
  REQUIRE(stuck_hold(s, 1));
  uint64_t before = stats_of(s).faults.count;
  atomic_store(block, 1);
  REQUIRE(await_value(&d->inside, 1));
  CHECK(await_value(&d->holds, 0));
  double took = 1e-9 * (double)(atomic_load(&d->zeroed_ns) - atomic_load(&d->blocked_ns));
  printf("# zero %.1f ms after %s blocked\n", 1e3 * took, call);
  CHECK(took < 0.5);                   /* 0.05 where the machine does nothing else */
  CHECK(atomic_load(&d->inside) == 1); /* it still hangs, and the fault is told */
  hap_stats stats = stats_of(s);
  CHECK(stats.faults.fault == HAP_FAULT_BLOCKED && stats.faults.count == before + 1);
  CHECK(stats.faults.pointer == hands[0].v);
  CHECK(text_has(detail_of(s), "pointer 1: ") && text_has(detail_of(s), "zero until the fault"));
  CHECK(text_has(detail_of(s), "device first") && text_has(detail_of(s), call));
  CHECK(await_value(&logs, 1) && text_has(logged, "device first") && text_has(logged, call));
  int forces = atomic_load(&d->forces) + (block == &d->block_write); /* its own, on its way out */
  atomic_store(block, 0);
  CHECK(await_value(&d->inside, 0));
  await_ticks(s, 50);
  stats = stats_of(s); /* latched by the loop, once */
  CHECK(stats.faults.fault == HAP_FAULT_BLOCKED && stats.faults.count == before + 1);
  CHECK(stats.faults.pointer == hands[0].v && text_has(detail_of(s), call));
  CHECK(atomic_load(&d->forces) == forces && atomic_load(&d->holds) == 0);
  CHECK(hap_session_reset_fault(s->session) == HAP_OK);
  CHECK(stuck_hold(s, 1));
  stuck_end(s, 1);
}

TEST(a_read_that_hangs_is_zeroed_and_told)
{
  log_catch();
  hang_in(&devices[0].block_read, "read");
  log_release();
}

TEST(a_write_that_hangs_is_zeroed_and_told)
{
  log_catch();
  hang_in(&devices[0].block_write, "write");
  log_release();
}

/* Its force comes after the zero of the watchdog, and another zero after that. */
TEST(a_write_that_gives_its_force_on_its_way_out_is_followed_by_zero)
{
  stage *s = stuck_begin(1);
  stuck_device *d = &devices[0];
  for (int i = 0; i < 5; ++i) {
    REQUIRE(stuck_hold(s, 1));
    atomic_store(&d->block_write, 1);
    REQUIRE(await_value(&d->inside, 1) && await_fault(s, HAP_FAULT_BLOCKED));
    int forces = atomic_load(&d->forces);
    atomic_store(&d->block_write, 0);
    CHECK(await_value(&d->forces, forces + 1));
    CHECK(await_value(&d->holds, 0));
    await_ticks(s, 5);
    CHECK(atomic_load(&d->forces) == forces + 1 && atomic_load(&d->holds) == 0);
    CHECK(hap_session_reset_fault(s->session) == HAP_OK);
  }
  stuck_end(s, 1);
}

/* The zero of the one hangs as well: the other is let go, and an emergency does not wait. */
TEST(a_zero_that_hangs_leaves_no_other_device_with_force)
{
  stage *s = stuck_begin(2);
  REQUIRE(stuck_hold(s, 2));
  atomic_store(&devices[0].block_zero, 1);
  atomic_store(&devices[0].block_read, 1);
  CHECK(await_value(&devices[0].zeroing, 1)); /* its watchdog */
  CHECK(await_value(&devices[1].holds, 0));
  CHECK(stats_of(s).faults.fault == HAP_FAULT_BLOCKED);
  CHECK(stats_of(s).faults.pointer == hands[0].v);
  atomic_store(&devices[1].holds, 1);
  atomic_store(&devices[0].block_zero, 0);
  CHECK(await_value(&devices[1].holds, 0)); /* again and again, while the loop hangs */
  CHECK(await_value(&devices[0].holds, 0));
  atomic_store(&devices[0].block_read, 0);
  stuck_end(s, 2);
}

static void *zero_all(void *unused)
{
  hap_emergency_zero();
  return unused;
}

TEST(an_emergency_zeroes_a_device_whose_zero_hangs_last)
{
  static stuck_device pair[2];
  pthread_t first;
  memset(pair, 0, sizeof pair);
  REQUIRE(hapi_emergency_add(&stuck_ops, &pair[0]) && hapi_emergency_add(&stuck_ops, &pair[1]));
  atomic_store(&pair[0].block_zero, 1);
  REQUIRE(pthread_create(&first, NULL, zero_all, NULL) == 0);
  REQUIRE(await_value(&pair[0].zeroing, 1));
  CHECK(hapi_emergency_is_zeroing(&stuck_ops, &pair[0]));
  CHECK(!hapi_emergency_is_zeroing(&stuck_ops, &pair[1]));
  atomic_store(&pair[1].holds, 1);
  pthread_t second;
  REQUIRE(pthread_create(&second, NULL, zero_all, NULL) == 0);
  CHECK(await_value(&pair[1].holds, 0));   /* though the one before it in the table hangs */
  CHECK(await_value(&pair[0].zeroing, 2)); /* and it is zeroed itself, last */
  CHECK(!hapi_emergency_remove(&stuck_ops, &pair[0])); /* not for ever */
  CHECK(hapi_emergency_remove(&stuck_ops, &pair[1]) || true);
  atomic_store(&pair[0].block_zero, 0);
  pthread_join(first, NULL);
  pthread_join(second, NULL);
  CHECK(hapi_emergency_remove(&stuck_ops, &pair[0]));
  CHECK(hapi_emergency_remove(&stuck_ops, &pair[1]));
}

/* ---- a loop that nobody wakes ---- */

static atomic_int noted;

static void note_blocked(void *user, uint64_t word)
{
  (void)user;
  (void)word;
  CHECK(atomic_load(&devices[0].zeroed_ns) == 0); /* before the zero */
  atomic_fetch_add(&noted, 1);
}

static void note_told(void *user, uint64_t word)
{
  (void)user;
  (void)word;
  CHECK(atomic_load(&devices[0].zeroed_ns) != 0);
}

TEST(a_loop_that_is_not_woken_is_zeroed)
{
  static hapi_watchdog watchdog;
  hapi_pulse pulse = {0};
  stuck_device *d = &devices[0];
  memset(d, 0, sizeof *d);
  atomic_store(&noted, 0);
  const hapi_watchdog_def def = {.ops = &stuck_ops,
                                 .self = d,
                                 .pulse = &pulse,
                                 .rate_hz = 1000.0,
                                 .blocked = note_blocked,
                                 .tell = note_told};
  REQUIRE(hapi_emergency_add(&stuck_ops, d));
  atomic_store(&d->holds, 1);
  REQUIRE(hapi_watchdog_start(&watchdog, &def) == HAP_OK);
  sleep_ms(300); /* no loop runs yet */
  CHECK(atomic_load(&d->holds) == 1 && atomic_load(&noted) == 0);
  hapi_pulse_beat(&pulse, HAPI_PHASE_WAIT, 0);
  CHECK(await_value(&d->holds, 0) && atomic_load(&noted) == 1);
  CHECK(hapi_watchdog_stop(&watchdog) && hapi_watchdog_stop(&watchdog));
  CHECK(hapi_emergency_remove(&stuck_ops, d));
}

/* ---- a stop that does not come back ---- */

TEST(a_stop_says_which_device_hangs_and_works_when_it_is_back)
{
  stage *s = stuck_begin(2);
  REQUIRE(stuck_hold(s, 2));
  atomic_store(&devices[1].block_read, 1);
  REQUIRE(await_value(&devices[1].inside, 1));
  CHECK(hap_pointer_remove(s->session, hands[0]) == HAP_ERROR_TIMEOUT);
  CHECK(text_has(detail_of(s), "device second"));
  CHECK(hap_pointer_restart(s->session, hands[1]) == HAP_ERROR_TIMEOUT);
  CHECK(text_has(detail_of(s), "device second"));
  for (int i = 0; i < 2; ++i) {
    CHECK(hap_session_stop(s->session) == HAP_ERROR_TIMEOUT);
    CHECK(stats_of(s).faults.fault == HAP_FAULT_BLOCKED);
    CHECK(text_has(detail_of(s), "device second did not come back from read"));
  }
  for (int i = 0; i < 2; ++i) {
    CHECK(atomic_load(&devices[i].holds) == 0 && atomic_load(&devices[i].stops) == 0);
  }
  atomic_store(&devices[1].block_read, 0);
  CHECK(await_value(&devices[1].inside, 0));
  CHECK(hap_session_stop(s->session) == HAP_OK);
  CHECK(atomic_load(&devices[0].stops) == 1 && atomic_load(&devices[1].stops) == 1);
  stuck_end(s, 2);
}

/* In a process of its own, as the memory is left behind: what is in use is not freed. */
static int destroy_hanging(bool zero_too)
{
  log_catch();
  stage *s = stuck_begin(2);
  REQUIRE(stuck_hold(s, 2));
  atomic_store(&devices[0].block_zero, zero_too);
  atomic_store(&devices[0].block_read, 1);
  REQUIRE(await_value(&devices[1].holds, 0) && await_value(&logs, zero_too ? 1 : 2));
  hap_session_destroy(s->session);
  bool told = strstr(logged, "device first") != NULL && strstr(logged, "not freed") != NULL;
  hap_device_close(handles[0]);
  hap_device_close(handles[1]);
  atomic_store(&devices[0].block_read, 0); /* it goes on in memory that is still there */
  atomic_store(&devices[0].block_zero, 0);
  bool back = await_value(&devices[0].inside, 0);
  sleep_ms(50);
  bool limp = atomic_load(&devices[0].holds) == 0 && atomic_load(&devices[1].holds) == 0;
  return told && back && limp ? 0 : 1;
}

TEST(a_destroy_comes_back_while_a_device_hangs)
{
  for (int zero_too = 0; zero_too < 2; ++zero_too) {
    fflush(stdout);
    pid_t child = fork();
    if (child == 0) {
      alarm(60);
      (void)syscall(SYS_exit_group, destroy_hanging(zero_too != 0)); /* past a sanitizer's look */
    }
    int status = 0;
    CHECK(waitpid(child, &status, 0) == child && WIFEXITED(status) && WEXITSTATUS(status) == 0);
  }
}

/* ---- what is not blocked ---- */

TEST(a_device_that_is_slow_is_no_fault)
{
  stage *s = stage_new(HAP_DRIVE_THREADS);
  opened = 0;
  s->def.haptic_hz = 100.0;
  stuck_ops.pacing = HAP_PACING_DEVICE;
  REQUIRE(stage_create(s) == HAP_OK);
  hap_pointer_def def;
  hap_pointer_def_init(&def, sizeof def);
  handles[0] = stuck_device_open("first");
  stuck_ops.pacing = HAP_PACING_HOST;
  def.device = handles[0];
  REQUIRE(hap_pointer_add(s->session, &def, &hands[0]) == HAP_OK);
  atomic_store(&devices[0].read_ms, 19); /* nearly two ticks */
  REQUIRE(hap_session_start(s->session) >= HAP_OK);
  await_ticks(s, 40);
  bool slept_long = atomic_load(&devices[0].longest_ns) > 30 * MS; /* on a busy machine */
  CHECK(stats_of(s).faults.fault == HAP_FAULT_NONE || slept_long);
  stuck_end(s, 1);
}

/* A child with a session, stopped and continued from outside; its device hangs on demand. */
static int run_stopped(bool hangs, int to_parent, int from_parent)
{
  char byte = 0;
  stage *s = stuck_begin(1);
  REQUIRE(stuck_hold(s, 1));
  if (hangs) {
    atomic_store(&devices[0].block_read, 1);
    REQUIRE(await_value(&devices[0].inside, 1));
  }
  bool good = write(to_parent, "r", 1) == 1;
  while (good && read(from_parent, &byte, 1) != 1) {
  }
  if (hangs) {
    return await_fault(s, HAP_FAULT_BLOCKED) && atomic_load(&devices[0].holds) == 0 ? 0 : 1;
  }
  return good && stats_of(s).faults.fault != HAP_FAULT_BLOCKED ? 0 : 2;
}

TEST(a_process_that_was_stopped_is_blocked_only_if_it_still_is)
{
  for (int hangs = 0; hangs < 2; ++hangs) {
    int to_child[2];
    int to_parent[2];
    char byte = 0;
    REQUIRE(pipe(to_child) == 0 && pipe(to_parent) == 0);
    fflush(stdout);
    pid_t child = fork();
    if (child == 0) {
      alarm(60);
      _exit(run_stopped(hangs != 0, to_parent[1], to_child[0]));
    }
    REQUIRE(read(to_parent[0], &byte, 1) == 1);
    for (int i = 0; i < 10; ++i) {
      kill(child, SIGSTOP);
      sleep_ms(hangs ? 5 : 150);
      kill(child, SIGCONT);
      sleep_ms(10);
    }
    REQUIRE(write(to_child[1], "g", 1) == 1);
    int status = 0;
    CHECK(waitpid(child, &status, 0) == child);
    CHECK(WIFEXITED(status) && WEXITSTATUS(status) == 0);
    for (int i = 0; i < 2; ++i) {
      close(to_child[i]);
      close(to_parent[i]);
    }
  }
}

/* ---- threads ---- */

/* Threads of the process of that name, and the priority of one of them. */
static int threads_count(const char *name, int *out_priority)
{
  int count = 0;
  DIR *tasks = opendir("/proc/self/task");
  for (struct dirent *e; tasks != NULL && (e = readdir(tasks)) != NULL;) {
    char path[300];
    char line[64] = "";
    struct sched_param parameters = {0};
    snprintf(path, sizeof path, "/proc/self/task/%s/comm", e->d_name);
    FILE *file = fopen(path, "r");
    if (file != NULL && fgets(line, sizeof line, file) != NULL &&
        strncmp(line, name, strlen(name)) == 0) {
      ++count;
      (void)sched_getparam((pid_t)strtol(e->d_name, NULL, 10), &parameters);
      *out_priority = parameters.sched_priority;
    }
    if (file != NULL) {
      fclose(file);
    }
  }
  if (tasks != NULL) {
    closedir(tasks);
  }
  return count;
}

TEST(the_watchdog_is_above_the_loop)
{
  int watch = 0;
  int loop = 0;
  stage *s = stage_new(HAP_DRIVE_THREADS);
  opened = 0;
  s->def.rt_priority = 98;
  REQUIRE(stage_create(s) == HAP_OK);
  hap_pointer_def def;
  hap_pointer_def_init(&def, sizeof def);
  handles[0] = stuck_device_open("first");
  def.device = handles[0];
  REQUIRE(hap_pointer_add(s->session, &def, &hands[0]) == HAP_OK);
  REQUIRE(hap_session_start(s->session) >= HAP_OK);
  CHECK(threads_count("hapode-watch", &watch) == 1 && threads_count("hapode-haptic", &loop) == 1);
  if (stats_of(s).loop.realtime != 0) {
    CHECK(loop == 98 && watch == 99);
  }
  CHECK(hap_session_stop(s->session) == HAP_OK);
  CHECK(threads_count("hapode-watch", &watch) == 0); /* nothing is left */
  stuck_end(s, 1);
}

TEST(lockstep_has_no_watchdog)
{
  int priority = 0;
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  opened = 0;
  REQUIRE(stage_create(s) == HAP_OK);
  hap_pointer_def def;
  hap_pointer_def_init(&def, sizeof def);
  stuck_ops.pacing = HAP_PACING_VIRTUAL;
  handles[0] = stuck_device_open("first");
  def.device = handles[0];
  REQUIRE(hap_pointer_add(s->session, &def, &hands[0]) == HAP_OK);
  atomic_store(&devices[0].read_ms, 50);
  REQUIRE(hap_session_start(s->session) == HAP_OK);
  CHECK(threads_count("hapode-watch", &priority) == 0);
  CHECK(hap_session_advance(s->session, 3) == HAP_OK);
  stuck_ops.pacing = HAP_PACING_HOST;
  stuck_end(s, 1);
}
