/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_CONFORM_INTERNAL_H
#define HAPODE_TOOLS_CONFORM_INTERNAL_H

/* Parts of conform_run:
 *   conform           the list of points, what is written about each
 *   conform_calls     ticks, and calls of the device with their times
 *   conform_watchdog  a function of the device that does not come back
 *   conform_rest      points before the device is energised
 *   conform_motion    a record of some ticks, and what it must be like
 *   conform_force     what is written
 *   conform_zero      zero, at any time
 *   conform_life      stop, start again, two devices, leaks, unplugged */

#include <stdatomic.h>

#include <hapode/device_impl.h>

#include "base/histogram.h"
#include "device/device.h"
#include "tools/conform/conform.h"

typedef struct conform_sample {
  double time; /* s */
  hap_pose pose;
  hap_twist twist;
  double axes[HAP_AXES_MAX];
  double axis_rates[HAP_AXES_MAX];
} conform_sample;

/* Ticks at rest and ticks under the small force, one after the other. */
#define CONFORM_REST_TICKS 400u
#define CONFORM_RECORD_MAX 1400u

/* What reads have got wrong so far. */
typedef struct conform_wrong {
  unsigned statuses;
  unsigned poses;
  unsigned twists;
  unsigned buttons;
  unsigned axes;
  unsigned zero_writes; /* of a zero wrench, between the reads */
} conform_wrong;

/* What a point has reported: others that find the same do not repeat it. */
typedef struct conform_said {
  bool holds_at_open;
  bool holds_at_start;
  bool jumps;
  bool reached_wrong;
  bool axis_wrong;
  bool zero_wrong;
  bool start_wrong;
  bool reads_unstarted;
  bool writes_unstarted;
} conform_said;

/* What the ticks gave. */
typedef struct conform_seen {
  hapi_histogram reads;
  hapi_histogram writes;
  hapi_histogram zeros;
  conform_wrong wrong;
  unsigned read_count;
  conform_sample record[CONFORM_RECORD_MAX];
  unsigned record_count;
} conform_seen;

typedef struct conform {
  const conform_options *options;
  FILE *out;

  /* the point */
  int number;
  const char *name;
  bool failed;
  char skip[300]; /* reason; empty: not skipped */
  int failures;

  /* the device */
  hap_device *device;
  const hap_device_ops *ops;
  void *self;
  hap_device_info info;
  bool running;
  bool stopped; /* the person wants no more, or a limit was passed */
  int64_t begin_ns;
  uint64_t tick;
  int64_t now_ns;
  bool bounded; /* under force: it must stay near its origin */
  double origin[3];

  conform_said said;
  conform_seen seen;
} conform;

/* ---- conform.c ---- */

/* The point does not hold; more than one reason may be given. */
void conform_fail(conform *c, const char *format, ...) HAP_PRINTF(2, 3);
/* It cannot be looked at. */
void conform_skip(conform *c, const char *format, ...) HAP_PRINTF(2, 3);
/* A figure, beside the points. */
void conform_note(conform *c, const char *format, ...) HAP_PRINTF(2, 3);

/* ---- conform_calls.c ---- */

bool conform_is_virtual(const conform *c);
double conform_period(const conform *c); /* s */
bool conform_status_is_known(hap_status status);

bool conform_open(conform *c, hap_detail *detail); /* the device of the options */
void conform_close(conform *c);                    /* zero, stop, close; idempotent */
hap_status conform_start(conform *c);
void conform_stop(conform *c); /* without zero before */
void conform_zero(conform *c);

/* One read without waiting; outputs arrive as NaN. *out may be partly filled. */
hap_status conform_read(conform *c, conform_sample *out);
/* One write; *reached arrives as NaN. No write at all comes after a stop. */
hap_status conform_write(conform *c, const hap_wrench *wanted, hap_wrench *reached);
/* Waits for the next tick and reads; false: it failed, or the check shall end. */
bool conform_tick(conform *c, conform_sample *out);
/* Since then reads have failed, or have begun to be wrong in a way in which they were not. */
bool conform_reads_worse(const conform *c, const conform_wrong *then);
/* The next tick comes so much later. */
void conform_pause(conform *c, double seconds);

/* What the motors hold; false: the device cannot say. */
bool conform_held(const conform *c, hap_wrench *out);
bool conform_is_zero(const hap_wrench *wrench);
/* Fails the point when the device says that it holds a force; when says in which case. */
void conform_expect_none(conform *c, const char *when);

#define CONFORM_TORQUE_ARM 0.01 /* m: small torque by small force */

/* Of the small force along axis 0..2, or of the small torque about axis 3..5. */
hap_wrench conform_small(const conform *c, int axis, double sign);
int conform_axes(const conform *c); /* 3 or 6 */
bool conform_has_force(const conform *c);
/* False and skipped when the check is one without force, or reads fail. */
bool conform_needs_force(conform *c);
bool conform_needs_reads(conform *c);
bool conform_needs_held(conform *c);
bool conform_needs_zero(conform *c);
/* False and skipped when asking for more than the device can is not allowed. */
bool conform_needs_limits(conform *c);

/* ---- conform_watchdog.c ---- */

bool conform_watchdog_begin(conform *c);
void conform_watchdog_end(void);
/* Around every call of the device; limit_s: longer is a failure of the running point. */
void conform_enter(const char *call, double limit_s);
void conform_leave(void);

#define CONFORM_TICK_LIMIT_S 3.0   /* read, write, zero, describe, held */
#define CONFORM_BLOCK_LIMIT_S 60.0 /* open, start, stop, close */

/* ---- points ---- */

void conform_describe(conform *c);
void conform_arguments(conform *c);
void conform_open_holds_no_force(conform *c);
void conform_before_start(conform *c);
void conform_stop_before_start(conform *c);

void conform_start_without_force(conform *c);
void conform_read_status(conform *c);
void conform_pose(conform *c);
void conform_twist(conform *c);
void conform_buttons(conform *c);
void conform_axis_values(conform *c);
void conform_read_time(conform *c);
void conform_steps(conform *c);
void conform_twist_fits(conform *c);
void conform_axis_rates_fit(conform *c);
void conform_after_pause(conform *c);

void conform_workspace(conform *c);
void conform_axis_forces(conform *c);
void conform_axis_limits(conform *c);
void conform_lights(conform *c);

void conform_reached(conform *c);
void conform_held_is_reached(conform *c);
void conform_write_time(conform *c);
void conform_limits(conform *c);
void conform_not_finite(conform *c);

void conform_zero_takes_force(conform *c);
void conform_zero_in_signal(conform *c);
void conform_zero_in_thread(conform *c);
void conform_zero_time(conform *c);

void conform_stop_takes_force(conform *c);
void conform_after_stop(conform *c);
void conform_stop_twice(conform *c);
void conform_start_again(conform *c);
void conform_info_is_stable(conform *c);
void conform_two_devices(conform *c);
void conform_open_again(conform *c);
void conform_leaks(conform *c);
void conform_unplugged(conform *c);

#endif
