/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <assert.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <unistd.h>

#include "bench/accuracy.h"

#define JOBS_MAX ACCURACY_SCENES_MAX

/* A process says here how it went, then its rows. */
typedef struct report {
  hap_status status;
  hap_detail detail;
  size_t rows;
} report;

static bool write_report(FILE *to, const report *r, const accuracy_table *table)
{
  return fwrite(r, sizeof *r, 1, to) == 1 &&
         fwrite(table->rows, sizeof *table->rows, table->count, to) == table->count &&
         fflush(to) == 0;
}

/* In the new process. It leaves without a look at the buffers that it has inherited. */
static void work(bench *b, const accuracy_scene *which, FILE *to)
{
  accuracy_table table = {0};
  report r = {.status = accuracy_sweep(b, which, &table)};
  r.detail = b->detail;
  r.rows = table.count;
  bool written = write_report(to, &r, &table);
  accuracy_table_free(&table);
  _exit(written ? 0 : 1);
}

static hap_status read_report(bench *b, const accuracy_scene *which, FILE *from,
                              accuracy_table *table)
{
  report r;
  accuracy_row row;
  rewind(from);
  if (fread(&r, sizeof r, 1, from) != 1) {
    return bench_fail(b, HAP_ERROR_IO, "%s: its process did not end well", which->name);
  }
  hap_status status = r.status;
  if (status < HAP_OK) {
    b->detail = r.detail;
  }
  for (size_t i = 0; i < r.rows && status >= HAP_OK; ++i) {
    status = fread(&row, sizeof row, 1, from) == 1
                 ? accuracy_table_add(b, table, &row)
                 : bench_fail(b, HAP_ERROR_IO, "%s: rows are missing", which->name);
  }
  return status;
}

static size_t processors(void)
{
  long count = sysconf(_SC_NPROCESSORS_ONLN);
  return count > 1 ? (size_t)count : 1;
}

/* No session exists yet, so that a process can be split. Twice through the list: what takes long
 * begins first, or the last scene would run alone. */
static hap_status run_all(bench *b, const accuracy_scene *const *scenes, size_t count,
                          FILE *const *files)
{
  size_t running = 0;
  hap_status status = HAP_OK;
  for (size_t turn = 0; turn < 2 * count && status >= HAP_OK; ++turn) {
    size_t i = turn % count;
    bool is_long = scenes[i]->starts_quick > 0;
    if (is_long != (turn < count)) {
      continue;
    }
    if (running == processors()) {
      (void)waitpid(-1, NULL, 0);
      --running;
    }
    pid_t child = fork();
    if (child == 0) {
      work(b, scenes[i], files[i]);
    }
    running += child > 0;
    status = child > 0 ? HAP_OK : bench_fail(b, HAP_ERROR_MEMORY, "no process for a scene");
  }
  for (; running > 0; --running) {
    (void)waitpid(-1, NULL, 0);
  }
  return status;
}

hap_status accuracy_jobs(bench *b, const accuracy_scene *const *scenes, size_t count,
                         accuracy_table *table)
{
  FILE *files[JOBS_MAX] = {NULL};
  hap_status status = HAP_OK;
  assert(count <= JOBS_MAX);
  for (size_t i = 0; i < count && i < JOBS_MAX && status >= HAP_OK; ++i) {
    files[i] = tmpfile();
    status = files[i] != NULL ? HAP_OK : bench_fail(b, HAP_ERROR_IO, "no file for a scene");
  }
  if (status >= HAP_OK) {
    status = run_all(b, scenes, count, files);
  }
  for (size_t i = 0; i < count && status >= HAP_OK; ++i) {
    status = read_report(b, scenes[i], files[i], table);
  }
  for (size_t i = 0; i < JOBS_MAX; ++i) {
    if (files[i] != NULL) {
      fclose(files[i]);
    }
  }
  return status;
}
