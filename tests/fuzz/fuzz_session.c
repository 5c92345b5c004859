/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The numbers that an application hands in: defs of a session and of a pointer, then targets. In
 * lockstep, over one cube. Whatever they are, they are refused, or forces and bodies stay
 * finite. */

#include <math.h>

#include <hapode/hapode.h>
#include <hapode/ode.h>

#include "base/vec.h"
#include "tests/fuzz/fuzz.h"
#include "tools/session_defs.h"

#define EDITS_MAX 8
#define MOVES_MAX 12
#define TICKS_MAX 10

/* What is left of the bytes; zeros behind their end. */
typedef struct source {
  const uint8_t *data;
  size_t left;
} source;

typedef struct place {
  dWorldID world;
  dSpaceID space;
  dBodyID cube;
  hap_session *session;
} place;

static uint8_t take_byte(source *s)
{
  if (s->left == 0) {
    return 0;
  }
  --s->left;
  return *s->data++;
}

/* One that hurts, one of daily life, or any eight bytes. */
static double take_double(source *s)
{
  static const double list[] = {0.0,    -0.0,   1.0, -1.0, NAN,   INFINITY, -INFINITY, 1e308,
                                5e-324, 1e-300, 1e9, 1e6,  100.0, 0.5,      1e-6,      20000.0};
  uint8_t kind = take_byte(s);
  if (kind < sizeof list / sizeof list[0]) {
    return list[kind];
  }
  if (kind < 128) {
    return (kind - 72) * 2e-3; /* near the cube */
  }
  uint8_t bytes[sizeof(double)];
  double value;
  for (size_t i = 0; i < sizeof bytes; ++i) {
    bytes[i] = take_byte(s);
  }
  memcpy(&value, bytes, sizeof value);
  return value;
}

static int32_t take_int(source *s)
{
  double value = take_double(s);
  return fabs(value) < 2147483647.0 ? (int32_t)value : INT32_MIN; /* false for NaN */
}

typedef struct session_defs {
  hap_session_def def;
  hap_expert_def expert;
  hap_research_def research;
} session_defs;

static void edit_session(source *s, session_defs *defs)
{
  hap_session_def *def = &defs->def;
  hap_expert_def *expert = &defs->expert;
  hap_research_def *research = &defs->research;
  double *const doubles[] = {&def->physics_hz, &expert->contact_hz, &def->haptic_hz};
  int32_t *const integers[] = {&def->max_bodies,
                               &def->max_contacts,
                               &def->max_pointers,
                               &def->rt_priority,
                               &research->physics_latency_ticks,
                               &expert->trace_rows,
                               &def->max_steps_per_update,
                               &expert->max_hull_points};
  uint8_t field = take_byte(s) % 16;
  if (field < 3) {
    *doubles[field] = take_double(s);
  } else if (field < 11) {
    *integers[field - 3] = take_int(s);
  } else if (field == 11) {
    def->model = (hap_model)(take_byte(s) % 5);
  } else if (field == 12) {
    research->impulse_pose = (hap_impulse_pose)(take_byte(s) % 3);
  } else if (field == 13) {
    unsigned byte = take_byte(s);
    research->probe = (hap_probe)(byte % 5);
    expert_wish(expert, HAP_EFFECT_CROSS, (hap_effect_wish)(byte / 5 % 3));
  } else if (field == 14) {
    unsigned byte = take_byte(s);
    uint32_t *mask = (byte & 32u) != 0 ? &expert->effects_on : &expert->effects_off;
    *mask ^= UINT32_C(1) << byte % 32u;
  } else {
    unsigned byte = take_byte(s);
    double *const dials[] = {&def->accuracy, &expert->force_error_wanted, &expert->tick_share,
                             &expert->physics_share, &def->budget};
    *dials[byte % 5] = take_double(s);
  }
}

/* What is allowed and only costs time and memory is made smaller. */
static void keep_small(hap_session_def *def, hap_expert_def *expert)
{
  const struct {
    int32_t *value;
    int32_t limit;
  } sizes[] = {{&def->max_bodies, 1024},
               {&def->max_contacts, 4096},
               {&expert->trace_rows, 1048576},
               {&expert->max_hull_points, 1048576}};
  for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; ++i) {
    if (*sizes[i].value > 40 && *sizes[i].value <= sizes[i].limit) {
      *sizes[i].value = 40;
    }
  }
}

static void edit_pointer(source *s, hap_pointer_def *def)
{
  double *const doubles[] = {&def->radius,
                             &def->finger_radius,
                             &def->stiffness,
                             &def->damping,
                             &def->friction,
                             &def->motion_scale,
                             &def->force_scale,
                             &def->max_force,
                             &def->max_torque,
                             &def->pose_world_device.position[0],
                             &def->pose_world_device.position[1],
                             &def->pose_world_device.quat_wxyz[0],
                             &def->pose_world_device.quat_wxyz[3]};
  *doubles[take_byte(s) % (sizeof doubles / sizeof doubles[0])] = take_double(s);
}

static void place_build(place *p)
{
  static bool initialised;
  if (!initialised) {
    dInitODE2(0);
    initialised = true;
  }
  dMass mass;
  p->world = dWorldCreate();
  p->space = dHashSpaceCreate(NULL);
  p->cube = dBodyCreate(p->world);
  dMassSetBoxTotal(&mass, 1.0, 0.1, 0.1, 0.1);
  dBodySetMass(p->cube, &mass);
  dGeomSetBody(dCreateBox(p->space, 0.1, 0.1, 0.1), p->cube);
  dCreatePlane(p->space, 0.0, 0.0, 1.0, -0.05);
  dWorldSetGravity(p->world, 0.0, 0.0, -9.81);
}

/* What the header promises of a def that was taken. */
static void check_def(const hap_session_def *def)
{
  const hap_expert_def *expert = def->expert;
  const hap_research_def *research = def->research;
  const double ranges[][3] = {
      {def->physics_hz, 1.0, fmin(1000.0, def->haptic_hz)},
      {expert->contact_hz, expert->contact_hz == HAP_BY_ACCURACY ? HAP_BY_ACCURACY : 20.0, 1000.0},
      {def->accuracy, 0.0, 1.0},
      {def->haptic_hz, 100.0, 20000.0},
      {def->max_bodies, 1, 1024},
      {def->max_contacts, 1, 4096},
      {def->max_pointers, 1, 16},
      {def->rt_priority, 0, 98},
      {research->physics_latency_ticks, -1, def->haptic_hz / def->physics_hz + 1e-6},
      {expert->trace_rows, 0, 1048576},
      {def->max_steps_per_update, 1, 64},
      {expert->max_hull_points, 0, 1048576},
      {def->model, HAP_MODEL_SINGLE, HAP_MODEL_CONTACT},
      {research->impulse_pose, HAP_IMPULSE_INTERPOLATED, HAP_IMPULSE_HELD},
      {research->probe, HAP_PROBE_SHARED, HAP_PROBE_BY_ACCURACY},
      {def->budget, 0.0, 1.0},
  };
  for (size_t i = 0; i < sizeof ranges / sizeof ranges[0]; ++i) {
    FUZZ_CHECK(ranges[i][0] >= ranges[i][1] && ranges[i][0] <= ranges[i][2]);
  }
  FUZZ_CHECK((expert->effects_on & expert->effects_off) == 0);
  FUZZ_CHECK(((expert->effects_on | expert->effects_off) >> HAP_EFFECTS) == 0);
}

static bool session_create(source *s, place *p)
{
  session_defs defs;
  hap_ode_def ode;
  hap_detail detail;
  session_defs_init(&defs.def, &defs.expert, &defs.research);
  hap_ode_def_init(&ode, sizeof ode);
  defs.def.drive = HAP_DRIVE_LOCKSTEP;
  defs.def.max_bodies = 8; /* less memory to clear: more inputs a second */
  defs.def.max_contacts = 32;
  defs.expert.max_hull_points = 32;
  ode.world = p->world;
  ode.space = p->space;
  for (int edits = take_byte(s) % EDITS_MAX; edits > 0; --edits) {
    edit_session(s, &defs);
  }
  keep_small(&defs.def, &defs.expert);
  fuzz_detail_spoil(&detail);
  hap_status status = hap_session_create(&defs.def, &ode, &p->session, &detail);
  fuzz_check_answer(status, p->session, &detail);
  if (status >= HAP_OK) {
    check_def(&defs.def);
  }
  return status >= HAP_OK;
}

static void check_pose(hap_status status, const hap_pose *pose)
{
  FUZZ_CHECK(status >= HAP_OK || status == HAP_ERROR_NOT_FOUND);
  if (status >= HAP_OK) {
    const double *q = pose->quat_wxyz;
    FUZZ_CHECK(hapi_finite(pose->position, 3));
    FUZZ_CHECK(fabs(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] - 1.0) < 1e-6);
  }
}

/* Of any time. The cube is known from start to stop. */
static void check_drawing(const place *p, hap_pointer_id id)
{
  int64_t now = hap_session_now(p->session);
  const int64_t times[] = {INT64_MIN, 0, now - 12345678, now, now + 1, INT64_MAX};
  for (size_t i = 0; i < sizeof times / sizeof times[0]; ++i) {
    hap_pose pose;
    hap_status status = hap_session_poses(p->session, times[i], &p->cube, 1, &pose);
    FUZZ_CHECK(status >= HAP_OK);
    check_pose(status, &pose);
    status = hap_pointer_poses(p->session, id, times[i], &pose, NULL);
    check_pose(status, &pose);
    status = hap_pointer_poses(p->session, id, times[i], NULL, &pose);
    check_pose(status, &pose);
    FUZZ_CHECK(hap_session_poses_now(p->session, &p->cube, 1, &pose) >= HAP_OK);
    check_pose(HAP_OK, &pose);
  }
}

static void check_state(const place *p, hap_pointer_id id, const hap_pointer_def *def)
{
  hap_pointer_state state;
  FUZZ_CHECK(hap_pointer_get(p->session, id, &state, sizeof state) == HAP_OK);
  FUZZ_CHECK(hapi_finite(state.wrench.force, 3) && hapi_finite(state.wrench.torque, 3));
  FUZZ_CHECK(hapi_v3_norm(state.wrench.force) * def->force_scale <= def->max_force * (1 + 1e-9));
  FUZZ_CHECK(hapi_finite(dBodyGetPosition(p->cube), 3));
  FUZZ_CHECK(hapi_finite(dBodyGetLinearVel(p->cube), 3));
  FUZZ_CHECK(hapi_finite(dBodyGetAngularVel(p->cube), 3));
  check_drawing(p, id);
}

static void hand_move(source *s, const place *p, hap_pointer_id id)
{
  hap_pose pose = {{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
  hap_twist twist = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  uint8_t kind = take_byte(s);
  for (int i = 0; i < 3; ++i) {
    pose.position[i] = take_double(s);
    twist.linear[i] = (kind & 1) != 0 ? take_double(s) : 0.0;
    twist.angular[i] = (kind & 2) != 0 ? take_double(s) : 0.0;
  }
  if ((kind & 4) != 0) {
    pose.quat_wxyz[take_byte(s) % 4] = take_double(s);
  }
  hap_status status = hap_pointer_set_target(p->session, id, &pose, &twist);
  bool finite = hapi_finite(pose.position, 3) && hapi_finite(pose.quat_wxyz, 4) &&
                hapi_finite(twist.linear, 3) && hapi_finite(twist.angular, 3);
  FUZZ_CHECK(status == HAP_ERROR_ARGUMENT || (status == HAP_OK && finite));
  if ((kind & 8) != 0) {
    FUZZ_CHECK(hap_session_reset_fault(p->session) == HAP_OK);
  }
  if ((kind & 16) != 0) {
    FUZZ_CHECK(hap_session_set_model(p->session, (hap_model)(take_byte(s) % 4)) == HAP_OK);
  }
}

/* A cube as large as the sphere, with friction. */
static void take_hull(source *s, hap_pointer_def *def)
{
  static double corners[8][3];
  for (int i = 0; i < 24; ++i) {
    corners[i / 3][i % 3] = (i / 3 >> i % 3 & 1) != 0 ? 0.01 : -0.01;
  }
  def->hull_xyz = &corners[0][0];
  def->hull_points = 8;
  def->radius = 0.0;
  def->friction = 0.5;
  def->finger_radius = take_double(s);
}

static void session_run(source *s, const place *p)
{
  hap_pointer_def def;
  hap_pointer_id id;
  uint8_t kind = take_byte(s);
  hap_pointer_def_init(&def, sizeof def);
  if ((kind & 128) != 0) {
    take_hull(s, &def);
  }
  for (int edits = kind % EDITS_MAX; edits > 0; --edits) {
    edit_pointer(s, &def);
  }
  if (hap_pointer_add(p->session, &def, &id) < HAP_OK) {
    FUZZ_CHECK(id.v == 0);
    return;
  }
  hap_status status = hap_session_start(p->session);
  FUZZ_CHECK(status >= HAP_OK || fuzz_starved());
  for (int moves = 0; status >= HAP_OK && moves < MOVES_MAX && s->left > 0; ++moves) {
    hand_move(s, p, id);
    status = hap_session_advance(p->session, 1 + take_byte(s) % TICKS_MAX);
    FUZZ_CHECK(status >= HAP_OK);
    check_state(p, id, &def);
  }
}

void fuzz_one(const uint8_t *data, size_t size)
{
  source s = {data, size};
  place p = {.session = NULL};
  place_build(&p);
  if (session_create(&s, &p)) {
    session_run(&s, &p);
  }
  hap_session_destroy(p.session);
  dSpaceDestroy(p.space);
  dWorldDestroy(p.world);
}
