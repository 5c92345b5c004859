/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The device spidar on a pseudo-terminal with an emulator behind it. Time is real here:
 * everything waits until it has happened, generously, and nothing asks how long it took. */

#include "tests/tap.h"

#include <fcntl.h>
#include <stdint.h>
#include <sys/resource.h>

#include <hapode/hapode.h>

#include "base/clock.h"
#include "base/safety.h"
#include "base/vec.h"
#include "device/device.h"
#include "device/one_effector.h"
#include "plugins/spidar/spidar.h"
#include "tests/spidar_rig.h"
#include "tools/rig.h"

static emulated machine;

/* A device, driven by hand. */
typedef struct hands {
  hap_device *device;
  const hap_device_ops *ops;
  void *self;
  hap_pose pose;
} hands;

static bool open_device(hands *h, const char *arguments, hap_detail *detail)
{
  char spec[500];
  snprintf(spec, sizeof spec, "spidar:%s%s", machine.port, arguments);
  if (hap_device_open(spec, &h->device, detail) < HAP_OK) {
    return false;
  }
  h->ops = hapi_device_ops(h->device);
  h->self = hapi_device_self(h->device);
  return true;
}

static hap_status read_once(hands *h)
{
  hap_twist twist;
  uint32_t buttons;
  return hapi_one_read(h->ops, h->self, hapi_clock_now(), &h->pose, &twist, &buttons);
}

/* Ticks with that force; the first error, or HAP_OK. */
static hap_status hands_push(hands *h, double x, int ticks)
{
  const hap_wrench wanted = {{x, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  for (int i = 0; i < ticks; ++i) {
    hap_wrench reached;
    hapi_clock_sleep_until(hapi_clock_now() + 1000000);
    hap_status status = read_once(h);
    if (status >= HAP_OK) {
      status = hapi_one_write(h->ops, h->self, &wanted, &reached);
    }
    if (status < HAP_OK) {
      return status;
    }
  }
  return HAP_OK;
}

/* Reads until one gives that; false: none does. */
static bool await_status(hands *h, hap_status wanted)
{
  double end = emulated_clock() + 20.0;
  while (emulated_clock() < end) {
    if (read_once(h) == wanted) {
      return true;
    }
    emulated_sleep(1e-3);
  }
  return false;
}

static bool status_explains(const hands *h, const char *word)
{
  hap_detail why = {""};
  hapi_device_explain(h->ops, h->self, &why);
  if (strstr(why.text, word) == NULL) {
    printf("# it says \"%s\"\n", why.text);
    return false;
  }
  return true;
}

/* ---- specs ---- */

static void spec_refused(const char *spec, const char *word)
{
  hap_device *device = NULL;
  hap_detail detail = {""};
  hap_status status = hap_device_open(spec, &device, &detail);
  CHECK_SAY(status < HAP_OK && device == NULL && strstr(detail.text, word) != NULL, "%s: %s", spec,
            detail.text);
}

TEST(wrong_arguments_are_refused_before_a_port_is_touched)
{
  static const struct {
    const char *spec;
    const char *word;
  } rows[] = {{"spidar:/no/such/port", "is it plugged in"},
              {"spidar:/dev/null", "not a serial port"},
              {"spidar:/dev/null,", "last comma"},
              {"spidar:/dev/null,modle=x4r", "modle"},
              {"spidar:/dev/null,model=x9", "there is no model 'x9'"},
              {"spidar:/dev/null,model=./nothing.txt", "nothing.txt"},
              {"spidar:model=x9", "there is no model 'x9'"},
              {"spidar:/dev/null,timeout=0", "timeout"},
              {"spidar:/dev/null,stall=0.01", "stall"},
              {"spidar:/dev/null,rotate=0/0/0/0", "rotate"},
              {"spidar:/dev/null,offset=1/2", "offset"},
              {"spidar:/dev/null,max_force=-1", "max_force"}};
  char longest[700];
  char dots[400];
  for (size_t i = 0; i < sizeof rows / sizeof rows[0]; ++i) {
    spec_refused(rows[i].spec, rows[i].word);
  }
  memset(dots, '.', sizeof dots - 1);
  dots[sizeof dots - 1] = '\0';
  snprintf(longest, sizeof longest, "spidar:/dev/null,model=%s", dots);
  spec_refused(longest, "the path is too long");
  snprintf(longest, sizeof longest, "spidar:%s", dots);
  spec_refused(longest, "the name of the port is too long");
}

TEST(limits_are_lowered_and_never_raised)
{
  hands h;
  hap_detail detail = {""};
  hap_device_info own;
  hap_device_info info;
  REQUIRE(open_device(&h, "", &detail));
  REQUIRE(hap_device_get_info(h.device, &own, sizeof own) == HAP_OK);
  hap_device_close(h.device);
  REQUIRE(open_device(&h, ",max_force=1.5,max_torque=0.02", &detail));
  REQUIRE(hap_device_get_info(h.device, &info, sizeof info) == HAP_OK);
  CHECK(info.max_force == 1.5 && info.max_torque == 0.02);
  hap_device_close(h.device);
  REQUIRE(open_device(&h, ",max_force=500,max_torque=50", &detail));
  REQUIRE(hap_device_get_info(h.device, &info, sizeof info) == HAP_OK);
  CHECK(info.max_force == own.max_force && info.max_torque == own.max_torque);
  hap_device_close(h.device);
}

TEST(the_port_is_found_and_is_for_one_alone)
{
  hap_device *device = NULL;
  hap_device *second = NULL;
  hap_device_info info;
  hap_detail detail = {""};
  setenv("HAPODE_SPIDAR_PORT", machine.port, 1);
  CHECK(hap_device_open("spidar", &device, &detail) == HAP_OK);
  if (device == NULL) {
    printf("# %s\n", detail.text);
    return;
  }
  REQUIRE(hap_device_get_info(device, &info, sizeof info) == HAP_OK);
  CHECK(strcmp(info.name, "spidar-x4r") == 0 && info.dof == 6);
  CHECK(info.max_force > 5.0 && info.max_force < 40.0 && info.max_torque > 0.05);
  CHECK(info.mass == 0.0 && info.damping == 0.0 && info.friction == 0.0); /* nobody knows them */
  CHECK_NEAR(info.delay, 1e-3 + 74 * 5e-6, 1e-9); /* a tick and the commands on the line */
  CHECK(hap_device_open("spidar", &second, &detail) < HAP_OK);
  CHECK(strstr(detail.text, "in use") != NULL);
  unsetenv("HAPODE_SPIDAR_PORT");
  hap_device_close(device);
}

TEST(boards_that_do_not_fit_are_named)
{
  hands h;
  hap_detail detail = {""};
  REQUIRE(emulated_tell(&machine, "report 0 B3F"));
  CHECK(!open_device(&h, "", &detail));
  CHECK(strstr(detail.text, "B3F 0, B3M 1") != NULL);
  CHECK(!open_device(&h, ",model=x4r", &detail));
  CHECK(strstr(detail.text, "7 motors") != NULL && strstr(detail.text, "8 strings") != NULL);
  REQUIRE(emulated_tell(&machine, "report 0 B3M"));
  REQUIRE(emulated_tell(&machine, "silent all 1"));
  CHECK(!open_device(&h, "", &detail));
  CHECK(strstr(detail.text, "no motor board answers") != NULL);
  REQUIRE(emulated_tell(&machine, "silent all 0"));
}

/* A port of another machine hears nothing of a list, and the warning comes before a question. */
TEST(a_list_sends_nothing)
{
  char command[400];
  char name[64];
  int master = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK);
  REQUIRE(master >= 0 && grantpt(master) == 0 && unlockpt(master) == 0 &&
          ptsname_r(master, name, sizeof name) == 0);
  int other = open(name, O_RDWR | O_NOCTTY | O_CLOEXEC); /* so that the line is up */
  for (int asked = 0; asked < 2; ++asked) {
    uint8_t bytes[64];
    snprintf(command, sizeof command,
             "HAPODE_SPIDAR_PORT=%s \"%s\" %s >%s/list 2>&1 && grep -q '%s' %s/list", name,
             getenv("HAPODE_RUN"), asked ? "--list-probe" : "--list", machine.folder,
             asked ? "bytes are sent" : name, machine.folder);
    CHECK(system(command) == 0);
    ssize_t count = read(master, bytes, sizeof bytes);
    CHECK(asked ? count > 0 : count < 0 && errno == EAGAIN);
  }
  snprintf(command, sizeof command, "%s/list", machine.folder);
  unlink(command);
  close(other);
  close(master);
}

/* ---- force ---- */

TEST(the_hand_feels_what_was_reached)
{
  hands h;
  hap_wrench held;
  double force[3];
  hap_detail detail = {""};
  REQUIRE(open_device(&h, ",timeout=5,rotate=1/0/0/0", &detail));
  REQUIRE(h.ops->start(h.self) == HAP_OK);
  CHECK(hands_push(&h, 2.0, 1500) == HAP_OK);
  hapi_one_held(h.ops, h.self, &held);
  CHECK_NEAR(held.force[0], 1.91, 0.05); /* not all that was wanted, and said so */
  REQUIRE(emulated_state(&machine, "force", force, 3));
  CHECK_NEAR(force[0], held.force[0], 0.15);
  CHECK_NEAR(force[1], 0.0, 0.05);
  CHECK_NEAR(h.pose.position[0], 2.0 / 150.0, 2e-3); /* the hand's spring gave way */
  CHECK(hands_push(&h, 0.0, 10) == HAP_OK);
  h.ops->zero(h.self);
  CHECK(emulated_await(&machine, true));
  hapi_one_held(h.ops, h.self, &held);
  CHECK(hapi_v3_norm(held.force) == 0.0);
  CHECK(hands_push(&h, 2.0, 10) == HAP_OK);
  CHECK(emulated_await(&machine, false));
  h.ops->stop(h.self);
  CHECK(emulated_await(&machine, true));
  hap_device_close(h.device);
}

/* x to the right, y away from the user, z up: the makers' z comes towards the user, their y is
 * up. */
TEST(the_frame_has_z_up)
{
  hands h;
  double place[3];
  hap_detail detail = {""};
  REQUIRE(open_device(&h, ",timeout=5,offset=1/0/0", &detail));
  REQUIRE(h.ops->start(h.self) == HAP_OK);
  REQUIRE(emulated_tell(&machine, "push 0 3 1.5"));
  CHECK(hands_push(&h, 0.0, 1500) == HAP_OK);
  REQUIRE(emulated_state(&machine, "position", place, 3));
  CHECK(place[1] > 0.015);
  CHECK_NEAR(h.pose.position[0], 1.0 + place[0], 2e-3);
  CHECK_NEAR(h.pose.position[1], -place[2], 2e-3);
  CHECK_NEAR(h.pose.position[2], place[1], 2e-3);
  CHECK_NEAR(fabs(h.pose.quat_wxyz[0]), 1.0, 1e-3);
  REQUIRE(emulated_tell(&machine, "push 0 0 0"));
  CHECK(hands_push(&h, 0.0, 500) == HAP_OK);
  hap_device_close(h.device);
  CHECK(emulated_await(&machine, true));
}

/* ---- home ---- */

/* The file of a calibration tells where the grip is when a start does not find it at home. */
TEST(a_home_that_was_told_holds_until_the_boards_are_switched_off)
{
  hands h;
  char command[600];
  char file[128];
  char argument[300];
  double place[3];
  hap_device_info info;
  hap_detail detail = {""};
  snprintf(file, sizeof file, "%s/home.txt", machine.folder);
  snprintf(command, sizeof command,
           "echo | \"%s\" --calibrate %s --device spidar:%s,timeout=5 >%s/out 2>&1 && "
           "sed -i 's/^mass_kg = 0 /mass_kg = 0.07 /' %s",
           getenv("HAPODE_RUN"), file, machine.port, machine.folder, file);
  REQUIRE(system(command) == 0);
  snprintf(argument, sizeof argument, ",timeout=5,rotate=1/0/0/0,model=%s", file);
  REQUIRE(open_device(&h, argument, &detail));
  REQUIRE(hap_device_get_info(h.device, &info, sizeof info) == HAP_OK);
  CHECK(info.mass == 0.07);
  REQUIRE(emulated_tell(&machine, "push 2.4 0 0")); /* away from home before it is started */
  emulated_sleep(1.0);
  CHECK(h.ops->start(h.self) == HAP_OK);
  CHECK(hands_push(&h, 0.0, 300) == HAP_OK);
  REQUIRE(emulated_state(&machine, "position", place, 3));
  CHECK(place[0] > 0.01);
  CHECK_NEAR(h.pose.position[0], place[0], 1e-3);
  REQUIRE(emulated_tell(&machine, "push 0 0 0"));
  CHECK(hands_push(&h, 0.0, 500) == HAP_OK);
  hap_device_close(h.device);
  CHECK(emulated_await(&machine, true));
  unlink(file);
  snprintf(file, sizeof file, "%s/out", machine.folder);
  unlink(file);
}

/* ---- what goes wrong ---- */

TEST(boards_that_are_silent_fail_and_come_back_by_themselves)
{
  hands h;
  hap_detail detail = {""};
  REQUIRE(open_device(&h, ",timeout=0.3", &detail));
  REQUIRE(h.ops->start(h.self) == HAP_OK);
  REQUIRE(await_status(&h, HAP_OK));
  hapi_device_explain(h.ops, h.self, &detail);
  CHECK(detail.text[0] == '\0');
  REQUIRE(emulated_tell(&machine, "silent 1 1"));
  CHECK(await_status(&h, HAP_ERROR_DEVICE));
  CHECK(status_explains(&h, "no whole answer"));
  REQUIRE(emulated_tell(&machine, "silent 1 0"));
  CHECK(await_status(&h, HAP_OK));
  h.ops->stop(h.self);
  hap_device_close(h.device);
}

/* N, of every string of one of two boards. */
static bool board_pull(int port, int board, double tension)
{
  const hapi_spidar_model *model = hapi_spidar_model_find("x4r");
  hapi_spidar_frame frame = {.board = (uint8_t)board, .command = HAPI_SPIDAR_CURRENT};
  uint8_t bytes[HAPI_SPIDAR_FRAME_MAX + 28] = {0};
  for (int i = 0; i < 4; ++i) {
    frame.current[i] = (int16_t)(tension * model->volts_per_newton[4 * board + i] * 4096.0 / 3.3);
  }
  int count = hapi_spidar_encode(&frame, 5, HAPI_SPIDAR_TO_BOARD, bytes) + 28;
  return write(port, bytes, (size_t)count) == count;
}

/* Currents of one of two boards are a force; those of both are none. While the emulator stands
 * still, the second command is on the line all the same, as with boards of metal. */
TEST(an_emulator_that_was_held_up_catches_up)
{
  double place[3];
  int port = open(machine.port, O_RDWR | O_NOCTTY | O_CLOEXEC);
  REQUIRE(port >= 0);
  CHECK(board_pull(port, 0, 2.0) && emulated_await(&machine, false));
  CHECK(kill(machine.pid, SIGSTOP) == 0);
  CHECK(board_pull(port, 1, 2.0));
  emulated_sleep(0.3);
  CHECK(kill(machine.pid, SIGCONT) == 0);
  REQUIRE(emulated_state(&machine, "position", place, 3));
  /* The lower strings alone would pull it by some 30 mm, and the hand is not back so soon. */
  CHECK_SAY(hapi_v3_norm(place) < 0.01, "%g mm off", 1e3 * hapi_v3_norm(place));
  CHECK(board_pull(port, 0, 0.0) && board_pull(port, 1, 0.0) && emulated_await(&machine, true));
  close(port);
}

/* Each way by itself: a device that reads and writes would be told by either. */
TEST(a_port_that_was_hung_up_fails_to_read_and_to_write)
{
  hapi_spidar_serial serial;
  hapi_spidar_port port;
  hap_detail detail = {""};
  char name[64];
  uint8_t byte = 0;
  int master = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
  REQUIRE(master >= 0 && grantpt(master) == 0 && unlockpt(master) == 0 &&
          ptsname_r(master, name, sizeof name) == 0);
  REQUIRE(hapi_spidar_serial_init(&serial, &detail) == HAP_OK);
  REQUIRE(hapi_spidar_serial_open(&serial, name, &detail) == HAP_OK);
  hapi_spidar_serial_port(&serial, &port);
  CHECK(port.receive(port.self, &byte, 1) == 0 && port.send(port.self, &byte, 1) == 0);
  close(master);
  CHECK(port.receive(port.self, &byte, 1) == -EIO);
  CHECK(port.send(port.self, &byte, 1) == -EIO);
  hapi_spidar_serial_finish(&serial);
}

TEST(a_cable_is_pulled_and_put_in_again)
{
  hands h;
  hap_detail detail = {""};
  char line[128];
  REQUIRE(open_device(&h, ",timeout=5", &detail));
  REQUIRE(h.ops->start(h.self) == HAP_OK);
  CHECK(hands_push(&h, 1.0, 20) == HAP_OK);
  REQUIRE(emulated_tell(&machine, "unplug"));
  CHECK(await_status(&h, HAP_ERROR_DEVICE));
  CHECK(status_explains(&h, "cable"));
  CHECK(hands_push(&h, 1.0, 1) == HAP_ERROR_DEVICE);
  h.ops->stop(h.self);
  CHECK(h.ops->start(h.self) == HAP_ERROR_DEVICE);
  CHECK(status_explains(&h, "does not open"));
  CHECK(read_once(&h) == HAP_ERROR_STATE);
  REQUIRE(emulated_tell(&machine, "plug"));
  REQUIRE(emulated_line(&machine, "port: ", line, sizeof line));
  CHECK(h.ops->start(h.self) == HAP_OK);
  CHECK(hands_push(&h, 1.0, 20) == HAP_OK);
  h.ops->stop(h.self);
  CHECK(emulated_await(&machine, true));
  hap_device_close(h.device);
}

/* ---- the guard ---- */

static hapi_spidar_pulse *pulse_of(const hands *h)
{
  return ((hapi_spidar_device *)h->self)->guard.pulse;
}

/* Ends as the process that drives the device ends. */
static void die_with_force(int number)
{
  pid_t child = fork();
  if (child == 0) {
    hands h;
    hap_detail detail = {""};
    if (!open_device(&h, ",timeout=10", &detail) || h.ops->start(h.self) < HAP_OK) {
      _exit(1);
    }
    for (;;) {
      (void)hands_push(&h, 3.0, 100);
    }
  }
  CHECK(emulated_await(&machine, false));
  emulated_sleep(0.5); /* beyond start, whose tensions are currents, too */
  CHECK(!emulated_is_limp(&machine));
  CHECK(kill(child, number) == 0);
  int status = 0;
  CHECK(waitpid(child, &status, 0) == child && WIFSIGNALED(status) && WTERMSIG(status) == number);
  CHECK(emulated_await(&machine, true));
}

/* The watchdog of the library takes the force off in 50 ms. Who is not asked gets a guard that is
 * slower by far, so that it leaves a living program alone, and that nobody has to wait for. */
TEST(without_a_stall_that_is_set_the_guard_waits_for_less_than_a_second)
{
  hands h;
  hap_detail detail = {""};
  REQUIRE(open_device(&h, "", &detail));
  double stall = ((const hapi_spidar_device *)h.self)->settings.stall;
  CHECK_SAY(stall >= 5.0 * 0.05 && stall <= 1.0, "%g s", stall);
  hap_device_close(h.device);
}

/* Ends with its force on, and the first zeros of the guard lose a byte. */
TEST(a_zero_that_loses_a_byte_is_sent_again)
{
  char command[64];
  int status = 0;
  pid_t child = fork();
  if (child == 0) {
    hands h;
    hap_detail detail = {""};
    if (!open_device(&h, ",timeout=10,stall=30", &detail) || h.ops->start(h.self) < HAP_OK) {
      _exit(1);
    }
    for (;;) {
      (void)hands_push(&h, 3.0, 100);
    }
  }
  CHECK(emulated_await(&machine, false));
  emulated_sleep(0.7); /* beyond start */
  CHECK(kill(child, SIGSTOP) == 0);
  emulated_sleep(0.1);
  /* After the flush and the zeros before it: in the currents of the first board. */
  snprintf(command, sizeof command, "lose command %d",
           HAPI_SPIDAR_FRAME_MAX + HAPI_SPIDAR_ZEROS_BEFORE + 1);
  REQUIRE(emulated_tell(&machine, command));
  CHECK(!emulated_is_limp(&machine));
  CHECK(kill(child, SIGKILL) == 0 && waitpid(child, &status, 0) == child);
  CHECK(emulated_await(&machine, true));
}

TEST(a_guard_is_deaf_to_signals_meant_for_the_program)
{
  static const int signals[] = {SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGUSR1, SIGPIPE, SIGALRM};
  hands h;
  hap_detail detail = {""};
  REQUIRE(open_device(&h, ",timeout=5,stall=10", &detail));
  REQUIRE(h.ops->start(h.self) == HAP_OK);
  pid_t guard = (pid_t)atomic_load(&pulse_of(&h)->guard);
  CHECK(getsid(guard) == guard && guard > 0); /* of no terminal */
  for (size_t i = 0; i < sizeof signals / sizeof signals[0]; ++i) {
    CHECK(kill(guard, signals[i]) == 0);
  }
  CHECK(hands_push(&h, 1.0, 100) == HAP_OK);
  hap_device_close(h.device);
  CHECK(emulated_await(&machine, true));
}

TEST(a_process_that_is_killed_leaves_no_force)
{
  die_with_force(SIGKILL);
  die_with_force(SIGTERM);
  hands h;
  hap_detail detail = {""};
  CHECK(open_device(&h, "", &detail)); /* the guard has let go of the port */
  hap_device_close(h.device);
}

TEST(a_loop_that_hangs_leaves_no_force)
{
  hands h;
  hap_detail detail = {""};
  REQUIRE(open_device(&h, ",timeout=5,stall=0.4", &detail));
  REQUIRE(h.ops->start(h.self) == HAP_OK);
  CHECK(hands_push(&h, 3.0, 50) == HAP_OK);
  CHECK(emulated_await(&machine, true)); /* nobody wrote in the meantime */
  CHECK(hands_push(&h, 3.0, 1) == HAP_ERROR_DEVICE);
  CHECK(status_explains(&h, "guard"));
  CHECK(emulated_is_limp(&machine));
  h.ops->stop(h.self);
  CHECK(h.ops->start(h.self) == HAP_OK);
  CHECK(hands_push(&h, 1.0, 10) == HAP_OK);
  hap_device_close(h.device);
  CHECK(emulated_await(&machine, true));
}

static char logged[600]; /* newest warning */

static void log_keep(hap_log_level level, const char *text, void *user)
{
  (void)level;
  (void)user;
  snprintf(logged, sizeof logged, "%s", text);
}

/* Times and counts of the guard process are in docs/safety.md. */
TEST(no_guard_constant_changes_unnoticed)
{
  CHECK(HAPI_SAFETY_GUARD_LOOK_S == 0.02 && HAPI_SAFETY_GUARD_STALL_S == 0.5);
  CHECK(HAPI_SAFETY_GUARD_ROUNDS == 4 && HAPI_SAFETY_GUARD_WAIT_S == 600.0);
}

TEST(no_guard_no_force)
{
  hands h;
  hap_detail detail = {""};
  struct rlimit before;
  REQUIRE(open_device(&h, ",timeout=5", &detail));
  REQUIRE(getrlimit(RLIMIT_NOFILE, &before) == 0);
  int next = open("/dev/null", O_RDONLY | O_CLOEXEC);
  close(next);
  const struct rlimit none = {(rlim_t)next, before.rlim_max};
  REQUIRE(setrlimit(RLIMIT_NOFILE, &none) == 0);
  hap_status status = h.ops->start(h.self);
  REQUIRE(setrlimit(RLIMIT_NOFILE, &before) == 0);
  CHECK(status == HAP_ERROR_DEVICE);
  CHECK(status_explains(&h, "guard process") && status_explains(&h, "stall=0"));
  CHECK(status_explains(&h, strerror(EMFILE)));
  CHECK(read_once(&h) == HAP_ERROR_STATE && emulated_is_limp(&machine));
  CHECK(h.ops->start(h.self) == HAP_OK && hands_push(&h, 1.0, 5) == HAP_OK);
  hap_device_close(h.device);
  logged[0] = '\0';
  REQUIRE(open_device(&h, ",timeout=5,stall=0", &detail));
  CHECK(h.ops->start(h.self) == HAP_OK && hands_push(&h, 1.0, 5) == HAP_OK);
  CHECK(strstr(logged, "no guard process") != NULL);
  hap_device_close(h.device);
  CHECK(emulated_await(&machine, true));
}

/* The limit on processes holds for users other than root. */
TEST(a_fork_that_fails_is_no_guard)
{
  if (geteuid() != 0) {
    SKIP("only root can become another user");
  }
  pid_t child = fork();
  if (child == 0) {
    hands h;
    hap_detail detail = {""};
    const struct rlimit none = {0, 0};
    bool good = open_device(&h, ",timeout=5", &detail) && setrlimit(RLIMIT_NPROC, &none) == 0 &&
                setresuid(65534, 65534, 65534) == 0 && h.ops->start(h.self) == HAP_ERROR_DEVICE &&
                status_explains(&h, "guard process");
    _exit(good ? 0 : 1);
  }
  int status = 0;
  CHECK(waitpid(child, &status, 0) == child && WIFEXITED(status) && WEXITSTATUS(status) == 0);
  CHECK(emulated_is_limp(&machine));
}

TEST(a_guard_that_is_killed_is_a_fault)
{
  hands h;
  hap_detail detail = {""};
  int ticks = 0;
  REQUIRE(open_device(&h, ",timeout=5,stall=10", &detail));
  REQUIRE(h.ops->start(h.self) == HAP_OK);
  CHECK(hands_push(&h, 3.0, 50) == HAP_OK);
  double begin = emulated_clock();
  REQUIRE(kill((pid_t)atomic_load(&pulse_of(&h)->guard), SIGKILL) == 0);
  while (ticks < 2000 && hands_push(&h, 3.0, 1) == HAP_OK) {
    ++ticks;
  }
  h.ops->zero(h.self); /* as the session does at once */
  CHECK(emulated_await(&machine, true));
  printf("# %d ticks until it was noticed, zero after %.0f ms\n", ticks,
         1e3 * (emulated_clock() - begin));
  CHECK(ticks < 200); /* 1 or 2, where the machine does nothing else */
  CHECK(status_explains(&h, "guard process") && status_explains(&h, "was it killed"));
  CHECK(hands_push(&h, 3.0, 1) == HAP_ERROR_DEVICE && emulated_is_limp(&machine));
  h.ops->stop(h.self);
  CHECK(h.ops->start(h.self) == HAP_OK && hands_push(&h, 1.0, 5) == HAP_OK); /* a new one */
  hap_device_close(h.device);
  CHECK(emulated_await(&machine, true));
}

static void plug_in(void)
{
  char line[128];
  REQUIRE(emulated_tell(&machine, "plug"));
  REQUIRE(emulated_line(&machine, "port: ", line, sizeof line));
}

/* Pulled while it holds a force, which it keeps. */
static void cable_pull(hands *h)
{
  hap_detail detail = {""};
  REQUIRE(open_device(h, ",timeout=5,stall=10", &detail));
  REQUIRE(h->ops->start(h->self) == HAP_OK);
  CHECK(hands_push(h, 3.0, 50) == HAP_OK);
  REQUIRE(emulated_tell(&machine, "unplug"));
  CHECK(await_status(h, HAP_ERROR_DEVICE));
  h->ops->zero(h->self);
  emulated_sleep(0.1);
  CHECK(!emulated_is_limp(&machine));
}

static int rescues_told;

static void rescue_hear(hap_log_level level, const char *text, void *user)
{
  (void)user;
  rescues_told += level == HAP_LOG_WARNING && strstr(text, "came back") != NULL;
}

TEST(boards_whose_cable_is_in_again_are_zeroed_by_the_guard)
{
  hands h;
  hap_hooks hooks;
  hap_hooks_init(&hooks, sizeof hooks);
  hooks.log = rescue_hear;
  REQUIRE(hap_hooks_set(&hooks) == HAP_OK);
  cable_pull(&h); /* nobody does anything about it */
  plug_in();
  CHECK(emulated_await(&machine, true));
  for (int i = 0; i < 2000 && !atomic_load(&pulse_of(&h)->rescued); ++i) {
    emulated_sleep(1e-3); /* it sends zeros several times */
  }
  CHECK(status_explains(&h, "came back"));
  h.ops->stop(h.self);
  CHECK(rescues_told == 0);
  CHECK(h.ops->start(h.self) == HAP_OK && hands_push(&h, 1.0, 5) == HAP_OK);
  CHECK(rescues_told == 1 && !atomic_load(&pulse_of(&h)->rescued));
  REQUIRE(hap_hooks_set(NULL) == HAP_OK);
  hap_device_close(h.device);
  CHECK(emulated_await(&machine, true));
}

TEST(boards_are_zeroed_when_the_program_has_ended_before)
{
  hands h;
  cable_pull(&h);
  h.ops->stop(h.self);
  hap_device_close(h.device);
  plug_in();
  CHECK(emulated_await(&machine, true));
}

TEST(boards_are_zeroed_when_the_program_was_killed_before)
{
  pid_t child = fork();
  if (child == 0) {
    hands h;
    cable_pull(&h);
    _exit(tap_failures);
  }
  int status = 0;
  CHECK(waitpid(child, &status, 0) == child && WIFEXITED(status) && WEXITSTATUS(status) == 0);
  CHECK(!emulated_is_limp(&machine));
  plug_in();
  CHECK(emulated_await(&machine, true));
}

TEST(other_boards_behind_the_same_name_are_left_alone)
{
  hands h;
  hap_detail detail = {""};
  cable_pull(&h);
  REQUIRE(emulated_tell(&machine, "report 0 B3F"));
  plug_in();
  emulated_sleep(1.5);
  CHECK(!emulated_is_limp(&machine) && !atomic_load(&pulse_of(&h)->rescued));
  REQUIRE(emulated_tell(&machine, "report 0 B3M"));
  h.ops->stop(h.self);
  hap_device_close(h.device);
  CHECK(open_device(&h, "", &detail)); /* who opens it zeroes it */
  CHECK(emulated_await(&machine, true));
  hap_device_close(h.device);
}

/* ---- a whole session ---- */

#define SAMPLES 100
#define LEAST_N 2.0 /* that a sample is worth */

typedef struct felt {
  double most;           /* N, that was asked for */
  double force[SAMPLES]; /* share of what was asked that was given along it, in each sample */
  double torque[SAMPLES];
  double torque_most; /* N m, that was asked for */
  int samples;
} felt;

/* From the frame with z up to the makers'. */
static void to_makers(const double v[3], double out[3])
{
  out[0] = v[0];
  out[1] = v[2];
  out[2] = -v[1];
}

static double force_share(const double asked[3], const double given[3])
{
  double size2 = hapi_v3_dot(asked, asked);
  return size2 > 0.0 ? hapi_v3_dot(asked, given) / size2 : 0.0;
}

static int by_value(const void *a, const void *b)
{
  double x = *(const double *)a;
  double y = *(const double *)b;
  return (x > y) - (x < y);
}

/* The median: the two are not asked for at the same moment, and a thread that waits for a
 * processor in between spoils a sample, not the device. */
static double shares_middle(double shares[SAMPLES], int count)
{
  qsort(shares, (size_t)count, sizeof *shares, by_value);
  return count > 0 ? shares[count / 2] : 0.0;
}

/* The wrench on the hand against that of the strings, while the emulated hand pushes. */
static void forces_compare(rig *r, emulated *e, felt *out)
{
  hap_pointer_state state;
  double asked[2][3];
  double given[2][3];
  if (hap_pointer_get(r->session, r->pointers[0], &state, sizeof state) < HAP_OK ||
      !emulated_state(e, "force", given[0], 3) || !emulated_state(e, "torque", given[1], 3)) {
    return;
  }
  to_makers(state.wrench.force, asked[0]);
  to_makers(state.wrench.torque, asked[1]);
  out->most = fmax(out->most, hapi_v3_norm(asked[0]));
  out->torque_most = fmax(out->torque_most, hapi_v3_norm(asked[1]));
  if (hapi_v3_norm(asked[0]) > LEAST_N) {
    out->force[out->samples] = force_share(asked[0], given[0]);
    out->torque[out->samples++] = force_share(asked[1], given[1]);
  }
}

static bool begin_scene(const char *name, const char *port, rig *r)
{
  rig_options options;
  hap_detail detail = {""};
  char spec[300];
  snprintf(spec, sizeof spec, "spidar:%s,timeout=5,stall=10", port);
  rig_options_init(&options);
  options.scene = name;
  options.devices[0] = spec;
  options.device_count = 1;
  hap_status status = rig_create(&options, r, &detail);
  if (status < HAP_OK) {
    printf("# %s\n", detail.text);
    return false;
  }
  return hap_session_start(r->session) >= HAP_OK;
}

/* Until there are samples enough, or a fault. */
static hap_fault force_feel(rig *r, emulated *e, felt *seen)
{
  hap_stats stats;
  hap_detail detail = {""};
  double end = emulated_clock() + 100.0;
  memset(seen, 0, sizeof *seen);
  do {
    emulated_sleep(5e-3);
    forces_compare(r, e, seen);
    if (hap_session_stats(r->session, &stats, sizeof stats) < HAP_OK) {
      return HAP_FAULT_WORLD;
    }
    if (stats.faults.fault == HAP_FAULT_BLOCKED) { /* the machine, and not the device */
      (void)hap_session_reset_fault(r->session);
      stats.faults.fault = HAP_FAULT_NONE;
    }
  } while (seen->samples < SAMPLES && stats.faults.fault == HAP_FAULT_NONE &&
           emulated_clock() < end);
  if (stats.faults.fault != HAP_FAULT_NONE) {
    (void)hap_session_detail(r->session, &detail);
    printf("# %s\n", detail.text);
  }
  printf("# %d samples, at most %.2f N and %.4f N m asked; given of it %.3f and %.3f\n",
         seen->samples, seen->most, seen->torque_most, shares_middle(seen->force, seen->samples),
         shares_middle(seen->torque, seen->samples));
  return stats.faults.fault;
}

TEST(a_row_of_cubes_is_felt)
{
  rig r;
  felt seen;
  hap_stats stats;
  hap_detail detail = {""};
  REQUIRE(emulated_tell(&machine, "hand push"));
  dInitODE2(0);
  REQUIRE(begin_scene("row10", machine.port, &r));
  CHECK(force_feel(&r, &machine, &seen) == HAP_FAULT_NONE && seen.samples == SAMPLES);
  CHECK(seen.most > 3.0); /* ten cubes of 0.1 kg on mu 0.5 move at 4.9 N */
  CHECK_NEAR(seen.force[seen.samples / 2], 0.98, 0.08);
  REQUIRE(emulated_tell(&machine, "unplug"));
  double end = emulated_clock() + 20.0;
  do {
    emulated_sleep(5e-3);
    (void)hap_session_stats(r.session, &stats, sizeof stats);
  } while (stats.faults.fault == HAP_FAULT_NONE && emulated_clock() < end);
  CHECK(stats.faults.fault == HAP_FAULT_DEVICE_READ ||
        stats.faults.fault == HAP_FAULT_DEVICE_WRITE);
  CHECK(hap_session_detail(r.session, &detail) == HAP_OK && strstr(detail.text, "cable") != NULL);
  CHECK(hap_pointer_restart(r.session, r.pointers[0]) < HAP_OK);
  CHECK(hap_session_detail(r.session, &detail) == HAP_OK && strstr(detail.text, "open") != NULL);
  hap_session_stop(r.session);
  rig_destroy(&r);
  dCloseODE();
}

/* Down onto the lever as its own hand does it, turning along with it; the makers' y is up and
 * their z towards the user. */
TEST(a_tool_that_turns_a_lever_is_felt)
{
  static const char *const arguments[] = {
      "--hand", "push",
      "--fifo", "40",
      "--path", "0:0/0/0;1.5:0/0/0;3:-0.003/-0.04/0;5:-0.003/-0.04/0;6:0/0/0",
      "--turn", "0:0/0/0;1.5:0/0/0;3:0/0.01/-0.16;5:0/0.01/-0.16;6:0/0/0",
      NULL};
  emulated other;
  rig r;
  felt seen;
  REQUIRE(emulated_start(&other, arguments));
  dInitODE2(0);
  REQUIRE(begin_scene("lever", other.port, &r));
  CHECK(force_feel(&r, &other, &seen) == HAP_FAULT_NONE && seen.samples == SAMPLES);
  CHECK(seen.torque_most > 0.01);
  CHECK_NEAR(seen.force[seen.samples / 2], 0.98, 0.08);
  CHECK_NEAR(seen.torque[seen.samples / 2], 0.96, 0.12);
  hap_session_stop(r.session);
  rig_destroy(&r);
  dCloseODE();
  emulated_stop(&other);
}

/* hapode-run, told so, starts a device again whose cable was pulled. */
TEST(a_run_goes_on_when_the_cable_is_in_again)
{
  static const char *const arguments[] = {"--hand", "push", "--fifo", "40", NULL};
  emulated other;
  char command[600];
  char said[128];
  REQUIRE(emulated_start(&other, arguments));
  snprintf(said, sizeof said, "%s/out", other.folder);
  snprintf(command, sizeof command,
           "\"%s\" --scene row10 --seconds 8 --reconnect --device spidar:%s,timeout=5,stall=10 "
           ">%s 2>&1",
           getenv("HAPODE_RUN"), other.port, said);
  pid_t child = fork();
  if (child == 0) {
    int status = system(command);
    _exit(WIFEXITED(status) ? WEXITSTATUS(status) : 99);
  }
  CHECK(emulated_await(&other, false));
  emulated_sleep(1.0); /* beyond start */
  REQUIRE(emulated_tell(&other, "unplug 0.5"));
  int status = 0;
  CHECK(waitpid(child, &status, 0) == child && WIFEXITED(status) && WEXITSTATUS(status) == 0);
  snprintf(command, sizeof command,
           "grep -q 'a device was lost' %s && grep -q 'the device is back' %s", said, said);
  CHECK(system(command) == 0);
  CHECK(emulated_await(&other, true));
  unlink(said);
  emulated_stop(&other);
}

static void machine_stop(void)
{
  emulated_stop(&machine);
}

SET_UP
{
  static const char *const arguments[] = {"--hand", "hold", "--first-count", "32700", "--fifo",
                                          "40",     NULL};
  hap_hooks hooks;
  hap_hooks_init(&hooks, sizeof hooks);
  hooks.log = log_keep;
  (void)hap_hooks_set(&hooks);
  signal(SIGPIPE, SIG_IGN);
  tap_at_end(machine_stop);
  return emulated_start(&machine, arguments) ||
         tap_skip_all("no emulator, or no pseudo-terminal: set HAPODE_SPIDAR_EMULATOR");
}
