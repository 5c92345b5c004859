/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tests/stability/run.h"

#include <math.h>
#include <stdio.h>

#include "tests/stability/bounds.h"

static void print_figures(const bounds *b, const char *how, const char *broken)
{
  printf(
      "# %s%s, %s: %.3g N, energy %+.4f, gain %.4f, depth %.3g mm (%.2f), momentum %.1e, way %.2g "
      "m%s%s\n",
      how, b->row->name, hap_model_name(b->model), b->worst.force, bounds_energy(b), bounds_gain(b),
      1e3 * b->worst.depth, b->worst.deeper, b->worst.residual, b->worst.way,
      broken[0] != '\0' ? "; broken:" : "", broken);
  (void)fflush(stdout);
}

bool case_holds(const case_row *row, hap_model model, const char *how)
{
  static world w;
  static bounds b;
  char broken[128];
  world_open(&w);
  if (!world_start(&w, row, model)) {
    printf("# %s: %s\n", row->name, w.detail.text);
    world_close(&w);
    return false;
  }
  bounds_begin(&b, row, &w, model);
  uint64_t ticks = (uint64_t)llround(row->seconds * w.def.haptic_hz);
  while (b.ticks < ticks && b.worst.finite && hap_session_advance(w.session, 1) >= HAP_OK) {
    bounds_look(&b);
  }
  b.worst.finite = b.worst.finite && b.ticks == ticks;
  bool good = bounds_hold(&b, broken, sizeof broken);
  print_figures(&b, how, broken);
  bounds_end(&b);
  world_close(&w);
  return good;
}
