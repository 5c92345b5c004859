/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Scenes from files: small texts, each aimed at one thing. What they come to is held against
 * MuJoCo's own compiler, where it is there, and against figures by hand. */

#include "tests/tap.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/vec.h"
#include "import/import.h"
#include "tests/program.h"
#include "tests/scene_oracle.h"

SET_UP
{
  return program_use("HAPODE_RUN");
}

typedef struct noted {
  char lines[4000];
  size_t length;
} noted;

static void note_take(void *user, const char *line)
{
  noted *to = user;
  if (to->length + strlen(line) + 2 < sizeof to->lines) {
    to->length +=
        (size_t)snprintf(to->lines + to->length, sizeof to->lines - to->length, "%s\n", line);
  }
}

typedef struct file_case {
  const char *name;
  const char *text;
} file_case;

#define IN_WORLD(text) "<mujoco>\n<worldbody>\n" text "\n</worldbody>\n</mujoco>\n"

static const file_case mjcf_cases[] = {
    {"shapes_of_uniform_density",
     IN_WORLD("<geom type='plane' size='1 1 .1'/>"
              "<body><freejoint/><geom size='.1'/></body>"
              "<body><freejoint/><geom type='capsule' size='.05 .2'/></body>"
              "<body><freejoint/><geom type='cylinder' size='.07 .1' density='500'/></body>"
              "<body><freejoint/><geom type='box' size='.1 .2 .3' mass='3'/></body>"
              "<body><freejoint/><geom type='ellipsoid' size='.1 .2 .3'/></body>")},
    {"several_geoms_in_a_body",
     IN_WORLD("<body pos='1 2 3' euler='10 20 30'><freejoint/><geom size='.1' pos='.1 0 0'/>"
              "<geom type='box' size='.1 .05 .02' pos='0 .3 .1' euler='30 0 50' mass='2'/>"
              "<geom type='capsule' size='.03 .2' zaxis='1 1 0' mass='0'/></body>")},
    {"two_ends", IN_WORLD("<body pos='0 0 1'><freejoint/>"
                          "<geom type='capsule' size='.05' fromto='0 0 0 .1 .2 .3'/>"
                          "<geom type='cylinder' size='.05' fromto='.1 0 0 .1 0 -.3'/>"
                          "<geom type='box' size='.05' fromto='.1 .1 0 -.4 .2 .3'/>"
                          "<geom type='ellipsoid' size='.05' fromto='.1 .1 0 .4 .2 -.3'/></body>")},
    {"ways_to_turn", IN_WORLD("<body quat='1 2 3 4'><geom size='.1'/><joint/></body>"
                              "<body axisangle='1 2 3 40'><geom size='.1'/><joint/></body>"
                              "<body xyaxes='1 1 0 0 2 1'><geom size='.1'/><joint/></body>"
                              "<body xyaxes='-1 0 0 0 -1 0.1'><geom size='.1'/><joint/></body>"
                              "<body zaxis='1 -2 .5'><geom size='.1'/><joint/></body>"
                              "<body zaxis='0 0 -1'><geom size='.1'/><joint/></body>"
                              "<body euler='10 -20 130'><geom size='.1'/><joint/></body>")},
    {"radians_and_another_order",
     "<mujoco><compiler angle='radian' eulerseq='ZXz'/><worldbody>"
     "<body euler='.1 .2 .3'><geom size='.1'/><joint range='-.5 1' limited='true'/>"
     "<body euler='1 -.2 2' pos='1 0 0'><geom size='.1'/><joint type='slide' axis='1 2 3' "
     "range='-.5 1' limited='true'/></body></body></worldbody></mujoco>"},
    {"large_letters",
     "<mujoco><compiler eulerseq='XYZ'/><worldbody><body euler='10 20 30'><geom size='.1'/>"
     "<joint/></body></worldbody></mujoco>"},
    {"classes_of_defaults",
     "<mujoco><default><geom density='100' size='.1 .2 .3'/><joint axis='1 0 0'/>"
     "<default class='a'><geom type='box' size='.5'/><joint pos='.1 .2 .3'/>"
     "<default class='b'><geom pos='1 1 1' mass='4'/><joint range='-10 20' limited='true'/>"
     "</default></default>"
     "<default class='c'><geom type='capsule' fromto='0 0 0 0 0 .5'/></default></default>"
     "<worldbody><body><joint/><geom/>"
     "<body childclass='a' pos='2 0 0'><joint/><geom/><geom class='b'/>"
     "<body><joint class='b' axis='0 1 0'/><geom class='c'/><geom size='.2 .1'/>"
     "<body childclass='b'><joint/><geom/><geom class='main'/></body></body></body></body>"
     "</worldbody></mujoco>"},
    {"inertial_stands_over_geoms",
     IN_WORLD("<body><joint/><inertial pos='.1 .2 .3' mass='2' diaginertia='.1 .2 .25' "
              "euler='10 20 30'/><geom size='.1'/></body>"
              "<body pos='1 0 0'><freejoint/><inertial pos='0 0 .1' mass='3' "
              "fullinertia='.3 .4 .5 .01 -.02 .03'/></body>")},
    {"inertia_from_geoms_always",
     "<mujoco><compiler inertiafromgeom='true'/><worldbody>"
     "<body><joint/><inertial pos='.1 .2 .3' mass='2' diaginertia='.1 .2 .25'/>"
     "<geom size='.1'/></body></worldbody></mujoco>"},
    {"inertia_of_some_groups",
     "<mujoco><compiler inertiagrouprange='1 2'/><worldbody>"
     "<body><joint/><geom size='.1' group='1'/><geom size='.2' group='0' pos='1 0 0'/>"
     "<geom size='.1' group='2' pos='0 0 1'/></body></worldbody></mujoco>"},
    {"a_total_mass",
     "<mujoco><compiler settotalmass='10'/><worldbody>"
     "<body><joint/><geom size='.1'/><body pos='1 0 0'><joint/><geom size='.2'/></body></body>"
     "</worldbody></mujoco>"},
    {"bounds_of_mass",
     "<mujoco><compiler boundmass='1' boundinertia='.01'/><worldbody>"
     "<body><joint/><geom size='.01'/></body><body><joint/><geom size='.3'/></body>"
     "</worldbody></mujoco>"},
    {"an_inertia_that_is_balanced",
     "<mujoco><compiler balanceinertia='true'/><worldbody>"
     "<body><joint/><inertial pos='0 0 0' mass='1' diaginertia='.1 .1 .4'/></body>"
     "</worldbody></mujoco>"},
    {"kinds_of_joints",
     IN_WORLD("<body><joint type='ball' pos='.1 0 0'/><geom size='.1'/>"
              "<body pos='0 0 1'><joint type='slide' axis='1 2 3'/><geom size='.1'/></body></body>"
              "<body><joint type='free'/><geom size='.1'/></body>")},
    {"several_joints_in_a_body",
     IN_WORLD("<body><joint type='slide' axis='1 0 0'/><joint type='slide' axis='0 1 0'/>"
              "<joint axis='0 0 1' pos='.1 0 0'/><geom size='.1'/></body>")},
    {"a_reference_of_a_joint",
     IN_WORLD("<body><joint ref='20' range='-30 50' limited='true'/><geom size='.1'/></body>"
              "<body><joint type='slide' ref='.2' range='-1 2' limited='true'/><geom size='.1'/>"
              "</body>")},
    {"bodies_in_bodies_without_joints",
     IN_WORLD("<body pos='0 0 1' euler='0 30 0'><joint axis='0 1 0'/><geom size='.1'/>"
              "<body pos='.5 0 0' euler='40 0 0'><geom type='box' size='.1 .2 .3'/>"
              "<body pos='0 .5 0'><geom size='.2'/></body></body></body>"
              "<body pos='3 0 0'><geom size='.5'/></body>")},
    {"a_mesh_of_points",
     "<mujoco><asset><mesh name='a' scale='.1 .2 .3' vertex='0 0 0 1 0 0 0 1 0 0 0 1 .1 .1 .1'/>"
     "</asset><worldbody><body><freejoint/><geom type='mesh' mesh='a' mass='3' pos='1 2 3' "
     "euler='10 20 30'/></body></worldbody></mujoco>"},
    {"a_mesh_with_faces_that_is_not_convex",
     "<mujoco><asset><mesh name='a' refpos='.1 0 0' refquat='1 .2 .3 .4' "
     "vertex='0 0 0 1 0 0 0 1 0 0 0 1 .3 .3 .3' "
     "face='0 2 1 0 1 3 0 3 2 1 2 4 2 3 4 3 1 4'/>"
     "</asset><worldbody><body><freejoint/><geom type='mesh' mesh='a' mass='2'/></body>"
     "</worldbody></mujoco>"},
    {"more_digits_and_signs",
     IN_WORLD("<body pos=' +1e-1\t-2.5E+0\n.5 '><joint/><geom size='1.e-1'/></body>")},
};

static import_model file_read(import_work *work, const char *text)
{
  import_model model;
  hap_detail why = {""};
  const char *path = folder_path("scene.xml");
  file_write(path, text);
  work->detail = &why;
  hap_status status = import_read(work, path, &model);
  work->detail = NULL;
  REQUIRE_SAY(status == HAP_OK, "%s", why.text);
  return model;
}

static hap_scene *scene_of(const char *text)
{
  hap_scene *scene = NULL;
  hap_detail why = {""};
  const char *path = folder_path("scene.xml");
  file_write(path, text);
  REQUIRE_SAY(import_scene(path, NULL, &scene, NULL, &why) == HAP_OK, "%s", why.text);
  return scene;
}

/* Mass, centre, inertia, axis, range, pose and the like equal MuJoCo's. */
static void oracle_check(const char *path, const import_model *ours)
{
  static const oracle_notes none;
  oracle_found found;
  if (!scene_oracle_is_there()) {
    SKIP("MuJoCo is not there to compare with (Debian: libmujoco-dev)");
  }
  REQUIRE_SAY(scene_oracle(path, ours, &none, &found), "MuJoCo: %s", found.first);
  CHECK_SAY(found.differ == 0, "%zu differ: %s", found.differ, found.first);
}

TEST_EACH(mjcf_cases, const file_case *row)
{
  noted notes = {.length = 0};
  import_work work = {.said = note_take, .user = &notes};
  import_model model = file_read(&work, row->text);
  CHECK_SAY(notes.length == 0, "%s", notes.lines);
  oracle_check(folder_path("scene.xml"), &model);
  import_work_finish(&work);
}

#define URDF(text) \
  "<robot name='r'>\n<mujoco><compiler fusestatic='false'/></mujoco>\n" text "</robot>"
#define BALL "<collision><geometry><sphere radius='.1'/></geometry></collision>"

static const file_case urdf_cases[] = {
    {"links_and_kinds_of_joints",
     URDF("<link name='base'>" BALL "</link>"
          "<link name='arm'>" BALL "</link><link name='hand'>" BALL "</link>"
          "<link name='tool'>" BALL "</link><link name='lift'>" BALL "</link>"
          "<joint name='a' type='revolute'><parent link='base'/><child link='arm'/>"
          "<origin xyz='.1 .2 .3' rpy='.3 -.5 2'/><axis xyz='0 1 1'/>"
          "<limit lower='-1' upper='2' effort='1' velocity='1'/></joint>"
          "<joint name='b' type='continuous'><parent link='arm'/><child link='hand'/>"
          "<origin xyz='0 0 .5'/></joint>"
          "<joint name='c' type='prismatic'><parent link='base'/><child link='lift'/>"
          "<axis xyz='0 0 2'/><limit lower='-.1' upper='.3' effort='1' velocity='1'/></joint>"
          "<joint name='d' type='fixed'><parent link='hand'/><child link='tool'/>"
          "<origin xyz='1 0 0' rpy='1 1 1'/></joint>")},
    {"inertials_and_shapes",
     URDF("<link name='base'/><link name='arm'>"
          "<inertial><origin xyz='.1 0 .2' rpy='.1 .2 .3'/><mass value='3'/>"
          "<inertia ixx='.3' iyy='.4' izz='.5' ixy='.01' ixz='-.02' iyz='.03'/></inertial>"
          "</link><link name='hand'>"
          "<collision><origin xyz='.1 0 0' rpy='.1 .2 .3'/><geometry><box size='.1 .2 .3'/>"
          "</geometry></collision>"
          "<collision><origin xyz='0 .3 0' rpy='1 0 0'/><geometry>"
          "<cylinder radius='.05' length='.3'/></geometry></collision></link>"
          "<joint name='a' type='revolute'><parent link='base'/><child link='arm'/>"
          "<limit lower='-1' upper='2' effort='1' velocity='1'/></joint>"
          "<joint name='b' type='continuous'><parent link='arm'/><child link='hand'/></joint>")},
};

TEST_EACH(urdf_cases, const file_case *row)
{
  noted notes = {.length = 0};
  import_work work = {.said = note_take, .user = &notes};
  import_model model = file_read(&work, row->text);
  CHECK_SAY(strcmp(notes.lines, "scene.xml:2: mujoco left out\n") == 0, "%s", notes.lines);
  oracle_check(folder_path("scene.xml"), &model);
  import_work_finish(&work);
}

/* ---- files of others ---- */

/* NULL: the test is skipped. */
static const char *other_file(const char *name)
{
  static char path[500];
  const char *folder = getenv("HAPODE_SHARED");
  snprintf(path, sizeof path, "%s/scenes/%s", folder != NULL ? folder : "", name);
  if (folder == NULL || !file_exists(path)) {
    SKIP("no %s of MuJoCo in the folder scenes of HAPODE_SHARED", name);
  }
  return path;
}

TEST(a_humanoid)
{
  const char *path = other_file("humanoid.xml");
  import_model model;
  hap_detail why = {""};
  noted notes = {.length = 0};
  import_work work = {.said = note_take, .user = &notes, .detail = &why};
  REQUIRE_SAY(import_read(&work, path, &model) == HAP_OK, "%s", why.text);
  CHECK(strstr(notes.lines, "joint") == NULL);
  CHECK(strstr(notes.lines, "tendon left out, 2 in it\n") != NULL);
  oracle_check(path, &model);
  import_work_finish(&work);
}

TEST(a_robot_of_one_empty_link)
{
  const char *path = other_file("model.urdf");
  hap_scene *scene = NULL;
  hap_detail why = {""};
  hap_scene_counts counts;
  const import_options options = {.strict = true};
  REQUIRE_SAY(import_scene(path, &options, &scene, NULL, &why) == HAP_OK, "%s", why.text);
  CHECK(hap_scene_count(scene, &counts, sizeof counts) == HAP_OK && counts.bodies == 0);
  CHECK(hap_scene_destroy(scene) == HAP_OK);
}

TEST(a_car)
{
  const char *path = other_file("car.xml");
  import_model model;
  hap_detail why = {""};
  noted notes = {.length = 0};
  import_work work = {.said = note_take, .user = &notes, .detail = &why};
  REQUIRE_SAY(import_read(&work, path, &model) == HAP_OK, "%s", why.text);
  CHECK(strstr(notes.lines, "left out, and its mass") == NULL);
  const import_body *wheel = model.bodies->next->next;
  REQUIRE(wheel != NULL);
  CHECK_NEAR(wheel->mass.mass, 1000.0 * M_PI * 0.03 * 0.03 * 0.02, 1e-12);
  import_work_finish(&work);
}

/* A tetrahedron, with a point inside, by hand: MuJoCo 2 has the volume of a box instead. */
TEST(a_mesh_has_the_mass_of_its_volume)
{
  import_work work = {.said = NULL};
  import_model model = file_read(
      &work,
      "<mujoco><asset><mesh name='a' scale='.1 .2 .3' vertex='0 0 0 1 0 0 0 1 0 0 0 1 .1 .1 .1'/>"
      "</asset><worldbody><body><freejoint/><geom type='mesh' mesh='a' density='500'/></body>"
      "</worldbody></mujoco>");
  const import_mass *mass = &model.bodies->next->mass;
  CHECK_NEAR(mass->mass, 500.0 * 0.1 * 0.2 * 0.3 / 6.0, 1e-12);
  CHECK_NEAR(mass->centre[2], 0.3 / 4.0, 1e-12);
  CHECK_NEAR(mass->inertia[0], mass->mass * 3.0 / 80.0 * (0.04 + 0.09), 1e-12);
  CHECK_NEAR(mass->inertia[1], mass->mass / 80.0 * 0.1 * 0.2, 1e-12);
  CHECK(model.bodies->next->geoms->mesh->triangle_count == 4);
  import_work_finish(&work);
}

/* A box of four walls and a floor that is open above: what is in it counts by how it is asked. */
TEST(a_mesh_has_mass_by_its_volume_its_hull_or_its_surface)
{
  static const struct {
    const char *inertia;
    double mass; /* of a cube of 1 m with the density 1, a hole of 0.5 m through it */
  } ways[] = {{"exact", 0.75}, {"convex", 1.0}, {"shell", 5.5 + 2.0}};
  for (size_t i = 0; i < sizeof ways / sizeof ways[0]; ++i) {
    char text[2000];
    import_work work = {.said = NULL};
    snprintf(
        text, sizeof text,
        "<mujoco><asset><mesh name='a' inertia='%s' vertex='"
        "-.5 -.5 -.5 .5 -.5 -.5 .5 .5 -.5 -.5 .5 -.5 -.5 -.5 .5 .5 -.5 .5 .5 .5 .5 -.5 .5 .5 "
        "-.25 -.25 -.5 .25 -.25 -.5 .25 .25 -.5 -.25 .25 -.5 "
        "-.25 -.25 .5 .25 -.25 .5 .25 .25 .5 -.25 .25 .5' face='"
        "0 1 5 0 5 4 1 2 6 1 6 5 2 3 7 2 7 6 3 0 4 3 4 7 "
        "8 13 9 8 12 13 9 14 10 9 13 14 10 15 11 10 14 15 11 12 8 11 15 12 "
        "0 8 9 0 9 1 1 9 10 1 10 2 2 10 11 2 11 3 3 11 8 3 8 0 "
        "4 13 12 4 5 13 5 14 13 5 6 14 6 15 14 6 7 15 7 12 15 7 4 12'/></asset><worldbody>"
        "<body><freejoint/><geom type='mesh' mesh='a' density='1'/></body></worldbody></mujoco>",
        ways[i].inertia);
    import_model model = file_read(&work, text);
    const import_mass *mass = &model.bodies->next->mass;
    CHECK_SAY(fabs(mass->mass - ways[i].mass) < 1e-12, "%s: %g", ways[i].inertia, mass->mass);
    CHECK_NEAR(mass->centre[0], 0.0, 1e-12);
    CHECK_NEAR(mass->centre[2], 0.0, 1e-12);
    if (i == 0) { /* of the cube without that of the hole, about x and z */
      CHECK_NEAR(mass->inertia[0], (1.0 / 6.0) - 0.25 * (0.25 + 1.0) / 12.0, 1e-12);
      CHECK_NEAR(mass->inertia[8], (1.0 / 6.0) - 0.25 * 0.5 / 12.0, 1e-12);
    }
    import_work_finish(&work);
  }
}

/* Rows of the text come from the top, heights from 0 to what the size says. */
TEST(a_height_field_lies_as_its_text)
{
  import_work work = {.said = NULL};
  import_model model =
      file_read(&work,
                "<mujoco><asset><hfield name='a' nrow='2' ncol='3' size='1 2 .5 .1' "
                "elevation='5 3 1  9 7 11'/></asset><worldbody><geom type='hfield' hfield='a' "
                "pos='1 2 3'/></worldbody></mujoco>");
  static const double right[6] = {0.4, 0.3, 0.5, 0.2, 0.1, 0.0};
  const import_geom *geom = model.bodies->geoms;
  REQUIRE(geom != NULL && geom->shape == IMPORT_FIELD && geom->field != NULL);
  CHECK(geom->field->rows == 2 && geom->field->columns == 3);
  CHECK(geom->size[0] == 1.0 && geom->size[1] == 2.0 && geom->pose.position[2] == 3.0);
  for (int i = 0; i < 6; ++i) {
    CHECK_NEAR(geom->field->heights[i], right[i], 1e-12);
  }
  import_work_finish(&work);
}

/* As a box of its mean height, base included. MuJoCo 3.14 has the same; the library of Debian knows
 * no heights in the text. */
TEST(a_height_field_has_a_mass)
{
  import_work work = {.said = NULL};
  import_model model =
      file_read(&work,
                "<mujoco><asset><hfield name='a' nrow='2' ncol='2' size='.2 .3 .1 .05' "
                "elevation='1 0 0 2'/></asset><worldbody><body><geom type='hfield' hfield='a'/>"
                "</body></worldbody></mujoco>");
  const import_mass *mass = &model.bodies->next->mass;
  CHECK_NEAR(mass->mass, 1000.0 * 0.4 * 0.6 * 0.1, 1e-9);
  CHECK_NEAR(mass->inertia[0], 24.0 / 12.0 * (0.36 + 0.01), 1e-9);
  CHECK_NEAR(mass->inertia[8], 24.0 / 12.0 * (0.16 + 0.36), 1e-9);
  CHECK(hapi_v3_norm(mass->centre) == 0.0);
  import_work_finish(&work);
}

/* A ball lies on the slope's low end, where the text says that it is low. */
TEST(a_ball_rolls_down_a_height_field)
{
  hap_session_def def;
  hap_session *session = NULL;
  hap_scene_body ball;
  hap_scene *scene = scene_of(
      "<mujoco><asset><hfield name='a' nrow='3' ncol='4' size='1 1 .4 .1' "
      "elevation='0 1 2 3 0 1 2 3 0 1 2 3'/></asset><worldbody><geom type='hfield' hfield='a'/>"
      "<body pos='.5 0 .5'><freejoint/><geom size='.1'/></body></worldbody></mujoco>");
  hap_session_def_init(&def, sizeof def);
  def.drive = HAP_DRIVE_LOCKSTEP;
  REQUIRE(hap_scene_session(scene, &def, &session, NULL) == HAP_OK);
  REQUIRE(hap_session_start(session) >= HAP_OK);
  REQUIRE(hap_session_advance(session, 600) == HAP_OK);
  CHECK(hap_scene_get_body(scene, 0, &ball, sizeof ball) == HAP_OK);
  const double ground = 0.2 * (1.0 + ball.pose.position[0]) + 0.1 * sqrt(1.04);
  CHECK_SAY(ball.pose.position[0] < 0.35, "x %g", ball.pose.position[0]);
  CHECK_NEAR(ball.pose.position[2], ground, 0.01);
  hap_session_destroy(session);
  CHECK(hap_scene_destroy(scene) == HAP_OK);
}

/* Copies stand in the frame of the one before, and their names end in their numbers. */
TEST(copies_are_placed_one_after_the_other)
{
  import_work work = {.said = NULL};
  import_model model =
      file_read(&work,
                "<mujoco><worldbody><replicate count='4' offset='1 0 0' euler='0 0 90' sep='-'>"
                "<body name='a' pos='0 .1 0'><freejoint/><geom size='.1'/></body></replicate>"
                "<replicate count='10' offset='0 0 1'><geom name='g' size='.1'/></replicate>"
                "</worldbody></mujoco>");
  static const double right[4][2] = {{0.0, 0.1}, {0.9, 0.0}, {1.0, 0.9}, {0.1, 1.0}};
  for (int i = 0; i < 4; ++i) {
    char name[] = "a-0";
    name[2] = (char)('0' + i);
    const import_body *body = import_find_body(&model, name);
    REQUIRE_SAY(body != NULL, "no body %s", name);
    CHECK_NEAR(body->pose_world.position[0], right[i][0], 1e-9);
    CHECK_NEAR(body->pose_world.position[1], right[i][1], 1e-9);
  }
  int geoms = 0;
  for (const import_geom *geom = model.bodies->geoms; geom != NULL; geom = geom->next) {
    CHECK_NEAR(geom->pose.position[2], (double)geoms++, 1e-9);
  }
  CHECK(geoms == 10);
  import_work_finish(&work);
}

static const double corners[4][3] = {{0, 0, 0}, {0.1, 0, 0}, {0, 0.2, 0}, {0, 0, 0.3}};
static const int faces[4][3] = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};

static size_t floats_put(unsigned char *to, const double *from, size_t count)
{
  for (size_t i = 0; i < count; ++i) {
    float value = (float)from[i];
    memcpy(to + 4 * i, &value, sizeof value);
  }
  return 4 * count;
}

/* The same tetrahedron in all forms. */
static void mesh_files_write(void)
{
  char text[4000];
  size_t used = 0;
  unsigned char bytes[400] = {0};
  const int counts[4] = {4, 0, 0, 4};
  for (int i = 0; i < 4; ++i) {
    used += (size_t)snprintf(text + used, sizeof text - used, "v %g %g %g\n", corners[i][0],
                             corners[i][1], corners[i][2]);
  }
  (void)snprintf(text + used, sizeof text - used,
                 "f 1/1/1 3/2/2 2/3/3\nf 1 2 4\nf -4 -1 -2\n# no face\nf 2//1 3//1 4//1\n");
  file_write(folder_path("a.obj"), text);
  used = (size_t)snprintf(text, sizeof text, "solid a\n");
  bytes[80] = 4;
  for (size_t i = 0; i < 4; ++i) {
    used += (size_t)snprintf(text + used, sizeof text - used, "facet normal 0 0 0\nouter loop\n");
    for (size_t k = 0; k < 3; ++k) {
      const double *v = corners[faces[i][k]];
      used += (size_t)snprintf(text + used, sizeof text - used, "  vertex %g %g %g\n", v[0], v[1],
                               v[2]);
      (void)floats_put(bytes + 84 + 50 * i + 12 + 12 * k, v, 3);
    }
    used += (size_t)snprintf(text + used, sizeof text - used, "endloop\nendfacet\n");
  }
  file_write(folder_path("text.stl"), text);
  file_write_bytes(folder_path("a.STL"), bytes, 84 + 200);
  file_write_bytes(folder_path("short.stl"), bytes, 84 + 199);
  memcpy(bytes, counts, sizeof counts);
  used = 16 + floats_put(bytes + 16, &corners[0][0], 12);
  memcpy(bytes + used, faces, sizeof faces);
  file_write_bytes(folder_path("a.msh"), bytes, used + sizeof faces);
  bytes[used] = 4;
  file_write_bytes(folder_path("bad.msh"), bytes, used + sizeof faces);
}

static const struct {
  const char *file;
  const char *note; /* NULL: it is read */
} mesh_files[] = {
    {"a.obj", NULL},
    {"text.stl", NULL},
    {"a.STL", NULL},
    {"a.msh", NULL},
    {"short.stl", "mesh short.stl left out: no such mesh can be"},
    {"bad.msh", "mesh bad.msh left out: no such mesh can be"},
    {"none.stl", "mesh none.stl left out: it is not there"},
    {"a.dae", "mesh a.dae left out: it is not there"},
    {"scene.xml", "mesh scene.xml left out: neither STL, OBJ nor MSH"},
    {"../../etc/passwd", "left out: it leads out of the folder"},
    {"/etc/passwd", "left out: it leads out of the folder"},
};

TEST(meshes_are_read_from_files_of_the_folder)
{
  mesh_files_write();
  for (size_t i = 0; i < sizeof mesh_files / sizeof mesh_files[0]; ++i) {
    char text[1000];
    noted notes = {.length = 0};
    import_work work = {.said = note_take, .user = &notes};
    snprintf(text, sizeof text,
             "<mujoco><asset><mesh name='a' file='%s'/></asset><worldbody><body><freejoint/>"
             "<geom size='.1' mass='1'/><geom type='mesh' mesh='a'/></body></worldbody></mujoco>",
             mesh_files[i].file);
    import_model model = file_read(&work, text);
    const double mass = model.bodies->next->mass.mass - 1.0;
    if (mesh_files[i].note == NULL) {
      CHECK_NEAR(mass, 1.0, 1e-6);
      CHECK_SAY(notes.length == 0, "%s", notes.lines);
    } else {
      CHECK_NEAR(mass, 0.0, 1e-12);
      CHECK_SAY(strstr(notes.lines, mesh_files[i].note) != NULL, "%s", notes.lines);
    }
    import_work_finish(&work);
  }
}

/* ---- the scene that comes of it ---- */

/* What is rigid is one body, with the mass of all. */
TEST(bodies_without_joints_are_parts_of_what_carries_them)
{
  hap_scene *scene = scene_of(IN_WORLD(
      "<body pos='0 0 1'><joint axis='0 1 0'/><geom size='.1' mass='1'/>"
      "<body pos='.5 0 0'><geom size='.1' mass='2'/></body></body><body><geom size='.5'/></body>"));
  hap_scene_counts counts;
  hap_scene_body body;
  REQUIRE(hap_scene_count(scene, &counts, sizeof counts) == HAP_OK);
  CHECK(counts.bodies == 1 && counts.geoms == 3 && counts.joints == 1);
  REQUIRE(hap_scene_get_body(scene, 0, &body, sizeof body) == HAP_OK);
  CHECK_NEAR(body.mass, 3.0, 1e-12);
  CHECK_NEAR(body.centre[0], 1.0 / 3.0, 1e-12);
  /* two balls, and their centres apart: m1 m2 / (m1 + m2) d^2 */
  CHECK_NEAR(body.inertia[2][2], 0.4 * 0.01 * 3.0 + 2.0 / 3.0 * 0.25, 1e-12);
  CHECK_NEAR(body.inertia[0][0], 0.4 * 0.01 * 3.0, 1e-12);
  CHECK_NEAR(body.pose.position[2], 1.0, 1e-12);
  CHECK(hap_scene_destroy(scene) == HAP_OK);
}

static hap_session *session_over(hap_scene *scene)
{
  hap_session_def def;
  hap_session *session = NULL;
  hap_detail why = {""};
  hap_session_def_init(&def, sizeof def);
  def.drive = HAP_DRIVE_LOCKSTEP;
  REQUIRE_SAY(hap_scene_session(scene, &def, &session, &why) == HAP_OK, "%s", why.text);
  return session;
}

/* Two balls on strings of no length: one on the world, one rigid on it. */
TEST(bodies_hold_each_other)
{
  hap_scene *scene = scene_of(
      "<mujoco>\n<worldbody><body name='a' pos='0 0 1'><freejoint/><geom size='.1'/></body>"
      "<body name='b' pos='.3 0 1'><freejoint/><geom size='.1'/></body></worldbody>\n<equality>"
      "<connect body1='a' anchor='0 0 .2'/><weld body1='a' body2='b'/></equality></mujoco>");
  hap_scene_joint joint;
  hap_scene_body bodies[2];
  hap_session *session = session_over(scene);
  bool has_ball = false;
  for (uint32_t i = 0; i < 2; ++i) {
    REQUIRE(hap_scene_get_joint(scene, i, &joint, sizeof joint) == HAP_OK);
    if (joint.kind == HAP_JOINT_BALL) {
      has_ball = true;
      CHECK(joint.body_b == HAP_SCENE_WORLD);
      CHECK_NEAR(joint.anchor[2], 1.2, 1e-9);
    } else {
      CHECK(joint.kind == HAP_JOINT_FIXED && joint.body_b != HAP_SCENE_WORLD);
    }
  }
  CHECK(has_ball);
  REQUIRE(hap_session_start(session) == HAP_OK);
  CHECK(hap_session_advance(session, 500) >= HAP_OK);
  double d[3];
  for (uint32_t i = 0; i < 2; ++i) {
    REQUIRE(hap_scene_get_body(scene, i, &bodies[i], sizeof bodies[i]) == HAP_OK);
  }
  hapi_v3_sub(bodies[0].pose.position, bodies[1].pose.position, d);
  CHECK_NEAR(hapi_v3_norm(d), 0.3, 0.01);
  CHECK_NEAR(hapi_v3_norm((const double[3]){bodies[0].pose.position[0], bodies[0].pose.position[1],
                                            bodies[0].pose.position[2] - 1.2}),
             0.2, 0.01);
  hap_session_destroy(session);
  CHECK(hap_scene_destroy(scene) == HAP_OK);
}

TEST(files_are_included)
{
  noted notes = {.length = 0};
  hap_detail why = {""};
  import_work work = {.said = note_take, .user = &notes};
  file_write(folder_path("part.xml"),
             "<mujocoinclude>\n<body name='p'><geom size='.1' fluidshape='ellipsoid'/>"
             "<include file='geom.xml'/></body></mujocoinclude>");
  file_write(folder_path("geom.xml"), "<x><geom size='.1'/><geom size='.2'/></x>");
  file_write(folder_path("head.xml"), "<mujoco><default><geom density='10'/></default></mujoco>");
  import_model model =
      file_read(&work,
                "<mujoco><include file='head.xml'/><worldbody><body name='a'><joint/>"
                "<geom size='.1'/><include file='part.xml'/><geom size='.3'/></body></worldbody>"
                "</mujoco>");
  CHECK_SAY(strcmp(notes.lines, "part.xml:2: geom: fluidshape left out\n") == 0, "%s", notes.lines);
  work.said = NULL;
  oracle_check(folder_path("scene.xml"), &model);
  import_work_finish(&work);
  file_write(folder_path("head.xml"), "<mujoco>\n<include file='head.xml'/></mujoco>");
  hap_scene *scene = NULL;
  CHECK(import_scene(folder_path("head.xml"), NULL, &scene, NULL, &why) == HAP_ERROR_FORMAT);
  CHECK_SAY(strncmp(why.text, "head.xml:2: include: more than 64", 33) == 0, "%s", why.text);
  file_write(folder_path("out.xml"), "<mujoco>\n<include file='../../etc/passwd'/></mujoco>");
  CHECK(import_scene(folder_path("out.xml"), NULL, &scene, NULL, &why) == HAP_ERROR_FORMAT);
  CHECK_SAY(strstr(why.text, "out.xml:2: include ../../etc/passwd: it leads out") != NULL, "%s",
            why.text);
}

/* A joint falls to its stop: which end it is hangs on the signs of range and axis. */
typedef struct stop_case {
  const char *name;
  const char *joint; /* of a rod along x from its own end on */
  double gravity;    /* along z */
  double x;          /* m, where its tip comes to rest */
  double z;
} stop_case;

static const stop_case stop_cases[] = {
    {"a_hinge_falls_to_its_high_stop", "axis='0 1 0' range='-20 30'", -9.81, 0.8660254, -0.5},
    {"a_hinge_rises_to_its_low_stop", "axis='0 1 0' range='-20 30'", 9.81, 0.9396926, 0.3420201},
    {"a_hinge_turned_round", "axis='0 -1 0' range='-20 30'", -9.81, 0.9396926, -0.3420201},
    {"a_slider_falls_to_its_low_stop", "type='slide' axis='0 0 1' range='-.2 .3'", -9.81, 1.0,
     -0.2},
    {"a_slider_rises_to_its_high_stop", "type='slide' axis='0 0 1' range='-.2 .3'", 9.81, 1.0, 0.3},
    {"a_hinge_with_a_reference", "axis='0 1 0' ref='10' range='-20 30'", -9.81, 0.9396926,
     -0.3420201},
};

static void stop_check(const stop_case *row, const char *above)
{
  char text[1000];
  hap_scene_body body;
  hap_scene_counts counts;
  snprintf(text, sizeof text,
           "<mujoco><option gravity='0 0 %g'/><worldbody>%s<body><joint %s/>"
           "<geom type='capsule' size='.02' fromto='0 0 0 1 0 0'/></body>%s</worldbody></mujoco>",
           row->gravity, above[0] != '\0' ? above : "", row->joint,
           above[0] != '\0' ? "</body>" : "");
  hap_scene *scene = scene_of(text);
  hap_session *session = session_over(scene);
  REQUIRE(hap_session_start(session) == HAP_OK);
  CHECK(hap_session_advance(session, 4000) >= HAP_OK);
  REQUIRE(hap_scene_count(scene, &counts, sizeof counts) == HAP_OK);
  REQUIRE(hap_scene_get_body(scene, counts.bodies - 1, &body, sizeof body) == HAP_OK);
  double tip[3];
  hapi_pose_point(body.pose.position, body.pose.quat_wxyz, (const double[3]){1.0, 0.0, 0.0}, tip);
  CHECK_NEAR(tip[0], row->x, 0.01);
  CHECK_NEAR(tip[2], row->z, 0.01);
  hap_session_destroy(session);
  CHECK(hap_scene_destroy(scene) == HAP_OK);
}

TEST_EACH(stop_cases, const stop_case *row)
{
  stop_check(row, "");
  /* The same on a body that a slider across holds. */
  stop_check(row,
             "<body><joint type='slide' axis='0 1 0'/><geom size='.1' mass='1000' "
             "contype='0' conaffinity='0'/>");
}

/* ---- what is left out, and what is refused ---- */

static const struct {
  const char *text;
  const char *line;
} left_out[] = {
    {IN_WORLD("<body>\n<joint type='ball' stiffness='3'/><geom size='.1'/></body>"),
     "scene.xml:4: joint : stiffness left out\n"},
    {IN_WORLD("<body>\n<joint stiffness='3' springref='200'/><geom size='.1'/></body>"),
     "scene.xml:4: joint : spring that rests beyond half a turn left out\n"},
    {IN_WORLD("<body>\n<joint damping='1 0 2'/><geom size='.1'/></body>"),
     "scene.xml:4: joint: what is not linear of damping left out\n"},
    {IN_WORLD("<body name='b'><geom size='.1'/>\n<body name='a'><joint/></body></body>"),
     "scene.xml:4: body a moves and has no mass: its joint left out\n"},
    {IN_WORLD("<body name='a'><joint/><geom size='.1'/>"
              "<inertial pos='0 0 0' mass='1' diaginertia='1 1 4'/></body>"),
     "scene.xml:3: body a: no body has such an inertia, 2 kg m^2 about all axes instead\n"},

    {"<mujoco>\n<actuator>\n<motor/><motor/></actuator></mujoco>",
     "scene.xml:2: actuator left out, 2 in it\n"},
    {IN_WORLD("<geom type='sdf'/>"), "scene.xml:3: geom without a name left out, and its mass"},
    {IN_WORLD("<body gravcomp='1'><joint/><geom size='.1'/></body>"),
     "scene.xml:3: body: gravcomp left out\n"},
    {IN_WORLD("<body name='a'><freejoint/><inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/>"
              "</body>"),
     "scene.xml:3: body a left out: it has no geom\n"},
    {IN_WORLD("<pony/>"), "scene.xml:3: pony left out\n"},
};

TEST(what_is_left_out_is_told_with_its_line)
{
  for (size_t i = 0; i < sizeof left_out / sizeof left_out[0]; ++i) {
    noted notes = {.length = 0};
    hap_detail why = {""};
    import_options options = {.said = note_take, .user = &notes};
    hap_scene *scene = NULL;
    size_t count = 0;
    file_write(folder_path("scene.xml"), left_out[i].text);
    CHECK_SAY(import_scene(folder_path("scene.xml"), &options, &scene, &count, &why) == HAP_OK,
              "%s", why.text);
    CHECK_SAY(strstr(notes.lines, left_out[i].line) != NULL, "%s", notes.lines);
    CHECK(count == 1);
    CHECK(hap_scene_destroy(scene) == HAP_OK);
    options.strict = true;
    CHECK(import_scene(folder_path("scene.xml"), &options, &scene, NULL, &why) == HAP_ERROR_FORMAT);
    CHECK(scene == NULL);
    size_t line = strcspn(left_out[i].line, "\n");
    CHECK_SAY(strncmp(why.text, left_out[i].line, line) == 0, "%s", why.text);
  }
}

static const struct {
  const char *text;
  const char *says;
} refusals[] = {
    {"", "scene.xml:1: no XML"},
    {"<mujoco>\n<worldbody>\n</mujoco>", "scene.xml:3: no XML"},
    {"<html/>", "scene.xml:1: <html>"},
    {"<!DOCTYPE m [\n<!ENTITY a 'b'>\n<!ENTITY c '&a;&a;'>]>\n<mujoco/>",
     "scene.xml:1: a document type"},
    {IN_WORLD("<flexcomp/>"), "scene.xml:3: flexcomp"},
    {IN_WORLD("<body><composite/></body>"), "scene.xml:3: composite"},
    {"<mujoco>\n<extension>\n<plugin/></extension></mujoco>", "scene.xml:3: plugin"},
    {"<mujoco>\n<asset>\n<skin/></asset></mujoco>", "scene.xml:3: skin"},
    {IN_WORLD("<body pos='1 2'/>"), "scene.xml:3: pos: 2 numbers"},
    {IN_WORLD("<body pos='1 2 3 4'/>"), "scene.xml:3: pos: more than 3"},
    {IN_WORLD("<body pos='1 2 nan'/>"), "scene.xml:3: pos: \"nan\" is no number"},
    {IN_WORLD("<body pos='1 2 3e99'/>"), "scene.xml:3: pos: a number beyond"},
    {IN_WORLD("<body quat='0 0 0 0'/>"), "scene.xml:3: quat: has no direction"},
    {IN_WORLD("<geom size='-1'/>"), "scene.xml:3: size: number 1"},
    {IN_WORLD("<geom type='egg'/>"), "scene.xml:3: type: \"egg\" is none of"},
    {IN_WORLD("<geom class='none'/>"), "scene.xml:3: class: there is no class none"},
    {IN_WORLD("<replicate count='10001'/>"), "scene.xml:3: count: not within 1 and 10000"},
    {IN_WORLD("<replicate count='200'>\n<replicate count='200'/></replicate>"),
     "scene.xml:4: more than 10000 copies"},
    {"<mujoco>\n<asset>\n<hfield name='a' nrow='2' ncol='2' size='1 1 1 1' elevation='1 2 3'/>"
     "</asset><worldbody><geom type='hfield' hfield='a'/></worldbody></mujoco>",
     "scene.xml:3: elevation: 3 numbers"},
    {IN_WORLD("<geom type='hfield' hfield='a'/>"), "scene.xml:3: hfield: there is none named a"},
    {IN_WORLD("<joint/>"), "scene.xml:3: a joint of the world"},
    {IN_WORLD("<body><joint range='1 0'/><geom size='.1'/></body>"), "scene.xml:3: range"},
    {"<mujoco>\n<contact><exclude body1='a' body2='b'/></contact></mujoco>",
     "scene.xml:2: body1: there is no body a"},
    {URDF("<link name='a'/><joint type='fixed'><parent link='a'/><child link='b'/></joint>"),
     "scene.xml:3: child: there is no link b"},
    {URDF("<link name='a'/><link name='b'/><joint type='fixed'><parent link='a'/><child link='b'/>"
          "</joint>\n<joint type='fixed'><parent link='b'/><child link='a'/></joint>"),
     "scene.xml:1: links in a loop"},
    {URDF("<link name='a'/><link name='b'/><joint type='fixed'><parent link='a'/><child link='b'/>"
          "</joint>\n<joint type='fixed'><parent link='a'/><child link='b'/></joint>"),
     "scene.xml:4: child: link b has a parent"},
    {URDF("<link name='a'/><link name='b'/><joint type='odd'><parent link='a'/><child link='b'/>"
          "</joint>"),
     "scene.xml:3: type: no joint is \"odd\""},
    {"<mujoco><compiler eulerseq='xyq'/></mujoco>", "scene.xml:1: eulerseq"},
    {"<mujoco><compiler coordinate='global'/></mujoco>", "scene.xml:1: coordinate"},
};

TEST(what_cannot_be_is_refused_with_its_line)
{
  for (size_t i = 0; i < sizeof refusals / sizeof refusals[0]; ++i) {
    hap_detail why = {""};
    hap_scene *scene = (hap_scene *)&why; /* must be overwritten */
    file_write(folder_path("scene.xml"), refusals[i].text);
    CHECK_SAY(import_scene(folder_path("scene.xml"), NULL, &scene, NULL, &why) == HAP_ERROR_FORMAT,
              "%s", refusals[i].text);
    CHECK(scene == NULL);
    CHECK_SAY(strncmp(why.text, refusals[i].says, strlen(refusals[i].says)) == 0, "%s", why.text);
  }
  hap_detail why = {""};
  hap_scene *scene = NULL;
  CHECK(import_scene(folder_path("none.xml"), NULL, &scene, NULL, &why) == HAP_ERROR_NOT_FOUND);
  CHECK(strstr(why.text, "none.xml: cannot be read") != NULL);
}

/* A tree of a hundred thousand elements inside each other ends at the limit. */
TEST(depth_has_a_limit)
{
  enum {
    LEVELS = 100000
  };
  char *text = malloc(6 * LEVELS + 20);
  REQUIRE(text != NULL);
  memcpy(text, "<mujoco>", 9);
  for (size_t i = 0; i < LEVELS; ++i) {
    memcpy(text + 8 + 6 * i, "<body>", 7);
  }
  hap_detail why = {""};
  hap_scene *scene = NULL;
  file_write(folder_path("scene.xml"), text);
  free(text);
  CHECK(import_scene(folder_path("scene.xml"), NULL, &scene, NULL, &why) == HAP_ERROR_FORMAT);
  CHECK_SAY(strcmp(why.text, "scene.xml:1: more than 256 levels") == 0, "%s", why.text);
}

/* ---- hapode-run ---- */

static const char robot[] =
    "<mujoco>\n<worldbody>\n"
    "<geom type='plane' size='1 1 .1'/>\n"
    "<body pos='0 0 .3'><freejoint/><geom type='box' size='.1 .1 .05'/>\n"
    "<body pos='.15 0 0'><joint axis='0 1 0' springdamper='1 1'/><joint axis='0 0 1'/>\n"
    "<geom type='capsule' size='.03' fromto='0 0 0 .2 0 0'/></body>\n"
    "</body></worldbody></mujoco>\n";

/* What is too thin or too far away takes nothing of the rest. */
static const char odd[] =
    "<mujoco>\n<worldbody>\n<geom type='plane' size='1 1 .1'/>\n"
    "<body pos='0 0 .1'><freejoint/><geom type='box' size='.1 .1 .1'/>\n"
    "<geom type='box' size='.1 .1 1e-9' mass='0'/></body>\n"
    "<body pos='3e4 0 1'><freejoint/><geom size='.1'/></body>\n"
    "<body pos='8 0 .1'><freejoint/><geom size='.1'/></body>\n"
    "</worldbody></mujoco>\n";

TEST(a_file_of_odd_lengths_and_places_is_touched)
{
  file_write(folder_path("odd.xml"), odd);
  CHECK_SAY(run("--scene %s --lockstep", folder_path("odd.xml")) == 0, "%s", ran.err);
  CHECK_SAY(says("odd.xml:5: geom left out: a length that is not within 1e-6 and 1e6 m\n"), "%s",
            ran.err);
  CHECK_SAY(strstr(ran.out, "\nfault: none\n") != NULL, "%s", ran.out);
  CHECK(strstr(ran.out, "\npeak_force_n: 0\n") == NULL);
}

TEST(hapode_run_loads_a_file)
{
  file_write(folder_path("robot.xml"), robot);
  CHECK(run("--scene %s --lockstep --seconds 4", folder_path("robot.xml")) == 0);
  CHECK_SAY(says("robot.xml:5: joint: springdamper left out\n"), "%s", ran.err);
  CHECK_SAY(strstr(ran.out, "\nfault: none\n") != NULL, "%s", ran.out);
  CHECK(strstr(ran.out, "\npeak_force_n: 0\n") == NULL); /* the hand finds it */
  CHECK(run("--scene %s --lockstep --seconds 1 --strict", folder_path("robot.xml")) == 1);
  CHECK_SAY(says("hapode-run: --scene: robot.xml:5: joint: springdamper left out\n"), "%s",
            ran.err);
  CHECK(run("--scene %s", folder_path("none.xml")) == 2);
  CHECK(run("--scene row10 --strict") == 2);
}
