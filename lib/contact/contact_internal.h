/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_CONTACT_CONTACT_INTERNAL_H
#define HAPODE_CONTACT_CONTACT_INTERNAL_H

/* Shared by the files of lib/contact. */

#include <stdatomic.h>

#include "base/histogram.h"
#include "base/thread.h"
#include "contact/contact.h"

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
  _Atomic uint64_t left_out; /* pairs without room for their contacts, sum over the passes */
  hapi_histogram pass_ns;
  hapi_thread thread;
  _Atomic int stop;
  int64_t start_ns;
};

/* mesh_filter.c: whether a contact with a triangle of a mesh is one with the mesh. normal out of the
 * triangle. */
bool hapi_mesh_allows(const hapi_near_geom *triangle, const double *corners,
                      const double normal[3]);

#endif
