/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "world/claim.h"

#include <pthread.h>
#include <stddef.h>

static pthread_mutex_t claims_lock = PTHREAD_MUTEX_INITIALIZER;
static hapi_claim *claims;

bool hapi_claim_take(hapi_claim *claim, const void *thing)
{
  pthread_mutex_lock(&claims_lock);
  const hapi_claim *other = claims;
  while (other != NULL && other->thing != thing) {
    other = other->next;
  }
  if (other == NULL) {
    claim->thing = thing;
    claim->next = claims;
    claims = claim;
  }
  pthread_mutex_unlock(&claims_lock);
  return other == NULL;
}

void hapi_claim_release(hapi_claim *claim)
{
  if (claim->thing == NULL) {
    return;
  }
  pthread_mutex_lock(&claims_lock);
  hapi_claim **link = &claims;
  while (*link != claim) {
    link = &(*link)->next;
  }
  *link = claim->next;
  claim->thing = NULL;
  pthread_mutex_unlock(&claims_lock);
}
