/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "sync/texture.h"

#include "base/alloc.h"

hapi_textures *hapi_textures_create(void)
{
  hapi_textures *textures = hapi_alloc(sizeof *textures);
  if (textures != NULL) {
    pthread_mutex_init(&textures->lock, NULL);
    atomic_init(&textures->count, 0u);
  }
  return textures;
}

void hapi_textures_destroy(hapi_textures *textures)
{
  if (textures == NULL) {
    return;
  }
  for (uint32_t i = 0; i < HAPI_TEXTURES; ++i) {
    hapi_free((void *)(uintptr_t)textures->of[i].heights);
  }
  pthread_mutex_destroy(&textures->lock);
  hapi_free(textures);
}
