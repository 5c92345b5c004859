/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_SCENE_ORACLE_H
#define HAPODE_TESTS_SCENE_ORACLE_H

/* What a reader of scene files has found against what MuJoCo's own compiler finds in the same file.
 * Bodies and joints of MJCF come in the file's order, those of URDF by their names. */

#include <stdbool.h>
#include <stddef.h>

#include "import/model.h"
#include "tests/oracle_notes.h"

typedef struct oracle_found {
  size_t differ;   /* numbers that are not equal within 1e-6 */
  size_t silent;   /* of these: no line of the reader is the reason */
  char first[400]; /* the first of them, a silent one where there is any; of a file that MuJoCo
                      refuses its reason */
} oracle_found;

bool scene_oracle_is_there(void);
/* notes: what the reader has said of the file. False: MuJoCo refuses the file. Meshes of bodies are
 * compared by their mass and the box around them. */
bool scene_oracle(const char *path, const import_model *ours, const oracle_notes *notes,
                  oracle_found *out);

/* Where a body of MJCF, from 0, has its frame after a time, in MuJoCo's own steps of 0.2 ms. False:
 * MuJoCo refuses the file, or has no such body. */
bool scene_oracle_move(const char *path, double seconds, size_t body, double out_position[3]);

#endif
