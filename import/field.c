/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "import/field.h"

#include <math.h>
#include <setjmp.h>
#include <stdio.h>
#include <string.h>

#ifdef HAPODE_IMPORT_PNG
#include <png.h>
#endif

#include "base/alloc.h"

#define SIDE_MOST 4096

static import_field *field_new(import_work *work, uint32_t rows, uint32_t columns)
{
  import_field *field = import_take(work, sizeof *field);
  double *heights = import_take(work, sizeof *heights * rows * columns);
  if (field == NULL || heights == NULL) {
    return NULL;
  }
  *field = (import_field){.heights = heights, .rows = rows, .columns = columns};
  return field;
}

static bool counts_are_good(uint32_t rows, uint32_t columns)
{
  return rows >= 1 && columns >= 1 && rows <= SIDE_MOST && columns <= SIDE_MOST;
}

static const char too_large[] = "more than 4096 rows or columns, or none";

#ifdef HAPODE_IMPORT_PNG

typedef struct png_reading {
  import_work *work;
  FILE *in;
  png_structp png;
  png_infop info;
  unsigned char *bytes;
  unsigned char **rows;
  import_field *field;
  const char *why;
  jmp_buf failed;
} png_reading;

static void png_fail(png_structp png, png_const_charp text)
{
  png_reading *r = png_get_error_ptr(png);
  (void)text;
  longjmp(r->failed, 1);
}

static void png_pass_over(png_structp png, png_const_charp text)
{
  (void)png, (void)text;
}

/* Bytes as they are in the file, without gamma; of a colour its red. */
static void png_read_all(png_reading *r)
{
  png_init_io(r->png, r->in);
  png_read_info(r->png, r->info);
  const uint32_t rows = png_get_image_height(r->png, r->info);
  const uint32_t columns = png_get_image_width(r->png, r->info);
  if (!counts_are_good(rows, columns)) {
    r->why = too_large;
    return;
  }
  png_set_strip_16(r->png);
  png_set_palette_to_rgb(r->png);
  png_set_expand_gray_1_2_4_to_8(r->png);
  (void)png_set_interlace_handling(r->png);
  png_read_update_info(r->png, r->info);
  const size_t stride = png_get_rowbytes(r->png, r->info);
  r->bytes = hapi_alloc_array(rows, stride);
  r->rows = hapi_alloc_array(rows, sizeof *r->rows);
  import_field *field = field_new(r->work, rows, columns);
  if (r->bytes == NULL || r->rows == NULL || field == NULL) {
    r->work->starved = true;
    return;
  }
  for (uint32_t i = 0; i < rows; ++i) {
    r->rows[i] = r->bytes + i * stride;
  }
  png_read_image(r->png, r->rows);
  const size_t channels = png_get_channels(r->png, r->info);
  for (uint32_t i = 0; i < rows; ++i) { /* pictures begin at the top */
    for (uint32_t k = 0; k < columns; ++k) {
      field->heights[(size_t)(rows - 1 - i) * columns + k] = r->rows[i][k * channels];
    }
  }
  r->field = field;
}

static import_field *png_read(import_work *work, const char *path, const char **out_why)
{
  png_reading r = {.work = work, .in = fopen(path, "rb"), .why = "no PNG that can be read"};
  if (r.in == NULL) {
    *out_why = "it cannot be opened";
    return NULL;
  }
  r.png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &r, png_fail, png_pass_over);
  r.info = r.png != NULL ? png_create_info_struct(r.png) : NULL;
  if (r.info != NULL && setjmp(r.failed) == 0) {
    png_read_all(&r);
  }
  png_destroy_read_struct(&r.png, &r.info, NULL);
  hapi_free(r.bytes);
  hapi_free(r.rows);
  (void)fclose(r.in);
  *out_why = r.why;
  return r.field;
}

#else

static import_field *png_read(import_work *work, const char *path, const char **out_why)
{
  (void)work, (void)path;
  *out_why = "this build reads no PNG (Debian: libpng-dev)";
  return NULL;
}

#endif

static import_field *numbers_read(import_work *work, FILE *in, const char **out_why)
{
  int32_t counts[2];
  *out_why = "no heights that can be read";
  if (fread(counts, sizeof counts[0], 2, in) != 2) {
    return NULL;
  }
  if (counts[0] < 1 || counts[1] < 1 ||
      !counts_are_good((uint32_t)counts[0], (uint32_t)counts[1])) {
    *out_why = too_large;
    return NULL;
  }
  import_field *field = field_new(work, (uint32_t)counts[0], (uint32_t)counts[1]);
  const size_t count = field != NULL ? (size_t)field->rows * field->columns : 0;
  for (size_t i = 0; i < count; ++i) {
    float height;
    if (fread(&height, sizeof height, 1, in) != 1 || !(fabsf(height) <= 1e12F)) {
      return NULL;
    }
    field->heights[i] = (double)height;
  }
  return fgetc(in) == EOF ? field : NULL;
}

import_field *import_field_file(import_work *work, const char *path, const char **out_why)
{
  const char *dot = strrchr(path, '.');
  if (dot != NULL && (strcmp(dot, ".png") == 0 || strcmp(dot, ".PNG") == 0)) {
    return png_read(work, path, out_why);
  }
  FILE *in = fopen(path, "rb");
  *out_why = "it cannot be opened";
  if (in == NULL) {
    return NULL;
  }
  import_field *field = numbers_read(work, in, out_why);
  (void)fclose(in);
  return field;
}

void import_field_scale(import_field *field, double height)
{
  const size_t count = (size_t)field->rows * field->columns;
  double low = INFINITY;
  double high = -INFINITY;
  for (size_t i = 0; i < count; ++i) {
    low = fmin(low, field->heights[i]);
    high = fmax(high, field->heights[i]);
  }
  for (size_t i = 0; i < count; ++i) {
    field->heights[i] = high > low ? height * (field->heights[i] - low) / (high - low) : 0.0;
  }
}
