/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* hapode-bench NAME [--out DIR] [--quick] [--verify] [--scene SCENE] [--only FILTER] [--coupling NAME]: measures,
 * writes NAME.csv and NAME.svg. Exit 0: done, 1: failed or --verify found something off, 2: usage. */

#include <string.h>

#include <ode/ode.h>

#include "bench/bench.h"

typedef struct program {
  const char *name;
  bench_fn run;
  const char *text;
} program;

static const program programs[] = {
    {"accuracy", bench_accuracy,
     "what accuracy costs in time; --scene NAME: of one scene alone; --coupling NAME: through it "
     "too"},
    {"couplings", bench_couplings,
     "direct and proxy against god-object and virtual coupling: force, depth, stability, drag"},
    {"edits", bench_edits,
     "a world that threads change all the time under sixteen hands: ticks, steps, waits, forces"},
    {"effects", bench_effects,
     "what each effect costs in a scene, and everything on against all left to the library; "
     "--scene NAME"},
    {"fig5", bench_fig5, "the paper's Fig. 5: force of a cube that runs into a fixed pointer"},
    {"fig6", bench_fig6, "the paper's Fig. 6: duty factors while one cube is pushed"},
    {"fig7", bench_fig7, "the paper's Fig. 7: duty factors while ten cubes are pushed, and more"},
    {"impedance", bench_impedance,
     "what the hand feels at the port from 0.5 to 200 Hz, and the stiffest wall of each device; "
     "--coupling\n"
     "             NAME: through it in the proxy's place"},
    {"jitter", bench_jitter,
     "how late the haptic thread wakes up, against cyclictest; page faults, context switches"},
    {"line", bench_line, "a SPIDAR at 1 kHz through its emulator: ticks without a new answer"},
    {"poses", bench_poses,
     "what is drawn at 90 Hz against where the loop had hand and bodies; cost of a call"},
    {"scaling", bench_scaling, "world size: one neighbour among up to 1000 resting cubes"},
    {"spidar", bench_spidar,
     "string devices: poses from rounded counts, tensions, times; numerics alone, no device"},
    {"stability", bench_stability,
     "where each integrator holds: stiffness, mass, contacts at once; --only KEY=VALUE/VALUE,...: "
     "of "
     "such points alone, by the names of the table"},
    {"tick", bench_tick,
     "the haptic loop alone: time of a tick; --scene NAME: of one case with contacts"},
};

#define PROGRAM_COUNT (sizeof programs / sizeof programs[0])

static void print_usage(FILE *to)
{
  fprintf(
      to,
      "usage: hapode-bench NAME [--out DIR] [--quick] [--verify] [--scene SCENE] [--only FILTER]\n"
      "                    [--coupling NAME]\n"
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

static bool takes_coupling(const program *p, const char *name)
{
  hap_coupling coupling;
  return (p->run == bench_accuracy || p->run == bench_impedance) &&
         bench_find_coupling(name, &coupling);
}

/* False: not understood, and stderr says what. */
static bool read_arguments(int count, char **arguments, bench *b, const program **out)
{
  *out = NULL;
  for (int i = 1; i < count; ++i) {
    const char *argument = arguments[i];
    if (strcmp(argument, "--quick") == 0) {
      b->quick = true;
    } else if (strcmp(argument, "--verify") == 0) {
      b->verify = true;
    } else if (strncmp(argument, "--out=", 6) == 0) {
      b->out = argument + 6;
    } else if (strcmp(argument, "--out") == 0 && i + 1 < count) {
      b->out = arguments[++i];
    } else if (strcmp(argument, "--scene") == 0 && i + 1 < count) {
      b->scene = arguments[++i];
    } else if (strcmp(argument, "--only") == 0 && i + 1 < count) {
      b->only = arguments[++i];
    } else if (strcmp(argument, "--coupling") == 0 && i + 1 < count) {
      b->coupling = arguments[++i];
    } else if (argument[0] == '-' || *out != NULL) {
      fprintf(stderr, "hapode-bench: \"%s\" is not understood\n", argument);
      return false;
    } else if ((*out = find_program(argument)) == NULL) {
      fprintf(stderr, "hapode-bench: there is no bench \"%s\"\n", argument);
      return false;
    }
  }
  if (*out == NULL) {
    fprintf(stderr, "hapode-bench: which bench?\n");
  } else if (b->scene != NULL && (*out)->run != bench_accuracy && (*out)->run != bench_effects &&
             (*out)->run != bench_tick) {
    fprintf(stderr, "hapode-bench: %s has no scenes to choose from\n", (*out)->name);
    return false;
  }
  if (*out != NULL && b->coupling != NULL && !takes_coupling(*out, b->coupling)) {
    fprintf(
        stderr,
        "hapode-bench: --coupling is proxy, god-object or virtual, for accuracy and impedance\n");
    return false;
  }
  if (*out != NULL && b->only != NULL && (*out)->run != bench_stability) {
    fprintf(stderr, "hapode-bench: %s has no points to choose from\n", (*out)->name);
    return false;
  }
  return *out != NULL && b->out[0] != '\0';
}

static int run(const program *p, bench *b)
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
  if (argc == 2 && (strcmp(argv[1], "--list") == 0 || strcmp(argv[1], "--help") == 0)) {
    print_usage(stdout);
    return 0;
  }
  if (!read_arguments(argc, argv, &b, &p)) {
    print_usage(stderr);
    return 2;
  }
  setvbuf(stdout, NULL, _IOLBF, 0);
  return run(p, &b);
}
