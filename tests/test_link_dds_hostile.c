/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A stranger on the same network, who writes whatever DDS lets through: samples out of range,
 * samples in the name of others, many of them. */

#include "tests/tap.h"

#include <dds/dds.h>
#include <hapode/link_dds.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

#include "hapode_link.h"

#define DOMAIN 67
#define WAIT_S 20.0

static double seconds_now(void)
{
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static int64_t clock_now(void)
{
  return (int64_t)(1e9 * seconds_now());
}

/* ---- the stranger: knows the format, and DDS ---- */

typedef struct stranger {
  dds_entity_t participant;
  dds_entity_t newest[2]; /* writers; down, up */
  dds_entity_t reliable[2];
  dds_entity_t listens; /* a reader of what clients send reliably */
} stranger;

static dds_entity_t stranger_topic(const stranger *s, bool reliable, bool up)
{
  static const char *const names[2][2] = {{"hapode_1_newest_down", "hapode_1_newest_up"},
                                          {"hapode_1_reliable_down", "hapode_1_reliable_up"}};
  dds_entity_t topic = dds_create_topic(
      s->participant, reliable ? &hapode_link_reliable_desc : &hapode_link_newest_desc,
      names[reliable][up], NULL, NULL);
  REQUIRE(topic > 0);
  return topic;
}

static void stranger_open(stranger *s, const char *world)
{
  s->participant = dds_create_participant(DOMAIN, NULL, NULL);
  REQUIRE(s->participant > 0);
  dds_qos_t *group = dds_create_qos();
  dds_qset_partition1(group, world);
  dds_entity_t publisher = dds_create_publisher(s->participant, group, NULL);
  dds_entity_t subscriber = dds_create_subscriber(s->participant, group, NULL);
  dds_delete_qos(group);
  dds_qos_t *reliable = dds_create_qos();
  dds_qset_reliability(reliable, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
  dds_qset_history(reliable, DDS_HISTORY_KEEP_ALL, 0);
  dds_qos_t *newest = dds_create_qos();
  dds_qset_reliability(newest, DDS_RELIABILITY_BEST_EFFORT, 0);
  for (int up = 0; up < 2; ++up) {
    s->newest[up] = dds_create_writer(publisher, stranger_topic(s, false, up == 1), newest, NULL);
    s->reliable[up] =
        dds_create_writer(publisher, stranger_topic(s, true, up == 1), reliable, NULL);
    REQUIRE(s->newest[up] > 0 && s->reliable[up] > 0);
  }
  s->listens = dds_create_reader(subscriber, stranger_topic(s, true, true), reliable, NULL);
  REQUIRE(s->listens > 0);
  dds_delete_qos(newest);
  dds_delete_qos(reliable);
}

static unsigned char bytes[60000];

static void write_newest(const stranger *s, bool up, uint64_t client, uint8_t channel,
                         uint32_t size)
{
  hapode_link_newest sample = {
      .client = client, .channel = channel, .part = 7, .data = {size, size, bytes, false}};
  CHECK(dds_write(s->newest[up], &sample) >= 0);
}

static void write_reliable(const stranger *s, bool up, uint64_t client, uint8_t kind, uint32_t size)
{
  hapode_link_reliable sample = {
      .client = client, .kind = kind, .channel = 200, .data = {size, size, bytes, false}};
  CHECK(dds_write(s->reliable[up], &sample) >= 0);
}

/* ---- honest ends ---- */

typedef struct scene {
  char world[64];
  hap_link *server;
  hap_link *client;
  uint32_t peer;
  uint64_t id; /* of the client: DDS tells everybody */
  stranger stranger;
} scene;

static void scene_finish(void *owned)
{
  scene *s = owned;
  if (s->stranger.participant > 0) {
    (void)dds_delete(s->stranger.participant);
  }
  hap_link_close(s->client);
  hap_link_close(s->server);
}

static scene *scene_new(void)
{
  scene *s = tap_own(sizeof *s, scene_finish);
  hap_link_dds_def def;
  hap_detail detail = {""};
  hap_link_event event;
  bool heard[2] = {false, false};
  (void)snprintf(s->world, sizeof s->world, "hostile-%d", (int)getpid());
  hap_link_dds_def_init(&def, sizeof def);
  def.world = s->world;
  def.module = getenv("HAPODE_LINK_DDS");
  REQUIRE_SAY(hap_link_dds_serve(&def, &s->server, &detail) == HAP_OK, "%s", detail.text);
  stranger_open(&s->stranger, s->world);
  REQUIRE(hap_link_dds_connect(&def, &s->client, &detail) == HAP_OK);
  for (double end_s = seconds_now() + WAIT_S; seconds_now() < end_s && !(heard[0] && heard[1]);) {
    while (hap_link_poll(s->server, clock_now(), &event, sizeof event) == HAP_OK) {
      heard[0] = heard[0] || event.kind == HAP_LINK_JOINED;
      s->peer = event.kind == HAP_LINK_JOINED ? event.peer : s->peer;
    }
    while (hap_link_poll(s->client, clock_now(), &event, sizeof event) == HAP_OK) {
      heard[1] = heard[1] || event.kind == HAP_LINK_JOINED;
    }
    usleep(500);
  }
  REQUIRE(heard[0] && heard[1]);
  void *sample = NULL;
  dds_sample_info_t info;
  for (int i = 0; i < 1000 && s->id == 0; ++i) {
    if (dds_take(s->stranger.listens, &sample, &info, 1, 1) > 0) {
      s->id = info.valid_data ? ((hapode_link_reliable *)sample)->client : 0;
      (void)dds_return_loan(s->stranger.listens, &sample, 1);
      sample = NULL;
    }
    usleep(1000);
  }
  REQUIRE(s->id != 0);
  return s;
}

/* Whether the two still have a whole link, and nothing that is not theirs comes by it. */
static void link_check(const scene *s)
{
  hap_link_event event;
  for (int up = 0; up < 2; ++up) {
    const hap_link_address at = {.peer = up ? HAP_LINK_SERVER : s->peer, .channel = 1};
    hap_link *from = up ? s->client : s->server;
    hap_link *to = up ? s->server : s->client;
    bool found = false;
    CHECK(hap_link_send_reliably(from, clock_now(), &at, "mine", 4) == HAP_OK);
    for (double end_s = seconds_now() + WAIT_S; seconds_now() < end_s && !found;) {
      while (hap_link_poll(to, clock_now(), &event, sizeof event) == HAP_OK) {
        CHECK(event.kind == HAP_LINK_MESSAGE && event.bytes == 4);
        CHECK(memcmp(event.data, "mine", 4) == 0);
        found = true;
      }
      usleep(500);
    }
    CHECK(found);
  }
}

TEST(what_is_written_in_the_name_of_a_peer_is_thrown_away)
{
  scene *s = scene_new();
  for (int round = 0; round < 20; ++round) {
    for (int up = 0; up < 2; ++up) {
      write_newest(&s->stranger, up == 1, s->id, 1, 100);
      for (uint8_t kind = 0; kind < 10; ++kind) { /* LEAVE is one of them */
        write_reliable(&s->stranger, up == 1, s->id, kind, 10);
      }
    }
    usleep(2000);
  }
  usleep(200000);
  link_check(s);
  (void)dds_delete(s->stranger.participant); /* its writers go, of the same key */
  s->stranger.participant = 0;
  usleep(200000);
  link_check(s);
}

/* It may join: whoever is on the network may. What it tells then is judged. */
TEST(samples_out_of_range_are_counted_and_refused)
{
  scene *s = scene_new();
  hap_link_event event;
  hap_link_figures before;
  hap_link_figures after;
  uint32_t joined = 0;
  const uint64_t own = 12345;
  memset(bytes, 0xff, 40);
  for (int i = 0; i < 200 && joined == 0; ++i) {
    write_reliable(&s->stranger, true, own, 1, 40); /* JOIN, with a name that is no text */
    write_reliable(&s->stranger, true, own, 3, 0);  /* READY */
    usleep(5000);
    while (hap_link_poll(s->server, clock_now(), &event, sizeof event) == HAP_OK) {
      joined = event.kind == HAP_LINK_JOINED ? event.peer : joined;
      CHECK(event.kind != HAP_LINK_JOINED || strspn(event.data, "?") == 40);
    }
  }
  REQUIRE(joined != 0);
  CHECK(hap_link_get_figures(s->server, &before, sizeof before) == HAP_OK);
  for (int i = 0; i < 10; ++i) {
    write_newest(&s->stranger, true, own, 200, 100); /* no such channel */
    write_newest(&s->stranger, true, own, 1, 0);     /* no bytes */
    write_reliable(&s->stranger, true, own, 0, 10);  /* channel 200 */
    write_reliable(&s->stranger, true, own, 0, 60000);
    usleep(5000);
    while (hap_link_poll(s->server, clock_now(), &event, sizeof event) == HAP_OK) {
      CHECK(event.kind != HAP_LINK_MESSAGE);
    }
  }
  CHECK(hap_link_get_figures(s->server, &after, sizeof after) == HAP_OK);
  printf("# %llu refused\n", (unsigned long long)(after.refused - before.refused));
  CHECK(after.refused >= before.refused + 30);
  link_check(s);
}

/* Thousands that join and never come, and a flood of messages: those who are there stay, and
 * another one still finds a place. */
TEST(a_flood_leaves_room_for_those_who_are_there)
{
  scene *s = scene_new();
  hap_link_event event;
  for (uint64_t i = 0; i < 3000; ++i) {
    write_reliable(&s->stranger, true, 1000 + i, 1, 8);
    write_newest(&s->stranger, true, 1000 + i, (uint8_t)i, 1200);
    if (i % 50 == 0) {
      while (hap_link_poll(s->server, clock_now(), &event, sizeof event) == HAP_OK) {
        CHECK(event.kind != HAP_LINK_LEFT);
      }
    }
  }
  link_check(s);
  hap_link *other;
  hap_link_dds_def def;
  bool joined = false;
  hap_link_dds_def_init(&def, sizeof def);
  def.world = s->world;
  def.module = getenv("HAPODE_LINK_DDS");
  REQUIRE(hap_link_dds_connect(&def, &other, NULL) == HAP_OK);
  for (double end_s = seconds_now() + WAIT_S; seconds_now() < end_s && !joined;) {
    joined = hap_link_poll(other, clock_now(), &event, sizeof event) == HAP_OK;
    while (hap_link_poll(s->server, clock_now(), &event, sizeof event) == HAP_OK) {
    }
    usleep(1000);
  }
  CHECK(joined);
  hap_link_close(other);
}

/* A client's process that dies is missed, though somebody else writes by its key. */
TEST(a_client_that_dies_is_missed_whoever_writes_in_its_name)
{
  scene *s = scene_new();
  hap_link_event event;
  bool left = false;
  write_reliable(&s->stranger, true, s->id, 0, 10);
  write_newest(&s->stranger, true, s->id, 1, 10);
  hap_link_close(s->client);
  s->client = NULL;
  for (double end_s = seconds_now() + WAIT_S; seconds_now() < end_s && !left;) {
    left = hap_link_poll(s->server, clock_now(), &event, sizeof event) == HAP_OK &&
           event.kind == HAP_LINK_LEFT && event.peer == s->peer;
    usleep(500);
  }
  CHECK(left);
}
