/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* far_end ROLE SCENE SECONDS LOOK_AHEAD [WORLD ADDRESS PEER]: a scene and its hand in sessions of
 * drive LOCKSTEP whose virtual clock follows that of the machine, so that no tick is missed. Public
 * API alone. The hand begins to move two seconds after its session. ROLE: reference (model single),
 * beside (model contact), serve or connect, which need the rest: the world's name, the address of
 * this end and that of the other one. Where there is a hand, each tick's force is a line; the last
 * line says how the link went. */

#include <hapode/hapode.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define LATE_S 2.0

typedef struct end {
  hap_scene *scene; /* whose hands are used */
  hap_scene *over;  /* of the session */
  hap_session *session;
  hap_link *link;
  hap_pointer_def def;
  hap_pointer_id pointer;
  bool hand;
  bool paced;
} end;

static void fail_now(const char *what, const hap_detail *why)
{
  fprintf(stderr, "%s: %s\n", what, why->text);
  exit(1);
}

static void session_need(const end *e, hap_status status, const char *what)
{
  hap_detail why = {""};
  if (status < HAP_OK) {
    (void)hap_session_detail(e->session, &why);
    fail_now(what, &why);
  }
}

static void session_make(end *e, const char *role, double look_ahead)
{
  hap_detail why = {""};
  hap_session_def def;
  hap_expert_def expert;
  hap_session_def_init(&def, sizeof def);
  hap_expert_def_init(&expert, sizeof expert);
  bool reference = strcmp(role, "reference") == 0;
  def.drive = HAP_DRIVE_LOCKSTEP;
  def.model = reference ? HAP_MODEL_SINGLE : HAP_MODEL_CONTACT;
  def.expert = &expert;
  def.max_bodies = 64;
  def.max_contacts = 1024;
  expert.iterations = reference ? 1000 : expert.iterations;
  expert.look_ahead = strcmp(role, "serve") == 0 ? look_ahead : 0.0;
  if (hap_scene_session(e->over, &def, &e->session, &why) < HAP_OK) {
    fail_now("session", &why);
  }
}

static void hand_add(end *e)
{
  hap_detail why = {""};
  const char *spec;
  char whole[1000];
  hap_pointer_def_init(&e->def, sizeof e->def);
  if (hap_scene_hand(e->scene, 0, &e->def, &spec) < HAP_OK) {
    fail_now("hand", &why);
  }
  (void)snprintf(whole, sizeof whole, "%s,start=%g", spec, -LATE_S);
  if (hap_device_open(whole, &e->def.device, &why) < HAP_OK) {
    fail_now("device", &why);
  }
  session_need(e, hap_pointer_add(e->session, &e->def, &e->pointer), "pointer");
}

static void link_make(end *e, bool serves, char *const *where)
{
  hap_detail why = {""};
  hap_link_dds_def def;
  hap_link_dds_def_init(&def, sizeof def);
  def.world = where[0];
  def.interface_name = where[1];
  def.peers = where[2];
  def.insecure = 1;
  def.module = getenv("HAPODE_LINK_DDS");
  hap_status status = serves ? hap_link_dds_serve(&def, &e->link, &why)
                             : hap_link_dds_connect(&def, &e->link, &why);
  if (status < HAP_OK) {
    fail_now("link", &why);
  }
  session_need(
      e, serves ? hap_session_serve(e->session, e->link) : hap_session_connect(e->session, e->link),
      "serve or connect");
}

static int64_t clock_now(void)
{
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

static void clock_wait(int64_t until_ns)
{
  const struct timespec until = {(time_t)(until_ns / 1000000000), (long)(until_ns % 1000000000)};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL) != 0) {
  }
}

static void end_run(end *e, double seconds)
{
  hap_remote_state state = {0};
  const int64_t start_ns = clock_now();
  for (int64_t tick = 1; tick <= llround(1e3 * seconds); ++tick) {
    if (e->paced) {
      clock_wait(start_ns + tick * 1000000);
    }
    session_need(e, hap_session_advance(e->session, 1), "advance");
    hap_pointer_state felt;
    if (e->hand && hap_pointer_get(e->session, e->pointer, &felt, sizeof felt) >= HAP_OK) {
      const double *f = felt.wrench.force;
      printf("%lld %.9g %.9g %.9g\n", (long long)tick, f[0], f[1], f[2]);
    }
    if (e->link != NULL && !e->hand) {
      (void)hap_session_remote_state(e->session, &state, sizeof state, NULL);
      if (state.joins > 0 && state.joined == 0) {
        break; /* the hand has been here */
      }
    }
  }
  hap_detail why = {""};
  if (e->link != NULL) {
    (void)hap_session_remote_state(e->session, &state, sizeof state, &why);
  }
  hap_stats stats;
  (void)hap_session_stats(e->session, &stats, sizeof stats);
  printf(
      "joins %llu refused %llu failed %llu bounded %llu trip_ms %.3f age_ms %.1f stale %llu %s\n",
      (unsigned long long)state.joins, (unsigned long long)state.refused,
      (unsigned long long)state.failed, (unsigned long long)state.bounded, 1e3 * state.round_trip_s,
      1e3 * stats.loop.model_age_max_s, (unsigned long long)stats.faults.stale_times, why.text);
}

int main(int count, char **arguments)
{
  hap_detail why = {""};
  end e = {0};
  if (count < 5) {
    return 2;
  }
  const char *role = arguments[1];
  bool serves = strcmp(role, "serve") == 0;
  bool connects = strcmp(role, "connect") == 0;
  e.hand = !serves;
  e.paced = serves || connects;
  if ((e.paced && count != 8) || hap_scene_load(arguments[2], &e.scene, &why) < HAP_OK ||
      (connects && hap_scene_create(NULL, &e.over, &why) < HAP_OK)) {
    fail_now("scene", &why);
  }
  e.over = connects ? e.over : e.scene;
  session_make(&e, role, strtod(arguments[4], NULL));
  if (e.paced) {
    link_make(&e, serves, arguments + 5);
  }
  if (e.hand) {
    hand_add(&e);
  }
  session_need(&e, hap_session_start(e.session), "start");
  end_run(&e, strtod(arguments[3], NULL));
  hap_session_destroy(e.session);
  hap_link_close(e.link);
  hap_device_close(e.def.device);
  return hap_scene_destroy(e.scene) < HAP_OK || (connects && hap_scene_destroy(e.over) < HAP_OK);
}
