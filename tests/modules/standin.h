/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_MODULES_STANDIN_H
#define HAPODE_TESTS_MODULES_STANDIN_H

/* What tests tell the stand-ins of makers' libraries, and what these saw. A stand-in knows the
 * maker's published prototypes and this, and nothing of the devices that call it. With STANDIN_FILE
 * in the environment it lies in that file, and outlives the process. */

#include <stdatomic.h>
#include <stdint.h>

#define STANDIN_DEVICES 2

typedef enum standin_fault {
  STANDIN_WELL = 0,
  STANDIN_READ_FAILS,  /* positions; libHD: an error of communication at the end of a frame */
  STANDIN_FORCE_FAILS, /* dhd: the call fails; libHD: more than the largest force */
  STANDIN_WARM,        /* libHD: the motors */
  STANDIN_NAN,         /* positions */
  STANDIN_BAD_FRAME,   /* no rotation */
  STANDIN_SILENT,      /* dhd: always an old position; libHD: the scheduler calls nobody */
  STANDIN_HANGS,       /* a call does not come back until it is over */
  STANDIN_UNPLUGGED,   /* all calls fail, also opening */
  STANDIN_NOT_THERE,   /* no device */
  STANDIN_NO_POWER,    /* dhd */
  STANDIN_NOT_READY,   /* not calibrated */
  STANDIN_NOT_ENABLED, /* dhd: forces cannot be enabled */
  STANDIN_IN_USE       /* libHD: by another program */
} standin_fault;

typedef struct standin_device {
  _Atomic int fault;          /* standin_fault */
  _Atomic double position[3]; /* m: the middle */
  _Atomic double swing[3];    /* m, to and fro */
  _Atomic double turn[3];     /* rad, a rotation vector */
  _Atomic int buttons;
  _Atomic int late_ms; /* each call of a position waits so long */

  _Atomic int opened;      /* now */
  _Atomic int opens;       /* so far */
  _Atomic int enabled;     /* forces */
  _Atomic double force[3]; /* N, what acts */
  _Atomic double torque[3];
  _Atomic uint64_t forces; /* that were set */
  _Atomic uint64_t pushes; /* of those, not zero */
} standin_device;

typedef struct standin {
  _Atomic int count;     /* devices on USB */
  _Atomic int wrist;     /* 0: none, 1: passive, 2: active */
  _Atomic int misuse;    /* calls that the maker forbids: two at once, outside of a frame... */
  _Atomic double hz;     /* of the swing */
  _Atomic int scheduler; /* libHD: it runs */
  standin_device of[STANDIN_DEVICES];
} standin;

/* A stand-in exports this. */
__attribute__((visibility("default"))) standin *standin_get(void);

#endif
