/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* What the hand feels when something breaks, tick by tick: one test a fault. In all of them the
 * force stays finite, within the device's limit and within the slew limit from write to write,
 * and zero is the last thing that a device gets (felt_end). Threads and processes:
 * test_faults_threads.c. */

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

static bool fault_begin(const char *hand)
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
  if (!fault_begin(PRESSING)) {
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
  CHECK(stats_of(&f.s).faults.fault == HAP_FAULT_NONE);
  CHECK((felt_guard(&f) & (HAP_GUARD_FAULT | HAP_GUARD_STALE | HAP_GUARD_RAMP_IN)) == 0);
  run_ticks(2000);
  CHECK_NEAR(felt_force(), 5.217, 0.01);
  CHECK(felt_guard(&f) == 0);
}

/* What a hand of 0.3 kg and 5 N s/m would be driven to by the whole force of the device for ever is
 * 2 m/s. */
static void check_no_burst(void)
{
  printf("# the force rose by %.3g N a tick at most, the hand came to %.3g m/s\n", felt.steepest,
         1e3 * felt.way_most);
  CHECK(felt.steepest < 2.0 && felt.way_most < 1e-3);
}

static void look_for_a_burst(void)
{
  felt.steepest = felt.way_most = 0.0;
}

/* No force at all for some time, and the cause known. */
static void check_latched(hap_fault fault, int ticks)
{
  for (int i = 0; i < ticks; ++i) {
    run_tick();
    CHECK(felt_force() == 0.0);
  }
  hap_stats stats = stats_of(&f.s);
  CHECK(stats.faults.fault == (uint32_t)fault && stats.faults.pointer == f.hand.v);
  CHECK(felt_guard(&f) == HAP_GUARD_FAULT && f.state.wrench.force[0] == 0.0);
}

/* ---- physics ---- */

TEST(physics_that_dies_fades_within_100_ms_and_comes_back_in_a_step)
{
  REQUIRE(begin_pressing());
  double before = felt_force();
  felt.steepest = 0.0;
  run_alone(20); /* an age of two steps is in good order */
  CHECK_NEAR(felt_force(), before, 1e-3);
  run_alone(120);
  CHECK(felt_force() == 0.0 && felt_guard(&f) == HAP_GUARD_STALE);
  CHECK(felt.steepest < 0.2); /* N: it fades, and is not cut */
  run_alone(5000);
  CHECK(felt_force() == 0.0 && stats_of(&f.s).faults.count == 0 &&
        stats_of(&f.s).faults.stale_times == 1);
  CHECK(felt.work_most < 1e-6); /* the hand sinks in, and is never pushed */
  look_for_a_burst();
  tick = (tick / STEP_TICKS + 1) * STEP_TICKS;
  check_normal_after(2 + STEP_TICKS);
  printf("# steepest %.3g N a tick, hand %.3g m/s\n", felt.steepest, 1e3 * felt.way_most);
  CHECK(felt.steepest < 40.0 / STEP_TICKS + 0.5); /* N: 1000 N/m 40 mm deep, over a step */
  felt_end(&f);
}

/* ---- the loop's own time ---- */

typedef struct taps {
  double work;   /* J that the hand had gained, the most at any time */
  double once;   /* J, the most between two reads */
  double stored; /* J, the most in the spring */
} taps;

static taps taps_end(hap_fault allowed)
{
  double stored = 0.5 * felt.peak * felt.peak / f.def.stiffness;
  taps t = {felt.work_most, felt.work_once, stored};
  felt.bad = f.s.research.guard == HAP_GUARD_MEASURE ? 0 : felt.bad; /* it has no slew limit */
  uint32_t fault = stats_of(&f.s).faults.fault;
  CHECK(fault == HAP_FAULT_NONE || fault == (uint32_t)allowed);
  felt_end(&f);
  return t;
}

static bool begin_tapping(hap_guard guard, const char *hand)
{
  char spec[200];
  felt_init(&f, HAP_DRIVE_LOCKSTEP, false);
  f.s.research.guard = guard;
  snprintf(spec, sizeof spec, "hand=%s," TAPPING, hand);
  return fault_begin(spec);
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
  bool most = guard == HAP_GUARD_ON && dropped > 40; /* more than half of all ticks */
  return taps_end(most ? HAP_FAULT_LATE : HAP_FAULT_NONE);
}

TEST(dropped_ticks_give_the_hand_no_more_than_the_force_held_over_one_gap)
{
  static const char *const hands[] = {"relaxed", "tense"};
  static const int dropped[] = {1, 3, 10, 20, 50};
  for (int h = 0; h < 2; ++h) {
    for (int i = 0; i < 5; ++i) {
      taps bare = tap_with_drops(HAP_GUARD_MEASURE, hands[h], dropped[i]);
      taps kept = tap_with_drops(HAP_GUARD_ON, hands[h], dropped[i]);
      printf("# %s, %d dropped: bare %.3g J, guarded %.3g, in one gap %.3g, stored %.3g\n",
             hands[h], dropped[i], bare.work, kept.work, kept.once, kept.stored);
      if (dropped[i] <= 20) {
        CHECK(kept.work <= 0.01 * kept.stored + kept.once);
      } else { /* the stiffness changes under load: some of it is the hand's */
        CHECK(kept.work <= 0.001 * bare.work);
      }
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
  return taps_end(HAP_FAULT_NONE);
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

TEST(a_loop_that_stood_still_while_the_hand_went_in_takes_the_surface_to_the_hand)
{
  for (int i = 0; i < 2; ++i) { /* the hand starts outside and in contact */
    felt_init(&f, HAP_DRIVE_LOCKSTEP, false);
    REQUIRE(fault_begin(i == 0
                            ? "path=0:-0.1/0/0;1:-0.1/0/0;1.04:0.2/0/0;2:0.2/0/0;2.1:0.202/0/0;"
                              "3:0.202/0/0;4:-0.1/0/0;5:-0.057/0/0"
                            : "path=0:-0.057/0/0;1:-0.057/0/0;1.04:0.2/0/0;2:0.2/0/0;2.1:0.202/0/0;"
                              "3:0.202/0/0;4:-0.1/0/0;5:-0.057/0/0"));
    run_ticks(1000);
    CHECK_NEAR(felt_force(), i == 0 ? 0.0 : 3.0, 1e-6);
    drop_ticks(45);
    run_ticks(955); /* 0.25 m deep */
    CHECK(felt_force() == 0.0);
    run_ticks(500); /* 2 mm on */
    CHECK_NEAR(felt_force(), 2.0, 1e-6);
    run_ticks(2500); /* out, and in again: the wall is where it was */
    CHECK_NEAR(felt_force(), 3.0, 1e-6);
    CHECK(stats_of(&f.s).faults.count == 0 && felt.peak <= 3.0 + 1e-6);
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
  CHECK(hap_session_reset_fault(f.s.session) == HAP_OK);
  look_for_a_burst();
  check_normal_after(20);
  check_no_burst();
  felt_end(&f);
}

/* The fault lasts; then the device answers again, and the hand has gone in deeper meanwhile. */
static void device_unplug(atomic_int *how, hap_fault fault)
{
  REQUIRE(begin_pressing());
  atomic_store(how, 1);
  run_tick(); /* reads or writes; the other one fails in the same tick */
  CHECK(felt_force() == 0.0 && felt.zeros >= 1); /* at once, no ramp */
  check_latched(fault, 300);
  CHECK(hap_session_reset_fault(f.s.session) == HAP_OK); /* too early */
  check_latched(fault, 100);
  CHECK(stats_of(&f.s).faults.count == 2);
  atomic_store(how, 0);
  check_latched(fault, 300); /* plugged again: nothing without a reset */
  CHECK(felt.work_most <= 1e-9);
  CHECK(hap_session_reset_fault(f.s.session) == HAP_OK);
  look_for_a_burst();
  run_ticks(2);
  CHECK(felt_force() < 0.5);
  check_normal_after(18); /* 40 mm deep by now, of which 10 mm count */
  check_no_burst();
  felt_end(&f);
}

TEST(unplugged_between_read_and_write_is_zero_at_once_and_comes_back_by_a_reset)
{
  device_unplug(&felt.fail_write, HAP_FAULT_DEVICE_WRITE);
}

TEST(unplugged_before_the_read_is_zero_at_once_and_comes_back_by_a_reset)
{
  device_unplug(&felt.fail_read, HAP_FAULT_DEVICE_READ);
}

/* Only a start brings it back; the hand begins its script anew then, and is where it was by its
 * end. */
TEST(a_device_that_was_lost_comes_back_by_a_restart_and_a_reset)
{
  hap_pointer_state state;
  REQUIRE(begin_pressing());
  atomic_store(&felt.lost, 1);
  atomic_store(&felt.fail_start, 1); /* the plug is out */
  run_tick();
  CHECK(felt_force() == 0.0);
  check_latched(HAP_FAULT_DEVICE_READ, 300);
  CHECK(hap_session_reset_fault(f.s.session) == HAP_OK); /* is not enough */
  check_latched(HAP_FAULT_DEVICE_READ, 100);
  CHECK(felt.starts == 1); /* nothing is started unless it is asked for */
  CHECK(hap_pointer_restart(f.s.session, f.hand) == HAP_ERROR_DEVICE);
  CHECK(text_has(detail_of(&f.s), "could not be read") && felt.starts == 2); /* the fault */
  check_latched(HAP_FAULT_DEVICE_READ, 100);
  CHECK(hap_pointer_get(f.s.session, f.hand, &state, sizeof state) == HAP_OK);
  atomic_store(&felt.fail_start, 0);
  CHECK(hap_pointer_restart(f.s.session, f.hand) == HAP_OK);
  check_latched(HAP_FAULT_DEVICE_READ, 600); /* it answers: and no force by surprise */
  CHECK(felt.work_most <= 1e-9);
  CHECK(hap_session_reset_fault(f.s.session) == HAP_OK);
  look_for_a_burst();
  run_ticks(2);
  CHECK((felt_guard(&f) & HAP_GUARD_RAMP_IN) != 0 && felt_force() < 0.6);
  check_normal_after(18);
  check_no_burst();
  felt_end(&f);
}

/* Whatever it was restarted for, without a fault: from nothing, over the ramp-in. */
TEST(a_restart_without_a_fault_comes_in_over_the_ramp)
{
  REQUIRE(begin_pressing());
  look_for_a_burst();
  int zeros = felt.zeros;
  CHECK(hap_pointer_restart(f.s.session, f.hand) == HAP_OK);
  CHECK(felt.zeros > zeros && felt_force() == 0.0 && felt.starts == 2);
  run_tick();
  CHECK((felt_guard(&f) & HAP_GUARD_RAMP_IN) != 0 && felt_force() < 0.6);
  run_ticks(500);
  check_normal_after(20);
  felt_end(&f);
}

TEST(a_restart_has_its_place)
{
  hap_pointer_id none = {0};
  hap_pointer_id free_id;
  hap_pointer_def def;
  CHECK(hap_pointer_restart(NULL, none) == HAP_ERROR_ARGUMENT);
  REQUIRE(begin_pressing());
  CHECK(hap_pointer_restart(f.s.session, none) == HAP_ERROR_NOT_FOUND);
  hap_pointer_def_init(&def, sizeof def);
  REQUIRE(hap_pointer_add(f.s.session, &def, &free_id) == HAP_OK);
  CHECK(hap_pointer_restart(f.s.session, free_id) == HAP_ERROR_STATE);
  CHECK(text_has(detail_of(&f.s), "no device"));
  atomic_store(&felt.fail_start, 1);
  CHECK(hap_pointer_restart(f.s.session, f.hand) == HAP_ERROR_DEVICE);
  run_ticks(10); /* out of the world, and no fault */
  CHECK(stats_of(&f.s).faults.fault == HAP_FAULT_NONE && felt_force() == 0.0);
  CHECK(hap_session_stop(f.s.session) == HAP_OK);
  CHECK(hap_pointer_restart(f.s.session, f.hand) == HAP_ERROR_STATE);
  CHECK(text_has(detail_of(&f.s), "not started"));
  atomic_store(&felt.fail_start, 0);
  CHECK(hap_session_start(f.s.session) == HAP_OK); /* starts all of them */
  CHECK(hap_session_advance(f.s.session, 2000) == HAP_OK);
  CHECK_NEAR(felt_force(), 5.217, 0.01);
  atomic_store(&felt.fail_start, 1);
  CHECK(hap_pointer_restart(f.s.session, f.hand) == HAP_ERROR_DEVICE);
  CHECK(hap_pointer_remove(f.s.session, f.hand) == HAP_OK);
  CHECK(hap_pointer_restart(f.s.session, f.hand) == HAP_ERROR_NOT_FOUND);
  felt_end(&f);
}

TEST(a_device_plugged_in_again_deep_in_a_body_comes_up_from_zero)
{
  felt_init(&f, HAP_DRIVE_LOCKSTEP, true); /* a body of 1 kg */
  REQUIRE(fault_begin("path=0:-0.07/0/0"));
  run_ticks(100);
  atomic_store(&felt.fail_read, 1);
  run_ticks(100);
  felt.jump = 0.5;
  atomic_store(&felt.fail_read, 0);
  run_ticks(100);
  CHECK(hap_session_reset_fault(f.s.session) == HAP_OK);
  look_for_a_burst();
  run_ticks(500);
  printf("# steepest %.3g N a tick, peak %.3g N, body at %.3g m/s\n", felt.steepest, felt.peak,
         dBodyGetLinearVel(f.s.cube)[0]);
  check_no_burst();
  CHECK(felt.peak > 1.0 && fabs(dBodyGetLinearVel(f.s.cube)[0]) < 1.0);
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
  f.pointer_expert.coupling = coupling;
  f.def.stiffness = stiffness;
  f.def.damping = 2.0;
  if (coupling == HAP_COUPLING_PROXY) {
    f.pointer_expert.coupling_stiffness = 1000.0;
    f.pointer_expert.coupling_damping = 1.0;
    f.pointer_expert.proxy_mass = 0.01;
  }
  fastest = 0.0;
  bool good = fault_begin("path=0:-0.07/0/0");
  at_sync = note_speed;
  run_ticks(100);
  felt.steepest = 0.0;
  return good;
}

TEST(a_hand_that_went_into_a_body_during_a_fault_does_not_shoot_it_away)
{
  static const hap_model models[] = {HAP_MODEL_CONTACT, HAP_MODEL_ACCELERANCE, HAP_MODEL_IMPULSE};
  for (int i = 0; i < 3; ++i) {
    felt_init(&f, HAP_DRIVE_LOCKSTEP, true);
    f.s.def.model = models[i];
    fastest = 0.0;
    REQUIRE(fault_begin("path=0:-0.07/0/0;0.2:-0.07/0/0;1:0.1/0/0")); /* 160 mm deep */
    at_sync = note_speed;
    run_ticks(100);
    atomic_store(&felt.bad_pose, 1);
    run_tick();
    atomic_store(&felt.bad_pose, 0);
    run_ticks(1500);
    CHECK(fastest == 0.0 && felt.peak == 0.0);
    CHECK(hap_session_reset_fault(f.s.session) == HAP_OK);
    look_for_a_burst();
    run_ticks(500);
    printf("# %s: body to %.3g m/s, %.3g N a tick\n", hap_model_name(models[i]), fastest,
           felt.steepest);
    CHECK(felt.peak > 1.0 && fastest > 0.05 && fastest < 1.5);
    check_no_burst();
    felt_end(&f);
  }
}

static const hap_coupling couplings[] = {HAP_COUPLING_DIRECT, HAP_COUPLING_PROXY};

static void hand_jump(double way)
{
  felt.jump += way;
  felt.fast = true; /* and its velocity is the difference */
  run_tick();
  felt.fast = false;
}

TEST(a_device_that_jumps_half_a_metre_into_a_wall_takes_the_surface_with_it)
{
  for (int i = 0; i < 4; ++i) {
    double stiffness = i / 2 == 0 ? 1000.0 : 10000.0;
    REQUIRE(begin_to_jump(false, couplings[i % 2], stiffness));
    hand_jump(0.5);
    run_ticks(400);
    CHECK(stats_of(&f.s).faults.count == 0 && felt.peak == 0.0);
    felt.jump += 1e-3; /* a hand that goes on feels it */
    run_ticks(100);
    CHECK(felt_force() > 0.4);
    felt.jump -= 2e-3;
    run_ticks(100);
    CHECK(felt_force() < 0.5);
    felt.jump += 1e-3; /* and one that comes back, 1 mm farther out */
    run_ticks(100);
    CHECK(felt_force() > 0.4);
    CHECK(stats_of(&f.s).faults.count == 0);
    felt_end(&f);
  }
}

TEST(a_device_that_jumps_half_a_metre_into_a_body_does_not_shoot_it_away)
{
  for (int i = 0; i < 4; ++i) {
    double stiffness = i / 2 == 0 ? 1000.0 : 10000.0;
    REQUIRE(begin_to_jump(true, couplings[i % 2], stiffness));
    hand_jump(0.5);
    run_ticks(1000);
    hand_jump(-0.5);
    run_ticks(1000);
    CHECK(fastest == 0.0 && felt.peak == 0.0);
    CHECK(stats_of(&f.s).faults.count == 0);
    felt_end(&f);
  }
}

/* The body comes to where the hand is: nothing jumped, and it has to come out. */
TEST(a_body_put_over_the_hand_is_pushed_out_slowly)
{
  for (int i = 0; i < 4; ++i) {
    double stiffness = i / 2 == 0 ? 1000.0 : 10000.0;
    REQUIRE(begin_to_jump(true, couplings[i % 2], stiffness));
    dBodySetPosition(f.s.cube, -0.05, 0.0, 0.0); /* half a metre deep */
    look_for_a_burst();
    run_ticks(3000);
    printf("# %s, %g N/m: body to %.3g m/s, force to %.3g N, %.3g N a tick\n",
           i % 2 == 0 ? "direct" : "proxy", stiffness, fastest, felt.peak, felt.steepest);
    /* 10 mm of spring, and what comes in at 0.2 m/s */
    CHECK(fastest > 0.05 && fastest <= 0.01 * sqrt(stiffness) + 0.4);
    CHECK(stats_of(&f.s).faults.count == 0);
    felt_end(&f);
  }
}

TEST(a_device_that_jumps_for_a_tick_and_back_is_felt_as_a_dip)
{
  for (int i = 0; i < 2; ++i) {
    REQUIRE(begin_pressing());
    felt.peak = 0.0;
    double way = i == 0 ? 0.5 : -0.5; /* deep into the wall, and out of it */
    hand_jump(way);
    hand_jump(-way);
    run_ticks(2000);
    /* From nothing the hand swings over; after the wall it has it 5 mm deeper. */
    CHECK(felt.peak < 8.0 && fabs(felt_force() - 5.217) < 0.75);
    CHECK(felt.work_most < 1e-3 && stats_of(&f.s).faults.count == 0);
    felt_end(&f);
  }
}

/* ---- the world ---- */

static void replace_box(void *arg)
{
  dGeomID old_geom = f.s.geom;
  dBodyID old = f.s.cube; /* it goes last, so that the new one is at another address */
  (void)arg;
  f.s.cube = dBodyCreate(f.s.world);
  f.s.geom = dCreateBox(f.s.space, 1.0, 1.0, 1.0);
  dBodySetKinematic(f.s.cube);
  dGeomSetBody(f.s.geom, f.s.cube);
  dBodySetPosition(f.s.cube, 0.45, 0.0, 0.0);
  dGeomDestroy(old_geom);
  dBodyDestroy(old);
}

static void post_replacement(void)
{
  CHECK(hap_session_post(f.s.session, replace_box, NULL) == HAP_OK);
}

TEST(a_body_destroyed_and_created_at_every_sync_is_felt_less_and_never_jumps)
{
  felt_init(&f, HAP_DRIVE_LOCKSTEP, true);
  dBodySetKinematic(f.s.cube);
  REQUIRE(fault_begin(PRESSING));
  run_ticks(2000);
  CHECK_NEAR(felt_force(), 5.217, 0.01);
  felt.work = felt.work_most = felt.work_once = 0.0;
  at_sync = post_replacement;
  run_ticks(4000);
  CHECK(stats_of(&f.s).faults.bodies_lost == 200 && stats_of(&f.s).faults.count == 0);
  printf("# gained %.3g J at most, %.3g in a tick, peak %.3g N\n", felt.work_most, felt.work_once,
         felt.peak);
  CHECK(felt.work_most <= 0.01 * 0.5 * felt.peak * felt.peak / 1000.0 + felt.work_once);
  at_sync = NULL;
  check_normal_after(1000);
  felt_end(&f);
}

/* A wall of rods, and cubes in front of it at its sides. */
static void add_crowd(void)
{
  for (int y = -8; y <= 8; ++y) {
    for (int z = -6; z <= 6; ++z) {
      dGeomID rod = dCreateBox(f.s.space, 1.0, 0.005, 0.005);
      dGeomSetPosition(rod, 0.45, 0.006 * y, 0.006 * z);
    }
  }
  for (int i = 0; i < 4; ++i) {
    dBodyID cube = add_cube(&f.s, 0.2, NULL);
    dBodySetPosition(cube, -0.06, i % 2 == 0 ? -0.11 : 0.11, i / 2 == 0 ? -0.06 : 0.06);
  }
}

static uint64_t dropped_before;
static int syncs_without_loss;

static void note_loss(void)
{
  uint64_t dropped = stats_of(&f.s).model.capacity_dropped;
  syncs_without_loss += dropped == dropped_before;
  dropped_before = dropped;
}

TEST(capacities_that_overflow_at_every_sync_leave_a_force_without_jumps)
{
  felt_init(&f, HAP_DRIVE_LOCKSTEP, false);
  add_crowd();
  f.s.def.max_bodies = 1;
  f.s.def.max_contacts = 2;
  REQUIRE(
      fault_begin("hand=relaxed,device_mass=0.1,device_damping=2,path=0:-0.02/0/0,"
                  "sine=0/0.04/0.02,hz=0.7"));
  run_ticks(1000);
  CHECK(felt_force() > 1.0);
  dropped_before = stats_of(&f.s).model.capacity_dropped;
  syncs_without_loss = 0;
  at_sync = note_loss;
  double least = FELT_LIMIT;
  for (int i = 0; i < 5000; ++i) {
    run_tick();
    least = fmin(least, felt_force());
  }
  hap_stats stats = stats_of(&f.s);
  printf("# %.3g to %.3g N, steepest %.3g N a tick, %llu dropped, %d of 250 syncs without\n", least,
         felt.peak, felt.steepest, (unsigned long long)stats.model.capacity_dropped,
         syncs_without_loss);
  CHECK(syncs_without_loss <= 1); /* the first one compares with itself */
  CHECK(stats.faults.count == 0 && stats.faults.states_rejected == 0);
  CHECK(stats.model.neighbours_max <= 2 && stats.model.pointer_contacts <= 2);
  felt_end(&f);
}
