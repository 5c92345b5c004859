/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/run_identify.h"

#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "base/log.h"
#include "base/regular.h"
#include "device/device.h"
#include "tools/run_loop.h"

#define COUNTDOWN_S 5

/* What cannot be written must be known before the device has moved. */
static hap_status check_writable(const char *path, hap_detail *detail)
{
  struct stat before;
  bool made = stat(path, &before) != 0;
  const char *why;
  int file = hapi_regular_create(path, O_APPEND, &why);
  if (file < 0) {
    return hapi_fail(detail, HAP_ERROR_IO, "--identify %.300s: cannot be written: %s", path, why);
  }
  close(file);
  if (made) {
    (void)unlink(path);
  }
  return HAP_OK;
}

/* A simulated device has nobody who could be hurt or who could hold it. */
static hap_status person_warn(const hap_device *device)
{
  fputs(
      "hapode-run: the device is going to move by itself, along each axis, by up to 50 mm\n"
      "hapode-run: put its grip in the middle of its range, LET GO OF IT and keep clear\n"
      "hapode-run: Ctrl-C takes the force away at any time\n",
      stderr);
  bool simulated = hapi_device_ops(device)->pacing == HAP_PACING_VIRTUAL;
  for (int left = simulated ? 0 : COUNTDOWN_S; left > 0 && !run_loop_stop_wanted(); --left) {
    const struct timespec second = {1, 0};
    fprintf(stderr, "hapode-run: it moves in %d s\n", left);
    nanosleep(&second, NULL);
  }
  return run_loop_stop_wanted() ? HAP_END : HAP_OK;
}

static int progress_watch(void *user, double done)
{
  const bool *terminal = user;
  if (*terminal) {
    fprintf(stderr, "\rhapode-run: do not touch the device: %3.0f %% ", 100.0 * done);
  }
  return run_loop_stop_wanted();
}

static void identity_print(const hap_device_identity *identity, FILE *out)
{
  fprintf(out, "device: %s\n", identity->device);
  fprintf(out, "mass_kg: %.4g\n", identity->mass);
  fprintf(out, "damping_nspm: %.4g\n", identity->damping);
  fprintf(out, "friction_n: %.4g\n", identity->friction);
  fprintf(out, "delay_ms: %.4g\n", 1e3 * identity->delay);
  fprintf(out, "quantum_um: %.4g\n", 1e6 * identity->quantum);
  fprintf(out, "residual: %.3g\n", identity->residual);
}

static hap_status device_identify(const run_options *options, hap_device *device,
                                  hap_device_identity *found, hap_detail *detail)
{
  hap_identify_def def;
  bool terminal = isatty(STDERR_FILENO) != 0;
  hap_identify_def_init(&def, sizeof def);
  def.rate_hz = options->rig.def.haptic_hz;
  def.watch = progress_watch;
  def.user = &terminal;
  hap_status status = person_warn(device);
  if (status == HAP_OK) {
    status = hap_device_identify(device, &def, found, detail);
  }
  fputs(terminal ? "\n" : "", stderr);
  return status;
}

hap_status run_identify(const run_options *options, FILE *out, hap_detail *detail)
{
  hap_device *device = NULL;
  hap_device_identity found;
  hap_device_identity_init(&found, sizeof found);
  hap_status status = hap_device_open(options->rig.devices[0], &device, detail);
  if (status < HAP_OK) {
    return status;
  }
  status = check_writable(options->identify_path, detail);
  if (status == HAP_OK) {
    status = device_identify(options, device, &found, detail);
  }
  hap_device_close(device);
  if (status == HAP_OK) {
    status = hap_device_identity_write(options->identify_path, &found, detail);
  }
  if (status == HAP_OK) {
    identity_print(&found, out);
  } else if (status == HAP_END) {
    snprintf(detail->text, sizeof detail->text, "stopped: nothing was written");
  }
  return status;
}
