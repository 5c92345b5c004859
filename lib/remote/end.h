/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_REMOTE_END_H
#define HAPODE_REMOTE_END_H

/* What both ends of a session over a network have in common: a link, a codec for the peer, what
 * went wrong. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/link.h>

#include "remote/codec.h"
#include "remote/scenery.h"
#include "remote/stamps.h"
#include "remote/terms.h"

typedef struct hapi_end {
  hap_link *link;   /* borrowed */
  hapi_codec codec; /* likewise */
  bool joined;      /* the peer is there */
  uint32_t peer;
  int64_t now_ns;    /* of what is going on */
  uint64_t refused;  /* messages that were not understood, or came from somebody else */
  uint64_t failed;   /* messages that the transport did not take */
  hap_detail detail; /* of the newest of both */
} hapi_end;

/* What an end makes of an event that is no matter of the codec: the peer has joined or left, or a
 * message of a channel of terms.h, stamps.h or scenery.h has come. */
typedef void (*hapi_end_hear)(void *of, const hap_link_event *event);

/* Takes what has come in: the peer's messages to the codec, other events to hear. The rest waits
 * for the next call when a peer has left, and when there is very much. */
void hapi_end_poll(hapi_end *end, hapi_end_hear hear, void *of);
/* Encodes and sends, where there is a peer. */
void hapi_end_send(hapi_end *end, void *const messages[2]);
void hapi_end_send_terms(hapi_end *end, const hapi_terms *terms);
void hapi_end_send_stamps(hapi_end *end, const unsigned char *data, uint32_t bytes);
/* hapi_scenery_out.send; of: the end. */
bool hapi_end_send_scenery(void *of, uint32_t part, bool reliable, const void *data,
                           uint32_t bytes);
/* Tells a peer, of whom nothing is taken, why. */
void hapi_end_send_refusal(hapi_end *end, uint32_t peer, const char *text);
/* Counts what hear has not understood. */
void hapi_end_refuse(hapi_end *end, const hap_detail *why);

#endif
