/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "local/contact_rows.h"

#include <math.h>
#include <string.h>

#include "base/assert.h"
#include "local/body_stay.h"
#include "local/body_step.h"
#include "local/body_still.h"
#include "local/contact_run.h"
#include "local/touch_place.h"

/* Contacts between bodies as rows of the solver. A contact is placed anew from the poses of its
 * bodies, and while both stay, and hardly move against each other, its rows stay as well: only the
 * gap follows, along the Jacobian of the normal's row. What a row asks for is what the world's own
 * contact joints would ask for (ODE's contact constraint), at the step of the tick. */

/* 84 degrees of slope. More than that may push without bound along a contact that hardly touches:
 * where a large island is not solved to the end within a tick, what lets go then gives energy. */
#define MU_MOST 10.0
#define PUSH_OUT_MAX 0.2    /* m/s */
#define PUSH_OUT_SLOP 1e-6  /* m, depth that is left alone */
#define PUSH_OUT_LEAST 2e-4 /* m/s: less may stay in the velocity, it is not worth a second solve */
#define LEAVE_FLOOR \
  2e-3 /* m: one that has rows keeps them so far, or all behind them would change
                               their places with each contact that opens and closes */

typedef struct placed_contact {
  uint32_t index;
  const hapi_patch_contact *in;
  const hapi_surface *surface;
  hapi_local_body *a;
  hapi_local_body *b;
  double normal[3]; /* from b to a */
  double point[3];  /* between the surfaces */
  double gap;
  double slope[3];
  bool follows; /* this and slope: see hapi_touch_spot */
  bool gives;   /* see hapi_row_source */
} placed_contact;

static hapi_touch_frame frame_of(const hapi_local_body *body)
{
  return body != NULL ? (hapi_touch_frame){&body->pose, body->rotation}
                      : (hapi_touch_frame){NULL, NULL};
}

static bool contact_place(placed_contact *c)
{
  hapi_touch_spot spot;
  hapi_touch_frame a = frame_of(c->a);
  hapi_touch_frame b = frame_of(c->b);
  if (!hapi_touch_place(c->in, &a, &b, &spot)) {
    return false;
  }
  hapi_v3_copy(spot.normal, c->normal);
  hapi_v3_copy(spot.point, c->point);
  c->gap = spot.gap;
  hapi_v3_copy(spot.slope, c->slope);
  c->follows = spot.follows;
  return true;
}

/* Two directions across the normal, as ODE takes them: its friction pyramid stands on them. */
static void friction_directions(const hapi_surface *surface, const double n[3], double t1[3],
                                double t2[3])
{
  if ((surface->flags & HAPI_SURFACE_FDIR1) != 0) {
    hapi_v3_madd(surface->direction, -hapi_v3_dot(surface->direction, n), n, t1);
    double length = hapi_v3_norm(t1);
    if (length > 1e-6) {
      hapi_v3_scale(1.0 / length, t1, t1);
      hapi_v3_cross(n, t1, t2);
      return;
    }
  }
  if (fabs(n[2]) > 0.70710678118654752440) { /* dPlaneSpace: t1 in the y-z plane ... */
    double k = 1.0 / sqrt(n[1] * n[1] + n[2] * n[2]);
    hapi_v3_set(t1, 0.0, -n[2] * k, n[1] * k);
  } else { /* ... or in the x-y plane */
    double k = 1.0 / sqrt(n[0] * n[0] + n[1] * n[1]);
    hapi_v3_set(t1, -n[1] * k, n[0] * k, 0.0);
  }
  hapi_v3_cross(n, t1, t2);
}

/* See hapi_row_source: what the energy observer has to count as the world's work. */
static bool contact_gives(const placed_contact *c)
{
  const hapi_surface *s = c->surface;
  bool moves = s->motion[0] != 0.0 || s->motion[1] != 0.0 || s->motion[2] != 0.0;
  return moves || (s->flags & HAPI_SURFACE_SOFT) != 0 || hapi_body_is_given(c->a) ||
         hapi_body_is_given(c->b);
}

/* The columns of a body in the rows of a contact, `side` 0: ja and ba, 1: jb and bb. */
static inline double *column_of(hapi_row *row, int side, int response)
{
  return side == 0 ? (response == 0 ? row->ja : row->ba) : (response == 0 ? row->jb : row->bb);
}

/* The same of a body that answers by its mass, which most do. */
static inline void free_column(const hapi_local_body *body, const double j[6], double b[6])
{
  hapi_v3_scale(body->inverse_mass, j, b);
  hapi_body_spin_up(body, j + 3, b + 3);
}

static inline void set_columns(const placed_contact *c, int side, double directions[3][3],
                               hapi_row *rows, uint32_t count)
{
  const hapi_local_body *body = side == 0 ? c->a : c->b;
  double arm[3];
  if (body == NULL) {
    for (uint32_t i = 0; i < count; ++i) {
      memset(column_of(&rows[i], side, 0), 0, sizeof rows->ja);
      memset(column_of(&rows[i], side, 1), 0, sizeof rows->ba);
    }
    return;
  }
  bool is_free = hapi_body_responds(body) && (body->flags & HAPI_BODY_MEASURED) == 0;
  hapi_body_arm(body, c->point, arm);
  for (uint32_t i = 0; i < count; ++i) {
    double *j = column_of(&rows[i], side, 0);
    double *b = column_of(&rows[i], side, 1);
    hapi_v3_scale(side == 0 ? 1.0 : -1.0, directions[i], j);
    hapi_v3_cross(arm, j, j + 3);
    if (is_free) {
      free_column(body, j, b);
    } else {
      hapi_row_response(body, j, b);
    }
  }
}

/* What the rows of a contact have in common; their parts, 0 normal, 1 and 2 friction. */
static void begin_rows(hapi_rows *rows, const placed_contact *c, const hapi_contact_memory *memory,
                       const uint8_t *parts, uint32_t count)
{
  const hapi_row_source source = {
      .contact = c->index, .body_a = c->in->body_a, .body_b = c->in->body_b, .gives = c->gives};
  uint32_t first = rows->solver.row_count;
  uint32_t a = c->a != NULL ? c->a->row : HAPI_STATIC_ROW;
  uint32_t b = c->b != NULL ? c->b->row : HAPI_STATIC_ROW;
  for (uint32_t i = 0; i < count; ++i) {
    hapi_row *row = &rows->solver.rows[first + i];
    row->ball = row->round = 0;
    row->single = c->b == NULL;
    row->a = a;
    row->b = b;
    row->mu = 0.0;
    row->normal = -1;
    row->impulse = memory->impulse[parts[i]];
    rows->sources[first + i] = source;
    rows->sources[first + i].part = parts[i];
  }
  rows->sources[first].count = (uint8_t)count;
}

/* m/s along the normal before the tick; negative: they come nearer. */
static double contact_closing(const placed_contact *c, const hapi_row *row)
{
  return hapi_row_start_speed(c->a, row->ja) + hapi_row_start_speed(c->b, row->jb);
}

/* What comes in faster than the threshold goes back with its share. */
static void contact_bounce(const placed_contact *c, double period, hapi_row *row,
                           hapi_row_source *source)
{
  const hapi_surface *s = c->surface;
  double speed = contact_closing(c, row);
  bool hits = c->gap + period * speed < 0.0;
  if ((s->flags & HAPI_SURFACE_BOUNCE) != 0 && hits && -speed > s->bounce_speed) {
    row->target = hapi_max(-s->bounce * speed + s->motion[2], row->target);
    source->pushes_out = false;
  }
}

/* Open: the gap may close within the tick, not more. Touching: apart, with the push-out of what is
 * deeper than the surface layer. */
static void set_normal(const hapi_tick_facts *facts, const placed_contact *c, hapi_row *row,
                       hapi_row_source *source, hapi_effect_sample *sample)
{
  const hapi_surface *s = c->surface;
  double deep = -c->gap - s->layer - PUSH_OUT_SLOP;
  bool soft = (s->flags & HAPI_SURFACE_SOFT) != 0;
  row->lo = 0.0;
  row->hi = HUGE_VAL;
  row->softness = s->cfm / facts->period;
  row->target = c->gap > 0.0 ? -c->gap / facts->period : s->motion[2];
  if (deep > 0.0) {
    double push = hapi_min(s->erp * deep / facts->period, s->max_push);
    push = soft ? push : hapi_min(push, PUSH_OUT_MAX);
    row->target += push;
    source->pushes_out = !soft && push > PUSH_OUT_LEAST;
  }
  if (facts->bounces) {
    uint64_t begin = hapi_effect_begin(sample);
    contact_bounce(c, facts->period, row, source);
    hapi_effect_end(sample, HAP_EFFECT_RESTITUTION, begin);
  }
}

static void set_friction(double period, const hapi_surface *s, hapi_row *row, int part,
                         int32_t normal)
{
  double mu = part == 1 ? s->mu : s->mu2;
  bool share = (s->flags & (part == 1 ? HAPI_SURFACE_APPROX1_1 : HAPI_SURFACE_APPROX1_2)) != 0;
  bool slips = (s->flags & (part == 1 ? HAPI_SURFACE_SLIP1 : HAPI_SURFACE_SLIP2)) != 0;
  row->target = s->motion[part - 1];
  row->softness = (slips ? s->slip[part - 1] : s->cfm) / period;
  row->normal = share ? normal : -1;
  row->mu = share ? hapi_min(mu, MU_MOST) : 0.0;
  row->hi = share ? 0.0 : mu * period; /* without Approx1 mu is a force */
  row->lo = -row->hi;
}

/* The parts of a contact that have rows. With Approx1 friction is bounded by the normal impulse; a
 * force mu is there from the touch on. */
static uint32_t list_parts(const placed_contact *c, const hapi_contact_memory *memory,
                           uint8_t parts[3])
{
  const hapi_surface *s = c->surface;
  bool touches = memory->impulse[0] > 0.0 || c->gap <= 0.0;
  uint32_t count = 1;
  parts[0] = 0;
  if (s->mu > 0.0 && (touches || (s->flags & HAPI_SURFACE_APPROX1_1) != 0)) {
    parts[count++] = 1;
  }
  if (s->mu2 > 0.0 && (touches || (s->flags & HAPI_SURFACE_APPROX1_2) != 0)) {
    parts[count++] = 2;
  }
  return count;
}

static bool answers_by_mass(const hapi_local_body *body)
{
  return body == NULL || (body->flags & HAPI_BODY_MEASURED) == 0;
}

/* Of a contact that is ready. */
static void note_lifted(hapi_rows *rows, uint32_t first)
{
  const hapi_solver *solver = &rows->solver;
  if (rows->sources[first].pushes_out) {
    bool packable = solver->rows[first].triple == HAPI_TRIPLE_BY_MASS;
    HAPI_ASSERT_INDEX(rows->lifted_count, rows->capacity);
    rows->lifted[rows->lifted_count++] =
        (hapi_row_lifted){first, packable ? solver->packs.known.ready - 1 : HAPI_NO_PACKABLE};
  }
}

static void add_contact(hapi_rows *rows, placed_contact *c, const hapi_contact_memory *memory,
                        const hapi_tick_facts *facts, hapi_effect_sample *sample)
{
  hapi_solver *solver = &rows->solver;
  uint32_t first = solver->row_count;
  hapi_row *own = &solver->rows[first];
  double directions[3][3];
  uint8_t parts[3];
  uint32_t count = list_parts(c, memory, parts);
  HAPI_ASSERT_UNIT(c->normal);
  HAPI_ASSERT(first + count <= rows->capacity);
  c->gives = contact_gives(c);
  hapi_v3_copy(c->normal, directions[0]);
  friction_directions(c->surface, c->normal, directions[1], directions[2]);
  if (count == 2 && parts[1] == 2) {
    hapi_v3_copy(directions[2], directions[1]);
  }
  begin_rows(rows, c, memory, parts, count);
  set_columns(c, 0, directions, own, count);
  set_columns(c, 1, directions, own, count);
  set_normal(facts, c, &own[0], &rows->sources[first], sample);
  for (uint32_t i = 1; i < count; ++i) {
    set_friction(facts->period, c->surface, &own[i], parts[i], (int32_t)first);
  }
  solver->row_count += count;
  hapi_contact_ready(solver, first, count, answers_by_mass(c->a) && answers_by_mass(c->b));
  note_lifted(rows, first);
}

/* A body that the contact was made for, and that is where the contact thread thought it was. */
static bool find_body(const hapi_bodies *bodies, uint32_t slot, uint32_t generation,
                      hapi_local_body **out)
{
  *out = hapi_bodies_at(bodies, slot);
  return *out == NULL || ((*out)->live && (*out)->generation == generation && !(*out)->waiting);
}

static double point_speed(const hapi_local_body *body, const double point[3])
{
  if (body == NULL) {
    return 0.0;
  }
  double arm[3];
  double velocity[3];
  hapi_v3_sub(point, body->pose.position, arm);
  hapi_v3_cross(body->start_twist + 3, arm, velocity);
  hapi_v3_add(velocity, body->start_twist, velocity);
  return hapi_v3_norm(velocity);
}

static bool is_near(const placed_contact *c, double floor, double period)
{
  if (c->gap <= floor) {
    return true;
  }
  double speed = point_speed(c->a, c->point) + point_speed(c->b, c->point);
  return c->gap <= floor + HAPI_OPEN_TICKS * period * speed;
}

/* m/s along the normal, before the tick; negative: they come nearer. */
static double contact_approach(const placed_contact *c)
{
  double speed = 0.0;
  const hapi_local_body *bodies[2] = {c->a, c->b};
  for (int i = 0; i < 2; ++i) {
    if (bodies[i] != NULL) {
      double j[6];
      double b[6];
      double arm[3];
      hapi_body_arm(bodies[i], c->point, arm);
      hapi_row_column(bodies[i], arm, c->normal, i == 0 ? 1.0 : -1.0, j, b);
      speed += hapi_row_start_speed(bodies[i], j);
    }
  }
  return speed;
}

/* The contact of that index; false: not one of this tick. */
static bool find_contact(const hapi_body_contacts *contacts, const hapi_bodies *bodies,
                         uint32_t index, placed_contact *out)
{
  hapi_patches *patches = contacts->patches;
  out->index = index;
  HAPI_ASSERT_INDEX(index, patches->contact_count);
  out->in = &hapi_patches_contacts(patches)[index];
  out->surface = &hapi_patches_surfaces(patches)[out->in->surface];
  bool has_a = find_body(bodies, out->in->body_a, out->in->generation_a, &out->a);
  bool has_b = find_body(bodies, out->in->body_b, out->in->generation_b, &out->b);
  return has_a && has_b && (hapi_body_responds(out->a) || hapi_body_responds(out->b)) &&
         (hapi_body_is_owned(out->a) || hapi_body_is_owned(out->b)); /* others are ODE's affair */
}

/* As in ODE. Before any row: a body has all of its contacts, the floor's as well, from the tick on
 * in which it wakes. */
void hapi_contact_wake(const hapi_body_contacts *contacts, const hapi_bodies *bodies,
                       hapi_rows *rows, double period)
{
  const hapi_patches *patches = contacts->patches;
  for (uint32_t i = 0; patches != NULL && i < patches->contact_count; ++i) {
    placed_contact c;
    if (find_contact(contacts, bodies, i, &c) && (hapi_body_rests(c.a) || hapi_body_rests(c.b)) &&
        contact_place(&c) && c.gap + period * contact_approach(&c) <= 0.0) {
      hapi_body_wake(hapi_body_rests(c.a) ? c.a : c.b, rows, period);
    }
  }
}

/* ---- what is kept ---- */

/* m, twice what the gap of a kept contact may be off by where a body is slow (touch_place.c). The
 * gap counts as so much wider. So what rests is never lifted out of the touch that the world's
 * collision sees, and is still held there when the loop gives it back. */
#define FOLLOW_MARGIN 2e-9

/* Less of a slope is left out: over the way of body_stay.h it is 2e-8 m, and 2e-10 where that is
 * short. */
#define SLOPE_LEAST 2e-4

/* m, more than the gap of a contact without rows is off by: a touch that slides has a slope of 0.2
 * at most, over the way of both bodies against each other. */
#define APART_SLACK 2e-4
#define APART_WAY 5e-4 /* m: half of the slack at that slope; of what turns, a thousandth of it */

static double reach_of(const hapi_local_body *body, const double point[3])
{
  double arm[3];
  if (body == NULL) {
    return 0.0;
  }
  hapi_body_arm(body, point, arm);
  return fabs(arm[0]) + fabs(arm[1]) + fabs(arm[2]);
}

/* Of a force along the normal, about the body's centre. */
static void moment_of(const hapi_local_body *body, const double point[3], double sign,
                      const double normal[3], double out[3])
{
  double arm[3];
  hapi_v3_set(out, 0.0, 0.0, 0.0);
  if (body != NULL) {
    hapi_body_arm(body, point, arm);
    hapi_v3_cross(arm, normal, out);
    hapi_v3_scale(sign, out, out);
  }
}

/* m: how much farther the bodies of a kept contact have gone from each other along the normal since
 * their stays began. */
static double normal_grown(const hapi_contact_kept *kept, const hapi_pair_stays *stays)
{
  return hapi_v3_dot(kept->normal, stays->apart) + hapi_v3_dot(kept->turn_a, stays->a->moved + 3) +
         hapi_v3_dot(kept->turn_b, stays->b->moved + 3);
}

/* Whether both bodies stay, and are near enough to where they were against each other. */
static bool kept_holds(const hapi_contact_kept *kept, const hapi_pair_stays *stays)
{
  double way[3];
  hapi_v3_sub(stays->apart, kept->apart, way);
  return stays->a->number == kept->stay_a && stays->b->number == kept->stay_b &&
         hapi_v3_dot(way, way) <= hapi_kept_way2(kept, stays);
}

/* m: how much wider the gap of kept rows has become. rows: looked at only where the contact slides
 * over a slope. */
static double gap_grown(const hapi_contact_kept *kept, const hapi_row *rows,
                        const hapi_pair_stays *stays)
{
  double grown = normal_grown(kept, stays);
  for (int i = 0; kept->slides && i < 2; ++i) {
    const hapi_row *row = &rows[1 + i];
    grown += kept->slope[i] * (hapi_stay_moved(stays->a, row->ja, row->ja + 3) +
                               hapi_stay_moved(stays->b, row->jb, row->jb + 3));
  }
  return grown;
}

/* False: the directions of the frictions are not there. */
static bool keep_slope(const placed_contact *c, const hapi_row *rows, hapi_contact_kept *out)
{
  out->slides = hapi_v3_dot(c->slope, c->slope) > SLOPE_LEAST * SLOPE_LEAST;
  for (int i = 0; out->slides && out->count == 3 && i < 2; ++i) {
    out->slope[i] = c->a != NULL ? hapi_v3_dot(c->slope, rows[1 + i].ja)
                                 : -hapi_v3_dot(c->slope, rows[1 + i].jb);
  }
  return !out->slides || out->count == 3;
}

/* A corner or an edge on a face. The point of crossing edges goes farther than their bodies. */
static bool is_flat(const hapi_patch_contact *in)
{
  return (in->touch == HAPI_TOUCH_FACE_A || in->touch == HAPI_TOUCH_FACE_B) && in->ball_a == 0.0 &&
         in->ball_b == 0.0 && in->rim_a == 0.0 && in->rim_b == 0.0;
}

/* m: how far the bodies may go against each other. What is fixed on a body may slide over a face of
 * the static world as far as it likes, as nothing of its rows changes. Without rows there is only
 * the gap: of faces and edges it has no second derivative, and a slope is within the slack. */
static double contact_way(const placed_contact *c, uint8_t what)
{
  double way_a = c->a != NULL ? c->a->stay.most_way : HUGE_VAL;
  double way_b = c->b != NULL ? c->b->stay.most_way : HUGE_VAL;
  double way = hapi_min(way_a, way_b);
  bool on_static = (c->b == NULL && c->in->touch == HAPI_TOUCH_FACE_B) ||
                   (c->a == NULL && c->in->touch == HAPI_TOUCH_FACE_A);
  bool curved =
      c->in->ball_a > 0.0 || c->in->ball_b > 0.0 || c->in->rim_a > 0.0 || c->in->rim_b > 0.0;
  if (what == HAPI_KEPT_APART && !curved && way >= HAPI_STAY_WAY) {
    return APART_WAY;
  }
  if (!is_flat(c->in)) {
    return hapi_min(HAPI_STAY_WAY, way);
  }
  return on_static && c->in->slide == HAPI_SLIDE_NONE ? HUGE_VAL : way;
}

/* For the next tick. first: of its rows, if it has some. */
static void contact_keep(const hapi_rows *rows, const placed_contact *c, uint8_t what,
                         uint32_t first, hapi_contact_kept *out)
{
  const uint32_t approx = HAPI_SURFACE_APPROX1_1 | HAPI_SURFACE_APPROX1_2;
  hapi_pair_stays stays;
  hapi_pair_stays_find(c->a, c->b, &stays);
  out->what = HAPI_KEPT_NOTHING;
  out->stay_a = stays.a->number;
  out->stay_b = stays.b->number;
  if (out->stay_a == HAPI_STAY_UNKNOWN || out->stay_b == HAPI_STAY_UNKNOWN) {
    return;
  }
  out->what = what;
  hapi_v3_copy(stays.apart, out->apart);
  double way = contact_way(c, what);
  out->way2 = way * way;
  out->body_a = c->in->body_a;
  out->body_b = c->in->body_b;
  if (what == HAPI_KEPT_APART) {
    out->reach_a = reach_of(c->a, c->point);
    out->reach_b = reach_of(c->b, c->point);
    hapi_v3_copy(c->normal, out->normal);
    moment_of(c->a, c->point, 1.0, c->normal, out->turn_a);
    moment_of(c->b, c->point, -1.0, c->normal, out->turn_b);
    out->gap = c->gap - APART_SLACK - normal_grown(out, &stays);
  } else if (what == HAPI_KEPT_ROWS) {
    const hapi_row *normal = &rows->solver.rows[first];
    out->first = first;
    out->surface = c->in->surface;
    out->count = (uint8_t)(rows->solver.row_count - first);
    out->all = (c->surface->flags & approx) == approx;
    out->plain = false; /* what moves has rows made anew: the next tick has time to find out */
    for (uint32_t i = 0; i < out->count; ++i) {
      out->what = normal[i].inverse != 0.0 ? out->what : HAPI_KEPT_NOTHING;
    }
    out->what = keep_slope(c, normal, out) ? out->what : HAPI_KEPT_NOTHING;
    hapi_v3_copy(c->normal, out->normal);
    hapi_v3_copy(normal->ja + 3, out->turn_a);
    hapi_v3_copy(normal->jb + 3, out->turn_b);
    out->gap = FOLLOW_MARGIN + c->gap - gap_grown(out, normal, &stays);
  }
}

static bool still_apart(const hapi_contact_kept *kept, const hapi_pair_stays *stays, double period)
{
  double gap = kept->gap + normal_grown(kept, stays);
  return gap > HAPI_OPEN_FLOOR + hapi_pair_closing(stays, kept->reach_a, kept->reach_b, period);
}

/* Whether the gap that is kept of a contact without rows is no wider than the one that it has. */
static bool gap_is_no_wider(const hapi_body_contacts *contacts, const hapi_bodies *bodies,
                            uint32_t index, const hapi_pair_stays *stays)
{
  const hapi_contact_kept *kept = &contacts->memory[index].kept;
  placed_contact c;
  return !find_contact(contacts, bodies, index, &c) || !contact_place(&c) ||
         kept->gap + normal_grown(kept, stays) <= c.gap;
}

static bool impulses_finite(const hapi_contact_memory *memory)
{
  double sum = memory->impulse[0] + memory->impulse[1] + memory->impulse[2];
  return hapi_finite(&sum, 1);
}

/* Where the rows of the tick before are now. */
static uint32_t rows_place(const hapi_rows *rows, const hapi_contact_kept *kept)
{
  return kept->first + rows->before.up;
}

/* Whether they are still there. Rows of this tick so far may have been written over them, also such
 * as were taken back: a stop of a joint that is too far away. Then the first one is among those. */
static bool rows_stand(const hapi_rows *rows, const hapi_contact_kept *kept, uint32_t index)
{
  uint32_t at = rows_place(rows, kept);
  return at >= rows->solver.row_count && at >= rows->before.from &&
         at + kept->count <= rows->before.end && rows->sources[at].contact == index &&
         !rows->sources[at].joint && !rows->sources[at].pointer &&
         rows->sources[at].count == kept->count;
}

/* Where the rows of the first contact stand of those from that one on; before->end: none do. What
 * does not stand will not do so later in the tick, so that each contact is looked at once. */
static uint32_t next_standing(const hapi_body_contacts *contacts, uint32_t index, hapi_rows *rows)
{
  uint32_t i = index > rows->before.next ? index : rows->before.next;
  while (i < contacts->memory_count && (contacts->memory[i].kept.what != HAPI_KEPT_ROWS ||
                                        !rows_stand(rows, &contacts->memory[i].kept, i))) {
    ++i;
  }
  rows->before.next = i;
  return i < contacts->memory_count ? rows_place(rows, &contacts->memory[i].kept)
                                    : rows->before.end;
}

/* Where the rows of a contact would be written over those that other contacts go on with, these go
 * up, or all of them would have to be made anew. Each time by twice as much: where many come, the
 * next ones find room. */
static void rows_make_room(const hapi_body_contacts *contacts, uint32_t index, hapi_rows *rows)
{
  hapi_rows_before *before = &rows->before;
  uint32_t first = rows->solver.row_count;
  if (first >= before->end) {
    return;
  }
  uint32_t from = next_standing(contacts, index + 1, rows);
  uint32_t count = before->end - from;
  if (count == 0 || from - first >= HAPI_CONTACT_ROWS) {
    return;
  }
  uint32_t way = before->step - (from - first);
  if (before->end + way > rows->capacity) {
    return;
  }
  memmove(&rows->solver.rows[from + way], &rows->solver.rows[from],
          count * sizeof *rows->solver.rows);
  memmove(&rows->sources[from + way], &rows->sources[from], count * sizeof *rows->sources);
  before->end += way;
  before->up += way;
  before->from = from + way;
  before->step *= 2;
  before->moved += count;
}

/* Whether rows that stand are where they would come next and ask for what they asked for: then they
 * are not even looked at. */
static bool rows_stay(const hapi_rows *rows, const hapi_contact_kept *kept, double gap,
                      const hapi_tick_facts *facts)
{
  return kept->plain && !facts->bounces && rows->before.up == 0 &&
         kept->first == rows->solver.row_count && gap <= 0.0 && gap >= kept->least;
}

/* What rows_stay stands for. */
static bool rows_ask_alike(const hapi_rows *rows, const placed_contact *c,
                           const hapi_contact_kept *kept)
{
  const hapi_row *normal = &rows->solver.rows[kept->first];
  return -c->gap - c->surface->layer - PUSH_OUT_SLOP <= 0.0 &&
         normal->target == c->surface->motion[2] && normal->drive == normal->target &&
         !rows->sources[kept->first].pushes_out;
}

/* After the normal was set: whether rows_stay may take it for granted. */
static void rows_note_plain(const hapi_row *normal, const placed_contact *c,
                            const hapi_tick_facts *facts, hapi_contact_kept *out)
{
  out->least = -c->surface->layer - PUSH_OUT_SLOP;
  out->plain = normal->triple != 0 && (hapi_row_moves_b(normal) || normal->single) && out->all &&
               c->gap <= 0.0 && c->gap >= out->least && !facts->bounces;
  out->by_mass = normal->triple == HAPI_TRIPLE_BY_MASS;
}

/* The rows of the tick before again, at the place that comes next; false: they have to be made. */
static bool rows_go_on(hapi_rows *rows, placed_contact *c, hapi_contact_memory *memory,
                       const hapi_tick_facts *facts, hapi_effect_sample *sample)
{
  hapi_solver *solver = &rows->solver;
  hapi_contact_kept *kept = &memory->kept;
  uint32_t first = solver->row_count;
  uint32_t at = rows_place(rows, kept);
  uint32_t count = kept->count;
  uint8_t parts[3];
  HAPI_ASSERT(at + count <= rows->capacity);
  if (c->gap > LEAVE_FLOOR || (!kept->all && list_parts(c, memory, parts) != count)) {
    return false;
  }
  if (at > first) {
    memmove(&solver->rows[first], &solver->rows[at], count * sizeof *solver->rows);
    memmove(&rows->sources[first], &rows->sources[at], count * sizeof *rows->sources);
  }
  if (kept->first != first) {
    for (uint32_t i = 1; i < count; ++i) {
      hapi_row *row = &solver->rows[first + i];
      row->normal = row->normal < 0 ? -1 : (int32_t)first;
    }
    for (uint32_t i = 0; i < count; ++i) { /* those of packed rows are not in the rows */
      HAPI_ASSERT_INDEX(rows->sources[first + i].part, 3);
      solver->rows[first + i].impulse = memory->impulse[rows->sources[first + i].part];
    }
    kept->first = first;
    hapi_contact_moved(solver);
  }
  rows->sources[first].pushes_out = false;
  set_normal(facts, c, &solver->rows[first], &rows->sources[first], sample);
  rows_note_plain(&solver->rows[first], c, facts, kept);
  solver->row_count += count;
  rows->kept += count;
  hapi_contact_again(solver, first, count);
  note_lifted(rows, first);
  return true;
}

/* ---- runs: see contact_run.h ---- */

/* What a run stands for. */
static bool run_is_of_such(const hapi_body_contacts *contacts, uint32_t index,
                           const hapi_pair_stays *stays, const hapi_rows *rows,
                           const hapi_tick_facts *facts)
{
  const hapi_contact_run *run = &contacts->runs[index];
  uint32_t first = rows->solver.row_count;
  for (uint32_t i = index; i < index + contacts->run_lengths[index]; ++i) {
    const hapi_contact_kept *kept = &contacts->memory[i].kept;
    double gap = kept->gap + normal_grown(kept, stays);
    if (!kept_holds(kept, stays) || (i > index && contacts->run_lengths[i] > 0)) {
      return false;
    }
    if (kept->what == HAPI_KEPT_APART) {
      if (!still_apart(kept, stays, facts->period)) {
        return false;
      }
      continue;
    }
    if (kept->what != HAPI_KEPT_ROWS || !kept->plain || kept->slides || kept->first != first ||
        gap > 0.0 || gap < kept->least || !rows_stand(rows, kept, i) ||
        !impulses_finite(&contacts->memory[i])) {
      return false;
    }
    first += kept->count;
  }
  return first == rows->solver.row_count + run->rows;
}

static bool run_rows_stand(const hapi_contact_run *run, const hapi_local_body *a,
                           const hapi_local_body *b, const hapi_rows *rows,
                           const hapi_tick_facts *facts)
{
  const hapi_row_source *source = &rows->sources[run->first];
  bool still = (a == NULL || hapi_body_is_still(a)) && (b == NULL || hapi_body_is_still(b));
  return !still && !facts->bounces && rows->before.up == 0 &&
         run->first == rows->solver.row_count && run->first >= rows->before.from &&
         run->first + run->rows <= rows->before.end && source->contact == run->lead &&
         !source->joint && !source->pointer;
}

/* How many contacts from there on need not be looked at. */
static uint32_t run_goes_on(const hapi_body_contacts *contacts, const hapi_bodies *bodies,
                            uint32_t index, hapi_rows *rows, const hapi_tick_facts *facts)
{
  const hapi_contact_run *run = &contacts->runs[index];
  if (contacts->run_lengths[index] == 0) {
    return 0;
  }
  const hapi_local_body *a = hapi_bodies_at(bodies, run->body_a);
  const hapi_local_body *b = hapi_bodies_at(bodies, run->body_b);
  hapi_pair_stays stays;
  hapi_pair_stays_find(a, b, &stays);
  if (!hapi_run_holds(run, &stays, facts->period) ||
      (run->rows > 0 && !run_rows_stand(run, a, b, rows, facts))) {
    return 0;
  }
  HAPI_ASSERT(run_is_of_such(contacts, index, &stays, rows, facts));
  if (run->rows > 0) {
    rows->solver.row_count += run->rows;
    rows->kept += run->rows;
    hapi_contact_stands(&rows->solver, run->by_mass);
  }
  return contacts->run_lengths[index];
}

/* False: the contact has to be placed. */
static bool contact_goes_on(hapi_body_contacts *contacts, const hapi_bodies *bodies, uint32_t index,
                            hapi_rows *rows, const hapi_tick_facts *facts,
                            hapi_effect_sample *sample)
{
  hapi_contact_memory *memory = &contacts->memory[index];
  const hapi_contact_kept *kept = &memory->kept;
  if (kept->what == HAPI_KEPT_NOTHING) {
    return false;
  }
  placed_contact c;
  c.index = index;
  c.a = hapi_bodies_at(bodies, kept->body_a);
  c.b = hapi_bodies_at(bodies, kept->body_b);
  hapi_pair_stays stays;
  hapi_pair_stays_find(c.a, c.b, &stays);
  if (!kept_holds(kept, &stays)) {
    return false;
  }
  if (kept->what == HAPI_KEPT_IDLE) {
    hapi_run_close(contacts);
    return true;
  }
  if (kept->what == HAPI_KEPT_APART) {
    HAPI_ASSERT(gap_is_no_wider(contacts, bodies, index, &stays));
    if (!still_apart(kept, &stays, facts->period)) {
      return false;
    }
    hapi_run_add(contacts, index, &stays, kept->gap + normal_grown(kept, &stays));
    return true;
  }
  if (!rows_stand(rows, kept, index) || !impulses_finite(memory)) {
    return false;
  }
  c.surface = &hapi_patches_surfaces(contacts->patches)[kept->surface];
  uint32_t at = rows_place(rows, kept);
  c.gap = kept->gap + gap_grown(kept, &rows->solver.rows[at], &stays);
  if (rows_stay(rows, kept, c.gap, facts)) {
    HAPI_ASSERT(rows_ask_alike(rows, &c, kept));
    rows->solver.row_count += kept->count;
    rows->kept += kept->count;
    hapi_contact_stands(&rows->solver, kept->by_mass);
  } else if (!rows_go_on(rows, &c, memory, facts, sample)) {
    return false;
  }
  hapi_run_add(contacts, index, &stays, c.gap);
  return true;
}

static void contact_make(hapi_body_contacts *contacts, const hapi_bodies *bodies, uint32_t index,
                         hapi_rows *rows, const hapi_tick_facts *facts, hapi_effect_sample *sample)
{
  hapi_contact_memory *memory = &contacts->memory[index];
  uint32_t first = rows->solver.row_count;
  placed_contact c;
  bool had = memory->kept.what == HAPI_KEPT_ROWS;
  memory->kept.what = HAPI_KEPT_NOTHING;
  if (!find_contact(contacts, bodies, index, &c)) {
    contact_keep(rows, &c, HAPI_KEPT_IDLE, first, &memory->kept);
  } else if (first + HAPI_CONTACT_ROWS <= rows->capacity && contact_place(&c)) {
    bool near = is_near(&c, had ? LEAVE_FLOOR : HAPI_OPEN_FLOOR, facts->period);
    if (near) {
      rows_make_room(contacts, index, rows);
      add_contact(rows, &c, memory, facts, sample);
    }
    if (c.follows) {
      contact_keep(rows, &c, near ? HAPI_KEPT_ROWS : HAPI_KEPT_APART, first, &memory->kept);
    }
  }
  if (rows->solver.row_count == first) {
    memset(memory->impulse, 0, sizeof memory->impulse);
  }
}

bool hapi_contact_is_near(const hapi_body_contacts *contacts, const hapi_bodies *bodies,
                          uint32_t index, const hapi_tick_facts *facts)
{
  const hapi_contact_kept *kept = &contacts->memory[index].kept;
  placed_contact c;
  if (kept->what != HAPI_KEPT_NOTHING) {
    const hapi_local_body *a = hapi_bodies_at(bodies, kept->body_a);
    const hapi_local_body *b = hapi_bodies_at(bodies, kept->body_b);
    hapi_pair_stays stays;
    hapi_pair_stays_find(a, b, &stays);
    if (kept_holds(kept, &stays) && (kept->what == HAPI_KEPT_IDLE || kept->what == HAPI_KEPT_ROWS ||
                                     still_apart(kept, &stays, facts->period))) {
      return kept->what == HAPI_KEPT_ROWS;
    }
  }
  return find_contact(contacts, bodies, index, &c) && contact_place(&c) &&
         is_near(&c, HAPI_OPEN_FLOOR, facts->period);
}

/* Those of islands that are still have no rows. */
static bool contact_rests(hapi_body_contacts *contacts, const hapi_bodies *bodies, uint32_t index)
{
  const hapi_contact_memory *memory = &contacts->memory[index];
  const hapi_contact_kept *kept = &memory->kept;
  if (kept->what != HAPI_KEPT_ROWS ||
      !hapi_contact_is_still(kept, hapi_bodies_at(bodies, kept->body_a),
                             hapi_bodies_at(bodies, kept->body_b))) {
    return false;
  }
  contacts->still_active += memory->impulse[0] > 0.0;
  return true;
}

void hapi_contact_rows(hapi_body_contacts *contacts, const hapi_bodies *bodies, hapi_rows *rows,
                       const hapi_tick_facts *facts, hapi_effect_sample *sample)
{
  if (contacts->patches == NULL) {
    return;
  }
  bool goes_on = contacts->rowed_tick + 1 == facts->tick;
  bool all_still = bodies->still > 0 && bodies->still == bodies->live_count && !contacts->adopted;
  contacts->rowed_tick = facts->tick;
  contacts->adopted = false;
  rows->before.end = goes_on ? rows->before.end : 0;
  if (all_still) {
    return;
  }
  contacts->still_active = 0;
  hapi_run_close(contacts);
  for (uint32_t i = 0; i < contacts->patches->contact_count; ++i) {
    if (bodies->still > 0 && contact_rests(contacts, bodies, i)) {
      hapi_run_close(contacts);
      continue;
    }
    uint32_t standing = goes_on ? run_goes_on(contacts, bodies, i, rows, facts) : 0;
    if (standing > 0) {
      hapi_run_close(contacts);
      i += standing - 1;
      continue;
    }
    contacts->run_lengths[i] = 0;
    if (!goes_on || !contact_goes_on(contacts, bodies, i, rows, facts, sample)) {
      contact_make(contacts, bodies, i, rows, facts, sample);
      hapi_run_close(contacts);
    }
  }
}
