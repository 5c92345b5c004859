/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <errno.h>
#include <stdio.h>
#include <string.h>

#include <png.h>

#include "view/view.h"

/* Writes with libpng, which leaves by longjmp when something fails. */
static bool rows_write(png_structp png, png_infop info, const uint8_t *pixels, const int size[2])
{
  if (setjmp(png_jmpbuf(png)) != 0) {
    return false;
  }
  png_set_IHDR(png, info, (png_uint_32)size[0], (png_uint_32)size[1], 8, PNG_COLOR_TYPE_RGB,
               PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  png_set_compression_level(png, 1); /* pictures come many a second: size matters less than time */
  png_set_filter(png, PNG_FILTER_TYPE_BASE, PNG_FILTER_SUB);
  png_write_info(png, info);
  for (int i = 0; i < size[1]; ++i) {
    png_write_row(png, pixels + 3 * (size_t)size[0] * (size_t)i);
  }
  png_write_end(png, NULL);
  return true;
}

/* libpng's own words would go to stderr. */
static void png_silent(png_structp png, png_const_charp text)
{
  (void)text;
  longjmp(png_jmpbuf(png), 1);
}

static void png_calm(png_structp png, png_const_charp text)
{
  (void)png;
  (void)text;
}

hap_status view_png_write(void *file, const uint8_t *pixels, int width, int height,
                          hap_detail *detail)
{
  const int size[2] = {width, height};
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, NULL, png_silent, png_calm);
  png_infop info = png != NULL ? png_create_info_struct(png) : NULL;
  if (info == NULL) {
    png_destroy_write_struct(&png, NULL);
    return HAP_ERROR_MEMORY;
  }
  errno = 0;
  png_init_io(png, file);
  bool good = rows_write(png, info, pixels, size) && fflush(file) == 0;
  int why = errno;
  png_destroy_write_struct(&png, &info);
  if (!good && detail != NULL) {
    snprintf(detail->text, sizeof detail->text, "cannot be written: %s",
             why != 0 ? strerror(why) : "libpng refuses");
  }
  return good ? HAP_OK : HAP_ERROR_IO;
}
