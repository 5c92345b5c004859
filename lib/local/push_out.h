/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_PUSH_OUT_H
#define HAPODE_LOCAL_PUSH_OUT_H

/* Push-out and the closing of joints move the bodies, and are not to stay in their velocities:
 * poses first, then a second solve without them. What pushes out in one tick does so in the next
 * ones, and the impulses of both solves differ by all that it takes to lift. Where that is dear,
 * each of them goes on from the impulses of its own one in the tick before. */

#include "local/rows.h"

/* Before the first solve of a tick, after its rows. */
void hapi_push_out_begin(hapi_rows *rows);
/* After it: whether something pushed out, so that there has to be a second one. */
bool hapi_push_out_acts(hapi_rows *rows);
/* Before the second one, when the bodies are where the first one moved them. */
void hapi_push_out_stop(hapi_rows *rows);
/* After it: what was set for it alone is taken back. */
void hapi_push_out_end(hapi_rows *rows);

#endif
