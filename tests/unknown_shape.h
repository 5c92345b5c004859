/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_UNKNOWN_SHAPE_H
#define HAPODE_TESTS_UNKNOWN_SHAPE_H

/* A geom that touches nothing, of a shape that the loop does not know: the body that has it is
 * moved by what testing simulations say. */

#include <ode/ode.h>

/* Its data are to be destroyed after the geom. */
static inline dTriMeshDataID add_unknown_shape(dSpaceID space, dBodyID body)
{
  static const double corners[] = {0.0, 0.0, 0.0, 0.01, 0.0, 0.0, 0.0, 0.01, 0.0};
  static const dTriIndex triangle[] = {0, 1, 2};
  dTriMeshDataID data = dGeomTriMeshDataCreate();
  dGeomTriMeshDataBuildDouble(data, corners, 3 * (int)sizeof(double), 3, triangle, 3,
                              3 * (int)sizeof(dTriIndex));
  dGeomID geom = dCreateTriMesh(space, data, NULL, NULL, NULL);
  dGeomSetCategoryBits(geom, 0);
  dGeomSetCollideBits(geom, 0);
  dGeomSetBody(geom, body);
  return data;
}

#endif
