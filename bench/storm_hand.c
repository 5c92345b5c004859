/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "bench/storm_hand.h"

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include <hapode/device_impl.h>

#include "base/alloc.h"
#include "base/vec.h"
#include "device/device.h"

typedef struct storm_hand {
  double center[3];
  double radius;
  double hz;
  bool running;
  double force[3]; /* N, held */
  storm_book book;
} storm_hand;

static hap_status open_hand(const char *args, void **self, hap_detail *detail)
{
  storm_hand *hand = hapi_alloc(sizeof *hand);
  (void)detail;
  if (hand == NULL) {
    return HAP_ERROR_MEMORY;
  }
  if (sscanf(args, "%lf/%lf/%lf/%lf/%lf", &hand->center[0], &hand->center[1], &hand->center[2],
             &hand->radius, &hand->hz) != 5) {
    hapi_free(hand);
    return HAP_ERROR_FORMAT;
  }
  atomic_init(&hand->book.holds, false);
  *self = hand;
  return HAP_OK;
}

static void describe(void *self, hap_device_info *out)
{
  (void)self;
  out->dof = 3;
  out->max_force = STORM_FORCE;
  out->max_torque = 1.0;
}

static void hold(storm_hand *hand, const double force[3])
{
  hapi_v3_copy(force, hand->force);
  atomic_store(&hand->book.holds, hapi_v3_norm(force) > 0.0);
}

static hap_status start(void *self)
{
  storm_hand *hand = self;
  hand->running = true;
  return HAP_OK;
}

static hap_status read_hand(void *self, int64_t time_ns, hap_pose *pose, hap_twist *twist,
                            uint32_t *buttons)
{
  const storm_hand *hand = self;
  double rate = 6.283185307179586 * hand->hz;
  double angle = rate * 1e-9 * (double)time_ns;
  double way[3] = {cos(angle), sin(angle), 0.5 * sin(angle)};
  double speed[3] = {-sin(angle), cos(angle), 0.5 * cos(angle)};
  *pose = (hap_pose){{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
  hapi_v3_madd(hand->center, hand->radius, way, pose->position);
  hapi_v3_scale(hand->radius * rate, speed, twist->linear);
  *buttons = 0;
  return HAP_OK;
}

static hap_status write_hand(void *self, const hap_wrench *wanted, hap_wrench *reached)
{
  storm_hand *hand = self;
  storm_book *book = &hand->book;
  double change[3];
  hapi_v3_sub(wanted->force, hand->force, change);
  double force = hapi_v3_norm(wanted->force);
  double step = hapi_v3_norm(change);
  bool good = hand->running && force <= STORM_FORCE * (1.0 + 1e-9) &&
              step <= STORM_SLEW * (1.0 + 1e-9); /* not for NaN */
  book->bad += !good;
  book->peak = fmax(book->peak, force);
  book->steepest = fmax(book->steepest, step);
  ++book->writes;
  hold(hand, wanted->force);
  *reached = *wanted;
  return HAP_OK;
}

static void zero(void *self)
{
  static const double none[3] = {0.0, 0.0, 0.0};
  hold(self, none);
}

static void stop(void *self)
{
  storm_hand *hand = self;
  hand->book.stops_with_force += atomic_load(&hand->book.holds);
  hand->running = false;
}

static void close_hand(void *self)
{
  hapi_free(self);
}

static const hap_device_ops ops = {
    .abi = HAP_DEVICE_ABI,
    .size = sizeof(hap_device_ops),
    .name = "storm",
    .help = "a circle, for measurements",
    .pacing = HAP_PACING_VIRTUAL,
    .open = open_hand,
    .describe = describe,
    .start = start,
    .read = read_hand,
    .write = write_hand,
    .zero = zero,
    .stop = stop,
    .close = close_hand,
};

hap_status storm_hand_open(const double center[3], double radius, double hz, hap_device **out,
                           hap_detail *detail)
{
  char args[200];
  snprintf(args, sizeof args, "%.17g/%.17g/%.17g/%.17g/%.17g", center[0], center[1], center[2],
           radius, hz);
  return hapi_device_open_ops(&ops, args, out, detail);
}

const storm_book *storm_hand_book(hap_device *device)
{
  const storm_hand *hand = hapi_device_self(device);
  return &hand->book;
}
