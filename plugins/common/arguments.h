/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_COMMON_ARGUMENTS_H
#define HAPODE_PLUGINS_COMMON_ARGUMENTS_H

/* The argument text of a device spec: "key=value,key=value". Allocates nothing, keeps nothing.
 * An unknown or repeated key, an empty item and a number that is not finite are errors. */

#include <stdbool.h>
#include <stddef.h>

#include <hapode/status.h>

typedef enum hapi_argument_kind {
  HAPI_ARGUMENT_NUMBER,     /* number[0] within least and most */
  HAPI_ARGUMENT_VECTOR,     /* x/y/z: number[0..2], each within least and most */
  HAPI_ARGUMENT_QUATERNION, /* w/x/y/z: number[0..3], made unit; zero is refused */
  HAPI_ARGUMENT_WORD,       /* one of words: word is its index */
  HAPI_ARGUMENT_TEXT        /* anything but a comma: text and length, borrowed from the input */
} hapi_argument_kind;

/* One known key. The caller fills the upper part and, as defaults, the values of the lower. */
typedef struct hapi_argument {
  const char *key;
  hapi_argument_kind kind;
  bool given; /* false at first */
  double least;
  double most;
  const char *expected;     /* ends the sentence "expected ..." of an error */
  const char *const *words; /* ends with NULL */

  double number[4];
  size_t word;
  const char *text;
  size_t length;
} hapi_argument;

/* Who asks, for error texts, and what may come. */
typedef struct hapi_argument_table {
  const char *device;
  hapi_argument *entries;
  size_t count;
} hapi_argument_table;

/* Reads text into the entries. HAP_ERROR_ARGUMENT with a text that names the key, says what was
 * expected and lists the known keys; entries are then partly filled. detail is not NULL. */
HAP_NODISCARD hap_status hapi_arguments_read(const hapi_argument_table *table, const char *text,
                                             hap_detail *detail);

/* The same sentence for what a device itself finds wrong about a value. */
hap_status hapi_arguments_fail(const hapi_argument_table *table, const hapi_argument *argument,
                               hap_detail *detail);

/* Numbers separated by '/', exactly count of them, up to stop; false when text has another form. */
HAP_NODISCARD bool hapi_arguments_numbers(const char *text, const char *stop, size_t count,
                                          double *out);

#endif
