/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/assert.h"
#include "base/vec.h"
#include "proximity/patch_parts.h"

static const double pi = 3.14159265358979323846;

/* What lies on the border within rounding is inside: flush faces keep their corners. */
static const double border = 1e-9;

static hapi_spot spot_between(const hapi_spot *a, const hapi_spot *b, double t)
{
  return (hapi_spot){.x = a->x + t * (b->x - a->x),
                     .y = a->y + t * (b->y - a->y),
                     .gap = a->gap + t * (b->gap - a->gap)};
}

/* Edges that run along each other more than this cross nowhere for sure: flush boxes. */
#define LEAST_SINE 0.2

/* Whether a spot lies on the border of the reference, along the way to another one. */
static bool spot_on_border(const hapi_spot *spot, double dx, double dy)
{
  double off = fabs(spot->side[0] * dx + spot->side[1] * dy);
  return spot->slide == HAPI_SLIDE_CORNER ||
         (spot->slide == HAPI_SLIDE_EDGE && off <= 1e-9 * (fabs(dx) + fabs(dy)));
}

/* The spot where the way from a to b crosses a side of the reference. On a way along its border
 * that is a corner of the reference, else a point of an edge of the incident feature. */
static hapi_spot edge_cut(const hapi_spot *a, const hapi_spot *b, double t, const double side[2])
{
  HAPI_ASSERT(t >= 0.0 && t <= 1.0);
  hapi_spot spot = spot_between(a, b, t);
  double way[3] = {b->x - a->x, b->y - a->y, b->gap - a->gap};
  if (spot_on_border(a, way[0], way[1]) && spot_on_border(b, way[0], way[1])) {
    spot.slide = HAPI_SLIDE_CORNER;
    return spot;
  }
  hapi_v3_scale(1.0 / hapi_v3_norm(way), way, spot.edge);
  if (fabs(spot.edge[0] * side[0] + spot.edge[1] * side[1]) < LEAST_SINE) {
    return spot;
  }
  spot.slide = HAPI_SLIDE_EDGE;
  spot.side[0] = side[0];
  spot.side[1] = side[1];
  return spot;
}

/* Sutherland-Hodgman: one half plane, left of the line from..to. A line of two spots is treated as
 * a polygon with no area; its doubles are dropped later. */
static int clip_side(const hapi_spot *from, const hapi_spot *to, const hapi_spot *in, int count,
                     hapi_spot *out)
{
  HAPI_ASSERT(count > 0 && count <= HAPI_SPOTS_MAX);
  double dx = to->x - from->x;
  double dy = to->y - from->y;
  double slack = border * (dx * dx + dy * dy);
  double length = sqrt(dx * dx + dy * dy);
  const double side[2] = {dy / length, -dx / length};
  int kept = 0;
  const hapi_spot *last = &in[count - 1];
  double last_out = dy * (last->x - from->x) - dx * (last->y - from->y) - slack;
  for (int i = 0; i < count; ++i) {
    double next_out = dy * (in[i].x - from->x) - dx * (in[i].y - from->y) - slack;
    if ((last_out > 0.0) != (next_out > 0.0) && kept < HAPI_SPOTS_MAX) {
      out[kept++] = edge_cut(last, &in[i], last_out / (last_out - next_out), side);
    }
    if (!(next_out > 0.0) && kept < HAPI_SPOTS_MAX) {
      out[kept++] = in[i];
    }
    last = &in[i];
    last_out = next_out;
  }
  return kept;
}

static bool all_left(const hapi_spot *from, const hapi_spot *to, const hapi_spot *in, int count)
{
  double dx = to->x - from->x;
  double dy = to->y - from->y;
  double slack = border * (dx * dx + dy * dy);
  for (int i = 0; i < count; ++i) {
    if (dy * (in[i].x - from->x) - dx * (in[i].y - from->y) > slack) {
      return false;
    }
  }
  return true;
}

static int clip_polygon(const hapi_feature *reference, const hapi_frame *frame, hapi_spot *spots,
                        int count)
{
  HAPI_ASSERT(reference->count >= 3 && reference->count <= HAPI_CORNERS_MAX);
  hapi_spot side[HAPI_CORNERS_MAX];
  hapi_spot clipped[HAPI_SPOTS_MAX];
  for (int i = 0; i < reference->count; ++i) {
    double arm[3];
    hapi_v3_sub(reference->corner[i], frame->origin, arm);
    side[i] = (hapi_spot){.x = hapi_v3_dot(arm, frame->x), .y = hapi_v3_dot(arm, frame->y)};
  }
  for (int i = 0; i < reference->count && count > 0; ++i) {
    const hapi_spot *to = &side[i + 1 < reference->count ? i + 1 : 0];
    if (!all_left(&side[i], to, spots, count)) {
      count = clip_side(&side[i], to, spots, count, clipped);
      memcpy(spots, clipped, (size_t)count * sizeof *spots);
    }
  }
  return count;
}

/* --- a disc as the reference ------------------------------------------------------------------ */

/* The overlap of a polygon with a disc, in the order of the polygon. */
typedef struct overlap {
  const hapi_spot *polygon;
  int corners;
  double radius;
  double slope[2]; /* of the polygon's plane; its gap at the middle of the disc: */
  double gap;
  double turn; /* 1: counter-clockwise, -1: clockwise, 0: no area */
  hapi_spot *out;
  int count;
  int left_at; /* the overlap has left the disc at this spot, -1: it has not */
} overlap;

static void overlap_push(overlap *o, hapi_spot spot)
{
  HAPI_ASSERT(o->count >= 0 && o->count <= HAPI_SPOTS_MAX);
  if (o->count < HAPI_SPOTS_MAX) {
    o->out[o->count++] = spot;
  }
}

static void push_arc(overlap *o, const hapi_spot *from, double span)
{
  double start = atan2(from->y, from->x);
  int steps = (int)(span / (0.25 * pi));
  for (int i = 1; i <= steps; ++i) {
    double angle = start + o->turn * span * i / (steps + 1.0);
    double x = o->radius * cos(angle);
    double y = o->radius * sin(angle);
    overlap_push(o, (hapi_spot){.x = x, .y = y, .gap = o->gap + o->slope[0] * x + o->slope[1] * y});
  }
}

/* The rim between two spots on it, in the sense of the polygon. */
static void arc_between(overlap *o, const hapi_spot *from, const hapi_spot *to)
{
  double span = o->turn * (atan2(to->y, to->x) - atan2(from->y, from->x));
  span += span < 0.0 ? 2.0 * pi : 0.0;
  if (o->turn != 0.0) {
    push_arc(o, from, span);
  }
}

/* Part t0..t1 of an edge that is in the disc; false: none. */
static bool edge_in_disc(const overlap *o, const hapi_spot *p, const hapi_spot *q, double t[2])
{
  double dx = q->x - p->x;
  double dy = q->y - p->y;
  double length2 = dx * dx + dy * dy;
  double radius2 = o->radius * o->radius * (1.0 + 2.0 * border);
  double off = p->x * dx + p->y * dy;
  double square = off * off - length2 * (p->x * p->x + p->y * p->y - radius2);
  if (!(length2 > 0.0) || square < 0.0) {
    return false;
  }
  double root = sqrt(square);
  t[0] = (-off - root) / length2;
  t[1] = (-off + root) / length2;
  return t[1] > 0.0 && t[0] < 1.0;
}

static void plane_of(overlap *o)
{
  const hapi_spot *s = o->polygon;
  double n[3] = {0.0, 0.0, 0.0};
  for (int i = 1; i + 1 < o->corners; ++i) {
    double u[3] = {s[i].x - s[0].x, s[i].y - s[0].y, s[i].gap - s[0].gap};
    double v[3] = {s[i + 1].x - s[0].x, s[i + 1].y - s[0].y, s[i + 1].gap - s[0].gap};
    double part[3];
    hapi_v3_cross(u, v, part);
    hapi_v3_add(n, part, n);
  }
  bool flat = fabs(n[2]) > 1e-3 * hapi_v3_norm(n);
  o->turn = !flat ? 0.0 : n[2] > 0.0 ? 1.0 : -1.0;
  o->slope[0] = flat ? -n[0] / n[2] : 0.0;
  o->slope[1] = flat ? -n[1] / n[2] : 0.0;
  o->gap = s[0].gap - o->slope[0] * s[0].x - o->slope[1] * s[0].y;
}

static bool polygon_holds_middle(const overlap *o)
{
  for (int i = 0; i < o->corners; ++i) {
    const hapi_spot *p = &o->polygon[i];
    const hapi_spot *q = &o->polygon[i + 1 < o->corners ? i + 1 : 0];
    if (o->turn * (p->x * q->y - p->y * q->x) < 0.0) {
      return false;
    }
  }
  return o->turn != 0.0;
}

static void walk_edges(overlap *o)
{
  int first_entry = -1;
  for (int i = 0; i < o->corners; ++i) {
    const hapi_spot *p = &o->polygon[i];
    const hapi_spot *q = &o->polygon[i + 1 < o->corners ? i + 1 : 0];
    double t[2];
    if (!edge_in_disc(o, p, q, t)) {
      continue;
    }
    hapi_spot entry = t[0] > 0.0 ? spot_between(p, q, t[0]) : *p;
    if (t[0] > 0.0 && o->left_at >= 0) {
      hapi_spot exit = o->out[o->left_at];
      arc_between(o, &exit, &entry);
    }
    overlap_push(o, entry);
    first_entry = first_entry < 0 && t[0] > 0.0 && o->left_at < 0 ? o->count - 1 : first_entry;
    if (t[1] < 1.0) {
      overlap_push(o, spot_between(p, q, t[1]));
      o->left_at = o->count - 1;
    }
  }
  if (first_entry >= 0 && o->left_at >= 0) {
    hapi_spot exit = o->out[o->left_at];
    hapi_spot entry = o->out[first_entry];
    arc_between(o, &exit, &entry);
  }
}

static int clip_disc(double radius, hapi_spot *spots, int count)
{
  hapi_spot clipped[HAPI_SPOTS_MAX];
  memset(clipped, 0, sizeof clipped);
  overlap o = {.polygon = spots, .corners = count, .radius = radius, .out = clipped};
  if (count == 1) {
    return spots[0].x * spots[0].x + spots[0].y * spots[0].y <= radius * radius ? 1 : 0;
  }
  o.left_at = -1;
  plane_of(&o);
  walk_edges(&o);
  if (o.count == 0 && polygon_holds_middle(&o)) {
    hapi_spot start = {.x = radius, .gap = o.gap + o.slope[0] * radius};
    overlap_push(&o, start);
    push_arc(&o, &start, 2.0 * pi * (1.0 - 1e-9));
  }
  for (int i = 0; i < o.count; ++i) {
    spots[i] = clipped[i];
  }
  return o.count;
}

int hapi_patch_clip(const hapi_feature *reference, const hapi_frame *frame, hapi_spot *spots,
                    int count)
{
  if (reference->disc > 0.0) {
    return clip_disc(reference->disc, spots, count);
  }
  return clip_polygon(reference, frame, spots, count);
}
