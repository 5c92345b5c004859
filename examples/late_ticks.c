/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#define _POSIX_C_SOURCE 200809L /* nanosleep */
#include <hapode/hapode.h>
#include <hapode/ode.h>
#include <stdio.h>
#include <time.h>

int main(void)
{
  dInitODE2(0);
  hap_detail why = {""};
  hap_session_def session_def;
  hap_ode_def ode_def;
  hap_pointer_def hand_def;
  hap_session_def_init(&session_def, sizeof session_def);
  hap_ode_def_init(&ode_def, sizeof ode_def);
  hap_pointer_def_init(&hand_def, sizeof hand_def);
  session_def.rt_priority = 80; /* the default; 0: do not ask for real time */
  ode_def.world = dWorldCreate(), ode_def.space = dHashSpaceCreate(NULL);
  hap_session *session;
  hap_pointer_id hand;
  if (hap_session_create(&session_def, &ode_def, &session, &why) < HAP_OK ||
      hap_device_open("virtual:sine=0.05/0/0,hz=1", &hand_def.device, &why) < HAP_OK ||
      hap_pointer_add(session, &hand_def, &hand) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  hap_status status = hap_session_start(session);
  if (status < HAP_OK) {
    return fprintf(stderr, "%s\n", hap_status_text(status)), 1;
  }
  if (status == HAP_NO_REALTIME) {
    puts("no real time: see the limits of this user, ulimit -r and ulimit -l");
  }
  nanosleep(&(struct timespec){.tv_sec = 1}, NULL);
  hap_stats stats;
  hap_session_stats(session, &stats, sizeof stats);
  printf(
      "%llu ticks, %llu missed; woken up late by %.0f us (99 %%), a tick takes %.0f us (99 %%)\n",
      (unsigned long long)stats.loop.ticks, (unsigned long long)stats.loop.missed_ticks,
      stats.loop.wake_us_p99, stats.loop.tick_us_p99);
  hap_session_destroy(session);
  hap_device_close(hand_def.device);
  return 0;
}
