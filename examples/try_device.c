/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#define _POSIX_C_SOURCE 200809L /* nanosleep */
#include <hapode/hapode.h>
#include <hapode/ode.h>
#include <stdio.h>
#include <time.h>

int main(int argc, char **argv)
{
  const char *spec = argc > 1 ? argv[1] : "virtual:sine=0.05/0/0,hz=1";
  const char *about;
  for (size_t i = 0; hap_device_name_at(i, &about) != NULL; ++i) {
    printf("%s: %s\n", hap_device_name_at(i, &about), about);
  }
  dInitODE2(0);
  hap_detail why = {""};
  hap_session_def session_def;
  hap_ode_def ode_def;
  hap_pointer_def hand_def;
  hap_device_info info;
  hap_session_def_init(&session_def, sizeof session_def);
  hap_ode_def_init(&ode_def, sizeof ode_def);
  hap_pointer_def_init(&hand_def, sizeof hand_def);
  ode_def.world = dWorldCreate(), ode_def.space = dHashSpaceCreate(NULL); /* nothing to touch */
  hap_session *session;
  hap_pointer_id hand;
  if (hap_device_open(spec, &hand_def.device, &why) < HAP_OK ||
      hap_device_get_info(hand_def.device, &info, sizeof info) < HAP_OK ||
      hap_session_create(&session_def, &ode_def, &session, &why) < HAP_OK ||
      hap_pointer_add(session, &hand_def, &hand) < HAP_OK || hap_session_start(session) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  printf("%s: %u degrees of freedom, up to %.1f N\n", info.name, info.dof, info.max_force);
  for (int i = 0; i < 10; ++i) {
    hap_pointer_state state;
    nanosleep(&(struct timespec){.tv_nsec = 100000000}, NULL);
    hap_pointer_get(session, hand, &state, sizeof state);
    printf("at %.4f %.4f %.4f m\n", state.device.position[0], state.device.position[1],
           state.device.position[2]);
  }
  hap_session_destroy(session);
  hap_device_close(hand_def.device);
  return 0;
}
