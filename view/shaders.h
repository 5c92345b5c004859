/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_VIEW_SHADERS_H
#define HAPODE_VIEW_SHADERS_H

/* Programs of the GPU, GLSL 3.30. Colours are linear until the last line. */

extern const char shader_body_vertex[];
extern const char shader_body_pixel[];
extern const char shader_shadow_vertex[];
extern const char shader_shadow_pixel[];
extern const char shader_sky_vertex[];
extern const char shader_sky_pixel[];
extern const char shader_ink_vertex[];
extern const char shader_ink_pixel[];

#endif
