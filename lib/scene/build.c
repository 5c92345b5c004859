/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include <hapode/ode.h>

#include "base/alloc.h"
#include "base/log.h"
#include "base/plausible.h"
#include "base/vec.h"
#include "scene/scene_internal.h"

/* Bodies, geoms and joints come and go. */

#define GEOMS_MOST 4096u /* of a body */
#define ANGLE_MOST M_PI

static const hap_geom_def geom_defaults = {
    .cookie = 0x48534745u,
    .shape = HAP_SHAPE_SPHERE,
    .pose = {.quat_wxyz = {1.0}},
    .edges = {0.1, 0.1, 0.1},
    .radius = 0.05,
    .length = 0.1,
    .density = 1000.0,
    .friction = 0.5,
    .colour_rgba = {0.7F, 0.7F, 0.7F, 1.0F},
    .category_bits = 0xffffffffu,
    .collide_bits = 0xffffffffu,
};

static const hap_body_def body_defaults = {
    .cookie = 0x4853424fu,
    .pose = {.quat_wxyz = {1.0}},
};

static const hap_joint_def joint_defaults = {
    .cookie = 0x48534a4fu,
    .body_b = HAP_SCENE_WORLD,
    .axis = {{0.0, 0.0, 1.0}, {1.0, 0.0, 0.0}},
    .low = {-INFINITY, -INFINITY},
    .high = {INFINITY, INFINITY},
};

static const hapi_def_type geom_def_type = HAPI_DEF_TYPE(hap_geom_def, geom_defaults);
static const hapi_def_type body_def_type = HAPI_DEF_TYPE(hap_body_def, body_defaults);
static const hapi_def_type joint_def_type = HAPI_DEF_TYPE(hap_joint_def, joint_defaults);

void hap_geom_def_init(hap_geom_def *def, size_t size_of_def)
{
  hapi_def_init(&geom_def_type, def, size_of_def);
}

void hap_body_def_init(hap_body_def *def, size_t size_of_def)
{
  hapi_def_init(&body_def_type, def, size_of_def);
}

void hap_joint_def_init(hap_joint_def *def, size_t size_of_def)
{
  hapi_def_init(&joint_def_type, def, size_of_def);
}

/* ---- geoms ---- */

/* The last one gets its number. */
static void geom_number(hap_scene *scene)
{
  ++scene->geom_count;
  dGeomSetData(scene->geoms[scene->geom_count - 1].geom, (void *)(uintptr_t)scene->geom_count);
}

static bool geoms_reserve(hap_scene *scene, uint32_t count)
{
  return hapi_reserve((void **)&scene->geoms, &scene->geom_capacity, scene->geom_count, count,
                      sizeof *scene->geoms) &&
         scene->geoms != NULL;
}

hap_status hap_scene_add_geom(hap_scene *scene, const hap_geom_def *given, uint32_t *out_geom,
                              hap_detail *detail)
{
  hap_geom_def def;
  if (scene == NULL) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "scene is NULL");
  }
  HAPI_TRY(hapi_def_read(&geom_def_type, given, &def, detail));
  HAPI_TRY(hapi_shape_check(&def, false, detail));
  HAPI_TRY(hapi_scene_may_edit(scene, detail));
  if (!geoms_reserve(scene, 1) ||
      hapi_shape_make(scene->space, &def, &scene->geoms[scene->geom_count]) < HAP_OK) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for a geom");
  }
  geom_number(scene);
  if (out_geom != NULL) {
    *out_geom = scene->geom_count - 1;
  }
  return HAP_OK;
}

/* ---- bodies ---- */

static void geoms_drop(hap_scene *scene, uint32_t count)
{
  for (uint32_t i = 0; i < count; ++i) {
    hapi_scene_geom_end(&scene->geoms[scene->geom_count + i]);
  }
}

/* What the def says of it. */
static void mass_given(const hap_body_def *def, dMass *out)
{
  const double(*m)[3] = def->inertia;
  dMassSetParameters(out, def->mass, 0.0, 0.0, 0.0, m[0][0], m[1][1], m[2][2], m[0][1], m[0][2],
                     m[1][2]);
}

/* Behind those that have numbers, and their mass about its centre. geoms: NULL where there are
 * none. */
static hap_status geoms_make(hap_scene *scene, const hap_body_def *def, const hap_geom_def *geoms,
                             dMass *out, double out_centre[3], hap_detail *detail)
{
  dMassSetZero(out);
  for (uint32_t i = 0; geoms != NULL && i < def->geom_count; ++i) {
    dMass mass;
    hapi_scene_geom *geom = &scene->geoms[scene->geom_count + i];
    if (hapi_shape_make(scene->space, &geoms[i], geom) < HAP_OK) {
      geoms_drop(scene, i);
      return hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for the geoms of a body");
    }
    if (def->has_inertia != 0) {
      continue;
    }
    if (!hapi_shape_mass(geom, geoms[i].density, &mass)) {
      geoms_drop(scene, i + 1);
      return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                       "geoms[%u] is a mesh of no volume: a mesh of a body is closed, its "
                       "triangles counter-clockwise as seen from outside",
                       i);
    }
    dMassAdd(out, &mass);
  }
  if (def->has_inertia !=
      0) { /* never moved to the origin and back: a small one would not stand it */
    mass_given(def, out);
    memcpy(out_centre, def->centre, sizeof def->centre);
    return HAP_OK;
  }
  if (def->mass > 0.0) {
    dMassAdjust(out, def->mass);
  }
  memcpy(out_centre, out->c, 3 * sizeof *out_centre);
  dMassTranslate(out, -out_centre[0], -out_centre[1], -out_centre[2]);
  memset(out->c, 0, sizeof out->c);
  return HAP_OK;
}

static void body_make(hap_scene *scene, const hap_body_def *def, const dMass *mass)
{
  hapi_scene_body *out = &scene->bodies[scene->body_count];
  double at[3];
  double across[3];
  double v[3];
  out->body = dBodyCreate(scene->world);
  dBodySetMass(out->body, mass);
  hapi_pose_point(def->pose.position, def->pose.quat_wxyz, out->centre, at);
  dBodySetPosition(out->body, at[0], at[1], at[2]);
  dBodySetQuaternion(out->body, def->pose.quat_wxyz);
  hapi_v3_sub(at, def->pose.position, at);
  hapi_v3_cross(def->twist.angular, at, across);
  hapi_v3_add(def->twist.linear, across, v);
  dBodySetLinearVel(out->body, v[0], v[1], v[2]);
  dBodySetAngularVel(out->body, def->twist.angular[0], def->twist.angular[1],
                     def->twist.angular[2]);
  if (def->is_kinematic != 0) {
    dBodySetKinematic(out->body);
  }
  dBodySetData(out->body, (void *)(uintptr_t)(scene->body_count + 1));
}

static void geoms_attach(hap_scene *scene, uint32_t count)
{
  const hapi_scene_body *body = &scene->bodies[scene->body_count];
  for (uint32_t i = 0; i < count; ++i) {
    hapi_scene_geom *geom = &scene->geoms[scene->geom_count];
    double at[3];
    hapi_v3_sub(geom->pose.position, body->centre, at);
    geom->body = scene->body_count;
    dGeomSetBody(geom->geom, body->body);
    dGeomSetOffsetPosition(geom->geom, at[0], at[1], at[2]);
    dGeomSetOffsetQuaternion(geom->geom, geom->pose.quat_wxyz);
    geom_number(scene);
  }
}

/* The caller's geoms may be of another build, and longer or shorter. */
static hap_status geoms_read(const hap_body_def *def, hap_geom_def *out, hap_detail *detail)
{
  const unsigned char *bytes = (const unsigned char *)def->geoms;
  size_t stride = def->geom_count > 0 ? def->geoms[0].size : 0;
  for (size_t i = 0; i < def->geom_count; ++i) {
    hap_detail why = {""};
    hap_status status = hapi_def_read(&geom_def_type, bytes + i * stride, &out[i], &why);
    status = status >= HAP_OK && out[i].size != stride
                 ? hapi_fail(&why, HAP_ERROR_ARGUMENT, "its size is not that of the first one")
                 : status;
    status = status >= HAP_OK ? hapi_shape_check(&out[i], true, &why) : status;
    if (status < HAP_OK) {
      return hapi_fail(detail, status, "geoms[%zu]: %.400s", i, why.text);
    }
  }
  return HAP_OK;
}

/* As ODE sees it, which ends the process otherwise. */
static bool matrix_positive(const double (*m)[3])
{
  const dReal rows[12] = {m[0][0], m[0][1], m[0][2], 0.0,     m[1][0], m[1][1],
                          m[1][2], 0.0,     m[2][0], m[2][1], m[2][2], 0.0};
  return dIsPositiveDefinite(rows, 3) != 0;
}

/* NULL: a body can have it. Principal moments are those of sum * 1 - 2 * m as well, none of which
 * is below 0 where none exceeds the sum of the others. */
static const char *inertia_wrong(const double m[3][3])
{
  const double sum = m[0][0] + m[1][1] + m[2][2];
  const double slack = 1e-9 * sum; /* of rounding: a thin plate has equality */
  const double s[3][3] = {
      {sum - 2 * m[0][0] + slack, -2 * m[0][1], -2 * m[0][2]},
      {-2 * m[0][1], sum - 2 * m[1][1] + slack, -2 * m[1][2]},
      {-2 * m[0][2], -2 * m[1][2], sum - 2 * m[2][2] + slack},
  };
  if (m[0][1] != m[1][0] || m[0][2] != m[2][0] || m[1][2] != m[2][1]) {
    return "inertia is not symmetric";
  }
  return !matrix_positive(m)   ? "inertia is not positive definite"
         : !matrix_positive(s) ? "inertia: a principal moment exceeds the sum of the other two"
                               : NULL;
}

static hap_status own_inertia_check(const hap_body_def *def, hap_detail *detail)
{
  const char *wrong = !(def->mass > 0.0)                ? "mass is 0"
                      : !hapi_plausible(def->centre, 3) ? "centre: not finite or beyond 1000 km"
                      : !hapi_finite(&def->inertia[0][0], 9) ? "inertia is not finite"
                                                             : inertia_wrong(def->inertia);
  return wrong == NULL ? HAP_OK
                       : hapi_fail(detail, HAP_ERROR_ARGUMENT, "%s, where has_inertia is 1", wrong);
}

static hap_status body_check(const hap_body_def *def, hap_detail *detail)
{
  const hapi_number_rule rules[] = {
      HAPI_RULE(def, mass, 0.0, 1e9),
      HAPI_RULE(def, is_kinematic, 0, 1),
      HAPI_RULE(def, has_inertia, 0, 1),
      HAPI_RULE(def, geom_count, def->has_inertia != 0 ? 0 : 1, GEOMS_MOST),
  };
  HAPI_TRY(hapi_numbers_check(rules, sizeof rules / sizeof rules[0], detail));
  const char *wrong =
      def->geoms == NULL && def->geom_count > 0 ? "geoms is NULL"
      : !hapi_plausible_pose(&def->pose)        ? "pose: not within 1000 km with a unit quaternion"
      : !(hapi_plausible(def->twist.linear, 3) && hapi_plausible(def->twist.angular, 3))
          ? "twist: not finite or beyond 1e6 m/s or rad/s"
          : NULL;
  if (wrong != NULL) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "%s", wrong);
  }
  return def->has_inertia != 0 ? own_inertia_check(def, detail) : HAP_OK;
}

static hap_status body_add(hap_scene *scene, const hap_body_def *def, const hap_geom_def *geoms,
                           hap_detail *detail)
{
  dMass mass;
  uint32_t count = (uint32_t)def->geom_count;
  if (!geoms_reserve(scene, count > 0 ? count : 1) ||
      !hapi_reserve((void **)&scene->bodies, &scene->body_capacity, scene->body_count, 1,
                    sizeof *scene->bodies)) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for a body");
  }
  HAPI_TRY(geoms_make(scene, def, geoms, &mass, scene->bodies[scene->body_count].centre, detail));
  body_make(scene, def, &mass);
  geoms_attach(scene, count);
  ++scene->body_count;
  return count == 0 && scene->session != NULL
             ? hap_session_adopt_body(scene->session, scene->bodies[scene->body_count - 1].body)
             : HAP_OK;
}

hap_status hap_scene_add_body(hap_scene *scene, const hap_body_def *given, uint32_t *out_body,
                              uint32_t *out_geom, hap_detail *detail)
{
  hap_body_def def;
  if (scene == NULL) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "scene is NULL");
  }
  HAPI_TRY(hapi_def_read(&body_def_type, given, &def, detail));
  HAPI_TRY(body_check(&def, detail));
  HAPI_TRY(hapi_scene_may_edit(scene, detail));
  hap_geom_def *geoms = hapi_alloc_array(def.geom_count + 1, sizeof *geoms);
  hap_status status = geoms == NULL ? hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for a body")
                                    : geoms_read(&def, geoms, detail);
  uint32_t first = scene->geom_count;
  status = status >= HAP_OK ? body_add(scene, &def, geoms, detail) : status;
  hapi_free(geoms);
  if (status >= HAP_OK && out_body != NULL) {
    *out_body = scene->body_count - 1;
  }
  if (status >= HAP_OK && out_geom != NULL) {
    *out_geom = first;
  }
  return status;
}

/* ---- joints ---- */

typedef struct joint_making {
  dJointID (*create)(dWorldID world, dJointGroupID group);
  void (*set_anchor)(dJointID joint, dReal x, dReal y, dReal z);  /* NULL: it has none */
  void (*set_axis[2])(dJointID joint, dReal x, dReal y, dReal z); /* NULL: it has no such */
  void (*set_parameter)(dJointID joint, int parameter, dReal value);
} joint_making;

static const joint_making makings[] = {
    [HAP_JOINT_BALL] = {.create = dJointCreateBall, .set_anchor = dJointSetBallAnchor},
    [HAP_JOINT_HINGE] = {dJointCreateHinge,
                         dJointSetHingeAnchor,
                         {dJointSetHingeAxis, NULL},
                         dJointSetHingeParam},
    [HAP_JOINT_SLIDER] = {dJointCreateSlider,
                          NULL,
                          {dJointSetSliderAxis, NULL},
                          dJointSetSliderParam},
    [HAP_JOINT_UNIVERSAL] = {dJointCreateUniversal,
                             dJointSetUniversalAnchor,
                             {dJointSetUniversalAxis1, dJointSetUniversalAxis2},
                             dJointSetUniversalParam},
    [HAP_JOINT_HINGE2] = {dJointCreateHinge2,
                          dJointSetHinge2Anchor,
                          {NULL, NULL},
                          dJointSetHinge2Param},
    [HAP_JOINT_FIXED] = {.create = dJointCreateFixed},
};

uint32_t hapi_scene_joint_axes(hap_joint_kind kind)
{
  switch (kind) {
    case HAP_JOINT_HINGE:
    case HAP_JOINT_SLIDER:
      return 1;
    case HAP_JOINT_UNIVERSAL:
    case HAP_JOINT_HINGE2:
      return 2;
    default:
      return 0;
  }
}

void hapi_scene_joint_set(const hapi_scene_joint *joint, int parameter, uint32_t axis, double value)
{
  makings[joint->kind].set_parameter(joint->joint, parameter + (int)axis * dParamGroup, value);
}

static hapi_axis_spring spring_of(const hap_joint_def *def, uint32_t axis)
{
  return (hapi_axis_spring){def->stiffness[axis], def->rest[axis], def->damping[axis],
                            def->inertia[axis]};
}

/* Of the free axes: whether stops and motor can be. */
static hap_status axes_check(const hap_joint_def *def, hap_detail *detail)
{
  double most = def->kind == HAP_JOINT_SLIDER ? 1e6 : ANGLE_MOST;
  for (uint32_t i = 0; i < hapi_scene_joint_axes(def->kind); ++i) {
    if (!hapi_plausible(def->axis[i], 3) || !(hapi_v3_norm(def->axis[i]) > HAPI_NUMBER_LEAST)) {
      return hapi_fail(detail, HAP_ERROR_ARGUMENT, "axis[%u] has no direction", i);
    }
    bool low = def->low[i] == -INFINITY || fabs(def->low[i]) <= most;
    bool high = def->high[i] == INFINITY || fabs(def->high[i]) <= most;
    if (!low || !high || def->low[i] > def->high[i]) {
      return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                       "low[%u], high[%u] are %g and %g: rising, within -%g .. %g or infinite", i,
                       i, def->low[i], def->high[i], most, most);
    }
    if (!(fabs(def->motor_speed[i]) <= 1e6 && def->motor_force[i] >= 0.0 &&
          def->motor_force[i] <= 1e9)) {
      return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                       "motor_speed[%u], motor_force[%u] are %g and %g: up to 1e6, and 0 to 1e9", i,
                       i, def->motor_speed[i], def->motor_force[i]);
    }
  }
  return HAP_OK;
}

static hap_status springs_check(const hap_joint_def *def, hap_detail *detail)
{
  const hapi_number_rule rules[] = {
      HAPI_RULE(def, stiffness[0], 0.0, 1e9), HAPI_RULE(def, stiffness[1], 0.0, 1e9),
      HAPI_RULE(def, rest[0], -1e6, 1e6),     HAPI_RULE(def, rest[1], -1e6, 1e6),
      HAPI_RULE(def, damping[0], 0.0, 1e9),   HAPI_RULE(def, damping[1], 0.0, 1e9),
      HAPI_RULE(def, inertia[0], 0.0, 1e9),   HAPI_RULE(def, inertia[1], 0.0, 1e9),
  };
  const bool can = def->kind == HAP_JOINT_HINGE || def->kind == HAP_JOINT_SLIDER ||
                   def->kind == HAP_JOINT_UNIVERSAL;
  HAPI_TRY(hapi_numbers_check(rules, sizeof rules / sizeof rules[0], detail));
  for (uint32_t i = 0; i < 2; ++i) {
    const hapi_axis_spring spring = spring_of(def, i);
    if (hapi_axis_spring_acts(&spring) && (!can || i >= hapi_scene_joint_axes(def->kind))) {
      return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                       "stiffness[%u], damping[%u], inertia[%u]: only axes of HINGE, SLIDER and "
                       "UNIVERSAL have them",
                       i, i, i);
    }
  }
  return HAP_OK;
}

static hap_status joint_check(const hap_scene *scene, const hap_joint_def *def, hap_detail *detail)
{
  if ((int)def->kind < HAP_JOINT_BALL || def->kind >= HAP_JOINT_OTHER) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "kind is %d: no joint that can be added",
                     (int)def->kind);
  }
  if (hapi_scene_body_at(scene, def->body_a) == NULL ||
      (def->body_b != HAP_SCENE_WORLD && hapi_scene_body_at(scene, def->body_b) == NULL)) {
    return hapi_fail(detail, HAP_ERROR_NOT_FOUND, "body_%c: there is no body of that number",
                     hapi_scene_body_at(scene, def->body_a) == NULL ? 'a' : 'b');
  }
  if (def->body_a == def->body_b) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "body_a and body_b are the same");
  }
  if (!hapi_plausible(def->anchor, 3)) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "anchor: not finite or beyond 1000 km");
  }
  HAPI_TRY(axes_check(def, detail));
  return springs_check(def, detail);
}

static void joint_make(hap_scene *scene, const hap_joint_def *def, hapi_scene_joint *out)
{
  const joint_making *making = &makings[def->kind];
  const hapi_scene_body *b = hapi_scene_body_at(scene, def->body_b);
  *out = (hapi_scene_joint){making->create(scene->world, NULL), def->kind};
  dJointAttach(out->joint, scene->bodies[def->body_a].body, b != NULL ? b->body : NULL);
  if (making->set_anchor != NULL) {
    making->set_anchor(out->joint, def->anchor[0], def->anchor[1], def->anchor[2]);
  }
  if (def->kind == HAP_JOINT_UNIVERSAL) { /* on the way the axes are never along each other */
    const double *first = def->axis[0];
    const bool is_y = fabs(first[1]) > fabs(first[2]);
    dJointSetUniversalAxis2(out->joint, 0.0, is_y ? 0.0 : 1.0, is_y ? 1.0 : 0.0);
  }
  for (int i = 0; i < 2; ++i) {
    if (making->set_axis[i] != NULL) {
      making->set_axis[i](out->joint, def->axis[i][0], def->axis[i][1], def->axis[i][2]);
    }
  }
  if (def->kind == HAP_JOINT_HINGE2) {
    dJointSetHinge2Axes(out->joint, def->axis[0], def->axis[1]);
  } else if (def->kind == HAP_JOINT_FIXED) {
    dJointSetFixed(out->joint);
  }
  for (uint32_t i = 0; i < hapi_scene_joint_axes(def->kind); ++i) {
    /* ODE 0.16 writes past its memory when a hinge loses its stops; -pi and pi are none to it */
    double most = def->kind == HAP_JOINT_SLIDER ? dInfinity : ANGLE_MOST;
    hapi_scene_joint_set(out, dParamLoStop, i, fmax(def->low[i], -most));
    hapi_scene_joint_set(out, dParamHiStop, i, fmin(def->high[i], most));
    hapi_scene_joint_set(out, dParamLoStop, i, fmax(def->low[i], -most)); /* ODE wants it twice */
    hapi_scene_joint_set(out, dParamVel, i, def->motor_speed[i]);
    hapi_scene_joint_set(out, dParamFMax, i, def->motor_force[i]);
    const hapi_axis_spring spring = spring_of(def, i);
    if (hapi_axis_spring_acts(&spring)) {
      hapi_spring_make(&scene->springs, scene->world, out->joint, i, &spring);
    }
  }
}

hap_status hap_scene_add_joint(hap_scene *scene, const hap_joint_def *given, uint32_t *out_joint,
                               hap_detail *detail)
{
  hap_joint_def def;
  if (scene == NULL) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "scene is NULL");
  }
  HAPI_TRY(hapi_def_read(&joint_def_type, given, &def, detail));
  HAPI_TRY(joint_check(scene, &def, detail));
  HAPI_TRY(hapi_scene_may_edit(scene, detail));
  if (!hapi_reserve((void **)&scene->joints, &scene->joint_capacity, scene->joint_count, 1,
                    sizeof *scene->joints) ||
      !hapi_reserve((void **)&scene->springs.of, &scene->springs.capacity, scene->springs.count, 2,
                    sizeof *scene->springs.of)) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for a joint");
  }
  joint_make(scene, &def, &scene->joints[scene->joint_count]);
  if (out_joint != NULL) {
    *out_joint = scene->joint_count;
  }
  ++scene->joint_count;
  return HAP_OK;
}

/* ---- and go ---- */

static void joint_remove(hap_scene *scene, hapi_scene_joint *joint)
{
  hapi_spring_remove(&scene->springs, joint->joint);
  dJointDestroy(joint->joint);
  joint->joint = NULL;
}

static void geom_remove(const hap_scene *scene, hapi_scene_geom *geom)
{
  if (scene->session != NULL) {
    (void)hap_session_forget_geom(scene->session, geom->geom);
  }
  hapi_scene_geom_end(geom);
}

hap_status hap_scene_remove_body(hap_scene *scene, uint32_t number)
{
  hapi_scene_body *body = scene != NULL ? hapi_scene_body_at(scene, number) : NULL;
  if (body == NULL) {
    return scene == NULL ? HAP_ERROR_ARGUMENT : HAP_ERROR_NOT_FOUND;
  }
  HAPI_TRY(hapi_scene_may_edit(scene, NULL));
  for (uint32_t i = 0; i < scene->joint_count; ++i) {
    hapi_scene_joint *joint = hapi_scene_joint_at(scene, i);
    if (joint != NULL && (dJointGetBody(joint->joint, 0) == body->body ||
                          dJointGetBody(joint->joint, 1) == body->body)) {
      joint_remove(scene, joint);
    }
  }
  if (scene->session != NULL) {
    (void)hap_session_forget_body(scene->session, body->body);
  }
  for (uint32_t i = 0; i < scene->geom_count; ++i) {
    if (scene->geoms[i].geom != NULL && scene->geoms[i].body == number) {
      geom_remove(scene, &scene->geoms[i]);
    }
  }
  dBodyDestroy(body->body);
  body->body = NULL;
  return HAP_OK;
}

hap_status hap_scene_remove_geom(hap_scene *scene, uint32_t number)
{
  hapi_scene_geom *geom = scene != NULL ? hapi_scene_geom_at(scene, number) : NULL;
  if (geom == NULL) {
    return scene == NULL ? HAP_ERROR_ARGUMENT : HAP_ERROR_NOT_FOUND;
  }
  if (geom->body != HAP_SCENE_WORLD) {
    return HAP_ERROR_STATE;
  }
  HAPI_TRY(hapi_scene_may_edit(scene, NULL));
  geom_remove(scene, geom);
  return HAP_OK;
}

hap_status hap_scene_remove_joint(hap_scene *scene, uint32_t number)
{
  hapi_scene_joint *joint = scene != NULL ? hapi_scene_joint_at(scene, number) : NULL;
  if (joint == NULL) {
    return scene == NULL ? HAP_ERROR_ARGUMENT : HAP_ERROR_NOT_FOUND;
  }
  HAPI_TRY(hapi_scene_may_edit(scene, NULL));
  joint_remove(scene, joint);
  return HAP_OK;
}
