/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "remote/wire_codec.h"

#include <string.h>

#include "base/log.h"

/* ---- out ---- */

static hap_status wire_post(void *of, uint32_t channel, uint32_t part, bool reliable,
                            const void *data, uint32_t bytes)
{
  const hapi_codec_out *out = of;
  const hap_link_parcel parcel = {.to = {.channel = channel, .part = part},
                                  .reliable = reliable ? 1 : 0,
                                  .bytes = bytes,
                                  .data = data};
  return out->send(out->of, &parcel);
}

static hap_status wire_send(void *self, void *const messages[2], const hapi_codec_out *out,
                            hap_detail *detail)
{
  hapi_wire_codec *codec = self;
  hapi_codec_out to = *out;
  const hapi_wire_out wire = {&to, wire_post};
  if (codec->server != NULL) {
    return hapi_wire_server_send(codec->server, messages[0], messages[1], &wire, detail);
  }
  return codec->client != NULL ? hapi_wire_client_send(codec->client, messages[0], &wire, detail)
                               : hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for a codec");
}

/* ---- in ---- */

static hap_status wire_take(void *self, const hap_link_event *event, hap_detail *detail)
{
  hapi_wire_codec *codec = self;
  if (codec->server != NULL) {
    return hapi_wire_server_take(codec->server, event->channel, event->data, event->bytes, detail);
  }
  return codec->client != NULL ? hapi_wire_client_take(codec->client, event->channel, event->data,
                                                       event->bytes, detail)
                               : hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for a codec");
}

static bool wire_give(void *self, void *const messages[2])
{
  hapi_wire_codec *codec = self;
  if (codec->server != NULL) {
    return hapi_wire_server_state(codec->server, messages[0]);
  }
  return codec->client != NULL && hapi_wire_client_world(codec->client, messages[0], messages[1]);
}

/* ---- life ---- */

hap_status hapi_wire_codec_open(hapi_wire_codec *codec)
{
  return codec->world ? hapi_wire_server_create(&codec->capacity, &codec->server)
                      : hapi_wire_client_create(&codec->capacity, &codec->client);
}

static void wire_close(hapi_wire_codec *codec)
{
  hapi_wire_server_destroy(codec->server);
  hapi_wire_client_destroy(codec->client);
  codec->server = NULL;
  codec->client = NULL;
}

/* Without memory for it all messages fail until there is some for the next peer. */
static void wire_reset(void *self)
{
  hapi_wire_codec *codec = self;
  wire_close(codec);
  if (hapi_wire_codec_open(codec) < HAP_OK) {
    hapi_log(HAP_LOG_ERROR, "no memory for a codec: the peer that joins gets nothing");
  }
}

void hapi_wire_codec_prepare(hapi_wire_codec *codec, const hapi_capacity *capacity, bool world,
                             hapi_codec *out)
{
  *codec = (hapi_wire_codec){.capacity = *capacity, .world = world};
  *out = (hapi_codec){codec, wire_send, wire_take, wire_give, wire_reset};
}

hap_status hapi_wire_codec_init(hapi_wire_codec *codec, const hapi_capacity *capacity, bool world,
                                hapi_codec *out)
{
  hapi_wire_codec_prepare(codec, capacity, world, out);
  return hapi_wire_codec_open(codec);
}

void hapi_wire_codec_finish(hapi_wire_codec *codec)
{
  wire_close(codec);
}
