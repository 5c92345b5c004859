/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "bench/stability_own.h"

#include <math.h>
#include <string.h>

#include <ode/ode.h>

#include <hapode/grab.h>
#include <hapode/ode.h>
#include <hapode/surface.h>

#include "base/log.h"
#include "base/vec.h"
#include "device/device.h"
#include "haptic/haptic_internal.h"
#include "physics/physics_internal.h"
#include "session/session_internal.h"
#include "tools/session_defs.h"

#define RADIUS 0.005 /* m, of the pointer */
#define HALF 0.02    /* m, of the cube */
#define GAP 1e-6
#define PUSH 1e-3       /* m */
#define STROKE 4e-3     /* m */
#define BEGIN_S 0.05    /* the field has come in; then the hand goes, or the blow comes */
#define CONTACT 1e3     /* N/m, of a pointer that strokes no texture */
#define LIMIT 20.0      /* N, of the pointer */
#define PROMISE 10.0    /* N, of springs and functions */
#define PULL 5.0        /* N, of magnets and detents */
#define SHAKE 2.0       /* N, of a vibration */
#define HEIGHT 1e-4     /* m, of a texture's waves */
#define WAVE 2e-3       /* m */
#define REACH_MOST 0.05 /* m, of a surface's pull */
#define REACH_LEAST 0.001
#define POWER_S 0.1                    /* docs/forces.md: promised power is a mean over this time */
#define MAGNET_SLOPE 2.598076211353316 /* likewise: at the middle, of strength / range */

typedef struct own_bed {
  const own_point *point;
  dWorldID world;
  dSpaceID space;
  dBodyID cube;
  hap_device *device;
  hap_session *session;
  hap_pointer_id pointer;
  hap_force_def def;
  hap_force_id force;
  uint32_t texture;
  double pull;      /* N, of a surface */
  double reach;     /* m, likewise, of a magnet */
  double stiffness; /* N/m, of the field as it is */
  double at[3];     /* m, pose of the cube after the newest tick, with its velocity */
  double speed;
  double kinetic;
  stability_account energy;
} own_bed;

const char *own_field_word(own_field field)
{
  static const char *const words[OWN_FIELDS] = {"spring",    "viscous", "magnet",    "detents",
                                                "vibration", "call",    "untold",    "texture",
                                                "adhesion",  "snap",    "grab-soft", "grab-rigid"};
  return words[field];
}

bool own_field_binds(own_field field)
{
  return field == OWN_SPRING || field == OWN_VISCOUS || field == OWN_MAGNET || field == OWN_DETENTS;
}

bool own_field_drives(own_field field)
{
  return field == OWN_VIBRATION || field == OWN_UNTOLD;
}

static bool is_surface(own_field field)
{
  return field == OWN_TEXTURE || field == OWN_ADHESION || field == OWN_SNAP;
}

/* Whether the surface's stiffness is that of the point. */
static bool is_hard(own_field field)
{
  return field == OWN_TEXTURE || field == OWN_ADHESION;
}

static bool is_grab(own_field field)
{
  return field == OWN_GRAB_SOFT || field == OWN_GRAB_RIGID;
}

/* ---- the bed ---- */

static double wash_height(void *arg, const double point[3])
{
  (void)arg;
  return HEIGHT * sin(2.0 * M_PI * point[0] / WAVE);
}

static void surface_say(void *user, hap_pointer_id pointer, dGeomID geom, hap_surface *io)
{
  const own_bed *s = user;
  (void)pointer;
  if (s->point->field == OWN_TEXTURE) {
    io->texture = s->texture;
  } else if (s->point->field == OWN_ADHESION) {
    io->adhesion = PULL;
  } else if (dGeomGetBody(geom) == s->cube) {
    io->magnet_force = s->pull;
    io->magnet_reach = s->reach;
  }
}

static void call_spring(void *user, const hap_force_tick *tick, hap_wrench *out)
{
  const own_bed *s = user;
  const hap_force_hand *hand = tick->hands[tick->self];
  hapi_v3_scale(-s->point->stiffness, hand->pose.position, out->force);
}

static void write_spec(const own_point *p, char out[512])
{
  double step = 1.0 / p->haptic_hz;
  int length =
      snprintf(out, 512, "virtual:max_force=%g,device_mass=%g,device_damping=%g,delay=%.9g,hand=%s",
               LIMIT, STABILITY_DEVICE_MASS, STABILITY_DEVICE_DAMPING, p->delay_ticks * step,
               stability_hand_word(p->hand));
  if (p->quantum > 0.0) {
    length += snprintf(out + length, 512 - (size_t)length, ",quantum=%g", p->quantum);
  }
  if (p->hand == STABILITY_NONE) { /* as fast as takes the field to 1 mm, if the device holds it */
    double held =
        fmin(p->stiffness, 0.8 * STABILITY_DEVICE_DAMPING / ((0.5 + p->delay_ticks) * step));
    double speed = PUSH * sqrt(held / STABILITY_DEVICE_MASS);
    snprintf(out + length, 512 - (size_t)length, ",kick=%g:%.9g/0/%.9g", BEGIN_S, speed, -speed);
    return;
  }
  snprintf(out + length, 512 - (size_t)length,
           ",path=0:0/0/0;%g:0/0/0;%g:0/0/%g;%g:%g/0/%g;%g:%g/0/%g;%g:0/0/%g", BEGIN_S,
           BEGIN_S + 0.02, -PUSH, BEGIN_S + 0.12, STROKE, -PUSH, BEGIN_S + 0.32, -STROKE, -PUSH,
           BEGIN_S + 0.42, -PUSH);
}

static void field_define(own_bed *s)
{
  static const hap_force_kind kinds[] = {
      [OWN_SPRING] = HAP_FORCE_SPRING,       [OWN_VISCOUS] = HAP_FORCE_VISCOUS,
      [OWN_MAGNET] = HAP_FORCE_MAGNET,       [OWN_DETENTS] = HAP_FORCE_DETENTS,
      [OWN_VIBRATION] = HAP_FORCE_VIBRATION, [OWN_CALL] = HAP_FORCE_CALL,
      [OWN_UNTOLD] = HAP_FORCE_CALL,
  };
  const own_point *p = s->point;
  const bool pulls = p->field == OWN_MAGNET || p->field == OWN_DETENTS;
  hap_force_def_init(&s->def, sizeof s->def);
  s->def.kind = (uint32_t)kinds[p->field];
  s->def.axis[0] = 1.0;
  s->def.axis[2] = p->field == OWN_DETENTS ? 0.0 : 1.0;
  s->def.strength = pulls ? PULL : SHAKE;
  s->def.range = MAGNET_SLOPE * PULL / p->stiffness;
  s->def.pitch = 2.0 * M_PI * PULL / p->stiffness;
  s->def.stiffness = p->field == OWN_UNTOLD ? 0.0 : p->stiffness;
  s->def.damping = p->field == OWN_VISCOUS ? 0.01 * p->stiffness : 0.0;
  s->def.vibration.hz = fmin(sqrt(p->stiffness), 0.4 * p->haptic_hz);
  s->def.max_force = pulls ? PULL : p->field == OWN_VIBRATION ? SHAKE : PROMISE;
  if (s->def.kind == HAP_FORCE_CALL) {
    s->def.call = call_spring;
    s->def.user = s;
    s->def.call_most_s = 0.5 / p->haptic_hz;
  }
  if (p->bound) {
    s->def.frame = HAP_FORCE_BODY;
    s->def.body = s->cube;
    s->def.origin[2] = HALF + RADIUS + GAP;
  }
}

/* HAP_SATURATED: it was cut; HAP_ERROR_ARGUMENT: refused. */
static hap_status field_add(own_bed *s)
{
  const own_point *p = s->point;
  hap_grab_def grab;
  if (is_surface(p->field)) {
    s->def.max_force = p->field == OWN_SNAP ? s->pull : 0.0; /* docs/surfaces.md */
    return HAP_OK;
  }
  if (!is_grab(p->field)) {
    field_define(s);
    return hap_pointer_force_add(s->session, s->pointer, &s->def, &s->force);
  }
  hap_grab_def_init(&grab, sizeof grab);
  grab.stiffness = p->field == OWN_GRAB_SOFT ? p->stiffness : 0.0;
  return hap_pointer_attach(s->session, s->pointer, s->cube, &grab);
}

static void bed_build(own_bed *s)
{
  dMass mass;
  s->world = dWorldCreate();
  s->space = dHashSpaceCreate(NULL);
  dWorldSetCFM(s->world, 1e-12);
  dWorldSetContactSurfaceLayer(s->world, 1e-5);
  const double middle = -(HALF + RADIUS + GAP); /* the hand begins at the origin */
  s->cube = dBodyCreate(s->world);
  dMassSetBoxTotal(&mass, s->point->mass, 2.0 * HALF, 2.0 * HALF, 2.0 * HALF);
  dBodySetMass(s->cube, &mass);
  dBodySetPosition(s->cube, 0.0, 0.0, middle);
  dGeomSetBody(dCreateBox(s->space, 2.0 * HALF, 2.0 * HALF, 2.0 * HALF), s->cube);
  if (s->point->floored) {
    (void)dCreatePlane(s->space, 0.0, 0.0, 1.0, middle - HALF);
  }
}

static hap_status session_open(bench *b, own_bed *s)
{
  hap_session_def def;
  hap_expert_def expert;
  hap_research_def research;
  hap_ode_def ode;
  hap_pointer_def pointer;
  hap_pointer_expert_def pointer_expert;
  hap_pointer_research_def pointer_research;
  hap_texture_def wash;
  char spec[512];
  session_defs_init(&def, &expert, &research);
  hap_ode_def_init(&ode, sizeof ode);
  pointer_defs_init(&pointer, &pointer_expert, &pointer_research);
  hap_texture_def_init(&wash, sizeof wash);
  def.drive = HAP_DRIVE_LOCKSTEP;
  def.haptic_hz = s->point->haptic_hz;
  def.max_bodies = 4; /* room is time: it is cleared for each point */
  def.max_contacts = 64;
  def.max_pointers = 1;
  research.guard = s->point->guarded ? HAP_GUARD_ON : HAP_GUARD_MEASURE;
  ode.world = s->world;
  ode.space = s->space;
  ode.pointer_surface = is_surface(s->point->field) ? surface_say : NULL;
  ode.user = s;
  ode.magnet_reach = s->point->field == OWN_SNAP ? REACH_MOST : 0.0;
  pointer.radius = RADIUS;
  pointer.stiffness = is_hard(s->point->field) ? s->point->stiffness : CONTACT;
  pointer.max_force = LIMIT;
  pointer_expert.coupling = s->point->coupling;
  wash.height = wash_height;
  write_spec(s->point, spec);
  HAPI_TRY(hap_device_open(spec, &s->device, &b->detail));
  pointer.device = s->device;
  HAPI_TRY(hap_session_create(&def, &ode, &s->session, &b->detail));
  hap_status status = hap_session_add_texture(s->session, &wash, &s->texture);
  status = status >= HAP_OK ? hap_pointer_add(s->session, &pointer, &s->pointer) : status;
  status = status >= HAP_OK ? hap_session_start(s->session) : status;
  status = status >= HAP_OK ? hap_session_advance(s->session, 2) : status; /* the cube is known */
  return bench_explain(b, s->session, status);
}

static void bed_close(own_bed *s)
{
  hap_session_destroy(s->session);
  if (s->device != NULL) {
    hap_device_close(s->device);
  }
  dSpaceDestroy(s->space);
  dWorldDestroy(s->world);
}

/* ---- energy ---- */

static void cube_look(own_bed *s)
{
  const hapi_tick *tick = &s->session->haptic->tick;
  const hapi_physics *physics = s->session->physics;
  const double inertia = 2.0 / 3.0 * s->point->mass * HALF * HALF;
  double v[3];
  double w[3];
  hapi_v3_copy(dBodyGetPosition(s->cube), s->at);
  hapi_v3_copy(dBodyGetLinearVel(s->cube), v);
  hapi_v3_copy(dBodyGetAngularVel(s->cube), w);
  for (uint32_t i = 0; i < tick->bodies.live_count; ++i) {
    const hapi_local_body *body = &tick->bodies.of[tick->bodies.live[i]];
    uint32_t known = physics->near.slots.bodies[tick->bodies.live[i]].known;
    if (known != HAPI_NONE && physics->world.bodies.entries[known].body == s->cube) {
      hapi_v3_copy(body->pose.position, s->at);
      hapi_v3_copy(body->twist.linear, v);
      hapi_v3_copy(body->twist.angular, w);
    }
  }
  s->speed = hapi_v3_norm(v);
  s->kinetic = 0.5 * s->point->mass * hapi_v3_dot(v, v) + 0.5 * inertia * hapi_v3_dot(w, w);
}

/* The whole of a magnet's well: what is counted too much is cut to what was taken. */
static double snap_energy(const own_bed *s)
{
  return 0.25 * MAGNET_SLOPE * s->pull * s->reach;
}

/* J, of the field: no more than it can hold. A cube that turns is left out: what is counted too
 * much is cut to what was taken. */
static double field_energy(const own_bed *s)
{
  const hapi_pointer *p = &s->session->haptic->tick.pointers.of[0];
  double way[3];
  hapi_v3_copy(p->handle.position, way);
  if (s->point->bound) {
    hapi_v3_sub(way, s->at, way);
    way[2] -= s->def.origin[2];
  }
  double length2 = hapi_v3_dot(way, way);
  switch (s->point->field) {
    case OWN_SPRING:
    case OWN_CALL:
    case OWN_UNTOLD:
      return 0.5 * s->stiffness * length2;
    case OWN_MAGNET: {
      double u2 = fmin(length2 / (s->def.range * s->def.range), 1.0);
      double depth = 0.25 * MAGNET_SLOPE * s->def.strength * s->def.range;
      return depth * (1.0 - (1.0 - u2) * (1.0 - u2));
    }
    case OWN_SNAP:
      return snap_energy(s);
    case OWN_DETENTS:
      return s->def.strength * s->def.pitch / (2.0 * M_PI) *
             (1.0 - cos(2.0 * M_PI * way[0] / s->def.pitch));
    case OWN_GRAB_SOFT:
    case OWN_GRAB_RIGID:
      return p->grab.ledger.sprung;
    case OWN_VISCOUS:
    case OWN_VIBRATION:
    case OWN_TEXTURE:
    case OWN_ADHESION: /* its spring is the contact's */
    case OWN_FIELDS:
      break;
  }
  return 0.0;
}

static double springs_energy(const own_bed *s)
{
  const hapi_tick *tick = &s->session->haptic->tick;
  const hapi_pointer *p = &tick->pointers.of[0];
  const double contact = is_hard(s->point->field) ? s->point->stiffness : CONTACT;
  double sum = field_energy(s);
  for (uint32_t i = 0; i < tick->touches.count; ++i) {
    const double *force = tick->touches.of[i].force;
    sum += 0.5 * hapi_v3_dot(force, force) / contact;
  }
  return sum + stability_coupling_energy(p);
}

/* ---- the run ---- */

/* False: more than is promised. */
static bool tick_run(own_bed *s, double seconds, hapi_virtual_port *port, own_result *out)
{
  const hapi_virtual_port was = *port;
  hap_pointer_state state;
  (void)hap_session_advance(s->session, 1);
  cube_look(s);
  hapi_virtual_get_port(hapi_device_self(s->device), port);
  stability_account_tick(&s->energy, &was, port, 1.0 / s->point->haptic_hz, s->kinetic,
                         springs_energy(s));
  if (hap_pointer_get(s->session, s->pointer, &state, sizeof state) < HAP_OK) {
    return false;
  }
  bool has = s->def.max_force > 0.0;
  double own = has ? hapi_v3_norm(state.own.force) / s->def.max_force : 0.0;
  double power = has ? s->def.max_force * 1.0 : 0.0; /* docs/forces.md: at 1 m/s */
  out->force = fmax(out->force, hapi_v3_norm(state.wrench.force));
  out->own = fmax(out->own, own);
  out->made = s->energy.made;
  double promised = power * (seconds + POWER_S) + 0.01 * s->energy.stored;
  return out->force <= LIMIT * (1.0 + 1e-9) && out->own <= 1.0 + 1e-9 &&
         (!has || s->energy.made <= promised);
}

hap_status own_run(bench *b, const own_point *point, double seconds, own_result *out)
{
  own_bed s;
  hapi_virtual_port port;
  memset(out, 0, sizeof *out);
  memset(&s, 0, sizeof s);
  s.point = point;
  s.energy.finite = true;
  s.reach = fmin(fmax(MAGNET_SLOPE * PULL / point->stiffness, REACH_LEAST), REACH_MOST);
  s.pull = point->stiffness * s.reach / MAGNET_SLOPE;
  bed_build(&s);
  hap_status status = session_open(b, &s);
  if (status >= HAP_OK) {
    hap_status added = field_add(&s);
    double held = s.session->haptic->tick.pointers.of[0].coupling.hold;
    out->refused = added == HAP_ERROR_ARGUMENT;
    out->cut = added == HAP_SATURATED;
    s.stiffness = out->cut ? fmin(point->stiffness, held) : point->stiffness;
    status = bench_explain(b, s.session, out->refused ? HAP_OK : added);
  }
  if (status >= HAP_OK) {
    uint64_t ticks = (uint64_t)llround(seconds * point->haptic_hz);
    bool good = true;
    hapi_virtual_get_port(hapi_device_self(s.device), &port);
    for (uint64_t i = 0; i < ticks && s.energy.finite && !out->refused; ++i) {
      good = tick_run(&s, (double)i / point->haptic_hz, &port, out) && good;
      if (10 * i >= 9 * ticks) {
        out->speed = fmax(out->speed, fmax(s.speed, hapi_v3_norm(port.velocity)));
      }
    }
    out->fault = s.session->haptic->tick.guard.latch.fault;
    out->energy_ratio = stability_account_ratio(&s.energy);
    out->bounded = out->refused || (good && s.energy.finite);
    out->stable =
        out->refused || (out->bounded && out->fault == HAP_FAULT_NONE &&
                         (own_field_drives(point->field) || out->energy_ratio <= STABILITY_RATIO));
  }
  bed_close(&s);
  return status < HAP_OK ? status : HAP_OK;
}
