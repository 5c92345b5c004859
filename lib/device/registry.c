/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "device/device.h"
#include "device/module.h"

/* Declared here and not in a header of the plugin: a device knows the library, never the other way
 * round. These names are all that the library knows of its devices. */
extern const hap_device_ops hapi_virtual_ops;
extern const hap_device_ops hapi_replay_ops;
extern const hap_device_ops hapi_spidar_ops;
extern const hap_device_ops hapi_haply_ops;
extern const hap_device_ops hapi_forcedimension_ops;
extern const hap_device_ops hapi_openhaptics_ops;

/* A list and not self-registration: constructors would be lost in a static library. */
static const hap_device_ops *const built_in[] = {&hapi_virtual_ops,        &hapi_replay_ops,
                                                 &hapi_spidar_ops,         &hapi_haply_ops,
                                                 &hapi_forcedimension_ops, &hapi_openhaptics_ops};

const hap_device_ops *hapi_registry_at(size_t index)
{
  return index < sizeof built_in / sizeof built_in[0] ? built_in[index] : NULL;
}

const hap_device_ops *hapi_registry_find(const char *name, size_t length)
{
  const hap_device_ops *ops;
  for (size_t i = 0; (ops = hapi_registry_at(i)) != NULL; ++i) {
    if (strlen(ops->name) == length && memcmp(ops->name, name, length) == 0) {
      return ops;
    }
  }
  return NULL;
}

const char *hap_device_name_at(size_t index, const char **out_description)
{
  const hap_device_ops *ops = hapi_registry_at(index);
  if (index == sizeof built_in / sizeof built_in[0]) {
    if (out_description != NULL) {
      *out_description = HAPI_MODULE_HELP;
    }
    return HAPI_MODULE_NAME;
  }
  if (out_description != NULL) {
    *out_description = ops != NULL ? ops->help : NULL;
  }
  return ops != NULL ? ops->name : NULL;
}
