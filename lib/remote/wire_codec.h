/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_REMOTE_WIRE_CODEC_H
#define HAPODE_REMOTE_WIRE_CODEC_H

/* lib/wire as the codec of an end. */

#include "remote/codec.h"
#include "sync/message.h"
#include "wire/wire.h"

typedef struct hapi_wire_codec {
  hapi_capacity capacity;
  bool world;               /* of the world's end */
  hapi_wire_server *server; /* of the world's end; else NULL */
  hapi_wire_client *client; /* of the loop's end; else NULL */
} hapi_wire_codec;

/* world: of the world's end. *out is *codec, which outlives it. HAP_ERROR_MEMORY. */
hap_status hapi_wire_codec_init(hapi_wire_codec *codec, const hapi_capacity *capacity, bool world,
                                hapi_codec *out);
/* The same in two: until it is opened, or reset for a peer, it takes and sends nothing. */
void hapi_wire_codec_prepare(hapi_wire_codec *codec, const hapi_capacity *capacity, bool world,
                             hapi_codec *out);
hap_status hapi_wire_codec_open(hapi_wire_codec *codec); /* HAP_ERROR_MEMORY */
void hapi_wire_codec_finish(hapi_wire_codec *codec);     /* zeroed allowed */

#endif
