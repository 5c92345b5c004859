/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PROBE_JOINT_PROBE_H
#define HAPODE_PROBE_JOINT_PROBE_H

/* What is kept of joints that the loop has no rows of its own for. */

#include <stdbool.h>
#include <stdint.h>

#include <ode/ode.h>

#include "near/slots.h"
#include "probe/probe.h"
#include "sync/messages.h"
#include "world/cycle.h"
#include "world/world.h"

/* Of the joints that the range's walk of this number has taken, and of those that kept it from
 * taking a mechanism. Their measurements belong to the joints. */
void hapi_joint_probes(hapi_probe *probe, hapi_joint_table *joints, uint64_t walk);

#endif
