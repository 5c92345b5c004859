/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "plugins/openhaptics/libhd.h"

#include <pthread.h>
#include <string.h>

/* In the order of hapi_hd. */
static const hapi_vendor_symbol symbols[] = {
    {"hdInitDevice", true},
    {"hdDisableDevice", true},
    {"hdMakeCurrentDevice", true},
    {"hdBeginFrame", true},
    {"hdEndFrame", true},
    {"hdGetDoublev", true},
    {"hdGetIntegerv", true},
    {"hdGetString", true},
    {"hdSetDoublev", true},
    {"hdEnable", true},
    {"hdDisable", true},
    {"hdGetError", true},
    {"hdScheduleAsynchronous", true},
    {"hdUnschedule", true},
    {"hdStartScheduler", true},
    {"hdStopScheduler", true},
    {"hdCheckCalibration", false},
};

#define SYMBOLS (sizeof symbols / sizeof symbols[0])

const char *const hapi_hd_names[] = {"libHD.so.3.4", "libHD.so.3", "libHD.so", NULL};

hap_status hapi_hd_load(const char *path, void **out_library, hapi_hd *out, hap_detail *detail)
{
  static const hapi_vendor vendor = {
      .device = "openhaptics",
      .install =
          "install OpenHaptics 3 and the Touch device driver (3dsystems.com), then run "
          "Touch_Setup",
      .names = hapi_hd_names,
      .symbols = symbols,
      .count = SYMBOLS,
  };
  hapi_vendor_function functions[SYMBOLS];
  _Static_assert(sizeof functions == sizeof *out, "a name for each function");
  hap_status status = hapi_vendor_load(&vendor, path, out_library, functions, detail);
  if (status >= HAP_OK) {
    memcpy(out, functions, sizeof functions);
  }
  return status;
}

static struct {
  pthread_mutex_t lock;
  int users;
} scheduler = {.lock = PTHREAD_MUTEX_INITIALIZER};

void hapi_hd_scheduler_begin(const hapi_hd *hd)
{
  pthread_mutex_lock(&scheduler.lock);
  if (scheduler.users++ == 0) {
    hd->start_scheduler();
  }
  pthread_mutex_unlock(&scheduler.lock);
}

void hapi_hd_scheduler_end(const hapi_hd *hd)
{
  pthread_mutex_lock(&scheduler.lock);
  if (--scheduler.users == 0) {
    hd->stop_scheduler();
  }
  pthread_mutex_unlock(&scheduler.lock);
}
