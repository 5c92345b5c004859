/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "local/brace_rows.h"

#include <math.h>

#include "base/assert.h"

/* The brace is a friction between the body and the velocity that ODE left it: it opposes motion
 * along the last push, with an impulse between none and the brace's. So it takes energy, and never
 * pushes the body on. One acceleration for the whole interval, as a testing simulation tells it,
 * would push back what has stopped. */

/* Begins without an impulse: a solve that is not finished gives way. */
static void row_brace(const hapi_local_body *body, const double answer[6], double period,
                      hapi_row *out)
{
  const double *brace = body->given.brace;
  double size = sqrt(hapi_dot6(brace, answer) / body->inverse_mass); /* N, at the centre */
  memset(out, 0, sizeof *out);
  for (int i = 0; i < 6; ++i) {
    out->ja[i] = brace[i] / size;
    out->ba[i] = answer[i] / size;
  }
  out->a = body->row;
  out->b = HAPI_STATIC_ROW;
  out->single = 1;
  out->normal = -1;
  out->hi = size * period;
  out->target = hapi_v3_dot(out->ja, body->given.twist.linear) +
                hapi_v3_dot(out->ja + 3, body->given.twist.angular);
}

void hapi_brace_rows(const hapi_bodies *bodies, hapi_rows *rows, double period)
{
  hapi_solver *solver = &rows->solver;
  for (uint32_t i = 0; i < bodies->live_count; ++i) {
    const hapi_local_body *body = &bodies->of[bodies->live[i]];
    double answer[6];
    if ((body->flags & HAPI_BODY_BRACED) == 0 || !hapi_body_responds(body)) {
      continue;
    }
    hapi_row_response(body, body->given.brace, answer);
    if (hapi_dot6(body->given.brace, answer) > 0.0) {
      HAPI_ASSERT_INDEX(solver->row_count, rows->capacity);
      row_brace(body, answer, period, &solver->rows[solver->row_count]);
      rows->sources[solver->row_count] = (hapi_row_source){.contact = HAPI_SLOT_NONE,
                                                           .body_a = HAPI_SLOT_NONE,
                                                           .body_b = HAPI_SLOT_NONE,
                                                           .pointer = true};
      hapi_row_ready(solver, solver->row_count++);
    }
  }
}
