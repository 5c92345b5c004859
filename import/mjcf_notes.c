/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "base/log.h"
#include "import/mjcf_internal.h"

/* What the readers do not take is told, so that nothing is lost in silence. */

typedef struct mjcf_known {
  const char *element;
  const char *taken;    /* attributes that are read */
  const char *harmless; /* attributes that change nothing of what is felt */
} mjcf_known;

#define PLACE "pos quat axisangle xyaxes zaxis euler"

/* Softness, margins and dimensions of contacts are the library's own for all geoms. */
static const mjcf_known elements[] = {
    {"body", "name childclass " PLACE, "user"},
    {"frame", "name childclass " PLACE, ""},
    {"replicate", "count offset euler sep childclass", ""},
    {"hfield", "name file size nrow ncol elevation", "content_type"},
    {"inertial", "pos quat axisangle xyaxes zaxis euler mass diaginertia fullinertia", ""},
    {"geom",
     "name class type contype conaffinity size material rgba friction mass density hfield mesh "
     "fromto group " PLACE,
     "user condim priority solmix solref solimp margin gap"},
    {"joint",
     "name class type pos axis limited range ref armature frictionloss stiffness "
     "springref damping springdamper",
     "group user solreffriction solimpfriction solreflimit solimplimit margin "
     "actuatorfrcrange actuatorfrclimited actuatorgravcomp"},
    {"mesh", "name class file vertex face scale refpos refquat inertia",
     "normal texcoord smoothnormal maxhullvert content_type material"},
    {"freejoint", "name", "group align"},
    {"compiler",
     "angle eulerseq autolimits inertiafromgeom inertiagrouprange boundmass boundinertia "
     "balanceinertia settotalmass meshdir assetdir",
     "texturedir discardvisual usethread strippath convexhull fusestatic saveinertial "
     "alignfree conflict"},
    {"option", "gravity",
     "timestep apirate impratio o_margin o_solref o_solimp o_friction integrator cone jacobian "
     "solver iterations tolerance noslip_iterations noslip_tolerance mpr_iterations "
     "mpr_tolerance ccd_iterations ccd_tolerance sdf_iterations sdf_initpoints ls_iterations "
     "ls_tolerance magnetic"},
    {"exclude", "name class body1 body2", ""},
};

/* Shown, told or thought of, not felt. */
static const char harmless[] =
    "light camera site visual statistic size custom sensor keyframe texture material";
/* Would make another scene of it. */
static const char refused[] = "flex flexcomp composite plugin skin deformable";
/* Their own readers look at them. */
static const char groups[] =
    "mujoco mujocoinclude worldbody default asset contact equality extension";

static const mjcf_known *known_of(const xml_element *element)
{
  for (size_t i = 0; i < sizeof elements / sizeof elements[0]; ++i) {
    if (xml_is(element, elements[i].element)) {
      return &elements[i];
    }
  }
  return NULL;
}

/* "0", "false": as without it. */
static bool value_is_nothing(const char *value)
{
  return value[strspn(value, "0. \t")] == '\0' || strcmp(value, "false") == 0;
}

static void attributes_note(mjcf *m, const xml_element *element, const mjcf_known *known)
{
  for (const xml_attribute *a = element->attributes; a != NULL; a = a->next) {
    if (!xml_word_in(a->name, known->taken) && !xml_word_in(a->name, known->harmless) &&
        !value_is_nothing(a->value)) {
      import_note(m->work, element->at, "%.40s: %.40s left out", element->name, a->name);
    }
  }
}

static size_t children_count(const xml_element *element)
{
  size_t count = 0;
  for (const xml_element *child = element->children; child != NULL; child = child->next) {
    ++count;
  }
  return count;
}

/* Default sections have elements of all kinds. */
static hap_status element_note(mjcf *m, const xml_element *element, bool is_default)
{
  const mjcf_known *known = known_of(element);
  if (xml_word_in(element->name, refused)) {
    return import_refuse(m->work, element->at, "%.40s: cannot be felt as it is meant",
                         element->name);
  }
  if (known != NULL) {
    attributes_note(m, element, known);
  } else if (!is_default && !xml_word_in(element->name, harmless) &&
             !xml_word_in(element->name, groups)) {
    size_t inside = children_count(element);
    if (inside > 0) {
      import_note(m->work, element->at, "%.40s left out, %zu in it", element->name, inside);
    } else {
      import_note(m->work, element->at, "%.40s left out", element->name);
    }
    return HAP_OK;
  }
  if (xml_word_in(element->name, harmless) || xml_is(element, "equality")) {
    return HAP_OK; /* the reader of equality tells its own */
  }
  const bool inside = is_default || xml_is(element, "default");
  for (const xml_element *child = element->children; child != NULL; child = child->next) {
    HAPI_TRY(element_note(m, child, inside));
  }
  return HAP_OK;
}

hap_status mjcf_note_rest(mjcf *m)
{
  return element_note(m, m->root, false);
}
