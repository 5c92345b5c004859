/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A million ticks of each device that a thread talks to: read, write, now and then a zero and an
 * explain, seen by LLVM's real-time sanitizer, while the thread exchanges with a stand-in or a
 * pretended service. */

#include "tests/tap.h"

#include <hapode/hapode.h>

#ifndef HAPODE_RTSAN

TEST(devices_neither_allocate_nor_lock_in_a_million_ticks)
{
  SKIP("needs libclang_rt.rtsan of libclang-rt-19-dev (and no other sanitizer)");
}

int main(void)
{
  RUN(devices_neither_allocate_nor_lock_in_a_million_ticks);
  return tap_done();
}

#else

#include <pthread.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/clock.h"
#include "device/device.h"
#include "plugins/haply/websocket.h"
#include "tests/haply_rig.h"
#include "tests/vendor_rig.h"

#define TICKS 1000000
#define SLOW ",stale=0.9,timeout=9"

void __rtsan_init(void);           /* NOLINT: LLVM's names */
void __rtsan_realtime_enter(void); /* NOLINT */
void __rtsan_realtime_exit(void);  /* NOLINT */

static void *volatile sink;

/* In a process of its own, which the sanitizer ends. */
static int ticks_run(const char *spec, bool wrong)
{
  hap_device *device = NULL;
  hap_detail detail = {""};
  hap_device_input in = {.size = sizeof in};
  hap_device_output wanted = {.size = sizeof wanted};
  hap_device_output given = {.size = sizeof given};
  hap_device_input *const ins[] = {&in};
  const hap_device_output *const wants[] = {&wanted};
  hap_device_output *const gives[] = {&given};
  int bad = 0;
  if (hap_device_open(spec, &device, &detail) != HAP_OK) {
    fprintf(stderr, "%s\n", detail.text);
    return 2;
  }
  const hap_device_ops *ops = hapi_device_ops(device);
  void *self = hapi_device_self(device);
  if (ops->start(self) != HAP_OK) {
    return 3;
  }
  for (int i = 0; i < TICKS; ++i) {
    int64_t now_ns = hapi_clock_now();
    wanted.wrench.force[0] = 1e-7 * i;
    __rtsan_realtime_enter();
    bad += ops->read(self, now_ns, ins) < HAP_OK;
    bad += ops->write(self, wants, gives) < HAP_OK;
    if (i % 1000 == 999) {
      ops->zero(self);
      ops->held(self, gives);
    }
    if (wrong && i == TICKS / 2) {
      sink = malloc(7); /* that the sanitizer sees anything */
    }
    __rtsan_realtime_exit();
  }
  ops->stop(self);
  hap_device_close(device);
  return bad == 0 ? 0 : 4;
}

static int child_status(const char *spec, bool wrong)
{
  int status = -1;
  fflush(stdout);
  pid_t child = fork();
  if (child == 0) {
    if (wrong) {
      CHECK(freopen("/dev/null", "w", stderr) != NULL);
    } else {
      dup2(1, 2);
    }
    _exit(ticks_run(spec, wrong));
  }
  CHECK(waitpid(child, &status, 0) == child);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

TEST(forcedimension_neither_allocates_nor_locks)
{
  CHECK(child_status(vendor_spec(VENDOR_DHD, SLOW), false) == 0);
  CHECK(child_status(vendor_spec(VENDOR_DHD, SLOW), true) != 0);
}

TEST(openhaptics_neither_allocates_nor_locks)
{
  CHECK(child_status(vendor_spec(VENDOR_HD, SLOW), false) == 0);
}

TEST(haply_neither_allocates_nor_locks)
{
  if (!hapi_websocket_is_there()) {
    SKIP("built without libwslay");
  }
  service *s = service_new(NULL);
  CHECK(child_status(service_spec(s, SLOW), false) == 0);
}

int main(void)
{
  setenv("RTSAN_OPTIONS", "halt_on_error=1", 0);
  __rtsan_init();
  RUN(forcedimension_neither_allocates_nor_locks);
  RUN(openhaptics_neither_allocates_nor_locks);
  RUN(haply_neither_allocates_nor_locks);
  return tap_done();
}

#endif
