/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/spidar-emulator/wire.h"

#include <math.h>
#include <string.h>

void wire_init(wire *w)
{
  memset(w, 0, sizeof *w);
}

bool wire_add_fault(wire *w, const wire_fault *fault)
{
  if (w->fault_count == WIRE_FAULTS_MAX) {
    return false;
  }
  w->faults[w->fault_count++] = *fault;
  return true;
}

/* The bytes that come of one: none, itself, two. */
static int byte_spoil(wire *w, hapi_spidar_direction direction, uint8_t byte, uint8_t out[2])
{
  int count = 1;
  out[0] = byte;
  for (int i = w->fault_count - 1; i >= 0; --i) {
    wire_fault *fault = &w->faults[i];
    if (fault->direction != direction || fault->skip-- > 0) {
      continue;
    }
    if (fault->kind == WIRE_LOSE) {
      count = 0;
    } else {
      out[0] = fault->kind == WIRE_STRAY ? fault->value : byte;
      out[1] = byte;
      count = 2;
    }
    *fault = w->faults[--w->fault_count];
  }
  return count;
}

/* ---- replies ---- */

/* Two drivers at once: the one that pulls the line down wins, bit by bit. */
static void byte_insert(wire *w, const wire_byte *byte)
{
  int at = w->reply_count;
  while (at > 0 && w->replies[at - 1].time > byte->time) {
    --at;
  }
  for (int i = at - 1; i <= at; ++i) {
    bool there = i >= 0 && i < w->reply_count;
    if (there && w->replies[i].board != byte->board &&
        fabs(w->replies[i].time - byte->time) < 0.999 * BOARD_BYTE_S) {
      w->replies[i].value &= byte->value;
      ++w->collisions;
      return;
    }
  }
  if (w->reply_count == WIRE_REPLIES_MAX) {
    return; /* nobody reads: as a driver's buffer does */
  }
  memmove(w->replies + at + 1, w->replies + at,
          (size_t)(w->reply_count - at) * sizeof w->replies[0]);
  w->replies[at] = *byte;
  ++w->reply_count;
}

static void send_reply(wire *w, int index, const board_reply *reply)
{
  for (int i = 0; i < reply->size; ++i) {
    double time = reply->start + w->late + (i + 1) * BOARD_BYTE_S;
    const wire_byte byte = {time, reply->bytes[i], (int8_t)index};
    byte_insert(w, &byte);
  }
}

void wire_noise(wire *w, uint8_t byte, double time)
{
  const wire_byte noise = {time, byte, -1};
  byte_insert(w, &noise);
}

int wire_to_host(wire *w, double time, uint8_t *out, int size)
{
  int used = 0;
  int taken = 0;
  while (taken < w->reply_count && w->replies[taken].time <= time && used + 2 <= size) {
    uint8_t bytes[2];
    int count = byte_spoil(w, HAPI_SPIDAR_FROM_BOARD, w->replies[taken].value, bytes);
    memcpy(out + used, bytes, (size_t)count);
    used += count;
    ++taken;
  }
  w->reply_count -= taken;
  memmove(w->replies, w->replies + taken, (size_t)w->reply_count * sizeof w->replies[0]);
  return used;
}

double wire_next(const wire *w)
{
  return w->reply_count > 0 ? w->replies[0].time : -1.0;
}

double wire_packet(const wire *w, double length)
{
  double end = wire_next(w);
  for (int i = 1; i < w->reply_count && w->replies[i].time <= w->replies[0].time + length; ++i) {
    end = w->replies[i].time;
  }
  return end;
}

/* ---- commands ---- */

static void byte_hear(wire *w, uint8_t byte, double time)
{
  for (int i = 0; i < w->count; ++i) {
    board_reply reply;
    if (!w->silent[i] && board_receive(&w->boards[i], byte, time, &reply)) {
      send_reply(w, i, &reply);
    }
  }
}

void wire_from_host(wire *w, uint8_t byte, double time)
{
  uint8_t bytes[2];
  int count = byte_spoil(w, HAPI_SPIDAR_TO_BOARD, byte, bytes);
  double start = time > w->free ? time : w->free;
  w->free = start + BOARD_BYTE_S;
  for (int i = 0; i < count; ++i) {
    byte_hear(w, bytes[i], w->free);
    w->free += i + 1 < count ? BOARD_BYTE_S : 0.0;
  }
}
