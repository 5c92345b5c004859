/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_LOG_H
#define HAPODE_BASE_LOG_H

#include <hapode/attributes.h>
#include <hapode/hooks.h>
#include <hapode/status.h>

/* Not for the haptic thread. */
void hapi_log(hap_log_level level, const char *format, ...) HAP_PRINTF(2, 3);

/* Writes the text (cut at the size of detail) and gives back status, so that a check can be
 * one line: return hapi_fail(detail, HAP_ERROR_ARGUMENT, "..."); detail may be NULL. */
hap_status hapi_fail(hap_detail *detail, hap_status status, const char *format, ...)
    HAP_PRINTF(3, 4);

/* Returns from the calling function whatever of a call is not HAP_OK. */
#define HAPI_TRY(call)         \
  do {                         \
    hap_status tried = (call); \
    if (tried != HAP_OK) {     \
      return tried;            \
    }                          \
  } while (0)

#endif
