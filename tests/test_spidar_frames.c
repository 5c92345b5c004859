/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* plugins/spidar/frames.h and cycle.h: lengths, frames, streams, and cycles that were damaged. */

#include "tests/tap.h"

#include <stdint.h>

#include "plugins/spidar/cycle.h"

#define MODELS 7
#define B1M 1
#define B3M 5
#define B5M 7

/* Of the makers' firmware, commands 0 to 11, header and all. */
static const struct {
  const char *name;
  int command[HAPI_SPIDAR_COMMANDS];
  int reply[HAPI_SPIDAR_COMMANDS];
} known[MODELS + 1] = {
    [1] = {"B1M",
           {1, 1, 13, 21, 1, 17, 9, 12, 12, 18, 3, 2},
           {0, 7, 0, 21, 9, 17, 17, 12, 12, 0, 0, 18}},
    [2] = {"B1F",
           {1, 1, 13, 23, 1, 13, 7, 10, 22, 14, 3, 2},
           {0, 7, 0, 21, 11, 13, 17, 10, 10, 0, 0, 14}},
    [3] = {"B2M",
           {1, 1, 13, 21, 1, 17, 9, 12, 12, 18, 3, 2},
           {0, 7, 0, 21, 9, 17, 17, 12, 12, 0, 0, 18}},
    [4] = {"B2F",
           {1, 1, 13, 23, 1, 13, 7, 10, 22, 14, 3, 2},
           {0, 7, 0, 21, 11, 13, 17, 10, 10, 0, 0, 14}},
    [5] = {"B3M",
           {1, 1, 13, 21, 1, 17, 9, 12, 12, 18, 3, 2},
           {0, 7, 0, 29, 17, 17, 17, 12, 12, 0, 0, 18}},
    [6] = {"B3F",
           {1, 1, 13, 23, 1, 13, 7, 10, 22, 14, 3, 2},
           {0, 7, 0, 27, 17, 13, 17, 10, 10, 0, 0, 14}},
    [7] = {"B5M",
           {1, 1, 13, 85, 1, 33, 17, 20, 84, 34, 3, 2},
           {0, 7, 0, 45, 25, 33, 41, 20, 20, 0, 0, 34}},
};

static uint32_t dice = 1;

static uint32_t throw_dice(void)
{
  dice = dice * 1664525u + 1013904223u;
  return dice >> 8;
}

TEST(lengths_are_those_of_the_firmware)
{
  for (int model = 1; model <= MODELS; ++model) {
    const char *name = known[model].name;
    REQUIRE(hapi_spidar_kind_find(model) != NULL);
    CHECK(strcmp(hapi_spidar_kind_find(model)->name, name) == 0);
    CHECK(hapi_spidar_kind_number(name, 3) == model);
    for (int command = 0; command < HAPI_SPIDAR_COMMANDS; ++command) {
      CHECK(hapi_spidar_length(model, command, HAPI_SPIDAR_TO_BOARD) ==
            known[model].command[command]);
      CHECK(hapi_spidar_length(model, command, HAPI_SPIDAR_FROM_BOARD) ==
            known[model].reply[command]);
    }
  }
}

TEST(there_is_nothing_beside_the_table)
{
  CHECK(hapi_spidar_kind_find(0) == NULL && hapi_spidar_kind_find(8) == NULL);
  CHECK(hapi_spidar_kind_find(-1) == NULL);
  CHECK(hapi_spidar_kind_number("B3", 2) == 0 && hapi_spidar_kind_number("B3MM", 4) == 0);
  CHECK(hapi_spidar_length(0, 6, HAPI_SPIDAR_TO_BOARD) == 0);
  CHECK(hapi_spidar_length(B3M, 12, HAPI_SPIDAR_TO_BOARD) == 0);
  CHECK(hapi_spidar_length(B3M, -1, HAPI_SPIDAR_FROM_BOARD) == 0);
}

/* 20 bytes between the end of a reply and the next command, and at least 5 zeros. */
TEST(padding_keeps_replies_apart)
{
  CHECK(hapi_spidar_padding(B3M, HAPI_SPIDAR_CURRENT) == 28);
  CHECK(hapi_spidar_padding(B5M, HAPI_SPIDAR_CURRENT) == 44);
  CHECK(hapi_spidar_padding(B3M, HAPI_SPIDAR_BOARD_INFO) == 26);
  CHECK(hapi_spidar_padding(B5M, HAPI_SPIDAR_FORCE_CONTROL) == 5);
  CHECK(hapi_spidar_padding(B3M, HAPI_SPIDAR_SET_CMDLEN) == 7);
}

TEST(a_current_command_byte_by_byte)
{
  const uint8_t wanted[] = {0x31, 0x01, 0x00, 0xff, 0xff, 0xff, 0x0f, 0x01, 0xf0};
  hapi_spidar_frame frame = {
      .board = 1, .command = HAPI_SPIDAR_CURRENT, .current = {1, -1, 4095, -4095}};
  uint8_t bytes[HAPI_SPIDAR_FRAME_MAX];
  CHECK(hapi_spidar_encode(&frame, B3M, HAPI_SPIDAR_TO_BOARD, bytes) == 9);
  CHECK(memcmp(bytes, wanted, sizeof wanted) == 0);
}

TEST(a_reply_byte_by_byte)
{
  const uint8_t bytes[41] = {0x37,        0x34,        0x12, 0x00,        0x80, [15] = 0xfe, 0xff,
                             [17] = 0x02, [31] = 0xff, 0x7f, [33] = 0x01, 0x02, [39] = 0x03, 0xfc};
  hapi_spidar_frame frame;
  REQUIRE(hapi_spidar_decode(bytes, sizeof bytes, B5M, HAPI_SPIDAR_FROM_BOARD, &frame));
  CHECK(frame.board == 7 && frame.command == HAPI_SPIDAR_CURRENT);
  CHECK(frame.position[0] == 0x1234 && frame.position[1] == -32768 && frame.position[7] == -2);
  CHECK(frame.velocity[0] == 2 && frame.velocity[7] == 32767);
  CHECK(frame.force[0] == 0x201 && frame.force[3] == -1021);
}

/* Whatever bytes follow the header, they come back from decode and encode. */
static void there_and_back(int model, int command, hapi_spidar_direction direction)
{
  uint8_t bytes[HAPI_SPIDAR_FRAME_MAX];
  uint8_t again[HAPI_SPIDAR_FRAME_MAX];
  hapi_spidar_frame frame;
  int length = hapi_spidar_length(model, command, direction);
  for (int i = 0; i < length; ++i) {
    bytes[i] = (uint8_t)throw_dice();
  }
  bytes[0] = hapi_spidar_header(command, (int)(throw_dice() % HAPI_SPIDAR_BOARDS));
  bool good = hapi_spidar_decode(bytes, (size_t)length, model, direction, &frame);
  CHECK(good == (length > 0));
  if (!good) {
    frame.command = (uint8_t)command;
    CHECK(hapi_spidar_encode(&frame, model, direction, again) == 0);
    return;
  }
  CHECK(frame.board == (bytes[0] & 7) && frame.command == command);
  CHECK(hapi_spidar_encode(&frame, model, direction, again) == length);
  CHECK(memcmp(bytes, again, (size_t)length) == 0);
  CHECK(!hapi_spidar_decode(bytes, (size_t)length - 1, model, direction, &frame));
  CHECK(!hapi_spidar_decode(bytes, (size_t)length + 1, model, direction, &frame));
}

TEST(every_frame_of_every_board_comes_back)
{
  for (int model = 1; model <= MODELS; ++model) {
    for (int command = 0; command < HAPI_SPIDAR_COMMANDS; ++command) {
      for (int round = 0; round < 20; ++round) {
        there_and_back(model, command, HAPI_SPIDAR_TO_BOARD);
        there_and_back(model, command, HAPI_SPIDAR_FROM_BOARD);
      }
    }
  }
}

/* ---- a stream ---- */

TEST(a_stream_is_cut_between_padding)
{
  hapi_spidar_cutter cutter;
  int frames = 0;
  int bytes = 0;
  hapi_spidar_cutter_init(&cutter, B3M, HAPI_SPIDAR_TO_BOARD);
  for (int command = 1; command < HAPI_SPIDAR_COMMANDS; ++command) {
    for (int i = 0; i < 5; ++i) { /* padding of both kinds */
      CHECK(hapi_spidar_cutter_push(&cutter, i % 2 == 0 ? 0x00 : (uint8_t)(0x60 + i)) == 0);
    }
    for (int i = 0; i < known[B3M].command[command]; ++i) {
      uint8_t byte = i == 0 ? hapi_spidar_header(command, 3) : 0x08; /* BOARD_INFO at a header's */
      int size = hapi_spidar_cutter_push(&cutter, byte);
      frames += size > 0;
      bytes += size;
    }
    CHECK(frames == command && cutter.bytes[0] == hapi_spidar_header(command, 3));
  }
  CHECK(bytes == 1 + 13 + 21 + 1 + 17 + 9 + 12 + 12 + 18 + 3 + 2);
}

TEST(lengths_of_another_board_are_learned)
{
  hapi_spidar_cutter cutter;
  uint8_t lengths[HAPI_SPIDAR_COMMANDS];
  for (int command = 0; command < HAPI_SPIDAR_COMMANDS; ++command) {
    lengths[command] = (uint8_t)known[B5M].command[command];
  }
  lengths[HAPI_SPIDAR_DIRECT] = 255; /* more than fits is cut */
  hapi_spidar_cutter_init(&cutter, B1M, HAPI_SPIDAR_TO_BOARD);
  hapi_spidar_cutter_set(&cutter, 2, lengths);
  int sizes[3] = {0, 0, 0};
  for (int i = 0; i < 17; ++i) {
    sizes[0] += hapi_spidar_cutter_push(&cutter, 0x32);
  }
  for (int i = 0; i < 9; ++i) {
    sizes[1] += hapi_spidar_cutter_push(&cutter, 0x33);
  }
  for (int i = 0; i < HAPI_SPIDAR_FRAME_MAX; ++i) {
    sizes[2] += hapi_spidar_cutter_push(&cutter, 0x2a);
  }
  CHECK(sizes[0] == 17 && sizes[1] == 9 && sizes[2] == HAPI_SPIDAR_FRAME_MAX);
}

TEST(a_reply_that_cannot_be_is_padding)
{
  hapi_spidar_cutter cutter;
  hapi_spidar_cutter_init(&cutter, B3M, HAPI_SPIDAR_FROM_BOARD);
  CHECK(hapi_spidar_cutter_push(&cutter, hapi_spidar_header(HAPI_SPIDAR_SET_CMDLEN, 1)) == 0);
  CHECK(cutter.need == 0);
  CHECK(hapi_spidar_cutter_push(&cutter, hapi_spidar_header(HAPI_SPIDAR_BOARD_INFO, 1)) == 0);
  CHECK(cutter.need == 7);
  hapi_spidar_cutter_drop(&cutter);
  CHECK(cutter.need == 0);
}

/* ---- cycles ---- */

static const hapi_spidar_boards two_b3m = {2, {0, 1}, {B3M, B3M}};
static const hapi_spidar_boards one_b5m = {1, {3}, {B5M}};

static int motors_of(const hapi_spidar_boards *boards)
{
  hapi_spidar_cycle cycle;
  hapi_spidar_cycle_init(&cycle, boards);
  return cycle.motors;
}

/* The replies of a cycle: positions, and everything else by chance. */
static int make_replies(const hapi_spidar_boards *boards, const int16_t *raw, uint8_t *out)
{
  int used = 0;
  for (int i = 0; i < boards->count; ++i) {
    hapi_spidar_frame frame;
    memset(&frame, 0, sizeof frame);
    frame.board = boards->id[i];
    frame.command = HAPI_SPIDAR_CURRENT;
    for (int k = 0; k < hapi_spidar_kind_find(boards->model[i])->motors; ++k) {
      frame.position[k] = *raw++;
      frame.velocity[k] = (int16_t)(throw_dice() % 7 - 3);
    }
    for (int k = 0; k < HAPI_SPIDAR_FORCES; ++k) {
      frame.force[k] = (int16_t)throw_dice();
    }
    used += hapi_spidar_encode(&frame, boards->model[i], HAPI_SPIDAR_FROM_BOARD, out + used);
  }
  return used;
}

/* A hand moves: so many counts a cycle. */
static void motors_move(int motors, int16_t *raw)
{
  for (int i = 0; i < motors; ++i) {
    raw[i] = (int16_t)(raw[i] + (int)(throw_dice() % 41) - 20);
  }
}

TEST(a_cycle_is_commands_with_padding)
{
  hapi_spidar_cycle cycle;
  uint8_t bytes[HAPI_SPIDAR_COMMANDS_MAX];
  int16_t currents[8] = {1, 2, 3, 4, 5, 6, 32767, -32768};
  hapi_spidar_frame frame;
  hapi_spidar_cycle_init(&cycle, &two_b3m);
  CHECK(cycle.motors == 8 && cycle.length == 34);
  REQUIRE(hapi_spidar_cycle_commands(&cycle, currents, bytes) == 2 * (9 + 28));
  REQUIRE(hapi_spidar_decode(bytes, 9, B3M, HAPI_SPIDAR_TO_BOARD, &frame));
  CHECK(frame.board == 0 && frame.current[0] == 1 && frame.current[3] == 4);
  REQUIRE(hapi_spidar_decode(bytes + 37, 9, B3M, HAPI_SPIDAR_TO_BOARD, &frame));
  CHECK(frame.board == 1 && frame.current[0] == 5);
  CHECK(frame.current[2] == 4095 && frame.current[3] == -4095);
  hapi_spidar_cycle_init(&cycle, &one_b5m);
  CHECK(hapi_spidar_cycle_commands(&cycle, currents, bytes) == 17 + 44 && bytes[0] == 0x33);
}

/* However the bytes are cut by whoever reads them. */
TEST(cycles_come_in_pieces)
{
  hapi_spidar_cycle cycle;
  int16_t raw[8] = {0};
  int16_t seen[HAPI_SPIDAR_CYCLE_MOTORS];
  uint8_t bytes[128];
  hapi_spidar_cycle_init(&cycle, &two_b3m);
  for (int piece = 1; piece <= 34; ++piece) {
    motors_move(8, raw);
    int length = make_replies(&two_b3m, raw, bytes);
    bool there = false;
    for (int at = 0; at < length; at += piece) {
      CHECK(!there);
      hapi_spidar_cycle_push(&cycle, bytes + at, at + piece < length ? piece : length - at);
      there = hapi_spidar_cycle_take(&cycle, seen);
    }
    CHECK(there && memcmp(seen, raw, sizeof raw) == 0);
  }
}

TEST(of_several_cycles_the_newest_is_taken)
{
  hapi_spidar_cycle cycle;
  int16_t raw[8] = {0};
  int16_t seen[HAPI_SPIDAR_CYCLE_MOTORS];
  uint8_t bytes[128];
  hapi_spidar_cycle_init(&cycle, &two_b3m);
  for (int i = 0; i < 40; ++i) { /* more than the buffer holds */
    motors_move(8, raw);
    hapi_spidar_cycle_push(&cycle, bytes, make_replies(&two_b3m, raw, bytes));
  }
  REQUIRE(hapi_spidar_cycle_take(&cycle, seen));
  CHECK(memcmp(seen, raw, sizeof raw) == 0);
  CHECK(!hapi_spidar_cycle_take(&cycle, seen));
  motors_move(8, raw);
  hapi_spidar_cycle_push(&cycle, bytes, make_replies(&two_b3m, raw, bytes));
  int length = make_replies(&two_b3m, seen, bytes + 34); /* the one after it has only begun */
  for (int part = 1; part < length; ++part) {
    hapi_spidar_cycle copy = cycle;
    hapi_spidar_cycle_push(&copy, bytes + 34, part);
    REQUIRE(hapi_spidar_cycle_take(&copy, seen));
    CHECK(memcmp(seen, raw, sizeof raw) == 0 && copy.have == part);
  }
}

/* Else each string would be taken for one of the other board. */
TEST(boards_that_answer_under_each_others_names_are_refused)
{
  int16_t raw[8] = {0};
  int16_t seen[HAPI_SPIDAR_CYCLE_MOTORS];
  uint8_t bytes[128];
  for (int piece = 1; piece <= 34; ++piece) {
    hapi_spidar_cycle cycle;
    hapi_spidar_cycle_init(&cycle, &two_b3m);
    int length = make_replies(&two_b3m, raw, bytes);
    uint8_t first = bytes[0];
    bytes[0] = bytes[length / 2];
    bytes[length / 2] = first;
    for (int at = 0; at < length; at += piece) {
      hapi_spidar_cycle_push(&cycle, bytes + at, at + piece < length ? piece : length - at);
      CHECK(!hapi_spidar_cycle_take(&cycle, seen));
    }
  }
}

TEST(who_is_silent_is_told)
{
  hapi_spidar_cycle cycle;
  int16_t raw[8] = {0};
  uint8_t bytes[128];
  hapi_spidar_cycle_init(&cycle, &two_b3m);
  CHECK(hapi_spidar_cycle_silent(&cycle) == 0);
  make_replies(&two_b3m, raw, bytes);
  hapi_spidar_cycle_push(&cycle, bytes, 17);
  CHECK(hapi_spidar_cycle_silent(&cycle) == 1);
  hapi_spidar_cycle_push(&cycle, bytes + 17, 17);
  CHECK(hapi_spidar_cycle_silent(&cycle) == -1);
}

/* ---- cycles with a wrong byte ---- */

typedef enum damage_kind {
  LOST,
  DOUBLED,
  STRAY_ZERO,
  STRAY_PADDING,
  STRAY_HEADER, /* of the first board */
  STRAY_LAST_HEADER,
  STRAY_CHANCE,
  FLIPPED, /* every bit of it */
  DAMAGES
} damage_kind;

static int damage_bytes(damage_kind damage, int place, uint8_t *bytes, int length)
{
  const uint8_t stray[DAMAGES] = {[STRAY_ZERO] = 0,
                                  [STRAY_PADDING] = 0xff,
                                  [STRAY_HEADER] = bytes[0],
                                  [STRAY_LAST_HEADER] = 0x31,
                                  [STRAY_CHANCE] = (uint8_t)throw_dice()};
  uint8_t *at = bytes + place;
  if (damage == LOST) {
    memmove(at, at + 1, (size_t)(length - place - 1));
    return length - 1;
  }
  if (damage == FLIPPED) {
    *at = (uint8_t) ~*at;
    return length;
  }
  memmove(at + 1, at, (size_t)(length - place));
  if (damage != DOUBLED) {
    *at = stray[damage];
  }
  return length + 1;
}

typedef struct tally {
  int taken;   /* damaged cycles, of which something was taken */
  int wrong;   /* of them, whose positions were others than those sent */
  int no_next; /* times that the cycle after it was not taken, or wrong */
} tally;

/* A cycle, a damaged one, a good one, as the loop sees them: with a drain after each. */
static void damage_one(const hapi_spidar_boards *boards, damage_kind damage, int place, tally *io)
{
  hapi_spidar_cycle cycle;
  hapi_spidar_counts counts = {.motors = motors_of(boards)};
  int16_t raw[8];
  int16_t seen[HAPI_SPIDAR_CYCLE_MOTORS];
  uint8_t bytes[128];
  hapi_spidar_cycle_init(&cycle, boards);
  for (int i = 0; i < 8; ++i) {
    raw[i] = (int16_t)throw_dice();
  }
  for (int round = 0; round < 3; ++round) {
    motors_move(8, raw);
    int length = make_replies(boards, raw, bytes);
    length = round == 1 ? damage_bytes(damage, place, bytes, length) : length;
    hapi_spidar_cycle_push(&cycle, bytes, length);
    bool taken =
        hapi_spidar_cycle_take(&cycle, seen) && hapi_spidar_counts_advance(&counts, seen, 400);
    bool right = taken && memcmp(seen, raw, sizeof raw) == 0;
    if (round == 1) {
      io->taken += taken;
      io->wrong += taken && !right;
    } else {
      io->no_next += !right;
    }
  }
}

static tally damage_all(const hapi_spidar_boards *boards, damage_kind damage)
{
  tally all = {0, 0, 0};
  hapi_spidar_cycle cycle;
  hapi_spidar_cycle_init(&cycle, boards);
  for (int place = 0; place < cycle.length; ++place) {
    for (int round = 0; round < 200; ++round) {
      damage_one(boards, damage, place, &all);
    }
  }
  return all;
}

TEST(a_lost_or_additional_byte_costs_its_own_cycle_alone)
{
  static const hapi_spidar_boards *const lines[] = {&two_b3m, &one_b5m};
  for (int line = 0; line < 2; ++line) {
    for (damage_kind damage = LOST; damage < FLIPPED; ++damage) {
      tally all = damage_all(lines[line], damage);
      printf("# %d boards, damage %d: %d taken, %d wrong\n", lines[line]->count, (int)damage,
             all.taken, all.wrong);
      CHECK(all.wrong == 0);
      CHECK(all.no_next == 0);
    }
  }
}

/* No checksum: bits of a position that change alone can be seen only by the step they make. */
TEST(a_changed_byte_is_seen_where_it_can_be)
{
  tally all = damage_all(&two_b3m, FLIPPED);
  CHECK(all.no_next == 0);
  CHECK(all.wrong <= 8 * 200 + 100); /* the low bytes of the eight positions, and a few high ones */
  CHECK(all.taken <= 8 * 200 + 100 + 16 * 200); /* what is not a position changes nothing */
}

TEST(positions_do_not_wrap)
{
  hapi_spidar_counts counts = {.motors = 2};
  int16_t raw[2] = {32700, -32700};
  REQUIRE(hapi_spidar_counts_advance(&counts, raw, 500));
  CHECK(counts.counts[0] == 32700 && counts.counts[1] == -32700);
  raw[0] = -32736; /* 100 further */
  raw[1] = 32736;
  REQUIRE(hapi_spidar_counts_advance(&counts, raw, 500));
  CHECK(counts.counts[0] == 32800 && counts.counts[1] == -32800);
  raw[0] = -32736 + 501;
  CHECK(!hapi_spidar_counts_advance(&counts, raw, 500));
  CHECK(counts.counts[0] == 32800 && counts.raw[0] == -32736);
  raw[0] = -32736 + 500;
  CHECK(hapi_spidar_counts_advance(&counts, raw, 500) && counts.counts[0] == 33300);
}
