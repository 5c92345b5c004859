/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Worlds for hands with friction, which pull along the surface and hold. As in build_solid.c
 * they come from apart and go again, over and over. */

#include "tests/stability/build.h"
#include "tests/stability/cases.h"

#define APART 0.002 /* m, before the touch */
#define ACROSS 0.03 /* m, how far a hand pulls to each side */
#define DEEP 0.02   /* m, behind the surface, where its spring pulls it to */
#define HALF (0.5 * WORLD_EDGE)
#define AT(x, y, z) ((const double[3]){(x), (y), (z)})

/* From above onto what has its top there, and round. */
static void rub_at(world *w, double x, double y, double top)
{
  double up = top + w->pointer.radius + APART;
  double z = top + w->pointer.radius - DEEP;
  add_hand(w,
           "path=0:%g/%g/%.9g;0.1:%g/%g/%.9g;0.2:%g/%g/%.9g;0.3:%g/%g/%.9g;0.4:%g/%g/%.9g;"
           "0.5:%g/%g/%.9g;0.6:%g/%g/%.9g,loop=1",
           x, y, up, x, y, z, x + ACROSS, y, z, x + ACROSS, y + ACROSS, z, x - ACROSS, y, z, x,
           y - ACROSS, z, x, y, up);
}

void build_rub(world *w, const case_row *row)
{
  add_floor(w);
  for (int i = 0; i < row->n; ++i) {
    (void)add_cube(w, row->mass, WORLD_EDGE,
                   AT(0.0, 0.0, WORLD_EDGE * (i + 0.5) - WORLD_LAYER * (i + 1)));
  }
  rub_at(w, 0.003, 0.002, row->n * (WORLD_EDGE - WORLD_LAYER));
}

void build_rub_sliding(world *w, const case_row *row)
{
  build_rub(w, row);
  w->surface.mu = 0.0;
}

void build_rub_ball(world *w, const case_row *row)
{
  add_floor(w);
  (void)add_ball(w, row->mass, HALF, AT(0.0, 0.0, HALF - WORLD_LAYER));
  rub_at(w, 0.001, 0.0, WORLD_EDGE - WORLD_LAYER);
}

/* From the side of a top that spins: it drags the finger along. */
void build_rub_top(world *w, const case_row *row)
{
  set_gravity(w, 0.0);
  dBodyID top = add_ball(w, row->mass, HALF, AT(0.0, 0.0, 0.0));
  dBodySetAngularVel(top, 0.0, 0.0, row->size);
  add_hand(w, "path=0:%g/0/0;0.3:%g/0/0;0.6:%g/0/0,loop=1", -HALF - w->pointer.radius - APART,
           -HALF - w->pointer.radius + 0.002, -HALF - w->pointer.radius - APART);
}

/* With the face flat at first, then turning and tilting on it. */
void build_tool_rub(world *w, const case_row *row)
{
  const double edge = row->n > 0 ? WORLD_EDGE : 0.0;
  double low = row->n * (edge - WORLD_LAYER) + TOOL_HALF + TOOL_ROUNDING;
  double z = low - 0.004;
  add_floor(w);
  for (int i = 0; i < row->n; ++i) {
    (void)add_cube(w, row->mass, WORLD_EDGE,
                   AT(0.0, 0.0, WORLD_EDGE * (i + 0.5) - WORLD_LAYER * (i + 1)));
  }
  take_tool(w);
  add_hand(w,
           "dof=6,path=0:0.003/0.002/%.6g;0.2:0.003/0.002/%.6g;0.4:0.018/0.002/%.6g;"
           "0.6:0.003/-0.013/%.6g;0.8:-0.012/0.002/%.6g;1:0.003/0.002/%.6g,"
           "turn=0:0/0/0;0.2:0/0/0;0.4:0/0/0.3;0.6:0.03/0.02/-0.3;0.8:-0.02/0.06/0;1:0/0/0,loop=1",
           low + APART, z, z, z, z, low + APART);
}

/* Two fingers lift a cube beside its middle, swing it, put it down and let go. */
static void case_pinch(world *w, const case_row *row, double reach, const char *more)
{
  double beside = 0.3 * HALF;
  double z = HALF - WORLD_LAYER;
  add_floor(w);
  (void)add_cube(w, row->mass, WORLD_EDGE, AT(0.0, 0.0, z));
  for (int side = -1; side <= 1; side += 2) {
    double x = side * (HALF + reach);
    double open = x + side * APART;
    double close = x - side * DEEP;
    add_hand(w,
             "%spath=0:%g/%g/%g;0.15:%g/%g/%g;0.4:%g/%g/%g;0.6:%g/%g/%g;0.8:%g/%g/%g;0.9:%g/%g/%g;"
             "1:%g/%g/%g,loop=1",
             more, open, beside, z, close, beside, z, close, beside, z + 0.03, close, beside + 0.05,
             z + 0.03, close, beside, z + 0.001, close, beside, z, open, beside, z);
  }
}

void build_pinch(world *w, const case_row *row)
{
  case_pinch(w, row, w->pointer.radius, "");
}

void build_tool_pinch(world *w, const case_row *row)
{
  take_tool(w);
  case_pinch(w, row, TOOL_HALF + TOOL_ROUNDING, "dof=6,");
}
