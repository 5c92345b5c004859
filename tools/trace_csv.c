/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/trace_csv.h"

void trace_csv_header(const trace_csv *csv)
{
  FILE *file = csv->file;
  fputs("t,px,py,pz,fx,fy,fz,tx,ty,tz,bodies,contacts,tick_us,model_age_s", file);
  for (size_t i = 1; i < csv->pointers; ++i) {
    fprintf(file, ",p%zu_x,p%zu_y,p%zu_z", i, i, i);
    fprintf(file, ",p%zu_fx,p%zu_fy,p%zu_fz", i, i, i);
    fprintf(file, ",p%zu_tx,p%zu_ty,p%zu_tz", i, i, i);
  }
  for (size_t k = 0; k < csv->bodies; ++k) {
    fprintf(file, ",b%zu_x,b%zu_y,b%zu_z", k, k, k);
  }
  fputc('\n', file);
}

static void vector_write(FILE *file, const double v[3])
{
  fprintf(file, ",%.9g,%.9g,%.9g", v[0], v[1], v[2]);
}

static void pointer_write(FILE *file, const hap_trace_pointer *p)
{
  vector_write(file, p->position);
  vector_write(file, p->force);
  vector_write(file, p->torque);
}

void trace_csv_row(const trace_csv *csv, const hap_trace_row *row)
{
  FILE *file = csv->file;
  fprintf(file, "%.9g", row->t);
  pointer_write(file, &row->pointers[0]);
  fprintf(file, ",%u,%u,%.4g,%.9g", row->bodies, row->contacts, row->tick_us, row->model_age_s);
  for (size_t i = 1; i < csv->pointers; ++i) {
    pointer_write(file, &row->pointers[i]);
  }
  for (size_t k = 0; k < csv->bodies; ++k) {
    vector_write(file, row->body_position[k]);
  }
  fputc('\n', file);
}
