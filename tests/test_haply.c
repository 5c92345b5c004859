/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The device haply over a pretended service in another language (haply_service.py), and its readers
 * by themselves. What is felt is the force that the service holds. */

#include "tests/tap.h"

#include <locale.h>
#include <netinet/in.h>
#include <sys/resource.h>
#include <sys/socket.h>

#include "base/safety.h"
#include "base/vec.h"
#include "device/device.h"
#include "plugins/haply/handshake.h"
#include "plugins/haply/json.h"
#include "plugins/haply/message.h"
#include "plugins/haply/websocket.h"
#include "tests/device_rig.h"
#include "tests/haply_rig.h"
#include "tests/pressed.h"
#include "tests/program.h"

#define TICKS 1000000
#define SLOW ",stale=0.5,timeout=5" /* where a busy machine is no part of the test */

SET_UP
{
  return hapi_websocket_is_there() || tap_skip_all("built without libwslay");
}

static hap_device_input read_settled(const device_rig *r)
{
  hap_device_input in = {.size = sizeof in};
  hap_device_input *const out[] = {&in};
  for (int i = 0; i < 100; ++i) {
    sleep_ms(1);
    CHECK(r->ops->read(r->self, hapi_clock_now(), out) == HAP_OK);
  }
  return in;
}

static hap_status write_now(const device_rig *r, const hap_wrench *wrench)
{
  hap_device_output wanted = {.size = sizeof wanted, .wrench = *wrench};
  hap_device_output given = {.size = sizeof given};
  const hap_device_output *const in[] = {&wanted};
  hap_device_output *const out[] = {&given};
  return r->ops->write(r->self, in, out);
}

/* Written again and again, as a force that nobody renews is taken off; false: it did not act within
 * 10 s. */
static bool force_arrives(const device_rig *r, const hap_wrench *wrench, service *s,
                          const char *arm)
{
  int64_t end = hapi_clock_now() + 10000 * MS;
  bool same = false;
  while (!same && hapi_clock_now() < end) {
    CHECK(write_now(r, wrench) == HAP_OK);
    sleep_ms(2);
    same = true;
    for (int i = 0; i < 3; ++i) {
      same = same && fabs(service_number(s, arm, "force", i) - wrench->force[i]) < 1e-9;
    }
  }
  return same;
}

/* ---- frames and units ---- */

TEST(each_axis_has_its_sign)
{
  service *s = service_new(NULL);
  device_rig *r = rig_new(service_spec(s, SLOW));
  for (int axis = 0; axis < 3; ++axis) {
    char command[80];
    snprintf(command, sizeof command, "at %g %g %g", axis == 0 ? 0.02 : 0.0, axis == 1 ? 0.02 : 0.0,
             axis == 2 ? 0.02 : 0.0);
    service_tell(s, command);
    hap_device_input in = read_settled(r);
    for (int i = 0; i < 3; ++i) {
      CHECK_NEAR(in.pose.position[i], i == axis ? 0.02 : 0.0, 1e-12);
    }
  }
}

TEST(each_force_has_its_sign)
{
  service *s = service_new(NULL);
  device_rig *r = rig_new(service_spec(s, SLOW));
  for (int axis = 0; axis < 3; ++axis) {
    hap_wrench push = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    push.force[axis] = -0.75;
    CHECK(force_arrives(r, &push, s, ""));
  }
  CHECK(service_number(s, "", "bad", 0) == 0.0);
}

TEST(a_grip_turns_the_handle)
{
  static const char *const arguments[] = {"--grips", "G1,G2", NULL};
  service *s = service_new(arguments);
  device_rig *r = rig_new(service_spec(s, SLOW ",turn=1"));
  service_tell(s, "turn 0.8 0 0.6 0");
  service_tell(s, "buttons 5");
  hap_device_input in = read_settled(r);
  CHECK_NEAR(in.pose.quat_wxyz[0], 0.8, 1e-12);
  CHECK_NEAR(in.pose.quat_wxyz[2], 0.6, 1e-12);
  CHECK(in.buttons == 5);
}

TEST(velocity_is_in_metres_a_second)
{
  static const char *const arguments[] = {"--swing", "0.01", NULL};
  double most = 0.0;
  service *s = service_new(arguments);
  device_rig *r = rig_new(service_spec(s, SLOW));
  for (int i = 0; i < 11; ++i) {
    most = fmax(most, fabs(read_settled(r).twist.linear[1]));
  }
  CHECK_NEAR(most, 2.0 * M_PI * 0.01, 0.005);
}

/* ---- faults, felt in a session ---- */

typedef struct service_fault {
  const char *name;
  const char *command;
  const char *says;
  const char *rest; /* of the spec */
  bool restart;     /* it needs one to come back */
} service_fault;

static const service_fault service_faults[] = {
    {"a_service_that_is_silent", "fault silent", "sends no state", "", false},
    {"garbage_instead_of_json", "fault garbage", "no JSON", "", false},
    {"a_decimal_comma", "fault comma", "no JSON", "", false},
    {"nan_instead_of_a_number", "fault nan", "no JSON", "", false},
    {"null_instead_of_a_number", "fault null", "no JSON", "", false},
    {"a_number_beyond_all_bounds", "fault huge_number", "no JSON", "", false},
    {"a_thousand_brackets", "fault deep", "no JSON", "", false},
    {"an_arm_that_is_unplugged", "fault unplugged", "without this Inverse3", "", false},
    {"a_grip_that_is_gone", "fault no_grip", "VerseGrip", ",turn=1", false},
    {"a_grip_that_is_no_rotation", "fault grip_not_unit", "unit quaternion", ",turn=1", false},
    {"a_message_that_is_too_long", "fault huge", "protocol", "", true},
    {"bytes_that_are_no_frames", "fault bytes", "", "", true},
    {"a_text_that_is_not_utf8", "fault not_utf8", "protocol", "", true},
    {"messages_that_are_no_text", "fault binary", "sends no state", "", false},
    {"answers_that_are_late", "late 0.2", "sends no state", "", false},
    {"a_close", "close", "service has gone", "", true},
    {"old_messages", "fault old", "without this Inverse3", "", false},
};

typedef struct pressed_pair {
  pressed *p;
  service *s;
  bool restart;
} pressed_pair;

static bool is_pushed_again(void *user)
{
  pressed_pair *pair = user;
  if (pressed_fault(pair->p) != HAP_FAULT_NONE) {
    if (pair->restart) {
      (void)hap_pointer_restart(pair->p->session, pair->p->hand);
    }
    (void)hap_session_reset_fault(pair->p->session);
    sleep_ms(100);
  }
  return service_is_pushed(pair->s);
}

static bool fault_is_latched(void *user)
{
  return pressed_fault(user) != HAP_FAULT_NONE;
}

/* Milliseconds from the fault to zero force. */
static double fault_run(const service_fault *row)
{
  static const char *const arguments[] = {"--grips", "G1", NULL};
  service *s = service_new(arguments);
  char at[64];
  snprintf(at, sizeof at, "at %g 0 0", PRESSED_X);
  service_tell(s, at);
  pressed *p = pressed_new(service_spec(s, row->rest));
  pressed_pair pair = {p, s, false};
  CHECK(pressed_await(is_pushed_again, &pair)); /* a busy machine may have latched a fault */
  pair.restart = row->restart;
  int64_t begin = hapi_clock_now();
  service_tell(s, row->command);
  CHECK(pressed_await(fault_is_latched, p));
  double ms = 1e-6 * (double)(hapi_clock_now() - begin);
  CHECK(pressed_await(service_is_let_go, s));
  ms = fmax(ms, 1e-6 * (double)(hapi_clock_now() - begin));
  sleep_ms(100); /* the cause of a break may come after the first doubt */
  CHECK(pressed_says(p, row->says));
  CHECK_NEAR(service_force(s, ""), 0.0, 0.0);
  service_tell(s, "fault");
  service_tell(s, "late 0");
  CHECK(pressed_await(is_pushed_again, &pair));
  tap_release(p);
  CHECK(pressed_await(service_is_let_go, s));
  CHECK(service_number(s, "", "bad", 0) == 0.0);
  tap_release(s);
  return ms;
}

TEST_EACH(service_faults, const service_fault *row)
{
  double ms = fault_run(row);
  for (int i = 0; i < 3 && ms >= 100.0; ++i) {
    ms = fmin(ms, fault_run(row));
  }
  printf("# %s: zero after %.1f ms\n", row->name, ms);
  CHECK(ms < 100.0);
}

/* The service is what holds the force: with the service it is gone. */
TEST(a_service_that_goes_and_comes_back)
{
  char at[64];
  service *s = service_new(NULL);
  snprintf(at, sizeof at, "at %g 0 0", PRESSED_X);
  service_tell(s, at);
  pressed *p = pressed_new(service_spec(s, ""));
  pressed_pair pair = {p, s, false};
  CHECK(pressed_await(is_pushed_again, &pair));
  pair.restart = true;
  service_tell(s, "gone");
  CHECK(pressed_await(fault_is_latched, p));
  CHECK(pressed_says(p, "service has gone"));
  CHECK(hap_pointer_restart(p->session, p->hand) < HAP_OK);
  CHECK(pressed_says(p, "does not answer"));
  service_tell(s, "back");
  CHECK(pressed_await(is_pushed_again, &pair));
  tap_release(p);
  CHECK(pressed_await(service_is_let_go, s));
}

/* ---- a service that stalls for 200 ms ---- */

/* False: the machine was late by itself. */
static bool stall_run(void)
{
  char at[64];
  char line[80];
  hap_pointer_state state;
  service *s = service_new(NULL);
  snprintf(at, sizeof at, "at %g 0 0", PRESSED_X);
  service_tell(s, at);
  pressed *p = pressed_new(service_spec(s, ",timeout=5"));
  pressed_pair pair = {p, s, false};
  bool quiet = pressed_await(pressed_is_at_ease, p);
  double pushes = service_number(s, "", "pushes", 0);
  CHECK(write(s->in, "stall 0.2\n", 10) == 10);
  sleep_ms(150);
  CHECK(hap_pointer_get(p->session, p->hand, &state, sizeof state) >= HAP_OK);
  CHECK(fault_is_latched(p) && hapi_v3_norm(state.wrench.force) == 0.0);
  quiet = quiet && pressed_fade_check(p);
  CHECK(service_line(s, line, sizeof line));
  CHECK(pressed_await(service_is_let_go, s));
  /* Until it stalled some, and of those that came meanwhile one. */
  CHECK(service_number(s, "", "pushes", 0) < pushes + 100.0);
  sleep_ms(50);
  CHECK(service_is_let_go(s));
  CHECK(pressed_await(is_pushed_again, &pair));
  tap_release(p);
  tap_release(s);
  return quiet;
}

/* The guard's table: all of the force for 4 ms, none after 18 ms, latched; over 20 ms back after a
 * reset. A service that goes on finds one force of before, and behind it a zero. */
TEST(a_stall_of_200_ms_fades_and_latches)
{
  bool quiet = stall_run();
  for (int i = 0; i < 5 && !quiet; ++i) {
    quiet = stall_run();
  }
  if (!quiet) {
    tap_say("the fade by itself was not seen: ticks are late here");
  }
}

/* ---- what is no fault ---- */

TEST(split_frames_and_pings_are_no_fault)
{
  hap_device_input in;
  service *s = service_new(NULL);
  device_rig *r = rig_new(service_spec(s, SLOW));
  service_tell(s, "ping");
  service_tell(s, "at 0.01 0.02 0.03");
  service_tell(s, "fault split"); /* with more pings */
  in = read_settled(r);
  in = read_settled(r);
  CHECK_NEAR(in.pose.position[2], 0.03, 1e-12);
  CHECK(service_number(s, "", "pongs", 0) > 2.0);
}

TEST(a_locale_with_a_decimal_comma_changes_nothing)
{
  static const char *const names[] = {"de_DE.UTF-8", "de_DE.utf8", "fr_FR.UTF-8", NULL};
  bool found = false;
  for (int i = 0; names[i] != NULL && !found; ++i) {
    found = setlocale(LC_ALL, names[i]) != NULL;
  }
  if (!found) {
    SKIP("no locale with a decimal comma is installed");
  }
  const hap_wrench push = {{0.125, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  service *s = service_new(NULL);
  device_rig *r = rig_new(service_spec(s, SLOW));
  service_tell(s, "at 0.25 0 0");
  CHECK_NEAR(read_settled(r).pose.position[0], 0.25, 1e-12);
  for (int i = 0; i < 100; ++i) { /* in that locale, and long enough */
    CHECK(write_now(r, &push) == HAP_OK);
    sleep_ms(1);
  }
  setlocale(LC_ALL, "C");
  CHECK(force_arrives(r, &push, s, ""));
  CHECK(service_number(s, "", "bad", 0) == 0.0);
}

/* ---- the end ---- */

#define ENDS "HAPODE_ENDS_BY_ITSELF" /* the spec of a device, in the process that ends */

static void push_and_exit(const char *spec)
{
  hap_detail detail;
  device_rig r;
  const hap_wrench push = {{0.5, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  memset(&r, 0, sizeof r);
  if (hap_device_open(spec, &r.device, &detail) != HAP_OK) {
    _exit(2);
  }
  r.ops = hapi_device_ops(r.device);
  r.self = hapi_device_self(r.device);
  if (r.ops->start(r.self) != HAP_OK || write_now(&r, &push) != HAP_OK) {
    _exit(3);
  }
  for (int i = 0; i < 200; ++i) {
    (void)write_now(&r, &push);
    sleep_ms(1);
  }
  exit(0); /* without zero, stop and close */
}

TEST(a_process_that_ends_by_itself_leaves_zero)
{
  if (getenv(ENDS) != NULL) {
    push_and_exit(getenv(ENDS));
  }
  service *s = service_new(NULL);
  CHECK(program_again("a_process_that_ends_by_itself", ENDS, service_spec(s, SLOW)) == 0);
  CHECK(service_number(s, "", "pushes", 0) > 0.0);
  CHECK(pressed_await(service_is_let_go, s));
}

/* ---- what is refused ---- */

typedef struct refusal {
  const char *name;
  const char *arms;
  const char *fault;
  const char *rest;
  const char *says[3];
} refusal;

static const refusal refusals[] = {
    {"a_web_server", "A", "fault http", "", {"does not speak WebSocket", "404", "Inverse Service"}},
    {"a_wrong_key", "A", "fault wrong_key", "", {"does not speak WebSocket", "101", "port="}},
    {"a_port_that_says_nothing", "A", "fault mute", "", {"does not speak", "nothing", "host="}},
    {"an_older_service", "A", "fault old", "", {"another version", "inverse3", "3.1"}},
    {"nothing_but_garbage", "A", "fault garbage", "", {"another version", "inverse3", "update"}},
    {"a_silent_service", "A", "fault silent", "", {"sends nothing", "another version", "update"}},
    {"no_arm", "", "fault", "", {"no Inverse3", "plugged in", "Haply Hub"}},
    {"two_arms", "A,B", "fault", "", {"2 Inverse3", "A, B", "id="}},
    {"another_arm", "A,B", "fault", ",id=C", {"'C'", "A, B", "no Inverse3"}},
    {"no_grip", "A", "fault", ",turn=1", {"VerseGrip", "charged", "turn=1"}},
    {"a_wrong_name", "A", "fault", ",id=\"x\"", {"id", "device_id", "expected"}},
};

TEST_EACH(refusals, const refusal *row)
{
  const char *const arguments[] = {"--arms", row->arms, NULL};
  hap_device *device = NULL;
  hap_detail detail = {""};
  service *s = service_new(arguments);
  service_tell(s, row->fault);
  CHECK(hap_device_open(service_spec(s, row->rest), &device, &detail) < HAP_OK && device == NULL);
  for (int i = 0; i < 3; ++i) {
    CHECK(text_has(detail.text, row->says[i]));
  }
}

TEST(no_service)
{
  hap_device *device = NULL;
  hap_detail detail = {""};
  service *s = service_new(NULL);
  service_tell(s, "gone");
  CHECK(hap_device_open(service_spec(s, ""), &device, &detail) == HAP_ERROR_NOT_FOUND);
  CHECK(text_has(detail.text, "nobody answers at ws://127.0.0.1:"));
  CHECK(text_has(detail.text, "install Haply's Inverse Service"));
}

TEST(two_arms_are_independent_and_none_is_had_twice)
{
  static const char *const arguments[] = {"--arms", "A,B", NULL};
  const hap_wrench push = {{0.0, 0.4, 0.0}, {0.0, 0.0, 0.0}};
  hap_device *third = NULL;
  hap_detail detail = {""};
  service *s = service_new(arguments);
  device_rig *a = rig_new(service_spec(s, SLOW ",id=A"));
  device_rig *b = rig_new(service_spec(s, SLOW ",id=B"));
  CHECK(force_arrives(b, &push, s, "B") && service_force(s, "A") == 0.0);
  CHECK(hap_device_open(service_spec(s, ",id=A"), &third, &detail) == HAP_ERROR_DEVICE);
  CHECK(text_has(detail.text, "uses Inverse3 A already"));
  tap_release(a);
  tap_release(b);
  CHECK(pressed_await(service_is_let_go, s));
  sleep_ms(20);
  CHECK(service_force(s, "B") == 0.0);
}

/* ---- the readers by themselves ---- */

/* RFC 6455, section 1.3. */
TEST(the_handshake_is_that_of_the_standard)
{
  char key[HAPI_HANDSHAKE_KEY];
  char accept[HAPI_HANDSHAKE_ACCEPT];
  hapi_handshake_accept("dGhlIHNhbXBsZSBub25jZQ==", accept);
  CHECK(strcmp(accept, "s3pPLMBiTxaQ9kYGzzhZRbK+xOo=") == 0);
  hapi_handshake_key((const uint8_t *)"the sample nonce", key);
  CHECK(strcmp(key, "dGhlIHNhbXBsZSBub25jZQ==") == 0);
}

static const char *const good_json[] = {
    "{}",
    "[]",
    " [1, -0.5e-3, 0, 10, 1E+2, \"a\\u00e9\\n\", true, false, null, [[]], {\"a\":{}}]\n",
    "\"text\"",
    "-0",
    "[[[[[[[[1]]]]]]]]",
};

static const char *const bad_json[] = {
    "",     "{",   "[1,]",  "[,1]",  "{\"a\"}", "{\"a\":}",  "{\"a\":1,}", "[1 2]", "01",
    "1.",   ".5",  "+1",    "1e",    "nan",     "NaN",       "Infinity",   "-",     "0x10",
    "1,5",  "tru", "truex", "\"a",   "\"\\x\"", "\"\\u12\"", "\"a\nb\"",   "{a:1}", "{\"a\" 1}",
    "[1]]", "[1}", "{1:2}", "1e999", "nul",     "[\"a\":1]", "{\"a\",1}",  "1 1",
};

TEST(json_is_read_strictly)
{
  hapi_json json;
  for (size_t i = 0; i < sizeof good_json / sizeof good_json[0]; ++i) {
    hapi_json_begin(&json, good_json[i], strlen(good_json[i]));
    CHECK_SAY(hapi_json_skip(&json) && hapi_json_end(&json), "%s", good_json[i]);
  }
  for (size_t i = 0; i < sizeof bad_json / sizeof bad_json[0]; ++i) {
    hapi_json_begin(&json, bad_json[i], strlen(bad_json[i]));
    CHECK_SAY(!(hapi_json_skip(&json) && hapi_json_end(&json)), "%s", bad_json[i]);
  }
}

TEST(a_message_without_bytes_is_none)
{
  const hapi_haply_wish wish = {"", ""};
  hapi_haply_state state;
  CHECK(!hapi_haply_read(NULL, 0, &wish, &state));
}

TEST(json_of_any_depth_ends)
{
  static char deep[4000];
  hapi_json json;
  memset(deep, '[', sizeof deep);
  hapi_json_begin(&json, deep, sizeof deep);
  CHECK(!hapi_json_skip(&json) && json.bad);
}

TEST(a_message_may_have_any_order_and_more_in_it)
{
  static const char text[] =
      "{\"more\":[1,{}],\"inverse3\":[{\"state\":{\"cursor_velocity\":{\"z\":3,\"x\":1,\"y\":2},"
      "\"q\":null,\"cursor_position\":{\"x\":0.1,\"y\":-0.2,\"z\":3e-1,\"w\":9}},"
      "\"device_id\":\"B\"},{\"device_id\":\"A\",\"state\":{}}]}";
  const hapi_haply_wish wish = {"B", ""};
  const hapi_haply_wish other = {"A", ""};
  hapi_haply_state state;
  CHECK(hapi_haply_read(text, strlen(text), &wish, &state));
  CHECK(state.arms.count == 2 && state.has_position && !state.has_grip);
  CHECK_NEAR(state.position[2], 0.3, 1e-15);
  CHECK_NEAR(state.velocity[0], 1.0, 0.0);
  CHECK(hapi_haply_read(text, strlen(text), &other, &state) && !state.has_position);
  for (size_t cut = 0; cut + 1 < sizeof text; ++cut) { /* cut off anywhere it is no message */
    CHECK(!hapi_haply_read(text, cut, &wish, &state));
  }
}

TEST(a_force_is_written_as_the_service_reads_it)
{
  char text[HAPI_HAPLY_TEXT];
  const double force[3] = {0.5, -1e-9, 12.0};
  size_t length = hapi_haply_write_force("04BA", force, text);
  CHECK(length == strlen(text));
  CHECK(strcmp(text,
               "{\"inverse3\":[{\"device_id\":\"04BA\",\"commands\":{\"set_cursor_force\":{"
               "\"values\":{\"x\":0.5,\"y\":-1e-09,\"z\":12}}}}]}") == 0);
}

/* ---- the tick ---- */

typedef struct ticks {
  const device_rig *r;
  struct rusage before;
  struct rusage after;
  uint64_t bad;
} ticks;

static void *ticks_run(void *user)
{
  ticks *t = user;
  hap_device_input in = {.size = sizeof in};
  hap_device_output wanted = {.size = sizeof wanted};
  hap_device_output given = {.size = sizeof given};
  hap_device_input *const ins[] = {&in};
  const hap_device_output *const wants[] = {&wanted};
  hap_device_output *const gives[] = {&given};
  for (int i = 0; i < TICKS + 1000; ++i) {
    if (i == 1000) {
      getrusage(RUSAGE_THREAD, &t->before);
    }
    t->bad += t->r->ops->read(t->r->self, hapi_clock_now(), ins) < HAP_OK;
    wanted.wrench.force[0] = 1e-7 * i;
    t->bad += t->r->ops->write(t->r->self, wants, gives) < HAP_OK;
  }
  getrusage(RUSAGE_THREAD, &t->after);
  return NULL;
}

TEST(a_million_ticks_wait_for_nothing)
{
  pthread_t thread;
  tap_fresh_memory();
  service *s = service_new(NULL);
  device_rig *r = rig_new(service_spec(s, SLOW));
  ticks t = {.r = r};
  REQUIRE(pthread_create(&thread, NULL, ticks_run, &t) == 0);
  pthread_join(thread, NULL);
  CHECK(t.bad == 0);
#if !TAP_THREAD_SANITIZER && !TAP_ADDRESS_SANITIZER
  CHECK(t.after.ru_nvcsw == t.before.ru_nvcsw && t.after.ru_minflt == t.before.ru_minflt);
#endif
}
