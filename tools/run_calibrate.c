/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/run_calibrate.h"

#include <string.h>

#include "device/device.h"
#include "plugins/spidar/spidar.h"
#include "tools/run_loop.h"

static hap_status wait_for_enter(void)
{
  char line[16];
  fputs(
      "hapode-run: hold the grip at home: at its marked place, not turned\n"
      "hapode-run: the motors are going to pull its strings taut with little force\n"
      "hapode-run: press Enter, and hold it still until this program is done\n",
      stderr);
  bool told = fgets(line, sizeof line, stdin) != NULL && !run_loop_stop_wanted();
  return told ? HAP_OK : HAP_END;
}

static void print(const hapi_spidar_model *model, const char *path, FILE *out)
{
  fprintf(out, "model: %s\noffsets_m:", model->name);
  for (int i = 0; i < model->strings; ++i) {
    fprintf(out, " %.5f", model->offset[i]);
  }
  fprintf(out, "\nuse: --device spidar:PORT,model=%s until the boards are switched off\n", path);
}

static hap_status calibrate(const run_options *options, hap_device *device, FILE *out,
                            hap_detail *detail)
{
  const hap_device_ops *ops = hapi_device_ops(device);
  hapi_spidar_device *spidar = hapi_device_self(device);
  hap_status status = wait_for_enter();
  if (status != HAP_OK) {
    return status;
  }
  hapi_spidar_forget_home(spidar);
  status = ops->start(spidar);
  ops->stop(spidar);
  if (status < HAP_OK) {
    hapi_device_explain(ops, spidar, detail);
    return status;
  }
  status = hapi_spidar_model_write(options->calibrate_path, &spidar->model, detail);
  if (status >= HAP_OK) {
    print(&spidar->model, options->calibrate_path, out);
  }
  return status;
}

hap_status run_calibrate(const run_options *options, FILE *out, hap_detail *detail)
{
  hap_device *device = NULL;
  hap_status status = hap_device_open(options->rig.devices[0], &device, detail);
  if (status < HAP_OK) {
    return status;
  }
  if (hapi_device_ops(device) == &hapi_spidar_ops) {
    status = calibrate(options, device, out, detail);
  } else {
    (void)snprintf(detail->text, sizeof detail->text,
                   "--calibrate: the device %.60s has no home to be told; spidar has",
                   hapi_device_ops(device)->name);
    status = HAP_ERROR_ARGUMENT;
  }
  hap_device_close(device);
  return status;
}
