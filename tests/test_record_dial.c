/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A dial that the application and the clock turn while a session is recorded: a replay turns it
 * likewise. */

#include "tests/tap.h"

#include "tests/owned_rig.h"
#include "tests/recorded.h"

static void turn_the_dial(rig *r, int look)
{
  static const double places[] = {0.9, 0.1, 0.0, 1.0};
  if (look % 4 == 3 && look < 16) {
    CHECK(hap_session_set_accuracy(r->session, places[look / 4]) == HAP_OK);
  }
  if (look == 17) { /* 10 us: the clock turns it, and is in the recording */
    CHECK(hap_session_set_budget(r->session, 0.01, 0.01) == HAP_OK);
  }
}

TEST(a_dial_that_is_turned)
{
  for (int i = 0; i < 2; ++i) {
    recorded_setup s =
        recorded_setup_of("row10", i == 0 ? HAP_MODEL_CONTACT : HAP_MODEL_ACCELERANCE, 1800);
    s.accuracy = 0.3;
    s.meanwhile = turn_the_dial;
    hap_stats before = recorded_make(&s);
    rig_options options;
    hap_accuracy_info info;
    replay again = recorded_play("row10", 0);
    check_alike(&again, &before);
    rig_options_init(&options);
    options.scene = "row10";
    REQUIRE(hap_player_open(recorded_path, 0, &options.player, NULL) == HAP_OK);
    rig *r = rig_own(&options);
    CHECK(hap_session_set_accuracy(r->session, 0.5) == HAP_ERROR_STATE);
    CHECK(hap_session_set_budget(r->session, 0.0, 0.0) == HAP_ERROR_STATE);
    CHECK(hap_session_start(r->session) == HAP_OK);
    CHECK(hap_session_advance(r->session, 100) == HAP_OK);
    CHECK(hap_session_accuracy(r->session, &info, sizeof info) == HAP_OK);
    CHECK_NEAR(info.tick.accuracy, 0.3, 1e-9);
    CHECK(hap_session_advance(r->session, 200) == HAP_OK);
    CHECK(hap_session_accuracy(r->session, &info, sizeof info) == HAP_OK);
    CHECK_NEAR(info.tick.accuracy, 0.9, 1e-9);
    tap_release(r);
    hap_player_close(options.player);
  }
}

/* Set between record and start: it is not in the def. */
TEST(a_dial_that_was_turned_before_the_start)
{
  recorded_setup s = recorded_setup_of("row10", HAP_MODEL_CONTACT, 400);
  rig r;
  s.accuracy = 0.5;
  REQUIRE(recorded_create(&s, &r));
  CHECK(hap_session_set_accuracy(r.session, 0.0) == HAP_OK);
  hap_stats before = recorded_run(&s, &r);
  rig_destroy(&r);
  replay again = recorded_play("row10", 0);
  check_alike(&again, &before);
}

SET_UP
{
  return recorded_init();
}
