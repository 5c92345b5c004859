/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Mechanisms of scene files that touch nothing move as MuJoCo moves them. */

#include "tests/tap.h"

#include <math.h>
#include <string.h>

#include "import/import.h"
#include "tests/program.h"
#include "tests/scene_oracle.h"

SET_UP
{
  return program_use("HAPODE_RUN");
}

typedef struct file_case {
  const char *name;
  const char *text;
} file_case;

#define IN_WORLD(text) "<mujoco>\n<worldbody>\n" text "\n</worldbody>\n</mujoco>\n"

static hap_scene *scene_of(const char *text)
{
  hap_scene *scene = NULL;
  hap_detail why = {""};
  const char *path = folder_path("scene.xml");
  file_write(path, text);
  REQUIRE_SAY(import_scene(path, NULL, &scene, NULL, &why) == HAP_OK, "%s", why.text);
  return scene;
}

#define FREE_GEOM "contype='0' conaffinity='0'"
static const file_case moving_cases[] = {
    {"a_double_pendulum",
     IN_WORLD("<body pos='0 0 1'><joint axis='0 1 0'/>"
              "<geom type='capsule' size='.02' fromto='0 0 0 .3 0 0' " FREE_GEOM
              "/><body pos='.3 0 0'><joint axis='0 1 0'/><geom type='capsule' "
              "size='.02' fromto='0 0 0 .2 0 .1' " FREE_GEOM "/></body></body>")},
    {"springs_and_dampers",
     IN_WORLD("<body pos='0 0 1'><joint axis='0 1 0' stiffness='2' springref='-40' damping='.05'/>"
              "<geom type='capsule' size='.02' fromto='0 0 0 .3 0 0' " FREE_GEOM "/>"
              "<body pos='.3 0 0'><joint axis='0 0 1' stiffness='.5' springref='60' damping='.01'/>"
              "<geom type='box' size='.1 .03 .02' pos='.1 0 0' " FREE_GEOM "/></body></body>")},
    {"rotors", IN_WORLD("<body pos='0 0 1'><joint axis='0 1 0' armature='.02'/>"
                        "<geom type='capsule' size='.02' fromto='0 0 0 .3 0 0' " FREE_GEOM "/>"
                        "<body pos='.3 0 0'><joint axis='0 1 0' armature='.01' damping='.02'/>"
                        "<geom type='box' size='.1 .03 .02' pos='.1 0 0' " FREE_GEOM "/></body>"
                        "</body>")},
    {"a_slide_with_a_pendulum",
     IN_WORLD("<body><joint type='slide' axis='1 0 0' stiffness='40' springref='.2' damping='1' "
              "armature='.5'/><geom type='box' size='.1 .1 .1' mass='1' " FREE_GEOM "/>"
              "<body pos='0 .2 0'><joint axis='0 1 0' damping='.01'/><geom size='.05' "
              "pos='.2 0 -.2' " FREE_GEOM "/></body></body>")},
    {"two_hinges_at_a_point",
     IN_WORLD("<body pos='0 0 1'><joint axis='1 0 0' stiffness='1' springref='50' damping='.02'/>"
              "<joint axis='0 1 0' stiffness='2' springref='-30' damping='.03' armature='.01'/>"
              "<geom type='box' size='.1 .03 .02' pos='.1 .05 0' " FREE_GEOM "/></body>")},
    {"friction",
     IN_WORLD("<body pos='0 0 1'><joint axis='0 1 0' frictionloss='.2' damping='.1'/>"
              "<geom type='capsule' size='.02' fromto='0 0 0 .3 0 0' mass='.4' " FREE_GEOM
              "/></body>")},
};

/* In steps of 1 ms of the whole world (model SINGLE). */
TEST_EACH(moving_cases, const file_case *row)
{
  hap_session_def def;
  hap_session *session = NULL;
  hap_scene *scene = scene_of(row->text);
  hap_scene_counts counts;
  if (!scene_oracle_is_there()) {
    (void)hap_scene_destroy(scene);
    SKIP("MuJoCo is not there to compare with (Debian: libmujoco-dev)");
  }
  hap_session_def_init(&def, sizeof def);
  def.drive = HAP_DRIVE_LOCKSTEP;
  def.model = HAP_MODEL_SINGLE;
  REQUIRE(hap_scene_session(scene, &def, &session, NULL) == HAP_OK);
  REQUIRE(hap_session_start(session) >= HAP_OK);
  CHECK(hap_scene_count(scene, &counts, sizeof counts) == HAP_OK);
  for (int ms = 200; ms <= 1000; ms += 200) {
    REQUIRE(hap_session_advance(session, 200) == HAP_OK);
    for (uint32_t i = 0; i < counts.bodies; ++i) {
      hap_scene_body body;
      double right[3];
      CHECK(hap_scene_get_body(scene, i, &body, sizeof body) == HAP_OK);
      REQUIRE(scene_oracle_move(folder_path("scene.xml"), 1e-3 * ms, i, right));
      for (int k = 0; k < 3; ++k) {
        CHECK_SAY(fabs(body.pose.position[k] - right[k]) < 5e-3,
                  "body %u at %d ms: [%d] is %.5f and not %.5f", i, ms, k, body.pose.position[k],
                  right[k]);
      }
    }
  }
  hap_session_destroy(session);
  CHECK(hap_scene_destroy(scene) == HAP_OK);
}
