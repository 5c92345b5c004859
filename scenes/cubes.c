/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Scenes made of cubes. The face that the hand meets is the plane x = 0: a pointer of radius r
 * touches when its centre is at x = -r. */

#include <math.h>

#include <scenes/build.h>

#define PILE_LAYERS_MAX 4
#define HOLD_CUBES 4
#define CLUMP_CUBES 8

static const double fig5_speed = 0.017; /* m/s, the paper's section 7.2 */

static dBodyID add_cube(scene *s, double x, double y, double z)
{
  const double edge = s->parameters.size;
  return scene_add_box(s, (const double[3]){edge, edge, edge}, s->parameters.mass,
                       (const double[3]){x, y, z});
}

/* Height of a cube's centre in a layer; the lowest one lies on the floor. */
static double layer_height(const scene *s, int layer)
{
  const double edge = s->parameters.size;
  const double deep = s->parameters.layer;
  return edge / 2 - deep + layer * (edge - deep);
}

/* The pointer stands at the origin and the cube comes centrally: nothing excites a rotation. Here
 * the gap is the one to the pointer. */
void scene_build_flying_cube(scene *s)
{
  const scene_parameters *p = &s->parameters;
  const dBodyID cube = add_cube(s, p->radius + p->gap + p->size / 2, 0, 0);
  dBodySetLinearVel(cube, -fig5_speed, 0, 0);
}

void scene_build_row(scene *s)
{
  const scene_parameters *p = &s->parameters;
  const int cubes = s->count > 0 ? s->count : 1;
  scene_add_floor(s);
  for (int i = 0; i < cubes; ++i) {
    add_cube(s, p->size / 2 + i * (p->size + p->gap), 0, layer_height(s, 0));
  }
}

void scene_build_stack(scene *s)
{
  const double x = s->parameters.size / 2;
  scene_add_floor(s);
  add_cube(s, x, 0, layer_height(s, 1));
  add_cube(s, x, 0, layer_height(s, 0));
}

void scene_build_wedge(scene *s)
{
  const scene_parameters *p = &s->parameters;
  scene_add_floor(s);
  dCreatePlane(s->space, -1, 0, 0, -(p->size + p->gap));
  add_cube(s, p->size / 2, 0, layer_height(s, 0));
}

/* Side of the lowest layer of the smallest pile that takes all cubes. */
static int pile_side(int cubes)
{
  for (int side = 1;; ++side) {
    int room = 0;
    for (int layer = 0; layer < PILE_LAYERS_MAX && layer < side; ++layer) {
      room += (side - layer) * (side - layer);
    }
    if (room >= cubes) {
      return side;
    }
  }
}

/* Square layers, each one cube narrower than the one below, so that a cube lies on four others. The
 * first cube is the middle of the border that the hand meets, at y = 0. */
void scene_build_pile(scene *s)
{
  const scene_parameters *p = &s->parameters;
  const double pitch = p->size + p->gap;
  const int side = pile_side(s->count);
  const int middle = side / 2;
  scene_add_floor(s);
  add_cube(s, p->size / 2, 0, layer_height(s, 0));
  for (int layer = 0; layer < PILE_LAYERS_MAX && layer < side; ++layer) {
    const int width = side - layer;
    for (int i = 0; i < width * width && s->body_count < (size_t)s->count; ++i) {
      const int along = i / width;
      const int across = i % width;
      if (layer != 0 || i != middle) {
        add_cube(s, p->size / 2 + pitch * (along + 0.5 * layer),
                 pitch * (across + 0.5 * layer - middle), layer_height(s, layer));
      }
    }
  }
}

/* The second cube from the top comes first, then the others from the top down. */
static void add_tower(scene *s, int cubes, int first)
{
  const double x = s->parameters.size / 2;
  scene_add_floor(s);
  add_cube(s, x, 0, layer_height(s, first));
  for (int layer = cubes - 1; layer >= 0; --layer) {
    if (layer != first) {
      add_cube(s, x, 0, layer_height(s, layer));
    }
  }
}

void scene_build_tower(scene *s)
{
  add_tower(s, s->count, s->count > 1 ? s->count - 2 : 0);
}

void scene_build_hold(scene *s)
{
  add_tower(s, HOLD_CUBES, HOLD_CUBES - 1);
}

/* One that is pushed into another, a third as heavy, which stands free. */
void scene_build_pair(scene *s)
{
  const scene_parameters *p = &s->parameters;
  scene_add_floor(s);
  add_cube(s, p->size / 2, 0, layer_height(s, 0));
  scene_add_box(s, (const double[3]){p->size, p->size, p->size}, p->mass / 3,
                (const double[3]){1.5 * p->size + p->gap, 0, layer_height(s, 0)});
}

/* A ring around the z axis, one face of each cube towards it, at the distance at which neighbours'
 * edges are the gap apart. The first cube is at +x. */
void scene_build_clump(scene *s)
{
  const scene_parameters *p = &s->parameters;
  const double inner = (p->size + p->gap) / 2 / tan(M_PI / CLUMP_CUBES);
  scene_add_floor(s);
  for (int i = 0; i < CLUMP_CUBES; ++i) {
    const double angle = 2 * M_PI * i / CLUMP_CUBES;
    const double r = inner + p->size / 2;
    const dBodyID cube = add_cube(s, r * cos(angle), r * sin(angle), layer_height(s, 0));
    dMatrix3 rotation;
    dRFromAxisAndAngle(rotation, 0, 0, 1, angle);
    dBodySetRotation(cube, rotation);
  }
}

/* A square of cubes that stand the gap apart, about the z axis. The first cubes are those in the
 * corner at -x, -y. */
void scene_build_field(scene *s)
{
  const scene_parameters *p = &s->parameters;
  const int side = (int)ceil(sqrt(s->count));
  const double pitch = p->size + p->gap;
  scene_add_floor(s);
  for (int i = 0; i < s->count; ++i) {
    int row = i / side;
    add_cube(s, pitch * (row - 0.5 * (side - 1)), pitch * (i % side - 0.5 * (side - 1)),
             layer_height(s, 0));
  }
}
