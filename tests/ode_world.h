/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_ODE_WORLD_H
#define HAPODE_TESTS_ODE_WORLD_H

/* What the worlds of the tests share: an ODE world, bodies, a session over them. What cannot be
 * made ends the test. Include after tap.h. */

#include <hapode/hapode.h>
#include <hapode/ode.h>

#include "tools/session_defs.h"

#define AT(x, y, z) ((const double[3]){(x), (y), (z)})

static const hap_model all_models[4] = {HAP_MODEL_SINGLE, HAP_MODEL_IMPULSE, HAP_MODEL_ACCELERANCE,
                                        HAP_MODEL_CONTACT};

static inline void ode_world_make(double gravity, dWorldID *out_world, dSpaceID *out_space)
{
  *out_world = dWorldCreate();
  *out_space = dHashSpaceCreate(NULL);
  dWorldSetGravity(*out_world, 0.0, 0.0, -gravity);
}

/* Contacts without compliance, a layer in which they rest without push. */
static inline void ode_world_stiffen(dWorldID world, int iterations)
{
  dWorldSetCFM(world, 1e-12);
  dWorldSetERP(world, 0.2);
  dWorldSetContactSurfaceLayer(world, 1e-4);
  dWorldSetQuickStepNumIterations(world, iterations);
}

static inline void ode_geom_end(dGeomID geom)
{
  bool mesh = dGeomGetClass(geom) == dTriMeshClass;
  bool field = dGeomGetClass(geom) == dHeightfieldClass;
  dTriMeshDataID mesh_data = mesh ? dGeomTriMeshGetTriMeshDataID(geom) : NULL;
  dHeightfieldDataID field_data = field ? dGeomHeightfieldGetHeightfieldData(geom) : NULL;
  dGeomDestroy(geom);
  if (mesh) {
    dGeomTriMeshDataDestroy(mesh_data);
  }
  if (field) {
    dGeomHeightfieldDataDestroy(field_data);
  }
}

/* Data of meshes and heightfields that are left in the space go as well; each geom has its own.
 * world: NULL when it is gone already. */
static inline void ode_world_end(hap_session *session, dWorldID world, dSpaceID space)
{
  if (world != NULL) {
    hap_session_destroy(session);
    while (dSpaceGetNumGeoms(space) > 0) {
      ode_geom_end(dSpaceGetGeom(space, 0));
    }
    dSpaceDestroy(space);
    dWorldDestroy(world);
  }
}

/* geom: may be NULL. */
static inline dBodyID ode_body(dWorldID world, dGeomID geom, const dMass *mass, const double at[3])
{
  dBodyID body = dBodyCreate(world);
  dBodySetMass(body, mass);
  dBodySetPosition(body, at[0], at[1], at[2]);
  if (geom != NULL) {
    dGeomSetBody(geom, body);
  }
  return body;
}

static inline dBodyID ode_box(dWorldID world, dSpaceID space, double mass, const double edges[3],
                              const double at[3])
{
  dMass m;
  dMassSetBoxTotal(&m, mass, edges[0], edges[1], edges[2]);
  return ode_body(world, dCreateBox(space, edges[0], edges[1], edges[2]), &m, at);
}

static inline dBodyID ode_ball(dWorldID world, dSpaceID space, double mass, double radius,
                               const double at[3])
{
  dMass m;
  dMassSetSphereTotal(&m, mass, radius);
  return ode_body(world, dCreateSphere(space, radius), &m, at);
}

static inline hap_session *session_make(const hap_session_def *def, const hap_ode_def *ode)
{
  hap_detail detail = {""};
  hap_session *session = NULL;
  REQUIRE_SAY(hap_session_create(def, ode, &session, &detail) >= HAP_OK, "%s", detail.text);
  return session;
}

static inline void session_run(hap_session *session)
{
  hap_detail detail = {""};
  bool good = hap_session_start(session) == HAP_OK;
  (void)hap_session_detail(session, &detail);
  REQUIRE_SAY(good, "%s", detail.text);
}

static inline hap_stats session_stats(const hap_session *session)
{
  hap_stats stats;
  memset(&stats, 0, sizeof stats);
  CHECK(hap_session_stats(session, &stats, sizeof stats) == HAP_OK);
  return stats;
}

#endif
