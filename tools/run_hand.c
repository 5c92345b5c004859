/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/run_hand.h"

#include <math.h>
#include <string.h>

#include "device/device.h"
#include "plugins/virtual/virtual.h"

#define CALM_S 0.012  /* the mouse says its place some 60 times a second: steps become a way */
#define SPEED_MAX 1.5 /* m/s, of a target: no hand is faster */
#define STEP_MAX_S 0.02

static void hand_begin(run_hand *h, const hap_device_input *at)
{
  hapi_hand_def def;
  const bool simulated = strcmp(hapi_device_ops(h->inner)->name, "virtual") == 0;
  hapi_virtual_get_hand(simulated ? hapi_device_self(h->inner) : NULL, &def);
  hapi_hand_init(&h->hand, &def);
  hapi_hand_place(&h->hand, at->pose.position, at->twist.linear);
  for (int i = 0; i < 3; ++i) {
    h->target.position[1][i] = at->pose.position[i];
    h->target.velocity[1][i] = at->twist.linear[i];
  }
}

/* The way of the target in a step: towards where it is wanted, no faster than a hand. */
static void target_move(run_hand *h, const double wanted[3], double step_s)
{
  double way[3];
  double length = 0.0;
  memcpy(h->target.position[0], h->target.position[1], sizeof h->target.position[0]);
  memcpy(h->target.velocity[0], h->target.velocity[1], sizeof h->target.velocity[0]);
  for (int i = 0; i < 3; ++i) {
    way[i] = (wanted[i] - h->target.position[0][i]) * step_s / (CALM_S + step_s);
    length += way[i] * way[i];
  }
  length = sqrt(length);
  const double share = length > SPEED_MAX * step_s ? SPEED_MAX * step_s / length : 1.0;
  for (int i = 0; i < 3; ++i) {
    h->target.position[1][i] = h->target.position[0][i] + share * way[i];
    h->target.velocity[1][i] = share * way[i] / step_s;
  }
}

static void hand_move(run_hand *h, const hap_device_input *inner, int64_t time_ns)
{
  const double step_s = fmin(1e-9 * (double)(time_ns - h->time_ns), STEP_MAX_S);
  if (!(step_s > 0.0)) {
    return;
  }
  target_move(h, h->wish.way == RUN_HAND_HOME ? inner->pose.position : h->wish.target, step_s);
  for (int i = 0; i < 3; ++i) {
    double push[2];
    hapi_hand_push(&h->hand, i, &h->target, h->force[i], push);
    hapi_hand_step_axis(&h->hand, i, step_s, push);
  }
}

static hap_status hand_read(void *self, int64_t time_ns, hap_device_input *const out[])
{
  run_hand *h = self;
  hap_status status = hap_device_read(h->inner, time_ns, out);
  if (status < HAP_OK) {
    return status;
  }
  if (hapi_triple_take(&h->buffer)) {
    const run_hand_way before = h->wish.way;
    h->wish = h->wishes[hapi_triple_front(&h->buffer)];
    if (before == RUN_HAND_SCRIPT && h->wish.way != RUN_HAND_SCRIPT) {
      hand_begin(h, out[0]);
      h->time_ns = time_ns;
    }
  }
  if (h->wish.way != RUN_HAND_SCRIPT) {
    hand_move(h, out[0], time_ns);
    memcpy(out[0]->pose.position, h->hand.position, sizeof h->hand.position);
    memcpy(out[0]->twist.linear, h->hand.velocity, sizeof h->hand.velocity);
  }
  h->time_ns = time_ns;
  return status;
}

static hap_status hand_write(void *self, const hap_device_output *const wanted[],
                             hap_device_output *const reached[])
{
  run_hand *h = self;
  hap_status status = hap_device_write(h->inner, wanted, reached);
  for (int i = 0; i < 3; ++i) {
    h->force[i] = status >= HAP_OK ? reached[0]->wrench.force[i] : 0.0;
  }
  return status;
}

static const hap_device_ops hand_ops = {.abi = HAP_DEVICE_ABI,
                                        .size = sizeof(hap_device_ops),
                                        .name = "hand",
                                        .help = "a simulated hand that the mouse pulls",
                                        .read = hand_read,
                                        .write = hand_write};

hap_status run_hand_open(run_hand *io, hap_device *inner, hap_device **out, hap_detail *detail)
{
  memset(io, 0, sizeof *io);
  io->inner = inner;
  hapi_triple_init(&io->buffer);
  return hap_device_wrap(inner, &hand_ops, io, out, detail);
}

void run_hand_pull(run_hand *io, run_hand_way way, const double target[3])
{
  run_hand_wish *wish = &io->wishes[hapi_triple_back(&io->buffer)];
  wish->way = way;
  memcpy(wish->target, target, sizeof wish->target);
  hapi_triple_publish(&io->buffer);
}
