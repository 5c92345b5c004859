/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The application decides about each contact: platforms with one side, belts, worlds with a near
 * callback of their own. Forces are held against plain ODE loops that know nothing of the library.
 */

#include "tests/tap.h"

#include <stdatomic.h>

#include "tests/desk.h"

#define G 9.81
#define PLAIN_PARTS 4 /* steps of a plain loop in a tick */
#define PLAIN_T (T / PLAIN_PARTS)
#define LAYER 1e-4
#define DAMPING 5.0 /* N s/m */

static int body_tag;
static int platform_tag;
static int belt_tag;

/* ---- what the application says ---- */

/* A platform that lets through what comes from below. */
static bool platform_holds(const double up[3], const double velocity[3], double depth)
{
  return up[2] > 0.7 && depth < 0.005 && velocity[2] < 0.01;
}

static bool one_way(void *user, hap_contact *io)
{
  (void)user;
  bool a_is_platform = io->data_a == &platform_tag;
  if (!a_is_platform && io->data_b != &platform_tag) {
    return true;
  }
  double sign = a_is_platform ? -1.0 : 1.0;
  const double up[3] = {sign * io->normal[0], sign * io->normal[1], sign * io->normal[2]};
  const double velocity[3] = {0.0, 0.0, sign * io->velocity[2]};
  return platform_holds(up, velocity, io->depth);
}

#define BELT_MU 0.4
#define BELT_SPEED 0.3 /* m/s, of the belt's surface along x where x is below 0 */

/* ODE's motion is that of a along the direction, seen from b. */
static bool belt_runs(void *user, hap_contact *io)
{
  (void)user;
  bool a_is_belt = io->data_a == &belt_tag;
  if (a_is_belt || io->data_b == &belt_tag) {
    io->surface.mode |= dContactFDir1 | dContactMotion1;
    io->surface.mu = BELT_MU;
    io->surface.motion1 = (a_is_belt ? -1.0 : 1.0) * (io->point[0] < 0.0 ? BELT_SPEED : 0.0);
    memcpy(io->direction, AT(1.0, 0.0, 0.0), sizeof io->direction);
  }
  return true;
}

/* ---- plain loops ---- */

typedef struct plain_world {
  dWorldID world;
  dSpaceID space;
  dJointGroupID contacts;
  hap_contact_fn says;
} plain_world;

/* Springs and dampers of contacts are those of a step of H. */
static void plain_convert(double ratio, double *io_erp, double *io_cfm)
{
  double part = ratio * *io_erp + 1.0 - *io_erp;
  *io_erp *= ratio / part;
  *io_cfm /= part;
}

static void plain_begin(plain_world *p)
{
  ode_world_make(G, &p->world, &p->space);
  ode_world_stiffen(p->world, 200);
  double erp = 0.2;
  double cfm = 1e-12;
  plain_convert(PLAIN_T * 60.0, &erp, &cfm);
  dWorldSetERP(p->world, erp);
  dWorldSetCFM(p->world, cfm);
  p->contacts = dJointGroupCreate(0);
}

static void plain_end(plain_world *p)
{
  dJointGroupDestroy(p->contacts);
  ode_world_end(NULL, p->world, p->space);
}

static void point_velocity(dGeomID geom, const double at[3], double out[3])
{
  dVector3 v = {0.0, 0.0, 0.0, 0.0};
  if (dGeomGetBody(geom) != NULL) {
    dBodyGetPointVel(dGeomGetBody(geom), at[0], at[1], at[2], v);
  }
  memcpy(out, v, 3 * sizeof *out);
}

/* The classic near callback. */
static void plain_near(void *data, dGeomID a, dGeomID b)
{
  plain_world *p = data;
  dContact contacts[8];
  if (dGeomGetBody(a) == NULL && dGeomGetBody(b) == NULL) {
    return;
  }
  int count = dCollide(a, b, 8, &contacts[0].geom, sizeof contacts[0]);
  for (int i = 0; i < count; ++i) {
    dContact *c = &contacts[i];
    hap_contact asked = {.data_a = dGeomGetData(a), .data_b = dGeomGetData(b)};
    double of_b[3];
    asked.depth = c->geom.depth;
    asked.surface = (dSurfaceParameters){.mode = dContactApprox1, .mu = 0.5};
    memcpy(asked.point, c->geom.pos, sizeof asked.point);
    memcpy(asked.normal, c->geom.normal, sizeof asked.normal);
    point_velocity(a, c->geom.pos, asked.velocity);
    point_velocity(b, c->geom.pos, of_b);
    for (int k = 0; k < 3; ++k) {
      asked.velocity[k] -= of_b[k];
    }
    if (p->says(NULL, &asked)) {
      c->surface = asked.surface;
      memcpy(c->fdir1, asked.direction, sizeof asked.direction);
      dJointID joint = dJointCreateContact(p->world, p->contacts, c);
      dJointAttach(joint, dGeomGetBody(a), dGeomGetBody(b));
    }
  }
}

static void plain_step(plain_world *p)
{
  dSpaceCollide(p->space, p, plain_near);
  dWorldQuickStep(p->world, PLAIN_T);
  dJointGroupEmpty(p->contacts);
}

static bool half_friction(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  (void)user;
  (void)a;
  (void)b;
  io->mu = 0.5;
  return true;
}

static desk *calls_desk(hap_model model, double physics_hz, hap_contact_fn says)
{
  desk *d = desk_new(G, model);
  d->def.physics_hz = physics_hz;
  d->ode.surface = half_friction;
  d->ode.contact = says;
  d->hand_def.damping = DAMPING;
  return d;
}

static double forces_differ(const double *a, const double *b, int count)
{
  double apart = 0.0;
  double all = 0.0;
  for (int i = 0; i < count; ++i) {
    apart += (a[i] - b[i]) * (a[i] - b[i]);
    all += b[i] * b[i];
  }
  return sqrt(apart / all);
}

/* ---- a platform with one side ---- */

#define LIFT_TICKS 2200
#define LIFTED 0.3 /* kg */
#define HALF 0.02  /* m, of the box */

/* From here to there, beginning and ending slowly. */
typedef struct glide {
  int begin;
  int end;
  double way; /* m */
} glide;

static void glides_at(const glide *glides, size_t count, int tick, double *io_at,
                      double *out_velocity)
{
  *out_velocity = 0.0;
  for (size_t i = 0; i < count; ++i) {
    const glide *g = &glides[i];
    double ticks = g->end - g->begin;
    double s = fmin(fmax((tick - g->begin) / ticks, 0.0), 1.0);
    *io_at += g->way * s * s * (3.0 - 2.0 * s);
    *out_velocity += g->way * 6.0 * s * (1.0 - s) / (ticks * T);
  }
}

/* m: the hand lifts the box through the platform, which is 4 mm thick, lays it down there and waits
 * below, lifts it again and lays it down. */
static void lift_hand(int tick, double *out_at, double *out_velocity)
{
  static const glide glides[] = {
      {100, 800, 0.140}, {900, 1200, -0.024}, {1300, 1600, 0.024}, {1700, 2000, -0.024}};
  *out_at = -0.10 - HALF - RADIUS - 2e-4;
  glides_at(glides, 4, tick, out_at, out_velocity);
}

static dBodyID lift_build(dWorldID world, dSpaceID space)
{
  dGeomID platform = dCreateBox(space, 0.4, 0.4, 0.004);
  dGeomSetPosition(platform, 0.0, 0.0, 0.002);
  dGeomSetData(platform, &platform_tag);
  dGeomSetCategoryBits(platform, 2);
  dWorldSetContactSurfaceLayer(world, LAYER);
  dBodyID box = ode_box(world, space, LIFTED, AT(2 * HALF, 2 * HALF, 2 * HALF), AT(0, 0, -0.10));
  dGeomID geom = dBodyGetFirstGeom(box);
  dGeomSetData(geom, &body_tag);
  dGeomSetCategoryBits(geom, 1);
  dJointID rail = dJointCreateSlider(world, NULL);
  dJointAttach(rail, box, NULL);
  dJointSetSliderAxis(rail, 0.0, 0.0, 1.0);
  dJointSetSliderParam(rail, dParamLoStop, -0.0005);
  dJointSetSliderParam(rail, dParamHiStop, dInfinity);
  return box;
}

static void lift_plain(double *force, double *height)
{
  plain_world p = {.says = one_way};
  plain_begin(&p);
  dBodyID box = lift_build(p.world, p.space);
  for (int i = 0; i < LIFT_TICKS; ++i) {
    double at;
    double velocity;
    lift_hand(i, &at, &velocity);
    for (int k = 0; k < PLAIN_PARTS; ++k) {
      double depth = at + RADIUS + velocity * PLAIN_T * k - (dBodyGetPosition(box)[2] - HALF);
      double rate = velocity - dBodyGetLinearVel(box)[2];
      double push = depth > 0.0 ? fmax(0.0, STIFFNESS * depth + DAMPING * rate) : 0.0;
      dBodyAddForce(box, 0.0, 0.0, push);
      plain_step(&p);
      force[i] = k == 0 ? push : force[i];
    }
    height[i] = dBodyGetPosition(box)[2];
  }
  plain_end(&p);
}

static void lift_felt(hap_model model, double physics_hz, double *force, double *height)
{
  desk *d = calls_desk(model, physics_hz, one_way);
  dBodyID box = lift_build(d->world, d->space);
  double velocity;
  d->hand_def.expert = NULL;
  d->hand_def.collide_bits = 1;
  lift_hand(0, &d->at[2], &velocity);
  desk_run(d, 0.0, 0.0, d->at[2]);
  for (int i = 0; i < LIFT_TICKS; ++i) {
    hap_pose pose;
    lift_hand(i, &d->at[2], &d->velocity[2]);
    hand_lead(d);
    REQUIRE(hap_session_advance(d->session, 1) >= HAP_OK);
    force[i] = -desk_state(d).wrench.force[2];
    REQUIRE(hap_session_poses_now(d->session, &box, 1, &pose) >= HAP_OK);
    height[i] = pose.position[2];
  }
}

typedef struct rate_row {
  const char *name;
  double physics_hz;
} rate_row;

static const rate_row lifts[] = {{"a_platform_with_one_side_at_60_hz", 60.0},
                                 {"a_platform_with_one_side_at_20_hz", 20.0}};

TEST_EACH(lifts, const rate_row *row)
{
  static double plain[LIFT_TICKS];
  static double felt[LIFT_TICKS];
  static double plain_height[LIFT_TICKS];
  static double height[LIFT_TICKS];
  lift_plain(plain, plain_height);
  lift_felt(HAP_MODEL_CONTACT, row->physics_hz, felt, height);
  double error = forces_differ(felt, plain, LIFT_TICKS);
  double apart = 0.0;
  for (int i = 0; i < LIFT_TICKS; ++i) {
    apart = fmax(apart, fabs(height[i] - plain_height[i]));
  }
  printf("# %.3f %% of a plain loop, %.3f mm\n", 100.0 * error, 1e3 * apart);
  CHECK(error < 0.01);
  CHECK(apart < 0.5e-3);
  CHECK_NEAR(height[1250], 0.004 + HALF, 0.3e-3); /* it lies on the platform */
}

/* ---- a belt ---- */

#define BELT_TICKS 2200
#define LOAD 0.5 /* kg */

static dBodyID belt_build(dWorldID world, dSpaceID space)
{
  dGeomID belt = dCreateBox(space, 1.0, 0.2, 0.02);
  dGeomSetPosition(belt, 0.0, 0.0, -0.01);
  dGeomSetData(belt, &belt_tag);
  dGeomSetCategoryBits(belt, 2);
  dWorldSetContactSurfaceLayer(world, LAYER);
  dBodyID box = ode_box(world, space, LOAD, AT(0.06, 0.06, 0.02), AT(-0.25, 0.0, 0.01 - LAYER));
  dGeomSetCategoryBits(dBodyGetFirstGeom(box), 1);
  return box;
}

/* m: stands in the way, and gives way. */
static void belt_hand(int tick, double *out_at, double *out_velocity)
{
  static const glide glides[] = {{700, 1200, 0.04}};
  *out_at = -0.2199 + RADIUS;
  glides_at(glides, 1, tick, out_at, out_velocity);
}

static void belt_plain(double *force)
{
  plain_world p = {.says = belt_runs};
  plain_begin(&p);
  dBodyID box = belt_build(p.world, p.space);
  for (int i = 0; i < BELT_TICKS; ++i) {
    double at;
    double velocity;
    belt_hand(i, &at, &velocity);
    for (int k = 0; k < PLAIN_PARTS; ++k) {
      double depth = dBodyGetPosition(box)[0] + 0.03 - (at + velocity * PLAIN_T * k - RADIUS);
      double rate = dBodyGetLinearVel(box)[0] - velocity;
      double push = depth > 0.0 ? fmax(0.0, STIFFNESS * depth + DAMPING * rate) : 0.0;
      dBodyAddForceAtPos(box, -push, 0.0, 0.0, at, 0.0, 0.01 - LAYER);
      plain_step(&p);
      force[i] = k == 0 ? push : force[i];
    }
  }
  plain_end(&p);
}

/* A direction may have any length. */
static bool belt_runs_long(void *user, hap_contact *io)
{
  (void)belt_runs(user, io);
  io->direction[0] *= 3.0;
  return true;
}

static void belt_felt(double physics_hz, double *force)
{
  desk *d = calls_desk(HAP_MODEL_CONTACT, physics_hz, belt_runs_long);
  (void)belt_build(d->world, d->space);
  d->hand_def.collide_bits = 1;
  belt_hand(0, &d->at[0], &d->velocity[0]);
  desk_run(d, d->at[0], 0.0, 0.01 - LAYER);
  for (int i = 0; i < BELT_TICKS; ++i) {
    belt_hand(i, &d->at[0], &d->velocity[0]);
    hand_lead(d);
    REQUIRE(hap_session_advance(d->session, 1) >= HAP_OK);
    force[i] = desk_state(d).wrench.force[0];
  }
}

static const rate_row belts[] = {{"a_belt_by_contact_at_60_hz", 60.0},
                                 {"a_belt_by_contact_at_20_hz", 20.0}};

TEST_EACH(belts, const rate_row *row)
{
  static double plain[BELT_TICKS];
  static double felt[BELT_TICKS];
  belt_plain(plain);
  belt_felt(row->physics_hz, felt);
  double error = forces_differ(felt, plain, BELT_TICKS);
  printf("# %.3f %% of a plain loop; held %.4f N\n", 100.0 * error, felt[2199]);
  CHECK(error < 0.01);
  CHECK_NEAR(felt[2199], BELT_MU * LOAD * G, 0.01 * BELT_MU * LOAD * G); /* sliding, closed form */
}

/* ---- what a near callback does, done by the library ---- */

#define PUSH_TICKS 800

static bool keep_all(void *user, hap_contact *io)
{
  (void)user;
  (void)io;
  return true;
}

static bool ice_slides(void *user, hap_contact *io)
{
  (void)user;
  io->surface.mode = dContactApprox1;
  io->surface.mu = 0.1;
  return true;
}

static dBodyID push_build(dWorldID world, dSpaceID space)
{
  (void)dCreatePlane(space, 0.0, 0.0, 1.0, 0.0);
  dWorldSetContactSurfaceLayer(world, LAYER);
  return ode_box(world, space, LOAD, AT(0.1, 0.1, 0.1), AT(0.0, 0.0, 0.05 - LAYER));
}

static void push_felt(hap_contact_fn says, double *force)
{
  desk *d = calls_desk(HAP_MODEL_CONTACT, 60.0, says);
  dBodyID box = push_build(d->world, d->space);
  hap_body_role role = HAP_ROLE_WORLD;
  d->velocity[0] = 0.04;
  /* Touches in the midst of a tick, not at its end, where rounding would decide. */
  desk_run(d, -0.05 - RADIUS - 0.00202, 0.0, 0.05 - LAYER);
  for (int i = 0; i < PUSH_TICKS; ++i) {
    d->at[0] += T * d->velocity[0];
    hand_lead(d);
    REQUIRE(hap_session_advance(d->session, 1) >= HAP_OK);
    force[i] = -desk_state(d).wrench.force[0];
  }
  REQUIRE(hap_session_roles(d->session, &box, 1, &role) >= HAP_OK);
  CHECK(role == HAP_ROLE_LOOP || role == HAP_ROLE_RESTING);
}

TEST(own_contacts_are_the_loops_and_exact)
{
  static double plain[PUSH_TICKS];
  static double felt[PUSH_TICKS];
  plain_world p = {.says = ice_slides};
  plain_begin(&p);
  dBodyID box = push_build(p.world, p.space);
  double at = -0.05 - RADIUS - 0.00202;
  for (int i = 0; i < PUSH_TICKS; ++i) {
    for (int k = 0; k < PLAIN_PARTS; ++k) {
      at += PLAIN_T * 0.04;
      double depth = at + RADIUS - (dBodyGetPosition(box)[0] - 0.05);
      double rate = 0.04 - dBodyGetLinearVel(box)[0];
      plain[i] = depth > 0.0 ? fmax(0.0, STIFFNESS * depth + DAMPING * rate) : 0.0;
      dBodyAddForceAtPos(box, plain[i], 0.0, 0.0, at, 0.0, 0.05 - LAYER);
      plain_step(&p);
    }
  }
  plain_end(&p);
  push_felt(ice_slides, felt);
  double error = forces_differ(felt, plain, PUSH_TICKS);
  printf("# %.3f %% of a plain loop\n", 100.0 * error);
  CHECK(error < 0.01);
}

/* A callback with which all forces are the same. */
static void push_compare(bool (*contact)(void *user, hap_contact *io))
{
  static double without[PUSH_TICKS];
  static double with[PUSH_TICKS];
  push_felt(NULL, without);
  push_felt(contact, with);
  CHECK(memcmp(with, without, sizeof with) == 0);
}

TEST(a_callback_that_keeps_all_changes_nothing)
{
  push_compare(keep_all);
}

/* ---- all models, far from hands ---- */

static bool drop_all(void *user, hap_contact *io)
{
  (void)user;
  (void)io;
  return false;
}

TEST(contacts_are_dropped_in_all_models)
{
  for (int i = 0; i < 4; ++i) {
    for (int k = 0; k < 2; ++k) { /* the hand is far, or near */
      desk *d = calls_desk(all_models[i], 60.0, drop_all);
      dBodyID box = push_build(d->world, d->space);
      desk_run(d, k == 0 ? 5.0 : -0.05 - RADIUS - 0.003, 0.0, 0.05);
      desk_wait(d, 200);
      CHECK(dBodyGetPosition(box)[2] < -0.05);
      tap_release(d);
    }
  }
}

/* ---- what is told ---- */

typedef struct told_book {
  atomic_int in_loop;
  atomic_int in_step;
  atomic_int bad;
  double speed; /* m/s, that the body falls with; 0: any */
} told_book;

static bool told_note(void *user, hap_contact *io)
{
  told_book *book = user;
  atomic_fetch_add(io->in_loop != 0 ? &book->in_loop : &book->in_step, 1);
  double length = 0.0;
  for (int k = 0; k < 3; ++k) {
    length += io->normal[k] * io->normal[k];
  }
  bool a_is_body = io->data_a == &body_tag;
  double sign = a_is_body ? 1.0 : -1.0;
  bool good = io->size == sizeof *io && fabs(length - 1.0) < 1e-9 &&
              (a_is_body ? io->data_b == &platform_tag : io->data_a == &platform_tag) &&
              io->data_b != io->data_a && io->a != io->b && sign * io->normal[2] > 0.99 &&
              fabs(io->point[2]) < fabs(io->depth) + 1e-6 && fabs(io->point[0]) < 0.051 &&
              io->surface.mu == 0.5 && (io->surface.mode & dContactApprox1) != 0 &&
              (book->speed == 0.0 || fabs(sign * io->velocity[2] + book->speed) < 1e-6);
  atomic_fetch_add(&book->bad, !good);
  return true;
}

typedef enum thing {
  THING_BOX,
  THING_BALL,
  THING_CAPSULE,
  THING_CYLINDER,
  THING_ON_MESH
} thing;

/* Two triangles. */
static dGeomID mesh_floor(dSpaceID space)
{
  static const double corners[] = {-1.0, -1.0, 0.0, 1.0, -1.0, 0.0, 1.0, 1.0, 0.0, -1.0, 1.0, 0.0};
  static const uint32_t indices[] = {0, 1, 2, 0, 2, 3};
  dTriMeshDataID data = dGeomTriMeshDataCreate();
  dGeomTriMeshDataBuildDouble(data, corners, 3 * sizeof(double), 4, indices, 6,
                              3 * sizeof(uint32_t));
  return dCreateTriMesh(space, data, NULL, NULL, NULL);
}

static void told_shape(desk *d, dBodyID box, thing what)
{
  dGeomID geom = dBodyGetFirstGeom(box);
  if (what == THING_BOX || what == THING_ON_MESH) {
    return;
  }
  dGeomDestroy(geom);
  geom = what == THING_BALL      ? dCreateSphere(d->space, 0.05)
         : what == THING_CAPSULE ? dCreateCapsule(d->space, 0.05, 0.06)
                                 : dCreateCylinder(d->space, 0.05, 0.1);
  dGeomSetBody(geom, box);
  if (what == THING_CAPSULE) {
    dMatrix3 along_y;
    dRFromAxisAndAngle(along_y, 1.0, 0.0, 0.0, 0.5 * M_PI);
    dBodySetRotation(box, along_y);
  }
}

static dBodyID told_build(desk *d, thing what)
{
  dGeomID ground =
      what == THING_ON_MESH ? mesh_floor(d->space) : dCreatePlane(d->space, 0.0, 0.0, 1.0, 0.0);
  dGeomSetData(ground, &platform_tag);
  dBodyID box = ode_box(d->world, d->space, LOAD, AT(0.1, 0.1, 0.1), AT(0.0, 0.0, 0.05 - LAYER));
  told_shape(d, box, what);
  dGeomSetData(dBodyGetFirstGeom(box), &body_tag);
  return box;
}

typedef struct told_row {
  const char *name;
  thing what;
} told_row;

static const told_row told_rows[] = {
    {"a_box_is_told_to_the_step_and_to_the_passes_alike", THING_BOX},
    {"a_ball_is_told_to_the_step_and_to_the_passes_alike", THING_BALL},
    {"a_capsule_is_told_to_the_step_and_to_the_passes_alike", THING_CAPSULE},
    {"a_cylinder_is_told_to_the_step_and_to_the_passes_alike", THING_CYLINDER},
    {"a_box_on_a_mesh_is_told_to_the_step_and_to_the_passes_alike", THING_ON_MESH}};

TEST_EACH(told_rows, const told_row *row)
{
  told_book book = {0};
  desk *d = calls_desk(HAP_MODEL_CONTACT, 60.0, told_note);
  d->ode.user = &book;
  (void)told_build(d, row->what);
  desk_run(d, 0.0, 0.0, 5.0);
  desk_wait(d, 100);
  CHECK(atomic_load(&book.in_step) > 0);
  CHECK(atomic_load(&book.in_loop) == 0);
  desk_move(d, 0.0, 0.0, -4.891, 500);
  desk_wait(d, 100);
  CHECK(atomic_load(&book.in_loop) > 0);
  CHECK(atomic_load(&book.bad) == 0);
}

TEST(velocities_are_those_of_the_world_in_slow_motion)
{
  told_book book = {.speed = 0.4};
  desk *d = calls_desk(HAP_MODEL_CONTACT, 60.0, told_note);
  d->ode.user = &book;
  dBodyID box = told_build(d, THING_BOX);
  dWorldSetGravity(d->world, 0.0, 0.0, 0.0);
  dBodySetPosition(box, 0.0, 0.0, 0.06);
  dBodySetLinearVel(box, 0.0, 0.0, -0.4);
  d->session = session_make(&d->def, &d->ode);
  REQUIRE(hap_session_set_time_scale(d->session, 0.25) == HAP_OK);
  REQUIRE(hap_pointer_add(d->session, &d->hand_def, &d->hand) == HAP_OK);
  d->at[0] = -0.05 - RADIUS - 0.002;
  d->at[2] = 0.05;
  hand_lead(d);
  session_run(d->session);
  desk_wait(d, 80);
  CHECK(atomic_load(&book.in_loop) > 0);
  CHECK(atomic_load(&book.bad) == 0);
}

/* ---- two bodies that move and turn ---- */

#define DISC_X 0.02
#define DISC_Y 0.01
#define DISC_RADIUS 0.05
#define DISC_SPIN 3.0   /* rad/s, about z */
#define DISC_FALLS 0.02 /* m/s */
#define PLATE_SPEED 0.1 /* m/s, along x */

/* The plate's upper side is at 0, and nothing holds the disc. */
static bool moving_note(void *user, hap_contact *io)
{
  told_book *book = user;
  double sign = io->data_a == &body_tag ? 1.0 : -1.0;
  double x = io->point[0] - DISC_X;
  double y = io->point[1] - DISC_Y;
  bool good = fabs(sign * io->velocity[0] - (-DISC_SPIN * y - PLATE_SPEED)) < 1e-6 &&
              fabs(sign * io->velocity[1] - DISC_SPIN * x) < 1e-6 &&
              fabs(sign * io->velocity[2] + DISC_FALLS) < 1e-6;
  if (io->in_loop != 0) { /* half way between the sides, on the disc's rim */
    good = good && fabs(io->point[2] + 0.5 * io->depth) < 1e-9 &&
           fabs(sqrt(x * x + y * y) - DISC_RADIUS) < 1e-6;
  }
  atomic_fetch_add(io->in_loop != 0 ? &book->in_loop : &book->in_step, 1);
  atomic_fetch_add(&book->bad, !good);
  return false;
}

static void moving_build(desk *d)
{
  dMass mass;
  dBodyID plate = ode_box(d->world, d->space, 5.0, AT(1.0, 1.0, 0.1), AT(0.0, 0.0, -0.05));
  dBodySetLinearVel(plate, PLATE_SPEED, 0.0, 0.0);
  dGeomSetData(dBodyGetFirstGeom(plate), &platform_tag);
  dGeomID disc = dCreateCylinder(d->space, DISC_RADIUS, 0.1);
  dMassSetCylinderTotal(&mass, LOAD, 3, DISC_RADIUS, 0.1);
  dBodyID body = ode_body(d->world, disc, &mass, AT(DISC_X, DISC_Y, 0.05 + 0.003));
  dBodySetLinearVel(body, 0.0, 0.0, -DISC_FALLS);
  dBodySetAngularVel(body, 0.0, 0.0, DISC_SPIN);
  dGeomSetData(disc, &body_tag);
}

TEST(velocities_are_those_of_both_at_the_point)
{
  for (int near = 0; near < 2; ++near) {
    told_book book = {0};
    desk *d = calls_desk(HAP_MODEL_CONTACT, 60.0, moving_note);
    d->ode.user = &book;
    dWorldSetGravity(d->world, 0.0, 0.0, 0.0);
    moving_build(d);
    desk_run(d, near == 0 ? 5.0 : DISC_X + DISC_RADIUS + RADIUS + 0.003, DISC_Y, 0.05);
    desk_wait(d, 400);
    CHECK(atomic_load(near == 0 ? &book.in_step : &book.in_loop) > 20);
    CHECK(atomic_load(&book.bad) == 0);
    tap_release(d);
  }
}

/* ---- directions ---- */

static bool direction_say(void *user, dGeomID a, dGeomID b, double out[3])
{
  (void)user;
  (void)a;
  (void)b;
  memcpy(out, AT(3.0, 4.0, 0.0), 3 * sizeof *out);
  return true;
}

static bool direction_surface(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  (void)half_friction(user, a, b, io);
  io->mode |= dContactFDir1;
  return true;
}

static bool direction_note(void *user, hap_contact *io)
{
  told_book *book = user;
  bool good = (io->surface.mode & dContactFDir1) != 0 && fabs(io->direction[0] - 0.6) < 1e-9 &&
              fabs(io->direction[1] - 0.8) < 1e-9 && fabs(io->direction[2]) < 1e-9;
  atomic_fetch_add(io->in_loop != 0 ? &book->in_loop : &book->in_step, 1);
  atomic_fetch_add(&book->bad, !good);
  return true;
}

TEST(the_direction_of_the_pair_is_told)
{
  for (int near = 0; near < 2; ++near) {
    told_book book = {0};
    desk *d = calls_desk(HAP_MODEL_CONTACT, 60.0, direction_note);
    d->ode.user = &book;
    d->ode.surface = direction_surface;
    d->ode.friction_direction = direction_say;
    (void)push_build(d->world, d->space);
    desk_run(d, near == 0 ? 5.0 : -0.05 - RADIUS - 0.003, 0.0, 0.05);
    desk_wait(d, 100);
    CHECK(atomic_load(near == 0 ? &book.in_step : &book.in_loop) > 0);
    CHECK(atomic_load(&book.bad) == 0);
    tap_release(d);
  }
}

/* ---- surfaces of single contacts ---- */

static bool half_ice(void *user, hap_contact *io)
{
  (void)user;
  io->surface.mu = io->point[1] < 0.0 ? 0.4 : 0.0;
  return true;
}

/* The half that is pushed rubs, and has less load as the push is above the floor. A box that is
 * pushed from behind stands straight until something turns it: nothing may stay undone. */
TEST(two_surfaces_under_one_box)
{
  const double height = 0.02;
  desk *d = calls_desk(HAP_MODEL_CONTACT, 60.0, half_ice);
  d->def.accuracy = 1.0;
  (void)push_build(d->world, d->space);
  desk_run(d, 0.0, -0.05 - RADIUS - 0.001, height - LAYER);
  const double right = 0.4 * 0.5 * LOAD * G / (1.0 + 0.4 * height / 0.1);
  double felt = 0.0;
  desk_move(d, 0.0, 0.024, 0.0, 600); /* what swings at first dies down */
  for (int i = 0; i < 400; ++i) {
    desk_move(d, 0.0, 4e-5, 0.0, 1);
    felt -= desk_state(d).wrench.force[1] / 400.0;
  }
  printf("# %.4f N of %.4f\n", felt, right);
  CHECK_NEAR(felt, right, 0.01 * right);
}

/* The time of the world passes slower, and so does the belt. */
TEST(a_belt_in_slow_motion)
{
  desk *d = calls_desk(HAP_MODEL_CONTACT, 60.0, belt_runs);
  hap_pose poses[2];
  hap_body_role role = HAP_ROLE_WORLD;
  dBodyID box = belt_build(d->world, d->space);
  d->session = session_make(&d->def, &d->ode);
  REQUIRE(hap_session_set_time_scale(d->session, 0.25) == HAP_OK);
  REQUIRE(hap_pointer_add(d->session, &d->hand_def, &d->hand) == HAP_OK);
  d->at[0] = -0.25;
  d->at[2] = 0.02 + RADIUS + 0.003;
  hand_lead(d);
  session_run(d->session);
  desk_move(d, 0.05, 0.0, 0.0, 700);
  REQUIRE(hap_session_poses_now(d->session, &box, 1, &poses[0]) >= HAP_OK);
  desk_move(d, 0.0075, 0.0, 0.0, 100);
  REQUIRE(hap_session_poses_now(d->session, &box, 1, &poses[1]) >= HAP_OK);
  REQUIRE(hap_session_roles(d->session, &box, 1, &role) >= HAP_OK);
  CHECK(role == HAP_ROLE_LOOP || role == HAP_ROLE_RESTING);
  CHECK_NEAR(poses[1].position[0] - poses[0].position[0], 0.25 * BELT_SPEED * 0.1, 1e-4);
}

/* ---- wrong callbacks ---- */

static double wrong_values[] = {(double)NAN, -1.0};

static bool wrong_mu(void *user, hap_contact *io)
{
  io->surface.mu = *(const double *)user;
  return true;
}

static bool wrong_direction(void *user, hap_contact *io)
{
  io->surface.mode |= dContactFDir1;
  io->direction[1] = *(const double *)user;
  return true;
}

static bool wrong_softness(void *user, hap_contact *io)
{
  io->surface.mode |= dContactSoftCFM;
  io->surface.soft_cfm = *(const double *)user;
  return true;
}

static bool writes_what_is_read(void *user, hap_contact *io)
{
  (void)user;
  io->normal[0] = io->point[1] = io->depth = io->velocity[2] = (double)NAN;
  io->a = io->b = NULL;
  io->size = 0;
  io->direction[2] = (double)NAN; /* without dContactFDir1 nobody reads it */
  return true;
}

typedef struct wrong_row {
  const char *name;
  hap_contact_fn says;
  int value;
} wrong_row;

static const wrong_row wrongs[] = {{"a_friction_that_is_nan", wrong_mu, 0},
                                   {"a_friction_below_0", wrong_mu, 1},
                                   {"a_direction_that_is_nan", wrong_direction, 0},
                                   {"a_softness_below_0", wrong_softness, 1}};

TEST_EACH(wrongs, const wrong_row *row)
{
  for (int i = 0; i < 2; ++i) { /* the hand is far, or near */
    hap_detail detail = {""};
    desk *d = calls_desk(HAP_MODEL_CONTACT, 60.0, row->says);
    d->ode.user = &wrong_values[row->value];
    dBodyID box = push_build(d->world, d->space);
    desk_run(d, i == 0 ? 5.0 : -0.05 - RADIUS - 0.002, 0.0, 0.05);
    desk_wait(d, 300);
    CHECK(session_stats(d->session).faults.fault == HAP_FAULT_WORLD);
    (void)hap_session_detail(d->session, &detail);
    CHECK(strstr(detail.text, "contact callback") != NULL);
    CHECK_NEAR(dBodyGetPosition(box)[2], 0.05 - LAYER, 1e-4);
    tap_release(d);
  }
}

TEST(what_is_to_be_read_has_no_effect)
{
  push_compare(writes_what_is_read);
}

/* ---- recordings ---- */

/* A platform, a belt, and what is neither. */
static bool recorded_says(void *user, hap_contact *io)
{
  return one_way(user, io) && belt_runs(user, io);
}

static dBodyID far_box; /* on a belt that no hand reaches: ODE's */

static dBodyID recorded_world(desk *d)
{
  dGeomID belt = dCreateBox(d->space, 100.0, 0.2, 0.02);
  dGeomSetPosition(belt, -50.0, 30.0, -0.01);
  dGeomSetData(belt, &belt_tag);
  far_box = ode_box(d->world, d->space, LOAD, AT(0.06, 0.06, 0.02), AT(-20.0, 30.0, 0.01 - LAYER));
  (void)ode_box(d->world, d->space, 0.3, AT(0.05, 0.05, 0.05), AT(0.0, 0.2, 0.025));
  return belt_build(d->world, d->space);
}

static void recorded_session(hap_contact_fn says, hap_pose *out, double *out_far)
{
  desk *d = calls_desk(HAP_MODEL_CONTACT, 60.0, says);
  dBodyID box = recorded_world(d);
  desk_record(d, "calls.rec", 0.01);
  session_run(d->session);
  for (int i = 0; i < 2 || (says != NULL && i < 100 && out->position[0] < -0.24);
       ++i) { /* the belt runs */
    desk_glide(d, i == 0 ? -0.18 : 0.0, 0.0, 0.0);
    CHECK(hap_session_poses_now(d->session, &box, 1, out) >= HAP_OK);
  }
  CHECK(hap_session_stop(d->session) == HAP_OK);
  *out_far = dBodyGetPosition(far_box)[0];
  tap_release(d);
}

TEST(a_replay_asks_nobody)
{
  double far_at;
  hap_pose pose = {{-1.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
  const hap_contact_fn says[] = {NULL, drop_all};
  recorded_session(recorded_says, &pose, &far_at);
  CHECK(far_at > -19.97);
  CHECK(pose.position[0] > -0.24);
  for (int i = 0; i < 2; ++i) {
    hap_play_difference difference;
    desk *r = calls_desk(HAP_MODEL_CONTACT, 60.0, says[i]);
    (void)recorded_world(r);
    desk_replay(r, "calls.rec");
    desk_play(r);
    CHECK(hap_player_difference(r->player, &difference, sizeof difference) == HAP_OK);
    CHECK(difference.what == HAP_DIFFERENCE_NONE);
    CHECK_NEAR(dBodyGetPosition(far_box)[0], far_at, 0.02); /* but for the steps after the end */
    tap_release(r);
  }
}

TEST(a_recording_without_answers_is_replayed_without_asking)
{
  hap_pose pose = {{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
  hap_play_difference difference;
  double far_at;
  recorded_session(NULL, &pose, &far_at);
  desk *r = calls_desk(HAP_MODEL_CONTACT, 60.0, drop_all);
  (void)recorded_world(r);
  desk_replay(r, "calls.rec");
  desk_play(r);
  CHECK(hap_player_difference(r->player, &difference, sizeof difference) == HAP_OK);
  CHECK(difference.what == HAP_DIFFERENCE_NONE);
}
