/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/rig.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "device/device.h"
#include "scene/scene_internal.h"

void rig_options_init(rig_options *options)
{
  memset(options, 0, sizeof *options);
  options->scene = "row10";
  options->coupling = HAP_COUPLING_AUTO;
  options->friction = options->finger_radius = -1.0;
  session_defs_init(&options->def, &options->expert, &options->research);
}

hap_status rig_find_model(const char *name, hap_model *out, hap_detail *detail)
{
  size_t length = 0;
  for (int i = 0; hap_model_name((hap_model)i) != NULL; ++i) {
    if (strcmp(name, hap_model_name((hap_model)i)) == 0) {
      *out = (hap_model)i;
      return HAP_OK;
    }
  }
  length += (size_t)snprintf(detail->text, sizeof detail->text,
                             "there is no model \"%.60s\"; models:", name);
  for (int i = 0; hap_model_name((hap_model)i) != NULL && length < sizeof detail->text; ++i) {
    length += (size_t)snprintf(detail->text + length, sizeof detail->text - length, " %s",
                               hap_model_name((hap_model)i));
  }
  return HAP_ERROR_NOT_FOUND;
}

/* "virtual" without arguments is the hand that belongs to the scene. */
static const char *device_spec(const rig_options *options, const rig *r, size_t index)
{
  const scene_parameters *p = &r->scene->parameters;
  const char *own = r->pointer_count < (size_t)p->pointers ? p->hands[r->pointer_count] : NULL;
  const char *asked = index < options->device_count ? options->devices[index] : NULL;
  bool scenes_own = asked == NULL || strcmp(asked, "virtual") == 0;
  return scenes_own && own != NULL ? own : asked != NULL ? asked : "virtual";
}

static hap_status take_identity(const char *path, hap_device *device, hap_detail *detail)
{
  hap_device_identity identity;
  hap_device_identity_init(&identity, sizeof identity);
  if (path == NULL) {
    return HAP_OK;
  }
  hap_status status = hap_device_identity_read(path, &identity, detail);
  return status < HAP_OK ? status : hap_device_set_identity(device, &identity, detail);
}

/* A device of hardware has its own frame: its origin is put where the scene's own hand begins. */
static void place_device(const char *hand, hap_pose *out)
{
  hap_device *scenes_own = NULL;
  if (hand == NULL || hap_device_open(hand, &scenes_own, NULL) < HAP_OK) {
    return;
  }
  const hap_device_ops *ops = hapi_device_ops(scenes_own);
  void *self = hapi_device_self(scenes_own);
  if (ops->start(self) >= HAP_OK && hapi_device_read(scenes_own, 0) >= HAP_OK) {
    memcpy(out->position, scenes_own->effectors[0].input.pose.position, sizeof out->position);
  }
  ops->stop(self);
  hap_device_close(scenes_own);
}

static void set_tool(const double edges[3], double out[8][3])
{
  for (int i = 0; i < 8; ++i) {
    for (int k = 0; k < 3; ++k) {
      out[i][k] = (i >> k & 1) != 0 ? 0.5 * edges[k] : -0.5 * edges[k];
    }
  }
}

/* What moves a pointer. */
typedef struct rig_hand {
  hap_device *device;
  uint32_t effector;
  hap_pose pose_world_device;
} rig_hand;

static hap_status open_device(const rig_options *options, rig *r, size_t index, hap_detail *detail)
{
  const scene_parameters *p = &r->scene->parameters;
  const char *spec = device_spec(options, r, index);
  if (index == 0 && options->hardware != NULL) {
    return HAP_OK; /* as it is since the begin */
  }
  if (strcmp(spec, "virtual") == 0) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "scene %s has %d simulated hands: give device %zu a motion, as in "
                     "virtual:path=0:0/0/0;1:0.1/0/0",
                     p->name, p->pointers, index + 1);
  }
  HAPI_TRY(hap_device_open(spec, &r->devices[index], detail));
  if (options->around == NULL) {
    return HAP_OK;
  }
  hap_device *inner = r->devices[index];
  HAPI_TRY(options->around->put(options->around->user, index, &r->devices[index], detail));
  r->inner[index] = r->devices[index] != inner ? inner : NULL;
  return HAP_OK;
}

static hap_status add_pointer(const rig_options *options, rig *r, const rig_hand *hand,
                              hap_detail *detail)
{
  const scene_parameters *p = &r->scene->parameters;
  hap_pointer_def def;
  hap_pointer_expert_def expert;
  hap_pointer_research_def research;
  pointer_defs_init(&def, &expert, &research);
  def.device = hand->device;
  def.effector = hand->effector;
  def.pose_world_device = hand->pose_world_device;
  double hull[8][3];
  def.radius = p->radius;
  if (p->tool[0] > 0.0) {
    set_tool(p->tool, hull);
    def.hull_xyz = &hull[0][0];
    def.hull_points = 8;
  }
  def.stiffness = options->stiffness > 0.0 ? options->stiffness : p->stiffness;
  def.damping = p->damping;
  def.friction = options->friction >= 0.0 ? options->friction : p->friction;
  def.finger_radius = options->finger_radius >= 0.0 ? options->finger_radius : p->finger_radius;
  if (options->max_force > 0.0) { /* and torque as on an arm of a metre */
    def.max_force = def.max_torque = options->max_force;
  }
  expert.coupling = options->coupling;
  expert.coupling_stiffness = options->coupling_stiffness;
  expert.coupling_damping = options->coupling_damping;
  research.integration = options->integration;
  research.virtual_mass =
      options->virtual_mass > 0.0 ? options->virtual_mass : research.virtual_mass;
  hap_status status = hap_pointer_add(r->session, &def, &r->pointers[r->pointer_count]);
  if (status < HAP_OK) {
    (void)hap_session_detail(r->session, detail);
    return status;
  }
  ++r->pointer_count;
  return HAP_OK;
}

/* All end effectors of a device are in its frame, which is put where the hand of the first one
 * begins. */
static hap_status add_device(const rig_options *options, rig *r, size_t index, hap_detail *detail)
{
  const scene_parameters *p = &r->scene->parameters;
  const size_t own = (size_t)p->pointers;
  hap_device_info info;
  HAPI_TRY(open_device(options, r, index, detail));
  rig_hand hand = {.device = r->devices[index], .pose_world_device = {.quat_wxyz = {1.0}}};
  HAPI_TRY(take_identity(options->identities[index], hand.device, detail));
  bool hardware = index == 0 && options->hardware != NULL;
  if (hardware || hapi_device_ops(hand.device)->pacing != HAP_PACING_VIRTUAL) {
    place_device(r->pointer_count < own ? p->hands[r->pointer_count] : NULL,
                 &hand.pose_world_device);
  }
  HAPI_TRY(hap_device_get_info(hand.device, &info, sizeof info));
  HAPI_TRY(add_pointer(options, r, &hand, detail));
  while (++hand.effector < info.effector_count) {
    if (r->pointer_count + (r->device_count - index - 1) < own) {
      HAPI_TRY(add_pointer(options, r, &hand, detail));
    } else {
      ++r->effectors_left;
    }
  }
  return HAP_OK;
}

static hap_status create_session(const rig_options *options, rig *r, hap_detail *detail)
{
  hap_ode_def ode;
  hap_ode_def_init(&ode, sizeof ode);
  ode.world = r->scene->world;
  ode.space = r->scene->space;
  ode.surface = scene_surface;
  ode.user = r->scene;
  ode.island_threads = options->island_threads != 0 ? options->island_threads : ode.island_threads;
  hap_session_def def = options->def;
  hap_expert_def expert = options->expert;
  hap_research_def research = options->research;
  def.expert = &expert;
  def.research = &research;
  if (options->player != NULL) {
    (void)hap_player_get_def(options->player, &def, &expert, &research);
  }
  bool hands_come = r->device_count > 0 || options->serves;
  int32_t own = hands_come ? r->scene->parameters.pointers : 0;
  int32_t hands = own > (int32_t)r->device_count ? own : (int32_t)r->device_count;
  if (def.max_pointers < hands) {
    def.max_pointers = hands;
  }
  hap_status status = r->is_loaded ? hap_scene_session(options->loaded, &def, &r->session, detail)
                                   : hap_session_create(&def, &ode, &r->session, detail);
  if (status < HAP_OK) {
    return status;
  }
  size_t traced =
      r->scene->body_count < HAP_TRACE_BODIES_MAX ? r->scene->body_count : HAP_TRACE_BODIES_MAX;
  return hap_session_trace_bodies(r->session, r->scene->bodies, traced);
}

static hap_status attach_recording(const rig_options *options, rig *r, hap_detail *detail)
{
  if (options->player != NULL) {
    return hap_session_play(r->session, options->player, detail);
  }
  return options->record != NULL ? hap_session_record(r->session, options->record, detail) : HAP_OK;
}

/* A loaded scene as if it were a built-in one. */
static hap_status loaded_take(const rig_options *options, rig *out, hap_detail *detail)
{
  const hap_scene *from = options->loaded;
  if (options->island_threads > 1) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "a scene from a file has no island threads");
  }
  out->scene = calloc(1, sizeof *out->scene);
  dBodyID *bodies = calloc(from->body_count + 1, sizeof(dBodyID));
  if (out->scene == NULL || bodies == NULL) {
    free(out->scene);
    free(bodies);
    out->scene = NULL;
    return hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for a scene");
  }
  for (uint32_t i = 0; i < from->body_count; ++i) {
    bodies[i] = from->bodies[i].body;
  }
  *out->scene = (scene){.parameters = *options->parameters,
                        .world = from->world,
                        .space = from->space,
                        .bodies = bodies,
                        .body_count = from->body_count};
  out->is_loaded = true;
  return HAP_OK;
}

static hap_status scene_make(const rig_options *options, rig *out, hap_detail *detail)
{
  if (options->loaded != NULL) {
    return loaded_take(options, out, detail);
  }
  return options->parameters != NULL
             ? scene_create_from(options->parameters, options->count, &out->scene, detail)
             : scene_create(options->scene, &out->scene, detail);
}

hap_status rig_create(const rig_options *options, rig *out, hap_detail *detail)
{
  memset(out, 0, sizeof *out);
  hap_status status = scene_make(options, out, detail);
  out->devices[0] = options->hardware;
  if (status < HAP_OK || out->scene == NULL) {
    rig_destroy(out);
    return status;
  }
  size_t own = (size_t)out->scene->parameters.pointers;
  rig_part part = RIG_SESSION;
  out->device_count = options->player != NULL     ? 0
                      : options->serves           ? 0
                      : options->device_count > 0 ? options->device_count
                                                  : own;
  status = create_session(options, out, detail);
  for (size_t i = 0; i < out->device_count && status >= HAP_OK; ++i) {
    part = RIG_POINTER;
    status = add_device(options, out, i, detail);
  }
  if (status >= HAP_OK) {
    part = RIG_RECORDING;
    status = attach_recording(options, out, detail);
  }
  if (status < HAP_OK) {
    rig_destroy(out);
    out->failed = part;
  }
  return status;
}

void rig_destroy(rig *r)
{
  hap_session_destroy(r->session);
  for (size_t i = 0; i < RIG_POINTERS_MAX; ++i) {
    hap_device_close(r->devices[i]);
    hap_device_close(r->inner[i]);
  }
  if (r->is_loaded) {
    free(r->scene->bodies);
    free(r->scene);
  } else {
    scene_destroy(r->scene);
  }
  memset(r, 0, sizeof *r);
}
