/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "base/log.h"
#include "import/field.h"
#include "import/mjcf_internal.h"
#include "import/path.h"

/* Height fields of the <asset> section, each read once. */

#define SIDE_MOST 4096.0

/* Rows of the text come from the top. */
static hap_status text_read(mjcf *m, const xml_element *element, import_field **out)
{
  double rows = 0.0;
  double columns = 0.0;
  double *given;
  size_t count;
  HAPI_TRY(xml_numbers(m->work, element, "nrow", XML_OF(1, 1), &rows, &count));
  HAPI_TRY(xml_numbers(m->work, element, "ncol", XML_OF(1, 1), &columns, &count));
  if (!(rows >= 1.0 && rows <= SIDE_MOST && columns >= 1.0 && columns <= SIDE_MOST)) {
    return import_refuse(m->work, element->at, "hfield: nrow and ncol are not within 1 and 4096");
  }
  import_field *field = import_take(m->work, sizeof *field);
  const size_t all = (size_t)rows * (size_t)columns;
  double *heights = import_take(m->work, all * sizeof *heights);
  if (field == NULL || heights == NULL) {
    return import_no_memory(m->work);
  }
  *field = (import_field){heights, (uint32_t)columns, (uint32_t)rows};
  HAPI_TRY(mjcf_list(m, element, "elevation", &given, &count));
  if (count != 0 && count != all) {
    return import_refuse(m->work, element->at, "elevation: %zu numbers, and not nrow x ncol",
                         count);
  }
  for (size_t i = 0; i < count; ++i) {
    const size_t row = field->rows - 1 - i / field->columns;
    heights[row * field->columns + i % field->columns] = given[i];
  }
  *out = field;
  return HAP_OK;
}

static hap_status field_read(mjcf *m, const xml_element *element, mjcf_field *out)
{
  const char *file = xml_get(element, "file");
  const char *why = "it has fewer than 2 rows or columns";
  size_t count;
  import_field *field = NULL;
  HAPI_TRY(xml_numbers(m->work, element, "size", XML_OF(4, 4), out->size, &count));
  if (count == 0 || !(out->size[0] > 0.0 && out->size[1] > 0.0 && out->size[2] > 0.0)) {
    return import_refuse(m->work, element->at, "hfield: size is not four numbers above 0");
  }
  if (file == NULL) {
    HAPI_TRY(text_read(m, element, &field));
  } else {
    const char *path = import_path(m->work, m->compiler.mesh_folder, file, &why);
    field = path != NULL ? import_field_file(m->work, path, &why) : NULL;
  }
  if (field == NULL || field->rows < 2 || field->columns < 2) {
    import_note(m->work, element->at, "hfield %.100s left out: %s", file != NULL ? file : "", why);
    return HAP_OK;
  }
  import_field_scale(field, out->size[2]);
  out->field = field;
  return HAP_OK;
}

hap_status mjcf_find_field(mjcf *m, const mjcf_item *geom, const mjcf_field **out)
{
  const char *name = mjcf_get(m, geom, "hfield");
  const xml_element *element = name != NULL ? mjcf_asset(m, "hfield", name) : NULL;
  if (element == NULL) {
    return import_refuse(m->work, geom->element->at, "hfield: there is none named %.60s",
                         name != NULL ? name : "nothing");
  }
  mjcf_field **end = &m->fields;
  for (; *end != NULL; end = &(*end)->next) {
    if ((*end)->element == element) {
      *out = *end;
      return HAP_OK;
    }
  }
  *end = import_take(m->work, sizeof **end);
  if (*end == NULL) {
    return import_no_memory(m->work);
  }
  (*end)->element = element;
  *out = *end;
  return field_read(m, element, *end);
}
