/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "base/assert.h"
#include "base/vec.h"
#include "proximity/direction.h"
#include "proximity/patch_parts.h"

/* From what lies over a reference to points of the patch: spots are clipped and reduced, then
 * added; edges are added where they cross. */

/* --- which spots are kept --------------------------------------------------------------------- */

/* Part of a height difference; a spot nearer than that beside a deeper one carries nothing: the
 * top corner of a plate over its bottom corner, up to a tilt of 6 degrees. */
static const double steep = 0.1;

static bool spot_covers(const hapi_spot *lower, const hapi_spot *upper, double near)
{
  double x = upper->x - lower->x;
  double y = upper->y - lower->y;
  double reach = near + steep * (upper->gap - lower->gap);
  return reach > 0.0 && x * x + y * y < reach * reach;
}

/* Of two spots in one place the deeper one, of equal ones the first one stays. */
static bool spot_is_covered(const hapi_spot *spots, int count, int i, double near)
{
  for (int k = 0; k < count; ++k) {
    bool lower = spots[k].gap < spots[i].gap || (k < i && spots[k].gap == spots[i].gap);
    if (lower && spot_covers(&spots[k], &spots[i], near)) {
      return true;
    }
  }
  return false;
}

/* A spot that is covered by a covered one is covered, nearly, by what covers that one. */
static int covered_remove(hapi_spot *spots, int count, double near)
{
  bool keep[HAPI_SPOTS_MAX];
  int kept = 0;
  for (int i = 0; i < count; ++i) {
    keep[i] = !spot_is_covered(spots, count, i, near);
  }
  for (int i = 0; i < count; ++i) {
    if (keep[i]) {
      spots[kept++] = spots[i];
    }
  }
  return kept;
}

static double triangle_area(const hapi_spot *a, const hapi_spot *b, const hapi_spot *c)
{
  return (b->x - a->x) * (c->y - a->y) - (b->y - a->y) * (c->x - a->x);
}

static double spot_distance2(const hapi_spot *a, const hapi_spot *b)
{
  return (b->x - a->x) * (b->x - a->x) + (b->y - a->y) * (b->y - a->y);
}

/* Area that a fourth spot adds to the triangle of the first three. */
static double area_added(const hapi_spot *s, const hapi_spot *p)
{
  double sign = triangle_area(&s[0], &s[1], &s[2]) < 0.0 ? -1.0 : 1.0;
  double added =
      fmax(-sign * triangle_area(&s[0], &s[1], p), -sign * triangle_area(&s[1], &s[2], p));
  return fmax(added, -sign * triangle_area(&s[2], &s[0], p));
}

/* How much the spot is wanted in a place of the four. */
static double spot_worth(const hapi_spot *s, int place, const hapi_spot *p)
{
  switch (place) {
    case 0:
      return -p->gap;
    case 1:
      return spot_distance2(&s[0], p);
    case 2:
      return fabs(triangle_area(&s[0], &s[1], p));
    default:
      return area_added(s, p);
  }
}

/* Spots of equal worth but for rounding keep their order, or the choice would jump between calls.
 */
static void spot_choose(hapi_spot *spots, int place, int count, double slack)
{
  int best = place;
  for (int i = place + 1; i < count; ++i) {
    if (spot_worth(spots, place, &spots[i]) > spot_worth(spots, place, &spots[best]) + slack) {
      best = i;
    }
  }
  hapi_spot kept = spots[place];
  spots[place] = spots[best];
  spots[best] = kept;
}

/* Twice the area that four spots span, in the order in which they were chosen. */
static double area_spanned(const hapi_spot *s)
{
  return fabs(triangle_area(&s[0], &s[1], &s[2])) + fmax(0.0, area_added(s, &s[3]));
}

/* Four of more, the first one being given; the area that they span. */
static double spots_choose(hapi_spot *spots, int count, double near)
{
  for (int place = 1; place < HAPI_PATCH_POINTS; ++place) {
    spot_choose(spots, place, count, near * near);
  }
  return area_spanned(spots);
}

/* Part of an area; another choice that spans less than so much more is no better. */
static const double wider = 0.05;

/* Where edges of two faces lie over each other they cross half way. That crossing is as deep as the
 * corners on both sides, and would take the place of one of them: so each of the deepest spots is
 * tried as the first one. */
static void spots_choose_widest(hapi_spot *spots, int count, double near)
{
  hapi_spot first[HAPI_SPOTS_MAX];
  double deepest = spots[0].gap + near;
  memcpy(first, spots, (size_t)count * sizeof *first);
  double area = spots_choose(spots, count, near);
  for (int i = 1; i < count; ++i) {
    hapi_spot tried[HAPI_SPOTS_MAX];
    if (first[i].gap > deepest) {
      continue;
    }
    memcpy(tried, first, (size_t)count * sizeof *tried);
    tried[0] = first[i];
    tried[i] = first[0];
    double spanned = spots_choose(tried, count, near);
    if (spanned > (1.0 + wider) * area) {
      area = spanned;
      memcpy(spots, tried, HAPI_PATCH_POINTS * sizeof *tried);
    }
  }
}

int hapi_patch_reduce(hapi_spot *spots, int count, double size)
{
  HAPI_ASSERT(count >= 0 && count <= HAPI_SPOTS_MAX && size >= 0.0);
  double near = 1e-6 * size;
  count = covered_remove(spots, count, near);
  if (count > 0) {
    spot_choose(spots, 0, count, near);
  }
  if (count <= HAPI_PATCH_POINTS) {
    return count;
  }
  spots_choose_widest(spots, count, near);
  return HAPI_PATCH_POINTS;
}

/* --- what is inside of the reference ---------------------------------------------------------- */

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
  if (count <= 1) {
    bool inside = count == 1 && hypot(spots[0].x, spots[0].y) <= radius;
    return inside ? 1 : 0;
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

/* Keeps what is inside of the reference face, which lies in the plane of the frame. */
static int spots_clip(const hapi_feature *reference, const hapi_frame *frame, hapi_spot *spots,
                      int count)
{
  if (reference->disc > 0.0) {
    return clip_disc(reference->disc, spots, count);
  }
  return clip_polygon(reference, frame, spots, count);
}

/* --- points ----------------------------------------------------------------------------------- */

static double gap_of(const hapi_pair *pair, const hapi_patch_point *p)
{
  double back[3];
  double lift_a[3];
  double lift_b[3];
  double between[3];
  hapi_v3_scale(-1.0, p->normal, back);
  hapi_surface_lift(pair->a, p->ball_a, p->rim_a, back, lift_a);
  hapi_surface_lift(pair->b, p->ball_b, p->rim_b, p->normal, lift_b);
  hapi_v3_sub(p->core_a, p->core_b, between);
  hapi_v3_add(between, lift_a, between);
  hapi_v3_sub(between, lift_b, between);
  return hapi_v3_dot(between, p->normal);
}

void hapi_patch_add(const hapi_pair *pair, const hapi_patch_point *point)
{
  HAPI_ASSERT_UNIT(point->normal);
  hapi_patch *patch = pair->out;
  HAPI_ASSERT(patch->count >= 0 && patch->count <= HAPI_PATCH_POINTS);
  double gap = gap_of(pair, point);
  if (!(gap <= pair->margin)) {
    return;
  }
  int place = patch->count;
  while (place > 0 && gap < patch->points[place - 1].gap) {
    --place;
  }
  if (place == HAPI_PATCH_POINTS) {
    return;
  }
  patch->count += patch->count < HAPI_PATCH_POINTS;
  for (int i = patch->count - 1; i > place; --i) {
    patch->points[i] = patch->points[i - 1];
  }
  patch->points[place] = *point;
  patch->points[place].gap = gap;
}

/* Field by field: clearing the point first takes as long as all the rest. */
static void face_point(hapi_patch_point *p, bool reference_is_a, const hapi_frame *frame,
                       const hapi_feature *incident, const hapi_spot *spot)
{
  double *fixed = reference_is_a ? p->core_a : p->core_b;
  double *pushed = reference_is_a ? p->core_b : p->core_a;
  p->touch = reference_is_a ? HAPI_TOUCH_FACE_A : HAPI_TOUCH_FACE_B;
  for (int i = 0; i < 3; ++i) {
    fixed[i] = frame->origin[i] + spot->x * frame->x[i] + spot->y * frame->y[i];
  }
  hapi_v3_madd(fixed, spot->gap, frame->normal, pushed);
  hapi_v3_sub(pushed, incident->lift, pushed);
  p->ball_a = reference_is_a ? 0.0 : incident->ball;
  p->ball_b = reference_is_a ? incident->ball : 0.0;
  p->rim_a = reference_is_a ? 0.0 : incident->rim;
  p->rim_b = reference_is_a ? incident->rim : 0.0;
  double *side = reference_is_a ? p->edge_a : p->edge_b;
  double *edge = reference_is_a ? p->edge_b : p->edge_a;
  p->slide = spot->slide;
  hapi_v3_set(side, 0.0, 0.0, 0.0);
  hapi_v3_set(edge, 0.0, 0.0, 0.0);
  if (spot->slide == HAPI_SLIDE_EDGE) {
    for (int i = 0; i < 3; ++i) {
      side[i] = spot->side[0] * frame->x[i] + spot->side[1] * frame->y[i];
      edge[i] = spot->edge[0] * frame->x[i] + spot->edge[1] * frame->y[i] +
                spot->edge[2] * frame->normal[i];
    }
  } else if (spot->slide == HAPI_SLIDE_CORNER) {
    hapi_v3_copy(incident->normal, edge);
  }
  hapi_v3_scale(reference_is_a ? -1.0 : 1.0, frame->normal, p->normal);
  p->gap = spot->gap;
}

void hapi_patch_add_spots(const hapi_pair *pair, bool reference_is_a, const hapi_frame *frame,
                          const hapi_feature *incident, hapi_spot *spots, int count)
{
  HAPI_ASSERT(count >= 0 && count <= HAPI_SPOTS_MAX);
  HAPI_ASSERT_UNIT(frame->normal);
  hapi_patch *patch = pair->out;
  int kept = 0;
  for (int i = 0; i < count; ++i) {
    if (spots[i].gap <= pair->margin) {
      spots[kept++] = spots[i];
    }
  }
  kept = hapi_patch_reduce(spots, kept, pair->size);
  for (int i = 0; i < kept && patch->count < HAPI_PATCH_POINTS; ++i) {
    face_point(&patch->points[patch->count++], reference_is_a, frame, incident, &spots[i]);
  }
}

bool hapi_patch_add_faces(const hapi_pair *pair, bool reference_is_a, const hapi_feature *reference,
                          const hapi_feature *incident)
{
  HAPI_ASSERT(reference->count >= 3 && reference->count <= HAPI_CORNERS_MAX);
  HAPI_ASSERT(incident->count >= 1 && incident->count <= HAPI_CORNERS_MAX);
  hapi_spot spots[HAPI_SPOTS_MAX];
  hapi_frame frame;
  int before = pair->out->count;
  hapi_v3_copy(reference->center, frame.origin);
  hapi_v3_copy(reference->normal, frame.normal);
  hapi_v3_sub(reference->corner[1], reference->corner[0], frame.x);
  hapi_v3_unit(frame.x, frame.x);
  hapi_v3_cross(frame.normal, frame.x, frame.y);
  for (int i = 0; i < incident->count; ++i) {
    double arm[3];
    hapi_v3_sub(incident->corner[i], frame.origin, arm);
    spots[i] = (hapi_spot){.x = hapi_v3_dot(arm, frame.x),
                           .y = hapi_v3_dot(arm, frame.y),
                           .gap = hapi_v3_dot(arm, frame.normal)};
  }
  int count = spots_clip(reference, &frame, spots, incident->count);
  hapi_patch_add_spots(pair, reference_is_a, &frame, incident, spots, count);
  return pair->out->count > before;
}

/* --- edges ------------------------------------------------------------------------------------ */

/* Sine of the angle below which two lines are side by side and not crossing: there the cross
 * product follows the bodies' rotations a hundred times too fast. */
static const double parallel = 0.01;

/* How far beyond its end, in parts of the smaller solid, an edge may be met. */
static const double beyond_end = 1e-6;

static void round_set(hapi_patch_point *p, const hapi_edge *a, const hapi_edge *b)
{
  p->ball_a = a->ball;
  p->ball_b = b->ball;
  p->rim_a = a->rim;
  p->rim_b = b->rim;
}

bool hapi_patch_add_edges(const hapi_pair *pair, const hapi_edge *a, const hapi_edge *b,
                          const double normal[3])
{
  HAPI_ASSERT_UNIT(a->direction);
  HAPI_ASSERT_UNIT(b->direction);
  hapi_patch_point p = {.touch = HAPI_TOUCH_EDGES};
  double along_a;
  double along_b;
  double slack = beyond_end * pair->size;
  hapi_v3_cross(a->direction, b->direction, p.normal);
  double sine = hapi_v3_unit(p.normal, p.normal);
  if (sine < parallel) {
    return false;
  }
  /* Where the lines come nearest, along each from its middle. sine: of their angle. */
  HAPI_ASSERT(sine > 0.0);
  double between[3];
  hapi_v3_sub(b->middle, a->middle, between);
  double cosine = hapi_v3_dot(a->direction, b->direction);
  double u = hapi_v3_dot(between, a->direction);
  double v = hapi_v3_dot(between, b->direction);
  along_a = (u - cosine * v) / (sine * sine);
  along_b = (cosine * u - v) / (sine * sine);
  if (fabs(along_a) > a->half + slack || fabs(along_b) > b->half + slack) {
    return false;
  }
  if (hapi_v3_dot(p.normal, normal) < 0.0) {
    hapi_v3_scale(-1.0, p.normal, p.normal);
  }
  hapi_v3_copy(a->direction, p.edge_a);
  hapi_v3_copy(b->direction, p.edge_b);
  hapi_v3_madd(a->middle, along_a, a->direction, p.core_a);
  hapi_v3_madd(b->middle, along_b, b->direction, p.core_b);
  round_set(&p, a, b);
  hapi_patch_add(pair, &p);
  return true;
}

bool hapi_patch_add_lines(const hapi_pair *pair, const hapi_edge *a, const hapi_edge *b,
                          const double normal[3])
{
  HAPI_ASSERT_UNIT(a->direction);
  HAPI_ASSERT_UNIT(b->direction);
  hapi_patch_point p = {.touch = HAPI_TOUCH_FACE_B};
  double between[3];
  hapi_v3_cross(a->direction, b->direction, between);
  if (hapi_v3_norm(between) >= parallel) {
    return false;
  }
  hapi_v3_sub(a->middle, b->middle, between);
  double shift = hapi_v3_dot(between, b->direction);
  double cosine = hapi_v3_dot(a->direction, b->direction);
  double low = fmax(-b->half, shift - a->half);
  double high = fmin(b->half, shift + a->half);
  double slack = beyond_end * pair->size;
  if (high < low - slack) {
    return false;
  }
  hapi_v3_madd(normal, -hapi_v3_dot(normal, b->direction), b->direction, p.normal);
  hapi_v3_unit(p.normal, p.normal);
  round_set(&p, a, b);
  for (int i = 0; i < 2; ++i) {
    double along = i == 0 ? low : high;
    hapi_v3_madd(b->middle, along, b->direction, p.core_b);
    hapi_v3_madd(a->middle, (along - shift) / cosine, a->direction, p.core_a);
    if (i == 0 || high - low > slack) {
      hapi_patch_add(pair, &p);
    }
  }
  return true;
}
