/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Sixteen hands' sessions and one world, in threads, over datagrams of the loopback interface: the
 * rate of steps is kept, or what was missed is told. 20 s; with the argument long 10 minutes. */

#include "tests/tap.h"

#include <arpa/inet.h>
#include <hapode/hapode.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "tests/ode_world.h"

#define HANDS 16
#define APART 4.0 /* m, between their cubes */
#define PHYSICS_HZ 60.0

/* ---- a transport of one socket for each client; on loopback all datagrams arrive ---- */

#define WIRE_HEAD 5 /* what it is, channel, part, reliable; and JOIN and LEAVE for the other end */
#define WIRE_MESSAGE 0
#define WIRE_JOIN 1
#define WIRE_LEAVE 2

typedef struct crowd_wire {
  int sockets[HANDS]; /* of a client: the first one */
  bool joined[HANDS];
  uint32_t count; /* 1: of a client */
  uint32_t next;  /* where a server looks first */
  bool told;      /* a client: that it joins */
  unsigned char in[WIRE_HEAD + HAP_LINK_RELIABLE_MOST];
} crowd_wire;

static void wire_put(int to, unsigned char what, const hap_link_parcel *parcel)
{
  unsigned char out[WIRE_HEAD + HAP_LINK_RELIABLE_MOST] = {what};
  size_t size = WIRE_HEAD;
  if (parcel != NULL) {
    out[1] = (unsigned char)parcel->to.channel;
    out[2] = (unsigned char)parcel->to.part;
    out[3] = (unsigned char)parcel->reliable;
    memcpy(out + WIRE_HEAD, parcel->data, parcel->bytes);
    size += parcel->bytes;
  }
  (void)send(to, out, size, 0);
}

static hap_status wire_send(void *self, int64_t now_ns, const hap_link_parcel *parcel,
                            hap_detail *detail)
{
  crowd_wire *w = self;
  uint32_t which = w->count == 1 ? 0 : parcel->to.peer - 1;
  (void)now_ns;
  if (which >= w->count || !w->joined[which]) {
    snprintf(detail->text, sizeof detail->text, "nobody is at the other end");
    return HAP_ERROR_NOT_FOUND;
  }
  wire_put(w->sockets[which], WIRE_MESSAGE, parcel);
  return HAP_OK;
}

static hap_status wire_poll(void *self, int64_t now_ns, hap_link_event *out, hap_detail *detail)
{
  crowd_wire *w = self;
  (void)now_ns;
  (void)detail;
  if (w->count == 1 && !w->told) {
    wire_put(w->sockets[0], WIRE_JOIN, NULL);
    w->told = true;
  }
  for (uint32_t i = 0; i < w->count; ++i) {
    uint32_t which = (w->next + i) % w->count;
    ssize_t size = recv(w->sockets[which], w->in, sizeof w->in, MSG_DONTWAIT);
    if (size < WIRE_HEAD) {
      continue;
    }
    w->next = which + 1;
    out->peer = w->count == 1 ? HAP_LINK_SERVER : which + 1;
    out->kind = w->in[0] == WIRE_JOIN    ? HAP_LINK_JOINED
                : w->in[0] == WIRE_LEAVE ? HAP_LINK_LEFT
                                         : HAP_LINK_MESSAGE;
    w->joined[which] = out->kind != HAP_LINK_LEFT;
    if (out->kind == HAP_LINK_JOINED) {
      out->data = "crowd";
      if (w->count > 1) {
        wire_put(w->sockets[which], WIRE_JOIN, NULL);
      }
    } else if (out->kind == HAP_LINK_MESSAGE) {
      out->channel = w->in[1];
      out->part = w->in[2];
      out->reliable = w->in[3];
      out->bytes = (uint32_t)size - WIRE_HEAD;
      out->data = w->in + WIRE_HEAD;
    }
    return HAP_OK;
  }
  return HAP_END;
}

static void wire_close(void *self)
{
  crowd_wire *w = self;
  for (uint32_t i = 0; i < w->count; ++i) {
    wire_put(w->sockets[i], WIRE_LEAVE, NULL);
    close(w->sockets[i]);
  }
}

static const hap_link_ops wire_ops = {.abi = HAP_LINK_ABI,
                                      .size = sizeof(hap_link_ops),
                                      .name = "crowd",
                                      .send = wire_send,
                                      .poll = wire_poll,
                                      .close = wire_close};

/* Two sockets of the loopback interface that know each other. */
static void sockets_open(int out[2])
{
  struct sockaddr_in at[2];
  const int room = 1 << 20; /* bytes: a server that comes late finds all of them */
  for (int i = 0; i < 2; ++i) {
    socklen_t size = sizeof at[i];
    out[i] = socket(AF_INET, SOCK_DGRAM, 0);
    memset(&at[i], 0, sizeof at[i]);
    at[i].sin_family = AF_INET;
    at[i].sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    REQUIRE(out[i] >= 0);
    (void)setsockopt(out[i], SOL_SOCKET, SO_RCVBUF, &room, sizeof room);
    REQUIRE(bind(out[i], (struct sockaddr *)&at[i], sizeof at[i]) == 0);
    REQUIRE(getsockname(out[i], (struct sockaddr *)&at[i], &size) == 0);
  }
  for (int i = 0; i < 2; ++i) {
    REQUIRE(connect(out[i], (struct sockaddr *)&at[1 - i], sizeof at[1 - i]) == 0);
  }
}

/* ---- the crowd ---- */

typedef struct crowd_side {
  dWorldID world;
  dSpaceID space;
  hap_session *session;
  hap_link *link;
  hap_pointer_id hand;
} crowd_side;

typedef struct crowd {
  crowd_wire wires[HANDS + 1]; /* the server's comes last */
  crowd_side sides[HANDS + 1];
} crowd;

static void crowd_finish(void *owned)
{
  crowd *c = owned;
  for (int i = 0; i <= HANDS; ++i) {
    ode_world_end(c->sides[i].session, c->sides[i].world, c->sides[i].space);
    hap_link_close(c->sides[i].link);
  }
}

static void side_create(crowd_side *side, double gravity)
{
  hap_session_def def;
  hap_expert_def expert;
  hap_research_def research;
  hap_ode_def ode;
  session_defs_init(&def, &expert, &research);
  def.physics_hz = PHYSICS_HZ;
  def.rt_priority = 0;
  def.max_pointers = HANDS;
  def.max_bodies = 32;
  def.max_contacts = 128;
  expert.look_ahead = 0.1;
  ode_world_make(gravity, &side->world, &side->space);
  ode_world_stiffen(side->world, 50);
  for (int i = 0; i < HANDS && gravity > 0.0; ++i) {
    (void)ode_box(side->world, side->space, 0.2, AT(0.05, 0.05, 0.05), AT(0.0, APART * i, 0.025));
  }
  if (gravity > 0.0) {
    dCreatePlane(side->space, 0.0, 0.0, 1.0, 0.0);
  }
  hap_ode_def_init(&ode, sizeof ode);
  ode.world = side->world;
  ode.space = side->space;
  side->session = session_make(&def, &ode);
}

static void crowd_join(crowd *c, int which)
{
  crowd_side *side = &c->sides[which];
  hap_pointer_def hand;
  side_create(side, 0.0);
  REQUIRE(hap_link_create(&wire_ops, &c->wires[which], &side->link, NULL) == HAP_OK);
  REQUIRE(hap_session_connect(side->session, side->link) == HAP_OK);
  hap_pointer_def_init(&hand, sizeof hand);
  hand.radius = 0.01;
  hand.stiffness = 1000.0;
  REQUIRE(hap_pointer_add(side->session, &hand, &side->hand) == HAP_OK);
  REQUIRE(hap_session_start(side->session) >= HAP_OK);
}

/* Down to 3 mm in, up again, every two seconds; all of them at times of their own. */
static void crowd_move(const crowd *c, double s)
{
  for (int i = 0; i < HANDS; ++i) {
    double wave = 0.5 + 0.5 * cos(M_PI * s + i);
    double speed = -0.5 * M_PI * sin(M_PI * s + i);
    double y = i < HANDS - 1 ? APART * i : APART * (i - 1); /* the last two share a cube */
    double x = i == HANDS - 2 ? -0.012 : i == HANDS - 1 ? 0.012 : 0.0;
    const hap_pose pose = {{x, y, 0.057 + 0.02 * wave}, {1.0, 0.0, 0.0, 0.0}};
    const hap_twist twist = {{0.0, 0.0, 0.02 * speed}, {0.0, 0.0, 0.0}};
    CHECK(hap_pointer_set_target(c->sides[i].session, c->sides[i].hand, &pose, &twist) == HAP_OK);
  }
}

static double seconds_now(clockid_t clock)
{
  struct timespec now;
  clock_gettime(clock, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

TEST(sixteen_hands_have_a_world_at_its_rate_or_are_told)
{
  double seconds = strcmp(tap_argument, "long") == 0 ? 600.0 : 8.0;
  crowd *c = tap_own(sizeof *c, crowd_finish);
  crowd_side *server = &c->sides[HANDS];
  c->wires[HANDS].count = HANDS;
  for (int i = 0; i < HANDS; ++i) {
    int ends[2];
    sockets_open(ends);
    c->wires[i].count = 1;
    c->wires[i].sockets[0] = ends[0];
    c->wires[HANDS].sockets[i] = ends[1];
  }
  side_create(server, 9.81);
  REQUIRE(hap_link_create(&wire_ops, &c->wires[HANDS], &server->link, NULL) == HAP_OK);
  REQUIRE(hap_session_serve(server->session, server->link) == HAP_OK);
  REQUIRE(hap_session_start(server->session) >= HAP_OK);
  for (int i = 0; i < HANDS; ++i) {
    crowd_join(c, i);
  }
  hap_stats first = session_stats(server->session);
  double begin = seconds_now(CLOCK_MONOTONIC);
  double used = seconds_now(CLOCK_PROCESS_CPUTIME_ID);
  double at = 0.0;
  double most[HANDS] = {0.0};
  while (at < seconds) {
    crowd_move(c, at);
    for (int i = 0; i < HANDS; ++i) {
      hap_pointer_state felt;
      CHECK(hap_pointer_get(c->sides[i].session, c->sides[i].hand, &felt, sizeof felt) >= HAP_OK);
      most[i] = fmax(most[i], felt.wrench.force[2]);
    }
    usleep(5000);
    at = seconds_now(CLOCK_MONOTONIC) - begin;
  }
  hap_stats last = session_stats(server->session);
  used = seconds_now(CLOCK_PROCESS_CPUTIME_ID) - used;
  hap_remote_state state;
  CHECK(hap_session_remote_state(server->session, &state, sizeof state, NULL) == HAP_OK);
  double steps = (double)(last.physics.steps - first.physics.steps);
  double missed = (double)(last.physics.missed - first.physics.missed);
  printf(
      "# %u hands: %.2f steps a second, %.0f missed; cycle %.2f ms, %.2f at most; %.1f and %.1f "
      "kB/s; "
      "%.2f processors in all\n",
      state.joined, steps / at, missed, last.physics.ms_mean, last.physics.ms_max,
      1e-3 * (double)state.figures.sent_bytes / at,
      1e-3 * (double)state.figures.received_bytes / at, used / at);
  CHECK(state.joined == HANDS && state.joins == HANDS && state.turned_away == 0);
  CHECK(state.shared == 1);
  CHECK(state.refused == 0 && state.failed == 0 && state.bounded == 0);
  CHECK(steps + missed >= 0.99 * PHYSICS_HZ * at - 2.0); /* the rate, or what was missed */
  int felt = 0;
  for (int i = 0; i < HANDS; ++i) {
    hap_stats of = session_stats(c->sides[i].session);
    felt += most[i] > 0.5 || of.safety.derated_ticks > 0 || of.faults.stale_times > 0;
  }
  CHECK(felt == HANDS); /* or the force was taken off, and that is told */
}
