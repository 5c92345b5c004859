/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/spidar-emulator/driven.h"

#include <errno.h>
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/log.h"

#define AWAIT_STEP_S 50e-6

/* ---- the port ---- */

static int port_send(void *self, const uint8_t *bytes, int count)
{
  driven_spidar *d = self;
  if (!d->emulator.plugged) {
    return -EIO;
  }
  emulator_write(&d->emulator, bytes, count, d->now);
  return 0;
}

static int port_receive(void *self, uint8_t *bytes, int size)
{
  driven_spidar *d = self;
  emulator_advance(&d->emulator, d->now);
  int count = emulator_read(&d->emulator, d->now, bytes, size);
  return d->emulator.plugged ? count : -EIO;
}

static void port_await(void *self, double seconds)
{
  driven_spidar *d = self;
  double end = d->now + seconds;
  double next = -1.0;
  while (d->now < end && !(next >= 0.0 && next <= d->now)) {
    d->now += fmin(AWAIT_STEP_S, end - d->now);
    emulator_advance(&d->emulator, d->now);
    next = wire_next(&d->emulator.wire);
  }
}

static double port_now(void *self)
{
  const driven_spidar *d = self;
  return d->now;
}

static void port_flush(void *self)
{
  uint8_t bytes[WIRE_REPLIES_MAX];
  (void)port_receive(self, bytes, sizeof bytes);
}

/* ---- the device ---- */

static hap_status driven_open(void *context, const char *args, void **self, hap_detail *detail)
{
  (void)context;
  const hapi_spidar_model *model = hapi_spidar_model_find("x4r");
  const emulator_def def = {.model = model,
                            .board_count = 2,
                            .board_model = {5, 5}, /* B3M */
                            .board_id = {0, 1},
                            .hand = EMULATOR_HAND_PUSH,
                            .path = args[0] != '\0' ? args : NULL};
  driven_spidar *d = hapi_alloc(sizeof *d);
  if (d == NULL) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "spidar: out of memory");
  }
  hap_status status = emulator_init(&d->emulator, &def, detail);
  if (status >= HAP_OK && !hapi_spidar_guard_init(&d->device.guard)) {
    emulator_finish(&d->emulator);
    status = hapi_fail(detail, HAP_ERROR_MEMORY, "spidar: out of memory");
  }
  if (status < HAP_OK) {
    hapi_free(d);
    return status;
  }
  d->device.serial.fd = -1;
  d->device.boards = (hapi_spidar_boards){.count = 2, .id = {0, 1}, .model = {5, 5}};
  d->device.model = *model;
  d->device.settings = (hapi_spidar_settings){.timeout = 0.02, .rotate = {1.0, 0.0, 0.0, 0.0}};
  hapi_spidar_capability(model, &d->device.settings.max_force, &d->device.settings.max_torque);
  hapi_spidar_heat_init(&d->device.heat, 0.0);
  atomic_init(&d->device.zeroed, true);
  *self = d;
  return HAP_OK;
}

static void driven_describe(void *self, uint32_t effector, hap_device_info *out)
{
  driven_spidar *d = self;
  hapi_spidar_ops.describe(&d->device, effector, out);
}

static hap_status driven_start(void *self)
{
  driven_spidar *d = self;
  const hapi_spidar_port port = {d, port_send, port_receive, port_await, port_now, port_flush};
  d->begun = -1.0;
  atomic_store(&d->device.cause, HAPI_SPIDAR_WELL);
  atomic_store(&d->device.told.cause, HAPI_SPIDAR_WELL);
  return hapi_spidar_begin(&d->device, &port) == HAPI_SPIDAR_WELL ? HAP_OK : HAP_ERROR_DEVICE;
}

static hap_status driven_read(void *self, int64_t time_ns, hap_device_input *const out[])
{
  driven_spidar *d = self;
  double time = 1e-9 * (double)time_ns;
  d->begun = d->begun < 0.0 ? d->now - time : d->begun;
  d->now = d->begun + time;
  hap_status status = hapi_spidar_ops.read(&d->device, time_ns, out);
  if (d->spoil != NULL) { /* of what the boards answer to the command that follows */
    d->spoil(d, time, d->user);
  }
  return status;
}

static hap_status driven_write(void *self, const hap_device_output *const wanted[],
                               hap_device_output *const reached[])
{
  driven_spidar *d = self;
  return hapi_spidar_ops.write(&d->device, wanted, reached);
}

static void driven_zero(void *self)
{
  static const uint8_t flush[HAPI_SPIDAR_FRAME_MAX];
  const int16_t none[HAPI_SPIDAR_CYCLE_MOTORS] = {0};
  driven_spidar *d = self;
  hapi_spidar_ops.zero(&d->device);
  emulator_write(&d->emulator, flush, sizeof flush, d->now);
  if (d->device.line.cycle.motors > 0) {
    uint8_t bytes[HAPI_SPIDAR_COMMANDS_MAX];
    int count = hapi_spidar_cycle_commands(&d->device.line.cycle, none, bytes);
    emulator_write(&d->emulator, bytes, count, d->now);
  }
}

static void driven_stop(void *self)
{
  driven_spidar *d = self;
  driven_zero(self);
  d->device.running = false;
}

static void driven_close(void *self)
{
  driven_spidar *d = self;
  hapi_spidar_guard_finish(&d->device.guard);
  emulator_finish(&d->emulator);
  hapi_free(d);
}

static void driven_held(void *self, hap_device_output *const out[])
{
  driven_spidar *d = self;
  hapi_spidar_ops.held(&d->device, out);
}

static void driven_explain(void *self, hap_detail *out)
{
  driven_spidar *d = self;
  hapi_spidar_ops.explain(&d->device, out);
}

const hap_device_ops driven_spidar_ops = {
    .abi = HAP_DEVICE_ABI,
    .size = sizeof(hap_device_ops),
    .name = "spidar",
    .help = "a SPIDAR that is emulated, in the session's time",
    .pacing = HAP_PACING_VIRTUAL,
    .open = driven_open,
    .describe = driven_describe,
    .start = driven_start,
    .read = driven_read,
    .write = driven_write,
    .zero = driven_zero,
    .stop = driven_stop,
    .close = driven_close,
    .held = driven_held,
    .explain = driven_explain,
};
