/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Scenes for pointers that are tools. */

#include <math.h>

#include <scenes/build.h>

/* A bar along x from a hinge along y at the origin, level at the start. A soft stop is the spring
 * against which it is turned down, a block below its end the limit. */
void scene_build_lever(scene *s)
{
  const double length = s->parameters.size;
  const double thickness = 0.02;
  const double limit = 0.2; /* rad */
  const dBodyID bar = scene_add_box(s, (const double[3]){length, thickness, thickness},
                                    s->parameters.mass, (const double[3]){length / 2, 0, 0});
  const dJointID hinge =
      scene_add_hinge(s, bar, NULL, (const double[3]){0, 0, 0}, (const double[3]){0, 1, 0});
  /* At 60 Hz 6 N m/rad and 0.1 N m s/rad. */
  dJointSetHingeParam(hinge, dParamHiStop, 0);
  dJointSetHingeParam(hinge, dParamStopERP, 0.5);
  dJointSetHingeParam(hinge, dParamStopCFM, 5);
  const double drop = length * sin(limit) + thickness / 2 * cos(limit);
  scene_add_block(s, (const double[3]){0.04, 0.1, 0.02},
                  (const double[3]){length * cos(limit), 0, -drop - 0.01});
}

/* A box of the body beside its hole. */
static void add_wall(scene *s, dBodyID body, const double edges[3], double x, double y)
{
  const dGeomID wall = dCreateBox(s->space, edges[0], edges[1], edges[2]);
  dGeomSetBody(wall, body);
  dGeomSetOffsetPosition(wall, x, y, 0);
}

/* A block on the floor with a square hole through it, as free as the floor's friction lets it: four
 * walls. */
void scene_build_peg(scene *s)
{
  const scene_parameters *p = &s->parameters;
  const double hole = p->size + p->gap;
  const double wall = 0.02;
  const double height = 0.04;
  const double outer = hole + 2 * wall;
  const double middle = (hole + wall) / 2;
  dMass mass;
  scene_add_floor(s);
  const dBodyID block = scene_add_box(s, (const double[3]){wall, outer, height}, p->mass,
                                      (const double[3]){0, 0, height / 2 - p->layer});
  dGeomSetOffsetPosition(dBodyGetFirstGeom(block), -middle, 0, 0);
  add_wall(s, block, (const double[3]){hole, wall, height}, 0, -middle);
  add_wall(s, block, (const double[3]){hole, wall, height}, 0, middle);
  add_wall(s, block, (const double[3]){wall, outer, height}, middle, 0); /* ODE's first geom */
  dMassSetBoxTotal(&mass, p->mass, outer, outer, height);
  dBodySetMass(block, &mass);
}
