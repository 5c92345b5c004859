/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/hapode.h>
#include <hapode/ode.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#define TICKS 2000

/* What a teacher's hand did, tick by tick, and how far a pupil's has come. */
typedef struct lesson {
  double way[TICKS][3]; /* m */
  int at;
  double stiffness, damping; /* N/m, N s/m */
  double off;                /* m, of the pupil */
} lesson;

/* On the haptic thread. The lesson waits for a hand that stays behind. */
static void pupil_guide(void *user, const hap_force_tick *tick, hap_wrench *out)
{
  lesson *l = user;
  const hap_force_hand *hand = tick->hands[tick->self];
  l->off = 0.0;
  for (int i = 0; i < 3; ++i) {
    double way = l->way[l->at][i] - hand->pose.position[i];
    out->force[i] = l->stiffness * way - l->damping * hand->twist.linear[i];
    l->off = hypot(l->off, way);
  }
  l->at += l->off < 0.01 && l->at + 1 < TICKS;
}

/* A hand for TICKS. The teacher's is written down, the pupil's is guided. */
static int hand_run(const char *device, lesson *l, int is_teacher)
{
  hap_detail why = {""};
  hap_session *session;
  hap_session_def def;
  hap_ode_def ode_def;
  hap_pointer_def hand_def;
  hap_pointer_id hand;
  hap_force_def guide;
  hap_force_id id;
  hap_session_def_init(&def, sizeof def);
  hap_ode_def_init(&ode_def, sizeof ode_def);
  hap_pointer_def_init(&hand_def, sizeof hand_def);
  hap_force_def_init(&guide, sizeof guide);
  def.drive = HAP_DRIVE_LOCKSTEP; /* no clock: the program ends at once */
  ode_def.world = dWorldCreate(), ode_def.space = dHashSpaceCreate(NULL);
  guide.kind = HAP_FORCE_CALL, guide.call = pupil_guide, guide.user = l;
  guide.stiffness = l->stiffness, guide.max_force = 4.0, guide.max_power = 0.5;
  if (hap_session_create(&def, &ode_def, &session, &why) < HAP_OK ||
      hap_device_open(device, &hand_def.device, &why) < HAP_OK ||
      hap_pointer_add(session, &hand_def, &hand) < HAP_OK ||
      (!is_teacher && hap_pointer_force_add(session, hand, &guide, &id) < HAP_OK) ||
      hap_session_start(session) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  for (int i = 0; i < TICKS && hap_session_advance(session, 1) == HAP_OK; ++i) {
    hap_pointer_state state;
    hap_pointer_get(session, hand, &state, sizeof state);
    if (is_teacher) {
      memcpy(l->way[i], state.proxy.position, sizeof l->way[i]);
    } else if (i % 200 == 199) {
      printf("%4d ms: %3d %% of the way, %4.1f mm off\n", i + 1, 100 * l->at / TICKS, 1e3 * l->off);
    }
  }
  hap_session_destroy(session);
  hap_device_close(hand_def.device);
  return 0;
}

int main(void)
{
  static lesson l = {.stiffness = 400.0, .damping = 4.0};
  dInitODE2(0);
  const char *teacher = "virtual:path=0:0/0/0;0.5:0.05/0/0;1:0.05/0.05/0;1.5:0/0.05/0;2:0/0/0";
  return hand_run(teacher, &l, 1) || hand_run("virtual:hand=none,device_mass=0.2", &l, 0);
}
