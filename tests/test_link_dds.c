/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* hapode/link_dds.h: what hapode/link.h promises, over the loopback interface of this machine, and
 * what is refused. Public API alone. */

#include "tests/tap.h"

#include <hapode/link_dds.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

#define WAIT_S 20.0

/* Tests of other folders may run at the same time: each process has a world of its own. */
static const char *world_name(void)
{
  static char name[64];
  (void)snprintf(name, sizeof name, "test-%d", (int)getpid());
  return name;
}

static double seconds_now(void)
{
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static int64_t clock_now(void)
{
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

static hap_link_dds_def def_of(const char *name)
{
  hap_link_dds_def def;
  hap_link_dds_def_init(&def, sizeof def);
  def.world = world_name();
  def.name = name;
  def.module = getenv("HAPODE_LINK_DDS");
  return def;
}

typedef struct ends {
  hap_link *server;
  hap_link *client;
  uint32_t peer;
} ends;

static void ends_close(void *owned)
{
  ends *e = owned;
  hap_link_close(e->client);
  hap_link_close(e->server);
}

static bool link_next(hap_link *link, hap_link_event *out)
{
  hap_status status = hap_link_poll(link, clock_now(), out, sizeof *out);
  if (status < HAP_OK) {
    hap_detail why;
    (void)hap_link_detail(link, &why);
    printf("# %s\n", why.text);
  }
  CHECK(status == HAP_OK || status == HAP_END);
  return status == HAP_OK;
}

/* Polls both until an event of the kind comes at link. */
static bool wait_event(const ends *e, hap_link *link, hap_link_event_kind kind, hap_link_event *out)
{
  hap_link_event other;
  for (double end_s = seconds_now() + WAIT_S; seconds_now() < end_s;) {
    if (e->server != NULL && link != e->server) {
      (void)link_next(e->server, &other);
    }
    if (e->client != NULL && link != e->client) {
      (void)link_next(e->client, &other);
    }
    if (link_next(link, out) && out->kind == (uint32_t)kind) {
      return true;
    }
    usleep(500);
  }
  return false;
}

static void client_open(ends *e, const char *name)
{
  hap_link_dds_def def = def_of(name);
  hap_detail detail = {""};
  REQUIRE_SAY(hap_link_dds_connect(&def, &e->client, &detail) == HAP_OK, "%s", detail.text);
}

/* Both ends hear that the other one is there. */
static void ends_join(ends *e, const char *name)
{
  hap_link_event event;
  bool heard[2] = {false, false};
  client_open(e, name);
  for (double end_s = seconds_now() + WAIT_S; seconds_now() < end_s && !(heard[0] && heard[1]);) {
    if (link_next(e->server, &event) && event.kind == HAP_LINK_JOINED) {
      CHECK(strcmp(event.data, name) == 0);
      e->peer = event.peer;
      heard[0] = true;
    }
    if (link_next(e->client, &event) && event.kind == HAP_LINK_JOINED) {
      CHECK(event.peer == HAP_LINK_SERVER);
      heard[1] = true;
    }
    usleep(500);
  }
  REQUIRE(heard[0] && heard[1] && e->peer != HAP_LINK_SERVER);
}

static ends *ends_open(void)
{
  ends *e = tap_own(sizeof *e, ends_close);
  hap_link_dds_def def = def_of("");
  hap_detail detail = {""};
  if (def.module == NULL) {
    SKIP("built without Cyclone DDS (Debian: cyclonedds-dev cyclonedds-tools)");
  }
  REQUIRE_SAY(hap_link_dds_serve(&def, &e->server, &detail) == HAP_OK, "%s", detail.text);
  ends_join(e, "left hand");
  return e;
}

TEST(messages_go_both_ways)
{
  ends *e = ends_open();
  hap_link_event event;
  unsigned char newest[HAP_LINK_NEWEST_MOST];
  static unsigned char reliable[HAP_LINK_RELIABLE_MOST];
  for (size_t i = 0; i < sizeof reliable; ++i) {
    reliable[i] = (unsigned char)(i * 7 + i / 251);
  }
  memcpy(newest, reliable, sizeof newest);
  for (int up = 0; up < 2; ++up) {
    hap_link *from = up ? e->client : e->server;
    hap_link *to = up ? e->server : e->client;
    hap_link_address at = {.peer = up ? HAP_LINK_SERVER : e->peer, .channel = 3, .part = 255};
    bool found = false;
    for (int i = 0; i < 20 && !found; ++i) { /* may be lost */
      int64_t before = clock_now();
      CHECK(hap_link_send_newest(from, before, &at, newest, sizeof newest) == HAP_OK);
      usleep(20000);
      while (!found && link_next(to, &event)) {
        found = event.kind == HAP_LINK_MESSAGE && event.reliable == 0;
        CHECK(found && event.channel == 3 && event.part == 255 && event.bytes == sizeof newest);
        CHECK(found && memcmp(event.data, newest, sizeof newest) == 0);
        CHECK(event.peer == (up ? e->peer : HAP_LINK_SERVER));
        CHECK(event.arrived_ns >= before && event.arrived_ns <= clock_now() - 1000000);
      }
    }
    CHECK(found);
    at.part = 0;
    at.channel = 15;
    CHECK(hap_link_send_reliably(from, clock_now(), &at, reliable, sizeof reliable) == HAP_OK);
    REQUIRE(wait_event(e, to, HAP_LINK_MESSAGE, &event));
    CHECK(event.reliable == 1 && event.channel == 15 && event.bytes == sizeof reliable);
    CHECK(memcmp(event.data, reliable, sizeof reliable) == 0);
  }
}

/* Over all channels, while newest ones go beside them. */
TEST(reliable_messages_come_once_and_in_order)
{
  ends *e = ends_open();
  hap_link_event event;
  const uint32_t most = 2000;
  uint32_t sent = 0;
  uint32_t come = 0;
  for (double end_s = seconds_now() + WAIT_S; seconds_now() < end_s && come < most;) {
    for (int i = 0; i < 20 && sent < most; ++i) {
      const hap_link_address at = {.peer = HAP_LINK_SERVER, .channel = sent % 16};
      hap_status status = hap_link_send_reliably(e->client, clock_now(), &at, &sent, sizeof sent);
      CHECK(status == HAP_OK || status == HAP_ERROR_CAPACITY);
      sent += status == HAP_OK;
    }
    (void)link_next(e->client, &event);
    while (link_next(e->server, &event)) {
      uint32_t number;
      REQUIRE(event.kind == HAP_LINK_MESSAGE && event.bytes == sizeof number);
      memcpy(&number, event.data, sizeof number);
      CHECK(number == come && event.channel == come % 16);
      ++come;
    }
    usleep(500);
  }
  CHECK(come == most);
}

/* A slow reader finds the newest one of each channel and part, not all of them. */
TEST(of_newest_messages_the_newest_of_a_part_counts)
{
  ends *e = ends_open();
  hap_link_event event;
  for (uint32_t number = 0; number < 100; ++number) {
    for (uint32_t part = 0; part < 3; ++part) {
      const hap_link_address at = {.peer = e->peer, .channel = 2, .part = part};
      CHECK(hap_link_send_newest(e->server, clock_now(), &at, &number, sizeof number) == HAP_OK);
    }
    usleep(500);
  }
  usleep(100000);
  uint32_t count[3] = {0};
  uint32_t last[3] = {0};
  while (link_next(e->client, &event)) {
    REQUIRE(event.kind == HAP_LINK_MESSAGE && event.part < 3 && event.channel == 2);
    ++count[event.part];
    memcpy(&last[event.part], event.data, sizeof last[0]);
  }
  for (int part = 0; part < 3; ++part) {
    CHECK(count[part] == 1 && last[part] >= 90);
  }
}

TEST(either_end_hears_that_the_other_one_has_left_and_another_joins)
{
  ends *e = ends_open();
  hap_link_event event;
  uint32_t first = e->peer;
  const hap_link_address at = {.peer = first, .channel = 1};
  hap_link_close(e->client);
  e->client = NULL;
  REQUIRE(wait_event(e, e->server, HAP_LINK_LEFT, &event));
  CHECK(event.peer == first);
  CHECK(hap_link_send_reliably(e->server, clock_now(), &at, "x", 1) == HAP_ERROR_NOT_FOUND);
  ends_join(e, "right hand");
  CHECK(e->peer != first);
  hap_link_close(e->server);
  e->server = NULL;
  REQUIRE(wait_event(e, e->client, HAP_LINK_LEFT, &event));
  CHECK(event.peer == HAP_LINK_SERVER);
}

/* Two of one name are two: it is for the session to choose. */
TEST(two_clients_of_one_name_are_told_apart)
{
  ends *e = ends_open();
  hap_link *first = e->client;
  uint32_t first_peer = e->peer;
  hap_link_event event;
  ends_join(e, "left hand");
  CHECK(e->peer != first_peer);
  const uint32_t peers[2] = {first_peer, e->peer};
  hap_link *const clients[2] = {first, e->client};
  for (uint32_t i = 0; i < 2; ++i) {
    const hap_link_address at = {.peer = peers[i], .channel = 1};
    CHECK(hap_link_send_reliably(e->server, clock_now(), &at, &i, sizeof i) == HAP_OK);
  }
  for (uint32_t i = 0; i < 2; ++i) {
    uint32_t number = 2;
    for (double end_s = seconds_now() + WAIT_S; seconds_now() < end_s && number == 2;) {
      if (link_next(clients[i], &event) && event.bytes == sizeof number) {
        memcpy(&number, event.data, sizeof number);
      }
      usleep(500);
    }
    CHECK(number == i);
    CHECK(!link_next(clients[i], &event));
  }
  hap_link_close(first);
}

TEST(links_of_another_world_do_not_meet)
{
  ends *e = ends_open();
  hap_link_dds_def def = def_of("stranger");
  hap_link_event event;
  hap_link *other;
  def.world = "another-world";
  REQUIRE(hap_link_dds_connect(&def, &other, NULL) == HAP_OK);
  for (int i = 0; i < 500; ++i) {
    CHECK(!link_next(other, &event));
    CHECK(!link_next(e->server, &event));
    usleep(1000);
  }
  hap_link_close(other);
}

/* ---- what is refused ---- */

typedef struct bad_def {
  const char *name;
  hap_link_dds_def def; /* what is not 0 is taken over */
  hap_status status;
  const char *says;
} bad_def;

static const bad_def bad_defs[] = {
    {"no world", {.world = ""}, HAP_ERROR_ARGUMENT, "name of the world"},
    {"wildcard", {.world = "*"}, HAP_ERROR_ARGUMENT, "name of the world"},
    {"markup", {.world = "a\"><b"}, HAP_ERROR_ARGUMENT, "name of the world"},
    {"hand", {.name = "a\nb"}, HAP_ERROR_ARGUMENT, "name of the hand"},
    {"domain", {.domain = 231}, HAP_ERROR_ARGUMENT, "domain 231"},
    {"insecure 2", {.insecure = 2}, HAP_ERROR_ARGUMENT, "insecure 2"},
    {"both", {.insecure = 1, .certificates = "/tmp"}, HAP_ERROR_ARGUMENT, "choose one"},
    {"peers alone", {.peers = "10.0.0.1"}, HAP_ERROR_ARGUMENT, "certificates"},
    {"interface alone", {.interface_name = "eth0"}, HAP_ERROR_ARGUMENT, "certificates"},
    {"markup of peers", {.insecure = 1, .peers = "a\"/>"}, HAP_ERROR_ARGUMENT, "peers"},
    {"no folder", {.certificates = "/nowhere", .domain = 68}, HAP_ERROR_NOT_FOUND, "identity_ca"},
    {"interface",
     {.insecure = 1, .interface_name = "none0", .domain = 69},
     HAP_ERROR_IO,
     "interface"},
    {"module", {.module = "/nowhere/x.so"}, HAP_ERROR_NOT_FOUND, "/nowhere/x.so"},
};

TEST_EACH(bad_defs, const bad_def *row)
{
  hap_link_dds_def def = def_of("hand");
  hap_link *link = (hap_link *)(uintptr_t)1;
  hap_detail detail = {""};
  if (def.module == NULL) {
    SKIP("built without Cyclone DDS");
  }
  def.world = row->def.world != NULL ? row->def.world : def.world;
  def.name = row->def.name != NULL ? row->def.name : def.name;
  def.module = row->def.module != NULL ? row->def.module : def.module;
  def.certificates = row->def.certificates;
  def.peers = row->def.peers;
  def.interface_name = row->def.interface_name;
  def.insecure = row->def.insecure;
  def.domain = row->def.domain != 0 ? row->def.domain : def.domain;
  hap_status status = hap_link_dds_serve(&def, &link, &detail);
  printf("# %s\n", detail.text);
  CHECK(status == row->status && link == NULL);
  CHECK(strstr(detail.text, row->says) != NULL);
}

TEST(without_a_module_a_text_says_what_to_install)
{
  hap_link *link;
  hap_detail detail = {""};
  hap_link_dds_def def;
  hap_link_dds_def_init(&def, sizeof def);
  hap_status status = hap_link_dds_serve(&def, &link, &detail);
  if (status >= HAP_OK) { /* it is installed */
    hap_link_close(link);
    SKIP("the module is installed on this machine");
  }
  CHECK(status == HAP_ERROR_NOT_FOUND && strstr(detail.text, "hapode-link-dds") != NULL);
  CHECK(hap_link_dds_serve(&def, NULL, &detail) == HAP_ERROR_ARGUMENT);
  def.cookie = 0;
  CHECK(hap_link_dds_serve(&def, &link, &detail) == HAP_ERROR_UNINITIALISED);
}

/* The process has one kind of network in a domain. */
TEST(a_domain_with_another_network_is_refused)
{
  ends *e = ends_open();
  hap_link_dds_def def = def_of("hand");
  hap_link *link;
  hap_detail detail = {""};
  def.insecure = 1;
  CHECK(hap_link_dds_connect(&def, &link, &detail) == HAP_ERROR_STATE);
  CHECK(strstr(detail.text, "another network") != NULL);
  CHECK(e->server != NULL);
}
