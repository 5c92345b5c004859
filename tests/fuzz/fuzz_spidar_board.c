/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* tools/spidar-emulator: the bytes are what a host sends to two boards, with faults on the way,
 * and a command of the emulator. The first byte chooses the model of the boards, the second and
 * third a fault. */

#include "tests/fuzz/fuzz.h"
#include "tools/spidar-emulator/emulator.h"

static void check_board(const board *b)
{
  for (int i = 0; i < HAPI_SPIDAR_MOTORS; ++i) {
    FUZZ_CHECK(abs(b->output[i]) <= b->current_limit && abs(b->current[i]) <= BOARD_CURRENT_MAX);
  }
  FUZZ_CHECK(b->asked < HAPI_SPIDAR_PARAMETERS && b->mode <= BOARD_FORCE_CONTROL);
}

static void set_boards(wire *w, int model)
{
  wire_init(w);
  w->count = 2;
  board_init(&w->boards[0], 0, model, -5);
  board_init(&w->boards[1], 1, 5, 32760);
}

static void board_send(const uint8_t *data, size_t size)
{
  static wire w;
  static uint8_t replies[2 * WIRE_REPLIES_MAX];
  const int32_t counts[HAPI_SPIDAR_MOTORS] = {1, -1, 70000, -70000, 5, 6, 7, 8};
  set_boards(&w, 1 + data[0] % 7);
  const wire_fault fault = {(wire_fault_kind)(data[1] % 3),
                            data[1] % 2 == 0 ? HAPI_SPIDAR_TO_BOARD : HAPI_SPIDAR_FROM_BOARD,
                            data[2], data[1]};
  FUZZ_CHECK(wire_add_fault(&w, &fault));
  for (size_t i = 3; i < size; ++i) {
    wire_from_host(&w, data[i], w.free);
    for (int k = 0; k < 2; ++k) {
      board_run(&w.boards[k], w.free);
      if (i % 16 == 0) {
        board_tick(&w.boards[k], counts);
      }
      check_board(&w.boards[k]);
    }
  }
  for (int i = 1; i < w.reply_count; ++i) {
    FUZZ_CHECK(w.replies[i - 1].time <= w.replies[i].time);
  }
  FUZZ_CHECK(wire_to_host(&w, 1e9, replies, sizeof replies) >= 0 && w.reply_count == 0);
}

static void board_command(const uint8_t *data, size_t size)
{
  static emulator e;
  emulator_action action;
  hap_detail detail;
  char *text = fuzz_text(data, size);
  set_boards(&e.wire, 5);
  e.model = hapi_spidar_model_find("x4r");
  e.event_count = 0;
  fuzz_detail_spoil(&detail);
  hap_status status = emulator_parse(&e, text, &action, &detail);
  fuzz_check_answer(status, status >= HAP_OK ? &action : NULL, &detail);
  if (status >= HAP_OK) {
    emulator_do(&e, &action);
  }
  fuzz_detail_spoil(&detail);
  status = emulator_plan_line(&e, text, &detail);
  fuzz_check_answer(status, status >= HAP_OK ? &e : NULL, &detail);
  FUZZ_CHECK(e.event_count <= 1);
  free(text);
}

void fuzz_one(const uint8_t *data, size_t size)
{
  if (size < 4) {
    return;
  }
  board_send(data, size);
  board_command(data, size);
}
