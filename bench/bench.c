/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>

#include "base/regular.h"
#include "bench/bench.h"
#include "bench/progress.h"
#include "tools/plot.h"

hap_status bench_fail(bench *b, hap_status status, const char *format, ...)
{
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(b->detail.text, sizeof b->detail.text, format, arguments);
  va_end(arguments);
  return status;
}

FILE *bench_csv_open(bench *b, const char *name, const char *header)
{
  char path[PATH_MAX];
  if (mkdir(b->out, 0777) != 0 && errno != EEXIST) {
    (void)bench_fail(b, HAP_ERROR_IO, "%s: %s", b->out, strerror(errno));
    return NULL;
  }
  if (snprintf(path, sizeof path, "%s/%s.csv", b->out, name) >= (int)sizeof path) {
    (void)bench_fail(b, HAP_ERROR_IO, "the name of the folder is too long");
    return NULL;
  }
  const char *why;
  FILE *csv = hapi_regular_create_stream(path, O_TRUNC, &why);
  if (csv == NULL) {
    (void)bench_fail(b, HAP_ERROR_IO, "%s: %s", path, why);
    return NULL;
  }
  if (header != NULL) {
    fprintf(csv, "%s\n", header);
  }
  return csv;
}

hap_status bench_csv_close(bench *b, FILE *csv, hap_status status)
{
  if (csv == NULL) {
    return HAP_ERROR_IO;
  }
  bool broken = ferror(csv) != 0;
  if ((fclose(csv) != 0 || broken) && status >= HAP_OK) {
    return bench_fail(b, HAP_ERROR_IO, "a table in %s could not be written: %s", b->out,
                      strerror(errno));
  }
  return status;
}

hap_status bench_explain(bench *b, hap_session *session, hap_status status)
{
  if (status < HAP_OK) {
    (void)hap_session_detail(session, &b->detail);
  }
  return status;
}

double bench_used_seconds(void)
{
  struct timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* The line about how far it is makes room. */
static void line_say(const char *verdict, const char *format, va_list arguments)
{
  progress_hide();
  fputs(verdict, stdout);
  vprintf(format, arguments);
  putchar('\n');
  progress_show();
}

void bench_say(const char *format, ...)
{
  va_list arguments;
  va_start(arguments, format);
  line_say("", format, arguments);
  va_end(arguments);
}

void bench_check(bench *b, bool good, const char *format, ...)
{
  va_list arguments;
  b->off += b->verify && !good;
  const char *verdict = good ? "ok   " : "off  ";
  va_start(arguments, format);
  line_say(b->verify ? verdict : "", format, arguments);
  va_end(arguments);
}

void bench_skip(const bench *b, const char *format, ...)
{
  va_list arguments;
  if (!b->verify) {
    return;
  }
  va_start(arguments, format);
  line_say("skip ", format, arguments);
  va_end(arguments);
}

static int by_value(const void *a, const void *b)
{
  double x = *(const double *)a;
  double y = *(const double *)b;
  return (x > y) - (x < y);
}

double bench_median(double *values, size_t count)
{
  qsort(values, count, sizeof *values, by_value);
  return bench_quantile(values, count, 0.5);
}

double bench_quantile(const double *sorted, size_t count, double share)
{
  if (count == 0) {
    return 0.0;
  }
  double at = share * (double)(count - 1);
  size_t below = (size_t)at;
  size_t above = below + 1 < count ? below + 1 : below;
  return sorted[below] + (at - (double)below) * (sorted[above] - sorted[below]);
}

bool bench_within(double value, double wanted, double relative)
{
  return fabs(value - wanted) <= relative * fabs(wanted);
}

double bench_percent(double value, double wanted)
{
  return 100.0 * (value / wanted - 1.0);
}

bool bench_find_coupling(const char *name, hap_coupling *out)
{
  for (int i = 0; hap_coupling_name((hap_coupling)i) != NULL; ++i) {
    if (strcmp(name, hap_coupling_name((hap_coupling)i)) == 0) {
      *out = (hap_coupling)i;
      return *out != HAP_COUPLING_DIRECT && *out != HAP_COUPLING_AUTO;
    }
  }
  return false;
}

hap_status bench_draw(bench *b, const char *name, int width, int height, bench_draw_fn draw,
                      const void *data)
{
  char path[PATH_MAX];
  if (!plot_available()) {
    bench_say("no picture %s.svg: %s", name, PLOT_ABSENT_TEXT);
    return HAP_OK;
  }
  if (snprintf(path, sizeof path, "%s/%s.svg", b->out, name) >= (int)sizeof path) {
    return bench_fail(b, HAP_ERROR_IO, "the name of the folder is too long");
  }
  FILE *script = plot_begin(path, width, height, &b->detail);
  if (script == NULL) {
    return HAP_ERROR_IO;
  }
  draw(script, data);
  return plot_end(script, &b->detail);
}
