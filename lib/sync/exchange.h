/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SYNC_EXCHANGE_H
#define HAPODE_SYNC_EXCHANGE_H

/* The mailboxes between physics, contact thread and haptic loop: one writer and one reader each. All
 * memory is taken at create. */

#include <stddef.h>

#include <hapode/status.h>

#include "sync/messages.h"
#include "sync/trail.h"

typedef struct hapi_exchange hapi_exchange;

hap_status hapi_exchange_create(const hapi_capacity *capacity, hapi_exchange **out);
void hapi_exchange_destroy(hapi_exchange *exchange); /* NULL allowed */

/* Forgets all messages; no thread may be using the exchange. */
void hapi_exchange_reset(hapi_exchange *exchange);

/* For each message: the place to write to, its hand-over, and the newest one (NULL: none newer; the
 * one taken before stays valid then, and only then). */

/* [physics] -> [haptic] */
hapi_model *hapi_exchange_model_back(hapi_exchange *exchange);
void hapi_exchange_model_publish(hapi_exchange *exchange);
hapi_model *hapi_exchange_model_take(hapi_exchange *exchange);

/* [haptic] -> [physics] */
hapi_state *hapi_exchange_state_back(hapi_exchange *exchange);
void hapi_exchange_state_publish(hapi_exchange *exchange);
hapi_state *hapi_exchange_state_take(hapi_exchange *exchange);

/* [physics] -> [contact] */
hapi_near *hapi_exchange_near_back(hapi_exchange *exchange);
void hapi_exchange_near_publish(hapi_exchange *exchange);
hapi_near *hapi_exchange_near_take(hapi_exchange *exchange);

/* [haptic] -> [contact] */
hapi_poses *hapi_exchange_poses_back(hapi_exchange *exchange);
void hapi_exchange_poses_publish(hapi_exchange *exchange);
hapi_poses *hapi_exchange_poses_take(hapi_exchange *exchange);

/* [contact] -> [haptic] */
hapi_patches *hapi_exchange_patches_back(hapi_exchange *exchange);
void hapi_exchange_patches_publish(hapi_exchange *exchange);
hapi_patches *hapi_exchange_patches_take(hapi_exchange *exchange);

/* [haptic] -> whoever draws. Not in the block: it is written round and round and stays in memory. */
hapi_trail *hapi_exchange_trail(hapi_exchange *exchange);

/* The whole block, for locking it into memory. */
void *hapi_exchange_memory(hapi_exchange *exchange, size_t *out_size);

#endif
