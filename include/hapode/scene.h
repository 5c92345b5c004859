/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SCENE_H
#define HAPODE_SCENE_H

/* A world without ODE's types: made here, or one of the built-in scenes. For bindings, viewers and
 * programs that have no world of their own (docs/scene.md). Who has an ODE world takes
 * hapode/ode.h.
 *
 * Bodies, geoms and joints have numbers from 0, in the order in which they were added. A number is
 * never given twice; that of a removed one is HAP_ERROR_NOT_FOUND from then on.
 *
 * Thread tag [scene]: one thread at a time while the scene has no session that runs; while one
 * runs, where the world may be touched (docs/editing.md): between hap_session_lock and unlock, in a
 * posted edit, in a step function, in drive LOCKSTEP between two advances; elsewhere
 * HAP_ERROR_THREAD. SI units, right-handed frames. */

#include <stddef.h>
#include <stdint.h>

#include <hapode/attributes.h>
#include <hapode/pointer.h>
#include <hapode/session.h>
#include <hapode/spatial.h>
#include <hapode/status.h>
#include <hapode/surface.h>

HAP_BEGIN_DECLS

/* A world that the library owns. */
typedef struct hap_scene hap_scene;

#define HAP_SCENE_WORLD UINT32_MAX /* in place of a body: what never moves */

/* How a scene is made. It has a size and may grow at its end. */
typedef struct hap_scene_def {
  uint32_t size;     /* set by hap_scene_def_init */
  uint32_t cookie;   /* set by hap_scene_def_init */
  double gravity[3]; /* m/s^2, default 0 0 -9.81 */
  /* 1..10000, default 50: of ODE's solver, for what is far from the hands */
  int32_t iterations;
  double layer; /* m, 0..1, default 1e-4: depth at which bodies rest on each other */
} hap_scene_def;

/* [any] Fills *def with defaults. size_of_def: sizeof *def of the caller's build. */
HAP_API void hap_scene_def_init(hap_scene_def *def, size_t size_of_def);

/* [any, one after the other] Makes an empty scene; def NULL: defaults. Initialises ODE for the
 * calling thread. On failure *out is NULL and detail (may be NULL) says what to do.
 * HAP_ERROR_UNINITIALISED, HAP_ERROR_ARGUMENT, HAP_ERROR_MEMORY. */
HAP_NODISCARD HAP_API hap_status hap_scene_create(const hap_scene_def *def, hap_scene **out,
                                                  hap_detail *detail);

/* [any, one after the other] Makes a built-in scene: "row10", "pile:20" (hap_scene_name_at lists
 * them). HAP_ERROR_NOT_FOUND: there is none of that name; detail lists them. HAP_ERROR_ARGUMENT: a
 * wrong number behind the name, or none where there is none to give. HAP_ERROR_MEMORY. */
HAP_NODISCARD HAP_API hap_status hap_scene_load(const char *spec, hap_scene **out,
                                                hap_detail *detail);

/* [any] Names of built-in scenes, index from 0; NULL past the end. What happens there, in one line,
 * in *out_text, unless that is NULL. */
HAP_API const char *hap_scene_name_at(size_t index, const char **out_text);

/* [any, one after the other] Frees the scene. NULL is allowed. HAP_ERROR_STATE, and nothing is
 * freed: its session is to be destroyed first. */
HAP_API hap_status hap_scene_destroy(hap_scene *scene);

/* ---- what is in it ---- */

/* Shape of a geom, in its own frame. Values are never renumbered. */
typedef enum hap_shape {
  HAP_SHAPE_SPHERE = 0,   /* radius */
  HAP_SHAPE_BOX = 1,      /* edges */
  HAP_SHAPE_CAPSULE = 2,  /* radius; length without the caps, along z */
  HAP_SHAPE_CYLINDER = 3, /* radius; length along z */
  HAP_SHAPE_PLANE = 4,    /* all below z = 0; HAP_SCENE_WORLD only */
  HAP_SHAPE_MESH = 5,     /* vertices and triangles */
  HAP_SHAPE_FIELD = 6     /* heights over x and y; HAP_SCENE_WORLD only */
} hap_shape;

/* A geom. Arrays are copied. It has a size and may grow at its end. */
typedef struct hap_geom_def {
  uint32_t size;   /* set by hap_geom_def_init */
  uint32_t cookie; /* set by hap_geom_def_init */
  hap_shape shape; /* default SPHERE */
  hap_pose pose;   /* in the body's frame, or in the world; default identity */
  double edges[3]; /* m, 1e-6..1e6, BOX, default 0.1 each; FIELD: along x and y */
  double radius;   /* m, 1e-6..1e6, default 0.05 */
  double length;   /* m, 1e-6..1e6, default 0.1 */
  /* MESH: x y z of each vertex, m; three indices of each triangle, counter-clockwise as seen from
   * outside. A mesh of a body is closed. */
  const double *vertices_xyz;
  size_t vertex_count;       /* 3..16777216 */
  const uint32_t *triangles; /* MESH: indices */
  size_t triangle_count;     /* 1..16777216 */
  /* FIELD: heights, m, row by row: columns along x, rows along y, both from the lower end. */
  const double *heights;
  uint32_t columns;       /* 2..65536 */
  uint32_t rows;          /* 2..65536 */
  double density;         /* kg/m^3, 1e-6..1e6, default 1000 */
  double friction;        /* 0..1e6, default 0.5: of two geoms the geometric mean */
  double bounce;          /* 0..1, default 0: of two geoms the larger */
  float colour_rgba[4];   /* 0..1, default 0.7 0.7 0.7 1; for who draws */
  uint32_t category_bits; /* default all; two geoms meet where the bits of one meet the */
  uint32_t collide_bits;  /* collide bits of the other; pointers have collide bits as well */
} hap_geom_def;

/* [any] Fills *def with defaults. size_of_def: sizeof *def of the caller's build. */
HAP_API void hap_geom_def_init(hap_geom_def *def, size_t size_of_def);

/* A body. Its geoms are copied. It has a size and may grow at its end. */
typedef struct hap_body_def {
  uint32_t size;   /* set by hap_body_def_init */
  uint32_t cookie; /* set by hap_body_def_init */
  hap_pose pose;   /* of the body's frame in the world, default identity */
  hap_twist twist; /* of the frame's origin, default 0 */
  /* kg, 0..1e9, default 0: by volume and density. Else the geoms' masses are scaled to this sum. */
  double mass;
  uint32_t is_kinematic;     /* 1: nothing moves it but its velocity; default 0 */
  const hap_geom_def *geoms; /* each was initialised */
  size_t geom_count;         /* 1..4096; 0..4096 with has_inertia */
  /* 1: mass, centre and inertia below count, and no volume does; default 0 */
  uint32_t has_inertia;
  double centre[3]; /* m, of mass, in the body's frame */
  /* kg m^2, about the centre of mass, axes of the body's frame; symmetric, positive definite, and
   * of a real body: no eigenvalue is larger than the sum of the other two */
  double inertia[3][3];
} hap_body_def;

/* [any] Fills *def with defaults. size_of_def: sizeof *def of the caller's build. */
HAP_API void hap_body_def_init(hap_body_def *def, size_t size_of_def);

/* [scene] Adds a body with its geoms. Its frame may be anywhere: the centre of mass is found. The
 * geoms have consecutive numbers, the first in *out_geom (may be NULL). On failure nothing is added
 * and detail (may be NULL) names the field: HAP_ERROR_UNINITIALISED, HAP_ERROR_ARGUMENT,
 * HAP_ERROR_MEMORY, HAP_ERROR_THREAD. */
HAP_NODISCARD HAP_API hap_status hap_scene_add_body(hap_scene *scene, const hap_body_def *def,
                                                    uint32_t *out_body, uint32_t *out_geom,
                                                    hap_detail *detail);

/* [scene] Adds a geom that never moves. Errors as hap_scene_add_body. */
HAP_NODISCARD HAP_API hap_status hap_scene_add_geom(hap_scene *scene, const hap_geom_def *def,
                                                    uint32_t *out_geom, hap_detail *detail);

/* Kind of a joint. Values are never renumbered. */
typedef enum hap_joint_kind {
  HAP_JOINT_BALL = 0,      /* turns about any axis */
  HAP_JOINT_HINGE = 1,     /* turns about axis 0 */
  HAP_JOINT_SLIDER = 2,    /* slides along axis 0 */
  HAP_JOINT_UNIVERSAL = 3, /* turns about axis 0 of body a and axis 1 of body b */
  HAP_JOINT_HINGE2 = 4,    /* a wheel: steers about axis 0, rolls about axis 1 */
  HAP_JOINT_FIXED = 5,     /* holds the bodies as they are */
  HAP_JOINT_OTHER = 6      /* of a built-in scene; cannot be added */
} hap_joint_kind;

/* A joint between two bodies as they are. It has a size and may grow at its end. */
typedef struct hap_joint_def {
  uint32_t size;       /* set by hap_joint_def_init */
  uint32_t cookie;     /* set by hap_joint_def_init */
  hap_joint_kind kind; /* default BALL */
  uint32_t body_a;     /* a body */
  uint32_t body_b;     /* another one, or HAP_SCENE_WORLD (default) */
  double anchor[3];    /* m, world; not of SLIDER and FIXED */
  double axis[2][3];   /* world, any length but 0; default z, x */
  /* rad or m, from where the joint is now; default none: -infinity and infinity. Angles are within
   * -pi and pi. */
  double low[2];
  double high[2];        /* the other end, likewise */
  double motor_speed[2]; /* rad/s or m/s, default 0 */
  double motor_force[2]; /* N m or N, default 0: no motor. With speed 0 it is friction */
  /* HINGE, SLIDER and UNIVERSAL, beside stops and motor: a spring, N m/rad or N/m, 0..1e9, default
   * 0. */
  double stiffness[2];
  double rest[2];    /* rad or m, where the spring rests; where the joint is now: 0, the default */
  double damping[2]; /* N m s/rad or N s/m, 0..1e9, default 0 */
  double inertia[2]; /* kg m^2 or kg, of a rotor that turns with the axis alone; default 0 */
} hap_joint_def;

/* [any] Fills *def with defaults. size_of_def: sizeof *def of the caller's build. */
HAP_API void hap_joint_def_init(hap_joint_def *def, size_t size_of_def);

/* [scene] Adds a joint. Bodies that a joint connects do not collide with each other. Errors as
 * hap_scene_add_body; HAP_ERROR_NOT_FOUND: no such body. */
HAP_NODISCARD HAP_API hap_status hap_scene_add_joint(hap_scene *scene, const hap_joint_def *def,
                                                     uint32_t *out_joint, hap_detail *detail);

/* [scene] Two bodies pass through each other from now on, as those that a joint connects do; twice
 * is as good as once. While a session runs, contacts that press go with the next step.
 * HAP_ERROR_NOT_FOUND: no such body. HAP_ERROR_ARGUMENT: they are the same. HAP_ERROR_MEMORY,
 * HAP_ERROR_THREAD. */
HAP_NODISCARD HAP_API hap_status hap_scene_let_pass(hap_scene *scene, uint32_t body_a,
                                                    uint32_t body_b, hap_detail *detail);

/* [scene] Takes a body with its geoms and joints away. What a hand feels of it ends.
 * HAP_ERROR_NOT_FOUND: there is none of that number. HAP_ERROR_THREAD. */
HAP_API hap_status hap_scene_remove_body(hap_scene *scene, uint32_t body);

/* [scene] The same of a geom that never moves. HAP_ERROR_STATE: it belongs to a body. */
HAP_API hap_status hap_scene_remove_geom(hap_scene *scene, uint32_t geom);

/* [scene] The same of a joint. */
HAP_API hap_status hap_scene_remove_joint(hap_scene *scene, uint32_t joint);

/* ---- reading it ---- */

/* How many numbers were given out. Its size goes with the call; it may grow at its end. */
typedef struct hap_scene_counts {
  uint32_t bodies; /* with those that were removed, also below */
  uint32_t geoms;  /* of bodies, and those that never move */
  uint32_t joints; /* between bodies, or a body and the world */
  uint32_t hands;  /* that a built-in scene was made for */
} hap_scene_counts;

/* [scene] size_of_out: sizeof *out of the caller's build. */
HAP_API hap_status hap_scene_count(const hap_scene *scene, hap_scene_counts *out,
                                   size_t size_of_out);

/* A geom of a scene. Its size goes with the call; it may grow at its end. */
typedef struct hap_scene_geom {
  uint32_t body;           /* HAP_SCENE_WORLD: it never moves */
  uint32_t shape;          /* hap_shape */
  hap_pose pose;           /* in the body's frame, or in the world */
  double edges[3];         /* m; FIELD: along x and y */
  double radius;           /* m */
  double length;           /* m */
  double friction;         /* infinity in some built-in scenes */
  double bounce;           /* 0..1 */
  float colour_rgba[4];    /* 0..1 */
  uint32_t vertex_count;   /* MESH, FIELD: for hap_scene_mesh */
  uint32_t triangle_count; /* MESH, FIELD: likewise */
} hap_scene_geom;

/* [scene] size_of_out: sizeof *out of the caller's build. HAP_ERROR_NOT_FOUND: there is none of
 * that number. */
HAP_API hap_status hap_scene_get_geom(const hap_scene *scene, uint32_t geom, hap_scene_geom *out,
                                      size_t size_of_out);

/* [scene] Vertices and triangles of a MESH or FIELD in the geom's frame, as in hap_geom_def.
 * HAP_ERROR_CAPACITY: there are more. HAP_ERROR_UNSUPPORTED: another shape. HAP_ERROR_NOT_FOUND. */
HAP_API hap_status hap_scene_mesh(const hap_scene *scene, uint32_t geom, double *out_vertices_xyz,
                                  size_t vertex_capacity, uint32_t *out_triangles,
                                  size_t triangle_capacity);

/* A body of a scene, as the world has it. Its size goes with the call; it may grow at its end. */
typedef struct hap_scene_body {
  hap_pose pose;         /* of its frame in the world */
  hap_twist twist;       /* of the frame's origin */
  double mass;           /* kg */
  double centre[3];      /* m, of mass, in the body's frame */
  double inertia[3][3];  /* kg m^2, about the centre of mass, axes of the body's frame */
  uint32_t is_kinematic; /* 1: nothing moves it but its velocity */
  uint32_t reserved;
  void *id; /* dBodyID, for hap_pointer_attach; to be compared with what touches tell */
} hap_scene_body;

/* [scene] For drawing: hap_scene_poses. size_of_out: sizeof *out of the caller's build.
 * HAP_ERROR_NOT_FOUND: there is none of that number. */
HAP_API hap_status hap_scene_get_body(const hap_scene *scene, uint32_t body, hap_scene_body *out,
                                      size_t size_of_out);

/* A joint of a scene, as the world has it. Its size goes with the call; it may grow at its end. */
typedef struct hap_scene_joint {
  uint32_t kind;      /* hap_joint_kind */
  uint32_t body_a;    /* a body */
  uint32_t body_b;    /* or HAP_SCENE_WORLD */
  uint32_t axes;      /* 0..2 that it has */
  double anchor[3];   /* m, world; of SLIDER, FIXED and OTHER the centre of body a */
  double axis[2][3];  /* unit, world */
  double position[2]; /* rad or m, from where it was made */
  double rate[2];     /* rad/s or m/s */
} hap_scene_joint;

/* [scene] size_of_out: sizeof *out of the caller's build. HAP_ERROR_NOT_FOUND: there is none of
 * that number. */
HAP_API hap_status hap_scene_get_joint(const hap_scene *scene, uint32_t joint, hap_scene_joint *out,
                                       size_t size_of_out);

/* [scene] Number of the geom that hap_touch, hap_event or hap_body_contact tells. HAP_SCENE_WORLD:
 * it is none of this scene. */
HAP_API uint32_t hap_scene_find_geom(const hap_scene *scene, const void *geom);

/* [scene] The same of a body. */
HAP_API uint32_t hap_scene_find_body(const hap_scene *scene, const void *body);

/* ---- a session over it ---- */

/* [physics] Before or after a step of the world; step_s: its length, s. */
typedef void (*hap_scene_step_fn)(void *user, double step_s);

/* [control] Functions that a session over the scene calls; set before it is created. NULL: none. */
HAP_API hap_status hap_scene_set_steps(hap_scene *scene, hap_scene_step_fn before,
                                       hap_scene_step_fn after, void *user);

/* [physics] How a pointer feels a geom of this number: *io comes with what the pointer has of its
 * own. When it is called, and what it may say: hap_pointer_surface_fn of hapode/ode.h. */
typedef void (*hap_scene_surface_fn)(void *user, uint32_t geom, hap_pointer_id pointer,
                                     hap_surface *io);

/* [control] The function that says how geoms feel; set before the session is created. NULL: all
 * feel as the pointers say. magnet_reach: m, 0..0.1, as in hap_ode_def. HAP_ERROR_STATE: there is a
 * session already. HAP_ERROR_ARGUMENT, and nothing changes: magnet_reach is out of range. */
HAP_API hap_status hap_scene_set_surface(hap_scene *scene, hap_scene_surface_fn surface,
                                         double magnet_reach, void *user);

/* [control] hap_session_create over the scene, with its errors; def NULL: defaults. A scene has one
 * session at a time. Its first HAP_TRACE_BODIES_MAX bodies go into the trace, in the order of their
 * numbers. */
HAP_NODISCARD HAP_API hap_status hap_scene_session(hap_scene *scene, const hap_session_def *def,
                                                   hap_session **out, hap_detail *detail);

/* [scene] A pointer as a built-in scene was made for: fills in radius, hull, stiffness, damping and
 * friction of *io, which was initialised. *out_device: spec of a device "virtual" that moves as a
 * hand would; the scene's, like the hull. HAP_ERROR_NOT_FOUND: the scene has no such hand. */
HAP_API hap_status hap_scene_hand(const hap_scene *scene, uint32_t hand, hap_pointer_def *io,
                                  const char **out_device);

/* [any] For drawing at time_ns: poses of the frames of count bodies from number first on, as
 * hap_session_poses gives them. Of removed bodies the element stays as it is.
 * HAP_ERROR_STATE: the scene has no session. HAP_ERROR_NOT_FOUND: so many bodies were never made.
 * Not at the same time as [scene] calls that add or remove. */
HAP_API hap_status hap_scene_poses(hap_scene *scene, int64_t time_ns, uint32_t first, size_t count,
                                   hap_pose *out);

/* ---- moving it ---- */

/* [scene] Puts a body elsewhere, at once: hap_session_teleport_body. */
HAP_API hap_status hap_scene_set_pose(hap_scene *scene, uint32_t body, const hap_pose *pose);

/* [scene] Velocity of the origin of its frame, up to 1e8 m/s and 1e7 rad/s. */
HAP_API hap_status hap_scene_set_twist(hap_scene *scene, uint32_t body, const hap_twist *twist);

/* [scene] Adds a force (N) and a torque (N m) about the centre of mass, world axes, for the next
 * step. From a step function: for each step. */
HAP_API hap_status hap_scene_push(hap_scene *scene, uint32_t body, const hap_wrench *wrench);

/* [scene] Speed (rad/s or m/s) and force (N m or N, 0: none) of the motor of an axis, 0 or 1.
 * HAP_ERROR_UNSUPPORTED: the joint has no such axis. HAP_ERROR_NOT_FOUND, HAP_ERROR_ARGUMENT. */
HAP_API hap_status hap_scene_set_motor(hap_scene *scene, uint32_t joint, uint32_t axis,
                                       double speed, double force);

HAP_END_DECLS

#endif
