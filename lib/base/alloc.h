/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_ALLOC_H
#define HAPODE_BASE_ALLOC_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <hapode/hooks.h>

/* The one door to the heap: goes through hap_hooks. Never on the haptic thread while it ticks. */

void *hapi_alloc(size_t size);                     /* zeroed; NULL when there is none */
void *hapi_alloc_array(size_t count, size_t size); /* zeroed; NULL on overflow as well */
/* The same at the begin of a cache line; goes back by hapi_free_lines. */
#define HAPI_CACHE_LINE 64u
void *hapi_alloc_lines(size_t count, size_t size);
void hapi_free_lines(void *memory); /* NULL allowed */
/* As hapi_alloc_array, and the heap may bring pages in when they are used first: for much that is
 * seldom used, and never by the haptic thread. */
void *hapi_alloc_late(size_t count, size_t size);
void hapi_free(void *memory); /* NULL allowed */
/* Grows an array of elements of one size to hold count more than those in use; false: no memory. */
bool hapi_reserve(void **array, uint32_t *capacity, uint32_t used, uint32_t count, size_t size);

/* The hooks in force; every member but user is callable. Only base/ calls through them. */
const hap_hooks *hapi_hooks(void);
/* Takes them over. NULL members get their defaults: of allocate and release none or both. */
void hapi_hooks_use(const hap_hooks *hooks);

#endif
