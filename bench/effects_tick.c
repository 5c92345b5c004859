/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <stdlib.h>
#include <string.h>

#include "tools/rig.h"
#include "tools/run_effects.h"

/* effects-tick SCENE LIST TICKS: a lockstep run of the same ticks every time, to count their
 * instructions. */

int main(int argc, char **argv)
{
  rig_options options;
  run_effects effects;
  hap_detail detail = {""};
  rig r;
  rig_options_init(&options);
  memset(&effects, 0, sizeof effects);
  memset(&r, 0, sizeof r);
  if (argc != 4 || run_effects_parse(argv[2], &effects, &detail) < HAP_OK ||
      run_effects_apply(&effects, options.def.model, &options.expert, &detail) < HAP_OK) {
    fprintf(stderr, "usage: effects-tick SCENE LIST TICKS: %s\n", detail.text);
    return 2;
  }
  dInitODE2(0);
  options.scene = argv[1];
  options.def.drive = HAP_DRIVE_LOCKSTEP;
  hap_status status = rig_create(&options, &r, &detail);
  status = status >= HAP_OK ? hap_session_start(r.session) : status;
  status = status >= HAP_OK ? hap_session_advance(r.session, strtoull(argv[3], NULL, 10)) : status;
  rig_destroy(&r);
  dCloseODE();
  if (status < HAP_OK) {
    fprintf(stderr, "effects-tick: %s %s\n", hap_status_text(status), detail.text);
  }
  return status < HAP_OK ? 1 : 0;
}
