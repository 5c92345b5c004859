/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_SPIDAR_WIRE_H
#define HAPODE_TOOLS_SPIDAR_WIRE_H

/* The two lines between the host and up to 8 boards, byte by byte: commands to all of them, replies
 * of whoever drives the reply line. Faults go in here. No clock: times are told, in s. */

#include "tools/spidar-emulator/board.h"

#define WIRE_REPLIES_MAX 4096 /* bytes on their way to the host */
#define WIRE_FAULTS_MAX 32

typedef enum wire_fault_kind {
  WIRE_LOSE,
  WIRE_DOUBLE,
  WIRE_STRAY /* value comes before the byte */
} wire_fault_kind;

typedef struct wire_fault {
  wire_fault_kind kind;
  hapi_spidar_direction direction;
  unsigned skip; /* bytes of that direction that pass before; padding counts as well */
  uint8_t value;
} wire_fault;

typedef struct wire_byte {
  double time; /* s, when it is over */
  uint8_t value;
  int8_t board; /* < 0: noise */
} wire_byte;

typedef struct wire {
  board boards[HAPI_SPIDAR_BOARDS];
  int count;
  bool silent[HAPI_SPIDAR_BOARDS]; /* by index: hears nothing and says nothing */
  double late;                     /* s, that every reply comes later */
  double free;                     /* s, when the command line is done with what it was given */
  wire_fault faults[WIRE_FAULTS_MAX];
  int fault_count;
  wire_byte replies[WIRE_REPLIES_MAX]; /* sorted by time */
  int reply_count;
  unsigned collisions; /* bytes that two boards sent at once */
} wire;

void wire_init(wire *w); /* no boards */

/* False: no room for it. */
bool wire_add_fault(wire *w, const wire_fault *fault);

/* A byte that the host gave to its port at that time; it takes BOARD_BYTE_S on the line, behind
 * those before it. */
void wire_from_host(wire *w, uint8_t byte, double time);

/* Noise on the reply line. */
void wire_noise(wire *w, uint8_t byte, double time);

/* Bytes that have reached the host by then; their number, at most size. */
int wire_to_host(wire *w, double time, uint8_t *out, int size);

/* When the next byte reaches the host; < 0: none is under way. */
double wire_next(const wire *w);

/* When the last byte does of those that come within length [s] of the next one: what an adapter
 * that collects bytes for so long hands on at once; < 0: none is under way. */
double wire_packet(const wire *w, double length);

#endif
