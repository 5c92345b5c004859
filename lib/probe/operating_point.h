/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PROBE_OPERATING_POINT_H
#define HAPODE_PROBE_OPERATING_POINT_H

/* The answer of whole bodies in model CONTACT, by testing simulations. */

#include "near/slots.h"
#include "probe/probe.h"
#include "world/cycle.h"
#include "world/world.h"

void hapi_operating_point_measure(hapi_probe *probe);

#endif
