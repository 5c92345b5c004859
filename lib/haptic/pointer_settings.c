/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/pointer_id.h"
#include "base/safety.h"
#include "base/vec.h"
#include "haptic/coupling_gains.h"
#include "haptic/haptic_internal.h"
#include "pointer/coupling.h"
#include "pointer/frame.h"

/* What is set while a pointer runs. Applications hand it over by a triple buffer; a tick takes it,
 * writes it into the slot's def, and brings the pointer there: at once where nothing would leap,
 * else in the next 20 ms. What a tick takes is an input and goes on the tape. */

#define GRIP_MOST 0.05   /* m, at the device: arm that a handle has against turning */
#define BALL_INERTIA 0.4 /* m r^2 */

/* ---- the loop's side ---- */

/* In the world, where a metre of the device is motion_scale metres and a newton its share. */
static void set_gains(const hapi_haptic *haptic, const hapi_pointer_slot *slot, hapi_pointer *p)
{
  const hapi_pointer_setup *def = &slot->def;
  hapi_coupling_gains gains = hapi_coupling_gains_of(&slot->info, def, haptic->tick.facts.period);
  double scale = p->device.motion_scale * p->device.force_scale;
  if (p->proxied && !(scale > 0.0)) {
    return; /* its spring is felt by nobody; without one it would be nowhere */
  }
  p->coupling.hold_known = gains.known && scale > 0.0;
  p->coupling.hold = p->coupling.hold_known ? gains.stiffness / scale : HUGE_VAL;
  p->coupling.stiffness = p->coupling.hold_known ? p->coupling.hold : 0.0;
  p->coupling.damping = p->coupling.hold_known ? gains.damping / scale : 0.0;
  p->coupling.own = slot->has_device && scale > 0.0
                        ? hapi_pointer_holds_of(&slot->info, def, haptic->tick.facts.period, scale)
                        : (hapi_pointer_holds){HUGE_VAL, HUGE_VAL, 0.0};
}

/* A proxy turns as if it were held at its vertices: by the square of their arm. Not of a long
 * tool's: the device's grip is not as long. */
static void set_spin_coupling(const hapi_pointer_slot *slot, hapi_pointer *p)
{
  const hapi_tool_hull *hull = &slot->hull;
  double sum = 0.0;
  for (uint32_t i = 0; i < hull->count; ++i) {
    sum += hapi_v3_dot(hull->points[i], hull->points[i]) / hull->count;
  }
  double reach = sqrt(sum) + slot->def.radius;
  double arm = fmin(reach, GRIP_MOST * p->device.motion_scale);
  p->coupling.spin_stiffness = arm * arm * p->coupling.stiffness;
  p->coupling.spin_damping = arm * arm * p->coupling.damping;
  p->coupling.inertia = arm * arm * p->coupling.mass;
  if (slot->def.coupling == HAP_COUPLING_VIRTUAL) {
    p->coupling.inertia = slot->def.virtual_inertia > 0.0
                              ? slot->def.virtual_inertia
                              : BALL_INERTIA * reach * reach * p->coupling.mass;
  }
}

void hapi_pointer_set_coupling(const hapi_haptic *haptic, const hapi_pointer_slot *slot,
                               hapi_pointer *io)
{
  const hapi_pointer_setup *def = &slot->def;
  io->coupling.kind = def->coupling;
  io->coupling.integration = def->integration;
  if (def->coupling == HAP_COUPLING_GOD_OBJECT || def->coupling == HAP_COUPLING_VIRTUAL) {
    io->coupling.integration = HAP_INTEGRATION_IMPLICIT; /* there is no spring of a contact */
  }
  io->coupling.mass = def->coupling == HAP_COUPLING_GOD_OBJECT ? 0.0
                      : def->coupling == HAP_COUPLING_VIRTUAL  ? def->virtual_mass
                                                               : def->proxy_mass;
  io->coupling.reason =
      def->coupling == HAP_COUPLING_AUTO ? HAP_COUPLING_MODEL : HAP_COUPLING_ASKED;
  set_gains(haptic, slot, io);
  set_spin_coupling(slot, io);
}

void hapi_pointer_set_shape(const hapi_haptic *haptic, uint32_t index)
{
  const hapi_pointer_slot *slot = &haptic->slots[index];
  hapi_pointer_shape *shape = &haptic->tick.pointers.of[index].shape;
  double farthest = 0.0;
  haptic->tick.pointers.hulls[index] = slot->hull;
  for (uint32_t i = 0; i < slot->hull.count; ++i) {
    farthest = fmax(farthest, hapi_v3_norm(slot->hull.points[i]));
  }
  shape->collide_bits = slot->def.collide_bits;
  shape->radius = slot->def.radius;
  shape->hull = slot->hull.count > 0 ? &haptic->tick.pointers.hulls[index] : NULL;
  shape->extent = slot->def.radius + farthest;
}

hapi_device_limits hapi_pointer_limits(const hapi_pointer_slot *slot)
{
  const hapi_pointer_setup *def = &slot->def;
  const hap_device_info *info = &slot->info;
  hapi_device_limits limits;
  limits.max_force =
      info->max_force > 0.0 && info->max_force < def->max_force ? info->max_force : def->max_force;
  limits.max_torque = info->max_torque > 0.0 && info->max_torque < def->max_torque
                          ? info->max_torque
                          : def->max_torque;
  limits.slew_force = def->max_slew > 0.0 ? def->max_slew : limits.max_force / HAPI_SAFETY_SLEW_S;
  limits.slew_torque = limits.max_torque * (limits.slew_force / limits.max_force);
  return limits;
}

static void glide_to(hapi_glide *glide, double value)
{
  *glide = (hapi_glide){.to = value, .left_s = HAPI_SAFETY_SET_S};
}

/* False: it was there before. */
static bool glide_follow(hapi_glide *glide, double seconds, double *io)
{
  if (!(glide->left_s > 0.0)) {
    return false;
  }
  if (seconds < glide->left_s * (1.0 - 1e-9)) {
    *io += seconds / glide->left_s * (glide->to - *io);
    glide->left_s -= seconds;
  } else {
    *io = glide->to;
    glide->left_s = 0.0;
  }
  return true;
}

/* Down as fast as the force itself may fall, up slowly. */
static double limit_follow(double limit, double wanted, double slew, double seconds)
{
  double down = hapi_max(limit - slew * seconds, wanted);
  return limit > wanted ? down : hapi_min(limit + wanted * seconds / HAPI_SAFETY_LIMIT_S, wanted);
}

static bool limits_follow(hapi_pointer *p, double seconds)
{
  const hapi_device_limits *wanted = &p->glides.wanted;
  hapi_device_limits *limits = &p->device.limits;
  limits->max_force =
      limit_follow(limits->max_force, wanted->max_force, limits->slew_force, seconds);
  limits->max_torque =
      limit_follow(limits->max_torque, wanted->max_torque, limits->slew_torque, seconds);
  if (limits->max_force != wanted->max_force || limits->max_torque != wanted->max_torque) {
    return true;
  }
  *limits = *wanted;
  return false;
}

void hapi_settings_swap(hapi_pointer_slot *slot)
{
  hapi_settings_copy(slot->set.swaps, &slot->set.next, &slot->def);
  if ((slot->set.swaps & HAP_SET_SHAPE) != 0) {
    slot->hull = slot->set.next_hull;
  }
  slot->set.swaps = 0;
}

/* The pointer is another one from this tick on: nothing of its contacts, its proxy and their forces
 * goes on. */
static void pointer_swap(hapi_haptic *haptic, uint32_t index)
{
  hapi_pointer_slot *slot = &haptic->slots[index];
  hapi_pointer *p = &haptic->tick.pointers.of[index];
  bool shape = (slot->set.swaps & (HAP_SET_SHAPE | HAP_SET_COLLIDE_BITS)) != 0;
  hapi_settings_swap(slot);
  if (shape) {
    slot->set.shape = (slot->set.shape + 1u) & (UINT32_MAX >> HAPI_SHAPE_SHIFT);
    p->generation = slot->generation | slot->set.shape << HAPI_SHAPE_SHIFT;
    hapi_pointer_set_shape(haptic, index);
    hapi_pointer_feel(p, hapi_wish(haptic->tick.facts.wishes, HAP_EFFECT_TORQUE), false);
  }
  hapi_touches_forget(&haptic->tick.touches, index);
  memset(&p->wrench, 0, sizeof p->wrench);
  p->contacts = 0;
  p->proxied = p->rigid = false;
  p->proxy.row = 0;
  p->coupling.near_stiffness = p->coupling.contact_stiffness = 0.0;
  hapi_pointer_set_coupling(haptic, slot, p);
  haptic->tick.pointers.proxies = true; /* until the next model says what is wished for */
}

/* Whether nobody would feel it. */
static bool pointer_may_swap(const hapi_haptic *haptic, const hapi_pointer *p)
{
  const hap_wrench *felt = &p->guard.written;
  bool guarded = haptic->tick.guard.mode == HAP_GUARD_ON;
  bool none = hapi_v3_norm(p->wrench.force) == 0.0 && hapi_v3_norm(p->wrench.torque) == 0.0;
  bool off = hapi_v3_norm(felt->force) == 0.0 && hapi_v3_norm(felt->torque) == 0.0;
  return !guarded || (off && (none || p->guard.share <= 0.0)) ||
         haptic->tick.guard.latch.fault != HAP_FAULT_NONE;
}

static void pointer_glide(const hapi_haptic *haptic, const hapi_pointer_slot *slot, hapi_pointer *p)
{
  hapi_pointer_glides *g = &p->glides;
  double seconds = haptic->tick.facts.period;
  double motion_scale = p->device.motion_scale;
  bool any = glide_follow(&g->stiffness, seconds, &p->surface.stiffness);
  any |= glide_follow(&g->damping, seconds, &p->surface.damping);
  any |= glide_follow(&g->friction, seconds, &p->surface.friction);
  any |= glide_follow(&g->finger_radius, seconds, &p->surface.finger_radius);
  bool scales = glide_follow(&g->force_scale, seconds, &p->device.force_scale);
  if (glide_follow(&g->motion_scale, seconds, &motion_scale)) {
    hapi_frame_set_scale(p, motion_scale, g->stands);
    scales = true;
  }
  if (scales) {
    set_gains(haptic, slot, p);
    set_spin_coupling(slot, p);
  }
  g->limits = g->limits && limits_follow(p, seconds);
  g->any = any || scales || g->limits; /* one tick longer than needed: added is 0 then */
}

static void setting_apply_frame(hapi_pointer *p, const hapi_pointer_setting *s, int64_t now_ns)
{
  bool leaps = (s->mask & HAP_SET_TELEPORT) != 0;
  if ((s->mask & HAP_SET_BASE) != 0) {
    const hapi_frame_base base = {s->def.pose_world_device, s->twist_world_device,
                                  s->base_time_ns != 0 ? s->base_time_ns : now_ns};
    hapi_frame_set_base(p, &base, leaps);
  }
  if ((s->mask & HAP_SET_UNCLUTCHED) != 0) {
    hapi_frame_unclutch(p, leaps);
  }
  if ((s->mask & HAPI_SET_CLUTCH) != 0) {
    hapi_frame_clutch(p, s->clutched != 0);
  }
  if ((s->mask & HAP_SET_MOTION_SCALE) != 0) {
    glide_to(&p->glides.motion_scale, s->def.motion_scale);
    p->glides.stands = (s->mask & HAP_SET_BASE) == 0;
  }
}

/* Those of the bits that would be something else than now. */
static uint32_t swaps_wanted(const hapi_pointer_slot *slot, const hapi_pointer_setting *s,
                             const hapi_tool_hull *hull)
{
  const hapi_pointer_setup *now = &slot->def;
  const hapi_pointer_setup *def = &s->def;
  bool shape = def->radius != now->radius || hull->count != slot->hull.count ||
               memcmp(hull->points, slot->hull.points, hull->count * sizeof hull->points[0]) != 0;
  bool coupling = def->coupling != now->coupling ||
                  def->coupling_stiffness != now->coupling_stiffness ||
                  def->coupling_damping != now->coupling_damping;
  uint32_t other = slot->set.swaps | (shape ? (uint32_t)HAP_SET_SHAPE : 0) |
                   (coupling ? (uint32_t)HAP_SET_COUPLING : 0) |
                   (def->collide_bits != now->collide_bits ? (uint32_t)HAP_SET_COLLIDE_BITS : 0);
  return s->mask & other & HAPI_SET_SWAP;
}

static void setting_apply(hapi_pointer_slot *slot, hapi_pointer *p, const hapi_pointer_setting *s,
                          const hapi_tool_hull *hull, int64_t now_ns)
{
  hapi_pointer_glides *g = &p->glides;
  uint32_t swaps = swaps_wanted(slot, s, hull);
  hapi_settings_copy(s->mask & ~(uint32_t)HAPI_SET_SWAP, &s->def, &slot->def);
  hapi_settings_copy(swaps, &s->def, &slot->set.next);
  slot->set.swaps |= swaps;
  if ((swaps & HAP_SET_SHAPE) != 0) {
    slot->set.next_hull = *hull;
  }
  setting_apply_frame(p, s, now_ns);
  if ((s->mask & HAP_SET_FORCE_SCALE) != 0) {
    glide_to(&g->force_scale, s->def.force_scale);
  }
  if ((s->mask & HAP_SET_STIFFNESS) != 0) {
    glide_to(&g->stiffness, s->def.stiffness);
  }
  if ((s->mask & HAP_SET_DAMPING) != 0) {
    glide_to(&g->damping, s->def.damping);
  }
  if ((s->mask & HAP_SET_FRICTION) != 0) {
    glide_to(&g->friction, s->def.friction);
    glide_to(&g->finger_radius, s->def.finger_radius);
  }
  if ((s->mask & HAP_SET_LIMITS) != 0) {
    g->limits = true;
    g->wanted = hapi_pointer_limits(slot);
  }
  g->any = true;
}

/* Several settings since the last tick are one. */
static void settings_take(hapi_pointer_settings_box *box, hapi_pointer_setting *out,
                          hapi_tool_hull *out_hull)
{
  const hapi_pointer_wishes *wishes = &box->places[hapi_triple_front(&box->buffer)];
  *out = wishes->value;
  *out_hull = wishes->hull;
  out->mask = 0;
  for (int i = 0; i < HAPI_SET_BITS; ++i) {
    out->mask |= wishes->numbers[i] != box->taken[i] ? 1u << i : 0;
  }
  memcpy(box->taken, wishes->numbers, sizeof box->taken);
}

static void settings_receive(hapi_haptic *haptic, uint32_t index, int64_t now_ns)
{
  hapi_pointer_slot *slot = &haptic->slots[index];
  hapi_pointer *p = &haptic->tick.pointers.of[index];
  hapi_pointer_setting setting;
  hapi_tool_hull hull;
  bool taken = hapi_tape_plays(haptic->tape) ? hapi_tape_next_set(haptic, index, &setting, &hull)
                                             : hapi_triple_take(&slot->set.buffer);
  if (!taken) {
    return;
  }
  if (!hapi_tape_plays(haptic->tape)) {
    settings_take(&slot->set, &setting, &hull);
    hapi_tape_set(haptic, index, &setting, &hull);
  }
  setting_apply(slot, p, &setting, &hull, now_ns);
}

void hapi_settings_follow(hapi_haptic *haptic, uint32_t index, int64_t now_ns)
{
  hapi_pointer_slot *slot = &haptic->slots[index];
  hapi_pointer *p = &haptic->tick.pointers.of[index];
  settings_receive(haptic, index, now_ns);
  if (slot->set.swaps != 0 && pointer_may_swap(haptic, p)) {
    pointer_swap(haptic, index);
  }
  p->guard.fades = p->frame.clutched || slot->set.swaps != 0;
  if (p->glides.any) {
    pointer_glide(haptic, slot, p);
  }
  p->glides.any = p->glides.any || slot->set.swaps != 0;
}

/* ---- the application's side ---- */

void hapi_settings_prepare(hapi_pointer_slot *slot)
{
  hapi_pointer_settings_box *box = &slot->set;
  memset(box, 0, sizeof *box);
  hapi_triple_init(&box->buffer);
  box->newest.value.def = slot->def;
  box->newest.value.def.device = NULL;
  box->newest.value.def.velocity = HAP_VELOCITY_AUTO; /* of the device, which is not there */
}

void hapi_settings_copy(uint32_t mask, const hapi_pointer_setup *from, hapi_pointer_setup *to)
{
  if ((mask & HAP_SET_BASE) != 0) {
    to->pose_world_device = from->pose_world_device;
  }
  if ((mask & HAP_SET_MOTION_SCALE) != 0) {
    to->motion_scale = from->motion_scale;
  }
  if ((mask & HAP_SET_FORCE_SCALE) != 0) {
    to->force_scale = from->force_scale;
  }
  if ((mask & HAP_SET_STIFFNESS) != 0) {
    to->stiffness = from->stiffness;
  }
  if ((mask & HAP_SET_DAMPING) != 0) {
    to->damping = from->damping;
  }
  if ((mask & HAP_SET_FRICTION) != 0) {
    to->friction = from->friction;
    to->finger_radius = from->finger_radius;
  }
  if ((mask & HAP_SET_LIMITS) != 0) {
    to->max_force = from->max_force;
    to->max_torque = from->max_torque;
  }
  if ((mask & HAP_SET_SHAPE) != 0) {
    to->radius = from->radius;
    to->hull_points = from->hull_points;
  }
  if ((mask & HAP_SET_COLLIDE_BITS) != 0) {
    to->collide_bits = from->collide_bits;
  }
  if ((mask & HAP_SET_COUPLING) != 0) {
    to->coupling = from->coupling;
    to->coupling_stiffness = from->coupling_stiffness;
    to->coupling_damping = from->coupling_damping;
  }
}
