/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Scenes with joints. */

#include <math.h>

#include <scenes/build.h>

#define ROD_RADIUS 0.02 /* m */
#define COUNT_OF(array) (sizeof(array) / sizeof(array)[0])

/* A panel of size x size in the plane y = 0 with its hinge along z through the origin. The hand
 * meets the face at y = -thickness / 2. No floor: the hinge carries it. */
void scene_build_door(scene *s)
{
  const double size = s->parameters.size;
  const double thickness = 0.02;
  const dBodyID panel = scene_add_box(s, (const double[3]){size, thickness, size},
                                      s->parameters.mass, (const double[3]){size / 2, 0, 0});
  scene_add_hinge(s, panel, NULL, (const double[3]){0, 0, 0}, (const double[3]){0, 0, 1});
}

/* A rod from one joint to the next, both in the plane y = 0. */
static dBodyID add_rod(scene *s, double mass, const double from[3], const double to[3])
{
  const double radius = ROD_RADIUS;
  const double x = to[0] - from[0];
  const double z = to[2] - from[2];
  const double length = hypot(x, z);
  const dBodyID rod =
      scene_add_capsule(s, radius, length - 2 * radius, mass,
                        (const double[3]){(from[0] + to[0]) / 2, 0, (from[2] + to[2]) / 2});
  dMatrix3 rotation;
  dRFromAxisAndAngle(rotation, 0, 1, 0, atan2(x, z));
  dBodySetRotation(rod, rotation);
  return rod;
}

/* The four shapes in a line along y, die first, where the hand comes from. */
static void add_dice(scene *s)
{
  const scene_parameters *p = &s->parameters;
  const double edge = p->size;
  const double pitch = edge + p->gap;
  const double x = 0.18;
  const double z = edge / 2 - s->parameters.layer;
  scene_add_box(s, (const double[3]){edge, edge, edge}, p->mass, (const double[3]){x, 0, z});
  scene_add_sphere(s, edge / 2, p->mass, (const double[3]){x, pitch, z});
  scene_add_cylinder(s, edge / 2, edge, p->mass, (const double[3]){x, 2 * pitch, z});
  const dBodyID capsule =
      scene_add_capsule(s, edge / 2, edge, p->mass, (const double[3]){x, 3 * pitch, z});
  dMatrix3 rotation;
  dRFromAxisAndAngle(rotation, 0, 1, 0, M_PI / 2);
  dBodySetRotation(capsule, rotation);
}

static const double head_joint[3] = {0.072, 0, 0.268};

/* Lamp head, two arms and a heavy base, hinges along y whose friction holds the pose; dice beside
 * it. Out: the head and the upper arm, which are not joined. */
static void add_stand(scene *s, dBodyID *out_head, dBodyID *out_upper)
{
  const double head_radius = 0.035;
  const double base_edges[3] = {0.16, 0.16, 0.03};
  const double joints[3][3] = {
      {0, 0, 0.04}, {-0.036, 0, 0.19}, {head_joint[0], head_joint[1], head_joint[2]}};
  const double axis[3] = {0, 1, 0};
  scene_add_floor(s);
  const dBodyID head = scene_add_cylinder(s, head_radius, 0.05, s->parameters.mass,
                                          (const double[3]){0.092, 0, 0.233});
  add_dice(s);
  const dBodyID upper = add_rod(s, 0.2, joints[1], joints[2]);
  const dBodyID lower = add_rod(s, 0.4, joints[0], joints[1]);
  const dBodyID base = scene_add_box(
      s, base_edges, 2.0, (const double[3]){0, 0, base_edges[2] / 2 - s->parameters.layer});
  scene_add_hinge(s, lower, base, joints[0], axis);
  scene_add_hinge(s, upper, lower, joints[1], axis);
  *out_head = head;
  *out_upper = upper;
}

/* The paper's Fig. 8. */
void scene_build_lightstand(scene *s)
{
  dBodyID head;
  dBodyID upper;
  add_stand(s, &head, &upper);
  scene_add_hinge(s, head, upper, head_joint, (const double[3]){0, 1, 0});
}

/* The same with a joint that ODE has and the loop does not: the head slides along the upper arm and
 * turns about it, each against friction. */
void scene_build_telescope(scene *s)
{
  const double hold = 2; /* N: twice the weight of the head */
  dBodyID head;
  dBodyID upper;
  add_stand(s, &head, &upper);
  const double along = hypot(0.108, 0.078);
  scene_add_piston(s, head, upper, head_joint, (const double[3]){0.108 / along, 0, 0.078 / along},
                   hold);
}

/* A rod that hangs from a hinge along y at the origin. */
void scene_build_pendulum(scene *s)
{
  const double end[3] = {0, 0, -s->parameters.size};
  const dBodyID rod = add_rod(s, s->parameters.mass, (const double[3]){0, 0, 0}, end);
  scene_add_hinge(s, rod, NULL, (const double[3]){0, 0, 0}, (const double[3]){0, 1, 0});
}

/* Two bars end to end along x, free in space, with a hinge along z where they meet. */
void scene_build_hinged(scene *s)
{
  const double length = s->parameters.size;
  const double edges[3] = {length, length / 4, length / 4};
  const dBodyID near =
      scene_add_box(s, edges, s->parameters.mass, (const double[3]){length / 2, 0, 0});
  const dBodyID far =
      scene_add_box(s, edges, s->parameters.mass, (const double[3]){-length / 2, 0, 0});
  scene_add_hinge(s, near, far, (const double[3]){0, 0, 0}, (const double[3]){0, 0, 1});
}

/* A cart on a rail along x, with a pole that hangs from it. */
void scene_build_cart(scene *s)
{
  const double edge = s->parameters.size;
  const double length = 0.3;
  const dBodyID cart = scene_add_box(s, (const double[3]){edge, edge, edge / 2}, s->parameters.mass,
                                     (const double[3]){0, 0, 0});
  const dBodyID pole = add_rod(s, 0.3 * s->parameters.mass, (const double[3]){0, 0, 0},
                               (const double[3]){0, 0, -length});
  scene_add_slider(s, cart, (const double[3]){1, 0, 0});
  scene_add_hinge(s, pole, cart, (const double[3]){0, 0, 0}, (const double[3]){0, 1, 0});
}

/* Links that hang from the world, each in a hinge along y. */
void scene_build_chain(scene *s)
{
  const double length = s->parameters.size;
  dBodyID above = NULL;
  for (int i = 0; i < s->count; ++i) {
    const double top[3] = {0, 0, -length * i};
    const double end[3] = {0, 0, -length * (i + 1)};
    const dBodyID link = add_rod(s, s->parameters.mass, top, end);
    scene_add_hinge(s, link, above, top, (const double[3]){0, 1, 0});
    above = link;
  }
}
