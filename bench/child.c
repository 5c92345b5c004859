/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "bench/child.h"

#include <fcntl.h>
#include <signal.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#define CHILD_WORDS 32

static void child_run(const char *name, const char *const words[], int in, int out)
{
  char path[4096];
  char *arguments[CHILD_WORDS + 2] = {path};
  ssize_t length = readlink("/proc/self/exe", path, sizeof path - 1);
  path[length > 0 ? length : 0] = '\0';
  char *slash = strrchr(path, '/');
  size_t used = slash != NULL ? (size_t)(slash + 1 - path) : 0;
  (void)snprintf(path + used, sizeof path - used, "%s", name);
  for (int i = 0; i < CHILD_WORDS && words[i] != NULL; ++i) {
    arguments[i + 1] = (char *)words[i];
  }
  (void)prctl(PR_SET_PDEATHSIG, SIGKILL);
  dup2(in, STDIN_FILENO);
  dup2(out, STDOUT_FILENO);
  execv(path, arguments);
  _exit(127);
}

bool bench_child_start(const char *name, const char *const words[], bench_child *out)
{
  int in[2];
  int said[2];
  *out = (bench_child){.pid = -1, .input = -1};
  if (pipe2(in, O_CLOEXEC) != 0) {
    return false;
  }
  if (pipe2(said, O_CLOEXEC) != 0) {
    close(in[0]);
    close(in[1]);
    return false;
  }
  out->pid = fork();
  if (out->pid == 0) {
    child_run(name, words, in[0], said[1]);
  }
  close(in[0]);
  close(said[1]);
  out->input = in[1];
  out->said = fdopen(said[0], "r");
  return out->pid > 0 && out->said != NULL;
}

bool bench_child_finish(bench_child *child, int signal)
{
  int status = -1;
  if (child->said != NULL) {
    fclose(child->said);
    close(child->input);
  }
  if (child->pid > 0) {
    if (signal != 0) {
      (void)kill(child->pid, signal);
    }
    (void)waitpid(child->pid, &status, 0);
  }
  *child = (bench_child){.input = -1};
  return status == 0;
}
