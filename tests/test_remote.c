/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Hands far from the world: a loop that has nothing of its world but messages of a link feels what
 * one beside it feels. The reference is ODE alone at 1 kHz with 1000 iterations. */

#include "tests/tap.h"

#include "bench/remote_run.h"
#include "tests/contact_world.h"
#include "tests/raw_codec.h"

/* ---- the codec that knows nothing ---- */

typedef struct raw_pair {
  raw_codec of[2];
} raw_pair;

static raw_pair pair;

static hap_status pair_open(void *user, const hapi_exchange *exchange, hapi_codec out[2])
{
  raw_pair *p = user;
  for (int i = 0; i < 2; ++i) {
    REQUIRE(raw_init(&p->of[i], exchange, i == 0));
    out[i] = raw_codec_of(&p->of[i]);
  }
  return HAP_OK;
}

static void pair_close(void *user)
{
  raw_pair *p = user;
  raw_finish(&p->of[0]);
  raw_finish(&p->of[1]);
}

static const remote_codecs raw_codecs = {pair_open, pair_close, &pair};

/* ---- the force ---- */

static const remote_way ways[] = {
    {.delay_s = 0.0, .seed = 1},
    {.delay_s = 0.01, .seed = 2},
    {.delay_s = 0.05, .seed = 3},
    {.delay_s = 0.1, .seed = 4},
    {.delay_s = 0.2, .seed = 5},
    {.delay_s = 0.05, .jitter_s = 0.02, .loss = 0.05, .duplicate = 0.05, .seed = 6},
};

#define WAYS (sizeof ways / sizeof ways[0])
#define FARTHEST (1u << 4)
#define LOSSY (1u << 5)
#define ALL ((1u << WAYS) - 1)

static void run_or_bail(const bench *b, hap_status status)
{
  REQUIRE_SAY(status >= HAP_OK, "%s", b->detail.text);
}

/* Over the error beside the world. Until a hand has joined, ODE alone has the world: a tower
 * settles a little otherwise in the few steps, and leans earlier or later. */
static double margin_of(const accuracy_scene *which)
{
  return strcmp(which->name, "tower") == 0 ? 0.012 : 0.002;
}

/* As small as beside the world, whatever the way. */
static void way_check(bench *b, const accuracy_motion *reference, double beside, remote_run *run)
{
  accuracy_motion motion;
  accuracy_errors errors;
  run_or_bail(b, remote_apart(b, run, &motion));
  REQUIRE(accuracy_compare(reference, &motion, NULL, REMOTE_PHYSICS_HZ, &errors));
  double momentum = motion.stats.hand.momentum_ratio - 1.0;
  printf(
      "# %s, %3.0f ms, jitter %2.0f, loss %.0f %%: %.3f %%, momentum 1 %+.1e, age %.0f ms, "
      "%.1f and %.1f kB/s, old %llu, dropped %llu\n",
      run->scene->name, 1e3 * run->way.delay_s, 1e3 * run->way.jitter_s, 100.0 * run->way.loss,
      100.0 * errors.force, momentum, 1e3 * run->age_s, 1e-3 * run->bytes_down,
      1e-3 * run->bytes_up, (unsigned long long)run->old,
      (unsigned long long)motion.stats.ahead.dropped);
  CHECK(errors.force <= beside + margin_of(run->scene));
  CHECK(errors.torque <= 0.05);
  CHECK(fabs(momentum) < 1e-9 || isnan(momentum)); /* of a hand that moves nothing */
  CHECK(run->refused == 0 && run->failed == 0 && run->bounded == 0);
  if (run->detail.text[0] != '\0') {
    printf("# %s\n", run->detail.text);
  }
  accuracy_motion_free(&motion);
}

static void ways_check(const accuracy_scene *which, unsigned asked, const remote_codecs *codecs)
{
  bench b = {.quick = true};
  accuracy_motion reference;
  accuracy_motion motion;
  accuracy_errors errors;
  run_or_bail(&b, remote_reference(&b, which, 0.0, &reference));
  run_or_bail(&b, remote_beside(&b, which, &motion));
  bool touched = accuracy_compare(&reference, &motion, NULL, REMOTE_PHYSICS_HZ, &errors);
  printf("# %s, beside: %.3f %%%s\n", which->name, 100.0 * errors.force,
         !touched                      ? ", nothing is touched so late"
         : remote_is_early(&reference) ? ", the hand is touched before it can have joined"
                                       : "");
  touched = touched && !remote_is_early(&reference);
  accuracy_motion_free(&motion);
  for (size_t i = 0; touched && i < WAYS; ++i) {
    if ((asked >> i & 1u) != 0) {
      remote_run run = {.scene = which, .way = ways[i], .look_ahead_s = -1.0, .codecs = codecs};
      way_check(&b, &reference, errors.force, &run);
    }
  }
  accuracy_motion_free(&reference);
}

typedef struct remote_case {
  const char *name;
  unsigned ways;
} remote_case;

static const remote_case cases[] = {{"slide", FARTHEST | LOSSY},
                                    {"stack", FARTHEST | LOSSY},
                                    {"door", LOSSY},
                                    {"hold", FARTHEST}, /* a stack that rocks while it rests */
                                    {"hit", FARTHEST | LOSSY}};

TEST_EACH(cases, const remote_case *row)
{
  ways_check(remote_scene(row->name), row->ways, NULL);
}

TEST(messages_as_they_are_in_memory_do_the_same)
{
  ways_check(remote_scene("stack"), FARTHEST | LOSSY, &raw_codecs);
}

TEST(all_scenes_on_all_ways)
{
  if (strncmp(tap_argument, "long", 4) != 0) {
    SKIP("takes half an hour; argument long, or longNAME for one scene");
  }
  const accuracy_scene *which;
  for (size_t i = 0; (which = accuracy_scene_at(i)) != NULL; ++i) {
    bool asked = tap_argument[4] == '\0' || strcmp(which->name, tap_argument + 4) == 0;
    if (asked && which->recording == NULL) { /* whose hand does not wait */
      ways_check(which, ALL, NULL);
    }
  }
}

/* ---- momentum ---- */

#define SWING_HZ 0.5
#define SWING 0.02 /* m */

static hapi_far far_ends;
static hap_link *far_links[2];
static hapi_wire_codec far_codecs[2];

static void lossy_join(hap_session *session)
{
  hap_link_path_def path;
  hapi_codec codecs[2];
  hap_link_path_def_init(&path, sizeof path);
  path.delay = 0.03;
  path.jitter = 0.05;
  path.loss = path.duplicate = 0.1;
  REQUIRE(hap_link_local_serve(&far_links[0], NULL) == HAP_OK);
  REQUIRE(hap_link_local_connect(far_links[0], "hand", &path, &path, &far_links[1], NULL) ==
          HAP_OK);
  for (int i = 0; i < 2; ++i) {
    REQUIRE(hapi_wire_codec_init(&far_codecs[i], hapi_exchange_capacity(session->exchange), i == 0,
                                 &codecs[i]) == HAP_OK);
  }
  far_ends = (hapi_far){.world = {.end = {.link = far_links[0], .codec = codecs[0]}},
                        .loop = {.end = {.link = far_links[1], .codec = codecs[1]}}};
  REQUIRE(hapi_session_set_far(session, HAPI_SIDE_BOTH, &far_ends) == HAP_OK);
}

/* The hand rubs a cube to and fro between two others. The loop has room for one of the three: of
 * the others the world hears by impulses, of that one by its state. */
TEST(momentum_is_kept_over_a_way_that_loses_doubles_and_reorders)
{
  double seconds = strcmp(tap_argument, "long") == 0 ? 3600.0 : 20.0;
  contact_world *w = cw_new(CW_GRAVITY);
  cw_add_floor(w);
  w->surface.mu = 0.1;
  for (int i = -1; i <= 1; ++i) {
    (void)cw_add_cube(w, 0.5, 0.05, 0.05 * i + 1e-4 * i, 0.0, 0.025);
  }
  w->def.physics_hz = 60.0;
  w->def.max_bodies = 1;
  w->def.max_contacts = 64;
  w->expert.look_ahead = 0.25;
  w->hand_def.friction = 1.0;
  cw_make(w, 0.0, 0.0, 0.0585);
  lossy_join(w->session);
  session_run(w->session);
  for (int64_t i = 0; i < (int64_t)(1e3 * seconds); ++i) {
    cw_move_hand(w, SWING * 2.0 * M_PI * SWING_HZ * cos(2e-3 * M_PI * SWING_HZ * (double)i), 0.0,
                 0.0);
    cw_tick(w);
  }
  hap_stats stats = cw_stats(w);
  printf("# %.0f s: %.4g N s given, %.2g N s not there, old %llu and %llu, age %.0f ms\n", seconds,
         stats.hand.impulse_abs_ns, stats.hand.momentum_error_ns,
         (unsigned long long)far_ends.world.old, (unsigned long long)far_ends.loop.old,
         1e3 * stats.loop.model_age_max_s);
  CHECK(stats.hand.impulse_abs_ns > 0.5 * seconds);
  CHECK(stats.hand.momentum_error_ns <= 1e-9 * stats.hand.impulse_abs_ns);
  CHECK(stats.faults.states_rejected == 0);
  CHECK(far_ends.world.end.refused == 0 && far_ends.loop.end.refused == 0);
  CHECK(far_ends.world.bounded == 0);
  tap_release(w);
  hapi_far_finish(&far_ends);
  hap_link_close(far_links[0]);
  hap_link_close(far_links[1]);
  hapi_wire_codec_finish(&far_codecs[0]);
  hapi_wire_codec_finish(&far_codecs[1]);
}
