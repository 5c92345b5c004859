/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* oracle-files FILE...: what the reader of scene files finds in each, against MuJoCo's compiler.
 * One line a file: equal, differs (and where), refused (by MuJoCo), unread (by hapode). A file that
 * differs and has notes is said to be noted. */

#include <stdio.h>
#include <string.h>

#include "import/import.h"
#include "tests/scene_oracle.h"

typedef struct told {
  size_t count;
  char first[200];
} told;

static void note_take(void *user, const char *line)
{
  told *to = user;
  if (to->count++ == 0) {
    (void)snprintf(to->first, sizeof to->first, "%s", line);
  }
}

static void file_compare(const char *path)
{
  told notes = {.count = 0};
  hap_detail why = {""};
  import_work work = {.said = note_take, .user = &notes, .detail = &why};
  import_model model;
  oracle_found found;
  if (import_read(&work, path, &model) != HAP_OK) {
    printf("unread   %s %s\n", path, why.text);
  } else if (!scene_oracle(path, &model, &found)) {
    printf("refused  %s %s\n", path, strtok(found.first, "\n"));
  } else if (found.differ == 0) {
    printf("equal    %s %zu notes\n", path, notes.count);
  } else {
    printf("differs  %s %zu numbers: %s; %zu notes: %s\n", path, found.differ, found.first,
           notes.count, notes.first);
  }
  (void)fflush(stdout);
  import_work_finish(&work);
}

int main(int argc, char **argv)
{
  if (!scene_oracle_is_there()) {
    (void)fprintf(stderr, "built without MuJoCo (Debian: libmujoco-dev)\n");
    return 2;
  }
  for (int i = 1; i < argc; ++i) {
    file_compare(argv[i]);
  }
  return 0;
}
