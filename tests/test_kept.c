/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* What contact passes keep of a pair. Contacts stay as they are while two bodies hardly move
 * against each other, wherever they go together, and are found anew for what changes; what is found
 * again goes on. Witnesses are
 * closed forms: heights of corners, a gap that is set. */

#include <math.h>
#include <string.h>

#include "base/vec.h"
#include "contact/contact.h"
#include "contact/rule.h"
#include "local/touch_place.h"
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

/* Where the loop has a contact, with the bodies where they are. */
static hapi_touch_spot spot_of(const bench *b, const hapi_patch_contact *contact)
{
  hapi_touch_spot spot = {.gap = HUGE_VAL};
  double rotations[2][9];
  hapi_touch_frame frames[2] = {{NULL, NULL}, {NULL, NULL}};
  for (int i = 0; i < (b->fixed ? 1 : 2); ++i) {
    hapi_quat_to_matrix(b->poses[i].quat_wxyz, rotations[i]);
    frames[i] = (hapi_touch_frame){&b->poses[i], rotations[i]};
  }
  CHECK(hapi_touch_place(contact, &frames[0], &frames[1], &spot));
  return spot;
}

/* Steps that each would be within the bound add up. The cubes overlap up to the border of each. */
TEST(contacts_of_a_creeping_body_go_along)
{
  bench *b = bench_new();
  pass_new(b);
  for (int i = 1; i <= 100; ++i) {
    b->poses[0].position[0] = 1e-6 * i;
    pass_run(b);
    CHECK(b->count == 4);
    for (uint32_t k = 0; k < b->count; ++k) {
      hapi_touch_spot spot = spot_of(b, &b->found[k]);
      double left = -HALF + b->poses[0].position[0];
      double end = spot.point[0] > 0.5 * left + 0.5 * HALF ? HALF : left;
      CHECK_NEAR(spot.point[0], end, 2.1e-6);
      CHECK_NEAR(spot.gap, -DEPTH, 1e-12);
    }
  }
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

/* The way is in parts of the smaller one. Two of its corners leave the face, and are no corners on
 * it any more when they are found anew. */
TEST(contacts_of_a_small_body_stay_for_less)
{
  const double half = 0.002; /* an extent of 3.5 mm: 0.17 um */
  const double begin = HALF - half - 5e-8;
  bench *b = bench_new();
  hapi_patch_contact before[4];
  hapi_v3_set(b->shapes[0].half, half, half, half);
  b->poses[0].position[0] = begin;
  b->poses[0].position[2] = HALF + half - DEPTH;
  pass_new(b);
  CHECK(b->count == 4);
  memcpy(before, b->found, sizeof before);
  b->poses[0].position[0] = begin + 1e-7;
  pass_run(b);
  CHECK(same_contacts(b, before, 4));
  b->poses[0].position[0] = begin + 3e-7;
  pass_run(b);
  CHECK(!same_contacts(b, before, 4));
} /* ---- what is found again ---- */

/* Of the contacts that a thread finds which has seen no other pass: one at the same place. */
static bool is_found_afresh(const bench *b, const hapi_patch_contact *contact, const bench *fresh)
{
  hapi_touch_spot spot = spot_of(b, contact);
  for (uint32_t i = 0; i < fresh->count; ++i) {
    hapi_touch_spot other = spot_of(b, &fresh->found[i]);
    double apart[3];
    hapi_v3_sub(spot.point, other.point, apart);
    if (hapi_v3_norm(apart) <= 1.1e-6 && fabs(spot.gap - other.gap) <= 3e-10 &&
        hapi_v3_dot(spot.normal, other.normal) > 1.0 - 1e-12) {
      return true;
    }
  }
  return false;
}

static uint32_t numbers_kept(const bench *b, const uint64_t *before, uint32_t count)
{
  uint32_t kept = 0;
  for (uint32_t i = 0; i < b->count; ++i) {
    for (uint32_t k = 0; k < count; ++k) {
      kept += b->found[i].number == before[k];
    }
  }
  return kept;
}

typedef struct slide_case {
  const char *name;
  hapi_shape upper;
  double height; /* m, of its centre over the face */
  double turn;   /* rad, about z at the begin */
  double tilt;   /* rad, about x */
  double kept;   /* of its contacts, at least: those have the number that they had */
  bool fixed;
} slide_case;

/* Ways of 3 to 30 um and turns of up to 1e-4 rad a pass: each pass finds all anew. */
TEST(what_is_found_again_is_what_a_fresh_pass_finds)
{
  static const slide_case cases[] = {
      {"flat", {.kind = HAPI_SHAPE_BOX, .half = {0.03, 0.04, 0.02}}, 0.02, 0.3, 0.0, 0.9, false},
      {"tilted", {.kind = HAPI_SHAPE_BOX, .half = {0.03, 0.04, 0.02}}, 0.02, 0.3, 2e-3, 0.9, false},
      {"over the border",
       {.kind = HAPI_SHAPE_BOX, .half = {0.06, 0.07, 0.02}},
       0.02,
       0.4,
       1e-3,
       0.9,
       false},
      {"on the static world",
       {.kind = HAPI_SHAPE_BOX, .half = {0.06, 0.02, 0.02}},
       0.02,
       0.8,
       1e-3,
       0.6, /* of six corners it keeps four, by turns others */
       true},
      {"on its edge",
       {.kind = HAPI_SHAPE_BOX, .half = {0.06, 0.02, 0.02}},
       0.028,
       0.2,
       0.78,
       0.8,
       false},
      {"ball", {.kind = HAPI_SHAPE_SPHERE, .radius = 0.02}, 0.02, 0.0, 0.0, 0.9, false},
      {"capsule",
       {.kind = HAPI_SHAPE_CAPSULE, .radius = 0.02, .half = {0.0, 0.0, 0.04}},
       0.02,
       0.2,
       1.5707,
       0.5,
       false},
  };
  for (size_t n = 0; n < sizeof cases / sizeof cases[0]; ++n) {
    const slide_case *c = &cases[n];
    bench *b = bench_new();
    uint32_t kept = 0;
    uint32_t all = 0;
    uint64_t numbers[CONTACTS_MOST];
    b->fixed = c->fixed;
    b->shapes[0] = c->upper;
    const double about_z[4] = {cos(0.5 * c->turn), 0.0, 0.0, sin(0.5 * c->turn)};
    const double about_x[4] = {cos(0.5 * c->tilt), sin(0.5 * c->tilt), 0.0, 0.0};
    hapi_quat_multiply(about_z, about_x, b->poses[0].quat_wxyz);
    b->poses[0].position[2] = HALF + c->height - DEPTH;
    pass_new(b);
    for (int i = 0; i < 300; ++i) {
      uint32_t count = b->count;
      for (uint32_t k = 0; k < count; ++k) {
        numbers[k] = b->found[k].number;
      }
      double angle = 1e-4 * sin(1.7 * i);
      const double step[4] = {cos(0.5 * angle), 0.02 * sin(0.5 * angle), 0.0, sin(0.5 * angle)};
      hapi_quat_multiply(step, b->poses[0].quat_wxyz, b->poses[0].quat_wxyz);
      b->poses[0].position[0] += 3e-5 * cos(0.9 * i) + 1e-6;
      b->poses[0].position[1] += 2e-5 * sin(1.3 * i) - 1e-6;
      pass_run(b);
      bench *fresh = bench_new();
      fresh->fixed = b->fixed;
      fresh->shapes[0] = b->shapes[0];
      memcpy(fresh->poses, b->poses, sizeof fresh->poses);
      pass_new(fresh);
      CHECK_SAY(b->count == fresh->count, "%s: %u and %u", c->name, b->count, fresh->count);
      for (uint32_t k = 0; k < b->count; ++k) {
        CHECK_SAY(is_found_afresh(b, &b->found[k], fresh), "%s: pass %d, contact %u", c->name, i,
                  k);
      }
      kept += numbers_kept(b, numbers, count);
      all += b->count;
    }
    printf("# %s: %u of %u contacts go on\n", c->name, kept, all);
    CHECK_SAY(all > 0 && kept >= c->kept * all, "%s: %u of %u", c->name, kept, all);
  }
}

/* ---- rules ---- */

static double random_in(uint64_t *io_state, double low, double high)
{
  *io_state = *io_state * 6364136223846793005u + 1442695040888963407u;
  return low + (high - low) * (double)(*io_state >> 11) * 0x1p-53;
}

/* Whether both put the touch at the same place, wherever the bodies are. */
static bool rules_place_alike(const hapi_patch_contact *x, const hapi_patch_contact *y,
                              uint64_t *io_random)
{
  for (int i = 0; i < 12; ++i) {
    double rotations[2][9];
    hap_pose poses[2];
    hapi_touch_spot spots[2];
    for (int k = 0; k < 2; ++k) {
      double q[4] = {1.0};
      for (int n = 0; n < 3; ++n) {
        poses[k].position[n] = random_in(io_random, -0.01, 0.01);
        q[1 + n] = random_in(io_random, -0.05, 0.05);
      }
      double length = sqrt(1.0 + hapi_v3_dot(q + 1, q + 1));
      for (int n = 0; n < 4; ++n) {
        poses[k].quat_wxyz[n] = q[n] / length;
      }
      hapi_quat_to_matrix(poses[k].quat_wxyz, rotations[k]);
    }
    const hapi_touch_frame a = {&poses[0], rotations[0]};
    const hapi_touch_frame b = {&poses[1], rotations[1]};
    CHECK(hapi_touch_place(x, &a, &b, &spots[0]) && hapi_touch_place(y, &a, &b, &spots[1]));
    double apart[3];
    hapi_v3_sub(spots[0].point, spots[1].point, apart);
    if (fabs(spots[0].gap - spots[1].gap) > 1e-9 || hapi_v3_norm(apart) > 1e-9) {
      return false;
    }
  }
  return true;
}

/* A corner, an edge over the border, or a corner of the face; places as by chance. */
static void rule_fill(hapi_touch touch, hapi_slide slide, uint64_t *io_random,
                      hapi_patch_contact *out)
{
  memset(out, 0, sizeof *out);
  out->touch = touch;
  out->slide = slide;
  for (int i = 0; i < 3; ++i) {
    out->core_a[i] = random_in(io_random, -0.01, 0.01);
    out->core_b[i] = random_in(io_random, -0.01, 0.01);
  }
  const double angle = random_in(io_random, 0.5, 1.0);
  double *side = touch == HAPI_TOUCH_FACE_A ? out->edge_a : out->edge_b;
  double *edge = touch == HAPI_TOUCH_FACE_A ? out->edge_b : out->edge_a;
  hapi_v3_set(out->normal, 0.0, 0.6, 0.8);
  hapi_v3_set(side, cos(angle), 0.8 * sin(angle), -0.6 * sin(angle));
  hapi_v3_set(edge, 1.0, 0.0, 0.0);
  if (slide == HAPI_SLIDE_CORNER) {
    hapi_v3_set(edge, 0.1, -0.6 * sqrt(0.99), -0.8 * sqrt(0.99));
  }
}

/* A face has a plane, an edge a line: what goes along them is the same rule. */
TEST(a_rule_is_the_same_where_it_places_the_touch_alike)
{
  static const hapi_touch touches[] = {HAPI_TOUCH_FACE_A, HAPI_TOUCH_FACE_B};
  static const hapi_slide slides[] = {HAPI_SLIDE_NONE, HAPI_SLIDE_EDGE, HAPI_SLIDE_CORNER};
  uint64_t random = 7;
  int same = 0;
  int others = 0;
  for (int n = 0; n < 6000; ++n) {
    hapi_patch_contact x;
    hapi_patch_contact y;
    hapi_touch touch = touches[n % 2];
    rule_fill(touch, slides[n / 2 % 3], &random, &x);
    y = x;
    double *core = n % 5 < 2 ? y.core_a : y.core_b;
    const double *along = n % 5 < 2 ? x.edge_a : x.edge_b;
    double way[3];
    switch (n % 7) { /* across a normal, along an edge, anywhere */
      case 0:
        hapi_v3_cross(x.normal, along, way);
        break;
      case 1:
        hapi_v3_set(way, 0.0, 0.8, -0.6); /* in the face */
        break;
      case 2:
        hapi_v3_copy(along, way);
        break;
      case 3:
        hapi_v3_set(way, -along[1], along[0], 0.0);
        break;
      default:
        for (int i = 0; i < 3; ++i) {
          way[i] = random_in(&random, -1.0, 1.0);
        }
    }
    hapi_v3_madd(core, 1e-4, way, core);
    bool alike = rules_place_alike(&x, &y, &random);
    CHECK_SAY(hapi_rule_is_same(&x, &y, 0.0) == alike, "%d: touch %d, slide %d", n, x.touch,
              x.slide);
    same += alike;
    others += !alike;
  }
  CHECK_SAY(same > 500 && others > 500, "%d and %d", same, others);
}
