/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Which rows of a scene are worth their time: those to which no other one is at least as good in less
 * time. Errors are those from the first start, which every row has, and an error below the noise
 * floor is none that could be told from it. */

#include <math.h>
#include <string.h>

#include "bench/accuracy.h"

#define TIME_NOISE 0.9 /* of a time: nearer ones cannot be told apart in a single run */

bool accuracy_is_choice(const accuracy_row *row)
{
  hap_coupling coupling;
  return strcmp(row->knob, ACCURACY_SPEED) != 0 && strcmp(row->knob, ACCURACY_AGE) != 0 &&
         !bench_find_coupling(row->knob, &coupling);
}

double accuracy_front_error(const accuracy_row *row)
{
  return fmax(row->first_force, row->noise_floor);
}

/* a leaves no reason to take b. */
static bool beats(const accuracy_row *a, const accuracy_row *b)
{
  double error_a = accuracy_front_error(a);
  double error_b = accuracy_front_error(b);
  return error_a <= error_b && a->duty <= b->duty && (error_a < error_b || a->duty < b->duty);
}

void accuracy_mark_front(accuracy_row *rows, size_t count)
{
  for (size_t i = 0; i < count; ++i) {
    bool beaten = !accuracy_is_choice(&rows[i]);
    for (size_t k = 0; k < count && !beaten; ++k) {
      beaten = accuracy_is_choice(&rows[k]) && beats(&rows[k], &rows[i]);
    }
    rows[i].front = beaten ? 0.0 : 1.0;
  }
}

/* The fastest that is as accurate as this one. */
static const accuracy_row *faster_than(const accuracy_row *rows, size_t count,
                                       const accuracy_row *of)
{
  const accuracy_row *best = of;
  for (size_t i = 0; i < count; ++i) {
    bool as_good = accuracy_front_error(&rows[i]) <= accuracy_front_error(of);
    best = rows[i].front > 0.0 && as_good && rows[i].duty < best->duty ? &rows[i] : best;
  }
  return best;
}

/* The most accurate that takes no longer. */
static const accuracy_row *better_than(const accuracy_row *rows, size_t count,
                                       const accuracy_row *of)
{
  const accuracy_row *best = of;
  for (size_t i = 0; i < count; ++i) {
    bool better = accuracy_front_error(&rows[i]) < accuracy_front_error(best);
    best = rows[i].front > 0.0 && rows[i].duty <= of->duty && better ? &rows[i] : best;
  }
  return best;
}

void accuracy_label(const accuracy_row *row, char out[ACCURACY_LABEL_MAX])
{
  int length = snprintf(out, ACCURACY_LABEL_MAX, "%s %g Hz", row->model, row->physics_hz);
  char *end = out + length;
  size_t room = ACCURACY_LABEL_MAX - (size_t)length;
  if (accuracy_knob_has_value(row->knob)) {
    snprintf(end, room, ", %s %g", row->knob, row->value);
  } else if (strcmp(row->knob, ACCURACY_DEFAULT) != 0) {
    snprintf(end, room, ", %s", row->knob);
  }
}

static void say_how_far(const accuracy_row *rows, size_t count, const accuracy_row *of,
                        const char *what)
{
  char label[ACCURACY_LABEL_MAX];
  const accuracy_row *fast = faster_than(rows, count, of);
  const accuracy_row *good = better_than(rows, count, of);
  if (good == of && fast->duty >= TIME_NOISE * of->duty) {
    bench_say("%s: %s is on the front", of->scene, what);
    return;
  }
  accuracy_label(fast, label);
  bench_say("%s: %s is off the front: %s is as accurate in %.2f of its time%s", of->scene, what,
            label, fast->duty / of->duty,
            good == of ? "; nothing is more accurate in its time" : "");
  if (good != of) {
    accuracy_label(good, label);
    bench_say("%s: %s: in no more time %s has %.2g of its error", of->scene, what, label,
              accuracy_front_error(good) / accuracy_front_error(of));
  }
}

void accuracy_report_front(const accuracy_row *rows, size_t count)
{
  for (size_t i = 0; i < count; ++i) {
    if (accuracy_row_is(&rows[i], HAP_MODEL_CONTACT, ACCURACY_DEFAULT) &&
        rows[i].physics_hz == ACCURACY_DEFAULT_HZ) {
      say_how_far(rows, count, &rows[i], "the default");
    } else if (accuracy_row_is(&rows[i], HAP_MODEL_ACCELERANCE, ACCURACY_PAPER) &&
               rows[i].physics_hz == ACCURACY_PAPER_HZ) {
      say_how_far(rows, count, &rows[i], "the paper's choice");
    }
  }
}
