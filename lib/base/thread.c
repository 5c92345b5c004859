/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/thread.h"

#include <errno.h>
#include <sched.h>
#include <string.h>
#include <sys/mman.h>
#if defined(__linux__)
#include <sys/prctl.h>
#endif
#if defined(__SSE2__)
#include <xmmintrin.h>
#endif

#include "base/assert.h"
#include "base/clock.h"

#define STACK_TOUCHED 65536
#define JOIN_LOOK_NS 200000

static int thread_create(hapi_thread *thread, void *(*entry)(void *), void *arg, int priority)
{
  pthread_attr_t attributes;
  int failed = pthread_attr_init(&attributes);
  if (failed != 0) {
    return failed;
  }
  if (priority > 0) {
    struct sched_param parameters;
    memset(&parameters, 0, sizeof parameters);
    parameters.sched_priority = priority;
    pthread_attr_setinheritsched(&attributes, PTHREAD_EXPLICIT_SCHED);
    pthread_attr_setschedpolicy(&attributes, SCHED_FIFO);
    pthread_attr_setschedparam(&attributes, &parameters);
  }
  failed = pthread_create(&thread->handle, &attributes, entry, arg);
  pthread_attr_destroy(&attributes);
  return failed;
}

hap_status hapi_thread_start(hapi_thread *thread, void *(*main)(void *), void *arg,
                             const char *name, int priority)
{
  HAPI_ASSERT(!thread->running && priority >= 0 && priority <= HAPI_THREAD_PRIORITY_MOST);
  atomic_store(&thread->ended, false);
  bool realtime = priority > 0 && thread_create(thread, main, arg, priority) == 0;
  atomic_store(&thread->realtime, realtime);
  int failed = realtime ? 0 : thread_create(thread, main, arg, 0);
  if (failed != 0) {
    errno = failed;
    return HAP_ERROR_SYSTEM;
  }
  thread->running = true;
  char shown[16];
  strncpy(shown, name, sizeof shown - 1);
  shown[sizeof shown - 1] = '\0';
  pthread_setname_np(thread->handle, shown);
  return HAP_OK;
}

void hapi_thread_join(hapi_thread *thread)
{
  if (thread->running) {
    pthread_join(thread->handle, NULL);
    thread->running = false;
    atomic_store(&thread->claims, 0);
  }
}

bool hapi_thread_join_within(hapi_thread *thread, double seconds)
{
  int64_t end = hapi_clock_now() + (int64_t)(1e9 * seconds);
  while (thread->running && !atomic_load(&thread->ended)) {
    if (hapi_clock_now() >= end) {
      return false;
    }
    hapi_clock_sleep_until(hapi_clock_now() + JOIN_LOOK_NS);
  }
  hapi_thread_join(thread);
  return true;
}

void hapi_thread_end(hapi_thread *thread)
{
  atomic_store(&thread->ended, true);
}

static uintptr_t own_mark(void)
{
  static _Thread_local char mark;
  return (uintptr_t)&mark;
}

void hapi_thread_claim(hapi_thread *thread)
{
  atomic_store(&thread->claims, own_mark());
}

bool hapi_thread_is_mine(const hapi_thread *thread)
{
  uintptr_t owner = atomic_load(&thread->claims);
  return owner == 0 || owner == own_mark();
}

void hapi_thread_prepare_for_ticks(void)
{
#if defined(__linux__)
  prctl(PR_SET_TIMERSLACK, 1UL, 0UL, 0UL, 0UL);
#endif
  volatile char deep[STACK_TOUCHED];
  for (size_t i = 0; i < sizeof deep; i += 1024) {
    deep[i] = 0;
  }
}

#if defined(__SSE2__)

#define FLUSH_TO_ZERO 0x8000u
#define DENORMALS_ARE_ZERO 0x0040u

unsigned hapi_denormals_flush(void)
{
  unsigned before = _mm_getcsr();
  _mm_setcsr(before | FLUSH_TO_ZERO | DENORMALS_ARE_ZERO);
  return before;
}

/* The rounding flags that were raised meanwhile are not the caller's either. */
void hapi_denormals_restore(unsigned before)
{
  _mm_setcsr(before);
}

#else

unsigned hapi_denormals_flush(void)
{
  return 0;
}

void hapi_denormals_restore(unsigned before)
{
  (void)before;
}

#endif

bool hapi_memory_lock(void *memory, size_t size)
{
  return mlock(memory, size) == 0;
}

void hapi_memory_unlock(void *memory, size_t size)
{
  munlock(memory, size);
}
