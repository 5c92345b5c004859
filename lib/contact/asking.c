/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "contact/asking.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"

bool hapi_asking_create(hapi_asking *asking, uint32_t contacts)
{
  asking->spots = hapi_alloc_array(contacts, sizeof *asking->spots);
  asking->pairs = hapi_alloc_array(contacts, sizeof *asking->pairs);
  asking->surfaces = hapi_alloc_array(contacts, sizeof *asking->surfaces);
  asking->tags = hapi_alloc_array(contacts, sizeof *asking->tags);
  return asking->spots != NULL && asking->pairs != NULL && asking->surfaces != NULL &&
         asking->tags != NULL;
}

void hapi_asking_finish(hapi_asking *asking)
{
  hapi_free(asking->spots);
  hapi_free(asking->pairs);
  hapi_free(asking->surfaces);
  hapi_free(asking->tags);
  hapi_verdicts_finish(&asking->verdicts);
  asking->spots = NULL;
  asking->pairs = NULL;
  asking->surfaces = NULL;
  asking->tags = NULL;
}

void hapi_asking_begin(hapi_asking *asking, hapi_tape *tape, uint32_t contacts)
{
  hapi_verdicts_clear(&asking->verdicts);
  if (!hapi_tape_plays(tape)) {
    return;
  }
  asking->played = hapi_verdicts_get(&asking->verdicts, tape, HAPI_CELL_PASS);
  bool needs_room = asking->verdicts.count > 0 && asking->spots == NULL;
  if (needs_room && !hapi_asking_create(asking, contacts)) {
    hapi_asking_finish(asking);
    tape->broken = true;
  }
}

/* What a tick would make NaN of; a recording comes from outside. */
static bool surface_is_sound(const hapi_surface *s)
{
  const double finite[] = {s->direction[0], s->direction[1], s->direction[2], s->bounce,
                           s->bounce_speed, s->erp,          s->cfm,          s->layer,
                           s->motion[0],    s->motion[1],    s->motion[2],    s->slip[0],
                           s->slip[1]};
  for (size_t i = 0; i < sizeof finite / sizeof finite[0]; ++i) {
    if (!isfinite(finite[i])) {
      return false;
    }
  }
  return s->mu >= 0.0 && s->mu2 >= 0.0 && s->max_push >= 0.0 && s->cfm >= 0.0 &&
         s->slip[0] >= 0.0 && s->slip[1] >= 0.0;
}

static hapi_verdict asking_verdict(hapi_asking *asking, hapi_near *near, const hapi_tape *tape,
                                   uint32_t contact, uint32_t surface, hapi_surface *out)
{
  if (hapi_tape_plays(tape)) {
    hapi_verdict verdict = hapi_verdicts_next(&asking->verdicts, out, sizeof *out);
    return verdict == HAPI_VERDICT_OWN && !surface_is_sound(out) ? HAPI_VERDICT_KEPT : verdict;
  }
  HAPI_ASSERT_INDEX(asking->pairs[surface], near->said_count);
  hapi_verdict verdict = (hapi_verdict)asking->ask(
      asking->of, &near->terms, &hapi_near_saids(near)[asking->pairs[surface]],
      &asking->tags[surface], &asking->spots[contact], out);
  if (hapi_tape_records(tape)) {
    hapi_verdicts_note(&asking->verdicts, verdict, out, sizeof *out);
  }
  return verdict;
}

/* Which surface of the message the contact has; beyond the others: a new one. */
static uint32_t surface_place(hapi_patches *patches, const hapi_surface *surface,
                              const hapi_pair_tags *tags)
{
  uint32_t last = patches->surface_count - 1;
  bool same = patches->surface_count > 0 &&
              memcmp(&hapi_patches_surfaces(patches)[last], surface, sizeof *surface) == 0 &&
              memcmp(&hapi_patches_pairs(patches)[last], tags, sizeof *tags) == 0;
  return same ? last : patches->surface_count;
}

void hapi_asking_run(hapi_asking *asking, hapi_near *near, const hapi_tape *tape, hapi_patches *io)
{
  bool asks = hapi_tape_plays(tape) ? asking->verdicts.count > 0
                                    : asking->ask != NULL && near->said_count > 0;
  if (!asks) {
    return;
  }
  io->contents = 0;
  uint32_t kept = 0;
  memcpy(asking->surfaces, hapi_patches_surfaces(io), io->surface_count * sizeof *asking->surfaces);
  memcpy(asking->tags, hapi_patches_pairs(io), io->surface_count * sizeof *asking->tags);
  io->surface_count = 0;
  for (uint32_t i = 0; i < io->contact_count; ++i) {
    hapi_patch_contact *contact = &hapi_patches_contacts(io)[i];
    hapi_surface surface;
    uint32_t of = contact->surface;
    memset(&surface, 0, sizeof surface);
    hapi_verdict verdict = asking_verdict(asking, near, tape, i, of, &surface);
    if (verdict == HAPI_VERDICT_DROPPED) {
      continue;
    }
    const hapi_surface *has = verdict == HAPI_VERDICT_OWN ? &surface : &asking->surfaces[of];
    contact->surface = surface_place(io, has, &asking->tags[of]);
    hapi_patches_surfaces(io)[contact->surface] = *has;
    hapi_patches_pairs(io)[contact->surface] = asking->tags[of];
    io->surface_count =
        contact->surface == io->surface_count ? io->surface_count + 1 : io->surface_count;
    hapi_patches_contacts(io)[kept++] = *contact;
  }
  io->contact_count = kept;
}
