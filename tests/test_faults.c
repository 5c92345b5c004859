/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* What the hand feels when something breaks, tick by tick: one test a fault. In all of them the force
 * stays finite, within the device's limit and within the slew limit from write to write, and zero is the
 * last thing that a device gets (felt_end). Threads and processes: test_faults_threads.c. */

#include "tests/tap.h"

#include "session/session_internal.h"
#include "tests/felt.h"

#define STEP_TICKS 20 /* of physics, 50 Hz */
#define PASS_TICKS 5

/* ---- a drive whose parts can fail ---- */

static felt_stage f;
static uint64_t tick;
static void (*at_sync)(void);

/* What the other threads do at the begin of a tick. */
static void run_others(bool physics)
{
  hap_session *session = f.s.session;
  int64_t now = (int64_t)tick * MS;
  if (physics && tick % STEP_TICKS == 0 && tick > 0) {
    if (at_sync != NULL) {
      at_sync();
    }
    hapi_physics_cycle(session->physics, now, now + STEP_TICKS * MS);
  }
  if (tick % PASS_TICKS == 0 || hapi_contact_has_news(session->contact)) {
    hapi_contact_pass(session->contact, 0);
  }
}

static void run_tick(void)
{
  hapi_haptic_receive(f.s.session->haptic, (int64_t)tick * MS);
  run_others(true);
  hapi_haptic_cycle(f.s.session->haptic, (int64_t)tick * MS);
  ++tick;
}

static void run_ticks(int ticks)
{
  for (int i = 0; i < ticks; ++i) {
    run_tick();
  }
}

static void drop_ticks(int ticks)
{
  for (int i = 0; i < ticks; ++i) {
    run_others(true);
    ++tick;
  }
}

/* The loop goes on, physics is gone. */
static void run_alone(int ticks)
{
  for (int i = 0; i < ticks; ++i) {
    run_others(false);
    hapi_haptic_cycle(f.s.session->haptic, (int64_t)tick * MS);
    ++tick;
  }
}

static bool begin(const char *hand)
{
  tick = 0;
  at_sync = NULL;
  return felt_begin(&f, hand);
}

/* A hand on a mechanism, 40 mm into a wall at its will; it comes to rest at about 5 N. */
#define PRESSING "hand=relaxed,device_mass=0.1,device_damping=2,path=0:-0.08/0/0;0.5:-0.02/0/0"
/* The same, to and fro about the surface of the wall, which begins at -0.06. */
#define TAPPING "device_mass=0.1,device_damping=0.5,path=0:-0.06/0/0,sine=-0.03/0/0,hz=3"

static bool begin_pressing(void)
{
  felt_init(&f, HAP_DRIVE_LOCKSTEP, false);
  if (!begin(PRESSING)) {
    return false;
  }
  run_ticks(2000);
  CHECK_NEAR(felt_force(), 5.217, 0.01); /* 40 mm on 150 and 1000 N/m in a row */
  CHECK(felt_guard(&f) == 0 && felt.peak < FELT_LIMIT);
  felt.work = felt.work_most = 0.0;
  return true;
}

/* As it was before the fault, after so many ticks. */
static void check_normal_after(int ticks)
{
  run_ticks(ticks);
  CHECK(stats_of(&f.s).fault == HAP_FAULT_NONE);
  CHECK(felt_guard(&f) == 0);
  run_ticks(2000);
  CHECK_NEAR(felt_force(), 5.217, 0.01);
}

/* No force at all for some time, and the cause known. */
static void check_latched(hap_fault fault, int ticks)
{
  for (int i = 0; i < ticks; ++i) {
    run_tick();
    CHECK(felt_force() == 0.0);
  }
  hap_stats stats = stats_of(&f.s);
  CHECK(stats.fault == (uint32_t)fault && stats.fault_pointer == f.hand.v);
  CHECK(felt_guard(&f) == HAP_GUARD_FAULT && f.state.wrench.force[0] == 0.0);
}

/* ---- physics ---- */

TEST(physics_that_dies_fades_within_100_ms_and_comes_back_in_a_step)
{
  REQUIRE(begin_pressing());
  double before = felt_force();
  felt.steepest = 0.0;
  run_alone(30); /* an age of two steps is in good order */
  CHECK_NEAR(felt_force(), before, 1e-3);
  run_alone(120);
  CHECK(felt_force() == 0.0 && felt_guard(&f) == HAP_GUARD_STALE);
  CHECK(felt.steepest < 0.2); /* N: it fades, and is not cut */
  run_alone(5000);
  CHECK(felt_force() == 0.0 && stats_of(&f.s).faults == 0 && stats_of(&f.s).stale_times == 1);
  CHECK(felt.work_most < 1e-6); /* the hand sinks in, and is never pushed */
  felt.steepest = 0.0;
  tick = (tick / STEP_TICKS + 1) * STEP_TICKS;
  check_normal_after(2 + STEP_TICKS);
  CHECK(felt.steepest < 40.0 / STEP_TICKS + 0.5); /* N: 1000 N/m 40 mm deep, over a step */
  felt_end(&f);
}

/* ---- the loop's own time ---- */

typedef struct taps {
  double work;   /* J that the hand had gained, the most at any time */
  double once;   /* J, the most between two reads */
  double stored; /* J, the most in the spring */
} taps;

static taps taps_end(void)
{
  double stored = 0.5 * felt.peak * felt.peak / f.def.stiffness;
  taps t = {felt.work_most, felt.work_once, stored};
  felt.bad = f.s.def.guard == HAP_GUARD_MEASURE ? 0 : felt.bad; /* it has no slew limit */
  CHECK(stats_of(&f.s).faults == 0);
  felt_end(&f);
  return t;
}

static bool begin_tapping(hap_guard guard, const char *hand)
{
  char spec[200];
  felt_init(&f, HAP_DRIVE_LOCKSTEP, false);
  f.s.def.guard = guard;
  snprintf(spec, sizeof spec, "hand=%s," TAPPING, hand);
  return begin(spec);
}

static taps tap_with_drops(hap_guard guard, const char *hand, int dropped)
{
  if (!begin_tapping(guard, hand)) {
    return (taps){(double)NAN, 0.0, 0.0};
  }
  while (tick < 10000) {
    run_ticks(37 + (int)(tick % 11)); /* no rhythm with the taps */
    drop_ticks(dropped);
  }
  return taps_end();
}

TEST(dropped_ticks_give_the_hand_no_more_than_the_force_held_over_one_gap)
{
  static const char *const hands[] = {"relaxed", "tense"};
  static const int dropped[] = {1, 3, 10, 20, 50};
  for (int h = 0; h < 2; ++h) {
    for (int i = 0; i < 5; ++i) {
      taps bare = tap_with_drops(HAP_GUARD_MEASURE, hands[h], dropped[i]);
      taps kept = tap_with_drops(HAP_GUARD_ON, hands[h], dropped[i]);
      printf("# %s, %d dropped: bare %.3g J, guarded %.3g, in one gap %.3g, stored %.3g\n", hands[h],
             dropped[i], bare.work, kept.work, kept.once, kept.stored);
      /* Of a longer gap a debt larger than all that was stored is forgiven. */
      bool is_long = dropped[i] > 20;
      CHECK(kept.work <= (is_long ? 0.1 * bare.work : 0.01 * kept.stored + kept.once));
    }
  }
}

static uint64_t random_state;

static double random_share(void)
{
  random_state = random_state * 6364136223846793005u + 1442695040888963407u;
  return (double)(random_state >> 11) / 9007199254740992.0;
}

/* The loop wakes up 1 ms to 1 ms + jitter after the last time, and the time it is given is the real
 * one. */
static taps tap_with_jitter(hap_guard guard, const char *hand, double jitter_ms)
{
  random_state = 7;
  if (!begin_tapping(guard, hand)) {
    return (taps){(double)NAN, 0.0, 0.0};
  }
  int64_t wake_ns = MS;
  for (; tick < 10000; ++tick) {
    run_others(true);
    while (wake_ns < (int64_t)(tick + 1) * MS) {
      hapi_haptic_cycle(f.s.session->haptic, wake_ns);
      wake_ns += MS + (int64_t)(1e6 * jitter_ms * random_share());
    }
  }
  return taps_end();
}

TEST(a_jittering_clock_gives_the_hand_no_more_than_the_force_held_over_one_tick)
{
  static const char *const hands[] = {"relaxed", "tense"};
  static const double jitters[] = {0.2, 1.0, 5.0};
  for (int h = 0; h < 2; ++h) {
    for (int i = 0; i < 3; ++i) {
      taps bare = tap_with_jitter(HAP_GUARD_MEASURE, hands[h], jitters[i]);
      taps kept = tap_with_jitter(HAP_GUARD_ON, hands[h], jitters[i]);
      printf("# %s, %g ms: bare %.3g J, guarded %.3g, in one tick %.3g, stored %.3g\n", hands[h],
             jitters[i], bare.work, kept.work, kept.once, kept.stored);
      CHECK(kept.work <= 0.01 * kept.stored + kept.once);
    }
  }
}

TEST(a_loop_that_stood_still_while_the_hand_went_in_comes_up_from_zero)
{
  for (int i = 0; i < 2; ++i) { /* the hand starts outside and in contact */
    felt_init(&f, HAP_DRIVE_LOCKSTEP, false);
    REQUIRE(begin(i == 0 ? "path=0:-0.1/0/0;1:-0.1/0/0;1.3:0.2/0/0"
                         : "path=0:-0.057/0/0;1:-0.057/0/0;1.3:0.2/0/0"));
    run_ticks(1000);
    CHECK_NEAR(felt_force(), i == 0 ? 0.0 : 3.0, 1e-6);
    drop_ticks(300);
    run_tick();
    CHECK(felt_force() < 1e-9);
    felt.steepest = 0.0;
    run_ticks(300); /* rigid, it stays where it is and feels the limit in the end */
    CHECK_NEAR(felt_force(), FELT_LIMIT, 1e-9);
    CHECK(felt.steepest < 1.0 && stats_of(&f.s).faults == 0);
    felt_end(&f);
  }
}

/* ---- the device ---- */

TEST(a_pose_that_is_nan_ramps_to_zero_and_a_reset_ramps_in)
{
  REQUIRE(begin_pressing());
  atomic_store(&felt.bad_pose, 1);
  run_tick();
  CHECK(felt_force() > 0.0 && felt.zeros == 0); /* 5 N of 5.2 */
  atomic_store(&felt.bad_pose, 0);              /* one tick is enough */
  check_latched(HAP_FAULT_DEVICE_POSE, 500);
  CHECK(felt.work_most < 1e-3); /* J; while it ramped down */
  double gone = felt.work;
  CHECK(hap_session_reset_fault(f.s.session) == HAP_OK);
  felt.steepest = 0.0;
  run_ticks(20);
  CHECK(felt.steepest < 1.0); /* N */
  CHECK(felt.work - gone < 0.01 * 0.5 * 5.2 * 5.2 / 1000.0);
  check_normal_after(300);
  felt_end(&f);
}

/* The fault lasts; then the device answers again, and the hand has gone in deeper meanwhile. */
static void unplug(atomic_int *how, hap_fault fault)
{
  REQUIRE(begin_pressing());
  atomic_store(how, 1);
  run_tick(); /* reads or writes; the other one fails in the same tick */
  CHECK(felt_force() == 0.0 && felt.zeros >= 1); /* at once, no ramp */
  check_latched(fault, 300);
  CHECK(hap_session_reset_fault(f.s.session) == HAP_OK); /* too early */
  check_latched(fault, 100);
  CHECK(stats_of(&f.s).faults == 2);
  atomic_store(how, 0);
  check_latched(fault, 300); /* plugged again: nothing without a reset */
  CHECK(felt.work_most <= 1e-9);
  CHECK(hap_session_reset_fault(f.s.session) == HAP_OK);
  felt.steepest = 0.0;
  run_ticks(2);
  CHECK(felt_force() < 0.5);
  run_ticks(18);
  CHECK(felt.steepest < 1.0); /* N: 40 mm deep by now, of which 10 mm count */
  check_normal_after(300);
  felt_end(&f);
}

TEST(unplugged_between_read_and_write_is_zero_at_once_and_comes_back_by_a_reset)
{
  unplug(&felt.fail_write, HAP_FAULT_DEVICE_WRITE);
}

TEST(unplugged_before_the_read_is_zero_at_once_and_comes_back_by_a_reset)
{
  unplug(&felt.fail_read, HAP_FAULT_DEVICE_READ);
}

TEST(a_device_plugged_in_again_elsewhere_comes_up_from_zero)
{
  felt_init(&f, HAP_DRIVE_LOCKSTEP, true); /* a body of 1 kg */
  REQUIRE(begin("path=0:-0.07/0/0"));
  run_ticks(100);
  atomic_store(&felt.fail_read, 1);
  run_ticks(100);
  felt.jump = 0.5;
  atomic_store(&felt.fail_read, 0);
  run_ticks(100);
  CHECK(hap_session_reset_fault(f.s.session) == HAP_OK);
  felt.steepest = 0.0;
  run_ticks(500);
  printf("# steepest %.3g N a tick, peak %.3g N, body at %.3g m/s\n", felt.steepest, felt.peak,
         dBodyGetLinearVel(f.s.cube)[0]);
  CHECK(felt.steepest < 1.0 && felt.peak > 1.0);
  CHECK(fabs(dBodyGetLinearVel(f.s.cube)[0]) < 0.7);
  felt_end(&f);
}

static double fastest; /* m/s, of the body at the syncs so far */

static void note_speed(void)
{
  fastest = fmax(fastest, hapi_v3_norm(dBodyGetLinearVel(f.s.cube)));
}

static bool begin_to_jump(bool body, hap_coupling coupling, double stiffness)
{
  felt_init(&f, HAP_DRIVE_LOCKSTEP, body);
  f.def.coupling = coupling;
  f.def.stiffness = stiffness;
  f.def.damping = 2.0;
  if (coupling == HAP_COUPLING_PROXY) {
    f.def.coupling_stiffness = 1000.0;
    f.def.coupling_damping = 1.0;
    f.def.mass = 0.01;
  }
  fastest = 0.0;
  bool good = begin("path=0:-0.07/0/0");
  at_sync = note_speed;
  run_ticks(100);
  felt.steepest = 0.0;
  return good;
}

static const hap_coupling couplings[] = {HAP_COUPLING_DIRECT, HAP_COUPLING_PROXY};

TEST(a_device_that_jumps_half_a_metre_into_a_wall_comes_up_from_zero)
{
  for (int i = 0; i < 4; ++i) {
    double stiffness = i / 2 == 0 ? 1000.0 : 10000.0;
    REQUIRE(begin_to_jump(false, couplings[i % 2], stiffness));
    felt.jump = 0.5;
    felt.fast = true; /* and its velocity is the difference */
    run_ticks(1);
    felt.fast = false;
    CHECK(felt_force() <= 0.5);
    run_ticks(400);
    CHECK(stats_of(&f.s).faults == 0);
    printf("# %s, %g N/m: steepest %.3g N a tick\n", i % 2 == 0 ? "direct" : "proxy", stiffness,
           felt.steepest);
    CHECK(felt.steepest <= (stiffness == 1000.0 ? 1.0 : FELT_STEP));
    CHECK_NEAR(felt_force(), FELT_LIMIT, 1e-9);
    felt_end(&f);
  }
}

TEST(a_device_that_jumps_half_a_metre_into_a_body_does_not_shoot_it_away)
{
  for (int i = 0; i < 4; ++i) {
    double stiffness = i / 2 == 0 ? 1000.0 : 10000.0;
    REQUIRE(begin_to_jump(true, couplings[i % 2], stiffness));
    felt.jump = 0.5;
    felt.fast = true;
    run_ticks(1);
    felt.fast = false;
    run_ticks(3000);
    printf("# %s, %g N/m: the body comes to %.3g m/s, the force to %.3g N\n",
           i % 2 == 0 ? "direct" : "proxy", stiffness, fastest, felt.peak);
    /* 10 mm of spring, and what comes in at 0.2 m/s */
    CHECK(fastest > 0.05 && fastest <= 0.01 * sqrt(stiffness) + 0.4);
    CHECK(stats_of(&f.s).faults == 0);
    felt_end(&f);
  }
}

TEST(a_device_that_jumps_for_a_tick_and_back_is_felt_as_a_dip)
{
  REQUIRE(begin_pressing());
  for (int i = 0; i < 10; ++i) {
    felt.jump = i % 2 == 0 ? 0.5 : -0.5; /* deep into the wall, and out of it */
    run_tick();
    felt.jump = 0.0;
    run_ticks(100);
    CHECK(felt.peak < 8.0 && felt_force() > 1.0);
  }
  CHECK(felt.work_most < 0.01 * 0.5 * 5.2 * 5.2 / 1000.0 + felt.work_once);
  check_normal_after(300);
  felt_end(&f);
}

/* ---- the world ---- */

static void replace_box(void *arg)
{
  (void)arg;
  dGeomDestroy(f.s.geom);
  dBodyDestroy(f.s.cube);
  f.s.cube = dBodyCreate(f.s.world);
  f.s.geom = dCreateBox(f.s.space, 1.0, 1.0, 1.0);
  dBodySetKinematic(f.s.cube);
  dGeomSetBody(f.s.geom, f.s.cube);
  dBodySetPosition(f.s.cube, 0.45, 0.0, 0.0);
}

static void post_replacement(void)
{
  CHECK(hap_session_post(f.s.session, replace_box, NULL) == HAP_OK);
}

TEST(a_body_destroyed_and_created_at_every_sync_is_felt_less_and_never_jumps)
{
  felt_init(&f, HAP_DRIVE_LOCKSTEP, true);
  dBodySetKinematic(f.s.cube);
  REQUIRE(begin(PRESSING));
  run_ticks(2000);
  CHECK_NEAR(felt_force(), 5.217, 0.01);
  felt.work = felt.work_most = felt.work_once = 0.0;
  at_sync = post_replacement;
  run_ticks(4000);
  printf("# lost %llu\n",(unsigned long long)stats_of(&f.s).bodies_lost);
  CHECK(stats_of(&f.s).bodies_lost == 200 && stats_of(&f.s).faults == 0);
  printf("# gained %.3g J at most, %.3g in a tick, peak %.3g N\n", felt.work_most, felt.work_once,
         felt.peak);
  CHECK(felt.work_most <= 0.01 * 0.5 * felt.peak * felt.peak / 1000.0 + felt.work_once);
  at_sync = NULL;
  check_normal_after(1000);
  felt_end(&f);
}

/* Five walls around the hand and cubes in them, for one body and two contacts. */
static void add_crowd(void)
{
  for (int i = 0; i < 4; ++i) {
    double y = i % 2 == 0 ? -0.02 : 0.02;
    double z = i / 2 == 0 ? -0.02 : 0.02;
    dGeomID wall = dCreateBox(f.s.space, 1.0, 0.02, 0.02);
    dGeomSetPosition(wall, 0.45 + 1e-3 * i, y, z);
    dGeomID geom = NULL;
    dBodyID cube = add_cube(&f.s, 0.2, &geom);
    dBodySetPosition(cube, -0.06, 5.0 * y, 5.0 * z);
  }
}

static uint64_t dropped_before;
static int syncs_without_loss;

static void note_loss(void)
{
  uint64_t dropped = stats_of(&f.s).capacity_dropped;
  syncs_without_loss += dropped == dropped_before;
  dropped_before = dropped;
}

TEST(capacities_that_overflow_at_every_sync_leave_a_force_without_jumps)
{
  felt_init(&f, HAP_DRIVE_LOCKSTEP, false);
  add_crowd();
  f.s.def.max_bodies = 1;
  f.s.def.max_contacts = 2;
  REQUIRE(begin("hand=relaxed,device_mass=0.1,device_damping=2,path=0:-0.02/0/0,"
                "sine=0/0.03/0.02,hz=0.7"));
  run_ticks(1000);
  CHECK(felt_force() > 1.0);
  dropped_before = stats_of(&f.s).capacity_dropped;
  syncs_without_loss = 0;
  at_sync = note_loss;
  double least = FELT_LIMIT;
  for (int i = 0; i < 5000; ++i) {
    run_tick();
    least = fmin(least, felt_force());
  }
  hap_stats stats = stats_of(&f.s);
  printf("# %.3g to %.3g N, steepest %.3g N a tick, %llu dropped, %d of 250 syncs without\n", least,
         felt.peak, felt.steepest, (unsigned long long)stats.capacity_dropped, syncs_without_loss);
  CHECK(syncs_without_loss <= 1); /* the first one compares with itself */
  CHECK(stats.faults == 0 && stats.states_rejected == 0);
  CHECK(stats.neighbours_max <= 2 && stats.pointer_contacts <= 2);
  felt_end(&f);
}

int main(void)
{
  dInitODE2(0);
  dAllocateODEDataForThread(dAllocateMaskAll);
  RUN(physics_that_dies_fades_within_100_ms_and_comes_back_in_a_step);
  RUN(dropped_ticks_give_the_hand_no_more_than_the_force_held_over_one_gap);
  RUN(a_jittering_clock_gives_the_hand_no_more_than_the_force_held_over_one_tick);
  RUN(a_loop_that_stood_still_while_the_hand_went_in_comes_up_from_zero);
  RUN(a_pose_that_is_nan_ramps_to_zero_and_a_reset_ramps_in);
  RUN(unplugged_between_read_and_write_is_zero_at_once_and_comes_back_by_a_reset);
  RUN(unplugged_before_the_read_is_zero_at_once_and_comes_back_by_a_reset);
  RUN(a_device_plugged_in_again_elsewhere_comes_up_from_zero);
  RUN(a_device_that_jumps_half_a_metre_into_a_wall_comes_up_from_zero);
  RUN(a_device_that_jumps_half_a_metre_into_a_body_does_not_shoot_it_away);
  RUN(a_device_that_jumps_for_a_tick_and_back_is_felt_as_a_dip);
  RUN(a_body_destroyed_and_created_at_every_sync_is_felt_less_and_never_jumps);
  RUN(capacities_that_overflow_at_every_sync_leave_a_force_without_jumps);
  dCloseODE();
  return tap_done();
}
