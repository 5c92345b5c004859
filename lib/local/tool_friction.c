/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "local/tool_friction.h"

#include <math.h>
#include <string.h>

/* Each point of a hull has an anchor of its own. A patch that is found anew may have other points,
 * in other places, while hull and body stick as before: a point that began there with nothing would
 * leave the others less and less to hold on to, and the hull would creep under a force that is far
 * from the limit. So one that comes to others that push the same way begins with what they have:
 * the motion of a rigid surface, a way and a turn about the normal, that is nearest to their
 * stretches (least squares, weighted with their stiffness). That has no more energy than they have.
 * How much more than the largest of theirs it may have is bounded: a hull that has turned about the
 * one corner that held it does not find the next one pulled far. By nothing more is too little:
 * those that are left need not have the largest of a turn and a way together, and would lose of it
 * each time. */

#define ALIKE_COSINE 0.95 /* of the normals */
#define MORE_MOST 1.5     /* of the largest stretch */
#define SPREAD_LEAST 1e-5 /* m, of points from their middle: nearer ones say nothing of a turn */

typedef struct surface_fit {
  double weight;
  double middle[3];
  double stretch[4]; /* m; rad */
  double turn;       /* rad, of the points about their middle */
  double most;       /* m, the largest stretch */
} surface_fit;

/* A point of the group that holds now, or did so at the last tick. */
static bool point_holds(const hapi_touches *touches, uint64_t tick, const hapi_local_contact *c,
                        const double normal[3])
{
  const hapi_friction *f = hapi_friction_of(touches, c);
  bool closed = f->stiffness > 0.0 && f->tick + 1 >= tick;
  return closed && c->feel.mu > 0.0 && touches->tool.tools[c->tool - 1].placed &&
         hapi_v3_dot(f->normal, normal) > ALIKE_COSINE;
}

static void stretch_of(const hapi_friction *f, const hapi_local_body *body, double out[4])
{
  if (body == NULL) {
    hapi_v3_copy(f->now.stretch_body, out);
  } else {
    hapi_quat_rotate(body->pose.quat_wxyz, f->now.stretch_body, out);
  }
  hapi_v3_scale(f->left, out, out);
  out[3] = f->left * f->now.turn;
}

static void add_mean(const hapi_friction *f, const hapi_local_body *body, surface_fit *io)
{
  double stretch[4];
  double weight = f->stiffness;
  stretch_of(f, body, stretch);
  io->weight += weight;
  hapi_v3_madd(io->middle, weight, f->at, io->middle); /* the point may have leapt since */
  hapi_v3_madd(io->stretch, weight, stretch, io->stretch);
  io->stretch[3] += weight * stretch[3];
  io->most = fmax(io->most, hapi_v3_norm(stretch));
}

/* The turn is the moment of the stretches over that of the places. */
static void add_moment(const hapi_friction *f, const hapi_local_body *body, const surface_fit *in,
                       const double normal[3], double io[2])
{
  double stretch[4];
  double arm[3];
  double across[3];
  double weight = f->stiffness;
  stretch_of(f, body, stretch);
  hapi_v3_sub(f->at, in->middle, arm);
  hapi_v3_cross(normal, arm, across);
  io[0] += weight * hapi_v3_dot(across, stretch); /* of the mean nothing is left in the sum */
  io[1] += weight * hapi_v3_dot(across, across);
}

static bool surface_find(const hapi_touches *touches, const hapi_bodies *bodies, uint64_t tick,
                         const hapi_local_contact *contact, const double normal[3],
                         surface_fit *out)
{
  const hapi_tool_world *w = &touches->tool;
  const hapi_local_contact *contacts = hapi_touches_of_tools(touches);
  uint32_t pair = w->tools[contact->tool - 1].pair;
  double moment[2] = {0.0, 0.0};
  memset(out, 0, sizeof *out);
  hapi_tool_walk at = hapi_tool_walk_begin(w, pair);
  for (; at.tool != HAPI_SLOT_NONE; hapi_tool_walk_next(w, &at)) {
    uint32_t k = at.tool;
    if (point_holds(touches, tick, &contacts[k], normal)) {
      add_mean(&w->tools[k].friction, hapi_bodies_at(bodies, contacts[k].body), out);
    }
  }
  if (!(out->weight > 0.0)) {
    return false;
  }
  hapi_v3_scale(1.0 / out->weight, out->middle, out->middle);
  hapi_v3_scale(1.0 / out->weight, out->stretch, out->stretch);
  out->stretch[3] /= out->weight;
  for (at = hapi_tool_walk_begin(w, pair); at.tool != HAPI_SLOT_NONE; hapi_tool_walk_next(w, &at)) {
    uint32_t k = at.tool;
    if (point_holds(touches, tick, &contacts[k], normal)) {
      add_moment(&w->tools[k].friction, hapi_bodies_at(bodies, contacts[k].body), out, normal,
                 moment);
    }
  }
  bool wide = moment[1] > SPREAD_LEAST * SPREAD_LEAST * out->weight;
  out->turn = wide ? moment[0] / moment[1] : 0.0;
  return true;
}

void hapi_tool_friction_begin(const hapi_touches *touches, const hapi_bodies *bodies, uint64_t tick,
                              const hapi_local_contact *contact, const hapi_rub_place *at,
                              double out[4])
{
  surface_fit found;
  double arm[3];
  double swing[3];
  memset(out, 0, 4 * sizeof *out);
  const hapi_pointer *p = at->pointer;
  if (contact->tool == 0 || p->device.jumped || p->rigid ||
      !surface_find(touches, bodies, tick, contact, at->normal, &found)) {
    return;
  }
  hapi_v3_sub(at->foot, found.middle, arm);
  hapi_v3_cross(at->normal, arm, swing);
  hapi_v3_madd(found.stretch, found.turn, swing, out);
  double length = hapi_v3_norm(out);
  double most = MORE_MOST * found.most;
  hapi_v3_scale(length > most ? most / length : 1.0, out, out);
  out[3] = found.stretch[3];
}
