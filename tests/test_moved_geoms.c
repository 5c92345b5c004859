/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Geoms without a body that the application moves. What is felt on one, and what lies on it, must
 * be as on a kinematic body with the same geom that is moved by its pose. */

#include "tests/tap.h"

#include <math.h>

#include "tests/contact_world.h"

#define RADIUS 0.005
#define K 1000.0
#define TICKS 1500
#define TURN (2.0 * M_PI)
#define CORNERS 8
#define THICK 0.02
#define SPEED 0.06  /* m/s */
#define SWING 0.033 /* m */
#define LATER 0.5   /* s */

typedef enum thing_kind {
  THING_BOX,
  THING_CYLINDER,
  THING_CONVEX,
  THING_MESH,
  THING_FIELD, /* flat: as a body a box */
  THING_PLANE, /* likewise */
  THING_KINDS
} thing_kind;

static const char *const kind_names[] = {"box", "cylinder", "convex", "mesh", "field", "plane"};

/* Where the upper side's middle is, and how far it is turned. */
typedef struct thing_place {
  double position[3];
  double turn[3]; /* rad, about its direction */
} thing_place;

typedef void (*way_fn)(double time, thing_place *out);

typedef struct moved {
  contact_world w; /* first: the callbacks' user */
  dGeomID geom;
  dBodyID body;     /* NULL: the geom is moved itself */
  double middle[3]; /* m, of the geom, below the upper side */
  dQuaternion stands;
  way_fn way;
  double time;  /* s, of the world */
  dBodyID lost; /* destroyed without a word as the geom begins to move; NULL: none */
  double points[3 * CORNERS];
  double planes[24];
  dTriMeshDataID mesh;
  dHeightfieldDataID field;
} moved;

static const unsigned faces[] = {4, 0, 2, 3, 1, 4, 4, 5, 7, 6, 4, 0, 1, 5, 4,
                                 4, 2, 6, 7, 3, 4, 0, 4, 6, 2, 4, 1, 3, 7, 5};
static const dTriIndex triangles[] = {0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4,
                                      2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5};

static void corners_set(moved *m, const double half[3])
{
  static const double normals[6][3] = {{0, 0, -1}, {0, 0, 1},  {0, -1, 0},
                                       {0, 1, 0},  {-1, 0, 0}, {1, 0, 0}};
  for (int i = 0; i < 3 * CORNERS; ++i) {
    m->points[i] = ((i / 3 >> i % 3) & 1) != 0 ? half[i % 3] : -half[i % 3];
  }
  for (int i = 0; i < 6; ++i) {
    memcpy(m->planes + 4 * i, normals[i], sizeof normals[i]);
    m->planes[4 * i + 3] = half[i < 2 ? 2 : i < 4 ? 1 : 0];
  }
}

/* 0.2 m wide. */
static void geom_make(moved *m, dSpaceID space, thing_kind kind, double thick)
{
  static const double level[4] = {0.0, 0.0, 0.0, 0.0};
  corners_set(m, AT(0.1, 0.1, 0.5 * thick));
  memcpy(m->middle, AT(0.0, 0.0, -0.5 * thick), sizeof m->middle);
  dQSetIdentity(m->stands);
  switch (kind) {
    case THING_BOX:
      m->geom = dCreateBox(space, 0.2, 0.2, thick);
      return;
    case THING_CYLINDER:
      m->geom = dCreateCylinder(space, 0.1, thick);
      return;
    case THING_CONVEX:
      m->geom = dCreateConvex(space, m->planes, 6, m->points, CORNERS, faces);
      return;
    case THING_MESH:
      m->mesh = dGeomTriMeshDataCreate();
      dGeomTriMeshDataBuildDouble(m->mesh, m->points, 3 * sizeof(double), CORNERS, triangles, 36,
                                  3 * sizeof(dTriIndex));
      m->geom = dCreateTriMesh(space, m->mesh, NULL, NULL, NULL);
      return;
    case THING_PLANE:
      m->geom = dCreatePlane(space, 0.0, 0.0, 1.0, 0.0);
      return;
    default:
      m->field = dGeomHeightfieldDataCreate();
      dGeomHeightfieldDataBuildDouble(m->field, level, 1, 0.2, 0.2, 2, 2, 1.0, 0.0, thick, 0);
      m->geom = dCreateHeightfield(space, m->field, 1);
      dQFromAxisAndAngle(m->stands, 1.0, 0.0, 0.0, 0.5 * M_PI); /* its height is along y */
      memset(m->middle, 0, sizeof m->middle);
  }
}

static void moved_put(moved *m, double time)
{
  thing_place there = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  const double *p = there.position;
  const double *turn = there.turn;
  dQuaternion q;
  dQuaternion all;
  dMatrix3 rotation;
  dVector3 below;
  m->way(time, &there);
  double angle = sqrt(turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2]);
  dQFromAxisAndAngle(q, turn[0], turn[1], angle > 0.0 ? turn[2] : 1.0, angle);
  dQtoR(q, rotation);
  dMultiply0_331(below, rotation, m->middle);
  if (m->body != NULL) {
    dBodySetPosition(m->body, p[0] + below[0], p[1] + below[1], p[2] + below[2]);
    dBodySetQuaternion(m->body, q);
    return;
  }
  if (dGeomGetClass(m->geom) == dPlaneClass) {
    const double n[3] = {rotation[2], rotation[6], rotation[10]};
    dGeomPlaneSetParams(m->geom, n[0], n[1], n[2], n[0] * p[0] + n[1] * p[1] + n[2] * p[2]);
    return;
  }
  dQMultiply0(all, q, m->stands);
  dGeomSetPosition(m->geom, p[0] + below[0], p[1] + below[1], p[2] + below[2]);
  dGeomSetQuaternion(m->geom, all);
}

/* A heap that gives the block of one body to the next block of its size. */
static struct {
  void *watched; /* NULL: none */
  void *free;
  size_t size;
  int taken;
} heap;

static void *heap_alloc(dsizeint size)
{
  void *block = heap.free;
  if (block == NULL || size != heap.size) {
    return malloc(size);
  }
  heap.free = NULL;
  ++heap.taken;
  return block;
}

static void *heap_realloc(void *block, dsizeint old_size, dsizeint size)
{
  (void)old_size;
  return realloc(block, size);
}

static void heap_free(void *block, dsizeint size)
{
  if (block == NULL || block != heap.watched) {
    free(block);
    return;
  }
  heap.watched = NULL;
  heap.free = block;
  heap.size = size;
}

static void moved_step(void *user, double step_s)
{
  moved *m = user;
  m->time += step_s;
  if (m->lost != NULL && m->time > LATER) {
    dGeomDestroy(dBodyGetFirstGeom(m->lost));
    heap.watched = m->lost;
    dBodyDestroy(m->lost);
    m->lost = NULL;
  }
  if (m->geom != NULL || m->body != NULL) {
    moved_put(m, m->time);
  }
}

static void moved_close(void *owned)
{
  moved *m = owned;
  cw_close(&m->w); /* with the data of its geoms */
}

typedef struct moved_case {
  thing_kind kind;
  double thick;
  double hz;
  hap_model model;
  way_fn way;
  bool has_body;
  bool hull; /* the hand is a cube as high and wide as the ball would be */
  bool in_space;
  bool loses; /* a body, as the geom begins to move */
  double friction;
} moved_case;

static moved *moved_open(const moved_case *c)
{
  static double hull[3 * CORNERS];
  moved *m = tap_own(sizeof *m, moved_close);
  cw_open(&m->w, 0.0);
  m->way = c->way;
  m->w.def.physics_hz = c->hz;
  m->w.def.model = c->model;
  m->w.hand_def.radius = RADIUS;
  m->w.hand_def.stiffness = K;
  m->w.hand_def.damping = 0.0;
  m->w.hand_def.friction = c->friction;
  m->w.hand_expert.coupling = HAP_COUPLING_DIRECT;
  m->w.ode.before_step = moved_step;
  dSpaceID space = c->in_space ? dSimpleSpaceCreate(m->w.space) : m->w.space;
  thing_kind kind = c->has_body && c->kind >= THING_FIELD ? THING_BOX : c->kind;
  geom_make(m, space, kind, c->thick > 0.0 ? c->thick : THICK);
  if (c->has_body) {
    m->body = dBodyCreate(m->w.world);
    dBodySetKinematic(m->body);
    dGeomSetBody(m->geom, m->body);
  }
  if (c->hull) {
    for (int i = 0; i < 3 * CORNERS; ++i) {
      hull[i] = ((i / 3 >> i % 3) & 1) != 0 ? RADIUS : -RADIUS;
    }
    m->w.hand_def.radius = 0.0;
    m->w.hand_def.hull_xyz = hull;
    m->w.hand_def.hull_points = CORNERS;
  }
  m->lost = c->loses ? cw_add_cube(&m->w, 0.1, 0.02, 1.0, 0.0, 0.0) : NULL;
  moved_put(m, 0.0);
  return m;
}

/* ---- ways ---- */

static void way_up(double time, thing_place *out)
{
  out->position[2] = SPEED * time;
}

static void way_swing(double time, thing_place *out)
{
  out->position[2] = SWING * (1.0 - cos(TURN * time));
}

/* At rest, then as above. */
static void way_up_later(double time, thing_place *out)
{
  way_up(fmax(time - LATER, 0.0), out);
}

static void way_tilt(double time, thing_place *out)
{
  out->turn[1] = -0.05 * sin(TURN * fmax(time - LATER, 0.0));
}

static void way_along(double time, thing_place *out)
{
  out->position[0] = SPEED * fmax(time - LATER, 0.0);
}

/* Up, and then it stands. */
static void way_stop(double time, thing_place *out)
{
  way_up(fmin(time, 0.8), out);
}

static void way_leap(double time, thing_place *out)
{
  out->position[2] = time > 0.6 ? 0.3 : 0.0;
}

/* ---- against a kinematic body ---- */

typedef struct felt {
  double force[TICKS][3];
} felt;

/* A hand that rests 3 mm deep, and goes up with the thing if that does. */
static void moved_feel(const moved_case *c, felt *out)
{
  moved *m = moved_open(c);
  cw_start(&m->w, 0.02, 0.01, RADIUS - 0.003);
  for (int k = 0; k < TICKS; ++k) {
    thing_place there = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    c->way(1e-3 * k, &there);
    m->w.hand_at[2] = there.position[2] + RADIUS - 0.003;
    cw_put_hand(&m->w, 0.0, 0.0, 0.0);
    CHECK(hap_session_advance(m->w.session, 1) >= HAP_OK);
    cw_read(&m->w);
    memcpy(out->force[k], m->w.force, sizeof m->w.force);
  }
  CHECK(cw_stats(&m->w).faults.bodies_lost == (c->loses ? 1 : 0));
}

static double felt_apart(const felt *a, const felt *b, int from)
{
  double most = 0.0;
  for (int k = from; k < TICKS; ++k) {
    double apart[3];
    for (int i = 0; i < 3; ++i) {
      apart[i] = a->force[k][i] - b->force[k][i];
    }
    most = fmax(most, cw_norm(apart));
  }
  return most;
}

static double felt_most(const felt *f)
{
  double most = 0.0;
  for (int k = 0; k < TICKS; ++k) {
    most = fmax(most, cw_norm(f->force[k]));
  }
  return most;
}

static double worst_of(moved_case c, int from)
{
  static felt runs[2];
  for (int i = 0; i < 2; ++i) {
    c.has_body = i == 1;
    moved_feel(&c, &runs[i]);
  }
  CHECK(felt_most(&runs[1]) > 2.9);
  return felt_apart(&runs[0], &runs[1], from);
}

/* N: points of a hull, and triangles, are found a contact pass later. */
static double tolerance_of(thing_kind kind, bool hull)
{
  return hull ? 0.1 : kind >= THING_FIELD ? 0.005 : 1e-6;
}

static void same_as_body(const moved_case *c, int from)
{
  double apart = worst_of(*c, from);
  CHECK_SAY(apart < tolerance_of(c->kind, c->hull), "%s, model %d, %s: %g N", kind_names[c->kind],
            (int)c->model, c->hull ? "hull" : "ball", apart);
}

TEST(a_geom_is_felt_as_a_body_is)
{
  static const way_fn ways[] = {way_up_later, way_tilt, way_along, way_stop};
  for (size_t i = 0; i < sizeof ways / sizeof ways[0]; ++i) {
    for (int hull = 0; hull < 2; ++hull) {
      moved_case c = {.hz = i % 2 == 0 ? 20.0 : 60.0,
                      .model = HAP_MODEL_CONTACT,
                      .way = ways[i],
                      .hull = hull != 0,
                      .friction = 0.5};
      same_as_body(&c, 0);
    }
  }
  moved_case c = {.hz = 20.0, .model = HAP_MODEL_CONTACT, .way = way_swing};
  same_as_body(&c, 0);
}

TEST(geoms_of_all_kinds_are_felt_as_bodies_are)
{
  for (int kind = 1; kind < THING_KINDS; ++kind) {
    for (int hull = 0; hull < 2; ++hull) {
      moved_case c = {.kind = (thing_kind)kind,
                      .hz = 60.0,
                      .model = HAP_MODEL_CONTACT,
                      .way = kind == THING_FIELD ? way_up_later : way_tilt,
                      .hull = hull != 0,
                      .in_space = true};
      same_as_body(&c, 0);
    }
  }
}

TEST(other_models_feel_it_too)
{
  static const hap_model models[] = {HAP_MODEL_SINGLE, HAP_MODEL_IMPULSE, HAP_MODEL_ACCELERANCE};
  for (int i = 0; i < 3; ++i) {
    moved_case c = {.hz = 60.0, .model = models[i], .way = way_up_later, .friction = 0.5};
    same_as_body(&c, 0);
    c.way = way_along;
    same_as_body(&c, 0);
    c.hull = true;
    same_as_body(&c, 100); /* from when the touch of the start has come in */
  }
}

/* A sheet of 1 mm, 3 mm deep: the hand stays on its side when the sheet begins to move. */
TEST(a_sheet_that_begins_to_move_holds_the_hand)
{
  for (int hull = 0; hull < 2; ++hull) {
    moved_case c = {.thick = 0.001,
                    .hz = 60.0,
                    .model = HAP_MODEL_CONTACT,
                    .way = way_up_later,
                    .hull = hull != 0};
    static felt run;
    moved_feel(&c, &run);
    for (int k = 100; k < TICKS; ++k) {
      CHECK(run.force[k][2] > 1.5); /* 3 N, less what is not foreseen of the first step */
    }
    CHECK_NEAR(run.force[TICKS - 1][2], 3.0, 0.05);
  }
}

/* It is there at once, and pushes nothing on its way. */
TEST(a_geom_that_is_put_elsewhere_does_not_slide_there)
{
  moved_case c = {.hz = 20.0, .model = HAP_MODEL_CONTACT, .way = way_leap};
  moved *m = moved_open(&c);
  cw_start(&m->w, 0.0, 0.0, 0.1);
  for (int k = 0; k < TICKS; ++k) {
    cw_tick(&m->w);
    CHECK(m->w.force[2] == 0.0);
  }
}

/* ---- coming from far, and what lies on it ---- */

#define FAST 1.0 /* m/s */

static void way_from_below(double time, thing_place *out)
{
  out->position[2] = FAST * (time - 1.0);
}

/* A hand at rest, that the thing meets after 1 s: as if it stood still there and the hand came. */
TEST(a_fast_geom_arrives_in_time)
{
  static const double rates[] = {20.0, 60.0};
  for (int i = 0; i < 4; ++i) {
    moved_case c = {
        .hz = rates[i % 2], .model = HAP_MODEL_CONTACT, .way = way_from_below, .has_body = i >= 2};
    moved *m = moved_open(&c);
    cw_start(&m->w, 0.0, 0.0, RADIUS);
    for (int k = 0; k < 1004; ++k) {
      cw_tick(&m->w);
      double depth = FAST * (1e-3 * k - 1.0); /* the tick's force is that of its begin */
      CHECK_NEAR(m->w.force[2], K * fmax(depth, 0.0), 1e-3 * K * FAST + 1e-6);
    }
    CHECK(m->w.force[2] > 2.0);
  }
}

/* The session's own body of a geom may come to be where the application's body was. */
TEST(a_geom_that_moves_as_a_body_is_lost_is_felt_as_a_body_is)
{
  moved_case c = {.hz = 60.0, .model = HAP_MODEL_CONTACT, .way = way_up_later, .loses = true};
  dSetAllocHandler(heap_alloc);
  dSetReallocHandler(heap_realloc);
  dSetFreeHandler(heap_free);
  same_as_body(&c, 0);
  CHECK(heap.taken == 1);
  dSetAllocHandler(NULL);
  dSetReallocHandler(NULL);
  dSetFreeHandler(NULL);
}

/* A load that the loop owns is lifted and carried along. */
TEST(what_lies_on_a_geom_goes_with_it)
{
  static const way_fn ways[] = {way_up_later, way_along, way_up_later, way_along};
  for (int i = 0; i < 4; ++i) {
    moved_case c = {.kind = i < 2 ? THING_BOX : THING_MESH,
                    .hz = 60.0,
                    .model = HAP_MODEL_CONTACT,
                    .way = ways[i]};
    moved *m = moved_open(&c);
    dWorldSetGravity(m->w.world, 0.0, 0.0, -CW_GRAVITY);
    (void)cw_add_cube(&m->w, 0.1, 0.02, 0.0, 0.0, 0.01);
    cw_start(&m->w, 0.0, 0.0, 0.02 + RADIUS + 0.004); /* near enough for the loop to own it */
    thing_place there = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    double worst = 0.0;
    for (int k = 0; k < TICKS; ++k) {
      c.way(1e-3 * k, &there);
      m->w.hand_at[0] = there.position[0];
      m->w.hand_at[2] = there.position[2] + 0.02 + RADIUS + 0.004;
      cw_tick(&m->w);
      for (int j = 0; j < 3; ++j) {
        double rest = j == 2 ? 0.01 : 0.0;
        double apart = fabs(m->w.position[0][j] - there.position[j] - rest);
        worst = k > 700 ? fmax(worst, apart) : worst;
      }
    }
    CHECK_SAY(worst < 1.5e-3, "%d: %g mm", i, 1e3 * worst);
    CHECK(m->w.seen.range_min == 1);
  }
}

/* ---- what an application may do to it meanwhile ---- */

TEST(a_geom_that_is_destroyed_lets_the_hand_go)
{
  for (int tells = 0; tells < 2; ++tells) {
    for (int hull = 0; hull < 2; ++hull) {
      moved_case c = {.hz = 60.0, .model = HAP_MODEL_CONTACT, .way = way_swing, .hull = hull != 0};
      moved *m = moved_open(&c);
      cw_start(&m->w, 0.0, 0.0, RADIUS + 0.02);
      cw_run(&m->w, 500);
      CHECK(m->w.force[2] > 1.0);
      if (tells != 0) {
        CHECK(hap_session_forget_geom(m->w.session, m->geom) == HAP_OK);
      }
      dGeomDestroy(m->geom);
      m->geom = dCreateBox(m->w.space, 0.01, 0.01, 0.01); /* likely at its address */
      c.way = way_leap;
      m->way = way_leap;
      memset(m->middle, 0, sizeof m->middle);
      m->middle[0] = 0.5;
      cw_run(&m->w, 100);
      CHECK(cw_norm(m->w.force) == 0.0);
      CHECK(cw_stats(&m->w).faults.bodies_lost == 0);
    }
  }
}

/* It becomes part of a body that falls, or of one that is moved. */
TEST(a_moving_geom_may_be_given_a_body)
{
  for (int kinematic = 0; kinematic < 2; ++kinematic) {
    moved_case c = {.hz = 60.0, .model = HAP_MODEL_CONTACT, .way = way_up};
    moved *m = moved_open(&c);
    cw_start(&m->w, 0.0, 0.0, RADIUS + 0.002);
    cw_run(&m->w, 100);
    CHECK_NEAR(m->w.force[2], K * (SPEED * 0.099 - 0.002), 0.1);
    dBodyID body = dBodyCreate(m->w.world);
    const dReal *at = dGeomGetPosition(m->geom);
    dBodySetPosition(body, at[0], at[1], at[2]);
    if (kinematic != 0) {
      dBodySetKinematic(body);
    }
    m->body = body;
    dGeomSetBody(m->geom, body);
    if (kinematic != 0) {
      cw_run(&m->w, 50);
      CHECK_NEAR(m->w.force[2], K * (SPEED * 0.149 - 0.002), 0.1);
      CHECK(hap_session_forget_body(m->w.session, body) == HAP_OK);
      dGeomSetBody(m->geom, NULL); /* and back */
      dBodyDestroy(body);
      m->body = NULL;
      cw_run(&m->w, 50);
      CHECK_NEAR(m->w.force[2], K * (SPEED * 0.199 - 0.002), 0.5);
    } else {
      m->geom = NULL, m->body = NULL; /* nobody moves it any more */
      cw_run(&m->w, 200);
      CHECK(dBodyGetPosition(body)[2] < -0.001); /* the hand has pushed it away */
    }
  }
}

static void way_rest(double time, thing_place *out)
{
  (void)time, (void)out;
}

/* It goes on under the hand: what was the static world's leaves as the body comes in. */
TEST(a_geom_that_stands_may_be_given_a_body)
{
  for (int hull = 0; hull < 2; ++hull) {
    moved_case c = {.hz = 60.0, .model = HAP_MODEL_CONTACT, .way = way_rest, .hull = hull != 0};
    moved *m = moved_open(&c);
    cw_start(&m->w, 0.0, 0.0, RADIUS - 0.002);
    cw_run(&m->w, 150);
    CHECK_NEAR(m->w.force[2], 2.0, 1e-9);
    m->body = dBodyCreate(m->w.world);
    dBodySetKinematic(m->body);
    moved_put(m, 0.0);
    dGeomSetBody(m->geom, m->body);
    for (int k = 0; k < 100; ++k) {
      cw_tick(&m->w);
      CHECK(m->w.force[2] > 1.65 && m->w.force[2] < 2.001);
    }
    CHECK_NEAR(m->w.force[2], 2.0, 1e-9);
  }
}

/* ---- slow motion, another start, geoms in a transform ---- */

/* What the application does with time: slower, a pause, faster, as it was. */
static double scale_at(int tick)
{
  return tick < 400 ? 0.3 : tick < 700 ? 0.1 : tick < 900 ? 0.0 : tick < 1200 ? 0.8 : 1.0;
}

static void slow_feel(const moved_case *c, felt *out)
{
  moved *m = moved_open(c);
  double time = 0.0;
  cw_start(&m->w, 0.02, 0.01, RADIUS - 0.003);
  for (int k = 0; k < TICKS; ++k) {
    thing_place there = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    CHECK(hap_session_set_time_scale(m->w.session, scale_at(k)) == HAP_OK);
    c->way(time, &there);
    time += 1e-3 * scale_at(k);
    m->w.hand_at[2] = there.position[2] + RADIUS - 0.003;
    cw_put_hand(&m->w, 0.0, 0.0, 0.0);
    CHECK(hap_session_advance(m->w.session, 1) == HAP_OK);
    cw_read(&m->w);
    memcpy(out->force[k], m->w.force, sizeof m->w.force);
  }
}

TEST(in_slow_motion_a_geom_is_felt_as_a_body_is)
{
  static const way_fn ways[] = {way_up, way_swing, way_along};
  for (int i = 0; i < 12; ++i) {
    static felt runs[2];
    moved_case c = {.kind = i < 6 ? THING_BOX : THING_MESH,
                    .hz = i % 4 < 2 ? 60.0 : 20.0,
                    .model = HAP_MODEL_CONTACT,
                    .way = ways[i % 3],
                    .hull = i % 2 != 0,
                    .friction = 0.5};
    for (int body = 0; body < 2; ++body) {
      c.has_body = body != 0;
      slow_feel(&c, &runs[body]);
    }
    double apart = felt_apart(&runs[0], &runs[1], 0);
    CHECK_SAY(apart < tolerance_of(c.kind, c.hull), "%d: %g N", i, apart);
    CHECK(felt_most(&runs[1]) > 2.0);
    CHECK_NEAR(runs[0].force[899][2], runs[0].force[750][2], 1e-6); /* a pause */
  }
}

/* What it did before is forgotten. It may have been moved meanwhile. */
TEST(after_another_start_a_geom_is_felt_as_a_body_is)
{
  for (int hull = 0; hull < 2; ++hull) {
    static felt runs[2];
    for (int body = 0; body < 2; ++body) {
      moved_case c = {.hz = 60.0,
                      .model = HAP_MODEL_CONTACT,
                      .way = way_up,
                      .has_body = body != 0,
                      .hull = hull != 0};
      moved *m = moved_open(&c);
      cw_start(&m->w, 0.02, 0.01, RADIUS - 0.003);
      for (int k = 0; k < TICKS; ++k) {
        if (k == 500 || k == 1000) {
          REQUIRE(hap_session_stop(m->w.session) >= HAP_OK);
          m->time = 1e-3 * k + (k == 500 ? 0.0 : 0.2);
          moved_put(m, m->time);
          session_run(m->w.session);
        }
        m->w.hand_at[2] = SPEED * (1e-3 * k + (k < 1000 ? 0.0 : 0.2)) + RADIUS - 0.003;
        cw_put_hand(&m->w, 0.0, 0.0, 0.0);
        CHECK(hap_session_advance(m->w.session, 1) == HAP_OK);
        cw_read(&m->w);
        memcpy(runs[body].force[k], m->w.force, sizeof m->w.force);
        bool learns = k % 500 < 120;
        CHECK(learns || fabs(m->w.force[2] - 3.0) < 0.05);
      }
    }
    double apart = felt_apart(&runs[0], &runs[1], 0);
    printf("# %s: %g N apart\n", hull ? "hull" : "ball", apart);
    CHECK(apart < 1.1); /* a body is not known to have stood before it was seen */
  }
}

/* Deprecated by ODE, and met in older programs. */
static dGeomID transform_of(dSpaceID space, dGeomID inner)
{
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wdeprecated-declarations"
  dGeomID outer = dCreateGeomTransform(space);
  dGeomTransformSetGeom(outer, inner);
  dGeomTransformSetInfo(outer, 1);
  dGeomTransformSetCleanup(outer, 1);
#pragma GCC diagnostic pop
  return outer;
}

/* Moved as a whole. A hull does not feel what is in a transform, and that is said once. */
TEST(a_geom_in_a_transform_is_followed)
{
  moved_case c = {.hz = 60.0, .model = HAP_MODEL_CONTACT, .way = way_up_later};
  moved *m = moved_open(&c);
  dGeomDestroy(m->geom);
  dGeomID box = dCreateBox(NULL, 0.2, 0.2, THICK);
  dGeomSetPosition(box, 0.0, 0.0, -0.03);
  m->geom = transform_of(m->w.space, box);
  m->middle[2] = 0.03 - 0.5 * THICK;
  moved_put(m, 0.0);
  cw_start(&m->w, 0.02, 0.01, RADIUS - 0.003);
  for (int k = 0; k < TICKS; ++k) {
    thing_place there = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    c.way(1e-3 * k, &there);
    m->w.hand_at[2] = there.position[2] + RADIUS - 0.003;
    cw_tick(&m->w);
    bool begins = k < 30 || (k > 500 && k < 560);
    CHECK(begins || fabs(m->w.force[2] - 3.0) < 0.02);
  }
}

/* More of them than the loop has places for: told, and nothing else happens. */
TEST(too_many_moving_geoms_are_told)
{
  moved_case c = {.hz = 60.0, .model = HAP_MODEL_CONTACT, .way = way_swing};
  moved *m = moved_open(&c);
  dGeomID more[60];
  m->w.def.max_bodies = 8;
  for (int i = 0; i < 60; ++i) {
    more[i] = dCreateSphere(m->w.space, 0.02);
  }
  cw_start(&m->w, 0.0, 0.0, RADIUS + 0.02);
  for (int k = 0; k < 300; ++k) {
    for (int i = 0; i < 60; ++i) {
      dGeomSetPosition(more[i], 1e-4 * i, 0.0, -0.02 + 1e-5 * k);
    }
    cw_tick(&m->w);
  }
  CHECK(isfinite(m->w.force[2]) && m->w.force[2] > 0.0);
  CHECK(cw_stats(&m->w).model.capacity_dropped > 0);
}
