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
  hapi_feel feel;
} hapi_known_feel;

/* Zeroed it is empty. */
typedef struct hapi_feels {
  hapi_known_feel *list;
  uint32_t count;
  uint32_t capacity;
  hapi_index by_pair;
  uint32_t given; /* numbers */
  bool said_crowded;
} hapi_feels;

void hapi_feels_finish(hapi_feels *feels);
void hapi_feels_clear(hapi_feels *feels); /* a session begins */
/* The geom of that number is asked about again; 0: all are. */
void hapi_feels_renew(hapi_feels *feels, uint64_t geom);

/* *out_mu: the static friction; *out_feel: as hapi_model_contact.feel. False: the pointer goes
 * through the geom. */
bool hapi_feels_ask(hapi_nearby *nearby, uint32_t pointer, dGeomID geom, double *out_mu,
                    uint32_t *out_feel);

/* Those of the model, to the loop. */
void hapi_feels_publish(hapi_nearby *nearby, hapi_model *out);

#endif
