/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_ACCURACY_H
#define HAPODE_BENCH_ACCURACY_H

/* The parts of hapode-bench accuracy: what is measured (accuracy_scenes.c), one run
 * (accuracy_run.c), two runs side by side (accuracy_error.c), all runs of a scene
 * (accuracy_sweep.c), scenes side by side (accuracy_jobs.c), picture, numbers with a bound. */

#include <stdint.h>

#include "bench/bench.h"
#include "bench/joint_gauge.h"
#include "tools/rig.h"

#define ACCURACY_HAPTIC_HZ 1000.0
#define ACCURACY_SPEC_MAX 1024
#define ACCURACY_STARTS_MAX 10
#define ACCURACY_SCENES_MAX 32

/* ---- accuracy_scenes.c ---- */

typedef struct accuracy_scene {
  const char *name;      /* in the table of results */
  const char *base;      /* in the table of the scenes */
  const char *recording; /* file of HAPODE_SHARED/data that moves the hand; NULL: the scene's own */
  double seconds;        /* of the window; 0: the scene's own */
  double seconds_quick;  /* 0: the same */
  double bound;      /* error of force and torque of model contact at 20 Hz; at 60 Hz half of it */
  int starts_quick;  /* a long run at 1000 iterations is dear; 0: all */
  double start_most; /* m: from farther off it is another scene; 0: all starts */
  bool speeds;       /* the hand's motion can be made faster and slower */
  bool rests;        /* the hand hardly moves: that is the scene */
} accuracy_scene;

const accuracy_scene *accuracy_scene_at(size_t index); /* NULL past the end */

/* The spec of a simulated hand with its path stretched in time, as a hand that yields to nothing
 * and a device without limit. False: too long, or not understood. */
bool accuracy_hand(const char *spec, double stretch, char *out, size_t size);

/* The spec of the recorded hand; HAP_ERROR_NOT_FOUND without the file. */
hap_status accuracy_recorded_hand(bench *b, const accuracy_scene *which, char *out, size_t size);

/* ---- accuracy_run.c ---- */

typedef struct accuracy_frame {
  double force[SCENE_POINTERS_MAX][3];  /* N, on the hands */
  double torque[SCENE_POINTERS_MAX][3]; /* N m, likewise */
  double hand[SCENE_POINTERS_MAX][3];   /* m */
  double body[HAP_TRACE_BODIES_MAX][3];
  uint32_t local; /* bit k: the loop moves body k itself */
} accuracy_frame;

typedef struct accuracy_motion {
  accuracy_frame *frames; /* at 1 kHz, whatever the loop's own rate */
  size_t count;
  size_t bodies;
  double deepest; /* m, that a pointer was in a body */
  size_t joints;
  joint_opening joints_loop;  /* the widest at any tick, between bodies that the loop moves */
  joint_opening joints_world; /* of the same in ODE's world */
  joint_opening joints_left;  /* in ODE's world, of the others: ODE alone moves them */
  hap_stats stats;
} accuracy_motion;

typedef struct accuracy_run_def {
  const scene_parameters *parameters; /* shift and iterations as they shall be */
  const char *hands[SCENE_POINTERS_MAX];
  double seconds;
  hap_model model;
  double physics_hz;
  double haptic_hz; /* a multiple of 1 kHz */
  double contact_hz;
  int latency_ticks;
  hap_probe probe;
  hap_effect_wish cross;
  hap_coupling coupling;     /* default: direct */
  double coupling_stiffness; /* N/m */
  double coupling_damping;   /* N s/m */
} accuracy_run_def;

void accuracy_run_def_init(accuracy_run_def *def); /* the library's defaults */
hap_status accuracy_run(bench *b, const accuracy_run_def *def, accuracy_motion *out);
void accuracy_motion_free(accuracy_motion *m); /* zeroed allowed */

/* ---- accuracy_error.c ---- */

typedef struct accuracy_errors {
  double force;         /* RMS of the difference / RMS of the reference, while either touches */
  double torque;        /* the same; 0: the hands feel none */
  double impulse_ratio; /* sums of the forces' norms */
  double peak_ratio;
  double pose_max;    /* m, over the bodies while the loop moves them */
  double pose_median; /* m */
  double line_n;      /* N, largest line of the difference at the physics rate or 5 harmonics,
                           above what is half way to the next ones and what the control has */
  bool lines;         /* contact is long enough to tell one */
  double force_rms;   /* N, of the reference while either touches */
  double joint_loop;  /* m, the widest joint of the test itself, as in accuracy_motion */
  double joint_world; /* m */
  double joint_left;  /* m */
  double joint_turn;  /* rad, of those that the loop moves, in either world */
} accuracy_errors;

/* control: as test, at another physics rate; may be NULL. False: nothing is touched in the reference,
 * or no memory. */
bool accuracy_compare(const accuracy_motion *reference, const accuracy_motion *test,
                      const accuracy_motion *control, double physics_hz, accuracy_errors *out);

double accuracy_hand_speed(const accuracy_motion *m); /* m/s, the largest */

/* Share of the ticks with contact in which no hand moves faster than 1 % of that. */
double accuracy_rest_share(const accuracy_motion *m);

/* ---- accuracy_sweep.c ---- */

/* Knobs of model accelerance: its ways of testing. */
#define ACCURACY_EQ4 "eq4" /* the default's, from the starts of the other two */
#define ACCURACY_OPERATING "operating"
#define ACCURACY_CROSS "operating_cross" /* with cross accelerance as well */

typedef struct accuracy_row {
  char scene[16];
  char knob[16];
  hap_model model;
  double physics_hz;
  double value; /* of the knob: Hz, s or m/s; 0 for "default" */
  accuracy_errors errors;
  double tick_us;
  double physics_ms;
  double duty; /* computing time of all threads / simulated time */
  double haptic_hz;
  double noise_floor;
  double torque_floor; /* the same of the torque */
  char hand[16];
  double hand_speed;
  double rest_share;
  double start_um; /* the worst start */
  double bound;    /* on errors.force and .torque; 0: none */
  size_t joints;
  double joint_floor; /* m, the widest joint of the references */
} accuracy_row;

typedef struct accuracy_table {
  accuracy_row *rows;
  size_t count;
  size_t capacity;
} accuracy_table;

hap_status accuracy_table_add(bench *b, accuracy_table *table, const accuracy_row *row);
void accuracy_table_free(accuracy_table *table); /* zeroed allowed */

/* Adds all rows of a scene. */
hap_status accuracy_sweep(bench *b, const accuracy_scene *which, accuracy_table *table);

/* ---- accuracy_jobs.c ---- */

/* The sweeps of these scenes, each in a process of its own and as many at a time as there are
 * processors; rows in the order of the scenes. */
hap_status accuracy_jobs(bench *b, const accuracy_scene *const *scenes, size_t count,
                         accuracy_table *table);

/* ---- accuracy_hold.c, accuracy_picture.c ---- */

/* A hand that rests on a stack for 10 s: force of model contact against dWorldStep. */
hap_status accuracy_check_hold(bench *b);

hap_status accuracy_draw(bench *b, const accuracy_table *table);

#endif
