/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_TAP_H
#define HAPODE_TESTS_TAP_H

/* Test Anything Protocol, version 13. A test is one test point. CHECK* note a failure and go on,
 * REQUIRE and SKIP leave the test, from any function that the test calls in its own thread.
 *
 *   TEST(name) { CHECK_NEAR(a, b, 1e-9); }
 *
 * Tests that differ in their data alone are the rows of a table. The first member of a row is the
 * name of its test:
 *
 *   static const fall falls[] = {{"a_ball_falls", ball, 9.81}, {"a_cube_falls", cube, 9.81}};
 *
 *   TEST_EACH(falls, const fall *row) { CHECK(...); }
 *
 * make_main.py writes main: it runs all tests of a file in their order, with ODE initialised. A
 * file with a main of its own lists its tests by RUN. What must come before ODE and the first test:
 *
 *   SET_UP { return folder_make(); }    false: no test is run (SKIP_ALL, BAIL_OUT)
 */

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <hapode/attributes.h>

/* gcc defines a macro, clang has a feature. */
#if defined(__has_feature)
#define TAP_HAS_FEATURE(x) __has_feature(x)
#else
#define TAP_HAS_FEATURE(x) 0
#endif
#if defined(__SANITIZE_THREAD__) || TAP_HAS_FEATURE(thread_sanitizer)
#define TAP_THREAD_SANITIZER 1
#else
#define TAP_THREAD_SANITIZER 0
#endif
#if defined(__SANITIZE_ADDRESS__) || TAP_HAS_FEATURE(address_sanitizer)
#define TAP_ADDRESS_SANITIZER 1
#else
#define TAP_ADDRESS_SANITIZER 0
#endif

typedef struct tap_table {
  const void *rows;
  size_t row_size;
  size_t count;
} tap_table;

typedef struct tap_test {
  const char *name;
  void (*run)(void);
  const tap_table *table; /* NULL: one test, else one for each row */
} tap_test;

extern int tap_failures;         /* in the running test */
extern const void *tap_row;      /* of the running test, in its table */
extern const char *tap_argument; /* the program's first, or "" */

void tap_note(const char *file, int line, const char *what);
void tap_check_near(double a, double b, double tolerance, const char *file, int line,
                    const char *what);
void tap_say(const char *format, ...) HAP_PRINTF(1, 2);
void tap_skip(const char *format, ...) HAP_PRINTF(1, 2);
/* Leaves the running test; what it owns is finished. */
_Noreturn void tap_leave(void);
/* From now on large blocks come from the system, never touched, not from what was freed: for tests
 * that count the pages a thread touches first. */
void tap_fresh_memory(void);
/* Both return false. */
bool tap_skip_all(const char *reason);
bool tap_bail_out(const char *reason);
/* Zeroed memory of the running test. It is finished and freed when the test has ended, the newest
 * first; tap_release does that at once. */
void *tap_own(size_t size, void (*finish)(void *owned));
void tap_release(void *memory);
/* Functions that are called after the last test, the newest first. */
void tap_at_end(void (*function)(void));
void tap_run(void (*test)(void), const char *name);
int tap_done(void);
/* set_up: may be NULL. The arguments only=BEGIN,... and except=BEGIN,... choose tests by how their
 * names begin. */
int tap_main(const tap_test *tests, size_t count, bool (*set_up)(void), int argc, char **argv);

static inline void tap_check(bool good, const char *file, int line, const char *what)
{
  if (!good) {
    tap_note(file, line, what);
  }
}

#define TEST(name)        \
  void test_##name(void); \
  void test_##name(void)
#define TEST_EACH(table, row)                                          \
  static void each_##table(row);                                       \
  extern const tap_table rows_##table;                                 \
  const tap_table rows_##table = {(table), sizeof((table)[0]),         \
                                  sizeof(table) / sizeof((table)[0])}; \
  TEST(table)                                                          \
  {                                                                    \
    each_##table(tap_row);                                             \
  }                                                                    \
  static void each_##table(row)
#define SET_UP           \
  bool tap_set_up(void); \
  bool tap_set_up(void)
#define RUN(name) tap_run(test_##name, #name)
#define CHECK(condition) tap_check((condition), __FILE__, __LINE__, #condition)
/* With a comment when it fails. */
#define REQUIRE_SAY(condition, ...)                      \
  do {                                                   \
    if (!(condition)) {                                  \
      tap_note(__FILE__, __LINE__, "needs " #condition); \
      tap_say(__VA_ARGS__);                              \
      tap_leave();                                       \
    }                                                    \
  } while (0)
#define CHECK_SAY(condition, ...)               \
  do {                                          \
    if (!(condition)) {                         \
      tap_note(__FILE__, __LINE__, #condition); \
      tap_say(__VA_ARGS__);                     \
    }                                           \
  } while (0)
#define CHECK_NEAR(a, b, tolerance) \
  tap_check_near((a), (b), (tolerance), __FILE__, __LINE__, #a " ~ " #b)
#define REQUIRE(condition)                               \
  do {                                                   \
    if (!(condition)) {                                  \
      tap_note(__FILE__, __LINE__, "needs " #condition); \
      tap_leave();                                       \
    }                                                    \
  } while (0)
#define SKIP(...)          \
  do {                     \
    tap_skip(__VA_ARGS__); \
    tap_leave();           \
  } while (0)

#endif
