/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "device/device.h"

#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"
#include "base/def.h"
#include "base/log.h"
#include "device/emergency.h"
#include "device/module.h"

#define FIGURE_MOST 1e9 /* of what a device says of itself, in SI units */

#define CLAIMED 1u
#define CLOSED 2u

static bool name_is_good(const char *name)
{
  size_t length = name != NULL ? strspn(name, "abcdefghijklmnopqrstuvwxyz0123456789_-") : 0;
  return length > 0 && name[length] == '\0';
}

/* The table of a device that was built before the optional operations ends there. */
#define SIZE_LEAST offsetof(hap_device_ops, held)

static const char *missing_operation(const hap_device_ops *ops)
{
  const struct {
    bool there;
    const char *name;
  } needed[] = {{ops->open != NULL, "open"},   {ops->describe != NULL, "describe"},
                {ops->start != NULL, "start"}, {ops->read != NULL, "read"},
                {ops->write != NULL, "write"}, {ops->zero != NULL, "zero"},
                {ops->stop != NULL, "stop"},   {ops->close != NULL, "close"}};
  for (size_t i = 0; i < sizeof needed / sizeof needed[0]; ++i) {
    if (!needed[i].there) {
      return needed[i].name;
    }
  }
  return NULL;
}

static hap_status check_abi(const hap_device_ops *ops, hap_detail *detail)
{
  /* Nothing behind abi may be read before abi is known: its place could hold anything. */
  if (ops->abi != HAP_DEVICE_ABI) {
    return hapi_fail(detail, HAP_ERROR_UNSUPPORTED,
                     "the device was built for device ABI %u, this library has %u: %s", ops->abi,
                     HAP_DEVICE_ABI,
                     ops->abi > HAP_DEVICE_ABI ? "it needs a newer library"
                                               : "build it anew with this library's headers");
  }
  if (ops->size < SIZE_LEAST) {
    return hapi_fail(detail, HAP_ERROR_UNSUPPORTED,
                     "the device's table has %u bytes, this library needs %zu: build it anew with "
                     "this library's headers and set size to sizeof(hap_device_ops)",
                     ops->size, SIZE_LEAST);
  }
  return HAP_OK;
}

static hap_status check_ops(const hap_device_ops *ops, hap_detail *detail)
{
  HAPI_TRY(check_abi(ops, detail));
  if (!name_is_good(ops->name)) {
    return hapi_fail(detail, HAP_ERROR_DEVICE,
                     "the device's name is missing or not made of [a-z0-9_-]");
  }
  if (ops->pacing > HAP_PACING_DEVICE) {
    return hapi_fail(detail, HAP_ERROR_UNSUPPORTED,
                     "device '%s': unknown pacing %u, known are 0 to %d", ops->name, ops->pacing,
                     HAP_PACING_DEVICE);
  }
  const char *missing = missing_operation(ops);
  if (missing != NULL) {
    return hapi_fail(detail, HAP_ERROR_DEVICE,
                     "device '%s': the operation '%s' is missing in its table", ops->name, missing);
  }
  return HAP_OK;
}

bool hapi_device_figures_good(const double *figures, size_t count)
{
  for (size_t i = 0; i < count; ++i) {
    if (figures[i] != 0.0 && !(figures[i] >= HAPI_NUMBER_LEAST && figures[i] <= FIGURE_MOST)) {
      return false;
    }
  }
  return true;
}

static hap_status check_info(const hap_device_ops *ops, const hap_device_info *info,
                             hap_detail *detail)
{
  if (info->dof != 3 && info->dof != 6) {
    return hapi_fail(detail, HAP_ERROR_DEVICE, "device '%s' says it has dof %u, known are 3 and 6",
                     ops->name, info->dof);
  }
  const double figures[] = {info->max_force, info->max_torque, info->rated_stiffness, info->damping,
                            info->quantum,   info->mass,       info->friction,        info->delay};
  if (!hapi_device_figures_good(figures, sizeof figures / sizeof figures[0])) {
    return hapi_fail(
        detail, HAP_ERROR_DEVICE,
        "device '%s' describes itself with a figure that is negative or not finite, or "
        "neither 0 nor from %g to %g",
        ops->name, HAPI_NUMBER_LEAST, FIGURE_MOST);
  }
  return HAP_OK;
}

static hap_status device_describe(hap_device *device, hap_detail *detail)
{
  hap_device_info *info = &device->info;
  info->size = sizeof *info;
  device->ops->describe(device->self, info);
  info->size = sizeof *info;
  info->name[sizeof info->name - 1] = '\0';
  if (info->name[0] == '\0') {
    snprintf(info->name, sizeof info->name, "%s", device->ops->name);
  }
  return check_info(device->ops, info, detail);
}

/* The library last: the code of close is in it. */
static void device_free(hap_device *device)
{
  HAPI_ASSERT(device->self != NULL);
  void *library = device->library;
  device->ops->close(device->self);
  hapi_free(device);
  hapi_module_unload(library);
}

/* What a device says of its failure, whatever it forgot to say. */
static hap_status fail_open(const hap_device_ops *ops, hap_status status, hap_detail *detail)
{
  hap_status known = status >= HAP_ERROR_SYSTEM ? status : HAP_ERROR_DEVICE;
  detail->text[sizeof detail->text - 1] = '\0';
  if (detail->text[0] == '\0') {
    return hapi_fail(detail, known, "device '%s' did not open: %s", ops->name,
                     hap_status_text(status));
  }
  return known;
}

static hap_status open_self(hap_device *device, const char *args, hap_detail *detail)
{
  hap_status status = device->ops->open(args, &device->self, detail);
  if (status < 0) {
    return fail_open(device->ops, status, detail);
  }
  if (device->self == NULL) {
    return hapi_fail(detail, HAP_ERROR_DEVICE, "device '%s': open said '%s' and gave no self",
                     device->ops->name, hap_status_text(status));
  }
  return HAP_OK;
}

hap_status hapi_device_open_ops(const hap_device_ops *ops, const char *args, hap_device **out,
                                hap_detail *detail)
{
  HAPI_ASSERT(ops != NULL && args != NULL && detail != NULL);
  *out = NULL;
  detail->text[0] = '\0';
  HAPI_TRY(check_ops(ops, detail));
  hap_device *device = hapi_alloc(sizeof *device);
  if (device == NULL) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "device '%s': out of memory", ops->name);
  }
  device->ops = ops;
  atomic_init(&device->holders.bits, 0);
  hap_status status = open_self(device, args, detail);
  if (status < 0) {
    hapi_free(device);
    return status;
  }
  status = device_describe(device, detail);
  if (status < 0) {
    device_free(device);
    return status;
  }
  *out = device;
  return HAP_OK;
}

static hap_status fail_unknown(const char *name, size_t length, hap_detail *detail)
{
  char names[256] = "";
  size_t used = 0;
  const char *known;
  for (size_t i = 0; (known = hap_device_name_at(i, NULL)) != NULL && used < sizeof names; ++i) {
    used += (size_t)snprintf(names + used, sizeof names - used, "%s%s", i > 0 ? ", " : "", known);
  }
  int shown = length < 64 ? (int)length : 64;
  return hapi_fail(detail, HAP_ERROR_NOT_FOUND, "there is no device '%.*s'; there are: %s", shown,
                   name, names);
}

hap_status hap_device_open(const char *spec, hap_device **out, hap_detail *detail)
{
  hap_detail unread = {0}; /* the ops are promised a detail */
  hap_detail *text = detail != NULL ? detail : &unread;
  text->text[0] = '\0';
  if (out == NULL) {
    return hapi_fail(text, HAP_ERROR_ARGUMENT, "hap_device_open: out is NULL");
  }
  *out = NULL;
  if (spec == NULL) {
    return hapi_fail(text, HAP_ERROR_ARGUMENT, "hap_device_open: spec is NULL");
  }
  size_t length = strcspn(spec, ":");
  const char *args = spec[length] == ':' ? spec + length + 1 : "";
  if (strlen(HAPI_MODULE_NAME) == length && memcmp(spec, HAPI_MODULE_NAME, length) == 0) {
    return hapi_module_open(args, out, text);
  }
  const hap_device_ops *ops = hapi_registry_find(spec, length);
  return ops != NULL ? hapi_device_open_ops(ops, args, out, text)
                     : fail_unknown(spec, length, text);
}

void hap_device_close(hap_device *device)
{
  if (device == NULL) {
    return;
  }
  if (!hapi_emergency_is_zeroing(device->ops, device->self)) { /* one that may hang */
    device->ops->zero(device->self);
  }
  /* acq_rel: the thread that frees must see all that the other holder did to the device. */
  unsigned before = atomic_fetch_or_explicit(&device->holders.bits, CLOSED, memory_order_acq_rel);
  if (before == 0) {
    device_free(device);
  }
}

hap_status hap_device_get_info(const hap_device *device, hap_device_info *out, size_t size_of_out)
{
  return device != NULL ? hapi_struct_give(&device->info, sizeof device->info, out, size_of_out)
                        : HAP_ERROR_ARGUMENT;
}

const hap_device_ops *hapi_device_ops(const hap_device *device)
{
  return device->ops;
}

void *hapi_device_self(const hap_device *device)
{
  return device->self;
}

const hap_device_info *hapi_device_info(const hap_device *device)
{
  return &device->info;
}

void hapi_device_explain(const hap_device_ops *ops, void *self, hap_detail *out)
{
  out->text[0] = '\0';
  if (ops->size >= offsetof(hap_device_ops, explain) + sizeof ops->explain &&
      ops->explain != NULL) {
    ops->explain(self, out);
    out->text[sizeof out->text - 1] = '\0';
  }
}

bool hapi_device_claim(hap_device *device)
{
  unsigned nobody = 0;
  return atomic_compare_exchange_strong_explicit(&device->holders.bits, &nobody, CLAIMED,
                                                 memory_order_acq_rel, memory_order_relaxed);
}

void hapi_device_release(hap_device *device)
{
  unsigned before =
      atomic_fetch_and_explicit(&device->holders.bits, ~CLAIMED, memory_order_acq_rel);
  HAPI_ASSERT((before & CLAIMED) != 0);
  if ((before & CLOSED) != 0) {
    device_free(device);
  }
}
