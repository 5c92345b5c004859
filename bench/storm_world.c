/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "bench/storm_world.h"

#include <math.h>
#include <string.h>

#include "base/vec.h"

#define FAR 0.6  /* m: what is farther away is put back */
#define FAST 4.0 /* m/s */
#define SPIN 60.0

double storm_uniform(uint64_t *seed, double low, double high)
{
  *seed ^= *seed << 13;
  *seed ^= *seed >> 7;
  *seed ^= *seed << 17;
  return low + (high - low) * (double)(*seed >> 11) * 0x1p-53;
}

static double uniform(storm_world *w, double low, double high)
{
  return storm_uniform(&w->seed, low, high);
}

static int below(storm_world *w, int count)
{
  int n = (int)uniform(w, 0.0, count);
  return n < count ? n : count - 1;
}

static bool chance(storm_world *w, double share)
{
  return uniform(w, 0.0, 1.0) < share;
}

static void expect(storm_world *w, bool good)
{
  w->unexpected += !good;
}

/* Most things are where a hand is. */
static void choose_place(storm_world *w, double out[3])
{
  double wide = w->spot_count > 0 && chance(w, 0.8) ? 0.04 : 0.3;
  const double *spot = w->spots[w->spot_count > 0 ? below(w, w->spot_count) : 0];
  for (int k = 0; k < 3; ++k) {
    out[k] = (wide < 0.1 ? spot[k] : 0.0) + uniform(w, -wide, wide);
  }
}

/* ---- geoms ---- */

static dGeomID make_geom(storm_world *w)
{
  dSpaceID space = chance(w, 0.3) ? w->nested : w->space;
  double a = uniform(w, 0.01, 0.05);
  double b = uniform(w, 0.02, 0.1);
  switch (below(w, 4)) {
    case 0:
      return dCreateSphere(space, a);
    case 1:
      return dCreateCapsule(space, a, b);
    case 2:
      return dCreateCylinder(space, a, b);
    default:
      return dCreateBox(space, 2 * a, b, uniform(w, 0.02, 0.1));
  }
}

static void add_geom(storm_world *w, storm_thing *t)
{
  if (t->geom_count < STORM_GEOMS) {
    dGeomID geom = make_geom(w);
    dGeomSetBody(geom, t->body);
    if (t->geom_count > 0) {
      dGeomSetOffsetPosition(geom, uniform(w, -0.05, 0.05), uniform(w, -0.05, 0.05), 0.0);
    }
    t->geoms[t->geom_count++] = geom;
  }
}

static void drop_geom(storm_world *w, storm_thing *t, bool tell)
{
  dGeomID geom = t->geoms[--t->geom_count];
  if (tell) {
    expect(w, hap_session_forget_geom(w->session, geom) == HAP_OK);
  }
  dGeomDestroy(geom);
}

static void resize_geom(storm_world *w, dGeomID geom)
{
  double a = uniform(w, 0.01, 0.05);
  double b = uniform(w, 0.02, 0.1);
  switch (dGeomGetClass(geom)) {
    case dSphereClass:
      dGeomSphereSetRadius(geom, a);
      break;
    case dCapsuleClass:
      dGeomCapsuleSetParams(geom, a, b);
      break;
    case dCylinderClass:
      dGeomCylinderSetParams(geom, a, b);
      break;
    default:
      dGeomBoxSetLengths(geom, b, b, 2 * a);
      break;
  }
}

/* ---- bodies ---- */

static void set_mass(storm_world *w, storm_thing *t)
{
  dMass mass;
  double edge = uniform(w, 0.03, 0.1);
  dMassSetBoxTotal(&mass, uniform(w, 0.05, 2.0), edge, edge, uniform(w, 0.03, 0.1));
  dBodySetMass(t->body, &mass);
}

static void create_body(storm_world *w, storm_thing *t)
{
  double at[3];
  memset(t, 0, sizeof *t);
  t->body = dBodyCreate(w->world);
  choose_place(w, at);
  dBodySetPosition(t->body, at[0], at[1], at[2]);
  set_mass(w, t);
  add_geom(w, t);
}

static void destroy_body(storm_world *w, storm_thing *t)
{
  bool tell =
      t->adopted || w->telling == STORM_TELLS || (w->telling == STORM_TELLS_HALF && chance(w, 0.5));
  w->untold += !tell;
  if (tell) {
    hap_status status = hap_session_forget_body(w->session, t->body);
    expect(w, status == HAP_OK || status == HAP_ERROR_NOT_FOUND);
  }
  if (t->joint != NULL && chance(w, 0.5)) {
    dJointDestroy(t->joint);
    t->joint = NULL;
  }
  bool geoms_first = chance(w, 0.5);
  for (int round = 0; round < 2; ++round) {
    while (geoms_first == (round == 0) && t->geom_count > 0) {
      drop_geom(w, t, tell);
    }
    if (geoms_first == (round == 1)) {
      dBodyDestroy(t->body);
    }
  }
  if (t->joint != NULL) {
    dJointDestroy(t->joint);
  }
  memset(t, 0, sizeof *t);
}

/* ---- the edits ---- */

static void edit_replace(storm_world *w, storm_thing *t)
{
  destroy_body(w, t);
  create_body(w, t); /* mostly at the same address */
}

static void edit_pose(storm_world *w, storm_thing *t)
{
  double at[3];
  dQuaternion q = {uniform(w, -1, 1), uniform(w, -1, 1), uniform(w, -1, 1), 0.1};
  choose_place(w, at);
  dBodySetPosition(t->body, at[0], at[1], at[2]);
  dBodySetQuaternion(t->body, q);
}

static void edit_velocity(storm_world *w, storm_thing *t)
{
  dBodySetLinearVel(t->body, uniform(w, -1, 1), uniform(w, -1, 1), uniform(w, -1, 1));
  dBodySetAngularVel(t->body, uniform(w, -5, 5), uniform(w, -5, 5), uniform(w, -5, 5));
}

static void edit_shape(storm_world *w, storm_thing *t)
{
  if (t->geom_count > 0) {
    resize_geom(w, t->geoms[below(w, t->geom_count)]);
  }
}

static void edit_offset(storm_world *w, storm_thing *t)
{
  if (t->geom_count > 0) {
    dGeomID geom = t->geoms[below(w, t->geom_count)];
    if (chance(w, 0.5)) {
      dGeomSetOffsetPosition(geom, uniform(w, -0.04, 0.04), uniform(w, -0.04, 0.04), 0.01);
    } else {
      dGeomClearOffset(geom);
    }
  }
}

static void edit_kinematic(storm_world *w, storm_thing *t)
{
  if (dBodyIsKinematic(t->body)) {
    dBodySetDynamic(t->body);
  } else {
    dBodySetKinematic(t->body);
    dBodySetLinearVel(t->body, uniform(w, -0.2, 0.2), uniform(w, -0.2, 0.2), 0.0);
  }
}

static void edit_enabled(storm_world *w, storm_thing *t)
{
  if (chance(w, 0.7)) {
    dBodyEnable(t->body);
  } else {
    dBodyDisable(t->body);
  }
}

static void edit_geoms(storm_world *w, storm_thing *t)
{
  if (t->geom_count > 1 && chance(w, 0.5)) {
    drop_geom(w, t, chance(w, 0.5) || w->telling == STORM_TELLS);
  } else if (t->geom_count == 1 && dBodyGetNumJoints(t->body) == 0) { /* a point mass */
    expect(w, hap_session_adopt_body(w->session, t->body) == HAP_OK);
    t->adopted = true;
    drop_geom(w, t, true);
    expect(w, hap_session_adopt_body(w->session, t->body) == HAP_OK);
  } else {
    add_geom(w, t);
  }
}

static void edit_geom_flags(storm_world *w, storm_thing *t)
{
  if (t->geom_count > 0) {
    dGeomID geom = t->geoms[below(w, t->geom_count)];
    dGeomSetCategoryBits(geom, chance(w, 0.8) ? ~0ul : 2ul);
    if (chance(w, 0.8)) {
      dGeomEnable(geom);
    } else {
      dGeomDisable(geom);
    }
    dSpaceID from = dGeomGetSpace(geom);
    dSpaceRemove(from, geom);
    dSpaceAdd(from == w->space ? w->nested : w->space, geom);
    dGeomSetBody(geom, t->body); /* ODE does not take a geom that is added for one that moved */
  }
}

static void set_joint(storm_world *w, storm_thing *t)
{
  const dReal *at = dBodyGetPosition(t->body);
  const storm_thing *partner = &w->things[below(w, STORM_THINGS)];
  dBodyID other = partner == t || partner->geom_count == 0 ? NULL : partner->body;
  switch (below(w, 4)) {
    case 0:
      t->joint = dJointCreateBall(w->world, NULL);
      dJointAttach(t->joint, t->body, other);
      dJointSetBallAnchor(t->joint, at[0], at[1], at[2]);
      break;
    case 1:
      t->joint = dJointCreateHinge(w->world, NULL);
      dJointAttach(t->joint, t->body, other);
      dJointSetHingeAnchor(t->joint, at[0], at[1], at[2]);
      dJointSetHingeAxis(t->joint, 0.0, 0.0, 1.0);
      dJointSetHingeParam(t->joint, dParamVel, uniform(w, -2, 2));
      dJointSetHingeParam(t->joint, dParamFMax, 0.1);
      break;
    case 2:
      t->joint = dJointCreateSlider(w->world, NULL);
      dJointAttach(t->joint, t->body, other);
      dJointSetSliderAxis(t->joint, 1.0, 0.0, 0.0);
      break;
    default:
      t->joint = dJointCreateFixed(w->world, NULL);
      dJointAttach(t->joint, t->body, other);
      dJointSetFixed(t->joint);
      break;
  }
}

static void edit_joint(storm_world *w, storm_thing *t)
{
  if (t->joint != NULL) {
    dJointDestroy(t->joint);
    t->joint = NULL;
  } else if (t->geom_count > 0) {
    set_joint(w, t);
  }
}

static void edit_settings(storm_world *w, storm_thing *t)
{
  dBodySetAutoDisableFlag(t->body, chance(w, 0.5));
  dBodySetAutoDisableTime(t->body, uniform(w, 0.0, 0.5));
  dBodySetAutoDisableSteps(t->body, below(w, 20));
  dBodySetLinearDamping(t->body, uniform(w, 0.0, 0.1));
  dBodySetGyroscopicMode(t->body, chance(w, 0.5));
  dBodySetGravityMode(t->body, chance(w, 0.8));
  dBodySetFiniteRotationMode(t->body, chance(w, 0.1));
  dBodyAddForce(t->body, uniform(w, -5, 5), uniform(w, -5, 5), uniform(w, -5, 5));
}

static void edit_world(storm_world *w, storm_thing *t)
{
  int i = below(w, STORM_WALLS);
  double at[3];
  (void)t;
  dWorldSetGravity(w->world, uniform(w, -2, 2), uniform(w, -2, 2), uniform(w, -9.81, 0.0));
  dWorldSetERP(w->world, uniform(w, 0.1, 0.4));
  dWorldSetQuickStepNumIterations(w->world, 10 + below(w, 20));
  dWorldSetContactSurfaceLayer(w->world, uniform(w, 0.0, 1e-3));
  choose_place(w, at);
  if (chance(w, 0.5)) {
    if (w->telling == STORM_TELLS) {
      expect(w, hap_session_forget_geom(w->session, w->walls[i]) == HAP_OK);
    }
    dGeomDestroy(w->walls[i]);
    w->walls[i] = dCreateBox(w->space, uniform(w, 0.05, 0.3), 0.05, 0.05);
  }
  dGeomSetPosition(w->walls[i], at[0], at[1], at[2]);
}

typedef void (*edit_fn)(storm_world *w, storm_thing *t);

static const edit_fn edits[] = {
    edit_replace,    edit_replace, edit_replace, edit_pose,     edit_velocity,  set_mass,
    edit_shape,      edit_shape,   edit_offset,  edit_enabled,  edit_kinematic, edit_geoms,
    edit_geom_flags, edit_joint,   edit_joint,   edit_settings, destroy_body,   edit_world,
};

/* Joints between bodies that were put elsewhere throw them about. */
static void calm(storm_world *w)
{
  for (int i = 0; i < STORM_THINGS; ++i) {
    storm_thing *t = &w->things[i];
    if (t->body != NULL && !(hapi_v3_norm(dBodyGetPosition(t->body)) < FAR &&
                             hapi_v3_norm(dBodyGetLinearVel(t->body)) < FAST &&
                             hapi_v3_norm(dBodyGetAngularVel(t->body)) < SPIN)) {
      edit_pose(w, t);
      dBodySetLinearVel(t->body, 0.0, 0.0, 0.0);
      dBodySetAngularVel(t->body, 0.0, 0.0, 0.0);
    }
  }
}

void storm_world_edit(storm_world *w, int count)
{
  for (int i = 0; i < count; ++i) {
    storm_thing *t = &w->things[below(w, STORM_THINGS)];
    if (t->body == NULL) {
      create_body(w, t);
    } else {
      edits[below(w, sizeof edits / sizeof edits[0])](w, t);
    }
    ++w->edits;
  }
  calm(w);
  for (int i = 0; i < STORM_THINGS; ++i) {
    atomic_store_explicit(&w->shown[i], w->things[i].body, memory_order_relaxed);
  }
}

void storm_world_open(storm_world *w, uint64_t seed)
{
  memset(w, 0, sizeof *w);
  w->seed = seed;
  w->world = dWorldCreate();
  w->space = dHashSpaceCreate(NULL);
  w->nested = dSimpleSpaceCreate(w->space);
  (void)dCreatePlane(w->space, 0.0, 0.0, 1.0, -0.15);
  for (int i = 0; i < STORM_WALLS; ++i) {
    w->walls[i] = dCreateBox(w->space, 0.1, 0.05, 0.05);
    dGeomSetPosition(w->walls[i], 0.1 * i - 0.15, 0.3, 0.0);
  }
  dWorldSetCFM(w->world, 1e-6);
  dWorldSetMaxAngularSpeed(w->world, 50.0); /* else ODE's gyroscopic term runs away at 60 Hz */
  dWorldSetContactMaxCorrectingVel(w->world, 1.0);
  for (int i = 0; i < STORM_THINGS / 2; ++i) {
    create_body(w, &w->things[i]);
  }
}

void storm_world_close(storm_world *w)
{
  dSpaceDestroy(w->space);
  dWorldDestroy(w->world);
}
