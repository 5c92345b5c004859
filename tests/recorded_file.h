/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_RECORDED_FILE_H
#define HAPODE_TESTS_RECORDED_FILE_H

/* A recording in memory, block by block, to be changed and written again under right sums. */

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <zlib.h>

#include "record/cell.h"
#include "record/file.h"
#include "tests/recorded.h"

#define FILE_MAX (8u << 20)

typedef struct block {
  hapi_block_head head;
  char *bytes; /* whole, head.size */
} block;

typedef struct file {
  hapi_file_head head;
  block blocks[512];
  uint32_t count;
} file;

static char raw[FILE_MAX];
static size_t raw_size;

static inline void write_raw(size_t size)
{
  FILE *out = fopen(recorded_path, "wb");
  CHECK(out != NULL && fwrite(raw, 1, size, out) == size);
  if (out != NULL) {
    fclose(out);
  }
}

static inline bool read_raw(void)
{
  FILE *in = fopen(recorded_path, "rb");
  raw_size = in != NULL ? fread(raw, 1, sizeof raw, in) : 0;
  if (in != NULL) {
    fclose(in);
  }
  return raw_size > sizeof(hapi_file_head) && raw_size < sizeof raw;
}

static inline bool file_unpack(file *f)
{
  memset(f, 0, sizeof *f);
  memcpy(&f->head, raw, sizeof f->head);
  for (size_t at = sizeof f->head; at < raw_size && f->count < 512; ++f->count) {
    block *b = &f->blocks[f->count];
    memcpy(&b->head, raw + at, sizeof b->head);
    at += sizeof b->head;
    b->bytes = malloc(b->head.size);
    uLongf size = b->head.size;
    if (b->head.stored == b->head.size) {
      memcpy(b->bytes, raw + at, b->head.size);
    } else if (uncompress((Bytef *)b->bytes, &size, (Bytef *)raw + at, b->head.stored) != Z_OK) {
      free(b->bytes);
      return false;
    }
    at += b->head.stored;
  }
  return f->count > 3;
}

/* With right sums, whatever is in it. */
static inline void file_pack(file *f)
{
  size_t at = sizeof f->head;
  f->head.crc = hapi_file_crc_head(&f->head);
  memcpy(raw, &f->head, sizeof f->head);
  for (uint32_t i = 0; i < f->count; ++i) {
    block *b = &f->blocks[i];
    b->head.stored = b->head.size;
    b->head.crc = hapi_file_crc_block(&b->head, b->bytes);
    memcpy(raw + at, &b->head, sizeof b->head);
    memcpy(raw + at + sizeof b->head, b->bytes, b->head.size);
    at += sizeof b->head + b->head.size;
  }
  write_raw(at);
}

static inline void file_release(file *f)
{
  for (uint32_t i = 0; i < f->count; ++i) {
    free(f->blocks[i].bytes);
  }
}

static inline file file_fresh(const char *scene_name, int ms)
{
  file f = {.count = 0};
  recorded_setup s = recorded_setup_of(scene_name, HAP_MODEL_CONTACT, ms);
  s.ticks = (uint64_t)ms;
  (void)recorded_make(&s);
  CHECK(read_raw() && file_unpack(&f));
  return f;
}

#endif
