/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_VIEW_CAMERA_H
#define HAPODE_VIEW_CAMERA_H

/* Where the eye is, and how a scene gets into the picture. */

#include <stdbool.h>
#include <stddef.h>

#include "view/view_math.h"

typedef struct view_camera {
  float eye[3];
  float target[3];
  float up_share;   /* part of the height that the middle is moved up by, for strips below */
  float free_share; /* part of the height that the scene may fill */
  float size;       /* m, of what is framed: distance of its corners from the middle */
  view_matrix look; /* world to picture */
  view_matrix back; /* picture to directions from the eye */
} view_camera;

/* What must be seen: balls. */
typedef struct camera_ball {
  float centre[3];
  float radius;
} camera_ball;

/* Looks at all balls from the usual side; size is set before. aspect: width by height. */
void camera_frame(view_camera *io, const camera_ball *balls, size_t count, float aspect);
/* From the middle of the balls to the corners of their box, m; 0.1 where there are none. */
float camera_bound(const camera_ball *balls, size_t count);
/* After eye, target, up_share and size are set. */
void camera_look(view_camera *io, float aspect);
/* The sun's map: world to its square, over the scene. Gives the size of a texel, m. */
float camera_sun(const view_camera *camera, const float sun[3], int texels, view_matrix *out);

#endif
