/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <limits.h>
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <ode/ode.h>

#include "base/regular.h"
#include "bench/accuracy.h"

#define TABLE_GROWTH 256
#define NOT_A_NUMBER 1e9 /* what a run that came to no number has in the table */

/* One line is one column of accuracy.csv, in its order, which only grows at the end. */
typedef struct column {
  const char *name;
  size_t offset;
  double scale;       /* what stands in the table / what the row has; 0: a text */
  const char *format; /* of the number */
} column;

#define TEXT(name, member)                          \
  {                                                 \
    name, offsetof(accuracy_row, member), 0.0, NULL \
  }
#define NUMBER(name, member, scale, format)             \
  {                                                     \
    name, offsetof(accuracy_row, member), scale, format \
  }

static const column columns[] = {
    TEXT("scene", scene),
    TEXT("model", model),
    NUMBER("physics_hz", physics_hz, 1.0, "%g"),
    TEXT("knob", knob),
    NUMBER("value", value, 1.0, "%g"),
    NUMBER("force_rel_rms", errors.force, 1.0, "%.6g"),
    NUMBER("impulse_ratio", errors.impulse_ratio, 1.0, "%.6g"),
    NUMBER("peak_ratio", errors.peak_ratio, 1.0, "%.6g"),
    NUMBER("tick_us", tick_us, 1.0, "%.4g"),
    NUMBER("physics_ms", physics_ms, 1.0, "%.4g"),
    NUMBER("duty", duty, 1.0, "%.4g"),
    NUMBER("haptic_hz", haptic_hz, 1.0, "%g"),
    NUMBER("noise_floor", noise_floor, 1.0, "%.6g"),
    NUMBER("estimate", estimate, 1.0, "%.6g"),
    TEXT("hand", hand),
    NUMBER("pose_error_mm", errors.pose_max, 1e3, "%.5g"),
    NUMBER("sync_line_n", errors.line_n, 1.0, "%.5g"),
    NUMBER("hand_speed", hand_speed, 1.0, "%.4g"),
    NUMBER("pose_median_mm", errors.pose_median, 1e3, "%.5g"),
    NUMBER("force_rms_n", errors.force_rms, 1.0, "%.4g"),
    NUMBER("rest_share", rest_share, 1.0, "%.3g"),
    NUMBER("start_um", start_um, 1.0, "%g"),
    NUMBER("torque_rel_rms", errors.torque, 1.0, "%.6g"),
    NUMBER("torque_floor", torque_floor, 1.0, "%.6g"),
    NUMBER("starts", starts, 1.0, "%g"),
    NUMBER("first_rel_rms", first_force, 1.0, "%.6g"),
    NUMBER("lines", errors.lines, 1.0, "%g"),
    NUMBER("front", front, 1.0, "%g"),
    NUMBER("joint_open_mm", errors.joint_loop, 1e3, "%.4g"),
    NUMBER("joint_world_mm", errors.joint_world, 1e3, "%.4g"),
    NUMBER("joint_left_mm", errors.joint_left, 1e3, "%.4g"),
    NUMBER("joint_floor_mm", joint_floor, 1e3, "%.4g"),
    NUMBER("joint_turn_deg", errors.joint_turn, 180.0 / M_PI, "%.4g"),
};

#define COLUMN_COUNT (sizeof columns / sizeof columns[0])

void accuracy_table_free(accuracy_table *table)
{
  free(table->rows);
  memset(table, 0, sizeof *table);
}

hap_status accuracy_table_add(bench *b, accuracy_table *table, const accuracy_row *row)
{
  if (table->count == table->capacity) {
    size_t capacity = table->capacity + TABLE_GROWTH;
    accuracy_row *rows = realloc(table->rows, capacity * sizeof *rows);
    if (rows == NULL) {
      return bench_fail(b, HAP_ERROR_MEMORY, "no memory for the table");
    }
    table->rows = rows;
    table->capacity = capacity;
  }
  table->rows[table->count] = *row;
  ++table->count;
  return HAP_OK;
}

size_t accuracy_rows_of_scene(const accuracy_table *table, size_t first)
{
  size_t end = first;
  while (end < table->count && strcmp(table->rows[end].scene, table->rows[first].scene) == 0) {
    ++end;
  }
  return end - first;
}

bool accuracy_row_is(const accuracy_row *row, hap_model model, const char *knob)
{
  return strcmp(row->model, hap_model_name(model)) == 0 && strcmp(row->knob, knob) == 0;
}

/* ---- as text ---- */

void accuracy_write_header(FILE *csv)
{
  for (size_t i = 0; i < COLUMN_COUNT; ++i) {
    fprintf(csv, "%s%s", i > 0 ? "," : "", columns[i].name);
  }
  fputc('\n', csv);
}

void accuracy_write_row(FILE *csv, const accuracy_row *row)
{
  for (size_t i = 0; i < COLUMN_COUNT; ++i) {
    const column *c = &columns[i];
    const char *at = (const char *)row + c->offset;
    char number[40];
    if (c->scale != 0.0) {
      double value = c->scale * *(const double *)(const void *)at;
      /* NOLINTNEXTLINE(clang-diagnostic-format-nonliteral): from the table above */
      snprintf(number, sizeof number, c->format, isfinite(value) ? value : NOT_A_NUMBER);
      at = number;
    }
    fprintf(csv, "%s%s", i > 0 ? "," : "", at);
  }
  fputc('\n', csv);
}

/* The field up to the next comma; NULL: it does not fit, or it is not a number of its own. */
static const char *read_field(const char *text, const column *c, accuracy_row *out)
{
  char field[ACCURACY_NAME_MAX + 16];
  size_t length = strcspn(text, ",\n");
  char *to = (char *)out + c->offset;
  char *end = NULL;
  if (length == 0 || length >= (c->scale != 0.0 ? sizeof field : ACCURACY_NAME_MAX)) {
    return NULL;
  }
  memcpy(field, text, length);
  field[length] = '\0';
  if (c->scale == 0.0) {
    memcpy(to, field, length + 1);
  } else {
    double value = strtod(field, &end) / c->scale;
    memcpy(to, &value, sizeof value);
  }
  return end == NULL || *end == '\0' ? text + length : NULL;
}

/* A line of the file; false: it is none that accuracy_write_row makes. */
static bool accuracy_read_row(const char *line, accuracy_row *out)
{
  memset(out, 0, sizeof *out);
  for (size_t i = 0; i < COLUMN_COUNT; ++i) {
    line = read_field(line, &columns[i], out);
    if (line == NULL || *line != (i + 1 < COLUMN_COUNT ? ',' : '\n')) {
      return false;
    }
    ++line;
  }
  return *line == '\0';
}

static bool accuracy_is_header(const char *line)
{
  for (size_t i = 0; i < COLUMN_COUNT; ++i) {
    size_t length = strlen(columns[i].name);
    if (strncmp(line, columns[i].name, length) != 0 ||
        line[length] != (i + 1 < COLUMN_COUNT ? ',' : '\n')) {
      return false;
    }
    line += length + 1;
  }
  return true;
}

/* The file of finished rows: what a run that was killed goes on from, and what a shard leaves.
 * It is a few lines that begin with # and say whose rows these are, then a table as
 * accuracy.csv. */

#define LINE_LENGTH 1024
#define LOCK_TRIES 250 /* of 20 ms: processes of a run that was killed end within moments */
#define FNV_BEGIN 0xcbf29ce484222325ull
#define FNV_PRIME 0x100000001b3ull

static const char first_line[] = "# hapode-bench accuracy: finished rows\n";

/* ---- whose rows ---- */

static bool hash_file(const char *path, uint64_t *io)
{
  unsigned char block[65536];
  const char *why = NULL;
  FILE *file = hapi_regular_open(path, &why);
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

static bool values_alike(double a, double b)
{
  return fabs(a - b) <= 1e-5 * fabs(b); /* as the table prints them */
}

/* plan->count: none. */
static size_t find_point(const accuracy_plan *plan, const accuracy_row *row)
{
  for (size_t g = 0; g < plan->group_count; ++g) {
    const accuracy_group *group = &plan->groups[g];
    bool of_scene = strcmp(row->scene, group->scene->name) == 0;
    for (size_t i = 0; of_scene && i < group->count; ++i) {
      const accuracy_point *point = &plan->points[group->first + i];
      if (accuracy_row_is(row, point->def.session.model, point->knob) &&
          values_alike(row->physics_hz, point->physics_hz) &&
          values_alike(row->value, point->value)) {
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

static hap_status accuracy_rows_head(bench *b, const char *path, accuracy_identity *out)
{
  const char *why = NULL;
  FILE *file = hapi_regular_open(path, &why);
  if (file == NULL) {
    return bench_fail(b, HAP_ERROR_IO, "%s: %s", path, why);
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
  const char *why = NULL;
  FILE *file = hapi_regular_open(path, &why);
  if (file == NULL) {
    return bench_fail(b, HAP_ERROR_IO, "%s: %s", path, why);
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

static hap_status file_lock(bench *b, const char *path, int file)
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
static hap_status file_prepare(bench *b, const char *path, int file, const accuracy_plan *plan,
                               const accuracy_identity *identity, accuracy_row *have)
{
  struct stat info;
  hap_status status = file_lock(b, path, file);
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
  hap_status status = file_prepare(b, path, file, plan, identity, have);
  if (status < HAP_OK) {
    close(file);
    return status;
  }
  *out_file = file;
  return HAP_OK;
}

/* Files of several processes or machines, each with the finished rows of a shard, into one
 * table. */

hap_status accuracy_merge_settings(bench *b, accuracy_settings *out)
{
  accuracy_identity head;
  char kind[8];
  hap_status status = accuracy_rows_head(b, b->merge[0], &head);
  if (status < HAP_OK) {
    return status;
  }
  if (sscanf(head.settings, "%7[^,], scene %31[^,], coupling %31[^,], estimates %7[^,],", kind,
             out->scene, out->coupling, out->estimates) != 4) {
    return bench_fail(b, HAP_ERROR_FORMAT, "%s: its settings \"%s\" are not understood",
                      b->merge[0], head.settings);
  }
  out->quick = strcmp(kind, "quick") == 0;
  return HAP_OK;
}

/* All of one run, and of the plan that is made here. */
static hap_status check_heads(bench *b, const accuracy_identity *here,
                              const accuracy_identity *heads)
{
  /* NOLINTNEXTLINE(clang-analyzer-core.NonNullParamChecker): one file at least */
  if (strcmp(heads[0].settings, here->settings) != 0) {
    return bench_fail(b, HAP_ERROR_STATE,
                      "%s is of a run with \"%s\", which here would be \"%s\": merge with the "
                      "build, and with the recordings, that it was run with",
                      b->merge[0], heads[0].settings, here->settings);
  }
  for (size_t i = 1; i < b->merge_count; ++i) {
    const char *what = strcmp(heads[i].build, heads[0].build) != 0         ? "builds"
                       : strcmp(heads[i].settings, heads[0].settings) != 0 ? "settings"
                       : heads[i].shards != heads[0].shards                ? "numbers of shards"
                                                                           : NULL;
    if (what != NULL) {
      return bench_fail(b, HAP_ERROR_STATE,
                        "%s and %s are of different %s (%s, %s, shard %zu/%zu; %s, %s, shard "
                        "%zu/%zu): run all shards alike",
                        b->merge[0], b->merge[i], what, heads[0].build, heads[0].settings,
                        heads[0].shard, heads[0].shards, heads[i].build, heads[i].settings,
                        heads[i].shard, heads[i].shards);
    }
    if (strcmp(heads[i].machine, heads[0].machine) != 0) {
      bench_say("times are of different machines: %s has %s, %s has %s", b->merge[0],
                heads[0].machine, b->merge[i], heads[i].machine);
    }
  }
  return HAP_OK;
}

/* Each shard once. */
static hap_status check_shards(bench *b, const accuracy_identity *heads)
{
  for (size_t shard = 1; shard <= heads[0].shards; ++shard) {
    size_t found = b->merge_count;
    for (size_t i = 0; i < b->merge_count; ++i) {
      if (heads[i].shard != shard) {
        continue;
      }
      if (found < b->merge_count) {
        return bench_fail(b, HAP_ERROR_STATE, "shard %zu of %zu is there twice: %s and %s", shard,
                          heads[0].shards, b->merge[found], b->merge[i]);
      }
      found = i;
    }
    if (found == b->merge_count) {
      return bench_fail(b, HAP_ERROR_NOT_FOUND, "shard %zu of %zu is missing", shard,
                        heads[0].shards);
    }
  }
  return HAP_OK;
}

/* That a file has its own rows, all of them and no others. */
static hap_status check_rows(bench *b, const accuracy_plan *plan, const char *path,
                             const accuracy_identity *head, const size_t *shard_of,
                             const accuracy_row *rows)
{
  size_t missing = 0;
  size_t others = 0;
  for (size_t g = 0; g < plan->group_count; ++g) {
    bool own = shard_of[g] + 1 == head->shard;
    for (size_t i = 0; i < plan->groups[g].count; ++i) {
      bool there = rows[plan->groups[g].first + i].scene[0] != '\0';
      missing += own && !there;
      others += !own && there;
    }
  }
  if (others > 0) {
    return bench_fail(b, HAP_ERROR_FORMAT, "%s: %zu rows are of another shard than %zu/%zu", path,
                      others, head->shard, head->shards);
  }
  if (missing > 0) {
    return bench_fail(b, HAP_ERROR_STATE,
                      "%s: %zu rows are missing: shard %zu/%zu has not ended; run it again, and it "
                      "goes on from there",
                      path, missing, head->shard, head->shards);
  }
  return HAP_OK;
}

typedef struct files {
  accuracy_identity *heads; /* merge_count */
  accuracy_row *rows;       /* of one file, by point */
  size_t *shard_of;         /* by group */
} files;

static hap_status read_heads(bench *b, const accuracy_plan *plan, files *f)
{
  f->heads = calloc(b->merge_count, sizeof *f->heads);
  f->rows = calloc(plan->count + 1, sizeof *f->rows);
  f->shard_of = calloc(plan->group_count + 1, sizeof *f->shard_of);
  if (f->heads == NULL || f->rows == NULL || f->shard_of == NULL) {
    return bench_fail(b, HAP_ERROR_MEMORY, "no memory for %zu files", b->merge_count);
  }
  hap_status status = HAP_OK;
  for (size_t i = 0; i < b->merge_count && status >= HAP_OK; ++i) {
    status = accuracy_rows_head(b, b->merge[i], &f->heads[i]);
  }
  return status;
}

static hap_status read_files(bench *b, const accuracy_plan *plan, files *f, accuracy_row *out)
{
  hap_status status = accuracy_deal(b, plan, f->heads[0].shards, f->shard_of);
  for (size_t i = 0; i < b->merge_count && status >= HAP_OK; ++i) {
    memset(f->rows, 0, (plan->count + 1) * sizeof *f->rows);
    status = accuracy_rows_read(b, b->merge[i], plan, f->rows);
    if (status >= HAP_OK) {
      status = check_rows(b, plan, b->merge[i], &f->heads[i], f->shard_of, f->rows);
    }
    for (size_t point = 0; point < plan->count && status >= HAP_OK; ++point) {
      if (f->rows[point].scene[0] != '\0') {
        out[point] = f->rows[point];
      }
    }
  }
  return status;
}

hap_status accuracy_merge(bench *b, const accuracy_plan *plan, accuracy_row *rows)
{
  files f = {0};
  accuracy_identity here;
  hap_status status = accuracy_identify(b, plan, &here);
  if (status >= HAP_OK) {
    status = read_heads(b, plan, &f);
  }
  if (status >= HAP_OK) {
    status = check_heads(b, &here, f.heads);
  }
  if (status >= HAP_OK) {
    status = check_shards(b, f.heads);
  }
  if (status >= HAP_OK) {
    status = read_files(b, plan, &f, rows);
  }
  free(f.heads);
  free(f.rows);
  free(f.shard_of);
  return status;
}
