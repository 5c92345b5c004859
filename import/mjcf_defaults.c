/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "import/mjcf_internal.h"

/* Classes of defaults: an attribute is looked for in the element, in its class, in the classes
 * above it. */

static mjcf_class *class_named(const mjcf *m, const char *name)
{
  for (mjcf_class *of = m->classes; of != NULL; of = of->next) {
    if (strcmp(of->name, name) == 0) {
      return of;
    }
  }
  return NULL;
}

static mjcf_class *class_add(mjcf *m, const char *name, const mjcf_class *parent)
{
  mjcf_class **end = &m->classes;
  while (*end != NULL) {
    end = &(*end)->next;
  }
  *end = import_take(m->work, sizeof **end);
  if (*end != NULL) {
    **end = (mjcf_class){name, parent, NULL};
  }
  return *end;
}

static hap_status section_read(mjcf *m, const xml_element *element, const mjcf_class *parent)
{
  const char *name = xml_get(element, "class");
  if (name == NULL && parent != NULL) {
    return import_refuse(m->work, element->at, "default: without a class");
  }
  mjcf_class *of = parent == NULL ? m->classes : class_named(m, name);
  if (parent == NULL && name != NULL && strcmp(name, "main") != 0 && class_named(m, name) == NULL) {
    m->classes->name = name; /* the top may have any name */
  }
  if (of != NULL && of->parent != parent) {
    return import_refuse(m->work, element->at, "default: class %.60s is there already", name);
  }
  of = of != NULL ? of : class_add(m, name, parent);
  mjcf_section **end = &m->sections;
  while (*end != NULL) {
    end = &(*end)->next;
  }
  *end = import_take(m->work, sizeof **end);
  if (of == NULL || *end == NULL) {
    return import_no_memory(m->work);
  }
  **end = (mjcf_section){of, element, NULL};
  for (const xml_element *child = element->children; child != NULL; child = child->next) {
    if (xml_is(child, "default")) {
      hap_status status = section_read(m, child, of);
      if (status != HAP_OK) {
        return status;
      }
    }
  }
  return HAP_OK;
}

hap_status mjcf_read_defaults(mjcf *m)
{
  if (class_add(m, "main", NULL) == NULL) {
    return import_no_memory(m->work);
  }
  for (const xml_element *top = m->root->children; top != NULL; top = top->next) {
    if (xml_is(top, "default")) {
      hap_status status = section_read(m, top, NULL);
      if (status != HAP_OK) {
        return status;
      }
    }
  }
  return HAP_OK;
}

hap_status mjcf_find_class(mjcf *m, const xml_element *element, const char *attribute,
                           const mjcf_class *otherwise, const mjcf_class **out)
{
  const char *name = xml_get(element, attribute);
  *out = name != NULL ? class_named(m, name) : otherwise;
  return *out != NULL ? HAP_OK
                      : import_refuse(m->work, element->at, "%s: there is no class %.60s",
                                      attribute, name != NULL ? name : "main");
}

hap_status mjcf_item_of(mjcf *m, const xml_element *element, const mjcf_class *childclass,
                        mjcf_item *out)
{
  out->element = element;
  return mjcf_find_class(m, element, "class", childclass, &out->of);
}

/* What the class itself says of elements of that kind; the last section counts. */
static const char *class_get(const mjcf *m, const mjcf_class *of, const char *kind,
                             const char *name)
{
  const char *found = NULL;
  for (const mjcf_section *s = m->sections; s != NULL; s = s->next) {
    for (const xml_element *e = s->of == of ? s->element->children : NULL; e != NULL; e = e->next) {
      const char *value = xml_is(e, kind) ? xml_get(e, name) : NULL;
      found = value != NULL ? value : found;
    }
  }
  return found;
}

const char *mjcf_get(const mjcf *m, const mjcf_item *item, const char *name)
{
  const char *value = xml_get(item->element, name);
  for (const mjcf_class *of = item->of; of != NULL && value == NULL; of = of->parent) {
    value = class_get(m, of, item->element->name, name);
  }
  return value;
}

/* A class may be as deep as the file. */
static hap_status class_numbers(mjcf *m, const mjcf_item *item, const char *name, xml_span span,
                                double *out, size_t *out_count)
{
  const mjcf_item above = {item->element, item->of != NULL ? item->of->parent : NULL};
  if (item->of == NULL) {
    return HAP_OK;
  }
  hap_status status = class_numbers(m, &above, name, span, out, out_count);
  for (const mjcf_section *s = m->sections; s != NULL && status == HAP_OK; s = s->next) {
    for (const xml_element *e = s->of == item->of ? s->element->children : NULL;
         e != NULL && status == HAP_OK; e = e->next) {
      if (xml_is(e, item->element->name)) {
        size_t count;
        status = xml_numbers(m->work, e, name, span, out, &count);
        *out_count = count > *out_count ? count : *out_count;
      }
    }
  }
  return status;
}

hap_status mjcf_numbers(mjcf *m, const mjcf_item *item, const char *name, xml_span span,
                        double *out, size_t *out_count)
{
  size_t count = 0;
  *out_count = 0;
  hap_status status = class_numbers(m, item, name, span, out, out_count);
  if (status == HAP_OK) {
    status = xml_numbers(m->work, item->element, name, span, out, &count);
  }
  *out_count = count > *out_count ? count : *out_count;
  return status;
}

hap_status mjcf_number(mjcf *m, const mjcf_item *item, const char *name, double *io)
{
  size_t count;
  return mjcf_numbers(m, item, name, XML_OF(1, 1), io, &count);
}

hap_status mjcf_word(mjcf *m, const mjcf_item *item, const char *name, const char *words, int *io)
{
  const char *value = mjcf_get(m, item, name);
  if (value == NULL) {
    return HAP_OK;
  }
  int place = 0;
  for (const char *at = words; *at != '\0'; ++place) {
    size_t length = strcspn(at, " ");
    if (strlen(value) == length && memcmp(value, at, length) == 0) {
      *io = place;
      return HAP_OK;
    }
    at += length + (at[length] == ' ' ? 1 : 0);
  }
  return import_refuse(m->work, item->element->at, "%s: \"%.40s\" is none of: %s", name, value,
                       words);
}
