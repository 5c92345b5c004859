/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The program hapode-bench: each of its names runs and leaves its table, errors have their exit
 * codes. Of the numbers only those are checked that are no times. HAPODE_BENCH: path of the
 * program. */

#include "tests/tap.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tools/plot.h"

#define ARGUMENTS_MAX 8
#define LINE_MAX_LENGTH 4096

static char folder[256]; /* of this test alone */

static const char *file_in_folder(const char *name, const char *extension)
{
  static char paths[4][320];
  static int next;
  char *path = paths[next++ % 4];
  snprintf(path, sizeof paths[0], "%s/%s%s", folder, name, extension);
  return path;
}

/* Exit code; what the program says goes to the file "said". -1: it did not end by itself. */
static int run(const char *const arguments[], char **environment)
{
  static char words[ARGUMENTS_MAX][320]; /* posix_spawn's are not const */
  char *argv[ARGUMENTS_MAX + 2] = {getenv("HAPODE_BENCH")};
  posix_spawn_file_actions_t actions;
  pid_t child = -1;
  int result = 0;
  for (int i = 0; i < ARGUMENTS_MAX && arguments[i] != NULL; ++i) {
    snprintf(words[i], sizeof words[i], "%s", arguments[i]);
    argv[i + 1] = words[i];
  }
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, file_in_folder("said", ""),
                                   O_WRONLY | O_CREAT | O_TRUNC, 0600);
  posix_spawn_file_actions_adddup2(&actions, STDOUT_FILENO, STDERR_FILENO);
  if (argv[0] == NULL || posix_spawn(&child, argv[0], &actions, NULL, argv, environment) != 0) {
    child = -1;
  }
  posix_spawn_file_actions_destroy(&actions);
  bool ended = child > 0 && waitpid(child, &result, 0) == child && WIFEXITED(result);
  return ended ? WEXITSTATUS(result) : -1;
}

static bool exists(const char *path)
{
  struct stat info;
  return stat(path, &info) == 0;
}

/* Lines that contain the text. */
static int count_lines(const char *path, const char *text)
{
  char line[LINE_MAX_LENGTH];
  int count = 0;
  FILE *file = fopen(path, "r");
  while (file != NULL && fgets(line, sizeof line, file) != NULL) {
    count += strstr(line, text) != NULL;
  }
  if (file != NULL) {
    fclose(file);
  }
  return count;
}

/* Rows that are whole: as many columns as the header, and no number that is none. */
static int count_rows(const char *path, const char *header)
{
  char line[LINE_MAX_LENGTH];
  int rows = -1;
  FILE *file = fopen(path, "r");
  size_t columns = 0;
  for (const char *c = header; *c != '\0'; ++c) {
    columns += *c == ',';
  }
  while (file != NULL && fgets(line, sizeof line, file) != NULL) {
    size_t commas = 0;
    line[strcspn(line, "\n")] = '\0';
    for (const char *c = line; *c != '\0'; ++c) {
      commas += *c == ',';
    }
    CHECK(commas == columns);
    CHECK(strstr(line, "nan") == NULL && strstr(line, "inf") == NULL);
    if (rows < 0) {
      CHECK(strcmp(line, header) == 0);
    }
    ++rows;
  }
  if (file != NULL) {
    fclose(file);
  }
  return rows;
}

static void check_program(const char *name, const char *header, int rows_least)
{
  const char *const arguments[] = {name, "--quick", "--out", folder, NULL};
  REQUIRE(run(arguments, environ) == 0);
  CHECK(count_rows(file_in_folder(name, ".csv"), header) >= rows_least);
  CHECK(!plot_available() || exists(file_in_folder(name, ".svg")));
  unlink(file_in_folder(name, ".csv"));
  unlink(file_in_folder(name, ".svg"));
}

TEST(fig5_leaves_its_tables)
{
  check_program("fig5", "model,t,force_n,stiffness,physics_hz", 1000);
  CHECK(count_rows(file_in_folder("fig5_summary", ".csv"),
                   "model,physics_hz,stiffness,contact_s,peak_n,impulse_ns") == 21);
  unlink(file_in_folder("fig5_summary", ".csv"));
}

TEST(fig5_is_as_the_paper_and_the_closed_form_say)
{
  const char *const arguments[] = {"fig5", "--verify", "--quick", "--out", folder, NULL};
  CHECK(run(arguments, environ) == 0);
  CHECK(count_lines(file_in_folder("said", ""), "ok ") >= 24);
  CHECK(count_lines(file_in_folder("said", ""), "fig5: 0 off") == 1);
}

#define EFFECTS_COLUMNS                                                                      \
  "scene,effect,state,reason,tick_us,physics_ms,instructions,contact_us,total_ms,force_rel," \
  "model,own_tick_us,own_physics_ms,own_contact_us"

/* A scene of which each effect is measured: in model contact 12 are on, off and auto beside all of them, in
 * accelerance five, of which testing cannot be off. Instructions are no time; without valgrind they are not
 * counted. */
TEST(effects_are_alike_and_leave_no_code)
{
  const char *const arguments[] = {"effects", "--quick", "--verify", "--scene",
                                   "slide",   "--out",   folder,     NULL};
  CHECK(run(arguments, environ) == 0);
  CHECK(count_lines(file_in_folder("said", ""), "ok   slide, contact: force of auto is") == 1);
  CHECK(count_lines(file_in_folder("said", ""), "ok   slide, accelerance: force of auto is") == 1);
  CHECK(count_lines(file_in_folder("said", ""), "skip instructions are not counted") == 1 ||
        count_lines(file_in_folder("said", ""), "ok   slide: a tick with gyro=off takes") == 1);
  CHECK(count_rows(file_in_folder("effects", ".csv"), EFFECTS_COLUMNS) ==
        3 + 3 * 12 + 3 + 3 * 5 - 1);
  CHECK(!plot_available() || exists(file_in_folder("effects", ".svg")));
  unlink(file_in_folder("effects", ".csv"));
  unlink(file_in_folder("effects", ".svg"));
}

TEST(effects_knows_its_scenes)
{
  const char *const arguments[] = {"effects", "--scene", "slides", "--out", folder, NULL};
  CHECK(run(arguments, environ) == 1);
  CHECK(count_lines(file_in_folder("said", ""), "slides") == 1);
  unlink(file_in_folder("effects", ".csv"));
}

/* Of the checks those that are no times hold on every machine. */
TEST(edits_leaves_its_table)
{
  const char *const arguments[] = {"edits", "--quick", "--verify", "--out", folder, NULL};
  int status = run(arguments, environ);
  CHECK(status == 0 || status == 1);
  CHECK(count_lines(file_in_folder("said", ""),
                    " 0 bad, 0 devices not released, 0 faults, 0 wrong") == 3);
  CHECK(count_lines(file_in_folder("said", ""), "ok     momentum: hands gave") == 3);
  CHECK(count_rows(file_in_folder("edits", ".csv"),
                   "drive,model,seconds,hands,editors,edits,posts,ticks,missed_ticks,contact_ticks,"
                   "physics_steps,physics_missed,physics_ms_max,locks,wait_ms_p50,wait_ms_p99,"
                   "wait_ms_max,held_ms_max,peak_n,steepest_n,lost,untold,impulse_abs_ns,momentum_"
                   "error_ns,faults") == 3);
  CHECK(!plot_available() || exists(file_in_folder("edits", ".svg")));
  unlink(file_in_folder("edits", ".csv"));
  unlink(file_in_folder("edits", ".svg"));
}

TEST(fig6_leaves_its_table)
{
  check_program("fig6", "model,step,t,duty,testing,bodies,layout,neighbours,tick_us", 1000);
}

TEST(fig7_leaves_its_table)
{
  check_program("fig7", "model,step,t,duty,testing,bodies,layout,neighbours,tick_us", 1000);
  unlink(file_in_folder("fig7_sizes", ".svg"));
}

/* Of the checks those that are no times hold on every machine. */
TEST(spidar_numerics_hold)
{
  const char *const arguments[] = {"spidar", "--quick", "--verify", "--out", folder, NULL};
  int status = run(arguments, environ);
  CHECK(status == 0 || status == 1);
  CHECK(count_lines(file_in_folder("said", ""), "ok ") >= 7 * 6);
  CHECK(count_rows(file_in_folder("spidar", ".csv"),
                   "model,strings,dof,position_mm,turn_deg,position_rms_mm,turn_rms_deg,bound_mm,"
                   "bound_deg,excess_counts,calls,lost,velocity_mm_s,velocity_windows_mm_s,"
                   "velocity_difference_mm_s,angular_rad_s,angular_windows_rad_s,"
                   "angular_difference_rad_s,qp_gap,qp_brute_n,changes,force_reached,"
                   "torque_reached,force_n,torque_nm,solve_us,tensions_us,jump_us") == 7);
  CHECK(!plot_available() || exists(file_in_folder("spidar", ".svg")));
  unlink(file_in_folder("spidar", ".csv"));
  unlink(file_in_folder("spidar", ".svg"));
}

/* Its share of late ticks is the machine's; that all were answered is not. */
TEST(the_line_of_a_spidar_is_measured)
{
  const char *const arguments[] = {"line", "--quick", "--verify", "--out", folder, NULL};
  CHECK(run(arguments, environ) == 0);
  CHECK(count_lines(file_in_folder("said", ""), "ok   line: two B3M: 0 of 2000 ticks failed") == 1);
  CHECK(count_lines(file_in_folder("said", ""), "ok   line: one B5M: 0 of 2000 ticks failed") == 1);
  CHECK(count_lines(file_in_folder("said", ""), "by the machine alone (too few to judge)") == 2);
  CHECK(count_lines(file_in_folder("said", ""), "a pulled cable failed with its cause after") == 2);
  CHECK(count_rows(file_in_folder("line", ".csv"),
                   "model,boards,realtime,ticks,late,missed,late_share,tick_us_p50,tick_us_p99,"
                   "tick_us_max,floor_ticks,floor_late,floor_missed,floor_late_share,pulled_ms") ==
        2);
  unlink(file_in_folder("line", ".csv"));
}

TEST(scaling_leaves_its_table)
{
  check_program("scaling",
                "bodies,neighbours,model,build_ms,step_ms,tick_us,probes,probe_ms,island_step_ms,"
                "library_ms,scene,range,owned,range_ms,publish_ms,gap",
                21);
}

TEST(jitter_leaves_its_table)
{
  check_program("jitter",
                "rate_hz,policy,p50_us,p99_us,p999_us,max_us,missed,source,turn,ticks,tick_us_p50,"
                "tick_us_p99,tick_us_max,minor_faults,major_faults,voluntary_switches,"
                "involuntary_switches",
                12);
}

TEST(poses_are_drawn_within_their_bound)
{
  const char *const arguments[] = {"poses", "--verify", "--quick", "--out", folder, NULL};
  CHECK(run(arguments, environ) == 0);
  CHECK(count_lines(file_in_folder("said", ""), "poses: 0 off") == 1);
  CHECK(count_rows(file_in_folder("poses", ".csv"),
                   "scene,model,physics_hz,frame_hz,frames,moved_mm,gap_mm,hand_mm,"
                   "undelayed_hand_mm,path_mm,jump_mm,back_mm") == 8);
  CHECK(count_rows(file_in_folder("poses_cost", ".csv"), "bodies,call_us") == 5);
  CHECK(!plot_available() || exists(file_in_folder("poses", ".svg")));
  unlink(file_in_folder("poses", ".csv"));
  unlink(file_in_folder("poses", ".svg"));
  unlink(file_in_folder("poses_cost", ".csv"));
}

TEST(couplings_are_side_by_side)
{
  const char *const arguments[] = {"couplings", "--verify", "--quick", "--out", folder, NULL};
  CHECK(run(arguments, environ) == 0);
  CHECK(count_lines(file_in_folder("said", ""), "couplings: 0 off") == 1);
  CHECK(count_rows(file_in_folder("couplings", ".csv"),
                   "coupling,scene,force_rel_rms,torque_rel_rms,peak_ratio,penetration_mm,tick_us,"
                   "stable_stiffness,mass_felt,damping_felt") == 24);
  CHECK(!plot_available() || exists(file_in_folder("couplings", ".svg")));
  unlink(file_in_folder("couplings", ".csv"));
  unlink(file_in_folder("couplings", ".svg"));
}

TEST(impedance_is_that_of_the_closed_forms)
{
  const char *const arguments[] = {"impedance", "--verify", "--quick", "--out", folder, NULL};
  const char *const names[] = {"impedance", "zwidth"};
  CHECK(run(arguments, environ) == 0);
  /* Two of each of six bodies direct and through a proxy, two of each of four walls of four devices. */
  CHECK(count_lines(file_in_folder("said", ""), "ok ") == 2 * 2 * 6 + 2 * 4 * 4);
  CHECK(count_lines(file_in_folder("said", ""), "impedance: 0 off") == 1);
  CHECK(count_rows(file_in_folder("impedance", ".csv"),
                   "case,model,coupling,hz,amplitude_m,stiffness_felt,damping_felt,mass_felt,"
                   "stiffness_true,damping_true,mass_true,magnitude_felt,magnitude_true,error,"
                   "phase_error_deg,residual,contact_share,error_sampled") == 6 * 5 * 10);
  CHECK(count_rows(file_in_folder("zwidth", ".csv"),
                   "device,mass,damping,delay,wall_damping,direct_stiffness,linear_stiffness,"
                   "passive_stiffness,coupling_stiffness,proxy_stiffness,proxy_felt") == 4 * 4);
  for (int i = 0; i < 2; ++i) {
    CHECK(!plot_available() || exists(file_in_folder(names[i], ".svg")));
    unlink(file_in_folder(names[i], ".csv"));
    unlink(file_in_folder(names[i], ".svg"));
  }
}

TEST(tick_leaves_its_table)
{
  check_program("tick",
                "model,neighbours,contacts,tick_ns,ns_per_neighbour,p99_ns,scene,phase,rows,sweeps,"
                "ode_ns,pass_ns",
                25);
}

/* ---- accuracy ---- */

#define ACCURACY_COLUMNS                                                                         \
  "scene,model,physics_hz,knob,value,force_rel_rms,impulse_ratio,peak_ratio,tick_us,physics_ms," \
  "duty,haptic_hz,noise_floor,estimate,hand,pose_error_mm,sync_line_n,hand_speed,"               \
  "pose_median_mm,force_rms_n,rest_share,start_um,torque_rel_rms,torque_floor,starts,"           \
  "first_rel_rms,lines,front,joint_open_mm,joint_world_mm,joint_left_mm,joint_floor_mm,"         \
  "joint_turn_deg"

/* Force error of a row of accuracy.csv that begins so; *out_count: how many rows do. */
static double force_error(const char *begin, int *out_count)
{
  char line[LINE_MAX_LENGTH];
  double error = -1.0;
  FILE *file = fopen(file_in_folder("accuracy", ".csv"), "r");
  *out_count = 0;
  while (file != NULL && fgets(line, sizeof line, file) != NULL) {
    if (strncmp(line, begin, strlen(begin)) == 0) {
      error = strtod(line + strlen(begin), NULL);
      ++*out_count;
    }
  }
  if (file != NULL) {
    fclose(file);
  }
  return error;
}

/* One scene; the numbers of all of them have their bounds in the program itself. */
TEST(accuracy_sets_models_side_by_side)
{
  const char *const arguments[] = {"accuracy", "--quick", "--scene", "slide",
                                   "--out",    folder,    NULL};
  const char *const rows[] = {
      "slide,contact,20,default,0,",
      "slide,contact,60,default,0,",
      "slide,accelerance,20,default,0,",
      "slide,accelerance,60,default,0,",
      "slide,impulse,20,default,0,",
      "slide,impulse,60,default,0,",
      "slide,single,1000,default,0,",
      "slide,accelerance,20,operating,0,",
      "slide,accelerance,60,operating,0,",
      "slide,accelerance,20,operating_cross,0,",
      "slide,accelerance,60,operating_cross,0,",
      "slide,accelerance,60,eq4,0,",
      "slide,accelerance,20,paper,0,",
      "slide,contact,20,explicit,0,",
      "slide,contact,20,implicit,0,",
      "slide,contact,20,midpoint,0,",
      "slide,contact,20,plane,0,",
      "slide,contact,20,sweeps,2,",
      "slide,contact,20,range_hops,0,",
      "slide,contact,20,iterations,5,",
      "slide,contact,20,haptic_hz,500,",
      "slide,contact,20,haptic_hz,2000,",
  };
  enum {
    DEFAULTS = 7,
    ROWS = sizeof rows / sizeof rows[0]
  };
  double errors[ROWS];
  REQUIRE(run(arguments, environ) == 0);
  CHECK(count_rows(file_in_folder("accuracy", ".csv"), ACCURACY_COLUMNS) >= ROWS);
  CHECK(count_lines(file_in_folder("accuracy", ".csv"), ",default,") == DEFAULTS);
  for (int i = 0; i < ROWS; ++i) {
    int count = 0;
    errors[i] = force_error(rows[i], &count);
    CHECK(count == 1 && errors[i] >= 0.0);
  }
  CHECK(errors[0] < 0.01 && errors[0] < 0.1 * errors[2]);
  CHECK(errors[1] < 0.01 && errors[1] < 0.5 * errors[3]);
  CHECK(errors[4] > 0.5); /* friction: a force on the last known pose is not near */
  CHECK(errors[6] < 1e-3);
  CHECK(errors[8] < 0.5 * errors[11]); /* the cube slides: eq. 4 asks one that rests */
  CHECK(errors[9] == errors[7] && errors[10] == errors[8]); /* a body alone */
  CHECK(errors[12] > 0.5);                              /* the paper's probes are those of eq. 4 */
  CHECK(errors[13] < 1e-6);                             /* the reference is explicit as well */
  CHECK(errors[14] > 0.01);                             /* 1 kHz is slow for this spring */
  CHECK(errors[17] > 2e-4 && errors[17] != errors[13]); /* two sweeps do not solve it */
  CHECK(errors[18] < 0.01 && errors[19] < 0.01);        /* a body alone needs neither */
  CHECK(errors[20] > 1.5e-3 && errors[21] < errors[20]);
  CHECK(!plot_available() || exists(file_in_folder("accuracy", ".svg")));
  CHECK(!plot_available() || exists(file_in_folder("accuracy_slide", ".svg")));
  CHECK(!exists(file_in_folder("accuracy", ".rows")));
}

TEST(accuracy_says_how_far_joints_open)
{
  const char *const arguments[] = {"accuracy", "--quick", "--verify", "--scene",
                                   "lever",    "--out",   folder,     NULL};
  REQUIRE(run(arguments, environ) == 0);
  CHECK(count_rows(file_in_folder("accuracy", ".csv"), ACCURACY_COLUMNS) > 0);
  CHECK(count_lines(file_in_folder("said", ""), "ok   lever at 20 Hz: joints open by") == 1);
  CHECK(count_lines(file_in_folder("said", ""), "ok   lever at 60 Hz: joints open by") == 1);
}

TEST(accuracy_knows_its_scenes)
{
  const char *const arguments[] = {"accuracy", "--scene", "slides", "--out", folder, NULL};
  CHECK(run(arguments, environ) == 1);
  CHECK(count_lines(file_in_folder("said", ""), "slides") == 1);
}

/* The whole map takes minutes; a part of it has no picture. */
TEST(stability_of_some_points_alone)
{
  const char *const arguments[] = {
      "stability", "--quick",
      "--only",    "stiffness=1,mass=1e-3/2,contacts=8,layout=cage,coupling=proxy/auto",
      "--out",     folder,
      NULL};
  REQUIRE(run(arguments, environ) == 0);
  const char *path = file_in_folder("stability", ".csv");
  CHECK(count_lines(path, "implicit+proxy,1,0.001,8,1,") == 2);
  CHECK(count_lines(path, "") == 3); /* the header as well */
  CHECK(!exists(file_in_folder("stability", ".svg")));
  unlink(file_in_folder("stability", ".csv"));
}

TEST(stability_knows_its_points)
{
  static const char *const wrong[] = {
      "stiff=1", "mass", "mass=", "mass=1/", "mass=1x", "hand=,body=cube"};
  for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; ++i) {
    const char *const arguments[] = {"stability", "--only", wrong[i], "--out", folder, NULL};
    CHECK(run(arguments, environ) == 1);
    CHECK(count_lines(file_in_folder("said", ""), "keys are integrator, stiffness") == 1);
  }
  const char *const none[] = {"stability", "--only", "mass=3", "--out", folder, NULL};
  CHECK(run(none, environ) == 1);
  CHECK(count_lines(file_in_folder("said", ""), "no such point") == 1);
  unlink(file_in_folder("stability", ".csv"));
}

TEST(without_gnuplot_a_line_says_that_there_is_no_picture)
{
  const char *const arguments[] = {"fig5", "--out", folder, NULL};
  char path[] = "PATH=/nowhere";
  char *environment[] = {path, NULL};
  unlink(file_in_folder("fig5", ".svg"));
  CHECK(run(arguments, environment) == 0);
  CHECK(count_lines(file_in_folder("said", ""), "no picture") == 1);
  CHECK(exists(file_in_folder("fig5", ".csv")));
  CHECK(!exists(file_in_folder("fig5", ".svg")));
}

TEST(wrong_usage_is_2_and_says_what_there_is)
{
  const char *const cases[][ARGUMENTS_MAX] = {
      {NULL},
      {"fig55", NULL},
      {"fig5", "fig6", NULL},
      {"fig5", "--fast", NULL},
      {"fig5", "--out", NULL},
      {"fig5", "--scene", "slide", NULL},
      {"fig5", "--only", "mass=1", NULL},
  };
  for (size_t i = 0; i < sizeof cases / sizeof cases[0]; ++i) {
    CHECK(run(cases[i], environ) == 2);
    CHECK(count_lines(file_in_folder("said", ""), "scaling") == 1);
  }
}

TEST(a_folder_that_cannot_be_is_1)
{
  const char *const arguments[] = {"fig5", "--out", "/dev/null/x", NULL};
  CHECK(run(arguments, environ) == 1);
  CHECK(count_lines(file_in_folder("said", ""), "/dev/null/x") == 1);
}

int main(void)
{
  const char *temporary = getenv("TMPDIR");
  snprintf(folder, sizeof folder, "%s/hapode-bench-XXXXXX", temporary != NULL ? temporary : "/tmp");
  if (getenv("HAPODE_BENCH") == NULL || mkdtemp(folder) == NULL) {
    printf("1..0 # SKIP needs HAPODE_BENCH and a folder for files\n");
    return 0;
  }
  RUN(fig5_leaves_its_tables);
  RUN(fig5_is_as_the_paper_and_the_closed_form_say);
  RUN(effects_are_alike_and_leave_no_code);
  RUN(effects_knows_its_scenes);
  RUN(edits_leaves_its_table);
  RUN(fig6_leaves_its_table);
  RUN(fig7_leaves_its_table);
  RUN(jitter_leaves_its_table);
  RUN(spidar_numerics_hold);
  RUN(the_line_of_a_spidar_is_measured);
  RUN(scaling_leaves_its_table);
  RUN(poses_are_drawn_within_their_bound);
  RUN(couplings_are_side_by_side);
  RUN(impedance_is_that_of_the_closed_forms);
  RUN(tick_leaves_its_table);
  RUN(accuracy_sets_models_side_by_side);
  RUN(accuracy_says_how_far_joints_open);
  RUN(accuracy_knows_its_scenes);
  RUN(stability_of_some_points_alone);
  RUN(stability_knows_its_points);
  RUN(without_gnuplot_a_line_says_that_there_is_no_picture);
  RUN(wrong_usage_is_2_and_says_what_there_is);
  RUN(a_folder_that_cannot_be_is_1);
  const char *const left[] = {"fig5.csv",     "fig5.svg",     "fig5_summary.csv",
                              "accuracy.csv", "accuracy.svg", "accuracy_slide.svg",
                              "said"};
  for (size_t i = 0; i < sizeof left / sizeof left[0]; ++i) {
    unlink(file_in_folder(left[i], ""));
  }
  rmdir(folder);
  return tap_done();
}
