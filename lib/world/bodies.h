/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_WORLD_BODIES_H
#define HAPODE_WORLD_BODIES_H

/* What is known of the world's bodies: a table with an entry for each. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/ode.h>

#include "base/index.h"
#include "world/cycle.h"

#define HAPI_NONE HAPI_INDEX_NONE
#define HAPI_STILL_MOST UINT16_MAX

typedef struct hapi_world hapi_world;

/* ODE's auto-disable, kept by the physics side: a testing simulation would reset ODE's own. */
typedef struct hapi_sleep {
  double linear_threshold;  /* m/s, squared as ODE keeps it */
  double angular_threshold; /* rad/s, squared */
  int idle_steps;
  double idle_time; /* s */
  int samples;
  int steps_left;
  double time_left;
  double *velocities; /* samples x 6, ring; NULL for up to one */
  int next_sample;
  bool ring_full;
} hapi_sleep;

/* Values of the application that the mark of a body stands in for. */
typedef struct hapi_mark {
  double idle_time;         /* s */
  double angular_threshold; /* rad/s */
} hapi_mark;

/* How a kinematic body went that the application moves by its pose alone. */
typedef struct hapi_posed_way {
  bool fresh;      /* a carrier that began at the last sync: it was static before */
  uint32_t stood;  /* likewise: syncs that it had been there */
  hap_pose place;  /* at the last sync */
  hap_pose before; /* at the one before it */
  hap_twist rate;  /* between them */
} hapi_posed_way;

/* What a step does not read for a body that is far from the pointers and has not changed. */
typedef struct hapi_known_rest {
  uint64_t birth; /* number of this life of the entry, from 1: addresses come again */
  uint64_t name;  /* its first birth: stays where it is renewed */
  bool adopted;
  double user_force[3]; /* accumulators before the last global step */
  double user_torque[3];
  hapi_mark mark;
  hapi_sleep sleep;
  double damping[2]; /* as the application means it, while converted: soften.c */
  void (*moved_callback)(dBodyID);
  dGeomID geom; /* of a carrier, world/carriers.h; NULL: a body of the world */
  hapi_posed_way way;
} hapi_known_rest;

/* 64 bytes: a scan goes through the memory of all of them. */
typedef struct hapi_known_body {
  dBodyID body;          /* NULL: free entry */
  hapi_known_rest *rest; /* the entry's */
  uint64_t seen;         /* scan that found it */
  uint32_t next;         /* entry that the last scan saw after it; a guess */
  uint32_t slot;         /* local slot, HAPI_NONE: not local */
  double extent;         /* m, from the body's origin to the far corner of its geoms */
  uint64_t
      geoms_print; /* of the geoms that it was measured of; 0: not yet, or they are not sound */
  bool found;      /* at least once, by a geom or a joint: it is gone when it is found no more */
  bool sized;      /* all of its geoms are of classes whose sizes are in geoms_print */
  bool measured;   /* the last scan found its geoms changed */
  bool jointed;
  bool contacted;  /* by contact joints of the application */
  bool loop_owned; /* in the newest message, also while its slot retires */
  bool loop_touched;
  bool pushed; /* user_force or user_torque is not 0 */
  bool mark_placed;
  bool mark_in_axis;
  bool sleep_taken;
  bool
      sleep_automatic; /* ODE's flag as the application set it; kept by us while the session runs */
  bool awake;          /* after the last global step */
  bool posed;          /* moves by its pose alone: rest->way */
  uint16_t still; /* cycles in a row in which it was at rest, up to HAPI_STILL_MOST; 0: it is new */
} hapi_known_body;

struct hapi_physics;

/* What other parts want to hear of the world. Called under the lock that the caller of the world's
 * function has. */
typedef struct hapi_world_listener {
  struct hapi_physics *physics; /* nothing here looks into it */
  /* Before the table grows: arrays by entry. False: no memory. */
  bool (*grow)(struct hapi_physics *physics, uint32_t capacity);
  void (*body_begun)(struct hapi_physics *physics, uint32_t index);
  void (*body_gone)(struct hapi_physics *physics, uint32_t index); /* its entry still holds it */
  void (*surface_asked)(struct hapi_physics *physics, dGeomID a, dGeomID b,
                        const dSurfaceParameters *surface);
} hapi_world_listener;

/* The first ones that the scan met; NULL: none. Not of the local bodies. */
typedef struct hapi_unsound {
  dBodyID body;
  const char *text; /* of the body */
  dGeomID geom;
} hapi_unsound;

typedef struct hapi_body_table {
  const hapi_world_listener *listener;
  hapi_known_body *entries;
  hapi_known_rest *rests; /* of each entry */
  dBodyID *handles; /* body of each entry once more, close together: for walks over all bodies */
  uint32_t capacity;
  uint32_t high; /* entries in use are below */
  hapi_index by_address;
  uint64_t births; /* entries begun so far */
  uint32_t used;
  uint64_t scan;
  uint32_t seen_count;    /* entries that this scan saw */
  uint32_t jointed_count; /* of those with joints */
  uint32_t last_seen;
  double fastest; /* m/s, surface of the bodies that are awake and not local */
  hapi_unsound unsound;
  uint64_t lost;
  uint32_t replaced; /* among them, not counted yet: another one is at the address */
  bool said_lost;
  bool starved;         /* the newest scan found no memory for a body: not all are known */
  bool geoms_forgotten; /* since the newest scan: another one may be at the address of one */
} hapi_body_table;

/* bodies.c */
hap_status hapi_bodies_init(hapi_body_table *table, const hapi_world_listener *listener);
void hapi_bodies_finish(hapi_body_table *table);
uint32_t hapi_bodies_find(const hapi_body_table *table, dBodyID body); /* HAPI_NONE */
/* By the birth of its entry; HAPI_NONE: it is gone. */
uint32_t hapi_bodies_find_birth(const hapi_body_table *table, uint64_t birth);
/* Likewise, by its name. */
uint32_t hapi_bodies_find_name(const hapi_body_table *table, uint64_t name);
/* Reads which bodies there are; HAP_ERROR_MEMORY when the table cannot grow. syncs: once in a
 * cycle, when what the application has moved counts. */
hap_status hapi_bodies_scan(hapi_world *world, const hapi_cycle *cycle, bool syncs);
hap_status hapi_bodies_adopt(hapi_body_table *table, dBodyID body);
/* To all but the application the body is a new one from now on. HAPI_NONE: it is not known. */
uint32_t hapi_bodies_renew(hapi_body_table *table, dBodyID body);
hap_status hapi_bodies_forget(hapi_body_table *table, dBodyID body);
/* Whose the body of an entry is: the loop's, which touched it, or ODE's. */
void hapi_bodies_own(hapi_body_table *table, uint32_t index, bool loop_owned, bool loop_touched);
hap_status hapi_bodies_set_moved_callback(hapi_world *world, const hapi_cycle *cycle, dBodyID body,
                                          void (*callback)(dBodyID));

/* extent.c */
bool hapi_extent_follow(hapi_known_body *known); /* measures it when the geoms have changed: true */
/* m/s, of its surface; 0 for one that sleeps */
double hapi_extent_speed(const hapi_known_body *known);
bool hapi_extent_is_still(const hapi_known_body *known); /* now, and for some cycles before */
/* At a sync, after a step of that length: how a body that is moved by its pose goes. */
void hapi_extent_follow_way(hapi_known_body *known, double seconds);
/* ODE's twist, or that of its poses. */
void hapi_extent_twist(const hapi_known_body *known, hap_twist *out);
/* Once a cycle: counts in known->still whether it is at rest at that speed. */
void hapi_extent_rest(hapi_known_body *known, double speed);

/* mark.c: tells a body from a later one at its address */
void hapi_mark_place(hapi_known_body *known);
bool hapi_mark_is_gone(const hapi_known_body *known); /* it is another body */
/* What the application has set since, of auto-disable. */
#define HAPI_MARK_TIME 1u
#define HAPI_MARK_THRESHOLD 2u
unsigned hapi_mark_follow(hapi_known_body *known);
void hapi_mark_remove(hapi_known_body *known); /* idempotent */

void hapi_pose_read(dBodyID body, hap_pose *out); /* NULL: the static world's */
void hapi_twist_read(dBodyID body, hap_twist *out);
void hapi_matrix_read(const dReal in[12], double out[9]); /* ODE's rows of four */
bool hapi_pose_is_sound(dBodyID body);                    /* its numbers are finite */

/* sleep.c */
void hapi_sleep_follow(hapi_known_body *known);              /* takes over; and what is set later */
void hapi_sleep_give_back(hapi_known_body *known);           /* idempotent */
void hapi_sleep_step(hapi_body_table *table, double step_s); /* just before the global step */
void hapi_sleep_note(hapi_known_body *known); /* after it, before anything wakes one */

#endif
