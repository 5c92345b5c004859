/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_DEF_H
#define HAPODE_BASE_DEF_H

/* The def structs of the API begin with size and cookie, both uint32_t: a caller of another build
 * has more members than this one, or fewer, and one that was not initialised is noticed. */

#include <stddef.h>
#include <stdint.h>

#include <hapode/status.h>

/* Fills *def, size_of_def bytes of the caller's build, with defaults of size bytes, which hold the
 * cookie. NULL is allowed. */
void hapi_def_init(void *def, size_t size_of_def, const void *defaults, size_t size);

/* Copies what the caller knows over the defaults in *out. HAP_ERROR_ARGUMENT for NULL,
 * HAP_ERROR_UNINITIALISED for another cookie. */
HAP_NODISCARD hap_status hapi_def_read(void *out, size_t size_of_out, const void *def,
                                       uint32_t cookie, const char *init_name, hap_detail *detail);

#endif
