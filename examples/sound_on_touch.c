/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#define _POSIX_C_SOURCE 200809L /* nanosleep */
#include <hapode/hapode.h>
#include <hapode/ode.h>
#include <math.h>
#include <stdio.h>
#include <time.h>

/* A synthesizer would be told what is printed here. */
static void event_play(const hap_event *e, const char *material)
{
  double t = 1e-9 * (double)e->time_ns;
  if (e->kind == HAP_EVENT_IMPACT) {
    printf("%.3f s  click of %s, %.0f mN s at %.2f m/s\n", t, material, 1e3 * e->impulse, e->speed);
  } else if (e->kind == HAP_EVENT_SLIDE || e->kind == HAP_EVENT_STICK) {
    printf("%.3f s  scraping on %s %s\n", t, material,
           e->kind == HAP_EVENT_SLIDE ? "begins" : "ends");
  } else if (e->kind == HAP_EVENT_FAULT) {
    printf("%.3f s  %s\n", t, hap_fault_text((hap_fault)e->number));
  }
}

int main(void)
{
  dInitODE2(0);
  dWorldID world = dWorldCreate();
  dSpaceID space = dHashSpaceCreate(NULL);
  static char wood[] = "wood";
  dGeomSetData(dCreatePlane(space, 0, 0, 1, 0), wood);

  hap_detail why = {""};
  hap_session *session;
  hap_pointer_id hand;
  hap_ode_def ode_def;
  hap_pointer_def hand_def;
  hap_ode_def_init(&ode_def, sizeof ode_def);
  ode_def.world = world, ode_def.space = space;
  hap_pointer_def_init(&hand_def, sizeof hand_def);
  hand_def.friction = 0.4;
  /* a tap, a harder one, and a stroke */
  const char *spec =
      "virtual:path=0:0/0/0.03;0.4:0/0/0.008;0.6:0/0/0.03;0.7:0/0/0.006;"
      "1:0/0/0.03;1.4:0/0/0.007;2:0.1/0/0.007";
  if (hap_session_create(NULL, &ode_def, &session, &why) < HAP_OK ||
      hap_device_open(spec, &hand_def.device, &why) < HAP_OK ||
      hap_pointer_add(session, &hand_def, &hand) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  hap_event events[32];
  size_t count;
  (void)hap_session_events(session, events, 32, sizeof *events, &count); /* from now on */
  if (hap_session_start(session) < HAP_OK) {
    return 1;
  }
  for (int frame = 0; frame < 130; ++frame) {
    nanosleep(&(struct timespec){.tv_nsec = 16666667}, NULL);
    while (hap_session_events(session, events, 32, sizeof *events, &count) == HAP_OK) {
      for (size_t i = 0; i < count; ++i) {
        event_play(&events[i], events[i].geom != NULL ? dGeomGetData(events[i].geom) : "");
      }
    }
  }
  hap_touch touch;
  if (hap_pointer_touches(session, hand, &touch, 1, sizeof touch, &count) == HAP_STALE) {
    nanosleep(&(struct timespec){.tv_nsec = 16666667}, NULL); /* the first call begins it */
  }
  if (hap_pointer_touches(session, hand, &touch, 1, sizeof touch, &count) == HAP_OK) {
    printf("at last on %s with %.2f N, of which %.2f N rub\n",
           (const char *)dGeomGetData(touch.geom), touch.force[2],
           hypot(touch.force[0], touch.force[1]));
  }
  hap_session_destroy(session);
  hap_device_close(hand_def.device);
  return 0;
}
