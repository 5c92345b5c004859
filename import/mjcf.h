/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_IMPORT_MJCF_H
#define HAPODE_IMPORT_MJCF_H

#include "import/model.h"
#include "import/xml.h"

/* Of a tree whose root is <mujoco>. The model lives as long as work. */
HAP_NODISCARD hap_status mjcf_read(import_work *work, const xml_element *root, import_model *out);

#endif
