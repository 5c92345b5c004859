/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "local/touch_adopt.h"

#include <string.h>

#include "base/assert.h"
#include "local/tool_adopt.h"
#include "local/touch_feel.h"
#include "local/touch_frame.h"

static uint32_t epoch_of(const hapi_bodies *bodies, uint32_t slot)
{
  return slot == HAPI_SLOT_NONE ? 0 : bodies->of[slot].epoch;
}

static void touches_keep(const hapi_touches *touches)
{
  for (uint32_t i = 0; i < touches->count; ++i) {
    const hapi_local_contact *c = &touches->of[i];
    HAPI_ASSERT(c->tool == 0);
    touches->kept[c->slot] = (hapi_kept_touch){.generation = c->seen ? c->generation : 0,
                                               .body = c->body,
                                               .epoch = c->epoch,
                                               .ramp = c->ramp,
                                               .ball = c->ball,
                                               .special = c->feel.special};
    if (c->feel.special) {
      touches->kept[c->slot].lift = c->feel.lift;
    }
  }
}

static void contact_adopt(hapi_touches *touches, const hapi_bodies *bodies,
                          const hapi_model_contact *in, uint32_t wishes, hapi_local_contact *out)
{
  const hapi_kept_touch *kept = &touches->kept[in->slot];
  memset(out, 0, sizeof *out);
  out->slot = in->slot;
  out->generation = in->generation;
  out->body = in->body;
  out->pointer = in->pointer;
  out->pointer_generation = in->pointer_generation;
  memcpy(out->point_body, in->point_body, sizeof out->point_body);
  memcpy(out->normal_body, in->normal_body, sizeof out->normal_body);
  memcpy(out->response.a, in->a, sizeof out->response.a);
  memcpy(out->response.turn, in->turn, sizeof out->response.turn);
  out->asked.geom = in->geom;
  out->asked.number = in->geom_number;
  out->weight = 1.0;
  out->asked.has = in->has_shape != 0;
  out->is_hidden = in->hidden != 0;
  out->asked.shape = in->shape;
  out->asked.pose = in->shape_pose;
  out->asked.told = in->told;
  out->epoch = epoch_of(bodies, in->body);
  bool goes_on = kept->generation == in->generation;
  if (goes_on) {
    out->seen = true;
    out->ramp = kept->ramp;
    out->ball = kept->ball;
    out->feel.lift = kept->lift;
    out->ball.known &= kept->epoch == out->epoch; /* else the body was put elsewhere */
    if (kept->body == HAPI_SLOT_NONE && in->body != HAPI_SLOT_NONE) {
      const hap_pose *frame = hapi_body_frame_at_begin(bodies, in->body);
      hapi_ball_hand_over(frame, &out->ball);
      hapi_friction_hand_over(frame, &touches->frictions[in->slot]);
    }
  }
  const hapi_feel_told told = {in->mu, in->feel, wishes, goes_on};
  hapi_touch_feel_adopt(touches, &told, out);
}

/* Those of contact number from of the message, which is number to here; *at: the first of them. */
static void crosses_adopt(hapi_crosses *crosses, const hapi_bodies *bodies, hapi_model *model,
                          uint32_t from, uint32_t to, uint32_t *at)
{
  const hapi_model_cross *in = hapi_model_crosses(model);
  while (*at < model->cross_count && in[*at].contact < from) {
    ++*at; /* of a contact that was left out */
  }
  for (; *at < model->cross_count && in[*at].contact == from; ++*at) {
    if (bodies->of[in[*at].body].live) {
      crosses->of[crosses->count] = in[*at];
      crosses->of[crosses->count++].contact = to;
    }
  }
}

void hapi_touches_adopt(hapi_touches *touches, const hapi_pointers *pointers,
                        const hapi_bodies *bodies, hapi_model *model)
{
  const hapi_model_contact *in = hapi_model_contacts(model);
  hapi_tool_set_aside(touches);
  hapi_feels_adopt(touches, model);
  uint32_t cross = 0;
  touches_keep(touches);
  touches->count = 0;
  touches->crosses.count = 0;
  touches->rubs = false;
  if (model->triangle_count > 0) {
    memcpy(touches->triangles, hapi_model_triangles(model),
           model->triangle_count * sizeof *touches->triangles);
  }
  for (uint32_t i = 0; i < model->contact_count; ++i) {
    uint32_t pointer = in[i].pointer;
    HAPI_ASSERT_INDEX(pointer, pointers->high);
    /* The pointer may have gone while the message was on its way. */
    if (in[i].tool == 0 && pointers->of[pointer].generation == in[i].pointer_generation) {
      crosses_adopt(&touches->crosses, bodies, model, i, touches->count, &cross);
      contact_adopt(touches, bodies, &in[i], model->wishes, &touches->of[touches->count++]);
    }
  }
  hapi_tool_adopt_model(touches, pointers, bodies, model);
}
