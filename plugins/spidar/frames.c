/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "plugins/spidar/frames.h"

#include <string.h>

/* By model number. That a B5M counts no current channels is meant: it never sends them. */
static const hapi_spidar_kind boards[] = {
    [1] = {"B1M", 4, 0, 0}, [2] = {"B1F", 3, 0, 2}, [3] = {"B2M", 4, 0, 0}, [4] = {"B2F", 3, 0, 2},
    [5] = {"B3M", 4, 4, 0}, [6] = {"B3F", 3, 3, 2}, [7] = {"B5M", 8, 0, 4},
};

#define MODELS ((int)(sizeof boards / sizeof boards[0]))

const hapi_spidar_kind *hapi_spidar_kind_find(int model)
{
  return model > 0 && model < MODELS ? &boards[model] : NULL;
}

int hapi_spidar_kind_number(const char *name, size_t length)
{
  for (int model = 1; model < MODELS; ++model) {
    if (strlen(boards[model].name) == length && memcmp(boards[model].name, name, length) == 0) {
      return model;
    }
  }
  return 0;
}

/* ---- layouts ---- */

/* How often a field is there. */
typedef enum repeat {
  ONE,
  SIX,
  ALL_COMMANDS,
  PER_MOTOR,
  PER_CURRENT,
  PER_FORCE,
  PER_FORCE_AND_MOTOR,
  LARGER_TARGET, /* of ALL: two values for each motor or one and the Jacobian */
  FOUR_PER_MOTOR /* bytes of a parameter */
} repeat;

typedef struct field {
  size_t offset; /* in hapi_spidar_frame */
  int size;      /* bytes of one */
  repeat repeat;
} field;

#define FIELD(member, size, repeat)                   \
  {                                                   \
    offsetof(hapi_spidar_frame, member), size, repeat \
  }
#define FIELDS_MAX 7
#define END FIELD(board, 0, ONE)
#define POSITION FIELD(position, 2, PER_MOTOR)
#define VELOCITY FIELD(velocity, 2, PER_MOTOR)
#define FORCE FIELD(force, 2, PER_FORCE)
#define COUNT FIELD(target_count, 1, ONE)
#define TICK FIELD(tick, 2, ONE)
#define PERIOD FIELD(period, 2, ONE)
#define JACOBIAN FIELD(jacobian, 2, PER_FORCE_AND_MOTOR)
#define TYPE FIELD(parameter_type, 1, ONE)
#define PARAMETER FIELD(parameter, 1, FOUR_PER_MOTOR)

static const field to_board[HAPI_SPIDAR_COMMANDS][FIELDS_MAX] = {
    [HAPI_SPIDAR_NONE] = {END},
    [HAPI_SPIDAR_BOARD_INFO] = {END},
    [HAPI_SPIDAR_SET_CMDLEN] = {FIELD(lengths, 1, ALL_COMMANDS), END},
    [HAPI_SPIDAR_ALL] = {FIELD(mode, 1, ONE), COUNT, PERIOD, FIELD(shared, 2, LARGER_TARGET), END},
    [HAPI_SPIDAR_SENSOR] = {END},
    [HAPI_SPIDAR_DIRECT] = {POSITION, VELOCITY, END},
    [HAPI_SPIDAR_CURRENT] = {FIELD(current, 2, PER_MOTOR), END},
    [HAPI_SPIDAR_INTERPOLATE] = {POSITION, PERIOD, COUNT, END},
    [HAPI_SPIDAR_FORCE_CONTROL] = {POSITION, JACOBIAN, PERIOD, COUNT, END},
    [HAPI_SPIDAR_SET_PARAM] = {TYPE, PARAMETER, END},
    [HAPI_SPIDAR_RESET_SENSOR] = {FIELD(flags, 2, ONE), END},
    [HAPI_SPIDAR_GET_PARAM] = {TYPE, END},
};

#define CURRENTS FIELD(current, 2, PER_CURRENT)

static const field from_board[HAPI_SPIDAR_COMMANDS][FIELDS_MAX] = {
    [HAPI_SPIDAR_BOARD_INFO] = {FIELD(info, 1, SIX), END},
    [HAPI_SPIDAR_ALL] = {FIELD(mode, 1, ONE), COUNT, TICK, POSITION, VELOCITY, CURRENTS, FORCE},
    [HAPI_SPIDAR_SENSOR] = {POSITION, CURRENTS, FORCE, END},
    [HAPI_SPIDAR_DIRECT] = {POSITION, VELOCITY, END},
    [HAPI_SPIDAR_CURRENT] = {POSITION, VELOCITY, FORCE, END},
    [HAPI_SPIDAR_INTERPOLATE] = {POSITION, TICK, COUNT, END},
    [HAPI_SPIDAR_FORCE_CONTROL] = {POSITION, TICK, COUNT, END},
    [HAPI_SPIDAR_GET_PARAM] = {TYPE, PARAMETER, END},
};

static int count_of(repeat how, const hapi_spidar_kind *kind)
{
  int jacobian = kind->forces * kind->motors;
  switch (how) {
    case ONE:
      return 1;
    case SIX:
      return 6;
    case ALL_COMMANDS:
      return HAPI_SPIDAR_COMMANDS;
    case PER_MOTOR:
      return kind->motors;
    case PER_CURRENT:
      return kind->currents;
    case PER_FORCE:
      return kind->forces;
    case PER_FORCE_AND_MOTOR:
      return jacobian;
    case LARGER_TARGET:
      return kind->motors + (jacobian > kind->motors ? jacobian : kind->motors);
    case FOUR_PER_MOTOR:
      return 4 * kind->motors;
  }
  return 0;
}

/* NULL: there is no such frame. The first field of a reply that is none has no size. */
static const field *layout_of(int command, hapi_spidar_direction direction)
{
  if (command < 0 || command >= HAPI_SPIDAR_COMMANDS) {
    return NULL;
  }
  if (direction == HAPI_SPIDAR_TO_BOARD) {
    return to_board[command];
  }
  return from_board[command][0].size > 0 ? from_board[command] : NULL;
}

int hapi_spidar_length(int model, int command, hapi_spidar_direction direction)
{
  const hapi_spidar_kind *kind = hapi_spidar_kind_find(model);
  const field *fields = layout_of(command, direction);
  if (kind == NULL || fields == NULL) {
    return 0;
  }
  int length = 1;
  for (int i = 0; i < FIELDS_MAX && fields[i].size > 0; ++i) {
    length += fields[i].size * count_of(fields[i].repeat, kind);
  }
  return length;
}

int hapi_spidar_padding(int model, int command)
{
  int there = hapi_spidar_length(model, command, HAPI_SPIDAR_TO_BOARD);
  int back = hapi_spidar_length(model, command, HAPI_SPIDAR_FROM_BOARD);
  int padding = back - there + 20;
  return padding > 5 ? padding : 5;
}

/* ---- frames and bytes ---- */

/* Number of values that lie in a row of the member: the Jacobian's rows are longer than a
 * board's. */
static int row_of(const field *f, const hapi_spidar_kind *kind)
{
  int count = count_of(f->repeat, kind);
  return f->repeat == PER_FORCE_AND_MOTOR ? kind->motors : count;
}

static size_t place_of(const field *f, int index, int row)
{
  int at = row > 0 && f->repeat == PER_FORCE_AND_MOTOR
               ? index / row * HAPI_SPIDAR_MOTORS + index % row
               : index;
  return f->offset + (size_t)(at * f->size);
}

int hapi_spidar_encode(const hapi_spidar_frame *frame, int model, hapi_spidar_direction direction,
                       uint8_t *out)
{
  int length = hapi_spidar_length(model, frame->command, direction);
  if (length == 0 || frame->board >= HAPI_SPIDAR_BOARDS) {
    return 0;
  }
  const hapi_spidar_kind *kind = hapi_spidar_kind_find(model);
  const field *f = layout_of(frame->command, direction);
  uint8_t *at = out;
  *at++ = hapi_spidar_header(frame->command, frame->board);
  for (; at < out + length; ++f) {
    int row = row_of(f, kind);
    for (int i = 0; i < count_of(f->repeat, kind); ++i) {
      const uint8_t *member = (const uint8_t *)frame + place_of(f, i, row);
      uint16_t word = *member;
      if (f->size == 2) {
        memcpy(&word, member, sizeof word);
      }
      *at++ = (uint8_t)word;
      if (f->size == 2) {
        *at++ = (uint8_t)(word >> 8);
      }
    }
  }
  return length;
}

bool hapi_spidar_decode(const uint8_t *bytes, size_t size, int model,
                        hapi_spidar_direction direction, hapi_spidar_frame *out)
{
  memset(out, 0, sizeof *out);
  if (size == 0) {
    return false;
  }
  int length = hapi_spidar_length(model, bytes[0] >> 3, direction);
  if (length == 0 || (size_t)length != size) {
    return false;
  }
  out->board = bytes[0] & 7;
  out->command = bytes[0] >> 3;
  const hapi_spidar_kind *kind = hapi_spidar_kind_find(model);
  const field *f = layout_of(out->command, direction);
  for (const uint8_t *at = bytes + 1; at < bytes + size; ++f) {
    int row = row_of(f, kind);
    for (int i = 0; i < count_of(f->repeat, kind); ++i) {
      uint8_t *member = (uint8_t *)out + place_of(f, i, row);
      if (f->size == 2) {
        uint16_t word = (uint16_t)(at[0] | at[1] << 8);
        memcpy(member, &word, sizeof word);
      } else {
        *member = *at;
      }
      at += f->size;
    }
  }
  return true;
}

/* ---- a stream of frames ---- */

void hapi_spidar_cutter_init(hapi_spidar_cutter *cutter, int model, hapi_spidar_direction direction)
{
  memset(cutter, 0, sizeof *cutter);
  for (int board = 0; board < HAPI_SPIDAR_BOARDS; ++board) {
    for (int command = 0; command < HAPI_SPIDAR_COMMANDS; ++command) {
      cutter->lengths[board][command] = (uint8_t)hapi_spidar_length(model, command, direction);
    }
  }
}

void hapi_spidar_cutter_set(hapi_spidar_cutter *cutter, int board,
                            const uint8_t lengths[HAPI_SPIDAR_COMMANDS])
{
  for (int command = 0; command < HAPI_SPIDAR_COMMANDS; ++command) {
    uint8_t length = lengths[command];
    cutter->lengths[board][command] =
        length < HAPI_SPIDAR_FRAME_MAX ? length : HAPI_SPIDAR_FRAME_MAX;
  }
}

void hapi_spidar_cutter_drop(hapi_spidar_cutter *cutter)
{
  cutter->have = 0;
  cutter->need = 0;
}

int hapi_spidar_cutter_push(hapi_spidar_cutter *cutter, uint8_t byte)
{
  if (cutter->need == 0) {
    int length = hapi_spidar_is_header(byte) ? cutter->lengths[byte & 7][byte >> 3] : 0;
    if (length == 0) {
      return 0;
    }
    cutter->need = length;
    cutter->have = 0;
  }
  cutter->bytes[cutter->have++] = byte;
  if (cutter->have < cutter->need) {
    return 0;
  }
  cutter->need = 0;
  return cutter->have;
}
