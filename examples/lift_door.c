/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/hapode.h>
#include <hapode/ode.h>
#include <stdio.h>

/* A lift door is a kinematic body, which nobody can push. It opens again where a hand stops it. */
typedef struct lift_door {
  dBodyID body;
  double speed; /* m/s; closing is along -x */
} lift_door;

static void door_move(void *user, double step_s) /* after_step: for the step to come */
{
  lift_door *door = user;
  double edge = dBodyGetPosition(door->body)[0] - 0.1;
  bool ends = (door->speed < 0 && edge <= 0) || (door->speed > 0 && edge >= 0.2);
  door->speed = ends ? 0 : door->speed;
  dBodySetLinearVel(door->body, door->speed, 0, 0);
  (void)step_s;
}

static void door_open(void *arg) /* an edit: between two steps */
{
  ((lift_door *)arg)->speed = 0.2;
}

int main(void)
{
  lift_door door = {.speed = -0.1};
  dInitODE2(0);
  dWorldID world = dWorldCreate();
  dSpaceID space = dHashSpaceCreate(NULL);
  door.body = dBodyCreate(world);
  dBodySetKinematic(door.body);
  dBodySetPosition(door.body, 0.3, 0, 1);
  dGeomSetBody(dCreateBox(space, 0.2, 0.04, 2), door.body);

  hap_detail why = {""};
  hap_session *session;
  hap_session_def def;
  hap_ode_def ode;
  hap_pointer_def hand_def;
  hap_pointer_id hand;
  hap_session_def_init(&def, sizeof def);
  hap_ode_def_init(&ode, sizeof ode);
  hap_pointer_def_init(&hand_def, sizeof hand_def);
  def.drive = HAP_DRIVE_LOCKSTEP; /* no clock: the program ends at once */
  ode.world = world, ode.space = space, ode.user = &door, ode.after_step = door_move;
  hand_def.max_force = 6; /* a door has any force: this is what the person gets of it */
  if (hap_session_create(&def, &ode, &session, &why) < HAP_OK ||
      hap_device_open("virtual:hand=tense,path=0:0.1/0/1", &hand_def.device, &why) < HAP_OK ||
      hap_pointer_add(session, &hand_def, &hand) < HAP_OK || hap_session_start(session) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  for (int frame = 0; frame < 150; ++frame) {
    hap_touch touch;
    size_t count;
    hap_pointer_state state;
    if (hap_session_advance(session, 20) < HAP_OK ||
        hap_pointer_get(session, hand, &state, sizeof state) < HAP_OK) {
      return 1;
    }
    bool touched =
        hap_pointer_touches(session, hand, &touch, 1, sizeof touch, &count) == HAP_OK && count > 0;
    if (touched && touch.body == door.body && touch.force[0] < -3 && door.speed < 0) {
      printf("%.2f s  stopped by a hand: %.1f N\n", 0.02 * (frame + 1), -touch.force[0]);
      (void)hap_session_post(session, door_open, &door);
    }
    if (frame % 25 == 24) {
      printf("%.2f s  edge at %.3f m, hand feels %.2f N\n", 0.02 * (frame + 1),
             dBodyGetPosition(door.body)[0] - 0.1, -state.wrench.force[0]);
    }
  }
  hap_session_destroy(session);
  hap_device_close(hand_def.device);
  return 0;
}
