/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/conform/conform_internal.h"

#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

/* In this order: each point leaves the device as the next one takes it. */
static const struct {
  const char *name;
  void (*look)(conform *c);
} points[] = {
    /* open */
    {"describe", conform_describe},
    {"unknown_argument_is_refused", conform_arguments},
    {"open_holds_no_force", conform_open_holds_no_force},
    {"read_and_write_before_start_are_refused", conform_before_start},
    {"stop_and_zero_before_start_do_nothing", conform_stop_before_start},
    /* running */
    {"start_holds_no_force", conform_start_without_force},
    {"read_status", conform_read_status},
    {"pose_is_finite_and_unit", conform_pose},
    {"twist_is_finite", conform_twist},
    {"buttons_are_filled_in", conform_buttons},
    {"axes_are_within_their_ranges", conform_axis_values},
    {"pose_does_not_jump", conform_steps},
    {"poses_are_in_the_workspace", conform_workspace},
    {"reached_is_plausible", conform_reached},
    {"held_is_what_was_reached", conform_held_is_reached},
    {"twist_fits_the_poses", conform_twist_fits},
    {"axis_rates_fit_the_axes", conform_axis_rates_fit},
    {"zero_takes_the_force_off", conform_zero_takes_force},
    {"axis_forces_are_reached", conform_axis_forces},
    {"leds_and_vibrators_are_taken", conform_lights},
    {"write_keeps_the_limits", conform_limits},
    {"write_not_finite_gives_no_force", conform_not_finite},
    {"axes_keep_their_limits", conform_axis_limits},
    {"zero_in_a_signal_handler", conform_zero_in_signal},
    {"zero_in_another_thread", conform_zero_in_thread},
    {"read_after_a_pause", conform_after_pause},
    {"read_comes_back_in_time", conform_read_time},
    {"write_comes_back_in_time", conform_write_time},
    {"zero_comes_back_in_time", conform_zero_time},
    /* stopped, and again */
    {"stop_takes_the_force_off", conform_stop_takes_force},
    {"read_and_write_after_stop_are_refused", conform_after_stop},
    {"stop_twice", conform_stop_twice},
    {"start_again", conform_start_again},
    {"info_is_stable", conform_info_is_stable},
    {"two_devices", conform_two_devices},
    {"open_again_holds_no_force", conform_open_again},
    {"nothing_is_left_open", conform_leaks},
    {"unplugged", conform_unplugged},
};

#define POINTS ((int)(sizeof points / sizeof points[0]))

static void diagnostic_say(conform *c, const char *format, va_list arguments)
{
  char text[600];
  vsnprintf(text, sizeof text, format, arguments);
  for (char *end = text; (end = strchr(end, '\n')) != NULL;) {
    *end = ' '; /* a line of its own would be read as a result */
  }
  fprintf(c->out, "# %s\n", text);
}

void conform_note(conform *c, const char *format, ...)
{
  va_list arguments;
  va_start(arguments, format);
  diagnostic_say(c, format, arguments);
  va_end(arguments);
}

void conform_fail(conform *c, const char *format, ...)
{
  va_list arguments;
  c->failed = true;
  va_start(arguments, format);
  diagnostic_say(c, format, arguments);
  va_end(arguments);
}

void conform_skip(conform *c, const char *format, ...)
{
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(c->skip, sizeof c->skip, format, arguments);
  va_end(arguments);
  c->skip[strcspn(c->skip, "\n")] = '\0';
}

static void point_look(conform *c, int index)
{
  c->number = index + 2; /* 1 is open */
  c->name = points[index].name;
  c->failed = false;
  c->skip[0] = '\0';
  points[index].look(c);
  if (c->stopped) {
    return;
  }
  bool skipped = !c->failed && c->skip[0] != '\0';
  fprintf(c->out, "%s %d - %s%s%s\n", c->failed ? "not ok" : "ok", c->number, c->name,
          skipped ? " # SKIP " : "", skipped ? c->skip : "");
  fflush(c->out);
  c->failures += c->failed;
}

static bool open_first(conform *c)
{
  hap_detail detail = {""};
  c->number = 1;
  c->name = "open";
  bool good = conform_open(c, &detail);
  if (!good) {
    conform_note(c, "%s", detail.text);
  }
  fprintf(c->out, "%s 1 - open\n", good ? "ok" : "not ok");
  if (!good) {
    fputs("Bail out! it does not open\n", c->out);
  }
  fflush(c->out);
  return good;
}

/* Nobody stands beside a simulated device. */
static bool person_warn(const conform *c)
{
  const conform_options *o = c->options;
  if (conform_is_virtual(c)) {
    return true;
  }
  fprintf(stderr,
          "the device '%s' is going to be energised several times%s%s\n"
          "Ctrl-C takes the force away at any time; pressed twice, at once\n",
          c->info.name,
          o->force > 0.0 ? ", with a small force to and fro: LET GO of its grip, clear the space "
                           "around it"
                         : ", without force",
          o->limits ? "\nand IF IT IS WRONG WITH ALL ITS FORCE for a tick: keep hands away" : "");
  for (int left = (int)o->wait_s; left > 0 && !o->stop(); --left) {
    const struct timespec second = {1, 0};
    fprintf(stderr, "it begins in %d s\n", left);
    nanosleep(&second, NULL);
  }
  return !o->stop();
}

static void look_at_all(conform *c)
{
  c->stopped = !person_warn(c);
  for (int i = 0; i < POINTS && !c->stopped; ++i) {
    point_look(c, i);
  }
  if (c->stopped) {
    c->failures += 1;
    if (c->number > 1) { /* else in the countdown */
      fprintf(c->out, "not ok %d - %s\n", c->number, c->name);
    }
    fprintf(c->out, "Bail out! %s\n", c->failed ? "the force was taken off" : "stopped");
  }
}

bool conform_run(const conform_options *options, FILE *out)
{
  conform *c = calloc(1, sizeof *c);
  if (c == NULL) {
    fputs("Bail out! out of memory\n", out);
    return false;
  }
  c->options = options;
  c->out = out;
  fprintf(out, "1..%d\n", POINTS + 1);
  bool good = conform_watchdog_begin(c);
  if (good) {
    good = open_first(c);
    if (good) {
      look_at_all(c);
    }
    conform_close(c);
    conform_watchdog_end();
    good = good && c->failures == 0;
  } else {
    fputs("Bail out! no thread could be started\n", out);
  }
  fflush(out);
  free(c);
  return good;
}
