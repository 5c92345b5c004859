/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Scenes of hapode-bench faults with many bodies, and the list of all scenes. */

#include <math.h>

#include "bench/faults_build.h"

static dBodyID cube_add(faults_world *w, double mass, double edge, double x, double y, double z)
{
  const double size[3] = {edge, edge, edge};
  const double at[3] = {x, y, z};
  dBodyID cube = faults_body(w, mass, size, at);
  faults_box(w, cube, size, at);
  return cube;
}

static void floor_add(faults_world *w)
{
  faults_gravity(w);
  dCreatePlane(w->space, 0.0, 0.0, 1.0, 0.0);
}

/* ---- light bodies that touch ---- */

#define TILE 0.03
#define TILE_MASS 0.05

/* A square of 7 x 7 cubes that lie against each other. Were they as deep in each other as a surface
 * layer, those that meet at their corners would have contacts as well, whose normals ODE chooses
 * between two sides that are equally deep. Right is the block of the hand's seven cubes alone. */
static void carpet_build(faults_world *w)
{
  const double pitch = TILE + 1e-6;
  floor_add(w);
  w->mu = 0.4;
  for (int i = 0; i < 49; ++i) {
    int along = i / 7;
    cube_add(w, TILE_MASS, TILE, 0.5 * TILE + pitch * along, pitch * (i % 7 - 3),
             0.5 * TILE - FAULTS_LAYER);
  }
}

static void row_build(faults_world *w)
{
  const double pitch = TILE - FAULTS_LAYER;
  floor_add(w);
  w->mu = 0.4;
  for (int i = 0; i < 30; ++i) {
    cube_add(w, TILE_MASS, TILE, 0.5 * TILE + pitch * i, 0.0, 0.5 * TILE - FAULTS_LAYER);
  }
}

/* Against the middle of the edge x = 0. */
static const faults_path carpet_path = {{-0.011, 0.0, 0.5 * TILE}, {{X, 0.05, 0.45, 0.011}}};

#define PILE_EDGE 0.05
#define PILE_MASS 0.2
#define PILE_GAP 0.002
#define PILE_LAYER 1e-3

/* Square layers, each one cube narrower than the one below; of the lowest, the middle of the border
 * at x = 0 comes first. */
static void pile_build(faults_world *w)
{
  const double pitch = PILE_EDGE + PILE_GAP;
  int side = 1;
  for (int room = 1; room < w->scene->count;) {
    ++side;
    room = 0;
    for (int layer = 0; layer < 4 && layer < side; ++layer) {
      room += (side - layer) * (side - layer);
    }
  }
  floor_add(w);
  dWorldSetContactSurfaceLayer(w->world, PILE_LAYER);
  dWorldSetQuickStepNumIterations(w->world, 100);
  for (int layer = 0; layer < 4 && layer < side; ++layer) {
    int width = side - layer;
    for (int n = 0; n < width * width && (int)w->body_count < w->scene->count; ++n) {
      int i = w->scene->turned ? width * width - 1 - n : n;
      int along = i / width;
      int across = i % width - side / 2;
      cube_add(w, PILE_MASS, PILE_EDGE, 0.5 * PILE_EDGE + pitch * (along + 0.5 * layer),
               pitch * (across + 0.5 * layer),
               0.5 * PILE_EDGE - PILE_LAYER + layer * (PILE_EDGE - PILE_LAYER));
    }
  }
}

static const faults_path pile_path = {{-0.015, 0.0, 0.025}, {{X, 0.05, 0.45, 0.013}}};

/* ---- one pointer on many ---- */

#define PEBBLE 0.01
#define PEBBLE_MASS 0.01
#define PLATE_RADIUS 80.0

/* Cubes apart on a floor, in a square. The reference's do not move: they are pressed down. */
static void pebbles_build(faults_world *w)
{
  const double pitch = 0.015;
  int side = (int)ceil(sqrt(w->scene->count));
  floor_add(w);
  for (int i = 0; i < w->scene->count; ++i) {
    int along = i / side;
    double x = pitch * (along - 0.5 * (side - 1));
    double y = pitch * (i % side - 0.5 * (side - 1));
    if (w->is_reference) {
      faults_box(w, NULL, (double[3]){PEBBLE, PEBBLE, PEBBLE},
                 (double[3]){x, y, 0.5 * PEBBLE - FAULTS_LAYER});
    } else {
      cube_add(w, PEBBLE_MASS, PEBBLE, x, y, 0.5 * PEBBLE - FAULTS_LAYER);
    }
  }
}

static const faults_path plate_path = {{0.0, 0.0, PLATE_RADIUS + PEBBLE + 5e-4},
                                       {{Z, 0.05, 0.25, -3e-3}}};

#define PLATE                                                                          \
  {                                                                                    \
    .path = &plate_path, .radius = PLATE_RADIUS, .stiffness = 20.0, .max_force = 200.0 \
  }
#define PILE_FINGER                                                         \
  {                                                                         \
    .path = &pile_path, .radius = 0.01, .stiffness = 2000.0, .damping = 5.0 \
  }
static const faults_scene many_table[] = {
    /* item, name, world, hand, seconds, judged by */
    {13, "pile_100", pile_build, PILE_FINGER, 1.0, JUDGED(FAULTS_DUTY, 0.15, .bound_20 = 0.15),
     .count = 100},
    {13, "pile_300", pile_build, PILE_FINGER, 1.0, JUDGED(FAULTS_DUTY, 1e9, .bound_20 = 1.0),
     .count = 300},
    {13, "pile_1000", pile_build, PILE_FINGER, 1.0, JUDGED(FAULTS_DUTY_OWN, 1e9, .bound_20 = 0.1),
     .count = 1000},
    {14, "carpet", carpet_build, FINGER(&carpet_path), 0.5, WITHIN(0.03, .iterations = 100)},
    {14, "pile_30", pile_build, PILE_FINGER, 0.5, WITHIN(0.03, .iterations = 200, .spreads = true),
     .count = 30},
    {14, "light_row", row_build, FINGER(&carpet_path), 0.5, WITHIN(0.01, .iterations = 200)},
    {15, "plate_64", pebbles_build, PLATE, 0.4, JUDGED(FAULTS_CAPACITY, 0.05), .count = 64},
    {15, "plate_256", pebbles_build, PLATE, 0.4, JUDGED(FAULTS_CAPACITY, 0.05), .count = 256},
    {15, "plate_1000", pebbles_build, PLATE, 0.4, JUDGED(FAULTS_CAPACITY, 0.05), .count = 1000},
};

const faults_scene *faults_scene_at(size_t index)
{
  if (index < faults_table_count) {
    return &faults_table[index];
  }
  index -= faults_table_count;
  if (index < faults_moving_count) {
    return &faults_moving_table[index];
  }
  index -= faults_moving_count;
  return index < sizeof many_table / sizeof many_table[0] ? &many_table[index] : NULL;
}
