/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_IMPORT_MESH_FILE_H
#define HAPODE_IMPORT_MESH_FILE_H

#include "import/model.h"

/* Triangles of an STL (binary or text), OBJ or MSH file, by the end of its name. NULL: *out_why
 * says why. Refused: more than 64 MiB or 1000000 triangles, an index or a number that cannot be. */
import_mesh *import_mesh_file(import_work *work, const char *path, const char **out_why);

#endif
