/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The table of devices that hap_emergency_zero zeroes: each device that is in it, by its own self,
 * and none that is not. */

#include "tests/tap.h"

#include <pthread.h>
#include <stdatomic.h>

#include <hapode/device.h>

#include "base/clock.h"
#include "device/emergency.h"

#define MS 1000000LL

typedef struct counted {
  atomic_int zeros;
  atomic_int waits; /* zero does not return while this is set */
  atomic_int inside;
} counted;

static void counted_zero(void *self)
{
  counted *c = self;
  atomic_fetch_add(&c->zeros, 1);
  atomic_store(&c->inside, 1);
  while (atomic_load(&c->waits) != 0) {
    hapi_clock_sleep_until(hapi_clock_now() + MS / 10);
  }
  atomic_store(&c->inside, 0);
}

static const hap_device_ops counted_ops = {.zero = counted_zero};
static const hap_device_ops other_ops = {.zero = counted_zero};

static counted devices[HAPI_EMERGENCY_DEVICES + 1];

static void counts_are(int a, int b, int c)
{
  CHECK(atomic_load(&devices[0].zeros) == a);
  CHECK(atomic_load(&devices[1].zeros) == b);
  CHECK(atomic_load(&devices[2].zeros) == c);
}

TEST(each_device_is_zeroed_once_an_emergency)
{
  memset(devices, 0, sizeof devices);
  uint64_t before = hapi_emergencies();
  hap_emergency_zero();
  CHECK(hapi_emergencies() == before + 1);
  counts_are(0, 0, 0);
  CHECK(hapi_emergency_add(&counted_ops, &devices[0]));
  hap_emergency_zero();
  counts_are(1, 0, 0);
  CHECK(hapi_emergency_add(&counted_ops, &devices[1]));
  CHECK(hapi_emergency_add(&other_ops, &devices[2]));
  hap_emergency_zero();
  counts_are(2, 1, 1);
  (void)hapi_emergency_remove(&counted_ops, &devices[0]);
  hap_emergency_zero();
  counts_are(2, 2, 2);
  (void)hapi_emergency_remove(&counted_ops, &devices[0]); /* it is not there */
  (void)hapi_emergency_remove(&counted_ops, &devices[2]); /* has other ops */
  (void)hapi_emergency_remove(&other_ops, &devices[1]);
  hap_emergency_zero();
  counts_are(2, 3, 3);
  CHECK(hapi_emergency_add(&counted_ops, &devices[0])); /* a place that was free again */
  hap_emergency_zero();
  counts_are(3, 4, 4);
  (void)hapi_emergency_remove(&counted_ops, &devices[0]);
  (void)hapi_emergency_remove(&counted_ops, &devices[1]);
  (void)hapi_emergency_remove(&other_ops, &devices[2]);
  hap_emergency_zero();
  counts_are(3, 4, 4);
  CHECK(hapi_emergencies() == before + 7);
}

TEST(one_device_is_zeroed_alone_and_only_while_it_is_there)
{
  memset(devices, 0, sizeof devices);
  CHECK(hapi_emergency_add(&counted_ops, &devices[0]) &&
        hapi_emergency_add(&counted_ops, &devices[1]));
  hapi_emergency_zero_one(&counted_ops, &devices[1]);
  hapi_emergency_zero_one(&counted_ops, &devices[2]); /* nobody knows it */
  CHECK(!hapi_emergency_is_zeroing(&counted_ops, &devices[1]));
  CHECK(hapi_emergency_remove(&counted_ops, &devices[0]) &&
        hapi_emergency_remove(&counted_ops, &devices[1]));
  hapi_emergency_zero_one(&counted_ops, &devices[1]);
  CHECK(atomic_load(&devices[0].zeros) == 0 && atomic_load(&devices[1].zeros) == 1 &&
        atomic_load(&devices[2].zeros) == 0);
}

TEST(there_is_room_for_64)
{
  memset(devices, 0, sizeof devices);
  for (int i = 0; i < HAPI_EMERGENCY_DEVICES; ++i) {
    CHECK(hapi_emergency_add(&counted_ops, &devices[i]));
  }
  CHECK(HAPI_EMERGENCY_DEVICES == 64);
  CHECK(!hapi_emergency_add(&counted_ops, &devices[HAPI_EMERGENCY_DEVICES]));
  hap_emergency_zero();
  for (int i = 0; i < HAPI_EMERGENCY_DEVICES; ++i) {
    CHECK(atomic_load(&devices[i].zeros) == 1);
    (void)hapi_emergency_remove(&counted_ops, &devices[i]);
  }
  CHECK(atomic_load(&devices[HAPI_EMERGENCY_DEVICES].zeros) == 0);
}

static void *emergency_call(void *unused)
{
  hap_emergency_zero();
  return unused;
}

static atomic_int removed;

static void *remove_first(void *unused)
{
  (void)hapi_emergency_remove(&counted_ops, &devices[0]);
  atomic_store(&removed, 1);
  return unused;
}

TEST(a_device_is_not_removed_under_a_call)
{
  pthread_t caller;
  pthread_t remover;
  memset(devices, 0, sizeof devices);
  atomic_store(&removed, 0);
  atomic_store(&devices[0].waits, 1);
  CHECK(hapi_emergency_add(&counted_ops, &devices[0]));
  REQUIRE(pthread_create(&caller, NULL, emergency_call, NULL) == 0);
  while (atomic_load(&devices[0].inside) == 0) {
    hapi_clock_sleep_until(hapi_clock_now() + MS);
  }
  REQUIRE(pthread_create(&remover, NULL, remove_first, NULL) == 0);
  hapi_clock_sleep_until(hapi_clock_now() + 50 * MS);
  CHECK(atomic_load(&removed) == 0);
  atomic_store(&devices[0].waits, 0);
  pthread_join(caller, NULL);
  pthread_join(remover, NULL);
  CHECK(atomic_load(&removed) == 1);
  hap_emergency_zero();
  CHECK(atomic_load(&devices[0].zeros) == 1);
}
