/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/hapode.h>
#include <hapode/ode.h>
#include <stdio.h>

/* 20 g and 0.2 N s/m: a light, slippery device. Nothing else holds it. */
#define DEVICE "virtual:hand=none,device_mass=0.02,device_damping=0.2,delay=0.001,kick=0.1:0.05/0/0"

static int buzz_count(dWorldID world, dSpaceID space, hap_coupling coupling)
{
  hap_detail why = {""};
  hap_session_def session_def;
  hap_ode_def ode_def;
  hap_pointer_def hand_def;
  hap_pointer_expert_def expert;
  hap_session_def_init(&session_def, sizeof session_def);
  hap_ode_def_init(&ode_def, sizeof ode_def);
  hap_pointer_def_init(&hand_def, sizeof hand_def);
  hap_pointer_expert_def_init(&expert, sizeof expert);
  session_def.drive = HAP_DRIVE_LOCKSTEP; /* no clock: the program ends at once */
  ode_def.world = world, ode_def.space = space;
  hand_def.stiffness = 5000;
  hand_def.expert = &expert;
  expert.coupling = coupling;
  hap_session *session;
  hap_pointer_id hand;
  if (hap_session_create(&session_def, &ode_def, &session, &why) < HAP_OK ||
      hap_device_open(DEVICE, &hand_def.device, &why) < HAP_OK ||
      hap_pointer_add(session, &hand_def, &hand) < HAP_OK || hap_session_start(session) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  hap_pointer_state state;
  int turns = 0;
  int held_back = 0;
  double last = 0.0;
  double spring = 0.0;
  for (int tick = 0; tick < 2000; ++tick) { /* a buzz: the hand turns round many times a second */
    if (hap_session_advance(session, 1) < HAP_OK) {
      break;
    }
    hap_pointer_get(session, hand, &state, sizeof state);
    turns += state.twist.linear[0] * last < 0.0;
    held_back += (state.guard & HAP_GUARD_ENERGY) != 0;
    spring = state.coupling_stiffness > spring ? state.coupling_stiffness : spring;
    last = state.twist.linear[0];
  }
  printf("%-6s: %2d turns, energy held back in %3d ticks, proxy's spring %.0f N/m\n",
         hap_coupling_name(coupling), turns, held_back, spring);
  hap_session_destroy(session);
  hap_device_close(hand_def.device);
  return 0;
}

int main(void)
{
  dInitODE2(0);
  dWorldID world = dWorldCreate();
  dSpaceID space = dHashSpaceCreate(NULL);
  dCreatePlane(space, -1.0, 0.0, 0.0, -0.012); /* walls on both sides of the free pointer */
  dCreatePlane(space, 1.0, 0.0, 0.0, -0.012);
  return buzz_count(world, space, HAP_COUPLING_DIRECT) |
         buzz_count(world, space, HAP_COUPLING_AUTO);
}
