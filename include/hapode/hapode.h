/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_HAPODE_H
#define HAPODE_HAPODE_H

/* Everything but the parts with ODE types (hapode/ode.h) and the part for people who write a
 * device (hapode/device_impl.h). */

#include <hapode/accuracy.h>
#include <hapode/attributes.h>
#include <hapode/device.h>
#include <hapode/effects.h>
#include <hapode/expert.h>
#include <hapode/forces.h>
#include <hapode/grab.h>
#include <hapode/hooks.h>
#include <hapode/identify.h>
#include <hapode/link.h>
#include <hapode/link_dds.h>
#include <hapode/outputs.h>
#include <hapode/pointer.h>
#include <hapode/pointer_set.h>
#include <hapode/record.h>
#include <hapode/remote.h>
#include <hapode/research.h>
#include <hapode/scene.h>
#include <hapode/session.h>
#include <hapode/spatial.h>
#include <hapode/stats.h>
#include <hapode/status.h>
#include <hapode/surface.h>
#include <hapode/touches.h>
#include <hapode/trace.h>
#include <hapode/version.h>

#endif
