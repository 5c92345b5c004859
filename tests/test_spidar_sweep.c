/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* hapode-run --calibrate with the spidar-emulator, whose hand follows a script and whose motors
 * are not quite where the model has them. In real time; nothing asks how long it took. */

#include "tests/files.h"
#include "tests/tap.h"

#include <stdint.h>

#include "base/vec.h"
#include "bench/spidar_truth.h"
#include "plugins/spidar/calibration.h"
#include "tests/spidar_rig.h"

#define SWEEP "12" /* s */
#define PATH_SIZE 6000

static emulated machine;
static hapi_spidar_model bent; /* what the emulator is */
static char bent_path[160];
static char found_path[160];
static char said_path[160];

/* ---- the emulator and its hand ---- */

static bool model_bend(void)
{
  hap_detail detail = {""};
  bent = *hapi_spidar_model_find("x4r");
  snprintf(bent.name, sizeof bent.name, "bent");
  bent.motor[0][0] += 2.0e-3;
  bent.motor[5][2] -= 2.0e-3;
  bent.motor[6][1] += 1.5e-3;
  return hapi_spidar_model_write(bent_path, &bent, &detail) >= HAP_OK;
}

/* At home for long enough to be told so, then from place to place, each axis within its reach. */
static void hand_wander(const double reach[3], double step, uint64_t *seed, char *out)
{
  size_t used = (size_t)snprintf(out, PATH_SIZE, "0:0/0/0;2:0/0/0");
  double time = 2.0;
  while (time < 40.0) {
    time += step;
    used += (size_t)snprintf(out + used, PATH_SIZE - used, ";%.2f:%.4f/%.4f/%.4f", time,
                             reach[0] * spidar_random(seed), reach[1] * spidar_random(seed),
                             reach[2] * spidar_random(seed));
  }
  (void)snprintf(out + used, PATH_SIZE - used, ";%.2f:0/0/0", time + step);
}

static bool start_machine(void)
{
  static char path[PATH_SIZE];
  static char turn[PATH_SIZE];
  const double reach[3] = {0.03, 0.038, 0.03};
  const double angle[3] = {0.6, 0.6, 0.6};
  uint64_t seed = 5;
  hand_wander(reach, 0.5, &seed, path);
  hand_wander(angle, 0.7, &seed, turn);
  const char *const arguments[] = {"--model", bent_path, "--fifo", "40", "--path",
                                   path,      "--turn",  turn,     NULL};
  return emulated_start(&machine, arguments);
}

/* ---- the program ---- */

/* typed: what comes on its stdin. The exit status. */
static int model_calibrate(const char *typed, const char *options)
{
  char command[2000];
  snprintf(command, sizeof command,
           "printf '%s' | \"%s\" --calibrate %s %s --device spidar:%s,model=x4r,timeout=5,stall=10 "
           ">%s 2>&1",
           typed, getenv("HAPODE_RUN"), found_path, options, machine.port, said_path);
  int status = system(command);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

static bool output_said(const char *text)
{
  static char all[20000];
  FILE *file = fopen(said_path, "r");
  size_t count = file != NULL ? fread(all, 1, sizeof all - 1, file) : 0;
  if (file != NULL) {
    fclose(file);
  }
  all[count] = '\0';
  if (strstr(all, text) == NULL) {
    printf("# no \"%s\" in \"%s\"\n", text, all);
    return false;
  }
  return true;
}

static bool was_written(void)
{
  return access(found_path, F_OK) == 0;
}

/* ---- how good what was found is ---- */

/* m, root mean square of the places' errors over the workspace, with counts as the emulator has
 * them; in the axes of what is found at home, as the whole frame may be elsewhere. */
static double error_of(const hapi_spidar_model *found)
{
  enum {
    POSES = 200
  };
  hapi_spidar_model real = bent;
  hap_pose home;
  hap_pose at_home = {{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
  double none[HAPI_SPIDAR_STRINGS_MAX] = {0.0};
  uint64_t seed = 9;
  double sum = 0.0;
  hapi_spidar_home(&home);
  hapi_spidar_calibrate_at(&real, &home, none);
  for (int n = -1; n < POSES; ++n) {
    hap_pose pose = home;
    hapi_spidar_solver solver;
    double counts[HAPI_SPIDAR_STRINGS_MAX] = {0.0};
    double lengths[HAPI_SPIDAR_STRINGS_MAX] = {0.0};
    if (n >= 0) {
      spidar_random_pose(&real, 0.8, &seed, &pose);
    }
    spidar_counts(&real, &pose, counts);
    hapi_spidar_measure(found, counts, lengths);
    hapi_spidar_solver_init(&solver, found, &pose);
    for (int i = 0; i < 10; ++i) {
      (void)hapi_spidar_solve(&solver, found, lengths);
    }
    if (n < 0) {
      at_home = solver.pose;
    }
    hapi_pose_unpoint(at_home.position, at_home.quat_wxyz, solver.pose.position,
                      solver.pose.position);
    double off = spidar_distance(&solver.pose, &pose);
    sum += n < 0 ? 0.0 : off * off;
  }
  return sqrt(sum / POSES);
}

/* m, as in test_spidar_calibration: what the place of the whole frame does not change. */
static double frame_error(const hapi_spidar_model *found)
{
  double worst = 0.0;
  for (int i = 0; i < found->strings; ++i) {
    for (int k = 0; k < i; ++k) {
      double way[2][3];
      hapi_v3_sub(found->motor[i], found->motor[k], way[0]);
      hapi_v3_sub(bent.motor[i], bent.motor[k], way[1]);
      worst = fmax(worst, fabs(hapi_v3_norm(way[0]) - hapi_v3_norm(way[1])));
    }
  }
  return worst;
}

/* ---- tests ---- */

static double error_at_home; /* of home alone */

TEST(who_writes_home_is_content_with_it)
{
  hapi_spidar_model m;
  hap_detail detail = {""};
  CHECK(model_calibrate("\\nhome\\n", "") == 0);
  CHECK(output_said("offsets_m:"));
  REQUIRE(hapi_spidar_model_read(found_path, &m, &detail) == HAP_OK);
  const hapi_spidar_model *x4r = hapi_spidar_model_find("x4r");
  CHECK(m.calibrated && memcmp(m.motor, x4r->motor, sizeof m.motor) == 0);
  error_at_home = error_of(&m);
  unlink(found_path);
}

TEST(a_sweep_finds_where_the_motors_are)
{
  hapi_spidar_model m;
  hap_detail detail = {""};
  CHECK(emulated_await(&machine, true));
  CHECK(model_calibrate("\\n\\n", "--seconds " SWEEP) == 0);
  CHECK(output_said("found: offsets and motor points"));
  CHECK(output_said("turned by"));
  REQUIRE(hapi_spidar_model_read(found_path, &m, &detail) == HAP_OK);
  double error = error_of(&m);
  double frame = frame_error(&m);
  printf("# places off by %.3f mm rms, with home alone by %.3f mm; motors by %.2f mm of %.2f mm\n",
         1e3 * error, 1e3 * error_at_home, 1e3 * frame,
         1e3 * frame_error(hapi_spidar_model_find("x4r")));
  CHECK(error < 0.25 * error_at_home);
  CHECK(m.calibrated && frame < 0.6e-3);
  unlink(found_path);
}

TEST(a_sweep_that_says_too_little_leaves_no_file)
{
  CHECK(emulated_await(&machine, true));
  CHECK(model_calibrate("\\n\\n\\n", "") != 0);
  CHECK(output_said("record more"));
  CHECK(!was_written());
  CHECK(emulated_await(&machine, true));
  CHECK(model_calibrate("\\n\\n", "--seconds 0.5") != 0); /* at home still */
  CHECK(output_said("move the grip further"));
  CHECK(!was_written());
}

TEST(nothing_is_written_when_nobody_is_there_or_the_cable_is_pulled)
{
  CHECK(emulated_await(&machine, true));
  CHECK(model_calibrate("", "") != 0);
  CHECK(!was_written());
  REQUIRE(emulated_tell(&machine, "hand hold"));
  pid_t child = fork();
  if (child == 0) {
    emulated_sleep(1.5);
    _exit(emulated_tell(&machine, "unplug") ? 0 : 1);
  }
  CHECK(model_calibrate("\\n\\n", "") == 1);
  CHECK(output_said("cable"));
  CHECK(!was_written());
  CHECK(waitpid(child, NULL, 0) == child);
}

static void machine_stop(void)
{
  emulated_stop(&machine);
}

SET_UP
{
  signal(SIGPIPE, SIG_IGN);
  if (!folder_make()) {
    return false;
  }
  snprintf(bent_path, sizeof bent_path, "%s", folder_path("bent.txt"));
  snprintf(found_path, sizeof found_path, "%s", folder_path("found.txt"));
  snprintf(said_path, sizeof said_path, "%s", folder_path("said"));
  tap_at_end(machine_stop);
  return (model_bend() && start_machine()) ||
         tap_skip_all("no emulator, or no pseudo-terminal: set HAPODE_SPIDAR_EMULATOR");
}
