/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The replay device: what it reads, what it refuses, and the curve between the rows. */

#include "tests/files.h"
#include "tests/tap.h"

#include <dirent.h>
#include <locale.h>
#include <stdarg.h>
#include <stdint.h>
#include <unistd.h>

#include <hapode/device_impl.h>
#include <hapode/hapode.h>

#include "base/vec.h"
#include "device/one_effector.h"
#include "tests/device_rig.h"

#define PI 3.14159265358979323846
#define T0 123456789LL /* ns; the device must not care where time begins */

static char motion_path[160];

static void replay_spec(const char *path, const char *arguments, char out[512])
{
  REQUIRE(snprintf(out, 512, "replay:%s%s", path, arguments) < 512);
}

/* arguments: what follows the file name */
static device_rig *rig_new_replay(const char *path, const char *arguments)
{
  char spec[512];
  replay_spec(path, arguments, spec);
  return rig_new(spec);
}

static hap_status replay_try(const char *path, const char *arguments, hap_detail *detail)
{
  char spec[512];
  hap_device *device = NULL;
  replay_spec(path, arguments, spec);
  hap_status status = hap_device_open(spec, &device, detail);
  CHECK((status < 0) == (device == NULL));
  hap_device_close(device);
  return status;
}

static void rig_read(device_rig *r, int64_t since_ns)
{
  uint32_t buttons = 77;
  CHECK(hapi_one_read(r->ops, r->self, T0 + since_ns, &r->pose, &r->twist, &buttons) == HAP_OK);
  CHECK(buttons == 0);
}

static void rig_restart(device_rig *r)
{
  r->ops->stop(r->self);
  CHECK(r->ops->start(r->self) == HAP_OK);
  rig_read(r, 0);
}

TEST(rows_are_met_exactly)
{
  file_write(
      motion_path,
      "t,x,y,z\n0,0.1,0.2,0.3\n0.01,0.11,-5e-1,.5\n0.015,+0.2,1,2\n0.1,0,0,0\n0.123456789,1,1,1\n");
  static const double t[] = {0.0, 0.01, 0.015, 0.1, 0.123456789};
  static const double p[][3] = {
      {0.1, 0.2, 0.3}, {0.11, -0.5, 0.5}, {0.2, 1.0, 2.0}, {0.0, 0.0, 0.0}, {1.0, 1.0, 1.0}};
  device_rig *r = rig_new_replay(motion_path, "");
  CHECK(r->ops->pacing == HAP_PACING_VIRTUAL);
  for (int i = 0; i < 5; ++i) {
    rig_read(r, llround(t[i] * 1e9));
    for (int k = 0; k < 3; ++k) {
      CHECK_NEAR(r->pose.position[k], p[i][k], 0.0);
    }
    CHECK(r->pose.quat_wxyz[0] == 1.0 && hapi_v3_norm(r->twist.angular) == 0.0);
  }
}

TEST(info_tells_what_the_file_has)
{
  file_write(motion_path, "t,x,y,z\n0,0,0,0\n");
  device_rig *r = rig_new_replay(motion_path, "");
  const hap_device_info *info = hapi_device_info(r->device);
  CHECK(info->dof == 3 && info->max_force == 20.0 && strcmp(info->name, "replay") == 0);
  file_write(motion_path, "t,x,y,z,qw,qx,qy,qz\n0,0,0,0,0,2,0,0\n");
  r = rig_new_replay(motion_path, "");
  CHECK(hapi_device_info(r->device)->dof == 6);
  rig_read(r, 0);
  CHECK_NEAR(r->pose.quat_wxyz[1], 1.0, 1e-15);
}

TEST(ends_are_at_rest)
{
  file_write(motion_path, "t,x,y,z\n0.5,1,0,0\n1,2,0,0\n1.5,3,0,0\n");
  device_rig *r = rig_new_replay(motion_path, "");
  rig_read(r, 0);
  CHECK(r->pose.position[0] == 1.0 && r->twist.linear[0] == 0.0);
  rig_read(r, 499999999);
  CHECK(r->pose.position[0] == 1.0 && r->twist.linear[0] == 0.0);
  rig_read(r, 750000000);
  CHECK_NEAR(r->pose.position[0], 1.5, 1e-14); /* three rows on a line: a line */
  CHECK_NEAR(r->twist.linear[0], 2.0, 1e-14);
  rig_read(r, 1500000001);
  CHECK(r->pose.position[0] == 3.0 && r->twist.linear[0] == 0.0);
  rig_read(r, 3600000000000);
  CHECK(r->pose.position[0] == 3.0 && r->twist.linear[0] == 0.0);
  uint32_t buttons;
  CHECK(hapi_one_read(r->ops, r->self, T0, &r->pose, &r->twist, &buttons) == HAP_ERROR_ARGUMENT);
  rig_restart(r);
  CHECK(r->pose.position[0] == 1.0);
}

TEST(one_row_is_a_constant)
{
  file_write(motion_path, "t,x,y,z\n3,1,2,3\n");
  device_rig *r = rig_new_replay(motion_path, "");
  for (int i = 0; i < 5; ++i) {
    rig_read(r, i * 1000000000LL);
    CHECK(r->pose.position[2] == 3.0 && hapi_v3_norm(r->twist.linear) == 0.0);
  }
}

TEST(two_rows_are_a_line)
{
  file_write(motion_path, "t,x,y,z\n0,0,0,0\n2,1,2,-4\n");
  device_rig *r = rig_new_replay(motion_path, "");
  rig_read(r, 0);
  CHECK_NEAR(r->twist.linear[2], -2.0, 1e-15);
  rig_read(r, 500000000);
  CHECK_NEAR(r->pose.position[1], 0.5, 1e-15);
  CHECK_NEAR(r->twist.linear[0], 0.5, 1e-15);
}

TEST(arguments_map_the_motion)
{
  file_write(motion_path,
             "t,x,y,z,qw,qx,qy,qz\n0,0,0,0,1,0,0,0\n1,1,2,3,1,0,0,0\n2,2,4,6,1,0,0,0\n");
  /* a quarter turn about z: x -> y, y -> -x */
  device_rig *r =
      rig_new_replay(motion_path, ",scale=0.5,offset=10/20/30,rotate=1/0/0/1,start=0.5");
  rig_read(r, 0);
  rig_read(r, 500000000);
  CHECK_NEAR(r->pose.position[0], 10.0 - 1.0, 1e-14);
  CHECK_NEAR(r->pose.position[1], 20.0 + 0.5, 1e-14);
  CHECK_NEAR(r->pose.position[2], 30.0 + 1.5, 1e-14);
  CHECK_NEAR(r->twist.linear[0], -1.0, 1e-14);
  CHECK_NEAR(r->twist.linear[1], 0.5, 1e-14);
  CHECK_NEAR(r->pose.quat_wxyz[0], sqrt(0.5), 1e-15);
  CHECK_NEAR(r->pose.quat_wxyz[3], sqrt(0.5), 1e-15);
  file_write(motion_path,
             "t,x,y,z\n0,0,0,0\n"); /* without a quaternion the orientation is that of rotate */
  r = rig_new_replay(motion_path, ",rotate=1/0/0/1");
  rig_read(r, 0);
  CHECK_NEAR(r->pose.quat_wxyz[3], sqrt(0.5), 1e-15);
}

TEST(start_far_into_the_recording)
{
  FILE *file = fopen(motion_path, "w");
  REQUIRE(file != NULL);
  fputs("t,x,y,z\n", file);
  for (int i = 0; i < 20000; ++i) {
    fprintf(file, "%.2f,%d,0,0\n", i * 0.01, i);
  }
  fclose(file);
  device_rig *r = rig_new_replay(motion_path, ",start=150");
  for (int i = 0; i < 100; ++i) {
    rig_read(r, i * 37000000LL);
    CHECK_NEAR(r->pose.position[0], 15000.0 + i * 3.7, 1e-8);
  }
}

/* 100 Hz rows of a 2 Hz sine, read at 1 kHz. */
static void write_sine(double hz, int rows)
{
  FILE *file = fopen(motion_path, "w");
  if (file == NULL) {
    return;
  }
  fputs("t,x,y,z\n", file);
  for (int i = 0; i < rows; ++i) {
    double t = i * 0.01;
    fprintf(file, "%.2f,%.17g,%.17g,0\n", t, 0.1 * sin(2.0 * PI * hz * t),
            0.1 * cos(2.0 * PI * hz * t));
  }
  fclose(file);
}

TEST(sine_comes_back_smooth)
{
  const double hz = 2.0;
  const double w = 2.0 * PI * hz;
  write_sine(hz, 301);
  device_rig *r = rig_new_replay(motion_path, "");
  /* bounds of the cubic spline away from its ends (Hall and Meyer 1976): 5/384 h^4 y'''' for the
   * value, 1/24 h^3 y'''' for the slope; the natural ends die out within a few rows */
  double value_bound = 5.0 / 384.0 * pow(0.01, 4) * 0.1 * pow(w, 4) * 1.05;
  double slope_bound = 1.0 / 24.0 * pow(0.01, 3) * 0.1 * pow(w, 4) * 1.05;
  double before = (double)NAN;
  for (int i = 0; i <= 3000; ++i) {
    double t = i * 1e-3;
    rig_read(r, i * 1000000LL);
    if (t >= 0.2 && t <= 2.8) {
      CHECK_NEAR(r->pose.position[0], 0.1 * sin(w * t), value_bound);
      CHECK_NEAR(r->twist.linear[0], 0.1 * w * cos(w * t), slope_bound);
      CHECK_NEAR(r->pose.position[1], 0.1 * cos(w * t), value_bound);
    }
    if (i > 0) { /* velocity without steps: what the acceleration of 0.1 w^2 can do in 1 ms */
      CHECK_NEAR(r->twist.linear[0], before, 0.1 * w * w * 1e-3 * 1.3);
    }
    before = r->twist.linear[0];
  }
}

static double random_share(uint32_t *state)
{
  *state = *state * 1664525u + 1013904223u;
  return (double)(*state >> 8) / 16777216.0;
}

/* Uneven stamps, three wobbles and a turning quaternion whose sign is thrown at random. */
static void write_turning(int rows, bool signs)
{
  FILE *file = fopen(motion_path, "w");
  if (file == NULL) {
    return;
  }
  uint32_t state = 5;
  double t = 0.0;
  fputs("t,x,y,z,qw,qx,qy,qz\n", file);
  for (int i = 0; i < rows; ++i) {
    double half = 0.5 * (3.0 * t + sin(5.0 * t));
    double sign = signs && random_share(&state) < 0.5 ? -1.0 : 1.0;
    fprintf(file, "%.9f,%.17g,%.17g,%.17g,%.17g,%.17g,%.17g,%.17g\n", t, sin(9.0 * t), cos(4.0 * t),
            t * t, sign * cos(half), sign * sin(half) * 0.6, 0.0, sign * sin(half) * 0.8);
    t += 0.005 + 0.01 * (i % 3) / 2.0;
  }
  fclose(file);
}

/* Angular velocity that takes quaternion a to b in dt, in the axes of the outer frame. */
static void angular_between(const double a[4], const double b[4], double dt, double out[3])
{
  double back[4] = {a[0], -a[1], -a[2], -a[3]};
  double turn[4];
  hapi_quat_multiply(b, back, turn);
  double s = hapi_v3_norm(turn + 1);
  double angle = 2.0 * atan2(s, turn[0]);
  hapi_v3_scale(s > 0.0 ? angle / s / dt : 0.0, turn + 1, out);
}

TEST(twist_is_the_derivative_of_the_pose)
{
  write_turning(200, true);
  device_rig *r = rig_new_replay(motion_path, ",scale=2,rotate=0.5/-0.5/0.1/0.7,offset=1/2/3");
  device_rig *near = rig_new_replay(motion_path, ",scale=2,rotate=0.5/-0.5/0.1/0.7,offset=1/2/3");
  rig_read(r, 0);
  rig_read(near, 0);
  for (int i = 1; i < 1500; ++i) {
    const int64_t half = 10000; /* 10 us */
    rig_read(near, i * 1000000LL - half);
    rig_read(r, i * 1000000LL);
    hap_pose first = near->pose;
    rig_read(near, i * 1000000LL + half);
    double angular[3];
    angular_between(first.quat_wxyz, near->pose.quat_wxyz, 2e-5, angular);
    for (int k = 0; k < 3; ++k) {
      double linear = (near->pose.position[k] - first.position[k]) / 2e-5;
      CHECK_NEAR(r->twist.linear[k], linear, 2e-5);
      CHECK_NEAR(r->twist.angular[k], angular[k], 2e-5);
    }
    double norm = 0.0;
    for (int k = 0; k < 4; ++k) {
      norm += r->pose.quat_wxyz[k] * r->pose.quat_wxyz[k];
    }
    CHECK_NEAR(norm, 1.0, 1e-14);
  }
}

TEST(rotation_has_the_speed_of_the_truth)
{
  write_turning(200, true);
  device_rig *r = rig_new_replay(motion_path, "");
  for (int i = 0; i < 1500; ++i) {
    double t = i * 1e-3;
    rig_read(r, i * 1000000LL);
    if (t > 0.2) {
      double w = 3.0 + 5.0 * cos(5.0 * t);
      CHECK_NEAR(r->twist.angular[0], 0.6 * w, 5e-3);
      CHECK_NEAR(r->twist.angular[1], 0.0, 1e-12);
      CHECK_NEAR(r->twist.angular[2], 0.8 * w, 5e-3);
      double half = 0.5 * (3.0 * t + sin(5.0 * t));
      CHECK_NEAR(fabs(r->pose.quat_wxyz[0]), fabs(cos(half)), 1e-5);
    }
  }
}

TEST(signs_of_quaternions_do_not_matter)
{
  write_turning(100, true);
  device_rig *a = rig_new_replay(motion_path, "");
  write_turning(100, false);
  device_rig *b = rig_new_replay(motion_path, "");
  for (int i = 0; i < 900; ++i) {
    rig_read(a, i * 1000000LL);
    rig_read(b, i * 1000000LL);
    double along = 0.0;
    for (int k = 0; k < 4; ++k) {
      along += a->pose.quat_wxyz[k] * b->pose.quat_wxyz[k];
    }
    CHECK_NEAR(fabs(along), 1.0, 1e-14);
    CHECK_NEAR(a->twist.angular[0], b->twist.angular[0], 1e-9);
  }
}

TEST(half_turns_between_rows_stay_finite)
{
  file_write(
      motion_path,
      "t,x,y,z,qw,qx,qy,qz\n0,0,0,0,1,0,0,0\n1,0,0,0,0,1,0,0\n2,0,0,0,-1,0,0,0\n3,0,0,0,0,0,1,0\n"
      "4,0,0,0,1,0,0,0\n");
  device_rig *r = rig_new_replay(motion_path, "");
  for (int i = 0; i < 4200; ++i) {
    rig_read(r, i * 1000000LL);
    CHECK(hapi_finite(r->pose.quat_wxyz, 4) && hapi_finite(r->twist.angular, 3));
  }
}

TEST(forms_of_text_are_accepted)
{
  static const char *const good[] = {"\xEF\xBB\xBFt,x,y,z\r\n0,1,2,3\r\n1,2,3,4\r\n",
                                     "t,x,y,z\n0,1,2,3\n1,2,3,4", /* no end of the last line */
                                     "t,x,y,z\n0,1,2,3\n1,2,3,4\n\n\r\n  \n",
                                     " t, x ,y,\tz \n 0 ,1 , 2,\t3\n1,2,3,4\n",
                                     "t,x,y,z\n0e0,1.,2.0,+3\n1,2,3,4\n",
                                     "t,x,y,z\n-0,1,2,3\n1,2,3,4\n"};
  for (size_t i = 0; i < sizeof good / sizeof good[0]; ++i) {
    file_write(motion_path, good[i]);
    device_rig *r = rig_new_replay(motion_path, "");
    rig_read(r, 0);
    CHECK(r->pose.position[0] == 1.0 && r->pose.position[2] == 3.0);
    rig_read(r, 1000000000);
    CHECK(r->pose.position[0] == 2.0 && r->pose.position[2] == 4.0);
  }
}

typedef struct bad_file {
  const char *text;
  int line;
  const char *why;
} bad_file;

static const bad_file bad_files[] = {
    {"", 1, "empty"},
    {"\n", 1, "header"},
    {"\xEF\xBB\xBF", 1, "header"},
    {"t,x,y\n0,1,2\n", 1, "header"},
    {"t,x,y,z,qw\n0,1,2,3,1\n", 1, "header"},
    {"t,x,y,z,\n0,1,2,3\n", 1, "header"},
    {"t,x,y,z,qw,qx,qy,qz,k\n", 1, "header"},
    {"t;x;y;z\n0;1;2;3\n", 1, "not 't;x;y;z'"},
    {"time,x,y,z\n", 1, "header"},
    {"0,1,2,3\n1,2,3,4\n", 1, "header"},
    {"t,x,y,z", 1, "no row"},
    {"t,x,y,z\n\n\n", 3, "no row"},
    {"t,x,y,z\n0,1,2\n", 2, "3 columns, the header has 4"},
    {"t,x,y,z\n0,1,2,3\n1,2,3,4,5\n", 3, "5 columns, the header has 4"},
    {"t,x,y,z\n0,1,2,3\n1,2,3,4,\n", 3, "5 columns"},
    {"t,x,y,z,qw,qx,qy,qz\n0,1,2,3\n", 2, "4 columns, the header has 8"},
    {"t,x,y,z\n0,1,2,3\n1,2,,4\n", 3, "column y: ''"},
    {"t,x,y,z\n0,1,2,3\n1,2,3,\n", 3, "column z"},
    {"t,x,y,z\n0,1,2,3\n1,two,3,4\n", 3, "column x: 'two'"},
    {"t,x,y,z\n0,1,2,3\n1,2,3,4 m\n", 3, "column z: '4 m'"},
    {"t,x,y,z\n0,1,2,3\n1,2,3,4;\n", 3, "'4;'"},
    {"t,x,y,z\n0,1,2,3\n1,2,0x3,4\n", 3, "'0x3'"},
    {"t,x,y,z\n0,nan,2,3\n", 2, "'nan'"},
    {"t,x,y,z\n0,1,-inf,3\n", 2, "'-inf'"},
    {"t,x,y,z\n0,1,2,1e999\n", 2, "'1e999'"},
    {"t,x,y,z\n0,1,2,1e9\n", 2, "beyond 1e6 m"},
    {"t,x,y,z\n1e11,1,2,3\n", 2, "beyond 1e10 s"},
    {"t,x,y,z\n0,1,2,3\n0.1,1,2,3\n0.1,1,2,3\n", 4, "does not increase"},
    {"t,x,y,z\n0,1,2,3\n0.2,1,2,3\n0.1,1,2,3\n", 4, "does not increase"},
    {"t,x,y,z\n0,1,2,3\n1e-12,1,2,3\n", 3, "less than 1 ns"},
    {"t,x,y,z\n0,1,2,3\n\n\n1,1,2,3\n", 3, "blank line"},
    {"t,x,y,z\r\n0,1,2,3\r\n\r\n1,1,2,3\r\n", 3, "blank line"},
    {"t,x,y,z,qw,qx,qy,qz\n0,0,0,0,1,0,0,0\n1,0,0,0,0,0,0,0\n", 3, "quaternion"},
    {"t,x,y,z\n0,1,2,3\n1,2,3,4\n# the end\n", 4, "column t: '# the end'"},
    {"t,x,y,z\r0,1,2,3\r1,2,3,4\r", 1, "header"}};

TEST(malformed_files_are_named_by_line)
{
  for (size_t i = 0; i < sizeof bad_files / sizeof bad_files[0]; ++i) {
    hap_detail detail;
    char place[200];
    file_write(motion_path, bad_files[i].text);
    snprintf(place, sizeof place, "%s, line %d: ", motion_path, bad_files[i].line);
    CHECK(replay_try(motion_path, "", &detail) == HAP_ERROR_FORMAT);
    bool told = strstr(detail.text, place) != NULL && strstr(detail.text, bad_files[i].why) != NULL;
    CHECK_SAY(told, "file %zu gave '%s'", i, detail.text);
  }
}

TEST(binary_and_endless_lines_are_refused)
{
  hap_detail detail;
  static const char zero_inside[] = "t,x,y,z\n0,1,2,3\n1,2\0,3,4\n";
  file_write_bytes(motion_path, zero_inside, sizeof zero_inside - 1);
  CHECK(replay_try(motion_path, "", &detail) == HAP_ERROR_FORMAT);
  CHECK(strstr(detail.text, "line 3: a zero byte") != NULL);
  static char large[100000];
  memset(large, '1', sizeof large - 1);
  large[7] = '\n';
  for (int i = 0; i < 7; ++i) {
    large[i] = "t,x,y,z"[i];
  }
  file_write(motion_path, large);
  CHECK(replay_try(motion_path, "", &detail) == HAP_ERROR_FORMAT);
  CHECK(strstr(detail.text, "line 2: the line is longer") != NULL);
}

TEST(files_that_cannot_be_read)
{
  hap_detail detail;
  const char *path = folder_path("none.csv");
  CHECK(replay_try(path, "", &detail) == HAP_ERROR_IO);
  CHECK(strstr(detail.text, path) != NULL && strstr(detail.text, "No such file") != NULL);
  CHECK(replay_try(test_folder, "", &detail) ==
        HAP_ERROR_IO); /* a folder opens, but does not read */
  CHECK(strstr(detail.text, test_folder) != NULL);
}

TEST(bad_specs_say_why)
{
  static const char *const bad[][2] = {{",scale=0", "scale: expected"},
                                       {",scale=-1", "scale"},
                                       {",scale=nan", "scale"},
                                       {",offset=1/2", "offset: expected x/y/z"},
                                       {",rotate=0/0/0/0", "rotate"},
                                       {",start=-1", "start"},
                                       {",speed=2", "no argument 'speed'"},
                                       {",scale=1,scale=1", "twice"},
                                       {",", "last comma"},
                                       {",scale", "key=value"},
                                       {",scale=1,", "key=value"}};
  file_write(motion_path, "t,x,y,z\n0,1,2,3\n");
  for (size_t i = 0; i < sizeof bad / sizeof bad[0]; ++i) {
    hap_detail detail;
    CHECK(replay_try(motion_path, bad[i][0], &detail) == HAP_ERROR_ARGUMENT);
    CHECK(strstr(detail.text, bad[i][1]) != NULL);
  }
  hap_detail detail;
  CHECK(replay_try("", "", &detail) == HAP_ERROR_ARGUMENT);
  CHECK(replay_try("", ",scale=1", &detail) == HAP_ERROR_ARGUMENT);
}

/* A locale with a decimal comma, or NULL. */
static const char *comma_locale(void)
{
  static const char *const names[] = {"de_DE.UTF-8", "de_DE.utf8", "de_DE",
                                      "fr_FR.UTF-8", "fr_FR.utf8", "nl_NL.UTF-8"};
  for (size_t i = 0; i < sizeof names / sizeof names[0]; ++i) {
    if (setlocale(LC_ALL, names[i]) != NULL && localeconv()->decimal_point[0] == ',') {
      return names[i];
    }
  }
  setlocale(LC_ALL, "C");
  return NULL;
}

TEST(decimal_comma_of_the_locale_is_ignored)
{
  if (comma_locale() == NULL) {
    SKIP("no locale with a decimal comma is installed");
  }
  file_write(motion_path, "t,x,y,z\n0,0.5,2.25,3\n0.5,1.5,2,3\n");
  device_rig *r = rig_new_replay(motion_path, ",scale=1.5,offset=0.5/0/0");
  CHECK(strtod("1.5", NULL) == 1.0); /* the locale is still the caller's */
  setlocale(LC_ALL, "C");
  rig_read(r, 0);
  CHECK(r->pose.position[0] == 1.25 && r->pose.position[1] == 3.375);
}

TEST(random_damage_never_crashes)
{
  static char text[4096];
  static char damaged[4096];
  static const char likely[] = "0123456789.,-+eE\n\r \tnaiftxyzqw\xEF\xBB\xBF";
  write_turning(25, true);
  FILE *file = fopen(motion_path, "rb");
  REQUIRE(file != NULL);
  size_t size = fread(text, 1, sizeof text, file);
  fclose(file);
  REQUIRE(size > 1000 && size < sizeof text);
  uint32_t state = 99;
  int opened = 0;
  for (int trial = 0; trial < 4000; ++trial) {
    memcpy(damaged, text, size);
    for (int n = 1 + (int)(random_share(&state) * 3.0); n > 0; --n) {
      size_t at = (size_t)(random_share(&state) * (double)size);
      if (random_share(&state) < 0.7) {
        damaged[at] = likely[(size_t)(random_share(&state) * (double)(sizeof likely - 1))];
      } else {
        unsigned char any = (unsigned char)(random_share(&state) * 256.0);
        memcpy(&damaged[at], &any, 1);
      }
    }
    file_write_bytes(
        motion_path, damaged,
        random_share(&state) < 0.1 ? (size_t)(random_share(&state) * (double)size) : size);
    hap_detail detail;
    hap_status status = replay_try(motion_path, "", &detail);
    CHECK(status == HAP_OK || status == HAP_ERROR_FORMAT);
    CHECK(status == HAP_OK || strstr(detail.text, ", line ") != NULL);
    if (status != HAP_OK) {
      continue;
    }
    ++opened;
    device_rig *r = rig_new_replay(motion_path, "");
    for (int i = 0; i < 60; ++i) {
      rig_read(r, i * 7000000LL);
      CHECK(hapi_finite(r->pose.position, 3) && hapi_finite(r->pose.quat_wxyz, 4));
      CHECK(hapi_finite(r->twist.linear, 3) && hapi_finite(r->twist.angular, 3));
    }
    tap_release(r);
  }
  printf("# %d of 4000 damaged files opened\n", opened);
  CHECK(opened > 200 && opened < 3800); /* both ways were gone */
}

TEST(half_a_million_rows_load)
{
  const int rows = 500000;
  FILE *file = fopen(motion_path, "w");
  REQUIRE(file != NULL);
  fputs("t,x,y,z\n", file);
  for (int i = 0; i < rows; ++i) {
    fprintf(file, "%d.%03d,%d,0,0\n", i / 1000, i % 1000, i);
  }
  fclose(file);
  device_rig *r = rig_new_replay(motion_path, "");
  for (int i = 0; i < rows; i += 997) {
    rig_read(r, i * 1000000LL);
    CHECK(r->pose.position[0] == (double)i);
  }
}

/* Folder of the shared recordings, or NULL. */
static const char *shared_data(void)
{
  static char path[1024];
  const char *shared = getenv("HAPODE_SHARED");
#ifdef HAPODE_SOURCE_ROOT
  const char *root = HAPODE_SOURCE_ROOT;
#else
  const char *root = ".";
#endif
  if (shared != NULL) {
    snprintf(path, sizeof path, "%s/data", shared);
  } else {
    snprintf(path, sizeof path, "%s/../shared/data", root);
  }
  return access(path, R_OK) == 0 ? path : NULL;
}

typedef struct extent {
  double low[3];
  double high[3];
  double last; /* s */
  long rows;
} extent;

/* Read a second way, by sscanf, so that the reader is not its own witness. */
static bool read_extent(const char *path, extent *out)
{
  FILE *file = fopen(path, "r");
  if (file == NULL) {
    return false;
  }
  char text[512];
  double p[3];
  out->rows = 0;
  while (fgets(text, sizeof text, file) != NULL) {
    if (sscanf(text, "%lf,%lf,%lf,%lf", &out->last, &p[0], &p[1], &p[2]) != 4) {
      continue;
    }
    for (int k = 0; k < 3; ++k) {
      out->low[k] = out->rows == 0 ? p[k] : fmin(out->low[k], p[k]);
      out->high[k] = out->rows == 0 ? p[k] : fmax(out->high[k], p[k]);
    }
    ++out->rows;
  }
  fclose(file);
  return out->rows > 1;
}

/* At 1 kHz: inside the recorded box and 1 % of its longest side, and no step of the position that
 * the velocities at its ends do not explain. */
static void check_recording(const char *path)
{
  extent e = {.rows = 0};
  REQUIRE(read_extent(path, &e));
  device_rig *r = rig_new_replay(path, "");
  double side = 0.0;
  for (int k = 0; k < 3; ++k) {
    side = fmax(side, e.high[k] - e.low[k]);
  }
  double fastest = 0.0;
  for (int64_t i = 0; i <= (int64_t)(e.last * 1e3); ++i) {
    hap_pose before = r->pose;
    rig_read(r, i * 1000000);
    fastest = fmax(fastest, hapi_v3_norm(r->twist.linear));
    for (int k = 0; k < 3; ++k) {
      CHECK(r->pose.position[k] >= e.low[k] - 0.01 * side);
      CHECK(r->pose.position[k] <= e.high[k] + 0.01 * side);
      CHECK(i == 0 || fabs(r->pose.position[k] - before.position[k]) < 7e-3); /* 7 m/s */
    }
  }
  CHECK(fastest > 0.05 && fastest < 7.0);
}

TEST(real_recordings_replay)
{
  const char *path = shared_data();
  if (path == NULL) {
    SKIP("no recordings: set HAPODE_SHARED to the folder that holds data/");
  }
  DIR *dir = opendir(path);
  REQUIRE(dir != NULL);
  int files = 0;
  const struct dirent *entry;
  while ((entry = readdir(dir)) != NULL) {
    const char *dot = strrchr(entry->d_name, '.');
    if (dot == NULL || strcmp(dot, ".csv") != 0) {
      continue;
    }
    char name[1400];
    snprintf(name, sizeof name, "%s/%s", path, entry->d_name);
    ++files;
    int before = tap_failures;
    check_recording(name);
    if (tap_failures != before) {
      printf("# in %s\n", name);
    }
  }
  closedir(dir);
  CHECK(files == 15);
}

SET_UP
{
  bool good = folder_make();
  snprintf(motion_path, sizeof motion_path, "%s", folder_path("motion.csv"));
  return good;
}
