/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_RECORDED_H
#define HAPODE_TESTS_RECORDED_H

/* Records a threaded session of a scene and plays it. Include after tap.h. */

#include <stdatomic.h>
#include <unistd.h>

#include "base/clock.h"
#include "tests/files.h"
#include "tools/rig.h"

#define MS 1000000LL

static char recorded_path[160];

static inline bool recorded_init(void)
{
  bool good = folder_make();
  snprintf(recorded_path, sizeof recorded_path, "%s", folder_path("session.rec"));
  return good;
}

static inline void sleep_ms(int ms)
{
  hapi_clock_sleep_until(hapi_clock_now() + ms * MS);
}

typedef struct recorded_setup {
  const char *scene;
  hap_model model;
  const char *devices[3];
  int ms;
  uint64_t ticks;                      /* at least, however many are missed */
  void (*meanwhile)(rig *r, int look); /* about every 50 ms */
  hap_record_def record;               /* its path is the file's */
  hap_probe probe;
  int32_t max_sweeps;
  int32_t range_hops;
  double accuracy;
  double reuse;
  hap_effect_wish cross;
  hap_coupling coupling; /* with a spring; else as the rig has it */
  double coupling_stiffness;
  double virtual_mass;
  double time_scale; /* from the start on; 0: 1 */
} recorded_setup;

static inline recorded_setup recorded_setup_of(const char *scene_name, hap_model model, int ms)
{
  recorded_setup s = {.scene = scene_name,
                      .model = model,
                      .ms = ms,
                      .probe = HAP_PROBE_BY_ACCURACY,
                      .max_sweeps = HAP_BY_ACCURACY,
                      .range_hops = HAP_BY_ACCURACY,
                      .accuracy = HAP_ACCURACY_DEFAULT,
                      .reuse = HAP_BY_ACCURACY};
  hap_record_def_init(&s.record, sizeof s.record);
  s.record.path = recorded_path;
  return s;
}

static inline bool recorded_create(const recorded_setup *s, rig *r)
{
  hap_detail detail = {""};
  rig_options options;
  rig_options_init(&options);
  options.scene = s->scene;
  options.def.model = s->model;
  options.research.probe = s->probe;
  options.expert.max_sweeps = s->max_sweeps;
  options.expert.range_hops = s->range_hops;
  options.def.accuracy = s->accuracy;
  options.expert.reuse = s->reuse;
  expert_wish(&options.expert, HAP_EFFECT_CROSS, s->cross);
  options.record = &s->record;
  if (s->coupling_stiffness > 0.0) {
    options.coupling = s->coupling;
    options.coupling_stiffness = s->coupling_stiffness;
    options.virtual_mass = s->virtual_mass;
  }
  for (int i = 0; i < 3 && s->devices[i] != NULL; ++i) {
    options.devices[options.device_count++] = s->devices[i];
  }
  hap_status status = rig_create(&options, r, &detail);
  if (status < HAP_OK) {
    printf("# %s\n", detail.text);
  }
  return status >= HAP_OK;
}

/* Runs a started or created session for its time and stops it. */
static inline hap_stats recorded_run(const recorded_setup *s, rig *r)
{
  hap_stats stats;
  memset(&stats, 0, sizeof stats);
  if (s->time_scale > 0.0) {
    CHECK(hap_session_set_time_scale(r->session, s->time_scale) == HAP_OK);
  }
  CHECK(hap_session_start(r->session) >= HAP_OK);
  for (int look = 0; look * 50 < s->ms || (stats.loop.ticks < s->ticks && look < 400); ++look) {
    sleep_ms(50);
    CHECK(hap_session_stats(r->session, &stats, sizeof stats) == HAP_OK);
    if (s->meanwhile != NULL) {
      s->meanwhile(r, look);
    }
  }
  CHECK(hap_session_stop(r->session) >= HAP_OK);
  CHECK(hap_session_stats(r->session, &stats, sizeof stats) == HAP_OK);
  return stats;
}

static inline hap_stats recorded_make(const recorded_setup *s)
{
  rig r;
  hap_stats stats;
  hap_record_state state;
  memset(&stats, 0, sizeof stats);
  if (!recorded_create(s, &r)) {
    CHECK(!"a session that can be recorded");
    return stats;
  }
  stats = recorded_run(s, &r);
  CHECK(hap_session_record_state(r.session, &state, sizeof state, NULL) == HAP_OK);
  CHECK(state.end == HAP_RECORD_STOPPED && state.ticks == stats.loop.ticks &&
        state.lost_ticks == 0);
  printf("# %s %s: %llu ticks, %llu missed, %.0f bytes a tick\n", s->scene,
         hap_model_name(s->model), (unsigned long long)stats.loop.ticks,
         (unsigned long long)stats.loop.missed_ticks,
         (double)state.bytes / (double)(state.ticks > 0 ? state.ticks : 1));
  rig_destroy(&r);
  return stats;
}

typedef struct replay {
  hap_status status; /* of the last advance, or of what failed before */
  hap_stats stats;
  hap_player_info info;
  uint64_t diverged_after; /* ticks, where advance said so; UINT64_MAX: nowhere */
  hap_play_difference difference;
  hap_detail detail;
} replay;

static inline void replay_run(rig *r, replay *out)
{
  uint64_t before = 0;
  out->status = hap_session_start(r->session);
  for (bool more = out->status >= HAP_OK; more;) {
    out->status = hap_session_advance(r->session, 100);
    CHECK(hap_session_stats(r->session, &out->stats, sizeof out->stats) == HAP_OK);
    if (out->status == HAP_DIVERGED && out->diverged_after == UINT64_MAX) {
      out->diverged_after = out->stats.loop.ticks;
    }
    more = out->status >= HAP_OK && out->status != HAP_END && out->stats.loop.ticks > before;
    before = out->stats.loop.ticks;
  }
  CHECK(hap_session_stats(r->session, &out->stats, sizeof out->stats) == HAP_OK);
  if (out->status < HAP_OK) {
    (void)hap_session_detail(r->session, &out->detail);
  }
  CHECK(hap_session_stop(r->session) == HAP_OK);
}

static inline replay recorded_play(const char *scene_name, uint32_t flags)
{
  replay out;
  rig r;
  rig_options options;
  memset(&out, 0, sizeof out);
  memset(&r, 0, sizeof r);
  out.diverged_after = UINT64_MAX;
  rig_options_init(&options);
  options.scene = scene_name;
  out.status = hap_player_open(recorded_path, flags, &options.player, &out.detail);
  if (out.status < HAP_OK) {
    return out;
  }
  CHECK(hap_player_get_info(options.player, &out.info, sizeof out.info) == HAP_OK);
  out.status = rig_create(&options, &r, &out.detail);
  if (out.status >= HAP_OK) {
    replay_run(&r, &out);
  }
  CHECK(hap_player_difference(options.player, &out.difference, sizeof out.difference) == HAP_OK);
  rig_destroy(&r);
  hap_player_close(options.player);
  return out;
}

static inline void check_alike(const replay *again, const hap_stats *before)
{
  CHECK(again->status == HAP_END);
  CHECK(again->difference.what == HAP_DIFFERENCE_NONE);
  if (again->status < HAP_OK || again->difference.what != HAP_DIFFERENCE_NONE) {
    printf("# %s%s\n", again->detail.text, again->difference.text);
  }
  CHECK(again->stats.loop.ticks == before->loop.ticks);
  CHECK(again->stats.loop.models_adopted == before->loop.models_adopted);
  CHECK(again->stats.contact.passes == before->contact.passes);
  CHECK(again->stats.loop.contact_ticks == before->loop.contact_ticks);
  CHECK(again->stats.faults.count == before->faults.count);
  CHECK(memcmp(&again->stats.hand.impulse_ns, &before->hand.impulse_ns, sizeof(double)) == 0);
  CHECK(memcmp(&again->stats.hand.peak_force_n, &before->hand.peak_force_n, sizeof(double)) == 0);
}

#endif
