/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Scenes without ODE's types: what is asked for here is what a binding would ask for. */

#include "tests/tap.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include <hapode/hapode.h>

#define REST 1e-3

static hap_scene *scene_new(double gravity)
{
  hap_scene_def def;
  hap_scene *scene = NULL;
  hap_detail detail = {""};
  hap_scene_def_init(&def, sizeof def);
  def.gravity[2] = -gravity;
  REQUIRE_SAY(hap_scene_create(&def, &scene, &detail) == HAP_OK, "%s", detail.text);
  return scene;
}

static hap_geom_def geom_of(hap_shape shape)
{
  hap_geom_def def;
  hap_geom_def_init(&def, sizeof def);
  def.shape = shape;
  return def;
}

static uint32_t body_add(hap_scene *scene, const hap_geom_def *geoms, size_t count,
                         const double at[3])
{
  hap_body_def def;
  hap_detail detail = {""};
  uint32_t body = HAP_SCENE_WORLD;
  hap_body_def_init(&def, sizeof def);
  memcpy(def.pose.position, at, sizeof def.pose.position);
  def.geoms = geoms;
  def.geom_count = count;
  REQUIRE_SAY(hap_scene_add_body(scene, &def, &body, NULL, &detail) == HAP_OK, "%s", detail.text);
  return body;
}

static uint32_t floor_add(hap_scene *scene)
{
  hap_geom_def plane = geom_of(HAP_SHAPE_PLANE);
  uint32_t geom = 0;
  REQUIRE(hap_scene_add_geom(scene, &plane, &geom, NULL) == HAP_OK);
  return geom;
}

static hap_session *session_over(hap_scene *scene)
{
  hap_session_def def;
  hap_session *session = NULL;
  hap_detail detail = {""};
  hap_session_def_init(&def, sizeof def);
  def.drive = HAP_DRIVE_LOCKSTEP;
  REQUIRE_SAY(hap_scene_session(scene, &def, &session, &detail) == HAP_OK, "%s", detail.text);
  return session;
}

static hap_scene_body body_at(const hap_scene *scene, uint32_t number)
{
  hap_scene_body body;
  memset(&body, 0, sizeof body);
  CHECK(hap_scene_get_body(scene, number, &body, sizeof body) == HAP_OK);
  return body;
}

static void scene_end(hap_scene *scene, hap_session *session)
{
  hap_session_destroy(session);
  CHECK(hap_scene_destroy(scene) == HAP_OK);
}

/* ---- mass ---- */

/* A shaft of no geom at all, with a ball: what the def says counts, and not the ball. */
TEST(a_body_may_have_its_own_inertia)
{
  hap_scene *scene = scene_new(0.0);
  hap_geom_def ball = geom_of(HAP_SHAPE_SPHERE);
  hap_body_def def;
  uint32_t bodies[2];
  const double inertia[3][3] = {{0.3, 0.02, -0.01}, {0.02, 0.4, 0.03}, {-0.01, 0.03, 0.5}};
  hap_body_def_init(&def, sizeof def);
  def.geoms = &ball;
  def.mass = 3.0;
  def.has_inertia = 1;
  memcpy(def.centre, ((double[3]){0.1, -0.2, 0.3}), sizeof def.centre);
  memcpy(def.inertia, inertia, sizeof def.inertia);
  for (size_t i = 0; i < 2; ++i) {
    def.geom_count = i;
    CHECK(hap_scene_add_body(scene, &def, &bodies[i], NULL, NULL) == HAP_OK);
    hap_scene_body body = body_at(scene, bodies[i]);
    CHECK_NEAR(body.mass, 3.0, 1e-12);
    for (int k = 0; k < 9; ++k) {
      CHECK_NEAR((&body.inertia[0][0])[k], (&inertia[0][0])[k], 1e-12);
      CHECK_NEAR(body.centre[k % 3], def.centre[k % 3], 1e-12);
    }
    CHECK_NEAR(body.pose.position[0], 0.0, 1e-12);
  }
  scene_end(scene, NULL);
}

static const struct {
  double mass;
  double inertia[3][3];
  const char *says;
} no_bodies[] = {
    {0.0, {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, "mass is 0"},
    {1.0, {{1, 0.1, 0}, {0, 1, 0}, {0, 0, 1}}, "not symmetric"},
    {1.0, {{1, 0, 0}, {0, -1, 0}, {0, 0, 1}}, "positive definite"},
    {1.0, {{1, 0, 0}, {0, 1, 0}, {0, 0, 2.1}}, "exceeds the sum"},
    {1.0, {{1, 0, 0}, {0, NAN, 0}, {0, 0, 1}}, "not finite"},
};

TEST(an_inertia_that_no_body_has_is_refused)
{
  hap_scene *scene = scene_new(0.0);
  for (size_t i = 0; i < sizeof no_bodies / sizeof no_bodies[0]; ++i) {
    hap_body_def def;
    hap_detail why = {""};
    hap_scene_counts counts;
    hap_body_def_init(&def, sizeof def);
    def.has_inertia = 1;
    def.mass = no_bodies[i].mass;
    memcpy(def.inertia, no_bodies[i].inertia, sizeof def.inertia);
    CHECK(hap_scene_add_body(scene, &def, NULL, NULL, &why) == HAP_ERROR_ARGUMENT);
    CHECK_SAY(strstr(why.text, no_bodies[i].says) != NULL, "%s", why.text);
    CHECK(hap_scene_count(scene, &counts, sizeof counts) == HAP_OK && counts.bodies == 0);
  }
  scene_end(scene, NULL);
}

/* Three balls fall on each other: those that shall pass do, and the third stays on top. */
TEST(bodies_that_are_let_pass_fall_through_each_other)
{
  hap_scene *scene = scene_new(9.81);
  hap_geom_def ball = geom_of(HAP_SHAPE_SPHERE);
  uint32_t balls[3];
  floor_add(scene);
  for (int i = 0; i < 3; ++i) {
    balls[i] = body_add(scene, &ball, 1, (double[3]){0.0, 0.0, 0.05 + 0.11 * i});
  }
  CHECK(hap_scene_let_pass(scene, balls[1], balls[0], NULL) == HAP_OK);
  CHECK(hap_scene_let_pass(scene, balls[0], balls[1], NULL) == HAP_OK);
  CHECK(hap_scene_let_pass(scene, balls[0], balls[0], NULL) == HAP_ERROR_ARGUMENT);
  CHECK(hap_scene_let_pass(scene, balls[0], 7, NULL) == HAP_ERROR_NOT_FOUND);
  hap_session *session = session_over(scene);
  REQUIRE(hap_session_start(session) == HAP_OK);
  CHECK(hap_session_advance(session, 1000) >= HAP_OK);
  CHECK_NEAR(body_at(scene, balls[0]).pose.position[2], 0.05, REST);
  CHECK_NEAR(body_at(scene, balls[1]).pose.position[2], 0.05, REST);
  CHECK_NEAR(body_at(scene, balls[2]).pose.position[2], 0.15, 2.0 * REST);
  scene_end(scene, session);
}

/* A hammer whose frame is at the end of its shaft: the sums of two boxes, by hand. */
TEST(mass_and_centre_of_a_body_are_those_of_its_geoms)
{
  hap_scene *scene = scene_new(0.0);
  hap_geom_def parts[2] = {geom_of(HAP_SHAPE_BOX), geom_of(HAP_SHAPE_BOX)};
  memcpy(parts[0].edges, ((double[3]){0.02, 0.02, 0.3}), sizeof parts[0].edges);
  parts[0].pose.position[2] = 0.15;
  parts[0].density = 700.0;
  memcpy(parts[1].edges, ((double[3]){0.1, 0.04, 0.04}), sizeof parts[1].edges);
  parts[1].pose.position[2] = 0.32;
  parts[1].density = 7800.0;
  double shaft = 700.0 * 0.02 * 0.02 * 0.3;
  double head = 7800.0 * 0.1 * 0.04 * 0.04;
  double z = (0.15 * shaft + 0.32 * head) / (shaft + head);
  double across = shaft / 12.0 * (0.02 * 0.02 + 0.3 * 0.3) + shaft * (z - 0.15) * (z - 0.15) +
                  head / 12.0 * (0.1 * 0.1 + 0.04 * 0.04) + head * (0.32 - z) * (0.32 - z);
  uint32_t hammer = body_add(scene, parts, 2, (double[3]){1.0, 2.0, 3.0});
  hap_scene_body body = body_at(scene, hammer);
  CHECK_NEAR(body.mass, shaft + head, 1e-12);
  CHECK_NEAR(body.centre[2], z, 1e-12);
  CHECK_NEAR(body.inertia[1][1], across, 1e-12);
  CHECK_NEAR(body.pose.position[0], 1.0, 1e-12);
  CHECK_NEAR(body.pose.position[2], 3.0, 1e-12);
  /* Its frame stays where it is put, and turns about the centre of mass when nothing holds it. */
  hap_twist twist = {{0.0, 0.0, 0.0}, {0.0, 2.0, 0.0}};
  CHECK(hap_scene_set_twist(scene, hammer, &twist) == HAP_OK);
  body = body_at(scene, hammer);
  CHECK_NEAR(body.twist.linear[0], 0.0, 1e-12);
  CHECK_NEAR(body.twist.angular[1], 2.0, 1e-12);
  hap_session *session = session_over(scene);
  CHECK(hap_session_start(session) >= HAP_OK);
  CHECK(hap_session_advance(session, 501) == HAP_OK);
  body = body_at(scene, hammer);
  /* The centre goes straight at 2 z along x; the frame's origin is z behind it along the shaft. */
  double angle = 2.0 * 0.5;
  CHECK_NEAR(body.pose.position[0], 1.0 + 2.0 * z * 0.5 - z * sin(angle), 1e-3);
  CHECK_NEAR(body.pose.position[2], 3.0 + z - z * cos(angle), 1e-3);
  scene_end(scene, session);
}

/* A cube as a mesh is a cube. */
static const double corners[24] = {-1, -1, -1, 1, -1, -1, 1, 1, -1, -1, 1, -1,
                                   -1, -1, 1,  1, -1, 1,  1, 1, 1,  -1, 1, 1};
static const uint32_t sides[36] = {0, 2, 1, 0, 3, 2, 4, 5, 6, 4, 6, 7, 0, 1, 5, 0, 5, 4,
                                   1, 2, 6, 1, 6, 5, 2, 3, 7, 2, 7, 6, 3, 0, 4, 3, 4, 7};

static hap_geom_def cube_mesh(double *vertices, double half)
{
  hap_geom_def def = geom_of(HAP_SHAPE_MESH);
  for (int i = 0; i < 24; ++i) {
    vertices[i] = half * corners[i];
  }
  def.vertices_xyz = vertices;
  def.vertex_count = 8;
  def.triangles = sides;
  def.triangle_count = 12;
  return def;
}

TEST(a_closed_mesh_has_the_mass_of_its_volume)
{
  hap_scene *scene = scene_new(9.81);
  double vertices[24];
  hap_geom_def def = cube_mesh(vertices, 0.05);
  def.pose.position[0] = 0.3;
  uint32_t cube = body_add(scene, &def, 1, (double[3]){0.0, 0.0, 0.05});
  hap_scene_body body = body_at(scene, cube);
  CHECK_NEAR(body.mass, 1.0, 1e-6); /* ODE has single precision here */
  CHECK_NEAR(body.centre[0], 0.3, 1e-6);
  CHECK_NEAR(body.inertia[2][2], 0.01 / 6.0, 1e-8);
  vertices[0] = 9.0; /* the scene has its own */
  uint32_t triangles[36];
  double read[24];
  CHECK(hap_scene_mesh(scene, 0, read, 8, triangles, 12) == HAP_OK);
  CHECK(read[0] == -0.05 && memcmp(triangles, sides, sizeof sides) == 0);
  CHECK(hap_scene_mesh(scene, 0, read, 7, triangles, 12) == HAP_ERROR_CAPACITY);
  (void)floor_add(scene);
  CHECK(hap_scene_mesh(scene, 1, read, 8, triangles, 12) == HAP_ERROR_UNSUPPORTED);
  hap_session *session = session_over(scene);
  CHECK(hap_session_start(session) >= HAP_OK);
  CHECK(hap_session_advance(session, 1000) == HAP_OK);
  CHECK_NEAR(body_at(scene, cube).pose.position[2], 0.05, REST);
  scene_end(scene, session);
}

/* ---- what is felt ---- */

/* N: along z, on a ball of 10 mm and 1 kN/m whose centre is pressed to (x, y, z). */
static double force_at(hap_session *session, hap_pointer_id hand, double x, double y, double z)
{
  hap_pointer_state state;
  for (int i = 0; i <= 300; ++i) { /* slowly from above */
    hap_pose pose = {{x, y, z + 1e-4 * (300 - i)}, {1.0, 0.0, 0.0, 0.0}};
    CHECK(hap_pointer_set_target(session, hand, &pose, NULL) == HAP_OK);
    CHECK(hap_session_advance(session, 1) == HAP_OK);
  }
  CHECK(hap_session_advance(session, 100) == HAP_OK);
  CHECK(hap_pointer_get(session, hand, &state, sizeof state) == HAP_OK);
  return state.wrench.force[2];
}

static hap_pointer_id ball_add(hap_session *session)
{
  hap_pointer_def def;
  hap_pointer_id hand;
  hap_pointer_def_init(&def, sizeof def);
  def.radius = 0.01;
  def.stiffness = 1000.0;
  REQUIRE(hap_pointer_add(session, &def, &hand) == HAP_OK);
  return hand;
}

/* Heights rise along x alone, along y alone, and at one corner: where which row and column is, and
 * how a cell is cut, shows in what is felt. */
TEST(a_field_is_felt_where_its_heights_are)
{
  static const double rises[3][4] = {{0.0, 0.1, 0.0, 0.1},  /* with the columns: along x */
                                     {0.0, 0.0, 0.1, 0.1},  /* with the rows: along y */
                                     {0.0, 0.0, 0.1, 0.0}}; /* at low x, high y */
  for (int i = 0; i < 3; ++i) {
    hap_scene *scene = scene_new(0.0);
    hap_geom_def def = geom_of(HAP_SHAPE_FIELD);
    def.heights = rises[i];
    def.columns = def.rows = 2;
    def.edges[0] = def.edges[1] = 1.0;
    def.pose.position[2] = 0.5;
    CHECK(hap_scene_add_geom(scene, &def, NULL, NULL) == HAP_OK);
    hap_scene_geom geom;
    CHECK(hap_scene_get_geom(scene, 0, &geom, sizeof geom) == HAP_OK);
    double v[12];
    uint32_t t[6];
    CHECK(geom.vertex_count == 4 && geom.triangle_count == 2);
    REQUIRE(hap_scene_mesh(scene, 0, v, 4, t, 2) == HAP_OK);
    hap_session *session = session_over(scene);
    hap_pointer_id hand = ball_add(session);
    CHECK(hap_session_start(session) >= HAP_OK);
    static const double places[2][2] = {{0.2, -0.25}, {-0.25, 0.2}};
    for (int k = 0; k < 2; ++k) {
      double x = places[k][0];
      double y = places[k][1];
      /* Of the triangle that the place is in: the first is below the diagonal, the second above. */
      const uint32_t *corner = t + (x > y ? 0 : 3);
      const double *a = v + 3 * corner[0];
      const double *b = v + 3 * corner[1];
      const double *c = v + 3 * corner[2];
      double det = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
      double s = ((x - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (y - a[1])) / det;
      double u = ((b[0] - a[0]) * (y - a[1]) - (x - a[0]) * (b[1] - a[1])) / det;
      CHECK(s >= 0.0 && u >= 0.0 && s + u <= 1.0);
      double height = 0.5 + a[2] + s * (b[2] - a[2]) + u * (c[2] - a[2]);
      double slope_x = ((b[2] - a[2]) * (c[1] - a[1]) - (c[2] - a[2]) * (b[1] - a[1])) / det;
      double slope_y = ((b[0] - a[0]) * (c[2] - a[2]) - (c[0] - a[0]) * (b[2] - a[2])) / det;
      double up = 1.0 / sqrt(1.0 + slope_x * slope_x + slope_y * slope_y);
      /* 2 mm deep along z: less along the normal, and of that force a part is along z. */
      double z = height + 0.01 / up - 0.002;
      CHECK_NEAR(force_at(session, hand, x, y, z), 2.0 * up * up, 1e-3);
    }
    scene_end(scene, session);
  }
}

TEST(who_is_touched_has_a_number)
{
  hap_scene *scene = scene_new(0.0);
  hap_geom_def two[2] = {geom_of(HAP_SHAPE_BOX), geom_of(HAP_SHAPE_SPHERE)};
  two[1].pose.position[0] = 1.0;
  (void)body_add(scene, two, 1, (double[3]){0.0, 3.0, 0.0});
  hap_body_def def;
  uint32_t body = 0;
  uint32_t first = 0;
  hap_body_def_init(&def, sizeof def);
  def.geoms = two;
  def.geom_count = 2;
  def.is_kinematic = 1;
  REQUIRE(hap_scene_add_body(scene, &def, &body, &first, NULL) == HAP_OK);
  CHECK(body == 1 && first == 1);
  hap_session *session = session_over(scene);
  hap_pointer_id hand = ball_add(session);
  CHECK(hap_session_start(session) >= HAP_OK);
  hap_touch touch;
  size_t count = 0;
  (void)hap_pointer_touches(session, hand, &touch, 1, sizeof touch, &count);
  CHECK_NEAR(force_at(session, hand, 1.0, 0.0, 0.058), 2.0, 1e-6); /* the ball of 50 mm */
  CHECK(hap_pointer_touches(session, hand, &touch, 1, sizeof touch, &count) == HAP_OK &&
        count == 1);
  CHECK(hap_scene_find_geom(scene, touch.geom) == first + 1);
  CHECK(hap_scene_find_body(scene, touch.body) == body);
  CHECK(hap_scene_find_geom(scene, session) == HAP_SCENE_WORLD);
  CHECK(hap_scene_find_body(scene, NULL) == HAP_SCENE_WORLD);
  scene_end(scene, session);
}

/* ---- joints ---- */

/* A pendulum of length L from its hinge to its centre: T = 2 pi sqrt((I + m L^2) / (m g L)). */
TEST(a_pendulum_swings_at_its_period)
{
  hap_scene *scene = scene_new(9.81);
  hap_geom_def bar = geom_of(HAP_SHAPE_CAPSULE);
  bar.radius = 0.01;
  bar.length = 0.4;
  bar.pose.position[2] = -0.2; /* the frame is at the hinge */
  uint32_t body = body_add(scene, &bar, 1, (double[3]){0.0, 0.0, 1.0});
  hap_joint_def def;
  uint32_t joint = 9;
  hap_joint_def_init(&def, sizeof def);
  def.kind = HAP_JOINT_HINGE;
  def.body_a = body;
  def.anchor[2] = 1.0;
  memcpy(def.axis[0], ((double[3]){0.0, 3.0, 0.0}), sizeof def.axis[0]);
  REQUIRE(hap_scene_add_joint(scene, &def, &joint, NULL) == HAP_OK);
  hap_twist push = {{0.0, 0.0, 0.0}, {0.0, 0.3, 0.0}};
  CHECK(hap_scene_set_twist(scene, body, &push) == HAP_OK);
  hap_scene_body b = body_at(scene, body);
  double period = 2.0 * M_PI * sqrt((b.inertia[1][1] + b.mass * 0.04) / (b.mass * 9.81 * 0.2));
  hap_session_def session_def;
  hap_session *session = NULL;
  hap_session_def_init(&session_def, sizeof session_def);
  session_def.drive = HAP_DRIVE_LOCKSTEP;
  session_def.physics_hz = 500.0;
  REQUIRE(hap_scene_session(scene, &session_def, &session, NULL) == HAP_OK);
  CHECK(hap_session_start(session) >= HAP_OK);
  hap_scene_joint j;
  double last = 0.0;
  double first_s = 0.0;
  double last_s = 0.0;
  int rises = 0;
  for (int i = 0; i < 6000; ++i) {
    CHECK(hap_session_advance(session, 1) == HAP_OK);
    REQUIRE(hap_scene_get_joint(scene, joint, &j, sizeof j) == HAP_OK);
    if (last < 0.0 && j.position[0] >= 0.0) {
      last_s = 1e-3 * i;
      first_s = rises++ == 0 ? last_s : first_s;
    }
    last = j.position[0];
  }
  printf("# %.4g s, %.4g s are right\n", (last_s - first_s) / (rises - 1), period);
  CHECK(rises > 3);
  CHECK_NEAR((last_s - first_s) / (rises - 1), period, 0.005 * period);
  CHECK(j.kind == HAP_JOINT_HINGE && j.axes == 1 && j.body_a == body &&
        j.body_b == HAP_SCENE_WORLD);
  CHECK_NEAR(fabs(j.axis[0][1]), 1.0, 1e-9);
  CHECK_NEAR(j.anchor[2], 1.0, 1e-6);
  scene_end(scene, session);
}

/* A weight hangs on a joint until the joint is gone; then it falls. */
TEST(a_joint_that_is_removed_holds_nothing)
{
  hap_scene *scene = scene_new(9.81);
  hap_geom_def ball = geom_of(HAP_SHAPE_SPHERE);
  uint32_t body = body_add(scene, &ball, 1, (double[3]){0.0, 0.0, 1.0});
  hap_joint_def def;
  uint32_t joint = 9;
  hap_joint_def_init(&def, sizeof def);
  def.kind = HAP_JOINT_FIXED;
  def.body_a = body;
  REQUIRE(hap_scene_add_joint(scene, &def, &joint, NULL) == HAP_OK);
  hap_session_def session_def;
  hap_session *session = NULL;
  hap_session_def_init(&session_def, sizeof session_def);
  session_def.drive = HAP_DRIVE_LOCKSTEP;
  REQUIRE(hap_scene_session(scene, &session_def, &session, NULL) == HAP_OK);
  CHECK(hap_session_start(session) >= HAP_OK);
  CHECK(hap_session_advance(session, 200) == HAP_OK);
  CHECK_NEAR(body_at(scene, body).pose.position[2], 1.0, 1e-3);
  CHECK(hap_scene_remove_joint(scene, joint) == HAP_OK);
  CHECK(hap_scene_remove_joint(scene, joint) == HAP_ERROR_NOT_FOUND);
  CHECK(hap_session_advance(session, 300) == HAP_OK);
  CHECK_NEAR(body_at(scene, body).pose.position[2], 1.0 - 0.5 * 9.81 * 0.09, 0.05);
  scene_end(scene, session);
}

TEST(every_kind_of_joint_has_its_axes_stops_and_motor)
{
  static const struct {
    hap_joint_kind kind;
    uint32_t axes;
  } kinds[] = {{HAP_JOINT_BALL, 0},      {HAP_JOINT_HINGE, 1},  {HAP_JOINT_SLIDER, 1},
               {HAP_JOINT_UNIVERSAL, 2}, {HAP_JOINT_HINGE2, 2}, {HAP_JOINT_FIXED, 0}};
  for (size_t i = 0; i < sizeof kinds / sizeof kinds[0]; ++i) {
    hap_scene *scene = scene_new(0.0);
    hap_geom_def ball = geom_of(HAP_SHAPE_SPHERE);
    hap_joint_def def;
    hap_scene_joint j;
    hap_joint_def_init(&def, sizeof def);
    def.kind = kinds[i].kind;
    def.body_a = body_add(scene, &ball, 1, (double[3]){0.0, 0.0, 0.0});
    def.body_b = body_add(scene, &ball, 1, (double[3]){0.0, 0.5, 0.0});
    def.anchor[1] = 0.25;
    def.low[0] = -0.2;
    def.high[0] = 0.2;
    def.motor_speed[0] = 1.0;
    def.motor_force[0] = 5.0;
    REQUIRE(hap_scene_add_joint(scene, &def, NULL, NULL) == HAP_OK);
    CHECK(hap_scene_get_joint(scene, 0, &j, sizeof j) == HAP_OK);
    CHECK(j.kind == kinds[i].kind && j.axes == kinds[i].axes && j.body_a == 0 && j.body_b == 1);
    hap_session *session = session_over(scene);
    CHECK(hap_session_start(session) >= HAP_OK);
    CHECK(hap_session_advance(session, 1000) == HAP_OK);
    CHECK(hap_scene_get_joint(scene, 0, &j, sizeof j) == HAP_OK);
    if (j.axes > 0) { /* it has gone to a stop and stays there */
      CHECK_NEAR(fabs(j.position[0]), 0.2, 5e-3);
      CHECK(hap_scene_set_motor(scene, 0, 0, -1.0, 5.0) == HAP_OK);
      double before = j.position[0];
      CHECK(hap_session_advance(session, 1000) == HAP_OK);
      CHECK(hap_scene_get_joint(scene, 0, &j, sizeof j) == HAP_OK);
      CHECK_NEAR(j.position[0], -before, 1e-2);
    }
    CHECK(hap_scene_set_motor(scene, 0, j.axes, 1.0, 1.0) == HAP_ERROR_UNSUPPORTED);
    scene_end(scene, session);
  }
}

/* ---- built-in scenes ---- */

TEST(all_built_in_scenes_load_and_run)
{
  const char *text = NULL;
  for (size_t i = 0; hap_scene_name_at(i, &text) != NULL; ++i) {
    hap_scene *scene = NULL;
    hap_scene_counts counts;
    hap_detail detail = {""};
    CHECK(text != NULL && text[0] != '\0');
    REQUIRE_SAY(hap_scene_load(hap_scene_name_at(i, NULL), &scene, &detail) == HAP_OK, "%s",
                detail.text);
    CHECK(hap_scene_count(scene, &counts, sizeof counts) == HAP_OK);
    CHECK(counts.bodies > 0 && counts.geoms >= counts.bodies && counts.hands > 0);
    for (uint32_t k = 0; k < counts.geoms; ++k) {
      hap_scene_geom geom;
      CHECK(hap_scene_get_geom(scene, k, &geom, sizeof geom) == HAP_OK);
      CHECK(geom.body < counts.bodies || geom.body == HAP_SCENE_WORLD);
      CHECK(geom.colour_rgba[3] == 1.0F);
    }
    hap_session *session = session_over(scene);
    hap_device *devices[2] = {NULL, NULL};
    for (uint32_t k = 0; k < counts.hands; ++k) {
      hap_pointer_def def;
      hap_pointer_id hand;
      const char *spec = NULL;
      hap_pointer_def_init(&def, sizeof def);
      CHECK(hap_scene_hand(scene, k, &def, &spec) == HAP_OK);
      REQUIRE(hap_device_open(spec, &devices[k], &detail) == HAP_OK);
      def.device = devices[k];
      REQUIRE(hap_pointer_add(session, &def, &hand) == HAP_OK);
    }
    CHECK(hap_session_start(session) >= HAP_OK);
    CHECK(hap_session_advance(session, 100) >= HAP_OK);
    hap_pose poses[16];
    size_t drawn = counts.bodies < 16 ? counts.bodies : 16;
    CHECK(hap_scene_poses(scene, hap_session_now(session), 0, drawn, poses) == HAP_OK);
    CHECK_NEAR(poses[0].quat_wxyz[0] * poses[0].quat_wxyz[0] +
                   poses[0].quat_wxyz[1] * poses[0].quat_wxyz[1] +
                   poses[0].quat_wxyz[2] * poses[0].quat_wxyz[2] +
                   poses[0].quat_wxyz[3] * poses[0].quat_wxyz[3],
               1.0, 1e-9);
    scene_end(scene, session);
    for (uint32_t k = 0; k < counts.hands; ++k) {
      hap_device_close(devices[k]);
    }
  }
}

/* ---- changes and mistakes ---- */

TEST(things_come_and_go_while_it_runs)
{
  hap_scene *scene = scene_new(9.81);
  hap_geom_def box = geom_of(HAP_SHAPE_BOX);
  uint32_t floor = floor_add(scene);
  uint32_t a = body_add(scene, &box, 1, (double[3]){0.0, 0.0, 0.05});
  hap_session *session = session_over(scene);
  hap_session *second = NULL;
  hap_detail detail = {""};
  CHECK(hap_scene_session(scene, NULL, &second, &detail) == HAP_ERROR_STATE && second == NULL);
  CHECK(hap_session_start(session) >= HAP_OK);
  CHECK(hap_session_advance(session, 100) == HAP_OK);
  CHECK(hap_scene_destroy(scene) == HAP_ERROR_STATE);
  uint32_t b = body_add(scene, &box, 1, (double[3]){0.0, 0.0, 0.15});
  CHECK(hap_session_advance(session, 500) == HAP_OK);
  CHECK_NEAR(body_at(scene, b).pose.position[2], 0.15, REST);
  CHECK(hap_scene_remove_body(scene, a) == HAP_OK);
  CHECK(hap_scene_remove_body(scene, a) == HAP_ERROR_NOT_FOUND);
  hap_pose poses[2] = {{{7.0}, {0.0}}, {{0.0}, {0.0}}};
  CHECK(hap_session_advance(session, 1000) == HAP_OK);
  CHECK(hap_scene_poses(scene, hap_session_now(session), 0, 2, poses) == HAP_OK);
  CHECK(poses[0].position[0] == 7.0); /* of nobody */
  CHECK_NEAR(poses[1].position[2], 0.05, REST);
  CHECK(hap_scene_poses(scene, 0, 1, 2, poses) == HAP_ERROR_NOT_FOUND);
  uint32_t c = body_add(scene, &box, 1, (double[3]){0.0, 0.0, 0.15});
  CHECK(c == 2); /* numbers do not come again */
  hap_pose up = {{0.0, 0.0, 5.0}, {1.0, 0.0, 0.0, 0.0}};
  CHECK(hap_scene_set_pose(scene, b, &up) == HAP_OK);
  CHECK(hap_scene_remove_geom(scene, floor) == HAP_OK);
  CHECK(hap_scene_remove_geom(scene, 1) == HAP_ERROR_NOT_FOUND); /* it went with its body */
  CHECK(hap_scene_remove_geom(scene, 3) == HAP_ERROR_STATE);
  CHECK(hap_session_advance(session, 1000) == HAP_OK);
  CHECK(body_at(scene, c).pose.position[2] < -3.0); /* it falls */
  hap_stats stats;
  CHECK(hap_session_stats(session, &stats, sizeof stats) == HAP_OK);
  CHECK(stats.faults.bodies_lost == 0 && stats.faults.count == 0);
  scene_end(scene, session);
}

static double stepped_s;

static void steps_add(void *user, double step_s)
{
  hap_scene *scene = user;
  hap_wrench wind = {{0.5, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  stepped_s += step_s;
  CHECK(hap_scene_push(scene, 0, &wind) == HAP_OK);
}

TEST(step_functions_push)
{
  hap_scene *scene = scene_new(0.0);
  hap_geom_def box = geom_of(HAP_SHAPE_BOX); /* 1 kg */
  (void)body_add(scene, &box, 1, (double[3]){0.0, 0.0, 0.0});
  stepped_s = 0.0;
  CHECK(hap_scene_set_steps(scene, steps_add, NULL, scene) == HAP_OK);
  hap_session *session = session_over(scene);
  CHECK(hap_scene_set_steps(scene, NULL, NULL, NULL) == HAP_ERROR_STATE);
  CHECK(hap_session_start(session) >= HAP_OK);
  CHECK(hap_session_advance(session, 1001) == HAP_OK);
  CHECK_NEAR(stepped_s, 1.0, 1e-9);
  CHECK_NEAR(body_at(scene, 0).twist.linear[0], 0.5 * stepped_s, 1e-9);
  scene_end(scene, session);
}

/* A geom number, and the stiffness that the function gives it. */
typedef struct felt_geom {
  uint32_t geom;
  double stiffness;
  int calls;
} felt_geom;

static void surface_soften(void *user, uint32_t geom, hap_pointer_id pointer, hap_surface *io)
{
  felt_geom *felt = user;
  felt->geom = geom;
  felt->calls += pointer.v != 0;
  io->stiffness = felt->stiffness;
}

TEST(a_surface_function_says_how_a_geom_feels)
{
  hap_scene *scene = scene_new(0.0);
  hap_geom_def far = geom_of(HAP_SHAPE_SPHERE);
  far.pose.position[0] = 5.0;
  CHECK(hap_scene_add_geom(scene, &far, NULL, NULL) == HAP_OK);
  uint32_t floor = floor_add(scene);
  felt_geom felt = {.geom = HAP_SCENE_WORLD, .stiffness = 400.0};
  CHECK(hap_scene_set_surface(NULL, surface_soften, 0.0, &felt) == HAP_ERROR_ARGUMENT);
  CHECK(hap_scene_set_surface(scene, surface_soften, 0.2, &felt) == HAP_ERROR_ARGUMENT);
  CHECK(hap_scene_set_surface(scene, surface_soften, NAN, &felt) == HAP_ERROR_ARGUMENT);
  CHECK(hap_scene_set_surface(scene, surface_soften, 0.0, &felt) == HAP_OK);
  hap_session *session = session_over(scene);
  CHECK(hap_scene_set_surface(scene, NULL, 0.0, NULL) == HAP_ERROR_STATE);
  hap_pointer_id hand = ball_add(session);
  CHECK(hap_session_start(session) >= HAP_OK);
  CHECK_NEAR(force_at(session, hand, 0.3, 0.0, 0.008), 0.8, 1e-3); /* 2 mm deep */
  CHECK(felt.calls > 0 && felt.geom == floor);
  scene_end(scene, session);
}

TEST(a_body_that_is_listed_can_be_held)
{
  hap_scene *scene = scene_new(0.0);
  hap_geom_def box = geom_of(HAP_SHAPE_BOX);
  uint32_t body = body_add(scene, &box, 1, (double[3]){0.0, 0.0, 0.0});
  hap_session *session = session_over(scene);
  hap_pointer_id hand = ball_add(session);
  hap_pointer_state state;
  hap_grab_def grab;
  hap_grab_def_init(&grab, sizeof grab);
  CHECK(hap_session_start(session) >= HAP_OK);
  (void)force_at(session, hand, 0.0, 0.0, 0.0);
  void *id = body_at(scene, body).id;
  CHECK(hap_scene_find_body(scene, id) == body);
  CHECK(hap_pointer_attach(session, hand, id, &grab) >= HAP_OK);
  CHECK(hap_session_advance(session, 100) == HAP_OK);
  CHECK(hap_pointer_get(session, hand, &state, sizeof state) == HAP_OK && state.held == id);
  scene_end(scene, session);
}

static void check_geom(hap_geom_def def, const char *word)
{
  hap_scene *scene = scene_new(0.0);
  hap_detail detail = {""};
  hap_body_def body;
  hap_body_def_init(&body, sizeof body);
  body.geoms = &def;
  body.geom_count = 1;
  CHECK(hap_scene_add_body(scene, &body, NULL, NULL, &detail) == HAP_ERROR_ARGUMENT);
  CHECK(strstr(detail.text, word) != NULL && strstr(detail.text, "geoms[0") != NULL);
  if (strstr(detail.text, word) == NULL) {
    printf("# %s\n", detail.text);
  }
  hap_scene_counts counts;
  CHECK(hap_scene_count(scene, &counts, sizeof counts) == HAP_OK && counts.geoms == 0);
  CHECK(hap_scene_destroy(scene) == HAP_OK);
}

TEST(mistakes_name_the_field)
{
  double vertices[24];
  hap_geom_def def = geom_of(HAP_SHAPE_SPHERE);
  def.radius = NAN;
  check_geom(def, "radius");
  def = geom_of(HAP_SHAPE_BOX);
  def.edges[1] = 0.0;
  check_geom(def, "edges[1]");
  def = geom_of(HAP_SHAPE_SPHERE);
  def.pose.quat_wxyz[0] = 0.5;
  check_geom(def, "pose");
  check_geom(geom_of(HAP_SHAPE_PLANE), "hap_scene_add_geom");
  check_geom(geom_of(HAP_SHAPE_MESH), "vertices_xyz");
  check_geom(geom_of((hap_shape)77), "shape");
  def = cube_mesh(vertices, 0.1);
  def.vertex_count = 7;
  check_geom(def, "vertex 7");
  def = cube_mesh(vertices, 0.1);
  vertices[5] = INFINITY;
  check_geom(def, "vertex 1");
  def = cube_mesh(vertices, -0.1); /* inside out */
  check_geom(def, "volume");
  def = geom_of(HAP_SHAPE_SPHERE);
  def.cookie = 0;
  hap_scene *scene = scene_new(0.0);
  hap_body_def body;
  hap_detail detail = {""};
  hap_body_def_init(&body, sizeof body);
  CHECK(hap_scene_add_body(scene, &body, NULL, NULL, &detail) == HAP_ERROR_ARGUMENT);
  body.geoms = &def;
  body.geom_count = 1;
  CHECK(hap_scene_add_body(scene, &body, NULL, NULL, &detail) == HAP_ERROR_UNINITIALISED);
  CHECK(hap_scene_add_geom(scene, &def, NULL, &detail) == HAP_ERROR_UNINITIALISED);
  CHECK(hap_scene_add_geom(scene, NULL, NULL, &detail) == HAP_ERROR_ARGUMENT);
  hap_joint_def joint;
  hap_joint_def_init(&joint, sizeof joint);
  CHECK(hap_scene_add_joint(scene, &joint, NULL, &detail) == HAP_ERROR_NOT_FOUND);
  def = geom_of(HAP_SHAPE_SPHERE);
  (void)body_add(scene, &def, 1, (double[3]){0.0, 0.0, 0.0});
  joint.kind = HAP_JOINT_HINGE;
  joint.low[0] = 0.3;
  joint.high[0] = 0.2;
  CHECK(hap_scene_add_joint(scene, &joint, NULL, &detail) == HAP_ERROR_ARGUMENT &&
        strstr(detail.text, "low[0]") != NULL);
  hap_joint_def_init(&joint, sizeof joint);
  joint.kind = HAP_JOINT_HINGE;
  memset(joint.axis[0], 0, sizeof joint.axis[0]);
  CHECK(hap_scene_add_joint(scene, &joint, NULL, &detail) == HAP_ERROR_ARGUMENT &&
        strstr(detail.text, "axis[0]") != NULL);
  joint.kind = HAP_JOINT_OTHER;
  CHECK(hap_scene_add_joint(scene, &joint, NULL, &detail) == HAP_ERROR_ARGUMENT);
  hap_scene *other = scene;
  CHECK(hap_scene_load("row", &other, &detail) == HAP_ERROR_NOT_FOUND && other == NULL &&
        strstr(detail.text, "row10") != NULL);
  CHECK(hap_scene_load(NULL, &other, &detail) == HAP_ERROR_ARGUMENT);
  hap_pose pose;
  CHECK(hap_scene_poses(scene, 0, 0, 1, &pose) == HAP_ERROR_STATE);
  CHECK(hap_scene_destroy(NULL) == HAP_OK);
  CHECK(hap_scene_destroy(scene) == HAP_OK);
}

/* ---- in a session ---- */

/* A box that lies on the floor with a capsule on a hinge and a cylinder on a ball joint, at rest
 * before a hand comes. Stops of the hinge come and go beside the rows of contacts. */
static hap_scene *three_make(void)
{
  hap_scene *s = NULL;
  uint32_t n[3];
  uint32_t k;
  hap_geom_def g;
  hap_joint_def j;
  REQUIRE(hap_scene_create(NULL, &s, NULL) >= HAP_OK);
  hap_geom_def_init(&g, sizeof g);
  g.shape = HAP_SHAPE_PLANE;
  g.friction = 1.0;
  REQUIRE(hap_scene_add_geom(s, &g, &k, NULL) >= HAP_OK);
  for (int i = 0; i < 3; ++i) {
    hap_body_def b;
    const double side = i == 0 ? 0.0 : i == 1 ? 1.0 : -1.0;
    hap_geom_def_init(&g, sizeof g);
    hap_body_def_init(&b, sizeof b);
    g.shape = i == 0 ? HAP_SHAPE_BOX : i == 1 ? HAP_SHAPE_CAPSULE : HAP_SHAPE_CYLINDER;
    g.friction = 1.0;
    g.category_bits = g.collide_bits = 1;
    if (i == 0) {
      g.edges[0] = g.edges[1] = 0.2;
      g.edges[2] = 0.1;
    } else {
      g.radius = 0.03;
      g.length = 0.2;
      g.pose.quat_wxyz[0] = g.pose.quat_wxyz[2] = sqrt(0.5);
      g.pose.quat_wxyz[2] *= -side;
      g.pose.position[0] = 0.1 * side;
    }
    b.geoms = &g;
    b.geom_count = 1;
    b.pose.position[0] = 0.15 * side;
    b.pose.position[2] = 0.3;
    REQUIRE(hap_scene_add_body(s, &b, &n[i], NULL, NULL) >= HAP_OK);
  }
  for (int i = 1; i < 3; ++i) {
    hap_joint_def_init(&j, sizeof j);
    j.kind = i == 1 ? HAP_JOINT_HINGE : HAP_JOINT_BALL;
    j.body_a = n[i];
    j.body_b = n[0];
    j.anchor[0] = i == 1 ? 0.15 : -0.15;
    j.anchor[2] = 0.3;
    if (i == 1) {
      j.axis[0][0] = j.axis[0][2] = 0.0;
      j.axis[0][1] = 1.0;
      j.low[0] = -M_PI / 3.0;
      j.high[0] = M_PI / 3.0;
    }
    REQUIRE(hap_scene_add_joint(s, &j, &k, NULL) >= HAP_OK);
  }
  return s;
}

TEST(what_has_come_to_rest_on_joints_stays_on_the_floor)
{
  hap_scene *s = three_make();
  hap_session *session = NULL;
  hap_session_def d;
  hap_pointer_def p;
  hap_pointer_id id;
  double top = 0.0;
  hap_session_def_init(&d, sizeof d);
  d.drive = HAP_DRIVE_LOCKSTEP;
  REQUIRE(hap_scene_session(s, &d, &session, NULL) >= HAP_OK);
  hap_pointer_def_init(&p, sizeof p);
  p.radius = 0.0222;
  REQUIRE(hap_device_open("virtual:path=0:-0.4416/0/0.3958;0.75:0/0/0.3;1.5:0/0/0.0222;"
                          "2.25:0.25/0/0.3;3:0.25/0/0.0222",
                          &p.device, NULL) >= HAP_OK);
  REQUIRE(hap_pointer_add(session, &p, &id) >= HAP_OK);
  REQUIRE(hap_session_start(session) >= HAP_OK);
  for (int t = 0; t < 3000; ++t) {
    hap_scene_body q;
    REQUIRE(hap_session_advance(session, 1) >= HAP_OK);
    REQUIRE(hap_scene_get_body(s, 0, &q, sizeof q) >= HAP_OK);
    top = t > 400 ? fmax(top, q.pose.position[2]) : 0.0;
  }
  CHECK_SAY(top < 0.06, "%g m", top);
  hap_session_destroy(session);
  hap_device_close(p.device);
  REQUIRE(hap_scene_destroy(s) >= HAP_OK);
}
