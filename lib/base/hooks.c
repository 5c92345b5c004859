/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/hooks.h>

#include "base/alloc.h"
#include "base/def.h"
#include "base/log.h"

static const hap_hooks no_hooks = {.cookie = 0x48484b31u};
static const hapi_def_type hooks_type = HAPI_DEF_TYPE(hap_hooks, no_hooks);

void hap_hooks_init(hap_hooks *hooks, size_t size_of_hooks)
{
  hapi_def_init(&hooks_type, hooks, size_of_hooks);
}

hap_status hap_hooks_set(const hap_hooks *hooks)
{
  hap_hooks wanted;
  HAPI_TRY(hapi_def_read_optional(&hooks_type, hooks, &wanted, NULL));
  /* Half a pair would free the memory of one heap in another. */
  if ((wanted.allocate == NULL) != (wanted.release == NULL)) {
    return HAP_ERROR_ARGUMENT;
  }
  hapi_hooks_use(&wanted);
  return HAP_OK;
}
