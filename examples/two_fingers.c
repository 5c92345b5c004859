/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/device_impl.h>
#include <hapode/hapode.h>
#include <math.h>
#include <stdio.h>

static double forces[2]; /* N, of the fingers of one device, which close on a cube and lift it */

static hap_status pinch_open(void *context, const char *args, void **self, hap_detail *detail)
{
  (void)context, (void)args, (void)detail;
  return *self = forces, HAP_OK;
}

static void pinch_describe(void *self, uint32_t finger, hap_device_info *out)
{
  (void)self, (void)finger;
  out->dof = 3, out->effector_count = 2, out->max_force = 8, out->quantum = 1e-5;
}

static void pinch_off(void *self)
{
  (void)self, forces[0] = forces[1] = 0;
}

static hap_status pinch_start(void *self)
{
  return pinch_off(self), HAP_OK;
}

static hap_status pinch_read(void *self, int64_t time_ns, hap_device_input *const out[])
{
  double t = 1e-9 * (double)time_ns, x = 0.05 - 0.0145 * fmin(t, 1), up = fmax(fmin(t, 2) - 1, 0);
  for (int i = 0; i < 2; ++i) {
    out[i]->pose = (hap_pose){{i == 0 ? -x : x, 0, 0.03 + 0.1 * up}, {1, 0, 0, 0}};
    out[i]->twist = (hap_twist){{0}, {0}}, out[i]->buttons = 0; /* not measured */
  }
  return (void)self, HAP_OK;
}

static hap_status pinch_write(void *self, const hap_device_output *const wanted[],
                              hap_device_output *const reached[])
{
  for (int i = 0; i < 2; ++i) { /* motors would be told here */
    forces[i] = wanted[i]->wrench.force[0], reached[i]->wrench = wanted[i]->wrench;
  }
  return (void)self, HAP_OK;
}

int main(void)
{
  const hap_device_ops ops = {HAP_DEVICE_ABI, sizeof ops,     "pinch",     "lifts",    0,
                              pinch_open,     pinch_describe, pinch_start, pinch_read, pinch_write,
                              pinch_off,      pinch_off,      pinch_off};
  hap_detail why = {""};
  hap_scene *scene;
  hap_session *session;
  hap_session_def def;
  hap_pointer_def finger;
  hap_pose cube;
  hap_session_def_init(&def, sizeof def);
  hap_pointer_def_init(&finger, sizeof finger);
  def.drive = HAP_DRIVE_LOCKSTEP, finger.friction = 0.8;
  if (hap_scene_load("grasp", &scene, &why) < HAP_OK ||
      hap_scene_session(scene, &def, &session, &why) < HAP_OK ||
      hap_device_create(&ops, NULL, &finger.device, &why) < HAP_OK ||
      hap_pointer_add(session, &finger, &(hap_pointer_id){0}) < HAP_OK || ++finger.effector != 1 ||
      hap_pointer_add(session, &finger, &(hap_pointer_id){0}) < HAP_OK ||
      hap_session_start(session) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  for (int i = 1; i <= 5 && hap_session_advance(session, 500) >= HAP_OK; ++i) {
    (void)hap_scene_poses(scene, hap_session_now(session), 0, 1, &cube);
    printf("%.2f and %.2f N, cube at %.3f m\n", forces[0], forces[1], cube.position[2]);
  }
  hap_session_destroy(session);
  hap_device_close(finger.device);
  return hap_scene_destroy(scene) < HAP_OK;
}
