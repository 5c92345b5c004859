/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "bench/joint_gauge.h"

#include <math.h>
#include <string.h>

#include "base/log.h"
#include "base/pose.h"

typedef void (*getter)(dJointID, dVector3);

/* Without anchors: the centre of the second body, or of the first on the static world. */
typedef struct kind {
  dJointType type;
  getter anchors[2];
  getter axes[2];
  bool slides;
  bool keeps_turn;
} kind;

static const kind kinds[] = {
    {dJointTypeBall, {dJointGetBallAnchor, dJointGetBallAnchor2}, {NULL, NULL}, false, false},
    {dJointTypeHinge,
     {dJointGetHingeAnchor, dJointGetHingeAnchor2},
     {dJointGetHingeAxis, dJointGetHingeAxis},
     false,
     false},
    {dJointTypeSlider, {NULL, NULL}, {dJointGetSliderAxis, dJointGetSliderAxis}, true, true},
    {dJointTypeUniversal,
     {dJointGetUniversalAnchor, dJointGetUniversalAnchor2},
     {dJointGetUniversalAxis1, dJointGetUniversalAxis2},
     false,
     false},
    {dJointTypeHinge2,
     {dJointGetHinge2Anchor, dJointGetHinge2Anchor2},
     {dJointGetHinge2Axis1, dJointGetHinge2Axis2},
     true,
     false},
    {dJointTypePiston,
     {dJointGetPistonAnchor, dJointGetPistonAnchor2},
     {dJointGetPistonAxis, dJointGetPistonAxis},
     true,
     false},
    {dJointTypeFixed, {NULL, NULL}, {NULL, NULL}, false, true},
};

static const hap_pose world_pose = {{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};

static const kind *kind_of(dJointID joint)
{
  for (size_t i = 0; i < sizeof kinds / sizeof kinds[0]; ++i) {
    if (kinds[i].type == dJointGetType(joint)) {
      return &kinds[i];
    }
  }
  return NULL;
}

hap_pose joint_gauge_pose(dBodyID body)
{
  hap_pose pose = world_pose;
  if (body != NULL) {
    hapi_v3_copy(dBodyGetPosition(body), pose.position);
    memcpy(pose.quat_wxyz, dBodyGetQuaternion(body), sizeof pose.quat_wxyz);
  }
  return pose;
}

static void relative_turn(const hap_pose *a, const hap_pose *b, double out[4])
{
  const double *q = a->quat_wxyz;
  const double back[4] = {q[0], -q[1], -q[2], -q[3]};
  hapi_quat_multiply(back, b->quat_wxyz, out);
}

/* acos of a dot product would round to 1e-8. */
static double angle_between(const double a[3], const double b[3])
{
  double across[3];
  hapi_v3_cross(a, b, across);
  return atan2(hapi_v3_norm(across), hapi_v3_dot(a, b));
}

/* ---- where the joints are ---- */

static void read_places(const kind *of, dJointID joint, joint_gauge_joint *out)
{
  dBodyID bodies[2] = {dJointGetBody(joint, 0), dJointGetBody(joint, 1)};
  hap_pose poses[2] = {joint_gauge_pose(bodies[0]), joint_gauge_pose(bodies[1])};
  hap_pose centre = bodies[1] != NULL ? poses[1] : poses[0];
  dVector3 axes[2] = {{0.0}, {0.0}};
  for (int side = 0; side < 2; ++side) {
    dVector3 at = {centre.position[0], centre.position[1], centre.position[2], 0.0};
    if (of->anchors[side] != NULL) {
      of->anchors[side](joint, at);
    }
    if (of->axes[side] != NULL) {
      of->axes[side](joint, axes[side]);
    }
    hapi_pose_unpoint(poses[side].position, poses[side].quat_wxyz, at, out->anchors[side]);
    hapi_quat_unrotate(poses[side].quat_wxyz, axes[side], out->axes[side]);
  }
  out->angle = angle_between(axes[0], axes[1]);
  relative_turn(&poses[0], &poses[1], out->turn);
  out->slides = of->slides;
  out->has_axes = of->axes[0] != NULL;
  out->keeps_turn = of->keeps_turn;
}

static bool find_bodies(dJointID joint, const dBodyID *bodies, size_t count, int out[2])
{
  for (int side = 0; side < 2; ++side) {
    dBodyID body = dJointGetBody(joint, side);
    out[side] = -1;
    for (size_t i = 0; i < count && body != NULL; ++i) {
      out[side] = bodies[i] == body ? (int)i : out[side];
    }
    if (body != NULL && out[side] < 0) {
      return false;
    }
  }
  return true;
}

static hap_status add_joint(joint_gauge *gauge, dJointID joint, const dBodyID *bodies, size_t count,
                            hap_detail *detail)
{
  const kind *of = kind_of(joint);
  if (gauge->count == JOINT_GAUGE_MAX) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "more than %d joints", JOINT_GAUGE_MAX);
  }
  joint_gauge_joint *out = &gauge->joints[gauge->count];
  if (of == NULL || !find_bodies(joint, bodies, count, out->bodies)) {
    return hapi_fail(detail, HAP_ERROR_UNSUPPORTED,
                     of == NULL ? "how far a joint of type %d is open is not known"
                                : "a joint of type %d has a body that is not in the list",
                     (int)dJointGetType(joint));
  }
  read_places(of, joint, out);
  ++gauge->count;
  return HAP_OK;
}

/* A joint is in the lists of both of its bodies. */
static bool is_counted_at(dJointID joint, dBodyID body)
{
  dBodyID first = dJointGetBody(joint, 0);
  return dJointGetType(joint) != dJointTypeContact &&
         body == (first != NULL ? first : dJointGetBody(joint, 1));
}

hap_status joint_gauge_init(joint_gauge *gauge, const dBodyID *bodies, size_t count,
                            hap_detail *detail)
{
  hap_status status = HAP_OK;
  memset(gauge, 0, sizeof *gauge);
  for (size_t i = 0; i < count; ++i) {
    for (int k = 0; k < dBodyGetNumJoints(bodies[i]) && status >= HAP_OK; ++k) {
      dJointID joint = dBodyGetJoint(bodies[i], k);
      if (is_counted_at(joint, bodies[i])) {
        status = add_joint(gauge, joint, bodies, count, detail);
      }
    }
  }
  return status;
}

/* ---- how far they are open ---- */

static double way_of(const joint_gauge_joint *joint, const hap_pose *a, const hap_pose *b)
{
  double from[3];
  double way[3];
  hapi_pose_point(a->position, a->quat_wxyz, joint->anchors[0], from);
  hapi_pose_point(b->position, b->quat_wxyz, joint->anchors[1], way);
  hapi_v3_sub(way, from, way);
  if (joint->slides) {
    double axis[3];
    hapi_quat_rotate(a->quat_wxyz, joint->axes[0], axis);
    hapi_v3_madd(way, -hapi_v3_dot(way, axis), axis, way);
  }
  return hapi_v3_norm(way);
}

static double turn_of(const joint_gauge_joint *joint, const hap_pose *a, const hap_pose *b)
{
  double axes[2][3];
  double is[4];
  double apart[4];
  const double *was = joint->turn;
  const double back[4] = {was[0], -was[1], -was[2], -was[3]};
  if (joint->keeps_turn) {
    relative_turn(a, b, is);
    hapi_quat_multiply(is, back, apart);
    return 2.0 * atan2(hapi_v3_norm(apart + 1), fabs(apart[0]));
  }
  if (!joint->has_axes) {
    return 0.0;
  }
  hapi_quat_rotate(a->quat_wxyz, joint->axes[0], axes[0]);
  hapi_quat_rotate(b->quat_wxyz, joint->axes[1], axes[1]);
  return fabs(angle_between(axes[0], axes[1]) - joint->angle);
}

void joint_gauge_read(const joint_gauge *gauge, const hap_pose *poses, const bool *set,
                      joint_opening *in, joint_opening *out)
{
  for (size_t i = 0; i < gauge->count; ++i) {
    const int *at = gauge->joints[i].bodies;
    bool has_a = set == NULL || at[0] < 0 || set[at[0]];
    bool has_b = set == NULL || at[1] < 0 || set[at[1]];
    joint_opening *worst = has_a && has_b ? in : out;
    if (worst != NULL) {
      const hap_pose *a = at[0] < 0 ? &world_pose : &poses[at[0]];
      const hap_pose *b = at[1] < 0 ? &world_pose : &poses[at[1]];
      worst->way = fmax(worst->way, way_of(&gauge->joints[i], a, b));
      worst->turn = fmax(worst->turn, turn_of(&gauge->joints[i], a, b));
    }
  }
}
