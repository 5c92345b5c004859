/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Recordings of hands on surfaces of their own are replayed bit for bit: by the public headers. */

#include "tests/tap.h"

#include <math.h>

#include "tests/desk.h"

typedef struct rough {
  uint32_t texture;
  double adhesion;
} rough;

static double rough_height(void *arg, const double point[3])
{
  (void)arg;
  return 2e-4 * sin(3000.0 * point[0]);
}

static void rough_feel(void *user, hap_pointer_id pointer, dGeomID geom, hap_surface *io)
{
  const rough *r = user;
  (void)pointer;
  (void)geom;
  io->friction_static = 0.5;
  io->friction_dynamic = 0.3;
  io->texture = r->texture;
  io->adhesion = r->adhesion;
  io->magnet_force = 0.5;
}

static desk *rough_desk(rough *r)
{
  desk *d = desk_new(9.81, HAP_MODEL_CONTACT);
  floor_add(d);
  ode_box(d->world, d->space, 0.15, AT(0.08, 0.08, 0.04), AT(0.0, 0.0, 0.02));
  *r = (rough){.adhesion = 2.0};
  d->ode.pointer_surface = rough_feel;
  d->ode.magnet_reach = 0.01;
  d->ode.user = r;
  return d;
}

static void rough_texture(const desk *d, rough *r)
{
  hap_texture_def def;
  hap_texture_def_init(&def, sizeof def);
  def.height = rough_height;
  REQUIRE(hap_session_add_texture(d->session, &def, &r->texture) == HAP_OK);
}

/* Down on the box, along it, up with it, and off by a jerk. */
TEST(a_hand_on_rough_and_sticky_things)
{
  rough r;
  hap_play_difference difference;
  desk *d = rough_desk(&r);
  desk_record(d, "rough.hapode", 0.04 + RADIUS + 0.002);
  rough_texture(d, &r);
  REQUIRE(hap_session_start(d->session) >= HAP_OK);
  desk_glide(d, 0.0, 0.0, -0.004);
  desk_glide(d, 0.01, 0.0, 0.0);
  desk_glide(d, 0.0, 0.0, 0.009);
  desk_glide(d, 0.0, 0.0, 0.2);
  CHECK(hap_session_stop(d->session) == HAP_OK);
  hap_stats before = session_stats(d->session);
  CHECK(before.loop.contact_ticks > 300 && before.faults.fault == HAP_FAULT_NONE);
  for (int sticks = 1; sticks >= 0; --sticks) {
    desk *again = rough_desk(&r);
    r.adhesion *= sticks; /* where nothing sticks it is another session */
    desk_replay(again, "rough.hapode");
    rough_texture(again, &r);
    session_run(again->session);
    hap_status status = HAP_OK;
    while (status == HAP_OK) {
      status = hap_session_advance(again->session, 100);
    }
    CHECK(hap_player_difference(again->player, &difference, sizeof difference) == HAP_OK);
    CHECK((difference.what == HAP_DIFFERENCE_NONE) == (sticks == 1));
  }
}
