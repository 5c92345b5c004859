/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "base/assert.h"
#include "base/clock.h"
#include "base/log.h"
#include "near/neighbors.h"
#include "physics/tape_cycle.h"
#include "record/verdict_cells.h"

/* Physics' part of a recording: what a cycle has from outside, and a hash of the local model
 * that it made of it. */

#define MODEL_BITS 0xffu
#define LOW_HALF 0xffffffffu

/* Recording: the cell of a cycle until it has taken its message; NULL: none. */
static hapi_cell *cycle_note(const hapi_taping *taping)
{
  bool running = hapi_tape_records(taping->tape) && taping->note != NULL &&
                 taping->note->kind == HAPI_CELL_CYCLE;
  return running ? taping->note : NULL;
}

static void note_commit(hapi_taping *taping)
{
  HAPI_ASSERT(hapi_tape_records(taping->tape));
  hapi_tape_commit(taping->tape);
  taping->note = NULL;
}

/* The bits of a time scale are kept against those of 1, which older recordings have. */
static uint32_t scale_bits(float scale)
{
  const float one = 1.0F;
  uint32_t bits[2];
  memcpy(&bits[0], &scale, sizeof scale);
  memcpy(&bits[1], &one, sizeof one);
  return bits[0] ^ bits[1];
}

static float bits_scale(uint32_t kept)
{
  float scale;
  uint32_t bits = kept ^ scale_bits(0.0F);
  memcpy(&scale, &bits, sizeof scale);
  return scale >= 0.0F && scale <= 1.0F ? scale : 1.0F; /* of a file from outside */
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

static void describe_world(const hapi_world *world, hapi_cell *out)
{
  dVector3 gravity;
  dWorldGetGravity(world->ode.world, gravity);
  const double values[] = {dWorldGetERP(world->ode.world),
                           dWorldGetCFM(world->ode.world),
                           dWorldGetQuickStepNumIterations(world->ode.world),
                           dWorldGetQuickStepW(world->ode.world),
                           dWorldGetContactSurfaceLayer(world->ode.world),
                           dWorldGetContactMaxCorrectingVel(world->ode.world)};
  uint64_t hash = hapi_hash_doubles(HAPI_HASH_BEGIN, gravity, 3);
  out->u[HAPI_WORLD_HASH] = hapi_hash_doubles(hash, values, sizeof values / sizeof values[0]);
  for (uint32_t i = 0; i < world->bodies.high; ++i) {
    dBodyID body = world->bodies.entries[i].body;
    if (body != NULL) {
      out->u[HAPI_WORLD_HASH] = hash_body(out->u[HAPI_WORLD_HASH], body);
      out->u[HAPI_WORLD_JOINTS] += (uint64_t)dBodyGetNumJoints(body);
      ++out->u[HAPI_WORLD_BODIES];
    }
  }
  for (uint32_t i = 0; i < world->spaces.count; ++i) {
    hash_space(world->spaces.list[i].space, out);
  }
}

static hap_status other_world(const hapi_cell *there, const hapi_cell *here, hap_detail *detail)
{
  return hapi_fail(detail, HAP_ERROR_WORLD,
                   "this is not the world that was recorded: it had %llu bodies with %llu geoms "
                   "and %llu joints, this one has %llu, %llu and %llu%s; build the one of the "
                   "recording",
                   (unsigned long long)there->u[HAPI_WORLD_BODIES],
                   (unsigned long long)(there->u[HAPI_WORLD_GEOMS] & LOW_HALF),
                   (unsigned long long)there->u[HAPI_WORLD_JOINTS],
                   (unsigned long long)here->u[HAPI_WORLD_BODIES],
                   (unsigned long long)here->u[HAPI_WORLD_GEOMS],
                   (unsigned long long)here->u[HAPI_WORLD_JOINTS],
                   there->u[HAPI_WORLD_BODIES] == here->u[HAPI_WORLD_BODIES] &&
                           (there->u[HAPI_WORLD_GEOMS] & LOW_HALF) == here->u[HAPI_WORLD_GEOMS]
                       ? ", but in other places, of other masses or shapes, or with other settings"
                       : "");
}

hap_status hapi_tape_world(hapi_taping *taping, const hapi_world *world, hapi_wanted *wanted,
                           hap_detail *detail)
{
  hapi_cell here = {0};
  taping->asking = world->asking;
  taping->asking->mode = hapi_tape_plays(taping->tape)     ? HAPI_ASKING_PLAYS
                         : hapi_tape_records(taping->tape) ? HAPI_ASKING_RECORDS
                                                           : HAPI_ASKING_ONLY;
  hapi_verdicts_clear(&taping->asking->verdicts);
  if (taping->tape == NULL) {
    return HAP_OK;
  }
  taping->locks = 0;
  taping->missed_unrecorded = 0;
  taping->dropped_unrecorded = 0;
  describe_world(world, &here);
  if (hapi_tape_records(taping->tape)) {
    hapi_tape_open(taping->tape);
    taping->note = hapi_tape_put(taping->tape, HAPI_CELL_WORLD, 0);
    memcpy(taping->note->u, here.u, sizeof here.u);
    taping->note->u[HAPI_WORLD_SEED] = dRandGetSeed();
    taping->note->flags = (uint16_t)atomic_load(&wanted->model);
    taping->note->word = atomic_load(&wanted->effects);
    taping->note->u[HAPI_WORLD_GEOMS] |= (uint64_t)scale_bits(atomic_load(&wanted->time_scale))
                                         << 32;
    return HAP_OK;
  }
  taping->read = hapi_verdicts_get(&taping->asking->verdicts, taping->tape, HAPI_CELL_WORLD);
  if (taping->read->u[HAPI_WORLD_HASH] != here.u[HAPI_WORLD_HASH]) {
    return other_world(taping->read, &here, detail);
  }
  dRandSetSeed((unsigned long)taping->read->u[HAPI_WORLD_SEED]);
  hap_model model = (hap_model)(taping->read->flags & MODEL_BITS);
  if (hap_model_name(model) != NULL) {
    atomic_store(&wanted->model, (int)model);
  }
  atomic_store(&wanted->effects, taping->read->word);
  atomic_store(&wanted->time_scale,
               bits_scale((uint32_t)(taping->read->u[HAPI_WORLD_GEOMS] >> 32)));
  return HAP_OK;
}

void hapi_tape_start(hapi_taping *taping, int64_t *io_start_ns)
{
  if (hapi_tape_records(taping->tape)) {
    taping->note->i[HAPI_WORLD_TIME] = *io_start_ns;
  } else if (hapi_tape_plays(taping->tape)) {
    *io_start_ns = taping->read->i[HAPI_WORLD_TIME];
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
    if ((l->flags & HAPI_LIMIT_SPRING) != 0) {
      const double spring[] = {l->spring.stiffness, l->spring.rest, l->spring.damping,
                               l->spring.inertia};
      hash = hapi_hash_doubles(hash, spring, sizeof spring / sizeof spring[0]);
    }
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

static uint64_t hash_feel(uint64_t hash, const hapi_model_feel *of)
{
  const hapi_feel *feel = &of->feel;
  const double values[] = {feel->mu,           feel->mu_static,    feel->stiffness, feel->damping,
                           feel->impact.force, feel->impact.decay, feel->impact.hz};
  hash = hapi_hash_word(hash, ((uint64_t)of->number << 32) | feel->more);
  hash = hapi_hash_doubles(hash, values, sizeof values / sizeof values[0]);
  if ((feel->more & HAPI_FEEL_ADHESION) != 0) { /* recordings of earlier versions have none */
    hash = hapi_hash_doubles(hash, &feel->adhesion, 1);
  }
  if ((feel->more & HAPI_FEEL_MAGNET) != 0) {
    hash = hapi_hash_doubles(hash, &feel->magnet_force, 1);
    hash = hapi_hash_doubles(hash, &feel->magnet_reach, 1);
  }
  hash = hapi_hash_word(hash, feel->texture_number);
  hash = hapi_hash_doubles(hash, feel->geom.position, 3);
  return hapi_hash_doubles(hash, feel->geom.quat_wxyz, 4);
}

static uint64_t hash_model(hapi_model *model)
{
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
  for (uint32_t i = 0; i < model->feel_count; ++i) {
    hash = hash_feel(hash, &hapi_model_feels(model)[i]);
  }
  for (uint32_t i = 0; i < model->triangle_count; ++i) {
    hash = hapi_hash_doubles(hash, hapi_model_triangles(model)[i].corners, 9);
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

static void compare_model(hapi_taping *taping, uint64_t number, uint64_t recorded)
{
  const hapi_difference difference = {.what = HAPI_DIFFERS_STEP, .number = number};
  if (recorded != taping->model_hash) {
    hapi_tape_differ(taping->tape, &difference);
  }
}

/* Before the loop can take the model: its tick then comes later in the recording. */
static void put_end(hapi_taping *taping, uint64_t number)
{
  hapi_tape_open(taping->tape);
  hapi_cell *cell = hapi_tape_put(taping->tape, HAPI_CELL_CYCLED, 0);
  HAPI_ASSERT(cell != NULL);
  cell->flags = taping->model_next;
  cell->u[HAPI_CYCLED_MODEL] = number;
  cell->u[HAPI_CYCLED_HASH] = taping->model_hash;
  cell->i[HAPI_CYCLED_SENT] = taping->sent_ns;
  hapi_verdicts_put(&taping->asking->verdicts, taping->tape, cell);
  note_commit(taping);
}

/* The clock's time that the loop takes for a sign of life. The first model needs none: it is
 * sent at the time that it is for. */
int64_t hapi_tape_sent(hapi_taping *taping, const hapi_cycle *cycle)
{
  taping->sent_ns = 0;
  if (taping->cycling && hapi_tape_plays(taping->tape)) {
    taping->sent_ns = taping->read_end->i[HAPI_CYCLED_SENT];
  } else if (taping->cycling && cycle->config->frame) {
    taping->sent_ns = hapi_clock_now();
  }
  return taping->sent_ns;
}

void hapi_tape_model(hapi_taping *taping, hapi_model *model)
{
  if (taping->tape == NULL) {
    return;
  }
  taping->model_hash = hash_model(model);
  if (hapi_tape_records(taping->tape) && taping->cycling) {
    put_end(taping, model->number);
  }
}

void hapi_tape_started(hapi_taping *taping, const hapi_cycle *cycle)
{
  HAPI_ASSERT(!taping->cycling);
  if (hapi_tape_records(taping->tape)) {
    taping->note->u[HAPI_WORLD_MODEL_HASH] = taping->model_hash;
    hapi_verdicts_put(&taping->asking->verdicts, taping->tape, taping->note);
    note_commit(taping);
  } else if (hapi_tape_plays(taping->tape)) {
    compare_model(taping, cycle->model_number, taping->read->u[HAPI_WORLD_MODEL_HASH]);
  }
}

/* ---- a cycle ---- */

void hapi_tape_cycle(hapi_taping *taping, hapi_wanted *wanted, int64_t now_ns, int64_t next_ns)
{
  hapi_verdicts_clear(&taping->asking->verdicts);
  taping->model_hash = 0;
  taping->model_next = (uint16_t)atomic_load(&wanted->model);
  taping->cycling = true;
  if (hapi_tape_records(taping->tape)) {
    hapi_tape_open(taping->tape);
    taping->note = hapi_tape_put(taping->tape, HAPI_CELL_CYCLE, 0);
    taping->note->i[HAPI_CYCLE_TIME] = now_ns;
    taping->note->i[HAPI_CYCLE_NEXT] = next_ns;
    taping->note->u[HAPI_CYCLE_SEED] = dRandGetSeed();
    taping->note->u[HAPI_CYCLE_LOCKS] = taping->locks;
    taping->note->u[HAPI_CYCLE_MISSED] = taping->missed_unrecorded;
    taping->note->u[HAPI_CYCLE_DROPPED] = taping->dropped_unrecorded & LOW_HALF;
  } else if (hapi_tape_plays(taping->tape)) {
    taping->read = hapi_tape_get(taping->tape, HAPI_CELL_CYCLE, 0);
    taping->read_end = hapi_verdicts_get(&taping->asking->verdicts, taping->tape, HAPI_CELL_CYCLED);
    dRandSetSeed((unsigned long)taping->read->u[HAPI_CYCLE_SEED]);
    taping->played_missed += taping->read->u[HAPI_CYCLE_MISSED] & LOW_HALF;
    taping->played_dropped += taping->read->u[HAPI_CYCLE_DROPPED] & LOW_HALF;
  }
  taping->locks = 0;
  taping->missed_unrecorded = 0;
  taping->dropped_unrecorded = 0;
}

/* Those that this cycle goes by. */
uint32_t hapi_tape_wanted_effects(hapi_taping *taping, hapi_wanted *wanted)
{
  if (hapi_tape_plays(taping->tape) && taping->read->kind == HAPI_CELL_CYCLE) {
    atomic_store(&wanted->effects, (uint32_t)(taping->read->u[HAPI_CYCLE_LOCKS] >> 32));
  }
  uint32_t effects = atomic_load(&wanted->effects);
  if (cycle_note(taping) != NULL) {
    uint64_t *word = &taping->note->u[HAPI_CYCLE_LOCKS];
    *word = (*word & LOW_HALF) | (uint64_t)effects << 32;
  }
  return effects;
}

double hapi_tape_wanted_scale(hapi_taping *taping, hapi_wanted *wanted)
{
  if (hapi_tape_plays(taping->tape) && taping->read->kind == HAPI_CELL_CYCLE) {
    uint64_t word = taping->read->u[HAPI_CYCLE_DROPPED];
    atomic_store(&wanted->time_scale, bits_scale((uint32_t)(word >> 32)));
  }
  float scale = atomic_load(&wanted->time_scale);
  if (cycle_note(taping) != NULL) {
    uint64_t *word = &taping->note->u[HAPI_CYCLE_DROPPED];
    *word = (*word & LOW_HALF) | (uint64_t)scale_bits(scale) << 32;
  }
  return (double)scale;
}

void hapi_tape_dials(hapi_taping *taping, int io_percent[2])
{
  for (unsigned i = 0; i < 2; ++i) {
    unsigned shift = 32 + 8 * i;
    if (hapi_tape_plays(taping->tape) && taping->read->kind == HAPI_CELL_CYCLE) {
      io_percent[i] = hapi_cell_dial(taping->read->u[HAPI_CYCLE_MISSED], shift);
    } else if (cycle_note(taping) != NULL) {
      taping->note->u[HAPI_CYCLE_MISSED] |= (uint64_t)(io_percent[i] + 1) << shift;
    }
  }
}

void hapi_tape_pace(hapi_taping *taping, int *io_pace, int *io_margin)
{
  if (hapi_tape_plays(taping->tape) && taping->read->kind == HAPI_CELL_CYCLE) {
    hapi_cell_pace(taping->read->u[HAPI_CYCLE_MISSED], io_pace, io_margin);
  } else if (cycle_note(taping) != NULL) {
    taping->note->u[HAPI_CYCLE_MISSED] |= hapi_pace_cell(*io_pace, *io_margin);
  }
}

int hapi_tape_dial_at_start(hapi_taping *taping, int percent)
{
  if (hapi_tape_plays(taping->tape)) {
    return hapi_cell_dial(taping->read->flags, 8);
  }
  if (hapi_tape_records(taping->tape)) {
    taping->note->flags |= (uint16_t)((percent + 1) << 8);
  }
  return percent;
}

void hapi_tape_edits(hapi_taping *taping, uint32_t count)
{
  hapi_cell *note = cycle_note(taping);
  if (note != NULL) {
    note->word = count;
  }
}

/* The cell goes out with it, and not at the cycle's end: whoever replays a step that took long
 * knows from here on which of the loop's messages it needs. */
void hapi_tape_state(hapi_taping *taping, const hapi_exchange *exchange, bool taken)
{
  hapi_cell *note = cycle_note(taping);
  if (note != NULL) {
    note->u[HAPI_CYCLE_STATE] = taken ? hapi_exchange_taken(exchange, HAPI_CHANNEL_STATE) : 0;
    note_commit(taping);
  }
}

/* at_end: asked for after the step, for the next one. */
hap_model hapi_tape_wanted_model(hapi_taping *taping, hapi_wanted *wanted, const hapi_cycle *cycle,
                                 bool at_end)
{
  int model = atomic_load(&wanted->model);
  if (hapi_tape_plays(taping->tape) && taping->read->kind == HAPI_CELL_CYCLE) {
    uint16_t flags = at_end ? taping->read_end->flags : taping->read->flags;
    model = hap_model_name((hap_model)flags) != NULL ? (int)flags : (int)cycle->model;
    atomic_store(&wanted->model, model);
  } else if (at_end) {
    taping->model_next = (uint16_t)model;
  } else if (cycle_note(taping) != NULL) {
    taping->note->flags = (uint16_t)model;
  }
  return (hap_model)model;
}

void hapi_tape_cycled(hapi_taping *taping, const hapi_cycle *cycle)
{
  taping->cycling = false;
  if (hapi_tape_records(taping->tape)) {
    if (taping->model_hash == 0) { /* the world was not sound */
      put_end(taping, 0);
    }
  } else if (hapi_tape_plays(taping->tape)) {
    compare_model(taping, cycle->model_number, taping->read_end->u[HAPI_CYCLED_HASH]);
  }
}
