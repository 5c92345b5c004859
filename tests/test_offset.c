/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A scene that lies 10 km from the origin, along all three axes, feels as it does at the origin.
 * There a double has steps of 1.8e-12 m: with 2 kN/m that is 4e-9 N. */

#include "tests/tap.h"

#include "scenes/scenes.h"
#include "tests/physics_world.h"
#include "tests/tick_world.h"

#define FAR 1e4 /* m */
#define TICKS 2000

static const double far[3] = {FAR, FAR, FAR};

/* ---- scenes ---- */

/* What is static and what moves; planes have no pose. */
static double shake; /* m */

static void space_carry(dSpaceID space, const double by[3])
{
  int count = dSpaceGetNumGeoms(space);
  for (int i = 0; i < count; ++i) {
    dGeomID geom = dSpaceGetGeom(space, i);
    dBodyID body = dGeomGetBody(geom);
    if (dGeomGetClass(geom) == dPlaneClass) {
      dVector4 plane;
      dGeomPlaneGetParams(geom, plane);
      dGeomPlaneSetParams(geom, plane[0], plane[1], plane[2], plane[3] + hapi_v3_dot(plane, by));
    } else if (body == NULL) {
      const dReal *p = dGeomGetPosition(geom);
      dGeomSetPosition(geom, p[0] + by[0], p[1] + by[1], p[2] + by[2]);
    } else {
      const dReal *p = dBodyGetPosition(body);
      double sign = shake * (i % 2 == 0 ? 1.0 : -1.0);
      dBodySetPosition(body, p[0] + by[0] + sign, p[1] + by[1] - sign, p[2] + by[2] + sign);
    }
  }
}

typedef struct run_result {
  double force[TICKS][3];
  uint64_t faults;
  bool good;
} run_result;

static hap_session *start_scene(scene *s, hap_model model, hap_device **device, const double by[3])
{
  hap_session *session = NULL;
  hap_session_def def;
  hap_expert_def expert;
  hap_research_def research;
  hap_ode_def ode;
  hap_pointer_def hand;
  hap_pointer_id id;
  session_defs_init(&def, &expert, &research);
  def.drive = HAP_DRIVE_LOCKSTEP;
  def.model = model;
  research.guard = HAP_GUARD_MEASURE; /* what it decides hangs on the last bit */
  def.physics_hz = 60.0;
  expert.trace_rows = 8;
  hap_ode_def_init(&ode, sizeof ode);
  ode.world = s->world;
  ode.space = s->space;
  ode.surface = scene_surface;
  ode.user = s;
  hap_pointer_def_init(&hand, sizeof hand);
  bool good = hap_device_open(s->parameters.hands[0], device, NULL) == HAP_OK &&
              hap_session_create(&def, &ode, &session, NULL) == HAP_OK;
  hand.device = *device;
  hand.radius = s->parameters.radius;
  hand.stiffness = s->parameters.stiffness;
  hand.damping = s->parameters.damping;
  hapi_v3_copy(by, hand.pose_world_device.position);
  good = good && hap_pointer_add(session, &hand, &id) == HAP_OK &&
         hap_session_start(session) == HAP_OK;
  return good ? session : (hap_session_destroy(session), NULL);
}

static void run_scene(const char *name, hap_model model, const double by[3], run_result *out)
{
  scene *s = NULL;
  hap_device *device = NULL;
  memset(out, 0, sizeof *out);
  REQUIRE(scene_create(name, &s, NULL) == HAP_OK);
  space_carry(s->space, by);
  hap_session *session = start_scene(s, model, &device, by);
  out->good = session != NULL;
  for (int i = 0; session != NULL && i < TICKS; ++i) {
    hap_trace_row row;
    size_t got = 0;
    out->good = out->good && hap_session_advance(session, 1) == HAP_OK &&
                hap_session_trace_read(session, &row, 1, sizeof(hap_trace_row), &got) == HAP_OK;
    hapi_v3_copy(row.pointers[0].force, out->force[i]);
  }
  hap_session_destroy(session);
  hap_device_close(device);
  scene_destroy(s);
}

static double difference_of(const run_result *a, const run_result *b, double *out_peak)
{
  double off = 0.0;
  *out_peak = 0.0;
  for (int i = 0; i < TICKS; ++i) {
    double d[3];
    hapi_v3_sub(a->force[i], b->force[i], d);
    off = fmax(off, hapi_v3_norm(d));
    *out_peak = fmax(*out_peak, hapi_v3_norm(a->force[i]));
  }
  return off;
}

static run_result here;
static run_result there;
static run_result shaken;

/* What a picometre at the origin does: where the force hangs on a picometre, no place is better
 * than 10 km away. */
static double scene_conditioning(const char *name, hap_model model)
{
  const double origin[3] = {0.0, 0.0, 0.0};
  double most = 0.0;
  double peak = 0.0;
  for (int k = 1; k <= 4; ++k) {
    shake = 1e-12 * k;
    run_scene(name, model, origin, &shaken);
    most = fmax(most, difference_of(&here, &shaken, &peak));
  }
  shake = 0.0;
  return most / peak;
}

static void check_scene(const char *name, hap_model model)
{
  const double origin[3] = {0.0, 0.0, 0.0};
  double peak = 0.0;
  run_scene(name, model, origin, &here);
  run_scene(name, model, far, &there);
  double off = difference_of(&here, &there, &peak) / peak;
  double allowed = fmin(0.25, fmax(1e-6, 10.0 * scene_conditioning(name, model)));
  printf("# %s, %s: %.2g of %.3g N, allowed %.2g\n", name, hap_model_name(model), off, peak,
         allowed);
  CHECK(here.good && there.good && peak > 1.0);
  CHECK(off <= allowed ||
        model == HAP_MODEL_SINGLE); /* ODE's alone, which has other contacts there */
}

TEST(scenes_far_from_the_origin)
{
  static const char *const names[] = {"slide", "row10", "stack", "roll", "wedge", "clump8"};
  for (size_t i = 0; i < sizeof names / sizeof names[0]; ++i) {
    for (int model = 0; model <= HAP_MODEL_CONTACT; ++model) {
      check_scene(names[i], (hap_model)model);
    }
  }
}

/* ---- the tick alone ---- */

static double tick_force[TICKS];

static void set_box(hapi_model_contact *c)
{
  c->has_shape = 1;
  c->shape.kind = HAPI_SHAPE_BOX;
  hapi_v3_set(c->shape.half, 0.05, 0.05, 0.05);
  c->shape_pose.quat_wxyz[0] = 1.0;
}

/* A cube of 0.5 kg on an edge of which a pointer presses, so that it goes and turns. */
static void run_tick(hap_model model, double at, double stiffness, double *forces)
{
  set_up();
  f.model->model = model;
  hapi_pointer *p = add_pointer(0, 0.0, 0.0, 0.0);
  p->surface.stiffness = stiffness;
  hapi_v3_set(p->device.pose_world_device.position, at, at, at);
  hapi_v3_set(p->device.pose.position, -0.0599, 0.02, 0.01);
  begin_model();
  hapi_model_body *body = add_body(0);
  body->flags = model == HAP_MODEL_CONTACT ? HAPI_BODY_OWNED : 0;
  body->mass = 0.5;
  body->linear_keep = body->angular_keep = 1.0;
  body->max_angular_speed = HUGE_VAL;
  for (int i = 0; i < 3; ++i) {
    body->inertia[4 * i] = 0.01;
    body->inverse_inertia[4 * i] = 100.0;
  }
  hapi_v3_set(body->pose.position, at, at, at);
  hapi_model_contact *c = add_contact(0, 0, 0);
  hapi_v3_set(c->point_body, -0.05, 0.02, 0.01);
  set_free(c, 0.5, 0.01);
  set_box(c);
  model_adopt();
  hapi_patches *patches = hapi_exchange_patches_back(f.exchange);
  patches->contact_count = patches->surface_count = 0;
  patches->model_number = f.model->number;
  hapi_tick_adopt_patches(&f.tick, patches);
  for (int i = 0; i < TICKS; ++i) {
    p->device.twist.linear[0] = i < TICKS / 2 ? 0.05 : -0.05;
    p->device.pose.position[0] += T * p->device.twist.linear[0];
    ticks_run(1);
    forces[i] = p->wrench.force[0];
  }
}

TEST(the_tick_far_from_the_origin)
{
  static double near_force[TICKS];
  static const double stiffness[] = {1e3, 1e5};
  for (int k = 0; k < 4; ++k) {
    hap_model model = k / 2 == 0 ? HAP_MODEL_ACCELERANCE : HAP_MODEL_CONTACT;
    if (model == HAP_MODEL_ACCELERANCE && k % 2 == 1) {
      continue; /* explicit: not stable */
    }
    run_tick(model, 0.0, stiffness[k % 2], near_force);
    run_tick(model, FAR, stiffness[k % 2], tick_force);
    double off = 0.0;
    double peak = 0.0;
    for (int i = 0; i < TICKS; ++i) {
      off = fmax(off, fabs(tick_force[i] - near_force[i]));
      peak = fmax(peak, fabs(near_force[i]));
    }
    printf("# %s, %g N/m: %.2g of %.3g N\n", hap_model_name(model), stiffness[k % 2], off / peak,
           peak);
    CHECK(peak > 0.1 && off <= 1e-6 * peak);
  }
}

/* ---- testing simulations ---- */

static void measure_at(double at, double out[6][3])
{
  test_world *w = world_new(9.81, 200);
  w->mu = 0.0;
  dBodyID cube = world_add_cube(w, 0.1, 1.0, at + 0.05, at, at + 0.05);
  dCreatePlane(w->space, 0.0, 0.0, 1.0, at);
  world_start(w, 0.01, at - 0.011, at + 0.02, at + 0.03);
  const hapi_contact_slot *contact = world_contact(w, cube, 0);
  REQUIRE(contact != NULL && world_contact_answer(w, contact)->probed);
  memcpy(out, world_contact_answer(w, contact)->a, 18 * sizeof(double));
}

TEST(accelerance_far_from_the_origin)
{
  double origin[6][3] = {{0.0}};
  double away[6][3] = {{0.0}};
  measure_at(0.0, origin);
  measure_at(FAR, away);
  double most = 0.0;
  double off = 0.0;
  for (int i = 0; i < 18; ++i) {
    most = fmax(most, fabs(origin[i / 3][i % 3]));
    off = fmax(off, fabs(origin[i / 3][i % 3] - away[i / 3][i % 3]));
  }
  printf("# A: %.2g of %.3g\n", off / most, most);
  CHECK(most > 0.1 && off <= 1e-6 * most);
}
