/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SYNC_PATCHES_H
#define HAPODE_SYNC_PATCHES_H

/* contact -> haptic: contacts between bodies (model CONTACT). */

#include <assert.h>
#include <string.h>

#include "base/hash.h"
#include "proximity/patch.h"
#include "sync/message.h"

/* How two geoms touch, as the application says it: ODE's dSurfaceParameters with fdir1; soft
 * constraints converted from the world's step to the tick (the same spring and damper). */
typedef struct hapi_surface {
  uint32_t flags; /* HAPI_SURFACE_* */
  double mu;      /* with APPROX1: friction coefficient, else N */
  double mu2;
  double direction[3]; /* unit, world: first friction direction, with FDIR1 */
  double bounce;
  double bounce_speed; /* m/s */
  double erp;          /* at the tick */
  double cfm;          /* (m/s)/N at the tick: J v = target - cfm x force */
  double layer;        /* m, depth that is not pushed out */
  double max_push;     /* m/s, largest correcting velocity */
  double motion[3];    /* m/s along friction 1, friction 2, normal */
  double slip[2];      /* m/(N s) */
} hapi_surface;

static inline uint64_t hapi_surface_hash(const hapi_surface *surface)
{
  uint64_t words[sizeof *surface / sizeof(uint64_t)];
  uint64_t hash = HAPI_HASH_BEGIN;
  static_assert(sizeof words == sizeof *surface, "all of it");
  memcpy(words, surface, sizeof words);
  for (size_t i = 0; i < sizeof words / sizeof words[0]; ++i) {
    hash = hapi_hash_word(hash, words[i]);
  }
  return hash;
}

enum {
  HAPI_SURFACE_APPROX1_1 = 1,
  HAPI_SURFACE_APPROX1_2 = 2,
  HAPI_SURFACE_FDIR1 = 4,
  HAPI_SURFACE_BOUNCE = 8,
  HAPI_SURFACE_SOFT = 16, /* push-out is a spring's, and stays in the velocity */
  HAPI_SURFACE_SLIP1 = 32,
  HAPI_SURFACE_SLIP2 = 64
};

/* A point of hapi_patch in the frames of its two bodies; the loop places it anew where they move.
 * Static world: world frame. */
typedef struct hapi_patch_contact {
  uint64_t key;    /* of the pair; contacts of a pair follow each other */
  uint64_t number; /* in two messages the same contact has the same one, but for its surface */
  uint32_t body_a;
  uint32_t generation_a;
  uint32_t body_b; /* HAPI_SLOT_NONE: static world */
  uint32_t generation_b;
  uint32_t surface; /* index into the message's surfaces */
  hapi_touch touch;
  hapi_slide slide;
  double core_a[3];
  double core_b[3];
  double normal[3]; /* from b to a: frame of the face's body; EDGES: world, for the sign */
  double ball_a;
  double ball_b;
  double rim_a;
  double rim_b;
  /* For some contacts only: last, so that a tick over a thousand contacts need not load them. */
  double axis_a[3]; /* of the rims */
  double axis_b[3];
  double edge_a[3]; /* EDGES and slides */
  double edge_b[3];
  hapi_shape shape; /* BALL: what the ball touches */
  hap_pose shape_pose;
} hapi_patch_contact;

/* A point of a patch between a pointer's hull (a) and a geom of a body (b). Side a is in the
 * pointer's frame. */
typedef struct hapi_tool_point {
  uint32_t pointer;
  uint32_t pointer_generation;
  double same_within; /* m, pointer's frame: a new point matches an old one nearer than this */
  double mu;          /* friction of the pointer against the geom; 0: none */
  uint32_t feel;      /* as hapi_model_contact.feel */
  uint64_t group;     /* the same for the points of all pairs that adjoin, see tool_seams.h */
  hapi_tag geom;
  hapi_patch_contact at;
} hapi_tool_point;

typedef struct hapi_pair_tags {
  hapi_tag geom_a;
  hapi_tag geom_b;
} hapi_pair_tags;

typedef struct hapi_patches {
  uint64_t number;       /* 1, 2, 3 ... */
  uint64_t model_number; /* of the hapi_near that it was made from */
  uint64_t tick;         /* of the hapi_poses */
  int64_t valid_from_ns; /* the loop uses the message from this time on */
  uint64_t contents;     /* messages with the same have the same contacts, with their numbers and
                            surfaces, in the same order; 0: not known */
  uint32_t contact_count;
  uint32_t surface_count;
  uint32_t tool_count; /* of pointers that are hulls; those of a key follow each other */
  uint32_t contacts_offset;
  uint32_t surfaces_offset;
  uint32_t pairs_offset;
  uint32_t tools_offset;
} hapi_patches;

HAPI_MESSAGE_ARRAY(hapi_patches_contacts, hapi_patches, hapi_patch_contact, contacts_offset)
HAPI_MESSAGE_ARRAY(hapi_patches_surfaces, hapi_patches, hapi_surface, surfaces_offset)
/* By surface. */
HAPI_MESSAGE_ARRAY(hapi_patches_pairs, hapi_patches, hapi_pair_tags, pairs_offset)
HAPI_MESSAGE_ARRAY(hapi_patches_tools, hapi_patches, hapi_tool_point, tools_offset)

#endif
