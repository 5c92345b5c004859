/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_SHIFTED_LINK_H
#define HAPODE_TESTS_SHIFTED_LINK_H

/* A link whose owner has another clock than the other end. */

#include <hapode/link.h>

typedef struct shifted {
  hap_link *inner;
  int64_t ahead_ns; /* the inner link's clock - the owner's */
} shifted;

static inline hap_status shifted_send(void *self, int64_t now_ns, const hap_link_parcel *parcel,
                                      hap_detail *detail)
{
  shifted *s = self;
  int64_t then_ns = now_ns + s->ahead_ns;
  hap_status status =
      parcel->reliable != 0
          ? hap_link_send_reliably(s->inner, then_ns, &parcel->to, parcel->data, parcel->bytes)
          : hap_link_send_newest(s->inner, then_ns, &parcel->to, parcel->data, parcel->bytes);
  (void)hap_link_detail(s->inner, detail);
  return status;
}

static inline hap_status shifted_poll(void *self, int64_t now_ns, hap_link_event *out,
                                      hap_detail *detail)
{
  shifted *s = self;
  hap_status status = hap_link_poll(s->inner, now_ns + s->ahead_ns, out, sizeof *out);
  out->arrived_ns -= status == HAP_OK ? s->ahead_ns : 0;
  (void)hap_link_detail(s->inner, detail);
  return status;
}

static inline void shifted_close(void *self)
{
  shifted *s = self;
  hap_link_close(s->inner);
  s->inner = NULL;
}

static const hap_link_ops shifted_ops = {.abi = HAP_LINK_ABI,
                                         .size = sizeof(hap_link_ops),
                                         .name = "shifted",
                                         .send = shifted_send,
                                         .poll = shifted_poll,
                                         .close = shifted_close};

#endif
