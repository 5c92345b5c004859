/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The command line of hapode-run: each line of the bytes is an argument. */

#include <math.h>

#include "tests/fuzz/fuzz.h"
#include "tools/run_options.h"

#define ARGUMENTS_MAX 40

/* Cuts text at its line ends; argv ends with NULL. */
static int text_split(char *text, char **argv)
{
  static char name[] = "hapode-run";
  int count = 0;
  argv[count++] = name;
  for (char *at = text; at != NULL && count < ARGUMENTS_MAX; ++count) {
    argv[count] = at;
    at = strchr(at, '\n');
    if (at != NULL) {
      *at++ = '\0';
    }
  }
  argv[count] = NULL;
  return count;
}

static void check_between(double value, double low, double high)
{
  FUZZ_CHECK(value >= low && value <= high);
}

static void check_def(const rig_options *of)
{
  const hap_session_def *def = &of->def;
  const hap_expert_def *expert = &of->expert;
  const hap_research_def *research = &of->research;
  FUZZ_CHECK(hap_model_name(def->model) != NULL);
  check_between(def->haptic_hz, 100.0, 20000.0);
  check_between(def->physics_hz, 1.0, fmin(1000.0, def->haptic_hz));
  FUZZ_CHECK(expert->contact_hz == HAP_BY_ACCURACY ||
             (expert->contact_hz >= 20.0 && expert->contact_hz <= 1000.0));
  check_between(def->accuracy, 0.0, 1.0);
  check_between(expert->force_error_wanted, 0.0, 1.0);
  FUZZ_CHECK(expert->force_error_wanted == 0.0 || expert->lookback > 0.0);
  check_between(expert->tick_share, 0.0, 1.0);
  check_between(expert->physics_share, 0.0, 1.0);
  check_between(def->rt_priority, 0, 98);
  check_between(research->physics_latency_ticks, -1, 20000);
  check_between(def->drive, HAP_DRIVE_THREADS, HAP_DRIVE_LOCKSTEP);
  check_between(research->impulse_pose, HAP_IMPULSE_INTERPOLATED, HAP_IMPULSE_HELD);
  check_between(research->probe, HAP_PROBE_SHARED, HAP_PROBE_BY_ACCURACY);
  for (int i = 0; i < HAP_EFFECTS; ++i) {
    bool on = (expert->effects_on & HAP_EFFECT_BIT(i)) != 0;
    bool off = (expert->effects_off & HAP_EFFECT_BIT(i)) != 0;
    hap_effect_wish wish = on ? HAP_EFFECT_ON : off ? HAP_EFFECT_OFF : HAP_EFFECT_AUTO;
    FUZZ_CHECK(!(on && off));
    FUZZ_CHECK(hap_effect_check((hap_effect)i, wish, def->model, NULL) == HAP_OK);
  }
}

static void check_options(const run_options *options)
{
  check_between(options->check.force, 0.0, CONFORM_FORCE_MAX);
  check_between(options->check.wait_s, 0.0, 3600.0);
  FUZZ_CHECK(options->check.spec == NULL || options->rig.device_count == 0);
  check_def(&options->rig);
  FUZZ_CHECK(options->seconds == 0.0 || options->seconds >= 0.001);
  check_between(options->seconds, 0.0, 86400.0);
  FUZZ_CHECK(options->rig.max_force == 0.0 || options->rig.max_force >= 1e-6);
  check_between(options->rig.max_force, 0.0, 1e6);
  FUZZ_CHECK(options->rig.stiffness == 0.0 || options->rig.stiffness >= 1e-3);
  check_between(options->rig.stiffness, 0.0, 1e9);
  check_between(options->rig.coupling, HAP_COUPLING_DIRECT, HAP_COUPLING_VIRTUAL);
  check_between(options->rig.coupling_stiffness, 0.0, 1e9);
  FUZZ_CHECK(options->rig.coupling == HAP_COUPLING_DIRECT ||
             options->rig.coupling == HAP_COUPLING_AUTO ||
             options->rig.def.model == HAP_MODEL_CONTACT);
  FUZZ_CHECK(options->rig.scene != NULL && options->rig.scene[0] != '\0');
  FUZZ_CHECK(options->rig.device_count <= RIG_POINTERS_MAX);
  for (size_t i = 0; i < options->rig.device_count; ++i) {
    FUZZ_CHECK(options->rig.devices[i] != NULL);
  }
  FUZZ_CHECK(options->trace_path == NULL || options->trace_path[0] != '\0');
  FUZZ_CHECK(options->plot_path == NULL || options->plot_path[0] != '\0');
}

void fuzz_one(const uint8_t *data, size_t size)
{
  char *argv[ARGUMENTS_MAX + 1];
  char *text = fuzz_text(data, size);
  int argc = text_split(text, argv);
  run_options options;
  hap_detail detail;
  fuzz_detail_spoil(&detail);
  hap_status status = run_options_parse(argc, argv, &options, &detail);
  fuzz_check_answer(status, status >= HAP_OK ? &options : NULL, &detail);
  if (status < HAP_OK) {
    FUZZ_CHECK(strstr(detail.text, "--") != NULL); /* it names the option */
    bool model = strncmp(detail.text, "--model: ", strlen("--model: ")) == 0;
    FUZZ_CHECK(!model || strstr(detail.text, hap_model_name(HAP_MODEL_CONTACT)) != NULL);
  } else if (options.action == RUN_SESSION) {
    check_options(&options);
  }
  free(text);
}
