/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The running haptic thread, seen by the kernel: in 10,000 ticks in contact it touches no memory
 * for the first time and waits for nothing but its next tick. Its symbols: lint/rt_symbols.py;
 * allocations and locks: test_rtsan.c. */

#include "tests/tap.h"

#include <time.h>

#include "bench/thread_counts.h"
#include "tools/rig.h"

#if defined(__has_feature)
#if __has_feature(thread_sanitizer) || __has_feature(address_sanitizer)
#define SANITIZED 1
#endif
#endif
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define SANITIZED 1
#endif

#define HAPTIC_HZ 4000.0
#define TICKS 10000

static rig r;

static hap_stats stats_now(void)
{
  hap_stats stats;
  memset(&stats, 0, sizeof stats);
  CHECK(hap_session_stats(r.session, &stats, sizeof stats) >= HAP_OK);
  return stats;
}

/* Ten times as long as it takes on an idle machine. */
static bool wait_for_ticks(uint64_t ticks)
{
  const struct timespec pause = {0, 5000000};
  for (int i = 0; i < 10000 && stats_now().loop.ticks < ticks; ++i) {
    nanosleep(&pause, NULL);
  }
  return stats_now().loop.ticks >= ticks;
}

static bool rig_begin(const char *scene_name, hap_model model)
{
  rig_options options;
  hap_detail detail = {0};
  rig_options_init(&options);
  options.scene = scene_name;
  options.def.drive = HAP_DRIVE_THREADS;
  options.def.model = model;
  options.def.haptic_hz = HAPTIC_HZ;
  if (model == HAP_MODEL_SINGLE) {
    options.def.physics_hz = 500.0; /* what any machine can do */
  }
  bool good = rig_create(&options, &r, &detail) >= HAP_OK && hap_session_start(r.session) >= HAP_OK;
  CHECK(good);
  return good;
}

static void ticks_are_quiet(const char *scene_name, hap_model model)
{
  thread_counts before;
  thread_counts after;
  if (!rig_begin(scene_name, model)) {
    return;
  }
  int thread = thread_find("hapode-haptic");
  REQUIRE(thread != 0 &&
          wait_for_ticks(2000)); /* warm: libraries, stack, first models, first touch */
  REQUIRE(thread_count(thread, &before));
  hap_stats begin_stats = stats_now();
  REQUIRE(wait_for_ticks(begin_stats.loop.ticks + TICKS));
  hap_stats end_stats = stats_now();
  REQUIRE(thread_count(thread, &after));
  thread_counts more = thread_counts_since(&after, &before);
  uint64_t ticks = end_stats.loop.ticks - begin_stats.loop.ticks;
  printf(
      "# %s, %s: %llu ticks, %llu in contact: faults %llu minor, %llu major; switches %llu own, "
      "%llu not\n",
      scene_name, hap_model_name(model), (unsigned long long)ticks,
      (unsigned long long)(end_stats.loop.contact_ticks - begin_stats.loop.contact_ticks),
      (unsigned long long)more.minor_faults, (unsigned long long)more.major_faults,
      (unsigned long long)more.voluntary, (unsigned long long)more.involuntary);
  CHECK(more.minor_faults == 0 && more.major_faults == 0);
  /* One wait a tick; those that the counting itself lasted are not in ticks. */
  CHECK(more.voluntary <= ticks + ticks / 100 + 10);
  CHECK(end_stats.loop.contact_ticks > begin_stats.loop.contact_ticks);
  rig_destroy(&r);
}

TEST(ticks_touch_no_new_memory_and_wait_for_nothing_else)
{
#if defined(SANITIZED)
  SKIP("a sanitizer's own memory");
#endif
  if (thread_find("no-such-thread") != 0 || thread_find("test_realtime") == 0) {
    SKIP("no /proc/self/task");
  }
  ticks_are_quiet("row10", HAP_MODEL_CONTACT);
  ticks_are_quiet("row10", HAP_MODEL_ACCELERANCE);
  ticks_are_quiet("row10", HAP_MODEL_IMPULSE);
  ticks_are_quiet("row10", HAP_MODEL_SINGLE);
}
