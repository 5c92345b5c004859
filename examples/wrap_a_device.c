/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/device_impl.h>
#include <hapode/hapode.h>
#include <stdio.h>

/* A device around another: a tool for a trembling hand. It passes on a calmer pose, and notes the
 * largest force that went to the motors. */
typedef struct calmer {
  hap_device *inner;
  hap_pose pose; /* as passed on */
  double most;   /* N */
  int begun;
} calmer;

static hap_status calmer_read(void *self, int64_t time_ns, hap_device_input *const out[])
{
  calmer *c = self;
  hap_status status = hap_device_read(c->inner, time_ns, out);
  for (int i = 0; i < 3 && status >= HAP_OK; ++i) {
    double moved = out[0]->pose.position[i] - c->pose.position[i];
    c->pose.position[i] += c->begun ? 0.02 * moved : moved; /* of 1 kHz: a low pass of 3 Hz */
    out[0]->pose.position[i] = c->pose.position[i];
  }
  c->begun = 1;
  return status;
}

static hap_status calmer_write(void *self, const hap_device_output *const wanted[],
                               hap_device_output *const reached[])
{
  calmer *c = self;
  double force = wanted[0]->wrench.force[2];
  c->most = force > c->most ? force : c->most;
  return hap_device_write(c->inner, wanted, reached);
}

static void calmer_describe(void *self, uint32_t effector, hap_device_info *io)
{
  (void)self, (void)effector;
  io->measures_velocity = 0; /* the twist is not that of the pose */
}

int main(void)
{
  const hap_device_ops ops = {HAP_DEVICE_ABI,  sizeof ops, "calmer",    "a low pass", 0, NULL,
                              calmer_describe, NULL,       calmer_read, calmer_write};
  calmer c = {.begun = 0};
  hap_detail why = {""};
  hap_scene *scene;
  hap_session *session;
  hap_session_def def;
  hap_pointer_def hand_def;
  hap_pointer_id hand;
  hap_device_info info;
  hap_geom_def floor;
  hap_session_def_init(&def, sizeof def);
  hap_pointer_def_init(&hand_def, sizeof hand_def);
  hap_geom_def_init(&floor, sizeof floor);
  def.drive = HAP_DRIVE_LOCKSTEP;
  floor.shape = HAP_SHAPE_PLANE;
  if (hap_device_open("virtual:path=0:0/0/0.009,sine=0/0/0.001,hz=10", &c.inner, &why) < HAP_OK ||
      hap_device_wrap(c.inner, &ops, &c, &hand_def.device, &why) < HAP_OK ||
      hap_device_get_effector(hand_def.device, 0, &info, sizeof info) < HAP_OK ||
      hap_scene_create(NULL, &scene, &why) < HAP_OK ||
      hap_scene_add_geom(scene, &floor, NULL, &why) < HAP_OK ||
      hap_scene_session(scene, &def, &session, &why) < HAP_OK ||
      hap_pointer_add(session, &hand_def, &hand) < HAP_OK || hap_session_start(session) < HAP_OK ||
      hap_session_advance(session, 2000) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  printf("at most %.2f N, of %g that the device can\n", c.most, info.max_force);
  hap_session_destroy(session);
  hap_device_close(hand_def.device);
  hap_device_close(c.inner);
  return hap_scene_destroy(scene) < HAP_OK;
}
