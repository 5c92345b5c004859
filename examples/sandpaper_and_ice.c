/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/hapode.h>
#include <hapode/ode.h>
#include <stdio.h>
#include <stdlib.h>

static char names[3][10] = {"ice", "sandpaper", "foam"};

/* [physics] Once for each geom that comes near the hand. */
static void surface_feel(void *user, hap_pointer_id pointer, dGeomID geom, hap_surface *io)
{
  const uint32_t *grains = user;
  (void)pointer;
  if (dGeomGetData(geom) == names[0]) {
    io->friction_static = 0.05;
    io->friction_dynamic = 0.03;
  } else if (dGeomGetData(geom) == names[1]) {
    io->friction_static = io->friction_dynamic = 0.4;
    io->texture = *grains;
  } else {
    io->stiffness = 250.0; /* N/m */
    io->damping = 2.0;     /* N s/m */
  }
}

/* Grains of up to 50 um, 0.5 mm apart. */
static hap_status grains_make(hap_session *session, uint32_t *out)
{
  static double heights[32 * 32];
  for (int i = 0; i < 32 * 32; ++i) {
    heights[i] = 5e-5 * rand() / RAND_MAX;
  }
  hap_texture_def def;
  hap_texture_def_init(&def, sizeof def);
  def.heights = heights, def.columns = def.rows = 32, def.pitch = 5e-4;
  return hap_session_add_texture(session, &def, out);
}

int main(void)
{
  dInitODE2(0);
  dSpaceID space = dHashSpaceCreate(NULL);
  for (int i = 0; i < 3; ++i) { /* three tiles in a row, their tops at z = 0 */
    dGeomID tile = dCreateBox(space, 0.1, 0.1, 0.02);
    dGeomSetPosition(tile, 0.1 * i, 0.0, -0.01);
    dGeomSetData(tile, names[i]);
  }
  hap_detail why = {""};
  hap_session *session;
  hap_pointer_id hand;
  uint32_t grains;
  hap_session_def session_def;
  hap_ode_def ode_def;
  hap_pointer_def hand_def;
  hap_session_def_init(&session_def, sizeof session_def);
  hap_ode_def_init(&ode_def, sizeof ode_def);
  hap_pointer_def_init(&hand_def, sizeof hand_def);
  session_def.drive = HAP_DRIVE_LOCKSTEP; /* no clock: the program ends at once */
  ode_def.world = dWorldCreate(), ode_def.space = space;
  ode_def.pointer_surface = surface_feel, ode_def.user = &grains;
  const char *path = "virtual:path=0:-0.04/0/0.02;0.3:-0.04/0/0.007;2.7:0.24/0/0.007"; /* stroke */
  if (hap_session_create(&session_def, &ode_def, &session, &why) < HAP_OK ||
      grains_make(session, &grains) < HAP_OK ||
      hap_device_open(path, &hand_def.device, &why) < HAP_OK ||
      hap_pointer_add(session, &hand_def, &hand) < HAP_OK || hap_session_start(session) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  hap_pointer_state state;
  for (int i = 0; i < 27 && hap_session_advance(session, 100) == HAP_OK; ++i) {
    hap_pointer_get(session, hand, &state, sizeof state);
    double x = state.proxy.position[0];
    int tile = (int)((x + 0.05) / 0.1);
    printf("%6.1f mm: %-9s presses with %.2f N, rubs with %.2f N\n", 1e3 * x, names[tile],
           state.wrench.force[2], -state.wrench.force[0]);
  }
  hap_session_destroy(session);
  hap_device_close(hand_def.device);
  return 0;
}
