/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* hapode-bench NAME [--out DIR] [--quick] [--verify] [--scene SCENE] [--only FILTER] [--coupling
 * NAME] [--estimates all|default] [--shard K/N | --merge FILE...] [--fresh]: measures, writes
 * NAME.csv and NAME.svg. Exit 0: done, 1: failed or --verify found something off, 2: usage. */

#include <stdlib.h>
#include <string.h>

#include <ode/ode.h>

#include "bench/accuracy.h"
#include "bench/bench.h"

typedef struct program {
  const char *name;
  bench_fn run;
  const char *text;
} program;

static const program programs[] = {
    {"accuracy", bench_accuracy,
     "what accuracy costs in time; --scene NAME: of one scene alone; --coupling NAME: through it "
     "too;\n"
     "             --estimates all|default: beside which rows the session's own estimate of the "
     "error;\n"
     "             --shard K/N: one of N parts, for as many processes or machines; --merge "
     "FILE...: the\n"
     "             table of all of them; --fresh: not from what a run that was killed has "
     "finished"},
    {"app", bench_app,
     "what an application is promised: forces, textures, vibrations, taps, settings, each against "
     "SINGLE\n"
     "             and a plain loop or a closed form"},
    {"couplings", bench_couplings,
     "direct and proxy against god-object and virtual coupling: force, depth, stability, drag"},
    {"edits", bench_edits,
     "a world that threads change all the time under sixteen hands: ticks, steps, waits, forces"},
    {"effects", bench_effects,
     "what each effect costs in a scene, and everything on against all left to the library; "
     "--scene NAME"},
    {"faults", bench_faults,
     "the felt force against an independent reference, scene by scene, and where it is wrong; "
     "--scene NAME;\n"
     "             --random N: N worlds of random bodies instead, and how many end their process"},
    {"fig5", bench_fig5, "the paper's Fig. 5: force of a cube that runs into a fixed pointer"},
    {"fig6", bench_fig6, "the paper's Fig. 6: duty factors while one cube is pushed"},
    {"fig7", bench_fig7, "the paper's Fig. 7: duty factors while ten cubes are pushed, and more"},
    {"hosting", bench_hosting,
     "what a world costs whoever serves it to a hand in another process: share of a core, memory, "
     "bytes;\n"
     "             --scene NAME"},
    {"impedance", bench_impedance,
     "what the hand feels at the port from 0.5 to 200 Hz, and the stiffest wall of each device; "
     "--coupling\n"
     "             NAME: through it in the proxy's place"},
    {"influence", bench_influence,
     "which bodies matter for the felt force, and what a border of the range costs; --scene "
     "WORLD:N"},
    {"input", bench_input,
     "the felt force while a device tells positions that are false for 0.2 s"},
    {"jitter", bench_jitter,
     "how late the haptic thread wakes up, against cyclictest; page faults, context switches"},
    {"late", bench_late,
     "a loop that is stopped in pulses: force, steps, and what the guard does; --scene NAME"},
    {"line", bench_line, "a SPIDAR at 1 kHz through its emulator: ticks without a new answer"},
    {"oscillation", bench_oscillation,
     "a device that swings by itself or runs away: when the guard acts, and where it must not"},
    {"peers", bench_peers,
     "the same worlds and hand in engines that are stepped at 1 kHz: time, force; --scene "
     "WORLD[:N][@HZ]; --only engine=NAME/NAME,...: of such rows alone"},
    {"poses", bench_poses,
     "what is drawn at 90 Hz against where the loop had hand and bodies; cost of a call"},
    {"remote", bench_remote,
     "a hand far from its world: force, bytes and age of models by delay and loss; --scene NAME"},
    {"scaling", bench_scaling, "world size: one neighbour among up to 1000 resting cubes"},
    {"spidar", bench_spidar,
     "string devices: poses from rounded counts, tensions, times; numerics alone, no device"},
    {"spread", bench_spread,
     "how sure a force is: worlds that begin 0.1 um aside, in sessions and in solved engines; "
     "--scene WORLD:N"},
    {"stability", bench_stability,
     "where each integrator holds: stiffness, mass, contacts at once; --only KEY=VALUE/VALUE,...: "
     "of "
     "such points alone, by the names of the table"},
    {"stopped", bench_stopped,
     "hapode-run in real time, stopped by signals or beside busy loops, with the virtual device "
     "and "
     "a SPIDAR's emulator: force, steps, and what the guard does"},
    {"tail", bench_tail, "the slowest ticks of every scene, at rest and pushed; --scene NAME[:N]"},
    {"tick", bench_tick,
     "the haptic loop alone: time of a tick; --scene NAME: of one case with contacts"},
};

#define PROGRAM_COUNT (sizeof programs / sizeof programs[0])

static void print_usage(FILE *to)
{
  fprintf(
      to,
      "usage: hapode-bench NAME [--out DIR] [--quick] [--verify] [--scene SCENE] [--only FILTER]\n"
      "                    [--coupling NAME] [--estimates all|default] [--shard K/N | --merge "
      "FILE...] [--fresh]\n"
      "                    [--random N]\n"
      "NAME.csv and NAME.svg go to DIR, by default the current folder. NAME is one of:\n");
  for (size_t i = 0; i < PROGRAM_COUNT; ++i) {
    fprintf(to, "  %-9s  %s\n", programs[i].name, programs[i].text);
  }
}

static const program *find_program(const char *name)
{
  for (size_t i = 0; i < PROGRAM_COUNT; ++i) {
    if (strcmp(programs[i].name, name) == 0) {
      return &programs[i];
    }
  }
  return NULL;
}

#define RANDOM_WORLDS_MAX 100000000
#define BAD_SHARD SIZE_MAX
#define TEXT_OF(number) TEXT_OF_(number)
#define TEXT_OF_(number) #number

static bool takes_coupling(const program *p)
{
  return p->run == bench_accuracy || p->run == bench_impedance;
}

/* The value of an option, "--name VALUE" or "--name=VALUE"; NULL: it is another argument. */
static const char *value_of(const char *name, int count, char **arguments, int *io)
{
  const char *argument = arguments[*io];
  size_t length = strlen(name);
  /* NOLINTNEXTLINE(clang-analyzer-core.NonNullParamChecker): no argument is NULL */
  if (strncmp(argument, name, length) == 0 && argument[length] == '=') {
    return argument + length + 1;
  }
  if (strcmp(argument, name) == 0 && *io + 1 < count) {
    ++*io;
    return arguments[*io];
  }
  return NULL;
}

/* The files after --merge, up to the next option. */
static void take_files(int count, char **arguments, bench *b, int *io)
{
  b->merge = (const char *const *)(void *)(arguments + *io + 1);
  while (*io + 1 < count && arguments[*io + 1][0] != '-') {
    ++b->merge_count;
    ++*io;
  }
}

/* An argument that is no name; false: there is no such. */
static bool take_option(int count, char **arguments, bench *b, int *io)
{
  const struct {
    const char *name;
    const char **out;
  } texts[] = {{"--out", &b->out},
               {"--scene", &b->scene},
               {"--only", &b->only},
               {"--coupling", &b->coupling},
               {"--estimates", &b->estimates}};
  const char *argument = arguments[*io];
  for (size_t i = 0; i < sizeof texts / sizeof texts[0]; ++i) {
    const char *value = value_of(texts[i].name, count, arguments, io);
    if (value != NULL) {
      *texts[i].out = value;
      return true;
    }
  }
  const char *random = value_of("--random", count, arguments, io);
  if (random != NULL) {
    char *end;
    b->random_worlds = strtol(random, &end, 10);
    return *end == '\0' && b->random_worlds >= 1 && b->random_worlds <= RANDOM_WORLDS_MAX;
  }
  const char *shard = value_of("--shard", count, arguments, io);
  if (shard != NULL) {
    b->shards = 0;
    if (!accuracy_read_shard(shard, &b->shard, &b->shards)) {
      b->shard = BAD_SHARD;
    }
    return true;
  }
  if (strcmp(argument, "--merge") == 0) {
    take_files(count, arguments, b, io);
    return true;
  }
  b->quick = b->quick || strcmp(argument, "--quick") == 0;
  b->verify = b->verify || strcmp(argument, "--verify") == 0;
  b->fresh = b->fresh || strcmp(argument, "--fresh") == 0;
  return strcmp(argument, "--quick") == 0 || strcmp(argument, "--verify") == 0 ||
         strcmp(argument, "--fresh") == 0;
}

/* That the bench takes what was given; stderr says what it does not. */
static bool options_fit(const program *p, const bench *b)
{
  const char *wrong = NULL;
  bool of_accuracy = b->shards > 0 || b->shard == BAD_SHARD || b->merge != NULL || b->fresh;
  hap_coupling coupling;
  bool known = b->estimates == NULL || strcmp(b->estimates, "all") == 0 ||
               strcmp(b->estimates, "default") == 0;
  if (b->scene != NULL && p->run != bench_accuracy && p->run != bench_tick &&
      p->run != bench_effects && p->run != bench_faults && p->run != bench_late &&
      p->run != bench_peers && p->run != bench_remote && p->run != bench_hosting &&
      p->run != bench_influence && p->run != bench_spread && p->run != bench_tail) {
    wrong = "has no scenes to choose from";
  } else if (b->random_worlds > 0 && (p->run != bench_faults || b->scene != NULL)) {
    wrong = "has no random worlds: --random is for faults, without --scene";
  } else if (b->coupling != NULL && !takes_coupling(p)) {
    wrong = "has no couplings to choose from: --coupling is for accuracy and impedance";
  } else if (b->coupling != NULL && !bench_find_coupling(b->coupling, &coupling)) {
    wrong = "takes --coupling proxy, god-object or virtual";
  } else if (b->only != NULL && p->run != bench_stability && p->run != bench_peers) {
    wrong = "has no points to choose from";
  } else if (b->estimates != NULL && p->run != bench_accuracy) {
    wrong = "has no estimates to choose from: --estimates is for accuracy";
  } else if (!known) {
    wrong = "takes --estimates all or default";
  } else if (of_accuracy && p->run != bench_accuracy) {
    wrong = "is done at once: --shard, --merge and --fresh are for accuracy";
  } else if (b->shard == BAD_SHARD) {
    wrong = "takes --shard K/N, 1 <= K <= N <= " TEXT_OF(ACCURACY_SHARDS_MAX);
  } else if (b->merge != NULL && b->merge_count == 0) {
    wrong = "--merge needs the files of the shards";
  } else if (b->merge != NULL && (b->shards > 0 || b->fresh || b->quick || b->scene != NULL ||
                                  b->coupling != NULL || b->estimates != NULL)) {
    wrong = "--merge takes all but --out and --verify from its files";
  }
  if (wrong != NULL) {
    fprintf(stderr, "hapode-bench: %s %s\n", p->name, wrong);
  }
  return wrong == NULL && b->out[0] != '\0';
}

/* False: not understood, and stderr says what. */
static bool read_arguments(int count, char **arguments, bench *b, const program **out)
{
  *out = NULL;
  for (int i = 1; i < count; ++i) {
    const char *argument = arguments[i];
    if (argument[0] == '-' ? !take_option(count, arguments, b, &i) : *out != NULL) {
      fprintf(stderr, "hapode-bench: \"%s\" is not understood\n", argument);
      return false;
    }
    if (argument[0] != '-' && (*out = find_program(argument)) == NULL) {
      fprintf(stderr, "hapode-bench: there is no bench \"%s\"\n", argument);
      return false;
    }
  }
  if (*out == NULL) {
    fprintf(stderr, "hapode-bench: which bench?\n");
    return false;
  }
  return options_fit(*out, b);
}

static int program_run(const program *p, bench *b)
{
  dInitODE2(0);
  hap_status status = p->run(b);
  dCloseODE();
  if (status < HAP_OK) {
    fprintf(stderr, "hapode-bench: %s: %s\n", p->name, b->detail.text);
    return 1;
  }
  if (b->verify) {
    bench_say("%s: %d off", p->name, b->off);
  }
  return b->off > 0 ? 1 : 0;
}

int main(int argc, char **argv)
{
  bench b = {.out = "."};
  const program *p = NULL;
  for (int i = 1; i < argc; ++i) {
    if (strcmp(argv[i], "--list") == 0 || strcmp(argv[i], "--help") == 0) {
      print_usage(stdout);
      return 0;
    }
  }
  if (!read_arguments(argc, argv, &b, &p)) {
    print_usage(stderr);
    return 2;
  }
  setvbuf(stdout, NULL, _IOLBF, 0);
  return program_run(p, &b);
}
