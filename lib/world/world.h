/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_WORLD_WORLD_H
#define HAPODE_WORLD_WORLD_H

/* The application's ODE world: what is known of it, and its step. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/ode.h>

#include "world/awake.h"
#include "world/bodies.h"
#include "world/carriers.h"
#include "world/claim.h"
#include "world/contact_call.h"
#include "world/cycle.h"
#include "world/joints.h"
#include "world/spaces.h"
#include "world/springs.h"
#include "world/surfaces.h"

/* Standard gravity, for the smallest perturbation of a testing simulation. */
#define HAPI_STANDARD_GRAVITY 9.81

/* Contacts of the step, as they were given to ODE, which has no getter for them. */
typedef struct hapi_contact_note {
  dJointID joint; /* compared only */
  dContact contact;
} hapi_contact_note;

typedef struct hapi_contact_notes {
  hapi_contact_note *list;
  uint32_t count;
  uint32_t capacity;
  bool softened; /* some contacts are for another step than H */
} hapi_contact_notes;

typedef struct hapi_world_counts {
  uint64_t steps;
  uint64_t contacts_rejected;
} hapi_world_counts;

/* Who steps the islands, between begin and end of a session. ODE's default is one object for all
 * worlds of the process: two worlds that step at once end the process. */
typedef struct hapi_islands {
  dThreadingImplementationID alone;     /* the thread that calls; NULL: as the application set it */
  dThreadingImplementationID threading; /* of the pool; NULL: none */
  dThreadingThreadPoolID pool;
} hapi_islands;

/* What is reached through a pointer may change in a const hapi_world: ODE's own objects, entries
 * of the tables, the surface cache, and what contacts are made with. */
struct hapi_world {
  hap_ode_def ode;
  hapi_claim claim;
  bool begun;      /* a session has taken the world over, and the bodies' sleep with it */
  bool gone;       /* the application has destroyed the world, and nothing of it may be touched */
  dGeomID witness; /* on a disabled body of ours, while begun; NULL: there is none */
  hapi_spaces spaces;
  bool said_space; /* that one was destroyed */
  hapi_body_table bodies;
  hapi_awake awake;
  hapi_carriers carriers;
  hapi_joint_table joints;
  const hapi_springs *springs; /* of whoever made the world; NULL: it has none */
  hapi_surface_cache *surfaces;
  hapi_contact_notes *notes;
  hapi_world_asking *asking;
  dJointGroupID contact_group;
  dContact *contact_scratch;
  hapi_islands islands;
  unsigned islands_threads; /* ODE's setting as it was found */
  hapi_world_counts counts;
};

/* life.c */
/* *world is zeroed. joint_slots: of the loop. *listener stays where it is. False: no memory;
 * finish is called in any case. */
bool hapi_world_create(hapi_world *world, const hap_ode_def *def, uint32_t joint_slots,
                       const hapi_world_listener *listener);
void hapi_world_finish(hapi_world *world);
void hapi_world_step(hapi_world *world, double step_s); /* the global step */

/* life.c: whether there is a world still. From watch to unwatch a destroyed one is noticed. */
void hapi_world_watch(hapi_world *world);
bool hapi_world_is_gone(hapi_world *world);
void hapi_world_unwatch(hapi_world *world);
double hapi_body_mass(dBodyID body); /* 0 for a kinematic one */

/* life.c: the body that a geom is of for the loop: its own, or its carrier; NULL: it is static */
dBodyID hapi_geom_body(const hapi_world *world, dGeomID geom);

/* flight.c */
/* Just before the global step, after the collision phase: what flies is put back by what the step
 * will take it too far. */
void hapi_flight_prepare(const hapi_world *world, double step_s);

/* life.c */
/* repeats: every run must come to the same, so that one thread steps all. False: no threads to
 * be had. */
bool hapi_islands_begin(hapi_world *world, bool repeats);
void hapi_islands_end(hapi_world *world);
void hapi_islands_rest(const hapi_world *world); /* for testing simulations */
void hapi_islands_go_on(const hapi_world *world);

/* soundness.c: states that ODE would abort the process on, or make NaN of. *out_text says what was
 * found and what to do. After a scan. */
bool hapi_world_is_unsound(const hapi_world *world, hap_detail *out_text); /* it, or its bodies */
bool hapi_body_is_unsound(const hapi_known_body *known, hap_detail *out_text); /* since the scan */
bool hapi_geoms_are_unsound(const hapi_world *world, hap_detail *out_text);
const char *hapi_body_unsoundness(dBodyID body, bool jointed); /* NULL: it is sound */
bool hapi_geom_is_sound(dGeomID geom);
/* What a collider found is made of numbers. */
bool hapi_contact_is_sound(const dContactGeom *contact);

/* collide.c */
typedef struct hapi_touching {
  dGeomID geoms[2];
  dBodyID bodies[2]; /* NULL: the static world */
} hapi_touching;

/* Contact joints for the next step, after a scan. notes: each with a note. Where most of the world
 * sleeps, those of bodies that are awake or will be woken by the step. */
void hapi_world_collide(hapi_world *world, const hapi_cycle *cycle, bool notes);
/* Those of one more body, and of all that hangs on it, unless they are there. */
void hapi_world_collide_also(hapi_world *world, const hapi_cycle *cycle, bool notes, dBodyID body);
/* Contact joints of two geoms; notes as above. Returns how many were rejected. */
uint32_t hapi_world_make_contacts(const hapi_world *world, const hapi_cycle *cycle,
                                  const hapi_touching *touching, dSurfaceParameters *surface,
                                  bool notes);
/* NULL: there is no note, the joint is the application's own. */
const dContact *hapi_world_contact_of(const hapi_world *world, dJointID joint);

/* soften.c */
/* Parameters of the world as the application means them, while ODE holds others. */
typedef struct hapi_meant {
  bool converted;
  double erp;
  double cfm;
} hapi_meant;

double hapi_step_ratio(const hapi_cycle *cycle);  /* T / H */
double hapi_tick_ratio(const hapi_cycle *cycle);  /* what passes for bodies in a tick, over H */
double hapi_world_ratio(const hapi_cycle *cycle); /* this cycle's step, or a part of it, over H */
/* Constraint parameters of step H as those of step T: the same spring and damper. */
void hapi_soften(double step_ratio, double *erp, double *cfm);
/* For a step at T: ERP, CFM and damping of the world and its bodies as meant for H. Undone by
 * restore. */
void hapi_world_convert(const hapi_world *world, double ratio, hapi_meant *out);
void hapi_world_restore(const hapi_world *world, const hapi_meant *meant);

#endif
