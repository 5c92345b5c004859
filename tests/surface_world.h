/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_SURFACE_WORLD_H
#define HAPODE_TESTS_SURFACE_WORLD_H

/* A contact world whose geoms have the surface that a test says, and a hand above a floor. By the
 * public headers alone. Include after tap.h. */

#include "tests/contact_world.h"
#include "tests/solids.h"

#define RADIUS 0.01
#define STIFFNESS 1000.0
#define PERIOD 1e-3
#define MODELS (sizeof all_models / sizeof all_models[0])

static struct {
  dGeomID other; /* that is left as it came */
  hap_surface says;
  hap_surface came; /* the last one */
  int calls;
  const contact_world *changes; /* NULL: the callback calls nothing */
  hap_status status;            /* of its call */
} told;

static inline void surface_say(void *user, hap_pointer_id pointer, dGeomID geom, hap_surface *io)
{
  (void)user;
  (void)pointer;
  ++told.calls;
  told.came = *io;
  if (told.changes != NULL) {
    told.status = hap_session_surface_changed(told.changes->session, geom);
  }
  if (geom != told.other) {
    *io = told.says;
  }
}

/* As it comes for the pointers of these tests. */
static inline hap_surface surface_plain(void)
{
  return (hap_surface){.size = sizeof(hap_surface),
                       .touchable = 1,
                       .stiffness = STIFFNESS,
                       .damping = 0.0,
                       .friction_static = 0.0,
                       .friction_dynamic = 0.0};
}

static inline void surface_change(contact_world *w, dGeomID geom)
{
  CHECK(hap_session_lock(w->session) == HAP_OK);
  CHECK(hap_session_surface_changed(w->session, geom) == HAP_OK);
  hap_session_unlock(w->session);
}

/* A floor that the hand stands 1 mm above. */
static inline contact_world *floor_new(hap_model model)
{
  memset(&told, 0, sizeof told);
  told.says = surface_plain();
  contact_world *w = cw_new(0.0);
  w->def.model = model;
  w->def.physics_hz = 100.0;
  w->hand_def.radius = RADIUS;
  w->hand_def.stiffness = STIFFNESS;
  w->hand_def.damping = 0.0;
  w->ode.pointer_surface = surface_say;
  return w;
}

static inline void floor_start(contact_world *w)
{
  cw_start(w, 0.0, 0.0, RADIUS + 0.001);
  cw_run(w, 30);
}

/* Down to that depth, and wait. */
static inline void hand_press(contact_world *w, double depth)
{
  double way = RADIUS - depth - w->hand_at[2];
  cw_go(w, 0.0, 0.0, way / 0.1, 100);
  cw_go(w, 0.0, 0.0, 0.0, 60);
}

/* The hand is a cube of 20 mm. */
static inline void hand_be_cube(contact_world *w, double corners[8 * 3])
{
  box_corners(AT(0.01, 0.01, 0.01), AT(0.0, 0.0, 0.0), corners);
  w->hand_def.radius = 0.0;
  w->hand_def.hull_xyz = corners;
  w->hand_def.hull_points = 8;
}

/* All geoms that say something have it from the next step on. */
static inline void texture_use(contact_world *w, const hap_texture_def *def)
{
  CHECK(hap_session_add_texture(w->session, def, &told.says.texture) == HAP_OK);
  surface_change(w, NULL);
}

#endif
