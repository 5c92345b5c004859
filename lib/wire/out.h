/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_WIRE_OUT_H
#define HAPODE_WIRE_OUT_H

/* Where the bytes go. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/status.h>

enum {
  HAPI_WIRE_CHANNEL_KNOWN = 1, /* reliable, in order */
  HAPI_WIRE_CHANNEL_WORLD = 2, /* datagrams down; part: number of the datagram in its frame */
  HAPI_WIRE_CHANNEL_STATE = 3  /* datagrams up, likewise */
};

/* A reliable message that is refused goes again with the next send. */
typedef struct hapi_wire_out {
  void *of;
  hap_status (*send)(void *of, uint32_t channel, uint32_t part, bool reliable, const void *data,
                     uint32_t bytes);
} hapi_wire_out;

#endif
