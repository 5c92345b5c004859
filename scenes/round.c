/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Scenes with bodies that roll; size is their diameter. The side that the hand meets touches the
 * plane x = 0. */

#include <math.h>

#include <scenes/build.h>

static double resting_height(const scene *s)
{
  return s->parameters.size / 2 - s->parameters.layer;
}

static dBodyID add_ball(scene *s, double x, double y)
{
  const scene_parameters *p = &s->parameters;
  return scene_add_sphere(s, p->size / 2, p->mass, (const double[3]){x, y, resting_height(s)});
}

/* From along z to along y, across the push. */
static void lay_down(dBodyID body)
{
  dMatrix3 rotation;
  dRFromAxisAndAngle(rotation, 1, 0, 0, M_PI / 2);
  dBodySetRotation(body, rotation);
}

void scene_build_ball(scene *s)
{
  scene_add_floor(s);
  add_ball(s, s->parameters.size / 2, 0);
}

void scene_build_lying_capsule(scene *s)
{
  const double radius = s->parameters.size / 2;
  scene_add_floor(s);
  lay_down(scene_add_capsule(s, radius, 2 * radius, s->parameters.mass,
                             (const double[3]){radius, 0, resting_height(s)}));
}

void scene_build_lying_cylinder(scene *s)
{
  const double radius = s->parameters.size / 2;
  scene_add_floor(s);
  lay_down(scene_add_cylinder(s, radius, 4 * radius, s->parameters.mass,
                              (const double[3]){radius, 0, resting_height(s)}));
}

/* Two spheres side by side with a notch that the first one fits, a little to one side, and a box
 * behind them. */
void scene_build_spheres(scene *s)
{
  const scene_parameters *p = &s->parameters;
  const double d = p->size;
  const double first = d / 2;
  scene_add_floor(s);
  add_ball(s, first, 0);
  add_ball(s, first + p->gap + 0.84 * d, 0.6 * d);
  add_ball(s, first + p->gap + 0.84 * d, -0.5 * d);
  scene_add_box(s, (const double[3]){d, 3 * d, d}, 2 * p->mass,
                (const double[3]){first + 2 * p->gap + 1.84 * d, 0, resting_height(s)});
}
