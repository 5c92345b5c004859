/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "plugins/common/claims.h"

#include <pthread.h>
#include <stdio.h>
#include <string.h>

#define CLAIMS_MAX 64
#define KEY_MAX 96

static struct {
  pthread_mutex_t lock;
  struct {
    const void *owner; /* NULL: free */
    char key[KEY_MAX];
  } of[CLAIMS_MAX];
} claims = {.lock = PTHREAD_MUTEX_INITIALIZER};

bool hapi_claim(const void *owner, const char *key)
{
  char wanted[KEY_MAX];
  int place = -1;
  bool taken = false;
  snprintf(wanted, sizeof wanted, "%s", key);
  pthread_mutex_lock(&claims.lock);
  for (int i = 0; i < CLAIMS_MAX; ++i) {
    bool used = claims.of[i].owner != NULL;
    taken = taken || (used && strcmp(claims.of[i].key, wanted) == 0);
    place = !used && place < 0 ? i : place;
  }
  if (!taken && place >= 0) {
    claims.of[place].owner = owner;
    memcpy(claims.of[place].key, wanted, sizeof wanted);
  }
  pthread_mutex_unlock(&claims.lock);
  return !taken && place >= 0;
}

void hapi_unclaim(const void *owner)
{
  pthread_mutex_lock(&claims.lock);
  for (int i = 0; i < CLAIMS_MAX; ++i) {
    claims.of[i].owner = claims.of[i].owner == owner ? NULL : claims.of[i].owner;
  }
  pthread_mutex_unlock(&claims.lock);
}
