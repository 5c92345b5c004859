/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"
#include "base/vec.h"
#include "near/near.h"
#include "proximity/triangle.h"
#include "sync/mesh_filter.h"

/* Triangles of static meshes near a box. ODE's own search keeps a cache that the whole process
 * shares, and gives contacts, not triangles; so the triangles are read once, in the order of the
 * mesh, with a box around every few of them. */

#define CHUNK 32u
#define SAMPLES 16u /* of a mesh, looked at in every walk */
#define FOUND_MAX HAPI_NEAR_TRIANGLES
#define FAN_MOST 64u /* triangles around a corner */

static void destroy_mesh(hapi_mesh *mesh)
{
  hapi_free(mesh->corners);
  hapi_free(mesh->boxes);
  memset(mesh, 0, sizeof *mesh);
}

void hapi_meshes_finish(hapi_meshes *meshes)
{
  for (uint32_t i = 0; i < meshes->count; ++i) {
    destroy_mesh(&meshes->meshes[i]);
  }
  hapi_free(meshes->meshes);
  memset(meshes, 0, sizeof *meshes);
}

void hapi_meshes_forget(hapi_meshes *meshes, dGeomID geom)
{
  for (uint32_t i = 0; i < meshes->count; ++i) {
    if (meshes->meshes[i].geom == geom) {
      destroy_mesh(&meshes->meshes[i]);
      meshes->meshes[i] = meshes->meshes[--meshes->count];
      return;
    }
  }
}

static void grow_box(double box[6], const double *point, bool first)
{
  for (int k = 0; k < 3; ++k) {
    box[2 * k] = first || point[k] < box[2 * k] ? point[k] : box[2 * k];
    box[2 * k + 1] = first || point[k] > box[2 * k + 1] ? point[k] : box[2 * k + 1];
  }
}

/* ODE gives the corners in the world: kept in the geom's frame, as the geom may be moved. */
static void read_triangle(dGeomID geom, uint32_t index, double out[9])
{
  dVector3 corners[3];
  dQuaternion quat;
  dGeomGetQuaternion(geom, quat);
  dGeomTriMeshGetTriangle(geom, (int)index, &corners[0], &corners[1], &corners[2]);
  for (int i = 0; i < 3; ++i) {
    hapi_pose_unpoint(dGeomGetPosition(geom), quat, corners[i], out + 3 * i);
  }
}

static bool read_mesh(dGeomID geom, hapi_mesh *mesh)
{
  uint32_t count = (uint32_t)dGeomTriMeshGetTriangleCount(geom);
  uint32_t chunks = (count + CHUNK - 1) / CHUNK;
  memset(mesh, 0, sizeof *mesh);
  mesh->corners = hapi_alloc_array(count, 9 * sizeof(double));
  mesh->boxes = hapi_alloc_array(chunks, 6 * sizeof(double));
  if (mesh->corners == NULL || mesh->boxes == NULL) {
    destroy_mesh(mesh);
    return false;
  }
  mesh->geom = geom;
  mesh->data = dGeomTriMeshGetTriMeshDataID(geom);
  mesh->count = count;
  for (uint32_t i = 0; i < count; ++i) {
    double *corners = mesh->corners + (size_t)9 * i;
    double *box = mesh->boxes + (size_t)6 * (i / CHUNK);
    read_triangle(geom, i, corners);
    for (int k = 0; k < 3; ++k) {
      grow_box(box, corners + 3 * k, i % CHUNK == 0 && k == 0);
    }
  }
  return true;
}

/* Some of its triangles are where they were: another mesh may have come to be at the address of
 * geom and data, or its corners may have been moved. */
static bool samples_agree(const hapi_mesh *mesh)
{
  const double *at = dGeomGetPosition(mesh->geom);
  double tolerance = 1e-9 * (1.0 + fabs(at[0]) + fabs(at[1]) + fabs(at[2]));
  for (uint32_t i = 0; i < SAMPLES; ++i) {
    uint32_t index = (uint32_t)((uint64_t)i * (mesh->count - 1) / (SAMPLES - 1));
    const double *kept = mesh->corners + (size_t)9 * index;
    double corners[9];
    read_triangle(mesh->geom, index, corners);
    for (int k = 0; k < 9; ++k) {
      if (!(fabs(corners[k] - kept[k]) <= tolerance + 1e-9 * fabs(kept[k]))) {
        return false;
      }
    }
  }
  return true;
}

static bool is_current(hapi_mesh *mesh, uint64_t walk)
{
  bool same = mesh->data == dGeomTriMeshGetTriMeshDataID(mesh->geom) &&
              mesh->count == (uint32_t)dGeomTriMeshGetTriangleCount(mesh->geom);
  if (!same || (mesh->checked_in != walk && mesh->count > 0 && !samples_agree(mesh))) {
    return false;
  }
  mesh->checked_in = walk;
  return true;
}

static const hapi_mesh *find_mesh(hapi_meshes *meshes, dGeomID geom, uint64_t walk)
{
  for (uint32_t i = 0; i < meshes->count; ++i) {
    hapi_mesh *mesh = &meshes->meshes[i];
    if (mesh->geom == geom && is_current(mesh, walk)) {
      return mesh;
    }
  }
  hapi_meshes_forget(meshes, geom);
  if (!hapi_reserve((void **)&meshes->meshes, &meshes->capacity, meshes->count, 1,
                    sizeof *meshes->meshes) ||
      !read_mesh(geom, &meshes->meshes[meshes->count])) {
    return NULL;
  }
  return &meshes->meshes[meshes->count++];
}

/* An edge is 3 x triangle + its number. */

static const double *edge_corner(const hapi_meshes *meshes, uint32_t edge, uint32_t which)
{
  return meshes->found[edge / 3].corners + (size_t)3 * ((edge % 3 + which) % 3);
}

static bool same_point(const double *a, const double *b)
{
  return a[0] == b[0] && a[1] == b[1] && a[2] == b[2];
}

/* False: it has no area. */
static bool triangle_normal(const double corners[9], double out[3])
{
  double sides[2][3];
  hapi_v3_sub(corners + 3, corners, sides[0]);
  hapi_v3_sub(corners + 6, corners, sides[1]);
  hapi_v3_cross(sides[0], sides[1], out);
  return hapi_v3_norm(out) > 0.0;
}

static uint64_t point_hash(const double point[3])
{
  uint64_t mixed = 0;
  for (int k = 0; k < 3; ++k) {
    uint64_t bits;
    memcpy(&bits, &point[k], sizeof bits);
    mixed = (mixed ^ bits) * 0x9e3779b97f4a7c15u;
    mixed ^= mixed >> 32;
  }
  return mixed;
}

static uint32_t place_of(uint64_t hash)
{
  return (uint32_t)(hash ^ (hash >> 29)) & (HAPI_EDGE_PLACES - 1);
}

static uint32_t next_place(uint32_t at)
{
  return (at + 1) & (HAPI_EDGE_PLACES - 1);
}

/* Whether the triangle of edge `other` lies level with that of `edge` or above it. */
static bool edge_is_closed_by(const hapi_meshes *meshes, uint32_t edge, uint32_t other)
{
  double normal[3];
  double rise[3];
  (void)triangle_normal(meshes->found[edge / 3].corners, normal);
  hapi_v3_sub(edge_corner(meshes, other, 2), edge_corner(meshes, edge, 0), rise);
  return hapi_v3_dot(rise, normal) >= -1e-4 * hapi_v3_norm(rise) * hapi_v3_norm(normal);
}

static void meet_edge(hapi_meshes *meshes, uint32_t edge)
{
  HAPI_ASSERT_INDEX(edge, 3 * HAPI_NEAR_TRIANGLES); /* less than half of the places */
  /* Of both directions the same. */
  uint32_t at =
      place_of(point_hash(edge_corner(meshes, edge, 0)) + point_hash(edge_corner(meshes, edge, 1)));
  for (; meshes->places[at] != 0; at = next_place(at)) {
    uint32_t other = meshes->places[at] - 1;
    const double *p = edge_corner(meshes, edge, 0);
    const double *q = edge_corner(meshes, edge, 1);
    const double *r = edge_corner(meshes, other, 0);
    const double *s = edge_corner(meshes, other, 1);
    if ((same_point(p, s) && same_point(q, r)) || (same_point(p, r) && same_point(q, s))) {
      meshes->found[edge / 3].joined |= 1u << (edge % 3);
      meshes->found[other / 3].joined |= 1u << (other % 3);
      if (edge_is_closed_by(meshes, edge, other)) {
        meshes->found[edge / 3].open_edges &= ~(1u << (edge % 3));
      }
      if (edge_is_closed_by(meshes, other, edge)) {
        meshes->found[other / 3].open_edges &= ~(1u << (other % 3));
      }
    }
  }
  meshes->places[at] = edge + 1;
}

/* ---- how far a contact may lean: no farther than the triangles around its own ---- */

/* Corners are numbered as the edges that begin there. */
static void meet_corner(hapi_meshes *meshes, uint32_t corner)
{
  HAPI_ASSERT_INDEX(corner, 3 * HAPI_NEAR_TRIANGLES);
  const double *point = edge_corner(meshes, corner, 0);
  uint32_t at = place_of(point_hash(point));
  while (meshes->places[at] != 0 &&
         !same_point(edge_corner(meshes, meshes->places[at] - 1, 0), point)) {
    at = next_place(at);
  }
  meshes->next_corner[corner] = meshes->places[at];
  meshes->places[at] = corner + 1;
}

static uint32_t chain_length(const hapi_meshes *meshes, uint32_t first)
{
  uint32_t length = 0;
  for (uint32_t i = first; i != 0; i = meshes->next_corner[i - 1]) {
    ++length;
  }
  return length;
}

/* The least cosine between a triangle and those that share a corner of the chain with it. Around
 * the middle of a large fan contacts may lean by any angle: its pairs would take milliseconds. */
static void lean_of_chain(const hapi_meshes *meshes, uint32_t first, double (*normals)[3],
                          double *io_cosines)
{
  bool large = chain_length(meshes, first) > FAN_MOST;
  for (uint32_t i = first; large && i != 0; i = meshes->next_corner[i - 1]) {
    io_cosines[(i - 1) / 3] = 0.0;
  }
  for (uint32_t i = first; !large && i != 0; i = meshes->next_corner[i - 1]) {
    for (uint32_t k = first; k != 0; k = meshes->next_corner[k - 1]) {
      double *least = &io_cosines[(i - 1) / 3];
      *least = fmin(*least, hapi_v3_dot(normals[(i - 1) / 3], normals[(k - 1) / 3]));
    }
  }
}

/* Whether the mesh ends there: an edge whose other triangle is outside the box is too. */
static bool has_border(const hapi_meshes *meshes, uint32_t triangle, const double box[6])
{
  for (uint32_t k = 0; k < 3; ++k) {
    double own[6];
    for (uint32_t end = 0; end < 2; ++end) {
      grow_box(own, edge_corner(meshes, 3 * triangle + k, end), end == 0);
    }
    if ((meshes->found[triangle].joined & (1u << k)) == 0 && hapi_boxes_meet(own, box)) {
      return true;
    }
  }
  return false;
}

static void find_leans(hapi_meshes *meshes, uint32_t count, const double box[6])
{
  double normals[HAPI_NEAR_TRIANGLES][3];
  double cosines[HAPI_NEAR_TRIANGLES];
  memset(meshes->places, 0, sizeof meshes->places);
  for (uint32_t corner = 0; corner < 3 * count; ++corner) {
    meet_corner(meshes, corner);
  }
  for (uint32_t i = 0; i < count; ++i) {
    if (triangle_normal(meshes->found[i].corners, normals[i])) {
      hapi_v3_scale(1.0 / hapi_v3_norm(normals[i]), normals[i], normals[i]);
    }
    cosines[i] = has_border(meshes, i, box) ? 0.0 : 1.0; /* at a border: any */
  }
  for (uint32_t at = 0; at < HAPI_EDGE_PLACES; ++at) {
    lean_of_chain(meshes, meshes->places[at], normals, cosines);
  }
  for (uint32_t i = 0; i < count; ++i) {
    meshes->found[i].open_edges |= hapi_mesh_lean(cosines[i]);
  }
}

void hapi_meshes_join(hapi_meshes *meshes, uint32_t count, const double box[6])
{
  memset(meshes->places, 0, sizeof meshes->places);
  for (uint32_t i = 0; i < count; ++i) {
    meshes->found[i].open_edges = 15;
    meshes->found[i].joined = 0;
  }
  for (uint32_t edge = 0; edge < 3 * count; ++edge) {
    meet_edge(meshes, edge);
  }
  find_leans(meshes, count, box);
}

static uint32_t search_chunk(const hapi_mesh *mesh, uint32_t chunk, const double box[6],
                             hapi_meshes *meshes, uint32_t found)
{
  HAPI_ASSERT(chunk * CHUNK < mesh->count && found <= FOUND_MAX);
  uint32_t end = (chunk + 1) * CHUNK < mesh->count ? (chunk + 1) * CHUNK : mesh->count;
  for (uint32_t i = chunk * CHUNK; i < end && found < FOUND_MAX; ++i) {
    const double *corners = mesh->corners + (size_t)9 * i;
    double own[6];
    for (int k = 0; k < 3; ++k) {
      grow_box(own, corners + 3 * k, k == 0);
    }
    if (hapi_boxes_meet(own, box)) {
      memcpy(meshes->found[found].corners, corners, sizeof meshes->found[found].corners);
      meshes->found[found++].index = i;
    }
  }
  return found;
}

uint32_t hapi_mesh_near(hapi_nearby *nearby, dGeomID geom, const double box[6], uint64_t walk)
{
  hapi_meshes *meshes = &nearby->meshes;
  const hapi_mesh *mesh = find_mesh(meshes, geom, walk);
  double local[6];
  uint32_t found = 0;
  if (mesh == NULL) {
    ++nearby->counts.dropped;
    return FOUND_MAX; /* ODE collides it: a body that the loop moved would fall through */
  }
  /* A box of the world in the geom's frame: one that holds it. */
  dQuaternion turn;
  dGeomGetQuaternion(geom, turn);
  for (int i = 0; i < 8; ++i) {
    double corner[3] = {box[i & 1], box[2 + ((i >> 1) & 1)], box[4 + ((i >> 2) & 1)]};
    hapi_pose_unpoint(dGeomGetPosition(geom), turn, corner, corner);
    grow_box(local, corner, i == 0);
  }
  for (uint32_t chunk = 0; chunk < (mesh->count + CHUNK - 1) / CHUNK; ++chunk) {
    if (hapi_boxes_meet(mesh->boxes + (size_t)6 * chunk, local)) {
      found = search_chunk(mesh, chunk, local, meshes, found);
    }
  }
  if (found == FOUND_MAX) {
    return found; /* too many: the caller leaves them to ODE */
  }
  hapi_meshes_join(meshes, found, local);
  dQuaternion quat;
  dGeomGetQuaternion(geom, quat);
  for (uint32_t i = 0; i < found; ++i) {
    for (int k = 0; k < 3; ++k) {
      double *corner = meshes->found[i].corners + 3 * k;
      hapi_pose_point(dGeomGetPosition(geom), quat, corner, corner);
    }
  }
  return found;
}

bool hapi_triangles_nearest(const hapi_meshes *meshes, uint32_t count, const double center[3],
                            double radius, hapi_nearest *out)
{
  double best = HUGE_VAL;
  for (uint32_t i = 0; i < count; ++i) {
    double point[3];
    double apart[3];
    hapi_triangle_nearest(meshes->found[i].corners, center, point);
    hapi_v3_sub(center, point, apart);
    double distance = hapi_v3_norm(apart);
    if (distance < best && (distance > 0.0 || triangle_normal(meshes->found[i].corners, apart))) {
      best = distance;
      hapi_v3_copy(point, out->point_b);
      hapi_v3_scale(1.0 / hapi_v3_norm(apart), apart, out->normal);
    }
  }
  out->distance = best - radius;
  hapi_v3_madd(center, -radius, out->normal, out->point_a);
  return best < HUGE_VAL;
}
