/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_OWNED_RIG_H
#define HAPODE_TESTS_OWNED_RIG_H

/* A scene with session and pointers that belongs to the running test. Include after tap.h. */

#include "tools/rig.h"

static inline void rig_finish_owned(void *owned)
{
  rig_destroy(owned);
}

/* Goes when the test has ended, or by tap_release. What cannot be made ends the test. */
static inline rig *rig_own(const rig_options *options)
{
  hap_detail detail = {""};
  rig *r = tap_own(sizeof *r, rig_finish_owned);
  REQUIRE_SAY(rig_create(options, r, &detail) >= HAP_OK, "%s", detail.text);
  return r;
}

#endif
