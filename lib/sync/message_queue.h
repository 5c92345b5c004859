/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SYNC_MESSAGE_QUEUE_H
#define HAPODE_SYNC_MESSAGE_QUEUE_H

/* All messages of a channel that may still be asked for, by number. For replay, in one thread. */

#include <stddef.h>
#include <stdint.h>

#include <hapode/status.h>

typedef struct hapi_message_queue hapi_message_queue;

hap_status hapi_message_queue_create(size_t message_size, hapi_message_queue **out);
void hapi_message_queue_destroy(hapi_message_queue *queue); /* NULL allowed */

/* Copies the message, unless it was forgotten before and is not expected. */
void hapi_message_queue_put(hapi_message_queue *queue, uint64_t number, const void *message);

/* The expected message, valid until the next one is taken; NULL: none is expected, it is held
 * already, or it is missing. Messages before it are forgotten. */
void *hapi_message_queue_take(hapi_message_queue *queue);

void hapi_message_queue_expect(hapi_message_queue *queue, uint64_t number); /* UINT64_MAX: newest */
/* All before that number but the one that is expected. */
void hapi_message_queue_forget(hapi_message_queue *queue, uint64_t before);
uint64_t hapi_message_queue_held(const hapi_message_queue *queue); /* number, 0: none */
/* HAP_ERROR_MEMORY: there was none for a message; HAP_ERROR_NOT_FOUND: take did not find the one
 * that was expected. */
hap_status hapi_message_queue_status(const hapi_message_queue *queue);

#endif
