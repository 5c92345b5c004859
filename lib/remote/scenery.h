/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_REMOTE_SCENERY_H
#define HAPODE_REMOTE_SCENERY_H

/* Where all bodies are, for a hand's session that draws them. Messages of channel 5, each of which
 * can be used by itself:
 *
 *   8 bytes   number of the step
 *   then for each body: 4 name, 4 birth, 3 x 4 position (float, m), 4 x 2 quaternion (of 32767)
 *
 * A body that moves is told in each step, as a newest message that may be lost. One that has come
 * to rest is told once more, reliably. After that it costs nothing. Bodies that the loop moves are
 * not told: it knows them better. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/link.h>

#include "sync/told_body.h"

#define HAPI_SCENERY_CHANNEL 5u
#define HAPI_SCENERY_HEAD 8u
#define HAPI_SCENERY_BODY 28u
#define HAPI_SCENERY_MOST ((HAP_LINK_NEWEST_MOST - HAPI_SCENERY_HEAD) / HAPI_SCENERY_BODY)

/* Bytes written. count: 1 to HAPI_SCENERY_MOST; names and births below 2^32. */
uint32_t hapi_scenery_write(uint64_t number, const hapi_told_body *bodies, uint32_t count,
                            unsigned char out[HAP_LINK_NEWEST_MOST]);
/* How many bodies; 0: it is no such message, and nothing of it is to be used. */
uint32_t hapi_scenery_read(const void *data, uint32_t bytes, uint64_t *out_number,
                           hapi_told_body out[HAPI_SCENERY_MOST]);

/* The bodies that are there, by place in a table. */
typedef struct hapi_scenery_source {
  void *of;
  uint32_t (*places)(void *of);
  void (*read)(void *of, uint32_t first, uint32_t count, hapi_told_body *out);
} hapi_scenery_source;

/* Where messages go. False: the transport did not take it. */
typedef struct hapi_scenery_out {
  void *of;
  bool (*send)(void *of, uint32_t part, bool reliable, const void *data, uint32_t bytes);
} hapi_scenery_out;

/* What a client was told of the body of a place. */
typedef struct hapi_place_told {
  hapi_told_body sent; /* name 0: it knows of none */
  uint64_t birth;      /* that it knows for sure */
  uint32_t still;      /* steps since then in which it has not moved */
  bool told;           /* it was told, and the loop has not had it since */
} hapi_place_told;

typedef struct hapi_scenery {
  hapi_place_told *of; /* by place */
  uint32_t capacity;
  uint32_t next;   /* place at which a step begins: not all bodies may find room in each */
  uint64_t number; /* of the step */
} hapi_scenery;

void hapi_scenery_reset(hapi_scenery *scenery); /* another client knows nothing */
void hapi_scenery_finish(hapi_scenery *scenery);
/* After a step. At most HAPI_SCENERY_PARTS newest messages and one reliable one. False: no memory
 * for so many bodies, and nothing is told. */
#define HAPI_SCENERY_PARTS 8u
bool hapi_scenery_step(hapi_scenery *scenery, const hapi_scenery_source *from,
                       const hapi_scenery_out *out);

#endif
