/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Models of string devices, their check and their file. */

#include "tests/files.h"
#include "tests/tap.h"

#include <sys/stat.h>
#include <unistd.h>

#include "base/vec.h"
#include "plugins/spidar/kinematics.h"
#include "plugins/spidar/model.h"

#define MODELS 7

static char path[160];

static const hapi_spidar_model *model_of(const char *name)
{
  const hapi_spidar_model *model = hapi_spidar_model_find(name);
  if (model == NULL) {
    printf("Bail out! no model %s\n", name);
    exit(1);
  }
  return model;
}

/* ---- the built-in ones ---- */

TEST(built_in_models_are_sound)
{
  int count = 0;
  for (; hapi_spidar_model_at((size_t)count) != NULL; ++count) {
    hap_detail detail = {""};
    const hapi_spidar_model *model = hapi_spidar_model_at((size_t)count);
    CHECK(hapi_spidar_model_check(model, &detail) == HAP_OK);
    CHECK(detail.text[0] == '\0');
    CHECK(hapi_spidar_model_find(model->name) == model);
  }
  CHECK(count == MODELS);
  CHECK(hapi_spidar_model_find("X4R") == hapi_spidar_model_find("x4r"));
  CHECK(hapi_spidar_model_find("x9") == NULL && hapi_spidar_model_find("") == NULL);
}

/* A string's signs, as bits: 1 is below 0. */
static unsigned count_negative(const double *values, int count)
{
  unsigned bits = 0;
  for (int i = 0; i < count; ++i) {
    bits |= values[i] < 0.0 ? 1u << i : 0u;
  }
  return bits;
}

typedef struct figures {
  const char *name;
  double volts, counts, least, most;
  unsigned counts_negative, volts_negative; /* bit i: string i */
  double motor_sum[3], grip_sum[3];         /* mm, sum over i of (i + 1) * point */
} figures;

/* Weighted sums, so that two exchanged points show; computed apart from the tables. */
static const figures known[] = {
    {
        "x4r",
        0.08,
        3.485e-5,
        0.2,
        20.0,
        0xC3,
        0x3C,
        {-552, 1520, 0},
        {-45, 180, 0},
    },
    {"x5r", 0.091, 2.25e-5, 0.3, 6.0, 0x55, 0xAA, {0, 1176, -620}, {30, 120, 0}},
    {"x5l", 0.091, 2.25e-5, 0.3, 6.0, 0, 0, {-620, -1176, 0}, {0, -120, 30}},
    {"t1", 0.04, 5.1645e-5, 0.3, 20.0, 0x3C, 0xC3, {225.734, 1681.1, -1872.72}, {-46, 307.2, -46}},
    {"x3r",
     0.3652968,
     1.66555e-5,
     0.3,
     20.0,
     0x3C,
     0,
     {339.412, 1216, -339.412},
     {31.82, 180, 31.82}},
    {"x3r4", 0.3652968, 1.66555e-5, 0.3, 20.0, 0x6, 0, {120, 280, 0}, {0, 0, 0}},
};

TEST(built_in_models_have_the_published_figures)
{
  for (size_t k = 0; k < sizeof known / sizeof known[0]; ++k) {
    const figures *f = &known[k];
    const hapi_spidar_model *m = model_of(f->name);
    CHECK_NEAR(m->min_tension, f->least, 0.0);
    CHECK_NEAR(m->max_tension, f->most, 0.0);
    CHECK(count_negative(m->metres_per_count, m->strings) == f->counts_negative);
    CHECK(count_negative(m->volts_per_newton, m->strings) == f->volts_negative);
    double motor[3] = {0.0};
    double grip[3] = {0.0};
    for (int i = 0; i < m->strings; ++i) {
      CHECK_NEAR(fabs(m->metres_per_count[i]), f->counts, 0.0);
      CHECK_NEAR(fabs(m->volts_per_newton[i]), f->volts, 0.0);
      hapi_v3_madd(motor, 1e3 * (i + 1), m->motor[i], motor);
      hapi_v3_madd(grip, 1e3 * (i + 1), m->grip[i], grip);
    }
    for (int axis = 0; axis < 3; ++axis) {
      CHECK_NEAR(motor[axis], f->motor_sum[axis], 1e-9);
      CHECK_NEAR(grip[axis], f->grip_sum[axis], 1e-9);
    }
  }
}

/* ---- the check ---- */

typedef void (*spoil_fn)(hapi_spidar_model *model);

static void name_empty(hapi_spidar_model *m)
{
  m->name[0] = '\0';
}
static void name_endless(hapi_spidar_model *m)
{
  memset(m->name, 'x', sizeof m->name);
}
static void name_of_two_lines(hapi_spidar_model *m)
{
  snprintf(m->name, sizeof m->name, "a\nb");
}
static void strings_3(hapi_spidar_model *m)
{
  m->strings = 3;
}
static void strings_9(hapi_spidar_model *m)
{
  m->strings = 9;
}
static void strings_too_few_for_6_dof(hapi_spidar_model *m)
{
  m->strings = 6;
}
static void dof_5(hapi_spidar_model *m)
{
  m->dof = 5;
}
static void motor_nan(hapi_spidar_model *m)
{
  m->motor[3][1] = NAN;
}
static void grip_infinite(hapi_spidar_model *m)
{
  m->grip[7][0] = INFINITY;
}
static void motor_far(hapi_spidar_model *m)
{
  m->motor[0][2] = 69.0; /* millimetres taken for metres */
}
static void count_zero(hapi_spidar_model *m)
{
  m->metres_per_count[2] = 0.0;
}
static void volts_zero(hapi_spidar_model *m)
{
  m->volts_per_newton[2] = 0.0;
}
static void tensions_crossed(hapi_spidar_model *m)
{
  m->min_tension = 21.0;
}
static void tension_negative(hapi_spidar_model *m)
{
  m->min_tension = -0.1;
}
static void heat_below_least(hapi_spidar_model *m)
{
  m->heat_tension = 0.1;
}
static void strings_the_same(hapi_spidar_model *m)
{
  memcpy(m->motor[1], m->motor[0], sizeof m->motor[0]);
  memcpy(m->grip[1], m->grip[0], sizeof m->grip[0]);
}
static void string_without_length(hapi_spidar_model *m)
{
  memcpy(m->motor[4], m->grip[4], sizeof m->motor[4]);
}
static void grip_a_point(hapi_spidar_model *m)
{
  memset(m->grip, 0, sizeof m->grip); /* nothing tells how it is turned */
}
static void motors_all_above(hapi_spidar_model *m)
{
  for (int i = 0; i < 4; ++i) {
    m->motor[i][1] = 0.05; /* nothing pulls down */
  }
}
static void workspace_too_large(hapi_spidar_model *m)
{
  m->workspace[0] = 0.4;
  m->workspace[2] = 0.4;
  m->workspace_turn = 1.9;
}
static void workspace_flat(hapi_spidar_model *m)
{
  m->workspace[1] = 0.0;
}
static void mass_negative(hapi_spidar_model *m)
{
  m->mass = -0.1;
}
static void damping_nan(hapi_spidar_model *m)
{
  m->damping = NAN;
}
static void friction_endless(hapi_spidar_model *m)
{
  m->friction = INFINITY;
}
static void offset_nan(hapi_spidar_model *m)
{
  m->offset[1] = NAN;
}

static const struct {
  spoil_fn spoil;
  const char *said;
} spoils[] = {
    {name_empty, "name"},
    {name_endless, "name"},
    {name_of_two_lines, "name"},
    {strings_3, "strings is 3"},
    {strings_9, "strings is 9"},
    {strings_too_few_for_6_dof, "7 are needed"},
    {dof_5, "dof is 5"},
    {motor_nan, "string_3"},
    {grip_infinite, "string_7"},
    {motor_far, "string_0"},
    {count_zero, "string_2.metres_per_count"},
    {volts_zero, "string_2.volts_per_newton"},
    {tensions_crossed, "max_tension_n"},
    {tension_negative, "min_tension_n"},
    {heat_below_least, "heat_tension_n"},
    {strings_the_same, "string_0 and string_1"},
    {string_without_length, "string_4 is shorter"},
    {grip_a_point, "do not tell the pose"},
    {motors_all_above, "cannot hold the grip"},
    {workspace_too_large, "do not tell the pose"},
    {workspace_flat, "workspace_mm"},
    {mass_negative, "mass_kg"},
    {damping_nan, "damping_ns_per_m"},
    {friction_endless, "friction_n"},
    {offset_nan, "string_1: its offset"},
};

TEST(what_is_wrong_is_refused)
{
  for (size_t i = 0; i < sizeof spoils / sizeof spoils[0]; ++i) {
    hapi_spidar_model m = *model_of("x4r");
    hap_detail detail = {""};
    spoils[i].spoil(&m);
    CHECK(hapi_spidar_model_check(&m, &detail) == HAP_ERROR_FORMAT);
    CHECK(strstr(detail.text, spoils[i].said) != NULL);
    if (strstr(detail.text, spoils[i].said) == NULL) {
      printf("# expected \"%s\": %s\n", spoils[i].said, detail.text);
    }
    CHECK(hapi_spidar_model_check(&m, NULL) == HAP_ERROR_FORMAT);
    CHECK(hapi_spidar_model_write(path, &m, &detail) == HAP_ERROR_FORMAT);
    CHECK(access(path, F_OK) != 0);
  }
}

TEST(what_a_file_does_not_say_has_sound_defaults)
{
  for (size_t k = 0; k < MODELS; ++k) {
    hapi_spidar_model m = *hapi_spidar_model_at(k);
    hap_detail detail = {""};
    hapi_spidar_model_default(&m);
    CHECK(k == 4 || hapi_spidar_model_check(&m, &detail) == HAP_OK); /* t1: its centre is needed */
    CHECK(detail.text[0] == '\0');
  }
}

/* ---- the file ---- */

static bool models_same(const hapi_spidar_model *a, const hapi_spidar_model *b)
{
  bool all = strcmp(a->name, b->name) == 0 && a->strings == b->strings && a->dof == b->dof &&
             a->board == b->board && a->calibrated == b->calibrated &&
             memcmp(a->motor, b->motor, sizeof a->motor) == 0 &&
             memcmp(a->grip, b->grip, sizeof a->grip) == 0 &&
             memcmp(a->offset, b->offset, sizeof a->offset) == 0 &&
             memcmp(a->volts_per_newton, b->volts_per_newton, sizeof a->offset) == 0 &&
             memcmp(a->metres_per_count, b->metres_per_count, sizeof a->offset) == 0;
  return all && a->min_tension == b->min_tension && a->max_tension == b->max_tension &&
         a->tension_rate == b->tension_rate && a->torque_weight == b->torque_weight &&
         a->spread_weight == b->spread_weight && a->residual == b->residual &&
         memcmp(a->centre, b->centre, sizeof a->centre) == 0 &&
         memcmp(a->workspace, b->workspace, sizeof a->workspace) == 0 &&
         a->workspace_turn == b->workspace_turn && a->heat_tension == b->heat_tension &&
         a->heat_time == b->heat_time && a->mass == b->mass && a->damping == b->damping &&
         a->friction == b->friction;
}

/* To the last bit, as the built-in figures have few digits. */
TEST(models_are_read_as_they_were_written)
{
  for (size_t k = 0; k < MODELS; ++k) {
    for (int calibrated = 0; calibrated < 2; ++calibrated) {
      hapi_spidar_model m = *hapi_spidar_model_at(k);
      hapi_spidar_model back;
      hap_detail detail = {""};
      m.mass = 0.125 * calibrated;
      m.damping = 0.25 * calibrated;
      m.friction = 0.5 * calibrated;
      for (int i = 0; i < m.strings && calibrated != 0; ++i) {
        m.offset[i] = 0.125 * (i - 3);
        m.calibrated = true;
      }
      memset(&back, 0xa5, sizeof back);
      CHECK(hapi_spidar_model_write(path, &m, &detail) == HAP_OK);
      CHECK(hapi_spidar_model_read(path, &back, &detail) == HAP_OK);
      CHECK(models_same(&m, &back));
      unlink(path);
    }
  }
}

TEST(a_file_that_was_there_stays_when_writing_fails)
{
  const hapi_spidar_model *m = model_of("x4r");
  hapi_spidar_model back;
  hap_detail detail = {""};
  char beside[170];
  CHECK(hapi_spidar_model_write(path, m, &detail) == HAP_OK);
  snprintf(beside, sizeof beside, "%s.new", path);
  REQUIRE(mkdir(beside, 0700) == 0); /* the new file cannot be made */
  CHECK(hapi_spidar_model_write(path, model_of("x5r"), &detail) == HAP_ERROR_IO);
  CHECK(strstr(detail.text, ".new") != NULL);
  CHECK(hapi_spidar_model_read(path, &back, &detail) == HAP_OK);
  CHECK(models_same(m, &back));
  rmdir(beside);
  unlink(path);
  CHECK(hapi_spidar_model_write("/nowhere/x", m, &detail) == HAP_ERROR_IO);
  /* a full disk: nothing is left behind, and it is said */
  CHECK(access("/dev/full", F_OK) != 0 || symlink("/dev/full", beside) == 0);
  CHECK(access("/dev/full", F_OK) != 0 ||
        hapi_spidar_model_write(path, m, &detail) == HAP_ERROR_IO);
  CHECK(access(path, F_OK) != 0 && access(beside, F_OK) != 0);
  unlink(beside);
}

static const char minimal[] =
    "# four strings\n"
    "version = 1\n"
    "name = mine\n"
    "  strings=4 # of them\n"
    "dof = 3\n"
    "min_tension_n = 0.3\r\n"
    "max_tension_n = 20\n"
    "\n"
    "string_0.motor_mm = -60 -70 -60\n"
    "string_1.motor_mm = 60\t-70  60\n"
    "string_2.motor_mm = -60 70 60\n"
    "string_3.motor_mm = 60 70 -60\n"
    "string_0.grip_mm = 0 0 0\nstring_1.grip_mm = 0 0 0\nstring_2.grip_mm = 0 0 0\n"
    "string_3.grip_mm = 0 0 0\n"
    "string_0.metres_per_count = 1.6e-5\nstring_1.metres_per_count = -1.6e-5\n"
    "string_2.metres_per_count = -1.6e-5\nstring_3.metres_per_count = 1.6e-5\n"
    "string_0.volts_per_newton = .3\nstring_1.volts_per_newton = .3\n"
    "string_2.volts_per_newton = .3\nstring_3.volts_per_newton = .3"; /* no end of line */

static void write_text(const char *text)
{
  FILE *file = fopen(path, "w");
  REQUIRE(file != NULL);
  fputs(text, file);
  fclose(file);
}

TEST(a_short_file_is_enough)
{
  hapi_spidar_model m;
  hap_detail detail = {""};
  write_text(minimal);
  CHECK(hapi_spidar_model_read(path, &m, &detail) == HAP_OK);
  CHECK(strcmp(m.name, "mine") == 0 && m.strings == 4 && m.dof == 3 && !m.calibrated);
  CHECK(m.motor[1][0] == 0.06 && m.motor[1][1] == -0.07 && m.motor[1][2] == 0.06);
  CHECK(m.board == HAPI_SPIDAR_UART && m.tension_rate == 4000.0 && m.heat_tension > 0.3);
  unlink(path);
}

/* One line more, or one instead of the one that begins like it; what is said, and the line. */
static const struct {
  const char *line;
  const char *instead; /* of the line that begins so; NULL: it comes last */
  const char *said;
} slips[] = {
    {"colour = red", NULL, "line 25: known are version"},
    {"colour", NULL, "line 25: expected key = value"},
    {"= 3", NULL, "line 25: expected key = value"},
    {"dof = 3", NULL, "line 25: given twice: dof"},
    {"name = b", NULL, "line 25: given twice: name"},
    {"min_tension_n = 1", NULL, "line 25: given twice: min_tension_n"},
    {"string_0.motor_mm = 1 2 3", NULL, "line 25: given twice: motor_mm"},
    {"string_4.motor_mm = 1 2 3", NULL, "there are strings = 4"},
    {"string_9.motor_mm = 1 2 3", NULL, "expected string_0. to string_7."},
    {"string_0motor_mm = 1 2 3", NULL, "expected string_0. to string_7."},
    {"string_0.motor_m = 1 2 3", NULL, "of a string are known motor_mm"},
    {"string_0.offset_m = 0.1", NULL, "offset_m is given for 1 strings of 4"},
    {"workspace_mm = 1 2", NULL, "workspace_mm: expected 3 decimal numbers"},
    {"workspace_mm = 1 2 3 4", NULL, "workspace_mm: expected 3 decimal numbers"},
    {"workspace_mm = 1,2,3", NULL, "workspace_mm: expected 3 decimal numbers"},
    {"residual_mm = nan", NULL, "residual_mm: expected 1 decimal number"},
    {"residual_mm = 0x10", NULL, "residual_mm: expected 1 decimal number"},
    {"residual_mm =", NULL, "residual_mm: expected 1 decimal number"},
    {"residual_mm = 1e999", NULL, "residual_mm: expected 1 decimal number"},
    {"residual_mm = -1", NULL, "residual_mm"},
    {"board = pci", NULL, "expected once uart or usb"},
    {"name = two words", "name", "name: expected 1 to 31 letters"},
    {"name =", "name", "name: expected 1 to 31 characters"},
    {"name = 0123456789012345678901234567890123456789", "name", "1 to 31 characters"},
    {"strings = 12", "  strings", "line 4: strings: expected a whole number"},
    {"strings = 9", "  strings", "line 4: strings: expected a whole number"},
    {"strings = 4.5", "  strings", "line 4: strings: expected a whole number"},
    {"strings = 3", "  strings", "there are strings = 3"},
    {"dof = 6", "dof", "4 strings cannot hold 6 dof"},
    {"dof = 4", "dof", "dof is 4"},
    {"# none", "dof", "without a line dof"},
    {"# none", "name", "without a line name"},
    {"# none", "min_tension_n", "without a line min_tension_n"},
    {"# none", "string_2.motor_mm", "without a line string_2.motor_mm"},
    {"# none", "  strings", "before the line strings = N"},
    {"version = 2", "version", "reads version 1, not 2"},
    {"# none", "version", "expected version = 1 before all else"},
};

static void line_slip(const char *line, const char *instead, char *out, size_t size)
{
  size_t used = 0;
  const char *at = minimal;
  while (*at != '\0') {
    size_t length = strcspn(at, "\n");
    bool replaced = instead != NULL && strncmp(at, instead, strlen(instead)) == 0;
    used += (size_t)(replaced ? snprintf(out + used, size - used, "%s\n", line)
                              : snprintf(out + used, size - used, "%.*s\n", (int)length, at));
    at += length + (at[length] == '\n');
  }
  if (instead == NULL) {
    snprintf(out + used, size - used, "%s\n", line);
  }
}

TEST(slips_are_said_with_their_line)
{
  for (size_t i = 0; i < sizeof slips / sizeof slips[0]; ++i) {
    char text[4096];
    hapi_spidar_model m;
    hapi_spidar_model before;
    hap_detail detail = {""};
    memset(&m, 0x5a, sizeof m);
    before = m;
    line_slip(slips[i].line, slips[i].instead, text, sizeof text);
    write_text(text);
    CHECK(hapi_spidar_model_read(path, &m, &detail) == HAP_ERROR_FORMAT);
    CHECK(strstr(detail.text, path) != NULL);
    bool said = strstr(detail.text, slips[i].said) != NULL;
    CHECK_SAY(said, "\"%s\": expected \"%s\": %s", slips[i].line, slips[i].said, detail.text);
    CHECK(memcmp(&m, &before, sizeof m) == 0);
    CHECK(hapi_spidar_model_read(path, &m, NULL) == HAP_ERROR_FORMAT);
  }
  unlink(path);
}

TEST(what_is_no_text_is_refused)
{
  hapi_spidar_model m;
  hap_detail detail = {""};
  FILE *file = fopen(path, "w");
  REQUIRE(file != NULL);
  fputs("version = 1\n", file);
  for (int i = 0; i < 3000; ++i) {
    fputc('x', file);
  }
  fclose(file);
  CHECK(hapi_spidar_model_read(path, &m, &detail) == HAP_ERROR_FORMAT);
  CHECK(strstr(detail.text, "line 2: longer than") != NULL);
  file = fopen(path, "w");
  REQUIRE(file != NULL);
  fwrite("version = 1\nname\0 = x\n", 1, 22, file);
  fclose(file);
  CHECK(hapi_spidar_model_read(path, &m, &detail) == HAP_ERROR_FORMAT);
  CHECK(strstr(detail.text, "line 2") != NULL);
  write_text("");
  CHECK(hapi_spidar_model_read(path, &m, &detail) == HAP_ERROR_FORMAT);
  CHECK(strstr(detail.text, "without a line version") != NULL);
  unlink(path);
  CHECK(hapi_spidar_model_read(path, &m, &detail) == HAP_ERROR_IO);
  CHECK(hapi_spidar_model_read("/", &m, &detail) == HAP_ERROR_IO);
  CHECK(strstr(detail.text, "it is a folder") != NULL);
}

SET_UP
{
  bool good = folder_make();
  snprintf(path, sizeof path, "%s", folder_path("model.txt"));
  return good;
}
