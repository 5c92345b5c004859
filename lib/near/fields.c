/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/assert.h"
#include "base/vec.h"
#include "near/fields.h"
#include "near/near.h"

/* Heightfields as triangles. ODE tells the heights to nobody, but a vertical ray meets the very
 * triangle: a ray through the middle of each triangle of a cell gives its plane, and so the heights
 * of its corners. Heights may change at any time, so nothing is kept.
 *
 * The lengths of the cells are what ODE does not tell at all, and on level ground nothing shows
 * them. They stand at the begin of ODE's record of the field, before anything else: width and depth
 * of the field, then those of a cell. A record that is laid out otherwise is noticed: width and
 * depth are in the field's box as well, a field has a whole number of cells, and all triangles that
 * meet at a corner must give it the same height. The field's triangles are unknown then. */

#define CELLS_MOST (0.5 * HAPI_NEAR_TRIANGLES) /* that are looked at */
#define FAR_CELL 1e9
#define SAME 1e-9     /* of a length */
#define HIGH_MOST 1e5 /* m: of heights that a callback gives, and that have no bounds */

/* In the field's frame, whose y is up. */
typedef struct field_grid {
  dGeomID level; /* the same field, in no space, where it is not placed */
  double half[2];
  double cell[2];
  int64_t cells[2];
  bool wraps;
  double top;
  double bottom;
} field_grid;

typedef struct field_range {
  int64_t from[2];
  int64_t to[2]; /* one beyond the last cell */
} field_range;

bool hapi_geom_has_triangles(dGeomID geom)
{
  return dGeomGetClass(geom) == dTriMeshClass || dGeomGetClass(geom) == dHeightfieldClass;
}

static bool nearly_same(double a, double b)
{
  return fabs(a - b) <= SAME * (fabs(a) + fabs(b));
}

/* False: ODE's record is not what it was taken for. grid->level is to be destroyed all the same. */
static bool grid_read(dGeomID geom, field_grid *grid)
{
  dHeightfieldDataID data = dGeomHeightfieldGetHeightfieldData(geom);
  const dReal *record = (const dReal *)(const void *)data;
  dReal box[6];
  grid->level = dCreateHeightfield(NULL, data, 0);
  dGeomGetAABB(grid->level, box);
  grid->wraps = box[1] == dInfinity;
  grid->top = fmin(box[3], HIGH_MOST);
  grid->bottom = fmax(box[2], -HIGH_MOST);
  for (int k = 0; k < 2; ++k) {
    double length = record[k];
    double count = length / record[2 + k];
    grid->half[k] = 0.5 * length;
    grid->cell[k] = record[2 + k];
    if (!(count > 0.5 && count < 1e9) || !nearly_same(count, round(count)) ||
        (!grid->wraps && !nearly_same(length, box[4 * k + 1] - box[4 * k]))) {
      return false;
    }
    grid->cells[k] = (int64_t)round(count);
  }
  return true;
}

/* How many cells a box of the field's frame lies over; *out: up to CELLS_MOST of them. */
static double range_of_box(const field_grid *grid, const double box[6], field_range *out)
{
  double count = 1.0;
  for (int k = 0; k < 2; ++k) {
    double from = floor((box[4 * k] + grid->half[k]) / grid->cell[k]);
    double to = floor((box[4 * k + 1] + grid->half[k]) / grid->cell[k]) + 1.0;
    from = grid->wraps ? from : fmax(from, 0.0);
    to = grid->wraps ? to : fmin(to, (double)grid->cells[k]);
    count *= fmax(to - from, 0.0);
    out->from[k] = (int64_t)fmax(fmin(from, FAR_CELL), -FAR_CELL);
    out->to[k] = out->from[k] + (int64_t)fmin(fmax(to - from, 0.0), CELLS_MOST);
  }
  return count;
}

/* A corner of the grid, without its height. */
static void grid_corner(const field_grid *grid, int64_t i, int64_t k, double out[3])
{
  out[0] = (double)i * grid->cell[0] - grid->half[0];
  out[1] = 0.0;
  out[2] = (double)k * grid->cell[1] - grid->half[1];
}

/* The triangle's plane, above a place of the field's frame. */
static bool ray_below(dGeomID ray, const field_grid *grid, const double place[3], double point[3],
                      double normal[3])
{
  dContactGeom contact;
  double from = grid->top + grid->cell[0];
  dGeomRaySetLength(ray, from - grid->bottom + grid->cell[0]);
  dGeomRaySet(ray, place[0], from, place[2], 0.0, -1.0, 0.0);
  if (dCollide(ray, grid->level, 1, &contact, sizeof contact) < 1 ||
      !hapi_contact_is_sound(&contact) || fabs(contact.normal[1]) < SAME) {
    return false;
  }
  hapi_v3_copy(contact.pos, point);
  hapi_v3_scale(contact.normal[1] < 0.0 ? -1.0 : 1.0, contact.normal, normal);
  return true;
}

/* Corners of a cell and of its triangles: ODE parts it from its second to its third one. */
static const int cell_corners[4][2] = {{0, 0}, {1, 0}, {0, 1}, {1, 1}};
static const int cell_triangles[2][3] = {{0, 2, 1}, {3, 1, 2}}; /* seen from above */

typedef struct field_patch {
  const field_grid *grid;
  field_range range;
  double *heights; /* of the range's corners */
} field_patch;

static double *patch_height(const field_patch *patch, int64_t i, int64_t k)
{
  int64_t row = patch->range.to[0] - patch->range.from[0] + 1;
  int64_t at = (k - patch->range.from[1]) * row + (i - patch->range.from[0]);
  HAPI_ASSERT_INDEX((uint64_t)at, HAPI_FIELD_CORNERS);
  return &patch->heights[at];
}

/* Heights of a triangle's corners, by a ray through its middle; those that are known must agree. */
static bool triangle_read(const field_patch *patch, dGeomID ray, int64_t i, int64_t k, int which)
{
  const field_grid *grid = patch->grid;
  double corners[3][3];
  double middle[3] = {0.0, 0.0, 0.0};
  double point[3];
  double normal[3];
  for (int c = 0; c < 3; ++c) {
    const int *corner = cell_corners[cell_triangles[which][c]];
    grid_corner(grid, i + corner[0], k + corner[1], corners[c]);
    hapi_v3_madd(middle, 1.0 / 3.0, corners[c], middle);
  }
  if (!ray_below(ray, grid, middle, point, normal)) {
    return false;
  }
  for (int c = 0; c < 3; ++c) {
    const int *corner = cell_corners[cell_triangles[which][c]];
    double *height = patch_height(patch, i + corner[0], k + corner[1]);
    double found = point[1] - (normal[0] * (corners[c][0] - point[0]) +
                               normal[2] * (corners[c][2] - point[2])) /
                                  normal[1];
    double slack = SAME * (grid->top - grid->bottom + fabs(found) +
                           (grid->cell[0] + grid->cell[1]) / normal[1]);
    if (isnan(*height)) {
      *height = found;
    } else if (!(fabs(found - *height) <= slack)) {
      return false;
    }
  }
  return true;
}

static bool patch_read(const field_patch *patch, dGeomID ray)
{
  for (uint32_t n = 0; n < HAPI_FIELD_CORNERS; ++n) {
    patch->heights[n] = NAN;
  }
  for (int64_t k = patch->range.from[1]; k < patch->range.to[1]; ++k) {
    for (int64_t i = patch->range.from[0]; i < patch->range.to[0]; ++i) {
      if (!triangle_read(patch, ray, i, k, 0) || !triangle_read(patch, ray, i, k, 1)) {
        return false;
      }
    }
  }
  return true;
}

/* The triangles of the patch that meet the box, in the field's frame. */
static uint32_t patch_triangles(const field_patch *patch, const double box[6],
                                hapi_near_triangle *out)
{
  uint32_t found = 0;
  for (int64_t k = patch->range.from[1]; k < patch->range.to[1]; ++k) {
    for (int64_t i = patch->range.from[0]; i < patch->range.to[0]; ++i) {
      for (uint32_t which = 0; which < 2; ++which) {
        double *corners = out[found].corners;
        double lowest = HUGE_VAL;
        double highest = -HUGE_VAL;
        for (int c = 0; c < 3; ++c) {
          const int *corner = cell_corners[cell_triangles[which][c]];
          grid_corner(patch->grid, i + corner[0], k + corner[1], corners + 3 * c);
          corners[3 * c + 1] = *patch_height(patch, i + corner[0], k + corner[1]);
          lowest = fmin(lowest, corners[3 * c + 1]);
          highest = fmax(highest, corners[3 * c + 1]);
        }
        if (lowest <= box[3] && highest >= box[2]) {
          out[found++].index = ((uint32_t)k & 0x7fffu) << 17 | ((uint32_t)i & 0xffffu) << 1 | which;
        }
      }
    }
  }
  HAPI_ASSERT(found <= HAPI_NEAR_TRIANGLES);
  return found;
}

static uint32_t field_near(hapi_nearby *nearby, dGeomID geom, const double box[6])
{
  hapi_meshes *meshes = &nearby->meshes;
  field_grid grid;
  field_patch patch = {.grid = &grid, .heights = meshes->heights};
  double local[6] = {0.0};
  uint32_t found = 0;
  for (int i = 0; i < 8; ++i) { /* a box of the field's frame that holds it */
    dVector3 at;
    dGeomGetPosRelPoint(geom, box[i & 1], box[2 + ((i >> 1) & 1)], box[4 + ((i >> 2) & 1)], at);
    for (int k = 0; k < 3; ++k) {
      local[2 * k] = i == 0 ? at[k] : fmin(local[2 * k], at[k]);
      local[2 * k + 1] = i == 0 ? at[k] : fmax(local[2 * k + 1], at[k]);
    }
  }
  bool known = grid_read(geom, &grid);
  double count = known ? range_of_box(&grid, local, &patch.range) : 0.0;
  known = known && count <= CELLS_MOST;
  if (known && count > 0.0) {
    known = patch_read(&patch, nearby->neighbors.ray_geom);
    found = known ? patch_triangles(&patch, local, meshes->found) : 0;
  }
  dGeomDestroy(grid.level);
  if (!known) {
    ++nearby->counts.dropped;
    if (count <= CELLS_MOST) {
      hapi_say_once(nearby->cycle, &meshes->said_unknown,
                    "the cells of a heightfield cannot be found: bodies on it are measured, which "
                    "is less accurate");
    }
    return HAPI_NEAR_TRIANGLES;
  }
  hapi_meshes_join(meshes, found, local);
  for (uint32_t i = 0; i < found; ++i) {
    for (int k = 0; k < 3; ++k) {
      double *corner = meshes->found[i].corners + 3 * k;
      dVector3 at;
      dGeomGetRelPointPos(geom, corner[0], corner[1], corner[2], at);
      hapi_v3_copy(at, corner);
    }
  }
  return found;
}

uint32_t hapi_triangles_near(hapi_nearby *nearby, dGeomID geom, const double box[6], uint64_t walk)
{
  HAPI_ASSERT(hapi_geom_has_triangles(geom));
  return dGeomGetClass(geom) == dTriMeshClass ? hapi_mesh_near(nearby, geom, box, walk)
                                              : field_near(nearby, geom, box);
}
