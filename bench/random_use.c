/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "bench/random_use.h"

#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include <hapode/expert.h>
#include <hapode/hapode.h>
#include <hapode/ode.h>
#include <hapode/research.h>

#include "bench/dice.h"
#include "bench/random_hands.h"

#define BODIES 20
#define GEOMS 3 /* of a body */
#define JOINTS 14
#define STATICS 8
#define NESTED 3 /* spaces in the space */
#define POINTERS 5
#define SHAPES 4 /* of convex geoms and meshes, which ODE borrows */

#define FAR 0.7   /* m: what is farther away is put back */
#define FAST 3.0  /* m/s */
#define SPIN 40.0 /* rad/s */

typedef struct use_body {
  dBodyID body; /* NULL: none */
  dGeomID geoms[GEOMS];
  int geom_count;
} use_body;

typedef struct use_pointer {
  hap_pointer_id id; /* 0: none */
  hap_device *device;
  double center[3]; /* m, of the circle of one without device */
} use_pointer;

typedef struct use {
  const random_use_def *def;
  random_use_result *out;
  uint64_t dice;
  dWorldID world;
  dSpaceID space;
  dSpaceID nested[NESTED];
  use_body bodies[BODIES];
  dJointID joints[JOINTS];
  dGeomID statics[STATICS];
  use_pointer pointers[POINTERS];
  dTriMeshDataID meshes[SHAPES];
  dHeightfieldDataID field;
  hap_session *session;
  bool started;
  int posted; /* edits that have not run */
  random_hands hands;
  uint64_t tick;
} use;

/* ---- what came of it ---- */

static void hash_word(use *u, uint64_t word)
{
  uint64_t hash = (u->out->world_hash ^ word) * 0x9e3779b97f4a7c15u;
  u->out->world_hash = hash ^ (hash >> 29);
}

static void hash_doubles(use *u, const double *values, int count)
{
  for (int i = 0; i < count; ++i) {
    uint64_t bits;
    memcpy(&bits, &values[i], sizeof bits);
    hash_word(u, bits);
  }
}

static void use_say(const use *u, const char *format, ...) HAP_PRINTF(2, 3);

static void use_say(const use *u, const char *format, ...)
{
  va_list arguments;
  if (!u->def->chatty) {
    return;
  }
  va_start(arguments, format);
  fprintf(stderr, "%6llu  ", (unsigned long long)u->tick);
  vfprintf(stderr, format, arguments);
  fputc('\n', stderr);
  va_end(arguments);
}

static void status_expect(use *u, hap_status status, const char *call)
{
  if (status < HAP_OK) {
    hap_detail detail = {""};
    (void)hap_session_detail(u->session, &detail);
    use_say(u, "%s: %s: %s", call, hap_status_name(status), detail.text);
    ++u->out->unexpected;
  }
}

#define EXPECT(u, call) status_expect(u, call, #call)

/* ---- shapes that ODE borrows ---- */

static const double cube_planes[] = {1, 0,  0, 0.5, -1, 0, 0, 0.5, 0, 1, 0,  0.5,
                                     0, -1, 0, 0.5, 0,  0, 1, 0.5, 0, 0, -1, 0.5};
static const unsigned cube_polygons[] = {4, 1, 3, 7, 5, 4, 0, 4, 6, 2, 4, 2, 6, 7, 3,
                                         4, 0, 1, 5, 4, 4, 4, 5, 7, 6, 4, 0, 2, 3, 1};
static double cube_corners[SHAPES][24];
static double plane_tables[SHAPES][24];

/* A cube of twelve triangles, and a ground of two. */
static double mesh_corners[SHAPES][8 * 3];
static const dTriIndex cube_triangles[] = {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                                           2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5};

static void shapes_make(use *u)
{
  for (int s = 0; s < SHAPES; ++s) {
    double edges[3] = {0.04 + 0.01 * s, 0.05, 0.06 - 0.008 * s};
    for (int i = 0; i < 8; ++i) {
      for (int k = 0; k < 3; ++k) {
        double at = (i >> k & 1) != 0 ? 0.5 * edges[k] : -0.5 * edges[k];
        cube_corners[s][3 * i + k] = at;
        mesh_corners[s][3 * i + k] = 1.1 * at;
      }
    }
    memcpy(plane_tables[s], cube_planes, sizeof cube_planes);
    for (int i = 0; i < 6; ++i) {
      plane_tables[s][4 * i + 3] = 0.5 * edges[i / 2];
    }
    u->meshes[s] = dGeomTriMeshDataCreate();
    dGeomTriMeshDataBuildDouble(u->meshes[s], mesh_corners[s], 3 * sizeof(double), 8,
                                cube_triangles, 36, 3 * sizeof(dTriIndex));
    dGeomTriMeshDataPreprocess2(u->meshes[s], 1u << dTRIDATAPREPROCESS_BUILD_FACE_ANGLES, NULL);
  }
}

static dReal field_height(void *user, int x, int z)
{
  (void)user;
  return 0.01 * ((x * 7 + z * 3) % 5);
}

/* ---- geoms ---- */

typedef enum geom_kind {
  GEOM_SPHERE = 0,
  GEOM_BOX,
  GEOM_CAPSULE,
  GEOM_CYLINDER,
  GEOM_CONVEX,
  GEOM_MESH,
  GEOM_RAY,
  GEOM_BODY_KINDS, /* the ones above may have a body */
  GEOM_PLANE = GEOM_BODY_KINDS,
  GEOM_FIELD,
  GEOM_KINDS
} geom_kind;

static dGeomID geom_make(use *u, dSpaceID space, geom_kind kind)
{
  double s[3];
  dice_fill(&u->dice, 0.02, 0.06, 3, s);
  int shape = (int)dice_below(&u->dice, SHAPES);
  switch (kind) {
    case GEOM_SPHERE:
      return dCreateSphere(space, s[0]);
    case GEOM_BOX:
      return dCreateBox(space, 2 * s[0], 2 * s[1], 2 * s[2]);
    case GEOM_CAPSULE:
      return dCreateCapsule(space, 0.7 * s[0], 2 * s[1]);
    case GEOM_CYLINDER:
      return dCreateCylinder(space, s[0], 2 * s[1]);
    case GEOM_CONVEX:
      return dCreateConvex(space, plane_tables[shape], 6, cube_corners[shape], 8, cube_polygons);
    case GEOM_MESH:
      return dCreateTriMesh(space, u->meshes[shape], NULL, NULL, NULL);
    case GEOM_RAY:
      return dCreateRay(space, s[0]);
    case GEOM_PLANE:
      return dCreatePlane(space, 0.0, 0.0, 1.0, -0.1 - s[0]);
    case GEOM_FIELD:
      return dCreateHeightfield(space, u->field, 1);
    case GEOM_KINDS:
      break;
  }
  return NULL;
}

static geom_kind geom_kind_any(use *u)
{
  static const geom_kind kinds[] = {GEOM_SPHERE,   GEOM_BOX,    GEOM_BOX,  GEOM_CAPSULE,
                                    GEOM_CYLINDER, GEOM_CONVEX, GEOM_MESH, GEOM_RAY};
  return kinds[(int)dice_below(&u->dice, (uint32_t)(sizeof kinds / sizeof kinds[0]))];
}

static dSpaceID space_any(use *u)
{
  dSpaceID nested = u->nested[(int)dice_below(&u->dice, NESTED)];
  return nested != NULL && dice_chance(&u->dice, 0.4) ? nested : u->space;
}

static void geom_offset(use *u, dGeomID geom)
{
  double at[3];
  dQuaternion q = {1.0, 0.0, 0.0, 0.0};
  dice_fill(&u->dice, -0.05, 0.05, 3, at);
  dGeomSetOffsetPosition(geom, at[0], at[1], at[2]);
  if (dice_chance(&u->dice, 0.5)) {
    dice_fill(&u->dice, -1.0, 1.0, 3, q + 1);
    dNormalize4(q);
    dGeomSetOffsetQuaternion(geom, q);
  }
}

/* ODE does not take a geom that is added for one that moved. */
static void geom_stir(dGeomID geom)
{
  if (dGeomGetBody(geom) != NULL) {
    dGeomSetBody(geom, dGeomGetBody(geom));
  } else {
    const dReal *at = dGeomGetPosition(geom);
    dGeomSetPosition(geom, at[0], at[1], at[2]);
  }
}

static void geom_resize(use *u, dGeomID geom)
{
  double s[3];
  dice_fill(&u->dice, 0.02, 0.06, 3, s);
  int shape = (int)dice_below(&u->dice, SHAPES);
  dSpaceID space = dGeomGetSpace(geom);
  switch (dGeomGetClass(geom)) {
    case dSphereClass:
      dGeomSphereSetRadius(geom, s[0]);
      break;
    case dBoxClass:
      dGeomBoxSetLengths(geom, 2 * s[0], 2 * s[1], 2 * s[2]);
      break;
    case dCapsuleClass:
      dGeomCapsuleSetParams(geom, 0.7 * s[0], 2 * s[1]);
      break;
    case dCylinderClass:
      dGeomCylinderSetParams(geom, s[0], 2 * s[1]);
      break;
    case dConvexClass:
      dGeomSetConvex(geom, plane_tables[shape], 6, cube_corners[shape], 8, cube_polygons);
      EXPECT(u, hap_session_forget_geom(u->session, geom));
      break;
    case dTriMeshClass: /* out of its space: ODE's lists do not take it for one that has changed */
      dSpaceRemove(space, geom);
      dGeomTriMeshSetData(geom, u->meshes[shape]);
      dSpaceAdd(space, geom);
      geom_stir(geom);
      EXPECT(u, hap_session_forget_geom(u->session, geom));
      break;
    default:
      break;
  }
}

static void geom_destroy(use *u, dGeomID geom)
{
  EXPECT(u, hap_session_forget_geom(u->session, geom));
  dGeomDestroy(geom);
}

/* ---- bodies ---- */

static void body_place(use *u, dBodyID body)
{
  double at[3];
  const use_pointer *near = &u->pointers[(int)dice_below(&u->dice, POINTERS)];
  dice_fill(&u->dice, -0.06, 0.06, 3, at);
  if (dice_chance(&u->dice, 0.2)) {
    dice_fill(&u->dice, -0.3, 0.3, 3, at);
  }
  for (int k = 0; k < 3; ++k) {
    at[k] += near->center[k];
  }
  dBodySetPosition(body, at[0], at[1], at[2]);
}

static void body_turn(use *u, dBodyID body)
{
  dQuaternion q = {1.0, 0.0, 0.0, 0.0};
  dice_fill(&u->dice, -1.0, 1.0, 4, q);
  q[0] += 2.5;
  dNormalize4(q);
  dBodySetQuaternion(body, q);
}

static void body_set_mass(use *u, dBodyID body)
{
  dMass mass;
  double s[4];
  dice_fill(&u->dice, 0.03, 0.1, 4, s);
  dMassSetBoxTotal(&mass, 20.0 * s[3] * s[3] * 2.0, s[0], s[1], s[2]);
  dBodySetMass(body, &mass);
}

static void body_add_geom(use *u, use_body *b, geom_kind kind)
{
  if (b->geom_count == GEOMS) {
    return;
  }
  dGeomID geom = geom_make(u, space_any(u), kind);
  dGeomSetBody(geom, b->body);
  if (b->geom_count > 0 || dice_chance(&u->dice, 0.1)) {
    geom_offset(u, geom);
  }
  b->geoms[b->geom_count++] = geom;
}

/* Out of the list; the geom stays. */
static dGeomID body_take_geom(use *u, use_body *b)
{
  int i = (int)dice_below(&u->dice, b->geom_count);
  dGeomID geom = b->geoms[i];
  b->geoms[i] = b->geoms[--b->geom_count];
  return geom;
}

/* One that no geom, nor joints from one with a geom, lead to has to be adopted. */
static void body_settle(use *u, dBodyID body)
{
  if (body != NULL && dBodyGetFirstGeom(body) == NULL) {
    EXPECT(u, hap_session_adopt_body(u->session, body));
  }
}

static void bodies_settle(use *u)
{
  for (int i = 0; i < BODIES; ++i) {
    body_settle(u, u->bodies[i].body);
  }
}

static void body_create(use *u, use_body *b)
{
  memset(b, 0, sizeof *b);
  b->body = dBodyCreate(u->world);
  body_place(u, b->body);
  body_set_mass(u, b->body);
  if (dice_chance(&u->dice, 0.3)) {
    body_turn(u, b->body);
  }
  if (dice_chance(&u->dice, 0.95)) {
    body_add_geom(u, b, geom_kind_any(u));
  }
  body_settle(u, b->body);
}

static void body_destroy(use *u, use_body *b)
{
  hap_status status = hap_session_forget_body(u->session, b->body);
  if (status != HAP_ERROR_NOT_FOUND) {
    status_expect(u, status, "hap_session_forget_body");
  }
  bool geoms_first = dice_chance(&u->dice, 0.5);
  while (geoms_first && b->geom_count > 0) {
    geom_destroy(u, body_take_geom(u, b));
  }
  for (int i = 0; i < JOINTS; ++i) { /* else they are left without bodies */
    dJointID joint = u->joints[i];
    if (joint != NULL &&
        (dJointGetBody(joint, 0) == b->body || dJointGetBody(joint, 1) == b->body) &&
        dice_chance(&u->dice, 0.6)) {
      dJointDestroy(joint);
      u->joints[i] = NULL;
    }
  }
  dBodyDestroy(b->body);
  while (b->geom_count > 0) {
    geom_destroy(u, body_take_geom(u, b));
  }
  memset(b, 0, sizeof *b);
}

/* ---- joints ---- */

typedef dJointID (*joint_make_fn)(dWorldID, dJointGroupID);
typedef void (*joint_set_fn)(dJointID, int, dReal);

typedef struct joint_kind {
  const char *name;
  joint_make_fn make;
  joint_set_fn set; /* NULL: it has no parameters */
  int groups;       /* of them */
  bool two;         /* it needs two bodies */
} joint_kind;

static const joint_kind joint_kinds[] = {
    {"ball", dJointCreateBall, dJointSetBallParam, 0, false},
    {"hinge", dJointCreateHinge, dJointSetHingeParam, 1, false},
    {"slider", dJointCreateSlider, dJointSetSliderParam, 1, false},
    {"universal", dJointCreateUniversal, dJointSetUniversalParam, 2, false},
    {"hinge2", dJointCreateHinge2, dJointSetHinge2Param, 2, true},
    {"fixed", dJointCreateFixed, dJointSetFixedParam, 0, false},
    {"amotor", dJointCreateAMotor, dJointSetAMotorParam, 3, true},
    {"lmotor", dJointCreateLMotor, dJointSetLMotorParam, 3, false},
    {"pr", dJointCreatePR, dJointSetPRParam, 2, false},
    {"pu", dJointCreatePU, dJointSetPUParam, 3, false},
    {"piston", dJointCreatePiston, dJointSetPistonParam, 2, false},
    {"plane2d", dJointCreatePlane2D, NULL, 0, false},
    {"dball", dJointCreateDBall, dJointSetDBallParam, 0, false},
    {"dhinge", dJointCreateDHinge, dJointSetDHingeParam, 0, false},
    {"null", dJointCreateNull, NULL, 0, false},
};

#define JOINT_KINDS ((int)(sizeof joint_kinds / sizeof joint_kinds[0]))

static const joint_kind *joint_kind_of(dJointID joint)
{
  static const struct {
    dJointType type;
    int kind;
  } table[] = {{dJointTypeBall, 0},      {dJointTypeHinge, 1},   {dJointTypeSlider, 2},
               {dJointTypeUniversal, 3}, {dJointTypeHinge2, 4},  {dJointTypeFixed, 5},
               {dJointTypeAMotor, 6},    {dJointTypeLMotor, 7},  {dJointTypePR, 8},
               {dJointTypePU, 9},        {dJointTypePiston, 10}, {dJointTypePlane2D, 11},
               {dJointTypeDBall, 12},    {dJointTypeDHinge, 13}};
  for (size_t i = 0; i < sizeof table / sizeof table[0]; ++i) {
    if (table[i].type == dJointGetType(joint)) {
      return &joint_kinds[table[i].kind];
    }
  }
  return &joint_kinds[JOINT_KINDS - 1];
}

/* Anchors, axes and angles, about a point near the bodies. */
static void joint_place(use *u, dJointID joint)
{
  dBodyID a = dJointGetBody(joint, 0);
  dBodyID b = dJointGetBody(joint, 1);
  dBodyID body = a != NULL ? a : b;
  double p[3];
  dVector3 d = {0.0};
  dVector3 e;
  dice_fill(&u->dice, -0.04, 0.04, 3, p);
  dice_fill(&u->dice, -0.3, 0.3, 3, d);
  if (body == NULL) {
    return;
  }
  int main_axis = (int)dice_below(&u->dice, 3);
  d[main_axis] += 1.0;
  for (int k = 0; k < 3; ++k) {
    p[k] += dBodyGetPosition(body)[k];
  }
  dSafeNormalize3(d);
  double other[3] = {0.0, 0.0, 0.0};
  other[(main_axis + 1) % 3] = 1.0;
  e[0] = d[1] * other[2] - d[2] * other[1];
  e[1] = d[2] * other[0] - d[0] * other[2];
  e[2] = d[0] * other[1] - d[1] * other[0];
  dSafeNormalize3(e);
  switch (dJointGetType(joint)) {
    case dJointTypeBall:
      dJointSetBallAnchor(joint, p[0], p[1], p[2]);
      break;
    case dJointTypeHinge:
      dJointSetHingeAnchor(joint, p[0], p[1], p[2]);
      dJointSetHingeAxis(joint, d[0], d[1], d[2]);
      break;
    case dJointTypeSlider:
      dJointSetSliderAxis(joint, d[0], d[1], d[2]);
      break;
    case dJointTypeUniversal:
      dJointSetUniversalAnchor(joint, p[0], p[1], p[2]);
      dJointSetUniversalAxis1(joint, d[0], d[1], d[2]);
      dJointSetUniversalAxis2(joint, e[0], e[1], e[2]);
      break;
    case dJointTypeHinge2: {
      const dReal axis1[3] = {d[0], d[1], d[2]};
      const dReal axis2[3] = {e[0], e[1], e[2]};
      dJointSetHinge2Anchor(joint, p[0], p[1], p[2]);
      dJointSetHinge2Axes(joint, axis1, axis2);
      break;
    }
    case dJointTypeFixed:
      dJointSetFixed(joint);
      break;
    case dJointTypeAMotor:
      dJointSetAMotorNumAxes(joint, 1);
      dJointSetAMotorAxis(joint, 0, 1, d[0], d[1], d[2]);
      break;
    case dJointTypeLMotor:
      dJointSetLMotorNumAxes(joint, 1);
      dJointSetLMotorAxis(joint, 0, 0, d[0], d[1], d[2]);
      break;
    case dJointTypePR:
      dJointSetPRAnchor(joint, p[0], p[1], p[2]);
      dJointSetPRAxis1(joint, d[0], d[1], d[2]);
      dJointSetPRAxis2(joint, e[0], e[1], e[2]);
      break;
    case dJointTypePU:
      dJointSetPUAnchor(joint, p[0], p[1], p[2]);
      dJointSetPUAxis1(joint, d[0], d[1], d[2]);
      dJointSetPUAxis2(joint, e[0], e[1], e[2]);
      dJointSetPUAxis3(joint, d[1] * e[2] - d[2] * e[1], d[2] * e[0] - d[0] * e[2],
                       d[0] * e[1] - d[1] * e[0]);
      break;
    case dJointTypePiston:
      dJointSetPistonAnchor(joint, p[0], p[1], p[2]);
      dJointSetPistonAxis(joint, d[0], d[1], d[2]);
      break;
    case dJointTypeDBall:
      dJointSetDBallAnchor1(joint, p[0], p[1], p[2]);
      dJointSetDBallAnchor2(joint, p[0] + 0.03, p[1], p[2]);
      break;
    case dJointTypeDHinge:
      dJointSetDHingeAxis(joint, d[0], d[1], d[2]);
      dJointSetDHingeAnchor1(joint, p[0], p[1], p[2]);
      dJointSetDHingeAnchor2(joint, p[0] + 0.03, p[1], p[2]);
      break;
    default:
      break;
  }
}

static void joint_set_parameters(use *u, dJointID joint)
{
  const joint_kind *kind = joint_kind_of(joint);
  double v[4];
  dice_fill(&u->dice, 0.0, 1.0, 4, v);
  int group = kind->groups > 0 ? (int)dice_below(&u->dice, kind->groups) * dParamGroup : 0;
  if (kind->set == NULL) {
    return;
  }
  if (kind->groups == 0) {
    kind->set(joint, dParamERP, 0.1 + 0.3 * v[0]);
    kind->set(joint, dParamCFM, 1e-5 * v[1]);
    return;
  }
  switch ((int)dice_below(&u->dice, 4)) {
    case 0:
      kind->set(joint, dParamLoStop + group, -0.6 * v[0]);
      kind->set(joint, dParamHiStop + group, 0.6 * v[1]);
      break;
    case 1:
      kind->set(joint, dParamVel + group, 2.0 * v[0] - 1.0);
      kind->set(joint, dParamFMax + group, 0.2 * v[1]);
      break;
    case 2:
      kind->set(joint, dParamBounce + group, 0.5 * v[0]);
      kind->set(joint, dParamStopERP + group, 0.1 + 0.3 * v[1]);
      kind->set(joint, dParamStopCFM + group, 1e-4 * v[2]);
      break;
    default: {
      /* ODE 0.16 steps a row too many of a hinge whose stops are taken away while it is at one. */
      double none = dJointGetType(joint) == dJointTypeHinge ? M_PI : dInfinity;
      kind->set(joint, dParamLoStop + group, -none);
      kind->set(joint, dParamHiStop + group, none);
      kind->set(joint, dParamFMax + group, 0.0);
      break;
    }
  }
}

static dBodyID body_any(use *u)
{
  return u->bodies[(int)dice_below(&u->dice, BODIES)].body;
}

/* False: there are no such bodies now. */
static bool joint_attach(use *u, dJointID joint, const joint_kind *kind)
{
  dBodyID a = body_any(u);
  dBodyID b = body_any(u);
  bool plane = dJointGetType(joint) == dJointTypePlane2D;
  if (a == NULL || a == b || (kind->two && b == NULL)) {
    return false;
  }
  if (plane || (!kind->two && dice_chance(&u->dice, 0.2))) {
    b = NULL;
  } else if (!kind->two && b != NULL && dice_chance(&u->dice, 0.1)) {
    a = NULL;
  }
  dJointAttach(joint, a, b);
  return true;
}

static void joint_create(use *u, int index, int kind)
{
  dJointID joint = joint_kinds[kind].make(u->world, NULL);
  u->joints[index] = joint;
  if (joint_attach(u, joint, &joint_kinds[kind])) {
    joint_place(u, joint);
    joint_set_parameters(u, joint);
  }
}

static void joint_destroy(use *u, int index)
{
  dJointDestroy(u->joints[index]);
  u->joints[index] = NULL;
}

static int joint_kind_any(use *u)
{
  return (int)dice_below(&u->dice, dice_chance(&u->dice, 0.7) ? 6 : JOINT_KINDS);
}

/* A joint made as another one is: the same kind, bodies and parameters that can be read. */
static void joint_create_like(use *u, int index, dBodyID a, dBodyID b, const joint_kind *kind)
{
  u->joints[index] = kind->make(u->world, NULL);
  if (a != NULL || b != NULL) {
    dJointAttach(u->joints[index], a, b);
    joint_place(u, u->joints[index]);
  }
}

/* ---- edits ---- */

typedef struct edit {
  const char *name;
  void (*run)(use *u, int at);
} edit;

static void edit_body_life(use *u, int at)
{
  use_body *b = &u->bodies[at % BODIES];
  if (b->body == NULL) {
    body_create(u, b);
  } else {
    body_destroy(u, b);
  }
}

static void edit_body_replace(use *u, int at)
{
  use_body *b = &u->bodies[at % BODIES];
  if (b->body != NULL) {
    body_destroy(u, b);
  }
  body_create(u, b);
}

/* Two go, two come: in the order of before, or not. */
static void edit_body_two(use *u, int at)
{
  use_body *a = &u->bodies[at % BODIES];
  use_body *b = &u->bodies[(at + 1 + (int)dice_below(&u->dice, BODIES - 1)) % BODIES];
  if (a->body != NULL) {
    body_destroy(u, a);
  }
  if (b->body != NULL) {
    body_destroy(u, b);
  }
  body_create(u, dice_chance(&u->dice, 0.5) ? a : b);
  body_create(u, a->body != NULL ? b : a);
}

static void edit_body_pose(use *u, int at)
{
  use_body *b = &u->bodies[at % BODIES];
  if (b->body != NULL) {
    body_place(u, b->body);
    body_turn(u, b->body);
  }
}

static void edit_body_velocity(use *u, int at)
{
  dBodyID body = u->bodies[at % BODIES].body;
  double v[6];
  dice_fill(&u->dice, -0.5, 0.5, 6, v);
  if (body != NULL) {
    dBodySetLinearVel(body, v[0], v[1], v[2]);
    dBodySetAngularVel(body, 4 * v[3], 4 * v[4], 4 * v[5]);
  }
}

static void edit_body_force(use *u, int at)
{
  dBodyID body = u->bodies[at % BODIES].body;
  double v[6];
  dice_fill(&u->dice, -1.0, 1.0, 6, v);
  if (body != NULL) {
    dBodyAddForce(body, v[0], v[1], v[2]);
    dBodyAddTorque(body, 0.01 * v[3], 0.01 * v[4], 0.01 * v[5]);
  }
}

static void edit_body_mass(use *u, int at)
{
  dBodyID body = u->bodies[at % BODIES].body;
  if (body != NULL && !dBodyIsKinematic(body)) {
    body_set_mass(u, body);
  }
}

static void edit_body_kinematic(use *u, int at)
{
  dBodyID body = u->bodies[at % BODIES].body;
  if (body == NULL) {
    return;
  }
  if (dBodyIsKinematic(body)) {
    dBodySetDynamic(body);
  } else {
    dBodySetKinematic(body);
  }
}

static void edit_body_enabled(use *u, int at)
{
  dBodyID body = u->bodies[at % BODIES].body;
  if (body == NULL) {
    return;
  }
  if (dice_chance(&u->dice, 0.6)) {
    dBodyEnable(body);
  } else {
    dBodyDisable(body);
  }
}

static void edit_body_settings(use *u, int at)
{
  dBodyID body = u->bodies[at % BODIES].body;
  double v[4];
  dice_fill(&u->dice, 0.0, 1.0, 4, v);
  if (body == NULL) {
    return;
  }
  switch ((int)dice_below(&u->dice, 6)) {
    case 0:
      dBodySetAutoDisableFlag(body, dice_chance(&u->dice, 0.6));
      break;
    case 1:
      dBodySetAutoDisableTime(body, 0.3 * v[0]);
      dBodySetAutoDisableSteps(body, (int)(10 * v[1]));
      dBodySetAutoDisableAverageSamplesCount(body, 1 + (unsigned)(4 * v[2]));
      dBodySetAutoDisableLinearThreshold(body, 0.05 * v[3]);
      break;
    case 2:
      dBodySetAutoDisableAngularThreshold(body, 0.2 * v[0]);
      dBodySetDamping(body, 0.05 * v[1], 0.05 * v[2]);
      break;
    case 3:
      dBodySetFiniteRotationMode(body, dice_chance(&u->dice, 0.5));
      dBodySetFiniteRotationAxis(body, v[0], v[1], v[2]);
      break;
    case 4:
      dBodySetGravityMode(body, dice_chance(&u->dice, 0.7));
      dBodySetGyroscopicMode(body, dice_chance(&u->dice, 0.5));
      break;
    default:
      dBodySetAutoDisableDefaults(body);
      break;
  }
}

static void body_has_moved(dBodyID body)
{
  (void)body;
}

static void edit_body_known(use *u, int at)
{
  dBodyID body = u->bodies[at % BODIES].body;
  if (body == NULL) {
    return;
  }
  switch ((int)dice_below(&u->dice, 3)) {
    case 0:
      EXPECT(u, hap_session_adopt_body(u->session, body));
      break;
    case 1:
      (void)hap_session_forget_body(u->session, body); /* it comes in again */
      break;
    default:
      EXPECT(u, hap_session_adopt_body(u->session, body));
      EXPECT(u, hap_session_set_moved_callback(u->session, body,
                                               dice_chance(&u->dice, 0.5) ? body_has_moved : NULL));
      break;
  }
}

static void edit_geom_life(use *u, int at)
{
  use_body *b = &u->bodies[at % BODIES];
  if (b->body == NULL) {
    return;
  }
  if (b->geom_count == 0 || dice_chance(&u->dice, 0.5)) {
    body_add_geom(u, b, geom_kind_any(u));
  } else {
    geom_destroy(u, body_take_geom(u, b));
  }
}

static void edit_geom_replace(use *u, int at)
{
  use_body *b = &u->bodies[at % BODIES];
  if (b->body == NULL || b->geom_count == 0) {
    return;
  }
  dGeomID geom = body_take_geom(u, b);
  int kind = dGeomGetClass(geom);
  static const geom_kind kinds[] = {[dSphereClass] = GEOM_SPHERE,
                                    [dBoxClass] = GEOM_BOX,
                                    [dCapsuleClass] = GEOM_CAPSULE,
                                    [dCylinderClass] = GEOM_CYLINDER};
  geom_destroy(u, geom);
  body_add_geom(
      u, b, kind <= dCylinderClass && dice_chance(&u->dice, 0.7) ? kinds[kind] : geom_kind_any(u));
}

/* Geoms of two bodies go and come in another order. */
static void edit_geom_two(use *u, int at)
{
  use_body *a = &u->bodies[at % BODIES];
  use_body *b = &u->bodies[(at + 1 + (int)dice_below(&u->dice, BODIES - 1)) % BODIES];
  if (a->geom_count == 0 || b->geom_count == 0) {
    return;
  }
  geom_destroy(u, body_take_geom(u, a));
  geom_destroy(u, body_take_geom(u, b));
  geom_kind kind = geom_kind_any(u);
  body_add_geom(u, a, kind);
  body_add_geom(u, b, dice_chance(&u->dice, 0.7) ? kind : geom_kind_any(u));
}

/* By one of the same sizes, to the last bit. */
static void edit_geom_like(use *u, int at)
{
  use_body *b = &u->bodies[at % BODIES];
  if (b->geom_count == 0 || dGeomGetClass(b->geoms[0]) != dBoxClass) {
    return;
  }
  dVector3 sizes;
  dSpaceID space = dGeomGetSpace(b->geoms[0]);
  bool offset = dGeomIsOffset(b->geoms[0]);
  dVector3 place;
  dQuaternion turn;
  dCopyVector3(place, dGeomGetOffsetPosition(b->geoms[0]));
  dGeomGetOffsetQuaternion(b->geoms[0], turn);
  dGeomBoxGetLengths(b->geoms[0], sizes);
  geom_destroy(u, b->geoms[0]);
  b->geoms[0] = dCreateBox(space, sizes[0], sizes[1], sizes[2]);
  dGeomSetBody(b->geoms[0], b->body);
  if (offset) {
    dGeomSetOffsetPosition(b->geoms[0], place[0], place[1], place[2]);
    dGeomSetOffsetQuaternion(b->geoms[0], turn);
  }
}

static void edit_geom_shape(use *u, int at)
{
  use_body *b = &u->bodies[at % BODIES];
  if (b->geom_count > 0) {
    geom_resize(u, b->geoms[(int)dice_below(&u->dice, b->geom_count)]);
  }
}

static void edit_geom_offset(use *u, int at)
{
  use_body *b = &u->bodies[at % BODIES];
  if (b->geom_count == 0) {
    return;
  }
  dGeomID geom = b->geoms[(int)dice_below(&u->dice, b->geom_count)];
  if (dice_chance(&u->dice, 0.6)) {
    geom_offset(u, geom);
  } else {
    dGeomClearOffset(geom);
  }
}

static void edit_geom_flags(use *u, int at)
{
  use_body *b = &u->bodies[at % BODIES];
  if (b->geom_count == 0) {
    return;
  }
  dGeomID geom = b->geoms[(int)dice_below(&u->dice, b->geom_count)];
  dGeomSetCategoryBits(geom, dice_chance(&u->dice, 0.8) ? ~0ul : 2ul);
  dGeomSetCollideBits(geom, dice_chance(&u->dice, 0.8) ? ~0ul : 2ul);
  if (dice_chance(&u->dice, 0.8)) {
    dGeomEnable(geom);
  } else {
    dGeomDisable(geom);
  }
}

static void edit_geom_space(use *u, int at)
{
  use_body *b = &u->bodies[at % BODIES];
  if (b->geom_count == 0) {
    return;
  }
  dGeomID geom = b->geoms[(int)dice_below(&u->dice, b->geom_count)];
  dSpaceRemove(dGeomGetSpace(geom), geom);
  dSpaceAdd(space_any(u), geom);
  geom_stir(geom);
}

static void edit_geom_give(use *u, int at)
{
  use_body *from = &u->bodies[at % BODIES];
  use_body *to = &u->bodies[(at + 1 + (int)dice_below(&u->dice, BODIES - 1)) % BODIES];
  if (from->geom_count == 0 || to->body == NULL || to->geom_count == GEOMS) {
    return;
  }
  dGeomID geom = body_take_geom(u, from);
  if (dGeomIsOffset(geom)) {
    dGeomClearOffset(geom);
  }
  dGeomSetBody(geom, to->body);
  to->geoms[to->geom_count++] = geom;
}

static void static_place(use *u, dGeomID geom)
{
  double at[3];
  const use_pointer *near = &u->pointers[(int)dice_below(&u->dice, POINTERS)];
  dQuaternion q = {1.0, 0.0, 0.0, 0.0};
  dice_fill(&u->dice, -0.08, 0.08, 3, at);
  dice_fill(&u->dice, -0.3, 0.3, 3, q + 1);
  dNormalize4(q);
  if (dGeomGetClass(geom) == dPlaneClass) {
    dGeomPlaneSetParams(geom, 0.0, 0.0, 1.0, -0.1 + 0.2 * at[0]);
    return;
  }
  if (dGeomGetClass(geom) == dHeightfieldClass) { /* its up is y */
    dMatrix3 up;
    dRFromAxisAndAngle(up, 1.0, 0.0, 0.0, 0.5 * M_PI);
    dGeomSetPosition(geom, near->center[0] + at[0], near->center[1] + at[1], -0.1 + 0.2 * at[2]);
    dGeomSetRotation(geom, up);
    return;
  }
  dGeomSetPosition(geom, near->center[0] + at[0], near->center[1] + at[1], near->center[2] + at[2]);
  dGeomSetQuaternion(geom, q);
}

static void edit_static(use *u, int at)
{
  dGeomID *geom = &u->statics[at % STATICS];
  if (*geom == NULL || dice_chance(&u->dice, 0.6)) {
    if (*geom != NULL) {
      geom_destroy(u, *geom);
    }
    *geom = geom_make(u, space_any(u), (geom_kind)(int)dice_below(&u->dice, GEOM_KINDS));
    static_place(u, *geom);
  } else if (dice_chance(&u->dice, 0.5)) {
    geom_resize(u, *geom);
  } else if (dice_chance(&u->dice, 0.5)) {
    geom_destroy(u, *geom);
    *geom = NULL;
  } else {
    static_place(u, *geom);
  }
}

/* Two go, two come: in the order of before, or not. */
static void edit_static_two(use *u, int at)
{
  dGeomID *a = &u->statics[at % STATICS];
  dGeomID *b = &u->statics[(at + 1 + (int)dice_below(&u->dice, STATICS - 1)) % STATICS];
  geom_kind kind = (geom_kind)(int)dice_below(&u->dice, GEOM_KINDS);
  if (*a != NULL) {
    geom_destroy(u, *a);
  }
  if (*b != NULL) {
    geom_destroy(u, *b);
  }
  *a = geom_make(u, u->space, kind);
  *b = geom_make(u, u->space, kind);
  static_place(u, *a);
  static_place(u, *b);
}

static bool is_nested_in(const use *u, dGeomID geom, int index)
{
  (void)u;
  return geom != NULL && dGeomGetSpace(geom) == u->nested[index];
}

static void edit_space(use *u, int at)
{
  int index = at % NESTED;
  if (u->nested[index] == NULL) {
    switch ((int)dice_below(&u->dice, 3)) {
      case 0:
        u->nested[index] = dSimpleSpaceCreate(u->space);
        break;
      case 1:
        u->nested[index] = dHashSpaceCreate(u->space);
        break;
      default:
        u->nested[index] = dSweepAndPruneSpaceCreate(u->space, dSAP_AXES_XYZ);
        break;
    }
    return;
  }
  for (int i = 0; i < BODIES; ++i) { /* with all that is in it */
    use_body *b = &u->bodies[i];
    for (int k = 0; k < b->geom_count;) {
      if (is_nested_in(u, b->geoms[k], index)) {
        EXPECT(u, hap_session_forget_geom(u->session, b->geoms[k]));
        b->geoms[k] = b->geoms[--b->geom_count];
      } else {
        ++k;
      }
    }
  }
  for (int i = 0; i < STATICS; ++i) {
    if (is_nested_in(u, u->statics[i], index)) {
      EXPECT(u, hap_session_forget_geom(u->session, u->statics[i]));
      u->statics[i] = NULL;
    }
  }
  dSpaceDestroy(u->nested[index]);
  u->nested[index] = NULL;
}

static void edit_joint_life(use *u, int at)
{
  int index = at % JOINTS;
  if (u->joints[index] != NULL) {
    joint_destroy(u, index);
  } else {
    joint_create(u, index, joint_kind_any(u));
  }
}

static void edit_joint_replace(use *u, int at)
{
  int index = at % JOINTS;
  if (u->joints[index] == NULL) {
    return;
  }
  const joint_kind *kind = joint_kind_of(u->joints[index]);
  dBodyID a = dJointGetBody(u->joints[index], 0);
  dBodyID b = dJointGetBody(u->joints[index], 1);
  joint_destroy(u, index);
  if (dice_chance(&u->dice, 0.5)) {
    joint_create_like(u, index, a, b, kind);
  } else {
    joint_create(u, index, joint_kind_any(u));
  }
}

/* Two go and come: of the same kind between the same bodies, or the one in the other's place. */
static void edit_joint_two(use *u, int at)
{
  int index[2] = {at % JOINTS, (at + 1 + (int)dice_below(&u->dice, JOINTS - 1)) % JOINTS};
  const joint_kind *kinds[2];
  dBodyID bodies[2][2];
  for (int i = 0; i < 2; ++i) {
    if (u->joints[index[i]] == NULL) {
      return;
    }
    kinds[i] = joint_kind_of(u->joints[index[i]]);
    bodies[i][0] = dJointGetBody(u->joints[index[i]], 0);
    bodies[i][1] = dJointGetBody(u->joints[index[i]], 1);
  }
  int first = (int)dice_below(&u->dice, 2);
  joint_destroy(u, index[first]);
  joint_destroy(u, index[1 - first]);
  first = (int)dice_below(&u->dice, 2);
  for (int i = 0; i < 2; ++i) {
    int k = (first + i) % 2;
    joint_create_like(u, index[k], bodies[k][0], bodies[k][1], kinds[k]);
  }
}

/* Another one of the same kind between the same bodies. */
static void edit_joint_twin(use *u, int at)
{
  dJointID joint = u->joints[at % JOINTS];
  int other = (at + 1 + (int)dice_below(&u->dice, JOINTS - 1)) % JOINTS;
  if (joint == NULL || u->joints[other] != NULL || dJointGetType(joint) == dJointTypePlane2D) {
    return;
  }
  joint_create_like(u, other, dJointGetBody(joint, 0), dJointGetBody(joint, 1),
                    joint_kind_of(joint));
}

static void edit_joint_attach(use *u, int at)
{
  dJointID joint = u->joints[at % JOINTS];
  if (joint != NULL && joint_attach(u, joint, joint_kind_of(joint))) {
    joint_place(u, joint);
  }
}

static void edit_joint_set(use *u, int at)
{
  dJointID joint = u->joints[at % JOINTS];
  if (joint == NULL) {
    return;
  }
  if (dice_chance(&u->dice, 0.3)) {
    joint_place(u, joint);
  }
  joint_set_parameters(u, joint);
  if (dice_chance(&u->dice, 0.2)) {
    dJointDisable(joint);
  } else {
    dJointEnable(joint);
  }
}

static void edit_world(use *u, int at)
{
  double v[4];
  (void)at;
  dice_fill(&u->dice, 0.0, 1.0, 4, v);
  switch ((int)dice_below(&u->dice, 4)) {
    case 0:
      dWorldSetGravity(u->world, 2 * v[0] - 1, 2 * v[1] - 1, -9.81 * v[2]);
      break;
    case 1:
      dWorldSetERP(u->world, 0.1 + 0.3 * v[0]);
      dWorldSetCFM(u->world, 1e-5 * v[1]);
      break;
    case 2:
      dWorldSetQuickStepNumIterations(u->world, 5 + (int)(10 * v[0]));
      dWorldSetContactSurfaceLayer(u->world, 1e-3 * v[1]);
      break;
    default:
      dWorldSetAutoDisableFlag(u->world, v[0] < 0.5);
      dWorldSetAutoDisableTime(u->world, 0.2 * v[1]);
      break;
  }
}

/* More of what replaces things, and of those at which hands are. */
static const edit edits[] = {
    {"body life", edit_body_life},
    {"body replace", edit_body_replace},
    {"body replace", edit_body_replace},
    {"body two", edit_body_two},
    {"body pose", edit_body_pose},
    {"body velocity", edit_body_velocity},
    {"body force", edit_body_force},
    {"body mass", edit_body_mass},
    {"body kinematic", edit_body_kinematic},
    {"body enabled", edit_body_enabled},
    {"body settings", edit_body_settings},
    {"body known", edit_body_known},
    {"geom life", edit_geom_life},
    {"geom replace", edit_geom_replace},
    {"geom replace", edit_geom_replace},
    {"geom two", edit_geom_two},
    {"geom like", edit_geom_like},
    {"geom shape", edit_geom_shape},
    {"geom offset", edit_geom_offset},
    {"geom flags", edit_geom_flags},
    {"geom space", edit_geom_space},
    {"geom give", edit_geom_give},
    {"static", edit_static},
    {"static", edit_static},
    {"static two", edit_static_two},
    {"space", edit_space},
    {"joint life", edit_joint_life},
    {"joint life", edit_joint_life},
    {"joint replace", edit_joint_replace},
    {"joint replace", edit_joint_replace},
    {"joint two", edit_joint_two},
    {"joint twin", edit_joint_twin},
    {"joint attach", edit_joint_attach},
    {"joint set", edit_joint_set},
    {"world", edit_world},
};

/* Joints between bodies that were put elsewhere throw them about. */
static void bodies_calm(use *u)
{
  for (int i = 0; i < BODIES; ++i) {
    dBodyID body = u->bodies[i].body;
    if (body == NULL) {
      continue;
    }
    const dReal *at = dBodyGetPosition(body);
    const dReal *v = dBodyGetLinearVel(body);
    const dReal *w = dBodyGetAngularVel(body);
    bool calm = dCalcVectorLength3(at) < FAR && dCalcVectorLength3(v) < FAST &&
                dCalcVectorLength3(w) < SPIN;
    if (!calm) {
      body_place(u, body);
      dBodySetLinearVel(body, 0.0, 0.0, 0.0);
      dBodySetAngularVel(body, 0.0, 0.0, 0.0);
    }
  }
}

static void edits_run(use *u, int count)
{
  for (int i = 0; i < count; ++i) {
    const edit *e = &edits[(int)dice_below(&u->dice, (uint32_t)(sizeof edits / sizeof edits[0]))];
    int at = (int)dice_below(&u->dice, 1 << 20);
    use_say(u, "%s %d", e->name, at);
    e->run(u, at);
    bodies_settle(u);
    ++u->out->edits;
  }
  bodies_calm(u);
}

/* ---- what the session calls ---- */

static bool use_surface(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  const use *u = user;
  if (dGeomGetClass(a) == dRayClass || dGeomGetClass(b) == dRayClass) {
    return false;
  }
  io->mu = 0.1 * ((dGeomGetClass(a) * 5 + dGeomGetClass(b) * 5) % 11);
  if (u->def->seed % 3 == 0) {
    io->mode |= dContactSoftERP | dContactSoftCFM;
    io->soft_erp = 0.2;
    io->soft_cfm = 1e-4;
  }
  if (u->def->seed % 5 == 0) {
    io->mode |= dContactBounce;
    io->bounce = 0.3;
    io->bounce_vel = 0.01;
  }
  return true;
}

static void use_pointer_surface(void *user, hap_pointer_id pointer, dGeomID geom, hap_surface *io)
{
  (void)user;
  (void)pointer;
  int kind = dGeomGetClass(geom) % 4;
  io->friction_dynamic = 0.2 * kind;
  io->friction_static = 0.25 * kind;
  io->stiffness *= 1.0 + 0.5 * kind;
  io->adhesion = kind == 3 ? 2.0 : 0.0;
}

static void use_before_step(void *user, double step_s)
{
  use *u = user;
  (void)step_s;
  if (dice_chance(&u->dice, 0.3)) {
    edits_run(u, 1 + (int)dice_below(&u->dice, 2));
  }
}

static void use_after_step(void *user, double step_s)
{
  use *u = user;
  (void)step_s;
  if (dice_chance(&u->dice, 0.3)) {
    edits_run(u, 1 + (int)dice_below(&u->dice, 2));
  }
}

static void use_posted(void *arg)
{
  use *u = arg;
  --u->posted;
  edits_run(u, 1 + (int)dice_below(&u->dice, 2));
}

/* ---- pointers ---- */

static void pointer_add(use *u, int index)
{
  use_pointer *p = &u->pointers[index];
  double corners[8][3];
  double v[6];
  hap_pointer_def def;
  hap_pointer_expert_def expert;
  hap_pointer_def_init(&def, sizeof def);
  hap_pointer_expert_def_init(&expert, sizeof expert);
  def.expert = &expert;
  dice_fill(&u->dice, 0.0, 1.0, 6, v);
  def.device = p->device;
  def.radius = 0.006 + 0.01 * v[0];
  def.stiffness = 300.0 + 2000.0 * v[1];
  def.damping = v[2] < 0.5 ? 0.0 : 4.0 * v[2];
  def.friction = v[3] < 0.4 ? 0.0 : v[3];
  def.finger_radius = def.friction > 0.0 && v[4] < 0.4 ? 0.005 : 0.0;
  if (v[5] < 0.4) {
    for (int i = 0; i < 8; ++i) {
      for (int k = 0; k < 3; ++k) {
        corners[i][k] = ((i >> k & 1) != 0 ? 1.0 : -1.0) * (0.01 + 0.01 * v[k]);
      }
    }
    def.hull_xyz = &corners[0][0];
    def.hull_points = 8;
    def.radius = v[0] < 0.5 ? 0.0 : 0.002;
  }
  static const hap_coupling couplings[] = {
      HAP_COUPLING_AUTO,  HAP_COUPLING_AUTO,       HAP_COUPLING_DIRECT, HAP_COUPLING_DIRECT,
      HAP_COUPLING_PROXY, HAP_COUPLING_GOD_OBJECT, HAP_COUPLING_VIRTUAL};
  expert.coupling = couplings[(int)dice_below(&u->dice, 7)];
  if (expert.coupling > HAP_COUPLING_DIRECT) {
    expert.coupling_stiffness = 800.0;
    expert.coupling_damping = 1.0;
  }
  hap_status status = hap_pointer_add(u->session, &def, &p->id);
  if (status == HAP_ERROR_UNSUPPORTED) { /* not this coupling in this model */
    expert.coupling = HAP_COUPLING_DIRECT;
    expert.coupling_stiffness = expert.coupling_damping = 0.0;
    status = hap_pointer_add(u->session, &def, &p->id);
  }
  status_expect(u, status, "hap_pointer_add");
}

static hap_status pointer_open(use *u, int index, hap_detail *detail)
{
  use_pointer *p = &u->pointers[index];
  p->center[0] = 0.09 * index - 0.18;
  p->center[1] = 0.05 * (index % 2);
  p->center[2] = 0.02 * (index % 3);
  if (index % 2 != 0) {
    return HAP_OK;
  }
  char spec[200];
  snprintf(spec, sizeof spec,
           "virtual:path=0:%g/%g/%g;0.3:%g/%g/%g;0.6:%g/%g/%g,loop=1,dof=%d,hand=%s", p->center[0],
           p->center[1], p->center[2], p->center[0] + 0.04, p->center[1], p->center[2] - 0.03,
           p->center[0], p->center[1], p->center[2], dice_chance(&u->dice, 0.5) ? 6 : 3,
           dice_chance(&u->dice, 0.5) ? "rigid" : "relaxed");
  return hap_device_open(spec, &p->device, detail);
}

static void pointers_move(use *u)
{
  for (int i = 0; i < POINTERS; ++i) {
    use_pointer *p = &u->pointers[i];
    double angle = 0.004 * (double)u->tick * (1.0 + 0.3 * i);
    hap_pose pose = {{p->center[0] + 0.04 * sin(angle), p->center[1] + 0.04 * cos(angle),
                      p->center[2] + 0.02 * sin(2.0 * angle)},
                     {cos(0.3 * angle), 0.0, 0.0, sin(0.3 * angle)}};
    if (p->id.v != 0 && p->device == NULL) {
      EXPECT(u, hap_pointer_set_target(u->session, p->id, &pose, NULL));
    }
  }
}

static void pointer_change(use *u)
{
  use_pointer *p = &u->pointers[(int)dice_below(&u->dice, POINTERS)];
  if (p->id.v == 0) {
    pointer_add(u, (int)(p - u->pointers));
  } else if (p->device != NULL && u->started && dice_chance(&u->dice, 0.2)) {
    EXPECT(u, hap_pointer_restart(u->session, p->id));
  } else {
    EXPECT(u, hap_pointer_remove(u->session, p->id));
    p->id.v = 0;
  }
}

/* ---- the session ---- */

static hap_status session_create(use *u, hap_detail *detail)
{
  static const double rates[] = {20.0, 20.0, 60.0, 60.0, 120.0};
  static const hap_model models[] = {HAP_MODEL_CONTACT,     HAP_MODEL_CONTACT, HAP_MODEL_CONTACT,
                                     HAP_MODEL_ACCELERANCE, HAP_MODEL_IMPULSE, HAP_MODEL_SINGLE};
  hap_session_def def;
  hap_ode_def ode;
  hap_expert_def expert;
  hap_research_def research;
  hap_session_def_init(&def, sizeof def);
  hap_ode_def_init(&ode, sizeof ode);
  hap_expert_def_init(&expert, sizeof expert);
  hap_research_def_init(&research, sizeof research);
  def.expert = &expert;
  def.research = &research;
  def.drive = HAP_DRIVE_LOCKSTEP;
  def.model = models[(int)dice_below(&u->dice, 6)];
  def.physics_hz = rates[(int)dice_below(&u->dice, 5)];
  def.max_pointers = POINTERS;
  def.max_bodies = dice_chance(&u->dice, 0.2) ? 3 : def.max_bodies;
  expert.range_hops = dice_chance(&u->dice, 0.2) ? (int)dice_below(&u->dice, 3) : expert.range_hops;
  expert.lookback = dice_chance(&u->dice, 0.25) ? 0.2 : 0.0;
  def.accuracy = dice_chance(&u->dice, 0.3) ? dice_between(&u->dice, 0.0, 1.0) : def.accuracy;
  research.probe =
      dice_chance(&u->dice, 0.3) ? (hap_probe)(int)dice_below(&u->dice, 3) : research.probe;
  research.guard = dice_chance(&u->dice, 0.3) ? HAP_GUARD_MEASURE : HAP_GUARD_ON;
  def.rt_priority = 0;
  for (int i = 0; i < HAP_EFFECTS; ++i) {
    hap_effect_wish wish = dice_chance(&u->dice, 0.15)
                               ? (hap_effect_wish)(int)dice_below(&u->dice, 3)
                               : HAP_EFFECT_AUTO;
    bool can = hap_effect_check((hap_effect)i, wish, def.model, NULL) == HAP_OK &&
               i != HAP_EFFECT_RECORDING && i != HAP_EFFECT_OBSERVER;
    if (can && wish != HAP_EFFECT_AUTO) {
      *(wish == HAP_EFFECT_ON ? &expert.effects_on : &expert.effects_off) |= HAP_EFFECT_BIT(i);
    }
  }
  ode.world = u->world;
  ode.space = u->space;
  ode.surface = use_surface;
  ode.pointer_surface = dice_chance(&u->dice, 0.3) ? use_pointer_surface : NULL;
  ode.before_step = use_before_step;
  ode.after_step = use_after_step;
  ode.user = u;
  return hap_session_create(&def, &ode, &u->session, detail);
}

static void session_change(use *u)
{
  hap_effect effect = (hap_effect)(int)dice_below(&u->dice, HAP_EFFECTS);
  hap_effect_wish wish = (hap_effect_wish)(int)dice_below(&u->dice, 3);
  double accuracy = dice_between(&u->dice, 0.0, 1.0);
  switch ((int)dice_below(&u->dice, 4)) {
    case 0:
      EXPECT(u, hap_session_set_model(u->session, (hap_model)(int)dice_below(&u->dice, 4)));
      break;
    case 1:
      EXPECT(u, hap_session_set_accuracy(u->session, accuracy));
      break;
    case 2:
      hash_word(u, (uint64_t)hap_session_set_effect(u->session, effect, wish));
      break;
    default:
      EXPECT(u, hap_session_reset_fault(u->session));
      break;
  }
}

/* What counts of the statistics; the rest are times. */
static void session_note(use *u)
{
  hap_stats s;
  EXPECT(u, hap_session_stats(u->session, &s, sizeof s));
  const uint64_t counts[] = {s.loop.trace_hash,    s.probes.steps,
                             s.loop.contact_ticks, s.physics.quickstep_calls,
                             s.model.bodies_known, s.model.capacity_dropped,
                             s.faults.count,       s.probes.reused,
                             s.error.lookbacks,    s.error.spoilt,
                             s.contact.sweeps};
  for (size_t i = 0; i < sizeof counts / sizeof counts[0]; ++i) {
    hash_word(u, counts[i]);
  }
  hash_doubles(u, &s.error.force_error, 1);
  u->out->trace_hash = (u->out->trace_hash ^ s.loop.trace_hash) * 0x9e3779b97f4a7c15u;
  u->out->probe_steps += s.probes.steps;
  u->out->contact_ticks += s.loop.contact_ticks;
  u->out->faults += s.faults.count;
  u->out->lost += s.faults.bodies_lost;
}

static void session_restart(use *u)
{
  use_say(u, "restart");
  EXPECT(u, hap_session_stop(u->session));
  u->started = false;
  session_note(u);
  EXPECT(u, hap_session_lock(u->session));
  edits_run(u, (int)dice_below(&u->dice, 6));
  EXPECT(u, hap_session_unlock(u->session));
  if (dice_chance(&u->dice, 0.5)) {
    pointer_change(u);
  }
  EXPECT(u, hap_session_start(u->session));
  u->started = true;
}

static void world_hash(use *u)
{
  for (int i = 0; i < BODIES; ++i) {
    dBodyID body = u->bodies[i].body;
    hap_pose pose = {{0}, {0}};
    if (body == NULL) {
      continue;
    }
    hash_doubles(u, dBodyGetPosition(body), 3);
    hash_doubles(u, dBodyGetQuaternion(body), 4);
    hash_doubles(u, dBodyGetLinearVel(body), 3);
    hash_doubles(u, dBodyGetAngularVel(body), 3);
    hash_word(u, (uint64_t)dBodyIsEnabled(body));
    hash_word(
        u, (uint64_t)hap_session_poses(u->session, hap_session_now(u->session), &body, 1, &pose));
    hash_doubles(u, pose.position, 3);
  }
}

/* Every other program has hands that do more than push. */
static void hands_change(use *u)
{
  random_hands *h = &u->hands;
  if (u->def->seed % 2 == 0) {
    return;
  }
  uint64_t throws = h->dice >> 32;
  const use_pointer *p = &u->pointers[throws % POINTERS];
  if (throws / 8 % 4 == 0) {
    random_hands_change(h, u->session, p->id, u->bodies[throws / 64 % BODIES].body);
  }
  random_hands_ask(h, u->session, p->id);
  hash_word(u, h->hash);
}

static void use_advance(use *u)
{
  uint64_t ticks = 1 + (uint64_t)(int)dice_below(&u->dice, 12);
  pointers_move(u);
  if (dice_chance(&u->dice, 0.4)) {
    edits_run(u, 1 + (int)dice_below(&u->dice, 3));
  }
  if (dice_chance(&u->dice, 0.1)) {
    pointer_change(u);
  }
  if (dice_chance(&u->dice, 0.03)) {
    session_change(u);
  }
  if (dice_chance(&u->dice, 0.1) && u->posted < 20) {
    ++u->posted;
    EXPECT(u, hap_session_post(u->session, use_posted, u));
  }
  if (dice_chance(&u->dice, 0.01)) {
    session_restart(u);
  }
  hands_change(u);
  EXPECT(u, hap_session_advance(u->session, ticks));
  u->tick += ticks;
  bodies_calm(u);
  world_hash(u);
  if (u->def->ticked != NULL) {
    u->def->ticked(u->session, u->def->ticked_arg);
  }
}

/* ---- the run ---- */

static void world_open(use *u)
{
  shapes_make(u);
  u->field = dGeomHeightfieldDataCreate();
  dGeomHeightfieldDataBuildCallback(u->field, u, field_height, 0.8, 0.8, 8, 8, 1.0, 0.0, 0.1, 0);
  dGeomHeightfieldDataSetBounds(u->field, -0.1, 0.1);
  u->world = dWorldCreate();
  u->space = dice_chance(&u->dice, 0.7)   ? dHashSpaceCreate(NULL)
             : dice_chance(&u->dice, 0.5) ? dSimpleSpaceCreate(NULL)
                                          : dSweepAndPruneSpaceCreate(NULL, dSAP_AXES_XYZ);
  u->nested[0] = dSimpleSpaceCreate(u->space);
  dWorldSetGravity(u->world, 0.0, 0.0, dice_chance(&u->dice, 0.5) ? -9.81 : 0.0);
  dWorldSetCFM(u->world, 1e-6);
  dWorldSetMaxAngularSpeed(u->world, 30.0);
  dWorldSetContactMaxCorrectingVel(u->world, 1.0);
  dWorldSetQuickStepNumIterations(u->world, 10);
  dWorldSetAutoDisableFlag(u->world, dice_chance(&u->dice, 0.3));
  u->statics[0] = geom_make(u, u->space, GEOM_PLANE);
}

static void world_close(use *u)
{
  for (int i = 0; i < JOINTS; ++i) {
    if (u->joints[i] != NULL) {
      dJointDestroy(u->joints[i]);
    }
  }
  dSpaceDestroy(u->space);
  dWorldDestroy(u->world);
  dGeomHeightfieldDataDestroy(u->field);
  for (int s = 0; s < SHAPES; ++s) {
    dGeomTriMeshDataDestroy(u->meshes[s]);
  }
}

hap_status random_use_run(const random_use_def *def, random_use_result *out, hap_detail *detail)
{
  use one;
  use *u = &one;
  memset(u, 0, sizeof *u);
  memset(out, 0, sizeof *out);
  u->def = def;
  u->out = out;
  u->dice = (def->seed + 1) * 0x9e3779b97f4a7c15u;
  for (int i = 0; i < 8; ++i) {
    (void)dice_next(&u->dice);
  }
  random_hands_begin(&u->hands, def->seed);
  hap_status status = HAP_OK;
  world_open(u);
  for (int i = 0; i < POINTERS && status >= HAP_OK; ++i) {
    status = pointer_open(u, i, detail);
  }
  status = status >= HAP_OK ? session_create(u, detail) : status;
  if (status >= HAP_OK) {
    for (int i = 0; i < BODIES / 2; ++i) {
      body_create(u, &u->bodies[i]);
    }
    for (int i = 0; i < JOINTS / 2; ++i) {
      joint_create(u, i, joint_kind_any(u));
    }
    for (int i = 0; i < POINTERS; ++i) {
      pointer_add(u, i);
    }
    status = hap_session_start(u->session);
    u->started = true;
    if (status < HAP_OK) {
      (void)hap_session_detail(u->session, detail);
    }
  }
  while (status >= HAP_OK && u->tick < def->ticks) {
    use_advance(u);
  }
  if (status >= HAP_OK) {
    EXPECT(u, hap_session_stop(u->session));
    session_note(u);
  }
  out->unexpected += u->hands.bad;
  hap_session_destroy(u->session);
  for (int i = 0; i < POINTERS; ++i) {
    hap_device_close(u->pointers[i].device);
  }
  world_close(u);
  return status;
}
