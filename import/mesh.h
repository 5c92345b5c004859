/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_IMPORT_MESH_H
#define HAPODE_IMPORT_MESH_H

#include "import/model.h"

/* The hull of points as triangles. NULL: they are in a plane, there is no memory, or this build has
 * no qhull; *out_why says which. */
const import_mesh *import_hull(import_work *work, const double *points_xyz, size_t count,
                               const char **out_why);

/* How the mass of a mesh is found from its triangles. */
typedef enum import_filling {
  IMPORT_FILLED_TWICE = 0, /* each triangle's pyramid counts as positive, from the middle of the
                              surface: MuJoCo's default, exact for what is convex */
  IMPORT_FILLED,           /* the volume; the triangles are closed and turn the same way */
  IMPORT_SHELL             /* the surface; density in kg/m^2 */
} import_filling;

/* Of uniform density, as MuJoCo's compiler finds it. mass 0: there is none. */
void import_mesh_mass(const import_mesh *mesh, import_filling filling, double density,
                      import_mass *out);

/* The hull of an ellipsoid. */
const import_mesh *import_ellipsoid(import_work *work, const double half_axes[3],
                                    const char **out_why);

#endif
