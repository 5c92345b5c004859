/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The second process of the SPIDAR, byte by byte: when it zeroes, how often, what does not end it,
 * and what it leaves alone. The port is a socket, whose other end this test reads. */

#include "tests/tap.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdint.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/clock.h"
#include "plugins/spidar/guard.h"

#define ROUNDS_LEAST 3 /* of zeros: the line may lose a byte of one */
#define ZEROS 20
#define STALL_S 0.2
#define PATIENCE_MS 20000

typedef struct rig {
  hapi_spidar_guard guard;
  int port;
  int board; /* the other end of the port */
  uint8_t zeros[ZEROS];
} rig;

static void rig_end(void *self)
{
  rig *r = self;
  hapi_spidar_guard_finish(&r->guard);
  close(r->port);
  close(r->board);
}

/* The guard's process; 0: there is none. It is a child of this one, who reaps orphans. */
static pid_t guard_process(void)
{
  pid_t found = 0;
  DIR *folder = opendir("/proc");
  REQUIRE(folder != NULL);
  for (struct dirent *entry = readdir(folder); entry != NULL; entry = readdir(folder)) {
    char path[300];
    char name[40] = "";
    char state = 'Z';
    int parent = 0;
    snprintf(path, sizeof path, "/proc/%.100s/stat", entry->d_name);
    FILE *file = fopen(path, "r");
    if (file != NULL && fscanf(file, "%*d (%39[^)]) %c %d", name, &state, &parent) == 3 &&
        parent == (int)getpid() && state != 'Z' && strcmp(name, "spidar-guard") == 0) {
      found = (pid_t)atoi(entry->d_name);
    }
    if (file != NULL) {
      fclose(file);
    }
  }
  closedir(folder);
  return found;
}

/* Those of earlier tests end on their own, and must not be taken for the next one. */
static bool guards_have_ended(void)
{
  for (int ms = 0; ms < PATIENCE_MS && guard_process() != 0; ms += 5) {
    hapi_clock_sleep_until(hapi_clock_now() + 5000000);
  }
  return guard_process() == 0;
}

static rig *rig_new(void)
{
  int ends[2];
  REQUIRE(guards_have_ended());
  rig *r = tap_own(sizeof *r, rig_end);
  REQUIRE(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) == 0);
  r->port = ends[0];
  r->board = ends[1];
  for (int i = 0; i < ZEROS; ++i) {
    r->zeros[i] = (uint8_t)(0x40 + i);
  }
  REQUIRE(hapi_spidar_guard_init(&r->guard));
  return r;
}

static bool rig_start_at(rig *r, const char *path, double stall_s)
{
  static const hapi_spidar_identity unknown = {.usb = false};
  static const hapi_spidar_boards boards = {.count = 0};
  const hapi_spidar_guard_def def = {.port = r->port,
                                     .path = path,
                                     .identity = &unknown,
                                     .boards = &boards,
                                     .zeros = r->zeros,
                                     .zero_count = ZEROS,
                                     .stall_s = stall_s};
  return hapi_spidar_guard_start(&r->guard, &def);
}

static bool rig_start(rig *r, double stall_s)
{
  return rig_start_at(r, "/no/such/port", stall_s);
}

/* Whole rounds of zeros that come until nothing has come for quiet_ms, or the port is closed. */
static int rounds_read(int board, const uint8_t *zeros, int first_ms, int quiet_ms)
{
  uint8_t bytes[4096];
  int used = 0;
  int rounds = 0;
  struct pollfd ready = {board, POLLIN, 0};
  while (used < (int)sizeof bytes && poll(&ready, 1, used == 0 ? first_ms : quiet_ms) > 0) {
    ssize_t count = read(board, bytes + used, sizeof bytes - (size_t)used);
    if (count <= 0) {
      break;
    }
    used += (int)count;
  }
  for (int i = 0; i + ZEROS <= used; ++i) {
    rounds += memcmp(bytes + i, zeros, ZEROS) == 0;
  }
  /* Before the first one zeros end a command that went out in part. */
  CHECK(rounds == 0 || (used == HAPI_SPIDAR_FRAME_MAX + rounds * ZEROS && bytes[0] == 0 &&
                        memcmp(bytes + HAPI_SPIDAR_FRAME_MAX, zeros, ZEROS) == 0));
  return rounds;
}

static bool is_quiet(const rig *r, int ms)
{
  struct pollfd ready = {r->board, POLLIN, 0};
  return poll(&ready, 1, ms) == 0;
}

static pid_t guard_await(void)
{
  pid_t found = 0;
  for (int ms = 0; ms < PATIENCE_MS && found == 0; ms += 5) {
    found = guard_process();
    hapi_clock_sleep_until(hapi_clock_now() + 5000000);
  }
  return found;
}

static bool guard_ends(pid_t guard)
{
  int end = 0;
  for (int ms = 0; ms < PATIENCE_MS; ms += 5) {
    if (waitpid(guard, &end, WNOHANG) == guard) {
      return true;
    }
    hapi_clock_sleep_until(hapi_clock_now() + 5000000);
  }
  return false;
}

TEST(an_orderly_end_sends_nothing)
{
  rig *r = rig_new();
  REQUIRE(rig_start(r, STALL_S));
  pid_t guard = guard_await();
  REQUIRE(guard > 0);
  hapi_spidar_guard_end(&r->guard, true);
  CHECK(r->guard.channel < 0);
  CHECK(guard_ends(guard));
  CHECK(is_quiet(r, 50));
  hapi_spidar_guard_end(&r->guard, true); /* again: nothing */
}

TEST(a_loop_that_stands_still_while_it_pulls_is_zeroed_several_times)
{
  rig *r = rig_new();
  REQUIRE(rig_start(r, STALL_S));
  CHECK(is_quiet(r, (int)(4.0 * STALL_S * 1000.0))); /* no force, no stall */
  CHECK(!atomic_load(&r->guard.pulse->stalled));
  atomic_store(&r->guard.pulse->pulling, true);
  for (int i = 0; i < 40; ++i) { /* it beats */
    atomic_fetch_add(&r->guard.pulse->beats, 1);
    hapi_clock_sleep_until(hapi_clock_now() + 10000000);
  }
  CHECK(!atomic_load(&r->guard.pulse->stalled) && is_quiet(r, 0));
  int64_t begin = hapi_clock_now();
  CHECK(rounds_read(r->board, r->zeros, PATIENCE_MS, 300) >= ROUNDS_LEAST);
  CHECK(atomic_load(&r->guard.pulse->stalled));
  CHECK(hapi_clock_now() - begin > (int64_t)(0.5e9 * STALL_S)); /* not at once */
  REQUIRE(rig_start(r, STALL_S)); /* a new one knows nothing of that */
  CHECK(!atomic_load(&r->guard.pulse->stalled) && !atomic_load(&r->guard.pulse->pulling));
  CHECK(is_quiet(r, 100));
}

/* A process that drives a device dies in each of these ways. */
static void driver_dies(rig *r, int number)
{
  pid_t driver = fork();
  REQUIRE(driver >= 0);
  if (driver == 0) {
    if (!rig_start(r, 100.0)) {
      _exit(1);
    }
    if (number == 0) {
      _exit(0);
    }
    (void)raise(number);
    for (;;) {
      pause();
    }
  }
  close(r->port); /* the guard alone has it then */
  r->port = open("/dev/null", O_RDWR | O_CLOEXEC);
  CHECK(rounds_read(r->board, r->zeros, PATIENCE_MS, 1000) >= ROUNDS_LEAST);
  CHECK(waitpid(driver, NULL, 0) == driver);
  char byte = 0;
  CHECK(read(r->board, &byte, 1) == 0); /* it has let go of the port */
}

TEST(a_driver_that_dies_is_zeroed_several_times)
{
  static const int ways[] = {0, SIGKILL, SIGTERM, SIGINT};
  for (size_t i = 0; i < sizeof ways / sizeof ways[0]; ++i) {
    driver_dies(rig_new(), ways[i]);
  }
}

/* Ctrl-C, a closed terminal and others are meant for the program. */
TEST(signals_for_the_program_do_not_end_it)
{
  static const int numbers[] = {SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGPIPE, SIGUSR1, SIGALRM};
  rig *r = rig_new();
  REQUIRE(rig_start(r, STALL_S));
  pid_t guard = guard_await();
  REQUIRE(guard > 0);
  for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; ++i) {
    CHECK(kill(guard, numbers[i]) == 0);
  }
  hapi_clock_sleep_until(hapi_clock_now() + 100000000);
  CHECK(waitpid(guard, NULL, WNOHANG) == 0);
  CHECK(getsid(guard) != getsid(0)); /* nor those of a terminal's group */
  atomic_store(&r->guard.pulse->pulling, true);
  CHECK(rounds_read(r->board, r->zeros, PATIENCE_MS, 300) >= ROUNDS_LEAST);
  hapi_spidar_guard_end(&r->guard, true);
  CHECK(guard_ends(guard));
}

static int descriptors_of(pid_t process)
{
  char path[60];
  int count = 0;
  snprintf(path, sizeof path, "/proc/%d/fd", (int)process);
  DIR *folder = opendir(path);
  for (struct dirent *entry = folder != NULL ? readdir(folder) : NULL; entry != NULL;
       entry = readdir(folder)) {
    count += entry->d_name[0] != '.';
  }
  if (folder != NULL) {
    closedir(folder);
  }
  return count;
}

static int descriptors_await(pid_t process, int most)
{
  int count = 0;
  for (int ms = 0; ms < PATIENCE_MS; ms += 5) {
    count = descriptors_of(process);
    if (count <= most) {
      break;
    }
    hapi_clock_sleep_until(hapi_clock_now() + 5000000);
  }
  return count;
}

TEST(it_keeps_nothing_else_of_the_program_open)
{
  int many[20];
  rig *r = rig_new();
  for (int i = 0; i < 20; ++i) {
    many[i] = open("/dev/null", O_RDONLY);
  }
  REQUIRE(rig_start(r, STALL_S));
  pid_t guard = guard_await();
  REQUIRE(guard > 0);
  int told = isatty(STDERR_FILENO) ? 1 : 0; /* where it says what it did */
  int kept = descriptors_await(guard, 3 + told) - told;
  CHECK(kept == 2 || kept == 3); /* port, channel, and the parent where the kernel has that */
  for (int i = 0; i < 20; ++i) {
    close(many[i]);
  }
  int before = descriptors_of(getpid());
  hapi_spidar_guard_end(&r->guard, true);
  CHECK(descriptors_of(getpid()) == before - 1);
  CHECK(guard_ends(guard));
}

/* Its name is the next one's, and that may be a person's shell. */
TEST(a_pseudo_terminal_is_not_waited_for)
{
  static const char *const paths[] = {"/no/such/port", "/dev/pts/1000000"};
  for (int i = 0; i < 2; ++i) {
    rig *r = rig_new();
    REQUIRE(rig_start_at(r, paths[i], STALL_S));
    pid_t guard = guard_await();
    REQUIRE(guard > 0);
    close(r->board); /* the other end of the port is gone */
    r->board = open("/dev/null", O_RDWR | O_CLOEXEC);
    hapi_spidar_guard_end(&r->guard, false);
    hapi_clock_sleep_until(hapi_clock_now() + 300000000);
    bool waits = waitpid(guard, NULL, WNOHANG) == 0;
    CHECK(waits == (i == 0));
    if (waits) {
      kill(guard, SIGKILL);
      CHECK(waitpid(guard, NULL, 0) == guard);
    }
  }
}

TEST(no_process_no_guard)
{
  rig *r = rig_new();
  struct rlimit none;
  REQUIRE(getrlimit(RLIMIT_NOFILE, &none) == 0);
  struct rlimit few = {3, none.rlim_max};
  REQUIRE(setrlimit(RLIMIT_NOFILE, &few) == 0);
  CHECK(!rig_start(r, STALL_S)); /* no channel */
  CHECK(r->guard.channel < 0);
  REQUIRE(setrlimit(RLIMIT_NOFILE, &none) == 0);
  CHECK(rig_start(r, STALL_S));
}

SET_UP
{
  return prctl(PR_SET_CHILD_SUBREAPER, 1) == 0 || tap_skip_all("orphans cannot be reaped here");
}
