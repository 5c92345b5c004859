/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_SPIDAR_SPIDAR_H
#define HAPODE_PLUGINS_SPIDAR_SPIDAR_H

/* The device: open.c finds the port and the boards and reads the arguments, spidar.c does the
 * ticks. */

#include <hapode/device_impl.h>

#include "plugins/spidar/belief.h"
#include "plugins/spidar/calibration.h"
#include "plugins/spidar/guard.h"
#include "plugins/spidar/serial.h"
#include "plugins/spidar/tensions.h"

/* Why the device does not work. */
typedef enum hapi_spidar_cause {
  HAPI_SPIDAR_WELL,
  HAPI_SPIDAR_HUNG_UP,     /* the port is gone */
  HAPI_SPIDAR_SILENT,      /* no whole answer for longer than the timeout */
  HAPI_SPIDAR_JUMPED,      /* positions that no string can have reached */
  HAPI_SPIDAR_MISFIT,      /* lengths that fit no pose, with all strings taut */
  HAPI_SPIDAR_STALLED,     /* the guard took the force off */
  HAPI_SPIDAR_UNGUARDED,   /* start: there is no guard process */
  HAPI_SPIDAR_GUARD_LOST,  /* the guard process has gone */
  HAPI_SPIDAR_NOT_OPENED,  /* start: the port does not open, or no board answers */
  HAPI_SPIDAR_OTHER_BOARDS /* start: not the boards that it was opened with */
} hapi_spidar_cause;

/* From the arguments. */
typedef struct hapi_spidar_settings {
  double timeout; /* s, of silence */
  double stall;   /* s, without a write, until the guard takes the force off; 0: no guard */
  double max_force;
  double max_torque;
  double offset[3]; /* where the model's origin is in the device's frame */
  double rotate[4]; /* the model's axes in it */
} hapi_spidar_settings;

/* Of the last failure since start, which may be over. */
typedef struct hapi_spidar_told {
  _Atomic int cause;  /* hapi_spidar_cause */
  _Atomic int string; /* MISFIT: which is wrong; < 0: none of them alone */
  _Atomic int off_um; /* by how much */
} hapi_spidar_told;

/* When the loop reads. */
typedef struct hapi_spidar_reads {
  int64_t newest_ns; /* < 0: there was none since start */
  double gap;        /* s, from the one before */
  double late;       /* s, for which the believed pose is carried on: the loop was late */
} hapi_spidar_reads;

typedef struct hapi_spidar_device {
  hapi_spidar_serial serial;
  hapi_spidar_guard guard;
  hapi_spidar_boards boards;
  hapi_spidar_line line;
  hapi_spidar_model model;
  bool model_calibrated; /* by a file: else the grip is taken to be at home at the first start */

  hapi_spidar_settings settings;

  uint8_t zeros[HAPI_SPIDAR_ZEROS_MAX]; /* takes the force off; never changes after open */
  int zero_count;

  /* Ticks. */
  bool running;
  bool asked;         /* a command went out since the newest read */
  atomic_bool zeroed; /* raised by zero, lowered by write */
  _Atomic int cause;  /* hapi_spidar_cause, of now */
  hapi_spidar_told told;
  hapi_spidar_belief belief;
  hapi_spidar_reads reads;
  bool doubted; /* the newest reply, or a string of it */
  double poor;  /* s, when replies began to be doubted; < 0: they are not */
  double taut;  /* s, when the strings began to be pulled after a zero */
  hapi_spidar_tensions tensions;
  hapi_spidar_heat heat;
  double written; /* s, of the newest write; < 0: the strings had no tension before */
  int16_t current[HAPI_SPIDAR_STRINGS_MAX];
  double rest[HAPI_SPIDAR_STRINGS_MAX]; /* counts of current, that rounding left over */
  hap_wrench held;                      /* in the device's frame */
} hapi_spidar_device;

/* [control] open.c: reads the arguments, finds port and boards. On failure everything is to be
 * closed by hapi_spidar_release. */
HAP_NODISCARD hap_status hapi_spidar_configure(hapi_spidar_device *device, const char *args,
                                               hap_detail *detail);
void hapi_spidar_release(hapi_spidar_device *device);

/* [control] The part of start behind an open port: tells the boards their lengths, winds the
 * strings in, finds the grip. WELL: it runs. Else its caller lets go. */
hapi_spidar_cause hapi_spidar_begin(hapi_spidar_device *device, const hapi_spidar_port *port);

/* [control] At the next start the grip is at home, whatever a file said. Not while it is
 * started. */
void hapi_spidar_forget_home(hapi_spidar_device *device);

extern const hap_device_ops hapi_spidar_ops;

#endif
