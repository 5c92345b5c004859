/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tap.h"

#include <stdint.h>

#include "base/pose.h"
#include "base/vec.h"
#include "local/ball_nearest.h"
#include "proximity/support.h"

/* The tick's own way to the nearest point of a ball, against that of all shapes. */

static double random_in(uint64_t *state, double low, double high)
{
  *state = *state * 6364136223846793005u + 1442695040888963407u;
  return low + (high - low) * (double)(*state >> 11) * 0x1p-53;
}

static void random_pose(uint64_t *state, hap_pose *out)
{
  for (int i = 0; i < 4; ++i) {
    out->quat_wxyz[i] = random_in(state, -1.0, 1.0);
  }
  hapi_quat_normalize(out->quat_wxyz);
  for (int i = 0; i < 3; ++i) {
    out->position[i] = random_in(state, -1.0, 1.0);
  }
}

static hapi_shape random_shape(uint64_t *state, hapi_shape_kind kind)
{
  hapi_shape shape = {.kind = kind, .radius = random_in(state, 0.1, 0.5)};
  for (int i = 0; i < 3; ++i) {
    shape.half[i] = random_in(state, 0.1, 0.8);
  }
  return shape;
}

static void check_pose(uint64_t *state, hapi_shape_kind kind, const hap_pose *in_body,
                       const hap_pose *body)
{
  hapi_shape shape = random_shape(state, kind);
  hapi_shape ball = {.kind = HAPI_SHAPE_SPHERE, .radius = random_in(state, 0.01, 0.5)};
  hapi_nearest wanted;
  hapi_nearest got;
  hap_pose at;
  hap_pose other = *in_body;
  double rotation[9];
  random_pose(state, &at);
  if (body != NULL) {
    hapi_quat_to_matrix(body->quat_wxyz, rotation);
    hapi_pose_point(body->position, body->quat_wxyz, in_body->position, other.position);
    hapi_quat_multiply(body->quat_wxyz, in_body->quat_wxyz, other.quat_wxyz);
  }
  hapi_touch_frame frame = {body, body != NULL ? rotation : NULL};
  REQUIRE(hapi_nearest_points(&ball, &at, &shape, &other, &wanted));
  REQUIRE(hapi_ball_nearest(at.position, ball.radius, &shape, in_body, &frame, &got));
  CHECK_NEAR(got.distance, wanted.distance, 1e-12);
  for (int i = 0; i < 3; ++i) {
    CHECK_NEAR(got.normal[i], wanted.normal[i], 1e-9);
    CHECK_NEAR(got.point_a[i], wanted.point_a[i], 1e-9);
    CHECK_NEAR(got.point_b[i], wanted.point_b[i], 1e-9);
  }
}

TEST(a_shape_in_the_world_in_a_body_and_turned_in_it)
{
  static const hapi_shape_kind kinds[] = {HAPI_SHAPE_SPHERE, HAPI_SHAPE_BOX, HAPI_SHAPE_CAPSULE,
                                          HAPI_SHAPE_CYLINDER, HAPI_SHAPE_PLANE};
  static const hap_pose as_it_is = {.quat_wxyz = {1.0, 0.0, 0.0, 0.0}};
  uint64_t state = 1;
  for (size_t k = 0; k < sizeof kinds / sizeof kinds[0]; ++k) {
    for (int i = 0; i < 100; ++i) {
      hap_pose body;
      hap_pose turned;
      random_pose(&state, &body);
      random_pose(&state, &turned);
      check_pose(&state, kinds[k], &turned, NULL);
      check_pose(&state, kinds[k], &as_it_is, &body);
      check_pose(&state, kinds[k], &turned, &body);
    }
  }
}

TEST(what_has_no_closed_form_and_what_is_no_number)
{
  hapi_shape shape = {.kind = HAPI_SHAPE_HULL};
  hap_pose pose = {.quat_wxyz = {1.0, 0.0, 0.0, 0.0}};
  hapi_touch_frame world = {NULL, NULL};
  hapi_nearest nearest;
  double center[3] = {0.0, 0.0, 1.0};
  CHECK(!hapi_ball_nearest(center, 0.1, &shape, &pose, &world, &nearest));
  shape = (hapi_shape){.kind = HAPI_SHAPE_BOX, .half = {0.1, 0.1, 0.1}};
  CHECK(hapi_ball_nearest(center, 0.1, &shape, &pose, &world, &nearest));
  center[0] = (double)NAN;
  CHECK(!hapi_ball_nearest(center, 0.1, &shape, &pose, &world, &nearest));
}

/* From far away along many directions: how much of the way the shape takes up. */
TEST(a_shape_is_within_its_reach_and_comes_near_it)
{
  static const hapi_shape_kind kinds[] = {HAPI_SHAPE_SPHERE, HAPI_SHAPE_BOX, HAPI_SHAPE_CAPSULE,
                                          HAPI_SHAPE_CYLINDER};
  const hapi_touch_frame world = {NULL, NULL};
  const double far = 1e4;
  uint64_t state = 1;
  for (int i = 0; i < 40; ++i) {
    hapi_shape shape = random_shape(&state, kinds[i % 4]);
    double reach = hapi_shape_reach(&shape);
    double most = 0.0;
    hap_pose pose;
    random_pose(&state, &pose);
    for (int k = 0; k < 2000; ++k) {
      double way[3] = {random_in(&state, -1.0, 1.0), random_in(&state, -1.0, 1.0),
                       random_in(&state, -1.0, 1.0)};
      double from[3];
      hapi_nearest nearest;
      hapi_v3_madd(pose.position, far / hapi_v3_norm(way), way, from);
      REQUIRE(hapi_ball_nearest(from, 0.0, &shape, &pose, &world, &nearest));
      most = fmax(most, far - nearest.distance);
    }
    CHECK(most < reach + 1e-3); /* the corner is seen from a finite distance */
    CHECK(most > 0.98 * reach);
  }
  CHECK(isinf(hapi_shape_reach(&(hapi_shape){.kind = HAPI_SHAPE_PLANE})));
  CHECK(isinf(hapi_shape_reach(&(hapi_shape){.kind = HAPI_SHAPE_HULL})));
}
