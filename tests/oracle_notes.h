/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_ORACLE_NOTES_H
#define HAPODE_TESTS_ORACLE_NOTES_H

/* The lines that the reader of scene files has said of a file, and whether one of them is the
 * reason of a difference from MuJoCo. */

#include <stdbool.h>
#include <stddef.h>

#define ORACLE_NOTES_MOST 4000

typedef struct oracle_notes {
  char *lines[ORACLE_NOTES_MOST];
  size_t count;
} oracle_notes;

/* As import_work.said; user: oracle_notes. */
void oracle_note_take(void *user, const char *line);
void oracle_notes_free(oracle_notes *notes);

/* what: as scene_oracle.c names it; of: the name of the body, joint or geom. A line that names a
 * body or joint is the reason of differences of that one alone. */
bool oracle_notes_explain(const oracle_notes *notes, const char *what, const char *of);

#endif
