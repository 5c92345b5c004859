/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "plugins/replay/csv.h"

#include <errno.h>
#include <string.h>

#include "base/assert.h"
#include "base/log.h"
#include "base/number.h"
#include "base/regular.h"

static const char *const names[HAPI_CSV_COLUMNS_MAX] = {"t", "x", "y", "z", "qw", "qx", "qy", "qz"};

/* The end of a long path tells more than its beginning. */
static const char *short_path(const char *path)
{
  size_t length = strlen(path);
  return length > 200 ? path + length - 200 : path;
}

hap_status hapi_csv_fail(const hapi_csv *csv, hap_status status, const char *text,
                         hap_detail *detail)
{
  return hapi_fail(detail, status, "%s, line %lu: %s", short_path(csv->path), csv->line, text);
}

static bool is_blank(char c)
{
  return c == ' ' || c == '\t';
}

static const char *skip_blanks(const char *at)
{
  while (is_blank(*at)) {
    ++at;
  }
  return at;
}

/* Takes the line end and the blanks before it away. */
static void line_trim(char *text, size_t length)
{
  if (length > 0 && text[length - 1] == '\r') {
    --length;
  }
  while (length > 0 && is_blank(text[length - 1])) {
    --length;
  }
  text[length] = '\0';
}

/* HAP_END at the end of the file. */
static hap_status read_line(hapi_csv *csv, hap_detail *detail)
{
  size_t length = 0;
  int c = getc_unlocked(csv->file);
  csv->line += c != EOF;
  bool any = c != EOF;
  for (; c != EOF && c != '\n'; c = getc_unlocked(csv->file)) {
    if (c == '\0') {
      return hapi_csv_fail(csv, HAP_ERROR_FORMAT, "a zero byte; this is not a text file", detail);
    }
    if (length + 1 == sizeof csv->text) {
      return hapi_csv_fail(csv, HAP_ERROR_FORMAT, "the line is longer than 511 characters", detail);
    }
    csv->text[length++] = (char)c;
  }
  if (ferror(csv->file)) {
    return hapi_fail(detail, HAP_ERROR_IO, "%s, line %lu: cannot be read: %s",
                     short_path(csv->path), csv->line + !any, strerror(errno));
  }
  line_trim(csv->text, length);
  return any ? HAP_OK : HAP_END;
}

/* How many of the known names the line holds, in order and separated by commas; 0: other text. */
static int count_names(const char *text)
{
  const char *at = text;
  for (int i = 0; i < HAPI_CSV_COLUMNS_MAX; ++i) {
    at = skip_blanks(at);
    size_t length = strlen(names[i]);
    if (strncmp(at, names[i], length) != 0) {
      return 0;
    }
    at = skip_blanks(at + length);
    if (*at == '\0') {
      return i + 1;
    }
    if (*at != ',') {
      return 0;
    }
    ++at;
  }
  return 0;
}

static hap_status read_header(hapi_csv *csv, hap_detail *detail)
{
  hap_status status = read_line(csv, detail);
  if (status < 0) {
    return status;
  }
  if (status == HAP_END) {
    csv->line = 1;
    return hapi_csv_fail(csv, HAP_ERROR_FORMAT, "the file is empty", detail);
  }
  const char *text = csv->text;
  if (strncmp(text, "\xEF\xBB\xBF", 3) == 0) {
    text += 3;
  }
  csv->columns = count_names(text);
  if (csv->columns == 4 || csv->columns == 8) {
    return HAP_OK;
  }
  return hapi_fail(detail, HAP_ERROR_FORMAT,
                   "%s, line 1: the header must be t,x,y,z or t,x,y,z,qw,qx,qy,qz, not '%.80s'",
                   short_path(csv->path), text);
}

hap_status hapi_csv_open(hapi_csv *csv, const char *path, hap_detail *detail)
{
  *csv = (hapi_csv){.path = path};
  const char *why = NULL;
  csv->file = hapi_regular_open(path, &why);
  if (csv->file == NULL) {
    return hapi_fail(detail, HAP_ERROR_IO, "%s: cannot be opened: %s", short_path(path), why);
  }
  return read_header(csv, detail);
}

void hapi_csv_close(hapi_csv *csv)
{
  if (csv->file != NULL) {
    fclose(csv->file);
    csv->file = NULL;
  }
}

static hap_status fail_count(const hapi_csv *csv, hap_detail *detail)
{
  int found = 1;
  for (const char *at = csv->text; *at != '\0'; ++at) {
    found += *at == ',';
  }
  return hapi_fail(detail, HAP_ERROR_FORMAT, "%s, line %lu: %d columns, the header has %d",
                   short_path(csv->path), csv->line, found, csv->columns);
}

static hap_status fail_number(const hapi_csv *csv, int column, const char *at, hap_detail *detail)
{
  return hapi_fail(detail, HAP_ERROR_FORMAT,
                   "%s, line %lu: column %s: '%.*s' is not a finite decimal number",
                   short_path(csv->path), csv->line, names[column],
                   (int)(strcspn(at, ",") < 40 ? strcspn(at, ",") : 40), at);
}

static hap_status parse_row(const hapi_csv *csv, double *row, hap_detail *detail)
{
  const char *at = csv->text;
  for (int i = 0; i < csv->columns; ++i) {
    const char *field = skip_blanks(at);
    const char *end = hapi_number_read(field, &row[i]);
    if (end == NULL) {
      return fail_number(csv, i, field, detail);
    }
    end = skip_blanks(end);
    bool last = i + 1 == csv->columns;
    if (*end != '\0' && *end != ',') {
      return fail_number(csv, i, field, detail);
    }
    if ((*end == ',') == last) {
      return fail_count(csv, detail);
    }
    at = end + 1;
  }
  return HAP_OK;
}

/* The line is blank: good when nothing but blank lines follow. */
static hap_status read_blank_end(hapi_csv *csv, hap_detail *detail)
{
  unsigned long first = csv->line;
  hap_status status = HAP_OK;
  while (status == HAP_OK && csv->text[0] == '\0') {
    status = read_line(csv, detail);
  }
  if (status != HAP_OK) {
    return status;
  }
  csv->line = first;
  return hapi_csv_fail(csv, HAP_ERROR_FORMAT, "a blank line between rows", detail);
}

hap_status hapi_csv_next(hapi_csv *csv, double row[HAPI_CSV_COLUMNS_MAX], hap_detail *detail)
{
  HAPI_ASSERT(csv->columns > 0 && csv->columns <= HAPI_CSV_COLUMNS_MAX);
  hap_status status = read_line(csv, detail);
  if (status != HAP_OK) {
    return status;
  }
  if (csv->text[0] == '\0') {
    return read_blank_end(csv, detail);
  }
  return parse_row(csv, row, detail);
}
