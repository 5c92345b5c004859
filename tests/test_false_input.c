/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Devices that tell what is false: the session over them, and by itself what believes a pose. */

#include "tests/tap.h"

#include <dirent.h>
#include <stdint.h>
#include <unistd.h>

#include <hapode/hapode.h>
#include <hapode/ode.h>

#include "base/safety.h"
#include "base/vec.h"
#include "bench/false_input.h"
#include "plugins/spidar/belief.h"
#include "plugins/spidar/calibration.h"
#include "pointer/plausible.h"

#define MS 1000000LL

/* ---- sessions ---- */

static false_input_run right;
static false_input_run run;

static void run_measure(const false_input_def *def, false_input_run *out)
{
  hap_detail detail = {""};
  REQUIRE_SAY(false_input_measure(def, out, &detail) >= HAP_OK, "%s", detail.text);
}

/* What is false never makes more than a tenth more force, nor 2 N in 2 ms. */
static void look_at(const false_input_def *def)
{
  false_input_figures f;
  run_measure(def, &run);
  false_input_compare(def, &right, &run, &f);
  printf("# %s, %s, %g Hz, %s: %.2f N (%.2f), in 2 ms %.2f N (%.2f), fault %u at %.0f ms\n",
         false_input_device_name(def->device), def->row ? "row" : "wall", def->haptic_hz,
         false_input_name(def->kind), f.peak, f.peak_right, f.step, f.step_right, run.fault,
         1e3 * run.fault_s);
  CHECK(f.peak_right > 4.0);
  CHECK(f.peak <= 1.1 * f.peak_right);
  CHECK(f.step <= 2.0 + f.step_right);
  if (def->kind == FALSE_ALWAYS || def->kind == FALSE_ALL_ALWAYS) {
    CHECK(run.told_s >= 0.0 && run.told_s <= 0.02);
    CHECK(run.fault == HAP_FAULT_DEVICE_INPUT && run.fault_s <= 0.0205);
  }
}

static void look_at_all(false_input_def *def, const false_input_kind *kinds, int count)
{
  def->kind = FALSE_NOTHING;
  run_measure(def, &right);
  CHECK(right.fault == HAP_FAULT_NONE && right.told_s < 0.0 && !right.doubted);
  for (int i = 0; i < count; ++i) {
    def->kind = kinds[i];
    look_at(def);
  }
}

TEST(a_spidar_that_tells_what_is_false)
{
  static const false_input_kind kinds[] = {FALSE_ONE_SPIKES, FALSE_ALL_SPIKES, FALSE_SINGLE,
                                           FALSE_ONE_STUCK,  FALSE_ONE_DRIFTS, FALSE_BOARD_STUCK,
                                           FALSE_ALWAYS};
  false_input_def def;
  false_input_init(&def);
  for (int row = 0; row < 2; ++row) {
    def.row = row != 0;
    look_at_all(&def, kinds, sizeof kinds / sizeof kinds[0]);
  }
  CHECK(strstr(run.text, "string 2 is") != NULL);
}

TEST(a_virtual_device_that_tells_what_is_false)
{
  static const false_input_kind kinds[] = {FALSE_ONE_SPIKES, FALSE_ALL_SPIKES, FALSE_SINGLE,
                                           FALSE_OLD,        FALSE_ALWAYS,     FALSE_ALL_ALWAYS};
  static const double rates[] = {1000.0, 5000.0};
  false_input_def def;
  false_input_init(&def);
  def.device = FALSE_INPUT_VIRTUAL;
  for (int i = 0; i < 2; ++i) {
    def.haptic_hz = rates[i];
    look_at_all(&def, kinds, sizeof kinds / sizeof kinds[0]);
  }
}

TEST(a_device_that_is_slow_to_tell_is_believed)
{
  static const double rates[] = {1000.0, 5000.0, 10000.0};
  false_input_def def;
  false_input_init(&def);
  def.device = FALSE_INPUT_COARSE;
  for (int i = 0; i < 3; ++i) {
    def.haptic_hz = rates[i];
    look_at_all(&def, NULL, 0);
  }
}

/* ---- a pointer by itself ---- */

static hapi_pointer hand;
static int64_t hand_ns;

static void hand_begin(void)
{
  memset(&hand, 0, sizeof hand);
  hand.device.speed_limit = 10.0;
  hand.device.pose.quat_wxyz[0] = 1.0;
  hand.guard.share = 1.0;
  hand_ns = 0;
}

/* One read; true: it was believed. */
static bool hand_tell(double x, int64_t after_ns)
{
  hand_ns += after_ns;
  hand.device.pose.position[0] = x;
  hand.device.twist.linear[0] = 0.0;
  return hapi_input_judge(&hand, hand_ns, false);
}

static double hand_x(void)
{
  return hand.device.pose.position[0];
}

TEST(a_spike_is_passed_over_on_the_way_that_the_hand_goes)
{
  hand_begin();
  for (int i = 0; i < 50; ++i) {
    CHECK(hand_tell(0.3e-3 * i, MS));
  }
  CHECK(!hand_tell(0.3e-3 * 50 + 0.004, MS));
  CHECK_NEAR(hand_x(), 0.3e-3 * 50, 2e-5);
  CHECK_NEAR(hand.device.twist.linear[0], 0.3, 0.02);
  CHECK(hand.belief.doubted && hand.belief.loss == 0.0);
  CHECK(hand_tell(0.3e-3 * 51, MS) && !hand.belief.doubted);
  CHECK_NEAR(hand_x(), 0.3e-3 * 51, 1e-12);
}

TEST(the_bound_is_that_of_a_hand)
{
  const double most = HAPI_SAFETY_ACCELERATION_LIMIT * 1e-6; /* m, in the first ms */
  CHECK_NEAR(most, 0.5e-3, 1e-9);
  hand_begin();
  CHECK(hand_tell(0.0, MS) && hand_tell(0.0, MS) && hand_tell(0.95 * most, MS));
  hand_begin();
  CHECK(hand_tell(0.0, MS) && hand_tell(0.0, MS) && !hand_tell(1.05 * most, MS));
  hand_begin(); /* at another rate as well */
  for (int i = 0; i < 10; ++i) {
    CHECK(hand_tell(0.0, MS / 10));
  }
  CHECK(!hand_tell(1.05 * most, MS / 10));
}

TEST(a_device_that_jumped_is_believed_after_some_ms)
{
  hand_begin();
  for (int i = 0; i < 20; ++i) {
    CHECK(hand_tell(0.0, MS));
  }
  int64_t held = hand_ns;
  while (hand_ns - held < 50 * MS && !hand_tell(0.05 + 1e-4 * (double)(hand_ns - held) / MS, MS)) {
    CHECK(hand_x() == 0.0 && !hand.belief.jumped);
  }
  CHECK(hand.belief.jumped && hand_ns - held >= 3 * MS && hand_ns - held <= 5 * MS);
  CHECK(hand_x() > 0.05 && hand.belief.loss == 0.0);
  CHECK(hand_tell(0.0506, MS) && !hand.belief.jumped);
}

TEST(noise_fades_and_is_told_within_20_ms)
{
  hand_begin();
  for (int i = 0; i < 20; ++i) {
    CHECK(hand_tell(0.0, MS));
  }
  int64_t begun = hand_ns;
  double before = 0.0;
  for (int i = 0; hand.belief.loss < 1.0 && i < 100; ++i) {
    (void)hand_tell(i % 2 == 0 ? 0.004 : -0.004, MS);
    CHECK(hand.belief.loss >= before && hand.belief.loss - before < 0.1);
    CHECK(fabs(hand_x()) < 1e-9);
    before = hand.belief.loss;
  }
  CHECK(hand_ns - begun >= 15 * MS && hand_ns - begun <= 20 * MS);
  hapi_input_forgive(&hand);
  CHECK(hand.belief.loss == 0.0);
  for (int i = 0; i < 5; ++i) {
    (void)hand_tell(0.0, MS);
  }
  CHECK(hand_x() == 0.0 && hand.belief.loss == 0.0);
}

/* One of a hundred is nothing; of three one is too many. */
TEST(doubt_adds_up)
{
  for (int every = 3; every <= 20; every += 17) {
    hand_begin();
    for (int i = 0; i < 1000; ++i) {
      (void)hand_tell(i > 10 && i % every == 0 ? 0.006 * (i % 2 == 0 ? 1.0 : -1.0) : 0.0, MS);
    }
    CHECK((hand.belief.loss > 0.0) == (every == 3));
  }
}

/* Nothing of it is pushed before it is believed. */
TEST(a_device_that_does_not_believe_itself_comes_in_later)
{
  hand_begin();
  hand.guard.share = 0.0;
  for (int i = 0; i < 250; ++i) {
    hand_ns += MS;
    CHECK(hapi_input_judge(&hand, hand_ns, true) && hand.belief.doubted && hand.belief.loss < 1.0);
  }
  hand_ns += MS;
  CHECK(hapi_input_judge(&hand, hand_ns, false) && hand.belief.doubt_s == 0.0);
  for (int i = 0; i < 310; ++i) {
    hand_ns += MS;
    (void)hapi_input_judge(&hand, hand_ns, true);
  }
  CHECK(hand.belief.loss == 1.0);
}

/* Steps of a hand's fast motion, told every so many ticks; also when it begins and turns. */
TEST(devices_that_tell_seldom)
{
  static const int every[] = {1, 2, 4, 10};
  static const double quantum[] = {0.0, 3e-5, 1e-4};
  for (int k = 0; k < 12; ++k) {
    int refused = 0;
    hand_begin();
    hand.velocity.quantum = quantum[k / 4];
    double told = 0.0;
    for (int i = 0; i < 4000; ++i) {
      double t = 1e-3 * i - 0.3;
      if (i % every[k % 4] == 0) { /* 0.1 m to and fro at 2.5 Hz: 1.6 m/s, 25 m/s^2 */
        told = t < 0.0 ? 0.0 : 0.05 * (1.0 - cos(2.0 * 3.14159265 * 2.5 * t));
        told += 0.02 * (t < 0.0 ? 0.0 : sin(60.0 * t) * sin(60.0 * t)); /* and a trembling */
        told = quantum[k / 4] > 0.0 ? quantum[k / 4] * round(told / quantum[k / 4]) : told;
      }
      refused += !hand_tell(told, MS);
    }
    CHECK_SAY(refused <= 24, "every %d, %g m: %d refused", every[k % 4], quantum[k / 4], refused);
  }
}

static void hand_play(const char *path, const char *name)
{
  FILE *file = fopen(path, "r");
  char line[512];
  int rows = 0;
  int refused = 0;
  hand_begin();
  REQUIRE(file != NULL);
  double t = -1.0;
  double x[3] = {0.0, 0.0, 0.0};
  while (fgets(line, sizeof line, file) != NULL) {
    double next;
    double at[3];
    if (sscanf(line, "%lf,%lf,%lf,%lf", &next, &at[0], &at[1], &at[2]) != 4) {
      continue;
    }
    for (; t >= 0.0 && t < next - 1e-9; t += 1e-3) { /* held at 1 kHz until the next one */
      hand_ns += MS;
      hapi_v3_copy(x, hand.device.pose.position);
      refused += !hapi_input_judge(&hand, hand_ns, false);
      CHECK(hand.belief.loss < 1.0);
    }
    t = t < 0.0 ? next : t;
    hapi_v3_copy(at, x);
    ++rows;
  }
  fclose(file);
  printf("# %s: %d rows, %d ticks refused\n", name, rows, refused);
  CHECK(rows > 100 && refused <= rows / 200);
}

TEST(recorded_hands_are_believed)
{
  const char *shared = getenv("HAPODE_SHARED");
  char folder[1000];
  snprintf(folder, sizeof folder, "%s/data", shared != NULL ? shared : ".");
  DIR *files = opendir(folder);
  if (files == NULL) {
    SKIP("needs the recordings of HAPODE_SHARED/data");
  }
  const struct dirent *entry;
  while ((entry = readdir(files)) != NULL) {
    char path[1400];
    if (strstr(entry->d_name, ".csv") != NULL) {
      snprintf(path, sizeof path, "%s/%s", folder, entry->d_name);
      hand_play(path, entry->d_name);
    }
  }
  closedir(files);
}

/* ---- strings by themselves ---- */

typedef struct strings {
  const hapi_spidar_model *plain;
  hapi_spidar_model model;
  hapi_spidar_belief belief;
  double counts[HAPI_SPIDAR_STRINGS_MAX];
  hap_pose grip;
  int64_t ns;
} strings;

static strings wires;

static void wires_begin(const char *name)
{
  strings *w = &wires;
  memset(w, 0, sizeof *w);
  w->plain = hapi_spidar_model_find(name);
  w->model = *w->plain;
  hapi_spidar_calibrate_at(&w->model, NULL, w->counts);
  hapi_spidar_home(&w->grip);
  hapi_spidar_belief_begin(&w->belief, &w->model, NULL);
}

/* A reply of where the grip is; one string is off by so many counts. */
static hapi_spidar_verdict wires_tell(double x, double y, int string, double counts)
{
  strings *w = &wires;
  double lengths[HAPI_SPIDAR_STRINGS_MAX];
  w->ns += MS;
  hapi_v3_set(w->grip.position, x, y, 0.0);
  hapi_spidar_lengths(&w->model, &w->grip, lengths);
  for (int i = 0; i < w->model.strings; ++i) {
    w->counts[i] = round((lengths[i] - w->model.offset[i]) / w->model.metres_per_count[i]);
    w->counts[i] += i == string ? counts : 0.0;
  }
  return hapi_spidar_belief_update(&w->belief, &w->model, w->ns, w->counts, true);
}

static double wires_off(void)
{
  double off[3];
  hapi_v3_sub(wires.belief.solver.pose.position, wires.grip.position, off);
  return hapi_v3_norm(off);
}

TEST(each_string_that_leaves_its_length_is_left_out)
{
  static const char *const names[] = {"x4r", "x5r", "x5l"};
  for (int m = 0; m < 3; ++m) {
    for (int string = 0; string < 8; ++string) {
      wires_begin(names[m]);
      for (int i = 0; i < 40; ++i) {
        CHECK(wires_tell(1e-4 * i, 0.0, -1, 0.0) == HAPI_SPIDAR_BELIEVED);
      }
      for (int i = 40; i < 60; ++i) {
        hapi_spidar_verdict said = wires_tell(1e-4 * i, 0.0, string, i % 2 == 0 ? 300.0 : 280.0);
        CHECK(said == HAPI_SPIDAR_SPARED && wires.belief.wrong == string);
        CHECK_NEAR(wires_off(), 0.0, 2e-4);
        CHECK_NEAR(fabs(wires.belief.error) / fabs(wires.model.metres_per_count[string]), 290.0,
                   25.0);
      }
      CHECK(wires_tell(6e-3, 0.0, -1, 0.0) == HAPI_SPIDAR_BELIEVED);
    }
  }
}

/* So slowly that no reply leaves its way: the fit tells. */
TEST(a_string_that_creeps_is_found_by_the_fit)
{
  wires_begin("x4r");
  hapi_spidar_verdict said = HAPI_SPIDAR_BELIEVED;
  int i = 0;
  for (; i < 2000 && said == HAPI_SPIDAR_BELIEVED; ++i) {
    said = wires_tell(0.0, 1e-3 * sin(1e-2 * i), 5, 0.5 * i);
  }
  /* At home x4r has pairs of strings that leave the same misfit. */
  CHECK(said == HAPI_SPIDAR_DOUBTED || wires.belief.wrong == 5);
  CHECK(i < 400 && wires_off() < 2e-3);
}

TEST(strings_that_leave_their_length_carry_the_pose_on_for_some_ms)
{
  wires_begin("x4r");
  for (int i = 0; i < 40; ++i) {
    (void)wires_tell(2e-4 * i, 0.0, -1, 0.0);
  }
  double before = wires.belief.solver.pose.position[0];
  for (int i = 40; i < 60; ++i) {
    strings *w = &wires;
    double lengths[HAPI_SPIDAR_STRINGS_MAX];
    w->ns += MS;
    hapi_v3_set(w->grip.position, 2e-4 * i, 0.0, 0.0);
    hapi_spidar_lengths(&w->model, &w->grip, lengths);
    for (int k = 0; k < 8; ++k) {
      w->counts[k] = round((lengths[k] - w->model.offset[k]) / w->model.metres_per_count[k]);
      w->counts[k] += k == 0 ? 300.0 : k == 3 ? -280.0 : k == 5 ? 260.0 : 0.0;
    }
    CHECK(hapi_spidar_belief_update(&w->belief, &w->model, w->ns, w->counts, true) ==
          HAPI_SPIDAR_DOUBTED);
  }
  double carried = wires.belief.solver.pose.position[0] - before;
  CHECK_NEAR(carried, 4 * 2e-4, 1e-4);
  CHECK(hapi_v3_norm(wires.belief.twist.linear) == 0.0);
  hapi_spidar_verdict said = HAPI_SPIDAR_DOUBTED;
  for (int i = 60; i < 65; ++i) {
    said = wires_tell(2e-4 * i, 0.0, -1, 0.0);
  }
  CHECK(said == HAPI_SPIDAR_BELIEVED);
  CHECK_NEAR(wires_off(), 0.0, 2e-5);
}

/* A fast grip, and then the same reply over and over. */
TEST(old_replies_of_a_fast_grip_are_noticed)
{
  wires_begin("x4r");
  for (int i = 0; i < 60; ++i) {
    CHECK(wires_tell(2.5e-4 * i, 0.0, -1, 0.0) == HAPI_SPIDAR_BELIEVED);
  }
  double x = wires.grip.position[0];
  int first = 0;
  for (int i = 1; i <= 20; ++i) {
    hapi_spidar_verdict said = wires_tell(x, 0.0, -1, 0.0);
    first = first == 0 && said == HAPI_SPIDAR_DOUBTED ? i : first;
    CHECK(first == 0 || said == HAPI_SPIDAR_DOUBTED);
  }
  CHECK(first > 0 && first <= 4);
  wires_begin("x4r"); /* one that comes to rest */
  for (int i = 0; i < 200; ++i) {
    double way = i < 100 ? 1e-4 * i : 1e-2;
    CHECK(wires_tell(way, 0.0, -1, 0.0) == HAPI_SPIDAR_BELIEVED);
  }
}

TEST(strings_without_tension_are_not_judged)
{
  wires_begin("x4r");
  for (int i = 0; i < 20; ++i) {
    (void)wires_tell(0.0, 0.0, -1, 0.0);
  }
  wires.counts[3] += 300.0;
  CHECK(hapi_spidar_belief_update(&wires.belief, &wires.model, wires.ns + MS, wires.counts,
                                  false) == HAPI_SPIDAR_BELIEVED);
}
