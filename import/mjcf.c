/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "import/mjcf.h"

#include <math.h>
#include <string.h>

#include "base/log.h"
#include "import/mjcf_internal.h"

/* The sections of the file. */

static hap_status sequence_read(mjcf *m, const xml_element *element)
{
  const char *sequence = xml_get(element, "eulerseq");
  if (sequence == NULL) {
    return HAP_OK;
  }
  if (strlen(sequence) != 3 || strspn(sequence, "xyzXYZ") != 3) {
    return import_refuse(m->work, element->at, "eulerseq: not three of x, y, z, X, Y, Z");
  }
  m->compiler.euler_sequence = sequence;
  return HAP_OK;
}

static hap_status compiler_read(mjcf *m, const xml_element *element)
{
  const mjcf_item item = {element, NULL};
  mjcf_compiler *c = &m->compiler;
  int degrees = c->angle != 1.0;
  int limits = c->auto_limits;
  int from = (int)c->inertia_from;
  int balance = c->balance_inertia;
  int local = 0;
  size_t count;
  HAPI_TRY(mjcf_word(m, &item, "angle", "radian degree", &degrees));
  HAPI_TRY(mjcf_word(m, &item, "autolimits", "false true", &limits));
  HAPI_TRY(mjcf_word(m, &item, "inertiafromgeom", "false true auto", &from));
  HAPI_TRY(mjcf_word(m, &item, "balanceinertia", "false true", &balance));
  HAPI_TRY(mjcf_word(m, &item, "coordinate", "local", &local));
  HAPI_TRY(sequence_read(m, element));
  HAPI_TRY(mjcf_numbers(m, &item, "inertiagrouprange", XML_OF(2, 2), c->groups, &count));
  HAPI_TRY(mjcf_number(m, &item, "boundmass", &c->bound_mass));
  HAPI_TRY(mjcf_number(m, &item, "boundinertia", &c->bound_inertia));
  HAPI_TRY(mjcf_number(m, &item, "settotalmass", &c->total_mass));
  c->angle = degrees != 0 ? M_PI / 180.0 : 1.0;
  c->auto_limits = limits != 0;
  c->inertia_from = (mjcf_inertia_from)from;
  c->balance_inertia = balance != 0;
  const char *meshes = xml_get(element, "meshdir");
  const char *assets = xml_get(element, "assetdir");
  c->mesh_folder = meshes != NULL ? meshes : assets != NULL ? assets : c->mesh_folder;
  return HAP_OK;
}

static hap_status option_read(mjcf *m, const xml_element *element)
{
  size_t count;
  HAPI_TRY(xml_numbers(m->work, element, "gravity", XML_OF(3, 3), m->model->gravity, &count));
  const xml_element *flag = xml_child(element, "flag");
  const char *gravity = flag != NULL ? xml_get(flag, "gravity") : NULL;
  if (gravity != NULL && strcmp(gravity, "disable") == 0) {
    memset(m->model->gravity, 0, sizeof m->model->gravity);
  }
  return HAP_OK;
}

/* Two bodies that an element names; what is not named stays. *out_there: both are there. Refused:
 * they are not, unless <replicate> has given its copies other names. */
static hap_status ends_find(mjcf *m, const xml_element *element, const import_body *io[2],
                            bool *out_there)
{
  const char *names[2] = {xml_get(element, "body1"), xml_get(element, "body2")};
  *out_there = true;
  for (int i = 0; i < 2; ++i) {
    io[i] = names[i] != NULL ? import_find_body(m->model, names[i]) : io[i];
    if (io[i] == NULL && m->replicas > 0 && names[i] != NULL) {
      *out_there = false;
    } else if (io[i] == NULL) {
      return import_refuse(m->work, element->at, "body%d: there is no body %.60s", i + 1,
                           names[i] != NULL ? names[i] : "without a name");
    }
  }
  if (!*out_there) {
    import_note(m->work, element->at, "%.40s between copies left out", element->name);
  }
  return HAP_OK;
}

static hap_status exclude_read(mjcf *m, const xml_element *element)
{
  const import_body *bodies[2] = {NULL, NULL};
  bool there;
  HAPI_TRY(ends_find(m, element, bodies, &there));
  if (!there) {
    return HAP_OK;
  }
  import_pass *pass = import_take(m->work, sizeof *pass);
  if (pass == NULL) {
    return import_no_memory(m->work);
  }
  *pass = (import_pass){bodies[0], bodies[1], m->model->passes};
  m->model->passes = pass;
  return HAP_OK;
}

static hap_status contact_read(mjcf *m, const xml_element *contact)
{
  for (const xml_element *child = contact->children; child != NULL; child = child->next) {
    if (xml_is(child, "exclude")) {
      HAPI_TRY(exclude_read(m, child));
    }
  }
  return HAP_OK;
}

/* connect and weld between bodies; all else is noted. */
static hap_status hold_read(mjcf *m, const xml_element *element)
{
  const mjcf_item item = {element, m->classes};
  const import_body *bodies[2] = {NULL, m->model->bodies};
  size_t count;
  bool there;
  HAPI_TRY(ends_find(m, element, bodies, &there));
  if (!there) {
    return HAP_OK;
  }
  import_hold *hold = import_take(m->work, sizeof *hold);
  if (hold == NULL) {
    return import_no_memory(m->work);
  }
  HAPI_TRY(mjcf_numbers(m, &item, "anchor", XML_OF(3, 3), hold->anchor, &count));
  hold->at = element->at;
  hold->a = bodies[0];
  hold->b = bodies[1];
  hold->is_fixed = xml_is(element, "weld");
  hold->next = m->model->holds;
  m->model->holds = hold;
  return HAP_OK;
}

static hap_status equality_read(mjcf *m, const xml_element *equality)
{
  for (const xml_element *child = equality->children; child != NULL; child = child->next) {
    const char *active = xml_get(child, "active");
    if (!(xml_is(child, "connect") || xml_is(child, "weld")) || xml_get(child, "site1") != NULL ||
        xml_get(child, "relpose") != NULL || (active != NULL && strcmp(active, "false") == 0)) {
      import_note(m->work, child->at, "equality: %.40s left out", child->name);
      continue;
    }
    HAPI_TRY(hold_read(m, child));
  }
  return HAP_OK;
}

static hap_status sections_read(mjcf *m, const char *name,
                                hap_status (*read)(mjcf *m, const xml_element *section))
{
  for (const xml_element *top = m->root->children; top != NULL; top = top->next) {
    if (xml_is(top, name)) {
      HAPI_TRY(read(m, top));
    }
  }
  return HAP_OK;
}

static hap_status world_begin(mjcf *m)
{
  const char *name = xml_get(m->root, "model");
  import_body *world = import_take(m->work, sizeof *world);
  if (world == NULL) {
    return import_no_memory(m->work);
  }
  world->at = m->root->at;
  world->name = "world";
  world->pose.quat_wxyz[0] = 1.0;
  m->model->name = name != NULL ? name : "";
  m->model->bodies = m->last_body = world;
  m->model->gravity[2] = -9.81;
  return HAP_OK;
}

hap_status mjcf_read(import_work *work, const xml_element *root, import_model *out)
{
  mjcf m = {.work = work,
            .model = out,
            .root = root,
            .compiler = {.angle = M_PI / 180.0,
                         .euler_sequence = "xyz",
                         .auto_limits = true,
                         .inertia_from = MJCF_FROM_EITHER,
                         .groups = {0.0, 5.0},
                         .mesh_folder = ""}};
  memset(out, 0, sizeof *out);
  HAPI_TRY(mjcf_note_rest(&m));
  HAPI_TRY(world_begin(&m));
  HAPI_TRY(sections_read(&m, "compiler", compiler_read));
  HAPI_TRY(sections_read(&m, "option", option_read));
  HAPI_TRY(mjcf_read_defaults(&m));
  HAPI_TRY(sections_read(&m, "worldbody", mjcf_read_worldbody));
  HAPI_TRY(sections_read(&m, "contact", contact_read));
  HAPI_TRY(sections_read(&m, "equality", equality_read));
  return mjcf_settle(&m);
}
