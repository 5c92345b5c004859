/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_TOUCH_ADOPT_H
#define HAPODE_LOCAL_TOUCH_ADOPT_H

#include "local/body.h"
#include "local/touch.h"
#include "pointer/pointer.h"

/* The contacts of pointers of a new model, whose bodies have been adopted. */
void hapi_touches_adopt(hapi_touches *touches, const hapi_pointers *pointers,
                        const hapi_bodies *bodies, hapi_model *model);

#endif
