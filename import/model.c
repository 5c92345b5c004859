/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "import/model.h"

#include <math.h>
#include <string.h>

#include "base/pose.h"
#include "base/vec.h"

import_body *import_find_body(const import_model *model, const char *name)
{
  for (import_body *body = model->bodies; body != NULL; body = body->next) {
    if (strcmp(body->name, name) == 0) {
      return body;
    }
  }
  return NULL;
}

void import_pose_join(const hap_pose *a, const hap_pose *b, hap_pose *out)
{
  hap_pose joined = {{0.0}, {0.0}};
  hapi_pose_point(a->position, a->quat_wxyz, b->position, joined.position);
  hapi_quat_multiply(a->quat_wxyz, b->quat_wxyz, joined.quat_wxyz);
  hapi_quat_normalize(joined.quat_wxyz);
  *out = joined;
}

void import_mass_place(const hap_pose *pose, const import_mass *mass, import_mass *out)
{
  double r[9];
  import_mass placed = {.mass = mass->mass};
  hapi_pose_point(pose->position, pose->quat_wxyz, mass->centre, placed.centre);
  hapi_quat_to_matrix(pose->quat_wxyz, r);
  hapi_m3_turn(r, mass->inertia, placed.inertia);
  *out = placed;
}

/* Steiner's share of a mass whose centre is d away. */
static void inertia_shift(double mass, const double d[3], double io[9])
{
  double square = hapi_v3_dot(d, d);
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      io[3 * i + k] += mass * ((i == k ? square : 0.0) - d[i] * d[k]);
    }
  }
}

void import_mass_add(import_mass *io, const import_mass *more)
{
  import_mass sum = {.mass = io->mass + more->mass};
  double d[3];
  if (!(more->mass > 0.0)) {
    return;
  }
  for (int k = 0; k < 3; ++k) {
    sum.centre[k] = (io->mass * io->centre[k] + more->mass * more->centre[k]) / sum.mass;
  }
  for (int k = 0; k < 9; ++k) {
    sum.inertia[k] = io->inertia[k] + more->inertia[k];
  }
  hapi_v3_sub(io->centre, sum.centre, d);
  inertia_shift(io->mass, d, sum.inertia);
  hapi_v3_sub(more->centre, sum.centre, d);
  inertia_shift(more->mass, d, sum.inertia);
  *io = sum;
}

void import_mass_scale(import_mass *io, double factor)
{
  io->mass *= factor;
  for (int k = 0; k < 9; ++k) {
    io->inertia[k] *= factor;
  }
}

static double capsule_mass(double r, double length, double density, double *out_across,
                           double *out_along)
{
  double cylinder = density * M_PI * r * r * length;
  double caps = density * M_PI * r * r * r * 4.0 / 3.0;
  *out_along = 0.5 * cylinder * r * r + 0.4 * caps * r * r;
  *out_across = cylinder * (r * r / 4.0 + length * length / 12.0) +
                caps * (0.4 * r * r + 0.375 * r * length + length * length / 4.0);
  return cylinder + caps;
}

void import_shape_mass(import_shape shape, const double size[3], double density, import_mass *out)
{
  const double a = size[0];
  const double b = size[1];
  const double c = size[2];
  double m = 0.0;
  double d[3] = {0.0};
  switch (shape) {
    case IMPORT_SPHERE:
      m = density * M_PI * a * a * a * 4.0 / 3.0;
      d[0] = d[1] = d[2] = 0.4 * m * a * a;
      break;
    case IMPORT_CAPSULE:
      m = capsule_mass(a, 2.0 * b, density, &d[0], &d[2]);
      d[1] = d[0];
      break;
    case IMPORT_CYLINDER:
      m = density * M_PI * a * a * 2.0 * b;
      d[0] = d[1] = m * (a * a / 4.0 + b * b / 3.0);
      d[2] = 0.5 * m * a * a;
      break;
    case IMPORT_BOX:
    case IMPORT_ELLIPSOID: {
      double share = shape == IMPORT_BOX ? 3.0 : 5.0;
      m = density * a * b * c * (shape == IMPORT_BOX ? 8.0 : M_PI * 4.0 / 3.0);
      d[0] = m * (b * b + c * c) / share;
      d[1] = m * (a * a + c * c) / share;
      d[2] = m * (a * a + b * b) / share;
      break;
    }
    case IMPORT_PLANE:
    case IMPORT_MESH:
    case IMPORT_FIELD:
      break;
  }
  *out = (import_mass){.mass = m, .inertia = {d[0], 0.0, 0.0, 0.0, d[1], 0.0, 0.0, 0.0, d[2]}};
}

void import_model_settle(import_model *model)
{
  for (import_body *body = model->bodies; body != NULL; body = body->next) {
    if (body->parent == NULL) {
      body->pose_world = body->pose;
    } else {
      import_pose_join(&body->parent->pose_world, &body->pose, &body->pose_world);
    }
    for (const import_geom *geom = body->geoms; geom != NULL && !body->mass_given;
         geom = geom->next) {
      import_mass_add(&body->mass, &geom->mass);
    }
  }
}

void import_model_join(import_model *model)
{
  for (import_body *body = model->bodies; body != NULL; body = body->next) {
    body->whole = (import_mass){.mass = 0.0};
  }
  for (import_body *body = model->bodies; body != NULL; body = body->next) {
    hap_pose inside;
    import_mass placed;
    body->carrier = body->parent == NULL || body->joints != NULL ? body : body->parent->carrier;
    const hap_pose *frame = &body->carrier->pose_world;
    hapi_pose_into(frame->position, frame->quat_wxyz, &body->pose_world, &inside);
    import_mass_place(&inside, &body->mass, &placed);
    import_mass_add(&body->carrier->whole, &placed);
  }
}
