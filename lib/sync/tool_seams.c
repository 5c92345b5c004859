/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "sync/tool_seams.h"

#include <math.h>

#include "base/vec.h"
#include "sync/tool_side.h"

/* A step between two surfaces that is none: of the hull's extent, and m at most. */
#define STEP_SHARE 0.01
#define STEP_MOST 1e-4

#define ALIKE_COSINE 0.95 /* of normals: of one surface */
#define SAME_PLACE 1e-6   /* m, on the hull */

static double step_of(const hapi_tool_part *part)
{
  return fmin(STEP_SHARE * part->extent, STEP_MOST);
}

/* The way out of the geom [m]. */
static double part_way(const hapi_tool_seams *s, const hapi_tool_part *part, double out[3])
{
  hapi_v3_set(out, 0.0, 0.0, 0.0);
  for (uint32_t i = 0; i < HAPI_TOOL_WAY_ROUNDS * part->count; ++i) {
    const hapi_tool_mark *mark = &s->marks[part->first + i % part->count];
    hapi_tool_way_add(mark->normal, -mark->gap, out);
  }
  return hapi_v3_norm(out);
}

/* Some point of the part lies on the other one, and pushes another way than that does. */
static bool part_crosses(const hapi_tool_seams *s, uint32_t part, uint32_t by, const double way[3],
                         double length)
{
  const hapi_tool_part *p = &s->parts[part];
  for (uint32_t i = p->first; i < p->first + p->count; ++i) {
    const hapi_tool_mark *mark = &s->marks[i];
    if (hapi_v3_dot(mark->normal, way) < ALIKE_COSINE * length &&
        s->holds(s->of, by, mark->at, step_of(p))) {
      return true;
    }
  }
  return false;
}

/* A hull that the deeper one alone would hold does not touch the part, or hardly: then the part is
 * what such a hull meets. In an inner corner it is touched: both push. */
static void part_hold(hapi_tool_seams *s, uint32_t part)
{
  double own[3];
  double depth = part_way(s, &s->parts[part], own);
  for (uint32_t by = 0; by < s->count; ++by) {
    double way[3];
    double step = step_of(&s->parts[part]);
    if (by == part || s->parts[by].hull != s->parts[part].hull || s->parts[by].count == 0) {
      continue;
    }
    double length = part_way(s, &s->parts[by], way);
    if (length > depth && part_crosses(s, part, by, way, length) &&
        s->depth(s->of, part, way) < step) {
      hapi_v3_scale(1.0 + step / length, way, way);
      s->look(s->of, part, way);
      return;
    }
  }
}

/* NULL: the other part has no point that pushes the same way. */
static const hapi_tool_mark *mark_alike(const hapi_tool_seams *s, const hapi_tool_part *by,
                                        const hapi_tool_mark *mark)
{
  const hapi_tool_mark *best = NULL;
  double least = HUGE_VAL;
  for (uint32_t i = by->first; i < by->first + by->count; ++i) {
    double apart[3];
    hapi_v3_sub(s->marks[i].place, mark->place, apart);
    double distance = hapi_v3_norm(apart);
    if (distance < least && hapi_v3_dot(s->marks[i].normal, mark->normal) > ALIKE_COSINE) {
      least = distance;
      best = &s->marks[i];
    }
  }
  return best;
}

/* Of two parts that have the same point, the deeper one keeps it; of such as are as deep always the
 * same one. */
static bool keeps_point(const hapi_tool_part *a, const hapi_tool_mark *in_a,
                        const hapi_tool_part *b, const hapi_tool_mark *in_b)
{
  double deeper = in_b->gap - in_a->gap;
  return fabs(deeper) > SAME_PLACE ? deeper > 0.0 : a->key < b->key;
}

static void parts_link(hapi_tool_seams *s, uint32_t a, uint32_t b)
{
  uint64_t one = s->parts[a].group;
  uint64_t other = s->parts[b].group;
  for (uint32_t i = 0; i < s->count && one != other; ++i) {
    if (s->parts[i].hull == s->parts[a].hull && s->parts[i].group == other) {
      s->parts[i].group = one;
    }
  }
}

/* Of the part's points, those that lie on another one, too. */
static void part_join(hapi_tool_seams *s, uint32_t part, uint32_t by)
{
  const hapi_tool_part *p = &s->parts[part];
  const hapi_tool_part *other = &s->parts[by];
  for (uint32_t i = p->first; i < p->first + p->count; ++i) {
    hapi_tool_mark *mark = &s->marks[i];
    const hapi_tool_mark *alike = mark_alike(s, other, mark);
    if (alike == NULL || !s->holds(s->of, by, mark->at, step_of(p))) {
      continue;
    }
    double apart[3];
    hapi_v3_sub(alike->place, mark->place, apart);
    bool twice = hapi_v3_norm(apart) < SAME_PLACE;
    mark->dropped |= twice ? keeps_point(other, alike, p, mark) : mark->border;
    parts_link(s, part, by);
  }
}

void hapi_tool_seams_join(hapi_tool_seams *s)
{
  for (uint32_t i = 0; i < s->count; ++i) {
    s->parts[i].group = s->parts[i].key;
  }
  for (uint32_t i = 0; i < s->count && s->count > 1; ++i) {
    part_hold(s, i);
  }
  for (uint32_t i = 0; i < s->count; ++i) {
    for (uint32_t k = 0; k < s->count; ++k) {
      if (k != i && s->parts[k].hull == s->parts[i].hull) {
        part_join(s, i, k);
      }
    }
  }
}
