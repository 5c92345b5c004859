/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The devices forcedimension and openhaptics over stand-ins for libdhd and libHD, which know the
 * makers' prototypes and nothing of the devices. What is felt is what acts in the stand-in. */

#include "tests/tap.h"

#include <fcntl.h>
#include <locale.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/safety.h"
#include "base/vec.h"
#include "device/device.h"
#include "tests/device_rig.h"
#include "tests/pressed.h"
#include "tests/program.h"
#include "tests/vendor_rig.h"

#define TICKS 1000000
#define SLOW ",stale=0.5,timeout=5" /* where a busy machine is no part of the test */

static const vendor both[] = {VENDOR_DHD, VENDOR_HD};

/* The newest sample, after the stand-in was changed and its values have come through. */
static hap_device_input read_settled(const device_rig *r)
{
  hap_device_input in;
  hap_device_input *const out[] = {&in};
  memset(&in, 0, sizeof in);
  in.size = sizeof in;
  for (int i = 0; i < 100; ++i) {
    sleep_ms(1);
    CHECK(r->ops->read(r->self, hapi_clock_now(), out) == HAP_OK);
  }
  return in;
}

static hap_status write_now(const device_rig *r, const hap_wrench *wrench, hap_wrench *reached)
{
  hap_device_output wanted = {.size = sizeof wanted, .wrench = *wrench};
  hap_device_output given = {.size = sizeof given};
  const hap_device_output *const in[] = {&wanted};
  hap_device_output *const out[] = {&given};
  hap_status status = r->ops->write(r->self, in, out);
  if (reached != NULL) {
    *reached = given.wrench;
  }
  return status;
}

/* Written again and again, as a force that nobody renews is taken off; false: it did not act within
 * 10 s. */
static bool wrench_arrives(const device_rig *r, const hap_wrench *wrench, const standin *it, int id)
{
  int64_t end = hapi_clock_now() + 10000 * MS;
  bool same = false;
  while (!same && hapi_clock_now() < end) {
    CHECK(write_now(r, wrench, NULL) == HAP_OK);
    sleep_ms(2);
    same = true;
    for (int i = 0; i < 3; ++i) {
      same = same && fabs(atomic_load(&it->of[id].force[i]) - wrench->force[i]) < 1e-12 &&
             fabs(atomic_load(&it->of[id].torque[i]) - wrench->torque[i]) < 1e-12;
    }
  }
  return same;
}

/* ---- frames and units ---- */

TEST(each_axis_has_its_sign)
{
  for (int v = 0; v < 2; ++v) {
    standin *it = vendor_standin(both[v], 0.0);
    device_rig *r = rig_new(vendor_spec(both[v], SLOW));
    for (int axis = 0; axis < 3; ++axis) {
      atomic_store(&it->of[0].position[axis], 0.01 * (axis + 1));
      atomic_store(&it->of[0].turn[axis], 0.3);
      hap_device_input in = read_settled(r);
      for (int i = 0; i < 3; ++i) {
        CHECK_NEAR(in.pose.position[i], i == axis ? 0.01 * (axis + 1) : 0.0, 1e-9);
        CHECK_NEAR(in.pose.quat_wxyz[1 + i], i == axis ? sin(0.15) : 0.0, 1e-9);
      }
      CHECK_NEAR(in.pose.quat_wxyz[0], cos(0.15), 1e-9);
      atomic_store(&it->of[0].position[axis], 0.0);
      atomic_store(&it->of[0].turn[axis], 0.0);
    }
    CHECK(atomic_load(&it->misuse) == 0);
    tap_release(r);
  }
}

TEST(each_force_has_its_sign)
{
  for (int v = 0; v < 2; ++v) {
    standin *it = vendor_standin(both[v], 0.0);
    device_rig *r = rig_new(vendor_spec(both[v], SLOW));
    for (int axis = 0; axis < 3; ++axis) {
      hap_wrench push = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
      push.force[axis] = 0.25 * (axis + 1);
      CHECK(wrench_arrives(r, &push, it, 0));
    }
    r->ops->zero(r->self);
    CHECK(pressed_await(vendor_is_let_go, it));
    tap_release(r);
  }
}

/* N m here, N mm for libHD. */
TEST(torques_go_out_where_a_wrist_has_motors)
{
  static const char *const rest[] = {SLOW, SLOW ",max_torque=0.3"};
  for (int v = 0; v < 2; ++v) {
    hap_device_info info;
    standin *it = vendor_standin(both[v], 0.0);
    atomic_store(&it->wrist, 2);
    device_rig *r = rig_new(vendor_spec(both[v], rest[v]));
    CHECK(hap_device_get_info(r->device, &info, sizeof info) == HAP_OK);
    CHECK(info.dof == 6 && info.max_torque >= 0.3);
    hap_wrench twist = {{0.0, 0.0, 0.0}, {0.1, -0.05, 0.02}};
    CHECK(wrench_arrives(r, &twist, it, 0));
    tap_release(r);
    CHECK(vendor_rests(it, 0));
  }
}

/* A swing of 10 mm with 1 Hz, and 0.5 rad/s about z. */
TEST(velocity_and_turning_are_in_si)
{
  for (int v = 0; v < 2; ++v) {
    double fastest = 0.0;
    double turned = 0.0;
    int count = 0;
    standin *it = vendor_standin(both[v], 0.0);
    atomic_store(&it->of[0].swing[1], 0.01);
    device_rig *r = rig_new(vendor_spec(both[v], SLOW));
    int64_t begin = hapi_clock_now();
    for (double t = 0.0; t < 1.5; t = 1e-9 * (double)(hapi_clock_now() - begin)) {
      hap_device_input in = {.size = sizeof in};
      hap_device_input *const out[] = {&in};
      atomic_store(&it->of[0].turn[2], 0.5 * t);
      sleep_ms(1);
      CHECK(r->ops->read(r->self, hapi_clock_now(), out) == HAP_OK);
      fastest = fmax(fastest, fabs(in.twist.linear[1]));
      turned += t > 0.2 ? in.twist.angular[2] : 0.0;
      count += t > 0.2;
    }
    CHECK_NEAR(fastest, 2.0 * M_PI * 0.01, 0.002);
    CHECK_NEAR(turned / count, 0.5, 0.1);
    tap_release(r);
  }
}

TEST(figures_come_from_the_device)
{
  hap_device_info info;
  (void)vendor_standin(VENDOR_DHD, 0.0);
  device_rig *r = rig_new(vendor_spec(VENDOR_DHD, ",max_force=3"));
  CHECK(hap_device_get_info(r->device, &info, sizeof info) == HAP_OK);
  CHECK(strcmp(info.name, "omega.6") == 0);
  CHECK_NEAR(info.max_force, 3.0, 0.0);
  tap_release(r);
  (void)vendor_standin(VENDOR_HD, 0.0);
  r = rig_new(vendor_spec(VENDOR_HD, ""));
  CHECK(hap_device_get_info(r->device, &info, sizeof info) == HAP_OK);
  CHECK(strcmp(info.name, "Touch") == 0);
  CHECK_NEAR(info.max_force, 0.88, 0.0);
  CHECK_NEAR(info.rated_stiffness, 1260.0, 1e-9);
  CHECK_NEAR(info.workspace_low[0], -0.16, 1e-12);
  CHECK_NEAR(info.workspace_high[2], 0.07, 1e-12);
}

TEST(buttons_are_told)
{
  for (int v = 0; v < 2; ++v) {
    standin *it = vendor_standin(both[v], 0.0);
    device_rig *r = rig_new(vendor_spec(both[v], SLOW));
    atomic_store(&it->of[0].buttons, 5);
    CHECK(read_settled(r).buttons == 5);
    tap_release(r);
  }
}

/* ---- faults, felt in a session ---- */

typedef struct vendor_fault {
  const char *name;
  vendor which;
  int fault;        /* standin_fault */
  const char *says; /* the session's text */
  bool reaches;     /* a zero can go out while the fault is there */
  bool restart;     /* it needs one to come back */
} vendor_fault;

static const vendor_fault vendor_faults[] = {
    {"dhd_positions_fail", VENDOR_DHD, STANDIN_READ_FAILS, "is lost", true, true},
    {"dhd_refuses_forces", VENDOR_DHD, STANDIN_FORCE_FAILS, "refuses forces", false, false},
    {"dhd_tells_nan", VENDOR_DHD, STANDIN_NAN, "not finite", true, false},
    {"dhd_tells_no_rotation", VENDOR_DHD, STANDIN_BAD_FRAME, "no rotation", true, false},
    {"dhd_tells_old_positions", VENDOR_DHD, STANDIN_SILENT, "its exchange had 3900 Hz", true,
     false},
    {"dhd_hangs", VENDOR_DHD, STANDIN_HANGS, "no new position", false, false},
    {"dhd_is_unplugged", VENDOR_DHD, STANDIN_UNPLUGGED, "is lost", false, true},
    {"hd_is_unplugged", VENDOR_HD, STANDIN_UNPLUGGED, "is lost", false, true},
    {"hd_loses_the_line", VENDOR_HD, STANDIN_READ_FAILS, "0x302", false, true},
    {"hd_refuses_forces", VENDOR_HD, STANDIN_FORCE_FAILS, "refuses the force", true, false},
    {"hd_has_warm_motors", VENDOR_HD, STANDIN_WARM, "the warmest at 93 %", true, false},
    {"hd_tells_nan", VENDOR_HD, STANDIN_NAN, "not finite", true, false},
    {"hd_tells_no_rotation", VENDOR_HD, STANDIN_BAD_FRAME, "no rotation", true, false},
    {"hd_has_a_scheduler_that_stands", VENDOR_HD, STANDIN_SILENT, "scheduler", false, false},
    {"hd_hangs", VENDOR_HD, STANDIN_HANGS, "scheduler", false, false},
};

static bool fault_is_latched(void *user)
{
  return pressed_fault(user) != HAP_FAULT_NONE;
}

typedef struct pressed_pair {
  pressed *p;
  standin *it;
  bool restart;
} pressed_pair;

/* As hapode-run --reconnect does. */
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
  return vendor_is_pushed(pair->it);
}

/* Milliseconds from the fault to zero force. */
static double fault_run(const vendor_fault *row)
{
  standin *it = vendor_standin(row->which, PRESSED_X);
  pressed *p = pressed_new(vendor_spec(row->which, ""));
  pressed_pair pair = {p, it, false};
  CHECK(pressed_await(is_pushed_again, &pair)); /* a busy machine may have latched a fault */
  pair.restart = row->restart;
  int64_t begin = hapi_clock_now();
  atomic_store(&it->of[0].fault, row->fault);
  CHECK(pressed_await(fault_is_latched, p));
  if (row->reaches) {
    CHECK(pressed_await(vendor_is_let_go, it));
  }
  double ms = 1e-6 * (double)(hapi_clock_now() - begin);
  CHECK(pressed_says(p, row->says));
  atomic_store(&it->of[0].fault, STANDIN_WELL);
  if (!row->restart) {
    CHECK(
        pressed_await(vendor_is_let_go, it)); /* before a reset: the first that goes out is zero */
  }
  CHECK(pressed_await(is_pushed_again, &pair));
  tap_release(p);
  CHECK(vendor_rests(it, 0) && atomic_load(&it->of[0].enabled) == 0);
  CHECK(atomic_load(&it->misuse) == 0 && atomic_load(&it->of[0].opened) == 0);
  return ms;
}

/* Within 100 ms; a busy machine may need another try. */
TEST_EACH(vendor_faults, const vendor_fault *row)
{
  double ms = fault_run(row);
  for (int i = 0; i < 3 && ms >= 100.0; ++i) {
    ms = fmin(ms, fault_run(row));
  }
  printf("# %s: told%s after %.1f ms\n", row->name, row->reaches ? ", and zero," : "", ms);
  CHECK(ms < 100.0);
}

/* ---- a call that stalls for 200 ms ---- */

/* False: the machine was late by itself. */
static bool stall_run(vendor which)
{
  standin *it = vendor_standin(which, PRESSED_X);
  pressed *p = pressed_new(vendor_spec(which, ",timeout=5,max_force=3")); /* not at its limit */
  pressed_pair pair = {p, it, false};
  hap_pointer_state state;
  bool quiet = pressed_await(pressed_is_at_ease, p);
  atomic_store(&it->of[0].fault, STANDIN_HANGS);
  sleep_ms(200);
  CHECK(hap_pointer_get(p->session, p->hand, &state, sizeof state) >= HAP_OK);
  CHECK(fault_is_latched(p) && hapi_v3_norm(state.wrench.force) == 0.0);
  quiet = quiet && pressed_fade_check(p);
  atomic_store(&it->of[0].fault, STANDIN_WELL);
  CHECK(pressed_await(vendor_is_let_go, it)); /* at once: nobody had reset */
  sleep_ms(50);
  CHECK(vendor_rests(it, 0));
  CHECK(pressed_await(is_pushed_again, &pair));
  tap_release(p);
  return quiet;
}

/* The guard's table: a device that is not believed has all of its force for 4 ms, none after 18 ms,
 * and latches; after a reset it comes back over 20 ms. */
TEST(a_stall_of_200_ms_fades_and_latches)
{
  for (int v = 0; v < 2; ++v) {
    bool quiet = stall_run(both[v]);
    for (int i = 0; i < 5 && !quiet; ++i) {
      quiet = stall_run(both[v]);
    }
    if (!quiet) {
      tap_say("%s: the fade by itself was not seen: ticks are late here", vendor_spec(both[v], ""));
    }
  }
}

/* Some ms are no fault: USB has them. */
TEST(late_calls_are_no_fault)
{
  for (int v = 0; v < 2; ++v) {
    standin *it = vendor_standin(both[v], PRESSED_X);
    atomic_store(&it->of[0].late_ms, 3);
    pressed *p = pressed_new(vendor_spec(both[v], ",stale=0.2,timeout=2"));
    pressed_pair pair = {p, it, false};
    CHECK(pressed_await(is_pushed_again, &pair));
    sleep_ms(200);
    CHECK(pressed_fault(p) != HAP_FAULT_DEVICE_INPUT && pressed_fault(p) != HAP_FAULT_DEVICE_READ);
    tap_release(p);
  }
}

/* ---- nobody writes, and the end ---- */

TEST(a_force_that_nobody_renews_is_taken_off)
{
  const hap_wrench push = {{0.5, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  for (int v = 0; v < 2; ++v) {
    standin *it = vendor_standin(both[v], 0.0);
    device_rig *r = rig_new(vendor_spec(both[v], SLOW));
    CHECK(write_now(r, &push, NULL) == HAP_OK);
    CHECK(pressed_await(vendor_is_pushed, it));
    CHECK(pressed_await(vendor_is_let_go, it));
    CHECK(write_now(r, &push, NULL) == HAP_OK);
    CHECK(pressed_await(vendor_is_pushed, it));
    tap_release(r);
    CHECK(vendor_rests(it, 0));
  }
}

TEST(times_are_those_of_the_safety_page)
{
  CHECK(HAPI_SAFETY_UNWRITTEN_S == 0.1 && HAPI_SAFETY_SILENT_S == 0.01 &&
        HAPI_SAFETY_LOST_S == 0.06);
}

static void *push_on(void *user)
{
  const hap_wrench push = {{0.5, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  for (;;) { /* also while the process ends */
    (void)write_now(user, &push, NULL);
    sleep_ms(1);
  }
  return NULL;
}

#define ENDS "HAPODE_ENDS_BY_ITSELF" /* the spec of a device, in the process that ends */

static void push_and_exit(const char *spec)
{
  static device_rig r;
  hap_detail detail;
  pthread_t thread;
  if (hap_device_open(spec, &r.device, &detail) != HAP_OK) {
    _exit(2);
  }
  r.ops = hapi_device_ops(r.device);
  r.self = hapi_device_self(r.device);
  if (r.ops->start(r.self) != HAP_OK || pthread_create(&thread, NULL, push_on, &r) != 0) {
    _exit(3);
  }
  sleep_ms(200);
  exit(0); /* without zero, stop and close */
}

TEST(a_process_that_ends_by_itself_leaves_zero)
{
  if (getenv(ENDS) != NULL) {
    push_and_exit(getenv(ENDS));
  }
  for (int v = 0; v < 2; ++v) {
    char path[] = "/tmp/hapode_standin_XXXXXX";
    int file = mkstemp(path);
    REQUIRE(file >= 0);
    setenv("STANDIN_FILE", path, 1);
    CHECK(program_again("a_process_that_ends_by_itself", ENDS, vendor_spec(both[v], SLOW)) == 0);
    unsetenv("STANDIN_FILE");
    const standin *it = mmap(NULL, sizeof *it, PROT_READ, MAP_SHARED, file, 0);
    REQUIRE(it != MAP_FAILED);
    CHECK(atomic_load(&it->of[0].pushes) > 0 && vendor_rests(it, 0));
    munmap((void *)(uintptr_t)it, sizeof *it);
    close(file);
    unlink(path);
  }
}

/* ---- what is refused ---- */

typedef struct refusal {
  const char *name;
  vendor which;
  int fault;        /* of the stand-in */
  const char *rest; /* of the spec, behind the library */
  const char *spec; /* instead of all that; NULL */
  const char *says[3];
} refusal;

static const refusal refusals[] = {
    {"no_library_of_dhd",
     VENDOR_DHD,
     0,
     NULL,
     "forcedimension",
     {"libdhd.so.3", "LD_LIBRARY_PATH", "install the Force Dimension SDK"}},
    {"no_library_of_hd",
     VENDOR_HD,
     0,
     NULL,
     "openhaptics",
     {"libHD.so.3", "LD_LIBRARY_PATH", "Touch_Setup"}},
    {"a_library_that_is_not_there",
     VENDOR_DHD,
     0,
     NULL,
     "forcedimension:library=/no/such.so",
     {"/no/such.so", "is not there", "whole path"}},
    {"a_library_without_a_path",
     VENDOR_HD,
     0,
     NULL,
     "openhaptics:library=libHD.so",
     {"libHD.so", "is not there", "whole path"}},
    {"a_library_that_is_a_text",
     VENDOR_DHD,
     0,
     NULL,
     "forcedimension:library=/etc/passwd",
     {"does not load", "/etc/passwd", "install it again"}},
    {"no_device_of_dhd",
     VENDOR_DHD,
     STANDIN_NOT_THERE,
     "",
     NULL,
     {"no device on USB", "switched on", "60-hapode-forcedimension.rules"}},
    {"no_device_of_hd",
     VENDOR_HD,
     STANDIN_NOT_THERE,
     "",
     NULL,
     {"Touch_Setup", "dialout", "0x302"}},
    {"a_device_of_dhd_with_another_number",
     VENDOR_DHD,
     0,
     ",id=7",
     NULL,
     {"device 7", "does not open", "another program"}},
    {"a_device_of_hd_with_another_name",
     VENDOR_HD,
     0,
     ",name=Right",
     NULL,
     {"'Right'", "does not open", "Touch_Setup"}},
    {"a_device_of_hd_in_use",
     VENDOR_HD,
     STANDIN_IN_USE,
     "",
     NULL,
     {"in use already", "name=", "0x301"}},
    {"a_name_that_is_too_long",
     VENDOR_HD,
     0,
     ",name=1234567890123456789012345678901234567890123456789012345678901234",
     NULL,
     {"name", "at most 63 bytes", "1234567890"}},
    {"half_a_number", VENDOR_DHD, 0, ",id=0.5", NULL, {"id", "whole number", "0.5"}},
    {"times_that_contradict",
     VENDOR_HD,
     0,
     ",stale=0.5,timeout=0.1",
     NULL,
     {"stale", "less than timeout", "0.5"}},
    {"a_decimal_comma", VENDOR_DHD, 0, ",max_force=1,5", NULL, {"'5'", "max_force", "known"}},
};

TEST_EACH(refusals, const refusal *row)
{
  hap_device *device = NULL;
  hap_detail detail = {""};
  standin *it = vendor_standin(row->which, 0.0);
  atomic_store(&it->of[0].fault, row->fault);
  const char *spec = row->spec != NULL ? row->spec : vendor_spec(row->which, row->rest);
  if (dlopen("libdhd.so.3", RTLD_LAZY) != NULL || dlopen("libHD.so.3", RTLD_LAZY) != NULL) {
    SKIP("a maker's library is installed");
  }
  CHECK(hap_device_open(spec, &device, &detail) < HAP_OK && device == NULL);
  for (int i = 0; i < 3; ++i) {
    CHECK(text_has(detail.text, row->says[i]));
  }
  CHECK(atomic_load(&it->of[0].opened) == 0);
}

TEST(an_old_library_lacks_a_function)
{
  char spec[600];
  hap_device *device = NULL;
  hap_detail detail = {""};
  snprintf(spec, sizeof spec, "forcedimension:library=%s", getenv("HAPODE_STANDIN_DHD_OLD"));
  CHECK(hap_device_open(spec, &device, &detail) == HAP_ERROR_UNSUPPORTED);
  CHECK(text_has(detail.text, "dhdSetForceAndTorqueAndGripperForce"));
  CHECK(text_has(detail.text, "another version"));
}

typedef struct bad_start {
  const char *name;
  vendor which;
  int fault;
  const char *says;
} bad_start;

static const bad_start bad_starts[] = {
    {"dhd_without_power", VENDOR_DHD, STANDIN_NO_POWER, "switch it on"},
    {"dhd_that_is_not_calibrated", VENDOR_DHD, STANDIN_NOT_READY, "HapticInit"},
    {"dhd_whose_forces_stay_off", VENDOR_DHD, STANDIN_NOT_ENABLED, "cannot be enabled"},
    {"dhd_that_tells_nothing", VENDOR_DHD, STANDIN_SILENT, "no position"},
    {"dhd_that_fails", VENDOR_DHD, STANDIN_READ_FAILS, "is lost"},
    {"hd_that_is_not_calibrated", VENDOR_HD, STANDIN_NOT_READY, "inkwell"},
    {"hd_whose_scheduler_stands", VENDOR_HD, STANDIN_SILENT, "no position"},
};

/* And the next start is good, once the cause is over. */
TEST_EACH(bad_starts, const bad_start *row)
{
  hap_detail detail = {""};
  standin *it = vendor_standin(row->which, 0.0);
  device_rig *r = rig_new(vendor_spec(row->which, SLOW));
  r->ops->stop(r->self);
  atomic_store(&it->of[0].fault, row->fault);
  CHECK(r->ops->start(r->self) == HAP_ERROR_DEVICE);
  r->ops->explain(r->self, &detail);
  CHECK(text_has(detail.text, row->says));
  CHECK(vendor_rests(it, 0));
  atomic_store(&it->of[0].fault, STANDIN_WELL);
  CHECK(r->ops->start(r->self) == HAP_OK);
  (void)read_settled(r);
}

/* ---- two devices ---- */

TEST(two_devices_are_independent_and_none_is_had_twice)
{
  static const char *const other[] = {SLOW ",id=1", SLOW ",name=Left"};
  static const char *const says[] = {"id=", "name="};
  for (int v = 0; v < 2; ++v) {
    const hap_wrench push = {{0.0, 0.4, 0.0}, {0.0, 0.0, 0.0}};
    hap_device *third = NULL;
    hap_detail detail = {""};
    standin *it = vendor_standin(both[v], 0.01);
    atomic_store(&it->count, 2);
    atomic_store(&it->of[1].position[2], 0.03);
    device_rig *one = rig_new(vendor_spec(both[v], SLOW));
    device_rig *two = rig_new(vendor_spec(both[v], other[v]));
    CHECK_NEAR(read_settled(one).pose.position[0], 0.01, 1e-9);
    CHECK_NEAR(read_settled(two).pose.position[2], 0.03, 1e-9);
    CHECK(wrench_arrives(two, &push, it, 1) && vendor_rests(it, 0));
    CHECK(hap_device_open(vendor_spec(both[v], ""), &third, &detail) == HAP_ERROR_DEVICE);
    CHECK(text_has(detail.text, "uses") && text_has(detail.text, says[v]));
    tap_release(one);
    CHECK(wrench_arrives(two, &push, it, 1));
    tap_release(two);
    CHECK(vendor_rests(it, 1));
    CHECK(atomic_load(&it->misuse) == 0);
  }
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
  hap_wrench push = {{0.1, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  hap_device_input in = {.size = sizeof in};
  hap_device_output wanted = {.size = sizeof wanted};
  hap_device_output given = {.size = sizeof given};
  hap_device_input *const ins[] = {&in};
  const hap_device_output *const wants[] = {&wanted};
  hap_device_output *const gives[] = {&given};
  wanted.wrench = push;
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

/* Allocations and locks: test_devices_rtsan. */
TEST(a_million_ticks_wait_for_nothing)
{
  for (int v = 0; v < 2; ++v) {
    pthread_t thread;
    tap_fresh_memory();
    (void)vendor_standin(both[v], 0.0);
    device_rig *r = rig_new(vendor_spec(both[v], SLOW));
    ticks t = {.r = r};
    REQUIRE(pthread_create(&thread, NULL, ticks_run, &t) == 0);
    pthread_join(thread, NULL);
    CHECK(t.bad == 0);
#if !TAP_THREAD_SANITIZER && !TAP_ADDRESS_SANITIZER
    CHECK(t.after.ru_nvcsw == t.before.ru_nvcsw && t.after.ru_minflt == t.before.ru_minflt);
#endif
    tap_release(r);
  }
}
