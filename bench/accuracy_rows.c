/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The file of finished rows: what a run that was killed goes on from, and what a shard leaves. It is
 * a few lines that begin with # and say whose rows these are, then a table as accuracy.csv. */

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <ode/ode.h>

#include "bench/accuracy.h"

#define LINE_LENGTH 1024
#define LOCK_TRIES 50 /* of 20 ms: processes of a run that was killed end within moments */
#define FNV_BEGIN 0xcbf29ce484222325ull
#define FNV_PRIME 0x100000001b3ull

static const char first_line[] = "# hapode-bench accuracy: finished rows\n";

/* ---- whose rows ---- */

static bool hash_file(const char *path, uint64_t *io)
{
  unsigned char block[65536];
  FILE *file = fopen(path, "rb");
  size_t got = 0;
  if (file == NULL) {
    return false;
  }
  while ((got = fread(block, 1, sizeof block, file)) > 0) {
    for (size_t i = 0; i < got; ++i) {
      *io = (*io ^ block[i]) * FNV_PRIME;
    }
  }
  bool good = ferror(file) == 0;
  fclose(file);
  return good;
}

/* The library is part of the program; ODE may be a file of its own. */
static bool hash_ode(uint64_t *io)
{
  char line[PATH_MAX + 128];
  char path[PATH_MAX + 128] = "";
  FILE *maps = fopen("/proc/self/maps", "r");
  while (maps != NULL && path[0] == '\0' && fgets(line, sizeof line, maps) != NULL) {
    const char *name = strrchr(line, '/');
    if (name != NULL && strncmp(name, "/libode", 7) == 0) {
      snprintf(path, sizeof path, "%s", strchr(line, '/'));
      path[strcspn(path, "\n")] = '\0';
    }
  }
  if (maps != NULL) {
    fclose(maps);
  }
  return path[0] == '\0' || hash_file(path, io);
}

static void name_machine(char *out, size_t size)
{
  char line[LINE_LENGTH];
  FILE *info = fopen("/proc/cpuinfo", "r");
  snprintf(out, size, "unknown");
  while (info != NULL && fgets(line, sizeof line, info) != NULL) {
    char *name = strchr(line, ':');
    if (strncmp(line, "model name", 10) == 0 && name != NULL) {
      snprintf(out, size, "%s", name + 2);
      out[strcspn(out, "\n")] = '\0';
      break;
    }
  }
  if (info != NULL) {
    fclose(info);
  }
}

hap_status accuracy_identify(bench *b, const accuracy_plan *plan, accuracy_identity *out)
{
  uint64_t hash = FNV_BEGIN;
  memset(out, 0, sizeof *out);
  if (!hash_file("/proc/self/exe", &hash) || !hash_ode(&hash)) {
    return bench_fail(b, HAP_ERROR_SYSTEM, "the program's own file cannot be read: %s",
                      strerror(errno));
  }
  snprintf(out->build, sizeof out->build, "%016" PRIx64, hash);
  snprintf(out->settings, sizeof out->settings,
           "%s, scene %s, coupling %s, estimates %s, %zu rows (%016" PRIx64 ")",
           plan->quick ? "quick" : "full", b->scene != NULL ? b->scene : "all",
           b->coupling != NULL ? b->coupling : "none",
           accuracy_estimates_all(b) ? "all" : "default", plan->count, accuracy_plan_hash(plan));
  name_machine(out->machine, sizeof out->machine);
  out->rows = plan->count;
  out->shard = b->shard > 0 ? b->shard : 1;
  out->shards = b->shards > 0 ? b->shards : 1;
  return HAP_OK;
}

bool accuracy_rows_path(const bench *b, const accuracy_identity *identity, char *out, size_t size)
{
  int length = b->shards > 0 ? snprintf(out, size, "%s/accuracy-%zu-of-%zu.rows", b->out,
                                        identity->shard, identity->shards)
                             : snprintf(out, size, "%s/accuracy.rows", b->out);
  return length > 0 && (size_t)length < size;
}

/* ---- reading ---- */

/* The text after "# key: ", without its end; false: it is another line. */
static bool read_head_line(FILE *file, const char *key, char *out, size_t size)
{
  char line[LINE_LENGTH];
  char begin[40];
  size_t length = (size_t)snprintf(begin, sizeof begin, "# %s: ", key);
  if (fgets(line, sizeof line, file) == NULL || strncmp(line, begin, length) != 0) {
    return false;
  }
  line[strcspn(line, "\n")] = '\0';
  return strlen(line + length) < size && snprintf(out, size, "%s", line + length) >= 0;
}

bool accuracy_read_shard(const char *text, size_t *shard, size_t *shards)
{
  char *end = NULL;
  const char *slash = strchr(text, '/');
  if (slash == NULL || *text < '0' || *text > '9' || slash[1] < '0' || slash[1] > '9') {
    return false;
  }
  unsigned long k = strtoul(text, &end, 10);
  bool whole = end == slash;
  unsigned long n = strtoul(slash + 1, &end, 10);
  *shard = k;
  *shards = n;
  return whole && *end == '\0' && k >= 1 && k <= n && n <= ACCURACY_SHARDS_MAX;
}

static bool read_head(FILE *file, accuracy_identity *out)
{
  char line[LINE_LENGTH];
  char shard[40];
  memset(out, 0, sizeof *out);
  return fgets(line, sizeof line, file) != NULL && strcmp(line, first_line) == 0 &&
         read_head_line(file, "build", out->build, sizeof out->build) &&
         read_head_line(file, "settings", out->settings, sizeof out->settings) &&
         read_head_line(file, "machine", out->machine, sizeof out->machine) &&
         read_head_line(file, "shard", shard, sizeof shard) &&
         accuracy_read_shard(shard, &out->shard, &out->shards) &&
         fgets(line, sizeof line, file) != NULL && accuracy_is_header(line);
}

static bool alike(double a, double b)
{
  return fabs(a - b) <= 1e-5 * fabs(b); /* as the table prints them */
}

static bool is_point(const accuracy_row *row, const accuracy_point *point)
{
  return accuracy_row_is(row, point->def.model, point->knob) &&
         alike(row->physics_hz, point->physics_hz) && alike(row->value, point->value);
}

/* plan->count: none. */
static size_t find_point(const accuracy_plan *plan, const accuracy_row *row)
{
  for (size_t g = 0; g < plan->group_count; ++g) {
    const accuracy_group *group = &plan->groups[g];
    bool of_scene = strcmp(row->scene, group->scene->name) == 0;
    for (size_t i = 0; of_scene && i < group->count; ++i) {
      if (is_point(row, &plan->points[group->first + i])) {
        return group->first + i;
      }
    }
  }
  return plan->count;
}

static hap_status read_rows(bench *b, const char *path, FILE *file, const accuracy_plan *plan,
                            accuracy_row *rows)
{
  char line[LINE_LENGTH];
  for (int number = 7; fgets(line, sizeof line, file) != NULL; ++number) {
    accuracy_row row;
    if (strchr(line, '\n') == NULL && feof(file)) {
      return HAP_OK; /* it was killed here */
    }
    size_t point = accuracy_read_row(line, &row) ? find_point(plan, &row) : plan->count;
    if (point == plan->count) {
      return bench_fail(b, HAP_ERROR_FORMAT, "%s: line %d is no row of this bench", path, number);
    }
    if (rows[point].scene[0] != '\0') {
      return bench_fail(b, HAP_ERROR_FORMAT, "%s: line %d is there twice", path, number);
    }
    rows[point] = row;
  }
  return HAP_OK;
}

hap_status accuracy_rows_head(bench *b, const char *path, accuracy_identity *out)
{
  FILE *file = fopen(path, "r");
  if (file == NULL) {
    return bench_fail(b, HAP_ERROR_IO, "%s: %s", path, strerror(errno));
  }
  bool good = read_head(file, out);
  fclose(file);
  return good ? HAP_OK
              : bench_fail(b, HAP_ERROR_FORMAT,
                           "%s: not a file of finished rows, or one of another version of "
                           "hapode-bench",
                           path);
}

hap_status accuracy_rows_read(bench *b, const char *path, const accuracy_plan *plan,
                              accuracy_row *rows)
{
  accuracy_identity identity;
  FILE *file = fopen(path, "r");
  if (file == NULL) {
    return bench_fail(b, HAP_ERROR_IO, "%s: %s", path, strerror(errno));
  }
  hap_status status = read_head(file, &identity)
                          ? read_rows(b, path, file, plan, rows)
                          : bench_fail(b, HAP_ERROR_FORMAT, "%s: its head is broken", path);
  fclose(file);
  return status;
}

/* ---- writing ---- */

/* All of it in one write. */
static hap_status write_text(bench *b, int file, const char *text, size_t length)
{
  ssize_t written = write(file, text, length);
  return written == (ssize_t)length
             ? HAP_OK
             : bench_fail(b, HAP_ERROR_IO, "finished rows cannot be written: %s",
                          written < 0 ? strerror(errno) : "no room");
}

hap_status accuracy_rows_append(bench *b, int file, const accuracy_row *row)
{
  char line[LINE_LENGTH];
  FILE *text = fmemopen(line, sizeof line, "w");
  if (text == NULL) {
    return bench_fail(b, HAP_ERROR_MEMORY, "no memory for a row");
  }
  accuracy_write_row(text, row);
  long length = ftell(text);
  fclose(text);
  return write_text(b, file, line, (size_t)length);
}

static hap_status write_head(bench *b, int file, const accuracy_identity *identity)
{
  char head[2 * LINE_LENGTH];
  FILE *text = fmemopen(head, sizeof head, "w");
  if (text == NULL) {
    return bench_fail(b, HAP_ERROR_MEMORY, "no memory for a head");
  }
  fprintf(text, "%s# build: %s\n# settings: %s\n# machine: %s\n# shard: %zu/%zu\n", first_line,
          identity->build, identity->settings, identity->machine, identity->shard,
          identity->shards);
  accuracy_write_header(text);
  long length = ftell(text);
  fclose(text);
  return write_text(b, file, head, (size_t)length);
}

/* ---- opening ---- */

static hap_status check_same(bench *b, const char *path, const accuracy_identity *here)
{
  accuracy_identity there;
  memset(&there, 0, sizeof there);
  hap_status status = accuracy_rows_head(b, path, &there);
  const char *what = status < HAP_OK                               ? NULL
                     : strcmp(there.settings, here->settings) != 0 ? "other settings"
                     : strcmp(there.build, here->build) != 0       ? "another build"
                     : strcmp(there.machine, here->machine) != 0   ? "another machine"
                     : there.shard != here->shard || there.shards != here->shards ? "another shard"
                                                                                  : NULL;
  if (what == NULL) {
    return status;
  }
  return bench_fail(b, HAP_ERROR_STATE,
                    "%s has the rows of a run of %s (%s; here: %s): --fresh begins anew without "
                    "them, another --out keeps them",
                    path, what, there.settings, here->settings);
}

/* What was written last, and has no end, is cut off. */
static hap_status cut_last_line(bench *b, const char *path, int file)
{
  char last = '\0';
  off_t end = lseek(file, 0, SEEK_END);
  while (end > 0 && pread(file, &last, 1, end - 1) == 1 && last != '\n') {
    --end;
  }
  return ftruncate(file, end) == 0 ? HAP_OK
                                   : bench_fail(b, HAP_ERROR_IO, "%s: %s", path, strerror(errno));
}

static hap_status lock(bench *b, const char *path, int file)
{
  for (int i = 0; i < LOCK_TRIES; ++i) {
    if (flock(file, LOCK_EX | LOCK_NB) == 0) {
      return HAP_OK;
    }
    usleep(20000);
  }
  return bench_fail(b, HAP_ERROR_STATE, "%s is in use by another run", path);
}

/* The file is the caller's, also after a failure. */
static hap_status prepare(bench *b, const char *path, int file, const accuracy_plan *plan,
                          const accuracy_identity *identity, accuracy_row *have)
{
  struct stat info;
  hap_status status = lock(b, path, file);
  if (status < HAP_OK) {
    return status;
  }
  if (fstat(file, &info) != 0 || (b->fresh && ftruncate(file, 0) != 0)) {
    return bench_fail(b, HAP_ERROR_IO, "%s: %s", path, strerror(errno));
  }
  if (b->fresh || info.st_size == 0) {
    return write_head(b, file, identity);
  }
  status = check_same(b, path, identity);
  if (status >= HAP_OK) {
    status = cut_last_line(b, path, file);
  }
  return status >= HAP_OK ? accuracy_rows_read(b, path, plan, have) : status;
}

hap_status accuracy_rows_open(bench *b, const accuracy_plan *plan,
                              const accuracy_identity *identity, accuracy_row *have, int *out_file)
{
  char path[PATH_MAX];
  *out_file = -1;
  if (mkdir(b->out, 0777) != 0 && errno != EEXIST) {
    return bench_fail(b, HAP_ERROR_IO, "%s: %s", b->out, strerror(errno));
  }
  if (!accuracy_rows_path(b, identity, path, sizeof path)) {
    return bench_fail(b, HAP_ERROR_IO, "the name of the folder is too long");
  }
  int file = open(path, O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
  if (file < 0) {
    return bench_fail(b, HAP_ERROR_IO, "%s: %s", path, strerror(errno));
  }
  hap_status status = prepare(b, path, file, plan, identity, have);
  if (status < HAP_OK) {
    close(file);
    return status;
  }
  *out_file = file;
  return HAP_OK;
}
