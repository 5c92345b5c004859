/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "import/import.h"

#include <string.h>

#include "base/log.h"
#include "import/build.h"
#include "import/include.h"
#include "import/mjcf.h"
#include "import/path.h"
#include "import/urdf.h"
#include "import/xml.h"

hap_status import_read(import_work *work, const char *path, import_model *out)
{
  xml_element *root = NULL;
  const char *slash = strrchr(path, '/');
  const char *base = slash != NULL ? slash + 1 : path;
  const char *name = import_text(work, base, strlen(base));
  if (name == NULL) {
    return import_no_memory(work);
  }
  HAPI_TRY(import_folder(work, path));
  HAPI_TRY(xml_read(work, path, name, &root));
  if (!xml_is(root, "mujoco") && !xml_is(root, "robot")) {
    return import_refuse(work, root->at, "<%.60s> is neither <mujoco> nor <robot>", root->name);
  }
  if (xml_is(root, "mujoco")) {
    HAPI_TRY(xml_include(work, root));
  }
  HAPI_TRY(xml_is(root, "robot") ? urdf_read(work, root, out) : mjcf_read(work, root, out));
  if (work->starved) {
    return import_no_memory(work);
  }
  import_model_join(out);
  return work->failed;
}

static hap_status scene_make(import_work *work, const char *path, hap_scene **out)
{
  import_model model;
  hap_scene_def def;
  hap_scene_def_init(&def, sizeof def);
  HAPI_TRY(import_read(work, path, &model));
  memcpy(def.gravity, model.gravity, sizeof def.gravity);
  HAPI_TRY(hap_scene_create(&def, out, work->detail));
  hap_status status = import_build(work, &model, *out);
  status = status == HAP_OK ? work->failed : status;
  if (status != HAP_OK) {
    (void)hap_scene_destroy(*out);
    *out = NULL;
  }
  return status;
}

hap_status import_scene(const char *path, const import_options *options, hap_scene **out,
                        size_t *out_notes, hap_detail *detail)
{
  import_work work = {.detail = detail};
  if (path == NULL || out == NULL) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "%s is NULL", path == NULL ? "path" : "out");
  }
  *out = NULL;
  if (options != NULL) {
    work.strict = options->strict;
    work.said = options->said;
    work.user = options->user;
  }
  hap_status status = scene_make(&work, path, out);
  if (out_notes != NULL) {
    *out_notes = work.note_count;
  }
  import_work_finish(&work);
  return status;
}
