/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SURFACE_H
#define HAPODE_SURFACE_H

/* How a pointer feels a geom (docs/surfaces.md). The application says it in the callback
 * hap_ode_def.pointer_surface of hapode/ode.h. */

#include <stddef.h>
#include <stdint.h>

#include <hapode/attributes.h>
#include <hapode/session.h>
#include <hapode/status.h>

HAP_BEGIN_DECLS

/* The surface of a geom against a pointer. It comes to the callback with what the pointer has of
 * its own (hap_pointer_def). A member that is left as it came stays the pointer's. It has a size
 * and may grow at its end. */
typedef struct hap_surface {
  uint32_t size; /* set by the library: of its build; members behind it are not read */
  /* 1 as it comes. 0: the pointer goes through the geom, as through a trigger volume. */
  uint32_t touchable;
  double stiffness; /* N/m, 0..1e9, of the contact, in place of hap_pointer_def.stiffness */
  double damping;   /* N s/m, 0..1e6, likewise */
  /* Coulomb friction: of a touch that sticks, and of one that slides, 0..10; above 10 is taken as
   * 10. Both come with hap_pointer_def.friction. A static one below the dynamic one is taken as
   * the dynamic one. */
  double friction_static;
  double friction_dynamic; /* of a touch that slides */
  uint32_t texture;        /* of hap_session_add_texture; 0, as it comes: smooth */
  /* What the material sounds like to the hand: at a touch with the speed v the hand feels
   * impact_force v exp(-impact_decay t) sin(2 pi impact_hz t) along the normal, beside the
   * contact's force; at most 5 N and 1 W in all. The body does not. It begins in the tick of the
   * touch. */
  double impact_force; /* N s/m, 0..1000; 0, as it comes: none */
  double impact_decay; /* 1/s, 10..10000; comes with 80 */
  double impact_hz;    /* Hz, 5..1000 and at most a fourth of haptic_hz; comes with 100 */
  /* N, 0..100: what a touch holds the hand with when it draws back, as sticky tape does. The
   * contact's spring then pulls, until the pull comes to this or the hand is 10 mm off; then the
   * touch is over. A hand that comes is not pulled. The body gets the opposite force. Friction goes
   * by the normal force plus this. Points of a hull share it. 0, as it comes: none. */
  double adhesion;
  /* N, 0..100: the surface pulls the pointer to its nearest point, from magnet_reach above it on,
   * with this force at 0.58 of the reach, and with none where the two meet: as HAP_FORCE_MAGNET,
   * declared as that is. The body gets the opposite force, in models CONTACT and SINGLE; in the
   * others bodies that move do not pull. Where that is steeper, at the surface, than the device can
   * hold, less is felt, and the log says so once. 0, as it comes: none. */
  double magnet_force;
  double magnet_reach; /* m, 0.001..hap_ode_def.magnet_reach; comes with that */
} hap_surface;

/* [haptic] m, -0.003..0.003: the height of a surface over a geom, at a point of the geom's frame;
 * of a plane that of the world. What is beyond the bounds is cut off. It is called in the tick,
 * five times for each contact: the tick waits for it. Where it takes longer than call_most_s of
 * hap_texture_def again and again, it is not called any more. It must give the same for the same
 * point, in any thread, and neither wait, allocate nor call the system. A height that is not finite
 * is HAP_FAULT_FORCE. */
typedef double (*hap_height_fn)(void *arg, const double point[3]);

/* A texture: heights of a surface over a geom, felt as force along and across it. A patch of
 * samples or a function. It has a size and may grow at its end. */
typedef struct hap_texture_def {
  uint32_t size;   /* set by hap_texture_def_init */
  uint32_t cookie; /* set by hap_texture_def_init */
  /* m, -0.003..0.003, row after row: heights[row * columns + column]; copied. Between samples the
   * surface is a cubic. NULL (default): a function. */
  const double *heights;
  int32_t columns;  /* 1..4096 */
  int32_t rows;     /* 1..4096 */
  double pitch;     /* m, from sample to sample, 1e-6..1, default 1e-3 */
  uint32_t repeats; /* 1 (default): the patch lies side by side; 0: its border goes on */
  /* Unit vectors of the geom's frame, at right angles: the way of the columns and that of the rows;
   * default x and y. Along their cross product the height is the same. */
  double along_columns[3];
  double along_rows[3]; /* the way of the rows */
  double origin[3];     /* m, geom's frame: where the first sample is; default 0 */

  hap_height_fn height; /* without heights; default NULL */
  void *arg;            /* handed to it; the caller's, until the session is destroyed */
  /* s, 0..0.5 of a haptic period, that all calls of height of a tick may take; 0 (default): 0.1 of
   * the period */
  double call_most_s;
} hap_texture_def;

/* [any] Fills *def with defaults. size_of_def: sizeof *def of the caller's build. */
HAP_API void hap_texture_def_init(hap_texture_def *def, size_t size_of_def);

/* [any] Makes a texture, also while the session runs. It is there until the session is destroyed;
 * at most 64. *out_texture: for hap_surface.texture. HAP_ERROR_ARGUMENT, HAP_ERROR_UNINITIALISED:
 * hap_session_detail names the field. HAP_ERROR_CAPACITY: there are 64. HAP_ERROR_MEMORY. */
HAP_NODISCARD HAP_API hap_status hap_session_add_texture(hap_session *session,
                                                         const hap_texture_def *def,
                                                         uint32_t *out_texture);

/* How the function of a texture does, since hap_session_start. It has a size and may grow at its
 * end. A texture of samples has 0 everywhere. Times are wall-clock, also in LOCKSTEP. */
typedef struct hap_texture_state {
  uint32_t size;       /* bytes filled in */
  uint32_t is_out;     /* 1: it was too late, and its geoms are smooth */
  uint64_t ticks;      /* that called it */
  uint64_t late_ticks; /* those in which it took longer than call_most_s */
  double us_mean;      /* us, of all calls of a tick */
  double us_max;       /* us, the longest tick's calls */
} hap_texture_state;

/* [any] State of a texture. size_of_out: sizeof *out of the caller's build. HAP_END: its function
 * took longer than call_most_s for the third time within about a second, or longer than 35 ms, and
 * is not called any more until the session is started again. HAP_EVENT_TEXTURE_OUT and the log tell
 * that, too. In drive LOCKSTEP time is measured and not judged; a replay has it from the recording.
 * HAP_ERROR_NOT_FOUND: no such texture. HAP_ERROR_ARGUMENT: a NULL, or no room for the size. */
HAP_API hap_status hap_session_get_texture(hap_session *session, uint32_t texture,
                                           hap_texture_state *out, size_t size_of_out);

HAP_END_DECLS

#endif
