/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <stdbool.h>
#include <string.h>

#include <hapode/link.h>

#include "base/alloc.h"
#include "base/assert.h"
#include "base/def.h"
#include "base/log.h"
#include "link/link_internal.h"

/* What all transports have in common: checks on both ways, counts, the text of the last error. */

struct hap_link {
  const hap_link_ops *ops;
  void *self;
  hap_link_figures figures;
  hap_detail detail;
};

static bool ops_are_whole(const hap_link_ops *ops)
{
  return ops->size >= sizeof *ops && ops->name != NULL && ops->send != NULL && ops->poll != NULL &&
         ops->close != NULL;
}

static hap_status ops_check(const hap_link_ops *ops, hap_detail *detail)
{
  if (ops == NULL) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "hap_link_create: ops is NULL");
  }
  if (ops->abi != HAP_LINK_ABI) {
    return hapi_fail(detail, HAP_ERROR_UNSUPPORTED,
                     "hap_link_create: the transport is of ABI %u, and this library has %u: build "
                     "it with the headers of this library",
                     ops->abi, HAP_LINK_ABI);
  }
  return ops_are_whole(ops) ? HAP_OK
                            : hapi_fail(detail, HAP_ERROR_ARGUMENT,
                                        "hap_link_create: an operation of the transport is NULL, "
                                        "or its size is too small");
}

hap_status hap_link_create(const hap_link_ops *ops, void *self, hap_link **out, hap_detail *detail)
{
  hap_status status = ops_check(ops, detail);
  hap_link *link = NULL;
  if (status >= HAP_OK && (self == NULL || out == NULL)) {
    status = hapi_fail(detail, HAP_ERROR_ARGUMENT, "hap_link_create: self or out is NULL");
  }
  if (status >= HAP_OK && (link = hapi_alloc(sizeof *link)) == NULL) {
    status = hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for a link");
  }
  if (out != NULL) {
    *out = link;
  }
  if (status < HAP_OK) {
    if (ops != NULL && ops->abi == HAP_LINK_ABI && self != NULL && ops_are_whole(ops)) {
      ops->close(self);
    }
    return status;
  }
  link->ops = ops;
  link->self = self;
  link->figures.size = sizeof link->figures;
  return HAP_OK;
}

void hap_link_close(hap_link *link)
{
  if (link != NULL) {
    link->ops->close(link->self);
    hapi_free(link);
  }
}

void *hapi_link_self(const hap_link *link, const hap_link_ops *ops)
{
  return link != NULL && link->ops == ops ? link->self : NULL;
}

/* ---- out ---- */

static hap_status parcel_check(hap_link *link, const hap_link_parcel *parcel)
{
  const hap_link_address *to = &parcel->to;
  uint32_t most = parcel->reliable != 0 ? HAP_LINK_RELIABLE_MOST : HAP_LINK_NEWEST_MOST;
  uint32_t parts = parcel->reliable != 0 ? 1 : HAP_LINK_PARTS;
  if (to->channel >= HAP_LINK_CHANNELS || to->part >= parts) {
    return hapi_fail(&link->detail, HAP_ERROR_ARGUMENT,
                     "channel %u, part %u: there are channels below %u and parts below %u",
                     to->channel, to->part, HAP_LINK_CHANNELS, parts);
  }
  if (parcel->data == NULL || parcel->bytes == 0 || parcel->bytes > most) {
    return hapi_fail(&link->detail, HAP_ERROR_ARGUMENT,
                     "a message of %u bytes%s: it may have 1 to %u; send it in parts",
                     parcel->bytes, parcel->data == NULL ? " at NULL" : "", most);
  }
  return HAP_OK;
}

static hap_status parcel_send(hap_link *link, int64_t now_ns, const hap_link_parcel *parcel)
{
  HAPI_TRY(parcel_check(link, parcel));
  hap_status status = link->ops->send(link->self, now_ns, parcel, &link->detail);
  if (status >= HAP_OK) {
    ++link->figures.sent;
    link->figures.sent_bytes += parcel->bytes;
  }
  return status;
}

hap_status hap_link_send_newest(hap_link *link, int64_t now_ns, const hap_link_address *to,
                                const void *data, uint32_t bytes)
{
  if (link == NULL || to == NULL) {
    return HAP_ERROR_ARGUMENT;
  }
  const hap_link_parcel parcel = {.to = *to, .bytes = bytes, .data = data};
  return parcel_send(link, now_ns, &parcel);
}

hap_status hap_link_send_reliably(hap_link *link, int64_t now_ns, const hap_link_address *to,
                                  const void *data, uint32_t bytes)
{
  if (link == NULL || to == NULL) {
    return HAP_ERROR_ARGUMENT;
  }
  const hap_link_parcel parcel = {.to = *to, .reliable = 1, .bytes = bytes, .data = data};
  return parcel_send(link, now_ns, &parcel);
}

/* ---- in ---- */

/* What another end has sent may be anything. */
static bool event_is_good(const hap_link_event *event)
{
  if (event->kind != HAP_LINK_MESSAGE) {
    return event->kind == HAP_LINK_JOINED || event->kind == HAP_LINK_LEFT;
  }
  uint32_t most = event->reliable != 0 ? HAP_LINK_RELIABLE_MOST : HAP_LINK_NEWEST_MOST;
  return event->channel < HAP_LINK_CHANNELS && event->data != NULL && event->bytes > 0 &&
         event->bytes <= most && event->part < (event->reliable != 0 ? 1 : HAP_LINK_PARTS);
}

static void event_count(hap_link *link, const hap_link_event *event)
{
  link->figures.peers += event->kind == HAP_LINK_JOINED;
  link->figures.peers -= event->kind == HAP_LINK_LEFT && link->figures.peers > 0;
  if (event->kind == HAP_LINK_MESSAGE) {
    ++link->figures.received;
    link->figures.received_bytes += event->bytes;
  }
}

hap_status hap_link_poll(hap_link *link, int64_t now_ns, hap_link_event *out, size_t size_of_out)
{
  if (link == NULL || out == NULL || size_of_out < sizeof out->size) {
    return HAP_ERROR_ARGUMENT;
  }
  for (;;) { /* until the transport has no more */
    hap_link_event event = {.size = sizeof event};
    hap_status status = link->ops->poll(link->self, now_ns, &event, &link->detail);
    if (status != HAP_OK) {
      return status;
    }
    bool knows = event.arrived_ns != 0 && event.arrived_ns <= now_ns;
    event.arrived_ns = knows ? event.arrived_ns : now_ns;
    if (event_is_good(&event)) {
      event_count(link, &event);
      return hapi_struct_give(&event, sizeof event, out, size_of_out);
    }
    ++link->figures.refused;
  }
}

hap_status hap_link_detail(const hap_link *link, hap_detail *out)
{
  if (link == NULL || out == NULL) {
    return HAP_ERROR_ARGUMENT;
  }
  *out = link->detail;
  return HAP_OK;
}

hap_status hap_link_get_figures(const hap_link *link, hap_link_figures *out, size_t size_of_out)
{
  return link != NULL ? hapi_struct_give(&link->figures, sizeof link->figures, out, size_of_out)
                      : HAP_ERROR_ARGUMENT;
}
