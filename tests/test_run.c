/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The program hapode-run as its users meet it: exit codes, messages, summary, trace, picture.
 * HAPODE_RUN: path of the program. */

#include "tests/program.h"
#include "tests/scene_names.h"
#include "tests/tap.h"

#include <signal.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <hapode/stats.h>

#include "tools/plot.h"

/* The value of a key of the summary; NULL: it is not there. */
static const char *value_of(const char *key)
{
  static char values[4][1000];
  static int next;
  size_t length = strlen(key);
  for (const char *line = ran.out; *line != '\0'; line += strcspn(line, "\n") + 1) {
    if (strncmp(line, key, length) == 0 && strncmp(line + length, ": ", 2) == 0) {
      char *value = values[next++ % 4];
      snprintf(value, sizeof values[0], "%.*s", (int)strcspn(line + length + 2, "\n"),
               line + length + 2);
      return value;
    }
    if (line[strcspn(line, "\n")] == '\0') {
      break;
    }
  }
  return NULL;
}

static double number_of(const char *key)
{
  const char *value = value_of(key);
  char *end = NULL;
  double number = value != NULL ? strtod(value, &end) : (double)NAN;
  return value != NULL && end != value && *end == '\0' ? number : (double)NAN;
}

/* ---- usage ---- */

TEST(help_list_and_version_are_answered)
{
  CHECK(run("--help") == 0);
  CHECK(strstr(ran.out, "--physics-hz") != NULL && strstr(ran.out, "exit:") != NULL);
  CHECK(ran.err[0] == '\0');
  CHECK(run("--version") == 0);
  CHECK(strncmp(ran.out, "hapode-run 0.", 13) == 0);
  CHECK(run("--list") == 0);
  const char *const there[] = {"fig5",
                               "row10[:N]",
                               "pile[:N]",
                               "lightstand",
                               "mass 60 kg",
                               "virtual",
                               "replay",
                               "impulse",
                               "accelerance",
                               "contact",
                               "testing",
                               "k 2000 N/m",
                               "duration 2 s",
                               "accelerance (never off), contact",
                               "install it from haply.co",
                               "install the maker's SDK 3",
                               "run Touch_Setup"};
  for (size_t i = 0; i < sizeof there / sizeof there[0]; ++i) {
    if (strstr(ran.out, there[i]) == NULL) {
      printf("# --list does not tell of %s\n", there[i]);
      CHECK(false);
    }
  }
}

TEST(an_unknown_name_is_answered_with_those_that_exist)
{
  CHECK(run("--scene nowhere") == 2);
  CHECK(says("--scene") && says("nowhere") && says("row10") && says("lightstand"));
  CHECK(run("--model guess") == 2);
  CHECK(says("--model") && says("guess") && says("single") && says("impulse"));
  CHECK(run("--device nothing") == 2);
  CHECK(says("--device") && says("nothing") && says("virtual") && says("replay"));
  CHECK(run("--effects glow=on") == 2);
  CHECK(says("--effects") && says("glow") && says("friction") && says("testing"));
  CHECK(run("--colour red") == 2);
  CHECK(says("--colour") && says("--physics-hz"));
  CHECK(run("row10") == 2);
  CHECK(says("row10"));
}

TEST(a_wrong_value_is_answered_with_what_is_allowed)
{
  const struct {
    const char *arguments;
    const char *option;
    const char *allowed;
  } cases[] = {
      {"--physics-hz 0", "--physics-hz", "1 to 1000"},
      {"--physics-hz nan", "--physics-hz", "1 to 1000"},
      {"--physics-hz=fast", "--physics-hz", "1 to 1000"},
      {"--haptic-hz 99", "--haptic-hz", "100 to 20000"},
      {"--physics-hz 800 --haptic-hz 500", "--physics-hz", "500"},
      {"--contact-hz 5", "--contact-hz", "20 to 1000"},
      {"--seconds -1", "--seconds", "86400"},
      {"--seconds 1x", "--seconds", "86400"},
      {"--seconds", "--seconds", "needs a value"},
      {"--lockstep=1", "--lockstep", "no value"},
      {"--rt-priority 100", "--rt-priority", "0 to 98"},
      {"--impulse-pose bent", "--impulse-pose", "held nor interpolated"},
      {"--probe twice", "--probe", "shared, paper or operating"},
      {"--model-age 0.01", "--model-age", "--lockstep"},
      {"--lockstep --model-age 150", "--model-age", "at most 20 s"},
      {"--effects friction", "--effects", "NAME=on"},
      {"--stiffness 0", "--stiffness", "0.001 to 1e+09"},
      {"--coupling proxy:500 --virtual-mass 1", "--virtual-mass", "--coupling virtual"},
      {"--coupling direct:500", "--coupling", "proxy:K"},
      {"--coupling proxy:x", "--coupling", "0.001 to 1e+09"},
      {"--coupling virtual --model accelerance", "--coupling", "virtual needs --model contact"},
      {"--coupling god-object --effects proxy=off", "--coupling", "--effects"},
      {"--effects proxy=on --model impulse", "--effects", "not supported"},
      {"--effects cross=on", "--effects", "not supported"},
      {"--scene fig5:3", "--scene", "takes no N"},
      {"--scene row10:x", "--scene", "number from 1"},
      {"--device virtual:colour=1", "--device", "path"},
      {"--trace=", "--trace", "empty FILE"},
      {"--trace a --plot a", "--plot", "--trace"},
  };
  for (size_t i = 0; i < sizeof cases / sizeof cases[0]; ++i) {
    bool good = run("%s", cases[i].arguments) == 2 && says(cases[i].option);
    if (!good || !says(cases[i].allowed)) {
      printf("# hapode-run %s: exit %d\n", cases[i].arguments, ran.code);
      CHECK(false);
    }
    CHECK(ran.out[0] == '\0');
  }
}

TEST(what_a_model_cannot_do_is_said)
{
  CHECK(run("--model accelerance --effects gyro=on") == 2);
  CHECK(says("gyro=on") && says("use model contact"));
  CHECK(run("--effects friction=off --friction 0.3") == 2 && says("friction=off"));
  CHECK(run("--lockstep --seconds 0.05 --friction 0.3 --finger-radius 0.004") == 0);
  CHECK(strstr(ran.out, "friction=on") != NULL);
  CHECK(run("--model accelerance --effects testing=off") == 2);
  CHECK(says("testing=off") && says("use model contact"));
  CHECK(run("--model accelerance --effects contacts=on") == 2);
  CHECK(says("contacts=on") && says("use model contact"));
  CHECK(run("--model accelerance --lockstep --seconds 0.05 "
            "--effects friction=off,torque=auto --effects testing=on") == 0);
  CHECK(run("--lockstep --seconds 0.05 --effects shape=off,contacts=on") == 0);
  CHECK(strstr(ran.out, "contacts=on") != NULL && strstr(ran.out, "shape=off") != NULL &&
        strstr(ran.out, "testing=off") != NULL);
  CHECK(run("--lockstep --seconds 0.5 --effects all=on --effects-table") == 0 &&
        strstr(ran.out, "testing=off,cross=off,contacts=on") != NULL &&
        strstr(ran.out, "the loop simulates it all") != NULL &&
        strstr(ran.out, "asked for") != NULL);
}

TEST(ways_of_testing_can_be_chosen)
{
  const char *const ways[] = {"--effects cross=on", "--probe operating", ""};
  char hashes[3][24];
  for (int i = 0; i < 3; ++i) { /* two bodies that touch */
    CHECK(run("--model accelerance --scene stack --physics-hz 20 --lockstep --seconds 0.7 %s",
              ways[i]) == 0);
    CHECK((strstr(value_of("effects"), "cross=on") != NULL) == (i == 0));
    snprintf(hashes[i], sizeof hashes[i], "%s", value_of("trace_hash"));
  }
  CHECK(strcmp(hashes[0], hashes[2]) != 0 && strcmp(hashes[1], hashes[2]) != 0);
}

/* ---- files ---- */

TEST(a_malformed_recording_names_its_line)
{
  file_write(folder_path("bad.csv"), "t,x,y,z\n0,0,0,0\n0.1,0,zero,0\n0.2,0,0,0\n");
  CHECK(run("--lockstep --device replay:%s", folder_path("bad.csv")) == 1);
  CHECK(says("bad.csv") && says("line 3"));
  CHECK(run("--lockstep --device replay:%s", folder_path("absent.csv")) == 1);
  CHECK(says("absent.csv"));
}

TEST(files_that_cannot_be_written_are_found_before_the_run)
{
  CHECK(run("--lockstep --seconds 1 --trace %s", folder_path("no/such/trace.csv")) == 1);
  CHECK(says("--trace") && says("no/such/trace.csv"));
  CHECK(ran.out[0] == '\0');
  CHECK(run("--lockstep --seconds 1 --plot %s", folder_path("no/such/plot.svg")) == 1);
  CHECK(says("--plot") && says("no/such/plot.svg"));
  CHECK(ran.out[0] == '\0');
  CHECK(run("--lockstep --seconds 1 --trace %s", test_folder) == 1);
  CHECK(says("--trace"));
}

/* A reader that comes late, or never, would stop the program. */
TEST(no_file_is_written_to_a_pipe)
{
  static const char *const options[] = {"--trace", "--plot", "--black-box", "--record",
                                        "--identify"};
  REQUIRE(mkfifo(folder_path("pipe"), 0600) == 0);
  for (size_t i = 0; i < sizeof options / sizeof options[0]; ++i) {
    CHECK(run("--seconds 1 --device virtual %s %s", options[i], folder_path("pipe")) == 1);
    CHECK_SAY(says(options[i] + 2) && says("it is a pipe"), "%s: %s", options[i], ran.err);
    CHECK(ran.out[0] == '\0');
  }
  CHECK(run("--lockstep --seconds 0.1 --trace /dev/null") == 0);
}

TEST(a_full_disk_is_a_failure_that_the_hand_does_not_feel)
{
  char hash[32];
  if (access("/dev/full", W_OK) != 0) {
    SKIP("no /dev/full");
  }
  CHECK(run("--lockstep --seconds 0.5") == 0);
  snprintf(hash, sizeof hash, "%s", value_of("trace_hash"));
  CHECK(run("--lockstep --seconds 0.5 --trace /dev/full") == 1);
  CHECK(says("--trace /dev/full: cannot be written: No space left on device"));
  CHECK(number_of("ticks") == 500.0 && strcmp(value_of("trace_hash"), hash) == 0);
  CHECK(number_of("trace_dropped") == 0.0);
  CHECK(run("--lockstep --seconds 0.5 --black-box /dev/full") == 1);
  CHECK(says("--black-box /dev/full: cannot be written: No space left on device"));
  CHECK(number_of("ticks") == 500.0 && strcmp(value_of("trace_hash"), hash) == 0);
}

TEST(a_full_disk_after_a_fault_is_said_beside_the_fault)
{
  if (access("/dev/full", W_OK) != 0) {
    SKIP("no /dev/full");
  }
  file_write(folder_path("off.csv"),
             "t,x,y,z\n0,0,0,0.5\n0.1,0,0,0.5\n0.2,9e5,0,0.5\n0.3,9e5,0,0.5\n");
  CHECK(run("--lockstep --seconds 1 --black-box /dev/full --trace /dev/full "
            "--device replay:%s,scale=10",
            folder_path("off.csv")) == 2); /* the same file twice */
  CHECK(run("--lockstep --seconds 1 --black-box /dev/full --device replay:%s,scale=10",
            folder_path("off.csv")) == 1);
  CHECK(says("pose that is not finite") && says("--black-box /dev/full: cannot be written"));
}

/* ---- summary and trace ---- */

static const char *const keys[] = {
    "scene",          "model",          "device",       "physics_hz",  "haptic_hz",
    "ticks",          "missed_ticks",   "tick_us_p50",  "tick_us_p99", "physics_ms_mean",
    "physics_duty",   "haptic_duty",    "peak_force_n", "impulse_ns",  "contact_ticks",
    "neighbours_max", "momentum_ratio", "effects",      "trace_hash",  "faults"};

TEST(the_summary_has_its_keys_in_order)
{
  CHECK(run("--scene slide --lockstep --seconds 1 --physics-hz 20") == 0);
  CHECK(ran.err[0] == '\0');
  const char *line = ran.out;
  for (size_t i = 0; i < sizeof keys / sizeof keys[0]; ++i) {
    size_t length = strlen(keys[i]);
    bool good = strncmp(line, keys[i], length) == 0 && strncmp(line + length, ": ", 2) == 0;
    if (!good) {
      printf("# line %zu is not %s: %.60s\n", i + 1, keys[i], line);
    }
    REQUIRE(good);
    line += strcspn(line, "\n") + 1;
  }
}

TEST(the_summary_has_its_values)
{
  CHECK(run("--scene slide --model accelerance --lockstep --seconds 1 --physics-hz 20 "
            "--device virtual") == 0);
  REQUIRE(value_of("scene") != NULL && value_of("effects") != NULL);
  CHECK(strcmp(value_of("scene"), "slide") == 0);
  CHECK(strcmp(value_of("model"), "accelerance") == 0);
  CHECK(strcmp(value_of("device"), "virtual") == 0);
  CHECK(strncmp(value_of("effects"), "testing=on,cross=off", 20) == 0);
  CHECK(strlen(value_of("trace_hash")) == 16 && strspn(value_of("trace_hash"), "0") < 16);
  CHECK(number_of("physics_hz") == 20.0);
  CHECK(number_of("haptic_hz") == 1000.0);
  CHECK(number_of("ticks") == 1000.0);
  CHECK(number_of("missed_ticks") == 0.0);
  CHECK(number_of("faults") == 0.0);
  CHECK(number_of("neighbours_max") == 1.0);
  CHECK(number_of("peak_force_n") > 1.0 && number_of("peak_force_n") <= 20.0);
  CHECK(number_of("contact_ticks") > 50.0 && number_of("contact_ticks") < 1000.0);
  CHECK(number_of("impulse_ns") > 0.1);
  CHECK(number_of("tick_us_p50") > 0.0 && number_of("tick_us_p99") >= number_of("tick_us_p50"));
  CHECK(number_of("physics_duty") > 0.0 && number_of("haptic_duty") > 0.0);
  CHECK_NEAR(number_of("momentum_ratio"), 1.0, 0.01);
}

TEST(the_coupling_can_be_chosen_and_is_reported)
{
  const struct {
    const char *arguments;
    const char *coupling;
    const char *effect;
  } cases[] = {
      {"", "direct (UNKNOWN: 2000 N/m near, the device does not say what it holds)", "proxy=off"},
      {"--effects proxy=off", "direct (ASKED)", "proxy=off"},
      {"--coupling virtual:500", "virtual (ASKED: a spring of 500 N/m)", "proxy=on"},
      {"--coupling proxy:500", "proxy (ASKED: a spring of 500 N/m)", "proxy=on"},
      {"--coupling=auto:3000", "direct (WITHIN: 2000 N/m near, no more than the device holds)",
       "proxy=off"},
      {"--coupling=auto:3000 --stiffness 8000",
       "proxy (ABOVE: 8000 N/m near, the device holds 3000 N/m)", "proxy=on"},
      {"--model accelerance", "direct (MODEL: only model contact has a proxy)", "proxy=off"},
  };
  for (size_t i = 0; i < sizeof cases / sizeof cases[0]; ++i) {
    REQUIRE(run("--scene slide --lockstep --seconds 1 %s", cases[i].arguments) == 0);
    REQUIRE(value_of("coupling") != NULL && value_of("effects") != NULL);
    bool good = strcmp(value_of("coupling"), cases[i].coupling) == 0 &&
                strstr(value_of("effects"), cases[i].effect) != NULL;
    CHECK_SAY(good, "%s: %s", cases[i].arguments, value_of("coupling"));
  }
}

/* 0.2 N s/m at 1 kHz: 0.8 x 0.2 / 0.0005 = 320 N/m. */
TEST(a_device_is_held_to_its_own_figures)
{
  CHECK(run("--scene slide --lockstep --seconds 1 --stiffness 8000 --device "
            "virtual:path=0:-0.1/0/0.05;0.5:0.05/0/0.05,device_mass=0.1,device_damping=0.2,"
            "hand=relaxed") == 0);
  REQUIRE(value_of("coupling") != NULL);
  CHECK(strcmp(value_of("coupling"), "proxy (ABOVE: 8000 N/m near, the device holds 320 N/m)") ==
        0);
  CHECK(run("--scene slide --lockstep --seconds 1 --coupling proxy") == 2);
  CHECK(says("coupling proxy") && says("identified"));
}

TEST(single_steps_the_world_at_the_haptic_rate)
{
  CHECK(run("--scene slide --model single --lockstep --seconds 0.1 --haptic-hz 500") == 0);
  CHECK(number_of("physics_hz") == 500.0);
  CHECK(number_of("ticks") == 50.0);
}

TEST(a_run_of_no_tick_has_a_summary)
{
  CHECK(run("--lockstep --seconds 0.001 --haptic-hz 100 --trace %s --plot %s",
            folder_path("trace.csv"), folder_path("same.svg")) == 0);
  CHECK(number_of("ticks") == 0.0);
}

static size_t columns_of(const char *line)
{
  size_t columns = 1;
  for (; *line != '\n' && *line != '\0'; ++line) {
    columns += *line == ',';
  }
  return columns;
}

/* Walks over the rows of a trace; the checks are about its numbers. */
static void check_rows(FILE *file, size_t columns, size_t rows, double period)
{
  char line[8000];
  double peak = 0.0;
  size_t count = 0;
  while (fgets(line, sizeof line, file) != NULL) {
    ++count;
    REQUIRE(columns_of(line) == columns);
    REQUIRE(fabs(strtod(line, NULL) - period * (double)(count - 1)) < 1e-6 + period);
    char *at = line;
    double force = 0.0;
    for (size_t i = 0; i < columns; ++i) {
      double value = strtod(at, &at);
      REQUIRE(isfinite(value) && (*at == ',' || *at == '\n'));
      force = i >= 4 && i <= 6 ? hypot(force, value) : force;
      ++at;
    }
    peak = fmax(peak, force);
  }
  CHECK(count == rows);
  CHECK_NEAR(peak, number_of("peak_force_n"), 1e-4 * peak);
}

TEST(the_trace_has_its_columns_and_every_tick)
{
  char head[8000] = "";
  CHECK(run("--scene row10:2 --lockstep --seconds 3 --trace %s", folder_path("trace.csv")) == 0);
  FILE *file = fopen(folder_path("trace.csv"), "r");
  REQUIRE(file != NULL);
  CHECK(fgets(head, sizeof head, file) != NULL);
  CHECK(strcmp(head,
               "t,px,py,pz,fx,fy,fz,tx,ty,tz,bodies,contacts,tick_us,model_age_s,"
               "b0_x,b0_y,b0_z,b1_x,b1_y,b1_z\n") == 0);
  check_rows(file, 20, 3000, 1e-3);
  fclose(file);
  CHECK(number_of("trace_dropped") == 0.0);
}

TEST(the_trace_of_threads_is_drained_while_they_run)
{
  char text[PROGRAM_OUTPUT_MAX];
  CHECK(run("--scene fig6 --haptic-hz 4000 --seconds 1.5 --no-realtime --trace %s",
            folder_path("threads.csv")) == 0);
  double rows = -1.0;
  FILE *file = fopen(folder_path("threads.csv"), "r");
  REQUIRE(file != NULL);
  while (fgets(text, sizeof text, file) != NULL) {
    rows += 1.0;
  }
  fclose(file);
  CHECK(number_of("ticks") > 100.0);
  CHECK(rows == number_of("ticks") - number_of("trace_dropped"));
  CHECK(strcmp(value_of("realtime"), "no") == 0);
}

TEST(two_devices_are_two_pointers)
{
  char head[8000] = "";
  CHECK(run("--scene slide --lockstep --seconds 0.5 --device virtual "
            "--device virtual:path=0:0.1/0/0.025;0.5:0.05/0/0.025,hand=rigid --trace %s",
            folder_path("two.csv")) == 0);
  CHECK(strncmp(value_of("device"), "virtual + virtual:path", 22) == 0);
  FILE *file = fopen(folder_path("two.csv"), "r");
  REQUIRE(file != NULL);
  CHECK(fgets(head, sizeof head, file) != NULL);
  CHECK(strstr(head, ",model_age_s,p1_x,p1_y,p1_z,p1_fx,p1_fy,p1_fz,p1_tx,p1_ty,p1_tz,b0_x,") !=
        NULL);
  double second_x = 0.0;
  CHECK(fscanf(file,
               "%*[^,],%*[^,],%*[^,],%*[^,],%*[^,],%*[^,],%*[^,],%*[^,],%*[^,],%*[^,],"
               "%*[^,],%*[^,],%*[^,],%*[^,],%lf",
               &second_x) == 1);
  fclose(file);
  CHECK_NEAR(second_x, 0.1, 1e-3);
}

/* The second end effector is 10 mm beside the first: where the scene has two hands it is a pointer,
 * in the device's frame, which begins where the scene's first hand does. */
TEST(end_effectors_of_a_device_are_pointers_as_far_as_the_scene_has_hands)
{
  char head[8000] = "";
  const char *module = folder_module("HAPODE_BROKEN");
  REQUIRE(run("--scene grasp --lockstep --seconds 0.1 --device module:%s,break=two_effectors "
              "--trace %s",
              module, folder_path("fingers.csv")) == 0);
  CHECK(strstr(ran.out, "effectors_left") == NULL);
  FILE *file = fopen(folder_path("fingers.csv"), "r");
  REQUIRE(file != NULL);
  CHECK(fgets(head, sizeof head, file) != NULL);
  CHECK(strstr(head, ",p1_x,") != NULL && strstr(head, ",p2_x,") == NULL);
  fclose(file);
  REQUIRE(run("--scene slide --lockstep --seconds 0.1 --device module:%s,break=two_effectors",
              module) == 0);
  CHECK(strstr(ran.out, "\neffectors_left: 1 (") != NULL);
  REQUIRE(run("--scene grasp --lockstep --seconds 0.1 --device module:%s,break=two_effectors "
              "--device virtual",
              module) == 0);
  CHECK(strstr(ran.out, "\neffectors_left: 1 (") != NULL);
}

TEST(lockstep_is_the_same_every_time)
{
  char first[64];
  CHECK(run("--scene row10 --lockstep --seconds 1.5") == 0);
  REQUIRE(value_of("trace_hash") != NULL);
  snprintf(first, sizeof first, "%s", value_of("trace_hash"));
  CHECK(run("--scene row10 --lockstep --seconds 1.5 --trace %s --plot %s", folder_path("same.csv"),
            folder_path("same.svg")) == 0);
  CHECK(strcmp(first, value_of("trace_hash")) == 0);
  CHECK(run("--scene row10 --lockstep --seconds 1.5 --model-age 0.01") == 0);
  CHECK(strcmp(first, value_of("trace_hash")) != 0);
}

TEST(a_recording_runs_in_lockstep)
{
  file_write(folder_path("push.csv"),
             "t,x,y,z\n0,-0.03,0,0.025\n0.2,-0.02,0,0.025\n"
             "0.4,-0.01,0,0.025\n0.6,0,0,0.025\n0.8,0.01,0,0.025\n");
  CHECK(run("--scene slide --lockstep --seconds 0.8 --device replay:%s", folder_path("push.csv")) ==
        0);
  CHECK(number_of("contact_ticks") > 50.0);
}

TEST(every_scene_runs_in_every_model)
{
  const char *const models[] = {"single", "impulse", "accelerance", "contact"};
  const char *const finite[] = {"peak_force_n", "impulse_ns", "physics_ms_mean", "tick_us_p99"};
  for (size_t i = 0; i < sizeof names / sizeof names[0]; ++i) {
    for (size_t k = 0; k < sizeof models / sizeof models[0]; ++k) {
      int code = run("--scene %s --model %s --lockstep --seconds 0.4", names[i], models[k]);
      bool good = code == 0 && number_of("ticks") == 400.0 && number_of("faults") == 0.0;
      for (size_t n = 0; n < sizeof finite / sizeof finite[0]; ++n) {
        good = good && isfinite(number_of(finite[n]));
      }
      CHECK_SAY(good, "%s, %s: exit %d, %.300s", names[i], models[k], code, ran.err);
    }
  }
}

TEST(a_device_fault_ends_the_run_with_1)
{
  file_write(folder_path("far.csv"),
             "t,x,y,z\n0,0,0,0.5\n0.1,0,0,0.5\n0.2,9e5,0,0.5\n0.3,9e5,0,0.5\n");
  CHECK(run("--lockstep --seconds 1 --device replay:%s,scale=10", folder_path("far.csv")) == 1);
  CHECK(says("fault") && says("pose"));
  CHECK(number_of("faults") == 1.0);
  CHECK(number_of("ticks") < 1000.0);
  CHECK(run("--no-realtime --seconds 1 --device replay:%s,scale=10", folder_path("far.csv")) == 1);
  CHECK(number_of("faults") == 1.0);
}

static size_t lines_of(const char *path, char *out_last, size_t size)
{
  size_t count = 0;
  FILE *file = fopen(path, "r");
  while (file != NULL && fgets(out_last, (int)size, file) != NULL) {
    ++count;
  }
  if (file != NULL) {
    fclose(file);
  }
  return count;
}

TEST(a_fault_leaves_its_last_ticks)
{
  char last[2000] = "";
  char rows[4000] = "t,x,y,z\n";
  for (int i = 0; i < 90; ++i) { /* a spline goes through them: it feels the leap only near it */
    size_t used = strlen(rows);
    snprintf(rows + used, sizeof rows - used, "%.2f,%s,0,0.5\n", 0.01 * i, i < 80 ? "0" : "9e5");
  }
  file_write(folder_path("late.csv"), rows);
  char box[320];
  snprintf(box, sizeof box, "%s", folder_path("box.csv"));
  CHECK(run("--lockstep --seconds 1 --device replay:%s,scale=10 --black-box %s",
            folder_path("late.csv"), box) == 1);
  CHECK(says("last 256 ticks before the fault") && says("pointer 1"));
  CHECK(lines_of(box, last, sizeof last) == 257);
  unsigned tick = 0;
  unsigned pointer = 0;
  unsigned fault = 0;
  CHECK(sscanf(last, "%u,%*[^,],%u,%u,", &tick, &pointer, &fault) == 3);
  CHECK(tick > 255 && pointer == 1 && fault == HAP_FAULT_DEVICE_INPUT);
  CHECK(run("--lockstep --seconds 0.1 --black-box %s", box) == 0);
  CHECK(lines_of(box, last, sizeof last) == 1); /* no fault, no rows */
  CHECK(run("--lockstep --seconds 0.1 --black-box /no/such/place") == 1 && says("--black-box"));
  CHECK(run("--lockstep --seconds 0.1 --trace %s --black-box %s", box, box) == 2);
}

TEST(a_deadly_signal_still_kills)
{
  const struct timespec pause = {0, 300000000};
  static const int signals[] = {SIGABRT, SIGSEGV};
  for (int i = 0; i < 2; ++i) {
    int result = 0;
    pid_t child = program_start("--seconds 10000 --no-realtime", NULL);
    REQUIRE(child > 0);
    nanosleep(&pause, NULL);
    kill(child, signals[i]);
    CHECK(waitpid(child, &result, 0) == child);
    CHECK(WIFSIGNALED(result) && WTERMSIG(result) == signals[i]);
  }
}

static void run_interrupt(int number, const char *arguments)
{
  const struct timespec pause = {0, 300000000};
  pid_t child = program_start(arguments, NULL);
  REQUIRE(child > 0);
  nanosleep(&pause, NULL);
  kill(child, number);
  CHECK(program_finish(child) == 0);
  CHECK(says("stopped early"));
  CHECK(number_of("ticks") > 0.0 && number_of("ticks") < 1e7);
  CHECK(number_of("faults") == 0.0 || strcmp(value_of("fault"), "emergency") == 0);
}

/* ---- a device that hangs ---- */

static char letters[300]; /* what it did, see tests/modules/hangs.c */

static const char *letters_read(void)
{
  FILE *file = fopen(folder_path("letters"), "r");
  size_t count = file != NULL ? fread(letters, 1, sizeof letters - 1, file) : 0;
  letters[count] = '\0';
  if (file != NULL) {
    fclose(file);
  }
  return letters;
}

static bool await_letter(char letter)
{
  const struct timespec pause = {0, 5000000};
  for (int i = 0; i < 4000 && strchr(letters_read(), letter) == NULL; ++i) {
    nanosleep(&pause, NULL);
  }
  return strchr(letters, letter) != NULL;
}

static pid_t hanging_start(const char *options, const char *call)
{
  char arguments[1000];
  (void)unlink(folder_path("letters"));
  snprintf(arguments, sizeof arguments, "%s module:%s,call=%s,file=%s", options,
           folder_module("HAPODE_HANGS"), call, folder_path("letters"));
  pid_t child = program_start(arguments, NULL);
  REQUIRE(child > 0);
  return child;
}

/* It holds a force and comes back from nothing. */
TEST(a_device_that_hangs_ends_the_run_with_zero)
{
  static const char *const calls[] = {"read", "write"};
  for (int i = 0; i < 2; ++i) {
    pid_t child = hanging_start("--seconds 60 --device", calls[i]);
    CHECK(program_finish(child) == 1);
    CHECK(says("device hangs did not come back from") && says(calls[i]));
    CHECK(says("not freed") && strcmp(value_of("fault"), "blocked") == 0);
    letters_read();
    CHECK(strstr(letters, "fhz") != NULL && letters[strlen(letters) - 1] == 'z');
  }
}

/* The check has no watchdog: the force is taken by the signal. */
TEST(the_first_signal_takes_the_force_of_a_device_that_hangs)
{
  static const char *const calls[] = {"read", "write"};
  for (int i = 0; i < 2; ++i) {
    int result = 0;
    pid_t child = hanging_start("--check-wait 0 --check-device", calls[i]);
    CHECK(await_letter('h'));
    CHECK(letters[strlen(letters) - 1] == 'h'); /* with its force */
    kill(child, SIGINT);
    for (int k = 0; k < 4000 && letters[strlen(letters) - 1] != 'z'; ++k) {
      const struct timespec pause = {0, 1000000};
      nanosleep(&pause, NULL);
      letters_read();
    }
    CHECK(letters[strlen(letters) - 1] == 'z');
    kill(child, SIGINT);
    CHECK(waitpid(child, &result, 0) == child);
    CHECK(WIFSIGNALED(result) && WTERMSIG(result) == SIGINT);
  }
}

TEST(the_second_signal_ends_a_run_whose_device_hangs_in_zero)
{
  const struct timespec pause = {0, 300000000};
  int result = 0;
  pid_t child = hanging_start("--seconds 60 --device", "zero");
  CHECK(await_letter('f'));
  kill(child, SIGTERM);
  nanosleep(&pause, NULL);
  kill(child, SIGINT);
  CHECK(waitpid(child, &result, 0) == child);
  CHECK(WIFSIGNALED(result) && WTERMSIG(result) == SIGINT);
}

TEST(a_signal_ends_the_run_with_its_summary)
{
  run_interrupt(SIGINT, "--seconds 10000 --no-realtime");
  run_interrupt(SIGTERM, "--seconds 80000 --lockstep");
}

TEST(a_device_is_identified_and_its_identity_used)
{
  static const char device[] =
      "virtual:hand=none,device_mass=0.3,device_damping=1,friction=0.1,delay=0.0015,quantum=3e-5";
  char file[320];
  snprintf(file, sizeof file, "%s", folder_path("device.txt"));
  CHECK(run("--identify %s --device %s", file, device) == 0);
  CHECK(says("LET GO"));
  CHECK_NEAR(number_of("mass_kg"), 0.3, 0.009);
  CHECK_NEAR(number_of("delay_ms"), 1.5, 0.2);
  CHECK_NEAR(number_of("quantum_um"), 30.0, 1e-6);
  const char *text = file_text(file);
  CHECK(strstr(text, "\ndevice = virtual\n") != NULL && strstr(text, "\nquantum = 3e-05 ") != NULL);
  CHECK(run("--lockstep --seconds 0.1 --device %s --identity %s", device, file) == 0);
  CHECK(run("--lockstep --seconds 0.1 --identity %s --device %s", file, device) == 2);
  CHECK(says("--identity: it belongs to a --device before it"));
  CHECK(run("--device %s --identity %s --identity %s", device, file, file) == 2);
  CHECK(says("has one already"));
  file_write(folder_path("push.csv"), "t,x,y,z\n0,0,0,0.1\n1,0,0,0\n");
  CHECK(run("--lockstep --seconds 0.1 --device replay:%s --identity %s", folder_path("push.csv"),
            file) == 2);
  CHECK(says("identity is that of 'virtual'"));
  file_write(file, "version = 1\nmas = 2\n");
  CHECK(run("--lockstep --seconds 0.1 --device %s --identity %s", device, file) == 1);
  CHECK(says("line 2: known are"));
}

TEST(an_identification_that_fails_writes_nothing)
{
  char file[320];
  snprintf(file, sizeof file, "%s", folder_path("device.txt"));
  unlink(file);
  CHECK(run("--identify %s --device virtual", file) == 1);
  CHECK(says("does not move") && !file_exists(file));
  CHECK(run("--identify %s", file) == 2);
  CHECK(says("exactly one --device"));
  CHECK(run("--identify %s --device virtuel", file) == 2);
  CHECK(run("--identify /nowhere/at/all --device virtual:hand=none,device_mass=1") == 1);
  CHECK(says("cannot be written"));
  file_write(file, "kept");
  CHECK(run("--identify %s --device virtual", file) == 1);
  CHECK(strcmp(file_text(file), "kept") == 0);
}

TEST(the_picture_is_an_svg)
{
  if (!plot_available()) {
    SKIP("needs gnuplot");
  }
  const char *const cases[] = {"--seconds 1", "--seconds 0.05 --model single",
                               "--seconds 0.5 --device virtual --device virtual:path=0:0/1/0"};
  for (size_t i = 0; i < sizeof cases / sizeof cases[0]; ++i) {
    unlink(folder_path("it's.svg"));
    CHECK(run("--lockstep %s --plot %s", cases[i], folder_path("it's.svg")) == 0);
    CHECK(ran.err[0] == '\0');
    CHECK(strstr(file_text(folder_path("it's.svg")), "<svg") != NULL);
  }
}

TEST(without_gnuplot_one_line_says_so)
{
  char *bare[] = {(char[]){"PATH=/nonexistent"}, NULL};
  char arguments[600];
  snprintf(arguments, sizeof arguments, "--lockstep --seconds 0.1 --plot %s",
           folder_path("none.svg"));
  CHECK(program_finish(program_start(arguments, bare)) == 0);
  CHECK(says("gnuplot") && strchr(ran.err, '\n') == ran.err + strlen(ran.err) - 1);
  CHECK(number_of("ticks") == 100.0);
  CHECK(!file_exists(folder_path("none.svg")));
}

/* ---- --record and --play ---- */

static bool has_value(const char *key, const char *text)
{
  const char *value = value_of(key);
  bool same = value != NULL && strcmp(value, text) == 0;
  if (!same) {
    printf("# %s is %s, not %s\n", key, value != NULL ? value : "not there", text);
  }
  return same;
}

/* Number of lines that differ in more than the computing time; -1: in number. */
static int different_rows(const char *one, const char *other)
{
  char a[4000];
  char b[4000];
  int different = 0;
  FILE *files[2] = {fopen(folder_path(one), "r"), fopen(folder_path(other), "r")};
  bool more = files[0] != NULL && files[1] != NULL;
  while (more) {
    bool first = fgets(a, sizeof a, files[0]) != NULL;
    more = fgets(b, sizeof b, files[1]) != NULL;
    different = first != more ? -1 : different;
    more = more && first;
    char *at[2] = {a, b};
    for (int column = 0; more && column < 12; ++column) {
      at[0] = at[0] != NULL ? strchr(at[0] + 1, ',') : NULL;
      at[1] = at[1] != NULL ? strchr(at[1] + 1, ',') : NULL;
    }
    bool same = more && at[0] != NULL && at[1] != NULL && at[0] - a == at[1] - b &&
                memcmp(a, b, (size_t)(at[0] - a)) == 0 &&
                strcmp(strchr(at[0] + 1, ','), strchr(at[1] + 1, ',')) == 0;
    different += more && different >= 0 && !same;
  }
  for (int i = 0; i < 2; ++i) {
    if (files[i] != NULL) {
      fclose(files[i]);
    }
  }
  return different;
}

TEST(a_run_that_was_recorded_is_played_bit_for_bit)
{
  CHECK(run("--seconds 1.2 --scene row10:6 --physics-hz 30 --record %s --trace %s",
            folder_path("a.rec"), folder_path("trace.csv")) == 0);
  CHECK(has_value("record_end", "stopped"));
  CHECK(number_of("record_ticks") == number_of("ticks") && number_of("record_lost_ticks") == 0.0);
  double ticks = number_of("ticks");
  char impulse[40];
  snprintf(impulse, sizeof impulse, "%s", value_of("impulse_ns"));
  CHECK(strstr(ran.out, ",recording=on\n") != NULL);
  CHECK(run("--play %s --trace %s", folder_path("a.rec"), folder_path("same.csv")) == 0);
  CHECK(has_value("replay", "identical") && number_of("ticks") == ticks);
  CHECK(has_value("scene", "row10:6") && number_of("physics_hz") == 30.0);
  CHECK(has_value("impulse_ns", impulse));
  CHECK(different_rows("trace.csv", "same.csv") == 0);
  CHECK(run("--play %s --seconds 0.1 --trace %s", folder_path("a.rec"), folder_path("same.csv")) ==
        0);
  CHECK(number_of("ticks") == 100.0 && different_rows("trace.csv", "same.csv") == -1);
}

TEST(a_recording_ends_at_its_limit_and_the_run_goes_on)
{
  CHECK(run("--seconds 1.5 --record %s --record-limit 0.2", folder_path("a.rec")) == 0);
  CHECK(says("ended before the run") && says("--record-limit is reached"));
  CHECK(has_value("record_end", "limit") && number_of("record_bytes") <= 209715.0);
  CHECK(number_of("ticks") > number_of("record_ticks"));
  double recorded = number_of("record_ticks");
  double bytes = number_of("record_bytes");
  REQUIRE(bytes > 1000.0);
  CHECK(run("--play %s", folder_path("a.rec")) == 0);
  CHECK(has_value("record_end", "limit") && number_of("record_ticks") == recorded);
  CHECK(truncate(folder_path("a.rec"), (off_t)bytes - 10) == 0);
  CHECK(run("--play %s", folder_path("a.rec")) == 1);
  CHECK(says("breaks off") && says("--play-incomplete"));
  CHECK(run("--play %s --play-incomplete", folder_path("a.rec")) == 0);
  CHECK(has_value("record_end", "broken_off"));
  CHECK(truncate(folder_path("a.rec"), 100) == 0);
  CHECK(run("--play %s --play-incomplete", folder_path("a.rec")) == 1);
}

TEST(a_recording_that_cannot_be_is_said)
{
  CHECK(run("--seconds 1 --record %s", folder_path("no/such/a.rec")) == 1);
  CHECK(says("--record: ") && says("cannot be written: No such file"));
  CHECK(ran.out[0] == '\0');
  if (access("/dev/full", W_OK) == 0) {
    CHECK(run("--seconds 1 --record /dev/full") == 1);
    CHECK(says("/dev/full: cannot be written: No space left on device") && ran.out[0] == '\0');
  }
  CHECK(run("--lockstep --record x") == 2 && says("--record: not with --lockstep"));
  CHECK(run("--record-limit 5") == 2 && says("--record-limit: only with --record"));
  CHECK(run("--play-incomplete") == 2 && says("--play-incomplete: only with --play"));
  CHECK(run("--play x --scene row10") == 2 && says("leave out --scene"));
  CHECK(run("--play x --record y") == 2 && says("leave out --record"));
  CHECK(run("--record x --trace x") == 2 && says("the same file"));
  CHECK(run("--effects recording=on") == 2 && says("--record FILE"));
  CHECK(run("--effects recording=off --record x") == 2 && says("recording=off"));
  CHECK(run("--play %s", folder_path("none.rec")) == 1 && says("cannot be opened"));
  file_write(folder_path("a.rec"), "t,x,y,z\n0,0,0,0\n1,0,0,0\nand some more of it\n");
  CHECK(run("--play %s", folder_path("a.rec")) == 1 && says("is no recording of a session"));
}

/* One that starts again at the fourth time. */
TEST(a_lost_device_ends_the_run_unless_it_is_to_be_waited_for)
{
  const char *module = folder_module("HAPODE_BROKEN");
  REQUIRE(module != NULL);
  CHECK(run("--scene slide --lockstep --seconds 4 --device module:%s,break=unplugged", module) ==
        1);
  CHECK(says("could not be read"));
  CHECK(run("--scene slide --lockstep --seconds 4 --reconnect --device module:%s,break=unplugged",
            module) == 0);
  CHECK(says("a device was lost") && says("the device is back"));
  const char *faults = value_of("faults");
  CHECK(faults != NULL && atoi(faults) == 1);
  CHECK(run("--scene slide --lockstep --seconds 4 --reconnect --device "
            "module:%s,break=unplugged_for_ever",
            module) == 1);
  CHECK(says("a device was lost") && says("could not be read"));
}

SET_UP
{
  return program_use("HAPODE_RUN");
}
