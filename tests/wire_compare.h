/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_WIRE_COMPARE_H
#define HAPODE_TESTS_WIRE_COMPARE_H

/* Whether two messages are the same within what the codec promises (wire/wire.h). The members come
 * from the codec's tables; tests/test_wire_witness.py holds these against the headers. */

#include <math.h>
#include <stdio.h>

#include "sync/exchange.h"
#include "wire/kinds.h"

/* Tags may have other values: then only whether they are NULL is looked at. */
static inline bool compare_field(const hapi_wire_field *f, const char *a, const char *b)
{
  double worst = 0.0;
  for (uint32_t i = 0; i < f->count; ++i) {
    double x = 0.0;
    double y = 0.0;
    double scale = 1.0;
    switch ((hapi_wire_type)f->type) {
      case HAPI_WIRE_TAG:
      case HAPI_WIRE_OWN:
        if ((*(const hapi_tag *)(const void *)a == NULL) !=
            (*(const hapi_tag *)(const void *)b == NULL)) {
          return false;
        }
        continue;
      case HAPI_WIRE_SINGLE:
      case HAPI_WIRE_FIXED:
      case HAPI_WIRE_QUAT:
      case HAPI_WIRE_FREE:
        memcpy(&x, a + i * sizeof x, sizeof x);
        memcpy(&y, b + i * sizeof y, sizeof y);
        scale = f->type == HAPI_WIRE_SINGLE ? 6e-8 * fmax(fabs(x), 1e-30)
                : f->bits == 17             ? 4e-6
                : f->bits == 18             ? 5e-6
                : f->bits == 20             ? 5e-7
                : f->bits == 24             ? 3e-8
                : f->bits == 12             ? 1.3e-4
                                            : 0.5;
        worst = fmax(worst, fabs(x - y) / scale);
        continue;
      case HAPI_WIRE_U32:
      case HAPI_WIRE_U64:
      case HAPI_WIRE_BOOL:
      case HAPI_WIRE_EXACT:
      case HAPI_WIRE_OPEN:
      case HAPI_WIRE_LIKE:
      case HAPI_WIRE_LABEL:
      case HAPI_WIRE_NOT:
        break;
    }
    size_t size = f->size / f->count;
    if (memcmp(a + i * size, b + i * size, size) != 0) {
      return false;
    }
  }
  return worst <= 1.0;
}

/* alike: doubles may differ by a nanometre. NULL: the same; else the member that differs. */
static inline const char *compare_record(hapi_wire_kind kind, const void *a, const void *b,
                                         bool alike)
{
  const hapi_wire_record *r = &hapi_wire_records[kind];
  for (uint32_t i = 0; i < r->field_count; ++i) {
    const hapi_wire_field *f = &r->fields[i];
    const char *x = (const char *)a + f->offset;
    const char *y = (const char *)b + f->offset;
    bool good = true;
    if (alike && f->type == HAPI_WIRE_EXACT) {
      for (uint32_t k = 0; k < f->count; ++k) {
        good = good && fabs(((const double *)(const void *)x)[k] -
                            ((const double *)(const void *)y)[k]) <= 1e-9;
      }
    } else {
      good = compare_field(f, x, y);
    }
    if (!good) {
      return f->name;
    }
  }
  return NULL;
}

#define COMPARE_LIST(kind, array, count, alike)                                  \
  do {                                                                           \
    if (a->count != b->count) {                                                  \
      return #count;                                                             \
    }                                                                            \
    for (uint32_t i = 0; i < a->count; ++i) {                                    \
      const char *bad = compare_record(kind, &array(a)[i], &array(b)[i], alike); \
      if (bad != NULL) {                                                         \
        return bad;                                                              \
      }                                                                          \
    }                                                                            \
  } while (0)

static inline const char *compare_models(hapi_model *a, hapi_model *b)
{
  const char *head = compare_record(HAPI_WIRE_MODEL, a, b, false);
  if (head != NULL) {
    return head;
  }
  COMPARE_LIST(HAPI_WIRE_TRIANGLE, hapi_model_triangles, triangle_count, true);
  COMPARE_LIST(HAPI_WIRE_BODY, hapi_model_bodies, body_count, false);
  COMPARE_LIST(HAPI_WIRE_CONTACT, hapi_model_contacts, contact_count, false);
  COMPARE_LIST(HAPI_WIRE_JOINT, hapi_model_joints, joint_count, false);
  COMPARE_LIST(HAPI_WIRE_FEEL, hapi_model_feels, feel_count, false);
  COMPARE_LIST(HAPI_WIRE_HAND, hapi_model_hands, hand_count, false);
  if (a->course_count != b->course_count) {
    return "course_count";
  }
  for (uint32_t i = 0; i < a->body_count; ++i) {
    const hapi_model_body *x = &hapi_model_bodies(a)[i];
    const hapi_model_body *y = &hapi_model_bodies(b)[i];
    const char *bad = (x->flags & HAPI_BODY_MEASURED) != 0
                          ? compare_record(HAPI_WIRE_RESPONSE, x, y, false)
                          : NULL;
    if ((x->course != 0) != (y->course != 0)) {
      return "course";
    }
    if (bad == NULL && x->course != 0) {
      bad = compare_record(HAPI_WIRE_COURSE, &hapi_model_courses(a)[x->course - 1],
                           &hapi_model_courses(b)[y->course - 1], false);
    }
    if (bad == NULL && y->tag != NULL && y->tag != (hapi_tag)(uintptr_t)x->birth) {
      bad = "tag";
    }
    if (bad != NULL) {
      return bad;
    }
  }
  for (uint32_t i = 0; i < a->joint_count; ++i) {
    const hapi_model_joint *x = &hapi_model_joints(a)[i];
    const char *bad = x->kind == HAPI_JOINT_MEASURED
                          ? compare_record(HAPI_WIRE_MEASURED, &x->measured,
                                           &hapi_model_joints(b)[i].measured, false)
                          : NULL;
    if (bad != NULL) {
      return bad;
    }
  }
  return NULL;
}

static inline const char *compare_nears(hapi_near *a, hapi_near *b)
{
  const char *head = compare_record(HAPI_WIRE_NEAR, a, b, false);
  if (head != NULL) {
    return head;
  }
  COMPARE_LIST(HAPI_WIRE_PLACED, hapi_near_bodies, body_count, false);
  COMPARE_LIST(HAPI_WIRE_GEOM, hapi_near_geoms, geom_count, true);
  COMPARE_LIST(HAPI_WIRE_PAIR, hapi_near_pairs, pair_count, false);
  COMPARE_LIST(HAPI_WIRE_TOOL, hapi_near_tools, tool_count, false);
  COMPARE_LIST(HAPI_WIRE_TOOL_PAIR, hapi_near_tool_pairs, tool_pair_count, false);
  if (a->point_count != b->point_count) {
    return "point_count";
  }
  for (uint32_t i = 0; i < 3 * a->point_count; ++i) {
    if (!(fabs(hapi_near_points(a)[i] - hapi_near_points(b)[i]) <= 1e-9)) {
      return "point";
    }
  }
  return NULL;
}

static inline const char *compare_states(hapi_state *a, hapi_state *b)
{
  const char *head = compare_record(HAPI_WIRE_STATE, a, b, false);
  if (head != NULL) {
    return head;
  }
  COMPARE_LIST(HAPI_WIRE_MOVED, hapi_state_bodies, body_high, false);
  COMPARE_LIST(HAPI_WIRE_TOUCH, hapi_state_contacts, contact_count, false);
  COMPARE_LIST(HAPI_WIRE_SPRING, hapi_state_springs, spring_count, false);
  COMPARE_LIST(HAPI_WIRE_GIVEN, hapi_state_joints, joint_count, false);
  COMPARE_LIST(HAPI_WIRE_SIDE, hapi_state_sides, side_count, false);
  for (uint32_t i = 0; i < a->pointer_count; ++i) {
    const hapi_state_pointer *x = &hapi_state_pointers(a)[i];
    const hapi_state_pointer *y = &hapi_state_pointers(b)[i];
    const char *bad = compare_record(HAPI_WIRE_POINTER, x, y, false);
    if (bad == NULL && x->is_tool != 0) {
      bad = compare_record(HAPI_WIRE_HULL, &hapi_state_hulls(a)[i], &hapi_state_hulls(b)[i], false);
    }
    if (bad != NULL) {
      return bad;
    }
  }
  return NULL;
}

#endif
