/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_RECORD_CELL_H
#define HAPODE_RECORD_CELL_H

/* What a recording is made of: cells of one size, in three streams, one for each thread that
 * writes. A packet is one cell that says how many follow, and those. docs/recording.md has the
 * table. */

#include <assert.h>
#include <stdint.h>
#include <string.h>

#include <hapode/outputs.h>

#include "base/assert.h"
#include "base/force_setup.h"
#include "base/grab_setup.h"
#include "base/hash.h"
#include "base/pace.h"
#include "base/pointer_setup.h"

typedef enum hapi_stream {
  HAPI_STREAM_HAPTIC = 0,
  HAPI_STREAM_PHYSICS = 1,
  HAPI_STREAM_CONTACT = 2,
  HAPI_STREAMS = 3
} hapi_stream;

/* Values are of the file. */
typedef enum hapi_cell_kind {
  /* haptic: BEGIN or TICK, and what follows in this order */
  HAPI_CELL_BEGIN = 1, /* before the first tick. i[0]: time of the pointers' first read */
  HAPI_CELL_TICK = 2,  /* hapi_tick_word */
  HAPI_CELL_LEAVE = 3, /* a pointer has gone */
  HAPI_CELL_JOIN = 4,  /* a pointer comes: HAPI_JOIN_CELLS of them, see hapi_joined */
  HAPI_CELL_POSE = 5,  /* read: d[0..2] position, d[3..6] quaternion; word: buttons */
  HAPI_CELL_TWIST = 6, /* read: d[0..5] */
  HAPI_CELL_FORCE = 7, /* to be written: d[0..2] force, d[3..5] torque; u[6]: hash of the pointer */
  HAPI_CELL_REACHED = 8, /* what the device made of it, where that is something else */
  HAPI_CELL_BODY = 9,    /* d[0..2] position, d[3..6] quaternion; word: slot */
  HAPI_CELL_HULL = 10,   /* behind the JOINs of a pointer that is one: d[0..2] a vertex, d[3..5] the
                            next one */
  HAPI_CELL_SET = 11,    /* before the POSE: HAPI_SET_CELLS of them, a hapi_pointer_setting; then
                            HULLs where it has a hull */
  HAPI_CELL_OWN =
      12, /* an own force is set: HAPI_OWN_CELLS of them, a hapi_force_setup; word: its place */
  HAPI_CELL_SAMPLES = 13, /* behind the OWNs of a vibration that has them: floats */
  HAPI_CELL_CALL = 14, /* what the call of an own force gave: d[0..2] force, d[3..5] torque; word:
                          the force's place; flags: hap_force_out */
  HAPI_CELL_GRAB = 15, /* before the POSE: HAPI_GRAB_CELLS of them, a hapi_grab_setup */
  HAPI_CELL_OUTPUTS = 25, /* before the POSE: HAPI_OUTPUTS_CELLS of them, a hap_pointer_outputs */
  HAPI_CELL_AXIS = 26,    /* behind the JOINs and HULLs, for each axis of the device: d[0] low, d[1]
                          high, d[2] max_force; word: kind, and from the second byte on the unit */
  HAPI_CELL_AXES = 27,    /* behind the TWIST: values, then rates, of all axes of the pointer */
  /* physics: WORLD, then CYCLE and CYCLED in turn, the one at the begin and the other at the end */
  HAPI_CELL_WORLD =
      16, /* hapi_world_word; flags: hap_model, and in the high byte the position of the dials + 1;
             word: effects wished for, at the start */
  HAPI_CELL_CYCLE = 17,  /* hapi_cycle_word; word: edits that were run; flags: hap_model wanted */
  HAPI_CELL_CYCLED = 18, /* hapi_cycled_word; flags: hap_model wanted then, of the next cycle */
  /* behind a WORLD, CYCLED or PASS of index 1, with as many VERDICT cells behind it as its word
     says: record/verdict_cells.h */
  HAPI_CELL_VERDICTS = 19, /* hapi_verdicts_word */
  HAPI_CELL_VERDICT = 20,
  /* contact, each a packet with its verdicts */
  HAPI_CELL_PASS = 24 /* hapi_pass_word */
} hapi_cell_kind;

/* Places in u of a cell of that kind. Numbers of messages: the first one of a mailbox is 1; 0: none
 * was taken. */
typedef enum hapi_tick_word {
  HAPI_TICK_WINDOW = 0, /* number of the tick; those left out were missed */
  HAPI_TICK_TIME = 1,   /* ns, the tick's own */
  HAPI_TICK_MODEL = 2,  /* message taken at its begin */
  HAPI_TICK_PATCHES = 3,
  HAPI_TICK_HASH = 4, /* of all pointers and local bodies after it */
  HAPI_TICK_BODIES = 5,
  HAPI_TICK_TEXTURES = 6 /* a bit for each texture whose function is out */
} hapi_tick_word;

typedef enum hapi_world_word {
  HAPI_WORLD_TIME = 0, /* ns, of tick 0 */
  HAPI_WORLD_SEED = 1, /* of ODE */
  HAPI_WORLD_HASH = 2,
  HAPI_WORLD_BODIES = 3,
  HAPI_WORLD_JOINTS = 4,
  HAPI_WORLD_GEOMS = 5,     /* low half; high half: the time scale, as in HAPI_CYCLE_DROPPED */
  HAPI_WORLD_MODEL_HASH = 6 /* of the first local model */
} hapi_world_word;

typedef enum hapi_cycle_word {
  HAPI_CYCLE_TIME = 0,  /* ns */
  HAPI_CYCLE_NEXT = 1,  /* ns */
  HAPI_CYCLE_STATE = 2, /* message taken */
  HAPI_CYCLE_SEED = 3,  /* of ODE */
  HAPI_CYCLE_LOCKS =
      4, /* low half: hap_session_lock since the cycle before; high half: effects wished
                            for, as in base/wishes.h */
  HAPI_CYCLE_MISSED = 5, /* low half: steps, likewise; high half: hapi_cycle_dials */
  HAPI_CYCLE_DROPPED = 6 /* low half: in drive FRAME, steps that frames had too much, likewise; high
                            half: the time scale as a float, its bits against those of 1 */
} hapi_cycle_word;

/* Positions of the dials of a cycle [percent], each + 1 in a byte; 0, of a recording without: the
 * default. */
#define HAPI_DIAL_OF_NONE 50

static inline int hapi_cell_dial(uint64_t word, unsigned shift)
{
  HAPI_ASSERT(shift <= 56u);
  int percent = (int)(word >> shift & 0xffu) - 1;
  return percent < 0 || percent > 100 ? HAPI_DIAL_OF_NONE : percent;
}

/* Behind them the pace of ticks, + 64 in a byte, and their margin in another one; 0, of a recording
 * without: the pace 0. */
#define HAPI_PACE_SHIFT 48u
#define HAPI_PACE_ZERO 64

static inline uint64_t hapi_pace_cell(int pace, int margin)
{
  uint64_t low = (unsigned)(pace + HAPI_PACE_ZERO) & 0xffu;
  return (low | (uint64_t)((unsigned)margin & 0xffu) << 8) << HAPI_PACE_SHIFT;
}

static inline void hapi_cell_pace(uint64_t word, int *out_pace, int *out_margin)
{
  int pace = (int)(word >> HAPI_PACE_SHIFT & 0xffu) - HAPI_PACE_ZERO;
  int margin = (int)(word >> (HAPI_PACE_SHIFT + 8) & 0xffu);
  *out_pace = pace < HAPI_PACE_LEAST || pace > HAPI_PACE_MOST ? 0 : pace;
  *out_margin = margin > HAPI_MARGIN_MOST ? 0 : margin;
}

typedef enum hapi_cycled_word {
  HAPI_CYCLED_MODEL = 0, /* number of the local model; 0: the world was not sound, and none came */
  HAPI_CYCLED_HASH = 1,  /* of it */
  HAPI_CYCLED_SENT = 2   /* ns, drive FRAME: when it was told to the loop; else 0 */
} hapi_cycled_word;

typedef enum hapi_pass_word {
  HAPI_PASS_NUMBER = 0,
  HAPI_PASS_POSES = 1, /* messages in use */
  HAPI_PASS_NEAR = 2,
  HAPI_PASS_VALID = 3, /* ns, from which the loop may use it */
  HAPI_PASS_HASH = 4
} hapi_pass_word;

#define HAPI_VERDICTS_MOST (1u << 19) /* cells: a reader has room for twice as many */

typedef enum hapi_verdicts_word {
  HAPI_VERDICTS_COUNT = 0,
  HAPI_VERDICTS_OWN = 1 /* surfaces */
} hapi_verdicts_word;

enum {
  /* of TICK */
  HAPI_CELL_RESET = 1,     /* the fault was reset */
  HAPI_CELL_EMERGENCY = 2, /* hap_emergency_zero had been called */
  HAPI_CELL_BLOCKED = 4, /* a watchdog had taken the force off; the high byte: 1 + the index of the
                              pointer in whose device the loop was, 0: none */
  HAPI_CELL_BLOCKED_POINTER_SHIFT = 8,
  /* of POSE and FORCE */
  HAPI_CELL_FAILED = 1,  /* the device did not answer, or did not take it */
  HAPI_CELL_DOUBTED = 2, /* of POSE: it does not believe what it measures */
  /* of LEAVE */
  HAPI_CELL_PAUSES = 1 /* its device is being started again, and its id stays valid */
};

typedef struct hapi_cell {
  uint8_t kind;
  uint8_t index;  /* of a pointer; TICK: hap_fault that another thread wants latched; WORLD, CYCLED,
                     PASS: 1: verdicts follow */
  uint16_t flags; /* HAPI_CELL_* */
  uint32_t word;  /* BEGIN, TICK: cells that follow in the packet */
  union {
    double d[7];
    uint64_t u[7];
    int64_t i[7];
  };
} hapi_cell;

static_assert(sizeof(hapi_cell) == 64, "the file's");

/* A device as the file has it. */
typedef struct hapi_joined_device {
  char name[64];
  uint32_t dof;
  double max_force; /* this and the others: as in hap_device_info */
  double max_torque;
  double rated_stiffness;
  double damping;
  double quantum;
  double mass;
  double friction;
  double delay;
  uint32_t measures_velocity;
} hapi_joined_device;

/* A pointer as the loop takes it in. */
typedef struct hapi_joined {
  hapi_pointer_setup def; /* device and hull_xyz NULL */
  hapi_joined_device device;
  uint32_t generation;
  uint32_t has_device;
} hapi_joined;

#define HAPI_CELL_BYTES (sizeof(((hapi_cell *)0)->d))
#define HAPI_CELL_NUMBERS 7u
#define HAPI_JOIN_CELLS 8u
#define HAPI_CELL_BODIES 16u /* of a tick; of more bodies one part after the other, tick by tick */

static_assert(sizeof(hapi_joined) <= HAPI_JOIN_CELLS * HAPI_CELL_BYTES, "room in the cells");

#define HAPI_SET_CELLS 6u

static_assert(sizeof(hapi_pointer_setting) <= HAPI_SET_CELLS * HAPI_CELL_BYTES,
              "room in the cells");

#define HAPI_OWN_CELLS 5u

static_assert(sizeof(hapi_force_setup) <= HAPI_OWN_CELLS * HAPI_CELL_BYTES, "room in the cells");

#define HAPI_OUTPUTS_CELLS 9u

static_assert(sizeof(hap_pointer_outputs) <= HAPI_OUTPUTS_CELLS * HAPI_CELL_BYTES,
              "room in the cells");

#define HAPI_AXES_CELLS ((2u * HAP_AXES_MAX + HAPI_CELL_NUMBERS - 1u) / HAPI_CELL_NUMBERS)

#define HAPI_GRAB_CELLS 3u

static_assert(sizeof(hapi_grab_setup) <= HAPI_GRAB_CELLS * HAPI_CELL_BYTES, "room in the cells");

#define HAPI_HULL_CELLS(points) (((uint32_t)(points) + 1u) / 2u)
#define HAPI_CELL_SAMPLE_COUNT 14u /* floats of a cell */
#define HAPI_SAMPLES_CELLS(samples) \
  (((uint32_t)(samples) + HAPI_CELL_SAMPLE_COUNT - 1u) / HAPI_CELL_SAMPLE_COUNT)

/* Of a tick with everything in it; 64 vertices are the most, and one set of samples is taken. */
#define HAPI_PACKET_MAX                                                             \
  (1u +                                                                             \
   16u * (1u + HAPI_JOIN_CELLS + 2u * HAPI_HULL_CELLS(64u) + HAPI_SET_CELLS +       \
          HAP_FORCES_MAX * (HAPI_OWN_CELLS + 1u) + HAPI_GRAB_CELLS + HAP_AXES_MAX + \
          HAPI_AXES_CELLS + HAPI_OUTPUTS_CELLS + 4u) +                              \
   HAPI_SAMPLES_CELLS(HAP_FORCE_SAMPLES_MAX) + HAPI_CELL_BODIES)

#endif
