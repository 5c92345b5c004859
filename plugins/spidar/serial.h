/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_SPIDAR_SERIAL_H
#define HAPODE_PLUGINS_SPIDAR_SERIAL_H

/* A serial port of Linux, 2 Mbit/s, raw. */

#include <stdatomic.h>

#include "plugins/spidar/identity.h"
#include "plugins/spidar/line.h"

#define HAPI_SPIDAR_PATH_MAX 256

/* The descriptor has the same number from init to finish; while no port is open, it is /dev/null.
 * So a signal handler may write to it at any time and never reaches another file.
 *
 * A port that is nearly full takes a command in part. Boards take what comes next for the rest of
 * it, and the header of the next command for a current of some ten newtons. So one at a time
 * writes, and the rest goes out before anything else. Who cannot wait for another thread writes
 * all the same: what begins with zeros ends what was cut, and so does the next write behind it. */
typedef struct hapi_spidar_serial {
  int fd;
  _Atomic uintptr_t writer; /* the thread that writes, and has the rest; 0: none */
  _Atomic int forcing;      /* zeros that go out or wait: nobody else begins */
  _Atomic unsigned cuts;    /* that nobody has the rest of: of who did not wait, of another port */
  unsigned cuts_known;
  int rest_count;
  uint8_t rest[HAPI_SPIDAR_ZEROS_MAX + HAPI_SPIDAR_FRAME_MAX]; /* of what the port took in part */
  char path[HAPI_SPIDAR_PATH_MAX];
  hapi_spidar_identity identity; /* of the adapter, when boards were found behind it */
} hapi_spidar_serial;

HAP_NODISCARD hap_status hapi_spidar_serial_init(hapi_spidar_serial *serial, hap_detail *detail);
void hapi_spidar_serial_finish(hapi_spidar_serial *serial);

/* [control] Opens path for this process alone. HAP_ERROR_DEVICE with what is wrong and what to do;
 * what was open before stays open. Waits up to 0.5 s for another process to let go of it. */
HAP_NODISCARD hap_status hapi_spidar_serial_open(hapi_spidar_serial *serial, const char *path,
                                                 hap_detail *detail);
void hapi_spidar_serial_shut(hapi_spidar_serial *serial);

/* Its functions work on *serial. send and receive are those of a tick: one write(2), two where a
 * rest goes first, one read(2). What was taken in part counts as sent. At most
 * HAPI_SPIDAR_ZEROS_MAX + HAPI_SPIDAR_FRAME_MAX bytes. */
void hapi_spidar_serial_port(hapi_spidar_serial *serial, hapi_spidar_port *out);

/* [any, also a signal handler] Opens path for this process alone, without waiting. The caller
 * closes fd. 0 or -errno; -EWOULDBLOCK: another process has it. */
int hapi_spidar_serial_attach(hapi_spidar_serial *serial, const char *path);

/* [any, also a signal handler] Tries a few times when the port is being written to. False: the port
 * did not take all. At most HAPI_SPIDAR_ZEROS_MAX bytes, which begin with zeros. */
bool hapi_spidar_serial_force(hapi_spidar_serial *serial, const uint8_t *bytes, int count);

/* Latency timer of the port's USB adapter in ms; < 0: it has none that can be seen. */
int hapi_spidar_serial_latency(const char *path);

/* ---- ports.c ---- */

/* [control] Serial ports that a SPIDAR may be on, by number from 0, in path of
 * HAPI_SPIDAR_PATH_MAX. False: no more. The environment's HAPODE_SPIDAR_PORT comes first. */
bool hapi_spidar_port_at(int index, char *path);

#endif
