/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_WORLD_WORLD_H
#define HAPODE_WORLD_WORLD_H

/* The application's ODE world: what is known of it, and its step. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/ode.h>

#include "world/bodies.h"
#include "world/claim.h"
#include "world/cycle.h"
#include "world/islands.h"
#include "world/joints.h"
#include "world/surfaces.h"

/* Standard gravity, for the smallest perturbation of a testing simulation. */
#define HAPI_STANDARD_GRAVITY 9.81

typedef struct hapi_world {
  hap_ode_def ode;
  hapi_claim claim;
  hapi_body_table bodies;
  hapi_joint_table joints;
  hapi_surface_cache surfaces;
  dJointGroupID contact_group;
  dJointGroupID carried_group; /* contacts of what the loop owns, see range_error.c */
  dContact *contact_scratch;
  hapi_islands islands;
  unsigned islands_threads; /* ODE's setting as it was found */
  bool converted;           /* ODE holds parameters of another step, see soften.c */
  double meant_erp;
  double meant_cfm;
} hapi_world;

double hapi_body_mass(dBodyID body); /* 0 for a kinematic one */

/* soundness.c: states that ODE would abort the process on, or make NaN of. *out_text says what was found
 * and what to do. */
bool hapi_world_is_unsound(hapi_physics *physics, hap_detail *out_text); /* after a scan */
const char *hapi_body_unsoundness(dBodyID body, bool jointed);           /* NULL: it is sound */
bool hapi_geom_is_sound(dGeomID geom);
/* What a collider found is made of numbers. */
bool hapi_contact_is_sound(const dContactGeom *contact);

/* collide.c */
void hapi_world_collide(hapi_physics *physics);
void hapi_world_collide_carried(hapi_physics *physics); /* what the loop carries: carried_group */
void hapi_world_quickstep(hapi_physics *physics, double step_s); /* counted */
/* Contact joints of two geoms for the next step, between these bodies (NULL: the static world). */
void hapi_world_make_contacts(hapi_physics *physics, const dGeomID geoms[2],
                              const dBodyID bodies[2], dSurfaceParameters *surface, bool carried);

/* soften.c */
/* Constraint parameters of step H as those of step T: the same spring and damper. */
void hapi_soften(double step_ratio, double *erp, double *cfm);
/* Model SINGLE steps at T: ERP, CFM and damping of the world and its bodies as meant for H. Undone
 * by restore. */
void hapi_world_convert(hapi_physics *physics);
void hapi_world_restore(hapi_physics *physics);

#endif
