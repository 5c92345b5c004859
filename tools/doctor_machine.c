/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/doctor.h"

#include <errno.h>
#include <langinfo.h>
#include <locale.h>
#include <pthread.h>
#include <sched.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>

#include <ode/ode.h>

#define SLEEPS 2000          /* of the latency check */
#define SLEEP_NS 1000000     /* length of each */
#define P999_GOOD_US 200.0   /* a fifth of a tick at 1 kHz */
#define LOCK_BYTES (1 << 24) /* more than a session locks */

void doctor_check_kernel(const doctor_place *place, doctor_check *check)
{
  char version[300] = "";
  char flag[8] = "";
  if (!doctor_line(place, "/proc/version", version, sizeof version)) {
    doctor_say(check, DOCTOR_WARNING, "/proc/version cannot be read");
    return;
  }
  bool rt = doctor_line(place, "/sys/kernel/realtime", flag, sizeof flag) && flag[0] == '1';
  if (rt || strstr(version, "PREEMPT_RT") != NULL) {
    doctor_say(check, DOCTOR_OK, "PREEMPT_RT: %.200s", version);
    return;
  }
  doctor_say(check, DOCTOR_WARNING, "no PREEMPT_RT: %.200s", version);
  doctor_todo(check, "sudo apt-get install linux-image-rt-amd64, then start that kernel");
}

/* Soft limit of /proc/self/limits; negative: unlimited. */
static bool limit_read(const doctor_place *place, const char *name, double *out)
{
  char rest[128];
  if (!doctor_field(place, "/proc/self/limits", name, rest, sizeof rest)) {
    return false;
  }
  const char *at = rest + strspn(rest, " ");
  *out = strncmp(at, "unlimited", 9) == 0 ? -1.0 : (double)strtoll(at, NULL, 10);
  return true;
}

void doctor_check_rtprio(const doctor_place *place, doctor_check *check)
{
  double limit;
  if (!limit_read(place, "Max realtime priority", &limit)) {
    doctor_say(check, DOCTOR_WARNING, "the limit cannot be read");
  } else if (limit < 0.0 || limit >= 80.0) {
    doctor_say(check, DOCTOR_OK, "rtprio lets the loop have its priority of 80");
  } else if (doctor_is_root(place)) {
    doctor_say(check, DOCTOR_OK, "rtprio is %g, which does not bind root", limit);
  } else {
    doctor_say(check, DOCTOR_PROBLEM, "rtprio is %g, the loop asks for 80", limit);
    doctor_todo(
        check,
        "echo \"$USER - rtprio 95\" | sudo tee /etc/security/limits.d/hapode-rtprio.conf, then "
        "log in again");
  }
}

void doctor_check_memlock(const doctor_place *place, doctor_check *check)
{
  double limit;
  if (!limit_read(place, "Max locked memory", &limit)) {
    doctor_say(check, DOCTOR_WARNING, "the limit cannot be read");
  } else if (limit < 0.0 || limit >= (double)LOCK_BYTES) {
    doctor_say(check, DOCTOR_OK, "memlock lets a session lock its memory");
  } else if (doctor_is_root(place)) {
    doctor_say(check, DOCTOR_OK, "memlock is %.0f bytes, which does not bind root", limit);
  } else {
    doctor_say(check, DOCTOR_WARNING, "memlock is %.0f bytes, a session may lock %d", limit,
               LOCK_BYTES);
    doctor_todo(check,
                "echo \"$USER - memlock unlimited\" | sudo tee "
                "/etc/security/limits.d/hapode-memlock.conf, then log in again");
  }
}

void doctor_check_memory_lock(const doctor_place *place, doctor_check *check)
{
  (void)place;
  void *memory = mmap(NULL, LOCK_BYTES, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) {
    doctor_say(check, DOCTOR_PROBLEM, "no memory: %s", strerror(errno));
    return;
  }
  if (mlock(memory, LOCK_BYTES) == 0) {
    doctor_say(check, DOCTOR_OK, "%d bytes were locked", LOCK_BYTES);
  } else {
    doctor_say(check, DOCTOR_WARNING, "%d bytes cannot be locked: %s", LOCK_BYTES, strerror(errno));
    doctor_todo(check, "ulimit -l unlimited, or as the check memlock says");
  }
  (void)munmap(memory, LOCK_BYTES);
}

static int lateness_compare(const void *a, const void *b)
{
  double x = *(const double *)a;
  double y = *(const double *)b;
  return (x > y) - (x < y);
}

typedef struct lateness {
  double us[SLEEPS];
} lateness;

static void *lateness_measure(void *user)
{
  lateness *late = user;
  struct timespec due;
  struct timespec now;
  for (int i = 0; i < SLEEPS; ++i) {
    clock_gettime(CLOCK_MONOTONIC, &due);
    due.tv_nsec += SLEEP_NS;
    if (due.tv_nsec >= 1000000000L) {
      due.tv_nsec -= 1000000000L;
      ++due.tv_sec;
    }
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, NULL) == EINTR) {
    }
    clock_gettime(CLOCK_MONOTONIC, &now);
    late->us[i] =
        (double)(now.tv_sec - due.tv_sec) * 1e6 + (double)(now.tv_nsec - due.tv_nsec) * 1e-3;
  }
  return NULL;
}

/* With SCHED_FIFO where that is allowed, else without. */
static bool lateness_run(lateness *late, bool *out_fifo)
{
  pthread_t thread;
  pthread_attr_t attributes;
  struct sched_param parameters = {.sched_priority = 80};
  bool good = pthread_attr_init(&attributes) == 0;
  if (!good) {
    return false;
  }
  (void)pthread_attr_setinheritsched(&attributes, PTHREAD_EXPLICIT_SCHED);
  (void)pthread_attr_setschedpolicy(&attributes, SCHED_FIFO);
  (void)pthread_attr_setschedparam(&attributes, &parameters);
  *out_fifo = pthread_create(&thread, &attributes, lateness_measure, late) == 0;
  good = *out_fifo || pthread_create(&thread, NULL, lateness_measure, late) == 0;
  (void)pthread_attr_destroy(&attributes);
  return good && pthread_join(thread, NULL) == 0;
}

void doctor_check_latency(const doctor_place *place, doctor_check *check)
{
  static lateness late;
  bool fifo = false;
  (void)place;
  if (!lateness_run(&late, &fifo)) {
    doctor_say(check, DOCTOR_PROBLEM, "no thread can be started");
    return;
  }
  qsort(late.us, SLEEPS, sizeof late.us[0], lateness_compare);
  check->measured = true;
  check->p50_us = late.us[SLEEPS / 2];
  check->p999_us = late.us[SLEEPS - 1 - SLEEPS / 1000];
  doctor_state state = check->p999_us < P999_GOOD_US ? DOCTOR_OK : DOCTOR_WARNING;
  doctor_say(check, state, "sleeps of 1 ms end late by %.0f us (half of them), %.0f us (p99.9), %s",
             check->p50_us, check->p999_us, fifo ? "SCHED_FIFO" : "without SCHED_FIFO");
  if (state != DOCTOR_OK) {
    doctor_todo(check, "close other programs, then see docs/realtime.md");
  }
}

void doctor_check_ode(const doctor_place *place, doctor_check *check)
{
  (void)place;
  if (dCheckConfiguration("ODE_double_precision") == 1) {
    doctor_say(check, DOCTOR_OK, "ODE has double precision");
    return;
  }
  doctor_say(check, DOCTOR_PROBLEM, "the ODE that was loaded has single precision");
  doctor_todo(check, "sudo apt-get install libode8; and no other libode.so.8 in LD_LIBRARY_PATH");
}

void doctor_check_locale(const doctor_place *place, doctor_check *check)
{
  (void)place;
  locale_t numbers = newlocale(LC_NUMERIC_MASK, "", (locale_t)0);
  if (numbers == (locale_t)0) {
    doctor_say(check, DOCTOR_WARNING, "the locale of the environment is not installed");
    doctor_todo(check, "export LC_ALL=C.UTF-8");
    return;
  }
  const char *radix = nl_langinfo_l(RADIXCHAR, numbers);
  if (strcmp(radix, ".") == 0) {
    doctor_say(check, DOCTOR_OK, "decimal point");
  } else {
    doctor_say(check, DOCTOR_WARNING,
               "the decimal sign is \"%.8s\": other programs may misread CSV", radix);
    doctor_todo(check, "export LC_NUMERIC=C.UTF-8");
  }
  freelocale(numbers);
}

void doctor_check_governor(const doctor_place *place, doctor_check *check)
{
  char path[128];
  char governor[64];
  int slow = 0;
  int known = 0;
  for (int cpu = 0; cpu < 1024; ++cpu) {
    snprintf(path, sizeof path, "/sys/devices/system/cpu/cpu%d/cpufreq/scaling_governor", cpu);
    if (doctor_line(place, path, governor, sizeof governor)) {
      ++known;
      slow += strcmp(governor, "performance") != 0;
    }
  }
  if (slow > 0) {
    doctor_say(check, DOCTOR_WARNING, "%d of %d processors are not set to performance", slow,
               known);
    doctor_todo(check, "sudo cpupower frequency-set -g performance");
  } else {
    doctor_say(check, DOCTOR_OK, known > 0 ? "performance" : "the system does not tell");
  }
}
