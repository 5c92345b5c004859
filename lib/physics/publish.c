/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/assert.h"
#include "base/clock.h"
#include "base/vec.h"
#include "physics/brace.h"
#include "physics/physics_internal.h"

/* The local model: what the loop is told after a step. Each part writes its own into the message.
 */

/* What a model is made of. */
typedef struct publishing {
  const hapi_cycle *cycle;
  const hapi_world *world;
  const hapi_slots *slots;
  const hapi_relief *relief;
  const hapi_answers *answers;
  hapi_account *account;
} publishing;

static publishing publishing_of(hapi_physics *physics)
{
  return (publishing){&physics->cycle,         &physics->world,
                      &physics->near.slots,    &physics->near.neighbors.relief,
                      &physics->probe.answers, &physics->account};
}

static double keep_per_tick(const hapi_cycle *cycle, double damping)
{
  double share = damping < 0.0 ? 0.0 : damping > 1.0 ? 1.0 : damping; /* lost in a step of H */
  if (share == 0.0) {
    return 1.0;
  }
  return pow(1.0 - share, hapi_tick_ratio(cycle));
}

static void fill_brace(const hapi_body_slot *slot, dBodyID body, hapi_slot_account *of,
                       hapi_model_body *out)
{
  const uint32_t others = HAPI_BODY_OWNED | HAPI_BODY_MEASURED | HAPI_BODY_DRIVEN;
  if ((out->flags & others) != 0) {
    return;
  }
  if (!of->outside) {
    hapi_brace_guess(slot, body, of);
  }
  if (hapi_v3_norm(of->brace) > 0.0 || hapi_v3_norm(of->brace + 3) > 0.0) {
    out->flags |= HAPI_BODY_BRACED;
    memcpy(out->brace, of->brace, sizeof out->brace);
  }
}

static double fill_inertia(dBodyID body, hapi_model_body *out)
{
  dMass mass;
  dBodyGetMass(body, &mass);
  hapi_matrix_read(mass.I, out->inertia);
  hapi_m3_invert(out->inertia, out->inverse_inertia);
  return mass.mass;
}

/* What the loop needs to move the body itself. */
static void fill_dynamics(const publishing *p, const hapi_body_slot *slot,
                          const hapi_body_answer *answer, hapi_slot_account *of,
                          hapi_model_body *out)
{
  const hapi_known_body *known = &p->world->bodies.entries[slot->known];
  dBodyID body = known->body;
  out->mass = fill_inertia(body, out);
  /* Whether the loop is to let its inertia turn. One that does not spin yet may do so before the
   * next sync: that is the tick's to see. */
  hap_effect_wish wish = hapi_wish(p->cycle->wishes, HAP_EFFECT_GYRO);
  bool turns = dBodyGetMaxAngularSpeed(body) > 0.0;
  if ((dBodyGetGyroscopicMode(body) != 0 && wish != HAP_EFFECT_OFF &&
       (wish == HAP_EFFECT_ON || (turns && !hapi_turns_alike(out->inertia))))) {
    out->flags |= HAPI_BODY_GYROSCOPIC;
  }
  if (dBodyGetGravityMode(body) != 0) {
    dVector3 gravity;
    dWorldGetGravity(p->world->ode.world, gravity);
    hapi_v3_copy(gravity, out->gravity);
  }
  hapi_v3_copy(known->rest->user_force, out->user_wrench);
  hapi_v3_copy(known->rest->user_torque, out->user_wrench + 3);
  hapi_v3_copy(out->gravity, of->falls);
  if (out->mass > 0.0) {
    hapi_v3_madd(of->falls, 1.0 / out->mass, known->rest->user_force, of->falls);
  }
  double linear = dBodyGetLinearDampingThreshold(body);
  double angular = dBodyGetAngularDampingThreshold(body);
  out->linear_keep = keep_per_tick(p->cycle, dBodyGetLinearDamping(body));
  out->angular_keep = keep_per_tick(p->cycle, dBodyGetAngularDamping(body));
  out->linear_threshold2 = linear * linear;
  out->angular_threshold2 = angular * angular;
  out->max_angular_speed = dBodyGetMaxAngularSpeed(body);
  memcpy(out->gain_taken, slot->gain_taken, sizeof out->gain_taken);
  memcpy(out->response, answer->response, sizeof out->response);
  fill_brace(slot, body, of, out);
}

static void vector_scale(double scale, double *io, int count)
{
  for (int i = 0; i < count; ++i) {
    io[i] *= scale;
  }
}

/* The loop is in the hand's time, in which a body of mass m goes s times as fast under the same
 * forces as one of mass m / s^2 would. Impulses then are force times the hand's time. In a pause
 * bodies are walls. */
static void body_scale(double scale, hapi_model_body *io)
{
  if (scale == 1.0) {
    return;
  }
  double slow2 = scale * scale;
  hapi_v3_scale(scale, io->twist.linear, io->twist.linear);
  hapi_v3_scale(scale, io->twist.angular, io->twist.angular);
  vector_scale(slow2, io->b, 6);
  vector_scale(slow2, io->gravity, 3);
  vector_scale(slow2, io->response[0], 36);
  io->linear_threshold2 *= slow2;
  io->angular_threshold2 *= slow2;
  io->max_angular_speed *= scale;
  if (scale > 0.0) {
    io->mass /= slow2;
    io->held_mass /= slow2;
    vector_scale(1.0 / slow2, io->inertia, 9);
    vector_scale(slow2, io->inverse_inertia, 9);
  } else {
    const uint32_t roles = HAPI_BODY_OWNED | HAPI_BODY_MEASURED | HAPI_BODY_RESTING |
                           HAPI_BODY_WHOLE | HAPI_BODY_ALONE | HAPI_BODY_GYROSCOPIC |
                           HAPI_BODY_BRACED;
    io->flags = (io->flags & ~roles) | HAPI_BODY_DRIVEN;
  }
}

static bool is_zero(const hap_twist *twist)
{
  return hapi_v3_dot(twist->linear, twist->linear) == 0.0 &&
         hapi_v3_dot(twist->angular, twist->angular) == 0.0;
}

/* A kinematic body that is moved by its pose alone has the velocity of its way in the next step: in
 * the loop it would stand until the next sync else. */
static void course_expect(const hapi_cycle *cycle, const hapi_course_past *past,
                          hapi_model_course *out, hap_twist *io_twist)
{
  hapi_course_find(past, io_twist, cycle->time_scale * cycle->probe_step_s, out);
  if (is_zero(io_twist)) {
    hapi_course_mean(out, io_twist);
  }
  hapi_course_scale(cycle->time_scale, out);
}

static void fill_course(const publishing *p, const hapi_known_body *known, hapi_slot_account *of,
                        hapi_model *model, hapi_model_body *out)
{
  const hapi_posed_way *way = known->posed ? &known->rest->way : NULL;
  hapi_model_course *course = &hapi_model_courses(model)[model->course_count];
  double period = p->cycle->probe_step_s;
  if (way != NULL && way->fresh) {
    hapi_course_stand(&of->course, &way->before, period, way->stood);
  } else if (way != NULL && !of->course.known) {
    hapi_course_note(&of->course, &way->before, &out->twist, 0.0);
  }
  hapi_course_note(&of->course, &out->pose, &out->twist, p->cycle->step_s);
  if (!(p->cycle->time_scale > 0.0)) {
    return; /* a pause: it stands */
  }
  course_expect(p->cycle, &of->course, course, &out->twist);
  course->begins = way != NULL && way->fresh;
  course->before = way != NULL ? way->before : out->pose;
  if (p->cycle->model == HAP_MODEL_CONTACT || course->begins != 0) {
    out->course = ++model->course_count;
  }
}

static bool fill_body(const publishing *p, uint32_t index, hapi_model *model, hapi_model_body *out)
{
  const hapi_body_slot *slot = &p->slots->bodies[index];
  hapi_slot_account *of = hapi_account_of(p->account, index);
  const hapi_body_answer *answer = &p->answers->bodies[index];
  HAPI_ASSERT_INDEX(slot->known, p->world->bodies.high);
  dBodyID body = p->world->bodies.entries[slot->known].body;
  memset(out, 0, sizeof *out);
  out->slot = index;
  out->generation = slot->generation;
  out->epoch = slot->epoch;
  out->birth = p->world->bodies.entries[slot->known].rest->birth;
  out->tag = dBodyGetWorld(body) == p->world->ode.world ? body : NULL; /* else a carrier */
  out->flags = slot->flags | (slot->pushed ? 0u : (uint32_t)HAPI_BODY_FOLLOWS);
  out->flags |= hapi_extent_is_still(&p->world->bodies.entries[slot->known]) ? HAPI_BODY_STILL : 0u;
  hapi_pose_read(body, &out->pose);
  hapi_twist_read(body, &out->twist);
  of->course.known &= (slot->flags & HAPI_BODY_DRIVEN) != 0;
  if ((slot->flags & HAPI_BODY_DRIVEN) != 0) {
    fill_course(p, &p->world->bodies.entries[slot->known], of, model, out);
  }
  memcpy(out->b, answer->b, sizeof out->b);
  memcpy(out->residual, of->residual, sizeof out->residual);
  hapi_v3_copy(of->impulse_taken, out->impulse_taken);
  hapi_v3_copy(of->angular_impulse_taken, out->impulse_taken + 3);
  if (p->cycle->model == HAP_MODEL_CONTACT) {
    fill_dynamics(p, slot, answer, of, out);
    if ((slot->flags & HAPI_BODY_MEASURED) == 0) {
      memset(out->b, 0, sizeof out->b); /* the loop knows it better, or nobody measured it */
    }
    if ((slot->flags & (HAPI_BODY_OWNED | HAPI_BODY_MEASURED | HAPI_BODY_DRIVEN)) == 0) {
      hapi_v3_copy(of->unheld, out->b);
    }
    if ((slot->flags & HAPI_BODY_OWNED) != 0 && dBodyGetNumJoints(body) == 0) {
      hapi_v3_copy(of->falls, out->b); /* over the age of the model, when it comes in */
    }
  }
  if (slot->held || p->cycle->model == HAP_MODEL_SINGLE) { /* forces may be bound to it */
    out->held_mass = fill_inertia(body, out);
  }
  body_scale(p->cycle->time_scale, out);
  bool sound = hapi_pose_is_sound(body) && hapi_finite(out->twist.linear, 3) &&
               hapi_finite(out->twist.angular, 3);
  p->account->counts.states_rejected += !sound;
  return sound;
}

static void fill_contact(const hapi_contact_slot *slot, const hapi_contact_answer *answer,
                         uint32_t index, hapi_model_contact *out)
{
  memset(out, 0, sizeof *out);
  out->slot = index;
  out->generation = slot->generation;
  out->body = slot->body;
  out->pointer = slot->pointer;
  out->pointer_generation = slot->pointer_generation;
  hapi_v3_copy(slot->point_body, out->point_body);
  hapi_v3_copy(slot->normal_body, out->normal_body);
  memcpy(out->a, answer->a, sizeof out->a);
  memcpy(out->turn, answer->turn, sizeof out->turn);
  out->geom = slot->geom;
  out->geom_number = slot->geom_number;
  out->mu = slot->said.mu;
  out->feel = slot->said.feel;
  out->has_shape = slot->has_shape;
  out->hidden = slot->hidden;
  out->shape = slot->shape;
  out->shape_pose = slot->shape_pose;
}

/* False: a point of a hull, and no room for more of them. */
static bool fill_tool(const publishing *p, const hapi_contact_slot *slot, hapi_model *out,
                      hapi_model_contact *contact)
{
  if (!slot->is_tool) {
    return true;
  }
  if (out->tool_count == p->cycle->config->capacity.tool_points) {
    ++p->account->counts.dropped;
    return false;
  }
  hapi_model_tools(out)[out->tool_count] = slot->tool;
  contact->tool = ++out->tool_count;
  return true;
}

/* As the bodies. */
static void contact_scale(double scale, hapi_model_contact *io)
{
  if (scale != 1.0) {
    vector_scale(scale * scale, io->a[0], 18);
    vector_scale(scale * scale, io->turn, 6);
  }
}

static void publish_contacts(const publishing *p, hapi_model *out)
{
  hapi_model_contact *contacts = hapi_model_contacts(out);
  out->contact_count = 0;
  out->tool_count = 0;
  HAPI_ASSERT(p->relief->count <= p->cycle->config->capacity.triangles);
  out->triangle_count = p->relief->count;
  memcpy(hapi_model_triangles(out), p->relief->triangles,
         p->relief->count * sizeof *p->relief->triangles);
  for (uint32_t i = 0; i < p->slots->contact_high; ++i) {
    const hapi_contact_slot *slot = &p->slots->contacts[i];
    if (slot->phase == HAPI_SLOT_LIVE) {
      HAPI_ASSERT_INDEX(out->contact_count, p->cycle->config->capacity.contacts);
      hapi_model_contact *contact = &contacts[out->contact_count];
      fill_contact(slot, &p->answers->contacts[i], i, contact);
      contact_scale(p->cycle->time_scale, contact);
      contact->told = p->relief->told[i];
      contact->has_shape |= contact->told.count > 0;
      out->contact_count += fill_tool(p, slot, out, contact);
    }
  }
}

static void publish_watch(const hapi_watch *watch, const hapi_body_table *table, hapi_model *out)
{
  out->watch_count = watch->count;
  for (uint32_t i = 0; i < watch->count; ++i) {
    HAPI_ASSERT(watch->bodies[i] == HAPI_NONE || watch->bodies[i] < table->high);
    const hapi_known_body *known =
        watch->bodies[i] != HAPI_NONE ? &table->entries[watch->bodies[i]] : NULL;
    bool local = known != NULL && known->slot != HAPI_NONE;
    out->watch_slot[i] = local ? known->slot : HAPI_SLOT_NONE;
    if (known != NULL && hapi_pose_is_sound(known->body)) {
      hapi_v3_copy(dBodyGetPosition(known->body), out->watch_position[i]);
    }
  }
}

/* ---- the joints of the range, as the loop has them ---- */

/* A softness from which on a constraint is a spring, not a rigid one with rounding; as of
 * contacts. */
#define SOFT_CFM 1e-6

/* ODE: a stop at pi and beyond is never met, as the angle goes on at -pi. */
#define WHOLE_TURN (M_PI - 1e-9)

typedef dReal (*parameter_fn)(dJointID, int);

static const hapi_body_slot *slot_of(const publishing *p, uint32_t body)
{
  uint32_t slot = body != HAPI_NONE ? p->world->bodies.entries[body].slot : HAPI_NONE;
  return slot != HAPI_NONE ? &p->slots->bodies[slot] : NULL;
}

static hapi_softness softness_of(const publishing *p, double erp, double cfm)
{
  hapi_softness out = {erp, cfm, cfm > SOFT_CFM};
  hapi_soften(hapi_tick_ratio(p->cycle), &out.erp, &out.cfm);
  out.cfm *= hapi_cycle_scale(p->cycle);
  return out;
}

static uint32_t stop_flag(double stop, bool turns, uint32_t flag)
{
  bool there = turns ? fabs(stop) < WHOLE_TURN : isfinite(stop);
  return there ? flag : 0u;
}

static void fill_limit(const publishing *p, dJointID joint, parameter_fn get, int group, bool turns,
                       hapi_model_limit *out)
{
  out->low = get(joint, dParamLoStop + group);
  out->high = get(joint, dParamHiStop + group);
  if (out->low <= out->high) { /* else ODE has none */
    out->flags |= stop_flag(out->low, turns, HAPI_LIMIT_LOW);
    out->flags |= stop_flag(out->high, turns, HAPI_LIMIT_HIGH);
  }
  if (out->flags == (HAPI_LIMIT_LOW | HAPI_LIMIT_HIGH) && out->low == out->high) {
    out->flags = HAPI_LIMIT_LOCKED;
  }
  out->stop = softness_of(p, get(joint, dParamStopERP + group), get(joint, dParamStopCFM + group));
  out->bounce = hapi_wish_is_off(p->cycle->wishes, HAP_EFFECT_RESTITUTION)
                    ? 0.0
                    : get(joint, dParamBounce + group);
  out->speed = hapi_cycle_scale(p->cycle) * get(joint, dParamVel + group);
  out->force = get(joint, dParamFMax + group);
  out->motor_cfm = hapi_cycle_scale(p->cycle) * get(joint, dParamCFM + group);
  out->fudge = get(joint, dParamFudgeFactor + group);
  bool drives = out->force > 0.0 && (out->flags & HAPI_LIMIT_LOCKED) == 0;
  out->flags |= drives ? HAPI_LIMIT_MOTOR : 0u;
}

/* Forces are those of the application's time, velocities those of the hand's. */
static void fill_spring(const publishing *p, dJointID joint, uint32_t axis, hapi_model_limit *out)
{
  const hapi_spring *spring = hapi_spring_of(p->world->springs, joint, axis);
  double scale = hapi_cycle_scale(p->cycle);
  if (spring != NULL) {
    out->flags |= HAPI_LIMIT_SPRING;
    out->spring = spring->is;
    out->spring.damping /= scale;
    out->spring.inertia /= scale * scale;
  }
}

static void fill_parameters(const publishing *p, const hapi_known_joint *known, dJointID joint,
                            hapi_model_joint *out)
{
  dWorldID world = p->world->ode.world;
  const hapi_joint_traits *traits = hapi_joint_traits_of(joint);
  out->linear = softness_of(p, dWorldGetERP(world), dWorldGetCFM(world));
  out->angular = out->along = out->linear;
  if (traits->soft == HAPI_SOFT_OWN) { /* a ball or a fixed joint has no free axis */
    out->linear = softness_of(p, traits->get(joint, dParamERP), traits->get(joint, dParamCFM));
    return;
  }
  for (int i = 0; i < traits->groups; ++i) {
    bool turns = known->kind != HAPI_JOINT_SLIDER;
    fill_limit(p, joint, traits->get, i * dParamGroup, turns, &out->limits[i]);
    fill_spring(p, joint, (uint32_t)i, &out->limits[i]);
  }
  if (traits->soft == HAPI_SOFT_SUSPENSION) {
    out->limits[1].flags &= HAPI_LIMIT_MOTOR; /* ODE never stops the second axis */
    out->along = softness_of(p, traits->get(joint, dParamSuspensionERP),
                             traits->get(joint, dParamSuspensionCFM));
  }
}

static void measured_scale(double scale, hapi_measured_joint *io)
{
  if (scale == 1.0) {
    return;
  }
  io->ahead_s /= scale;
  for (uint32_t i = 0; i < io->row_count; ++i) {
    io->rows[i].softness.cfm *= scale;
    io->rows[i].speed *= scale;
    io->rows[i].impulse /= scale;
  }
}

static void joint_fill(const publishing *p, const hapi_known_joint *known, hapi_model_joint *out)
{
  HAPI_ASSERT_INDEX(known->slot, p->world->joints.slot_count);
  memset(out, 0, sizeof *out);
  const hapi_joint_measurement *measured = known->carried ? NULL : known->measurement;
  uint32_t first = measured != NULL ? measured->first : 0;
  const hapi_body_slot *a = slot_of(p, known->index[first]);
  const hapi_body_slot *b = slot_of(p, known->index[1 - first]);
  out->slot = known->slot;
  out->generation = p->world->joints.slots[known->slot].generation;
  out->kind = known->kind;
  out->body_a = (uint32_t)(a - p->slots->bodies);
  out->generation_a = a->generation;
  out->body_b = b != NULL ? (uint32_t)(b - p->slots->bodies) : HAPI_SLOT_NONE;
  out->generation_b = b != NULL ? b->generation : 0;
  out->told = dJointGetFeedback(known->joint) != NULL;
  if (measured != NULL) {
    out->kind = HAPI_JOINT_MEASURED;
    out->place = measured->place;
    out->measured = measured->found;
    measured_scale(hapi_cycle_scale(p->cycle), &out->measured);
    hapi_joint_axis axes[HAPI_JOINT_LIMITS] = {{0}};
    int count = hapi_joint_axes(known, axes);
    for (int i = 0; i < count; ++i) {
      fill_limit(p, known->joint, axes[i].get, axes[i].group, !axes[i].slides, &out->limits[i]);
    }
    return;
  }
  out->place = known->place;
  fill_parameters(p, known, known->joint, out);
}

/* ---- the message ---- */

static uint32_t count_bounces(const hapi_range *range, hapi_model *model)
{
  if (model->model != HAP_MODEL_CONTACT) {
    return 0;
  }
  uint32_t count = range->number == model->number ? range->bounces : 0;
  for (uint32_t i = 0; i < model->joint_count; ++i) {
    for (int k = 0; k < HAPI_JOINT_LIMITS; ++k) {
      count += hapi_model_joints(model)[i].limits[k].bounce > 0.0;
    }
  }
  return count;
}

void hapi_physics_make_model(hapi_physics *physics, int64_t state_ns, int64_t valid_from_ns)
{
  HAPI_ASSERT(hapi_lock_in_callback(&physics->lock));
  hapi_cycle *cycle = &physics->cycle;
  hapi_model *out = hapi_exchange_model_back(physics->config.exchange);
  const publishing p = publishing_of(physics);
  ++cycle->model_number;
  HAPI_ASSERT(cycle->probe_step_s > 0.0);
  out->number = cycle->model_number;
  out->state_ns = state_ns;
  out->tick = cycle->state != NULL ? cycle->state->tick : 0;
  out->valid_from_ns = valid_from_ns;
  out->blend_s = cycle->model == HAP_MODEL_IMPULSE ? cycle->probe_step_s : 0.0;
  out->model = cycle->model;
  out->impulse_pose = cycle->config->impulse_pose;
  out->wishes = cycle->wishes;
  out->max_sweeps = cycle->settings.max_sweeps;
  out->row_updates = cycle->settings.row_updates;
  out->force_drift = cycle->settings.force_drift;
  out->tick_work =
      hapi_room_work(physics->room.pace + physics->room.margin, physics->config.haptic_hz);
  out->sent_ns = hapi_tape_sent(&physics->tape, cycle);
  out->period_s = hapi_cycle_period(
      cycle, hapi_tape_wanted_model(&physics->tape, &physics->wanted, cycle, true));
  out->look_ahead_s = cycle->config->look_ahead_s;
  out->time_scale = cycle->time_scale;
  out->tick_budget_ns = hapi_dial_tick_budget(&physics->dial, physics->config.haptic_hz);
  hapi_model_body *bodies = hapi_model_bodies(out);
  out->body_count = out->course_count = 0;
  for (uint32_t i = 0; i < p.slots->body_high; ++i) {
    HAPI_ASSERT(out->body_count < p.cycle->config->capacity.bodies);
    if (p.slots->bodies[i].phase == HAPI_SLOT_LIVE &&
        fill_body(&p, i, out, &bodies[out->body_count])) {
      ++out->body_count;
    }
  }
  publish_contacts(&p, out);
  hapi_feels_publish(&physics->near, out);
  out->cross_count = 0;
  for (uint32_t i = 0; i < out->contact_count; ++i) {
    hapi_cross_publish(&physics->cross, hapi_model_contacts(out)[i].slot, i, out);
  }
  for (uint32_t i = 0; i < out->cross_count && cycle->time_scale != 1.0; ++i) {
    vector_scale(cycle->time_scale * cycle->time_scale, hapi_model_crosses(out)[i].a[0], 18);
  }
  const hapi_range *range = &physics->near.range;
  int64_t begin_ns = hapi_clock_now();
  out->joint_count = 0;
  if (out->model == HAP_MODEL_CONTACT && range->number == out->number) {
    hapi_joints_take_slots(&physics->world.joints, out->number, range->mechanism.joints,
                           range->mechanism.joint_count);
    uint32_t count = range->mechanism.joint_count;
    hapi_model_joint *to = hapi_model_joints(out);
    HAPI_ASSERT(count <= p.cycle->config->capacity.joints);
    for (uint32_t i = 0; i < count; ++i) {
      joint_fill(&p, &p.world->joints.entries[range->mechanism.joints[i]], &to[i]);
    }
    out->joint_count = count;
  }
  physics->counts.own.joints_s += 1e-9 * (double)(hapi_clock_now() - begin_ns);
  out->bounces = count_bounces(&physics->near.range, out);
  publish_watch(&physics->watch, &physics->world.bodies, out);
  hap_stats *stats = &physics->counts.own.stats;
  const hapi_nearby *near = &physics->near;
  stats->model.neighbours = hapi_neighbors_bodies(near);
  stats->model.pointer_contacts = out->contact_count;
  if (out->model == HAP_MODEL_CONTACT && near->range.number == out->number) {
    stats->model.pointer_contacts +=
        near->range.near->tool_pair_count; /* whose points are found later */
  }
  if (stats->model.neighbours > stats->model.neighbours_max) {
    stats->model.neighbours_max = stats->model.neighbours;
  }
  out->touches = physics->counts.own.stats.model.pointer_contacts;
  hapi_effects_note(physics->counts.own.effects, cycle, &physics->world, &physics->near,
                    &physics->probe.answers, out);
  /* First: the contact thread waits for the loop to use the model. */
  hapi_range_publish(&physics->near);
}

void hapi_physics_send_model(hapi_physics *physics)
{
  hapi_tape_model(&physics->tape, hapi_exchange_model_back(physics->config.exchange));
  hapi_exchange_model_publish(physics->config.exchange);
}

/* ---- what the application has set in after_step ---- */

/* The callback may have destroyed bodies without a word: those with a geom are known to live. */
static void space_note_living(const hapi_body_table *table, hapi_slots *slots, dSpaceID space)
{
  int count = dSpaceGetNumGeoms(space);
  for (int i = 0; i < count; ++i) {
    dGeomID geom = dSpaceGetGeom(space, i);
    if (dGeomIsSpace(geom)) {
      space_note_living(table, slots, (dSpaceID)geom);
      continue;
    }
    uint32_t index = hapi_bodies_find(table, dGeomGetBody(geom));
    const hapi_known_body *known = index != HAPI_NONE ? &table->entries[index] : NULL;
    if (known != NULL && known->slot != HAPI_NONE && !hapi_mark_is_gone(known)) {
      slots->bodies[known->slot].alive = true;
    }
  }
}

/* NULL: it is not known to live. */
static dBodyID body_living(const publishing *p, uint32_t slot)
{
  const hapi_body_slot *of = slot != HAPI_SLOT_NONE ? &p->slots->bodies[slot] : NULL;
  return of != NULL && of->alive ? p->world->bodies.entries[of->known].body : NULL;
}

/* Whether the body that a joint has is the known one at that address, and not a later one. */
static bool body_is(const publishing *p, dBodyID body, const hapi_known_joint *known, int which)
{
  return body == known->bodies[which] &&
         (body == NULL || (known->index[which] != HAPI_NONE &&
                           !hapi_mark_is_gone(&p->world->bodies.entries[known->index[which]])));
}

/* ODE's own order: the world comes second. */
static bool joint_is_kin(const publishing *p, dJointID joint, const hapi_known_joint *known)
{
  dBodyID a = dJointGetBody(joint, 0);
  dBodyID b = dJointGetBody(joint, 1);
  return dJointGetType(joint) == known->name.type && body_is(p, a != NULL ? a : b, known, 0) &&
         body_is(p, a != NULL ? b : NULL, known, 1);
}

/* The joint that has the name now: one that was made in place of another has its name at any
 * address. NULL: there is none, or its bodies are not known to live. */
static dJointID joint_named(const publishing *p, const hapi_model_joint *joint,
                            const hapi_known_joint *known)
{
  const uint32_t slots[2] = {joint->body_a, joint->body_b};
  for (int i = 0; i < 2; ++i) {
    dBodyID body = body_living(p, slots[i]);
    uint32_t older = 0;
    for (int k = body != NULL ? dBodyGetNumJoints(body) : 0; k > 0; --k) {
      dJointID of = dBodyGetJoint(body, k - 1); /* the newest comes first */
      if (joint_is_kin(p, of, known) && older++ == known->name.rank) {
        return of;
      }
    }
  }
  return NULL;
}

static void body_renew(const publishing *p, hapi_model *model, hapi_model_body *io)
{
  dBodyID body = io->course != 0 ? body_living(p, io->slot) : NULL;
  hap_twist twist;
  if (body == NULL) {
    return;
  }
  hapi_twist_read(body, &twist);
  if (!hapi_finite(twist.linear, 3) || !hapi_finite(twist.angular, 3)) {
    return;
  }
  hapi_slot_account *of = hapi_account_of(p->account, io->slot);
  hapi_model_course *course = &hapi_model_courses(model)[io->course - 1];
  uint32_t begins = course->begins;
  hap_pose before = course->before;
  hapi_course_set(&of->course, &twist, p->cycle->step_s);
  course_expect(p->cycle, &of->course, course, &twist);
  course->begins = begins;
  course->before = before;
  hapi_v3_scale(p->cycle->time_scale, twist.linear, io->twist.linear);
  hapi_v3_scale(p->cycle->time_scale, twist.angular, io->twist.angular);
}

void hapi_physics_renew_model(hapi_physics *physics)
{
  hapi_model *model = hapi_exchange_model_back(physics->config.exchange);
  const publishing p = publishing_of(physics);
  if (model->model != HAP_MODEL_CONTACT || (model->course_count == 0 && model->joint_count == 0)) {
    return;
  }
  for (uint32_t i = 0; i < p.slots->body_high; ++i) {
    physics->near.slots.bodies[i].alive = false;
  }
  const hapi_spaces *spaces = &physics->world.spaces;
  for (uint32_t i = 0; i < spaces->count; ++i) {
    space_note_living(&physics->world.bodies, &physics->near.slots, spaces->list[i].space);
  }
  for (uint32_t i = 0; i < model->body_count; ++i) {
    body_renew(&p, model, &hapi_model_bodies(model)[i]);
  }
  for (uint32_t i = 0; i < model->joint_count; ++i) {
    hapi_model_joint *joint = &hapi_model_joints(model)[i];
    const hapi_known_joint *known =
        &physics->world.joints.entries[physics->near.range.mechanism.joints[i]];
    dJointID now = known->carried ? joint_named(&p, joint, known) : NULL;
    if (now != NULL) {
      memset(joint->limits, 0, sizeof joint->limits);
      fill_parameters(&p, known, now, joint);
    }
  }
}
