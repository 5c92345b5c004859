/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Asserts: on in the library that the tests link, and forces are off before the process ends. */

#include "base/assert.h"

#include <math.h>
#include <signal.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/index.h"
#include "device/emergency.h"
#include "tap.h"

typedef struct ending {
  int signal; /* that ended the child; 0: it came to its end */
  char said[1024];
} ending;

/* What body does in a process of its own; its stderr is kept. */
static ending ending_of(void (*body)(void))
{
  ending e = {0, ""};
  int pipe_ends[2];
  fflush(stdout);
  pid_t child = pipe(pipe_ends) == 0 ? fork() : -1;
  if (child == 0) {
    signal(SIGABRT, SIG_DFL);
    dup2(pipe_ends[1], STDERR_FILENO);
    close(pipe_ends[0]);
    body();
    _exit(0);
  }
  if (child < 0) {
    e.signal = -1;
    return e;
  }
  close(pipe_ends[1]);
  size_t length = 0;
  ssize_t got;
  while ((got = read(pipe_ends[0], e.said + length, sizeof e.said - 1 - length)) > 0) {
    length += (size_t)got;
  }
  close(pipe_ends[0]);
  int status = 0;
  waitpid(child, &status, 0);
  e.signal = WIFSIGNALED(status) ? WTERMSIG(status) : 0;
  return e;
}

static void word_say(const char *word)
{
  if (write(STDERR_FILENO, word, strlen(word)) < 0) {
    _exit(1);
  }
}

static void device_zero(void *self)
{
  word_say(self);
}

static void clumsy_device_zero(void *self)
{
  device_zero(self);
  HAPI_ASSERT(self == NULL);
}

static const hap_device_ops device_ops = {.zero = device_zero};
static const hap_device_ops clumsy_device_ops = {.zero = clumsy_device_zero};
static char left_word[] = "left ";
static char right_word[] = "right ";

static void body_that_holds(void)
{
  HAPI_ASSERT(1 + 1 == 2);
  word_say("end");
}

static void body_that_fails(void)
{
  hapi_emergency_add(&device_ops, left_word);
  hapi_emergency_add(&device_ops, right_word);
  HAPI_ASSERT(1 + 1 == 3);
  word_say("end");
}

static void body_with_a_clumsy_device(void)
{
  hapi_emergency_add(&clumsy_device_ops, left_word);
  HAPI_ASSERT(1 + 1 == 3);
}

static void body_that_misuses_the_library(void)
{
  hapi_index index = {0};
  if (hapi_index_reserve(&index, 1)) {
    hapi_index_put(&index, 7, HAPI_INDEX_NONE);
  }
}

TEST(tests_have_asserts_inside_the_library)
{
#if HAPI_ASSERTS
  ending e = ending_of(body_that_misuses_the_library);
  CHECK(e.signal == SIGABRT);
  CHECK(strstr(e.said, "index.c:") != NULL);
#else
  SKIP("built with -Dasserts=disabled");
#endif
}

TEST(a_failed_assert_zeroes_all_devices_then_speaks_then_aborts)
{
#if HAPI_ASSERTS
  ending e = ending_of(body_that_fails);
  CHECK(e.signal == SIGABRT);
  const char *begin = "left right hapode: ";
  CHECK(strncmp(e.said, begin, strlen(begin)) == 0);
  CHECK(strstr(e.said, "test_assert.c:") != NULL);
  CHECK(strstr(e.said, ": assert failed: 1 + 1 == 3\n") != NULL);
  CHECK(strstr(e.said, "end") == NULL);
#else
  SKIP("built with -Dasserts=disabled");
#endif
}

TEST(an_assert_that_fails_in_zero_ends_the_process_too)
{
#if HAPI_ASSERTS
  ending e = ending_of(body_with_a_clumsy_device);
  CHECK(e.signal == SIGABRT);
  CHECK(strstr(e.said, "self == NULL") != NULL);
#else
  SKIP("built with -Dasserts=disabled");
#endif
}

TEST(an_assert_that_holds_does_nothing)
{
  ending e = ending_of(body_that_holds);
  CHECK(e.signal == 0);
  CHECK(strcmp(e.said, "end") == 0);
}

TEST(an_index_is_inside_of_its_range)
{
  CHECK(hapi_assert_is_index(0, 1));
  CHECK(!hapi_assert_is_index(1, 1));
  CHECK(!hapi_assert_is_index(-1, 1));
  CHECK(!hapi_assert_is_index(0, 0));
}

TEST(unit_vectors_and_quaternions_have_length_1)
{
  const double q[4] = {0.5, 0.5, -0.5, 0.5};
  const double nearly[3] = {1 + 1e-7, 0, 0};
  const double longer[3] = {1 + 1e-5, 0, 0};
  const double none[3] = {NAN, 0, 1};
  CHECK(hapi_assert_is_unit(q, 4));
  CHECK(hapi_assert_is_unit(nearly, 3));
  CHECK(!hapi_assert_is_unit(longer, 3));
  CHECK(!hapi_assert_is_unit(none, 3));
}

TEST(nan_and_infinity_are_not_finite)
{
  const double v[3] = {1, NAN, INFINITY};
  CHECK(hapi_assert_is_finite(v, 1));
  CHECK(!hapi_assert_is_finite(v, 2));
  CHECK(!hapi_assert_is_finite(v + 2, 1));
}

TEST(positive_matrices_are_symmetric_and_have_positive_eigenvalues)
{
  const double good[4] = {2, 1, 1, 2};
  const double skew[4] = {2, 1, 0.9, 2};
  const double saddle[4] = {1, 2, 2, 1}; /* 3 and -1 */
  const double flat[4] = {1, 1, 1, 1};
  const double none[4] = {1, 0, 0, NAN};
  CHECK(hapi_assert_is_positive(good, 2));
  CHECK(!hapi_assert_is_positive(skew, 2));
  CHECK(!hapi_assert_is_positive(saddle, 2));
  CHECK(!hapi_assert_is_positive(flat, 2));
  CHECK(!hapi_assert_is_positive(none, 2));
}

int main(void)
{
  RUN(tests_have_asserts_inside_the_library);
  RUN(a_failed_assert_zeroes_all_devices_then_speaks_then_aborts);
  RUN(an_assert_that_fails_in_zero_ends_the_process_too);
  RUN(an_assert_that_holds_does_nothing);
  RUN(an_index_is_inside_of_its_range);
  RUN(unit_vectors_and_quaternions_have_length_1);
  RUN(nan_and_infinity_are_not_finite);
  RUN(positive_matrices_are_symmetric_and_have_positive_eigenvalues);
  return tap_done();
}
