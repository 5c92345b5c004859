/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "bench/points.h"

#include <stdlib.h>
#include <string.h>

static const point_field *field_find(const point_field *fields, size_t count, const char *key,
                                     size_t length)
{
  for (size_t i = 0; i < count; ++i) {
    if (strlen(fields[i].key) == length && strncmp(fields[i].key, key, length) == 0) {
      return &fields[i];
    }
  }
  return NULL;
}

/* One of the list. */
static bool key_is_known(const char *keys, const char *key, size_t length)
{
  for (const char *at = keys; *at != '\0';) {
    size_t size = strcspn(at, ",");
    if (size == length && strncmp(at, key, length) == 0) {
      return true;
    }
    at += size;
    at += strspn(at, ", ");
  }
  return false;
}

/* *out_has: the value, up to `length`, is the field's. False: not a value of such a field. */
static bool field_compare(const point_field *f, const char *value, size_t length, bool *out_has)
{
  if (f->word != NULL) {
    *out_has = strlen(f->word) == length && strncmp(f->word, value, length) == 0;
    return length > 0;
  }
  char *end = NULL;
  *out_has = strtod(value, &end) == f->number;
  return length > 0 && end == value + length;
}

/* One "KEY=VALUE/VALUE" of this length; field NULL: another map has the key. */
static bool values_look_at(const char *item, size_t length, const point_field *field,
                           bool *io_takes)
{
  bool any = false;
  for (size_t at = strcspn(item, "="); at < length && field != NULL;) {
    const char *value = item + at + 1;
    size_t size = strcspn(value, "/,");
    bool has = false;
    if (!field_compare(field, value, size, &has)) {
      return false;
    }
    any = any || has;
    at += 1 + size;
  }
  *io_takes = *io_takes && any;
  return true;
}

hap_status points_filter(bench *b, const point_field *fields, size_t count, const char *keys,
                         bool *out_takes)
{
  *out_takes = true;
  for (const char *item = b->only; item != NULL && *item != '\0';) {
    size_t length = strcspn(item, ",");
    size_t key = strcspn(item, "=,");
    const point_field *field = field_find(fields, count, item, key);
    if (key >= length || !(field != NULL || key_is_known(keys, item, key)) ||
        !values_look_at(item, length, field, out_takes)) {
      return bench_fail(b, HAP_ERROR_ARGUMENT,
                        "--only: \"%.*s\" is not KEY=VALUE or KEY=VALUE/VALUE; keys are %s",
                        (int)length, item, keys);
    }
    item += length + (item[length] == ',');
  }
  return HAP_OK;
}
