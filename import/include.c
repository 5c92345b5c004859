/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "import/include.h"

#include "base/log.h"
#include "import/path.h"

#define FILES_MOST 64u

static hap_status include_walk(import_work *work, xml_element *element, size_t *files);

static hap_status include_read(import_work *work, const xml_element *element, size_t *files,
                               xml_element **out)
{
  const char *why = "it names no file";
  const char *file = xml_get(element, "file");
  const char *path = file != NULL ? import_path(work, "", file, &why) : NULL;
  if (path == NULL) {
    return import_refuse(work, element->at, "include %.100s: %s", file != NULL ? file : "", why);
  }
  if (++*files > FILES_MOST) {
    return import_refuse(work, element->at, "include: more than 64 files, or a file in itself");
  }
  HAPI_TRY(xml_read(work, path, file, out));
  return include_walk(work, *out, files);
}

static hap_status include_walk(import_work *work, xml_element *element, size_t *files)
{
  xml_element **at = &element->children;
  while (*at != NULL) {
    xml_element *root = NULL;
    if (!xml_is(*at, "include")) {
      HAPI_TRY(include_walk(work, *at, files));
      at = &(*at)->next;
      continue;
    }
    HAPI_TRY(include_read(work, *at, files, &root));
    xml_element *rest = (*at)->next;
    *at = root != NULL ? root->children : NULL;
    for (; *at != NULL; at = &(*at)->next) {
      (*at)->parent = element;
    }
    *at = rest;
  }
  return HAP_OK;
}

hap_status xml_include(import_work *work, xml_element *root)
{
  size_t files = 0;
  return include_walk(work, root, &files);
}
