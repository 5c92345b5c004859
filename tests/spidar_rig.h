/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_SPIDAR_RIG_H
#define HAPODE_TESTS_SPIDAR_RIG_H

/* A spidar-emulator as a process of its own, with commands and answers. */

#include <errno.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#define EMULATED_WAIT_MS 20000

typedef struct emulated {
  pid_t pid;
  int in;
  FILE *out;
  char port[128]; /* a link, which stays when the port is another one */
  char folder[64];
} emulated;

static inline void emulated_sleep(double seconds)
{
  const struct timespec length = {(time_t)seconds,
                                  (long)(1e9 * (seconds - (double)(time_t)seconds))};
  nanosleep(&length, NULL);
}

static inline double emulated_clock(void)
{
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* The next line that begins like this; false: none came in time. */
static inline bool emulated_line(emulated *e, const char *begin, char *line, size_t size)
{
  struct pollfd more = {fileno(e->out), POLLIN, 0};
  while (poll(&more, 1, EMULATED_WAIT_MS) > 0 && fgets(line, (int)size, e->out) != NULL) {
    if (strncmp(line, begin, strlen(begin)) == 0) {
      return true;
    }
  }
  return false;
}

/* arguments: further ones of the emulator, NULL at their end, at most 10. */
static inline bool emulated_start(emulated *e, const char *const *arguments)
{
  const char *program = getenv("HAPODE_SPIDAR_EMULATOR");
  const char *words[16] = {program, "--link", e->port};
  int to[2];
  int from[2];
  char line[256];
  snprintf(e->folder, sizeof e->folder, "/tmp/hapode_spidar_XXXXXX");
  if (program == NULL || mkdtemp(e->folder) == NULL || pipe(to) != 0 || pipe(from) != 0) {
    return false;
  }
  snprintf(e->port, sizeof e->port, "%s/port", e->folder);
  for (int i = 0; arguments != NULL && arguments[i] != NULL; ++i) {
    words[3 + i] = arguments[i];
  }
  e->pid = fork();
  if (e->pid == 0) {
    dup2(to[0], 0);
    dup2(from[1], 1);
    for (int fd = 3; fd < 64; ++fd) {
      close(fd);
    }
    execv(program, (char **)words);
    _exit(127);
  }
  close(to[0]);
  close(from[1]);
  e->in = to[1];
  e->out = fdopen(from[0], "r");
  setvbuf(e->out, NULL, _IONBF, 0); /* so that poll sees what has not been read */
  return e->pid > 0 && emulated_line(e, "port: /dev/pts/", line, sizeof line);
}

static inline bool emulated_tell(emulated *e, const char *command)
{
  char line[128];
  int length = snprintf(line, sizeof line, "%s\n", command);
  return write(e->in, line, (size_t)length) == length;
}

/* Of a list of the state, such as "force"; false: it did not answer. */
static inline bool emulated_state(emulated *e, const char *name, double *out, int count)
{
  char line[1200];
  char key[32];
  snprintf(key, sizeof key, " %s=", name);
  if (!emulated_tell(e, "state") || !emulated_line(e, "state ", line, sizeof line)) {
    return false;
  }
  char *at = strstr(line, key);
  at = at != NULL ? at + strlen(key) : NULL;
  for (int i = 0; at != NULL && i < count; ++i) {
    char *end = NULL;
    out[i] = strtod(at, &end);
    at = end != at ? end + (*end == '/') : NULL;
  }
  return at != NULL;
}

static inline bool emulated_is_limp(emulated *e)
{
  double current[8];
  bool limp = emulated_state(e, "current", current, 8);
  for (int i = 0; i < 8; ++i) {
    limp = limp && current[i] == 0.0;
  }
  return limp;
}

/* Waits until no motor has a current, or all have; false: that did not come. */
static inline bool emulated_await(emulated *e, bool limp)
{
  double end = emulated_clock() + 1e-3 * EMULATED_WAIT_MS;
  while (emulated_clock() < end) {
    if (emulated_is_limp(e) == limp) {
      return true;
    }
    emulated_sleep(0.01);
  }
  return false;
}

static inline void emulated_stop(emulated *e)
{
  int status = 0;
  (void)emulated_tell(e, "quit");
  close(e->in);
  if (e->pid > 0) {
    while (waitpid(e->pid, &status, 0) < 0 && errno == EINTR) {
    }
  }
  if (e->out != NULL) {
    fclose(e->out);
  }
  (void)unlink(e->port);
  (void)rmdir(e->folder);
}

#endif
