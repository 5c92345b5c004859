/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_VIEW_FONT_H
#define HAPODE_VIEW_FONT_H

/* Letters made of strokes. A capital is 6 units high; the baseline is at y = 2. */

#define FONT_BASELINE 2.0F
#define FONT_CAPITAL 6.0F
#define FONT_MICRO '\x7f' /* the Greek letter of 1e-6 */

/* Strokes of a letter: pairs of digits x y, and a blank where the pen is lifted. A letter that is
 * not there gives a box. */
const char *font_strokes(char letter);
float font_advance(char letter); /* to the next letter */
float font_width(const char *text);

#endif
