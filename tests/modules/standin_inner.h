/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_MODULES_STANDIN_INNER_H
#define HAPODE_TESTS_MODULES_STANDIN_INNER_H

/* What both stand-ins share. */

#include "standin.h"

#define STANDIN_CALL __attribute__((visibility("default")))

double standin_seconds(void);
void standin_sleep_ms(double ms);
void standin_motion(int id, double position[3], double velocity[3]);
void standin_rotation(int id, double r[3][3]);
void standin_force(int id, const double force[3], const double torque[3]);
/* Waits while it hangs. */
int standin_fault_of(int id);

#endif
