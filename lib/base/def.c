/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/def.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include <hapode/version.h>

#include "base/assert.h"
#include "base/log.h"

typedef struct def_head {
  uint32_t size;
  uint32_t cookie;
} def_head;

/* A caller of an older build has room for less than this build knows. */
void hapi_def_init(const hapi_def_type *type, void *def, size_t size_of_def)
{
  HAPI_ASSERT(type->defaults != NULL && type->size >= sizeof(def_head));
  uint32_t size = (uint32_t)size_of_def;
  if (def == NULL || size_of_def < sizeof(def_head)) {
    return;
  }
  memset(def, 0, size_of_def);
  memcpy(def, type->defaults, type->size < size_of_def ? type->size : size_of_def);
  memcpy(def, &size, sizeof size);
}

static hap_status head_read(const hapi_def_type *type, const void *def, def_head *out,
                            hap_detail *detail)
{
  def_head wanted;
  if (def == NULL) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "the def is NULL");
  }
  memcpy(out, def, sizeof *out);
  memcpy(&wanted, type->defaults, sizeof wanted);
  if (out->cookie != wanted.cookie || out->size < sizeof *out || out->size > 65536) {
    return hapi_fail(detail, HAP_ERROR_UNINITIALISED,
                     "the def was not initialised: call %s_init first", type->name);
  }
  return HAP_OK;
}

/* What a newer build of the caller has set must not be passed over. */
hap_status hapi_def_read(const hapi_def_type *type, const void *def, void *out, hap_detail *detail)
{
  def_head head;
  const unsigned char *bytes = def;
  memcpy(out, type->defaults, type->size);
  HAPI_TRY(head_read(type, def, &head, detail));
  for (size_t i = type->size; i < head.size; ++i) {
    if (bytes[i] != 0) {
      return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                       "%s: byte %zu is set, but hapode %s knows %zu of its %u bytes: the program "
                       "was built with newer headers and sets a newer field",
                       type->name, i, hap_version(), type->size, head.size);
    }
  }
  memcpy(out, def, head.size < type->size ? head.size : type->size);
  head.size = (uint32_t)type->size;
  memcpy(out, &head, sizeof head);
  return HAP_OK;
}

hap_status hapi_def_read_optional(const hapi_def_type *type, const void *def, void *out,
                                  hap_detail *detail)
{
  if (def == NULL) {
    hapi_def_init(type, out, type->size);
    return HAP_OK;
  }
  return hapi_def_read(type, def, out, detail);
}

hap_status hapi_def_write(const hapi_def_type *type, const void *known, void *def,
                          hap_detail *detail)
{
  def_head head;
  HAPI_TRY(head_read(type, def, &head, detail));
  size_t size = head.size < type->size ? head.size : type->size;
  memcpy((char *)def + sizeof head, (const char *)known + sizeof head, size - sizeof head);
  return HAP_OK;
}

hap_status hapi_struct_give(const void *value, size_t size, void *out, size_t size_of_out)
{
  uint32_t given = (uint32_t)(size_of_out < size ? size_of_out : size);
  if (out == NULL || size_of_out < sizeof given) {
    return HAP_ERROR_ARGUMENT;
  }
  memcpy(out, value, given);
  memcpy(out, &given, sizeof given);
  return HAP_OK;
}

hap_status hapi_numbers_check(const hapi_number_rule *rules, size_t count, hap_detail *detail)
{
  for (size_t i = 0; i < count; ++i) {
    const hapi_number_rule *r = &rules[i];
    bool other = r->other_name != NULL && r->value == r->other;
    if (!other && !(r->value >= r->low && r->value <= r->high)) {
      return hapi_fail(detail, HAP_ERROR_ARGUMENT, "%s is %g, not %sin %g .. %g", r->name, r->value,
                       r->other_name != NULL ? r->other_name : "", r->low, r->high);
    }
    if (r->value != 0.0 && fabs(r->value) < HAPI_NUMBER_LEAST) {
      return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                       "%s is %g; a number that is not 0 is at least %g", r->name, r->value,
                       HAPI_NUMBER_LEAST);
    }
  }
  return HAP_OK;
}
