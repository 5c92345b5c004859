/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_WIRE_SENDER_H
#define HAPODE_WIRE_SENDER_H

/* Frames to datagrams. Each frame goes as its difference to one that the other end has said to
 * have. Records that are new and of a kind that is known beforehand are told reliably first. */

#include "wire/frame.h"
#include "wire/labels.h"
#include "wire/out.h"

#define HAPI_WIRE_VERSION 1u
#define HAPI_WIRE_DATAGRAM 1200u
#define HAPI_WIRE_RELIABLE 60000u
#define HAPI_WIRE_PARTS 256u /* datagrams of a frame at most */
#define HAPI_WIRE_KEPT 8u    /* frames that an end keeps, one of them being written */

/* The third byte of a datagram. */
enum {
  HAPI_WIRE_KEEP = 1, /* the receiver shall keep the frame, and acknowledge it */
  HAPI_WIRE_LAST = 2  /* the last part of the frame */
};

typedef struct hapi_wire_sender {
  hapi_wire_shape shape;
  uint32_t channel;
  hapi_wire_labels labels[HAPI_WIRE_KINDS];
  uint64_t *known[HAPI_WIRE_KINDS]; /* cells by label, as they were described */
  hapi_wire_frame frames[HAPI_WIRE_KEPT];
  hapi_wire_frame *now; /* being written; NULL: none */
  uint64_t number;      /* of the newest frame */
  uint64_t base;        /* newest frame that was acknowledged; 0: none */
  uint64_t kept;        /* newest frame that is kept */
  uint64_t answer;      /* frames from one that was kept to its acknowledgement, the newest time */
  uint64_t serial;      /* of the newest description that was sent */
  uint8_t *directory;
  size_t directory_size;
  uint8_t bulk[HAPI_WIRE_RELIABLE];
} hapi_wire_sender;

bool hapi_wire_sender_create(hapi_wire_sender *sender, uint32_t channel, uint32_t first,
                             uint32_t end, const hapi_capacity *capacity);
void hapi_wire_sender_finish(hapi_wire_sender *sender); /* also of a zeroed one */

/* A new frame; then its records, list by list. */
void hapi_wire_sender_begin(hapi_wire_sender *sender);
/* The cells of a record with this key are to be written. NULL: the list is full. */
uint64_t *hapi_wire_sender_add(hapi_wire_sender *sender, hapi_wire_kind kind, uint64_t key);
/* A record of a kind that is alike, of cells; it gets those that were described with the key.
 * False: the list is full. */
bool hapi_wire_sender_add_alike(hapi_wire_sender *sender, hapi_wire_kind kind, uint64_t key,
                                const uint64_t *cells);

/* Sends the frame; ack: the frame of the other direction that is acknowledged with it. */
hap_status hapi_wire_sender_send(hapi_wire_sender *sender, uint64_t ack, const hapi_wire_out *out,
                                 hap_detail *detail);

/* The other end has frame number. False: it was never sent. */
bool hapi_wire_sender_acknowledge(hapi_wire_sender *sender, uint64_t number);

#endif
