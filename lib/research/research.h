/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_RESEARCH_RESEARCH_H
#define HAPODE_RESEARCH_RESEARCH_H

/* What only comparisons use. */

#include "research/cross.h"
#include "research/range_error.h"

typedef struct hapi_research {
  hapi_cross cross;
  hapi_range_error range;
} hapi_research;

#endif
