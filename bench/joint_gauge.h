/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_JOINT_GAUGE_H
#define HAPODE_BENCH_JOINT_GAUGE_H

/* How far joints are open, from nothing but ODE's getters and poses of the bodies, wherever
 * these come from: the world's, or the loop's. For the bench and the tests. */

#include <stdbool.h>
#include <stddef.h>

#include <ode/ode.h>

#include <hapode/spatial.h>
#include <hapode/status.h>

#define JOINT_GAUGE_MAX 64

typedef struct joint_gauge_joint {
  int bodies[2];        /* indices into the list; -1: static world */
  double anchors[2][3]; /* m, each in its body's frame */
  double axes[2][3];    /* likewise, unit vectors */
  double turn[4];       /* the second body in the first */
  double angle;         /* rad, between the axes */
  bool slides;          /* free, or sprung, along the first axis */
  bool has_axes;
  bool keeps_turn; /* the bodies cannot turn against each other */
} joint_gauge_joint;

typedef struct joint_gauge {
  joint_gauge_joint joints[JOINT_GAUGE_MAX];
  size_t count; /* 0: the bodies have no joints */
} joint_gauge;

typedef struct joint_opening {
  double way;  /* m, from anchor to anchor; of a joint that slides the part across its axis */
  double turn; /* rad, of the axes, or of the bodies, from where they are to be to each other */
} joint_opening;

/* Ball, hinge, slider, universal, hinge-2, piston and fixed joints of the bodies. What ODE has
 * no getter for (axis of a hinge in the second body, how a slider or fixed joint has its bodies)
 * is what the poses are now. HAP_ERROR_UNSUPPORTED (another kind, a body that is not in the
 * list), HAP_ERROR_MEMORY (too many joints). */
hap_status joint_gauge_init(joint_gauge *gauge, const dBodyID *bodies, size_t count,
                            hap_detail *detail);

/* In the order of the list. Raises in to the widest joint between bodies of a set (NULL: all of
 * them), out, which may be NULL, to that of the other joints. The poses of bodies that are not
 * in the set are not read where out is NULL. */
void joint_gauge_read(const joint_gauge *gauge, const hap_pose *poses, const bool *set,
                      joint_opening *in, joint_opening *out);

hap_pose joint_gauge_pose(dBodyID body); /* in ODE's world; NULL: the static world's */

#endif
