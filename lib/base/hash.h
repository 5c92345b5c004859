/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_HASH_H
#define HAPODE_BASE_HASH_H

#include <stdint.h>
#include <string.h>

#include <hapode/spatial.h>

#define HAPI_HASH_BEGIN 0xcbf29ce484222325u

/* FNV-1a over 64-bit words: cheap, and any changed bit changes it. */
static inline uint64_t hapi_hash_word(uint64_t hash, uint64_t word)
{
  hash = (hash ^ word) * 0x100000001b3u;
  return hash ^ (hash >> 29);
}

static inline uint64_t hapi_hash_doubles(uint64_t hash, const double *values, int count)
{
  for (int i = 0; i < count; ++i) {
    uint64_t word;
    memcpy(&word, &values[i], sizeof word);
    hash = hapi_hash_word(hash, word);
  }
  return hash;
}

static inline uint64_t hapi_hash_motion(uint64_t hash, const hap_pose *pose, const hap_twist *twist)
{
  hash = hapi_hash_doubles(hash, pose->position, 3);
  hash = hapi_hash_doubles(hash, pose->quat_wxyz, 4);
  hash = hapi_hash_doubles(hash, twist->linear, 3);
  return hapi_hash_doubles(hash, twist->angular, 3);
}

#endif
