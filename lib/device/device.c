/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "device/device.h"

#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/log.h"
#include "base/vec.h"

#define CLAIMED 1u
#define CLOSED 2u

static bool name_is_good(const char *name)
{
  size_t length = name != NULL ? strspn(name, "abcdefghijklmnopqrstuvwxyz0123456789_-") : 0;
  return length > 0 && name[length] == '\0';
}

static bool ops_are_complete(const hap_device_ops *ops)
{
  return ops->open != NULL && ops->describe != NULL && ops->start != NULL && ops->read != NULL &&
         ops->write != NULL && ops->zero != NULL && ops->stop != NULL && ops->close != NULL;
}

static hap_status check_ops(const hap_device_ops *ops, hap_detail *detail)
{
  /* Nothing behind abi may be read before abi is known: its place could hold anything. */
  if (ops->abi != HAP_DEVICE_ABI) {
    return hapi_fail(detail, HAP_ERROR_UNSUPPORTED,
                     "the device was built for device ABI %u, this library has %u", ops->abi,
                     HAP_DEVICE_ABI);
  }
  if (ops->size < sizeof *ops) {
    return hapi_fail(detail, HAP_ERROR_UNSUPPORTED,
                     "the device's table has %u bytes, this library needs %zu", ops->size,
                     sizeof *ops);
  }
  if (!name_is_good(ops->name)) {
    return hapi_fail(detail, HAP_ERROR_DEVICE, "the device's name is not made of [a-z0-9_-]");
  }
  if (ops->pacing > HAP_PACING_DEVICE) {
    return hapi_fail(detail, HAP_ERROR_UNSUPPORTED, "device '%s': unknown pacing %u", ops->name,
                     ops->pacing);
  }
  if (!ops_are_complete(ops)) {
    return hapi_fail(detail, HAP_ERROR_DEVICE, "device '%s': an operation is missing", ops->name);
  }
  return HAP_OK;
}

static hap_status check_info(const hap_device_ops *ops, const hap_device_info *info,
                             hap_detail *detail)
{
  if (info->dof != 3 && info->dof != 6) {
    return hapi_fail(detail, HAP_ERROR_DEVICE, "device '%s' says it has dof %u, known are 3 and 6",
                     ops->name, info->dof);
  }
  double limits[] = {info->max_force, info->max_torque, info->rated_stiffness, info->damping,
                     info->quantum,   info->mass,       info->friction,        info->delay};
  for (size_t i = 0; i < sizeof limits / sizeof limits[0]; ++i) {
    if (!hapi_finite(&limits[i], 1) || limits[i] < 0.0) {
      return hapi_fail(detail, HAP_ERROR_DEVICE,
                       "device '%s' describes itself with a limit that is negative or not finite",
                       ops->name);
    }
  }
  return HAP_OK;
}

static hap_status describe(hap_device *device, hap_detail *detail)
{
  hap_device_info *info = &device->info;
  device->ops->describe(device->self, info);
  info->name[sizeof info->name - 1] = '\0';
  if (info->name[0] == '\0') {
    snprintf(info->name, sizeof info->name, "%s", device->ops->name);
  }
  return check_info(device->ops, info, detail);
}

static void device_free(hap_device *device)
{
  device->ops->close(device->self);
  hapi_free(device);
}

hap_status hapi_device_open_ops(const hap_device_ops *ops, const char *args, hap_device **out,
                                hap_detail *detail)
{
  *out = NULL;
  hap_status status = check_ops(ops, detail);
  if (status < 0) {
    return status;
  }
  hap_device *device = hapi_alloc(sizeof *device);
  if (device == NULL) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "device '%s': out of memory", ops->name);
  }
  device->ops = ops;
  atomic_init(&device->holders.bits, 0);
  status = ops->open(args, &device->self, detail);
  if (status < 0) {
    hapi_free(device);
    return status;
  }
  status = describe(device, detail);
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
  const hap_device_ops *ops;
  for (size_t i = 0; (ops = hapi_registry_at(i)) != NULL && used < sizeof names; ++i) {
    used +=
        (size_t)snprintf(names + used, sizeof names - used, "%s%s", i > 0 ? ", " : "", ops->name);
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
  const hap_device_ops *ops = hapi_registry_find(spec, length);
  if (ops == NULL) {
    return fail_unknown(spec, length, text);
  }
  const char *args = spec[length] == ':' ? spec + length + 1 : "";
  hap_status status = hapi_device_open_ops(ops, args, out, text);
  if (status < 0 && text->text[0] == '\0') {
    return hapi_fail(text, status, "device '%s': %s", ops->name, hap_status_text(status));
  }
  return status;
}

void hap_device_close(hap_device *device)
{
  if (device == NULL) {
    return;
  }
  device->ops->zero(device->self);
  /* acq_rel: whoever frees must see all that the other holder did to the device. */
  unsigned before = atomic_fetch_or_explicit(&device->holders.bits, CLOSED, memory_order_acq_rel);
  if (before == 0) {
    device_free(device);
  }
}

hap_status hap_device_get_info(const hap_device *device, hap_device_info *out, size_t size_of_out)
{
  if (device == NULL || out == NULL || size_of_out == 0) {
    return HAP_ERROR_ARGUMENT;
  }
  /* A caller built with another version of the struct gets what both sides know. */
  size_t common = size_of_out < sizeof device->info ? size_of_out : sizeof device->info;
  memset(out, 0, size_of_out);
  memcpy(out, &device->info, common);
  return HAP_OK;
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
  if ((before & CLOSED) != 0) {
    device_free(device);
  }
}
