/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_CONTACT_KEPT_H
#define HAPODE_CONTACT_KEPT_H

/* What passes have found between two geoms, for as long as it holds: most pairs hardly move against
 * each other, and most of what is near does not touch. */

#include <stdbool.h>
#include <stdint.h>

#include "contact/places.h"

/* How far two bodies may go against each other, in parts of the smaller one's extent and in all,
 * until what was found between them is found anew.
 *
 * A contact is fixed in the frames of its two bodies. A tick places it where the bodies are, gap
 * and normal right to first order, as between two passes. What goes stale is where the border of a
 * face cuts the other face. Of a corner that has left the face, or come over it, the lever is wrong
 * by as much as the bodies have gone, and where an edge runs along the border by up to five times
 * as much (LEAST_SINE in patch_add.c). A cube's lever is half an edge, 0.58 of its extent: 5e-5 of
 * the extent is 1e-4 of the lever, 5e-4 at worst. Errors do not add up, as the way counts from
 * where the contacts were found. Gaps are wrong by way^2 / lever, less than a nanometre. Ten times
 * as much would be as good for the levers, but in a dense pile that slips, other bricks would
 * stick. */
#define HAPI_KEPT_SHARE 5e-5
#define HAPI_KEPT_WAY 2e-6 /* m */

/* Some contacts tell a direction in world axes, for its sign: until the bodies have turned by this
 * much. Of the difference of two quaternions. */
#define HAPI_KEPT_TURN 0.05

/* The pairs of one key, in the order of the near message. */
typedef struct hapi_kept_pair {
  uint64_t key;
  uint64_t stamp; /* of all geoms */
  uint32_t first; /* pair of the message */
  uint32_t pairs;
  uint32_t geoms[2]; /* of the first pair */
  double extents[2]; /* m, largest of its geoms */
  bool valid;        /* what follows holds */
  bool by_world;     /* a contact says something in world axes */
  uint32_t count;    /* contacts */
  uint32_t contacts; /* the first one, others follow by hapi_kept.next */
  double gap;        /* m, of the deepest contact */
  double margin;     /* m, within which they were looked for */
  double clear;      /* m, without contacts: the geoms are not nearer than this; 0: not known */
  hap_pose apart;    /* of one body in the frame of the other, as it was found */
  double quat[4];    /* of one body, likewise */
  uint64_t stays[2]; /* of the bodies, when `moved` was measured */
  double moved;      /* m, of any point of the smaller one, as the other sees it */
} hapi_kept_pair;

/* Where an application is asked about contacts: the points of both surfaces in the frames of their
 * bodies, the normal in the frame of the second one. */
typedef struct hapi_kept_ends {
  double a[3];
  double b[3];
  double normal[3];
} hapi_kept_ends;

typedef struct hapi_kept {
  hapi_kept_pair *pairs; /* of the near message */
  hapi_kept_pair *older; /* scratch: of the message before */
  uint32_t count;
  hapi_patch_contact *contacts;
  hapi_kept_ends *ends; /* by contact */
  uint32_t *next;       /* by contact */
  uint32_t contact_capacity;
  uint32_t free;   /* the first contact that is not in use */
  uint32_t *table; /* of pairs of the message before, by key: number + 1; 0: free */
  uint32_t places; /* of the table; 0: not filled */
} hapi_kept;

/* asks: the application is asked about contacts. False: no memory; finish is due all the same. */
bool hapi_kept_create(hapi_kept *kept, const hapi_capacity *capacity, bool asks);
void hapi_kept_finish(hapi_kept *kept); /* also of a zeroed one */
void hapi_kept_begin(hapi_kept *kept);  /* forgets all */

/* After hapi_places_take_near: pairs of the new message keep what was found of them. */
void hapi_kept_take_near(hapi_kept *kept, const hapi_places *places);

/* Whether what was found still holds, with these bodies (NULL: static world), where contacts count
 * within the margin [m]. */
bool hapi_kept_holds(hapi_kept_pair *pair, const hapi_pass_body *a, const hapi_pass_body *b,
                     double margin);

/* Of contacts that were just found anew, in `io`: those that are one that is kept become that one,
 * with its number; others have number 0. out_order: their indices, each kept one in its place. */
void hapi_kept_go_on(const hapi_kept *kept, const hapi_kept_pair *pair, hapi_patch_contact *io,
                     uint32_t count, uint32_t *out_order);

/* Begins anew with no contacts. */
void hapi_kept_find(hapi_kept *kept, hapi_kept_pair *pair, const hapi_pass_body *a,
                    const hapi_pass_body *b, double margin);
/* One more; ends may be NULL. Without room for all of them nothing is kept of the pair. */
void hapi_kept_add(hapi_kept *kept, hapi_kept_pair *pair, const hapi_patch_contact *contact,
                   const hapi_kept_ends *ends);

#endif
