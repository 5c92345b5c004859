/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/run_scene_file.h"

#include <math.h>
#include <string.h>

#include "base/log.h"
#include "base/vec.h"
#include "scene/scene_internal.h"

#ifdef HAPODE_IMPORT
#include "import/import.h"
#endif

#define VISITS_MOST 12u
#define VISIT_S 1.5      /* from a body to the next */
#define HAND_SPEED 2.0   /* m/s at most: a faster one is taken for a fault of the device */
#define HAND_REACH 900.0 /* m from the middle of the world: a path takes no more than 1000 */

/* A built-in scene's name has neither a slash nor an end. */
static bool scene_is_file(const char *spec)
{
  const char *dot = strrchr(spec, '.');
  return strchr(spec, '/') != NULL ||
         (dot != NULL &&
          (strcmp(dot, ".xml") == 0 || strcmp(dot, ".mjcf") == 0 || strcmp(dot, ".urdf") == 0));
}

#ifdef HAPODE_IMPORT

static void line_show(void *user, const char *line)
{
  (void)user;
  fprintf(stderr, "%s\n", line);
}

static hap_status file_load(const run_options *options, bool says, hap_scene **out,
                            hap_detail *detail)
{
  const import_options how = {.strict = options->strict, .said = says ? line_show : NULL};
  return import_scene(options->rig.scene, &how, out, NULL, detail);
}

#else

static hap_status file_load(const run_options *options, bool says, hap_scene **out,
                            hap_detail *detail)
{
  (void)options, (void)says, (void)out;
  return hapi_fail(detail, HAP_ERROR_UNSUPPORTED,
                   "this program was built without expat, and reads no files of scenes (Debian: "
                   "libexpat1-dev, then set up again)");
}

#endif

static bool box_is_near(const dReal box[6])
{
  for (int k = 0; k < 6; ++k) {
    if (!(fabs(box[k]) < HAND_REACH)) {
      return false;
    }
  }
  return true;
}

/* The corners of all that moves where a hand can go. False: nothing does. */
static bool scene_extent(const hap_scene *from, double low[3], double high[3])
{
  hapi_v3_set(low, INFINITY, INFINITY, INFINITY);
  hapi_v3_set(high, -INFINITY, -INFINITY, -INFINITY);
  for (uint32_t i = 0; i < from->geom_count; ++i) {
    dReal box[6];
    dGeomGetAABB(from->geoms[i].geom, box);
    if (from->geoms[i].body == HAP_SCENE_WORLD || !box_is_near(box)) {
      continue;
    }
    for (int k = 0; k < 3; ++k) {
      low[k] = fmin(low[k], box[2 * k]);
      high[k] = fmax(high[k], box[2 * k + 1]);
    }
  }
  return low[0] <= high[0];
}

/* Height of the ground below the scene, or of its own lowest point. */
static double ground_height(const hap_scene *from, double low)
{
  double ground = low;
  for (uint32_t i = 0; i < from->geom_count; ++i) {
    const hapi_scene_geom *geom = &from->geoms[i];
    if (geom->shape == HAP_SHAPE_PLANE && geom->pose.position[2] < ground) {
      ground = geom->pose.position[2];
    }
  }
  return ground;
}

/* A path of a hand that is being written. */
typedef struct hand_path {
  char *out;
  size_t size;
  size_t used;
  double time;
  double at[3];
} hand_path;

static void path_go(hand_path *io, double least_s, double x, double y, double z)
{
  const double to[3] = {x, y, z};
  double way[3];
  hapi_v3_sub(io->at, to, way);
  io->time += fmax(least_s, hapi_v3_norm(way) / HAND_SPEED);
  hapi_v3_copy(to, io->at);
  io->used += (size_t)snprintf(io->out + io->used, io->size - io->used, ";%.4f:%.4f/%.4f/%.4f",
                               io->time, x, y, z);
}

/* From beside the scene, at its largest height, through the bodies one after the other, each from
 * where it is down to the ground, to which it may have fallen. Returns the seconds it takes. */
static double hand_write(const hap_scene *from, double radius, char *out, size_t size)
{
  double low[3];
  double high[3];
  if (!scene_extent(from, low, high)) {
    hapi_v3_set(low, -0.1, -0.1, 0.0);
    hapi_v3_set(high, 0.1, 0.1, 0.2);
  }
  const double ground = ground_height(from, low[2]) + radius;
  const double away[3] = {low[0] - 4.0 * radius, 0.5 * (low[1] + high[1]), high[2] + 2.0 * radius};
  hand_path path = {.out = out, .size = size};
  hapi_v3_copy(away, path.at);
  path.used =
      (size_t)snprintf(out, size, "virtual:path=0:%.4f/%.4f/%.4f", away[0], away[1], away[2]);
  const uint32_t visits = from->body_count < VISITS_MOST ? from->body_count : VISITS_MOST;
  for (uint32_t i = 0; i < visits; ++i) {
    const uint32_t body = (uint32_t)((uint64_t)i * from->body_count / visits);
    const dReal *x = dBodyGetPosition(from->bodies[body].body);
    if (fmax(fmax(fabs(x[0]), fabs(x[1])), fabs(x[2])) < HAND_REACH) {
      path_go(&path, 0.5 * VISIT_S, x[0], x[1], x[2]);
      path_go(&path, 0.5 * VISIT_S, x[0], x[1], fmin(ground, x[2]));
    }
  }
  path_go(&path, VISIT_S, away[0], away[1], away[2]);
  return path.time;
}

/* A pointer of the size of the scene's things; the rest as any pointer has it. */
static void parameters_fill(const hap_scene *from, run_scene_file *out)
{
  hap_pointer_def def;
  double low[3];
  double high[3];
  double edges[3] = {0.2, 0.2, 0.2};
  hap_pointer_def_init(&def, sizeof def);
  if (scene_extent(from, low, high)) {
    hapi_v3_sub(high, low, edges);
  }
  out->parameters =
      (scene_parameters){.name = "file",
                         .radius = fmin(fmax(0.03 * hapi_v3_norm(edges), 0.002), 0.05),
                         .stiffness = def.stiffness,
                         .damping = def.damping,
                         .friction = def.friction,
                         .finger_radius = def.finger_radius,
                         .pointers = 1,
                         .hands = {out->hand}};
  out->parameters.duration = hand_write(from, out->parameters.radius, out->hand, sizeof out->hand);
}

hap_status run_scene_file_open(run_options *options, run_scene_file *out, hap_detail *detail)
{
  memset(out, 0, sizeof *out);
  options->rig.loaded = NULL; /* the run before may have had one */
  options->rig.parameters = NULL;
  if (!scene_is_file(options->rig.scene)) {
    return options->strict
               ? hapi_fail(detail, HAP_ERROR_ARGUMENT, "--strict: --scene names no file")
               : HAP_OK;
  }
  HAPI_TRY(file_load(options, true, &out->scene, detail));
  parameters_fill(out->scene, out);
  options->rig.loaded = out->scene;
  options->rig.parameters = &out->parameters;
  return HAP_OK;
}

hap_status run_scene_file_again(const run_options *options, hap_scene **out, hap_detail *detail)
{
  return options->rig.loaded != NULL ? file_load(options, false, out, detail)
                                     : hap_scene_load(options->rig.scene, out, detail);
}

void run_scene_file_close(run_scene_file *file)
{
  (void)hap_scene_destroy(file->scene);
  file->scene = NULL;
}
