/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_IMPORT_NOTES_H
#define HAPODE_IMPORT_NOTES_H

/* What a reader of scene files has in common: memory that goes at once, and lines that say what was
 * left out or why a file is refused. */

#include <stdbool.h>
#include <stddef.h>

#include <hapode/attributes.h>
#include <hapode/status.h>

/* Where something stands in a file. */
typedef struct import_place {
  const char *file;
  int line;
} import_place;

typedef struct import_chunk import_chunk;

typedef struct import_work {
  import_chunk *chunks;
  const char *folder;                         /* of the file, without links */
  bool strict;                                /* what would be left out is refused */
  void (*said)(void *user, const char *line); /* may be NULL */
  void *user;
  size_t note_count;
  bool starved;       /* memory was refused: no answer but HAP_ERROR_MEMORY is right */
  hap_status failed;  /* HAP_ERROR_ARGUMENT of a strict note; the reader goes on to its end */
  hap_detail *detail; /* may be NULL */
} import_work;

/* Zeroed; NULL: no memory. Lives until import_work_finish. */
void *import_take(import_work *work, size_t size);
/* A copy of length bytes with a zero behind them. */
char *import_text(import_work *work, const char *text, size_t length);
void import_work_finish(import_work *work);

/* "file:line: text" to said. Of a strict reader it is a refusal as well. */
void import_note(import_work *work, import_place at, const char *format, ...) HAP_PRINTF(3, 4);

/* HAP_ERROR_FORMAT with "file:line: text" as detail. */
hap_status import_refuse(import_work *work, import_place at, const char *format, ...)
    HAP_PRINTF(3, 4);

hap_status import_no_memory(import_work *work);

#endif
