/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_TOOL_ADOPT_H
#define HAPODE_LOCAL_TOOL_ADOPT_H

/* The contacts of hulls, of a new model or new patches. */

#include "local/body.h"
#include "local/touch.h"
#include "pointer/pointer.h"

/* Before a model's spheres are taken: their places. */
void hapi_tool_set_aside(hapi_touches *touches);

/* After them. */
void hapi_tool_adopt_model(hapi_touches *touches, const hapi_pointers *pointers,
                           const hapi_bodies *bodies, hapi_model *model);

/* Model CONTACT. */
void hapi_tool_adopt_patches(hapi_touches *touches, const hapi_pointers *pointers,
                             const hapi_bodies *bodies, hapi_patches *patches, uint32_t wishes);

#endif
