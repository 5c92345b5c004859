/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_NEAR_NEAR_H
#define HAPODE_NEAR_NEAR_H

/* What is near the pointers, and which number (slot) each body and contact has in the loop. */

#include "near/meshes.h"
#include "near/neighbors.h"
#include "near/range.h"
#include "near/shapes.h"
#include "near/slots.h"
#include "near/tools.h"

typedef struct hapi_nearby {
  hapi_neighbors neighbors;
  hapi_tool_search tools;
  hapi_slots slots;
  hapi_meshes meshes;
  hapi_range range;
} hapi_nearby;

#endif
