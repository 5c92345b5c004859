/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tests/scene_oracle.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/vec.h"
#include "tests/oracle_model.h"

#ifdef HAPODE_ORACLE
#include <mujoco/mujoco.h>
#endif

#define NEAR 1e-6
#define NO_RANGE 1e12 /* m, rad: the reader takes no limit for as far as that */

typedef struct comparing {
  const oracle_model *theirs;
  bool by_names;
  const oracle_notes *notes;
  oracle_found *out;
} comparing;

static void number_differs(const comparing *c, const char *what, const char *of, double ours,
                           double theirs)
{
  const bool silent = !oracle_notes_explain(c->notes, what, of);
  const bool first = c->out->differ == 0 || (silent && c->out->silent == 0);
  ++c->out->differ;
  c->out->silent += silent;
  if (first) {
    (void)snprintf(c->out->first, sizeof c->out->first, "%s of \"%s\" is %.9g and not %.9g", what,
                   of, ours, theirs);
  }
}

static void vectors_compare(const comparing *c, const char *what, const char *of,
                            const double *ours, const double *theirs, int count)
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
                         const double *theirs)
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
  const oracle_bodies *bodies = &c->theirs->bodies;
  double r[9];
  double inertia[9];
  const double *d = bodies->inertia + 3 * i;
  const double diagonal[9] = {d[0], 0, 0, 0, d[1], 0, 0, 0, d[2]};
  hapi_quat_to_matrix(bodies->iquat + 4 * i, r);
  hapi_m3_turn(r, diagonal, inertia);
  vectors_compare(c, "mass", body->name, &body->mass.mass, bodies->mass + i, 1);
  const double *m = body->mass.inertia;
  const bool balanced = d[0] == d[1] && d[1] == d[2] && !hapi_m3_is_scalar(m);
  if (body->mass.mass > 0.0 && c->by_names &&
      balanced) { /* by MuJoCo; hapode does so with a note */
    const double trace = m[0] + m[4] + m[8];
    const double theirs_trace = d[0] + d[1] + d[2];
    vectors_compare(c, "trace of inertia", body->name, &trace, &theirs_trace, 1);
  } else if (body->mass.mass > 0.0) {
    vectors_compare(c, "centre", body->name, body->mass.centre, bodies->ipos + 3 * i, 3);
    vectors_compare(c, "inertia", body->name, body->mass.inertia, inertia, 9);
  }
}

static void springs_compare(const comparing *c, const import_joint *joint, int j)
{
  const oracle_joints *joints = &c->theirs->joints;
  const int dof = joints->dof_at[j];
  const double zero = joints->qpos0[joints->qpos_at[j]];
  const double rest = joints->qpos_spring[joints->qpos_at[j]] - zero;
  vectors_compare(c, "stiffness", joint->name, &joint->stiffness, joints->stiffness + j, 1);
  vectors_compare(c, "damping", joint->name, &joint->damping, joints->damping + dof, 1);
  vectors_compare(c, "armature", joint->name, &joint->armature, joints->armature + dof, 1);
  vectors_compare(c, "friction", joint->name, &joint->friction, joints->friction + dof, 1);
  if (joint->stiffness > 0.0 && joint->kind != IMPORT_BALL) {
    vectors_compare(c, "springref", joint->name, &joint->rest, &rest, 1);
  }
}

static void joint_compare(const comparing *c, const import_joint *joint, int j)
{
  static const int kinds[] = {ORACLE_FREE, ORACLE_BALL, ORACLE_HINGE, ORACLE_SLIDE};
  const oracle_joints *joints = &c->theirs->joints;
  flags_compare(c, "kind of joint", joint->name, kinds[joint->kind], joints->type[j]);
  if (joint->kind == IMPORT_FREE || kinds[joint->kind] != joints->type[j]) {
    return;
  }
  vectors_compare(c, "anchor", joint->name, joint->anchor, joints->pos + 3 * j, 3);
  springs_compare(c, joint, j);
  if (joint->kind == IMPORT_BALL) {
    return;
  }
  vectors_compare(c, "axis", joint->name, joint->axis, joints->axis + 3 * j, 3);
  double zero = joints->qpos0[joints->qpos_at[j]];
  const double range[2] = {joint->low + zero, joint->high + zero};
  const double *theirs = joints->range + 2 * (ptrdiff_t)j;
  bool limited = joints->limited[j] != 0 && theirs[1] - theirs[0] < NO_RANGE;
  flags_compare(c, "being limited", joint->name, isfinite(joint->low) != 0, limited);
  if (limited && isfinite(joint->low)) {
    vectors_compare(c, "range", joint->name, range, joints->range + 2 * j, 2);
  }
}

/* By the box around it: MuJoCo tells a mesh's points in the axes of its inertia. */
static void mesh_compare(const comparing *c, const import_geom *geom, int g)
{
  double box[6] = {0};
  for (size_t v = 0; v < geom->mesh->vertex_count; ++v) {
    double at[3];
    hapi_pose_point(geom->pose.position, geom->pose.quat_wxyz, geom->mesh->vertices_xyz + 3 * v,
                    at);
    for (int k = 0; k < 3; ++k) {
      box[k] = v == 0 ? at[k] : fmin(box[k], at[k]);
      box[3 + k] = v == 0 ? at[k] : fmax(box[3 + k], at[k]);
    }
  }
  vectors_compare(c, "box of mesh", geom->name, box, c->theirs->geoms.box + 6 * (ptrdiff_t)g, 6);
}

static void geom_compare(const comparing *c, const import_geom *geom, int g)
{
  static const int types[] = {ORACLE_PLANE, ORACLE_SPHERE,    ORACLE_CAPSULE, ORACLE_CYLINDER,
                              ORACLE_BOX,   ORACLE_ELLIPSOID, ORACLE_MESH,    ORACLE_FIELD};
  static const int sizes[] = {0, 1, 2, 2, 3, 3, 0, 0};
  const oracle_geoms *geoms = &c->theirs->geoms;
  const char *name = geom->name;
  flags_compare(c, "shape of geom", name, types[geom->shape], geoms->type[g]);
  if (types[geom->shape] != geoms->type[g]) {
    return;
  }
  if (geom->shape == IMPORT_MESH && geom->mesh != NULL) {
    mesh_compare(c, geom, g);
  } else {
    vectors_compare(c, "place of geom", name, geom->pose.position, geoms->pos + 3 * g, 3);
    turn_compare(c, "turn of geom", name, geom->pose.quat_wxyz, geoms->quat + 4 * g);
  }
  vectors_compare(c, "size", name, geom->size, geoms->size + 3 * g, sizes[geom->shape]);
  if (c->by_names) { /* URDF has no more of it */
    return;
  }
  vectors_compare(c, "friction of geom", name, &geom->friction, geoms->friction + 3 * g, 1);
  flags_compare(c, "contype", name, geom->category_bits, (uint32_t)geoms->contype[g]);
  flags_compare(c, "conaffinity", name, geom->collide_bits, (uint32_t)geoms->conaffinity[g]);
  static const double grey[4] = {0.5, 0.5, 0.5, 1.0};
  const bool is_default = memcmp(geoms->rgba + 4 * (ptrdiff_t)g, grey, sizeof grey) == 0;
  for (int k = 0; k < 4; ++k) {
    const int material = geoms->material[g];
    const double *rgba = material < 0 || !is_default
                             ? geoms->rgba + 4 * (ptrdiff_t)g
                             : geoms->material_rgba + 4 * (ptrdiff_t)material;
    const double colour = (double)geom->colour_rgba[k];
    if (!(fabs(colour - rgba[k]) < NEAR)) {
      number_differs(c, "colour", name, colour, rgba[k]);
    }
  }
}

static void field_compare(const comparing *c, const import_geom *geom, int g)
{
  const oracle_geoms *geoms = &c->theirs->geoms;
  const int f = geoms->data[g];
  const int rows = geoms->field_rows[f];
  const int columns = geoms->field_columns[f];
  flags_compare(c, "rows of field", geom->name, geom->field->rows, rows);
  flags_compare(c, "columns of field", geom->name, geom->field->columns, columns);
  for (int i = 0; i < rows * columns && c->out->differ == 0; ++i) {
    const double height =
        geoms->field_data[geoms->field_at[f] + i] * geoms->field_size[4 * (ptrdiff_t)f + 2];
    vectors_compare(c, "height of field", geom->name, geom->field->heights + i, &height, 1);
  }
}

static void body_compare(const comparing *c, const import_body *body, int i)
{
  const oracle_bodies *bodies = &c->theirs->bodies;
  int j = bodies->joint_at[i];
  int g = bodies->geom_at[i];
  const int last_joint = j + bodies->joint_count[i];
  const int last_geom = g + bodies->geom_count[i];
  vectors_compare(c, "place", body->name, body->pose_world.position, bodies->xpos + 3 * i, 3);
  turn_compare(c, "turn", body->name, body->pose_world.quat_wxyz, bodies->xquat + 4 * i);
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
    if (geom->shape == IMPORT_FIELD && c->theirs->geoms.type[g] == ORACLE_FIELD) {
      field_compare(c, geom, g);
    }
  }
  if (g >= 0 && g < last_geom) {
    number_differs(c, "number of geoms", body->name, g, last_geom);
  }
}

/* -1: none. */
static int body_find(const oracle_bodies *bodies, const char *name)
{
  int i = bodies->count - 1;
  while (i >= 0 && strcmp(bodies->names[i], name) != 0) {
    --i;
  }
  return i;
}

static void model_compare(const comparing *c, const import_model *ours)
{
  const oracle_bodies *bodies = &c->theirs->bodies;
  int count = 0;
  vectors_compare(c, "gravity", ours->name, ours->gravity, c->theirs->gravity, 3);
  for (const import_body *body = ours->bodies; body != NULL; body = body->next) {
    if (c->by_names && count > 0 && strcmp(body->name, "world") == 0) {
      continue; /* MuJoCo takes a root of that name for its own */
    }
    const int i = !c->by_names || count == 0 ? count : body_find(bodies, body->name);
    if (i < 0 || i >= bodies->count) {
      number_differs(c, "number of bodies", body->name, 1 + count, bodies->count);
      return;
    }
    body_compare(c, body, i);
    ++count;
  }
  flags_compare(c, "number of bodies", ours->name, count, bodies->count);
}

bool scene_oracle_is_there(void)
{
  return oracle_node_is_there() || oracle_library_is_there();
}

bool scene_oracle(const char *path, const import_model *ours, const oracle_notes *notes,
                  oracle_found *out)
{
  oracle_model theirs;
  memset(out, 0, sizeof *out);
  const char *end = strrchr(path, '.');
  const bool is_there = oracle_node_is_there()
                            ? oracle_node_read(path, &theirs, out->first, sizeof out->first)
                            : oracle_library_read(path, &theirs, out->first, sizeof out->first);
  if (!is_there) {
    return false;
  }
  out->first[0] = '\0'; /* a warning */
  const bool urdf = ours->bodies->next != NULL && strcmp(ours->bodies->name, "") == 0;
  const comparing c = {&theirs, urdf || (end != NULL && strcmp(end, ".urdf") == 0), notes, out};
  model_compare(&c, ours);
  oracle_model_free(&theirs);
  return true;
}

#ifdef HAPODE_ORACLE

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

#else

bool scene_oracle_move(const char *path, double seconds, size_t body, double out_position[3])
{
  (void)path, (void)seconds, (void)body, (void)out_position;
  return false;
}

#endif
