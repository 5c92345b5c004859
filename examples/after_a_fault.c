/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/device_impl.h>
#include <hapode/hapode.h>
#include <signal.h>
#include <stdio.h>

static hap_device *cable_device; /* what is at the other end of the cable */

/* A device around it: *self is 0 while the cable is pulled out. */
static hap_status cable_read(void *self, int64_t time_ns, hap_device_input *const out[])
{
  return *(int *)self ? hap_device_read(cable_device, time_ns, out) : HAP_ERROR_DEVICE;
}

static void signal_force_off(int number) /* Ctrl-C */
{
  (void)number;
  hap_emergency_zero(); /* made for handlers. NOLINT(bugprone-signal-handler) */
}

/* What the hand feels after so many ticks; of a fault what happened, and its last ticks. */
static void hand_print(hap_session *session, hap_pointer_id hand, uint64_t ticks)
{
  static hap_black_box_row rows[HAP_BLACK_BOX_TICKS];
  hap_status status = hap_session_advance(session, ticks);
  hap_pointer_state state;
  hap_event event;
  hap_detail text;
  size_t count = 0;
  (void)hap_pointer_get(session, hand, &state, sizeof state);
  printf("%s, %.2f N\n", hap_status_name(status), state.wrench.force[0]);
  while (hap_session_events(session, &event, 1, sizeof event, &count) == HAP_OK) {
    printf("  %s\n", hap_event_name((hap_event_kind)event.kind));
  }
  if (hap_session_black_box(session, rows, HAP_BLACK_BOX_TICKS, sizeof rows[0], &count) == HAP_OK &&
      hap_session_detail(session, &text) == HAP_OK) {
    printf("  %s\n  %zu ticks kept, the last but one with %.2f N, the last with %.2f N\n",
           text.text, count, rows[count - 2].written.force[0], rows[count - 1].written.force[0]);
  }
}

int main(void)
{
  const hap_device_ops ops = {HAP_DEVICE_ABI, sizeof ops, "cable", "pulled out", 0,
                              NULL,           NULL,       NULL,    cable_read,   NULL};
  int is_in = 1;
  hap_detail why = {""};
  hap_scene *scene;
  hap_session *session;
  hap_session_def def;
  hap_pointer_def hand_def;
  hap_pointer_id hand;
  hap_session_def_init(&def, sizeof def);
  hap_pointer_def_init(&hand_def, sizeof hand_def);
  def.drive = HAP_DRIVE_LOCKSTEP;
  if (hap_scene_load("slide", &scene, &why) < HAP_OK ||
      hap_device_open("virtual:path=0:-.05/0/.025;1:.05/0/.025", &cable_device, &why) < HAP_OK ||
      hap_device_wrap(cable_device, &ops, &is_in, &hand_def.device, &why) < HAP_OK ||
      hap_scene_session(scene, &def, &session, &why) < HAP_OK ||
      hap_pointer_add(session, &hand_def, &hand) < HAP_OK || hap_session_start(session) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  (void)signal(SIGINT, signal_force_off);
  hand_print(session, hand, 700);
  is_in = 0;
  hand_print(session, hand, 100);
  is_in = 1; /* plugged in again; a restart opens it anew */
  if (hap_pointer_restart(session, hand) < HAP_OK || hap_session_reset_fault(session) < HAP_OK) {
    return 1;
  }
  hand_print(session, hand, 700);
  (void)raise(SIGINT);
  hand_print(session, hand, 10);
  hap_status status = hap_session_stop(session);
  hap_session_destroy(session);
  hap_device_close(hand_def.device);
  hap_device_close(cable_device);
  return status < HAP_OK || hap_scene_destroy(scene) < HAP_OK;
}
