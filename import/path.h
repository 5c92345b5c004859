/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_IMPORT_PATH_H
#define HAPODE_IMPORT_PATH_H

#include "import/notes.h"

/* The folder of a scene file, from which nothing that it names may lead out, links followed. */
HAP_NODISCARD hap_status import_folder(import_work *work, const char *path);

/* "prefix/name" in that folder as a path that can be opened; NULL: it is not there, or leads out:
 * *out_why says which. */
const char *import_path(import_work *work, const char *prefix, const char *name,
                        const char **out_why);

/* The same of a name as URDF has it: "package://NAME/..." is in the nearest folder NAME that the
 * file is in, or beside it, and may not lead out of that; "file://" is taken away. */
const char *import_package_path(import_work *work, const char *name, const char **out_why);

#endif
