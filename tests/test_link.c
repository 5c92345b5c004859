/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* hapode/link.h: what a link promises, on the one inside the process. Public API alone. */

#include "tests/tap.h"

#include <hapode/link.h>
#include <math.h>

#define MS 1000000LL

/* ---- two ends ---- */

typedef struct ends {
  hap_link *server;
  hap_link *client;
  uint32_t peer; /* the client's number */
  int64_t now_ns;
} ends;

static hap_link_path_def path_of(double delay, double jitter, double loss, double duplicate)
{
  hap_link_path_def path;
  hap_link_path_def_init(&path, sizeof path);
  path.delay = delay;
  path.jitter = jitter;
  path.loss = loss;
  path.duplicate = duplicate;
  return path;
}

static void ends_close(void *owned)
{
  ends *e = owned;
  hap_link_close(e->client);
  hap_link_close(e->server);
}

static bool link_next(hap_link *link, int64_t now_ns, hap_link_event *out)
{
  hap_status status = hap_link_poll(link, now_ns, out, sizeof *out);
  CHECK(status == HAP_OK || status == HAP_END);
  return status == HAP_OK;
}

/* Of a kind, and nothing else before it. */
static void expect_event(hap_link *link, int64_t now_ns, hap_link_event_kind kind,
                         hap_link_event *out)
{
  REQUIRE(link_next(link, now_ns, out));
  CHECK(out->kind == (uint32_t)kind && out->size == sizeof *out);
}

static ends *ends_open(const hap_link_path_def *up, const hap_link_path_def *down)
{
  ends *e = tap_own(sizeof *e, ends_close);
  hap_detail detail = {""};
  hap_link_event event;
  REQUIRE(hap_link_local_serve(&e->server, &detail) == HAP_OK);
  REQUIRE(hap_link_local_connect(e->server, "left hand", up, down, &e->client, &detail) == HAP_OK);
  CHECK(!link_next(e->client, 0, &event));
  e->now_ns = up != NULL ? llround(1e9 * (up->delay + up->jitter)) : 0;
  expect_event(e->server, e->now_ns, HAP_LINK_JOINED, &event);
  CHECK(strcmp(event.data, "left hand") == 0);
  e->peer = event.peer;
  CHECK(e->peer != HAP_LINK_SERVER);
  e->now_ns += down != NULL ? llround(1e9 * (down->delay + down->jitter)) : 0;
  expect_event(e->client, e->now_ns, HAP_LINK_JOINED, &event);
  CHECK(event.peer == HAP_LINK_SERVER);
  return e;
}

static const hap_link_address to_server = {.peer = HAP_LINK_SERVER, .channel = 3, .part = 2};

static hap_status send_number(ends *e, uint32_t number, bool reliable)
{
  hap_link_address to = to_server;
  to.part = reliable ? 0 : to.part;
  return reliable ? hap_link_send_reliably(e->client, e->now_ns, &to, &number, sizeof number)
                  : hap_link_send_newest(e->client, e->now_ns, &to, &number, sizeof number);
}

static uint32_t number_of(const hap_link_event *event)
{
  uint32_t number = 0;
  REQUIRE(event->kind == HAP_LINK_MESSAGE && event->bytes == sizeof number);
  memcpy(&number, event->data, sizeof number);
  return number;
}

/* ---- the way ---- */

TEST(a_message_comes_whole_after_the_delay_and_not_before)
{
  const hap_link_path_def up = path_of(0.05, 0.0, 0.0, 0.0);
  const hap_link_path_def down = path_of(0.02, 0.0, 0.0, 0.0);
  ends *e = ends_open(&up, &down);
  CHECK(e->now_ns == 70 * MS); /* a round trip to join */
  char text[HAP_LINK_NEWEST_MOST];
  memset(text, 'x', sizeof text);
  hap_link_event event;
  REQUIRE(hap_link_send_newest(e->client, e->now_ns, &to_server, text, sizeof text) == HAP_OK);
  text[0] = 'y'; /* the link has its own */
  CHECK(!link_next(e->server, e->now_ns + 50 * MS - 1, &event));
  expect_event(e->server, e->now_ns + 50 * MS, HAP_LINK_MESSAGE, &event);
  CHECK(event.peer == e->peer && event.channel == 3 && event.part == 2 && event.reliable == 0);
  CHECK(event.bytes == sizeof text && memchr(event.data, 'y', event.bytes) == NULL);
  const hap_link_address back = {.peer = e->peer, .channel = 15};
  REQUIRE(hap_link_send_reliably(e->server, e->now_ns, &back, "abc", 3) == HAP_OK);
  CHECK(!link_next(e->client, e->now_ns + 20 * MS - 1, &event));
  expect_event(e->client, e->now_ns + 20 * MS, HAP_LINK_MESSAGE, &event);
  CHECK(event.reliable == 1 && event.channel == 15 && event.part == 0 &&
        memcmp(event.data, "abc", 3) == 0);
}

/* What became of numbered messages, one a millisecond. */
typedef struct course {
  uint32_t came[20000]; /* how often */
  uint32_t count;
  uint32_t overtaken;
  double late_sum; /* s */
  double late_most;
  double late_least;
  uint64_t hash; /* of what came when */
} course;

static void course_forget(void *owned)
{
  (void)owned;
}

static course *course_run(uint64_t seed, bool reliable)
{
  course *c = tap_own(sizeof *c, course_forget);
  hap_link_path_def up = path_of(0.05, 0.02, 0.05, 0.03);
  up.seed = seed;
  ends *e = ends_open(&up, NULL);
  uint32_t highest = 0;
  int64_t begin_ns = e->now_ns;
  c->late_least = 1.0;
  c->hash = 1;
  const uint32_t all = sizeof c->came / sizeof c->came[0];
  for (uint32_t i = 0; i < all + 100; ++i, e->now_ns += MS) {
    CHECK(i >= all || send_number(e, i, reliable) == HAP_OK);
    hap_link_event event;
    while (link_next(e->server, e->now_ns, &event)) {
      uint32_t number = number_of(&event);
      double late = 1e-9 * (double)(e->now_ns - begin_ns - number * MS);
      ++c->came[number];
      ++c->count;
      c->overtaken += number < highest;
      highest = number > highest ? number : highest;
      c->late_sum += late;
      c->late_most = fmax(c->late_most, late);
      c->late_least = fmin(c->late_least, late);
      c->hash = (c->hash ^ number ^ ((uint64_t)i << 32)) * 0x100000001b3u;
    }
  }
  return c;
}

static uint32_t came_times(const course *c, uint32_t times)
{
  uint32_t count = 0;
  for (size_t i = 0; i < sizeof c->came / sizeof c->came[0]; ++i) {
    count += c->came[i] == times;
  }
  return count;
}

/* Binomial: 20000 draws of 5 and 3 per cent have standard deviations of 31 and 24. */
TEST(newest_messages_are_lost_doubled_late_and_overtaken_as_asked)
{
  const course *c = course_run(7, false);
  printf("# lost %u, twice %u, overtaken %u, %.2f ms\n", came_times(c, 0), came_times(c, 2),
         c->overtaken, 1e3 * c->late_sum / c->count);
  CHECK(abs((int)came_times(c, 0) - 1000) < 125);
  CHECK(abs((int)came_times(c, 2) - 570) < 100);
  CHECK(c->late_least >= 0.05 && c->late_most <= 0.0711);
  CHECK_NEAR(c->late_sum / c->count, 0.06 + 0.0005, 3e-4); /* polled once a millisecond */
  CHECK(c->overtaken > 5000);
}

TEST(reliable_messages_come_once_and_in_order)
{
  const course *c = course_run(7, true);
  CHECK(came_times(c, 1) == sizeof c->came / sizeof c->came[0] && c->overtaken == 0);
}

TEST(the_same_seed_is_the_same_course_on_every_machine)
{
  CHECK(course_run(7, false)->hash == course_run(7, false)->hash);
  CHECK(course_run(7, false)->hash != course_run(8, false)->hash);
  printf("# 0x%016llx\n", (unsigned long long)course_run(7, false)->hash);
  CHECK(course_run(7, false)->hash == 0xd166c87bef63adc1u);
}

/* ---- peers ---- */

TEST(clients_are_told_apart_and_leave)
{
  ends *e = ends_open(NULL, NULL);
  hap_link *other;
  hap_link_event event;
  hap_detail detail = {""};
  CHECK(hap_link_local_connect(e->server, "left hand", NULL, NULL, &other, &detail) ==
        HAP_ERROR_STATE);
  CHECK(strstr(detail.text, "left hand") != NULL && other == NULL);
  REQUIRE(hap_link_local_connect(e->server, "right", NULL, NULL, &other, &detail) == HAP_OK);
  CHECK(!link_next(other, 0, &event));
  expect_event(e->server, 0, HAP_LINK_JOINED, &event);
  uint32_t second = event.peer;
  CHECK(second != e->peer && strcmp(event.data, "right") == 0);
  expect_event(other, 0, HAP_LINK_JOINED, &event);
  REQUIRE(hap_link_send_newest(other, 0, &to_server, "r", 1) == HAP_OK);
  expect_event(e->server, 0, HAP_LINK_MESSAGE, &event);
  CHECK(event.peer == second);
  hap_link_close(other);
  expect_event(e->server, 0, HAP_LINK_LEFT, &event);
  CHECK(event.peer == second && !link_next(e->server, 0, &event));
  const hap_link_address gone = {.peer = second};
  CHECK(hap_link_send_newest(e->server, 0, &gone, "x", 1) == HAP_ERROR_NOT_FOUND);
  CHECK(hap_link_detail(e->server, &detail) == HAP_OK && strstr(detail.text, "left") != NULL);
  CHECK(send_number(e, 1, false) == HAP_OK); /* the first one is still there */
  hap_link_close(e->server);
  e->server = NULL;
  expect_event(e->client, 0, HAP_LINK_LEFT, &event);
  CHECK(event.peer == HAP_LINK_SERVER && send_number(e, 1, true) == HAP_ERROR_NOT_FOUND);
}

TEST(nothing_follows_of_a_client_that_has_left)
{
  const hap_link_path_def up = path_of(0.0, 0.1, 0.0, 1.0);
  ends *e = ends_open(&up, NULL);
  hap_link_event event;
  for (uint32_t i = 0; i < 100; ++i) {
    CHECK(send_number(e, i, false) == HAP_OK);
  }
  hap_link_close(e->client);
  e->client = NULL;
  while (link_next(e->server, e->now_ns + 200 * MS, &event) && event.kind == HAP_LINK_MESSAGE) {
  }
  CHECK(event.kind == HAP_LINK_LEFT && !link_next(e->server, e->now_ns + 200 * MS, &event));
}

TEST(a_client_that_closes_unheard_was_never_there)
{
  const hap_link_path_def up = path_of(0.1, 0.0, 0.0, 0.0);
  hap_link *server;
  hap_link *client;
  hap_link_event event;
  REQUIRE(hap_link_local_serve(&server, NULL) == HAP_OK);
  REQUIRE(hap_link_local_connect(server, "", &up, NULL, &client, NULL) == HAP_OK);
  CHECK(!link_next(client, 0, &event));
  CHECK(hap_link_send_newest(client, 0, &to_server, "x", 1) == HAP_ERROR_NOT_FOUND);
  hap_link_close(client);
  CHECK(!link_next(server, 1000 * MS, &event));
  hap_link_close(server);
}

TEST(an_outage_is_made_by_other_paths)
{
  ends *e = ends_open(NULL, NULL);
  const hap_link_path_def cut = path_of(0.0, 0.0, 1.0, 0.0);
  hap_link_event event;
  CHECK(hap_link_local_set_paths(e->client, &cut, NULL) == HAP_OK);
  CHECK(send_number(e, 1, false) == HAP_OK && !link_next(e->server, MS, &event));
  const hap_link_path_def good = path_of(0.0, 0.0, 0.0, 0.0);
  CHECK(hap_link_local_set_paths(e->client, &good, NULL) == HAP_OK);
  CHECK(send_number(e, 2, false) == HAP_OK);
  expect_event(e->server, MS, HAP_LINK_MESSAGE, &event);
  CHECK(number_of(&event) == 2);
  CHECK(hap_link_local_set_paths(e->server, &good, NULL) == HAP_ERROR_ARGUMENT);
}

/* ---- what is wrong ---- */

typedef struct bad_send {
  hap_link_address to;
  uint32_t bytes;
  bool reliable;
} bad_send;

TEST(what_no_link_sends_is_refused_with_a_text)
{
  static const bad_send bad[] = {
      {{0, HAP_LINK_CHANNELS, 0}, 1, false},
      {{0, 0, HAP_LINK_PARTS}, 1, false},
      {{0, 0, 1}, 1, true},
      {{0, 0, 0}, 0, false},
      {{0, 0, 0}, HAP_LINK_NEWEST_MOST + 1, false},
      {{0, 0, 0}, HAP_LINK_RELIABLE_MOST + 1, true},
  };
  static const char bytes[HAP_LINK_RELIABLE_MOST + 1];
  ends *e = ends_open(NULL, NULL);
  for (size_t i = 0; i < sizeof bad / sizeof bad[0]; ++i) {
    hap_detail detail = {""};
    hap_status status = bad[i].reliable
                            ? hap_link_send_reliably(e->client, 0, &bad[i].to, bytes, bad[i].bytes)
                            : hap_link_send_newest(e->client, 0, &bad[i].to, bytes, bad[i].bytes);
    CHECK(status == HAP_ERROR_ARGUMENT && hap_link_detail(e->client, &detail) == HAP_OK);
    CHECK(strlen(detail.text) > 20);
  }
  hap_link_event event;
  CHECK(!link_next(e->server, MS, &event));
  CHECK(hap_link_send_newest(NULL, 0, &to_server, "x", 1) == HAP_ERROR_ARGUMENT);
  CHECK(hap_link_send_newest(e->client, 0, NULL, "x", 1) == HAP_ERROR_ARGUMENT);
  CHECK(hap_link_send_newest(e->client, 0, &to_server, NULL, 1) == HAP_ERROR_ARGUMENT);
  CHECK(hap_link_poll(e->client, 0, &event, 3) == HAP_ERROR_ARGUMENT);
  CHECK(hap_link_poll(e->client, 0, NULL, sizeof event) == HAP_ERROR_ARGUMENT);
  hap_link_close(NULL);
}

TEST(paths_out_of_range_are_refused_by_name)
{
  static const struct {
    const char *name;
    hap_link_path_def path;
  } bad[] = {{"delay", {.delay = -1e-3}},
             {"delay", {.delay = 11.0}},
             {"jitter", {.jitter = (double)NAN}},
             {"loss", {.loss = 1.5}},
             {"duplicate", {.duplicate = -0.5}}};
  hap_link *server;
  hap_link *client;
  REQUIRE(hap_link_local_serve(&server, NULL) == HAP_OK);
  for (size_t i = 0; i < sizeof bad / sizeof bad[0]; ++i) {
    hap_detail detail = {""};
    hap_link_path_def path =
        path_of(bad[i].path.delay, bad[i].path.jitter, bad[i].path.loss, bad[i].path.duplicate);
    CHECK(hap_link_local_connect(server, "a", &path, NULL, &client, &detail) == HAP_ERROR_ARGUMENT);
    CHECK(strstr(detail.text, bad[i].name) != NULL && client == NULL);
  }
  hap_link_close(server);
}

/* ---- a transport of one's own ---- */

typedef struct own_transport {
  hap_link_event events[8];
  uint32_t next;
  uint32_t count;
  bool closed;
} own_transport;

static hap_status own_send(void *self, int64_t now_ns, const hap_link_parcel *parcel,
                           hap_detail *detail)
{
  (void)self;
  (void)now_ns;
  (void)parcel;
  snprintf(detail->text, sizeof detail->text, "the cable is out");
  return HAP_ERROR_IO;
}

static hap_status own_poll(void *self, int64_t now_ns, hap_link_event *out, hap_detail *detail)
{
  own_transport *own = self;
  (void)now_ns;
  (void)detail;
  if (own->next == own->count) {
    return HAP_END;
  }
  *out = own->events[own->next++];
  return HAP_OK;
}

static void own_close(void *self)
{
  ((own_transport *)self)->closed = true;
}

static hap_link_ops own_ops(void)
{
  return (hap_link_ops){.abi = HAP_LINK_ABI,
                        .size = sizeof(hap_link_ops),
                        .name = "own",
                        .send = own_send,
                        .poll = own_poll,
                        .close = own_close};
}

TEST(what_a_transport_gets_from_outside_is_checked_and_counted)
{
  const hap_link_ops ops = own_ops();
  own_transport own = {.count = 7,
                       .events = {{.kind = 77},
                                  {.channel = 16, .bytes = 1, .data = "x"},
                                  {.part = 256, .bytes = 1, .data = "x"},
                                  {.bytes = 1201, .data = "x"},
                                  {.bytes = 1},
                                  {.data = "x"},
                                  {.channel = 15, .part = 255, .bytes = 1, .data = "x"}}};
  hap_link *link;
  hap_link_event event;
  hap_link_figures figures;
  hap_detail detail = {""};
  REQUIRE(hap_link_create(&ops, &own, &link, &detail) == HAP_OK);
  expect_event(link, 0, HAP_LINK_MESSAGE, &event);
  CHECK(event.channel == 15 && event.part == 255 && !link_next(link, 0, &event));
  CHECK(hap_link_send_newest(link, 0, &to_server, "x", 1) == HAP_ERROR_IO);
  CHECK(hap_link_detail(link, &detail) == HAP_OK && strstr(detail.text, "cable") != NULL);
  CHECK(hap_link_get_figures(link, &figures, sizeof figures) == HAP_OK);
  CHECK(figures.refused == 6 && figures.received == 1 && figures.received_bytes == 1);
  CHECK(figures.sent == 0 && figures.sent_bytes == 0);
  hap_link_close(link);
  CHECK(own.closed);
}

TEST(operations_of_another_abi_or_with_holes_are_refused)
{
  hap_link_ops bad[4] = {own_ops(), own_ops(), own_ops(), own_ops()};
  bad[0].abi = HAP_LINK_ABI + 1;
  bad[1].poll = NULL;
  bad[2].size = 8;
  bad[3].name = NULL;
  for (int i = 0; i < 4; ++i) {
    own_transport own = {.count = 0};
    hap_link *link = NULL;
    hap_detail detail = {""};
    hap_status wanted = i == 0 ? HAP_ERROR_UNSUPPORTED : HAP_ERROR_ARGUMENT;
    CHECK(hap_link_create(&bad[i], &own, &link, &detail) == wanted);
    CHECK(link == NULL && strlen(detail.text) > 20);
  }
}
