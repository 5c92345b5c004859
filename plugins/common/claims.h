/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_COMMON_CLAIMS_H
#define HAPODE_PLUGINS_COMMON_CLAIMS_H

/* Which hardware this process drives: two devices that write forces to one would fight, where a
 * maker's library or service lets them. */

#include <stdbool.h>

/* [control] False: somebody has that key, or there is no room. At most 95 characters count. */
bool hapi_claim(const void *owner, const char *key);

/* [control] Everything that the owner has. */
void hapi_unclaim(const void *owner);

#endif
