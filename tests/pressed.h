/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_PRESSED_H
#define HAPODE_TESTS_PRESSED_H

/* A session in real time, whose one hand presses against a wall: its device has to stand at
 * PRESSED_X. Include after tap.h. */

#include <hapode/hapode.h>
#include <hapode/ode.h>

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
