/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

#include "tests/program.h"

#include <fcntl.h>
#include <spawn.h>
#include <stdarg.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/tap.h"

#define ARGUMENTS_MAX 40

extern char **environ;

program_result ran;

static const char *program_path;

bool program_use(const char *variable)
{
  program_path = getenv(variable);
  if (program_path == NULL) {
    printf("# %s is not set\n", variable);
    return tap_skip_all("needs the path of the program in the environment");
  }
  return folder_make();
}

pid_t program_start(const char *arguments, char **environment)
{
  static char words[4000];
  char *argv[ARGUMENTS_MAX + 2] = {words};
  size_t count = 1;
  posix_spawn_file_actions_t actions;
  pid_t child = -1;
  int used = snprintf(words, sizeof words, "%s", program_path) + 1;
  snprintf(words + used, sizeof words - (size_t)used, "%s", arguments);
  for (char *rest = NULL, *word = strtok_r(words + used, " ", &rest);
       word != NULL && count <= ARGUMENTS_MAX; word = strtok_r(NULL, " ", &rest)) {
    argv[count++] = word;
  }
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, folder_path("out"),
                                   O_WRONLY | O_CREAT | O_TRUNC, 0600);
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, folder_path("err"),
                                   O_WRONLY | O_CREAT | O_TRUNC, 0600);
  if (posix_spawn(&child, argv[0], &actions, NULL, argv,
                  environment != NULL ? environment : environ) != 0) {
    child = -1;
  }
  posix_spawn_file_actions_destroy(&actions);
  return child;
}

void program_look(void)
{
  snprintf(ran.out, sizeof ran.out, "%s", file_text(folder_path("out")));
  snprintf(ran.err, sizeof ran.err, "%s", file_text(folder_path("err")));
}

int program_finish(pid_t child)
{
  int result = 0;
  bool ended = child > 0 && waitpid(child, &result, 0) == child && WIFEXITED(result);
  ran.code = ended ? WEXITSTATUS(result) : -1;
  program_look();
  return ran.code;
}

int run(const char *format, ...)
{
  char arguments[3000];
  va_list list;
  va_start(list, format);
  vsnprintf(arguments, sizeof arguments, format, list);
  va_end(list);
  return program_finish(program_start(arguments, NULL));
}

bool says(const char *text)
{
  bool found = strstr(ran.err, text) != NULL;
  if (!found) {
    printf("# \"%s\" is not in: %.400s\n", text, ran.err);
  }
  return found;
}

int said_lines(const char *part)
{
  return lines_with(ran.out, part) + lines_with(ran.err, part);
}

/* Options of a sanitizer behind those that are set. */
static void options_add(const char *variable, const char *option)
{
  char both[1000];
  const char *set = getenv(variable);
  (void)snprintf(both, sizeof both, "%s%s%s", set != NULL ? set : "", set != NULL ? ":" : "",
                 option);
  setenv(variable, both, 1);
}

int program_again(const char *test, const char *variable, const char *value)
{
  int status = -1;
  char only[200];
  fflush(stdout);
  pid_t child = fork();
  if (child == 0) {
    const int nowhere = open("/dev/null", O_WRONLY);
    (void)snprintf(only, sizeof only, "only=%s", test);
    setenv(variable, value, 1);
    options_add("ASAN_OPTIONS", "detect_leaks=0");
    options_add("TSAN_OPTIONS", "report_thread_leaks=0");
    (void)dup2(nowhere, STDOUT_FILENO);
    execl("/proc/self/exe", "test", only, (char *)NULL);
    _exit(127);
  }
  return waitpid(child, &status, 0) == child && WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}
