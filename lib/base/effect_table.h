/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_EFFECT_TABLE_H
#define HAPODE_BASE_EFFECT_TABLE_H

/* The effects: names, and which models can have them. */

#include <stdbool.h>

#include <hapode/effects.h>
#include <hapode/session.h>

#define HAPI_MODEL_BIT(model) (1u << (unsigned)(model))

typedef struct hapi_effect_row {
  const char *name;
  const char *text;
  unsigned has;   /* models that can have it; 0: it is nothing of a model */
  unsigned needs; /* of these, the ones that are made of it */
  bool timed;     /* it has a part of its own in a tick, which can be told from the rest */
} hapi_effect_row;

extern const hapi_effect_row hapi_effect_rows[HAP_EFFECTS];

#endif
