/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_HAPTIC_HAPTIC_H
#define HAPODE_HAPTIC_HAPTIC_H

/* The haptic side of a session: pointers and their devices, the tick, the thread that paces it. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/effects.h>
#include <hapode/outputs.h>
#include <hapode/pointer.h>
#include <hapode/session.h>
#include <hapode/stats.h>
#include <hapode/surface.h>
#include <hapode/touches.h>
#include <hapode/trace.h>

#include "base/force_setup.h"
#include "base/grab_setup.h"
#include "base/pointer_setup.h"
#include "haptic/own_list.h"
#include "record/tape.h"
#include "sync/exchange.h"
#include "sync/texture.h"

typedef struct hapi_haptic hapi_haptic;

typedef struct hapi_haptic_config {
  hapi_capacity capacity;
  double haptic_hz;
  bool lockstep;
  int rt_priority;
  uint32_t trace_rows;
  hap_guard guard;
  hapi_exchange *exchange;
  const hapi_textures *textures; /* NULL: there are none */
} hapi_haptic_config;

hap_status hapi_haptic_create(const hapi_haptic_config *config, hapi_haptic **out);
void hapi_haptic_destroy(hapi_haptic *haptic); /* NULL allowed; ended before, with true */

/* [control] Forgets all state, starts the devices, tells physics where the pointers are. */
hap_status hapi_haptic_begin(hapi_haptic *haptic, int64_t start_ns, hap_detail *detail);
void hapi_haptic_set_start(hapi_haptic *haptic, int64_t start_ns); /* time of tick 0 */
/* Zero force, devices stopped; idempotent. False: the loop or a device has not come back for
 * HAPI_SAFETY_STOP_WAIT_S. Then nothing is freed or stopped, and the next call tries again. */
HAP_NODISCARD bool hapi_haptic_end(hapi_haptic *haptic);
/* [any] Where the loop stood still, in words, such as "in read of device virtual". */
void hapi_haptic_where(hapi_haptic *haptic, hap_detail *out);

/* [control] Before begin: from then on what comes from outside goes to the tape or comes from it,
 * until the tape is taken away after end. NULL: none. */
void hapi_haptic_set_tape(hapi_haptic *haptic, hapi_tape *tape);
/* Replay: deadlines that no tick was begun for. */
void hapi_haptic_count_missed(hapi_haptic *haptic, uint64_t ticks);

/* [control] Between begin and end; not in lockstep. */
hap_status hapi_haptic_start_thread(hapi_haptic *haptic);
/* Idempotent. False: it has not ended for HAPI_SAFETY_STOP_WAIT_S. */
HAP_NODISCARD bool hapi_haptic_stop_thread(hapi_haptic *haptic);
bool hapi_haptic_is_realtime(const hapi_haptic *haptic);

/* [haptic] Uses a local model that has come in and whose time has come. */
void hapi_haptic_receive(hapi_haptic *haptic, int64_t now_ns);
/* [haptic] One whole tick: devices in, tick, devices out, messages. */
void hapi_haptic_cycle(hapi_haptic *haptic, int64_t now_ns);

/* pointer.h */
hap_status hapi_haptic_add_pointer(hapi_haptic *haptic, const hapi_pointer_setup *def,
                                   hap_pointer_id *out, hap_detail *detail);
/* remove, restart: HAP_ERROR_TIMEOUT: the loop or the device has not come back. */
hap_status hapi_haptic_remove_pointer(hapi_haptic *haptic, hap_pointer_id id);
hap_status hapi_haptic_restart_pointer(hapi_haptic *haptic, hap_pointer_id id, hap_detail *detail);
/* [any] What the pointer's device says of its last failure; "" when it says nothing. */
void hapi_haptic_explain(hapi_haptic *haptic, hap_pointer_id id, hap_detail *out);
hap_status hapi_haptic_set_target(hapi_haptic *haptic, hap_pointer_id id, const hap_pose *pose,
                                  const hap_twist *twist);
/* The same; from the first time on, of the loop, the target goes on as fast, for the second one;
 * then it stands. */
hap_status hapi_haptic_carry_target(hapi_haptic *haptic, hap_pointer_id id, const hap_pose *pose,
                                    const hap_twist *twist, const int64_t told_carried_ns[2]);
/* [any] Changes what was set last by merge, which says what is wrong, and hands it to the loop.
 * of: merge's; io_hull: of HAP_SET_SHAPE. */
typedef hap_status (*hapi_setting_merge)(const void *of, hapi_pointer_setting *io,
                                         hapi_tool_hull *io_hull, hap_detail *detail);
/* The fields that the mask names. */
void hapi_settings_copy(uint32_t mask, const hapi_pointer_setup *from, hapi_pointer_setup *to);
hap_status hapi_haptic_set_pointer(hapi_haptic *haptic, hap_pointer_id id, hapi_setting_merge merge,
                                   const void *of, hap_detail *detail);
hap_status hapi_haptic_get_settings(hapi_haptic *haptic, hap_pointer_id id,
                                    hapi_pointer_setting *out);
/* [any] outputs.h */
hap_status hapi_haptic_set_outputs(hapi_haptic *haptic, hap_pointer_id id,
                                   const hap_pointer_outputs *outputs, hap_detail *detail);
/* *io stays as it is where nothing was set. */
hap_status hapi_haptic_get_outputs(hapi_haptic *haptic, hap_pointer_id id, hap_pointer_outputs *io);
/* [any] Of its device; HAP_ERROR_UNSUPPORTED: that does not tell one. */
hap_status hapi_haptic_workspace(hapi_haptic *haptic, hap_pointer_id id, double out_low[3],
                                 double out_high[3]);
hap_status hapi_haptic_get_pointer(hapi_haptic *haptic, hap_pointer_id id, hap_pointer_state *out);
bool hapi_haptic_has_pointer(hapi_haptic *haptic, hap_pointer_id id);
/* [any] Whether a tick has had it. */
bool hapi_haptic_pointer_acts(hapi_haptic *haptic, hap_pointer_id id);
/* [any] Pointer and device in the world at time_ns; HAP_STALE: later than the newest tick by more
 * than grace_ns; HAP_ERROR_NOT_FOUND: also while no tick has had the pointer. */
hap_status hapi_haptic_pointer_poses(hapi_haptic *haptic, hap_pointer_id id, int64_t time_ns,
                                     int64_t grace_ns, hap_pose out_proxy_device[2]);

/* [any] forces.h. io: v 0: it is added, and its id comes back. HAP_SATURATED: something was cut to
 * what the device can hold. */
hap_status hapi_haptic_put_force(hapi_haptic *haptic, hap_pointer_id id, hap_force_id *io,
                                 const hapi_force_setup *setup, const hapi_own_extra *extra,
                                 hap_detail *detail);
hap_status hapi_haptic_remove_force(hapi_haptic *haptic, hap_pointer_id id, hap_force_id force,
                                    hap_detail *detail);
hap_status hapi_haptic_get_force(hapi_haptic *haptic, hap_pointer_id id, hap_force_id force,
                                 hap_force_state *out);

/* [any] surface.h. number: of a texture that there is. */
void hapi_haptic_get_texture(const hapi_haptic *haptic, uint32_t number, hap_texture_state *out);

/* [any] grab.h. birth 0: what is held is let go. HAP_SATURATED: something was cut to what the
 * device can hold. */
hap_status hapi_haptic_grab(hapi_haptic *haptic, hap_pointer_id id, const hapi_grab_setup *setup,
                            hap_detail *detail);

/* [any] touches.h: what was written, and HAP_STALE when nobody had asked before. */
hap_status hapi_haptic_touches(hapi_haptic *haptic, hap_pointer_id id, hap_touch *touches,
                               size_t capacity, size_t size_of_touch, size_t *out_count);
hap_status hapi_haptic_contacts(hapi_haptic *haptic, hap_body_contact *contacts, size_t capacity,
                                size_t size_of_contact, size_t *out_count);
size_t hapi_haptic_read_events(hapi_haptic *haptic, hap_event *events, size_t capacity,
                               size_t size_of_event);

bool hapi_haptic_has_pointers(const hapi_haptic *haptic);

void hapi_haptic_reset_fault(hapi_haptic *haptic);            /* [any] from the next tick on */
void hapi_haptic_fault(hapi_haptic *haptic, hap_fault fault); /* [any] from the next tick on */
bool hapi_haptic_has_fault(const hapi_haptic *haptic);        /* [any] latched at the last tick */
void hapi_haptic_stats(const hapi_haptic *haptic, hap_stats *out); /* [any] its part of *out */
void hapi_haptic_effects(const hapi_haptic *haptic, hap_effect_info *out); /* [any] likewise */
size_t hapi_haptic_read_trace(hapi_haptic *haptic, hap_trace_row *rows, size_t capacity,
                              size_t size_of_row);
/* [app] */
size_t hapi_haptic_read_black_box(hapi_haptic *haptic, hap_black_box_row *rows, size_t capacity,
                                  size_t size_of_row);

#endif
