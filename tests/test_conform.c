/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* hapode-run --check-device: a device with one fault is caught by the line that is meant, and by
 * no other one. HAPODE_RUN, HAPODE_BROKEN, HAPODE_SKELETON: paths of the program and of the
 * modules. */

#include "tests/program.h"
#include "tests/tap.h"

#include <signal.h>
#include <time.h>

#define POINTS 39

static pid_t check_start(const char *spec, const char *options)
{
  char arguments[1000];
  snprintf(arguments, sizeof arguments, "--check-device %s --check-wait 0 %s", spec, options);
  return program_start(arguments, NULL);
}

/* False: not for long. */
static bool await_line(const char *line)
{
  const struct timespec moment = {0, 10000000};
  for (int i = 0; i < 3000; ++i) {
    program_look();
    if (strstr(ran.out, line) != NULL) {
      return true;
    }
    nanosleep(&moment, NULL);
  }
  return false;
}

/* Exit code. */
static int device_check(const char *spec, const char *options)
{
  return program_finish(check_start(spec, options));
}

static const char *broken_check(const char *fault)
{
  static char spec[600];
  snprintf(spec, sizeof spec, "module:%s,break=%s", folder_module("HAPODE_BROKEN"), fault);
  return spec;
}

/* "not ok N - point" and no other "not ok". */
static bool caught_by(const char *point)
{
  const char *line = strstr(ran.out, "\nnot ok ");
  char name[100] = "";
  bool one = lines_from(ran.out, "not ok ") == 1 && line != NULL &&
             sscanf(line, " not ok %*d - %99s", name) == 1 && strcmp(name, point) == 0;
  return one;
}

static void output_show(void)
{
  for (const char *line = strtok(ran.out, "\n"); line != NULL; line = strtok(NULL, "\n")) {
    printf("#   %s\n", line);
  }
}

/* ---- faults ---- */

static const struct {
  const char *fault;
  const char *point;
} faults[] = {
    {"help_of_two_lines", "describe"},
    {"measures_twice", "describe"},
    {"takes_any_argument", "unknown_argument_is_refused"},
    {"silent_refusal", "unknown_argument_is_refused"},
    {"self_of_failure", "unknown_argument_is_refused"},
    {"force_at_open", "open_holds_no_force"},
    {"read_before_start", "read_and_write_before_start_are_refused"},
    {"write_before_start", "read_and_write_before_start_are_refused"},
    {"stop_before_start_gives_force", "stop_and_zero_before_start_do_nothing"},
    {"start_fails", "start_holds_no_force"},
    {"force_at_start", "start_holds_no_force"},
    {"read_fails", "read_status"},
    {"odd_status", "read_status"},
    {"pose_is_nan", "pose_is_finite_and_unit"},
    {"quaternion_is_not_unit", "pose_is_finite_and_unit"},
    {"pose_is_not_filled_in", "pose_is_finite_and_unit"},
    {"twist_is_nan", "twist_is_finite"},
    {"buttons_are_not_filled_in", "buttons_are_filled_in"},
    {"jumps", "pose_does_not_jump"},
    {"gives_double", "reached_is_plausible"},
    {"gives_against", "reached_is_plausible"},
    {"reached_is_not_filled_in", "reached_is_plausible"},
    {"reached_is_a_lie", "held_is_what_was_reached"},
    {"twist_is_double", "twist_fits_the_poses"},
    {"twist_is_against", "twist_fits_the_poses"},
    {"twist_in_degrees", "twist_fits_the_poses"},
    {"no_limit", "write_keeps_the_limits"},
    {"limit_per_axis", "write_keeps_the_limits"},
    {"limit_is_not_said", "write_keeps_the_limits"},
    {"nan_is_taken", "write_not_finite_gives_no_force"},
    {"nan_is_held", "write_not_finite_gives_no_force"},
    {"axis_is_nan", "axes_are_within_their_ranges"},
    {"axis_is_beyond", "axes_are_within_their_ranges"},
    {"axis_rate_is_double", "axis_rates_fit_the_axes"},
    {"axis_rate_is_against", "axis_rates_fit_the_axes"},
    {"axis_rate_is_none", "axis_rates_fit_the_axes"},
    {"workspace_is_elsewhere", "poses_are_in_the_workspace"},
    {"axis_gives_double", "axis_forces_are_reached"},
    {"axis_gives_against", "axis_forces_are_reached"},
    {"axis_is_not_zeroed", "axis_forces_are_reached"},
    {"axis_reached_is_not_filled_in", "axis_forces_are_reached"},
    {"axis_has_no_limit", "axes_keep_their_limits"},
    {"axis_nan_is_held", "axes_keep_their_limits"},
    {"vibrators_are_refused", "leds_and_vibrators_are_taken"},
    {"zero_does_nothing", "zero_takes_the_force_off"},
    {"zero_is_for_ever", "zero_takes_the_force_off"},
    {"zero_disturbs", "zero_in_another_thread"},
    {"pause_is_fatal", "read_after_a_pause"},
    {"read_is_slow", "read_comes_back_in_time"},
    {"write_is_slow", "write_comes_back_in_time"},
    {"zero_is_slow", "zero_comes_back_in_time"},
    {"stop_keeps_force", "stop_takes_the_force_off"},
    {"read_after_stop", "read_and_write_after_stop_are_refused"},
    {"write_after_stop", "read_and_write_after_stop_are_refused"},
    {"second_stop_gives_force", "stop_twice"},
    {"starts_once", "start_again"},
    {"start_resumes", "start_again"},
    {"info_changes", "info_is_stable"},
    {"shared", "two_devices"},
    {"force_of_last_life", "open_again_holds_no_force"},
    {"leak_file", "nothing_is_left_open"},
    {"leak_thread", "nothing_is_left_open"},
#if !TAP_ADDRESS_SANITIZER && !TAP_THREAD_SANITIZER
    {"leak_memory", "nothing_is_left_open"}, /* theirs is not the C library's heap */
#endif
};

TEST(each_fault_is_caught_by_its_line_alone)
{
  for (size_t i = 0; i < sizeof faults / sizeof faults[0]; ++i) {
    int code = device_check(broken_check(faults[i].fault), "");
    bool good = code == 1 && caught_by(faults[i].point) &&
                lines_from(ran.out, "ok ") + lines_from(ran.out, "not ok ") == POINTS;
    CHECK(good);
    if (!good) {
      printf("# %s, for %s: exit code %d\n", faults[i].fault, faults[i].point, code);
      output_show();
    }
  }
}

TEST(without_a_fault_every_point_holds)
{
  int code = device_check(broken_check("none"), "");
  CHECK(code == 0 && lines_from(ran.out, "not ok") == 0 && lines_from(ran.out, "ok ") == POINTS);
  CHECK(lines_from(ran.out, "1..39") == 1);
  if (code != 0) {
    output_show();
  }
}

/* ---- what hangs ---- */

TEST(a_device_that_hangs_is_given_up_with_its_line)
{
  CHECK(device_check(broken_check("read_hangs"), "") == 1);
  CHECK(strstr(ran.out, "# read has not come back\nnot ok 8 - read_status\nBail out!") != NULL ||
        strstr(ran.out, "# read has not come back\nnot ok 6 - ") != NULL);
  CHECK(device_check(broken_check("zero_locks"), "") == 1);
  CHECK(caught_by("zero_in_a_signal_handler") && strstr(ran.out, "Bail out!") != NULL);
}

/* ---- what may be asked for ---- */

static int output_skips(const char *reason)
{
  int count = 0;
  for (const char *at = ran.out; (at = strstr(at, reason)) != NULL; ++at) {
    ++count;
  }
  return count;
}

TEST(a_check_without_force_asks_for_none)
{
  CHECK(device_check(broken_check("refuses_all_force"), "--check-force 0") == 0);
  CHECK(lines_from(ran.out, "not ok") == 0 && output_skips("# SKIP a check without force") >= 4);
  CHECK(output_skips("what this check must not ask for") == 0);
  CHECK(device_check(broken_check("refuses_all_force"), "") == 1); /* the fault is one */
}

TEST(a_device_in_real_time_gets_small_forces_alone)
{
  CHECK(device_check(broken_check("refuses_much_force,pacing=host"), "") == 0);
  CHECK(lines_from(ran.out, "not ok") == 0 && output_skips("# SKIP only with --check-limits") == 3);
  CHECK(output_skips("what this check must not ask for") == 0);
  CHECK(device_check(broken_check("refuses_much_force,pacing=host"), "--check-limits") == 1);
  CHECK(output_skips("what this check must not ask for") > 0);
}

TEST(a_device_that_runs_away_is_let_go)
{
  CHECK(device_check(broken_check("runs_away,pacing=host"), "") == 1);
  CHECK(caught_by("reached_is_plausible"));
  CHECK(strstr(ran.out, "moved more than 50 mm") != NULL);
  CHECK(strstr(ran.out, "Bail out! the force was taken off") != NULL);
  CHECK(output_skips("what this check must not ask for") == 0);
}

TEST(a_stop_in_the_countdown_energises_nothing)
{
  pid_t child = check_start(broken_check("start_fails,pacing=host"), "--check-wait 600");
  CHECK(child > 0 && await_line("\nok 1 - open") && kill(child, SIGINT) == 0);
  CHECK(program_finish(child) == 1);
  CHECK(lines_from(ran.out, "ok ") == 1 && lines_from(ran.out, "not ok") == 0);
  CHECK(strstr(ran.out, "ok 1 - open\nBail out! stopped") != NULL);
}

TEST(a_device_with_a_clock_of_its_own_is_waited_for)
{
  int code = device_check(broken_check("none,pacing=device"), "--check-limits");
  CHECK(code == 0 && lines_from(ran.out, "not ok") == 0);
  if (code != 0) {
    output_show();
  }
  CHECK(device_check(broken_check("read_is_slow,pacing=device"), "") == 1);
  CHECK(caught_by("read_comes_back_in_time"));
}

TEST(a_device_is_followed_through_its_plug)
{
  int code = device_check(broken_check("unplugged"), "--check-unplug 3");
  printf("# exit code %d\n", code);
  CHECK(lines_from(ran.out, "ok 39 - unplugged") == 1 &&
        lines_from(ran.out, "ok 39 - unplugged # SKIP") == 0);
  CHECK(device_check(broken_check("none"), "--check-unplug 3") == 1 && caught_by("unplugged"));
  CHECK(strstr(ran.out, "nobody unplugged it") != NULL);
}

/* ---- the program ---- */

TEST(a_device_that_does_not_open_is_said)
{
  CHECK(device_check("module:/nowhere/libfoo.so", "") == 1);
  CHECK(strstr(ran.out, "# module /nowhere/libfoo.so: cannot be opened") != NULL);
  CHECK(strstr(ran.out, "not ok 1 - open\nBail out!") != NULL);
  CHECK(device_check("no_such_device", "") == 1);
  CHECK(strstr(ran.out, "there are: virtual, replay, spidar, haply,") != NULL);
  CHECK(device_check(folder_module("HAPODE_BROKEN"), "") == 1); /* no name before the path */
}

TEST(options_that_do_not_go_together_are_refused)
{
  CHECK(device_check("virtual", "--device virtual") == 2);
  CHECK(device_check("virtual", "--check-force 5") == 2);
}

/* Ctrl-C, in the middle. */
TEST(a_signal_ends_it_with_the_force_off)
{
  pid_t child = check_start(broken_check("none,pacing=host"), "--check-unplug 600");
  CHECK(child > 0 && await_line("\nok 15 - ") && kill(child, SIGINT) == 0);
  CHECK(program_finish(child) == 1);
  CHECK(strstr(ran.out, "Bail out! stopped") != NULL);
}

SET_UP
{
  return getenv("HAPODE_BROKEN") != NULL ? program_use("HAPODE_RUN")
                                         : tap_bail_out("HAPODE_BROKEN is not set");
}
