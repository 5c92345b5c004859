/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Histogram, fair lock, clock, the door to the heap, index, status texts. */

#include "tests/tap.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdint.h>
#include <time.h>

#include <hapode/hapode.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/fair_lock.h"
#include "base/histogram.h"
#include "base/index.h"
#include "base/log.h"
#include "base/thread.h"

#define MS 1000000LL

/* ---- histogram ---- */

static hapi_histogram histogram;

TEST(histogram_is_empty_at_first)
{
  hapi_histogram_reset(&histogram);
  CHECK_NEAR(hapi_histogram_mean_ns(&histogram), 0.0, 0.0);
  CHECK_NEAR(hapi_histogram_max_ns(&histogram), 0.0, 0.0);
  CHECK_NEAR(hapi_histogram_quantile_ns(&histogram, 0.5), 0.0, 0.0);
  CHECK_NEAR(hapi_histogram_quantile_ns(&histogram, 1.0), 0.0, 0.0);
}

TEST(histogram_mean_and_maximum_are_exact)
{
  hapi_histogram_reset(&histogram);
  double sum = 0.0;
  for (int i = 1; i <= 1000; ++i) {
    hapi_histogram_add(&histogram, 977LL * i);
    sum += 977.0 * i;
  }
  CHECK_NEAR(hapi_histogram_mean_ns(&histogram), sum / 1000.0, 1e-9);
  CHECK_NEAR(hapi_histogram_max_ns(&histogram), 977000.0, 0.0);
}

/* Every value from 1 ns to beyond a minute, alone in the histogram, comes back within 7 %. */
TEST(histogram_gives_values_back_within_7_percent)
{
  double worst = 0.0;
  for (double value = 1.0; value < 1e11; value *= 1.013) {
    int64_t ns = (int64_t)value;
    hapi_histogram_reset(&histogram);
    hapi_histogram_add(&histogram, ns);
    double back = hapi_histogram_quantile_ns(&histogram, 0.5);
    worst = fmax(worst, fabs(back - (double)ns) / (double)ns);
  }
  CHECK(worst < 0.07);
  CHECK(worst > 0.0); /* else nothing was compared */
}

TEST(histogram_quantiles_of_a_known_set)
{
  static const double shares[] = {0.01, 0.1, 0.5, 0.9, 0.99, 0.999};
  hapi_histogram_reset(&histogram);
  for (int i = 0; i < 10000; ++i) {
    hapi_histogram_add(&histogram, 1000LL * ((i * 7919LL) % 10000 + 1)); /* 1 us .. 10 ms */
  }
  for (size_t i = 0; i < sizeof shares / sizeof shares[0]; ++i) {
    double wanted = shares[i] * 1e7;
    CHECK_NEAR(hapi_histogram_quantile_ns(&histogram, shares[i]), wanted, 0.07 * wanted);
  }
  CHECK(hapi_histogram_quantile_ns(&histogram, 1.0) >= 0.93e7);
}

TEST(histogram_takes_any_number)
{
  hapi_histogram_reset(&histogram);
  hapi_histogram_add(&histogram, -5);
  hapi_histogram_add(&histogram, INT64_MIN);
  CHECK_NEAR(hapi_histogram_max_ns(&histogram), 0.0, 0.0);
  hapi_histogram_add(&histogram, INT64_MAX);
  CHECK_NEAR(hapi_histogram_max_ns(&histogram), 9.223372036854775807e18, 1e4);
  CHECK(hapi_histogram_quantile_ns(&histogram, 0.5) <= 1.0);
  CHECK(hapi_histogram_quantile_ns(&histogram, 1.0) > 1e11);
}

/* ---- clock ---- */

TEST(clock_deadlines_do_not_drift)
{
  static const double rates[] = {1.0, 3.0, 60.0, 100.0, 1000.0, 1024.0, 44100.0 / 7.0, 20000.0};
  for (size_t i = 0; i < sizeof rates / sizeof rates[0]; ++i) {
    double rate = rates[i];
    CHECK(hapi_clock_deadline(0, rate) == 0);
    for (uint64_t index = 1; index < 5000; index += 7) {
      long double exact = (long double)index / (long double)rate * 1e9L;
      CHECK(fabsl((long double)hapi_clock_deadline(index, rate) - exact) <= 0.51L);
    }
  }
  /* After a year at 20 kHz still to the nanosecond. */
  uint64_t year = 365ull * 86400ull;
  CHECK(hapi_clock_deadline(year * 20000ull, 20000.0) == (int64_t)year * HAPI_NS_PER_S);
  CHECK(hapi_clock_deadline(year * 20000ull + 1, 20000.0) - (int64_t)year * HAPI_NS_PER_S == 50000);
  CHECK(hapi_clock_deadline(year * 60ull + 1, 60.0) - (int64_t)year * HAPI_NS_PER_S == 16666667);
}

TEST(clock_deadlines_are_strictly_increasing)
{
  int64_t before = -1;
  for (uint64_t index = 0; index < 200000; ++index) {
    int64_t at = hapi_clock_deadline(index, 1000.0 / 3.0);
    CHECK(at > before);
    before = at;
  }
}

TEST(clock_sleeps_until_a_time_and_not_longer_for_a_past_one)
{
  int64_t begin = hapi_clock_now();
  hapi_clock_sleep_until(begin + 3 * MS);
  CHECK(hapi_clock_now() >= begin + 3 * MS);
  hapi_clock_sleep_until(0);       /* these come back */
  hapi_clock_sleep_until(-5 * MS); /* a negative timespec must not be handed on */
  hapi_clock_sleep_until(INT64_MIN);
  hapi_clock_sleep_until(begin);
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  int64_t system = (int64_t)now.tv_sec * HAPI_NS_PER_S + now.tv_nsec;
  CHECK(hapi_clock_now() - system < 10 * HAPI_NS_PER_S && hapi_clock_now() >= system);
}

/* ---- fair lock ---- */

typedef struct contest {
  hapi_fair_lock lock;
  atomic_int stop;
  atomic_int waiting;
  atomic_ullong hog_rounds;
  int inside; /* protected by the lock */
  unsigned long long sum;
} contest;

/* Takes the lock again as soon as it has given it, as an overloaded physics thread does. */
static void *lock_hog(void *arg)
{
  contest *c = arg;
  while (atomic_load(&c->stop) == 0) {
    hapi_fair_lock_take(&c->lock, INT64_MAX);
    ++c->inside;
    atomic_fetch_add(&c->hog_rounds, 1);
    struct timespec busy = {0, 200000};
    nanosleep(&busy, NULL);
    --c->inside;
    hapi_fair_lock_give(&c->lock);
  }
  return NULL;
}

TEST(fair_lock_lets_a_waiter_in_after_one_round_of_a_busy_holder)
{
  contest c;
  memset(&c, 0, sizeof c);
  pthread_t thread;
  REQUIRE(hapi_fair_lock_init(&c.lock));
  REQUIRE(pthread_create(&thread, NULL, lock_hog, &c) == 0);
  unsigned long long worst = 0;
  for (int i = 0; i < 200; ++i) {
    /* Counted from the moment this thread is in the queue: one round may be running then, and the
     * holder may have queued before us once. */
    unsigned long long before = atomic_load(&c.hog_rounds);
    CHECK(hapi_fair_lock_take(&c.lock, INT64_MAX));
    unsigned long long rounds = atomic_load(&c.hog_rounds) - before;
    worst = rounds > worst ? rounds : worst;
    CHECK(c.inside == 0);
    hapi_fair_lock_give(&c.lock);
  }
  printf("# longest wait: %llu rounds of the holder\n", worst);
  /* 2, and room for this thread being held up between reading the count and queueing. */
  CHECK(worst <= 20);
  atomic_store(&c.stop, 1);
  pthread_join(thread, NULL);
  hapi_fair_lock_finish(&c.lock);
}

static void *count_adder(void *arg)
{
  contest *c = arg;
  for (int i = 0; i < 3000; ++i) {
    if (hapi_fair_lock_take(&c->lock, INT64_MAX)) {
      ++c->sum; /* a plain number: the thread sanitizer and the sum would tell */
      hapi_fair_lock_give(&c->lock);
    }
  }
  return NULL;
}

TEST(fair_lock_excludes)
{
  enum {
    THREADS = 4
  };
  contest c;
  memset(&c, 0, sizeof c);
  pthread_t threads[THREADS];
  REQUIRE(hapi_fair_lock_init(&c.lock));
  for (int i = 0; i < THREADS; ++i) {
    REQUIRE(pthread_create(&threads[i], NULL, count_adder, &c) == 0);
  }
  for (int i = 0; i < THREADS; ++i) {
    pthread_join(threads[i], NULL);
  }
  CHECK(c.sum == 3000ull * THREADS);
  hapi_fair_lock_finish(&c.lock);
}

typedef struct queue_test {
  contest *contest;
  int number;
  int *order;
  int *count;
} queue_test;

static void *queue_up(void *arg)
{
  queue_test *q = arg;
  if (hapi_fair_lock_take(&q->contest->lock, INT64_MAX)) {
    q->order[(*q->count)++] = q->number;
    hapi_fair_lock_give(&q->contest->lock);
  }
  return NULL;
}

static unsigned lock_waiters(hapi_fair_lock *lock)
{
  pthread_mutex_lock(&lock->mutex);
  unsigned count = lock->count;
  pthread_mutex_unlock(&lock->mutex);
  return count;
}

static void wait_for_waiters(hapi_fair_lock *lock, unsigned count)
{
  for (int i = 0; i < 5000 && lock_waiters(lock) != count; ++i) {
    hapi_clock_sleep_until(hapi_clock_now() + MS);
  }
}

TEST(fair_lock_serves_in_order_of_arrival)
{
  enum {
    THREADS = 80
  };
  contest c;
  memset(&c, 0, sizeof c);
  pthread_t threads[THREADS];
  queue_test tests[THREADS];
  int order[THREADS] = {0};
  int count = 0;
  REQUIRE(hapi_fair_lock_init(&c.lock));
  CHECK(hapi_fair_lock_take(&c.lock, INT64_MAX));
  for (int i = 0; i < THREADS; ++i) {
    tests[i] = (queue_test){&c, i, order, &count};
    REQUIRE(pthread_create(&threads[i], NULL, queue_up, &tests[i]) == 0);
    wait_for_waiters(&c.lock, (unsigned)i + 1);
  }
  hapi_fair_lock_give(&c.lock);
  for (int i = 0; i < THREADS; ++i) {
    pthread_join(threads[i], NULL);
  }
  CHECK(count == THREADS);
  for (int i = 0; i < THREADS; ++i) {
    CHECK(order[i] == i);
  }
  hapi_fair_lock_finish(&c.lock);
}

TEST(fair_lock_gives_up_in_time_and_blocks_nobody_by_it)
{
  hapi_fair_lock lock;
  REQUIRE(hapi_fair_lock_init(&lock));
  CHECK(!hapi_fair_lock_is_mine(&lock));
  CHECK(hapi_fair_lock_take(&lock, 0)); /* free: a deadline in the past does not matter */
  CHECK(hapi_fair_lock_is_mine(&lock));
  for (int i = 0; i < 200; ++i) {
    CHECK(!hapi_fair_lock_take(&lock, hapi_clock_now()));
  }
  int64_t begin = hapi_clock_now();
  CHECK(!hapi_fair_lock_take(&lock, begin + 5 * MS));
  CHECK(hapi_clock_now() >= begin + 5 * MS);
  CHECK(hapi_fair_lock_is_mine(&lock));
  hapi_fair_lock_give(&lock);
  CHECK(!hapi_fair_lock_is_mine(&lock));
  CHECK(hapi_fair_lock_take(&lock, INT64_MAX));
  hapi_fair_lock_give(&lock);
  hapi_fair_lock_finish(&lock);
}

/* One who gave up between two others in the queue must not stop the one behind. */
TEST(fair_lock_goes_on_behind_one_who_gave_up)
{
  contest c;
  memset(&c, 0, sizeof c);
  pthread_t threads[2];
  queue_test tests[2];
  int order[2] = {-1, -1};
  int count = 0;
  REQUIRE(hapi_fair_lock_init(&c.lock));
  CHECK(hapi_fair_lock_take(&c.lock, INT64_MAX));
  tests[0] = (queue_test){&c, 0, order, &count};
  REQUIRE(pthread_create(&threads[0], NULL, queue_up, &tests[0]) == 0);
  wait_for_waiters(&c.lock, 1);
  CHECK(!hapi_fair_lock_take(&c.lock, hapi_clock_now() + MS));
  tests[1] = (queue_test){&c, 1, order, &count};
  REQUIRE(pthread_create(&threads[1], NULL, queue_up, &tests[1]) == 0);
  wait_for_waiters(&c.lock, 2);
  hapi_fair_lock_give(&c.lock);
  pthread_join(threads[0], NULL);
  pthread_join(threads[1], NULL);
  CHECK(order[0] == 0 && order[1] == 1);
  hapi_fair_lock_finish(&c.lock);
}

static void *take_and_end(void *lock)
{
  CHECK(hapi_fair_lock_take(lock, INT64_MAX));
  return NULL;
}

static void *take_for_good(void *lock)
{
  return hapi_fair_lock_take(lock, INT64_MAX) ? lock : NULL;
}

TEST(fair_lock_of_a_thread_that_ended_goes_to_the_next)
{
  hapi_fair_lock lock;
  pthread_t thread;
  void *had = NULL;
  REQUIRE(hapi_fair_lock_init(&lock));
  for (int i = 0; i < 3; ++i) {
    REQUIRE(pthread_create(&thread, NULL, take_and_end, &lock) == 0);
    pthread_join(thread, NULL);
    CHECK(!hapi_fair_lock_is_mine(&lock));
    CHECK(hapi_fair_lock_take(&lock, i == 0 ? 0 : INT64_MAX)); /* seen at once */
    CHECK(hapi_fair_lock_is_mine(&lock));
    hapi_fair_lock_give(&lock);
  }
  /* while somebody waits; and the next thread may have the name of the one that ended */
  REQUIRE(hapi_fair_lock_take(&lock, INT64_MAX));
  REQUIRE(pthread_create(&thread, NULL, take_for_good, &lock) == 0);
  wait_for_waiters(&lock, 1);
  hapi_fair_lock_give(&lock);
  pthread_join(thread, &had);
  CHECK(had == &lock);
  REQUIRE(pthread_create(&thread, NULL, take_for_good, &lock) == 0);
  pthread_join(thread, &had);
  CHECK(had == &lock);
  CHECK(hapi_fair_lock_take(&lock, hapi_clock_now() + 10 * MS));
  hapi_fair_lock_give(&lock);
  hapi_fair_lock_finish(&lock);
}

/* ---- threads ---- */

static void *say_done(void *arg)
{
  hapi_thread_prepare_for_ticks();
  atomic_store((atomic_int *)arg, 1);
  return NULL;
}

TEST(thread_starts_with_or_without_real_time_and_joins_twice)
{
  static const int priorities[] = {0, 1, 99};
  for (size_t i = 0; i < sizeof priorities / sizeof priorities[0]; ++i) {
    hapi_thread thread = {0};
    atomic_int done = 0;
    hapi_thread_join(&thread); /* never started */
    CHECK(hapi_thread_start(&thread, say_done, &done, "a name longer than fifteen characters",
                            priorities[i]) == HAP_OK);
    CHECK(priorities[i] != 0 || !thread.realtime);
    hapi_thread_join(&thread);
    hapi_thread_join(&thread);
    CHECK(atomic_load(&done) == 1 && !thread.running);
  }
}

/* ---- heap, hooks, texts ---- */

typedef struct counted_heap {
  int lives;
  int logs;
  char last[1024];
} counted_heap;

static void *counted_allocate(size_t size, void *user)
{
  counted_heap *heap = user;
  ++heap->lives;
  void *memory = malloc(size);
  if (memory != NULL) {
    memset(memory, 0xa5, size);
  }
  return memory;
}

static void counted_release(void *memory, void *user)
{
  --((counted_heap *)user)->lives;
  free(memory);
}

static void counted_log(hap_log_level level, const char *text, void *user)
{
  counted_heap *heap = user;
  ++heap->logs;
  snprintf(heap->last, sizeof heap->last, "%d %s", (int)level, text);
}

TEST(heap_zeroes_and_goes_through_the_hooks)
{
  counted_heap heap = {0, 0, ""};
  hap_hooks hooks;
  hap_hooks_init(&hooks, sizeof hooks);
  hooks.allocate = counted_allocate;
  hooks.release = counted_release;
  hooks.log = counted_log;
  hooks.user = &heap;
  REQUIRE(hap_hooks_set(&hooks) == HAP_OK);
  unsigned char *block = hapi_alloc(100);
  REQUIRE(block != NULL);
  CHECK(heap.lives == 1);
  for (int i = 0; i < 100; ++i) {
    CHECK(block[i] == 0);
  }
  CHECK(hapi_alloc_array(SIZE_MAX / 2, 3) == NULL); /* the product does not fit */
  CHECK(heap.lives == 1);
  void *empty = hapi_alloc_array(0, 8);
  CHECK(empty != NULL);
  hapi_free(block);
  hapi_free(empty);
  hapi_free(NULL);
  CHECK(heap.lives == 0);
  hapi_log(HAP_LOG_WARNING, "%d and %s", 3, "four");
  CHECK(heap.logs == 1 && strcmp(heap.last, "1 3 and four") == 0);
  hap_hooks unset;
  memset(&unset, 0, sizeof unset);
  CHECK(hap_hooks_set(&unset) == HAP_ERROR_UNINITIALISED);
  hap_hooks half;
  hap_hooks_init(&half, sizeof half);
  half.allocate = counted_allocate;
  half.user = &heap;
  CHECK(hap_hooks_set(&half) == HAP_ERROR_ARGUMENT);
  CHECK(hap_hooks_set(NULL) == HAP_OK);
  hapi_log(HAP_LOG_ERROR, "nobody hears this");
  CHECK(heap.logs == 1);
}

/* ---- index ---- */

#define KEYS 48u

static uint64_t key_number(uint32_t i)
{
  return i == 0 ? 0 : i == 1 ? UINT64_MAX : i % 2 == 0 ? i : hapi_index_mix(i);
}

/* Against an array. values: HAPI_INDEX_NONE where there is no key. */
static void check_index(const hapi_index *index, const uint32_t values[KEYS])
{
  for (uint32_t i = 0; i < KEYS; ++i) {
    CHECK(hapi_index_get(index, key_number(i)) == values[i]);
  }
}

TEST(index_finds_what_was_put_and_not_removed)
{
  hapi_index index = {0};
  uint32_t values[KEYS];
  uint32_t count = 0;
  uint64_t random = 1;
  memset(values, 0xff, sizeof values);
  check_index(&index, values);
  hapi_index_clear(&index);
  REQUIRE(hapi_index_reserve(&index, KEYS / 2));
  for (uint32_t round = 0; round < 20000; ++round) {
    random = hapi_index_mix(random + round);
    uint32_t i = (uint32_t)(random % KEYS);
    bool there = values[i] != HAPI_INDEX_NONE;
    if (there && random >> 63 == 0) { /* another value of the key that is there */
      values[i] = round;
      hapi_index_put(&index, key_number(i), round);
    } else if (there || count == KEYS / 2) {
      count -= there;
      values[i] = HAPI_INDEX_NONE;
      hapi_index_remove(&index, key_number(i));
    } else {
      ++count;
      values[i] = round;
      hapi_index_put(&index, key_number(i), round);
    }
    if (round % 16 == 0) {
      check_index(&index, values);
    }
  }
  CHECK(hapi_index_reserve(&index, 100 * KEYS)); /* what is there stays */
  check_index(&index, values);
  CHECK(!hapi_index_reserve(&index, UINT32_MAX)); /* more than there can be */
  check_index(&index, values);
  hapi_index_clear(&index);
  memset(values, 0xff, sizeof values);
  check_index(&index, values);
  hapi_index_finish(&index);
  check_index(&index, values);
}

TEST(fail_writes_and_cuts_the_text)
{
  hap_detail detail;
  char large[2000];
  memset(large, 'x', sizeof large);
  large[sizeof large - 1] = '\0';
  CHECK(hapi_fail(&detail, HAP_ERROR_IO, "%s is %d", "it", 7) == HAP_ERROR_IO);
  CHECK(strcmp(detail.text, "it is 7") == 0);
  CHECK(hapi_fail(&detail, HAP_ERROR_IO, "%s", large) == HAP_ERROR_IO);
  CHECK(strlen(detail.text) == sizeof detail.text - 1);
  CHECK(hapi_fail(NULL, HAP_ERROR_IO, "%s", large) == HAP_ERROR_IO);
}

TEST(every_status_has_a_name_and_a_text)
{
  for (int i = HAP_ERROR_SYSTEM; i <= HAP_END; ++i) {
    CHECK(strncmp(hap_status_name((hap_status)i), "HAP_", 4) == 0);
    CHECK(strcmp(hap_status_name((hap_status)i), "HAP_UNKNOWN_STATUS") != 0);
    CHECK(strcmp(hap_status_text((hap_status)i), "unknown status") != 0);
    for (int k = HAP_ERROR_SYSTEM; k < i; ++k) {
      CHECK(strcmp(hap_status_text((hap_status)i), hap_status_text((hap_status)k)) != 0);
    }
  }
  CHECK(strcmp(hap_status_name((hap_status)99), "HAP_UNKNOWN_STATUS") == 0);
  CHECK(strcmp(hap_status_text((hap_status)-99), "unknown status") == 0);
  char version[32];
  snprintf(version, sizeof version, "%d.%d.%d", HAP_VERSION_MAJOR, HAP_VERSION_MINOR,
           HAP_VERSION_PATCH);
  CHECK(strcmp(hap_version(), version) == 0);
}
