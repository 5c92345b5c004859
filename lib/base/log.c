/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/log.h"

#include <stdarg.h>
#include <stdio.h>

#include "base/alloc.h"

void hapi_log(hap_log_level level, const char *format, ...)
{
  char text[1024];
  va_list list;
  va_start(list, format);
  int length = vsnprintf(text, sizeof text, format, list);
  va_end(list);
  if (length < 0) {
    return;
  }
  const hap_hooks *hooks = hapi_hooks();
  hooks->log(level, text, hooks->user);
}

hap_status hapi_fail(hap_detail *detail, hap_status status, const char *format, ...)
{
  if (detail == NULL) {
    return status;
  }
  va_list list;
  va_start(list, format);
  int length = vsnprintf(detail->text, sizeof detail->text, format, list);
  va_end(list);
  if (length < 0) {
    detail->text[0] = '\0';
  }
  return status;
}
