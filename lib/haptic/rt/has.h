/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_HAPTIC_RT_HAS_H
#define HAPODE_HAPTIC_RT_HAS_H

/* Which effects this build of the tick has: all, unless the build option without_effects, or one of the
 * variants that bench counts instructions of, leaves some out. A constant beside the condition of the effect
 * lets the compiler drop all of it. */

#include <stdbool.h>

#ifdef HAPI_WITHOUT_CROSS
#define HAPI_HAS_CROSS false
#else
#define HAPI_HAS_CROSS true
#endif
#ifdef HAPI_WITHOUT_CONTACTS
#define HAPI_HAS_CONTACTS false
#else
#define HAPI_HAS_CONTACTS true
#endif
#ifdef HAPI_WITHOUT_JOINTS
#define HAPI_HAS_JOINTS false
#else
#define HAPI_HAS_JOINTS true
#endif
#ifdef HAPI_WITHOUT_RESTITUTION
#define HAPI_HAS_RESTITUTION false
#else
#define HAPI_HAS_RESTITUTION true
#endif
#ifdef HAPI_WITHOUT_FRICTION
#define HAPI_HAS_FRICTION false
#else
#define HAPI_HAS_FRICTION true
#endif
#ifdef HAPI_WITHOUT_TORQUE
#define HAPI_HAS_TORQUE false
#else
#define HAPI_HAS_TORQUE true
#endif
#ifdef HAPI_WITHOUT_GYRO
#define HAPI_HAS_GYRO false
#else
#define HAPI_HAS_GYRO true
#endif
#ifdef HAPI_WITHOUT_SHAPE
#define HAPI_HAS_SHAPE false
#else
#define HAPI_HAS_SHAPE true
#endif
#ifdef HAPI_WITHOUT_PROXY
#define HAPI_HAS_PROXY false
#else
#define HAPI_HAS_PROXY true
#endif
#ifdef HAPI_WITHOUT_OBSERVER
#define HAPI_HAS_OBSERVER false
#else
#define HAPI_HAS_OBSERVER true
#endif

#endif
