/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/html_columns.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

#define STEPS 65535.0

void html_bytes_add(html_bytes *io, const void *data, size_t count)
{
  if (io->failed || count == 0) {
    return;
  }
  if (count > io->capacity - io->count) {
    size_t capacity = 2 * io->capacity + count + 4096;
    uint8_t *more = realloc(io->data, capacity);
    if (more == NULL) {
      io->failed = true;
      return;
    }
    io->data = more;
    io->capacity = capacity;
  }
  memcpy(io->data + io->count, data, count);
  io->count += count;
}

void html_bytes_free(html_bytes *of)
{
  free(of->data);
  memset(of, 0, sizeof *of);
}

void html_column_add(html_bytes *io, const double *values, size_t count, double finest, FILE *out)
{
  double least = count > 0 ? values[0] : 0.0;
  double most = least;
  for (size_t i = 0; i < count; ++i) {
    least = fmin(least, values[i]);
    most = fmax(most, values[i]);
  }
  if (most - least <= finest) {
    fprintf(out, "[%.9g,0,%zu]", 0.5 * (least + most), count);
    return;
  }
  const double step = fmax((most - least) / STEPS, finest);
  uint16_t before = 0;
  fprintf(out, "[%.17g,%.17g,%zu]", least, step, count);
  for (size_t i = 0; i < count; ++i) {
    uint16_t now = (uint16_t)lround((values[i] - least) / step);
    uint16_t change = (uint16_t)(now - before);
    html_bytes_add(io, (const uint8_t[]){(uint8_t)change, (uint8_t)(change >> 8)}, 2);
    before = now;
  }
}

static void base64_write(const uint8_t *data, size_t count, FILE *out)
{
  static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  for (size_t i = 0; i < count; i += 3) {
    const size_t here = count - i < 3 ? count - i : 3;
    const uint32_t bits = (uint32_t)data[i] << 16 | (here > 1 ? (uint32_t)data[i + 1] << 8 : 0) |
                          (here > 2 ? data[i + 2] : 0);
    fputc(digits[bits >> 18 & 63], out);
    fputc(digits[bits >> 12 & 63], out);
    fputc(here > 1 ? digits[bits >> 6 & 63] : '=', out);
    fputc(here > 2 ? digits[bits & 63] : '=', out);
  }
}

bool html_bytes_write(const html_bytes *from, FILE *out)
{
  uLongf size = compressBound((uLong)from->count);
  uint8_t *packed = malloc(size + 1);
  const uint8_t none = 0;
  bool good = packed != NULL && !from->failed &&
              compress2(packed, &size, from->count > 0 ? from->data : &none, (uLong)from->count,
                        Z_BEST_COMPRESSION) == Z_OK;
  if (good) {
    base64_write(packed, size, out);
  }
  free(packed);
  return good && ferror(out) == 0;
}
