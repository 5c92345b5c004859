/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "record/file.h"

#include <stdio.h>
#if defined(__GLIBC__)
#include <gnu/libc-version.h>
#endif
#include <zlib.h>

#include <hapode/version.h>

#include "base/alloc.h"

#if defined(__x86_64__)
#define PROCESSOR "x86_64"
#elif defined(__aarch64__)
#define PROCESSOR "aarch64"
#elif defined(__riscv)
#define PROCESSOR "riscv"
#elif defined(__powerpc64__)
#define PROCESSOR "ppc64"
#elif defined(__i386__)
#define PROCESSOR "i386"
#else
#define PROCESSOR "other"
#endif

#if defined(__linux__)
#define SYSTEM "linux"
#else
#define SYSTEM "other"
#endif

void hapi_file_describe(hapi_file_info *out)
{
  snprintf(out->build.library, sizeof out->build.library, "%s", hap_version());
  snprintf(out->build.machine, sizeof out->build.machine, "%s-%s-%zu", PROCESSOR, SYSTEM,
           8 * sizeof(void *));
#if defined(__GLIBC__)
  snprintf(out->build.system, sizeof out->build.system, "glibc %s", gnu_get_libc_version());
#else
  snprintf(out->build.system, sizeof out->build.system, "other libc");
#endif
  out->joined_size = (uint32_t)sizeof(hapi_joined);
}

void *hapi_file_zlib_allocate(void *user, unsigned count, unsigned size)
{
  (void)user;
  return hapi_alloc_array(count, size);
}

void hapi_file_zlib_release(void *user, void *memory)
{
  (void)user;
  hapi_free(memory);
}

static uint32_t crc_of(uint32_t crc, const void *bytes, size_t size)
{
  return (uint32_t)crc32(crc, bytes, (uInt)size);
}

uint32_t hapi_file_crc_head(const hapi_file_head *head)
{
  hapi_file_head h = *head;
  h.crc = 0;
  return crc_of(0, &h, sizeof h);
}

uint32_t hapi_file_crc_block(const hapi_block_head *head, const void *stored)
{
  hapi_block_head h = *head;
  h.crc = 0;
  return crc_of(crc_of(0, &h, sizeof h), stored, head->stored);
}
