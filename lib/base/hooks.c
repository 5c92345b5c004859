/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/hooks.h>

#include "base/alloc.h"
#include "base/def.h"

#define HOOKS_COOKIE 0x48484b31u

void hap_hooks_init(hap_hooks *hooks, size_t size_of_hooks)
{
  const hap_hooks none = {.cookie = HOOKS_COOKIE};
  hapi_def_init(hooks, size_of_hooks, &none, sizeof none);
}

hap_status hap_hooks_set(const hap_hooks *hooks)
{
  hap_hooks wanted;
  hap_hooks_init(&wanted, sizeof wanted);
  hap_status status = hooks == NULL ? HAP_OK
                                    : hapi_def_read(&wanted, sizeof wanted, hooks, HOOKS_COOKIE,
                                                    "hap_hooks_init", NULL);
  if (status < HAP_OK) {
    return status;
  }
  /* Half a pair would free the memory of one heap in another. */
  if ((wanted.allocate == NULL) != (wanted.release == NULL)) {
    return HAP_ERROR_ARGUMENT;
  }
  hapi_hooks_use(&wanted);
  return HAP_OK;
}
