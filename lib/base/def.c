/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/def.h"

#include <string.h>

#include "base/log.h"

typedef struct def_head {
  uint32_t size;
  uint32_t cookie;
} def_head;

/* A caller of an older build has room for less than this build knows. */
void hapi_def_init(void *def, size_t size_of_def, const void *defaults, size_t size)
{
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

hap_status hapi_def_read(void *out, size_t size_of_out, const void *def, uint32_t cookie,
                         const char *init_name, hap_detail *detail)
{
  def_head head;
  if (def == NULL) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "the def is NULL");
  }
  memcpy(&head, def, sizeof head);
  if (head.cookie != cookie || head.size < sizeof head || head.size > 65536) {
    return hapi_fail(detail, HAP_ERROR_UNINITIALISED, "the def was not initialised: call %s first",
                     init_name);
  }
  memcpy(out, def, head.size < size_of_out ? head.size : size_of_out);
  return HAP_OK;
}
