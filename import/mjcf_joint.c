/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>

#include "base/log.h"
#include "base/vec.h"
#include "import/mjcf_internal.h"

#define THINGS_MOST 20000u

static hap_status limits_read(mjcf *m, const mjcf_item *item, import_joint *joint)
{
  enum {
    LIMITS_NOT,
    LIMITS_YES,
    LIMITS_AUTO
  };
  int limited = LIMITS_AUTO;
  double range[2];
  double reference = 0.0;
  size_t count;
  const double unit = joint->kind == IMPORT_SLIDER ? 1.0 : m->compiler.angle;
  HAPI_TRY(mjcf_word(m, item, "limited", "false true auto", &limited));
  HAPI_TRY(mjcf_numbers(m, item, "range", XML_OF(2, 2), range, &count));
  HAPI_TRY(mjcf_number(m, item, "ref", &reference));
  const bool has_range = count == 2;
  if (limited == LIMITS_NOT ||
      (limited == LIMITS_AUTO && !(m->compiler.auto_limits && has_range))) {
    return HAP_OK;
  }
  if (joint->kind == IMPORT_FREE || !has_range) {
    return HAP_OK;
  }
  if (joint->kind == IMPORT_BALL) {
    import_note(m->work, item->element->at, "range of a ball joint left out");
    return HAP_OK;
  }
  if (!(range[0] < range[1])) {
    return import_refuse(m->work, item->element->at, "range: does not rise");
  }
  joint->low = (range[0] - reference) * unit;
  joint->high = (range[1] - reference) * unit;
  return HAP_OK;
}

/* A spring and a damper may be polynomials; the linear part is taken. */
static hap_status linear_read(mjcf *m, const mjcf_item *item, const char *name, double *out)
{
  double parts[3] = {0.0, 0.0, 0.0};
  size_t count;
  HAPI_TRY(mjcf_numbers(m, item, name, XML_OF(1, 3), parts, &count));
  if (parts[1] != 0.0 || parts[2] != 0.0) {
    import_note(m->work, item->element->at, "joint: what is not linear of %s left out", name);
  }
  if (parts[0] < 0.0) {
    import_note(m->work, item->element->at, "joint: %s below 0 left out", name);
  }
  *out = fmax(parts[0], 0.0);
  return HAP_OK;
}

static hap_status spring_read(mjcf *m, const mjcf_item *item, import_joint *joint)
{
  double reference = 0.0;
  double rest = 0.0;
  double both[2] = {0.0, 0.0};
  size_t count;
  HAPI_TRY(mjcf_number(m, item, "armature", &joint->armature));
  HAPI_TRY(mjcf_number(m, item, "ref", &reference));
  HAPI_TRY(mjcf_number(m, item, "springref", &rest));
  HAPI_TRY(linear_read(m, item, "stiffness", &joint->stiffness));
  HAPI_TRY(linear_read(m, item, "damping", &joint->damping));
  HAPI_TRY(mjcf_numbers(m, item, "springdamper", XML_OF(2, 2), both, &count));
  joint->rest = (rest - reference) * (joint->kind == IMPORT_HINGE ? m->compiler.angle : 1.0);
  if (both[0] > 0.0 && both[1] > 0.0) {
    import_note(m->work, item->element->at, "joint: springdamper left out");
  }
  return HAP_OK;
}

hap_status mjcf_read_joint(mjcf *m, const mjcf_item *item, const hap_pose *frame, import_body *body)
{
  int kind = IMPORT_HINGE;
  double axis[3] = {0.0, 0.0, 1.0};
  double anchor[3] = {0.0, 0.0, 0.0};
  size_t count;
  if (xml_is(item->element, "freejoint")) {
    kind = IMPORT_FREE;
  } else {
    HAPI_TRY(mjcf_word(m, item, "type", "free ball hinge slide", &kind));
  }
  if (body->parent == NULL) {
    return import_refuse(m->work, item->element->at, "a joint of the world");
  }
  if (kind == IMPORT_FREE && body->parent->parent != NULL) {
    return import_refuse(m->work, item->element->at, "a free joint of a body in another one");
  }
  import_joint **end = &body->joints;
  for (; *end != NULL; end = &(*end)->next) {
    if (kind == IMPORT_FREE || (*end)->kind == IMPORT_FREE) {
      return import_refuse(m->work, item->element->at, "a free joint beside another joint");
    }
  }
  if (++m->things > THINGS_MOST || (*end = import_take(m->work, sizeof **end)) == NULL) {
    return m->things > THINGS_MOST
               ? import_refuse(m->work, item->element->at, "more than 20000 geoms and joints")
               : import_no_memory(m->work);
  }
  import_joint *joint = *end;
  const char *name = xml_get(item->element, "name");
  *joint = (import_joint){.at = item->element->at,
                          .name = name != NULL ? name : "",
                          .kind = (import_joint_kind)kind,
                          .low = -INFINITY,
                          .high = INFINITY};
  HAPI_TRY(mjcf_numbers(m, item, "axis", XML_OF(3, 3), axis, &count));
  HAPI_TRY(mjcf_numbers(m, item, "pos", XML_OF(3, 3), anchor, &count));
  HAPI_TRY(spring_read(m, item, joint));
  HAPI_TRY(mjcf_number(m, item, "frictionloss", &joint->friction));
  if (!(joint->friction >= 0.0)) {
    return import_refuse(m->work, item->element->at, "frictionloss: below 0");
  }
  double length = hapi_v3_norm(axis);
  if (!(length > 1e-12)) {
    return import_refuse(m->work, item->element->at, "axis: has no direction");
  }
  hapi_v3_scale(1.0 / length, axis, axis);
  hapi_quat_rotate(frame->quat_wxyz, axis, joint->axis);
  hapi_pose_point(frame->position, frame->quat_wxyz, anchor, joint->anchor);
  return limits_read(m, item, joint);
}
