/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_DEF_H
#define HAPODE_BASE_DEF_H

/* The structs of the API that a caller of another build has with more or fewer members. A def
 * begins with size and cookie, both uint32_t; the cookie tells whether it was initialised. What the
 * library gives out begins with its size. */

#include <stddef.h>
#include <stdint.h>

#include <hapode/status.h>

typedef struct hapi_def_type {
  const char *name;     /* of the struct; its init function is the name with "_init" */
  const void *defaults; /* of this build; they hold the cookie */
  size_t size;
} hapi_def_type;

#define HAPI_DEF_TYPE(name, defaults)    \
  {                                      \
#name, &(defaults), sizeof(defaults) \
  }

/* Fills *def, size_of_def bytes of the caller's build, with the defaults. NULL is allowed. */
void hapi_def_init(const hapi_def_type *type, void *def, size_t size_of_def);

/* *out, of this build: the defaults, and over them what the caller's def has. HAP_ERROR_ARGUMENT
 * for NULL and for bytes beyond this build's that are not 0, HAP_ERROR_UNINITIALISED for another
 * cookie. */
HAP_NODISCARD hap_status hapi_def_read(const hapi_def_type *type, const void *def, void *out,
                                       hap_detail *detail);

/* The same, but NULL stands for the defaults. */
HAP_NODISCARD hap_status hapi_def_read_optional(const hapi_def_type *type, const void *def,
                                                void *out, hap_detail *detail);

/* Fills in an initialised def of the caller's: as many members of *known, of this build, as it has
 * room for. Errors as of read. */
HAP_NODISCARD hap_status hapi_def_write(const hapi_def_type *type, const void *known, void *def,
                                        hap_detail *detail);

/* Gives out as much of *value, which begins with its size, as the caller's build has room for.
 * HAP_ERROR_ARGUMENT: out is NULL or has no room for the size. */
HAP_NODISCARD hap_status hapi_struct_give(const void *value, size_t size, void *out,
                                          size_t size_of_out);

/* ---- numbers of a def ---- */

typedef struct hapi_number_rule {
  const char *name;
  double value;
  double low;
  double high;
  const char *other_name; /* NULL: no other value is good; such as "HAP_BY_ACCURACY or " */
  double other;
} hapi_number_rule;

/* Rules for a member of the def: a number within limits, or another one besides. */
#define HAPI_RULE(def, member, low, high)        \
  {                                              \
#member, (def)->member, low, high, NULL, 0.0 \
  }
#define HAPI_RULE_OR(def, member, other, low, high)         \
  {                                                         \
#member, (def)->member, low, high, #other " or ", other \
  }

/* The least magnitude of a number from outside that is not 0. What is made of such numbers,
 * quotients too, is never subnormal: the loop takes subnormal numbers for 0. */
#define HAPI_NUMBER_LEAST 1e-15

/* HAP_ERROR_ARGUMENT where a value, which may be NaN, breaks its rule or is too near to 0. */
HAP_NODISCARD hap_status hapi_numbers_check(const hapi_number_rule *rules, size_t count,
                                            hap_detail *detail);

#endif
