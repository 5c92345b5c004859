/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SYNC_EXCHANGE_H
#define HAPODE_SYNC_EXCHANGE_H

/* The two mailboxes between physics and haptic loop. All memory is taken at create. */

#include <stddef.h>

#include <hapode/status.h>

#include "sync/messages.h"

typedef struct hapi_exchange hapi_exchange;

hap_status hapi_exchange_create(const hapi_capacity *capacity, hapi_exchange **out);
void hapi_exchange_destroy(hapi_exchange *exchange); /* NULL allowed */

/* Forgets all messages; no thread may be using the exchange. */
void hapi_exchange_reset(hapi_exchange *exchange);

/* [physics] */
hapi_model *hapi_exchange_model_back(hapi_exchange *exchange);
void hapi_exchange_model_publish(hapi_exchange *exchange);
hapi_state *hapi_exchange_state_take(hapi_exchange *exchange); /* NULL: none newer */

/* [haptic] */
hapi_model *hapi_exchange_model_take(hapi_exchange *exchange); /* NULL: none newer */
hapi_state *hapi_exchange_state_back(hapi_exchange *exchange);
void hapi_exchange_state_publish(hapi_exchange *exchange);

/* The whole block, for locking it into memory. */
void *hapi_exchange_memory(hapi_exchange *exchange, size_t *out_size);

#endif
