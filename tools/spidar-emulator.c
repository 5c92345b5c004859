/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A SPIDAR behind a pseudo-terminal, in real time: spidar-emulator/emulator.h with a port and a
 * clock. */

#include <errno.h>
#include <fcntl.h>
#include <getopt.h>
#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include "base/number.h"
#include "base/regular.h"
#include "tools/spidar-emulator/emulator.h"

#define WAKE_LEAST_S 20e-6
#define WAKE_MOST_S 1e-3
#define BEHIND_MOST_S 1.0 /* more, and the machine was asleep: simulated time stands still for it */
#define SLICE_S 1e-3      /* of the time that it is behind */
#define SAY_MAX 1024
#define AHEAD_S \
  1e-3 /* that bytes may wait for the line: as with a port, the host notices the rest */
#define READ_MOST 256
#define PACKET_S \
  300e-6 /* no adapter hands on bytes one by one; its latency timer is 1 ms at best */

typedef struct program {
  emulator emulator;
  hapi_spidar_model model;
  int master; /* < 0: pulled out */
  int slave;  /* kept open, so that a host may come and go */
  const char *link;
  const char *script;
  double start;  /* s, of the clock, at simulated time 0 */
  double packet; /* s, for which replies are collected: each write wakes a thread of the kernel */
  char line[256];
  size_t line_used;
  bool input; /* stdin may say more */
} program;

static volatile sig_atomic_t stop_wanted;

static void want_stop(int number)
{
  (void)number;
  stop_wanted = 1;
}

static double clock_now(void)
{
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static int usage_complain(const char *text)
{
  fprintf(stderr, "spidar-emulator: %s\n", text);
  return 2;
}

/* ---- the port ---- */

static void renew_link(const char *link, const char *name)
{
  if (link != NULL && ((unlink(link) != 0 && errno != ENOENT) || symlink(name, link) != 0)) {
    fprintf(stderr, "spidar-emulator: %s: %s\n", link, strerror(errno));
  }
}

static bool plug_in(program *p)
{
  char name[64];
  struct termios raw;
  p->master = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (p->master < 0 || grantpt(p->master) != 0 || unlockpt(p->master) != 0 ||
      ptsname_r(p->master, name, sizeof name) != 0) {
    return false;
  }
  p->slave = open(name, O_RDWR | O_NOCTTY | O_CLOEXEC);
  if (p->slave < 0 || tcgetattr(p->slave, &raw) != 0) {
    return false;
  }
  cfmakeraw(&raw);
  (void)tcsetattr(p->slave, TCSANOW, &raw);
  renew_link(p->link, name);
  printf("port: %s\n", name);
  return fflush(stdout) == 0;
}

static void pull_out(program *p)
{
  if (p->master >= 0) {
    close(p->slave);
    close(p->master);
    p->master = p->slave = -1;
    if (p->link != NULL) {
      (void)unlink(p->link);
    }
  }
}

static bool follow_plug(program *p)
{
  if (p->emulator.plugged && p->master < 0) {
    return plug_in(p);
  }
  if (!p->emulator.plugged) {
    pull_out(p);
  }
  return true;
}

static bool may_read(const program *p, double now)
{
  return p->master >= 0 && p->emulator.wire.free < now + AHEAD_S;
}

static void bytes_exchange(program *p, double now)
{
  uint8_t bytes[4096];
  if (p->master < 0) {
    return;
  }
  ssize_t count = may_read(p, now) ? read(p->master, bytes, READ_MOST) : 0;
  if (count > 0) {
    emulator_write(&p->emulator, bytes, (int)count, now);
  }
  bool whole = wire_packet(&p->emulator.wire, p->packet) <= now;
  int replies = whole ? emulator_read(&p->emulator, now, bytes, sizeof bytes) : 0;
  if (replies > 0) {
    (void)!write(p->master, bytes, (size_t)replies); /* nobody reads: lost, as on a line */
  }
}

/* ---- commands ---- */

static void command_obey(program *p, const char *line)
{
  emulator_action action;
  hap_detail detail = {""};
  char text[SAY_MAX];
  if (emulator_parse(&p->emulator, line, &action, &detail) < HAP_OK) {
    printf("error %s\n", detail.text);
    return;
  }
  emulator_do(&p->emulator, &action);
  if (action.kind == EMULATOR_STATE) {
    emulator_say(&p->emulator, text, sizeof text);
    puts(text);
  }
  stop_wanted = stop_wanted || action.kind == EMULATOR_QUIT;
}

/* Whole lines of what has come; what is longer than a line may be is an error of its own. */
static void read_commands(program *p)
{
  char *free = p->line + p->line_used;
  ssize_t count = read(STDIN_FILENO, free, sizeof p->line - 1 - p->line_used);
  if (count <= 0) {
    p->input = count < 0 && (errno == EINTR || errno == EAGAIN);
    return;
  }
  p->line_used += (size_t)count;
  p->line[p->line_used] = '\0';
  char *at = p->line;
  for (char *end; (end = strchr(at, '\n')) != NULL; at = end + 1) {
    *end = '\0';
    if (at[strspn(at, " \t\r")] != '\0') {
      command_obey(p, at);
    }
  }
  p->line_used = strlen(at);
  memmove(p->line, at, p->line_used + 1);
  if (p->line_used == sizeof p->line - 1) {
    p->line_used = 0;
    puts("error the line is too long");
  }
  (void)fflush(stdout);
}

static bool load_script(program *p)
{
  char line[256];
  hap_detail detail = {""};
  int number = 0;
  bool good = true;
  if (p->script == NULL) {
    return true;
  }
  const char *why = NULL;
  FILE *file = hapi_regular_open(p->script, &why);
  if (file == NULL) {
    fprintf(stderr, "spidar-emulator: %s: %s\n", p->script, why);
    return false;
  }
  while (good && fgets(line, sizeof line, file) != NULL) {
    ++number;
    line[strcspn(line, "\n")] = '\0';
    good = emulator_plan_line(&p->emulator, line, &detail) >= HAP_OK;
  }
  if (!good) {
    fprintf(stderr, "spidar-emulator: %s, line %d: %s\n", p->script, number, detail.text);
  }
  fclose(file);
  return good;
}

/* ---- the loop ---- */

static void bytes_await(program *p, double now)
{
  double next = wire_packet(&p->emulator.wire, p->packet);
  double wait = next >= 0.0 && next - now < WAKE_MOST_S ? next - now : WAKE_MOST_S;
  wait = wait > WAKE_LEAST_S ? wait : WAKE_LEAST_S;
  const struct timespec timeout = {0, (long)(1e9 * wait)};
  struct pollfd files[2] = {{may_read(p, now) ? p->master : -1, POLLIN, 0},
                            {p->input ? STDIN_FILENO : -1, POLLIN, 0}};
  if (ppoll(files, 2, &timeout, NULL) > 0 && files[1].revents != 0) {
    read_commands(p);
  }
}

/* What has been waiting in the port is on the line at once, and boards go on while this process is
 * held up: else half of a cycle of commands would stay until it is awake. */
static void program_catch_up(program *p, double now)
{
  while (emulator_time(&p->emulator) + SLICE_S < now) {
    double next = emulator_time(&p->emulator) + SLICE_S;
    emulator_advance(&p->emulator, next);
    bytes_exchange(p, next);
  }
}

static int program_run(program *p)
{
  p->start = clock_now();
  while (stop_wanted == 0) {
    double now = clock_now() - p->start;
    double behind = now - emulator_time(&p->emulator);
    if (behind > BEHIND_MOST_S) {
      p->start += behind;
      now -= behind;
    }
    program_catch_up(p, now);
    emulator_advance(&p->emulator, now);
    if (!follow_plug(p)) {
      return usage_complain("no pseudo-terminal could be opened");
    }
    bytes_exchange(p, now);
    bytes_await(p, now);
  }
  pull_out(p);
  return 0;
}

/* ---- options ---- */

static void print_help(void)
{
  printf(
      "usage: spidar-emulator [OPTIONS]\n"
      "A SPIDAR with its boards and a hand, behind a pseudo-terminal whose name is the first line\n"
      "on stdout, \"port: /dev/pts/N\". Commands are read from stdin, a line each.\n\n"
      "  --model NAME        x4r (default), x4l, x5r, x5l, t1, or a geometry file\n"
      "  --boards LIST       such as B3M:0,B3M:1: model and id of each; default two B3M, or one\n"
      "                      B5M for x5r and x5l\n"
      "  --hand push|hold|none\n"
      "  --path T:x/y/z;...  of the hand, s and m from home, repeated\n"
      "  --turn T:x/y/z;...  of the hand, s and rotation vector in rad, repeated\n"
      "  --first-count N     of the encoders at power-on, default 0\n"
      "  --script FILE       lines \"SECONDS COMMAND\"\n"
      "  --link PATH         a symbolic link to the port, renewed when it is plugged in again\n"
      "  --packet SECONDS    for which replies are collected, as a USB adapter does; 0: byte by "
      "byte,\n"
      "                      default 0.0003\n"
      "  --fifo PRIORITY     SCHED_FIFO, 1 to 99\n\n"
      "commands:\n%s",
      emulator_help);
}

static bool read_model(const char *name, hapi_spidar_model *out)
{
  hap_detail detail = {""};
  const hapi_spidar_model *known = hapi_spidar_model_find(name);
  if (known != NULL) {
    *out = *known;
    return true;
  }
  if (hapi_spidar_model_read(name, out, &detail) < HAP_OK) {
    usage_complain(detail.text);
    return false;
  }
  return true;
}

static bool read_boards(const char *text, emulator_def *def)
{
  def->board_count = 0;
  for (const char *at = text; *at != '\0'; at += *at == ',') {
    size_t length = strcspn(at, ":,");
    double id = 0.0;
    int model = hapi_spidar_kind_number(at, length);
    if (at[length] != ':' || model == 0 || def->board_count == HAPI_SPIDAR_BOARDS) {
      return false;
    }
    const char *end = hapi_number_read(at + length + 1, &id);
    if (end == NULL || (*end != ',' && *end != '\0') || !(id >= 0.0 && id <= 7.0)) {
      return false;
    }
    def->board_model[def->board_count] = model;
    def->board_id[def->board_count++] = (int)id;
    at = end;
  }
  return def->board_count > 0;
}

static bool read_hand(const char *text, emulator_hand *out)
{
  static const char *const names[] = {"push", "hold", "none"};
  for (int i = 0; i < 3; ++i) {
    if (strcmp(text, names[i]) == 0) {
      *out = (emulator_hand)i;
      return true;
    }
  }
  return false;
}

static bool read_count(const char *text, double least, double most, int *out)
{
  double value = 0.0;
  const char *end = hapi_number_read(text, &value);
  *out = (int)value;
  return end != NULL && *end == '\0' && value >= least && value <= most;
}

static bool read_seconds(const char *text, double *out)
{
  const char *end = hapi_number_read(text, out);
  return end != NULL && *end == '\0' && *out >= 0.0 && *out <= 1.0;
}

static bool set_fifo(const char *text)
{
  int priority = 0;
  if (!read_count(text, 1.0, 99.0, &priority)) {
    return false;
  }
  const struct sched_param parameters = {.sched_priority = priority};
  if (sched_setscheduler(0, SCHED_FIFO, &parameters) != 0) {
    fprintf(stderr, "spidar-emulator: no SCHED_FIFO: %s\n", strerror(errno));
  }
  return true;
}

typedef struct choice {
  const char *model;
  const char *boards;
} choice;

static bool take_option(int option, program *p, emulator_def *def, choice *chosen)
{
  int count = 0;
  switch (option) {
    case 'm':
      chosen->model = optarg;
      return true;
    case 'b':
      chosen->boards = optarg;
      return true;
    case 'h':
      return read_hand(optarg, &def->hand);
    case 'p':
      def->path = optarg;
      return true;
    case 't':
      def->turn = optarg;
      return true;
    case 'c':
      if (!read_count(optarg, -1e6, 1e6, &count)) {
        return false;
      }
      def->first_count = count;
      return true;
    case 's':
      p->script = optarg;
      return true;
    case 'l':
      p->link = optarg;
      return true;
    case 'k':
      return read_seconds(optarg, &p->packet);
    case 'f':
      return set_fifo(optarg);
    default:
      return false;
  }
}

/* 0: go on; else the exit status plus one. */
static int read_options(int argc, char **argv, program *p, emulator_def *def)
{
  static const struct option options[] = {
      {"model", required_argument, NULL, 'm'},       {"boards", required_argument, NULL, 'b'},
      {"hand", required_argument, NULL, 'h'},        {"path", required_argument, NULL, 'p'},
      {"first-count", required_argument, NULL, 'c'}, {"script", required_argument, NULL, 's'},
      {"link", required_argument, NULL, 'l'},        {"fifo", required_argument, NULL, 'f'},
      {"packet", required_argument, NULL, 'k'},      {"turn", required_argument, NULL, 't'},
      {"help", no_argument, NULL, '?' + 256},        {NULL, 0, NULL, 0}};
  choice chosen = {"x4r", NULL};
  int option;
  while ((option = getopt_long(argc, argv, "", options, NULL)) != -1) {
    if (option == '?' + 256) {
      print_help();
      return 1;
    }
    if (!take_option(option, p, def, &chosen)) {
      return 1 + usage_complain("an option is wrong; see --help");
    }
  }
  if (optind < argc) {
    return 1 + usage_complain("it takes no arguments, only options; see --help");
  }
  if (!read_model(chosen.model, &p->model)) {
    return 3;
  }
  bool b5m = strncmp(p->model.name, "x5", 2) == 0;
  const char *boards = chosen.boards != NULL ? chosen.boards : b5m ? "B5M:0" : "B3M:0,B3M:1";
  if (!read_boards(boards, def)) {
    return 1 + usage_complain("--boards is not like B3M:0,B3M:1");
  }
  return 0;
}

int main(int argc, char **argv)
{
  static program p = {.master = -1, .slave = -1, .input = true, .packet = PACKET_S};
  emulator_def def = {.model = &p.model};
  hap_detail detail = {""};
  const struct sigaction stop = {.sa_handler = want_stop};
  int code = read_options(argc, argv, &p, &def);
  if (code != 0) {
    return code - 1;
  }
  if (emulator_init(&p.emulator, &def, &detail) < HAP_OK) {
    return usage_complain(detail.text);
  }
  sigaction(SIGINT, &stop, NULL);
  sigaction(SIGTERM, &stop, NULL);
  signal(SIGPIPE, SIG_IGN);
  code = load_script(&p) ? program_run(&p) : 2;
  emulator_finish(&p.emulator);
  return code;
}
