/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_RUN_OPTIONS_H
#define HAPODE_TOOLS_RUN_OPTIONS_H

/* The command line of hapode-run. */

#include <stdio.h>

#include "tools/conform/conform.h"
#include "tools/rig.h"
#include "tools/run_effects.h"
#include "tools/run_keys.h"

typedef enum run_action {
  RUN_SESSION = 0,
  RUN_LIST,
  RUN_PROBE, /* a list for which serial ports are asked */
  RUN_DOCTOR,
  RUN_HELP,
  RUN_VERSION
} run_action;

/* Pictures of the run. */
typedef struct run_shot_options {
  const char *path;   /* of --shot; NULL: none */
  const char *frames; /* folder of --frames; NULL: none */
  double at;          /* s, of --shot; negative: when the force is strongest */
  int size[2];        /* px */
  bool camera_given;
  double camera[6]; /* m: eye, then what it looks at */
} run_shot_options;

/* A window on the run. */
typedef struct run_window_options {
  bool wanted;
  run_keys keys;
  bool keys_given;
  struct run_stage *stage; /* of the window that is open; NULL: none */
} run_window_options;

/* Beside the files. */
typedef struct run_recording_options {
  double limit_mib; /* of --record; 0: the default */
  bool incomplete;  /* --play of a file that breaks off */
} run_recording_options;

/* A world in another process. */
typedef struct run_far_options {
  const char *serve;        /* name of the world; NULL: not */
  const char *connect;      /* likewise */
  const char *name;         /* of the hand; NULL: the default */
  const char *certificates; /* folder; NULL: none */
  const char *interface_name;
  const char *peers;
  int32_t domain; /* negative: the default */
  bool insecure;
  bool shown; /* bodies are drawn */
} run_far_options;

typedef struct run_options {
  run_action action;
  bool json; /* of RUN_DOCTOR */
  run_far_options far;
  rig_options rig;
  bool strict; /* of a file: what would be left out is refused */
  bool coupling_given;
  double seconds;     /* 0: as long as the scene says */
  double model_age_s; /* negative: not given */
  double lookback;    /* likewise */
  bool reconnect;     /* start a lost device again */
  const char *trace_path;
  const char *plot_path;
  const char *black_box_path;
  run_shot_options shot;
  const char *html_path; /* of --html; NULL: none */
  run_window_options window;
  const char *identify_path;  /* not NULL: identify the device, no session */
  const char *calibrate_path; /* not NULL: calibrate the device, no session */
  conform_options check;      /* spec not NULL: check that device, no session */
  run_effects effects;
  bool effects_table; /* why, and what they cost */
  const char *record_path;
  const char *play_path; /* not NULL: no devices, all from the file */
  run_recording_options recording;
  const char *not_beside_play; /* first option given that the file answers itself; NULL: none */
} run_options;

/* Fills *out. On failure the detail text names the option and what it may be. */
hap_status run_options_parse(int argc, char **argv, run_options *out, hap_detail *detail);

void run_options_help(FILE *out);

#endif
