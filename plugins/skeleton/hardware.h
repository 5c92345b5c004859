/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef SKELETON_HARDWARE_H
#define SKELETON_HARDWARE_H

/* ============ REPLACE: what stands behind these functions is your hardware. ============
 *
 * In the skeleton it is a simulated toy (toy_hardware.c): three sliding axes, each with a motor and
 * an encoder, that nobody holds. The units of the hardware, counts and milliamperes, end here:
 * skeleton.c turns them into metres and newtons. */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct hardware hardware;

/* Finds the board and talks to it; motors stay off. NULL: why says, in size bytes, what is wrong
 * and what to do. May block. */
hardware *hardware_open(char *why, size_t size);
void hardware_close(hardware *board);

/* Motors on, at zero current; false: the board does not answer. May block. Also opens anew what was
 * lost. */
bool hardware_enable(hardware *board);
void hardware_disable(hardware *board); /* may block */

/* [haptic] Newest counts of the encoders; false: the board does not answer. Never blocks: no answer
 * within a fraction of a tick is none. */
bool hardware_read(hardware *board, int32_t counts[3]);

/* [haptic] Currents that the motors hold from now on; false: the board does not answer. */
bool hardware_write(hardware *board, const int16_t milliamperes[3]);

/* [any, also a signal handler] Currents to zero at once. Nothing but a store to an atomic or a
 * single write(2) of bytes that were prepared before: no lock, no printf, no malloc. */
void hardware_off(hardware *board);

/* What the motors were told last. */
void hardware_currents(const hardware *board, int16_t milliamperes[3]);

#endif
