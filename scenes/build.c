/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

#include <scenes/build.h>

static dBodyID add_body(scene *s, dGeomID geom, const dMass *mass, const double centre[3])
{
  const dBodyID body = dBodyCreate(s->world);
  dBodySetMass(body, mass);
  dBodySetPosition(body, centre[0], centre[1], centre[2]);
  dGeomSetBody(geom, body);
  s->bodies[s->body_count++] = body;
  return body;
}

dBodyID scene_add_box(scene *s, const double edges[3], double mass, const double centre[3])
{
  dMass m;
  dMassSetBoxTotal(&m, mass, edges[0], edges[1], edges[2]);
  return add_body(s, dCreateBox(s->space, edges[0], edges[1], edges[2]), &m, centre);
}

dBodyID scene_add_sphere(scene *s, double radius, double mass, const double centre[3])
{
  dMass m;
  dMassSetSphereTotal(&m, mass, radius);
  return add_body(s, dCreateSphere(s->space, radius), &m, centre);
}

dBodyID scene_add_cylinder(scene *s, double radius, double length, double mass,
                           const double centre[3])
{
  dMass m;
  dMassSetCylinderTotal(&m, mass, 3, radius, length);
  return add_body(s, dCreateCylinder(s->space, radius, length), &m, centre);
}

dBodyID scene_add_capsule(scene *s, double radius, double length, double mass,
                          const double centre[3])
{
  dMass m;
  dMassSetCapsuleTotal(&m, mass, 3, radius, length);
  return add_body(s, dCreateCapsule(s->space, radius, length), &m, centre);
}

void scene_add_floor(scene *s)
{
  dCreatePlane(s->space, 0, 0, 1, 0);
}

void scene_add_block(scene *s, const double edges[3], const double centre[3])
{
  const dGeomID block = dCreateBox(s->space, edges[0], edges[1], edges[2]);
  dGeomSetPosition(block, centre[0], centre[1], centre[2]);
}

dJointID scene_add_hinge(scene *s, dBodyID a, dBodyID b, const double anchor[3],
                         const double axis[3])
{
  const dJointID hinge = dJointCreateHinge(s->world, NULL);
  dJointAttach(hinge, a, b);
  dJointSetHingeAnchor(hinge, anchor[0], anchor[1], anchor[2]);
  dJointSetHingeAxis(hinge, axis[0], axis[1], axis[2]);
  dJointSetHingeParam(hinge, dParamVel, 0);
  dJointSetHingeParam(hinge, dParamFMax, s->parameters.hinge_torque);
  return hinge;
}

dJointID scene_add_piston(scene *s, dBodyID a, dBodyID b, const double anchor[3],
                          const double axis[3], double force)
{
  const dJointID piston = dJointCreatePiston(s->world, NULL);
  dJointAttach(piston, a, b);
  dJointSetPistonAnchor(piston, anchor[0], anchor[1], anchor[2]);
  dJointSetPistonAxis(piston, axis[0], axis[1], axis[2]);
  dJointSetPistonParam(piston, dParamFMax1, force);
  dJointSetPistonParam(piston, dParamFMax2, s->parameters.hinge_torque);
  return piston;
}

dJointID scene_add_slider(scene *s, dBodyID a, const double axis[3])
{
  const dJointID slider = dJointCreateSlider(s->world, NULL);
  dJointAttach(slider, a, NULL);
  dJointSetSliderAxis(slider, axis[0], axis[1], axis[2]);
  return slider;
}
