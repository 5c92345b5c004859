/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

#include "tests/files.h"

#include <ftw.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

#include "tests/tap.h"

#define PATHS 8
#define MODULES 8

char test_folder[100];

static int entry_remove(const char *path, const struct stat *about, int kind, struct FTW *walk)
{
  (void)about;
  (void)kind;
  (void)walk;
  return remove(path);
}

static int content_remove(const char *path, const struct stat *about, int kind, struct FTW *walk)
{
  return walk->level > 0 ? entry_remove(path, about, kind, walk) : 0;
}

void folder_clear(void)
{
  (void)nftw(test_folder, content_remove, 8, FTW_DEPTH | FTW_PHYS);
}

static void folder_remove(void)
{
  (void)nftw(test_folder, entry_remove, 8, FTW_DEPTH | FTW_PHYS);
}

bool folder_make(void)
{
  const char *base = getenv("TMPDIR");
  snprintf(test_folder, sizeof test_folder, "%.70s/hapode-test-XXXXXX",
           base != NULL ? base : "/tmp");
  (void)umask(022); /* modules that others may write are refused */
  if (mkdtemp(test_folder) == NULL) {
    return tap_bail_out("no temporary folder");
  }
  tap_at_end(folder_remove);
  return true;
}

const char *folder_path(const char *name)
{
  static char paths[PATHS][160];
  static int next;
  next = (next + 1) % PATHS;
  snprintf(paths[next], sizeof paths[next], "%s/%s", test_folder, name);
  return paths[next];
}

static void file_copy(const char *from, const char *to)
{
  struct stat about;
  FILE *file = fopen(from, "r");
  size_t size = file != NULL && fstat(fileno(file), &about) == 0 ? (size_t)about.st_size : 0;
  char *bytes = calloc(size + 1, 1);
  if (file != NULL && bytes != NULL && fread(bytes, 1, size, file) == size) {
    file_write_bytes(to, bytes, size);
  }
  free(bytes);
  if (file != NULL) {
    fclose(file);
  }
}

const char *folder_module(const char *variable)
{
  static char paths[MODULES][160];
  static int count;
  const char *from = getenv(variable);
  const char *name = from != NULL ? strrchr(from, '/') : NULL;
  if (name == NULL) {
    return NULL;
  }
  const char *path = folder_path(name + 1);
  for (int i = 0; i < count; ++i) {
    if (strcmp(paths[i], path) == 0) {
      return paths[i];
    }
  }
  file_copy(from, path);
  if (count == MODULES || chmod(path, 0755) != 0) {
    return NULL;
  }
  return strcpy(paths[count++], path);
}

bool file_exists(const char *path)
{
  struct stat about;
  return stat(path, &about) == 0;
}

const char *file_text(const char *path)
{
  static char *text;
  struct stat about;
  FILE *file = fopen(path, "r");
  size_t size = file != NULL && fstat(fileno(file), &about) == 0 ? (size_t)about.st_size : 0;
  free(text);
  text = calloc(size + 1, 1);
  size_t got = text != NULL && file != NULL ? fread(text, 1, size, file) : 0;
  if (file != NULL) {
    fclose(file);
  }
  return text != NULL && got == size ? text : "";
}

void file_write_bytes(const char *path, const void *bytes, size_t size)
{
  FILE *file = fopen(path, "w");
  if (file == NULL || fwrite(bytes, 1, size, file) != size || fclose(file) != 0) {
    printf("Bail out! cannot write %s\n", path);
    exit(1);
  }
}

void file_write(const char *path, const char *text)
{
  file_write_bytes(path, text, strlen(text));
}

static int lines_count(const char *text, const char *part, bool at_begin)
{
  int count = 0;
  for (const char *line = text; *line != '\0';) {
    const char *end = line + strcspn(line, "\n");
    const char *found = strstr(line, part);
    count += found != NULL && (at_begin ? found == line : found + strlen(part) <= end);
    line = end + (*end == '\n');
  }
  return count;
}

int lines_with(const char *text, const char *part)
{
  return lines_count(text, part, false);
}

int lines_from(const char *text, const char *part)
{
  return lines_count(text, part, true);
}
