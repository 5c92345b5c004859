/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_COMMON_RELAY_H
#define HAPODE_PLUGINS_COMMON_RELAY_H

/* Between the tick and a carrier: the thread that talks to hardware through calls that may block, a
 * maker's library or a socket. Both sides exchange their newest values and never wait. This is the
 * tick's side; relay_carrier.h has the other one.
 *
 * A device that says nothing is no hand at rest: samples have the time of their arrival, and the
 * tick is told when the newest one is too old. A force that nobody renews is no force: the carrier
 * sends zero when the tick has not written for HAPI_SAFETY_UNWRITTEN_S. */

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include <hapode/device_impl.h>

#include "sync/triple_buffer.h"

/* ---- what is exchanged ---- */

typedef struct hapi_relay_sample {
  int64_t stamp_ns; /* CLOCK_MONOTONIC, of its arrival */
  uint32_t buttons;
  hap_pose pose;      /* quaternion of about unit length */
  double velocity[3]; /* m/s */
} hapi_relay_sample;

typedef struct hapi_relay_told {
  hapi_relay_sample sample;
  double spin[3]; /* rad/s, in the axes of the frame */
} hapi_relay_told;

/* Why a device does not work. Those of a device follow OWN. */
typedef enum hapi_relay_cause {
  HAPI_RELAY_WELL = 0,
  HAPI_RELAY_SILENT,     /* nothing new for too long; over with the next sample */
  HAPI_RELAY_NOT_FINITE, /* what comes is NaN, infinite, or no rotation */
  HAPI_RELAY_OWN = 16
} hapi_relay_cause;

typedef struct hapi_relay_settings {
  double max_force;  /* N */
  double max_torque; /* N m; 0: no torque goes out */
  double stale;      /* s, age of a sample from which it is doubted */
  double lost;       /* s, age from which read fails */
  bool turns;        /* orientations are told */
} hapi_relay_settings;

/* A tick's side of it. */
typedef struct hapi_relay_tick {
  bool running;
  bool begun;       /* a sample was taken since start */
  hap_wrench held;  /* of the newest write */
  int64_t start_ns; /* no sample yet: its age counts from here */
} hapi_relay_tick;

/* A carrier's side of it. */
typedef struct hapi_relay_carrier {
  int64_t fresh_ns;  /* when the newest command was found */
  hap_wrench sent;   /* last */
  int64_t anchor_ns; /* of the orientation from which the spin is counted; 0: none */
  double anchor[4];
  double spin[3];
} hapi_relay_carrier;

typedef struct hapi_relay {
  hapi_relay_settings settings;
  hapi_triple_buffer sample_places;
  hapi_relay_told samples[3];
  hapi_triple_buffer command_places;
  hap_wrench commands[3];
  atomic_bool zeroed;  /* raised by zero, lowered by write */
  atomic_bool resting; /* the last force that went out was zero */
  _Atomic int cause;   /* of now: read and write fail unless WELL */
  _Atomic int doubt;   /* of the newest message: WELL when a sample came of it */
  _Atomic int last;    /* cause of the last failure since start, which may be over */
  hapi_relay_tick tick;
  hapi_relay_carrier carrier;
} hapi_relay;

/* ---- [haptic] the operations of hap_device_ops: no lock, no call of the system ---- */

HAP_NODISCARD hap_status hapi_relay_read(hapi_relay *relay, int64_t time_ns, hap_device_input *out);
HAP_NODISCARD hap_status hapi_relay_write(hapi_relay *relay, const hap_wrench *wanted,
                                          hap_wrench *reached);
/* What is written last; after stop, what went out last. */
void hapi_relay_held(const hapi_relay *relay, hap_wrench *out);
/* [any] Also a signal handler. */
void hapi_relay_zero(hapi_relay *relay);

/* ---- [any] ---- */

/* WELL ends it. */
void hapi_relay_set_cause(hapi_relay *relay, int cause);
/* A message without a sample; read says so when it runs out of samples. */
void hapi_relay_set_doubt(hapi_relay *relay, int cause);

int hapi_relay_cause_now(const hapi_relay *relay);
int hapi_relay_cause_last(const hapi_relay *relay);
bool hapi_relay_is_resting(const hapi_relay *relay);
/* The process ends: no force goes out any more. */
bool hapi_relay_is_leaving(void);
void hapi_relay_leave(void);
bool hapi_relay_is_zero(const hap_wrench *wrench);

#endif
