/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_HOOKS_H
#define HAPODE_BASE_HOOKS_H

#include <hapode/hooks.h>

/* The hooks in force; every member but user is callable. Only base/ calls through them. */
const hap_hooks *hapi_hooks(void);

#endif
