/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"
#include "base/clock.h"
#include "base/log.h"
#include "base/pointer_id.h"
#include "base/pose.h"
#include "base/vec.h"
#include "near/ahead.h"
#include "near/fields.h"
#include "near/near.h"
#include "proximity/constrained_ball.h"

/* Neighbours: the bodies that a pointer may touch before the next sync (paper section 4.1). In two
 * passes. Before the global step the space is asked for what is near; its geoms are clean then, and
 * asking moves nothing in its lists. After the step the nearest points are taken. */

#define REACH_FLOOR 0.005       /* m */
#define DEPTH_MOST 1.0          /* m, of a touch: what is deeper has been left behind */
#define REACH_ACCELERATION 15.0 /* m/s^2: a hand, or a body that is hit */

bool hapi_neighbors_create(hapi_nearby *nearby)
{
  return hapi_cover_create(&nearby->neighbors.cover) && hapi_relief_create(nearby);
}

void hapi_neighbors_finish(hapi_nearby *nearby)
{
  hapi_cover_finish(&nearby->neighbors.cover);
  hapi_relief_finish(nearby);
  hapi_feels_finish(&nearby->neighbors.feels);
}

void hapi_neighbors_reset(hapi_nearby *nearby)
{
  hapi_feels_clear(&nearby->neighbors.feels);
}

void hapi_neighbors_forget_feel(hapi_nearby *nearby, dGeomID geom)
{
  uint64_t name = geom != NULL ? hapi_geom_names_find(&nearby->tools.names, geom) : 0;
  if (geom == NULL || name != 0) {
    hapi_feels_renew(&nearby->neighbors.feels, name);
  }
}

double hapi_neighbors_reach(double relative_speed, double horizon_s)
{
  return REACH_FLOOR + relative_speed * horizon_s + REACH_ACCELERATION * horizon_s * horizon_s;
}

/* How many geoms are near is the world's affair: the lists grow as they must. */
static bool grow_lists(hapi_neighbors *hood)
{
  uint32_t capacity = 2 * hood->candidate_capacity;
  hapi_candidate *candidates = hapi_alloc_array(capacity, sizeof *candidates);
  hapi_hit *hits = hapi_alloc_array(capacity, sizeof *hits);
  if (candidates == NULL || hits == NULL) {
    hapi_free(candidates);
    hapi_free(hits);
    return false;
  }
  memcpy(candidates, hood->candidates, hood->candidate_count * sizeof *candidates);
  hapi_free(hood->candidates);
  hapi_free(hood->hits);
  hood->candidates = candidates;
  hood->hits = hits;
  hood->candidate_capacity = capacity;
  return true;
}

static void collect_geom(void *data, dGeomID a, dGeomID b)
{
  hapi_nearby *nearby = data;
  hapi_neighbors *hood = &nearby->neighbors;
  dGeomID geom = a == hood->probe_geom ? b : a;
  if (dGeomIsSpace(geom)) {
    dSpaceCollide2(hood->probe_geom, geom, data, collect_geom);
    return;
  }
  const hapi_state_pointer *pointer =
      &hapi_state_pointers(nearby->cycle->state)[hood->current_pointer];
  if (!dGeomIsEnabled(geom) || dGeomGetClass(geom) == dRayClass ||
      (dGeomGetCategoryBits(geom) & pointer->collide_bits) == 0) {
    return;
  }
  if (hood->candidate_count == hood->candidate_capacity && !grow_lists(hood)) {
    ++nearby->counts.dropped;
    return;
  }
  HAPI_ASSERT(hood->candidate_count < hood->candidate_capacity);
  hapi_candidate *candidate = &hood->candidates[hood->candidate_count++];
  candidate->geom = geom;
  candidate->pointer = hood->current_pointer;
  candidate->reach = hood->current_reach;
}

/* m: how deep the pointer is in what it touched at the loop's last message. What is that far in
 * front of it belongs to the touch. */
static double deepest_touch(const hapi_nearby *nearby, uint32_t pointer)
{
  double deepest = hapi_tool_depth(nearby, pointer);
  for (uint32_t i = 0; i < nearby->slots.contact_high; ++i) {
    const hapi_contact_slot *slot = &nearby->slots.contacts[i];
    if (slot->phase == HAPI_SLOT_LIVE && slot->pointer == pointer && slot->last_touch.touched) {
      deepest = fmax(deepest, slot->last_touch.depth);
    }
  }
  return deepest;
}

void hapi_neighbors_collect(hapi_nearby *nearby)
{
  hapi_neighbors *hood = &nearby->neighbors;
  hood->candidate_count = 0;
  hood->feels.reach = fmax(hood->feels.reach_now, nearby->world->ode.magnet_reach);
  hood->feels.reach_now = 0.0;
  if (nearby->cycle->state == NULL) {
    return;
  }
  const hapi_state_pointer *pointers = hapi_state_pointers(nearby->cycle->state);
  hood->fastest = nearby->world->bodies.fastest;
  for (uint32_t i = 0; i < nearby->slots.body_high; ++i) { /* what the loop moved since the scan */
    uint32_t index = nearby->slots.bodies[i].known;
    hapi_known_body *known = index != HAPI_NONE ? &nearby->world->bodies.entries[index] : NULL;
    double speed = known != NULL ? hapi_extent_speed(known) : 0.0;
    hood->fastest = speed > hood->fastest ? speed : hood->fastest;
    if (known != NULL && known->slot == i) { /* others are counted by the scan */
      hapi_extent_rest(known, speed);
    }
  }
  hapi_cover_begin(&hood->cover);
  for (uint32_t i = 0; i < nearby->cycle->state->pointer_count; ++i) {
    if (pointers[i].generation == 0) {
      continue;
    }
    const double *at = pointers[i].pose.position;
    bool is_tool = pointers[i].is_tool != 0;
    double size = is_tool ? pointers[i].extent : pointers[i].radius;
    double speed = hood->fastest + hapi_v3_norm(pointers[i].twist.linear);
    speed += is_tool ? size * hapi_v3_norm(pointers[i].twist.angular) : 0.0;
    double reach = hapi_neighbors_reach(speed, hapi_cycle_horizon(nearby->cycle, 2.0)) +
                   fmin(deepest_touch(nearby, i), DEPTH_MOST) + hood->feels.reach;
    hood->current_pointer = i;
    hood->current_reach = reach;
    dGeomSphereSetRadius(hood->probe_geom, size + reach);
    dGeomSetPosition(hood->probe_geom, at[0], at[1], at[2]);
    dGeomSetCollideBits(hood->probe_geom, ~0ul);
    dGeomSetCategoryBits(hood->probe_geom, ~0ul);
    const hapi_cover_question question = {&nearby->world->spaces, HAPI_SPACES_ALL,
                                          hood->probe_geom};
    hapi_cover_ask(&hood->cover, &question, nearby, collect_geom);
  }
}

/* Of a geom's body; false: it has none that is known. */
static bool geom_twist(const hapi_nearby *nearby, dGeomID geom, dBodyID *out_body, hap_twist *out)
{
  *out_body = hapi_geom_body(nearby->world, geom);
  uint32_t known = hapi_bodies_find(&nearby->world->bodies, *out_body);
  if (known != HAPI_NONE) {
    hapi_extent_twist(&nearby->world->bodies.entries[known], out);
  } else if (*out_body != NULL) {
    hapi_twist_read(*out_body, out);
  }
  return *out_body != NULL;
}

double hapi_neighbors_speed(const hapi_nearby *nearby, dGeomID geom,
                            const hapi_state_pointer *pointer, const double point[3])
{
  double velocity[3] = {0.0, 0.0, 0.0};
  dBodyID body;
  hap_twist twist;
  if (geom_twist(nearby, geom, &body, &twist)) {
    double arm[3];
    hapi_v3_sub(point, dBodyGetPosition(body), arm);
    hapi_v3_cross(twist.angular, arm, velocity);
    hapi_v3_add(velocity, twist.linear, velocity);
  }
  double difference[3];
  hapi_v3_sub(pointer->twist.linear, velocity, difference);
  return hapi_v3_norm(difference);
}

double hapi_neighbors_spin(const hapi_nearby *nearby, dGeomID geom, double distance)
{
  dBodyID body;
  hap_twist twist;
  return geom_twist(nearby, geom, &body, &twist) ? distance * hapi_v3_norm(twist.angular) : 0.0;
}

/* A search about a geom: from where a pointer would be if it could not enter it. */
typedef struct side_search {
  hapi_nearby *nearby;
  dGeomID geom;
  dBodyID body; /* NULL: static */
  double radius;
  double reach;
  bool mesh;
  uint32_t triangles; /* of a mesh, in nearby->meshes.found */
} side_search;

static void side_to_body(const side_search *s, const double point[3], double out[3])
{
  hapi_v3_copy(point, out);
  if (s->body != NULL) {
    hapi_pose_unpoint(dBodyGetPosition(s->body), dBodyGetQuaternion(s->body), point, out);
  }
}

static void side_to_world(const side_search *s, const double point[3], double out[3])
{
  hapi_v3_copy(point, out);
  if (s->body != NULL) {
    hapi_pose_point(dBodyGetPosition(s->body), dBodyGetQuaternion(s->body), point, out);
  }
}

/* The triangles that the ball may meet on its way between the two places of the body's frame. */
static void side_gather(side_search *s, const double from[3], const double to[3])
{
  double box[6];
  double ends[2][3];
  side_to_world(s, from, ends[0]);
  side_to_world(s, to, ends[1]);
  for (int k = 0; k < 3; ++k) {
    box[2 * k] = fmin(ends[0][k], ends[1][k]) - s->reach - s->radius;
    box[2 * k + 1] = fmax(ends[0][k], ends[1][k]) + s->reach + s->radius;
  }
  uint64_t walk = s->nearby->cycle->model_number + 1; /* of this cycle */
  s->triangles = hapi_mesh_near(s->nearby, s->geom, box, walk);
}

/* Nearest points of a ball of the pointer's size at a place of the body's frame. */
static bool side_nearest(const side_search *s, const double at[3], hapi_nearest *out)
{
  double center[3];
  side_to_world(s, at, center);
  bool found =
      s->mesh && s->triangles < HAPI_NEAR_TRIANGLES
          ? hapi_triangles_nearest(&s->nearby->meshes, s->triangles, center, s->radius, out)
          : hapi_geom_nearest(s->nearby, s->geom, center, s->radius, s->reach, out);
  if (found && s->body != NULL) {
    side_to_body(s, out->point_b, out->point_b);
    hapi_quat_unrotate(dBodyGetQuaternion(s->body), out->normal, out->normal);
  }
  return found;
}

/* A pointer that touched at the loop's last message is felt from the side that it is on. False: it
 * has left the geom. */
static bool nearest_of_side(hapi_nearby *nearby, const hapi_candidate *candidate,
                            const hapi_contact_slot *slot, const double center[3], double radius,
                            hapi_nearest *out)
{
  hapi_constrained_ball ball = {.known = true, .outside = radius};
  hapi_ball_search search;
  hapi_nearest here;
  double at[3];
  double way[3];
  side_search s = {.nearby = nearby,
                   .geom = candidate->geom,
                   .body = hapi_geom_body(nearby->world, candidate->geom),
                   .radius = radius,
                   .mesh = dGeomGetClass(candidate->geom) == dTriMeshClass};
  hapi_v3_copy(slot->last_touch.ball, ball.ball);
  hapi_v3_copy(slot->last_touch.ball, ball.center);
  hapi_v3_copy(slot->last_touch.normal, ball.normal);
  side_to_body(&s, center, at);
  hapi_v3_sub(at, ball.center, way);
  s.reach = candidate->reach + hapi_v3_norm(way);
  if (s.mesh) {
    side_gather(&s, ball.center, at);
  }
  bool near = side_nearest(&s, at, &here);
  if (!hapi_ball_is_free(&ball, at, radius, near ? &here : NULL)) {
    hapi_ball_search_begin(&ball, at, radius, near ? &here : NULL, &search);
    while (hapi_ball_search_asks(&ball, &search)) {
      hapi_nearest there;
      bool found = side_nearest(&s, search.ask, &there);
      hapi_ball_search_answer(&ball, &search, found ? &there : NULL);
    }
    near = hapi_ball_search_end(&ball, &search, &here);
  }
  if (!ball.held &&
      hapi_geom_nearest(nearby, candidate->geom, center, radius, candidate->reach, out)) {
    return true;
  }
  *out = here;
  if (near && s.body != NULL) {
    side_to_world(&s, out->point_b, out->point_b);
    hapi_quat_rotate(dBodyGetQuaternion(s.body), out->normal, out->normal);
  }
  return near;
}

/* What the loop last told of the contact; NULL: nothing that is of use. */
static const hapi_contact_slot *touch_of(hapi_nearby *nearby, const hapi_candidate *candidate,
                                         const hapi_state_pointer *pointer)
{
  dBodyID body = hapi_geom_body(nearby->world, candidate->geom);
  uint32_t known = hapi_bodies_find(&nearby->world->bodies, body);
  uint32_t of = known != HAPI_NONE ? nearby->world->bodies.entries[known].slot : HAPI_SLOT_NONE;
  if (body != NULL && of == HAPI_NONE) {
    return NULL;
  }
  const hapi_contact_slot *slot =
      hapi_slots_find_contact(nearby, of, candidate->geom, candidate->pointer, pointer->generation);
  bool moved =
      slot != NULL && body != NULL && slot->last_touch.epoch != nearby->slots.bodies[of].epoch;
  return slot != NULL && slot->last_touch.touched && !moved ? slot : NULL;
}

/* Nearest points for where the pointer will be at the time of the model, which is later than now in
 * model IMPULSE; where that would put its centre inside the body, for where it is now. */
static bool find_nearest(hapi_nearby *nearby, const hapi_candidate *candidate, hapi_hit *hit)
{
  hapi_nearest *out = &hit->nearest;
  const hapi_state_pointer *pointer =
      &hapi_state_pointers(nearby->cycle->state)[candidate->pointer];
  const hapi_contact_slot *touch = touch_of(nearby, candidate, pointer);
  double ahead = hapi_cycle_steps_to_now(nearby->cycle) ? 0.0 : nearby->cycle->probe_step_s;
  double there[3];
  hapi_v3_madd(pointer->pose.position, ahead, pointer->twist.linear, there);
  double radius = pointer->radius;
  bool found = touch != NULL ? nearest_of_side(nearby, candidate, touch, there, radius, out)
                             : hapi_geom_nearest(nearby, candidate->geom, there, radius,
                                                 candidate->reach, out);
  if (touch == NULL && (!found || out->distance < -radius)) {
    found = hapi_geom_nearest(nearby, candidate->geom, pointer->pose.position, radius,
                              candidate->reach, out);
  }
  if (!found) {
    return false;
  }
  hit->reach =
      hapi_neighbors_reach(hapi_neighbors_speed(nearby, candidate->geom, pointer, out->point_b),
                           hapi_cycle_horizon(nearby->cycle, 1.0));
  return out->distance <= hit->reach + nearby->neighbors.feels.reach;
}

static bool find_hit(hapi_nearby *nearby, const hapi_candidate *candidate, hapi_hit *out)
{
  out->tool_count = 0;
  return hapi_state_pointers(nearby->cycle->state)[candidate->pointer].is_tool != 0
             ? hapi_tool_find(nearby, candidate, out)
             : find_nearest(nearby, candidate, out);
}

/* What the application says of the pair. False: the pointer does not feel the geom, or it is too
 * far for that. */
static bool hit_is_felt(hapi_nearby *nearby, const hapi_candidate *candidate, hapi_hit *io)
{
  return hapi_feels_ask(nearby, candidate->pointer, candidate->geom, &io->said) &&
         io->nearest.distance <= io->reach + io->said.reach;
}

static int hit_by_distance(const void *a, const void *b)
{
  double x = ((const hapi_hit *)a)->nearest.distance;
  double y = ((const hapi_hit *)b)->nearest.distance;
  return (x > y) - (x < y);
}

static void place_contact(hapi_nearby *nearby, hapi_contact_slot *slot, const hapi_hit *hit,
                          const hapi_state_pointer *pointer)
{
  dBodyID body = hapi_geom_body(nearby->world, hit->geom);
  double normal[3];
  hapi_v3_copy(hit->nearest.point_b, slot->point_body);
  HAPI_ASSERT_UNIT(hit->nearest.normal);
  hapi_v3_copy(hit->nearest.normal, normal);
  if (body != NULL) {
    const dReal *q = dBodyGetQuaternion(body);
    hapi_pose_unpoint(dBodyGetPosition(body), q, hit->nearest.point_b, slot->point_body);
    hapi_quat_unrotate(q, hit->nearest.normal, normal);
  }
  /* The shape itself, in the body's frame, for the loop to ask. */
  hap_pose world = {{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
  hap_effect_wish wish = hapi_wish(nearby->cycle->wishes, HAP_EFFECT_SHAPE);
  slot->has_shape = hapi_shape_of_geom(hit->geom, &slot->shape, &world);
  bool relief = !slot->has_shape && nearby->cycle->model == HAP_MODEL_CONTACT &&
                hapi_geom_has_triangles(hit->geom);
  slot->shape_reason = !slot->has_shape && !relief            ? HAP_REASON_NO_CLOSED_FORM
                       : slot->shape.kind == HAPI_SHAPE_PLANE ? HAP_REASON_FLAT
                                                              : HAP_REASON_CALLED;
  if (wish == HAP_EFFECT_AUTO && slot->shape_reason == HAP_REASON_CALLED &&
      !nearby->cycle->settings.shapes) {
    slot->shape_reason = HAP_REASON_ACCURACY;
  }
  if (wish == HAP_EFFECT_OFF ||
      (wish == HAP_EFFECT_AUTO && slot->shape_reason != HAP_REASON_CALLED)) {
    slot->has_shape = false;
  }
  if (relief && (wish == HAP_EFFECT_ON ||
                 (wish == HAP_EFFECT_AUTO && slot->shape_reason == HAP_REASON_CALLED))) {
    double speed = hapi_neighbors_speed(nearby, hit->geom, pointer, pointer->pose.position);
    double within = hapi_neighbors_reach(speed, hapi_cycle_horizon(nearby->cycle, 2.0));
    double least = REACH_FLOOR + speed * hapi_cycle_horizon(nearby->cycle, 1.0);
    hapi_relief_note(nearby, hit->geom, pointer, pointer->radius + within, pointer->radius + least,
                     slot);
  }
  slot->shape_pose = world;
  if (slot->has_shape && body != NULL) {
    hapi_pose_into(dBodyGetPosition(body), dBodyGetQuaternion(body), &world, &slot->shape_pose);
  }
  hapi_v3_copy(normal, slot->normal_body);
  hapi_v3_copy(hit->nearest.point_b, slot->point_world);
  slot->distance = hit->nearest.distance;
  slot->placed = true;
  slot->hidden = hit->hidden;
  slot->last_touch.epoch =
      slot->body != HAPI_SLOT_NONE ? nearby->slots.bodies[slot->body].epoch : 0;
  slot->speed = hapi_neighbors_speed(nearby, hit->geom, pointer, hit->nearest.point_b);
  slot->stiffness = pointer->stiffness;
  slot->finger_radius = pointer->finger_radius;
}

static uint32_t body_of_hit(const hapi_nearby *nearby, const hapi_hit *hit)
{
  return hapi_bodies_find(&nearby->world->bodies, hapi_geom_body(nearby->world, hit->geom));
}

/* What is only near finds its place when it is touched: farther ones lose theirs then. */
static void say_crowded(hapi_nearby *nearby, const hapi_hit *hit)
{
  if (hit->nearest.distance < 0.0) {
    hapi_say_once(nearby->cycle, &nearby->neighbors.said_crowded,
                  "a pointer touches more than the session has room for: what finds none is not "
                  "felt, and the force is too small; give more max_bodies and max_contacts");
  }
}

/* Once the walk has ended. What it had no room for may be touched before a model comes that has it:
 * then it answers with its mass, or is not felt. */
static void ahead_tell(hapi_nearby *nearby)
{
  nearby->counts.ahead_all += nearby->counts.ahead_dropped;
  if (nearby->counts.ahead_dropped > 0 && nearby->cycle->config->look_ahead_s > 0.0) {
    hapi_say_once(
        nearby->cycle, &nearby->neighbors.said_ahead,
        "looking ahead (hap_expert_def.look_ahead) finds more bodies than the session has "
        "room or a tick has time for: the force may be wrong where they are touched "
        "(hap_stats.ahead.dropped); give more max_bodies and max_contacts");
  }
}

/* Bodies and contacts of the model by their distance alone, also when farther ones hold all places:
 * those lose them then. */
static uint32_t choose_hits(hapi_nearby *nearby, uint32_t count)
{
  hapi_hit *hits = nearby->neighbors.hits;
  uint32_t bodies = 0;
  uint32_t chosen = 0;
  uint32_t contacts = 0;
  for (uint32_t i = 0; i < count; ++i) {
    bool has_body = hapi_geom_body(nearby->world, hits[i].geom) != NULL;
    uint32_t index = body_of_hit(nearby, &hits[i]);
    bool known = index != HAPI_NONE;
    bool counted = known && hapi_nearby_chose(nearby, index, nearby->cycle->model_number + 1);
    uint32_t more = hits[i].tool_count > 0 ? hits[i].tool_count : 1;
    bool room = contacts + more <= nearby->cycle->config->capacity.contacts &&
                (!has_body || known) &&
                (!known || counted || bodies < nearby->cycle->config->max_bodies);
    if (!room) {
      ++nearby->counts.dropped;
      ++nearby->counts.ahead_dropped;
      say_crowded(nearby, &hits[i]);
      continue;
    }
    if (known && !counted) {
      nearby->visits[index].chosen_in = nearby->cycle->model_number + 1;
      ++bodies;
    }
    contacts += more;
    hits[chosen++] = hits[i];
  }
  return chosen;
}

/* What the chosen hits have already is kept from those that need a new place. */
static void keep_places(hapi_nearby *nearby, const hapi_hit *hit)
{
  uint32_t index = body_of_hit(nearby, hit);
  uint32_t slot = index != HAPI_NONE ? nearby->world->bodies.entries[index].slot : HAPI_SLOT_NONE;
  uint32_t generation = hapi_state_pointers(nearby->cycle->state)[hit->pointer].generation;
  if (hit->tool_count > 0) {
    hapi_tool_keep_places(nearby, hit, slot);
    return;
  }
  hapi_contact_slot *contact =
      hapi_slots_find_contact(nearby, slot, hit->geom, hit->pointer, generation);
  if (contact != NULL) {
    contact->wanted = true;
  }
}

static void take_body(hapi_body_slot *local, dBodyID body)
{
  local->wanted = true;
  local->mass = hapi_body_mass(body);
  local->flags = dBodyIsKinematic(body)  ? HAPI_BODY_DRIVEN
                 : !dBodyIsEnabled(body) ? HAPI_BODY_RESTING
                                         : 0;
}

static void take_hit(hapi_nearby *nearby, const hapi_hit *hit)
{
  dBodyID body = hapi_geom_body(nearby->world, hit->geom);
  const hapi_state_pointer *pointer = &hapi_state_pointers(nearby->cycle->state)[hit->pointer];
  uint32_t slot = body != NULL ? hapi_slots_body(nearby, body_of_hit(nearby, hit)) : HAPI_SLOT_NONE;
  hapi_contact_slot *contact = NULL;
  if (hit->tool_count > 0 && (body == NULL || slot != HAPI_NONE)) {
    hapi_tool_take(nearby, hit, slot);
    if (body != NULL) {
      take_body(&nearby->slots.bodies[slot], body);
    }
    return;
  }
  if (body == NULL || slot != HAPI_NONE) {
    contact = hapi_slots_contact(nearby, slot, hit->geom, hit->pointer, pointer->generation);
  }
  if (contact == NULL) {
    ++nearby->counts.dropped; /* until the loop has let go of an old slot */
    return;
  }
  contact->wanted = true;
  place_contact(nearby, contact, hit, pointer);
  contact->said = (hapi_contact_said){hit->said.mu, hit->said.feel};
  contact->geom_number =
      hapi_geom_names_get(&nearby->tools.names, hit->geom, nearby->cycle->model_number + 1);
  if (body != NULL) {
    take_body(&nearby->slots.bodies[slot], body);
  }
}

/* ---- seams, as in local/seams.h: for what the tick cannot ask the shape of ---- */

#define SEAM_SHARE 0.01 /* of the pointer's radius */
#define SEAM_MOST 1e-4  /* m */

/* The tick does: of both it asks the shape. */
static bool tick_hides(const hapi_nearby *nearby, dGeomID a, dGeomID b)
{
  hapi_shape shape;
  hap_pose pose;
  hap_effect_wish wish = hapi_wish(nearby->cycle->wishes, HAP_EFFECT_SHAPE);
  bool asks = wish == HAP_EFFECT_ON || (wish == HAP_EFFECT_AUTO && nearby->cycle->settings.shapes);
  return nearby->cycle->model == HAP_MODEL_CONTACT && asks &&
         hapi_shape_of_geom(a, &shape, &pose) && hapi_shape_of_geom(b, &shape, &pose);
}

static bool box_holds(dGeomID geom, const double point[3], double slack)
{
  dReal box[6];
  dGeomGetAABB(geom, box);
  for (int k = 0; k < 3; ++k) {
    if (point[k] < box[2 * k] - slack || point[k] > box[2 * k + 1] + slack) {
      return false;
    }
  }
  return true;
}

/* Whether the point that was found on the one lies on the other. */
static bool hit_lies_on(hapi_nearby *nearby, const hapi_hit *hit, dGeomID geom, double step)
{
  hapi_nearest there;
  return box_holds(geom, hit->nearest.point_b, step) &&
         hapi_geom_nearest(nearby, geom, hit->nearest.point_b, 0.0, step, &there);
}

static double seam_step(const hapi_nearby *nearby, const hapi_hit *hit)
{
  double radius = hapi_state_pointers(nearby->cycle->state)[hit->pointer].radius;
  return fmin(SEAM_SHARE * radius, SEAM_MOST);
}

static bool hits_adjoin(hapi_nearby *nearby, const hapi_hit *a, const hapi_hit *b)
{
  double step = seam_step(nearby, a);
  return a->pointer == b->pointer && a->tool_count == 0 && b->tool_count == 0 &&
         (box_holds(b->geom, a->nearest.point_b, step) ||
          box_holds(a->geom, b->nearest.point_b, step)) &&
         !tick_hides(nearby, a->geom, b->geom) &&
         (hit_lies_on(nearby, a, b->geom, step) || hit_lies_on(nearby, b, a->geom, step));
}

/* Also by a third one: the corners of four meet. */
static bool hits_are_surface(hapi_nearby *nearby, const hapi_hit *a, const hapi_hit *b,
                             uint32_t count)
{
  const hapi_hit *hits = nearby->neighbors.hits;
  bool one = hits_adjoin(nearby, a, b);
  for (uint32_t k = 0; k < count && !one; ++k) {
    one = hits[k].seams && &hits[k] != a && &hits[k] != b && hits_adjoin(nearby, a, &hits[k]) &&
          hits_adjoin(nearby, &hits[k], b);
  }
  return one;
}

/* Whether the sphere would not touch the other geom where one alone would hold it. */
static bool hold_clears(hapi_nearby *nearby, const hapi_hit *by, const hapi_hit *other)
{
  double radius = hapi_state_pointers(nearby->cycle->state)[other->pointer].radius;
  double held[3];
  hapi_nearest there;
  hapi_v3_madd(by->nearest.point_b, radius, by->nearest.normal, held);
  return !hapi_geom_nearest(nearby, other->geom, held, radius, radius, &there) ||
         there.distance > -seam_step(nearby, other);
}

/* Marks the hits that adjoin others. False: none do, which is the usual case. */
static bool seams_find(hapi_nearby *nearby, uint32_t count)
{
  hapi_hit *hits = nearby->neighbors.hits;
  bool any = false;
  for (uint32_t i = 0; i < count; ++i) {
    hits[i].hidden = hits[i].aside = hits[i].seams = false;
    for (uint32_t k = 0; k < i; ++k) {
      if (hits_adjoin(nearby, &hits[k], &hits[i])) {
        any = hits[i].seams = hits[k].seams = true;
      }
    }
  }
  return any;
}

static bool seam_between(hapi_nearby *nearby, const hapi_hit *a, const hapi_hit *b, uint32_t count)
{
  return a->seams && b->seams && hits_are_surface(nearby, a, b, count);
}

/* Nearest first. As in local/seams.c, first come edges on which the sphere is deep: alone they
 * would hold it aside, inside of their neighbour. */
static void hits_hide(hapi_nearby *nearby, uint32_t count)
{
  hapi_hit *hits = nearby->neighbors.hits;
  if (!seams_find(nearby, count)) {
    return;
  }
  for (uint32_t i = 0; i < count; ++i) {
    for (uint32_t k = 0; k < i; ++k) {
      hits[k].aside = hits[k].aside || (seam_between(nearby, &hits[k], &hits[i], count) &&
                                        !hold_clears(nearby, &hits[k], &hits[i]) &&
                                        hold_clears(nearby, &hits[i], &hits[k]));
    }
  }
  for (uint32_t i = 0; i < count; ++i) {
    hits[i].hidden = hits[i].aside;
    for (uint32_t k = 0; k < i && !hits[i].hidden; ++k) {
      hits[i].hidden = !hits[k].aside && seam_between(nearby, &hits[k], &hits[i], count) &&
                       hold_clears(nearby, &hits[k], &hits[i]);
    }
  }
}

/* What is left where geoms adjoin under a hull. For model CONTACT another thread finds points. */
static uint32_t hits_join(hapi_nearby *nearby, uint32_t count)
{
  hapi_hit *hits = nearby->neighbors.hits;
  uint32_t kept = 0;
  if (nearby->cycle->model == HAP_MODEL_CONTACT) {
    return count;
  }
  hapi_tool_join_hits(nearby, count);
  for (uint32_t i = 0; i < count; ++i) {
    const hapi_state_pointer *p = &hapi_state_pointers(nearby->cycle->state)[hits[i].pointer];
    if (p->is_tool == 0 || hits[i].tool_count > 0) {
      hits[kept++] = hits[i];
    }
  }
  return kept;
}

static void take_kept_body(hapi_nearby *nearby, uint64_t birth)
{
  uint32_t known = hapi_bodies_find_birth(&nearby->world->bodies, birth);
  uint32_t slot = known != HAPI_NONE && known < nearby->visit_capacity
                      ? hapi_slots_body(nearby, known)
                      : HAPI_NONE;
  if (slot != HAPI_NONE) {
    nearby->visits[known].chosen_in = nearby->cycle->model_number + 1;
    take_body(&nearby->slots.bodies[slot], nearby->world->bodies.entries[known].body);
    nearby->slots.bodies[slot].held = true;
  }
}

/* What pointers hold, and what own forces are bound to, is in the model before all that is near. */
static void take_kept(hapi_nearby *nearby)
{
  const hapi_state *state = nearby->cycle->state;
  for (uint32_t i = 0; state != NULL && i < state->pointer_count; ++i) {
    const hapi_state_pointer *pointer = &hapi_state_pointers(nearby->cycle->state)[i];
    for (uint32_t k = 0; pointer->generation != 0 && k < pointer->bound_count; ++k) {
      take_kept_body(nearby, pointer->bound[k]);
    }
    if (pointer->generation != 0 && pointer->held != 0) {
      take_kept_body(nearby, pointer->held);
    }
  }
}

void hapi_neighbors_find(hapi_nearby *nearby)
{
  hapi_neighbors *hood = &nearby->neighbors;
  uint32_t count = 0;
  nearby->tools.count = 0;
  nearby->counts.ahead_dropped = 0;
  hapi_relief_begin(nearby);
  hapi_slots_begin_model(nearby);
  hapi_slots_hand_over(nearby);
  if (!hapi_nearby_reserve_visits(nearby)) {
    hood->candidate_count = 0; /* what cannot be noted is not near */
  }
  take_kept(nearby);
  for (uint32_t i = 0; i < hood->candidate_count; ++i) {
    hapi_hit *hit = &hood->hits[count];
    const hapi_candidate *near = &hood->candidates[i];
    if (near->geom != NULL && find_hit(nearby, near, hit) && hit_is_felt(nearby, near, hit)) {
      hit->geom = near->geom;
      hit->pointer = near->pointer;
      ++count;
    }
  }
  qsort(hood->hits, count, sizeof *hood->hits, hit_by_distance); /* nearest first, for capacity */
  HAPI_ASSERT(count <= hood->candidate_count);
  count = hits_join(nearby, count);
  count = hood->hit_count = choose_hits(nearby, count);
  hits_hide(nearby, count);
  for (uint32_t i = 0; i < count; ++i) {
    keep_places(nearby, &hood->hits[i]);
  }
  for (uint32_t i = 0; i < count; ++i) {
    take_hit(nearby, &hood->hits[i]);
  }
  int64_t begin_ns = hapi_clock_now();
  hapi_ahead_range(nearby, count);
  ahead_tell(nearby);
  nearby->counts.last_range_s =
      1e-9 * (double)(hapi_clock_now() - begin_ns) - nearby->range.links.cover.boxes_s;
  nearby->counts.range_s += nearby->counts.last_range_s;
  hapi_slots_end_model(nearby);
}

uint32_t hapi_neighbors_bodies(const hapi_nearby *nearby)
{
  uint32_t count = 0;
  for (uint32_t i = 0; i < nearby->slots.body_high; ++i) {
    const hapi_body_slot *slot = &nearby->slots.bodies[i];
    count += slot->phase == HAPI_SLOT_LIVE && (slot->flags & HAPI_BODY_DRIVEN) == 0 &&
             hapi_nearby_chose(nearby, slot->known, nearby->cycle->model_number);
  }
  return count;
}
