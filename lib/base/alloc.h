/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_ALLOC_H
#define HAPODE_BASE_ALLOC_H

#include <stddef.h>

/* The one door to the heap: goes through hap_hooks. Never on the haptic thread while it ticks. */

void *hapi_alloc(size_t size);                     /* zeroed; NULL when there is none */
void *hapi_alloc_array(size_t count, size_t size); /* zeroed; NULL on overflow as well */
void hapi_free(void *memory);                      /* NULL allowed */

#endif
