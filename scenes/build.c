/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

#include <assert.h>
#include <math.h>
#include <string.h>

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

dGeomID scene_add_block(scene *s, const double edges[3], const double centre[3])
{
  const dGeomID block = dCreateBox(s->space, edges[0], edges[1], edges[2]);
  dGeomSetPosition(block, centre[0], centre[1], centre[2]);
  return block;
}

/* ODE's field has its heights along y, and z turned round. */
void scene_add_field(scene *s, double edge, const double at[3])
{
  scene_field *f = &s->field;
  const int side = SCENE_FIELD_SIDE;
  dMatrix3 rotation;
  double low = f->heights[0][0];
  double high = low;
  for (int row = 0; row < side; ++row) {
    memcpy(f->as_ode[row], f->heights[side - 1 - row], sizeof f->as_ode[row]);
    for (int column = 0; column < side; ++column) {
      const double h = f->heights[row][column];
      low = h < low ? h : low;
      high = h > high ? h : high;
    }
  }
  f->edge = edge;
  f->data = dGeomHeightfieldDataCreate();
  dGeomHeightfieldDataBuildDouble(f->data, f->as_ode[0], 0, edge, edge, side, side, 1, 0, 1, 0);
  dGeomHeightfieldDataSetBounds(f->data, low, high);
  f->geom = dCreateHeightfield(s->space, f->data, 1);
  dRFromAxisAndAngle(rotation, 1, 0, 0, M_PI / 2);
  dGeomSetRotation(f->geom, rotation);
  dGeomSetPosition(f->geom, at[0], at[1], at[2]);
}

void scene_set_friction(scene *s, dGeomID geom, double mu)
{
  assert(s->friction_count < SCENE_FRICTIONS_MAX);
  s->frictions[s->friction_count++] = (scene_friction){geom, mu};
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
