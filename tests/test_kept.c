/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* What contact passes keep of a pair. Contacts stay as they are while two bodies hardly move
 * against each other, wherever they go together, and are found anew for what changes. Witnesses are
 * closed forms: heights of corners, a gap that is set. */

#include <math.h>
#include <string.h>

#include "base/vec.h"
#include "contact/contact.h"
#include "tests/tap.h"

#define HALF 0.05 /* m, of both cubes */
#define DEPTH 1e-4
#define HAPTIC_HZ 1000.0
#define CONTACTS_MOST 64

typedef struct bench {
  hapi_exchange *exchange;
  hapi_contact *contact;
  hapi_shape shapes[2];
  hap_pose poses[2]; /* of bodies 0 and 1 */
  hap_twist twists[2];
  double offset; /* m, of the first geom in its body */
  bool fixed;    /* the second geom is static, at its pose of the begin */
  uint64_t model;
  hapi_patch_contact found[CONTACTS_MOST];
  uint32_t count;
} bench;

static void bench_end(void *owned)
{
  bench *b = owned;
  hapi_contact_destroy(b->contact);
  hapi_exchange_destroy(b->exchange);
}

/* The first cube stands on the second one, that deep in it. */
static bench *bench_new(void)
{
  bench *b = tap_own(sizeof *b, bench_end);
  const hapi_capacity capacity = {.bodies = 4,
                                  .contacts = CONTACTS_MOST,
                                  .pairs = 64,
                                  .pointers = 1,
                                  .geoms = 16,
                                  .hull_points = 64,
                                  .joints = 1,
                                  .tool_points = 4};
  CHECK(hapi_exchange_create(&capacity, &b->exchange) >= HAP_OK);
  const hapi_contact_config config = {
      .capacity = capacity, .haptic_hz = HAPTIC_HZ, .exchange = b->exchange};
  CHECK(hapi_contact_create(&config, &b->contact) >= HAP_OK);
  hapi_contact_begin(b->contact, 0);
  for (int i = 0; i < 2; ++i) {
    b->shapes[i] = (hapi_shape){.kind = HAPI_SHAPE_BOX, .half = {HALF, HALF, HALF}};
    b->poses[i].quat_wxyz[0] = 1.0;
  }
  b->poses[0].position[2] = 2.0 * HALF - DEPTH;
  return b;
}

static void near_put(bench *b)
{
  hapi_near *near = hapi_exchange_near_back(b->exchange);
  near->model_number = ++b->model;
  near->body_count = b->fixed ? 1 : 2;
  near->geom_count = 2;
  near->pair_count = 1;
  near->point_count = near->tool_count = near->tool_pair_count = near->said_count = 0;
  near->between = 1;
  near->contact_hz = 200.0;
  for (uint32_t i = 0; i < 2; ++i) {
    bool fixed = i == 1 && b->fixed;
    hapi_near_geom *geom = &hapi_near_geoms(near)[i];
    memset(geom, 0, sizeof *geom);
    geom->body = fixed ? HAPI_SLOT_NONE : i;
    geom->generation = fixed ? 0 : 1;
    geom->shape = b->shapes[i];
    geom->pose.quat_wxyz[0] = 1.0;
    geom->pose.position[0] = i == 0 ? b->offset : 0.0;
    if (!fixed) {
      hapi_near_bodies(near)[i] = (hapi_near_body){i, 1, b->poses[i], b->twists[i]};
    }
  }
  hapi_near_pair *pair = &hapi_near_pairs(near)[0];
  memset(pair, 0, sizeof *pair);
  pair->key = 77;
  pair->geom_b = 1;
  hapi_exchange_near_publish(b->exchange);
}

/* One pass with the bodies where they are. */
static void pass_run(bench *b)
{
  hapi_poses *poses = hapi_exchange_poses_back(b->exchange);
  poses->model_number = b->model;
  poses->body_count = 2;
  poses->pointer_count = poses->side_count = 0;
  for (uint32_t i = 0; i < 2; ++i) {
    hapi_poses_bodies(poses)[i] = (hapi_poses_body){i, 1, b->poses[i], b->twists[i]};
  }
  hapi_exchange_poses_publish(b->exchange);
  hapi_contact_pass(b->contact, 0);
  hapi_patches *patches = hapi_exchange_patches_take(b->exchange);
  CHECK(patches != NULL && patches->contact_count <= CONTACTS_MOST);
  b->count = patches->contact_count;
  memcpy(b->found, hapi_patches_contacts(patches), b->count * sizeof *b->found);
}

static void pass_new(bench *b)
{
  near_put(b);
  pass_run(b);
}

static bool same_contacts(const bench *b, const hapi_patch_contact *before, uint32_t count)
{
  return b->count == count && memcmp(b->found, before, count * sizeof *before) == 0;
}

static void world_turn(bench *b, const double about[3], double angle)
{
  double turn[4] = {cos(0.5 * angle)};
  hapi_v3_scale(sin(0.5 * angle), about, turn + 1);
  for (int i = 0; i < 2; ++i) {
    hapi_quat_rotate(turn, b->poses[i].position, b->poses[i].position);
    hapi_quat_multiply(turn, b->poses[i].quat_wxyz, b->poses[i].quat_wxyz);
  }
}

TEST(contacts_stay_for_two_micrometres)
{
  bench *b = bench_new();
  hapi_patch_contact before[4];
  pass_new(b);
  CHECK(b->count == 4);
  memcpy(before, b->found, sizeof before);
  b->poses[0].position[0] = 1.5e-6;
  pass_run(b);
  CHECK(same_contacts(b, before, 4));
  b->poses[0].position[0] = 2.5e-6;
  pass_run(b);
  CHECK(!same_contacts(b, before, 4));
  CHECK(b->count == 4);
}

/* Steps that each would be within the bound add up. */
TEST(a_creeping_body_is_found_anew)
{
  bench *b = bench_new();
  uint32_t changes = 0;
  pass_new(b);
  for (int i = 1; i <= 100; ++i) {
    hapi_patch_contact before[4];
    memcpy(before, b->found, sizeof before);
    b->poses[0].position[0] = 1e-6 * i;
    pass_run(b);
    CHECK(b->count == 4);
    changes += !same_contacts(b, before, 4);
    for (uint32_t k = 0; k < b->count; ++k) { /* where the cubes overlap along x */
      double a = b->found[k].core_a[0] + b->poses[0].position[0];
      CHECK(a > -HALF + b->poses[0].position[0] - 2.1e-6 && a < HALF + 2.1e-6);
    }
  }
  CHECK(changes >= 30 && changes <= 60);
}

TEST(a_small_turn_is_a_motion_of_the_corners)
{
  bench *b = bench_new();
  hapi_patch_contact before[4];
  pass_new(b);
  memcpy(before, b->found, sizeof before);
  const double angles[] = {1e-5, 4e-5}; /* of corners at 87 mm: 0.9 um, 3.5 um */
  for (int i = 0; i < 2; ++i) {
    b->poses[0].quat_wxyz[0] = cos(0.5 * angles[i]);
    b->poses[0].quat_wxyz[3] = sin(0.5 * angles[i]);
    pass_run(b);
    CHECK(same_contacts(b, before, 4) == (i == 0));
  }
}

TEST(bodies_that_go_together_keep_their_contacts)
{
  static const double about[3] = {0.6, 0.0, 0.8};
  bench *b = bench_new();
  hapi_patch_contact before[4];
  pass_new(b);
  memcpy(before, b->found, sizeof before);
  for (int i = 0; i < 50; ++i) {
    world_turn(b, about, 0.1);
    b->poses[0].position[1] += 0.3;
    b->poses[1].position[1] += 0.3;
    if (i % 3 == 0) {
      near_put(b);
    }
    pass_run(b);
    CHECK(same_contacts(b, before, 4));
  }
}

TEST(a_body_on_the_static_world_is_seen_to_move)
{
  bench *b = bench_new();
  hapi_patch_contact before[4];
  b->fixed = true;
  pass_new(b);
  CHECK(b->count == 4);
  memcpy(before, b->found, sizeof before);
  b->poses[0].position[1] = 1e-6;
  pass_run(b);
  CHECK(same_contacts(b, before, 4));
  b->poses[0].position[1] = 0.01;
  pass_run(b);
  CHECK(b->count == 4);
  CHECK(!same_contacts(b, before, 4));
}

TEST(a_geom_that_changes_is_found_anew)
{
  bench *b = bench_new();
  hapi_patch_contact before[4];
  pass_new(b);
  memcpy(before, b->found, sizeof before);
  b->offset = 1e-13; /* rounding */
  pass_new(b);
  CHECK(same_contacts(b, before, 4));
  b->offset = 1e-6;
  pass_new(b);
  CHECK(!same_contacts(b, before, 4));
  memcpy(before, b->found, sizeof before);
  b->shapes[0].half[0] = 0.04;
  pass_new(b);
  CHECK(!same_contacts(b, before, 4));
  CHECK(b->count == 4);
}

/* Crossed edges tell their side in world axes. */
TEST(crossed_edges_that_turn_over_keep_their_side)
{
  static const double about_x[3] = {1.0, 0.0, 0.0};
  const double eighth = 0.25 * acos(0.0); /* half of 45 degrees */
  bench *b = bench_new();
  double height = 2.0 * sqrt(2.0) * HALF - DEPTH;
  b->poses[0] = (hap_pose){{0.0, 0.0, height}, {cos(eighth), sin(eighth), 0.0, 0.0}};
  b->poses[1] = (hap_pose){{0.0, 0.0, 0.0}, {cos(eighth), 0.0, sin(eighth), 0.0}};
  pass_new(b);
  for (int i = 0; i < 40; ++i) {
    double along[3];
    world_turn(b, about_x, 0.1);
    pass_run(b);
    CHECK(b->count == 1);
    CHECK(b->found[0].touch == HAPI_TOUCH_EDGES);
    hapi_v3_sub(b->poses[0].position, b->poses[1].position, along);
    CHECK(hapi_v3_dot(along, b->found[0].normal) > 0.95 * height);
  }
}

/* A cube that comes down: its contacts are there before it can touch, at any speed, and none while
 * it is far. Also with a turn, where boxes and balls say less than the corners. */
TEST(what_comes_near_is_found_in_time)
{
  static const double speeds[] = {0.001, 0.01, 0.1, 1.0, 5.0}; /* m/s */
  for (size_t i = 0; i < sizeof speeds / sizeof speeds[0]; ++i) {
    for (int turned = 0; turned < 2; ++turned) {
      bench *b = bench_new();
      double step = 0.005 * speeds[i];
      double low = turned ? sqrt(2.0) * HALF : HALF; /* of the lowest corner below the middle */
      double gap = step < 1e-3 ? 4e-3 : 10.0 * step;
      if (turned) {
        b->poses[0].quat_wxyz[0] = cos(0.25 * acos(0.0));
        b->poses[0].quat_wxyz[1] = sin(0.25 * acos(0.0));
      }
      b->twists[0].linear[2] = -speeds[i];
      near_put(b);
      while (gap > -2.0 * step) {
        b->poses[0].position[2] = HALF + low + gap;
        pass_run(b);
        CHECK(b->count > 0 || gap > 1e-3 + 1.2 * step);
        CHECK(b->count == 0 || gap < 3e-3 + 2.2 * step);
        gap -= step;
      }
    }
  }
}

/* It begins to move in a pass: what was kept at rest had a margin for slow bodies. */
TEST(what_begins_to_move_gets_its_margin)
{
  bench *b = bench_new();
  b->poses[0].position[2] = 2.0 * HALF + 4e-3;
  pass_new(b);
  pass_run(b);
  CHECK(b->count == 0);
  b->twists[0].linear[2] = -0.5;
  pass_run(b);
  CHECK(b->count == 4);
}

/* A cube tilted so that two of its corners are within the margin of a slow one. It begins to turn:
 * the other two may come down before the next pass. */
TEST(what_begins_to_turn_gets_its_margin)
{
  const double angle = 0.04; /* the far corners are 4 mm up */
  bench *b = bench_new();
  b->poses[0].quat_wxyz[0] = cos(0.5 * angle);
  b->poses[0].quat_wxyz[2] = sin(0.5 * angle);
  b->poses[0].position[2] = HALF + HALF * (cos(angle) + sin(angle)) - DEPTH;
  pass_new(b);
  pass_run(b);
  CHECK(b->count == 2);
  b->twists[0].angular[1] = -4.0;
  pass_run(b);
  CHECK(b->count == 4);
}

/* The way is in parts of the smaller one. */
TEST(contacts_of_a_small_body_stay_for_less)
{
  const double half = 0.002; /* an extent of 3.5 mm: 0.17 um */
  bench *b = bench_new();
  hapi_patch_contact before[4];
  hapi_v3_set(b->shapes[0].half, half, half, half);
  b->poses[0].position[2] = HALF + half - DEPTH;
  pass_new(b);
  CHECK(b->count == 4);
  memcpy(before, b->found, sizeof before);
  b->poses[0].position[0] = 1e-7;
  pass_run(b);
  CHECK(same_contacts(b, before, 4));
  b->poses[0].position[0] = 3e-7;
  pass_run(b);
  CHECK(!same_contacts(b, before, 4));
}
