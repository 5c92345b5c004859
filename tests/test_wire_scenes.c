/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* lib/wire between physics and loop: a hand feels the same by way of the codec, also where
 * datagrams are lost, doubled and overtaken; and what it costs. The witness beside it is the same
 * session whose messages are copied byte by byte (held_messages.h). */

#include "tests/tap.h"

#include "bench/accuracy.h"
#include "tests/contact_world.h"
#include "tests/held_messages.h"
#include "tests/logged.h"
#include "tests/wired_messages.h"

#define LATE_S 1.0 /* the hand begins to move so long after the start */

typedef struct wire_run {
  const char *name;
  const char *scene;
  double delay_s;
  double jitter_s;
  double loss;
  double down_most; /* bytes/s at 60 Hz; 0: not looked at */
  double up_most;
  double error_most; /* of the force, against the witness */
  int count;         /* of bodies; 0: the scene's own */
} wire_run;

typedef struct wire_case {
  const wire_run *run;
  bool wired; /* else byte by byte */
  held_messages held;
  wired_messages *way;
} wire_case;

static hap_status wire_join(void *user, hap_session *session)
{
  wire_case *c = user;
  if (!c->wired) {
    return held_begin(&c->held, session, c->run->delay_s);
  }
  c->way->delay_s = c->run->delay_s;
  c->way->jitter_s = c->run->jitter_s;
  c->way->loss = c->run->loss;
  c->way->duplicates = c->run->loss;
  return wired_begin(c->way, session);
}

static const accuracy_scene *scene_named(const char *name)
{
  const accuracy_scene *which = NULL;
  for (size_t i = 0; (which = accuracy_scene_at(i)) != NULL && strcmp(which->name, name) != 0;
       ++i) {
  }
  return which;
}

static char hands[SCENE_POINTERS_MAX][ACCURACY_SPEC_MAX];

static double scene_run(bench *b, wire_case *c, accuracy_motion *out)
{
  accuracy_run_def def;
  const accuracy_scene *which = scene_named(c->run->scene);
  REQUIRE(which != NULL);
  scene_parameters parameters = accuracy_parameters(which);
  accuracy_run_def_init(&def);
  parameters.count_default = c->run->count != 0 ? c->run->count : parameters.count_default;
  def.parameters = &parameters;
  def.seconds = accuracy_seconds(which, true) + LATE_S;
  for (int i = 0; i < parameters.pointers; ++i) {
    REQUIRE(accuracy_hand(parameters.hands[i], 1.0, hands[i], sizeof hands[i] - 16));
    size_t length = strlen(hands[i]);
    (void)snprintf(hands[i] + length, sizeof hands[i] - length, ",start=%g", -LATE_S);
    def.hands[i] = hands[i];
  }
  def.session.physics_hz = 60.0;
  def.session.max_bodies = 64;
  def.session.max_contacts = 1024;
  def.expert.look_ahead = 2.0 * c->run->delay_s + 2.0 * c->run->jitter_s + 0.05;
  def.join = wire_join;
  def.join_user = c;
  hap_status status = accuracy_run(b, &def, out);
  REQUIRE_SAY(status >= HAP_OK, "%s", b->detail.text);
  return def.seconds;
}

static const wire_run runs[] = {
    {"slide", "slide", 0.0, 0.0, 0.0, 8e3, 6e3, 0.001},
    {"slide_200ms", "slide", 0.2, 0.0, 0.0, 8e3, 7e3, 0.001}, /* against older messages */
    {"row10", "row10", 0.0, 0.0, 0.0, 60e3, 30e3, 0.001},
    {"row10_far", "row10", 0.05, 0.0, 0.0, 60e3, 30e3, 0.002},
    {"row10_lossy", "row10", 0.05, 0.02, 0.05, 60e3, 30e3, 0.002},
    {"stack", "stack", 0.0, 0.0, 0.0, 0.0, 0.0, 0.001},
    {"door", "door", 0.05, 0.02, 0.05, 0.0, 0.0, 0.002},
    {"hit", "hit", 0.05, 0.02, 0.05, 0.0, 0.0, 0.02},
    {"lightstand", "lightstand", 0.05, 0.02, 0.05, 0.0, 0.0, 0.1},
    {"lever", "lever", 0.05, 0.02, 0.05, 0.0, 0.0, 0.01},
    {"grasp", "grasp", 0.05, 0.02, 0.05, 0.0, 0.0, 0.01, 0},
    {"pile_of_50", "pile8", 0.02, 0.02, 0.05, 0.0, 0.0, 0.3, 50},
};

TEST_EACH(runs, const wire_run *row)
{
  bench b = {.quick = true};
  accuracy_motion witness;
  accuracy_motion motion;
  accuracy_errors errors;
  wire_case held = {.run = row};
  wire_case wired = {.run = row, .wired = true, .way = calloc(1, sizeof(wired_messages))};
  REQUIRE(wired.way != NULL);
  scene_run(&b, &held, &witness);
  double seconds = scene_run(&b, &wired, &motion);
  wired_messages *w = wired.way;
  hapi_wire_counts client;
  hapi_wire_counts server;
  hapi_wire_client_count(w->client, &client);
  hapi_wire_server_count(w->server, &server);
  CHECK(accuracy_compare(&witness, &motion, NULL, 60.0, &errors));
  double down = (double)w->down.bytes / seconds;
  double up = (double)w->up.bytes / seconds;
  printf(
      "# %s: force %.3f %%, down %.0f + %.0f bytes/s in %llu datagrams of %llu, up %.0f + %.0f "
      "in %llu of %llu; models %llu (%llu lacking), states %llu (%llu), momentum 1 %+.1e\n",
      row->name, 100.0 * errors.force, down, (double)w->down.known_bytes / seconds,
      (unsigned long long)w->down.count, (unsigned long long)w->down.sent, up,
      (double)w->up.known_bytes / seconds, (unsigned long long)w->up.count,
      (unsigned long long)w->up.sent, (unsigned long long)client.frames,
      (unsigned long long)client.lacking, (unsigned long long)server.frames,
      (unsigned long long)server.lacking, motion.stats.hand.momentum_ratio - 1.0);
  CHECK_SAY(w->errors == 0, "%s", w->detail.text);
  CHECK(w->down.largest <= 1200 && w->up.largest <= 1200);
  CHECK(row->down_most == 0.0 || down <= row->down_most);
  CHECK(row->up_most == 0.0 || up <= row->up_most);
  CHECK(errors.force <= row->error_most);
  CHECK(fabs(motion.stats.hand.momentum_ratio - 1.0) <= 1e-9);
  CHECK((double)client.frames >=
        (1.0 - 3.0 * row->loss - 0.02) * (double)w->down.sent - 60.0 * row->delay_s - 3.0);
  wired_end(w);
  held_end(&held.held);
  free(w);
  accuracy_motion_free(&witness);
  accuracy_motion_free(&motion);
}
