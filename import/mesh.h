/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_IMPORT_MESH_H
#define HAPODE_IMPORT_MESH_H

#include "import/model.h"

/* The hull of points as triangles. NULL: they are in a plane, there is no memory, or this build has
 * no qhull; *out_why says which. */
const import_mesh *import_hull(import_work *work, const double *points_xyz, size_t count,
                               const char **out_why);

/* Of the volume that triangles enclose, of uniform density, as MuJoCo's compiler finds it: each
 * triangle's pyramid counts as positive, from the middle of the surface and from the centre of
 * mass. Exact for what is convex. */
void import_mesh_mass(const import_mesh *mesh, double density, import_mass *out);

/* The hull of an ellipsoid. */
const import_mesh *import_ellipsoid(import_work *work, const double half_axes[3],
                                    const char **out_why);

#endif
