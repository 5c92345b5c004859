/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_WORLD_AWAKE_H
#define HAPODE_WORLD_AWAKE_H

/* Where most of a world sleeps: the few bodies whose contacts a step needs. These are the bodies
 * that are awake, and what they wake: ODE's search for islands goes on through joints to bodies
 * that sleep, and in that step those must have all of their contacts, too. */

#include <stdbool.h>
#include <stdint.h>

#include <ode/ode.h>

typedef struct hapi_world hapi_world;

#define HAPI_AWAKE_MOST 32u /* each is compared with all geoms, so that more do not pay */

typedef struct hapi_awake {
  dBodyID bodies[HAPI_AWAKE_MOST]; /* in the order in which they were found */
  uint32_t count;
  bool alone;        /* the contacts of this step are those of these bodies, and no others */
  uint32_t waits;    /* collision phases until it is tried again: they were too many */
  uint32_t failures; /* in a row, up to a few */
} hapi_awake;

/* False: too many are awake, or so few sleep that it is not worth while. After a scan. */
bool hapi_awake_begin(hapi_world *world);
uint32_t hapi_awake_find(const hapi_awake *awake, dBodyID body); /* HAPI_NONE: it is not there */
/* Once more does nothing, and NULL neither. False: there is no room. */
bool hapi_awake_add(hapi_awake *awake, dBodyID body);
/* What hangs on a body by joints that are on, contacts among them. False: there is no room. */
bool hapi_awake_add_partners(hapi_awake *awake, dBodyID body);
void hapi_awake_end(hapi_awake *awake); /* they were too many */

#endif
