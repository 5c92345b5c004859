/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "wire/state.h"

#include <stdio.h>

#include "base/alloc.h"
#include "base/hash.h"
#include "wire/block.h"

/* ---- to a frame ---- */

typedef struct packing {
  hapi_wire_sender *sender;
  hap_detail *detail;
  hap_status status;
} packing;

/* NULL: there is no room. */
static uint64_t *state_add(packing *p, hapi_wire_kind kind, uint64_t key, const void *from)
{
  uint64_t *cells = hapi_wire_sender_add(p->sender, kind, key);
  const char *bad = cells != NULL ? hapi_wire_pack(kind, from, NULL, cells) : NULL;
  if (p->status >= HAP_OK && (cells == NULL || bad != NULL)) {
    p->status = cells == NULL ? HAP_ERROR_CAPACITY : HAP_ERROR_ARGUMENT;
    snprintf(p->detail->text, sizeof p->detail->text, "%s %u: %s%s", hapi_wire_records[kind].name,
             p->sender->now->counts[kind], bad != NULL ? bad : "there is no room for it",
             bad != NULL ? " is not finite or out of range" : "");
  }
  return cells;
}

/* Place of the gain among the cells of a body. */
#define MOVED_GAIN 24u

/* What all hands gave is often what one body got, bit for bit: then it is told once. */
static void pack_gain(const hapi_state *state, const hapi_state_body *body, uint64_t *cells)
{
  bool same = memcmp(body->gain, state->hand_impulse, sizeof state->hand_impulse) == 0;
  cells[1] = same;
  if (same) {
    memset(cells + MOVED_GAIN, 0, 3 * sizeof *cells);
  }
}

static uint64_t *state_add_at(packing *p, hapi_wire_kind kind, uint64_t key, uint32_t slot,
                              const void *from)
{
  uint64_t *cells = state_add(p, kind, key, from);
  if (cells != NULL) {
    cells[0] = slot;
  }
  return cells;
}

static uint64_t key_of(uint32_t slot, uint32_t generation)
{
  return (uint64_t)slot << 32 | generation;
}

static void pack_pointers(packing *p, hapi_state *state)
{
  for (uint32_t i = 0; i < state->pointer_count; ++i) {
    const hapi_state_pointer *pointer = &hapi_state_pointers(state)[i];
    if (pointer->generation == 0) {
      continue;
    }
    (void)state_add_at(p, HAPI_WIRE_POINTER, key_of(i, pointer->generation), i, pointer);
    if (pointer->is_tool != 0) {
      const hapi_tool_hull *hull = &hapi_state_hulls(state)[i];
      uint64_t key = hapi_hash_word(HAPI_HASH_BEGIN, key_of(i, hull->count));
      key = hapi_hash_doubles(key, hull->points[0], 3 * HAPI_TOOL_POINTS_MAX);
      (void)state_add_at(p, HAPI_WIRE_HULL, key, i, hull);
    }
  }
}

hap_status hapi_wire_state_pack(hapi_wire_sender *sender, hapi_state *state, hap_detail *detail)
{
  packing p = {.sender = sender, .detail = detail};
  hapi_wire_sender_begin(sender);
  (void)state_add(&p, HAPI_WIRE_STATE, 0, state);
  pack_pointers(&p, state);
  for (uint32_t i = 0; i < state->body_high; ++i) {
    const hapi_state_body *body = &hapi_state_bodies(state)[i];
    uint64_t *cells = body->generation != 0 ? state_add_at(&p, HAPI_WIRE_MOVED, i, i, body) : NULL;
    if (cells != NULL) {
      pack_gain(state, body, cells);
    }
  }
  for (uint32_t i = 0; i < state->contact_count; ++i) {
    const hapi_state_contact *c = &hapi_state_contacts(state)[i];
    (void)state_add(&p, HAPI_WIRE_TOUCH, key_of(c->slot, c->generation), c);
  }
  for (uint32_t i = 0; i < state->spring_count; ++i) {
    (void)state_add(&p, HAPI_WIRE_SPRING, i, &hapi_state_springs(state)[i]);
  }
  for (uint32_t i = 0; i < state->joint_count; ++i) {
    const hapi_state_joint *joint = &hapi_state_joints(state)[i];
    (void)state_add(&p, HAPI_WIRE_GIVEN, key_of(joint->slot, joint->generation), joint);
  }
  for (uint32_t i = 0; i < state->side_count; ++i) {
    const hapi_tool_side *side = &hapi_state_sides(state)[i];
    (void)state_add(&p, HAPI_WIRE_SIDE, hapi_hash_word(side->key, side->pointer), side);
  }
  return p.status;
}

/* ---- from a frame ---- */

bool hapi_wire_state_in_create(hapi_wire_state_in *state, const hapi_wire_shape *shape,
                               const hapi_capacity *capacity)
{
  const hapi_capacity *c = capacity;
  hapi_state head = {0};
  size_t size = sizeof head;
  head.bodies_offset = hapi_wire_block_array(&size, c->bodies, sizeof(hapi_state_body));
  head.contacts_offset = hapi_wire_block_array(&size, c->contacts, sizeof(hapi_state_contact));
  head.pointers_offset = hapi_wire_block_array(&size, c->pointers, sizeof(hapi_state_pointer));
  head.hulls_offset = hapi_wire_block_array(&size, c->pointers, sizeof(hapi_tool_hull));
  head.springs_offset = hapi_wire_block_array(&size, c->springs, sizeof(hapi_state_spring));
  head.joints_offset = hapi_wire_block_array(&size, c->joints, sizeof(hapi_state_joint));
  head.sides_offset = hapi_wire_block_array(&size, c->tool_points, sizeof(hapi_tool_side));
  head.pointer_count = c->pointers;
  head.spring_capacity = c->springs;
  state->shape = shape;
  state->capacity = *capacity;
  state->state = hapi_alloc(size);
  if (state->state != NULL) {
    *state->state = head;
  }
  return state->state != NULL;
}

void hapi_wire_state_in_finish(hapi_wire_state_in *state)
{
  hapi_free(state->state);
  memset(state, 0, sizeof *state);
}

typedef struct accepting {
  hapi_wire_state_in *in;
  const hapi_wire_frame *frame;
} accepting;

static uint32_t no_index(const void *of, hapi_wire_kind kind, uint64_t cell)
{
  (void)of;
  (void)kind;
  (void)cell;
  return HAPI_WIRE_NOWHERE; /* no record of a state has a label of another */
}

static uint64_t state_unpack(const accepting *a, hapi_wire_kind kind, uint32_t place, void *out)
{
  const uint64_t *cells = hapi_wire_cells_at(a->frame, a->in->shape, kind, place);
  hapi_wire_unpack(kind, cells, no_index, NULL, out);
  return cells[0];
}

/* Of a record that says its place in the array first: whether it is below most. */
static bool slot_of(const accepting *a, hapi_wire_kind kind, uint32_t place, uint32_t most,
                    uint32_t *out)
{
  uint64_t slot = hapi_wire_cells_at(a->frame, a->in->shape, kind, place)[0];
  *out = (uint32_t)slot;
  return slot < most;
}

static const char *head_accept(const accepting *a)
{
  hapi_state *s = a->in->state;
  const uint32_t *counts = a->frame->counts;
  if (counts[HAPI_WIRE_STATE] != 1) {
    return "it has no head";
  }
  (void)state_unpack(a, HAPI_WIRE_STATE, 0, s);
  s->contact_count = counts[HAPI_WIRE_TOUCH];
  s->spring_count = counts[HAPI_WIRE_SPRING];
  s->joint_count = counts[HAPI_WIRE_GIVEN];
  s->side_count = counts[HAPI_WIRE_SIDE];
  return (uint32_t)s->model <= HAP_MODEL_CONTACT && s->body_high <= a->in->capacity.bodies &&
                 s->time_scale >= 0.0
             ? NULL
             : "its head is out of range";
}

static const char *pointers_accept(const accepting *a)
{
  hapi_state_pointer *pointers = hapi_state_pointers(a->in->state);
  uint32_t most = a->in->capacity.pointers;
  uint32_t slot;
  memset(pointers, 0, most * sizeof *pointers);
  for (uint32_t i = 0; i < a->frame->counts[HAPI_WIRE_POINTER]; ++i) {
    if (!slot_of(a, HAPI_WIRE_POINTER, i, most, &slot) || pointers[slot].generation != 0) {
      return "a pointer's place is out of range, or two have it";
    }
    hapi_state_pointer *p = &pointers[slot];
    (void)state_unpack(a, HAPI_WIRE_POINTER, i, p);
    if (p->generation == 0 || p->bound_count > HAP_FORCES_MAX || p->radius < 0.0 ||
        p->stiffness < 0.0 || p->damping < 0.0 || p->friction < 0.0 || p->finger_radius < 0.0 ||
        p->extent < 0.0) {
      return "a pointer is out of range";
    }
  }
  uint32_t tools = 0;
  for (uint32_t i = 0; i < most; ++i) {
    tools += pointers[i].is_tool != 0;
  }
  if (tools != a->frame->counts[HAPI_WIRE_HULL]) {
    return "not every tool has a hull";
  }
  for (uint32_t i = 0; i < tools; ++i) {
    if (!slot_of(a, HAPI_WIRE_HULL, i, most, &slot) || pointers[slot].is_tool == 0) {
      return "a hull's pointer is none that has one";
    }
    hapi_tool_hull *hull = &hapi_state_hulls(a->in->state)[slot];
    (void)state_unpack(a, HAPI_WIRE_HULL, i, hull);
    if (hull->count == 0 || hull->count > HAPI_TOOL_POINTS_MAX) {
      return "a hull has no points, or too many";
    }
    for (uint32_t k = 0; k < i; ++k) {
      uint32_t other;
      if (slot_of(a, HAPI_WIRE_HULL, k, most, &other) && other == slot) {
        return "two hulls are of one pointer";
      }
    }
  }
  return NULL;
}

static const char *bodies_accept(const accepting *a)
{
  hapi_state_body *bodies = hapi_state_bodies(a->in->state);
  uint32_t high = a->in->state->body_high;
  uint32_t slot;
  memset(bodies, 0, high * sizeof *bodies);
  for (uint32_t i = 0; i < a->frame->counts[HAPI_WIRE_MOVED]; ++i) {
    if (!slot_of(a, HAPI_WIRE_MOVED, i, high, &slot) || bodies[slot].generation != 0) {
      return "a body's slot is out of range, or two have it";
    }
    (void)state_unpack(a, HAPI_WIRE_MOVED, i, &bodies[slot]);
    uint64_t same = hapi_wire_cells_at(a->frame, a->in->shape, HAPI_WIRE_MOVED, i)[1];
    if (same == 1) {
      memcpy(bodies[slot].gain, a->in->state->hand_impulse, sizeof a->in->state->hand_impulse);
    }
    if (bodies[slot].generation == 0 || same > 1) {
      return "a body's generation is 0, or its gain is of no kind";
    }
  }
  return NULL;
}

static const char *rest_accept(const accepting *a)
{
  hapi_state *s = a->in->state;
  const hapi_capacity *c = &a->in->capacity;
  for (uint32_t i = 0; i < s->contact_count; ++i) {
    hapi_state_contact *contact = &hapi_state_contacts(s)[i];
    (void)state_unpack(a, HAPI_WIRE_TOUCH, i, contact);
    if (contact->slot >= c->contacts) {
      return "a contact's slot is out of range";
    }
  }
  for (uint32_t i = 0; i < s->spring_count; ++i) {
    hapi_state_spring *spring = &hapi_state_springs(s)[i];
    (void)state_unpack(a, HAPI_WIRE_SPRING, i, spring);
    if (spring->slot != HAPI_SLOT_NONE && spring->slot >= c->contacts) {
      return "a spring's contact is out of range";
    }
  }
  for (uint32_t i = 0; i < s->joint_count; ++i) {
    hapi_state_joint *joint = &hapi_state_joints(s)[i];
    (void)state_unpack(a, HAPI_WIRE_GIVEN, i, joint);
    if (joint->slot >= c->joints || joint->body_a >= c->bodies) {
      return "a joint's slot or body is out of range";
    }
  }
  for (uint32_t i = 0; i < s->side_count; ++i) {
    hapi_tool_side *side = &hapi_state_sides(s)[i];
    (void)state_unpack(a, HAPI_WIRE_SIDE, i, side);
    if (side->pointer >= c->pointers || (side->body != HAPI_SLOT_NONE && side->body >= c->bodies)) {
      return "a side's pointer or body is out of range";
    }
  }
  return NULL;
}

const char *hapi_wire_state_accept(void *of, const hapi_wire_frame *frame)
{
  const accepting a = {of, frame};
  const char *bad = head_accept(&a);
  bad = bad == NULL ? pointers_accept(&a) : bad;
  bad = bad == NULL ? bodies_accept(&a) : bad;
  bad = bad == NULL ? rest_accept(&a) : bad;
  a.in->fresh = bad == NULL;
  return bad;
}

bool hapi_wire_state_give(hapi_wire_state_in *in, hapi_state *out)
{
  hapi_state *from = in->state;
  if (!in->fresh) {
    return false;
  }
  in->fresh = false;
  hapi_state head = *from;
  head.pointer_count = out->pointer_count;
  head.spring_capacity = out->spring_capacity;
  head.bodies_offset = out->bodies_offset;
  head.contacts_offset = out->contacts_offset;
  head.pointers_offset = out->pointers_offset;
  head.hulls_offset = out->hulls_offset;
  head.springs_offset = out->springs_offset;
  head.joints_offset = out->joints_offset;
  head.sides_offset = out->sides_offset;
  head.spring_count =
      head.spring_count < head.spring_capacity ? head.spring_count : head.spring_capacity;
  *out = head;
#define GIVE(array, count) \
  hapi_wire_block_copy(array(out), array(from), out->count, sizeof *array(out))
  GIVE(hapi_state_bodies, body_high);
  GIVE(hapi_state_contacts, contact_count);
  GIVE(hapi_state_pointers, pointer_count);
  GIVE(hapi_state_hulls, pointer_count);
  GIVE(hapi_state_springs, spring_count);
  GIVE(hapi_state_joints, joint_count);
  GIVE(hapi_state_sides, side_count);
  return true;
}
