/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_SOLIDS_H
#define HAPODE_TESTS_SOLIDS_H

/* Geoms that read arrays of the application: boxes of corners, and ground of triangles. The arrays
 * outlive the world, so that most are static; ode_world_end destroys ODE's data. */

#include <math.h>
#include <string.h>

#include <ode/ode.h>

/* ---- boxes ---- */

/* Bit k of a corner's index: on which side it is along axis k. */
typedef struct box_arrays {
  double corners[24];
  double planes[24];
} box_arrays;

static const unsigned box_faces[30] = {4, 0, 2, 3, 1, 4, 4, 5, 7, 6, 4, 0, 1, 5, 4,
                                       4, 2, 6, 7, 3, 4, 0, 4, 6, 2, 4, 1, 3, 7, 5};
static const dTriIndex box_triangles[36] = {0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5, 0, 1, 5, 0, 5, 4,
                                            2, 6, 7, 2, 7, 3, 0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6};

static inline void box_corners(const double half[3], const double middle[3], double out[24])
{
  for (int i = 0; i < 24; ++i) {
    int axis = i % 3;
    out[i] = middle[axis] + ((i / 3 >> axis & 1) != 0 ? half[axis] : -half[axis]);
  }
}

static inline dGeomID convex_box(dSpaceID space, box_arrays *box, const double half[3])
{
  static const double middle[3] = {0.0, 0.0, 0.0};
  box_corners(half, middle, box->corners);
  for (int i = 0; i < 6; ++i) { /* as in box_faces: down and up, then along y and x */
    int axis = 2 - i / 2;
    for (int k = 0; k < 3; ++k) {
      box->planes[4 * i + k] = k != axis ? 0.0 : i % 2 == 0 ? -1.0 : 1.0;
    }
    box->planes[4 * i + 3] = half[axis];
  }
  return dCreateConvex(space, box->planes, 6, box->corners, 8, box_faces);
}

/* ---- triangles ---- */

static inline dGeomID mesh_create(dSpaceID space, const double *corners, int corner_count,
                                  const dTriIndex *indices, int index_count)
{
  dTriMeshDataID data = dGeomTriMeshDataCreate();
  dGeomTriMeshDataBuildDouble(data, corners, 3 * sizeof(double), corner_count, indices, index_count,
                              3 * sizeof(dTriIndex));
  return dCreateTriMesh(space, data, NULL, NULL, NULL);
}

static inline dGeomID mesh_box(dSpaceID space, box_arrays *box, const double half[3])
{
  static const double middle[3] = {0.0, 0.0, 0.0};
  box_corners(half, middle, box->corners);
  return mesh_create(space, box->corners, 8, box_triangles, 36);
}

/* Level, at z = 0, 2 m wide. */
static inline dGeomID mesh_floor(dSpaceID space)
{
  static const double corners[] = {-1.0, -1.0, 0.0, 1.0, -1.0, 0.0, 1.0, 1.0, 0.0, -1.0, 1.0, 0.0};
  static const dTriIndex indices[] = {0, 1, 2, 0, 2, 3};
  return mesh_create(space, corners, 4, indices, 6);
}

/* ---- thin things ---- */

typedef enum sheet_kind {
  SHEET_BOX,
  SHEET_CYLINDER,
  SHEET_CONVEX,
  SHEET_MESH,
  SHEET_KINDS
} sheet_kind;

static const char *const sheet_names[] = {"box", "cylinder", "convex", "mesh"};

/* Its upper side at z = 0. */
static inline dGeomID sheet_create(dSpaceID space, box_arrays *box, sheet_kind kind, double width,
                                   double thickness)
{
  const double half[3] = {0.5 * width, 0.5 * width, 0.5 * thickness};
  dGeomID geom = NULL;
  switch (kind) {
    case SHEET_BOX:
      geom = dCreateBox(space, width, width, thickness);
      break;
    case SHEET_CYLINDER:
      geom = dCreateCylinder(space, 0.5 * width, thickness);
      break;
    case SHEET_CONVEX:
      geom = convex_box(space, box, half);
      break;
    default:
      geom = mesh_box(space, box, half);
  }
  dGeomSetPosition(geom, 0.0, 0.0, -0.5 * thickness);
  return geom;
}

/* ---- ground over a square grid about the origin ---- */

#define GRID_CELLS_MAX 40

typedef struct grid {
  int cells;   /* along a side */
  double cell; /* m */
  double heights[(GRID_CELLS_MAX + 1) * (GRID_CELLS_MAX + 1)];
  double corners[(GRID_CELLS_MAX + 1) * (GRID_CELLS_MAX + 1) * 3];
  dTriIndex indices[GRID_CELLS_MAX * GRID_CELLS_MAX * 6];
} grid;

/* i counts along x, k against y, which is along the z of a heightfield. */
typedef double (*grid_height)(int i, int k);

static inline double grid_level(int i, int k)
{
  (void)i;
  (void)k;
  return 0.0;
}

static inline void grid_fill(grid *g, int cells, double cell, grid_height height)
{
  g->cells = cells;
  g->cell = cell;
  for (int k = 0; k <= cells; ++k) {
    for (int i = 0; i <= cells; ++i) {
      g->heights[k * (cells + 1) + i] = height(i, k);
    }
  }
}

/* Upright: its y is the world's z. */
static inline dGeomID grid_field(dSpaceID space, grid *g)
{
  dMatrix3 upright;
  double width = g->cells * g->cell;
  dHeightfieldDataID data = dGeomHeightfieldDataCreate();
  dGeomHeightfieldDataBuildDouble(data, g->heights, 0, width, width, g->cells + 1, g->cells + 1,
                                  1.0, 0.0, 1.0, 0);
  dGeomID geom = dCreateHeightfield(space, data, 1);
  dRFromAxisAndAngle(upright, 1.0, 0.0, 0.0, 0.5 * M_PI);
  dGeomSetRotation(geom, upright);
  return geom;
}

/* The same triangles. */
static inline dGeomID grid_mesh(dSpaceID space, grid *g)
{
  int row = g->cells + 1;
  dTriIndex *at = g->indices;
  for (int n = 0; n < row * row; ++n) {
    int i = n % row;
    int k = n / row;
    g->corners[3 * n] = g->cell * (i - 0.5 * g->cells);
    g->corners[3 * n + 1] = g->cell * (0.5 * g->cells - k);
    g->corners[3 * n + 2] = g->heights[n];
  }
  for (int n = 0; n < g->cells * g->cells; ++n) {
    dTriIndex a = (dTriIndex)(n / g->cells * row + n % g->cells);
    dTriIndex b = a + (dTriIndex)row;
    const dTriIndex cell[6] = {a, b, a + 1, a + 1, b, b + 1};
    memcpy(at, cell, sizeof cell);
    at += 6;
  }
  return mesh_create(space, g->corners, row * row, g->indices, 6 * g->cells * g->cells);
}

#endif
