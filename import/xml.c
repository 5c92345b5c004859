/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "import/xml.h"

#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

#include <expat.h>

#include "base/alloc.h"
#include "base/log.h"
#include "base/number.h"
#include "base/regular.h"

#define BYTES_MOST (32u << 20)
#define DEPTH_MOST 256u
#define ELEMENTS_MOST 500000u
#define NUMBER_MOST 1e12
#define READ_SIZE 65536

typedef struct xml_reading {
  import_work *work;
  XML_Parser parser;
  const char *name;
  xml_element *root;
  xml_element *open;
  xml_element *last; /* child of open that ended last; NULL: none yet */
  size_t depth;
  size_t elements;
  hap_status status;
} xml_reading;

static void reading_stop(xml_reading *r, const char *why)
{
  import_place at = {r->name, (int)XML_GetCurrentLineNumber(r->parser)};
  if (r->status == HAP_OK) {
    r->status = why != NULL ? import_refuse(r->work, at, "%s", why) : import_no_memory(r->work);
  }
  XML_StopParser(r->parser, XML_FALSE);
}

static bool attributes_take(xml_reading *r, xml_element *element, const char **list)
{
  xml_attribute **end = &element->attributes;
  for (; list[0] != NULL; list += 2) {
    xml_attribute *a = import_take(r->work, sizeof *a);
    char *name = import_text(r->work, list[0], strlen(list[0]));
    char *value = import_text(r->work, list[1], strlen(list[1]));
    if (a == NULL || name == NULL || value == NULL) {
      return false;
    }
    *a = (xml_attribute){name, value, NULL};
    *end = a;
    end = (xml_attribute **)&a->next;
  }
  return true;
}

static void element_begin(void *user, const char *name, const char **attributes)
{
  xml_reading *r = user;
  if (r->status != HAP_OK) {
    return;
  }
  if (++r->depth > DEPTH_MOST || ++r->elements > ELEMENTS_MOST) {
    reading_stop(r, r->depth > DEPTH_MOST ? "more than 256 levels" : "more than 500000 elements");
    return;
  }
  xml_element *element = import_take(r->work, sizeof *element);
  char *copy = import_text(r->work, name, strlen(name));
  if (element == NULL || copy == NULL || !attributes_take(r, element, attributes)) {
    reading_stop(r, NULL);
    return;
  }
  element->name = copy;
  element->at = (import_place){r->name, (int)XML_GetCurrentLineNumber(r->parser)};
  element->parent = r->open;
  if (r->last != NULL) {
    r->last->next = element;
  } else if (r->open != NULL) {
    r->open->children = element;
  } else {
    r->root = element;
  }
  r->open = element;
  r->last = NULL;
}

static void element_end(void *user, const char *name)
{
  xml_reading *r = user;
  (void)name;
  if (r->status == HAP_OK) {
    --r->depth;
    r->last = r->open;
    r->open = r->open->parent;
  }
}

/* Its entities may stand for others, without an end. No scene needs one. */
static void doctype_seen(void *user, const XML_Char *name, const XML_Char *system,
                         const XML_Char *public_id, int has_subset)
{
  (void)name, (void)system, (void)public_id;
  if (has_subset != 0) {
    reading_stop(user, "a document type with declarations");
  }
}

static hap_status file_parse(xml_reading *r, FILE *file)
{
  size_t all = 0;
  bool ended = false;
  while (!ended) {
    void *buffer = XML_GetBuffer(r->parser, READ_SIZE);
    if (buffer == NULL) {
      return import_no_memory(r->work);
    }
    size_t size = fread(buffer, 1, READ_SIZE, file);
    if (ferror(file) != 0) {
      return hapi_fail(r->work->detail, HAP_ERROR_IO, "%.300s: cannot be read: %s", r->name,
                       strerror(errno));
    }
    all += size;
    if (all > BYTES_MOST) {
      return import_refuse(r->work, (import_place){r->name, 1}, "more than 32 MiB");
    }
    ended = size < READ_SIZE;
    if (XML_ParseBuffer(r->parser, (int)size, ended) != XML_STATUS_OK && r->status == HAP_OK) {
      import_place at = {r->name, (int)XML_GetCurrentLineNumber(r->parser)};
      enum XML_Error why = XML_GetErrorCode(r->parser);
      return why == XML_ERROR_NO_MEMORY
                 ? import_no_memory(r->work)
                 : import_refuse(r->work, at, "no XML: %s", XML_ErrorString(why));
    }
    if (r->status != HAP_OK) {
      return r->status;
    }
  }
  return HAP_OK;
}

/* The parser's memory comes from where all comes from. */
static void *parser_take(size_t size)
{
  size_t *block = size < SIZE_MAX / 2 ? hapi_alloc(size + sizeof(max_align_t)) : NULL;
  if (block == NULL) {
    return NULL;
  }
  *block = size;
  return (char *)block + sizeof(max_align_t);
}

static void parser_give(void *memory)
{
  if (memory != NULL) {
    hapi_free((char *)memory - sizeof(max_align_t));
  }
}

static void *parser_grow(void *memory, size_t size)
{
  void *more = parser_take(size);
  if (more != NULL && memory != NULL) {
    size_t before = *(size_t *)(void *)((char *)memory - sizeof(max_align_t));
    memcpy(more, memory, before < size ? before : size);
    parser_give(memory);
  }
  return more;
}

hap_status xml_read(import_work *work, const char *path, const char *name, xml_element **out)
{
  static const XML_Memory_Handling_Suite memory = {parser_take, parser_grow, parser_give};
  const char *why;
  FILE *file = hapi_regular_open(path, &why);
  if (file == NULL) {
    return hapi_fail(work->detail, HAP_ERROR_NOT_FOUND, "%.300s: cannot be read: %s", path, why);
  }
  xml_reading r = {.work = work, .name = name, .parser = XML_ParserCreate_MM(NULL, &memory, NULL)};
  hap_status status = HAP_ERROR_MEMORY;
  if (r.parser == NULL) {
    status = import_no_memory(work);
  } else {
    XML_SetUserData(r.parser, &r);
    XML_SetElementHandler(r.parser, element_begin, element_end);
    XML_SetStartDoctypeDeclHandler(r.parser, doctype_seen);
    XML_SetHashSalt(r.parser, 0x68617065u); /* runs are the same */
    status = file_parse(&r, file);
    XML_ParserFree(r.parser);
  }
  fclose(file);
  *out = r.root;
  return status;
}

const char *xml_get(const xml_element *element, const char *name)
{
  for (const xml_attribute *a = element->attributes; a != NULL; a = a->next) {
    if (strcmp(a->name, name) == 0) {
      return a->value;
    }
  }
  return NULL;
}

bool xml_is(const xml_element *element, const char *name)
{
  return strcmp(element->name, name) == 0;
}

xml_element *xml_child(const xml_element *element, const char *name)
{
  for (xml_element *child = element->children; child != NULL; child = child->next) {
    if (xml_is(child, name)) {
      return child;
    }
  }
  return NULL;
}

bool xml_word_in(const char *word, const char *list)
{
  size_t length = strlen(word);
  for (const char *at = list; length > 0 && (at = strstr(at, word)) != NULL; at += length) {
    if ((at == list || at[-1] == ' ') && (at[length] == ' ' || at[length] == '\0')) {
      return true;
    }
  }
  return false;
}

hap_status xml_numbers(import_work *work, const xml_element *element, const char *name,
                       xml_span span, double *out, size_t *out_count)
{
  static const char blanks[] = " \t\r\n";
  const char *text = xml_get(element, name);
  *out_count = 0;
  if (text == NULL) {
    return HAP_OK;
  }
  size_t count = 0;
  for (const char *at = text + strspn(text, blanks); *at != '\0'; at += strspn(at, blanks)) {
    double value;
    const char *end = hapi_number_read(at, &value);
    if (end == NULL || (*end != '\0' && strchr(blanks, *end) == NULL)) {
      return import_refuse(work, element->at, "%s: \"%.40s\" is no number", name, at);
    }
    if (!(fabs(value) <= NUMBER_MOST)) {
      return import_refuse(work, element->at, "%s: a number beyond 1e12", name);
    }
    if (count == span.most) {
      return import_refuse(work, element->at, "%s: more than %zu numbers", name, span.most);
    }
    out[count++] = value;
    at = end;
  }
  if (count < span.least) {
    return import_refuse(work, element->at, "%s: %zu numbers, and not %zu", name, count,
                         span.least);
  }
  *out_count = count;
  return HAP_OK;
}
