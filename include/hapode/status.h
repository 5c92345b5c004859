/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_STATUS_H
#define HAPODE_STATUS_H

#include <hapode/attributes.h>

HAP_BEGIN_DECLS

/* What every call returns: 0 is good, positive is information (the call did its work), negative
 * is an error (the call changed nothing). Values are never renumbered. */
typedef enum hap_status {
  HAP_OK = 0, /* done */

  HAP_NO_REALTIME = 1, /* running, but without real-time scheduling or locked memory */
  HAP_STALE = 2,       /* the answer is older than one physics step */
  HAP_SATURATED = 3,   /* the wanted wrench was beyond a limit and was shortened */
  HAP_DROPPED = 4,     /* more frame time came in than three physics steps; the rest was dropped */
  HAP_END = 5,         /* nothing further to read */
  HAP_BODY_LOST = 6,   /* a body was destroyed without hap_session_forget_body; it was dropped */
  HAP_FAULTED = 7,     /* done, but a fault is latched and the force is zero */
  HAP_CLAMPED = 8,     /* the time asked for is no longer kept; the oldest that is was given */

  HAP_ERROR_ARGUMENT = -1,      /* an argument is NULL, out of range or not finite */
  HAP_ERROR_UNINITIALISED = -2, /* a def struct did not go through its _init function */
  HAP_ERROR_MEMORY = -3,        /* the allocator returned NULL */
  HAP_ERROR_STATE = -4,         /* not now: wrong drive, already started, not started ... */
  HAP_ERROR_THREAD = -5,        /* not from this thread, or not from a callback */
  HAP_ERROR_CAPACITY = -6,      /* a capacity fixed at create is used up */
  HAP_ERROR_NOT_FOUND = -7,     /* no such pointer, body, device or scene */
  HAP_ERROR_UNSUPPORTED = -8,   /* a thing that this version cannot do */
  HAP_ERROR_WORLD = -9,         /* the ODE world holds something that cannot be simulated */
  HAP_ERROR_DEVICE = -10,       /* the device failed */
  HAP_ERROR_IO = -11,           /* a file cannot be opened, read or written */
  HAP_ERROR_FORMAT = -12,       /* a file or text does not have the form it should have */
  HAP_ERROR_TIMEOUT = -13,      /* it did not happen within the time given */
  HAP_ERROR_SYSTEM = -14        /* the operating system refused (threads, clocks) */
} hap_status;

/* Room for one sentence that says what was wrong, where, and what to do. Always terminated. */
typedef struct hap_detail {
  char text[512]; /* "" when there is nothing to say */
} hap_detail;

/* [any] Name of a status, such as "HAP_ERROR_ARGUMENT"; never NULL, also for unknown values. */
HAP_API const char *hap_status_name(hap_status status);

/* [any] One short English sentence for a status; never NULL. */
HAP_API const char *hap_status_text(hap_status status);

HAP_END_DECLS

#endif
