/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

#include <assert.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <scenes/build.h>

#define SHIFT_MAX 1e3 /* m */

static const double push_out_speed = 0.5; /* m/s, of bodies that penetrate */

static hap_status spec_fail(hap_detail *detail, hap_status status, const char *format, ...)
    HAP_PRINTF(3, 4);

static hap_status spec_fail(hap_detail *detail, hap_status status, const char *format, ...)
{
  if (detail != NULL) {
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(detail->text, sizeof detail->text, format, arguments);
    va_end(arguments);
  }
  return status;
}

/* "fig5, fig6, fig7:N, ..." */
static const char *list_scenes(char *out, size_t size)
{
  size_t used = 0;
  out[0] = '\0';
  for (size_t i = 0; scene_row_at(i) != NULL && used < size; ++i) {
    const scene_parameters *p = &scene_row_at(i)->parameters;
    const int n = snprintf(out + used, size - used, "%s%s%s", i != 0 ? ", " : "", p->name,
                           p->count_default > 0 ? ":N" : "");
    used += (size_t)n;
  }
  return out;
}

static const scene_row *find_row(const char *name, size_t length)
{
  for (size_t i = 0; scene_row_at(i) != NULL; ++i) {
    const char *have = scene_row_at(i)->parameters.name;
    if (strlen(have) == length && memcmp(have, name, length) == 0) {
      return scene_row_at(i);
    }
  }
  return NULL;
}

/* Digits only, 1 .. SCENE_COUNT_MAX; otherwise 0. */
static int parse_count(const char *text)
{
  int count = 0;
  for (const char *c = text; *c != '\0'; ++c) {
    if (*c < '0' || *c > '9') {
      return 0;
    }
    count = 10 * count + (*c - '0');
    if (count > SCENE_COUNT_MAX) {
      return 0;
    }
  }
  return count;
}

static bool at_least(double value, double least, bool strictly)
{
  return strictly ? value > least : value >= least; /* both false for NaN */
}

/* Name of the first field that cannot be built, or NULL. */
static const char *bad_parameter(const scene_parameters *p)
{
  const struct {
    const char *name;
    double value;
    double least;
    bool strictly;
  } checks[] = {
      {"mass", p->mass, 0, true},
      {"size", p->size, 0, true},
      {"gravity", p->gravity, -1e6, false},
      {"gap", p->gap, -p->size / 2, true},
      {"radius", p->radius, 0, true},
      {"stiffness", p->stiffness, 0, false},
      {"damping", p->damping, 0, false},
      {"tool", p->tool[0], 0, false},
      {"tool", p->tool[1], p->tool[0] > 0 ? 1e-6 : 0, false},
      {"tool", p->tool[2], p->tool[0] > 0 ? 1e-6 : 0, false},
      {"duration", p->duration, 0, true},
      {"iterations", p->iterations, 1, false},
      {"hinge_torque", p->hinge_torque, 0, false},
      {"layer", p->layer, 0, false},
      {"friction", p->friction, 0, false},
      {"finger_radius", p->finger_radius, 0, false},
      {"shift", p->shift[0], -SHIFT_MAX, false},
      {"shift", p->shift[1], -SHIFT_MAX, false},
      {"shift", p->shift[2], -SHIFT_MAX, false},
  };
  for (size_t i = 0; i < sizeof checks / sizeof checks[0]; ++i) {
    if (!isfinite(checks[i].value) ||
        !at_least(checks[i].value, checks[i].least, checks[i].strictly)) {
      return checks[i].name;
    }
  }
  if (!(p->mu >= 0)) {
    return "mu";
  }
  if (p->pointers < 1 || p->pointers > SCENE_POINTERS_MAX) {
    return "pointers";
  }
  for (int i = 0; i < p->pointers; ++i) {
    if (p->hands[i] == NULL) {
      return "hands";
    }
  }
  return NULL;
}

static void create_world(scene *s)
{
  s->world = dWorldCreate();
  s->space = dHashSpaceCreate(NULL);
  dWorldSetGravity(s->world, 0, 0, -s->parameters.gravity);
  dWorldSetERP(s->world, 0.2);
  dWorldSetCFM(s->world, 1e-10); /* more shows in measured accelerances */
  dWorldSetQuickStepNumIterations(s->world, s->parameters.iterations);
  dWorldSetContactMaxCorrectingVel(s->world, push_out_speed);
  dWorldSetContactSurfaceLayer(s->world, s->parameters.layer);
  dWorldSetAutoDisableFlag(s->world, 0);
}

/* Where a joint hangs on the world, its place there is taken anew: the bodies are not turned, so
 * that this changes nothing else. */
static void shift_joint(dJointID joint, const double shift[3])
{
  dVector3 at;
  dVector3 axis;
  if (dJointGetBody(joint, 0) != NULL && dJointGetBody(joint, 1) != NULL) {
    return;
  }
  if (dJointGetType(joint) == dJointTypeHinge) {
    dJointGetHingeAxis(joint, axis);
    dJointGetHingeAnchor2(joint, at);
    dJointSetHingeAnchor(joint, at[0] + shift[0], at[1] + shift[1], at[2] + shift[2]);
    dJointSetHingeAxis(joint, axis[0], axis[1], axis[2]);
  } else if (dJointGetType(joint) == dJointTypeSlider) {
    dJointGetSliderAxis(joint, axis);
    dJointSetSliderAxis(joint, axis[0], axis[1], axis[2]);
  }
}

static void shift_bodies(scene *s)
{
  const double *shift = s->parameters.shift;
  if (shift[0] == 0 && shift[1] == 0 && shift[2] == 0) {
    return; /* bit for bit the scene itself */
  }
  for (size_t i = 0; i < s->body_count; ++i) {
    const dReal *x = dBodyGetPosition(s->bodies[i]);
    dBodySetPosition(s->bodies[i], x[0] + shift[0], x[1] + shift[1], x[2] + shift[2]);
    for (int k = 0; k < dBodyGetNumJoints(s->bodies[i]); ++k) {
      shift_joint(dBodyGetJoint(s->bodies[i], k), shift);
    }
  }
}

/* parameters were checked, count is in range */
static hap_status scene_build(const scene_row *row, const scene_parameters *parameters, int count,
                              scene **out, hap_detail *detail)
{
  const size_t bodies = (size_t)(count > 0 ? count : row->bodies);
  scene *s = calloc(1, sizeof *s);
  dBodyID *list = calloc(bodies, sizeof(dBodyID));
  if (s == NULL || list == NULL) {
    free(s);
    free(list);
    return spec_fail(detail, HAP_ERROR_MEMORY, "no memory for scene '%s' of %zu bodies",
                     row->parameters.name, bodies);
  }
  s->parameters = *parameters;
  s->parameters.name = row->parameters.name;
  s->count = count;
  s->bodies = list;
  create_world(s);
  row->build(s);
  assert(s->body_count == bodies);
  shift_bodies(s);
  *out = s;
  return HAP_OK;
}

hap_status scene_create_from(const scene_parameters *parameters, int count, scene **out,
                             hap_detail *detail)
{
  char all[256];
  if (out == NULL) {
    return spec_fail(detail, HAP_ERROR_ARGUMENT, "scene: out is NULL");
  }
  *out = NULL;
  if (parameters == NULL || parameters->name == NULL) {
    return spec_fail(detail, HAP_ERROR_ARGUMENT, "scene: no name; there are: %s",
                     list_scenes(all, sizeof all));
  }
  const scene_row *row = find_row(parameters->name, strlen(parameters->name));
  if (row == NULL) {
    return spec_fail(detail, HAP_ERROR_NOT_FOUND, "no scene '%.40s'; there are: %s",
                     parameters->name, list_scenes(all, sizeof all));
  }
  const char *bad = bad_parameter(parameters);
  if (bad != NULL) {
    return spec_fail(detail, HAP_ERROR_ARGUMENT, "scene '%s' cannot be built with this %s",
                     parameters->name, bad);
  }
  const int count_max = row->parameters.count_default > 0 ? SCENE_COUNT_MAX : 0;
  const int count_min = count_max > 0 ? 1 : 0;
  const int wanted = count != 0 ? count : parameters->count_default;
  if (wanted < count_min || wanted > count_max) {
    return spec_fail(detail, HAP_ERROR_ARGUMENT, "scene '%s': N is %d .. %d, not %d; there are: %s",
                     parameters->name, count_min, count_max, wanted, list_scenes(all, sizeof all));
  }
  return scene_build(row, parameters, wanted, out, detail);
}

hap_status scene_create(const char *spec, scene **out, hap_detail *detail)
{
  char all[256];
  if (out == NULL) {
    return spec_fail(detail, HAP_ERROR_ARGUMENT, "scene: out is NULL");
  }
  *out = NULL;
  const char *name = spec != NULL ? spec : "";
  const size_t length = strcspn(name, ":");
  const scene_row *row = find_row(name, length);
  if (row == NULL) {
    return spec_fail(detail, spec != NULL ? HAP_ERROR_NOT_FOUND : HAP_ERROR_ARGUMENT,
                     "no scene '%.40s'; there are: %s", name, list_scenes(all, sizeof all));
  }
  int count = 0;
  if (name[length] == ':') {
    if (row->parameters.count_default == 0) {
      return spec_fail(detail, HAP_ERROR_ARGUMENT, "scene '%s' takes no N; there are: %s",
                       row->parameters.name, list_scenes(all, sizeof all));
    }
    count = parse_count(name + length + 1);
    if (count == 0) {
      return spec_fail(detail, HAP_ERROR_ARGUMENT,
                       "scene '%s': N is a number from 1 to %d, not '%.40s'; there are: %s",
                       row->parameters.name, SCENE_COUNT_MAX, name + length + 1,
                       list_scenes(all, sizeof all));
    }
  }
  return scene_create_from(&row->parameters, count, out, detail);
}

void scene_destroy(scene *s)
{
  if (s == NULL) {
    return;
  }
  dSpaceDestroy(s->space);
  if (s->field.data != NULL) {
    dGeomHeightfieldDataDestroy(s->field.data);
  }
  dWorldDestroy(s->world);
  free(s->bodies);
  free(s);
}

double scene_friction_of(const scene *s, dGeomID geom)
{
  for (size_t i = 0; i < s->friction_count; ++i) {
    if (s->frictions[i].geom == geom) {
      return s->frictions[i].mu;
    }
  }
  return s->parameters.mu;
}

bool scene_surface(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  const scene *s = user;
  const dBodyID body_a = dGeomGetBody(a);
  const dBodyID body_b = dGeomGetBody(b);
  if (body_a == body_b || (body_a != NULL && body_b != NULL &&
                           dAreConnectedExcluding(body_a, body_b, dJointTypeContact))) {
    return false;
  }
  io->mode = dContactApprox1;
  const double mu_a = scene_friction_of(s, a);
  const double mu_b = scene_friction_of(s, b);
  io->mu = mu_a == mu_b ? mu_a : sqrt(mu_a * mu_b);
  return true;
}
