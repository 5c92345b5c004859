/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "world/carriers.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"
#include "base/pose.h"
#include "base/vec.h"

/* A carrier begins where its geom was at the last sync, with the axes of the world: a touch of the
 * static world goes on as one of the carrier by a shift alone. */

#define FIRST_CAPACITY 64u
#define FORGOTTEN (-1)
#define STANDS_MOST 120u /* syncs: then the geom may be of the static world again */

/* ---- places ---- */

/* ODE ends the process where a heightfield that cannot be placed is asked for its pose, and does
 * not tell which ones can: of all of them the box is taken, so that their turns are not seen. */
static void field_place_read(dGeomID geom, double out[HAPI_GEOM_NUMBERS])
{
  dReal box[6];
  dGeomGetAABB(geom, box);
  for (int k = 0; k < 3; ++k) {
    out[k] = 0.5 * (box[2 * k] + box[2 * k + 1]);
    out[3 + k] = box[2 * k + 1] - box[2 * k];
  }
}

static void place_read(dGeomID geom, double out[HAPI_GEOM_NUMBERS])
{
  memset(out, 0, HAPI_GEOM_NUMBERS * sizeof *out);
  if (dGeomGetClass(geom) == dPlaneClass) {
    dVector4 plane;
    dGeomPlaneGetParams(geom, plane);
    memcpy(out, plane, 4 * sizeof *out);
    return;
  }
  if (dGeomGetClass(geom) == dHeightfieldClass) {
    field_place_read(geom, out);
    return;
  }
  memcpy(out, dGeomGetPosition(geom), 3 * sizeof *out);
  memcpy(out + 3, dGeomGetRotation(geom), 12 * sizeof *out);
}

/* The shortest turn from the z axis to the normal. */
static void plane_turn(const double normal[3], double out[4])
{
  double half[4] = {1.0 + normal[2], -normal[1], normal[0], 0.0};
  double length = sqrt(half[0] * half[0] + half[1] * half[1] + half[2] * half[2]);
  static const double over[4] = {0.0, 1.0, 0.0, 0.0};
  for (int i = 0; i < 4; ++i) {
    out[i] = length > 1e-9 ? half[i] / length : over[i];
  }
}

static void place_pose(int kind, const double place[HAPI_GEOM_NUMBERS], hap_pose *out)
{
  if (kind == dPlaneClass) {
    hapi_v3_scale(place[3], place, out->position);
    plane_turn(place, out->quat_wxyz);
    return;
  }
  if (kind == dHeightfieldClass) {
    *out = (hap_pose){{place[0], place[1], place[2]}, {1.0, 0.0, 0.0, 0.0}};
    return;
  }
  dMatrix3 rotation = {0.0};
  memcpy(rotation, place + 3, sizeof rotation);
  hapi_v3_copy(place, out->position);
  dRtoQ(rotation, out->quat_wxyz);
}

static void quat_back(const double q[4], double out[4])
{
  out[0] = q[0];
  hapi_v3_scale(-1.0, q + 1, out + 1);
}

static void carrier_place(const hapi_loose_geom *loose)
{
  hap_pose pose;
  double turn[4];
  place_pose(loose->kind, loose->place, &pose);
  hapi_quat_multiply(pose.quat_wxyz, loose->turn_back, turn);
  const double *p = pose.position;
  dBodySetPosition(loose->carrier, p[0], p[1], p[2]);
  dBodySetQuaternion(loose->carrier, turn);
}

/* ---- the table ---- */

static bool table_grow(hapi_carriers *carriers)
{
  uint32_t capacity = carriers->capacity > 0 ? 2 * carriers->capacity : FIRST_CAPACITY;
  hapi_loose_geom *entries = hapi_alloc_array(capacity, sizeof *entries);
  if (entries == NULL || !hapi_index_reserve(&carriers->by_address, capacity)) {
    hapi_free(entries);
    return false;
  }
  if (carriers->high > 0) {
    memcpy(entries, carriers->entries, carriers->high * sizeof *entries);
  }
  hapi_free(carriers->entries);
  carriers->entries = entries;
  carriers->capacity = capacity;
  return true;
}

static uint32_t free_entry(const hapi_carriers *carriers)
{
  for (uint32_t i = 0; carriers->used < carriers->high && i < carriers->high; ++i) {
    if (carriers->entries[i].geom == NULL) {
      return i;
    }
  }
  return carriers->high;
}

static bool entry_add(hapi_carriers *carriers, dGeomID geom, uint32_t *out_index)
{
  uint32_t index = free_entry(carriers);
  if (index == carriers->capacity && !table_grow(carriers)) {
    return false;
  }
  carriers->entries[index] = (hapi_loose_geom){.geom = geom, .kind = FORGOTTEN};
  carriers->high = index == carriers->high ? index + 1 : carriers->high;
  ++carriers->used;
  hapi_index_put(&carriers->by_address, hapi_index_address(geom), index);
  *out_index = index;
  return true;
}

/* A scan meets most geoms in the order of the one before. */
static uint32_t find_next(const hapi_carriers *carriers, dGeomID geom)
{
  uint32_t last = carriers->last_seen;
  uint32_t next = last != HAPI_INDEX_NONE ? carriers->entries[last].next : HAPI_INDEX_NONE;
  if (next < carriers->high && carriers->entries[next].geom == geom) {
    return next;
  }
  uint32_t index = hapi_index_get(&carriers->by_address, hapi_index_address(geom));
  if (last != HAPI_INDEX_NONE) {
    carriers->entries[last].next = index;
  }
  return index;
}

/* The body is destroyed by the scan that meets it no more. */
static void carrier_end(hapi_carriers *carriers, hapi_loose_geom *loose)
{
  carriers->count -= loose->carrier != NULL;
  loose->carrier = NULL;
}

static void carrier_begin(hapi_carriers *carriers, hapi_loose_geom *loose)
{
  hap_pose pose;
  if (carriers->world == NULL) {
    carriers->world = dWorldCreate();
  }
  place_pose(loose->kind, loose->place, &pose);
  quat_back(pose.quat_wxyz, loose->turn_back);
  loose->carrier = dBodyCreate(carriers->world);
  dBodySetKinematic(loose->carrier);
  dBodySetData(loose->carrier, loose->geom);
  carrier_place(loose);
  ++carriers->count;
}

void hapi_carriers_reset(hapi_carriers *carriers)
{
  for (uint32_t i = 0; i < carriers->high; ++i) {
    carrier_end(carriers, &carriers->entries[i]);
  }
  carriers->high = carriers->used = 0;
  hapi_index_clear(&carriers->by_address);
}

void hapi_carriers_finish(hapi_carriers *carriers)
{
  if (carriers->world != NULL) {
    dWorldDestroy(carriers->world);
  }
  hapi_free(carriers->entries);
  hapi_index_finish(&carriers->by_address);
  memset(carriers, 0, sizeof *carriers);
}

/* ---- scans ---- */

void hapi_carriers_begin_scan(hapi_carriers *carriers, bool syncs)
{
  carriers->syncs = syncs;
  carriers->last_seen = HAPI_INDEX_NONE;
  carriers->seen_count = 0;
}

/* As it was read last: of most geoms without a copy, as all of them are asked at each sync. */
static bool place_is(dGeomID geom, int kind, const double place[HAPI_GEOM_NUMBERS])
{
  if (kind == dPlaneClass || kind == dHeightfieldClass) {
    double now[HAPI_GEOM_NUMBERS];
    place_read(geom, now);
    return memcmp(now, place, sizeof now) == 0;
  }
  return memcmp(dGeomGetPosition(geom), place, 3 * sizeof *place) == 0 &&
         memcmp(dGeomGetRotation(geom), place + 3, 12 * sizeof *place) == 0;
}

/* Whether it moved since the last sync. */
static bool loose_moved(const hapi_loose_geom *loose, double out_place[HAPI_GEOM_NUMBERS])
{
  if (place_is(loose->geom, loose->kind, loose->place)) {
    return false;
  }
  place_read(loose->geom, out_place);
  return hapi_finite(out_place, HAPI_GEOM_NUMBERS);
}

#define BOX_SAME 1e-9 /* m */

static bool box_changed(const double a[HAPI_GEOM_NUMBERS], const double b[HAPI_GEOM_NUMBERS])
{
  double apart[3];
  hapi_v3_sub(a + 3, b + 3, apart);
  return !(hapi_v3_norm(apart) < BOX_SAME);
}

static void loose_follow(hapi_carriers *carriers, hapi_loose_geom *loose, bool may_end,
                         hapi_carrier_meeting *out)
{
  double place[HAPI_GEOM_NUMBERS];
  bool moved = loose_moved(loose, place);
  if (moved && loose->kind == dHeightfieldClass && box_changed(loose->place, place)) {
    carrier_end(carriers, loose); /* turned, or another one: it is static again */
    memcpy(loose->place, place, sizeof place);
  } else if (moved) {
    out->is_new = loose->carrier == NULL;
    if (out->is_new) {
      carrier_begin(carriers, loose);
    }
    memcpy(loose->place, place, sizeof place);
    out->stood = loose->stands;
    loose->stands = 0;
    if (!out->is_new) {
      carrier_place(loose);
    }
  } else {
    loose->stands += loose->stands <= STANDS_MOST;
    if (loose->carrier != NULL && loose->stands > STANDS_MOST && may_end) {
      carrier_end(carriers, loose);
    }
  }
}

bool hapi_carriers_meet(hapi_carriers *carriers, dGeomID geom, uint64_t scan, bool may_end,
                        hapi_carrier_meeting *out)
{
  int kind = dGeomGetClass(geom);
  uint32_t index = find_next(carriers, geom);
  *out = (hapi_carrier_meeting){NULL, false, 0};
  if (index == HAPI_INDEX_NONE && !entry_add(carriers, geom, &index)) {
    return false;
  }
  HAPI_ASSERT_INDEX(index, carriers->high);
  hapi_loose_geom *loose = &carriers->entries[index];
  carriers->last_seen = index;
  carriers->seen_count += loose->seen != scan;
  loose->seen = scan;
  if (loose->kind != kind) { /* it is new, or another one */
    carrier_end(carriers, loose);
    loose->kind = kind;
    loose->stands = 0;
    place_read(geom, loose->place);
  } else if (carriers->syncs) {
    loose_follow(carriers, loose, may_end, out);
  }
  out->body = loose->carrier;
  return true;
}

void hapi_carriers_place(hapi_carriers *carriers, dGeomID geom)
{
  uint32_t index = hapi_index_get(&carriers->by_address, hapi_index_address(geom));
  HAPI_ASSERT_INDEX(index, carriers->high);
  carrier_place(&carriers->entries[index]);
}

void hapi_carriers_end_scan(hapi_carriers *carriers, uint64_t scan)
{
  for (uint32_t i = 0; carriers->seen_count < carriers->used && i < carriers->high; ++i) {
    hapi_loose_geom *loose = &carriers->entries[i];
    if (loose->geom != NULL && loose->seen != scan) {
      carrier_end(carriers, loose);
      hapi_index_remove(&carriers->by_address, hapi_index_address(loose->geom));
      loose->geom = NULL;
      --carriers->used;
    }
  }
}

void hapi_carriers_forget(hapi_carriers *carriers, dGeomID geom)
{
  uint32_t index = hapi_index_get(&carriers->by_address, hapi_index_address(geom));
  if (index != HAPI_INDEX_NONE) {
    carriers->entries[index].kind = FORGOTTEN;
  }
}

dBodyID hapi_carrier_of(const hapi_carriers *carriers, dGeomID geom)
{
  if (carriers->count == 0) {
    return NULL;
  }
  uint32_t index = hapi_index_get(&carriers->by_address, hapi_index_address(geom));
  return index != HAPI_INDEX_NONE ? carriers->entries[index].carrier : NULL;
}

dGeomID hapi_carried_geom(const hapi_carriers *carriers, dBodyID body)
{
  bool carried = carriers->world != NULL && dBodyGetWorld(body) == carriers->world;
  return carried ? (dGeomID)dBodyGetData(body) : NULL;
}
