/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_ALLOC_H
#define HAPODE_BASE_ALLOC_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* The one door to the heap: goes through hap_hooks. Never on the haptic thread while it ticks. */

void *hapi_alloc(size_t size);                     /* zeroed; NULL when there is none */
void *hapi_alloc_array(size_t count, size_t size); /* zeroed; NULL on overflow as well */
void hapi_free(void *memory);                      /* NULL allowed */
/* Grows an array of elements of one size to hold count more than those in use; false: no memory. */
bool hapi_reserve(void **array, uint32_t *capacity, uint32_t used, uint32_t count, size_t size);

#endif
