/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "bench/thread_counts.h"

#include <dirent.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static FILE *open_task(const char *thread, const char *file)
{
  char path[128];
  (void)snprintf(path, sizeof path, "/proc/self/task/%.32s/%s", thread, file);
  return fopen(path, "r");
}

static bool is_named(const char *thread, const char *name)
{
  char line[64] = "";
  FILE *file = open_task(thread, "comm");
  bool same = file != NULL && fgets(line, sizeof line, file) != NULL;
  if (file != NULL) {
    fclose(file);
  }
  line[strcspn(line, "\n")] = '\0';
  return same && strcmp(line, name) == 0;
}

int thread_find(const char *name)
{
  int found = 0;
  DIR *tasks = opendir("/proc/self/task");
  for (struct dirent *e; tasks != NULL && found == 0 && (e = readdir(tasks)) != NULL;) {
    found = is_named(e->d_name, name) ? (int)strtol(e->d_name, NULL, 10) : 0;
  }
  if (tasks != NULL) {
    closedir(tasks);
  }
  return found;
}

/* Members 10 and 12 of the line; the second one, the name, may hold anything but is in brackets. */
static bool read_faults(const char *thread, thread_counts *out)
{
  char line[1024] = "";
  FILE *file = open_task(thread, "stat");
  bool good = file != NULL && fgets(line, sizeof line, file) != NULL;
  if (file != NULL) {
    fclose(file);
  }
  const char *rest = strrchr(line, ')');
  return good && rest != NULL &&
         sscanf(rest + 1, " %*c %*d %*d %*d %*d %*d %*u %" SCNu64 " %*u %" SCNu64,
                &out->minor_faults, &out->major_faults) == 2;
}

static bool read_switches(const char *thread, thread_counts *out)
{
  char line[256];
  int found = 0;
  FILE *file = open_task(thread, "status");
  while (file != NULL && fgets(line, sizeof line, file) != NULL) {
    found += sscanf(line, "voluntary_ctxt_switches: %" SCNu64, &out->voluntary) == 1;
    found += sscanf(line, "nonvoluntary_ctxt_switches: %" SCNu64, &out->involuntary) == 1;
  }
  if (file != NULL) {
    fclose(file);
  }
  return found == 2;
}

bool thread_count(int thread, thread_counts *out)
{
  char text[16];
  (void)snprintf(text, sizeof text, "%d", thread);
  *out = (thread_counts){0};
  return thread > 0 && read_faults(text, out) && read_switches(text, out);
}

thread_counts thread_counts_since(const thread_counts *now, const thread_counts *before)
{
  return (thread_counts){.minor_faults = now->minor_faults - before->minor_faults,
                         .major_faults = now->major_faults - before->major_faults,
                         .voluntary = now->voluntary - before->voluntary,
                         .involuntary = now->involuntary - before->involuntary};
}
