/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_SPIDAR_LINE_H
#define HAPODE_PLUGINS_SPIDAR_LINE_H

/* The boards behind a port: who is there, and one exchange with all of them a tick. */

#include <hapode/status.h>

#include "plugins/spidar/cycle.h"

/* A port. Nothing of it waits but await; times are in s, of any clock. */
typedef struct hapi_spidar_port {
  void *self;
  /* All bytes or none: 0, or -errno; -EAGAIN: the port cannot take them now. */
  int (*send)(void *self, const uint8_t *bytes, int count);
  /* Bytes that are there, at most size; 0: none; -errno. A line that was hung up: -EIO. */
  int (*receive)(void *self, uint8_t *bytes, int size);
  /* Until something is there or the time is over. */
  void (*await)(void *self, double seconds);
  double (*now)(void *self);
  /* Throws away what was received. */
  void (*flush)(void *self);
} hapi_spidar_port;

typedef struct hapi_spidar_line {
  hapi_spidar_port port;
  hapi_spidar_cycle cycle;
  hapi_spidar_counts counts;
  double step_rate;   /* counts/s that a string may do; a faster one is a wrong reply */
  double taken;       /* s, of the newest good reply */
  double waiting;     /* s, of the oldest command without an answer; < 0: there is none */
  uint32_t bad_steps; /* replies in a row that jumped */
} hapi_spidar_line;

/* [control] Asks all ids for a board, which takes some 200 ms. HAP_ERROR_DEVICE: none, or the port
 * failed; detail says which. */
HAP_NODISCARD hap_status hapi_spidar_line_find(const hapi_spidar_port *port,
                                               hapi_spidar_boards *out, hap_detail *detail);

/* [any, also a signal handler] Asks the ids of the boards, and no others. 1: they answer as those
 * models; 0: another one answers for one of them; -EAGAIN: one does not answer; -errno. */
int hapi_spidar_line_compare(const hapi_spidar_port *port, const hapi_spidar_boards *boards);

/* [control] Tells all boards the lengths of each other's commands, and makes ready for cycles. */
HAP_NODISCARD hap_status hapi_spidar_line_begin(hapi_spidar_line *line,
                                                const hapi_spidar_port *port,
                                                const hapi_spidar_boards *boards, double step_rate);

/* [haptic] Sends a current to each motor, in the order of board ids and channels. 0 or -errno. */
int hapi_spidar_line_send(hapi_spidar_line *line, const int16_t *currents);

/* [haptic] 1: line->counts are new; 0: no good reply has come; -errno. */
int hapi_spidar_line_receive(hapi_spidar_line *line);

/* s since a command has been waiting for a good answer; 0: none does. */
double hapi_spidar_line_silence(const hapi_spidar_line *line);

/* [control] One exchange, at most timeout s. HAP_ERROR_TIMEOUT, HAP_ERROR_DEVICE. */
HAP_NODISCARD hap_status hapi_spidar_line_exchange(hapi_spidar_line *line, const int16_t *currents,
                                                   double timeout);

#endif
