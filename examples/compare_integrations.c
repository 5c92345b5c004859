/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/hapode.h>
#include <hapode/research.h>
#include <stdio.h>

/* A hand at 0.1 m/s hits a floating ball of 10 g on a spring [N/m]. A rule that keeps the energy
 * sends the ball off at 0.2 m/s; on a stiff spring the blow is over within a few ticks. */
static hap_status ball_hit(hap_integration rule, double stiffness, hap_detail *why)
{
  static const char *const names[] = {"auto", "explicit", "implicit", "midpoint"};
  hap_scene_def space;
  hap_scene *scene;
  hap_session *session;
  hap_session_def def;
  hap_pointer_def hand;
  hap_pointer_research_def research;
  hap_geom_def shape;
  hap_body_def ball;
  hap_scene_body after;
  hap_stats stats;
  hap_scene_def_init(&space, sizeof space);
  space.gravity[2] = 0;
  hap_session_def_init(&def, sizeof def);
  def.drive = HAP_DRIVE_LOCKSTEP;
  hap_geom_def_init(&shape, sizeof shape);
  shape.radius = 0.02;
  hap_body_def_init(&ball, sizeof ball);
  ball.geoms = &shape, ball.geom_count = 1, ball.mass = 0.01;
  hap_pointer_research_def_init(&research, sizeof research);
  research.integration = rule;
  hap_pointer_def_init(&hand, sizeof hand);
  hand.stiffness = stiffness, hand.research = &research;
  hap_status status = hap_scene_create(&space, &scene, why);
  if (status < HAP_OK || (status = hap_scene_add_body(scene, &ball, NULL, NULL, why)) < HAP_OK ||
      (status = hap_device_open("virtual:blend=linear,path=0:-0.05/0/0;1:0.05/0/0", &hand.device,
                                why)) < HAP_OK ||
      (status = hap_scene_session(scene, &def, &session, why)) < HAP_OK ||
      (status = hap_pointer_add(session, &hand, &(hap_pointer_id){0})) < HAP_OK ||
      (status = hap_session_start(session)) < HAP_OK ||
      (status = hap_session_advance(session, 600)) < HAP_OK ||
      (status = hap_scene_get_body(scene, 0, &after, sizeof after)) < HAP_OK ||
      (status = hap_session_stats(session, &stats, sizeof stats)) < HAP_OK) {
    return status;
  }
  printf("%5.0f N/m, %-8s: at most %.2f N, the ball leaves at %.3f m/s\n", stiffness, names[rule],
         stats.hand.peak_force_n, after.twist.linear[0]);
  hap_session_destroy(session);
  hap_device_close(hand.device);
  return hap_scene_destroy(scene);
}

int main(void)
{
  hap_detail why = {""};
  for (int rule = HAP_INTEGRATION_AUTO; rule <= HAP_INTEGRATION_MIDPOINT; ++rule) {
    if (ball_hit((hap_integration)rule, 2000, &why) < HAP_OK ||
        ball_hit((hap_integration)rule, 45000, &why) < HAP_OK) {
      return fprintf(stderr, "%s\n", why.text), 1;
    }
  }
  return 0;
}
