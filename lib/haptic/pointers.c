/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/pointer_id.h"
#include "base/pose.h"
#include "base/safety.h"
#include "base/vec.h"
#include "device/device.h"
#include "device/emergency.h"
#include "guard/force_guard.h"
#include "haptic/axes.h"
#include "haptic/coupling_gains.h"
#include "haptic/grabs.h"
#include "haptic/outputs.h"
#include "haptic/own_forces.h"
#include "pointer/coupling.h"
#include "pointer/frame.h"
#include "pointer/plausible.h"

#define WORLD_STIFFNESS_MOST 1e15 /* N/m, of a proxy: beyond it rounding of positions is felt */

/* ---- the loop's side ---- */

static void pointer_activate(hapi_haptic *haptic, uint32_t index)
{
  hapi_pointer_slot *slot = &haptic->slots[index];
  const hapi_pointer_setup *def = &slot->def;
  const hap_device_info *info = &slot->info;
  hapi_pointer *p = &haptic->tick.pointers.of[index];
  memset(p, 0, sizeof *p);
  haptic->tick.pointers.high =
      index >= haptic->tick.pointers.high ? index + 1 : haptic->tick.pointers.high;
  p->generation = slot->generation;
  p->handle.foreign = def->foreign != 0;
  slot->set.shape = 0;
  hapi_pointer_set_shape(haptic, index);
  p->device.three_dof = slot->has_device && info->dof < 6;
  p->surface.stiffness = def->stiffness;
  p->surface.damping = def->damping;
  p->surface.friction = def->friction;
  p->surface.finger_radius = def->finger_radius;
  p->device.turns = !slot->has_device || info->dof == 6;
  hapi_pointer_feel(p, hapi_wish(haptic->tick.facts.wishes, HAP_EFFECT_TORQUE), false);
  haptic->tick.pointers.proxies = true; /* until the next model says what is wished for */
  p->device.motion_scale = def->motion_scale;
  p->device.force_scale = def->force_scale;
  p->device.pose_world_device = def->pose_world_device;
  const double *turn = def->pose_world_device.quat_wxyz;
  p->device.aligned = turn[0] == 1.0 && turn[1] == 0.0 && turn[2] == 0.0 && turn[3] == 0.0;
  p->device.limits = hapi_pointer_limits(slot);
  p->device.estimates =
      def->velocity == HAP_VELOCITY_ESTIMATED ||
      (def->velocity == HAP_VELOCITY_AUTO && info->quantum > 0.0 && info->measures_velocity == 0);
  p->device.speed_limit = slot->has_device ? HAPI_SAFETY_SPEED_LIMIT : 0.0;
  hapi_velocity_reset(&p->velocity, info->quantum);
  hapi_pointer_set_coupling(haptic, slot, p);
  hapi_frame_init(p, &def->pose_world_device);
  p->device.pose.quat_wxyz[0] = 1.0;
  p->device.good.quat_wxyz[0] = 1.0;
  p->handle.quat[0] = p->proxy.quat[0] = 1.0;
  p->pose.quat_wxyz[0] = 1.0;
  hapi_own_begin(haptic, index);
  hapi_axes_join(haptic, index);
  hapi_outputs_join(haptic, index);
}

/* For a new user of the slot, whose def is in it. */
static void slot_prepare(hapi_pointer_slot *slot)
{
  pthread_mutex_lock(&slot->lock);
  uint32_t generation = (atomic_load(&slot->generation) + 1u) & HAPI_GENERATION_MASK;
  atomic_store(&slot->generation, generation != 0 ? generation : 1u);
  hapi_triple_init(&slot->target_buffer);
  hapi_triple_init(&slot->state_buffer);
  hapi_own_list_begin(&slot->own);
  memset(&slot->grab, 0, sizeof slot->grab);
  hapi_triple_init(&slot->grab.buffer);
  memset(slot->targets, 0, sizeof slot->targets);
  memset(slot->states, 0, sizeof slot->states);
  for (int i = 0; i < 3; ++i) {
    slot->targets[i].pose.quat_wxyz[0] = 1.0;
    slot->states[i].device.quat_wxyz[0] = 1.0;
    slot->states[i].proxy.quat_wxyz[0] = 1.0;
    slot->states[i].size = sizeof slot->states[i];
  }
  hapi_settings_prepare(slot);
  hapi_outputs_prepare(slot);
  pthread_mutex_unlock(&slot->lock);
}

/* A replay has the pointers of the recording, and no devices. */
static void follow_tape(hapi_haptic *haptic)
{
  uint32_t index = 0;
  bool pauses = false;
  hapi_joined joined;
  hap_device_info info;
  hap_axis_info axes[HAP_AXES_MAX];
  hapi_tool_hull hull;
  for (;;) {
    if (hapi_tape_next_leave(haptic, &index, &pauses)) {
      haptic->tick.pointers.of[index].generation = 0;
      atomic_store(&haptic->slots[index].phase, pauses ? HAPI_POINTER_PAUSED : HAPI_POINTER_EMPTY);
      continue;
    }
    if (!hapi_tape_next_join(haptic, &index, &joined, &info, axes, &hull)) {
      return;
    }
    hapi_pointer_slot *slot = &haptic->slots[index];
    slot->hull = hull;
    slot->def = joined.def;
    slot->info = info;
    memcpy(slot->axes, axes, sizeof slot->axes);
    slot->has_device = joined.has_device != 0;
    slot->set.swaps = 0; /* is in the def */
    if (atomic_load(&slot->phase) != HAPI_POINTER_PAUSED ||
        slot->generation != joined.generation) { /* one that was paused has the id that it had */
      slot_prepare(slot);
      atomic_store(&slot->generation, joined.generation);
    }
    pointer_activate(haptic, index);
    atomic_store_explicit(&slot->phase, HAPI_POINTER_ACTIVE, memory_order_release);
  }
}

static int phase_after(int way)
{
  return way == HAPI_POINTER_LEAVING ? HAPI_POINTER_LEFT : HAPI_POINTER_PAUSED;
}

/* The last pointer of a device takes all force with it. Before that the others go on: the next
 * write, in this tick, has no force for this end effector. */
static void device_leave(hapi_pointer_slot *slot, bool was_active)
{
  if (slot->ops == NULL) {
    return;
  }
  hapi_device_drive *drive = &slot->def.device->drive;
  hap_device_output *wanted = &slot->effector->wanted;
  *wanted = (hap_device_output){.size = sizeof *wanted};
  if (was_active && slot->started) {
    HAPI_ASSERT(drive->active > 0);
    --drive->active;
  }
  if (drive->active == 0) {
    slot->ops->zero(slot->self);
  }
}

void hapi_pointers_follow(hapi_haptic *haptic)
{
  HAPI_ASSERT(hapi_thread_is_mine(&haptic->thread));
  if (hapi_tape_plays(haptic->tape)) {
    follow_tape(haptic);
    return;
  }
  for (uint32_t i = 0; i < haptic->config.capacity.pointers; ++i) {
    hapi_pointer_slot *slot = &haptic->slots[i];
    int phase = atomic_load_explicit(&slot->phase, memory_order_acquire);
    /* A pointer that the application moves comes in with its first target. Before it is added the
     * application may be filling the slot. */
    bool ready = phase == HAPI_POINTER_ADDED &&
                 (slot->ops != NULL || hapi_triple_is_fresh(&slot->target_buffer));
    if (ready) {
      hapi_settings_swap(slot);
      pointer_activate(haptic, i);
      if (slot->ops != NULL) {
        ++slot->def.device->drive.active;
      }
      hapi_tape_join(haptic, i);
      /* Fails when the application wants it back meanwhile: seen at the next tick. */
      (void)atomic_compare_exchange_strong(&slot->phase, &phase, HAPI_POINTER_ACTIVE);
    } else if (phase == HAPI_POINTER_LEAVING || phase == HAPI_POINTER_PAUSING) {
      device_leave(slot, haptic->tick.pointers.of[i].generation != 0);
      haptic->tick.pointers.of[i].generation = 0;
      hapi_tape_leave(haptic, i, phase == HAPI_POINTER_PAUSING);
      atomic_store_explicit(&slot->phase, phase_after(phase), memory_order_release);
    }
  }
}

/* What the device would do with another force nobody knows: zero, and no ramp. */
static void fail_device(hapi_haptic *haptic, uint32_t index, hap_fault fault)
{
  hapi_pointer_slot *slot = &haptic->slots[index];
  if (slot->ops != NULL) {
    slot->ops->zero(slot->self);
  }
  hapi_guard_cut(&haptic->tick.pointers.of[index]);
  hapi_outputs_cut(&haptic->tick.outputs[index]);
  hapi_tick_fault(&haptic->tick, fault, index + 1);
}

/* The first of its pointers reads all of a device. */
static hap_status device_read_once(hapi_haptic *haptic, uint32_t index, int64_t now_ns)
{
  hap_device *device = haptic->slots[index].def.device;
  if (device->drive.read_number != haptic->reads) {
    hapi_pulse_beat(&haptic->standstill.pulse, HAPI_PHASE_READ, index);
    device->drive.read_number = haptic->reads;
    device->drive.read_status = hapi_device_read(device, now_ns);
  }
  return device->drive.read_status;
}

static void target_carry(const hapi_pointer_target *target, int64_t now_ns, hapi_pointer_input *io)
{
  int64_t since_ns = now_ns - target->told_ns;
  bool goes_on = since_ns < target->carried_ns;
  double seconds = 1e-9 * (double)(goes_on ? since_ns : target->carried_ns);
  if (seconds > 0.0) {
    hapi_pose_move(&io->pose, &target->twist, seconds);
  }
  if (!goes_on) {
    io->twist = (hap_twist){{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  }
}

static void ask_device(hapi_haptic *haptic, uint32_t index, int64_t now_ns, hapi_pointer_input *io)
{
  hapi_pointer_slot *slot = &haptic->slots[index];
  if (slot->ops != NULL) {
    hap_status status = device_read_once(haptic, index, now_ns);
    const hap_device_input *in = &slot->effector->input;
    io->pose = in->pose;
    io->twist = in->twist;
    io->buttons = in->buttons;
    io->failed = !hapi_device_did(status);
    io->doubted = status == HAP_STALE;
    return;
  }
  hapi_triple_take(&slot->target_buffer);
  const hapi_pointer_target *target = &slot->targets[hapi_triple_front(&slot->target_buffer)];
  io->pose = target->pose;
  io->twist = target->twist;
  if (target->carried_ns > 0) {
    target_carry(target, now_ns, io);
  }
}

void hapi_pointers_read(hapi_haptic *haptic, int64_t now_ns)
{
  ++haptic->reads;
  for (uint32_t i = 0; i < haptic->tick.pointers.high; ++i) {
    hapi_pointer_slot *slot = &haptic->slots[i];
    hapi_pointer *p = &haptic->tick.pointers.of[i];
    if (p->generation == 0) {
      continue;
    }
    if (p->glides.any || hapi_triple_is_fresh(&slot->set.buffer) || hapi_tape_plays(haptic->tape)) {
      hapi_settings_follow(haptic, i, now_ns);
    }
    if (slot->outputs.again || hapi_triple_is_fresh(&slot->outputs.buffer) ||
        hapi_tape_plays(haptic->tape)) {
      hapi_outputs_take(haptic, i);
    }
    if (hapi_triple_is_fresh(&slot->grab.buffer) || hapi_tape_plays(haptic->tape)) {
      hapi_grab_follow(haptic, i);
    }
    hapi_pointer_input in = {.pose = p->device.pose};
    if (!hapi_tape_plays(haptic->tape)) {
      ask_device(haptic, i, now_ns, &in);
    }
    if (haptic->tape != NULL) {
      hapi_tape_input(haptic, i, &in);
    }
    if (p->has_axes && !hapi_axes_read(haptic, i, now_ns, in.failed)) {
      in.doubted = true;
    }
    if (in.failed) {
      fail_device(haptic, i, HAP_FAULT_DEVICE_READ);
      continue;
    }
    p->device.pose = in.pose;
    p->device.twist = in.twist;
    p->device.buttons = in.buttons;
    bool believed =
        haptic->tick.guard.mode != HAP_GUARD_ON || hapi_input_judge(p, now_ns, in.doubted);
    if (slot->has_device && p->device.estimates && believed) {
      double gap = hapi_input_gap(p, haptic->tick.facts.period);
      const hap_pose *told = gap > 0.0 ? hapi_input_told(p) : &p->device.pose;
      hapi_velocity_update(&p->velocity, now_ns, told, gap, &p->device.twist);
    }
    if (haptic->tick.guard.mode == HAP_GUARD_ON && believed) {
      hapi_input_judge_twist(p);
    }
  }
}

/* The last of its pointers writes all of a device. */
static void device_fill(hapi_haptic *haptic, uint32_t index)
{
  const hapi_pointer_slot *slot = &haptic->slots[index];
  hap_device *device = slot->def.device;
  const hapi_pointer *p = &haptic->tick.pointers.of[index];
  slot->effector->wanted.wrench = p->device.wrench;
  if (p->drives) {
    hapi_outputs_fill(&haptic->tick.outputs[index], &haptic->tick.axes[index],
                      &slot->effector->wanted);
  }
  if (++device->drive.filled >= device->drive.active) {
    hapi_pulse_beat(&haptic->standstill.pulse, HAPI_PHASE_WRITE, index);
    device->drive.filled = 0;
    device->drive.write_status = hapi_device_write(device);
  }
}

void hapi_pointers_write(hapi_haptic *haptic)
{
  for (uint32_t i = 0; i < haptic->tick.pointers.high; ++i) {
    if (haptic->tick.pointers.of[i].generation != 0 && haptic->slots[i].ops != NULL) {
      device_fill(haptic, i);
    }
  }
  for (uint32_t i = 0; i < haptic->tick.pointers.high; ++i) {
    hapi_pointer_slot *slot = &haptic->slots[i];
    hapi_pointer *p = &haptic->tick.pointers.of[i];
    if (p->generation == 0) {
      continue;
    }
    hapi_pointer_output out = {.reached = p->device.wrench};
    if (slot->ops != NULL) {
      out.failed = !hapi_device_did(slot->def.device->drive.write_status);
      out.reached = slot->effector->reached.wrench;
    }
    if (haptic->tape != NULL) {
      hapi_tape_output(haptic, i, &out);
    }
    if (out.failed) {
      fail_device(haptic, i, HAP_FAULT_DEVICE_WRITE);
    }
    if (slot->ops != NULL &&
        (hapi_emergencies() != haptic->emergencies || hapi_standstill_pending(haptic))) {
      slot->ops->zero(slot->self); /* another zero came while this force was being written */
    }
  }
}

/* On the hand, world. */
static hap_wrench declared_felt(const hapi_pointer *p)
{
  hap_wrench felt;
  hapi_coupling_felt(p, &p->declared.given, &felt);
  return felt;
}

/* Without the axes, which stay 0 where there are none. */
static void state_tell(const hapi_pointer *p, int64_t now_ns, hap_pointer_state *out)
{
  double scale = p->device.motion_scale * p->device.force_scale;
  hap_coupling spring = p->rigid ? p->coupling.kind : HAP_COUPLING_PROXY;
  out->contacts = p->contacts;
  out->stamp_ns = now_ns;
  out->device = p->device.good;
  out->proxy = p->pose;
  out->twist = p->twist;
  out->wrench = p->wrench;
  out->buttons = p->device.buttons;
  out->coupling = p->proxied ? (uint32_t)spring : HAP_COUPLING_DIRECT;
  out->coupling_reason = (uint32_t)p->coupling.reason;
  out->guard = p->guard.flags;
  out->coupling_stiffness = p->proxied ? scale * p->coupling.stiffness : 0.0;
  out->coupling_damping = p->proxied ? scale * p->coupling.damping : 0.0;
  out->contact_stiffness = scale * p->coupling.contact_stiffness;
  out->held = hapi_grab_acts(&p->grab) ? p->grab.tag : NULL;
  out->own = p->declared.any ? declared_felt(p) : (hap_wrench){{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
}

static void axes_tell(const hapi_tick *tick, uint32_t index, hap_pointer_state *out)
{
  const hapi_axes *axes = &tick->axes[index];
  out->axis_count = axes->count;
  for (uint32_t i = 0; i < axes->count; ++i) {
    out->axes[i] = axes->of[i].at;
    out->axis_rates[i] = axes->of[i].rate;
    out->axis_forces[i] = tick->outputs[index].axes[i].force;
  }
}

void hapi_pointers_publish(hapi_haptic *haptic)
{
  for (uint32_t i = 0; i < haptic->tick.pointers.high; ++i) {
    hapi_pointer_slot *slot = &haptic->slots[i];
    const hapi_pointer *p = &haptic->tick.pointers.of[i];
    if (p->generation == 0) {
      continue;
    }
    hap_pointer_state *state = &slot->states[hapi_triple_back(&slot->state_buffer)];
    state_tell(p, haptic->tick.facts.now_ns, state);
    if (p->has_axes) {
      axes_tell(&haptic->tick, i, state);
    }
    hapi_triple_publish(&slot->state_buffer);
  }
}

/* ---- the application's side ---- */

/* False: a zero of the device does not come back, and so this one would not. The device is left
 * alone. */
static bool stop_device(hapi_pointer_slot *slot)
{
  if (slot->ops == NULL || !slot->started) {
    return true;
  }
  hapi_device_drive *drive = &slot->def.device->drive;
  HAPI_ASSERT(drive->users > 0);
  if (drive->users > 1) { /* it goes on for its other pointers */
    --drive->users;
    slot->started = false;
    return true;
  }
  if (!hapi_watchdog_stop(&drive->watchdog)) {
    return false;
  }
  if (!hapi_emergency_is_zeroing(slot->ops, slot->self)) {
    slot->ops->zero(slot->self);
  }
  if (!hapi_emergency_remove(slot->ops, slot->self)) {
    return false;
  }
  slot->ops->stop(slot->self);
  drive->users = drive->active = 0;
  slot->started = false;
  return true;
}

static hap_status start_device(hapi_haptic *haptic, hapi_pointer_slot *slot, hap_detail *detail)
{
  HAPI_ASSERT(slot >= haptic->slots && slot < haptic->slots + haptic->config.capacity.pointers);
  if (slot->ops == NULL || slot->started) {
    return HAP_OK;
  }
  hapi_device_drive *drive = &slot->def.device->drive;
  if (drive->users > 0) { /* for another pointer */
    ++drive->users;
    slot->started = true;
    return HAP_OK;
  }
  if (haptic->config.lockstep && slot->ops->pacing != HAP_PACING_VIRTUAL) {
    return hapi_fail(detail, HAP_ERROR_UNSUPPORTED,
                     "device %s has a clock of its own and cannot run in lockstep; use drive "
                     "threads or a virtual device",
                     slot->ops->name);
  }
  if (slot->ops->start(slot->self) < HAP_OK) {
    hap_detail why;
    hapi_device_explain(slot->ops, slot->self, &why);
    return hapi_fail(detail, HAP_ERROR_DEVICE, "device %s did not start%s%.400s", slot->ops->name,
                     why.text[0] != '\0' ? ": " : "", why.text);
  }
  if (!hapi_emergency_add(slot->ops, slot->self)) {
    slot->ops->zero(slot->self);
    slot->ops->stop(slot->self);
    return hapi_fail(detail, HAP_ERROR_CAPACITY, "all %d places for running devices are in use",
                     HAPI_EMERGENCY_DEVICES);
  }
  slot->started = true;
  drive->users = 1;
  drive->active = drive->filled = 0;
  hap_status watched = hapi_standstill_watch(haptic, (uint32_t)(slot - haptic->slots));
  if (watched < HAP_OK) {
    (void)stop_device(slot);
    return hapi_fail(detail, watched,
                     "device %s has no force: the thread of its watchdog could "
                     "not be started",
                     slot->ops->name);
  }
  return HAP_OK;
}

hap_status hapi_pointers_start_devices(hapi_haptic *haptic, hap_detail *detail)
{
  for (uint32_t i = 0; i < haptic->config.capacity.pointers; ++i) {
    hapi_pointer_slot *slot = &haptic->slots[i];
    if (atomic_load(&slot->phase) == HAPI_POINTER_EMPTY) {
      continue;
    }
    hap_status status = start_device(haptic, slot, detail);
    if (status < HAP_OK) {
      (void)hapi_pointers_stop_devices(haptic);
      return status;
    }
    atomic_store(&slot->phase, HAPI_POINTER_ADDED);
  }
  return HAP_OK;
}

bool hapi_pointers_stop_devices(hapi_haptic *haptic)
{
  bool all = true;
  for (uint32_t i = 0; i < haptic->config.capacity.pointers; ++i) {
    all = stop_device(&haptic->slots[i]) && all;
  }
  return all;
}

bool hapi_haptic_has_pointers(const hapi_haptic *haptic)
{
  bool any = false;
  for (uint32_t i = 0; i < haptic->config.capacity.pointers; ++i) {
    any = any || atomic_load(&haptic->slots[i].phase) != HAPI_POINTER_EMPTY;
  }
  return any;
}

static hapi_pointer_slot *find_slot(hapi_haptic *haptic, hap_pointer_id id)
{
  uint32_t index = (uint32_t)(id.v & 0xffffffffu);
  if (index == 0 || index > haptic->config.capacity.pointers) {
    return NULL;
  }
  hapi_pointer_slot *slot = &haptic->slots[index - 1];
  int phase = atomic_load(&slot->phase);
  bool there = phase == HAPI_POINTER_ADDED || phase == HAPI_POINTER_ACTIVE ||
               phase == HAPI_POINTER_PAUSING || phase == HAPI_POINTER_PAUSED;
  return there && slot->generation == (uint32_t)(id.v >> 32) ? slot : NULL;
}

bool hapi_haptic_has_pointer(hapi_haptic *haptic, hap_pointer_id id)
{
  return find_slot(haptic, id) != NULL;
}

bool hapi_haptic_pointer_acts(hapi_haptic *haptic, hap_pointer_id id)
{
  const hapi_pointer_slot *slot = find_slot(haptic, id);
  return slot != NULL && atomic_load(&slot->phase) == HAPI_POINTER_ACTIVE;
}

/* With its lock taken; NULL: it is not there, or it was removed in between. */
hapi_pointer_slot *hapi_slot_lock(hapi_haptic *haptic, hap_pointer_id id)
{
  hapi_pointer_slot *slot = find_slot(haptic, id);
  if (slot == NULL) {
    return NULL;
  }
  pthread_mutex_lock(&slot->lock);
  if (find_slot(haptic, id) != slot) {
    pthread_mutex_unlock(&slot->lock);
    return NULL;
  }
  return slot;
}

static void fill_slot(hapi_pointer_slot *slot, const hapi_pointer_setup *def)
{
  slot->def = *def;
  slot->def.hull_xyz = NULL;
  memset(&slot->hull, 0, sizeof slot->hull);
  slot->hull.count = (uint32_t)def->hull_points;
  if (def->hull_points > 0) {
    memcpy(slot->hull.points, def->hull_xyz, 3 * def->hull_points * sizeof(double));
  }
  slot->ops = def->device != NULL ? hapi_device_ops(def->device) : NULL;
  slot->self = def->device != NULL ? hapi_device_self(def->device) : NULL;
  slot->effector = def->device != NULL ? &def->device->effectors[def->effector] : NULL;
  slot->has_device = def->device != NULL;
  memset(&slot->info, 0, sizeof slot->info);
  if (def->device != NULL) {
    slot->info = slot->effector->info;
    memcpy(slot->axes, slot->effector->axes, sizeof slot->axes);
  }
  slot_prepare(slot);
}

static hap_status check_coupling(const hapi_haptic *haptic, const hapi_pointer_slot *slot,
                                 const hapi_pointer_setup *def, hap_detail *detail)
{
  const char *name = hap_coupling_name(def->coupling);
  if (!hapi_coupling_has_spring(def->coupling)) {
    return HAP_OK;
  }
  hapi_coupling_gains gains = hapi_coupling_gains_of(&slot->info, def, haptic->tick.facts.period);
  double scale = def->motion_scale * def->force_scale;
  if (gains.known && !(gains.stiffness <= scale * WORLD_STIFFNESS_MOST)) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "coupling %s: with force_scale %g the spring of %g N/m has no use; take "
                     "coupling direct or a larger force_scale",
                     name, def->force_scale, gains.stiffness);
  }
  if (!gains.known) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "coupling %s: the device gives neither damping nor rated stiffness; set "
                     "coupling_stiffness, or have the device identified",
                     name);
  }
  return HAP_OK;
}

static hap_status device_take(const hapi_haptic *haptic, const hapi_pointer_setup *def,
                              hap_detail *detail)
{
  hap_device *device = def->device;
  uint32_t count = device != NULL ? device->effector_count : 1;
  if (def->effector >= count) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "effector is %u: the device has %u, which count from 0", def->effector, count);
  }
  if (device == NULL || hapi_device_claim_effector(device, haptic, def->effector)) {
    return HAP_OK;
  }
  return hapi_fail(detail, HAP_ERROR_STATE, "the device serves another pointer already%s",
                   count > 1 ? " with this end effector, or one of another session" : "");
}

hap_status hapi_haptic_add_pointer(hapi_haptic *haptic, const hapi_pointer_setup *def,
                                   hap_pointer_id *out, hap_detail *detail)
{
  uint32_t index = 0;
  while (index < haptic->config.capacity.pointers &&
         atomic_load(&haptic->slots[index].phase) != HAPI_POINTER_EMPTY) {
    ++index;
  }
  if (index == haptic->config.capacity.pointers) {
    return hapi_fail(detail, HAP_ERROR_CAPACITY,
                     "all %u pointers of the session are in use; raise max_pointers",
                     haptic->config.capacity.pointers);
  }
  HAPI_TRY(device_take(haptic, def, detail));
  hapi_pointer_slot *slot = &haptic->slots[index];
  fill_slot(slot, def);
  hap_status status = check_coupling(haptic, slot, &slot->def, detail);
  if (status >= HAP_OK && haptic->begun) {
    status = start_device(haptic, slot, detail);
  }
  if (status < HAP_OK) {
    if (def->device != NULL) {
      hapi_device_release_effector(def->device, def->effector);
    }
    return status;
  }
  out->v = ((uint64_t)slot->generation << 32) | (index + 1);
  atomic_store_explicit(&slot->phase, HAPI_POINTER_ADDED, memory_order_release);
  return HAP_OK;
}

/* The loop lets go of the pointer; when no loop runs, it is done here. False: the loop stands
 * still, and the pointer stays what it was. */
static bool leave_loop(hapi_haptic *haptic, hapi_pointer_slot *slot, hapi_pointer_phase way)
{
  int64_t end = hapi_clock_now() + (int64_t)(1e9 * HAPI_SAFETY_STOP_WAIT_S);
  int before = atomic_exchange(&slot->phase, (int)way);
  while (haptic->thread.running && atomic_load(&slot->phase) != phase_after((int)way)) {
    int wanted = (int)way;
    if (hapi_clock_now() >= end && atomic_compare_exchange_strong(&slot->phase, &wanted, before)) {
      return false;
    }
    hapi_clock_sleep_until(hapi_clock_now() + 1000000);
  }
  if (!haptic->thread.running) {
    hapi_pointers_follow(haptic);
  }
  return true;
}

hap_status hapi_haptic_remove_pointer(hapi_haptic *haptic, hap_pointer_id id)
{
  hapi_pointer_slot *slot = find_slot(haptic, id);
  if (slot == NULL) {
    return HAP_ERROR_NOT_FOUND;
  }
  if (!leave_loop(haptic, slot, HAPI_POINTER_LEAVING)) {
    return HAP_ERROR_TIMEOUT;
  }
  if (!stop_device(slot)) {
    atomic_store(&slot->phase, HAPI_POINTER_PAUSED);
    return HAP_ERROR_TIMEOUT;
  }
  if (slot->def.device != NULL) {
    pthread_mutex_lock(&slot->lock); /* nobody is asking it to explain itself */
    hapi_device_release_effector(slot->def.device, slot->def.effector);
    pthread_mutex_unlock(&slot->lock);
  }
  atomic_store(&slot->phase, HAPI_POINTER_EMPTY);
  return HAP_OK;
}

void hapi_haptic_explain(hapi_haptic *haptic, hap_pointer_id id, hap_detail *out)
{
  hapi_pointer_slot *slot = hapi_slot_lock(haptic, id);
  out->text[0] = '\0';
  if (slot == NULL) {
    return;
  }
  if (slot->ops != NULL) {
    hapi_device_explain(slot->ops, slot->self, out);
  }
  pthread_mutex_unlock(&slot->lock);
}

static bool slot_has(const hapi_pointer_slot *slot, const hap_device *device)
{
  return atomic_load(&slot->phase) != HAPI_POINTER_EMPTY && slot->def.device == device;
}

/* All pointers of the device; false: the loop or the device does not come back. */
static bool device_pause(hapi_haptic *haptic, const hap_device *device)
{
  bool gone = true;
  for (uint32_t i = 0; gone && i < haptic->config.capacity.pointers; ++i) {
    hapi_pointer_slot *slot = &haptic->slots[i];
    if (slot_has(slot, device)) {
      gone = leave_loop(haptic, slot, HAPI_POINTER_PAUSING) && stop_device(slot);
    }
  }
  return gone;
}

static hap_status device_resume(hapi_haptic *haptic, const hap_device *device, hap_detail *detail)
{
  hap_status status = HAP_OK;
  for (uint32_t i = 0; status >= HAP_OK && i < haptic->config.capacity.pointers; ++i) {
    hapi_pointer_slot *slot = &haptic->slots[i];
    if (slot_has(slot, device)) {
      status = start_device(haptic, slot, detail);
      if (status >= HAP_OK) {
        atomic_store_explicit(&slot->phase, HAPI_POINTER_ADDED, memory_order_release);
      }
    }
  }
  return status;
}

/* Not in the loop's thread: start may block. */
hap_status hapi_haptic_restart_pointer(hapi_haptic *haptic, hap_pointer_id id, hap_detail *detail)
{
  hapi_pointer_slot *slot = find_slot(haptic, id);
  if (slot == NULL) {
    return hapi_fail(detail, HAP_ERROR_NOT_FOUND, "there is no such pointer");
  }
  if (slot->ops == NULL || !haptic->begun) {
    return hapi_fail(
        detail, HAP_ERROR_STATE,
        slot->ops == NULL ? "the pointer has no device" : "the session is not started");
  }
  const hap_device *device = slot->def.device;
  if (!device_pause(haptic, device)) {
    hap_detail where;
    hapi_haptic_where(haptic, &where);
    return hapi_fail(detail, HAP_ERROR_TIMEOUT, "the loop or the device has not come back: %.400s",
                     where.text);
  }
  return device_resume(haptic, device, detail);
}

static hap_status target_set(hapi_haptic *haptic, hap_pointer_id id,
                             const hapi_pointer_target *target)
{
  hapi_pointer_slot *slot = hapi_slot_lock(haptic, id);
  if (slot == NULL) {
    return HAP_ERROR_NOT_FOUND;
  }
  bool free = slot->ops == NULL;
  if (free) {
    slot->targets[hapi_triple_back(&slot->target_buffer)] = *target;
    hapi_triple_publish(&slot->target_buffer);
  }
  pthread_mutex_unlock(&slot->lock);
  return free ? HAP_OK : HAP_ERROR_STATE;
}

hap_status hapi_haptic_set_target(hapi_haptic *haptic, hap_pointer_id id, const hap_pose *pose,
                                  const hap_twist *twist)
{
  hapi_pointer_target target = {.pose = *pose};
  if (twist != NULL) {
    target.twist = *twist;
  }
  return target_set(haptic, id, &target);
}

hap_status hapi_haptic_carry_target(hapi_haptic *haptic, hap_pointer_id id, const hap_pose *pose,
                                    const hap_twist *twist, const int64_t told_carried_ns[2])
{
  const hapi_pointer_target target = {*pose, *twist, told_carried_ns[0], told_carried_ns[1]};
  return target_set(haptic, id, &target);
}

hap_status hapi_haptic_set_pointer(hapi_haptic *haptic, hap_pointer_id id, hapi_setting_merge merge,
                                   const void *of, hap_detail *detail)
{
  hapi_pointer_slot *slot = hapi_slot_lock(haptic, id);
  if (slot == NULL) {
    return HAP_ERROR_NOT_FOUND;
  }
  hapi_pointer_wishes *newest = &slot->set.newest;
  hapi_pointer_setting value = newest->value;
  hapi_tool_hull hull = newest->hull;
  hap_status status = merge(of, &value, &hull, detail);
  if (status >= HAP_OK) {
    status = check_coupling(haptic, slot, &value.def, detail);
  }
  if (status >= HAP_OK) {
    newest->value = value;
    newest->hull = hull;
    for (int i = 0; i < HAPI_SET_BITS; ++i) {
      newest->numbers[i] += value.mask >> i & 1u;
    }
    slot->set.places[hapi_triple_back(&slot->set.buffer)] = *newest;
    hapi_triple_publish(&slot->set.buffer);
  }
  pthread_mutex_unlock(&slot->lock);
  return status;
}

hap_status hapi_haptic_get_settings(hapi_haptic *haptic, hap_pointer_id id,
                                    hapi_pointer_setting *out)
{
  hapi_pointer_slot *slot = hapi_slot_lock(haptic, id);
  if (slot == NULL) {
    return HAP_ERROR_NOT_FOUND;
  }
  *out = slot->set.newest.value;
  pthread_mutex_unlock(&slot->lock);
  return HAP_OK;
}

hap_status hapi_haptic_workspace(hapi_haptic *haptic, hap_pointer_id id, double out_low[3],
                                 double out_high[3])
{
  hapi_pointer_slot *slot = hapi_slot_lock(haptic, id);
  bool known = true;
  if (slot == NULL) {
    return HAP_ERROR_NOT_FOUND;
  }
  hapi_v3_copy(slot->info.workspace_low, out_low);
  hapi_v3_copy(slot->info.workspace_high, out_high);
  pthread_mutex_unlock(&slot->lock);
  for (int i = 0; i < 3; ++i) {
    known = known && out_low[i] < out_high[i];
  }
  return known ? HAP_OK : HAP_ERROR_UNSUPPORTED;
}

hap_status hapi_haptic_get_pointer(hapi_haptic *haptic, hap_pointer_id id, hap_pointer_state *out)
{
  hapi_pointer_slot *slot = hapi_slot_lock(haptic, id);
  if (slot == NULL) {
    return HAP_ERROR_NOT_FOUND;
  }
  hapi_triple_take(&slot->state_buffer);
  *out = slot->states[hapi_triple_front(&slot->state_buffer)];
  pthread_mutex_unlock(&slot->lock);
  return HAP_OK;
}
