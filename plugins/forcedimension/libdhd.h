/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_FORCEDIMENSION_LIBDHD_H
#define HAPODE_PLUGINS_FORCEDIMENSION_LIBDHD_H

/* The functions of libdhd (Force Dimension SDK 3) that the device calls, by their published
 * prototypes. Metres, newtons, newton metres; errors are negative. Any of them may wait for USB. */

#include <stdbool.h>

#include "plugins/common/vendor.h"

#define HAPI_DHD_OLD 1 /* of a position: the one before, as less than its time guard passed */
#define HAPI_DHD_STATUS_MAX 64 /* newer versions tell more than the 13 that are known */

/* Indices of what dhdGetStatus gives. */
typedef enum hapi_dhd_status {
  HAPI_DHD_POWER = 0,
  HAPI_DHD_RESET = 3 /* it knows where it is */
} hapi_dhd_status;

typedef struct hapi_dhd {
  int (*open)(void);
  int (*open_id)(char id);
  int (*close)(char id);
  int (*enable_force)(unsigned char on, char id);
  int (*get_pose)(double *x, double *y, double *z, double frame[3][3], char id);
  int (*get_velocity)(double *x, double *y, double *z, char id);
  /* force, torque, force of the gripper */
  int (*set_force)(double fx, double fy, double fz, double tx, double ty, double tz, double fg,
                   char id);
  unsigned int (*get_buttons)(char id);
  bool (*has_wrist)(char id);
  const char *(*get_last_error)(void);
  /* NULL where the library does not have them: */
  bool (*has_active_wrist)(char id);
  const char *(*get_name)(char id);
  int (*get_count)(void);
  int (*get_status)(int status[HAPI_DHD_STATUS_MAX], char id);
  double (*get_max_force)(char id); /* negative: no limit was set */
  double (*get_rate)(char id);      /* kHz, of the exchange with the hardware */
} hapi_dhd;

/* Of the shared object, in the order in which they are tried; ends with NULL. */
extern const char *const hapi_dhd_names[];

/* [control] As hapi_vendor_load. */
HAP_NODISCARD hap_status hapi_dhd_load(const char *path, void **out_library, hapi_dhd *out,
                                       hap_detail *detail);

#endif
