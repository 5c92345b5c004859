/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_FALSE_INPUT_H
#define HAPODE_BENCH_FALSE_INPUT_H

/* A hand presses a pointer against a wall, or against a row of cubes, and for a while its device
 * tells positions that are false. In lockstep; what comes out is the force of every tick. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/session.h>
#include <hapode/status.h>

#define FALSE_INPUT_BEGIN_S 2.0  /* of what is false */
#define FALSE_INPUT_LENGTH_S 0.2 /* so long */
#define FALSE_INPUT_END_S 2.6    /* of the run */
#define FALSE_INPUT_TOLD_S 0.02  /* from what can be seen to the flag of the guard */
#define FALSE_INPUT_HZ_MAX 10000
#define FALSE_INPUT_TICKS_MAX 26000

typedef enum false_input_kind {
  FALSE_NOTHING = 0,
  FALSE_ONE_SPIKES,  /* one string +- a spike in 5 % of the replies; virtual: one axis */
  FALSE_ALL_SPIKES,  /* all strings, each for itself; virtual: each axis */
  FALSE_SINGLE,      /* three replies alone, one string by a spike, once by 5000 counts */
  FALSE_ONE_STUCK,   /* one string; virtual: the whole pose */
  FALSE_ONE_DRIFTS,  /* one string by 0.1 m/s; virtual: one axis by 0.02 m/s */
  FALSE_BOARD_STUCK, /* one board repeats its positions; virtual: one axis */
  FALSE_ALL_STUCK,   /* all boards */
  FALSE_OLD,         /* positions of 50 ms ago in 10 % of the replies */
  FALSE_ALWAYS,      /* one string +- a spike in every reply; virtual: one axis */
  FALSE_ALL_ALWAYS,  /* all strings */
  FALSE_KINDS
} false_input_kind;

typedef enum false_input_device {
  FALSE_INPUT_SPIDAR = 0, /* emulated x4r */
  FALSE_INPUT_VIRTUAL,    /* the device virtual with a relaxed hand */
  FALSE_INPUT_COARSE,     /* the same, encoder steps of 50 um, new positions every 4 ms */
  FALSE_INPUT_DEVICES
} false_input_device;

typedef struct false_input_def {
  false_input_device device;
  false_input_kind kind;
  bool row;         /* cubes in place of the wall */
  double stiffness; /* N/m, of the contact */
  double spike;     /* m, of one string, or along an axis of the virtual device */
  uint32_t seed;
  double haptic_hz;
} false_input_def;

typedef struct false_input_run {
  int ticks;
  double force[FALSE_INPUT_TICKS_MAX][3]; /* N, on the hand */
  double pressed[FALSE_INPUT_TICKS_MAX];  /* N, of the spring at the place where the hand really is,
                                             or was in the last 8 ms; 0: the device tells often */
  uint32_t fault;                         /* hap_fault that latched */
  double fault_s;                         /* from FALSE_INPUT_BEGIN_S; < 0: none */
  double told_s;                          /* when a flag of the guard said so first; < 0: never */
  double seen_s;                          /* when seen.h shows it first; < 0: never */
  bool doubted;   /* at any time, the guard said that the device is not believed */
  char text[600]; /* of the fault */
} false_input_run;

/* Against the run without anything false. */
typedef struct false_input_figures {
  double peak;       /* N, largest force from FALSE_INPUT_BEGIN_S on */
  double peak_right; /* N, the same undisturbed */
  double share; /* largest force over what is right: peak_right, or what the hand presses; until
                        it can be seen that all positions of a slow device are false, what a hand
                        would feel that moves so */
  double step;  /* N, largest change in 2 ms */
  double step_right;
  double step_more; /* N, largest change beyond that, and beyond what such a hand makes */
} false_input_figures;

void false_input_init(false_input_def *def);
const char *false_input_name(false_input_kind kind);
const char *false_input_device_name(false_input_device device);

HAP_NODISCARD hap_status false_input_measure(const false_input_def *def, false_input_run *out,
                                             hap_detail *detail);
/* What can be seen is told in time. */
bool false_input_is_told(const false_input_run *run);
void false_input_compare(const false_input_def *def, const false_input_run *right,
                         const false_input_run *run, false_input_figures *out);

#endif
