/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Touches, contacts and events, as an application sees them: by the public headers, against closed
 * forms and the world's own books. */

#include "tests/tap.h"

#include <pthread.h>
#include <stdatomic.h>
#include <time.h>

#include "tests/desk.h"
#include "tests/fake_device.h"

#define EVENTS 256

static size_t touches_of(desk *d, hap_touch *out, size_t capacity)
{
  size_t count = 0;
  hap_status status = hap_pointer_touches(d->session, d->hand, out, capacity, sizeof *out, &count);
  CHECK(status == (count > 0 ? HAP_OK : HAP_END) || status == HAP_STALE);
  return count;
}

static size_t events_of(desk *d, hap_event *out)
{
  size_t count = 0;
  hap_status status = hap_session_events(d->session, out, EVENTS, sizeof *out, &count);
  CHECK(status == (count > 0 ? HAP_OK : HAP_END));
  return count;
}

/* Forgets what has happened so far. */
static void desk_listen(desk *d)
{
  hap_touch touch;
  hap_body_contact contact;
  hap_event events[EVENTS];
  size_t count = 0;
  (void)touches_of(d, &touch, 1);
  (void)hap_session_contacts(d->session, &contact, 1, sizeof contact, &count);
  (void)events_of(d, events);
}

/* ---- touches ---- */

typedef struct model_row {
  const char *name;
  hap_model model;
} model_row;

static const model_row models[] = {
    {"a_floor_is_touched_with_the_force_of_its_spring_in_model_single", HAP_MODEL_SINGLE},
    {"a_floor_is_touched_with_the_force_of_its_spring_in_model_impulse", HAP_MODEL_IMPULSE},
    {"a_floor_is_touched_with_the_force_of_its_spring_in_model_accelerance", HAP_MODEL_ACCELERANCE},
    {"a_floor_is_touched_with_the_force_of_its_spring_in_model_contact", HAP_MODEL_CONTACT},
};

TEST_EACH(models, const model_row *row)
{
  const double depth = 0.002;
  hap_touch touch[2] = {{0}};
  desk *d = desk_new(0.0, row->model);
  dGeomID ground = floor_add(d);
  desk_run(d, 0.1, -0.2, RADIUS + 0.002);
  desk_listen(d);
  desk_wait(d, 40);
  CHECK(touches_of(d, touch, 2) == 0);
  desk_move(d, 0.0, 0.0, -0.002 - depth, 200);
  desk_wait(d, 50);
  REQUIRE(touches_of(d, touch, 2) == 1);
  CHECK(touch->geom == ground);
  CHECK(touch->body == NULL);
  CHECK(touch->points == 1);
  check_vector(touch->normal, 0.0, 0.0, 1.0, 1e-12);
  check_vector(touch->point, 0.1, -0.2, 0.0, 1e-9);
  check_vector(touch->force, 0.0, 0.0, STIFFNESS * depth, 1e-9);
  check_vector(touch->slip, 0.0, 0.0, 0.0, 1e-12);
  CHECK(touch->is_sliding == 0);
  /* 40 ticks, and half of the way down, to the tick */
  CHECK(llabs(touch->since_ns - 107000000) <= 34000000);
  desk_move(d, 0.0, 0.0, 0.01, 20);
  CHECK(touches_of(d, touch, 2) == 0);
}

TEST(a_body_and_each_of_its_geoms_are_told_the_hardest_first)
{
  hap_touch touch[4] = {{0}};
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  dBodyID block = ode_box(d->world, d->space, 1e6, AT(0.2, 0.2, 0.1), AT(0.0, 0.0, -0.05));
  dGeomID top = dBodyGetFirstGeom(block);
  dGeomID wall = dCreateBox(d->space, 0.1, 0.2, 0.2);
  dGeomSetBody(wall, block);
  dGeomSetOffsetPosition(wall, 0.1, 0.0, 0.05 + 0.1);
  desk_run(d, 0.04, 0.0, 0.02); /* the wall's face is at x = 0.05 */
  desk_listen(d);
  desk_wait(d, 30);
  desk_move(d, 0.003, 0.0, -0.011, 300); /* 3 mm in the wall, 1 mm in the top */
  desk_wait(d, 20);
  REQUIRE(touches_of(d, touch, 4) == 2);
  CHECK(touch[0].geom == wall && touch[1].geom == top);
  CHECK(touch[0].body == block && touch[1].body == block);
  check_vector(touch[0].normal, -1.0, 0.0, 0.0, 1e-4);
  check_vector(touch[1].normal, 0.0, 0.0, 1.0, 1e-4);
  CHECK_NEAR(touch[0].force[0], -3.0, 0.05);
  CHECK_NEAR(touch[1].force[2], 1.0, 0.05);
  hap_touch only = {0};
  REQUIRE(touches_of(d, &only, 1) == 1);
  CHECK(only.geom == wall);
}

TEST(a_hull_touches_a_floor_once_with_all_of_its_corners)
{
  static const double corners[] = {-0.02, -0.01, 0.0,   0.02, -0.01, 0.0,   -0.02, 0.01,
                                   0.0,   0.02,  0.01,  0.0,  -0.02, -0.01, 0.02,  0.02,
                                   -0.01, 0.02,  -0.02, 0.01, 0.02,  0.02,  0.01,  0.02};
  hap_touch touch[4] = {{0}};
  hap_pointer_state state;
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  dGeomID ground = floor_add(d);
  d->hand_def.radius = 0.0;
  d->hand_def.hull_xyz = corners;
  d->hand_def.hull_points = 8;
  d->hand_def.friction = 0.5;
  desk_run(d, 0.0, 0.0, 0.001);
  desk_listen(d);
  desk_wait(d, 30);
  desk_move(d, 0.0, 0.0, -0.003, 100);
  desk_move(d, 0.03, 0.0, 0.0, 100);
  REQUIRE(touches_of(d, touch, 4) == 1);
  REQUIRE(hap_pointer_get(d->session, d->hand, &state, sizeof state) == HAP_OK);
  CHECK(touch->geom == ground && touch->points == 4);
  check_vector(touch->point, 0.03, 0.0, -0.001, 1.1e-3);
  check_vector(touch->force, state.wrench.force[0], state.wrench.force[1], state.wrench.force[2],
               1e-9);
  CHECK_NEAR(touch->force[2], 2.0, 0.02);
  CHECK_NEAR(touch->force[0], -0.5 * touch->force[2], 1e-3); /* it slides */
  CHECK(touch->is_sliding == 1);
  check_vector(touch->slip, 0.3, 0.0, 0.0, 1e-9);
}

/* Sticking friction is a spring of the contact's stiffness: it lets go after mu x depth. */
TEST(a_finger_slides_from_where_friction_lets_it_go)
{
  const double depth = 0.002;
  const double mu = 0.5;
  hap_event events[EVENTS];
  hap_touch touch = {0};
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  floor_add(d);
  d->hand_def.friction = mu;
  desk_run(d, 0.0, 0.0, RADIUS + 0.001);
  desk_listen(d);
  desk_wait(d, 30);
  desk_move(d, 0.0, 0.0, -0.001 - depth, 100);
  desk_wait(d, 10);
  (void)events_of(d, events);
  desk_move(d, 0.9 * mu * depth, 0.0, 0.0, 90);
  REQUIRE(touches_of(d, &touch, 1) == 1);
  CHECK(touch.is_sliding == 0);
  CHECK(events_of(d, events) == 0);
  desk_move(d, 0.2 * mu * depth, 0.0, 0.0, 20);
  REQUIRE(events_of(d, events) == 1);
  CHECK(events->kind == HAP_EVENT_SLIDE);
  CHECK_NEAR(events->speed, 0.01, 1e-6);
  REQUIRE(touches_of(d, &touch, 1) == 1);
  CHECK(touch.is_sliding == 1);
  desk_wait(d, 20);
  REQUIRE(events_of(d, events) == 1);
  CHECK(events->kind == HAP_EVENT_STICK);
}

/* A belt runs below the finger, and a lift comes up to another one: speeds are those that the body
 * sees. */
TEST(speeds_are_against_the_body)
{
  hap_event e[EVENTS];
  hap_touch touch = {0};
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  dBodyID belt = ode_box(d->world, d->space, 1.0, AT(2.0, 0.2, 0.02), AT(0.0, 0.0, -0.01));
  dBodySetKinematic(belt);
  dBodySetLinearVel(belt, 0.3, 0.0, 0.0);
  desk_run(d, 0.0, 0.0, RADIUS - 0.001);
  desk_listen(d);
  desk_wait(d, 100);
  REQUIRE(touches_of(d, &touch, 1) == 1);
  CHECK(touch.body == belt && touch.is_sliding == 1);
  check_vector(touch.slip, -0.3, 0.0, 0.0, 1e-6);
  tap_release(d);

  d = desk_new(0.0, HAP_MODEL_CONTACT);
  dBodyID lift = ode_box(d->world, d->space, 1.0, AT(0.2, 0.2, 0.02), AT(0.0, 0.0, -0.03));
  dBodySetKinematic(lift);
  dBodySetLinearVel(lift, 0.0, 0.0, 0.2);
  desk_run(d, 0.0, 0.0, RADIUS);
  desk_listen(d);
  desk_wait(d, 150);
  REQUIRE(events_of(d, e) >= 2);
  CHECK(e[0].kind == HAP_EVENT_TOUCH && e[0].body == lift);
  CHECK_NEAR(e[0].speed, 0.2, 1e-3);
  CHECK(llabs(e[0].time_ns - 100000000) <= 2000000); /* 20 mm away */
  CHECK(e[1].kind == HAP_EVENT_IMPACT);              /* ended by its time: the lift goes on */
  CHECK(llabs(e[1].time_ns - e[0].time_ns - 20000000) <= 1000000);
}

/* What is hit leaves: its speed before the blow counts. */
TEST(a_ball_that_flies_at_the_finger_closes_with_its_speed)
{
  hap_event e[EVENTS];
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  dBodyID ball = ode_ball(d->world, d->space, 0.001, 0.02, AT(0.1, 0.0, 0.0));
  dBodySetLinearVel(ball, -0.5, 0.0, 0.0);
  desk_run(d, 0.0, 0.0, 0.0);
  desk_listen(d);
  desk_wait(d, 400);
  REQUIRE(events_of(d, e) >= 2);
  CHECK(e[0].kind == HAP_EVENT_TOUCH && e[0].body == ball);
  CHECK_NEAR(e[0].speed, 0.5, 1e-3);
}

TEST(touches_give_the_impulse_that_a_body_gets)
{
  double sum[3] = {0.0, 0.0, 0.0};
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  dBodyID ball = ode_ball(d->world, d->space, 0.3, 0.03, AT(0.0, 0.0, 0.0));
  desk_run(d, -0.05, 0.004, 0.0);
  desk_listen(d);
  desk_wait(d, 20);
  for (int i = 0; i < 200; ++i) {
    hap_touch touch = {0};
    desk_move(d, 0.0005, 0.0, 0.0, 1);
    if (touches_of(d, &touch, 1) == 1) {
      CHECK(touch.body == ball);
      hapi_v3_madd(sum, -T, touch.force, sum);
    }
  }
  desk_wait(d, 100); /* the ball has left, and the world has it all */
  const dReal *v = dBodyGetLinearVel(ball);
  CHECK(sum[0] > 0.1);
  check_vector(sum, 0.3 * v[0], 0.3 * v[1], 0.3 * v[2], 1e-3 * sum[0]);
}

/* ---- events ---- */

/* A hand that dips into a floor as half a sine does: closed forms for speed and impulse. */
TEST(a_tap_is_a_touch_a_blow_and_a_release)
{
  const double depth = 0.004;
  const int ticks = 20; /* of the half sine; its quarter is shorter than the longest blow */
  const double turn = M_PI / (ticks * T);
  hap_event e[EVENTS];
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  dGeomID ground = floor_add(d);
  desk_run(d, 0.0, 0.0, RADIUS + 1e-6);
  desk_listen(d);
  desk_wait(d, 30);
  CHECK(events_of(d, e) == 0);
  int64_t begin = hap_session_now(d->session);
  for (int i = 0; i <= ticks; ++i) {
    d->at[2] = RADIUS - depth * sin(turn * i * T);
    d->velocity[2] = -depth * turn * cos(turn * i * T);
    hand_lead(d);
    REQUIRE(hap_session_advance(d->session, 1) >= HAP_OK);
  }
  desk_move(d, 0.0, 0.0, 0.01, 20);
  REQUIRE(events_of(d, e) >= 3);
  CHECK(e[0].kind == HAP_EVENT_TOUCH);
  CHECK(e[1].kind == HAP_EVENT_IMPACT);
  CHECK(e[2].kind == HAP_EVENT_RELEASE);
  for (int i = 0; i < 3; ++i) {
    CHECK(e[i].pointer.v == d->hand.v && e[i].geom == ground && e[i].body == NULL);
    check_vector(e[i].normal, 0.0, 0.0, 1.0, 1e-9);
  }
  CHECK(llabs(e[0].time_ns - begin) <= 2000000);
  CHECK(llabs(e[1].time_ns - begin - 10000000) <= 2000000);
  CHECK(llabs(e[2].time_ns - begin - 25000000) <= 3000000); /* 5 ms after the last force */
  CHECK_NEAR(e[0].speed, depth * turn, 0.02 * depth * turn);
  CHECK_NEAR(e[1].speed, e[0].speed, 1e-12);
  CHECK_NEAR(e[1].impulse, STIFFNESS * depth / turn, 0.1 * STIFFNESS * depth / turn);
  CHECK_NEAR(e[2].impulse, 2.0 * STIFFNESS * depth / turn, 0.01 * STIFFNESS * depth / turn);
}

TEST(what_leaves_with_its_pointer_or_its_geom_is_released)
{
  hap_event e[EVENTS];
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  dGeomID ground = floor_add(d);
  desk_run(d, 0.0, 0.0, RADIUS - 0.001);
  desk_listen(d);
  desk_wait(d, 60);
  REQUIRE(events_of(d, e) == 1);
  CHECK(e->kind == HAP_EVENT_TOUCH && e->geom == ground);
  REQUIRE(hap_session_lock(d->session) == HAP_OK);
  CHECK(hap_session_forget_geom(d->session, ground) == HAP_OK);
  dGeomDestroy(ground);
  CHECK(hap_session_unlock(d->session) == HAP_OK);
  desk_wait(d, 60);
  REQUIRE(events_of(d, e) == 1);
  CHECK(e->kind == HAP_EVENT_RELEASE && e->geom == ground); /* compared only */
  dGeomID other = floor_add(d);
  desk_wait(d, 60);
  REQUIRE(events_of(d, e) == 1);
  CHECK(e->kind == HAP_EVENT_TOUCH && e->geom == other);
  REQUIRE(hap_pointer_remove(d->session, d->hand) == HAP_OK);
  REQUIRE(hap_session_advance(d->session, 3) >= HAP_OK);
  REQUIRE(events_of(d, e) == 1);
  CHECK(e->kind == HAP_EVENT_RELEASE && e->geom == other && e->pointer.v == d->hand.v);
  hap_touch touch;
  size_t count = 7;
  CHECK(hap_pointer_touches(d->session, d->hand, &touch, 1, sizeof touch, &count) ==
        HAP_ERROR_NOT_FOUND);
  CHECK(count == 0);
}

static uint32_t buttons_now;

static hap_status press_buttons(fake_device *device, int64_t time_ns, hap_pose *io,
                                uint32_t *buttons)
{
  (void)device;
  (void)time_ns;
  (void)io;
  *buttons = buttons_now;
  return HAP_OK;
}

static void desk_take_fake(desk *d)
{
  fakes_opened = 0;
  fake_next()->move = press_buttons;
  d->hand_def.device = fake_device_open(HAP_PACING_VIRTUAL);
}

TEST(buttons_and_faults_are_events)
{
  hap_event e[EVENTS];
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  desk_take_fake(d);
  d->session = session_make(&d->def, &d->ode);
  REQUIRE(hap_pointer_add(d->session, &d->hand_def, &d->hand) == HAP_OK);
  session_run(d->session);
  desk_listen(d);
  buttons_now = 5;
  REQUIRE(hap_session_advance(d->session, 2) >= HAP_OK);
  buttons_now = 1;
  REQUIRE(hap_session_advance(d->session, 2) >= HAP_OK);
  REQUIRE(events_of(d, e) == 3);
  CHECK(e[0].kind == HAP_EVENT_BUTTON && e[0].number == 0 && e[0].is_down == 1);
  CHECK(e[1].kind == HAP_EVENT_BUTTON && e[1].number == 2 && e[1].is_down == 1);
  CHECK(e[2].kind == HAP_EVENT_BUTTON && e[2].number == 2 && e[2].is_down == 0);
  CHECK(e[2].pointer.v == d->hand.v);
  fakes[0].fail_read = 1;
  (void)hap_session_advance(d->session, 2);
  REQUIRE(events_of(d, e) == 1);
  CHECK(e->kind == HAP_EVENT_FAULT && e->number == HAP_FAULT_DEVICE_READ);
  CHECK(e->pointer.v == d->hand.v);
  fakes[0].fail_read = 0;
  REQUIRE(hap_session_reset_fault(d->session) == HAP_OK);
  (void)hap_session_advance(d->session, 2);
  hap_emergency_zero();
  (void)hap_session_advance(d->session, 2);
  REQUIRE(events_of(d, e) == 1);
  CHECK(e->kind == HAP_EVENT_FAULT && e->number == HAP_FAULT_EMERGENCY && e->pointer.v == 0);
  hap_session_destroy(d->session);
  d->session = NULL;
  hap_device_close(d->hand_def.device);
}

TEST(events_without_room_are_counted)
{
  static hap_event e[2000];
  size_t count = 0;
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  desk_take_fake(d);
  d->session = session_make(&d->def, &d->ode);
  REQUIRE(hap_pointer_add(d->session, &d->hand_def, &d->hand) == HAP_OK);
  buttons_now = 0;
  session_run(d->session);
  desk_listen(d);
  for (int i = 0; i < 1200; ++i) {
    buttons_now = i % 2 == 0;
    REQUIRE(hap_session_advance(d->session, 1) >= HAP_OK);
  }
  CHECK(hap_session_events(d->session, e, 2000, sizeof *e, &count) == HAP_OK);
  CHECK(count == 1024);
  CHECK(session_stats(d->session).events.dropped == 1200 - 1024);
  for (size_t i = 0; i + 1 < count; ++i) {
    CHECK(e[i].time_ns < e[i + 1].time_ns && e[i].is_down != e[i + 1].is_down);
  }
  CHECK(hap_session_events(d->session, e, 2000, sizeof *e, &count) == HAP_END && count == 0);
  hap_session_destroy(d->session);
  d->session = NULL;
  hap_device_close(d->hand_def.device);
}

/* ---- contacts of bodies ---- */

TEST(a_pushed_pile_tells_who_presses_on_whom)
{
  hap_body_contact c[16];
  hap_touch touch = {0};
  size_t count = 0;
  desk *d = desk_new(10.0, HAP_MODEL_CONTACT);
  dGeomID ground = floor_add(d);
  dBodyID low = ode_box(d->world, d->space, 0.5, AT(0.1, 0.1, 0.05), AT(0.0, 0.0, 0.025));
  dBodyID high = ode_box(d->world, d->space, 0.3, AT(0.08, 0.08, 0.05), AT(0.0, 0.0, 0.075));
  desk_run(d, 0.01, 0.0, 0.1 + RADIUS + 0.001);
  desk_listen(d);
  desk_wait(d, 100);
  desk_move(d, 0.0, 0.0, -0.003, 100);
  desk_wait(d, 500);
  REQUIRE(touches_of(d, &touch, 1) == 1);
  CHECK(touch.body == high);
  CHECK_NEAR(touch.force[2], 2.0, 0.2);
  REQUIRE(hap_session_contacts(d->session, c, 16, sizeof *c, &count) == HAP_OK);
  REQUIRE(count == 2);
  bool found[2] = {false, false};
  for (size_t i = 0; i < count; ++i) {
    bool of_floor = c[i].geom_a == ground || c[i].geom_b == ground;
    double side = c[i].body_a == (of_floor ? low : high) ? 1.0 : -1.0; /* of what lies above */
    double carried = (of_floor ? 0.8 : 0.3) * 10.0 + touch.force[2];
    found[of_floor] = true;
    CHECK(c[i].points >= 3 && c[i].points <= 4);
    CHECK_NEAR(side * c[i].force[2], carried, 0.02 * carried);
    CHECK_NEAR(side * c[i].normal[2], 1.0, 1e-3);
    CHECK_NEAR(c[i].point[2], of_floor ? 0.0 : 0.05, 1e-3);
    CHECK(of_floor || (c[i].body_a == low) != (c[i].body_a == high));
  }
  CHECK(found[0] && found[1]);
}

TEST(who_moves_a_body_is_told)
{
  hap_body_role roles[4];
  desk *d = desk_new(10.0, HAP_MODEL_CONTACT);
  floor_add(d);
  dBodyID bodies[4];
  for (int i = 0; i < 3; ++i) {
    bodies[i] = ode_box(d->world, d->space, 0.1, AT(0.04, 0.04, 0.04), AT(0.041 * i, 0.0, 0.02));
  }
  dBodySetPosition(bodies[2], 5.0, 0.0, 0.02); /* far */
  bodies[3] = ode_box(d->world, d->space, 0.1, AT(0.04, 0.04, 0.04), AT(0.0, 0.05, 0.02));
  dBodySetKinematic(bodies[3]);
  desk_run(d, -0.04, 0.0, 0.02);
  desk_move(d, 0.011, 0.0, 0.0, 200);
  REQUIRE(hap_session_roles(d->session, bodies, 4, roles) == HAP_OK);
  CHECK(roles[0] == HAP_ROLE_LOOP && roles[1] == HAP_ROLE_LOOP);
  CHECK(roles[2] == HAP_ROLE_WORLD && roles[3] == HAP_ROLE_DRIVEN);
  REQUIRE(hap_session_set_model(d->session, HAP_MODEL_ACCELERANCE) == HAP_OK);
  desk_wait(d, 100);
  REQUIRE(hap_session_roles(d->session, bodies, 4, roles) == HAP_OK);
  CHECK(roles[0] == HAP_ROLE_MEASURED && roles[2] == HAP_ROLE_WORLD);
  REQUIRE(hap_session_set_model(d->session, HAP_MODEL_IMPULSE) == HAP_OK);
  desk_wait(d, 100);
  REQUIRE(hap_session_roles(d->session, bodies, 1, roles) == HAP_OK);
  CHECK(roles[0] == HAP_ROLE_WORLD);
  dBodyID stranger = dBodyCreate(d->world);
  CHECK(hap_session_roles(d->session, &stranger, 1, roles) == HAP_ERROR_NOT_FOUND);
  CHECK(hap_session_roles(d->session, NULL, 1, roles) == HAP_ERROR_ARGUMENT);
}

/* ---- it changes nothing, and takes what it is given ---- */

static uint64_t hash_of_run(bool asks)
{
  desk *d = desk_new(10.0, HAP_MODEL_CONTACT);
  floor_add(d);
  for (int i = 0; i < 4; ++i) {
    ode_box(d->world, d->space, 0.1, AT(0.04, 0.04, 0.04), AT(0.041 * i, 0.0, 0.02));
  }
  desk_run(d, -0.04, 0.0, 0.02);
  for (int i = 0; i < 300; ++i) {
    desk_move(d, 0.0002, 0.0, 0.0, 1);
    if (asks) {
      desk_listen(d);
    }
  }
  uint64_t hash = session_stats(d->session).loop.trace_hash;
  tap_release(d);
  return hash;
}

TEST(asking_changes_nothing)
{
  CHECK(hash_of_run(false) == hash_of_run(true));
}

static void stroke_world(desk *d)
{
  floor_add(d);
  ode_box(d->world, d->space, 0.1, AT(0.04, 0.04, 0.04), AT(0.05, 0.0, 0.02));
}

TEST(a_replay_tells_the_same_events)
{
  hap_event told[EVENTS];
  hap_event again[EVENTS];
  size_t count = 0;
  desk *d = desk_new(10.0, HAP_MODEL_CONTACT);
  stroke_world(d);
  d->hand_def.friction = 0.3;
  desk_record(d, "touches.rec", 0.02);
  (void)events_of(d, told);
  session_run(d->session);
  desk_glide(d, 0.0, 0.0, -0.012);
  desk_glide(d, 0.05, 0.0, 0.0);
  desk_glide(d, 0.0, 0.0, 0.02);
  CHECK(hap_session_stop(d->session) == HAP_OK);
  size_t number = events_of(d, told);
  CHECK(number >= 3); /* at least of the floor: touch, slide, release */
  tap_release(d);

  desk *r = desk_new(10.0, HAP_MODEL_CONTACT);
  stroke_world(r);
  desk_replay(r, "touches.rec");
  (void)events_of(r, again);
  desk_play(r);
  REQUIRE(hap_session_events(r->session, again, EVENTS, sizeof *again, &count) == HAP_OK);
  REQUIRE(count == number);
  for (size_t i = 0; i < count; ++i) { /* but for the addresses of geoms and bodies */
    CHECK(again[i].kind == told[i].kind && again[i].time_ns == told[i].time_ns);
    CHECK(memcmp(again[i].point, told[i].point, sizeof told[i].point) == 0);
    CHECK(again[i].speed == told[i].speed && again[i].impulse == told[i].impulse);
    CHECK((again[i].body == NULL) == (told[i].body == NULL));
  }
}

TEST(the_first_call_begins_it_and_says_so)
{
  hap_touch touch = {0};
  hap_body_contact contact = {0};
  size_t count = 9;
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  floor_add(d);
  desk_run(d, 0.0, 0.0, RADIUS - 0.001);
  desk_wait(d, 50);
  CHECK(hap_pointer_touches(d->session, d->hand, &touch, 1, sizeof touch, &count) == HAP_STALE);
  CHECK(count == 0);
  CHECK(hap_session_contacts(d->session, &contact, 1, sizeof contact, &count) == HAP_STALE);
  desk_wait(d, 1);
  CHECK(hap_pointer_touches(d->session, d->hand, &touch, 1, sizeof touch, &count) == HAP_OK);
  CHECK(count == 1);
  CHECK(hap_session_contacts(d->session, &contact, 1, sizeof contact, &count) == HAP_END);
}

TEST(another_geom_at_the_same_address_is_touched_anew)
{
  hap_event events[EVENTS];
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  dGeomID tile = dCreateBox(d->space, 0.1, 0.1, 0.02);
  dGeomSetPosition(tile, 0.0, 0.0, -0.01);
  desk_run(d, 0.0, 0.0, RADIUS - 0.001);
  desk_listen(d);
  desk_wait(d, 100);
  (void)events_of(d, events);
  REQUIRE(hap_session_lock(d->session) == HAP_OK);
  CHECK(hap_session_forget_geom(d->session, tile) == HAP_OK);
  dGeomDestroy(tile);
  dGeomID other = dCreateBox(d->space, 0.1, 0.1, 0.02);
  dGeomSetPosition(other, 0.0, 0.0, -0.01);
  REQUIRE(hap_session_unlock(d->session) == HAP_OK);
  desk_wait(d, 100);
  size_t count = events_of(d, events);
  int kinds[HAP_EVENT_LET_GO + 1] = {0};
  for (size_t i = 0; i < count; ++i) {
    ++kinds[events[i].kind];
  }
  printf("# at %s address\n", other == tile ? "the same" : "another");
  CHECK(kinds[HAP_EVENT_RELEASE] == 1 && kinds[HAP_EVENT_TOUCH] == 1);
}

TEST(structs_of_other_builds_and_wrong_calls_are_met)
{
  struct {
    hap_touch touch;
    double later;
  } large = {.later = 3.0};
  void *small = NULL;
  hap_touch touch;
  hap_event event;
  hap_body_contact contact;
  size_t count = 0;
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  dGeomID ground = floor_add(d);
  desk_run(d, 0.0, 0.0, RADIUS - 0.001);
  desk_listen(d);
  desk_wait(d, 60);
  CHECK(hap_pointer_touches(d->session, d->hand, &large.touch, 1, sizeof large, &count) == HAP_OK);
  CHECK(large.touch.geom == ground && large.later == 3.0);
  CHECK(hap_pointer_touches(d->session, d->hand, (hap_touch *)(void *)&small, 1, sizeof small,
                            &count) == HAP_OK);
  CHECK(small == ground);
  CHECK(hap_pointer_touches(d->session, d->hand, &touch, 0, sizeof touch, &count) == HAP_END);
  CHECK(hap_pointer_touches(NULL, d->hand, &touch, 1, sizeof touch, &count) == HAP_ERROR_ARGUMENT);
  CHECK(hap_pointer_touches(d->session, d->hand, NULL, 1, sizeof touch, &count) ==
        HAP_ERROR_ARGUMENT);
  CHECK(hap_pointer_touches(d->session, d->hand, &touch, 1, 3, &count) == HAP_ERROR_ARGUMENT);
  CHECK(hap_pointer_touches(d->session, d->hand, &touch, 1, sizeof touch, NULL) ==
        HAP_ERROR_ARGUMENT);
  CHECK(hap_pointer_touches(d->session, (hap_pointer_id){12345}, &touch, 1, sizeof touch, &count) ==
        HAP_ERROR_NOT_FOUND);
  CHECK(hap_session_events(d->session, &event, 1, 8, &count) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_events(NULL, &event, 1, sizeof event, &count) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_contacts(d->session, &contact, 1, 4, &count) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_contacts(d->session, NULL, 1, sizeof contact, &count) == HAP_ERROR_ARGUMENT);
  for (int kind = HAP_EVENT_TOUCH; kind <= HAP_EVENT_LET_GO; ++kind) {
    CHECK((hap_event_name((hap_event_kind)kind) != NULL) == (kind != 9)); /* 9 is none */
  }
  CHECK(hap_event_name((hap_event_kind)0) == NULL && hap_event_name((hap_event_kind)99) == NULL);
}

/* ---- with threads ---- */

typedef struct poller {
  desk *d;
  atomic_int stop;
  atomic_int touches;
  atomic_int events;
  atomic_int wrong;
} poller;

/* Whole, whatever the loop does meanwhile: a force along its normal, on a geom of the world. */
static void *poll_touches(void *argument)
{
  poller *p = argument;
  while (atomic_load(&p->stop) == 0) {
    hap_touch touch;
    hap_event event;
    size_t count = 0;
    if (hap_pointer_touches(p->d->session, p->d->hand, &touch, 1, sizeof touch, &count) == HAP_OK) {
      atomic_fetch_add(&p->touches, 1);
      bool whole = fabs(touch.normal[2] - 1.0) < 1e-9 && fabs(touch.force[0]) < 1e-9 &&
                   touch.force[2] > 0.0 && touch.geom != NULL;
      atomic_fetch_add(&p->wrong, !whole);
    }
    while (hap_session_events(p->d->session, &event, 1, sizeof event, &count) == HAP_OK) {
      atomic_fetch_add(&p->events, 1);
    }
  }
  return NULL;
}

TEST(several_threads_may_ask_while_the_loop_runs)
{
  pthread_t threads[2];
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  floor_add(d);
  d->def.drive = HAP_DRIVE_THREADS;
  d->def.rt_priority = 0;
  poller poll = {.d = d};
  poller *p = &poll;
  desk_run(d, 0.0, 0.0, RADIUS);
  for (int i = 0; i < 2; ++i) {
    REQUIRE(pthread_create(&threads[i], NULL, poll_touches, p) == 0);
  }
  int64_t end = hap_session_now(d->session) + 5000000000;
  for (int i = 0; hap_session_now(d->session) < end &&
                  (atomic_load(&p->touches) < 100 || atomic_load(&p->events) < 20);
       ++i) {
    d->at[2] = RADIUS - (i % 2 == 0 ? 0.001 : -0.001);
    hand_lead(d);
    nanosleep(&(struct timespec){.tv_nsec = 20000000}, NULL);
  }
  atomic_store(&p->stop, 1);
  for (int i = 0; i < 2; ++i) {
    pthread_join(threads[i], NULL);
  }
  CHECK(atomic_load(&p->touches) >= 100 && atomic_load(&p->events) >= 20);
  CHECK(atomic_load(&p->wrong) == 0);
}
