/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "remote/terms.h"

#include <assert.h>
#include <stddef.h>
#include <string.h>

#include <hapode/expert.h>

#include "base/log.h"
#include "remote/bytes.h"

static const unsigned char magic[8] = {'h', 'a', 'p', 'o', 'd', 'e', 0x0d, 0x0a};

#define PERIOD_MOST_S 1.0

/* What messages have room for: both ends have the same. */
typedef struct terms_room {
  const char *name; /* of what decides it in a session */
  size_t offset;
} terms_room;

#define ROOM(member, name)                \
  {                                       \
    name, offsetof(hapi_capacity, member) \
  }

static const terms_room rooms[] = {
    ROOM(bodies, "max_bodies"),     ROOM(contacts, "max_contacts"),
    ROOM(pairs, "max_contacts"),    ROOM(pointers, "max_pointers"),
    ROOM(geoms, "max_bodies"),      ROOM(hull_points, "max_hull_points"),
    ROOM(joints, "max_bodies"),     ROOM(tool_points, "the version"),
    ROOM(crosses, "max_bodies"),    ROOM(springs, "lookback"),
    ROOM(triangles, "the version"), ROOM(feels, "the version"),
};

#define ROOMS (sizeof rooms / sizeof rooms[0])
#define ROOMS_AT 40 /* byte of the message */
#define LIMITS_AT 88
#define DRAWS_AT 104
#define SCENE_AT 108

static_assert(ROOMS_AT + 4 * ROOMS <= LIMITS_AT, "the rooms are in the message");
static_assert(LIMITS_AT + 16 <= DRAWS_AT && SCENE_AT + 12 <= HAPI_TERMS_BYTES, "so is the rest");

/* What a message of channel 0 is. */
#define KIND_AT 12
#define KIND_TERMS 0u
#define KIND_REFUSAL 1u
#define TEXT_AT 16u

static uint32_t *room_of(hapi_capacity *capacity, size_t index)
{
  return (uint32_t *)(void *)((char *)capacity + rooms[index].offset);
}

static uint32_t room_read(const hapi_capacity *capacity, size_t index)
{
  uint32_t room;
  memcpy(&room, (const char *)capacity + rooms[index].offset, sizeof room);
  return room;
}

void hapi_terms_write(const hapi_terms *terms, unsigned char out[HAPI_TERMS_BYTES])
{
  memset(out, 0, HAPI_TERMS_BYTES);
  memcpy(out, magic, sizeof magic);
  hapi_bytes_write(HAPI_TERMS_VERSION, 4, out + 8);
  hapi_bytes_write_real(terms->look_ahead_s, out + 16);
  hapi_bytes_write_real(terms->period_s, out + 24);
  hapi_bytes_write_real(terms->haptic_hz, out + 32);
  for (size_t i = 0; i < ROOMS; ++i) {
    hapi_bytes_write(room_read(&terms->capacity, i), 4, out + ROOMS_AT + 4 * i);
  }
  hapi_bytes_write_real(terms->limits.force, out + LIMITS_AT);
  hapi_bytes_write_real(terms->limits.speed, out + LIMITS_AT + 8);
  hapi_bytes_write(terms->draws, 4, out + DRAWS_AT);
  hapi_bytes_write(terms->scene.bodies, 4, out + SCENE_AT);
  hapi_bytes_write(terms->scene.shapes, 8, out + SCENE_AT + 4);
}

uint32_t hapi_refusal_write(const char *text, unsigned char out[HAPI_REFUSAL_BYTES_MOST])
{
  size_t length = strnlen(text, HAPI_REFUSAL_BYTES_MOST - TEXT_AT);
  memset(out, 0, TEXT_AT);
  memcpy(out, magic, sizeof magic);
  hapi_bytes_write(HAPI_TERMS_VERSION, 4, out + 8);
  hapi_bytes_write(KIND_REFUSAL, 4, out + KIND_AT);
  memcpy(out + TEXT_AT, text, length);
  return TEXT_AT + (uint32_t)length;
}

/* The text is for people, of somebody who is not known: what is no letter is none here. */
bool hapi_refusal_read(const void *data, uint32_t bytes, hap_detail *out)
{
  const unsigned char *in = data;
  if (bytes <= TEXT_AT || bytes > HAPI_REFUSAL_BYTES_MOST || memcmp(in, magic, sizeof magic) != 0 ||
      hapi_bytes_read(in + KIND_AT, 4) != KIND_REFUSAL) {
    return false;
  }
  memset(out, 0, sizeof *out);
  for (uint32_t i = 0; i < bytes - TEXT_AT; ++i) {
    unsigned char letter = in[TEXT_AT + i];
    out->text[i] = (char)(letter >= 0x20 && letter < 0x7f ? letter : '?');
  }
  return true;
}

hap_status hapi_terms_read(const void *data, uint32_t bytes, hapi_terms *out, hap_detail *detail)
{
  const unsigned char *in = data;
  if (bytes != HAPI_TERMS_BYTES || memcmp(in, magic, sizeof magic) != 0 ||
      hapi_bytes_read(in + KIND_AT, 4) != KIND_TERMS) {
    return hapi_fail(detail, HAP_ERROR_FORMAT,
                     "the other end does not speak hapode: %u bytes with another begin", bytes);
  }
  uint32_t version = (uint32_t)hapi_bytes_read(in + 8, 4);
  if (version != HAPI_TERMS_VERSION) {
    return hapi_fail(detail, HAP_ERROR_UNSUPPORTED,
                     "the other end speaks version %u, and this one %u: use the same hapode on "
                     "both",
                     version, HAPI_TERMS_VERSION);
  }
  hapi_terms terms = {.look_ahead_s = hapi_bytes_read_real(in + 16),
                      .period_s = hapi_bytes_read_real(in + 24),
                      .haptic_hz = hapi_bytes_read_real(in + 32),
                      .limits = {.force = hapi_bytes_read_real(in + LIMITS_AT),
                                 .speed = hapi_bytes_read_real(in + LIMITS_AT + 8)},
                      .draws = hapi_bytes_read(in + DRAWS_AT, 4) != 0,
                      .scene = {(uint32_t)hapi_bytes_read(in + SCENE_AT, 4),
                                hapi_bytes_read(in + SCENE_AT + 4, 8)}};
  for (size_t i = 0; i < ROOMS; ++i) {
    *room_of(&terms.capacity, i) = (uint32_t)hapi_bytes_read(in + ROOMS_AT + 4 * i, 4);
  }
  if (!(terms.look_ahead_s >= 0.0 && terms.look_ahead_s <= HAP_LOOK_AHEAD_MOST) ||
      !(terms.period_s > 0.0 && terms.period_s <= PERIOD_MOST_S)) { /* false for NaN */
    return hapi_fail(detail, HAP_ERROR_FORMAT,
                     "the other end looks ahead by %g s and steps by %g s: 0 to %g s and up to %g "
                     "s are possible",
                     terms.look_ahead_s, terms.period_s, HAP_LOOK_AHEAD_MOST, PERIOD_MOST_S);
  }
  if (!(terms.limits.force >= 0.0 && terms.limits.speed >= 0.0)) { /* likewise */
    return hapi_fail(detail, HAP_ERROR_FORMAT, "limits of the other end are below 0");
  }
  *out = terms;
  return HAP_OK;
}

hap_status hapi_terms_compare(const hapi_terms *loop, const hapi_terms *world, hap_detail *detail)
{
  if (loop->haptic_hz != world->haptic_hz) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "the world is for loops of %g Hz, and this one has %g: give both the same "
                     "haptic_hz",
                     world->haptic_hz, loop->haptic_hz);
  }
  for (size_t i = 0; i < ROOMS; ++i) {
    uint32_t ours = room_read(&loop->capacity, i);
    uint32_t theirs = room_read(&world->capacity, i);
    if (ours != theirs) {
      return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                       "messages of the world have room for %u where those of the loop have %u: "
                       "give both the same %s",
                       theirs, ours, rooms[i].name);
    }
  }
  return HAP_OK;
}
