/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_TEXTURE_H
#define HAPODE_LOCAL_TEXTURE_H

#include "sync/texture.h"

/* What functions take that say heights, each at the texture's number - 1. */
typedef struct hapi_texture_calls {
  int64_t (*clock)(void); /* ns; NULL: nobody measures */
  uint64_t out;           /* a bit each: not called any more, and felt as smooth */
  uint64_t called;        /* a bit each: since the caller has looked; then how long: */
  int64_t spent_ns[HAPI_TEXTURES];
} hapi_texture_calls;

static inline uint64_t hapi_texture_bit(uint32_t number)
{
  return (uint64_t)1 << (number - 1);
}

/* Two unit vectors at right angles, across the normal. */
void hapi_texture_tangents(const double normal[3], double out[2][3]);

/* m, at a point of the geom's frame. out_slope: its gradient; of the normal's direction, unit, it
 * may have any part. */
double hapi_texture_height(const hapi_texture *t, const double point[3], const double normal[3],
                           double out_slope[3]);

/* The time between the two counts for the texture of that number, if it is a function. */
int64_t hapi_texture_begin(const hapi_texture_calls *calls, const hapi_texture *t);
void hapi_texture_end(hapi_texture_calls *calls, const hapi_texture *t, uint32_t number,
                      int64_t begin_ns);

#endif
