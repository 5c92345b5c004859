/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_CONTACT_MEMORY_H
#define HAPODE_LOCAL_CONTACT_MEMORY_H

/* Contacts between bodies, model CONTACT: the contact thread's newest set, with the impulses of the
 * one before. */

#include <stdalign.h>

#include "base/alloc.h"
#include "local/rows.h"
#include "sync/messages.h"

/* What the rows of a tick leave to the next one. */
enum {
  HAPI_KEPT_NOTHING,
  HAPI_KEPT_IDLE,  /* no contact of the loop's, whatever the gap */
  HAPI_KEPT_APART, /* too far open for rows */
  HAPI_KEPT_ROWS
};

/* Holds while both bodies stay and go no farther against each other, see body_stay.h, and no tick
 * was without rows. */
typedef struct hapi_contact_kept {
  uint64_t stay_a;
  uint64_t stay_b;
  uint32_t body_a; /* slots */
  uint32_t body_b;
  uint32_t first;   /* ROWS: where they stand, and how many */
  uint32_t surface; /* of the patches */
  uint8_t count;
  bool plain;   /* ROWS: their targets are those of a contact that touches, no deeper than the next:
                   they ask for no more while the gap is between 0 and */
  bool by_mass; /* ROWS: see hapi_contact_ready */
  bool slides;  /* ROWS: slope is not 0 */
  bool all;     /* ROWS: one for each part that the surface has, whether the bodies touch or not */
  uint8_t what; /* HAPI_KEPT_ */
  double apart[3];  /* m: how far a had gone from b when this was made, */
  double way2;      /* m^2, and how far from there they may go */
  double gap;       /* m, at the poses where the stays began */
  double normal[3]; /* the normal's row of the Jacobian: a's linear part, b's is opposite; */
  double turn_a[3]; /* and its angular parts: the gap follows without a look at the row */
  double turn_b[3];
  double least;    /* ROWS: m, this */
  double slope[2]; /* ROWS: hapi_touch_spot's along the directions of the frictions */
  double reach_a;  /* APART: m, by which the body's turn moves the contact, or more */
  double reach_b;
} hapi_contact_kept;

/* What is kept of a contact from tick to tick, and from one set of patches to the next. A tick
 * reads its first three cache lines. */
typedef struct hapi_contact_memory {
  alignas(HAPI_CACHE_LINE) double impulse[3]; /* N s: normal, friction 1 and 2 */
  hapi_contact_kept kept;
  uint64_t key;
  uint64_t number;  /* see hapi_patch_contact */
  uint64_t surface; /* hash of it: the message before is not ours any more */
  double core_a[3];
  double held[3]; /* N s, on the first body in a tick, while it is still: see body_still.h */
} hapi_contact_memory;

/* Contacts that a tick passes over as one, see contact_run.h. */
typedef struct hapi_contact_run hapi_contact_run;

#define HAPI_RUN_MOST 16u /* contacts of a run */

typedef struct hapi_body_contacts {
  hapi_patches *patches;           /* NULL: none yet */
  hapi_contact_memory *memory;     /* of its contacts; capacity.contacts */
  hapi_contact_memory *old_memory; /* scratch: of those that are not in their places */
  hapi_contact_run *runs;          /* by the first contact of each; capacity.contacts */
  uint8_t *run_lengths;            /* contacts of each; 0: none begins there */
  uint64_t contents;               /* of the patches */
  uint32_t memory_count;
  uint32_t run;          /* the one that is being made, by its first contact; HAPI_SLOT_NONE */
  uint32_t *buckets;     /* of the matching; bucket_count */
  uint32_t bucket_count; /* power of 2 */
  uint32_t buckets_used; /* likewise; scratch of the matching */
  uint32_t active;       /* that push in this tick */
  uint32_t still_active; /* likewise, of contacts without rows: their islands are still */
  bool adopted;          /* since rows were made: contacts came, went or changed their surface */
  uint64_t rowed_tick;   /* the last one in which rows were made */
} hapi_body_contacts;

/* The set stays in use, and must stay as it is, until the next call. The one before is not looked
 * at. rows: of the last tick; their sources go with the contacts. */
void hapi_body_contacts_adopt(hapi_body_contacts *contacts, hapi_patches *patches,
                              const hapi_rows *rows);

#endif
