/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PHYSICS_PUBLISH_H
#define HAPODE_PHYSICS_PUBLISH_H

/* The local model: what the loop is told after a step. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/session.h>

#include "physics/account.h"
#include "probe/probe.h"

/* What a model is made of. */
typedef struct hapi_publishing {
  const hapi_cycle *cycle;
  const hapi_world *world;
  const hapi_slots *slots;
  const hapi_answers *answers;
  hapi_account *account;
} hapi_publishing;

/* Bodies whose positions are traced: body table entries. */
typedef struct hapi_watch {
  uint32_t bodies[HAP_TRACE_BODIES_MAX]; /* HAPI_NONE: it is gone */
  uint32_t count;
} hapi_watch;

/* publish_joints.c: entries of the joint table, which have slots */
void hapi_publish_joints(const hapi_publishing *p, const uint32_t *joints, uint32_t count,
                         hapi_model *out);

/* publish.c */
void hapi_publish_bodies(const hapi_publishing *p, hapi_model *out);
void hapi_publish_contacts(const hapi_publishing *p, hapi_model *out);
void hapi_publish_watch(const hapi_watch *watch, const hapi_body_table *table, hapi_model *out);

#endif
