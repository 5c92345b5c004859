/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <hapode/device.h>
#include <hapode/device_impl.h>
#include <hapode/hapode.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/histogram.h"
#include "base/vec.h"
#include "bench/storm.h"
#include "device/device.h"

#define STORM_THINGS 24
#define STORM_GEOMS 3 /* of a thing */
#define STORM_WALLS 4

typedef struct storm_thing {
  dBodyID body; /* NULL: none */
  dGeomID geoms[STORM_GEOMS];
  int geom_count;
  dJointID joint;
  bool adopted;
} storm_thing;

typedef struct storm_world {
  dWorldID world;
  dSpaceID space;
  dSpaceID nested;
  storm_thing things[STORM_THINGS];
  dGeomID walls[STORM_WALLS];
  double spots[STORM_SPOTS][3]; /* m */
  int spot_count;
  uint64_t seed;
  hap_session *session;
  storm_telling telling;
  uint64_t edits;
  uint64_t untold;                      /* bodies destroyed without a word */
  uint64_t unexpected;                  /* answers of the session */
  _Atomic(dBodyID) shown[STORM_THINGS]; /* the bodies, for those who draw */
} storm_world;

/* A device on a circle, which nothing stops, that keeps book of every force it is given. */

typedef struct storm_book {
  uint64_t writes;
  uint64_t bad; /* not finite, beyond the limit, too steep, or to a device that does not run */
  uint64_t stops_with_force;
  double peak;       /* N */
  double steepest;   /* N, between two writes */
  atomic_bool holds; /* a force */
} storm_book;

#define FAR 0.6  /* m: what is farther away is put back */
#define FAST 4.0 /* m/s */
#define SPIN 60.0

static double storm_uniform(uint64_t *seed, double low, double high)
{
  *seed ^= *seed << 13;
  *seed ^= *seed >> 7;
  *seed ^= *seed << 17;
  return low + (high - low) * (double)(*seed >> 11) * 0x1p-53;
}

static double world_uniform(storm_world *w, double low, double high)
{
  return storm_uniform(&w->seed, low, high);
}

static int world_below(storm_world *w, int count)
{
  int n = (int)world_uniform(w, 0.0, count);
  return n < count ? n : count - 1;
}

static bool world_chance(storm_world *w, double share)
{
  return world_uniform(w, 0.0, 1.0) < share;
}

static void world_expect(storm_world *w, bool good)
{
  w->unexpected += !good;
}

/* Most things are where a hand is. */
static void choose_place(storm_world *w, double out[3])
{
  double wide = w->spot_count > 0 && world_chance(w, 0.8) ? 0.04 : 0.3;
  const double *spot = w->spots[w->spot_count > 0 ? world_below(w, w->spot_count) : 0];
  for (int k = 0; k < 3; ++k) {
    out[k] = (wide < 0.1 ? spot[k] : 0.0) + world_uniform(w, -wide, wide);
  }
}

/* ---- geoms ---- */

static dGeomID make_geom(storm_world *w)
{
  dSpaceID space = world_chance(w, 0.3) ? w->nested : w->space;
  double a = world_uniform(w, 0.01, 0.05);
  double b = world_uniform(w, 0.02, 0.1);
  switch (world_below(w, 4)) {
    case 0:
      return dCreateSphere(space, a);
    case 1:
      return dCreateCapsule(space, a, b);
    case 2:
      return dCreateCylinder(space, a, b);
    default:
      return dCreateBox(space, 2 * a, b, world_uniform(w, 0.02, 0.1));
  }
}

static void add_geom(storm_world *w, storm_thing *t)
{
  if (t->geom_count < STORM_GEOMS) {
    dGeomID geom = make_geom(w);
    dGeomSetBody(geom, t->body);
    if (t->geom_count > 0) {
      dGeomSetOffsetPosition(geom, world_uniform(w, -0.05, 0.05), world_uniform(w, -0.05, 0.05),
                             0.0);
    }
    t->geoms[t->geom_count++] = geom;
  }
}

static void drop_geom(storm_world *w, storm_thing *t, bool tell)
{
  dGeomID geom = t->geoms[--t->geom_count];
  if (tell) {
    world_expect(w, hap_session_forget_geom(w->session, geom) == HAP_OK);
  }
  dGeomDestroy(geom);
}

static void resize_geom(storm_world *w, dGeomID geom)
{
  double a = world_uniform(w, 0.01, 0.05);
  double b = world_uniform(w, 0.02, 0.1);
  switch (dGeomGetClass(geom)) {
    case dSphereClass:
      dGeomSphereSetRadius(geom, a);
      break;
    case dCapsuleClass:
      dGeomCapsuleSetParams(geom, a, b);
      break;
    case dCylinderClass:
      dGeomCylinderSetParams(geom, a, b);
      break;
    default:
      dGeomBoxSetLengths(geom, b, b, 2 * a);
      break;
  }
}

/* ---- bodies ---- */

static void set_mass(storm_world *w, storm_thing *t)
{
  dMass mass;
  double edge = world_uniform(w, 0.03, 0.1);
  dMassSetBoxTotal(&mass, world_uniform(w, 0.05, 2.0), edge, edge, world_uniform(w, 0.03, 0.1));
  dBodySetMass(t->body, &mass);
}

static void create_body(storm_world *w, storm_thing *t)
{
  double at[3];
  memset(t, 0, sizeof *t);
  t->body = dBodyCreate(w->world);
  choose_place(w, at);
  dBodySetPosition(t->body, at[0], at[1], at[2]);
  set_mass(w, t);
  add_geom(w, t);
}

static void destroy_body(storm_world *w, storm_thing *t)
{
  bool tell = t->adopted || w->telling == STORM_TELLS ||
              (w->telling == STORM_TELLS_HALF && world_chance(w, 0.5));
  w->untold += !tell;
  if (tell) {
    hap_status status = hap_session_forget_body(w->session, t->body);
    world_expect(w, status == HAP_OK || status == HAP_ERROR_NOT_FOUND);
  }
  if (t->joint != NULL && world_chance(w, 0.5)) {
    dJointDestroy(t->joint);
    t->joint = NULL;
  }
  bool geoms_first = world_chance(w, 0.5);
  for (int round = 0; round < 2; ++round) {
    while (geoms_first == (round == 0) && t->geom_count > 0) {
      drop_geom(w, t, tell);
    }
    if (geoms_first == (round == 1)) {
      dBodyDestroy(t->body);
    }
  }
  if (t->joint != NULL) {
    dJointDestroy(t->joint);
  }
  memset(t, 0, sizeof *t);
}

/* ---- the edits ---- */

static void edit_replace(storm_world *w, storm_thing *t)
{
  destroy_body(w, t);
  create_body(w, t); /* mostly at the same address */
}

static void edit_pose(storm_world *w, storm_thing *t)
{
  double at[3];
  dQuaternion q = {world_uniform(w, -1, 1), world_uniform(w, -1, 1), world_uniform(w, -1, 1), 0.1};
  choose_place(w, at);
  dBodySetPosition(t->body, at[0], at[1], at[2]);
  dBodySetQuaternion(t->body, q);
}

static void edit_velocity(storm_world *w, storm_thing *t)
{
  dBodySetLinearVel(t->body, world_uniform(w, -1, 1), world_uniform(w, -1, 1),
                    world_uniform(w, -1, 1));
  dBodySetAngularVel(t->body, world_uniform(w, -5, 5), world_uniform(w, -5, 5),
                     world_uniform(w, -5, 5));
}

static void edit_shape(storm_world *w, storm_thing *t)
{
  if (t->geom_count > 0) {
    resize_geom(w, t->geoms[world_below(w, t->geom_count)]);
  }
}

static void edit_offset(storm_world *w, storm_thing *t)
{
  if (t->geom_count > 0) {
    dGeomID geom = t->geoms[world_below(w, t->geom_count)];
    if (world_chance(w, 0.5)) {
      dGeomSetOffsetPosition(geom, world_uniform(w, -0.04, 0.04), world_uniform(w, -0.04, 0.04),
                             0.01);
    } else {
      dGeomClearOffset(geom);
    }
  }
}

static void edit_kinematic(storm_world *w, storm_thing *t)
{
  if (dBodyIsKinematic(t->body)) {
    dBodySetDynamic(t->body);
  } else {
    dBodySetKinematic(t->body);
    dBodySetLinearVel(t->body, world_uniform(w, -0.2, 0.2), world_uniform(w, -0.2, 0.2), 0.0);
  }
}

static void edit_enabled(storm_world *w, storm_thing *t)
{
  if (world_chance(w, 0.7)) {
    dBodyEnable(t->body);
  } else {
    dBodyDisable(t->body);
  }
}

static void edit_geoms(storm_world *w, storm_thing *t)
{
  if (t->geom_count > 1 && world_chance(w, 0.5)) {
    drop_geom(w, t, world_chance(w, 0.5) || w->telling == STORM_TELLS);
  } else if (t->geom_count == 1 && dBodyGetNumJoints(t->body) == 0) { /* a point mass */
    world_expect(w, hap_session_adopt_body(w->session, t->body) == HAP_OK);
    t->adopted = true;
    drop_geom(w, t, true);
    world_expect(w, hap_session_adopt_body(w->session, t->body) == HAP_OK);
  } else {
    add_geom(w, t);
  }
}

static void edit_geom_flags(storm_world *w, storm_thing *t)
{
  if (t->geom_count > 0) {
    dGeomID geom = t->geoms[world_below(w, t->geom_count)];
    dGeomSetCategoryBits(geom, world_chance(w, 0.8) ? ~0ul : 2ul);
    if (world_chance(w, 0.8)) {
      dGeomEnable(geom);
    } else {
      dGeomDisable(geom);
    }
    dSpaceID from = dGeomGetSpace(geom);
    dSpaceRemove(from, geom);
    dSpaceAdd(from == w->space ? w->nested : w->space, geom);
    dGeomSetBody(geom, t->body); /* ODE does not take a geom that is added for one that moved */
  }
}

static void set_joint(storm_world *w, storm_thing *t)
{
  const dReal *at = dBodyGetPosition(t->body);
  const storm_thing *partner = &w->things[world_below(w, STORM_THINGS)];
  dBodyID other = partner == t || partner->geom_count == 0 ? NULL : partner->body;
  switch (world_below(w, 4)) {
    case 0:
      t->joint = dJointCreateBall(w->world, NULL);
      dJointAttach(t->joint, t->body, other);
      dJointSetBallAnchor(t->joint, at[0], at[1], at[2]);
      break;
    case 1:
      t->joint = dJointCreateHinge(w->world, NULL);
      dJointAttach(t->joint, t->body, other);
      dJointSetHingeAnchor(t->joint, at[0], at[1], at[2]);
      dJointSetHingeAxis(t->joint, 0.0, 0.0, 1.0);
      dJointSetHingeParam(t->joint, dParamVel, world_uniform(w, -2, 2));
      dJointSetHingeParam(t->joint, dParamFMax, 0.1);
      break;
    case 2:
      t->joint = dJointCreateSlider(w->world, NULL);
      dJointAttach(t->joint, t->body, other);
      dJointSetSliderAxis(t->joint, 1.0, 0.0, 0.0);
      break;
    default:
      t->joint = dJointCreateFixed(w->world, NULL);
      dJointAttach(t->joint, t->body, other);
      dJointSetFixed(t->joint);
      break;
  }
}

static void edit_joint(storm_world *w, storm_thing *t)
{
  if (t->joint != NULL) {
    dJointDestroy(t->joint);
    t->joint = NULL;
  } else if (t->geom_count > 0) {
    set_joint(w, t);
  }
}

static void edit_settings(storm_world *w, storm_thing *t)
{
  dBodySetAutoDisableFlag(t->body, world_chance(w, 0.5));
  dBodySetAutoDisableTime(t->body, world_uniform(w, 0.0, 0.5));
  dBodySetAutoDisableSteps(t->body, world_below(w, 20));
  dBodySetLinearDamping(t->body, world_uniform(w, 0.0, 0.1));
  dBodySetGyroscopicMode(t->body, world_chance(w, 0.5));
  dBodySetGravityMode(t->body, world_chance(w, 0.8));
  dBodySetFiniteRotationMode(t->body, world_chance(w, 0.1));
  dBodyAddForce(t->body, world_uniform(w, -5, 5), world_uniform(w, -5, 5), world_uniform(w, -5, 5));
}

static void edit_world(storm_world *w, storm_thing *t)
{
  int i = world_below(w, STORM_WALLS);
  double at[3];
  (void)t;
  dWorldSetGravity(w->world, world_uniform(w, -2, 2), world_uniform(w, -2, 2),
                   world_uniform(w, -9.81, 0.0));
  dWorldSetERP(w->world, world_uniform(w, 0.1, 0.4));
  dWorldSetQuickStepNumIterations(w->world, 10 + world_below(w, 20));
  dWorldSetContactSurfaceLayer(w->world, world_uniform(w, 0.0, 1e-3));
  choose_place(w, at);
  if (world_chance(w, 0.5)) {
    if (w->telling == STORM_TELLS) {
      world_expect(w, hap_session_forget_geom(w->session, w->walls[i]) == HAP_OK);
    }
    dGeomDestroy(w->walls[i]);
    w->walls[i] = dCreateBox(w->space, world_uniform(w, 0.05, 0.3), 0.05, 0.05);
  }
  dGeomSetPosition(w->walls[i], at[0], at[1], at[2]);
}

typedef void (*edit_fn)(storm_world *w, storm_thing *t);

static const edit_fn edits[] = {
    edit_replace,    edit_replace, edit_replace, edit_pose,     edit_velocity,  set_mass,
    edit_shape,      edit_shape,   edit_offset,  edit_enabled,  edit_kinematic, edit_geoms,
    edit_geom_flags, edit_joint,   edit_joint,   edit_settings, destroy_body,   edit_world,
};

/* Joints between bodies that were put elsewhere throw them about. */
static void world_calm(storm_world *w)
{
  for (int i = 0; i < STORM_THINGS; ++i) {
    storm_thing *t = &w->things[i];
    if (t->body != NULL && !(hapi_v3_norm(dBodyGetPosition(t->body)) < FAR &&
                             hapi_v3_norm(dBodyGetLinearVel(t->body)) < FAST &&
                             hapi_v3_norm(dBodyGetAngularVel(t->body)) < SPIN)) {
      edit_pose(w, t);
      dBodySetLinearVel(t->body, 0.0, 0.0, 0.0);
      dBodySetAngularVel(t->body, 0.0, 0.0, 0.0);
    }
  }
}

/* That many edits; the caller may touch the world. */
static void storm_world_edit(storm_world *w, int count)
{
  for (int i = 0; i < count; ++i) {
    storm_thing *t = &w->things[world_below(w, STORM_THINGS)];
    if (t->body == NULL) {
      create_body(w, t);
    } else {
      edits[world_below(w, sizeof edits / sizeof edits[0])](w, t);
    }
    ++w->edits;
  }
  world_calm(w);
  for (int i = 0; i < STORM_THINGS; ++i) {
    atomic_store_explicit(&w->shown[i], w->things[i].body, memory_order_relaxed);
  }
}

static void storm_world_open(storm_world *w, uint64_t seed)
{
  memset(w, 0, sizeof *w);
  w->seed = seed;
  w->world = dWorldCreate();
  w->space = dHashSpaceCreate(NULL);
  w->nested = dSimpleSpaceCreate(w->space);
  (void)dCreatePlane(w->space, 0.0, 0.0, 1.0, -0.15);
  for (int i = 0; i < STORM_WALLS; ++i) {
    w->walls[i] = dCreateBox(w->space, 0.1, 0.05, 0.05);
    dGeomSetPosition(w->walls[i], 0.1 * i - 0.15, 0.3, 0.0);
  }
  dWorldSetCFM(w->world, 1e-6);
  dWorldSetMaxAngularSpeed(w->world, 50.0); /* else ODE's gyroscopic term runs away at 60 Hz */
  dWorldSetContactMaxCorrectingVel(w->world, 1.0);
  for (int i = 0; i < STORM_THINGS / 2; ++i) {
    create_body(w, &w->things[i]);
  }
}

typedef struct storm_hand {
  double center[3];
  double radius;
  double hz;
  bool running;
  _Atomic double force[3]; /* N, held */
  storm_book book;
} storm_hand;

static hap_status hand_open_hand(void *context, const char *args, void **self, hap_detail *detail)
{
  (void)context;
  storm_hand *hand = hapi_alloc(sizeof *hand);
  (void)detail;
  if (hand == NULL) {
    return HAP_ERROR_MEMORY;
  }
  if (sscanf(args, "%lf/%lf/%lf/%lf/%lf", &hand->center[0], &hand->center[1], &hand->center[2],
             &hand->radius, &hand->hz) != 5) {
    hapi_free(hand);
    return HAP_ERROR_FORMAT;
  }
  atomic_init(&hand->book.holds, false);
  *self = hand;
  return HAP_OK;
}

static void hand_describe(void *self, uint32_t effector, hap_device_info *out)
{
  (void)effector;
  (void)self;
  out->dof = 3;
  out->max_force = STORM_FORCE;
  out->max_torque = 1.0;
}

/* Zero comes from any thread, also in the midst of a write. */
static void hand_hold(storm_hand *hand, const double force[3])
{
  for (int i = 0; i < 3; ++i) {
    atomic_store(&hand->force[i], force[i]);
  }
  atomic_store(&hand->book.holds, hapi_v3_norm(force) > 0.0);
}

static hap_status hand_start(void *self)
{
  storm_hand *hand = self;
  hand->running = true;
  return HAP_OK;
}

static hap_status read_hand(void *self, int64_t time_ns, hap_device_input *const out[])
{
  hap_device_input *in = out[0];
  const storm_hand *hand = self;
  double rate = 6.283185307179586 * hand->hz;
  double angle = rate * 1e-9 * (double)time_ns;
  double way[3] = {cos(angle), sin(angle), 0.5 * sin(angle)};
  double speed[3] = {-sin(angle), cos(angle), 0.5 * cos(angle)};
  in->pose = (hap_pose){{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
  hapi_v3_madd(hand->center, hand->radius, way, in->pose.position);
  hapi_v3_scale(hand->radius * rate, speed, in->twist.linear);
  in->buttons = 0;
  return HAP_OK;
}

static hap_status write_hand(void *self, const hap_device_output *const wanted[],
                             hap_device_output *const reached[])
{
  storm_hand *hand = self;
  storm_book *book = &hand->book;
  double change[3];
  for (int i = 0; i < 3; ++i) {
    change[i] = wanted[0]->wrench.force[i] - atomic_load(&hand->force[i]);
  }
  double force = hapi_v3_norm(wanted[0]->wrench.force);
  double step = hapi_v3_norm(change);
  bool good = hand->running && force <= STORM_FORCE * (1.0 + 1e-9) &&
              step <= STORM_SLEW * (1.0 + 1e-9); /* not for NaN */
  book->bad += !good;
  book->peak = fmax(book->peak, force);
  book->steepest = fmax(book->steepest, step);
  ++book->writes;
  hand_hold(hand, wanted[0]->wrench.force);
  reached[0]->wrench = wanted[0]->wrench;
  return HAP_OK;
}

static void hand_zero(void *self)
{
  static const double none[3] = {0.0, 0.0, 0.0};
  hand_hold(self, none);
}

static void hand_stop(void *self)
{
  storm_hand *hand = self;
  hand->book.stops_with_force += atomic_load(&hand->book.holds);
  hand->running = false;
}

static void close_hand(void *self)
{
  hapi_free(self);
}

static const hap_device_ops ops = {
    .abi = HAP_DEVICE_ABI,
    .size = sizeof(hap_device_ops),
    .name = "storm",
    .help = "a circle, for measurements",
    .pacing = HAP_PACING_VIRTUAL,
    .open = hand_open_hand,
    .describe = hand_describe,
    .start = hand_start,
    .read = read_hand,
    .write = write_hand,
    .zero = hand_zero,
    .stop = hand_stop,
    .close = close_hand,
};

/* On a circle of radius [m] about center [m], hz turns a second. */
static hap_status storm_hand_open(const double center[3], double radius, double hz,
                                  hap_device **out, hap_detail *detail)
{
  char args[200];
  snprintf(args, sizeof args, "%.17g/%.17g/%.17g/%.17g/%.17g", center[0], center[1], center[2],
           radius, hz);
  return hapi_device_open_ops(&ops, NULL, args, out, detail);
}

/* while no loop has it */
static const storm_book *storm_hand_book(hap_device *device)
{
  const storm_hand *hand = hapi_device_self(device);
  return &hand->book;
}

#define MS 1000000LL

typedef struct hand {
  _Atomic uint64_t id; /* hap_pointer_id.v, 0: it is not there */
  hap_device *device;  /* NULL: moved by hap_pointer_set_target */
} hand;

typedef struct storm {
  storm_def def;
  storm_world world;
  hap_session *session;
  hand hands[STORM_SPOTS];
  uint64_t seed; /* of the thread that drives */
  int64_t now_ns;
  atomic_bool stop;
  pthread_t editors[STORM_EDITORS_MAX];
  pthread_t poster;
  pthread_t viewer;
  atomic_uint_fast64_t unexpected;
  atomic_uint_fast64_t posts_taken;
  atomic_uint_fast64_t posts_refused;
  atomic_uint_fast64_t posts_run;
  atomic_uint_fast64_t in_vain;
  pthread_mutex_t waits_lock; /* between the editors */
  hapi_histogram waits;
  storm_result *out;
} storm;

static void storm_expect(storm *s, bool good)
{
  if (!good) {
    atomic_fetch_add(&s->unexpected, 1);
  }
}

static void sleep_ns(int64_t ns)
{
  hapi_clock_sleep_until(hapi_clock_now() + ns);
}

/* ---- the threads ---- */

static void run_edit(void *arg);

static void storm_post(storm *s)
{
  hap_status status = hap_session_post(s->session, run_edit, s);
  storm_expect(s, status == HAP_OK || status == HAP_ERROR_CAPACITY || status == HAP_ERROR_STATE);
  atomic_fetch_add(status == HAP_OK ? &s->posts_taken : &s->posts_refused, 1);
}

static void run_edit(void *arg)
{
  storm *s = arg;
  storm_world_edit(&s->world, 2);
  storm_expect(s, hap_session_lock(s->session) == HAP_ERROR_THREAD);
  if (atomic_fetch_add(&s->posts_run, 1) % 16 == 0) {
    storm_post(s); /* from within */
  }
}

static hap_status lock_somehow(storm *s, int way)
{
  switch (way) {
    case 0:
      return hap_session_try_lock(s->session, 0);
    case 1:
      return hap_session_try_lock(s->session, 2 * MS);
    case 2:
      return hap_session_try_lock(s->session, INT64_MAX);
    default:
      return hap_session_lock(s->session);
  }
}

static void edit_locked(storm *s, int way)
{
  int64_t begin = hapi_clock_now();
  hap_status status = lock_somehow(s, way);
  if (status == HAP_ERROR_TIMEOUT && way < 2) {
    atomic_fetch_add(&s->in_vain, 1);
    return;
  }
  storm_expect(s, status == HAP_OK);
  if (status == HAP_OK) {
    int64_t waited = hapi_clock_now() - begin;
    pthread_mutex_lock(&s->waits_lock);
    hapi_histogram_add(&s->waits, waited);
    pthread_mutex_unlock(&s->waits_lock);
    storm_world_edit(&s->world, 3);
    storm_expect(s, hap_session_unlock(s->session) == HAP_OK);
  }
}

static void *editor_main(void *arg)
{
  storm *s = arg;
  uint64_t seed = (uint64_t)(uintptr_t)&seed;
  dAllocateODEDataForThread(dAllocateMaskAll);
  while (!atomic_load(&s->stop)) {
    bool paced = s->def.editor_hz > 0.0;
    edit_locked(s, paced ? 3 : (int)storm_uniform(&seed, 0.0, 4.0));
    double pause_s = paced ? 1.0 / s->def.editor_hz : storm_uniform(&seed, 0.0, 0.006);
    sleep_ns((int64_t)(1e9 * pause_s));
  }
  dCleanupODEAllDataForThread();
  return NULL;
}

static void *poster_main(void *arg)
{
  storm *s = arg;
  while (!atomic_load(&s->stop)) {
    storm_post(s);
    sleep_ns(3 * MS);
  }
  return NULL;
}

static void look_at_bodies(storm *s)
{
  for (int i = 0; i < STORM_THINGS; ++i) {
    hap_pose pose;
    dBodyID body = atomic_load_explicit(&s->world.shown[i], memory_order_relaxed);
    if (body != NULL) {
      hap_status status =
          hap_session_poses(s->session, hap_session_now(s->session), &body, 1, &pose);
      storm_expect(s, status >= HAP_OK || status == HAP_ERROR_NOT_FOUND); /* it may have gone */
    }
  }
}

static void look_at_hands(storm *s)
{
  for (int i = 0; i < s->def.hands; ++i) {
    hap_pointer_state state;
    hap_pointer_id id = {atomic_load(&s->hands[i].id)};
    if (id.v != 0) {
      hap_status status = hap_pointer_get(s->session, id, &state, sizeof state);
      storm_expect(s, status == HAP_OK || status == HAP_ERROR_NOT_FOUND);
    }
  }
}

static void *viewer_main(void *arg)
{
  storm *s = arg;
  while (!atomic_load(&s->stop)) {
    hap_stats stats;
    hap_detail detail;
    look_at_bodies(s);
    look_at_hands(s);
    storm_expect(s, hap_session_stats(s->session, &stats, sizeof stats) == HAP_OK);
    storm_expect(s, hap_session_detail(s->session, &detail) == HAP_OK);
    sleep_ns(8 * MS);
  }
  return NULL;
}

/* ---- hands ---- */

/* Hands with a device have even numbers. */
static hap_status open_hand(storm *s, int index, hap_detail *detail)
{
  const double at[3] = {0.1 * (index % 4) - 0.15, 0.1 * (index / 4 % 4) - 0.15, 0.0};
  hapi_v3_copy(at, s->world.spots[index]);
  return index % 2 == 0
             ? storm_hand_open(at, 0.04, 0.4 + 0.05 * index, &s->hands[index].device, detail)
             : HAP_OK;
}

static void add_hand(storm *s, int index)
{
  hap_pointer_def def;
  hap_pointer_id id;
  hap_pointer_def_init(&def, sizeof def);
  def.device = s->hands[index].device;
  def.radius = 0.01 + 0.002 * (index % 5);
  def.stiffness = 500.0 * (1 + index % 4);
  def.damping = index % 3;
  def.max_force = STORM_FORCE;
  storm_expect(s, hap_pointer_add(s->session, &def, &id) == HAP_OK);
  atomic_store(&s->hands[index].id, id.v);
  ++s->out->hands_added;
}

static bool is_held(const storm *s, int index)
{
  hap_device *device = s->hands[index].device;
  return device != NULL && atomic_load(&storm_hand_book(device)->holds);
}

static void remove_hand(storm *s, int index)
{
  hap_pointer_state state;
  hap_pointer_id id = {atomic_exchange(&s->hands[index].id, 0)};
  storm_expect(s, hap_pointer_remove(s->session, id) == HAP_OK);
  s->out->unreleased += is_held(s, index);
  storm_expect(s, hap_pointer_remove(s->session, id) == HAP_ERROR_NOT_FOUND);
  storm_expect(s, hap_pointer_get(s->session, id, &state, sizeof state) == HAP_ERROR_NOT_FOUND);
}

static void move_hands(storm *s)
{
  for (int i = 1; i < s->def.hands; i += 2) {
    hap_pointer_id id = {atomic_load(&s->hands[i].id)};
    double angle = 1e-9 * (double)s->now_ns * (2.0 + 0.3 * i);
    const double *at = s->world.spots[i];
    hap_pose pose = {{at[0] + 0.04 * sin(angle), at[1] + 0.04 * cos(angle), at[2]},
                     {1.0, 0.0, 0.0, 0.0}};
    if (id.v != 0) {
      storm_expect(s, hap_pointer_set_target(s->session, id, &pose, NULL) == HAP_OK);
    }
  }
}

static void hands_churn(storm *s)
{
  int index = (int)storm_uniform(&s->seed, 0.0, s->def.hands);
  if (atomic_load(&s->hands[index].id) != 0) {
    remove_hand(s, index);
  } else {
    add_hand(s, index);
  }
}

/* ---- the run ---- */

static void take_figures(storm *s)
{
  storm_result *out = s->out;
  storm_expect(s, hap_session_stats(s->session, &out->stats, sizeof out->stats) == HAP_OK);
  uint32_t fault = out->stats.faults.fault;
  bool late = fault == HAP_FAULT_LATE || fault == HAP_FAULT_BLOCKED; /* the machine's */
  out->faults += late ? 0 : out->stats.faults.count;
  if (out->stats.faults.count > 0) {
    hap_detail detail = {""};
    (void)hap_session_detail(s->session, &detail);
    fprintf(stderr, "storm: %s\n", detail.text);
  }
}

/* A millisecond, or a tick in lockstep. */
static void storm_drive(storm *s, uint64_t round)
{
  int64_t before = s->now_ns;
  if (s->def.drive == HAP_DRIVE_LOCKSTEP) {
    if (round % 5 == 0) {
      storm_world_edit(&s->world, 1);
    }
    if (s->def.posts && round % 7 == 0) {
      storm_post(s);
    }
    storm_expect(s, hap_session_advance(s->session, 1) >= HAP_OK);
    s->now_ns += MS;
    if (s->def.ticked != NULL) {
      s->def.ticked(s->session, s->def.ticked_arg);
    }
    return;
  }
  sleep_ns(MS);
  s->now_ns = hapi_clock_now();
  if (s->def.drive == HAP_DRIVE_FRAME) {
    storm_expect(s, hap_session_update(s->session, 1e-9 * (double)(s->now_ns - before)) >= HAP_OK);
  }
}

static void drive_to_the_end(storm *s)
{
  s->now_ns = s->def.drive == HAP_DRIVE_LOCKSTEP ? 0 : hapi_clock_now();
  int64_t begin = s->now_ns;
  int64_t end = begin + (int64_t)(1e9 * s->def.seconds);
  bool restarted = !s->def.restarts;
  for (uint64_t round = 0; s->now_ns < end; ++round) {
    move_hands(s);
    if (s->def.churn && round % 11 == 0) {
      hands_churn(s);
    }
    if (!restarted && s->now_ns > begin + (end - begin) / 2) {
      storm_expect(s, hap_session_stop(s->session) == HAP_OK);
      take_figures(s);
      storm_expect(s, hap_session_start(s->session) >= HAP_OK);
      restarted = true;
    }
    storm_drive(s, round);
  }
}

static bool start_threads(storm *s, int *out_editors)
{
  bool good = pthread_create(&s->viewer, NULL, viewer_main, s) == 0;
  good = good && (!s->def.posts || pthread_create(&s->poster, NULL, poster_main, s) == 0);
  for (*out_editors = 0; good && *out_editors < s->def.editors; ++*out_editors) {
    good = pthread_create(&s->editors[*out_editors], NULL, editor_main, s) == 0;
  }
  return good;
}

static void run_threads(storm *s)
{
  int editors = 0;
  storm_expect(s, start_threads(s, &editors));
  drive_to_the_end(s);
  atomic_store(&s->stop, true);
  for (int i = 0; i < editors; ++i) {
    pthread_join(s->editors[i], NULL);
  }
  if (s->def.posts) {
    pthread_join(s->poster, NULL);
  }
  pthread_join(s->viewer, NULL);
}

static hap_status create_session(storm *s, hap_detail *detail)
{
  hap_session_def def;
  hap_ode_def ode;
  hap_session_def_init(&def, sizeof def);
  hap_ode_def_init(&ode, sizeof ode);
  def.drive = s->def.drive;
  def.model = s->def.model;
  def.physics_hz = s->def.physics_hz;
  def.max_pointers = STORM_SPOTS;
  def.rt_priority = s->def.rt_priority;
  ode.world = s->world.world;
  ode.space = s->world.space;
  ode.surface = s->def.surface;
  hap_status status = hap_session_create(&def, &ode, &s->session, detail);
  s->world.session = s->session;
  return status;
}

static hap_status storm_begin(storm *s, hap_detail *detail)
{
  hap_status status = HAP_OK;
  s->world.spot_count = s->def.hands;
  for (int i = 0; i < s->def.hands && status >= HAP_OK; ++i) {
    status = open_hand(s, i, detail);
  }
  status = status >= HAP_OK ? create_session(s, detail) : status;
  for (int i = 0; i < s->def.hands && status >= HAP_OK; ++i) {
    add_hand(s, i);
  }
  status = status >= HAP_OK ? hap_session_start(s->session) : status;
  if (status < HAP_OK && s->session != NULL) {
    (void)hap_session_detail(s->session, detail);
  }
  return status;
}

static void close_hands(storm *s)
{
  for (int i = 0; i < s->def.hands; ++i) {
    if (s->hands[i].device == NULL) {
      continue;
    }
    const storm_book *book = storm_hand_book(s->hands[i].device);
    s->out->writes += book->writes;
    s->out->bad += book->bad;
    s->out->unreleased += book->stops_with_force + is_held(s, i);
    s->out->peak = fmax(s->out->peak, book->peak);
    s->out->steepest = fmax(s->out->steepest, book->steepest);
    hap_device_close(s->hands[i].device);
  }
}

static void storm_conclude(storm *s)
{
  storm_result *out = s->out;
  out->edits = s->world.edits;
  out->untold = s->world.untold;
  out->unexpected = atomic_load(&s->unexpected) + s->world.unexpected;
  out->posts_run = atomic_load(&s->posts_run);
  out->posts_taken = atomic_load(&s->posts_taken);
  out->posts_refused = atomic_load(&s->posts_refused);
  out->tries_in_vain = atomic_load(&s->in_vain);
  out->lost = out->stats.faults.bodies_lost;
  out->wait_ms_p50 = 1e-6 * hapi_histogram_quantile_ns(&s->waits, 0.5);
  out->wait_ms_p99 = 1e-6 * hapi_histogram_quantile_ns(&s->waits, 0.99);
}

hap_status storm_run(const storm_def *def, storm_result *out, hap_detail *detail)
{
  static storm one; /* its histogram is large */
  storm *s = &one;
  memset(s, 0, sizeof *s);
  memset(out, 0, sizeof *out);
  s->def = *def;
  s->out = out;
  s->seed = def->seed * 77 + 1;
  pthread_mutex_init(&s->waits_lock, NULL);
  storm_world_open(&s->world, def->seed);
  s->world.telling = def->telling;
  hap_status status = storm_begin(s, detail);
  if (status >= HAP_OK) {
    if (def->drive == HAP_DRIVE_LOCKSTEP) {
      drive_to_the_end(s);
    } else {
      run_threads(s);
    }
    storm_expect(s, hap_session_stop(s->session) == HAP_OK);
    take_figures(s);
  }
  hap_session_destroy(s->session);
  storm_conclude(s); /* destroy runs what was posted last */
  close_hands(s);
  dSpaceDestroy(s->world.space);
  dWorldDestroy(s->world.world);
  pthread_mutex_destroy(&s->waits_lock);
  return status;
}
