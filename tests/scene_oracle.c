/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tests/scene_oracle.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/vec.h"

#ifdef HAPODE_ORACLE
#include <mujoco/mujoco.h>

#define NEAR 1e-6

typedef struct comparing {
  const mjModel *theirs;
  const mjData *data;
  bool by_names;
  oracle_found *out;
} comparing;

static void number_differs(const comparing *c, const char *what, const char *of, double ours,
                           double theirs)
{
  if (c->out->differ++ == 0) {
    (void)snprintf(c->out->first, sizeof c->out->first, "%s of \"%s\" is %.9g and not %.9g", what,
                   of, ours, theirs);
  }
}

static void vectors_compare(const comparing *c, const char *what, const char *of,
                            const double *ours, const mjtNum *theirs, int count)
{
  double largest = 0.0;
  for (int k = 0; k < count; ++k) {
    largest = fmax(largest, fabs(theirs[k]));
  }
  for (int k = 0; k < count; ++k) {
    if (!(fabs(ours[k] - theirs[k]) < NEAR * fmax(1.0, largest))) {
      number_differs(c, what, of, ours[k], theirs[k]);
    }
  }
}

static void flags_compare(const comparing *c, const char *what, const char *of, double ours,
                          double theirs)
{
  if (ours != theirs) {
    number_differs(c, what, of, ours, theirs);
  }
}

/* Of two signs the one that fits. */
static void turn_compare(const comparing *c, const char *what, const char *of, const double *ours,
                         const mjtNum *theirs)
{
  double dot = 0.0;
  double flipped[4];
  for (int k = 0; k < 4; ++k) {
    dot += ours[k] * theirs[k];
  }
  for (int k = 0; k < 4; ++k) {
    flipped[k] = dot < 0.0 ? -ours[k] : ours[k];
  }
  vectors_compare(c, what, of, flipped, theirs, 4);
}

static void mass_compare(const comparing *c, const import_body *body, int i)
{
  const mjModel *theirs = c->theirs;
  mjtNum r[9];
  double inertia[9];
  const mjtNum *d = theirs->body_inertia + 3 * i;
  const double diagonal[9] = {d[0], 0, 0, 0, d[1], 0, 0, 0, d[2]};
  mju_quat2Mat(r, theirs->body_iquat + 4 * i);
  hapi_m3_turn(r, diagonal, inertia);
  vectors_compare(c, "mass", body->name, &body->mass.mass, theirs->body_mass + i, 1);
  const double *m = body->mass.inertia;
  const bool balanced = d[0] == d[1] && d[1] == d[2] && !hapi_m3_is_scalar(m);
  if (body->mass.mass > 0.0 && c->by_names &&
      balanced) { /* by MuJoCo; hapode does so with a note */
    const double trace = m[0] + m[4] + m[8];
    const mjtNum theirs_trace = d[0] + d[1] + d[2];
    vectors_compare(c, "trace of inertia", body->name, &trace, &theirs_trace, 1);
  } else if (body->mass.mass > 0.0) {
    vectors_compare(c, "centre", body->name, body->mass.centre, theirs->body_ipos + 3 * i, 3);
    vectors_compare(c, "inertia", body->name, body->mass.inertia, inertia, 9);
  }
}

static void springs_compare(const comparing *c, const import_joint *joint, int j)
{
  const mjModel *theirs = c->theirs;
  const int dof = theirs->jnt_dofadr[j];
  const mjtNum zero = theirs->qpos0[theirs->jnt_qposadr[j]];
  const mjtNum rest = theirs->qpos_spring[theirs->jnt_qposadr[j]] - zero;
  vectors_compare(c, "stiffness", joint->name, &joint->stiffness, theirs->jnt_stiffness + j, 1);
  vectors_compare(c, "damping", joint->name, &joint->damping, theirs->dof_damping + dof, 1);
  vectors_compare(c, "armature", joint->name, &joint->armature, theirs->dof_armature + dof, 1);
  vectors_compare(c, "friction", joint->name, &joint->friction, theirs->dof_frictionloss + dof, 1);
  if (joint->stiffness > 0.0 && joint->kind != IMPORT_BALL) {
    vectors_compare(c, "springref", joint->name, &joint->rest, &rest, 1);
  }
}

static void joint_compare(const comparing *c, const import_joint *joint, int j)
{
  static const int kinds[] = {mjJNT_FREE, mjJNT_BALL, mjJNT_HINGE, mjJNT_SLIDE};
  const mjModel *theirs = c->theirs;
  flags_compare(c, "kind of joint", joint->name, kinds[joint->kind], theirs->jnt_type[j]);
  if (joint->kind == IMPORT_FREE || kinds[joint->kind] != theirs->jnt_type[j]) {
    return;
  }
  vectors_compare(c, "anchor", joint->name, joint->anchor, theirs->jnt_pos + 3 * j, 3);
  springs_compare(c, joint, j);
  if (joint->kind == IMPORT_BALL) {
    return;
  }
  vectors_compare(c, "axis", joint->name, joint->axis, theirs->jnt_axis + 3 * j, 3);
  mjtNum zero = theirs->qpos0[theirs->jnt_qposadr[j]];
  const double range[2] = {joint->low + zero, joint->high + zero};
  bool limited = theirs->jnt_limited[j] != 0;
  flags_compare(c, "being limited", joint->name, isfinite(joint->low) != 0, limited);
  if (limited && isfinite(joint->low)) {
    vectors_compare(c, "range", joint->name, range, theirs->jnt_range + 2 * j, 2);
  }
}

static void geom_compare(const comparing *c, const import_geom *geom, int g)
{
  static const int types[] = {mjGEOM_PLANE, mjGEOM_SPHERE,    mjGEOM_CAPSULE, mjGEOM_CYLINDER,
                              mjGEOM_BOX,   mjGEOM_ELLIPSOID, mjGEOM_MESH,    mjGEOM_HFIELD};
  static const int sizes[] = {0, 1, 2, 2, 3, 3, 0, 0};
  const mjModel *theirs = c->theirs;
  const char *name = geom->name;
  flags_compare(c, "shape of geom", name, types[geom->shape], theirs->geom_type[g]);
  if (types[geom->shape] != theirs->geom_type[g]) {
    return;
  }
  if (geom->shape != IMPORT_MESH) { /* its frame is put into the centre of mass */
    vectors_compare(c, "place of geom", name, geom->pose.position, theirs->geom_pos + 3 * g, 3);
    turn_compare(c, "turn of geom", name, geom->pose.quat_wxyz, theirs->geom_quat + 4 * g);
  }
  vectors_compare(c, "size", name, geom->size, theirs->geom_size + 3 * g, sizes[geom->shape]);
  if (c->by_names) { /* URDF has no more of it */
    return;
  }
  vectors_compare(c, "friction of geom", name, &geom->friction, theirs->geom_friction + 3 * g, 1);
  flags_compare(c, "contype", name, geom->category_bits, (uint32_t)theirs->geom_contype[g]);
  flags_compare(c, "conaffinity", name, geom->collide_bits, (uint32_t)theirs->geom_conaffinity[g]);
  static const float grey[4] = {0.5F, 0.5F, 0.5F, 1.0F};
  const bool is_default = memcmp(theirs->geom_rgba + 4 * (ptrdiff_t)g, grey, sizeof grey) == 0;
  for (int k = 0; k < 4; ++k) {
    const int material = theirs->geom_matid[g];
    const float *rgba = material < 0 || !is_default ? theirs->geom_rgba + 4 * (ptrdiff_t)g
                                                    : theirs->mat_rgba + 4 * (ptrdiff_t)material;
    if (!(fabsf(geom->colour_rgba[k] - rgba[k]) < 1e-6F)) {
      number_differs(c, "colour", name, (double)geom->colour_rgba[k], (double)rgba[k]);
    }
  }
}

static void field_compare(const comparing *c, const import_geom *geom, int g)
{
  const mjModel *theirs = c->theirs;
  const int f = theirs->geom_dataid[g];
  const int rows = theirs->hfield_nrow[f];
  const int columns = theirs->hfield_ncol[f];
  flags_compare(c, "rows of field", geom->name, geom->field->rows, rows);
  flags_compare(c, "columns of field", geom->name, geom->field->columns, columns);
  for (int i = 0; i < rows * columns && c->out->differ == 0; ++i) {
    const double height = (double)theirs->hfield_data[theirs->hfield_adr[f] + i] *
                          theirs->hfield_size[4 * (ptrdiff_t)f + 2];
    vectors_compare(c, "height of field", geom->name, geom->field->heights + i, &height, 1);
  }
}

static void body_compare(const comparing *c, const import_body *body, int i)
{
  const mjModel *theirs = c->theirs;
  int j = theirs->body_jntadr[i];
  int g = theirs->body_geomadr[i];
  const int last_joint = j + theirs->body_jntnum[i];
  const int last_geom = g + theirs->body_geomnum[i];
  vectors_compare(c, "place", body->name, body->pose_world.position, c->data->xpos + 3 * i, 3);
  turn_compare(c, "turn", body->name, body->pose_world.quat_wxyz, c->data->xquat + 4 * i);
  if (body->parent != NULL) {
    mass_compare(c, body, i);
  }
  for (const import_joint *joint = body->joints; joint != NULL; joint = joint->next, ++j) {
    if (j >= last_joint) {
      number_differs(c, "number of joints", body->name, 1 + j, last_joint);
      break;
    }
    joint_compare(c, joint, j);
  }
  if (j >= 0 && j < last_joint) {
    number_differs(c, "number of joints", body->name, j, last_joint);
  }
  for (const import_geom *geom = body->geoms; geom != NULL; geom = geom->next, ++g) {
    if (g >= last_geom) {
      number_differs(c, "number of geoms", body->name, 1 + g, last_geom);
      break;
    }
    geom_compare(c, geom, g);
    if (geom->shape == IMPORT_FIELD && theirs->geom_type[g] == mjGEOM_HFIELD) {
      field_compare(c, geom, g);
    }
  }
  if (g >= 0 && g < last_geom) {
    number_differs(c, "number of geoms", body->name, g, last_geom);
  }
}

static void model_compare(const comparing *c, const import_model *ours)
{
  static const mjtNum none[3] = {0.0, 0.0, 0.0};
  int count = 0;
  const bool weightless = (c->theirs->opt.disableflags & mjDSBL_GRAVITY) != 0;
  vectors_compare(c, "gravity", ours->name, ours->gravity,
                  weightless ? none : c->theirs->opt.gravity, 3);
  for (const import_body *body = ours->bodies; body != NULL; body = body->next) {
    if (c->by_names && count > 0 && strcmp(body->name, "world") == 0) {
      continue; /* MuJoCo takes a root of that name for its own */
    }
    const int i =
        !c->by_names || count == 0 ? count : mj_name2id(c->theirs, mjOBJ_BODY, body->name);
    if (i < 0 || i >= c->theirs->nbody) {
      number_differs(c, "number of bodies", body->name, 1 + count, c->theirs->nbody);
      return;
    }
    body_compare(c, body, i);
    ++count;
  }
  flags_compare(c, "number of bodies", ours->name, count, c->theirs->nbody);
}

bool scene_oracle_move(const char *path, double seconds, size_t body, double out_position[3])
{
  char why[300];
  mjModel *theirs = mj_loadXML(path, NULL, why, (int)sizeof why);
  if (theirs == NULL || (int)body + 1 >= theirs->nbody) {
    mj_deleteModel(theirs);
    return false;
  }
  mjData *data = mj_makeData(theirs);
  theirs->opt.timestep = 2e-4;
  theirs->opt.integrator = mjINT_RK4;
  while (data->time < seconds - 1e-4) {
    mj_step(theirs, data);
  }
  mj_kinematics(theirs, data);
  hapi_v3_copy(data->xpos + 3 * (body + 1), out_position);
  mj_deleteData(data);
  mj_deleteModel(theirs);
  return true;
}

bool scene_oracle_is_there(void)
{
  return true;
}

bool scene_oracle(const char *path, const import_model *ours, oracle_found *out)
{
  memset(out, 0, sizeof *out);
  const char *end = strrchr(path, '.');
  mjModel *theirs = mj_loadXML(path, NULL, out->first, (int)sizeof out->first);
  if (theirs == NULL) {
    return false;
  }
  out->first[0] = '\0'; /* a warning */
  mjData *data = mj_makeData(theirs);
  mj_kinematics(theirs, data);
  const bool urdf = ours->bodies->next != NULL && strcmp(ours->bodies->name, "") == 0;
  const comparing c = {theirs, data, urdf || (end != NULL && strcmp(end, ".urdf") == 0), out};
  model_compare(&c, ours);
  mj_deleteData(data);
  mj_deleteModel(theirs);
  return true;
}

#else

bool scene_oracle_move(const char *path, double seconds, size_t body, double out_position[3])
{
  (void)path, (void)seconds, (void)body, (void)out_position;
  return false;
}

bool scene_oracle_is_there(void)
{
  return false;
}

bool scene_oracle(const char *path, const import_model *ours, oracle_found *out)
{
  (void)path, (void)ours, (void)out;
  return false;
}

#endif
