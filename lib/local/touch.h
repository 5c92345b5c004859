/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_TOUCH_H
#define HAPODE_LOCAL_TOUCH_H

/* Contacts of pointers: of spheres, and the points of hulls' patches. */

#include <stdbool.h>
#include <stdint.h>

#include "local/pair_feel.h"
#include "local/texture.h"
#include "proximity/constrained_ball.h"
#include "sync/messages.h"

/* How much of a contact that arrived deep is felt yet, see contact_ramp.h. */
typedef struct hapi_ramp {
  double depth;  /* m, at the last tick */
  double share;  /* 0..1, of the force */
  double excess; /* m, of the depth that does not count */
  bool held;     /* the excess goes by drawing back alone */
  bool late;     /* the excess is of a gap between ticks: the hand pays for what comes in */
  double given;  /* m, that came in in this tick without that, as the world's work */

  /* Of the energy observer, at the last tick: */
  double felt_share; /* with what the guard took */
  double felt;       /* what the guard left of friction */
  double felt_excess;
  double felt_stiffness; /* N/m */
  double sprung;         /* J in the spring, as it was felt */
  double drawn;          /* J of it in a spring that pulled */
} hapi_ramp;

/* Where the anchors of a contact's friction are. */
typedef struct hapi_friction_place {
  double anchor_pointer[3]; /* m, in the pointer's frame */
  double anchor_body[3];
  double normal_pointer[3]; /* of the surface */
  double normal_body[3];
  double
      mark_pointer[3]; /* unit, along the surface: one direction when they were set; soft finger */
  double mark_body[3];
  double stretch_body[3]; /* m, of the pointer ahead of the body, in the body's frame */
  double turn;            /* rad, likewise, about the normal */
} hapi_friction_place;

/* Friction of a pointer contact, of a sphere's by its slot; see pointer_friction.h. Of four
 * numbers: along the surface in world axes, and about the normal times the finger's radius. */
typedef struct hapi_friction {
  uint32_t generation; /* of the contact */
  uint32_t epoch;      /* of the body */
  uint64_t tick;       /* the last in which the contact was closed */
  hapi_friction_place set;
  hapi_friction_place now; /* the anchors if they were set in this tick */
  double normal[3];
  double at[3];      /* m, world: where the force acts */
  double stretch[4]; /* m, of the pointer ahead of the body */
  double speed[4];   /* m/s, at which it grows */
  double stiffness;  /* N/m, in this tick */
  double damping;    /* N s/m */
  bool rigid;        /* the contact does not give, and what slides begins anew at the next tick: */
  bool slid;         /* it did; the stiffness is the coupling's then */
  double left;       /* 0..1, share of the stretch that sliding has left in this tick */
  double pull;       /* N, of spring and damper where nothing slides */
  double axes[3][4]; /* unit, at right angles; the first along the pull */
  uint32_t axis_count; /* 2; 3 with torsion */
} hapi_friction;

#define HAPI_NO_ROW 0xffffffffu

/* Model CONTACT: the geom that is asked for its nearest point at every tick. */
typedef struct hapi_touch_shape {
  bool has; /* it is asked; else the shape may still be known, of a plane */
  hapi_shape shape;
  hap_pose pose; /* body frame */
  hapi_tag geom;
  uint64_t number; /* of the geom, beside its address, which another one may get */
  hapi_told told;  /* of its surface, into hapi_touches.triangles; where it is no shape */
} hapi_touch_shape;

/* Accelerance of the body, world axes. */
typedef struct hapi_touch_response {
  double a[6][3]; /* by one N at the contact, eq. 6 */
  double turn[6]; /* by one N m about the normal; soft finger */
} hapi_touch_response;

typedef struct hapi_local_contact {
  uint32_t slot;
  uint32_t body;
  uint32_t pointer;
  uint32_t pointer_generation;
  uint32_t generation;
  uint32_t epoch; /* of the body, when the model came */
  uint32_t tool;  /* of a hull: 1 + index into the tools; 0: of a sphere */
  uint32_t row;   /* model CONTACT: in this tick, HAPI_NO_ROW */
  bool seen;      /* rendered at least once */
  bool placed;    /* in this tick, where pointers touch several things */
  bool is_hidden; /* by what the model says; for shapes that the loop does not ask */
  double shown;   /* 0..1, in this tick: of the rest the surface goes on behind it, see seams.h */

  double point_body[3];
  double normal_body[3];
  hapi_ramp ramp;
  hapi_constrained_ball ball; /* of a sphere, in the body's frame; model CONTACT */
  double weight;              /* 0..1, share of the pointer's stiffness; of a sphere 1 */
  double force[3];            /* on the body */
  double couple[3];           /* N m, on the body about the contact point; friction */
  double normal_now[3];       /* model CONTACT, and of hulls all: world, out of the body */
  double point_now[3];
  hapi_touch_response response;
  hapi_touch_shape asked;
  hapi_touch_feel feel;
} hapi_local_contact;

/* A contact of a pointer that is a hull, beside its hapi_local_contact. */
typedef struct hapi_local_tool {
  hapi_tool_point in;
  uint32_t pair; /* index */
  uint32_t next; /* of the same pair; HAPI_SLOT_NONE: the last one */
  double member; /* 0..1: one that is new, or no longer there, comes and goes slowly */
  bool leaving;  /* no longer there */
  bool placed;   /* in this tick */
  uint32_t heir; /* scratch of adopting: 1 + the new point that goes on with it; 0: none */
  double claim;  /* 0..1, in this tick: its part of the stiffness before it is shared */
  double depth;  /* m, in this tick, less the pair's excess */
  double felt;   /* 0..1, share of the stiffness in this tick */
  hapi_friction friction;
} hapi_local_tool;

/* What the contacts of a hull with one geom have in common. */
typedef struct hapi_tool_pair {
  uint64_t key;
  uint32_t pointer;
  uint32_t first; /* of its tools, by their next */
  uint64_t group; /* as of its points */
  uint32_t ring;  /* index of the next pair of the group; itself: it is alone */
  uint64_t was;   /* scratch of adopting: group before */
  bool renewed;   /* likewise: there are new points */
  bool seen;
  hapi_ramp ramp; /* of the deepest of them */
  double depth;   /* m, of the deepest, at the last tick */
  uint64_t found; /* tick of the poses that its points were found with */
  uint64_t leapt; /* the last tick to which hull or body came by no motion */
  bool placed;    /* in the last tick, at: */
  hap_pose at;    /* of the hull, in the body's frame */
  bool sided;     /* in this tick the hull is in the geom, and its side is known: */
  hapi_tool_side side;
} hapi_tool_pair;

/* Of those that are leaving, and of new ones before the old are dropped. */
#define HAPI_TOOL_PAIRS(capacity) ((size_t)3 * (capacity)->tool_points)

/* What belongs to the contacts of hulls, in the order of these. */
typedef struct hapi_tool_world {
  hapi_local_tool *tools;           /* 2 x capacity: new ones and those that are leaving */
  hapi_local_tool *old_tools;       /* scratch of adopting */
  hapi_local_contact *old_contacts; /* likewise */
  hapi_tool_pair *pairs;            /* HAPI_TOOL_PAIRS */
  uint32_t count;
  uint32_t pair_count;
  uint32_t capacity; /* hapi_capacity.tool_points */
  uint64_t found;    /* as of the pairs, of the newest points */
} hapi_tool_world;

/* The tools of all pairs of a group, from the first of one of them on:
 * hapi_tool_walk at = hapi_tool_walk_begin(w, pair); at.tool != HAPI_SLOT_NONE; */
typedef struct hapi_tool_walk {
  uint32_t tool;
  uint32_t pair;
  uint32_t begin;
} hapi_tool_walk;

/* On to the next pair that has tools. */
static inline void hapi_tool_walk_turn(const hapi_tool_world *w, hapi_tool_walk *io)
{
  while (io->tool == HAPI_SLOT_NONE && w->pairs[io->pair].ring != io->begin) {
    io->pair = w->pairs[io->pair].ring;
    io->tool = w->pairs[io->pair].first;
  }
}

static inline hapi_tool_walk hapi_tool_walk_begin(const hapi_tool_world *w, uint32_t pair)
{
  hapi_tool_walk at = {w->pairs[pair].first, pair, pair};
  hapi_tool_walk_turn(w, &at);
  return at;
}

static inline void hapi_tool_walk_next(const hapi_tool_world *w, hapi_tool_walk *io)
{
  io->tool = w->tools[io->tool].next;
  hapi_tool_walk_turn(w, io);
}

/* Cross accelerances of the model in use; contact: an index into the touches. */
typedef struct hapi_crosses {
  hapi_model_cross *of; /* capacity.crosses */
  uint32_t count;
} hapi_crosses;

/* Of the contacts of spheres, by contact slot: with what the next model's contact goes on. */
typedef struct hapi_kept_touch {
  uint32_t generation; /* of the contact; 0: nothing is kept */
  uint32_t body;
  uint32_t epoch; /* of the body */
  hapi_ramp ramp;
  hapi_constrained_ball ball;
  bool special; /* then: */
  hapi_touch_lift lift;
} hapi_kept_touch;

/* A contact that may hide others: see seams.h. */
typedef struct hapi_hider {
  double middle[3]; /* m, world: of its shape */
  double within;    /* m: what is farther from there is not hidden; HUGE_VAL: not known */
  double depth;     /* m */
  uint32_t contact; /* index */
  uint32_t pointer;
  bool aside; /* an edge on which the pointer is deep: what is beside it holds the pointer */
} hapi_hider;

typedef struct hapi_touches {
  hapi_local_contact *of; /* of spheres, then of hulls; count in all */
  uint32_t count;
  uint32_t pushing;         /* that push in this tick */
  uint32_t close;           /* spheres' with shapes that touched in the last tick, or nearly */
  bool rubs;                /* some contact rubs */
  hapi_kept_touch *kept;    /* capacity.contacts */
  hapi_friction *frictions; /* by contact slot; of spheres */
  hapi_hider *hiders;       /* scratch of seams.c; capacity.contacts */
  hapi_tool_world tool;
  hapi_crosses crosses;
  hapi_pair_feel *feels;     /* capacity.feels */
  hapi_pair_feel *old_feels; /* scratch of adopting */
  uint32_t feel_count;
  bool magnets; /* some surface pulls in this tick */
  hapi_texture_calls textures;
  uint32_t unsound; /* index + 1 of a pointer that touches a texture without height; 0: none */
  hapi_triangle *triangles; /* of the model, each in its body's frame; capacity.triangles */
  uint64_t contact_ticks;   /* in which something pushed; this and the next since start */
  double hand_impulse[3];   /* N s on dynamic bodies, all pointers */
  double hand_impulse_abs;
} hapi_touches;

/* Whether the contact has a shape that can be asked: others hide nothing, and are not hidden. */
static inline bool hapi_touch_has_shape(const hapi_local_contact *c)
{
  return c->asked.has || c->asked.shape.kind == HAPI_SHAPE_PLANE;
}

/* What is kept of the contact. */
static inline hapi_friction *hapi_friction_of(const hapi_touches *touches,
                                              const hapi_local_contact *contact)
{
  return contact->tool != 0 ? &touches->tool.tools[contact->tool - 1].friction
                            : &touches->frictions[contact->slot];
}

/* What was begun in this tick; NULL: nothing. */
static inline hapi_friction *hapi_friction_now(const hapi_touches *touches, uint64_t tick,
                                               const hapi_local_contact *contact)
{
  hapi_friction *f = hapi_friction_of(touches, contact);
  bool acts = contact->feel.rubs && f->generation == contact->generation && f->tick == tick;
  return acts ? f : NULL;
}

/* Contacts of the pointer begin as those do that arrive deep. HAPI_SLOT_NONE: of all pointers. */
static inline void hapi_touches_forget(const hapi_touches *touches, uint32_t pointer)
{
  for (uint32_t i = 0; i < touches->count; ++i) {
    if (pointer == HAPI_SLOT_NONE || touches->of[i].pointer == pointer) {
      touches->of[i].seen = touches->of[i].ball.known = false;
    }
  }
  for (uint32_t i = 0; i < touches->tool.pair_count; ++i) {
    if (pointer == HAPI_SLOT_NONE || touches->tool.pairs[i].pointer == pointer) {
      touches->tool.pairs[i].seen = touches->tool.pairs[i].sided = false;
      touches->tool.pairs[i].found = 0;
    }
  }
}

/* The contacts of hulls. */
static inline hapi_local_contact *hapi_touches_of_tools(const hapi_touches *touches)
{
  return &touches->of[touches->count - touches->tool.count];
}

#endif
