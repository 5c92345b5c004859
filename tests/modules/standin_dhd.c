/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A stand-in for libdhd: the published functions of the Force Dimension SDK, metres and newtons,
 * over pretended hardware. STANDIN_OLD: a version without the function for gripper forces. */

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "standin_inner.h"

#define DHD_OLD 1

/* As the maker declares them. */
STANDIN_CALL int dhdOpen(void);
STANDIN_CALL int dhdOpenID(char id);
STANDIN_CALL int dhdClose(char id);
STANDIN_CALL int dhdGetDeviceCount(void);
STANDIN_CALL int dhdEnableForce(unsigned char on, char id);
STANDIN_CALL int dhdGetPositionAndOrientationFrame(double *x, double *y, double *z,
                                                   double frame[3][3], char id);
STANDIN_CALL int dhdGetLinearVelocity(double *x, double *y, double *z, char id);
STANDIN_CALL int dhdSetForceAndTorqueAndGripperForce(double fx, double fy, double fz, double tx,
                                                     double ty, double tz, double fg, char id);
STANDIN_CALL unsigned int dhdGetButtonMask(char id);
STANDIN_CALL bool dhdHasWrist(char id);
STANDIN_CALL bool dhdHasActiveWrist(char id);
STANDIN_CALL const char *dhdGetSystemName(char id);
STANDIN_CALL double dhdGetMaxForce(char id);
STANDIN_CALL double dhdGetComFreq(char id);
STANDIN_CALL int dhdGetStatus(int status[16], char id);
STANDIN_CALL const char *dhdErrorGetLastStr(void);

static const char *last_error = "no error";
static atomic_int inside; /* calls about positions and forces */

/* -1: no such device, or none that answers. */
static int device_enter(char id)
{
  int at = id < 0 ? 0 : id;
  if (at >= STANDIN_DEVICES) {
    last_error = "invalid index";
    return -1;
  }
  if (standin_fault_of(at) == STANDIN_UNPLUGGED) {
    last_error = "communication error";
    return -1;
  }
  if (atomic_load(&standin_get()->of[at].opened) == 0) {
    last_error = "device not ready";
    atomic_fetch_add(&standin_get()->misuse, 1);
    return -1;
  }
  return at;
}

int dhdGetDeviceCount(void)
{
  int fault = atomic_load(&standin_get()->of[0].fault);
  return fault == STANDIN_NOT_THERE || fault == STANDIN_UNPLUGGED
             ? 0
             : atomic_load(&standin_get()->count);
}

int dhdOpenID(char id)
{
  if (id < 0 || id >= dhdGetDeviceCount() || id >= STANDIN_DEVICES) {
    last_error = "no device found";
    return -1;
  }
  atomic_store(&standin_get()->of[(int)id].opened, 1);
  atomic_fetch_add(&standin_get()->of[(int)id].opens, 1);
  return id;
}

int dhdOpen(void)
{
  return dhdOpenID(0);
}

int dhdClose(char id)
{
  int at = device_enter(id);
  if (at < 0) {
    return -1;
  }
  atomic_store(&standin_get()->of[at].opened, 0);
  return 0;
}

int dhdEnableForce(unsigned char on, char id)
{
  int at = device_enter(id);
  if (at < 0 || atomic_load(&standin_get()->of[at].fault) == STANDIN_NOT_ENABLED) {
    last_error = "not available";
    return -1;
  }
  atomic_store(&standin_get()->of[at].enabled, on);
  return 0;
}

int dhdGetPositionAndOrientationFrame(double *x, double *y, double *z, double frame[3][3], char id)
{
  double p[3];
  double v[3];
  if (atomic_fetch_add(&inside, 1) != 0 && atomic_load(&standin_get()->count) == 1) {
    atomic_fetch_add(&standin_get()->misuse, 1);
  }
  int at = device_enter(id);
  atomic_fetch_sub(&inside, 1);
  int fault = at >= 0 ? atomic_load(&standin_get()->of[at].fault) : STANDIN_READ_FAILS;
  if (fault == STANDIN_READ_FAILS) {
    last_error = "communication error";
    return -1;
  }
  int late = atomic_load(&standin_get()->of[at].late_ms);
  if (late > 0) {
    standin_sleep_ms(late);
  }
  standin_motion(at, p, v);
  standin_rotation(at, frame);
  *x = fault == STANDIN_NAN ? NAN : p[0];
  *y = p[1];
  *z = p[2];
  frame[0][0] = fault == STANDIN_BAD_FRAME ? 7.0 : frame[0][0];
  return fault == STANDIN_SILENT ? DHD_OLD : 0;
}

int dhdGetLinearVelocity(double *x, double *y, double *z, char id)
{
  double p[3];
  double v[3];
  int at = device_enter(id);
  if (at < 0) {
    return -1;
  }
  standin_motion(at, p, v);
  *x = v[0];
  *y = v[1];
  *z = v[2];
  return 0;
}

#ifndef STANDIN_OLD
int dhdSetForceAndTorqueAndGripperForce(double fx, double fy, double fz, double tx, double ty,
                                        double tz, double fg, char id)
{
  const double force[3] = {fx, fy, fz};
  const double torque[3] = {tx, ty, tz};
  int at = device_enter(id);
  (void)fg;
  if (at < 0 || atomic_load(&standin_get()->of[at].fault) == STANDIN_FORCE_FAILS) {
    last_error = "the force is not available";
    return -1;
  }
  standin_force(at, force, torque);
  return 0;
}
#endif

unsigned int dhdGetButtonMask(char id)
{
  int at = device_enter(id);
  return at >= 0 ? (unsigned)atomic_load(&standin_get()->of[at].buttons) : 0;
}

bool dhdHasWrist(char id)
{
  (void)id;
  return atomic_load(&standin_get()->wrist) > 0;
}

bool dhdHasActiveWrist(char id)
{
  (void)id;
  return atomic_load(&standin_get()->wrist) > 1;
}

const char *dhdGetSystemName(char id)
{
  (void)id;
  return atomic_load(&standin_get()->wrist) > 1 ? "sigma.7" : "omega.6";
}

double dhdGetMaxForce(char id)
{
  (void)id;
  return -1.0;
}

double dhdGetComFreq(char id)
{
  return device_enter(id) >= 0 ? 3.9 : 0.0; /* kHz */
}

int dhdGetStatus(int status[16], char id)
{
  int at = device_enter(id);
  if (at < 0) {
    return -1;
  }
  int fault = atomic_load(&standin_get()->of[at].fault);
  memset(status, 0, 16 * sizeof *status);
  status[0] = fault != STANDIN_NO_POWER;
  status[1] = 1;
  status[3] = fault != STANDIN_NOT_READY;
  return 0;
}

const char *dhdErrorGetLastStr(void)
{
  return last_error;
}
