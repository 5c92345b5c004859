/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The device forcedimension: omega, delta, sigma and lambda, by the maker's library. Each of its
 * calls may wait for USB, so a thread of the device makes them, and the tick exchanges newest
 * values with it. Frame, metres and newtons are the library's own: x towards the operator, y to the
 * operator's right, z up. */

#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/log.h"
#include "base/safety.h"
#include "base/thread.h"
#include "plugins/common/claims.h"
#include "plugins/common/relay_carrier.h"
#include "plugins/common/rotation.h"
#include "plugins/forcedimension/libdhd.h"

#define PRIORITY 82       /* above loop and watchdog, which it must not wait for */
#define CYCLE_NS 250000LL /* the shortest; USB gives up to 4 kHz */
#define FIRST_WAIT_S 1.0  /* for a first position */
#define FAILURES_MOST 3   /* in a row: the device is lost */
#define REFUSED_NS 500000000LL
#define RATE_NS 500000000LL
#define ZERO_TRIES 5
#define NAME_MAX 48
#define PATH_ROOM 256

typedef enum dhd_cause {
  DHD_LOST = HAPI_RELAY_OWN, /* calls fail */
  DHD_REFUSED,               /* positions come, forces do not go out */
  DHD_NOT_OPENED,
  DHD_NO_POWER,
  DHD_NOT_RESET,
  DHD_NO_FORCE, /* dhdEnableForce fails */
  DHD_NO_POSITION,
  DHD_NO_THREAD,
  DHD_STUCK /* a call of the thread before has not come back */
} dhd_cause;

typedef struct dhd_device {
  void *library;
  hapi_dhd dhd;
  char name[NAME_MAX];
  char id;   /* of the opened device */
  bool open; /* it is */
  hapi_relay relay;

  /* The carrier. */
  hapi_thread thread;
  atomic_bool ending;
  int failures;               /* of positions, in a row */
  int refusals;               /* of forces, in a row */
  int64_t refused_ns;         /* the last of them */
  int64_t rated_ns;           /* when the rate was asked for */
  _Atomic int rate_hz;        /* of the library's exchange with the hardware; 0: not known */
  _Atomic(const char *) said; /* by the library, of the last failure; "" */
} dhd_device;

/* Of the maker's data sheets: what it gives for long, the whole name's begin decides. */
typedef struct dhd_family {
  const char *begin;
  double max_force;  /* N */
  double max_torque; /* N m, where the wrist is active */
} dhd_family;

static const dhd_family families[] = {
    {"omega", 12.0, 0.0},  {"delta", 20.0, 0.0}, {"sigma", 20.0, 0.4},
    {"lambda", 20.0, 0.2}, {"", 5.0, 0.0}, /* not known: little */
};

/* ---- the carrier ---- */

static void note_failure(dhd_device *device)
{
  const char *said = device->dhd.get_last_error();
  atomic_store(&device->said, said != NULL ? said : "");
}

/* NaN goes on as it is: the relay refuses it. */
static bool pose_read(dhd_device *device)
{
  hapi_relay_sample sample = {.buttons = 0};
  double frame[3][3] = {{0.0}};
  double *p = sample.pose.position;
  double *v = sample.velocity;
  int got = device->dhd.get_pose(&p[0], &p[1], &p[2], frame, device->id);
  if (got == HAPI_DHD_OLD) {
    return true;
  }
  if (got < 0 || device->dhd.get_velocity(&v[0], &v[1], &v[2], device->id) < 0) {
    note_failure(device);
    return false;
  }
  sample.stamp_ns = hapi_clock_now(); /* the calls may have waited */
  sample.buttons = device->dhd.get_buttons(device->id);
  sample.pose.quat_wxyz[0] = 1.0;
  if (device->relay.settings.turns) {
    double rows[9];
    memcpy(rows, frame, sizeof rows);
    (void)hapi_rotation_to_quat(rows, sample.pose.quat_wxyz);
  }
  (void)hapi_relay_publish(&device->relay, &sample);
  return true;
}

static bool force_send(dhd_device *device, const hap_wrench *w)
{
  int got = device->dhd.set_force(w->force[0], w->force[1], w->force[2], w->torque[0], w->torque[1],
                                  w->torque[2], 0.0, device->id);
  if (got < 0) {
    note_failure(device);
  }
  return got >= 0;
}

static bool zero_send(dhd_device *device)
{
  const hap_wrench none = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  bool sent = false;
  for (int i = 0; i < ZERO_TRIES && !sent; ++i) {
    sent = force_send(device, &none);
  }
  if (sent) {
    (void)hapi_relay_sent(&device->relay, &none);
  }
  return sent;
}

static void force_exchange(dhd_device *device, int64_t now_ns)
{
  hap_wrench wanted;
  hapi_relay_wanted(&device->relay, now_ns, &wanted);
  bool sent = force_send(device, &wanted);
  device->refusals = sent ? 0 : device->refusals + 1;
  if (!sent) {
    device->refused_ns = now_ns;
  }
  if (sent && hapi_relay_sent(&device->relay, &wanted)) {
    (void)zero_send(device);
  }
}

/* Now and then: for the text of a fault. */
static void rate_read(dhd_device *device, int64_t now_ns)
{
  if (device->dhd.get_rate != NULL && now_ns - device->rated_ns > RATE_NS) {
    double khz = device->dhd.get_rate(device->id);
    atomic_store(&device->rate_hz, khz > 0.0 && khz < 1e3 ? (int)(1e3 * khz) : 0);
    device->rated_ns = now_ns;
  }
}

/* False: the device is lost, and waits for a restart. */
static bool cycle_run(dhd_device *device, int64_t now_ns)
{
  device->failures = pose_read(device) ? 0 : device->failures + 1;
  if (device->failures >= FAILURES_MOST) {
    hapi_relay_set_cause(&device->relay, DHD_LOST);
    return false;
  }
  force_exchange(device, now_ns);
  rate_read(device, now_ns);
  if (device->refusals >= FAILURES_MOST) {
    hapi_relay_set_cause(&device->relay, DHD_REFUSED);
  } else if (hapi_relay_cause_now(&device->relay) == DHD_REFUSED &&
             now_ns - device->refused_ns > REFUSED_NS) {
    hapi_relay_set_cause(&device->relay, HAPI_RELAY_WELL);
  }
  return true;
}

static void *carrier_main(void *arg)
{
  dhd_device *device = arg;
  hapi_thread_prepare_for_ticks();
  bool good = true;
  while (good && !atomic_load(&device->ending)) {
    int64_t now_ns = hapi_clock_now();
    good = cycle_run(device, now_ns);
    hapi_clock_sleep_until(now_ns + CYCLE_NS);
  }
  (void)zero_send(device);
  (void)device->dhd.enable_force(0, device->id);
  hapi_thread_end(&device->thread);
  return NULL;
}

/* ---- open and close ---- */

enum argument {
  ID,
  LIBRARY,
  RELAY,
  ARGUMENT_COUNT = RELAY + HAPI_RELAY_ARGUMENTS
};

static hap_status dhd_refuse(dhd_device *device, int id, hap_detail *detail)
{
  const char *said = device->dhd.get_last_error();
  int count = device->dhd.get_count != NULL ? device->dhd.get_count() : -1;
  char which[24] = "a device";
  if (id >= 0) {
    snprintf(which, sizeof which, "device %d", id);
  }
  if (count == 0) {
    return hapi_fail(detail, HAP_ERROR_DEVICE,
                     "forcedimension: no device on USB: is it plugged in and switched on? May you "
                     "write it (lsusb -d 1451: shows it; install 60-hapode-forcedimension.rules in "
                     "/etc/udev/rules.d, plug it in again)? The library says: %.100s",
                     said != NULL ? said : "nothing");
  }
  return hapi_fail(detail, HAP_ERROR_DEVICE,
                   "forcedimension: %s does not open: %.150s; is another program using it (the "
                   "maker's HapticDesk, for one), and may you write to it (udev rule)?",
                   which, said != NULL ? said : "no reason given");
}

static hap_status claim_opened(dhd_device *device, hap_detail *detail)
{
  char key[32];
  snprintf(key, sizeof key, "forcedimension:%d", device->id);
  if (!hapi_claim(device, key)) {
    return hapi_fail(detail, HAP_ERROR_DEVICE,
                     "forcedimension: this program uses device %d already; for another one say "
                     "id=",
                     device->id);
  }
  device->open = true;
  return HAP_OK;
}

static bool dhd_reopen(dhd_device *device)
{
  if (device->open) {
    (void)device->dhd.close(device->id);
  }
  device->open = device->dhd.open_id(device->id) >= 0;
  if (!device->open) {
    note_failure(device);
  }
  return device->open;
}

static void figures_read(dhd_device *device, hapi_relay_settings *out)
{
  const dhd_family *family = families;
  const char *name = device->dhd.get_name != NULL ? device->dhd.get_name(device->id) : NULL;
  snprintf(device->name, sizeof device->name, "%.40s",
           name != NULL && *name != '\0' ? name : "Force Dimension");
  while (strncasecmp(device->name, family->begin, strlen(family->begin)) != 0) {
    ++family;
  }
  double limit = device->dhd.get_max_force != NULL ? device->dhd.get_max_force(device->id) : -1.0;
  bool active = device->dhd.has_active_wrist != NULL && device->dhd.has_active_wrist(device->id);
  out->max_force = limit > 0.0 && limit < family->max_force ? limit : family->max_force;
  out->max_torque = active ? family->max_torque : 0.0;
  out->turns = device->dhd.has_wrist(device->id);
}

static hap_status dhd_find(dhd_device *device, const hapi_argument_table *table, hap_detail *detail)
{
  const hapi_argument *entries = table->entries;
  char path[PATH_ROOM];
  hapi_relay_settings settings;
  memset(&settings, 0, sizeof settings);
  int id = entries[ID].given ? (int)entries[ID].number[0] : -1;
  if (entries[ID].given && (double)id != entries[ID].number[0]) {
    return hapi_arguments_fail(table, &entries[ID], detail);
  }
  if (entries[LIBRARY].length >= sizeof path) {
    return hapi_arguments_fail(table, &entries[LIBRARY], detail);
  }
  snprintf(path, sizeof path, "%.*s", (int)entries[LIBRARY].length,
           entries[LIBRARY].given ? entries[LIBRARY].text : "");
  HAPI_TRY(hapi_dhd_load(path, &device->library, &device->dhd, detail));
  int opened = id >= 0 ? device->dhd.open_id((char)id) : device->dhd.open();
  if (opened < 0) {
    return dhd_refuse(device, id, detail);
  }
  device->id = (char)(id >= 0 ? id : opened);
  HAPI_TRY(claim_opened(device, detail));
  figures_read(device, &settings);
  HAPI_TRY(hapi_relay_take_arguments(table, entries + RELAY, &settings, detail));
  hapi_relay_init(&device->relay, &settings);
  return HAP_OK;
}

static void dhd_free(dhd_device *device)
{
  if (device->open) {
    (void)device->dhd.close(device->id);
  }
  hapi_unclaim(device);
  hapi_vendor_unload(device->library);
  hapi_free(device);
}

static hap_status dhd_open(void *context, const char *args, void **self, hap_detail *detail)
{
  hapi_argument entries[ARGUMENT_COUNT] = {
      [ID] = {"id", HAPI_ARGUMENT_NUMBER, false, 0.0, 15.0, "a whole number from 0 to 15"},
      [LIBRARY] = {"library", HAPI_ARGUMENT_TEXT,
                   .expected = "the whole path of libdhd.so, at most 255 bytes"},
  };
  const hapi_argument_table table = {"forcedimension", entries, ARGUMENT_COUNT};
  (void)context;
  hapi_relay_arguments(entries + RELAY);
  HAPI_TRY(hapi_arguments_read(&table, args, detail));
  dhd_device *device = hapi_alloc(sizeof *device);
  if (device == NULL) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "forcedimension: out of memory");
  }
  atomic_init(&device->said, "");
  hap_status status = dhd_find(device, &table, detail);
  if (status < HAP_OK) {
    dhd_free(device);
    return status;
  }
  *self = device;
  return HAP_OK;
}

static void dhd_describe(void *self, uint32_t effector, hap_device_info *out)
{
  const dhd_device *device = self;
  (void)effector;
  snprintf(out->name, sizeof out->name, "%s", device->name);
  out->dof = device->relay.settings.turns ? 6 : 3;
  out->max_force = device->relay.settings.max_force;
  out->max_torque = device->relay.settings.max_torque;
  out->measures_velocity = 1;
  out->button_count = 8;
}

/* ---- start and stop ---- */

/* False: a call of the library has not come back, and all that it uses must stay. */
static bool carrier_end(dhd_device *device)
{
  hapi_relay_zero(&device->relay);
  atomic_store(&device->ending, true);
  bool ended = hapi_thread_join_within(&device->thread, HAPI_SAFETY_STOP_WAIT_S);
  hapi_relay_stop(&device->relay);
  return ended;
}

static bool first_awaited(dhd_device *device)
{
  int64_t end = hapi_clock_now() + (int64_t)(1e9 * FIRST_WAIT_S);
  while (!hapi_triple_is_fresh(&device->relay.sample_places)) {
    if (hapi_clock_now() >= end || hapi_relay_cause_now(&device->relay) == DHD_LOST) {
      return false;
    }
    hapi_clock_sleep_until(hapi_clock_now() + CYCLE_NS);
  }
  return true;
}

static int what_is_missing(dhd_device *device)
{
  int status[HAPI_DHD_STATUS_MAX] = {0};
  if (device->dhd.get_status != NULL && device->dhd.get_status(status, device->id) >= 0) {
    if (status[HAPI_DHD_POWER] == 0) {
      return DHD_NO_POWER;
    }
    if (status[HAPI_DHD_RESET] == 0) {
      return DHD_NOT_RESET;
    }
  }
  if (device->dhd.enable_force(1, device->id) < 0) {
    note_failure(device);
    return DHD_NO_FORCE;
  }
  return HAPI_RELAY_WELL;
}

static hap_status start_fail(dhd_device *device, int cause)
{
  hapi_relay_set_cause(&device->relay, cause);
  return HAP_ERROR_DEVICE;
}

static hap_status dhd_start(void *self)
{
  dhd_device *device = self;
  bool lost = hapi_relay_cause_now(&device->relay) != HAPI_RELAY_WELL;
  if (!carrier_end(device)) {
    return start_fail(device, DHD_STUCK);
  }
  if ((lost || !device->open) && !dhd_reopen(device)) {
    return start_fail(device, DHD_NOT_OPENED);
  }
  int missing = what_is_missing(device);
  if (missing != HAPI_RELAY_WELL) {
    return start_fail(device, missing);
  }
  if (!hapi_relay_start(&device->relay)) {
    return start_fail(device, DHD_NO_THREAD);
  }
  hapi_relay_zero(&device->relay);
  device->failures = device->refusals = 0;
  atomic_store(&device->ending, false);
  if (hapi_thread_start(&device->thread, carrier_main, device, "hapode-dhd", PRIORITY) < HAP_OK) {
    hapi_relay_stop(&device->relay);
    return start_fail(device, DHD_NO_THREAD);
  }
  if (!first_awaited(device)) {
    bool told = hapi_relay_cause_now(&device->relay) == DHD_LOST;
    (void)carrier_end(device);
    return start_fail(device, told ? DHD_LOST : DHD_NO_POSITION);
  }
  return HAP_OK;
}

static void dhd_stop(void *self)
{
  dhd_device *device = self;
  if (!carrier_end(device)) {
    hapi_log(HAP_LOG_ERROR, "forcedimension: a call of libdhd does not come back: switch %s off",
             device->name);
  } else if (!hapi_relay_is_resting(&device->relay)) {
    hapi_log(HAP_LOG_ERROR, "forcedimension: %s did not take zero force: switch it off",
             device->name);
  }
}

/* A carrier that hangs in the library keeps what it uses. */
static void dhd_close(void *self)
{
  dhd_device *device = self;
  if (carrier_end(device)) {
    dhd_free(device);
  }
}

/* ---- every tick ---- */

static hap_status dhd_read(void *self, int64_t time_ns, hap_device_input *const out[])
{
  dhd_device *device = self;
  return hapi_relay_read(&device->relay, time_ns, out[0]);
}

static hap_status dhd_write(void *self, const hap_device_output *const wanted[],
                            hap_device_output *const reached[])
{
  dhd_device *device = self;
  return hapi_relay_write(&device->relay, &wanted[0]->wrench, &reached[0]->wrench);
}

static void dhd_zero(void *self)
{
  dhd_device *device = self;
  hapi_relay_zero(&device->relay);
}

static void dhd_held(void *self, hap_device_output *const out[])
{
  const dhd_device *device = self;
  hapi_relay_held(&device->relay, &out[0]->wrench);
}

static const char *cause_text(int cause)
{
  switch (cause) {
    case HAPI_RELAY_SILENT:
      return "no new position for too long: a busy machine, or USB; restart when it goes on";
    case HAPI_RELAY_NOT_FINITE:
      return "positions are not finite, or orientations no rotation: calibrate the device";
    case DHD_LOST:
      return "the device is lost: look at cable and power, then restart";
    case DHD_REFUSED:
      return "the device refuses forces: press its force button, look at its lamp, then reset";
    case DHD_NOT_OPENED:
      return "the device does not open again: look at cable and power";
    case DHD_NO_POWER:
      return "the device has no power: switch it on";
    case DHD_NOT_RESET:
      return "the device is not calibrated: move the grip to the centre and press its button, or "
             "run the maker's HapticInit";
    case DHD_NO_FORCE:
      return "the forces cannot be enabled";
    case DHD_NO_POSITION:
      return "no position came within a second: is the device calibrated?";
    case DHD_NO_THREAD:
      return "no thread, or more than 64 devices";
    case DHD_STUCK:
      return "a call of libdhd does not come back: switch the device off and on";
    default:
      return NULL;
  }
}

static void dhd_explain(void *self, hap_detail *out)
{
  const dhd_device *device = self;
  int cause = hapi_relay_cause_last(&device->relay);
  const char *text = cause_text(cause);
  const char *said = atomic_load(&device->said);
  int rate_hz = atomic_load(&device->rate_hz);
  char rate[48] = "";
  if (rate_hz > 0) {
    snprintf(rate, sizeof rate, "; its exchange had %d Hz", rate_hz);
  }
  if (text != NULL) {
    snprintf(out->text, sizeof out->text, "%s: %s%s%s%.150s%s", device->name, text, rate,
             *said != '\0' ? " (libdhd: " : "", said, *said != '\0' ? ")" : "");
  }
}

/* ---- the table ---- */

extern const hap_device_ops hapi_forcedimension_ops;

const hap_device_ops hapi_forcedimension_ops = {
    .abi = HAP_DEVICE_ABI,
    .size = sizeof(hap_device_ops),
    .name = "forcedimension",
    .help =
        "omega, delta, sigma or lambda, by libdhd: [id=N][,library=PATH][,max_force=N]"
        "[,max_torque=NM][,turn=0|1][,stale=S][,timeout=S]; never tried on hardware; "
        "docs/vendor-devices.md",
    .pacing = HAP_PACING_HOST,
    .open = dhd_open,
    .describe = dhd_describe,
    .start = dhd_start,
    .read = dhd_read,
    .write = dhd_write,
    .zero = dhd_zero,
    .stop = dhd_stop,
    .close = dhd_close,
    .held = dhd_held,
    .explain = dhd_explain,
};
