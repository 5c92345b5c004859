/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "remote/end.h"

#include <stdio.h>
#include <string.h>

#include "base/assert.h"
#include "base/log.h"

/* A peer that floods takes this much time of a cycle and no more. */
#define POLLS_MOST 4096u

void hapi_end_refuse(hapi_end *end, const hap_detail *why)
{
  if (end->refused++ == 0) { /* a peer that floods must not flood the log */
    hapi_log(HAP_LOG_WARNING, "a message of peer %u is not taken: %.300s", end->peer, why->text);
  }
  end->detail = *why;
}

void hapi_end_poll(hapi_end *end, hapi_end_hear hear, void *of)
{
  hap_link_event event = {.kind = HAP_LINK_MESSAGE};
  hap_status status = HAP_OK;
  for (uint32_t i = 0; i < POLLS_MOST && event.kind != HAP_LINK_LEFT; ++i) {
    status = hap_link_poll(end->link, end->now_ns, &event, sizeof event);
    if (status != HAP_OK) {
      break;
    }
    bool theirs = event.kind == HAP_LINK_MESSAGE && end->joined && event.peer == end->peer;
    hap_detail why = {""};
    if (event.kind == HAP_LINK_MESSAGE && !theirs && event.peer == end->peer) {
      continue; /* it has overtaken that the peer has joined, or comes after its end */
    }
    if (event.kind == HAP_LINK_MESSAGE && !theirs) {
      snprintf(why.text, sizeof why.text, "it is of peer %u, who has no part here", event.peer);
      hapi_end_refuse(end, &why);
    } else if (event.kind != HAP_LINK_MESSAGE || event.channel == HAPI_TERMS_CHANNEL ||
               event.channel == HAPI_STAMPS_CHANNEL || event.channel == HAPI_SCENERY_CHANNEL) {
      hear(of, &event);
    } else if (end->codec.take(end->codec.self, &event, &why) < HAP_OK) {
      hapi_end_refuse(end, &why);
    }
  }
  if (status < HAP_OK) {
    ++end->failed;
    (void)hap_link_detail(end->link, &end->detail);
  }
}

/* hapi_codec_out.send */
static hap_status end_post(void *of, const hap_link_parcel *parcel)
{
  hapi_end *end = of;
  hap_link_address to = parcel->to;
  to.peer = end->peer;
  hap_status status =
      parcel->reliable != 0
          ? hap_link_send_reliably(end->link, end->now_ns, &to, parcel->data, parcel->bytes)
          : hap_link_send_newest(end->link, end->now_ns, &to, parcel->data, parcel->bytes);
  if (status < HAP_OK) {
    ++end->failed;
    (void)hap_link_detail(end->link, &end->detail);
  }
  return status;
}

void hapi_end_send(hapi_end *end, void *const messages[2])
{
  const hapi_codec_out out = {end, end_post};
  hap_detail why = {""};
  uint64_t failed = end->failed;
  if (!end->joined) {
    return;
  }
  if (end->codec.send(end->codec.self, messages, &out, &why) < HAP_OK && end->failed == failed) {
    ++end->failed; /* the codec's own reason: a message that it cannot encode */
    end->detail = why;
  }
}

void hapi_end_send_stamps(hapi_end *end, const unsigned char *data, uint32_t bytes)
{
  const hap_link_parcel parcel = {
      .to = {.channel = HAPI_STAMPS_CHANNEL}, .bytes = bytes, .data = data};
  (void)end_post(end, &parcel);
}

bool hapi_end_send_scenery(void *of, uint32_t part, bool reliable, const void *data, uint32_t bytes)
{
  const hap_link_parcel parcel = {.to = {.channel = HAPI_SCENERY_CHANNEL, .part = part},
                                  .reliable = reliable,
                                  .bytes = bytes,
                                  .data = data};
  return end_post(of, &parcel) >= HAP_OK;
}

void hapi_end_send_terms(hapi_end *end, const hapi_terms *terms)
{
  unsigned char bytes[HAPI_TERMS_BYTES];
  hapi_terms_write(terms, bytes);
  const hap_link_parcel parcel = {
      .to = {.channel = HAPI_TERMS_CHANNEL}, .reliable = 1, .bytes = sizeof bytes, .data = bytes};
  (void)end_post(end, &parcel);
}

void hapi_end_send_refusal(hapi_end *end, uint32_t peer, const char *text)
{
  unsigned char bytes[HAPI_REFUSAL_BYTES_MOST];
  uint32_t own = end->peer;
  const hap_link_parcel parcel = {.to = {.channel = HAPI_TERMS_CHANNEL},
                                  .reliable = 1,
                                  .bytes = hapi_refusal_write(text, bytes),
                                  .data = bytes};
  end->peer = peer;
  (void)end_post(end, &parcel);
  end->peer = own;
}
