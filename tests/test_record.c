/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Threaded sessions are recorded, and replayed in lockstep bit for bit. What is wrong with a
 * file is in test_record_file.c. */

#include "tests/tap.h"

#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <sys/resource.h>

#include "tests/fake_device.h"
#include "tests/owned_rig.h"
#include "tests/recorded.h"

/* ---- a device with a clock and troubles of its own ---- */

static atomic_int block_ms; /* the next read */
static unsigned noise;

/* To and fro, into the row of cubes, as the wall clock says, with noise: no two runs are alike. */
static hap_status hand_move(fake_device *d, int64_t time_ns, hap_pose *io, uint32_t *buttons)
{
  double t = 1e-9 * (double)(hapi_clock_now() % (1000 * 1000 * MS));
  int ms = atomic_exchange(&block_ms, 0);
  (void)d;
  (void)time_ns;
  if (ms > 0) {
    sleep_ms(ms);
  }
  noise = noise * 1664525u + 1013904223u;
  io->position[0] = -0.01 + 0.012 * sin(9.0 * t) + 1e-6 * (noise >> 28);
  io->position[2] = 0.025;
  *buttons = noise >> 31;
  return HAP_OK;
}

static void hand_push(fake_device *d, const hap_wrench *wanted, hap_wrench *reached)
{
  (void)d;
  (void)wanted;
  reached->force[0] *= 0.5; /* it is weak */
}

static hap_device *device;

static hap_pointer_id add_hand(rig *r)
{
  hap_pointer_def def;
  hap_pointer_id id = {0};
  hap_pointer_def_init(&def, sizeof def);
  fakes_opened = 0;
  fake_device *d = fake_next();
  d->info = (hap_device_info){.dof = 3, .max_force = 10.0, .damping = 1.0, .quantum = 1e-6};
  d->move = hand_move;
  d->push = hand_push;
  device = fake_device_open(HAP_PACING_HOST);
  def.device = device;
  def.stiffness = 2000.0;
  def.damping = 5.0;
  CHECK(hap_pointer_add(r->session, &def, &id) == HAP_OK);
  return id;
}

/* ---- what is alike ---- */

static replay check_setup(const recorded_setup *s)
{
  hap_stats before = recorded_make(s);
  replay again = recorded_play(s->scene, 0);
  check_alike(&again, &before);
  return again;
}

TEST(scenes_in_model_contact)
{
  static const char *const scenes[] = {"row10", "stack", "fig5",  "clump8", "grasp", "roll",
                                       "door",  "cart",  "chain", "lever",  "peg"};
  for (size_t i = 0; i < sizeof scenes / sizeof scenes[0]; ++i) {
    recorded_setup s = recorded_setup_of(scenes[i], HAP_MODEL_CONTACT, 700);
    (void)check_setup(&s);
  }
}

TEST(scenes_in_the_paper_s_models)
{
  static const char *const scenes[] = {"row10", "stack", "fig5", "grasp", "peg"};
  for (size_t i = 0; i < sizeof scenes / sizeof scenes[0]; ++i) {
    for (int model = HAP_MODEL_SINGLE; model <= HAP_MODEL_ACCELERANCE; ++model) {
      recorded_setup s = recorded_setup_of(scenes[i], (hap_model)model, 400);
      (void)check_setup(&s);
    }
  }
}

TEST(ways_of_testing)
{
  static const char *const scenes[] = {"stack", "spheres"};
  for (size_t i = 0; i < sizeof scenes / sizeof scenes[0]; ++i) {
    recorded_setup s = recorded_setup_of(scenes[i], HAP_MODEL_ACCELERANCE, 400);
    s.probe = HAP_PROBE_OPERATING;
    s.cross = HAP_EFFECT_ON;
    (void)check_setup(&s);
    hap_player *player = NULL;
    hap_session_def def;
    hap_expert_def expert;
    hap_research_def research;
    session_defs_init(&def, &expert, &research);
    REQUIRE(hap_player_open(recorded_path, HAP_PLAY_WHOLE, &player, NULL) == HAP_OK);
    CHECK(hap_player_get_def(player, &def, &expert, &research) == HAP_OK);
    CHECK(research.probe == HAP_PROBE_OPERATING &&
          expert.effects_on == HAP_EFFECT_BIT(HAP_EFFECT_CROSS));
    hap_player_close(player);
  }
}

/* The range ends before the row does, and two sweeps do not solve it. */
TEST(a_loop_of_less_accuracy)
{
  recorded_setup s = recorded_setup_of("row10", HAP_MODEL_CONTACT, 900);
  s.max_sweeps = 2;
  s.range_hops = 3;
  (void)check_setup(&s);
  hap_player *player = NULL;
  hap_session_def def;
  hap_expert_def expert;
  hap_research_def research;
  session_defs_init(&def, &expert, &research);
  REQUIRE(hap_player_open(recorded_path, HAP_PLAY_WHOLE, &player, NULL) == HAP_OK);
  CHECK(hap_player_get_def(player, &def, &expert, &research) == HAP_OK);
  CHECK(expert.max_sweeps == 2 && expert.range_hops == 3);
  hap_player_close(player);
}

/* Testing simulations that are used again are so in the replay. */
TEST(testing_simulations_that_are_not_made)
{
  recorded_setup s = recorded_setup_of("slide", HAP_MODEL_ACCELERANCE, 900);
  s.reuse = 1e-4;
  (void)check_setup(&s);
  hap_player *player = NULL;
  hap_session_def def;
  hap_expert_def expert;
  hap_research_def research;
  session_defs_init(&def, &expert, &research);
  REQUIRE(hap_player_open(recorded_path, HAP_PLAY_WHOLE, &player, NULL) == HAP_OK);
  CHECK(hap_player_get_def(player, &def, &expert, &research) == HAP_OK && expert.reuse == 1e-4);
  hap_player_close(player);
}

/* The mass is not the default's: it is in the file. */
TEST(couplings_of_the_literature)
{
  static const char *const scenes[] = {"slide", "peg"};
  for (int i = 0; i < 4; ++i) {
    recorded_setup s = recorded_setup_of(scenes[i / 2], HAP_MODEL_CONTACT, 700);
    s.coupling = i % 2 == 0 ? HAP_COUPLING_GOD_OBJECT : HAP_COUPLING_VIRTUAL;
    s.coupling_stiffness = 800.0;
    s.virtual_mass = 0.25;
    (void)check_setup(&s);
  }
}

TEST(two_pointers_and_a_replayed_motion)
{
  char spec[400];
  char csv[320];
  snprintf(csv, sizeof csv, "%s.csv", recorded_path);
  FILE *file = fopen(csv, "w");
  REQUIRE(file != NULL);
  fputs("t,x,y,z\n0,-0.03,0,0.025\n0.3,0.005,0,0.025\n0.6,-0.01,0,0.025\n1,0.01,0,0.025\n", file);
  fclose(file);
  snprintf(spec, sizeof spec, "replay:%s", csv);
  recorded_setup s = recorded_setup_of("row10", HAP_MODEL_CONTACT, 800);
  s.devices[0] = spec;
  s.devices[1] = "virtual:path=0:0.2/-0.06/0.025;0.5:0.2/-0.02/0.025,hand=relaxed";
  replay again = check_setup(&s);
  CHECK(again.info.pointers == 2 && again.info.edits == 0);
  CHECK(again.stats.loop.contact_ticks > 10);
  unlink(csv);
}

/* ---- what happens meanwhile ---- */

static void hold_physics(rig *r, int look)
{
  if (look == 4) {
    CHECK(hap_session_lock(r->session) == HAP_OK);
    sleep_ms(300); /* five steps, and the model grows old */
    CHECK(hap_session_unlock(r->session) == HAP_OK);
  }
}

TEST(a_stall_of_physics)
{
  for (int model = HAP_MODEL_SINGLE; model <= HAP_MODEL_CONTACT; ++model) {
    recorded_setup s = recorded_setup_of("row10", (hap_model)model, 700);
    s.meanwhile = hold_physics;
    hap_stats before = recorded_make(&s);
    replay again = recorded_play("row10", 0);
    check_alike(&again, &before);
    CHECK(again.info.edits == 1); /* the lock is told, though nothing was done under it */
    CHECK(again.stats.physics.missed == before.physics.missed && before.physics.missed > 2);
    CHECK(again.stats.faults.stale_ticks == before.faults.stale_ticks);
  }
}

/* ---- a step that takes long, in a world of this test ---- */

#define LONG_MS 2600 /* so that a replay sees its begin long before its end */

typedef struct small_world {
  dWorldID world;
  dSpaceID space;
  hap_session_def def;
  hap_expert_def expert;
  hap_research_def research;
  hap_ode_def ode;
  hap_session *session;
  hap_pointer_id hands[16];
  dBodyID cube;
  dBodyID guest; /* NULL: none */
  int steps;
  int calls;
  bool sleeps;
} small_world;

static bool slow_surface(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  small_world *w = user;
  (void)a;
  (void)b;
  io->mode = dContactApprox1;
  io->mu = 0.5;
  if (w->sleeps && ++w->calls == 20) {
    sleep_ms(LONG_MS);
  }
  return true;
}

/* A cube that slides on a floor, and a pointer in its way. */
static void build_world(small_world *w)
{
  dMass mass;
  memset(w, 0, sizeof *w);
  w->world = dWorldCreate();
  w->space = dHashSpaceCreate(NULL);
  dWorldSetGravity(w->world, 0.0, 0.0, -9.81);
  dBodyID cube = w->cube = dBodyCreate(w->world);
  dMassSetBoxTotal(&mass, 1.0, 0.1, 0.1, 0.1);
  dBodySetMass(cube, &mass);
  dGeomSetBody(dCreateBox(w->space, 0.1, 0.1, 0.1), cube);
  dBodySetPosition(cube, 0.0, 0.0, 0.05);
  dBodySetLinearVel(cube, 0.5, 0.0, 0.0);
  dCreatePlane(w->space, 0.0, 0.0, 1.0, 0.0);
  session_defs_init(&w->def, &w->expert, &w->research);
  hap_ode_def_init(&w->ode, sizeof w->ode);
  w->ode.world = w->world;
  w->ode.space = w->space;
  w->ode.surface = slow_surface;
  w->ode.user = w;
}

static void destroy_world(small_world *w)
{
  hap_session_destroy(w->session);
  dSpaceDestroy(w->space);
  dWorldDestroy(w->world);
}

/* Hands in a row across the cube's way. */
static void start_recording(small_world *w, int hands)
{
  hap_detail detail = {""};
  hap_pointer_def hand_def;
  recorded_setup s = recorded_setup_of("", HAP_MODEL_CONTACT, 0);
  hap_pointer_def_init(&hand_def, sizeof hand_def);
  CHECK(hap_session_create(&w->def, &w->ode, &w->session, &detail) == HAP_OK);
  for (int i = 0; i < hands; ++i) {
    double y = 0.006 * (i - 0.5 * (hands - 1));
    hap_pose pose = {{0.07, y, 0.05}, {1.0, 0.0, 0.0, 0.0}};
    CHECK(hap_pointer_add(w->session, &hand_def, &w->hands[i]) == HAP_OK);
    CHECK(hap_pointer_set_target(w->session, w->hands[i], &pose, NULL) == HAP_OK);
  }
  CHECK(hap_session_record(w->session, &s.record, &detail) == HAP_OK);
  CHECK(hap_session_start(w->session) >= HAP_OK);
}

static hap_stats stop_recording(small_world *w)
{
  hap_stats stats;
  CHECK(hap_session_stop(w->session) == HAP_OK);
  CHECK(hap_session_stats(w->session, &stats, sizeof stats) == HAP_OK);
  destroy_world(w);
  return stats;
}

/* In a world that was built anew. */
static replay play_in(small_world *w)
{
  replay out;
  hap_player *player = NULL;
  memset(&out, 0, sizeof out);
  CHECK(hap_player_open(recorded_path, HAP_PLAY_WHOLE, &player, &out.detail) == HAP_OK);
  CHECK(hap_player_get_def(player, &w->def, &w->expert, &w->research) == HAP_OK);
  CHECK(hap_player_get_info(player, &out.info, sizeof out.info) == HAP_OK);
  CHECK(hap_session_create(&w->def, &w->ode, &w->session, &out.detail) == HAP_OK);
  CHECK(hap_session_play(w->session, player, &out.detail) == HAP_OK);
  rig r = {.session = w->session};
  replay_run(&r, &out);
  CHECK(hap_player_difference(player, &out.difference, sizeof out.difference) == HAP_OK);
  int64_t last = hap_session_now(w->session);
  hap_player_close(player); /* the session was stopped: it needs it no more */
  CHECK(hap_session_now(w->session) == last && last > 0);
  destroy_world(w);
  return out;
}

TEST(a_step_that_takes_long)
{
  small_world w;
  build_world(&w);
  w.sleeps = true;
  start_recording(&w, 1);
  sleep_ms(LONG_MS + 700);
  hap_stats before = stop_recording(&w);
  CHECK(before.faults.stale_times == 1 && before.physics.missed > 100);
  build_world(&w);
  replay again = play_in(&w);
  check_alike(&again, &before);
  CHECK(again.stats.faults.stale_ticks == before.faults.stale_ticks &&
        before.loop.contact_ticks > 10);
}

/* ---- a world that changes ---- */

static dBodyID add_ball(small_world *w, double mass, double x)
{
  dMass m;
  dBodyID ball = dBodyCreate(w->world);
  dMassSetSphereTotal(&m, mass, 0.02);
  dBodySetMass(ball, &m);
  dGeomSetBody(dCreateSphere(w->space, 0.02), ball);
  dBodySetPosition(ball, x, 0.0, 0.05);
  return ball;
}

/* A ball between the hands and the cube is exchanged for another one, which often gets its
 * address. */
static void exchange_balls(void *user, double step_s)
{
  small_world *w = user;
  (void)step_s;
  if (w->guest != NULL && w->steps % 7 == 0) {
    dGeomDestroy(dBodyGetFirstGeom(w->guest));
    dBodyDestroy(w->guest);
    w->guest = NULL;
  }
  if (w->guest == NULL && w->steps % 14 < 10) {
    w->guest = add_ball(w, 0.1 + 0.01 * w->steps, 0.09);
  }
  ++w->steps;
}

TEST(sixteen_hands_and_bodies_that_callbacks_exchange)
{
  small_world w;
  build_world(&w);
  w.def.max_pointers = 16;
  w.ode.before_step = exchange_balls;
  start_recording(&w, 16);
  sleep_ms(900);
  hap_stats before = stop_recording(&w);
  CHECK(before.faults.bodies_lost >= 2 && before.loop.contact_ticks > 10);
  build_world(&w);
  w.ode.before_step = exchange_balls;
  replay again = play_in(&w);
  check_alike(&again, &before);
  CHECK(again.info.pointers == 16 && again.info.edits == 0);
  CHECK(again.stats.faults.bodies_lost == before.faults.bodies_lost);
}

static void cube_surface(void *user, hap_pointer_id pointer, dGeomID geom, hap_surface *io)
{
  (void)user;
  (void)pointer;
  if (dGeomGetBody(geom) != NULL) {
    io->stiffness = 2500.0;
    io->damping = 1.0;
    io->friction_static = 0.9;
    io->friction_dynamic = 0.4;
  }
}

TEST(surfaces_of_their_own)
{
  small_world w;
  build_world(&w);
  w.ode.pointer_surface = cube_surface;
  start_recording(&w, 3);
  sleep_ms(500);
  hap_stats before = stop_recording(&w);
  CHECK(before.loop.contact_ticks > 10);
  build_world(&w);
  w.ode.pointer_surface = cube_surface;
  replay again = play_in(&w);
  check_alike(&again, &before);
  build_world(&w); /* where nobody says so, it is another session */
  again = play_in(&w);
  CHECK(again.difference.what != HAP_DIFFERENCE_NONE);
}

static void push_cube(void *arg)
{
  dBodyAddForce(arg, -300.0, 0.0, 0.0);
}

TEST(edits_and_locks_are_counted_and_drawing_is_none)
{
  small_world w;
  hap_pose poses[2];
  build_world(&w);
  start_recording(&w, 1);
  for (int i = 0; i < 30; ++i) {
    sleep_ms(10);
    (void)hap_session_poses(w.session, hap_session_now(w.session), &w.cube, 1, poses);
    (void)hap_pointer_poses(w.session, w.hands[0], hap_session_now(w.session), poses, poses + 1);
  }
  CHECK(hap_session_post(w.session, push_cube, w.cube) == HAP_OK);
  CHECK(hap_session_post(w.session, push_cube, w.cube) == HAP_OK);
  CHECK(hap_session_lock(w.session) == HAP_OK && hap_session_unlock(w.session) == HAP_OK);
  sleep_ms(300);
  hap_stats before = stop_recording(&w);
  CHECK(before.edits.run == 2 && before.edits.locks == 1);
  build_world(&w);
  replay again = play_in(&w);
  CHECK(again.status == HAP_END && again.info.edits == 3);
  CHECK(again.difference.what != HAP_DIFFERENCE_NONE && again.difference.tick > 100);
}

static void change_model(rig *r, int look)
{
  static const hap_model models[] = {HAP_MODEL_ACCELERANCE, HAP_MODEL_SINGLE, HAP_MODEL_IMPULSE,
                                     HAP_MODEL_CONTACT};
  if (look % 3 == 1) {
    CHECK(hap_session_set_model(r->session, models[look / 3 % 4]) == HAP_OK);
  }
}

TEST(changes_of_model)
{
  recorded_setup s = recorded_setup_of("stack", HAP_MODEL_CONTACT, 900);
  s.meanwhile = change_model;
  (void)check_setup(&s);
}

static void change_time(rig *r, int look)
{
  static const double scales[] = {0.3, 0.0, 0.1, 1.0};
  if (look % 2 == 1) {
    CHECK(hap_session_set_time_scale(r->session, scales[look / 2 % 4]) == HAP_OK);
  }
}

TEST(changes_of_time)
{
  recorded_setup s = recorded_setup_of("stack", HAP_MODEL_CONTACT, 900);
  s.meanwhile = change_time;
  (void)check_setup(&s);
}

static void change_rate(rig *r, int look)
{
  static const double rates[] = {17.0, 120.0, 60.0, 333.0, 1000.0 / 3.0};
  static const hap_model models[] = {HAP_MODEL_CONTACT, HAP_MODEL_SINGLE, HAP_MODEL_IMPULSE};
  CHECK(hap_session_set_physics_hz(r->session, rates[look % 5]) == HAP_OK);
  if (look % 4 == 3) {
    CHECK(hap_session_set_model(r->session, models[look / 4 % 3]) == HAP_OK);
  }
}

TEST(changes_of_rate)
{
  recorded_setup s = recorded_setup_of("stack", HAP_MODEL_CONTACT, 900);
  s.meanwhile = change_rate;
  (void)check_setup(&s);
}

static void ramp_time(rig *r, int look)
{
  CHECK(hap_session_set_time_scale(r->session, 0.2 + 0.05 * (look % 16)) == HAP_OK);
}

TEST(slow_from_the_start)
{
  recorded_setup s = recorded_setup_of("stack", HAP_MODEL_CONTACT, 900);
  s.time_scale = 0.2;
  s.meanwhile = ramp_time;
  (void)check_setup(&s);
}

static hap_pointer_id guest;

static void make_trouble(rig *r, int look)
{
  static atomic_int *const troubles[] = {&fakes[0].fail_read, &fakes[0].fail_write,
                                         &fakes[0].bad_pose};
  hap_pose pose = {{0.5, 0.0, 0.025}, {1.0, 0.0, 0.0, 0.0}};
  hap_pointer_def def;
  hap_pointer_def_init(&def, sizeof def);
  if (look == 1) {
    CHECK(hap_pointer_add(r->session, &def, &guest) == HAP_OK);
  } else if (look < 12) {
    pose.position[0] += 0.001 * look;
    CHECK(hap_pointer_set_target(r->session, guest, &pose, NULL) == HAP_OK || look == 0);
  } else if (look == 12) {
    CHECK(hap_pointer_remove(r->session, guest) == HAP_OK);
  } else if (look == 14) {
    CHECK(hap_pointer_add(r->session, &def, &guest) == HAP_OK);
    CHECK(hap_pointer_set_target(r->session, guest, &pose, NULL) == HAP_OK);
  } else if (look == 16) {
    hap_emergency_zero();
  }
  if (look % 4 == 2 && look < 12) {
    atomic_store(troubles[look / 4], 1);
  } else if (look % 4 == 3 && look < 20) {
    atomic_store(troubles[look / 4 % 3], 0);
    CHECK(hap_session_reset_fault(r->session) == HAP_OK);
  } else if (look == 18) {
    atomic_store(&block_ms, 30);
  } else if (look == 21) {
    atomic_store(&block_ms, 150); /* its watchdog takes the force off */
  }
}

TEST(a_device_with_troubles_and_pointers_that_come_and_go)
{
  rig r;
  recorded_setup s = recorded_setup_of("row10", HAP_MODEL_CONTACT, 1400);
  s.devices[0] = "virtual:path=0:0/0.2/0.025"; /* elsewhere */
  s.meanwhile = make_trouble;
  REQUIRE(recorded_create(&s, &r));
  hap_pointer_id id = add_hand(&r);
  guest.v = 0;
  hap_stats before = recorded_run(&s, &r);
  CHECK(hap_pointer_remove(r.session, id) == HAP_OK);
  rig_destroy(&r);
  hap_device_close(device);
  CHECK(before.faults.count == 5 && before.loop.missed_ticks >= 25 &&
        before.loop.contact_ticks > 10);
  CHECK(before.faults.fault == HAP_FAULT_BLOCKED && before.faults.pointer == id.v);
  replay again = recorded_play("row10", 0);
  check_alike(&again, &before);
  CHECK(again.stats.faults.fault == HAP_FAULT_BLOCKED && again.stats.faults.pointer == id.v);
  CHECK(again.info.pointers == 3);
  CHECK(again.stats.loop.missed_ticks <= before.loop.missed_ticks &&
        again.stats.loop.missed_ticks >=
            before.loop.missed_ticks - 3); /* but for those before the first */
}

static hap_pointer_id lost;

static void lose_and_restart(rig *r, int look)
{
  if (look == 4) {
    atomic_store(&fakes[0].fail_read, 1);
  } else if (look == 6) {
    atomic_store(&fakes[0].fail_read, 0);
    atomic_store(&fakes[0].fail_start, 1);
    CHECK(hap_pointer_restart(r->session, lost) == HAP_ERROR_DEVICE);
  } else if (look == 10) {
    atomic_store(&fakes[0].fail_start, 0);
    CHECK(hap_pointer_restart(r->session, lost) == HAP_OK);
    CHECK(hap_session_reset_fault(r->session) == HAP_OK);
  } else if (look == 14) { /* nothing wrong with it */
    CHECK(hap_pointer_restart(r->session, lost) == HAP_OK);
  }
}

/* In how many ticks the pointer, whose id holds all the time, was out of the world. */
static uint64_t ticks_paused(hap_session *session, hap_pointer_id id, hap_status *out_status)
{
  uint64_t paused = 0;
  hap_pointer_state state;
  for (*out_status = HAP_OK; *out_status >= HAP_OK && *out_status != HAP_END;) {
    *out_status = hap_session_advance(session, 1);
    CHECK(hap_pointer_get(session, id, &state, sizeof state) == HAP_OK);
    paused += state.stamp_ns < hap_session_now(session);
  }
  return paused;
}

TEST(a_device_that_is_started_again)
{
  rig r;
  hap_status status = HAP_OK;
  hap_detail detail = {""};
  hap_stats stats;
  hap_play_difference difference;
  rig_options options;
  recorded_setup s = recorded_setup_of("row10", HAP_MODEL_CONTACT, 1000);
  s.devices[0] = "virtual:path=0:0/0.2/0.025"; /* elsewhere */
  s.meanwhile = lose_and_restart;
  REQUIRE(recorded_create(&s, &r));
  lost = add_hand(&r);
  hap_stats before = recorded_run(&s, &r);
  CHECK(hap_pointer_remove(r.session, lost) == HAP_OK);
  rig_destroy(&r);
  hap_device_close(device);
  CHECK(before.faults.count == 1 && before.loop.contact_ticks > 10);
  rig_options_init(&options);
  options.scene = "row10";
  REQUIRE(hap_player_open(recorded_path, HAP_PLAY_WHOLE, &options.player, &detail) == HAP_OK);
  REQUIRE(rig_create(&options, &r, &detail) == HAP_OK);
  CHECK(hap_session_start(r.session) == HAP_OK);
  CHECK(hap_pointer_restart(r.session, lost) == HAP_ERROR_STATE);
  uint64_t paused = ticks_paused(r.session, lost, &status);
  CHECK(status == HAP_END && paused > 20 && paused < before.loop.ticks / 2);
  CHECK(hap_player_difference(options.player, &difference, sizeof difference) == HAP_OK);
  CHECK(difference.what == HAP_DIFFERENCE_NONE);
  CHECK(hap_session_stats(r.session, &stats, sizeof stats) == HAP_OK);
  CHECK(stats.loop.ticks == before.loop.ticks &&
        stats.loop.contact_ticks == before.loop.contact_ticks);
  CHECK(stats.faults.slewed_ticks == before.faults.slewed_ticks &&
        stats.faults.count == before.faults.count);
  rig_destroy(&r);
  hap_player_close(options.player);
}

/* ---- other drives ---- */

/* Even frames, a loop that stands, frames of more than two steps, more time than three steps. */
static void draw_frames(rig *r)
{
  hap_pose pose;
  for (int frame = 0; frame < 70; ++frame) {
    int ms = frame < 20 ? 15 : frame == 20 ? 150 : frame < 40 ? 40 + frame % 3 : 12;
    sleep_ms(ms);
    double frame_s = frame % 20 == 19 ? 0.2 : frame % 9 == 5 ? 0.0 : 1e-3 * ms;
    (void)hap_session_update(r->session, frame_s);
    (void)hap_session_poses(r->session, hap_session_now(r->session), r->scene->bodies, 1, &pose);
  }
}

TEST(a_frame_loop_with_pauses_and_hitches)
{
  for (int model = HAP_MODEL_IMPULSE; model <= HAP_MODEL_CONTACT; ++model) {
    rig_options options;
    recorded_setup s = recorded_setup_of("row10", (hap_model)model, 0);
    rig_options_init(&options);
    options.scene = s.scene;
    options.def.model = s.model;
    options.def.drive = HAP_DRIVE_FRAME;
    options.record = &s.record;
    rig *r = rig_own(&options);
    hap_pointer_id id = add_hand(r);
    REQUIRE(hap_session_start(r->session) >= HAP_OK);
    draw_frames(r);
    CHECK(hap_pointer_restart(r->session, id) == HAP_OK);
    draw_frames(r);
    hap_stats before;
    CHECK(hap_session_stop(r->session) == HAP_OK);
    CHECK(hap_session_stats(r->session, &before, sizeof before) == HAP_OK);
    tap_release(r);
    hap_device_close(device);
    replay again = recorded_play("row10", 0);
    check_alike(&again, &before);
    CHECK(again.info.edits == 0);
    CHECK(again.stats.faults.stale_ticks == before.faults.stale_ticks &&
          before.faults.stale_times > 10);
    CHECK(again.stats.faults.stale_times == before.faults.stale_times &&
          before.loop.contact_ticks > 10);
    CHECK(again.stats.physics.frames_dropped == before.physics.frames_dropped &&
          before.physics.frames_dropped > 10);
  }
}

TEST(a_frame_loop)
{
  rig_options options;
  recorded_setup s = recorded_setup_of("stack", HAP_MODEL_CONTACT, 0);
  rig_options_init(&options);
  options.scene = s.scene;
  options.def.drive = HAP_DRIVE_FRAME;
  options.record = &s.record;
  rig *r = rig_own(&options);
  REQUIRE(hap_session_start(r->session) >= HAP_OK);
  for (int frame = 0; frame < 60; ++frame) {
    sleep_ms(10 + frame % 7);
    (void)hap_session_update(r->session, frame % 5 == 0 ? 0.05 : 0.011);
  }
  hap_stats before;
  CHECK(hap_session_stop(r->session) == HAP_OK);
  CHECK(hap_session_stats(r->session, &before, sizeof before) == HAP_OK);
  tap_release(r);
  replay again = recorded_play("stack", 0);
  check_alike(&again, &before);
  CHECK(before.physics.steps > 10);
}

/* ---- its end ---- */

static hap_stats run_limited(uint64_t max_bytes, hap_record_state *out_state,
                             hap_status *out_status)
{
  rig r;
  hap_stats stats = {0};
  recorded_setup s = recorded_setup_of("row10", HAP_MODEL_CONTACT, 1000);
  s.ticks = 1000; /* 500 bytes each */
  s.record.max_bytes = max_bytes;
  if (recorded_create(&s, &r)) {
    stats = recorded_run(&s, &r);
    *out_status = hap_session_record_state(r.session, out_state, sizeof *out_state, NULL);
    rig_destroy(&r);
  }
  return stats;
}

TEST(at_its_limit_it_ends_and_the_session_goes_on)
{
  hap_record_state state = {0};
  hap_status status = HAP_OK;
  hap_stats before = run_limited(200000, &state, &status);
  CHECK(status == HAP_RECORD_ENDED && state.end == HAP_RECORD_LIMIT && state.bytes <= 200000);
  CHECK(state.bytes > 100000 && before.loop.ticks > state.ticks + 100 && before.faults.count == 0);
  replay again = recorded_play("row10", 0);
  CHECK(again.status == HAP_END && again.difference.what == HAP_DIFFERENCE_NONE);
  CHECK(again.info.end == HAP_RECORD_LIMIT && again.info.ticks == state.ticks);
  CHECK(again.stats.loop.ticks <= state.ticks && again.stats.loop.ticks + 300 > state.ticks);
}

/* A pipe that nobody reads is a disk that hangs. Only as a standard stream is a pipe written. */
TEST(a_disk_that_hangs_makes_a_gap_that_is_told)
{
  rig r;
  int ends[2];
  char bytes[65536];
  hap_record_state state = {0};
  recorded_setup s = recorded_setup_of("row10", HAP_MODEL_CONTACT, 0);
  s.record.buffer_s = 0.05;
  int kept = dup(STDERR_FILENO);
  REQUIRE(kept >= 0 && pipe(ends) == 0 && dup2(ends[1], STDERR_FILENO) >= 0);
  s.record.path = "/dev/stderr";
  bool runs = recorded_create(&s, &r) && hap_session_start(r.session) >= HAP_OK;
  REQUIRE(dup2(kept, STDERR_FILENO) >= 0 && close(kept) == 0);
  REQUIRE(runs);
  for (int i = 0; i < 200 && state.lost_ticks < 100; ++i) {
    sleep_ms(50);
    (void)hap_session_record_state(r.session, &state, sizeof state, NULL);
  }
  CHECK(state.end == HAP_RECORD_OVERFLOW && state.lost_ticks >= 100);
  hap_stats stats;
  CHECK(hap_session_stats(r.session, &stats, sizeof stats) == HAP_OK && stats.faults.count == 0);
  close(ends[1]);
  FILE *file = fopen(recorded_path, "wb"); /* the disk comes back */
  REQUIRE(file != NULL);
  for (ssize_t got = 1; got > 0;) {
    got = read(ends[0], bytes, sizeof bytes);
    fwrite(bytes, 1, got > 0 ? (size_t)got : 0, file);
  }
  fclose(file);
  close(ends[0]);
  CHECK(hap_session_stop(r.session) == HAP_OK);
  CHECK(hap_session_record_state(r.session, &state, sizeof state, NULL) == HAP_RECORD_ENDED);
  rig_destroy(&r);
  replay again = recorded_play("row10", 0);
  CHECK(again.status == HAP_END && again.difference.what == HAP_DIFFERENCE_NONE);
  CHECK(again.info.end == HAP_RECORD_OVERFLOW && again.info.ticks == state.ticks);
  CHECK(again.stats.loop.ticks <= state.ticks && again.stats.loop.ticks + 100 > state.ticks);
}

TEST(a_full_disk_is_told_and_the_session_goes_on)
{
  rig r;
  struct rlimit before;
  struct rlimit small;
  hap_record_state state = {0};
  hap_detail detail = {""};
  recorded_setup s = recorded_setup_of("row10", HAP_MODEL_CONTACT, 1000);
  s.ticks = 1000;
  fflush(stdout);
  REQUIRE(recorded_create(&s, &r));
  REQUIRE(getrlimit(RLIMIT_FSIZE, &before) == 0);
  small = before;
  small.rlim_cur = 100000;
  REQUIRE(setrlimit(RLIMIT_FSIZE, &small) == 0);
  hap_stats stats = recorded_run(&s, &r);
  REQUIRE(setrlimit(RLIMIT_FSIZE, &before) == 0);
  CHECK(hap_session_record_state(r.session, &state, sizeof state, &detail) == HAP_ERROR_IO);
  CHECK(strstr(detail.text, "File too large") != NULL && state.end == HAP_RECORD_FAILED);
  CHECK(stats.faults.count == 0 && stats.loop.ticks > state.ticks + 100);
  rig_destroy(&r);
  replay cut = recorded_play("row10", 0);
  CHECK(cut.status == HAP_ERROR_FORMAT && strstr(cut.detail.text, "breaks off") != NULL);
  replay again = recorded_play("row10", HAP_PLAY_INCOMPLETE);
  CHECK(again.status == HAP_END && again.difference.what == HAP_DIFFERENCE_NONE);
  CHECK(again.info.end == HAP_RECORD_GOES_ON && again.stats.loop.ticks > 50);
}

/* ---- what is not allowed ---- */

static hap_status record_with(rig *r, hap_record_def def, const char *says)
{
  hap_detail detail = {""};
  hap_status status = hap_session_record(r->session, &def, &detail);
  if (strstr(detail.text, says) == NULL) {
    printf("# \"%s\" does not say \"%s\"\n", detail.text, says);
    CHECK(!"the text");
  }
  return status;
}

TEST(what_cannot_be_recorded_is_refused)
{
  rig r;
  rig_options options;
  hap_detail detail = {""};
  hap_record_def def;
  hap_record_state state;
  rig_options_init(&options);
  options.scene = "fig5";
  REQUIRE(rig_create(&options, &r, &detail) == HAP_OK);
  hap_record_def_init(&def, sizeof def);
  CHECK(hap_session_record_state(r.session, &state, sizeof state, NULL) == HAP_ERROR_STATE);
  CHECK(record_with(&r, def, "path is NULL") == HAP_ERROR_ARGUMENT);
  def.path = "/no/such/folder/a.rec";
  CHECK(record_with(&r, def, "cannot be written: No such file") == HAP_ERROR_IO);
  def.path = recorded_path;
  def.max_bytes = 65535;
  CHECK(record_with(&r, def, "max_bytes is 65535") == HAP_ERROR_ARGUMENT);
  hap_record_def_init(&def, sizeof def);
  def.path = recorded_path;
  def.buffer_s = (double)NAN;
  CHECK(record_with(&r, def, "buffer_s") == HAP_ERROR_ARGUMENT);
  def.buffer_s = 1.0;
  def.note_size = 3;
  CHECK(record_with(&r, def, "note is NULL") == HAP_ERROR_ARGUMENT);
  def.note_size = 0;
  def.cookie = 0;
  CHECK(record_with(&r, def, "hap_record_def_init") == HAP_ERROR_UNINITIALISED);
  if (access("/dev/full", W_OK) == 0) {
    hap_record_def_init(&def, sizeof def);
    def.path = "/dev/full";
    CHECK(record_with(&r, def, "/dev/full: cannot be written: No space left") == HAP_ERROR_IO);
  }
  hap_record_def_init(&def, sizeof def);
  def.path = recorded_path;
  CHECK(hap_session_start(r.session) >= HAP_OK && hap_session_stop(r.session) == HAP_OK);
  CHECK(record_with(&r, def, "has been started before") == HAP_ERROR_STATE);
  rig_destroy(&r);
  options.def.drive = HAP_DRIVE_LOCKSTEP;
  REQUIRE(rig_create(&options, &r, &detail) == HAP_OK);
  CHECK(record_with(&r, def, "lockstep") == HAP_ERROR_STATE);
  rig_destroy(&r);
}

TEST(a_replay_takes_nothing_else)
{
  rig r;
  rig_options options;
  hap_detail detail = {""};
  hap_pointer_def def;
  hap_pointer_id id = {1};
  hap_pose pose = {{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
  recorded_setup s = recorded_setup_of("fig5", HAP_MODEL_CONTACT, 100);
  (void)recorded_make(&s);
  rig_options_init(&options);
  options.scene = "fig5";
  REQUIRE(hap_player_open(recorded_path, HAP_PLAY_WHOLE, &options.player, &detail) == HAP_OK);
  REQUIRE(rig_create(&options, &r, &detail) == HAP_OK);
  hap_pointer_def_init(&def, sizeof def);
  CHECK(hap_pointer_add(r.session, &def, &id) == HAP_ERROR_STATE);
  CHECK(hap_pointer_remove(r.session, id) == HAP_ERROR_STATE);
  CHECK(hap_pointer_restart(r.session, id) == HAP_ERROR_STATE);
  CHECK(hap_pointer_set_target(r.session, id, &pose, NULL) == HAP_ERROR_STATE);
  CHECK(hap_session_set_model(r.session, HAP_MODEL_SINGLE) == HAP_ERROR_STATE);
  CHECK(hap_session_reset_fault(r.session) == HAP_ERROR_STATE);
  CHECK(hap_session_play(r.session, options.player, &detail) == HAP_ERROR_STATE);
  CHECK(hap_session_start(r.session) == HAP_OK);
  CHECK(hap_session_advance(r.session, 10) == HAP_OK);
  int64_t now = hap_session_now(r.session);
  CHECK(hap_session_advance(r.session, 1) == HAP_OK && hap_session_now(r.session) > now);
  CHECK(hap_session_stop(r.session) == HAP_OK);
  CHECK(hap_session_start(r.session) == HAP_ERROR_STATE);
  rig_destroy(&r);
  hap_player_close(options.player);
  rig_options_init(&options); /* with a def and pointers of its own */
  options.scene = "fig5";
  options.def.drive = HAP_DRIVE_LOCKSTEP;
  hap_player *player = NULL;
  REQUIRE(hap_player_open(recorded_path, HAP_PLAY_WHOLE, &player, &detail) == HAP_OK);
  REQUIRE(rig_create(&options, &r, &detail) == HAP_OK);
  CHECK(hap_session_play(r.session, player, &detail) == HAP_ERROR_STATE);
  CHECK(strstr(detail.text, "pointers of its own") != NULL);
  rig_destroy(&r);
  options.def.max_bodies = 10;
  REQUIRE(rig_create(&options, &r, &detail) == HAP_OK);
  CHECK(hap_session_play(r.session, player, &detail) == HAP_ERROR_ARGUMENT);
  rig_destroy(&r);
  hap_player_close(player);
}

SET_UP
{
  return recorded_init();
}
