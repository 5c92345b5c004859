/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The system gives no thread: start says which one and why, and the session is as before. Here
 * pthread_create is that of this file. */

#include "tests/tap.h"

#include <dlfcn.h>
#include <errno.h>
#include <pthread.h>

#include "tests/stage.h"

static int given;   /* threads, before */
static int refused; /* errno of all others; 0: none is refused */

typedef int (*create_fn)(pthread_t *, const pthread_attr_t *, void *(*)(void *), void *);

/* NOLINTNEXTLINE(readability-inconsistent-declaration-parameter-name): the system's begin with _ */
int pthread_create(pthread_t *thread, const pthread_attr_t *attributes, void *(*entry)(void *),
                   void *arg)
{
  create_fn real;
  void *symbol = dlsym(RTLD_NEXT, "pthread_create");
  memcpy(&real, &symbol, sizeof real);
  return refused != 0 && given-- <= 0 ? refused : real(thread, attributes, entry, arg);
}

static void start_refused(stage *s, int threads_before, int why, const char *which)
{
  hap_detail text;
  given = threads_before;
  refused = why;
  CHECK(hap_session_start(s->session) == HAP_ERROR_SYSTEM);
  refused = 0;
  CHECK(hap_session_detail(s->session, &text) == HAP_OK);
  CHECK_SAY(strstr(text.text, which) != NULL && strstr(text.text, strerror(why)) != NULL, "%s",
            text.text);
}

TEST(a_thread_that_is_refused_is_named_with_its_cause)
{
  static const char *const names[] = {"haptic", "physics", "contact"};
  stage *s = stage_new(HAP_DRIVE_THREADS);
  REQUIRE(stage_create(s) == HAP_OK);
  for (int i = 0; i < 3; ++i) {
    start_refused(s, i, EAGAIN, names[i]);
    start_refused(s, i, ENOMEM, names[i]);
  }
  CHECK(hap_session_start(s->session) >= HAP_OK);
  CHECK(hap_session_stop(s->session) == HAP_OK);
}
