/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PROBE_ACCELERANCE_H
#define HAPODE_PROBE_ACCELERANCE_H

/* A and b of contacts by testing simulations (eq. 3-6). */

#include <ode/ode.h>

#include "near/slots.h"
#include "probe/probe.h"
#include "world/cycle.h"
#include "world/world.h"

/* Share of the weight that a probe uses at least where the pointer gave no force yet (eq. 4 would
 * divide by zero). */
#define HAPI_PROBE_FLOOR 0.01

/* Who looks on while contacts are tested. */
typedef struct hapi_contact_watch {
  void *user;
  /* Before the islands that are measured are: of which others A is used again. */
  void (*begin)(void *user, const hapi_reuse_book *book);
  /* After a testing simulation with a force [N] at a contact. */
  void (*column)(void *user, uint32_t contact, int axis, double force);
  void (*keep)(void *user, uint32_t contact); /* after three of them */
  /* About the operating point: out of the b of a body under test what the loop adds by itself. */
  void (*take_out)(void *user, uint32_t body, double io_b[6]);
} hapi_contact_watch;

/* Of a dynamic body at a rotation of ODE's. */
void hapi_accelerance_free_body(dBodyID body, const dReal rotation[12], hapi_free_body *out);
/* watch: NULL for none. */
void hapi_accelerance_measure(hapi_probe *probe, const hapi_contact_watch *watch);

#endif
