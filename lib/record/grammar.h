/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_RECORD_GRAMMAR_H
#define HAPODE_RECORD_GRAMMAR_H

/* Which cells may follow which. What a cell says may be anything that a session could have met: a
 * device may have given numbers that are none. */

#include <stdbool.h>

#include "record/cell.h"

typedef struct hapi_grammar {
  bool begun[HAPI_STREAMS];
  uint64_t cells[HAPI_STREAMS];
  uint32_t left;                   /* haptic: cells that the packet lacks */
  bool judged[HAPI_STREAMS];       /* a VERDICTS is the next one */
  uint32_t verdicts[HAPI_STREAMS]; /* VERDICT cells that are to follow */
  uint64_t ticks;
  uint64_t window;
  int64_t start_ns; /* tick 0 */
  int64_t first_ns;
  int64_t last_ns;
  bool cycling; /* physics: a CYCLE without its CYCLED */
  uint64_t state;
  uint64_t model;
  uint64_t pass;
  uint64_t poses;
  uint64_t near;
  uint64_t edits;    /* posted ones and locks */
  uint32_t pointers; /* places that they had */
} hapi_grammar;

/* NULL: it may stand here. Otherwise what is wrong with it. */
const char *hapi_grammar_take(hapi_grammar *grammar, hapi_stream stream, const hapi_cell *cell);

#endif
