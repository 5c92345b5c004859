/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Worlds and runs of hapode-bench faults: what is made, and its end. */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bench/faults_build.h"

void faults_gravity(faults_world *w)
{
  dWorldSetGravity(w->world, 0.0, 0.0, -9.81);
}

dBodyID faults_body(faults_world *w, double mass, const double size[3], const double at[3])
{
  dMass m;
  dBodyID body = dBodyCreate(w->world);
  dMassSetBoxTotal(&m, mass, size[0], size[1], size[2]);
  dBodySetMass(body, &m);
  dBodySetPosition(body, at[0], at[1], at[2]);
  w->bodies[w->body_count++] = body;
  return body;
}

dGeomID faults_box(faults_world *w, dBodyID body, const double size[3], const double at[3])
{
  dGeomID box = dCreateBox(w->space, size[0], size[1], size[2]);
  if (body != NULL) {
    dGeomSetBody(box, body);
  } else {
    dGeomSetPosition(box, at[0], at[1], at[2]);
  }
  return box;
}

/* A way with soft ends. */
static void hand_glide(const faults_glide *g, double t, double *io_position, double *io_velocity)
{
  double u = fmin(fmax((t - g->begin) / (g->end - g->begin), 0.0), 1.0);
  *io_position += g->way * u * u * u * (10.0 + u * (6.0 * u - 15.0));
  *io_velocity += g->way * 30.0 * u * u * (1.0 - u) * (1.0 - u) / (g->end - g->begin);
}

void faults_hand(const faults_motion *motion, double t, double out_position[3],
                 double out_velocity[3])
{
  const faults_path *path = motion->path;
  for (int k = 0; k < 3; ++k) {
    out_position[k] = path != NULL ? path->from[k] : 0.0;
    out_velocity[k] = 0.0;
  }
  for (int i = 0; path != NULL && i < FAULTS_GLIDES && path->glides[i].way != 0.0; ++i) {
    const faults_glide *glide = &path->glides[i];
    hand_glide(glide, t, &out_position[glide->axis], &out_velocity[glide->axis]);
  }
  if (motion->hand != NULL) {
    motion->hand(t, out_position, out_velocity);
  }
}

double faults_world_open(const faults_world *w)
{
  double widest = 0.0;
  for (size_t i = 0; i < w->hinge_count; ++i) {
    dVector3 a;
    dVector3 b;
    dJointGetHingeAnchor(w->hinges[i], a);
    dJointGetHingeAnchor2(w->hinges[i], b);
    widest = fmax(widest, hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]));
  }
  return widest;
}

bool faults_world_create(const faults_scene *scene, bool is_reference, faults_world *out)
{
  memset(out, 0, sizeof *out);
  out->scene = scene;
  out->is_reference = is_reference;
  out->world = dWorldCreate();
  out->space = dHashSpaceCreate(NULL);
  out->own_contacts = dJointGroupCreate(0);
  out->mu = 0.5;
  dWorldSetContactSurfaceLayer(out->world, FAULTS_LAYER);
  scene->build(out);
  return true;
}

void faults_world_destroy(faults_world *w)
{
  if (w->world == NULL) {
    return;
  }
  dJointGroupDestroy(w->own_contacts);
  dSpaceDestroy(w->space);
  dWorldDestroy(w->world);
  if (w->mesh_data != NULL) {
    dGeomTriMeshDataDestroy(w->mesh_data);
  }
  if (w->field_data != NULL) {
    dGeomHeightfieldDataDestroy(w->field_data);
  }
  free(w->mesh.vertices);
  free(w->mesh.indices);
  free(w->field);
  memset(w, 0, sizeof *w);
}

bool faults_run_create(const faults_scene *scene, faults_run *out)
{
  memset(out, 0, sizeof *out);
  out->count = (size_t)(scene->seconds / FAULTS_TICK_S + 0.5);
  out->force = calloc(out->count, sizeof *out->force);
  out->told = calloc(out->count, sizeof *out->told);
  if (out->force == NULL || out->told == NULL) {
    faults_run_free(out);
    return false;
  }
  return true;
}

void faults_run_free(faults_run *r)
{
  free(r->force);
  free(r->told);
  memset(r, 0, sizeof *r);
}
