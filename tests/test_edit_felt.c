/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* One edit of the body that a hand presses on: what the hand feels of it. Every write is looked
 * at (felt.h): finite, within the limit, no steeper than the slew limit. */

#include "tests/tap.h"

#include "tests/felt.h"

/* A hand of 150 N/m that wants 4 cm behind a face of 1 kN/m. */
#define PRESSING "hand=relaxed,device_mass=0.1,device_damping=2,path=0:-0.08/0/0;0.5:-0.02/0/0"
#define PRESSED 5.217 /* N */

static felt_stage f;

static void run_ticks(int count)
{
  for (int i = 0; i < count; ++i) {
    CHECK(hap_session_advance(f.s.session, 1) >= HAP_OK);
  }
}

typedef struct edit_case {
  const char *name;
  void (*edit)(void);
  double least; /* N, a second later */
  double most;
} edit_case;

static void destroy_told(void)
{
  CHECK(hap_session_forget_geom(f.s.session, f.s.geom) == HAP_OK);
  CHECK(hap_session_forget_body(f.s.session, f.s.cube) == HAP_OK);
  dGeomDestroy(f.s.geom);
  dBodyDestroy(f.s.cube);
}

static void destroy_untold(void)
{
  dGeomDestroy(f.s.geom);
  dBodyDestroy(f.s.cube);
}

static void destroy_geom(void)
{
  dGeomDestroy(f.s.geom);
}

static void floor_build(void)
{
  f.s.cube = dBodyCreate(f.s.world);
  f.s.geom = dCreateBox(f.s.space, 1.0, 1.0, 1.0);
  dGeomSetBody(f.s.geom, f.s.cube);
  dBodySetKinematic(f.s.cube);
  dBodySetPosition(f.s.cube, 0.45, 0.0, 0.0);
}

static void replace_told(void)
{
  destroy_told();
  floor_build();
}

static void replace_untold(void)
{
  destroy_untold();
  floor_build();
}

static void cube_grow(void)
{
  dGeomBoxSetLengths(f.s.geom, 1.01, 1.0, 1.0);
}

static void grow_much(void)
{
  dGeomBoxSetLengths(f.s.geom, 1.1, 1.0, 1.0);
}

static void cube_shrink(void)
{
  dGeomBoxSetLengths(f.s.geom, 0.8, 1.0, 1.0);
}

static void cube_shift(void)
{
  dGeomSetOffsetPosition(f.s.geom, -0.01, 0.0, 0.0);
}

static void move_away(void)
{
  dBodySetPosition(f.s.cube, 5.0, 0.0, 0.0);
}

static void move_over(void)
{
  dBodySetPosition(f.s.cube, 0.2, 0.0, 0.0);
}

static void pull_back(void)
{
  dBodySetLinearVel(f.s.cube, 1.0, 0.0, 0.0);
}

static void set_free(void)
{
  dBodySetDynamic(f.s.cube);
}

static void switch_off(void)
{
  dGeomDisable(f.s.geom);
}

static void cube_hide(void)
{
  dGeomSetCategoryBits(f.s.geom, 0);
}

static void take_off(void)
{
  dGeomSetBody(f.s.geom, NULL); /* stays where it is */
}

static void cube_hinge(void)
{
  dJointID joint = dJointCreateHinge(f.s.world, NULL);
  dJointAttach(joint, f.s.cube, NULL);
  dJointSetHingeAnchor(joint, 0.45, 0.0, 0.0);
  dBodySetDynamic(f.s.cube);
}

static void change_world(void)
{
  dWorldSetGravity(f.s.world, 0.0, 0.0, -20.0);
  dWorldSetERP(f.s.world, 0.8);
  dWorldSetCFM(f.s.world, 1e-3);
}

static void cube_disable(void)
{
  dBodyDisable(f.s.cube);
}

static const edit_case cases[] = {
    {"destroyed, told", destroy_told, 0.0, 0.0},
    {"destroyed, not told", destroy_untold, 0.0, 0.0},
    {"its geom destroyed", destroy_geom, 0.0, 0.0},
    {"replaced, told", replace_told, PRESSED - 0.01, PRESSED + 0.01},
    {"replaced, not told", replace_untold, PRESSED - 0.01, PRESSED + 0.01},
    {"grown by 5 mm", cube_grow, PRESSED + 0.6, PRESSED + 0.8},
    {"grown by 50 mm", grow_much, FELT_LIMIT, FELT_LIMIT},
    {"shrunk", cube_shrink, 0.0, 0.0},
    {"shifted by 10 mm", cube_shift, PRESSED + 1.2, PRESSED + 1.5},
    {"moved away", move_away, 0.0, 0.0},
    {"moved over the hand", move_over, FELT_LIMIT, FELT_LIMIT},
    {"pulled back", pull_back, 0.0, 0.0},
    {"set free", set_free, 0.0, 0.0},
    {"geom switched off", switch_off, 0.0, 0.0},
    {"geom without category", cube_hide, 0.0, 0.0},
    {"geom without body", take_off, PRESSED - 0.01, PRESSED + 0.01},
    {"on a hinge, through its middle", cube_hinge, PRESSED - 0.2, PRESSED + 0.2},
    {"gravity, ERP, CFM", change_world, PRESSED - 0.01, PRESSED + 0.01},
    {"disabled", cube_disable, PRESSED - 0.01, PRESSED + 0.01},
};

/* A sync of 50 Hz, a tick more, and the way down at the slew limit. */
#define LATEST 30

static void check_case(const edit_case *what, hap_model model)
{
  felt_init(&f, HAP_DRIVE_LOCKSTEP, true);
  f.s.def.model = model;
  dBodySetKinematic(f.s.cube);
  REQUIRE(felt_begin(&f, PRESSING));
  run_ticks(2000);
  CHECK_NEAR(felt_force(), PRESSED, 0.01);
  felt.steepest = 0.0;
  what->edit();
  run_ticks(LATEST);
  bool gone = what->most == 0.0 && what->edit != pull_back && what->edit != set_free;
  CHECK(!gone || felt_force() == 0.0);
  run_ticks(1500);
  double force = felt_force();
  bool good = force >= what->least - 1e-9 && force <= what->most + 1e-9 && felt.bad == 0 &&
              stats_of(&f.s).faults.count == 0;
  CHECK_SAY(good, "%s, %s: %.4f N, steps of %.3f N, peak %.3f", what->name, hap_model_name(model),
            force, felt.steepest, felt.peak);
  felt_end(&f);
}

TEST(every_edit_is_felt_without_a_jump)
{
  const hap_model models[] = {HAP_MODEL_CONTACT, HAP_MODEL_ACCELERANCE, HAP_MODEL_SINGLE};
  for (size_t i = 0; i < sizeof cases / sizeof cases[0]; ++i) {
    for (int m = 0; m < 3; ++m) {
      check_case(&cases[i], models[m]);
    }
  }
}
