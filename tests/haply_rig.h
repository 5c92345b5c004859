/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_HAPLY_RIG_H
#define HAPODE_TESTS_HAPLY_RIG_H

/* The pretended service of Haply as a process of its own, with commands and answers.
 * HAPODE_HAPLY_SERVICE: its path. Include after tap.h. */

#include <errno.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#define SERVICE_WAIT_MS 20000

typedef struct service {
  pid_t pid;
  int in;
  FILE *out;
  int port;
} service;

/* The next line; false: none came in time. */
static inline bool service_line(service *s, char *line, size_t size)
{
  struct pollfd more = {fileno(s->out), POLLIN, 0};
  return poll(&more, 1, SERVICE_WAIT_MS) > 0 && fgets(line, (int)size, s->out) != NULL;
}

/* A command and its answer. */
static inline bool service_ask(service *s, const char *command, char *line, size_t size)
{
  char text[128];
  int length = snprintf(text, sizeof text, "%s\n", command);
  return write(s->in, text, (size_t)length) == length && service_line(s, line, size);
}

static inline void service_tell(service *s, const char *command)
{
  char line[256];
  REQUIRE_SAY(service_ask(s, command, line, sizeof line) && strcmp(line, "done\n") == 0,
              "the service does not do: %s", command);
}

/* A number of the state, such as "forces"; of an arm, "" for the first. NAN: there is none. */
static inline double service_number(service *s, const char *arm, const char *name, int index)
{
  char line[400];
  char command[80];
  char key[32];
  snprintf(command, sizeof command, "state %s", arm);
  snprintf(key, sizeof key, " %s=", name);
  if (!service_ask(s, command, line, sizeof line)) {
    return NAN;
  }
  const char *at = strstr(line, key);
  at = at != NULL ? at + strlen(key) : NULL;
  for (int i = 0; at != NULL && i < index; ++i) {
    at = strchr(at, '/');
    at = at != NULL ? at + 1 : NULL;
  }
  return at != NULL ? strtod(at, NULL) : (double)NAN;
}

static inline double service_force(service *s, const char *arm)
{
  double sum = 0.0;
  for (int i = 0; i < 3; ++i) {
    double force = service_number(s, arm, "force", i);
    sum += force * force;
  }
  return sqrt(sum);
}

static inline bool service_is_pushed(void *user)
{
  return service_force(user, "") > 0.3;
}

static inline bool service_is_let_go(void *user)
{
  return service_force(user, "") == 0.0;
}

static inline void service_end(void *owned)
{
  service *s = owned;
  int status = 0;
  close(s->in);
  if (s->pid > 0) {
    while (waitpid(s->pid, &status, 0) < 0 && errno == EINTR) {
    }
  }
  if (s->out != NULL) {
    fclose(s->out);
  }
}

/* arguments: further ones, NULL at their end, at most 8. It ends with the test. */
static inline service *service_new(const char *const *arguments)
{
  const char *words[16] = {"python3", "-B", getenv("HAPODE_HAPLY_SERVICE")};
  char line[80];
  int to[2];
  int from[2];
  service *s = tap_own(sizeof *s, service_end);
  signal(SIGPIPE, SIG_IGN);
  REQUIRE(words[2] != NULL && pipe(to) == 0 && pipe(from) == 0);
  for (int i = 0; arguments != NULL && arguments[i] != NULL; ++i) {
    words[3 + i] = arguments[i];
  }
  s->pid = fork();
  if (s->pid == 0) {
    dup2(to[0], 0);
    dup2(from[1], 1);
    for (int fd = 3; fd < 64; ++fd) {
      close(fd);
    }
    execvp(words[0], (char **)words);
    _exit(127);
  }
  close(to[0]);
  close(from[1]);
  s->in = to[1];
  s->out = fdopen(from[0], "r");
  setvbuf(s->out, NULL, _IONBF, 0); /* so that poll sees what has not been read */
  REQUIRE_SAY(service_line(s, line, sizeof line) && sscanf(line, "port: %d", &s->port) == 1,
              "the service does not run");
  return s;
}

/* "haply:port=N" and rest. */
static inline const char *service_spec(const service *s, const char *rest)
{
  static char spec[200];
  snprintf(spec, sizeof spec, "haply:host=127.0.0.1,port=%d%s", s->port, rest);
  return spec;
}

#endif
