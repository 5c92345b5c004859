/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/hapode.h>
#include <hapode/ode.h>
#include <stdio.h>

#define PLATFORM 2u /* category bits of what only bodies touch */

static int platform_name;

/* [physics, contact] A contact of the platform is one if the box lies on it or comes from above. */
static bool platform_contact(void *user, hap_contact *io)
{
  (void)user;
  double up = io->data_b == &platform_name ? 1 : -1; /* the normal is out of b */
  if (io->data_a != &platform_name && io->data_b != &platform_name) {
    return true;
  }
  return up * io->normal[2] > 0.7 && up * io->velocity[2] < 0.01 && io->depth < 0.005;
}

int main(void)
{
  dInitODE2(0);
  dWorldID world = dWorldCreate();
  dSpaceID space = dHashSpaceCreate(NULL);
  dSpaceID level = dSimpleSpaceCreate(NULL); /* what stands, in a space of its own */
  dWorldSetGravity(world, 0, 0, -9.81);
  dWorldSetContactSurfaceLayer(world, 0.0001);
  dGeomID platform = dCreateBox(level, 0.4, 0.4, 0.004);
  dGeomSetData(platform, &platform_name);
  dGeomSetCategoryBits(platform, PLATFORM);
  dBodyID box = dBodyCreate(world);
  dMass mass;
  dMassSetBoxTotal(&mass, 0.3, 0.1, 0.1, 0.04);
  dBodySetMass(box, &mass);
  dBodySetPosition(box, 0, 0, -0.1);
  dGeomSetBody(dCreateBox(space, 0.1, 0.1, 0.04), box);
  dJointID rail = dJointCreateSlider(world, NULL); /* or the box falls off the fingertip */
  dJointAttach(rail, box, NULL);
  dJointSetSliderAxis(rail, 0, 0, 1);
  dJointSetSliderParam(rail, dParamLoStop, 0);

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
  ode.world = world, ode.space = space, ode.contact = platform_contact;
  hand_def.collide_bits = ~PLATFORM; /* the hand goes through */
  hand_def.damping = 10;             /* N s/m: the box comes to rest on it */
  if (hap_session_create(&def, &ode, &session, &why) < HAP_OK ||
      hap_session_add_space(session, level, HAP_SPACE_OTHERS) < HAP_OK ||
      hap_device_open("virtual:path=0:0/0/-0.14;2:0/0/0.02;3:0/0/0.02;4:0/0/-0.04",
                      &hand_def.device, &why) < HAP_OK ||
      hap_pointer_add(session, &hand_def, &hand) < HAP_OK || hap_session_start(session) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  for (int frame = 0; frame < 9; ++frame) {
    hap_pointer_state state;
    if (hap_session_advance(session, 500) < HAP_OK ||
        hap_pointer_get(session, hand, &state, sizeof state) < HAP_OK) {
      return 1;
    }
    printf("%.1f s  box %.3f m above the platform, hand feels %.2f N\n", 0.5 * (frame + 1),
           dBodyGetPosition(box)[2] - 0.0219, 0 - state.wrench.force[2]);
  }
  hap_session_lock(session); /* another level comes */
  hap_status gone = hap_session_remove_space(session, level);
  dSpaceDestroy(level);
  hap_session_unlock(session);
  hap_session_destroy(session);
  hap_device_close(hand_def.device);
  return gone < HAP_OK;
}
