/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "world/contact_call.h"

#include <math.h>
#include <string.h>

#include "base/vec.h"
#include "world/surfaces.h"

void hapi_said_surface_give(const hapi_said_surface *said, dSurfaceParameters *out)
{
  *out = (dSurfaceParameters){.mode = said->mode,
                              .mu = said->mu,
                              .mu2 = said->mu2,
                              .rho = said->rho[0],
                              .rho2 = said->rho[1],
                              .rhoN = said->rho[2],
                              .bounce = said->bounce,
                              .bounce_vel = said->bounce_speed,
                              .soft_erp = said->soft_erp,
                              .soft_cfm = said->soft_cfm,
                              .motion1 = said->motion[0],
                              .motion2 = said->motion[1],
                              .motionN = said->motion[2],
                              .slip1 = said->slip[0],
                              .slip2 = said->slip[1]};
}

/* A direction that has no length is ODE's own. */
static void direction_settle(hap_contact *io)
{
  double length = hapi_v3_norm(io->direction);
  if ((io->surface.mode & dContactFDir1) != 0 && length > 1e-12) {
    hapi_v3_scale(1.0 / length, io->direction, io->direction);
  } else {
    io->surface.mode &= ~dContactFDir1;
    hapi_v3_set(io->direction, 0.0, 0.0, 0.0);
  }
}

/* *out: what is said now, where that is OWN. */
static hapi_verdict contact_ask(const hapi_contact_caller *caller, const hapi_said_surface *said,
                                hap_contact *io, hapi_said_surface *out)
{
  io->size = sizeof *io;
  hapi_said_surface_give(said, &io->surface);
  hapi_v3_copy(said->direction, io->direction);
  if (!caller->call(caller->user, io)) {
    return HAPI_VERDICT_DROPPED;
  }
  bool directed = (io->surface.mode & dContactFDir1) != 0;
  if (!hapi_surface_is_sound(&io->surface) || (directed && !hapi_finite(io->direction, 3))) {
    caller->report(caller->report_user, HAP_FAULT_WORLD,
                   "the contact callback gave a number that is not finite, or a friction, softness "
                   "or slip below 0: the contact has the surface of its pair");
    return HAPI_VERDICT_KEPT;
  }
  direction_settle(io);
  hapi_said_surface_of(&io->surface, io->direction, out);
  return memcmp(out, said, sizeof *out) == 0 ? HAPI_VERDICT_KEPT : HAPI_VERDICT_OWN;
}

int hapi_contact_call(const void *of, const hapi_surface_terms *terms, const hapi_near_said *said,
                      const hapi_pair_tags *tags, const hapi_contact_spot *spot,
                      hapi_surface *out_surface)
{
  hapi_said_surface own;
  dSurfaceParameters surface;
  hap_contact contact = {.in_loop = 1,
                         .a = tags->geom_a,
                         .b = tags->geom_b,
                         .data_a = said->data_a,
                         .data_b = said->data_b,
                         .depth = -spot->gap};
  hapi_v3_copy(spot->point, contact.point);
  hapi_v3_copy(spot->normal, contact.normal);
  hapi_v3_scale(1.0 / terms->scale, spot->velocity, contact.velocity);
  hapi_verdict verdict = contact_ask(of, &said->said, &contact, &own);
  if (verdict == HAPI_VERDICT_OWN) {
    hapi_said_surface_give(&own, &surface);
    hapi_surface_make(terms, &surface, out_surface);
    hapi_v3_copy(own.direction, out_surface->direction);
  }
  return (int)verdict;
}

static hapi_verdict step_verdict(hapi_world_asking *asking, const dContact *of,
                                 const hapi_said_surface *said, const double velocity[3],
                                 hapi_said_surface *out)
{
  if (asking->mode == HAPI_ASKING_PLAYS) {
    return hapi_verdicts_next(&asking->verdicts, out, sizeof *out);
  }
  hap_contact contact = {.a = of->geom.g1,
                         .b = of->geom.g2,
                         .data_a = dGeomGetData(of->geom.g1),
                         .data_b = dGeomGetData(of->geom.g2),
                         .depth = of->geom.depth};
  hapi_v3_copy(of->geom.pos, contact.point);
  hapi_v3_copy(of->geom.normal, contact.normal);
  hapi_v3_copy(velocity, contact.velocity);
  hapi_verdict verdict = contact_ask(&asking->caller, said, &contact, out);
  if (asking->mode == HAPI_ASKING_RECORDS) {
    hapi_verdicts_note(&asking->verdicts, verdict, out, sizeof *out);
  }
  return verdict;
}

bool hapi_world_ask_contact(hapi_world_asking *asking, dContact *io, const double velocity[3])
{
  static const double none[3] = {0.0, 0.0, 0.0};
  hapi_said_surface said;
  hapi_said_surface own;
  dSurfaceParameters surface;
  bool directed = (io->surface.mode & dContactFDir1) != 0;
  hapi_said_surface_of(&io->surface, directed ? io->fdir1 : none, &said);
  hapi_verdict verdict = step_verdict(asking, io, &said, velocity, &own);
  if (verdict != HAPI_VERDICT_OWN) {
    return verdict != HAPI_VERDICT_DROPPED;
  }
  hapi_said_surface_give(&own, &surface);
  if (hapi_surface_is_sound(&surface) && hapi_finite(own.direction, 3)) { /* a recording's, too */
    io->surface = surface;
    hapi_v3_copy(own.direction, io->fdir1);
  }
  return true;
}
