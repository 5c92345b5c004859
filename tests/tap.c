/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

#include "tests/tap.h"

#include <setjmp.h>
#include <stdarg.h>
#include <time.h>
#ifdef __GLIBC__
#include <malloc.h>
#endif

#include <ode/ode.h>

#define TAP_SHOWN_MAX 20
#define TAP_ENDS_MAX 8
#define TAP_SLOW 1.0 /* s: what takes longer is said */

int tap_failures;
const void *tap_row;
const char *tap_argument = "";

static int tap_count;
static int tap_failed_points;
static char tap_reason[512]; /* why the running test is skipped; empty: it is not */
static int tap_exit_code;    /* when no test is run */
static void (*tap_ends[TAP_ENDS_MAX])(void);
static int tap_end_count;

typedef struct tap_owned {
  struct tap_owned *older;
  void (*finish)(void *owned);
  max_align_t memory[];
} tap_owned;

static tap_owned *tap_newest; /* of the running test */
static jmp_buf tap_end_of_test;

void tap_note(const char *file, int line, const char *what)
{
  ++tap_failures;
  if (tap_failures <= TAP_SHOWN_MAX) {
    printf("# %s:%d: %s\n", file, line, what);
  }
}

void tap_check_near(double a, double b, double tolerance, const char *file, int line,
                    const char *what)
{
  if (!(fabs(a - b) <= tolerance)) { /* also when one is NaN */
    char text[512];
    snprintf(text, sizeof text, "%s: %.12g, %.12g differ by %.3g, more than %.3g", what, a, b,
             fabs(a - b), tolerance);
    tap_note(file, line, text);
  }
}

void tap_say(const char *format, ...)
{
  va_list list;
  va_start(list, format);
  printf("# ");
  vprintf(format, list);
  printf("\n");
  va_end(list);
}

void tap_skip(const char *format, ...)
{
  va_list list;
  va_start(list, format);
  vsnprintf(tap_reason, sizeof tap_reason, format, list);
  va_end(list);
}

void tap_fresh_memory(void)
{
#ifdef __GLIBC__
  (void)mallopt(M_MMAP_THRESHOLD, 1 << 14);
#endif
}

bool tap_skip_all(const char *reason)
{
  printf("1..0 # SKIP %s\n", reason);
  return false;
}

bool tap_bail_out(const char *reason)
{
  printf("Bail out! %s\n", reason);
  tap_exit_code = 1;
  return false;
}

void *tap_own(size_t size, void (*finish)(void *owned))
{
  tap_owned *owned = calloc(1, sizeof *owned + size);
  if (owned == NULL) {
    printf("Bail out! no memory\n");
    exit(1);
  }
  owned->older = tap_newest;
  owned->finish = finish;
  tap_newest = owned;
  return owned->memory;
}

void tap_release(void *memory)
{
  tap_owned **at = &tap_newest;
  while (*at != NULL && (void *)(*at)->memory != memory) {
    at = &(*at)->older;
  }
  tap_owned *owned = *at;
  if (owned != NULL) {
    *at = owned->older;
    owned->finish(memory);
    free(owned);
  }
}

void tap_leave(void)
{
  longjmp(tap_end_of_test, 1);
}

void tap_at_end(void (*function)(void))
{
  for (int i = 0; i < tap_end_count; ++i) {
    if (tap_ends[i] == function) {
      return;
    }
  }
  if (tap_end_count == TAP_ENDS_MAX) {
    abort();
  }
  tap_ends[tap_end_count++] = function;
}

static double tap_seconds(void)
{
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static void tap_call(void (*test)(void))
{
  if (setjmp(tap_end_of_test) == 0) {
    test();
  }
}

void tap_run(void (*test)(void), const char *name)
{
  double begin = tap_seconds();
  tap_failures = 0;
  tap_reason[0] = '\0';
  tap_call(test);
  while (tap_newest != NULL) {
    tap_release(tap_newest->memory);
  }
  double seconds = tap_seconds() - begin;
  if (seconds > TAP_SLOW) {
    printf("# %.1f s: %s\n", seconds, name);
  }
  ++tap_count;
  tap_failed_points += tap_failures != 0;
  bool skipped = tap_reason[0] != '\0' && tap_failures == 0;
  printf("%s %d - %s%s%s\n", tap_failures != 0 ? "not ok" : "ok", tap_count, name,
         skipped ? " # SKIP " : "", skipped ? tap_reason : "");
  fflush(stdout);
}

int tap_done(void)
{
  printf("1..%d\n", tap_count);
  return tap_failed_points == 0 && tap_count > 0 ? 0 : 1;
}

/* A name that begins with one of the words, which commas part. */
static bool tap_is_listed(const char *name, const char *words)
{
  while (*words != '\0') {
    size_t length = strcspn(words, ",");
    if (length > 0 && strncmp(name, words, length) == 0) {
      return true;
    }
    words += length + (words[length] == ',');
  }
  return false;
}

static bool tap_is_asked(const char *name)
{
  if (strncmp(tap_argument, "only=", 5) == 0) {
    return tap_is_listed(name, tap_argument + 5);
  }
  return strncmp(tap_argument, "except=", 7) != 0 || !tap_is_listed(name, tap_argument + 7);
}

static void tap_run_asked(void (*test)(void), const char *name)
{
  if (tap_is_asked(name)) {
    tap_run(test, name);
  }
}

static void tap_run_rows(void (*test)(void), const tap_table *table)
{
  for (size_t i = 0; i < table->count; ++i) {
    tap_row = (const char *)table->rows + i * table->row_size;
    tap_run_asked(test, *(const char *const *)tap_row);
  }
}

int tap_main(const tap_test *tests, size_t count, bool (*set_up)(void), int argc, char **argv)
{
  tap_argument = argc > 1 ? argv[1] : "";
  bool runs = set_up == NULL || set_up();
  if (runs) {
    dInitODE2(0);
    dAllocateODEDataForThread(dAllocateMaskAll);
    for (size_t i = 0; i < count; ++i) {
      if (tests[i].table != NULL) {
        tap_run_rows(tests[i].run, tests[i].table);
      } else {
        tap_run_asked(tests[i].run, tests[i].name);
      }
    }
  }
  while (tap_end_count > 0) {
    tap_ends[--tap_end_count]();
  }
  if (!runs) {
    return tap_exit_code;
  }
  dCloseODE();
  return tap_done();
}
