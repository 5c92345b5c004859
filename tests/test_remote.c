/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Hands far from the world: a loop that has nothing of its world but messages of a link feels what
 * one beside it feels. The reference is ODE alone at 1 kHz with 1000 iterations. */

#include "tests/tap.h"

#include "bench/remote_run.h"
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

typedef struct remote_case {
  const char *name;
  const char *scene;
} remote_case;

static const remote_case cases[] = {
    {"slide", "slide"}, {"row10", "row10"}, {"stack", "stack"},
    {"door", "door"},   {"hit", "hit"},     {"fig7", "fig7"},
};

static const remote_way ways[] = {
    {.delay_s = 0.0, .seed = 1},
    {.delay_s = 0.01, .seed = 2},
    {.delay_s = 0.05, .seed = 3},
    {.delay_s = 0.1, .seed = 4},
    {.delay_s = 0.2, .seed = 5},
    {.delay_s = 0.05, .jitter_s = 0.02, .loss = 0.05, .duplicate = 0.05, .seed = 6},
};

static void run_or_bail(bench *b, hap_status status)
{
  REQUIRE_SAY(status >= HAP_OK, "%s", b->detail.text);
}

TEST_EACH(cases, const remote_case *row)
{
  bench b = {.quick = true};
  const accuracy_scene *which = remote_scene(row->scene);
  accuracy_motion reference;
  accuracy_motion motion;
  accuracy_errors errors;
  run_or_bail(&b, remote_reference(&b, which, 0.0, &reference));
  run_or_bail(&b, remote_beside(&b, which, &motion));
  REQUIRE(accuracy_compare(&reference, &motion, NULL, REMOTE_PHYSICS_HZ, &errors));
  double beside = errors.force;
  printf("# beside: %.3f %%\n", 100.0 * beside);
  accuracy_motion_free(&motion);
  for (size_t i = 0; i < sizeof ways / sizeof ways[0]; ++i) {
    remote_run run = {.scene = which, .way = ways[i], .look_ahead_s = -1.0, .codecs = &raw_codecs};
    run_or_bail(&b, remote_apart(&b, &run, &motion));
    REQUIRE(accuracy_compare(&reference, &motion, NULL, REMOTE_PHYSICS_HZ, &errors));
    double momentum = motion.stats.hand.momentum_ratio - 1.0;
    printf(
        "# %3.0f ms, jitter %2.0f, loss %.0f %%: %.3f %%, momentum 1 %+.1e, age %.0f ms, "
        "%.1f and %.1f kB/s, old %llu, dropped %llu\n",
        1e3 * run.way.delay_s, 1e3 * run.way.jitter_s, 100.0 * run.way.loss, 100.0 * errors.force,
        momentum, 1e3 * run.age_s, 1e-3 * run.bytes_down, 1e-3 * run.bytes_up,
        (unsigned long long)run.old, (unsigned long long)motion.stats.ahead.dropped);
    CHECK(errors.force <= beside + 0.002);
    CHECK(fabs(momentum) < 1e-9 || isnan(momentum));
    CHECK(run.refused == 0 && run.failed == 0);
    if (run.detail.text[0] != '\0') {
      printf("# %s\n", run.detail.text);
    }
    accuracy_motion_free(&motion);
  }
  accuracy_motion_free(&reference);
}
