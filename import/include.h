/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_IMPORT_INCLUDE_H
#define HAPODE_IMPORT_INCLUDE_H

#include "import/xml.h"

/* Puts what the files of <include> have in the place of these elements. Refused: a file that is not
 * there or leads out of the folder, more than 64 of them. */
HAP_NODISCARD hap_status xml_include(import_work *work, xml_element *root);

#endif
