/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_OPENHAPTICS_LIBHD_H
#define HAPODE_PLUGINS_OPENHAPTICS_LIBHD_H

/* The functions and numbers of libHD (3D Systems OpenHaptics 3, HDAPI) that the device uses, by
 * their published prototypes. Millimetres, newtons, newton millimetres. Calls are about the current
 * device, which hd_make_current and begin_frame choose for their thread. */

#include "plugins/common/vendor.h"

#define HAPI_HD_INVALID 0xffffffffu
#define HAPI_HD_PRIORITY 0xffffu /* the highest of the scheduler */
#define HAPI_HD_DONE 0u          /* what a callback returns */
#define HAPI_HD_CONTINUE 1u
#define HAPI_HD_FORCE_OUTPUT 0x4000u

typedef enum hapi_hd_get {
  HAPI_HD_BUTTONS = 0x2000,
  HAPI_HD_POSITION = 0x2050,
  HAPI_HD_VELOCITY = 0x2051,
  HAPI_HD_TRANSFORM = 0x2052, /* 16 numbers, column by column */
  HAPI_HD_MODEL = 0x2501,     /* a text */
  HAPI_HD_WORKSPACE = 0x2551, /* 6 numbers: the low corner, the high one */
  HAPI_HD_INPUT_DOF = 0x2553,
  HAPI_HD_OUTPUT_DOF = 0x2554,
  HAPI_HD_MAX_STIFFNESS = 0x2602,        /* N/mm */
  HAPI_HD_MAX_FORCE = 0x2603,            /* N, for a moment */
  HAPI_HD_MAX_CONTINUOUS_FORCE = 0x2604, /* N */
  HAPI_HD_TEMPERATURE = 0x2605,          /* of up to 6 motors: 0 cold, 1 too warm */
  HAPI_HD_FORCE = 0x2700,
  HAPI_HD_TORQUE = 0x2701
} hapi_hd_get;

typedef enum hapi_hd_error {
  HAPI_HD_SUCCESS = 0,
  HAPI_HD_WARM = 0x200,
  HAPI_HD_TOO_MUCH_FORCE = 0x201,
  HAPI_HD_TOO_MUCH_IMPULSE = 0x202,
  HAPI_HD_TOO_FAST = 0x203,
  HAPI_HD_FORCE_ERROR = 0x204,
  HAPI_HD_FAULT = 0x300,
  HAPI_HD_IN_USE = 0x301,
  HAPI_HD_NO_ANSWER = 0x302
} hapi_hd_error;

#define HAPI_HD_NEEDS_HANDS 0x5002u /* of check_calibration: somebody has to move the stylus */

typedef struct hapi_hd_fault {
  unsigned int code; /* hapi_hd_error */
  int internal;
  unsigned int device;
} hapi_hd_fault;

typedef unsigned int (*hapi_hd_callback)(void *user);

typedef struct hapi_hd {
  unsigned int (*init_device)(const char *name);
  void (*disable_device)(unsigned int device);
  void (*make_current)(unsigned int device);
  void (*begin_frame)(unsigned int device);
  void (*end_frame)(unsigned int device);
  void (*get_doubles)(unsigned int what, double *out);
  void (*get_integers)(unsigned int what, int *out);
  const char *(*get_string)(unsigned int what);
  void (*set_doubles)(unsigned int what, const double *values);
  void (*enable)(unsigned int what);
  void (*disable)(unsigned int what);
  hapi_hd_fault (*get_error)(void); /* the oldest that was not asked for; SUCCESS: there is none */
  unsigned long (*schedule)(hapi_hd_callback callback, void *user, unsigned short priority);
  void (*unschedule)(unsigned long handle);
  void (*start_scheduler)(void);
  void (*stop_scheduler)(void);
  unsigned int (*check_calibration)(void); /* NULL where the library does not have it */
} hapi_hd;

/* Of the shared object, in the order in which they are tried; ends with NULL. */
extern const char *const hapi_hd_names[];

/* [control] As hapi_vendor_load. */
HAP_NODISCARD hap_status hapi_hd_load(const char *path, void **out_library, hapi_hd *out,
                                      hap_detail *detail);

/* [control] The one scheduler of the library runs while somebody needs it. */
void hapi_hd_scheduler_begin(const hapi_hd *hd);
void hapi_hd_scheduler_end(const hapi_hd *hd);

#endif
