/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "remote/scenery.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"
#include "base/plausible.h"
#include "base/vec.h"
#include "remote/bytes.h"

#define QUAT_STEPS 32767.0
#define NAME_MOST UINT32_MAX

/* ---- bytes ---- */

static void real_write(double value, unsigned char *out)
{
  const float single = (float)value;
  uint32_t word;
  memcpy(&word, &single, sizeof word);
  hapi_bytes_write(word, 4, out);
}

static double real_read(const unsigned char *in)
{
  const uint32_t word = (uint32_t)hapi_bytes_read(in, 4);
  float single;
  memcpy(&single, &word, sizeof single);
  return (double)single;
}

uint32_t hapi_scenery_write(uint64_t number, const hapi_told_body *bodies, uint32_t count,
                            unsigned char out[HAP_LINK_NEWEST_MOST])
{
  HAPI_ASSERT(count > 0 && count <= HAPI_SCENERY_MOST);
  hapi_bytes_write(number, 8, out);
  for (uint32_t i = 0; i < count; ++i) {
    unsigned char *at = out + HAPI_SCENERY_HEAD + i * HAPI_SCENERY_BODY;
    hapi_bytes_write(bodies[i].name, 4, at);
    hapi_bytes_write(bodies[i].birth, 4, at + 4);
    for (int k = 0; k < 3; ++k) {
      real_write(bodies[i].pose.position[k], at + 8 + 4 * k);
    }
    for (int k = 0; k < 4; ++k) {
      long steps = lround(QUAT_STEPS * bodies[i].pose.quat_wxyz[k]);
      hapi_bytes_write((uint16_t)(int16_t)steps, 2, at + 20 + 2 * k);
    }
  }
  return HAPI_SCENERY_HEAD + count * HAPI_SCENERY_BODY;
}

static bool body_read(const unsigned char *at, hapi_told_body *out)
{
  double norm2 = 0.0;
  *out = (hapi_told_body){.name = hapi_bytes_read(at, 4), .birth = hapi_bytes_read(at + 4, 4)};
  for (int k = 0; k < 3; ++k) {
    out->pose.position[k] = real_read(at + 8 + 4 * k);
  }
  for (int k = 0; k < 4; ++k) {
    double part = (int16_t)(uint16_t)hapi_bytes_read(at + 20 + 2 * k, 2) / QUAT_STEPS;
    out->pose.quat_wxyz[k] = part;
    norm2 += part * part;
  }
  if (out->name == 0 || out->birth == 0 || fabs(norm2 - 1.0) > 1e-3) {
    return false;
  }
  hapi_quat_normalize(out->pose.quat_wxyz);
  return hapi_plausible_pose(&out->pose);
}

uint32_t hapi_scenery_read(const void *data, uint32_t bytes, uint64_t *out_number,
                           hapi_told_body out[HAPI_SCENERY_MOST])
{
  const unsigned char *in = data;
  uint32_t count = bytes > HAPI_SCENERY_HEAD ? (bytes - HAPI_SCENERY_HEAD) / HAPI_SCENERY_BODY : 0;
  if (count > HAPI_SCENERY_MOST || bytes != HAPI_SCENERY_HEAD + count * HAPI_SCENERY_BODY) {
    return 0;
  }
  for (uint32_t i = 0; i < count; ++i) {
    if (!body_read(in + HAPI_SCENERY_HEAD + i * HAPI_SCENERY_BODY, &out[i])) {
      return 0;
    }
  }
  *out_number = hapi_bytes_read(in, 8);
  return count;
}

/* ---- which bodies a step tells ---- */

#define MOVED_M 1e-5      /* less is not told at once */
#define TURNED 1e-4       /* likewise, of each part of a quaternion */
#define SETTLED_STEPS 10u /* so long not moved: it rests */
#define AT_ONCE 64u       /* places that are read */

/* One step: messages that are filled on the way. */
typedef struct scenery_step {
  hapi_scenery *scenery;
  const hapi_scenery_out *out;
  hapi_told_body newest[HAPI_SCENERY_MOST];
  uint32_t newest_count;
  uint32_t parts; /* sent */
  hapi_told_body sure[HAPI_SCENERY_MOST];
  uint32_t sure_places[HAPI_SCENERY_MOST];
  uint32_t sure_count;
  uint32_t left_out; /* first place that found no room */
} scenery_step;

#define NO_PLACE UINT32_MAX

void hapi_scenery_finish(hapi_scenery *scenery)
{
  hapi_free(scenery->of);
  scenery->of = NULL;
  scenery->capacity = 0;
}

void hapi_scenery_reset(hapi_scenery *scenery)
{
  if (scenery->of != NULL) {
    memset(scenery->of, 0, scenery->capacity * sizeof *scenery->of);
  }
  scenery->next = 0;
}

static bool scenery_reserve(hapi_scenery *scenery, uint32_t places)
{
  if (places <= scenery->capacity) {
    return true;
  }
  uint32_t capacity = places + places / 2;
  hapi_place_told *of = hapi_alloc_array(capacity, sizeof *of);
  if (of == NULL) {
    return false;
  }
  if (scenery->capacity > 0) {
    memcpy(of, scenery->of, scenery->capacity * sizeof *of);
  }
  hapi_free(scenery->of);
  scenery->of = of;
  scenery->capacity = capacity;
  return true;
}

static bool body_moved(const hap_pose *from, const hap_pose *to)
{
  double way[3];
  double turned = 0.0;
  hapi_v3_sub(to->position, from->position, way);
  for (int k = 0; k < 4; ++k) {
    turned = fmax(turned, fabs(to->quat_wxyz[k] - from->quat_wxyz[k]));
  }
  return hapi_v3_norm(way) > MOVED_M || turned > TURNED;
}

static void newest_send(scenery_step *s)
{
  unsigned char bytes[HAP_LINK_NEWEST_MOST];
  if (s->newest_count > 0) {
    uint32_t size = hapi_scenery_write(s->scenery->number, s->newest, s->newest_count, bytes);
    (void)s->out->send(s->out->of, s->parts++, false, bytes, size);
    s->newest_count = 0;
  }
}

static void sure_send(scenery_step *s)
{
  unsigned char bytes[HAP_LINK_NEWEST_MOST];
  if (s->sure_count == 0) {
    return;
  }
  uint32_t size = hapi_scenery_write(s->scenery->number, s->sure, s->sure_count, bytes);
  if (!s->out->send(s->out->of, 0, true, bytes, size)) {
    return; /* in the next step once more */
  }
  for (uint32_t i = 0; i < s->sure_count; ++i) {
    hapi_place_told *place = &s->scenery->of[s->sure_places[i]];
    place->birth = s->sure[i].birth;
    place->still += place->still == SETTLED_STEPS;
  }
}

/* As a newest message, where it has moved and there is room. */
static void body_tell(scenery_step *s, uint32_t index, const hapi_told_body *body)
{
  hapi_place_told *place = &s->scenery->of[index];
  if (body->owned) {
    place->told = false;
  } else if (place->told && !body_moved(&place->sent.pose, &body->pose)) {
    place->still += place->still < SETTLED_STEPS;
  } else if (s->parts == HAPI_SCENERY_PARTS) {
    s->left_out = s->left_out == NO_PLACE ? index : s->left_out;
  } else {
    place->sent = *body;
    place->still = 0;
    place->told = true;
    s->newest[s->newest_count++] = *body;
    if (s->newest_count == HAPI_SCENERY_MOST) {
      newest_send(s);
    }
  }
}

static void body_look(scenery_step *s, uint32_t index, const hapi_told_body *body)
{
  hapi_place_told *place = &s->scenery->of[index];
  if (body->name == 0 || body->name > NAME_MOST || body->birth > NAME_MOST) {
    memset(place, 0, sizeof *place);
    return;
  }
  if (place->sent.name != body->name) { /* whoever has not heard of it takes birth for name */
    *place = (hapi_place_told){.sent = {.name = body->name}, .birth = body->name};
  }
  body_tell(s, index, body);
  bool rests = place->told && place->still == SETTLED_STEPS;
  if ((rests || place->birth != body->birth) && s->sure_count < HAPI_SCENERY_MOST) {
    s->sure_places[s->sure_count] = index;
    s->sure[s->sure_count++] = *body;
  }
}

bool hapi_scenery_step(hapi_scenery *scenery, const hapi_scenery_source *from,
                       const hapi_scenery_out *out)
{
  hapi_told_body bodies[AT_ONCE];
  uint32_t places = from->places(from->of);
  if (!scenery_reserve(scenery, places)) {
    return false;
  }
  scenery_step step = {.scenery = scenery, .out = out, .left_out = NO_PLACE};
  uint32_t at = scenery->next < places ? scenery->next : 0;
  ++scenery->number;
  for (uint32_t done = 0; done < places;) {
    uint32_t count = places - done < places - at ? places - done : places - at;
    count = count < AT_ONCE ? count : AT_ONCE;
    from->read(from->of, at, count, bodies);
    for (uint32_t i = 0; i < count; ++i) {
      body_look(&step, at + i, &bodies[i]);
    }
    done += count;
    at = at + count < places ? at + count : 0;
  }
  newest_send(&step);
  sure_send(&step);
  scenery->next = step.left_out != NO_PLACE ? step.left_out : 0;
  return true;
}
