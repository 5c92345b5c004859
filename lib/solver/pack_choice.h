/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SOLVER_PACK_CHOICE_H
#define HAPODE_SOLVER_PACK_CHOICE_H

#include "solver/packs.h"

/* What this processor does best. Not on the tick: it asks the processor. */
const hapi_pack_work *hapi_pack_work_best(void);

#endif
