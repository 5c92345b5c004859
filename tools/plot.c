/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/plot.h"

#include <errno.h>
#include <limits.h>
#include <spawn.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/log.h"

bool plot_available(void)
{
#ifdef PLOT_DISABLED
  return false;
#else
  const char *path = getenv("PATH");
  while (path != NULL && *path != '\0') {
    size_t length = strcspn(path, ":");
    char file[PATH_MAX];
    int printed = snprintf(file, sizeof file, "%.*s/gnuplot", (int)length, path);
    if (length > 0 && printed < (int)sizeof file && access(file, X_OK) == 0) {
      return true;
    }
    path += length + (path[length] == ':');
  }
  return false;
#endif
}

void plot_string(FILE *script, const char *text)
{
  fputc('\'', script);
  for (; *text != '\0'; ++text) {
    if (*text == '\'') {
      fputc('\'', script);
    }
    fputc(*text, script);
  }
  fputc('\'', script);
}

FILE *plot_begin(const char *svg_path, int width, int height, hap_detail *detail)
{
  FILE *script = tmpfile();
  if (script == NULL) {
    snprintf(detail->text, sizeof detail->text, "no temporary file for gnuplot's script: %s",
             strerror(errno));
    return NULL;
  }
  /* Colours: Okabe and Ito, without the yellow. */
  fprintf(script,
          "set encoding utf8\n"
          "set terminal svg size %d,%d font 'DejaVu Sans,12' background rgb 'white'\n"
          "set output ",
          width, height);
  plot_string(script, svg_path);
  fprintf(script,
          "\nset linetype 1 lc rgb '#0072b2' lw 1.5\n"
          "set linetype 2 lc rgb '#d55e00' lw 1.5\n"
          "set linetype 3 lc rgb '#009e73' lw 1.5\n"
          "set linetype 4 lc rgb '#cc79a7' lw 1.5\n"
          "set linetype 5 lc rgb '#e69f00' lw 1.5\n"
          "set linetype 6 lc rgb '#56b4e9' lw 1.5\n"
          "set style line 100 lc rgb '#d0d0d0' lw 0.5\n"
          "set grid linestyle 100\n"
          "set border 3 lc rgb '#606060'\n"
          "set tics nomirror\n");
  return script;
}

/* Starts gnuplot with the script as its input and its words into errors. */
static int gnuplot_start(FILE *script, FILE *errors, pid_t *out)
{
  char program[] = "gnuplot";
  char from_input[] = "-";
  char *arguments[] = {program, from_input, NULL};
  posix_spawn_file_actions_t actions;
  int error = posix_spawn_file_actions_init(&actions);
  if (error != 0) {
    return error;
  }
  error = posix_spawn_file_actions_adddup2(&actions, fileno(script), STDIN_FILENO);
  if (error == 0) {
    error = posix_spawn_file_actions_adddup2(&actions, fileno(errors), STDOUT_FILENO);
  }
  if (error == 0) {
    error = posix_spawn_file_actions_adddup2(&actions, fileno(errors), STDERR_FILENO);
  }
  if (error == 0) {
    error = posix_spawnp(out, program, &actions, NULL, arguments, environ);
  }
  posix_spawn_file_actions_destroy(&actions);
  return error;
}

static hap_status wait_for(pid_t child, FILE *errors, hap_detail *detail)
{
  int result = 0;
  char words[400];
  while (waitpid(child, &result, 0) < 0) {
    if (errno != EINTR) {
      return hapi_fail(detail, HAP_ERROR_SYSTEM, "gnuplot was lost: %s", strerror(errno));
    }
  }
  if (WIFEXITED(result) && WEXITSTATUS(result) == 0) {
    return HAP_OK;
  }
  rewind(errors);
  words[fread(words, 1, sizeof words - 1, errors)] = '\0';
  return hapi_fail(detail, HAP_ERROR_IO, "gnuplot failed: %s", words);
}

/* The offset of script's descriptor is where gnuplot begins to read. */
static hap_status gnuplot_run(FILE *script, hap_detail *detail)
{
  if (ferror(script) != 0 || fflush(script) != 0 || lseek(fileno(script), 0, SEEK_SET) != 0) {
    return hapi_fail(detail, HAP_ERROR_IO, "gnuplot's script could not be written: %s",
                     strerror(errno));
  }
  FILE *errors = tmpfile();
  if (errors == NULL) {
    return hapi_fail(detail, HAP_ERROR_IO, "no temporary file: %s", strerror(errno));
  }
  pid_t child = 0;
  hap_status status = HAP_ERROR_SYSTEM;
  int error = gnuplot_start(script, errors, &child);
  if (error != 0) {
    snprintf(detail->text, sizeof detail->text, "gnuplot cannot be started: %s", strerror(error));
  } else {
    status = wait_for(child, errors, detail);
  }
  fclose(errors);
  return status;
}

hap_status plot_end(FILE *script, hap_detail *detail)
{
  if (script == NULL) {
    return HAP_ERROR_ARGUMENT; /* detail is plot_begin's */
  }
  hap_status status = HAP_ERROR_UNSUPPORTED;
  if (plot_available()) {
    status = gnuplot_run(script, detail);
  } else {
    snprintf(detail->text, sizeof detail->text, PLOT_ABSENT_TEXT);
  }
  fclose(script);
  return status;
}
