/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_PROGRAM_H
#define HAPODE_TESTS_PROGRAM_H

/* Runs a program of this project as its users do. */

#include <stdbool.h>
#include <sys/types.h>

#include "tests/files.h"

#define PROGRAM_OUTPUT_MAX 60000

/* What the newest run came to. */
typedef struct program_result {
  int code; /* -1: it did not end by itself */
  char out[PROGRAM_OUTPUT_MAX];
  char err[PROGRAM_OUTPUT_MAX];
} program_result;

extern program_result ran;

/* The program whose path is in an environment variable, and a folder for its files. For SET_UP. */
bool program_use(const char *variable);

/* Starts it with arguments that blanks part; what it says goes to files. environment NULL: ours. */
pid_t program_start(const char *arguments, char **environment);
/* The exit code; fills in ran. */
int program_finish(pid_t child);
/* What a program that still runs has said so far, in ran. */
void program_look(void);
/* Starts and finishes. */
int run(const char *format, ...);
/* This test program once more, with that test alone and a variable set, as a process of its own,
 * which may end as it likes: sanitizers then tell no memory and threads that are left. What it
 * says is dropped. The exit code; -1: a signal ended it. */
int program_again(const char *test, const char *variable, const char *value);
/* ran.err holds the text, else a comment says so. */
bool says(const char *text);
/* Of what was said in both ways. */
int said_lines(const char *part);

#endif
