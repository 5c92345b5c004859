/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/vec.h"
#include "world/world.h"

/* The border between the application's world and ours: what ODE holds is looked at once a cycle,
 * before collision, step and testing simulations. ODE aborts the process on a quaternion that is
 * not finite, and one number that is none, in a joint or in the gravity as well as in a pose, makes
 * such a quaternion in one step. Finite numbers have limits too: beyond them the products of a step
 * overflow. */

#define MASS_LEAST 1e-12    /* kg */
#define MASS_MOST 1e12      /* kg */
#define INERTIA_LEAST 1e-30 /* kg m^2 */
#define INERTIA_MOST 1e30   /* kg m^2 */
#define DEFINITE 1e-12      /* determinant of an inertia, of the product of its diagonal */
#define POSITION_MOST 1e9   /* m */
#define SPEED_MOST 1e8      /* m/s */
#define SPIN_MOST 1e7       /* rad/s */
#define WRENCH_MOST 1e12    /* N, N m */
#define GRAVITY_MOST 1e6    /* m/s^2 */
#define NORMAL_LEAST 0.99   /* length of a contact's normal */
#define NORMAL_MOST 1.01
#define ERP_MOST 10.0          /* ODE means 0 .. 1 */
#define JOINT_NUMBER_MOST 1e12 /* speeds, softness, error reduction of joints */

static bool vector_within(const dReal *v, double limit)
{
  return fabs(v[0]) <= limit && fabs(v[1]) <= limit && fabs(v[2]) <= limit; /* false for NaN */
}

/* ---- bodies ---- */

static bool good_inertia(const dReal i[12])
{
  double minor = i[0] * i[5] - i[1] * i[4];
  double det =
      minor * i[10] - i[2] * (i[5] * i[8] - i[4] * i[9]) - i[6] * (i[0] * i[9] - i[1] * i[8]);
  double least = fmin(i[0], fmin(i[5], i[10]));
  double most = fmax(i[0], fmax(i[5], i[10]));
  return hapi_finite(i, 12) && least >= INERTIA_LEAST && most <= INERTIA_MOST &&
         minor > DEFINITE * i[0] * i[5] && det > DEFINITE * i[0] * i[5] * i[10];
}

static const char *mass_unsoundness(dBodyID body)
{
  dMass mass;
  dBodyGetMass(body, &mass);
  if (!(mass.mass >= MASS_LEAST && mass.mass <= MASS_MOST)) {
    return "has no mass in 1e-12 .. 1e12 kg";
  }
  return good_inertia(mass.I) ? NULL
                              : "has an inertia that is not finite and positive definite, in "
                                "1e-30 .. 1e30 kg m^2";
}

static const char *damping_unsoundness(dBodyID body)
{
  double linear = dBodyGetLinearDamping(body);
  double angular = dBodyGetAngularDamping(body);
  bool good = fabs(linear) <= 1.0 && fabs(angular) <= 1.0 && !isnan(dBodyGetMaxAngularSpeed(body));
  return good ? NULL : "has a damping or a largest angular speed that is not a number, or above 1";
}

static const char *state_unsoundness(dBodyID body)
{
  const char *what = dBodyIsKinematic(body) ? NULL : mass_unsoundness(body);
  if (what != NULL) {
    return what;
  }
  if (!vector_within(dBodyGetPosition(body), POSITION_MOST)) {
    return "has a position that is not finite or beyond 1e9 m";
  }
  if (!vector_within(dBodyGetLinearVel(body), SPEED_MOST) ||
      !vector_within(dBodyGetAngularVel(body), SPIN_MOST)) {
    return "has a velocity that is not finite or beyond 1e8 m/s or 1e7 rad/s";
  }
  if (!vector_within(dBodyGetForce(body), WRENCH_MOST) ||
      !vector_within(dBodyGetTorque(body), WRENCH_MOST)) {
    return "has a force or torque on it that is not finite or beyond 1e12";
  }
  if (!hapi_finite(dBodyGetQuaternion(body), 4)) {
    return "has an orientation that is not finite";
  }
  return damping_unsoundness(body);
}

static bool is_short(const dReal *v, double limit)
{
  return v[0] * v[0] + v[1] * v[1] + v[2] * v[2] <= limit * limit; /* false for NaN */
}

static bool plain_mass(dBodyID body)
{
  dMass mass;
  uint64_t bits[12];
  dBodyGetMass(body, &mass);
  memcpy(bits, mass.I, sizeof bits);
  uint64_t beside = bits[1] | bits[2] | bits[3] | bits[4] | bits[6] | bits[7] | bits[8] | bits[9] |
                    bits[11]; /* of the diagonal */
  const dReal *i = mass.I;
  return mass.mass >= MASS_LEAST && mass.mass <= MASS_MOST && beside == 0 &&
         i[0] >= INERTIA_LEAST && i[0] <= INERTIA_MOST && i[5] >= INERTIA_LEAST &&
         i[5] <= INERTIA_MOST && i[10] >= INERTIA_LEAST && i[10] <= INERTIA_MOST;
}

/* What nearly all bodies pass, and none that is not sound: a step looks at each body that there
 * is. */
static bool is_plainly_sound(dBodyID body)
{
  return plain_mass(body) && is_short(dBodyGetPosition(body), POSITION_MOST) &&
         hapi_finite(dBodyGetQuaternion(body), 4) &&
         is_short(dBodyGetLinearVel(body), SPEED_MOST) &&
         is_short(dBodyGetAngularVel(body), SPIN_MOST) &&
         is_short(dBodyGetForce(body), WRENCH_MOST) &&
         is_short(dBodyGetTorque(body), WRENCH_MOST) && damping_unsoundness(body) == NULL;
}

void hapi_pose_read(dBodyID body, hap_pose *out)
{
  *out = (hap_pose){{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
  if (body != NULL) {
    hapi_v3_copy(dBodyGetPosition(body), out->position);
    memcpy(out->quat_wxyz, dBodyGetQuaternion(body), sizeof out->quat_wxyz);
  }
}

void hapi_twist_read(dBodyID body, hap_twist *out)
{
  hapi_v3_copy(dBodyGetLinearVel(body), out->linear);
  hapi_v3_copy(dBodyGetAngularVel(body), out->angular);
}

void hapi_matrix_read(const dReal in[12], double out[9])
{
  for (int i = 0; i < 9; ++i) {
    out[i] = in[4 * (i / 3) + i % 3];
  }
}

bool hapi_pose_is_sound(dBodyID body)
{
  return hapi_finite(dBodyGetPosition(body), 3) && hapi_finite(dBodyGetQuaternion(body), 4);
}

/* ---- joints ---- */

/* Stops are infinite where there are none, and a largest force where there is no limit. */
static bool good_parameter(int name, double value)
{
  switch (name) {
    case dParamLoStop:
      return value <= POSITION_MOST;
    case dParamHiStop:
      return value >= -POSITION_MOST;
    case dParamFMax:
    case dParamLoVel:
    case dParamHiVel:
      return !isnan(value);
    default:
      return fabs(value) <= JOINT_NUMBER_MOST;
  }
}

static bool good_anchor(dJointID joint, void (*read)(dJointID, dVector3))
{
  dVector3 at = {0.0, 0.0, 0.0, 0.0};
  if (read != NULL) {
    read(joint, at);
  }
  return vector_within(at, 2.0 * POSITION_MOST);
}

/* Axes are not looked at: ODE normalises them when they are set, and takes none that has no
 * direction. */
static bool joint_is_sound(dJointID joint)
{
  const hapi_joint_traits *traits = hapi_joint_traits_of(joint);
  for (int group = 0; traits != NULL && group < traits->groups; ++group) {
    for (int name = dParamLoStop; name < dParamsInGroup; ++name) {
      if (!good_parameter(name, traits->get(joint, name + group * dParamGroup))) {
        return false;
      }
    }
  }
  return traits == NULL ||
         (good_anchor(joint, traits->anchor) && good_anchor(joint, traits->anchor2));
}

/* Each joint once: by its first body. */
static bool joints_are_sound(dBodyID body)
{
  int count = dBodyGetNumJoints(body);
  for (int i = 0; i < count; ++i) {
    dJointID joint = dBodyGetJoint(body, i);
    dBodyID first = dJointGetBody(joint, 0);
    bool ours = first == body || first == NULL;
    if (ours && dJointIsEnabled(joint) && !joint_is_sound(joint)) {
      return false;
    }
  }
  return true;
}

const char *hapi_body_unsoundness(dBodyID body, bool jointed)
{
  const char *what = is_plainly_sound(body) ? NULL : state_unsoundness(body);
  if (what == NULL && jointed && !joints_are_sound(body)) {
    what = "has a joint with an anchor or a parameter that is not finite or beyond 1e12";
  }
  return what;
}

/* ---- geoms ---- */

/* The box around a geom has all of its numbers in it. A collider would loop or end on them. */
bool hapi_geom_is_sound(dGeomID geom)
{
  dReal box[6];
  dGeomGetAABB(geom, box);
  for (int k = 0; k < 6; ++k) {
    if (isnan(box[k])) { /* infinite is what a plane is */
      return false;
    }
  }
  return true;
}

/* ODE's collider of a convex geom and a box gives the normal (0, 0, 0) where the two just touch.
 * QuickStep divides by the effective mass along it, makes NaN of it and aborts the process. */
bool hapi_contact_is_sound(const dContactGeom *contact)
{
  double length = hapi_v3_norm(contact->normal); /* false for NaN */
  return vector_within(contact->pos, 2.0 * POSITION_MOST) && length > NORMAL_LEAST &&
         length < NORMAL_MOST && fabs(contact->depth) <= POSITION_MOST;
}

/* ---- the world ---- */

static const char *world_unsoundness(dWorldID world)
{
  dVector3 gravity;
  dWorldGetGravity(world, gravity);
  double erp = dWorldGetERP(world);
  double cfm = dWorldGetCFM(world);
  if (!vector_within(gravity, GRAVITY_MOST)) {
    return "a gravity that is not finite or beyond 1e6 m/s^2";
  }
  if (!(erp >= 0.0 && erp <= ERP_MOST) || !(cfm >= 0.0 && cfm <= JOINT_NUMBER_MOST)) {
    return "an ERP that is not in 0 .. 10 or a CFM that is not in 0 .. 1e12";
  }
  bool layer = fabs(dWorldGetContactSurfaceLayer(world)) <= POSITION_MOST;
  bool push = dWorldGetContactMaxCorrectingVel(world) >= 0.0; /* also infinity; false for NaN */
  return layer && push ? NULL
                       : "a contact surface layer or largest correcting velocity that is none";
}

static void body_say(hap_detail *out, dBodyID body, const char *what)
{
  const dReal *p = dBodyGetPosition(body);
  snprintf(out->text, sizeof out->text, "a body at (%g, %g, %g) %s: set it right%s", p[0], p[1],
           p[2], what, dBodyIsKinematic(body) ? "" : ", or make the body kinematic");
}

bool hapi_world_is_unsound(const hapi_world *world, hap_detail *out_text)
{
  const hapi_body_table *table = &world->bodies;
  const char *what = world_unsoundness(world->ode.world);
  if (what != NULL) {
    snprintf(out_text->text, sizeof out_text->text, "the world has %s: set it right", what);
    return true;
  }
  if (table->unsound.body != NULL) {
    body_say(out_text, table->unsound.body, table->unsound.text);
  }
  return table->unsound.body != NULL;
}

bool hapi_body_is_unsound(const hapi_known_body *known, hap_detail *out_text)
{
  const char *what = hapi_body_unsoundness(known->body, known->jointed);
  if (what != NULL) {
    body_say(out_text, known->body, what);
  }
  return what != NULL;
}

bool hapi_geoms_are_unsound(const hapi_world *world, hap_detail *out_text)
{
  dGeomID geom = world->bodies.unsound.geom;
  if (geom != NULL) {
    snprintf(out_text->text, sizeof out_text->text,
             "a geom of class %d has a pose or size that is not a number: set it right",
             dGeomGetClass(geom));
  }
  return geom != NULL;
}
