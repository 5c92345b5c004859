/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_NEAR_FEELS_H
#define HAPODE_NEAR_FEELS_H

/* What the application has said of pairs of a pointer and a geom: it is asked once, as long as the
 * two stay near each other. */

#include <stdbool.h>
#include <stdint.h>

#include <ode/ode.h>

#include "base/index.h"
#include "sync/messages.h"

typedef struct hapi_nearby hapi_nearby;

typedef struct hapi_known_feel {
  uint64_t geom; /* its number, of geom_names.h */
  uint32_t pointer;
  uint32_t generation;
  uint32_t number; /* of the pair */
  uint64_t model;  /* newest one that it is near in */
  bool known;      /* else the application is asked again */
  bool touchable;
  bool special; /* has been other than the pointer's own, and is told to the loop */
  double reach; /* m, from which on it acts: as much farther away it is of interest */
  hapi_feel feel;
} hapi_known_feel;

/* Zeroed it is empty. */
typedef struct hapi_feels {
  hapi_known_feel *list;
  uint32_t count;
  uint32_t capacity;
  hapi_index by_pair;
  uint32_t given; /* numbers */
  double reach; /* m, the largest of the pairs near at the last step, within which all are asked */
  double reach_now; /* the same of this step, up to now */
  bool said_crowded;
  bool said_steep;
} hapi_feels;

void hapi_feels_finish(hapi_feels *feels);
void hapi_feels_clear(hapi_feels *feels); /* a session begins */
/* The geom of that number is asked about again; 0: all are. */
void hapi_feels_renew(hapi_feels *feels, uint64_t geom);

/* What is said of a pair. */
typedef struct hapi_feels_said {
  double mu;     /* static friction */
  double reach;  /* as of hapi_known_feel */
  uint32_t feel; /* as hapi_model_contact.feel */
} hapi_feels_said;

/* False: the pointer goes through the geom. */
bool hapi_feels_ask(hapi_nearby *nearby, uint32_t pointer, dGeomID geom, hapi_feels_said *out);

/* Those of the model, to the loop. */
void hapi_feels_publish(hapi_nearby *nearby, hapi_model *out);

#endif
