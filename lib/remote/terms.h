/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_REMOTE_TERMS_H
#define HAPODE_REMOTE_TERMS_H

/* What the two ends agree on when a client joins: reliable messages of channel 0. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/status.h>

#include "sync/message.h"
#include "sync/told_body.h"

#define HAPI_TERMS_CHANNEL 0u
#define HAPI_TERMS_BYTES 128u
#define HAPI_TERMS_VERSION 1u /* of these and of all other messages */
#define HAPI_REFUSAL_BYTES_MOST 272u

/* What a hand's devices can do. */
typedef struct hapi_limits {
  double force; /* N, world */
  double speed; /* m/s, world */
} hapi_limits;

typedef struct hapi_terms {
  double look_ahead_s; /* by which physics looks ahead, and a model may be late */
  double period_s;     /* H of physics */
  double haptic_hz;    /* of the loop: joints and damping are converted to its ticks */
  hapi_capacity capacity;
  hapi_limits limits;     /* of a client; of a world those that it allows */
  bool draws;             /* a client: it wants to know where all bodies are */
  hapi_scene_print scene; /* of the session's own world */
} hapi_terms;

void hapi_terms_write(const hapi_terms *terms, unsigned char out[HAPI_TERMS_BYTES]);
/* HAP_ERROR_FORMAT: no such message. HAP_ERROR_UNSUPPORTED: of another version. */
hap_status hapi_terms_read(const void *data, uint32_t bytes, hapi_terms *out, hap_detail *detail);
/* Whether a loop of these terms can have a world of those. HAP_ERROR_ARGUMENT. */
hap_status hapi_terms_compare(const hapi_terms *loop, const hapi_terms *world, hap_detail *detail);

/* A server tells a client why it does not take it: the text, cut where it is too long. The bytes
 * written. */
uint32_t hapi_refusal_write(const char *text, unsigned char out[HAPI_REFUSAL_BYTES_MOST]);
/* False: it is no refusal. */
bool hapi_refusal_read(const void *data, uint32_t bytes, hap_detail *out);

#endif
