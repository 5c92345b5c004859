/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/hapode.h>
#include <hapode/ode.h>
#include <math.h>
#include <stdatomic.h>
#include <stdio.h>

/* A ball of thick air. What is atomic is read by the frame loop. */
typedef struct volume {
  double center[3]; /* m */
  double radius;
  double drag; /* N s/m */
  atomic_int is_inside;
  atomic_int entries;
} volume;

/* On the haptic thread: no lock, no allocation, no printf. */
static void volume_feel(void *user, const hap_force_tick *tick, hap_wrench *out)
{
  volume *v = user;
  const hap_force_hand *hand = tick->hands[tick->self];
  double distance2 = 0.0;
  for (int i = 0; i < 3; ++i) {
    double way = hand->pose.position[i] - v->center[i];
    distance2 += way * way;
  }
  double depth = v->radius - sqrt(distance2);
  double share = fmin(fmax(depth / 0.005, 0.0), 1.0); /* no edge: it comes in over 5 mm */
  for (int i = 0; i < 3; ++i) {
    out->force[i] = -share * v->drag * hand->twist.linear[i];
  }
  int was_inside = atomic_exchange(&v->is_inside, depth > 0.0);
  atomic_fetch_add(&v->entries, depth > 0.0 && was_inside == 0);
}

int main(void)
{
  hap_detail why = {""};
  hap_session *session;
  hap_pointer_id hand;
  hap_session_def session_def;
  hap_ode_def ode_def;
  hap_pointer_def hand_def;
  dInitODE2(0);
  hap_session_def_init(&session_def, sizeof session_def);
  session_def.drive = HAP_DRIVE_LOCKSTEP; /* no clock: the program ends at once */
  hap_ode_def_init(&ode_def, sizeof ode_def);
  ode_def.world = dWorldCreate(), ode_def.space = dHashSpaceCreate(NULL);
  hap_pointer_def_init(&hand_def, sizeof hand_def);

  static volume air = {.center = {0.05, 0.0, 0.0}, .radius = 0.02, .drag = 8.0};
  hap_force_def def;
  hap_force_id id;
  hap_force_def_init(&def, sizeof def);
  def.kind = HAP_FORCE_CALL;
  def.call = volume_feel, def.user = &air;
  def.max_force = 3.0, def.max_power = 0.1; /* it brakes, and gives hardly any energy */
  if (hap_session_create(&session_def, &ode_def, &session, &why) < HAP_OK ||
      hap_device_open("virtual:path=0:0/0/0;1:0.1/0/0;2:0/0/0", &hand_def.device, &why) < HAP_OK ||
      hap_pointer_add(session, &hand_def, &hand) < HAP_OK ||
      hap_pointer_force_add(session, hand, &def, &id) < HAP_OK ||
      hap_session_start(session) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  for (int frame = 0; frame < 120; ++frame) {
    hap_force_state state;
    if (hap_session_advance(session, 17) >= HAP_OK && frame % 10 == 0) { /* ticks of 1 ms */
      printf("%s, entered %d times\n", air.is_inside ? "inside" : "outside", air.entries);
    }
    if (hap_pointer_force_get(session, hand, id, &state, sizeof state) == HAP_END) {
      return fprintf(stderr, "the call was taken out: %u\n", state.out), 1;
    }
  }
  hap_session_destroy(session);
  hap_device_close(hand_def.device);
  return 0;
}
