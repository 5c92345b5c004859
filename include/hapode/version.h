/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_VERSION_H
#define HAPODE_VERSION_H

#include <hapode/attributes.h>

HAP_BEGIN_DECLS

/* Version of these headers; the library's own: hap_version. */
#define HAP_VERSION_MAJOR 0 /* the first number: 0 until the API is settled */
#define HAP_VERSION_MINOR 2 /* goes up with every change of the API */
#define HAP_VERSION_PATCH 0 /* goes up with corrections */

/* [any] Version of the library that runs, such as "0.2.0". */
HAP_API const char *hap_version(void);

HAP_END_DECLS

#endif
