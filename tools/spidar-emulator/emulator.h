/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_SPIDAR_EMULATOR_H
#define HAPODE_TOOLS_SPIDAR_EMULATOR_H

/* A SPIDAR with its boards and a hand that holds it, in simulated time: bytes in, bytes out.
 * Without a port and without a clock, so that a test drives it as it likes. */

#include "plugins/virtual/motion.h"
#include "tools/spidar-emulator/grip.h"
#include "tools/spidar-emulator/wire.h"

#define EMULATOR_STEP_HZ 24000.0
#define EMULATOR_EVENTS_MAX 256

typedef enum emulator_hand {
  EMULATOR_HAND_PUSH, /* follows the path like a relaxed hand; at home while no motor pulls */
  EMULATOR_HAND_HOLD, /* the same, and the path stays at home */
  EMULATOR_HAND_NONE  /* the grip hangs free in its strings; no gravity */
} emulator_hand;

typedef struct emulator_def {
  const hapi_spidar_model *model; /* borrowed */
  int board_count;                /* whose motors are the model's strings */
  int board_model[HAPI_SPIDAR_BOARDS];
  int board_id[HAPI_SPIDAR_BOARDS];
  int32_t first_count; /* of all encoders at power-on */
  emulator_hand hand;
  /* of the hand, "T:x/y/z;...", m from home, repeated; NULL: to and fro along x */
  const char *path;
  const char *turn; /* of the hand, the same with rotation vectors in rad; NULL: not turned */
} emulator_def;

typedef enum emulator_action_kind {
  EMULATOR_FAULT,   /* fault */
  EMULATOR_SILENT,  /* board index number[0] (-1: all) is silent: number[1] */
  EMULATOR_LATE,    /* number[0] s */
  EMULATOR_GARBAGE, /* number[0] bytes */
  EMULATOR_UNPLUG,  /* for number[0] s; < 0: until PLUG */
  EMULATOR_PLUG,
  EMULATOR_POWER,    /* off and on */
  EMULATOR_REPORT,   /* board number[0] says it is model number[1] */
  EMULATOR_SATURATE, /* currents are clipped to number[0] */
  EMULATOR_FALSE,    /* the encoder of string number[0] (-1: all) is off by number[1] counts */
  EMULATOR_STUCK,    /* it stands still: number[1] */
  EMULATOR_PUSH,     /* number: N */
  EMULATOR_HAND,     /* number[0]: emulator_hand */
  EMULATOR_STATE,    /* of the program: says the state */
  EMULATOR_QUIT      /* of the program */
} emulator_action_kind;

typedef struct emulator_action {
  emulator_action_kind kind;
  wire_fault fault;
  double number[3];
} emulator_action;

/* Something that happens by itself. */
typedef struct emulator_event {
  double time; /* s */
  emulator_action action;
} emulator_event;

typedef struct emulator {
  const hapi_spidar_model *model;
  int32_t first_count;
  emulator_hand hand;
  wire wire;
  grip grip;
  hapi_motion path;
  hapi_motion turn;
  double drawn;   /* s, since when motors have been pulling; the hand's path begins then */
  double push[3]; /* N, on the grip, beside the hand */
  uint64_t steps; /* done */
  double next_tick[HAPI_SPIDAR_BOARDS];
  double home[HAPI_SPIDAR_STRINGS_MAX]; /* m, lengths at power-on */
  double pull[HAPI_SPIDAR_STRINGS_MAX]; /* N, of the motors */
  double pulled;                        /* N, largest force of all strings on the grip so far */
  bool plugged;
  double plug_time; /* s, when it is plugged in again; < 0: never by itself */
  uint32_t dice;
  emulator_event events[EMULATOR_EVENTS_MAX];
  int event_count;
  int event_next;
} emulator;

/* HAP_ERROR_ARGUMENT: the boards do not have as many motors as the model has strings, or the path
 * is wrong; HAP_ERROR_MEMORY. */
HAP_NODISCARD hap_status emulator_init(emulator *e, const emulator_def *def, hap_detail *detail);
void emulator_finish(emulator *e);

static inline double emulator_time(const emulator *e)
{
  return (double)e->steps / EMULATOR_STEP_HZ;
}

/* Goes on to time, in whole steps. */
void emulator_advance(emulator *e, double time);

/* Bytes from the host, at a time not before emulator_time; bytes to it. Unplugged, they are
 * lost. */
void emulator_write(emulator *e, const uint8_t *bytes, int count, double time);
int emulator_read(emulator *e, double time, uint8_t *out, int size);

/* Does it now. The program's own actions do nothing. */
void emulator_do(emulator *e, const emulator_action *action);

/* Does it at that time. False: no room, or there is a later one already. */
bool emulator_plan(emulator *e, double time, const emulator_action *action);

/* "state t=... ..." in one line, without its end. */
void emulator_say(const emulator *e, char *out, size_t size);

/* ---- commands.c ---- */

/* Reads a command, docs/spidar.md, "Emulator". HAP_ERROR_FORMAT with a sentence. */
HAP_NODISCARD hap_status emulator_parse(const emulator *e, const char *line, emulator_action *out,
                                        hap_detail *detail);

/* Plans a line "SECONDS COMMAND"; nothing for an empty line and one that begins with '#'. */
HAP_NODISCARD hap_status emulator_plan_line(emulator *e, const char *line, hap_detail *detail);

/* What all commands are, a line for each. */
extern const char emulator_help[];

#endif
