/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Testing simulations that are not made again: how many are made while all rests, that none is used
 * again when the application has changed something, and that the hand feels the same. */

#include <math.h>
#include <string.h>

#include <tests/tap.h>

#include <tests/contact_world.h>
#include <tests/unknown_shape.h>

#include "physics/physics_internal.h"
#include "session/session_internal.h"

#define EDGE 0.05
#define STEP_TICKS 20 /* of a physics step */
#define STEPS_OF_A 4  /* testing simulations that a contact takes */
#define SETTLE_STEPS 60
#define HELD 0.001   /* m, that the hand is in the body: 2 N, where friction holds 3 */
#define LAYER 1e-3   /* m */
#define OVERLAP 5e-4 /* m: touching, within the layer where nothing is pushed out */
#define MOVED 2e-5   /* m: more than what holds for the same */

/* Two cubes, one on the other, and a hand that is held against the upper one. */
typedef struct stack {
  contact_world w;
  dGeomID floor;
  dGeomID top_geom;
  bool apart; /* for the application the lower cube does not touch the floor */
} stack;

static void stack_end(void *owned)
{
  cw_close(&((stack *)owned)->w);
}

static bool stack_surface(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  stack *s = user;
  *io = s->w.surface;
  return !s->apart || (a != s->floor && b != s->floor);
}

static stack *stack_new(double reuse, hap_probe probe)
{
  stack *s = tap_own(sizeof *s, stack_end);
  cw_open(&s->w, CW_GRAVITY);
  dWorldSetContactSurfaceLayer(s->w.world, LAYER);
  s->w.def.physics_hz = 50.0;
  s->w.def.model = HAP_MODEL_ACCELERANCE;
  s->w.expert.reuse = reuse;
  s->w.research.probe = probe;
  s->w.ode.surface = stack_surface;
  s->floor = cw_add_floor(&s->w);
  (void)cw_add_cube(&s->w, 1.0, EDGE, 0.0, 0.0, 0.5 * EDGE - OVERLAP);
  (void)cw_add_cube(&s->w, 0.6, EDGE, 0.0, 0.0, 1.5 * EDGE - 2.0 * OVERLAP);
  s->top_geom = dBodyGetFirstGeom(s->w.bodies[1]);
  return s;
}

static void stack_start(stack *s)
{
  double radius = s->w.hand_def.radius;
  cw_start(&s->w, -0.5 * EDGE - radius, 0.0, 1.5 * EDGE - 2.0 * OVERLAP);
  cw_go(&s->w, 0.01, 0.0, 0.0, (int)(1000.0 * HELD / 0.01));
  cw_go(&s->w, 0.0, 0.0, 0.0, SETTLE_STEPS * STEP_TICKS);
}

/* Testing simulations of so many physics steps. */
static uint64_t probes_of(contact_world *w, int steps)
{
  uint64_t before = cw_stats(w).probes.steps;
  cw_run(w, steps * STEP_TICKS);
  return cw_stats(w).probes.steps - before;
}

/* ---- while all rests ---- */

static void check_rest(hap_probe probe)
{
  stack *s = stack_new(1e-6, probe);
  stack *reference = stack_new(0.0, probe);
  stack_start(s);
  stack_start(reference);
  CHECK_NEAR(s->w.force[0], -2000.0 * HELD, 0.02);
  for (int step = 0; step < 20; ++step) {
    uint64_t made = probes_of(&s->w, 1);
    CHECK(made <= 1);
    CHECK(probes_of(&reference->w, 1) == STEPS_OF_A);
    CHECK_NEAR(s->w.force[0], reference->w.force[0], 1e-3 * fabs(reference->w.force[0]));
  }
  CHECK(cw_stats(&s->w).probes.reused >= 20);
  CHECK(cw_stats(&reference->w).probes.reused == 0);
}

TEST(what_rests_is_measured_once)
{
  check_rest(HAP_PROBE_SHARED);
  check_rest(HAP_PROBE_OPERATING);
}

TEST(as_in_the_paper_all_are_made)
{
  stack *s = stack_new(1e-6, HAP_PROBE_PAPER);
  stack_start(s);
  CHECK(probes_of(&s->w, 3) == 3 * STEPS_OF_A && cw_stats(&s->w).probes.reused == 0);
  s = stack_new(1e-6, HAP_PROBE_SHARED);
  expert_wish(&s->w.expert, HAP_EFFECT_TESTING, HAP_EFFECT_ON);
  stack_start(s);
  CHECK(probes_of(&s->w, 3) == 3 * STEPS_OF_A && cw_stats(&s->w).probes.reused == 0);
}

/* Each step is less than what holds for the same, ten of them are not. */
TEST(what_creeps_is_measured_again)
{
  stack *s = stack_new(1e-6, HAP_PROBE_SHARED);
  stack_start(s);
  uint64_t before = cw_stats(&s->w).probes.reused;
  for (int step = 0; step < 12; ++step) {
    s->w.hand_at[2] += 3e-7;
    cw_run(&s->w, STEP_TICKS);
  }
  uint64_t reused = cw_stats(&s->w).probes.reused - before;
  CHECK(reused >= 6 && reused <= 10);
}

/* ---- what the application changes ---- */

typedef void (*change_fn)(stack *s);

static void change_mass(stack *s)
{
  dMass m;
  dMassSetBoxTotal(&m, 0.7, EDGE, EDGE, EDGE);
  dBodySetMass(s->w.bodies[0], &m);
}

static void change_inertia(stack *s)
{
  dMass m;
  dBodyGetMass(s->w.bodies[1], &m);
  m.I[0] *= 1.5;
  dBodySetMass(s->w.bodies[1], &m);
}

static void move_lower(stack *s)
{
  const dReal *p = dBodyGetPosition(s->w.bodies[0]);
  dBodySetPosition(s->w.bodies[0], p[0] + MOVED, p[1], p[2]);
}

static void turn_lower(stack *s)
{
  dQuaternion q;
  dQFromAxisAndAngle(q, 0.0, 0.0, 1.0, MOVED / EDGE * 2.0);
  dBodySetQuaternion(s->w.bodies[0], q);
}

static void push_lower(stack *s)
{
  dBodySetLinearVel(s->w.bodies[0], 0.5, 0.0, 0.0); /* friction takes 0.1 in a step */
}

static void change_friction(stack *s)
{
  s->w.surface.mu = 0.4999;
}

static void change_softness(stack *s)
{
  s->w.surface.mode |= dContactSoftCFM;
  s->w.surface.soft_cfm = 1e-5;
}

static void change_direction(stack *s)
{
  s->w.surface.mode |= dContactFDir1;
  s->w.direction[0] = 0.6;
  s->w.direction[1] = 0.8;
}

static void stack_part(stack *s)
{
  s->apart = true;
}

static void lower_floor(stack *s)
{
  dGeomPlaneSetParams(s->floor, 0.0, 0.0, 1.0, -MOVED);
}

static void tilt_floor(stack *s)
{
  dGeomPlaneSetParams(s->floor, 1e-3, 0.0, 1.0, 0.0);
}

static void stack_shrink(stack *s)
{
  dGeomBoxSetLengths(s->top_geom, EDGE, EDGE - 4.0 * MOVED, EDGE);
}

static void add_geom(stack *s)
{
  dGeomID geom = dCreateSphere(s->w.space, 0.01);
  dGeomSetBody(geom, s->w.bodies[0]);
  dGeomSetOffsetPosition(geom, 0.02, 0.02, -0.5 * EDGE + 0.0099);
}

static void add_body(stack *s)
{
  (void)cw_add_cube(&s->w, 0.2, EDGE, EDGE - 1e-4, 0.0, 0.5 * EDGE);
}

static void add_joint(stack *s)
{
  dJointID joint = dJointCreateBall(s->w.world, NULL);
  dJointAttach(joint, s->w.bodies[0], s->w.bodies[1]);
  dJointSetBallAnchor(joint, 0.0, 0.0, EDGE);
}

static void change_gravity(stack *s)
{
  dWorldSetGravity(s->w.world, 0.0, 0.0, -9.80);
}

static void leave_gravity(stack *s)
{
  dBodySetGravityMode(s->w.bodies[0], 0);
}

static void change_damping(stack *s)
{
  dBodySetLinearDamping(s->w.bodies[0], 0.01);
}

static void change_iterations(stack *s)
{
  dWorldSetQuickStepNumIterations(s->w.world, 50);
}

static void change_layer(stack *s)
{
  dWorldSetContactSurfaceLayer(s->w.world, 2e-4);
}

static void add_force(stack *s)
{
  s->w.user.force[0] = 0.05;
}

static void make_kinematic(stack *s)
{
  dBodySetKinematic(s->w.bodies[0]);
}

static void move_hand(stack *s)
{
  s->w.hand_at[2] += MOVED;
}

static void stack_press(stack *s)
{
  s->w.hand_at[0] += 10.0 * MOVED;
}

static const struct {
  const char *name;
  change_fn change;
  int steps; /* until physics knows of it */
} changes[] = {
    {"mass", change_mass, 1},
    {"inertia", change_inertia, 1},
    {"pose", move_lower, 1},
    {"turn", turn_lower, 1},
    {"velocity", push_lower, 1},
    {"mu", change_friction, 1},
    {"softness", change_softness, 1},
    {"friction direction", change_direction, 1},
    {"contact gone", stack_part, 1},
    {"floor lowered", lower_floor, 1},
    {"floor tilted", tilt_floor, 1},
    {"size", stack_shrink, 1},
    {"geom", add_geom, 1},
    {"body", add_body, 1},
    {"joint", add_joint, 1},
    {"gravity", change_gravity, 1},
    {"gravity of a body", leave_gravity, 1},
    {"damping", change_damping, 1},
    {"iterations", change_iterations, 1},
    {"surface layer", change_layer, 1},
    {"force", add_force, 1},
    {"kinematic", make_kinematic, 1},
    {"hand along", move_hand, 2},
    {"hand into", stack_press, 2},
};

static void check_change(size_t which, double *out_worst)
{
  stack *s = stack_new(1e-6, HAP_PROBE_SHARED);
  stack *reference = stack_new(0.0, HAP_PROBE_SHARED);
  stack_start(s);
  stack_start(reference);
  CHECK(probes_of(&s->w, 1) <= 1);
  (void)probes_of(&reference->w, 1);
  changes[which].change(s);
  changes[which].change(reference);
  uint64_t made = probes_of(&s->w, changes[which].steps);
  (void)probes_of(&reference->w, changes[which].steps);
  if (made < STEPS_OF_A) {
    printf("# %s: %d testing simulations\n", changes[which].name, (int)made);
  }
  CHECK(made >= STEPS_OF_A);
  for (int tick = 0; tick < 4 * STEP_TICKS; ++tick) {
    cw_tick(&s->w);
    cw_tick(&reference->w);
    for (int k = 0; k < 3; ++k) {
      *out_worst = fmax(*out_worst, fabs(s->w.force[k] - reference->w.force[k]));
    }
  }
}

TEST(what_is_changed_is_measured_in_the_next_step)
{
  for (size_t i = 0; i < sizeof changes / sizeof changes[0]; ++i) {
    double worst = 0.0;
    check_change(i, &worst);
    if (worst > 0.01) {
      printf("# %s: the force is another by %g N\n", changes[i].name, worst);
    }
    CHECK(worst <= 0.01); /* of 2 N */
  }
}

/* ---- joints ---- */

typedef struct held {
  contact_world w;
  dJointID joint;
} held;

static void held_end(void *owned)
{
  cw_close(&((held *)owned)->w);
}

/* A cube that a joint holds to the world in the air. */
static held *held_new(dJointID (*create)(held *h))
{
  held *h = tap_own(sizeof *h, held_end);
  cw_open(&h->w, 0.0);
  h->w.def.physics_hz = 50.0;
  h->w.def.model = HAP_MODEL_ACCELERANCE;
  (void)cw_add_cube(&h->w, 1.0, EDGE, 0.0, 0.0, 0.0);
  h->joint = create(h);
  return h;
}

static dJointID create_hinge(held *h)
{
  dJointID joint = dJointCreateHinge(h->w.world, NULL);
  dJointAttach(joint, h->w.bodies[0], NULL);
  dJointSetHingeAnchor(joint, -0.1, 0.0, 0.0);
  dJointSetHingeAxis(joint, 0.0, 1.0, 0.0);
  dJointSetHingeParam(joint, dParamFMax, 5.0);
  return joint;
}

static dJointID create_fixed(held *h)
{
  dJointID joint = dJointCreateFixed(h->w.world, NULL);
  dJointAttach(joint, h->w.bodies[0], NULL);
  dJointSetFixed(joint);
  dJointSetFixedParam(joint, dParamCFM, 1e-3);
  return joint;
}

static dJointID create_slider(held *h)
{
  dJointID joint = dJointCreateSlider(h->w.world, NULL);
  dJointAttach(joint, h->w.bodies[0], NULL);
  dJointSetSliderAxis(joint, 0.0, 0.0, 1.0);
  dJointSetSliderParam(joint, dParamFMax, 50.0);
  return joint;
}

static void start_held(held *h)
{
  cw_start(&h->w, 0.5 * EDGE + h->w.hand_def.radius, 0.0, 0.0);
  cw_move_hand(&h->w, -0.02, 0.0, 0.0); /* through the hinge's axis */
  cw_run(&h->w, 100);
  cw_go(&h->w, 0.0, 0.0, 0.0, SETTLE_STEPS * STEP_TICKS);
}

static void change_motor(held *h)
{
  dJointSetHingeParam(h->joint, dParamFMax, 4.9);
}

static void change_speed(held *h)
{
  dJointSetHingeParam(h->joint, dParamVel, 1e-9);
}

static void change_stop(held *h)
{
  dJointSetHingeParam(h->joint, dParamLoStop, -1.0);
}

static void change_anchor(held *h)
{
  dJointSetHingeAnchor(h->joint, -0.12, 0.0, 0.0);
}

static void change_axis(held *h)
{
  dJointSetHingeAxis(h->joint, 0.01, 1.0, 0.0);
}

static void switch_off(held *h)
{
  dJointDisable(h->joint);
}

static void change_fixed(held *h)
{
  dJointSetFixedParam(h->joint, dParamCFM, 1.1e-3);
}

/* Nothing of it has a getter: it shows where the body goes. */
static void set_anew(held *h)
{
  dJointSetFixed(h->joint);
}

static void change_slider(held *h)
{
  dJointSetSliderAxis(h->joint, 0.0, 0.01, 1.0);
}

TEST(joints_are_held_against_what_they_were)
{
  static const struct {
    const char *name;
    dJointID (*create)(held *h);
    void (*change)(held *h);
  } cases[] = {
      {"motor", create_hinge, change_motor},    {"speed", create_hinge, change_speed},
      {"stop", create_hinge, change_stop},      {"anchor", create_hinge, change_anchor},
      {"axis", create_hinge, change_axis},      {"off", create_hinge, switch_off},
      {"softness", create_fixed, change_fixed}, {"fixed anew", create_fixed, set_anew},
      {"slider", create_slider, change_slider},
  };
  for (size_t i = 0; i < sizeof cases / sizeof cases[0]; ++i) {
    held *h = held_new(cases[i].create);
    start_held(h);
    CHECK(h->w.force[0] > 1.0);
    uint64_t rest = probes_of(&h->w, 2);
    cases[i].change(h);
    uint64_t made = probes_of(&h->w, 1);
    if (rest != 2 || made < STEPS_OF_A) {
      printf("# %s: %d at rest, then %d\n", cases[i].name, (int)rest, (int)made);
    }
    CHECK(rest == 2); /* b alone */
    CHECK(made >= STEPS_OF_A);
  }
}

/* ---- model CONTACT ---- */

/* A row on a floor, held against a wall by two hands on a cube that is measured as a whole. */
static contact_world *begin_row(double reuse)
{
  contact_world *w = cw_new(CW_GRAVITY);
  dWorldSetContactSurfaceLayer(w->world, LAYER);
  w->def.physics_hz = 50.0;
  w->expert.reuse = reuse;
  (void)cw_add_floor(w);
  (void)dCreatePlane(w->space, -1.0, 0.0, 0.0, -(3.5 * EDGE - 4.0 * OVERLAP));
  for (int i = 0; i < 4; ++i) {
    (void)cw_add_cube(w, 0.5, EDGE, (EDGE - OVERLAP) * i, 0.0, 0.5 * EDGE - OVERLAP);
  }
  add_unknown_shape(w->space, w->bodies[0]);
  cw_start(w, -0.5 * EDGE - w->hand_def.radius, 0.01, 0.5 * EDGE);
  hap_pointer_id other;
  const hap_pose pose = {{-0.5 * EDGE - w->hand_def.radius + 1e-3, -0.01, 0.5 * EDGE},
                         {1.0, 0.0, 0.0, 0.0}};
  REQUIRE(hap_pointer_add(w->session, &w->hand_def, &other) == HAP_OK);
  REQUIRE(hap_pointer_set_target(w->session, other, &pose, NULL) == HAP_OK);
  cw_go(w, 0.04, 0.0, 0.0, 100);
  cw_go(w, 0.0, 0.0, 0.0, SETTLE_STEPS * STEP_TICKS);
  return w;
}

/* Bodies that the loop moves with this flag. */
static int count_roles(const contact_world *w, uint32_t flag)
{
  const hapi_physics *physics = w->session->physics;
  int count = 0;
  for (uint32_t i = 0; i < physics->near.slots.body_high; ++i) {
    const hapi_body_slot *slot = &physics->near.slots.bodies[i];
    count += slot->phase == HAPI_SLOT_LIVE && (slot->flags & flag) != 0;
  }
  return count;
}

TEST(a_measured_body_that_rests_is_measured_once)
{
  contact_world *w = begin_row(1e-6);
  contact_world *reference = begin_row(0.0);
  REQUIRE(w != NULL && reference != NULL);
  uint64_t made = probes_of(w, 10);
  uint64_t all = probes_of(reference, 10);
  printf("# %d testing simulations of %d\n", (int)made, (int)all);
  CHECK(all >= 10 * 7 && made <= 10);
  CHECK(fabs(reference->force[0]) > 2.0);
  CHECK_NEAR(w->force[0], reference->force[0], 1e-3 * fabs(reference->force[0]));
  CHECK(count_roles(w, HAPI_BODY_MEASURED) > 0);
  CHECK(count_roles(w, HAPI_BODY_MEASURED) == count_roles(w, HAPI_BODY_WHOLE));
  dMass m;
  dMassSetBoxTotal(&m, 0.6, EDGE, EDGE, EDGE);
  dBodySetMass(w->bodies[2], &m);
  CHECK(probes_of(w, 1) >= 7);
}
