/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* hapode-bench hosting: what one world costs the machine that serves it. hapode-run --serve and
 * --connect are started as for users, in real time, on this machine. Columns of hosting.csv:
 *
 *   bodies           of the scene
 *   hands            0 or 1: one that pushes to and fro all the time
 *   processor_share  of one core, of the server's process
 *   resident_kb      of it; own_kb: without what processes share
 *   bytes_down       a second, payload, to the hand; bytes_up: from it
 *   physics_missed   steps of the world that were not in time, in the whole run */

#include <math.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <hapode/hapode.h>

#include "bench/bench.h"
#include "bench/child.h"

#define LOOK_S 10.0
#define LOOK_QUICK_S 3.0
#define SETTLE_S 1.5 /* before a look: programs start, and hands join */
#define ROWS_MOST 8

typedef struct hosted_scene {
  const char *name;
  int bodies;
  const char *from; /* of the hand, and back; a second each way */
  const char *to;
} hosted_scene;

static const hosted_scene hosted[] = {
    {"slide", 1, "-0.03/0/0.025", "0.03/0/0.025"},
    {"row10", 10, "-0.03/0/0.025", "0.03/0/0.025"},
    {"row10:30", 30, "-0.03/0/0.025", "0.03/0/0.025"},
};

typedef struct hosting_row {
  const hosted_scene *scene;
  int hands;
  double share;
  long resident_kb;
  long own_kb;
  double down;
  double up;
  long missed;
} hosting_row;

typedef struct hosting_table {
  hosting_row rows[ROWS_MOST];
  size_t count;
} hosting_table;

static void seconds_wait(double seconds)
{
  struct timespec left = {(time_t)seconds, (long)(1e9 * (seconds - (double)(time_t)seconds))};
  (void)nanosleep(&left, NULL);
}

/* ---- a process, as the system sees it ---- */

/* s of processor; negative: it is not there. */
static double process_seconds(pid_t pid)
{
  char path[64];
  char text[1024];
  (void)snprintf(path, sizeof path, "/proc/%d/stat", (int)pid);
  FILE *file = fopen(path, "r");
  size_t length = file != NULL ? fread(text, 1, sizeof text - 1, file) : 0;
  if (file != NULL) {
    fclose(file);
  }
  text[length] = '\0';
  char *at = strrchr(text, ')');             /* behind the name: state is field 3 */
  for (int i = 2; at != NULL && i < 14; ++i) /* utime is field 14 */
  {
    at = strchr(at + 1, ' ');
  }
  if (at == NULL) {
    return -1.0;
  }
  unsigned long user = strtoul(at, &at, 10);
  unsigned long system = strtoul(at, NULL, 10);
  return (double)(user + system) / (double)sysconf(_SC_CLK_TCK);
}

static long status_kb(pid_t pid, const char *key)
{
  char path[64];
  char line[256];
  long value = -1;
  (void)snprintf(path, sizeof path, "/proc/%d/status", (int)pid);
  FILE *file = fopen(path, "r");
  while (file != NULL && fgets(line, sizeof line, file) != NULL) {
    if (strncmp(line, key, strlen(key)) == 0) {
      value = strtol(line + strlen(key), NULL, 10);
    }
  }
  if (file != NULL) {
    fclose(file);
  }
  return value;
}

/* Value of "key: value" in what a program says until its end; NaN: there is none. */
static void summary_read(FILE *said, const char *const keys[], size_t count, double *out)
{
  char line[1024];
  for (size_t i = 0; i < count; ++i) {
    out[i] = NAN;
  }
  while (fgets(line, sizeof line, said) != NULL) {
    for (size_t i = 0; i < count; ++i) {
      size_t length = strlen(keys[i]);
      if (strncmp(line, keys[i], length) == 0 && line[length] == ':') {
        out[i] = strtod(line + length + 1, NULL);
      }
    }
  }
}

/* ---- a world and its hand ---- */

static bool process_look(pid_t pid, double seconds, hosting_row *out)
{
  double before = process_seconds(pid);
  seconds_wait(seconds);
  double after = process_seconds(pid);
  out->share = (after - before) / seconds;
  out->resident_kb = status_kb(pid, "VmRSS:");
  out->own_kb = status_kb(pid, "RssAnon:");
  return before >= 0.0 && after >= 0.0;
}

static void hand_write(const hosted_scene *scene, double seconds, char *out, size_t size)
{
  size_t length = (size_t)snprintf(out, size, "virtual:path=0:%s", scene->from);
  for (int i = 1; i <= (int)seconds && length < size; ++i) {
    length += (size_t)snprintf(out + length, size - length, ";%d:%s", i,
                               i % 2 == 1 ? scene->to : scene->from);
  }
  if (length < size) {
    (void)snprintf(out + length, size - length, ",blend=smooth,hand=tense");
  }
}

static bool hand_look(const char *world, double seconds, pid_t server, hosting_row *out)
{
  static const char *const keys[] = {"remote_bytes_received", "remote_bytes_sent", "remote_drawn",
                                     "remote_refused"};
  char device[2048];
  char text[32];
  double got[BENCH_COUNT(keys)] = {0.0};
  double whole = seconds + 2.0 * SETTLE_S;
  bench_child hand;
  hand_write(out->scene, whole, device, sizeof device);
  (void)snprintf(text, sizeof text, "%g", whole);
  const char *const words[] = {"--connect", world,  "--scene",       out->scene->name,
                               "--device",  device, "--no-realtime", "--seconds",
                               text,        NULL};
  bool good = bench_child_start("hapode-run", words, &hand);
  seconds_wait(SETTLE_S);
  good = good && process_look(server, seconds, out);
  if (hand.said != NULL) {
    summary_read(hand.said, keys, BENCH_COUNT(keys), got);
  }
  out->down = got[0] / whole;
  out->up = got[1] / whole;
  return bench_child_finish(&hand, 0) && good && got[2] == 1.0 && got[3] == 0.0;
}

static hap_status scene_host(bench *b, const hosted_scene *scene, hosting_table *io)
{
  static const char *const keys[] = {"physics_missed", "remote_joins"};
  double seconds = b->quick ? LOOK_QUICK_S : LOOK_S;
  double got[BENCH_COUNT(keys)] = {0.0};
  char world[64];
  bench_child server;
  hosting_row *rows = &io->rows[io->count];
  rows[0] = (hosting_row){.scene = scene, .hands = 0};
  rows[1] = (hosting_row){.scene = scene, .hands = 1};
  (void)snprintf(world, sizeof world, "hosting-%d-%zu", (int)getpid(), io->count);
  const char *const words[] = {"--serve", world, "--scene", scene->name, "--no-realtime", NULL};
  bool good = bench_child_start("hapode-run", words, &server);
  seconds_wait(SETTLE_S);
  good = good && process_look(server.pid, seconds, &rows[0]) &&
         hand_look(world, seconds, server.pid, &rows[1]);
  if (server.pid > 0) {
    (void)kill(server.pid, SIGINT);
    summary_read(server.said, keys, BENCH_COUNT(keys), got);
    good = got[1] == 1.0 && good;
    rows[0].missed = rows[1].missed = good ? (long)got[0] : -1;
  }
  good = bench_child_finish(&server, 0) && good;
  if (!good) {
    return bench_fail(b, HAP_ERROR_IO,
                      "%s: hapode-run --serve and --connect do not work here (is it built with "
                      "Cyclone DDS?): try them by hand",
                      scene->name);
  }
  io->count += 2;
  return HAP_OK;
}

static void rows_check(bench *b, const hosting_row *idle, const hosting_row *held)
{
  bench_say(
      "%s: %.2f %% of a core without a hand, %.2f %% with one; %.1f MB, of which %.1f MB are "
      "its own; %.1f kB/s down, %.1f kB/s up",
      idle->scene->name, 100.0 * idle->share, 100.0 * held->share, 1e-3 * (double)held->resident_kb,
      1e-3 * (double)held->own_kb, 1e-3 * held->down, 1e-3 * held->up);
  bench_check(b, held->down <= 60e3 && held->up <= 30e3,
              "%s: %.1f kB/s down and %.1f kB/s up, drawn poses among them (at most 60 and 30)",
              idle->scene->name, 1e-3 * held->down, 1e-3 * held->up);
}

/* ---- memory, by what a session has room for ---- */

typedef struct hosting_room {
  int32_t bodies;
  int32_t contacts;
  int32_t pointers;
} hosting_room;

static const hosting_room rooms[] = {{32, 256, 1}, {64, 1024, 2}, {256, 3072, 0}};

/* kB that a served world takes, beside the program; negative: it does not start. */
static long room_use(const hosting_room *room)
{
  hap_detail why;
  hap_scene *scene;
  hap_session *session;
  hap_link *link;
  hap_session_def def;
  hap_session_def_init(&def, sizeof def);
  def.max_bodies = room->bodies;
  def.max_contacts = room->contacts;
  def.max_pointers = room->pointers > 0 ? room->pointers : def.max_pointers;
  def.rt_priority = 0;
  long before = status_kb(getpid(), "RssAnon:");
  bool good = hap_scene_load("slide", &scene, &why) >= HAP_OK &&
              hap_scene_session(scene, &def, &session, &why) >= HAP_OK &&
              hap_link_local_serve(&link, &why) >= HAP_OK &&
              hap_session_serve(session, link) >= HAP_OK && hap_session_start(session) >= HAP_OK;
  seconds_wait(0.2);
  return good ? status_kb(getpid(), "RssAnon:") - before : -1;
}

/* In a process of its own: what was freed before stays with a process. */
static long room_measure(const hosting_room *room)
{
  long used = -1;
  int ends[2];
  if (pipe(ends) != 0) {
    return -1;
  }
  (void)fflush(NULL);
  pid_t pid = fork();
  if (pid == 0) {
    long found = room_use(room);
    bool told = write(ends[1], &found, sizeof found) == (ssize_t)sizeof found;
    _exit(told ? 0 : 1);
  }
  close(ends[1]);
  if (pid < 0 || read(ends[0], &used, sizeof used) != (ssize_t)sizeof used) {
    used = -1;
  }
  close(ends[0]);
  (void)waitpid(pid, NULL, 0);
  return used;
}

static void rooms_measure(bench *b)
{
  for (size_t i = 0; i < BENCH_COUNT(rooms); ++i) {
    long used = room_measure(&rooms[i]);
    bench_check(b, used > 0, "%d bodies, %d contacts: %.1f MB of memory in a process that serves",
                (int)rooms[i].bodies, (int)rooms[i].contacts, 1e-3 * (double)used);
  }
}

/* ---- */

static void hosting_draw(FILE *script, const void *data)
{
  const hosting_table *table = data;
  fprintf(script,
          "set title 'One world, served by one process'\nset style data histograms\n"
          "set style fill solid\nset yrange [0:*]\nset ylabel 'share of a core [%%]'\n"
          "set key top left\n$t << EOD\n");
  for (size_t i = 0; i + 1 < table->count; i += 2) {
    fprintf(script, "\"%s\" %.4g %.4g\n", table->rows[i].scene->name, 100.0 * table->rows[i].share,
            100.0 * table->rows[i + 1].share);
  }
  fprintf(script,
          "EOD\nplot $t using 2:xtic(1) title 'no hand', $t using 3 title 'a hand that "
          "pushes'\n");
}

hap_status bench_hosting(bench *b)
{
  static hosting_table table;
  hap_status status = HAP_OK;
  table.count = 0;
  rooms_measure(b);
  for (size_t i = 0; i < BENCH_COUNT(hosted) && status >= HAP_OK; ++i) {
    if (b->scene == NULL || strcmp(b->scene, hosted[i].name) == 0) {
      status = scene_host(b, &hosted[i], &table);
      if (status >= HAP_OK) {
        rows_check(b, &table.rows[table.count - 2], &table.rows[table.count - 1]);
      }
    }
  }
  FILE *csv = bench_csv_open(b, "hosting",
                             "scene,bodies,hands,processor_share,resident_kb,own_kb,bytes_down,"
                             "bytes_up,physics_missed");
  for (size_t i = 0; i < table.count && csv != NULL; ++i) {
    const hosting_row *row = &table.rows[i];
    fprintf(csv, "%s,%d,%d,%.5g,%ld,%ld,%.6g,%.6g,%ld\n", row->scene->name, row->scene->bodies,
            row->hands, row->share, row->resident_kb, row->own_kb, row->down, row->up, row->missed);
  }
  status = bench_csv_close(b, csv, status);
  return status >= HAP_OK ? bench_draw(b, "hosting", 700, 450, hosting_draw, &table) : status;
}
