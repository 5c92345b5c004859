/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_BODY_ADOPT_H
#define HAPODE_LOCAL_BODY_ADOPT_H

#include "local/body.h"
#include "local/facts.h"

/* The bodies of a new model of some age. before: the facts of the last one, at the time of now. */
void hapi_local_bodies_adopt(hapi_bodies *bodies, hapi_model *model, int64_t now_ns, double age_s,
                             const hapi_tick_facts *before);

#endif
