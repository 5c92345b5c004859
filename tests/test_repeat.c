/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Lockstep has the same bits in every run, whatever addresses ODE's heap gives to what the
 * application makes in place of what it destroyed. */

#include "tests/tap.h"

#include "tests/contact_world.h"
#include "tests/repeat.h"
#include "tests/solids.h"

#define EDGE 0.1         /* m, of the cubes */
#define SLAB 0.2         /* m, their ground is so thick */
#define TICKS 1000       /* of a run */
#define EDIT_AT 130      /* an edit every so many ticks: physics steps every 50 */
#define RARE_EDIT_AT 400 /* windows of looking back pass between two edits */

typedef struct scene {
  contact_world w;
  dGeomID slab;
  dGeomID geoms[2]; /* of the two bodies */
  dJointID joints[2];
  int joint_count;
  int edits;
} scene;

typedef struct edit_case {
  const char *name;
  void (*begin)(scene *s); /* may be NULL */
  void (*edit)(scene *s);
  bool tool;       /* the hand is a box */
  double lookback; /* of the session's def */
} edit_case;

static void add_box_geom(scene *s, int i, double edge)
{
  s->geoms[i] = dCreateBox(s->w.space, edge, edge, EDGE);
  dGeomSetBody(s->geoms[i], s->w.bodies[i]);
}

static void set_mass(dBodyID body)
{
  dMass mass;
  dMassSetBoxTotal(&mass, 0.5, EDGE, EDGE, EDGE);
  dBodySetMass(body, &mass);
}

static void add_cube(scene *s, int i, double x)
{
  s->w.bodies[i] = dBodyCreate(s->w.world);
  set_mass(s->w.bodies[i]);
  dBodySetPosition(s->w.bodies[i], x, 0.0, 0.5 * EDGE);
  add_box_geom(s, i, EDGE);
}

static void add_slab(scene *s, double length)
{
  s->slab = dCreateBox(s->w.space, length, length, SLAB);
  dGeomSetPosition(s->slab, 0.0, 0.0, -0.5 * SLAB);
}

/* ---- the edits, all told ---- */

static void drop_geom(scene *s, dGeomID geom)
{
  CHECK(hap_session_forget_geom(s->w.session, geom) == HAP_OK);
  dGeomDestroy(geom);
}

static void replace_geom(scene *s)
{
  drop_geom(s, s->geoms[0]);
  add_box_geom(s, 0, EDGE + 0.001 * (s->edits % 3));
}

static void replace_geom_by_its_like(scene *s)
{
  drop_geom(s, s->geoms[0]);
  add_box_geom(s, 0, EDGE);
}

static void replace_slab(scene *s)
{
  drop_geom(s, s->slab);
  add_slab(s, 2.0 + 0.001 * (s->edits % 3));
}

/* A cube as a convex geom, of two sizes. */
static void add_convex(scene *s, int size)
{
  static box_arrays boxes[2];
  double half = 0.05 + 0.005 * size;
  s->geoms[0] = convex_box(s->w.space, &boxes[size], AT(half, half, 0.05));
  dGeomSetBody(s->geoms[0], s->w.bodies[0]);
}

static void begin_convex(scene *s)
{
  dGeomDestroy(s->geoms[0]);
  add_convex(s, 0);
}

static void replace_convex(scene *s)
{
  drop_geom(s, s->geoms[0]);
  add_convex(s, (s->edits + 1) % 2);
}

static void hinge_make(scene *s, dBodyID other)
{
  const dReal *at = dBodyGetPosition(s->w.bodies[0]);
  dJointID joint = dJointCreateHinge(s->w.world, NULL);
  dJointAttach(joint, s->w.bodies[0], other);
  dJointSetHingeAnchor(joint, at[0], at[1], at[2]);
  dJointSetHingeAxis(joint, 0.0, 0.0, 1.0);
  s->joints[s->joint_count++] = joint;
}

static void begin_hinge(scene *s)
{
  hinge_make(s, s->w.bodies[1]);
}

static void drop_joints(scene *s)
{
  while (s->joint_count > 0) {
    dJointDestroy(s->joints[--s->joint_count]);
  }
}

static void replace_hinge(scene *s)
{
  drop_joints(s);
  hinge_make(s, s->w.bodies[1]);
}

/* Two of the same kind between the same bodies, which change addresses. */
static void balls_make(scene *s)
{
  const dReal *at = dBodyGetPosition(s->w.bodies[0]);
  for (int i = 0; i < 2; ++i) {
    dJointID joint = dJointCreateBall(s->w.world, NULL);
    dJointAttach(joint, s->w.bodies[0], s->w.bodies[1]);
    dJointSetBallAnchor(joint, at[0] + 0.06, at[1] + 0.03 * (2 * i - 1), at[2]);
    s->joints[s->joint_count++] = joint;
  }
}

static void replace_balls(scene *s)
{
  if (s->edits % 2 == 0) {
    drop_joints(s);
  } else { /* the other way round */
    dJointDestroy(s->joints[0]);
    dJointDestroy(s->joints[1]);
    s->joint_count = 0;
  }
  balls_make(s);
}

static void fixed_make(scene *s)
{
  dJointID joint = dJointCreateFixed(s->w.world, NULL);
  dJointAttach(joint, s->w.bodies[0], s->w.bodies[1]);
  dJointSetFixed(joint);
  s->joints[s->joint_count++] = joint;
}

static void replace_fixed(scene *s)
{
  drop_joints(s);
  fixed_make(s);
}

/* One that the loop has to measure; along another axis each time. */
static void slider_make(scene *s)
{
  const dReal *at = dBodyGetPosition(s->w.bodies[0]);
  dJointID joint = dJointCreatePiston(s->w.world, NULL);
  dJointAttach(joint, s->w.bodies[0], s->w.bodies[1]);
  dJointSetPistonAnchor(joint, at[0], at[1], at[2]);
  dJointSetPistonAxis(joint, 1.0, 0.1 * (s->edits % 3), 0.0);
  s->joints[s->joint_count++] = joint;
}

static void replace_slide(scene *s)
{
  drop_joints(s);
  slider_make(s);
}

static void replace_body_on_hinge(scene *s)
{
  double x = dBodyGetPosition(s->w.bodies[1])[0];
  drop_joints(s);
  CHECK(hap_session_forget_body(s->w.session, s->w.bodies[1]) == HAP_OK);
  drop_geom(s, s->geoms[1]);
  dBodyDestroy(s->w.bodies[1]);
  add_cube(s, 1, x);
  hinge_make(s, s->w.bodies[1]);
}

/* ---- a run ---- */

/* Two cubes on a slab; a hand pushes the first one on, again and again. */
static void run_case(repeat_log *log, const void *arg)
{
  const edit_case *c = arg;
  static scene s;
  memset(&s, 0, sizeof s);
  cw_open(&s.w, CW_GRAVITY);
  add_slab(&s, 2.0);
  add_cube(&s, 0, 0.0);
  add_cube(&s, 1, EDGE + 0.02);
  s.w.body_count = 2;
  dQuaternion turned = {0.98, 0.0, 0.0, 0.2};
  dBodySetQuaternion(s.w.bodies[0], turned);
  if (c->begin != NULL) {
    c->begin(&s);
  }
  double corners[24];
  box_corners(AT(0.01, 0.01, 0.01), AT(0.0, 0.0, 0.0), corners);
  s.w.hand_def.hull_xyz = c->tool ? corners : NULL;
  s.w.hand_def.hull_points = c->tool ? 8 : 0;
  s.w.hand_def.friction = c->tool ? 0.5 : 0.0;
  s.w.expert.lookback = c->lookback;
  cw_start(&s.w, -0.07, 0.01, 0.5 * EDGE);
  hap_status status = HAP_OK;
  int every = c->lookback > 0.0 ? RARE_EDIT_AT : EDIT_AT;
  for (int i = 0; i < TICKS && status == HAP_OK; ++i) {
    if (i % every == every - 1) {
      c->edit(&s);
      ++s.edits;
    }
    s.w.hand_at[0] = -0.06 + 5e-5 * i + 0.02 * sin(0.02 * i);
    cw_put_hand(&s.w, 0.0, 0.0, 0.0);
    status = hap_session_advance(s.w.session, 1);
    repeat_note(log, s.w.session);
  }
  hap_stats stats = cw_stats(&s.w);
  CHECK(status == HAP_OK && stats.loop.contact_ticks > 50 && stats.faults.count == 0);
  CHECK(stats.faults.bodies_lost == 0 && stats.model.range_bodies == 2);
  CHECK(c->lookback == 0.0 || (stats.error.lookbacks > 0 && stats.error.spoilt > 0));
  cw_close(&s.w);
}

TEST(what_is_replaced)
{
  static const edit_case cases[] = {
      {"a geom of a body", NULL, replace_geom},
      {"a geom by its like", NULL, replace_geom_by_its_like},
      {"a convex geom", begin_convex, replace_convex},
      {"a static geom", NULL, replace_slab},
      {"a joint", begin_hinge, replace_hinge},
      {"two joints of the same bodies", balls_make, replace_balls},
      {"a fixed joint", fixed_make, replace_fixed},
      {"a joint that is measured", slider_make, replace_slide},
      {"a body and its joint", begin_hinge, replace_body_on_hinge},
      {"a geom at a tool", NULL, replace_geom, .tool = true},
      {"a geom at a tool, by its like", NULL, replace_geom_by_its_like, .tool = true},
      {"a geom, looking back", NULL, replace_geom, .lookback = 0.1},
      {"a static geom, looking back", NULL, replace_slab, .lookback = 0.1},
  };
  for (size_t i = 0; i < sizeof cases / sizeof cases[0]; ++i) {
    bool same = repeat_run(run_case, &cases[i]);
    CHECK_SAY(same, "in another place: %s", cases[i].name);
  }
}

SET_UP
{
  repeat_init();
  return true;
}
