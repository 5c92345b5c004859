/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

#include "tests/tap.h"

#include <stdarg.h>

#include <ode/ode.h>

#define TAP_SHOWN_MAX 20
#define TAP_ENDS_MAX 8

int tap_failures;
const char *tap_argument = "";

static int tap_count;
static int tap_failed_points;
static char tap_reason[512]; /* why the running test is skipped; empty: it is not */
static int tap_exit_code;    /* when no test is run */
static void (*tap_ends[TAP_ENDS_MAX])(void);
static int tap_end_count;

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

void tap_skip(const char *format, ...)
{
  va_list list;
  va_start(list, format);
  vsnprintf(tap_reason, sizeof tap_reason, format, list);
  va_end(list);
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

void tap_run(void (*test)(void), const char *name)
{
  tap_failures = 0;
  tap_reason[0] = '\0';
  test();
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

int tap_main(const tap_test *tests, size_t count, bool (*set_up)(void), int argc, char **argv)
{
  tap_argument = argc > 1 ? argv[1] : "";
  bool runs = set_up == NULL || set_up();
  if (runs) {
    dInitODE2(0);
    dAllocateODEDataForThread(dAllocateMaskAll);
    for (size_t i = 0; i < count; ++i) {
      tap_run(tests[i].run, tests[i].name);
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
