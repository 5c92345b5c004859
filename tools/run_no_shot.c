/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A program without pictures. */

#include "base/log.h"
#include "tools/run_shot.h"

hap_status run_shot_open(const run_options *options, const rig *r, double seconds, size_t pointers,
                         run_shot **out, hap_detail *detail)
{
  (void)r;
  (void)seconds;
  (void)pointers;
  *out = NULL;
  return options->shot.path == NULL && options->shot.frames == NULL
             ? HAP_OK
             : hapi_fail(detail, HAP_ERROR_UNSUPPORTED,
                         "--shot and --frames: this build draws no pictures (meson option view; "
                         "Debian: libepoxy-dev libegl-dev libpng-dev)");
}

void run_shot_add_row(run_shot *shot, const hap_trace_row *row)
{
  (void)shot;
  (void)row;
}

void run_shot_look(run_shot *shot, double t)
{
  (void)shot;
  (void)t;
}

hap_status run_shot_close(run_shot *shot, hap_detail *detail)
{
  (void)shot;
  (void)detail;
  return HAP_OK;
}

void run_shot_drop(run_shot *shot)
{
  (void)shot;
}
