/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_WORLD_CLAIM_H
#define HAPODE_WORLD_CLAIM_H

/* One session at most steps a world. Two of them give the world each other's contact joints and
 * undo each other's steps, until ODE aborts the process. The same of a space. The list of what is
 * claimed is shared by all threads and has a lock of its own. */

#include <stdbool.h>

typedef struct hapi_claim {
  const void *thing; /* NULL: nothing is claimed */
  struct hapi_claim *next;
} hapi_claim;

/* False: another claim has the thing, and *claim is unchanged. *claim stays where it is until
 * release. */
bool hapi_claim_take(hapi_claim *claim, const void *thing);
/* A zeroed claim is allowed. */
void hapi_claim_release(hapi_claim *claim);

#endif
