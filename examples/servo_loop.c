/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/hapode.h>
#include <math.h>
#include <stdio.h>

#define RADIUS_MM 40.0
#define STIFFNESS_N_PER_MM 0.25

/* A servo callback as it was: millimetres in, newtons out, a ball that does not move. */
static void old_callback(const double position_mm[3], double force[3])
{
  double distance = sqrt(position_mm[0] * position_mm[0] + position_mm[1] * position_mm[1] +
                         position_mm[2] * position_mm[2]);
  double depth = distance > 0 ? fmax(RADIUS_MM - distance, 0) : 0;
  for (int i = 0; i < 3; ++i) {
    force[i] = depth > 0 ? STIFFNESS_N_PER_MM * depth * position_mm[i] / distance : 0;
  }
}

/* The same callback in the tick. What it must not do here: wait, allocate, print. */
static void old_callback_call(void *user, const hap_force_tick *tick, hap_wrench *out)
{
  const double *at = tick->hands[tick->self]->pose.position;
  (void)user;
  old_callback((double[]){1e3 * at[0], 1e3 * at[1], 1e3 * at[2]}, out->force);
}

/* A hand presses on the ball from above; with is_call by the old code, else on a geom. */
static int ball_feel(int is_call)
{
  hap_detail why = {""};
  hap_scene *scene = NULL;
  hap_session *session = NULL;
  hap_session_def session_def;
  hap_geom_def ball;
  hap_pointer_def hand_def;
  hap_pointer_id hand;
  hap_force_def force;
  hap_session_def_init(&session_def, sizeof session_def);
  hap_geom_def_init(&ball, sizeof ball);
  hap_pointer_def_init(&hand_def, sizeof hand_def);
  hap_force_def_init(&force, sizeof force);
  session_def.drive = HAP_DRIVE_LOCKSTEP; /* no clock: the program ends at once */
  ball.radius = 0.039, hand_def.radius = 0.001;
  hand_def.stiffness = 1e3 * STIFFNESS_N_PER_MM;
  force.kind = HAP_FORCE_CALL, force.call = old_callback_call;
  force.stiffness = 1e3 * STIFFNESS_N_PER_MM, force.max_force = 3.0;
  hap_status s = hap_scene_create(NULL, &scene, &why);
  if (s >= HAP_OK && !is_call) {
    s = hap_scene_add_geom(scene, &ball, &(uint32_t){0}, &why);
  }
  if (s < HAP_OK || hap_scene_session(scene, &session_def, &session, &why) < HAP_OK ||
      hap_device_open("virtual:path=0:0/0/0.06;2:0/0/0.03", &hand_def.device, &why) < HAP_OK ||
      hap_pointer_add(session, &hand_def, &hand) < HAP_OK ||
      (is_call && hap_pointer_force_add(session, hand, &force, &(hap_force_id){0}) < HAP_OK) ||
      hap_session_start(session) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  for (int i = 0; i < 5 && hap_session_advance(session, 400) >= HAP_OK; ++i) {
    hap_pointer_state state;
    (void)hap_pointer_get(session, hand, &state, sizeof state);
    printf("%s: at %.2f mm %.3f N\n", is_call ? "call" : "geom", 1e3 * state.device.position[2],
           state.wrench.force[2]);
  }
  hap_session_destroy(session);
  hap_device_close(hand_def.device);
  return hap_scene_destroy(scene) < HAP_OK;
}

int main(void)
{
  return ball_feel(1) | ball_feel(0);
}
