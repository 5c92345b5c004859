/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/vec.h"
#include "world/world.h"

/* Where a joint is in its bodies' frames, and what its parameters are, by ODE's getters. Some of
 * it has none: how a slider or a fixed joint has its bodies turned to each other, where the axis
 * of a hinge is in its second body, the angle that the axes of a hinge-2 are to have. All of
 * that ODE itself takes from the poses at the time when the joint is set; so it is taken here
 * from the poses at the time when the joint is seen for the first time or has changed. */

/* Of what a joint was remembered as, against what its getters say. */
#define SAME_PLACE 1e-7   /* m, and of unit vectors */
#define SAME_ANGLE 1e-4   /* rad */
#define SAME_SLIDE 1e-4   /* m */
#define LEAST_ACROSS 1e-6 /* of two axes, below which they have no plane */

/* ---- geometry ---- */

static void point_into(const hap_pose *pose, const double world[3], double out[3])
{
  hapi_pose_unpoint(pose->position, pose->quat_wxyz, world, out);
}

static void vector_into(const hap_pose *pose, const double world[3], double out[3])
{
  hapi_quat_unrotate(pose->quat_wxyz, world, out);
}

/* v about a unit axis; Rodrigues. */
static void turn_about(const double axis[3], double angle, const double v[3], double out[3])
{
  double across[3];
  double along = hapi_v3_dot(axis, v) * (1.0 - cos(angle));
  hapi_v3_cross(axis, v, across);
  for (int i = 0; i < 3; ++i) {
    out[i] = cos(angle) * v[i] + sin(angle) * across[i] + along * axis[i];
  }
}

/* The part of v across a unit axis, as a unit vector; false: there is none. */
static bool across_axis(const double axis[3], const double v[3], double out[3])
{
  hapi_v3_madd(v, -hapi_v3_dot(v, axis), axis, out);
  double length = hapi_v3_norm(out);
  if (!(length > LEAST_ACROSS)) {
    return false;
  }
  hapi_v3_scale(1.0 / length, out, out);
  return true;
}

/* What ODE's getters say at one time. */
typedef struct reading {
  dJointID joint;
  bool turned; /* attached the other way round: the world first */
  hap_pose a;
  hap_pose b; /* identity: static world */
  hapi_joint_place place;
  double positions[2]; /* of the free axes, as ODE measures them */
} reading;

/* ODE answers for the body that the application attached first; here it is the one that comes
 * first. */
static void read_anchors(reading *r, void (*first)(dJointID, dVector3),
                         void (*second)(dJointID, dVector3))
{
  dVector3 at = {0.0, 0.0, 0.0, 0.0};
  (r->turned ? second : first)(r->joint, at);
  point_into(&r->a, at, r->place.anchor_a);
  (r->turned ? first : second)(r->joint, at);
  point_into(&r->b, at, r->place.anchor_b);
}

static void read_turn(reading *r)
{
  const double *q = r->a.quat_wxyz;
  double back[4] = {q[0], -q[1], -q[2], -q[3]};
  hapi_quat_multiply(back, r->b.quat_wxyz, r->place.turn);
}

/* Some direction across a unit axis. */
static void any_across(const double axis[3], double out[3])
{
  const double x[3] = {1.0, 0.0, 0.0};
  const double y[3] = {0.0, 1.0, 0.0};
  (void)across_axis(axis, fabs(axis[0]) < 0.6 ? x : y, out);
}

static void read_hinge(reading *r)
{
  dVector3 axis;
  double ahead[3];
  double behind[3];
  double angle = dJointGetHingeAngle(r->joint);
  read_anchors(r, dJointGetHingeAnchor, dJointGetHingeAnchor2);
  r->positions[0] = r->turned ? -angle : angle;
  dJointGetHingeAxis(r->joint, axis);
  any_across(axis, ahead);
  turn_about(axis, -r->positions[0], ahead, behind);
  vector_into(&r->a, axis, r->place.axis_a);
  vector_into(&r->b, axis, r->place.axis_b);
  vector_into(&r->a, ahead, r->place.reference_a);
  vector_into(&r->b, behind, r->place.reference_b);
}

static void read_slider(reading *r)
{
  dVector3 axis;
  double start[3];
  r->positions[0] = dJointGetSliderPosition(r->joint);
  dJointGetSliderAxis(r->joint, axis);
  hapi_v3_scale(r->turned ? -1.0 : 1.0, axis, axis);
  hapi_v3_madd(r->a.position, -r->positions[0], axis, start);
  vector_into(&r->a, axis, r->place.axis_a);
  any_across(r->place.axis_a, r->place.reference_a);
  point_into(&r->b, start, r->place.anchor_b);
  read_turn(r);
}

/* The axes in the world. */
static bool read_cross(reading *r, const double first[3], const double second[3])
{
  double v[3];
  vector_into(&r->a, first, r->place.axis_a);
  vector_into(&r->b, second, r->place.axis_b);
  if (!across_axis(first, second, v)) {
    return false;
  }
  turn_about(first, r->positions[0], v, v);
  vector_into(&r->a, v, r->place.reference_a);
  (void)across_axis(second, first, v);
  turn_about(second, -r->positions[1], v, v);
  vector_into(&r->b, v, r->place.reference_b);
  return true;
}

static bool read_universal(reading *r)
{
  dVector3 first;
  dVector3 second;
  double one = dJointGetUniversalAngle1(r->joint);
  double two = dJointGetUniversalAngle2(r->joint);
  r->positions[0] = r->turned ? -two : one;
  r->positions[1] = r->turned ? one : two;
  read_anchors(r, dJointGetUniversalAnchor, dJointGetUniversalAnchor2);
  dJointGetUniversalAxis1(r->joint, first);
  dJointGetUniversalAxis2(r->joint, second);
  r->place.sin_axes = 1.0;
  return r->turned ? read_cross(r, second, first) : read_cross(r, first, second);
}

static bool read_hinge2(reading *r)
{
  dVector3 first;
  dVector3 second;
  double across[3];
  r->positions[0] = dJointGetHinge2Angle1(r->joint);
  read_anchors(r, dJointGetHinge2Anchor, dJointGetHinge2Anchor2);
  dJointGetHinge2Axis1(r->joint, first);
  dJointGetHinge2Axis2(r->joint, second);
  hapi_v3_cross(first, second, across);
  r->place.sin_axes = hapi_v3_norm(across);
  r->place.cos_axes = hapi_v3_dot(first, second);
  return read_cross(r, first, second);
}

static bool place_is_finite(const hapi_joint_place *p)
{
  return hapi_finite(p->anchor_a, 3) && hapi_finite(p->anchor_b, 3) && hapi_finite(p->axis_a, 3) &&
         hapi_finite(p->axis_b, 3) && hapi_finite(p->reference_a, 3) &&
         hapi_finite(p->reference_b, 3) && hapi_finite(p->turn, 4) &&
         hapi_finite(&p->cos_axes, 1) && hapi_finite(&p->sin_axes, 1);
}

static bool read_place(const hapi_known_joint *known, reading *r)
{
  bool good = true;
  memset(r, 0, sizeof *r);
  r->joint = known->joint;
  r->turned = dJointGetBody(known->joint, 0) == NULL;
  hapi_pose_read(known->bodies[0], &r->a);
  hapi_pose_read(known->bodies[1], &r->b);
  switch (known->kind) {
    case HAPI_JOINT_BALL:
      read_anchors(r, dJointGetBallAnchor, dJointGetBallAnchor2);
      break;
    case HAPI_JOINT_HINGE:
      read_hinge(r);
      break;
    case HAPI_JOINT_SLIDER:
      read_slider(r);
      break;
    case HAPI_JOINT_UNIVERSAL:
      good = read_universal(r);
      break;
    case HAPI_JOINT_HINGE2:
      good = known->bodies[1] != NULL && read_hinge2(r);
      break;
    case HAPI_JOINT_FIXED:
      /* ODE holds the centre of the second body where it is in the first; of one that hangs on the
       * world its own centre. */
      if (known->bodies[1] != NULL) {
        point_into(&r->a, r->b.position, r->place.anchor_a);
      } else {
        hapi_v3_copy(r->a.position, r->place.anchor_b);
      }
      read_turn(r);
      break;
    case HAPI_JOINT_MEASURED:
      break;
  }
  return good && place_is_finite(&r->place);
}

/* ---- has it changed? ---- */

static bool near_to(const double a[3], const double b[3])
{
  double apart[3];
  hapi_v3_sub(a, b, apart);
  return hapi_v3_norm(apart) <= SAME_PLACE; /* false for NaN */
}

/* From one direction to another about an axis between them, world. */
static double angle_about(const double axis[3], const double from[3], const double to[3])
{
  double across[3];
  hapi_v3_cross(from, to, across);
  return atan2(hapi_v3_dot(across, axis),
               hapi_v3_dot(from, to) - hapi_v3_dot(from, axis) * hapi_v3_dot(to, axis));
}

/* How far the axes are from where they shall be to each other, rad. */
static double axes_open(hapi_joint_kind kind, const hapi_joint_place *was, const reading *r)
{
  double a[3];
  double b[3];
  double across[3];
  hapi_quat_rotate(r->a.quat_wxyz, was->axis_a, a);
  hapi_quat_rotate(r->b.quat_wxyz, was->axis_b, b);
  hapi_v3_cross(a, b, across);
  return kind == HAPI_JOINT_HINGE
             ? hapi_v3_norm(across)
             : fabs(was->cos_axes * hapi_v3_norm(across) - was->sin_axes * hapi_v3_dot(a, b));
}

/* Whether a place as it was remembered gives the angle that ODE measures now. ODE takes all of a
 * relative turn for one about the axis: where the joint is open, its angle is off by as much. */
static bool same_angle(hapi_joint_kind kind, const hapi_joint_place *was, const reading *r,
                       int which)
{
  double axis[3];
  double from[3];
  double to[3];
  const double *b = which == 0 && kind != HAPI_JOINT_HINGE ? was->axis_b : was->reference_b;
  hapi_quat_rotate(r->b.quat_wxyz, b, from);
  hapi_quat_rotate(r->a.quat_wxyz, which == 0 ? was->reference_a : was->axis_a, to);
  if (which == 0) {
    hapi_quat_rotate(r->a.quat_wxyz, was->axis_a, axis);
  } else {
    hapi_quat_rotate(r->b.quat_wxyz, was->axis_b, axis);
  }
  double apart = 2.0 * fabs(sin(0.5 * (angle_about(axis, from, to) - r->positions[which])));
  return apart < SAME_ANGLE + 2.0 * axes_open(kind, was, r);
}

static bool same_slide(const hapi_joint_place *was, const reading *r)
{
  double start[3];
  double way[3];
  double axis[3];
  hapi_quat_rotate(r->a.quat_wxyz, was->axis_a, axis);
  hapi_pose_point(r->b.position, r->b.quat_wxyz, was->anchor_b, start);
  hapi_v3_sub(r->a.position, start, way);
  return fabs(hapi_v3_dot(way, axis) - r->positions[0]) < SAME_SLIDE;
}

/* Asked is what the motion of the bodies does not change: anchors and axes in the bodies' own
 * frames, and where the angles have their zero. */
static bool same_place(hapi_joint_kind kind, const hapi_joint_place *was, const reading *r)
{
  const hapi_joint_place *is = &r->place;
  bool anchors = near_to(was->anchor_a, is->anchor_a) && near_to(was->anchor_b, is->anchor_b);
  bool axis_a = near_to(was->axis_a, is->axis_a);
  switch (kind) {
    case HAPI_JOINT_BALL:
      return anchors;
    case HAPI_JOINT_HINGE:
      return anchors && axis_a && same_angle(kind, was, r, 0);
    case HAPI_JOINT_SLIDER:
      return axis_a && same_slide(was, r);
    case HAPI_JOINT_UNIVERSAL:
      return anchors && axis_a && near_to(was->axis_b, is->axis_b) && same_angle(kind, was, r, 0) &&
             same_angle(kind, was, r, 1);
    case HAPI_JOINT_HINGE2:
      return anchors && axis_a && near_to(was->axis_b, is->axis_b) && same_angle(kind, was, r, 0);
    case HAPI_JOINT_FIXED:
    case HAPI_JOINT_MEASURED:
      return true; /* nothing of it can be read: see has_been_moved */
  }
  return false;
}

/* ---- bodies moved against each other between two steps ---- */

static void relative_pose(const hapi_known_joint *known, hap_pose *out)
{
  reading r = {0};
  hapi_pose_read(known->bodies[0], &r.a);
  hapi_pose_read(known->bodies[1], &r.b);
  point_into(&r.a, r.b.position, out->position);
  read_turn(&r);
  memcpy(out->quat_wxyz, r.place.turn, sizeof out->quat_wxyz);
}

static bool hides_turn(hapi_joint_kind kind)
{
  return kind == HAPI_JOINT_SLIDER || kind == HAPI_JOINT_FIXED;
}

void hapi_joint_leave(hapi_known_joint *known)
{
  if (known->usable && hides_turn(known->kind)) {
    relative_pose(known, &known->left);
    known->left_is_known = true;
  }
}

/* By the application. To set a slider or a fixed joint anew makes sense for it then only. */
static bool has_been_moved(const hapi_known_joint *known)
{
  hap_pose now;
  if (!known->left_is_known || !hides_turn(known->kind)) {
    return false;
  }
  relative_pose(known, &now);
  double turned = 0.0;
  for (int i = 0; i < 4; ++i) {
    turned += fabs(now.quat_wxyz[i] - known->left.quat_wxyz[i]);
  }
  return !near_to(now.position, known->left.position) || !(turned <= SAME_PLACE);
}

void hapi_joint_read(hapi_known_joint *known, bool is_new)
{
  reading r;
  if (!read_place(known, &r)) {
    known->usable = false;
  } else if (is_new || !known->usable || !same_place(known->kind, &known->place, &r) ||
             has_been_moved(known)) {
    known->place = r.place;
    known->usable = true;
  }
}

double hapi_joint_open(const hapi_known_joint *known)
{
  const hapi_joint_place *place = &known->place;
  hap_pose a;
  hap_pose b;
  double ends[2][3];
  double apart[3];
  double axis[3];
  if (!known->carried || !known->usable) {
    return 0.0;
  }
  hapi_pose_read(known->bodies[0], &a);
  hapi_pose_read(known->bodies[1], &b);
  hapi_pose_point(a.position, a.quat_wxyz, place->anchor_a, ends[0]);
  hapi_pose_point(b.position, b.quat_wxyz, place->anchor_b, ends[1]);
  hapi_v3_sub(ends[1], ends[0], apart);
  if (known->kind == HAPI_JOINT_SLIDER || known->kind == HAPI_JOINT_HINGE2) { /* free along it */
    hapi_quat_rotate(a.quat_wxyz, place->axis_a, axis);
    hapi_v3_madd(apart, -hapi_v3_dot(apart, axis), axis, apart);
  }
  return hapi_v3_norm(apart);
}
