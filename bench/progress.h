/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_PROGRESS_H
#define HAPODE_BENCH_PROGRESS_H

/* How far a long program is: one line of stderr, where that is a terminal, and nothing elsewhere.
 * The terminal is one for the process, and so is the line. */

#include <stddef.h>

/* what: of which there are count, such as "rows". cost: of all that is to be done now, in any unit;
 * the time that is left follows from it. */
void progress_begin(const char *program, const char *what, size_t count, double cost);

/* So many more are finished, and what they cost. */
void progress_add(size_t count, double cost);

/* Writes the line anew; progress_hide takes it away before something else is written. */
void progress_show(void);
void progress_hide(void);

/* All is done, or has failed: the line goes. */
void progress_end(void);

#endif
