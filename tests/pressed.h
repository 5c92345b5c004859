/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_PRESSED_H
#define HAPODE_TESTS_PRESSED_H

/* A session in real time, whose one hand presses against a wall: its device has to stand at
 * PRESSED_X. Include after tap.h. */

#include <hapode/hapode.h>
#include <hapode/ode.h>

#include "base/vec.h"
#include "tests/stage.h"

#define PRESSED_X (-0.008) /* m: 2 mm deep, of a ball of 10 mm before a face at 0 */

typedef struct pressed {
  dWorldID world;
  dSpaceID space;
  hap_session *session;
  hap_device *device;
  hap_pointer_id hand;
} pressed;

static inline void pressed_end(void *owned)
{
  pressed *p = owned;
  ode_world_end(p->session, p->world, p->space);
  p->world = NULL;
  hap_device_close(p->device);
  p->device = NULL;
}

/* Started; it goes when the test has ended. */
static inline pressed *pressed_new(const char *spec)
{
  hap_session_def def;
  hap_ode_def ode;
  hap_pointer_def hand;
  hap_detail detail = {""};
  pressed *p = tap_own(sizeof *p, pressed_end);
  ode_world_make(0.0, &p->world, &p->space);
  dGeomSetPosition(dCreateBox(p->space, 1.0, 1.0, 1.0), 0.5, 0.0, 0.0);
  hap_session_def_init(&def, sizeof def);
  hap_ode_def_init(&ode, sizeof ode);
  hap_pointer_def_init(&hand, sizeof hand);
  def.rt_priority = 0;
  ode.world = p->world;
  ode.space = p->space;
  p->session = session_make(&def, &ode);
  REQUIRE_SAY(hap_device_open(spec, &p->device, &detail) == HAP_OK, "%s: %s", spec, detail.text);
  hand.device = p->device;
  REQUIRE(hap_pointer_add(p->session, &hand, &p->hand) == HAP_OK);
  session_run(p->session);
  return p;
}

static inline uint32_t pressed_fault(const pressed *p)
{
  return session_stats(p->session).faults.fault;
}

/* What the session says, and the device in it. */
static inline bool pressed_says(const pressed *p, const char *part)
{
  hap_detail detail = {""};
  CHECK(hap_session_detail(p->session, &detail) == HAP_OK);
  return text_has(detail.text, part);
}

/* The row of the guard's table for poses that stay false, by the black box and so in times of the
 * loop: from the first doubt on all of the force for 4 ms, none after 18 ms, latched. False: ticks
 * were late, and the guard took force off for that, too. */
static inline bool pressed_fade_check(const pressed *p)
{
  static hap_black_box_row rows[HAP_BLACK_BOX_TICKS];
  size_t count = 0;
  CHECK(hap_session_black_box(p->session, rows, HAP_BLACK_BOX_TICKS, sizeof rows[0], &count) ==
        HAP_OK);
  REQUIRE_SAY(count > 40, "%zu", count);
  size_t first = count - 1; /* the last row has the fault, and no doubt any more */
  while (first > 1 && (rows[first - 1].guard & HAP_GUARD_INPUT) != 0) {
    --first;
  }
  for (size_t i = first - 1; i < count; ++i) {
    if ((rows[i].guard & HAP_GUARD_LATE) != 0 || rows[i].fault == HAP_FAULT_LATE) {
      return false;
    }
  }
  double before = hapi_v3_norm(rows[first - 1].written.force);
  CHECK(before > 0.3 && rows[count - 1].fault == HAP_FAULT_DEVICE_INPUT);
  for (size_t i = first; i < count; ++i) {
    double ms = 1e-6 * (double)(rows[i].time_ns - rows[first].time_ns);
    double at_most_ms = 1e-6 * (double)(rows[i].time_ns - rows[first - 1].time_ns);
    double share = hapi_v3_norm(rows[i].written.force) / before;
    CHECK_SAY((at_most_ms > 3.9 || share > 0.95) && (ms < 17.5 || share < 0.1), "%g ms: %g", ms,
              share);
    CHECK_SAY(i + 1 == count || ms < 19.0, "not latched after %g ms", ms);
  }
  return true;
}

/* All of the force, without a fault and without the guard's doubts about a busy machine. */
static inline bool pressed_is_at_ease(void *user)
{
  const pressed *p = user;
  hap_pointer_state state;
  CHECK(hap_pointer_get(p->session, p->hand, &state, sizeof state) >= HAP_OK);
  if (pressed_fault(p) != HAP_FAULT_NONE) {
    (void)hap_session_reset_fault(p->session);
  }
  bool at_ease = (state.guard & ~(uint32_t)HAP_GUARD_SATURATED) == 0;
  sleep_ms(at_ease ? 60 : 5); /* for the black box */
  CHECK(hap_pointer_get(p->session, p->hand, &state, sizeof state) >= HAP_OK);
  return at_ease && (state.guard & ~(uint32_t)HAP_GUARD_SATURATED) == 0 &&
         hapi_v3_norm(state.wrench.force) > 0.3;
}

/* Until it is true, for 10 s. */
static inline bool pressed_await(bool (*is)(void *user), void *user)
{
  int64_t end = hapi_clock_now() + 10000 * MS;
  while (!is(user)) {
    if (hapi_clock_now() >= end) {
      return false;
    }
    sleep_ms(1);
  }
  return true;
}

#endif
