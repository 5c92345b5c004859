/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A device that hangs for ever once it holds a force: "call=read", "call=write" or "call=zero"; any
 * other name: it works. It moves along x at 0.1 m/s. With ",file=PATH" it writes a letter for what
 * happens: f it holds a force, h it hangs, z zero. */

#define _POSIX_C_SOURCE 200809L

#include <hapode/device_impl.h>

#include <fcntl.h>
#include <math.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#define SPEED 0.1 /* m/s */
#define REACH 0.3 /* m */

typedef struct hangs {
  char call[16];
  int file;
  int64_t start_ns;
  atomic_bool holds;
  atomic_bool hanging;
} hangs;

static void letter_write(const hangs *d, char letter)
{
  if (d->file >= 0) {
    (void)!write(d->file, &letter, 1);
  }
}

static void hang_in(hangs *d, const char *call)
{
  const struct timespec long_time = {0, 100000000};
  if (!atomic_load(&d->holds) || strcmp(d->call, call) != 0) {
    return;
  }
  atomic_store(&d->hanging, true);
  letter_write(d, 'h');
  for (;;) {
    nanosleep(&long_time, NULL);
  }
}

static hap_status hangs_open(void *context, const char *args, void **self, hap_detail *detail)
{
  (void)context;
  hangs *d = calloc(1, sizeof *d);
  char path[256] = "";
  if (d == NULL || sscanf(args, "call=%15[a-z],file=%255s", d->call, path) < 1) {
    snprintf(detail->text, sizeof detail->text, "call= is missing");
    free(d);
    return HAP_ERROR_ARGUMENT;
  }
  d->file = path[0] != '\0' ? open(path, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600) : -1;
  *self = d;
  return HAP_OK;
}

static void hangs_describe(void *self, uint32_t effector, hap_device_info *out)
{
  (void)effector;
  (void)self;
  out->dof = 3;
  out->max_force = 5.0;
}

static hap_status hangs_start(void *self)
{
  (void)self;
  return HAP_OK;
}

static hap_status hangs_read(void *self, int64_t time_ns, hap_device_input *const out[])
{
  hap_device_input *in = out[0];
  hangs *d = self;
  hang_in(d, "read");
  d->start_ns = d->start_ns != 0 ? d->start_ns : time_ns;
  double x = fmin(SPEED * 1e-9 * (double)(time_ns - d->start_ns), REACH);
  in->pose = (hap_pose){{x, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
  memset(&in->twist, 0, sizeof in->twist);
  in->buttons = 0;
  return HAP_OK;
}

static hap_status hangs_write(void *self, const hap_device_output *const wanted[],
                              hap_device_output *const reached[])
{
  hangs *d = self;
  hang_in(d, "write");
  bool force = wanted[0]->wrench.force[0] != 0.0 || wanted[0]->wrench.force[1] != 0.0 ||
               wanted[0]->wrench.force[2] != 0.0;
  if (force && !atomic_load(&d->holds)) {
    letter_write(d, 'f');
  }
  atomic_store(&d->holds, force);
  reached[0]->wrench = wanted[0]->wrench;
  return HAP_OK;
}

static void hangs_zero(void *self)
{
  hangs *d = self;
  hang_in(d, "zero");
  if (atomic_load(&d->holds) || !atomic_load(&d->hanging)) {
    letter_write(d, 'z');
  }
  atomic_store(&d->holds, false);
}

static void hangs_stop(void *self)
{
  hangs_zero(self);
}

static void hangs_close(void *self)
{
  hangs *d = self;
  if (d->file >= 0) {
    close(d->file);
  }
  free(d);
}

static const hap_device_ops ops = {
    .abi = HAP_DEVICE_ABI,
    .size = sizeof(hap_device_ops),
    .name = "hangs",
    .help = "for tests",
    .pacing = HAP_PACING_HOST,
    .open = hangs_open,
    .describe = hangs_describe,
    .start = hangs_start,
    .read = hangs_read,
    .write = hangs_write,
    .zero = hangs_zero,
    .stop = hangs_stop,
    .close = hangs_close,
};

const hap_device_ops *hapode_device_module(uint32_t host_abi)
{
  return host_abi == HAP_DEVICE_ABI ? &ops : NULL;
}
