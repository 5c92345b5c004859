/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The device openhaptics: 3D Systems Touch and Touch X, Geomagic, Phantom, by the maker's library.
 * Its scheduler is a thread of its own with 1 kHz, which calls scheduler_tick. The tick of a
 * session exchanges newest values with it. Frame of the library: x to the right, y up, z towards
 * the user. Its millimetres become metres here. */

#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/log.h"
#include "base/vec.h"
#include "plugins/common/claims.h"
#include "plugins/common/relay_carrier.h"
#include "plugins/common/rotation.h"
#include "plugins/openhaptics/libhd.h"

#define MM 1e-3
#define FIRST_WAIT_S 1.0
#define REST_WAIT_S 0.1 /* for the last zero, and for the last callback */
#define LOOK_NS 500000LL
#define COMPLAINT_NS 1000000000LL /* a complaint of the library counts for so long */
#define ERRORS_MOST 8             /* that are taken off the library's list in a tick */
#define FAILURES_MOST 3           /* ticks in a row with an error that is no complaint */
#define NAME_ROOM 64
#define PATH_ROOM 256
#define MOTORS 6
#define FORCE_UNKNOWN 0.5 /* N, where the library does not say */

typedef enum hd_cause {
  HD_LOST = HAPI_RELAY_OWN,
  HD_WARM,
  HD_REFUSED,
  HD_NOT_OPENED,
  HD_NOT_CALIBRATED,
  HD_NO_POSITION,
  HD_NO_SCHEDULER,
  HD_STUCK
} hd_cause;

typedef struct hd_figures {
  char name[NAME_ROOM]; /* of the model */
  double stiffness;     /* N/m */
  double low[3];        /* m */
  double high[3];
} hd_figures;

typedef struct hd_device {
  void *library;
  hapi_hd hd;
  char asked[NAME_ROOM]; /* name in the maker's set-up; "": its default */
  unsigned int handle;
  bool open;
  bool scheduled;
  unsigned long callback;
  hd_figures figures;
  hapi_relay relay;

  /* The scheduler's thread. */
  atomic_bool ending;
  atomic_bool ended;
  atomic_bool
      inside; /* of a callback: the library's scheduler waits for its end, and so would we */
  int failures;
  int complaint; /* hd_cause; 0: none */
  int64_t complaint_ns;
  _Atomic unsigned int error; /* the last */
  _Atomic int temperature;    /* of the warmest motor, in hundredths; < 0: not known */
} hd_device;

/* ---- the scheduler's thread ---- */

static void wrench_set(hd_device *device, const hap_wrench *w)
{
  device->hd.set_doubles(HAPI_HD_FORCE, w->force);
  if (device->relay.settings.max_torque > 0.0) {
    const double torque[3] = {w->torque[0] / MM, w->torque[1] / MM, w->torque[2] / MM};
    device->hd.set_doubles(HAPI_HD_TORQUE, torque);
  }
}

static void sample_get(hd_device *device, hapi_relay_sample *out)
{
  double m[16] = {0.0};
  int buttons = 0;
  device->hd.get_doubles(HAPI_HD_POSITION, out->pose.position);
  device->hd.get_doubles(HAPI_HD_VELOCITY, out->velocity);
  device->hd.get_doubles(HAPI_HD_TRANSFORM, m);
  device->hd.get_integers(HAPI_HD_BUTTONS, &buttons);
  hapi_v3_scale(MM, out->pose.position, out->pose.position);
  hapi_v3_scale(MM, out->velocity, out->velocity);
  out->buttons = (uint32_t)buttons;
  out->pose.quat_wxyz[0] = 1.0;
  if (device->relay.settings.turns) {
    const double rows[9] = {m[0], m[4], m[8], m[1], m[5], m[9], m[2], m[6], m[10]};
    (void)hapi_rotation_to_quat(rows, out->pose.quat_wxyz);
  }
}

static void temperature_read(hd_device *device)
{
  double motors[MOTORS] = {0.0};
  double most = 0.0;
  device->hd.get_doubles(HAPI_HD_TEMPERATURE, motors);
  for (int i = 0; i < MOTORS; ++i) {
    most = hapi_max(motors[i], most);
  }
  atomic_store(&device->temperature, (int)(100.0 * hapi_min(most, 10.0)));
}

/* What it complains of counts for a while, as the library says it once. */
static void note_error(hd_device *device, unsigned int code, int64_t now_ns, bool *out_failed)
{
  atomic_store(&device->error, code);
  if (code >= HAPI_HD_WARM && code <= HAPI_HD_FORCE_ERROR) {
    device->complaint = code == HAPI_HD_WARM ? HD_WARM : HD_REFUSED;
    device->complaint_ns = now_ns;
    if (code == HAPI_HD_WARM) {
      temperature_read(device);
    }
  } else {
    *out_failed = true;
  }
}

/* True: this tick's sample is good. */
static bool errors_take(hd_device *device, int64_t now_ns)
{
  bool failed = false;
  unsigned int code = device->hd.get_error().code;
  for (int i = 0; i < ERRORS_MOST && code != HAPI_HD_SUCCESS; ++i) {
    note_error(device, code, now_ns, &failed);
    code = device->hd.get_error().code;
  }
  device->failures = failed ? device->failures + 1 : 0;
  if (device->failures >= FAILURES_MOST) {
    hapi_relay_set_cause(&device->relay, HD_LOST);
  } else if (hapi_relay_cause_now(&device->relay) != HD_LOST) {
    if (device->complaint != 0 && now_ns - device->complaint_ns > COMPLAINT_NS) {
      device->complaint = 0;
    }
    hapi_relay_set_cause(&device->relay, device->complaint);
  }
  return !failed;
}

static void frame_run(hd_device *device)
{
  hapi_relay_sample sample;
  hap_wrench wanted;
  memset(&sample, 0, sizeof sample);
  device->hd.begin_frame(device->handle);
  int64_t now_ns = hapi_clock_now();
  sample.stamp_ns = now_ns;
  sample_get(device, &sample);
  hapi_relay_wanted(&device->relay, now_ns, &wanted);
  wrench_set(device, &wanted);
  device->hd.end_frame(device->handle);
  if (hapi_relay_sent(&device->relay, &wanted)) {
    const hap_wrench none = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    device->hd.begin_frame(device->handle);
    wrench_set(device, &none);
    device->hd.end_frame(device->handle);
    (void)hapi_relay_sent(&device->relay, &none);
  }
  if (errors_take(device, now_ns)) {
    (void)hapi_relay_publish(&device->relay, &sample);
  }
}

static unsigned int scheduler_tick(void *user)
{
  hd_device *device = user;
  if (atomic_load(&device->ended)) {
    return HAPI_HD_DONE;
  }
  atomic_store(&device->inside, true);
  /* Read before the zero goes out: whoever sees the end knows that a zero was the last. */
  bool ending = atomic_load(&device->ending);
  frame_run(device);
  if (ending) {
    atomic_store(&device->ended, true);
  }
  atomic_store(&device->inside, false);
  return ending ? HAPI_HD_DONE : HAPI_HD_CONTINUE;
}

/* ---- open and close ---- */

enum argument {
  NAME,
  LIBRARY,
  RELAY,
  ARGUMENT_COUNT = RELAY + HAPI_RELAY_ARGUMENTS
};

static unsigned int errors_drop(const hd_device *device)
{
  unsigned int first = HAPI_HD_SUCCESS;
  for (int i = 0; i < ERRORS_MOST; ++i) {
    unsigned int code = device->hd.get_error().code;
    first = first == HAPI_HD_SUCCESS ? code : first;
  }
  return first;
}

/* Drivers differ in the name that means their default. */
static bool hd_init(hd_device *device)
{
  const char *const tries[] = {device->asked[0] != '\0' ? device->asked : NULL, "Default Device"};
  int count = device->asked[0] != '\0' ? 1 : 2;
  device->open = false;
  for (int i = 0; i < count && !device->open; ++i) {
    (void)errors_drop(device);
    device->handle = device->hd.init_device(tries[i]);
    atomic_store(&device->error, errors_drop(device));
    device->open = device->handle != HAPI_HD_INVALID &&
                   atomic_load(&device->error) != HAPI_HD_IN_USE &&
                   atomic_load(&device->error) != HAPI_HD_NO_ANSWER &&
                   atomic_load(&device->error) != HAPI_HD_FAULT;
  }
  return device->open;
}

static double figure_get(const hd_device *device, unsigned int what)
{
  double values[16] = {0.0};
  device->hd.get_doubles(what, values);
  bool good = errors_drop(device) == HAPI_HD_SUCCESS && hapi_finite(values, 1);
  return good && values[0] > 0.0 && values[0] < 1e6 ? values[0] : 0.0;
}

static int dof_get(const hd_device *device, unsigned int what)
{
  int dof[4] = {0};
  device->hd.get_integers(what, dof);
  return errors_drop(device) == HAPI_HD_SUCCESS ? dof[0] : 3;
}

static void workspace_get(hd_device *device)
{
  double box[16] = {0.0};
  bool good = true;
  device->hd.get_doubles(HAPI_HD_WORKSPACE, box);
  good = errors_drop(device) == HAPI_HD_SUCCESS && hapi_finite(box, 6);
  for (int i = 0; i < 3; ++i) {
    good = good && box[i] < box[3 + i] && fabs(box[i]) < 1e4 && fabs(box[3 + i]) < 1e4;
  }
  for (int i = 0; i < 3 && good; ++i) {
    device->figures.low[i] = MM * box[i];
    device->figures.high[i] = MM * box[3 + i];
  }
}

static void figures_read(hd_device *device, hapi_relay_settings *out)
{
  device->hd.make_current(device->handle);
  (void)errors_drop(device);
  const char *name = device->hd.get_string(HAPI_HD_MODEL);
  snprintf(device->figures.name, sizeof device->figures.name, "%.60s",
           name != NULL && *name != '\0' ? name : "OpenHaptics");
  (void)errors_drop(device);
  device->figures.stiffness = figure_get(device, HAPI_HD_MAX_STIFFNESS) / MM;
  workspace_get(device);
  double lasting = figure_get(device, HAPI_HD_MAX_CONTINUOUS_FORCE);
  double moment = figure_get(device, HAPI_HD_MAX_FORCE);
  out->max_force = lasting > 0.0 ? lasting : moment > 0.0 ? moment : FORCE_UNKNOWN;
  out->turns = dof_get(device, HAPI_HD_INPUT_DOF) >= 6;
}

static hap_status hd_refuse(const hd_device *device, hap_detail *detail)
{
  unsigned int code = atomic_load(&device->error);
  const char *what =
      code == HAPI_HD_IN_USE
          ? "it is in use already: end the other program, or give another name="
          : "is it plugged in and switched on? Run the maker's Touch_Setup and pair it, and see "
            "that you may write its port (/dev/ttyACM0, group dialout: sudo usermod -aG dialout "
            "$USER; or the maker's udev rule)";
  return hapi_fail(detail, HAP_ERROR_DEVICE,
                   "openhaptics: device '%.60s' does not open (error 0x%x of libHD): %s",
                   device->asked[0] != '\0' ? device->asked : "Default Device", code, what);
}

static hap_status hd_find(hd_device *device, const hapi_argument_table *table, hap_detail *detail)
{
  const hapi_argument *entries = table->entries;
  char path[PATH_ROOM];
  char key[NAME_ROOM + 16];
  hapi_relay_settings settings;
  memset(&settings, 0, sizeof settings);
  if (entries[LIBRARY].length >= sizeof path || entries[NAME].length >= sizeof device->asked) {
    bool library = entries[LIBRARY].length >= sizeof path;
    return hapi_arguments_fail(table, &entries[library ? LIBRARY : NAME], detail);
  }
  snprintf(path, sizeof path, "%.*s", (int)entries[LIBRARY].length,
           entries[LIBRARY].given ? entries[LIBRARY].text : "");
  snprintf(device->asked, sizeof device->asked, "%.*s", (int)entries[NAME].length,
           entries[NAME].given ? entries[NAME].text : "");
  snprintf(key, sizeof key, "openhaptics:%s",
           device->asked[0] != '\0' ? device->asked : "Default Device");
  if (!hapi_claim(device, key)) {
    return hapi_fail(detail, HAP_ERROR_DEVICE,
                     "openhaptics: this program uses '%.60s' already; for another one say name=",
                     key + strlen("openhaptics:"));
  }
  HAPI_TRY(hapi_hd_load(path, &device->library, &device->hd, detail));
  if (!hd_init(device)) {
    return hd_refuse(device, detail);
  }
  figures_read(device, &settings);
  HAPI_TRY(hapi_relay_take_arguments(table, entries + RELAY, &settings, detail));
  hapi_relay_init(&device->relay, &settings);
  return HAP_OK;
}

static void hd_free(hd_device *device)
{
  if (device->open) {
    device->hd.disable_device(device->handle);
  }
  hapi_unclaim(device);
  hapi_vendor_unload(device->library);
  hapi_free(device);
}

static hap_status hd_open(void *context, const char *args, void **self, hap_detail *detail)
{
  hapi_argument entries[ARGUMENT_COUNT] = {
      [NAME] = {"name", HAPI_ARGUMENT_TEXT,
                .expected = "the name of a device in Touch_Setup, at most 63 bytes"},
      [LIBRARY] = {"library", HAPI_ARGUMENT_TEXT,
                   .expected = "the whole path of libHD.so, at most 255 bytes"},
  };
  const hapi_argument_table table = {"openhaptics", entries, ARGUMENT_COUNT};
  (void)context;
  hapi_relay_arguments(entries + RELAY);
  HAPI_TRY(hapi_arguments_read(&table, args, detail));
  hd_device *device = hapi_alloc(sizeof *device);
  if (device == NULL) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "openhaptics: out of memory");
  }
  atomic_init(&device->temperature, -1);
  hap_status status = hd_find(device, &table, detail);
  if (status < HAP_OK) {
    hd_free(device);
    return status;
  }
  *self = device;
  return HAP_OK;
}

static void hd_describe(void *self, uint32_t effector, hap_device_info *out)
{
  const hd_device *device = self;
  (void)effector;
  snprintf(out->name, sizeof out->name, "%s", device->figures.name);
  out->dof = device->relay.settings.turns ? 6 : 3;
  out->max_force = device->relay.settings.max_force;
  out->max_torque = device->relay.settings.max_torque;
  out->rated_stiffness = device->figures.stiffness;
  out->measures_velocity = 1;
  out->button_count = 4;
  hapi_v3_copy(device->figures.low, out->workspace_low);
  hapi_v3_copy(device->figures.high, out->workspace_high);
}

/* ---- start and stop ---- */

static void zero_from_here(hd_device *device)
{
  const hap_wrench none = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  (void)errors_drop(device);
  device->hd.begin_frame(device->handle);
  wrench_set(device, &none);
  device->hd.end_frame(device->handle);
  if (errors_drop(device) == HAPI_HD_SUCCESS) {
    (void)hapi_relay_sent(&device->relay, &none);
  }
}

/* The scheduler's last word is a zero; where that does not come, the zero goes out from here.
 * False: the scheduler is stuck in a call of the library, which would not let us in either. */
static bool hd_rest(hd_device *device)
{
  int64_t end = hapi_clock_now() + (int64_t)(1e9 * REST_WAIT_S);
  hapi_relay_zero(&device->relay);
  hapi_relay_stop(&device->relay);
  if (!device->scheduled) {
    return true;
  }
  atomic_store(&device->ending, true);
  while (!atomic_load(&device->ended) && hapi_clock_now() < end) {
    hapi_clock_sleep_until(hapi_clock_now() + LOOK_NS);
  }
  if (!atomic_load(&device->ended) && atomic_load(&device->inside)) {
    return false;
  }
  bool said_zero = atomic_exchange(&device->ended, true);
  device->hd.unschedule(device->callback);
  hapi_hd_scheduler_end(&device->hd);
  device->scheduled = false;
  if (!said_zero) {
    zero_from_here(device);
  }
  device->hd.make_current(device->handle);
  device->hd.disable(HAPI_HD_FORCE_OUTPUT);
  (void)errors_drop(device);
  return true;
}

static hap_status start_fail(hd_device *device, int cause)
{
  hapi_relay_set_cause(&device->relay, cause);
  return HAP_ERROR_DEVICE;
}

static bool first_awaited(const hd_device *device)
{
  int64_t end = hapi_clock_now() + (int64_t)(1e9 * FIRST_WAIT_S);
  while (!hapi_triple_is_fresh(&device->relay.sample_places)) {
    if (hapi_clock_now() >= end || hapi_relay_cause_now(&device->relay) == HD_LOST) {
      return false;
    }
    hapi_clock_sleep_until(hapi_clock_now() + LOOK_NS);
  }
  return true;
}

static void callback_begin(hd_device *device)
{
  device->failures = 0;
  device->complaint = 0;
  atomic_store(&device->ending, false);
  atomic_store(&device->ended, false);
  atomic_store(&device->error, HAPI_HD_SUCCESS);
  device->callback = device->hd.schedule(scheduler_tick, device, HAPI_HD_PRIORITY);
  hapi_hd_scheduler_begin(&device->hd);
  device->scheduled = true;
}

static hap_status hd_start(void *self)
{
  hd_device *device = self;
  bool lost = hapi_relay_cause_now(&device->relay) == HD_LOST;
  if (!hd_rest(device)) {
    return start_fail(device, HD_STUCK);
  }
  if (lost && device->open) {
    device->hd.disable_device(device->handle);
    device->open = false;
  }
  if (!device->open && !hd_init(device)) {
    return start_fail(device, HD_NOT_OPENED);
  }
  device->hd.make_current(device->handle);
  if (device->hd.check_calibration != NULL &&
      device->hd.check_calibration() == HAPI_HD_NEEDS_HANDS) {
    return start_fail(device, HD_NOT_CALIBRATED);
  }
  device->hd.enable(HAPI_HD_FORCE_OUTPUT);
  (void)errors_drop(device);
  if (!hapi_relay_start(&device->relay)) {
    return start_fail(device, HD_NO_SCHEDULER);
  }
  callback_begin(device);
  if (!first_awaited(device)) {
    int cause = hapi_relay_cause_now(&device->relay) == HD_LOST ? HD_LOST : HD_NO_POSITION;
    (void)hd_rest(device);
    return start_fail(device, cause);
  }
  return HAP_OK;
}

static void hd_stop(void *self)
{
  hd_device *device = self;
  if (!hd_rest(device)) {
    hapi_log(HAP_LOG_ERROR, "openhaptics: a call of libHD does not come back: switch %s off",
             device->figures.name);
  } else if (!hapi_relay_is_resting(&device->relay)) {
    hapi_log(HAP_LOG_ERROR, "openhaptics: %s did not take zero force: switch it off",
             device->figures.name);
  }
}

static void hd_close(void *self)
{
  hd_device *device = self;
  if (hd_rest(device)) {
    hd_free(device);
  }
}

/* ---- every tick ---- */

static hap_status hd_read(void *self, int64_t time_ns, hap_device_input *const out[])
{
  hd_device *device = self;
  return hapi_relay_read(&device->relay, time_ns, out[0]);
}

static hap_status hd_write(void *self, const hap_device_output *const wanted[],
                           hap_device_output *const reached[])
{
  hd_device *device = self;
  return hapi_relay_write(&device->relay, &wanted[0]->wrench, &reached[0]->wrench);
}

static void hd_zero(void *self)
{
  hd_device *device = self;
  hapi_relay_zero(&device->relay);
}

static void hd_held(void *self, hap_device_output *const out[])
{
  const hd_device *device = self;
  hapi_relay_held(&device->relay, &out[0]->wrench);
}

static const char *cause_text(int cause)
{
  switch (cause) {
    case HAPI_RELAY_SILENT:
      return "the scheduler of libHD stands still or is late; restart";
    case HAPI_RELAY_NOT_FINITE:
      return "positions are not finite, or orientations no rotation: calibrate with Touch_Setup";
    case HD_LOST:
      return "the device is lost: look at its cable, then restart";
    case HD_WARM:
      return "motors are too warm: let them cool down for some minutes, then reset";
    case HD_REFUSED:
      return "the device refuses the force or a speed: lower max_force=, then reset";
    case HD_NOT_OPENED:
      return "the device does not open again: look at its cable, run Touch_Setup";
    case HD_NOT_CALIBRATED:
      return "the device is not calibrated: put the stylus into the inkwell, or run Touch_Setup";
    case HD_NO_POSITION:
      return "the scheduler of libHD gave no position within a second";
    case HD_NO_SCHEDULER:
      return "more than 64 devices run";
    case HD_STUCK:
      return "a call of libHD does not come back: switch the device off and on";
    default:
      return NULL;
  }
}

static void hd_explain(void *self, hap_detail *out)
{
  const hd_device *device = self;
  int cause = hapi_relay_cause_last(&device->relay);
  const char *text = cause_text(cause);
  unsigned int code = atomic_load(&device->error);
  int temperature = atomic_load(&device->temperature);
  char said[32] = "";
  char warm[48] = "";
  if (code != HAPI_HD_SUCCESS) {
    snprintf(said, sizeof said, " (error 0x%x of libHD)", code);
  }
  if (cause == HD_WARM && temperature >= 0) {
    snprintf(warm, sizeof warm, " (the warmest at %d %%)", temperature);
  }
  if (text != NULL) {
    snprintf(out->text, sizeof out->text, "%s: %s%s%s", device->figures.name, text, warm, said);
  }
}

/* ---- the table ---- */

extern const hap_device_ops hapi_openhaptics_ops;

const hap_device_ops hapi_openhaptics_ops = {
    .abi = HAP_DEVICE_ABI,
    .size = sizeof(hap_device_ops),
    .name = "openhaptics",
    .help =
        "3D Systems Touch, Phantom, by libHD: [name=NAME][,library=PATH][,max_force=N]"
        "[,max_torque=NM][,turn=0|1][,stale=S][,timeout=S]; never tried on hardware; "
        "docs/vendor-devices.md",
    .pacing = HAP_PACING_HOST,
    .open = hd_open,
    .describe = hd_describe,
    .start = hd_start,
    .read = hd_read,
    .write = hd_write,
    .zero = hd_zero,
    .stop = hd_stop,
    .close = hd_close,
    .held = hd_held,
    .explain = hd_explain,
};
