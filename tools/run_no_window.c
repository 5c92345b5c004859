/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A build without windows. */

#include "base/log.h"
#include "tools/run_window.h"

hap_status run_window(run_options *options, int (*run)(run_options *options), int *out_code,
                      hap_detail *detail)
{
  (void)options;
  (void)run;
  (void)out_code;
  return hapi_fail(detail, HAP_ERROR_UNSUPPORTED,
                   "--view: this build has no window (meson option view; Debian: libglfw3-dev "
                   "libepoxy-dev libegl-dev libpng-dev)");
}

void run_stage_prepare(run_stage *stage, run_options *io)
{
  (void)stage;
  (void)io;
}

hap_status run_stage_enter(run_stage *stage, const run_options *options, const rig *r,
                           size_t pointers, double seconds, hap_detail *detail)
{
  (void)stage;
  (void)options;
  (void)r;
  (void)pointers;
  (void)seconds;
  (void)detail;
  return HAP_OK;
}

void run_stage_leave(run_stage *stage)
{
  (void)stage;
}

void run_stage_add_row(run_stage *stage, const hap_trace_row *row)
{
  (void)stage;
  (void)row;
}

hap_status run_stage_look(run_stage *stage, double t)
{
  (void)stage;
  (void)t;
  return HAP_OK;
}

void run_stage_pace(run_stage *stage, double t)
{
  (void)stage;
  (void)t;
}

bool run_stage_goes_on(run_stage *stage, run_options *io)
{
  (void)stage;
  (void)io;
  return false;
}
