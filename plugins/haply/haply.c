/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The device haply: an Inverse3 by Haply's service, which has the hardware and speaks JSON through
 * a WebSocket. A thread of the device speaks to the service, and the tick exchanges newest values
 * with it. The service answers each force with the state of then, so the exchange has the pace of
 * the service. Frame, metres and newtons are the service's own. */

#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/log.h"
#include "base/safety.h"
#include "base/thread.h"
#include "plugins/common/claims.h"
#include "plugins/common/relay_carrier.h"
#include "plugins/haply/message.h"
#include "plugins/haply/websocket.h"

#define PRIORITY 82 /* above loop and watchdog */
#define PORT 10001
#define CONNECT_S 2.0
#define AGAIN_S 0.1        /* to send a zero through another connection */
#define WAIT_MS 1          /* until it looks after a zero */
#define PAUSE_NS 100000LL  /* of each cycle: a flood must not keep the processor */
#define ASK_NS 100000000LL /* an answer that stays away is asked for once more */
#define MAX_FORCE 4.0      /* N: the service does not say; the arm gives more for a moment */
#define ZERO_WAIT_NS 50000000LL
#define HOST_ROOM 104

typedef enum haply_cause {
  HAPLY_GONE = HAPI_RELAY_OWN, /* the service */
  HAPLY_BROKEN,                /* bytes or messages that are not the protocol's */
  HAPLY_NO_ARM,                /* the service goes on without the arm */
  HAPLY_NO_GRIP,
  HAPLY_GARBAGE, /* a message was no JSON */
  HAPLY_NOT_CONNECTED,
  HAPLY_NO_STATE,
  HAPLY_NO_THREAD,
  HAPLY_STUCK
} haply_cause;

typedef struct haply_device {
  char host[HOST_ROOM];
  unsigned port;
  hapi_haply_wish wish; /* from open on, arm is the name of the one that is there */
  hapi_relay relay;
  hapi_websocket *ws;

  /* The carrier. */
  hapi_thread thread;
  atomic_bool ending;
  bool due;        /* a state has come since the last command */
  bool zero_last;  /* the last command was a zero */
  int64_t sent_ns; /* the last command */
  /* Of open: what came so far. */
  hapi_haply_state first;
  bool first_good;
  int first_count; /* messages */
} haply_device;

static hapi_websocket_place place_of(const haply_device *device)
{
  return (hapi_websocket_place){device->host, device->port, "haply"};
}

/* ---- the carrier ---- */

static void state_publish(haply_device *device, const hapi_haply_state *state)
{
  hapi_relay_sample sample = {.stamp_ns = hapi_clock_now(), .buttons = state->buttons};
  bool turns = device->relay.settings.turns;
  if (!state->has_position || (turns && !state->has_grip)) {
    hapi_relay_set_doubt(&device->relay, state->has_position ? HAPLY_NO_GRIP : HAPLY_NO_ARM);
    return;
  }
  memcpy(sample.pose.position, state->position, sizeof state->position);
  memcpy(sample.velocity, state->velocity, sizeof state->velocity);
  sample.pose.quat_wxyz[0] = 1.0;
  if (turns) {
    memcpy(sample.pose.quat_wxyz, state->quat_wxyz, sizeof state->quat_wxyz);
  }
  (void)hapi_relay_publish(&device->relay, &sample);
}

static void message_take(void *user, const char *text, size_t length)
{
  haply_device *device = user;
  hapi_haply_state state;
  device->due = true;
  if (!hapi_haply_read(text, length, &device->wish, &state)) {
    hapi_relay_set_doubt(&device->relay, HAPLY_GARBAGE);
    return;
  }
  state_publish(device, &state);
}

static bool force_send(haply_device *device, const hap_wrench *wanted, int64_t now_ns)
{
  char text[HAPI_HAPLY_TEXT];
  size_t length = hapi_haply_write_force(device->wish.arm, wanted->force, text);
  if (!hapi_websocket_send(device->ws, text, length)) {
    return false;
  }
  device->due = false;
  device->zero_last = hapi_relay_is_zero(wanted);
  device->sent_ns = now_ns;
  return true;
}

/* One command for each state: a service that stalls must not find a queue of old forces when it
 * goes on. A zero goes out at once. */
static void force_exchange(haply_device *device, int64_t now_ns)
{
  hap_wrench wanted;
  hapi_relay_wanted(&device->relay, now_ns, &wanted);
  memset(wanted.torque, 0, sizeof wanted.torque);
  bool zero = hapi_relay_is_zero(&wanted);
  bool due = device->due || (zero && !device->zero_last) || now_ns - device->sent_ns > ASK_NS;
  if (due && force_send(device, &wanted, now_ns) && hapi_relay_sent(&device->relay, &wanted)) {
    const hap_wrench none = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    if (force_send(device, &none, now_ns)) {
      (void)hapi_relay_sent(&device->relay, &none);
    }
  }
}

/* Until it went out, within a bound. */
static void zero_send(haply_device *device)
{
  const hap_wrench none = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  int64_t end = hapi_clock_now() + ZERO_WAIT_NS;
  bool sent = false;
  while (!sent && hapi_clock_now() < end) {
    sent = force_send(device, &none, hapi_clock_now());
    if (sent) {
      (void)hapi_relay_sent(&device->relay, &none);
    } else {
      hapi_clock_sleep_until(hapi_clock_now() + PAUSE_NS);
    }
  }
}

/* The connection is of no use any more, but the service may be there and hold the last force. */
static void zero_send_anew(haply_device *device)
{
  const hapi_websocket_place place = place_of(device);
  hapi_websocket *before = device->ws;
  hap_detail why;
  if (hapi_websocket_open(&place, AGAIN_S, &device->ws, &why) >= HAP_OK) {
    zero_send(device);
  }
  hapi_websocket_close(before); /* last: it may wait */
}

static hapi_websocket_state cycle_run(haply_device *device)
{
  hapi_websocket_wait(device->ws, WAIT_MS);
  hapi_websocket_state state = hapi_websocket_receive(device->ws, message_take, device);
  if (state == HAPI_WEBSOCKET_OPEN) {
    force_exchange(device, hapi_clock_now());
  }
  return state;
}

static void *carrier_main(void *arg)
{
  haply_device *device = arg;
  hapi_websocket_state state = HAPI_WEBSOCKET_OPEN;
  hapi_thread_prepare_for_ticks();
  while (state == HAPI_WEBSOCKET_OPEN && !atomic_load(&device->ending)) {
    state = cycle_run(device);
    hapi_clock_sleep_until(hapi_clock_now() + PAUSE_NS);
  }
  if (state != HAPI_WEBSOCKET_OPEN) {
    hapi_relay_set_cause(&device->relay, state == HAPI_WEBSOCKET_GONE ? HAPLY_GONE : HAPLY_BROKEN);
    zero_send_anew(device);
  } else {
    zero_send(device);
  }
  hapi_thread_end(&device->thread);
  return NULL;
}

/* ---- open and close ---- */

enum argument {
  HOST,
  PORT_ARGUMENT,
  ID,
  GRIP,
  RELAY,
  ARGUMENT_COUNT = RELAY + HAPI_RELAY_ARGUMENTS
};

static void first_take(void *user, const char *text, size_t length)
{
  haply_device *device = user;
  hapi_haply_state state;
  ++device->first_count;
  if (hapi_haply_read(text, length, &device->wish, &state) && state.has_arms) {
    device->first = state;
    device->first_good = true;
  }
}

/* Of a connection of its own: the service tells what there is before anything was asked. */
static hap_status service_ask(haply_device *device, hap_detail *detail)
{
  const hapi_websocket_place place = place_of(device);
  int64_t end = hapi_clock_now() + (int64_t)(1e9 * CONNECT_S);
  hapi_websocket *ws = NULL;
  hap_detail why = {""};
  hap_status status = hapi_websocket_open(&place, CONNECT_S, &ws, &why);
  if (status == HAP_ERROR_NOT_FOUND || status == HAP_ERROR_FORMAT) {
    return hapi_fail(detail, status,
                     "%.300s; install Haply's Inverse Service (haply.co, with Haply Hub) and start "
                     "it, or say host= and port=",
                     why.text);
  }
  if (status < HAP_OK) {
    return hapi_fail(detail, status, "%s", why.text);
  }
  hapi_websocket_state state = HAPI_WEBSOCKET_OPEN;
  while (!device->first_good && state == HAPI_WEBSOCKET_OPEN && hapi_clock_now() < end) {
    hapi_websocket_wait(ws, 20);
    state = hapi_websocket_receive(ws, first_take, device);
  }
  hapi_websocket_close(ws);
  if (!device->first_good) {
    return hapi_fail(
        detail, HAP_ERROR_FORMAT,
        "haply: the service at %.100s:%u %s: it may be another version; update "
        "Haply's Inverse Service to 3.1 or later",
        device->host, device->port,
        device->first_count > 0 ? "sends messages without a list 'inverse3'" : "sends nothing");
  }
  return HAP_OK;
}

/* "04BA, 04BB" */
static void list_names(const hapi_haply_list *list, char *out, size_t size)
{
  size_t used = 0;
  out[0] = '\0';
  for (int i = 0; i < list->count && i < HAPI_HAPLY_NAMED && used < size; ++i) {
    used += (size_t)snprintf(out + used, size - used, "%s%s", i > 0 ? ", " : "", list->id[i]);
  }
}

static hap_status arm_choose(haply_device *device, hap_detail *detail)
{
  const hapi_haply_list *arms = &device->first.arms;
  char names[HAPI_HAPLY_NAMED * (HAPI_HAPLY_ID + 2)];
  char key[HOST_ROOM + HAPI_HAPLY_ID + 16];
  list_names(arms, names, sizeof names);
  if (arms->count == 0) {
    return hapi_fail(detail, HAP_ERROR_DEVICE,
                     "haply: the service runs, but has no Inverse3: is it plugged in and switched "
                     "on, and does Haply Hub show it?");
  }
  if (device->wish.arm[0] == '\0' && arms->count > 1) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "haply: there are %d Inverse3 (%s): say which by id=", arms->count, names);
  }
  if (!device->first.has_position) {
    return hapi_fail(detail, HAP_ERROR_DEVICE,
                     "haply: there is no Inverse3 '%s' with a position; there is %s",
                     device->wish.arm, names);
  }
  if (device->wish.arm[0] == '\0') {
    memcpy(device->wish.arm, arms->id[0], sizeof device->wish.arm);
  }
  snprintf(key, sizeof key, "haply:%s", device->wish.arm);
  if (!hapi_claim(device, key)) {
    return hapi_fail(
        detail, HAP_ERROR_DEVICE,
        "haply: this program uses Inverse3 %s already; for another one say id=", device->wish.arm);
  }
  return HAP_OK;
}

static hap_status id_take(const hapi_argument_table *table, int which, char out[HAPI_HAPLY_ID],
                          hap_detail *detail)
{
  const hapi_argument *entry = &table->entries[which];
  if (entry->given) {
    snprintf(out, HAPI_HAPLY_ID, "%.*s", (int)entry->length, entry->text);
    if (entry->length + 1 >= HAPI_HAPLY_ID || !hapi_haply_is_id(out)) {
      return hapi_arguments_fail(table, entry, detail);
    }
  }
  return HAP_OK;
}

static hap_status haply_find(haply_device *device, const hapi_argument_table *table,
                             hap_detail *detail)
{
  const hapi_argument *entries = table->entries;
  hapi_relay_settings settings;
  memset(&settings, 0, sizeof settings);
  settings.max_force = MAX_FORCE;
  if (entries[HOST].given && entries[HOST].length + 1 >= sizeof device->host) {
    return hapi_arguments_fail(table, &entries[HOST], detail);
  }
  snprintf(device->host, sizeof device->host, "%.*s",
           entries[HOST].given ? (int)entries[HOST].length : (int)strlen("localhost"),
           entries[HOST].given ? entries[HOST].text : "localhost");
  device->port = (unsigned)entries[PORT_ARGUMENT].number[0];
  if ((double)device->port != entries[PORT_ARGUMENT].number[0]) {
    return hapi_arguments_fail(table, &entries[PORT_ARGUMENT], detail);
  }
  HAPI_TRY(id_take(table, ID, device->wish.arm, detail));
  HAPI_TRY(id_take(table, GRIP, device->wish.grip, detail));
  HAPI_TRY(hapi_relay_take_arguments(table, entries + RELAY, &settings, detail));
  HAPI_TRY(service_ask(device, detail));
  HAPI_TRY(arm_choose(device, detail));
  if (settings.turns && !device->first.has_grip) {
    return hapi_fail(detail, HAP_ERROR_DEVICE,
                     "haply: turn=1 needs a VerseGrip, and the service has none: is it charged and "
                     "paired, or leave turn=1 out");
  }
  hapi_relay_init(&device->relay, &settings);
  return HAP_OK;
}

static void haply_free(haply_device *device)
{
  hapi_websocket_close(device->ws);
  hapi_unclaim(device);
  hapi_free(device);
}

static hap_status haply_open(void *context, const char *args, void **self, hap_detail *detail)
{
  hapi_argument entries[ARGUMENT_COUNT] = {
      [HOST] = {"host", HAPI_ARGUMENT_TEXT, .expected = "a name or address of a machine"},
      [PORT_ARGUMENT] = {"port", HAPI_ARGUMENT_NUMBER, false, 1.0, 65535.0,
                         "a whole number from 1 to 65535", .number = {PORT}},
      [ID] = {"id", HAPI_ARGUMENT_TEXT, .expected = "the device_id of an Inverse3"},
      [GRIP] = {"grip", HAPI_ARGUMENT_TEXT, .expected = "the device_id of a VerseGrip"},
  };
  const hapi_argument_table table = {"haply", entries, ARGUMENT_COUNT};
  (void)context;
  hapi_relay_arguments(entries + RELAY);
  HAPI_TRY(hapi_arguments_read(&table, args, detail));
  haply_device *device = hapi_alloc(sizeof *device);
  if (device == NULL) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "haply: out of memory");
  }
  hap_status status = haply_find(device, &table, detail);
  if (status < HAP_OK) {
    haply_free(device);
    return status;
  }
  *self = device;
  return HAP_OK;
}

static void haply_describe(void *self, uint32_t effector, hap_device_info *out)
{
  const haply_device *device = self;
  (void)effector;
  snprintf(out->name, sizeof out->name, "Inverse3 %s", device->wish.arm);
  out->dof = device->relay.settings.turns ? 6 : 3;
  out->max_force = device->relay.settings.max_force;
  out->max_torque = device->relay.settings.turns ? device->relay.settings.max_torque : 0.0;
  out->measures_velocity = 1;
  out->button_count = 3;
}

/* ---- start and stop ---- */

static bool carrier_end(haply_device *device)
{
  hapi_relay_zero(&device->relay);
  atomic_store(&device->ending, true);
  bool ended = hapi_thread_join_within(&device->thread, HAPI_SAFETY_STOP_WAIT_S);
  hapi_relay_stop(&device->relay);
  if (ended) {
    hapi_websocket_close(device->ws);
    device->ws = NULL;
  }
  return ended;
}

static hap_status start_fail(haply_device *device, int cause)
{
  hapi_relay_set_cause(&device->relay, cause);
  return HAP_ERROR_DEVICE;
}

static bool first_awaited(const haply_device *device)
{
  int64_t end = hapi_clock_now() + (int64_t)(1e9 * CONNECT_S);
  while (!hapi_triple_is_fresh(&device->relay.sample_places)) {
    if (hapi_clock_now() >= end || hapi_relay_cause_now(&device->relay) != HAPI_RELAY_WELL) {
      return false;
    }
    hapi_clock_sleep_until(hapi_clock_now() + PAUSE_NS);
  }
  return true;
}

static hap_status haply_start(void *self)
{
  haply_device *device = self;
  const hapi_websocket_place place = place_of(device);
  hap_detail why;
  if (!carrier_end(device)) {
    return start_fail(device, HAPLY_STUCK);
  }
  if (hapi_websocket_open(&place, CONNECT_S, &device->ws, &why) < HAP_OK) {
    return start_fail(device, HAPLY_NOT_CONNECTED);
  }
  if (!hapi_relay_start(&device->relay)) {
    return start_fail(device, HAPLY_NO_THREAD);
  }
  device->due = true;
  device->zero_last = false;
  atomic_store(&device->ending, false);
  if (hapi_thread_start(&device->thread, carrier_main, device, "hapode-haply", PRIORITY) < HAP_OK) {
    hapi_relay_stop(&device->relay);
    return start_fail(device, HAPLY_NO_THREAD);
  }
  if (!first_awaited(device)) {
    int cause = hapi_relay_cause_now(&device->relay);
    (void)carrier_end(device);
    return start_fail(device, cause != HAPI_RELAY_WELL ? cause : HAPLY_NO_STATE);
  }
  return HAP_OK;
}

static void haply_stop(void *self)
{
  haply_device *device = self;
  (void)carrier_end(device);
  if (!hapi_relay_is_resting(&device->relay)) {
    hapi_log(HAP_LOG_ERROR, "haply: Inverse3 %s did not take zero force: switch it off",
             device->wish.arm);
  }
}

static void haply_close(void *self)
{
  haply_device *device = self;
  if (carrier_end(device)) {
    haply_free(device);
  }
}

/* ---- every tick ---- */

static hap_status haply_read(void *self, int64_t time_ns, hap_device_input *const out[])
{
  haply_device *device = self;
  return hapi_relay_read(&device->relay, time_ns, out[0]);
}

static hap_status haply_write(void *self, const hap_device_output *const wanted[],
                              hap_device_output *const reached[])
{
  haply_device *device = self;
  return hapi_relay_write(&device->relay, &wanted[0]->wrench, &reached[0]->wrench);
}

static void haply_zero(void *self)
{
  haply_device *device = self;
  hapi_relay_zero(&device->relay);
}

static void haply_held(void *self, hap_device_output *const out[])
{
  const haply_device *device = self;
  hapi_relay_held(&device->relay, &out[0]->wrench);
}

static const char *cause_text(int cause)
{
  switch (cause) {
    case HAPI_RELAY_SILENT:
      return "the service sends no state: is it busy, or stopped?";
    case HAPI_RELAY_NOT_FINITE:
      return "positions are beyond all bounds, or an orientation is no unit quaternion";
    case HAPLY_GONE:
      return "the service has gone: start it, then restart";
    case HAPLY_BROKEN:
      return "the service does not keep to its protocol: restart, or update it";
    case HAPLY_NO_ARM:
      return "the service goes on without this Inverse3: look at its cable";
    case HAPLY_NO_GRIP:
      return "the VerseGrip tells no orientation: is it charged and near?";
    case HAPLY_GARBAGE:
      return "a message of the service is no JSON, or has no numbers where they belong";
    case HAPLY_NOT_CONNECTED:
      return "the service does not answer: start Haply's Inverse Service";
    case HAPLY_NO_STATE:
      return "the service sends no state of this Inverse3";
    case HAPLY_NO_THREAD:
      return "no thread, or more than 64 devices";
    case HAPLY_STUCK:
      return "the thread before has not ended";
    default:
      return NULL;
  }
}

static void haply_explain(void *self, hap_detail *out)
{
  const haply_device *device = self;
  const char *text = cause_text(hapi_relay_cause_last(&device->relay));
  if (text != NULL) {
    snprintf(out->text, sizeof out->text, "Inverse3 %s at ws://%s:%u: %s", device->wish.arm,
             device->host, device->port, text);
  }
}

/* ---- the table ---- */

extern const hap_device_ops hapi_haply_ops;

const hap_device_ops hapi_haply_ops = {
    .abi = HAP_DEVICE_ABI,
    .size = sizeof(hap_device_ops),
    .name = "haply",
    .help =
        "Haply Inverse3, by its service: [id=ID][,grip=ID][,host=NAME][,port=N][,max_force=N]"
        "[,turn=0|1][,stale=S][,timeout=S]; never tried on hardware; docs/vendor-devices.md",
    .pacing = HAP_PACING_HOST,
    .open = haply_open,
    .describe = haply_describe,
    .start = haply_start,
    .read = haply_read,
    .write = haply_write,
    .zero = haply_zero,
    .stop = haply_stop,
    .close = haply_close,
    .held = haply_held,
    .explain = haply_explain,
};
