/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_CONTACT_PLACES_H
#define HAPODE_CONTACT_PLACES_H

/* Where bodies and geoms are in a contact pass. */

#include <stdbool.h>
#include <stdint.h>

#include "sync/messages.h"
#include "sync/touch_local.h"

/* By slot. */
typedef struct hapi_pass_body {
  uint32_t generation;
  bool known;
  bool told;     /* in this pass: pose and twist */
  uint64_t stay; /* the same while no bit of the pose changes; 0: none yet */
  hap_pose pose;
  hap_twist twist;
  double spin; /* rad/s */
} hapi_pass_body;

/* What follows from a geom of a near message, wherever its body is. */
typedef struct hapi_geom_trait {
  uint64_t stamp;   /* of all that decides its contacts, but for the pose of its body */
  double extent;    /* m, from the origin of its body to the farthest point; static world: 0 */
  double center[3]; /* m, body frame, of a ball that holds it */
  double radius;    /* m, of that ball; infinite: of a plane */
} hapi_geom_trait;

typedef struct hapi_places {
  hapi_near *near;   /* newest one that the loop is ready for; NULL: none yet */
  hapi_poses *poses; /* NULL: none yet */
  hapi_pass_body *bodies;
  hapi_geom_trait *geoms; /* of the near message */
  uint64_t stays;
  uint32_t body_capacity;
  double seconds; /* from the poses of a pass to the last use of its contacts */
} hapi_places;

typedef struct hapi_placed_geom {
  const hapi_near_geom *in;
  const hapi_pass_body *body; /* NULL: static world */
  hapi_shape shape;
  hap_pose pose;
} hapi_placed_geom;

/* False: no memory; finish is due all the same. */
bool hapi_places_create(hapi_places *places, const hapi_capacity *capacity);
void hapi_places_finish(hapi_places *places); /* also of a zeroed one */
void hapi_places_begin(hapi_places *places);  /* forgets all messages */

void hapi_places_take_near(hapi_places *places, hapi_near *near);
/* From both messages, at a pass's begin. */
void hapi_places_set_bodies(hapi_places *places);

/* Index: of a geom of the near message. False: of a body that is not where the pass knows. */
bool hapi_places_geom(const hapi_places *places, uint32_t index, hapi_placed_geom *out);
/* The body of a geom; NULL: the static world. False as above. */
bool hapi_places_body(const hapi_places *places, uint32_t index, const hapi_pass_body **out);

/* m: two geoms, with these bodies, are not nearer than this; may be negative. */
double hapi_places_clear(const hapi_places *places, const hapi_near_pair *pair,
                         const hapi_pass_body *a, const hapi_pass_body *b);

hapi_touch_side hapi_placed_side(const hapi_placed_geom *geom);

/* What moves, and how far it reaches about the origin of its body. */
typedef struct hapi_mover {
  const double *linear; /* m/s */
  double spin;          /* rad/s */
  double extent;        /* m */
} hapi_mover;

hapi_mover hapi_places_mover(const hapi_pass_body *body, double extent); /* NULL: static world */

/* m, along the normal: how far surfaces may come nearer until the contacts are found anew. */
double hapi_places_margin(const hapi_places *places, hapi_mover a, hapi_mover b);

/* m, the part of every margin that no motion needs. */
#define HAPI_MARGIN_FLOOR 0.002

#endif
