/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "plugins/common/relay_carrier.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/safety.h"
#include "base/vec.h"

#define RUNNING_MAX 64
#define EXIT_WAIT_NS 100000000LL
#define EXIT_LOOK_NS 500000LL
#define SPIN_S 0.004     /* over which an orientation's difference is taken */
#define SPIN_OLD_S 0.05  /* after a longer gap it begins anew */
#define LENGTH_OFF 0.01  /* of a quaternion */
#define TORQUE_NONE 1e-9 /* N m: see hapi_relay_take_arguments */

enum argument {
  MAX_FORCE,
  MAX_TORQUE,
  STALE,
  TIMEOUT,
  TURN
};

/* ---- arguments ---- */

static const char *const no_or_yes[] = {"0", "1", NULL};

void hapi_relay_arguments(hapi_argument out[HAPI_RELAY_ARGUMENTS])
{
  const hapi_argument known[HAPI_RELAY_ARGUMENTS] = {
      [MAX_FORCE] = {"max_force", HAPI_ARGUMENT_NUMBER, false, 1e-3, 1e3, "N from 0.001 to 1000"},
      [MAX_TORQUE] = {"max_torque", HAPI_ARGUMENT_NUMBER, false, 1e-6, 1e2, "N m from 1e-6 to 100"},
      [STALE] = {"stale", HAPI_ARGUMENT_NUMBER, false, 2e-3, 1.0,
                 "seconds from 0.002 to 1, less than timeout"},
      [TIMEOUT] = {"timeout", HAPI_ARGUMENT_NUMBER, false, 5e-3, 10.0,
                   "seconds from 0.005 to 10, more than stale"},
      [TURN] = {"turn", HAPI_ARGUMENT_WORD, .expected = "0 or 1", .words = no_or_yes},
  };
  memcpy(out, known, sizeof known);
}

hap_status hapi_relay_take_arguments(const hapi_argument_table *table, const hapi_argument *given,
                                     hapi_relay_settings *out, hap_detail *detail)
{
  out->stale = given[STALE].given ? given[STALE].number[0] : HAPI_SAFETY_SILENT_S;
  out->lost =
      given[TIMEOUT].given ? given[TIMEOUT].number[0] : fmax(HAPI_SAFETY_LOST_S, 2.0 * out->stale);
  if (out->stale >= out->lost) {
    return hapi_arguments_fail(table, &given[given[STALE].given ? STALE : TIMEOUT], detail);
  }
  if (given[MAX_FORCE].given) {
    out->max_force = given[MAX_FORCE].number[0];
  }
  if (given[MAX_TORQUE].given) {
    out->max_torque = given[MAX_TORQUE].number[0];
  }
  if (given[TURN].given) {
    out->turns = given[TURN].word == 1;
  }
  /* A passive handle turns the tool, and gets no torque worth the name: 0 would be "not known". */
  if (out->turns && out->max_torque == 0.0) {
    out->max_torque = TORQUE_NONE;
  }
  return HAP_OK;
}

/* ---- the end of the process ---- */

static struct {
  pthread_mutex_t lock;
  hapi_relay *of[RUNNING_MAX];
  pid_t process; /* that registered relays_rest; a child by fork has no carriers */
} running = {.lock = PTHREAD_MUTEX_INITIALIZER};

/* Of all that run: zero, and wait until it went out. Carriers still run in exit(). */
static void relays_rest(void)
{
  int64_t end = hapi_clock_now() + EXIT_WAIT_NS;
  if (getpid() != running.process) {
    return;
  }
  hapi_relay_leave();
  pthread_mutex_lock(&running.lock);
  for (int i = 0; i < RUNNING_MAX; ++i) {
    if (running.of[i] != NULL) {
      hapi_relay_zero(running.of[i]);
    }
  }
  for (int i = 0; i < RUNNING_MAX; ++i) {
    while (running.of[i] != NULL && !hapi_relay_is_resting(running.of[i]) &&
           hapi_clock_now() < end) {
      hapi_clock_sleep_until(hapi_clock_now() + EXIT_LOOK_NS);
    }
  }
  pthread_mutex_unlock(&running.lock);
}

static bool running_add(hapi_relay *relay)
{
  bool room = false;
  pthread_mutex_lock(&running.lock);
  if (running.process != getpid()) {
    running.process = getpid();
    /* Handlers run in the reverse order: this one comes before those of libraries that devices
     * loaded earlier. */
    (void)atexit(relays_rest);
  }
  for (int i = 0; i < RUNNING_MAX && !room; ++i) {
    room = running.of[i] == NULL;
    running.of[i] = room ? relay : running.of[i];
  }
  pthread_mutex_unlock(&running.lock);
  return room;
}

static void running_remove(const hapi_relay *relay)
{
  pthread_mutex_lock(&running.lock);
  for (int i = 0; i < RUNNING_MAX; ++i) {
    running.of[i] = running.of[i] == relay ? NULL : running.of[i];
  }
  pthread_mutex_unlock(&running.lock);
}

/* ---- life ---- */

void hapi_relay_init(hapi_relay *relay, const hapi_relay_settings *settings)
{
  memset(relay, 0, sizeof *relay);
  relay->settings = *settings;
  hapi_triple_init(&relay->sample_places);
  hapi_triple_init(&relay->command_places);
  atomic_init(&relay->zeroed, true);
  atomic_init(&relay->resting, true);
  atomic_init(&relay->cause, HAPI_RELAY_WELL);
  atomic_init(&relay->doubt, HAPI_RELAY_WELL);
  atomic_init(&relay->last, HAPI_RELAY_WELL);
}

bool hapi_relay_start(hapi_relay *relay)
{
  hapi_relay_stop(relay);
  hapi_triple_init(&relay->sample_places);
  hapi_triple_init(&relay->command_places);
  memset(&relay->tick, 0, sizeof relay->tick);
  memset(&relay->carrier, 0, sizeof relay->carrier);
  /* Any thread may look at these meanwhile. */
  atomic_store(&relay->resting, true);
  atomic_store(&relay->cause, HAPI_RELAY_WELL);
  atomic_store(&relay->doubt, HAPI_RELAY_WELL);
  atomic_store(&relay->last, HAPI_RELAY_WELL);
  relay->tick.start_ns = hapi_clock_now();
  relay->tick.running = running_add(relay);
  return relay->tick.running;
}

void hapi_relay_stop(hapi_relay *relay)
{
  if (relay->tick.running) {
    running_remove(relay);
    hapi_relay_zero(relay);
    relay->tick.running = false;
  }
}

/* ---- the carrier's side ---- */

/* Over a few ms: the difference of two samples that arrived at once is noise. */
static void spin_follow(hapi_relay_carrier *carrier, const hapi_relay_sample *sample)
{
  const double *q = sample->pose.quat_wxyz;
  double passed = 1e-9 * (double)(sample->stamp_ns - carrier->anchor_ns);
  if (carrier->anchor_ns != 0 && passed < SPIN_S) {
    return;
  }
  memset(carrier->spin, 0, sizeof carrier->spin);
  if (carrier->anchor_ns != 0 && passed < SPIN_OLD_S) {
    const double *a = carrier->anchor;
    const double back[4] = {a[0], -a[1], -a[2], -a[3]};
    double turned[4];
    hapi_quat_multiply(q, back, turned);
    double sine = hapi_v3_norm(turned + 1);
    double angle = 2.0 * atan2(sine, fabs(turned[0]));
    double scale = sine > 0.0 ? copysign(angle / sine, turned[0]) / passed : 0.0;
    hapi_v3_scale(scale, turned + 1, carrier->spin);
  }
  carrier->anchor_ns = sample->stamp_ns;
  memcpy(carrier->anchor, q, sizeof carrier->anchor);
}

bool hapi_relay_publish(hapi_relay *relay, const hapi_relay_sample *sample)
{
  hapi_relay_told *told = &relay->samples[hapi_triple_back(&relay->sample_places)];
  const double *q = sample->pose.quat_wxyz;
  double length = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  if (!hapi_finite(sample->pose.position, 3) || !hapi_finite(sample->velocity, 3) ||
      !(fabs(length - 1.0) <= LENGTH_OFF)) {
    hapi_relay_set_doubt(relay, HAPI_RELAY_NOT_FINITE);
    return false;
  }
  told->sample = *sample;
  if (relay->settings.turns) {
    hapi_quat_normalize(told->sample.pose.quat_wxyz);
    spin_follow(&relay->carrier, &told->sample);
  } else {
    const double identity[4] = {1.0, 0.0, 0.0, 0.0};
    memcpy(told->sample.pose.quat_wxyz, identity, sizeof identity);
  }
  hapi_v3_copy(relay->carrier.spin, told->spin);
  hapi_triple_publish(&relay->sample_places);
  hapi_relay_set_doubt(relay, HAPI_RELAY_WELL);
  return true;
}

void hapi_relay_wanted(hapi_relay *relay, int64_t now_ns, hap_wrench *out)
{
  hapi_relay_carrier *carrier = &relay->carrier;
  if (hapi_triple_take(&relay->command_places)) {
    carrier->fresh_ns = now_ns;
  }
  double unwritten = 1e-9 * (double)(now_ns - carrier->fresh_ns);
  bool none = atomic_load(&relay->zeroed) || unwritten > HAPI_SAFETY_UNWRITTEN_S ||
              atomic_load(&relay->cause) != HAPI_RELAY_WELL || hapi_relay_is_leaving();
  bool rested = atomic_load(&relay->resting);
  memset(out, 0, sizeof *out);
  if (!none) {
    *out = relay->commands[hapi_triple_front(&relay->command_places)];
    atomic_store(&relay->resting, rested && hapi_relay_is_zero(out));
  }
  /* Once more: who raised a flag in between, and saw it resting, does not wait for a zero. */
  if (!none && (atomic_load(&relay->zeroed) || hapi_relay_is_leaving())) {
    memset(out, 0, sizeof *out);
    atomic_store(&relay->resting, rested);
  }
}

bool hapi_relay_sent(hapi_relay *relay, const hap_wrench *sent)
{
  bool zero = hapi_relay_is_zero(sent);
  relay->carrier.sent = *sent;
  if (zero) {
    atomic_store(&relay->resting, true);
  }
  return !zero && (atomic_load(&relay->zeroed) || hapi_relay_is_leaving());
}
