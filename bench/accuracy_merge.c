/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Files of several processes or machines, each with the finished rows of a shard, into one table. */

#include <stdlib.h>
#include <string.h>

#include "bench/accuracy.h"

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
  /* NOLINTNEXTLINE(clang-analyzer-core.NonNullParamChecker): there is one for each file, and one file at least */
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

static void take_rows(const accuracy_plan *plan, const accuracy_row *from, accuracy_row *rows)
{
  for (size_t i = 0; i < plan->count; ++i) {
    if (from[i].scene[0] != '\0') {
      rows[i] = from[i];
    }
  }
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
    if (status >= HAP_OK) {
      take_rows(plan, f->rows, out);
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
