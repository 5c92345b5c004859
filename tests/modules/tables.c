/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A module whose table is wrong as the environment's HAPODE_TEST_TABLE says; right without it. It
 * counts, for the tests of loading. */

#define _POSIX_C_SOURCE 200809L

#include <hapode/device_impl.h>

#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

/* Of this load of the module: begins at 0 when its code is gone and comes again. */
HAP_API atomic_int tables_opened;
HAP_API atomic_int tables_zeroed;

static const char *wrong;

static bool variant_is(const char *name)
{
  return wrong != NULL && strcmp(wrong, name) == 0;
}

static hap_status tables_open(void *context, const char *args, void **self, hap_detail *detail)
{
  (void)context;
  if (variant_is("open_fails") || strcmp(args, "fail") == 0) {
    snprintf(detail->text, sizeof detail->text, "no board on port 7: is it switched on?");
    return HAP_ERROR_DEVICE;
  }
  if (variant_is("open_fails_silently")) {
    return (hap_status)-77;
  }
  if (!variant_is("no_self")) {
    *self = malloc(16);
  }
  atomic_fetch_add(&tables_opened, 1);
  return HAP_OK;
}

static void tables_describe(void *self, uint32_t effector, hap_device_info *out)
{
  (void)effector;
  (void)self;
  out->dof = variant_is("dof_4") ? 4 : 3;
  out->max_force = variant_is("limit_is_negative") ? -1.0 : 5.0;
  out->damping = variant_is("damping_is_subnormal") ? 1e-310 : 0.0;
}

static hap_status tables_start(void *self)
{
  (void)self;
  return HAP_OK;
}

static hap_status tables_read(void *self, int64_t time_ns, hap_device_input *const out[])
{
  hap_device_input *in = out[0];
  (void)self;
  (void)time_ns;
  in->pose = (hap_pose){{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
  memset(&in->twist, 0, sizeof in->twist);
  in->buttons = 0;
  return HAP_OK;
}

static hap_status tables_write(void *self, const hap_device_output *const wanted[],
                               hap_device_output *const reached[])
{
  (void)self;
  reached[0]->wrench = wanted[0]->wrench;
  return HAP_OK;
}

static void tables_zero(void *self)
{
  const struct timespec while_it_is_here = {0, 20000000};
  (void)self;
  if (variant_is("zero_is_slow")) {
    nanosleep(&while_it_is_here, NULL);
  }
  atomic_fetch_add(&tables_zeroed, 1); /* last, so that it comes back to this code from the sleep */
}

static void tables_stop(void *self)
{
  (void)self;
}

static void tables_close(void *self)
{
  atomic_fetch_sub(&tables_opened, 1);
  free(self);
}

static hap_device_ops ops;

static void fill_in(void)
{
  static char long_name[2000];
  const hap_device_ops right = {HAP_DEVICE_ABI,     sizeof ops,   "tables",        "for tests",
                                HAP_PACING_VIRTUAL, tables_open,  tables_describe, tables_start,
                                tables_read,        tables_write, tables_zero,     tables_stop,
                                tables_close,       NULL};
  memset(long_name, 'n', sizeof long_name - 1);
  ops = right;
  ops.abi += variant_is("abi_is_new") ? 1 : variant_is("abi_is_old") ? UINT32_MAX : 0;
  ops.size = variant_is("size_is_small") ? 40 : ops.size;
  ops.pacing = variant_is("pacing_is_unknown") ? 9 : ops.pacing;
  ops.name = variant_is("no_name")        ? NULL
             : variant_is("name_is_bad")  ? "My Device"
             : variant_is("name_is_long") ? long_name
                                          : ops.name;
  ops.read = variant_is("no_read") ? NULL : ops.read;
  ops.zero = variant_is("no_zero") || variant_is("name_is_long") ? NULL : ops.zero;
}

/* Once: the environment is that of this load. */
const hap_device_ops *hapode_device_module(uint32_t host_abi)
{
  static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
  pthread_mutex_lock(&lock);
  if (ops.size == 0) {
    wrong = getenv("HAPODE_TEST_TABLE");
    fill_in();
  }
  pthread_mutex_unlock(&lock);
  return variant_is("refuses") || host_abi != HAP_DEVICE_ABI ? NULL : &ops;
}
