/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/effect_clock.h"
#include "base/pointer_id.h"
#include "base/thread.h"
#include "base/vec.h"
#include "device/emergency.h"
#include "guard/force_guard.h"
#include "haptic/grabs.h"
#include "haptic/own_call.h"
#include "haptic/own_forces.h"
#include "haptic/texture_time.h"
#include "haptic/tick_memory.h"
#include "tick/report.h"

#define LATE_SHARE 0.9 /* of its period, that a tick may take */

#define STORE(field, value) \
  atomic_store_explicit(&haptic->figures.field, (value), memory_order_relaxed)
#define LOAD(field) atomic_load_explicit(&haptic->figures.field, memory_order_relaxed)

hap_status hapi_haptic_create(const hapi_haptic_config *config, hapi_haptic **out)
{
  const uint32_t pointers = config->capacity.pointers;
  *out = NULL;
  hapi_haptic *haptic = hapi_alloc(sizeof *haptic);
  if (haptic == NULL) {
    return HAP_ERROR_MEMORY;
  }
  hapi_black_box *box = &haptic->black_box;
  haptic->config = *config;
  pthread_mutex_init(&haptic->black_box_lock, NULL);
  /* hapi_alloc_array writes zeros: no tick is the first to touch a page. */
  box->pointers = pointers;
  box->rows = hapi_alloc_array((size_t)HAP_BLACK_BOX_TICKS * pointers, sizeof *box->rows);
  box->counts = hapi_alloc_array(HAP_BLACK_BOX_TICKS, sizeof *box->counts);
  haptic->ring.capacity = config->trace_rows;
  haptic->ring.rows = hapi_alloc_array(config->trace_rows, sizeof *haptic->ring.rows);
  haptic->slots = hapi_alloc_array(pointers, sizeof *haptic->slots);
  for (uint32_t i = 0; haptic->slots != NULL && i < pointers; ++i) {
    atomic_init(&haptic->slots[i].phase, HAPI_POINTER_EMPTY);
    pthread_mutex_init(&haptic->slots[i].lock, NULL);
  }
  bool tick = hapi_tick_memory_create(&haptic->tick, &config->capacity);
  bool told = hapi_told_create(haptic);
  if (!tick || !told || box->rows == NULL || box->counts == NULL || haptic->ring.rows == NULL ||
      haptic->slots == NULL) {
    hapi_haptic_destroy(haptic);
    return HAP_ERROR_MEMORY;
  }
  haptic->tick.facts.period = 1.0 / config->haptic_hz;
  haptic->tick.hashing = config->lockstep;
  haptic->tick.guard.mode = config->guard;
  hapi_tick_reset(&haptic->tick);
  *out = haptic;
  return HAP_OK;
}

void hapi_haptic_destroy(hapi_haptic *haptic)
{
  if (haptic == NULL) {
    return;
  }
  bool ended = hapi_haptic_end(haptic);
  HAPI_ASSERT(ended);
  (void)ended;
  for (uint32_t i = 0; haptic->slots != NULL && i < haptic->config.capacity.pointers; ++i) {
    hap_pointer_id id = {((uint64_t)haptic->slots[i].generation << 32) | (i + 1)};
    (void)hapi_haptic_remove_pointer(haptic, id);
    hapi_own_list_finish(&haptic->slots[i].own);
    pthread_mutex_destroy(&haptic->slots[i].lock);
  }
  hapi_told_destroy(haptic);
  hapi_free(haptic->slots);
  hapi_free(haptic->ring.rows);
  hapi_free(haptic->black_box.rows);
  hapi_free(haptic->black_box.counts);
  pthread_mutex_destroy(&haptic->black_box_lock);
  hapi_tick_memory_destroy(&haptic->tick);
  hapi_free(haptic);
}

static void figures_publish(hapi_haptic *haptic)
{
  const hapi_tick *tick = &haptic->tick;
  const hapi_fault_latch *latch = &tick->guard.latch;
  int64_t age = tick->facts.model_number != 0 ? tick->facts.now_ns - tick->facts.state_ns : 0;
  STORE(loop.ticks, tick->facts.tick);
  STORE(hand.contact_ticks, tick->touches.contact_ticks);
  STORE(hand.saturated_ticks, tick->guard.saturated_ticks);
  STORE(faults.count, latch->count);
  STORE(faults.fault, (int)latch->fault);
  STORE(faults.fault_pointer,
        hapi_pointer_id_of(latch->generation, latch->pointer)); /* id; 0: none */
  STORE(faults.stale_times, tick->guard.stale_times);
  STORE(faults.stale_ticks, tick->guard.stale_ticks);
  STORE(hand.slewed_ticks, tick->guard.slewed_ticks);
  STORE(hand.energy_ticks, tick->guard.energy_ticks);
  STORE(hand.derated_ticks, tick->guard.late.derated_ticks);
  STORE(hand.oscillation_ticks, tick->guard.oscillation_ticks);
  STORE(loop.model, (int)tick->facts.model);
  STORE(loop.hash, tick->hashing && tick->facts.tick > 0 ? tick->hash : 0);
  STORE(loop.age_ns, age);
  if (age > LOAD(loop.age_max_ns)) {
    STORE(loop.age_max_ns, age);
  }
  STORE(hand.peak_force, tick->guard.peak_force);
  STORE(solver.sweeps, tick->rows.sweeps);
  STORE(solver.residual, tick->rows.residual_max);
  STORE(solver.unsolved_ticks, tick->rows.unsolved_all);
  STORE(solver.local_contacts, tick->facts.model == HAP_MODEL_CONTACT ? tick->contacts.active : 0);
  STORE(hand.impulse_abs, tick->touches.hand_impulse_abs);
  for (int i = 0; i < 3; ++i) {
    STORE(hand.impulse[i], tick->touches.hand_impulse[i]);
  }
}

/* Of a tick that has been reset. */
static void figures_reset(hapi_haptic *haptic)
{
  hapi_histogram_reset(&haptic->figures.loop.tick_ns);
  hapi_histogram_reset(&haptic->figures.loop.wake_ns);
  STORE(loop.missed_ticks, 0);
  STORE(loop.models_adopted, 0);
  STORE(loop.contact_passes, 0);
  STORE(loop.trace_dropped, 0);
  STORE(loop.age_max_ns, 0);
  figures_publish(haptic);
  atomic_store(&haptic->ring.read, 0);
  atomic_store(&haptic->ring.written, 0);
  atomic_store(&haptic->reset_fault, 0);
  atomic_store(&haptic->outside_fault, HAP_FAULT_NONE);
  atomic_store(&haptic->standstill.blocked, 0);
  atomic_store(&haptic->standstill.happened, 0);
}

static void state_report(hapi_haptic *haptic)
{
  hapi_state *state = hapi_exchange_state_back(haptic->config.exchange);
  hapi_tick_report(&haptic->tick, state);
  state->load = haptic->time.load;
  hapi_tick_report_work(&haptic->tick, &haptic->time.work);
  state->work = haptic->time.work;
  state->derated = haptic->tick.guard.late.derated_ticks > 0;
  state->swings = haptic->tick.guard.oscillation_ticks > 0;
  state->force_out = haptic->told.hands.out;
  state->texture_out = haptic->tick.touches.textures.out != 0;
  state->unsolved = haptic->tick.rows.unsolved_most;
  hapi_exchange_state_publish(haptic->config.exchange);
}

hap_status hapi_haptic_begin(hapi_haptic *haptic, int64_t start_ns, hap_detail *detail)
{
  hapi_tick_reset(&haptic->tick);
  memset(haptic->tick.pointers.of, 0,
         haptic->config.capacity.pointers * sizeof *haptic->tick.pointers.of);
  haptic->tick.pointers.high = 0;
  figures_reset(haptic);
  hapi_loop_effects_reset(haptic);
  hapi_told_reset(haptic);
  pthread_mutex_lock(&haptic->black_box_lock);
  hapi_black_box_reset(&haptic->black_box);
  pthread_mutex_unlock(&haptic->black_box_lock);
  haptic->emergencies = hapi_emergencies();
  haptic->pending = NULL;
  haptic->pending_patches = NULL;
  haptic->start_ns = start_ns;
  haptic->time.last_tick_us = 0.0;
  haptic->time.tick_budget_ns = 0;
  memset(&haptic->time.load, 0, sizeof haptic->time.load);
  memset(&haptic->time.work, 0, sizeof haptic->time.work);
  hapi_grabs_reset(haptic);
  hapi_texture_time_begin(haptic);
  hap_status status = hapi_pointers_start_devices(haptic, detail);
  if (status < HAP_OK) {
    return status;
  }
  haptic->begun = true;
  /* Physics builds the first local model around where the pointers are. */
  hapi_tape_begin(haptic, start_ns);
  hapi_pointers_follow(haptic);
  hapi_pointers_read(haptic, start_ns);
  hapi_pulse_beat(&haptic->standstill.pulse, HAPI_PHASE_NONE, 0); /* until the loop runs */
  hapi_tape_begun(haptic);
  hapi_tick_read(&haptic->tick, start_ns);
  state_report(haptic);
  return HAP_OK;
}

void hapi_haptic_set_start(hapi_haptic *haptic, int64_t start_ns)
{
  haptic->start_ns = start_ns;
}

void hapi_haptic_set_tape(hapi_haptic *haptic, hapi_tape *tape)
{
  haptic->tape = tape;
}

void hapi_haptic_count_missed(hapi_haptic *haptic, uint64_t ticks)
{
  STORE(loop.missed_ticks, LOAD(loop.missed_ticks) + ticks);
}

bool hapi_haptic_end(hapi_haptic *haptic)
{
  if (haptic->begun && (!hapi_haptic_stop_thread(haptic) || !hapi_pointers_stop_devices(haptic))) {
    return false;
  }
  haptic->begun = false;
  return true;
}

static void publish_poses(hapi_haptic *haptic)
{
  if (haptic->tick.facts.model == HAP_MODEL_CONTACT) {
    hapi_tick_report_poses(&haptic->tick, hapi_exchange_poses_back(haptic->config.exchange));
    hapi_exchange_poses_publish(haptic->config.exchange);
  }
}

/* All is taken before anything is told: what a tick has from the other threads then never comes of
 * what it has told them itself, and a replay can run them one after the other. A set of patches
 * that was taken and is not due leaves the one in use to its writer, who fills in another one
 * first: that happens in lockstep alone, where a tick comes between any two passes. */
static void take_messages(hapi_haptic *haptic)
{
  bool model = haptic->pending == NULL;
  bool patches = haptic->pending_patches == NULL;
  if (model) {
    haptic->pending = hapi_exchange_model_take(haptic->config.exchange);
  }
  if (patches) {
    haptic->pending_patches = hapi_exchange_patches_take(haptic->config.exchange);
  }
  if (haptic->tape != NULL) {
    hapi_tape_taken(haptic, model && haptic->pending != NULL,
                    patches && haptic->pending_patches != NULL);
  }
}

static void messages_receive(hapi_haptic *haptic, int64_t now_ns)
{
  HAPI_ASSERT(hapi_thread_is_mine(&haptic->thread));
  take_messages(haptic);
  if (haptic->pending != NULL && now_ns >= haptic->pending->valid_from_ns) {
    haptic->tick.facts.now_ns = now_ns;
    haptic->time.tick_budget_ns = haptic->pending->tick_budget_ns;
    hapi_tick_adopt(&haptic->tick, haptic->pending, now_ns);
    haptic->pending = NULL;
    STORE(loop.models_adopted, LOAD(loop.models_adopted) + 1);
    hapi_loop_note_effects(haptic);
    publish_poses(haptic); /* the contact thread looks for new bodies */
  }
  if (haptic->pending_patches != NULL && now_ns >= haptic->pending_patches->valid_from_ns) {
    hapi_tick_adopt_patches(&haptic->tick, haptic->pending_patches);
    haptic->pending_patches = NULL;
    STORE(loop.contact_passes, LOAD(loop.contact_passes) + 1);
  }
}

void hapi_haptic_receive(hapi_haptic *haptic, int64_t now_ns)
{
  unsigned before = hapi_denormals_flush();
  messages_receive(haptic, now_ns);
  hapi_denormals_restore(before);
}

/* The devices have zero already. */
static void pointers_cut(hapi_haptic *haptic)
{
  for (uint32_t i = 0; i < haptic->config.capacity.pointers; ++i) {
    hapi_guard_cut(&haptic->tick.pointers.of[i]);
    hapi_outputs_cut(&haptic->tick.outputs[i]);
  }
}

/* After the devices were read, where the loop may have stood still: it gives no force any more. */
static void standstill_follow(hapi_haptic *haptic)
{
  hapi_loop_standstill io;
  hapi_standstill_take(haptic, &io);
  hapi_tape_standstill(haptic, &io);
  if (io.blocked) {
    hapi_tick_fault(&haptic->tick, HAP_FAULT_BLOCKED, io.pointer);
    pointers_cut(haptic);
  }
}

/* What other threads want of the tick. */
static void calls_follow(hapi_haptic *haptic)
{
  hapi_loop_calls calls;
  calls.reset = atomic_load_explicit(&haptic->reset_fault, memory_order_acquire) != 0;
  if (calls.reset) {
    atomic_store_explicit(&haptic->reset_fault, 0, memory_order_relaxed);
  }
  calls.outside_fault =
      (hap_fault)atomic_load_explicit(&haptic->outside_fault, memory_order_acquire);
  if (calls.outside_fault != HAP_FAULT_NONE) {
    atomic_store_explicit(&haptic->outside_fault, HAP_FAULT_NONE, memory_order_relaxed);
  }
  uint64_t emergencies = hapi_emergencies();
  calls.emergency = emergencies != haptic->emergencies;
  haptic->emergencies = emergencies;
  hapi_tape_calls(haptic, &calls);
  if (calls.reset) {
    hapi_tick_reset_fault(&haptic->tick);
  }
  if (calls.outside_fault != HAP_FAULT_NONE) {
    hapi_tick_fault(&haptic->tick, calls.outside_fault, 0);
  }
  if (calls.emergency) {
    hapi_tick_fault(&haptic->tick, HAP_FAULT_EMERGENCY, 0);
    pointers_cut(haptic);
  }
}

static void time_note(hapi_haptic *haptic, int64_t begin_ns)
{
  int64_t spent_ns = hapi_clock_now() - begin_ns;
  hapi_histogram_add(&haptic->figures.loop.tick_ns, spent_ns);
  hapi_loop_sample_end(haptic, spent_ns);
  haptic->time.last_tick_us = 1e-3 * (double)spent_ns;
  ++haptic->time.work.ticks;
  haptic->time.work.spent_ns += (double)spent_ns;
  const hapi_work *work = &haptic->tick.rows.work;
  haptic->time.work.late += work->most > 0 && work->done > work->most / 4 &&
                            (double)spent_ns > LATE_SHARE * 1e9 / haptic->config.haptic_hz;
  if (haptic->time.tick_budget_ns > 0) {
    ++haptic->time.load.ticks;
    haptic->time.load.over += spent_ns > haptic->time.tick_budget_ns;
    haptic->time.load.spent_ns += (double)spent_ns;
  }
}

/* A row without room is dropped and counted: the loop never waits. */
static void trace_write(hapi_haptic *haptic)
{
  hapi_trace_ring *ring = &haptic->ring;
  if (ring->capacity == 0) {
    return;
  }
  uint64_t written = atomic_load_explicit(&ring->written, memory_order_relaxed);
  uint64_t read = atomic_load_explicit(&ring->read, memory_order_acquire);
  if (written - read >= ring->capacity) {
    STORE(loop.trace_dropped, LOAD(loop.trace_dropped) + 1);
    return;
  }
  hap_trace_row *row = &ring->rows[written % ring->capacity];
  hapi_tick_trace(&haptic->tick, row);
  row->t = 1e-9 * (double)(haptic->tick.facts.now_ns - haptic->start_ns);
  row->tick_us = haptic->time.last_tick_us;
  atomic_store_explicit(&ring->written, written + 1, memory_order_release);
}

void hapi_haptic_cycle(hapi_haptic *haptic, int64_t now_ns)
{
  HAPI_ASSERT(hapi_thread_is_mine(&haptic->thread));
  int64_t begin_ns = hapi_clock_now();
  unsigned before = hapi_denormals_flush();
  hapi_pulse_beat(&haptic->standstill.pulse, HAPI_PHASE_TICK, 0);
  hapi_loop_sample_begin(haptic);
  if (haptic->tape != NULL) {
    hapi_tape_tick(haptic, now_ns);
  }
  hapi_pointers_follow(haptic);
  hapi_own_follow(haptic, now_ns);
  hapi_texture_time_follow(haptic);
  calls_follow(haptic);
  messages_receive(haptic, now_ns);
  hapi_pointers_read(haptic, now_ns);
  standstill_follow(haptic);
  hapi_pulse_beat(&haptic->standstill.pulse, HAPI_PHASE_TICK, 0);
  hapi_tick_read(&haptic->tick, now_ns);
  if (haptic->told.hands.any) {
    hapi_own_call_all(haptic);
  }
  hapi_tick_answer(&haptic->tick);
  hapi_pointers_write(haptic);
  if (haptic->tick.touches.textures.called != 0) {
    hapi_texture_time_judge(haptic);
  }
  hapi_pulse_beat(&haptic->standstill.pulse, HAPI_PHASE_TICK, 0);
  if (haptic->tape != NULL) {
    uint64_t recording = hapi_effect_begin(&haptic->tick.sample);
    hapi_tape_ticked(haptic);
    if (hapi_tape_records(haptic->tape)) {
      hapi_effect_end(&haptic->tick.sample, HAP_EFFECT_RECORDING, recording);
    }
  }
  hapi_black_box_record(&haptic->black_box, &haptic->tick);
  state_report(haptic);
  publish_poses(haptic);
  hapi_tick_report_trail(&haptic->tick, hapi_exchange_trail(haptic->config.exchange));
  hapi_tick_report_path(&haptic->tick, hapi_exchange_path(haptic->config.exchange));
  hapi_pointers_publish(haptic);
  uint32_t asked = atomic_load_explicit(&haptic->told.asked, memory_order_relaxed);
  if (asked != 0) {
    hapi_told_publish(haptic, asked);
  }
  trace_write(haptic);
  figures_publish(haptic);
  time_note(haptic, begin_ns);
  hapi_denormals_restore(before);
}

void hapi_haptic_reset_fault(hapi_haptic *haptic)
{
  atomic_store_explicit(&haptic->reset_fault, 1, memory_order_release);
}

void hapi_haptic_fault(hapi_haptic *haptic, hap_fault fault)
{
  atomic_store_explicit(&haptic->outside_fault, (int)fault, memory_order_release);
}

bool hapi_haptic_has_fault(const hapi_haptic *haptic)
{
  return LOAD(faults.fault) != HAP_FAULT_NONE || hapi_standstill_pending(haptic);
}

void hapi_haptic_stats(const hapi_haptic *haptic, hap_stats *out)
{
  const hapi_histogram *tick = &haptic->figures.loop.tick_ns;
  const hapi_histogram *wake = &haptic->figures.loop.wake_ns;
  double impulse[3];
  for (int i = 0; i < 3; ++i) {
    impulse[i] = LOAD(hand.impulse[i]);
  }
  out->loop.tick_us_mean = 1e-3 * hapi_histogram_mean_ns(tick);
  out->loop.tick_us_p50 = 1e-3 * hapi_histogram_quantile_ns(tick, 0.5);
  out->loop.tick_us_p99 = 1e-3 * hapi_histogram_quantile_ns(tick, 0.99);
  out->loop.tick_us_max = 1e-3 * hapi_histogram_max_ns(tick);
  out->loop.duty = 1e-6 * out->loop.tick_us_mean * haptic->config.haptic_hz;
  out->loop.wake_us_mean = 1e-3 * hapi_histogram_mean_ns(wake);
  out->loop.wake_us_p50 = 1e-3 * hapi_histogram_quantile_ns(wake, 0.5);
  out->loop.wake_us_p99 = 1e-3 * hapi_histogram_quantile_ns(wake, 0.99);
  out->loop.wake_us_p999 = 1e-3 * hapi_histogram_quantile_ns(wake, 0.999);
  out->loop.wake_us_max = 1e-3 * hapi_histogram_max_ns(wake);
  out->loop.model = (uint32_t)LOAD(loop.model);
  out->loop.ticks = LOAD(loop.ticks);
  out->loop.missed_ticks = LOAD(loop.missed_ticks);
  out->loop.contact_ticks = LOAD(hand.contact_ticks);
  out->loop.model_age_s = 1e-9 * (double)LOAD(loop.age_ns);
  out->loop.model_age_max_s = 1e-9 * (double)LOAD(loop.age_max_ns);
  out->loop.models_adopted = LOAD(loop.models_adopted);
  out->contact.passes = LOAD(loop.contact_passes);
  out->contact.points = LOAD(solver.local_contacts);
  out->contact.sweeps = LOAD(solver.sweeps);
  out->contact.residual_max = LOAD(solver.residual);
  out->room.unsolved_ticks = LOAD(solver.unsolved_ticks);
  out->hand.impulse_ns = hapi_v3_norm(impulse);
  out->hand.impulse_abs_ns = LOAD(hand.impulse_abs);
  out->hand.peak_force_n = LOAD(hand.peak_force);
  out->faults.saturated_ticks = LOAD(hand.saturated_ticks);
  out->faults.count = LOAD(faults.count);
  out->faults.fault = (uint32_t)LOAD(faults.fault);
  out->faults.pointer = LOAD(faults.fault_pointer);
  out->faults.stale_times = LOAD(faults.stale_times);
  out->faults.stale_ticks = LOAD(faults.stale_ticks);
  out->faults.slewed_ticks = LOAD(hand.slewed_ticks);
  out->faults.energy_ticks = LOAD(hand.energy_ticks);
  out->safety.derated_ticks = LOAD(hand.derated_ticks);
  out->safety.oscillation_ticks = LOAD(hand.oscillation_ticks);
  out->events.dropped = atomic_load(&haptic->told.telling.events.dropped);
  out->loop.realtime = atomic_load(&haptic->thread.realtime) ? 1 : 0;
  out->loop.trace_dropped = LOAD(loop.trace_dropped);
  out->loop.trace_hash = LOAD(loop.hash);
  hapi_standstill_stats(haptic, out);
}

size_t hapi_haptic_read_black_box(hapi_haptic *haptic, hap_black_box_row *rows, size_t capacity,
                                  size_t size_of_row)
{
  pthread_mutex_lock(&haptic->black_box_lock);
  size_t count = hapi_black_box_read(&haptic->black_box, rows, capacity, size_of_row);
  pthread_mutex_unlock(&haptic->black_box_lock);
  return count;
}

size_t hapi_haptic_read_trace(hapi_haptic *haptic, hap_trace_row *rows, size_t capacity,
                              size_t size_of_row)
{
  size_t size = size_of_row < sizeof *rows ? size_of_row : sizeof *rows;
  hapi_trace_ring *ring = &haptic->ring;
  uint64_t read = atomic_load_explicit(&ring->read, memory_order_relaxed);
  uint64_t written = atomic_load_explicit(&ring->written, memory_order_acquire);
  size_t count = 0;
  while (read < written && count < capacity) {
    memcpy((char *)rows + count++ * size_of_row, &ring->rows[read++ % ring->capacity], size);
  }
  atomic_store_explicit(&ring->read, read, memory_order_release);
  return count;
}
