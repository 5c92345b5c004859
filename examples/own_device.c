/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/device_impl.h>
#include <hapode/hapode.h>
#include <hapode/ode.h>
#include <math.h>
#include <stdio.h>

/* A device in the program: a hand that bobs, and feels a force [N]. */
static hap_status bob_open(void *context, const char *args, void **self, hap_detail *detail)
{
  (void)args, (void)detail;
  *self = context;
  return HAP_OK;
}

static void bob_describe(void *self, uint32_t effector, hap_device_info *out)
{
  (void)self, (void)effector;
  out->dof = 3, out->max_force = 5, out->measures_velocity = 1;
}

static hap_status bob_start(void *self)
{
  return *(double *)self = 0, HAP_OK;
}

static hap_status bob_read(void *self, int64_t time_ns, hap_device_input *const out[])
{
  double t = 1e-9 * (double)time_ns;
  (void)self;
  out[0]->pose = (hap_pose){{0, 0, 0.02 + 0.012 * cos(6 * t)}, {1, 0, 0, 0}};
  out[0]->twist = (hap_twist){{0, 0, -0.072 * sin(6 * t)}, {0, 0, 0}};
  out[0]->buttons = 0;
  return HAP_OK;
}

static hap_status bob_write(void *self, const hap_device_output *const wanted[],
                            hap_device_output *const reached[])
{
  *(double *)self = wanted[0]->wrench.force[2]; /* a motor would be told here */
  reached[0]->wrench = wanted[0]->wrench;
  return HAP_OK;
}

static void bob_off(void *self)
{
  *(double *)self = 0;
}

int main(void)
{
  const hap_device_ops ops = {HAP_DEVICE_ABI, sizeof ops,   "bob",     "bobs",   HAP_PACING_VIRTUAL,
                              bob_open,       bob_describe, bob_start, bob_read, bob_write,
                              bob_off,        bob_off,      bob_off};
  double force = 0;
  hap_detail why = {""};
  hap_session *session;
  hap_session_def def;
  hap_ode_def ode;
  hap_pointer_def hand_def;
  dInitODE2(0);
  hap_session_def_init(&def, sizeof def);
  hap_ode_def_init(&ode, sizeof ode);
  hap_pointer_def_init(&hand_def, sizeof hand_def);
  def.drive = HAP_DRIVE_LOCKSTEP, ode.world = dWorldCreate(), ode.space = dHashSpaceCreate(NULL);
  dCreatePlane(ode.space, 0, 0, 1, 0);
  if (hap_session_create(&def, &ode, &session, &why) < HAP_OK ||
      hap_device_create(&ops, &force, &hand_def.device, &why) < HAP_OK ||
      hap_pointer_add(session, &hand_def, &(hap_pointer_id){0}) < HAP_OK ||
      hap_session_start(session) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  for (int i = 0; i < 10 && hap_session_advance(session, 100) >= HAP_OK; ++i) {
    printf("%.1f s  %.2f N\n", 0.1 * (i + 1), force);
  }
  hap_session_destroy(session);
  hap_device_close(hand_def.device);
  return 0;
}
