/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/log.h"
#include "base/vec.h"
#include "import/mjcf_internal.h"

#define BODIES_MOST 10000u
#define COPIES_MOST 10000u /* by <replicate>, all together */

/* Where the children of an element are put. */
typedef struct mjcf_place {
  import_body *body;
  const mjcf_class *childclass;
  hap_pose frame;     /* in the body */
  const char *suffix; /* of names, by <replicate> */
} mjcf_place;

static hap_status children_read(mjcf *m, const xml_element *element, const mjcf_place *place);

static hap_status inertia_read(mjcf *m, const mjcf_item *item, double out[9])
{
  double d[3];
  double full[6];
  size_t diagonal;
  size_t count;
  HAPI_TRY(mjcf_numbers(m, item, "diaginertia", XML_OF(3, 3), d, &diagonal));
  HAPI_TRY(mjcf_numbers(m, item, "fullinertia", XML_OF(6, 6), full, &count));
  memset(out, 0, 9 * sizeof *out);
  if (diagonal > 0) {
    out[0] = d[0], out[4] = d[1], out[8] = d[2];
  } else if (count > 0) {
    const double m9[9] = {full[0], full[3], full[4], full[3], full[1],
                          full[5], full[4], full[5], full[2]};
    memcpy(out, m9, sizeof m9);
  }
  return HAP_OK;
}

static hap_status inertial_read(mjcf *m, const xml_element *element, const mjcf_place *place)
{
  const mjcf_item item = {element, NULL};
  import_mass own = {.mass = 0.0};
  hap_pose pose;
  HAPI_TRY(mjcf_number(m, &item, "mass", &own.mass));
  HAPI_TRY(inertia_read(m, &item, own.inertia));
  HAPI_TRY(mjcf_pose(m, &item, &pose));
  if (!(own.mass >= 0.0) ||
      !(own.inertia[0] >= 0.0 && own.inertia[4] >= 0.0 && own.inertia[8] >= 0.0)) {
    return import_refuse(m->work, element->at, "inertial: below 0");
  }
  if (m->compiler.inertia_from != MJCF_FROM_GEOMS && place->body->parent != NULL) {
    import_pose_join(&place->frame, &pose, &pose);
    import_mass_place(&pose, &own, &place->body->mass);
    place->body->mass_given = true;
  }
  return HAP_OK;
}

/* NULL: no memory. */
static const char *name_join(mjcf *m, const char *name, const char *suffix)
{
  const size_t size = strlen(name) + strlen(suffix) + 1;
  if (suffix[0] == '\0') {
    return name;
  }
  char *joined = import_take(m->work, size);
  if (joined != NULL) {
    (void)snprintf(joined, size, "%s%s", name, suffix);
  }
  return joined;
}

static hap_status body_read(mjcf *m, const xml_element *element, const mjcf_place *place)
{
  const mjcf_item item = {element, NULL};
  const char *name = xml_get(element, "name");
  mjcf_place inside = {.frame = {.quat_wxyz = {1.0, 0.0, 0.0, 0.0}}, .suffix = place->suffix};
  if (++m->bodies > BODIES_MOST) {
    return import_refuse(m->work, element->at, "more than 10000 bodies");
  }
  import_body *body = import_take(m->work, sizeof *body);
  name = name != NULL ? name_join(m, name, place->suffix) : "";
  if (body == NULL || name == NULL) {
    return import_no_memory(m->work);
  }
  *body = (import_body){.at = element->at,
                        .name = name,
                        .parent = place->body,
                        .mass_given = m->compiler.inertia_from == MJCF_FROM_INERTIAL};
  m->last_body->next = body;
  m->last_body = body;
  inside.body = body;
  HAPI_TRY(mjcf_pose(m, &item, &body->pose));
  import_pose_join(&place->frame, &body->pose, &body->pose);
  HAPI_TRY(mjcf_find_class(m, element, "childclass", place->childclass, &inside.childclass));
  return children_read(m, element, &inside);
}

static hap_status frame_read(mjcf *m, const xml_element *element, const mjcf_place *place)
{
  const mjcf_item item = {element, NULL};
  mjcf_place inside = *place;
  HAPI_TRY(mjcf_pose(m, &item, &inside.frame));
  import_pose_join(&place->frame, &inside.frame, &inside.frame);
  HAPI_TRY(mjcf_find_class(m, element, "childclass", place->childclass, &inside.childclass));
  return children_read(m, element, &inside);
}

/* Names of a copy end in its number, with as many digits as the count has. */
static const char *copy_suffix(mjcf *m, const mjcf_item *item, int count, int number,
                               const char *outer)
{
  char digits[16];
  char width[16];
  const char *separator = xml_get(item->element, "sep");
  const int most = snprintf(width, sizeof width, "%d", count);
  (void)snprintf(digits, sizeof digits, "%0*d", most, number);
  const char *own = name_join(m, separator != NULL ? separator : "", digits);
  return own != NULL ? name_join(m, own, outer) : NULL;
}

/* Each copy is placed in the frame of the one before it. */
static hap_status replicate_read(mjcf *m, const xml_element *element, const mjcf_place *place)
{
  const mjcf_item item = {element, NULL};
  double count = 0.0;
  double offset[3] = {0.0, 0.0, 0.0};
  double euler[3] = {0.0, 0.0, 0.0};
  double at[3] = {0.0, 0.0, 0.0};
  size_t given;
  mjcf_place inside = *place;
  HAPI_TRY(mjcf_number(m, &item, "count", &count));
  HAPI_TRY(mjcf_numbers(m, &item, "offset", XML_OF(3, 3), offset, &given));
  HAPI_TRY(mjcf_numbers(m, &item, "euler", XML_OF(3, 3), euler, &given));
  HAPI_TRY(mjcf_find_class(m, element, "childclass", place->childclass, &inside.childclass));
  if (!(count >= 1.0 && count <= (double)COPIES_MOST)) {
    return import_refuse(m->work, element->at, "count: not within 1 and 10000");
  }
  for (int i = 0; i < (int)count; ++i) {
    const double turned[3] = {i * euler[0], i * euler[1], i * euler[2]};
    double step[3];
    hap_pose own = {.quat_wxyz = {1.0, 0.0, 0.0, 0.0}};
    if (++m->replicas > COPIES_MOST) {
      return import_refuse(m->work, element->at, "more than 10000 copies");
    }
    hapi_v3_copy(at, own.position);
    mjcf_turn_euler(m, turned, own.quat_wxyz);
    import_pose_join(&place->frame, &own, &inside.frame);
    inside.suffix = copy_suffix(m, &item, (int)count, i, place->suffix);
    if (inside.suffix == NULL) {
      return import_no_memory(m->work);
    }
    HAPI_TRY(children_read(m, element, &inside));
    hapi_quat_rotate(own.quat_wxyz, offset, step);
    hapi_v3_add(at, step, at);
  }
  return HAP_OK;
}

static hap_status child_read(mjcf *m, const xml_element *child, const mjcf_place *place)
{
  mjcf_item item;
  if (xml_is(child, "body")) {
    return body_read(m, child, place);
  }
  if (xml_is(child, "frame")) {
    return frame_read(m, child, place);
  }
  if (xml_is(child, "replicate")) {
    return replicate_read(m, child, place);
  }
  if (xml_is(child, "inertial")) {
    return inertial_read(m, child, place);
  }
  if (xml_is(child, "freejoint")) {
    item = (mjcf_item){child, NULL};
    return mjcf_read_joint(m, &item, &place->frame, place->body);
  }
  if (xml_is(child, "geom")) {
    HAPI_TRY(mjcf_item_of(m, child, place->childclass, &item));
    return mjcf_read_geom(m, &item, &place->frame, place->body);
  }
  if (xml_is(child, "joint")) {
    HAPI_TRY(mjcf_item_of(m, child, place->childclass, &item));
    return mjcf_read_joint(m, &item, &place->frame, place->body);
  }
  return HAP_OK; /* mjcf_note_rest says which */
}

static hap_status children_read(mjcf *m, const xml_element *element, const mjcf_place *place)
{
  for (const xml_element *child = element->children; child != NULL; child = child->next) {
    HAPI_TRY(child_read(m, child, place));
  }
  return HAP_OK;
}

hap_status mjcf_read_worldbody(mjcf *m, const xml_element *worldbody)
{
  mjcf_place world = {
      .body = m->model->bodies, .frame = {.quat_wxyz = {1.0, 0.0, 0.0, 0.0}}, .suffix = ""};
  HAPI_TRY(mjcf_find_class(m, worldbody, "childclass", m->classes, &world.childclass));
  return children_read(m, worldbody, &world);
}

/* Bounds are of the principal moments; a bound of the diagonal alone would turn the axes. */
static void mass_bound(const mjcf *m, const import_body *body, import_mass *io)
{
  io->mass = fmax(io->mass, m->compiler.bound_mass);
  const double off = fabs(io->inertia[1]) + fabs(io->inertia[2]) + fabs(io->inertia[5]);
  const double bound = m->compiler.bound_inertia;
  if (off == 0.0) {
    for (int k = 0; k < 9; k += 4) {
      io->inertia[k] = fmax(io->inertia[k], bound);
    }
  } else if (bound > 0.0) {
    import_note(m->work, body->at, "boundinertia left out: the inertia is not along the axes");
  }
  const double *d = io->inertia;
  const double sum = d[0] + d[4] + d[8];
  if (m->compiler.balance_inertia && off == 0.0 &&
      (2.0 * d[0] > sum || 2.0 * d[4] > sum || 2.0 * d[8] > sum)) {
    io->inertia[0] = io->inertia[4] = io->inertia[8] = sum / 3.0;
  }
}

hap_status mjcf_settle(mjcf *m)
{
  double sum = 0.0;
  import_model_settle(m->model);
  for (import_body *body = m->model->bodies->next; body != NULL; body = body->next) {
    mass_bound(m, body, &body->mass);
    sum += body->mass.mass;
  }
  if (m->compiler.total_mass > 0.0 && sum > 0.0) {
    for (import_body *body = m->model->bodies->next; body != NULL; body = body->next) {
      import_mass_scale(&body->mass, m->compiler.total_mass / sum);
    }
  }
  return HAP_OK;
}
