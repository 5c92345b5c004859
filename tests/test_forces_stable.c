/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A map of own forces that are bound to bodies, over masses, stiffnesses and rates of physics: a
 * hand drags a box over a floor, along a row of others, and rubs on a texture. By public headers.
 * Asked is: no fault, forces within their limits, no body that is thrown, and nearly rest at the
 * end. */

#include "tests/tap.h"

#include <math.h>
#include <stdlib.h>

#include <hapode/forces.h>
#include <hapode/surface.h>

#include "tests/desk.h"

#define LIMIT 12.0 /* N, of the hand */
#define BOXES 4
#define HALF 0.03 /* m, of an edge */

typedef struct map_point {
  hap_force_kind kind;
  double mass; /* kg, of the box that the force is bound to */
  double stiffness;
  double physics_hz;
  double farther; /* m, that the hand goes */
} map_point;

typedef struct map_result {
  double fastest; /* m/s, of all boxes */
  double last;    /* m/s, when the hand has stood for half a second */
  double most;    /* N */
  uint64_t faults;
} map_result;

static double height_waves(void *arg, const double point[3])
{
  (void)arg;
  return 1e-4 * sin(1500.0 * point[0]) * sin(1200.0 * point[1]);
}

static void surface_rough(void *user, hap_pointer_id pointer, dGeomID geom, hap_surface *io)
{
  (void)pointer;
  (void)geom;
  io->texture = *(const uint32_t *)user;
  io->friction_static = io->friction_dynamic = 0.4;
}

static double boxes_fastest(const dBodyID boxes[BOXES])
{
  double fastest = 0.0;
  for (int i = 0; i < BOXES; ++i) {
    const dReal *v = dBodyGetLinearVel(boxes[i]);
    fastest = fmax(fastest, sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]));
  }
  return fastest;
}

static map_result map_run(const map_point *at)
{
  uint32_t texture = 0;
  hap_texture_def rough;
  map_result out = {0.0, 0.0, 0.0, 0};
  dBodyID boxes[BOXES];
  const double edges[3] = {2.0 * HALF, 2.0 * HALF, 2.0 * HALF};
  desk *d = desk_new(9.81, HAP_MODEL_CONTACT);
  floor_add(d);
  for (int i = 0; i < BOXES; ++i) { /* one, and a row beside its way */
    const double place[3] = {i == 0 ? 0.0 : 0.05 + 0.065 * i, i == 0 ? 0.0 : 0.065, HALF};
    boxes[i] = ode_box(d->world, d->space, i == 0 ? at->mass : 0.3, edges, place);
  }
  d->def.physics_hz = at->physics_hz;
  d->ode.pointer_surface = surface_rough;
  d->ode.user = &texture;
  d->hand_def.max_force = LIMIT;
  d->session = session_make(&d->def, &d->ode);
  hap_texture_def_init(&rough, sizeof rough);
  rough.height = height_waves;
  REQUIRE(hap_session_add_texture(d->session, &rough, &texture) == HAP_OK);
  REQUIRE(hap_pointer_add(d->session, &d->hand_def, &d->hand) == HAP_OK);
  d->at[2] = 2.0 * HALF + 2.0 * RADIUS;
  hand_lead(d);
  session_run(d->session);
  desk_wait(d, 120);
  hap_force_def def;
  hap_force_id id;
  hap_force_def_init(&def, sizeof def);
  def.kind = (uint32_t)at->kind;
  def.frame = HAP_FORCE_BODY;
  def.body = boxes[0];
  def.origin[2] = HALF;
  def.axis[0] = 1.0, def.axis[2] = 0.0;
  def.stiffness = at->stiffness;
  def.damping = 2e-3 * at->stiffness;
  def.strength = 5e-3 * at->stiffness;
  def.range = 0.05;
  def.pitch = 0.03;
  REQUIRE(hap_pointer_force_add(d->session, d->hand, &def, &id) == HAP_OK);
  for (int i = 0; i < 3000; ++i) { /* down on to it, along the row, and there it stands */
    double before[3] = {d->at[0], d->at[1], d->at[2]};
    double t = fmin(T * i, 1.0);
    d->at[0] = (0.12 + at->farther) * (1.0 - cos(M_PI * t));
    d->at[1] = 0.01 * sin(9.0 * t);
    d->at[2] = 2.0 * HALF + RADIUS + 0.01 - 0.013 * fmin(t / 0.2, 1.0);
    for (int k = 0; k < 3; ++k) {
      d->velocity[k] = (d->at[k] - before[k]) / T;
    }
    hand_lead(d);
    REQUIRE(hap_session_advance(d->session, 1) >= HAP_OK);
    hap_pointer_state state;
    REQUIRE(hap_pointer_get(d->session, d->hand, &state, sizeof state) == HAP_OK);
    const double *f = state.wrench.force;
    out.most = fmax(out.most, sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]));
    double v = boxes_fastest(boxes);
    out.fastest = fmax(out.fastest, v);
    out.last = i >= 2900 ? fmax(out.last, v) : 0.0;
  }
  out.faults = session_stats(d->session).faults.count;
  tap_release(d);
  return out;
}

static const hap_force_kind map_kinds[] = {HAP_FORCE_SPRING, HAP_FORCE_MAGNET, HAP_FORCE_DETENTS,
                                           HAP_FORCE_VISCOUS};

static int compare_doubles(const void *a, const void *b)
{
  double x = *(const double *)a;
  double y = *(const double *)b;
  return (x > y) - (x < y);
}

/* A light box under a stiff magnet rattles, and what of it is left at the end of one run is chance:
 * 0.000 to 0.22 m/s in 160 runs whose hands go 0.01 mm farther each, in a quarter above 0.1. So it
 * is run nine times, and the median counts. */
#define RATTLES 9
static map_result map_run_rattling(map_point at)
{
  map_result out = {0.0, 0.0, 0.0, 0};
  double last[RATTLES];
  for (int i = 0; i < RATTLES; ++i) {
    at.farther = 1e-5 * i;
    map_result run = map_run(&at);
    out.fastest = fmax(out.fastest, run.fastest);
    out.most = fmax(out.most, run.most);
    out.faults += run.faults;
    last[i] = run.last;
  }
  qsort(last, RATTLES, sizeof last[0], compare_doubles);
  out.last = last[RATTLES / 2];
  return out;
}

/* In model SINGLE, where no force is cut for a light body, detents throw it at 21 m/s. */
TEST(the_map_is_bounded)
{
  const double masses[] = {0.02, 0.2, 2.0};
  const double stiffnesses[] = {200.0, 1000.0, 5000.0};
  const double rates[] = {20.0, 60.0};
  map_result worst = {0.0, 0.0, 0.0, 0};
  for (int i = 0; i < 36; ++i) {
    map_point at = {map_kinds[i % 4], masses[i / 4 % 3], stiffnesses[i / 12], 0.0, 0.0};
    for (int r = 0; r < 2; ++r) {
      at.physics_hz = rates[r];
      bool light = at.mass < 0.1 || at.kind == HAP_FORCE_MAGNET;
      bool rattles = light && at.stiffness > 1000.0;
      const map_result got = rattles ? map_run_rattling(at) : map_run(&at);
      CHECK_SAY(
          got.faults == 0 && got.most <= LIMIT + 1e-9 && got.fastest <= 4.0 && got.last <= 0.12,
          "%s, %g kg, %g N/m, %g Hz: %.2f N, %.3f m/s, %.3f at the end, %llu faults",
          hap_force_kind_name(at.kind), at.mass, at.stiffness, at.physics_hz, got.most, got.fastest,
          got.last, (unsigned long long)got.faults);
      worst.fastest = fmax(worst.fastest, got.fastest);
      worst.last = fmax(worst.last, got.last);
    }
  }
  printf("# 72 points: at most %.2f m/s, and %.3f at the end\n", worst.fastest, worst.last);
}
