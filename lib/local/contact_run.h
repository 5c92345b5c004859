/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_CONTACT_RUN_H
#define HAPODE_LOCAL_CONTACT_RUN_H

/* Kept contacts of a pair that follow each other and share a normal, of which all stay: their rows
 * stand one behind the other and ask for what they asked for, or they are too far open for rows.
 * While the bodies have gone less since than each of them allows, none of them is looked at. */

#include "local/body_stay.h"
#include "local/contact_memory.h"

/* More open than this, and than what its bodies close in some ticks, a contact has no rows. */
#define HAPI_OPEN_FLOOR 1e-3 /* m */
#define HAPI_OPEN_TICKS 3.0

struct hapi_contact_run {
  uint64_t stay_a;
  uint64_t stay_b;
  uint32_t body_a; /* slots */
  uint32_t body_b;
  uint32_t lead;  /* the first contact with rows */
  uint32_t first; /* where they stand */
  uint16_t rows;
  uint16_t by_mass; /* contacts, see hapi_contact_stands */
  bool slow;        /* both bodies were, when it was made */
  double margin;    /* m: by which the gaps of those with rows may change, HUGE_VAL: none; */
  double way2;      /* m^2: how far the bodies may go against each other; */
  double open; /* m: how near those without rows may come, see HAPI_OPEN_FLOOR; HUGE_VAL: none */
  double apart[3];   /* of hapi_pair_stays, when it was made; */
  double angle_a[3]; /* likewise rad, of the stays' moved + 3 */
  double angle_b[3];
  double normal[3];
  double turn_a[3]; /* of the first contact, see hapi_contact_kept */
  double turn_b[3];
  double radius2; /* m^2: most of another one's turn_a - turn_a, */
  double skew2;   /* m^2: of the sum of that and of the same of b; 0 but for when they were made */
  double reach_a; /* m, of those without rows */
  double reach_b;
};

/* The stays of the bodies of a contact, and how far a has gone from b since they began. */
typedef struct hapi_pair_stays {
  const hapi_body_stay *a;
  const hapi_body_stay *b;
  double apart[3]; /* m */
} hapi_pair_stays;

static inline void hapi_pair_stays_find(const hapi_local_body *a, const hapi_local_body *b,
                                        hapi_pair_stays *out)
{
  out->a = hapi_stay_of(a);
  out->b = hapi_stay_of(b);
  hapi_v3_sub(out->a->moved, out->b->moved, out->apart);
}

/* m: of points as far from the centres of the bodies, how much nearer they may come in
 * HAPI_OPEN_TICKS. */
static inline double hapi_pair_closing(const hapi_pair_stays *stays, double reach_a, double reach_b,
                                       double period)
{
  double speed_a = stays->a->speed + reach_a * stays->a->spin;
  double speed_b = stays->b->speed + reach_b * stays->b->spin;
  return HAPI_OPEN_TICKS * period * (speed_a + speed_b);
}

/* m^2: how far the bodies of a kept contact may go against each other. */
static inline double hapi_kept_way2(const hapi_contact_kept *kept, const hapi_pair_stays *stays)
{
  const double slow2 = HAPI_STAY_SLOW_WAY * HAPI_STAY_SLOW_WAY;
  return stays->a->slow && stays->b->slow ? hapi_min(slow2, kept->way2) : kept->way2;
}

/* A kept contact that was just looked at, with its gap of now [m]. Contacts come in their order. */
void hapi_run_add(hapi_body_contacts *contacts, uint32_t index, const hapi_pair_stays *stays,
                  double gap);

/* The next contact belongs to none of those that came so far. */
static inline void hapi_run_close(hapi_body_contacts *contacts)
{
  contacts->run = HAPI_SLOT_NONE;
}

/* Whether no contact of it can have gone beyond what it allows. Not whether its rows stand. */
bool hapi_run_holds(const hapi_contact_run *run, const hapi_pair_stays *stays, double period);

#endif
