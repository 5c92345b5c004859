/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "near/cover.h"

/* Many small questions to a space, answered from one. ODE's hash space looks at each of its geoms
 * to find those near one, so a walk over dozens of bodies would cost dozens of passes over the
 * world. Here the space is asked once for a box that holds what the last round of questions asked
 * for; its geoms are kept in the order in which ODE gave them, with their boxes. A question inside
 * the box is answered from the list, with the geoms and in the order that ODE itself would give. */

#define GROWTH 0.5 /* of its length on each side: a walk that leaves the box asks few times more */

static bool box_holds(const dReal outer[6], const dReal inner[6])
{
  return outer[0] <= inner[0] && inner[1] <= outer[1] && outer[2] <= inner[2] &&
         inner[3] <= outer[3] && outer[4] <= inner[4] && inner[5] <= outer[5];
}

static void box_unite(dReal box[6], bool *has, const dReal other[6])
{
  for (int k = 0; k < 6; k += 2) {
    box[k] = !*has || other[k] < box[k] ? other[k] : box[k];
    box[k + 1] = !*has || other[k + 1] > box[k + 1] ? other[k + 1] : box[k + 1];
  }
  *has = true;
}

bool hapi_cover_create(hapi_cover *cover)
{
  cover->box_geom = dCreateBox(NULL, 1.0, 1.0, 1.0);
  return cover->box_geom != NULL;
}

void hapi_cover_finish(hapi_cover *cover)
{
  if (cover->box_geom != NULL) {
    dGeomDestroy(cover->box_geom);
  }
  hapi_free(cover->found);
  memset(cover, 0, sizeof *cover);
}

void hapi_cover_begin(hapi_cover *cover)
{
  cover->filled = false;
  memcpy(cover->box, cover->asked, sizeof cover->box);
  cover->has_box = cover->has_asked;
  cover->has_asked = false;
  cover->boxes_s = 0.0;
}

static void note_geom(void *data, dGeomID a, dGeomID b)
{
  hapi_cover *cover = data;
  dGeomID geom = a == cover->box_geom ? b : a;
  if (dGeomIsSpace(geom)) {
    dSpaceCollide2(cover->box_geom, geom, data, note_geom);
    return;
  }
  cover->missing = cover->missing || !hapi_reserve((void **)&cover->found, &cover->capacity,
                                                   cover->count, 1, sizeof *cover->found);
  if (!cover->missing) {
    hapi_covered *found = &cover->found[cover->count++];
    found->geom = geom;
    found->space = cover->asking;
    dGeomGetAABB(geom, found->box);
  }
}

/* Of all spaces: the next question may be of others. */
static void cover_fill(hapi_cover *cover, const hapi_spaces *spaces)
{
  cover->count = 0;
  cover->missing = false;
  for (uint32_t i = 0; i < spaces->count; ++i) {
    dSpaceID space = spaces->list[i].space;
    int64_t begin_ns = hapi_clock_now();
    dSpaceClean(space); /* ODE does it first of all when it is asked */
    cover->boxes_s += 1e-9 * (double)(hapi_clock_now() - begin_ns);
    cover->asking = 1u << i;
    dSpaceCollide2(cover->box_geom, (dGeomID)space, cover, note_geom);
  }
  cover->filled = !cover->missing;
}

void hapi_cover_ask(hapi_cover *cover, const hapi_cover_question *question, void *data,
                    dNearCallback *callback)
{
  const hapi_spaces *spaces = question->spaces;
  dGeomID geom = question->geom;
  dReal box[6];
  dGeomGetAABB(geom, box);
  box_unite(cover->asked, &cover->has_asked, box);
  if (!cover->filled || !box_holds(cover->box, box)) {
    /* Asks for what was covered before and the new box, with room around it. */
    dReal length[3];
    dReal middle[3];
    box_unite(cover->box, &cover->has_box, box);
    for (int k = 0; k < 3; ++k) {
      length[k] = (1.0 + 2.0 * GROWTH) * (cover->box[2 * k + 1] - cover->box[2 * k]);
      middle[k] = 0.5 * (cover->box[2 * k] + cover->box[2 * k + 1]);
    }
    dGeomBoxSetLengths(cover->box_geom, length[0], length[1], length[2]);
    dGeomSetPosition(cover->box_geom, middle[0], middle[1], middle[2]);
    dGeomGetAABB(cover->box_geom, cover->box);
    cover_fill(cover, spaces);
  }
  if (!cover->filled ||
      !box_holds(cover->box, box)) { /* no memory, or so far out that it is rounded off */
    for (uint32_t i = 0; i < spaces->count; ++i) {
      if ((question->mask & 1u << i) != 0) {
        dSpaceCollide2(geom, (dGeomID)spaces->list[i].space, data, callback);
      }
    }
    return;
  }
  for (uint32_t i = 0; i < cover->count; ++i) {
    if ((cover->found[i].space & question->mask) != 0 &&
        hapi_boxes_meet(cover->found[i].box, box)) {
      callback(data, geom, cover->found[i].geom);
    }
  }
}
