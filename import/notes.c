/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "import/notes.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/log.h"

#define CHUNK_SIZE 65536u

struct import_chunk {
  import_chunk *next;
  size_t used;
  size_t size;
  max_align_t bytes[];
};

static import_chunk *chunk_new(import_work *work, size_t least)
{
  size_t size = least > CHUNK_SIZE ? least : CHUNK_SIZE;
  import_chunk *chunk = hapi_alloc(sizeof *chunk + size);
  if (chunk != NULL) {
    chunk->size = size;
    chunk->next = work->chunks;
    work->chunks = chunk;
  }
  return chunk;
}

void *import_take(import_work *work, size_t size)
{
  const size_t grain = sizeof(max_align_t);
  if (size > SIZE_MAX / 2) {
    return NULL;
  }
  size = (size + grain - 1) / grain * grain;
  import_chunk *chunk = work->chunks;
  if (chunk == NULL || chunk->size - chunk->used < size) {
    chunk = chunk_new(work, size);
  }
  if (chunk == NULL) {
    work->starved = true;
    return NULL;
  }
  void *memory = (char *)chunk->bytes + chunk->used;
  chunk->used += size;
  return memory;
}

char *import_text(import_work *work, const char *text, size_t length)
{
  char *copy = import_take(work, length + 1);
  if (copy != NULL) {
    memcpy(copy, text, length);
  }
  return copy;
}

void import_work_finish(import_work *work)
{
  while (work->chunks != NULL) {
    import_chunk *next = work->chunks->next;
    hapi_free(work->chunks);
    work->chunks = next;
  }
}

void import_note(import_work *work, import_place at, const char *format, ...)
{
  hap_detail line;
  va_list arguments;
  int begin = snprintf(line.text, sizeof line.text, "%.200s:%d: ", at.file, at.line);
  va_start(arguments, format);
  vsnprintf(line.text + begin, sizeof line.text - (size_t)begin, format, arguments);
  va_end(arguments);
  ++work->note_count;
  if (work->said != NULL) {
    work->said(work->user, line.text);
  }
  if (work->strict && work->failed == HAP_OK) {
    work->failed = hapi_fail(work->detail, HAP_ERROR_FORMAT, "%s", line.text);
  }
}

hap_status import_refuse(import_work *work, import_place at, const char *format, ...)
{
  hap_detail text;
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(text.text, sizeof text.text, format, arguments);
  va_end(arguments);
  return hapi_fail(work->detail, HAP_ERROR_FORMAT, "%.200s:%d: %.280s", at.file, at.line,
                   text.text);
}

hap_status import_no_memory(import_work *work)
{
  return hapi_fail(work->detail, HAP_ERROR_MEMORY, "no memory for a scene file");
}
