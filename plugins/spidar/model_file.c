/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The geometry file: lines "key = value", '#' begins a comment. */

#include <errno.h>
#include <fcntl.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "base/key_file.h"
#include "base/log.h"
#include "base/number.h"
#include "base/regular.h"
#include "plugins/spidar/model.h"

#define VERSION 1.0
#define DEGREES 57.29577951308232087679815481410517
#define STRING_PREFIX "string_"

/* A key, and where its numbers are. */
typedef struct figure {
  const char *key;
  size_t offset;
  int count;      /* of numbers */
  double divisor; /* a number in the file over this is the member */
  bool needed;
  const char *about;
} figure;

#define AT(member) offsetof(hapi_spidar_model, member)

static const figure device_figures[] = {
    {"min_tension_n", AT(min_tension), 1, 1.0, true, "of a string, always"},
    {"max_tension_n", AT(max_tension), 1, 1.0, true, "of a string"},
    {"tension_rate_n_per_s", AT(tension_rate), 1, 1.0, false, "fastest change of a tension"},
    {"torque_weight_per_m2", AT(torque_weight), 1, 1.0, false,
     "missing torque against missing force, squares of both"},
    {"spread_weight", AT(spread_weight), 1, 1.0, false, "small tensions against missing force"},
    {"centre_mm", AT(centre), 3, 1000.0, false, "of the workspace"},
    {"workspace_mm", AT(workspace), 3, 1000.0, false, "to each side of its centre"},
    {"workspace_deg", AT(workspace_turn), 1, DEGREES, false, "largest turn"},
    {"residual_mm", AT(residual), 1, 1000.0, false,
     "beyond it a length does not fit: a string is slack or broken"},
    {"heat_tension_n", AT(heat_tension), 1, 1.0, false, "that a motor bears for ever"},
    {"heat_time_s", AT(heat_time), 1, 1.0, false, "thermal time constant of a motor"},
    {"mass_kg", AT(mass), 1, 1.0, false, "of the mechanism, felt at the grip; 0: not known"},
    {"damping_ns_per_m", AT(damping), 1, 1.0, false, "the same"},
    {"friction_n", AT(friction), 1, 1.0, false, "the same"},
};
#define DEVICE_FIGURES (sizeof device_figures / sizeof device_figures[0])

/* Of string 0; the others' follow at the stride of their arrays. */
static const figure string_figures[] = {
    {"motor_mm", AT(motor), 3, 1000.0, true, NULL},
    {"grip_mm", AT(grip), 3, 1000.0, true, NULL},
    {"metres_per_count", AT(metres_per_count), 1, 1.0, true, NULL},
    {"volts_per_newton", AT(volts_per_newton), 1, 1.0, true, NULL},
    {"offset_m", AT(offset), 1, 1.0, false, NULL},
};
#define STRING_FIGURES (sizeof string_figures / sizeof string_figures[0])
#define OFFSET_FIGURE 4

static double *values_at(hapi_spidar_model *model, const figure *f, int string)
{
  char *at = (char *)model + f->offset;
  return (double *)(void *)at + (ptrdiff_t)string * f->count;
}

/* ---- reading ---- */

typedef struct reader {
  hapi_key_file file;
  bool versioned;
  bool named;
  bool boarded;
  bool known[DEVICE_FIGURES];
  bool known_of_string[HAPI_SPIDAR_STRINGS_MAX][STRING_FIGURES];
  hapi_spidar_model model;
} reader;

/* count numbers between blanks, and no more. */
static bool numbers_of(const char *text, int count, double *out)
{
  for (int i = 0; i < count; ++i) {
    size_t blank = strspn(text, " \t");
    if (i > 0 && blank == 0) {
      return false;
    }
    text = hapi_number_read(text + blank, &out[i]);
    if (text == NULL) {
      return false;
    }
  }
  return *text == '\0';
}

static hap_status take_figure(reader *r, const figure *f, int string, const char *value)
{
  double numbers[3];
  bool *known =
      string < 0 ? &r->known[f - device_figures] : &r->known_of_string[string][f - string_figures];
  if (*known) {
    return hapi_key_file_fail(&r->file, "given twice: ", f->key);
  }
  if (!numbers_of(value, f->count, numbers)) {
    return hapi_fail(r->file.detail, HAP_ERROR_FORMAT,
                     "%.200s, line %lu: %s: expected %d decimal number%s, not '%.60s'",
                     r->file.path, r->file.line, f->key, f->count,
                     f->count > 1 ? "s with blanks between" : "", value);
  }
  double *out = values_at(&r->model, f, string < 0 ? 0 : string);
  for (int i = 0; i < f->count; ++i) {
    out[i] = numbers[i] / f->divisor;
  }
  *known = true;
  return HAP_OK;
}

/* "string_3.motor_mm" */
static hap_status take_string(reader *r, const char *key, const char *value)
{
  const char *digit = key + strlen(STRING_PREFIX);
  if (digit[0] < '0' || digit[0] > '7' || digit[1] != '.') {
    return hapi_key_file_fail(&r->file, "expected string_0. to string_7. before a key, not ", key);
  }
  int string = digit[0] - '0';
  if (string >= r->model.strings) {
    return hapi_fail(r->file.detail, HAP_ERROR_FORMAT,
                     "%.200s, line %lu: %.60s, but %s strings = %d: they count from 0",
                     r->file.path, r->file.line, key,
                     r->model.strings == 0 ? "before the line strings = N," : "there are",
                     r->model.strings);
  }
  for (size_t i = 0; i < STRING_FIGURES; ++i) {
    if (strcmp(digit + 2, string_figures[i].key) == 0) {
      return take_figure(r, &string_figures[i], string, value);
    }
  }
  return hapi_key_file_fail(
      &r->file,
      "of a string are known motor_mm, grip_mm, metres_per_count, volts_per_newton and "
      "offset_m, not ",
      digit + 2);
}

static hap_status take_name(reader *r, const char *value)
{
  if (r->named) {
    return hapi_key_file_fail(&r->file, "given twice: ", "name");
  }
  if (*value == '\0' || strlen(value) >= sizeof r->model.name) {
    return hapi_key_file_fail(&r->file, "name: expected 1 to 31 characters, not ", value);
  }
  snprintf(r->model.name, sizeof r->model.name, "%s", value);
  r->named = true;
  return HAP_OK;
}

static hap_status take_board(reader *r, const char *value)
{
  bool uart = strcmp(value, "uart") == 0;
  if (r->boarded || (!uart && strcmp(value, "usb") != 0)) {
    return hapi_key_file_fail(&r->file, "board: expected once uart or usb, not ", value);
  }
  r->model.board = uart ? HAPI_SPIDAR_UART : HAPI_SPIDAR_USB;
  r->boarded = true;
  return HAP_OK;
}

/* strings, dof: whole numbers that are small enough to be looked at by the check. */
static hap_status take_whole(reader *r, const char *key, const char *value, int *out)
{
  if (*out != 0) {
    return hapi_key_file_fail(&r->file, "given twice: ", key);
  }
  if (value[0] < '1' || value[0] > '8' || value[1] != '\0') {
    return hapi_fail(r->file.detail, HAP_ERROR_FORMAT,
                     "%.200s, line %lu: %s: expected a whole number from %s, not '%.60s'",
                     r->file.path, r->file.line, key, *key == 'd' ? "3 and 6" : "4 to 8", value);
  }
  *out = value[0] - '0';
  return HAP_OK;
}

static hap_status take_version(reader *r, const char *value)
{
  double version = 0.0;
  if (!numbers_of(value, 1, &version) || version != VERSION) {
    return hapi_key_file_fail(&r->file, "version: this library reads version 1, not ", value);
  }
  r->versioned = true;
  return HAP_OK;
}

static hap_status take_device(reader *r, const char *key, const char *value)
{
  for (size_t i = 0; i < DEVICE_FIGURES; ++i) {
    if (strcmp(key, device_figures[i].key) == 0) {
      return take_figure(r, &device_figures[i], -1, value);
    }
  }
  return hapi_key_file_fail(
      &r->file,
      "known are version, name, board, strings, dof, min_tension_n, max_tension_n, "
      "tension_rate_n_per_s, torque_weight_per_m2, spread_weight, centre_mm, "
      "workspace_mm, workspace_deg, residual_mm, heat_tension_n, heat_time_s, "
      "mass_kg, damping_ns_per_m, friction_n and "
      "string_N.KEY, not ",
      key);
}

static hap_status take_line(void *self, const hapi_key_file *file, char *key, char *value)
{
  reader *r = self;
  hapi_key_file_uncomment(value);
  if (!r->versioned) {
    return strcmp(key, "version") == 0
               ? take_version(r, value)
               : hapi_key_file_fail(file, "expected version = 1 before all else, not ", key);
  }
  if (strncmp(key, STRING_PREFIX, strlen(STRING_PREFIX)) == 0) {
    return take_string(r, key, value);
  }
  if (strcmp(key, "name") == 0) {
    return take_name(r, value);
  }
  if (strcmp(key, "board") == 0) {
    return take_board(r, value);
  }
  if (strcmp(key, "strings") == 0) {
    return take_whole(r, key, value, &r->model.strings);
  }
  return strcmp(key, "dof") == 0 ? take_whole(r, key, value, &r->model.dof)
                                 : take_device(r, key, value);
}

static hap_status check_strings(reader *r)
{
  int offsets = 0;
  for (int s = 0; s < r->model.strings; ++s) {
    char prefix[32];
    snprintf(prefix, sizeof prefix, STRING_PREFIX "%d.", s);
    offsets += r->known_of_string[s][OFFSET_FIGURE];
    for (size_t i = 0; i < STRING_FIGURES; ++i) {
      if (string_figures[i].needed && !r->known_of_string[s][i]) {
        return hapi_key_file_lacks(&r->file, prefix, string_figures[i].key);
      }
    }
  }
  r->model.calibrated = offsets > 0;
  if (offsets != 0 && offsets != r->model.strings) {
    return hapi_fail(r->file.detail, HAP_ERROR_FORMAT,
                     "%.200s: offset_m is given for %d strings of %d; give it for all or for none",
                     r->file.path, offsets, r->model.strings);
  }
  return HAP_OK;
}

static hap_status check_complete(reader *r)
{
  const char *missing = r->versioned ? NULL : "version";
  missing = missing != NULL || r->named ? missing : "name";
  missing = missing != NULL || r->model.strings != 0 ? missing : "strings";
  missing = missing != NULL || r->model.dof != 0 ? missing : "dof";
  for (size_t i = 0; i < DEVICE_FIGURES && missing == NULL; ++i) {
    missing = r->known[i] || !device_figures[i].needed ? NULL : device_figures[i].key;
  }
  return missing != NULL ? hapi_key_file_lacks(&r->file, "", missing) : check_strings(r);
}

/* What the file does not say. */
static void fill_in(reader *r)
{
  hapi_spidar_model given = r->model;
  hapi_spidar_model_default(&r->model);
  for (size_t i = 0; i < DEVICE_FIGURES; ++i) {
    const figure *f = &device_figures[i];
    if (r->known[i]) {
      memcpy(values_at(&r->model, f, 0), values_at(&given, f, 0),
             (size_t)f->count * sizeof(double));
    }
  }
}

static hap_status check_whole(reader *r)
{
  hap_detail why;
  fill_in(r);
  hap_status status = hapi_spidar_model_check(&r->model, &why);
  return status >= HAP_OK
             ? HAP_OK
             : hapi_fail(r->file.detail, status, "%.200s: %.300s", r->file.path, why.text);
}

hap_status hapi_spidar_model_read(const char *path, hapi_spidar_model *out, hap_detail *detail)
{
  reader r = {.file = {.path = path, .detail = detail}};
  hap_status status = hapi_key_file_read(&r.file, take_line, &r);
  if (status >= HAP_OK) {
    status = check_complete(&r);
  }
  if (status >= HAP_OK) {
    status = check_whole(&r);
  }
  if (status >= HAP_OK) {
    *out = r.model;
  }
  return status;
}

/* ---- writing ---- */

static void write_figure(FILE *file, const char *prefix, const figure *f, const double *values)
{
  fprintf(file, "%s%s =", prefix, f->key);
  for (int i = 0; i < f->count; ++i) {
    char number[32];
    hapi_number_write(number, sizeof number, values[i] * f->divisor);
    fprintf(file, " %s", number);
  }
  fprintf(file, f->about != NULL ? " # %s\n" : "\n", f->about);
}

static void write_lines(FILE *file, hapi_spidar_model *model)
{
  fprintf(file,
          "# hapode: geometry of a string device; x right, y up, z towards the user, origin at the "
          "grip at home\nversion = 1\nname = %s\nboard = %s\nstrings = %d\ndof = %d\n\n",
          model->name, model->board == HAPI_SPIDAR_UART ? "uart" : "usb", model->strings,
          model->dof);
  for (size_t i = 0; i < DEVICE_FIGURES; ++i) {
    write_figure(file, "", &device_figures[i], values_at(model, &device_figures[i], 0));
  }
  for (int s = 0; s < model->strings; ++s) {
    char prefix[32];
    snprintf(prefix, sizeof prefix, STRING_PREFIX "%d.", s);
    fprintf(file, "\n");
    for (size_t i = 0; i < STRING_FIGURES; ++i) {
      const figure *f = &string_figures[i];
      if (i != OFFSET_FIGURE || model->calibrated) {
        write_figure(file, prefix, f, values_at(model, f, s));
      }
    }
  }
}

/* Into a file of another name first: a full disk must not cost the old one. */
hap_status hapi_spidar_model_write(const char *path, const hapi_spidar_model *model,
                                   hap_detail *detail)
{
  char whole[4096];
  hapi_spidar_model copy = *model;
  hap_status status = hapi_spidar_model_check(model, detail);
  if (status < HAP_OK) {
    return status;
  }
  if (snprintf(whole, sizeof whole, "%s.new", path) >= (int)sizeof whole) {
    return hapi_fail(detail, HAP_ERROR_IO, "%.200s...: the path is too long", path);
  }
  const char *why;
  FILE *file = hapi_regular_create_stream(whole, O_TRUNC, &why);
  if (file == NULL) {
    return hapi_fail(detail, HAP_ERROR_IO, "%.200s: cannot be opened: %s", whole, why);
  }
  write_lines(file, &copy);
  bool good = ferror(file) == 0;
  good = fclose(file) == 0 && good;
  if (good && rename(whole, path) == 0) {
    return HAP_OK;
  }
  status = hapi_fail(detail, HAP_ERROR_IO, "%.200s: cannot be written: %s", path, strerror(errno));
  (void)remove(whole);
  return status;
}
