/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "tests/stability/build.h"
#include "tests/stability/cases.h"

static const char *const hand_words[] = {"relaxed", "tense", "rigid", "none"};

/* ---- what builders are made of ---- */

dBodyID add_body(world *w, dGeomID geom, const dMass *mass, const double at[3])
{
  const double *o = w->origin;
  if (w->body_count == WORLD_BODIES_MAX) {
    return NULL;
  }
  dBodyID body = dBodyCreate(w->world);
  dBodySetMass(body, mass);
  dBodySetPosition(body, o[0] + at[0], o[1] + at[1], o[2] + at[2]);
  dGeomSetBody(geom, body);
  w->bodies[w->body_count++] = body;
  return body;
}

dBodyID add_box(world *w, double mass, const double edges[3], const double at[3])
{
  dMass m;
  dMassSetBoxTotal(&m, mass, edges[0], edges[1], edges[2]);
  return add_body(w, dCreateBox(w->space, edges[0], edges[1], edges[2]), &m, at);
}

dBodyID add_cube(world *w, double mass, double edge, const double at[3])
{
  return add_box(w, mass, (const double[3]){edge, edge, edge}, at);
}

dBodyID add_ball(world *w, double mass, double radius, const double at[3])
{
  dMass m;
  dMassSetSphereTotal(&m, mass, radius);
  return add_body(w, dCreateSphere(w->space, radius), &m, at);
}

dGeomID add_block(world *w, const double edges[3], const double at[3])
{
  const double *o = w->origin;
  dGeomID geom = dCreateBox(w->space, edges[0], edges[1], edges[2]);
  dGeomSetPosition(geom, o[0] + at[0], o[1] + at[1], o[2] + at[2]);
  return geom;
}

void add_floor(world *w)
{
  (void)dCreatePlane(w->space, 0.0, 0.0, 1.0, w->origin[2]);
}

void set_gravity(world *w, double gravity)
{
  dWorldSetGravity(w->world, 0.0, 0.0, -gravity);
}

void add_hand(world *w, const char *format, ...)
{
  va_list arguments;
  va_start(arguments, format);
  char *out = w->motions[w->hand_count++];
  (void)vsnprintf(out, sizeof w->motions[0], format, arguments);
  va_end(arguments);
}

/* ---- the session ---- */

static bool world_surface(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  world *w = user;
  dBodyID body_a = dGeomGetBody(a);
  dBodyID body_b = dGeomGetBody(b);
  if (w->scene != NULL) {
    return scene_surface(w->scene, a, b, io);
  }
  *io = w->surface;
  return (body_a != NULL || body_b != NULL) &&
         !(body_a != NULL && body_b != NULL &&
           dAreConnectedExcluding(body_a, body_b, dJointTypeContact));
}

static void in_step(void *user, double step_s)
{
  world *w = user;
  (void)step_s;
  if (w->before_step != NULL) {
    w->before_step(w);
  }
  ++w->steps;
}

void world_open(world *w)
{
  memset(w, 0, sizeof *w);
  w->world = dWorldCreate();
  w->space = dHashSpaceCreate(NULL);
  w->surface = (dSurfaceParameters){.mode = dContactApprox1, .mu = 0.5};
  w->max_force = 100.0;
  w->device_damping = 2.0;
  set_gravity(w, 9.81);
  dWorldSetERP(w->world, 0.2);
  dWorldSetContactSurfaceLayer(w->world, WORLD_LAYER);
  dWorldSetQuickStepNumIterations(w->world, 50);
  session_defs_init(&w->def, &w->expert, &w->research);
  pointer_defs_init(&w->pointer, &w->pointer_expert, &w->pointer_research);
  w->def.drive = HAP_DRIVE_LOCKSTEP;
  w->research.guard = HAP_GUARD_MEASURE; /* it would hide what is looked for */
  w->def.max_pointers = WORLD_HANDS_MAX;
  w->def.physics_hz = 60.0;
}

static bool open_session(world *w)
{
  hap_ode_def ode;
  hap_ode_def_init(&ode, sizeof ode);
  ode.world = w->world;
  ode.space = w->space;
  ode.surface = world_surface;
  ode.before_step = in_step;
  ode.user = w;
  return hap_session_create(&w->def, &ode, &w->session, &w->detail) >= HAP_OK;
}

static bool open_hand(world *w, const case_row *row, int index)
{
  char spec[640];
  bool rigid = row->hand == RIGID;
  (void)snprintf(spec, sizeof spec, "virtual:hand=%s,max_force=%g,device_damping=%g,%s%s%s%s",
                 hand_words[row->hand], w->max_force, w->device_damping,
                 rigid ? "" : "device_mass=0.1,", row->device != NULL ? row->device : "",
                 row->device != NULL ? "," : "", w->motions[index]);
  if (hap_device_open(spec, &w->devices[index], &w->detail) < HAP_OK) {
    return false;
  }
  hap_pointer_def def = w->pointer;
  def.device = w->devices[index];
  memcpy(def.pose_world_device.position, w->origin, sizeof w->origin);
  return hap_pointer_add(w->session, &def, &w->pointers[index]) >= HAP_OK;
}

static void take_parameters(world *w, const case_row *row, hap_model model)
{
  w->def.model = model;
  w->def.physics_hz = row->physics_hz > 0.0 ? row->physics_hz : w->def.physics_hz;
  w->device_damping = row->device_damping > 0.0 ? row->device_damping : w->device_damping;
  w->max_force = row->max_force > 0.0 ? row->max_force : w->max_force;
  w->pointer.stiffness = row->k;
  w->pointer.friction = row->mu;
  w->pointer.finger_radius = row->finger;
  w->pointer.max_force = 1e6; /* the device's limit is the one that counts */
  dWorldSetCFM(w->world, row->cfm < 0.0 ? 0.0 : row->cfm > 0.0 ? row->cfm : 1e-12);
  if (row->coupling_stiffness > 0.0 && model == HAP_MODEL_CONTACT) {
    w->pointer_expert.coupling =
        row->coupling != HAP_COUPLING_DIRECT ? row->coupling : HAP_COUPLING_PROXY;
    w->pointer_expert.coupling_stiffness = row->coupling_stiffness;
  }
}

bool world_start(world *w, const case_row *row, hap_model model)
{
  w->origin[0] = row->origin;
  row->build(w, row);
  if (w->world == NULL) {
    return false;
  }
  take_parameters(w, row, model);
  for (int i = 0; i < w->body_count; ++i) {
    memcpy(w->start[i], dBodyGetPosition(w->bodies[i]), sizeof w->start[i]);
  }
  bool good = open_session(w);
  for (int i = 0; i < w->hand_count && good; ++i) {
    good = open_hand(w, row, i);
  }
  good = good && hap_session_start(w->session) >= HAP_OK;
  if (!good && w->session != NULL && w->detail.text[0] == '\0') {
    (void)hap_session_detail(w->session, &w->detail);
  }
  return good;
}

void world_close(world *w)
{
  hap_session_destroy(w->session);
  for (int i = 0; i < w->hand_count; ++i) {
    hap_device_close(w->devices[i]);
  }
  if (w->scene != NULL) {
    scene_destroy(w->scene);
    return;
  }
  dSpaceDestroy(w->space);
  dWorldDestroy(w->world);
}
