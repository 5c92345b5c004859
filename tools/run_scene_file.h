/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_RUN_SCENE_FILE_H
#define HAPODE_TOOLS_RUN_SCENE_FILE_H

/* --scene FILE: a scene from a file of others, and a simulated hand that visits its bodies. */

#include "tools/run_options.h"

typedef struct run_scene_file {
  hap_scene *scene; /* NULL: --scene names a built-in one */
  scene_parameters parameters;
  char hand[2000];
} run_scene_file;

/* Where options->rig.scene is a file it is loaded and put into the options, which keep pointers to
 * *out. Lines of what is left out go to stderr. Errors of import_scene; HAP_ERROR_UNSUPPORTED: this
 * program was built without expat. */
HAP_NODISCARD hap_status run_scene_file_open(run_options *options, run_scene_file *out,
                                             hap_detail *detail);
/* The scene of the options once more, a built-in one or of the file, for who reads it beside the
 * run. The caller destroys it. */
HAP_NODISCARD hap_status run_scene_file_again(const run_options *options, hap_scene **out,
                                              hap_detail *detail);
/* After the session over it. */
void run_scene_file_close(run_scene_file *file);

#endif
