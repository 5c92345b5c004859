/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_ACCURACY_H
#define HAPODE_BENCH_ACCURACY_H

/* hapode-bench accuracy: runs and the comparison of two (accuracy_run.c), what is measured
 * (accuracy_plan.c), rows as text and in files (accuracy_rows.c), the measurement, what is worth
 * its time, and the picture (accuracy.c). */

#include <stdint.h>

#include "bench/bench.h"
#include "bench/joint_gauge.h"
#include "tools/rig.h"

#define ACCURACY_HAPTIC_HZ 1000.0
#define ACCURACY_SPEC_MAX 1024
#define ACCURACY_STARTS_MAX 10
#define ACCURACY_SCENES_MAX 32
#define ACCURACY_NAME_MAX 16
#define ACCURACY_SHARDS_MAX 10000

/* ---- accuracy_run.c: scenes ---- */

typedef struct accuracy_scene {
  const char *name;      /* in the table of results */
  const char *base;      /* in the table of the scenes */
  int count;             /* N of the scene; 0: its own */
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

/* ---- accuracy_run.c: runs ---- */

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
  double used_s;              /* of the processor, for all that was computed */
  hap_stats stats;
} accuracy_motion;

typedef struct accuracy_run_def {
  const scene_parameters *parameters; /* shift as it shall be */
  const char *hands[SCENE_POINTERS_MAX];
  double seconds;
  hap_session_def session; /* drive, guard and trace are those of the bench */
  hap_expert_def expert;
  hap_research_def research;
  hap_coupling coupling;     /* default: direct */
  double coupling_stiffness; /* N/m */
  double coupling_damping;   /* N s/m */
  hap_integration integration;
  int32_t iterations; /* of QuickStep; 0: the scene's */
  /* Before the session starts; NULL: nothing is to be done then. */
  hap_status (*join)(void *user, hap_session *session);
  void *join_user;
} accuracy_run_def;

void accuracy_run_def_init(accuracy_run_def *def); /* the library's defaults */
hap_status accuracy_run(bench *b, const accuracy_run_def *def, accuracy_motion *out);
void accuracy_motion_free(accuracy_motion *m); /* zeroed allowed */

/* ---- accuracy_run.c: comparison ---- */

typedef struct accuracy_errors {
  double force;         /* RMS of the difference / RMS of the reference, while either touches */
  double torque;        /* the same; 0: the hands feel none */
  double impulse_ratio; /* sums of the forces' norms */
  double peak_ratio;
  double pose_max;    /* m, over the bodies while the loop moves them */
  double pose_median; /* m */
  double line_n;      /* N, largest line of the difference at the physics rate or 5 harmonics,
                           above what is half way to the next ones and what the control has */
  double lines;       /* 1: contact is long enough to tell one */
  double force_rms;   /* N, of the reference while either touches */
  double joint_loop;  /* m, the widest joint of the test itself, as in accuracy_motion */
  double joint_world; /* m */
  double joint_left;  /* m */
  double joint_turn;  /* rad, of those that the loop moves, in either world */
} accuracy_errors;

/* control: as test, at another physics rate; may be NULL. False: nothing is touched in the
 * reference, or no memory. */
bool accuracy_compare(const accuracy_motion *reference, const accuracy_motion *test,
                      const accuracy_motion *control, double physics_hz, accuracy_errors *out);

double accuracy_hand_speed(const accuracy_motion *m); /* m/s, the largest */

/* Share of the ticks with contact in which no hand moves faster than 1 % of that. */
double accuracy_rest_share(const accuracy_motion *m);

/* ---- accuracy_plan.c ---- */

/* As in the table of the scenes, which has its base. */
scene_parameters accuracy_parameters(const accuracy_scene *which);

/* Knobs whose name says it all; their value is 0. */
#define ACCURACY_DEFAULT "default"
#define ACCURACY_EQ4 \
  "eq4" /* model accelerance: the default's probes, from the starts of the others */
#define ACCURACY_PAPER "paper" /* four testing simulations for each neighbour */
#define ACCURACY_OPERATING "operating"
#define ACCURACY_CROSS "operating_cross" /* with cross accelerance as well */
#define ACCURACY_DIAL "dial"             /* a row of the path of a setting of all knobs at once */
#define ACCURACY_SPEED "hand_speed"
#define ACCURACY_AGE "model_age"

#define ACCURACY_PAPER_HZ 20.0   /* the paper's physics rate */
#define ACCURACY_DEFAULT_HZ 60.0 /* the library's */

/* A row of the table that is to be measured. */
typedef struct accuracy_point {
  char knob[ACCURACY_NAME_MAX];
  double value;
  double physics_hz; /* as the table says it: of model SINGLE the loop's rate */
  bool all_starts;   /* else the first one */
  accuracy_run_def def;
} accuracy_point;

/* Points that are held against the same references. */
typedef struct accuracy_group {
  const accuracy_scene *scene;
  double physics_hz; /* what soft constraints of the references are converted from */
  double hand_speed; /* m/s; 0: as the scene has it */
  size_t first;      /* of the points */
  size_t count;
  double cost; /* about proportional to the time that it takes */
} accuracy_group;

typedef struct accuracy_plan {
  accuracy_group *groups;
  size_t group_count;
  size_t group_capacity;
  accuracy_point *points;
  size_t count;
  size_t capacity;
  bool quick;
  bool estimates_all;
} accuracy_plan;

/* All rows of these scenes, in the order of the table. */
hap_status accuracy_plan_make(bench *b, const accuracy_scene *const *scenes, size_t count,
                              accuracy_plan *out);
void accuracy_plan_free(accuracy_plan *plan); /* zeroed allowed */

bool accuracy_estimates_all(const bench *b); /* else beside the default alone */

bool accuracy_knob_has_value(const char *knob); /* else its name says it all */

/* Starts of a scene: indices of the offsets of accuracy_start. */
size_t accuracy_starts(const accuracy_scene *which, bool quick, size_t out[ACCURACY_STARTS_MAX]);
double accuracy_start(size_t index); /* m */

/* QuickStep iterations of the scene's references. */
int accuracy_reference_iterations(const scene_parameters *p);

double accuracy_seconds(const accuracy_scene *which, bool quick); /* of a run */

/* About proportional to the time of a row. The first one of a group makes the references. */
double accuracy_point_cost(const accuracy_plan *plan, const accuracy_group *group,
                           const accuracy_point *point);

/* Which of so many shards, from 0, measures each group: none has much more to do than another one.
 * out: group_count. */
hap_status accuracy_deal(bench *b, const accuracy_plan *plan, size_t shards, size_t *out);

uint64_t accuracy_plan_hash(const accuracy_plan *plan);

/* ---- accuracy_rows.c: a row ---- */

typedef struct accuracy_row {
  char scene[ACCURACY_NAME_MAX];
  char knob[ACCURACY_NAME_MAX];
  char model[ACCURACY_NAME_MAX];
  double physics_hz;
  double value; /* of the knob: Hz, s or m/s; 0 for "default" */
  accuracy_errors errors;
  double tick_us;
  double physics_ms;
  double duty; /* computing time of all threads / simulated time */
  double haptic_hz;
  double noise_floor;
  double torque_floor; /* the same of the torque */
  double estimate;     /* of errors.force, from the worst start, by the session itself; 0: none */
  char hand[ACCURACY_NAME_MAX];
  double hand_speed;
  double rest_share;
  double joint_floor; /* m, the widest joint of the references */
  double start_um;    /* the worst start */
  double starts;      /* how many */
  double first_force; /* errors.force from the first start alone */
  double front;       /* 1: nothing of its scene is as good in less time */
} accuracy_row;

typedef struct accuracy_table {
  accuracy_row *rows;
  size_t count;
  size_t capacity;
} accuracy_table;

hap_status accuracy_table_add(bench *b, accuracy_table *table, const accuracy_row *row);
void accuracy_table_free(accuracy_table *table); /* zeroed allowed */

void accuracy_write_header(FILE *csv);
void accuracy_write_row(FILE *csv, const accuracy_row *row);

/* How many rows from the first on are of its scene. */
size_t accuracy_rows_of_scene(const accuracy_table *table, size_t first);

bool accuracy_row_is(const accuracy_row *row, hap_model model, const char *knob);

/* ---- accuracy_rows.c: the file ---- */

/* The file of finished rows. Its head says of which build, settings and shard it is; the rows
 * are in the order in which they were finished. */
typedef struct accuracy_identity {
  char build[40];     /* of program, library and ODE */
  char settings[200]; /* what was asked for */
  char machine[80];   /* whose times these are */
  size_t rows;        /* of the plan */
  size_t shard;       /* 1 .. shards */
  size_t shards;
} accuracy_identity;

hap_status accuracy_identify(bench *b, const accuracy_plan *plan, accuracy_identity *out);

/* "K/N" of a shard, 1 <= K <= N. */
bool accuracy_read_shard(const char *text, size_t *shard, size_t *shards);

/* rows: by point of the plan, which is the file's. What is not in the file stays as it is. A
 * last line that breaks off is left out. HAP_ERROR_FORMAT with a text. */
hap_status accuracy_rows_read(bench *b, const char *path, const accuracy_plan *plan,
                              accuracy_row *rows);

/* Opens the run's file, new or to go on with: then its rows are in have. Nobody else has it
 * open. */
hap_status accuracy_rows_open(bench *b, const accuracy_plan *plan,
                              const accuracy_identity *identity, accuracy_row *have, int *out_file);

/* One write, so that several processes can do it. */
hap_status accuracy_rows_append(bench *b, int file, const accuracy_row *row);

/* Path of the run's file. */
bool accuracy_rows_path(const bench *b, const accuracy_identity *identity, char *out, size_t size);

/* ---- accuracy_rows.c: files of several machines ---- */

typedef struct accuracy_settings {
  bool quick;
  char scene[32];    /* "all": every one */
  char coupling[32]; /* "none" */
  char estimates[8]; /* all, default */
} accuracy_settings;

/* What the first of the files b->merge was run with. */
hap_status accuracy_merge_settings(bench *b, accuracy_settings *out);

/* The rows of the files b->merge, which are all shards of one run. */
hap_status accuracy_merge(bench *b, const accuracy_plan *plan, accuracy_row *rows);

#endif
