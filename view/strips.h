/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_VIEW_STRIPS_H
#define HAPODE_VIEW_STRIPS_H

/* Text and plots over the picture. size: width and height, px. */

#include "view/ink.h"
#include "view/view.h"

float strips_share(int height); /* of the height, that the strips take */
float strips_unit(int height);  /* px, of a length that is 1 in a picture of 720 lines */
void strips_draw(ink *io, const view_strips *strips, double t, const int size[2]);
void labels_draw(ink *io, const view_labels *labels, const view_frame *frame, const int size[2]);
void legend_draw(ink *io, const view_frame *frame, const int size[2]);
/* Notice, tables and slider. */
void overlay_draw(ink *io, const view_labels *labels, bool strips, const int size[2]);
bool slider_share(const int size[2], const double xy[2], double *out_share);
void arrow_label_draw(ink *io, const float at[2], double force_n, const int size[2]);
void grid_label_draw(ink *io, float cell, bool strips, const int size[2]);

#endif
