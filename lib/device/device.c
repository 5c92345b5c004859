/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "device/device.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"
#include "base/def.h"
#include "base/log.h"
#include "device/emergency.h"
#include "device/module.h"

#define FIGURE_MOST 1e9    /* of what a device says of itself, in SI units */
#define AXIS_MOST 1e6      /* of the values of an axis */
#define WORKSPACE_MOST 1e3 /* m */

#define ALL_EFFECTORS 0xffffu
#define CLOSED 0x10000u

static bool name_is_good(const char *name)
{
  size_t length = name != NULL ? strspn(name, "abcdefghijklmnopqrstuvwxyz0123456789_-") : 0;
  return length > 0 && name[length] == '\0';
}

/* The table of a device that was built before the optional operations ends there. */
#define SIZE_LEAST offsetof(hap_device_ops, held)

/* Whether the table of the device's build has the member, and not NULL. */
#define HAS_OPERATION(ops, member) (HAP_HAS_MEMBER(ops, member) && (ops)->member != NULL)

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

hap_status hapi_device_check_abi(const hap_device_ops *ops, hap_detail *detail)
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
  HAPI_TRY(hapi_device_check_abi(ops, detail));
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

/* Of what there can be so many. */
static hap_status check_counts(const hap_device_ops *ops, const hap_device_info *info,
                               hap_detail *detail)
{
  const struct {
    const char *what;
    uint32_t count;
    uint32_t most;
  } counts[] = {{"effector_count", info->effector_count, HAP_EFFECTORS_MAX},
                {"axis_count", info->axis_count, HAP_AXES_MAX},
                {"button_count", info->button_count, 32},
                {"led_count", info->led_count, 32},
                {"vibrator_count", info->vibrator_count, HAP_VIBRATORS_MAX}};
  for (size_t i = 0; i < sizeof counts / sizeof counts[0]; ++i) {
    if (counts[i].count > counts[i].most) {
      return hapi_fail(detail, HAP_ERROR_DEVICE,
                       "device '%s' says it has %s %u; there can be %u at most", ops->name,
                       counts[i].what, counts[i].count, counts[i].most);
    }
  }
  if (info->axis_count > 0 && !HAS_OPERATION(ops, describe_axis)) {
    return hapi_fail(detail, HAP_ERROR_DEVICE,
                     "device '%s' has axis_count %u: the operation 'describe_axis' is missing in "
                     "its table",
                     ops->name, info->axis_count);
  }
  return HAP_OK;
}

static bool box_is_good(const double low[3], const double high[3])
{
  bool good = true;
  for (int i = 0; i < 3; ++i) {
    good = good && fabs(low[i]) <= WORKSPACE_MOST && fabs(high[i]) <= WORKSPACE_MOST &&
           low[i] <= high[i];
  }
  return good;
}

static hap_status check_info(const hap_device_ops *ops, const hap_device_info *info,
                             hap_detail *detail)
{
  if (info->dof != 3 && info->dof != 6) {
    return hapi_fail(detail, HAP_ERROR_DEVICE, "device '%s' says it has dof %u, known are 3 and 6",
                     ops->name, info->dof);
  }
  const double figures[] = {info->max_force,     info->max_torque, info->rated_stiffness,
                            info->damping,       info->quantum,    info->mass,
                            info->friction,      info->delay,      info->vibrator_hz[0],
                            info->vibrator_hz[1]};
  if (!hapi_device_figures_good(figures, sizeof figures / sizeof figures[0])) {
    return hapi_fail(
        detail, HAP_ERROR_DEVICE,
        "device '%s' describes itself with a figure that is negative or not finite, or "
        "neither 0 nor from %g to %g",
        ops->name, HAPI_NUMBER_LEAST, FIGURE_MOST);
  }
  if (!box_is_good(info->workspace_low, info->workspace_high)) {
    return hapi_fail(detail, HAP_ERROR_DEVICE,
                     "device '%s' has a workspace that is not finite, beyond %g m, or whose "
                     "workspace_low is above workspace_high",
                     ops->name, WORKSPACE_MOST);
  }
  return check_counts(ops, info, detail);
}

static bool axis_is_known(const hap_axis_info *axis)
{
  return axis->kind <= HAP_AXIS_GRIPPER && axis->unit <= HAP_AXIS_SHARE;
}

static bool axis_has_range(const hap_axis_info *axis)
{
  return fabs(axis->low) <= AXIS_MOST && fabs(axis->high) <= AXIS_MOST &&
         axis->high - axis->low >= HAPI_NUMBER_LEAST;
}

bool hapi_device_axis_good(const hap_axis_info *axis)
{
  const double figures[] = {axis->max_force, axis->rated_stiffness, axis->rated_damping};
  return axis_is_known(axis) && axis_has_range(axis) && hapi_device_figures_good(figures, 3);
}

static hap_status check_axis(const hap_device_ops *ops, uint32_t index, const hap_axis_info *axis,
                             hap_detail *detail)
{
  if (hapi_device_axis_good(axis)) {
    return HAP_OK;
  }
  return hapi_fail(
      detail, HAP_ERROR_DEVICE, "device '%s', axis %u: %s", ops->name, index,
      !axis_is_known(axis)   ? "an unknown kind or unit; is the library older than the device?"
      : axis_has_range(axis) ? "max_force, rated_stiffness or rated_damping is neither 0 nor "
                               "from 1e-15 to 1e9"
                             : "low and high are not finite, beyond 1e6, or not in this order");
}

static void info_read(const hap_device *device, uint32_t effector, hap_device_info *out)
{
  memset(out, 0, sizeof *out);
  out->size = sizeof *out;
  device->ops->describe(device->self, effector, out);
  out->size = sizeof *out;
  out->pacing = device->ops->pacing;
  out->effector_count = out->effector_count > 0 ? out->effector_count : 1;
  out->name[sizeof out->name - 1] = '\0';
  if (out->name[0] == '\0') {
    snprintf(out->name, sizeof out->name, "%s", device->ops->name);
  }
}

static hap_status effector_describe(hap_device *device, uint32_t index, hap_detail *detail)
{
  hapi_effector *effector = &device->effectors[index];
  info_read(device, index, &effector->info);
  HAPI_TRY(check_info(device->ops, &effector->info, detail));
  if (effector->info.effector_count != device->effector_count) {
    return hapi_fail(
        detail, HAP_ERROR_DEVICE, "device '%s': effector_count is %u, and %u for end effector %u",
        device->ops->name, device->effector_count, effector->info.effector_count, index);
  }
  for (uint32_t i = 0; i < effector->info.axis_count; ++i) {
    hap_axis_info *axis = &effector->axes[i];
    axis->size = sizeof *axis;
    device->ops->describe_axis(device->self, index, i, axis);
    axis->size = sizeof *axis;
    HAPI_TRY(check_axis(device->ops, i, axis, detail));
  }
  effector->input.size = sizeof effector->input;
  effector->input.pose.quat_wxyz[0] = 1.0;
  effector->wanted.size = sizeof effector->wanted;
  effector->reached.size = sizeof effector->reached;
  device->inputs[index] = &effector->input;
  device->wanted[index] = &effector->wanted;
  device->reached[index] = &effector->reached;
  return HAP_OK;
}

static hap_status device_describe(hap_device *device, hap_detail *detail)
{
  hap_device_info first;
  info_read(device, 0, &first);
  HAPI_TRY(check_info(device->ops, &first, detail));
  device->effector_count = first.effector_count;
  device->effectors = hapi_alloc_array(first.effector_count, sizeof *device->effectors);
  if (device->effectors == NULL) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "device '%s': out of memory", device->ops->name);
  }
  for (uint32_t i = 0; i < device->effector_count; ++i) {
    HAPI_TRY(effector_describe(device, i, detail));
  }
  return HAP_OK;
}

/* The library last: the code of close is in it. */
static void device_free(hap_device *device)
{
  HAPI_ASSERT(device->self != NULL);
  void *library = device->library;
  device->ops->close(device->self);
  hapi_free(device->effectors);
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

static hap_status open_self(hap_device *device, void *context, const char *args, hap_detail *detail)
{
  hap_status status = device->ops->open(context, args, &device->self, detail);
  if (status < 0) {
    return fail_open(device->ops, status, detail);
  }
  if (device->self == NULL) {
    return hapi_fail(detail, HAP_ERROR_DEVICE, "device '%s': open said '%s' and gave no self",
                     device->ops->name, hap_status_text(status));
  }
  return HAP_OK;
}

hap_status hapi_device_open_ops(const hap_device_ops *ops, void *context, const char *args,
                                hap_device **out, hap_detail *detail)
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
  atomic_init(&device->holders.owner, NULL);
  hap_status status = open_self(device, context, args, detail);
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
  return ops != NULL ? hapi_device_open_ops(ops, NULL, args, out, text)
                     : fail_unknown(spec, length, text);
}

hap_status hap_device_create(const hap_device_ops *ops, void *context, hap_device **out,
                             hap_detail *detail)
{
  hap_detail unread = {0};
  hap_detail *text = detail != NULL ? detail : &unread;
  text->text[0] = '\0';
  if (out == NULL || ops == NULL) {
    return hapi_fail(text, HAP_ERROR_ARGUMENT, "hap_device_create: ops or out is NULL");
  }
  return hapi_device_open_ops(ops, context, "", out, text);
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
  return hap_device_get_effector(device, 0, out, size_of_out);
}

hap_status hap_device_get_effector(const hap_device *device, uint32_t effector,
                                   hap_device_info *out, size_t size_of_out)
{
  if (device == NULL) {
    return HAP_ERROR_ARGUMENT;
  }
  return effector < device->effector_count
             ? hapi_struct_give(&device->effectors[effector].info, sizeof *out, out, size_of_out)
             : HAP_ERROR_NOT_FOUND;
}

hap_status hap_device_get_axis(const hap_device *device, uint32_t effector, uint32_t axis,
                               hap_axis_info *out, size_t size_of_out)
{
  if (device == NULL) {
    return HAP_ERROR_ARGUMENT;
  }
  bool there =
      effector < device->effector_count && axis < device->effectors[effector].info.axis_count;
  return there ? hapi_struct_give(&device->effectors[effector].axes[axis], sizeof *out, out,
                                  size_of_out)
               : HAP_ERROR_NOT_FOUND;
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
  return &device->effectors[0].info;
}

void hapi_device_explain(const hap_device_ops *ops, void *self, hap_detail *out)
{
  out->text[0] = '\0';
  if (HAS_OPERATION(ops, explain)) {
    ops->explain(self, out);
    out->text[sizeof out->text - 1] = '\0';
  }
}

static void wanted_clear(hap_device *device, uint32_t effector)
{
  hap_device_output *wanted = &device->effectors[effector].wanted;
  *wanted = (hap_device_output){.size = sizeof *wanted};
}

bool hapi_device_claim(hap_device *device)
{
  unsigned nobody = 0;
  bool claimed = atomic_compare_exchange_strong_explicit(
      &device->holders.bits, &nobody, ALL_EFFECTORS, memory_order_acq_rel, memory_order_relaxed);
  for (uint32_t i = 0; claimed && i < device->effector_count; ++i) {
    wanted_clear(device, i);
  }
  return claimed;
}

bool hapi_device_claim_effector(hap_device *device, const void *session, uint32_t effector)
{
  HAPI_ASSERT_INDEX(effector, device->effector_count);
  hapi_device_holders *holders = &device->holders;
  unsigned bit = 1u << effector;
  unsigned before = atomic_load(&holders->bits);
  do {
    bool foreign = (before & ALL_EFFECTORS) != 0 && atomic_load(&holders->owner) != session;
    if (foreign || (before & (CLOSED | bit)) != 0) {
      return false;
    }
  } while (!atomic_compare_exchange_weak(&holders->bits, &before, before | bit));
  atomic_store(&holders->owner, session);
  wanted_clear(device, effector);
  return true;
}

static void bits_release(hap_device *device, unsigned bits)
{
  unsigned held = atomic_load(&device->holders.bits) & ALL_EFFECTORS;
  HAPI_ASSERT((held & bits) == bits);
  if (held == bits) {
    atomic_store(&device->holders.owner, NULL); /* before others can claim it */
  }
  unsigned before = atomic_fetch_and_explicit(&device->holders.bits, ~bits, memory_order_acq_rel);
  if (before == (bits | CLOSED)) {
    device_free(device);
  }
}

void hapi_device_release(hap_device *device)
{
  bits_release(device, ALL_EFFECTORS);
}

void hapi_device_release_effector(hap_device *device, uint32_t effector)
{
  bits_release(device, 1u << effector);
}
