/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PROXIMITY_PATCH_PARTS_H
#define HAPODE_PROXIMITY_PATCH_PARTS_H

/* What the patch files share. All coordinates are relative to the origin of the solids. Solids are
 * convex; "along d" means: what a plane that comes from far along d meets first. */

#include "proximity/gjk.h"
#include "proximity/patch.h"

enum {
  HAPI_CORNERS_MAX = 32,
  HAPI_SPOTS_MAX = 3 * HAPI_CORNERS_MAX
};

/* --- pieces of a surface ---------------------------------------------------------------------- */

/* A face, a line on a surface or a corner. */
typedef struct hapi_feature {
  int count;                          /* 1: corner, 2: line, more: face, counter-clockwise */
  double corner[HAPI_CORNERS_MAX][3]; /* m, on the surface */
  double center[3];                   /* m, of a face */
  double normal[3];                   /* unit, outward; faces only */
  double area;                        /* m2 */
  double disc;                        /* m, of a round face, whose corners are on the rim; else 0 */
  double lift[3];                     /* m, from the core to the surface */
  double ball;                        /* m, as in hapi_patch_point */
  double rim;
} hapi_feature;

/* The face whose normal is most along d. False: there is none (point, capsule, needle). */
bool hapi_feature_face(const hapi_solid *solid, const double d[3], hapi_feature *out);

/* Face, line or corner that is most along d. Not for planes. */
void hapi_feature_along(const hapi_solid *solid, const double d[3], hapi_feature *out);

/* A straight edge or axis. */
typedef struct hapi_edge {
  double middle[3]; /* m, of the core */
  double direction[3];
  double half; /* m */
  double ball; /* m, as in hapi_patch_point */
  double rim;
} hapi_edge;

/* The edge that is square to d, among those farthest along d. False: there is none. */
bool hapi_feature_edge(const hapi_solid *solid, const double d[3], hapi_edge *out);

/* Points on a rim of a cylinder (side 1 or -1), the first one farthest along d. */
void hapi_rim_corners(const hapi_solid *cylinder, double side, const double d[3], int count,
                      double (*out)[3]);

/* From core to surface: ball x dir + rim x unit(part of dir across the axis of the solid). */
void hapi_surface_lift(const hapi_solid *solid, double ball, double rim, const double dir[3],
                       double out[3]);

/* --- points seen along a normal --------------------------------------------------------------- */

typedef struct hapi_spot {
  double x; /* m */
  double y;
  double gap; /* m, height over the reference */
  hapi_slide slide;
  double edge[3]; /* unit, in the frame: of the incident feature, HAPI_SLIDE_EDGE */
  double side[2]; /* unit, in the frame: out of the reference face, HAPI_SLIDE_EDGE */
} hapi_spot;

typedef struct hapi_frame {
  double origin[3];
  double x[3];
  double y[3];
  double normal[3]; /* out of the reference */
} hapi_frame;

/* Drops repeated spots and those that stand over a deeper one, and all but four. Deepest first. */
int hapi_patch_reduce(hapi_spot *spots, int count, double size);

/* --- patches ---------------------------------------------------------------------------------- */

typedef struct hapi_pair {
  const hapi_solid *a;
  const hapi_solid *b;
  double margin; /* m */
  double size;   /* m, of the smaller solid */
  hapi_patch *out;
} hapi_pair;

/* Reduces the spots, which are on the feature of one solid, and adds them as FACE points; the
 * reference is a plane on the other one. */
void hapi_patch_add_spots(const hapi_pair *pair, bool reference_is_a, const hapi_frame *frame,
                          const hapi_feature *incident, hapi_spot *spots, int count);

/* Adds the overlap of two features seen along the normal of the reference. False: there is none
 * within the margin. */
bool hapi_patch_add_faces(const hapi_pair *pair, bool reference_is_a, const hapi_feature *reference,
                          const hapi_feature *incident);

/* Adds the point of two edges that cross, where they do. normal: b to a, tells the side. */
bool hapi_patch_add_edges(const hapi_pair *pair, const hapi_edge *a, const hapi_edge *b,
                          const double normal[3]);

/* Adds the ends of the overlap of two lines side by side, of which at least one is round. */
bool hapi_patch_add_lines(const hapi_pair *pair, const hapi_edge *a, const hapi_edge *b,
                          const double normal[3]);

/* Adds a point if its gap is within the margin; sets the gap from the other fields. A full patch
 * loses its highest point. */
void hapi_patch_add(const hapi_pair *pair, const hapi_patch_point *point);

/* Each handles some kinds; false: no answer. */
bool hapi_patch_boxes(const hapi_pair *pair);
bool hapi_patch_plane(const hapi_pair *pair);   /* one is a plane */
bool hapi_patch_sphere(const hapi_pair *pair);  /* a is a sphere */
bool hapi_patch_general(const hapi_pair *pair); /* no sphere, no plane */

/* Adds the ends of the capsules of the pair as balls, in place of what is there already. Against a
 * hull it does nothing. */
void hapi_patch_add_ends(const hapi_pair *pair);

/* The best of the directions in which simple contacts have their normal: sets normal and distance,
 * the separation of the cores along it. False: so deep that it may be on a wrong side. */
bool hapi_patch_guess(const hapi_solid *a, const hapi_solid *b, hapi_gjk *out);

/* Nearest points of the cores and the normal; the distance is negative when they meet. start: a
 * guess. */
bool hapi_patch_axis(const hapi_solid *a, const hapi_solid *b, const hapi_gjk *start,
                     hapi_gjk *out);

#endif
