/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "physics/edits.h"

#include "base/assert.h"

/* Edits that other threads posted, run between two steps in the order of posting. */

hap_status hapi_edits_post(hapi_edits *edits, hap_edit_fn edit, void *arg)
{
  hap_status status = HAP_ERROR_CAPACITY;
  pthread_mutex_lock(&edits->lock);
  HAPI_ASSERT(edits->first < HAPI_EDITS_MAX && edits->count <= HAPI_EDITS_MAX);
  if (edits->closed) {
    status = HAP_ERROR_STATE;
  } else if (edits->count < HAPI_EDITS_MAX) {
    uint32_t at = (edits->first + edits->count++) % HAPI_EDITS_MAX;
    edits->ring[at] = (hapi_edit){edit, arg};
    status = HAP_OK;
  }
  pthread_mutex_unlock(&edits->lock);
  return status;
}

static bool edit_take(hapi_edits *edits, hapi_edit *out)
{
  pthread_mutex_lock(&edits->lock);
  bool any = edits->count > 0;
  if (any) {
    *out = edits->ring[edits->first];
    edits->first = (edits->first + 1) % HAPI_EDITS_MAX;
    --edits->count;
  }
  pthread_mutex_unlock(&edits->lock);
  return any;
}

uint32_t hapi_edits_waiting(hapi_edits *edits)
{
  pthread_mutex_lock(&edits->lock);
  uint32_t count = edits->count;
  pthread_mutex_unlock(&edits->lock);
  return count;
}

void hapi_edits_run(hapi_edits *edits, uint32_t count)
{
  hapi_edit edit;
  for (uint32_t i = 0; i < count && edit_take(edits, &edit); ++i) {
    edit.run(edit.arg);
    ++edits->run;
  }
}

void hapi_edits_close(hapi_edits *edits)
{
  pthread_mutex_lock(&edits->lock);
  edits->closed = true;
  pthread_mutex_unlock(&edits->lock);
}
