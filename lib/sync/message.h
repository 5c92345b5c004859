/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SYNC_MESSAGE_H
#define HAPODE_SYNC_MESSAGE_H

/* What several messages between threads have in common. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/research.h>
#include <hapode/session.h>
#include <hapode/spatial.h>
#include <hapode/trace.h>

#include "base/assert.h"

#define HAPI_SLOT_NONE 0xffffffffu

/* A geom or body of the application: compared, and told to it again (hapode/touches.h). Nothing
 * that is computed may depend on it. */
typedef void *hapi_tag;

typedef struct hapi_capacity {
  uint32_t bodies; /* slots: those of the range, and as many again around it */
  uint32_t contacts;
  uint32_t pairs; /* of geoms that are near each other */
  uint32_t pointers;
  uint32_t geoms;        /* near the pointers */
  uint32_t hull_points;  /* of all hulls together */
  uint32_t trail_rows;   /* 0: none are kept */
  uint32_t trail_stride; /* ticks from row to row */
  uint32_t joints;       /* between bodies of the range */
  uint32_t tool_points;  /* contacts of pointers that are hulls */
  uint32_t crosses;      /* cross accelerances; 0: none are measured */
  uint32_t path_rows;    /* 0: none are kept */
  uint32_t springs;      /* of hapi_state; 0: they are not told */
  uint32_t triangles;    /* near pointers that are spheres */
  uint32_t feels;        /* pairs of a pointer and a geom with a surface of its own */
  uint32_t saids;        /* pairs, where the application is asked about contacts; else 0 */
} hapi_capacity;

#define HAPI_TOOL_POINTS_MAX 64u /* vertices of a pointer's hull */

/* A pointer's hull, in the pointer's frame. */
typedef struct hapi_tool_hull {
  uint32_t count; /* 0: the pointer is a sphere */
  double points[HAPI_TOOL_POINTS_MAX][3];
} hapi_tool_hull;

/* The side on which a pointer's hull touches a geom. Frame of the geom's body. */
typedef struct hapi_tool_side {
  uint64_t key; /* of hull and geom */
  uint32_t pointer;
  uint32_t body;  /* slot; HAPI_SLOT_NONE: the static world, also of a geom that has moved since */
  uint32_t epoch; /* of the body */
  hap_pose place; /* of the hull if it could not enter the geom */
  double way[3];  /* m, from where it is to there */
} hapi_tool_side;

/* Defines function(message), which gives the array that lies offset bytes behind the message's
 * begin; 0: the message has no such array. */
/* NOLINTBEGIN(bugprone-macro-parentheses): types */
#define HAPI_MESSAGE_ARRAY(function, message, element, offset) \
  static inline element *function(message *m)                  \
  {                                                            \
    HAPI_ASSERT(m->offset == 0 || m->offset >= sizeof *m);     \
    return (element *)(void *)((char *)m + m->offset);         \
  }
/* NOLINTEND(bugprone-macro-parentheses) */

enum {
  HAPI_BODY_DRIVEN = 1,  /* moved by the application: keeps its twist, feels no force */
  HAPI_BODY_RESTING = 2, /* asleep in the world: does not move until it is pushed */
  HAPI_BODY_FOLLOWS = 4, /* not pushed in the interval before: the world's state is better */
  /* Model CONTACT: the loop moves the body, ODE takes its state from the loop. A body that is not
   * OWNED, DRIVEN or MEASURED is outside of the range: it answers with its mass, and ODE gets
   * what the loop gave to it. */
  HAPI_BODY_OWNED = 8,
  HAPI_BODY_MEASURED = 16, /* model CONTACT: the loop moves it by response and b, ODE by itself */
  HAPI_BODY_GYROSCOPIC = 32,
  HAPI_BODY_TOUCHED = 64, /* of the loop's message: a contact carried it in this tick */
  /* Of an OWNED one: nothing can touch it before the next sync, so it waits for no contacts. */
  HAPI_BODY_ALONE = 256,
  /* Of a MEASURED one: all its rows go by response; else those of its only pointer contact by that
   * contact's a. */
  HAPI_BODY_WHOLE = 128,
  /* Of one outside of the range: the world beyond it takes up some of the loop's push. */
  HAPI_BODY_BRACED = 512,
  /* Of an OWNED one: a copy of what another loop moves. It is drawn to what that tells, and nothing
   * is told of it. */
  HAPI_BODY_SHARED = 1024,
  /* It has been at rest for a while: its velocity is what a solver leaves, which rocks it. */
  HAPI_BODY_STILL = 2048
};

/* A slower body gets no gyroscopic term, which would change its rotation in a tick by a
 * millionth. */
#define HAPI_SPIN_LEAST 1e-3 /* rad/s */

#endif
