/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Hands' sessions that tell of more than a hand can do, and those that come when the world has one;
 * and that the bound on them lets pass what moves hard without a hand. */

#include "tests/tap.h"

#include "tests/far_rig.h"
#include "tests/logged.h"

#define CUBE 0.2        /* kg */
#define FORCE 100.0     /* N: 0.1 m of the pointer's 1000 N/m */
#define SPEED 10.0      /* m/s */
#define SAVED_S 0.1     /* s, of energy */
#define HELD_S 1.0      /* s, of force */
#define TURN_AWAY_S 1.0 /* s */

/* ---- a codec that lies ---- */

#define BODIES_LIED 8 /* what a client has room for */

typedef enum lie {
  LIE_NONE,
  LIE_IMPULSE,
  LIE_MOMENT,
  LIE_INFINITE,
  LIE_SPEED,
  LIE_SPIN,
  LIE_PLACE,
  LIE_GROWTH,
  LIE_ENERGY, /* 40 J in each message: what is saved up would allow one of them */
  LIE_SHOVES, /* 20 N s in each message, likewise */
  LIE_LEFT,
  LIE_SLOW,
  LIE_NEXT,  /* of bodies that are not known yet */
  LIE_OTHERS /* of bodies that were never told to it */
} lie;

typedef struct liar {
  hapi_codec inner;
  lie kind;
  double growth; /* m/s */
  double shoves; /* N s, so far */
  int64_t left_ns;
} liar;

static void body_lie(liar *l, hapi_state *state, hapi_state_body *io)
{
  const uint32_t owned = HAPI_BODY_OWNED;
  bool flies = l->kind == LIE_SPEED || l->kind == LIE_SPIN || l->kind == LIE_PLACE ||
               l->kind == LIE_GROWTH || l->kind == LIE_ENERGY || l->kind == LIE_SLOW;
  io->flags = flies ? io->flags | owned : io->flags & ~owned;
  io->impulse[0] += l->kind == LIE_IMPULSE ? 1e9 : l->kind == LIE_INFINITE ? HUGE_VAL : 0.0;
  io->impulse[0] += l->shoves;
  io->angular_impulse[2] += l->kind == LIE_MOMENT ? 1e9 : 0.0;
  io->twist.linear[0] = l->kind == LIE_SPEED ? 1e6 : l->kind == LIE_SLOW ? 1.0 : l->growth;
  io->twist.angular[2] += l->kind == LIE_SPIN ? 1e6 : 0.0;
  io->pose.position[0] += l->kind == LIE_PLACE ? 1e3 : 0.0;
  state->time_scale = l->kind == LIE_SLOW ? 1e-9 : state->time_scale;
  if (l->kind == LIE_LEFT) {
    io->owned_until_ns = l->left_ns = l->left_ns + 1000000;
    io->owned_pose = io->pose;
    io->owned_twist = (hap_twist){{0.0, 1e6, 0.0}, {0.0, 0.0, 1e6}};
  }
  if (l->kind == LIE_NEXT) {
    ++io->generation;
    io->impulse[0] = 1e9;
  }
}

static void others_lie(hapi_state *state, uint32_t slot)
{
  hapi_state_body *body = &hapi_state_bodies(state)[slot];
  state->body_high = BODIES_LIED;
  if (body->generation == 0) {
    *body = (hapi_state_body){.generation = 1,
                              .flags = HAPI_BODY_OWNED,
                              .pose = {{0.0, 0.0, 0.03}, {1.0, 0.0, 0.0, 0.0}},
                              .twist = {{0.0, 0.0, 0.1}, {0.0, 0.0, 0.0}},
                              .impulse = {0.0, 0.0, 1e-3 * (double)state->tick}};
  }
}

static hap_status liar_send(void *self, void *const messages[2], const hapi_codec_out *out,
                            hap_detail *detail)
{
  liar *l = self;
  hapi_state *state = messages[0];
  hapi_state_body truth[BODIES_LIED]; /* the loop goes on with its own */
  const uint32_t high = state->body_high;
  REQUIRE(high <= BODIES_LIED);
  memcpy(truth, hapi_state_bodies(state), sizeof truth);
  l->growth = l->kind == LIE_GROWTH   ? fmax(1.1 * l->growth, 0.1)
              : l->kind == LIE_ENERGY ? sqrt(l->growth * l->growth + 2.0 * 40.0 / CUBE)
                                      : 0.0;
  l->shoves += l->kind == LIE_SHOVES ? 20.0 : 0.0;
  for (uint32_t i = 0; l->kind == LIE_OTHERS && i < BODIES_LIED; ++i) {
    others_lie(state, i);
  }
  for (uint32_t i = 0; i < state->body_high && l->kind < LIE_OTHERS && l->kind != LIE_NONE; ++i) {
    if (hapi_state_bodies(state)[i].generation != 0) {
      body_lie(l, state, &hapi_state_bodies(state)[i]);
    }
  }
  hap_status status = l->inner.send(l->inner.self, messages, out, detail);
  memcpy(hapi_state_bodies(state), truth, sizeof truth);
  state->body_high = high;
  return status;
}

static hap_status liar_take(void *self, const hap_link_event *event, hap_detail *detail)
{
  liar *l = self;
  return l->inner.take(l->inner.self, event, detail);
}

static bool liar_give(void *self, void *const messages[2])
{
  liar *l = self;
  return l->inner.give(l->inner.self, messages);
}

static void liar_reset(void *self)
{
  liar *l = self;
  l->inner.reset(l->inner.self);
}

static void client_make_liar(client *c, liar *l, lie kind)
{
  hapi_codec *codec = &c->far.loop.end.codec;
  *l = (liar){.inner = *codec, .kind = kind, .left_ns = 1000000};
  *codec = (hapi_codec){l, liar_send, liar_take, liar_give, liar_reset};
}

/* ---- what bodies do, by ODE's figures ---- */

static double cube_energy(const server *s)
{
  const dReal *v = dBodyGetLinearVel(s->cube);
  const dReal *w = dBodyGetAngularVel(s->cube);
  const double inertia = CUBE * 0.05 * 0.05 / 6.0;
  return 0.5 * CUBE * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) +
         0.5 * inertia * (w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
}

typedef struct lie_case {
  const char *name;
  lie kind;
} lie_case;

static const lie_case lies[] = {
    {"impulse", LIE_IMPULSE}, {"moment", LIE_MOMENT},    {"infinite", LIE_INFINITE},
    {"speed", LIE_SPEED},     {"spin", LIE_SPIN},        {"place", LIE_PLACE},
    {"growth", LIE_GROWTH},   {"energy", LIE_ENERGY},    {"shoves", LIE_SHOVES},
    {"left", LIE_LEFT},       {"slow motion", LIE_SLOW}, {"next", LIE_NEXT},
};

/* With a telling of nothing but 1e9 N s, 1e6 m/s or a speed that grows by a tenth in each message,
 * or of what is possible once, again and again, the cube gets no more than the pointer can give.
 * Then another hand has the world. */
TEST_EACH(lies, const lie_case *row)
{
  server *s = server_open();
  client *c = client_open(s, "liar", 1000.0, 8);
  liar l;
  double most = 0.0;
  double farthest = 0.0;
  client_put(c, 0.0, 0.07, 0.0);
  ends_run(s, c, 600); /* an honest begin: it knows the cube */
  logged[0] = '\0';
  log_listen(true);
  client_make_liar(c, &l, row->kind);
  for (int i = 0; i < 3000; ++i) {
    ends_run(s, c, 1);
    double energy = cube_energy(s) - FORCE * SPEED * (SAVED_S + 1e-3 * i);
    double momentum = sqrt(2.0 * CUBE * cube_energy(s)) - FORCE * (HELD_S + 1e-3 * i);
    const dReal *at = dBodyGetPosition(s->cube);
    most = fmax(most, row->kind == LIE_SHOVES ? momentum : energy);
    farthest = fmax(farthest, hypot(at[0], at[1]));
    REQUIRE(isfinite(at[0]) && isfinite(energy));
  }
  log_listen(false);
  const hapi_world_end *world = &s->far.world;
  printf("# %s: %llu not taken, %.3g J or N s over the bound, %.3g m away\n", row->name,
         (unsigned long long)world->bounded, most, farthest);
  CHECK(most <= 1e-3);
  CHECK(farthest < 200.0 || row->kind == LIE_SHOVES); /* a push by its time alone may throw it */
  if (row->kind != LIE_NEXT) {
    CHECK(world->bounded > 5 && world->turned_away == 1 && !world->end.joined);
    CHECK(strstr(logged, "its device can") != NULL);
    CHECK(c->far.loop.turned_away && strstr(c->far.loop.end.detail.text, "its device") != NULL);
  }
  tap_release(c);
  ends_run(s, NULL, 300);
  dBodySetPosition(s->cube, 0.0, 0.0, 0.025);
  dBodySetLinearVel(s->cube, 0.0, 0.0, 0.0);
  dBodySetAngularVel(s->cube, 0.0, 0.0, 0.0);
  const dQuaternion upright = {1.0, 0.0, 0.0, 0.0};
  dBodySetQuaternion(s->cube, upright);
  CHECK_NEAR(hand_press(s, client_open(s, "honest", 1000.0, 8)), 3.0, 0.02);
  CHECK(world->end.joined);
}

/* A device that tells 1e9 N may do what the server allows, and no more. */
TEST(the_smaller_of_told_and_allowed_limits_counts)
{
  server *s = server_open();
  client *c = client_open(s, "strong", 1000.0, 8);
  s->far.world.guests[0].bound.most = (hapi_limits){2.0, 1.0};
  c->far.loop.limits = (hapi_limits){1e9, 1e9};
  ends_run(s, c, 300);
  CHECK(s->far.world.guests[0].admitted);
  CHECK(s->far.world.guests[0].bound.limits.force == 2.0 &&
        s->far.world.guests[0].bound.limits.speed == 1.0);
}

/* ---- beside an honest one ---- */

static const lie_case beside[] = {
    {"impulse, beside another", LIE_IMPULSE}, {"infinite, beside another", LIE_INFINITE},
    {"speed, beside another", LIE_SPEED},     {"place, beside another", LIE_PLACE},
    {"left, beside another", LIE_LEFT},       {"others, beside another", LIE_OTHERS},
};

/* What a client tells disturbs its own bodies alone, also where it tells of those of another. */
TEST_EACH(beside, const lie_case *row)
{
  server *s = server_open_for(cube_surface, 2);
  client *c = client_open(s, "honest", 1000.0, 8);
  client *other = client_open(s, "liar", 1000.0, 8);
  dBodyID own = ode_box(s->world, s->space, CUBE, AT(0.05, 0.05, 0.05), AT(5.0, 0.0, 0.025));
  liar l;
  double force[3];
  double least = 1e9;
  client_put(c, 0.0, 0.2, 0.0);
  client_put(other, 5.0, 0.07, 0.0);
  for (int i = 0; i < 4000; ++i) {
    if (i == 500) {
      client_put(c, 0.0, 0.057, 0.0);
    }
    if (i == 1500) {
      client_make_liar(other, &l, row->kind);
    }
    ends_run(s, c, 1);
    ends_run(NULL, other, 1);
    client_feel(c, force);
    least = i > 1400 ? fmin(least, force[2]) : least;
    REQUIRE(i < 1400 || fabs(force[2] - 3.0) < 0.02);
  }
  const hapi_world_end *world = &s->far.world;
  printf("# %s: %llu not taken, %.3f N at least; the liar's cube at %.2g m\n", row->name,
         (unsigned long long)world->bounded, least, dBodyGetPosition(own)[0]);
  CHECK_NEAR(dBodyGetPosition(s->cube)[2], 0.025, 5e-4);
  CHECK(world->joined == (row->kind == LIE_OTHERS ? 2 : 1));
  CHECK(other->far.loop.turned_away == (row->kind != LIE_OTHERS));
  CHECK(!c->far.loop.turned_away);
}

/* As many messages as the network takes, of one of two. */
TEST(a_client_that_floods_is_turned_away_and_the_other_does_not_feel_it)
{
  server *s = server_open_for(cube_surface, 2);
  client *c = client_open(s, "honest", 1000.0, 8);
  client *other = client_open(s, "flood", 1000.0, 8);
  const hap_link_address to = {.channel = HAPI_STAMPS_CHANNEL};
  hap_detail why = {""};
  double force[3];
  client_put(c, 0.0, 0.2, 0.0);
  client_put(other, 5.0, 0.2, 0.0);
  for (int i = 0; i < 4000; ++i) {
    if (i == 500) {
      client_put(c, 0.0, 0.057, 0.0);
    }
    for (int k = 0; i > 1500 && k < 100; ++k) {
      hap_status sent =
          hap_link_send_newest(other->link, hap_session_now(other->session), &to, "flood", 5);
      CHECK(sent >= HAP_OK);
    }
    ends_run(s, c, 1);
    ends_run(NULL, other, 1);
    client_feel(c, force);
    REQUIRE(i < 1400 || fabs(force[2] - 3.0) < 0.02);
  }
  CHECK(other->far.loop.turned_away);
  why = other->far.loop.end.detail;
  printf("# %s; %llu refused\n", why.text, (unsigned long long)s->far.world.end.refused);
  CHECK(strstr(why.text, "messages come from it") != NULL);
  CHECK(s->far.world.joined == 1);
}

/* A body is moved by who was told to, from the model on that told so, to the last one. */
TEST(a_loop_moves_what_it_was_given_and_nothing_else)
{
  server *s = server_open();
  hapi_guest *guest = &s->far.world.guests[0];
  hapi_state *state = hapi_exchange_state_back(s->far.world.cut);
  static const struct {
    uint64_t model;
    uint32_t generation;
    bool owned;
    bool told;
  } rows[] = {{9, 5, true, true}, {10, 5, false, true}, {11, 5, false, false}, {9, 4, true, false}};
  for (size_t i = 0; i < sizeof rows / sizeof rows[0]; ++i) {
    hap_detail why;
    hapi_guest_begin(guest, 0, &s->far.world.terms.capacity);
    guest->bodies[3] = (hapi_guest_body){.generation = 5, .mine_to = 10, .owned_to = 9};
    state->body_high = 4;
    state->model_number = rows[i].model;
    memset(hapi_state_bodies(state), 0, 4 * sizeof(hapi_state_body));
    hapi_state_bodies(state)[3].generation = rows[i].generation;
    guest->bound.of[3].generation = rows[i].generation;
    hapi_state_bodies(state)[3].flags = HAPI_BODY_OWNED;
    CHECK(hapi_guest_admit(guest, 0, state, &why));
    const hapi_state_body *body = &hapi_state_bodies(state)[3];
    CHECK((body->generation != 0) == rows[i].told);
    CHECK(!rows[i].told || ((body->flags & HAPI_BODY_OWNED) != 0) == rows[i].owned);
  }
}

static double limit_of(const server *s)
{
  return s->far.world.guests[0].bound.limits.force;
}

/* What is set while the session runs counts too; what falls is not told. */
TEST(a_pointer_that_is_made_stiffer_later_may_push_more)
{
  server *s = server_open();
  client *c = client_open(s, "hand", 1000.0, 8);
  hap_pointer_settings settings;
  hap_pointer_settings_init(&settings, sizeof settings);
  ends_run(s, c, 300);
  CHECK_NEAR(limit_of(s), 100.0, 1e-9); /* 0.1 m of 1000 N/m */
  settings.mask = HAP_SET_STIFFNESS;
  settings.stiffness = 2500.0;
  CHECK(hap_pointer_set(c->session, c->hand, &settings) == HAP_OK);
  ends_run(s, c, 300);
  CHECK_NEAR(limit_of(s), 250.0, 1e-9);
  settings.stiffness = 500.0;
  for (int i = 0; i < 10; ++i) { /* to and fro, which adds up to nothing */
    settings.stiffness = i % 2 == 0 ? 500.0 : 2500.0;
    CHECK(hap_pointer_set(c->session, c->hand, &settings) == HAP_OK);
  }
  ends_run(s, c, 300);
  CHECK_NEAR(limit_of(s), 250.0, 1e-9);
  settings.mask = HAP_SET_LIMITS | HAP_SET_MOTION_SCALE | HAP_SET_FORCE_SCALE;
  settings.max_force = settings.max_torque = 280.0;
  settings.motion_scale = settings.force_scale = 1.0;
  CHECK(hap_pointer_set(c->session, c->hand, &settings) == HAP_OK);
  ends_run(s, c, 300);
  CHECK_NEAR(limit_of(s), 280.0, 1e-9);
  settings.mask = HAP_SET_STIFFNESS;
  settings.stiffness = -1.0;
  CHECK(hap_pointer_set(c->session, c->hand, &settings) == HAP_ERROR_ARGUMENT);
  settings.stiffness = 9000.0; /* the world allows 300 N */
  CHECK(hap_pointer_set(c->session, c->hand, &settings) == HAP_OK);
  ends_run(s, c, 300);
  CHECK_NEAR(limit_of(s), 300.0, 1e-9);
  CHECK(c->session->ferry.limits.force == 900.0);
  CHECK(hap_pointer_remove(c->session, c->hand) == HAP_OK);
  CHECK(c->session->ferry.limits.force == 0.0);
}

/* ---- honest ones: heavy bodies that fall, jump, are driven and edited near a hand ---- */

static bool bouncy_surface(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  (void)user;
  (void)a;
  (void)b;
  *io = (dSurfaceParameters){
      .mode = dContactApprox1 | dContactBounce, .mu = 0.5, .bounce = 0.9, .bounce_vel = 0.01};
  return true;
}

static void honest_check(const server *s)
{
  CHECK(s->far.world.end.joined && s->far.world.guests[0].admitted);
  CHECK(s->far.world.bounded == 0 && s->far.world.turned_away == 0);
  if (s->far.world.end.detail.text[0] != '\0') {
    printf("# %s\n", s->far.world.end.detail.text);
  }
}

TEST(heavy_bodies_that_fall_and_jump_are_within_the_bound)
{
  server *s = server_open_with(bouncy_surface);
  client *c = client_open(s, "hand", 1000.0, 8);
  for (int i = 0; i < 4; ++i) {
    double mass = pow(10.0, i);
    dBodyID body =
        ode_box(s->world, s->space, mass, AT(0.1, 0.1, 0.1), AT(0.15 * i - 0.2, 0.15, 2.0 + i));
    dBodySetAngularVel(body, 1.0, 2.0, 3.0);
  }
  for (int i = 0; i < 8000; ++i) {
    client_put(c, 0.1 * sin(3e-3 * i), 0.06 + 0.02 * sin(5e-3 * i), 0.3 * cos(3e-3 * i));
    ends_run(s, c, 1);
  }
  honest_check(s);
}

/* A kinematic bat of 2 m/s hits 5 kg again and again. */
TEST(what_driven_bodies_hit_is_within_the_bound)
{
  server *s = server_open_with(bouncy_surface);
  client *c = client_open(s, "hand", 1000.0, 8);
  dBodyID ball = ode_box(s->world, s->space, 5.0, AT(0.1, 0.1, 0.1), AT(0.4, 0.0, 0.05));
  dBodyID bat = ode_box(s->world, s->space, 1.0, AT(0.1, 0.6, 0.6), AT(0.8, 0.0, 0.3));
  dBodySetKinematic(bat);
  client_put(c, 0.0, 0.057, 0.0);
  for (int i = 0; i < 6000; ++i) {
    dBodySetLinearVel(bat, -2.0 * cos(6.283e-3 * i), 0.0, 0.0);
    ends_run(s, c, 1);
    if (i % 2000 == 1999) {
      dBodySetPosition(ball, 0.3, 0.0, 0.3);
      dBodySetLinearVel(ball, -3.0, 0.0, 0.0);
    }
  }
  honest_check(s);
}

static bool belt_surface(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  (void)user;
  (void)a;
  (void)b;
  *io = (dSurfaceParameters){.mode = dContactApprox1 | dContactMotion1, .mu = 0.8, .motion1 = 3.0};
  return true;
}

/* A floor that moves with 3 m/s, as a conveyor, takes bodies of 20 kg along. The hand, of 2 N and
 * 1 m/s at most, gives next to nothing. */
TEST(what_a_conveyor_takes_along_is_within_the_bound)
{
  server *s = server_open_with(belt_surface);
  const hapi_limits weak = {2.0, 1.0};
  hapi_world_end_limit(&s->far.world, &weak);
  client *c = client_open(s, "hand", 1000.0, 8);
  dBodyID boxes[3];
  for (int i = 0; i < 3; ++i) {
    boxes[i] = ode_box(s->world, s->space, 20.0, AT(0.1, 0.1, 0.1), AT(0.2 * i, 0.3, 0.05));
  }
  double fastest = 0.0;
  client_put(c, 0.0, 0.2, 0.0);
  for (int i = 0; i < 6000; ++i) {
    ends_run(s, c, 1);
    const dReal *v = dBodyGetLinearVel(boxes[i % 3]);
    fastest = fmax(fastest, hypot(v[0], v[1]));
    if (i % 1000 == 999) { /* back to the hand, at rest */
      dBodySetPosition(boxes[i / 1000 % 3], 0.1, -0.3, 0.3);
      dBodySetLinearVel(boxes[i / 1000 % 3], 0.0, 0.0, 0.0);
    }
  }
  printf("# %.2f m/s\n", fastest);
  CHECK(fastest > 2.0);
  honest_check(s);
}

/* The application throws the cube at the hand with 30 m/s, and carries 50 kg up by a force. */
TEST(what_the_application_does_is_within_the_bound)
{
  server *s = server_open();
  client *c = client_open(s, "hand", 1000.0, 8);
  dBodyID lifted = ode_box(s->world, s->space, 50.0, AT(0.1, 0.1, 0.1), AT(-0.2, 0.0, 0.05));
  client_put(c, 0.0, 0.057, 0.0);
  for (int i = 0; i < 6000; ++i) {
    if (i % 1500 == 700) {
      dBodySetPosition(s->cube, 2.0, 0.0, 0.06);
      dBodySetLinearVel(s->cube, -30.0, 0.0, 0.0);
    }
    dBodyAddForce(lifted, 0.0, 0.0, 520.0);
    ends_run(s, c, 1);
  }
  honest_check(s);
}

/* A second without any state: what the hand gave meanwhile comes at once. */
TEST(an_outage_of_a_second_is_within_the_bound)
{
  server *s = server_open();
  client *c = client_open(s, "hand", 1000.0, 8);
  hap_link_path_def cut;
  hap_link_path_def_init(&cut, sizeof cut);
  cut.delay = 0.5 * ROUND_TRIP;
  const hap_link_path_def good = cut;
  CHECK_NEAR(hand_press(s, c), 3.0, 0.02);
  cut.loss = 1.0;
  CHECK(hap_link_local_set_paths(c->clock.inner, &cut, &good) == HAP_OK);
  for (int i = 0; i < 1000; ++i) { /* to the side, with the cube */
    client_put(c, 3e-4 * i, 0.057, 0.3);
    ends_run(s, c, 1);
  }
  CHECK(hap_link_local_set_paths(c->clock.inner, &good, &good) == HAP_OK);
  ends_run(s, c, 500);
  printf("# the cube is at %.3f m\n", dBodyGetPosition(s->cube)[0]);
  CHECK(dBodyGetPosition(s->cube)[0] > 0.1);
  honest_check(s);
}

/* ---- those that come second ---- */

TEST(a_second_hand_is_told_that_the_world_has_one)
{
  server *s = server_open();
  client *c = client_open(s, "hand", 1000.0, 8);
  ends_run(s, c, 300);
  client *second = client_open(s, "other", 1000.0, 8);
  for (int i = 0; i < 500; ++i) {
    ends_run(s, c, 1);
    CHECK(hap_session_advance(second->session, 1) == HAP_OK);
  }
  CHECK(second->far.loop.turned_away && !second->far.loop.agreed);
  CHECK(strstr(second->far.loop.end.detail.text, "has a hand's session already") != NULL);
  CHECK(s->far.world.turned_away == 1 && s->far.world.end.joined);
  CHECK_NEAR(hand_press(s, c), 3.0, 0.02);
  hap_link *same;
  hap_detail why;
  CHECK(hap_link_local_connect(s->link, "hand", NULL, NULL, &same, &why) == HAP_ERROR_STATE);
}

TEST(a_refusal_is_text_and_nothing_else_is_one)
{
  unsigned char bytes[HAPI_REFUSAL_BYTES_MOST + 1];
  hap_detail text;
  uint32_t size = hapi_refusal_write("no\nroom", bytes);
  REQUIRE(hapi_refusal_read(bytes, size, &text));
  CHECK(strcmp(text.text, "no?room") == 0);
  hapi_terms terms;
  CHECK(hapi_terms_read(bytes, size, &terms, &text) == HAP_ERROR_FORMAT);
  for (uint32_t i = 0; i <= 16; ++i) {
    CHECK(!hapi_refusal_read(bytes, i, &text));
  }
  CHECK(!hapi_refusal_read(bytes, HAPI_REFUSAL_BYTES_MOST + 1, &text));
  bytes[0] ^= 1;
  CHECK(!hapi_refusal_read(bytes, size, &text));
  char longest[1000];
  memset(longest, 'a', sizeof longest - 1);
  longest[sizeof longest - 1] = '\0';
  size = hapi_refusal_write(longest, bytes);
  CHECK(size == HAPI_REFUSAL_BYTES_MOST && hapi_refusal_read(bytes, size, &text));
  CHECK(strlen(text.text) == HAPI_REFUSAL_BYTES_MOST - 16);
  const hapi_terms good = {.look_ahead_s = 0.25, .period_s = 0.02, .haptic_hz = 1000.0};
  unsigned char told[HAPI_TERMS_BYTES];
  hapi_terms_write(&good, told);
  CHECK(!hapi_refusal_read(told, sizeof told, &text));
}
