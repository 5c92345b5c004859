/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_POINTER_POINTER_H
#define HAPODE_POINTER_POINTER_H

/* A pointer as the tick knows it: its shape and surface, the device in and out, the coupling
 * between device and pointer, and the body behind a spring that it may be (a proxy). World frame
 * and SI units where nothing else is said. Zeroed: no pointer. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/pointer.h>
#include <hapode/spatial.h>

#include "pointer/belief.h"
#include "pointer/declared.h"
#include "pointer/grab.h"
#include "pointer/holds.h"
#include "pointer/swings.h"
#include "pointer/transient.h"
#include "pointer/velocity.h"
#include "sync/messages.h"

typedef struct hapi_pointer_shape {
  uint32_t collide_bits;
  double radius;
  const hapi_tool_hull *hull; /* NULL: a sphere */
  double extent;              /* m, from the origin to the farthest point of the surface */
} hapi_pointer_shape;

typedef struct hapi_pointer_surface {
  double stiffness;
  double damping;
  double friction;
  double finger_radius; /* m, of the torsion; 0: none */
  double hardest; /* N/m, of the surfaces near it that have a stiffness of their own; 0: none */
} hapi_pointer_surface;

/* At the device. */
typedef struct hapi_device_limits {
  double max_force;   /* N */
  double max_torque;  /* N m */
  double slew_force;  /* N/s */
  double slew_torque; /* N m/s */
} hapi_device_limits;

/* Device frame and units. */
typedef struct hapi_pointer_device {
  bool three_dof; /* no torque; it does not turn a hull */
  bool turns;     /* the pointer turns with it and gives it torque; else only friction goes by it */
  bool feels_torque;  /* torque is worked out, and given to a device that can take it */
  bool aligned;       /* its axes are the world's: no turning to be worked out */
  bool estimates;     /* twist is made of poses by hapi_velocity, not read */
  bool placed;        /* there was a pose that could be used */
  bool jumped;        /* between the last one and this one; see coupling.c */
  uint32_t buttons;   /* in */
  double jump_s;      /* s, > 0: contacts that arrive deep are so because of a jump */
  double stood;       /* 0..1, share of the time since the last read in which ticks were missed */
  bool slow;          /* so many were missed of late that bodies are in slow motion */
  double speed_limit; /* m/s, that a hand can make; 0: none */
  double motion_scale;
  double force_scale;
  hap_pose pose_world_device;
  hap_pose pose;     /* in */
  hap_twist twist;   /* in */
  hap_wrench wrench; /* out, scaled and limited */
  hap_pose good;     /* the last pose that could be used */
  hapi_device_limits limits;
} hapi_pointer_device;

/* Stiffnesses as felt in the world: the device's / (motion_scale force_scale). The turning is of a
 * hull only. */
typedef struct hapi_pointer_coupling {
  hap_coupling kind;           /* asked for */
  hap_integration integration; /* model CONTACT */
  hap_coupling_reason reason;  /* of what it is now */
  bool hold_known;
  double hold; /* N/m, what the device can hold; HUGE_VAL: not known */
  double stiffness;
  double damping;
  double mass;              /* kg, of the proxy */
  double spin_stiffness;    /* N m/rad */
  double spin_damping;      /* N m s/rad */
  double inertia;           /* kg m^2, of the proxy */
  double idle_s;            /* s, that a proxy of coupling AUTO has touched nothing */
  double near_stiffness;    /* N/m, sum over the contacts near the pointer, as they are found */
  double contact_stiffness; /* N/m, the same of the last tick, whole */
  hapi_pointer_holds own;
} hapi_pointer_coupling;

/* Where the device's frame is in the world at time_ns, and how it goes on from there. */
typedef struct hapi_frame_base {
  hap_pose pose;
  hap_twist twist;
  int64_t time_ns;
} hapi_frame_base;

/* How the device's frame lies and moves, see frame.c. */
typedef struct hapi_pointer_frame {
  bool used; /* else it stands, as pose_world_device */
  bool clutched;
  bool rebased; /* since the last placing */
  bool leaps;   /* likewise: by no motion */
  bool leapt;   /* in this tick */
  bool stands;  /* a new scale is about where the pointer is */
  hapi_frame_base base;
  double scale_before; /* of the last placing, where it is another one now; else 0 */
  double index[3];     /* m, device frame */
  double index_turn[4];
  hap_pose seen;      /* device less the index, at the last placing */
  hap_pose last;      /* device, likewise */
  double lag[3];      /* m */
  double lag_turn[3]; /* 2 sin(angle / 2) along the axis */
  double lag_s;       /* s, until it has ended */
  hap_twist carries;  /* share of the handle's velocity that is not the hand's */
  double step[3];     /* m, likewise of its way in this tick */
  double turned[3];   /* rad */
  double carried[3];  /* m, sum of the steps, also of leaps */
} hapi_pointer_frame;

/* A number on its way to another one. */
typedef struct hapi_glide {
  double to;
  double left_s; /* 0: it is there */
} hapi_glide;

/* What was set, and is not there yet, see lib/haptic/pointer_settings.c. */
typedef struct hapi_pointer_glides {
  bool any;
  bool limits;
  bool stands; /* while the scale changes the pointer does not move */
  hapi_glide motion_scale;
  hapi_glide force_scale;
  hapi_glide stiffness;
  hapi_glide damping;
  hapi_glide friction;
  hapi_glide finger_radius;
  hapi_device_limits wanted;
} hapi_pointer_glides;

/* Where the device is in the world. */
typedef struct hapi_pointer_handle {
  bool foreign; /* of another session's device: the application does not hear of it */
  double position[3];
  double velocity[3];
  double quat[4];
  double spin[3]; /* rad/s */
} hapi_pointer_handle;

/* The body behind the spring, model CONTACT. */
typedef struct hapi_pointer_proxy {
  uint32_t row;    /* place in the solver's velocities; 0: direct */
  double response; /* 1/kg, change of its velocity by one N s */
  double position[3];
  double velocity[3];
  double offset[3];        /* m, from the device to the end of the spring, shrinking */
  double free_velocity[3]; /* m/s, with nothing in touch */
  double spin_response;    /* 1/(kg m^2) */
  double quat[4];
  double spin[3];        /* rad/s */
  double offset_turn[3]; /* rad */
  double free_spin[3];   /* rad/s */
} hapi_pointer_proxy;

/* How a proxy moves in this tick whose contacts do not give: god-object and virtual tool. */
typedef struct hapi_rigid_move {
  double reach;      /* m, how far it may come */
  double speed_most; /* m/s, rad/s: along the way to where the device is */
  double spin_most;
  uint32_t near_rows; /* contacts within reach */
  bool pushed_out;    /* it moves by velocity */
  double velocity[6];
  double
      carried[6]; /* of a god-object: that of the bodies under it, as far as forces leave it out */
} hapi_rigid_move;

/* What may change the pointer's force in a tick, see local/explained.h. World units. */
typedef struct hapi_explained {
  double stiffness; /* N/m, sum over the contacts that push */
  double damping;   /* N s/m */
  double speed;     /* m/s, of the fastest surface */
  double world;     /* N, by motion of the surfaces, and by contacts that come in slowly */
  double torque;    /* N m, by turning of what is held */
} hapi_explained;

/* The bound on changes of a force: what is known of the last tick. Device frame and units. */
typedef struct hapi_change_bound {
  double velocity[3];       /* m/s, of the device */
  double carried[3];        /* m/s, world: of its base */
  bool doubted;             /* the device */
  bool held_back;           /* the energy observer took of the force: not all is back */
  hapi_explained explained; /* of this tick, and of the one before: */
  hapi_explained before;
  hap_wrench came;   /* of what is wanted: what the bound has let in */
  double share;      /* 0..1, of it that ramps, age and doubt left */
  double most_force; /* N, N m: by which the force of a doubted device may change */
  double most_torque;
} hapi_change_bound;

/* What the guard keeps of a pointer. Device frame and units where nothing else is said; zeroed: a
 * pointer that has just come. */
typedef struct hapi_guard_pointer {
  bool fades;         /* the ramp goes down: a clutch is held, or a shape waits */
  double share;       /* 0..1, of the ramp-in */
  double late_loss;   /* 0..1, share of the force that late ticks have taken */
  bool placed;        /* position and moved are of the device as it is now */
  double position[3]; /* at the last tick */
  double quat[4];
  double moved[3];  /* since the tick before */
  double turned[3]; /* rad, likewise, of a device that gives torque */
  hapi_change_bound change;
  hap_wrench wanted;  /* before the guard */
  hap_wrench written; /* at the last tick; in force until the next write */
  hap_wrench contact; /* of that, without what was declared */
  uint32_t flags;     /* hap_guard_flag, of the last tick */
  double limit;       /* N in the world, of the device */
  double felt;        /* 0..1, share after ramp-in and age */
  double force2;      /* N^2, of this tick: sum over the contacts, other models than CONTACT */
  double power;       /* W, likewise: of the bodies on the springs */
  /* Of the depth that gaps held back, what comes in in the next tick: */
  double paid_way;    /* m, that the hand has paid for */
  double given_share; /* 0..1, of the rest: the world's work */
  hapi_swings swings;
} hapi_guard_pointer;

typedef struct hapi_pointer {
  uint32_t generation; /* 0: no pointer here */
  uint32_t contacts;   /* that push */
  bool proxied;        /* it is a proxy, of whatever coupling */
  bool rigid;          /* one whose contacts do not give: god-object and virtual tool */
  bool own;            /* it has own forces: tick/own_forces.h */
  bool has_axes;       /* pointer/axes.h */
  bool drives;         /* outputs beside the wrench were set: tick/outputs.h */
  hap_pose pose;
  hap_twist twist;
  hap_wrench wrench; /* on the hand: of contacts; after the guard with what is declared */
  hapi_declared declared;
  hapi_transients transients;
  hapi_pointer_shape shape;
  hapi_pointer_surface surface;
  hapi_pointer_device device;
  hapi_pointer_coupling coupling;
  hapi_pointer_handle handle;
  hapi_pointer_proxy proxy;
  hapi_rigid_move rigid_move;
  hapi_guard_pointer guard;
  hapi_velocity velocity;
  hapi_pointer_belief belief;
  hapi_pointer_frame frame;
  hapi_pointer_glides glides;
  hapi_grab grab;
} hapi_pointer;

typedef struct hapi_pointers {
  hapi_pointer *of;      /* capacity.pointers */
  hapi_tool_hull *hulls; /* likewise */
  uint32_t high;         /* from here on no pointer has come yet; before it some may have left */
  bool proxies;          /* some pointer is or may become one */
  bool pushes;           /* in this tick some own force is bound to a body */
  bool grabs;            /* some pointer holds something, or may */
} hapi_pointers;

#endif
