/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "plugins/spidar/line.h"

#include <errno.h>
#include <string.h>

#include "base/log.h"

#define ANSWER_S 10e-3 /* for BOARD_INFO */
#define TRIES 3
#define INFO_SIZE 7 /* of that reply, the same for all models */
#define ANY_MODEL 1
#define SEND_S 50e-3  /* for a port that is full */
#define STEP_LEAST 32 /* counts, whatever the time between two replies was */
#define EXCHANGE_S 5e-3

/* Waits for a port that is full. */
static int send_patiently(const hapi_spidar_port *port, const uint8_t *bytes, int count)
{
  double end = port->now(port->self) + SEND_S;
  int sent = port->send(port->self, bytes, count);
  while (sent == -EAGAIN && port->now(port->self) < end) {
    port->await(port->self, 1e-3);
    sent = port->send(port->self, bytes, count);
  }
  return sent;
}

/* ---- who is there ---- */

static bool is_board(const hapi_spidar_frame *frame)
{
  const hapi_spidar_kind *kind = hapi_spidar_kind_find(frame->info[0]);
  if (kind == NULL || frame->info[1] != HAPI_SPIDAR_TARGETS) {
    return false;
  }
  /* Of the currents the firmware's word is not taken: some B5M say 8 and send none. */
  return frame->info[2] == kind->motors && frame->info[4] == kind->forces;
}

/* The model that a board of that id tells somewhere in these bytes; 0: it does not. Replies to what
 * was sent before, and garbage of boards that were just switched on, may be among them. */
static int find_answer(const uint8_t *bytes, int count, int id)
{
  hapi_spidar_frame frame;
  for (int i = 0; i + INFO_SIZE <= count; ++i) {
    if (bytes[i] == hapi_spidar_header(HAPI_SPIDAR_BOARD_INFO, id) &&
        hapi_spidar_decode(bytes + i, INFO_SIZE, ANY_MODEL, HAPI_SPIDAR_FROM_BOARD, &frame) &&
        is_board(&frame)) {
      return frame.info[0];
    }
  }
  return 0;
}

/* The model of the board, 0 when there is none, or -errno. */
static int await_answer(const hapi_spidar_port *port, int id)
{
  uint8_t bytes[256];
  int used = 0;
  double end = port->now(port->self) + ANSWER_S;
  for (;;) {
    double left = end - port->now(port->self);
    int count = port->receive(port->self, bytes + used, (int)sizeof bytes - used);
    if (count < 0) {
      return count;
    }
    used += count;
    int model = find_answer(bytes, used, id);
    if (model > 0) {
      return model;
    }
    if (used == (int)sizeof bytes) {
      used = INFO_SIZE - 1; /* an answer may have begun in the last of them */
      memmove(bytes, bytes + sizeof bytes - (size_t)used, (size_t)used);
    }
    if (count == 0 && left <= 0.0) {
      return 0;
    }
    if (count == 0) {
      port->await(port->self, left);
    }
  }
}

static int board_ask(const hapi_spidar_port *port, int id)
{
  /* The zeros before it end a command that a board may have received in part. */
  uint8_t bytes[HAPI_SPIDAR_FRAME_MAX + 1 + 26] = {0};
  bytes[HAPI_SPIDAR_FRAME_MAX] = hapi_spidar_header(HAPI_SPIDAR_BOARD_INFO, id);
  port->flush(port->self);
  int sent = send_patiently(port, bytes, (int)sizeof bytes);
  return sent < 0 ? sent : await_answer(port, id);
}

static hap_status fail_port(int error, hap_detail *detail)
{
  return hapi_fail(detail, HAP_ERROR_DEVICE, "the port failed: %s", strerror(-error));
}

/* Several times, as garbage may spoil an answer and a busy machine delay it. */
static int ask_often(const hapi_spidar_port *port, int id)
{
  int model = 0;
  for (int i = 0; i < TRIES && model == 0; ++i) {
    model = board_ask(port, id);
  }
  return model;
}

hap_status hapi_spidar_line_find(const hapi_spidar_port *port, hapi_spidar_boards *out,
                                 hap_detail *detail)
{
  memset(out, 0, sizeof *out);
  for (int id = 0; id < HAPI_SPIDAR_BOARDS; ++id) {
    int model = ask_often(port, id);
    if (model < 0) {
      return fail_port(model, detail);
    }
    if (model > 0) {
      out->id[out->count] = (uint8_t)id;
      out->model[out->count++] = (uint8_t)model;
    }
  }
  if (out->count == 0) {
    return hapi_fail(detail, HAP_ERROR_DEVICE,
                     "no motor board answers: is the SPIDAR switched on, is this its port?");
  }
  return HAP_OK;
}

int hapi_spidar_line_compare(const hapi_spidar_port *port, const hapi_spidar_boards *boards)
{
  for (int i = 0; i < boards->count; ++i) {
    int model = ask_often(port, boards->id[i]);
    if (model <= 0) {
      return model < 0 ? model : -EAGAIN;
    }
    if (model != boards->model[i]) {
      return 0;
    }
  }
  return 1;
}

/* ---- cycles ---- */

static int tell_lengths(const hapi_spidar_port *port, int id, int model)
{
  uint8_t bytes[64] = {0};
  hapi_spidar_frame frame = {.board = (uint8_t)id, .command = HAPI_SPIDAR_SET_CMDLEN};
  for (int command = 0; command < HAPI_SPIDAR_COMMANDS; ++command) {
    frame.lengths[command] = (uint8_t)hapi_spidar_length(model, command, HAPI_SPIDAR_TO_BOARD);
  }
  int count = hapi_spidar_encode(&frame, model, HAPI_SPIDAR_TO_BOARD, bytes);
  count += hapi_spidar_padding(model, HAPI_SPIDAR_SET_CMDLEN);
  return send_patiently(port, bytes, count + 5);
}

hap_status hapi_spidar_line_begin(hapi_spidar_line *line, const hapi_spidar_port *port,
                                  const hapi_spidar_boards *boards, double step_rate)
{
  memset(line, 0, sizeof *line);
  line->port = *port;
  line->step_rate = step_rate;
  line->waiting = -1.0;
  hapi_spidar_cycle_init(&line->cycle, boards);
  line->counts.motors = line->cycle.motors;
  for (int i = 0; i < boards->count; ++i) {
    if (tell_lengths(port, boards->id[i], boards->model[i]) < 0) {
      return HAP_ERROR_DEVICE;
    }
  }
  port->flush(port->self);
  return HAP_OK;
}

int hapi_spidar_line_send(hapi_spidar_line *line, const int16_t *currents)
{
  uint8_t bytes[HAPI_SPIDAR_COMMANDS_MAX];
  int count = hapi_spidar_cycle_commands(&line->cycle, currents, bytes);
  int sent = line->port.send(line->port.self, bytes, count);
  if (line->waiting < 0.0) {
    line->waiting = line->port.now(line->port.self);
  }
  return sent == -EAGAIN ? 0 : sent; /* a cycle without an answer, as others are */
}

static bool take_cycle(hapi_spidar_line *line, const int16_t *raw)
{
  double now = line->port.now(line->port.self);
  double most = STEP_LEAST + line->step_rate * (now - line->taken);
  int step_max = most < 32767.0 ? (int)most : 32767;
  if (!hapi_spidar_counts_advance(&line->counts, raw, step_max)) {
    ++line->bad_steps;
    return false;
  }
  line->bad_steps = 0;
  line->taken = now;
  line->waiting = -1.0;
  return true;
}

int hapi_spidar_line_receive(hapi_spidar_line *line)
{
  uint8_t bytes[sizeof line->cycle.bytes];
  int16_t raw[HAPI_SPIDAR_CYCLE_MOTORS];
  int count = line->port.receive(line->port.self, bytes, (int)sizeof bytes);
  if (count < 0) {
    return count;
  }
  hapi_spidar_cycle_push(&line->cycle, bytes, count);
  return hapi_spidar_cycle_take(&line->cycle, raw) && take_cycle(line, raw) ? 1 : 0;
}

double hapi_spidar_line_silence(const hapi_spidar_line *line)
{
  return line->waiting < 0.0 ? 0.0 : line->port.now(line->port.self) - line->waiting;
}

/* Sends again when nothing came: a command may have been lost. */
hap_status hapi_spidar_line_exchange(hapi_spidar_line *line, const int16_t *currents,
                                     double timeout)
{
  const hapi_spidar_port *port = &line->port;
  double end = port->now(port->self) + timeout;
  double again = 0.0;
  int taken = 0;
  while (taken == 0) {
    double now = port->now(port->self);
    if (now >= end) {
      return HAP_ERROR_TIMEOUT;
    }
    if (now >= again) {
      again = now + EXCHANGE_S;
      int sent = hapi_spidar_line_send(line, currents);
      if (sent < 0) {
        return HAP_ERROR_DEVICE;
      }
    }
    port->await(port->self, 0.5e-3);
    taken = hapi_spidar_line_receive(line);
  }
  return taken < 0 ? HAP_ERROR_DEVICE : HAP_OK;
}
