/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/run_coupling.h"

void run_coupling_look(run_coupling *io, const rig *r)
{
  for (size_t i = 0; i < r->pointer_count; ++i) {
    hap_pointer_state *kept = &io->stiffest[i];
    hap_pointer_state now;
    if (hap_pointer_get(r->session, r->pointers[i], &now, sizeof now) >= HAP_OK &&
        (kept->size == 0 || now.contact_stiffness >= kept->contact_stiffness)) {
      *kept = now;
    }
  }
}

static void print_reason(const hap_pointer_state *state, FILE *out)
{
  bool spring = state->coupling != HAP_COUPLING_DIRECT;
  switch ((hap_coupling_reason)state->coupling_reason) {
    case HAP_COUPLING_ASKED:
      fputs("ASKED", out);
      break;
    case HAP_COUPLING_UNKNOWN:
      fprintf(out, "UNKNOWN: %.4g N/m near, the device does not say what it holds",
              state->contact_stiffness);
      break;
    case HAP_COUPLING_MODEL:
      fputs("MODEL: only model contact has a proxy", out);
      break;
    case HAP_COUPLING_WITHIN:
      fprintf(out, "WITHIN: %.4g N/m near, no more than the device holds",
              state->contact_stiffness);
      break;
    case HAP_COUPLING_ABOVE:
      fprintf(out, "ABOVE: %.4g N/m near, the device holds %.4g N/m", state->contact_stiffness,
              state->coupling_stiffness);
      break;
  }
  if (spring && state->coupling_reason == HAP_COUPLING_ASKED) {
    fprintf(out, ": a spring of %.4g N/m", state->coupling_stiffness);
  }
}

void run_coupling_print(const run_coupling *coupling, size_t pointers, FILE *out)
{
  fputs("coupling: ", out);
  for (size_t i = 0; i < pointers; ++i) {
    const hap_pointer_state *state = &coupling->stiffest[i];
    fprintf(out, "%s%s (", i > 0 ? " + " : "", hap_coupling_name((hap_coupling)state->coupling));
    print_reason(state, out);
    fputc(')', out);
  }
  fputc('\n', out);
}
