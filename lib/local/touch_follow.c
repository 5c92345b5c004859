/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "local/touch_follow.h"

#include <math.h>

#include "base/assert.h"
#include "base/pose.h"
#include "base/safety.h"
#include "base/vec.h"
#include "local/ball_nearest.h"
#include "local/pointer_friction.h"
#include "local/texture.h"
#include "pointer/own_force.h"

#define FOOT_STEP 1e-6 /* m */
#define FOOT_MOST 2.0  /* FOOT_STEPs: no surface is so hollow where a ball touches it once */

/* A surface that changes under a contact that presses changes its stiffness slowly: all at once the
 * force would leap by the depth times the difference. */
static void stiffness_follow(hapi_pair_feel *pair, const hapi_pointer *p, double period)
{
  bool springs = (pair->in.feel.more & HAPI_FEEL_SPRING) != 0;
  double wanted = springs ? pair->in.feel.stiffness : p->surface.stiffness;
  if (pair->stiffness < 0.0) {
    pair->pressed = pair->stiffness == HAPI_FEEL_OWN;
    pair->stiffness = pair->pressed ? p->surface.stiffness : wanted;
  }
  double most = period / HAPI_SAFETY_CONTACT_RAMP_S * hapi_max(wanted, pair->stiffness);
  bool loaded = pair->pressed || pair->hold.sticks;
  pair->stiffness =
      loaded ? hapi_min(hapi_max(wanted, pair->stiffness - most), pair->stiffness + most) : wanted;
}

/* Nor does a texture that comes under a contact that presses leap, or one that goes. out: as of
 * hapi_texture_calls. */
static void texture_follow(hapi_pair_feel *pair, uint64_t out, double period)
{
  const hapi_feel *said = &pair->in.feel;
  bool is_out = said->texture != NULL && (out & hapi_texture_bit(said->texture_number)) != 0;
  const hapi_texture *wanted = is_out ? NULL : said->texture;
  bool loaded = pair->pressed || pair->hold.sticks;
  double most = period / HAPI_SAFETY_CONTACT_RAMP_S;
  pair->parts = wanted != pair->texture;
  pair->left_share = loaded ? hapi_max(pair->left_share - most, 0.0) : 0.0;
  if (pair->parts) {
    pair->texture = wanted;
    pair->lift_share = loaded ? 0.0 : 1.0;
    pair->left_share = loaded ? 1.0 - most : 0.0;
  }
  pair->lift_share = loaded ? hapi_min(pair->lift_share + most, 1.0) : 1.0;
}

#define AT_LIMIT 1e-6 /* of the adhesion: less is rounding */

/* A touch that has pressed sticks from the next tick on. It lets go in the tick after the one in
 * which the pull came to all that holds, or in which it was too far: then the spring's energy is
 * lost. So coming and going takes energy from the hand, and never gives any. */
static void hold_follow(hapi_pair_feel *pair)
{
  hapi_pair_hold *hold = &pair->hold;
  bool can = (pair->in.feel.more & HAPI_FEEL_ADHESION) != 0;
  bool holds = hold->sticks && hold->taken < (1.0 - AT_LIMIT) * hold->pull &&
               hold->depth > -HAPI_SAFETY_ADHESION_WAY;
  hold->sticks = can && (hold->presses || holds);
  hold->presses = false;
  hold->pull = hold->taken = 0.0;
  hold->depth = -HUGE_VAL;
}

/* A magnet that comes while the hand is in its reach comes in as an own force does. */
static void magnet_begin(hapi_pair_feel *pair, double gap, double period)
{
  hapi_pair_magnet *magnet = &pair->magnet;
  const hapi_feel *said = &pair->in.feel;
  double most = period / HAPI_SAFETY_RAMP_IN_S * hapi_max(said->magnet_force, magnet->strength);
  if (!magnet->known) {
    magnet->strength = gap < said->magnet_reach ? 0.0 : said->magnet_force;
    magnet->begins = true;
  }
  magnet->strength =
      hapi_min(hapi_max(said->magnet_force, magnet->strength - most), magnet->strength + most);
  magnet->any = magnet->known = true;
  magnet->pull = (hap_wrench){{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
}

/* Along the slope of the gap, so that it is the slope of a potential. Points of a hull have their
 * shares of it. depth: m. */
static void magnet_pull(hapi_touches *touches, hapi_pair_feel *pair, const hapi_feel_place *at,
                        const hapi_local_contact *c, double depth, double period)
{
  hapi_pair_magnet *magnet = &pair->magnet;
  const hapi_feel *said = &pair->in.feel;
  double gap = hapi_max(-depth, 0.0);
  double force[3];
  double arm[3];
  double moment[3];
  if (!magnet->any) {
    magnet_begin(pair, gap, period);
  }
  double share = at->share * hapi_magnet_share(gap * gap, said->magnet_reach);
  hapi_v3_scale(share > 0.0 ? -magnet->strength * share * gap : 0.0, c->feel.lift.push, force);
  hapi_v3_add(magnet->pull.force, force, magnet->pull.force);
  if (at->pointer->shape.hull != NULL) {
    hapi_v3_sub(at->point, at->pointer->pose.position, arm);
    hapi_v3_cross(arm, force, moment);
    hapi_v3_add(magnet->pull.torque, moment, magnet->pull.torque);
  }
  magnet->hardest = HAPI_MAGNET_PEAK * magnet->strength / said->magnet_reach;
  magnet->body = c->body;
  touches->magnets = true;
}

/* Once in each tick. */
static void pair_follow(hapi_pair_feel *pair, uint64_t textures_out, const hapi_tick_facts *facts,
                        const hapi_pointer *p)
{
  if (pair->tick != facts->tick || pair->stiffness < 0.0) {
    pair->pressed = pair->presses && pair->tick + 1 == facts->tick;
    pair->presses = false;
    if (pair->tick + 1 != facts->tick) {
      pair->hold.sticks = pair->hold.presses = false;
      pair->magnet.known = false;
    }
    pair->tick = facts->tick;
    hold_follow(pair);
    stiffness_follow(pair, p, facts->period);
    texture_follow(pair, textures_out, facts->period);
  }
}

/* Whether friction let the contact slide in the tick before. */
static bool contact_slid(const hapi_touches *touches, const hapi_tick_facts *facts,
                         const hapi_local_contact *c)
{
  const hapi_friction *f = hapi_friction_of(touches, c);
  bool there = f->generation == c->generation && f->tick + 1 == facts->tick;
  return c->feel.rubs && there && (f->rigid ? f->slid : f->left < 1.0);
}

/* m/s, of the pointer and the surface towards each other; below 0: apart. */
static double closing_speed(const hapi_feel_place *at)
{
  const hapi_pointer *p = at->pointer;
  double relative[3];
  double arm[3];
  double swing[3];
  hapi_v3_copy(p->proxied ? p->proxy.velocity : p->twist.linear, relative);
  if (p->shape.hull != NULL) {
    hapi_v3_sub(at->point, p->pose.position, arm);
    hapi_v3_cross(p->proxied ? p->proxy.spin : p->twist.angular, arm, swing);
    hapi_v3_add(relative, swing, relative);
  }
  if (at->body != NULL) {
    hapi_v3_sub(at->point, at->body->pose.position, arm);
    hapi_v3_cross(at->body->twist.angular, arm, swing);
    hapi_v3_add(swing, at->body->twist.linear, swing);
    hapi_v3_sub(relative, swing, relative);
  }
  return -hapi_v3_dot(relative, at->normal);
}

/* A material answers the touch that begins; others of the pair in this tick are the same one. */
static void material_answer(const hapi_pair_feel *pair, const hapi_feel_place *at, double depth,
                            double period)
{
  const hapi_feel *said = &pair->in.feel;
  double speed = closing_speed(at);
  if ((said->more & HAPI_FEEL_IMPACT) != 0 && speed > 0.0) {
    hapi_transient_begin(&at->pointer->transients, &said->impact, speed, depth, at->normal, period);
  }
}

/* A touch of a textured surface, in the frame of the geom's body. */
typedef struct textured_spot {
  double center[3]; /* of the pointer */
  double foot[3];   /* on the surface */
  double normal[3];
} textured_spot;

static void spot_find(const hapi_feel_place *at, textured_spot *out)
{
  const double *center = at->pointer->pose.position;
  hapi_friction_foot(at->pointer, at->normal, at->point, out->foot);
  hapi_v3_copy(center, out->center);
  hapi_v3_copy(at->normal, out->normal);
  if (at->body != NULL) {
    const hap_pose *pose = &at->body->pose;
    hapi_pose_unpoint(pose->position, pose->quat_wxyz, out->foot, out->foot);
    hapi_pose_unpoint(pose->position, pose->quat_wxyz, center, out->center);
    hapi_quat_unrotate(pose->quat_wxyz, at->normal, out->normal);
  }
}

/* On a surface that is curved the foot goes less far than the ball, and over an edge it stays: then
 * the height changes by as much less. *io: slope by the foot, then by the ball. */
static void slope_of_ball(const hapi_local_contact *c, const textured_spot *spot, double radius,
                          double *io)
{
  static const hapi_touch_frame own = {NULL, NULL};
  double along[2][3];
  double slope[3] = {0.0, 0.0, 0.0};
  hapi_nearest here;
  hapi_texture_tangents(spot->normal, along);
  if (!hapi_ball_nearest(spot->center, radius, &c->asked.shape, &c->asked.pose, &own, &here)) {
    return;
  }
  for (int i = 0; i < 2; ++i) {
    double beside[3];
    double way[3];
    hapi_nearest nearest;
    hapi_v3_madd(spot->center, FOOT_STEP, along[i], beside);
    if (!hapi_ball_nearest(beside, radius, &c->asked.shape, &c->asked.pose, &own, &nearest)) {
      return;
    }
    hapi_v3_sub(nearest.point_b, here.point_b, way);
    if (hapi_v3_norm(way) > FOOT_MOST * FOOT_STEP) {
      return; /* deep in it the nearest side may be another one */
    }
    hapi_v3_madd(slope, hapi_v3_dot(io, way) / FOOT_STEP, along[i], slope);
  }
  hapi_v3_copy(slope, io);
}

/* A spring of stiffness k whose depth is that of the geom and the height h of the texture has the
 * energy k (g + h)^2 / 2 and the force k (g + h) (n - grad h), n out of the geom: what pushes along
 * the surface is what climbing costs, and no way round gives any energy. A hull's face on a corner
 * of the geom stays at one place of the texture: it has no slope. False: a height that is not
 * finite. */
static bool contact_lift(hapi_touches *touches, const hapi_pair_feel *pair,
                         const hapi_feel_place *at, hapi_local_contact *c)
{
  textured_spot spot;
  double point[3];
  double normal[3];
  double slope[3];
  const hap_pose *geom = &pair->in.feel.geom;
  spot_find(at, &spot);
  hapi_pose_unpoint(geom->position, geom->quat_wxyz, spot.foot, point);
  hapi_quat_unrotate(geom->quat_wxyz, spot.normal, normal);
  int64_t begin_ns = hapi_texture_begin(&touches->textures, pair->texture);
  double height = hapi_texture_height(pair->texture, point, normal, slope);
  hapi_texture_end(&touches->textures, pair->texture, pair->in.feel.texture_number, begin_ns);
  if (!hapi_finite(&height, 1) || !hapi_finite(slope, 3)) {
    return false;
  }
  c->feel.lift.height = pair->lift_share * height;
  bool stays = c->tool != 0 && touches->tool.tools[c->tool - 1].in.at.touch == HAPI_TOUCH_FACE_A;
  if (stays) {
    return true;
  }
  hapi_quat_rotate(geom->quat_wxyz, slope, slope);
  if (c->asked.has && c->asked.told.count == 0 && c->asked.shape.kind != HAPI_SHAPE_PLANE) {
    slope_of_ball(c, &spot, at->pointer->shape.radius, slope);
  }
  if (at->body != NULL) {
    hapi_quat_rotate(at->body->pose.quat_wxyz, slope, slope);
  }
  hapi_v3_madd(slope, -hapi_v3_dot(slope, at->normal), at->normal, slope);
  hapi_v3_scale(pair->lift_share, slope, c->feel.lift.slope);
  return true;
}

/* What is left of a texture that has gone stays with the contact, less and less. */
static void lift_leave(const hapi_pair_feel *pair, const hapi_touch_lift *before,
                       const hapi_feel_place *at, hapi_touch_lift *io)
{
  double slope[3];
  if (pair->parts) {
    io->left = before->height;
    hapi_v3_copy(before->slope, io->left_slope);
  }
  hapi_v3_copy(io->left_slope, slope);
  hapi_v3_madd(slope, -hapi_v3_dot(slope, at->normal), at->normal, slope);
  io->height += pair->left_share * io->left;
  hapi_v3_madd(io->slope, pair->left_share, slope, io->slope);
}

void hapi_touch_feel_follow(hapi_touches *touches, const hapi_tick_facts *facts,
                            const hapi_feel_place *at, hapi_local_contact *c, double *io_depth)
{
  HAPI_ASSERT_INDEX(c->feel.pair, touches->feel_count);
  hapi_pair_feel *pair = &touches->feels[c->feel.pair];
  const hapi_feel *said = &pair->in.feel;
  const hapi_pointer *p = at->pointer;
  const hapi_touch_feel before = c->feel;
  pair_follow(pair, touches->textures.out, facts, p);
  c->feel.sticks = pair->hold.sticks;
  c->feel.pull = pair->hold.sticks ? at->share * said->adhesion : 0.0;
  c->feel.stiffness = pair->stiffness;
  c->feel.damping = (said->more & HAPI_FEEL_SPRING) != 0 ? said->damping : p->surface.damping;
  c->feel.mu = contact_slid(touches, facts, c) ? said->mu : said->mu_static;
  c->feel.lift.height = 0.0;
  hapi_v3_set(c->feel.lift.slope, 0.0, 0.0, 0.0);
  if (pair->texture != NULL && !contact_lift(touches, pair, at, c)) {
    touches->unsound = c->pointer + 1;
  }
  bool leaves = pair->left_share > 0.0;
  if (leaves) {
    lift_leave(pair, &before.lift, at, &c->feel.lift);
  }
  hapi_v3_sub(at->normal, c->feel.lift.slope, c->feel.lift.push);
  bool rough = pair->texture != NULL || leaves;
  c->feel.lifted = rough ? fabs(c->feel.lift.height - before.lift.height) : 0.0;
  c->feel.turned = 0.0;
  for (int i = 0; rough && i < 3; ++i) {
    c->feel.turned += fabs(c->feel.lift.push[i] - before.lift.push[i]);
  }
  *io_depth += c->feel.lift.height;
  /* What does not give has no depth. */
  bool pressed = p->rigid && hapi_v3_dot(c->force, at->normal) < 0.0;
  pair->hold.presses = pair->hold.presses || *io_depth > 0.0 || pressed;
  pair->hold.depth = hapi_max(pair->hold.depth, *io_depth);
  if ((said->more & HAPI_FEEL_MAGNET) != 0 && !facts->faulted) {
    magnet_pull(touches, pair, at, c, *io_depth, facts->period);
  } else {
    pair->magnet.known = false;
  }
  if (*io_depth > 0.0 && !pair->pressed && !pair->presses && !pair->hold.sticks) {
    material_answer(pair, at, *io_depth, facts->period);
  }
  pair->presses = pair->presses || *io_depth > 0.0;
}
