/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_HOOKS_H
#define HAPODE_HOOKS_H

#include <stddef.h>

#include <hapode/attributes.h>
#include <hapode/status.h>

HAP_BEGIN_DECLS

/* How much a line of the log matters. Values are never renumbered. */
typedef enum hap_log_level {
  HAP_LOG_ERROR = 0,   /* something was not done */
  HAP_LOG_WARNING = 1, /* it was done, but not as well as it should */
  HAP_LOG_INFO = 2     /* what happens */
} hap_log_level;

/* The process-wide hooks. A member left NULL keeps its default: malloc, free, and a log that is
 * thrown away. */
typedef struct hap_hooks {
  void *(*allocate)(size_t size, void *user); /* as malloc; NULL is a legal answer */
  void (*release)(void *memory, void *user);  /* as free */
  void (*log)(hap_log_level level, const char *text, void *user); /* any thread but the haptic */
  void *user;
} hap_hooks;

/* [control] Sets the hooks, or the defaults when hooks is NULL. Call it before any other function
 * of the library and not again while an object of the library lives. */
HAP_API hap_status hap_hooks_set(const hap_hooks *hooks);

HAP_END_DECLS

#endif
