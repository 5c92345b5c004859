/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "contact/places.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/hash.h"
#include "base/vec.h"

#define MARGIN_SPEED 1.5 /* of the way that the bodies' speed makes until the next pass */
#define MARGIN_GRAVITY 9.81
#define STEPS_PER_UNIT 1073741824.0 /* about 1 nm */
#define STEPS_MOST 1e9
#define ROUNDING 1e-9 /* m, and part, of distances far from the world's origin */

bool hapi_places_create(hapi_places *places, const hapi_capacity *capacity)
{
  places->body_capacity = capacity->bodies;
  places->bodies = hapi_alloc_array(capacity->bodies, sizeof *places->bodies);
  places->geoms = hapi_alloc_array(capacity->geoms, sizeof *places->geoms);
  return places->bodies != NULL && places->geoms != NULL;
}

void hapi_places_finish(hapi_places *places)
{
  hapi_free(places->bodies);
  hapi_free(places->geoms);
  places->bodies = NULL;
  places->geoms = NULL;
}

void hapi_places_begin(hapi_places *places)
{
  places->near = NULL;
  places->poses = NULL;
  places->stays = 0;
  memset(places->bodies, 0, places->body_capacity * sizeof *places->bodies);
}

/* ---- what follows from geoms alone ---- */

/* Poses and corners in the frame of a body come from those in the world, and have other last bits
 * in each message. Whole steps of a nanometre are the same, but where a value is between two of
 * them: then the contacts are found anew. */
static uint64_t hash_steps(uint64_t hash, const double *values, int count)
{
  for (int i = 0; i < count; ++i) {
    double steps = hapi_max(hapi_min(values[i], STEPS_MOST), -STEPS_MOST) * STEPS_PER_UNIT;
    hash = hapi_hash_word(hash, (uint64_t)(int64_t)(steps + (steps < 0.0 ? -0.5 : 0.5)));
  }
  return hash;
}

static uint64_t geom_stamp(const hapi_near_geom *geom, const double *hull)
{
  const hapi_shape *s = &geom->shape;
  const double sizes[] = {s->radius, s->half[0], s->half[1], s->half[2], s->rounding};
  uint64_t hash = hapi_hash_word(HAPI_HASH_BEGIN, ((uint64_t)geom->body << 32) | geom->generation);
  hash = hapi_hash_word(hash, ((uint64_t)s->kind << 32) | geom->open_edges);
  hash = hapi_hash_doubles(hash, sizes, (int)(sizeof sizes / sizeof sizes[0]));
  hash = hash_steps(hash, geom->pose.position, 3);
  hash = hash_steps(hash, geom->pose.quat_wxyz, 4);
  hash = hapi_hash_word(hash, s->hull_count);
  return hull == NULL ? hash : hash_steps(hash, hull, 3 * (int)s->hull_count);
}

/* The mean of the corners, and the farthest of them. */
static void hull_ball(const double *hull, size_t count, double out_center[3], double *out_radius)
{
  double far2 = 0.0;
  hapi_v3_set(out_center, 0.0, 0.0, 0.0);
  for (size_t i = 0; i < count; ++i) {
    hapi_v3_madd(out_center, 1.0 / (double)count, hull + 3 * i, out_center);
  }
  for (size_t i = 0; i < count; ++i) {
    double arm[3];
    hapi_v3_sub(hull + 3 * i, out_center, arm);
    far2 = hapi_max(far2, hapi_v3_dot(arm, arm));
  }
  *out_radius = sqrt(far2);
}

static void geom_trait(const hapi_near_geom *geom, const double *hull, hapi_geom_trait *out)
{
  const hapi_shape *s = &geom->shape;
  out->stamp = geom_stamp(geom, hull);
  out->extent = 0.0;
  if (geom->body != HAPI_SLOT_NONE) {
    out->extent =
        hapi_v3_norm(geom->pose.position) + hapi_v3_norm(s->half) + s->radius + geom->extent;
  }
  hapi_v3_copy(geom->pose.position, out->center);
  if (s->kind == HAPI_SHAPE_PLANE) {
    out->radius = HUGE_VAL;
  } else if (hull != NULL) {
    double center[3];
    hull_ball(hull, s->hull_count, center, &out->radius);
    out->radius += s->rounding;
    hapi_pose_point(geom->pose.position, geom->pose.quat_wxyz, center, out->center);
  } else {
    out->radius = hapi_v3_norm(s->half) + s->radius;
  }
}

static const double *geom_hull(const hapi_places *places, const hapi_near_geom *geom)
{
  return geom->shape.kind != HAPI_SHAPE_HULL
             ? NULL
             : hapi_near_points(places->near) + (size_t)3 * geom->hull_first;
}

void hapi_places_take_near(hapi_places *places, hapi_near *near)
{
  places->near = near;
  for (uint32_t i = 0; i < near->geom_count; ++i) {
    const hapi_near_geom *geom = &hapi_near_geoms(near)[i];
    geom_trait(geom, geom_hull(places, geom), &places->geoms[i]);
  }
}

/* ---- where things are now ---- */

static void body_set(hapi_places *places, hapi_pass_body *body, const hap_pose *pose,
                     const hap_twist *twist)
{
  if (memcmp(&body->pose, pose, sizeof *pose) != 0) {
    body->pose = *pose;
    body->stay = ++places->stays;
  }
  body->twist = *twist;
  body->spin = hapi_v3_norm(twist->angular);
  body->told = true;
}

/* In three walks: who is there, where the loop has them, and where physics has those that
 * the loop does not have yet. */
void hapi_places_set_bodies(hapi_places *places)
{
  const hapi_near_body *near = hapi_near_bodies(places->near);
  const hapi_poses_body *loop = hapi_poses_bodies(places->poses);
  for (uint32_t i = 0; i < places->body_capacity; ++i) {
    places->bodies[i].known = false;
  }
  for (uint32_t i = 0; i < places->near->body_count; ++i) {
    hapi_pass_body *body = &places->bodies[near[i].slot];
    bool same = body->generation == near[i].generation && body->stay != 0;
    body->generation = near[i].generation;
    body->known = true;
    body->stay = same ? body->stay : ++places->stays;
    body->told = false;
  }
  for (uint32_t i = 0; i < places->poses->body_count; ++i) {
    hapi_pass_body *body = &places->bodies[loop[i].slot];
    if (body->known && body->generation == loop[i].generation) {
      body_set(places, body, &loop[i].pose, &loop[i].twist);
    }
  }
  for (uint32_t i = 0; i < places->near->body_count; ++i) {
    hapi_pass_body *body = &places->bodies[near[i].slot];
    if (!body->told) {
      body_set(places, body, &near[i].pose, &near[i].twist);
    }
  }
}

bool hapi_places_body(const hapi_places *places, uint32_t index, const hapi_pass_body **out)
{
  const hapi_near_geom *geom = &hapi_near_geoms(places->near)[index];
  *out = NULL;
  if (geom->body == HAPI_SLOT_NONE) {
    return true;
  }
  *out = &places->bodies[geom->body];
  return (*out)->known && (*out)->generation == geom->generation;
}

bool hapi_places_geom(const hapi_places *places, uint32_t index, hapi_placed_geom *out)
{
  const hapi_near_geom *in = &hapi_near_geoms(places->near)[index];
  bool known = hapi_places_body(places, index, &out->body);
  out->in = in;
  out->shape = in->shape;
  out->pose = in->pose;
  if (in->shape.kind == HAPI_SHAPE_HULL) {
    out->shape.hull = geom_hull(places, in);
  }
  if (out->body != NULL) {
    const hap_pose *body = &out->body->pose;
    hapi_pose_point(body->position, body->quat_wxyz, in->pose.position, out->pose.position);
    hapi_quat_multiply(body->quat_wxyz, in->pose.quat_wxyz, out->pose.quat_wxyz);
  }
  return known;
}

static void ball_center(const hapi_geom_trait *geom, const hapi_pass_body *body, double out[3])
{
  if (body == NULL) {
    hapi_v3_copy(geom->center, out);
    return;
  }
  hapi_pose_point(body->pose.position, body->pose.quat_wxyz, geom->center, out);
}

double hapi_places_clear(const hapi_places *places, const hapi_near_pair *pair,
                         const hapi_pass_body *a, const hapi_pass_body *b)
{
  double centers[2][3];
  const hapi_geom_trait *geom_a = &places->geoms[pair->geom_a];
  const hapi_geom_trait *geom_b = &places->geoms[pair->geom_b];
  ball_center(geom_a, a, centers[0]);
  ball_center(geom_b, b, centers[1]);
  hapi_v3_sub(centers[0], centers[1], centers[0]);
  double distance = hapi_v3_norm(centers[0]);
  return distance * (1.0 - ROUNDING) - ROUNDING - geom_a->radius - geom_b->radius;
}

hapi_touch_side hapi_placed_side(const hapi_placed_geom *geom)
{
  return (hapi_touch_side){.body = geom->body != NULL ? &geom->body->pose : NULL,
                           .pose = geom->pose,
                           .shape = geom->shape,
                           .shape_pose = geom->in->pose};
}

hapi_mover hapi_places_mover(const hapi_pass_body *body, double extent)
{
  static const double still[3];
  return body == NULL ? (hapi_mover){still, 0.0, 0.0}
                      : (hapi_mover){body->twist.linear, body->spin, extent};
}

double hapi_places_margin(const hapi_places *places, hapi_mover a, hapi_mover b)
{
  double apart[3];
  double seconds = places->seconds;
  hapi_v3_sub(a.linear, b.linear, apart);
  double speed = a.spin * a.extent + b.spin * b.extent + hapi_v3_norm(apart);
  return HAPI_MARGIN_FLOOR + MARGIN_SPEED * speed * seconds +
         0.5 * MARGIN_GRAVITY * seconds * seconds;
}
