/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/log.h"
#include "base/vec.h"
#include "import/mesh.h"
#include "import/mjcf_internal.h"

#define THINGS_MOST 20000u

enum {
  TYPE_PLANE,
  TYPE_HFIELD,
  TYPE_SPHERE,
  TYPE_CAPSULE,
  TYPE_ELLIPSOID,
  TYPE_CYLINDER,
  TYPE_BOX,
  TYPE_MESH,
  TYPE_SDF
};

#define TYPES "plane hfield sphere capsule ellipsoid cylinder box mesh sdf"

static const int shapes[] = {
    [TYPE_PLANE] = IMPORT_PLANE,
    [TYPE_HFIELD] = IMPORT_FIELD,
    [TYPE_SPHERE] = IMPORT_SPHERE,
    [TYPE_CAPSULE] = IMPORT_CAPSULE,
    [TYPE_ELLIPSOID] = IMPORT_ELLIPSOID,
    [TYPE_CYLINDER] = IMPORT_CYLINDER,
    [TYPE_BOX] = IMPORT_BOX,
    [TYPE_MESH] = IMPORT_MESH,
    [TYPE_SDF] = -1,
};

static size_t sizes_of(int shape)
{
  switch (shape) {
    case IMPORT_PLANE:
    case IMPORT_MESH:
    case IMPORT_FIELD:
      return 0;
    case IMPORT_SPHERE:
      return 1;
    case IMPORT_CAPSULE:
    case IMPORT_CYLINDER:
      return 2;
    default:
      return 3;
  }
}

/* Two ends stand for place, direction and length. */
static hap_status ends_read(mjcf *m, const mjcf_item *item, import_geom *geom, bool *out_there)
{
  double ends[6];
  double along[3];
  size_t count;
  HAPI_TRY(mjcf_numbers(m, item, "fromto", XML_OF(6, 6), ends, &count));
  *out_there = count == 6;
  if (count == 0) {
    return HAP_OK;
  }
  if (geom->shape == IMPORT_SPHERE || geom->shape == IMPORT_PLANE || geom->shape == IMPORT_FIELD) {
    return import_refuse(m->work, item->element->at, "fromto: of no such geom");
  }
  hapi_v3_sub(ends, ends + 3, along);
  double length = hapi_v3_norm(along);
  if (!(length > 1e-12)) {
    return import_refuse(m->work, item->element->at, "fromto: has no length");
  }
  if (geom->shape == IMPORT_BOX || geom->shape == IMPORT_ELLIPSOID) {
    geom->size[1] = geom->size[0];
    geom->size[2] = 0.5 * length;
  } else {
    geom->size[1] = 0.5 * length;
  }
  for (int k = 0; k < 3; ++k) {
    geom->pose.position[k] = 0.5 * (ends[k] + ends[k + 3]);
  }
  mjcf_turn_z(along, geom->pose.quat_wxyz);
  return HAP_OK;
}

static hap_status size_read(mjcf *m, const mjcf_item *item, import_geom *geom)
{
  bool ends;
  size_t count;
  HAPI_TRY(mjcf_numbers(m, item, "size", XML_OF(1, 3), geom->size, &count));
  HAPI_TRY(mjcf_pose(m, item, &geom->pose));
  HAPI_TRY(ends_read(m, item, geom, &ends));
  for (size_t i = 0; i < sizes_of((int)geom->shape); ++i) {
    if (!(geom->size[i] > 0.0)) {
      return import_refuse(m->work, item->element->at, "size: number %zu is not above 0", i + 1);
    }
  }
  return HAP_OK;
}

/* A height field weighs as a box of its mean height, base included, as MuJoCo has it. */
static void field_mass(const mjcf_field *field, double density, import_mass *out)
{
  const double half[3] = {field->size[0], field->size[1],
                          0.25 * field->size[2] + 0.5 * field->size[3]};
  import_shape_mass(IMPORT_BOX, half, density, out);
}

static hap_status mass_read(mjcf *m, const mjcf_item *item, const mjcf_mesh *of,
                            const mjcf_field *field, import_geom *geom)
{
  double density = 1000.0;
  double mass = -1.0;
  double group = 0.0;
  HAPI_TRY(mjcf_number(m, item, "density", &density));
  HAPI_TRY(mjcf_number(m, item, "mass", &mass));
  HAPI_TRY(mjcf_number(m, item, "group", &group));
  if (density < 0.0) {
    return import_refuse(m->work, item->element->at, "density: below 0");
  }
  if (group < m->compiler.groups[0] || group > m->compiler.groups[1]) {
    return HAP_OK;
  }
  import_mass own;
  if (of != NULL) {
    own = of->mass;
    import_mass_scale(&own, density);
  } else if (field != NULL) {
    field_mass(field, density, &own);
  } else {
    import_shape_mass(geom->shape, geom->size, mass >= 0.0 ? 1.0 : density, &own);
  }
  if (mass >= 0.0 && own.mass > 0.0) {
    import_mass_scale(&own, mass / own.mass);
  }
  import_mass_place(&geom->pose, &own, &geom->mass);
  return HAP_OK;
}

/* rgba stands over the material's; without both it is the middle grey of MuJoCo. */
static hap_status colour_read(mjcf *m, const mjcf_item *item, import_geom *geom)
{
  double rgba[4] = {0.5, 0.5, 0.5, 1.0};
  size_t count;
  const char *material = mjcf_get(m, item, "material");
  for (const xml_element *top = m->root->children; top != NULL && material != NULL;
       top = top->next) {
    for (const xml_element *e = xml_is(top, "asset") ? top->children : NULL; e != NULL;
         e = e->next) {
      const char *name = xml_is(e, "material") ? xml_get(e, "name") : NULL;
      if (name != NULL && strcmp(name, material) == 0) {
        rgba[0] = rgba[1] = rgba[2] = 1.0;
        HAPI_TRY(xml_numbers(m->work, e, "rgba", XML_OF(4, 4), rgba, &count));
      }
    }
  }
  HAPI_TRY(mjcf_numbers(m, item, "rgba", XML_OF(3, 4), rgba, &count));
  for (int k = 0; k < 4; ++k) {
    geom->colour_rgba[k] = (float)hapi_min(hapi_max(rgba[k], 0.0), 1.0);
  }
  return HAP_OK;
}

static hap_status contact_read(mjcf *m, const mjcf_item *item, import_geom *geom)
{
  double friction[3] = {1.0, 0.0, 0.0};
  double category = 1.0;
  double collide = 1.0;
  size_t count;
  HAPI_TRY(mjcf_numbers(m, item, "friction", XML_OF(1, 3), friction, &count));
  HAPI_TRY(mjcf_number(m, item, "contype", &category));
  HAPI_TRY(mjcf_number(m, item, "conaffinity", &collide));
  if (!(friction[0] >= 0.0) || !(category >= 0.0 && category <= 4294967295.0) ||
      !(collide >= 0.0 && collide <= 4294967295.0)) {
    return import_refuse(m->work, item->element->at, "friction, contype or conaffinity: below 0");
  }
  geom->friction = hapi_min(friction[0], 1e6);
  geom->category_bits = (uint32_t)category;
  geom->collide_bits = (uint32_t)collide;
  geom->collides = geom->category_bits != 0 || geom->collide_bits != 0;
  return HAP_OK;
}

static import_geom *geom_add(mjcf *m, import_body *body)
{
  import_geom **end = &body->geoms;
  while (*end != NULL) {
    end = &(*end)->next;
  }
  *end = import_take(m->work, sizeof **end);
  return *end;
}

/* The mesh of a geom that has one; *out_why not NULL: the geom is left out. */
static hap_status surface_read(mjcf *m, const mjcf_item *item, int shape, const mjcf_mesh **out,
                               const mjcf_field **out_field, const char **out_why)
{
  *out = NULL;
  *out_field = NULL;
  *out_why = NULL;
  if (shape < 0) {
    *out_why = "of no such shape";
  } else if (shape == IMPORT_MESH) {
    HAPI_TRY(mjcf_find_mesh(m, item, out));
    *out_why = (*out)->hull == NULL ? "its mesh is" : NULL;
  } else if (shape == IMPORT_FIELD) {
    HAPI_TRY(mjcf_find_field(m, item, out_field));
    *out_why = (*out_field)->field == NULL ? "its height field is" : NULL;
  } else if (mjcf_get(m, item, "mesh") != NULL) {
    *out_why = "its size is that of a mesh";
  }
  return HAP_OK;
}

hap_status mjcf_read_geom(mjcf *m, const mjcf_item *item, const hap_pose *frame, import_body *body)
{
  int type = TYPE_SPHERE;
  const char *name = xml_get(item->element, "name");
  HAPI_TRY(mjcf_word(m, item, "type", TYPES, &type));
  const mjcf_mesh *mesh;
  const mjcf_field *field;
  const char *why;
  HAPI_TRY(surface_read(m, item, shapes[type], &mesh, &field, &why));
  if (why != NULL) {
    import_note(m->work, item->element->at, "geom %.60s left out, and its mass: %s",
                name != NULL ? name : "without a name", why);
    return HAP_OK;
  }
  if (++m->things > THINGS_MOST) {
    return import_refuse(m->work, item->element->at, "more than 20000 geoms and joints");
  }
  import_geom *geom = geom_add(m, body);
  if (geom == NULL) {
    return import_no_memory(m->work);
  }
  geom->at = item->element->at;
  geom->name = name != NULL ? name : "";
  geom->shape = (import_shape)shapes[type];
  HAPI_TRY(size_read(m, item, geom));
  import_pose_join(frame, &geom->pose, &geom->pose);
  geom->mesh = mesh != NULL                      ? mesh->hull
               : geom->shape == IMPORT_ELLIPSOID ? import_ellipsoid(m->work, geom->size, &why)
                                                 : NULL;
  if (field != NULL) {
    geom->field = field->field;
    memcpy(geom->size, field->size, 2 * sizeof geom->size[0]);
  }
  HAPI_TRY(mass_read(m, item, mesh, field, geom));
  HAPI_TRY(colour_read(m, item, geom));
  return contact_read(m, item, geom);
}
