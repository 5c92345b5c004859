/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/alloc.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "base/assert.h"
#include "base/def.h"
#include "base/hooks.h"

#define HOOKS_COOKIE 0x48484b31u

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

void hap_hooks_init(hap_hooks *hooks, size_t size_of_hooks)
{
  const hap_hooks none = {.cookie = HOOKS_COOKIE};
  hapi_def_init(hooks, size_of_hooks, &none, sizeof none);
}

hap_status hap_hooks_set(const hap_hooks *hooks)
{
  hap_hooks wanted;
  hap_hooks_init(&wanted, sizeof wanted);
  hap_status status = hooks == NULL ? HAP_OK
                                    : hapi_def_read(&wanted, sizeof wanted, hooks, HOOKS_COOKIE,
                                                    "hap_hooks_init", NULL);
  if (status < HAP_OK) {
    return status;
  }
  /* Half a pair would free the memory of one heap in another. */
  if ((wanted.allocate == NULL) != (wanted.release == NULL)) {
    return HAP_ERROR_ARGUMENT;
  }
  if (wanted.allocate == NULL) {
    wanted.allocate = default_allocate;
    wanted.release = default_release;
  }
  if (wanted.log == NULL) {
    wanted.log = default_log;
  }
  current = wanted;
  return HAP_OK;
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

void *hapi_alloc_array(size_t count, size_t size)
{
  if (size != 0 && count > SIZE_MAX / size) {
    return NULL;
  }
  return hapi_alloc(count * size);
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
