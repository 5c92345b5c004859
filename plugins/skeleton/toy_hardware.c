/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* ============ REPLACE all of this file by your hardware. ============
 *
 * A toy that lives in real time: a slider of 0.1 kg on each axis, 1 N s/m, stops at 50 mm on both
 * sides. Between two calls it moves as the current of its motor says. */

#define _POSIX_C_SOURCE 200809L /* clock_gettime */

#include "hardware.h"

#include <math.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define MASS 0.1       /* kg */
#define DAMPING 1.0    /* N s/m */
#define STOP 0.05      /* m */
#define COUNT 1e-5     /* m of a count */
#define NEWTON_MA 0.01 /* N of a milliampere */

struct hardware {
  bool enabled;
  int64_t time_ns;
  double position[3];
  double velocity[3];
  int16_t current[3];
  atomic_bool off; /* beside the currents: three numbers cannot be cleared in one step */
};

static int64_t clock_now(void)
{
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

hardware *hardware_open(char *why, size_t size)
{
  hardware *board = calloc(1, sizeof *board);
  if (board == NULL) {
    snprintf(why, size, "no memory for the toy");
    return NULL;
  }
  atomic_init(&board->off, true);
  board->time_ns = clock_now();
  return board;
}

void hardware_close(hardware *board)
{
  free(board);
}

bool hardware_enable(hardware *board)
{
  hardware_off(board);
  board->enabled = true;
  return true;
}

void hardware_disable(hardware *board)
{
  hardware_off(board);
  board->enabled = false;
}

void hardware_currents(const hardware *board, int16_t milliamperes[3])
{
  memcpy(milliamperes, board->current, sizeof board->current);
  if (atomic_load(&board->off)) {
    memset(milliamperes, 0, sizeof board->current);
  }
}

/* m v' = f - d v, solved exactly for a force that is constant. */
static void axis_slide(hardware *board, int axis, double force, double length)
{
  double end = force / DAMPING; /* the velocity that it tends to */
  double decay = exp(-length * DAMPING / MASS);
  double way = end * length + (board->velocity[axis] - end) * (1.0 - decay) * MASS / DAMPING;
  board->velocity[axis] = end + (board->velocity[axis] - end) * decay;
  board->position[axis] += way;
  if (fabs(board->position[axis]) > STOP) {
    board->position[axis] = copysign(STOP, board->position[axis]);
    board->velocity[axis] = 0.0;
  }
}

static void board_move(hardware *board)
{
  int64_t now_ns = clock_now();
  int16_t current[3];
  hardware_currents(board, current);
  for (int axis = 0; axis < 3; ++axis) {
    axis_slide(board, axis, NEWTON_MA * current[axis], 1e-9 * (double)(now_ns - board->time_ns));
  }
  board->time_ns = now_ns;
}

bool hardware_read(hardware *board, int32_t counts[3])
{
  board_move(board);
  for (int axis = 0; axis < 3; ++axis) {
    counts[axis] = (int32_t)lround(board->position[axis] / COUNT);
  }
  return board->enabled;
}

bool hardware_write(hardware *board, const int16_t milliamperes[3])
{
  board_move(board); /* up to now with the currents before */
  memcpy(board->current, milliamperes, sizeof board->current);
  atomic_store(&board->off, false);
  return board->enabled;
}

void hardware_off(hardware *board)
{
  atomic_store(&board->off, true);
}
