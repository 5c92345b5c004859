/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "solver/packs.h"

#include <math.h>
#include <string.h>

#include "base/assert.h"
#include "base/vec.h"

#define PACKABLE_LEAST 8u /* contacts: fewer are swept as quickly one by one */
#define FULL_LEAST 2u     /* lanes a pack, in the mean: likewise */
#define COLORS 64u
#define LOOSE_COLOR 64u /* of a pair beyond all colors */
/* Levels of a stack that packs are for. One of 30 under a hand gains energy by many sweeps in the
 * order of packs, and not by few sweeps and a direct solve; one of 20 does not. The reason is not
 * known. */
#define HEIGHT_MOST 8u
#define COUNT_MOST 15u /* contacts of a pair that the order tells apart */

static bool is_packable(const hapi_row *row)
{
  return row->triple == HAPI_TRIPLE_BY_MASS;
}

/* ---- a lane ---- */

static void lane_set_impulses(const hapi_packs *packs, uint32_t place, const hapi_row *row)
{
  uint32_t at = place / HAPI_LANES;
  uint32_t lane = place % HAPI_LANES;
  for (int i = 0; i < 3; ++i) {
    packs->contacts[at].drive[i][lane] = row[i].drive;
    packs->impulse[at][i][lane] = row[i].impulse;
  }
  packs->contacts[at].load[lane] = row[1].hi;
}

static void lane_get_impulses(const hapi_packs *packs, uint32_t place, hapi_row *row)
{
  for (int i = 0; i < 3; ++i) {
    row[i].impulse = packs->impulse[place / HAPI_LANES][i][place % HAPI_LANES];
  }
}

/* Of a contact that goes on: only a partner that moves and does not respond changes what frictions
 * ask for. */
static void lane_set_drives(const hapi_packs *packs, uint32_t place, const hapi_row *row)
{
  int changed = hapi_row_moves_b(row) || row->single ? 1 : 3;
  for (int i = 0; i < changed; ++i) {
    packs->contacts[place / HAPI_LANES].drive[i][place % HAPI_LANES] = row[i].drive;
  }
}

/* The arm along the directions d of three rows, from their moments arm x d. Of left-handed
 * directions it is the opposite, and so are cross products with it. */
static void arm_find(const hapi_row *row, bool of_b, double out[3])
{
  for (int k = 0; k < 3; ++k) {
    const hapi_row *turns = &row[(k + 1) % 3];
    const double *along = row[(k + 2) % 3].ja;
    out[k] = of_b ? -hapi_v3_dot(turns->jb + 3, along) : hapi_v3_dot(turns->ja + 3, along);
  }
}

static void contact_fill(const hapi_packs *packs, uint32_t place, const hapi_row *row)
{
  uint32_t at = place / HAPI_LANES;
  uint32_t lane = place % HAPI_LANES;
  hapi_pack_contact *c = &packs->contacts[at];
  double arm[3];
  arm_find(row, false, arm);
  for (int i = 0; i < 3; ++i) {
    c->arm[i][lane] = arm[i];
    c->softness[i][lane] = row[i].softness;
    c->inverse[i][lane] = row[i].inverse;
    c->response[i][lane] = row[i].response;
  }
  c->mu[0][lane] = row[1].mu;
  c->mu[1][lane] = row[2].mu;
  c->coupling[0][lane] = row[1].coupling[0];
  c->coupling[1][lane] = row[2].coupling[0];
  c->coupling[2][lane] = row[2].coupling[1];
  lane_set_impulses(packs, place, row);
}

static void turn_fill(const double inverse_inertia[9], double (*out)[HAPI_LANES], uint32_t lane)
{
  static const int at[6] = {0, 1, 2, 4, 5, 8};
  for (int i = 0; i < 6; ++i) {
    out[i][lane] = inverse_inertia[at[i]];
  }
}

/* What the contacts of a lane have in common, from the rows of the first one. */
static void bodies_fill(const hapi_packs *packs, hapi_pack *pack, uint32_t lane,
                        const hapi_row *row)
{
  double apart[3] = {0.0};
  double arm[3];
  double right[3];
  hapi_v3_cross(row[1].ja, row[2].ja, right);
  double sign = hapi_v3_dot(row[0].ja, right) < 0.0 ? -1.0 : 1.0;
  pack->mass_a[lane] = hapi_row_inverse_mass(row->ja, row->ba);
  turn_fill(packs->inverse_inertia[row->a], pack->turn_a, lane);
  if (pack->paired) {
    pack->mass_b[lane] = hapi_row_inverse_mass(row->jb, row->bb);
    turn_fill(packs->inverse_inertia[row->b], pack->turn_b, lane);
    arm_find(row, false, arm);
    arm_find(row, true, apart);
    hapi_v3_sub(apart, arm, apart);
  }
  for (int k = 0; k < 3; ++k) {
    pack->arms_apart[k][lane] = apart[k];
    pack->across[k][lane] = 0.0;
    for (int i = 0; i < 3; ++i) {
      pack->direction[i][k][lane] = row[i].ja[k];
      pack->across[k][lane] += sign * apart[i] * row[i].ja[k];
    }
  }
}

/* ---- units, colors and their order ---- */

static void units_find(hapi_packs *packs, const hapi_row *rows, uint32_t row_count)
{
  uint32_t most = HAPI_LANES * packs->contact_capacity;
  uint32_t units = 0;
  packs->packable_count = 0;
  for (uint32_t i = 0; i < row_count && packs->packable_count < most; ++i) {
    const hapi_row *row = &rows[i];
    if (!is_packable(row)) {
      continue;
    }
    const hapi_row *last =
        packs->packable_count > 0 ? &rows[packs->packables[packs->packable_count - 1].row] : NULL;
    if (last == NULL || last + 3 != row || last->a != row->a || last->b != row->b ||
        packs->units[units - 1].count == HAPI_PACK_CONTACTS || !hapi_same_directions(last, row)) {
      packs->units[units++] =
          (hapi_pack_unit){.first = packs->packable_count, .paired = hapi_row_moves_b(row)};
    }
    packs->packables[packs->packable_count++] = (hapi_packable){
        .row = i, .a = row->a, .b = row->b, .place = HAPI_NO_PLACE, .unit = units - 1};
    ++packs->units[units - 1].count;
    i += 2;
  }
  packs->unit_count = units;
}

static bool level_lower(uint32_t *level, uint32_t below)
{
  bool lowers = below != 0 && (*level == 0 || *level > below + 1);
  *level = lowers ? below + 1 : *level;
  return lowers;
}

/* How far a load has to go until something holds it: a row on a floor is low, a stack is high. */
static void levels_find(hapi_packs *packs, uint32_t body_count)
{
  bool again = true;
  memset(packs->plan.levels, 0, body_count * sizeof *packs->plan.levels);
  for (uint32_t i = 0; i < packs->unit_count; ++i) {
    if (!packs->units[i].paired) {
      packs->plan.levels[packs->packables[packs->units[i].first].a] = 1;
    }
  }
  while (again) {
    again = false;
    for (uint32_t i = 0; i < packs->unit_count; ++i) {
      const hapi_packable *at = &packs->packables[packs->units[i].first];
      if (packs->units[i].paired) {
        again = level_lower(&packs->plan.levels[at->a], packs->plan.levels[at->b]) || again;
        again = level_lower(&packs->plan.levels[at->b], packs->plan.levels[at->a]) || again;
      }
    }
  }
  packs->height = 1;
  for (uint32_t i = 0; i < body_count; ++i) {
    packs->height = packs->plan.levels[i] > packs->height ? packs->plan.levels[i] : packs->height;
  }
}

/* The first color that neither body has. */
static void units_color(hapi_packs *packs, uint32_t body_count)
{
  memset(packs->plan.colors, 0, body_count * sizeof *packs->plan.colors);
  for (uint32_t i = 0; i < packs->unit_count; ++i) {
    hapi_pack_unit *unit = &packs->units[i];
    const hapi_packable *at = &packs->packables[unit->first];
    uint64_t used = packs->plan.colors[at->a] | (unit->paired ? packs->plan.colors[at->b] : 0);
    uint32_t color = 0;
    while (color < COLORS && (used >> color & 1) != 0) {
      ++color;
    }
    unit->color = (uint8_t)color;
    if (color < COLORS) {
      packs->plan.colors[at->a] |= (uint64_t)1 << color;
      packs->plan.colors[at->b] |= unit->paired ? (uint64_t)1 << color : 0;
    }
  }
}

static uint32_t key_of_count(const hapi_pack_unit *unit)
{
  return unit->count < COUNT_MOST ? COUNT_MOST - unit->count : 0;
}

static uint32_t key_of_color(const hapi_pack_unit *unit)
{
  return 2u * unit->color + unit->paired;
}

/* Stable, from one list to the other. */
static void units_sort(const hapi_packs *packs, uint32_t (*key)(const hapi_pack_unit *),
                       const uint32_t *from, uint32_t *to)
{
  uint32_t begins[2 * (COLORS + 1) + 1] = {0};
  for (uint32_t i = 0; i < packs->unit_count; ++i) {
    ++begins[key(&packs->units[from[i]]) + 1];
  }
  for (uint32_t k = 1; k < sizeof begins / sizeof begins[0]; ++k) {
    begins[k] += begins[k - 1];
  }
  for (uint32_t i = 0; i < packs->unit_count; ++i) {
    to[begins[key(&packs->units[from[i]])]++] = from[i];
  }
}

/* By color, and those with many contacts first: what is side by side is of one length. */
static void units_order(hapi_packs *packs)
{
  for (uint32_t i = 0; i < packs->unit_count; ++i) {
    packs->plan.order[i] = i;
  }
  units_sort(packs, key_of_count, packs->plan.order, packs->plan.sorted);
  units_sort(packs, key_of_color, packs->plan.sorted, packs->plan.order);
}

/* ---- packs ---- */

/* Of so many units from the list; false: there is no room. */
static bool pack_add(hapi_packs *packs, const hapi_row *rows, const uint32_t *units, uint32_t lanes)
{
  hapi_pack *pack = &packs->of[packs->count];
  memset(pack, 0, sizeof *pack);
  pack->first = packs->contact_count;
  pack->block = packs->block_count;
  pack->paired = packs->units[units[0]].paired;
  uint32_t filled = 0;
  for (uint32_t lane = 0; lane < lanes; ++lane) {
    uint32_t count = packs->units[units[lane]].count;
    pack->count = count > pack->count ? count : pack->count;
    filled += count;
  }
  if (pack->first + pack->count > packs->contact_capacity) {
    return false;
  }
  if (filled < HAPI_LANES * pack->count) { /* what is empty has zeros */
    memset(&packs->contacts[pack->first], 0, pack->count * sizeof *packs->contacts);
    memset(packs->impulse[pack->first], 0, pack->count * sizeof *packs->impulse);
  }
  for (uint32_t lane = 0; lane < lanes; ++lane) {
    const hapi_pack_unit *unit = &packs->units[units[lane]];
    const hapi_row *row = &rows[packs->packables[unit->first].row];
    pack->a[lane] = 6 * row->a;
    pack->b[lane] = 6 * row->b;
    for (uint32_t i = 0; i < unit->count; ++i) {
      hapi_packable *packable = &packs->packables[unit->first + i];
      packable->place = (pack->first + i) * HAPI_LANES + lane;
      packable->pack = packs->count;
    }
  }
  packs->contact_count += pack->count;
  packs->block_count += pack->count * (pack->count - 1) / 2;
  ++packs->count;
  return true;
}

/* The last one with the one before, where that is still alone. */
static void pack_pair(const hapi_packs *packs, bool alike)
{
  hapi_pack *pack = &packs->of[packs->count - 1];
  if (alike && !pack[-1].beside && pack[-1].count == pack->count) {
    pack[-1].beside = pack->beside = true;
  }
}

static void packs_add(hapi_packs *packs, const hapi_row *rows)
{
  packs->count = packs->contact_count = packs->block_count = 0;
  uint32_t lanes = 0;
  uint32_t last = UINT32_MAX;
  for (uint32_t i = 0; i < packs->unit_count; i += lanes) {
    const uint32_t *units = packs->plan.order + i;
    uint32_t key = key_of_color(&packs->units[units[0]]);
    lanes = 1;
    while (lanes < HAPI_LANES && i + lanes < packs->unit_count &&
           key_of_color(&packs->units[units[lanes]]) == key) {
      ++lanes;
    }
    if (packs->units[units[0]].color == LOOSE_COLOR || !pack_add(packs, rows, units, lanes)) {
      return; /* the rest is loose */
    }
    pack_pair(packs, key == last);
    last = key;
  }
}

static void loose_add(hapi_packs *packs, uint32_t first, uint32_t end)
{
  if (first < end) {
    packs->loose[packs->loose_count++] = (hapi_loose_rows){first, end};
    packs->loose_rows += end - first;
  }
}

static void loose_find(hapi_packs *packs, uint32_t row_count)
{
  uint32_t begin = 0;
  packs->loose_count = packs->loose_rows = 0;
  for (uint32_t i = 0; i < packs->packable_count; ++i) {
    const hapi_packable *packable = &packs->packables[i];
    if (packable->place != HAPI_NO_PLACE) {
      loose_add(packs, begin, packable->row);
      begin = packable->row + 3;
    }
  }
  loose_add(packs, begin, row_count);
}

/* What was made anew, and all impulses where the rows have them. */
static void unit_fill(const hapi_packs *packs, const hapi_row *rows, const hapi_pack_unit *unit)
{
  hapi_packable *first = &packs->packables[unit->first];
  hapi_pack *pack = &packs->of[first->pack];
  bool made = false;
  for (uint32_t i = 0; i < unit->count; ++i) {
    const hapi_row *row = &rows[first[i].row];
    if (first[i].made != row->made) {
      first[i].made = row->made;
      contact_fill(packs, first[i].place, row);
      made = true;
    } else if (!packs->ahead) {
      lane_set_impulses(packs, first[i].place, row);
    }
  }
  if (made) {
    bodies_fill(packs, pack, first->place % HAPI_LANES, &rows[first->row]);
    pack->stale = true;
  }
}

static void packs_fill(hapi_packs *packs, const hapi_row *rows)
{
  for (uint32_t i = 0; i < packs->unit_count; ++i) {
    const hapi_pack_unit *unit = &packs->units[i];
    if (packs->packables[unit->first].place != HAPI_NO_PLACE) {
      unit_fill(packs, rows, unit);
    }
  }
  packs->work->couple(packs);
}

static void packs_set_impulses(const hapi_packs *packs, const hapi_row *rows)
{
  for (uint32_t i = 0; i < packs->packable_count; ++i) {
    if (packs->packables[i].place != HAPI_NO_PLACE) {
      lane_set_impulses(packs, packs->packables[i].place, &rows[packs->packables[i].row]);
    }
  }
}

/* Whether no row was made, went or moved. */
static bool packs_stand(const hapi_packs *packs, uint32_t row_count, uint32_t body_count)
{
  return packs->count > 0 && packs->known.filled == packs->known.made &&
         packs->known.held == packs->known.ready && packs->known.row_count == row_count &&
         packs->known.body_count == body_count;
}

static bool unit_holds(const hapi_packs *packs, const hapi_row *rows, const hapi_pack_unit *unit)
{
  const hapi_packable *first = &packs->packables[unit->first];
  for (uint32_t i = 0; i < unit->count; ++i) {
    const hapi_packable *packable = &first[i];
    const hapi_row *row = &rows[packable->row];
    if (packable->place == HAPI_NO_PLACE || !is_packable(row) || row->a != packable->a ||
        row->b != packable->b || hapi_row_moves_b(row) != unit->paired) {
      return false;
    }
    bool made = row->made != packable->made || rows[first->row].made != first->made;
    if (made && !hapi_same_directions(&rows[first->row], row)) {
      return false;
    }
  }
  return true;
}

/* Whether what may be packed is what it was, in the same places. */
static bool packs_hold(const hapi_packs *packs, const hapi_row *rows, uint32_t row_count,
                       uint32_t body_count)
{
  if (packs->count == 0 || packs->known.row_count != row_count ||
      packs->known.body_count != body_count) {
    return false;
  }
  for (uint32_t i = 0; i < packs->unit_count; ++i) {
    if (!unit_holds(packs, rows, &packs->units[i])) {
      return false;
    }
  }
  for (uint32_t i = 0; i < packs->loose_count; ++i) {
    for (uint32_t k = packs->loose[i].first; k < packs->loose[i].end; ++k) {
      if (is_packable(&rows[k])) {
        return false;
      }
    }
  }
  return true;
}

static bool news_hold(const hapi_packs *packs, const hapi_row *rows, const hapi_pack_news *news)
{
  const hapi_packable *packable = &packs->packables[news->which];
  return packable->row == news->row && unit_holds(packs, rows, &packs->units[packable->unit]);
}

static bool is_alike(const hapi_packs *packs, const hapi_row *rows)
{
  bool same = true;
  for (uint32_t i = 0; i < packs->packable_count; ++i) {
    uint32_t at = packs->packables[i].place / HAPI_LANES;
    uint32_t lane = packs->packables[i].place % HAPI_LANES;
    const hapi_row *row = &rows[packs->packables[i].row];
    for (int k = 0; packs->packables[i].place != HAPI_NO_PLACE && k < 3; ++k) {
      same = same && packs->contacts[at].drive[k][lane] == row[k].drive &&
             (packs->ahead || packs->impulse[at][k][lane] == row[k].impulse);
    }
  }
  return same;
}

/* Copies only the changed contacts. This is enough where there are as many packable contacts as
 * before and each new one has the place of an old one: the others did not move, or alike would be
 * false. Returns false otherwise. */
static bool packs_take_news(hapi_packs *packs, const hapi_row *rows, uint32_t row_count,
                            uint32_t body_count)
{
  bool made = false;
  if (packs->count == 0 || !packs->known.alike || packs->known.row_count != row_count ||
      packs->known.body_count != body_count || packs->known.ready != packs->packable_count) {
    return false;
  }
  for (uint32_t i = 0; i < packs->known.news; ++i) {
    if (packs->news[i].made && !news_hold(packs, rows, &packs->news[i])) {
      return false;
    }
  }
  for (uint32_t i = 0; i < packs->known.news; ++i) {
    const hapi_packable *packable = &packs->packables[packs->news[i].which];
    if (packs->news[i].made) {
      unit_fill(packs, rows, &packs->units[packable->unit]);
      made = true;
    } else if (packable->place != HAPI_NO_PLACE) {
      lane_set_drives(packs, packable->place, &rows[packable->row]);
    }
  }
  if (made) {
    packs->work->couple(packs);
  }
  HAPI_ASSERT(is_alike(packs, rows));
  return true;
}

/* Whether four at once are quicker than one by one. */
static bool packs_pay(const hapi_packs *packs)
{
  uint32_t packed = (packs->known.row_count - packs->loose_rows) / 3;
  return packs->count > 0 && packed >= FULL_LEAST * packs->contact_count;
}

/* Packs and rows hold the same values from here on. */
static void packs_know(hapi_packs *packs)
{
  packs->known.filled = packs->known.made;
  packs->known.held = packs->known.ready;
  packs->known.alike = true;
  packs->known.news = 0;
}

void hapi_packs_give_back(hapi_packs *packs, hapi_row *rows)
{
  for (uint32_t i = 0; packs->ahead && i < packs->packable_count; ++i) {
    const hapi_packable *packable = &packs->packables[i];
    hapi_row *row = &rows[packable->row];
    if (packable->place != HAPI_NO_PLACE && is_packable(row) && row->made == packable->made) {
      lane_get_impulses(packs, packable->place, row);
    }
  }
  packs->ahead = false;
}

bool hapi_packs_begin(hapi_packs *packs, hapi_row *rows, uint32_t row_count, uint32_t body_count)
{
  if (packs_take_news(packs, rows, row_count, body_count)) {
    packs_know(packs);
    return true;
  }
  hapi_packs_give_back(packs, rows);
  if (packs->work == NULL || body_count > packs->body_capacity || row_count < 3 * PACKABLE_LEAST) {
    packs->count = packs->height = 0;
    return false;
  }
  if (packs_stand(packs, row_count, body_count)) {
    packs_set_impulses(packs, rows);
    packs_know(packs);
    return true;
  }
  if (!packs_hold(packs, rows, row_count, body_count)) {
    packs->known.row_count = row_count;
    packs->known.body_count = body_count;
    packs->count = packs->height = 0;
    units_find(packs, rows, row_count);
    if (packs->packable_count < PACKABLE_LEAST) {
      return false;
    }
    levels_find(packs, body_count);
    if (packs->height > HEIGHT_MOST) {
      return false;
    }
    units_color(packs, body_count);
    units_order(packs);
    packs_add(packs, rows);
    loose_find(packs, row_count);
    if (!packs_pay(packs)) {
      packs->count = 0;
      return false;
    }
    packs->known.anew = true;
  }
  packs_fill(packs, rows);
  packs_know(packs);
  return true;
}

void hapi_packs_store(hapi_packs *packs, hapi_row *rows)
{
  for (uint32_t i = 0; i < packs->packable_count; ++i) {
    if (packs->packables[i].place != HAPI_NO_PLACE) {
      lane_get_impulses(packs, packs->packables[i].place, &rows[packs->packables[i].row]);
    }
  }
  packs->ahead = false;
}

void hapi_packs_load(const hapi_packs *packs, const hapi_row *rows)
{
  packs_set_impulses(packs, rows);
}

void hapi_packs_end(hapi_packs *packs, hapi_row *rows)
{
  packs->in_use = false;
  packs->ahead = true;
  for (uint32_t i = 0; HAPI_ASSERTS && i < packs->packable_count; ++i) {
    for (int k = 0; packs->packables[i].place != HAPI_NO_PLACE && k < 3; ++k) {
      rows[packs->packables[i].row + (uint32_t)k].impulse = NAN; /* whoever asks is found out */
    }
  }
}

void hapi_packs_forget(hapi_packs *packs)
{
  packs->count = packs->contact_count = packs->packable_count = 0;
  packs->known.alike = packs->ahead = false;
  packs->loose_count = packs->loose_rows = packs->known.row_count = packs->known.body_count = 0;
}
