/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_CONTACT_MEMORY_H
#define HAPODE_LOCAL_CONTACT_MEMORY_H

/* Contacts between bodies, model CONTACT: the contact thread's newest set, with the impulses of the
 * one before. */

#include "sync/messages.h"

/* What is kept of a contact from tick to tick, and from one set of patches to the next. */
typedef struct hapi_contact_memory {
  uint64_t key;
  double core_a[3];
  double impulse[3]; /* N s: normal, friction 1 and 2 */
} hapi_contact_memory;

typedef struct hapi_body_contacts {
  hapi_patches *patches;       /* NULL: none yet */
  hapi_contact_memory *memory; /* of its contacts; capacity.contacts */
  hapi_contact_memory *old_memory;
  uint32_t memory_count;
  uint32_t *buckets;     /* of the matching; bucket_count */
  uint32_t bucket_count; /* power of 2 */
  uint32_t buckets_used; /* likewise; scratch of the matching */
  uint32_t active;       /* that push in this tick */
} hapi_body_contacts;

/* The set stays in use, and must stay as it is, until the next call. */
void hapi_body_contacts_adopt(hapi_body_contacts *contacts, hapi_patches *patches);

#endif
