/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "bench/app_stand.h"

#include <string.h>

#include <hapode/device_impl.h>

#include "base/log.h"
#include "tools/session_defs.h"

static void stand_surface(void *user, hap_pointer_id pointer, dGeomID geom, hap_surface *io)
{
  const app_stand *s = user;
  (void)pointer;
  (void)geom;
  if (s->says.size != 0) {
    *io = s->says;
  }
}

void stand_init(bench *b, app_stand *s, double gravity)
{
  memset(s, 0, sizeof *s);
  s->bench = b;
  s->world = dWorldCreate();
  s->space = dHashSpaceCreate(NULL);
  dWorldSetGravity(s->world, 0.0, 0.0, -gravity);
  dWorldSetCFM(s->world, 1e-12);
  dWorldSetContactSurfaceLayer(s->world, 1e-4);
  dWorldSetQuickStepNumIterations(s->world, 50);
  session_defs_init(&s->def, &s->expert, &s->research);
  s->def.drive = HAP_DRIVE_LOCKSTEP;
  hap_ode_def_init(&s->ode, sizeof s->ode);
  s->ode.world = s->world;
  s->ode.space = s->space;
  s->ode.pointer_surface = stand_surface;
  s->ode.user = s;
  pointer_defs_init(&s->hand_def, &s->hand_expert, &s->hand_research);
  s->hand_def.radius = STAND_RADIUS;
  s->hand_def.stiffness = STAND_STIFFNESS;
  s->hand_def.damping = 0.0;
  s->hand_def.max_force = STAND_FORCE_MOST;
}

dBodyID stand_box(dWorldID world, dSpaceID space, double mass, const double edges[3],
                  const double at[3])
{
  dMass m;
  dBodyID body = dBodyCreate(world);
  dMassSetBoxTotal(&m, mass, edges[0], edges[1], edges[2]);
  dBodySetMass(body, &m);
  dBodySetPosition(body, at[0], at[1], at[2]);
  dGeomSetBody(dCreateBox(space, edges[0], edges[1], edges[2]), body);
  return body;
}

/* ---- a device ---- */

static hap_status keeper_open(void *context, const char *args, void **self, hap_detail *detail)
{
  (void)args;
  (void)detail;
  *self = context;
  return HAP_OK;
}

static void keeper_describe(void *self, uint32_t effector, hap_device_info *out)
{
  (void)self;
  (void)effector;
  out->dof = 3;
  out->max_force = STAND_FORCE_MOST;
  out->measures_velocity = 1;
}

static hap_status keeper_start(void *self)
{
  (void)self;
  return HAP_OK;
}

static hap_status keeper_read(void *self, int64_t time_ns, hap_device_input *const out[])
{
  const app_stand *s = self;
  (void)time_ns;
  out[0]->pose = (hap_pose){{s->at[0], s->at[1], s->at[2]}, {1.0, 0.0, 0.0, 0.0}};
  out[0]->twist = (hap_twist){{s->velocity[0], s->velocity[1], s->velocity[2]}, {0.0, 0.0, 0.0}};
  out[0]->buttons = 0;
  return HAP_OK;
}

static hap_status keeper_write(void *self, const hap_device_output *const wanted[],
                               hap_device_output *const reached[])
{
  app_stand *s = self;
  memcpy(s->written, wanted[0]->wrench.force, sizeof s->written);
  reached[0]->wrench = wanted[0]->wrench;
  return HAP_OK;
}

static void keeper_off(void *self)
{
  app_stand *s = self;
  memset(s->written, 0, sizeof s->written);
}

hap_status stand_device(app_stand *s)
{
  static const hap_device_ops ops = {.abi = HAP_DEVICE_ABI,
                                     .size = sizeof ops,
                                     .name = "keeper",
                                     .help = "keeps what is written",
                                     .pacing = HAP_PACING_VIRTUAL,
                                     .open = keeper_open,
                                     .describe = keeper_describe,
                                     .start = keeper_start,
                                     .read = keeper_read,
                                     .write = keeper_write,
                                     .zero = keeper_off,
                                     .stop = keeper_off,
                                     .close = keeper_off};
  hap_status status = hap_device_create(&ops, s, &s->device, &s->bench->detail);
  s->hand_def.device = s->device;
  return status;
}

/* ---- a session ---- */

static hap_status stand_lead(app_stand *s)
{
  if (s->device != NULL) {
    return HAP_OK;
  }
  hap_pose pose = {{s->at[0], s->at[1], s->at[2]}, {1.0, 0.0, 0.0, 0.0}};
  hap_twist twist = {{s->velocity[0], s->velocity[1], s->velocity[2]}, {0.0, 0.0, 0.0}};
  return hap_pointer_set_target(s->session, s->hand, &pose, &twist);
}

hap_status stand_open(app_stand *s)
{
  hap_status status = hap_session_create(&s->def, &s->ode, &s->session, &s->bench->detail);
  HAPI_TRY(status);
  status = hap_pointer_add(s->session, &s->hand_def, &s->hand);
  status = status >= HAP_OK ? stand_lead(s) : status;
  return bench_explain(s->bench, s->session, status);
}

hap_status stand_run(app_stand *s)
{
  return bench_explain(s->bench, s->session, hap_session_start(s->session));
}

hap_status stand_tick(app_stand *s)
{
  hap_status status = stand_lead(s);
  status = status >= HAP_OK ? hap_session_advance(s->session, 1) : status;
  if (status > HAP_OK) { /* a fault: nothing here is one */
    return bench_fail(s->bench, HAP_ERROR_STATE, "a tick ended with: %s", hap_status_text(status));
  }
  if (status >= HAP_OK) {
    status = hap_pointer_get(s->session, s->hand, &s->felt, sizeof s->felt);
  }
  return bench_explain(s->bench, s->session, status);
}

hap_status stand_wait(app_stand *s, int ticks)
{
  memset(s->velocity, 0, sizeof s->velocity);
  for (int i = 0; i < ticks; ++i) {
    HAPI_TRY(stand_tick(s));
  }
  return HAP_OK;
}

hap_status stand_glide(app_stand *s, double x, double y, double z, int ticks)
{
  const double way[3] = {x, y, z};
  for (int i = 0; i < ticks; ++i) {
    for (int k = 0; k < 3; ++k) {
      s->at[k] += way[k] / ticks;
      s->velocity[k] = way[k] / ticks * s->def.haptic_hz;
    }
    HAPI_TRY(stand_tick(s));
  }
  return HAP_OK;
}

void stand_finish(app_stand *s)
{
  hap_session_destroy(s->session);
  hap_device_close(s->device);
  if (s->world != NULL) {
    dSpaceDestroy(s->space);
    dWorldDestroy(s->world);
  }
  memset(s, 0, sizeof *s);
}
