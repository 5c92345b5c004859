/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/hapode.h>
#include <hapode/ode.h>
#include <math.h>
#include <stdio.h>

typedef struct cloth {
  double ribs; /* 1/m */
  uint32_t texture;
} cloth;

static cloth cloths[2] = {{.ribs = 100.0}, {.ribs = 250.0}}; /* corduroy, then a finer one */
static const cloth *worn = &cloths[0];

/* [haptic] Five times a contact and tick: the same for the same point, quick, and without waits. */
static double rib_height(void *arg, const double point[3])
{
  const cloth *c = arg;
  double phase = c->ribs * point[0] - floor(c->ribs * point[0]);
  return 8e-4 * phase * (1.0 - phase); /* arcs of 0.2 mm, side by side */
}

static void cloth_feel(void *user, hap_pointer_id pointer, dGeomID geom, hap_surface *io)
{
  (void)user, (void)pointer, (void)geom, io->texture = worn->texture;
}

int main(void)
{
  dInitODE2(0);
  dWorldID world = dWorldCreate();
  dSpaceID space = dHashSpaceCreate(NULL);
  dGeomID table = dCreatePlane(space, 0.0, 0.0, 1.0, 0.0);
  hap_detail why = {""};
  hap_session *session;
  hap_pointer_id hand;
  hap_session_def session_def;
  hap_ode_def ode_def;
  hap_pointer_def hand_def;
  hap_texture_def ribs;
  hap_session_def_init(&session_def, sizeof session_def);
  hap_ode_def_init(&ode_def, sizeof ode_def);
  hap_pointer_def_init(&hand_def, sizeof hand_def);
  hap_texture_def_init(&ribs, sizeof ribs);
  session_def.drive = HAP_DRIVE_LOCKSTEP; /* no clock: the program ends at once */
  ode_def.world = world, ode_def.space = space, ode_def.pointer_surface = cloth_feel;
  const char *path = "virtual:path=0:0/0/0.02;0.3:0/0/0.009;2.3:0.2/0/0.009"; /* a stroke */
  if (hap_session_create(&session_def, &ode_def, &session, &why) < HAP_OK ||
      hap_device_open(path, &hand_def.device, &why) < HAP_OK ||
      hap_pointer_add(session, &hand_def, &hand) < HAP_OK || hap_session_start(session) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  for (int i = 0; i < 2; ++i) {
    ribs.height = rib_height, ribs.arg = &cloths[i];
    if (hap_session_add_texture(session, &ribs, &cloths[i].texture) < HAP_OK ||
        hap_session_try_lock(session, 1000000000) < HAP_OK) { /* 1 s, then without new cloth */
      return 1;
    }
    worn = &cloths[i];
    hap_session_surface_changed(session, table); /* asks cloth_feel again */
    hap_session_unlock(session);
    hap_session_advance(session, 500); /* in the first round the hand comes down meanwhile */
    hap_pointer_state before, now;
    int crossed = 0;
    hap_pointer_get(session, hand, &before, sizeof before);
    double begin = before.proxy.position[0];
    for (int k = 0; k < 600 && hap_session_advance(session, 1) == HAP_OK; ++k, before = now) {
      hap_pointer_get(session, hand, &now, sizeof now);
      crossed += before.wrench.force[0] < 0.0 && now.wrench.force[0] >= 0.0; /* over a rib */
    }
    hap_texture_state time;
    hap_status in = hap_session_get_texture(session, cloths[i].texture, &time, sizeof time);
    printf("%.0f ribs a metre: %d felt on %.0f mm, function %s\n", cloths[i].ribs, crossed,
           1e3 * (before.proxy.position[0] - begin), in == HAP_END ? "too late" : "in time");
  }
  hap_session_destroy(session);
  hap_device_close(hand_def.device);
  return 0;
}
