/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_RAW_CODEC_H
#define HAPODE_TESTS_RAW_CODEC_H

/* A witness for the codec: the memory of a message as it is, zipped and cut into datagrams. A sync
 * is whole when all of its datagrams have come. It knows nothing of what is in a message, and works
 * inside one process alone. */

#include <stdlib.h>
#include <string.h>
#include <zlib.h>

#include "remote/codec.h"
#include "sync/exchange.h"

#define RAW_PIECES 256u
#define RAW_KEPT 32u /* syncs that may be on their way at once */
#define RAW_CHANNEL 2u

typedef struct raw_head {
  uint64_t number;
  uint32_t index; /* of the message in its sync */
  uint32_t piece;
  uint32_t pieces;
} raw_head;

#define RAW_PIECE (HAP_LINK_NEWEST_MOST - (uint32_t)sizeof(raw_head)) /* bytes beside the head */

/* A message of a sync that comes in. */
typedef struct raw_part {
  uint64_t number;
  uint32_t pieces; /* 0: none has come */
  uint32_t missing;
  uint32_t bytes;
  bool has[RAW_PIECES];
  unsigned char data[RAW_PIECES * RAW_PIECE];
} raw_part;

typedef struct raw_codec {
  size_t out_size[2]; /* 0: there is no such message */
  size_t in_size[2];
  uint64_t sent;
  uint64_t given;
  unsigned char *zipped;
  raw_part *parts[2]; /* RAW_KEPT each */
} raw_codec;

static inline hap_status raw_send(void *self, void *const messages[2], const hapi_codec_out *out,
                                  hap_detail *detail)
{
  raw_codec *c = self;
  ++c->sent;
  for (uint32_t i = 0; i < 2 && c->out_size[i] > 0; ++i) {
    uLongf size = compressBound(c->out_size[i]);
    if (compress2(c->zipped, &size, messages[i], c->out_size[i], 1) != Z_OK ||
        size > RAW_PIECES * RAW_PIECE) {
      (void)snprintf(detail->text, sizeof detail->text, "too large: %lu bytes", size);
      return HAP_ERROR_CAPACITY;
    }
    raw_head head = {.number = c->sent, .index = i};
    head.pieces = (uint32_t)((size + RAW_PIECE - 1) / RAW_PIECE);
    for (; head.piece < head.pieces; ++head.piece) {
      unsigned char datagram[sizeof head + RAW_PIECE];
      uint32_t rest = (uint32_t)size - head.piece * RAW_PIECE;
      uint32_t bytes = rest < RAW_PIECE ? rest : RAW_PIECE;
      memcpy(datagram, &head, sizeof head);
      memcpy(datagram + sizeof head, c->zipped + head.piece * RAW_PIECE, bytes);
      const hap_link_parcel parcel = {.to = {.channel = RAW_CHANNEL + i, .part = head.piece},
                                      .bytes = (uint32_t)sizeof head + bytes,
                                      .data = datagram};
      if (out->send(out->of, &parcel) < HAP_OK) {
        return HAP_ERROR_IO;
      }
    }
  }
  return HAP_OK;
}

static inline hap_status raw_take(void *self, const hap_link_event *event, hap_detail *detail)
{
  raw_codec *c = self;
  raw_head head;
  memcpy(&head, event->data, sizeof head);
  (void)detail;
  raw_part *part = &c->parts[head.index][head.number % RAW_KEPT];
  if (part->number > head.number) {
    return HAP_OK; /* of long ago */
  }
  if (part->number < head.number) {
    part->number = head.number;
    part->missing = part->pieces = head.pieces;
    part->bytes = 0;
    memset(part->has, 0, sizeof part->has);
  }
  uint32_t bytes = event->bytes - (uint32_t)sizeof head;
  if (!part->has[head.piece]) {
    part->has[head.piece] = true;
    memcpy(part->data + head.piece * RAW_PIECE, (const char *)event->data + sizeof head, bytes);
    part->bytes += bytes;
    --part->missing;
  }
  return HAP_OK;
}

static inline bool raw_is_whole(const raw_codec *c, uint64_t number)
{
  bool whole = true;
  for (int i = 0; i < 2 && c->in_size[i] > 0; ++i) {
    const raw_part *part = &c->parts[i][number % RAW_KEPT];
    whole = whole && part->number == number && part->missing == 0;
  }
  return whole;
}

static inline bool raw_give(void *self, void *const messages[2])
{
  raw_codec *c = self;
  uint64_t newest = 0;
  for (uint32_t k = 0; k < RAW_KEPT; ++k) {
    uint64_t number = c->parts[0][k].number;
    newest = number > newest && raw_is_whole(c, number) ? number : newest;
  }
  if (newest <= c->given) {
    return false;
  }
  c->given = newest;
  for (int i = 0; i < 2 && c->in_size[i] > 0; ++i) {
    const raw_part *part = &c->parts[i][newest % RAW_KEPT];
    uLongf size = c->in_size[i];
    if (uncompress(messages[i], &size, part->data, part->bytes) != Z_OK) {
      return false;
    }
  }
  return true;
}

static inline void raw_reset(void *self)
{
  raw_codec *c = self;
  c->sent = c->given = 0;
  memset(c->parts[0], 0, RAW_KEPT * sizeof *c->parts[0]);
  memset(c->parts[1], 0, RAW_KEPT * sizeof *c->parts[1]);
}

static inline hapi_codec raw_codec_of(raw_codec *c)
{
  return (hapi_codec){c, raw_send, raw_take, raw_give, raw_reset};
}

static inline void raw_finish(raw_codec *c)
{
  free(c->zipped);
  free(c->parts[0]);
  free(c->parts[1]);
  *c = (raw_codec){{0}, {0}};
}

/* Of the world's end, or of the loop's. False: no memory. */
static inline bool raw_init(raw_codec *c, const hapi_exchange *exchange, bool world)
{
  size_t down[2] = {hapi_exchange_message_size(exchange, HAPI_CHANNEL_MODEL),
                    hapi_exchange_message_size(exchange, HAPI_CHANNEL_NEAR)};
  size_t up[2] = {hapi_exchange_message_size(exchange, HAPI_CHANNEL_STATE), 0};
  size_t most = 0;
  *c = (raw_codec){{0}, {0}};
  for (int i = 0; i < 2; ++i) {
    c->out_size[i] = world ? down[i] : up[i];
    c->in_size[i] = world ? up[i] : down[i];
    most = c->out_size[i] > most ? c->out_size[i] : most;
    c->parts[i] = calloc(RAW_KEPT, sizeof *c->parts[i]);
  }
  c->zipped = malloc(compressBound(most));
  return c->zipped != NULL && c->parts[0] != NULL && c->parts[1] != NULL;
}

#endif
