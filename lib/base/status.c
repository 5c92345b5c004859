/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/status.h>
#include <hapode/version.h>

#define STATUSES(X)                                                                            \
  X(HAP_OK, "good")                                                                            \
  X(HAP_NO_REALTIME, "running without real-time scheduling or locked memory")                  \
  X(HAP_STALE, "the answer is older than one physics step")                                    \
  X(HAP_SATURATED, "the wanted wrench was beyond a limit and was shortened")                   \
  X(HAP_DROPPED, "more frame time came in than three physics steps, the rest was dropped")     \
  X(HAP_END, "nothing further to read")                                                        \
  X(HAP_BODY_LOST, "a body was destroyed without hap_session_forget_body, it was dropped")     \
  X(HAP_FAULTED, "done, but a fault is latched and the force is zero")                         \
  X(HAP_CLAMPED, "the time asked for is no longer kept, the oldest that is was given")         \
  X(HAP_RECORD_ENDED, "the recording ended before its session, the file is whole up to there") \
  X(HAP_DIVERGED, "the replay is another one than the recording")                              \
  X(HAP_ERROR_ARGUMENT, "an argument is NULL, out of range or not finite")                     \
  X(HAP_ERROR_UNINITIALISED, "a def struct did not go through its _init function")             \
  X(HAP_ERROR_MEMORY, "out of memory")                                                         \
  X(HAP_ERROR_STATE, "not possible in the present state")                                      \
  X(HAP_ERROR_THREAD, "not possible from this thread or from a callback")                      \
  X(HAP_ERROR_CAPACITY, "a capacity fixed at creation is used up")                             \
  X(HAP_ERROR_NOT_FOUND, "no such thing")                                                      \
  X(HAP_ERROR_UNSUPPORTED, "this version cannot do that")                                      \
  X(HAP_ERROR_WORLD, "the ODE world holds something that cannot be simulated")                 \
  X(HAP_ERROR_DEVICE, "the device failed")                                                     \
  X(HAP_ERROR_IO, "a file cannot be opened, read or written")                                  \
  X(HAP_ERROR_FORMAT, "a file or text does not have the form it should have")                  \
  X(HAP_ERROR_TIMEOUT, "it did not happen within the time given")                              \
  X(HAP_ERROR_SYSTEM, "the operating system refused")

const char *hap_status_name(hap_status status)
{
#define NAME_CASE(name, text) \
  case name:                  \
    return #name;
  switch (status) {
    STATUSES(NAME_CASE)
  }
  return "HAP_UNKNOWN_STATUS"; /* a newer library, or memory gone bad */
}

const char *hap_status_text(hap_status status)
{
#define TEXT_CASE(name, text) \
  case name:                  \
    return text;
  switch (status) {
    STATUSES(TEXT_CASE)
  }
  return "unknown status";
}

#define TEXT_OF(x) #x
#define TEXT(x) TEXT_OF(x)

const char *hap_version(void)
{
  return TEXT(HAP_VERSION_MAJOR) "." TEXT(HAP_VERSION_MINOR) "." TEXT(HAP_VERSION_PATCH);
}
