/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The table of stability cases, tests/stability/cases.c: one TAP line for each case and each
 * model that claims it, the worst figures in a comment before it. With the argument "all" the
 * other models are run and printed too; any other argument selects the cases whose names contain
 * it. */

#include "tests/tap.h"

#include "tests/stability/run.h"

static const hap_model models[] = {HAP_MODEL_CONTACT, HAP_MODEL_SINGLE, HAP_MODEL_ACCELERANCE,
                                   HAP_MODEL_IMPULSE};

static const case_row *row; /* of the running test */
static hap_model model;

TEST(row_holds)
{
  CHECK(case_holds(row, model, ""));
}

static void run_row(bool all)
{
  char name[96];
  for (size_t i = 0; i < sizeof models / sizeof models[0]; ++i) {
    model = models[i];
    if ((row->judged & (1u << model)) == 0) {
      (void)(all && case_holds(row, model, "not claimed: "));
    } else {
      (void)snprintf(name, sizeof name, "%s, %s", row->name, hap_model_name(model));
      tap_run(test_row_holds, name);
    }
  }
}

int main(int argc, char **argv)
{
  const char *asked = "";
  bool all = false;
  for (int i = 1; i < argc; ++i) {
    bool word = strcmp(argv[i], "all") == 0;
    all = all || word;
    asked = word ? asked : argv[i];
  }
  dInitODE2(0);
  dAllocateODEDataForThread(dAllocateMaskAll);
  for (size_t i = 0; i < stability_case_count; ++i) {
    row = &stability_cases[i];
    if (strstr(row->name, asked) != NULL) {
      run_row(all);
    }
  }
  dCloseODE();
  return tap_done();
}
