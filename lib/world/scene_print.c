/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "world/scene_print.h"

#include <math.h>
#include <string.h>

#define GRID 1e6 /* steps of a metre or kilogram */

static uint64_t print_mix(uint64_t print, uint64_t bits)
{
  uint64_t x = (print ^ bits) * 0x9e3779b97f4a7c15u;
  return x ^ (x >> 29);
}

static uint64_t mix_values(uint64_t print, const dReal *values, int count)
{
  for (int i = 0; i < count; ++i) {
    double steps = round(GRID * (double)values[i]) + 0.0; /* -0 is 0 */
    uint64_t bits;
    memcpy(&bits, &steps, sizeof bits);
    print = print_mix(print, bits);
  }
  return print;
}

static uint64_t mix_shape(uint64_t print, dGeomID geom)
{
  dVector4 sizes = {0};
  int kind = dGeomGetClass(geom);
  print = print_mix(print, (uint64_t)kind + 1);
  switch (kind) {
    case dSphereClass:
      sizes[0] = dGeomSphereGetRadius(geom);
      break;
    case dBoxClass:
      dGeomBoxGetLengths(geom, sizes);
      break;
    case dCapsuleClass:
      dGeomCapsuleGetParams(geom, &sizes[0], &sizes[1]);
      break;
    case dCylinderClass:
      dGeomCylinderGetParams(geom, &sizes[0], &sizes[1]);
      break;
    case dPlaneClass:
      dGeomPlaneGetParams(geom, sizes);
      break;
    case dTriMeshClass:
      sizes[0] = dGeomTriMeshGetTriangleCount(geom);
      break;
    default:
      break;
  }
  return mix_values(print, sizes, 4);
}

static uint64_t print_of_body(dBodyID body)
{
  dMass mass;
  dBodyGetMass(body, &mass);
  uint64_t print = mix_values(1, &mass.mass, 1);
  for (dGeomID geom = dBodyGetFirstGeom(body); geom != NULL; geom = dBodyGetNextGeom(geom)) {
    print = mix_shape(print, geom);
    if (dGeomIsOffset(geom)) {
      print = mix_values(print, dGeomGetOffsetPosition(geom), 3);
    }
  }
  return print;
}

/* A sum: the order of geoms in a space is that of their last motions. */
static uint64_t sum_of_fixed(dSpaceID space)
{
  uint64_t sum = 0;
  for (int i = 0; i < dSpaceGetNumGeoms(space); ++i) {
    dGeomID geom = dSpaceGetGeom(space, i);
    if (dGeomIsSpace(geom)) {
      sum += sum_of_fixed((dSpaceID)geom);
    } else if (dGeomGetBody(geom) == NULL) {
      int kind = dGeomGetClass(geom); /* these may have no place */
      bool placed = kind != dPlaneClass && kind != dHeightfieldClass;
      uint64_t print = mix_shape(2, geom);
      sum += placed ? mix_values(print, dGeomGetPosition(geom), 3) : print;
    }
  }
  return sum;
}

void hapi_scene_print_read(const hapi_world *world, hapi_scene_print *out)
{
  *out = (hapi_scene_print){0};
  for (uint32_t i = 0; i < world->bodies.high; ++i) {
    const hapi_known_body *known = &world->bodies.entries[i];
    if (known->body != NULL && known->rest->geom == NULL) {
      ++out->bodies;
      out->shapes += print_mix(print_of_body(known->body), known->rest->name);
    }
  }
  for (uint32_t i = 0; i < world->spaces.count; ++i) {
    out->shapes += sum_of_fixed(world->spaces.list[i].space);
  }
}
