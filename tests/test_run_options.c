/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* hapode-run: what its options come to together, and what the dial has come to. */

#include "tests/tap.h"

#include "tools/run_summary.h"

#define WORDS_MAX 16
#define INDENT 28

static run_options options;
static hap_detail why;

static hap_status options_parse(const char *arguments)
{
  static char words[400];
  char *argv[WORDS_MAX] = {words};
  int argc = 1;
  why.text[0] = '\0';
  snprintf(words, sizeof words, "hapode-run %s", arguments);
  for (char *rest = NULL, *word = strtok_r(words + sizeof "hapode-run" - 1, " ", &rest);
       word != NULL && argc < WORDS_MAX; word = strtok_r(NULL, " ", &rest)) {
    argv[argc++] = word;
  }
  return run_options_parse(argc, argv, &options, &why);
}

/* Refused, with a text that begins with the option and has this in it. */
static bool options_refused(const char *arguments, const char *option, const char *text)
{
  bool good = options_parse(arguments) < HAP_OK && strncmp(why.text, option, strlen(option)) == 0 &&
              why.text[strlen(option)] == ':' && strstr(why.text, text) != NULL;
  if (!good) {
    printf("# %s: %s\n", arguments, why.text);
  }
  return good;
}

TEST(a_wanted_error_needs_looking_back)
{
  CHECK(options_parse("--seconds 1") == HAP_OK && options.rig.expert.lookback == 0.0);
  CHECK(options_parse("--lookback 0.3") == HAP_OK && options.rig.expert.lookback == 0.3);
  CHECK(options_parse("--force-error 0.05") == HAP_OK && options.rig.expert.lookback == 0.1);
  CHECK(options_parse("--force-error 0.05 --lookback 0.3") == HAP_OK &&
        options.rig.expert.lookback == 0.3);
  CHECK(options_refused("--force-error 0.05 --lookback 0", "--force-error", "--lookback 0"));
}

TEST(the_reference_has_no_error)
{
  CHECK(options_refused("--model single --lookback 0.1", "--lookback", "single"));
  CHECK(options_refused("--model single --force-error 0.1", "--force-error", "single"));
  CHECK(options_parse("--model single --lookback 0") == HAP_OK);
  CHECK(options_parse("--model impulse --force-error 0.1") == HAP_OK);
}

TEST(a_budget_needs_a_clock)
{
  CHECK(options_refused("--lockstep --tick-share 0.1", "--tick-share", "--accuracy"));
  CHECK(options_refused("--physics-share 0.1 --lockstep", "--physics-share", "--accuracy"));
  CHECK(options_parse("--tick-share 0.1 --physics-share 0.2") == HAP_OK);
  CHECK(options.rig.expert.tick_share == 0.1 && options.rig.expert.physics_share == 0.2);
}

TEST(a_budget_of_the_tick_needs_a_model_with_something_to_leave_out)
{
  CHECK(options_refused("--model accelerance --tick-share 0.1", "--tick-share", "contact"));
  CHECK(options_refused("--tick-share 0.1 --model single", "--tick-share", "contact"));
  CHECK(options_parse("--model accelerance --physics-share 0.1") == HAP_OK);
}

TEST(single_settings_stay_when_they_are_given)
{
  const hap_expert_def *expert = &options.rig.expert;
  CHECK(options_parse("--seconds 1") == HAP_OK && expert->iterations == HAP_BY_ACCURACY);
  CHECK(expert->max_sweeps == HAP_BY_ACCURACY && expert->range_hops == HAP_BY_ACCURACY);
  CHECK(options_parse("--iterations 500 --sweeps 4 --range 0") == HAP_OK);
  CHECK(expert->iterations == 500 && expert->max_sweeps == 4);
  CHECK(expert->range_hops == 0);
  CHECK(options_parse("--iterations world --range all") == HAP_OK);
  CHECK(expert->iterations == 0 && expert->range_hops == HAP_RANGE_ALL);
  CHECK(options_refused("--iterations 0", "--iterations", "1 to 10000"));
  CHECK(options_refused("--iterations worlds", "--iterations", "1 to 10000"));
  CHECK(options_parse("--look-ahead 0.25") == HAP_OK && expert->look_ahead == 0.25);
  CHECK(options_refused("--look-ahead 1.5", "--look-ahead", "0 to 1"));
  CHECK(options_parse("--substeps 4") == HAP_OK && expert->substeps == 4);
  CHECK(options_refused("--substeps 65", "--substeps", "1 to 64"));
  CHECK(options_refused("--sweeps 1", "--sweeps", "2 to 10000"));
  CHECK(options_refused("--sweeps 2.5", "--sweeps", "whole number"));
  CHECK(options_refused("--range -1", "--range", "0 to 1024"));
  CHECK(options_refused("--range nan", "--range", "0 to 1024"));
  CHECK(options_refused("--range 1e3x", "--range", "0 to 1024"));
  CHECK(options_refused("--range 1025", "--range", "0 to 1024"));
}

/* Each line of the help begins an option, or goes on below its text. */
TEST(the_help_is_indented)
{
  char line[400];
  FILE *help = tmpfile();
  REQUIRE(help != NULL);
  run_options_help(help);
  rewind(help);
  bool table = false;
  int below = 0;
  while (fgets(line, sizeof line, help) != NULL && strncmp(line, "A summary", 9) != 0) {
    table = table || strncmp(line, "  --", 4) == 0;
    if (table && line[0] != '\n' && strncmp(line, "  --", 4) != 0) {
      CHECK(strspn(line, " ") == INDENT);
      ++below;
    }
  }
  CHECK(below > 10);
  fclose(help);
}

TEST(the_summary_says_what_accuracy_comes_to)
{
  char text[400] = "";
  hap_accuracy_info info = {.tick = {.accuracy = 0.1, .share = 0.2, .load = 0.3, .turns = 4},
                            .physics = {.accuracy = 0.6, .reason = HAP_ACCURACY_BUDGET},
                            .contact_hz = 100.0,
                            .max_sweeps = 2,
                            .range_hops = 4,
                            .probe = HAP_PROBE_OPERATING,
                            .iterations = 20,
                            .reuse = 1e-6,
                            .row_updates = 300};
  FILE *summary = tmpfile();
  REQUIRE(summary != NULL);
  run_summary_accuracy(&info, summary);
  rewind(summary);
  CHECK(fread(text, 1, sizeof text - 1, summary) > 0);
  fclose(summary);
  CHECK(strcmp(text,
               "accuracy_tick: 0.1 (asked for)\n"
               "load_tick: 0.3 of 0.2, turned 4 times\n"
               "accuracy_physics: 0.6 (as much as fits)\n"
               "accuracy_settings: contact_hz=100,max_sweeps=2,range_hops=4,shapes=0,"
               "probe=operating,iterations=20,reuse=1e-06,"
               "row_updates=300\n") == 0);
}
