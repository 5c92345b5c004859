/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The viewer by its pixels, 640 x 360. Where a point of the world is in the picture follows from
 * the camera that a test sets: eye on -y, in the height of what it looks at. */

#include <hapode/hapode.h>
#include <hapode/scene.h>

#include "tests/tap.h"
#include "view/view.h"

#define WIDTH 640
#define HEIGHT 360

/* A picture of a scene with one body in it. */
typedef struct easel {
  view *view;
  hap_scene *scene;
  hap_pose bodies[2];
  hap_body_role roles[2];
  view_frame frame;
  const uint8_t *pixels;
} easel;

typedef struct pixel {
  int r;
  int g;
  int b;
} pixel;

static const double eye[3] = {0.0, -1.2, 0.5};
static const double target[3] = {0.0, 0.0, 0.1};

static void easel_finish(void *owned)
{
  easel *e = owned;
  view_destroy(e->view);
  (void)hap_scene_destroy(e->scene);
}

static void box_init(hap_geom_def *out)
{
  hap_geom_def_init(out, sizeof *out);
  out->shape = HAP_SHAPE_BOX;
}

static void floor_add(hap_scene *scene)
{
  hap_geom_def plane;
  hap_geom_def_init(&plane, sizeof plane);
  plane.shape = HAP_SHAPE_PLANE;
  REQUIRE(hap_scene_add_geom(scene, &plane, NULL, NULL) == HAP_OK);
}

/* A body 0.1 m above the floor, or only a geom that never moves. */
static easel *easel_make(const hap_geom_def *geom, bool of_world)
{
  hap_detail why = {""};
  easel *e = tap_own(sizeof *e, easel_finish);
  hap_status status = view_create(WIDTH, HEIGHT, &e->view, &why);
  if (status == HAP_ERROR_UNSUPPORTED) {
    SKIP("%s", why.text);
  }
  REQUIRE(status == HAP_OK);
  REQUIRE(hap_scene_create(NULL, &e->scene, NULL) == HAP_OK);
  floor_add(e->scene);
  e->frame = (view_frame){.bodies = e->bodies, .roles = e->roles};
  if (of_world) {
    REQUIRE(hap_scene_add_geom(e->scene, geom, NULL, NULL) == HAP_OK);
  } else {
    hap_body_def def;
    hap_body_def_init(&def, sizeof def);
    def.geoms = geom;
    def.geom_count = 1;
    def.pose.position[2] = 0.1;
    REQUIRE(hap_scene_add_body(e->scene, &def, NULL, NULL, NULL) == HAP_OK);
    e->frame.body_count = 1;
    e->bodies[0] = def.pose;
    e->roles[0] = HAP_ROLE_LOOP;
  }
  REQUIRE_SAY(view_take_scene(e->view, e->scene, &why) == HAP_OK, "%s", why.text);
  view_set_camera(e->view, eye, target);
  return e;
}

static easel *easel_with_box(void)
{
  hap_geom_def box;
  box_init(&box);
  return easel_make(&box, false);
}

static void easel_draw(easel *e)
{
  e->pixels = view_draw(e->view, &e->frame, NULL, NULL);
}

/* By the pinhole that the test's own camera is: 30 degrees from the lower to the upper border. */
static void point_project(const double point[3], double out[2])
{
  const double down = atan2(eye[2] - target[2], target[1] - eye[1]);
  const double y = point[1] - eye[1];
  const double z = point[2] - eye[2];
  const double depth = y * cos(down) - z * sin(down);
  const double scale = 0.5 * HEIGHT / tan(15.0 * 3.14159265358979 / 180.0);
  out[0] = 0.5 * WIDTH + scale * (point[0] - eye[0]) / depth;
  out[1] = 0.5 * HEIGHT - scale * (y * sin(down) + z * cos(down)) / depth;
}

static pixel pixel_at(const easel *e, double x, double y, double z)
{
  const double point[3] = {x, y, z};
  double at[2];
  point_project(point, at);
  REQUIRE(at[0] >= 0 && at[0] < WIDTH && at[1] >= 0 && at[1] < HEIGHT);
  const uint8_t *p = &e->pixels[3 * ((int)at[1] * WIDTH + (int)at[0])];
  return (pixel){p[0], p[1], p[2]};
}

static bool is_red(pixel p)
{
  return p.r > 110 && p.r > 2 * p.g && p.r > 2 * p.b;
}

static bool is_orange(pixel p)
{
  return p.r > p.g + 30 && p.g > p.b + 20;
}

static bool is_green(pixel p)
{
  return p.g > p.r + 60 && p.g > p.b + 40;
}

static int pixel_sum(pixel p)
{
  return p.r + p.g + p.b;
}

static void pointer_put(easel *e, double x, double y, double z)
{
  view_pointer *p = &e->frame.pointers[0];
  *p = (view_pointer){.proxy = {.position = {x, y, z}, .quat_wxyz = {1.0}}, .radius = 0.02};
  p->device = p->proxy;
  e->frame.pointer_count = 1;
}

TEST(the_projection_is_that_of_a_pinhole)
{
  easel *e = easel_with_box();
  const double points[][3] = {{0, 0, 0.1}, {0.3, 0.1, 0}, {-0.2, -0.3, 0.2}, {0.1, 0.5, 0.05}};
  easel_draw(e);
  for (size_t i = 0; i < sizeof points / sizeof points[0]; ++i) {
    double at[2];
    double expected[2];
    CHECK(view_project(e->view, points[i], at));
    point_project(points[i], expected);
    CHECK_NEAR(at[0], expected[0], 0.2);
    CHECK_NEAR(at[1], expected[1], 0.2);
  }
  CHECK(!view_project(e->view, (const double[3]){0, -3, 0}, (double[2]){0, 0}));
}

TEST(the_pointer_is_red_where_it_is)
{
  easel *e = easel_with_box();
  pointer_put(e, -0.15, 0, 0.05);
  easel_draw(e);
  CHECK(is_red(pixel_at(e, -0.15, 0, 0.05)));
  CHECK(!is_red(pixel_at(e, 0.2, 0, 0.05)));
  CHECK(!is_red(pixel_at(e, -0.15, 0, 0.09)));
  pointer_put(e, 0.2, 0, 0.05);
  easel_draw(e);
  CHECK(is_red(pixel_at(e, 0.2, 0, 0.05)));
  CHECK(!is_red(pixel_at(e, -0.15, 0, 0.05)));
}

TEST(a_device_apart_from_its_pointer_is_seen_through)
{
  easel *e = easel_with_box();
  pointer_put(e, -0.15, 0, 0.05);
  easel_draw(e);
  pixel without = pixel_at(e, -0.22, 0, 0.05);
  e->frame.pointers[0].device.position[0] = -0.22;
  easel_draw(e);
  pixel with = pixel_at(e, -0.22, 0, 0.05);
  CHECK(is_red(pixel_at(e, -0.15, 0, 0.05)));
  CHECK(with.g < without.g - 20 && with.g > 60 && with.r > with.g + 20);
}

TEST(a_tool_is_a_box)
{
  easel *e = easel_with_box();
  pointer_put(e, -0.2, 0, 0.05);
  view_pointer *p = &e->frame.pointers[0];
  p->radius = 0.002;
  p->half_edges[0] = p->half_edges[1] = 0.01;
  p->half_edges[2] = 0.04;
  easel_draw(e);
  CHECK(is_red(pixel_at(e, -0.2, -0.01, 0.085)) && is_red(pixel_at(e, -0.2, -0.01, 0.015)));
  CHECK(!is_red(pixel_at(e, -0.17, 0, 0.05)));
}

TEST(a_shadow_is_darker_than_the_floor)
{
  easel *e = easel_with_box();
  e->bodies[0].position[2] = 0.05;
  easel_draw(e);
  pixel shaded = pixel_at(e, 0.08, 0.01, 0);
  pixel lit = pixel_at(e, -0.12, 0.01, 0);
  CHECK(pixel_sum(shaded) < pixel_sum(lit) - 60);
  e->bodies[0].position[0] = 0.35; /* away: the same floor, and no shadow there */
  easel_draw(e);
  CHECK(pixel_sum(pixel_at(e, 0.08, 0.01, 0)) > pixel_sum(shaded) + 60);
}

/* Green pixels: how many, and their middle and reach from the pointer. */
typedef struct patch_of_green {
  int count;
  double middle[2];
  double reach;
} patch_of_green;

static patch_of_green green_find(const easel *e)
{
  patch_of_green found = {0};
  double begin[2];
  point_project(e->frame.pointers[0].proxy.position, begin);
  for (int y = 60; y < HEIGHT; ++y) {
    for (int x = 0; x < WIDTH; ++x) {
      const uint8_t *p = &e->pixels[3 * (y * WIDTH + x)];
      if (is_green((pixel){p[0], p[1], p[2]})) {
        const double dx = x + 0.5 - begin[0];
        const double dy = y + 0.5 - begin[1];
        ++found.count;
        found.middle[0] += dx;
        found.middle[1] += dy;
        found.reach = fmax(found.reach, hypot(dx, dy));
      }
    }
  }
  if (found.count > 0) {
    found.middle[0] /= found.count;
    found.middle[1] /= found.count;
  }
  return found;
}

static patch_of_green green_of_force(easel *e, double x, double y, double z)
{
  const double force[3] = {x, y, z};
  memcpy(e->frame.pointers[0].force, force, sizeof force);
  easel_draw(e);
  return green_find(e);
}

TEST(the_arrow_follows_the_force)
{
  easel *e = easel_with_box();
  pointer_put(e, 0, -0.1, 0.15);
  CHECK(green_of_force(e, 0, 0, 0).count == 0);
  patch_of_green right = green_of_force(e, 8, 0, 0);
  patch_of_green left = green_of_force(e, -8, 0, 0);
  patch_of_green up = green_of_force(e, 0, 0, 8);
  CHECK(right.count > 50 && right.middle[0] > 20 && fabs(right.middle[1]) < 6);
  CHECK(left.count > 50 && left.middle[0] < -20 && fabs(left.middle[1]) < 6);
  CHECK(up.count > 20 && up.middle[1] < -15 && fabs(up.middle[0]) < 4);
}

TEST(the_arrow_is_as_long_as_the_force_is_large)
{
  easel *e = easel_with_box();
  double edge[2];
  double middle[2];
  const double position[3] = {0, -0.1, 0.15};
  const double side[3] = {0.02, -0.1, 0.15}; /* where the arrow begins */
  pointer_put(e, position[0], position[1], position[2]);
  point_project(side, edge);
  point_project(position, middle);
  const double begin = edge[0] - middle[0];
  double one = green_of_force(e, 6, 0, 0).reach - begin;
  double two = green_of_force(e, 12, 0, 0).reach - begin;
  CHECK(one > 15);
  CHECK_NEAR(two / one, 2.0, 0.12);
}

TEST(a_touch_is_yellow)
{
  easel *e = easel_with_box();
  e->frame.touches[0] = (view_touch){.point = {0.02, -0.052, 0.12}, .normal = {0.0, -1.0, 0.0}};
  easel_draw(e);
  CHECK(!is_red(pixel_at(e, 0.02, -0.052, 0.12)) && is_orange(pixel_at(e, 0.02, -0.052, 0.12)));
  int before = pixel_at(e, 0.02, -0.052, 0.12).g;
  e->frame.touch_count = 1;
  easel_draw(e);
  CHECK(pixel_at(e, 0.02, -0.052, 0.12).g > before + 30);
}

static pixel pixel_of_role(easel *e, hap_body_role role)
{
  e->roles[0] = role;
  easel_draw(e);
  return pixel_at(e, 0.0, -0.05, 0.1);
}

TEST(a_body_has_the_colour_of_its_treatment)
{
  easel *e = easel_with_box();
  pixel far = pixel_of_role(e, HAP_ROLE_WORLD);
  pixel loop = pixel_of_role(e, HAP_ROLE_LOOP);
  pixel resting = pixel_of_role(e, HAP_ROLE_RESTING);
  pixel measured = pixel_of_role(e, HAP_ROLE_MEASURED);
  pixel edge = pixel_of_role(e, HAP_ROLE_EDGE);
  pixel driven = pixel_of_role(e, HAP_ROLE_DRIVEN);
  CHECK(abs(far.r - far.g) < 20 && abs(far.g - far.b) < 20);
  CHECK(is_orange(loop));
  CHECK(resting.b > resting.g + 10 && resting.g > resting.r + 20);
  CHECK(measured.b > measured.g + 20 && measured.r > measured.g + 5);
  CHECK(edge.g > edge.r + 5 && edge.g > edge.b && edge.g < edge.r + 60);
  CHECK(driven.g > driven.r + 30 && driven.g > driven.b + 20);
}

static void shape_check(const hap_geom_def *geom)
{
  easel *e = easel_make(geom, false);
  easel_draw(e);
  CHECK(is_orange(pixel_at(e, 0.0, -0.02, 0.1)));
  CHECK(!is_orange(pixel_at(e, 0.25, 0.0, 0.1)));
  CHECK(!is_orange(pixel_at(e, 0.0, 0.0, 0.3)));
}

TEST(round_shapes_are_there)
{
  const hap_shape shapes[] = {HAP_SHAPE_SPHERE, HAP_SHAPE_CAPSULE, HAP_SHAPE_CYLINDER};
  for (int i = 0; i < 3; ++i) {
    hap_geom_def geom;
    hap_geom_def_init(&geom, sizeof geom);
    geom.shape = shapes[i];
    shape_check(&geom);
  }
}

TEST(a_capsule_is_longer_than_a_sphere)
{
  hap_geom_def geom;
  hap_geom_def_init(&geom, sizeof geom);
  geom.radius = 0.03;
  easel *ball = easel_make(&geom, false);
  easel_draw(ball);
  CHECK(!is_orange(pixel_at(ball, 0.0, 0.0, 0.16)));
  tap_release(ball);
  geom.shape = HAP_SHAPE_CAPSULE;
  easel *capsule = easel_make(&geom, false);
  easel_draw(capsule);
  CHECK(is_orange(pixel_at(capsule, 0.0, 0.0, 0.16)));
}

TEST(a_mesh_is_there)
{
  static const double vertices[] = {-0.1, -0.1, -0.05, 0.1, -0.1, -0.05, 0, 0.1, -0.05, 0, 0, 0.1};
  static const uint32_t triangles[] = {0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3};
  hap_geom_def geom;
  hap_geom_def_init(&geom, sizeof geom);
  geom.shape = HAP_SHAPE_MESH;
  geom.vertices_xyz = vertices;
  geom.vertex_count = 4;
  geom.triangles = triangles;
  geom.triangle_count = 4;
  shape_check(&geom);
}

TEST(a_field_is_there)
{
  static const double heights[] = {0, 0, 0, 0, 0.15, 0, 0, 0, 0};
  hap_geom_def geom;
  hap_geom_def_init(&geom, sizeof geom);
  geom.shape = HAP_SHAPE_FIELD;
  geom.edges[0] = geom.edges[1] = 0.3;
  geom.heights = heights;
  geom.columns = geom.rows = 3;
  memcpy(geom.colour_rgba, ((const float[4]){0.9F, 0.1F, 0.1F, 1.0F}), sizeof geom.colour_rgba);
  easel *e = easel_make(&geom, true);
  easel_draw(e);
  CHECK(is_red(pixel_at(e, 0.0, -0.03, 0.12)));
  CHECK(!is_red(pixel_at(e, 0.12, 0.0, 0.13)));
}

TEST(without_a_camera_all_is_in_the_picture)
{
  hap_geom_def box;
  box_init(&box);
  easel *e = easel_make(&box, false);
  hap_detail why = {""};
  view_destroy(e->view);
  REQUIRE(view_create(WIDTH, HEIGHT, &e->view, &why) == HAP_OK);
  REQUIRE(view_take_scene(e->view, e->scene, &why) == HAP_OK);
  pointer_put(e, -0.3, 0.1, 0.05);
  e->frame.pointers[0].force[0] = -9.0;
  static view_strips strips;
  view_strips_init(&strips, 1.0);
  for (int place = 0; place < 3; ++place) {
    e->bodies[0].position[0] = 4.0 * place;
    e->pixels = view_draw(e->view, &e->frame, &strips, NULL);
    double from[3];
    double to[3];
    double at[3][2];
    view_arrow(e->view, &e->frame.pointers[0], from, to);
    REQUIRE(view_project(e->view, e->bodies[0].position, at[0]));
    REQUIRE(view_project(e->view, e->frame.pointers[0].proxy.position, at[1]));
    REQUIRE(view_project(e->view, to, at[2]));
    for (int i = 0; i < 3; ++i) {
      CHECK(at[i][0] > 0 && at[i][0] < WIDTH && at[i][1] > 0 && at[i][1] < 0.82 * HEIGHT);
    }
  }
}

TEST(moving_pictures_are_framed_calmly)
{
  hap_geom_def box;
  box_init(&box);
  easel *e = easel_make(&box, false);
  double at[3][2];
  view_destroy(e->view);
  REQUIRE(view_create(WIDTH, HEIGHT, &e->view, NULL) == HAP_OK);
  REQUIRE(view_take_scene(e->view, e->scene, NULL) == HAP_OK);
  view_set_calm(e->view, 0.5);
  easel_draw(e);
  REQUIRE(view_project(e->view, e->bodies[0].position, at[0]));
  e->bodies[0].position[0] += 0.05;
  easel_draw(e); /* the body moves in the picture; the eye follows later */
  REQUIRE(view_project(e->view, e->bodies[0].position, at[1]));
  CHECK(at[1][0] > at[0][0] + 15);
  for (int i = 0; i < 12; ++i) {
    easel_draw(e);
  }
  REQUIRE(view_project(e->view, e->bodies[0].position, at[2]));
  CHECK_NEAR(at[2][0], at[0][0], 1.0);
}

TEST(strips_show_what_came_in)
{
  easel *e = easel_with_box();
  static view_strips strips;
  view_strips_init(&strips, 1.0);
  for (int i = 0; i < 500; ++i) { /* the first half only */
    view_strips_add(&strips, 0.001 * i, 5.0, 10.0);
  }
  CHECK_NEAR(strips.force[100], 5.0, 1e-6);
  CHECK_NEAR(strips.tick_us[100], 10.0, 1e-4);
  CHECK(strips.force[400] < 0.0F && strips.tick_us[400] < 0.0F);
  e->pixels = view_draw(e->view, &e->frame, &strips, NULL);
  int greens[2] = {0, 0};
  for (int y = (int)(0.84 * HEIGHT); y < HEIGHT; ++y) {
    for (int x = 40; x < WIDTH / 2 - 16; ++x) {
      const uint8_t *p = &e->pixels[3 * (y * WIDTH + x)];
      greens[x > 170] += is_green((pixel){p[0], p[1], p[2]});
    }
  }
  CHECK_SAY(greens[0] > 100 && greens[1] < greens[0] / 10, "%d %d", greens[0], greens[1]);
}

/* Where frames come more slowly than bins: the line is drawn through, and so is what is below. */
TEST(a_strip_of_few_values_has_no_gaps)
{
  easel *e = easel_with_box();
  static view_strips strips;
  view_strips_init(&strips, 1.0);
  for (int i = 0; i <= 100; ++i) {
    view_strips_add(&strips, 0.009999 * i, 5.0, 10.0);
  }
  CHECK(strips.force[101] < 0.0F);
  e->pixels = view_draw(e->view, &e->frame, &strips, NULL);
  int least = 255;
  int most = 0;
  for (int x = 60; x < WIDTH / 2 - 40; ++x) { /* a row near the lower end of the curve's area */
    const int green = e->pixels[3 * (338 * WIDTH + x) + 1];
    least = green < least ? green : least;
    most = green > most ? green : most;
  }
  CHECK_SAY(most - least < 8 && least > 60, "%d to %d", least, most);
}

TEST(text_stands_in_the_corner)
{
  easel *e = easel_with_box();
  view_labels labels = {"title of it", "and more"};
  int dark[2] = {0, 0};
  for (int with = 0; with < 2; ++with) {
    e->pixels = view_draw(e->view, &e->frame, NULL, with == 1 ? &labels : NULL);
    for (int y = 8; y < 30; ++y) {
      for (int x = 8; x < 120; ++x) {
        dark[with] += e->pixels[3 * (y * WIDTH + x)] < 90;
      }
    }
  }
  CHECK_SAY(dark[0] == 0 && dark[1] > 40, "%d %d", dark[0], dark[1]);
}

TEST(a_thousand_bodies_are_drawn)
{
  hap_scene *scene;
  hap_detail why = {""};
  view *v;
  hap_status status = view_create(WIDTH, HEIGHT, &v, &why);
  if (status == HAP_ERROR_UNSUPPORTED) {
    SKIP("%s", why.text);
  }
  static hap_pose bodies[1000];
  static hap_body_role roles[1000];
  REQUIRE(hap_scene_load("pile:1000", &scene, &why) == HAP_OK);
  CHECK(view_take_scene(v, scene, &why) == HAP_OK);
  for (uint32_t i = 0; i < 1000; ++i) {
    hap_scene_body body;
    CHECK(hap_scene_get_body(scene, i, &body, sizeof body) == HAP_OK);
    bodies[i] = body.pose;
    roles[i] = HAP_ROLE_LOOP;
  }
  const view_frame frame = {.bodies = bodies, .roles = roles, .body_count = 1000};
  for (int stray = 0; stray < 2; ++stray) { /* one that has flown away is not waited for */
    bodies[500].position[0] += 100.0 * stray;
    const uint8_t *pixels = view_draw(v, &frame, NULL, NULL);
    int orange = 0;
    for (int i = 0; i < WIDTH * HEIGHT; ++i) {
      orange += is_orange((pixel){pixels[3 * i], pixels[3 * i + 1], pixels[3 * i + 2]});
    }
    CHECK_SAY(orange > WIDTH * HEIGHT / 12, "%d pixels of bodies", orange);
  }
  (void)hap_scene_destroy(scene);
  view_destroy(v);
}

TEST(sizes_out_of_range_are_refused)
{
  view *v;
  CHECK(view_create(63, 360, &v, NULL) == HAP_ERROR_ARGUMENT && v == NULL);
  CHECK(view_create(640, 8193, &v, NULL) == HAP_ERROR_ARGUMENT && v == NULL);
}
