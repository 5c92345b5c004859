/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_BODY_H
#define HAPODE_LOCAL_BODY_H

/* The bodies of the local world, and what is asked of one of them again and again. */

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#include "base/vec.h"
#include "sync/messages.h"

/* Totals that physics is told. */
typedef struct hapi_body_account {
  uint64_t left_tick; /* not live: since this tick, and nothing of the body has changed since */
  double impulse[3];
  double angular_impulse[3];
  double residual_taken[6]; /* of eq. 14, what has been added so far */
  double gain[6];
} hapi_body_account;

/* Of a body that the loop moves by its accelerance. */
typedef struct hapi_body_linear {
  double residual[6];     /* of eq. 14, to be added in this tick */
  double acceleration[6]; /* sum of A f in this tick; 0 between ticks, of a body that answers */
  double b[6];
} hapi_body_linear;

/* Model IMPULSE: pose at adoption, and pose to reach. */
typedef struct hapi_body_shown {
  hap_pose from;
  hap_pose to;
} hapi_body_shown;

/* Where the loop let go of a body that it owned. */
typedef struct hapi_body_left {
  hap_pose pose;
  hap_twist twist;
} hapi_body_left;

/* Whether the body stands still with its island, see body_still.h. */
typedef struct hapi_body_still {
  uint32_t island;   /* 1 + slot of one of its bodies; 0: it does not */
  uint32_t parent;   /* scratch of finding islands: a slot */
  uint32_t quiet;    /* ticks in a row in which it hardly moved, while it is not still */
  bool touched;      /* a contact carries it */
  bool ends;         /* of the island's one body, this and the next two: it wakes in this tick */
  uint32_t contacts; /* that have rows while it is awake */
  uint32_t found;    /* of those, in this tick; scratch */
  double motion;     /* m/s, when quiet began; while it is still these stay as they are: */
  uint64_t stay;     /* number */
  hap_pose pose;
  double free[6]; /* velocity after a tick in which nothing touched it */
} hapi_body_still;

/* Since when the body has hardly turned, see body_stay.h. A tick reads the first three of each
 * contact's bodies. */
typedef struct hapi_body_stay {
  uint64_t number; /* no other stay of any body has it; 0: none */
  double moved[6]; /* m, rad about world axes, from the pose at its begin to that of this tick */
  bool slow;       /* may be about to rest */
  bool waiting;    /* this and the next three: at its begin */
  uint32_t flags;
  uint32_t row;
  hap_pose pose;
  double most_way;  /* m, against another body, while a contact of both is flat */
  double most_turn; /* rad, of each component, before the stay ends */
  double speed;     /* m/s, sum of the components' sizes */
  double spin;      /* rad/s, likewise */
  hapi_body_still still;
} hapi_body_stay;

/* Of a copy of a body that another loop moves. */
typedef struct hapi_body_draw {
  bool any;
  double left[6];  /* m, rad about world axes: how far that one is away */
  hap_twist twist; /* of that one */
  double gain[3];  /* N s: of pointers up to the last tick */
} hapi_body_draw;

/* Hundreds of them are more than a near cache holds: what every tick reads or tells stands
 * together, first that of all models, then that of some; what a sync writes and few ask for comes
 * last. */
typedef struct hapi_local_body {
  uint32_t generation;
  uint32_t flags;
  uint32_t epoch;
  uint32_t row; /* place in the solver's velocities */
  bool live;    /* in the model in use */
  bool pushed;  /* since it was adopted */
  bool round;   /* the same inertia about all axes: it does not turn with them */
  bool forced;  /* the application pushes it */
  bool rowed;   /* scratch: it has a row in this tick */
  bool waiting; /* for its first contacts: goes on with its twist until they are known */
  hap_pose pose;
  hap_twist twist;
  hapi_body_account account;
  int64_t owned_until_ns;

  /* Model CONTACT. */
  uint64_t entered_model;    /* with which the loop came to own the body */
  double start_twist[6];     /* before this tick */
  double rotation[9];        /* of pose */
  double inverse_mass;       /* 0 where it is not used: driven and measured ones */
  double inverse_inertia[9]; /* world */
  hapi_body_stay stay;

  hapi_body_linear linear;
  hapi_model_body given; /* of the newest model */
  hapi_body_shown shown;
  hapi_body_left left;
  hapi_body_draw draw;
} hapi_local_body;

/* Of a driven body: how physics expects it to go, and what the loop was off by when it was told. */
typedef struct hapi_body_course {
  bool known;
  int64_t begin_ns;
  hapi_model_course in;
  int64_t told_ns; /* when the loop was apart by: */
  double apart[6]; /* m, rad, ahead of the course; it fades */
} hapi_body_course;

typedef struct hapi_bodies {
  hapi_local_body *of;       /* by slot, capacity.bodies */
  hapi_body_course *courses; /* likewise */
  uint32_t *live;            /* slots in the model, live_count */
  uint32_t live_count;
  uint32_t braced;         /* of the model */
  uint32_t copies;         /* likewise, of bodies that another loop moves */
  uint32_t high;           /* beyond the highest slot that was ever used */
  uint32_t resting;        /* at the tick's begin */
  uint64_t stays;          /* numbers of hapi_body_stay that were given, since start */
  uint32_t still;          /* that stand still, see body_still.h */
  uint32_t quiet;          /* that may soon, in this tick */
  bool never_still;        /* all are awake: what else must come out the same, for tests */
  bool exact;              /* stays of all are as short as those of slow ones */
  bool unsound;            /* a state was not finite in this tick */
  double given;            /* J, of this tick: what things of given motion did on owned bodies */
  double owned_impulse[3]; /* since start, see hapi_state */
} hapi_bodies;

/* NULL: the static world. */
static inline hapi_local_body *hapi_bodies_at(const hapi_bodies *bodies, uint32_t slot)
{
  return slot == HAPI_SLOT_NONE ? NULL : &bodies->of[slot];
}

static inline void hapi_body_point(const hapi_local_body *body, const double local[3],
                                   double out[3])
{
  if (body == NULL) {
    hapi_v3_copy(local, out);
    return;
  }
  hapi_m3_apply(body->rotation, local, out);
  hapi_v3_add(out, body->pose.position, out);
}

/* Where a body is whose geom was part of the static world: of the newest model, at its begin. */
static inline const hap_pose *hapi_body_frame_at_begin(const hapi_bodies *bodies, uint32_t slot)
{
  const hapi_model_course *course = &bodies->courses[slot].in;
  return course->begins != 0 ? &course->before : &bodies->of[slot].pose;
}

/* From the world to the body's frame. */
static inline void hapi_body_unpoint(const hapi_local_body *body, const double place[3],
                                     double out[3])
{
  if (body == NULL) {
    hapi_v3_copy(place, out);
    return;
  }
  double apart[3];
  hapi_v3_sub(place, body->pose.position, apart);
  hapi_m3_apply_transposed(body->rotation, apart, out);
}

static inline void hapi_body_vector(const hapi_local_body *body, const double local[3],
                                    double out[3])
{
  if (body == NULL) {
    hapi_v3_copy(local, out);
    return;
  }
  hapi_m3_apply(body->rotation, local, out);
}

/* Whether impulses of the loop move it: not what is driven or asleep. A body outside of the range
 * answers with its own mass until physics says what became of it: as a wall it would take the whole
 * push of an interval and hand it on too late, which is unstable. */
static inline bool hapi_body_responds(const hapi_local_body *body)
{
  return body != NULL && (body->flags & (HAPI_BODY_DRIVEN | HAPI_BODY_RESTING)) == 0;
}

static inline bool hapi_body_rests(const hapi_local_body *body)
{
  return body != NULL && (body->flags & HAPI_BODY_RESTING) != 0;
}

/* Of the loop: it moves and owns the body. */
static inline bool hapi_body_is_owned(const hapi_local_body *body)
{
  return body != NULL && (body->flags & HAPI_BODY_OWNED) != 0;
}

/* Of physics: the loop moves along with it, or pushes it on physics' account. */
static inline bool hapi_body_is_given(const hapi_local_body *body)
{
  return body != NULL && (body->flags & HAPI_BODY_OWNED) == 0;
}

/* From the centre of mass to a point of the world. */
static inline void hapi_body_arm(const hapi_local_body *body, const double point[3], double out[3])
{
  if (body != NULL) {
    hapi_v3_sub(point, body->pose.position, out);
  }
}

/* Of a torque, to the angular velocity of a body that answers by its mass. */
static inline void hapi_body_spin_up(const hapi_local_body *body, const double torque[3],
                                     double out[3])
{
  if (body->round) {
    hapi_v3_scale(body->inverse_inertia[0], torque, out);
  } else {
    hapi_m3_apply(body->inverse_inertia, torque, out);
  }
}

/* Eq. 6. Only of a contact that is the only thing to touch the body: rows of one body that answer
 * by different matrices make energy, without bound where they are many. */
static inline bool hapi_body_has_own_probes(const hapi_local_body *body)
{
  return body != NULL &&
         (body->flags & (HAPI_BODY_MEASURED | HAPI_BODY_WHOLE)) == HAPI_BODY_MEASURED;
}

#endif
