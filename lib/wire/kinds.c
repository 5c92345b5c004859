/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "wire/kinds.h"

#include <math.h>
#include <string.h>

#include "base/assert.h"
#include "base/hash.h"
#include "wire/fields.h"

/* ---- the tables: every member of every struct, in the order of the cells ---- */

static const hapi_wire_field model_fields[] = {
#define M(kind, ...) kind(hapi_model, __VA_ARGS__)
    M(LONG, number), M(LONG, tick), M(LONG, state_ns), M(LONG, valid_from_ns), M(LONG, sent_ns),
    M(EXACT, blend_s, 1), M(EXACT, period_s, 1), M(EXACT, time_scale, 1), M(NUMBER, model),
    M(NUMBER, impulse_pose), M(NUMBER, wishes), M(NUMBER, max_sweeps), M(NUMBER, row_updates),
    M(EXACT, force_drift, 1), M(LONG, tick_work), M(LONG, tick_budget_ns), M(NUMBER, touches),
    M(NUMBER, bounces), M(NUMBER, watch_count), M(NUMBERS, watch_slot, HAP_TRACE_BODIES_MAX),
    M(FIXED, watch_position, 3 * HAP_TRACE_BODIES_MAX, HAPI_WIRE_POSITION_BITS),
    /* What the lists say. */
    M(NOT, body_count), M(NOT, contact_count), M(NOT, joint_count), M(NOT, tool_count),
    M(NOT, cross_count), M(NOT, course_count), M(NOT, triangle_count), M(NOT, feel_count),
    M(NOT, hand_count),
    /* The receiver's own. */
    M(NOT, look_ahead_s), M(NOT, bodies_offset), M(NOT, contacts_offset), M(NOT, joints_offset),
    M(NOT, tools_offset), M(NOT, crosses_offset), M(NOT, courses_offset), M(NOT, triangles_offset),
    M(NOT, feels_offset), M(NOT, hands_offset)};

static const hapi_wire_field near_fields[] = {
#define N(kind, ...) kind(hapi_near, __VA_ARGS__)
    N(LONG, model_number), N(NUMBER, between), N(NUMBER, always), N(EXACT, contact_hz, 1),
    N(NOT, body_count), N(NOT, geom_count), N(NOT, pair_count), N(NOT, point_count),
    N(NOT, tool_count), N(NOT, tool_pair_count), N(NOT, bodies_offset), N(NOT, geoms_offset),
    N(NOT, pairs_offset), N(NOT, points_offset), N(NOT, tools_offset), N(NOT, tool_pairs_offset),
    /* Nobody is asked about contacts. */
    N(NOT, said_count), N(NOT, saids_offset), N(NOT, terms)};

static const hapi_wire_field triangle_fields[] = {
    EXACT(hapi_triangle, corners, 9), NOT(hapi_triangle, middle), NOT(hapi_triangle, reach)};

static const hapi_wire_field body_fields[] = {
#define B(kind, ...) kind(hapi_model_body, __VA_ARGS__)
    B(NUMBER, slot),
    B(NUMBER, generation),
    B(NUMBER, flags),
    B(NUMBER, epoch),
    B(POSE, pose),
    B(TWIST, twist),
    B(SINGLE, b, 6),
    B(EXACT, residual, 6),
    B(EXACT, impulse_taken, 6),
    B(EXACT, gain_taken, 6),
    B(SINGLE, brace, 6),
    B(LONG, birth),
    B(EXACT, held_mass, 1),
    MEMBER(hapi_model_body, tag, 1, HAPI_WIRE_OWN, 0),
    B(EXACT, mass, 1),
    B(EXACT, gravity, 3),
    B(EXACT, user_wrench, 6),
    B(EXACT, linear_keep, 1),
    B(EXACT, angular_keep, 1),
    B(OPEN, linear_threshold2, 1),
    B(OPEN, angular_threshold2, 1),
    B(OPEN, max_angular_speed, 1),
    B(EXACT, inertia, 9),
    B(EXACT, inverse_inertia, 9),
    B(NOT, course),
    B(NOT, response)};

static const hapi_wire_field response_fields[] = {SINGLE(hapi_model_body, response, 36)};

static const hapi_wire_field course_fields[] = {
#define C(kind, ...) kind(hapi_model_course, __VA_ARGS__)
    C(NUMBER, leaps), C(NUMBER, begins), C(POSE, before), C(EXACT, period_s, 1),
    C(SINGLE, ways, 6 * HAPI_COURSE_ORDER)};

static const hapi_wire_field contact_fields[] = {
#define T(kind, ...) kind(hapi_model_contact, __VA_ARGS__)
    T(NUMBER, slot),
    T(NUMBER, generation),
    T(NUMBER, body),
    T(NUMBER, pointer),
    T(NUMBER, pointer_generation),
    T(NUMBER, has_shape),
    T(NUMBER, hidden),
    T(NUMBER, feel),
    T(FIXED, point_body, 3, HAPI_WIRE_POSITION_BITS),
    T(FIXED, normal_body, 3, HAPI_WIRE_UNIT_BITS),
    T(FIXED, told.at, 3, HAPI_WIRE_POSITION_BITS),
    T(LABEL, told.first, HAPI_WIRE_TRIANGLE),
    T(NUMBER, told.count),
    T(EXACT, told.within, 1),
    T(SINGLE, a, 18),
    T(SINGLE, turn, 6),
    T(OPEN, mu, 1),
    T(SHAPE, shape),
    EXACT_POSE(hapi_model_contact, shape_pose),
    T(TAG, geom),
    T(LONG, geom_number),
    T(NOT, tool)};

static const hapi_wire_field joint_fields[] = {
#define J(kind, ...) kind(hapi_model_joint, __VA_ARGS__)
    J(NUMBER, slot),
    J(NUMBER, generation),
    J(NUMBER, kind),
    J(NUMBER, body_a),
    J(NUMBER, generation_a),
    J(NUMBER, body_b),
    J(NUMBER, generation_b),
    J(NUMBER, told),
    J(EXACT, place.anchor_a, 3),
    J(EXACT, place.anchor_b, 3),
    J(EXACT, place.axis_a, 3),
    J(EXACT, place.axis_b, 3),
    J(EXACT, place.reference_a, 3),
    J(EXACT, place.reference_b, 3),
    J(EXACT, place.turn, 4),
    J(EXACT, place.cos_axes, 1),
    J(EXACT, place.sin_axes, 1),
    J(SOFTNESS, along),
    J(SOFTNESS, linear),
    J(SOFTNESS, angular),
    J(LIMIT, limits[0]),
    J(LIMIT, limits[1]),
    J(LIMIT, limits[2]),
    J(NOT, measured)};

static const hapi_wire_field measured_fields[] = {
#define R(kind, ...) kind(hapi_measured_joint, __VA_ARGS__)
    R(NUMBER, number), R(NUMBER, row_count), R(NUMBER, carrier),  R(EXACT, ahead_s, 1),
    R(ROW, rows[0]),   R(ROW, rows[1]),      R(ROW, rows[2]),     R(ROW, rows[3]),
    R(ROW, rows[4]),   R(ROW, rows[5]),      R(SINGLE, given, 6), R(AXIS, axes[0]),
    R(AXIS, axes[1]),  R(AXIS, axes[2])};

static const hapi_wire_field feel_fields[] = {
#define F(kind, ...) kind(hapi_model_feel, __VA_ARGS__)
    F(NUMBER, number), F(NUMBER, pointer), F(NUMBER, feel.more), F(OPEN, feel.mu, 1),
    F(OPEN, feel.mu_static, 1), F(EXACT, feel.stiffness, 1), F(EXACT, feel.damping, 1),
    F(EXACT, feel.impact.force, 1), F(EXACT, feel.impact.decay, 1), F(EXACT, feel.impact.hz, 1),
    F(EXACT, feel.adhesion, 1), F(EXACT, feel.magnet_force, 1), F(EXACT, feel.magnet_reach, 1),
    /* Textures are refused. NOLINTNEXTLINE(bugprone-sizeof-expression): geom is a handle */
    F(NOT, feel.texture_number), F(NOT, feel.texture), F(NOT, feel.geom)};

static const hapi_wire_field placed_fields[] = {
#define P(kind, ...) kind(hapi_near_body, __VA_ARGS__)
    P(NUMBER, slot), P(NUMBER, generation), P(FREE_POSE, pose), P(TWIST, twist)};

typedef struct vertex {
  double at[3];
} vertex;
static const hapi_wire_field vertex_fields[] = {EXACT(vertex, at, 3)};

static const hapi_wire_field geom_fields[] = {
#define G(kind, ...) kind(hapi_near_geom, __VA_ARGS__)
    G(NUMBER, body),
    G(NUMBER, generation),
    G(SHAPE, shape),
    G(EXACT, extent, 1),
    G(LABEL, hull_first, HAPI_WIRE_VERTEX),
    G(NUMBER, open_edges),
    EXACT_POSE(hapi_near_geom, pose)};

static const hapi_wire_field pair_fields[] = {
#define A(kind, ...) kind(hapi_near_pair, __VA_ARGS__)
    A(LONG, key),
    A(LABEL, geom_a, HAPI_WIRE_GEOM),
    A(LABEL, geom_b, HAPI_WIRE_GEOM),
    A(TAG, tags.geom_a),
    A(TAG, tags.geom_b),
    A(SURFACE, surface)};

static const hapi_wire_field tool_fields[] = {
#define O(kind, ...) kind(hapi_near_tool, __VA_ARGS__)
    O(NUMBER, pointer),    O(NUMBER, generation),
    O(EXACT, radius, 1),   O(EXACT, extent, 1),
    O(POSE, pose),         O(TWIST, twist),
    O(NUMBER, hull.count), O(EXACT, hull.points, 3 * HAPI_TOOL_POINTS_MAX)};

static const hapi_wire_field tool_pair_fields[] = {
#define Q(kind, ...) kind(hapi_near_tool_pair, __VA_ARGS__)
    Q(LONG, key),
    Q(LABEL, tool, HAPI_WIRE_TOOL),
    Q(LABEL, geom, HAPI_WIRE_GEOM),
    Q(TAG, tag),
    Q(OPEN, mu, 1),
    Q(NUMBER, feel),
    Q(EXACT, reach, 1)};

static const hapi_wire_field hand_fields[] = {
#define L(kind, ...) kind(hapi_model_hand, __VA_ARGS__)
    L(NUMBER, number),
    L(NUMBER, generation),
    L(EXACT, radius, 1),
    L(EXACT, stiffness, 1),
    L(EXACT, damping, 1),
    L(OPEN, friction, 1),
    L(EXACT, finger_radius, 1),
    L(POSE, pose),
    L(TWIST, twist),
    L(NUMBER, hull.count),
    L(EXACT, hull.points, 3 * HAPI_TOOL_POINTS_MAX)};

static const hapi_wire_field state_fields[] = {
#define S(kind, ...) kind(hapi_state, __VA_ARGS__)
    S(LONG, tick),
    S(LONG, model_number),
    S(LONG, now_ns),
    S(EXACT, time_scale, 1),
    S(EXACT, hand_impulse, 3),
    S(LIKE, owned_impulse, 3),
    S(LONG, load.ticks),
    S(LONG, load.over),
    S(FIXED, load.spent_ns, 1, 0),
    S(FLAG, derated),
    S(FLAG, swings),
    S(NUMBER, force_out),
    S(FLAG, texture_out),
    S(LONG, work.ticks),
    S(LONG, work.done),
    S(FIXED, work.spent_ns, 1, 0),
    S(LONG, work.late),
    S(NUMBER, work.rows),
    S(NUMBER, work.owned),
    S(NUMBER, work.awake),
    S(NUMBER, unsolved),
    S(NUMBER, model),
    S(NUMBER, body_high),
    S(NOT, contact_count),
    S(NOT, pointer_count),
    S(NOT, bodies_offset),
    S(NOT, contacts_offset),
    S(NOT, pointers_offset),
    S(NOT, hulls_offset),
    S(NOT, spring_count),
    S(NOT, spring_capacity),
    S(NOT, springs_offset),
    S(NOT, joint_count),
    S(NOT, joints_offset),
    S(NOT, side_count),
    S(NOT, sides_offset)};

static const hapi_wire_field pointer_fields[] = {
#define H(kind, ...) kind(hapi_state_pointer, __VA_ARGS__)
    H(NUMBER, generation),
    H(NUMBER, collide_bits),
    H(EXACT, radius, 1),
    H(EXACT, stiffness, 1),
    H(EXACT, damping, 1),
    H(OPEN, friction, 1),
    H(EXACT, finger_radius, 1),
    H(OPEN, magnet_hold, 1),
    H(POSE, pose),
    H(TWIST, twist),
    H(FIXED, apart, 3, HAPI_WIRE_POSITION_BITS),
    H(EXACT, hold, 1),
    H(NUMBER, is_tool),
    H(EXACT, extent, 1),
    H(NUMBER, bound_count),
    H(LONGS, bound, HAP_FORCES_MAX),
    H(LONG, held)};

static const hapi_wire_field hull_fields[] = {
    NUMBER(hapi_tool_hull, count), EXACT(hapi_tool_hull, points, 3 * HAPI_TOOL_POINTS_MAX)};

static const hapi_wire_field moved_fields[] = {
#define V(kind, ...) kind(hapi_state_body, __VA_ARGS__)
    V(NUMBER, generation),
    V(NUMBER, flags),
    V(NUMBER, epoch),
    V(POSE, pose),
    V(TWIST, twist),
    V(EXACT, impulse, 3),
    V(EXACT, angular_impulse, 3),
    V(EXACT, gain, 6),
    V(EXACT, residual, 6),
    V(LONG, owned_until_ns),
    V(FREE_POSE, owned_pose),
    V(TWIST, owned_twist),
    V(NOT, reserved)};

static const hapi_wire_field touch_fields[] = {
#define U(kind, ...) kind(hapi_state_contact, __VA_ARGS__)
    U(NUMBER, slot),
    U(NUMBER, generation),
    U(NUMBER, touches),
    U(FIXED, depth, 1, HAPI_WIRE_POSITION_BITS),
    U(FIXED, force, 3, HAPI_WIRE_FORCE_BITS),
    U(FIXED, ball, 3, HAPI_WIRE_POSITION_BITS),
    U(FIXED, normal, 3, HAPI_WIRE_UNIT_BITS),
    U(NOT, reserved)};

static const hapi_wire_field spring_fields[] = {
#define W(kind, ...) kind(hapi_state_spring, __VA_ARGS__)
    W(NUMBER, slot),
    W(NUMBER, generation),
    W(LONG, key),
    W(FIXED, place, 3, HAPI_WIRE_POSITION_BITS),
    W(SINGLE, stretch_body, 3),
    W(SINGLE, turn, 1)};

static const hapi_wire_field given_fields[] = {
#define I(kind, ...) kind(hapi_state_joint, __VA_ARGS__)
    I(NUMBER, slot),
    I(NUMBER, generation),
    I(NUMBER, body_a),
    I(EXACT, given.seconds, 1),
    I(EXACT, given.impulse, 12),
    I(NOT, reserved)};

static const hapi_wire_field side_fields[] = {
#define D(kind, ...) kind(hapi_tool_side, __VA_ARGS__)
    D(LONG, key),     D(NUMBER, pointer), D(NUMBER, body),
    D(NUMBER, epoch), D(POSE, place),     D(FIXED, way, 3, HAPI_WIRE_POSITION_BITS)};

#define RECORD(name, fields, of, prefix, known, alike)                                 \
  {                                                                                    \
    name, fields, sizeof(fields) / sizeof(fields)[0], sizeof(of), prefix, known, alike \
  }

const hapi_wire_record hapi_wire_records[HAPI_WIRE_KINDS] = {
    [HAPI_WIRE_MODEL] = RECORD("model", model_fields, hapi_model, 0, false, false),
    [HAPI_WIRE_NEAR] = RECORD("near", near_fields, hapi_near, 0, false, false),
    [HAPI_WIRE_TRIANGLE] = RECORD("triangle", triangle_fields, hapi_triangle, 0, true, true),
    [HAPI_WIRE_BODY] = RECORD("body", body_fields, hapi_model_body, 0, true, false),
    [HAPI_WIRE_RESPONSE] = RECORD("response", response_fields, hapi_model_body, 1, false, false),
    [HAPI_WIRE_COURSE] = RECORD("course", course_fields, hapi_model_course, 1, false, false),
    [HAPI_WIRE_CONTACT] = RECORD("contact", contact_fields, hapi_model_contact, 0, false, false),
    [HAPI_WIRE_JOINT] = RECORD("joint", joint_fields, hapi_model_joint, 0, true, false),
    [HAPI_WIRE_MEASURED] =
        RECORD("measured", measured_fields, hapi_measured_joint, 1, false, false),
    [HAPI_WIRE_FEEL] = RECORD("feel", feel_fields, hapi_model_feel, 0, false, false),
    [HAPI_WIRE_PLACED] = RECORD("placed", placed_fields, hapi_near_body, 1, false, false),
    [HAPI_WIRE_VERTEX] = RECORD("vertex", vertex_fields, vertex, 0, true, true),
    [HAPI_WIRE_GEOM] = RECORD("geom", geom_fields, hapi_near_geom, 0, true, true),
    [HAPI_WIRE_PAIR] = RECORD("pair", pair_fields, hapi_near_pair, 0, true, false),
    [HAPI_WIRE_TOOL] = RECORD("tool", tool_fields, hapi_near_tool, 0, true, false),
    [HAPI_WIRE_TOOL_PAIR] =
        RECORD("tool pair", tool_pair_fields, hapi_near_tool_pair, 0, true, false),
    [HAPI_WIRE_HAND] = RECORD("hand", hand_fields, hapi_model_hand, 0, true, false),
    [HAPI_WIRE_STATE] = RECORD("state", state_fields, hapi_state, 0, false, false),
    [HAPI_WIRE_POINTER] = RECORD("pointer", pointer_fields, hapi_state_pointer, 1, true, false),
    [HAPI_WIRE_HULL] = RECORD("hull", hull_fields, hapi_tool_hull, 1, true, false),
    [HAPI_WIRE_MOVED] = RECORD("moved", moved_fields, hapi_state_body, 2, false, false),
    [HAPI_WIRE_TOUCH] = RECORD("touch", touch_fields, hapi_state_contact, 0, false, false),
    [HAPI_WIRE_SPRING] = RECORD("spring", spring_fields, hapi_state_spring, 0, false, false),
    [HAPI_WIRE_GIVEN] = RECORD("given", given_fields, hapi_state_joint, 0, false, false),
    [HAPI_WIRE_SIDE] = RECORD("side", side_fields, hapi_tool_side, 0, false, false),
};

uint32_t hapi_wire_cells(hapi_wire_kind kind)
{
  const hapi_wire_record *r = &hapi_wire_records[kind];
  uint32_t count = r->prefix;
  for (uint32_t i = 0; i < r->field_count; ++i) {
    count += r->fields[i].count;
  }
  HAPI_ASSERT(count <= HAPI_WIRE_CELLS_MOST);
  return count;
}

uint32_t hapi_wire_most(hapi_wire_kind kind, const hapi_capacity *c)
{
  switch (kind) {
    case HAPI_WIRE_MODEL:
    case HAPI_WIRE_NEAR:
    case HAPI_WIRE_STATE:
      return 1;
    case HAPI_WIRE_TRIANGLE:
      return c->triangles;
    case HAPI_WIRE_BODY:
    case HAPI_WIRE_RESPONSE:
    case HAPI_WIRE_COURSE:
    case HAPI_WIRE_PLACED:
    case HAPI_WIRE_MOVED:
      return c->bodies;
    case HAPI_WIRE_CONTACT:
    case HAPI_WIRE_TOOL_PAIR:
    case HAPI_WIRE_TOUCH:
      return c->contacts;
    case HAPI_WIRE_JOINT:
    case HAPI_WIRE_MEASURED:
    case HAPI_WIRE_GIVEN:
      return c->joints;
    case HAPI_WIRE_FEEL:
      return c->feels;
    case HAPI_WIRE_VERTEX:
      return c->hull_points;
    case HAPI_WIRE_GEOM:
      return c->geoms;
    case HAPI_WIRE_PAIR:
      return c->pairs;
    case HAPI_WIRE_TOOL:
    case HAPI_WIRE_HAND:
    case HAPI_WIRE_POINTER:
    case HAPI_WIRE_HULL:
      return c->pointers;
    case HAPI_WIRE_SPRING:
      return c->springs;
    case HAPI_WIRE_SIDE:
      return c->tool_points;
    case HAPI_WIRE_KINDS:
      break;
  }
  return 0;
}

void hapi_wire_find_xor(hapi_wire_kind kind, bool *out)
{
  const hapi_wire_record *r = &hapi_wire_records[kind];
  uint32_t at = r->prefix;
  memset(out, 0, HAPI_WIRE_CELLS_MOST * sizeof *out);
  for (uint32_t i = 0; i < r->field_count; ++i) {
    const hapi_wire_field *f = &r->fields[i];
    for (uint32_t k = 0; k < f->count; ++k) {
      out[at++] = f->type == HAPI_WIRE_EXACT || f->type == HAPI_WIRE_OPEN ||
                  f->type == HAPI_WIRE_LIKE || f->type == HAPI_WIRE_SINGLE;
    }
  }
}

/* ---- struct to cells ---- */

static bool pack_fixed(double value, double steps, uint64_t *out)
{
  double scaled = value * steps;
  if (!(scaled > -HAPI_WIRE_FIXED_MOST && scaled < HAPI_WIRE_FIXED_MOST)) {
    return false;
  }
  *out = (uint64_t)llround(scaled);
  return true;
}

static double steps_of(unsigned bits)
{
  return (double)(UINT64_C(1) << bits);
}

/* Doubles of which all bits travel. */
static bool pack_bits(const hapi_wire_field *f, const double *from, uint64_t *out)
{
  for (uint32_t i = 0; i < f->count; ++i) {
    memcpy(&out[i], &from[i], sizeof out[i]);
    if (f->type == HAPI_WIRE_OPEN ? from[i] != from[i] : !(from[i] - from[i] == 0.0)) {
      return false;
    }
    if (f->type == HAPI_WIRE_LIKE) {
      out[i] ^= (out - f->count)[i];
    }
  }
  return true;
}

static bool pack_doubles(const hapi_wire_field *f, const double *from, uint64_t *out)
{
  double steps = steps_of(f->bits);
  for (uint32_t i = 0; i < f->count; ++i) {
    float single = (float)from[i];
    uint32_t bits;
    if (f->type == HAPI_WIRE_SINGLE) {
      memcpy(&bits, &single, sizeof bits);
      out[i] = bits;
    }
    if (f->type == HAPI_WIRE_SINGLE ? !(single - single == 0.0f)
                                    : !pack_fixed(from[i], steps, &out[i])) {
      return false;
    }
  }
  return true;
}

static bool pack_field(const hapi_wire_field *f, const char *from, const hapi_wire_names *names,
                       uint64_t *out)
{
  uint32_t number;
  hapi_tag tag;
  switch ((hapi_wire_type)f->type) {
    case HAPI_WIRE_U32:
      for (uint32_t i = 0; i < f->count; ++i) {
        memcpy(&number, from + i * sizeof number, sizeof number);
        out[i] = number;
      }
      return true;
    case HAPI_WIRE_U64:
      memcpy(out, from, f->count * sizeof *out);
      return true;
    case HAPI_WIRE_BOOL:
      *out = *(const bool *)from;
      return true;
    case HAPI_WIRE_EXACT:
    case HAPI_WIRE_OPEN:
    case HAPI_WIRE_LIKE:
      return pack_bits(f, (const double *)(const void *)from, out);
    case HAPI_WIRE_SINGLE:
    case HAPI_WIRE_FIXED:
    case HAPI_WIRE_QUAT:
    case HAPI_WIRE_FREE:
      return pack_doubles(f, (const double *)(const void *)from, out);
    case HAPI_WIRE_TAG:
      memcpy(&tag, from, sizeof tag);
      *out = names->tag(names->of, tag);
      return true;
    case HAPI_WIRE_OWN:
      memcpy(&tag, from, sizeof tag);
      *out = tag != NULL;
      return true;
    case HAPI_WIRE_LABEL:
      memcpy(&number, from, sizeof number);
      *out = names->label(names->of, (hapi_wire_kind)f->bits, number);
      return true;
    case HAPI_WIRE_NOT:
      break;
  }
  return true;
}

const char *hapi_wire_pack(hapi_wire_kind kind, const void *from, const hapi_wire_names *names,
                           uint64_t *out_cells)
{
  const hapi_wire_record *r = &hapi_wire_records[kind];
  uint64_t *out = out_cells + r->prefix;
  for (uint32_t i = 0; i < r->field_count; ++i) {
    const hapi_wire_field *f = &r->fields[i];
    if (!pack_field(f, (const char *)from + f->offset, names, out)) {
      return f->name;
    }
    out += f->count;
  }
  return NULL;
}

/* ---- cells to struct ---- */

/* Of a quaternion that was rounded; four zeros stay so. */
static void unpack_quat(const uint64_t *cells, double steps, double *out)
{
  double sum = 0.0;
  for (int i = 0; i < 4; ++i) {
    out[i] = (double)(int64_t)cells[i] / steps;
    sum += out[i] * out[i];
  }
  for (int i = 0; i < 4 && sum > 0.0; ++i) {
    out[i] /= sqrt(sum);
  }
}

static void unpack_doubles(const hapi_wire_field *f, const uint64_t *cells, double *out)
{
  double steps = steps_of(f->bits);
  if (f->type == HAPI_WIRE_QUAT || f->type == HAPI_WIRE_FREE) {
    unpack_quat(cells, steps, out);
    return;
  }
  for (uint32_t i = 0; i < f->count; ++i) {
    if (f->type == HAPI_WIRE_SINGLE) {
      uint32_t bits = (uint32_t)cells[i];
      float single;
      memcpy(&single, &bits, sizeof single);
      out[i] = (double)single;
    } else {
      out[i] = (double)(int64_t)cells[i] / steps;
    }
  }
}

static void unpack_field(const hapi_wire_field *f, const uint64_t *cells, hapi_wire_index_fn index,
                         const void *of, char *out)
{
  uint32_t number;
  uint64_t bits;
  hapi_tag tag;
  switch ((hapi_wire_type)f->type) {
    case HAPI_WIRE_U32:
      for (uint32_t i = 0; i < f->count; ++i) {
        number = (uint32_t)cells[i];
        memcpy(out + i * sizeof number, &number, sizeof number);
      }
      return;
    case HAPI_WIRE_U64:
      memcpy(out, cells, f->count * sizeof *cells);
      return;
    case HAPI_WIRE_BOOL:
      *(bool *)out = cells[0] != 0;
      return;
    case HAPI_WIRE_EXACT:
    case HAPI_WIRE_OPEN:
      memcpy(out, cells, f->count * sizeof *cells);
      return;
    case HAPI_WIRE_LIKE:
      for (uint32_t i = 0; i < f->count; ++i) {
        bits = cells[i] ^ (cells - f->count)[i];
        memcpy(out + i * sizeof bits, &bits, sizeof bits);
      }
      return;
    case HAPI_WIRE_SINGLE:
    case HAPI_WIRE_FIXED:
    case HAPI_WIRE_QUAT:
    case HAPI_WIRE_FREE:
      unpack_doubles(f, cells, (double *)(void *)out);
      return;
    case HAPI_WIRE_TAG:
    case HAPI_WIRE_OWN:
      tag = (hapi_tag)(uintptr_t)cells[0];
      memcpy(out, &tag, sizeof tag);
      return;
    case HAPI_WIRE_LABEL:
      number = index(of, (hapi_wire_kind)f->bits, cells[0]);
      memcpy(out, &number, sizeof number);
      return;
    case HAPI_WIRE_NOT:
      return;
  }
}

void hapi_wire_unpack(hapi_wire_kind kind, const uint64_t *cells, hapi_wire_index_fn index,
                      const void *of, void *out)
{
  const hapi_wire_record *r = &hapi_wire_records[kind];
  cells += r->prefix;
  for (uint32_t i = 0; i < r->field_count; ++i) {
    unpack_field(&r->fields[i], cells, index, of, (char *)out + r->fields[i].offset);
    cells += r->fields[i].count;
  }
}

/* ---- whether cells can be a record ---- */

#define QUAT_OFF 1e-4 /* of the squared length; rounding makes 1.5e-5 */

static bool check_quat(const uint64_t *cells, double steps, bool may_be_zero)
{
  double sum = 0.0;
  for (int i = 0; i < 4; ++i) {
    double part = (double)(int64_t)cells[i] / steps;
    sum += part * part;
  }
  return fabs(sum - 1.0) <= QUAT_OFF || (may_be_zero && sum == 0.0);
}

static bool check_cell(hapi_wire_type type, uint64_t cell)
{
  double fixed = (double)(int64_t)cell;
  switch (type) {
    case HAPI_WIRE_U32:
    case HAPI_WIRE_LABEL:
      return cell <= UINT32_MAX;
    case HAPI_WIRE_BOOL:
    case HAPI_WIRE_OWN:
      return cell <= 1;
    case HAPI_WIRE_EXACT:
    case HAPI_WIRE_LIKE:
      return (cell >> 52 & 0x7ffu) != 0x7ffu;
    case HAPI_WIRE_OPEN:
      return (cell & UINT64_C(0x7fffffffffffffff)) <= UINT64_C(0x7ff0000000000000);
    case HAPI_WIRE_SINGLE:
      return cell <= UINT32_MAX && (cell >> 23 & 0xffu) != 0xffu;
    case HAPI_WIRE_FIXED:
    case HAPI_WIRE_QUAT:
    case HAPI_WIRE_FREE:
      return fixed > -HAPI_WIRE_FIXED_MOST && fixed < HAPI_WIRE_FIXED_MOST;
    case HAPI_WIRE_U64:
    case HAPI_WIRE_TAG:
    case HAPI_WIRE_NOT:
      break;
  }
  return true;
}

const char *hapi_wire_check(hapi_wire_kind kind, const uint64_t *cells)
{
  const hapi_wire_record *r = &hapi_wire_records[kind];
  cells += r->prefix;
  for (uint32_t i = 0; i < r->field_count; ++i) {
    const hapi_wire_field *f = &r->fields[i];
    bool good = true;
    for (uint32_t k = 0; k < f->count; ++k) {
      uint64_t like = f->type == HAPI_WIRE_LIKE ? (cells - f->count)[k] : 0;
      good = good && check_cell((hapi_wire_type)f->type, cells[k] ^ like);
    }
    if (f->type == HAPI_WIRE_QUAT || f->type == HAPI_WIRE_FREE) {
      good = good && check_quat(cells, steps_of(f->bits), f->type == HAPI_WIRE_FREE);
    }
    if (!good) {
      return f->name;
    }
    cells += f->count;
  }
  return NULL;
}

/* ---- what is known by what it is ---- */

#define ALIKE_STEPS 1073741824.0 /* about 1 nm */

uint64_t hapi_wire_alike(hapi_wire_kind kind, const uint64_t *cells)
{
  const hapi_wire_record *r = &hapi_wire_records[kind];
  uint64_t hash = HAPI_HASH_BEGIN;
  for (uint32_t i = 0; i < r->field_count; ++i) {
    const hapi_wire_field *f = &r->fields[i];
    for (uint32_t k = 0; k < f->count; ++k, ++cells) {
      double value;
      uint64_t word = *cells;
      memcpy(&value, cells, sizeof value);
      if (f->type == HAPI_WIRE_EXACT && fabs(value) < 1e9) {
        double steps = value * ALIKE_STEPS;
        word = (uint64_t)(int64_t)(steps + (steps < 0.0 ? -0.5 : 0.5));
      }
      hash = hapi_hash_word(hash, word);
    }
  }
  return hash;
}
