/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_CONTACT_RUN_H
#define HAPODE_LOCAL_CONTACT_RUN_H

/* A run: neighbours in the list of contacts, of the same two bodies, with the same normal and kept
 * from the tick before. Each either has rows that need no change, or is too far open for rows. A
 * run knows the smallest motion of the bodies that changes this for any of its contacts. Until then
 * the tick looks at the run alone. */

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
  uint16_t by_mass;  /* contacts, see hapi_contact_stands */
  bool slow;         /* both bodies were slow when the run was made */
  double margin;     /* m: gaps of contacts with rows may change by so much; HUGE_VAL: no rows */
  double way2;       /* m^2: square of the way that the bodies may go against each other */
  double open;       /* m: contacts without rows may close by so much; HUGE_VAL: all have rows */
  double apart[3];   /* m: hapi_pair_stays.apart when the run was made */
  double angle_a[3]; /* rad: turn of a since its stay began, when the run was made */
  double angle_b[3];
  double normal[3];
  double turn_a[3]; /* of the first contact, see hapi_contact_kept */
  double turn_b[3];
  double
      radius2;  /* m^2: largest |d_a|^2, with d_a = turn_a of another contact - turn_a; d_b alike */
  double skew2; /* m^2: largest |d_a + d_b|^2. Contacts that were made at once have d_b = -d_a */
  double reach_a; /* m: largest of contacts without rows, see hapi_contact_kept */
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

/* m: what a gap may close in HAPI_OPEN_TICKS. reach: of its point from the bodies' centres. */
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

/* Adds a kept contact that was just looked at, in the order of the contacts, with its gap [m] in
 * this tick. */
void hapi_run_add(hapi_body_contacts *contacts, uint32_t index, const hapi_pair_stays *stays,
                  double gap);

/* The next contact does not join the run that is being made. */
static inline void hapi_run_close(hapi_body_contacts *contacts)
{
  contacts->run = HAPI_SLOT_NONE;
}

/* Whether the motion of the bodies is small enough for all contacts. The caller knows whether the
 * rows are still in their places. */
bool hapi_run_holds(const hapi_contact_run *run, const hapi_pair_stays *stays, double period);

#endif
