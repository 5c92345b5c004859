/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "bench/port.h"

#include <string.h>

#include "tools/session_defs.h"

static const double friction = 0.5;
static const double surface_layer = 1e-3; /* m */

/* A body on one point would tip over: its rotation is made so slow that nothing of it is seen. */
static const double free_inertia = 1.0; /* kg m^2 */

static bool surface_set(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  (void)user;
  (void)a;
  (void)b;
  io->mode = dContactApprox1;
  io->mu = friction;
  return true;
}

static dBodyID add_body(port *p, dGeomID geom, const dMass *mass, const double at[3])
{
  dBodyID body = dBodyCreate(p->world);
  dBodySetMass(body, mass);
  dGeomSetBody(geom, body);
  dBodySetPosition(body, at[0], at[1], at[2]);
  return body;
}

static dBodyID add_cube(port *p, const dMass *mass)
{
  dGeomID geom = dCreateBox(p->space, PORT_EDGE, PORT_EDGE, PORT_EDGE);
  return add_body(p, geom, mass, (const double[3]){0.0, 0.0, 0.5 * PORT_EDGE});
}

static dBodyID add_free_cube(port *p, double mass)
{
  dMass m;
  dMassSetParameters(&m, mass, 0.0, 0.0, 0.0, free_inertia, free_inertia, free_inertia, 0.0, 0.0,
                     0.0);
  return add_cube(p, &m);
}

static void add_held(port *p, double mass)
{
  dJointID joint = dJointCreateFixed(p->world, NULL);
  dJointAttach(joint, add_free_cube(p, mass), NULL);
  dJointSetFixed(joint);
}

static void add_slider(port *p, double mass)
{
  dJointID joint = dJointCreateSlider(p->world, NULL);
  dJointAttach(joint, add_free_cube(p, mass), NULL);
  dJointSetSliderAxis(joint, 0.0, 0.0, 1.0);
}

/* The floor is at the side: the push is along z. */
static void add_stuck(port *p, double mass)
{
  dMass m;
  dMassSetBoxTotal(&m, mass, PORT_EDGE, PORT_EDGE, PORT_EDGE);
  add_cube(p, &m);
  dCreatePlane(p->space, 1.0, 0.0, 0.0, -0.5 * PORT_EDGE + surface_layer);
  dWorldSetGravity(p->world, -PORT_GRAVITY, 0.0, 0.0);
}

static void add_flap(port *p, double mass)
{
  dMass m;
  const double edges[3] = {PORT_FLAP_LENGTH, PORT_EDGE, 2.0 * PORT_FLAP_HALF};
  const double at[3] = {0.5 * PORT_FLAP_LENGTH - PORT_FLAP_ARM, 0.0, PORT_FLAP_HALF};
  dMassSetBoxTotal(&m, mass, edges[0], edges[1], edges[2]);
  dGeomID geom = dCreateBox(p->space, edges[0], edges[1], edges[2]);
  dBodyID flap = add_body(p, geom, &m, at);
  dJointID joint = dJointCreateHinge(p->world, NULL);
  dJointAttach(joint, flap, NULL);
  dJointSetHingeAnchor(joint, -PORT_FLAP_ARM, 0.0, 0.0);
  dJointSetHingeAxis(joint, 0.0, 1.0, 0.0);
}

static void build_world(port *p, const port_def *def)
{
  p->world = dWorldCreate();
  p->space = dHashSpaceCreate(NULL);
  dWorldSetGravity(p->world, 0.0, 0.0, -PORT_GRAVITY);
  dWorldSetERP(p->world, 0.2);
  dWorldSetCFM(p->world, 1e-10);
  dWorldSetContactSurfaceLayer(p->world, surface_layer);
  switch (def->body) {
    case PORT_WALL:
      dGeomSetPosition(dCreateBox(p->space, PORT_EDGE, PORT_EDGE, PORT_EDGE), 0.0, 0.0,
                       0.5 * PORT_EDGE);
      break;
    case PORT_HELD:
      add_held(p, def->mass);
      break;
    case PORT_STUCK:
      add_stuck(p, def->mass);
      break;
    case PORT_FREE:
      add_free_cube(p, def->mass);
      break;
    case PORT_SLIDER:
      add_slider(p, def->mass);
      break;
    case PORT_HINGE:
      add_flap(p, def->mass);
      break;
    case PORT_BODIES:
      break;
  }
}

static hap_status create_session(bench *b, port *p, const port_def *def)
{
  hap_ode_def ode;
  hap_session_def session;
  hap_expert_def expert;
  hap_research_def research;
  hap_ode_def_init(&ode, sizeof ode);
  session_defs_init(&session, &expert, &research);
  ode.world = p->world;
  ode.space = p->space;
  ode.surface = surface_set;
  session.drive = HAP_DRIVE_LOCKSTEP;
  research.guard = HAP_GUARD_MEASURE;
  session.model = def->model;
  session.physics_hz = PORT_PHYSICS_HZ;
  session.haptic_hz = def->haptic_hz > 0.0 ? def->haptic_hz : PORT_HAPTIC_HZ;
  session.max_pointers = 1;
  session.max_bodies = 1;
  session.max_contacts = 16;
  return hap_session_create(&session, &ode, &p->session, &b->detail);
}

static hap_status add_pointer(bench *b, port *p, const port_def *def)
{
  hap_pointer_def pointer;
  hap_pointer_expert_def pointer_expert;
  hap_pointer_research_def pointer_research;
  pointer_defs_init(&pointer, &pointer_expert, &pointer_research);
  hap_status status = hap_device_open(def->device, &p->device, &b->detail);
  if (status < HAP_OK) {
    return status;
  }
  pointer.device = p->device;
  pointer.radius = PORT_RADIUS;
  pointer.stiffness = def->stiffness;
  pointer.damping = def->damping;
  pointer_expert.coupling = def->coupling;
  pointer_expert.coupling_stiffness = def->coupling_stiffness;
  pointer_expert.coupling_damping = def->coupling_damping;
  pointer_research.virtual_mass =
      def->virtual_mass > 0.0 ? def->virtual_mass : pointer_research.virtual_mass;
  pointer.max_force = 1e6;
  status = hap_pointer_add(p->session, &pointer, &p->pointer);
  if (status >= HAP_OK) {
    status = hap_session_start(p->session);
  }
  if (status < HAP_OK) {
    (void)hap_session_detail(p->session, &b->detail);
  }
  return status;
}

hap_status port_open(bench *b, const port_def *def, port *out)
{
  memset(out, 0, sizeof *out);
  build_world(out, def);
  hap_status status = create_session(b, out, def);
  if (status >= HAP_OK) {
    status = add_pointer(b, out, def);
  }
  if (status < HAP_OK) {
    port_close(out);
  }
  return status;
}

void port_close(port *p)
{
  hap_session_destroy(p->session);
  hap_device_close(p->device);
  dSpaceDestroy(p->space);
  dWorldDestroy(p->world);
  memset(p, 0, sizeof *p);
}

hap_status port_advance(bench *b, port *p)
{
  hap_status status = hap_session_advance(p->session, 1);
  if (status >= HAP_OK) {
    status = hap_pointer_get(p->session, p->pointer, &p->state, sizeof p->state);
  }
  if (status < HAP_OK) {
    (void)hap_session_detail(p->session, &b->detail);
  }
  return status;
}
