/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "plugins/common/arguments.h"

#include <stdio.h>
#include <string.h>

#include "base/log.h"
#include "base/number.h"
#include "base/vec.h"

#define SHOWN 60 /* characters of the input in an error: the known keys need their place, too */

/* A part of the input. */
typedef struct slice {
  const char *text;
  size_t length;
} slice;

static int length_shown(size_t length)
{
  return length < SHOWN ? (int)length : SHOWN;
}

static void list_keys(const hapi_argument_table *table, char *out, size_t size)
{
  size_t used = 0;
  out[0] = '\0';
  for (size_t i = 0; i < table->count && used < size; ++i) {
    used +=
        (size_t)snprintf(out + used, size - used, "%s%s", i > 0 ? ", " : "", table->entries[i].key);
  }
}

/* "DEVICE: WHAT 'ITEM'TAIL; known: KEYS" */
static hap_status fail_item(const hapi_argument_table *table, const char *what, slice item,
                            const char *tail, hap_detail *detail)
{
  char keys[256];
  list_keys(table, keys, sizeof keys);
  return hapi_fail(detail, HAP_ERROR_ARGUMENT, "%s: %s '%.*s'%s; known: %s", table->device, what,
                   length_shown(item.length), item.text, tail, keys);
}

hap_status hapi_arguments_fail(const hapi_argument_table *table, const hapi_argument *argument,
                               hap_detail *detail)
{
  char what[160];
  snprintf(what, sizeof what, "%s: expected %s, not", argument->key, argument->expected);
  slice value = {argument->text, argument->length};
  return fail_item(table, what, value, "", detail);
}

bool hapi_arguments_numbers(const char *text, const char *stop, size_t count, double *out)
{
  const char *at = text;
  for (size_t i = 0; i < count; ++i) {
    const char *end = hapi_number_read(at, &out[i]);
    bool last = i + 1 == count;
    if (end == NULL || end > stop || (last ? end != stop : *end != '/')) {
      return false;
    }
    at = end + 1;
  }
  return true;
}

static bool read_numbers(hapi_argument *argument, size_t count)
{
  const char *stop = argument->text + argument->length;
  double value[4];
  if (!hapi_arguments_numbers(argument->text, stop, count, value)) {
    return false;
  }
  for (size_t i = 0; i < count; ++i) {
    if (value[i] < argument->least || value[i] > argument->most) {
      return false;
    }
  }
  memcpy(argument->number, value, count * sizeof value[0]);
  return true;
}

static bool read_quaternion(hapi_argument *argument)
{
  double value[4];
  if (!hapi_arguments_numbers(argument->text, argument->text + argument->length, 4, value)) {
    return false;
  }
  double largest = 0.0;
  for (int i = 0; i < 4; ++i) {
    largest = fmax(largest, fabs(value[i]));
  }
  if (largest < 1e-9 || largest > 1e9) {
    return false;
  }
  for (int i = 0; i < 4; ++i) {
    argument->number[i] = value[i] / largest; /* the square of 1e-9 would count as no direction */
  }
  hapi_quat_normalize(argument->number);
  return true;
}

static bool read_word(hapi_argument *argument)
{
  for (size_t i = 0; argument->words[i] != NULL; ++i) {
    if (strlen(argument->words[i]) == argument->length &&
        memcmp(argument->words[i], argument->text, argument->length) == 0) {
      argument->word = i;
      return true;
    }
  }
  return false;
}

static bool read_value(hapi_argument *argument)
{
  switch (argument->kind) {
    case HAPI_ARGUMENT_NUMBER:
      return read_numbers(argument, 1);
    case HAPI_ARGUMENT_VECTOR:
      return read_numbers(argument, 3);
    case HAPI_ARGUMENT_QUATERNION:
      return read_quaternion(argument);
    case HAPI_ARGUMENT_WORD:
      return read_word(argument);
    case HAPI_ARGUMENT_TEXT:
      return argument->length > 0;
  }
  return false;
}

static hapi_argument *find_key(const hapi_argument_table *table, slice key)
{
  for (size_t i = 0; i < table->count; ++i) {
    const char *known = table->entries[i].key;
    if (strlen(known) == key.length && memcmp(known, key.text, key.length) == 0) {
      return &table->entries[i];
    }
  }
  return NULL;
}

static hap_status read_item(const hapi_argument_table *table, slice item, hap_detail *detail)
{
  const char *equals = memchr(item.text, '=', item.length);
  if (equals == NULL) {
    return fail_item(table, "expected key=value, not", item, "", detail);
  }
  slice key = {item.text, (size_t)(equals - item.text)};
  hapi_argument *argument = find_key(table, key);
  if (argument == NULL) {
    return fail_item(table, "there is no argument", key, "", detail);
  }
  if (argument->given) {
    return fail_item(table, "argument", key, " is given twice", detail);
  }
  argument->given = true;
  argument->text = equals + 1;
  argument->length = item.length - key.length - 1;
  return read_value(argument) ? HAP_OK : hapi_arguments_fail(table, argument, detail);
}

hap_status hapi_arguments_read(const hapi_argument_table *table, const char *text,
                               hap_detail *detail)
{
  const char *at = text;
  bool more = *text != '\0';
  while (more) {
    slice item = {at, strcspn(at, ",")};
    hap_status status = read_item(table, item, detail);
    if (status < 0) {
      return status;
    }
    at += item.length;
    more = *at == ','; /* so a comma at the end is an empty item, which is refused */
    at += more;
  }
  return HAP_OK;
}
