/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Runs a fuzzer on every file of a folder, whole and cut off at every byte, or every Nth: what
 * fuzzing has found once is tested wherever the tests run, without libFuzzer. An input that fails
 * ends the program; the last line with a '#' tells which it was. */

#include "tests/tap.h"

#include <dirent.h>
#include <sys/stat.h>

#include "tests/fuzz/fuzz.h"

#define FILE_MAX 65536

static const char *folder;
static long cut_step = 1; /* bytes */

/* Fills data; the size, or -1 when it is no file that can be read whole. */
static long read_file(const char *name, uint8_t *data)
{
  char path[4096];
  struct stat about;
  snprintf(path, sizeof path, "%s/%s", folder, name);
  if (stat(path, &about) != 0 || !S_ISREG(about.st_mode) || about.st_size > FILE_MAX) {
    return -1;
  }
  FILE *file = fopen(path, "rb");
  size_t size = file != NULL ? fread(data, 1, FILE_MAX, file) : 0;
  if (file != NULL) {
    fclose(file);
  }
  return (long)size == (long)about.st_size ? (long)size : -1;
}

/* In a block of its own size, which a sanitizer watches. */
static void input_run(const uint8_t *data, size_t size)
{
  uint8_t *copy = malloc(size > 0 ? size : 1);
  memcpy(copy, data, size);
  CHECK(LLVMFuzzerTestOneInput(copy, size) == 0);
  free(copy);
}

/* Number of files. */
static int run_files(bool cut)
{
  static uint8_t data[FILE_MAX];
  struct dirent **names = NULL;
  int count = scandir(folder, &names, NULL, alphasort);
  int files = 0;
  for (int i = 0; i < count; ++i) {
    if (names[i]->d_name[0] != '.') {
      long size = read_file(names[i]->d_name, data);
      CHECK(size >= 0);
      printf("# %s%s\n", names[i]->d_name, cut ? ", cut off" : "");
      fflush(stdout);
      /* from file to file at other places */
      for (long length = cut ? i % cut_step : size; length <= size; length += cut_step) {
        input_run(data, (size_t)length);
      }
      ++files;
    }
    free(names[i]);
  }
  free(names);
  return files;
}

TEST(every_file_of_the_corpus)
{
  CHECK(run_files(false) > 0);
}

TEST(every_file_cut_off)
{
  CHECK(run_files(true) > 0);
}

int main(int argc, char **argv)
{
  folder = argc > 1 ? argv[1] : NULL;
  cut_step = argc > 2 ? strtol(argv[2], NULL, 10) : 1;
  if (folder == NULL || argc > 3 || cut_step < 1) {
    fprintf(stderr, "usage: %s CORPUS_FOLDER [BYTES]\n", argv[0]);
    return 2;
  }
  fuzz_start();
  RUN(every_file_of_the_corpus);
  RUN(every_file_cut_off);
  return tap_done();
}
