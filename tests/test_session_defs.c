/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* What a session is made of: defs and worlds, good and bad, and structs of other sizes. */

#include "tests/tap.h"

#include <stddef.h>

#include "tests/stage.h"

/* ---- defs ---- */

/* Creates with the defs of s as they are; must fail and say part. */
static bool stage_refused(stage *s, hap_status status, const char *part)
{
  s->session = (hap_session *)s; /* must be overwritten */
  s->detail.text[0] = '\0';
  hap_status answer = stage_create(s);
  bool good = answer == status && s->session == NULL && text_has(s->detail.text, part);
  if (answer != status) {
    printf("# %s for \"%s\"\n", hap_status_name(answer), part);
  }
  if (answer >= HAP_OK) {
    hap_session_destroy(s->session);
  }
  s->session = NULL;
  return good;
}

TEST(unset_defs_are_refused)
{
  static const unsigned char garbage[] = {0x00, 0xff, 0xa5, 0x01};
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  for (size_t i = 0; i < sizeof garbage; ++i) {
    hap_session_def good = s->def;
    memset(&s->def, garbage[i], sizeof s->def);
    CHECK(stage_refused(s, HAP_ERROR_UNINITIALISED, "hap_session_def_init"));
    s->def = good;
    hap_expert_def good_expert = s->expert;
    memset(&s->expert, garbage[i], sizeof s->expert);
    CHECK(stage_refused(s, HAP_ERROR_UNINITIALISED, "hap_expert_def_init"));
    s->expert = good_expert;
    hap_research_def good_research = s->research;
    memset(&s->research, garbage[i], sizeof s->research);
    CHECK(stage_refused(s, HAP_ERROR_UNINITIALISED, "hap_research_def_init"));
    s->research = good_research;
    hap_ode_def good_ode = s->ode;
    memset(&s->ode, garbage[i], sizeof s->ode);
    CHECK(stage_refused(s, HAP_ERROR_UNINITIALISED, "hap_ode_def_init"));
    s->ode = good_ode;
  }
  uint32_t cookie = s->def.cookie;
  s->def.cookie = s->ode.cookie; /* one def for another */
  CHECK(stage_refused(s, HAP_ERROR_UNINITIALISED, "hap_session_def_init"));
  s->def.cookie = cookie;
  s->def.size = 3;
  CHECK(stage_refused(s, HAP_ERROR_UNINITIALISED, "hap_session_def_init"));
  hap_session_def_init(NULL, sizeof s->def); /* do nothing */
  hap_session_def_init(&s->def, 3);
  hap_ode_def_init(NULL, sizeof s->ode);
}

TEST(missing_arguments_are_refused)
{
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  hap_session *out = (hap_session *)s;
  CHECK(hap_session_create(&s->def, NULL, &out, NULL) == HAP_ERROR_ARGUMENT && out == NULL);
  CHECK(hap_session_create(&s->def, &s->ode, NULL, &s->detail) == HAP_ERROR_ARGUMENT);
  CHECK(text_has(s->detail.text, "out"));
  s->ode.world = NULL;
  CHECK(stage_refused(s, HAP_ERROR_ARGUMENT, "world"));
  s->ode.world = s->world;
  s->ode.space = NULL;
  CHECK(stage_refused(s, HAP_ERROR_ARGUMENT, "space"));
  s->ode.space = s->space;
  s->ode.max_contacts_per_pair = 0;
  CHECK(stage_refused(s, HAP_ERROR_ARGUMENT, "max_contacts_per_pair"));
  s->ode.max_contacts_per_pair = 65;
  CHECK(stage_refused(s, HAP_ERROR_ARGUMENT, "max_contacts_per_pair"));
  s->ode.max_contacts_per_pair = 8;
  s->ode.island_threads = -1;
  CHECK(stage_refused(s, HAP_ERROR_ARGUMENT, "island_threads"));
  s->ode.island_threads = 65;
  CHECK(stage_refused(s, HAP_ERROR_ARGUMENT, "island_threads"));
}

/* Fields by their place in a stage. */
#define REAL_FIELD(part, name, value)              \
  {                                                \
#name, offsetof(stage, part.name), true, value \
  }
#define WHOLE_FIELD(part, name, value)              \
  {                                                 \
#name, offsetof(stage, part.name), false, value \
  }

static const struct {
  const char *name;
  size_t offset;
  bool real;
  double value;
} bad_fields[] = {
    REAL_FIELD(def, physics_hz, 0.0),
    REAL_FIELD(def, physics_hz, -1.0),
    REAL_FIELD(def, physics_hz, 0.99),
    REAL_FIELD(def, physics_hz, 1001.0),
    REAL_FIELD(def, physics_hz, (double)NAN),
    REAL_FIELD(def, physics_hz, (double)INFINITY),
    REAL_FIELD(def, haptic_hz, 99.0),
    REAL_FIELD(def, haptic_hz, 20001.0),
    REAL_FIELD(def, haptic_hz, (double)NAN),
    REAL_FIELD(def, haptic_hz, 0.0),
    REAL_FIELD(def, haptic_hz, -1000.0),
    REAL_FIELD(def, haptic_hz, (double)INFINITY),
    REAL_FIELD(expert, contact_hz, 19.0),
    REAL_FIELD(expert, contact_hz, 1001.0),
    REAL_FIELD(expert, contact_hz, (double)NAN),
    REAL_FIELD(expert, contact_hz, -1.0),
    REAL_FIELD(def, accuracy, -0.01),
    REAL_FIELD(def, accuracy, 1.01),
    REAL_FIELD(def, accuracy, (double)NAN),
    REAL_FIELD(expert, force_error_wanted, -0.1),
    REAL_FIELD(expert, force_error_wanted, 0.0009),
    REAL_FIELD(expert, force_error_wanted, 1.1),
    REAL_FIELD(expert, force_error_wanted, (double)NAN),
    REAL_FIELD(expert, tick_share, 0.009),
    REAL_FIELD(expert, tick_share, 1.1),
    REAL_FIELD(expert, tick_share, (double)NAN),
    REAL_FIELD(expert, physics_share, -1.0),
    REAL_FIELD(expert, physics_share, (double)INFINITY),
    WHOLE_FIELD(expert, iterations, -1),
    WHOLE_FIELD(expert, iterations, 10001),
    WHOLE_FIELD(def, max_bodies, 0),
    WHOLE_FIELD(def, max_bodies, -1),
    WHOLE_FIELD(def, max_bodies, 1025),
    WHOLE_FIELD(def, max_contacts, 0),
    WHOLE_FIELD(def, max_contacts, 8193),
    WHOLE_FIELD(def, max_contacts, -2147483648.0),
    WHOLE_FIELD(def, max_pointers, 0),
    WHOLE_FIELD(def, max_pointers, 17),
    WHOLE_FIELD(def, rt_priority, -1),
    WHOLE_FIELD(def, rt_priority, 99),
    WHOLE_FIELD(expert, trace_rows, -1),
    WHOLE_FIELD(expert, trace_rows, 1048577),
    WHOLE_FIELD(def, drive, 3),
    WHOLE_FIELD(def, drive, -1),
    WHOLE_FIELD(def, model, 4),
    WHOLE_FIELD(def, model, -1),
    WHOLE_FIELD(research, impulse_pose, 2),
    WHOLE_FIELD(research, probe, 4),
    WHOLE_FIELD(research, probe, -1),
    WHOLE_FIELD(expert, max_sweeps, -1),
    WHOLE_FIELD(expert, max_sweeps, 1),
    WHOLE_FIELD(expert, max_sweeps, 10001),
    WHOLE_FIELD(expert, range_hops, -3),
    WHOLE_FIELD(expert, range_hops, 1025),
    REAL_FIELD(expert, reuse, -1e-9),
    REAL_FIELD(expert, reuse, 0.0101),
    REAL_FIELD(expert, reuse, (double)NAN),
    WHOLE_FIELD(research, guard, 2),
    WHOLE_FIELD(research, guard, -1),
    WHOLE_FIELD(expert, substeps, 0),
    WHOLE_FIELD(expert, substeps, 65),
    REAL_FIELD(expert, look_ahead, -1e-9),
    REAL_FIELD(expert, look_ahead, 1.01),
    REAL_FIELD(expert, look_ahead, (double)NAN),
    WHOLE_FIELD(expert, effects_on, 1 << HAP_EFFECTS),
    WHOLE_FIELD(expert, effects_off, -2147483648.0),
    REAL_FIELD(def, budget, 0.009),
    REAL_FIELD(def, budget, 1.1),
    REAL_FIELD(def, budget, -0.1),
    REAL_FIELD(def, budget, (double)NAN),
    WHOLE_FIELD(research, physics_latency_ticks, -2),
    WHOLE_FIELD(research, physics_latency_ticks, 20001),
};

TEST(every_bad_field_is_named)
{
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  for (size_t i = 0; i < sizeof bad_fields / sizeof bad_fields[0]; ++i) {
    char good[sizeof(double)];
    char *at = (char *)s + bad_fields[i].offset;
    memcpy(good, at, sizeof good);
    int32_t whole = bad_fields[i].real ? 0 : (int32_t)bad_fields[i].value;
    if (bad_fields[i].real) {
      memcpy(at, &bad_fields[i].value, sizeof(double));
    } else {
      memcpy(at, &whole, sizeof whole);
    }
    CHECK(stage_refused(s, HAP_ERROR_ARGUMENT, bad_fields[i].name));
    memcpy(at, good, bad_fields[i].real ? sizeof(double) : sizeof whole);
  }
  s->def.physics_hz = 500.0;
  s->def.haptic_hz = 499.0; /* H / T below 1 */
  CHECK(stage_refused(s, HAP_ERROR_ARGUMENT, "at least one tick"));
  s->def.haptic_hz = 500.0;
  CHECK(stage_create(s) == HAP_OK); /* H = T */
}

TEST(no_def_is_one_of_defaults)
{
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  hap_accuracy_info info;
  REQUIRE(hap_session_create(NULL, &s->ode, &s->session, &s->detail) == HAP_OK);
  CHECK(hap_session_advance(s->session, 1) == HAP_ERROR_STATE);
  CHECK(text_has(detail_of(s), "LOCKSTEP")); /* it is not: the default is THREADS */
  CHECK(hap_session_start(s->session) >= HAP_OK);
  CHECK(hap_session_accuracy(s->session, &info, sizeof info) == HAP_OK);
  CHECK(info.accuracy == HAP_ACCURACY_DEFAULT && info.tick.share == 0.0);
}

TEST(an_effect_is_on_or_off_and_not_both)
{
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  s->expert.effects_on = s->expert.effects_off = HAP_EFFECT_BIT(HAP_EFFECT_GYRO);
  CHECK(stage_refused(s, HAP_ERROR_ARGUMENT, "gyro"));
  s->expert.effects_on = 0;
  CHECK(stage_create(s) == HAP_OK);
}

TEST(a_budget_is_for_real_time)
{
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  s->def.budget = 0.5;
  CHECK(stage_refused(s, HAP_ERROR_UNSUPPORTED, "LOCKSTEP"));
  s->def.drive = HAP_DRIVE_THREADS;
  s->expert.physics_share = 0.25; /* and the tick has the budget */
  REQUIRE(stage_create(s) == HAP_OK && hap_session_start(s->session) >= HAP_OK);
  hap_accuracy_info info;
  CHECK(hap_session_accuracy(s->session, &info, sizeof info) == HAP_OK);
  CHECK(info.tick.share == 0.5 && info.physics.share == 0.25);
}

TEST(models_are_checked)
{
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  CHECK(s->def.model == HAP_MODEL_CONTACT); /* the default */
  REQUIRE(stage_create(s) == HAP_OK);
  CHECK(hap_session_set_model(s->session, HAP_MODEL_SINGLE) == HAP_OK);
  CHECK(hap_session_set_model(s->session, (hap_model)4) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_set_model(s->session, (hap_model)-1) == HAP_ERROR_ARGUMENT);
}

/* A program built against an older header has a smaller def, one built against a newer header a
 * larger one. */
TEST(smaller_and_larger_defs_are_accepted)
{
  union {
    hap_session_def def;
    unsigned char bytes[sizeof(hap_session_def) + 64];
  } block;
  static const size_t sizes[] = {8, offsetof(hap_session_def, haptic_hz),
                                 offsetof(hap_session_def, expert), sizeof(hap_session_def),
                                 sizeof(hap_session_def) + 64};
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; ++i) {
    memset(&block, 0xee, sizeof block);
    hap_session_def_init(&block.def, sizes[i]);
    for (size_t k = sizes[i]; k < sizeof block; ++k) {
      CHECK(block.bytes[k] == 0xee); /* init keeps to what it was told */
    }
    CHECK(block.def.size == sizes[i]);
    if (sizes[i] > offsetof(hap_session_def, physics_hz)) {
      block.def.drive = HAP_DRIVE_LOCKSTEP;
    }
    CHECK(hap_session_create(&block.def, &s->ode, &s->session, &s->detail) == HAP_OK);
    hap_session_destroy(s->session);
    s->session = NULL;
  }
}

/* What a newer program sets and this library does not know must not be passed over. */
TEST(unknown_bytes_of_a_larger_def_are_refused)
{
  union {
    hap_session_def def;
    hap_expert_def expert;
    hap_research_def research;
    hap_ode_def ode;
    unsigned char bytes[1024];
  } block;
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  hap_session *session = NULL;
  hap_session_def_init(&block.def, sizeof block);
  block.bytes[sizeof(hap_session_def) + 11] = 1;
  CHECK(hap_session_create(&block.def, &s->ode, &session, &s->detail) == HAP_ERROR_ARGUMENT);
  CHECK(session == NULL && text_has(s->detail.text, "hap_session_def: byte"));
  hap_expert_def_init(&block.expert, sizeof block);
  s->def.expert = &block.expert;
  CHECK(stage_create(s) == HAP_OK); /* all of them 0 */
  hap_session_destroy(s->session);
  block.bytes[sizeof block - 1] = 0x80;
  CHECK(stage_refused(s, HAP_ERROR_ARGUMENT, "hap_expert_def: byte 1023"));
  s->def.expert = NULL;
  hap_research_def_init(&block.research, sizeof block);
  s->def.research = &block.research;
  block.bytes[sizeof(hap_research_def)] = 1;
  CHECK(stage_refused(s, HAP_ERROR_ARGUMENT, "hap_research_def: byte"));
  s->def.research = NULL;
  hap_ode_def_init(&block.ode, sizeof block);
  block.ode.world = s->world;
  block.ode.space = s->space;
  block.bytes[sizeof(hap_ode_def)] = 1;
  CHECK(hap_session_create(&s->def, &block.ode, &session, &s->detail) == HAP_ERROR_ARGUMENT);
  CHECK(text_has(s->detail.text, "hap_ode_def: byte"));
  CHECK(stage_create(s) == HAP_OK); /* both NULL */
}

/* Bytes up to the end of ticks. */
#define TICKS_END (offsetof(hap_stats, loop.ticks) + sizeof(uint64_t))

TEST(statistics_of_a_smaller_struct)
{
  stage *s = stage_running(HAP_DRIVE_LOCKSTEP);
  CHECK(hap_session_advance(s->session, 5) == HAP_OK);
  union {
    hap_stats stats;
    unsigned char bytes[sizeof(hap_stats) + 32];
  } block;
  static const size_t sizes[] = {4, TICKS_END, sizeof(hap_stats) - 8, sizeof(hap_stats),
                                 sizeof(hap_stats) + 32};
  for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; ++i) {
    memset(&block, 0xee, sizeof block);
    CHECK(hap_session_stats(s->session, &block.stats, sizes[i]) == HAP_OK);
    size_t filled = sizes[i] < sizeof(hap_stats) ? sizes[i] : sizeof(hap_stats);
    CHECK(block.stats.size == filled);
    CHECK(filled < TICKS_END || block.stats.loop.ticks == 5);
    for (size_t k = filled; k < sizeof block; ++k) {
      CHECK(block.bytes[k] == 0xee);
    }
  }
  CHECK(hap_session_stats(s->session, &block.stats, 3) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_stats(s->session, NULL, 8) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_stats(NULL, &block.stats, 8) == HAP_ERROR_ARGUMENT);
}

/* ---- worlds that cannot be stepped ---- */

static void body_spoil(dBodyID body, int way)
{
  const double nan = (double)NAN;
  dMass mass;
  dBodyGetMass(body, &mass);
  switch (way) {
    case 0:
      dBodySetPosition(body, nan, 0.0, 0.0);
      break;
    case 1:
      dBodySetLinearVel(body, 0.0, (double)INFINITY, 0.0);
      break;
    case 2:
      dBodySetAngularVel(body, 0.0, 0.0, nan);
      break;
    case 3:
      dBodyAddForce(body, nan, 0.0, 0.0);
      break;
    case 4:
      dBodyAddTorque(body, nan, 0.0, 0.0);
      break;
    case 5:
      ((dReal *)(uintptr_t)dBodyGetQuaternion(body))[2] = nan; /* the setter would abort */
      break;
    default: /* ODE itself aborts on zero, and takes an infinite mass for a kinematic body */
      mass.mass = nan;
      dBodySetMass(body, &mass);
  }
}

TEST(a_body_that_cannot_be_simulated_is_refused_at_create_and_start)
{
  for (int way = 0; way < 7; ++way) {
    stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
    REQUIRE(stage_create(s) == HAP_OK);
    body_spoil(add_cube(s, 5.0, NULL), way);
    CHECK(hap_session_start(s->session) == HAP_ERROR_WORLD);
    CHECK(text_has(detail_of(s), "a body at ("));
    CHECK(hap_session_advance(s->session, 1) == HAP_ERROR_STATE); /* has not started */
    hap_session_destroy(s->session);
    CHECK(stage_refused(s, HAP_ERROR_WORLD, way < 6 ? "not finite" : "has no mass"));
    stage_end(s);
  }
}

TEST(a_body_that_goes_bad_is_kept_from_ode)
{
  for (int way = 0; way < 7; ++way) {
    stage *s = stage_running(HAP_DRIVE_LOCKSTEP);
    CHECK(hap_session_advance(s->session, 100) == HAP_OK);
    dMass mass;
    dBodyGetMass(s->cube, &mass);
    REQUIRE(hap_session_lock(s->session) == HAP_OK);
    body_spoil(s->cube, way);
    CHECK(hap_session_unlock(s->session) == HAP_OK);
    uint64_t steps = stats_of(s).physics.steps;
    CHECK(hap_session_advance(s->session, 100) == HAP_FAULTED);
    CHECK(stats_of(s).faults.fault == HAP_FAULT_WORLD && stats_of(s).faults.count == 1);
    CHECK(stats_of(s).physics.steps == steps && stats_of(s).loop.ticks == 200);
    CHECK(text_has(detail_of(s), "body at"));
    dBodySetMass(s->cube, &mass);
    dBodySetPosition(s->cube, 0.0, 0.0, 0.0);
    ((dReal *)(uintptr_t)dBodyGetQuaternion(s->cube))[2] = 0.0;
    dBodySetLinearVel(s->cube, 0.0, 0.0, 0.0);
    dBodySetAngularVel(s->cube, 0.0, 0.0, 0.0);
    dBodySetForce(s->cube, 0.0, 0.0, 0.0);
    dBodySetTorque(s->cube, 0.0, 0.0, 0.0);
    CHECK(hap_session_advance(s->session, 100) == HAP_FAULTED);
    CHECK(stats_of(s).physics.steps > steps);
    CHECK(stats_of(s).faults.fault == HAP_FAULT_WORLD); /* latched */
    CHECK(hap_session_reset_fault(s->session) == HAP_OK);
    CHECK(hap_session_advance(s->session, 100) == HAP_OK);
    CHECK(stats_of(s).faults.fault == HAP_FAULT_NONE);
  }
}
