/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "bench/stability.h"

#include <math.h>
#include <string.h>

#include <ode/ode.h>

#include <hapode/ode.h>

#include "base/vec.h"
#include "device/device.h"
#include "haptic/haptic_internal.h"
#include "physics/physics_internal.h"
#include "plugins/virtual/virtual.h"
#include "session/session_internal.h"
#include "tools/session_defs.h"

#define POINTER_RADIUS 10.0 /* m: so large that all normals are nearly those of the push */
#define HALF 0.005          /* m, of a ball or cube */
#define PITCH 0.012
#define BACK 0.0115
#define GAP 1e-6    /* m, before the push */
#define PUSH 1e-3   /* m */
#define PUSH_S 0.01 /* from rest to rest */
#define MISSED_OF 100
#define MISSED_AT 57 /* not a tick at which physics is due */
#define NO_LIMIT 1e6 /* N */

typedef struct stability_bed {
  const stability_point *point;
  dWorldID world;
  dSpaceID space;
  dBodyID bodies[STABILITY_CONTACTS_MAX];
  hap_device *device;
  hap_session *session;
  hap_pointer_id pointer;
  double kinetic; /* J, of the bodies after the newest tick */
  stability_account energy;
} stability_bed;

/* ---- the bed ---- */

static void add_body(stability_bed *s, int index, dGeomID geom, const dMass *mass,
                     const double at[3])
{
  dBodyID body = dBodyCreate(s->world);
  dBodySetMass(body, mass);
  dBodySetPosition(body, at[0], at[1], at[2]);
  dGeomSetBody(geom, body);
  s->bodies[index] = body;
}

/* A ball under the pointer at x and y, its back against the normal. */
static void add_ball(stability_bed *s, int index, double x, double y, double side)
{
  const double reach = POINTER_RADIUS + HALF + GAP;
  const double at[3] = {x, y, side * sqrt(reach * reach - x * x - y * y)};
  const double out = 1.0 + 1.5 * HALF / reach;
  dMass mass;
  dMassSetSphereTotal(&mass, s->point->mass, HALF);
  add_body(s, index, dCreateSphere(s->space, HALF), &mass, at);
  if (s->point->layout != STABILITY_FREE) {
    dMatrix3 rotation;
    dGeomID back = dCreateBox(s->space, BACK, BACK, HALF);
    dRFromZAxis(rotation, at[0], at[1], at[2]);
    dGeomSetRotation(back, rotation);
    dGeomSetPosition(back, out * at[0], out * at[1], out * at[2]);
  }
}

/* A cube that the pointer touches at its nearest edge or corner, with four contacts on its back. */
static void add_cube(stability_bed *s, int index, double x, double y, double side)
{
  const double across[2] = {fmax(0.0, fabs(x) - HALF), fmax(0.0, fabs(y) - HALF)};
  const double reach = POINTER_RADIUS + GAP;
  const double top = sqrt(reach * reach - across[0] * across[0] - across[1] * across[1]);
  const double at[3] = {x, y, side * (top + HALF)};
  dMass mass;
  dMassSetBoxTotal(&mass, s->point->mass, 2.0 * HALF, 2.0 * HALF, 2.0 * HALF);
  add_body(s, index, dCreateBox(s->space, 2.0 * HALF, 2.0 * HALF, 2.0 * HALF), &mass, at);
  if (s->point->layout != STABILITY_FREE) {
    dGeomID back = dCreateBox(s->space, BACK, BACK, HALF);
    dGeomSetPosition(back, x, y, at[2] + side * 1.5 * HALF);
  }
}

static void add_bodies(stability_bed *s)
{
  const int sides = s->point->layout == STABILITY_CAGE ? 2 : 1;
  const int each = s->point->contacts / sides;
  const int across = (int)ceil(sqrt(each));
  for (int i = 0; i < s->point->contacts; ++i) {
    const int column = i % each % across;
    const int row = i % each / across;
    const int last_row = (each - 1) / across;
    double x = PITCH * (column - 0.5 * (across - 1));
    double y = PITCH * (row - 0.5 * last_row);
    (s->point->cubes ? add_cube : add_ball)(s, i, x, y, i < each ? -1.0 : 1.0);
  }
}

static void write_spec(const stability_point *p, const char *hand, char out[256])
{
  int length = snprintf(
      out, 256, "virtual:max_force=1e6,device_mass=%g,device_damping=%g,delay=%.9g,%s",
      STABILITY_DEVICE_MASS, STABILITY_DEVICE_DAMPING, p->delay_ticks / STABILITY_HAPTIC_HZ, hand);
  if (p->quantum > 0.0) {
    snprintf(out + length, 256 - (size_t)length, ",quantum=%g", p->quantum);
  }
}

static hap_status open_session(bench *b, stability_bed *s, const char *spec)
{
  hap_session_def def;
  hap_expert_def expert;
  hap_research_def research;
  hap_ode_def ode;
  hap_pointer_def pointer;
  hap_pointer_expert_def pointer_expert;
  hap_pointer_research_def pointer_research;
  session_defs_init(&def, &expert, &research);
  hap_ode_def_init(&ode, sizeof ode);
  pointer_defs_init(&pointer, &pointer_expert, &pointer_research);
  def.drive = HAP_DRIVE_LOCKSTEP;
  research.guard = HAP_GUARD_MEASURE;
  def.haptic_hz = STABILITY_HAPTIC_HZ;
  ode.world = s->world;
  ode.space = s->space;
  pointer.radius = POINTER_RADIUS;
  pointer.stiffness = s->point->stiffness;
  pointer.max_force = NO_LIMIT;
  pointer_expert.coupling = s->point->coupling;
  pointer_research.integration = s->point->integration;
  hap_status status = hap_device_open(spec, &s->device, &b->detail);
  pointer.device = s->device;
  if (status >= HAP_OK) {
    status = hap_session_create(&def, &ode, &s->session, &b->detail);
  }
  if (status >= HAP_OK) {
    status = hap_pointer_add(s->session, &pointer, &s->pointer);
  }
  if (status >= HAP_OK) {
    status = hap_session_start(s->session);
  }
  if (status < HAP_OK && s->session != NULL) {
    (void)hap_session_detail(s->session, &b->detail);
  }
  return status;
}

static hap_status open_bed(bench *b, const stability_point *point, const char *hand,
                           stability_bed *s)
{
  char spec[256];
  memset(s, 0, sizeof *s);
  s->point = point;
  s->energy.finite = true;
  s->world = dWorldCreate();
  s->space = dHashSpaceCreate(NULL);
  dWorldSetCFM(s->world, 1e-12);
  dWorldSetContactSurfaceLayer(s->world, 1e-5);
  add_bodies(s);
  write_spec(point, hand, spec);
  return open_session(b, s, spec);
}

static void close_bed(stability_bed *s)
{
  hap_session_destroy(s->session);
  if (s->device != NULL) {
    hap_device_close(s->device);
  }
  dSpaceDestroy(s->space);
  dWorldDestroy(s->world);
}

/* ---- energy ---- */

static int index_of(const stability_bed *s, dBodyID body)
{
  for (int i = 0; i < s->point->contacts; ++i) {
    if (s->bodies[i] == body) {
      return i;
    }
  }
  return -1;
}

static double kinetic_of(const stability_bed *s, const double linear[3], const double angular[3])
{
  double inertia = (s->point->cubes ? 2.0 / 3.0 : 0.4) * s->point->mass * HALF * HALF;
  return 0.5 * s->point->mass * hapi_v3_dot(linear, linear) +
         0.5 * inertia * hapi_v3_dot(angular, angular);
}

static void bodies_look(stability_bed *s)
{
  const hapi_tick *tick = &s->session->haptic->tick;
  const hapi_physics *physics = s->session->physics;
  bool local[STABILITY_CONTACTS_MAX] = {false};
  s->kinetic = 0.0;
  for (uint32_t i = 0; i < tick->bodies.live_count; ++i) {
    const hapi_local_body *body = &tick->bodies.of[tick->bodies.live[i]];
    uint32_t known = physics->near.slots.bodies[tick->bodies.live[i]].known;
    int index = known == HAPI_NONE ? -1 : index_of(s, physics->world.bodies.entries[known].body);
    if (index >= 0) {
      local[index] = true;
      s->kinetic += kinetic_of(s, body->twist.linear, body->twist.angular);
    }
  }
  for (int i = 0; i < s->point->contacts; ++i) {
    if (!local[i]) { /* has drifted away */
      s->kinetic +=
          kinetic_of(s, dBodyGetLinearVel(s->bodies[i]), dBodyGetAngularVel(s->bodies[i]));
    }
  }
}

double stability_coupling_energy(const hapi_pointer *p)
{
  double apart[3];
  if (!p->proxied) {
    return 0.0;
  }
  hapi_v3_sub(p->proxy.position, p->handle.position, apart);
  hapi_v3_sub(apart, p->proxy.offset, apart);
  return 0.5 * p->coupling.stiffness * hapi_v3_dot(apart, apart) +
         0.5 * p->coupling.mass * hapi_v3_dot(p->proxy.velocity, p->proxy.velocity);
}

/* J, of the contacts' springs, from their forces, and of the coupling's, with the device where it
 * was measured last. */
static double springs_energy(const stability_bed *s)
{
  const hapi_tick *tick = &s->session->haptic->tick;
  const hapi_pointer *p = &tick->pointers.of[0];
  double sum = 0.0;
  for (uint32_t i = 0; i < tick->touches.count && !p->rigid; ++i) {
    const double *force = tick->touches.of[i].force;
    sum += 0.5 * hapi_v3_dot(force, force) / s->point->stiffness;
  }
  return sum + stability_coupling_energy(p);
}

void stability_account_tick(stability_account *io, const hapi_virtual_port *was,
                            const hapi_virtual_port *now, double period, double kinetic,
                            double springs)
{
  double way[3];
  hapi_v3_sub(now->position, was->position, way);
  /* velocity is nearly linear within: mean of its square from ends and mean */
  double mean = hapi_v3_dot(way, way) / (period * period);
  double ends =
      0.5 * (hapi_v3_dot(was->velocity, was->velocity) + hapi_v3_dot(now->velocity, now->velocity));
  io->lost += STABILITY_DEVICE_DAMPING * period * (2.0 * mean + ends) / 3.0;
  double made = now->work - io->lost + kinetic;
  double held = fmin(springs, fmax(0.0, -made)); /* no more than was taken */
  double stored = kinetic + held + 0.5 * now->mass * hapi_v3_dot(now->velocity, now->velocity);
  io->finite = io->finite && isfinite(made) && isfinite(stored);
  io->made = fmax(io->made, made);
  io->stored = fmax(io->stored, stored);
}

double stability_account_ratio(const stability_account *account)
{
  return account->finite && account->stored > 0.0 ? 1.0 + account->made / account->stored
                                                  : HUGE_VAL;
}

/* ---- runs ---- */

const char *stability_hand_word(stability_hand hand)
{
  return hand == STABILITY_NONE ? "none" : hand == STABILITY_RELAXED ? "relaxed" : "tense";
}

const char *stability_layout_word(stability_layout layout)
{
  return layout == STABILITY_FREE ? "free" : layout == STABILITY_BACKED ? "backed" : "cage";
}

bool stability_is_rigid(hap_coupling coupling)
{
  return coupling == HAP_COUPLING_GOD_OBJECT || coupling == HAP_COUPLING_VIRTUAL;
}

static double in_series(const stability_point *p, double held)
{
  double k = p->stiffness * p->contacts / (p->layout == STABILITY_CAGE ? 2 : 1);
  double series = stability_is_rigid(p->coupling) ? held : k * held / (k + held);
  return p->coupling == HAP_COUPLING_DIRECT ? k : series;
}

static void write_hand(const stability_point *p, char out[128])
{
  if (p->hand != STABILITY_NONE) {
    snprintf(out, 128, "hand=%s,path=0:0/0/0;%g:0/0/0;%g:0/0/%g", stability_hand_word(p->hand),
             PUSH_S, 2.0 * PUSH_S, -PUSH);
    return;
  }
  double held = 0.8 * STABILITY_DEVICE_DAMPING * STABILITY_HAPTIC_HZ / (0.5 + p->delay_ticks);
  double speed = PUSH * sqrt(in_series(p, held) / STABILITY_DEVICE_MASS);
  snprintf(out, 128, "hand=none,kick=%g:0/0/%.9g", PUSH_S, -fmin(speed, 50.0));
}

static void tick_once(stability_bed *s, uint64_t index, hapi_virtual_port *port, double *way)
{
  hapi_virtual_port was = *port;
  bool missed = s->point->missed && index % MISSED_OF == MISSED_AT;
  double period = (missed ? 2.0 : 1.0) / STABILITY_HAPTIC_HZ;
  if (missed) {
    atomic_fetch_add(&s->session->tick, 1);
  }
  (void)hap_session_advance(s->session, 1);
  bodies_look(s);
  hapi_virtual_get_port(hapi_device_self(s->device), port);
  stability_account_tick(&s->energy, &was, port, period, s->kinetic, springs_energy(s));
  *way = fmax(*way, -port->position[2]);
}

static void run_finish(stability_bed *s, double way, int touched, stability_result *out)
{
  const hapi_tick *tick = &s->session->haptic->tick;
  out->energy_ratio = stability_account_ratio(&s->energy);
  out->stable = s->energy.finite && tick->guard.latch.fault == HAP_FAULT_NONE &&
                out->energy_ratio <= STABILITY_RATIO;
  out->held = tick->pointers.of[0].coupling.hold;
  out->residual = tick->rows.residual_max;
  out->way = way;
  out->stored = s->energy.stored;
  out->touched = touched;
  out->proxied = tick->pointers.of[0].proxied;
}

hap_status stability_run(bench *b, const stability_point *point, double seconds,
                         stability_result *out)
{
  char hand[128];
  stability_bed s;
  hapi_virtual_port port;
  memset(out, 0, sizeof *out);
  write_hand(point, hand);
  hap_status status = open_bed(b, point, hand, &s);
  if (status >= HAP_OK) {
    double way = 0.0;
    int touched = 0;
    uint64_t ticks = (uint64_t)llround(seconds * STABILITY_HAPTIC_HZ);
    hapi_virtual_get_port(hapi_device_self(s.device), &port);
    for (uint64_t i = 0; i < ticks && s.energy.finite; ++i) {
      tick_once(&s, i, &port, &way);
      int pushing = (int)s.session->haptic->tick.touches.pushing;
      touched = pushing > touched ? pushing : touched;
    }
    run_finish(&s, way, touched, out);
  }
  close_bed(&s);
  return status;
}

hap_status stability_feel(bench *b, const stability_point *point, double *out)
{
  static const uint64_t stops[2] = {700, 1400};
  const char *hand = "hand=rigid,blend=linear,path=0:0/0/0.0001;2:0/0/-0.0019";
  stability_point backed = *point;
  backed.layout = STABILITY_BACKED;
  stability_bed s;
  double z[2];
  double force[2];
  hap_status status = open_bed(b, &backed, hand, &s);
  for (int i = 0; i < 2 && status >= HAP_OK; ++i) {
    hap_pointer_state state;
    hapi_virtual_port port;
    status = hap_session_advance(s.session, stops[i] - s.session->tick);
    if (hap_pointer_get(s.session, s.pointer, &state, sizeof state) < HAP_OK) {
      status = HAP_ERROR_STATE;
    }
    hapi_virtual_get_port(hapi_device_self(s.device), &port);
    z[i] = port.position[2];
    force[i] = state.wrench.force[2];
  }
  *out = status >= HAP_OK ? (force[1] - force[0]) / (z[0] - z[1]) : 0.0;
  close_bed(&s);
  return status;
}
