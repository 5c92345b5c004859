/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_DEF_H
#define HAPODE_BASE_DEF_H

/* The def structs of the API begin with size and cookie, both uint32_t. The size tells a caller of
 * another build, with more or fewer members; the cookie tells whether the def was initialised. */

#include <stddef.h>
#include <stdint.h>

#include <hapode/status.h>

/* Fills *def, size_of_def bytes of the caller's build, with defaults of size bytes, which hold the
 * cookie. NULL is allowed. */
void hapi_def_init(void *def, size_t size_of_def, const void *defaults, size_t size);

/* The size of an initialised def, such as one that is to be filled in. HAP_ERROR_ARGUMENT for NULL,
 * HAP_ERROR_UNINITIALISED for another cookie. */
HAP_NODISCARD hap_status hapi_def_check(const void *def, uint32_t cookie, const char *init_name,
                                        uint32_t *out_size, hap_detail *detail);

/* Copies what the caller knows over the defaults in *out, whose size is then size_of_out. init_name
 * is the struct's name with "_init". HAP_ERROR_ARGUMENT for NULL and for bytes beyond size_of_out
 * that are not 0, HAP_ERROR_UNINITIALISED for another cookie. */
HAP_NODISCARD hap_status hapi_def_read(void *out, size_t size_of_out, const void *def,
                                       uint32_t cookie, const char *init_name, hap_detail *detail);

/* Fills in an initialised def of the caller's: as many members of *known as it has room for. */
void hapi_def_write(void *def, const void *known, size_t size_of_known);

#endif
