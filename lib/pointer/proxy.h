/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_POINTER_PROXY_H
#define HAPODE_POINTER_PROXY_H

/* The body behind a spring that a pointer may be, model CONTACT. v and free: its six of the
 * solver's velocities, with and without impulses; period in s. */

#include <hapode/effects.h>

#include "pointer/pointer.h"

/* Direct or proxy, and why. True: its contacts begin as those do that arrive deep. */
bool hapi_proxy_choose(hapi_pointer *pointer, hap_effect_wish wish, double period);

/* Another model than CONTACT: it is direct. True: as above. */
bool hapi_proxy_end(hapi_pointer *pointer);

/* A proxy at the tick's begin. */
void hapi_proxy_place(hapi_pointer *pointer, double period);

/* The velocity that a proxy would have with nothing in touch. t: s, the period. */
void hapi_proxy_free(hapi_pointer *p, double t, double v[6]);

/* Where a proxy goes, and the force on the hand. False: its state is not finite; it is where the
 * device is. */
bool hapi_proxy_move(hapi_pointer *pointer, double period, const double v[6]);

/* After missed ticks: of the way of the device since before, the share in which the loop stood
 * still stretches the spring slowly. */
void hapi_proxy_catch_up(hapi_pointer *pointer, const hapi_pointer_handle *before);

/* It begins anew where the device is. */
void hapi_proxy_begin_anew(hapi_pointer *pointer);

/* 2 sin(angle / 2) along the axis of the turn that brings one to the other. */
void hapi_proxy_turn_between(const double from[4], const double to[4], double out[3]);

/* Turns a quaternion by a spin [rad/s] for some time. */
void hapi_proxy_turn_by(double quat[4], const double spin[3], double seconds);

#endif
