/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/conform/conform_internal.h"

#include <dirent.h>
#include <malloc.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "base/clock.h"
#include "base/vec.h"

#define AGAIN_TICKS 50
#define ROUNDS 7
#define ROUNDS_GROWN 4 /* the first ones may fill caches of the C library */

/* ---- stop and start ---- */

void conform_stop_takes_force(conform *c)
{
  hap_wrench held;
  bool looks = conform_needs_force(c) && conform_needs_held(c);
  if (looks) {
    const hap_wrench push = conform_small(c, 0, 1.0);
    hap_wrench reached;
    (void)conform_write(c, &push, &reached);
  }
  if (c->running) {
    conform_stop(c);
  }
  if (looks && conform_held(c, &held) && !conform_is_zero(&held)) {
    conform_fail(c, "stopped without zero before, it holds %.3g N", hapi_v3_norm(held.force));
    conform_zero(c);
  }
}

void conform_after_stop(conform *c)
{
  const hap_wrench none = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  conform_sample sample;
  hap_wrench reached;
  if (conform_read(c, &sample) >= HAP_OK && !c->said.reads_unstarted) {
    conform_fail(c, "after stop it can be read");
  }
  if (conform_write(c, &none, &reached) >= HAP_OK && !c->said.writes_unstarted) {
    conform_fail(c, "after stop it takes a wrench");
  }
}

void conform_stop_twice(conform *c)
{
  conform_stop(c);
  conform_stop(c);
  conform_expect_none(c, "stopped several times,");
  conform_zero(c);
}

static void read_some(conform *c, const char *when)
{
  const hap_wrench none = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  conform_wrong before = c->seen.wrong;
  conform_sample sample;
  hap_wrench reached;
  unsigned refused = 0;
  for (int i = 0; i < AGAIN_TICKS && conform_tick(c, &sample); ++i) {
    refused += conform_write(c, &none, &reached) < HAP_OK;
  }
  if (conform_reads_worse(c, &before) || refused > 0) {
    conform_fail(c, "%s reads or writes failed or were not filled in", when);
  }
}

void conform_start_again(conform *c)
{
  if (c->seen.wrong.statuses > 0 || c->said.start_wrong) {
    conform_skip(c, "it cannot be started or read");
    return;
  }
  hap_status status = conform_start(c);
  if (status < HAP_OK) {
    conform_fail(c, "the second start gave %s", hap_status_name(status));
    c->said.start_wrong = true;
    return;
  }
  if (!c->said.holds_at_start) {
    conform_expect_none(c, "started again,");
  }
  conform_zero(c);
  read_some(c, "started again,");
}

/* ---- info ---- */

static bool is_same_info(conform *c, uint32_t effector)
{
  hap_device_info now = {.size = sizeof now};
  conform_enter("describe", CONFORM_TICK_LIMIT_S);
  c->ops->describe(c->self, effector, &now);
  conform_leave();
  const hap_device_info *then = &c->device->effectors[effector].info;
  bool same = now.dof == then->dof && now.measures_velocity == then->measures_velocity &&
              (now.effector_count > 0 ? now.effector_count : 1) == then->effector_count &&
              now.axis_count == then->axis_count && now.button_count == then->button_count &&
              now.led_count == then->led_count && now.vibrator_count == then->vibrator_count &&
              (now.name[0] == '\0' || strncmp(now.name, then->name, sizeof now.name) == 0);
  const double pairs[][2] = {{now.max_force, then->max_force},
                             {now.max_torque, then->max_torque},
                             {now.rated_stiffness, then->rated_stiffness},
                             {now.damping, then->damping},
                             {now.quantum, then->quantum},
                             {now.mass, then->mass},
                             {now.friction, then->friction},
                             {now.delay, then->delay},
                             {now.vibrator_hz[0], then->vibrator_hz[0]},
                             {now.vibrator_hz[1], then->vibrator_hz[1]}};
  for (size_t i = 0; i < sizeof pairs / sizeof pairs[0]; ++i) {
    same = same && pairs[i][0] == pairs[i][1];
  }
  for (int i = 0; i < 3; ++i) {
    same = same && now.workspace_low[i] == then->workspace_low[i] &&
           now.workspace_high[i] == then->workspace_high[i];
  }
  return same;
}

static void compare_info(conform *c, const char *when)
{
  bool same = true;
  for (uint32_t i = 0; i < c->device->effector_count; ++i) {
    same = is_same_info(c, i) && same;
  }
  if (!same) {
    conform_fail(c, "%s it describes itself in another way than when it was opened", when);
  }
}

void conform_info_is_stable(conform *c)
{
  if (c->running) {
    compare_info(c, "running,");
    conform_zero(c);
    conform_stop(c);
  }
  compare_info(c, "stopped,");
}

/* ---- two devices ---- */

/* Both run; force on one is none on the other, and zero of one takes none from the other. */
static void compare_forces(conform *c, conform *other)
{
  hap_wrench reached;
  hap_wrench held;
  const hap_wrench push = conform_small(c, 0, 1.0);
  if (!conform_has_force(c) || c->said.zero_wrong || !conform_held(c, &held)) {
    return;
  }
  conform_zero(other);
  (void)conform_write(c, &push, &reached);
  if (conform_held(other, &held) && !conform_is_zero(&held)) {
    conform_fail(c, "a force on one device is held by the other");
  }
  conform_zero(other);
  if (conform_held(c, &held) && conform_is_zero(&held)) {
    conform_fail(c, "zero of one device took the force off the other");
  }
  conform_zero(c);
}

static void run_both(conform *c, conform *other)
{
  conform_sample sample;
  if (conform_start(c) < HAP_OK || conform_start(other) < HAP_OK) {
    conform_fail(c, "two were opened, and one of them does not start");
    return;
  }
  for (int i = 0; i < AGAIN_TICKS; ++i) {
    if (!conform_tick(c, &sample) || !conform_tick(other, &sample)) {
      conform_fail(c, "two run, and one of them cannot be read");
      return;
    }
  }
  compare_forces(c, other);
  conform_close(other);
  read_some(c, "when the other one was closed,");
}

void conform_two_devices(conform *c)
{
  hap_detail detail = {""};
  if (c->seen.wrong.statuses > 0 || c->said.start_wrong) {
    conform_skip(c, "it cannot be started again or read");
    return;
  }
  conform *other = calloc(1, sizeof *other);
  if (other == NULL) {
    conform_fail(c, "out of memory");
    return;
  }
  other->options = c->options;
  other->out = c->out;
  if (conform_open(other, &detail)) {
    run_both(c, other);
  } else {
    conform_skip(c, "only one at a time: %.200s", detail.text);
  }
  conform_close(other);
  if (c->running) {
    conform_zero(c);
    conform_stop(c);
  }
  free(other);
}

/* ---- open again ---- */

void conform_open_again(conform *c)
{
  hap_detail detail = {""};
  hap_wrench reached;
  conform_sample sample;
  if (conform_has_force(c) && !c->said.start_wrong && conform_start(c) >= HAP_OK &&
      conform_tick(c, &sample)) {
    const hap_wrench push = conform_small(c, 0, 1.0);
    (void)conform_write(c, &push, &reached);
  }
  conform_close(c);
  if (!conform_open(c, &detail)) {
    conform_fail(c, "closed, it does not open again: %s", detail.text);
    return;
  }
  if (conform_needs_held(c) && !c->said.holds_at_open) {
    conform_expect_none(c, "opened again,");
  }
}

/* ---- leaks ---- */

typedef struct usage {
  size_t heap; /* bytes */
  size_t files;
  size_t threads;
} usage;

static size_t entries_of(const char *folder)
{
  size_t count = 0;
  DIR *directory = opendir(folder);
  while (directory != NULL && readdir(directory) != NULL) {
    ++count;
  }
  if (directory != NULL) {
    closedir(directory);
  }
  return count;
}

static void usage_measure(usage *out)
{
  struct mallinfo2 heap = mallinfo2();
  out->heap = heap.uordblks + heap.hblkhd;
  out->files = entries_of("/proc/self/fd");
  out->threads = entries_of("/proc/self/task");
}

static bool one_life(conform *c)
{
  hap_detail detail = {""};
  conform_sample sample;
  if (!conform_open(c, &detail)) {
    conform_fail(c, "it does not open again: %s", detail.text);
    return false;
  }
  if (c->seen.wrong.statuses == 0 && conform_start(c) >= HAP_OK) {
    for (int i = 0; i < 3 && conform_tick(c, &sample); ++i) {
    }
  }
  conform_close(c);
  return !c->stopped;
}

/* What grows in every round is never given back. */
void conform_leaks(conform *c)
{
  unsigned heap = 0;
  unsigned files = 0;
  unsigned threads = 0;
  usage before;
  conform_close(c);
  usage_measure(&before);
  for (int round = 0; round < ROUNDS; ++round) {
    usage now;
    if (!one_life(c)) {
      return;
    }
    usage_measure(&now);
    heap = now.heap > before.heap ? heap + 1 : 0;
    files = now.files > before.files ? files + 1 : 0;
    threads = now.threads > before.threads ? threads + 1 : 0;
    before = now;
  }
  if (heap >= ROUNDS_GROWN || files >= ROUNDS_GROWN || threads >= ROUNDS_GROWN) {
    conform_fail(c, "each time it is opened and closed there is more left: %s%s%s",
                 heap >= ROUNDS_GROWN ? "memory " : "", files >= ROUNDS_GROWN ? "files " : "",
                 threads >= ROUNDS_GROWN ? "threads" : "");
  }
}

/* ---- unplugged ---- */

static void person_tell(const conform *c, const char *what)
{
  if (!conform_is_virtual(c)) {
    fprintf(stderr, "%s now; there are %g s for it\n", what, c->options->unplug_s);
  }
}

/* True when reads or writes began to fail. */
static bool await_failure(conform *c)
{
  const hap_wrench none = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  double ticks = c->options->unplug_s * c->options->rate_hz;
  conform_sample sample;
  hap_wrench reached;
  for (double i = 0.0; i < ticks && !c->stopped; i += 1.0) {
    if (!conform_tick(c, &sample) || conform_write(c, &none, &reached) < HAP_OK) {
      return !c->stopped;
    }
  }
  return false;
}

/* As the session does: zero, and reads and writes that fail, which still must not block. */
static void look_while_gone(conform *c)
{
  const hap_wrench none = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  conform_sample sample;
  hap_wrench reached;
  hapi_histogram_reset(&c->seen.reads);
  hapi_histogram_reset(&c->seen.writes);
  for (int i = 0; i < AGAIN_TICKS && !c->stopped; ++i) {
    (void)conform_tick(c, &sample);
    (void)conform_write(c, &none, &reached);
    conform_zero(c);
  }
  double most_ns = 2e9 * conform_period(c);
  double read_ns = hapi_histogram_quantile_ns(&c->seen.reads, 0.9);
  double write_ns = hapi_histogram_quantile_ns(&c->seen.writes, 0.9);
  if (read_ns > most_ns || write_ns > most_ns) {
    conform_fail(c, "unplugged, it blocks: read %.3g us, write %.3g us", 1e-3 * read_ns,
                 1e-3 * write_ns);
  }
  conform_expect_none(c, "unplugged,");
  conform_stop(c);
}

static bool start_when_back(conform *c)
{
  const struct timespec moment = {0, 200000000};
  int64_t end_ns = hapi_clock_now() + (int64_t)(1e9 * c->options->unplug_s);
  while (hapi_clock_now() < end_ns && !c->options->stop()) {
    if (conform_start(c) >= HAP_OK) {
      return true;
    }
    conform_expect_none(c, "not started,");
    nanosleep(&moment, NULL);
  }
  return false;
}

void conform_unplugged(conform *c)
{
  hap_detail detail = {""};
  if (!(c->options->unplug_s > 0.0)) {
    conform_skip(c, "only with --check-unplug, and somebody to pull the plug");
    return;
  }
  if (!conform_open(c, &detail) || conform_start(c) < HAP_OK) {
    conform_fail(c, "it does not start: %s", detail.text);
    return;
  }
  person_tell(c, "pull its plug");
  if (!await_failure(c)) {
    conform_fail(c, "nobody unplugged it, or it does not notice");
    return;
  }
  look_while_gone(c);
  person_tell(c, "put its plug in again");
  if (!start_when_back(c)) {
    conform_fail(c, "plugged in again, it does not start");
    return;
  }
  conform_expect_none(c, "plugged in and started again,");
  memset(&c->seen.wrong, 0, sizeof c->seen.wrong);
  read_some(c, "plugged in and started again,");
}
