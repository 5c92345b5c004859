/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "base/log.h"
#include "base/vec.h"
#include "import/mesh.h"
#include "import/mesh_file.h"
#include "import/mjcf_internal.h"
#include "import/path.h"

/* Meshes of the <asset> section, each read once. */

#define NUMBERS_MOST 3000000u

/* "folder/wheel.stl" is called wheel. */
static bool asset_is_named(const xml_element *element, const char *name)
{
  const char *own = xml_get(element, "name");
  const char *file = xml_get(element, "file");
  if (own != NULL || file == NULL) {
    return own != NULL && strcmp(own, name) == 0;
  }
  const char *slash = strrchr(file, '/');
  const char *base = slash != NULL ? slash + 1 : file;
  const char *dot = strrchr(base, '.');
  size_t length = dot != NULL ? (size_t)(dot - base) : strlen(base);
  return strlen(name) == length && memcmp(base, name, length) == 0;
}

const xml_element *mjcf_asset(const mjcf *m, const char *kind, const char *name)
{
  for (const xml_element *top = m->root->children; top != NULL; top = top->next) {
    for (const xml_element *e = xml_is(top, "asset") ? top->children : NULL; e != NULL;
         e = e->next) {
      if (xml_is(e, kind) && asset_is_named(e, name)) {
        return e;
      }
    }
  }
  return NULL;
}

hap_status mjcf_list(mjcf *m, const xml_element *element, const char *name, double **out,
                     size_t *out_count)
{
  const char *text = xml_get(element, name);
  size_t most = text != NULL ? strlen(text) / 2 + 1 : 0;
  most = most < NUMBERS_MOST ? most : NUMBERS_MOST;
  *out_count = 0;
  *out = import_take(m->work, (most + 1) * sizeof **out);
  return *out == NULL ? import_no_memory(m->work)
                      : xml_numbers(m->work, element, name, XML_OF(0, most), *out, out_count);
}

static hap_status inline_read(mjcf *m, const xml_element *element, import_mesh **out)
{
  double *points;
  double *faces;
  size_t numbers;
  size_t corners;
  HAPI_TRY(mjcf_list(m, element, "vertex", &points, &numbers));
  HAPI_TRY(mjcf_list(m, element, "face", &faces, &corners));
  import_mesh *mesh = import_take(m->work, sizeof *mesh);
  uint32_t *list = import_take(m->work, (corners + 1) * sizeof *list);
  if (mesh == NULL || list == NULL) {
    return import_no_memory(m->work);
  }
  const size_t vertices = numbers / 3;
  for (size_t i = 0; i < corners; ++i) {
    if (!(faces[i] >= 0.0 && faces[i] < (double)vertices)) {
      return import_refuse(m->work, element->at, "face: there is no vertex %g", faces[i]);
    }
    list[i] = (uint32_t)faces[i];
  }
  *mesh = (import_mesh){points, list, vertices, corners / 3};
  *out = mesh;
  return HAP_OK;
}

/* NULL in *out: it was told why. */
static hap_status file_read(mjcf *m, const xml_element *element, const char *file,
                            import_mesh **out)
{
  const char *why;
  const char *path = import_path(m->work, m->compiler.mesh_folder, file, &why);
  *out = path != NULL ? import_mesh_file(m->work, path, &why) : NULL;
  if (*out == NULL) {
    import_note(m->work, element->at, "mesh %.100s left out: %s", file, why);
  }
  return HAP_OK;
}

static hap_status vertices_place(mjcf *m, const mjcf_item *item, import_mesh *mesh)
{
  double scale[3] = {1.0, 1.0, 1.0};
  hap_pose reference = {.quat_wxyz = {1.0, 0.0, 0.0, 0.0}};
  size_t count;
  HAPI_TRY(mjcf_numbers(m, item, "scale", XML_OF(3, 3), scale, &count));
  HAPI_TRY(mjcf_numbers(m, item, "refpos", XML_OF(3, 3), reference.position, &count));
  HAPI_TRY(mjcf_numbers(m, item, "refquat", XML_OF(4, 4), reference.quat_wxyz, &count));
  hapi_quat_normalize(reference.quat_wxyz);
  double *placed = import_take(m->work, (3 * mesh->vertex_count + 1) * sizeof *placed);
  if (placed == NULL) {
    return import_no_memory(m->work);
  }
  for (size_t i = 0; i < 3 * mesh->vertex_count; i += 3) {
    hapi_pose_unpoint(reference.position, reference.quat_wxyz, mesh->vertices_xyz + i, placed + i);
    for (size_t k = 0; k < 3; ++k) {
      placed[i + k] *= scale[k];
    }
  }
  mesh->vertices_xyz = placed;
  return HAP_OK;
}

static hap_status mass_find(mjcf *m, const mjcf_item *item, const import_mesh *mesh, mjcf_mesh *out)
{
  enum {
    INERTIA_LEGACY,
    INERTIA_EXACT,
    INERTIA_SHELL,
    INERTIA_CONVEX
  };
  int inertia = INERTIA_LEGACY;
  HAPI_TRY(mjcf_word(m, item, "inertia", "legacy exact shell convex", &inertia));
  const bool of_hull = inertia == INERTIA_CONVEX || mesh->triangle_count == 0;
  import_mesh_mass(of_hull ? out->hull : mesh,
                   inertia == INERTIA_CONVEX ? IMPORT_FILLED : (import_filling)inertia, 1.0,
                   &out->mass);
  if (!(out->mass.mass > 0.0)) {
    import_note(m->work, item->element->at, "mesh: mass left out, its triangles enclose none");
  }
  return HAP_OK;
}

static hap_status mesh_read(mjcf *m, const xml_element *element, mjcf_mesh *out)
{
  mjcf_item item;
  const char *why = "it has no points";
  const char *file = xml_get(element, "file");
  import_mesh *mesh = NULL;
  HAPI_TRY(mjcf_item_of(m, element, m->classes, &item));
  HAPI_TRY(file != NULL ? file_read(m, element, file, &mesh) : inline_read(m, element, &mesh));
  if (mesh == NULL) {
    return HAP_OK;
  }
  HAPI_TRY(vertices_place(m, &item, mesh));
  out->hull = mesh->vertex_count > 3
                  ? import_hull(m->work, mesh->vertices_xyz, mesh->vertex_count, &why)
                  : NULL;
  if (out->hull == NULL) {
    import_note(m->work, element->at, "mesh left out: %s", why);
    return HAP_OK;
  }
  return mass_find(m, &item, mesh, out);
}

hap_status mjcf_find_mesh(mjcf *m, const mjcf_item *geom, const mjcf_mesh **out)
{
  const char *name = mjcf_get(m, geom, "mesh");
  const xml_element *element = name != NULL ? mjcf_asset(m, "mesh", name) : NULL;
  if (element == NULL) {
    return import_refuse(m->work, geom->element->at, "mesh: there is none named %.60s",
                         name != NULL ? name : "nothing");
  }
  mjcf_mesh **end = &m->meshes;
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
  return mesh_read(m, element, *end);
}
