/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Worlds whose geoms are in several top-level spaces, or in spaces inside a space: a hand feels the
 * same as in one space. */

#include "tests/tap.h"

#include "tests/desk.h"

#define G 9.81
#define TICKS 900
#define EDGE 0.1
#define LAYER 1e-4

/* Which space the floor, the wall, the lower box and the upper one are in: 0 the first one. */
typedef struct layout {
  const char *name;
  int place[4];
  uint32_t pairs[3]; /* of the added ones; 0: inside the first one */
} layout;

#define BOTH (HAP_SPACE_INSIDE | HAP_SPACE_OTHERS)

typedef struct yard {
  desk *d;
  dSpaceID spaces[4];
  dBodyID boxes[2];
} yard;

static dSpaceID yard_space(yard *y, const layout *l, int place)
{
  if (place > 0 && y->spaces[place] == NULL) {
    bool nested = l->pairs[place - 1] == 0;
    y->spaces[place] = place == 2 ? dSimpleSpaceCreate(nested ? y->d->space : NULL)
                                  : dHashSpaceCreate(nested ? y->d->space : NULL);
  }
  return y->spaces[place];
}

static void yard_end(void *owned)
{
  yard *y = owned;
  hap_session_destroy(y->d->session);
  y->d->session = NULL;
  for (int i = 1; i < 4; ++i) {
    if (y->spaces[i] != NULL) {
      CHECK(dGeomGetSpace((dGeomID)y->spaces[i]) == NULL ||
            dGeomGetSpace((dGeomID)y->spaces[i]) == y->d->space);
      dSpaceDestroy(y->spaces[i]);
    }
  }
}

static bool half_friction(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  (void)user;
  (void)a;
  (void)b;
  io->mu = 0.5;
  return true;
}

/* Two boxes on each other, on a floor before a wall. */
static yard *yard_new(const layout *l, hap_model model)
{
  desk *d = desk_new(G, model);
  yard *y = tap_own(sizeof *y, yard_end);
  y->d = d;
  y->spaces[0] = d->space;
  d->def.physics_hz = 60.0;
  d->ode.surface = half_friction;
  dWorldSetQuickStepNumIterations(d->world, 200);
  dWorldSetContactSurfaceLayer(d->world, LAYER);
  (void)dCreatePlane(yard_space(y, l, l->place[0]), 0.0, 0.0, 1.0, 0.0);
  dGeomID wall = dCreateBox(yard_space(y, l, l->place[1]), 0.1, 1.0, 0.3);
  dGeomSetPosition(wall, 0.05 + 0.5 * EDGE + 0.01, 0.0, 0.15);
  for (int i = 0; i < 2; ++i) {
    y->boxes[i] = ode_box(d->world, yard_space(y, l, l->place[2 + i]), 0.3, AT(EDGE, EDGE, EDGE),
                          AT(0.0, 0.0, 0.5 * EDGE + (EDGE - LAYER) * i - LAYER));
  }
  return y;
}

static void yard_run(yard *y, const layout *l, double x, double y_at, double z)
{
  desk *d = y->d;
  d->session = session_make(&d->def, &d->ode);
  for (int i = 1; i < 4; ++i) {
    if (y->spaces[i] != NULL && l->pairs[i - 1] != 0) {
      REQUIRE(hap_session_add_space(d->session, y->spaces[i], l->pairs[i - 1]) == HAP_OK);
    }
  }
  REQUIRE(hap_pointer_add(d->session, &d->hand_def, &d->hand) == HAP_OK);
  d->at[0] = x;
  d->at[1] = y_at;
  d->at[2] = z;
  hand_lead(d);
  session_run(d->session);
}

static hap_pointer_state yard_state(const yard *y)
{
  hap_pointer_state state;
  memset(&state, 0, sizeof state);
  CHECK(hap_pointer_get(y->d->session, y->d->hand, &state, sizeof state) == HAP_OK);
  return state;
}

/* The hand pushes the lower box against the wall, and the tower with it. */
static void yard_push(const layout *l, hap_model model, double (*out)[3])
{
  yard *y = yard_new(l, model);
  desk *d = y->d;
  yard_run(y, l, -0.5 * EDGE - RADIUS - 0.002, 0.0, 0.5 * EDGE);
  d->velocity[0] = 0.02;
  for (int i = 0; i < TICKS; ++i) {
    d->at[0] += T * d->velocity[0];
    hand_lead(d);
    REQUIRE(hap_session_advance(d->session, 1) >= HAP_OK);
    hap_pointer_state state = yard_state(y);
    memcpy(out[i], state.wrench.force, sizeof out[i]);
  }
  hap_pose poses[2];
  REQUIRE(hap_session_poses_now(d->session, y->boxes, 2, poses) >= HAP_OK);
  CHECK(poses[0].position[0] > 0.005 && poses[0].position[0] < 0.0105);
  CHECK_NEAR(poses[1].position[2], 1.5 * EDGE, 1e-3);
  tap_release(y);
  tap_release(d);
}

static double forces_differ(double (*a)[3], double (*b)[3])
{
  double apart = 0.0;
  double all = 0.0;
  for (int i = 0; i < TICKS; ++i) {
    for (int k = 0; k < 3; ++k) {
      apart += (a[i][k] - b[i][k]) * (a[i][k] - b[i][k]);
      all += b[i][k] * b[i][k];
    }
  }
  return sqrt(apart / all);
}

static const layout one_space = {.name = ""};

static const layout layouts[] = {
    {"a_level_in_a_space_of_its_own", {1, 1, 0, 0}, {HAP_SPACE_OTHERS}},
    {"bodies_in_an_added_space", {0, 0, 1, 1}, {BOTH}},
    {"each_thing_in_a_space_of_its_own",
     {0, 1, 2, 3},
     {HAP_SPACE_OTHERS, HAP_SPACE_OTHERS, HAP_SPACE_OTHERS}},
    {"a_level_inside_the_first_space", {1, 1, 0, 0}, {0}},
    {"all_in_spaces_inside_the_first_one", {1, 2, 3, 3}, {0, 0, 0}},
    {"spaces_inside_and_beside", {1, 2, 2, 0}, {0, BOTH}}};

TEST_EACH(layouts, const layout *row)
{
  static double right[TICKS][3];
  static double felt[TICKS][3];
  for (int i = 0; i < 4; ++i) {
    yard_push(&one_space, all_models[i], right);
    yard_push(row, all_models[i], felt);
    double error = forces_differ(felt, right);
    printf("# %s: %.4f %%\n", hap_model_name(all_models[i]), 100.0 * error);
    CHECK(error < 0.001);
  }
}

/* ---- who meets whom ---- */

typedef struct meeting {
  const char *name;
  layout at;
  double height; /* m, of the upper box after a fall */
} meeting;

/* The boxes stand on the floor, or go through it: 0.15 both stand on each other. */
static const meeting meetings[] = {
    {"others_do_not_meet_in_a_space_of_others", {"", {0, 0, 1, 1}, {HAP_SPACE_OTHERS}}, 0.05},
    {"inside_does_not_meet_the_first_space", {"", {0, 0, 1, 1}, {HAP_SPACE_INSIDE}}, -1.0},
    {"two_spaces_of_inside_do_not_meet", {"", {0, 0, 1, 2}, {HAP_SPACE_INSIDE, BOTH}}, 0.05}};

TEST_EACH(meetings, const meeting *row)
{
  for (int near = 0; near < 2; ++near) { /* the world's step, and the loop */
    yard *y = yard_new(&row->at, HAP_MODEL_CONTACT);
    desk *d = y->d;
    if (row->height > 0.0) { /* beside each other until they fall: none is pushed out */
      dBodySetPosition(y->boxes[1], 0.0, 0.0, 0.5 * EDGE + 0.003);
    }
    yard_run(y, &row->at, near != 0 ? -0.5 * EDGE - RADIUS - 0.003 : 3.0, 0.0, 0.05);
    desk_wait(d, 300);
    double z = dBodyGetPosition(y->boxes[1])[2];
    if (row->height > 0.0) {
      CHECK_NEAR(z, row->height, 1e-3);
      CHECK_NEAR(dBodyGetPosition(y->boxes[1])[0], 0.0, 1e-3);
    } else {
      CHECK(z < -0.1);
    }
    tap_release(y);
    tap_release(d);
  }
}

TEST(a_geom_in_no_space_meets_nothing)
{
  yard *y = yard_new(&one_space, HAP_MODEL_CONTACT);
  desk *d = y->d;
  dGeomID skirt = dCreateBox(NULL, 0.3, 0.3, 0.3); /* in wall and floor, if it met them */
  dGeomSetBody(skirt, y->boxes[0]);
  yard_run(y, &one_space, -0.5 * EDGE - RADIUS - 0.003, 0.0, 0.05);
  desk_wait(d, 300);
  check_vector(dBodyGetPosition(y->boxes[0]), 0.0, 0.0, 0.05, 1e-3);
  dGeomDestroy(skirt);
}

/* ---- while it runs ---- */

typedef struct edit_of {
  yard *y;
  hap_status status;
} edit_of;

static void floor_remove(void *arg)
{
  edit_of *e = arg;
  e->status = hap_session_remove_space(e->y->d->session, e->y->spaces[1]);
}

static void floor_put(void *arg)
{
  edit_of *e = arg;
  e->status = hap_session_add_space(e->y->d->session, e->y->spaces[1], HAP_SPACE_OTHERS);
}

static const layout level = {"", {1, 1, 0, 0}, {HAP_SPACE_OTHERS}};

TEST(spaces_come_and_go_while_it_runs)
{
  yard *y = yard_new(&level, HAP_MODEL_CONTACT);
  desk *d = y->d;
  edit_of e = {.y = y, .status = HAP_ERROR_STATE};
  yard_run(y, &level, 0.0, 0.3, RADIUS - 0.002); /* in the floor */
  desk_wait(d, 200);
  CHECK_NEAR(yard_state(y).wrench.force[2], 2.0, 0.1);
  REQUIRE(hap_session_post(d->session, floor_remove, &e) == HAP_OK);
  desk_wait(d, 100);
  CHECK(e.status == HAP_OK);
  CHECK(yard_state(y).wrench.force[2] == 0.0);
  CHECK(dBodyGetPosition(y->boxes[0])[2] < 0.049);
  CHECK(dGeomGetSpace((dGeomID)y->spaces[1]) == NULL);
  REQUIRE(hap_session_post(d->session, floor_put, &e) == HAP_OK);
  desk_wait(d, 400);
  CHECK(e.status == HAP_OK);
  CHECK_NEAR(yard_state(y).wrench.force[2], 2.0, 0.1);
}

TEST(bodies_of_a_space_that_is_removed_are_forgotten)
{
  static const layout movers = {"", {0, 0, 1, 1}, {BOTH}};
  for (int nested = 0; nested < 2; ++nested) {
    yard *y = yard_new(&movers, HAP_MODEL_CONTACT);
    desk *d = y->d;
    hap_pose pose;
    dSpaceID inner = dSimpleSpaceCreate(y->spaces[1]);
    if (nested != 0) { /* in a space inside of it */
      dGeomID geom = dBodyGetFirstGeom(y->boxes[0]);
      dSpaceRemove(y->spaces[1], geom);
      dSpaceAdd(inner, geom);
    }
    yard_run(y, &movers, -0.5 * EDGE - RADIUS + 0.001, 0.0, 0.05);
    desk_wait(d, 100);
    CHECK(hap_session_poses(d->session, 0, y->boxes, 1, &pose) >= HAP_OK);
    CHECK(hap_session_remove_space(d->session, y->spaces[1]) == HAP_OK);
    CHECK(hap_session_poses(d->session, 0, y->boxes, 1, &pose) == HAP_ERROR_NOT_FOUND);
    desk_wait(d, 100);
    CHECK(session_stats(d->session).faults.bodies_lost == 0);
    CHECK(yard_state(y).wrench.force[0] == 0.0);
    tap_release(y);
    tap_release(d);
  }
}

typedef struct loss {
  const char *name;
  int clean_up;
  bool is_started;
} loss;

static const loss losses[] = {{"a_space_that_is_destroyed_with_its_geoms", 1, true},
                              {"a_space_that_is_destroyed_and_leaves_its_geoms", 0, true},
                              {"a_space_that_is_destroyed_before_the_start", 1, false}};

TEST_EACH(losses, const loss *row)
{
  for (int i = 0; i < 4; ++i) {
    yard *y = yard_new(&level, all_models[i]);
    desk *d = y->d;
    hap_detail detail = {""};
    dGeomID left[2] = {dSpaceGetGeom(y->spaces[1], 0), dSpaceGetGeom(y->spaces[1], 1)};
    dSpaceSetCleanup(y->spaces[1], row->clean_up);
    if (!row->is_started) {
      d->session = session_make(&d->def, &d->ode);
      REQUIRE(hap_session_add_space(d->session, y->spaces[1], BOTH) == HAP_OK);
      dSpaceDestroy(y->spaces[1]);
      y->spaces[1] = NULL;
      d->at[2] = RADIUS;
      d->at[1] = 0.3;
      REQUIRE(hap_pointer_add(d->session, &d->hand_def, &d->hand) == HAP_OK);
      hand_lead(d);
      session_run(d->session);
    } else {
      yard_run(y, &level, 0.0, 0.3, RADIUS - 0.002);
      desk_wait(d, 200);
      dSpaceDestroy(y->spaces[1]);
      y->spaces[1] = NULL;
    }
    desk_wait(d, 200);
    (void)hap_session_detail(d->session, &detail);
    CHECK(strstr(detail.text, "space was destroyed") != NULL);
    CHECK(session_stats(d->session).faults.fault == HAP_FAULT_NONE);
    CHECK(yard_state(y).wrench.force[2] == 0.0);
    CHECK(dBodyGetPosition(y->boxes[0])[2] < 0.04);
    for (int k = 0; k < 2 && row->clean_up == 0; ++k) {
      dGeomDestroy(left[k]);
    }
    tap_release(y);
    tap_release(d);
  }
}

TEST(an_added_space_may_be_emptied_and_filled_again)
{
  yard *y = yard_new(&level, HAP_MODEL_CONTACT);
  desk *d = y->d;
  yard_run(y, &level, 0.0, 0.3, RADIUS - 0.002);
  desk_wait(d, 100);
  while (dSpaceGetNumGeoms(y->spaces[1]) > 0) {
    dGeomDestroy(dSpaceGetGeom(y->spaces[1], 0));
  }
  (void)dCreatePlane(y->spaces[1], 0.0, 0.0, 1.0, 0.0);
  desk_wait(d, 300);
  CHECK_NEAR(dBodyGetPosition(y->boxes[0])[2], 0.05, 2e-3);
  CHECK_NEAR(yard_state(y).wrench.force[2], 2.0, 0.1);
}

/* ---- errors ---- */

static void detail_has(const hap_session *session, const char *text)
{
  hap_detail detail = {""};
  (void)hap_session_detail(session, &detail);
  tap_check(strstr(detail.text, text) != NULL, __FILE__, __LINE__, text);
}

TEST(a_space_that_cannot_be_added_says_why)
{
  desk *d = desk_new(G, HAP_MODEL_CONTACT);
  desk *other = desk_new(G, HAP_MODEL_CONTACT);
  dSpaceID spaces[HAP_SPACES_MAX + 1];
  dSpaceID inner = dSimpleSpaceCreate(d->space);
  dGeomID ball = dCreateSphere(NULL, 1.0);
  hap_detail detail = {""};
  hap_session *second = NULL;
  d->session = session_make(&d->def, &d->ode);
  other->session = session_make(&other->def, &other->ode);
  CHECK(hap_session_add_space(d->session, NULL, BOTH) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_add_space(NULL, d->space, BOTH) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_add_space(d->session, (dSpaceID)ball, BOTH) == HAP_ERROR_ARGUMENT);
  detail_has(d->session, "no space");
  CHECK(hap_session_add_space(d->session, d->space, BOTH) == HAP_ERROR_STATE);
  detail_has(d->session, "already has a session");
  CHECK(hap_session_add_space(d->session, other->space, BOTH) == HAP_ERROR_STATE);
  CHECK(hap_session_add_space(d->session, inner, BOTH) == HAP_ERROR_ARGUMENT);
  detail_has(d->session, "inside another one");
  for (int i = 0; i <= HAP_SPACES_MAX; ++i) {
    spaces[i] = dSimpleSpaceCreate(NULL);
  }
  CHECK(hap_session_add_space(d->session, spaces[0], 0) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_add_space(d->session, spaces[0], 4) == HAP_ERROR_ARGUMENT);
  detail_has(d->session, "HAP_SPACE_INSIDE");
  for (int i = 0; i < HAP_SPACES_MAX; ++i) {
    CHECK(hap_session_add_space(d->session, spaces[i], BOTH) == HAP_OK);
  }
  CHECK(hap_session_add_space(d->session, spaces[HAP_SPACES_MAX], BOTH) == HAP_ERROR_CAPACITY);
  detail_has(d->session, "16 spaces");
  CHECK(hap_session_remove_space(d->session, spaces[3]) == HAP_OK);
  CHECK(hap_session_add_space(d->session, spaces[2], BOTH) == HAP_ERROR_STATE); /* twice */
  CHECK(hap_session_add_space(other->session, spaces[2], BOTH) == HAP_ERROR_STATE);
  CHECK(hap_session_add_space(other->session, spaces[3], BOTH) == HAP_OK);
  CHECK(hap_session_remove_space(d->session, spaces[3]) == HAP_ERROR_NOT_FOUND);
  CHECK(hap_session_remove_space(d->session, d->space) == HAP_ERROR_NOT_FOUND);
  detail_has(d->session, "first one");
  CHECK(hap_session_remove_space(d->session, NULL) == HAP_ERROR_ARGUMENT);
  /* a world of its own, and the space of a session */
  hap_ode_def ode = d->ode;
  ode.world = dWorldCreate();
  CHECK(hap_session_create(&d->def, &ode, &second, &detail) == HAP_ERROR_STATE);
  CHECK(strstr(detail.text, "space already has a session") != NULL);
  /* a space around the first one */
  ode.space = dHashSpaceCreate(spaces[HAP_SPACES_MAX]);
  second = session_make(&d->def, &ode);
  CHECK(hap_session_add_space(second, spaces[HAP_SPACES_MAX], BOTH) == HAP_ERROR_ARGUMENT);
  hap_session_destroy(second);
  dWorldDestroy(ode.world);
  session_run(d->session);
  CHECK(hap_session_advance(d->session, 50) >= HAP_OK);
  hap_session_destroy(d->session);
  hap_session_destroy(other->session);
  d->session = other->session = NULL;
  for (int i = 0; i <= HAP_SPACES_MAX; ++i) {
    CHECK(dGeomGetSpace((dGeomID)spaces[i]) == NULL);
    dSpaceDestroy(spaces[i]);
  }
  dSpaceDestroy(inner);
  dGeomDestroy(ball);
}

TEST(a_space_is_added_where_the_world_may_be_touched_alone)
{
  desk *d = desk_new(G, HAP_MODEL_CONTACT);
  dSpaceID space = dSimpleSpaceCreate(NULL);
  d->def.drive = HAP_DRIVE_THREADS;
  d->def.rt_priority = 0;
  desk_run(d, 0.0, 0.0, 1.0);
  CHECK(hap_session_add_space(d->session, space, BOTH) == HAP_ERROR_THREAD);
  REQUIRE(hap_session_lock(d->session) == HAP_OK);
  CHECK(hap_session_add_space(d->session, space, BOTH) == HAP_OK);
  hap_session_unlock(d->session);
  CHECK(hap_session_remove_space(d->session, space) == HAP_ERROR_THREAD);
  hap_session_destroy(d->session);
  d->session = NULL;
  dSpaceDestroy(space);
}
