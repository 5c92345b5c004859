/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Scenes with joints. */

#include <math.h>

#include <scenes/build.h>

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
  const double radius = 0.02;
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

/* The paper's Fig. 8: lamp head, two arms and a heavy base, hinges along y whose friction holds the
 * pose; dice beside it. */
void scene_build_lightstand(scene *s)
{
  const double head_radius = 0.035;
  const double base_edges[3] = {0.16, 0.16, 0.03};
  const double joints[3][3] = {{0, 0, 0.04}, {-0.036, 0, 0.19}, {0.072, 0, 0.268}};
  const double axis[3] = {0, 1, 0};
  scene_add_floor(s);
  const dBodyID head = scene_add_cylinder(s, head_radius, 0.05, s->parameters.mass,
                                          (const double[3]){0.092, 0, 0.233});
  add_dice(s);
  const dBodyID upper = add_rod(s, 0.2, joints[1], joints[2]);
  const dBodyID lower = add_rod(s, 0.4, joints[0], joints[1]);
  const dBodyID base = scene_add_box(
      s, base_edges, 2.0, (const double[3]){0, 0, base_edges[2] / 2 - s->parameters.layer});
  const dBodyID chain[] = {base, lower, upper, head};
  for (size_t i = 0; i + 1 < COUNT_OF(chain); ++i) {
    scene_add_hinge(s, chain[i + 1], chain[i], joints[i], axis);
  }
}
