/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "world/cycle.h"

#include "base/log.h"

void hapi_say_once(const hapi_cycle *cycle, bool *io_said, const char *text)
{
  if (!*io_said) {
    hapi_log(HAP_LOG_WARNING, "%s", text);
    cycle->config->report(cycle->config->user, HAP_FAULT_NONE, text);
  }
  *io_said = true;
}
