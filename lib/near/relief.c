/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "near/relief.h"

#include <string.h>

#include "base/alloc.h"
#include "base/pose.h"
#include "base/vec.h"
#include "near/fields.h"
#include "near/near.h"

/* Until the model after the next one, and what the session looks ahead, the pointer may go a long
 * way, over more triangles than a tick can look at. Then those nearest to it are told, and how far
 * they go. */

#define SHRINK 0.8
#define SLACK_LEAST 1e-3 /* m, beyond the pointer's surface: with less there is no use in them */

bool hapi_relief_create(hapi_nearby *nearby)
{
  uint32_t room = nearby->cycle->config->capacity.triangles;
  nearby->neighbors.relief.triangles =
      hapi_alloc_array(room, sizeof *nearby->neighbors.relief.triangles);
  nearby->neighbors.relief.told = hapi_alloc_array(nearby->cycle->config->capacity.contacts,
                                                   sizeof *nearby->neighbors.relief.told);
  return nearby->neighbors.relief.triangles != NULL && nearby->neighbors.relief.told != NULL;
}

void hapi_relief_finish(hapi_nearby *nearby)
{
  hapi_free(nearby->neighbors.relief.triangles);
  hapi_free(nearby->neighbors.relief.told);
  memset(&nearby->neighbors.relief, 0, sizeof nearby->neighbors.relief);
}

void hapi_relief_begin(hapi_nearby *nearby)
{
  nearby->neighbors.relief.count = 0;
  for (uint32_t i = 0; i < nearby->slots.contact_high; ++i) {
    nearby->neighbors.relief.told[i].count = 0;
  }
}

/* How many triangles come nearer to the place than *io_within, which gets less until there is room
 * for them. */
static uint32_t relief_find(hapi_nearby *nearby, dGeomID geom, const double at[3], double least,
                            double *io_within)
{
  uint32_t room = nearby->cycle->config->capacity.triangles - nearby->neighbors.relief.count;
  for (; *io_within >= least; *io_within *= SHRINK) {
    double box[6];
    for (int k = 0; k < 6; ++k) {
      box[k] = at[k / 2] + (k % 2 == 0 ? -*io_within : *io_within);
    }
    uint32_t count = hapi_triangles_near(nearby, geom, box, nearby->cycle->model_number + 1);
    if (count < HAPI_NEAR_TRIANGLES && count <= room) {
      return count;
    }
  }
  return 0;
}

void hapi_relief_note(hapi_nearby *nearby, dGeomID geom, const hapi_state_pointer *pointer,
                      double within, double least, const hapi_contact_slot *slot)
{
  hapi_relief *relief = &nearby->neighbors.relief;
  hapi_told *told = &relief->told[slot - nearby->slots.contacts];
  const double *at = pointer->pose.position;
  dBodyID body = hapi_geom_body(nearby->world, geom);
  told->first = relief->count;
  told->count = relief_find(nearby, geom, at, pointer->radius + SLACK_LEAST, &within);
  if (within < least) {
    ++nearby->counts.dropped;
    hapi_say_once(nearby->cycle, &relief->said_cut,
                  "a surface has more triangles near a pointer than the loop can look at: beyond "
                  "them it is a plane until the next step of the world");
  }
  told->within = within;
  hapi_v3_copy(at, told->at);
  if (body != NULL) {
    hapi_pose_unpoint(dBodyGetPosition(body), dBodyGetQuaternion(body), at, told->at);
  }
  for (uint32_t i = 0; i < told->count; ++i) {
    double corners[9];
    memcpy(corners, nearby->meshes.found[i].corners, sizeof corners);
    for (int k = 0; body != NULL && k < 9; k += 3) {
      hapi_pose_unpoint(dBodyGetPosition(body), dBodyGetQuaternion(body), corners + k, corners + k);
    }
    hapi_triangle_set(corners, &relief->triangles[relief->count++]);
  }
}
