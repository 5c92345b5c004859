/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_FUZZ_DEVICE_CHECK_H
#define HAPODE_TESTS_FUZZ_DEVICE_CHECK_H

#include <hapode/device.h>

/* Opens spec, holds the device against what device_impl.h promises a session over some reads and
 * writes, and closes it. */
void fuzz_device(const char *spec);

#endif
