/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* lib/base/key_file.h: what is a line, a key, a value, and where an error is said to be. */

#include "tests/files.h"
#include "tests/tap.h"

#include <stdlib.h>
#include <unistd.h>

#include "base/key_file.h"

static char path[160];

/* All keys and values, as "LINE:KEY=VALUE;". */
typedef struct heard {
  char text[2000];
  const char *refused; /* a key */
} heard;

static hap_status line_take(void *self, const hapi_key_file *file, char *key, char *value)
{
  heard *h = self;
  size_t used = strlen(h->text);
  snprintf(h->text + used, sizeof h->text - used, "%lu:%s=%s;", file->line, key, value);
  if (h->refused != NULL && strcmp(key, h->refused) == 0) {
    return hapi_key_file_fail(file, "not this: ", value);
  }
  return HAP_OK;
}

static hap_status read_text(const char *text, heard *h, hap_detail *detail)
{
  hapi_key_file file = {.path = path, .detail = detail};
  file_write(path, text);
  h->text[0] = '\0';
  return hapi_key_file_read(&file, line_take, h);
}

TEST(keys_and_values_are_trimmed)
{
  static const char *const rows[][2] = {
      {"", ""},
      {"\n \t\r\n# a = b\n  # c\n", ""},
      {"a=b", "1:a=b;"},
      {"\t a b\t = c  d \r\n", "1:a b=c  d;"},
      {"a = b = c\n\nd==e\n", "1:a=b = c;3:d==e;"},
      {"a = # b\n", "1:a=# b;"},
      {"a =\nb = \t\n", "1:a=;2:b=;"},
  };
  for (size_t i = 0; i < sizeof rows / sizeof rows[0]; ++i) {
    heard h = {"", NULL};
    hap_detail detail = {""};
    CHECK(read_text(rows[i][0], &h, &detail) == HAP_OK);
    CHECK(strcmp(h.text, rows[i][1]) == 0);
  }
}

TEST(what_is_no_line_is_refused_with_its_place)
{
  static const char *const rows[][2] = {
      {"a = 1\nb\nc = 2\n", "line 2: expected key = value, not b"},
      {"= 1\n", "line 1: expected key = value, not = 1"},
      {"\n  = # 1\n", "line 2: expected key = value"},
  };
  for (size_t i = 0; i < sizeof rows / sizeof rows[0]; ++i) {
    heard h = {"", NULL};
    hap_detail detail = {""};
    CHECK(read_text(rows[i][0], &h, &detail) == HAP_ERROR_FORMAT);
    CHECK(strstr(detail.text, path) != NULL && strstr(detail.text, rows[i][1]) != NULL);
    CHECK(strstr(h.text, "c=2") == NULL);
  }
}

TEST(who_takes_may_end_it)
{
  heard h = {"", "b"};
  hap_detail detail = {""};
  CHECK(read_text("a = 1\nb = 2\nc = 3\n", &h, &detail) == HAP_ERROR_FORMAT);
  CHECK(strcmp(h.text, "1:a=1;2:b=2;") == 0);
  CHECK(strstr(detail.text, "line 2: not this: 2") != NULL);
}

TEST(lines_have_an_end)
{
  heard h = {"", NULL};
  hap_detail detail = {""};
  hapi_key_file file = {.path = path, .detail = &detail};
  char line[600];
  memset(line, 'x', sizeof line);
  line[1] = '=';
  line[510] = '\n';
  file_write_bytes(path, line, 511);
  CHECK(hapi_key_file_read(&file, line_take, &h) == HAP_OK);
  CHECK(strlen(h.text) == strlen("1:x=") + 508 + 1);
  line[510] = 'x';
  line[511] = '\n';
  file_write_bytes(path, line, 512);
  CHECK(hapi_key_file_read(&file, line_take, &h) == HAP_ERROR_FORMAT);
  CHECK(strstr(detail.text, "line 1: longer than 510") != NULL);
  file_write_bytes(path, "a=1\nb\0=2\n", 9);
  CHECK(hapi_key_file_read(&file, line_take, &h) == HAP_ERROR_FORMAT);
  CHECK(strstr(detail.text, "line 2: longer") != NULL);
}

TEST(a_comment_is_taken_off_a_value)
{
  static const char *const rows[][2] = {{"1", "1"},  {"1 # m", "1"},    {"1#m # s", "1"},
                                        {"# m", ""}, {"1 2 \t", "1 2"}, {"", ""}};
  for (size_t i = 0; i < sizeof rows / sizeof rows[0]; ++i) {
    char value[20];
    snprintf(value, sizeof value, "%s", rows[i][0]);
    hapi_key_file_uncomment(value);
    CHECK(strcmp(value, rows[i][1]) == 0);
  }
}

TEST(what_cannot_be_read_says_why)
{
  heard h = {"", NULL};
  hap_detail detail = {""};
  hapi_key_file none = {.path = "/nowhere/at/all", .detail = &detail};
  hapi_key_file folder = {.path = "/proc/self/mem", .detail = &detail};
  hapi_key_file quiet = {.path = "/nowhere/at/all"};
  CHECK(hapi_key_file_read(&none, line_take, &h) == HAP_ERROR_IO);
  CHECK(strstr(detail.text, "/nowhere/at/all: cannot be opened: ") != NULL);
  CHECK(hapi_key_file_read(&folder, line_take, &h) == HAP_ERROR_IO);
  CHECK(strstr(detail.text, "/proc/self/mem, line 1: cannot be read: ") != NULL);
  CHECK(hapi_key_file_read(&quiet, line_take, &h) == HAP_ERROR_IO);
  folder.line = 7;
  CHECK(hapi_key_file_lacks(&folder, "of.", "it") == HAP_ERROR_FORMAT);
  CHECK(strcmp(detail.text, "/proc/self/mem, line 7: the file ends without a line of.it = ...") ==
        0);
}

SET_UP
{
  bool good = folder_make();
  snprintf(path, sizeof path, "%s", folder_path("keys"));
  return good;
}
