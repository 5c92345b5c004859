/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>

#include "base/alloc.h"
#include "base/assert.h"
#include "base/vec.h"
#include "world/world.h"

/* The collision phase: contact joints for the next step. */

/* ODE wants it at right angles to the normal. A pair whose normal it is has ODE's own direction. */
static void settle_direction(dContact *contact)
{
  double across[3];
  const double *n = contact->geom.normal;
  hapi_v3_madd(contact->fdir1, -hapi_v3_dot(contact->fdir1, n), n, across);
  double length = hapi_v3_norm(across);
  if (length > 1e-6) {
    hapi_v3_scale(1.0 / length, across, contact->fdir1);
  } else {
    contact->surface.mode &= ~dContactFDir1;
  }
}

/* A surface that is soft for the world's step, in a world that is stepped at another. */
static void surface_soften(const hapi_world *world, const hapi_cycle *cycle, dSurfaceParameters *s)
{
  if (hapi_world_ratio(cycle) == 1.0 || (s->mode & (dContactSoftERP | dContactSoftCFM)) == 0) {
    return;
  }
  world->notes->softened = true;
  double erp = (s->mode & dContactSoftERP) != 0 ? s->soft_erp : dWorldGetERP(world->ode.world);
  double cfm = (s->mode & dContactSoftCFM) != 0 ? s->soft_cfm : dWorldGetCFM(world->ode.world);
  hapi_soften(hapi_world_ratio(cycle), &erp, &cfm);
  s->soft_erp = erp;
  s->soft_cfm = cfm;
  s->mode |= dContactSoftERP | dContactSoftCFM;
}

/* ODE has no getter for what a contact joint holds. Without memory for a note the island of the
 * contact is measured again. */
static void contact_note(hapi_contact_notes *notes, dJointID joint, const dContact *contact)
{
  if (hapi_reserve((void **)&notes->list, &notes->capacity, notes->count, 1, sizeof *notes->list)) {
    notes->list[notes->count++] = (hapi_contact_note){joint, *contact};
    dJointSetData(joint, (void *)(uintptr_t)notes->count); /* the joint is ours */
  }
}

const dContact *hapi_world_contact_of(const hapi_world *world, dJointID joint)
{
  const hapi_contact_notes *notes = world->notes;
  uintptr_t number = (uintptr_t)dJointGetData(joint);
  bool ours = number > 0 && number <= notes->count && notes->list[number - 1].joint == joint;
  return ours ? &notes->list[number - 1].contact : NULL;
}

/* m/s, of a geom at a point. */
static void geom_velocity(const hapi_world *world, dGeomID geom, const double point[3],
                          double out[3])
{
  dVector3 velocity = {0.0, 0.0, 0.0, 0.0};
  dBodyID own = dGeomGetBody(geom);
  dBodyID body = own != NULL ? own : hapi_carrier_of(&world->carriers, geom);
  if (body != NULL) {
    dBodyGetPointVel(body, point[0], point[1], point[2], velocity);
  }
  hapi_v3_copy(velocity, out);
}

/* As the application wants it: false, none. */
static bool contact_is_wanted(const hapi_world *world, const hapi_cycle *cycle, dContact *io)
{
  double velocity[3];
  double other[3];
  geom_velocity(world, io->geom.g1, io->geom.pos, velocity);
  geom_velocity(world, io->geom.g2, io->geom.pos, other);
  hapi_v3_sub(velocity, other, velocity);
  if (!hapi_world_ask_contact(world->asking, io, velocity)) {
    return false;
  }
  surface_soften(world, cycle, &io->surface);
  return true;
}

uint32_t hapi_world_make_contacts(const hapi_world *world, const hapi_cycle *cycle,
                                  const hapi_touching *touching, dSurfaceParameters *surface,
                                  bool notes)
{
  dGeomID a = touching->geoms[0];
  dGeomID b = touching->geoms[1];
  dContact *contacts = world->contact_scratch;
  double direction[3];
  uint32_t rejected = 0;
  HAPI_ASSERT(!dGeomIsSpace(a) && !dGeomIsSpace(b));
  HAPI_ASSERT(touching->bodies[0] != touching->bodies[1]);
  int count = dCollide(a, b, world->ode.max_contacts_per_pair, &contacts[0].geom, sizeof(dContact));
  HAPI_ASSERT(count <= world->ode.max_contacts_per_pair);
  bool asks = hapi_world_asks(world->asking);
  if (!asks) { /* else each contact has its own */
    surface_soften(world, cycle, surface);
  }
  bool directed = count > 0 && (surface->mode & dContactFDir1) != 0 &&
                  hapi_world_direction(world, a, b, direction);
  if (!directed) {
    surface->mode &= ~dContactFDir1;
  }
  for (int i = 0; i < count; ++i) {
    if (!hapi_contact_is_sound(&contacts[i].geom)) {
      ++rejected;
      continue;
    }
    contacts[i].surface = *surface;
    if (directed) {
      hapi_v3_copy(direction, contacts[i].fdir1);
    }
    if (asks && !contact_is_wanted(world, cycle, &contacts[i])) {
      continue;
    }
    if ((contacts[i].surface.mode & dContactFDir1) != 0) {
      settle_direction(&contacts[i]);
    }
    dJointID joint = dJointCreateContact(world->ode.world, world->contact_group, &contacts[i]);
    dJointAttach(joint, touching->bodies[0], touching->bodies[1]);
    if (notes) {
      contact_note(world->notes, joint, &contacts[i]);
    }
  }
  return rejected;
}

static bool can_move(dBodyID body)
{
  return body != NULL && !dBodyIsKinematic(body);
}

/* The loop carries the contacts of what it moves: ODE must not have them as well. */
static bool carried_by_loop(const hapi_body_table *table, dBodyID body)
{
  uint32_t known = hapi_bodies_find(table, body);
  return known != HAPI_NONE && table->entries[known].loop_owned;
}

typedef struct collision {
  const hapi_world *world;
  const hapi_cycle *cycle;
  bool notes;
  bool alone;  /* of one body of world->awake */
  uint32_t at; /* its place there */
  uint32_t rejected;
} collision;

/* A pair of two bodies that are awake was met from the first of them. */
static bool was_met(const collision *c, dBodyID a, dBodyID b)
{
  const hapi_awake *awake = &c->world->awake;
  dBodyID other = awake->bodies[c->at] == a ? b : a;
  return other != NULL && hapi_awake_find(awake, other) < c->at;
}

static void near_callback(void *data, dGeomID a, dGeomID b)
{
  collision *c = data;
  if (dGeomIsSpace(a) || dGeomIsSpace(b)) {
    dSpaceCollide2(a, b, data, near_callback); /* what is inside of one is met by itself */
    return;
  }
  dBodyID body_a = dGeomGetBody(a);
  dBodyID body_b = dGeomGetBody(b);
  if (body_a == body_b || (!can_move(body_a) && !can_move(body_b)) ||
      (c->alone && was_met(c, body_a, body_b))) {
    return;
  }
  dSurfaceParameters surface;
  bool turned;
  bool carried =
      carried_by_loop(&c->world->bodies, body_a) || carried_by_loop(&c->world->bodies, body_b);
  if (carried || !hapi_world_ask_surface(c->world, c->cycle, a, b, &surface, &turned)) {
    return;
  }
  hapi_touching touching = {.geoms = {turned ? b : a, turned ? a : b}};
  touching.bodies[0] = dGeomGetBody(touching.geoms[0]);
  touching.bodies[1] = dGeomGetBody(touching.geoms[1]);
  c->rejected += hapi_world_make_contacts(c->world, c->cycle, &touching, &surface, c->notes);
}

/* The pairs inside a space, and those inside each space in it: every pair once. */
static void collide_inside(collision *c, dSpaceID space)
{
  dSpaceCollide(space, c, near_callback);
  int count = dSpaceGetNumGeoms(space);
  for (int i = 0; i < count; ++i) {
    dGeomID geom = dSpaceGetGeom(space, i);
    if (dGeomIsSpace(geom)) {
      collide_inside(c, (dSpaceID)geom);
    }
  }
}

static void collide_spaces(collision *c, const hapi_spaces *spaces)
{
  for (uint32_t i = 0; i < spaces->count; ++i) {
    const hapi_space *a = &spaces->list[i];
    if ((a->pairs & HAP_SPACE_INSIDE) != 0) {
      collide_inside(c, a->space);
    }
    for (uint32_t k = 0; k < i; ++k) {
      const hapi_space *b = &spaces->list[k];
      if ((a->pairs & b->pairs & HAP_SPACE_OTHERS) != 0) {
        dSpaceCollide2((dGeomID)b->space, (dGeomID)a->space, c, near_callback);
      }
    }
  }
}

/* HAPI_NONE: none of those that collide, or one inside of such a space. */
static uint32_t space_of(const hapi_spaces *spaces, dGeomID geom)
{
  for (uint32_t i = 0; i < spaces->count; ++i) {
    if (spaces->list[i].space == dGeomGetSpace(geom)) {
      return i;
    }
  }
  return HAPI_NONE;
}

/* The pairs of one geom, as collide_spaces would find them. False: they depend on spaces inside
 * spaces. */
static bool collide_geom(collision *c, dGeomID geom)
{
  const hapi_spaces *spaces = &c->world->spaces;
  uint32_t own = space_of(spaces, geom);
  if (own == HAPI_NONE) {
    return dGeomGetSpace(geom) == NULL; /* then it meets nothing */
  }
  for (uint32_t i = 0; i < spaces->count; ++i) {
    uint32_t both = spaces->list[i].pairs & spaces->list[own].pairs;
    if ((both & (i == own ? HAP_SPACE_INSIDE : HAP_SPACE_OTHERS)) != 0) {
      dSpaceCollide2(geom, (dGeomID)spaces->list[i].space, c, near_callback);
    }
  }
  return true;
}

/* The bodies of world->awake from a place on, and what they wake. False: too many. */
static bool collide_awake(collision *c, hapi_awake *awake, uint32_t from)
{
  bool good = true;
  c->alone = true;
  for (c->at = from; good && c->at < awake->count; ++c->at) {
    dBodyID body = awake->bodies[c->at];
    for (dGeomID g = dBodyGetFirstGeom(body); g != NULL && good; g = dBodyGetNextGeom(g)) {
      good = !dGeomIsEnabled(g) || collide_geom(c, g);
    }
    good = good && hapi_awake_add_partners(awake, body);
  }
  c->alone = false;
  if (!good) {
    hapi_awake_end(awake);
  }
  return good;
}

static void contacts_drop(const hapi_world *world)
{
  dJointGroupEmpty(world->contact_group);
  world->notes->count = 0;
  world->notes->softened = false;
}

static void collide_all(collision *c)
{
  c->rejected = 0;
  contacts_drop(c->world);
  collide_spaces(c, &c->world->spaces);
}

void hapi_world_collide(hapi_world *world, const hapi_cycle *cycle, bool notes)
{
  collision c = {.world = world, .cycle = cycle, .notes = notes};
  hapi_world_forget_surfaces(world);
  contacts_drop(world);
  if (!hapi_awake_begin(world) || !collide_awake(&c, &world->awake, 0)) {
    collide_all(&c);
  }
  world->counts.contacts_rejected += c.rejected;
}

void hapi_world_collide_also(hapi_world *world, const hapi_cycle *cycle, bool notes, dBodyID body)
{
  hapi_awake *awake = &world->awake;
  collision c = {.world = world, .cycle = cycle, .notes = notes};
  uint32_t from = awake->count;
  if (!awake->alone || hapi_awake_find(awake, body) != HAPI_NONE) {
    return;
  }
  bool room = hapi_awake_add(awake, body);
  if (!room) {
    hapi_awake_end(awake);
  }
  if (!room || !collide_awake(&c, awake, from)) {
    collide_all(&c);
  }
  world->counts.contacts_rejected += c.rejected;
}
