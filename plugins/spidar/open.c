/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <stdio.h>
#include <string.h>

#include "base/log.h"
#include "base/safety.h"
#include "base/vec.h"
#include "plugins/common/arguments.h"
#include "plugins/spidar/spidar.h"

#define TIMEOUT 0.02 /* s */
#define PORTS_MAX 16 /* that are looked at */

enum argument {
  MODEL,
  OFFSET,
  ROTATE,
  TIMEOUT_ARGUMENT,
  STALL_ARGUMENT,
  MAX_FORCE,
  MAX_TORQUE,
  ARGUMENT_COUNT
};

static const hapi_argument known_arguments[ARGUMENT_COUNT] = {
    [MODEL] = {"model", HAPI_ARGUMENT_TEXT,
               .expected = "x4r, x4l, x5r, x5l, t1 or a geometry file"},
    [OFFSET] = {"offset", HAPI_ARGUMENT_VECTOR, false, -1e3, 1e3, "x/y/z in m, each within 1000"},
    /* x to the right, y away from the user, z up */
    [ROTATE] = {"rotate", HAPI_ARGUMENT_QUATERNION, .expected = "w/x/y/z, not all zero",
                .number = {0.70710678118654752, 0.70710678118654752}},
    [TIMEOUT_ARGUMENT] = {"timeout", HAPI_ARGUMENT_NUMBER, false, 2e-3, 10.0,
                          "seconds from 0.002 to 10", .number = {TIMEOUT}},
    [STALL_ARGUMENT] = {"stall", HAPI_ARGUMENT_NUMBER, false, 0.0, 60.0,
                        "seconds from 0.05 to 60, or 0: no guard",
                        .number = {HAPI_SAFETY_GUARD_STALL_S}},
    [MAX_FORCE] = {"max_force", HAPI_ARGUMENT_NUMBER, false, 1e-3, 1e3, "N from 0.001 to 1000"},
    [MAX_TORQUE] = {"max_torque", HAPI_ARGUMENT_NUMBER, false, 1e-6, 1e3, "N m from 1e-6 to 1000"},
};

/* ---- the model ---- */

static hap_status read_model(const char *name, size_t length, hapi_spidar_model *out,
                             hap_detail *detail)
{
  char text[HAPI_SPIDAR_PATH_MAX];
  if (length >= sizeof text) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "spidar: model: the path is too long");
  }
  memcpy(text, name, length);
  text[length] = '\0';
  const hapi_spidar_model *known = hapi_spidar_model_find(text);
  if (known != NULL) {
    *out = *known;
    return HAP_OK;
  }
  if (strchr(text, '/') == NULL && strchr(text, '.') == NULL) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "spidar: there is no model '%.60s'; there are x4r, x4l, x5r, x5l, t1, and "
                     "geometry files, whose names have a '/' or a '.'",
                     text);
  }
  return hapi_spidar_model_read(text, out, detail);
}

static int motors_of(const hapi_spidar_boards *boards)
{
  int motors = 0;
  for (int i = 0; i < boards->count; ++i) {
    motors += hapi_spidar_kind_find(boards->model[i])->motors;
  }
  return motors;
}

/* "B3M 0, B3M 1" */
static void name_boards(const hapi_spidar_boards *boards, char *out, size_t size)
{
  size_t used = 0;
  out[0] = '\0';
  for (int i = 0; i < boards->count && used < size; ++i) {
    used += (size_t)snprintf(out + used, size - used, "%s%s %d", i > 0 ? ", " : "",
                             hapi_spidar_kind_find(boards->model[i])->name, boards->id[i]);
  }
}

static bool boards_are(const hapi_spidar_boards *boards, int count, const char *name)
{
  bool all = boards->count == count;
  for (int i = 0; i < boards->count; ++i) {
    all = all && strcmp(hapi_spidar_kind_find(boards->model[i])->name, name) == 0;
  }
  return all;
}

static hap_status choose_model(hapi_spidar_device *device, const hapi_argument *given,
                               hap_detail *detail)
{
  const hapi_spidar_boards *boards = &device->boards;
  char names[80];
  name_boards(boards, names, sizeof names);
  if (!given->given) {
    bool x4 = boards_are(boards, 2, "B3M");
    if (!x4 && !boards_are(boards, 1, "B5M")) {
      return hapi_fail(detail, HAP_ERROR_DEVICE,
                       "spidar: %.100s has boards %s, which are neither two B3M (x4r) nor one B5M "
                       "(x5r): say model=",
                       device->serial.path, names);
    }
    device->model = *hapi_spidar_model_find(x4 ? "x4r" : "x5r");
  }
  if (motors_of(boards) != device->model.strings) {
    return hapi_fail(detail, HAP_ERROR_DEVICE,
                     "spidar: %.100s has boards %s with %d motors, model %s has %d strings",
                     device->serial.path, names, motors_of(boards), device->model.name,
                     device->model.strings);
  }
  device->model_calibrated = device->model.calibrated;
  return HAP_OK;
}

/* ---- the port ---- */

static hap_status find_boards(hapi_spidar_device *device, const char *path, hap_detail *detail)
{
  hap_detail why = {""};
  hapi_spidar_port port;
  hap_status status = hapi_spidar_serial_open(&device->serial, path, &why);
  if (status < HAP_OK) {
    return hapi_fail(detail, status, "spidar: %.480s", why.text);
  }
  hapi_spidar_serial_port(&device->serial, &port);
  status = hapi_spidar_line_find(&port, &device->boards, &why);
  if (status < HAP_OK) {
    hapi_spidar_serial_shut(&device->serial);
    return hapi_fail(detail, status, "spidar: %.200s: %.200s", path, why.text);
  }
  hapi_spidar_identity_at(HAPI_SPIDAR_SYSFS, path, &device->serial.identity);
  return HAP_OK;
}

/* The first port that boards answer on. */
static hap_status find_port(hapi_spidar_device *device, hap_detail *detail)
{
  char path[HAPI_SPIDAR_PATH_MAX];
  char tried[300] = "";
  size_t used = 0;
  for (int i = 0; i < PORTS_MAX && hapi_spidar_port_at(i, path); ++i) {
    hap_detail why = {""};
    if (find_boards(device, path, &why) >= HAP_OK) {
      return HAP_OK;
    }
    if (used < sizeof tried) {
      const char *text = strncmp(why.text, "spidar: ", 8) == 0 ? why.text + 8 : why.text;
      used += (size_t)snprintf(tried + used, sizeof tried - used, "%s%s", i > 0 ? "; " : "", text);
    }
  }
  if (tried[0] == '\0') {
    return hapi_fail(detail, HAP_ERROR_DEVICE,
                     "spidar: there is no serial port of a USB adapter: is it plugged in? Another "
                     "port is given as spidar:PORT");
  }
  return hapi_fail(detail, HAP_ERROR_DEVICE, "spidar: on no port: %s", tried);
}

static hap_status open_port(hapi_spidar_device *device, const char *name, size_t length,
                            hap_detail *detail)
{
  char path[HAPI_SPIDAR_PATH_MAX];
  if (length == 0) {
    return find_port(device, detail);
  }
  if (length >= sizeof path) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "spidar: the name of the port is too long");
  }
  memcpy(path, name, length);
  path[length] = '\0';
  return find_boards(device, path, detail);
}

/* ---- all of it ---- */

static void set_limits(hapi_spidar_device *device, const hapi_argument *entries)
{
  hapi_spidar_capability(&device->model, &device->settings.max_force, &device->settings.max_torque);
  if (entries[MAX_FORCE].given) {
    device->settings.max_force = fmin(device->settings.max_force, entries[MAX_FORCE].number[0]);
  }
  if (entries[MAX_TORQUE].given) {
    device->settings.max_torque = fmin(device->settings.max_torque, entries[MAX_TORQUE].number[0]);
  }
}

/* Zeros before the commands end one that was cut in the middle of its currents: else the next
 * header would be taken for a current, and a great one. */
static void prepare_zeros(hapi_spidar_device *device)
{
  const int16_t none[HAPI_SPIDAR_CYCLE_MOTORS] = {0};
  hapi_spidar_cycle cycle;
  hapi_spidar_cycle_init(&cycle, &device->boards);
  device->zero_count = HAPI_SPIDAR_ZEROS_BEFORE;
  device->zero_count +=
      hapi_spidar_cycle_commands(&cycle, none, device->zeros + HAPI_SPIDAR_ZEROS_BEFORE);
}

static hap_status read_arguments(hapi_spidar_device *device, hapi_argument *entries,
                                 const char *text, hap_detail *detail)
{
  const hapi_argument_table table = {"spidar", entries, ARGUMENT_COUNT};
  hap_status status = hapi_arguments_read(&table, text, detail);
  if (status < HAP_OK) {
    return status;
  }
  device->settings.timeout = entries[TIMEOUT_ARGUMENT].number[0];
  device->settings.stall = entries[STALL_ARGUMENT].number[0];
  if (device->settings.stall > 0.0 && device->settings.stall < 0.05) {
    return hapi_arguments_fail(&table, &entries[STALL_ARGUMENT], detail);
  }
  hapi_v3_copy(entries[OFFSET].number, device->settings.offset);
  memcpy(device->settings.rotate, entries[ROTATE].number, sizeof device->settings.rotate);
  const hapi_argument *model = &entries[MODEL];
  return model->given ? read_model(model->text, model->length, &device->model, detail) : HAP_OK;
}

/* PORT is what is there before the first comma when it has no '='. */
static hap_status arguments_split(const char *args, size_t *port, const char **rest,
                                  hap_detail *detail)
{
  size_t length = strcspn(args, ",");
  *port = memchr(args, '=', length) == NULL ? length : 0;
  *rest = args + *port;
  if (*port == 0) {
    return HAP_OK;
  }
  *rest += args[length] == ',';
  if (args[length] == ',' && **rest == '\0') {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "spidar: nothing follows the last comma");
  }
  return HAP_OK;
}

hap_status hapi_spidar_configure(hapi_spidar_device *device, const char *args, hap_detail *detail)
{
  hapi_argument entries[ARGUMENT_COUNT];
  const char *rest = "";
  size_t port = 0;
  memcpy(entries, known_arguments, sizeof entries);
  hap_status status = arguments_split(args, &port, &rest, detail);
  if (status >= HAP_OK) { /* before anything is sent to a port */
    status = read_arguments(device, entries, rest, detail);
  }
  if (status >= HAP_OK) {
    status = hapi_spidar_serial_init(&device->serial, detail);
  }
  if (status >= HAP_OK) {
    status = open_port(device, args, port, detail);
  }
  if (status >= HAP_OK) {
    status = choose_model(device, &entries[MODEL], detail);
  }
  if (status < HAP_OK) {
    return status;
  }
  if (!hapi_spidar_guard_init(&device->guard)) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "spidar: out of memory");
  }
  set_limits(device, entries);
  prepare_zeros(device);
  (void)hapi_spidar_serial_force(&device->serial, device->zeros, device->zero_count);
  return HAP_OK;
}

void hapi_spidar_forget_home(hapi_spidar_device *device)
{
  device->model.calibrated = false;
  device->model_calibrated = false;
}

void hapi_spidar_release(hapi_spidar_device *device)
{
  hapi_spidar_guard_finish(&device->guard);
  hapi_spidar_serial_finish(&device->serial);
}
