/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* oracle-files FILE...: what the reader of scene files finds in each, against MuJoCo's compiler.
 * One line a file: equal; noted: it differs, and lines of the reader are the reasons; wrong: it
 * differs without; refused (by MuJoCo), unread (by hapode). Exit 1 where any is wrong. */

#include <stdio.h>
#include <string.h>

#include "import/import.h"
#include "tests/scene_oracle.h"

/* False: it is wrong. */
static bool file_compare(const char *path)
{
  static oracle_notes notes;
  hap_detail why = {""};
  import_work work = {.said = oracle_note_take, .user = &notes, .detail = &why};
  import_model model;
  oracle_found found = {.silent = 0};
  if (import_read(&work, path, &model) != HAP_OK) {
    printf("unread   %s %s\n", path, why.text);
  } else if (!scene_oracle(path, &model, &notes, &found)) {
    printf("refused  %s %s\n", path, strtok(found.first, "\n"));
  } else if (found.differ == 0) {
    printf("equal    %s %zu notes\n", path, notes.count);
  } else {
    printf("%s %s %zu numbers, %zu without a reason: %s; %zu notes\n",
           found.silent > 0 ? "wrong   " : "noted   ", path, found.differ, found.silent,
           found.first, notes.count);
  }
  (void)fflush(stdout);
  import_work_finish(&work);
  oracle_notes_free(&notes);
  return found.silent == 0;
}

int main(int argc, char **argv)
{
  if (!scene_oracle_is_there()) {
    (void)fprintf(stderr, "built without MuJoCo (Debian: libmujoco-dev)\n");
    return 2;
  }
  int wrong = 0;
  for (int i = 1; i < argc; ++i) {
    wrong += !file_compare(argv[i]);
  }
  return wrong > 0;
}
