/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/status.h>
#include <hapode/version.h>

const char *hap_status_name(hap_status status)
{
#define NAME(x) \
  case x:       \
    return #x
  switch (status) {
    NAME(HAP_OK);
    NAME(HAP_NO_REALTIME);
    NAME(HAP_STALE);
    NAME(HAP_SATURATED);
    NAME(HAP_DROPPED);
    NAME(HAP_END);
    NAME(HAP_BODY_LOST);
    NAME(HAP_FAULTED);
    NAME(HAP_CLAMPED);
    NAME(HAP_ERROR_ARGUMENT);
    NAME(HAP_ERROR_UNINITIALISED);
    NAME(HAP_ERROR_MEMORY);
    NAME(HAP_ERROR_STATE);
    NAME(HAP_ERROR_THREAD);
    NAME(HAP_ERROR_CAPACITY);
    NAME(HAP_ERROR_NOT_FOUND);
    NAME(HAP_ERROR_UNSUPPORTED);
    NAME(HAP_ERROR_WORLD);
    NAME(HAP_ERROR_DEVICE);
    NAME(HAP_ERROR_IO);
    NAME(HAP_ERROR_FORMAT);
    NAME(HAP_ERROR_TIMEOUT);
    NAME(HAP_ERROR_SYSTEM);
  }
#undef NAME
  return "HAP_UNKNOWN_STATUS"; /* a newer library, or memory gone bad */
}

const char *hap_status_text(hap_status status)
{
  switch (status) {
    case HAP_OK:
      return "good";
    case HAP_NO_REALTIME:
      return "running without real-time scheduling or locked memory";
    case HAP_STALE:
      return "the answer is older than one physics step";
    case HAP_SATURATED:
      return "the wanted wrench was beyond a limit and was shortened";
    case HAP_DROPPED:
      return "more frame time came in than three physics steps, the rest was dropped";
    case HAP_BODY_LOST:
      return "a body was destroyed without hap_session_forget_body, it was dropped";
    case HAP_FAULTED:
      return "done, but a fault is latched and the force is zero";
    case HAP_CLAMPED:
      return "the time asked for is no longer kept, the oldest that is was given";
    case HAP_END:
      return "nothing further to read";
    case HAP_ERROR_ARGUMENT:
      return "an argument is NULL, out of range or not finite";
    case HAP_ERROR_UNINITIALISED:
      return "a def struct did not go through its _init function";
    case HAP_ERROR_MEMORY:
      return "out of memory";
    case HAP_ERROR_STATE:
      return "not possible in the present state";
    case HAP_ERROR_THREAD:
      return "not possible from this thread or from a callback";
    case HAP_ERROR_CAPACITY:
      return "a capacity fixed at creation is used up";
    case HAP_ERROR_NOT_FOUND:
      return "no such thing";
    case HAP_ERROR_UNSUPPORTED:
      return "this version cannot do that";
    case HAP_ERROR_WORLD:
      return "the ODE world holds something that cannot be simulated";
    case HAP_ERROR_DEVICE:
      return "the device failed";
    case HAP_ERROR_IO:
      return "a file cannot be opened, read or written";
    case HAP_ERROR_FORMAT:
      return "a file or text does not have the form it should have";
    case HAP_ERROR_TIMEOUT:
      return "it did not happen within the time given";
    case HAP_ERROR_SYSTEM:
      return "the operating system refused";
  }
  return "unknown status";
}

#define TEXT_OF(x) #x
#define TEXT(x) TEXT_OF(x)

const char *hap_version(void)
{
  return TEXT(HAP_VERSION_MAJOR) "." TEXT(HAP_VERSION_MINOR) "." TEXT(HAP_VERSION_PATCH);
}
