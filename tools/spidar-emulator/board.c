/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/spidar-emulator/board.h"

#include <string.h>

#define TURN 1024 /* counts of a magnetic turn, which a reset of the sensor leaves */
#define B5M 7
#define TICK_HZ 3000.0
#define TICK_HZ_B5M 5560.0
#define GAIN_SHIFT 4 /* of the position control: k and b count sixteenths */

void board_init(board *b, int id, int model, int32_t counts)
{
  memset(b, 0, sizeof *b);
  b->id = id;
  b->model = b->reported = model;
  b->current_limit = BOARD_CURRENT_MAX;
  b->mode = BOARD_CURRENT;
  b->pending_due = -1.0;
  b->dice = 12345u + (uint32_t)id;
  hapi_spidar_cutter_init(&b->cutter, model, HAPI_SPIDAR_TO_BOARD);
  for (int i = 0; i < HAPI_SPIDAR_MOTORS; ++i) {
    b->counts[i] = counts;
    b->parameters[HAPI_SPIDAR_PARAMETER_PD][2 * i] = 16;
  }
}

double board_tick_hz(const board *b)
{
  return b->model == B5M ? TICK_HZ_B5M : TICK_HZ;
}

int16_t board_position(const board *b, int motor)
{
  int32_t told = b->counts[motor] + b->lies.false_by[motor];
  return (int16_t)(uint16_t)(uint32_t)(told - b->origin[motor]);
}

/* ---- replies ---- */

static void fill_info(const board *b, hapi_spidar_frame *frame)
{
  const hapi_spidar_kind *kind = hapi_spidar_kind_find(b->reported);
  uint8_t currents = (uint8_t)(b->reported == B5M ? 8 : kind->currents); /* some firmware does */
  const uint8_t info[6] = {(uint8_t)b->reported,  HAPI_SPIDAR_TARGETS,
                           (uint8_t)kind->motors, currents,
                           (uint8_t)kind->forces, 0};
  memcpy(frame->info, info, sizeof info);
}

/* From the state as it is now, before the command. */
static void fill_reply(const board *b, int command, hapi_spidar_frame *out)
{
  memset(out, 0, sizeof *out);
  out->board = (uint8_t)b->id;
  out->command = (uint8_t)command;
  out->mode = (uint8_t)b->mode;
  out->target_count = b->target_count;
  out->tick = b->tick;
  for (int i = 0; i < HAPI_SPIDAR_MOTORS; ++i) {
    out->position[i] = board_position(b, i);
  }
  memcpy(out->velocity, b->velocity, sizeof out->velocity);
  memcpy(out->current, b->output, sizeof out->current);
  memcpy(out->force, b->force, sizeof out->force);
  out->parameter_type = b->asked;
  memcpy(out->parameter, b->parameters[b->asked], sizeof out->parameter);
  if (command == HAPI_SPIDAR_BOARD_INFO) {
    fill_info(b, out);
  }
}

static double reply_delay(board *b)
{
  b->dice = b->dice * 1664525u + 1013904223u;
  double share = (double)(b->dice >> 8) / (double)(1u << 24);
  return BOARD_REPLY_MIN_S + share * (BOARD_REPLY_MAX_S - BOARD_REPLY_MIN_S);
}

static bool begin_reply(board *b, double header_time, double time, board_reply *out)
{
  hapi_spidar_frame frame;
  fill_reply(b, b->cutter.bytes[0] >> 3, &frame);
  out->size = hapi_spidar_encode(&frame, b->model, HAPI_SPIDAR_FROM_BOARD, out->bytes);
  double start = header_time + reply_delay(b);
  out->start = start > time ? start : time;
  return out->size > 0;
}

/* ---- commands ---- */

static int16_t current_clip(const board *b, int value)
{
  int limit = b->current_limit;
  return (int16_t)(value > limit ? limit : value < -limit ? -limit : value);
}

static void take_all(board *b, const hapi_spidar_frame *frame)
{
  const hapi_spidar_kind *kind = hapi_spidar_kind_find(b->model);
  if (frame->mode == BOARD_SKIP || frame->mode > BOARD_FORCE_CONTROL) {
    return;
  }
  b->mode = (board_mode)frame->mode;
  for (int i = 0; i < kind->motors; ++i) {
    if (b->mode == BOARD_CURRENT) {
      b->current[i] = current_clip(b, frame->shared[i]);
    } else {
      b->target[i] = frame->shared[i];
      b->target_velocity[i] = 0;
      if (b->mode == BOARD_DIRECT) {
        b->target_velocity[i] = frame->shared[kind->motors + i];
      }
    }
  }
}

static void take_targets(board *b, const hapi_spidar_frame *frame, board_mode mode)
{
  b->mode = mode;
  memcpy(b->target, frame->position, sizeof b->target);
  memcpy(b->target_velocity, frame->velocity, sizeof b->target_velocity);
  b->target_count = frame->target_count;
}

static void set_parameter(board *b, const hapi_spidar_frame *frame)
{
  if (frame->parameter_type < HAPI_SPIDAR_PARAMETERS) {
    memcpy(b->parameters[frame->parameter_type], frame->parameter, sizeof frame->parameter);
  }
}

static void reset_sensor(board *b, int flags)
{
  for (int i = 0; i < HAPI_SPIDAR_MOTORS && (flags & 1) != 0; ++i) {
    int32_t within = (b->counts[i] % TURN + TURN) % TURN;
    b->origin[i] = b->counts[i] - within;
  }
  if ((flags & 2) != 0) {
    memset(b->force, 0, sizeof b->force);
  }
}

static void command_execute(board *b)
{
  const hapi_spidar_frame *frame = &b->pending;
  ++b->executed;
  switch ((hapi_spidar_command)frame->command) {
    case HAPI_SPIDAR_NONE:
    case HAPI_SPIDAR_BOARD_INFO:
    case HAPI_SPIDAR_SENSOR:
    case HAPI_SPIDAR_SET_CMDLEN: /* taken as it came */
      break;
    case HAPI_SPIDAR_ALL:
      take_all(b, frame);
      break;
    case HAPI_SPIDAR_CURRENT:
      b->mode = BOARD_CURRENT;
      for (int i = 0; i < HAPI_SPIDAR_MOTORS; ++i) {
        b->current[i] = current_clip(b, frame->current[i]);
      }
      break;
    case HAPI_SPIDAR_DIRECT:
      take_targets(b, frame, BOARD_DIRECT);
      break;
    case HAPI_SPIDAR_INTERPOLATE:
      take_targets(b, frame, BOARD_INTERPOLATE);
      break;
    case HAPI_SPIDAR_FORCE_CONTROL:
      take_targets(b, frame, BOARD_FORCE_CONTROL);
      break;
    case HAPI_SPIDAR_SET_PARAM:
      set_parameter(b, frame);
      break;
    case HAPI_SPIDAR_RESET_SENSOR:
      reset_sensor(b, frame->flags);
      break;
    case HAPI_SPIDAR_GET_PARAM:
      b->asked = frame->parameter_type < HAPI_SPIDAR_PARAMETERS ? frame->parameter_type : 0;
      break;
  }
}

void board_run(board *b, double time)
{
  if (b->pending_due >= 0.0 && b->pending_due <= time) {
    b->pending_due = -1.0;
    command_execute(b);
  }
}

/* Every board keeps the lengths of every other one. */
static void learn_lengths(board *b, int whose)
{
  hapi_spidar_cutter_set(&b->cutter, whose, b->cutter.bytes + 1);
}

static void command_complete(board *b, int size, double time)
{
  int whose = b->cutter.bytes[0] & 7;
  int command = b->cutter.bytes[0] >> 3;
  if (command == HAPI_SPIDAR_SET_CMDLEN && size == 1 + HAPI_SPIDAR_COMMANDS) {
    learn_lengths(b, whose);
  }
  if (whose != b->id) {
    return;
  }
  /* One buffer: what was not executed yet is lost. */
  if (hapi_spidar_decode(b->cutter.bytes, (size_t)size, b->model, HAPI_SPIDAR_TO_BOARD,
                         &b->pending)) {
    b->pending_due = time + BOARD_EXECUTE_S;
  }
}

/* True: a reply of its own begins. */
static bool take_byte(board *b, uint8_t byte, double header_time, double time, board_reply *out)
{
  bool header = b->cutter.need == 0;
  int size = hapi_spidar_cutter_push(&b->cutter, byte);
  bool mine = (byte & 7) == b->id;
  bool replies =
      header && (size > 0 || b->cutter.need > 0) && mine && begin_reply(b, header_time, time, out);
  if (size > 0) {
    command_complete(b, size, time);
  }
  return replies;
}

bool board_receive(board *b, uint8_t byte, double time, board_reply *out)
{
  bool replies = false;
  b->fifo.bytes[b->fifo.have] = byte;
  b->fifo.times[b->fifo.have++] = time;
  if (b->fifo.have < BOARD_FIFO) {
    return false;
  }
  board_run(b, time);
  for (int i = 0; i < BOARD_FIFO; ++i) {
    /* Two headers within six bytes: the second one's reply overwrites the first. */
    board_reply reply;
    if (take_byte(b, b->fifo.bytes[i], b->fifo.times[i], time, &reply)) {
      *out = reply;
      replies = true;
    }
  }
  b->fifo.have = 0;
  return replies;
}

/* ---- control ---- */

static int16_t word_read(const uint8_t *bytes)
{
  return (int16_t)(uint16_t)(bytes[0] | bytes[1] << 8);
}

/* Position control goes to the newest target at once; only its signs and sizes are the
 * firmware's. */
static int16_t motor_control(const board *b, int motor, int motors)
{
  const uint8_t *gains = b->parameters[HAPI_SPIDAR_PARAMETER_PD];
  int k = word_read(gains + (size_t)2 * (size_t)motor);
  int d = word_read(gains + (size_t)2 * (size_t)(motors + motor));
  int off = (int16_t)(uint16_t)((uint16_t)b->target[motor] - (uint16_t)board_position(b, motor));
  int slow = b->target_velocity[motor] - b->velocity[motor];
  return current_clip(b, (k * (off >> GAIN_SHIFT)) + (d * slow >> GAIN_SHIFT));
}

void board_tick(board *b, const int32_t counts[HAPI_SPIDAR_MOTORS])
{
  int motors = hapi_spidar_kind_find(b->model)->motors;
  ++b->tick;
  for (int i = 0; i < motors; ++i) {
    int32_t now = b->lies.stuck[i] ? b->counts[i] : counts[i];
    b->velocity[i] = (int16_t)(now - b->counts[i]);
    b->counts[i] = now;
    b->output[i] = b->current[i];
    if (b->mode != BOARD_CURRENT) {
      b->output[i] = motor_control(b, i, motors);
    }
  }
}
