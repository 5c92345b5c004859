/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_ACCURACY_LOOKBACK_H
#define HAPODE_ACCURACY_LOOKBACK_H

/* How far off the felt force is, found out while the session runs: a short time of the past is gone
 * over again as model SINGLE would have had it, and its forces are held against those that the
 * hands felt.
 *
 * A window opens at a sync: the state of the bodies near the pointers is kept. While it is open
 * the loop tells where the pointers went and what the hands felt, and the pairs of geoms that
 * the application was asked about are noted with their surfaces. When it closes, the bodies are
 * put back to where they were, all others are switched off, and ODE steps them at the haptic
 * rate under the pointers on the same way; then all is put back as it was, as after a testing
 * simulation. */

#include "accuracy/lookback_window.h"

/* What a window that has ended says of the force. */
typedef struct hapi_lookback_verdict {
  double error;   /* share of the force that was wrong */
  double seconds; /* over so long */
} hapi_lookback_verdict;

/* The time that there is for a cycle's share. */
typedef struct hapi_lookback_time {
  int64_t now_ns;
  double spare_s;     /* that the dial leaves for it */
  int own_iterations; /* of the world, outside of a cycle's steps */
} hapi_lookback_time;

/* Nothing where it is not asked for. */
/* After the scans of a cycle. True: a window has ended, and *out is what it says. */
bool hapi_lookback_follow(hapi_lookback *w, const hapi_cycle *cycle, const hapi_world *world,
                          const hapi_slots *slots, const hapi_lookback_time *time,
                          hapi_lookback_verdict *out);
/* Who may be touched. */
void hapi_lookback_note(hapi_lookback *w, const hapi_cycle *cycle, const hapi_slots *slots,
                        const hapi_neighbors *neighbors);
/* A pair that collides. */
void hapi_lookback_ask(hapi_lookback *w, const hapi_body_table *bodies, dGeomID a, dGeomID b,
                       const dSurfaceParameters *surface);
void hapi_lookback_forget_geom(hapi_lookback *w, dGeomID geom); /* it is about to be destroyed */
/* The world is as at now_ns. */
void hapi_lookback_open(hapi_lookback *w, const hapi_cycle *cycle, const hapi_world *world,
                        const hapi_slots *slots, const hapi_neighbors *neighbors, int64_t now_ns);
/* The next window begins where the session is. */
void hapi_lookback_unchain(hapi_lookback *w);
void hapi_lookback_reset(hapi_lookback *w);
void hapi_lookback_finish(hapi_lookback *w);

#endif
