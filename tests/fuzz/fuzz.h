/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_FUZZ_FUZZ_H
#define HAPODE_TESTS_FUZZ_FUZZ_H

/* A fuzzer is one file fuzz_READER.c that defines fuzz_one, a folder corpus/READER and one word in
 * meson.build. fuzz_one hands the bytes to one reader and checks what it promises. Around it,
 * fuzz.c counts the library's allocations, and runs each input a second time with one of them
 * failing. */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <hapode/status.h>

/* Defined by the fuzzer. May be called any number of times; leaves nothing allocated. */
void fuzz_one(const uint8_t *data, size_t size);

/* Once, before the first input. */
void fuzz_start(void);

/* One input; the name and the type are libFuzzer's. */
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* Whether an allocation of the running input was refused. */
bool fuzz_starved(void);

/* The bytes as a text, in a block of its own and of just its size, so that a sanitizer sees a
 * reader that goes beyond it. Ends at the first zero byte. Free it. */
char *fuzz_text(const uint8_t *data, size_t size);

/* Fills it so that a text without end is seen. */
void fuzz_detail_spoil(hap_detail *detail);

/* What every reader owes: a refusal has no result and a text that ends; HAP_ERROR_MEMORY comes
 * when, and only when, an allocation was refused. */
void fuzz_check_answer(hap_status status, const void *result, const hap_detail *detail);

/* A file in memory with these bytes; path, of at least 40 bytes, opens it. Close the descriptor. */
int fuzz_file(const uint8_t *data, size_t size, char *path, size_t path_size);

#define FUZZ_CHECK(condition)                                                 \
  do {                                                                        \
    if (!(condition)) {                                                       \
      fprintf(stderr, "%s:%d: not so: %s\n", __FILE__, __LINE__, #condition); \
      abort();                                                                \
    }                                                                         \
  } while (0)

#endif
