/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <stdlib.h>
#include <string.h>

#include "bench/stability_table.h"

/* --only KEY=VALUE[/VALUE],...: points that have one of the values at each of the keys. */

#define KEYS                                                                              \
  "integrator, stiffness, mass, contacts, coupling, layout, hand, delay_ticks, quantum, " \
  "missed, body"

/* What a point has at a key: a word or, word NULL, a number. */
typedef struct field {
  const char *word;
  double number;
} field;

static bool find_word(const stability_row *row, const char *key, size_t length, field *out)
{
  const stability_point *p = &row->point;
  const struct {
    const char *key;
    const char *word;
  } words[] = {
      {"integrator", row->integrator},
      {"coupling", stability_coupling_word(p->coupling)},
      {"layout", stability_layout_word(p->layout)},
      {"hand", stability_hand_word(p->hand)},
      {"body", p->cubes ? "cube" : "ball"},
  };
  for (size_t i = 0; i < sizeof words / sizeof words[0]; ++i) {
    if (strlen(words[i].key) == length && strncmp(words[i].key, key, length) == 0) {
      out->word = words[i].word;
      return true;
    }
  }
  return false;
}

static bool find_number(const stability_row *row, const char *key, size_t length, field *out)
{
  const stability_point *p = &row->point;
  const struct {
    const char *key;
    double number;
  } numbers[] = {
      {"stiffness", p->stiffness},     {"mass", p->mass},       {"contacts", p->contacts},
      {"delay_ticks", p->delay_ticks}, {"quantum", p->quantum}, {"missed", p->missed ? 1.0 : 0.0},
  };
  for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; ++i) {
    if (strlen(numbers[i].key) == length && strncmp(numbers[i].key, key, length) == 0) {
      *out = (field){.number = numbers[i].number};
      return true;
    }
  }
  return false;
}

/* *out_has: the value, up to `length`, is the field's. False: not a value of such a field. */
static bool compare(const field *f, const char *value, size_t length, bool *out_has)
{
  if (f->word != NULL) {
    *out_has = strlen(f->word) == length && strncmp(f->word, value, length) == 0;
    return length > 0;
  }
  char *end = NULL;
  *out_has = strtod(value, &end) == f->number;
  return length > 0 && end == value + length;
}

/* One "KEY=VALUE/VALUE" of this length. */
static bool look_at(const char *item, size_t length, const stability_row *row, bool *io_takes)
{
  size_t key = strcspn(item, "=,");
  field f = {NULL, 0.0};
  bool any = false;
  if (key >= length || (!find_word(row, item, key, &f) && !find_number(row, item, key, &f))) {
    return false;
  }
  for (size_t at = key; at < length;) {
    const char *value = item + at + 1;
    size_t size = strcspn(value, "/,");
    bool has = false;
    if (!compare(&f, value, size, &has)) {
      return false;
    }
    any = any || has;
    at += 1 + size;
  }
  *io_takes = *io_takes && any;
  return true;
}

hap_status stability_filter(bench *b, const stability_row *row, bool *out_takes)
{
  *out_takes = true;
  for (const char *item = b->only; item != NULL && *item != '\0';) {
    size_t length = strcspn(item, ",");
    if (!look_at(item, length, row, out_takes)) {
      return bench_fail(b, HAP_ERROR_ARGUMENT,
                        "--only: \"%.*s\" is not KEY=VALUE or KEY=VALUE/VALUE; keys are " KEYS,
                        (int)length, item);
    }
    item += length + (item[length] == ',');
  }
  return HAP_OK;
}
