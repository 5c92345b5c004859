/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_EFFECTS_H
#define HAPODE_EFFECTS_H

/* Effects: parts of the simulation that a scene may or may not need (docs/effects.md). */

#include <stddef.h>
#include <stdint.h>

#include <hapode/attributes.h>
#include <hapode/session.h>
#include <hapode/status.h>

HAP_BEGIN_DECLS

/* Each effect is off, on or left to the library. The library then decides at every sync from the
 * bodies and pointers that are near each other. A session begins with the wishes of
 * hap_expert_def.effects_on and effects_off. Values are never renumbered. */
typedef enum hap_effect {
  HAP_EFFECT_TESTING = 0,     /* testing simulations of what the loop does not simulate itself */
  HAP_EFFECT_CROSS = 1,       /* ACCELERANCE: cross accelerance between local bodies; auto: off */
  HAP_EFFECT_CONTACTS = 2,    /* CONTACT: contacts between bodies in the loop */
  HAP_EFFECT_PASSES = 3,      /* CONTACT: contacts found anew between syncs */
  HAP_EFFECT_JOINTS = 4,      /* CONTACT: joints in the loop */
  HAP_EFFECT_RANGE = 5,       /* CONTACT: bodies beyond the neighbours in the loop */
  HAP_EFFECT_RESTITUTION = 6, /* CONTACT: bounce of contacts and of stops in the loop */
  HAP_EFFECT_FRICTION = 7,    /* friction of the pointers */
  HAP_EFFECT_TORQUE = 8,      /* torque on the hand */
  HAP_EFFECT_GYRO = 9,        /* CONTACT: gyroscopic term of the loop's bodies */
  HAP_EFFECT_SHAPE = 10,      /* CONTACT: the shape itself at every tick, not a plane */
  HAP_EFFECT_PROXY = 11,      /* CONTACT: coupling by a proxy, of pointers of HAP_COUPLING_AUTO */
  HAP_EFFECT_OBSERVER = 12,   /* energy observer of the guard */
  HAP_EFFECT_RECORDING = 13   /* hap_session_record */
} hap_effect;

/* How many there are in this version. */
#define HAP_EFFECTS 14

/* The bit of an effect in hap_expert_def. */
#define HAP_EFFECT_BIT(effect) (UINT32_C(1) << (unsigned)(effect))

/* What the application wants. Values are never renumbered. */
typedef enum hap_effect_wish {
  HAP_EFFECT_AUTO = 0, /* where the scene needs it */
  HAP_EFFECT_OFF = 1,  /* left out, whatever the scene needs: for experiments */
  HAP_EFFECT_ON = 2    /* simulated, whatever the scene needs */
} hap_effect_wish;

/* What became of a wish. Values are never renumbered. */
typedef enum hap_effect_state {
  HAP_EFFECT_IS_OFF = 0,   /* for none */
  HAP_EFFECT_IS_ON = 1,    /* for everything that can have it */
  HAP_EFFECT_IS_PARTLY = 2 /* for some: hap_effect_info.on of .of */
} hap_effect_state;

/* Why an effect is in its state. Of an effect that is partly on: why it is off for the rest. Values
 * are never renumbered. */
typedef enum hap_effect_reason {
  HAP_REASON_NOT_YET = 0,       /* no sync so far */
  HAP_REASON_ASKED = 1,         /* the wish is not auto */
  HAP_REASON_CALLED = 2,        /* the scene needs it */
  HAP_REASON_MODEL = 3,         /* this model is made of it */
  HAP_REASON_NOT_IN_MODEL = 4,  /* this model does not have it */
  HAP_REASON_FAR = 5,           /* nothing is near a pointer */
  HAP_REASON_ASLEEP = 6,        /* what is near sleeps */
  HAP_REASON_FREE = 7,          /* in no joint, touched by nothing */
  HAP_REASON_ALONE = 8,         /* nothing else is near enough to be touched before the next sync */
  HAP_REASON_OWNED = 9,         /* the loop simulates all of it itself */
  HAP_REASON_NO_BOUNCE = 10,    /* no surface and no stop that gives back speed */
  HAP_REASON_NO_FRICTION = 11,  /* mu is 0 */
  HAP_REASON_NO_TORQUE = 12,    /* the device gives no torque */
  HAP_REASON_ROUND = 13,        /* a sphere without friction */
  HAP_REASON_SYMMETRIC = 14,    /* the same inertia about every axis */
  HAP_REASON_LOCKED = 15,       /* the body cannot turn */
  HAP_REASON_STILL = 16,        /* it does not spin */
  HAP_REASON_NOT_IN_WORLD = 17, /* ODE's gyroscopic mode is off for it */
  HAP_REASON_FLAT = 18,         /* the plane is the shape */
  HAP_REASON_NO_CLOSED_FORM = 19, /* a plane of a convex geom or a mesh, points of a hull */
  HAP_REASON_WITHIN = 20,         /* the device can hold what it touches */
  HAP_REASON_DEVICE_UNKNOWN = 21, /* the device does not say what it can hold */
  HAP_REASON_COUPLING = 22,       /* the pointer's coupling says it */
  HAP_REASON_MEASURING = 23,      /* HAP_GUARD_MEASURE */
  HAP_REASON_NOT_RECORDED = 24,   /* hap_session_record was not called */
  HAP_REASON_OUTSIDE = 25,        /* the loop cannot simulate it, or has no room for it */
  HAP_REASON_NOT_PAPERS = 26,     /* model ACCELERANCE is the paper's; what is not must be on */
  HAP_REASON_ACCURACY = 27        /* the accuracy asked for or affordable is too low (accuracy.h) */
} hap_effect_reason;

/* What an effect is doing. Times are wall-clock, also in drive LOCKSTEP. It has a size and may grow
 * at its end. */
typedef struct hap_effect_info {
  uint32_t size;   /* bytes filled in */
  uint32_t effect; /* hap_effect */
  uint32_t wish;   /* hap_effect_wish */
  uint32_t state;  /* hap_effect_state, at the last sync */
  uint32_t reason; /* hap_effect_reason */
  uint32_t on;     /* bodies, contacts, joints or pointers that have it */
  uint32_t of;     /* ... of so many that were looked at; 0: it does not count single ones */
  /* us a tick, mean since start over the sampled ones (every 64th). NaN: not known, on a
   * processor without a counter, or where the parts cannot be told apart */
  double tick_us;
  double physics_ms; /* ms a physics step, mean since start; NaN likewise */
  double contact_us; /* us a contact pass, likewise: of CONTACTS and PASSES */
} hap_effect_info;

/* [any] Name as programs spell it ("testing", "gyro"); NULL for an unknown value. */
HAP_API const char *hap_effect_name(hap_effect effect);

/* [any] What it is, a few words; NULL for an unknown value. */
HAP_API const char *hap_effect_text(hap_effect effect);

/* [any] "auto", "off", "on"; NULL for an unknown value. */
HAP_API const char *hap_effect_wish_name(hap_effect_wish wish);

/* [any] The reason in a few words; "" for an unknown value, never NULL. */
HAP_API const char *hap_effect_reason_text(hap_effect_reason reason);

/* [any] Whether a model can fulfil a wish. AUTO always; OFF where the model is not made of the
 * effect; ON where the model has the effect. RECORDING is switched on by hap_session_record alone.
 * detail, may be NULL: what to do. */
HAP_API hap_status hap_effect_check(hap_effect effect, hap_effect_wish wish, hap_model model,
                                    hap_detail *detail);

/* [any] Changes a wish from the next sync on. It stays when the model changes, and counts as
 * AUTO in a model that cannot fulfil it. On an error nothing changes, and hap_session_detail
 * says why. HAP_ERROR_ARGUMENT: no such effect or wish. HAP_ERROR_UNSUPPORTED: hap_effect_check
 * refuses it for the session's model, or OBSERVER is to be on with HAP_GUARD_MEASURE.
 * HAP_ERROR_STATE: the session plays a recording, or RECORDING is to be off while it is
 * recorded. */
HAP_NODISCARD HAP_API hap_status hap_session_set_effect(hap_session *session, hap_effect effect,
                                                        hap_effect_wish wish);

/* [any] The first count effects as of the last sync (HAP_EFFECTS: all). out is an array of elements
 * of size_of_one bytes: sizeof *out of the caller's build. HAP_ERROR_ARGUMENT: a NULL, more than
 * HAP_EFFECTS, or elements without room for their size. */
HAP_API hap_status hap_session_effects(const hap_session *session, hap_effect_info *out,
                                       size_t count, size_t size_of_one);

HAP_END_DECLS

#endif
