/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/alloc.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "base/assert.h"

static void *default_allocate(size_t size, void *user)
{
  (void)user;
  return malloc(size);
}

static void default_release(void *memory, void *user)
{
  (void)user;
  free(memory);
}

static void default_log(hap_log_level level, const char *text, void *user)
{
  (void)level;
  (void)text;
  (void)user;
}

/* Not atomic: hap_hooks_set is promised to come before any object of the library. */
static hap_hooks current = {
    .allocate = default_allocate, .release = default_release, .log = default_log};

const hap_hooks *hapi_hooks(void)
{
  return &current;
}

void hapi_hooks_use(const hap_hooks *hooks)
{
  HAPI_ASSERT((hooks->allocate == NULL) == (hooks->release == NULL));
  current = *hooks;
  if (current.allocate == NULL) {
    current.allocate = default_allocate;
    current.release = default_release;
  }
  if (current.log == NULL) {
    current.log = default_log;
  }
}

void *hapi_alloc(size_t size)
{
  /* One byte at least: malloc(0) may answer NULL, which here means out of memory. */
  size_t wanted = size != 0 ? size : 1;
  void *memory = current.allocate(wanted, current.user);
  if (memory != NULL) {
    memset(memory, 0, wanted);
  }
  return memory;
}

/* calloc takes large blocks from the system, which gives them zeroed and page by page. */
void *hapi_alloc_late(size_t count, size_t size)
{
  if (current.allocate != default_allocate || count == 0 || size == 0) {
    return hapi_alloc_array(count, size);
  }
  return calloc(count, size);
}

void *hapi_alloc_array(size_t count, size_t size)
{
  if (size != 0 && count > SIZE_MAX / size) {
    return NULL;
  }
  return hapi_alloc(count * size);
}

/* The heap's own pointer stands before the line. */
void *hapi_alloc_lines(size_t count, size_t size)
{
  const size_t room = HAPI_CACHE_LINE + sizeof(void *);
  if (size != 0 && count > (SIZE_MAX - room) / size) {
    return NULL;
  }
  unsigned char *memory = hapi_alloc(count * size + room);
  if (memory == NULL) {
    return NULL;
  }
  unsigned char *line = memory + sizeof memory;
  line += (HAPI_CACHE_LINE - (uintptr_t)line % HAPI_CACHE_LINE) % HAPI_CACHE_LINE;
  memcpy(line - sizeof memory, &memory, sizeof memory);
  return line;
}

void hapi_free_lines(void *memory)
{
  void *of_heap;
  if (memory != NULL) {
    memcpy(&of_heap, (unsigned char *)memory - sizeof of_heap, sizeof of_heap);
    hapi_free(of_heap);
  }
}

void hapi_free(void *memory)
{
  if (memory != NULL) {
    current.release(memory, current.user);
  }
}

bool hapi_reserve(void **array, uint32_t *capacity, uint32_t used, uint32_t count, size_t size)
{
  HAPI_ASSERT(size > 0 && used <= *capacity);
  HAPI_ASSERT(*capacity == 0 || *array != NULL);
  if (used + count <= *capacity) {
    return true;
  }
  uint32_t wanted = 2 * (used + count) + 64;
  void *more = hapi_alloc_array(wanted, size);
  if (more == NULL) {
    return false;
  }
  if (used > 0) {
    memcpy(more, *array, used * size);
  }
  hapi_free(*array);
  *array = more;
  *capacity = wanted;
  return true;
}
