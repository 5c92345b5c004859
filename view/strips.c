/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "view/strips.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "view/font.h"

static const float ink_dark[4] = {0.10F, 0.12F, 0.15F, 1.0F};
static const float ink_soft[4] = {0.28F, 0.31F, 0.36F, 1.0F};
static const float ink_light[4] = {0.94F, 0.95F, 0.97F, 1.0F};
static const float ink_faint[4] = {0.94F, 0.95F, 0.97F, 0.62F};
static const float ink_grid[4] = {1.0F, 1.0F, 1.0F, 0.16F};
static const float ink_panel_colour[4] = {0.09F, 0.11F, 0.14F, 0.88F};
static const float ink_paper[4] = {1.0F, 1.0F, 1.0F, 0.55F};

void view_strips_init(view_strips *strips, double seconds)
{
  memset(strips, 0, sizeof *strips);
  strips->seconds = seconds;
  for (int i = 0; i < VIEW_BINS; ++i) {
    strips->force[i] = strips->tick_us[i] = -1.0F;
  }
}

/* Forgets the oldest bins. */
static void bins_shift(view_strips *io, size_t by)
{
  float *const all[] = {io->force, io->tick_us, io->tick_weight};
  by = by < VIEW_BINS ? by : VIEW_BINS;
  for (size_t i = 0; i < sizeof all / sizeof all[0]; ++i) {
    memmove(all[i], all[i] + by, (VIEW_BINS - by) * sizeof(float));
    for (size_t k = VIEW_BINS - by; k < VIEW_BINS; ++k) {
      all[i][k] = all[i] == io->tick_weight ? 0.0F : -1.0F;
    }
  }
}

void view_strips_add(view_strips *strips, double t, double force_n, double tick_us)
{
  const double bin_s = strips->seconds / VIEW_BINS;
  const double late = t - strips->begin - strips->seconds;
  if (late >= bin_s && bin_s > 0.0) {
    const double by = ceil(late / bin_s);
    bins_shift(strips, by < VIEW_BINS ? (size_t)by : VIEW_BINS);
    strips->begin += by * bin_s;
  }
  double place = bin_s > 0.0 ? (t - strips->begin) / bin_s : 0.0;
  int bin = place < 0.0 ? 0 : place < VIEW_BINS ? (int)place : VIEW_BINS - 1;
  float weight = strips->tick_weight[bin];
  float mean = weight > 0.0F ? strips->tick_us[bin] : 0.0F;
  strips->force[bin] = fmaxf(strips->force[bin], (float)force_n);
  strips->tick_us[bin] = (mean * weight + (float)tick_us) / (weight + 1.0F);
  strips->tick_weight[bin] = weight + 1.0F;
}

float strips_share(int height)
{
  return height < 420 ? 0.21F : 0.185F;
}

float strips_unit(int height)
{
  return fmaxf((float)height / 720.0F, 0.66F);
}

/* The smallest of 1, 2, 5, 10, ... that is not below. */
static float round_up(float value)
{
  float decade = powf(10.0F, floorf(log10f(fmaxf(value, 1e-6F))));
  float share = value / decade;
  return decade * (share <= 1.0F ? 1.0F : share <= 2.0F ? 2.0F : share <= 5.0F ? 5.0F : 10.0F);
}

/* One plot in a box of left, top, right, bottom. */
typedef struct strip_plot {
  float box[4];
  float unit;
  float now; /* share of the width; < 0: not to be marked */
  const float *values;
  float colour[4];
  float least; /* to which the scale reaches, however small the values */
  const char *name;
  const char *unit_name;
} strip_plot;

/* Three digits, and no powers of ten. */
static int number_write(char *out, size_t size, double value)
{
  int digits = value >= 99.95 ? 0 : value >= 9.995 ? 1 : 2;
  return snprintf(out, size, "%.*f", digits, value);
}

/* The top of a plot: single peaks far above the rest are cut. */
static float values_top(const float *values, float most, float least)
{
  float sum = 0.0F;
  int count = 0;
  for (int i = 0; i < VIEW_BINS; ++i) {
    sum += fmaxf(values[i], 0.0F);
    count += values[i] >= 0.0F;
  }
  return round_up(fmaxf(fminf(most, count > 0 ? 8.0F * sum / (float)count : 0.0F), least));
}

static float values_most(const float *values)
{
  float most = 0.0F;
  for (int i = 0; i < VIEW_BINS; ++i) {
    most = fmaxf(most, values[i]);
  }
  return most;
}

/* Bins between two values that have none get theirs from the line between them, as it is drawn. */
static void values_join(const float *values, float out[VIEW_BINS])
{
  int last = -1;
  memcpy(out, values, VIEW_BINS * sizeof out[0]);
  for (int i = 0; i < VIEW_BINS; ++i) {
    if (values[i] < 0.0F) {
      continue;
    }
    for (int k = last + 1; last >= 0 && k < i; ++k) {
      const float share = (float)(k - last) / (float)(i - last);
      out[k] = values[last] + share * (values[i] - values[last]);
    }
    last = i;
  }
}

/* Below the curve, a column for each pixel. */
static void area_fill(ink *io, const strip_plot *p, const float area[4], float top)
{
  const float fill[4] = {p->colour[0], p->colour[1], p->colour[2], 0.20F};
  const float scale = VIEW_BINS / (area[2] - area[0]);
  float joined[VIEW_BINS];
  values_join(p->values, joined);
  for (float x = ceilf(area[0]); x + 1.0F <= area[2]; x += 1.0F) {
    int bin = (int)((x + 0.5F - area[0]) * scale);
    float value = bin < VIEW_BINS ? joined[bin] : -1.0F;
    float y = area[3] - (area[3] - area[1]) * fminf(value / top, 1.0F);
    if (value > 0.0F) {
      ink_panel(io, (const float[4]){x, y, x + 1.0F, area[3]}, 0.0F, fill);
    }
  }
}

static void curve_draw(ink *io, const strip_plot *p, const float area[4], float top)
{
  const float wide = (area[2] - area[0]) / VIEW_BINS;
  float last[2] = {0.0F, 0.0F};
  bool begun = false;
  for (int i = 0; i < VIEW_BINS; ++i) {
    if (p->values[i] < 0.0F) {
      continue;
    }
    const float at[2] = {area[0] + wide * ((float)i + 0.5F),
                         area[3] - (area[3] - area[1]) * fminf(p->values[i] / top, 1.0F)};
    if (begun) {
      ink_line(io, (const float[4]){last[0], last[1], at[0], at[1]}, 0.85F * p->unit, p->colour);
    }
    memcpy(last, at, sizeof last);
    begun = true;
  }
}

static void plot_draw(ink *io, const strip_plot *p)
{
  const float u = p->unit;
  const float *b = p->box;
  const float area[4] = {b[0] + 46.0F * u, b[1] + 34.0F * u, b[2] - 14.0F * u, b[3] - 14.0F * u};
  const float most = values_most(p->values);
  const float top = values_top(p->values, most, p->least);
  char text[64];
  ink_panel(io, b, 7.0F * u, ink_panel_colour);
  ink_text(io, (const float[3]){b[0] + 13.0F * u, b[1] + 20.0F * u, 9.5F * u}, INK_LEFT, ink_light,
           p->name);
  for (int i = 0; i <= 2; ++i) {
    const float y = area[3] - 0.5F * (float)i * (area[3] - area[1]);
    ink_line(io, (const float[4]){area[0], y, area[2], y}, 0.4F * u, ink_grid);
    snprintf(text, sizeof text, "%g", 0.5 * (double)i * (double)top);
    ink_text(io, (const float[3]){area[0] - 7.0F * u, y + 3.5F * u, 7.5F * u}, INK_RIGHT, ink_faint,
             text);
  }
  area_fill(io, p, area, top);
  curve_draw(io, p, area, top);
  float value = -1.0F;
  if (p->now >= 0.0F) {
    const float x = area[0] + p->now * (area[2] - area[0]);
    int bin = (int)(p->now * VIEW_BINS);
    for (bin = bin < VIEW_BINS ? bin : VIEW_BINS - 1; bin >= 0 && value < 0.0F; --bin) {
      value = p->values[bin];
    }
    ink_line(io, (const float[4]){x, area[1], x, area[3]}, 0.6F * u, ink_light);
    if (value >= 0.0F) {
      const float y = area[3] - (area[3] - area[1]) * fminf(value / top, 1.0F);
      ink_line(io, (const float[4]){x, y, x, y}, 3.4F * u, ink_light);
      ink_line(io, (const float[4]){x, y, x, y}, 2.2F * u, p->colour);
    }
  }
  int used = number_write(text, sizeof text, (double)fmaxf(value, 0.0F));
  used += snprintf(text + used, sizeof text - (size_t)used, " %s   most ", p->unit_name);
  (void)number_write(text + used, sizeof text - (size_t)used, (double)most);
  ink_text(io, (const float[3]){b[2] - 14.0F * u, b[1] + 20.0F * u, 9.5F * u}, INK_RIGHT, p->colour,
           text);
}

void strips_draw(ink *io, const view_strips *strips, double t, const int size[2])
{
  const float u = strips_unit(size[1]);
  const float gap = 12.0F * u;
  const float top = (float)size[1] * (1.0F - strips_share(size[1]));
  const float bottom = (float)size[1] - gap;
  const float middle = 0.5F * (float)size[0];
  const double share = strips->seconds > 0.0 ? (t - strips->begin) / strips->seconds : 0.0;
  const float now = (float)fmin(fmax(share, 0.0), 1.0);
  const strip_plot force = {.box = {gap, top, middle - 0.5F * gap, bottom},
                            .unit = u,
                            .now = now,
                            .values = strips->force,
                            .colour = {0.25F, 0.86F, 0.50F, 1.0F},
                            .least = 0.1F,
                            .name = "force on the hand",
                            .unit_name = "N"};
  const strip_plot tick = {.box = {middle + 0.5F * gap, top, (float)size[0] - gap, bottom},
                           .unit = u,
                           .now = now,
                           .values = strips->tick_us,
                           .colour = {0.98F, 0.72F, 0.30F, 1.0F},
                           .least = 1.0F,
                           .name = "time of a tick",
                           .unit_name = "\x7fs"};
  plot_draw(io, &force);
  plot_draw(io, &tick);
}

void labels_draw(ink *io, const view_labels *labels, const view_frame *frame, const int size[2])
{
  const float u = strips_unit(size[1]);
  char text[64];
  int used = snprintf(text, sizeof text, "t = %.3f s", frame->t);
  if (frame->force_error > 0.0) {
    snprintf(text + used, sizeof text - (size_t)used, "   force error %.2g %%",
             100.0 * frame->force_error);
  }
  ink_text(io, (const float[3]){22.0F * u, 36.0F * u, 15.0F * u}, INK_LEFT, ink_dark,
           labels->title);
  ink_text(io, (const float[3]){22.0F * u, 58.0F * u, 9.5F * u}, INK_LEFT, ink_soft,
           labels->subtitle);
  ink_text(io, (const float[3]){22.0F * u, 78.0F * u, 9.5F * u}, INK_LEFT, ink_soft, text);
}

void legend_draw(ink *io, const view_frame *frame, const int size[2])
{
  static const struct {
    hap_body_role role;
    const char *text;
  } rows[] = {{HAP_ROLE_LOOP, "in the loop"},  {HAP_ROLE_RESTING, "in the loop, at rest"},
              {HAP_ROLE_MEASURED, "measured"}, {HAP_ROLE_EDGE, "at the edge"},
              {HAP_ROLE_DRIVEN, "driven"},     {HAP_ROLE_WORLD, "far"}};
  const float u = strips_unit(size[1]);
  const float right = (float)size[0] - 22.0F * u;
  float y = 34.0F * u;
  for (size_t i = 0; i < sizeof rows / sizeof rows[0]; ++i) {
    size_t count = 0;
    char text[64];
    float colour[4] = {0.0F, 0.0F, 0.0F, 1.0F};
    for (size_t k = 0; k < frame->body_count; ++k) {
      count += frame->roles[k] == rows[i].role;
    }
    if (count == 0) {
      continue;
    }
    view_role_colour(rows[i].role, colour);
    snprintf(text, sizeof text, "%s  %zu", rows[i].text, count);
    ink_text(io, (const float[3]){right - 20.0F * u, y, 9.5F * u}, INK_RIGHT, ink_soft, text);
    ink_panel(io, (const float[4]){right - 12.0F * u, y - 11.0F * u, right, y + 1.0F * u}, 3.0F * u,
              colour);
    y += 20.0F * u;
  }
}

/* ---- over the picture ---- */

static float panel_width(const view_panel *panel, float u)
{
  float wide[2] = {0.0F, 0.0F};
  for (size_t i = 0; i < panel->row_count; ++i) {
    for (int k = 0; k < 2; ++k) {
      wide[k] = fmaxf(wide[k], ink_text_width(panel->rows[i][k], 8.5F * u));
    }
  }
  return 50.0F * u + fmaxf(wide[0] + wide[1], ink_text_width(panel->title, 9.5F * u));
}

static void panel_draw(ink *io, const view_panel *panel, const float at[2], float u)
{
  const float row = 17.0F * u;
  const float text = 8.5F * u;
  const float right = at[0] + panel_width(panel, u);
  float first = 0.0F;
  for (size_t i = 0; i < panel->row_count; ++i) {
    first = fmaxf(first, ink_text_width(panel->rows[i][0], text));
  }
  const float bottom = at[1] + 44.0F * u + row * (float)panel->row_count;
  ink_panel(io, (const float[4]){at[0], at[1], right, bottom}, 8.0F * u, ink_panel_colour);
  ink_text(io, (const float[3]){at[0] + 16.0F * u, at[1] + 24.0F * u, 9.5F * u}, INK_LEFT,
           ink_light, panel->title);
  for (size_t i = 0; i < panel->row_count; ++i) {
    const float y = at[1] + 46.0F * u + row * (float)i;
    ink_text(io, (const float[3]){at[0] + 16.0F * u, y, text}, INK_LEFT, ink_light,
             panel->rows[i][0]);
    ink_text(io, (const float[3]){at[0] + 34.0F * u + first, y, text}, INK_LEFT, ink_faint,
             panel->rows[i][1]);
  }
}

static void notice_draw(ink *io, const char *notice, bool strips, const int size[2])
{
  const float u = strips_unit(size[1]);
  const float below = strips ? strips_share(size[1]) : 0.0F;
  float y = (float)size[1] * (1.0F - below) - 30.0F * u;
  char line[128];
  while (*notice != '\0') {
    const size_t length = strcspn(notice, "\n");
    snprintf(line, sizeof line, "%.*s", (int)length, notice);
    const float half = 0.5F * ink_text_width(line, 10.0F * u) + 12.0F * u;
    const float x = 0.5F * (float)size[0];
    ink_panel(io, (const float[4]){x - half, y - 16.0F * u, x + half, y + 9.0F * u}, 6.0F * u,
              ink_panel_colour);
    ink_text(io, (const float[3]){x, y + 1.0F * u, 10.0F * u}, INK_MIDDLE, ink_light, line);
    notice += length + (notice[length] != '\0');
    y -= 30.0F * u;
  }
}

/* Ends and height of the slider: over the curve of the force strip. */
static void slider_place(const int size[2], float out[3])
{
  const float u = strips_unit(size[1]);
  out[0] = 24.0F * u;
  out[1] = (float)size[0] - 24.0F * u;
  out[2] = (float)size[1] * (1.0F - strips_share(size[1])) - 14.0F * u;
}

bool slider_share(const int size[2], const double xy[2], double *out_share)
{
  float at[3];
  slider_place(size, at);
  const double share = (xy[0] - (double)at[0]) / (double)(at[1] - at[0]);
  *out_share = fmin(fmax(share, 0.0), 1.0);
  return share > -0.02 && share < 1.02 &&
         fabs(xy[1] - (double)at[2]) < 14.0 * (double)strips_unit(size[1]);
}

static void slider_draw(ink *io, const double shares[2], const int size[2])
{
  static const float filled[4] = {0.86F, 0.13F, 0.17F, 1.0F};
  const float u = strips_unit(size[1]);
  float at[3];
  slider_place(size, at);
  const float wide = at[1] - at[0];
  const float now = at[0] + wide * (float)shares[0];
  const float known = at[0] + wide * (float)shares[1];
  ink_line(io, (const float[4]){at[0], at[2], at[1], at[2]}, 3.0F * u, ink_paper);
  ink_line(io, (const float[4]){at[0], at[2], known, at[2]}, 3.0F * u, ink_panel_colour);
  ink_line(io, (const float[4]){at[0], at[2], now, at[2]}, 3.0F * u, filled);
  ink_line(io, (const float[4]){now, at[2], now, at[2]}, 8.0F * u, ink_light);
  ink_line(io, (const float[4]){now, at[2], now, at[2]}, 5.5F * u, filled);
}

void overlay_draw(ink *io, const view_labels *labels, bool strips, const int size[2])
{
  const float u = strips_unit(size[1]);
  if (labels->has_slider) {
    slider_draw(io, labels->slider, size);
  }
  if (labels->notice[0] != '\0') {
    notice_draw(io, labels->notice, strips, size);
  }
  for (size_t i = 0; i < VIEW_PANELS; ++i) {
    const view_panel *p = &labels->panels[i];
    const float middle = 0.5F * ((float)size[0] - panel_width(p, u));
    const float at[2] = {i == 0 ? 22.0F * u : middle, (i == 0 ? 100.0F : 36.0F) * u};
    if (p->row_count > 0) {
      panel_draw(io, p, at, u);
    }
  }
}

void arrow_label_draw(ink *io, const float at[2], double force_n, const int size[2])
{
  const float u = strips_unit(size[1]);
  char text[32];
  snprintf(text, sizeof text, "%.1f N", force_n);
  const float half = 0.5F * ink_text_width(text, 10.0F * u) + 7.0F * u;
  const bool beside = at[0] > 0.45F * (float)size[0] && at[0] < 0.8F * (float)size[0];
  const float low = (beside ? 20.0F : 100.0F) * u; /* below the labels */
  const float high = (float)size[1] * (1.0F - strips_share(size[1])) - 14.0F * u;
  const float x = fminf(fmaxf(at[0], half + 8.0F * u), (float)size[0] - half - 8.0F * u);
  const float y = fminf(fmaxf(at[1] - 26.0F * u, low), high);
  ink_panel(io, (const float[4]){x - half, y - 11.0F * u, x + half, y + 9.0F * u}, 5.0F * u,
            ink_paper);
  ink_text(io, (const float[3]){x, y + 4.0F * u, 10.0F * u}, INK_MIDDLE, ink_dark, text);
}

void grid_label_draw(ink *io, float cell, bool strips, const int size[2])
{
  const float u = strips_unit(size[1]);
  const float below = strips ? strips_share(size[1]) : 0.0F;
  char text[40];
  const bool small = (double)cell < 0.999;
  snprintf(text, sizeof text, "grid %.6g %s", (small ? 1e3 : 1.0) * (double)cell,
           small ? "mm" : "m");
  ink_text(io,
           (const float[3]){(float)size[0] - 22.0F * u, (float)size[1] * (1.0F - below) - 12.0F * u,
                            8.0F * u},
           INK_RIGHT, ink_soft, text);
}
