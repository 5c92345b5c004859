/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_LOGGED_H
#define HAPODE_TESTS_LOGGED_H

/* What the library logs, kept for a test to look at. Include after tap.h. */

#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include <hapode/hooks.h>

static char logged[2048];

static inline void log_keep(hap_log_level level, const char *text, void *user)
{
  (void)user;
  (void)level;
  size_t used = strlen(logged);
  snprintf(logged + used, sizeof logged - used, "%s\n", text);
}

static inline void log_listen(bool listen)
{
  hap_hooks hooks;
  hap_hooks_init(&hooks, sizeof hooks);
  hooks.log = listen ? log_keep : NULL;
  REQUIRE(hap_hooks_set(&hooks) == HAP_OK);
}

#endif
