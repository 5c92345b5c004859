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

struct hapi_contact {
  hapi_contact_config config;
  hapi_near *near; /* newest one that the loop is ready for; NULL: none yet */
  hapi_poses *poses;
  hapi_pass_body *bodies; /* capacity.bodies */
  uint64_t number;
  _Atomic uint64_t full_passes; /* pairs after which there was no room */
  hapi_histogram pass_ns;
  hapi_thread thread;
  _Atomic int stop;
  int64_t start_ns;
  hapi_tape *tape; /* of a recording or a replay; NULL: none */
};

/* mesh_filter.c: whether a contact with a triangle of a mesh is one with the mesh. normal out of the
 * triangle. */
bool hapi_mesh_allows(const hapi_near_geom *triangle, const double *corners,
                      const double normal[3]);

#endif
