/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_IMPORT_URDF_H
#define HAPODE_IMPORT_URDF_H

#include "import/model.h"
#include "import/xml.h"

/* Of a tree whose root is <robot>. The links that no joint moves are fixed to the world. The model
 * lives as long as work. */
HAP_NODISCARD hap_status urdf_read(import_work *work, const xml_element *root, import_model *out);

#endif
