/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* hapode-run --check-device: a device with one fault is caught by the line that is meant, and by no other
 * one. HAPODE_RUN, HAPODE_BROKEN, HAPODE_SKELETON: paths of the program and of the modules. */

#include "tests/tap.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#define OUTPUT_MAX 30000
#define POINTS 33

extern char **environ;

static char out_path[] = "/tmp/hapode-conform-XXXXXX";
static char output[OUTPUT_MAX];

/* ---- the program ---- */

static pid_t start(const char *spec, const char *const *options)
{
  static char words[16][700];
  const char *const fixed[] = {getenv("HAPODE_RUN"), "--check-device", spec, "--check-wait", "0"};
  char *argv[17] = {NULL};
  posix_spawn_file_actions_t actions;
  pid_t child = -1;
  for (int i = 0; i < 16; ++i) {
    const char *word = i < 5 ? fixed[i] : options != NULL ? options[i - 5] : NULL;
    if (word == NULL) {
      break;
    }
    snprintf(words[i], sizeof words[i], "%s", word);
    argv[i] = words[i];
  }
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, out_path, O_WRONLY | O_TRUNC, 0600);
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0600);
  if (argv[0] == NULL || posix_spawn(&child, argv[0], &actions, NULL, argv, environ) != 0) {
    child = -1;
  }
  posix_spawn_file_actions_destroy(&actions);
  return child;
}

static void read_output(void)
{
  FILE *file = fopen(out_path, "r");
  size_t got = file != NULL ? fread(output, 1, sizeof output - 1, file) : 0;
  output[got] = '\0';
  if (file != NULL) {
    fclose(file);
  }
}

/* False: not for long. */
static bool await_line(const char *line)
{
  const struct timespec moment = {0, 10000000};
  for (int i = 0; i < 3000; ++i) {
    read_output();
    if (strstr(output, line) != NULL) {
      return true;
    }
    nanosleep(&moment, NULL);
  }
  return false;
}

/* Exit code; -1: it did not end by itself. */
static int finish(pid_t child)
{
  int result = 0;
  bool ended = child > 0 && waitpid(child, &result, 0) == child && WIFEXITED(result);
  read_output();
  return ended ? WEXITSTATUS(result) : -1;
}

static int check(const char *spec, const char *const *options)
{
  return finish(start(spec, options));
}

static const char *broken(const char *fault)
{
  static char spec[600];
  snprintf(spec, sizeof spec, "module:%s,break=%s", getenv("HAPODE_BROKEN"), fault);
  return spec;
}

static int lines_with(const char *begin)
{
  int count = 0;
  size_t length = strlen(begin);
  for (const char *line = output; *line != '\0'; line += *line == '\n') {
    count += strncmp(line, begin, length) == 0;
    line += strcspn(line, "\n");
  }
  return count;
}

/* "not ok N - point" and no other "not ok". */
static bool caught_by(const char *point)
{
  const char *line = strstr(output, "\nnot ok ");
  char name[100] = "";
  bool one = lines_with("not ok ") == 1 && line != NULL &&
             sscanf(line, " not ok %*d - %99s", name) == 1 && strcmp(name, point) == 0;
  return one;
}

static void show(void)
{
  for (const char *line = strtok(output, "\n"); line != NULL; line = strtok(NULL, "\n")) {
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
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
    {"leak_memory", "nothing_is_left_open"}, /* theirs is not the C library's heap */
#endif
};

TEST(each_fault_is_caught_by_its_line_alone)
{
  for (size_t i = 0; i < sizeof faults / sizeof faults[0]; ++i) {
    int code = check(broken(faults[i].fault), NULL);
    bool good = code == 1 && caught_by(faults[i].point) &&
                lines_with("ok ") + lines_with("not ok ") == POINTS;
    CHECK(good);
    if (!good) {
      printf("# %s, for %s: exit code %d\n", faults[i].fault, faults[i].point, code);
      show();
    }
  }
}

TEST(without_a_fault_every_point_holds)
{
  int code = check(broken("none"), NULL);
  CHECK(code == 0 && lines_with("not ok") == 0 && lines_with("ok ") == POINTS);
  CHECK(lines_with("1..33") == 1);
  if (code != 0) {
    show();
  }
}

/* ---- what hangs ---- */

TEST(a_device_that_hangs_is_given_up_with_its_line)
{
  CHECK(check(broken("read_hangs"), NULL) == 1);
  CHECK(strstr(output, "# read has not come back\nnot ok 8 - read_status\nBail out!") != NULL ||
        strstr(output, "# read has not come back\nnot ok 6 - ") != NULL);
  CHECK(check(broken("zero_locks"), NULL) == 1);
  CHECK(caught_by("zero_in_a_signal_handler") && strstr(output, "Bail out!") != NULL);
}

/* ---- what may be asked for ---- */

static int skips(const char *reason)
{
  int count = 0;
  for (const char *at = output; (at = strstr(at, reason)) != NULL; ++at) {
    ++count;
  }
  return count;
}

TEST(a_check_without_force_asks_for_none)
{
  static const char *const none[] = {"--check-force", "0", NULL};
  CHECK(check(broken("refuses_all_force"), none) == 0);
  CHECK(lines_with("not ok") == 0 && skips("# SKIP a check without force") >= 4);
  CHECK(skips("what this check must not ask for") == 0);
  CHECK(check(broken("refuses_all_force"), NULL) == 1); /* the fault is one */
}

TEST(a_device_in_real_time_gets_small_forces_alone)
{
  static const char *const limits[] = {"--check-limits", NULL};
  CHECK(check(broken("refuses_much_force,pacing=host"), NULL) == 0);
  CHECK(lines_with("not ok") == 0 && skips("# SKIP only with --check-limits") == 2);
  CHECK(skips("what this check must not ask for") == 0);
  CHECK(check(broken("refuses_much_force,pacing=host"), limits) == 1);
  CHECK(skips("what this check must not ask for") > 0);
}

TEST(a_device_that_runs_away_is_let_go)
{
  CHECK(check(broken("runs_away,pacing=host"), NULL) == 1);
  CHECK(caught_by("reached_is_plausible"));
  CHECK(strstr(output, "moved more than 50 mm") != NULL);
  CHECK(strstr(output, "Bail out! the force was taken off") != NULL);
  CHECK(skips("what this check must not ask for") == 0);
}

TEST(a_stop_in_the_countdown_energises_nothing)
{
  static const char *const wait[] = {"--check-wait", "600", NULL};
  pid_t child = start(broken("start_fails,pacing=host"), wait);
  CHECK(child > 0 && await_line("\nok 1 - open") && kill(child, SIGINT) == 0);
  CHECK(finish(child) == 1);
  CHECK(lines_with("ok ") == 1 && lines_with("not ok") == 0);
  CHECK(strstr(output, "ok 1 - open\nBail out! stopped") != NULL);
}

TEST(a_device_with_a_clock_of_its_own_is_waited_for)
{
  static const char *const limits[] = {"--check-limits", NULL};
  int code = check(broken("none,pacing=device"), limits);
  CHECK(code == 0 && lines_with("not ok") == 0);
  if (code != 0) {
    show();
  }
  CHECK(check(broken("read_is_slow,pacing=device"), NULL) == 1);
  CHECK(caught_by("read_comes_back_in_time"));
}

TEST(a_device_is_followed_through_its_plug)
{
  static const char *const unplug[] = {"--check-unplug", "3", NULL};
  int code = check(broken("unplugged"), unplug);
  printf("# exit code %d\n", code);
  CHECK(lines_with("ok 33 - unplugged") == 1 && lines_with("ok 33 - unplugged # SKIP") == 0);
  CHECK(check(broken("none"), unplug) == 1 && caught_by("unplugged"));
  CHECK(strstr(output, "nobody unplugged it") != NULL);
}

/* ---- the program ---- */

TEST(a_device_that_does_not_open_is_said)
{
  CHECK(check("module:/nowhere/libfoo.so", NULL) == 1);
  CHECK(strstr(output, "# module /nowhere/libfoo.so: cannot be opened") != NULL);
  CHECK(strstr(output, "not ok 1 - open\nBail out!") != NULL);
  CHECK(check("no_such_device", NULL) == 1);
  CHECK(strstr(output, "there are: virtual, replay, spidar, module") != NULL);
  CHECK(check(getenv("HAPODE_BROKEN"), NULL) == 1); /* no name before the path */
}

TEST(options_that_do_not_go_together_are_refused)
{
  static const char *const device[] = {"--device", "virtual", NULL};
  static const char *const much[] = {"--check-force", "5", NULL};
  CHECK(check("virtual", device) == 2);
  CHECK(check("virtual", much) == 2);
}

/* Ctrl-C, in the middle. */
TEST(a_signal_ends_it_with_the_force_off)
{
  static const char *const unplug[] = {"--check-unplug", "600", NULL};
  pid_t child = start(broken("none,pacing=host"), unplug);
  CHECK(child > 0 && await_line("\nok 15 - ") && kill(child, SIGINT) == 0);
  CHECK(finish(child) == 1);
  CHECK(strstr(output, "Bail out! stopped") != NULL);
}

int main(void)
{
  int file = mkstemp(out_path);
  if (file < 0 || getenv("HAPODE_BROKEN") == NULL) {
    printf("Bail out! no temporary file, or HAPODE_BROKEN is not set\n");
    return 1;
  }
  close(file);
  RUN(without_a_fault_every_point_holds);
  RUN(each_fault_is_caught_by_its_line_alone);
  RUN(a_device_that_hangs_is_given_up_with_its_line);
  RUN(a_check_without_force_asks_for_none);
  RUN(a_device_in_real_time_gets_small_forces_alone);
  RUN(a_device_that_runs_away_is_let_go);
  RUN(a_stop_in_the_countdown_energises_nothing);
  RUN(a_device_with_a_clock_of_its_own_is_waited_for);
  RUN(a_device_is_followed_through_its_plug);
  RUN(a_device_that_does_not_open_is_said);
  RUN(options_that_do_not_go_together_are_refused);
  RUN(a_signal_ends_it_with_the_force_off);
  remove(out_path);
  return tap_done();
}
