/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* hapode/remote.h: sessions with a world and sessions with a hand, by the public API; in lockstep
 * over the link inside the process, and in threads over datagrams of the loopback interface. */

#include "tests/tap.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <hapode/hapode.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include "tests/logged.h"
#include "tests/ode_world.h"

#define MS 1000000LL

/* ---- datagrams: a transport that knows the headers alone; on loopback all of them arrive ---- */

#define CABLE_HEAD 5 /* what it is, channel, part, reliable; and JOIN and LEAVE for the other end */
#define CABLE_MESSAGE 0
#define CABLE_JOIN 1
#define CABLE_LEAVE 2

typedef struct cable {
  int socket;
  bool server;
  bool joined;
  bool told; /* that it joins */
  unsigned char in[CABLE_HEAD + HAP_LINK_RELIABLE_MOST];
} cable;

static void cable_put(const cable *c, unsigned char what, const hap_link_parcel *parcel)
{
  unsigned char out[CABLE_HEAD + HAP_LINK_RELIABLE_MOST] = {what};
  size_t size = CABLE_HEAD;
  if (parcel != NULL) {
    out[1] = (unsigned char)parcel->to.channel;
    out[2] = (unsigned char)parcel->to.part;
    out[3] = (unsigned char)parcel->reliable;
    memcpy(out + CABLE_HEAD, parcel->data, parcel->bytes);
    size += parcel->bytes;
  }
  (void)send(c->socket, out, size, 0);
}

static hap_status cable_send(void *self, int64_t now_ns, const hap_link_parcel *parcel,
                             hap_detail *detail)
{
  cable *c = self;
  (void)now_ns;
  if (!c->joined) {
    snprintf(detail->text, sizeof detail->text, "nobody is at the other end");
    return HAP_ERROR_NOT_FOUND;
  }
  cable_put(c, CABLE_MESSAGE, parcel);
  return HAP_OK;
}

static hap_status cable_poll(void *self, int64_t now_ns, hap_link_event *out, hap_detail *detail)
{
  cable *c = self;
  (void)now_ns;
  (void)detail;
  if (!c->server && !c->told) {
    cable_put(c, CABLE_JOIN, NULL);
    c->told = true;
  }
  ssize_t size = 0;
  do { /* what is left of another client goes */
    size = recv(c->socket, c->in, sizeof c->in, MSG_DONTWAIT);
    if (size < CABLE_HEAD) {
      return HAP_END;
    }
  } while (c->in[0] == CABLE_MESSAGE && !c->joined);
  out->peer = c->server ? 1 : HAP_LINK_SERVER;
  if (c->in[0] == CABLE_JOIN) {
    out->kind = HAP_LINK_JOINED;
    out->data = "cable";
    c->joined = true;
    if (c->server) {
      cable_put(c, CABLE_JOIN, NULL);
    }
    return HAP_OK;
  }
  if (c->in[0] == CABLE_LEAVE) {
    out->kind = HAP_LINK_LEFT;
    c->joined = false;
    return HAP_OK;
  }
  out->channel = c->in[1];
  out->part = c->in[2];
  out->reliable = c->in[3];
  out->bytes = (uint32_t)size - CABLE_HEAD;
  out->data = c->in + CABLE_HEAD;
  return HAP_OK;
}

static void cable_close(void *self)
{
  cable *c = self;
  cable_put(c, CABLE_LEAVE, NULL);
  close(c->socket);
}

static const hap_link_ops cable_ops = {.abi = HAP_LINK_ABI,
                                       .size = sizeof(hap_link_ops),
                                       .name = "cable",
                                       .send = cable_send,
                                       .poll = cable_poll,
                                       .close = cable_close};

/* Two sockets of the loopback interface that know each other. */
static void cables_open(cable of[2])
{
  struct sockaddr_in at[2];
  for (int i = 0; i < 2; ++i) {
    socklen_t size = sizeof at[i];
    of[i] = (cable){.socket = socket(AF_INET, SOCK_DGRAM, 0), .server = i == 0};
    memset(&at[i], 0, sizeof at[i]);
    at[i].sin_family = AF_INET;
    at[i].sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    REQUIRE(of[i].socket >= 0);
    REQUIRE(bind(of[i].socket, (struct sockaddr *)&at[i], sizeof at[i]) == 0);
    REQUIRE(getsockname(of[i].socket, (struct sockaddr *)&at[i], &size) == 0);
  }
  for (int i = 0; i < 2; ++i) {
    REQUIRE(connect(of[i].socket, (struct sockaddr *)&at[1 - i], sizeof at[1 - i]) == 0);
  }
}

/* ---- a world and a hand ---- */

typedef struct side {
  dWorldID world;
  dSpaceID space;
  dBodyID cube;
  hap_session_def def;
  hap_expert_def expert;
  hap_research_def research;
  hap_session *session;
  hap_pointer_id hand;
  hap_link *link;
} side;

static void side_finish(void *owned)
{
  side *s = owned;
  ode_world_end(s->session, s->world, s->space);
  hap_link_close(s->link);
}

static side *side_new(hap_drive drive)
{
  side *s = tap_own(sizeof *s, side_finish);
  session_defs_init(&s->def, &s->expert, &s->research);
  s->def.drive = drive;
  s->def.physics_hz = 50.0;
  s->def.rt_priority = 0;
  s->def.max_bodies = 8;
  s->def.max_contacts = 64;
  s->def.expert = &s->expert;
  s->expert.look_ahead = 0.2;
  return s;
}

static void side_create(side *s, bool filled)
{
  hap_ode_def ode;
  ode_world_make(filled ? 9.81 : 0.0, &s->world, &s->space);
  if (filled) {
    ode_world_stiffen(s->world, 100);
    dCreatePlane(s->space, 0.0, 0.0, 1.0, 0.0);
    s->cube = ode_box(s->world, s->space, 0.2, AT(0.05, 0.05, 0.05), AT(0.0, 0.0, 0.025));
  }
  hap_ode_def_init(&ode, sizeof ode);
  ode.world = s->world;
  ode.space = s->space;
  s->session = session_make(&s->def, &ode);
}

static void side_add_hand(side *s)
{
  hap_pointer_def hand;
  hap_pointer_def_init(&hand, sizeof hand);
  hand.radius = 0.01;
  hand.stiffness = 1000.0;
  REQUIRE(hap_pointer_add(s->session, &hand, &s->hand) == HAP_OK);
}

static void side_put(const side *s, double z)
{
  const hap_pose pose = {{0.0, 0.0, z}, {1.0, 0.0, 0.0, 0.0}};
  CHECK(hap_pointer_set_target(s->session, s->hand, &pose, NULL) == HAP_OK);
}

static double side_feel(const side *s)
{
  hap_pointer_state state;
  CHECK(hap_pointer_get(s->session, s->hand, &state, sizeof state) >= HAP_OK);
  return state.wrench.force[2];
}

static hap_remote_state side_state(const side *s)
{
  hap_remote_state state;
  hap_detail detail;
  CHECK(hap_session_remote_state(s->session, &state, sizeof state, &detail) == HAP_OK);
  if (state.refused + state.failed > 0) {
    printf("# %s\n", detail.text);
  }
  return state;
}

static const char *side_detail(const side *s)
{
  static hap_detail detail;
  CHECK(hap_session_detail(s->session, &detail) == HAP_OK);
  return detail.text;
}

/* ---- lockstep ---- */

TEST(a_hand_is_served_by_the_public_api_in_lockstep)
{
  side *world = side_new(HAP_DRIVE_LOCKSTEP);
  side *hand = side_new(HAP_DRIVE_LOCKSTEP);
  hap_link_path_def path;
  hap_link_path_def_init(&path, sizeof path);
  path.delay = 0.05;
  path.loss = 0.05;
  side_create(world, true);
  side_create(hand, false);
  side_add_hand(hand);
  REQUIRE(hap_link_local_serve(&world->link, NULL) == HAP_OK);
  REQUIRE(hap_link_local_connect(world->link, "", &path, &path, &hand->link, NULL) == HAP_OK);
  REQUIRE(hap_session_serve(world->session, world->link) == HAP_OK);
  REQUIRE(hap_session_connect(hand->session, hand->link) == HAP_OK);
  CHECK(side_state(hand).joined == 0 && side_state(world).joins == 0);
  session_run(world->session);
  session_run(hand->session);
  for (int i = 0; i < 2000; ++i) {
    side_put(hand, i < 700 ? 0.2 : 0.057);
    CHECK(hap_session_advance(hand->session, 1) == HAP_OK);
    CHECK(hap_session_advance(world->session, 1) == HAP_OK);
  }
  CHECK_NEAR(side_feel(hand), 3.0, 0.02);
  hap_remote_state state = side_state(hand);
  CHECK(state.joined == 1 && state.joins == 1 && state.refused == 0 && state.failed == 0);
  CHECK_NEAR(state.round_trip_s, 0.1, 2e-3);
  CHECK_NEAR(state.clock_ahead_s, 0.0, 2e-3);
  CHECK_NEAR(state.look_ahead, 0.2, 1e-12);
  CHECK(state.figures.received > 80 && state.figures.sent > 80);
  CHECK(side_state(world).joined == 1 && side_state(world).refused == 0);
  tap_release(hand);
  CHECK(hap_session_advance(world->session, 200) == HAP_OK);
  CHECK(side_state(world).joined == 0 && side_state(world).joins == 1);
}

/* ---- threads ---- */

static bool wait_for(const side *hand, double low, double high)
{
  for (int i = 0; i < 10000; ++i) {
    double force = side_feel(hand);
    if (force >= low && force <= high) {
      return true;
    }
    usleep(1000);
  }
  printf("# the force is %g N\n", side_feel(hand));
  return false;
}

TEST(in_threads_over_datagrams_a_hand_feels_joins_leaves_and_comes_again)
{
  static cable cables[2];
  side *world = side_new(HAP_DRIVE_THREADS);
  side_create(world, true);
  cables_open(cables);
  REQUIRE(hap_link_create(&cable_ops, &cables[0], &world->link, NULL) == HAP_OK);
  REQUIRE(hap_session_serve(world->session, world->link) == HAP_OK);
  REQUIRE(hap_session_start(world->session) >= HAP_OK);
  for (int round = 0; round < 2; ++round) {
    side *hand = side_new(HAP_DRIVE_THREADS);
    side_create(hand, false);
    side_add_hand(hand);
    side_put(hand, 0.2);
    cables[1].socket = round == 0 ? cables[1].socket : dup(cables[1].socket);
    REQUIRE(hap_link_create(&cable_ops, &cables[1], &hand->link, NULL) == HAP_OK);
    REQUIRE(hap_session_connect(hand->session, hand->link) == HAP_OK);
    REQUIRE(hap_session_start(hand->session) >= HAP_OK);
    for (int i = 0; i < 5000 && side_state(hand).joined == 0; ++i) {
      usleep(1000);
    }
    CHECK(side_state(hand).joined == 1);
    usleep(300000);
    side_put(hand, 0.057);
    CHECK(wait_for(hand, 2.95, 3.05));
    CHECK(side_state(hand).refused == 0 && side_state(world).refused == 0);
    CHECK(side_state(hand).round_trip_s < 1.0);
    int keep = dup(cables[1].socket);
    tap_release(hand); /* closes its socket */
    cables[1] = (cable){.socket = keep};
    for (int i = 0; i < 5000 && side_state(world).joined == 1; ++i) {
      usleep(1000);
    }
    CHECK(side_state(world).joined == 0 && side_state(world).joins == (uint64_t)round + 1);
  }
  close(cables[1].socket);
}

/* The server's process ends without a word: its messages stop. */
TEST(in_threads_a_world_that_falls_silent_is_felt_as_nothing)
{
  static cable cables[2];
  side *world = side_new(HAP_DRIVE_THREADS);
  side *hand = side_new(HAP_DRIVE_THREADS);
  side_create(world, true);
  side_create(hand, false);
  side_add_hand(hand);
  side_put(hand, 0.2);
  cables_open(cables);
  REQUIRE(hap_link_create(&cable_ops, &cables[0], &world->link, NULL) == HAP_OK);
  REQUIRE(hap_link_create(&cable_ops, &cables[1], &hand->link, NULL) == HAP_OK);
  REQUIRE(hap_session_serve(world->session, world->link) == HAP_OK);
  REQUIRE(hap_session_connect(hand->session, hand->link) == HAP_OK);
  REQUIRE(hap_session_start(world->session) >= HAP_OK);
  REQUIRE(hap_session_start(hand->session) >= HAP_OK);
  for (int i = 0; i < 5000 && side_state(hand).joined == 0; ++i) {
    usleep(1000);
  }
  usleep(300000);
  side_put(hand, 0.057);
  CHECK(wait_for(hand, 2.95, 3.05));
  REQUIRE(hap_session_lock(world->session) == HAP_OK); /* physics stands still */
  CHECK(wait_for(hand, -1e-9, 1e-9));
  REQUIRE(hap_session_unlock(world->session) == HAP_OK);
  CHECK(wait_for(hand, 2.95, 3.05)); /* and comes back */
  hap_stats stats;
  CHECK(hap_session_stats(hand->session, &stats, sizeof stats) == HAP_OK);
  CHECK(stats.faults.stale_times >= 1 && stats.faults.count == 0);
}

/* Frames of 16 ms for two seconds: the hand comes down in the middle. */
TEST(a_world_in_a_frame_loop_is_felt_in_another_session)
{
  static cable cables[2];
  side *world = side_new(HAP_DRIVE_FRAME);
  side *hand = side_new(HAP_DRIVE_THREADS);
  side_create(world, true);
  side_create(hand, false);
  side_add_hand(hand);
  side_put(hand, 0.2);
  cables_open(cables);
  REQUIRE(hap_link_create(&cable_ops, &cables[0], &world->link, NULL) == HAP_OK);
  REQUIRE(hap_link_create(&cable_ops, &cables[1], &hand->link, NULL) == HAP_OK);
  REQUIRE(hap_session_serve(world->session, world->link) == HAP_OK);
  REQUIRE(hap_session_connect(hand->session, hand->link) == HAP_OK);
  REQUIRE(hap_session_start(world->session) >= HAP_OK);
  REQUIRE(hap_session_start(hand->session) >= HAP_OK);
  bool felt = false;
  for (int frame = 0; frame < 600 && !felt; ++frame) {
    CHECK(hap_session_update(world->session, 0.016) >= HAP_OK);
    if (frame == 60) {
      side_put(hand, 0.057);
    }
    felt = fabs(side_feel(hand) - 3.0) < 0.05;
    usleep(16000);
  }
  CHECK(felt);
}

/* ---- what does not go ---- */

TEST(what_does_not_go_over_a_network_is_refused_with_a_text)
{
  hap_link *link;
  REQUIRE(hap_link_local_serve(&link, NULL) == HAP_OK);
  side *s = side_new(HAP_DRIVE_LOCKSTEP);
  s->def.model = HAP_MODEL_ACCELERANCE;
  side_create(s, true);
  CHECK(hap_session_serve(s->session, link) == HAP_ERROR_UNSUPPORTED);
  CHECK(strstr(side_detail(s), "model") != NULL);
  s = side_new(HAP_DRIVE_LOCKSTEP);
  s->expert.lookback = 0.1;
  side_create(s, true);
  CHECK(hap_session_serve(s->session, link) == HAP_ERROR_UNSUPPORTED);
  CHECK(strstr(side_detail(s), "looking back") != NULL);
  s = side_new(HAP_DRIVE_FRAME);
  side_create(s, true);
  CHECK(hap_session_connect(s->session, link) == HAP_ERROR_UNSUPPORTED);
  CHECK(strstr(side_detail(s), "FRAME") != NULL);
  s = side_new(HAP_DRIVE_LOCKSTEP);
  side_create(s, true);
  hap_remote_state state;
  CHECK(hap_session_remote_state(s->session, &state, sizeof state, NULL) == HAP_ERROR_STATE);
  CHECK(hap_session_serve(s->session, NULL) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_serve(NULL, link) == HAP_ERROR_ARGUMENT);
  side_add_hand(s);
  CHECK(hap_session_serve(s->session, link) == HAP_ERROR_STATE);
  CHECK(strstr(side_detail(s), "pointer") != NULL);
  CHECK(hap_session_connect(s->session, link) == HAP_OK);
  CHECK(hap_session_connect(s->session, link) == HAP_ERROR_STATE);
  CHECK(hap_session_remote_state(s->session, &state, 2, NULL) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_remote_state(s->session, NULL, sizeof state, NULL) == HAP_ERROR_ARGUMENT);
  s = side_new(HAP_DRIVE_LOCKSTEP);
  side_create(s, true);
  session_run(s->session);
  CHECK(hap_session_serve(s->session, link) == HAP_ERROR_STATE);
  s = side_new(HAP_DRIVE_LOCKSTEP);
  side_create(s, true);
  hap_pointer_def hand;
  hap_pointer_def_init(&hand, sizeof hand);
  CHECK(hap_session_set_client_limits(s->session, 10.0, 1.0) == HAP_ERROR_STATE);
  CHECK(hap_session_serve(s->session, link) == HAP_OK);
  CHECK(hap_session_set_client_limits(s->session, 10.0, 1.0) == HAP_OK);
  const double wrong[] = {-1.0, 1.1e9, (double)NAN, (double)INFINITY};
  for (int i = 0; i < 4; ++i) {
    CHECK(hap_session_set_client_limits(s->session, wrong[i], 1.0) == HAP_ERROR_ARGUMENT);
    CHECK(hap_session_set_client_limits(s->session, 1.0, wrong[i]) == HAP_ERROR_ARGUMENT);
  }
  CHECK(hap_session_set_client_limits(NULL, 1.0, 1.0) == HAP_ERROR_ARGUMENT);
  CHECK(hap_pointer_add(s->session, &hand, &s->hand) == HAP_ERROR_STATE);
  CHECK(strstr(side_detail(s), "hap_session_connect") != NULL);
  session_run(s->session);
  CHECK(hap_session_set_client_limits(s->session, 1.0, 1.0) == HAP_ERROR_STATE);
  CHECK(hap_session_stop(s->session) == HAP_OK);
  CHECK(hap_session_start(s->session) == HAP_ERROR_STATE);
  CHECK(strstr(side_detail(s), "anew") != NULL);
  tap_release(s);
  hap_link_close(link);
}

/* By the public API alone: a client with a stronger hand than is allowed pushes, and is bounded. */
TEST(limits_of_a_client_are_counted_and_told_by_the_public_api)
{
  side *world = side_new(HAP_DRIVE_LOCKSTEP);
  side *hand = side_new(HAP_DRIVE_LOCKSTEP);
  side_create(world, true);
  side_create(hand, false);
  side_add_hand(hand);
  REQUIRE(hap_link_local_serve(&world->link, NULL) == HAP_OK);
  REQUIRE(hap_link_local_connect(world->link, "", NULL, NULL, &hand->link, NULL) == HAP_OK);
  REQUIRE(hap_session_serve(world->session, world->link) == HAP_OK);
  REQUIRE(hap_session_set_client_limits(world->session, 0.01, 0.01) == HAP_OK);
  REQUIRE(hap_session_connect(hand->session, hand->link) == HAP_OK);
  session_run(world->session);
  session_run(hand->session);
  const hap_pose begin = {{-0.06, 0.0, 0.03}, {1.0, 0.0, 0.0, 0.0}};
  for (int i = 0; i < 3000; ++i) { /* 1 m/s at the side of the cube: 0.1 J */
    hap_pose pose = begin;
    pose.position[0] += i < 500 ? 0.0 : fmin(1e-3 * (i - 500), 0.2);
    CHECK(hap_pointer_set_target(hand->session, hand->hand, &pose, NULL) == HAP_OK);
    CHECK(hap_session_advance(hand->session, 1) == HAP_OK);
    CHECK(hap_session_advance(world->session, 1) == HAP_OK);
  }
  hap_remote_state state = side_state(world);
  CHECK(state.bounded > 0);
  CHECK(state.turned_away == 0 || side_state(hand).turned_away == 1);
  CHECK(fabs(dBodyGetLinearVel(world->cube)[0]) < 0.2);
}

/* ---- drawn poses ---- */

#define ROLL 0.3 /* m/s */

/* A ball that nobody touches, far from the hand, without friction. */
static dBodyID side_add_ball(const side *s)
{
  dBodyID ball = dBodyCreate(s->world);
  dGeomID geom = dCreateSphere(s->space, 0.05);
  dMass mass;
  dMassSetSphereTotal(&mass, 0.3, 0.05);
  dBodySetMass(ball, &mass);
  dGeomSetBody(geom, ball);
  dBodySetPosition(ball, 0.0, 8.0, 1.0);
  dBodySetGravityMode(ball, 0);
  return ball;
}

/* path: of both directions; NULL: without delay. */
static void side_join(side *world, side *hand, const hap_link_path_def *path)
{
  REQUIRE(hap_link_local_serve(&world->link, NULL) == HAP_OK);
  REQUIRE(hap_link_local_connect(world->link, "", path, path, &hand->link, NULL) == HAP_OK);
  REQUIRE(hap_session_serve(world->session, world->link) == HAP_OK);
  REQUIRE(hap_session_connect(hand->session, hand->link) == HAP_OK);
  session_run(world->session);
  session_run(hand->session);
}

static void sides_advance(const side *world, const side *hand, const double to[3], int ticks)
{
  const hap_pose pose = {{to[0], to[1], to[2]}, {1.0, 0.0, 0.0, 0.0}};
  CHECK(hap_pointer_set_target(hand->session, hand->hand, &pose, NULL) == HAP_OK);
  for (int i = 0; i < ticks; ++i) {
    CHECK(hap_session_advance(hand->session, 1) == HAP_OK);
    CHECK(hap_session_advance(world->session, 1) == HAP_OK);
  }
}

static double pose_x(const side *s, dBodyID body, int64_t time_ns, hap_body_role *out_role)
{
  hap_pose pose = {{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
  CHECK(hap_session_poses(s->session, time_ns, &body, 1, &pose) >= HAP_OK);
  CHECK(hap_session_roles(s->session, &body, 1, out_role) == HAP_OK);
  return pose.position[0];
}

/* How far the cube, as it is drawn, is from where the force on the hand says that it is. False: the
 * hand feels nothing. */
static bool cube_apart(const side *s, double stiffness, double *io_most)
{
  hap_pointer_state state;
  hap_pose cube = {{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
  CHECK(hap_pointer_get(s->session, s->hand, &state, sizeof state) >= HAP_OK);
  CHECK(hap_session_poses_now(s->session, &s->cube, 1, &cube) >= HAP_OK);
  dMatrix3 turn;
  double away2 = 0.0;
  double push = 0.0;
  dRfromQ(turn, cube.quat_wxyz);
  for (int k = 0; k < 3; ++k) { /* from the cube's surface to the middle of the pointer */
    double at = 0.0;
    double force = 0.0;
    for (int i = 0; i < 3; ++i) {
      at += turn[4 * i + k] * (state.proxy.position[i] - cube.position[i]);
      force += turn[4 * i + k] * state.wrench.force[i];
    }
    double away = at - fmin(fmax(at, -0.025), 0.025);
    away2 += away * away;
    push += away * force;
  }
  push /= fmax(sqrt(away2), 1e-9);
  if (push < 0.2) {
    return false;
  }
  *io_most = fmax(*io_most, fabs(0.01 - sqrt(away2) - push / stiffness));
  return true;
}

/* The hand's session has the same world once more, which stands still. Of that it draws what the
 * other session tells: what the hand pushes at once, and the rest one way, a step and lost
 * messages late. */
TEST(bodies_of_the_world_are_drawn_in_the_hand_s_session)
{
  side *world = side_new(HAP_DRIVE_LOCKSTEP);
  side *hand = side_new(HAP_DRIVE_LOCKSTEP);
  hap_link_path_def path;
  hap_link_path_def_init(&path, sizeof path);
  path.delay = 0.05;
  path.loss = 0.05;
  side_create(world, true);
  side_create(hand, true);
  dBodyID balls[2] = {side_add_ball(world), side_add_ball(hand)};
  dBodySetLinearVel(balls[0], ROLL, 0.0, 0.0);
  side_add_hand(hand);
  side_join(world, hand, &path);
  double late_most = 0.0;
  double late_least = 1.0;
  double apart = 0.0;
  int touched = 0;
  for (int i = 0; i < 3000; ++i) {
    double x = i < 1000 ? -0.06 : fmin(-0.06 + 1e-4 * (i - 1000), 0.04); /* pushes with 0.1 m/s */
    sides_advance(world, hand, AT(x, 0.0, 0.03), 1);
    hap_body_role role;
    int64_t now_ns = hap_session_now(hand->session);
    if (i > 500) {
      double late = 1e-9 * (double)now_ns - pose_x(hand, balls[1], now_ns, &role) / ROLL;
      CHECK(role == HAP_ROLE_WORLD);
      late_most = fmax(late_most, late);
      late_least = fmin(late_least, late);
    }
    if (cube_apart(hand, 1000.0, &apart)) {
      ++touched;
      (void)pose_x(hand, hand->cube, now_ns, &role);
      CHECK(role == HAP_ROLE_LOOP);
    }
  }
  printf("# the ball is drawn %.0f to %.0f ms late, the cube %.3f mm from the hand in %d ticks\n",
         1e3 * late_least, 1e3 * late_most, 1e3 * apart, touched);
  CHECK(late_least > 0.05 && late_most < 0.05 + 5.0 * 0.02);
  CHECK(touched > 300 && apart < 1e-3);
  CHECK(dBodyGetPosition(hand->cube)[0] == 0.0 && dBodyGetPosition(balls[1])[0] == 0.0);
  CHECK(fabs(dBodyGetPosition(world->cube)[0]) > 0.02);
  CHECK(side_state(hand).refused == 0 && side_state(world).refused == 0);
  CHECK(side_state(hand).drawn == 1);
}

/* After the hand has let go, both worlds come to rest at the same place, whatever was lost; a body
 * that was put elsewhere is drawn there. From then on nothing is told. */
TEST(what_rests_is_drawn_where_it_is_and_costs_nothing)
{
  side *world = side_new(HAP_DRIVE_LOCKSTEP);
  side *hand = side_new(HAP_DRIVE_LOCKSTEP);
  hap_link_path_def path;
  hap_link_path_def_init(&path, sizeof path);
  path.delay = 0.03;
  path.jitter = 0.05;
  path.loss = 0.4;
  path.duplicate = 0.1;
  side_create(world, true);
  side_create(hand, true);
  dBodyID balls[2] = {side_add_ball(world), side_add_ball(hand)};
  side_add_hand(hand);
  side_join(world, hand, &path);
  sides_advance(world, hand, AT(0.0, -9.0, 3.0), 500);
  const uint64_t early = side_state(hand).refused; /* what overtook the word that it has joined */
  const hap_pose there = {{1.0, 9.0, 2.0}, {0.0, 1.0, 0.0, 0.0}};
  CHECK(hap_session_lock(world->session) == HAP_OK);
  CHECK(hap_session_teleport_body(world->session, balls[0], &there) == HAP_OK);
  dBodySetLinearVel(world->cube, 1.0, 0.5, 0.0);
  CHECK(hap_session_unlock(world->session) == HAP_OK);
  sides_advance(world, hand, AT(0.0, -9.0, 3.0), 3000);
  const dBodyID own[2] = {hand->cube, balls[1]};
  const dBodyID theirs[2] = {world->cube, balls[0]};
  hap_pose drawn[2] = {{{0.0}, {0.0}}};
  CHECK(hap_session_poses(hand->session, hap_session_now(hand->session), own, 2, drawn) >= HAP_OK);
  for (int i = 0; i < 2; ++i) {
    const dReal *at = dBodyGetPosition(theirs[i]);
    const dReal *turn = dBodyGetQuaternion(theirs[i]);
    double turned = 0.0;
    for (int k = 0; k < 4; ++k) {
      turned += turn[k] * drawn[i].quat_wxyz[k];
    }
    CHECK(hypot(hypot(drawn[i].position[0] - at[0], drawn[i].position[1] - at[1]),
                drawn[i].position[2] - at[2]) < 2e-5);
    CHECK(fabs(turned) > 1.0 - 1e-8);
  }
  CHECK(hypot(dBodyGetPosition(world->cube)[0], dBodyGetPosition(world->cube)[1]) > 0.005);
  CHECK(drawn[1].position[1] == 9.0);
  uint64_t before = side_state(world).figures.sent_bytes;
  sides_advance(world, hand, AT(0.0, -9.0, 3.0), 1000);
  uint64_t after = side_state(world).figures.sent_bytes;
  printf("# %.0f bytes a step while all rests\n", (double)(after - before) / 50.0);
  CHECK((double)(after - before) / 50.0 <
        60.0); /* a frame without a body, and answers for clocks */
  CHECK(side_state(hand).refused == early && side_state(world).failed == 0);
}

TEST(a_world_that_was_built_otherwise_is_not_drawn_and_a_text_says_so)
{
  for (int how = 0; how < 3; ++how) { /* a body more there, another mass, an empty world here */
    side *world = side_new(HAP_DRIVE_LOCKSTEP);
    side *hand = side_new(HAP_DRIVE_LOCKSTEP);
    side_create(world, true);
    side_create(hand, how < 2);
    if (how == 0) {
      (void)side_add_ball(world);
    } else if (how == 1) {
      dMass mass;
      dMassSetBoxTotal(&mass, 0.3, 0.05, 0.05, 0.05);
      dBodySetMass(hand->cube, &mass);
    }
    side_add_hand(hand);
    log_listen(true);
    logged[0] = '\0';
    side_join(world, hand, NULL);
    dBodySetLinearVel(world->cube, 0.4, 0.0, 0.0);
    sides_advance(world, hand, AT(0.0, 0.0, 0.5), 500);
    hap_remote_state state;
    hap_detail detail;
    CHECK(hap_session_remote_state(hand->session, &state, sizeof state, &detail) == HAP_OK);
    CHECK(state.joined == 1 && state.drawn == 0 && state.refused == 0);
    bool says = strstr(detail.text, "not drawn") != NULL && strstr(logged, "not drawn") != NULL;
    CHECK(says == (how < 2));
    CHECK(how != 0 || strstr(logged, "of 2 bodies there and 1 here") != NULL);
    CHECK(how != 1 || strstr(logged, "1 here with other shapes or masses") != NULL);
    if (how < 2) {
      hap_body_role role;
      CHECK(pose_x(hand, hand->cube, hap_session_now(hand->session), &role) == 0.0);
    }
    log_listen(false);
  }
}

/* ---- a server that tells what cannot be ---- */

TEST(what_no_body_can_be_is_refused_and_other_bodies_stay_drawn)
{
  side *world = side_new(HAP_DRIVE_LOCKSTEP);
  side *hand = side_new(HAP_DRIVE_LOCKSTEP);
  side_create(world, true);
  side_create(hand, true);
  side_add_hand(hand);
  side_join(world, hand, NULL);
  sides_advance(world, hand, AT(0.0, -9.0, 3.0), 500);
  unsigned char told[HAP_LINK_NEWEST_MOST];
  const hap_link_address to = {.peer = 1, .channel = 5};
  memset(told, 0xff, sizeof told);
  for (uint32_t bytes = 1; bytes < 200; ++bytes) {
    CHECK(hap_link_send_newest(world->link, hap_session_now(world->session), &to, told, bytes) ==
          HAP_OK);
    sides_advance(world, hand, AT(0.0, -9.0, 3.0), 2);
  }
  CHECK(side_state(hand).refused == 199);
  /* Bodies that the hand's session does not have: as of step 2^63, at (1, 1, 1). */
  static const unsigned char one[28] = {0xee, 0xee, 0xee, 0, 1,    0,    0, 0, 0,    0,
                                        0x80, 0x3f, 0,    0, 0x80, 0x3f, 0, 0, 0x80, 0x3f,
                                        0xff, 0x7f, 0,    0, 0,    0,    0, 0};
  memset(told, 0, 8);
  told[7] = 0x80;
  memcpy(told + 8, one, sizeof one);
  memcpy(told + 36, one, sizeof one);
  CHECK(hap_link_send_reliably(world->link, hap_session_now(world->session), &to, told, 64) ==
        HAP_OK);
  sides_advance(world, hand, AT(0.0, -9.0, 3.0), 100);
  hap_body_role role;
  CHECK(side_state(hand).refused == 199);
  CHECK(fabs(pose_x(hand, hand->cube, hap_session_now(hand->session), &role)) < 1e-3);
  CHECK(role == HAP_ROLE_WORLD);
}

/* The application may make and destroy bodies of its own world; the lock is all that it takes. */
TEST(a_body_that_is_destroyed_in_the_hand_s_session_is_not_looked_at)
{
  side *world = side_new(HAP_DRIVE_LOCKSTEP);
  side *hand = side_new(HAP_DRIVE_LOCKSTEP);
  side_create(world, true);
  side_create(hand, true);
  dBodyID balls[2] = {side_add_ball(world), side_add_ball(hand)};
  dBodySetLinearVel(balls[0], ROLL, 0.0, 0.0);
  side_add_hand(hand);
  side_join(world, hand, NULL);
  sides_advance(world, hand, AT(0.0, -9.0, 3.0), 500);
  CHECK(hap_session_lock(hand->session) == HAP_OK);
  dBodyID late = side_add_ball(hand); /* before: else it would be at the old one's address */
  dGeomDestroy(dBodyGetFirstGeom(balls[1]));
  dBodyDestroy(balls[1]);
  dBodySetPosition(late, 4.0, 8.0, 1.0);
  CHECK(hap_session_unlock(hand->session) == HAP_OK);
  sides_advance(world, hand, AT(0.0, -9.0, 3.0), 500);
  hap_body_role role;
  CHECK_NEAR(pose_x(hand, late, hap_session_now(hand->session), &role), 4.0, 1e-12);
  CHECK(pose_x(hand, hand->cube, hap_session_now(hand->session), &role) < 1e-3);
  CHECK(side_state(hand).refused == 0);
}

TEST(what_the_world_decides_is_not_set_in_the_hand_s_session)
{
  side *world = side_new(HAP_DRIVE_LOCKSTEP);
  side *hand = side_new(HAP_DRIVE_LOCKSTEP);
  side_create(world, true);
  side_create(hand, false);
  side_add_hand(hand);
  side_join(world, hand, NULL);
  CHECK(hap_session_set_model(hand->session, HAP_MODEL_CONTACT) == HAP_ERROR_UNSUPPORTED);
  CHECK(strstr(side_detail(hand), "another session") != NULL);
  CHECK(hap_session_set_time_scale(hand->session, 0.5) == HAP_ERROR_UNSUPPORTED);
  CHECK(hap_session_set_physics_hz(hand->session, 50.0) == HAP_ERROR_UNSUPPORTED);
  CHECK(hap_session_set_accuracy(hand->session, 0.5) == HAP_ERROR_UNSUPPORTED);
  CHECK(hap_session_set_effect(hand->session, HAP_EFFECT_FRICTION, HAP_EFFECT_OFF) ==
        HAP_ERROR_UNSUPPORTED);
  CHECK(hap_session_set_time_scale(world->session, 0.5) == HAP_OK);
  CHECK(hap_session_set_model(world->session, HAP_MODEL_SINGLE) == HAP_ERROR_UNSUPPORTED);
  CHECK(strstr(side_detail(world), "only contact") != NULL);
}

/* The application draws, and edits its own world, while messages come; the threads share nothing
 * without a lock (this test is for the sanitizer as well). */
TEST(in_threads_the_world_is_drawn_while_it_moves)
{
  static cable cables[2];
  side *world = side_new(HAP_DRIVE_THREADS);
  side *hand = side_new(HAP_DRIVE_THREADS);
  side_create(world, true);
  side_create(hand, true);
  dBodyID balls[2] = {side_add_ball(world), side_add_ball(hand)};
  side_add_hand(hand);
  side_put(hand, 3.0);
  cables_open(cables);
  REQUIRE(hap_link_create(&cable_ops, &cables[0], &world->link, NULL) == HAP_OK);
  REQUIRE(hap_link_create(&cable_ops, &cables[1], &hand->link, NULL) == HAP_OK);
  REQUIRE(hap_session_serve(world->session, world->link) == HAP_OK);
  REQUIRE(hap_session_connect(hand->session, hand->link) == HAP_OK);
  REQUIRE(hap_session_start(world->session) >= HAP_OK);
  REQUIRE(hap_session_start(hand->session) >= HAP_OK);
  for (int i = 0; i < 5000 && side_state(hand).drawn == 0; ++i) {
    usleep(1000);
  }
  CHECK(side_state(hand).drawn == 1);
  CHECK(hap_session_lock(world->session) == HAP_OK);
  dBodySetLinearVel(balls[0], ROLL, 0.0, 0.0);
  CHECK(hap_session_unlock(world->session) == HAP_OK);
  double before = 0.0;
  int back = 0;
  for (int i = 0; i < 10000 && before < 0.1; ++i) {
    hap_body_role role;
    double x = pose_x(hand, balls[1], hap_session_now(hand->session), &role);
    back += x < before - 1e-9;
    before = x;
    if (i % 50 == 0) {
      CHECK(hap_session_lock(hand->session) == HAP_OK);
      CHECK(hap_session_unlock(hand->session) == HAP_OK);
    }
    usleep(1000);
  }
  CHECK(before >= 0.1 && back == 0);
  CHECK(side_state(hand).refused == 0);
}

/* What another hand's loop moves is told to a hand's session that only draws it. */
TEST(what_another_hand_pushes_is_drawn_a_way_late)
{
  side *world = side_new(HAP_DRIVE_LOCKSTEP);
  side *hands[2] = {side_new(HAP_DRIVE_LOCKSTEP), side_new(HAP_DRIVE_LOCKSTEP)};
  hap_link_path_def path;
  hap_link_path_def_init(&path, sizeof path);
  path.delay = 0.02;
  path.loss = 0.05;
  side_create(world, true);
  REQUIRE(hap_link_local_serve(&world->link, NULL) == HAP_OK);
  REQUIRE(hap_session_serve(world->session, world->link) == HAP_OK);
  session_run(world->session);
  for (int i = 0; i < 2; ++i) {
    side_create(hands[i], true);
    side_add_hand(hands[i]);
    REQUIRE(hap_link_local_connect(world->link, i == 0 ? "pushes" : "looks", &path, &path,
                                   &hands[i]->link, NULL) == HAP_OK);
    REQUIRE(hap_session_connect(hands[i]->session, hands[i]->link) == HAP_OK);
    session_run(hands[i]->session);
  }
  const hap_pose away = {{0.0, -9.0, 3.0}, {1.0, 0.0, 0.0, 0.0}};
  CHECK(hap_pointer_set_target(hands[1]->session, hands[1]->hand, &away, NULL) == HAP_OK);
  double apart = 0.0;
  hap_body_role roles[2] = {HAP_ROLE_WORLD, HAP_ROLE_WORLD};
  hap_pose drawn[2] = {{{0.0}, {1.0}}, {{0.0}, {1.0}}};
  for (int i = 0; i < 4000; ++i) {
    double x = i < 1000 ? -0.06 : i < 2500 ? fmin(-0.06 + 1e-4 * (i - 1000), 0.02) : -0.06;
    const hap_pose pose = {{x, 0.0, 0.03}, {1.0, 0.0, 0.0, 0.0}};
    CHECK(hap_pointer_set_target(hands[0]->session, hands[0]->hand, &pose, NULL) == HAP_OK);
    for (int k = 0; k < 2; ++k) {
      CHECK(hap_session_advance(hands[k]->session, 1) == HAP_OK);
      CHECK(hap_session_poses_now(hands[k]->session, &hands[k]->cube, 1, &drawn[k]) >= HAP_OK);
      CHECK(hap_session_roles(hands[k]->session, &hands[k]->cube, 1, &roles[k]) == HAP_OK);
    }
    CHECK(hap_session_advance(world->session, 1) == HAP_OK);
    if (i > 1300 && i < 1700) { /* pushed */
      CHECK(roles[0] == HAP_ROLE_LOOP && roles[1] == HAP_ROLE_WORLD);
      apart = fmax(apart, fabs(drawn[0].position[0] - drawn[1].position[0]));
    }
  }
  const dReal *at = dBodyGetPosition(world->cube);
  printf("# %.1f mm behind, at %.4f, %.4f and %.4f m in the end\n", 1e3 * apart, at[0],
         drawn[0].position[0], drawn[1].position[0]);
  CHECK(at[0] > 0.02 && apart > 1e-3 && apart < 0.05);
  CHECK(fabs(drawn[1].position[0] - at[0]) < 2e-5 && fabs(drawn[0].position[0] - at[0]) < 2e-5);
  for (int k = 0; k < 2; ++k) {
    hap_session_destroy(hands[k]->session);
    hands[k]->session = NULL;
  }
}
