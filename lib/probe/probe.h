/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PROBE_PROBE_H
#define HAPODE_PROBE_PROBE_H

/* Testing simulations: steps of the global world that are undone. Made by accelerance.c,
 * operating_point.c and joint_probe.c. */

#include <stdbool.h>

#include "probe/admittance.h"
#include "probe/answers.h"
#include "probe/reuse.h"
#include "probe/test_set.h"

/* A contact in the testing simulations of this cycle. */
typedef struct hapi_contact_trial {
  uint32_t round;        /* order among the contacts of its island */
  double measured[6][3]; /* A, before it is known to be good */
  double measured_turn[6];
} hapi_contact_trial;

typedef struct hapi_contact_trials {
  hapi_pushed pushed;       /* slots of the contacts under test */
  hapi_contact_trial *list; /* by slot */
  uint32_t *rounds;         /* by island: contacts so far */
} hapi_contact_trials;

/* Model CONTACT. */
typedef struct hapi_body_trials {
  hapi_pushed pushed; /* slots of the bodies under test */
  double (*base)[6];  /* their acceleration at the operating point, in the order of pushed */
} hapi_body_trials;

typedef struct hapi_probe_counts {
  uint64_t joint_steps; /* of joint_probe.c; those of a test set are in it */
  uint64_t clipped;
  uint64_t singular;
  uint64_t reused;
  uint32_t joints;    /* measured, in the newest model */
  double joint_error; /* the largest of theirs */
} hapi_probe_counts;

typedef struct hapi_probe {
  /* What it reads. */
  const hapi_cycle *cycle;
  const hapi_world *world;
  const hapi_slots *slots;

  hapi_test_set test;
  hapi_answers answers;
  hapi_contact_trials contacts;
  hapi_body_trials bodies;
  hapi_reuse reuse;
  hapi_probe_counts counts;
  bool said_not_probed; /* of a transmission, once a session */
  bool said_not_held;   /* of a joint that cannot be measured, likewise */
} hapi_probe;

/* What is read outlives it. False: no memory. */
bool hapi_probe_create(hapi_probe *probe, const hapi_cycle *cycle, const hapi_world *world,
                       const hapi_slots *slots);
void hapi_probe_finish(hapi_probe *probe);
/* A session begins: nothing was found out. */
void hapi_probe_reset(hapi_probe *probe);
/* Kind of an answer that was measured. */
void hapi_probe_count(hapi_probe *probe, hapi_admittance kind);
/* The island of a body in a slot joins the test set. *out_testable: it can be undone, else the
 * body is driven from now on. HAP_ERROR_MEMORY. */
hap_status hapi_probe_add_body(hapi_probe *probe, uint32_t body, bool *out_testable);

/* accelerance.c: A and b of contacts (eq. 3-6) */

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

/* operating_point.c: the answer of whole bodies in model CONTACT */
void hapi_operating_point_measure(hapi_probe *probe);

/* joint_probe.c: what is kept of joints that the loop has no rows of its own for */

/* Of the joints that the range's walk of this number has taken, and of those that kept it from
 * taking a mechanism. Their measurements belong to the joints. */
void hapi_joint_probes(hapi_probe *probe, hapi_joint_table *joints, uint64_t walk);

#endif
