/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The program hapode-bench: each of its names runs and leaves its table, errors have their exit
 * codes. Of the numbers only those are checked that are no times. HAPODE_BENCH: path of the
 * program. */

#include "tests/program.h"
#include "tests/tap.h"

#include <stdarg.h>

#include "tools/plot.h"

/* Into the folder, which is empty before; the exit code. */
static int bench_run(const char *format, ...)
{
  char arguments[1000];
  va_list list;
  va_start(list, format);
  vsnprintf(arguments, sizeof arguments, format, list);
  va_end(list);
  folder_clear();
  return run("%s --out %s", arguments, test_folder);
}

static const char *csv_path(const char *name)
{
  char file[100];
  snprintf(file, sizeof file, "%s.csv", name);
  return folder_path(file);
}

static bool picture_exists(const char *name)
{
  char file[100];
  snprintf(file, sizeof file, "%s.svg", name);
  return file_exists(folder_path(file));
}

static int commas_in(const char *line)
{
  int commas = 0;
  for (; *line != '\0' && *line != '\n'; ++line) {
    commas += *line == ',';
  }
  return commas;
}

/* Rows that are whole: as many columns as the header, and no NaN or infinity. */
static int table_rows(const char *name, const char *header)
{
  const char *text = file_text(csv_path(name));
  int rows = -1;
  CHECK(lines_with(text, "nan") == 0 && lines_with(text, "inf") == 0);
  CHECK(strncmp(text, header, strlen(header)) == 0 && text[strlen(header)] == '\n');
  for (const char *line = text; *line != '\0'; line += strcspn(line, "\n") + 1) {
    CHECK(commas_in(line) == commas_in(header));
    ++rows;
  }
  return rows;
}

static void check_picture(const char *name)
{
  CHECK(!plot_available() || picture_exists(name));
}

static void check_program(const char *name, const char *header, int rows_least)
{
  REQUIRE(bench_run("%s --quick", name) == 0);
  CHECK(table_rows(name, header) >= rows_least);
  check_picture(name);
}

typedef struct plain_table {
  const char *name;
  const char *program;
  const char *header;
  int rows_least;
} plain_table;

static const plain_table tables[] = {
    {"fig6_leaves_its_table", "fig6", "model,step,t,duty,testing,bodies,layout,neighbours,tick_us",
     1000},
    {"fig7_leaves_its_table", "fig7", "model,step,t,duty,testing,bodies,layout,neighbours,tick_us",
     1000},
    {"scaling_leaves_its_table", "scaling",
     "bodies,neighbours,model,build_ms,step_ms,tick_us,probes,probe_ms,island_step_ms,"
     "library_ms,scene,range,owned,range_ms,publish_ms,gap",
     21},
    {"jitter_leaves_its_table", "jitter",
     "rate_hz,policy,p50_us,p99_us,p999_us,max_us,missed,source,turn,ticks,tick_us_p50,"
     "tick_us_p99,tick_us_max,minor_faults,major_faults,voluntary_switches,"
     "involuntary_switches",
     12},
    {"tick_leaves_its_table", "tick",
     "model,neighbours,contacts,tick_ns,ns_per_neighbour,p99_ns,scene,phase,rows,sweeps,"
     "ode_ns,pass_ns",
     25},
};

TEST_EACH(tables, const plain_table *row)
{
  check_program(row->program, row->header, row->rows_least);
}

TEST(fig5_leaves_its_tables)
{
  check_program("fig5", "model,t,force_n,stiffness,physics_hz", 1000);
  CHECK(table_rows("fig5_summary", "model,physics_hz,stiffness,contact_s,peak_n,impulse_ns") == 21);
}

TEST(fig5_is_as_the_paper_and_the_closed_form_say)
{
  CHECK(bench_run("fig5 --verify --quick") == 0);
  CHECK(said_lines("ok ") >= 24);
  CHECK(said_lines("fig5: 0 off") == 1);
}

#define EFFECTS_COLUMNS                                                                      \
  "scene,effect,state,reason,tick_us,physics_ms,instructions,contact_us,total_ms,force_rel," \
  "model,own_tick_us,own_physics_ms,own_contact_us"

/* A scene of which each effect is measured: in model contact 12 are on, off and auto beside all
 * of them, in accelerance five, of which testing cannot be off. Instructions are no time;
 * without valgrind they are not counted. */
TEST(effects_are_alike_and_leave_no_code)
{
  CHECK(bench_run("effects --quick --verify --scene slide") == 0);
  CHECK(said_lines("ok   slide, contact: force of auto is") == 1);
  CHECK(said_lines("ok   slide, accelerance: force of auto is") == 1);
  CHECK(said_lines("skip instructions are not counted") == 1 ||
        said_lines("ok   slide: a tick takes") == 1);
  CHECK(table_rows("effects", EFFECTS_COLUMNS) == 3 + 3 * 12 + 3 + 3 * 5 - 1);
  check_picture("effects");
}

TEST(effects_knows_its_scenes)
{
  CHECK(bench_run("effects --scene slides") == 1);
  CHECK(said_lines("slides") == 1);
}

/* Of the checks those that are no times hold on every machine. */
TEST(edits_leaves_its_table)
{
  int status = bench_run("edits --quick --verify");
  CHECK(status == 0 || status == 1);
  CHECK(said_lines(" 0 bad, 0 devices not released, 0 faults, 0 wrong") == 3);
  CHECK(said_lines("ok     momentum: hands gave") == 3);
  CHECK(table_rows("edits",
                   "drive,model,seconds,hands,editors,edits,posts,ticks,missed_ticks,contact_ticks,"
                   "physics_steps,physics_missed,physics_ms_max,locks,wait_ms_p50,wait_ms_p99,"
                   "wait_ms_max,held_ms_max,peak_n,steepest_n,lost,untold,impulse_abs_ns,momentum_"
                   "error_ns,faults") == 3);
  check_picture("edits");
}

/* Of the checks those that are no times hold on every machine. */
TEST(spidar_numerics_hold)
{
  int status = bench_run("spidar --quick --verify");
  CHECK(status == 0 || status == 1);
  CHECK(said_lines("ok ") >= 7 * 6);
  CHECK(table_rows("spidar",
                   "model,strings,dof,position_mm,turn_deg,position_rms_mm,turn_rms_deg,bound_mm,"
                   "bound_deg,excess_counts,calls,lost,velocity_mm_s,velocity_windows_mm_s,"
                   "velocity_difference_mm_s,angular_rad_s,angular_windows_rad_s,"
                   "angular_difference_rad_s,qp_gap,qp_brute_n,changes,force_reached,"
                   "torque_reached,force_n,torque_nm,solve_us,tensions_us,jump_us") == 7);
  check_picture("spidar");
}

/* Its share of late ticks is the machine's; that all were answered is not. */
TEST(the_line_of_a_spidar_is_measured)
{
  CHECK(bench_run("line --quick --verify") == 0);
  CHECK(said_lines("ok   line: two B3M: 0 of 2000 ticks failed") == 1);
  CHECK(said_lines("ok   line: one B5M: 0 of 2000 ticks failed") == 1);
  CHECK(said_lines("by the machine alone (too few to judge)") == 2);
  CHECK(said_lines("a pulled cable failed with its cause after") == 2);
  CHECK(table_rows("line",
                   "model,boards,realtime,ticks,late,missed,late_share,tick_us_p50,tick_us_p99,"
                   "tick_us_max,floor_ticks,floor_late,floor_missed,floor_late_share,pulled_ms") ==
        2);
}

TEST(poses_are_drawn_within_their_bound)
{
  CHECK(bench_run("poses --verify --quick") == 0);
  CHECK(said_lines("poses: 0 off") == 1);
  CHECK(table_rows("poses",
                   "scene,model,physics_hz,frame_hz,frames,moved_mm,gap_mm,hand_mm,"
                   "undelayed_hand_mm,path_mm,jump_mm,back_mm") == 8);
  CHECK(table_rows("poses_cost", "bodies,call_us") == 5);
  check_picture("poses");
}

TEST(what_an_application_is_promised_holds)
{
  CHECK(bench_run("app --verify --quick") == 0);
  CHECK(said_lines("app: 0 off") == 1);
  CHECK(table_rows("app", "number,case,model,physics_hz,haptic_hz,against,value,bound,unit") >=
        100);
}

TEST(couplings_are_side_by_side)
{
  CHECK(bench_run("couplings --verify --quick") == 0);
  CHECK(said_lines("couplings: 0 off") == 1);
  CHECK(table_rows("couplings",
                   "coupling,scene,force_rel_rms,torque_rel_rms,peak_ratio,penetration_mm,tick_us,"
                   "stable_stiffness,mass_felt,damping_felt") == 24);
  check_picture("couplings");
}

TEST(impedance_is_that_of_the_closed_forms)
{
  CHECK(bench_run("impedance --verify --quick") == 0);
  /* Two of each of six bodies direct and through a proxy, two of each of four walls of four
   * devices. */
  CHECK(said_lines("ok ") == 2 * 2 * 6 + 2 * 4 * 4);
  CHECK(said_lines("impedance: 0 off") == 1);
  CHECK(table_rows("impedance",
                   "case,model,coupling,hz,amplitude_m,stiffness_felt,damping_felt,mass_felt,"
                   "stiffness_true,damping_true,mass_true,magnitude_felt,magnitude_true,error,"
                   "phase_error_deg,residual,contact_share,error_sampled") == 6 * 5 * 10);
  CHECK(table_rows("zwidth",
                   "device,mass,damping,delay,wall_damping,direct_stiffness,linear_stiffness,"
                   "passive_stiffness,coupling_stiffness,proxy_stiffness,proxy_felt,haptic_hz") ==
        4 * 4);
  check_picture("impedance");
  check_picture("zwidth");
}

/* ---- accuracy ---- */

#define ACCURACY_COLUMNS                                                                         \
  "scene,model,physics_hz,knob,value,force_rel_rms,impulse_ratio,peak_ratio,tick_us,physics_ms," \
  "duty,haptic_hz,noise_floor,estimate,hand,pose_error_mm,sync_line_n,hand_speed,"               \
  "pose_median_mm,force_rms_n,rest_share,start_um,torque_rel_rms,torque_floor,starts,"           \
  "first_rel_rms,lines,front,joint_open_mm,joint_world_mm,joint_left_mm,joint_floor_mm,"         \
  "joint_turn_deg"

/* Of the one row of accuracy.csv that begins so. */
static double force_error(const char *begin)
{
  const char *text = file_text(csv_path("accuracy"));
  const char *row = strstr(text, begin);
  CHECK(lines_from(text, begin) == 1);
  return row != NULL ? strtod(row + strlen(begin), NULL) : -1.0;
}

/* One scene; the numbers of all of them have their bounds in the program itself. */
TEST(accuracy_sets_models_side_by_side)
{
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
  REQUIRE(bench_run("accuracy --quick --scene slide") == 0);
  CHECK(lines_with(file_text(csv_path("accuracy")), ",default,") == DEFAULTS);
  for (int i = 0; i < ROWS; ++i) {
    errors[i] = force_error(rows[i]);
    CHECK(errors[i] >= 0.0);
  }
  CHECK(table_rows("accuracy", ACCURACY_COLUMNS) >= ROWS);
  CHECK(errors[0] < 0.01 && errors[0] < 0.1 * errors[2]);
  CHECK(errors[1] < 0.01 && errors[1] < 0.5 * errors[3]);
  CHECK(errors[4] > 0.5); /* friction: a force on the last known pose is not near */
  CHECK(errors[6] < 1e-3);
  CHECK(errors[8] < 0.5 * errors[11]); /* the cube slides: eq. 4 asks one that rests */
  CHECK(errors[9] == errors[7] && errors[10] == errors[8]); /* a body alone */
  CHECK(errors[12] > 0.5);                              /* the paper's probes are those of eq. 4 */
  CHECK(errors[13] < 1e-3);                             /* the reference is explicit as well */
  CHECK(errors[14] > 0.01);                             /* 1 kHz is slow for this spring */
  CHECK(errors[17] > 2e-4 && errors[17] != errors[13]); /* two sweeps do not solve it */
  CHECK(errors[18] < 0.01 && errors[19] < 0.01);        /* a body alone needs neither */
  CHECK(errors[20] > 1.5e-3 && errors[21] < errors[20]);
  check_picture("accuracy");
  check_picture("accuracy_slide");
  CHECK(!file_exists(folder_path("accuracy.rows")));
}

TEST(accuracy_says_how_far_joints_open)
{
  REQUIRE(bench_run("accuracy --quick --verify --scene lever") == 0);
  CHECK(table_rows("accuracy", ACCURACY_COLUMNS) > 0);
  CHECK(said_lines("ok   lever at 20 Hz: joints open by") == 1);
  CHECK(said_lines("ok   lever at 60 Hz: joints open by") == 1);
}

TEST(accuracy_knows_its_scenes)
{
  CHECK(bench_run("accuracy --scene slides") == 1);
  CHECK(said_lines("slides") == 1);
}

/* The whole map takes minutes; a part of it has no picture. */
TEST(stability_of_some_points_alone)
{
  REQUIRE(bench_run("stability --quick --only "
                    "stiffness=1,mass=1e-3/2,contacts=8,layout=cage,coupling=proxy/auto") == 0);
  const char *text = file_text(csv_path("stability"));
  CHECK(lines_with(text, "implicit+proxy,1,0.001,8,1,") == 2);
  CHECK(lines_with(text, "") == 3); /* the header as well */
  CHECK(!picture_exists("stability"));
}

TEST(stability_knows_its_points)
{
  static const char *const wrong[] = {
      "stiff=1", "mass", "mass=", "mass=1/", "mass=1x", "hand=,body=cube"};
  for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; ++i) {
    CHECK(bench_run("stability --only %s", wrong[i]) == 1);
    CHECK(said_lines("keys are map, integrator, stiffness") == 1);
  }
  CHECK(bench_run("stability --only mass=3") == 1);
  CHECK(said_lines("no such point") == 1);
}

TEST(without_gnuplot_a_line_says_that_there_is_no_picture)
{
  char arguments[400];
  char *bare[] = {(char[]){"PATH=/nowhere"}, NULL};
  folder_clear();
  snprintf(arguments, sizeof arguments, "fig5 --out %s", test_folder);
  CHECK(program_finish(program_start(arguments, bare)) == 0);
  CHECK(said_lines("no picture") == 1);
  CHECK(file_exists(csv_path("fig5")));
  CHECK(!picture_exists("fig5"));
}

TEST(wrong_usage_is_2_and_says_what_there_is)
{
  static const char *const cases[] = {"",
                                      "fig55",
                                      "fig5 fig6",
                                      "fig5 --fast",
                                      "fig5 --out",
                                      "fig5 --scene slide",
                                      "fig5 --only mass=1"};
  for (size_t i = 0; i < sizeof cases / sizeof cases[0]; ++i) {
    CHECK(run("%s", cases[i]) == 2);
    CHECK(said_lines("scaling") == 1);
  }
}

TEST(a_folder_that_cannot_be_is_1)
{
  CHECK(run("fig5 --out /dev/null/x") == 1);
  CHECK(said_lines("/dev/null/x") == 1);
}

SET_UP
{
  return program_use("HAPODE_BENCH");
}
