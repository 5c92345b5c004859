/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_COMMON_RELAY_CARRIER_H
#define HAPODE_PLUGINS_COMMON_RELAY_CARRIER_H

/* A relay as the device's control calls and its carrier have it. */

#include "plugins/common/arguments.h"
#include "plugins/common/relay.h"

/* ---- [control] ---- */

/* The arguments that all of these devices have: max_force, max_torque, stale, timeout, turn. */
#define HAPI_RELAY_ARGUMENTS 5
void hapi_relay_arguments(hapi_argument out[HAPI_RELAY_ARGUMENTS]);
/* What was given, over what out has. HAP_ERROR_ARGUMENT: stale is not below timeout. */
HAP_NODISCARD hap_status hapi_relay_take_arguments(const hapi_argument_table *table,
                                                   const hapi_argument *given,
                                                   hapi_relay_settings *out, hap_detail *detail);

void hapi_relay_init(hapi_relay *relay, const hapi_relay_settings *settings);

/* Before the carrier begins: no force, no sample, no cause. When the process ends by itself, the
 * force is zero first; false: too many devices run. */
HAP_NODISCARD bool hapi_relay_start(hapi_relay *relay);
/* No force from now on, and no tick. The carrier may end before or after it. */
void hapi_relay_stop(hapi_relay *relay);

/* ---- [carrier] ---- */

/* False: it is not finite or no rotation, and is not used. */
bool hapi_relay_publish(hapi_relay *relay, const hapi_relay_sample *sample);
/* What shall act now; zero, when nothing shall. */
void hapi_relay_wanted(hapi_relay *relay, int64_t now_ns, hap_wrench *out);
/* After it went out. True: in the meantime zero was called, and has to go out at once. */
bool hapi_relay_sent(hapi_relay *relay, const hap_wrench *sent);

#endif
