/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/def.h"

#include <string.h>

#include <hapode/version.h>

#include "base/assert.h"
#include "base/log.h"

typedef struct def_head {
  uint32_t size;
  uint32_t cookie;
} def_head;

/* A caller of an older build has room for less than this build knows. */
void hapi_def_init(void *def, size_t size_of_def, const void *defaults, size_t size)
{
  HAPI_ASSERT(defaults != NULL && size >= sizeof(def_head));
  def_head head;
  if (def == NULL || size_of_def < sizeof head) {
    return;
  }
  memset(def, 0, size_of_def);
  memcpy(def, defaults, size < size_of_def ? size : size_of_def);
  memcpy(&head, def, sizeof head);
  head.size = (uint32_t)size_of_def;
  memcpy(def, &head, sizeof head);
}

/* What a newer build of the caller has set must not be passed over. */
static hap_status def_check_unknown(const void *def, size_t size_of_def, size_t known,
                                    const char *init_name, hap_detail *detail)
{
  const unsigned char *bytes = def;
  for (size_t i = known; i < size_of_def; ++i) {
    if (bytes[i] != 0) {
      return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                       "%.*s: byte %zu is set, but hapode %s knows %zu of its %zu bytes: the "
                       "program was built with newer headers and sets a newer field",
                       (int)(strlen(init_name) - strlen("_init")), init_name, i, hap_version(),
                       known, size_of_def);
    }
  }
  return HAP_OK;
}

hap_status hapi_def_check(const void *def, uint32_t cookie, const char *init_name,
                          uint32_t *out_size, hap_detail *detail)
{
  HAPI_ASSERT(out_size != NULL);
  def_head head;
  if (def == NULL) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "the def is NULL");
  }
  memcpy(&head, def, sizeof head);
  if (head.cookie != cookie || head.size < sizeof head || head.size > 65536) {
    return hapi_fail(detail, HAP_ERROR_UNINITIALISED, "the def was not initialised: call %s first",
                     init_name);
  }
  *out_size = head.size;
  return HAP_OK;
}

hap_status hapi_def_read(void *out, size_t size_of_out, const void *def, uint32_t cookie,
                         const char *init_name, hap_detail *detail)
{
  uint32_t size = 0;
  hap_status status = hapi_def_check(def, cookie, init_name, &size, detail);
  if (status >= HAP_OK) {
    status = def_check_unknown(def, size, size_of_out, init_name, detail);
  }
  if (status >= HAP_OK) {
    def_head head = {(uint32_t)size_of_out, cookie};
    memcpy(out, def, size < size_of_out ? size : size_of_out);
    memcpy(out, &head, sizeof head);
  }
  return status;
}

void hapi_def_write(void *def, const void *known, size_t size_of_known)
{
  def_head head;
  memcpy(&head, def, sizeof head);
  size_t size = head.size < size_of_known ? head.size : size_of_known;
  memcpy((char *)def + sizeof head, (const char *)known + sizeof head, size - sizeof head);
}
