/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tests/fuzz/fuzz.h"

#include <stdatomic.h>
#include <sys/mman.h>
#include <unistd.h>

#include <hapode/hooks.h>

static struct {
  atomic_long calls;   /* of this run */
  atomic_long lives;   /* blocks that are not released */
  atomic_long fail_at; /* number of the call that fails, from 1; 0: none */
  atomic_bool failed;
} heap;

static void *counted_allocate(size_t size, void *user)
{
  (void)user;
  if (atomic_fetch_add(&heap.calls, 1) + 1 == atomic_load(&heap.fail_at)) {
    atomic_store(&heap.failed, true);
    return NULL;
  }
  void *memory = malloc(size);
  FUZZ_CHECK(memory != NULL);
  memset(memory, 0xa5, size); /* whoever does not clear it shall notice */
  atomic_fetch_add(&heap.lives, 1);
  return memory;
}

static void counted_release(void *memory, void *user)
{
  (void)user;
  atomic_fetch_sub(&heap.lives, 1);
  free(memory);
}

void fuzz_start(void)
{
  hap_hooks hooks;
  hap_hooks_init(&hooks, sizeof hooks);
  hooks.allocate = counted_allocate;
  hooks.release = counted_release;
  FUZZ_CHECK(hap_hooks_set(&hooks) == HAP_OK);
}

bool fuzz_starved(void)
{
  return atomic_load(&heap.failed);
}

static void input_run(const uint8_t *data, size_t size, long fail_at)
{
  atomic_store(&heap.calls, 0);
  atomic_store(&heap.failed, false);
  atomic_store(&heap.fail_at, fail_at);
  fuzz_one(data, size);
  FUZZ_CHECK(atomic_load(&heap.lives) == 0);
}

/* Which allocation fails depends on the bytes alone, so that an input tells the same every time. */
static long failure_pick(const uint8_t *data, size_t size, long calls)
{
  uint32_t hash = 2166136261u; /* FNV-1a */
  for (size_t i = 0; i < size; ++i) {
    hash = (hash ^ data[i]) * 16777619u;
  }
  return 1 + (long)(hash % (uint32_t)calls);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
  input_run(data, size, 0);
  long calls = atomic_load(&heap.calls);
  if (calls > 0) {
    input_run(data, size, failure_pick(data, size, calls));
  }
  return 0;
}

char *fuzz_text(const uint8_t *data, size_t size)
{
  const uint8_t *end = size > 0 ? memchr(data, 0, size) : NULL;
  size_t length = end != NULL ? (size_t)(end - data) : size;
  char *text = malloc(length + 1);
  FUZZ_CHECK(text != NULL);
  if (length > 0) {
    memcpy(text, data, length);
  }
  text[length] = '\0';
  return text;
}

void fuzz_detail_spoil(hap_detail *detail)
{
  memset(detail->text, '#', sizeof detail->text);
}

void fuzz_check_answer(hap_status status, const void *result, const hap_detail *detail)
{
  FUZZ_CHECK((status == HAP_ERROR_MEMORY) == fuzz_starved());
  FUZZ_CHECK((result != NULL) == (status >= HAP_OK));
  if (status < HAP_OK) {
    FUZZ_CHECK(memchr(detail->text, '\0', sizeof detail->text) != NULL);
    FUZZ_CHECK(detail->text[0] != '\0');
  }
}

int fuzz_file(const uint8_t *data, size_t size, char *path, size_t path_size)
{
  int descriptor = memfd_create("fuzz", 0);
  FUZZ_CHECK(descriptor >= 0);
  for (size_t done = 0; done < size;) {
    ssize_t written = write(descriptor, data + done, size - done);
    FUZZ_CHECK(written > 0);
    done += (size_t)written;
  }
  FUZZ_CHECK(snprintf(path, path_size, "/proc/self/fd/%d", descriptor) < (int)path_size);
  return descriptor;
}
