/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A session of two devices in real time, with a fault every few seconds: after each the device's
 * last force is zero, and after a reset there is force again; memory and descriptors do not grow.
 * Argument: long, an hour; seconds=N. */

#include "tests/tap.h"

#include <dirent.h>
#include <stdatomic.h>
#include <unistd.h>

#include "tests/fake_device.h"
#include "tests/stage.h"

#define DEVICES 2
#define QUICK_S 6.0
#define LONG_S 3600.0
#define PATIENCE_MS 20000
#define GROWTH_MOST 1024 /* kB, after the first tenth */

typedef enum trouble {
  TROUBLE_READ,
  TROUBLE_WRITE,
  TROUBLE_POSE,
  TROUBLE_EMERGENCY,
  TROUBLE_RESTART,
  TROUBLES
} trouble;

static const char *const trouble_names[TROUBLES] = {"read fails", "write fails", "pose is NaN",
                                                    "emergency", "lost and started again"};

static hap_device *devices[DEVICES];
static hap_pointer_id hands[DEVICES];
static atomic_int beyond; /* writes that were not finite, or beyond the limit */
static int own_faults;    /* of a busy machine: a loop that was held up */

/* Watches what arrives at the motors. */
static void soak_push(fake_device *d, const hap_wrench *wanted, hap_wrench *reached)
{
  (void)reached;
  double force = hapi_v3_norm(wanted->force);
  if (!(force <= d->info.max_force * (1.0 + 1e-9))) {
    atomic_fetch_add(&beyond, 1);
  }
}

static bool hand_pushes(int i)
{
  return atomic_load(&fakes[i].pushing) != 0;
}

static bool is_faulted(stage *s)
{
  return stats_of(s).faults.fault != HAP_FAULT_NONE;
}

/* At its own rate, and never for ever. */
static bool await_force(stage *s, bool wanted)
{
  for (int ms = 0; ms < PATIENCE_MS; ++ms) {
    bool all = true;
    for (int i = 0; i < DEVICES; ++i) {
      all = all && hand_pushes(i) == wanted;
    }
    bool faulted = is_faulted(s);
    if (all && faulted == !wanted) {
      return true;
    }
    if (faulted && wanted && ms % 100 == 99) {
      ++own_faults;
      CHECK(hap_session_reset_fault(s->session) == HAP_OK);
    }
    sleep_ms(1);
  }
  return false;
}

static void trouble_set(stage *s, trouble what, int i, int on)
{
  switch (what) {
    case TROUBLE_READ:
    case TROUBLE_RESTART:
      atomic_store(&fakes[i].fail_read, on);
      break;
    case TROUBLE_WRITE:
      atomic_store(&fakes[i].fail_write, on);
      break;
    case TROUBLE_POSE:
      atomic_store(&fakes[i].bad_pose, on);
      break;
    case TROUBLE_EMERGENCY:
      if (on != 0) {
        hap_emergency_zero();
      }
      break;
    case TROUBLES:
      break;
  }
  if (what == TROUBLE_RESTART && on == 0) {
    CHECK(hap_pointer_restart(s->session, hands[i]) == HAP_OK);
  }
}

/* False: it ended badly, and the soak with it. */
static bool trouble_pass(stage *s, trouble what, int i)
{
  trouble_set(s, what, i, 1);
  bool gone = await_force(s, false);
  if (gone) {
    for (int k = 0; k < DEVICES; ++k) {
      gone = gone && atomic_load(&fakes[k].zeroed) == 1;
    }
  }
  sleep_ms(20);
  gone = gone && !hand_pushes(0) && !hand_pushes(1); /* and it stays away */
  trouble_set(s, what, i, 0);
  CHECK(hap_session_reset_fault(s->session) == HAP_OK);
  bool back = await_force(s, true);
  CHECK_SAY(gone && back, "%s, device %d: force %s, then %s", trouble_names[what], i,
            gone ? "gone" : "stays", back ? "back" : "does not come back");
  return gone && back;
}

static long memory_kb(void)
{
  char line[200];
  long kb = -1;
  FILE *file = fopen("/proc/self/status", "r");
  while (file != NULL && fgets(line, sizeof line, file) != NULL) {
    (void)sscanf(line, "VmRSS: %ld", &kb);
  }
  if (file != NULL) {
    fclose(file);
  }
  return kb;
}

static int entries_of(const char *path)
{
  int count = 0;
  DIR *folder = opendir(path);
  while (folder != NULL && readdir(folder) != NULL) {
    ++count;
  }
  if (folder != NULL) {
    closedir(folder);
  }
  return count;
}

static stage *soak_begin(void)
{
  stage *s = stage_new(HAP_DRIVE_THREADS);
  fakes_opened = 0;
  dBodySetKinematic(s->cube);
  s->def.max_pointers = DEVICES;
  for (int i = 0; i < DEVICES; ++i) {
    fake_device *d = fake_next();
    d->info.max_force = 10.0;
    d->push = soak_push;
    devices[i] = fake_device_open(HAP_PACING_VIRTUAL);
  }
  REQUIRE(stage_create(s) == HAP_OK);
  for (int i = 0; i < DEVICES; ++i) {
    hap_pointer_def def;
    hap_pointer_def_init(&def, sizeof def);
    def.device = devices[i];
    REQUIRE(hap_pointer_add(s->session, &def, &hands[i]) == HAP_OK);
  }
  session_run(s->session);
  return s;
}

static double seconds_asked(void)
{
  double seconds = strcmp(tap_argument, "long") == 0 ? LONG_S : QUICK_S;
  (void)sscanf(tap_argument, "seconds=%lf", &seconds);
  return seconds;
}

TEST(force_is_gone_after_each_fault_and_nothing_grows)
{
  double seconds = seconds_asked();
  double pause_s = seconds > 60.0 ? 3.4 : 0.1; /* an hour has a thousand faults */
  stage *s = soak_begin();
  REQUIRE(await_force(s, true));
  int64_t begin = hapi_clock_now();
  int passed = 0;
  long warm_kb = 0;
  int files = 0;
  int threads = 0;
  uint32_t random = 22;
  for (double t = 0.0; t < seconds; t = 1e-9 * (double)(hapi_clock_now() - begin)) {
    random = random * 1664525u + 1013904223u;
    if (!trouble_pass(s, (trouble)((random >> 16) % TROUBLES), (int)(random >> 30) % DEVICES)) {
      break;
    }
    ++passed;
    if (warm_kb == 0 && t > 0.1 * seconds) {
      warm_kb = memory_kb();
      files = entries_of("/proc/self/fd");
      threads = entries_of("/proc/self/task");
    }
    sleep_ms((int)(1000.0 * pause_s * ((random >> 8) % 100) / 50.0));
  }
  long grown_kb = memory_kb() - warm_kb;
  printf("# %d faults in %.0f s and %d of a busy machine, memory %+ld kB of %ld\n", passed, seconds,
         own_faults, grown_kb, warm_kb);
  CHECK(passed >= 3 && warm_kb > 0);
  CHECK(entries_of("/proc/self/fd") == files && entries_of("/proc/self/task") == threads);
#if !TAP_ADDRESS_SANITIZER && !TAP_THREAD_SANITIZER
  CHECK(grown_kb <= GROWTH_MOST);
#endif
  stage_end(s);
  for (int i = 0; i < DEVICES; ++i) {
    hap_device_close(devices[i]);
    CHECK(!hand_pushes(i) && atomic_load(&fakes[i].zeroed) == 1);
    CHECK(atomic_load(&fakes[i].closes) == 1);
  }
  CHECK(atomic_load(&beyond) == 0);
}
