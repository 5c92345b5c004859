/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SYNC_TEXTURE_H
#define HAPODE_SYNC_TEXTURE_H

/* Reliefs of surfaces. The session makes and keeps them until it is destroyed; what there is never
 * changes, so all threads read it. */

#include <pthread.h>
#include <stdatomic.h>
#include <stdint.h>

#include <hapode/surface.h>

typedef struct hapi_texture {
  const double *heights; /* rows x columns, m; NULL: the function */
  uint32_t columns;
  uint32_t rows;
  double per_m; /* samples a metre */
  uint32_t repeats;
  double along[2][3]; /* unit, geom's frame: of columns and rows */
  double origin[3];   /* m, geom's frame: of the first sample */
  hap_height_fn height;
  void *arg;
  int64_t most_ns; /* that the calls of a tick may take */
} hapi_texture;

#define HAPI_TEXTURES 64u

typedef struct hapi_textures {
  pthread_mutex_t lock; /* of those who add */
  _Atomic uint32_t count;
  hapi_texture of[HAPI_TEXTURES];
} hapi_textures;

hapi_textures *hapi_textures_create(void); /* NULL: no memory */
void hapi_textures_destroy(hapi_textures *textures);

/* By its public number; NULL: there is none. */
static inline const hapi_texture *hapi_texture_find(const hapi_textures *textures, uint32_t number)
{
  uint32_t count = atomic_load_explicit(&textures->count, memory_order_acquire);
  return number > 0 && number <= count ? &textures->of[number - 1] : NULL;
}

#endif
