/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "base/assert.h"
#include "base/vec.h"
#include "guard/energy_observer.h"
#include "local/body_adopt.h"
#include "local/tool_adopt.h"
#include "local/touch_adopt.h"
#include "pointer/coupling.h"
#include "tick/tick.h"

#define AGE_MOST_S 0.1 /* over which a body is carried on; and what the session looks ahead */

/* Nothing that is near: nothing can be touched before the next sync, and nothing be given. */
static bool model_observes(const hapi_pointers *pointers, const hapi_model *model)
{
  bool felt = model->contact_count + model->touches > 0;
  for (uint32_t i = 0; i < pointers->high; ++i) {
    const hapi_pointer *p = &pointers->of[i];
    felt = felt || (p->generation != 0 && (hapi_v3_norm(p->guard.written.force) > 0.0 ||
                                           hapi_v3_norm(p->guard.written.torque) > 0.0));
  }
  hap_effect_wish wish = hapi_wish(model->wishes, HAP_EFFECT_OBSERVER);
  return wish == HAP_EFFECT_ON || (wish == HAP_EFFECT_AUTO && felt);
}

static bool may_be_proxy(const hapi_pointer *p, uint32_t wishes)
{
  bool asked = p->coupling.kind == HAP_COUPLING_AUTO && p->coupling.hold_known &&
               !hapi_wish_is_off(wishes, HAP_EFFECT_PROXY);
  return p->generation != 0 &&
         (p->proxied || asked ||
          (p->coupling.kind != HAP_COUPLING_AUTO && p->coupling.kind != HAP_COUPLING_DIRECT));
}

/* Whether torque is felt, and whether some pointer may become a proxy. */
static void pointers_adopt(hapi_pointers *pointers, hapi_model *model)
{
  const hapi_model_contact *contacts = hapi_model_contacts(model);
  hap_effect_wish torque = hapi_wish(model->wishes, HAP_EFFECT_TORQUE);
  bool friction = hapi_wish_is_on(model->wishes, HAP_EFFECT_FRICTION);
  bool proxies = false;
  for (uint32_t i = 0; i < pointers->high; ++i) {
    bool any = false;
    for (uint32_t k = 0; k < model->contact_count && !any; ++k) {
      any = contacts[k].pointer == i && (contacts[k].mu > 0.0 || friction);
    }
    proxies = proxies || may_be_proxy(&pointers->of[i], model->wishes);
    hapi_pointer_feel(&pointers->of[i], torque, any);
  }
  pointers->proxies = proxies;
}

/* How hard the surfaces are that are harder than the pointers. */
static void pointers_note_hardest(const hapi_pointers *pointers, const hapi_touches *touches)
{
  for (uint32_t i = 0; i < pointers->high; ++i) {
    pointers->of[i].surface.hardest = 0.0;
  }
  for (uint32_t i = 0; i < touches->feel_count; ++i) {
    const hapi_model_feel *in = &touches->feels[i].in;
    HAPI_ASSERT_INDEX(in->pointer, pointers->high);
    double *hardest = &pointers->of[in->pointer].surface.hardest;
    *hardest = hapi_max(*hardest, in->feel.stiffness);
  }
}

void hapi_tick_adopt(hapi_tick *tick, hapi_model *model, int64_t now_ns)
{
  hapi_tick_facts *facts = &tick->facts;
  hapi_solver *solver = &tick->rows.solver;
  hapi_tick_watch *watch = &tick->watch;
  double age_s = 1e-9 * (double)(now_ns - model->state_ns);
  double age_most_s = AGE_MOST_S + model->look_ahead_s;
  age_s = age_s > age_most_s ? age_most_s : age_s < -AGE_MOST_S ? -AGE_MOST_S : age_s;
  HAPI_ASSERT(model->body_count <= tick->capacity.bodies);
  HAPI_ASSERT(model->joint_count <= tick->capacity.joints);
  HAPI_ASSERT(model->cross_count <= tick->capacity.crosses);
  HAPI_ASSERT(model->triangle_count <= tick->capacity.triangles);
  HAPI_ASSERT(model->feel_count <= tick->capacity.feels);
  HAPI_ASSERT(model->watch_count <= HAP_TRACE_BODIES_MAX);
  hapi_local_bodies_adopt(&tick->bodies, model, now_ns, age_s, facts);
  solver->max_sweeps = model->max_sweeps;
  tick->rows.drift = model->force_drift;
  if (model->row_updates > 0) {
    solver->update_budget = model->row_updates;
  }
  tick->rows.work.most = model->tick_work;
  bool observes = model_observes(&tick->pointers, model);
  if (observes && !facts->observes) {
    hapi_energy_resume(&tick->guard, &tick->pointers, facts->now_ns);
  }
  pointers_adopt(&tick->pointers, model);
  hapi_touches_adopt(&tick->touches, &tick->pointers, &tick->bodies, model);
  hapi_joints_adopt(&tick->joints, model);
  pointers_note_hardest(&tick->pointers, &tick->touches);
  facts->wishes = model->wishes;
  facts->bounces = model->bounces > 0 || hapi_wish_is_on(model->wishes, HAP_EFFECT_RESTITUTION);
  facts->observes = observes;
  facts->model_number = model->number;
  facts->model = model->model;
  facts->impulse_pose = model->impulse_pose;
  facts->blend_s = model->blend_s;
  facts->adopted_ns = now_ns;
  facts->state_ns = model->state_ns;
  facts->sent_ns = model->sent_ns;
  facts->physics_period = model->period_s;
  facts->look_ahead_s = model->look_ahead_s;
  facts->time_scale = model->time_scale;
  watch->count = model->watch_count;
  memcpy(watch->slot, model->watch_slot, sizeof watch->slot);
  memcpy(watch->position, model->watch_position, sizeof watch->position);
}

void hapi_tick_adopt_patches(hapi_tick *tick, hapi_patches *patches)
{
  HAPI_ASSERT(patches->contact_count <= tick->capacity.contacts);
  HAPI_ASSERT(patches->tool_count <= tick->capacity.tool_points);
  hapi_body_contacts_adopt(&tick->contacts, patches, &tick->rows);
  if (tick->facts.model == HAP_MODEL_CONTACT) {
    hapi_tool_adopt_patches(&tick->touches, &tick->pointers, &tick->bodies, patches,
                            tick->facts.wishes);
  }
}
