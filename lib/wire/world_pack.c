/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <stdio.h>

#include "base/alloc.h"
#include "base/hash.h"
#include "wire/world.h"

bool hapi_wire_world_out_create(hapi_wire_world_out *world, const hapi_capacity *capacity)
{
  world->capacity = *capacity;
  world->vertex_keys = hapi_alloc_array(capacity->hull_points, sizeof *world->vertex_keys);
  world->bodies = hapi_alloc_array(capacity->bodies, sizeof *world->bodies);
  return hapi_wire_tags_create(&world->tags, capacity->geoms + capacity->contacts) &&
         world->vertex_keys != NULL && world->bodies != NULL;
}

void hapi_wire_world_out_finish(hapi_wire_world_out *world)
{
  hapi_wire_tags_finish(&world->tags);
  hapi_free(world->vertex_keys);
  hapi_free(world->bodies);
  world->vertex_keys = NULL;
  world->bodies = NULL;
}

typedef struct packing {
  hapi_wire_world_out *world;
  hapi_wire_sender *sender;
  hapi_wire_names names;
  hap_detail *detail;
  hap_status status;
} packing;

static uint64_t tag_of(void *of, hapi_tag tag)
{
  packing *p = of;
  return hapi_wire_tag_number(&p->world->tags, tag);
}

static uint64_t label_of(void *of, hapi_wire_kind kind, uint32_t index)
{
  const packing *p = of;
  const hapi_wire_frame *frame = p->sender->now;
  return index < frame->counts[kind] ? frame->labels[kind][index] + UINT64_C(1) : 0;
}

static void pack_refuse(packing *p, hap_status status, hapi_wire_kind kind, const char *why)
{
  if (p->status >= HAP_OK) {
    p->status = status;
    snprintf(p->detail->text, sizeof p->detail->text, "%s %u: %s", hapi_wire_records[kind].name,
             p->sender->now->counts[kind], why);
  }
}

static void pack_bad(packing *p, hapi_wire_kind kind, const char *member)
{
  if (member != NULL && p->status >= HAP_OK) {
    char why[128];
    snprintf(why, sizeof why, "%s is not finite or out of range", member);
    pack_refuse(p, HAP_ERROR_ARGUMENT, kind, why);
  }
}

/* NULL: there is no room. */
static uint64_t *pack_add(packing *p, hapi_wire_kind kind, uint64_t key, const void *from)
{
  uint64_t *cells = hapi_wire_sender_add(p->sender, kind, key);
  if (cells == NULL) {
    pack_refuse(p, HAP_ERROR_CAPACITY, kind, "there is no room for it");
    return NULL;
  }
  pack_bad(p, kind, hapi_wire_pack(kind, from, &p->names, cells));
  return cells;
}

static void pack_alike(packing *p, hapi_wire_kind kind, const uint64_t *key, const void *from)
{
  uint64_t cells[HAPI_WIRE_CELLS_MOST];
  pack_bad(p, kind, hapi_wire_pack(kind, from, &p->names, cells));
  if (!hapi_wire_sender_add_alike(p->sender, kind,
                                  key != NULL ? *key : hapi_wire_alike(kind, cells), cells)) {
    pack_refuse(p, HAP_ERROR_CAPACITY, kind, "there is no room for it");
  }
}

static uint64_t key_of(uint32_t slot, uint32_t generation)
{
  return (uint64_t)slot << 32 | generation;
}

/* ---- the model ---- */

static void pack_bodies(packing *p, hapi_model *model)
{
  const hapi_model_body *bodies = hapi_model_bodies(model);
  memset(p->world->bodies, 0, p->world->capacity.bodies * sizeof *p->world->bodies);
  for (uint32_t i = 0; i < model->body_count; ++i) {
    (void)pack_add(p, HAPI_WIRE_BODY, key_of(bodies[i].slot, bodies[i].generation), &bodies[i]);
    p->world->bodies[bodies[i].slot] = i + 1;
  }
  for (uint32_t i = 0; i < model->body_count && p->status >= HAP_OK; ++i) {
    uint64_t key = key_of(bodies[i].slot, bodies[i].generation);
    uint64_t label = label_of(p, HAPI_WIRE_BODY, i);
    if ((bodies[i].flags & HAPI_BODY_MEASURED) != 0) {
      uint64_t *cells = pack_add(p, HAPI_WIRE_RESPONSE, key, &bodies[i]);
      if (cells != NULL) {
        cells[0] = label;
      }
    }
    if (bodies[i].course != 0) {
      uint64_t *cells =
          pack_add(p, HAPI_WIRE_COURSE, key, &hapi_model_courses(model)[bodies[i].course - 1]);
      if (cells != NULL) {
        cells[0] = label;
      }
    }
  }
}

static void pack_joints(packing *p, hapi_model *model)
{
  for (uint32_t i = 0; i < model->joint_count; ++i) {
    const hapi_model_joint *joint = &hapi_model_joints(model)[i];
    uint64_t key = key_of(joint->slot, joint->generation);
    (void)pack_add(p, HAPI_WIRE_JOINT, key, joint);
    if (joint->kind == HAPI_JOINT_MEASURED) {
      uint64_t *cells = pack_add(p, HAPI_WIRE_MEASURED, key, &joint->measured);
      if (cells != NULL) {
        cells[0] = label_of(p, HAPI_WIRE_JOINT, i);
      }
    }
  }
}

static void pack_hands(packing *p, hapi_model *model)
{
  for (uint32_t i = 0; i < model->hand_count; ++i) {
    const hapi_model_hand *hand = &hapi_model_hands(model)[i];
    uint64_t key = hapi_hash_word(HAPI_HASH_BEGIN, key_of(hand->number, hand->generation));
    key = hapi_hash_doubles(key, hand->hull.points[0], 3 * HAPI_TOOL_POINTS_MAX);
    (void)pack_add(p, HAPI_WIRE_HAND, key, hand);
  }
}

static void pack_model(packing *p, hapi_model *model)
{
  (void)pack_add(p, HAPI_WIRE_MODEL, 0, model);
  for (uint32_t i = 0; i < model->triangle_count; ++i) {
    pack_alike(p, HAPI_WIRE_TRIANGLE, NULL, &hapi_model_triangles(model)[i]);
  }
  pack_bodies(p, model);
  for (uint32_t i = 0; i < model->contact_count; ++i) {
    const hapi_model_contact *contact = &hapi_model_contacts(model)[i];
    (void)pack_add(p, HAPI_WIRE_CONTACT, key_of(contact->slot, contact->generation), contact);
  }
  pack_joints(p, model);
  pack_hands(p, model);
  for (uint32_t i = 0; i < model->feel_count; ++i) {
    const hapi_model_feel *feel = &hapi_model_feels(model)[i];
    (void)pack_add(p, HAPI_WIRE_FEEL, feel->number, feel);
    if ((feel->feel.more & HAPI_FEEL_TEXTURE) != 0 || feel->feel.texture != NULL) {
      pack_refuse(p, HAP_ERROR_UNSUPPORTED, HAPI_WIRE_FEEL,
                  "a surface has a texture, which clients cannot have; take it away");
    }
  }
}

/* ---- the near message ---- */

/* Places of pose and twist among the cells of a placed body. */
#define PLACED_POSE 3u
#define PLACED_CELLS 13u

static void pack_placed(packing *p, hapi_model *model, const hapi_near_body *in)
{
  uint64_t *cells = pack_add(p, HAPI_WIRE_PLACED, key_of(in->slot, in->generation), in);
  uint32_t index = p->world->bodies[in->slot];
  const hapi_model_body *body = index != 0 ? &hapi_model_bodies(model)[index - 1] : NULL;
  bool same = body != NULL && body->generation == in->generation &&
              memcmp(&body->pose, &in->pose, sizeof in->pose) == 0 &&
              memcmp(&body->twist, &in->twist, sizeof in->twist) == 0;
  if (cells != NULL) {
    cells[0] = same;
  }
  if (cells != NULL && same) {
    memset(cells + PLACED_POSE, 0, PLACED_CELLS * sizeof *cells);
  }
}

/* A vertex is known by its hull and its place in it: hulls share corners. */
static void vertex_keys_find(packing *p, hapi_near *near)
{
  const double *points = hapi_near_points(near);
  uint64_t *keys = p->world->vertex_keys;
  for (uint32_t i = 0; i < near->point_count; ++i) {
    keys[i] = hapi_hash_doubles(HAPI_HASH_BEGIN, points + (size_t)3 * i, 3);
  }
  for (uint32_t i = 0; i < near->geom_count; ++i) {
    const hapi_near_geom *geom = &hapi_near_geoms(near)[i];
    uint32_t first = geom->hull_first;
    uint64_t hash = HAPI_HASH_BEGIN;
    if (geom->shape.kind != HAPI_SHAPE_HULL || first > near->point_count ||
        geom->shape.hull_count > near->point_count - first) {
      continue;
    }
    for (uint32_t k = 0; k < geom->shape.hull_count; ++k) {
      uint64_t cells[3];
      memcpy(cells, points + (size_t)3 * (first + k), sizeof cells);
      hash = hapi_hash_word(hash, hapi_wire_alike(HAPI_WIRE_VERTEX, cells));
    }
    for (uint32_t k = 0; k < geom->shape.hull_count; ++k) {
      keys[first + k] = hapi_hash_word(hash, k);
    }
  }
}

static void pack_geoms(packing *p, hapi_near *near)
{
  vertex_keys_find(p, near);
  for (uint32_t i = 0; i < near->point_count; ++i) {
    pack_alike(p, HAPI_WIRE_VERTEX, &p->world->vertex_keys[i],
               hapi_near_points(near) + (size_t)3 * i);
  }
  for (uint32_t i = 0; i < near->geom_count; ++i) {
    pack_alike(p, HAPI_WIRE_GEOM, NULL, &hapi_near_geoms(near)[i]);
  }
}

static void pack_pairs(packing *p, hapi_near *near)
{
  for (uint32_t i = 0; i < near->pair_count; ++i) {
    const hapi_near_pair *pair = &hapi_near_pairs(near)[i];
    uint64_t key = hapi_hash_word(HAPI_HASH_BEGIN, pair->key);
    key = hapi_hash_word(key, label_of(p, HAPI_WIRE_GEOM, pair->geom_a));
    key = hapi_hash_word(key, label_of(p, HAPI_WIRE_GEOM, pair->geom_b));
    (void)pack_add(p, HAPI_WIRE_PAIR, key, pair);
  }
}

static void pack_tools(packing *p, hapi_near *near)
{
  for (uint32_t i = 0; i < near->tool_count; ++i) {
    const hapi_near_tool *tool = &hapi_near_tools(near)[i];
    uint64_t key = hapi_hash_word(HAPI_HASH_BEGIN, key_of(tool->pointer, tool->generation));
    key = hapi_hash_doubles(key, tool->hull.points[0], 3 * HAPI_TOOL_POINTS_MAX);
    (void)pack_add(p, HAPI_WIRE_TOOL, key, tool);
  }
  for (uint32_t i = 0; i < near->tool_pair_count; ++i) {
    const hapi_near_tool_pair *pair = &hapi_near_tool_pairs(near)[i];
    uint64_t key = hapi_hash_word(HAPI_HASH_BEGIN, pair->key);
    key = hapi_hash_word(key, label_of(p, HAPI_WIRE_GEOM, pair->geom));
    key = hapi_hash_word(key, label_of(p, HAPI_WIRE_TOOL, pair->tool));
    (void)pack_add(p, HAPI_WIRE_TOOL_PAIR, key, pair);
  }
}

static void pack_near(packing *p, hapi_model *model, hapi_near *near)
{
  (void)pack_add(p, HAPI_WIRE_NEAR, 0, near);
  if (near->said_count > 0) {
    pack_refuse(p, HAP_ERROR_UNSUPPORTED, HAPI_WIRE_NEAR,
                "the application wants to be asked about contacts, which clients cannot do");
  }
  for (uint32_t i = 0; i < near->body_count; ++i) {
    pack_placed(p, model, &hapi_near_bodies(near)[i]);
  }
  pack_geoms(p, near);
  pack_pairs(p, near);
  pack_tools(p, near);
}

hap_status hapi_wire_world_pack(hapi_wire_world_out *world, hapi_wire_sender *sender,
                                hapi_model *model, hapi_near *near, hap_detail *detail)
{
  packing p = {.world = world, .sender = sender, .detail = detail};
  p.names = (hapi_wire_names){&p, tag_of, label_of};
  if (model->model != HAP_MODEL_CONTACT || model->tool_count > 0 || model->cross_count > 0) {
    snprintf(detail->text, sizeof detail->text,
             "only model CONTACT goes to clients; set it in hap_session_def.model");
    return HAP_ERROR_UNSUPPORTED;
  }
  hapi_wire_sender_begin(sender);
  pack_model(&p, model);
  if (near != NULL && near->model_number == model->number) {
    pack_near(&p, model, near);
  } else {
    static const hapi_near none = {.contact_hz = 1.0};
    (void)pack_add(&p, HAPI_WIRE_NEAR, 0, &none);
  }
  return p.status;
}
