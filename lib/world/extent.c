/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/vec.h"
#include "world/world.h"

/* How far a body reaches from its origin. Measured anew when its geoms have changed: the box
 * around a geom, which it is taken from, is another one in each orientation. */

#define REST_SPEED 2e-3 /* m/s */
#define STILL_LEAST 4u  /* cycles */

/* Of a carrier the geom that it is of. */
static dGeomID first_geom(const hapi_known_body *known)
{
  dGeomID geom = dBodyGetFirstGeom(known->body);
  return geom != NULL ? geom : known->rest->geom;
}

static double extent_measure(const hapi_known_body *known)
{
  const dReal *at = dBodyGetPosition(known->body);
  double extent = 0.0;
  for (dGeomID geom = first_geom(known); geom != NULL; geom = dBodyGetNextGeom(geom)) {
    dReal box[6];
    double far2 = 0.0;
    dGeomGetAABB(geom, box);
    for (int k = 0; k < 3; ++k) {
      double low = fabs(box[2 * k] - at[k]);
      double high = fabs(box[2 * k + 1] - at[k]);
      double far = low > high ? low : high;
      far2 += far * far;
    }
    extent = far2 > extent * extent ? sqrt(far2) : extent;
  }
  return isfinite(extent) ? extent : 0.0;
}

static uint64_t print_mix(uint64_t print, uint64_t bits)
{
  uint64_t x = (print ^ bits) * 0x9e3779b97f4a7c15u;
  return x ^ (x >> 29);
}

static uint64_t mix_numbers(uint64_t print, const double *values, int count)
{
  for (int i = 0; i < count; ++i) {
    uint64_t bits;
    memcpy(&bits, &values[i], sizeof bits);
    print = print_mix(print, bits);
  }
  return print;
}

/* Of the classes whose sizes can be set; the others are known by their address alone, 0. */
static int sizes_of(dGeomID geom, int kind, dVector3 out)
{
  switch (kind) {
    case dSphereClass:
      out[0] = dGeomSphereGetRadius(geom);
      return 1;
    case dBoxClass:
      dGeomBoxGetLengths(geom, out);
      return 3;
    case dCapsuleClass:
      dGeomCapsuleGetParams(geom, &out[0], &out[1]);
      return 2;
    case dCylinderClass:
      dGeomCylinderGetParams(geom, &out[0], &out[1]);
      return 2;
    default:
      return 0;
  }
}

static uint64_t print_of(const hapi_known_body *known, bool *out_sized)
{
  uint64_t print = 1;
  *out_sized = true;
  for (dGeomID geom = first_geom(known); geom != NULL; geom = dBodyGetNextGeom(geom)) {
    dVector3 sizes = {0};
    int kind = dGeomGetClass(geom);
    int count = sizes_of(geom, kind, sizes);
    *out_sized = *out_sized && count > 0;
    uint64_t address = (uint64_t)(uintptr_t)geom; /* not where sizes say enough: lockstep */
    print = print_mix(print, count > 0 ? (uint64_t)kind : address);
    print = mix_numbers(print, sizes, count);
    if (dGeomIsOffset(geom)) {
      print = mix_numbers(print, dGeomGetOffsetPosition(geom), 3);
      print = mix_numbers(print, dGeomGetOffsetRotation(geom), 12);
    }
  }
  return print;
}

bool hapi_extent_follow(hapi_known_body *known)
{
  bool sized;
  uint64_t print = print_of(known, &sized);
  known->sized = sized;
  if (print == known->geoms_print) {
    return false;
  }
  known->geoms_print = print;
  known->extent = extent_measure(known);
  return true;
}

void hapi_extent_rest(hapi_known_body *known, double speed)
{
  bool rests = speed < REST_SPEED && !known->pushed;
  known->still = !rests ? 0 : known->still < HAPI_STILL_MOST ? known->still + 1 : known->still;
}

bool hapi_extent_is_still(const hapi_known_body *known)
{
  return known->still >= STILL_LEAST && !known->pushed && hapi_extent_speed(known) < REST_SPEED;
}

double hapi_extent_speed(const hapi_known_body *known)
{
  if (!dBodyIsEnabled(known->body)) {
    return 0.0;
  }
  hap_twist twist;
  hapi_extent_twist(known, &twist);
  return hapi_v3_norm(twist.linear) + known->extent * hapi_v3_norm(twist.angular);
}

void hapi_extent_twist(const hapi_known_body *known, hap_twist *out)
{
  if (known->posed) {
    *out = known->rest->way.rate;
  } else {
    hapi_twist_read(known->body, out);
  }
}

static bool no_velocity(const dReal *v)
{
  return v[0] == 0.0 && v[1] == 0.0 && v[2] == 0.0;
}

static void way_rate(const hap_pose *from, const hap_pose *to, double seconds, hap_twist *out)
{
  const double back[4] = {from->quat_wxyz[0], -from->quat_wxyz[1], -from->quat_wxyz[2],
                          -from->quat_wxyz[3]};
  double turn[4];
  hapi_v3_sub(to->position, from->position, out->linear);
  hapi_v3_scale(1.0 / seconds, out->linear, out->linear);
  hapi_quat_multiply(to->quat_wxyz, back, turn);
  double sine = hapi_v3_norm(turn + 1);
  double angle = 2.0 * atan2(sine, fabs(turn[0]));
  double rate = sine > 0.0 ? copysign(angle / (sine * seconds), turn[0]) : 0.0;
  hapi_v3_scale(rate, turn + 1, out->angular);
}

void hapi_extent_follow_way(hapi_known_body *known, double seconds)
{
  dBodyID body = known->body;
  bool still = no_velocity(dBodyGetLinearVel(body)) && no_velocity(dBodyGetAngularVel(body));
  if (!still || !dBodyIsEnabled(body) || !dBodyIsKinematic(body)) {
    known->posed = false;
    return;
  }
  hapi_posed_way *way = &known->rest->way;
  hap_pose now;
  hapi_pose_read(body, &now);
  way->fresh = false;
  if (!known->posed) {
    *way = (hapi_posed_way){.place = now, .before = now};
    known->posed = true;
  } else if (seconds > 0.0) {
    way_rate(&way->place, &now, seconds, &way->rate);
    way->before = way->place;
    way->place = now;
  }
}
