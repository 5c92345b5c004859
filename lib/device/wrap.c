/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/alloc.h"
#include "base/log.h"
#include "base/vec.h"
#include "device/device.h"

/* A device around another. Whatever the application's operations do, the inner device is started
 * before them, and zeroed and stopped without them. */

typedef struct wrap {
  hap_device_ops ops;         /* of the outer device */
  hap_device *inner;          /* claimed */
  const hap_device_ops *over; /* the application's */
  void *self;                 /* of over */
} wrap;

#define HAS_OPERATION(ops, member) (HAP_HAS_MEMBER(ops, member) && (ops)->member != NULL)

/* What hap_device_wrap was given. */
typedef struct wrap_order {
  hap_device *inner;
  const hap_device_ops *over;
  void *context;
  const hap_device_ops *ops; /* of the outer device; copied */
} wrap_order;

static hap_status wrap_fill(const wrap_order *order, const char *args, wrap *out,
                            hap_detail *detail)
{
  out->ops = *order->ops;
  out->inner = order->inner;
  out->over = order->over;
  out->self = order->context;
  return order->over->open != NULL ? order->over->open(order->context, args, &out->self, detail)
                                   : HAP_OK;
}

static hap_status wrap_open(void *context, const char *args, void **self, hap_detail *detail)
{
  const wrap_order *order = context;
  if (!hapi_device_claim(order->inner)) {
    return hapi_fail(detail, HAP_ERROR_STATE,
                     "device '%s': a pointer or another wrapper has the device in it",
                     order->ops->name);
  }
  wrap *w = hapi_alloc(sizeof *w);
  if (w == NULL) {
    hapi_device_release(order->inner);
    return hapi_fail(detail, HAP_ERROR_MEMORY, "device '%s': out of memory", order->ops->name);
  }
  hap_status status = wrap_fill(order, args, w, detail);
  if (status < HAP_OK) {
    hapi_free(w);
    hapi_device_release(order->inner);
    return status;
  }
  w->inner->wrapped = true;
  *self = w;
  return HAP_OK;
}

static void wrap_close(void *self)
{
  wrap *w = self;
  if (w->over->close != NULL) {
    w->over->close(w->self);
  }
  w->inner->wrapped = false;
  hapi_device_release(w->inner);
  hapi_free(w);
}

static void wrap_describe(void *self, uint32_t effector, hap_device_info *out)
{
  const wrap *w = self;
  (void)hap_device_get_effector(w->inner, effector, out, sizeof *out);
  if (w->over->describe != NULL) {
    w->over->describe(w->self, effector, out);
  }
  out->effector_count = w->inner->effector_count;
}

static void wrap_describe_axis(void *self, uint32_t effector, uint32_t axis, hap_axis_info *out)
{
  const wrap *w = self;
  (void)hap_device_get_axis(w->inner, effector, axis, out, sizeof *out);
  if (HAS_OPERATION(w->over, describe_axis)) {
    w->over->describe_axis(w->self, effector, axis, out);
  }
}

static hap_status wrap_start(void *self)
{
  const wrap *w = self;
  const hap_device_ops *ops = w->inner->ops;
  hap_status status = ops->start(w->inner->self);
  if (status < HAP_OK || w->over->start == NULL) {
    return status;
  }
  status = w->over->start(w->self);
  if (status < HAP_OK) {
    ops->zero(w->inner->self);
    ops->stop(w->inner->self);
  }
  return status;
}

static hap_status wrap_read(void *self, int64_t time_ns, hap_device_input *const out[])
{
  const wrap *w = self;
  return w->over->read != NULL ? w->over->read(w->self, time_ns, out)
                               : hap_device_read(w->inner, time_ns, out);
}

static hap_status wrap_write(void *self, const hap_device_output *const wanted[],
                             hap_device_output *const reached[])
{
  const wrap *w = self;
  return w->over->write != NULL ? w->over->write(w->self, wanted, reached)
                                : hap_device_write(w->inner, wanted, reached);
}

static void wrap_zero(void *self)
{
  const wrap *w = self;
  w->inner->ops->zero(w->inner->self);
  if (w->over->zero != NULL) {
    w->over->zero(w->self);
  }
}

static void wrap_stop(void *self)
{
  const wrap *w = self;
  w->inner->ops->zero(w->inner->self);
  w->inner->ops->stop(w->inner->self);
  if (w->over->stop != NULL) {
    w->over->stop(w->self);
  }
}

static void wrap_held(void *self, hap_device_output *const out[])
{
  const wrap *w = self;
  if (HAS_OPERATION(w->over, held)) {
    w->over->held(w->self, out);
  } else {
    w->inner->ops->held(w->inner->self, out);
  }
}

static void wrap_explain(void *self, hap_detail *out)
{
  const wrap *w = self;
  if (HAS_OPERATION(w->over, explain)) {
    w->over->explain(w->self, out);
  }
  if (out->text[0] == '\0') {
    hapi_device_explain(w->inner->ops, w->inner->self, out);
  }
}

static hap_device_ops wrap_ops(const hap_device *inner, const hap_device_ops *over)
{
  bool holds = HAS_OPERATION(over, held) || HAS_OPERATION(inner->ops, held);
  return (hap_device_ops){.abi = HAP_DEVICE_ABI,
                          .size = sizeof(hap_device_ops),
                          .name = over->name,
                          .help = over->help,
                          .pacing = inner->ops->pacing,
                          .open = wrap_open,
                          .describe = wrap_describe,
                          .start = wrap_start,
                          .read = wrap_read,
                          .write = wrap_write,
                          .zero = wrap_zero,
                          .stop = wrap_stop,
                          .close = wrap_close,
                          .held = holds ? wrap_held : NULL,
                          .explain = wrap_explain,
                          .describe_axis = wrap_describe_axis};
}

hap_status hap_device_wrap(hap_device *inner, const hap_device_ops *ops, void *context,
                           hap_device **out, hap_detail *detail)
{
  hap_detail unread = {0};
  hap_detail *text = detail != NULL ? detail : &unread;
  text->text[0] = '\0';
  if (out == NULL || inner == NULL || ops == NULL) {
    return hapi_fail(text, HAP_ERROR_ARGUMENT, "hap_device_wrap: inner, ops or out is NULL");
  }
  *out = NULL;
  HAPI_TRY(hapi_device_check_abi(ops, text));
  const hap_device_ops outer = wrap_ops(inner, ops);
  wrap_order order = {inner, ops, context, &outer};
  HAPI_TRY(hapi_device_open_ops(&outer, &order, "", out, text));
  const wrap *w = (*out)->self;
  (*out)->ops = &w->ops; /* outer goes */
  return HAP_OK;
}

/* ---- for its operations ---- */

hap_status hap_device_read(hap_device *inner, int64_t time_ns, hap_device_input *const out[])
{
  if (inner == NULL || out == NULL) {
    return HAP_ERROR_ARGUMENT;
  }
  return inner->wrapped ? inner->ops->read(inner->self, time_ns, out) : HAP_ERROR_STATE;
}

static bool output_is_finite(const hap_device_output *output)
{
  return hapi_finite(output->wrench.force, 3) && hapi_finite(output->wrench.torque, 3) &&
         hapi_finite(output->axis_forces, HAP_AXES_MAX);
}

hap_status hap_device_write(hap_device *inner, const hap_device_output *const wanted[],
                            hap_device_output *const reached[])
{
  if (inner == NULL || wanted == NULL || reached == NULL) {
    return HAP_ERROR_ARGUMENT;
  }
  for (uint32_t i = 0; inner->wrapped && i < inner->effector_count; ++i) {
    if (!output_is_finite(wanted[i])) {
      inner->ops->zero(inner->self);
      return HAP_ERROR_ARGUMENT;
    }
  }
  return inner->wrapped ? inner->ops->write(inner->self, wanted, reached) : HAP_ERROR_STATE;
}
