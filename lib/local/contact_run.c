/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "local/contact_run.h"

#include <math.h>
#include <string.h>

#include "base/assert.h"

/* Less than the exact bounds, as these and the gaps are rounded. */
#define SLACK (1.0 - 1e-6)
#define SLACK_WAY 1e-14 /* m */

static bool joins_run(const hapi_contact_run *run, const hapi_contact_kept *kept)
{
  return run->body_a == kept->body_a && run->body_b == kept->body_b &&
         memcmp(run->normal, kept->normal, sizeof run->normal) == 0;
}

static void run_begin(hapi_contact_run *run, const hapi_contact_kept *kept,
                      const hapi_pair_stays *stays)
{
  *run = (hapi_contact_run){.stay_a = kept->stay_a,
                            .stay_b = kept->stay_b,
                            .body_a = kept->body_a,
                            .body_b = kept->body_b,
                            .slow = stays->a->slow && stays->b->slow,
                            .margin = HUGE_VAL,
                            .way2 = HUGE_VAL,
                            .open = HUGE_VAL};
  hapi_v3_copy(stays->apart, run->apart);
  hapi_v3_copy(stays->a->moved + 3, run->angle_a);
  hapi_v3_copy(stays->b->moved + 3, run->angle_b);
  hapi_v3_copy(kept->normal, run->normal);
  hapi_v3_copy(kept->turn_a, run->turn_a);
  hapi_v3_copy(kept->turn_b, run->turn_b);
}

static void run_add_rows(hapi_contact_run *run, uint32_t index, const hapi_contact_kept *kept,
                         double gap)
{
  double margin = hapi_min(-gap, gap - kept->least);
  if (run->rows == 0) {
    run->lead = index;
    run->first = kept->first;
  }
  HAPI_ASSERT(run->first + run->rows == kept->first);
  run->rows = (uint16_t)(run->rows + kept->count);
  run->by_mass = (uint16_t)(run->by_mass + kept->by_mass);
  run->margin = hapi_min(run->margin, SLACK * margin - SLACK_WAY);
}

static void run_add_apart(hapi_contact_run *run, const hapi_contact_kept *kept, double gap)
{
  run->open = hapi_min(run->open, SLACK * (gap - HAPI_OPEN_FLOOR));
  run->reach_a = hapi_max(run->reach_a, kept->reach_a);
  run->reach_b = hapi_max(run->reach_b, kept->reach_b);
}

void hapi_run_add(hapi_body_contacts *contacts, uint32_t index, const hapi_pair_stays *stays,
                  double gap)
{
  const hapi_contact_kept *kept = &contacts->memory[index].kept;
  bool has_rows = kept->what == HAPI_KEPT_ROWS;
  HAPI_ASSERT(has_rows || kept->what == HAPI_KEPT_APART);
  if (has_rows && (!kept->plain || kept->slides)) {
    hapi_run_close(contacts);
    return;
  }
  if (contacts->run == HAPI_SLOT_NONE || contacts->run_lengths[contacts->run] == HAPI_RUN_MOST ||
      !joins_run(&contacts->runs[contacts->run], kept)) {
    contacts->run = index;
    run_begin(&contacts->runs[index], kept, stays);
  }
  hapi_contact_run *run = &contacts->runs[contacts->run];
  double turn_a[3];
  double turn_b[3];
  double skew[3];
  double way[3];
  HAPI_ASSERT(contacts->run + contacts->run_lengths[contacts->run] == index);
  ++contacts->run_lengths[contacts->run];
  hapi_v3_sub(kept->turn_a, run->turn_a, turn_a);
  hapi_v3_sub(kept->turn_b, run->turn_b, turn_b);
  hapi_v3_add(turn_a, turn_b, skew);
  run->radius2 = hapi_max(run->radius2, hapi_v3_dot(turn_a, turn_a));
  run->skew2 = hapi_max(run->skew2, hapi_v3_dot(skew, skew));
  hapi_v3_sub(stays->apart, kept->apart, way);
  double left = SLACK * sqrt(hapi_kept_way2(kept, stays)) - hapi_v3_norm(way);
  run->way2 = left > 0.0 ? hapi_min(run->way2, left * left) : 0.0;
  if (has_rows) {
    run_add_rows(run, index, kept, gap);
  } else {
    run_add_apart(run, kept, gap);
  }
}

/* m: upper bound of the change of any gap since the run was made. With way w and turns A and B of
 * the bodies a gap changes by n.w + turn_a.A + turn_b.B, to first order. That of the first contact
 * is exact; another one differs by d_a.A + d_b.B = d_a.(A - B) + (d_a + d_b).B. */
static double run_change(const hapi_contact_run *run, const hapi_pair_stays *stays,
                         const double way[3])
{
  double angle_a[3];
  double angle_b[3];
  double against[3];
  hapi_v3_sub(stays->a->moved + 3, run->angle_a, angle_a);
  hapi_v3_sub(stays->b->moved + 3, run->angle_b, angle_b);
  hapi_v3_sub(angle_a, angle_b, against);
  double first = hapi_v3_dot(run->normal, way) + hapi_v3_dot(run->turn_a, angle_a) +
                 hapi_v3_dot(run->turn_b, angle_b);
  double others2 =
      run->radius2 * hapi_v3_dot(against, against) + run->skew2 * hapi_v3_dot(angle_b, angle_b);
  return fabs(first) + sqrt(2.0 * others2); /* x + y <= sqrt(2 (x^2 + y^2)) */
}

bool hapi_run_holds(const hapi_contact_run *run, const hapi_pair_stays *stays, double period)
{
  double way[3];
  hapi_v3_sub(stays->apart, run->apart, way);
  double change = run_change(run, stays, way);
  return stays->a->number == run->stay_a && stays->b->number == run->stay_b &&
         (run->slow || !stays->a->slow || !stays->b->slow) && hapi_v3_dot(way, way) <= run->way2 &&
         change <= run->margin &&
         (run->open == HUGE_VAL ||
          change + hapi_pair_closing(stays, run->reach_a, run->reach_b, period) < run->open);
}
