/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_RECORDED_HAND_H
#define HAPODE_TESTS_RECORDED_HAND_H

/* Motion of real hands, as files of HAPODE_SHARED/data have it: rows of a time [s] and a place [m].
 * Include after tap.h. */

#include <dirent.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define RECORDED_HAND_ROWS 12000

typedef struct recorded_hand {
  DIR *folder;
  char path[1000];
  const char *name; /* of the file */
  int rows;
  int row; /* in which recorded_hand_at was last */
  double t[RECORDED_HAND_ROWS];
  double x[RECORDED_HAND_ROWS][3];
} recorded_hand;

static recorded_hand played;

/* False: there are no recordings. */
static inline bool recorded_hands_open(void)
{
  const char *shared = getenv("HAPODE_SHARED");
  snprintf(played.path, sizeof played.path, "%s/data", shared != NULL ? shared : ".");
  played.folder = opendir(played.path);
  return played.folder != NULL;
}

static inline void recorded_hand_load(void)
{
  char line[512];
  char path[1400];
  snprintf(path, sizeof path, "%s/%s", played.path, played.name);
  FILE *file = fopen(path, "r");
  REQUIRE(file != NULL);
  played.rows = played.row = 0;
  while (fgets(line, sizeof line, file) != NULL && played.rows < RECORDED_HAND_ROWS) {
    double *x = played.x[played.rows];
    played.rows +=
        sscanf(line, "%lf,%lf,%lf,%lf", &played.t[played.rows], &x[0], &x[1], &x[2]) == 4;
  }
  fclose(file);
  REQUIRE(played.rows > 100);
}

/* The next recording; false: there is no more, and the folder is closed. */
static inline bool recorded_hands_next(void)
{
  const struct dirent *entry;
  while ((entry = readdir(played.folder)) != NULL) {
    if (strstr(entry->d_name, ".csv") != NULL) {
      played.name = entry->d_name;
      recorded_hand_load();
      return true;
    }
  }
  closedir(played.folder);
  return false;
}

/* s, between which recorded_hand_at has places. */
static inline double recorded_hand_begin(void)
{
  played.row = 0;
  return played.t[1];
}

static inline double recorded_hand_end(void)
{
  return played.t[played.rows - 3];
}

/* By cubics through the rows; times go on from recorded_hand_begin. */
static inline void recorded_hand_at(double t, double out[3])
{
  while (played.row < played.rows - 3 && played.t[played.row + 1] <= t) {
    ++played.row;
  }
  int i = played.row > 0 ? played.row : 1;
  double h = played.t[i + 1] - played.t[i];
  double u = (t - played.t[i]) / h;
  for (int k = 0; k < 3; ++k) {
    double slope[2];
    for (int side = 0; side < 2; ++side) {
      int at = i + side;
      slope[side] =
          h * (played.x[at + 1][k] - played.x[at - 1][k]) / (played.t[at + 1] - played.t[at - 1]);
    }
    double a = played.x[i][k];
    double c = played.x[i + 1][k] - a;
    out[k] = a + u * (slope[0] + u * ((3.0 * c - 2.0 * slope[0] - slope[1]) +
                                      u * (slope[0] + slope[1] - 2.0 * c)));
  }
}

#endif
