/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/run_spacemouse.h"

#include <dlfcn.h>
#include <math.h>
#include <string.h>

#define FULL 350.0       /* of the daemon's numbers, at its own sensitivity */
#define MOST_EVENTS 1000 /* that are taken at once: a daemon gone mad holds no picture up */
#define EVENT_MOTION 1

/* As libspnav has it since its first version: first the type, then the axes. Newer versions have
 * more kinds of events, none of which is as large as this. */
typedef union spacemouse_event {
  struct {
    int type;
    int axes[6];
    unsigned period_ms;
    int *axes_again;
  } motion;
  int room[64];
} spacemouse_event;

void run_spacemouse_open(run_spacemouse *out)
{
  int (*open)(void) = NULL;
  memset(out, 0, sizeof *out);
  void *library = dlopen("libspnav.so.0", RTLD_NOW | RTLD_LOCAL);
  if (library == NULL) {
    return;
  }
  *(void **)&open = dlsym(library, "spnav_open");
  *(void **)&out->poll = dlsym(library, "spnav_poll_event");
  *(void **)&out->close = dlsym(library, "spnav_close");
  if (open != NULL && out->poll != NULL && out->close != NULL && open() == 0) {
    out->library = library;
  } else {
    (void)dlclose(library);
  }
}

void run_spacemouse_close(run_spacemouse *mouse)
{
  if (mouse->library != NULL) {
    (void)mouse->close();
    (void)dlclose(mouse->library);
    mouse->library = NULL;
  }
}

bool run_spacemouse_read(run_spacemouse *mouse, double out[6])
{
  spacemouse_event event;
  bool moved = false;
  for (int i = 0; mouse->library != NULL && i < MOST_EVENTS && mouse->poll(&event) != 0; ++i) {
    /* Told when it changes: the last one stays until the cap is let go. */
    for (int k = 0; event.motion.type == EVENT_MOTION && k < 6; ++k) {
      mouse->deflection[k] = fmin(fmax(event.motion.axes[k] / FULL, -1.0), 1.0);
    }
  }
  for (int k = 0; k < 6; ++k) {
    out[k] = k == 5 ? -mouse->deflection[k] : mouse->deflection[k];
    moved = moved || out[k] != 0.0;
  }
  return moved;
}
