/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A device of numbers: a mechanism, held by a hand with a scripted motion. */

#include <hapode/device_impl.h>

#include <string.h>

#include "base/alloc.h"
#include "base/log.h"
#include "base/number.h"
#include "base/vec.h"
#include "plugins/common/arguments.h"
#include "plugins/common/output.h"
#include "plugins/common/timeline.h"
#include "plugins/virtual/delay.h"
#include "plugins/virtual/friction.h"
#include "plugins/virtual/gripper.h"
#include "plugins/virtual/motion.h"
#include "plugins/virtual/virtual.h"

#define SUBSTEP_NS 1000000u /* the target is taken as straight within */
#define SUBSTEPS_MAX 1000u  /* a read stays bounded however long the pause was */

#define NEVER UINT64_MAX

/* A jump of the velocity: the hand's blow. */
typedef struct kick {
  uint64_t at_ns; /* of the timeline; NEVER: none */
  bool done;
  double velocity[3];
} kick;

/* What the encoders say: rounded to the quantum, the velocity a difference of that. */
typedef struct measured {
  double position[3];
  double velocity[3];
} measured;

typedef struct virtual_device {
  hap_device_info info;
  hapi_motion motion;
  double start; /* s of the script at the first read */
  double orientation[4];
  double told_orientation[4]; /* dof=3: at every read */
  bool yields;                /* else rigid: exactly on the script */
  bool held;                  /* else nobody has the device in his hand */
  hapi_hand hand;             /* with the mechanism; rigid: its place alone */
  kick kick;
  hapi_delay delay;
  hapi_motion turning; /* dof=6: rotation vector, rad, from the orientation on */
  hapi_hand wrist; /* the same model: its positions are a rotation vector, its mass an inertia */
  hapi_delay torque_delay;
  hapi_gripper gripper;
  double work; /* J, see virtual.h */
  measured measured;
  hapi_output output;
  hapi_timeline timeline;
} virtual_device;

enum argument {
  PATH,
  BLEND,
  LOOP,
  SINE,
  HZ,
  START,
  ORIENTATION,
  HAND,
  MASS,
  DAMPING,
  STIFFNESS,
  MAX_FORCE,
  MAX_TORQUE,
  RATED_STIFFNESS,
  DEVICE_DAMPING,
  DEVICE_MASS,
  FRICTION,
  DELAY,
  QUANTUM,
  KICK,
  DOF,
  TURN,
  TURN_SINE,
  TURN_HZ,
  INERTIA,
  TURN_DAMPING,
  TURN_STIFFNESS,
  DEVICE_INERTIA,
  DEVICE_TURN_DAMPING,
  GRIPPER,
  GRIPPER_SINE,
  GRIPPER_HZ,
  GRIPPER_MOST,
  GRIPPER_FORCE,
  GRIPPER_STIFFNESS,
  GRIPPER_DAMPING,
  LEDS,
  VIBRATORS,
  ARGUMENT_COUNT
};

/* Order of the words of hand=. */
enum hand_word {
  RIGID,
  RELAXED,
  TENSE,
  NOBODY
};

/* Round numbers, chosen and not fitted: a hand on a handle, held loosely and co-contracted. For the
 * order: one trial of a person holding a haptic device gave 0.55 kg, 6.5 N s/m, 135 N/m (figure 3
 * of "Haptic perception of force magnitude and its relation to postural arm dynamics in 3D",
 * Scientific Reports 5, 18004, 2015). */
static const hapi_hand_def presets[] = {
    [RIGID] = {1.0, 0.0, 0.0, 0.0}, /* not used */
    [RELAXED] = {0.2, 3.0, 150.0, 0.0},
    [TENSE] = {0.3, 10.0, 800.0, 0.0},
    [NOBODY] = {0.0, 0.0, 0.0, 0.0},
};

/* Fingers on a gripper, with the mechanism of 50 g: round numbers again. */
static const hapi_hand_def fingers[] = {
    [RIGID] = {1.0, 0.0, 0.0, 0.0}, /* not used */
    [RELAXED] = {0.06, 1.0, 100.0, 0.5},
    [TENSE] = {0.06, 4.0, 500.0, 0.5},
    [NOBODY] = {0.05, 0.0, 0.0, 0.5},
};

/* The same of turning the handle, with a wrist: round numbers again. */
static const hapi_hand_def wrists[] = {
    [RIGID] = {1.0, 0.0, 0.0, 0.0}, /* not used */
    [RELAXED] = {1e-3, 0.02, 1.0, 0.0},
    [TENSE] = {1.5e-3, 0.06, 5.0, 0.0},
    [NOBODY] = {0.0, 0.0, 0.0, 0.0},
};

#define TURN_MOST 3.0      /* rad: a rotation vector has no use at 2 pi */
#define INERTIA_LEAST 1e-7 /* kg m^2 */
#define GRIP 0.05          /* m, arm that gives a mechanism's inertia where the spec does not */

static const char *const blend_words[] = {"smooth", "linear", NULL};
static const char *const switch_words[] = {"0", "1", NULL};
static const char *const hand_words[] = {"rigid", "relaxed", "tense", "none", NULL};
static const char *const dof_words[] = {"3", "6", NULL};

static const hapi_argument known_arguments[ARGUMENT_COUNT] = {
    [PATH] = {"path", HAPI_ARGUMENT_TEXT, .expected = "T:x/y/z;T:x/y/z in s and m"},
    [BLEND] = {"blend", HAPI_ARGUMENT_WORD, .expected = "smooth or linear", .words = blend_words},
    [LOOP] = {"loop", HAPI_ARGUMENT_WORD, .expected = "0 or 1", .words = switch_words},
    [SINE] = {"sine", HAPI_ARGUMENT_VECTOR, false, -1e3, 1e3, "ax/ay/az in m, each within 1000"},
    [HZ] = {"hz", HAPI_ARGUMENT_NUMBER, false, 0.0, 1e4, "a number from 0 to 10000",
            .number = {1.0}},
    [START] = {"start", HAPI_ARGUMENT_NUMBER, false, -1e6, 1e6, "seconds within 1e6"},
    [ORIENTATION] = {"orientation", HAPI_ARGUMENT_QUATERNION, .expected = "w/x/y/z, not all zero",
                     .number = {1.0}},
    [HAND] = {"hand", HAPI_ARGUMENT_WORD, .expected = "rigid, relaxed, tense or none",
              .words = hand_words},
    [MASS] = {"mass", HAPI_ARGUMENT_NUMBER, false, 1e-3, 1e3, "kg from 0.001 to 1000"},
    [DAMPING] = {"damping", HAPI_ARGUMENT_NUMBER, false, 0.0, 1e5, "N s/m from 0 to 1e5"},
    [STIFFNESS] = {"stiffness", HAPI_ARGUMENT_NUMBER, false, 0.0, 1e7, "N/m from 0 to 1e7"},
    [MAX_FORCE] = {"max_force", HAPI_ARGUMENT_NUMBER, false, 1e-3, 1e6, "N from 0.001 to 1e6",
                   .number = {20.0}},
    [MAX_TORQUE] = {"max_torque", HAPI_ARGUMENT_NUMBER, false, 1e-6, 1e6, "N m from 1e-6 to 1e6",
                    .number = {1.0}},
    [RATED_STIFFNESS] = {"rated_stiffness", HAPI_ARGUMENT_NUMBER, false, 0.0, 1e9,
                         "N/m from 0 to 1e9"},
    [DEVICE_DAMPING] = {"device_damping", HAPI_ARGUMENT_NUMBER, false, 0.0, 1e6,
                        "N s/m from 0 to 1e6"},
    [DEVICE_MASS] = {"device_mass", HAPI_ARGUMENT_NUMBER, false, 0.0, 1e3, "kg from 0 to 1000"},
    [FRICTION] = {"friction", HAPI_ARGUMENT_NUMBER, false, 0.0, 1e3, "N from 0 to 1000"},
    [DELAY] = {"delay", HAPI_ARGUMENT_NUMBER, false, 0.0, 0.1, "seconds from 0 to 0.1"},
    [QUANTUM] = {"quantum", HAPI_ARGUMENT_NUMBER, false, 0.0, 0.1, "m from 0 to 0.1"},
    [KICK] = {"kick", HAPI_ARGUMENT_TEXT, .expected = "T:vx/vy/vz in s and m/s (at most 100 m/s)"},
    [DOF] = {"dof", HAPI_ARGUMENT_WORD, .expected = "3 or 6", .words = dof_words},
    [TURN] = {"turn", HAPI_ARGUMENT_TEXT, .expected = "T:rx/ry/rz;T:rx/ry/rz in s and rad"},
    [TURN_SINE] = {"turn_sine", HAPI_ARGUMENT_VECTOR, false, -3.0, 3.0,
                   "ax/ay/az in rad, each within 3"},
    [TURN_HZ] = {"turn_hz", HAPI_ARGUMENT_NUMBER, false, 0.0, 1e4, "a number from 0 to 10000",
                 .number = {1.0}},
    [INERTIA] = {"inertia", HAPI_ARGUMENT_NUMBER, false, 1e-7, 1e3, "kg m^2 from 1e-7 to 1000"},
    [TURN_DAMPING] = {"turn_damping", HAPI_ARGUMENT_NUMBER, false, 0.0, 1e4,
                      "N m s/rad from 0 to 1e4"},
    [TURN_STIFFNESS] = {"turn_stiffness", HAPI_ARGUMENT_NUMBER, false, 0.0, 1e6,
                        "N m/rad from 0 to 1e6"},
    [DEVICE_INERTIA] = {"device_inertia", HAPI_ARGUMENT_NUMBER, false, 0.0, 1e3,
                        "kg m^2 from 0 to 1000"},
    [DEVICE_TURN_DAMPING] = {"device_turn_damping", HAPI_ARGUMENT_NUMBER, false, 0.0, 1e4,
                             "N m s/rad from 0 to 1e4"},
    [GRIPPER] = {"gripper", HAPI_ARGUMENT_TEXT, .expected = "T:x;T:x in s and m"},
    [GRIPPER_SINE] = {"gripper_sine", HAPI_ARGUMENT_NUMBER, false, 0.0, 1.0, "m from 0 to 1"},
    [GRIPPER_HZ] = {"gripper_hz", HAPI_ARGUMENT_NUMBER, false, 0.0, 1e4, "a number from 0 to 10000",
                    .number = {1.0}},
    [GRIPPER_MOST] = {"gripper_max", HAPI_ARGUMENT_NUMBER, false, 1e-3, 1.0, "m from 0.001 to 1",
                      .number = {0.08}},
    [GRIPPER_FORCE] = {"gripper_force", HAPI_ARGUMENT_NUMBER, false, 0.0, 1e3, "N from 0 to 1000",
                       .number = {10.0}},
    [GRIPPER_STIFFNESS] = {"gripper_stiffness", HAPI_ARGUMENT_NUMBER, false, 0.0, 1e9,
                           "N/m from 0 to 1e9"},
    [GRIPPER_DAMPING] = {"gripper_damping", HAPI_ARGUMENT_NUMBER, false, 0.0, 1e6,
                         "N s/m from 0 to 1e6"},
    [LEDS] = {"leds", HAPI_ARGUMENT_NUMBER, false, 0.0, 32.0, "a whole number from 0 to 32"},
    [VIBRATORS] = {"vibrators", HAPI_ARGUMENT_NUMBER, false, 0.0, HAP_VIBRATORS_MAX,
                   "a whole number from 0 to 4"},
};

static hap_status set_motion(virtual_device *device, const hapi_argument *entries,
                             hap_detail *detail)
{
  hapi_motion *motion = &device->motion;
  motion->blend = entries[BLEND].word == 0 ? HAPI_BLEND_SMOOTH : HAPI_BLEND_LINEAR;
  motion->loop = entries[LOOP].word == 1;
  motion->hz = entries[HZ].number[0];
  hapi_v3_copy(entries[SINE].number, motion->sine);
  device->start = entries[START].number[0];
  memcpy(device->orientation, entries[ORIENTATION].number, sizeof device->orientation);
  memcpy(device->told_orientation, device->orientation, sizeof device->told_orientation);
  hapi_quat_normalize(device->told_orientation);
  if (!entries[PATH].given) {
    return HAP_OK;
  }
  const hapi_motion_text text = {"path", "T:x/y/z in s and m (at most 1000 m)", entries[PATH].text,
                                 entries[PATH].length, false};
  return hapi_motion_set_path(motion, &text, detail);
}

static hap_status set_turning(virtual_device *device, const hapi_argument *entries,
                              hap_detail *detail)
{
  hapi_motion *turning = &device->turning;
  for (int i = TURN; entries[DOF].word == 0 && i <= DEVICE_TURN_DAMPING; ++i) {
    if (entries[i].given) {
      return hapi_fail(detail, HAP_ERROR_ARGUMENT, "virtual: %s needs dof=6", entries[i].key);
    }
  }
  if (entries[TURN_HZ].given && !entries[TURN_SINE].given) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "virtual: turn_hz has no effect without turn_sine");
  }
  turning->blend = device->motion.blend;
  turning->loop = device->motion.loop;
  turning->hz = entries[TURN_HZ].number[0];
  hapi_v3_copy(entries[TURN_SINE].number, turning->sine);
  if (!entries[TURN].given) {
    return HAP_OK;
  }
  const hapi_motion_text text = {"turn", "T:rx/ry/rz in s and rad", entries[TURN].text,
                                 entries[TURN].length, false};
  hap_status status = hapi_motion_set_path(turning, &text, detail);
  for (size_t i = 0; status >= HAP_OK && i < turning->count; ++i) {
    if (!(hapi_v3_norm(turning->waypoints[i].position) <= TURN_MOST)) {
      return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                       "virtual: turn: waypoint %zu is a turn by %g rad; at most %g", i + 1,
                       hapi_v3_norm(turning->waypoints[i].position), TURN_MOST);
    }
  }
  return status;
}

static bool is_tuned(const hapi_argument *entries)
{
  return entries[MASS].given || entries[DAMPING].given || entries[STIFFNESS].given ||
         entries[INERTIA].given || entries[TURN_DAMPING].given || entries[TURN_STIFFNESS].given;
}

static hap_status check_hand(const hapi_argument *entries, size_t word, hap_detail *detail)
{
  bool tuned = is_tuned(entries);
  if (tuned && (word == RIGID || word == NOBODY)) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "virtual: hand=%s has no mass, damping or stiffness", hand_words[word]);
  }
  if (word == NOBODY && !(entries[DEVICE_MASS].number[0] >= 1e-3)) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "virtual: hand=none: the device alone needs device_mass=, 0.001 kg or more");
  }
  if (word == RIGID && entries[KICK].given) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "virtual: kick: hand=rigid cannot be kicked");
  }
  return HAP_OK;
}

static void set_wrist(virtual_device *device, const hapi_argument *entries, size_t word)
{
  hapi_hand_def def = wrists[word];
  double device_inertia = entries[DEVICE_INERTIA].given
                              ? entries[DEVICE_INERTIA].number[0]
                              : GRIP * GRIP * entries[DEVICE_MASS].number[0];
  def.mass = entries[INERTIA].given ? entries[INERTIA].number[0] : def.mass;
  def.damping = entries[TURN_DAMPING].given ? entries[TURN_DAMPING].number[0] : def.damping;
  def.stiffness = entries[TURN_STIFFNESS].given ? entries[TURN_STIFFNESS].number[0] : def.stiffness;
  def.mass = fmax(def.mass + device_inertia, INERTIA_LEAST);
  def.drag = entries[DEVICE_TURN_DAMPING].number[0];
  hapi_hand_init(&device->wrist, &def);
}

static hap_status set_hand(virtual_device *device, const hapi_argument *entries, hap_detail *detail)
{
  bool tuned = is_tuned(entries);
  size_t word = entries[HAND].given || !tuned ? entries[HAND].word : RELAXED;
  hap_status status = check_hand(entries, word, detail);
  if (status < 0) {
    return status;
  }
  hapi_hand_def def = presets[word];
  def.mass = entries[MASS].given ? entries[MASS].number[0] : def.mass;
  def.damping = entries[DAMPING].given ? entries[DAMPING].number[0] : def.damping;
  def.stiffness = entries[STIFFNESS].given ? entries[STIFFNESS].number[0] : def.stiffness;
  def.mass += entries[DEVICE_MASS].number[0];
  def.drag = entries[DEVICE_DAMPING].number[0];
  device->yields = word != RIGID;
  device->held = word != NOBODY;
  hapi_hand_init(&device->hand, &def);
  set_wrist(device, entries, word);
  return HAP_OK;
}

static hap_status set_kick(virtual_device *device, const hapi_argument_table *table,
                           hap_detail *detail)
{
  const hapi_argument *text = &table->entries[KICK];
  double time = 0.0;
  device->kick.at_ns = NEVER;
  if (!text->given) {
    return HAP_OK;
  }
  const char *colon = hapi_number_read(text->text, &time);
  double *velocity = device->kick.velocity;
  if (colon == NULL || *colon != ':' || fabs(time) > 1e6 ||
      !hapi_arguments_numbers(colon + 1, text->text + text->length, 3, velocity) ||
      !(hapi_v3_norm(velocity) <= 100.0)) {
    return hapi_arguments_fail(table, text, detail);
  }
  if (time < device->start) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "virtual: kick: at %g s, before start=%g", time,
                     device->start);
  }
  device->kick.at_ns = (uint64_t)llround((time - device->start) * 1e9);
  return HAP_OK;
}

static hap_status set_gripper(virtual_device *device, const hapi_argument *entries,
                              hap_detail *detail)
{
  hapi_gripper *gripper = &device->gripper;
  size_t word = entries[HAND].given || !is_tuned(entries) ? entries[HAND].word : RELAXED;
  gripper->there = entries[GRIPPER].given || entries[GRIPPER_SINE].given;
  for (int i = GRIPPER_HZ; !gripper->there && i <= GRIPPER_DAMPING; ++i) {
    if (entries[i].given) {
      return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                       "virtual: %s needs gripper= or gripper_sine=", entries[i].key);
    }
  }
  gripper->yields = word != RIGID;
  gripper->high = entries[GRIPPER_MOST].number[0];
  gripper->max_force = entries[GRIPPER_FORCE].number[0];
  gripper->rated_stiffness = entries[GRIPPER_STIFFNESS].number[0];
  gripper->rated_damping = entries[GRIPPER_DAMPING].number[0];
  hapi_hand_init(&gripper->fingers, &fingers[word]);
  hapi_motion *motion = &gripper->motion;
  motion->blend = device->motion.blend;
  motion->loop = device->motion.loop;
  motion->hz = entries[GRIPPER_HZ].number[0];
  motion->sine[0] = entries[GRIPPER_SINE].number[0];
  device->info.axis_count = gripper->there ? 1 : 0;
  device->info.led_count = (uint32_t)entries[LEDS].number[0];
  device->info.vibrator_count = (uint32_t)entries[VIBRATORS].number[0];
  if ((double)device->info.led_count != entries[LEDS].number[0] ||
      (double)device->info.vibrator_count != entries[VIBRATORS].number[0]) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "virtual: leds and vibrators are whole numbers");
  }
  if (!entries[GRIPPER].given) {
    return HAP_OK;
  }
  const hapi_motion_text text = {"gripper", "T:x in s and m", entries[GRIPPER].text,
                                 entries[GRIPPER].length, true};
  return hapi_motion_set_path(motion, &text, detail);
}

static void set_info(virtual_device *device, const hapi_argument *entries)
{
  hap_device_info *info = &device->info;
  info->dof = entries[DOF].word == 0 ? 3 : 6;
  info->max_force = entries[MAX_FORCE].number[0];
  info->max_torque = entries[MAX_TORQUE].number[0];
  info->rated_stiffness = entries[RATED_STIFFNESS].number[0];
  info->damping = entries[DEVICE_DAMPING].number[0];
  info->quantum = entries[QUANTUM].number[0];
  info->mass = entries[DEVICE_MASS].number[0];
  info->friction = entries[FRICTION].number[0];
  info->delay = entries[DELAY].number[0];
  info->measures_velocity = info->quantum == 0.0;
  hapi_output_init(&device->output, info->max_force, info->dof == 6 ? info->max_torque : 0.0);
}

static hap_status device_configure(virtual_device *device, const char *args, hap_detail *detail)
{
  hapi_argument entries[ARGUMENT_COUNT];
  memcpy(entries, known_arguments, sizeof entries);
  hapi_argument_table table = {"virtual", entries, ARGUMENT_COUNT};
  hap_status status = hapi_arguments_read(&table, args, detail);
  if (status < 0) {
    return status;
  }
  set_info(device, entries);
  if (entries[HZ].given && !entries[SINE].given) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "virtual: hz has no effect without sine");
  }
  status = set_hand(device, entries, detail);
  if (status >= 0) {
    status = set_motion(device, entries, detail);
  }
  if (status >= 0) {
    status = set_turning(device, entries, detail);
  }
  if (status >= 0) {
    status = set_gripper(device, entries, detail);
  }
  if (status >= 0) {
    status = set_kick(device, &table, detail);
  }
  uint64_t delay_ns = (uint64_t)llround(device->info.delay * 1e9);
  if (status >= 0 && !(hapi_delay_init(&device->delay, delay_ns) &&
                       hapi_delay_init(&device->torque_delay, delay_ns))) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "virtual: no memory for the delay");
  }
  return status;
}

static void virtual_close(void *self)
{
  virtual_device *device = self;
  hapi_motion_finish(&device->motion);
  hapi_motion_finish(&device->turning);
  hapi_motion_finish(&device->gripper.motion);
  hapi_delay_finish(&device->delay);
  hapi_delay_finish(&device->torque_delay);
  hapi_free(device);
}

static hap_status virtual_open(void *context, const char *args, void **self, hap_detail *detail)
{
  (void)context;
  virtual_device *device = hapi_alloc(sizeof *device);
  if (device == NULL) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "virtual: out of memory");
  }
  hap_status status = device_configure(device, args, detail);
  if (status < 0) {
    virtual_close(device);
    return status;
  }
  *self = device;
  return HAP_OK;
}

static void virtual_describe(void *self, uint32_t effector, hap_device_info *out)
{
  (void)effector;
  const virtual_device *device = self;
  *out = device->info;
}

static hap_status virtual_start(void *self)
{
  virtual_device *device = self;
  hapi_output_zero(&device->output);
  hapi_delay_clear(&device->delay);
  hapi_delay_clear(&device->torque_delay);
  device->kick.done = false;
  device->work = 0.0;
  hapi_timeline_start(&device->timeline);
  return HAP_OK;
}

static bool device_turns(const virtual_device *device)
{
  return device->info.dof == 6;
}

/* w = J(x) x' of a rotation vector x: the left Jacobian of its exponential. */
static void spin_matrix(const double x[3], double out[9])
{
  double angle = hapi_v3_norm(x);
  double angle2 = angle * angle;
  bool small = angle < 1e-3;
  double first = small ? 0.5 - angle2 / 24.0 : (1.0 - cos(angle)) / angle2;
  double second = small ? 1.0 / 6.0 - angle2 / 120.0 : (angle - sin(angle)) / (angle2 * angle);
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      out[3 * i + k] = second * x[i] * x[k] + (i == k ? 1.0 - second * angle2 : 0.0);
    }
  }
  out[1] -= first * x[2];
  out[2] += first * x[1];
  out[3] += first * x[2];
  out[5] -= first * x[0];
  out[6] -= first * x[1];
  out[7] += first * x[0];
}

/* The handle's turning over a step: as the hand's motion, in rotation vectors. The torque that acts
 * on them is J^T times the device's, so that both do the same work. */
static void turn_hand(virtual_device *device, double from, double length)
{
  hapi_hand_target target = {0};
  double matrix[9];
  double torque[3];
  double before[3];
  hapi_v3_copy(device->wrist.position, before);
  spin_matrix(before, matrix);
  hapi_m3_apply_transposed(matrix, device->torque_delay.acting, torque);
  hapi_motion_at(&device->turning, from, target.position[0], target.velocity[0]);
  hapi_motion_at(&device->turning, from + length, target.position[1], target.velocity[1]);
  for (int axis = 0; axis < 3; ++axis) {
    double push[2];
    hapi_hand_push(&device->wrist, axis, &target, torque[axis], push);
    hapi_hand_step_axis(&device->wrist, axis, length, push);
    device->work += torque[axis] * (device->wrist.position[axis] - before[axis]);
  }
}

/* J that the torque gave to a rigid wrist on its way from there. */
static double rigid_turn_work(const virtual_device *device, const double from[3])
{
  double matrix[9];
  double way[3];
  double turn[3];
  spin_matrix(from, matrix);
  hapi_v3_sub(device->wrist.position, from, way);
  hapi_m3_apply(matrix, way, turn);
  return hapi_v3_dot(device->torque_delay.acting, turn);
}

/* Hand and mechanism from one time to another under the force that acts, in steps short enough for
 * the script. */
static void move_hand(virtual_device *device, uint64_t from_ns, uint64_t to_ns)
{
  uint64_t way_ns = to_ns - from_ns;
  uint64_t count = way_ns / SUBSTEP_NS + (way_ns % SUBSTEP_NS != 0);
  count = count < SUBSTEPS_MAX ? count : SUBSTEPS_MAX;
  double from = device->start + hapi_timeline_seconds(from_ns);
  double length = hapi_timeline_seconds(way_ns) / (double)count;
  hapi_hand_target target = {0};
  hapi_motion_at(&device->motion, from, target.position[1], target.velocity[1]);
  for (uint64_t i = 0; i < count; ++i) {
    hapi_v3_copy(target.position[1], target.position[0]);
    hapi_v3_copy(target.velocity[1], target.velocity[0]);
    hapi_motion_at(&device->motion, from + length * (double)(i + 1), target.position[1],
                   target.velocity[1]);
    for (int axis = 0; axis < 3; ++axis) {
      double push[2];
      hapi_hand_push(&device->hand, axis, &target, device->delay.acting[axis], push);
      hapi_friction_step(&device->hand, axis, device->info.friction, length, push);
    }
    if (device_turns(device)) {
      turn_hand(device, from + length * (double)i, length);
    }
  }
}

/* To where a script is at that time. */
static void hand_place(const virtual_device *device, const hapi_motion *motion, uint64_t at_ns,
                       hapi_hand *hand)
{
  double position[3];
  double velocity[3];
  hapi_motion_at(motion, device->start + hapi_timeline_seconds(at_ns), position, velocity);
  if (!device->held) {
    hapi_v3_set(velocity, 0.0, 0.0, 0.0);
  }
  hapi_hand_place(hand, position, velocity);
}

static void place_hand(virtual_device *device, uint64_t at_ns)
{
  hand_place(device, &device->motion, at_ns, &device->hand);
  if (device_turns(device)) {
    hand_place(device, &device->turning, at_ns, &device->wrist);
  }
}

static void gripper_read(virtual_device *device, bool first, uint64_t before_ns,
                         hap_device_input *out)
{
  hapi_gripper *gripper = &device->gripper;
  uint64_t way_ns = device->timeline.elapsed_ns - before_ns;
  double force = hapi_output_is_zeroed(&device->output) ? 0.0 : gripper->held;
  if (first) {
    hapi_gripper_place(gripper, device->start, device->held);
  } else {
    hapi_gripper_move(gripper, device->start + hapi_timeline_seconds(before_ns),
                      hapi_timeline_seconds(way_ns), force);
  }
  out->axes[0] = gripper->fingers.position[0];
  out->axis_rates[0] = gripper->fingers.velocity[0];
}

static void kick_hand(virtual_device *device, uint64_t now_ns)
{
  if (!device->kick.done && device->kick.at_ns <= now_ns) {
    hapi_v3_add(device->hand.velocity, device->kick.velocity, device->hand.velocity);
    device->kick.done = true;
  }
}

/* From the read at before_ns to the newest one, cut where a command begins to act and at the
 * kick. */
static void device_move(virtual_device *device, uint64_t before_ns)
{
  uint64_t now_ns = device->timeline.elapsed_ns;
  hap_wrench given;
  hapi_output_get(&device->output, &given);
  hapi_delay_give(&device->delay, before_ns, given.force);
  if (device_turns(device)) {
    hapi_delay_give(&device->torque_delay, before_ns, given.torque);
  }
  for (uint64_t at_ns = before_ns; at_ns < now_ns;) {
    uint64_t to_ns = hapi_delay_take(&device->delay, at_ns);
    if (device_turns(device)) {
      (void)hapi_delay_take(&device->torque_delay, at_ns); /* changes at the same times */
    }
    kick_hand(device, at_ns);
    if (!device->kick.done && device->kick.at_ns < to_ns) {
      to_ns = device->kick.at_ns;
    }
    to_ns = to_ns < now_ns ? to_ns : now_ns;
    double way[3];
    double turn[3];
    hapi_v3_copy(device->hand.position, way);
    hapi_v3_copy(device->wrist.position, turn);
    if (device->yields) {
      move_hand(device, at_ns, to_ns);
    } else {
      place_hand(device, to_ns);
      device->work += device_turns(device) ? rigid_turn_work(device, turn) : 0.0;
    }
    hapi_v3_sub(device->hand.position, way, way);
    device->work += hapi_v3_dot(device->delay.acting, way);
    at_ns = to_ns;
  }
}

static void pose_measure(virtual_device *device, bool first, uint64_t way_ns)
{
  measured *m = &device->measured;
  double quantum = device->info.quantum;
  if (quantum == 0.0) {
    hapi_v3_copy(device->hand.position, m->position);
    hapi_v3_copy(device->hand.velocity, m->velocity);
    return;
  }
  for (int i = 0; i < 3; ++i) {
    double before = m->position[i];
    m->position[i] = quantum * round(device->hand.position[i] / quantum);
    if (first) {
      m->velocity[i] = 0.0;
    } else if (way_ns > 0) {
      m->velocity[i] = (m->position[i] - before) / hapi_timeline_seconds(way_ns);
    }
  }
}

static void show_turn(const virtual_device *device, hap_pose *pose, hap_twist *twist)
{
  if (!device_turns(device)) {
    memcpy(pose->quat_wxyz, device->told_orientation, sizeof pose->quat_wxyz);
    return;
  }
  const double *x = device->wrist.position;
  double angle = hapi_v3_norm(x);
  double part = angle < 1e-6 ? 0.5 : sin(0.5 * angle) / angle;
  double turn[4] = {cos(0.5 * angle), part * x[0], part * x[1], part * x[2]};
  double matrix[9];
  hapi_quat_multiply(turn, device->orientation, pose->quat_wxyz);
  hapi_quat_normalize(pose->quat_wxyz);
  spin_matrix(x, matrix);
  hapi_m3_apply(matrix, device->wrist.velocity, twist->angular);
}

static hap_status virtual_read(void *self, int64_t time_ns, hap_device_input *const out[])
{
  hap_device_input *in = out[0];
  virtual_device *device = self;
  bool first = !device->timeline.begun;
  uint64_t before_ns = device->timeline.elapsed_ns;
  hap_status status = hapi_timeline_advance(&device->timeline, time_ns);
  if (status < 0) {
    return status;
  }
  if (first) {
    place_hand(device, 0);
  } else {
    device_move(device, before_ns);
  }
  if (device->gripper.there) {
    gripper_read(device, first, before_ns, in);
  }
  pose_measure(device, first, device->timeline.elapsed_ns - before_ns);
  in->twist = (hap_twist){{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  hapi_v3_copy(device->measured.position, in->pose.position);
  hapi_v3_copy(device->measured.velocity, in->twist.linear);
  show_turn(device, &in->pose, &in->twist);
  in->buttons = 0;
  return HAP_OK;
}

static hap_status virtual_write(void *self, const hap_device_output *const wanted[],
                                hap_device_output *const reached[])
{
  virtual_device *device = self;
  hapi_gripper *gripper = &device->gripper;
  bool shortened = false;
  if (!device->timeline.running) {
    return HAP_ERROR_STATE;
  }
  if (gripper->there) {
    double push = wanted[0]->axis_forces[0];
    if (!hapi_finite(&push, 1)) {
      return HAP_ERROR_ARGUMENT;
    }
    gripper->held = hapi_max(hapi_min(push, gripper->max_force), -gripper->max_force);
    reached[0]->axis_forces[0] = gripper->held;
    shortened = gripper->held != push;
  }
  hap_status status = hapi_output_write(&device->output, &wanted[0]->wrench, &reached[0]->wrench);
  return status == HAP_OK && shortened ? HAP_SATURATED : status;
}

static void virtual_zero(void *self)
{
  virtual_device *device = self;
  hapi_output_zero(&device->output);
}

static void virtual_stop(void *self)
{
  virtual_device *device = self;
  hapi_output_zero(&device->output);
  hapi_timeline_stop(&device->timeline);
}

static void virtual_held(void *self, hap_device_output *const out[])
{
  const virtual_device *device = self;
  hapi_output_get(&device->output, &out[0]->wrench);
  out[0]->axis_forces[0] = hapi_output_is_zeroed(&device->output) ? 0.0 : device->gripper.held;
}

static void virtual_describe_axis(void *self, uint32_t effector, uint32_t axis, hap_axis_info *out)
{
  const virtual_device *device = self;
  (void)effector;
  (void)axis;
  out->kind = HAP_AXIS_GRIPPER;
  out->unit = HAP_AXIS_METRES;
  out->low = 0.0;
  out->high = device->gripper.high;
  out->max_force = device->gripper.max_force;
  out->rated_stiffness = device->gripper.rated_stiffness;
  out->rated_damping = device->gripper.rated_damping;
}

void hapi_virtual_get_port(const void *self, hapi_virtual_port *out)
{
  const virtual_device *device = self;
  out->work = device->work;
  hapi_v3_copy(device->delay.acting, out->force);
  hapi_v3_copy(device->hand.position, out->position);
  hapi_v3_copy(device->hand.velocity, out->velocity);
  hapi_v3_copy(device->torque_delay.acting, out->torque);
  hapi_v3_copy(device->wrist.position, out->turn);
  hapi_v3_copy(device->wrist.velocity, out->turn_rate);
  out->inertia = device->yields ? device->wrist.def.mass : 0.0;
  out->mass = device->yields ? device->hand.def.mass : 0.0;
}

void hapi_virtual_get_hand(const void *self, hapi_hand_def *out)
{
  const virtual_device *device = self;
  *out = device != NULL && device->yields ? device->hand.def : presets[RELAXED];
}

const hap_device_ops hapi_virtual_ops = {
    .abi = HAP_DEVICE_ABI,
    .size = sizeof(hap_device_ops),
    .name = "virtual",
    .help =
        "scripted motion and a simulated hand: path=T:x/y/z;..., blend=smooth|linear, loop=0|1, "
        "sine=ax/ay/az, hz=F, start=S, orientation=w/x/y/z, "
        "hand=rigid|relaxed|tense|none, mass=, damping=, stiffness=, kick=T:vx/vy/vz, "
        "max_force=, max_torque=, rated_stiffness=, device_mass=, device_damping=, friction=, "
        "delay=, quantum=, dof=3|6; dof=6: turn=T:rx/ry/rz;..., turn_sine=, turn_hz=, inertia=, "
        "turn_damping=, turn_stiffness=, device_inertia=, device_turn_damping=; "
        "gripper=T:x;..., gripper_sine=A, gripper_hz=F, gripper_max=, gripper_force=, "
        "gripper_stiffness=, gripper_damping=; leds=, "
        "vibrators=",
    .pacing = HAP_PACING_VIRTUAL,
    .open = virtual_open,
    .describe = virtual_describe,
    .start = virtual_start,
    .read = virtual_read,
    .write = virtual_write,
    .zero = virtual_zero,
    .stop = virtual_stop,
    .close = virtual_close,
    .held = virtual_held,
    .describe_axis = virtual_describe_axis,
};
