/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "plugins/spidar/cycle.h"

#include <stdlib.h>
#include <string.h>

#include "base/assert.h"

static int reply_length(const hapi_spidar_boards *boards, int index)
{
  return hapi_spidar_length(boards->model[index], HAPI_SPIDAR_CURRENT, HAPI_SPIDAR_FROM_BOARD);
}

static int motors_of(const hapi_spidar_boards *boards, int index)
{
  const hapi_spidar_kind *kind = hapi_spidar_kind_find(boards->model[index]);
  HAPI_ASSERT(kind != NULL); /* boards of other models are not listed */
  return kind->motors;
}

void hapi_spidar_cycle_init(hapi_spidar_cycle *cycle, const hapi_spidar_boards *boards)
{
  memset(cycle, 0, sizeof *cycle);
  cycle->boards = *boards;
  for (int i = 0; i < boards->count; ++i) {
    cycle->start[i] = cycle->length;
    cycle->length += reply_length(boards, i);
    cycle->motors += motors_of(boards, i);
  }
  HAPI_ASSERT(cycle->length <= (int)sizeof cycle->bytes);
  HAPI_ASSERT(cycle->motors <= HAPI_SPIDAR_CYCLE_MOTORS);
}

void hapi_spidar_cycle_clear(hapi_spidar_cycle *cycle)
{
  cycle->have = 0;
}

static int16_t current_clip(int16_t current)
{
  int high = current < HAPI_SPIDAR_CURRENT_MAX ? current : HAPI_SPIDAR_CURRENT_MAX;
  return (int16_t)(high > -HAPI_SPIDAR_CURRENT_MAX ? high : -HAPI_SPIDAR_CURRENT_MAX);
}

int hapi_spidar_cycle_commands(const hapi_spidar_cycle *cycle, const int16_t *currents,
                               uint8_t *out)
{
  int used = 0;
  int motor = 0;
  for (int i = 0; i < cycle->boards.count; ++i) {
    int model = cycle->boards.model[i];
    hapi_spidar_frame frame = {.board = cycle->boards.id[i], .command = HAPI_SPIDAR_CURRENT};
    for (int k = 0; k < motors_of(&cycle->boards, i); ++k) {
      frame.current[k] = current_clip(currents[motor++]);
    }
    used += hapi_spidar_encode(&frame, model, HAPI_SPIDAR_TO_BOARD, out + used);
    int padding = hapi_spidar_padding(model, HAPI_SPIDAR_CURRENT);
    memset(out + used, 0, (size_t)padding);
    used += padding;
  }
  return used;
}

static void drop_oldest(hapi_spidar_cycle *cycle, int count)
{
  HAPI_ASSERT(count >= 0 && count <= cycle->have);
  cycle->have -= count;
  memmove(cycle->bytes, cycle->bytes + count, (size_t)cycle->have);
  memmove(cycle->begins, cycle->begins + count, (size_t)cycle->have * sizeof cycle->begins[0]);
}

void hapi_spidar_cycle_push(hapi_spidar_cycle *cycle, const uint8_t *bytes, int count)
{
  HAPI_ASSERT(count >= 0);
  int room = (int)sizeof cycle->bytes;
  if (count == 0) {
    return;
  }
  if (count > room) {
    bytes += count - room;
    count = room;
  }
  if (cycle->have + count > room) {
    drop_oldest(cycle, cycle->have + count - room);
  }
  HAPI_ASSERT(cycle->have + count <= room);
  memcpy(cycle->bytes + cycle->have, bytes, (size_t)count);
  memset(cycle->begins + cycle->have, 0, (size_t)count * sizeof cycle->begins[0]);
  cycle->begins[cycle->have] = true;
  cycle->have += count;
}

/* Whether what is there of a cycle that begins at that place has its headers where they belong. */
static bool fits_at(const hapi_spidar_cycle *cycle, int place)
{
  for (int i = 0; i < cycle->boards.count; ++i) {
    int at = place + cycle->start[i];
    if (at < cycle->have &&
        cycle->bytes[at] != hapi_spidar_header(HAPI_SPIDAR_CURRENT, cycle->boards.id[i])) {
      return false;
    }
  }
  return true;
}

static void decode_at(const hapi_spidar_cycle *cycle, int place, int16_t *out_raw)
{
  HAPI_ASSERT(place >= 0 && place + cycle->length <= cycle->have);
  for (int i = 0; i < cycle->boards.count; ++i) {
    hapi_spidar_frame frame;
    (void)hapi_spidar_decode(cycle->bytes + place + cycle->start[i],
                             (size_t)reply_length(&cycle->boards, i), cycle->boards.model[i],
                             HAPI_SPIDAR_FROM_BOARD, &frame);
    int motors = motors_of(&cycle->boards, i);
    memcpy(out_raw, frame.position, (size_t)motors * sizeof out_raw[0]);
    out_raw += motors;
  }
}

static bool may_begin(const hapi_spidar_cycle *cycle, int place)
{
  int before = place - cycle->length;
  return cycle->begins[place] || (before >= 0 && fits_at(cycle, before));
}

/* Newest first. Behind a whole cycle there is nothing, or the beginning of the next one: in one
 * with a byte too many or too few something else stands there. */
bool hapi_spidar_cycle_take(hapi_spidar_cycle *cycle, int16_t *out_raw)
{
  for (int end = cycle->have; end >= cycle->length && cycle->length > 0; --end) {
    int begin = end - cycle->length;
    if (fits_at(cycle, begin) && fits_at(cycle, end) && may_begin(cycle, begin)) {
      decode_at(cycle, begin, out_raw);
      drop_oldest(cycle, end);
      cycle->begins[0] = true;
      return true;
    }
  }
  return false;
}

int hapi_spidar_cycle_silent(const hapi_spidar_cycle *cycle)
{
  for (int i = 0; i < cycle->boards.count; ++i) {
    uint8_t header = hapi_spidar_header(HAPI_SPIDAR_CURRENT, cycle->boards.id[i]);
    if (memchr(cycle->bytes, header, (size_t)cycle->have) == NULL) {
      return cycle->boards.id[i];
    }
  }
  return -1;
}

/* ---- positions that do not wrap ---- */

bool hapi_spidar_counts_advance(hapi_spidar_counts *counts, const int16_t *raw, int step_max)
{
  HAPI_ASSERT(counts->motors > 0 && counts->motors <= HAPI_SPIDAR_CYCLE_MOTORS);
  int16_t step[HAPI_SPIDAR_CYCLE_MOTORS];
  size_t size = (size_t)counts->motors * sizeof raw[0];
  if (!counts->known) {
    for (int i = 0; i < counts->motors; ++i) {
      counts->counts[i] = raw[i];
    }
    memcpy(counts->raw, raw, size);
    counts->known = true;
    return true;
  }
  for (int i = 0; i < counts->motors; ++i) {
    step[i] = (int16_t)(uint16_t)((uint16_t)raw[i] - (uint16_t)counts->raw[i]);
    if (abs(step[i]) > step_max) {
      return false;
    }
  }
  for (int i = 0; i < counts->motors; ++i) {
    counts->counts[i] += step[i];
  }
  memcpy(counts->raw, raw, size);
  return true;
}
