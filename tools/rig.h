/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_RIG_H
#define HAPODE_TOOLS_RIG_H

/* A scene with a session over it and its pointers: what hapode-run, hapode-bench and the tests set
 * up alike. */

#include <hapode/hapode.h>
#include <hapode/ode.h>

#include "scenes/scenes.h"
#include "tools/session_defs.h"

#define RIG_POINTERS_MAX 16

/* Puts a device around a pointer's one, or leaves *io as it is. */
typedef struct rig_around {
  hap_status (*put)(void *user, size_t index, hap_device **io, hap_detail *detail);
  void *user;
} rig_around;

typedef struct rig_options {
  const char *scene;                  /* "name" or "name:N" */
  const scene_parameters *parameters; /* not NULL: build from these with count, not from scene */
  /* Not NULL: this one, borrowed, with hands and pointers as in parameters. It has no threads for
   * islands */
  hap_scene *loaded;
  int count;
  /* Specs in pointer order; "virtual" alone: the scene's own simulated hand; none given: the same.
   * Further end effectors of a device take what the scene has more of hands than there are devices,
   * behind the device's first one. */
  const char *devices[RIG_POINTERS_MAX];
  size_t device_count;
  /* Pointer 0's, which the rig takes over and puts where the scene's own hand begins; NULL: as
   * devices says */
  hap_device *hardware;
  /* files for the devices; NULL: as they say themselves */
  const char *identities[RIG_POINTERS_MAX];
  double max_force;     /* N; 0: 20 */
  double stiffness;     /* N/m, of the pointers' contacts; 0: the scene's */
  double friction;      /* of the pointers; < 0: the scene's */
  double finger_radius; /* m, of the pointers; < 0: the scene's */
  hap_coupling coupling;
  double coupling_stiffness; /* N/m, of hap_pointer_def */
  double coupling_damping;   /* N s/m, likewise */
  double virtual_mass;       /* kg, likewise; 0: the default */
  int island_threads;        /* of hap_ode_def; 0: the default */
  hap_session_def def;
  hap_expert_def expert;
  hap_research_def research;
  const hap_record_def *record; /* not NULL: the session is recorded */
  hap_player *player; /* not NULL: it plays, with the def and the pointers of the recording */
  hap_integration integration; /* of the pointers */
  const rig_around *around;    /* NULL: none */
  bool serves;                 /* no pointers: they are in another process */
} rig_options;

typedef enum rig_part {
  RIG_SCENE = 0,
  RIG_SESSION,
  RIG_POINTER,
  RIG_RECORDING
} rig_part;

typedef struct rig {
  scene *scene;
  bool is_loaded; /* world and space of scene are those of rig_options.loaded */
  hap_session *session;
  hap_device *devices[RIG_POINTERS_MAX]; /* device_count */
  hap_device *inner[RIG_POINTERS_MAX];   /* what the devices are around; NULL: nothing */
  size_t device_count;
  size_t effectors_left; /* end effectors that drive no pointer */
  hap_pointer_id pointers[RIG_POINTERS_MAX];
  size_t pointer_count;
  rig_part failed; /* what it was after a rig_create that failed */
} rig;

/* Defaults: row10, coupling auto, and those of the structs of a session. */
void rig_options_init(rig_options *options);

/* dInitODE2 was called. On failure nothing is left behind, detail says why and out->failed
 * where. */
hap_status rig_create(const rig_options *options, rig *out, hap_detail *detail);
void rig_destroy(rig *r); /* zeroed allowed */

/* A model by name; on failure a text that lists what exists. */
hap_status rig_find_model(const char *name, hap_model *out, hap_detail *detail);

#endif
