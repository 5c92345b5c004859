/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The table of stability cases, tests/stability/cases.c: one TAP line for each case and each model that
 * claims it, the worst figures in a comment before it. With the argument "all" the other models are run
 * and printed too; any other argument selects the cases whose names contain it. */

#include "tests/tap.h"

#include "tests/stability/bounds.h"

static const hap_model models[] = {HAP_MODEL_CONTACT, HAP_MODEL_SINGLE, HAP_MODEL_ACCELERANCE,
                                   HAP_MODEL_IMPULSE};

/* What is run now. */
static struct {
  const case_row *row;
  hap_model model;
  world w;
  bounds b;
} now;

/* False: could not be started. */
static bool run_case(void)
{
  world *w = &now.w;
  bounds *b = &now.b;
  world_open(w);
  if (!world_start(w, now.row, now.model)) {
    printf("# %s: %s\n", now.row->name, w->detail.text);
    world_close(w);
    return false;
  }
  bounds_begin(b, now.row, w, now.model);
  uint64_t ticks = (uint64_t)llround(now.row->seconds * w->def.haptic_hz);
  while (b->ticks < ticks && b->finite && hap_session_advance(w->session, 1) >= HAP_OK) {
    bounds_look(b);
  }
  b->finite = b->finite && b->ticks == ticks;
  bounds_end(b);
  world_close(w);
  return true;
}

/* Runs the case and prints its worst figures; whether the bounds held. */
static bool measure_case(const char *how)
{
  const bounds *b = &now.b;
  char broken[128];
  if (!run_case()) {
    return false;
  }
  bool good = bounds_hold(b, broken, sizeof broken);
  printf("# %s%s, %s: %.3g N, energy %+.4f, gain %.4f, depth %.3g mm (%.2f), momentum %.1e, way %.2g m%s%s\n",
         how, now.row->name, hap_model_name(now.model), b->force, bounds_energy(b), bounds_gain(b), 1e3 * b->depth,
         b->deeper, b->residual, b->way, good ? "" : "; broken:", broken);
  (void)fflush(stdout);
  return good;
}

TEST(case_holds)
{
  CHECK(measure_case(""));
}

static void run_row(const case_row *row, bool all)
{
  char name[96];
  now.row = row;
  for (size_t i = 0; i < sizeof models / sizeof models[0]; ++i) {
    now.model = models[i];
    if ((row->judged & (1u << models[i])) == 0) {
      (void)(all && measure_case("not claimed: "));
    } else if ((row->fails & (1u << models[i])) != 0) {
      (void)measure_case("TODO ");
    } else {
      (void)snprintf(name, sizeof name, "%s, %s", row->name, hap_model_name(models[i]));
      tap_run(case_holds, name);
    }
  }
}

int main(int argc, char **argv)
{
  const char *asked = "";
  bool all = false;
  for (int i = 1; i < argc; ++i) {
    all = all || strcmp(argv[i], "all") == 0;
    asked = strcmp(argv[i], "all") == 0 ? asked : argv[i];
  }
  dInitODE2(0);
  dAllocateODEDataForThread(dAllocateMaskAll);
  for (size_t i = 0; i < stability_case_count; ++i) {
    const case_row *row = &stability_cases[i];
    if (strstr(row->name, asked) != NULL) {
      run_row(row, all);
    }
  }
  dCloseODE();
  return tap_done();
}
