/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The worlds of hapode-bench peers. The face that the hand meets is the plane x = 0. */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bench/peer.h"

#define EDGE 0.05       /* m, of cubes */
#define LAYER 1e-4      /* m */
#define CUBE_MASS 0.2   /* kg */
#define ROW_MASS 1.0    /* kg, all cubes of a row: the hand pushes rows of any length alike */
#define PILE_MASS 2.0   /* kg, all cubes of a pile, so that the hand moves one of any size */
#define PILE_CUBE 0.02  /* kg, of a cube at least: a lighter one makes the hand's damper unstable */
#define CARPET_GAP 1e-6 /* m: deeper ones that meet at a corner have contacts of a wrong normal */
#define APART 0.05      /* m, between cubes that do not touch */
#define PILE_LAYERS 4   /* of cubes */
#define BOXES_MAX 5000  /* of a world */
#define HAND_GAP 1e-3   /* m, to the first box */

static peer_box *box_add(peer_world *w, const double edges[3], double mass, double x, double y,
                         double z)
{
  peer_box *box = &w->boxes[w->count++];
  memcpy(box->edges, edges, sizeof box->edges);
  box->mass = mass;
  box->at[0] = x;
  box->at[1] = y;
  box->at[2] = z;
  return box;
}

static void cube_add(peer_world *w, double mass, double x, double y, double z)
{
  box_add(w, (const double[3]){EDGE, EDGE, EDGE}, mass, x, y, z);
}

static double layer_height(int layer)
{
  return EDGE / 2 - LAYER + layer * (EDGE - LAYER);
}

static void joint_add(peer_world *w, peer_joint_kind kind, int parent, int child,
                      const double anchor[3])
{
  peer_joint *joint = &w->joints[w->joint_count++];
  joint->kind = kind;
  joint->parent = parent;
  joint->child = child;
  memcpy(joint->anchor, anchor, sizeof joint->anchor);
  joint->axis[2] = 1.0;
}

/* ---- worlds ---- */

/* A square of cubes; the first one is at a corner. */
static void apart_build(peer_world *w, int count)
{
  int side = (int)ceil(sqrt(count));
  for (int i = 0; i < count; ++i) {
    int along = i / side;
    cube_add(w, CUBE_MASS, EDGE / 2 + (EDGE + APART) * along, (EDGE + APART) * (i % side),
             layer_height(0));
  }
  w->hand.way = 0.012;
}

static void row_build(peer_world *w, int count)
{
  for (int i = 0; i < count; ++i) {
    cube_add(w, ROW_MASS / count, EDGE / 2 + (EDGE - LAYER) * i, 0.0, layer_height(0));
  }
  w->hand.way = 0.012;
}

/* A square of cubes; the hand meets the middle of a side. */
static void carpet_build(peer_world *w, int count)
{
  const double pitch = EDGE + CARPET_GAP;
  int side = (int)ceil(sqrt(count));
  int middle = side / 2;
  cube_add(w, ROW_MASS / side, EDGE / 2, 0.0, layer_height(0));
  for (int i = 0; i < count; ++i) {
    int along = i / side;
    if (i != middle) {
      cube_add(w, ROW_MASS / side, EDGE / 2 + pitch * along, pitch * (i % side - middle),
               layer_height(0));
    }
  }
  w->hand.way = 0.012;
}

static int pile_side(int count)
{
  for (int side = 1;; ++side) {
    int room = 0;
    for (int layer = 0; layer < PILE_LAYERS && layer < side; ++layer) {
      room += (side - layer) * (side - layer);
    }
    if (room >= count) {
      return side;
    }
  }
}

/* Square layers, each one cube narrower than the one below. Every cube touches its neighbours, as
 * bricks of a wall do: rows are shifted, so that nowhere two cubes meet at an edge alone. */
static void pile_build(peer_world *w, int count)
{
  const double pitch = EDGE - LAYER;
  double mass = fmax(PILE_MASS / count, PILE_CUBE);
  int side = pile_side(count);
  int middle = side / 2;
  cube_add(w, mass, EDGE / 2, 0.0, layer_height(0));
  for (int layer = 0; layer < PILE_LAYERS && layer < side; ++layer) {
    int width = side - layer;
    for (int i = 0; i < width * width && (int)w->count < count; ++i) {
      int along = i / width;
      int half = layer / 2;
      double shift = half + 0.5 * (along % 2) + 0.25 * (layer % 2);
      if (layer != 0 || i != middle) {
        cube_add(w, mass, EDGE / 2 + pitch * (along + 0.5 * layer),
                 pitch * (i % width - middle + shift), layer_height(layer));
      }
    }
  }
  w->hand.way = 0.008;
}

/* The hand meets the middle one. */
static void tower_build(peer_world *w, int count)
{
  int first = count / 2;
  cube_add(w, CUBE_MASS, EDGE / 2, 0.0, layer_height(first));
  for (int layer = 0; layer < count; ++layer) {
    if (layer != first) {
      cube_add(w, CUBE_MASS, EDGE / 2, 0.0, layer_height(layer));
    }
  }
  w->hand.way = 0.006;
}

/* Links hang from the world, the first one on top. The hand meets the middle one. */
static void chain_build(peer_world *w, int count)
{
  const double link[3] = {0.02, 0.02, 0.06};
  int middle = count / 2;
  for (int i = 0; i < count; ++i) {
    box_add(w, link, 0.1, 0.5 * link[0], 0.0, -link[2] * (i + 0.5));
    joint_add(w, PEER_BALL, i - 1, i, (const double[3]){0.5 * link[0], 0.0, -link[2] * i});
  }
  w->has_floor = false;
  w->boxes_pass = true;
  w->hand.way = 0.015;
  w->hand.from[2] = -link[2] * (middle + 0.5);
}

/* On its back, the arms spread: the hand meets the trunk beside its middle. */
static void ragdoll_build(peer_world *w, int count)
{
  const double thick = 0.04;
  const double z = 0.5 * thick - LAYER;
  const double upper_arm[3] = {0.06, 0.025, thick};
  const double leg[3] = {0.03, 0.07, thick};
  (void)count;
  box_add(w, (const double[3]){0.08, 0.12, thick}, 0.5, 0.04, 0.0, z);
  box_add(w, (const double[3]){0.05, 0.05, thick}, 0.2, 0.04, 0.085, z);
  joint_add(w, PEER_BALL, 0, 1, (const double[3]){0.04, 0.06, z});
  for (int side = 0; side < 2; ++side) {
    double out = side == 0 ? -1.0 : 1.0;
    double shoulder = side == 0 ? 0.0 : 0.08;
    double hip = side == 0 ? 0.02 : 0.06;
    int first = (int)w->count;
    box_add(w, upper_arm, 0.1, shoulder + out * 0.03, 0.045, z);
    box_add(w, upper_arm, 0.1, shoulder + out * 0.09, 0.045, z);
    box_add(w, leg, 0.1, hip, -0.095, z);
    box_add(w, leg, 0.1, hip, -0.165, z);
    joint_add(w, PEER_BALL, 0, first, (const double[3]){shoulder, 0.045, z});
    joint_add(w, PEER_HINGE, first, first + 1, (const double[3]){shoulder + out * 0.06, 0.045, z});
    joint_add(w, PEER_BALL, 0, first + 2, (const double[3]){hip, -0.06, z});
    joint_add(w, PEER_HINGE, first + 2, first + 3, (const double[3]){hip, -0.13, z});
  }
  w->boxes_pass = true;
  w->hand.way = 0.012;
  w->hand.from[1] = -0.02;
}

/* Level about the cube, hills beyond. */
static double ground_height(double x, double y)
{
  double beyond = fmax(0.0, hypot(x, y) - 0.5);
  return -0.05 * (1.0 - cos(2.0 * beyond));
}

static void ground_fill(peer_ground *g)
{
  unsigned side = (unsigned)g->cells + 1;
  unsigned *next = g->indices;
  for (size_t i = 0; i < g->vertex_count; ++i) {
    double *v = &g->vertices[3 * i];
    size_t row = i / side;
    v[0] = g->begin + g->cell * (double)(i % side);
    v[1] = g->begin + g->cell * (double)row;
    v[2] = ground_height(v[0], v[1]);
  }
  for (unsigned y = 0; y + 1 < side; ++y) {
    for (unsigned x = 0; x + 1 < side; ++x) {
      unsigned a = y * side + x;
      const unsigned square[6] = {a, a + 1, a + side + 1, a, a + side + 1, a + side};
      memcpy(next, square, sizeof square);
      next += 6;
    }
  }
}

static void mesh_build(peer_world *w, int count)
{
  peer_ground *g = &w->ground;
  (void)count;
  cube_add(w, CUBE_MASS, EDGE / 2, 0.0, layer_height(0));
  g->cells = 224;
  g->cell = EDGE;
  g->begin = -0.5 * g->cells * g->cell + 0.02; /* lines of the surface are not edges of the cube */
  g->vertex_count = (size_t)(g->cells + 1) * (size_t)(g->cells + 1);
  g->triangle_count = 2 * (size_t)g->cells * (size_t)g->cells;
  g->vertices = calloc(g->vertex_count, 3 * sizeof *g->vertices);
  g->indices = calloc(g->triangle_count, 3 * sizeof *g->indices);
  if (g->vertices != NULL && g->indices != NULL) {
    ground_fill(g);
  }
  w->has_floor = false;
  w->hand.way = 0.012;
}

static const struct {
  const char *name;
  void (*build)(peer_world *w, int count);
  int fixed; /* boxes that it has; 0: any number */
} builders[] = {
    {"apart", apart_build, 0}, {"apart_sleep", apart_build, 0}, {"row", row_build, 0},
    {"pile", pile_build, 0},   {"carpet", carpet_build, 0},     {"tower", tower_build, 0},
    {"chain", chain_build, 0}, {"ragdoll", ragdoll_build, 10},  {"mesh", mesh_build, 1},
};

static bool world_is_whole(const peer_world *w)
{
  const peer_ground *g = &w->ground;
  return w->count > 0 && (g->cells == 0 || (g->vertices != NULL && g->indices != NULL));
}

bool peer_world_create(const char *name, int count, peer_world *out)
{
  memset(out, 0, sizeof *out);
  for (size_t i = 0; i < sizeof builders / sizeof builders[0]; ++i) {
    bool fits =
        builders[i].fixed > 0 ? count == builders[i].fixed : count >= 1 && count <= BOXES_MAX;
    if (strcmp(builders[i].name, name) != 0 || !fits) {
      continue;
    }
    out->boxes = calloc((size_t)count, sizeof *out->boxes);
    out->joints = calloc((size_t)count, sizeof *out->joints);
    if (out->boxes == NULL || out->joints == NULL) {
      break;
    }
    out->has_floor = true;
    out->mu = 0.5;
    out->gravity = 9.81;
    out->layer = LAYER;
    out->hand = (peer_hand){.settle_s = 0.2,
                            .seconds = 0.5,
                            .radius = 0.01,
                            .stiffness = 2000.0,
                            .damping = 5.0,
                            .from = {-0.01 - HAND_GAP, 0.0, NAN}};
    builders[i].build(out, count);
    if (isnan(out->hand.from[2])) {
      out->hand.from[2] = out->boxes[0].at[2];
    }
    break;
  }
  if (!world_is_whole(out)) {
    peer_world_destroy(out);
    return false;
  }
  return true;
}

void peer_world_destroy(peer_world *world)
{
  free(world->boxes);
  free(world->joints);
  free(world->ground.vertices);
  free(world->ground.indices);
  memset(world, 0, sizeof *world);
}

double peer_world_mass(const peer_world *world)
{
  double sum = 0.0;
  for (size_t i = 0; i < world->count; ++i) {
    sum += world->boxes[i].mass;
  }
  return sum;
}
