/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tests/oracle_model.h"

#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#ifdef HAPODE_ORACLE
#include <mujoco/mujoco.h>
#endif

/* ---- memory ---- */

typedef struct block {
  struct block *next;
  double numbers[];
} block;

static void *model_take(oracle_model *model, size_t bytes)
{
  block *taken = calloc(1, sizeof(block) + bytes + sizeof(double));
  if (taken == NULL) {
    abort();
  }
  taken->next = model->memory;
  model->memory = taken;
  return taken->numbers;
}

void oracle_model_free(oracle_model *model)
{
  while (model->memory != NULL) {
    block *last = model->memory;
    model->memory = last->next;
    free(last);
  }
}

/* ---- the library ---- */

#ifdef HAPODE_ORACLE

bool oracle_library_is_there(void)
{
  return true;
}

/* The library's arrays are of several types, and go with its model. */
#define TAKE(to, type, from, size)                                 \
  do {                                                             \
    type *copied = model_take(out, (size_t)(size) * sizeof(type)); \
    for (ptrdiff_t k = 0; k < (ptrdiff_t)(size); ++k) {            \
      copied[k] = (type)(from)[k];                                 \
    }                                                              \
    (to) = copied;                                                 \
  } while (false)

static void bodies_take(const mjModel *m, const mjData *data, oracle_model *out)
{
  oracle_bodies *to = &out->bodies;
  const ptrdiff_t n = m->nbody;
  const char **names = model_take(out, (size_t)n * sizeof(char *));
  to->count = m->nbody;
  TAKE(to->joint_at, int, m->body_jntadr, n);
  TAKE(to->joint_count, int, m->body_jntnum, n);
  TAKE(to->geom_at, int, m->body_geomadr, n);
  TAKE(to->geom_count, int, m->body_geomnum, n);
  TAKE(to->mass, double, m->body_mass, n);
  TAKE(to->ipos, double, m->body_ipos, 3 * n);
  TAKE(to->iquat, double, m->body_iquat, 4 * n);
  TAKE(to->inertia, double, m->body_inertia, 3 * n);
  TAKE(to->xpos, double, data->xpos, 3 * n);
  TAKE(to->xquat, double, data->xquat, 4 * n);
  for (int i = 0; i < m->nbody; ++i) {
    const char *name = mj_id2name(m, mjOBJ_BODY, i);
    char *copied = model_take(out, name != NULL ? strlen(name) + 1 : 1);
    strcpy(copied, name != NULL ? name : "");
    names[i] = copied;
  }
  to->names = names;
}

static void joints_take(const mjModel *m, oracle_model *out)
{
  oracle_joints *to = &out->joints;
  const ptrdiff_t n = m->njnt;
  TAKE(to->type, int, m->jnt_type, n);
  TAKE(to->qpos_at, int, m->jnt_qposadr, n);
  TAKE(to->dof_at, int, m->jnt_dofadr, n);
  TAKE(to->limited, int, m->jnt_limited, n);
  TAKE(to->pos, double, m->jnt_pos, 3 * n);
  TAKE(to->axis, double, m->jnt_axis, 3 * n);
  TAKE(to->range, double, m->jnt_range, 2 * n);
  TAKE(to->stiffness, double, m->jnt_stiffness, n);
  TAKE(to->damping, double, m->dof_damping, m->nv);
  TAKE(to->armature, double, m->dof_armature, m->nv);
  TAKE(to->friction, double, m->dof_frictionloss, m->nv);
  TAKE(to->qpos0, double, m->qpos0, m->nq);
  TAKE(to->qpos_spring, double, m->qpos_spring, m->nq);
}

static void box_take(const mjModel *m, int g, double out[6])
{
  const int mesh = m->geom_type[g] == mjGEOM_MESH ? m->geom_dataid[g] : -1;
  for (int v = 0; mesh >= 0 && v < m->mesh_vertnum[mesh]; ++v) {
    const float *from = m->mesh_vert + 3 * ((ptrdiff_t)m->mesh_vertadr[mesh] + v);
    const mjtNum vertex[3] = {(mjtNum)from[0], (mjtNum)from[1], (mjtNum)from[2]};
    mjtNum at[3];
    mju_rotVecQuat(at, vertex, m->geom_quat + 4 * (ptrdiff_t)g);
    for (int k = 0; k < 3; ++k) {
      at[k] += m->geom_pos[3 * (ptrdiff_t)g + k];
      out[k] = v == 0 || at[k] < out[k] ? at[k] : out[k];
      out[3 + k] = v == 0 || at[k] > out[3 + k] ? at[k] : out[3 + k];
    }
  }
}

static void geoms_take(const mjModel *m, oracle_model *out)
{
  oracle_geoms *to = &out->geoms;
  const ptrdiff_t n = m->ngeom;
  TAKE(to->type, int, m->geom_type, n);
  TAKE(to->contype, int, m->geom_contype, n);
  TAKE(to->conaffinity, int, m->geom_conaffinity, n);
  TAKE(to->material, int, m->geom_matid, n);
  TAKE(to->data, int, m->geom_dataid, n);
  TAKE(to->pos, double, m->geom_pos, 3 * n);
  TAKE(to->quat, double, m->geom_quat, 4 * n);
  TAKE(to->size, double, m->geom_size, 3 * n);
  double *boxes = model_take(out, 6 * (size_t)n * sizeof(double));
  for (int g = 0; g < m->ngeom; ++g) {
    box_take(m, g, boxes + 6 * (ptrdiff_t)g);
  }
  to->box = boxes;
  TAKE(to->friction, double, m->geom_friction, 3 * n);
  TAKE(to->rgba, double, m->geom_rgba, 4 * n);
  TAKE(to->material_rgba, double, m->mat_rgba, 4 * (ptrdiff_t)m->nmat);
  TAKE(to->field_rows, int, m->hfield_nrow, m->nhfield);
  TAKE(to->field_columns, int, m->hfield_ncol, m->nhfield);
  TAKE(to->field_at, int, m->hfield_adr, m->nhfield);
  TAKE(to->field_size, double, m->hfield_size, 4 * (ptrdiff_t)m->nhfield);
  TAKE(to->field_data, double, m->hfield_data, m->nhfielddata);
}

bool oracle_library_read(const char *path, oracle_model *out, char *why, size_t size)
{
  memset(out, 0, sizeof *out);
  mjModel *model = mj_loadXML(path, NULL, why, (int)size);
  if (model == NULL) {
    return false;
  }
  mjData *data = mj_makeData(model);
  mj_kinematics(model, data);
  if ((model->opt.disableflags & mjDSBL_GRAVITY) == 0) {
    memcpy(out->gravity, model->opt.gravity, sizeof out->gravity);
  }
  bodies_take(model, data, out);
  joints_take(model, out);
  geoms_take(model, out);
  mj_deleteData(data);
  mj_deleteModel(model);
  return true;
}

#else

bool oracle_library_is_there(void)
{
  return false;
}

bool oracle_library_read(const char *path, oracle_model *out, char *why, size_t size)
{
  memset(out, 0, sizeof *out);
  (void)snprintf(why, size, "%s: no MuJoCo", path);
  return false;
}

#endif

/* ---- the package for node ---- */

static struct {
  pid_t child; /* 0: none */
  int to;
  FILE *from;
} node;

typedef struct array_place {
  const char *name;
  size_t offset; /* of a pointer in oracle_model */
  bool is_real;
} array_place;

#define INTS(name, member)                      \
  {                                             \
    name, offsetof(oracle_model, member), false \
  }
#define REALS(name, member)                    \
  {                                            \
    name, offsetof(oracle_model, member), true \
  }

static const array_place arrays[] = {
    INTS("body_jntadr", bodies.joint_at),
    INTS("body_jntnum", bodies.joint_count),
    INTS("body_geomadr", bodies.geom_at),
    INTS("body_geomnum", bodies.geom_count),
    REALS("body_mass", bodies.mass),
    REALS("body_ipos", bodies.ipos),
    REALS("body_iquat", bodies.iquat),
    REALS("body_inertia", bodies.inertia),
    REALS("xpos", bodies.xpos),
    REALS("xquat", bodies.xquat),
    INTS("jnt_type", joints.type),
    INTS("jnt_qposadr", joints.qpos_at),
    INTS("jnt_dofadr", joints.dof_at),
    INTS("jnt_limited", joints.limited),
    REALS("jnt_pos", joints.pos),
    REALS("jnt_axis", joints.axis),
    REALS("jnt_range", joints.range),
    REALS("jnt_stiffness", joints.stiffness),
    REALS("dof_damping", joints.damping),
    REALS("dof_armature", joints.armature),
    REALS("dof_frictionloss", joints.friction),
    REALS("qpos0", joints.qpos0),
    REALS("qpos_spring", joints.qpos_spring),
    INTS("geom_type", geoms.type),
    INTS("geom_contype", geoms.contype),
    INTS("geom_conaffinity", geoms.conaffinity),
    INTS("geom_matid", geoms.material),
    INTS("geom_dataid", geoms.data),
    REALS("geom_pos", geoms.pos),
    REALS("geom_quat", geoms.quat),
    REALS("geom_size", geoms.size),
    REALS("geom_box", geoms.box),
    REALS("geom_friction", geoms.friction),
    REALS("geom_rgba", geoms.rgba),
    REALS("mat_rgba", geoms.material_rgba),
    INTS("hfield_nrow", geoms.field_rows),
    INTS("hfield_ncol", geoms.field_columns),
    INTS("hfield_adr", geoms.field_at),
    REALS("hfield_size", geoms.field_size),
    REALS("hfield_data", geoms.field_data),
};

bool oracle_node_is_there(void)
{
  return getenv("HAPODE_MUJOCO_NODE") != NULL && getenv("HAPODE_SOURCE") != NULL;
}

static bool node_start(void)
{
  int to[2];
  int from[2];
  char script[4096];
  (void)snprintf(script, sizeof script, "%s/tests/mujoco_models.mjs", getenv("HAPODE_SOURCE"));
  /* A socket can be written to without a signal when its reader has ended. */
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, to) != 0 || pipe2(from, O_CLOEXEC) != 0) {
    return false;
  }
  node.child = fork();
  if (node.child == 0) {
    (void)dup2(to[0], STDIN_FILENO);
    (void)dup2(from[1], STDOUT_FILENO);
    execlp("node", "node", script, getenv("HAPODE_MUJOCO_NODE"), (char *)NULL);
    _exit(127);
  }
  close(to[0]);
  close(from[1]);
  node.to = to[1];
  node.from = fdopen(from[0], "r");
  return node.child > 0 && node.from != NULL;
}

static void node_stop(void)
{
  close(node.to);
  (void)fclose(node.from);
  (void)waitpid(node.child, NULL, 0);
  node.child = 0;
}

/* NAME COUNT NUMBER... of one line. */
static bool array_read(oracle_model *out, const char *name, char *rest)
{
  char *at = rest;
  const long count = strtol(rest, &at, 10);
  for (size_t a = 0; a < sizeof arrays / sizeof arrays[0]; ++a) {
    if (strcmp(arrays[a].name, name) != 0) {
      continue;
    }
    double *reals = model_take(out, (size_t)count * sizeof(double));
    int *ints = model_take(out, (size_t)count * sizeof(int));
    for (long k = 0; k < count; ++k) {
      char *end;
      reals[k] = strtod(at, &end);
      if (end == at) {
        return false;
      }
      ints[k] = arrays[a].is_real ? 0 : (int)reals[k];
      at = end;
    }
    memcpy((char *)out + arrays[a].offset, arrays[a].is_real ? (void *)&reals : (void *)&ints,
           sizeof(void *));
    return true;
  }
  if (strcmp(name, "gravity") == 0) {
    for (int k = 0; k < 3; ++k) {
      out->gravity[k] = strtod(at, &at);
    }
    return true;
  }
  return false;
}

/* A line without its end; NULL: the program has ended. */
static char *line_read(char **line, size_t *size)
{
  if (getline(line, size, node.from) < 0) {
    return NULL;
  }
  (*line)[strcspn(*line, "\n")] = '\0';
  return *line;
}

static bool names_read(oracle_model *out, int count, char **line, size_t *size)
{
  const char **names = model_take(out, (size_t)count * sizeof(char *));
  for (int i = 0; i < count; ++i) {
    if (line_read(line, size) == NULL) {
      return false;
    }
    char *copied = model_take(out, strlen(*line) + 1);
    names[i] = strcpy(copied, *line);
  }
  out->bodies.count = count;
  out->bodies.names = names;
  return true;
}

/* All that follows "model": false where it is not as agreed. */
static bool answer_read(oracle_model *out, char **line, size_t *size)
{
  while (line_read(line, size) != NULL) {
    char *rest;
    const char *name = strtok_r(*line, " ", &rest);
    if (name == NULL) {
      return false;
    }
    if (strcmp(name, "end") == 0) {
      return out->bodies.count > 0;
    }
    const bool good = strcmp(name, "bodies") == 0
                          ? names_read(out, (int)strtol(rest, NULL, 10), line, size)
                          : array_read(out, name, rest);
    if (!good) {
      return false;
    }
  }
  return false;
}

bool oracle_node_read(const char *path, oracle_model *out, char *why, size_t size)
{
  char *line = NULL;
  size_t room = 0;
  char whole[4096];
  memset(out, 0, sizeof *out);
  (void)snprintf(why, size, "node or its MuJoCo has ended");
  const char *real = realpath(path, NULL);
  (void)snprintf(whole, sizeof whole, "%s\n", real != NULL ? real : path);
  free((void *)real);
  if (node.child == 0 && !node_start()) {
    return false;
  }
  bool good =
      send(node.to, whole, strlen(whole), MSG_NOSIGNAL) >= 0 && line_read(&line, &room) != NULL;
  if (good && strncmp(line, "refused ", 8) == 0) {
    (void)snprintf(why, size, "%s", line + 8);
    free(line);
    return false;
  }
  good = good && strncmp(line, "model ", 6) == 0 && answer_read(out, &line, &room);
  free(line);
  if (!good) {
    oracle_model_free(out);
    node_stop(); /* the next file has another one */
  }
  return good;
}
