/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Bodies that are made of triangles: they lie and slide as the same bodies of boxes do. */

#include <stdatomic.h>

#include "tests/tap.h"

#include "tests/contact_world.h"
#include "tests/solids.h"

#define BARS_MAX 4

/* A body of boxes, whose triangles can stand for them. The boxes do not touch each other. */
typedef struct bars {
  int count;
  double at[BARS_MAX][3];
  double half[BARS_MAX][3];
} bars;

static const bars crate = {1, {{0.0, 0.0, 0.0}}, {{0.025, 0.025, 0.025}}};
static const bars sledge = {2,
                            {{0.0, -0.03, 0.0}, {0.0, 0.03, 0.0}},
                            {{0.05, 0.01, 0.015}, {0.05, 0.01, 0.015}}}; /* two runners */

/* Orders of the triangles: as they are made, turned round, and shuffled with their corners. */
#define ORDERS 5

static void triangles_order(dTriIndex *triangles, int count, int order)
{
  uint32_t random = (uint32_t)order;
  for (int i = count - 1; i > 0 && order > 0; --i) {
    random = 1664525u * random + 1013904223u;
    int other = order == 1 ? count - 1 - i : (int)((random >> 8) % (uint32_t)(i + 1));
    int turned = order == 1 ? 0 : (int)((random >> 28) % 3);
    if (order == 1 && other >= i) {
      break;
    }
    dTriIndex kept[3];
    memcpy(kept, &triangles[3 * i], sizeof kept);
    memmove(&triangles[3 * i], &triangles[3 * other], sizeof kept);
    for (int k = 0; k < 3; ++k) {
      triangles[3 * other + k] = kept[(k + turned) % 3];
    }
  }
}

typedef struct solid {
  double corners[24 * BARS_MAX];
  dTriIndex triangles[36 * BARS_MAX];
} solid;

static int order_of_test;

static dGeomID solid_create(dSpaceID space, const bars *b, solid *s)
{
  for (int n = 0; n < b->count; ++n) {
    box_corners(b->half[n], b->at[n], s->corners + (size_t)24 * (size_t)n);
    for (int i = 0; i < 36; ++i) {
      s->triangles[36 * n + i] = (dTriIndex)(8 * n) + box_triangles[i];
    }
  }
  triangles_order(s->triangles, 12 * b->count, order_of_test);
  return mesh_create(space, s->corners, 8 * b->count, s->triangles, 36 * b->count);
}

static dBodyID add_bars(contact_world *w, const bars *b, solid *mesh, const double at[3])
{
  dMass mass;
  dMassSetBoxTotal(&mass, 0.5, 0.06, 0.06, 0.05);
  if (mesh != NULL) {
    return cw_add(w, solid_create(w->space, b, mesh), &mass, at[0], at[1], at[2]);
  }
  dBodyID body = cw_add(w, NULL, &mass, at[0], at[1], at[2]);
  for (int n = 0; n < b->count; ++n) {
    const double *h = b->half[n];
    dGeomID geom = dCreateBox(w->space, 2.0 * h[0], 2.0 * h[1], 2.0 * h[2]);
    dGeomSetBody(geom, body);
    dGeomSetOffsetPosition(geom, b->at[n][0], b->at[n][1], b->at[n][2]);
  }
  return body;
}

typedef enum ground {
  GROUND_PLANE,
  GROUND_BOX,
  GROUND_RAILS, /* two capsules */
  GROUND_BALLS,
  GROUND_DRUM,
  GROUND_MESH, /* level */
  GROUND_FIELD,
  GROUNDS
} ground;

static const char *const ground_names[] = {"plane", "box",  "rails", "balls",
                                           "drum",  "mesh", "field"};

/* All have their highest point at 0. */
static void add_ground(contact_world *w, ground kind)
{
  static grid level;
  dMatrix3 turned;
  switch (kind) {
    case GROUND_PLANE:
      cw_add_floor(w);
      break;
    case GROUND_BOX:
      dGeomSetPosition(dCreateBox(w->space, 0.8, 0.8, 0.1), 0.0, 0.0, -0.05);
      break;
    case GROUND_RAILS:
      for (int i = 0; i < 2; ++i) {
        dGeomID rail = dCreateCapsule(w->space, 0.02, 1.0);
        dRFromAxisAndAngle(turned, 0.0, 1.0, 0.0, 0.5 * M_PI);
        dGeomSetRotation(rail, turned);
        dGeomSetPosition(rail, 0.0, i == 0 ? -0.02 : 0.02, -0.02);
      }
      break;
    case GROUND_BALLS:
      for (int i = 0; i < 3; ++i) {
        dGeomSetPosition(dCreateSphere(w->space, 0.2), 0.03 * (i == 2) - 0.01,
                         i == 2 ? 0.0 : 0.04 * i - 0.02, -0.2);
      }
      break;
    case GROUND_DRUM:
      dGeomSetPosition(dCreateCylinder(w->space, 0.4, 0.1), 0.0, 0.0, -0.05);
      break;
    case GROUND_MESH:
      mesh_floor(w->space);
      break;
    case GROUND_FIELD:
      grid_fill(&level, 6, 0.8 / 6.0, grid_level);
      grid_field(w->space, &level);
      break;
    case GROUNDS:
      break;
  }
}

#define TICKS 500

typedef struct course {
  double force[TICKS][3];
  double at[3];
  uint32_t owned;
  uint32_t measured;
} course;

/* Pushed along x, on ground, by a sphere. */
static void course_run(const bars *b, bool as_mesh, ground kind, double physics_hz, course *out)
{
  static solid mesh;
  contact_world w;
  cw_open(&w, CW_GRAVITY);
  w.def.physics_hz = physics_hz;
  const double half = b->half[0][2];
  add_bars(&w, b, as_mesh ? &mesh : NULL, (const double[3]){0.0, 0.0, half - 1e-4});
  add_ground(&w, kind);
  const double side = b->at[0][1];
  cw_start(&w, -b->half[0][0] - 0.012, side, 0.8 * half);
  cw_move_hand(&w, 0.06, 0.0, 0.0);
  for (int i = 0; i < TICKS; ++i) {
    cw_tick(&w);
    memcpy(out->force[i], w.force, sizeof out->force[i]);
  }
  hap_stats stats = cw_stats(&w);
  out->owned = stats.model.range_bodies;
  out->measured = stats.model.measured_bodies;
  memcpy(out->at, w.position[0], sizeof out->at);
  cw_close(&w);
}

/* RMS, share of the force of the second. */
static double course_apart(const course *a, const course *b, double *out_apart)
{
  double off = 0.0;
  double sum = 0.0;
  *out_apart = 0.0;
  for (int i = 0; i < TICKS; ++i) {
    for (int k = 0; k < 3; ++k) {
      double d = a->force[i][k] - b->force[i][k];
      off += d * d;
      sum += b->force[i][k] * b->force[i][k];
    }
  }
  for (int k = 0; k < 3; ++k) {
    *out_apart = fmax(*out_apart, fabs(a->at[k] - b->at[k]));
  }
  return sqrt(off / sum);
}

static void course_compare(const bars *b, const char *name, ground kind, double hz)
{
  static course mesh;
  static course box;
  double apart;
  course_run(b, true, kind, hz, &mesh);
  course_run(b, false, kind, hz, &box);
  double off = course_apart(&mesh, &box, &apart);
  printf("# %s on %s, %.0f Hz: force %.3f %% off, %.2g mm apart of %.0f mm\n", name,
         ground_names[kind], hz, 100.0 * off, 1e3 * apart, 1e3 * box.at[0]);
  CHECK(mesh.owned == 1 && mesh.measured == 0);
  CHECK(box.at[0] > 0.005);
  CHECK(off < 0.02);
  CHECK(apart < 2e-4);
}

TEST(a_crate_of_triangles_slides_as_a_box)
{
  for (int kind = 0; kind < GROUNDS; ++kind) {
    course_compare(&crate, "crate", (ground)kind, 20.0);
  }
}

/* What is not convex. */
TEST(a_sledge_of_triangles_slides_as_its_runners)
{
  course_compare(&sledge, "sledge", GROUND_PLANE, 60.0);
  course_compare(&sledge, "sledge", GROUND_BOX, 20.0);
  course_compare(&sledge, "sledge", GROUND_MESH, 20.0);
  course_compare(&sledge, "sledge", GROUND_FIELD, 20.0);
}

/* Boxes on a plane have no seams: what lies on level triangles is as they are, in any order of its
 * own triangles. */
TEST(no_order_of_triangles_is_felt)
{
  static const ground level[] = {GROUND_FIELD, GROUND_MESH};
  static course right;
  static course now;
  double apart;
  course_run(&sledge, false, GROUND_PLANE, 60.0, &right);
  for (int g = 0; g < 2; ++g) {
    course_run(&sledge, false, level[g], 60.0, &now);
    CHECK(course_apart(&now, &right, &apart) < 1e-3);
    for (order_of_test = 0; order_of_test < ORDERS; ++order_of_test) {
      course_run(&sledge, true, level[g], 60.0, &now);
      double off = course_apart(&now, &right, &apart);
      printf("# on %s, order %d: force %.4f %% off\n", ground_names[level[g]], order_of_test,
             100.0 * off);
      CHECK(off < 1e-3);
      CHECK(apart < 1e-5);
    }
    order_of_test = 0;
  }
}

static _Atomic int said;

static void count_said(hap_log_level level, const char *text, void *user)
{
  (void)user;
  if (level >= HAP_LOG_WARNING && strstr(text, "triangle meshes") != NULL) {
    atomic_fetch_add(&said, 1);
  }
}

/* Two of them near each other are measured, and that is said once. */
TEST(two_crates_of_triangles_are_measured)
{
  static solid meshes[2];
  contact_world w;
  hap_hooks hooks;
  hap_hooks_init(&hooks, sizeof hooks);
  hooks.log = count_said;
  REQUIRE(hap_hooks_set(&hooks) == HAP_OK);
  cw_open(&w, CW_GRAVITY);
  cw_add_floor(&w);
  add_bars(&w, &crate, &meshes[0], (const double[3]){0.0, 0.0, 0.0249});
  add_bars(&w, &crate, &meshes[1], (const double[3]){0.06, 0.0, 0.0249});
  cw_start(&w, -0.04, 0.0, 0.02);
  cw_run(&w, 300);
  hap_stats stats = cw_stats(&w);
  CHECK(stats.model.range_bodies == 0 && stats.model.measured_bodies >= 1);
  CHECK(atomic_load(&said) == 1);
  cw_close(&w);
  CHECK(hap_hooks_set(NULL) == HAP_OK);
}
