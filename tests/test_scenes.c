/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

#include <scenes/scenes.h>
#include <tests/scene_names.h>
#include <tests/tap.h>

#define CONTACTS_MAX 8
#define WAYPOINTS_MAX 16
#define KEPT_MAX 100 /* pile */

static const double slow_step = 0.05; /* s, the paper's physics step */
static const double tick = 0.001;     /* s */

/* One scene under test: what the near callback needs and fills. */
typedef struct run {
  scene *s;
  dJointGroupID contacts;
  double deepest;            /* m, of all contacts seen */
  double least;              /* of the first body's x, m */
  double most;               /* the same */
  double fastest;            /* m/s, of the first body as long as the second rests */
  double start[KEPT_MAX][3]; /* m, where bodies were */
} run;

/* A hand as the text of the virtual device describes it. */
typedef struct hand {
  double waypoints[WAYPOINTS_MAX][4]; /* s, m */
  int count;
  double sine[3];
  double hz;
  double mass; /* 0: rigid */
  double damping;
  double stiffness;
} hand;

static bool near_zero_or_more(double x)
{
  return isfinite(x) && x >= 0;
}

static void pair_near(void *user, dGeomID a, dGeomID b)
{
  run *r = user;
  dContact contacts[CONTACTS_MAX];
  dSurfaceParameters surface = {.mode = dContactApprox1, .mu = dInfinity};
  if ((dGeomGetBody(a) == NULL && dGeomGetBody(b) == NULL) ||
      !scene_surface(r->s, a, b, &surface)) {
    return;
  }
  const int count = dCollide(a, b, CONTACTS_MAX, &contacts[0].geom, sizeof contacts[0]);
  for (int i = 0; i < count; ++i) {
    contacts[i].surface = surface;
    r->deepest = fmax(r->deepest, contacts[i].geom.depth);
    const dJointID joint = dJointCreateContact(r->s->world, r->contacts, &contacts[i]);
    dJointAttach(joint, dGeomGetBody(a), dGeomGetBody(b));
  }
}

static void run_step(run *r, double seconds)
{
  dSpaceCollide(r->s->space, r, pair_near);
  dWorldQuickStep(r->s->world, seconds);
  dJointGroupEmpty(r->contacts);
}

static bool open_run(run *r, const char *spec)
{
  hap_detail detail = {""};
  *r = (run){0};
  if (scene_create(spec, &r->s, &detail) != HAP_OK) {
    printf("# %s: %s\n", spec, detail.text);
    return false;
  }
  dRandSetSeed(1);
  r->contacts = dJointGroupCreate(0);
  for (size_t i = 0; i < r->s->body_count && i < KEPT_MAX; ++i) {
    memcpy(r->start[i], dBodyGetPosition(r->s->bodies[i]), sizeof r->start[i]);
  }
  return true;
}

static void close_run(run *r)
{
  dJointGroupDestroy(r->contacts);
  scene_destroy(r->s);
}

static double text_field(const char *text, const char *key, double otherwise)
{
  const char *at = strstr(text, key);
  return at != NULL ? atof(at + strlen(key)) : otherwise;
}

static void parse_hand(const char *text, hand *out)
{
  *out = (hand){0};
  const char *at = strstr(text, "path=");
  int used = 0;
  at += at != NULL ? 5 : 0;
  while (at != NULL && out->count < WAYPOINTS_MAX) {
    double *w = out->waypoints[out->count];
    if (sscanf(at, "%lf:%lf/%lf/%lf%n", &w[0], &w[1], &w[2], &w[3], &used) != 4) {
      break;
    }
    ++out->count;
    at += used + (at[used] == ';');
  }
  at = strstr(text, "sine=");
  if (at != NULL) {
    CHECK(sscanf(at, "sine=%lf/%lf/%lf", &out->sine[0], &out->sine[1], &out->sine[2]) == 3);
  }
  const bool tense = strstr(text, "hand=tense") != NULL;
  const bool relaxed = strstr(text, "hand=relaxed") != NULL;
  out->hz = text_field(text, ",hz=", 0);
  out->mass = text_field(text, ",mass=", tense ? 0.3 : relaxed ? 0.2 : 0);
  out->damping = text_field(text, ",damping=", tense ? 10 : 3);
  out->stiffness = text_field(text, ",stiffness=", tense ? 800 : 150);
}

/* Where the hand wants to be. Smooth: at rest at each waypoint. */
static void path_at(const hand *h, double t, double out[3])
{
  int i = 0;
  while (i + 2 < h->count && h->waypoints[i + 1][0] <= t) {
    ++i;
  }
  const double *from = h->waypoints[i];
  const double *to = h->count > 1 ? h->waypoints[i + 1] : from;
  const double span = to[0] - from[0];
  const double u = span > 0 ? fmin(1, fmax(0, (t - from[0]) / span)) : 0;
  const double blend = u * u * u * (10 - 15 * u + 6 * u * u);
  for (int k = 0; k < 3; ++k) {
    out[k] =
        from[k + 1] + blend * (to[k + 1] - from[k + 1]) + h->sine[k] * sin(2 * M_PI * h->hz * t);
  }
}

/* The pointer's pose and speed one tick later, pushed by force. */
static void hand_step(const hand *h, double t, const double force[3], double x[3], double v[3])
{
  double now[3];
  double next[3];
  path_at(h, t, now);
  path_at(h, t + tick, next);
  for (int k = 0; k < 3; ++k) {
    const double wanted = (next[k] - now[k]) / tick;
    const double pull = h->stiffness * (now[k] - x[k]) + h->damping * (wanted - v[k]);
    v[k] = h->mass > 0 ? v[k] + tick * (pull + force[k]) / h->mass : wanted;
    x[k] = h->mass > 0 ? x[k] + tick * v[k] : next[k];
  }
}

/* Contact of the pointer with one body; adds to the force on the hand and pushes the body. True if
 * it pushes. */
static bool ball_touch(run *r, dGeomID ball, dBodyID body, const double v[3], double force[3])
{
  bool pushes = false;
  for (dGeomID geom = dBodyGetFirstGeom(body); geom != NULL; geom = dBodyGetNextGeom(geom)) {
    dContactGeom c;
    dVector3 u;
    if (dCollide(ball, geom, 1, &c, sizeof c) == 0) {
      continue;
    }
    dBodyGetPointVel(body, c.pos[0], c.pos[1], c.pos[2], u);
    double rate = 0;
    for (int k = 0; k < 3; ++k) {
      rate -= c.normal[k] * (v[k] - u[k]);
    }
    const scene_parameters *p = &r->s->parameters;
    const double f = fmax(0, p->stiffness * c.depth + p->damping * rate);
    pushes = pushes || f > 0;
    for (int k = 0; k < 3; ++k) {
      force[k] += f * c.normal[k];
    }
    dBodyAddForceAtPos(body, -f * c.normal[0], -f * c.normal[1], -f * c.normal[2], c.pos[0],
                       c.pos[1], c.pos[2]);
  }
  return pushes;
}

/* What a pointer felt in a run. */
typedef struct felt {
  double peak_n;
  double last_n;
  double share;   /* of the duration in which a force is felt */
  double held;    /* of the duration in which the hand does not move */
  double impulse; /* N s */
  bool first;     /* the first body was touched */
  int at_once;    /* most bodies touched at the same time */
} felt;

/* A simulated hand with its pointer. */
typedef struct player {
  hand h;
  dGeomID ball;
  double x[3];
  double v[3];
  double force[3];
} player;

static void player_init(player *one, const scene_parameters *p, int index)
{
  *one = (player){.ball = dCreateSphere(NULL, p->radius)};
  parse_hand(p->hands[index], &one->h);
  path_at(&one->h, 0, one->x);
}

static double vector_norm(const double *x)
{
  return sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
}

/* One tick of one pointer that starts at time t. */
static void player_tick(player *one, run *r, double t, felt *out)
{
  const double part = tick / r->s->parameters.duration;
  int touched = 0;
  hand_step(&one->h, t, one->force, one->x, one->v);
  dGeomSetPosition(one->ball, one->x[0], one->x[1], one->x[2]);
  memset(one->force, 0, sizeof one->force);
  for (size_t b = 0; b < r->s->body_count; ++b) {
    const bool pushes = ball_touch(r, one->ball, r->s->bodies[b], one->v, one->force);
    out->first = out->first || (b == 0 && pushes);
    touched += pushes;
  }
  const double f = vector_norm(one->force);
  out->last_n = f;
  out->peak_n = fmax(out->peak_n, f);
  out->share += f > 0 ? part : 0;
  out->held += vector_norm(one->v) < 1e-3 ? part : 0;
  out->impulse += f * tick;
  out->at_once = touched > out->at_once ? touched : out->at_once;
}

static void run_watch(run *r)
{
  const double x = dBodyGetPosition(r->s->bodies[0])[0];
  const size_t other = r->s->body_count > 1 ? 1 : 0;
  r->least = fmin(r->least, x);
  r->most = fmax(r->most, x);
  if (vector_norm(dBodyGetLinearVel(r->s->bodies[other])) < 0.01) {
    r->fastest = fmax(r->fastest, vector_norm(dBodyGetLinearVel(r->s->bodies[0])));
  }
}

/* Plays the scene and tells what each pointer felt. */
static void play_all(run *r, felt out[SCENE_POINTERS_MAX])
{
  const scene_parameters *p = &r->s->parameters;
  const long ticks = lround(p->duration / tick);
  player players[SCENE_POINTERS_MAX];
  memset(out, 0, SCENE_POINTERS_MAX * sizeof *out);
  r->least = r->most = dBodyGetPosition(r->s->bodies[0])[0];
  for (int k = 0; k < p->pointers; ++k) {
    player_init(&players[k], p, k);
  }
  for (long i = 0; i < ticks; ++i) {
    for (int k = 0; k < p->pointers; ++k) {
      player_tick(&players[k], r, (double)i * tick, &out[k]);
    }
    run_step(r, tick);
    run_watch(r);
  }
  for (int k = 0; k < p->pointers; ++k) {
    dGeomDestroy(players[k].ball);
  }
}

static felt run_play(run *r)
{
  felt all[SCENE_POINTERS_MAX];
  play_all(r, all);
  return all[0];
}

static void check_parameters(const scene *s)
{
  const scene_parameters *p = &s->parameters;
  CHECK(p->mass > 0 && p->size > 0 && p->radius > 0 && p->duration > 0 && p->iterations > 0);
  CHECK(near_zero_or_more(p->stiffness) && near_zero_or_more(p->damping) && p->mu >= 0);
  CHECK(p->pointers >= 1 && p->pointers <= SCENE_POINTERS_MAX);
  for (int i = 0; i < p->pointers; ++i) {
    CHECK(p->hands[i] != NULL && strncmp(p->hands[i], "virtual:", 8) == 0);
  }
  CHECK(dWorldGetCFM(s->world) <= 1e-10);
  CHECK(dWorldGetAutoDisableFlag(s->world) == 0);
  CHECK(dWorldGetQuickStepNumIterations(s->world) == p->iterations);
}

static void check_bodies(const scene *s)
{
  CHECK(s->body_count > 0);
  for (size_t i = 0; i < s->body_count; ++i) {
    const dReal *x = dBodyGetPosition(s->bodies[i]);
    dMass mass;
    dBodyGetMass(s->bodies[i], &mass);
    CHECK(isfinite(x[0]) && isfinite(x[1]) && isfinite(x[2]));
    CHECK(isfinite(mass.mass) && mass.mass > 0 && dMassCheck(&mass) == 1);
    CHECK(dBodyGetFirstGeom(s->bodies[i]) != NULL);
  }
}

static void check_start(const char *spec)
{
  run r;
  REQUIRE(open_run(&r, spec));
  check_parameters(r.s);
  check_bodies(r.s);
  dSpaceCollide(r.s->space, &r, pair_near);
  CHECK(r.deepest <= r.s->parameters.layer + 1e-4);
  close_run(&r);
}

TEST(every_scene_builds)
{
  const size_t count = sizeof names / sizeof names[0];
  for (size_t i = 0; i < count; ++i) {
    check_start(names[i]);
  }
  CHECK(scene_table_at(count - 1) != NULL && scene_table_at(count) == NULL);
}

static void check_count(const char *spec, size_t bodies)
{
  run r;
  REQUIRE(open_run(&r, spec));
  CHECK(r.s->body_count == bodies);
  CHECK(r.s->count == (int)bodies);
  close_run(&r);
}

TEST(n_is_the_number_of_bodies)
{
  const int counts[] = {1, 2, 3, 5, 6, 13, 100, 2000};
  const char *some[] = {"fig7", "row10", "pile", "tower"};
  for (size_t i = 0; i < sizeof counts / sizeof counts[0]; ++i) {
    for (size_t k = 0; k < sizeof some / sizeof some[0]; ++k) {
      char spec[32];
      snprintf(spec, sizeof spec, "%s:%d", some[k], counts[i]);
      check_count(spec, (size_t)counts[i]);
      check_start(spec);
    }
  }
  check_count("fig7", 10);
  check_count("row10", 10);
  check_count("pile", 100);
  check_count("tower", 8);
}

/* Largest distance that a body moved, m; infinite when one is not finite. */
static double largest_move(const run *r)
{
  double largest = 0;
  for (size_t i = 0; i < r->s->body_count && i < KEPT_MAX; ++i) {
    const dReal *x = dBodyGetPosition(r->s->bodies[i]);
    const double *from = r->start[i];
    const double move = hypot(hypot(x[0] - from[0], x[1] - from[1]), x[2] - from[2]);
    largest = isfinite(move) ? fmax(largest, move) : HUGE_VAL;
  }
  return largest;
}

/* The two bodies see the anchor at the same place, and the axis still points where it did. */
static void check_hinge(dJointID hinge)
{
  dVector3 a;
  dVector3 b;
  dJointGetHingeAnchor(hinge, a);
  dJointGetHingeAnchor2(hinge, b);
  CHECK(hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]) < 2e-4);
  dJointGetHingeAxis(hinge, a);
  const dBodyID body = dJointGetBody(hinge, 0);
  const dReal *w = dBodyGetRotation(body);
  /* along z (door) or y (light stand), in the world and in the body */
  const int k = fabs(a[2]) > fabs(a[1]) ? 2 : 1;
  CHECK_NEAR(fabs(w[5 * k]), 1, 1e-3);
}

static int check_joints(const scene *s)
{
  int hinges = 0;
  for (size_t i = 0; i < s->body_count; ++i) {
    for (int k = 0; k < dBodyGetNumJoints(s->bodies[i]); ++k) {
      const dJointID joint = dBodyGetJoint(s->bodies[i], k);
      if (dJointGetType(joint) == dJointTypeHinge) {
        ++hinges;
        check_hinge(joint);
      }
    }
  }
  return hinges;
}

static void check_rest(const char *spec, double seconds)
{
  run r;
  REQUIRE(open_run(&r, spec));
  for (int i = 0; i * slow_step < seconds; ++i) {
    run_step(&r, slow_step);
  }
  printf("# %s: moved %.4f mm\n", spec, 1e3 * largest_move(&r));
  CHECK(largest_move(&r) < 1e-3);
  check_joints(r.s);
  close_run(&r);
}

TEST(resting_scenes_stay_at_rest)
{
  for (size_t i = 1; i < sizeof names / sizeof names[0]; ++i) { /* fig5 flies */
    /* eight cubes stand for their run; longer takes twice the iterations */
    check_rest(names[i], strcmp(names[i], "tower") == 0 ? 1.2 : 10);
  }
  check_rest("pile:1", 10);
  check_rest("tower:3", 10);
}

TEST(fig5_flies_at_its_speed)
{
  run r;
  REQUIRE(open_run(&r, "fig5"));
  const dBodyID cube = r.s->bodies[0];
  const double start = dBodyGetPosition(cube)[0];
  for (int i = 0; i < 40; ++i) {
    run_step(&r, slow_step);
    const dReal *v = dBodyGetLinearVel(cube);
    const dReal *w = dBodyGetAngularVel(cube);
    CHECK(v[0] == -0.017 && v[1] == 0 && v[2] == 0);
    CHECK(w[0] == 0 && w[1] == 0 && w[2] == 0);
  }
  CHECK_NEAR(dBodyGetPosition(cube)[0], start - 2 * 0.017, 1e-12);
  dMass mass;
  dBodyGetMass(cube, &mass);
  CHECK(mass.mass == 60);
  const double contact_s = r.s->parameters.gap / 0.017;
  CHECK(contact_s > 0.09 && contact_s < 0.13);
  CHECK(fabs(remainder(contact_s, slow_step)) > 0.005);
  close_run(&r);
}

/* Closed forms: half period, peak v sqrt(k m), impulse 2 m v. */
TEST(fig5_rebounds_as_a_spring_does)
{
  run r;
  REQUIRE(open_run(&r, "fig5"));
  const scene_parameters p = r.s->parameters;
  const felt f = run_play(&r);
  CHECK_NEAR(f.peak_n, 0.017 * sqrt(p.stiffness * p.mass), 1e-3);
  CHECK_NEAR(f.share * p.duration, M_PI * sqrt(p.mass / p.stiffness), 2 * tick);
  CHECK_NEAR(f.impulse, 2 * p.mass * 0.017, 1e-3);
  close_run(&r);
}

static void check_felt(const run *r, const felt *f, double peak_max, double share_min)
{
  printf("# %s: peak %.2f N, contact %.0f %%, held %.0f %%, %.2f N s, %d at once\n",
         r->s->parameters.name, f->peak_n, 100 * f->share, 100 * f->held, f->impulse, f->at_once);
  CHECK(f->first);
  CHECK(f->peak_n >= 1 && f->peak_n <= peak_max);
  CHECK(f->share >= share_min);
}

TEST(hands_are_felt)
{
  const char *specs[] = {"fig6",  "fig7", "slide",      "row10", "stack",
                         "wedge", "door", "lightstand", "pile"};
  for (size_t i = 0; i < sizeof specs / sizeof specs[0]; ++i) {
    run r;
    REQUIRE(open_run(&r, specs[i]));
    const felt f = run_play(&r);
    check_felt(&r, &f, 10, 0.4);
    CHECK(f.held <= 0.3);
    CHECK(r.s->parameters.hinge_torque == 0 || check_joints(r.s) > 0);
    close_run(&r);
  }
}

/* Plays a scene whose hands are rigid; false: it cannot. */
static bool play_rigid(run *r, const char *spec, double share_min, felt out[SCENE_POINTERS_MAX])
{
  if (!open_run(r, spec)) {
    return false;
  }
  play_all(r, out);
  for (int k = 0; k < r->s->parameters.pointers; ++k) {
    CHECK(strstr(r->s->parameters.hands[k], "hand=rigid") != NULL);
    check_felt(r, &out[k], 15, share_min);
    CHECK(out[k].held <= 0.3 || strcmp(spec, "hold") == 0);
  }
  return true;
}

TEST(tower_is_pushed_and_stands)
{
  felt f[SCENE_POINTERS_MAX];
  run r;
  REQUIRE(play_rigid(&r, "tower", 0.4, f));
  CHECK(f[0].last_n == 0);
  for (size_t i = 0; i < r.s->body_count; ++i) {
    const dReal *x = dBodyGetPosition(r.s->bodies[i]);
    const double *start = r.start[i];
    const bool upper = i < 2; /* the pushed one, and the one on top */
    CHECK_NEAR(x[2], start[2], 5e-4);
    CHECK(upper ? x[0] - start[0] > 0.008 && x[0] - start[0] < 0.02 : fabs(x[0] - start[0]) < 1e-3);
  }
  close_run(&r);
}

TEST(topple_falls_over)
{
  felt f[SCENE_POINTERS_MAX];
  run r;
  REQUIRE(play_rigid(&r, "topple", 0.2, f));
  /* its height lies along x, and it rests */
  CHECK_NEAR(dBodyGetRotation(r.s->bodies[0])[2], 1, 1e-3);
  CHECK_NEAR(dBodyGetPosition(r.s->bodies[0])[2], r.s->parameters.size / 2, 2e-3);
  CHECK(vector_norm(dBodyGetLinearVel(r.s->bodies[0])) < 0.01);
  close_run(&r);
}

TEST(edge_falls_to_the_floor)
{
  felt f[SCENE_POINTERS_MAX];
  run r;
  REQUIRE(play_rigid(&r, "edge", 0.2, f));
  const scene_parameters *p = &r.s->parameters;
  const dReal *x = dBodyGetPosition(r.s->bodies[0]);
  CHECK_NEAR(x[2], p->size / 2, 2e-3);
  CHECK(x[0] > 1.4 * p->size + p->gap);
  CHECK(vector_norm(dBodyGetLinearVel(r.s->bodies[0])) < 0.05);
  close_run(&r);
}

TEST(hit_collides_at_a_metre_a_second)
{
  felt f[SCENE_POINTERS_MAX];
  run r;
  REQUIRE(play_rigid(&r, "hit", 0.4, f));
  const dReal *a = dBodyGetPosition(r.s->bodies[0]);
  const dReal *b = dBodyGetPosition(r.s->bodies[1]);
  const scene_parameters *p = &r.s->parameters;
  CHECK_NEAR(r.fastest, 1, 0.15);
  CHECK(b[0] > 1.5 * p->size + p->gap + 0.05);
  CHECK(b[0] - a[0] > p->size - 2 * p->layer);
  close_run(&r);
}

TEST(round_bodies_roll_to_and_fro)
{
  const char *specs[] = {"roll", "roll_capsule", "roll_cylinder"};
  for (size_t i = 0; i < sizeof specs / sizeof specs[0]; ++i) {
    felt f[SCENE_POINTERS_MAX];
    run r;
    REQUIRE(play_rigid(&r, specs[i], 0.2, f));
    const double radius = r.s->parameters.size / 2;
    const dReal *w = dBodyGetAngularVel(r.s->bodies[0]);
    const dReal *v = dBodyGetLinearVel(r.s->bodies[0]);
    const dReal *x = dBodyGetPosition(r.s->bodies[0]);
    CHECK(r.s->parameters.pointers == 2);
    CHECK(r.most > radius + 0.05 && r.least < radius + 0.002);
    CHECK_NEAR(w[1] * radius, v[0], 2e-3);
    CHECK_NEAR(x[1], 0, 1e-4);
    /* turned as far as it came */
    const dReal *q = dBodyGetQuaternion(r.s->bodies[0]);
    const double lain = i == 0 ? 1 : sqrt(0.5); /* the part of how it lay at the start */
    CHECK_NEAR(2 * acos(fmin(1, fabs(q[0]) / lain)), (x[0] - radius) / radius, 0.02);
    close_run(&r);
  }
}

TEST(clump_touches_eight_at_once)
{
  felt f[SCENE_POINTERS_MAX];
  run r;
  REQUIRE(play_rigid(&r, "field", 0.3, f) && r.s->body_count == 16);
  CHECK(f[0].at_once == 16);
  close_run(&r);
  REQUIRE(play_rigid(&r, "clump8", 0.4, f));
  CHECK(f[0].at_once == 8 && r.s->body_count == 8);
  for (size_t i = 0; i < r.s->body_count; ++i) {
    CHECK(dBodyGetRotation(r.s->bodies[i])[10] > 0.999);
  }
  close_run(&r);
}

TEST(spheres_push_all_on)
{
  felt f[SCENE_POINTERS_MAX];
  run r;
  REQUIRE(play_rigid(&r, "spheres", 0.2, f));
  for (size_t i = 0; i < r.s->body_count; ++i) {
    const dReal *x = dBodyGetPosition(r.s->bodies[i]);
    CHECK(x[0] - r.start[i][0] > 0.01);
    CHECK_NEAR(x[2], r.s->parameters.size / 2, 1e-3);
  }
  close_run(&r);
}

TEST(hold_stays_under_the_hand)
{
  felt f[SCENE_POINTERS_MAX];
  run r;
  REQUIRE(play_rigid(&r, "hold", 0.8, f));
  CHECK(f[0].held > 0.8);
  CHECK_NEAR(f[0].last_n, 4, 0.1);
  CHECK(largest_move(&r) < 2e-4);
  close_run(&r);
}

/* The path alone, no force and no hand: the pointer must reach into the first body. */
TEST(paths_reach_the_first_body)
{
  for (size_t i = 0; scene_table_at(i) != NULL; ++i) {
    const scene_parameters *p = scene_table_at(i);
    run r;
    hand h;
    bool reached = false;
    REQUIRE(open_run(&r, p->name));
    parse_hand(p->hands[0], &h);
    CHECK(h.count > 0 && h.waypoints[0][0] == 0 && h.waypoints[h.count - 1][0] <= p->duration);
    const dGeomID ball = p->tool[0] > 0 ? dCreateBox(NULL, p->tool[0], p->tool[1], p->tool[2])
                                        : dCreateSphere(NULL, p->radius);
    for (int k = 0; k * slow_step < p->duration; ++k) {
      const double t = k * slow_step;
      double x[3];
      dContactGeom c;
      path_at(&h, t, x);
      dGeomSetPosition(ball, x[0], x[1], x[2]);
      const int touches = dCollide(ball, dBodyGetFirstGeom(r.s->bodies[0]), 1, &c, sizeof c);
      CHECK(t > 0 || touches == 0);
      reached = reached || touches > 0;
      run_step(&r, slow_step);
    }
    CHECK(reached);
    dGeomDestroy(ball);
    close_run(&r);
  }
}

/* x of the scene's static box; NaN where it has none. */
static double block_x(const scene *s)
{
  double x = NAN;
  for (int i = 0; i < dSpaceGetNumGeoms(s->space); ++i) {
    const dGeomID geom = dSpaceGetGeom(s->space, i);
    const bool block = dGeomGetBody(geom) == NULL && dGeomGetClass(geom) == dBoxClass;
    x = block ? dGeomGetPosition(geom)[0] : x;
  }
  return x;
}

/* A step without gravity finds no joint open. */
static void check_closed(const scene *s)
{
  dWorldSetGravity(s->world, 0, 0, 0);
  dWorldQuickStep(s->world, tick);
  for (size_t b = 0; b < s->body_count; ++b) {
    CHECK(dBodyGetNumJoints(s->bodies[b]) == 0 ||
          vector_norm(dBodyGetLinearVel(s->bodies[b])) < 1e-9);
  }
}

static void check_shifted(scene_parameters p)
{
  const double shift[3] = {1e-3, -2e-6, 0.5};
  run still;
  scene *s = NULL;
  REQUIRE(open_run(&still, p.name));
  CHECK(vector_norm(still.s->parameters.shift) == 0);
  memcpy(p.shift, shift, sizeof shift);
  REQUIRE(scene_create_from(&p, 0, &s, NULL) == HAP_OK);
  CHECK(s->body_count == still.s->body_count);
  for (size_t b = 0; b < s->body_count; ++b) {
    const dReal *x = dBodyGetPosition(s->bodies[b]);
    for (int k = 0; k < 3; ++k) {
      CHECK(x[k] == still.start[b][k] + shift[k]);
    }
  }
  check_closed(s);
  CHECK(isnan(block_x(still.s)) ? isnan(block_x(s)) : block_x(s) == block_x(still.s));
  scene_destroy(s);
  close_run(&still);
}

TEST(shift_moves_what_can_move)
{
  for (size_t i = 0; scene_table_at(i) != NULL; ++i) {
    check_shifted(*scene_table_at(i));
  }
}

TEST(infinite_friction_stays_finite)
{
  run r;
  REQUIRE(open_run(&r, "slide"));
  scene_parameters p = r.s->parameters;
  close_run(&r);
  p.mu = dInfinity;
  memset(&r, 0, sizeof r);
  REQUIRE(scene_create_from(&p, 0, &r.s, NULL) == HAP_OK);
  r.contacts = dJointGroupCreate(0);
  const double start = dBodyGetPosition(r.s->bodies[0])[0];
  for (int i = 0; i < 50; ++i) {
    dBodyAddForce(r.s->bodies[0], 4, 0, 0);
    run_step(&r, slow_step);
  }
  CHECK_NEAR(dBodyGetPosition(r.s->bodies[0])[0], start, 1e-4);
  close_run(&r);
}

TEST(surface_leaves_out_jointed_pairs)
{
  run r;
  REQUIRE(open_run(&r, "lightstand"));
  CHECK(check_joints(r.s) == 6); /* three hinges, each seen from both of its bodies */
  const size_t base = r.s->body_count - 1;
  const dGeomID lower = dBodyGetFirstGeom(r.s->bodies[base - 1]);
  const dGeomID head = dBodyGetFirstGeom(r.s->bodies[0]);
  dSurfaceParameters io = {.mode = dContactApprox1, .mu = dInfinity};
  CHECK(!scene_surface(r.s, lower, dBodyGetFirstGeom(r.s->bodies[base]), &io));
  CHECK(scene_surface(r.s, lower, head, &io));
  CHECK(io.mu == 0.5 && io.mode == dContactApprox1);
  close_run(&r);
}
