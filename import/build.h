/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_IMPORT_BUILD_H
#define HAPODE_IMPORT_BUILD_H

#include <hapode/scene.h>

#include "import/model.h"

/* Bodies, geoms and joints of a scene from those of a model that was joined. Bodies without joints
 * are parts of the body that carries them. Several joints of a body have bodies between them that
 * take a share of its mass. The scene's error with the place in the file in front of it. */
HAP_NODISCARD hap_status import_build(import_work *work, import_model *model, hap_scene *scene);

#endif
