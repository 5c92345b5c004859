/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "physics/physics_internal.h"

/* Physics' part of a recording: what a cycle has from outside, and a hash of the local model that it
 * made of it. */

#define MODEL_BITS 0xffu
#define LOW_HALF 0xffffffffu

/* Recording: the cell of a cycle until it has taken its message; NULL: none. */
static hapi_cell *cycle_note(const hapi_physics *physics)
{
  bool running = hapi_tape_records(physics->tape.tape) && physics->tape.note != NULL &&
                 physics->tape.note->kind == HAPI_CELL_CYCLE;
  return running ? physics->tape.note : NULL;
}

static void commit(hapi_physics *physics)
{
  hapi_tape_commit(physics->tape.tape);
  physics->tape.note = NULL;
}

const char *hapi_physics_ode_configuration(void)
{
  return dGetConfiguration();
}

/* ---- the world at the start ---- */

static uint64_t hash_geom(uint64_t hash, dGeomID geom)
{
  hapi_shape shape;
  hap_pose pose;
  hash = hapi_hash_word(hash, (uint64_t)dGeomGetClass(geom));
  hash = hapi_hash_word(hash, dGeomGetCategoryBits(geom));
  hash = hapi_hash_word(hash, dGeomGetCollideBits(geom));
  if (hapi_shape_of_geom(geom, &shape, &pose)) {
    hash = hapi_hash_doubles(hash, shape.half, 3);
    hash = hapi_hash_doubles(hash, &shape.radius, 1);
    hash = hapi_hash_doubles(hash, pose.position, 3);
    hash = hapi_hash_doubles(hash, pose.quat_wxyz, 4);
  }
  return hash;
}

static void hash_space(dSpaceID space, hapi_cell *io)
{
  int count = dSpaceGetNumGeoms(space);
  for (int i = 0; i < count; ++i) {
    dGeomID geom = dSpaceGetGeom(space, i);
    if (dGeomIsSpace(geom)) {
      hash_space((dSpaceID)geom, io);
    } else {
      io->u[HAPI_WORLD_HASH] = hash_geom(io->u[HAPI_WORLD_HASH], geom);
      ++io->u[HAPI_WORLD_GEOMS];
    }
  }
}

static uint64_t hash_body(uint64_t hash, dBodyID body)
{
  dMass mass;
  dBodyGetMass(body, &mass);
  hash = hapi_hash_doubles(hash, &mass.mass, 1);
  hash = hapi_hash_doubles(hash, mass.I, 12);
  hash = hapi_hash_doubles(hash, dBodyGetPosition(body), 3);
  hash = hapi_hash_doubles(hash, dBodyGetQuaternion(body), 4);
  hash = hapi_hash_doubles(hash, dBodyGetLinearVel(body), 3);
  hash = hapi_hash_doubles(hash, dBodyGetAngularVel(body), 3);
  hash = hapi_hash_word(hash, (uint64_t)dBodyGetGravityMode(body));
  return hapi_hash_word(hash, (uint64_t)dBodyIsEnabled(body));
}

static uint64_t hash_settings(dWorldID world)
{
  dVector3 gravity;
  dWorldGetGravity(world, gravity);
  const double values[] = {dWorldGetERP(world),
                           dWorldGetCFM(world),
                           dWorldGetQuickStepNumIterations(world),
                           dWorldGetQuickStepW(world),
                           dWorldGetContactSurfaceLayer(world),
                           dWorldGetContactMaxCorrectingVel(world)};
  uint64_t hash = hapi_hash_doubles(HAPI_HASH_BEGIN, gravity, 3);
  return hapi_hash_doubles(hash, values, sizeof values / sizeof values[0]);
}

static void describe_world(hapi_physics *physics, hapi_cell *out)
{
  out->u[HAPI_WORLD_HASH] = hash_settings(physics->world.ode.world);
  for (uint32_t i = 0; i < physics->world.bodies.high; ++i) {
    dBodyID body = physics->world.bodies.entries[i].body;
    if (body != NULL) {
      out->u[HAPI_WORLD_HASH] = hash_body(out->u[HAPI_WORLD_HASH], body);
      out->u[HAPI_WORLD_JOINTS] += (uint64_t)dBodyGetNumJoints(body);
      ++out->u[HAPI_WORLD_BODIES];
    }
  }
  hash_space(physics->world.ode.space, out);
}

static hap_status other_world(const hapi_cell *there, const hapi_cell *here, hap_detail *detail)
{
  return hapi_fail(detail, HAP_ERROR_WORLD,
                   "this is not the world that was recorded: it had %llu bodies with %llu geoms "
                   "and %llu joints, this one has %llu, %llu and %llu%s; build the one of the "
                   "recording",
                   (unsigned long long)there->u[HAPI_WORLD_BODIES],
                   (unsigned long long)there->u[HAPI_WORLD_GEOMS],
                   (unsigned long long)there->u[HAPI_WORLD_JOINTS],
                   (unsigned long long)here->u[HAPI_WORLD_BODIES],
                   (unsigned long long)here->u[HAPI_WORLD_GEOMS],
                   (unsigned long long)here->u[HAPI_WORLD_JOINTS],
                   there->u[HAPI_WORLD_BODIES] == here->u[HAPI_WORLD_BODIES] &&
                           there->u[HAPI_WORLD_GEOMS] == here->u[HAPI_WORLD_GEOMS]
                       ? ", but in other places, of other masses or shapes, or with other settings"
                       : "");
}

hap_status hapi_tape_world(hapi_physics *physics, hap_detail *detail)
{
  hapi_cell here = {0};
  if (physics->tape.tape == NULL) {
    return HAP_OK;
  }
  physics->tape.locks = 0;
  physics->tape.missed_unrecorded = 0;
  physics->tape.dropped_unrecorded = 0;
  describe_world(physics, &here);
  if (hapi_tape_records(physics->tape.tape)) {
    hapi_tape_open(physics->tape.tape);
    physics->tape.note = hapi_tape_put(physics->tape.tape, HAPI_CELL_WORLD, 0);
    memcpy(physics->tape.note->u, here.u, sizeof here.u);
    physics->tape.note->u[HAPI_WORLD_SEED] = dRandGetSeed();
    physics->tape.note->flags = (uint16_t)atomic_load(&physics->wanted.model);
    physics->tape.note->word = atomic_load(&physics->wanted.effects);
    return HAP_OK;
  }
  physics->tape.read = hapi_tape_get(physics->tape.tape, HAPI_CELL_WORLD, 0);
  if (physics->tape.read->u[HAPI_WORLD_HASH] != here.u[HAPI_WORLD_HASH]) {
    return other_world(physics->tape.read, &here, detail);
  }
  dRandSetSeed((unsigned long)physics->tape.read->u[HAPI_WORLD_SEED]);
  hap_model model = (hap_model)(physics->tape.read->flags & MODEL_BITS);
  if (hap_model_name(model) != NULL) {
    atomic_store(&physics->wanted.model, (int)model);
  }
  atomic_store(&physics->wanted.effects, physics->tape.read->word);
  return HAP_OK;
}

void hapi_tape_start(hapi_physics *physics, int64_t *io_start_ns)
{
  if (hapi_tape_records(physics->tape.tape)) {
    physics->tape.note->i[HAPI_WORLD_TIME] = *io_start_ns;
  } else if (hapi_tape_plays(physics->tape.tape)) {
    *io_start_ns = physics->tape.read->i[HAPI_WORLD_TIME];
  }
}

/* ---- the local model ---- */

static uint64_t hash_joint(uint64_t hash, const hapi_model_joint *j)
{
  hash = hapi_hash_word(hash, ((uint64_t)j->kind << 32) | j->slot);
  hash = hapi_hash_doubles(hash, j->place.anchor_a, 3);
  hash = hapi_hash_doubles(hash, j->place.anchor_b, 3);
  hash = hapi_hash_doubles(hash, j->place.axis_a, 3);
  for (int i = 0; i < 2; ++i) {
    const hapi_model_limit *l = &j->limits[i];
    const double values[] = {l->low, l->high, l->bounce, l->speed, l->force};
    hash = hapi_hash_word(hash, l->flags);
    hash = hapi_hash_doubles(hash, values, sizeof values / sizeof values[0]);
  }
  return hash;
}

static uint64_t hash_measured(uint64_t hash, const hapi_measured_joint *m)
{
  hash = hapi_hash_word(hash, ((uint64_t)m->carrier << 32) | m->row_count);
  for (uint32_t i = 0; i < m->row_count; ++i) {
    const hapi_measured_row *row = &m->rows[i];
    const double values[] = {row->softness.erp, row->softness.cfm, row->error, row->speed};
    hash = hapi_hash_doubles(hash, row->force, 3);
    hash = hapi_hash_doubles(hash, row->torque, 3);
    hash = hapi_hash_doubles(hash, values, sizeof values / sizeof values[0]);
  }
  return hapi_hash_doubles(hash, m->given, 6);
}

static uint64_t hash_model(const hapi_physics *physics)
{
  hapi_model *model = hapi_exchange_model_back(physics->config.exchange);
  const hapi_model_body *b = hapi_model_bodies(model);
  const hapi_model_contact *c = hapi_model_contacts(model);
  uint64_t hash = hapi_hash_word(HAPI_HASH_BEGIN, model->number);
  for (uint32_t i = 0; i < model->body_count; ++i) {
    hash = hapi_hash_word(hash, ((uint64_t)b[i].flags << 32) | b[i].slot);
    hash = hapi_hash_doubles(hash, b[i].pose.position, 3);
    hash = hapi_hash_doubles(hash, b[i].pose.quat_wxyz, 4);
    hash = hapi_hash_doubles(hash, b[i].twist.linear, 3);
    hash = hapi_hash_doubles(hash, b[i].twist.angular, 3);
    hash = hapi_hash_doubles(hash, b[i].b, 6);
    hash = hapi_hash_doubles(hash, b[i].residual, 6);
    hash = hapi_hash_doubles(hash, b[i].user_wrench, 6);
  }
  for (uint32_t i = 0; i < model->contact_count; ++i) {
    hash = hapi_hash_word(hash, ((uint64_t)c[i].slot << 32) | c[i].body);
    hash = hapi_hash_doubles(hash, c[i].point_body, 3);
    hash = hapi_hash_doubles(hash, c[i].normal_body, 3);
    hash = hapi_hash_doubles(hash, c[i].a[0], 18);
    hash = hapi_hash_doubles(hash, c[i].turn, 6);
    hash = hapi_hash_doubles(hash, &c[i].mu, 1);
  }
  hapi_tool_point *tools = hapi_model_tools(model);
  for (uint32_t i = 0; i < model->tool_count; ++i) {
    hash = hapi_hash_word(hash, tools[i].pointer);
    hash = hapi_hash_doubles(hash, tools[i].at.core_a, 3);
    hash = hapi_hash_doubles(hash, tools[i].at.core_b, 3);
    hash = hapi_hash_doubles(hash, tools[i].at.normal, 3);
  }
  for (uint32_t i = 0; i < model->cross_count; ++i) {
    const hapi_model_cross *x = &hapi_model_crosses(model)[i];
    hash = hapi_hash_word(hash, ((uint64_t)x->contact << 32) | x->body);
    hash = hapi_hash_doubles(hash, x->a[0], 18);
  }
  for (uint32_t i = 0; i < model->joint_count; ++i) {
    const hapi_model_joint *joint = &hapi_model_joints(model)[i];
    hash = hash_joint(hash, joint);
    hash = joint->kind == HAPI_JOINT_MEASURED ? hash_measured(hash, &joint->measured) : hash;
  }
  return hash;
}

static void compare_model(hapi_physics *physics, uint64_t recorded)
{
  const hapi_difference difference = {.what = HAPI_DIFFERS_STEP,
                                      .number = physics->cycle.model_number};
  if (recorded != physics->tape.model_hash) {
    hapi_tape_differ(physics->tape.tape, &difference);
  }
}

/* Before the loop can take the model: its tick then comes later in the recording. */
static void put_end(hapi_physics *physics, uint64_t number)
{
  hapi_tape_open(physics->tape.tape);
  hapi_cell *cell = hapi_tape_put(physics->tape.tape, HAPI_CELL_CYCLED, 0);
  cell->flags = physics->tape.model_next;
  cell->u[HAPI_CYCLED_MODEL] = number;
  cell->u[HAPI_CYCLED_HASH] = physics->tape.model_hash;
  cell->i[HAPI_CYCLED_SENT] = physics->tape.sent_ns;
  commit(physics);
}

/* The clock's time that the loop takes for a sign of life. The first model needs none: it is sent at the
 * time that it is for. */
int64_t hapi_tape_sent(hapi_physics *physics)
{
  physics->tape.sent_ns = 0;
  if (physics->tape.cycling && hapi_tape_plays(physics->tape.tape)) {
    physics->tape.sent_ns = physics->tape.read_end->i[HAPI_CYCLED_SENT];
  } else if (physics->tape.cycling && physics->config.frame) {
    physics->tape.sent_ns = hapi_clock_now();
  }
  return physics->tape.sent_ns;
}

void hapi_tape_model(hapi_physics *physics)
{
  if (physics->tape.tape == NULL) {
    return;
  }
  physics->tape.model_hash = hash_model(physics);
  if (hapi_tape_records(physics->tape.tape) && physics->tape.cycling) {
    put_end(physics, physics->cycle.model_number);
  }
}

void hapi_tape_started(hapi_physics *physics)
{
  if (hapi_tape_records(physics->tape.tape)) {
    physics->tape.note->u[HAPI_WORLD_MODEL_HASH] = physics->tape.model_hash;
    commit(physics);
  } else if (hapi_tape_plays(physics->tape.tape)) {
    compare_model(physics, physics->tape.read->u[HAPI_WORLD_MODEL_HASH]);
  }
}

/* ---- a cycle ---- */

void hapi_tape_cycle(hapi_physics *physics, int64_t now_ns, int64_t next_ns)
{
  physics->tape.model_hash = 0;
  physics->tape.model_next = (uint16_t)atomic_load(&physics->wanted.model);
  physics->tape.cycling = true;
  if (hapi_tape_records(physics->tape.tape)) {
    hapi_tape_open(physics->tape.tape);
    physics->tape.note = hapi_tape_put(physics->tape.tape, HAPI_CELL_CYCLE, 0);
    physics->tape.note->i[HAPI_CYCLE_TIME] = now_ns;
    physics->tape.note->i[HAPI_CYCLE_NEXT] = next_ns;
    physics->tape.note->u[HAPI_CYCLE_SEED] = dRandGetSeed();
    physics->tape.note->u[HAPI_CYCLE_LOCKS] = physics->tape.locks;
    physics->tape.note->u[HAPI_CYCLE_MISSED] = physics->tape.missed_unrecorded;
    physics->tape.note->u[HAPI_CYCLE_DROPPED] = physics->tape.dropped_unrecorded;
  } else if (hapi_tape_plays(physics->tape.tape)) {
    physics->tape.read = hapi_tape_get(physics->tape.tape, HAPI_CELL_CYCLE, 0);
    physics->tape.read_end = hapi_tape_get(physics->tape.tape, HAPI_CELL_CYCLED, 0);
    dRandSetSeed((unsigned long)physics->tape.read->u[HAPI_CYCLE_SEED]);
    physics->counts.own.stats.physics.missed += physics->tape.read->u[HAPI_CYCLE_MISSED] & LOW_HALF;
    physics->counts.own.stats.physics.frames_dropped += physics->tape.read->u[HAPI_CYCLE_DROPPED];
  }
  physics->tape.locks = 0;
  physics->tape.missed_unrecorded = 0;
  physics->tape.dropped_unrecorded = 0;
}

/* Those that this cycle goes by. */
uint32_t hapi_tape_wanted_effects(hapi_physics *physics)
{
  if (hapi_tape_plays(physics->tape.tape) && physics->tape.read->kind == HAPI_CELL_CYCLE) {
    atomic_store(&physics->wanted.effects,
                 (uint32_t)(physics->tape.read->u[HAPI_CYCLE_LOCKS] >> 32));
  }
  uint32_t wanted = atomic_load(&physics->wanted.effects);
  if (cycle_note(physics) != NULL) {
    uint64_t *word = &physics->tape.note->u[HAPI_CYCLE_LOCKS];
    *word = (*word & LOW_HALF) | (uint64_t)wanted << 32;
  }
  return wanted;
}

void hapi_tape_dials(hapi_physics *physics, int io_percent[2])
{
  for (unsigned i = 0; i < 2; ++i) {
    unsigned shift = 32 + 8 * i;
    if (hapi_tape_plays(physics->tape.tape) && physics->tape.read->kind == HAPI_CELL_CYCLE) {
      io_percent[i] = hapi_cell_dial(physics->tape.read->u[HAPI_CYCLE_MISSED], shift);
    } else if (cycle_note(physics) != NULL) {
      physics->tape.note->u[HAPI_CYCLE_MISSED] |= (uint64_t)(io_percent[i] + 1) << shift;
    }
  }
}

int hapi_tape_dial_at_start(hapi_physics *physics, int percent)
{
  if (hapi_tape_plays(physics->tape.tape)) {
    return hapi_cell_dial(physics->tape.read->flags, 8);
  }
  if (hapi_tape_records(physics->tape.tape)) {
    physics->tape.note->flags |= (uint16_t)((percent + 1) << 8);
  }
  return percent;
}

void hapi_tape_edits(hapi_physics *physics, uint32_t count)
{
  hapi_cell *note = cycle_note(physics);
  if (note != NULL) {
    note->word = count;
  }
}

/* The cell goes out with it, and not at the cycle's end: whoever replays a step that took long knows
 * from here on which of the loop's messages it needs. */
void hapi_tape_state(hapi_physics *physics, bool taken)
{
  hapi_cell *note = cycle_note(physics);
  if (note != NULL) {
    note->u[HAPI_CYCLE_STATE] =
        taken ? hapi_exchange_taken(physics->config.exchange, HAPI_CHANNEL_STATE) : 0;
    commit(physics);
  }
}

/* at_end: asked for after the step, for the next one. */
hap_model hapi_tape_wanted_model(hapi_physics *physics, bool at_end)
{
  int wanted = atomic_load(&physics->wanted.model);
  if (hapi_tape_plays(physics->tape.tape) && physics->tape.read->kind == HAPI_CELL_CYCLE) {
    uint16_t flags = at_end ? physics->tape.read_end->flags : physics->tape.read->flags;
    wanted = hap_model_name((hap_model)flags) != NULL ? (int)flags : (int)physics->cycle.model;
    atomic_store(&physics->wanted.model, wanted);
  } else if (at_end) {
    physics->tape.model_next = (uint16_t)wanted;
  } else if (cycle_note(physics) != NULL) {
    physics->tape.note->flags = (uint16_t)wanted;
  }
  return (hap_model)wanted;
}

void hapi_tape_cycled(hapi_physics *physics)
{
  physics->tape.cycling = false;
  if (hapi_tape_records(physics->tape.tape)) {
    if (physics->tape.model_hash == 0) { /* the world was not sound */
      put_end(physics, 0);
    }
  } else if (hapi_tape_plays(physics->tape.tape)) {
    compare_model(physics, physics->tape.read_end->u[HAPI_CYCLED_HASH]);
  }
}
