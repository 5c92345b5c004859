/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_UNKNOWN_SHAPE_H
#define HAPODE_TESTS_UNKNOWN_SHAPE_H

/* A geom that touches nothing, of a shape that the loop does not know on a body: the body that has
 * it is moved by what testing simulations say. */

#include <ode/ode.h>

static inline void add_unknown_shape(dSpaceID space, dBodyID body)
{
  static const double heights[] = {0.0, 0.0, 0.0, 0.0};
  dHeightfieldDataID data = dGeomHeightfieldDataCreate();
  dGeomHeightfieldDataBuildDouble(data, heights, 0, 0.01, 0.01, 2, 2, 1.0, 0.0, 0.01, 0);
  dGeomID geom = dCreateHeightfield(space, data, 1);
  dGeomSetCategoryBits(geom, 0);
  dGeomSetCollideBits(geom, 0);
  dGeomSetBody(geom, body);
}

#endif
