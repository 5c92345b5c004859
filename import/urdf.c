/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "import/urdf.h"

#include <math.h>
#include <string.h>

#include "base/log.h"
#include "base/number.h"
#include "base/vec.h"
#include "import/mesh.h"
#include "import/mesh_file.h"
#include "import/path.h"

#define LINKS_MOST 5000u
#define DEPTH_MOST 500u
#define NUMBER_MOST 1e12 /* as xml_numbers */
#define DENSITY 1000.0   /* kg/m^3, of links without <inertial>, as MuJoCo has it */

typedef struct urdf {
  import_work *work;
  import_model *model;
  const xml_element *root;
  import_body *last_body;
  size_t links;
} urdf;

static hap_status origin_read(urdf *u, const xml_element *of, hap_pose *out)
{
  double rpy[3] = {0.0, 0.0, 0.0};
  size_t count;
  const xml_element *origin = xml_child(of, "origin");
  *out = (hap_pose){.quat_wxyz = {1.0, 0.0, 0.0, 0.0}};
  if (origin == NULL) {
    return HAP_OK;
  }
  HAPI_TRY(xml_numbers(u->work, origin, "xyz", XML_OF(3, 3), out->position, &count));
  HAPI_TRY(xml_numbers(u->work, origin, "rpy", XML_OF(3, 3), rpy, &count));
  for (int k = 0; k < 3; ++k) { /* about the axes of the parent */
    double turn[4] = {cos(0.5 * rpy[k]), 0.0, 0.0, 0.0};
    turn[1 + k] = sin(0.5 * rpy[k]);
    hapi_quat_multiply(turn, out->quat_wxyz, out->quat_wxyz);
  }
  return HAP_OK;
}

/* Of a child element's attribute; without either *io stays. */
static hap_status value_read(urdf *u, const xml_element *of, const char *child, const char *name,
                             double *io)
{
  size_t count;
  const xml_element *element = xml_child(of, child);
  return element != NULL ? xml_numbers(u->work, element, name, XML_OF(1, 1), io, &count) : HAP_OK;
}

/* Beyond all numbers that may be: there is none. */
static hap_status stop_read(urdf *u, const xml_element *of, const char *name, double *io)
{
  const xml_element *limit = xml_child(of, "limit");
  const char *text = limit != NULL ? xml_get(limit, name) : NULL;
  double value;
  if (text != NULL && hapi_number_read(text, &value) != NULL && fabs(value) > NUMBER_MOST) {
    *io = copysign(INFINITY, value);
    return HAP_OK;
  }
  return value_read(u, of, "limit", name, io);
}

static hap_status inertial_read(urdf *u, const xml_element *link, import_body *body)
{
  static const char *const names[6] = {"ixx", "iyy", "izz", "ixy", "ixz", "iyz"};
  const xml_element *inertial = xml_child(link, "inertial");
  double i[6] = {0.0};
  hap_pose pose;
  import_mass own = {.mass = 0.0};
  if (inertial == NULL) {
    return HAP_OK;
  }
  HAPI_TRY(origin_read(u, inertial, &pose));
  HAPI_TRY(value_read(u, inertial, "mass", "value", &own.mass));
  for (int k = 0; k < 6; ++k) {
    HAPI_TRY(value_read(u, inertial, "inertia", names[k], &i[k]));
  }
  if (!(own.mass >= 0.0)) {
    return import_refuse(u->work, inertial->at, "inertial: mass below 0");
  }
  const double m[9] = {i[0], i[3], i[4], i[3], i[1], i[5], i[4], i[5], i[2]};
  memcpy(own.inertia, m, sizeof m);
  import_mass_place(&pose, &own, &body->mass);
  body->mass_given = true;
  return HAP_OK;
}

/* NULL: *out_why says why. */
static const import_mesh *mesh_read(urdf *u, const xml_element *element, import_mass *out_mass,
                                    const char **out_why)
{
  const char *file = xml_get(element, "filename");
  double scale[3] = {1.0, 1.0, 1.0};
  size_t count;
  *out_why = file == NULL ? "it names no file" : "its scale";
  if (file == NULL ||
      xml_numbers(u->work, element, "scale", XML_OF(3, 3), scale, &count) != HAP_OK) {
    return NULL;
  }
  const char *path = import_package_path(u->work, file, out_why);
  import_mesh *mesh = path != NULL ? import_mesh_file(u->work, path, out_why) : NULL;
  double *scaled =
      mesh != NULL ? import_take(u->work, 3 * mesh->vertex_count * sizeof *scaled) : NULL;
  if (scaled == NULL) {
    return NULL;
  }
  for (size_t i = 0; i < 3 * mesh->vertex_count; ++i) {
    scaled[i] = scale[i % 3] * mesh->vertices_xyz[i];
  }
  mesh->vertices_xyz = scaled;
  const import_mesh *hull =
      mesh->vertex_count > 3 ? import_hull(u->work, scaled, mesh->vertex_count, out_why) : NULL;
  if (hull != NULL) {
    import_mesh_mass(mesh->triangle_count > 0 ? mesh : hull, IMPORT_FILLED_TWICE, DENSITY,
                     out_mass);
  }
  return hull;
}

/* *out_good: all are above 0. */
static hap_status lengths_read(urdf *u, const xml_element *shape, import_geom *geom, bool *out_good)
{
  size_t count = 0;
  bool good = true;
  if (xml_is(shape, "box")) {
    geom->shape = IMPORT_BOX;
    HAPI_TRY(xml_numbers(u->work, shape, "size", XML_OF(3, 3), geom->size, &count));
    hapi_v3_scale(0.5, geom->size, geom->size);
    good = geom->size[1] > 0.0 && geom->size[2] > 0.0;
  } else if (xml_is(shape, "sphere")) {
    geom->shape = IMPORT_SPHERE;
    HAPI_TRY(xml_numbers(u->work, shape, "radius", XML_OF(1, 1), geom->size, &count));
  } else {
    geom->shape = xml_is(shape, "cylinder") ? IMPORT_CYLINDER : IMPORT_CAPSULE;
    HAPI_TRY(xml_numbers(u->work, shape, "radius", XML_OF(1, 1), geom->size, &count));
    HAPI_TRY(xml_numbers(u->work, shape, "length", XML_OF(1, 1), geom->size + 1, &count));
    geom->size[1] *= 0.5;
    good = geom->size[1] > 0.0;
  }
  *out_good = good && geom->size[0] > 0.0;
  return HAP_OK;
}

static hap_status collision_read(urdf *u, const xml_element *collision, import_body *body,
                                 import_geom ***end)
{
  const xml_element *geometry = xml_child(collision, "geometry");
  const xml_element *shape = geometry != NULL ? geometry->children : NULL;
  const char *why = "no shape that can be";
  import_mass own = {.mass = 0.0};
  import_geom *geom = import_take(u->work, sizeof *geom);
  if (geom == NULL) {
    return import_no_memory(u->work);
  }
  if (shape != NULL && xml_is(shape, "mesh")) {
    geom->shape = IMPORT_MESH;
    geom->mesh = mesh_read(u, shape, &own, &why);
  } else if (shape != NULL && xml_word_in(shape->name, "box sphere cylinder capsule")) {
    bool good;
    HAPI_TRY(lengths_read(u, shape, geom, &good));
    why = good ? NULL : "a length that is not above 0";
    if (good) {
      import_shape_mass(geom->shape, geom->size, DENSITY, &own);
    }
  }
  if (why != NULL && geom->mesh == NULL) {
    import_note(u->work, collision->at, "collision of link %.60s left out: %s", body->name, why);
    return HAP_OK;
  }
  geom->at = collision->at;
  geom->name = "";
  geom->friction = 1.0;
  geom->collides = true;
  geom->category_bits = geom->collide_bits = 1;
  for (int k = 0; k < 4; ++k) {
    geom->colour_rgba[k] = k < 3 ? 0.5F : 1.0F;
  }
  HAPI_TRY(origin_read(u, collision, &geom->pose));
  import_mass_place(&geom->pose, &own, &geom->mass);
  **end = geom;
  *end = &geom->next;
  return HAP_OK;
}

/* fixed: no joint. */
static hap_status joint_read(urdf *u, const xml_element *element, import_body *body)
{
  const char *type = xml_get(element, "type");
  const char *name = xml_get(element, "name");
  double axis[3] = {1.0, 0.0, 0.0};
  size_t count;
  const xml_element *along = xml_child(element, "axis");
  if (type == NULL || !xml_word_in(type, "fixed floating revolute continuous prismatic planar")) {
    return import_refuse(u->work, element->at, "type: no joint is \"%.40s\"",
                         type != NULL ? type : "");
  }
  if (xml_child(element, "mimic") != NULL) {
    import_note(u->work, element->at, "joint %.60s: mimic left out", name != NULL ? name : "");
  }
  if (strcmp(type, "planar") == 0) {
    import_note(u->work, element->at, "joint %.60s, which is planar, left out: its link is fixed",
                name != NULL ? name : "");
  }
  if (strcmp(type, "fixed") == 0 || strcmp(type, "planar") == 0) {
    return HAP_OK;
  }
  import_joint *joint = import_take(u->work, sizeof *joint);
  if (joint == NULL) {
    return import_no_memory(u->work);
  }
  const bool is_free = strcmp(type, "floating") == 0;
  if (is_free && body->parent->carrier != u->model->bodies) {
    return import_refuse(u->work, element->at, "a floating link of one that moves");
  }
  *joint = (import_joint){.at = element->at,
                          .name = name != NULL ? name : "",
                          .kind = is_free                          ? IMPORT_FREE
                                  : strcmp(type, "prismatic") == 0 ? IMPORT_SLIDER
                                                                   : IMPORT_HINGE,
                          .low = -INFINITY,
                          .high = INFINITY};
  if (along != NULL) {
    HAPI_TRY(xml_numbers(u->work, along, "xyz", XML_OF(3, 3), axis, &count));
  }
  double length = hapi_v3_norm(axis);
  if (!(length > 1e-12)) {
    return import_refuse(u->work, element->at, "axis: has no direction");
  }
  hapi_v3_scale(1.0 / length, axis, joint->axis);
  if (strcmp(type, "continuous") != 0 && !is_free) {
    joint->low = joint->high = 0.0;
    HAPI_TRY(stop_read(u, element, "lower", &joint->low));
    HAPI_TRY(stop_read(u, element, "upper", &joint->high));
    if (joint->low > joint->high) {
      import_note(u->work, element->at, "joint %.60s: limit that does not rise left out",
                  joint->name);
    }
    if (joint->low > joint->high || (joint->low == 0.0 && joint->high == 0.0)) { /* not said */
      joint->low = -INFINITY;
      joint->high = INFINITY;
    }
  }
  if (strcmp(type, "continuous") == 0) {
    double ends[2] = {0.0, 0.0};
    HAPI_TRY(stop_read(u, element, "lower", &ends[0]));
    HAPI_TRY(stop_read(u, element, "upper", &ends[1]));
    if (isfinite(ends[0]) && isfinite(ends[1]) && ends[0] < ends[1]) {
      import_note(u->work, element->at, "joint %.60s: limit of a continuous joint left out",
                  joint->name);
    }
  }
  HAPI_TRY(value_read(u, element, "dynamics", "friction", &joint->friction));
  HAPI_TRY(value_read(u, element, "dynamics", "damping", &joint->damping));
  if (!(joint->friction >= 0.0)) {
    return import_refuse(u->work, element->at, "friction: below 0");
  }
  if (joint->damping < 0.0) {
    import_note(u->work, element->at, "joint %.60s: damping below 0 left out", joint->name);
    joint->damping = 0.0;
  }
  body->joints = joint;
  return HAP_OK;
}

static const char *end_name(const xml_element *joint, const char *end)
{
  const xml_element *element = xml_child(joint, end);
  const char *name = element != NULL ? xml_get(element, "link") : NULL;
  return name != NULL ? name : "";
}

static const xml_element *link_named(const urdf *u, const char *name)
{
  for (const xml_element *e = u->root->children; e != NULL; e = e->next) {
    const char *own = xml_is(e, "link") ? xml_get(e, "name") : NULL;
    if (own != NULL && strcmp(own, name) == 0) {
      return e;
    }
  }
  return NULL;
}

/* The link with all that hangs on it; joint NULL: on the world. */
static hap_status link_read(urdf *u, const xml_element *link, const xml_element *joint,
                            import_body *parent, size_t depth)
{
  const char *name = xml_get(link, "name");
  if (depth > DEPTH_MOST || ++u->links > LINKS_MOST) {
    return import_refuse(u->work, link->at, "more than 5000 links, 500 in a chain, or a loop");
  }
  import_body *body = import_take(u->work, sizeof *body);
  if (body == NULL) {
    return import_no_memory(u->work);
  }
  *body = (import_body){.at = link->at, .name = name != NULL ? name : "", .parent = parent};
  body->pose.quat_wxyz[0] = 1.0;
  u->last_body->next = body;
  u->last_body = body;
  if (joint != NULL) {
    HAPI_TRY(origin_read(u, joint, &body->pose));
    HAPI_TRY(joint_read(u, joint, body));
  }
  body->carrier = body->joints != NULL ? body : parent->carrier;
  HAPI_TRY(inertial_read(u, link, body));
  import_geom **end = &body->geoms;
  for (const xml_element *e = link->children; e != NULL; e = e->next) {
    if (xml_is(e, "collision")) {
      HAPI_TRY(collision_read(u, e, body, &end));
    }
  }
  for (const xml_element *e = u->root->children; e != NULL; e = e->next) {
    if (xml_is(e, "joint") && strcmp(end_name(e, "parent"), body->name) == 0) {
      const xml_element *child = link_named(u, end_name(e, "child"));
      if (child == NULL) {
        return import_refuse(u->work, e->at, "child: there is no link %.60s", end_name(e, "child"));
      }
      HAPI_TRY(link_read(u, child, e, body, depth + 1));
    }
  }
  return HAP_OK;
}

/* The joint that moves a link; NULL: the world has it. */
static hap_status parent_find(urdf *u, const xml_element *link, const xml_element **out)
{
  const char *name = xml_get(link, "name");
  *out = NULL;
  for (const xml_element *e = u->root->children; e != NULL; e = e->next) {
    if (!xml_is(e, "joint") || name == NULL || strcmp(end_name(e, "child"), name) != 0) {
      continue;
    }
    if (*out != NULL) {
      return import_refuse(u->work, e->at, "child: link %.60s has a parent already", name);
    }
    if (link_named(u, end_name(e, "parent")) == NULL) {
      return import_refuse(u->work, e->at, "parent: there is no link %.60s", end_name(e, "parent"));
    }
    *out = e;
  }
  return HAP_OK;
}

static hap_status roots_read(urdf *u)
{
  size_t links = 0;
  for (const xml_element *e = u->root->children; e != NULL; e = e->next) {
    const xml_element *joint;
    if (xml_is(e, "link")) {
      ++links;
      if (links > LINKS_MOST) {
        return import_refuse(u->work, e->at, "more than 5000 links");
      }
      HAPI_TRY(parent_find(u, e, &joint));
      if (joint == NULL) {
        HAPI_TRY(link_read(u, e, NULL, u->model->bodies, 1));
      }
    } else if (!xml_word_in(e->name, "joint material gazebo transmission")) {
      import_note(u->work, e->at, "%.40s left out", e->name);
    }
  }
  return u->links == links ? HAP_OK
                           : import_refuse(u->work, u->root->at, "links in a loop, or twice");
}

hap_status urdf_read(import_work *work, const xml_element *root, import_model *out)
{
  urdf u = {.work = work, .model = out, .root = root};
  const char *name = xml_get(root, "name");
  import_body *world = import_take(work, sizeof *world);
  memset(out, 0, sizeof *out);
  if (world == NULL) {
    return import_no_memory(work);
  }
  *world = (import_body){.at = root->at, .name = "", .carrier = world};
  world->pose.quat_wxyz[0] = 1.0;
  out->name = name != NULL ? name : "";
  out->gravity[2] = -9.81;
  out->bodies = u.last_body = world;
  HAPI_TRY(roots_read(&u));
  import_model_settle(out);
  return HAP_OK;
}
