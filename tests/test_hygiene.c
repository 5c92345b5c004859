/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Numbers that are none, at every border between the application and the library: what comes in is
 * refused or kept out and said, and nothing of it comes out again. ODE would end the process. */

#include "tests/tap.h"

#include <float.h>

#include "tests/physics_world.h"
#include "tests/solids.h"

#define EDGE 0.1
#define RADIUS 0.01
#define COUNT(array) (sizeof(array) / sizeof(array)[0])

static const double no_number = (double)NAN;
static const double too_far = (double)INFINITY;

static bool all_finite(const test_world *w)
{
  bool good = true;
  for (int i = 0; i < w->body_count; ++i) {
    hap_pose pose;
    good = good && hap_session_poses(w->session, hap_session_now(w->session), &w->bodies[i], 1,
                                     &pose) >= HAP_OK;
    good = good && hapi_finite(pose.position, 3) && hapi_finite(pose.quat_wxyz, 4);
  }
  for (int i = 0; i < w->pointer_count; ++i) {
    hap_pointer_state s;
    good = good && hap_pointer_get(w->session, w->pointers[i], &s, sizeof s) == HAP_OK;
    good = good && hapi_finite(s.device.position, 3) && hapi_finite(s.proxy.position, 3) &&
           hapi_finite(s.twist.linear, 3) && hapi_finite(s.wrench.force, 3) &&
           hapi_finite(s.wrench.torque, 3);
  }
  hap_trace_row row;
  size_t got = 0;
  while (hap_session_trace_read(w->session, &row, 1, sizeof(hap_trace_row), &got) == HAP_OK) {
    good =
        good && hapi_finite(row.pointers[0].position, 3) && hapi_finite(row.pointers[0].force, 3);
    for (uint32_t i = 0; i < row.body_count; ++i) {
      good = good && hapi_finite(row.body_position[i], 3);
    }
  }
  hap_stats stats = world_stats(w);
  return good && isfinite(stats.hand.impulse_ns) && isfinite(stats.hand.peak_force_n) &&
         isfinite(stats.hand.momentum_error_ns);
}

/* A cube that is touched, on a hinge to another one, and a static box. The session is made, not
 * started. */
typedef struct scene_of_things {
  test_world w;
  dJointID hinge;
  dGeomID block;
} things;

static void open_things(things *t, hap_model model)
{
  world_open(&t->w, 9.81, 20);
  t->w.def.model = model;
  t->w.expert.trace_rows = 4096;
  (void)world_add_cube(&t->w, EDGE, 1.0, EDGE / 2, 0.0, EDGE / 2);
  (void)world_add_cube(&t->w, EDGE, 1.0, 2.0, 0.0, EDGE / 2);
  (void)world_add_cube(&t->w, EDGE, 1.0, 2.0 + 1.5 * EDGE, 0.0, EDGE / 2);
  t->hinge = dJointCreateHinge(t->w.world, NULL);
  dJointAttach(t->hinge, t->w.bodies[1], t->w.bodies[2]);
  dJointSetHingeAnchor(t->hinge, 2.0 + EDGE, 0.0, EDGE / 2);
  dJointSetHingeAxis(t->hinge, 0.0, 0.0, 1.0);
  dCreatePlane(t->w.space, 0.0, 0.0, 1.0, 0.0);
  t->block = dCreateBox(t->w.space, 1.0, 1.0, 1.0);
  dGeomSetPosition(t->block, 0.0, 3.0, 0.5);
  world_create_session(&t->w, NULL);
  world_add_pointer(&t->w, RADIUS, -RADIUS + 0.002, 0.0, EDGE / 2);
  REQUIRE(hap_session_trace_bodies(t->w.session, t->w.bodies, 3) == HAP_OK);
}

/* ---- what the application does to its world ---- */

typedef struct damage {
  const char *name;
  void (*act)(things *t, double bad);
  const char *said; /* in the detail text */
  int kinds;        /* of bad_numbers, a bit each: others are legal, or ODE itself refuses them */
} damage;

static void gravity_set(things *t, double bad)
{
  dWorldSetGravity(t->w.world, 0.0, bad, 0.0);
}
static void erp_set(things *t, double bad)
{
  dWorldSetERP(t->w.world, bad);
}
static void cfm_set(things *t, double bad)
{
  dWorldSetCFM(t->w.world, bad);
}
static void layer_set(things *t, double bad)
{
  dWorldSetContactSurfaceLayer(t->w.world, bad);
}
static void position_set(things *t, double bad)
{
  dBodySetPosition(t->w.bodies[0], 0.0, bad, 0.0);
}
static void velocity_set(things *t, double bad)
{
  dBodySetLinearVel(t->w.bodies[1], bad, 0.0, 0.0);
}
static void spin_set(things *t, double bad)
{
  dBodySetAngularVel(t->w.bodies[0], bad, 0.0, 0.0);
}
static void force_set(things *t, double bad)
{
  dBodyAddForce(t->w.bodies[2], 0.0, 0.0, bad);
}
static void torque_set(things *t, double bad)
{
  dBodyAddTorque(t->w.bodies[0], 0.0, bad, 0.0);
}
static void damping_set(things *t, double bad)
{
  dBodySetAngularDamping(t->w.bodies[0], bad);
}
static void mass_set(things *t, double bad)
{
  dMass m;
  dBodyGetMass(t->w.bodies[0], &m);
  m.mass = bad;
  dBodySetMass(t->w.bodies[0], &m);
}
static void inertia_set(things *t, double bad)
{
  dMass m;
  dBodyGetMass(t->w.bodies[0], &m);
  m.I[0] = bad;
  dBodySetMass(t->w.bodies[0], &m);
}
static void inertia_product(things *t, double bad)
{
  dMass m;
  dBodyGetMass(t->w.bodies[0], &m);
  m.I[1] = m.I[4] = bad;
  dBodySetMass(t->w.bodies[0], &m);
}
static void anchor_set(things *t, double bad)
{
  dJointSetHingeAnchor(t->hinge, bad, 0.0, 0.0);
}
static void motor_set(things *t, double bad)
{
  dJointSetHingeParam(t->hinge, dParamFMax, 1.0);
  dJointSetHingeParam(t->hinge, dParamVel, bad);
}
static void stop_set(things *t, double bad)
{
  dJointSetHingeParam(t->hinge, dParamLoStop, bad);
}
static void stop_softness(things *t, double bad)
{
  dJointSetHingeParam(t->hinge, dParamStopCFM, bad);
}
static void block_place(things *t, double bad)
{
  dGeomSetPosition(t->block, bad, 3.0, 0.5);
}

static const damage damages[] = {
    {"gravity", gravity_set, "gravity", 1 | 2 | 4},
    {"erp", erp_set, "ERP", 1 | 2 | 4},
    {"cfm", cfm_set, "CFM", 1 | 2 | 4},
    {"layer", layer_set, "layer", 1 | 2 | 4},
    {"position", position_set, "position", 1 | 2 | 4},
    {"velocity", velocity_set, "velocity", 1 | 2 | 4},
    {"spin", spin_set, "velocity", 1 | 2 | 4},
    {"force", force_set, "force", 1 | 2 | 4},
    {"torque", torque_set, "torque", 1 | 2 | 4},
    {"damping", damping_set, "damping", 1 | 2 | 4},
    {"mass", mass_set, "mass", 2 | 8},
    {"inertia", inertia_set, "inertia", 1},
    {"product of inertia", inertia_product, "inertia", 1},
    {"joint anchor", anchor_set, "joint", 1 | 2 | 4},
    {"joint motor", motor_set, "joint", 1 | 2 | 4},
    {"joint stop", stop_set, "joint", 1 | 2},
    {"joint softness", stop_softness, "joint", 1 | 2 | 4},
    {"geom place", block_place, "geom", 1},
};

static const double bad_numbers[] = {(double)NAN, 1e300, -(double)INFINITY, DBL_TRUE_MIN};

static void check_damage(const damage *d, double bad, hap_model model, bool running)
{
  things t;
  hap_detail detail = {""};
  int failures = tap_failures;
  open_things(&t, model);
  CHECK(running || (d->act(&t, bad), true));
  hap_status status = hap_session_start(t.w.session);
  if (running) {
    CHECK(status == HAP_OK && hap_session_advance(t.w.session, 60) == HAP_OK);
    d->act(&t, bad); /* lockstep: between two calls the world is the application's */
    CHECK(hap_session_advance(t.w.session, 110) == HAP_FAULTED);
    CHECK(world_stats(&t.w).faults.fault == HAP_FAULT_WORLD);
    CHECK(all_finite(&t.w));
  } else {
    CHECK(status == HAP_ERROR_WORLD);
  }
  CHECK(hap_session_detail(t.w.session, &detail) == HAP_OK);
  bool said = strstr(detail.text, d->said) != NULL && strstr(detail.text, "set it right") != NULL;
  CHECK(said);
  if (tap_failures > failures) {
    printf("# %s = %g, model %s, %s: \"%s\"\n", d->name, bad, hap_model_name(model),
           running ? "running" : "at start", detail.text);
  }
  world_close(&t.w);
}

/* While it runs in two of the four models each: all numbers and all models of every damage. */
TEST(nothing_that_is_no_number_reaches_the_world)
{
  for (size_t i = 0; i < COUNT(damages); ++i) {
    for (size_t k = 0; k < COUNT(bad_numbers); ++k) {
      if ((damages[i].kinds & (1 << k)) == 0) {
        continue;
      }
      check_damage(&damages[i], bad_numbers[k], HAP_MODEL_ACCELERANCE, false);
      for (int model = (int)(i + k) % 2; model <= HAP_MODEL_CONTACT; model += 2) {
        check_damage(&damages[i], bad_numbers[k], (hap_model)model, true);
      }
    }
  }
}

TEST(a_geom_at_no_place_of_its_body_is_said)
{
  things t;
  hap_detail detail;
  open_things(&t, HAP_MODEL_CONTACT);
  session_run(t.w.session);
  dGeomSetOffsetPosition(dBodyGetFirstGeom(t.w.bodies[2]), no_number, 0.0, 0.0);
  CHECK(hap_session_advance(t.w.session, 110) == HAP_FAULTED);
  CHECK(hap_session_detail(t.w.session, &detail) == HAP_OK);
  CHECK(strstr(detail.text, "geom") != NULL && all_finite(&t.w));
  world_close(&t.w);
}

/* A running total would keep it for good, also when the world has been set right. */
TEST(a_velocity_that_a_step_made_is_in_no_residual)
{
  things t;
  open_things(&t, HAP_MODEL_ACCELERANCE);
  session_run(t.w.session);
  CHECK(hap_session_advance(t.w.session, 120) == HAP_OK);
  hapi_physics *physics = world_physics(&t.w);
  const hapi_slot_account *account = world_account(&t.w, t.w.bodies[0]);
  REQUIRE(account != NULL);
  dBodySetLinearVel(t.w.bodies[0], no_number, 0.0, 0.0);
  physics->cycle.has_new_state = true;
  hapi_reconcile_residual(&physics->account);
  CHECK(hapi_finite(account->residual, 6));
  dBodySetLinearVel(t.w.bodies[0], 0.0, 0.0, 0.0);
  world_close(&t.w);
}

/* One without geom and joint, which only adoption makes known. */
TEST(an_adopted_body_is_looked_at_too)
{
  things t;
  open_things(&t, HAP_MODEL_ACCELERANCE);
  dBodyID alone = dBodyCreate(t.w.world);
  CHECK(hap_session_adopt_body(t.w.session, alone) == HAP_OK);
  REQUIRE(hap_session_start(t.w.session) == HAP_OK);
  CHECK(hap_session_advance(t.w.session, 60) == HAP_OK);
  dBodySetAngularVel(alone, 0.0, no_number, 0.0);
  CHECK(hap_session_advance(t.w.session, 60) == HAP_FAULTED);
  CHECK(world_stats(&t.w).faults.fault == HAP_FAULT_WORLD && all_finite(&t.w));
  dBodySetAngularVel(alone, 0.0, 0.0, 0.0);
  world_close(&t.w);
}

/* What is set right goes on; nothing of what was wrong is left anywhere. */
TEST(a_world_that_was_set_right_goes_on)
{
  things t;
  open_things(&t, HAP_MODEL_ACCELERANCE);
  session_run(t.w.session);
  CHECK(hap_session_advance(t.w.session, 60) == HAP_OK);
  gravity_set(&t, no_number);
  CHECK(hap_session_advance(t.w.session, 60) == HAP_FAULTED);
  dWorldSetGravity(t.w.world, 0.0, 0.0, -9.81);
  CHECK(hap_session_advance(t.w.session, 60) == HAP_FAULTED); /* until it is reset */
  CHECK(hap_session_reset_fault(t.w.session) == HAP_OK);
  CHECK(hap_session_advance(t.w.session, 200) == HAP_OK);
  CHECK(all_finite(&t.w) && world_stats(&t.w).loop.contact_ticks > 100);
  CHECK_NEAR(dBodyGetPosition(t.w.bodies[1])[2], EDGE / 2, 0.1 * EDGE);
  world_close(&t.w);
}

/* ---- surfaces ---- */

typedef struct bad_surface {
  int bit;
  size_t offset;
  double value;
} bad_surface;

#define SURFACE(bit, field, value)                  \
  {                                                 \
    bit, offsetof(dSurfaceParameters, field), value \
  }

static const bad_surface bad_surfaces[] = {
    SURFACE(0, mu, (double)NAN),
    SURFACE(0, mu, -1.0),
    SURFACE(dContactMu2, mu2, (double)NAN),
    SURFACE(dContactRolling, rho, (double)NAN),
    SURFACE(dContactRolling, rho2, (double)NAN),
    SURFACE(dContactRolling, rhoN, (double)NAN),
    SURFACE(dContactBounce, bounce, (double)NAN),
    SURFACE(dContactBounce, bounce, 1e300),
    SURFACE(dContactBounce, bounce_vel, (double)INFINITY),
    SURFACE(dContactSoftERP, soft_erp, (double)NAN),
    SURFACE(dContactSoftERP, soft_erp, 1e300),
    SURFACE(dContactSoftCFM, soft_cfm, (double)INFINITY),
    SURFACE(dContactSoftCFM, soft_cfm, -1.0),
    SURFACE(dContactMotion1, motion1, (double)NAN),
    SURFACE(dContactMotion2, motion2, -1e300),
    SURFACE(dContactMotionN, motionN, (double)NAN),
    SURFACE(dContactSlip1, slip1, (double)NAN),
    SURFACE(dContactSlip2, slip2, -1.0),
};

static const bad_surface *surface_now;

static bool give_surface(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  (void)user;
  (void)a;
  (void)b;
  io->mode |= surface_now->bit;
  memcpy((char *)io + surface_now->offset, &surface_now->value, sizeof surface_now->value);
  return true;
}

TEST(no_surface_that_is_no_number_reaches_a_contact)
{
  for (size_t i = 0; i < COUNT(bad_surfaces); ++i) {
    for (int model = 0; model <= HAP_MODEL_CONTACT; ++model) {
      hap_detail detail;
      surface_now = &bad_surfaces[i];
      test_world *w = world_new(9.81, 20);
      w->def.model = (hap_model)model;
      (void)world_add_cube(w, EDGE, 1.0, EDGE / 2, 0.0, EDGE / 2);
      dCreatePlane(w->space, 0.0, 0.0, 1.0, 0.0);
      world_create_session(w, give_surface);
      world_add_pointer(w, RADIUS, -RADIUS + 0.002, 0.0, EDGE / 2);
      REQUIRE(hap_session_start(w->session) == HAP_OK);
      CHECK(hap_session_advance(w->session, 200) == HAP_FAULTED);
      CHECK(hap_session_detail(w->session, &detail) == HAP_OK);
      CHECK(strstr(detail.text, "surface") != NULL && all_finite(w));
      world_close(w);
    }
  }
}

/* ---- what a collider finds ---- */

/* A geom class of the application's, whose collider finds a contact of no depth. */
static int collide_with_nothing(dGeomID a, dGeomID b, int flags, dContactGeom *out, int skip)
{
  (void)flags;
  (void)skip;
  *out = (dContactGeom){.normal = {0.0, 0.0, 1.0}, .depth = no_number, .g1 = a, .g2 = b};
  return 1;
}

static dColliderFn *collider_of(int other)
{
  (void)other;
  return collide_with_nothing;
}

static void box_of_nothing(dGeomID geom, dReal box[6])
{
  (void)geom;
  for (int k = 0; k < 6; ++k) {
    box[k] = k % 2 == 0 ? -10.0 : 10.0;
  }
}

TEST(a_contact_that_is_no_number_is_dropped_and_counted)
{
  dContactGeom contact = {.pos = {1.0, 2.0, 3.0}, .normal = {0.0, 0.0, 1.0}, .depth = 0.01};
  CHECK(hapi_contact_is_sound(&contact));
  dReal *places[] = {&contact.pos[0],    &contact.pos[2],    &contact.normal[0],
                     &contact.normal[1], &contact.normal[2], &contact.depth};
  const double bad[] = {no_number, too_far, 1e300};
  for (size_t i = 0; i < COUNT(places); ++i) {
    for (size_t k = 0; k < COUNT(bad); ++k) {
      double before = *places[i];
      *places[i] = bad[k];
      CHECK(!hapi_contact_is_sound(&contact));
      *places[i] = before;
    }
  }
  test_world *w = world_new(9.81, 20);
  (void)world_add_cube(w, EDGE, 1.0, 0.0, 0.0, 0.04);
  dGeomClass class = {.bytes = 8, .collider = collider_of, .aabb = box_of_nothing};
  dSpaceAdd(w->space, dCreateGeom(dCreateGeomClass(&class)));
  world_start(w, RADIUS, -0.3, 0.0, 0.05);
  CHECK(hap_session_advance(w->session, 500) >= HAP_OK); /* as if nothing were there */
  CHECK(world_stats(w).faults.contacts_rejected >= 9);
  CHECK(all_finite(w) && dBodyGetPosition(w->bodies[0])[2] < -0.5);
}

/* Where a convex geom and a box just touch, ODE's collider gives the normal (0, 0, 0). */
TEST(a_contact_without_a_normal_is_dropped_and_counted)
{
  static box_arrays box;
  for (int model = 0; model <= HAP_MODEL_CONTACT; ++model) {
    dMass mass;
    test_world *w = world_new(0.0, 20);
    w->def.model = (hap_model)model;
    dMassSetBoxTotal(&mass, 1.0, 0.1, 0.1, 0.1);
    (void)world_add(w, convex_box(w->space, &box, AT(0.05, 0.05, 0.05)), &mass, 0.0, 0.0, 0.0);
    (void)world_add(w, dCreateBox(w->space, 0.1, 0.1, 0.1), &mass, -0.1, 0.01, 0.075);
    world_start(w, RADIUS, 5.0, 0.0, 0.0);
    CHECK(hap_session_advance(w->session, 200) == HAP_OK);
    CHECK(world_stats(w).faults.contacts_rejected > 0 && all_finite(w));
    world_close(w);
  }
}

/* ---- pointers ---- */

TEST(targets_beyond_the_world_change_nothing)
{
  test_world *w = world_new(0.0, 20);
  (void)world_add_cube(w, EDGE, 1.0, EDGE / 2, 0.0, 0.0);
  world_start(w, RADIUS, -0.5, 0.0, 0.0);
  CHECK(hap_session_advance(w->session, 2) == HAP_OK);
  const double bad[] = {no_number, too_far, 1e300, -1e7, DBL_MAX};
  for (size_t i = 0; i < COUNT(bad); ++i) {
    hap_detail detail;
    hap_pose pose = {{0.0, bad[i], 0.0}, {1.0, 0.0, 0.0, 0.0}};
    CHECK(hap_pointer_set_target(w->session, w->pointers[0], &pose, NULL) == HAP_ERROR_ARGUMENT);
    CHECK(hap_session_detail(w->session, &detail) == HAP_OK && strstr(detail.text, "position"));
    pose.position[1] = 0.0;
    hap_twist twist = {{0.0, 0.0, 0.0}, {0.0, 0.0, bad[i]}};
    CHECK(hap_pointer_set_target(w->session, w->pointers[0], &pose, &twist) == HAP_ERROR_ARGUMENT);
    CHECK(hap_session_detail(w->session, &detail) == HAP_OK && strstr(detail.text, "twist"));
  }
  CHECK(hap_session_advance(w->session, 10) == HAP_OK);
  hap_pointer_state state;
  CHECK(hap_pointer_get(w->session, w->pointers[0], &state, sizeof state) == HAP_OK);
  CHECK(state.proxy.position[0] == -0.5 && state.device.position[0] == -0.5);
}

/* A target that is good in its own frame, and that frame and scale take out of the world. */
TEST(a_pointer_out_of_the_world_stays_where_it_was)
{
  test_world *w = world_new(0.0, 20);
  world_create_session(w, NULL);
  hap_pointer_def def;
  hap_pointer_def_init(&def, sizeof def);
  def.motion_scale = 1e6;
  CHECK(hap_pointer_add(w->session, &def, &w->pointers[0]) == HAP_OK);
  w->pointer_count = 1;
  world_move_pointer(w, 0, (const double[3]){1e-6, 0.0, 0.0}, NULL);
  REQUIRE(hap_session_start(w->session) == HAP_OK);
  CHECK(hap_session_advance(w->session, 2) == HAP_OK);
  world_move_pointer(w, 0, (const double[3]){1e5, 0.0, 0.0}, NULL);
  CHECK(hap_session_advance(w->session, 2) == HAP_FAULTED);
  CHECK(world_stats(w).faults.fault == HAP_FAULT_DEVICE_POSE);
  hap_pointer_state state;
  CHECK(hap_pointer_get(w->session, w->pointers[0], &state, sizeof state) == HAP_OK);
  CHECK_NEAR(state.proxy.position[0], 1.0, 1e-15);
  CHECK_NEAR(state.device.position[0], 1e-6, 0.0);
}

TEST(long_frame_times_are_one_call_long_and_no_frame_times_are_refused)
{
  test_world *w = world_new(0.0, 20);
  w->def.drive = HAP_DRIVE_FRAME;
  w->def.rt_priority = 0;
  world_create_session(w, NULL);
  session_run(w->session);
  for (int i = 0; i < 40; ++i) {
    CHECK(hap_session_update(w->session, 86400.0 / (1 << i % 12)) == HAP_DROPPED);
    CHECK(hap_session_update(w->session, 0.0) == HAP_OK); /* and not dropped again and again */
    CHECK(hap_session_update(w->session, 1.7e5 * pow(1.5, 40.0 * i)) == HAP_ERROR_ARGUMENT);
  }
  CHECK(hap_session_update(w->session, DBL_TRUE_MIN) == HAP_OK);
  CHECK(hap_session_update(w->session, 0.051) == HAP_OK);
  CHECK(world_stats(w).physics.steps == 121);
  CHECK(hap_session_stop(w->session) == HAP_OK);
}
