/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Stands in for libspnav and its daemon. STANDIN_SPNAV: "MS X Y Z RX RY RZ;..." are the deflections
 * of a cap one after the other, each for so many ms; then it is let go. Like the daemon it tells
 * changes alone. */

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define STANDIN_CALL __attribute__((visibility("default")))

STANDIN_CALL int spnav_open(void);
STANDIN_CALL int spnav_close(void);
STANDIN_CALL int spnav_poll_event(void *event);

static double begin_ms = -1.0;
static int told = -1;

static double now_ms(void)
{
  struct timespec now;
  (void)timespec_get(&now, TIME_UTC);
  return 1e3 * (double)now.tv_sec + 1e-6 * (double)now.tv_nsec;
}

int spnav_open(void)
{
  return getenv("STANDIN_SPNAV") != NULL ? 0 : -1;
}

int spnav_close(void)
{
  return 0;
}

int spnav_poll_event(void *event)
{
  struct {
    int type;
    int axes[6];
    unsigned period;
    int *data;
  } motion = {1, {0}, 8, NULL};
  const char *at = getenv("STANDIN_SPNAV");
  begin_ms = begin_ms < 0.0 ? now_ms() : begin_ms;
  double left_ms = now_ms() - begin_ms;
  int step = 0;
  for (; at != NULL; at = strchr(at, ';'), at += at != NULL, ++step) {
    double lasts_ms = 0.0;
    int *a = motion.axes;
    if (sscanf(at, "%lf %d %d %d %d %d %d", &lasts_ms, &a[0], &a[1], &a[2], &a[3], &a[4], &a[5]) ==
            7 &&
        left_ms < lasts_ms) {
      break;
    }
    left_ms -= lasts_ms;
    memset(motion.axes, 0, sizeof motion.axes);
  }
  if (step == told) {
    return 0;
  }
  told = step;
  memcpy(event, &motion, sizeof motion);
  return motion.type;
}
