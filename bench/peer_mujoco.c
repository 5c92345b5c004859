/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* MuJoCo: soft contacts, projected Gauss-Seidel. The truth is Newton's method, as 1000 sweeps end
 * far from 100 in a row of 30. The model is a text that this writes. A surface of triangles is a
 * height field, as meshes are convex there. */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <mujoco/mujoco.h>

#include "bench/peer.h"

#define FILE_NAME "world.xml"
#define CONTACT_STEPS 5.0 /* time constant of a contact; with 2 piles explode */
#define GROUND_DEPTH 0.5  /* m, of the height field's base below its lowest point */

typedef struct mujoco_sim {
  mjModel *model;
  mjData *data;
  int *bodies; /* of the boxes: MuJoCo numbers them in the order of their nesting */
} mujoco_sim;

/* ---- the model's text ---- */

static int joint_of(const peer_world *world, size_t box)
{
  for (size_t i = 0; i < world->joint_count; ++i) {
    if (world->joints[i].child == (int)box) {
      return (int)i;
    }
  }
  return -1;
}

static void text_joint(FILE *to, const peer_world *world, int number, size_t box)
{
  if (number < 0) {
    fprintf(to, "<freejoint/>");
    return;
  }
  const peer_joint *joint = &world->joints[number];
  const double *at = world->boxes[box].at;
  fprintf(to, "<joint type='%s' pos='%.17g %.17g %.17g' axis='%.17g %.17g %.17g'/>",
          joint->kind == PEER_BALL ? "ball" : "hinge", joint->anchor[0] - at[0],
          joint->anchor[1] - at[1], joint->anchor[2] - at[2], joint->axis[0], joint->axis[1],
          joint->axis[2]);
}

/* A box and, in it, those that are jointed to it as its children. Contacts push from the touch on:
 * boxes that rest a layer deep in each other elsewhere are smaller by that, and just touch. */
static void text_box(FILE *to, const peer_world *world, size_t box, const double from[3])
{
  const peer_box *b = &world->boxes[box];
  fprintf(to, "<body name='b%zu' pos='%.17g %.17g %.17g'>", box, b->at[0] - from[0],
          b->at[1] - from[1], b->at[2] - from[2]);
  text_joint(to, world, joint_of(world, box), box);
  fprintf(to,
          "<geom type='box' size='%.17g %.17g %.17g' mass='%.17g' contype='1' "
          "conaffinity='%d'/>",
          0.5 * (b->edges[0] - world->layer), 0.5 * (b->edges[1] - world->layer),
          0.5 * (b->edges[2] - world->layer), b->mass, world->boxes_pass ? 0 : 1);
  for (size_t i = 0; i < world->joint_count; ++i) {
    if (world->joints[i].parent == (int)box) {
      text_box(to, world, (size_t)world->joints[i].child, b->at);
    }
  }
  fprintf(to, "</body>");
}

static void ground_extent(const peer_ground *g, double *out_least, double *out_most)
{
  *out_least = *out_most = g->vertices[2];
  for (size_t i = 0; i < g->vertex_count; ++i) {
    *out_least = fmin(*out_least, g->vertices[3 * i + 2]);
    *out_most = fmax(*out_most, g->vertices[3 * i + 2]);
  }
}

static void text_fixed(FILE *to, const peer_world *world)
{
  const peer_ground *g = &world->ground;
  if (world->has_floor) {
    fprintf(to, "<geom type='plane' size='10 10 1' pos='0 0 %.17g' contype='0' conaffinity='1'/>",
            -0.5 * world->layer);
  }
  if (g->cells > 0) {
    double least;
    double most;
    double middle = g->begin + 0.5 * g->cells * g->cell;
    ground_extent(g, &least, &most);
    fprintf(to,
            "<geom type='hfield' hfield='ground' pos='%.17g %.17g %.17g' contype='0' "
            "conaffinity='1'/>",
            middle, middle, least - 0.5 * world->layer);
  }
}

/* The friction cone is round, and friction ten times as stiff as the contact, or bodies creep. */
static void text_write(FILE *to, const peer_world *world, const peer_setting *setting)
{
  const double origin[3] = {0.0, 0.0, 0.0};
  fprintf(to,
          "<mujoco><option timestep='%.17g' gravity='0 0 %.17g' solver='%s' iterations='%d' "
          "tolerance='0' cone='elliptic' impratio='10'/><size njmax='%zu' nconmax='%zu' "
          "nstack='%zu'/>",
          setting->step_s, -world->gravity, setting->is_truth ? "Newton" : "PGS",
          setting->iterations, 40 * world->count + 200, 14 * world->count + 100,
          (size_t)4000000 + 400000 * world->count);
  fprintf(to,
          "<default><geom friction='%.17g 0 0' condim='3' solref='%.17g 1' "
          "solimp='0.95 0.99 0.0001'/></default>",
          world->mu, CONTACT_STEPS * setting->step_s);
  if (world->ground.cells > 0) {
    double least;
    double most;
    int side = world->ground.cells + 1;
    double half = 0.5 * world->ground.cells * world->ground.cell;
    ground_extent(&world->ground, &least, &most);
    fprintf(to,
            "<asset><hfield name='ground' nrow='%d' ncol='%d' size='%.17g %.17g %.17g "
            "%.17g'/></asset>",
            side, side, half, half, most - least, GROUND_DEPTH);
  }
  fprintf(to, "<worldbody>");
  text_fixed(to, world);
  for (size_t i = 0; i < world->count; ++i) {
    int joint = joint_of(world, i);
    if (joint < 0 || world->joints[joint].parent < 0) {
      text_box(to, world, i, origin);
    }
  }
  fprintf(to, "</worldbody></mujoco>");
}

static mjModel *model_load(const char *text, size_t size)
{
  char why[500] = "";
  mjVFS *files = calloc(1, sizeof *files);
  mjModel *model = NULL;
  if (files == NULL) {
    return NULL;
  }
  mj_defaultVFS(files);
  if (mj_makeEmptyFileVFS(files, FILE_NAME, (int)size) == 0) {
    memcpy(files->filedata[mj_findFileVFS(files, FILE_NAME)], text, size);
    model = mj_loadXML(FILE_NAME, files, why, sizeof why);
  }
  if (model == NULL) {
    fprintf(stderr, "mujoco: %s\n", why);
  }
  mj_deleteVFS(files);
  free(files);
  return model;
}

static mjModel *model_create(const peer_world *world, const peer_setting *setting)
{
  char *text = NULL;
  size_t size = 0;
  FILE *to = open_memstream(&text, &size);
  if (to == NULL) {
    return NULL;
  }
  text_write(to, world, setting);
  if (fclose(to) != 0) {
    free(text);
    return NULL;
  }
  mjModel *model = model_load(text, size);
  free(text);
  return model;
}

/* Its heights are shares of the extent. */
static void ground_fill(mjModel *model, const peer_ground *g)
{
  double least;
  double most;
  ground_extent(g, &least, &most);
  for (size_t i = 0; i < g->vertex_count; ++i) {
    model->hfield_data[i] = (float)((g->vertices[3 * i + 2] - least) / (most - least));
  }
}

/* ---- the engine ---- */

static void mujoco_destroy(void *data)
{
  mujoco_sim *sim = data;
  mj_deleteData(sim->data);
  mj_deleteModel(sim->model);
  free(sim->bodies);
  free(sim);
}

static void *mujoco_create(const peer_world *world, const peer_setting *setting)
{
  mujoco_sim *sim = calloc(1, sizeof *sim);
  if (sim == NULL) {
    return NULL;
  }
  sim->bodies = calloc(world->count, sizeof *sim->bodies);
  sim->model = model_create(world, setting);
  if (sim->model != NULL && world->ground.cells > 0) {
    ground_fill(sim->model, &world->ground);
  }
  sim->data = sim->model != NULL ? mj_makeData(sim->model) : NULL;
  if (sim->data == NULL || sim->bodies == NULL) {
    mujoco_destroy(sim);
    return NULL;
  }
  for (size_t i = 0; i < world->count; ++i) {
    char name[32];
    snprintf(name, sizeof name, "b%zu", i);
    sim->bodies[i] = mj_name2id(sim->model, mjOBJ_BODY, name);
  }
  mj_step1(sim->model, sim->data);
  return sim;
}

/* Its first half finds places and contacts, so that these are there when the hand looks. */
static void mujoco_step(void *data, const peer_push *pushes, size_t count)
{
  mujoco_sim *sim = data;
  mju_zero(sim->data->qfrc_applied, sim->model->nv);
  for (size_t i = 0; i < count; ++i) {
    mj_applyFT(sim->model, sim->data, pushes[i].force, NULL, pushes[i].point,
               sim->bodies[pushes[i].box], sim->data->qfrc_applied);
  }
  mj_step2(sim->model, sim->data);
  mj_step1(sim->model, sim->data);
}

static void mujoco_read(const void *data, size_t box, peer_motion *out)
{
  const mujoco_sim *sim = data;
  mjtNum velocity[6]; /* turning first */
  int body = sim->bodies[box];
  memcpy(out->position, &sim->data->xipos[3 * body], sizeof out->position);
  memcpy(out->quat_wxyz, &sim->data->xquat[4 * body], sizeof out->quat_wxyz);
  mj_objectVelocity(sim->model, sim->data, mjOBJ_BODY, body, velocity, 0);
  memcpy(out->angular, velocity, sizeof out->angular);
  memcpy(out->linear, &velocity[3], sizeof out->linear);
}

static double mujoco_mass(const void *data, size_t box)
{
  const mujoco_sim *sim = data;
  return sim->model->body_mass[sim->bodies[box]];
}

static bool mujoco_sleeps(const void *data, size_t box)
{
  (void)data, (void)box;
  return false;
}

static size_t mujoco_boxes(const void *data)
{
  const mujoco_sim *sim = data;
  return (size_t)sim->model->nbody - 1;
}

const peer_engine peer_mujoco = {.name = "mujoco",
                                 .iterations = 20,
                                 .boxes_most = 30,
                                 .can_sleep = false,
                                 .create = mujoco_create,
                                 .destroy = mujoco_destroy,
                                 .step = mujoco_step,
                                 .read = mujoco_read,
                                 .mass = mujoco_mass,
                                 .sleeps = mujoco_sleeps,
                                 .boxes = mujoco_boxes};
