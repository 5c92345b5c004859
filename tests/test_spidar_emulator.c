/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* tools/spidar-emulator and plugins/spidar/line.h, one against the other, in simulated time. */

#include "tests/tap.h"

#include <errno.h>
#include <stdint.h>

#include "base/vec.h"
#include "plugins/spidar/line.h"
#include "plugins/spidar/tensions.h"
#include "tools/spidar-emulator/emulator.h"

#define B3M 5
#define B3F 6
#define B5M 7
#define CYCLE_S 1e-3
#define STEP_RATE (10.0 / 3.485e-5) /* counts/s */

/* ---- a board alone ---- */

/* Sends a command and padding; the first reply, or one of size 0. */
static board_reply send_to(board *b, const hapi_spidar_frame *frame, double *time)
{
  board_reply first = {.size = 0};
  uint8_t bytes[HAPI_SPIDAR_FRAME_MAX + 64] = {0};
  int count = hapi_spidar_encode(frame, b->model, HAPI_SPIDAR_TO_BOARD, bytes) + 60;
  for (int i = 0; i < count; ++i) {
    board_reply reply;
    *time += BOARD_BYTE_S;
    if (board_receive(b, bytes[i], *time, &reply) && first.size == 0) {
      first = reply;
    }
  }
  *time += 1e-3;
  board_run(b, *time);
  return first;
}

static hapi_spidar_frame command_of(int id, int command)
{
  hapi_spidar_frame frame;
  memset(&frame, 0, sizeof frame);
  frame.board = (uint8_t)id;
  frame.command = (uint8_t)command;
  return frame;
}

/* What a board answers to a command. */
static hapi_spidar_frame ask_board(board *b, const hapi_spidar_frame *frame, double *time)
{
  hapi_spidar_frame told;
  board_reply reply = send_to(b, frame, time);
  REQUIRE(
      hapi_spidar_decode(reply.bytes, (size_t)reply.size, b->model, HAPI_SPIDAR_FROM_BOARD, &told));
  return told;
}

TEST(every_command_of_every_board_has_its_reply)
{
  for (int model = 1; model <= 7; ++model) {
    board b;
    double time = 0.0;
    board_init(&b, 3, model, 0);
    for (int command = 0; command < HAPI_SPIDAR_COMMANDS; ++command) {
      hapi_spidar_frame frame = command_of(3, command);
      for (int i = 0; i < HAPI_SPIDAR_COMMANDS; ++i) {
        frame.lengths[i] = (uint8_t)hapi_spidar_length(model, i, HAPI_SPIDAR_TO_BOARD);
      }
      unsigned before = b.executed;
      double begin = time;
      board_reply reply = send_to(&b, &frame, &time);
      CHECK(reply.size == hapi_spidar_length(model, command, HAPI_SPIDAR_FROM_BOARD));
      CHECK(reply.size == 0 || reply.bytes[0] == hapi_spidar_header(command, 3));
      CHECK(b.executed == before + 1);
      /* from the header on, and not before the receiver's six bytes are there */
      CHECK(reply.size == 0 || (reply.start >= begin + BOARD_BYTE_S + BOARD_REPLY_MIN_S &&
                                reply.start <= begin + 7 * BOARD_BYTE_S + BOARD_REPLY_MAX_S));
    }
  }
}

TEST(what_a_board_says_it_is)
{
  board b;
  double time = 0.0;
  hapi_spidar_frame frame = command_of(1, HAPI_SPIDAR_BOARD_INFO);
  board_init(&b, 1, B5M, 0);
  const uint8_t wanted[6] = {7, 12, 8, 8, 4, 0};
  CHECK(memcmp(ask_board(&b, &frame, &time).info, wanted, sizeof wanted) == 0);
}

TEST(a_reply_tells_what_was_before_its_command)
{
  board b;
  double time = 0.0;
  int32_t counts[HAPI_SPIDAR_MOTORS] = {5, -7, 1000, 70000};
  hapi_spidar_frame current = command_of(0, HAPI_SPIDAR_CURRENT);
  const hapi_spidar_frame sensor = command_of(0, HAPI_SPIDAR_SENSOR);
  board_init(&b, 0, B3M, 0);
  current.current[2] = 321;
  hapi_spidar_frame told = ask_board(&b, &current, &time);
  CHECK(told.position[2] == 0);
  told = ask_board(&b, &sensor, &time);
  CHECK(told.current[2] == 0); /* no control tick yet */
  board_tick(&b, counts);
  told = ask_board(&b, &sensor, &time);
  CHECK(told.current[2] == 321 && told.position[0] == 5 && told.position[1] == -7);
  CHECK(told.position[3] == 70000 - 65536); /* it wraps */
  told = ask_board(&b, &current, &time);
  CHECK(told.velocity[2] == 1000);
  board_tick(&b, counts);
  told = ask_board(&b, &current, &time);
  CHECK(told.velocity[2] == 0);
}

TEST(parameters_are_told_one_call_late)
{
  board b;
  double time = 0.0;
  hapi_spidar_frame set = command_of(2, HAPI_SPIDAR_SET_PARAM);
  hapi_spidar_frame get = command_of(2, HAPI_SPIDAR_GET_PARAM);
  board_init(&b, 2, B3M, 0);
  set.parameter_type = HAPI_SPIDAR_PARAMETER_CURRENT_GAIN;
  set.parameter[3] = 77;
  (void)send_to(&b, &set, &time);
  get.parameter_type = HAPI_SPIDAR_PARAMETER_CURRENT_GAIN;
  hapi_spidar_frame told = ask_board(&b, &get, &time);
  CHECK(told.parameter_type == HAPI_SPIDAR_PARAMETER_PD);
  told = ask_board(&b, &get, &time);
  CHECK(told.parameter_type == HAPI_SPIDAR_PARAMETER_CURRENT_GAIN && told.parameter[3] == 77);
}

TEST(a_reset_leaves_the_count_within_a_turn)
{
  board b;
  double time = 0.0;
  int32_t counts[HAPI_SPIDAR_MOTORS] = {5000, -1, 1024, 0};
  hapi_spidar_frame reset = command_of(0, HAPI_SPIDAR_RESET_SENSOR);
  board_init(&b, 0, B3M, 0);
  board_tick(&b, counts);
  reset.flags = 2;
  (void)send_to(&b, &reset, &time);
  CHECK(board_position(&b, 0) == 5000);
  reset.flags = 1;
  (void)send_to(&b, &reset, &time);
  CHECK(board_position(&b, 0) == 5000 - 4096 && board_position(&b, 1) == 1023);
  CHECK(board_position(&b, 2) == 0 && board_position(&b, 3) == 0);
}

TEST(currents_are_clipped_and_other_modes_let_them_go)
{
  board b;
  double time = 0.0;
  const int32_t counts[HAPI_SPIDAR_MOTORS] = {0};
  hapi_spidar_frame current = command_of(0, HAPI_SPIDAR_CURRENT);
  hapi_spidar_frame direct = command_of(0, HAPI_SPIDAR_DIRECT);
  hapi_spidar_frame all = command_of(0, HAPI_SPIDAR_ALL);
  current.current[0] = 30000;
  current.current[1] = -30000;
  board_init(&b, 0, B3M, 0);
  (void)send_to(&b, &current, &time);
  board_tick(&b, counts);
  CHECK(b.output[0] == 4095 && b.output[1] == -4095 && b.mode == BOARD_CURRENT);
  direct.position[0] = 1600;
  (void)send_to(&b, &direct, &time);
  board_tick(&b, counts);
  CHECK(b.mode == BOARD_DIRECT && b.output[0] == 1600 && b.output[1] == 0);
  all.mode = BOARD_CURRENT;
  all.shared[3] = 12;
  (void)send_to(&b, &all, &time);
  board_tick(&b, counts);
  CHECK(b.mode == BOARD_CURRENT && b.output[3] == 12 && b.output[0] == 0);
}

/* A second command within the time that the first one takes to be executed. */
TEST(there_is_one_buffer)
{
  board b;
  hapi_spidar_frame current = command_of(0, HAPI_SPIDAR_CURRENT);
  uint8_t bytes[HAPI_SPIDAR_FRAME_MAX] = {0};
  board_reply reply;
  board_init(&b, 0, B3M, 0);
  current.current[0] = 1;
  int count = hapi_spidar_encode(&current, B3M, HAPI_SPIDAR_TO_BOARD, bytes);
  current.current[0] = 2;
  count += hapi_spidar_encode(&current, B3M, HAPI_SPIDAR_TO_BOARD, bytes + count);
  for (int i = 0; i < count; ++i) {
    (void)board_receive(&b, bytes[i], 1e-6 * i, &reply); /* faster than the line is */
  }
  board_run(&b, 1.0);
  CHECK(b.executed == 1 && b.current[0] == 2);
}

/* ---- several boards ---- */

typedef struct stage {
  emulator emulator;
  hapi_spidar_port port;
  double now;
} stage;

static int stage_send(void *self, const uint8_t *bytes, int count)
{
  stage *s = self;
  if (!s->emulator.plugged) {
    return -EIO;
  }
  emulator_write(&s->emulator, bytes, count, s->now);
  return 0;
}

static int stage_receive(void *self, uint8_t *bytes, int size)
{
  stage *s = self;
  emulator_advance(&s->emulator, s->now);
  int count = emulator_read(&s->emulator, s->now, bytes, size);
  return s->emulator.plugged ? count : -EIO;
}

static void stage_await(void *self, double seconds)
{
  stage *s = self;
  double end = s->now + seconds;
  double next = -1.0;
  while (s->now < end && !(next >= 0.0 && next <= s->now)) {
    s->now += fmin(50e-6, end - s->now);
    emulator_advance(&s->emulator, s->now);
    next = wire_next(&s->emulator.wire);
  }
}

static double stage_now(void *self)
{
  const stage *s = self;
  return s->now;
}

static void stage_flush(void *self)
{
  uint8_t bytes[4096];
  (void)stage_receive(self, bytes, sizeof bytes);
}

static void stage_end(void *owned)
{
  stage *s = owned;
  emulator_finish(&s->emulator);
}

static stage *set_stage(const emulator_def *def)
{
  stage *s = tap_own(sizeof *s, stage_end);
  hap_detail detail = {""};
  REQUIRE_SAY(emulator_init(&s->emulator, def, &detail) == HAP_OK, "%s", detail.text);
  s->port = (hapi_spidar_port){s, stage_send, stage_receive, stage_await, stage_now, stage_flush};
  return s;
}

static emulator_def x4r_of(emulator_hand hand)
{
  return (emulator_def){.model = hapi_spidar_model_find("x4r"),
                        .board_count = 2,
                        .board_model = {B3M, B3M},
                        .board_id = {0, 1},
                        .first_count = 32600,
                        .hand = hand};
}

static void stage_tell(stage *s, const char *line)
{
  emulator_action action;
  hap_detail detail = {""};
  bool good = emulator_parse(&s->emulator, line, &action, &detail) >= HAP_OK;
  CHECK_SAY(good, "%s: %s", line, detail.text);
  emulator_do(&s->emulator, &action);
}

TEST(all_ids_and_models_are_found)
{
  static const struct {
    const char *model;
    int count;
    int boards[3];
    int ids[3];
  } rows[] = {{"x4r", 2, {B3M, B3M}, {0, 1}}, {"x4r", 2, {B3M, B3M}, {6, 7}},
              {"x4r", 2, {1, 3}, {2, 5}},     {"x5r", 1, {B5M}, {0}},
              {"x5r", 1, {B5M}, {7}},         {"x3r4", 1, {B3M}, {4}}};
  for (size_t i = 0; i < sizeof rows / sizeof rows[0]; ++i) {
    emulator_def def = {.model = hapi_spidar_model_find(rows[i].model),
                        .board_count = rows[i].count};
    memcpy(def.board_model, rows[i].boards, sizeof rows[i].boards);
    memcpy(def.board_id, rows[i].ids, sizeof rows[i].ids);
    stage *s = set_stage(&def);
    hapi_spidar_boards found;
    hap_detail detail = {""};
    CHECK(hapi_spidar_line_find(&s->port, &found, &detail) == HAP_OK);
    REQUIRE(found.count == rows[i].count);
    for (int k = 0; k < found.count; ++k) {
      CHECK(found.id[k] == rows[i].ids[k] && found.model[k] == rows[i].boards[k]);
    }
  }
}

TEST(boards_are_found_among_garbage)
{
  const emulator_def def = x4r_of(EMULATOR_HAND_HOLD);
  hapi_spidar_boards found;
  hap_detail detail = {""};
  stage *s = set_stage(&def);
  stage_tell(s, "garbage 300");
  CHECK(hapi_spidar_line_find(&s->port, &found, &detail) == HAP_OK && found.count == 2);
  for (int lost = 0; lost < 14; ++lost) { /* one answer with a byte missing */
    wire_fault fault = {WIRE_LOSE, HAPI_SPIDAR_FROM_BOARD, (unsigned)lost, 0};
    REQUIRE(wire_add_fault(&s->emulator.wire, &fault));
    CHECK(hapi_spidar_line_find(&s->port, &found, &detail) == HAP_OK && found.count == 2);
  }
}

TEST(who_is_not_there_is_not_found)
{
  const emulator_def def = x4r_of(EMULATOR_HAND_HOLD);
  hapi_spidar_boards found;
  hap_detail detail = {""};
  stage *s = set_stage(&def);
  stage_tell(s, "silent 1 1");
  CHECK(hapi_spidar_line_find(&s->port, &found, &detail) == HAP_OK);
  CHECK(found.count == 1 && found.id[0] == 0);
  stage_tell(s, "silent all 1");
  CHECK(hapi_spidar_line_find(&s->port, &found, &detail) == HAP_ERROR_DEVICE);
  CHECK(strstr(detail.text, "switched on") != NULL);
  stage_tell(s, "silent all 0");
  stage_tell(s, "report 0 B3F");
  CHECK(hapi_spidar_line_find(&s->port, &found, &detail) == HAP_OK);
  CHECK(found.count == 2 && found.model[0] == B3F && found.model[1] == B3M);
  stage_tell(s, "unplug");
  CHECK(hapi_spidar_line_find(&s->port, &found, &detail) == HAP_ERROR_DEVICE);
  CHECK(strstr(detail.text, "port failed") != NULL);
}

/* ---- cycles ---- */

static stage *stage_begin(const emulator_def *def, hapi_spidar_line *line)
{
  hapi_spidar_boards found;
  hap_detail detail = {""};
  stage *s = set_stage(def);
  REQUIRE(hapi_spidar_line_find(&s->port, &found, &detail) == HAP_OK);
  REQUIRE(hapi_spidar_line_begin(line, &s->port, &found, STEP_RATE) == HAP_OK);
  return s;
}

/* A tick: takes what came, asks anew. */
static bool stage_tick(stage *s, hapi_spidar_line *line, const int16_t *currents)
{
  s->now += CYCLE_S;
  bool taken = hapi_spidar_line_receive(line) == 1;
  CHECK(hapi_spidar_line_send(line, currents) == 0);
  return taken;
}

/* Against the encoders themselves, which have moved on a little. */
static bool is_right(const stage *s, const hapi_spidar_line *line)
{
  const wire *w = &s->emulator.wire;
  int motor = 0;
  bool right = true;
  for (int i = 0; i < w->count; ++i) {
    for (int k = 0; k < hapi_spidar_kind_find(w->boards[i].model)->motors; ++k) {
      right = right && abs(line->counts.counts[motor] - w->boards[i].counts[k]) <= 12;
      ++motor;
    }
  }
  return right;
}

static const int16_t taut[8] = {20, 20, -20, -20, -20, -20, 20, 20};

TEST(cycles_are_answered_and_wrap)
{
  const emulator_def def = x4r_of(EMULATOR_HAND_PUSH);
  hapi_spidar_line line;
  int taken = 0;
  int32_t least = INT32_MAX;
  int32_t most = INT32_MIN;
  stage *s = stage_begin(&def, &line);
  (void)stage_tick(s, &line, taut);
  for (int i = 0; i < 3000; ++i) {
    taken += stage_tick(s, &line, taut);
    CHECK(is_right(s, &line));
    for (int k = 0; k < 8; ++k) {
      least = line.counts.counts[k] < least ? line.counts.counts[k] : least;
      most = line.counts.counts[k] > most ? line.counts.counts[k] : most;
    }
  }
  CHECK(taken == 3000);
  CHECK(most > 32767 && least < 32600); /* across the wrap */
  CHECK(s->emulator.wire.collisions == 0);
}

TEST(short_padding_lets_replies_collide)
{
  const emulator_def def = x4r_of(EMULATOR_HAND_HOLD);
  hapi_spidar_line line;
  stage *s = stage_begin(&def, &line);
  uint8_t bytes[HAPI_SPIDAR_COMMANDS_MAX];
  (void)hapi_spidar_cycle_commands(&line.cycle, taut, bytes);
  memmove(bytes + 9, bytes + 37, 37); /* no zeros between the two */
  emulator_write(&s->emulator, bytes, 9 + 37, s->now);
  CHECK(s->emulator.wire.collisions > 0);
  s->now += CYCLE_S;
  CHECK(hapi_spidar_line_receive(&line) == 0);
  (void)stage_tick(s, &line, taut);
  CHECK(stage_tick(s, &line, taut) && is_right(s, &line));
}

/* ---- wrong bytes, at every place of a cycle ---- */

typedef struct outcome {
  int wrong;  /* replies that were taken and were not those of the encoders */
  int slow;   /* faults after which two cycles went by without a good one */
  int missed; /* cycles without a good one */
} outcome;

static void look_after(stage *s, hapi_spidar_line *line, const int16_t *currents, outcome *io)
{
  int without = 0;
  for (int i = 0; i < 8; ++i) {
    bool taken = stage_tick(s, line, currents);
    io->wrong += taken && !is_right(s, line);
    without = taken ? 0 : without + 1;
    io->missed += !taken;
    io->slow += without == 2;
  }
}

static outcome spoil_all(const emulator_def *def, wire_fault fault, const int16_t *currents)
{
  outcome all = {0, 0, 0};
  hapi_spidar_line line;
  stage *s = stage_begin(def, &line);
  for (int i = 0; i < 400; ++i) { /* the strings are wound in */
    (void)stage_tick(s, &line, currents);
  }
  uint8_t bytes[HAPI_SPIDAR_COMMANDS_MAX];
  int commands = hapi_spidar_cycle_commands(&line.cycle, currents, bytes);
  bool to = fault.direction == HAPI_SPIDAR_TO_BOARD;
  if (to) { /* with a byte lost, a current is another one: not so great that strings fly */
    stage_tell(s, "saturate 110");
  }
  for (int place = 0; place < (to ? commands : line.cycle.length); ++place) {
    fault.skip = (unsigned)place;
    REQUIRE(wire_add_fault(&s->emulator.wire, &fault));
    look_after(s, &line, currents, &all);
  }
  return all;
}

static void spoil_in_all_ways(const emulator_def *def, hapi_spidar_direction direction,
                              const int16_t *currents)
{
  static const uint8_t stray[] = {0x00, 0xff, 0x30, 0x31, 0x08, 0x5a, 0x77, 0x01};
  for (int i = 0; i < 10; ++i) {
    wire_fault fault = {.direction = direction};
    fault.kind = i == 0 ? WIRE_LOSE : i == 1 ? WIRE_DOUBLE : WIRE_STRAY;
    fault.value = i >= 2 ? stray[i - 2] : 0;
    outcome all = spoil_all(def, fault, currents);
    printf("# %s, way %d: %d cycles missed, %d wrong, %d slow\n",
           direction == HAPI_SPIDAR_TO_BOARD ? "commands" : "replies", i, all.missed, all.wrong,
           all.slow);
    CHECK(all.wrong == 0);
    CHECK(all.slow == 0);
  }
}

TEST(a_wrong_byte_in_the_replies_costs_one_cycle)
{
  const emulator_def def = x4r_of(EMULATOR_HAND_PUSH);
  spoil_in_all_ways(&def, HAPI_SPIDAR_FROM_BOARD, taut);
}

TEST(a_wrong_byte_in_the_replies_of_one_board_costs_one_cycle)
{
  const emulator_def def = {.model = hapi_spidar_model_find("x5r"),
                            .board_count = 1,
                            .board_model = {B5M},
                            .board_id = {0},
                            .first_count = -5,
                            .hand = EMULATOR_HAND_PUSH};
  const int16_t alternating[8] = {40, -40, 40, -40, 40, -40, 40, -40};
  spoil_in_all_ways(&def, HAPI_SPIDAR_FROM_BOARD, alternating);
}

/* A header that is lost, or one too many, makes a board take the currents for commands: here
 * they are none. */
TEST(a_wrong_byte_in_the_commands_costs_one_cycle)
{
  static const uint8_t padding[] = {0x00, 0xff, 0x77};
  const emulator_def def = x4r_of(EMULATOR_HAND_PUSH);
  const int16_t harmless[8] = {97, 98, -99, -100, -101, -102, 103, 104};
  for (int i = 0; i < 5; ++i) {
    wire_fault fault = {.direction = HAPI_SPIDAR_TO_BOARD};
    fault.kind = i == 0 ? WIRE_LOSE : i == 1 ? WIRE_DOUBLE : WIRE_STRAY;
    fault.value = i >= 2 ? padding[i - 2] : 0;
    outcome all = spoil_all(&def, fault, harmless);
    printf("# commands, way %d: %d cycles missed, %d wrong, %d slow\n", i, all.missed, all.wrong,
           all.slow);
    CHECK(all.wrong == 0);
    CHECK(all.slow == 0);
  }
}

TEST(late_replies_are_taken_when_they_come)
{
  const emulator_def def = x4r_of(EMULATOR_HAND_PUSH);
  hapi_spidar_line line;
  stage *s = stage_begin(&def, &line);
  (void)stage_tick(s, &line, taut);
  stage_tell(s, "late 0.0033");
  int taken = 0;
  for (int i = 0; i < 100; ++i) {
    taken += stage_tick(s, &line, taut);
    CHECK(is_right(s, &line));
  }
  CHECK(taken >= 95);
}

TEST(silence_is_measured)
{
  const emulator_def def = x4r_of(EMULATOR_HAND_HOLD);
  hapi_spidar_line line;
  stage *s = stage_begin(&def, &line);
  (void)stage_tick(s, &line, taut);
  CHECK(stage_tick(s, &line, taut));
  CHECK(hapi_spidar_line_silence(&line) <= 1e-9);
  stage_tell(s, "silent 1 1");
  for (int i = 0; i < 20; ++i) {
    CHECK(!stage_tick(s, &line, taut) || i == 0);
  }
  CHECK(hapi_spidar_line_silence(&line) > 0.017 && hapi_spidar_line_silence(&line) < 0.021);
  CHECK(hapi_spidar_cycle_silent(&line.cycle) == 1);
  stage_tell(s, "silent 1 0");
  (void)stage_tick(s, &line, taut);
  CHECK(stage_tick(s, &line, taut) && is_right(s, &line));
  CHECK(hapi_spidar_line_exchange(&line, taut, 0.1) == HAP_OK);
  stage_tell(s, "silent all 1");
  s->now += CYCLE_S;
  stage_flush(s);
  hapi_spidar_cycle_clear(&line.cycle);
  CHECK(hapi_spidar_line_exchange(&line, taut, 0.1) == HAP_ERROR_TIMEOUT);
  stage_tell(s, "unplug");
  CHECK(hapi_spidar_line_exchange(&line, taut, 0.1) == HAP_ERROR_DEVICE);
}

/* Five of them are 5 ms. */
TEST(a_pulled_cable_is_noticed_by_the_next_tick)
{
  const emulator_def def = x4r_of(EMULATOR_HAND_HOLD);
  hapi_spidar_line line;
  for (int part = 0; part < 10; ++part) {
    stage *s = stage_begin(&def, &line);
    (void)stage_tick(s, &line, taut);
    CHECK(stage_tick(s, &line, taut));
    s->now += 1e-4 * part; /* answers are under way, or all there */
    stage_tell(s, "unplug");
    s->now += CYCLE_S;
    CHECK(hapi_spidar_line_receive(&line) == -EIO);
    CHECK(hapi_spidar_line_send(&line, taut) == -EIO);
  }
}

TEST(positions_that_jump_are_not_believed)
{
  const emulator_def def = x4r_of(EMULATOR_HAND_HOLD);
  hapi_spidar_line line;
  stage *s = stage_begin(&def, &line);
  (void)stage_tick(s, &line, taut);
  CHECK(stage_tick(s, &line, taut));
  s->emulator.wire.boards[1].origin[2] = 5000; /* a RESET_SENSOR that nobody sent */
  int32_t before = line.counts.counts[6];
  (void)stage_tick(s, &line, taut);
  for (int i = 0; i < 5; ++i) {
    CHECK(!stage_tick(s, &line, taut));
  }
  CHECK(line.bad_steps >= 5 && abs(line.counts.counts[6] - before) < 5);
}

TEST(encoders_that_are_off_or_stand_still)
{
  const emulator_def def = x4r_of(EMULATOR_HAND_PUSH);
  hapi_spidar_line line;
  stage *s = stage_begin(&def, &line);
  (void)stage_tick(s, &line, taut);
  REQUIRE(stage_tick(s, &line, taut));
  int32_t before[8];
  memcpy(before, line.counts.counts, sizeof before);
  stage_tell(s, "false 5 200");
  (void)stage_tick(s, &line, taut);
  REQUIRE(stage_tick(s, &line, taut));
  for (int i = 0; i < 8; ++i) {
    CHECK(abs(line.counts.counts[i] - before[i] - (i == 5 ? 200 : 0)) <= 3);
  }
  stage_tell(s, "false all 0");
  stage_tell(s, "stuck 6 1");
  emulator_advance(&s->emulator, s->now + 1.8); /* the hand has moved by then */
  s->now = emulator_time(&s->emulator);
  (void)stage_tick(s, &line, taut);
  (void)stage_tick(s, &line, taut);
  CHECK(abs(line.counts.counts[6] - before[6]) <= 3 && line.counts.counts[5] != before[5]);
  stage_tell(s, "stuck all 0");
  (void)stage_tick(s, &line, taut);
  (void)stage_tick(s, &line, taut);
  CHECK(abs(line.counts.counts[6] - before[6]) > 3);
}

/* ---- mechanics ---- */

/* With the tensions that the device would ask for: what the hand feels is what was wanted. */
static void model_feel(const char *name, int model, const hap_wrench *wanted)
{
  const hapi_spidar_model *m = hapi_spidar_model_find(name);
  emulator_def def = {.model = m,
                      .board_count = model == B5M ? 1 : 2,
                      .board_model = {model, model},
                      .board_id = {0, 1},
                      .hand = EMULATOR_HAND_HOLD};
  hapi_spidar_line line;
  hapi_spidar_tensions solver;
  hap_wrench reached;
  double tension[HAPI_SPIDAR_STRINGS_MAX];
  int16_t currents[8];
  stage *s = stage_begin(&def, &line);
  hapi_spidar_tensions_init(&solver, m);
  for (int i = 0; i < 2500; ++i) {
    const hap_pose *pose = &s->emulator.grip.pose;
    CHECK(hapi_spidar_tensions_solve(&solver, m, pose, wanted, tension, &reached) >= HAP_OK);
    for (int k = 0; k < 8; ++k) {
      currents[k] = (int16_t)lround(tension[k] * m->volts_per_newton[k] * 4096.0 / 3.3);
    }
    (void)stage_tick(s, &line, currents);
    for (int k = 0; k < 8; ++k) {
      CHECK(s->emulator.grip.tension[k] >= 0.0);
    }
  }
  const grip *g = &s->emulator.grip;
  for (int k = 0; k < 3; ++k) {
    CHECK_NEAR(g->wrench.force[k], reached.force[k], 0.03);
    CHECK_NEAR(g->wrench.torque[k], reached.torque[k], 1.5e-3);
    CHECK_NEAR(g->pose.position[k], reached.force[k] / 150.0, 5e-4); /* the hand's spring */
  }
}

TEST(what_is_asked_for_is_felt)
{
  const hap_wrench push = {{1.5, -0.5, 0.7}, {0.0, 0.0, 0.0}};
  const hap_wrench turn = {{0.0, 0.0, 0.0}, {0.005, 0.0, -0.005}};
  model_feel("x4r", B3M, &push);
  model_feel("x4r", B3M, &turn);
  model_feel("x5r", B5M, &push);
}

TEST(nobody_holds_it_and_nobody_pulls)
{
  const emulator_def def = x4r_of(EMULATOR_HAND_NONE);
  stage *s = set_stage(&def);
  emulator_advance(&s->emulator, 0.5);
  CHECK(hapi_v3_norm(s->emulator.grip.pose.position) < 1e-9);
  stage_tell(s, "push 0.2 0 0"); /* against slack rotors alone */
  emulator_advance(&s->emulator, 0.55);
  CHECK(s->emulator.grip.pose.position[0] > 1e-4);
}

/* ---- commands ---- */

static const char *const good_commands[] = {"lose reply",
                                            "lose command 3",
                                            "double reply 0",
                                            "stray reply 5 255",
                                            "stray command 1 0",
                                            " silent 1 1 ",
                                            "silent all 0",
                                            "late 0.002",
                                            "garbage 10",
                                            "report 1 B5M",
                                            "false 3 -300",
                                            "false all 0",
                                            "stuck 7 1",
                                            "stuck all 0",
                                            "saturate 100",
                                            "power",
                                            "unplug",
                                            "unplug 0.5",
                                            "plug",
                                            "push 1 -2 .5",
                                            "hand none",
                                            "state",
                                            "quit"};
static const char *const bad_commands[] = {"",
                                           "lose",
                                           "lose it",
                                           "lose reply x",
                                           "lose reply 1 2",
                                           "stray reply 1",
                                           "stray reply 1 256",
                                           "silent 2 1",
                                           "silent 1 2",
                                           "silent 1",
                                           "late",
                                           "late -1",
                                           "garbage",
                                           "report 2 B3M",
                                           "report 1 B9M",
                                           "false 8 1",
                                           "false 1",
                                           "false 1 40000",
                                           "stuck 1 2",
                                           "saturate 4096",
                                           "power 1",
                                           "unplug -1",
                                           "push 1 2",
                                           "push 1 2 999",
                                           "hand",
                                           "hand left",
                                           "state now",
                                           "lose reply 1 2 3 4 5 6 7",
                                           "quitt"};

TEST(commands_are_understood_or_refused)
{
  const emulator_def def = x4r_of(EMULATOR_HAND_HOLD);
  stage *s = set_stage(&def);
  emulator_action action;
  hap_detail detail = {""};
  for (size_t i = 0; i < sizeof good_commands / sizeof good_commands[0]; ++i) {
    bool taken = emulator_parse(&s->emulator, good_commands[i], &action, &detail) == HAP_OK;
    CHECK_SAY(taken, "%s", good_commands[i]);
  }
  for (size_t i = 0; i < sizeof bad_commands / sizeof bad_commands[0]; ++i) {
    bool refused =
        emulator_parse(&s->emulator, bad_commands[i], &action, &detail) == HAP_ERROR_FORMAT;
    CHECK_SAY(refused, "%s", bad_commands[i]);
  }
}

TEST(a_script_is_followed)
{
  const emulator_def def = x4r_of(EMULATOR_HAND_HOLD);
  stage *s = set_stage(&def);
  hap_detail detail = {""};
  CHECK(emulator_plan_line(&s->emulator, "# nothing", &detail) == HAP_OK);
  CHECK(emulator_plan_line(&s->emulator, "", &detail) == HAP_OK);
  CHECK(emulator_plan_line(&s->emulator, "0.1 unplug 0.05", &detail) == HAP_OK);
  CHECK(emulator_plan_line(&s->emulator, "0.2 silent 0 1", &detail) == HAP_OK);
  CHECK(emulator_plan_line(&s->emulator, "0.1 power", &detail) == HAP_ERROR_FORMAT);
  CHECK(emulator_plan_line(&s->emulator, "power", &detail) == HAP_ERROR_FORMAT);
  CHECK(emulator_plan_line(&s->emulator, "1 powder", &detail) == HAP_ERROR_FORMAT);
  emulator_advance(&s->emulator, 0.099);
  CHECK(s->emulator.plugged);
  emulator_advance(&s->emulator, 0.12);
  CHECK(!s->emulator.plugged);
  emulator_advance(&s->emulator, 0.16);
  CHECK(s->emulator.plugged && !s->emulator.wire.silent[0]);
  emulator_advance(&s->emulator, 0.21);
  CHECK(s->emulator.wire.silent[0] && !s->emulator.wire.silent[1]);
}

TEST(a_wrong_emulator_is_refused)
{
  hap_detail detail = {""};
  emulator_def def = x4r_of(EMULATOR_HAND_PUSH);
  static emulator wrong;
  def.board_count = 1;
  CHECK(emulator_init(&wrong, &def, &detail) == HAP_ERROR_ARGUMENT);
  CHECK(strstr(detail.text, "4 motors") != NULL && strstr(detail.text, "8 strings") != NULL);
  def = x4r_of(EMULATOR_HAND_PUSH);
  def.path = "0:0/0/0;1:1/1";
  CHECK(emulator_init(&wrong, &def, &detail) == HAP_ERROR_ARGUMENT);
}
