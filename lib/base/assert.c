/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/assert.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <hapode/device.h>

static void message_write(const char *text)
{
  size_t length = strlen(text);
  while (length > 0) {
    ssize_t written = write(STDERR_FILENO, text, length);
    if (written <= 0) {
      return;
    }
    text += written;
    length -= (size_t)written;
  }
}

/* People may hold the devices: their force goes to zero before anything else, even before the
 * message, which may block. A device whose zero fails an assert itself comes back here and ends the
 * process at once. */
_Noreturn void hapi_assert_failed(const char *condition, const char *file, int line)
{
  static _Thread_local bool failing;
  if (!failing) {
    failing = true;
    hap_emergency_zero();
  }
  char text[512];
  snprintf(text, sizeof text, "hapode: %s:%d: assert failed: %s\n", file, line, condition);
  message_write(text);
  abort();
}
