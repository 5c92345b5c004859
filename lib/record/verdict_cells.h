/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_RECORD_VERDICT_CELLS_H
#define HAPODE_RECORD_VERDICT_CELLS_H

/* The verdicts of a step, or of a pass, in a recording. They stand behind its last cell, which says
 * so by its index: a VERDICTS, then VERDICT cells with two bits for each verdict, then those with
 * the surfaces. */

#include "base/verdicts.h"
#include "record/tape.h"

/* RECORD. Behind the cell, the last one that was put; it must not be committed before. */
void hapi_verdicts_put(const hapi_verdicts *verdicts, hapi_tape *tape, hapi_cell *io_cell);

/* PLAY. A cell that verdicts may follow, and the verdicts, if they do. */
const hapi_cell *hapi_verdicts_get(hapi_verdicts *verdicts, hapi_tape *tape, hapi_cell_kind kind);

#endif
