/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* plugins/spidar/frames.h, cycle.h and line.h: the bytes are what boards send. The first chooses
 * the boards, the second how the rest is cut into pieces. */

#include <errno.h>

#include "plugins/spidar/line.h"
#include "tests/fuzz/fuzz.h"

/* What is cut out of a stream is a frame, and comes back from decode and encode. */
static void line_cut(const uint8_t *data, size_t size, int model, hapi_spidar_direction direction)
{
  hapi_spidar_cutter cutter;
  hapi_spidar_cutter_init(&cutter, model, direction);
  for (size_t i = 0; i < size; ++i) {
    hapi_spidar_frame frame;
    uint8_t again[HAPI_SPIDAR_FRAME_MAX];
    int length = hapi_spidar_cutter_push(&cutter, data[i]);
    FUZZ_CHECK(length >= 0 && length <= HAPI_SPIDAR_FRAME_MAX);
    if (length > 0) {
      FUZZ_CHECK(hapi_spidar_is_header(cutter.bytes[0]));
      FUZZ_CHECK(hapi_spidar_decode(cutter.bytes, (size_t)length, model, direction, &frame));
      FUZZ_CHECK(hapi_spidar_encode(&frame, model, direction, again) == length);
      FUZZ_CHECK(memcmp(again, cutter.bytes, (size_t)length) == 0);
    }
  }
}

static bool bytes_hold(const uint8_t *data, size_t size, const uint8_t *part, size_t count)
{
  for (size_t i = 0; i + count <= size; ++i) {
    if (memcmp(data + i, part, count) == 0) {
      return true;
    }
  }
  return false;
}

/* Positions that are taken were sent, in just these bytes. */
static void check_taken(const hapi_spidar_cycle *cycle, const int16_t *raw, const uint8_t *data,
                        size_t size)
{
  for (int i = 0; i < cycle->boards.count; ++i) {
    const hapi_spidar_kind *kind = hapi_spidar_kind_find(cycle->boards.model[i]);
    uint8_t bytes[1 + 2 * HAPI_SPIDAR_MOTORS] = {
        hapi_spidar_header(HAPI_SPIDAR_CURRENT, cycle->boards.id[i])};
    for (int k = 0; k < kind->motors; ++k) {
      bytes[1 + 2 * k] = (uint8_t)(*raw & 0xff);
      bytes[2 + 2 * k] = (uint8_t)((uint16_t)*raw >> 8);
      ++raw;
    }
    FUZZ_CHECK(bytes_hold(data, size, bytes, 1 + 2 * (size_t)kind->motors));
  }
}

static void take_cycles(const uint8_t *data, size_t size, size_t piece,
                        const hapi_spidar_boards *boards)
{
  hapi_spidar_cycle cycle;
  hapi_spidar_counts counts = {0};
  hapi_spidar_cycle_init(&cycle, boards);
  counts.motors = cycle.motors;
  for (size_t at = 0; at < size; at += piece) {
    int16_t raw[HAPI_SPIDAR_CYCLE_MOTORS];
    size_t end = at + piece < size ? at + piece : size;
    hapi_spidar_cycle_push(&cycle, data + at, (int)(end - at));
    if (hapi_spidar_cycle_take(&cycle, raw)) {
      check_taken(&cycle, raw, data, size);
      hapi_spidar_counts before = counts;
      if (!hapi_spidar_counts_advance(&counts, raw, 100)) {
        FUZZ_CHECK(memcmp(&before, &counts, sizeof counts) == 0);
      } else if (before.known) {
        FUZZ_CHECK(abs(counts.counts[0] - before.counts[0]) <= 100);
      }
    }
    (void)hapi_spidar_cycle_silent(&cycle);
  }
}

/* ---- a port that says these bytes ---- */

typedef struct source {
  const uint8_t *data;
  size_t size;
  size_t piece;
  double now;
} source;

static int source_send(void *self, const uint8_t *bytes, int count)
{
  (void)self;
  (void)bytes;
  return count > 0 ? 0 : -EINVAL;
}

static int source_receive(void *self, uint8_t *bytes, int size)
{
  source *s = self;
  size_t count = s->piece < s->size ? s->piece : s->size;
  count = count < (size_t)size ? count : (size_t)size;
  memcpy(bytes, s->data, count);
  s->data += count;
  s->size -= count;
  s->now += 1e-4;
  return (int)count;
}

static void source_await(void *self, double seconds)
{
  source *s = self;
  s->now += seconds;
}

static double source_now(void *self)
{
  const source *s = self;
  return s->now;
}

static void source_flush(void *self)
{
  (void)self;
}

static void frames_find(const uint8_t *data, size_t size, size_t piece)
{
  source s = {data, size, piece, 0.0};
  const hapi_spidar_port port = {&s,           source_send, source_receive,
                                 source_await, source_now,  source_flush};
  hapi_spidar_boards found;
  hapi_spidar_line line;
  const int16_t none[HAPI_SPIDAR_CYCLE_MOTORS] = {0};
  hap_detail detail;
  fuzz_detail_spoil(&detail);
  hap_status status = hapi_spidar_line_find(&port, &found, &detail);
  FUZZ_CHECK((status >= HAP_OK) == (found.count > 0));
  if (status < HAP_OK) {
    return;
  }
  for (int i = 0; i < found.count; ++i) {
    FUZZ_CHECK(hapi_spidar_kind_find(found.model[i]) != NULL && found.id[i] < HAPI_SPIDAR_BOARDS);
  }
  FUZZ_CHECK(hapi_spidar_line_begin(&line, &port, &found, 1e5) == HAP_OK);
  for (int i = 0; i < 10; ++i) {
    FUZZ_CHECK(hapi_spidar_line_send(&line, none) == 0);
    FUZZ_CHECK(hapi_spidar_line_receive(&line) >= 0);
  }
}

void fuzz_one(const uint8_t *data, size_t size)
{
  static const hapi_spidar_boards lines[] = {
      {2, {0, 1}, {5, 5}}, {1, {3}, {7}}, {3, {2, 4, 7}, {1, 6, 4}}, {1, {0}, {5}}};
  if (size < 2) {
    return;
  }
  size_t piece = 1 + (size_t)data[1] % 64;
  int model = 1 + data[0] % 7;
  line_cut(data + 2, size - 2, model, HAPI_SPIDAR_FROM_BOARD);
  line_cut(data + 2, size - 2, model, HAPI_SPIDAR_TO_BOARD);
  take_cycles(data + 2, size - 2, piece, &lines[data[0] % 4]);
  frames_find(data + 2, size - 2, piece);
}
