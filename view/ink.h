/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_VIEW_INK_H
#define HAPODE_VIEW_INK_H

/* Strokes, panels and text over the picture; pixels from the upper left corner. */

#include <hapode/status.h>

#include "view/gpu.h"

#define INK_MAX 16384 /* of one picture */

typedef struct ink_mark {
  float ends[4];
  float colour[4];
  float radius;
  float is_panel;
} ink_mark;

typedef struct ink {
  GLuint program;
  GLuint array;
  GLuint buffer;
  size_t count;
  ink_mark marks[INK_MAX];
} ink;

typedef enum ink_side {
  INK_LEFT = 0, /* the text begins there */
  INK_MIDDLE,
  INK_RIGHT
} ink_side;

hap_status ink_make(ink *out, hap_detail *detail);
void ink_free(ink *of);
void ink_line(ink *io, const float ends[4], float radius, const float colour[4]);
void ink_panel(ink *io, const float corners[4], float radius, const float colour[4]);
/* height: px, of a capital. at: on the baseline. */
void ink_text(ink *io, const float at_and_height[3], ink_side side, const float colour[4],
              const char *text);
float ink_text_width(const char *text, float height);
void ink_draw(ink *io, int width, int height); /* and forgets all */

#endif
