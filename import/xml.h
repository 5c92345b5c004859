/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_IMPORT_XML_H
#define HAPODE_IMPORT_XML_H

/* A file as a tree of elements that know their lines. */

#include "import/notes.h"

typedef struct xml_attribute {
  const char *name;
  const char *value;
  const struct xml_attribute *next;
} xml_attribute;

typedef struct xml_element {
  const char *name;
  import_place at;
  xml_attribute *attributes;
  struct xml_element *parent;
  struct xml_element *children;
  struct xml_element *next;
} xml_element;

/* The root of a regular file. HAP_ERROR_FORMAT: no XML, or one of the limits: 32 MiB, 256 levels,
 * 500000 elements, no document type of its own. HAP_ERROR_NOT_FOUND: it cannot be opened.
 * HAP_ERROR_MEMORY. name: how lines call it; lives as long as the tree. */
HAP_NODISCARD hap_status xml_read(import_work *work, const char *path, const char *name,
                                  xml_element **out);

/* NULL: there is none. */
const char *xml_get(const xml_element *element, const char *name);
bool xml_is(const xml_element *element, const char *name);
/* The first child of that name; NULL: there is none. */
xml_element *xml_child(const xml_element *element, const char *name);
/* A word of a list that blanks part. */
bool xml_word_in(const char *word, const char *list);

/* How many numbers there may be. */
typedef struct xml_span {
  size_t least;
  size_t most;
} xml_span;

#define XML_OF(least, most) ((xml_span){(least), (most)})

/* Up to span.most numbers of an attribute into out; how many there were in *out_count. What is
 * behind them stays as it is. Without the attribute nothing is written and *out_count is 0.
 * Refused: no numbers, fewer than span.least, more than span.most, one beyond 1e12. */
HAP_NODISCARD hap_status xml_numbers(import_work *work, const xml_element *element,
                                     const char *name, xml_span span, double *out,
                                     size_t *out_count);

#endif
