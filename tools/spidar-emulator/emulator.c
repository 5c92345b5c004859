/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/spidar-emulator/emulator.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/log.h"
#include "base/vec.h"

#define CURRENT_VOLTS (3.3 / 4096.0) /* of a count of current */

/* A relaxed hand, as that of the device virtual. */
#define HAND_MASS 0.2
#define HAND_STIFFNESS 150.0
#define HAND_DAMPING 3.0
#define WRIST_INERTIA 1e-3
#define WRIST_STIFFNESS 1.0
#define WRIST_DAMPING 0.02

static const char default_path[] = "0:0/0/0;1:0/0/0;3:0.055/0/0;3.5:0.055/0/0;5.5:0/0/0";

static void set_hand(emulator *e, emulator_hand hand)
{
  grip_def alone;
  grip_def_init(&alone, e->model);
  bool held = hand != EMULATOR_HAND_NONE;
  e->hand = hand;
  e->grip.def.mass = alone.mass + (held ? HAND_MASS : 0.0);
  e->grip.def.inertia = alone.inertia + (held ? WRIST_INERTIA : 0.0);
}

static void power_on(emulator *e)
{
  memcpy(e->home, e->grip.wound, sizeof e->home);
  memset(e->pull, 0, sizeof e->pull);
  for (int i = 0; i < e->wire.count; ++i) {
    board *b = &e->wire.boards[i];
    board_init(b, b->id, b->model, e->first_count);
    e->next_tick[i] = emulator_time(e);
  }
}

static hap_status check_boards(const emulator_def *def, hap_detail *detail)
{
  int motors = 0;
  for (int i = 0; i < def->board_count; ++i) {
    const hapi_spidar_kind *kind = hapi_spidar_kind_find(def->board_model[i]);
    if (kind == NULL) {
      return hapi_fail(detail, HAP_ERROR_ARGUMENT, "there is no board of model %d",
                       def->board_model[i]);
    }
    motors += kind->motors;
  }
  if (motors != def->model->strings) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "the boards have %d motors, model %s has %d strings", motors, def->model->name,
                     def->model->strings);
  }
  return HAP_OK;
}

static hap_status set_motions(emulator *e, const emulator_def *def, hap_detail *detail)
{
  const char *path = def->path != NULL ? def->path : default_path;
  const hapi_motion_text text = {"path", "T:x/y/z;... in s and m", path, strlen(path), false};
  e->path.loop = e->turn.loop = true;
  hap_status status = hapi_motion_set_path(&e->path, &text, detail);
  if (status >= HAP_OK && def->turn != NULL) {
    const hapi_motion_text turn = {"turn", "T:x/y/z;... in s and rad", def->turn, strlen(def->turn),
                                   false};
    status = hapi_motion_set_path(&e->turn, &turn, detail);
  }
  return status;
}

hap_status emulator_init(emulator *e, const emulator_def *def, hap_detail *detail)
{
  memset(e, 0, sizeof *e);
  hap_status status = check_boards(def, detail);
  if (status < HAP_OK) {
    return status;
  }
  status = set_motions(e, def, detail);
  if (status < HAP_OK) {
    emulator_finish(e);
    return status;
  }
  grip_def mechanics;
  grip_def_init(&mechanics, def->model);
  grip_init(&e->grip, &mechanics);
  wire_init(&e->wire);
  e->model = def->model;
  e->first_count = def->first_count;
  e->plugged = true;
  e->plug_time = -1.0;
  e->dice = 99;
  e->wire.count = def->board_count;
  for (int i = 0; i < def->board_count; ++i) {
    e->wire.boards[i].id = def->board_id[i];
    e->wire.boards[i].model = def->board_model[i];
  }
  set_hand(e, def->hand);
  power_on(e);
  return HAP_OK;
}

void emulator_finish(emulator *e)
{
  hapi_motion_finish(&e->path);
  hapi_motion_finish(&e->turn);
}

/* ---- motors and encoders ---- */

static void counts_encode(const emulator *e, int first, int motors,
                          int32_t counts[HAPI_SPIDAR_MOTORS])
{
  for (int i = 0; i < motors; ++i) {
    double way = e->grip.wound[first + i] - e->home[first + i];
    counts[i] = e->first_count + (int32_t)lround(way / e->model->metres_per_count[first + i]);
  }
}

static void tick_boards(emulator *e, double time)
{
  int first = 0;
  for (int i = 0; i < e->wire.count; ++i) {
    board *b = &e->wire.boards[i];
    int motors = hapi_spidar_kind_find(b->model)->motors;
    board_run(b, time);
    if (time >= e->next_tick[i]) {
      int32_t counts[HAPI_SPIDAR_MOTORS] = {0};
      e->next_tick[i] += 1.0 / board_tick_hz(b);
      counts_encode(e, first, motors, counts);
      board_tick(b, counts);
      for (int k = 0; k < motors; ++k) {
        double volts = CURRENT_VOLTS * b->output[k];
        e->pull[first + k] = volts / e->model->volts_per_newton[first + k];
      }
    }
    first += motors;
  }
}

/* ---- the hand ---- */

/* Whoever starts the device finds the grip at home. */
static void follow_motors(emulator *e)
{
  bool pulls = false;
  for (int i = 0; i < e->model->strings; ++i) {
    pulls = pulls || e->pull[i] != 0.0;
  }
  if (!pulls) {
    e->drawn = emulator_time(e);
  }
}

/* How the grip is turned from the attitude of that rotation vector, world axes. */
static void quat_unturn(const double quat[4], const double turn[3], double out[4])
{
  double angle = hapi_v3_norm(turn);
  double share = angle > 0.0 ? -sin(0.5 * angle) / angle : 0.0;
  const double back[4] = {cos(0.5 * angle), share * turn[0], share * turn[1], share * turn[2]};
  hapi_quat_multiply(quat, back, out);
}

static void hand_hold(const emulator *e, hap_wrench *out)
{
  double place[3] = {0.0, 0.0, 0.0};
  double speed[3] = {0.0, 0.0, 0.0};
  double turn[3] = {0.0, 0.0, 0.0};
  double rate[3] = {0.0, 0.0, 0.0};
  double off[4];
  const grip *g = &e->grip;
  if (e->hand == EMULATOR_HAND_PUSH) {
    hapi_motion_at(&e->path, emulator_time(e) - e->drawn, place, speed);
    hapi_motion_at(&e->turn, emulator_time(e) - e->drawn, turn, rate);
  }
  quat_unturn(g->pose.quat_wxyz, turn, off);
  double side = off[0] < 0.0 ? -2.0 : 2.0;
  for (int k = 0; k < 3; ++k) {
    out->force[k] += HAND_STIFFNESS * (place[k] - g->pose.position[k]) +
                     HAND_DAMPING * (speed[k] - g->twist.linear[k]);
    out->torque[k] =
        -WRIST_STIFFNESS * side * off[1 + k] - WRIST_DAMPING * (g->twist.angular[k] - rate[k]);
  }
}

static void emulator_step(emulator *e)
{
  hap_wrench other = {{e->push[0], e->push[1], e->push[2]}, {0.0, 0.0, 0.0}};
  if (e->hand != EMULATOR_HAND_NONE) {
    hand_hold(e, &other);
  }
  tick_boards(e, emulator_time(e));
  follow_motors(e);
  grip_step(&e->grip, e->pull, &other, 1.0 / EMULATOR_STEP_HZ);
  e->pulled = fmax(e->pulled, hapi_v3_norm(e->grip.wrench.force));
  ++e->steps;
}

/* ---- time ---- */

static void follow_plan(emulator *e)
{
  double time = emulator_time(e);
  while (e->event_next < e->event_count && e->events[e->event_next].time <= time) {
    emulator_do(e, &e->events[e->event_next++].action);
  }
  if (!e->plugged && e->plug_time >= 0.0 && e->plug_time <= time) {
    e->plugged = true;
  }
}

void emulator_advance(emulator *e, double time)
{
  while (emulator_time(e) + 1.0 / EMULATOR_STEP_HZ <= time) {
    follow_plan(e);
    emulator_step(e);
  }
  follow_plan(e);
}

void emulator_write(emulator *e, const uint8_t *bytes, int count, double time)
{
  for (int i = 0; i < count && e->plugged; ++i) {
    wire_from_host(&e->wire, bytes[i], time);
  }
}

int emulator_read(emulator *e, double time, uint8_t *out, int size)
{
  int count = wire_to_host(&e->wire, time, out, size);
  return e->plugged ? count : 0;
}

/* ---- what happens to it ---- */

bool emulator_plan(emulator *e, double time, const emulator_action *action)
{
  bool later = e->event_count > 0 && e->events[e->event_count - 1].time > time;
  if (later || e->event_count == EMULATOR_EVENTS_MAX) {
    return false;
  }
  e->events[e->event_count++] = (emulator_event){time, *action};
  return true;
}

static void throw_garbage(emulator *e, int count)
{
  for (int i = 0; i < count; ++i) {
    e->dice = e->dice * 1664525u + 1013904223u;
    wire_noise(&e->wire, (uint8_t)(e->dice >> 24), emulator_time(e) + i * BOARD_BYTE_S);
  }
}

static void board_silence(emulator *e, int id, bool silent)
{
  for (int i = 0; i < e->wire.count; ++i) {
    if (id < 0 || e->wire.boards[i].id == id) {
      e->wire.silent[i] = silent;
    }
  }
}

static void board_report(emulator *e, int id, int model)
{
  for (int i = 0; i < e->wire.count; ++i) {
    if (e->wire.boards[i].id == id) {
      e->wire.boards[i].reported = model;
    }
  }
}

static void tension_saturate(emulator *e, int limit)
{
  for (int i = 0; i < e->wire.count; ++i) {
    e->wire.boards[i].current_limit = limit;
  }
}

/* string < 0: all of them. */
static void encoder_spoil(emulator *e, int string, const int16_t *false_by, const bool *stuck)
{
  int first = 0;
  for (int i = 0; i < e->wire.count; ++i) {
    board *b = &e->wire.boards[i];
    int motors = hapi_spidar_kind_find(b->model)->motors;
    for (int k = 0; k < motors; ++k) {
      if (string < 0 || string == first + k) {
        if (false_by != NULL) {
          b->lies.false_by[k] = *false_by;
        }
        b->lies.stuck[k] = stuck != NULL ? *stuck : b->lies.stuck[k];
      }
    }
    first += motors;
  }
}

void emulator_do(emulator *e, const emulator_action *action)
{
  const double *n = action->number;
  switch (action->kind) {
    case EMULATOR_FAULT:
      (void)wire_add_fault(&e->wire, &action->fault);
      break;
    case EMULATOR_SILENT:
      board_silence(e, (int)n[0], n[1] != 0.0);
      break;
    case EMULATOR_LATE:
      e->wire.late = n[0];
      break;
    case EMULATOR_GARBAGE:
      throw_garbage(e, (int)n[0]);
      break;
    case EMULATOR_UNPLUG:
      e->plugged = false;
      e->plug_time = n[0] >= 0.0 ? emulator_time(e) + n[0] : -1.0;
      break;
    case EMULATOR_PLUG:
      e->plugged = true;
      break;
    case EMULATOR_POWER:
      power_on(e);
      break;
    case EMULATOR_REPORT:
      board_report(e, (int)n[0], (int)n[1]);
      break;
    case EMULATOR_SATURATE:
      tension_saturate(e, (int)n[0]);
      break;
    case EMULATOR_FALSE:
      encoder_spoil(e, (int)n[0], &(int16_t){(int16_t)n[1]}, NULL);
      break;
    case EMULATOR_STUCK:
      encoder_spoil(e, (int)n[0], NULL, &(bool){n[1] != 0.0});
      break;
    case EMULATOR_PUSH:
      hapi_v3_copy(n, e->push);
      break;
    case EMULATOR_HAND:
      set_hand(e, (emulator_hand)(int)n[0]);
      break;
    case EMULATOR_STATE:
    case EMULATOR_QUIT:
      break;
  }
}

/* ---- what it is like ---- */

static size_t say_list(char *out, size_t size, const char *name, const double *values, int count)
{
  size_t used = (size_t)snprintf(out, size, " %s=", name);
  for (int i = 0; i < count && used < size; ++i) {
    used += (size_t)snprintf(out + used, size - used, "%s%.6g", i > 0 ? "/" : "", values[i]);
  }
  return used < size ? used : size;
}

void emulator_say(const emulator *e, char *out, size_t size)
{
  unsigned executed = 0;
  double current[HAPI_SPIDAR_STRINGS_MAX] = {0.0};
  int motor = 0;
  for (int i = 0; i < e->wire.count; ++i) {
    const board *b = &e->wire.boards[i];
    executed += b->executed;
    for (int k = 0; k < hapi_spidar_kind_find(b->model)->motors; ++k) {
      current[motor++] = b->output[k];
    }
  }
  size_t used =
      (size_t)snprintf(out, size, "state t=%.4f plugged=%d commands=%u collisions=%u",
                       emulator_time(e), e->plugged ? 1 : 0, executed, e->wire.collisions);
  used += say_list(out + used, size - used, "position", e->grip.pose.position, 3);
  used += say_list(out + used, size - used, "quat", e->grip.pose.quat_wxyz, 4);
  used += say_list(out + used, size - used, "force", e->grip.wrench.force, 3);
  used += say_list(out + used, size - used, "torque", e->grip.wrench.torque, 3);
  used += say_list(out + used, size - used, "pulled", &e->pulled, 1);
  used += say_list(out + used, size - used, "tension", e->grip.tension, e->model->strings);
  (void)say_list(out + used, size - used, "current", current, e->model->strings);
}
