/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tick/report.h"

#include <string.h>

#include "base/assert.h"
#include "base/hash.h"
#include "base/pointer_id.h"
#include "base/vec.h"
#include "pointer/coupling.h"
#include "pointer/own_force.h"

static void report_body(const hapi_local_body *in, hapi_state_body *out)
{
  out->generation = in->generation;
  out->flags = in->flags;
  out->epoch = in->epoch;
  out->pose = in->pose;
  out->twist = in->twist;
  hapi_v3_copy(in->account.impulse, out->impulse);
  hapi_v3_copy(in->account.angular_impulse, out->angular_impulse);
  memcpy(out->residual, in->account.residual_taken, sizeof out->residual);
  memcpy(out->gain, in->account.gain, sizeof out->gain);
  out->owned_until_ns = in->owned_until_ns;
  if (in->owned_until_ns != 0) {
    out->owned_pose = in->left.pose;
    out->owned_twist = in->left.twist;
  }
}

/* For an assert. */
static inline bool report_is_of(const hapi_local_body *in, const hapi_state_body *told)
{
  hapi_state_body again = *told;
  report_body(in, &again);
  return memcmp(&again, told, sizeof again) == 0;
}

/* written: the tick of which the message tells as yet; it has what left before. */
static void report_bodies(const hapi_bodies *from, uint64_t written, hapi_state *out)
{
  hapi_state_body *bodies = hapi_state_bodies(out);
  for (uint32_t i = 0; i < from->high; ++i) {
    const hapi_local_body *in = &from->of[i];
    if (in->generation == 0) { /* never adopted: nothing is written where nothing was */
      if (bodies[i].generation != 0) {
        memset(&bodies[i], 0, sizeof bodies[i]);
      }
    } else if (in->live || written < in->account.left_tick || in->account.left_tick == 0) {
      report_body(in, &bodies[i]);
    } else {
      HAPI_ASSERT(report_is_of(in, &bodies[i]));
    }
  }
  out->body_high = from->high;
}

/* Where a pointer that touches would be if it could not enter the geom: physics then looks for the
 * nearest point from there. */
static void report_ball(const hapi_local_contact *in, const hapi_pointer *p,
                        const hapi_local_body *body, hapi_state_contact *out)
{
  double apart[3];
  out->touches =
      in->tool == 0 && in->seen && in->ramp.depth > 0.0 && p->generation == in->pointer_generation;
  if (out->touches == 0) {
    return;
  }
  hapi_v3_copy(p->pose.position, out->ball);
  if (body != NULL) {
    hapi_pose_unpoint(body->pose.position, body->pose.quat_wxyz, out->ball, out->ball);
  }
  if (in->asked.has && in->ball.known) {
    hapi_v3_copy(in->ball.normal, out->normal);
    hapi_v3_sub(in->ball.center, out->ball, apart);
    out->depth = hapi_v3_dot(apart, out->normal);
    hapi_v3_copy(in->ball.center, out->ball);
  } else if (p->device.jump_s > 0.0 || in->ramp.excess > 0.0) {
    out->touches = 0; /* it has no side: it was put where it is */
  } else {            /* the plane that the model gave */
    hapi_v3_copy(in->normal_body, out->normal);
    hapi_v3_sub(out->ball, in->point_body, apart);
    out->depth = p->shape.radius - hapi_v3_dot(apart, out->normal);
    hapi_v3_madd(out->ball, out->depth, out->normal, out->ball);
  }
}

static void report_contacts(const hapi_touches *touches, const hapi_pointers *pointers,
                            const hapi_bodies *bodies, hapi_state *out)
{
  hapi_state_contact *contacts = hapi_state_contacts(out);
  uint32_t count = 0;
  for (uint32_t i = 0; i < touches->count; ++i) {
    const hapi_local_contact *in = &touches->of[i];
    if (in->slot != HAPI_SLOT_NONE) { /* else physics does not know it */
      contacts[count].slot = in->slot;
      contacts[count].generation = in->generation;
      report_ball(in, &pointers->of[in->pointer], hapi_bodies_at(bodies, in->body),
                  &contacts[count]);
      hapi_v3_copy(in->force, contacts[count++].force);
    }
  }
  out->contact_count = count;
}

static void report_springs(const hapi_touches *touches, uint64_t tick, hapi_state *out)
{
  out->spring_count = 0;
  for (uint32_t i = 0; i < touches->count && out->spring_count < out->spring_capacity; ++i) {
    const hapi_local_contact *c = &touches->of[i];
    const hapi_friction *f = c->feel.rubs ? hapi_friction_of(touches, c) : NULL;
    if (f == NULL || f->tick + 1 != tick || f->rigid || !(f->stiffness > 0.0)) {
      continue;
    }
    hapi_state_spring *to = &hapi_state_springs(out)[out->spring_count++];
    to->slot = c->tool != 0 ? HAPI_SLOT_NONE : c->slot;
    to->generation = c->generation;
    if (c->tool != 0) {
      const hapi_patch_contact *at = &touches->tool.tools[c->tool - 1].in.at;
      to->key = at->key;
      hapi_v3_copy(at->core_a, to->place);
    }
    hapi_v3_scale(f->left, f->now.stretch_body, to->stretch_body);
    to->turn = f->left * f->now.turn;
  }
}

static void report_joints(const hapi_joints *from, hapi_state *out)
{
  out->joint_count = 0;
  for (uint32_t i = 0; i < from->count && out->joint_count < from->told; ++i) {
    const hapi_model_joint *in = &from->of[i];
    if (in->told != 0) {
      hapi_state_joints(out)[out->joint_count++] =
          (hapi_state_joint){.slot = in->slot,
                             .generation = in->generation,
                             .body_a = in->body_a,
                             .given = from->memory[in->slot].given};
    }
  }
}

/* As many as there are pairs with points that are not leaving, of which there is one at least. */
static uint32_t report_sides(const hapi_tool_world *w, hapi_tool_side *out)
{
  uint32_t count = 0;
  for (uint32_t i = 0; i < w->pair_count; ++i) {
    const hapi_tool_pair *pair = &w->pairs[i];
    if (pair->first != HAPI_SLOT_NONE && pair->sided) {
      HAPI_ASSERT_INDEX(count, w->capacity);
      out[count++] = pair->side;
    }
  }
  return count;
}

/* A proxy does not enter what it touches: for others the hand behind it does, held by both springs
 * one after the other. */
static void report_hand(const hapi_pointer *in, hapi_state_pointer *out)
{
  hapi_v3_set(out->apart, 0.0, 0.0, 0.0);
  out->hold = 0.0;
  if (in->proxied && in->coupling.stiffness > 0.0) {
    double soft = in->rigid ? 0.0 : 1.0 / in->surface.stiffness;
    hapi_v3_sub(in->handle.position, in->pose.position, out->apart);
    out->hold = 1.0 / (1.0 / in->coupling.stiffness + soft);
  }
}

/* The places of those that have not come yet were cleared at start. */
static void report_pointers(const hapi_tick *tick, hapi_state *out)
{
  const hapi_pointers *from = &tick->pointers;
  hapi_state_pointer *pointers = hapi_state_pointers(out);
  for (uint32_t i = 0; i < from->high; ++i) {
    const hapi_pointer *in = &from->of[i];
    pointers[i].generation = in->generation;
    if (in->generation == 0) {
      continue;
    }
    pointers[i].collide_bits = in->shape.collide_bits;
    pointers[i].radius = in->shape.radius;
    pointers[i].stiffness = in->surface.stiffness;
    pointers[i].magnet_hold = hapi_magnet_hold(in);
    pointers[i].damping = in->surface.damping;
    pointers[i].friction = in->surface.friction;
    pointers[i].finger_radius = in->surface.finger_radius;
    pointers[i].pose = in->pose;
    pointers[i].twist = in->twist;
    report_hand(in, &pointers[i]);
    pointers[i].is_tool = in->shape.hull != NULL;
    pointers[i].extent = in->shape.extent;
    pointers[i].bound_count =
        in->own ? hapi_own_forces_bound(&tick->own[(size_t)i * HAP_FORCES_MAX], pointers[i].bound)
                : 0;
    pointers[i].held = in->grab.any ? hapi_grab_holds_for(&in->grab) : 0;
    if (in->shape.hull != NULL) {
      hapi_state_hulls(out)[i] = *in->shape.hull;
    }
  }
}

void hapi_tick_report(const hapi_tick *tick, hapi_state *out)
{
  hapi_v3_copy(tick->touches.hand_impulse, out->hand_impulse);
  hapi_v3_copy(tick->bodies.owned_impulse, out->owned_impulse);
  out->now_ns = tick->facts.now_ns;
  out->time_scale = tick->facts.time_scale;
  out->model_number = tick->facts.model_number;
  out->model = tick->facts.model;
  report_bodies(&tick->bodies, out->tick, out);
  report_contacts(&tick->touches, &tick->pointers, &tick->bodies, out);
  report_springs(&tick->touches, tick->facts.tick, out);
  report_joints(&tick->joints, out);
  report_pointers(tick, out);
  out->tick = tick->facts.tick;
  out->side_count = report_sides(&tick->touches.tool, hapi_state_sides(out));
}

/* Whether the loop's pose is the body's, and not what it makes do with until the next sync: a body
 * that it does not own, and gave nothing that the world has not had yet, takes the world's state
 * then. */
static bool loop_leads(hap_model model, const hapi_local_body *body)
{
  if (!body->live || (body->flags & HAPI_BODY_DRIVEN) != 0 || model == HAP_MODEL_IMPULSE) {
    return false;
  }
  const double *taken = body->given.impulse_taken;
  return model == HAP_MODEL_SINGLE || (body->flags & HAPI_BODY_OWNED) != 0 ||
         memcmp(body->account.impulse, taken, sizeof body->account.impulse) != 0 ||
         memcmp(body->account.angular_impulse, taken + 3, sizeof body->account.angular_impulse) !=
             0;
}

static void store_position(_Atomic double *to, const double from[3])
{
  atomic_store_explicit(&to[0], from[0], memory_order_release);
  atomic_store_explicit(&to[1], from[1], memory_order_release);
  atomic_store_explicit(&to[2], from[2], memory_order_release);
}

static void store_quat(_Atomic double *to, const double from[4])
{
  store_position(to, from);
  atomic_store_explicit(&to[3], from[3], memory_order_release);
}

static void trail_bodies(const hapi_bodies *bodies, hap_model model, hapi_trail_body *places)
{
  for (uint32_t i = 0; i < bodies->high; ++i) {
    const hapi_local_body *body = &bodies->of[i];
    uint32_t generation = loop_leads(model, body) ? body->generation : 0;
    if (generation != 0) {
      store_position(places[i].pose, body->pose.position);
      store_quat(places[i].pose + 3, body->pose.quat_wxyz);
    }
    atomic_store_explicit(&places[i].generation, generation, memory_order_release);
  }
}

static void trail_pointers(const hapi_pointers *pointers, hapi_trail_pointer *places)
{
  for (uint32_t i = 0; i < pointers->high; ++i) {
    const hapi_pointer *p = &pointers->of[i];
    if (p->generation != 0) {
      store_position(places[i].proxy, p->pose.position);
      store_position(places[i].device, p->handle.position);
      store_quat(places[i].proxy_quat, p->pose.quat_wxyz);
      store_quat(places[i].device_quat, p->handle.quat);
    }
    atomic_store_explicit(&places[i].proxied, p->proxied, memory_order_release);
    atomic_store_explicit(&places[i].generation, p->generation & HAPI_GENERATION_MASK,
                          memory_order_release);
  }
}

void hapi_tick_report_trail(const hapi_tick *tick, hapi_trail *trail)
{
  if (trail->rows == 0 || trail->wait > 0) {
    trail->wait -= trail->wait > 0;
    return;
  }
  trail->wait = trail->stride - 1;
  uint64_t row = atomic_load_explicit(&trail->written, memory_order_relaxed);
  hapi_trail_row *head = &trail->heads[row % trail->rows];
  /* A step goes from the tick's time to the next one's; model SINGLE shows the world as it is. */
  int64_t step_ns =
      tick->facts.model == HAP_MODEL_SINGLE ? 0 : (int64_t)(1e9 * tick->facts.period + 0.5);
  atomic_store_explicit(&head->time_ns, tick->facts.now_ns, memory_order_release);
  atomic_store_explicit(&head->bodies_ns, tick->facts.now_ns + step_ns, memory_order_release);
  atomic_store_explicit(&head->body_high, tick->bodies.high, memory_order_release);
  trail_bodies(&tick->bodies, tick->facts.model, hapi_trail_bodies(trail, row));
  trail_pointers(&tick->pointers, hapi_trail_pointers(trail, row));
  atomic_store_explicit(&trail->written, row + 1, memory_order_release);
}

static void path_take_declared(const hapi_pointer *p, hap_wrench *io)
{
  hap_wrench felt;
  hapi_coupling_felt(p, &p->declared.given, &felt);
  hapi_v3_sub(io->force, felt.force, io->force);
  hapi_v3_sub(io->torque, felt.torque, io->torque);
}

void hapi_tick_report_path(const hapi_tick *tick, hapi_path *path)
{
  hapi_path_pointer *out = hapi_path_next(path);
  if (out == NULL) {
    return;
  }
  for (uint32_t i = 0; i < tick->capacity.pointers; ++i) {
    const hapi_pointer *p = &tick->pointers.of[i];
    out[i] = (hapi_path_pointer){.generation = p->generation,
                                 .is_tool = p->shape.hull != NULL,
                                 .turns = p->device.turns,
                                 .three_dof = p->device.three_dof,
                                 .rigid = p->rigid,
                                 .radius = p->shape.radius,
                                 .stiffness = p->surface.stiffness,
                                 .damping = p->surface.damping,
                                 .finger_radius = p->surface.finger_radius,
                                 .pose = p->pose,
                                 .twist = p->twist,
                                 .wrench = p->wrench};
    if (p->declared.any) { /* looking back knows of contacts alone */
      path_take_declared(p, &out[i].wrench);
    }
  }
  hapi_path_send(path, tick->facts.now_ns);
}

void hapi_tick_report_work(const hapi_tick *tick, hapi_tick_work *out)
{
  out->done = tick->rows.work.all;
  out->rows = tick->rows.solver.row_count;
  out->owned = out->awake = 0;
  for (uint32_t i = 0; i < tick->bodies.live_count; ++i) {
    uint32_t flags = tick->bodies.of[tick->bodies.live[i]].flags;
    bool owned = (flags & HAPI_BODY_OWNED) != 0;
    out->owned += owned;
    out->awake += owned && (flags & HAPI_BODY_RESTING) == 0;
  }
}

void hapi_tick_report_poses(const hapi_tick *tick, hapi_poses *out)
{
  hapi_poses_body *bodies = hapi_poses_bodies(out);
  for (uint32_t i = 0; i < tick->bodies.live_count; ++i) {
    const hapi_local_body *in = &tick->bodies.of[tick->bodies.live[i]];
    bodies[i].slot = tick->bodies.live[i];
    bodies[i].generation = in->generation;
    bodies[i].pose = in->pose;
    bodies[i].twist = in->twist;
  }
  out->body_count = tick->bodies.live_count;
  out->pointer_count = tick->pointers.high;
  out->model_number = tick->facts.model_number;
  out->tick = tick->facts.tick;
  out->side_count = report_sides(&tick->touches.tool, hapi_poses_sides(out));
  for (uint32_t i = 0; i < tick->pointers.high; ++i) {
    const hapi_pointer *in = &tick->pointers.of[i];
    hapi_poses_pointer *to = &hapi_poses_pointers(out)[i];
    to->generation = in->shape.hull != NULL ? in->generation : 0;
    if (to->generation != 0) {
      to->pose = in->pose;
      to->twist = in->twist;
    }
  }
}

/* ---- the trace ---- */

void hapi_tick_trace(const hapi_tick *tick, hap_trace_row *out)
{
  out->tick = tick->facts.tick - 1; /* the one that has just been run */
  out->model_age_s = 1e-9 * (double)(tick->facts.now_ns - tick->facts.state_ns);
  out->bodies = tick->bodies.live_count;
  out->contacts = tick->touches.pushing;
  out->pointer_count = 0;
  for (uint32_t i = 0; i < tick->capacity.pointers && i < HAP_TRACE_POINTERS_MAX; ++i) {
    const hapi_pointer *p = &tick->pointers.of[i];
    out->pointer_count = p->generation != 0 ? i + 1 : out->pointer_count;
    hapi_v3_copy(p->pose.position, out->pointers[i].position);
    hapi_v3_copy(p->wrench.force, out->pointers[i].force);
    hapi_v3_copy(p->wrench.torque, out->pointers[i].torque);
  }
  out->body_count = tick->watch.count;
  for (uint32_t i = 0; i < tick->watch.count; ++i) {
    uint32_t slot = tick->watch.slot[i];
    hapi_v3_copy(
        slot == HAPI_SLOT_NONE ? tick->watch.position[i] : tick->bodies.of[slot].pose.position,
        out->body_position[i]);
  }
}

uint64_t hapi_tick_hash_axes(const hapi_tick *tick, uint32_t pointer, uint64_t hash)
{
  const hapi_pointer *p = &tick->pointers.of[pointer];
  const hapi_outputs *outputs = p->drives ? &tick->outputs[pointer] : NULL;
  for (uint32_t i = 0; p->has_axes && i < tick->axes[pointer].count; ++i) {
    hash = hapi_hash_doubles(hash, &tick->axes[pointer].of[i].at, 1);
    hash = hapi_hash_doubles(hash, &tick->axes[pointer].of[i].rate, 1);
  }
  for (uint32_t i = 0; outputs != NULL && i < HAP_AXES_MAX; ++i) {
    hash = hapi_hash_doubles(hash, &outputs->axes[i].force, 1);
  }
  return outputs != NULL ? hapi_hash_doubles(hash, outputs->amplitudes, HAP_VIBRATORS_MAX) : hash;
}

uint64_t hapi_tick_hash(const hapi_tick *tick, uint64_t hash)
{
  for (uint32_t i = 0; i < tick->pointers.high; ++i) {
    const hapi_pointer *p = &tick->pointers.of[i];
    if (p->generation != 0) {
      hash = hapi_hash_doubles(hash, p->pose.position, 3);
      hash = hapi_hash_doubles(hash, p->device.wrench.force, 3);
      hash = hapi_hash_doubles(hash, p->device.wrench.torque, 3);
      hash = p->has_axes || p->drives ? hapi_tick_hash_axes(tick, i, hash) : hash;
    }
  }
  for (uint32_t i = 0; i < tick->bodies.live_count; ++i) {
    const hapi_local_body *body = &tick->bodies.of[tick->bodies.live[i]];
    hash = hapi_hash_motion(hash, &body->pose, &body->twist);
  }
  return hash;
}
