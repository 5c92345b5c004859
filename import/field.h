/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_IMPORT_FIELD_H
#define HAPODE_IMPORT_FIELD_H

#include "import/model.h"

/* Heights of a PNG file, as its grey says, or of MuJoCo's own form: two counts and numbers of 32
 * bits. The first row is the lowest along y. NULL: *out_why says why; larger than 4096 x 4096, a
 * number that is none, or no libpng in this build. */
import_field *import_field_file(import_work *work, const char *path, const char **out_why);

/* From 0 to height, which is what the highest of them gets; all 0 where they are equal. */
void import_field_scale(import_field *field, double height);

#endif
