/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tick/report.h"

#include <string.h>

#include "base/vec.h"

static void trace_bodies(const hapi_tick_watch *watch, const hapi_bodies *bodies,
                         hap_trace_row *out)
{
  out->body_count = watch->count;
  for (uint32_t i = 0; i < watch->count; ++i) {
    uint32_t slot = watch->slot[i];
    const double *at = slot == HAPI_SLOT_NONE ? watch->position[i] : bodies->of[slot].pose.position;
    hapi_v3_copy(at, out->body_position[i]);
  }
}

void hapi_tick_trace(const hapi_tick *tick, hap_trace_row *out)
{
  out->tick = tick->facts.tick - 1; /* the one that has just been run */
  out->model_age_s = 1e-9 * (double)(tick->facts.now_ns - tick->facts.state_ns);
  out->bodies = tick->bodies.live_count;
  out->contacts = tick->touches.pushing;
  out->pointer_count = 0;
  for (uint32_t i = 0; i < tick->capacity.pointers && i < HAP_TRACE_POINTERS_MAX; ++i) {
    const hapi_pointer *p = &tick->pointers.of[i];
    out->pointer_count = p->generation != 0 ? i + 1 : out->pointer_count;
    hapi_v3_copy(p->pose.position, out->pointers[i].position);
    hapi_v3_copy(p->wrench.force, out->pointers[i].force);
    hapi_v3_copy(p->wrench.torque, out->pointers[i].torque);
  }
  trace_bodies(&tick->watch, &tick->bodies, out);
}

/* FNV-1a over 64-bit words: cheap, and any changed bit changes it. */
static uint64_t hash_doubles(uint64_t hash, const double *values, int count)
{
  for (int i = 0; i < count; ++i) {
    uint64_t word;
    memcpy(&word, &values[i], sizeof word);
    hash = (hash ^ word) * 0x100000001b3u;
    hash ^= hash >> 29;
  }
  return hash;
}

uint64_t hapi_tick_hash(const hapi_tick *tick, uint64_t hash)
{
  for (uint32_t i = 0; i < tick->pointers.high; ++i) {
    const hapi_pointer *p = &tick->pointers.of[i];
    if (p->generation != 0) {
      hash = hash_doubles(hash, p->pose.position, 3);
      hash = hash_doubles(hash, p->device.wrench.force, 3);
      hash = hash_doubles(hash, p->device.wrench.torque, 3);
    }
  }
  for (uint32_t i = 0; i < tick->bodies.live_count; ++i) {
    const hapi_local_body *body = &tick->bodies.of[tick->bodies.live[i]];
    hash = hash_doubles(hash, body->pose.position, 3);
    hash = hash_doubles(hash, body->pose.quat_wxyz, 4);
    hash = hash_doubles(hash, body->twist.linear, 3);
    hash = hash_doubles(hash, body->twist.angular, 3);
  }
  return hash;
}
