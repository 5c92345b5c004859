/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "import/build.h"

#include <math.h>
#include <string.h>

#include "base/log.h"
#include "base/pose.h"
#include "base/vec.h"

#define BETWEEN_SHARE 0.05 /* of a body's mass, of each body between its joints */

static hap_status build_fail(import_work *work, import_place at, hap_status status,
                             const hap_detail *why)
{
  return hapi_fail(work->detail, status, "%.200s:%d: %.280s", at.file, at.line, why->text);
}

/* ---- geoms ---- */

/* Lengths as hap_scene_add_geom takes them, m. */
#define LENGTH_LEAST 1e-6
#define LENGTH_MOST 1e6

static bool lengths_fit(const hap_geom_def *def)
{
  const double lengths[] = {def->radius, def->length, def->edges[0], def->edges[1], def->edges[2]};
  const size_t first = def->shape == HAP_SHAPE_BOX || def->shape == HAP_SHAPE_FIELD ? 2 : 0;
  const size_t end = def->shape == HAP_SHAPE_BOX                                           ? 5
                     : def->shape == HAP_SHAPE_FIELD                                       ? 4
                     : def->shape == HAP_SHAPE_SPHERE                                      ? 1
                     : def->shape == HAP_SHAPE_CAPSULE || def->shape == HAP_SHAPE_CYLINDER ? 2
                                                                                           : 0;
  for (size_t i = first; i < end; ++i) {
    if (!(lengths[i] >= LENGTH_LEAST && lengths[i] <= LENGTH_MOST)) {
      return false;
    }
  }
  return true;
}

/* False: not as a geom of that body. */
static bool geom_fill(const import_geom *geom, const hap_pose *frame, hap_geom_def *out)
{
  const double *s = geom->size;
  hap_geom_def_init(out, sizeof *out);
  import_pose_join(frame, &geom->pose, &out->pose);
  out->friction = geom->friction;
  out->category_bits = geom->category_bits;
  out->collide_bits = geom->collide_bits;
  memcpy(out->colour_rgba, geom->colour_rgba, sizeof out->colour_rgba);
  switch (geom->shape) {
    case IMPORT_PLANE:
      out->shape = HAP_SHAPE_PLANE;
      return true;
    case IMPORT_SPHERE:
      out->shape = HAP_SHAPE_SPHERE;
      out->radius = s[0];
      return true;
    case IMPORT_CAPSULE:
    case IMPORT_CYLINDER:
      out->shape = geom->shape == IMPORT_CAPSULE ? HAP_SHAPE_CAPSULE : HAP_SHAPE_CYLINDER;
      out->radius = s[0];
      out->length = 2.0 * s[1];
      return true;
    case IMPORT_BOX:
      out->shape = HAP_SHAPE_BOX;
      hapi_v3_scale(2.0, s, out->edges);
      return true;
    case IMPORT_FIELD:
      out->shape = HAP_SHAPE_FIELD;
      out->edges[0] = 2.0 * s[0];
      out->edges[1] = 2.0 * s[1];
      out->heights = geom->field->heights;
      out->columns = geom->field->columns;
      out->rows = geom->field->rows;
      return true;
    case IMPORT_ELLIPSOID:
    case IMPORT_MESH:
      out->shape = HAP_SHAPE_MESH;
      break;
  }
  if (geom->mesh == NULL) {
    return false;
  }
  out->vertices_xyz = geom->mesh->vertices_xyz;
  out->vertex_count = geom->mesh->vertex_count;
  out->triangles = geom->mesh->triangles;
  out->triangle_count = geom->mesh->triangle_count;
  return true;
}

/* NULL: it is filled in. Else why it cannot be. */
static const char *geom_missing(const import_geom *geom, const hap_pose *frame, hap_geom_def *out)
{
  return !geom_fill(geom, frame, out) ? "its shape"
         : !lengths_fit(out)          ? "a length that is not within 1e-6 and 1e6 m"
                                      : NULL;
}

static hap_status fixed_geoms_add(import_work *work, const import_body *body, hap_scene *scene)
{
  for (const import_geom *geom = body->geoms; geom != NULL; geom = geom->next) {
    hap_geom_def def;
    hap_detail why = {""};
    const char *why_not = geom_missing(geom, &body->pose_world, &def);
    if (why_not != NULL) {
      import_note(work, geom->at, "geom left out: %s", why_not);
      continue;
    }
    hap_status status = hap_scene_add_geom(scene, &def, NULL, &why);
    if (status < HAP_OK) {
      return build_fail(work, geom->at, status, &why);
    }
  }
  return HAP_OK;
}

static size_t geoms_count(const import_model *model, const import_body *carrier)
{
  size_t count = 0;
  for (const import_body *body = model->bodies; body != NULL; body = body->next) {
    for (const import_geom *geom = body->carrier == carrier ? body->geoms : NULL; geom != NULL;
         geom = geom->next) {
      ++count;
    }
  }
  return count;
}

static size_t geoms_fill(import_work *work, const import_model *model, const import_body *carrier,
                         hap_geom_def *out)
{
  const hap_pose *frame = &carrier->pose_world;
  size_t count = 0;
  for (const import_body *body = model->bodies; body != NULL; body = body->next) {
    hap_pose inside;
    if (body->carrier != carrier) {
      continue;
    }
    hapi_pose_into(frame->position, frame->quat_wxyz, &body->pose_world, &inside);
    for (const import_geom *geom = body->geoms; geom != NULL; geom = geom->next) {
      const bool stands = geom->shape == IMPORT_PLANE || geom->shape == IMPORT_FIELD;
      const char *why = stands ? "a plane or height field of a body that moves"
                               : geom_missing(geom, &inside, &out[count]);
      if (why != NULL) {
        import_note(work, geom->at, "geom left out: %s", why);
      } else {
        ++count;
      }
    }
  }
  return count;
}

/* ---- bodies ---- */

static void mass_fill(const import_mass *mass, double share, hap_body_def *out)
{
  out->has_inertia = 1;
  out->mass = share * mass->mass;
  hapi_v3_copy(mass->centre, out->centre);
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      out->inertia[i][k] = 0.5 * share * (mass->inertia[3 * i + k] + mass->inertia[3 * k + i]);
    }
  }
}

/* Whether a body can have it: it and the moments of its mass along the axes are positive. */
static bool inertia_is_real(const double m[9])
{
  const double half = 0.5 * (m[0] + m[4] + m[8]);
  const double slack = 1e-9 * half; /* a thin plate has none along one axis */
  for (int k = 0; k < 2; ++k) {     /* m, then half * 1 - m */
    const double s = k == 0 ? 1.0 : -1.0;
    const double add = k == 0 ? 0.0 : half + slack;
    const double a[3] = {s * m[0] + add, s * m[4] + add, s * m[8] + add};
    const double b[3] = {s * m[1], s * m[2], s * m[5]}; /* xy, xz, yz */
    const double all = a[0] * (a[1] * a[2] - b[2] * b[2]) - b[0] * (b[0] * a[2] - b[2] * b[1]) +
                       b[1] * (b[0] * b[2] - a[1] * b[1]);
    if (!(a[0] > 0.0 && a[0] * a[1] - b[0] * b[0] > 0.0 && all > 0.0)) {
      return false;
    }
  }
  return true;
}

/* Where it is the mean of the moments is about all axes; where that is nothing, that of a ball of
 * the mass. */
static void inertia_mend(import_work *work, import_body *body)
{
  double *m = body->whole.inertia;
  if (inertia_is_real(m)) {
    return;
  }
  const double mean = (m[0] + m[4] + m[8]) / 3.0;
  const double ball =
      0.4 * body->whole.mass * pow(body->whole.mass / (1000.0 * 4.18879), 2.0 / 3.0);
  const bool some = mean > 1e-6 * ball;
  memset(m, 0, 9 * sizeof *m);
  m[0] = m[4] = m[8] = some ? mean : ball;
  import_note(work, body->at, "body %.60s: no body has such an inertia, %g kg m^2 %s instead",
              body->name, m[0], some ? "about all axes" : "of a ball of its mass");
}

static hap_status part_add(import_work *work, import_body *body, const hap_body_def *def,
                           hap_scene *scene, uint32_t *out)
{
  hap_detail why = {""};
  hap_status status = hap_scene_add_body(scene, def, out, NULL, &why);
  return status < HAP_OK ? build_fail(work, body->at, status, &why) : HAP_OK;
}

/* ---- joints ---- */

/* ODE's hinges turn less than half a turn to a stop. */
static void limits_fill(import_work *work, const import_joint *joint, int axis, hap_joint_def *out)
{
  const double most = joint->kind == IMPORT_SLIDER ? INFINITY : M_PI;
  out->low[axis] = joint->low >= -most ? joint->low : -INFINITY;
  out->high[axis] = joint->high <= most ? joint->high : INFINITY;
  if ((out->low[axis] != joint->low || out->high[axis] != joint->high)) {
    import_note(work, joint->at, "joint %.60s: limits beyond half a turn left out", joint->name);
  }
}

/* Spring, damper and rotor of a hinge or slider; a word of what another joint has of it. */
static void spring_fill(import_work *work, const import_joint *joint, int axis, hap_joint_def *out)
{
  const bool has_axis = joint->kind == IMPORT_HINGE || joint->kind == IMPORT_SLIDER;
  const bool far = joint->kind == IMPORT_HINGE && fabs(joint->rest) > M_PI; /* see limits_fill */
  const double values[] = {far ? 0.0 : joint->stiffness, joint->damping, joint->armature};
  static const char *const names[] = {"stiffness", "damping", "armature"};
  double *const to[] = {out->stiffness, out->damping, out->inertia};
  out->rest[axis] = joint->rest;
  if (far && joint->stiffness != 0.0) {
    import_note(work, joint->at, "joint %.60s: spring that rests beyond half a turn left out",
                joint->name);
  }
  for (int i = 0; i < 3; ++i) {
    if (has_axis && values[i] >= 0.0 && values[i] <= 1e9) {
      to[i][axis] = values[i];
    } else if (values[i] != 0.0) {
      import_note(work, joint->at, "joint %.60s: %s left out", joint->name, names[i]);
    }
  }
}

/* Two hinges one after the other at one point and at right angles are a universal joint, without a
 * body between them. */
static bool joints_pair(const import_joint *first)
{
  const import_joint *second = first->next;
  double apart[3];
  if (second == NULL || first->kind != IMPORT_HINGE || second->kind != IMPORT_HINGE) {
    return false;
  }
  hapi_v3_sub(first->anchor, second->anchor, apart);
  return hapi_v3_norm(apart) < 1e-9 && fabs(hapi_v3_dot(first->axis, second->axis)) < 1e-6;
}

/* The part of the body that comes with one joint, or two of them. */
static const import_joint *joints_after(const import_joint *joint)
{
  return joints_pair(joint) ? joint->next->next : joint->next;
}

static size_t parts_count(const import_body *body)
{
  size_t count = 0;
  for (const import_joint *joint = body->joints; joint != NULL; joint = joints_after(joint)) {
    ++count;
  }
  return count;
}

/* Of a pair the second axis goes with the body that is moved, the first with the one before it. */
static hap_status joint_add(import_work *work, const import_body *body, const import_joint *joint,
                            const uint32_t ends[2], hap_scene *scene)
{
  static const hap_joint_kind kinds[] = {[IMPORT_FREE] = HAP_JOINT_OTHER,
                                         [IMPORT_BALL] = HAP_JOINT_BALL,
                                         [IMPORT_HINGE] = HAP_JOINT_HINGE,
                                         [IMPORT_SLIDER] = HAP_JOINT_SLIDER};
  const hap_pose *frame = &body->pose_world;
  const bool pair = joints_pair(joint);
  const import_joint *of[2] = {pair ? joint->next : joint, joint};
  hap_joint_def def;
  hap_detail why = {""};
  hap_joint_def_init(&def, sizeof def);
  def.kind = pair ? HAP_JOINT_UNIVERSAL : kinds[joint->kind];
  def.body_a = ends[0];
  def.body_b = ends[1];
  hapi_pose_point(frame->position, frame->quat_wxyz, joint->anchor, def.anchor);
  for (int axis = 0; axis < (pair ? 2 : 1); ++axis) {
    hapi_quat_rotate(frame->quat_wxyz, of[axis]->axis, def.axis[axis]);
    spring_fill(work, of[axis], axis, &def);
    if (joint->kind != IMPORT_BALL) {
      limits_fill(work, of[axis], axis, &def);
      def.motor_force[axis] = fmin(of[axis]->friction, 1e9);
    } else if (joint->friction > 0.0) {
      import_note(work, joint->at, "joint %.60s: friction of a ball joint left out", joint->name);
    }
  }
  hap_status status = hap_scene_add_joint(scene, &def, NULL, &why);
  return status < HAP_OK ? build_fail(work, joint->at, status, &why) : HAP_OK;
}

/* Nothing can be felt of it, and no body hangs on it. */
static bool body_is_nothing(const import_model *model, const import_body *body)
{
  bool needed = body->joints->kind != IMPORT_FREE || geoms_count(model, body) > 0;
  for (const import_body *other = model->bodies->next; other != NULL && !needed;
       other = other->next) {
    needed = other->carrier == other && other->parent->carrier == body;
  }
  for (const import_hold *hold = model->holds; hold != NULL && !needed; hold = hold->next) {
    needed = hold->a->carrier == body || hold->b->carrier == body;
  }
  return !needed;
}

/* The body with its joints. The first joint or pair of them stands on the parent, each further one
 * on the body that the one before it moves. */
static hap_status carrier_add(import_work *work, const import_model *model, import_body *body,
                              hap_scene *scene)
{
  hap_body_def def;
  const size_t parts = parts_count(body);
  const double share = fmin(BETWEEN_SHARE, 0.5 / (double)parts);
  const import_body *parent = body->parent->carrier;
  const uint32_t parent_number = parent->parent == NULL ? HAP_SCENE_WORLD : parent->number;
  uint32_t below = parent_number;
  if (body_is_nothing(model, body)) {
    body->number = HAP_SCENE_WORLD;
    import_note(work, body->at, "body %.60s left out: it has no geom", body->name);
    return HAP_OK;
  }
  hap_geom_def *geoms = import_take(work, (geoms_count(model, body) + 1) * sizeof *geoms);
  if (geoms == NULL) {
    return import_no_memory(work);
  }
  inertia_mend(work, body);
  hap_body_def_init(&def, sizeof def);
  def.pose = body->pose_world;
  const import_joint *joint = body->joints;
  mass_fill(&body->whole, share, &def);
  for (; joints_after(joint) != NULL; joint = joints_after(joint)) {
    uint32_t between;
    HAPI_TRY(part_add(work, body, &def, scene, &between));
    HAPI_TRY(joint_add(work, body, joint, (const uint32_t[2]){between, below}, scene));
    below = between;
  }
  mass_fill(&body->whole, 1.0 - share * (double)(parts - 1), &def);
  def.geoms = geoms;
  def.geom_count = geoms_fill(work, model, body, geoms);
  HAPI_TRY(part_add(work, body, &def, scene, &body->number));
  if (joint->kind != IMPORT_FREE) {
    HAPI_TRY(joint_add(work, body, joint, (const uint32_t[2]){body->number, below}, scene));
  } else {
    hap_joint_def none;
    hap_joint_def_init(&none, sizeof none);
    spring_fill(work, joint, 0, &none);
  }
  if (parts > 1 && parent_number != HAP_SCENE_WORLD) {
    return hap_scene_let_pass(scene, body->number, parent_number, work->detail);
  }
  return HAP_OK;
}

static hap_status passes_add(import_work *work, const import_model *model, hap_scene *scene)
{
  for (const import_pass *pass = model->passes; pass != NULL; pass = pass->next) {
    const import_body *a = pass->a->carrier;
    const import_body *b = pass->b->carrier;
    if (a->parent == NULL || b->parent == NULL) {
      import_note(work, a->at,
                  "bodies %.60s and %.60s that do not touch: one never moves, left out",
                  pass->a->name, pass->b->name);
    } else if (a != b && a->number != HAP_SCENE_WORLD && b->number != HAP_SCENE_WORLD) {
      HAPI_TRY(hap_scene_let_pass(scene, a->number, b->number, work->detail));
    }
  }
  return HAP_OK;
}

/* The first end of a joint is a body that moves. */
static hap_status holds_add(import_work *work, const import_model *model, hap_scene *scene)
{
  for (const import_hold *hold = model->holds; hold != NULL; hold = hold->next) {
    hap_joint_def def;
    hap_detail why = {""};
    const import_body *a = hold->a->carrier;
    const import_body *b = hold->b->carrier;
    if (a == b) {
      import_note(work, hold->at, "equality between parts of one body left out");
      continue;
    }
    hap_joint_def_init(&def, sizeof def);
    def.kind = hold->is_fixed ? HAP_JOINT_FIXED : HAP_JOINT_BALL;
    def.body_a = a->parent != NULL ? a->number : b->number;
    def.body_b = a->parent != NULL && b->parent != NULL ? b->number : HAP_SCENE_WORLD;
    const hap_pose *frame = &hold->a->pose_world;
    hapi_pose_point(frame->position, frame->quat_wxyz, hold->anchor, def.anchor);
    hap_status status = hap_scene_add_joint(scene, &def, NULL, &why);
    if (status < HAP_OK) {
      return build_fail(work, hold->at, status, &why);
    }
  }
  return HAP_OK;
}

/* What has no mass cannot move by itself: it goes with what carries it. */
static void massless_hold(import_work *work, import_model *model)
{
  bool held = false;
  for (import_body *body = model->bodies->next; body != NULL; body = body->next) {
    const bool moves = body->carrier == body && !body_is_nothing(model, body);
    if (moves && !(body->whole.mass > 0.0)) {
      import_note(work, body->at, "body %.60s moves and has no mass: its joint left out",
                  body->name);
      body->joints = NULL;
      held = true;
    }
  }
  if (held) {
    import_model_join(model);
  }
}

hap_status import_build(import_work *work, import_model *model, hap_scene *scene)
{
  massless_hold(work, model);
  for (import_body *body = model->bodies; body != NULL; body = body->next) {
    if (body->carrier->parent == NULL) {
      HAPI_TRY(fixed_geoms_add(work, body, scene));
    } else if (body->carrier == body) {
      HAPI_TRY(carrier_add(work, model, body, scene));
    }
  }
  HAPI_TRY(passes_add(work, model, scene));
  return holds_add(work, model, scene);
}
