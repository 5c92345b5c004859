/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/run_black_box.h"

#include <inttypes.h>
#include <stdlib.h>

#include "tools/rig.h"

#define ROWS (HAP_BLACK_BOX_TICKS * RIG_POINTERS_MAX)

static void values_write(FILE *file, const double *v, int count)
{
  for (int i = 0; i < count; ++i) {
    fprintf(file, ",%.9g", v[i]);
  }
}

static void write_row(FILE *file, const hap_black_box_row *row)
{
  fprintf(file, "%" PRIu64 ",%.9g,%u,%u,%u", row->tick, 1e-9 * (double)row->time_ns,
          (unsigned)(row->pointer.v & 0xffffffffu), row->fault, row->guard);
  values_write(file, row->pose.position, 3);
  values_write(file, row->pose.quat_wxyz, 4);
  values_write(file, row->twist.linear, 3);
  values_write(file, row->twist.angular, 3);
  values_write(file, row->wanted.force, 3);
  values_write(file, row->wanted.torque, 3);
  values_write(file, row->written.force, 3);
  values_write(file, row->written.torque, 3);
  fprintf(file, ",%.9g\n", row->model_age_s);
}

size_t run_black_box_write(hap_session *session, FILE *file)
{
  size_t count = 0;
  size_t ticks = 0;
  hap_black_box_row *rows = malloc(ROWS * sizeof *rows);
  fputs(
      "tick,t,pointer,fault,guard,x,y,z,qw,qx,qy,qz,vx,vy,vz,wx,wy,wz,wanted_fx,wanted_fy,"
      "wanted_fz,wanted_tx,wanted_ty,wanted_tz,fx,fy,fz,tx,ty,tz,model_age_s\n",
      file);
  if (rows != NULL &&
      hap_session_black_box(session, rows, ROWS, sizeof(hap_black_box_row), &count) == HAP_OK) {
    for (size_t i = 0; i < count; ++i) {
      write_row(file, &rows[i]);
      ticks += i == 0 || rows[i].tick != rows[i - 1].tick;
    }
  }
  free(rows);
  return ticks;
}
