/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_TAP_H
#define HAPODE_TESTS_TAP_H

/* Test Anything Protocol, version 13. A program runs test functions one after the other; a test is
 * one test point. CHECK* note a failure and go on, REQUIRE leaves the test.
 *
 *   TEST(name) { CHECK_NEAR(a, b, 1e-9); }
 *   int main(void) { RUN(name); return tap_done(); }
 */

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int tap_count;
static int tap_failed_points;
static int tap_failures;   /* in the running test */
static char tap_skip[512]; /* reason; empty: not skipped */

static void tap_note(const char *file, int line, const char *what)
{
  ++tap_failures;
  if (tap_failures <= 20) {
    printf("# %s:%d: %s\n", file, line, what);
  }
}

static inline void tap_check(bool good, const char *file, int line, const char *what)
{
  if (!good) {
    tap_note(file, line, what);
  }
}

static inline void tap_check_near(double a, double b, double tolerance, const char *file, int line,
                                  const char *what)
{
  if (!(fabs(a - b) <= tolerance)) { /* also when one is NaN */
    char text[512];
    snprintf(text, sizeof text, "%s: %.12g, %.12g differ by %.3g, more than %.3g", what, a, b,
             fabs(a - b), tolerance);
    tap_note(file, line, text);
  }
}

static void tap_run(void (*test)(void), const char *name)
{
  tap_failures = 0;
  tap_skip[0] = '\0';
  test();
  ++tap_count;
  tap_failed_points += tap_failures != 0;
  printf("%s %d - %s%s%s\n", tap_failures != 0 ? "not ok" : "ok", tap_count, name,
         tap_skip[0] != '\0' && tap_failures == 0 ? " # SKIP " : "",
         tap_failures == 0 ? tap_skip : "");
  fflush(stdout);
}

static int tap_done(void)
{
  printf("1..%d\n", tap_count);
  return tap_failed_points == 0 && tap_count > 0 ? 0 : 1;
}

#define TEST(name) static void name(void)
#define RUN(name) tap_run(name, #name)
#define CHECK(condition) tap_check((condition), __FILE__, __LINE__, #condition)
#define CHECK_NEAR(a, b, tolerance) \
  tap_check_near((a), (b), (tolerance), __FILE__, __LINE__, #a " ~ " #b)
#define REQUIRE(condition)                               \
  do {                                                   \
    if (!(condition)) {                                  \
      tap_note(__FILE__, __LINE__, "needs " #condition); \
      return;                                            \
    }                                                    \
  } while (0)
#define SKIP(...)                                     \
  do {                                                \
    snprintf(tap_skip, sizeof tap_skip, __VA_ARGS__); \
    return;                                           \
  } while (0)

#endif
