/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* hapode-run --view as its users meet it, on a display of its own: Xvfb, and xdotool for the mouse
 * and the keys. HAPODE_RUN: path of the program. */

#include <fcntl.h>
#include <math.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/program.h"
#include "tests/tap.h"

typedef struct display {
  pid_t server;
} display;

static void display_finish(void *owned)
{
  const display *d = owned;
  if (d->server > 0) {
    kill(d->server, SIGTERM);
    (void)waitpid(d->server, NULL, 0);
  }
  unsetenv("DISPLAY");
}

/* A display until the end of the test, or the test is left. */
static void display_open(void)
{
  int ends[2];
  char number[16] = "";
  char name[20];
  display *d = tap_own(sizeof *d, display_finish);
  if (system("command -v Xvfb >/dev/null && command -v xdotool >/dev/null") != 0) {
    SKIP("Xvfb or xdotool is not there");
  }
  REQUIRE(pipe(ends) == 0);
  d->server = fork();
  if (d->server == 0) {
    const int nowhere = open("/dev/null", O_RDWR);
    for (int i = STDIN_FILENO; i <= STDERR_FILENO; ++i) {
      dup2(nowhere, i);
    }
    close(ends[0]);
    snprintf(number, sizeof number, "%d", ends[1]);
    execlp("Xvfb", "Xvfb", "-displayfd", number, "-screen", "0", "800x600x24", "-nolisten", "tcp",
           (char *)NULL);
    _exit(127);
  }
  close(ends[1]);
  REQUIRE(d->server > 0);
  for (size_t i = 0; i + 1 < sizeof number && strchr(number, '\n') == NULL; ++i) {
    REQUIRE(read(ends[0], &number[i], 1) == 1);
  }
  close(ends[0]);
  snprintf(name, sizeof name, ":%d", atoi(number));
  setenv("DISPLAY", name, 1);
  int code = run("--view --lockstep --seconds 0.01");
  if (code == 2 && says("OpenGL")) {
    SKIP("%.*s", (int)strcspn(ran.err, "\n"), ran.err);
  }
  REQUIRE_SAY(code == 0, "%s", ran.err);
}

/* "key: value" of the summary. */
static const char *line_of(const char *key)
{
  static char lines[4][120];
  static int next;
  char *line = lines[next++ % 4];
  const char *found = NULL;
  for (const char *at = ran.out; (at = strstr(at, key)) != NULL; at += strlen(key)) {
    found = at;
  }
  REQUIRE_SAY(found != NULL, "%s: %s", key, ran.err);
  snprintf(line, sizeof lines[0], "%.*s", (int)strcspn(found, "\n"), found);
  return line;
}

/* Commands of xdotool, when the window is there; then the program must have ended by itself. */
static void window_drive(pid_t child, const char *commands)
{
  char line[1000];
  snprintf(line, sizeof line, "timeout 20 xdotool search --sync --name '^hapode$' >/dev/null && %s",
           commands);
  CHECK_SAY(system(line) == 0, "%s", commands);
  siginfo_t about = {0};
  for (int i = 0; i < 100 && about.si_pid != child; ++i) {
    (void)usleep(100000);
    REQUIRE(waitid(P_PID, (id_t)child, &about, WEXITED | WNOWAIT | WNOHANG) == 0);
  }
  kill(child, SIGKILL); /* no more than a ghost, or the test fails by its code */
  CHECK(program_finish(child) == 0);
}

TEST(a_window_changes_nothing)
{
  display_open();
  const char *const scenes[] = {"row10", "lightstand", "grasp", "peg"};
  for (size_t i = 0; i < sizeof scenes / sizeof scenes[0]; ++i) {
    REQUIRE(run("--scene %s --lockstep --seconds 0.4", scenes[i]) == 0);
    const char *hash = line_of("trace_hash: ");
    const char *locks = line_of("locks: ");
    REQUIRE_SAY(
        run("--scene %s --lockstep --seconds 0.4 --shot-size 400x320 --view", scenes[i]) == 0, "%s",
        ran.err);
    CHECK_SAY(strcmp(hash, line_of("trace_hash: ")) == 0, "%s", scenes[i]);
    CHECK_SAY(strcmp(locks, line_of("locks: ")) == 0, "%s", scenes[i]);
  }
}

TEST(threads_have_a_window_too)
{
  display_open();
  REQUIRE(run("--scene row10:3 --seconds 0.6 --no-realtime --shot-size 400x320 --view") == 0);
  CHECK(strcmp(line_of("locks: "), "locks: 0") == 0);
  CHECK(strcmp(line_of("faults: "), "faults: 0") == 0);
}

TEST(keys_change_the_run)
{
  display_open();
  pid_t child = program_start("--view --lockstep --scene row10 --shot-size 400x320", NULL);
  window_drive(child, "xdotool mousemove 200 160 sleep 0.5 key n sleep 1 key Escape");
  CHECK_SAY(strcmp(line_of("scene: "), "scene: row10") != 0, "%s", ran.out);
  child = program_start(
      "--view --lockstep --scene row10 --shot-size 400x320 --keys scene-next=off,quit=x", NULL);
  window_drive(child, "xdotool mousemove 200 160 sleep 0.5 key n sleep 0.5 key x");
  CHECK(strcmp(line_of("scene: "), "scene: row10") == 0);
}

/* Where the trace has its pointer at first and last, m. */
static void ends_of(const char *path, double out[2][3])
{
  char line[4000];
  FILE *file = fopen(path, "r");
  REQUIRE(file != NULL);
  REQUIRE(fgets(line, sizeof line, file) != NULL);
  int count = 0;
  while (fgets(line, sizeof line, file) != NULL) {
    double *at = out[count++ > 0];
    REQUIRE(sscanf(line, "%*[^,],%lf,%lf,%lf", &at[0], &at[1], &at[2]) == 3);
  }
  fclose(file);
  REQUIRE(count > 2);
}

/* The hand stands in the air, 0.1 m high; the eye looks along y. */
TEST(the_mouse_pulls_the_hand)
{
  char arguments[600];
  char path[300];
  double ends[2][3];
  display_open();
  snprintf(path, sizeof path, "%s", folder_path("pulled.csv"));
  snprintf(arguments, sizeof arguments,
           "--view --lockstep --scene row10 --device virtual:path=0:-0.1/0/0.1 --shot-size 400x320 "
           "--camera=0,-1,0.1,0,0,0.1 --trace %s",
           path);
  pid_t child = program_start(arguments, NULL);
  window_drive(child,
               "xdotool mousemove 200 160 sleep 1 mousedown 1 mousemove 220 160 mousemove 240 130 "
               "sleep 0.2 mouseup 1 sleep 1.5 key Escape");
  ends_of(path, ends);
  /* 320 pixels are 2 tan 15 deg at 1 m: 40 to the right, 30 up */
  const double per_pixel = 2.0 * 0.26795 / 320.0;
  CHECK_NEAR(ends[0][0], -0.1, 1e-9);
  CHECK_NEAR(ends[1][0] - ends[0][0], 40.0 * per_pixel, 3e-3);
  CHECK_NEAR(ends[1][1] - ends[0][1], 0.0, 1e-3);
  CHECK_NEAR(ends[1][2] - ends[0][2], 30.0 * per_pixel, 3e-3);
}

/* How far the hand comes that a SpaceMouse pushes: the eye looks along y at first. */
static void spacemouse_push(const char *deflections, double out[3])
{
  char arguments[600];
  char path[300];
  double ends[2][3];
  char from[300];
  (void)snprintf(from, sizeof from, "cp %s %s", getenv("HAPODE_STANDIN_SPNAV"),
                 folder_path("libspnav.so.0"));
  REQUIRE(system(from) == 0);
  setenv("LD_LIBRARY_PATH", test_folder, 1);
  setenv("STANDIN_SPNAV", deflections, 1);
  (void)snprintf(path, sizeof path, "%s", folder_path("pushed.csv"));
  (void)snprintf(arguments, sizeof arguments,
                 "--view --lockstep --scene row10 --device virtual:path=0:-0.1/0/0.3 "
                 "--shot-size 400x320 --camera=0,-1,0.3,0,0,0.3 --trace %s",
                 path);
  pid_t child = program_start(arguments, NULL);
  unsetenv("STANDIN_SPNAV");
  unsetenv("LD_LIBRARY_PATH");
  window_drive(child, "sleep 2 && xdotool mousemove 200 160 key Escape");
  ends_of(path, ends);
  for (int i = 0; i < 3; ++i) {
    out[i] = ends[1][i] - ends[0][i];
  }
}

TEST(a_spacemouse_pushes_the_hand)
{
  double way[3];
  display_open();
  spacemouse_push("500 350 175 0 0 0 0", way); /* right and half as much up */
  CHECK_SAY(way[0] > 0.1 && fabs(way[2] - 0.5 * way[0]) < 0.01 && fabs(way[1]) < 1e-3, "%g %g %g",
            way[0], way[1], way[2]);
  spacemouse_push("500 0 0 350 0 0 0", way); /* away */
  CHECK_SAY(way[1] > 0.1 && fabs(way[0]) < 1e-3 && fabs(way[2]) < 1e-3, "%g %g %g", way[0], way[1],
            way[2]);
  /* turned counter-clockwise as seen from above: what is right is nearer now */
  spacemouse_push("400 0 0 0 0 350 0;500 350 0 0 0 0 0", way);
  CHECK_SAY(way[0] > 0.05 && way[1] < -0.05 && fabs(way[2]) < 1e-3, "%g %g %g", way[0], way[1],
            way[2]);
  spacemouse_push("400 0 0 0 350 0 0;500 0 0 350 0 0 0", way); /* the eye rose: away is down, too */
  CHECK_SAY(way[1] > 0.05 && way[2] < -0.02, "%g %g %g", way[0], way[1], way[2]);
  spacemouse_push("500 0 0 0 0 0 0", way);
  CHECK_SAY(fabs(way[0]) + fabs(way[1]) + fabs(way[2]) < 1e-6, "%g", way[0]);
}

TEST(a_recording_is_looked_at)
{
  char arguments[400];
  char path[300];
  display_open();
  snprintf(path, sizeof path, "%s", folder_path("run.rec"));
  REQUIRE(run("--scene row10:3 --seconds 0.6 --no-realtime --record %s", path) == 0);
  snprintf(arguments, sizeof arguments, "--view --shot-size 400x320 --play %s", path);
  pid_t child = program_start(arguments, NULL);
  window_drive(child,
               "xdotool mousemove 200 160 sleep 1 key Left key Right key space sleep 0.3 "
               "mousemove 200 244 mousedown 1 mousemove 300 244 mouseup 1 key Escape");
  CHECK(strcmp(line_of("replay: "), "replay: identical") == 0);
}

TEST(without_a_display_a_sentence_says_so)
{
  unsetenv("DISPLAY");
  unsetenv("WAYLAND_DISPLAY");
  CHECK(run("--view --lockstep --seconds 0.01") == 2);
  CHECK(says("--view needs a display"));
  CHECK(ran.out[0] == '\0');
}

TEST(wrong_usage_is_refused)
{
  const struct {
    const char *arguments;
    const char *text;
  } cases[] = {{"--view --shot a.png", "not with --shot"},
               {"--keys quit=x", "only with --view"},
               {"--view --keys quit=n", "two things"},
               {"--view --keys fly=n", "scene-next"},
               {"--view --keys quit=F13", "F1 to F12"}};
  for (size_t i = 0; i < sizeof cases / sizeof cases[0]; ++i) {
    CHECK_SAY(run("%s", cases[i].arguments) == 2, "%s", cases[i].arguments);
    CHECK_SAY(says(cases[i].text), "%s", cases[i].arguments);
  }
}

SET_UP
{
  return program_use("HAPODE_RUN");
}
