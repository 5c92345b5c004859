/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Drive FRAME in a frame loop: even and uneven frames, hitches, pauses, wrong calls. What hangs
 * on the host's clock is asked of the clock; nothing is expected of it. */

#include "tests/tap.h"

#include <pthread.h>

#include "session/frame_clock.h"
#include "tests/felt.h"

#define SPEED 0.5 /* m/s, of the cube that is drawn */
#define TRACE_ROWS 30000
#define REST_N 5.0 /* of the resting hand */

/* ---- which steps, and when: without a clock ---- */

typedef struct loop {
  double remainder_s;
  int64_t now_ns;
  int64_t last_ns; /* of the last step */
  uint64_t steps;
  uint64_t dropped;
  double uneven_ns; /* largest distance of two steps from H */
  double late_ns;   /* largest time from a step to the frame that made it */
} loop;

static void loop_frame(loop *l, double clock_s, double frame_s, double period)
{
  l->now_ns += (int64_t)llround(1e9 * clock_s);
  hapi_frame_steps f = hapi_frame_take(&l->remainder_s, frame_s, period, 3, l->now_ns, l->last_ns);
  CHECK(f.count >= 0 && f.count <= 3 && (f.dropped == 0 || f.count == 3));
  for (int i = 0; i < f.count; ++i) {
    int64_t at = f.first_ns + i * f.apart_ns;
    CHECK(at > l->last_ns);
    l->uneven_ns = fmax(l->uneven_ns, fabs((double)(at - l->last_ns) - 1e9 * period));
    l->late_ns = fmax(l->late_ns, (double)(l->now_ns - at));
    l->last_ns = at;
  }
  l->steps += (uint64_t)f.count;
  l->dropped += f.dropped;
}

/* From -share to +share. */
static double frame_jitter(uint32_t *random, double share)
{
  *random = *random * 1664525u + 1013904223u;
  return share * ((double)(*random >> 8) / (1 << 23) - 1.0);
}

TEST(steps_lie_evenly_on_the_clock_at_any_frame_rate)
{
  static const double rates[] = {24.0, 45.0, 60.0, 72.0, 90.0, 120.0, 144.0, 500.0};
  for (int r = 0; r < 8; ++r) {
    for (int uneven = 0; uneven < 2; ++uneven) {
      loop l = {0};
      uint32_t random = 1;
      double share = uneven == 0 ? 0.0 : rates[r] < 40.0 ? 0.1 : 0.4; /* less than four steps */
      double total = 0.0;
      for (int i = 0; i < 5000; ++i) {
        double dt = (1.0 + frame_jitter(&random, share)) / rates[r];
        loop_frame(&l, dt, dt, 1.0 / 60.0);
        total += dt;
      }
      CHECK(l.dropped == 0);
      CHECK(fabs((double)l.steps - 60.0 * total) <= 1.0);
      CHECK(l.uneven_ns < 5000.0); /* of 16.7 ms: frame times are rounded to ns here */
      CHECK(l.late_ns < 1e9 * (1.4 / rates[r] + 1.0 / 60.0));
    }
  }
}

TEST(a_hitch_drops_what_is_beyond_three_steps_and_goes_on)
{
  loop l = {0};
  for (int i = 0; i < 90; ++i) {
    loop_frame(&l, 1.0 / 90.0, 1.0 / 90.0, 0.02);
  }
  CHECK(l.steps == 50 && l.dropped == 0);
  double before = l.remainder_s;
  loop_frame(&l, 0.3, 0.3, 0.02);
  CHECK(l.steps == 53 && l.dropped == 12);
  CHECK_NEAR(l.remainder_s, before, 1e-9);
  CHECK(l.now_ns - l.last_ns < 20 * MS);
  for (int i = 0; i < 90; ++i) {
    loop_frame(&l, 1.0 / 90.0, 1.0 / 90.0, 0.02);
  }
  CHECK(l.steps == 103 && l.dropped == 12);
}

TEST(frame_time_may_go_slower_or_faster_than_the_clock_or_stand)
{
  static const double paces[] = {0.1, 0.5, 0.9, 1.1, 2.0, 10.0};
  for (int p = 0; p < 6; ++p) {
    loop l = {0};
    for (int i = 0; i < 2000; ++i) {
      loop_frame(&l, 0.01, 0.01 * paces[p], 0.02);
      CHECK(l.last_ns <= l.now_ns); /* never ahead of the clock */
    }
    CHECK(fabs((double)(l.steps + l.dropped) - 1000.0 * paces[p]) <= 1.0);
    CHECK(l.late_ns < 41e6);
  }
  loop l = {0};
  loop_frame(&l, 0.02, 0.02, 0.02);
  for (int i = 0; i < 1000; ++i) { /* paused: neither steps nor a debt */
    loop_frame(&l, 0.01, 0.0, 0.02);
  }
  CHECK(l.steps == 1 && l.dropped == 0);
  loop_frame(&l, 0.01, 0.02, 0.02);
  CHECK(l.steps == 2 && l.now_ns - l.last_ns < MS);
  for (int i = 0; i < 1000; ++i) { /* no time at all between frames: steps are in order still */
    loop_frame(&l, 0.0, 0.06, 0.02);
  }
  CHECK(l.steps == 3002 && l.last_ns - l.now_ns <= 3000);
}

/* ---- with a session ---- */

typedef struct view {
  felt_stage f;
  dBodyID cube;   /* goes by at SPEED */
  int64_t origin; /* ns, of the frame time */
  int64_t last;   /* ns, of the last frame */
  double given;   /* s, frame time in all */
  double x;       /* m, drawn */
  int64_t slack;  /* ns, most that a call of update took, with what the host did meanwhile */
  int64_t slack_now;
  int64_t gap;          /* ns, longest from frame to frame */
  double back;          /* m, most that it went back from frame to frame */
  double jump;          /* m, most that it went on beyond its speed */
  double off;           /* m, most that it was from where it should be */
  uint64_t late_faults; /* the host's, which were reset */
} view;

/* N, that was written last. The book of felt.h is the loop's while it runs. */
static double force_now(view *v)
{
  (void)felt_guard(&v->f);
  return hapi_v3_norm(v->f.state.wrench.force);
}

/* A host that keeps the loop from running is no fault of the drive. */
static void view_forgive(view *v)
{
  uint32_t fault = stats_of(&v->f.s).faults.fault;
  if (fault == HAP_FAULT_LATE || fault == HAP_FAULT_BLOCKED) {
    ++v->late_faults;
    CHECK(hap_session_reset_fault(v->f.s.session) == HAP_OK);
  }
}

static const char pressing[] =
    "hand=relaxed,device_mass=0.1,device_damping=2,path=0:-0.08/0/0;0.5:-0.02/0/0";

static const char resting[] = "hand=rigid,path=0:-0.08/0/0;0.5:-0.055/0/0";

static bool view_begin(view *v, const char *hand)
{
  memset(v, 0, sizeof *v);
  felt_init(&v->f, HAP_DRIVE_FRAME, false);
  v->f.s.expert.trace_rows = TRACE_ROWS;
  v->cube = add_cube(&v->f.s, 0.0, NULL);
  dBodySetPosition(v->cube, 0.0, 5.0, 0.0);
  dBodySetLinearVel(v->cube, SPEED, 0.0, 0.0);
  bool good = felt_begin(&v->f, hand);
  v->origin = v->last = good ? hap_session_now(v->f.s.session) : 0;
  return good;
}

/* Draws after the update, as a frame loop does. scale: of the frame time. */
static hap_status view_frame(view *v, int64_t until_ns, double scale)
{
  hap_pose pose = {{0.0}, {0.0}};
  hapi_clock_sleep_until(until_ns);
  int64_t now = hap_session_now(v->f.s.session);
  double frame_s = scale * 1e-9 * (double)(now - v->last);
  hap_status status = hap_session_update(v->f.s.session, frame_s);
  int64_t drawn = hap_session_now(v->f.s.session);
  CHECK(status >= HAP_OK);
  CHECK(hap_session_poses(v->f.s.session, drawn, &v->cube, 1, &pose) >= HAP_OK);
  double way = pose.position[0] - v->x;
  int64_t before = v->slack_now;
  v->slack_now = drawn - now;
  v->slack = v->slack_now > v->slack ? v->slack_now : v->slack;
  v->gap = drawn - v->last > v->gap ? drawn - v->last : v->gap;
  double most = SPEED * 1e-9 * (double)(drawn - v->last + v->slack_now + before);
  v->back = fmax(v->back, -way);
  v->jump = fmax(v->jump, way - most);
  double delay = stats_of(&v->f.s).physics.pose_delay_s;
  double wanted = SPEED * (1e-9 * (double)(drawn - v->origin) - delay);
  v->off = fmax(v->off, fabs(pose.position[0] - wanted));
  v->given += frame_s;
  v->last = now;
  v->x = pose.position[0];
  return status;
}

static void view_forget(view *v)
{
  v->back = v->jump = v->off = 0.0;
  v->slack = v->gap = 0;
}

static uint64_t view_frames(view *v, double hz, int count, double uneven)
{
  static uint32_t random = 7;
  uint64_t dropped = 0;
  for (int i = 0; i < count; ++i) {
    double dt = (1.0 + frame_jitter(&random, uneven)) / hz;
    dropped += view_frame(v, v->last + (int64_t)(1e9 * dt), 1.0) == HAP_DROPPED;
  }
  return dropped;
}

/* The world's own time is that of its steps, and all frame time is in steps, dropped ones and the
 * remainder. */
static void check_world(view *v)
{
  view_forgive(v);
  hap_stats stats = stats_of(&v->f.s);
  double h = 1.0 / v->f.s.def.physics_hz;
  double world = h * (double)stats.physics.steps;
  CHECK_NEAR(dBodyGetPosition(v->cube)[0], SPEED * world, 1e-9);
  double rest = v->given - world - h * (double)stats.physics.frames_dropped;
  CHECK(rest > -1e-6 && rest < h + 1e-6);
  CHECK(stats.faults.count == v->late_faults && stats.physics.missed == 0);
}

/* Jitter of 40 % of a frame; the delay needs a second to find how late frames come. Where the
 * host kept a frame from coming, drawing is a matter of the clock: the bounds grow by what was
 * seen. */
static void check_rate(double hz)
{
  view v;
  REQUIRE(view_begin(&v, pressing));
  uint64_t dropped = view_frames(&v, hz, (int)hz, 0.4);
  CHECK(v.back == 0.0);
  view_forget(&v);
  dropped += view_frames(&v, hz, (int)hz, 0.4);
  hap_stats stats = stats_of(&v.f.s);
  printf(
      "# %g Hz: back %.2g, jump %.2g, off %.2g m; update took up to %.2f ms; delay %.1f ms; "
      "stale %llu times, force %.2f N\n",
      hz, v.back, v.jump, v.off, 1e-6 * (double)v.slack, 1e3 * stats.physics.pose_delay_s,
      (unsigned long long)stats.faults.stale_times, force_now(&v));
  CHECK(v.back == 0.0);
  CHECK(stats.physics.pose_delay_s >= 0.02 && stats.physics.pose_delay_s <= 0.12);
  if (dropped == 0 && v.slack < 2 * MS && 1e-9 * (double)v.gap < 1.5 / hz) {
    CHECK(v.jump <= 0.3 * SPEED / hz);
    CHECK(v.off <= SPEED * 0.004);
  }
  check_world(&v);
  /* A hand that falls in while late ticks take of the force has more after it. */
  CHECK(force_now(&v) <= (stats.safety.derated_ticks > 0 ? FELT_LIMIT : 6.0) &&
        (force_now(&v) > 0.0 || stats.faults.stale_times > 0 || v.late_faults > 0));
  CHECK(hap_session_stop(v.f.s.session) == HAP_OK);
  felt_end(&v.f);
}

TEST(frames_that_come_unevenly_are_drawn_evenly)
{
  check_rate(72.0);
  check_rate(90.0);
  check_rate(120.0);
}

static bool is_normal(view *v)
{
  return felt_guard(&v->f) == 0 && force_now(v) > 0.98 * REST_N;
}

static void frames_until_normal(view *v)
{
  for (int i = 0; i < 1000 && !is_normal(v); ++i) {
    view_forgive(v);
    (void)view_frames(v, 90.0, 1, 0.0);
  }
  CHECK(is_normal(v));
}

/* Frames of 33 ms, two steps of 20 ms are good for 41: the remainder that the world is behind by
 * makes no difference. Not on a host that makes frames longer. */
TEST(slow_frames_are_felt_in_full)
{
  view v;
  int64_t longest = 0;
  REQUIRE(view_begin(&v, resting));
  (void)view_frames(&v, 90.0, 70, 0.0);
  frames_until_normal(&v);
  hap_stats before = stats_of(&v.f.s);
  for (int i = 0; i < 40; ++i) {
    int64_t last = v.last;
    (void)view_frame(&v, v.last + 33 * MS, 1.0);
    int64_t gap = hap_session_now(v.f.s.session) - last;
    longest = gap > longest ? gap : longest;
  }
  hap_stats after = stats_of(&v.f.s);
  uint64_t stale = after.faults.stale_times - before.faults.stale_times;
  uint64_t missed = after.loop.missed_ticks - before.loop.missed_ticks;
  printf("# frames of up to %.1f ms, %llu ticks missed, stale %llu times\n", 1e-6 * (double)longest,
         (unsigned long long)missed, (unsigned long long)stale);
  CHECK(stale == 0 || longest > 38 * MS || missed > 0);
  CHECK(v.back == 0.0);
  check_world(&v);
  CHECK(hap_session_stop(v.f.s.session) == HAP_OK);
  felt_end(&v.f);
}

/* No frame for 300 ms, and until the hand feels nothing any more. */
static void view_hang(view *v)
{
  int64_t until = hap_session_now(v->f.s.session) + 300 * MS;
  for (int i = 0; i < 20000; ++i) {
    sleep_ms(1);
    view_forgive(v);
    if (hap_session_now(v->f.s.session) >= until && force_now(v) == 0.0) {
      break;
    }
  }
  CHECK((felt_guard(&v->f) & HAP_GUARD_STALE) != 0 && force_now(v) == 0.0);
}

static double force_of(const hap_trace_row *row)
{
  return hapi_v3_norm(row->pointers[0].force);
}

/* Ticks from the first one with a new model, after some without force, to the whole force; 0
 * where the model became old again meanwhile, as the host kept the next frame from coming. *at:
 * from there on, and where it ended; -1: there is no more. */
static int ticks_to_normal(const hap_trace_row *rows, int count, int *at)
{
  int i = *at;
  while (i < count && !(rows[i].model_age_s > 0.1 && force_of(&rows[i]) == 0.0)) {
    ++i;
  }
  while (i < count && rows[i].model_age_s > 0.1) {
    ++i;
  }
  int begin = i;
  bool aged = false;
  while (i < count && force_of(&rows[i]) < 0.98 * REST_N) {
    aged = aged || rows[i].model_age_s > 0.04;
    ++i;
  }
  *at = i < count ? i : -1;
  return aged ? 0 : i - begin;
}

#define HITCHES 5

/* late: hitches after which late ticks took of the force, which lasts longer than two steps.
 * test_guard and test_faults have the return by a clock of their own. */
static void check_return(view *v, const bool late[HITCHES])
{
  static hap_trace_row rows[TRACE_ROWS];
  size_t count = 0;
  int at = 0;
  int hitches = 0;
  int longest = 0;
  CHECK(hap_session_trace_read(v->f.s.session, rows, TRACE_ROWS, sizeof(hap_trace_row), &count) ==
        HAP_OK);
  while (at >= 0) {
    int ticks = ticks_to_normal(rows, (int)count, &at);
    if (at >= 0) {
      longest = hitches < HITCHES && !late[hitches] && ticks > longest ? ticks : longest;
      ++hitches;
    }
  }
  printf("# %d hitches, normal after %d ticks, a step has 20\n", hitches, longest);
  CHECK(hitches >= HITCHES);
  CHECK(longest <= 40 || hitches > HITCHES); /* more are the host's: which ones, nobody knows */
}

TEST(a_hitch_fades_the_force_drops_time_and_is_over_within_two_syncs)
{
  view v;
  bool late[HITCHES];
  REQUIRE(view_begin(&v, resting));
  (void)view_frames(&v, 90.0, 60, 0.0);
  frames_until_normal(&v);
  for (int i = 0; i < HITCHES; ++i) {
    uint64_t dropped = stats_of(&v.f.s).physics.frames_dropped;
    uint64_t steps = stats_of(&v.f.s).physics.steps;
    view_hang(&v);
    uint64_t faults = v.late_faults;
    uint64_t derated = stats_of(&v.f.s).safety.derated_ticks;
    CHECK(view_frame(&v, 0, 1.0) == HAP_DROPPED);
    CHECK(stats_of(&v.f.s).physics.steps == steps + 3);
    CHECK(stats_of(&v.f.s).physics.frames_dropped >= dropped + 11); /* of 15 or more */
    frames_until_normal(&v);
    late[i] = stats_of(&v.f.s).safety.derated_ticks > derated || v.late_faults > faults;
  }
  CHECK(stats_of(&v.f.s).faults.stale_times >= HITCHES);
  CHECK(v.back == 0.0 && v.jump <= SPEED * 0.04);
  check_world(&v);
  check_return(&v, late);
  CHECK(hap_session_stop(v.f.s.session) == HAP_OK);
  printf("# %.2g N a tick at most; drawn back %.2g, jump %.2g m\n", felt.steepest, v.back, v.jump);
  felt_end(&v.f); /* every write was within the slew limit */
}

/* The hand of a paused program still moves, and is drawn so. */
static void view_pause(view *v, bool calls)
{
  hap_pose first = {{0.0}, {0.0}};
  hap_pose pose = first;
  hap_pose hand;
  int64_t until = hap_session_now(v->f.s.session) + 300 * MS;
  int drawn = 0;
  while (hap_session_now(v->f.s.session) < until) {
    sleep_ms(5);
    CHECK(!calls || hap_session_update(v->f.s.session, 0.0) == HAP_OK);
    int64_t now = hap_session_now(v->f.s.session);
    hap_status status = hap_session_poses(v->f.s.session, now, &v->cube, 1, &pose);
    CHECK(hap_pointer_poses(v->f.s.session, v->f.hand, now, &hand, NULL) >= HAP_OK);
    if (now > until - 150 * MS) {
      CHECK(status == HAP_STALE);
      first = drawn++ == 0 ? pose : first;
      CHECK(memcmp(&first, &pose, sizeof pose) == 0); /* stands */
    }
  }
  CHECK(pose.position[0] >= v->x);
  v->x = pose.position[0];
  v->last = hap_session_now(v->f.s.session); /* frame time goes on from here */
  v->slack_now = 0;
}

TEST(a_pause_stands_still_and_goes_on_where_it_was)
{
  for (int calls = 0; calls < 2; ++calls) {
    view v;
    REQUIRE(view_begin(&v, resting));
    (void)view_frames(&v, 90.0, 60, 0.2);
    frames_until_normal(&v);
    for (int i = 0; i < 3; ++i) {
      uint64_t dropped = stats_of(&v.f.s).physics.frames_dropped;
      view_pause(&v, calls != 0);
      view_forget(&v);
      uint64_t frames_dropped = view_frames(&v, 90.0, 30, 0.2);
      CHECK(frames_dropped > 0 || stats_of(&v.f.s).physics.frames_dropped == dropped);
      CHECK(v.back == 0.0);
      CHECK(v.jump <= SPEED * 0.04); /* two steps: the world goes on at once */
      frames_until_normal(&v);
    }
    printf("# drawn back %.2g, jump %.2g m\n", v.back, v.jump);
    check_world(&v);
    CHECK(hap_session_stop(v.f.s.session) == HAP_OK);
    felt_end(&v.f);
  }
}

TEST(slow_motion_is_drawn_evenly)
{
  view v;
  REQUIRE(view_begin(&v, pressing));
  for (int i = 0; i < 120; ++i) {
    (void)view_frame(&v, v.last + 11 * MS, 0.5);
  }
  view_forget(&v);
  double from = v.x;
  int64_t begin = v.last;
  double fastest = 0.0;
  for (int i = 0; i < 90; ++i) {
    double x = v.x;
    int64_t last = v.last;
    (void)view_frame(&v, v.last + 11 * MS, 0.5);
    fastest = fmax(fastest, (v.x - x) / (1e-9 * (double)(v.last - last)));
  }
  double mean = (v.x - from) / (1e-9 * (double)(v.last - begin));
  printf("# %.3f m/s, fastest frame %.3f m/s, delay %.1f ms, back %.2g m\n", mean, fastest,
         1e3 * stats_of(&v.f.s).physics.pose_delay_s, v.back);
  CHECK(v.back == 0.0 && mean > 0.0);
  if (stats_of(&v.f.s).physics.frames_dropped == 0 && v.slack < 2 * MS && v.gap < 16 * MS) {
    CHECK_NEAR(mean, 0.5 * SPEED, 0.05 * SPEED);
    CHECK(fastest <= SPEED); /* and not in jumps of a step */
  }
  check_world(&v);
  CHECK(hap_session_stop(v.f.s.session) == HAP_OK);
  felt_end(&v.f);
}

/* ---- what it must not be called with ---- */

static void *update_elsewhere(void *arg)
{
  stage *s = arg;
  s->seen[0] = hap_session_update(s->session, 0.1);
  s->seen[1] = text_has(detail_of(s), "another thread");
  return NULL;
}

TEST(wrong_calls_say_so_and_change_nothing)
{
  static const double bad[] = {-1e-9,   -1.0, (double)NAN, (double)INFINITY, -(double)INFINITY,
                               86401.0, 1e300};
  stage s;
  pthread_t thread;
  stage_run(&s, HAP_DRIVE_FRAME); /* H = 20 ms */
  CHECK(hap_session_update(s.session, 0.015) == HAP_OK);
  for (size_t i = 0; i < sizeof bad / sizeof bad[0]; ++i) {
    CHECK(hap_session_update(s.session, bad[i]) == HAP_ERROR_ARGUMENT);
    CHECK(text_has(detail_of(&s), "frame_s") && text_has(s.detail.text, "seconds"));
  }
  REQUIRE(pthread_create(&thread, NULL, update_elsewhere, &s) == 0);
  CHECK(pthread_join(thread, NULL) == 0);
  CHECK(s.seen[0] == HAP_ERROR_THREAD && s.seen[1] == 1);
  REQUIRE(hap_session_lock(s.session) == HAP_OK);
  CHECK(hap_session_update(s.session, 0.1) == HAP_ERROR_THREAD);
  CHECK(text_has(detail_of(&s), "lock"));
  CHECK(hap_session_unlock(s.session) == HAP_OK);
  CHECK(atomic_load(&s.steps) == 0 && stats_of(&s).physics.frames_dropped == 0);
  CHECK(hap_session_update(s.session, 0.005) == HAP_OK); /* the remainder is still there */
  CHECK(atomic_load(&s.steps) == 1);
  CHECK(hap_session_update(s.session, 86400.0) == HAP_DROPPED); /* the machine slept */
  CHECK(atomic_load(&s.steps) == 4 && stats_of(&s).physics.frames_dropped == 4320000 - 3);
  CHECK(hap_session_stop(s.session) == HAP_OK);
  CHECK(hap_session_update(s.session, 0.02) == HAP_ERROR_STATE);
  stage_end(&s);
  static const hap_drive others[] = {HAP_DRIVE_THREADS, HAP_DRIVE_LOCKSTEP};
  for (int i = 0; i < 2; ++i) {
    stage_run(&s, others[i]);
    CHECK(hap_session_update(s.session, 0.02) == HAP_ERROR_STATE);
    CHECK(text_has(detail_of(&s), "FRAME"));
    stage_end(&s);
  }
}
