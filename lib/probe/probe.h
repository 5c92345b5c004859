/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PROBE_PROBE_H
#define HAPODE_PROBE_PROBE_H

/* Testing simulations: steps of the global world that are undone. */

#include <stdbool.h>

#include "probe/accelerance.h"
#include "probe/joint_probe.h"
#include "probe/reuse.h"
#include "probe/snapshot.h"
#include "probe/test_set.h"

typedef struct hapi_probe {
  hapi_snapshot snapshot;
  hapi_test_set test;
  hapi_reuse reuse;
  bool said_not_probed; /* of a transmission, once a session */
  bool said_not_held;   /* of a joint that cannot be measured, likewise */
} hapi_probe;

#endif
