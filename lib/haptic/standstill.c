/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/log.h"
#include "haptic/haptic_internal.h"

/* The loop stands still: a device's watchdog sees it, notes it here and takes the force off. Who
 * asks for the statistics sees the fault from then on. The loop latches it when it goes on.
 *
 * The note comes before the zero, and the loop looks for a note after each write: so zero comes
 * last, whichever of the two is first. */

static void standstill_note(void *user, uint64_t word)
{
  hapi_haptic *haptic = user;
  atomic_store(&haptic->standstill.happened, word);
  atomic_store(&haptic->standstill.blocked, word);
}

static void standstill_tell(void *user, uint64_t word)
{
  hap_detail where;
  (void)word;
  hapi_haptic_where(user, &where);
  hapi_log(HAP_LOG_ERROR, "the loop stands still and a watchdog has taken the force off: %.300s",
           where.text);
}

hap_status hapi_standstill_watch(hapi_haptic *haptic, uint32_t index)
{
  hapi_pointer_slot *slot = &haptic->slots[index];
  if (haptic->config.lockstep) {
    return HAP_OK; /* who calls advance waits for the device */
  }
  const hapi_watchdog_def def = {
      .ops = slot->ops,
      .self = slot->self,
      .pulse = &haptic->standstill.pulse,
      .rate_hz = haptic->config.haptic_hz,
      .priority = haptic->config.rt_priority > 0 ? haptic->config.rt_priority + 1 : 0,
      .blocked = standstill_note,
      .tell = standstill_tell,
      .user = haptic};
  return hapi_watchdog_start(&slot->def.device->drive.watchdog, &def);
}

/* Index + 1 of the pointer in whose device, or in the call of whose force, the loop is; 0: in
 * none. */
static uint32_t word_pointer(const hapi_haptic *haptic, uint64_t word)
{
  hapi_phase phase = hapi_pulse_phase(word);
  uint32_t index = hapi_pulse_index(word);
  bool called = phase == HAPI_PHASE_READ || phase == HAPI_PHASE_WRITE || phase == HAPI_PHASE_CALL;
  return called && index < haptic->config.capacity.pointers ? index + 1 : 0;
}

bool hapi_standstill_pending(const hapi_haptic *haptic)
{
  return atomic_load(&haptic->standstill.blocked) != 0;
}

void hapi_standstill_take(hapi_haptic *haptic, hapi_loop_standstill *out)
{
  uint64_t word =
      hapi_standstill_pending(haptic) ? atomic_exchange(&haptic->standstill.blocked, 0) : 0;
  out->blocked = word != 0;
  out->pointer = word_pointer(haptic, word);
}

void hapi_standstill_stats(const hapi_haptic *haptic, hap_stats *io)
{
  uint64_t word = atomic_load(&haptic->standstill.blocked);
  if (word == 0 || io->faults.fault != HAP_FAULT_NONE) {
    return;
  }
  uint32_t pointer = word_pointer(haptic, word);
  io->faults.fault = HAP_FAULT_BLOCKED;
  io->faults.count += 1;
  io->faults.pointer =
      pointer > 0 ? ((uint64_t)haptic->slots[pointer - 1].generation << 32) | pointer : 0;
}

void hapi_haptic_where(hapi_haptic *haptic, hap_detail *out)
{
  uint64_t word = atomic_load(&haptic->standstill.happened);
  uint32_t pointer = word_pointer(haptic, word);
  if (hapi_pulse_phase(word) == HAPI_PHASE_CALL) {
    (void)hapi_fail(out, HAP_OK, "the call of an own force did not come back");
  } else if (pointer > 0) {
    const hapi_pointer_slot *slot = &haptic->slots[pointer - 1];
    (void)hapi_fail(out, HAP_OK, "device %s did not come back from %s",
                    atomic_load(&slot->phase) != HAPI_POINTER_EMPTY ? slot->info.name : "",
                    hapi_pulse_phase(word) == HAPI_PHASE_READ ? "read" : "write");
  } else if (word == 0) {
    (void)hapi_fail(out, HAP_OK, "a device did not come back from zero");
  } else {
    (void)hapi_fail(out, HAP_OK, "%s",
                    hapi_pulse_phase(word) == HAPI_PHASE_WAIT
                        ? "the haptic thread was not woken: do other programs hold the processors?"
                        : "a tick did not come to its end");
  }
}
