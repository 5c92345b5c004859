/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "physics/physics_internal.h"

/* Edits that other threads posted, run between two steps in the order of posting. */

hap_status hapi_physics_post(hapi_physics *physics, hap_edit_fn edit, void *arg)
{
  hap_status status = HAP_ERROR_CAPACITY;
  pthread_mutex_lock(&physics->edits_lock);
  if (physics->edits_closed) {
    status = HAP_ERROR_STATE;
  } else if (physics->edit_count < HAPI_EDITS_MAX) {
    uint32_t at = (physics->edit_first + physics->edit_count++) % HAPI_EDITS_MAX;
    physics->edits[at] = (hapi_edit){edit, arg};
    status = HAP_OK;
  }
  pthread_mutex_unlock(&physics->edits_lock);
  return status;
}

static bool take_edit(hapi_physics *physics, hapi_edit *out)
{
  pthread_mutex_lock(&physics->edits_lock);
  bool any = physics->edit_count > 0;
  if (any) {
    *out = physics->edits[physics->edit_first];
    physics->edit_first = (physics->edit_first + 1) % HAPI_EDITS_MAX;
    --physics->edit_count;
  }
  pthread_mutex_unlock(&physics->edits_lock);
  return any;
}

void hapi_edits_run(hapi_physics *physics)
{
  pthread_mutex_lock(&physics->edits_lock);
  uint32_t count = physics->edit_count; /* what an edit posts waits for the next step */
  pthread_mutex_unlock(&physics->edits_lock);
  hapi_edit edit;
  physics->editable = true;
  for (uint32_t i = 0; i < count && take_edit(physics, &edit); ++i) {
    edit.run(edit.arg);
    ++physics->figures.stats.edits_run;
  }
  physics->editable = false;
}

void hapi_physics_close(hapi_physics *physics)
{
  pthread_mutex_lock(&physics->edits_lock);
  physics->edits_closed = true;
  pthread_mutex_unlock(&physics->edits_lock);
  hapi_physics_enter(physics);
  hapi_edits_run(physics); /* all of them: no more can come */
  hapi_physics_leave(physics);
}
