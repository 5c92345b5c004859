/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A stand-in for libHD: the published functions of HDAPI, millimetres and newtons, over pretended
 * hardware, with a scheduler of 1 kHz. */

#include <math.h>
#include <pthread.h>
#include <string.h>

#include "standin_inner.h"

typedef unsigned int HHD;
typedef unsigned int HDenum;
typedef unsigned int HDCallbackCode;
typedef unsigned long HDSchedulerHandle;
typedef HDCallbackCode (*HDSchedulerCallback)(void *data);

typedef struct {
  unsigned int errorCode;
  int internalErrorCode;
  HHD hHD;
} HDErrorInfo;

STANDIN_CALL HHD hdInitDevice(const char *name);
STANDIN_CALL void hdDisableDevice(HHD device);
STANDIN_CALL void hdMakeCurrentDevice(HHD device);
STANDIN_CALL void hdBeginFrame(HHD device);
STANDIN_CALL void hdEndFrame(HHD device);
STANDIN_CALL void hdGetDoublev(HDenum what, double *out);
STANDIN_CALL void hdGetIntegerv(HDenum what, int *out);
STANDIN_CALL const char *hdGetString(HDenum what);
STANDIN_CALL void hdSetDoublev(HDenum what, const double *values);
STANDIN_CALL void hdEnable(HDenum what);
STANDIN_CALL void hdDisable(HDenum what);
STANDIN_CALL HDErrorInfo hdGetError(void);
STANDIN_CALL HDSchedulerHandle hdScheduleAsynchronous(HDSchedulerCallback callback, void *data,
                                                      unsigned short priority);
STANDIN_CALL void hdUnschedule(HDSchedulerHandle handle);
STANDIN_CALL void hdStartScheduler(void);
STANDIN_CALL void hdStopScheduler(void);
STANDIN_CALL unsigned int hdCheckCalibration(void);

#define CALLBACKS 8
#define ERRORS 16

/* Errors are of the thread that made them. */
static _Thread_local HHD current;
static _Thread_local int in_frame;
static _Thread_local double frame_force[3];
static _Thread_local double frame_torque[3];
static _Thread_local unsigned int errors[ERRORS];
static _Thread_local int error_count;

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static struct {
  HDSchedulerCallback call;
  void *data;
} callbacks[CALLBACKS];
static pthread_t thread;
static atomic_int running;

static void error_push(unsigned int code)
{
  if (error_count < ERRORS) {
    errors[error_count++] = code;
  }
}

HDErrorInfo hdGetError(void)
{
  HDErrorInfo error = {0, 0, current};
  if (error_count > 0) {
    error.errorCode = errors[0];
    memmove(errors, errors + 1, sizeof errors - sizeof errors[0]);
    --error_count;
  }
  return error;
}

static standin_device *device_now(void)
{
  return &standin_get()->of[current < STANDIN_DEVICES ? current : 0];
}

HHD hdInitDevice(const char *name)
{
  HHD device = name != NULL && strcmp(name, "Left") == 0 ? 1 : 0;
  int fault = atomic_load(&standin_get()->of[device].fault);
  if (name != NULL && strcmp(name, "Left") != 0 && strcmp(name, "Default Device") != 0) {
    error_push(0x302);
    return 0xffffffffu;
  }
  if (fault == STANDIN_NOT_THERE || fault == STANDIN_UNPLUGGED) {
    error_push(0x302);
    return 0xffffffffu;
  }
  if (fault == STANDIN_IN_USE || atomic_load(&standin_get()->of[device].opened) != 0) {
    error_push(0x301);
    return 0xffffffffu;
  }
  atomic_store(&standin_get()->of[device].opened, 1);
  atomic_fetch_add(&standin_get()->of[device].opens, 1);
  current = device;
  return device;
}

void hdDisableDevice(HHD device)
{
  if (device >= STANDIN_DEVICES || atomic_load(&standin_get()->of[device].opened) == 0) {
    error_push(0x104);
    return;
  }
  atomic_store(&standin_get()->of[device].opened, 0);
}

void hdMakeCurrentDevice(HHD device)
{
  current = device;
}

void hdBeginFrame(HHD device)
{
  current = device;
  if (in_frame != 0) {
    error_push(0x400);
    atomic_fetch_add(&standin_get()->misuse, 1);
  }
  in_frame = 1;
  (void)standin_fault_of((int)device);
  memset(frame_force, 0, sizeof frame_force);
  memset(frame_torque, 0, sizeof frame_torque);
}

static double vector_norm(const double v[3])
{
  return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

/* What was set in the frame acts from now on, while the output is on. */
void hdEndFrame(HHD device)
{
  const double none[3] = {0.0, 0.0, 0.0};
  if (in_frame == 0 || device != current) {
    error_push(0x401);
    atomic_fetch_add(&standin_get()->misuse, 1);
    return;
  }
  in_frame = 0;
  int fault = atomic_load(&device_now()->fault);
  if (fault == STANDIN_READ_FAILS || fault == STANDIN_UNPLUGGED) {
    error_push(0x302);
    return;
  }
  if (fault == STANDIN_WARM) {
    error_push(0x200);
  }
  if (fault == STANDIN_FORCE_FAILS && vector_norm(frame_force) > 0.0) {
    error_push(0x201);
    return;
  }
  int enabled = atomic_load(&device_now()->enabled);
  standin_force((int)device, enabled ? frame_force : none, enabled ? frame_torque : none);
}

static void transform_get(double out[16])
{
  double r[3][3];
  double p[3];
  double v[3];
  standin_rotation((int)current, r);
  standin_motion((int)current, p, v);
  memset(out, 0, 16 * sizeof *out);
  for (int column = 0; column < 3; ++column) {
    for (int row = 0; row < 3; ++row) {
      out[4 * column + row] = r[row][column];
    }
    out[12 + column] = 1e3 * p[column];
  }
  out[15] = 1.0;
  if (atomic_load(&device_now()->fault) == STANDIN_BAD_FRAME) {
    out[0] = 7.0;
  }
}

void hdGetDoublev(HDenum what, double *out)
{
  static const double box[6] = {-160.0, -120.0, -70.0, 160.0, 120.0, 70.0};
  double p[3];
  double v[3];
  standin_motion((int)current, p, v);
  switch (what) {
    case 0x2050:
      for (int i = 0; i < 3; ++i) {
        out[i] = atomic_load(&device_now()->fault) == STANDIN_NAN ? NAN : 1e3 * p[i];
      }
      break;
    case 0x2051:
      for (int i = 0; i < 3; ++i) {
        out[i] = 1e3 * v[i];
      }
      break;
    case 0x2052:
      transform_get(out);
      break;
    case 0x2551:
      memcpy(out, box, sizeof box);
      break;
    case 0x2602:
      *out = 1.26; /* N/mm */
      break;
    case 0x2603:
      *out = 3.3;
      break;
    case 0x2604:
      *out = 0.88;
      break;
    case 0x2605:
      for (int i = 0; i < 6; ++i) {
        out[i] = 0.1 * i + (atomic_load(&device_now()->fault) == STANDIN_WARM ? 0.43 : 0.0);
      }
      break;
    default:
      error_push(0x100);
  }
}

void hdGetIntegerv(HDenum what, int *out)
{
  switch (what) {
    case 0x2000:
      *out = atomic_load(&device_now()->buttons);
      break;
    case 0x2553:
      *out = atomic_load(&standin_get()->wrist) > 0 ? 6 : 3;
      break;
    case 0x2554:
      *out = atomic_load(&standin_get()->wrist) > 1 ? 6 : 3;
      break;
    default:
      error_push(0x100);
  }
}

const char *hdGetString(HDenum what)
{
  return what == 0x2501 ? "Touch" : "";
}

void hdSetDoublev(HDenum what, const double *values)
{
  if (in_frame == 0) {
    error_push(0x400);
    atomic_fetch_add(&standin_get()->misuse, 1);
  }
  if (what == 0x2700) {
    memcpy(frame_force, values, sizeof frame_force);
  } else if (what == 0x2701) {
    for (int i = 0; i < 3; ++i) {
      frame_torque[i] = 1e-3 * values[i]; /* N mm */
    }
  } else {
    error_push(0x100);
  }
}

void hdEnable(HDenum what)
{
  if (what == 0x4000) {
    atomic_store(&device_now()->enabled, 1);
  }
}

void hdDisable(HDenum what)
{
  const double none[3] = {0.0, 0.0, 0.0};
  if (what == 0x4000) {
    atomic_store(&device_now()->enabled, 0);
    standin_force((int)current, none, none);
  }
}

/* ---- the scheduler ---- */

static int is_asleep(void)
{
  return atomic_load(&standin_get()->of[0].fault) == STANDIN_SILENT;
}

static void *scheduler_main(void *unused)
{
  while (atomic_load(&running) != 0) {
    int late = atomic_load(&standin_get()->of[0].late_ms);
    if (!is_asleep()) {
      pthread_mutex_lock(&lock);
      for (int i = 0; i < CALLBACKS; ++i) {
        if (callbacks[i].call != NULL && callbacks[i].call(callbacks[i].data) == 0) {
          callbacks[i].call = NULL;
        }
      }
      pthread_mutex_unlock(&lock);
    }
    standin_sleep_ms(late > 0 ? late : 1.0);
  }
  return unused;
}

HDSchedulerHandle hdScheduleAsynchronous(HDSchedulerCallback callback, void *data,
                                         unsigned short priority)
{
  HDSchedulerHandle handle = 0xffffffffu;
  (void)priority;
  pthread_mutex_lock(&lock);
  for (int i = 0; i < CALLBACKS && handle == 0xffffffffu; ++i) {
    if (callbacks[i].call == NULL) {
      callbacks[i].call = callback;
      callbacks[i].data = data;
      handle = (HDSchedulerHandle)i;
    }
  }
  pthread_mutex_unlock(&lock);
  return handle;
}

void hdUnschedule(HDSchedulerHandle handle)
{
  pthread_mutex_lock(&lock);
  if (handle < CALLBACKS && callbacks[handle].call != NULL) {
    callbacks[handle].call = NULL;
  } else {
    error_push(0x104);
  }
  pthread_mutex_unlock(&lock);
}

void hdStartScheduler(void)
{
  if (atomic_exchange(&running, 1) != 0) {
    atomic_fetch_add(&standin_get()->misuse, 1);
    return;
  }
  atomic_store(&standin_get()->scheduler, 1);
  pthread_create(&thread, NULL, scheduler_main, NULL);
}

void hdStopScheduler(void)
{
  if (atomic_exchange(&running, 0) == 0) {
    atomic_fetch_add(&standin_get()->misuse, 1);
    return;
  }
  pthread_join(thread, NULL);
  atomic_store(&standin_get()->scheduler, 0);
}

unsigned int hdCheckCalibration(void)
{
  return atomic_load(&device_now()->fault) == STANDIN_NOT_READY ? 0x5002u : 0x5000u;
}
