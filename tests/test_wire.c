/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* lib/wire: what comes out is what went in, whatever happens to the datagrams; and what may be
 * wrong with them. */

#include "tests/tap.h"

#include "tests/wire_compare.h"
#include "tests/wire_rig.h"
#include "wire/receiver.h"

/* ---- what comes out is what went in ---- */

TEST(every_member_of_every_message_arrives)
{
  rig *r = rig_make();
  for (int step = 0; step < 300; ++step) {
    hapi_model *sent;
    hapi_near *sent_near;
    hapi_model *model;
    hapi_near *near;
    hapi_state *state;
    hapi_state *came;
    REQUIRE_SAY(send_down(r, &sent, &sent_near) == HAP_OK, "%s", r->detail.text);
    REQUIRE_SAY(send_up(r, &state) == HAP_OK, "%s", r->detail.text);
    take_all(r);
    REQUIRE(world_of(r, &model, &near) && state_of(r, &came));
    CHECK(!world_of(r, &model, &near) && !state_of(r, &came));
    const char *bad = compare_models(sent, model);
    REQUIRE_SAY(bad == NULL, "step %d: model.%s", step, bad);
    bad = compare_nears(sent_near, near);
    REQUIRE_SAY(bad == NULL, "step %d: near.%s", step, bad);
    bad = compare_states(state, came);
    REQUIRE_SAY(bad == NULL, "step %d: state.%s", step, bad);
  }
}

static uint32_t bytes_of(const post *p)
{
  uint32_t sum = 0;
  for (uint32_t i = 0; i < p->count; ++i) {
    sum += p->parcels[i].channel == HAPI_WIRE_CHANNEL_KNOWN ? 0 : p->parcels[i].bytes;
  }
  return sum;
}

TEST(a_body_at_rest_costs_nothing)
{
  rig *r = rig_make();
  const hapi_wire_out out = {&r->down, post_send};
  hapi_model *model;
  hapi_near *near;
  hapi_state *state;
  wire_world_step(&r->world, &model, &near);
  for (int i = 0; i < 6; ++i) {
    ++model->number;
    near->model_number = model->number;
    REQUIRE(hapi_wire_server_send(r->server, model, near, &out, &r->detail) == HAP_OK);
    REQUIRE(send_up(r, &state) == HAP_OK);
    CHECK_SAY(i < 3 || (r->down.count == 1 && bytes_of(&r->down) <= 24), "%u bytes",
              bytes_of(&r->down));
    take_all(r);
  }
}

/* ---- whatever happens on the way ---- */

typedef struct road {
  const char *name;
  double loss;
  uint32_t overtake; /* parcels */
  double twice;
  uint32_t acks_every; /* steps: the other direction is as rare */
} road;

static const road roads[] = {
    {"loss", 0.2, 0, 0.0, 1}, {"overtaking", 0.0, 30, 0.0, 1},     {"duplicates", 0.0, 10, 0.5, 1},
    {"all", 0.1, 20, 0.2, 1}, {"rare_answers", 0.05, 5, 0.05, 40},
};

/* Parcels on their way; of channel KNOWN all arrive, in order. */
typedef struct traffic {
  wire_dice dice;
  const road *road;
  parcel *held[256];
  uint32_t count;
} traffic;

static void traffic_pass(traffic *t, rig *r, post *from, hap_status (*take)(rig *, const parcel *),
                         bool all)
{
  for (uint32_t i = 0; i < from->count; ++i) {
    const parcel *p = &from->parcels[i];
    bool known = p->channel == HAPI_WIRE_CHANNEL_KNOWN;
    int copies = known ? 1 : 0.5 + 0.5 * dice_unit(&t->dice) >= t->road->loss;
    copies += !known && 0.5 + 0.5 * dice_unit(&t->dice) < t->road->twice;
    for (int k = 0; k < copies; ++k) {
      if (known || t->road->overtake == 0) {
        REQUIRE_SAY(take(r, p) == HAP_OK, "%s", r->detail.text);
        continue;
      }
      parcel *copy = malloc(sizeof *copy);
      *copy = *p;
      t->held[t->count++] = copy;
    }
    while (t->count > (all ? 0 : t->road->overtake)) {
      uint32_t which = dice_below(&t->dice, t->count);
      REQUIRE_SAY(take(r, t->held[which]) == HAP_OK, "%s", r->detail.text);
      free(t->held[which]);
      t->held[which] = t->held[--t->count];
    }
  }
  from->count = 0;
}

#define STEPS 1500u
#define REMEMBERED 512u

TEST_EACH(roads, const road *row)
{
  rig *r = rig_make();
  traffic down = {.dice = {3}, .road = row};
  traffic up = {.dice = {4}, .road = row};
  static uint32_t bodies[REMEMBERED]; /* of a message: how many there were */
  static uint32_t contacts[REMEMBERED];
  uint64_t newest = 0;
  uint32_t given = 0;
  hapi_model *sent;
  hapi_near *sent_near;
  hapi_model *model;
  hapi_near *near;
  hapi_state *state;
  hapi_state *came;
  for (uint32_t step = 0; step < STEPS; ++step) {
    REQUIRE_SAY(send_down(r, &sent, &sent_near) == HAP_OK, "%s", r->detail.text);
    bodies[sent->number % REMEMBERED] = sent->body_count;
    contacts[sent->number % REMEMBERED] = sent->contact_count;
    traffic_pass(&down, r, &r->down, take_down, false);
    if (step % row->acks_every == 0) {
      REQUIRE_SAY(send_up(r, &state) == HAP_OK, "%s", r->detail.text);
      traffic_pass(&up, r, &r->up, take_up, false);
    }
    if (world_of(r, &model, &near)) {
      ++given;
      CHECK(model->number > newest);
      CHECK(near->model_number == model->number);
      CHECK(model->body_count == bodies[model->number % REMEMBERED]);
      CHECK(model->contact_count <= contacts[model->number % REMEMBERED]); /* some are lost */
      newest = model->number;
    }
    if (state_of(r, &came)) {
      CHECK(came->now_ns == (int64_t)came->tick * 1000000);
    }
  }
  printf("# %s: %u of %u models given\n", row->name, given, STEPS);
  CHECK(given > STEPS / 8);
  /* What is on its way arrives; then everything does. */
  const road straight = {"", 0.0, 0, 0.0, 1};
  for (int i = 0; i < 3; ++i) {
    traffic_pass(&down, r, &r->down, take_down, true);
    traffic_pass(&up, r, &r->up, take_up, true);
    down.road = up.road = &straight;
    REQUIRE(send_down(r, &sent, &sent_near) == HAP_OK);
    REQUIRE(send_up(r, &state) == HAP_OK);
  }
  for (uint32_t i = 0; i < down.count; ++i) {
    free(down.held[i]);
  }
  for (uint32_t i = 0; i < up.count; ++i) {
    free(up.held[i]);
  }
  take_all(r);
  REQUIRE(world_of(r, &model, &near) && state_of(r, &came));
  const char *bad = compare_models(sent, model);
  CHECK_SAY(bad == NULL, "model.%s", bad);
  bad = compare_nears(sent_near, near);
  CHECK_SAY(bad == NULL, "near.%s", bad);
  bad = compare_states(state, came);
  CHECK_SAY(bad == NULL, "state.%s", bad);
}

/* Of a message of several datagrams one is lost: the bodies in it are as they were known last, all
 * others are new. */
TEST(a_lost_datagram_costs_its_own_bodies)
{
  rig *r = rig_make();
  hapi_model *sent;
  hapi_near *sent_near;
  hapi_model *model;
  hapi_near *near;
  hapi_state *state;
  r->world.rest = 0;
  for (int i = 0; i < 3; ++i) {
    REQUIRE(send_down(r, &sent, &sent_near) == HAP_OK);
    REQUIRE(send_up(r, &state) == HAP_OK);
    take_all(r);
  }
  REQUIRE(world_of(r, &model, &near));
  uint32_t compared = 0;
  uint32_t old = 0;
  for (uint32_t lost = 1; lost < 6; ++lost) {
    static hapi_model_body before[60];
    uint32_t before_count = model->body_count;
    memcpy(before, hapi_model_bodies(model), before_count * sizeof before[0]);
    REQUIRE(send_down(r, &sent, &sent_near) == HAP_OK);
    uint32_t datagrams = 0;
    for (uint32_t i = 0; i < r->down.count; ++i) {
      bool known = r->down.parcels[i].channel == HAPI_WIRE_CHANNEL_KNOWN;
      datagrams += !known;
      if (known || r->down.parcels[i].part != lost) {
        REQUIRE(take_down(r, &r->down.parcels[i]) == HAP_OK);
      }
    }
    REQUIRE(datagrams > 6);
    CHECK(!world_of(r, &model, &near)); /* it may come yet */
    r->down.count = 0;
    static hapi_model_body now[60];
    uint32_t now_count = sent->body_count;
    uint64_t number = sent->number;
    memcpy(now, hapi_model_bodies(sent), now_count * sizeof now[0]);
    REQUIRE(send_down(r, &sent, &sent_near) == HAP_OK);
    for (uint32_t i = 0; i < r->down.count; ++i) { /* the next one begins to come */
      bool first = r->down.parcels[i].part == 0;
      if (first) {
        REQUIRE(take_down(r, &r->down.parcels[i]) == HAP_OK);
      }
    }
    if (!world_of(r, &model, &near)) { /* something new was in the lost one */
      take_all(r);
      REQUIRE(world_of(r, &model, &near));
      continue;
    }
    CHECK(model->number == number && model->body_count == now_count);
    for (uint32_t i = 0; i < model->body_count; ++i) {
      const hapi_model_body *body = &hapi_model_bodies(model)[i];
      bool is_new = compare_record(HAPI_WIRE_BODY, body, &now[i], false) == NULL;
      bool is_old = false;
      for (uint32_t k = 0; k < before_count; ++k) {
        is_old = is_old || compare_record(HAPI_WIRE_BODY, body, &before[k], false) == NULL;
      }
      CHECK(is_new || is_old);
      ++compared;
      old += !is_new;
    }
    take_all(r);
    (void)world_of(r, &model, &near);
  }
  printf("# %u of %u bodies were as known before\n", old, compared);
  CHECK(compared > 0 && old > 0 && old < compared / 3);
}

TEST(descriptions_that_are_refused_go_again)
{
  rig *r = rig_make();
  hapi_model *sent;
  hapi_near *sent_near;
  hapi_model *model;
  hapi_near *near;
  r->down.refuses = true;
  CHECK(send_down(r, &sent, &sent_near) == HAP_ERROR_CAPACITY && r->detail.text[0] != '\0');
  CHECK(r->down.count == 0);
  r->down.refuses = false;
  REQUIRE(send_down(r, &sent, &sent_near) == HAP_OK);
  take_all(r);
  REQUIRE(world_of(r, &model, &near));
  CHECK(compare_models(sent, model) == NULL && compare_nears(sent_near, near) == NULL);
}

/* Datagrams may come before the descriptions that they need. */
TEST(a_message_waits_for_its_descriptions)
{
  rig *r = rig_make();
  hapi_model *sent;
  hapi_near *sent_near;
  hapi_model *model;
  hapi_near *near;
  REQUIRE(send_down(r, &sent, &sent_near) == HAP_OK);
  for (uint32_t i = r->down.count; i-- > 0;) {
    CHECK(!world_of(r, &model, &near));
    if (r->down.parcels[i].channel != HAPI_WIRE_CHANNEL_KNOWN) {
      REQUIRE(take_down(r, &r->down.parcels[i]) == HAP_OK);
    }
  }
  for (uint32_t i = 0; i < r->down.count; ++i) {
    if (r->down.parcels[i].channel == HAPI_WIRE_CHANNEL_KNOWN) {
      REQUIRE(take_down(r, &r->down.parcels[i]) == HAP_OK);
    }
  }
  REQUIRE(world_of(r, &model, &near));
  CHECK(compare_models(sent, model) == NULL && compare_nears(sent_near, near) == NULL);
}

/* Numbers have 64 bits on the wire: nothing happens where 32 of them end, nor 63. */
static const uint64_t begins[] = {UINT64_C(0xfffffff0), UINT64_C(0x7ffffffffffffff0)};

TEST(numbers_go_on_beyond_32_and_63_bits)
{
  for (int which = 0; which < 2; ++which) {
    rig *r = rig_make();
    static hapi_wire_sender sender;
    static hapi_wire_sender back;
    static hapi_wire_receiver receiver;
    REQUIRE(hapi_wire_sender_create(&sender, HAPI_WIRE_CHANNEL_STATE, HAPI_WIRE_STATE,
                                    HAPI_WIRE_KINDS, &wire_capacity));
    REQUIRE(hapi_wire_sender_create(&back, HAPI_WIRE_CHANNEL_WORLD, HAPI_WIRE_MODEL,
                                    HAPI_WIRE_STATE, &wire_capacity));
    REQUIRE(hapi_wire_receiver_create(&receiver, HAPI_WIRE_CHANNEL_STATE, HAPI_WIRE_STATE,
                                      HAPI_WIRE_KINDS, &wire_capacity));
    sender.number = receiver.heard = begins[which];
    for (int i = 0; i < 40; ++i) {
      const hapi_wire_out out = {&r->up, post_send};
      hapi_wire_sender_begin(&sender);
      uint64_t *cells = hapi_wire_sender_add(&sender, HAPI_WIRE_STATE, 0);
      memset(cells, 0, sender.shape.cells[HAPI_WIRE_STATE] * sizeof *cells);
      cells[0] = (uint64_t)i;
      REQUIRE(hapi_wire_sender_send(&sender, 0, &out, &r->detail) == HAP_OK);
      CHECK(r->up.count == 1 && r->up.parcels[0].bytes < 50);
      hapi_code_reader head = {r->up.parcels[0].data + 4, r->up.parcels[0].data + 40, false};
      CHECK(hapi_code_take(&head) == begins[which] + (uint64_t)i + 1);
      CHECK(hapi_code_take(&head) == (i == 0 ? 0 : 1)); /* against the one before */
      r->up.count = 0;
      CHECK(hapi_wire_sender_acknowledge(&sender, sender.number));
      CHECK(!hapi_wire_sender_acknowledge(&sender, sender.number + 1));
    }
    hapi_wire_sender_finish(&sender);
    hapi_wire_sender_finish(&back);
    hapi_wire_receiver_finish(&receiver);
  }
}

/* ---- bytes, written by hand from docs/wire.md ---- */

static const uint8_t golden[] = {
    1,    3,    3,    0, /* version, channel STATE, flags keep and last, part */
    1,    0,    0,    0, /* number, base, descriptions, acknowledgement: none */
    3,    3,             /* bytes of the directory, all of them here */
    0,    1,             /* the first record is number 0, and there is one */
    1,                   /* changed lists: that of the first kind */
    1,    0,             /* one record, of label 0 */
    0,                   /* record 0 */
    0x04,                /* four cells that change: */
    0xd0, 0x0f,          /* tick 1000 */
    0x04,                /* model 2 */
    0x05,                /* now_ns -3 */
    0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0xf8, 0x3f, /* time_scale 1.0 */
    0xf0, 0x61,                                           /* 15 + 6 stay, one changes: */
    0x06,                                                 /* model 3, CONTACT */
    0x00,                                                 /* and no more */
};

TEST(bytes_are_as_documented)
{
  rig *r = rig_make();
  const hapi_wire_out out = {&r->up, post_send};
  hapi_state *state = hapi_exchange_state_back(r->out);
  hapi_state *came;
  state->tick = 1000;
  state->model_number = 2;
  state->now_ns = -3;
  state->time_scale = 1.0;
  state->model = HAP_MODEL_CONTACT;
  REQUIRE(hapi_wire_client_send(r->client, state, &out, &r->detail) == HAP_OK);
  REQUIRE(r->up.count == 1);
  CHECK(r->up.parcels[0].bytes == sizeof golden);
  CHECK(memcmp(r->up.parcels[0].data, golden, sizeof golden) == 0);
  REQUIRE(hapi_wire_server_take(r->server, HAPI_WIRE_CHANNEL_STATE, golden, sizeof golden,
                                &r->detail) == HAP_OK);
  REQUIRE(state_of(r, &came));
  CHECK(came->tick == 1000 && came->model_number == 2 && came->now_ns == -3);
  CHECK(came->time_scale == 1.0 && came->model == HAP_MODEL_CONTACT && came->body_high == 0);
}

/* ---- bad input ---- */

typedef struct broken {
  const char *name;
  size_t at;
  uint8_t value;
  const char *says;
} broken;

static const broken breaks[] = {
    {"another_version", 0, 2, "version 2"},
    {"another_channel", 1, 2, "not of channel"},
    {"unknown_flag", 2, 0x83, "malformed head"},
    {"number_zero", 4, 0, "malformed head"},
    {"base_before_all", 5, 5, "malformed head"},
    {"acknowledges_the_future", 7, 9, "acknowledges number 9"},
    {"directory_longer", 8, 4, "directory"},
    {"chunk_longer", 9, 9, "malformed head"},
    {"record_beyond_the_end", 10, 9, "no such record"},
    {"too_few_records", 11, 0, "bytes follow"},
    {"too_many_records", 11, 2, "no such record"},
    {"unknown_list", 12, 0x81, "directory"},
    {"two_heads", 13, 2, "directory"},
    {"label_beyond_the_end", 14, 8, "directory"},
    {"skips_beyond_the_end", 15, 9, "no such record"},
    {"cells_beyond_the_end", 31, 0xff, "too many cells"},
    {"unknown_model", 32, 0x08, "out of range"},
    {"infinite_time", 29, 0x7f, "time_scale"},
};

TEST_EACH(breaks, const broken *row)
{
  rig *r = rig_make();
  uint8_t bytes[sizeof golden];
  hapi_state *came;
  memcpy(bytes, golden, sizeof bytes);
  bytes[row->at] = row->value;
  hap_status status =
      hapi_wire_server_take(r->server, HAPI_WIRE_CHANNEL_STATE, bytes, sizeof bytes, &r->detail);
  CHECK(status == HAP_ERROR_FORMAT);
  CHECK_SAY(strstr(r->detail.text, row->says) != NULL, "said: %s", r->detail.text);
  CHECK(!state_of(r, &came));
}

/* ---- lists that are copied from the base ---- */

typedef struct copied_list {
  const char *name;
  uint8_t directory[4]; /* changed lists, records, code of a run, from */
  bool good;
} copied_list;

static const copied_list copies[] = {
    {"all_of_the_base", {8, 3, 2 * 3 + 1, 0}, true},
    {"one_of_the_base", {8, 1, 2 * 1 + 1, 2}, true},
    {"an_empty_run", {8, 1, 1, 0}, false},
    {"a_run_longer_than_the_list", {8, 1, 2 * 2 + 1, 0}, false},
    {"a_run_from_beyond_the_base", {8, 1, 2 * 1 + 1, 4}, false},
    {"a_run_that_ends_beyond_the_base", {8, 2, 2 * 2 + 1, 2}, false},
    {"a_run_of_an_empty_list", {16, 1, 2 * 1 + 1, 0}, false},
};

/* The base has three bodies. */
TEST_EACH(copies, const copied_list *row)
{
  rig *r = rig_make();
  const hapi_wire_out out = {&r->up, post_send};
  hapi_state *state = hapi_exchange_state_back(r->out);
  hapi_state *came;
  state->time_scale = 1.0;
  state->model = HAP_MODEL_CONTACT;
  state->body_high = 3;
  for (uint32_t i = 0; i < 3; ++i) {
    hapi_state_bodies(state)[i] =
        (hapi_state_body){.generation = 1 + i, .pose = {.quat_wxyz = {1.0, 0.0, 0.0, 0.0}}};
  }
  REQUIRE(hapi_wire_client_send(r->client, state, &out, &r->detail) == HAP_OK);
  for (uint32_t i = 0; i < r->up.count; ++i) {
    REQUIRE_SAY(take_up(r, &r->up.parcels[i]) == HAP_OK, "%s", r->detail.text);
  }
  REQUIRE(state_of(r, &came));
  CHECK(came->body_high == 3);
  const uint8_t *sent = r->up.parcels[r->up.count - 1].data;
  const uint8_t *d = row->directory;
  const uint8_t bytes[] = {sent[0], sent[1], 3, 0, sent[4] + 1, 1,    sent[6], sent[7],
                           4,       4,       0, 0, d[0],        d[1], d[2],    d[3]};
  CHECK(sent[2] == 3 && sent[4] < 127 && sent[6] < 128 && sent[7] < 128);
  hap_status status =
      hapi_wire_server_take(r->server, HAPI_WIRE_CHANNEL_STATE, bytes, sizeof bytes, &r->detail);
  CHECK_SAY(status == (row->good ? HAP_OK : HAP_ERROR_FORMAT), "%s", r->detail.text);
  CHECK(row->good || strstr(r->detail.text, "directory") != NULL);
  CHECK(state_of(r, &came) == row->good);
}

TEST(every_shortened_datagram_is_refused)
{
  for (uint32_t bytes = 0; bytes < sizeof golden; ++bytes) {
    rig *r = rig_make();
    hapi_state *came;
    CHECK(hapi_wire_server_take(r->server, HAPI_WIRE_CHANNEL_STATE, golden, bytes, &r->detail) ==
          HAP_ERROR_FORMAT);
    CHECK(r->detail.text[0] != '\0' && !state_of(r, &came));
    tap_release(r);
  }
}

TEST(replayed_and_future_messages_change_nothing)
{
  rig *r = rig_make();
  hapi_state *state;
  hapi_state *came;
  REQUIRE(send_up(r, &state) == HAP_OK);
  uint32_t old = r->up.count;
  for (int i = 0; i < 20; ++i) {
    REQUIRE(send_up(r, &state) == HAP_OK);
  }
  for (uint32_t i = 0; i < r->up.count; ++i) {
    REQUIRE(take_up(r, &r->up.parcels[i]) == HAP_OK);
  }
  REQUIRE(state_of(r, &came));
  CHECK(came->tick == state->tick);
  for (uint32_t i = 0; i < old; ++i) {
    CHECK(take_up(r, &r->up.parcels[i]) == HAP_OK);
  }
  CHECK(!state_of(r, &came));
  uint8_t bytes[sizeof golden + 4];
  memcpy(bytes, golden, 4);
  memcpy(bytes + 4, (const uint8_t[]){0xff, 0xff, 0xff, 0xff, 0x7f}, 5); /* number */
  memcpy(bytes + 9, golden + 5, sizeof golden - 5);
  CHECK(hapi_wire_server_take(r->server, HAPI_WIRE_CHANNEL_STATE, bytes, sizeof bytes,
                              &r->detail) == HAP_ERROR_FORMAT);
  CHECK(strstr(r->detail.text, "where the newest was") != NULL);
}

/* What a sender of its own could say. */
typedef struct false_member {
  const char *name;
  void (*spoil)(hapi_model *model, hapi_near *near);
  hap_status status; /* of the sender */
  const char *says;
} false_member;

static void spoil_mass(hapi_model *m, hapi_near *n)
{
  (void)n;
  hapi_model_bodies(m)[1].mass = 0.0;
}
static void spoil_held(hapi_model *m, hapi_near *n)
{
  (void)n;
  hapi_model_bodies(m)[1].held_mass = -1.0;
}
static void spoil_generation(hapi_model *m, hapi_near *n)
{
  (void)n;
  hapi_model_bodies(m)[1].generation = 0;
}
static void spoil_nan(hapi_model *m, hapi_near *n)
{
  (void)n;
  hapi_model_bodies(m)[1].gravity[1] = nan("");
}
static void spoil_far(hapi_model *m, hapi_near *n)
{
  (void)n;
  hapi_model_bodies(m)[1].pose.position[1] = 1e30;
}
static void spoil_quat(hapi_model *m, hapi_near *n)
{
  (void)n;
  hapi_model_bodies(m)[1].pose.quat_wxyz[1] += 0.1;
}
static void spoil_slot(hapi_model *m, hapi_near *n)
{
  (void)n;
  hapi_model_bodies(m)[1].slot = hapi_model_bodies(m)[2].slot;
}
static void spoil_inertia(hapi_model *m, hapi_near *n)
{
  (void)n;
  hapi_model_bodies(m)[1].inertia[4] = -1.0;
}
static void spoil_contact(hapi_model *m, hapi_near *n)
{
  (void)n;
  hapi_model_contacts(m)[0].body = 59;
}
static void spoil_pointer(hapi_model *m, hapi_near *n)
{
  (void)n;
  hapi_model_contacts(m)[0].pointer = 8;
}
static void spoil_joint(hapi_model *m, hapi_near *n)
{
  (void)n;
  hapi_model_joints(m)[0].body_a = HAPI_SLOT_NONE;
}
static void spoil_triangle(hapi_model *m, hapi_near *n)
{
  (void)m;
  hapi_near_geoms(n)[0].shape.hull_count = 3;
  hapi_near_geoms(n)[0].open_edges = 0x20;
}
static void spoil_edges(hapi_model *m, hapi_near *n)
{
  (void)m;
  hapi_near_geoms(n)[1].open_edges = 7;
}
static void spoil_hull(hapi_model *m, hapi_near *n)
{
  (void)m;
  hapi_near_geoms(n)[0].shape.hull_count = 1000;
}
static void spoil_rate(hapi_model *m, hapi_near *n)
{
  (void)m;
  n->contact_hz = 0.0;
}
static void spoil_tool(hapi_model *m, hapi_near *n)
{
  (void)m;
  hapi_near_tools(n)[0].hull.count = 65;
}
static void spoil_period(hapi_model *m, hapi_near *n)
{
  (void)n;
  m->period_s = 0.0;
}
static void spoil_model(hapi_model *m, hapi_near *n)
{
  (void)n;
  m->model = HAP_MODEL_ACCELERANCE;
}
static void spoil_said(hapi_model *m, hapi_near *n)
{
  (void)m;
  n->said_count = n->pair_count;
}
static void spoil_texture(hapi_model *m, hapi_near *n)
{
  (void)n;
  hapi_model_feels(m)[0].feel.more |= HAPI_FEEL_TEXTURE;
}

static const false_member lies[] = {
    {"mass", spoil_mass, HAP_OK, "mass"},
    {"held_mass", spoil_held, HAP_OK, "mass"},
    {"generation", spoil_generation, HAP_OK, "generation"},
    {"nan", spoil_nan, HAP_ERROR_ARGUMENT, "gravity"},
    {"far", spoil_far, HAP_ERROR_ARGUMENT, "position"},
    {"quat", spoil_quat, HAP_OK, "quat"},
    {"slot", spoil_slot, HAP_OK, "slot"},
    {"inertia", spoil_inertia, HAP_OK, "inertia"},
    {"contact", spoil_contact, HAP_OK, "contact"},
    {"pointer", spoil_pointer, HAP_OK, "contact"},
    {"joint", spoil_joint, HAP_OK, "joint"},
    {"edges", spoil_edges, HAP_OK, "edges"},
    {"triangle", spoil_triangle, HAP_OK, "a triangle has edges"},
    {"hull", spoil_hull, HAP_OK, "points"},
    {"rate", spoil_rate, HAP_OK, "head"},
    {"tool", spoil_tool, HAP_OK, "tool"},
    {"period", spoil_period, HAP_OK, "head"},
    {"model", spoil_model, HAP_ERROR_UNSUPPORTED, "CONTACT"},
    {"said", spoil_said, HAP_ERROR_UNSUPPORTED, "asked"},
    {"texture", spoil_texture, HAP_ERROR_UNSUPPORTED, "texture"},
};

TEST_EACH(lies, const false_member *row)
{
  rig *r = rig_make();
  const hapi_wire_out out = {&r->down, post_send};
  hapi_model *model;
  hapi_near *near;
  hapi_model *came;
  hapi_near *came_near;
  REQUIRE(send_down(r, &model, &near) == HAP_OK);
  take_all(r);
  REQUIRE(world_of(r, &came, &came_near));
  wire_world_step(&r->world, &model, &near);
  row->spoil(model, near);
  hap_status status = hapi_wire_server_send(r->server, model, near, &out, &r->detail);
  CHECK(status == row->status);
  hap_status taken = status;
  for (uint32_t i = 0; i < r->down.count && taken >= HAP_OK; ++i) {
    taken = take_down(r, &r->down.parcels[i]);
  }
  CHECK(taken < HAP_OK && !world_of(r, &came, &came_near));
  CHECK_SAY(strstr(r->detail.text, row->says) != NULL, "said: %s", r->detail.text);
  CHECK(r->down.count > 0 || status < HAP_OK);
  if (status < HAP_OK) { /* and the next one goes */
    REQUIRE(send_down(r, &model, &near) == HAP_OK);
    take_all(r);
    REQUIRE(world_of(r, &came, &came_near));
    CHECK(compare_models(model, came) == NULL);
  }
}

static bool model_can_be(hapi_model *m, hapi_near *n)
{
  bool good = m->body_count <= wire_capacity.bodies && m->contact_count <= wire_capacity.contacts &&
              m->joint_count <= wire_capacity.joints && n->pair_count <= wire_capacity.pairs;
  for (uint32_t i = 0; i < m->body_count; ++i) {
    const hapi_model_body *b = &hapi_model_bodies(m)[i];
    good = good && b->slot < wire_capacity.bodies && b->course <= m->course_count &&
           hapi_assert_is_unit(b->pose.quat_wxyz, 4) && isfinite(b->mass) &&
           isfinite(b->twist.linear[0] + b->gain_taken[5]);
  }
  for (uint32_t i = 0; i < m->contact_count; ++i) {
    const hapi_model_contact *c = &hapi_model_contacts(m)[i];
    good = good && c->slot < wire_capacity.contacts && c->pointer < 2 * wire_capacity.pointers &&
           c->told.first + c->told.count <= m->triangle_count;
  }
  for (uint32_t i = 0; i < n->pair_count; ++i) {
    const hapi_near_pair *p = &hapi_near_pairs(n)[i];
    good = good && p->geom_a < n->geom_count && p->geom_b < n->geom_count;
  }
  for (uint32_t i = 0; i < n->geom_count; ++i) {
    const hapi_near_geom *g = &hapi_near_geoms(n)[i];
    good = good && g->hull_first + (g->shape.kind == HAPI_SHAPE_HULL ? g->shape.hull_count : 0) <=
                       n->point_count;
  }
  return good;
}

/* Bytes are changed, cut and swapped: what is given then can be, and whole ones come again. */
TEST(changed_bytes_do_no_harm)
{
  rig *r = rig_make();
  wire_dice dice = {99};
  uint32_t refused = 0;
  uint32_t given = 0;
  for (uint32_t step = 0; step < 4000; ++step) {
    hapi_model *model;
    hapi_near *near;
    hapi_state *state;
    REQUIRE(send_down(r, &model, &near) == HAP_OK);
    REQUIRE(send_up(r, &state) == HAP_OK);
    for (uint32_t i = 0; i < r->down.count + r->up.count; ++i) {
      bool down = i < r->down.count;
      parcel *p = down ? &r->down.parcels[i] : &r->up.parcels[i - r->down.count];
      bool spoil = dice_below(&dice, 10) == 0;
      for (uint32_t k = dice_below(&dice, 4); spoil && k > 0; --k) {
        p->data[dice_below(&dice, p->bytes)] = (uint8_t)dice_below(&dice, 256);
      }
      p->bytes = spoil && dice_below(&dice, 4) == 0 ? dice_below(&dice, p->bytes + 1) : p->bytes;
      refused += (down ? take_down(r, p) : take_up(r, p)) < HAP_OK;
    }
    r->down.count = r->up.count = 0;
    if (world_of(r, &model, &near)) {
      ++given;
      CHECK(model_can_be(model, near));
    }
    hapi_state *came;
    if (state_of(r, &came)) {
      CHECK(came->body_high <= wire_capacity.bodies && came->model <= HAP_MODEL_CONTACT);
    }
    if (step % 40 == 39) { /* a description was spoilt: nothing goes on without it */
      hapi_wire_server_destroy(r->server);
      hapi_wire_client_destroy(r->client);
      r->server = NULL, r->client = NULL;
      REQUIRE(hapi_wire_server_create(&wire_capacity, &r->server) == HAP_OK);
      REQUIRE(hapi_wire_client_create(&wire_capacity, &r->client) == HAP_OK);
    }
  }
  printf("# %u refused, %u models given\n", refused, given);
  CHECK(refused > 1000 && given > 50);
}

/* ---- memory ---- */

static uint64_t allocations;

static void *counting_allocate(size_t size, void *user)
{
  (void)user;
  ++allocations;
  return calloc(1, size);
}

static void counting_release(void *memory, void *user)
{
  (void)user;
  free(memory);
}

static void hooks_restore(void)
{
  hapi_hooks_use(&(hap_hooks){.size = sizeof(hap_hooks)});
}

TEST(nothing_is_allocated_after_create)
{
  hap_hooks hooks = {.size = sizeof hooks};
  hooks.allocate = counting_allocate;
  hooks.release = counting_release;
  hapi_hooks_use(&hooks);
  rig *r = rig_make();
  uint64_t before = allocations;
  CHECK(before > 0);
  for (int i = 0; i < 100; ++i) {
    hapi_model *model;
    hapi_near *near;
    hapi_state *state;
    REQUIRE(send_down(r, &model, &near) == HAP_OK && send_up(r, &state) == HAP_OK);
    take_all(r);
    REQUIRE(world_of(r, &model, &near) && state_of(r, &state));
  }
  CHECK(allocations == before);
  tap_release(r);
  hooks_restore();
}
