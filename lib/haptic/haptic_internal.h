/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_HAPTIC_HAPTIC_INTERNAL_H
#define HAPODE_HAPTIC_HAPTIC_INTERNAL_H

/* Shared by the files of lib/haptic. */

#include <pthread.h>
#include <stdatomic.h>

#include <hapode/device_impl.h>

#include "base/effect_figures.h"
#include "base/histogram.h"
#include "base/pulse.h"
#include "base/thread.h"
#include "device/device.h"
#include "device/watchdog.h"
#include "haptic/grab_box.h"
#include "haptic/haptic.h"
#include "haptic/outputs_box.h"
#include "haptic/own_hands.h"
#include "haptic/settings_box.h"
#include "haptic/target.h"
#include "record/tape.h"
#include "sync/triple_buffer.h"
#include "tick/black_box.h"
#include "tick/telling.h"
#include "tick/tick.h"

typedef enum hapi_pointer_phase {
  HAPI_POINTER_EMPTY = 0,
  HAPI_POINTER_ADDED = 1,   /* by the application, not yet seen by the loop */
  HAPI_POINTER_ACTIVE = 2,  /* the loop uses it */
  HAPI_POINTER_LEAVING = 3, /* to be let go by the loop */
  HAPI_POINTER_LEFT = 4,    /* let go; the application cleans up */
  HAPI_POINTER_PAUSING = 5, /* as LEAVING and LEFT, and its id stays valid: */
  HAPI_POINTER_PAUSED = 6   /* its device is being started again, or did not start */
} hapi_pointer_phase;

typedef struct hapi_pointer_slot {
  _Atomic int phase;
  _Atomic uint32_t generation; /* written while EMPTY */
  hapi_pointer_setup def;      /* hull_xyz NULL: the vertices are copied */
  hapi_tool_hull hull;
  const hap_device_ops *ops; /* NULL: moved by hap_pointer_set_target */
  void *self;
  hapi_effector *effector; /* NULL: likewise */
  bool has_device;         /* also in a replay, where there are no ops */
  bool started;
  hap_device_info info;
  hap_axis_info axes[HAP_AXES_MAX]; /* info.axis_count */
  pthread_mutex_t lock;             /* between applications that set, get, ask and remove */
  hapi_triple_buffer target_buffer;
  hapi_pointer_target targets[3];
  hapi_own_list own;
  hapi_triple_buffer state_buffer;
  hap_pointer_state states[3];
  hapi_pointer_settings_box set;
  hapi_outputs_box outputs;
  hapi_grab_box grab;
} hapi_pointer_slot;

/* Published for the statistics; each written by the haptic thread alone. */
typedef struct hapi_loop_figures {
  hapi_histogram tick_ns;
  hapi_histogram wake_ns; /* from a deadline to the loop's waking up for it */
  _Atomic uint64_t ticks;
  _Atomic uint64_t missed_ticks;
  _Atomic uint64_t models_adopted;
  _Atomic uint64_t contact_passes;
  _Atomic uint64_t trace_dropped;
  _Atomic uint64_t hash;
  _Atomic int model;
  _Atomic int64_t age_ns; /* of the model */
  _Atomic int64_t age_max_ns;
} hapi_loop_figures;

typedef struct hapi_solver_figures {
  _Atomic uint64_t sweeps;
  _Atomic double residual;
  _Atomic uint64_t unsolved_ticks;
  _Atomic uint32_t local_contacts;
} hapi_solver_figures;

typedef struct hapi_fault_figures {
  _Atomic uint64_t count;
  _Atomic int fault;
  _Atomic uint64_t fault_pointer;
  _Atomic uint64_t stale_times;
  _Atomic uint64_t stale_ticks;
} hapi_fault_figures;

typedef struct hapi_hand_figures {
  _Atomic uint64_t contact_ticks;
  _Atomic uint64_t saturated_ticks;
  _Atomic uint64_t slewed_ticks;
  _Atomic uint64_t energy_ticks;
  _Atomic uint64_t derated_ticks;
  _Atomic uint64_t oscillation_ticks;
  _Atomic double peak_force;
  _Atomic double impulse[3];
  _Atomic double impulse_abs;
} hapi_hand_figures;

typedef struct hapi_haptic_figures {
  hapi_loop_figures loop;
  hapi_solver_figures solver;
  hapi_fault_figures faults;
  hapi_hand_figures hand;
} hapi_haptic_figures;

/* States that the loop tells: of what pointers have. */
enum {
  HAPI_LOOP_TORQUE,
  HAPI_LOOP_PROXY,
  HAPI_LOOP_OBSERVER,
  HAPI_LOOP_NOTED
};

typedef struct hapi_loop_effects {
  uint64_t begin; /* cycles, of the sampled tick */
  _Atomic uint64_t samples;
  _Atomic double spent_ns[HAP_EFFECTS];
  _Atomic uint64_t shown[HAPI_LOOP_NOTED];
} hapi_loop_effects;

/* One writer (haptic), one reader (application). */
typedef struct hapi_trace_ring {
  hap_trace_row *rows;
  uint32_t capacity;
  _Atomic uint64_t written;
  _Atomic uint64_t read;
} hapi_trace_ring;

/* What the application has asked for. */
enum {
  HAPI_ASKED_TOUCHES = 1,
  HAPI_ASKED_CONTACTS = 2,
  HAPI_ASKED_EVENTS = 4
};

/* Touches of a pointer, or contacts of bodies, at one tick. */
typedef struct hapi_told_list {
  hapi_triple_buffer buffer;
  uint32_t counts[3];
  uint32_t generations[3]; /* of the pointer */
} hapi_told_list;

/* What ticks tell the application, once it has asked. */
typedef struct hapi_told_things {
  _Atomic uint32_t asked;
  pthread_mutex_t lock; /* between those who ask */
  hapi_telling telling;
  hapi_told_list *of_pointers;
  hapi_told_list of_bodies;
  hap_touch *touches;         /* HAP_TOUCHES_MAX for each place of each pointer's buffer */
  hap_body_contact *contacts; /* likewise capacity.contacts for each place */
  hapi_own_hands hands;
  hapi_texture_times textures;
} hapi_told_things;

/* What watchdogs see of the loop and tell it. */
typedef struct hapi_standstill {
  hapi_pulse pulse;          /* where the loop is */
  _Atomic uint64_t blocked;  /* pulse at which it stood still; 0: the loop has heard of it */
  _Atomic uint64_t happened; /* the newest of those */
} hapi_standstill;

/* What ticks take, and what they do in it. */
typedef struct hapi_loop_time {
  double last_tick_us;
  int64_t tick_budget_ns; /* of the model in use */
  hapi_tick_load load;
  hapi_tick_work work;
} hapi_loop_time;

struct hapi_haptic {
  hapi_haptic_config config;
  hapi_tick tick;
  hapi_model *pending; /* taken, its time has not come */
  hapi_patches *pending_patches;
  hapi_pointer_slot *slots;
  hapi_trace_ring ring;
  hapi_black_box black_box;
  pthread_mutex_t black_box_lock; /* between its readers */
  hapi_haptic_figures figures;
  hapi_loop_effects effects;
  hapi_thread thread;
  _Atomic int stop;
  _Atomic int reset_fault;
  _Atomic int outside_fault; /* hap_fault that another thread wants latched */
  hapi_standstill standstill;
  hapi_told_things told;
  uint64_t emergencies; /* calls of hap_emergency_zero that the loop has seen */
  uint64_t reads;       /* of all devices, since the loop was made */
  bool begun;
  int64_t start_ns;
  hapi_loop_time time;

  hapi_tape *tape;            /* of a recording or a replay; NULL: none */
  hapi_cell *note;            /* recording: first cell of the packet */
  const hapi_cell *tick_cell; /* replay: of the tick */
  uint32_t turn;              /* whose bodies are recorded */
};

/* What other threads want of a tick. */
typedef struct hapi_loop_calls {
  bool reset;
  bool emergency;
  hap_fault outside_fault;
} hapi_loop_calls;

typedef struct hapi_loop_standstill {
  bool blocked;     /* a watchdog has taken the force off */
  uint32_t pointer; /* index + 1 of the pointer in whose device the loop was; 0: in none */
} hapi_loop_standstill;

typedef struct hapi_pointer_input {
  hap_pose pose;
  hap_twist twist;
  uint32_t buttons;
  bool failed;
  bool doubted; /* by the device itself */
} hapi_pointer_input;

typedef struct hapi_pointer_output {
  hap_wrench reached;
  bool failed;
} hapi_pointer_output;

/* tape_tick.c: nothing without a tape. Of an io a recording notes what is in it, a replay fills it
 * in. */
void hapi_tape_begin(hapi_haptic *haptic, int64_t start_ns);
void hapi_tape_begun(hapi_haptic *haptic);
void hapi_tape_tick(hapi_haptic *haptic, int64_t now_ns);
void hapi_tape_calls(hapi_haptic *haptic, hapi_loop_calls *io);
void hapi_tape_standstill(hapi_haptic *haptic, hapi_loop_standstill *io);
void hapi_tape_textures(hapi_haptic *haptic, uint64_t *io_out);
void hapi_tape_taken(hapi_haptic *haptic, bool model, bool patches);
void hapi_tape_join(hapi_haptic *haptic, uint32_t index);
void hapi_tape_leave(hapi_haptic *haptic, uint32_t index, bool pauses);
void hapi_tape_set(hapi_haptic *haptic, uint32_t index, const hapi_pointer_setting *setting,
                   const hapi_tool_hull *hull);
void hapi_tape_input(hapi_haptic *haptic, uint32_t index, hapi_pointer_input *io);
void hapi_tape_output(hapi_haptic *haptic, uint32_t index, hapi_pointer_output *io);
void hapi_tape_ticked(hapi_haptic *haptic);
/* Replay only; false: no more of them come now. */
bool hapi_tape_next_leave(hapi_haptic *haptic, uint32_t *out_index, bool *out_pauses);
bool hapi_tape_next_join(hapi_haptic *haptic, uint32_t *out_index, hapi_joined *out,
                         hap_device_info *out_info, hap_axis_info *out_axes,
                         hapi_tool_hull *out_hull);

bool hapi_tape_next_set(hapi_haptic *haptic, uint32_t index, hapi_pointer_setting *out,
                        hapi_tool_hull *out_hull);

/* loop_effects.c */
void hapi_loop_effects_reset(hapi_haptic *haptic);
void hapi_loop_sample_begin(hapi_haptic *haptic);
void hapi_loop_sample_end(hapi_haptic *haptic, int64_t spent_ns);
void hapi_loop_note_effects(hapi_haptic *haptic); /* after a model was adopted */

/* told.c */
bool hapi_told_create(hapi_haptic *haptic); /* false: no memory; destroy is due all the same */
void hapi_told_destroy(hapi_haptic *haptic);
void hapi_told_reset(hapi_haptic *haptic);                   /* a session begins */
void hapi_told_publish(hapi_haptic *haptic, uint32_t asked); /* [haptic] after a tick */

/* standstill.c: the loop stands still; who looks is a watchdog */
hap_status hapi_standstill_watch(hapi_haptic *haptic, uint32_t index);     /* starts its watchdog */
void hapi_standstill_take(hapi_haptic *haptic, hapi_loop_standstill *out); /* [haptic] */
bool hapi_standstill_pending(const hapi_haptic *haptic);                   /* [any] */
void hapi_standstill_stats(const hapi_haptic *haptic, hap_stats *io);      /* [any] */

/* pointer_settings.c: what is set while a pointer runs */
void hapi_settings_prepare(hapi_pointer_slot *slot); /* for a new user of the slot */
void hapi_pointer_set_coupling(const hapi_haptic *haptic, const hapi_pointer_slot *slot,
                               hapi_pointer *io);
void hapi_pointer_set_shape(const hapi_haptic *haptic, uint32_t index);
void hapi_settings_swap(hapi_pointer_slot *slot); /* what waits, into its def */
hapi_device_limits hapi_pointer_limits(const hapi_pointer_slot *slot);
/* [haptic] What was set since, and a tick on the way there. */
void hapi_settings_follow(hapi_haptic *haptic, uint32_t index, int64_t now_ns);

/* pointers.c: what the loop does with the slots */
/* [any] With its lock taken; NULL: it is not there. */
hapi_pointer_slot *hapi_slot_lock(hapi_haptic *haptic, hap_pointer_id id);
void hapi_pointers_follow(hapi_haptic *haptic); /* phases */
void hapi_pointers_read(hapi_haptic *haptic, int64_t now_ns);
void hapi_pointers_write(hapi_haptic *haptic);
void hapi_pointers_publish(hapi_haptic *haptic);
hap_status hapi_pointers_start_devices(hapi_haptic *haptic, hap_detail *detail);
/* False: one of them does not come back from a call. */
HAP_NODISCARD bool hapi_pointers_stop_devices(hapi_haptic *haptic);

#endif
