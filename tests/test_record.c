/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Recordings of threaded sessions, replayed in lockstep bit for bit; and where they are not. */

#include "tests/tap.h"

#include <unistd.h>

#include "base/clock.h"
#include "record/file.h"
#include "tools/rig.h"

#define MS 1000000LL

static char path[300];

/* ---- a run and its replay ---- */

static void sleep_ms(int ms)
{
  hapi_clock_sleep_until(hapi_clock_now() + ms * MS);
}

typedef struct setup {
  const char *scene;
  hap_model model;
  const char *devices[2];
  int ms;
  void (*meanwhile)(rig *r);
} setup;

static bool create(const setup *s, rig *r)
{
  hap_detail detail = {""};
  rig_options options;
  hap_record_def record;
  rig_options_init(&options);
  hap_record_def_init(&record, sizeof record);
  record.path = path;
  options.scene = s->scene;
  options.def.model = s->model;
  options.record = &record;
  for (int i = 0; i < 2 && s->devices[i] != NULL; ++i) {
    options.devices[options.device_count++] = s->devices[i];
  }
  hap_status status = rig_create(&options, r, &detail);
  if (status < HAP_OK) {
    printf("# %s\n", detail.text);
  }
  return status >= HAP_OK;
}

/* What the threads came to. */
static hap_stats record(const setup *s)
{
  rig r;
  hap_stats stats = {0};
  hap_record_state state;
  hap_detail detail = {""};
  if (!create(s, &r) || hap_session_start(r.session) < HAP_OK) {
    CHECK(!"a session that starts");
    return stats;
  }
  for (int waited = 0; waited < s->ms; waited += 50) {
    sleep_ms(50);
    if (s->meanwhile != NULL) {
      s->meanwhile(&r);
    }
  }
  CHECK(hap_session_stop(r.session) >= HAP_OK);
  CHECK(hap_session_stats(r.session, &stats, sizeof stats) == HAP_OK);
  CHECK(hap_session_record_state(r.session, &state, sizeof state, &detail) == HAP_OK);
  CHECK(state.end == HAP_RECORD_STOPPED && state.ticks == stats.ticks && state.lost_ticks == 0);
  printf("# %s %s: %llu ticks, %llu missed, %llu bytes, %.0f a tick\n", s->scene,
         hap_model_name(s->model), (unsigned long long)stats.ticks,
         (unsigned long long)stats.missed_ticks, (unsigned long long)state.bytes,
         (double)state.bytes / (double)(state.ticks > 0 ? state.ticks : 1));
  rig_destroy(&r);
  return stats;
}

typedef struct replay {
  hap_status status; /* of the last advance */
  hap_stats stats;
  hap_play_difference difference;
  hap_detail detail;
} replay;

static replay play(const char *scene_name)
{
  replay out = {.status = HAP_OK};
  rig r = {0};
  rig_options options;
  rig_options_init(&options);
  options.scene = scene_name;
  out.status = hap_player_open(path, 0, &options.player, &out.detail);
  if (out.status < HAP_OK) {
    return out;
  }
  out.status = rig_create(&options, &r, &out.detail);
  if (out.status >= HAP_OK) {
    out.status = hap_session_start(r.session);
    for (bool more = out.status >= HAP_OK; more;) {
      out.status = hap_session_advance(r.session, 100);
      more = out.status >= HAP_OK && out.status != HAP_END;
    }
    CHECK(hap_session_stats(r.session, &out.stats, sizeof out.stats) == HAP_OK);
    if (out.status < HAP_OK) {
      (void)hap_session_detail(r.session, &out.detail);
    }
    hap_session_stop(r.session);
  }
  CHECK(hap_player_difference(options.player, &out.difference, sizeof out.difference) == HAP_OK);
  rig_destroy(&r);
  hap_player_close(options.player);
  return out;
}

static void check_alike(const setup *s)
{
  hap_stats before = record(s);
  replay again = play(s->scene);
  CHECK(again.status == HAP_END);
  CHECK(again.difference.what == HAP_DIFFERENCE_NONE);
  if (again.status < HAP_OK || again.difference.what != HAP_DIFFERENCE_NONE) {
    printf("# %s%s\n", again.detail.text, again.difference.text);
  }
  CHECK(again.stats.ticks == before.ticks);
  CHECK(again.stats.models_adopted == before.models_adopted);
  CHECK(again.stats.contact_passes == before.contact_passes);
  CHECK(again.stats.contact_ticks == before.contact_ticks);
  CHECK(memcmp(&again.stats.impulse_ns, &before.impulse_ns, sizeof(double)) == 0);
  CHECK(memcmp(&again.stats.peak_force_n, &before.peak_force_n, sizeof(double)) == 0);
}

TEST(scenes_in_model_contact)
{
  static const char *const scenes[] = {"row10", "stack", "fig5", "clump8"};
  for (size_t i = 0; i < sizeof scenes / sizeof scenes[0]; ++i) {
    check_alike(&(setup){.scene = scenes[i], .model = HAP_MODEL_CONTACT, .ms = 700});
  }
}

TEST(scenes_in_the_paper_s_models)
{
  static const char *const scenes[] = {"row10", "stack", "fig5"};
  for (size_t i = 0; i < sizeof scenes / sizeof scenes[0]; ++i) {
    for (int model = HAP_MODEL_SINGLE; model <= HAP_MODEL_ACCELERANCE; ++model) {
      check_alike(&(setup){.scene = scenes[i], .model = (hap_model)model, .ms = 400});
    }
  }
}

int main(void)
{
  snprintf(path, sizeof path, "%s/hapode-record-%d", getenv("TMPDIR") ? getenv("TMPDIR") : "/tmp",
           (int)getpid());
  dInitODE2(0);
  if (getenv("X") == NULL) RUN(scenes_in_model_contact);
  RUN(scenes_in_the_paper_s_models);
  dCloseODE();
  unlink(path);
  return tap_done();
}
