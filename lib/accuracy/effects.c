/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "accuracy/effects.h"

#include <string.h>

#include "base/effect_table.h"
#include "base/vec.h"

/* What the effects of the newest model came to, and why: counted from the model itself, as it
 * goes to the loop. */

/* A look at a model. */
typedef struct sight {
  hapi_effect_figures *figures; /* HAP_EFFECTS */
  const hapi_cycle *cycle;
  const hapi_body_table *bodies;
  const hapi_nearby *near;
  const hapi_answers *answers;
} sight;

static hapi_effect_figures *sight_figures(const sight *s, hap_effect effect)
{
  return &s->figures[effect];
}

static bool model_is_far(const hapi_model *model)
{
  return model->body_count == 0 && model->touches == 0;
}

static void effect_sum_up(const sight *s, hap_effect effect, hap_effect_reason none)
{
  hapi_effect_sum_up(sight_figures(s, effect), hapi_wish(s->cycle->wishes, effect), none);
}

/* ---- of bodies ---- */

/* Why a body that could turn gyroscopically does not; CALLED: it does. */
static hap_effect_reason body_gyro(const sight *s, const hapi_model_body *in)
{
  dBodyID body = s->bodies->entries[s->near->slots.bodies[in->slot].known].body;
  if (dBodyGetGyroscopicMode(body) == 0) {
    return HAP_REASON_NOT_IN_WORLD;
  }
  if (hapi_wish_is_on(s->cycle->wishes, HAP_EFFECT_GYRO)) {
    return HAP_REASON_CALLED;
  }
  return in->max_angular_speed == 0.0                         ? HAP_REASON_LOCKED
         : hapi_turns_alike(in->inertia)                      ? HAP_REASON_SYMMETRIC
         : (in->flags & HAPI_BODY_RESTING) != 0               ? HAP_REASON_ASLEEP
         : hapi_v3_norm(in->twist.angular) <= HAPI_SPIN_LEAST ? HAP_REASON_STILL
                                                              : HAP_REASON_CALLED;
}

static void note_bodies(const sight *s, hapi_model *model)
{
  const hapi_model_body *bodies = hapi_model_bodies(model);
  bool gyro_off = hapi_wish_is_off(s->cycle->wishes, HAP_EFFECT_GYRO);
  for (uint32_t i = 0; i < model->body_count; ++i) {
    uint32_t flags = bodies[i].flags;
    uint32_t known = s->near->slots.bodies[bodies[i].slot].known;
    bool owned = (flags & HAPI_BODY_OWNED) != 0;
    if (owned) {
      hap_effect_reason why = body_gyro(s, &bodies[i]);
      hapi_effect_note(sight_figures(s, HAP_EFFECT_GYRO), why == HAP_REASON_CALLED && !gyro_off,
                       why);
    }
    if ((flags & (HAPI_BODY_DRIVEN | HAPI_BODY_OWNED | HAPI_BODY_MEASURED)) == HAPI_BODY_DRIVEN) {
      continue;
    }
    /* Bodies that the loop moves without owning them are what testing simulations are for. */
    hapi_effect_note(sight_figures(s, HAP_EFFECT_TESTING), (flags & HAPI_BODY_MEASURED) != 0,
                     owned ? HAP_REASON_OWNED : HAP_REASON_OUTSIDE);
    if (!hapi_nearby_chose(s->near, known, s->cycle->model_number)) {
      hapi_effect_note(sight_figures(s, HAP_EFFECT_RANGE), owned, HAP_REASON_OUTSIDE);
    }
    /* Whether there is anything for it to touch. */
    hapi_effect_note(sight_figures(s, HAP_EFFECT_CONTACTS), owned && (flags & HAPI_BODY_ALONE) == 0,
                     owned ? HAP_REASON_ALONE : HAP_REASON_OUTSIDE);
  }
}

/* ---- of contacts and joints ---- */

static void note_touches(const sight *s, hapi_model *model)
{
  const hapi_model_contact *contacts = hapi_model_contacts(model);
  bool asked = hapi_wish_is_on(s->cycle->wishes, HAP_EFFECT_FRICTION);
  for (uint32_t i = 0; i < model->contact_count; ++i) {
    const hapi_contact_slot *slot = &s->near->slots.contacts[contacts[i].slot];
    hapi_effect_note(sight_figures(s, HAP_EFFECT_FRICTION), contacts[i].mu > 0.0 || asked,
                     HAP_REASON_NO_FRICTION);
    if (model->model == HAP_MODEL_CONTACT && contacts[i].tool == 0) {
      hapi_effect_note(sight_figures(s, HAP_EFFECT_SHAPE), contacts[i].has_shape != 0,
                       slot->shape_reason);
    }
  }
}

/* The pairs whose bodies all sleep are looked at once, as nothing moves. */
static void note_passes(const sight *s, const hapi_model *model)
{
  hapi_effect_figures *f = sight_figures(s, HAP_EFFECT_PASSES);
  const hapi_near *near = s->near->range.near;
  uint32_t pairs = near->pair_count + near->tool_pair_count;
  hap_effect_wish wish = hapi_wish(s->cycle->wishes, HAP_EFFECT_PASSES);
  bool on = wish == HAP_EFFECT_ON || (wish == HAP_EFFECT_AUTO && pairs > 0);
  f->on = on ? pairs : 0;
  f->of = pairs;
  f->reason = HAP_REASON_ALONE;
  hapi_effect_sum_up(f, wish, model_is_far(model) ? HAP_REASON_FAR : HAP_REASON_ALONE);
}

static void note_joints(const sight *s, hapi_model *model)
{
  hapi_effect_figures *f = sight_figures(s, HAP_EFFECT_JOINTS);
  const hapi_model_body *bodies = hapi_model_bodies(model);
  f->on = f->of = model->joint_count;
  for (uint32_t i = 0; i < model->body_count; ++i) {
    const hapi_known_body *known = &s->bodies->entries[s->near->slots.bodies[bodies[i].slot].known];
    if (known->jointed && (bodies[i].flags & (HAPI_BODY_OWNED | HAPI_BODY_DRIVEN)) == 0) {
      ++f->of; /* tied by joints that the loop does not hold */
      f->reason = HAP_REASON_OUTSIDE;
    }
  }
  effect_sum_up(s, HAP_EFFECT_JOINTS, model_is_far(model) ? HAP_REASON_FAR : HAP_REASON_FREE);
}

/* ---- the models ---- */

static void effect_set(const sight *s, hap_effect effect, hap_effect_state state,
                       hap_effect_reason reason)
{
  hapi_effect_figures *f = sight_figures(s, effect);
  f->on = f->of = 0;
  f->state = (uint32_t)state;
  f->reason = (uint32_t)reason;
}

static void note_model_contact(const sight *s, hapi_model *model)
{
  hap_effect_reason alone = model_is_far(model) ? HAP_REASON_FAR : HAP_REASON_ALONE;
  hap_effect_reason none = model_is_far(model) ? HAP_REASON_FAR : HAP_REASON_OWNED;
  bool tools = s->near->range.near->tool_pair_count > 0; /* hulls, which have points instead */
  note_bodies(s, model);
  const hapi_near_tool_pair *pairs = hapi_near_tool_pairs(s->near->range.near);
  bool asked = hapi_wish_is_on(s->cycle->wishes, HAP_EFFECT_FRICTION);
  for (uint32_t i = 0; i < s->near->range.near->tool_pair_count; ++i) {
    hapi_effect_note(sight_figures(s, HAP_EFFECT_FRICTION), pairs[i].mu > 0.0 || asked,
                     HAP_REASON_NO_FRICTION);
  }
  note_passes(s, model);
  note_joints(s, model);
  hapi_effect_figures *bounces = sight_figures(s, HAP_EFFECT_RESTITUTION);
  bounces->on = bounces->of = model->bounces;
  bool nothing = s->near->range.near->pair_count + model->joint_count == 0;
  effect_sum_up(s, HAP_EFFECT_RESTITUTION,
                model_is_far(model) ? HAP_REASON_FAR
                : nothing           ? HAP_REASON_ALONE
                                    : HAP_REASON_NO_BOUNCE);
  effect_sum_up(s, HAP_EFFECT_TESTING, none);
  effect_sum_up(s, HAP_EFFECT_CONTACTS, alone);
  effect_sum_up(s, HAP_EFFECT_RANGE, alone);
  effect_sum_up(s, HAP_EFFECT_GYRO, alone);
  effect_sum_up(s, HAP_EFFECT_SHAPE, tools ? HAP_REASON_NO_CLOSED_FORM : HAP_REASON_FAR);
}

static void note_model_accelerance(const sight *s, hapi_model *model)
{
  hapi_effect_figures *testing = sight_figures(s, HAP_EFFECT_TESTING);
  hapi_effect_figures *cross = sight_figures(s, HAP_EFFECT_CROSS);
  const hapi_model_body *bodies = hapi_model_bodies(model);
  for (uint32_t i = 0; i < model->body_count; ++i) {
    if ((bodies[i].flags & HAPI_BODY_DRIVEN) == 0) {
      hapi_effect_note(testing, !s->answers->bodies[bodies[i].slot].known_free, HAP_REASON_FREE);
    }
  }
  cross->on = cross->of = model->cross_count;
  effect_sum_up(s, HAP_EFFECT_TESTING, HAP_REASON_FAR);
  if (hapi_wish_is_on(s->cycle->wishes, HAP_EFFECT_CROSS)) {
    effect_sum_up(s, HAP_EFFECT_CROSS, model_is_far(model) ? HAP_REASON_FAR : HAP_REASON_ALONE);
  } else {
    effect_set(s, HAP_EFFECT_CROSS, HAP_EFFECT_IS_OFF, HAP_REASON_NOT_PAPERS);
  }
}

/* What the model cannot have. */
static void note_others(const sight *s)
{
  for (int i = 0; i < HAP_EFFECTS; ++i) {
    unsigned has = hapi_effect_rows[i].has;
    if (has != 0 && (has & HAPI_MODEL_BIT(s->cycle->model)) == 0) {
      effect_set(s, (hap_effect)i, HAP_EFFECT_IS_OFF, HAP_REASON_NOT_IN_MODEL);
    }
  }
}

void hapi_effects_note(hapi_effect_figures out[HAP_EFFECTS], const hapi_cycle *cycle,
                       const hapi_world *world, const hapi_nearby *near,
                       const hapi_answers *answers, hapi_model *model)
{
  const sight s = {out, cycle, &world->bodies, near, answers};
  memset(out, 0, HAP_EFFECTS * sizeof *out);
  note_touches(&s, model);
  if (cycle->model == HAP_MODEL_CONTACT && near->range.number == model->number) {
    note_model_contact(&s, model);
  } else if (cycle->model == HAP_MODEL_ACCELERANCE) {
    note_model_accelerance(&s, model);
  }
  effect_sum_up(&s, HAP_EFFECT_FRICTION, HAP_REASON_FAR);
  note_others(&s);
}
