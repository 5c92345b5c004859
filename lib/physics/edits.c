/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "physics/physics_internal.h"

/* Edits that other threads posted, run between two steps in the order of posting. */

hap_status hapi_physics_post(hapi_physics *physics, hap_edit_fn edit, void *arg)
{
  hap_status status = HAP_ERROR_CAPACITY;
  pthread_mutex_lock(&physics->edits.lock);
  if (physics->edits.closed) {
    status = HAP_ERROR_STATE;
  } else if (physics->edits.count < HAPI_EDITS_MAX) {
    uint32_t at = (physics->edits.first + physics->edits.count++) % HAPI_EDITS_MAX;
    physics->edits.ring[at] = (hapi_edit){edit, arg};
    status = HAP_OK;
  }
  pthread_mutex_unlock(&physics->edits.lock);
  return status;
}

static bool take_edit(hapi_physics *physics, hapi_edit *out)
{
  pthread_mutex_lock(&physics->edits.lock);
  bool any = physics->edits.count > 0;
  if (any) {
    *out = physics->edits.ring[physics->edits.first];
    physics->edits.first = (physics->edits.first + 1) % HAPI_EDITS_MAX;
    --physics->edits.count;
  }
  pthread_mutex_unlock(&physics->edits.lock);
  return any;
}

void hapi_edits_run(hapi_physics *physics)
{
  pthread_mutex_lock(&physics->edits.lock);
  uint32_t count = physics->edits.count; /* what an edit posts waits for the next step */
  pthread_mutex_unlock(&physics->edits.lock);
  hapi_edit edit;
  hapi_tape_edits(physics, count);
  physics->lock.editable = true;
  for (uint32_t i = 0; i < count && take_edit(physics, &edit); ++i) {
    edit.run(edit.arg);
    ++physics->counts.own.stats.edits.run;
  }
  physics->lock.editable = false;
}

void hapi_physics_close(hapi_physics *physics)
{
  pthread_mutex_lock(&physics->edits.lock);
  physics->edits.closed = true;
  pthread_mutex_unlock(&physics->edits.lock);
  hapi_physics_enter(physics);
  hapi_edits_run(physics); /* all of them: no more can come */
  hapi_physics_leave(physics);
}
