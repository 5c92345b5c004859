/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_CONTACT_CONTACT_INTERNAL_H
#define HAPODE_CONTACT_CONTACT_INTERNAL_H

/* Shared by the files of lib/contact. */

#include <stdatomic.h>

#include "base/histogram.h"
#include "base/thread.h"
#include "contact/contact.h"
#include "sync/touch_local.h"

/* Where a body of the pass is. By slot. */
typedef struct hapi_pass_body {
  uint32_t generation;
  bool known;
  hap_pose pose;
  hap_twist twist;
} hapi_pass_body;

/* What a pass found between the geoms of a pair. */
typedef struct hapi_pass_pair {
  double spare;   /* m, gap less margin: how near to a touch, beside what speed and age may make */
  uint32_t count; /* contacts */
  bool left_out;  /* for want of room */
} hapi_pass_pair;

struct hapi_contact {
  hapi_contact_config config;
  hapi_near *near; /* newest one that the loop is ready for; NULL: none yet */
  hapi_poses *poses;
  hapi_pass_body *bodies; /* capacity.bodies */
  hapi_pass_pair *pairs;  /* capacity.contacts */
  uint64_t number;
  uint32_t lingers;          /* passes that are made although nothing is left to find */
  _Atomic uint64_t left_out; /* pairs without room for their contacts, sum over the passes */
  hapi_histogram pass_ns;
  hapi_thread thread;
  _Atomic int stop;
  int64_t start_ns;
  hapi_tape *tape; /* of a recording or a replay; NULL: none */
};

/* tool_pass.c: contacts of the pointers that are hulls. The bodies of the pass have been placed. */
void hapi_tool_pass(hapi_contact *contact, hapi_patches *out);

/* contact_pass.c */
/* A geom of a pair where it is now. */
typedef struct hapi_placed_geom {
  const hapi_near_geom *in;
  const hapi_pass_body *body; /* NULL: static world */
  hapi_shape shape;
  hap_pose pose;
} hapi_placed_geom;

/* False: of a body that is not where the pass knows. */
bool hapi_pass_place_geom(const hapi_contact *contact, uint32_t index, hapi_placed_geom *out);
hapi_touch_side hapi_pass_side_of(const hapi_placed_geom *geom);
double hapi_pass_extent(const hapi_placed_geom *geom); /* m, about the origin of its body */
/* m, how far surfaces may come nearer until the contacts are found anew; speed: m/s, of the one
 * against the other. */
double hapi_pass_margin(const hapi_contact *contact, double speed);

#endif
