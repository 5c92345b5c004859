/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_CYCLES_H
#define HAPODE_BASE_CYCLES_H

/* The processor's own counter of time, read in a few nanoseconds and without the system. Its unit
 * is not known: only shares are taken of it. */

#include <stdbool.h>
#include <stdint.h>

#if defined(__x86_64__) || defined(__i386__)
#include <x86intrin.h>
#endif

#if defined(__x86_64__) || defined(__i386__)
#define HAPI_HAS_CYCLES true
static inline uint64_t hapi_cycles(void)
{
  return __rdtsc();
}
#elif defined(__aarch64__)
#define HAPI_HAS_CYCLES true
static inline uint64_t hapi_cycles(void)
{
  uint64_t now;
  __asm__ volatile("mrs %0, cntvct_el0" : "=r"(now));
  return now;
}
#else
#define HAPI_HAS_CYCLES false
static inline uint64_t hapi_cycles(void)
{
  return 0;
}
#endif

#endif
