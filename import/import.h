/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_IMPORT_IMPORT_H
#define HAPODE_IMPORT_IMPORT_H

/* Scenes from files of others: MJCF and URDF (docs/scene_files.md). What cannot be had of a file is
 * told line by line, and the rest is loaded. */

#include <hapode/scene.h>

#include "import/model.h"

typedef struct import_options {
  bool strict; /* what would be left out is refused */
  /* A line "file:line: text" of what is left out; NULL: nobody is told */
  void (*said)(void *user, const char *line);
  void *user;
} import_options;

/* A scene from a file; options NULL: not strict, nobody is told. Initialises ODE for the calling
 * thread. *out_notes (may be NULL): lines that were told.
 * HAP_ERROR_NOT_FOUND: it cannot be opened. HAP_ERROR_FORMAT, with "file:line: text" as detail:
 * refused. HAP_ERROR_MEMORY. Errors of hap_scene_add_body and its like. */
HAP_NODISCARD hap_status import_scene(const char *path, const import_options *options,
                                      hap_scene **out, size_t *out_notes, hap_detail *detail);

/* The same without a scene; work was zeroed but for its options, and is finished by the caller. */
HAP_NODISCARD hap_status import_read(import_work *work, const char *path, import_model *out);

#endif
