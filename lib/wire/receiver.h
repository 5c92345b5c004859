/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_WIRE_RECEIVER_H
#define HAPODE_WIRE_RECEIVER_H

/* Datagrams to frames. Everything that comes may be wrong. */

#include "wire/frame.h"
#include "wire/sender.h"

/* Says whether a whole frame can be what it says, and takes it over. NULL: yes; else a text. */
typedef const char *(*hapi_wire_accept_fn)(void *of, const hapi_wire_frame *frame);

/* A frame of which datagrams have come. */
typedef struct hapi_wire_gathering {
  uint64_t number; /* 0: none */
  uint64_t base;   /* 0: none */
  uint64_t serial; /* of the newest description that it may need */
  uint32_t directory;
  uint32_t parts; /* that have come */
  uint32_t last;  /* 1 + number of the last one; 0: not known yet */
  uint32_t above; /* 1 + highest number that has come */
  bool keep;
  bool done;                       /* given, or of no use */
  uint16_t sizes[HAPI_WIRE_PARTS]; /* 0: has not come */
  uint8_t bytes[HAPI_WIRE_PARTS][HAPI_WIRE_DATAGRAM];
} hapi_wire_gathering;

#define HAPI_WIRE_GATHERINGS 4u

/* Frames are that much ahead of the newest one at most: at 1 kHz, 17 minutes. */
#define HAPI_WIRE_AHEAD_MOST 1000000u

typedef struct hapi_wire_receiver {
  hapi_wire_shape shape;
  uint32_t channel;
  hapi_wire_accept_fn accept;
  void *of;
  uint64_t *known[HAPI_WIRE_KINDS];   /* cells by label */
  uint64_t *serials[HAPI_WIRE_KINDS]; /* of the descriptions, by label; 0: none */
  hapi_wire_frame frames[HAPI_WIRE_KEPT + 1];
  bool kept[HAPI_WIRE_KEPT + 1];
  uint64_t serial; /* of the newest description */
  uint64_t heard;  /* newest frame of which something has come */
  uint64_t given;  /* newest frame that was accepted */
  uint64_t acked;  /* newest frame that is kept */
  uint64_t base;   /* newest base that was used: older frames are needed no more */
  uint64_t frames_given;
  uint64_t lacking;
  uint64_t late;
  uint64_t refused;
  hapi_wire_frame *last; /* newest accepted one; NULL: none */
  hapi_wire_gathering *gatherings;
  uint8_t *directory;
  bool *lost; /* by record of the frame */
  size_t records_most;
  size_t directory_size;
} hapi_wire_receiver;

bool hapi_wire_receiver_create(hapi_wire_receiver *receiver, uint32_t channel, uint32_t first,
                               uint32_t end, const hapi_capacity *capacity);
void hapi_wire_receiver_finish(hapi_wire_receiver *receiver); /* also of a zeroed one */

/* A datagram. back: who sends the other direction; it hears what is acknowledged. */
hap_status hapi_wire_receiver_take(hapi_wire_receiver *receiver, const uint8_t *data,
                                   uint32_t bytes, hapi_wire_sender *back, hap_detail *detail);
/* A reliable message. */
hap_status hapi_wire_receiver_learn(hapi_wire_receiver *receiver, const uint8_t *data,
                                    uint32_t bytes, hap_detail *detail);

#endif
