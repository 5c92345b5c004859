/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_THREAD_H
#define HAPODE_BASE_THREAD_H

#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <hapode/status.h>

#define HAPI_THREAD_PRIORITY_MOST 99 /* of SCHED_FIFO */

typedef struct hapi_thread {
  pthread_t handle;
  bool running;
  _Atomic bool realtime;    /* has the priority it asked for */
  _Atomic bool ended;       /* hapi_thread_end was called */
  _Atomic uintptr_t claims; /* who runs, after hapi_thread_claim; 0: nobody */
} hapi_thread;

/* Starts main(arg). priority 1..99 asks for SCHED_FIFO and goes on without it when that is not
 * allowed. name: at most 15 characters are shown. HAP_ERROR_SYSTEM: errno says why. */
hap_status hapi_thread_start(hapi_thread *thread, void *(*main)(void *), void *arg,
                             const char *name, int priority);
void hapi_thread_join(hapi_thread *thread); /* idempotent */
/* For threads that may not come back, and that call hapi_thread_end last. False: it has not ended
 * within that time and goes on; all that it uses must stay. */
bool hapi_thread_join_within(hapi_thread *thread, double seconds);
void hapi_thread_end(hapi_thread *thread); /* [the thread] it uses nothing any more */

/* [the thread] From now on, until it is joined, what belongs to it is its own; for asserts. */
void hapi_thread_claim(hapi_thread *thread);
/* Whether the calling thread may do what belongs to the thread: also anyone while it does not run.
 * */
bool hapi_thread_is_mine(const hapi_thread *thread);

/* The calling thread: wakes up without the timer slack of ordinary threads, and has its stack
 * touched down to 64 KiB. */
void hapi_thread_prepare_for_ticks(void);

/* What decays, such as a damped velocity, ends in denormal numbers, which x86 multiplies a hundred
 * times slower. Between flush and restore the calling thread takes them for zero, as operands and
 * as results; flush gives back what restore needs. About what is computed and not about who
 * computes: so lockstep, in the application's thread, has the same bits as the threads. Other
 * processors are left as they are. */
unsigned hapi_denormals_flush(void);
void hapi_denormals_restore(unsigned before);

/* Keeps the block in memory; false when not allowed. */
bool hapi_memory_lock(void *memory, size_t size);
void hapi_memory_unlock(void *memory, size_t size);

#endif
