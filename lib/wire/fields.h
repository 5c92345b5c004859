/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_WIRE_FIELDS_H
#define HAPODE_WIRE_FIELDS_H

/* For the tables of kinds.c. MEMBER(struct, member, elements, type, bits). */

#include "wire/kinds.h"

/* NOLINTBEGIN(bugprone-macro-parentheses): types and members */
#define MEMBER(of, member, elements, type, bits)                                   \
  {                                                                                \
#member, offsetof(of, member), sizeof(((of *)0)->member), elements, type, bits \
  }
#define NUMBER(of, member) MEMBER(of, member, 1, HAPI_WIRE_U32, 0)
#define NUMBERS(of, member, n) MEMBER(of, member, n, HAPI_WIRE_U32, 0)
#define LONG(of, member) MEMBER(of, member, 1, HAPI_WIRE_U64, 0)
#define LONGS(of, member, n) MEMBER(of, member, n, HAPI_WIRE_U64, 0)
#define FLAG(of, member) MEMBER(of, member, 1, HAPI_WIRE_BOOL, 0)
#define EXACT(of, member, n) MEMBER(of, member, n, HAPI_WIRE_EXACT, 0)
#define OPEN(of, member, n) MEMBER(of, member, n, HAPI_WIRE_OPEN, 0)
#define LIKE(of, member, n) MEMBER(of, member, n, HAPI_WIRE_LIKE, 0)
#define SINGLE(of, member, n) MEMBER(of, member, n, HAPI_WIRE_SINGLE, 0)
#define FIXED(of, member, n, bits) MEMBER(of, member, n, HAPI_WIRE_FIXED, bits)
#define NOT(of, member) MEMBER(of, member, 0, HAPI_WIRE_NOT, 0)
#define TAG(of, member) MEMBER(of, member, 1, HAPI_WIRE_TAG, 0)
#define LABEL(of, member, kind) MEMBER(of, member, 1, HAPI_WIRE_LABEL, kind)
#define POSE(of, member)                                  \
  FIXED(of, member.position, 3, HAPI_WIRE_POSITION_BITS), \
      MEMBER(of, member.quat_wxyz, 4, HAPI_WIRE_QUAT, HAPI_WIRE_QUAT_BITS)
#define FREE_POSE(of, member)                             \
  FIXED(of, member.position, 3, HAPI_WIRE_POSITION_BITS), \
      MEMBER(of, member.quat_wxyz, 4, HAPI_WIRE_FREE, HAPI_WIRE_QUAT_BITS)
#define EXACT_POSE(of, member) EXACT(of, member.position, 3), EXACT(of, member.quat_wxyz, 4)
#define TWIST(of, member)                            \
  FIXED(of, member.linear, 3, HAPI_WIRE_SPEED_BITS), \
      FIXED(of, member.angular, 3, HAPI_WIRE_SPEED_BITS)
#define SHAPE(of, member)                                                          \
  NUMBER(of, member.kind), EXACT(of, member.radius, 1), EXACT(of, member.half, 3), \
      NOT(of, member.hull), LONG(of, member.hull_count), EXACT(of, member.rounding, 1)
#define SOFTNESS(of, member) \
  EXACT(of, member.erp, 1), EXACT(of, member.cfm, 1), FLAG(of, member.soft)
#define SPRING_OF(of, member)                                                              \
  EXACT(of, member.stiffness, 1), EXACT(of, member.rest, 1), EXACT(of, member.damping, 1), \
      EXACT(of, member.inertia, 1)
#define LIMIT(of, member)                                                                    \
  NUMBER(of, member.flags), OPEN(of, member.low, 1), OPEN(of, member.high, 1),               \
      SOFTNESS(of, member.stop), EXACT(of, member.bounce, 1), EXACT(of, member.speed, 1),    \
      OPEN(of, member.force, 1), EXACT(of, member.motor_cfm, 1), EXACT(of, member.fudge, 1), \
      SPRING_OF(of, member.spring)
#define SURFACE(of, member)                                                                  \
  NUMBER(of, member.flags), OPEN(of, member.mu, 1), OPEN(of, member.mu2, 1),                 \
      EXACT(of, member.direction, 3), EXACT(of, member.bounce, 1),                           \
      OPEN(of, member.bounce_speed, 1), EXACT(of, member.erp, 1), EXACT(of, member.cfm, 1),  \
      EXACT(of, member.layer, 1), OPEN(of, member.max_push, 1), EXACT(of, member.motion, 3), \
      EXACT(of, member.slip, 2)
#define ROW(of, member)                                                                     \
  SINGLE(of, member.force, 3), SINGLE(of, member.torque, 3), SOFTNESS(of, member.softness), \
      SINGLE(of, member.error, 1), SINGLE(of, member.speed, 1), SINGLE(of, member.impulse, 1)
#define AXIS(of, member)                                                                \
  SINGLE(of, member.direction, 3), NUMBER(of, member.carrier), FLAG(of, member.slides), \
      EXACT(of, member.position, 1)
/* NOLINTEND(bugprone-macro-parentheses) */

#endif
