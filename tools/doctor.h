/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_DOCTOR_H
#define HAPODE_TOOLS_DOCTOR_H

/* Inner: what the checks of hapode-run --doctor share. */

#include <dirent.h>
#include <stdbool.h>
#include <stddef.h>

#include <hapode/attributes.h>

typedef enum doctor_state {
  DOCTOR_OK = 0,
  DOCTOR_WARNING,
  DOCTOR_PROBLEM
} doctor_state;

typedef struct doctor_check {
  doctor_state state;
  char text[1000];
  char todo[400]; /* what to type; "": nothing */
  bool measured;
  double p50_us; /* this and the next: where measured */
  double p999_us;
} doctor_check;

/* Where files are looked for: a prefix of their paths, "" outside of tests. */
typedef struct doctor_place {
  const char *root;
} doctor_place;

/* ---- what is said ---- */

HAP_PRINTF(3, 4) void doctor_say(doctor_check *check, doctor_state state, const char *format, ...);
void doctor_todo(doctor_check *check, const char *text);
/* What has no room is left out. */
void doctor_append(doctor_check *check, const char *before, const char *text);

/* ---- what is read ---- */

/* The first line of a small file, without its end; false: there is none. */
bool doctor_line(const doctor_place *place, const char *path, char *out, size_t size);
/* The rest of the line of a file that begins so. */
bool doctor_field(const doctor_place *place, const char *path, const char *name, char *out,
                  size_t size);
DIR *doctor_folder(const doctor_place *place, const char *path);
/* By its effective user. */
bool doctor_is_root(const doctor_place *place);

/* ---- the checks ---- */

/* doctor_machine.c */
void doctor_check_kernel(const doctor_place *place, doctor_check *check);
void doctor_check_rtprio(const doctor_place *place, doctor_check *check);
void doctor_check_memlock(const doctor_place *place, doctor_check *check);
void doctor_check_memory_lock(const doctor_place *place, doctor_check *check);
void doctor_check_latency(const doctor_place *place, doctor_check *check);
void doctor_check_ode(const doctor_place *place, doctor_check *check);
void doctor_check_locale(const doctor_place *place, doctor_check *check);
void doctor_check_governor(const doctor_place *place, doctor_check *check);

/* doctor_devices.c */
void doctor_check_devices(const doctor_place *place, doctor_check *check);
void doctor_check_vendors(const doctor_place *place, doctor_check *check);
void doctor_check_rules(const doctor_place *place, doctor_check *check);
void doctor_check_groups(const doctor_place *place, doctor_check *check);
void doctor_check_ports(const doctor_place *place, doctor_check *check);

#endif
