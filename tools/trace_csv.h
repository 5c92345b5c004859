/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_TRACE_CSV_H
#define HAPODE_TOOLS_TRACE_CSV_H

/* Rows of a trace as CSV, SI units but for tick_us. Columns:
 *
 *   t,px,py,pz,fx,fy,fz,tx,ty,tz       first pointer: position, force and torque on the hand
 *   bodies,contacts,tick_us,model_age_s
 *   p<i>_x,p<i>_y,p<i>_z,p<i>_fx,p<i>_fy,p<i>_fz,p<i>_tx,p<i>_ty,p<i>_tz   pointer i = 1, 2, ...
 *   b<k>_x,b<k>_y,b<k>_z               traced body k = 0, 1, ...
 */

#include <stddef.h>
#include <stdio.h>

#include <hapode/trace.h>

typedef struct trace_csv {
  FILE *file;
  size_t pointers;
  size_t bodies;
} trace_csv;

/* Errors stay on the file: ask ferror. */
void trace_csv_header(const trace_csv *csv);
void trace_csv_row(const trace_csv *csv, const hap_trace_row *row);

#endif
