/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_HOOKS_H
#define HAPODE_HOOKS_H

/* The allocator and the log of the whole process. */

#include <stddef.h>
#include <stdint.h>

#include <hapode/attributes.h>
#include <hapode/status.h>

HAP_BEGIN_DECLS

/* How much a line of the log matters. Values are never renumbered. */
typedef enum hap_log_level {
  HAP_LOG_ERROR = 0,   /* something was not done */
  HAP_LOG_WARNING = 1, /* it was done, but not as well as it should be */
  HAP_LOG_INFO = 2     /* an event */
} hap_log_level;

/* The hooks. A member left NULL keeps its default: malloc, free, and a log that is thrown away. It
 * has a size and may grow at its end. */
typedef struct hap_hooks {
  uint32_t size;                              /* set by hap_hooks_init */
  uint32_t cookie;                            /* set by hap_hooks_init */
  void *(*allocate)(size_t size, void *user); /* as malloc; NULL is a legal answer. Any thread */
  void (*release)(void *memory, void *user);  /* as free. Any thread but the haptic */
  void (*log)(hap_log_level level, const char *text, void *user); /* any thread but the haptic */
  void *user; /* handed to all of them; the caller's */
} hap_hooks;

/* [any] All members NULL. size_of_hooks: sizeof *hooks of the caller's build. */
HAP_API void hap_hooks_init(hap_hooks *hooks, size_t size_of_hooks);

/* [control] Sets the hooks, which are copied; NULL: the defaults. Call it before any other function
 * of the library, and not again while an object of the library lives. HAP_ERROR_ARGUMENT: only one
 * of allocate and release. HAP_ERROR_UNINITIALISED: without hap_hooks_init. */
HAP_API hap_status hap_hooks_set(const hap_hooks *hooks);

HAP_END_DECLS

#endif
