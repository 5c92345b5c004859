/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_VIRTUAL_DELAY_H
#define HAPODE_PLUGINS_VIRTUAL_DELAY_H

/* A line of force commands, each of which acts a fixed time after it was given. Times in ns of the
 * device's timeline, never going back. */

#include <stdbool.h>
#include <stdint.h>

/* In flight at once: 0.1 s at 20 kHz are 2000. */
#define HAPI_DELAY_COMMANDS 4096

typedef struct hapi_delay_command {
  uint64_t due_ns;
  double force[3];
} hapi_delay_command;

typedef struct hapi_delay {
  uint64_t delay_ns;
  hapi_delay_command *commands; /* a ring; NULL without delay */
  uint32_t first;
  uint32_t count;
  double acting[3];
} hapi_delay;

/* [control] False: no memory. finish is good for a zeroed one. */
bool hapi_delay_init(hapi_delay *line, uint64_t delay_ns);
void hapi_delay_finish(hapi_delay *line);

/* Forgets all commands: no force acts. */
void hapi_delay_clear(hapi_delay *line);

/* A command given at now_ns. When the line is full, it takes the place of the last one. */
void hapi_delay_give(hapi_delay *line, uint64_t now_ns, const double force[3]);

/* Goes to now_ns; line->acting is then what acts from there to the time that is returned, the next
 * change, UINT64_MAX when there is none. */
uint64_t hapi_delay_take(hapi_delay *line, uint64_t now_ns);

#endif
