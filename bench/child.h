/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_CHILD_H
#define HAPODE_BENCH_CHILD_H

/* A program of this build, run as a child in its own process: it ends with the caller. */

#include <stdbool.h>
#include <stdio.h>
#include <sys/types.h>

typedef struct bench_child {
  pid_t pid;  /* <= 0: none */
  int input;  /* its stdin; -1: none */
  FILE *said; /* its stdout; NULL: none */
} bench_child;

/* Starts the program of that name beside this one. words: what follows its name, NULL at the end.
 */
bool bench_child_start(const char *name, const char *const words[], bench_child *out);

/* Ends it, if it has not ended, and waits for it. True: it ended by itself with exit 0. A zeroed
 * child and one that was finished are accepted. */
bool bench_child_finish(bench_child *child, int signal);

#endif
