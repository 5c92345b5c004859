/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_THREAD_COUNTS_H
#define HAPODE_BENCH_THREAD_COUNTS_H

/* What the kernel counts of a thread of this process, read in /proc from outside of the thread. */

#include <stdbool.h>
#include <stdint.h>

typedef struct thread_counts {
  uint64_t minor_faults; /* memory touched for the first time */
  uint64_t major_faults; /* memory fetched from a disk */
  uint64_t voluntary;    /* context switches because the thread waited */
  uint64_t involuntary;  /* because another one was put in its place */
} thread_counts;

/* The thread of that name, at most 15 characters; 0: there is none, or no /proc. */
int thread_find(const char *name);

/* False: the thread has ended, or there is no /proc. */
bool thread_count(int thread, thread_counts *out);

thread_counts thread_counts_since(const thread_counts *now, const thread_counts *before);

#endif
