/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Two hands on one cube, each in a session of its own: squeeze, push and tap, by hands that are
 * tense, relaxed or rigid, at 0 to 100 ms one way. The reference is both hands in the world's
 * session. */

#include "tests/tap.h"

#include "bench/remote_hands.h"
#include "haptic/haptic_internal.h"
#include "physics/physics_internal.h"
#include "session/session_internal.h"
#include "tests/hands_rig.h"

#define EDGE 0.1      /* m */
#define MASS 1.0      /* kg */
#define STIFFNESS 2e3 /* N/m */
#define RADIUS 0.01   /* m */

static void run_finish(void *owned)
{
  (void)owned;
}

static bool cube_surface(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  (void)user;
  (void)a;
  (void)b;
  *io = (dSurfaceParameters){.mode = dContactApprox1, .mu = 0.3};
  return true;
}

typedef struct pair_run {
  hands_rig *rig;
  dBodyID cube;
} pair_run;

static pair_run *run_with(double delay, const hap_pointer_def *def)
{
  pair_run *run = tap_own(sizeof *run, run_finish);
  hands_rig *r = run->rig = rig_new(delay, 4);
  dCreatePlane(r->space, 0.0, 0.0, 1.0, 0.0);
  run->cube = ode_box(r->world, r->space, MASS, AT(EDGE, EDGE, EDGE), AT(0.0, 0.0, 0.5 * EDGE));
  rig_serve(r, cube_surface);
  if (delay >= 0.0) {
    session_run(r->session);
  }
  rig_join(r, 0, def);
  rig_join(r, 1, def);
  if (delay < 0.0) {
    session_run(r->session);
  }
  return run;
}

static pair_run *run_new(double delay)
{
  hap_pointer_def hand;
  hap_pointer_def_init(&hand, sizeof hand);
  hand.radius = RADIUS;
  hand.stiffness = STIFFNESS;
  hand.friction = 0.5;
  return run_with(delay, &hand);
}

/* ---- two hands do something with it ---- */

static void task_run(remote_hands *run)
{
  hap_detail why;
  REQUIRE_SAY(remote_hands_run(run, &why) >= HAP_OK, "%s", why.text);
}

typedef struct shared_case {
  const char *name;
  remote_task what;
} shared_case;

static const shared_case tasks[] = {
    {"squeeze", REMOTE_SQUEEZE}, {"push", REMOTE_PUSH}, {"tap", REMOTE_TAP}};

TEST_EACH(tasks, const shared_case *row)
{
  static const double delays[] = {0.0, 0.01, 0.05, 0.1};
  static remote_hands reference;
  static remote_hands run;
  for (int g = 0; g < 3; ++g) {
    reference =
        (remote_hands){.task = row->what, .grip = (remote_grip)g, .delay_s = REMOTE_HANDS_HERE};
    task_run(&reference);
    run = (remote_hands){.task = row->what, .grip = (remote_grip)g, .delay_s = REMOTE_HANDS_ODE};
    task_run(&run);
    printf("# %s, %s, ODE alone at 1 kHz: the reference is off by %.3f\n", row->name,
           remote_grips[g], remote_hands_error(&reference, &run));
    CHECK(remote_hands_error(&reference, &run) <= 0.004); /* 0.002 measured */
    for (int d = 0; d < 4; ++d) {
      run = (remote_hands){.task = row->what, .grip = (remote_grip)g, .delay_s = delays[d]};
      task_run(&run);
      double error = remote_hands_error(&run, &reference);
      double peak = remote_hands_peak(&run, &reference);
      printf(
          "# %s, %s, %3.0f ms: error %.2f, peak %.2f; cube at %.1f mm, %.1f; %.1f mm apart, "
          "%.2f left; %.1f and %.1f kB/s\n",
          row->name, remote_grips[g], 1e3 * delays[d], error, peak, 1e3 * run.place,
          1e3 * reference.place, 1e3 * run.apart, 1e3 * run.left, 1e-3 * run.bytes_down,
          1e-3 * run.bytes_up);
      CHECK(run.refused == 0);
      CHECK(peak <= 3.5);
      CHECK(delays[d] > 0.01 || error <= 0.4);
      CHECK(run.apart <= 0.025 && run.left <= 1e-3);
    }
  }
}

/* ---- hands that come near and go ---- */

/* Hand 0 presses on the top from above, 3 mm in, and takes the cube along; the other one comes near
 * and goes again. */
TEST(a_hand_that_comes_near_and_goes_is_not_felt)
{
  static const double delays[] = {0.0, 0.05, 0.1};
  for (int d = 0; d < 3; ++d) {
    pair_run *run = run_new(delays[d]);
    hands_rig *r = run->rig;
    double before[3] = {0.0};
    double step = 0.0;
    double least = HUGE_VAL;
    for (int i = 0; i < 9000; ++i) {
      double s = 1e-3 * i;
      double z = EDGE + RADIUS + fmax(0.05 - 0.1 * fmax(s - 1.0, 0.0), -0.003);
      double far = s < 4.0   ? 5.0
                   : s < 6.0 ? fmax(5.0 - 3.0 * (s - 4.0), 0.4)
                             : fmin(0.4 + 3.0 * (s - 6.0), 5.0);
      double v = s > 4.0 && far > 0.4 && far < 5.0 ? (s < 6.0 ? -3.0 : 3.0) : 0.0;
      rig_put(r, 0, AT(0.0, 0.0, z), AT(0.0, 0.0, 0.0));
      rig_put(r, 1, AT(far, 0.0, 0.5), AT(v, 0.0, 0.0));
      rig_tick(r);
      double force[3];
      rig_feel(r, 0, force);
      for (int k = 0; k < 3 && i > 3000; ++k) {
        step = fmax(step, fabs(force[k] - before[k]));
      }
      least = i > 3000 ? fmin(least, force[2]) : least;
      memcpy(before, force, sizeof before);
    }
    printf("# %3.0f ms: steps of %.3f N at most, %.3f N at least\n", 1e3 * delays[d], step, least);
    CHECK(step < 0.005);
    CHECK_NEAR(least, 6.0, 0.1); /* the world's cube rests elsewhere in the layer of 0.1 mm */
    tap_release(run->rig);
    tap_release(run);
  }
}

#define BESIDE_TICKS 4000

/* Hand 0 pushes the cube 4 cm along and back off it, while the other one is so near that the cube
 * is shared from 50 ms on, and does nothing. out: force of hand 0. */
static void push_beside_idle(double delay, double out[BESIDE_TICKS][3])
{
  hap_pointer_def hand;
  hap_pointer_def_init(&hand, sizeof hand);
  hand.radius = RADIUS;
  hand.stiffness = STIFFNESS;
  hand.damping = 50.0; /* it does not bounce along */
  pair_run *run = run_with(delay, &hand);
  for (int i = 0; i < BESIDE_TICKS; ++i) {
    const double s = fmin(fmax(1e-3 * (i - 1500) / 2.0, 0.0), 1.0); /* of the way */
    const double x = -0.02 + 0.03 * (1.0 - cos(2.0 * M_PI * s));
    const double v = s > 0.0 && s < 1.0 ? 0.03 * M_PI * sin(2.0 * M_PI * s) : 0.0;
    rig_put(run->rig, 0, AT(x - 0.5 * EDGE - RADIUS, 0.0, 0.5 * EDGE), AT(v, 0.0, 0.0));
    rig_put(run->rig, 1, AT(0.3, 0.0, 0.5 * EDGE), AT(0.0, 0.0, 0.0));
    rig_tick(run->rig);
    rig_feel(run->rig, 0, out[i]);
  }
  CHECK(delay < 0.0 || rig_state(run->rig->session).shared == (delay >= 0.05));
  tap_release(run->rig);
  tap_release(run);
}

TEST(a_hand_beside_an_idle_one_feels_nearly_what_it_feels_in_the_world)
{
  static const double delays[] = {0.0, 0.01, 0.05, 0.1};
  static double felt[BESIDE_TICKS][3];
  static double here[BESIDE_TICKS][3];
  push_beside_idle(-1.0, here);
  for (int d = 0; d < 4; ++d) {
    double off = 0.0;
    double all = 0.0;
    push_beside_idle(delays[d], felt);
    for (int i = 0; i < BESIDE_TICKS; ++i) {
      double apart[3];
      hapi_v3_sub(felt[i], here[i], apart);
      off += hapi_v3_dot(apart, apart);
      all += hapi_v3_dot(here[i], here[i]);
    }
    printf("# %3.0f ms: %.4f off, RMS %.2f N\n", 1e3 * delays[d], sqrt(off / all),
           sqrt(all / BESIDE_TICKS));
    CHECK(sqrt(off / all) <= (delays[d] >= 0.05 ? 0.15 : 1e-3));
  }
}

/* An application hears of its own pointer alone. */
TEST(touches_of_another_session_s_hand_are_not_told)
{
  pair_run *run = run_new(0.05);
  hands_rig *r = run->rig;
  int own = 0;
  int others = 0;
  int copies = 0;
  for (int i = 0; i < 3000; ++i) {
    double in = i < 1000 ? 0.02 : fmax(0.02 - 1e-4 * (i - 1000), -0.002);
    for (int k = 0; k < 2; ++k) {
      rig_put(r, k, AT((k == 0 ? -1.0 : 1.0) * (0.5 * EDGE + RADIUS + in), 0.0, 0.5 * EDGE),
              AT(0.0, 0.0, 0.0));
    }
    rig_tick(r);
    hap_event event;
    size_t count = 0;
    while (hap_session_events(r->hands[0].session, &event, 1, sizeof event, &count) == HAP_OK) {
      own += event.pointer.v == r->hands[0].id.v;
      others += event.pointer.v != r->hands[0].id.v;
    }
    const hapi_pointers *pointers = &r->hands[0].session->haptic->tick.pointers;
    copies = i == 2900 ? (int)pointers->high : copies;
  }
  CHECK(copies == 2); /* the other one is there */
  CHECK(rig_state(r->session).shared == 1);
  CHECK(own > 0 && others == 0);
}

/* A proxy stays at the surface, and so its pose alone would not push: hand 0 pushes the cube 20 mm
 * along, against friction, beside the world and apart. */
TEST(a_proxy_pushes_the_cube_of_all)
{
  static const double delays[] = {-1.0, 0.05};
  double place[2];
  double felt[2][3];
  for (int d = 0; d < 2; ++d) {
    hap_pointer_def hand;
    hap_pointer_expert_def expert;
    hap_pointer_research_def research;
    pointer_defs_init(&hand, &expert, &research);
    hand.radius = RADIUS;
    hand.stiffness = STIFFNESS;
    expert.coupling = HAP_COUPLING_PROXY;
    expert.coupling_stiffness = 1000.0;
    pair_run *run = run_with(delays[d], &hand);
    hands_rig *r = run->rig;
    for (int i = 0; i < 4000; ++i) {
      double in = i < 1000 ? -0.02 : fmin(2e-5 * (i - 1000) - 0.02, 0.02);
      rig_put(r, 0, AT(in - 0.5 * EDGE - RADIUS, 0.0, 0.5 * EDGE),
              AT(i > 1000 && in < 0.02 ? 0.02 : 0.0, 0.0, 0.0));
      rig_put(r, 1, AT(0.3, 0.0, 0.5 * EDGE), AT(0.0, 0.0, 0.0));
      rig_tick(r);
    }
    rig_feel(r, 0, felt[d]);
    place[d] = dBodyGetPosition(run->cube)[0];
    tap_release(run->rig);
    tap_release(run);
  }
  printf("# cube at %.2f mm, %.2f beside; %.3f N, %.3f beside\n", 1e3 * place[1], 1e3 * place[0],
         felt[1][0], felt[0][0]);
  CHECK(place[0] > 0.015);
  CHECK_NEAR(place[1], place[0], 1e-3);
  CHECK_NEAR(felt[1][0], felt[0][0], 0.6); /* friction holds any 2.9 N */
}

/* The other hand presses on the side and its session is gone at once, while the first one presses
 * on the top. */
TEST(a_session_that_dies_is_not_felt_by_the_other_one)
{
  pair_run *run = run_new(0.05);
  hands_rig *r = run->rig;
  double before[3] = {0.0};
  double step = 0.0;
  for (int i = 0; i < 5000; ++i) {
    double down = i < 1000 ? 0.05 : fmax(0.05 - 1e-4 * (i - 1000), -0.003);
    double in = i < 2000 ? 0.02 : fmax(0.02 - 1e-4 * (i - 2000), -0.001);
    double force[3];
    rig_put(r, 0, AT(0.0, 0.0, EDGE + RADIUS + down), AT(0.0, 0.0, 0.0));
    if (i == 4000) {
      rig_leave(r, 1);
    } else if (i < 4000) {
      rig_put(r, 1, AT(0.5 * EDGE + RADIUS + in, 0.0, 0.5 * EDGE), AT(0.0, 0.0, 0.0));
    }
    rig_tick(r);
    rig_feel(r, 0, force);
    for (int k = 0; k < 3 && i > 3900; ++k) {
      step = fmax(step, fabs(force[k] - before[k]));
    }
    memcpy(before, force, sizeof before);
  }
  printf("# steps of %.4f N at most, %.3f N at the end\n", step, before[2]);
  CHECK(step < 0.02);
  CHECK_NEAR(before[2], 6.0, 0.1);
  CHECK(rig_state(r->session).joined == 1);
}

typedef struct pile_course {
  const char *name;
  unsigned random;
} pile_course;

static const pile_course pile_courses[] = {{"hands_come_and_go_in_a_pile", 12345},
                                           {"hands_come_and_go_in_another_pile", 7919000},
                                           {"hands_come_and_go_and_throw_nothing", 205894}};

/* Four hands, one of them a cube, go about at random in a pile with a hinge; they come and go, and
 * messages are lost, doubled and late. Nothing flies off, and what hands gave is counted. */
TEST_EACH(pile_courses, const pile_course *row)
{
  static const double corners[8][3] = {
      {-0.01, -0.01, -0.01}, {0.01, -0.01, -0.01}, {-0.01, 0.01, -0.01}, {0.01, 0.01, -0.01},
      {-0.01, -0.01, 0.01},  {0.01, -0.01, 0.01},  {-0.01, 0.01, 0.01},  {0.01, 0.01, 0.01}};
  hands_rig *r = rig_new(0.03, 6);
  dBodyID bodies[8];
  unsigned random = row->random;
  double wish[4][3];
  double at[4][3];
  r->jitter = 0.02;
  r->loss = 0.05;
  r->expert.look_ahead = 0.2;
  r->def.max_contacts = 512;
  dCreatePlane(r->space, 0.0, 0.0, 1.0, 0.0);
  for (int i = 0; i < 8; ++i) {
    const int layer = i / 4;
    bodies[i] = ode_box(r->world, r->space, 0.2 + 0.1 * i, AT(0.06, 0.06, 0.06),
                        AT(0.07 * (i % 4), 0.03 * layer, 0.031 + 0.061 * layer));
  }
  dJointID hinge = dJointCreateHinge(r->world, NULL);
  dJointAttach(hinge, bodies[0], bodies[1]);
  dJointSetHingeAnchor(hinge, 0.035, 0.0, 0.031);
  dJointSetHingeAxis(hinge, 0.0, 0.0, 1.0);
  rig_serve(r, cube_surface);
  session_run(r->session);
  for (int t = 0; t < 12000; ++t) {
    for (int i = 0; i < 4; ++i) {
      random = random * 1103515245u + 12345u;
      bool here = r->hands[i].session != NULL;
      if (t % 1000 == 250 * i && (!here || random >> 29 == 0)) {
        hap_pointer_def hand;
        rig_leave(r, i);
        hap_pointer_def_init(&hand, sizeof hand);
        hand.stiffness = 800.0;
        hand.friction = 0.4;
        hand.radius = i == 3 ? 0.002 : 0.01;
        hand.hull_xyz = i == 3 ? corners[0] : NULL;
        hand.hull_points = i == 3 ? 8 : 0;
        rig_join(r, i, &hand);
        hapi_v3_set(at[i], -0.2, 0.3 * i - 0.4, 0.3);
        hapi_v3_copy(at[i], wish[i]);
      }
      if (r->hands[i].session == NULL) {
        continue;
      }
      if (t % 400 == 100 * i) {
        hapi_v3_set(wish[i], 0.3 * ((random >> 8) % 1000) / 1000.0 - 0.03,
                    0.2 * ((random >> 12) % 1000) / 1000.0 - 0.08,
                    0.15 * ((random >> 16) % 1000) / 1000.0);
      }
      double v[3];
      for (int k = 0; k < 3; ++k) {
        v[k] = fmin(fmax(5.0 * (wish[i][k] - at[i][k]), -0.3), 0.3);
        at[i][k] += 1e-3 * v[k];
      }
      rig_put(r, i, at[i], v);
    }
    rig_tick(r);
    for (int i = 0; i < 8; ++i) {
      const dReal *place = dBodyGetPosition(bodies[i]);
      REQUIRE(hapi_v3_norm(place) < 3.0 && place[2] > -0.02);
      REQUIRE(hapi_v3_norm(dBodyGetLinearVel(bodies[i])) < 5.0);
    }
  }
  hap_remote_state state = rig_state(r->session);
  hap_stats stats = session_stats(r->session);
  printf("# %llu joined, %llu shared, momentum %.2g N s not there, %llu rejected\n",
         (unsigned long long)state.joins, (unsigned long long)state.shared,
         stats.hand.momentum_error_ns, (unsigned long long)stats.faults.states_rejected);
  CHECK(state.joins > 6 && state.refused == 0 && state.bounded == 0 && state.turned_away == 0);
  CHECK(stats.faults.states_rejected == 0);
  for (int i = 0; i < 4; ++i) {
    CHECK(r->hands[i].session == NULL || session_stats(r->hands[i].session).faults.count == 0);
  }
}

/* ---- momentum ---- */

/* A cube in free space: both hands push it about, one comes later, one is gone at once. What hands
 * gave is what the cube has. */
TEST(the_momentum_of_a_shared_cube_is_what_hands_gave_to_it)
{
  static const double delays[] = {0.0, 0.01, 0.1};
  for (int d = 0; d < 3; ++d) {
    pair_run *run = tap_own(sizeof *run, run_finish);
    hap_pointer_def hand;
    hands_rig *r = run->rig = rig_new(delays[d], 4);
    dWorldSetGravity(r->world, 0.0, 0.0, 0.0);
    run->cube = ode_box(r->world, r->space, MASS, AT(EDGE, EDGE, EDGE), AT(0.0, 0.0, 0.0));
    rig_serve(r, cube_surface);
    hap_pointer_def_init(&hand, sizeof hand);
    hand.radius = RADIUS;
    hand.stiffness = STIFFNESS;
    session_run(r->session);
    rig_join(r, 0, &hand);
    rig_join(r, 1, &hand);
    double given = 0.0;
    double worst = 0.0;
    const double *counted = r->session->physics->account.counts.hand_impulse;
    for (int i = 0; i < 6000; ++i) {
      double s = 1e-3 * i;
      for (int k = 0; k < 2 && r->hands[k].session != NULL; ++k) { /* each follows the cube */
        double side = k == 0 ? -1.0 : 1.0;
        double far = k == 1 && s < 2.0 ? 4.0 : 0.0;
        double in = 0.004 * fmax(sin(2.0 * M_PI * (k == 0 ? 1.0 : 1.3) * s), 0.0) - 0.002;
        in = s < 1.0 || s > 5.0 ? -0.05 : in;
        double x = dBodyGetPosition(run->cube)[0] + side * (0.5 * EDGE + RADIUS - in + far);
        rig_put(r, k, AT(x, 0.0, 0.0), AT(0.0, 0.0, 0.0));
      }
      if (i == 4000) {
        rig_leave(r, 1);
      }
      rig_tick(r);
      given = fmax(given, fabs(counted[0]));
      /* Of the newest state that physics has had. */
      double p = MASS * dBodyGetLinearVel(run->cube)[0];
      worst = fmax(worst, fabs(p - counted[0]));
    }
    double p = MASS * dBodyGetLinearVel(run->cube)[0];
    printf("# %3.0f ms: %.4f N s given at most, %.2g N s not there in between, %.2g at the end\n",
           1e3 * delays[d], given, worst, fabs(p - counted[0]));
    CHECK(given > 0.05);
    CHECK(worst <= 1e-5); /* a velocity on its way is rounded to 4e-6 m/s */
    CHECK(fabs(p - counted[0]) <= 1e-5);
    tap_release(run->rig);
    tap_release(run);
  }
}
