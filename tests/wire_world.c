/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tests/wire_world.h"

static void wire_shape(wire_dice *d, hapi_shape *out)
{
  out->kind = (hapi_shape_kind)dice_below(d, HAPI_SHAPE_HULL);
  out->radius = 1.0 + dice_unit(d);
  out->rounding = 1.0 + dice_unit(d);
  for (int i = 0; i < 3; ++i) {
    out->half[i] = 1.0 + dice_unit(d);
  }
}

static wire_dice dice_of(uint32_t kind, uint32_t slot, uint32_t generation)
{
  wire_dice d = {.state = (uint64_t)kind << 60 | (uint64_t)slot << 20 | generation};
  for (int i = 0; i < 5; ++i) {
    (void)dice_below(&d, 2);
  }
  return d;
}

/* What never changes of a body, then what does. */
static void wire_body(const wire_world *w, uint32_t slot, uint32_t generation, hapi_model_body *out)
{
  wire_dice d = dice_of(1, slot, generation);
  memset(out, 0, sizeof *out);
  out->slot = slot;
  out->generation = generation;
  out->birth = 1000 * generation + slot;
  out->tag = slot % 5 == 0 ? NULL : (void *)(uintptr_t)(0x10000 + slot);
  out->mass = 2.0 + dice_unit(&d);
  out->held_mass = 1.0 + dice_unit(&d);
  dice_fill(&d, out->gravity, 3);
  dice_fill(&d, out->user_wrench, 6);
  out->linear_keep = 0.5 + 0.5 * dice_unit(&d);
  out->angular_keep = 0.5 + 0.5 * dice_unit(&d);
  out->linear_threshold2 = 1.0 + dice_unit(&d);
  out->angular_threshold2 = 1.0 + dice_unit(&d);
  out->max_angular_speed = slot % 3 == 0 ? HUGE_VAL : 5.0;
  dice_fill(&d, out->inertia, 9);
  dice_fill(&d, out->inverse_inertia, 9);
  for (int i = 0; i < 9; i += 4) {
    out->inertia[i] = 2.0 + dice_unit(&d);
    out->inverse_inertia[i] = 2.0 + dice_unit(&d);
  }
  dice_pose(&d, &out->pose);
  bool rests = dice_below(&d, 100) < w->rest;
  d.state += rests ? 0 : w->number * 977;
  (void)dice_below(&d, 2);
  out->epoch = dice_below(&d, 9);
  out->flags = slot % 7 == 0 ? HAPI_BODY_DRIVEN : slot % 11 == 0 ? HAPI_BODY_MEASURED : 8;
  for (int i = 0; i < 3; ++i) {
    out->pose.position[i] += 0.01 * dice_unit(&d);
    out->pose.quat_wxyz[i] += 0.001 * dice_unit(&d);
  }
  hapi_quat_normalize(out->pose.quat_wxyz);
  dice_twist(&d, &out->twist);
  dice_fill(&d, out->b, 6);
  dice_fill(&d, out->residual, 6);
  dice_fill(&d, out->impulse_taken, 6);
  dice_fill(&d, out->gain_taken, 6);
  dice_fill(&d, out->brace, 6);
  if ((out->flags & HAPI_BODY_MEASURED) != 0) {
    dice_fill(&d, out->response[0], 36);
  }
}

/* Of which generation a slot is at this step; 0: it is empty, as it is every few steps. */
static uint32_t wire_generation(const wire_world *w, uint32_t kind, uint32_t slot)
{
  uint32_t period = 20 + 7 * ((slot + kind) % 9);
  uint64_t phase = (w->number + 3 * slot) % period;
  return phase < period / 4 && slot % 3 == 1 ? 0 : 1 + (uint32_t)((w->number + 3 * slot) / period);
}

static uint32_t wire_slot(const wire_world *w, hapi_model *model, wire_dice *d)
{
  (void)w;
  return model->body_count == 0 ? HAPI_SLOT_NONE
                                : hapi_model_bodies(model)[dice_below(d, model->body_count)].slot;
}

static void wire_bodies(const wire_world *w, hapi_model *model)
{
  model->body_count = model->course_count = 0;
  for (uint32_t i = 0; i < w->bodies; ++i) {
    uint32_t generation = wire_generation(w, 1, i);
    if (generation == 0) {
      continue;
    }
    hapi_model_body *body = &hapi_model_bodies(model)[model->body_count++];
    wire_body(w, i, generation, body);
    if ((body->flags & HAPI_BODY_DRIVEN) != 0) {
      wire_dice d = dice_of(2, i, (uint32_t)w->number);
      hapi_model_course *course = &hapi_model_courses(model)[model->course_count++];
      body->course = model->course_count;
      course->leaps = dice_below(&d, 2);
      course->begins = dice_below(&d, 2);
      course->period_s = 1.5 + dice_unit(&d);
      dice_pose(&d, &course->before);
      dice_fill(&d, course->ways[0], 6 * HAPI_COURSE_ORDER);
    }
  }
}

static void wire_contacts(const wire_world *w, hapi_model *model)
{
  model->contact_count = 0;
  model->triangle_count = 9;
  for (uint32_t i = 0; i < model->triangle_count; ++i) {
    double corners[9];
    wire_dice d = dice_of(3, i, (uint32_t)(w->number / 30));
    dice_fill(&d, corners, 9);
    hapi_triangle_set(corners, &hapi_model_triangles(model)[i]);
  }
  for (uint32_t i = 0; i < w->contacts; ++i) {
    uint32_t generation = wire_generation(w, 4, i);
    if (generation == 0) {
      continue;
    }
    hapi_model_contact *c = &hapi_model_contacts(model)[model->contact_count++];
    wire_dice d = dice_of(4, i, generation);
    memset(c, 0, sizeof *c);
    c->slot = i;
    c->generation = generation;
    c->pointer = dice_below(&d, 4);
    c->pointer_generation = dice_below(&d, 99);
    c->has_shape = 1;
    c->feel = dice_below(&d, 9);
    wire_shape(&d, &c->shape);
    dice_pose(&d, &c->shape_pose);
    c->geom = (void *)(uintptr_t)(0x5000 + i);
    c->geom_number = 1 + dice_below(&d, 99);
    c->mu = i % 4 == 0 ? HUGE_VAL : 1.0 + dice_unit(&d);
    c->body = i % 3 == 0 ? HAPI_SLOT_NONE : wire_slot(w, model, &d);
    d.state += w->number;
    (void)dice_below(&d, 2);
    c->hidden = dice_below(&d, 2);
    dice_fill(&d, c->point_body, 3);
    dice_fill(&d, c->normal_body, 3);
    dice_fill(&d, c->a[0], 18);
    dice_fill(&d, c->turn, 6);
    if (i % 2 == 0) {
      c->told.first = dice_below(&d, 4);
      c->told.count = 1 + dice_below(&d, 4);
      c->told.within = 1.0 + dice_unit(&d);
      dice_fill(&d, c->told.at, 3);
    }
  }
}

static void wire_softness(wire_dice *d, hapi_softness *out)
{
  out->erp = dice_unit(d);
  out->cfm = dice_unit(d);
  out->soft = dice_below(d, 2) != 0;
}

static void wire_limit(wire_dice *d, hapi_model_limit *out)
{
  out->flags = dice_below(d, 32);
  out->low = dice_below(d, 3) == 0 ? -HUGE_VAL : dice_unit(d);
  out->high = dice_below(d, 3) == 0 ? HUGE_VAL : dice_unit(d);
  wire_softness(d, &out->stop);
  dice_fill(d, &out->bounce, 1);
  dice_fill(d, &out->speed, 1);
  dice_fill(d, &out->force, 1);
  dice_fill(d, &out->motor_cfm, 1);
  dice_fill(d, &out->fudge, 1);
  dice_fill(d, &out->spring.stiffness, 4);
}

static void wire_measured(const wire_world *w, uint32_t slot, hapi_measured_joint *out)
{
  wire_dice d = dice_of(6, slot, (uint32_t)w->number);
  out->number = dice_below(&d, 999);
  out->row_count = dice_below(&d, 7);
  out->carrier = dice_below(&d, 2);
  out->ahead_s = dice_unit(&d);
  for (uint32_t i = 0; i < HAPI_MEASURED_ROWS; ++i) {
    hapi_measured_row *row = &out->rows[i];
    dice_fill(&d, row->force, 3);
    dice_fill(&d, row->torque, 3);
    wire_softness(&d, &row->softness);
    row->error = dice_unit(&d);
    row->speed = dice_unit(&d);
    row->impulse = dice_unit(&d);
  }
  dice_fill(&d, out->given, 6);
  for (int i = 0; i < HAPI_JOINT_LIMITS; ++i) {
    dice_fill(&d, out->axes[i].direction, 3);
    out->axes[i].carrier = dice_below(&d, 3);
    out->axes[i].slides = dice_below(&d, 2) != 0;
    out->axes[i].position = dice_unit(&d);
  }
}

static void wire_joints(const wire_world *w, hapi_model *model)
{
  model->joint_count = 0;
  for (uint32_t i = 0; i < w->joints && model->body_count > 0; ++i) {
    uint32_t generation = wire_generation(w, 5, i);
    if (generation == 0) {
      continue;
    }
    hapi_model_joint *j = &hapi_model_joints(model)[model->joint_count++];
    wire_dice d = dice_of(5, i, generation);
    memset(j, 0, sizeof *j);
    j->slot = i;
    j->generation = generation;
    j->kind = (hapi_joint_kind)dice_below(&d, HAPI_JOINT_MEASURED + 1);
    j->body_a = wire_slot(w, model, &d);
    j->generation_a = dice_below(&d, 99);
    j->body_b = i % 2 == 0 ? HAPI_SLOT_NONE : wire_slot(w, model, &d);
    j->generation_b = dice_below(&d, 99);
    j->told = dice_below(&d, 2);
    dice_fill(&d, j->place.anchor_a, 3);
    dice_fill(&d, j->place.anchor_b, 3);
    dice_fill(&d, j->place.axis_a, 3);
    dice_fill(&d, j->place.axis_b, 3);
    dice_fill(&d, j->place.reference_a, 3);
    dice_fill(&d, j->place.reference_b, 3);
    dice_fill(&d, j->place.turn, 4);
    dice_fill(&d, &j->place.cos_axes, 1);
    dice_fill(&d, &j->place.sin_axes, 1);
    wire_softness(&d, &j->along);
    wire_softness(&d, &j->linear);
    wire_softness(&d, &j->angular);
    for (int k = 0; k < HAPI_JOINT_LIMITS; ++k) {
      wire_limit(&d, &j->limits[k]);
    }
    if (j->kind == HAPI_JOINT_MEASURED) {
      wire_measured(w, i, &j->measured);
    }
  }
}

static void wire_head(const wire_world *w, hapi_model *model)
{
  wire_dice d = {w->number};
  model->number = w->number;
  model->tick = 16 * w->number;
  model->state_ns = (int64_t)(w->number * 16666667);
  model->valid_from_ns = model->state_ns + dice_below(&d, 1000000);
  model->sent_ns = dice_below(&d, 1000000);
  model->blend_s = 1.0 + dice_unit(&d);
  model->period_s = 1.1 + dice_unit(&d);
  model->time_scale = 1.0 + dice_unit(&d);
  model->model = HAP_MODEL_CONTACT;
  model->impulse_pose = HAP_IMPULSE_HELD;
  model->wishes = dice_below(&d, 1u << 30);
  model->max_sweeps = dice_below(&d, 99);
  model->row_updates = dice_below(&d, 9999);
  model->force_drift = dice_unit(&d);
  model->tick_work = dice_below(&d, 99999);
  model->tick_budget_ns = -(int64_t)dice_below(&d, 99999);
  model->touches = dice_below(&d, 99);
  model->bounces = dice_below(&d, 99);
  model->watch_count = 1 + dice_below(&d, HAP_TRACE_BODIES_MAX);
  for (uint32_t i = 0; i < HAP_TRACE_BODIES_MAX; ++i) {
    model->watch_slot[i] = i % 2 == 0 ? HAPI_SLOT_NONE : dice_below(&d, 12);
    dice_fill(&d, model->watch_position[i], 3);
  }
  model->tool_count = model->cross_count = 0;
  model->feel_count = 5;
  for (uint32_t i = 0; i < model->feel_count; ++i) {
    hapi_model_feel *f = &hapi_model_feels(model)[i];
    wire_dice e = dice_of(7, i, (uint32_t)(w->number / 17));
    memset(f, 0, sizeof *f);
    f->number = 100 + i + (uint32_t)(w->number / 50);
    f->pointer = dice_below(&e, 4);
    f->feel.more = HAPI_FEEL_SPRING | HAPI_FEEL_MAGNET;
    dice_fill(&e, &f->feel.mu, 4);
    dice_fill(&e, &f->feel.impact.force, 3);
    dice_fill(&e, &f->feel.adhesion, 3);
  }
  model->hand_count = (uint32_t)(w->number / 20) % 3;
  for (uint32_t i = 0; i < model->hand_count; ++i) {
    hapi_model_hand *h = &hapi_model_hands(model)[i];
    wire_dice e = dice_of(12, i, 1);
    memset(h, 0, sizeof *h);
    h->number = i + 1;
    h->generation = 3;
    h->radius = dice_unit(&e) + 1.0;
    h->stiffness = dice_unit(&e) + 1.0;
    h->damping = dice_unit(&e) + 1.0;
    h->friction = dice_unit(&e) + 1.0;
    h->finger_radius = dice_unit(&e) + 1.0;
    h->hull.count = 4 * i;
    dice_fill(&e, h->hull.points[0], 3 * (int)h->hull.count);
    dice_pose(&d, &h->pose);
    dice_twist(&d, &h->twist);
  }
}

static void wire_geoms(const wire_world *w, hapi_model *model, hapi_near *near)
{
  near->geom_count = near->point_count = 0;
  for (uint32_t i = 0; i < w->geoms; ++i) {
    wire_dice d = dice_of(8, i, 1);
    uint32_t of = wire_generation(w, 8, i);
    if (of == 0) {
      continue;
    }
    hapi_near_geom *g = &hapi_near_geoms(near)[near->geom_count++];
    memset(g, 0, sizeof *g);
    wire_shape(&d, &g->shape);
    dice_pose(&d, &g->pose);
    /* As from a moved body: other last bits each time. */
    g->pose.position[0] += 1e-17 * (double)(w->number % 5);
    g->body =
        i % 4 == 0 || model->body_count == 0 ? HAPI_SLOT_NONE : hapi_model_bodies(model)[0].slot;
    g->generation = dice_below(&d, 50);
    g->extent = 1.0 + dice_unit(&d);
    if (i % 5 == 0) {
      g->shape.kind = HAPI_SHAPE_HULL;
      g->shape.hull_count = i % 2 == 0 ? 3 : 8;
      g->open_edges = i % 2 == 0 ? 1 + dice_below(&d, 31) : 0;
      g->hull_first = near->point_count;
      dice_fill(&d, hapi_near_points(near) + (size_t)3 * near->point_count,
                3 * (int)g->shape.hull_count);
      near->point_count += (uint32_t)g->shape.hull_count;
    }
  }
}

static void wire_near_make(const wire_world *w, hapi_model *model, hapi_near *near)
{
  wire_dice d = {w->number + 7};
  near->model_number = model->number;
  near->between = dice_below(&d, 2);
  near->always = dice_below(&d, 2);
  near->contact_hz = 100.0 + dice_below(&d, 100);
  near->said_count = 0;
  near->body_count = model->body_count;
  for (uint32_t i = 0; i < near->body_count; ++i) {
    const hapi_model_body *body = &hapi_model_bodies(model)[i];
    hapi_near_body *out = &hapi_near_bodies(near)[i];
    *out = (hapi_near_body){body->slot, body->generation, body->pose, body->twist};
    if (i % 6 == 0) {
      dice_pose(&d, &out->pose);
    }
  }
  wire_geoms(w, model, near);
  near->pair_count = 0;
  for (uint32_t i = 0; i < w->pairs && near->geom_count > 1; ++i) {
    wire_dice e = dice_of(9, i, 1);
    if (wire_generation(w, 9, i) == 0) {
      continue;
    }
    hapi_near_pair *pair = &hapi_near_pairs(near)[near->pair_count++];
    memset(pair, 0, sizeof *pair);
    pair->key = 77 * (i / 2);
    pair->geom_a = dice_below(&e, near->geom_count);
    pair->geom_b = dice_below(&e, near->geom_count);
    pair->tags.geom_a = (void *)(uintptr_t)(0x9000 + pair->geom_a);
    pair->tags.geom_b = NULL;
    pair->surface.flags = dice_below(&e, 128);
    dice_fill(&e, &pair->surface.mu, 13);
    pair->surface.max_push = HUGE_VAL;
    dice_fill(&e, pair->surface.slip, 2);
  }
  near->tool_count = 2;
  for (uint32_t i = 0; i < near->tool_count; ++i) {
    wire_dice e = dice_of(10, i, 1);
    hapi_near_tool *tool = &hapi_near_tools(near)[i];
    memset(tool, 0, sizeof *tool);
    tool->pointer = i + 1;
    tool->generation = 5;
    tool->radius = 1.0 + dice_unit(&e);
    tool->extent = 1.0 + dice_unit(&e);
    tool->hull.count = w->bodies > 9 ? 4 + 60 * i : 1;
    dice_fill(&e, tool->hull.points[0], 3 * (int)tool->hull.count);
    dice_pose(&d, &tool->pose);
    dice_twist(&d, &tool->twist);
  }
  near->tool_pair_count = near->geom_count > 0 ? 6 : 0;
  for (uint32_t i = 0; i < near->tool_pair_count; ++i) {
    hapi_near_tool_pair *pair = &hapi_near_tool_pairs(near)[i];
    memset(pair, 0, sizeof *pair);
    *pair = (hapi_near_tool_pair){.key = i / 2,
                                  .tool = i % 2,
                                  .geom = dice_below(&d, near->geom_count),
                                  .tag = (void *)(uintptr_t)(0x9000 + i),
                                  .mu = 0.25 * i,
                                  .feel = i,
                                  .reach = 0.5 * i};
  }
}

void wire_world_step(wire_world *w, hapi_model **out_model, hapi_near **out_near)
{
  hapi_model *model = hapi_exchange_model_back(w->exchange);
  hapi_near *near = hapi_exchange_near_back(w->exchange);
  ++w->number;
  wire_head(w, model);
  wire_bodies(w, model);
  wire_contacts(w, model);
  wire_joints(w, model);
  wire_near_make(w, model, near);
  *out_model = model;
  *out_near = near;
}

static void wire_state_pointers(const wire_world *w, wire_dice *d, hapi_state *s)
{
  for (uint32_t i = 0; i < s->pointer_count; ++i) {
    hapi_state_pointer *p = &hapi_state_pointers(s)[i];
    memset(p, 0, sizeof *p);
    p->generation = i == 2 ? 0 : 1 + (uint32_t)(w->number / 40);
    if (p->generation == 0) {
      continue;
    }
    p->collide_bits = dice_below(d, 1u << 30);
    p->radius = 1.0 + dice_unit(d);
    p->stiffness = 1.0 + dice_unit(d);
    p->damping = 1.0 + dice_unit(d);
    p->friction = 1.0 + dice_unit(d);
    p->finger_radius = 1.0 + dice_unit(d);
    p->magnet_hold = dice_unit(d);
    dice_pose(d, &p->pose);
    dice_twist(d, &p->twist);
    p->is_tool = i == 1;
    p->extent = 1.0 + dice_unit(d);
    p->bound_count = dice_below(d, HAP_FORCES_MAX + 1);
    p->held = dice_below(d, 999);
    for (uint32_t k = 0; k < HAP_FORCES_MAX; ++k) {
      p->bound[k] = dice_below(d, 999);
    }
    if (p->is_tool != 0) {
      wire_dice e = dice_of(11, i, p->generation);
      hapi_tool_hull *hull = &hapi_state_hulls(s)[i];
      memset(hull, 0, sizeof *hull);
      hull->count = w->bodies > 9 ? 64 : 1;
      dice_fill(&e, hull->points[0], 3 * (int)hull->count);
    }
  }
}

static void wire_state_lists(const wire_world *w, wire_dice *d, hapi_state *s)
{
  s->contact_count = dice_below(d, 20);
  for (uint32_t i = 0; i < s->contact_count; ++i) {
    hapi_state_contact *c = &hapi_state_contacts(s)[i];
    *c = (hapi_state_contact){.slot = i, .generation = 3, .touches = i % 2, .depth = dice_unit(d)};
    dice_fill(d, c->force, 9);
  }
  s->spring_count = dice_below(d, wire_capacity.springs);
  for (uint32_t i = 0; i < s->spring_count; ++i) {
    hapi_state_spring *spring = &hapi_state_springs(s)[i];
    *spring = (hapi_state_spring){
        .slot = i % 2 == 0 ? HAPI_SLOT_NONE : i, .generation = i, .key = w->number / 9};
    dice_fill(d, spring->place, 7);
  }
  s->joint_count = dice_below(d, 20);
  for (uint32_t i = 0; i < s->joint_count; ++i) {
    hapi_state_joint *joint = &hapi_state_joints(s)[i];
    *joint = (hapi_state_joint){.slot = i, .generation = 7, .body_a = i % 9};
    dice_fill(d, &joint->given.seconds, 13);
  }
  s->side_count = dice_below(d, 10);
  for (uint32_t i = 0; i < s->side_count; ++i) {
    hapi_tool_side *side = &hapi_state_sides(s)[i];
    *side = (hapi_tool_side){.key = 33 * i, .pointer = i % 4, .body = i, .epoch = i};
    dice_pose(d, &side->place);
    dice_fill(d, side->way, 3);
  }
}

hapi_state *wire_state_step(wire_world *w)
{
  hapi_state *s = hapi_exchange_state_back(w->exchange);
  ++w->number;
  wire_dice d = {w->number};
  s->tick = w->number;
  s->model_number = w->number / 16;
  s->now_ns = (int64_t)w->number * 1000000;
  s->time_scale = 1.0 + dice_unit(&d);
  dice_fill(&d, s->hand_impulse, 3);
  dice_fill(&d, s->owned_impulse, 3);
  s->load = (hapi_tick_load){w->number, w->number / 3, (double)(w->number * 12345)};
  s->derated = dice_below(&d, 2) != 0;
  s->swings = dice_below(&d, 2) != 0;
  s->force_out = dice_below(&d, 3);
  s->texture_out = dice_below(&d, 2) != 0;
  s->work = (hapi_tick_work){w->number, 100 * w->number, (double)(w->number * 777), 3, 4, 5, 6};
  s->unsolved = dice_below(&d, 99);
  s->model = HAP_MODEL_CONTACT;
  s->body_high = w->bodies;
  for (uint32_t i = 0; i < w->bodies; ++i) {
    hapi_state_body *body = &hapi_state_bodies(s)[i];
    wire_dice e = dice_of(12, i, (uint32_t)(i % 2 == 0 ? w->number : w->number / 25));
    memset(body, 0, sizeof *body);
    body->generation = wire_generation(w, 12, i);
    if (body->generation == 0) {
      continue;
    }
    body->flags = dice_below(&e, 512);
    body->epoch = dice_below(&e, 9);
    dice_pose(&e, &body->pose);
    dice_twist(&e, &body->twist);
    dice_fill(&e, body->impulse, 3);
    dice_fill(&e, body->angular_impulse, 3);
    dice_fill(&e, body->residual, 6);
    dice_fill(&e, body->gain, 6);
    if ((i + w->number) % 8 == 0) {
      memcpy(body->gain, s->hand_impulse, sizeof s->hand_impulse);
    }
    body->owned_until_ns = dice_below(&e, 2) != 0 ? dice_below(&e, 1u << 30) : 0;
    if (body->owned_until_ns != 0) {
      dice_pose(&e, &body->owned_pose);
      dice_twist(&e, &body->owned_twist);
    }
  }
  wire_state_pointers(w, &d, s);
  wire_state_lists(w, &d, s);
  return s;
}
