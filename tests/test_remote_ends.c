/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Two sessions, one with a world and one with a hand, and a link between them: joining, leaving,
 * another client after the first one, a server that dies, terms that do not fit. */

#include "tests/tap.h"

#include "remote/stamps.h"
#include "remote/terms.h"
#include "tests/far_rig.h"
#include "tests/logged.h"

/* ---- tests ---- */

TEST(a_hand_feels_a_cube_that_only_another_session_has)
{
  server *s = server_open();
  client *c = client_open(s, "hand", 1000.0, 8);
  CHECK_NEAR(hand_press(s, c), 3.0, 0.02); /* 3 mm of 1000 N/m */
  hap_stats stats = session_stats(c->session);
  CHECK(stats.faults.stale_ticks == 0 && stats.loop.models_adopted > 50);
  CHECK(stats.loop.model_age_max_s > 0.05 && stats.loop.model_age_max_s < 0.08);
  CHECK(s->far.world.end.refused == 0 && c->far.loop.end.refused == 0);
  for (int i = 0; i < 300; ++i) { /* and takes it along by friction: 60 mm */
    client_put(c, 2e-4 * i, 0.057, 0.2);
    ends_run(s, c, 1);
  }
  ends_run(s, c, 200);
  printf("# the cube is at %.4f m\n", dBodyGetPosition(s->cube)[0]);
  CHECK(dBodyGetPosition(s->cube)[0] > 0.05);
  hap_stats world = session_stats(s->session);
  CHECK(world.hand.momentum_error_ns < 1e-12);
}

/* A cube in flight is the loop's when the hand goes; then it falls as bodies do. */
TEST(the_bodies_of_a_hand_that_leaves_are_the_world_s_again)
{
  server *s = server_open();
  client *c = client_open(s, "hand", 1000.0, 8);
  client_put(c, 0.0, 0.5, 0.0);
  dBodySetPosition(s->cube, 0.0, 0.0, 2.0);
  dBodySetLinearVel(s->cube, 0.3, 0.0, 1.0);
  ends_run(s, c, 400); /* up, 1 m beside the hand, and down */
  hap_stats stats = session_stats(s->session);
  printf("# %u bodies in the loop, the cube at %.4f m\n", stats.model.range_bodies,
         dBodyGetPosition(s->cube)[2]);
  CHECK(stats.model.range_bodies == 1);
  tap_release(c);
  ends_run(s, NULL, 220);
  CHECK(!s->far.world.end.joined);
  CHECK(s->session->physics != NULL && session_stats(s->session).model.range_bodies == 0);
  /* The world had it as it was a one-way trip ago: carried on by that. */
  double t = 1e-9 * (double)newest_cycle(s);
  const dReal *at = dBodyGetPosition(s->cube);
  const dReal *v = dBodyGetLinearVel(s->cube);
  printf("# %.4f s: at %.5f %.5f m, %.5f m/s\n", t, at[0], at[2], v[2]);
  CHECK_NEAR(at[0], 0.3 * t, 1e-4);
  CHECK_NEAR(at[2], 2.0 + t - 0.5 * 9.81 * t * t, 2.5e-3); /* ticks: g T t / 2 is 2 mm */
  CHECK_NEAR(v[2], 1.0 - 9.81 * t, 0.011);
}

TEST(another_hand_comes_after_the_first_and_momentum_is_kept)
{
  server *s = server_open();
  double first[2];
  for (int i = 0; i < 2; ++i) {
    client *c = client_open(s, i == 0 ? "first" : "second", 1000.0, 8);
    first[i] = hand_press(s, c);
    hap_stats stats = session_stats(c->session);
    CHECK(stats.faults.stale_ticks == 0 && stats.loop.model_age_max_s < 0.08);
    tap_release(c);
    ends_run(s, NULL, 300);
    CHECK(dBodyIsEnabled(s->cube) != 0 || dBodyGetPosition(s->cube)[2] > 0.02);
    CHECK_NEAR(dBodyGetPosition(s->cube)[2], 0.025, 1e-3);
  }
  CHECK_NEAR(first[0], 3.0, 0.02);
  CHECK_NEAR(first[1], 3.0, 0.02);
  hap_stats world = session_stats(s->session);
  printf("# momentum %.3g N s not there\n", world.hand.momentum_error_ns);
  CHECK(s->far.world.clients == 2 && world.hand.momentum_error_ns < 1e-12);
}

TEST(of_a_second_hand_nothing_is_taken_and_the_first_one_does_not_feel_it)
{
  server *s = server_open();
  client *c = client_open(s, "hand", 1000.0, 8);
  hap_link *other;
  hap_link_event event;
  REQUIRE(hap_link_local_connect(s->link, "other", NULL, NULL, &other, NULL) == HAP_OK);
  ends_run(s, c, 200);
  CHECK(hap_link_poll(other, hap_session_now(s->session), &event, sizeof event) == HAP_END);
  ends_run(s, c, 50);
  CHECK(hap_link_poll(other, hap_session_now(s->session), &event, sizeof event) == HAP_OK);
  for (uint32_t channel = 0; channel < HAP_LINK_CHANNELS; ++channel) {
    const hap_link_address to = {.channel = channel};
    CHECK(hap_link_send_newest(other, hap_session_now(s->session), &to, "no", 2) == HAP_OK);
  }
  CHECK_NEAR(hand_press(s, c), 3.0, 0.02);
  CHECK(s->far.world.end.refused == HAP_LINK_CHANNELS);
  hap_link_close(other);
}

TEST(a_server_that_dies_is_felt_as_nothing_100_ms_after_the_limit)
{
  server *s = server_open();
  client *c = client_open(s, "hand", 1000.0, 8);
  double force[3];
  CHECK_NEAR(hand_press(s, c), 3.0, 0.02);
  int64_t last_ns = newest_cycle(s);
  int64_t limit_ns = last_ns + 2 * 20 * MS + 150 * MS + MS;
  while (hap_session_now(c->session) <= limit_ns + 100 * MS + MS) {
    client_feel(c, force);
    CHECK(hap_session_now(c->session) > limit_ns || fabs(force[2] - 3.0) < 0.02);
    CHECK(hap_session_advance(c->session, 1) == HAP_OK);
  }
  client_feel(c, force);
  CHECK_NEAR(force[2], 0.0, 1e-9);
  CHECK(session_stats(c->session).faults.count == 0);
}

/* ---- a server that is wrong ---- */

static bool future_give(void *self, void *const messages[2])
{
  hapi_model *model = messages[0];
  model->number = ++*(uint64_t *)self;
  model->state_ns = model->valid_from_ns = model->sent_ns = INT64_C(3600000000000000);
  model->look_ahead_s = 1e9;
  return true;
}

/* Else the guard would wait for it to grow old for ever. */
TEST(a_model_of_the_future_is_as_old_as_its_arrival)
{
  server *s = server_open();
  client *c = client_open(s, "hand", 1000.0, 8);
  hapi_loop_end *loop = &c->far.loop;
  uint64_t number = 0;
  loop->agreed = true;
  loop->stamps = (hapi_stamps){.count = 1};
  loop->end.codec = (hapi_codec){.self = &number, .give = future_give};
  hapi_loop_end_receive(loop, 5000 * MS);
  const hapi_model *model = hapi_exchange_model_take(loop->exchange);
  REQUIRE(model != NULL && model->number == 1);
  CHECK(model->state_ns == 5000 * MS && model->sent_ns == 5000 * MS);
  CHECK(model->valid_from_ns == 5000 * MS);
  CHECK(model->look_ahead_s == loop->terms.look_ahead_s);
}

TEST(a_world_that_does_not_look_ahead_far_enough_is_warned_of_once)
{
  server *s = server_open();
  client *c = client_open(s, "hand", 1000.0, 8);
  logged[0] = '\0';
  log_listen(true);
  ends_run(s, c, 2000);
  CHECK(strstr(logged, "away and back") == NULL);
  c->far.loop.terms.look_ahead_s = 0.05; /* of 0.1 s, and a step of 0.02 s */
  ends_run(s, c, 200);
  const char *first = strstr(logged, "away and back");
  CHECK(first != NULL && strstr(first + 1, "away and back") == NULL);
  log_listen(false);
}

/* ---- terms ---- */

TEST(ends_that_do_not_fit_say_why_and_nothing_is_felt)
{
  static const struct {
    double haptic_hz;
    int32_t max_bodies;
    const char *says;
  } bad[] = {{2000.0, 8, "haptic_hz"}, {1000.0, 16, "max_bodies"}};
  for (int i = 0; i < 2; ++i) {
    server *s = server_open();
    client *c = client_open(s, "hand", bad[i].haptic_hz, bad[i].max_bodies);
    double force[3];
    client_put(c, 0.0, 0.057, 0.0);
    for (int k = 0; k < 600; ++k) {
      ends_run(s, NULL, 1);
      CHECK(hap_session_advance(c->session, bad[i].haptic_hz > 1000.0 ? 2 : 1) == HAP_OK);
    }
    client_feel(c, force);
    CHECK(force[2] == 0.0 && !c->far.loop.agreed && c->far.loop.end.refused > 0);
    CHECK(strstr(c->far.loop.end.detail.text, bad[i].says) != NULL);
    tap_release(c);
    tap_release(s);
  }
}

TEST(bytes_that_are_no_terms_are_refused)
{
  const hapi_terms terms = {.look_ahead_s = 0.25, .period_s = 0.02, .haptic_hz = 1000.0};
  unsigned char good[HAPI_TERMS_BYTES];
  hapi_terms read;
  hap_detail detail;
  hapi_terms_write(&terms, good);
  REQUIRE(hapi_terms_read(good, sizeof good, &read, &detail) == HAP_OK);
  CHECK(read.look_ahead_s == 0.25 && read.period_s == 0.02 && read.haptic_hz == 1000.0);
  CHECK(hapi_terms_read(good, sizeof good - 1, &read, &detail) == HAP_ERROR_FORMAT);
  for (int i = 0; i < 8; ++i) {
    unsigned char bad[HAPI_TERMS_BYTES];
    memcpy(bad, good, sizeof bad);
    bad[i] ^= 0x20;
    CHECK(hapi_terms_read(bad, sizeof bad, &read, &detail) == HAP_ERROR_FORMAT);
  }
  good[8] = 2;
  CHECK(hapi_terms_read(good, sizeof good, &read, &detail) == HAP_ERROR_UNSUPPORTED);
  CHECK(strstr(detail.text, "version 2") != NULL);
  const double wrong[] = {-0.1, 1.1, (double)NAN, (double)INFINITY};
  for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; ++i) {
    hapi_terms bad = terms;
    bad.look_ahead_s = wrong[i];
    hapi_terms_write(&bad, good);
    CHECK(hapi_terms_read(good, sizeof good, &read, &detail) == HAP_ERROR_FORMAT);
    bad = terms;
    bad.period_s = wrong[i];
    hapi_terms_write(&bad, good);
    CHECK(hapi_terms_read(good, sizeof good, &read, &detail) == HAP_ERROR_FORMAT);
  }
}

/* ---- the clocks ---- */

/* Questions and answers with these ways, where the world's clock is ahead by 5 s. */
static int64_t offset_of(const int64_t (*ways)[2], uint32_t count, int64_t *out_trip_ns)
{
  const int64_t ahead_ns = 5000 * MS;
  hapi_stamps stamps = {.count = 0};
  unsigned char question[HAPI_STAMPS_QUESTION];
  unsigned char answer[HAPI_STAMPS_ANSWER];
  for (uint32_t i = 0; i < count; ++i) {
    int64_t now_ns = (i + 1) * 300 * MS;
    REQUIRE(hapi_stamps_ask(&stamps, now_ns, question));
    CHECK(!hapi_stamps_ask(&stamps, now_ns + MS, question));
    const int64_t found_ns = now_ns + ways[i][0] + ahead_ns; /* and 3 ms until the answer goes */
    const int64_t times_ns[2] = {found_ns, found_ns + 3 * MS};
    REQUIRE(hapi_stamps_answer(question, sizeof question, times_ns, answer));
    REQUIRE(hapi_stamps_take(&stamps, answer, sizeof answer,
                             now_ns + ways[i][0] + ways[i][1] + 3 * MS));
  }
  return hapi_stamps_offset(&stamps, out_trip_ns) - ahead_ns;
}

/* The answer with the shortest round trip counts; what its ways differ by, by half. */
TEST(the_clocks_are_compared_by_the_fastest_of_sixteen_answers)
{
  static const int64_t equal[][2] = {{50 * MS, 50 * MS}};
  static const int64_t some[][2] = {
      {60 * MS, 20 * MS}, {30 * MS, 26 * MS}, {90 * MS, 20 * MS}, {20 * MS, 70 * MS}};
  int64_t many[17][2];
  int64_t trip_ns;
  CHECK(offset_of(equal, 1, &trip_ns) == 0 && trip_ns == 100 * MS);
  CHECK(offset_of(some, 4, &trip_ns) == 2 * MS && trip_ns == 56 * MS);
  for (int i = 0; i < 17; ++i) {
    many[i][0] = i == 0 ? 10 * MS : 40 * MS; /* the first one is forgotten by then */
    many[i][1] = i == 0 ? 10 * MS : (30 + i) * MS;
  }
  CHECK(offset_of((const int64_t(*)[2])many, 17, &trip_ns) == (40 - 31) * MS / 2);
  CHECK(trip_ns == 71 * MS);
}

TEST(answers_that_cannot_be_true_are_refused)
{
  hapi_stamps stamps = {.count = 0};
  unsigned char question[HAPI_STAMPS_QUESTION];
  unsigned char answer[HAPI_STAMPS_ANSWER];
  REQUIRE(hapi_stamps_ask(&stamps, 1000 * MS, question));
  const int64_t times_ns[2] = {7, 7};
  CHECK(!hapi_stamps_answer(question, sizeof question - 1, times_ns, answer));
  REQUIRE(hapi_stamps_answer(question, sizeof question, times_ns, answer));
  CHECK(!hapi_stamps_take(&stamps, answer, sizeof answer - 1, 1010 * MS));
  CHECK(!hapi_stamps_take(&stamps, answer, sizeof answer, 990 * MS));   /* before it was asked */
  CHECK(!hapi_stamps_take(&stamps, answer, sizeof answer, 12000 * MS)); /* of another life */
  memset(answer, 0xff, sizeof answer);
  CHECK(!hapi_stamps_take(&stamps, answer, sizeof answer, 1000 * MS));
  CHECK(stamps.count == 0);
}
