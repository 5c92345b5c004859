/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/hapode.h>
#include <hapode/ode.h>
#include <stdio.h>

int main(void)
{
  dInitODE2(0);
  hap_detail why = {""};
  hap_session *session;
  hap_pointer_id hand;
  hap_session_def def;
  hap_ode_def ode;
  hap_pointer_def hand_def;
  hap_session_def_init(&def, sizeof def);
  hap_ode_def_init(&ode, sizeof ode);
  hap_pointer_def_init(&hand_def, sizeof hand_def);
  def.drive = HAP_DRIVE_LOCKSTEP; /* no clock: the program ends at once */
  ode.world = dWorldCreate(), ode.space = dHashSpaceCreate(NULL);
  /* fingers that close and open a gripper of 80 mm; LEDs and a vibrator that nobody sees */
  const char *spec =
      "virtual:hand=relaxed,gripper=0:0.07;1:0.01;2:0.07,gripper_force=8,gripper_stiffness=400,"
      "leds=1,vibrators=1";
  if (hap_session_create(&def, &ode, &session, &why) < HAP_OK ||
      hap_device_open(spec, &hand_def.device, &why) < HAP_OK ||
      hap_pointer_add(session, &hand_def, &hand) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  hap_axis_info gripper; /* the egg is as stiff as the gripper holds */
  if (hap_device_get_axis(hand_def.device, 0, 0, &gripper, sizeof gripper) < HAP_OK) {
    return 1;
  }
  hap_pointer_outputs outputs; /* an egg of 40 mm between the fingers */
  hap_pointer_outputs_init(&outputs, sizeof outputs);
  outputs.axes[0].target = 0.04;
  outputs.axes[0].max_force = 6;
  outputs.gripper_closed = 0.52, outputs.gripper_open = 0.58; /* of 80 mm: 42 and 46 mm */
  hap_event events[16];
  size_t count;
  (void)hap_session_events(session, events, 16, sizeof *events, &count); /* from now on */
  if (hap_pointer_set_outputs(session, hand, &outputs) < HAP_OK ||
      hap_session_start(session) < HAP_OK) {
    return hap_session_detail(session, &why), fprintf(stderr, "%s\n", why.text), 1;
  }
  for (int frame = 0; frame < 100; ++frame) {
    hap_pointer_state state;
    if (hap_session_advance(session, 20) < HAP_OK ||
        hap_pointer_get(session, hand, &state, sizeof state) < HAP_OK) {
      return 1;
    }
    /* it pushes, and does not pull */
    outputs.axes[0].stiffness = state.axes[0] < 0.04 ? gripper.rated_stiffness : 0;
    (void)hap_session_events(session, events, 16, sizeof *events, &count);
    for (size_t i = 0; i < count; ++i) {
      if (events[i].kind == HAP_EVENT_GRIPPER) {
        outputs.leds = events[i].is_down;
        outputs.vibrators[0] = (hap_vibration){events[i].is_down ? 0.5 : 0, 120};
        printf("%.2f s  %s at %.2f m/s\n", 1e-9 * (double)events[i].time_ns,
               events[i].is_down ? "holds the egg" : "lets it go", events[i].speed);
      }
    }
    (void)hap_pointer_set_outputs(session, hand, &outputs);
    if (frame % 10 == 9) {
      printf("%.2f s  %4.1f mm, %.2f N\n", 0.02 * (frame + 1), 1e3 * state.axes[0],
             state.axis_forces[0]);
    }
  }
  (void)hap_pointer_get_outputs(session, hand, &outputs);
  printf("the gripper was promised %.2f W at most\n", outputs.axes[0].max_power);
  hap_session_destroy(session);
  hap_device_close(hand_def.device);
  return 0;
}
