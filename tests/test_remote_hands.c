/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Several hands' sessions in one world, each with bodies of its own: what each feels is what it
 * feels alone, whoever comes and goes. */

#include "tests/tap.h"

#include "remote/merge.h"
#include "tests/hands_rig.h"

#define SECONDS 3.0
#define TICKS 3000
#define APART 4.0 /* m, between cubes */

static bool cube_surface(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  (void)user;
  (void)a;
  (void)b;
  *io = (dSurfaceParameters){.mode = dContactApprox1, .mu = 0.3};
  return true;
}

/* Rows of three cubes, APART from each other. Those of a row are one surface (local/seams.h): at a
 * slit of 0.1 mm rounding would say when they push twice. */
static hands_rig *cubes_new(double delay)
{
  hands_rig *r = rig_new(delay, RIG_HANDS);
  dCreatePlane(r->space, 0.0, 0.0, 1.0, 0.0);
  r->def.max_bodies = 64;
  r->def.max_contacts = 512;
  for (int i = 0; i < RIG_HANDS; ++i) {
    for (int k = 0; k < 3; ++k) {
      (void)ode_box(r->world, r->space, 0.2, AT(0.05, 0.05, 0.05),
                    AT(0.05001 * k, APART * i, 0.025));
    }
  }
  rig_serve(r, cube_surface);
  session_run(r->session);
  return r;
}

static void cubes_join(hands_rig *r, int which)
{
  hap_pointer_def hand;
  hap_pointer_def_init(&hand, sizeof hand);
  hand.radius = 0.01;
  hand.stiffness = 1000.0;
  hand.friction = 0.3; /* the floor holds the cubes: else rounding would say when one slides */
  rig_join(r, which, &hand);
}

/* Down after a second, and then along the row; each hand with a phase of its own. */
static void hand_move(const hands_rig *r, int which, int tick)
{
  double s = 1e-3 * tick - 1.0 - 0.013 * which;
  double z = s < 0.0 ? 0.1 : fmax(0.1 - 0.2 * s, 0.057);
  double w = 2.0 * M_PI * 0.7;
  double x = s < 0.5 ? 0.0 : 0.02 * (1.0 - cos(w * (s - 0.5)));
  double vx = s < 0.5 ? 0.0 : 0.02 * w * sin(w * (s - 0.5));
  rig_put(r, which, AT(x, APART * which, z), AT(vx, 0.0, s > 0.0 && z > 0.057 ? -0.2 : 0.0));
}

static void felt_finish(void *owned)
{
  (void)owned;
}

/* What a hand feels that is alone in the world. */
static double (*alone_new(double delay, int which))[3]
{
  double(*felt)[3] = tap_own(TICKS * sizeof *felt, felt_finish);
  hands_rig *r = cubes_new(delay);
  cubes_join(r, which);
  for (int i = 0; i < TICKS; ++i) {
    hand_move(r, which, i);
    rig_tick(r);
    rig_feel(r, which, felt[i]);
  }
  tap_release(r);
  return felt;
}

/* RMS of the difference to RMS. */
static double error_of(double (*felt)[3], double (*reference)[3])
{
  double sums[2] = {0.0, 0.0};
  for (int i = 0; i < TICKS; ++i) {
    for (int k = 0; k < 3; ++k) {
      sums[0] += (felt[i][k] - reference[i][k]) * (felt[i][k] - reference[i][k]);
      sums[1] += reference[i][k] * reference[i][k];
    }
  }
  return sqrt(sums[0] / sums[1]);
}

typedef struct hands_case {
  const char *name;
  int count;
  double delay;
} hands_case;

static const hands_case cases[] = {
    {"two, 0 ms", 2, 0.0}, {"two, 50 ms", 2, 0.05}, {"sixteen, 50 ms", 16, 0.05}};

TEST_EACH(cases, const hands_case *row)
{
  static double felt[RIG_HANDS][TICKS][3];
  hands_rig *r = cubes_new(row->delay);
  for (int i = 0; i < row->count; ++i) {
    cubes_join(r, i);
  }
  for (int t = 0; t < TICKS; ++t) {
    for (int i = 0; i < row->count; ++i) {
      hand_move(r, i, t);
    }
    rig_tick(r);
    for (int i = 0; i < row->count; ++i) {
      rig_feel(r, i, felt[i][t]);
    }
  }
  hap_remote_state world = rig_state(r->session);
  hap_stats stats = session_stats(r->session);
  printf("# %u hands, momentum %.2g N s of %.3g not there\n", world.joined,
         stats.hand.momentum_error_ns, stats.hand.impulse_abs_ns);
  CHECK(world.joined == (uint32_t)row->count && world.joins == (uint64_t)row->count);
  CHECK(world.refused == 0 && world.failed == 0 && world.bounded == 0 && world.turned_away == 0);
  CHECK(stats.hand.momentum_error_ns < 1e-9);
  for (int i = 0; i<row->count; i += row->count> 2 ? 5 : 1) {
    hap_remote_state of = rig_state(r->hands[i].session);
    double error = error_of(felt[i], alone_new(row->delay, i));
    printf("# hand %d: %.4f %% off, %.1f and %.1f kB/s\n", i, 100.0 * error,
           1e-3 * (double)of.figures.received_bytes / SECONDS,
           1e-3 * (double)of.figures.sent_bytes / SECONDS);
    CHECK(error <= 0.002);
    CHECK(of.refused == 0 && of.failed == 0);
  }
}

/* One goes, another one comes in its place; the third one feels nothing of it. */
TEST(hands_come_and_go_and_the_others_do_not_feel_it)
{
  static double felt[TICKS][3];
  hands_rig *r = cubes_new(0.03);
  for (int i = 0; i < 3; ++i) {
    cubes_join(r, i);
  }
  for (int t = 0; t < TICKS; ++t) {
    if (t == 1500) {
      rig_leave(r, 0);
    }
    if (t == 1600) {
      cubes_join(r, 4);
    }
    if (t == 1700) {
      cubes_join(r, 5);
      rig_leave(r, 2);
    }
    for (int i = 0; i < 6; ++i) {
      if (r->hands[i].session != NULL) {
        hand_move(r, i, i < 3 ? t : t - 1000); /* above its cube at first */
      }
    }
    rig_tick(r);
    rig_feel(r, 1, felt[t]);
  }
  double error = error_of(felt, alone_new(0.03, 1));
  hap_remote_state world = rig_state(r->session);
  hap_stats stats = session_stats(r->session);
  printf("# %.4f %% off, momentum %.2g N s not there\n", 100.0 * error,
         stats.hand.momentum_error_ns);
  CHECK(error <= 0.002);
  CHECK(world.joined == 3 && world.joins == 5);
  CHECK(stats.hand.momentum_error_ns < 1e-9);
  for (int i = 4; i < 6; ++i) {
    double force[3];
    rig_feel(r, i, force);
    CHECK_NEAR(force[2], 3.0, 0.05);
  }
}

/* max_pointers is the room for hands of all sessions. */
TEST(a_hand_for_which_there_is_no_room_is_told_so)
{
  hands_rig *r = rig_new(0.01, 2);
  dCreatePlane(r->space, 0.0, 0.0, 1.0, 0.0);
  rig_serve(r, cube_surface);
  session_run(r->session);
  for (int i = 0; i < 3; ++i) {
    cubes_join(r, i);
  }
  for (int t = 0; t < 500; ++t) {
    for (int i = 0; i < 3; ++i) {
      hand_move(r, i, t);
    }
    rig_tick(r);
  }
  hap_detail why;
  hap_remote_state state;
  CHECK(hap_session_remote_state(r->hands[2].session, &state, sizeof state, &why) == HAP_OK);
  printf("# %s\n", why.text);
  CHECK(state.turned_away == 1 && strstr(why.text, "2 hands' sessions already") != NULL);
  CHECK(rig_state(r->session).joined == 2);
  CHECK(rig_state(r->hands[0].session).joined == 1);
  /* And a second pointer of one that is there. */
  hap_pointer_def hand;
  hap_pointer_id second;
  hap_pointer_def_init(&hand, sizeof hand);
  REQUIRE(hap_pointer_add(r->hands[0].session, &hand, &second) == HAP_OK);
  const hap_pose pose = {{0.0, 0.0, 0.5}, {1.0, 0.0, 0.0, 0.0}};
  CHECK(hap_pointer_set_target(r->hands[0].session, second, &pose, NULL) == HAP_OK);
  for (int t = 500; t < 700; ++t) {
    rig_tick(r);
  }
  CHECK(hap_session_remote_state(r->hands[0].session, &state, sizeof state, &why) == HAP_OK);
  printf("# %s\n", why.text);
  CHECK(state.turned_away == 1 && strstr(why.text, "max_pointers") != NULL);
  CHECK(rig_state(r->session).joined == 1);
}

TEST(two_hands_of_one_name_cannot_be)
{
  hands_rig *r = rig_new(0.01, 4);
  hap_link *links[2];
  hap_detail why;
  rig_serve(r, cube_surface);
  REQUIRE(hap_link_local_connect(r->link, "hand", NULL, NULL, &links[0], NULL) == HAP_OK);
  CHECK(hap_link_local_connect(r->link, "hand", NULL, NULL, &links[1], &why) == HAP_ERROR_STATE);
  CHECK(strstr(why.text, "hand") != NULL);
  hap_link_close(links[0]);
}

/* ---- totals ---- */

/* The guest's loop has given so much to the body of slot 0 since it came. */
static void guest_gives(hapi_merge_from *from, uint32_t which, hapi_exchange *exchange,
                        double impulse, double hand_impulse)
{
  hapi_state *told = hapi_exchange_state_back(exchange);
  hapi_guest *guest = &from->guests[which];
  guest->bodies[0].generation = 1;
  told->body_high = 1;
  hapi_state_bodies(told)[0] = (hapi_state_body){.generation = 1, .impulse = {impulse}};
  told->hand_impulse[0] = hand_impulse;
  from->shares->of[0].of = (uint8_t)which;
  hapi_guest_take(guest, 0, told, hapi_exchange_message_size(exchange, HAPI_CHANNEL_STATE),
                  from->shares->of, (uint8_t)which);
}

/* Physics takes differences of totals: a total that falls as a loop goes would push bodies back. */
TEST(what_a_loop_gave_stays_given_when_it_goes)
{
  const hapi_capacity capacity = {.bodies = 2, .contacts = 2, .pointers = 2};
  static const uint8_t contact_guests[2];
  hapi_exchange *exchange;
  hapi_exchange *out;
  hapi_shares shares = {0};
  hapi_merge merge = {0};
  hapi_guest guests[2] = {{.taken = 0}};
  REQUIRE(hapi_exchange_create(&capacity, &exchange) == HAP_OK);
  REQUIRE(hapi_exchange_create(&capacity, &out) == HAP_OK);
  REQUIRE(hapi_shares_create(&shares, &capacity) && hapi_merge_create(&merge, &capacity));
  hapi_merge_from from = {
      .shares = &shares, .guests = guests, .count = 2, .contact_guests = contact_guests};
  for (int i = 0; i < 2; ++i) {
    REQUIRE(hapi_guest_create(&guests[i], exchange, 0.1) == HAP_OK);
  }
  shares.of[0].generation = 1;
  hapi_state *sum = hapi_exchange_state_back(out);
  guest_gives(&from, 0, exchange, 1.0, 3.0);
  REQUIRE(hapi_merge_make(&merge, &from, sum, &capacity));
  CHECK_NEAR(hapi_state_bodies(sum)[0].impulse[0], 1.0, 0.0);
  guests[0].fresh = false;
  hapi_merge_leave(&merge, &shares, &guests[0]);
  hapi_shares_leave(&shares, 0);
  hapi_guest_begin(&guests[0], 0, &capacity);
  guest_gives(&from, 1, exchange, 0.25, 0.5);
  REQUIRE(hapi_merge_make(&merge, &from, sum, &capacity));
  CHECK_NEAR(hapi_state_bodies(sum)[0].impulse[0], 1.25, 0.0);
  CHECK_NEAR(sum->hand_impulse[0], 3.5, 0.0);
  for (int i = 0; i < 2; ++i) {
    hapi_guest_finish(&guests[i]);
  }
  hapi_merge_finish(&merge);
  hapi_shares_finish(&shares);
  hapi_exchange_destroy(exchange);
  hapi_exchange_destroy(out);
}
