/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_IMPORT_MJCF_INTERNAL_H
#define HAPODE_IMPORT_MJCF_INTERNAL_H

/* Shared by the readers of MJCF. Names of elements and attributes: MuJoCo's XML reference. */

#include "import/model.h"
#include "import/xml.h"

typedef struct mjcf_class {
  const char *name;
  const struct mjcf_class *parent; /* NULL: main */
  struct mjcf_class *next;
} mjcf_class;

/* A <default> section of a class; a class may have several. */
typedef struct mjcf_section {
  const mjcf_class *of;
  const xml_element *element;
  struct mjcf_section *next;
} mjcf_section;

typedef enum mjcf_inertia_from {
  MJCF_FROM_INERTIAL = 0,
  MJCF_FROM_GEOMS,
  MJCF_FROM_EITHER /* inertial where there is one */
} mjcf_inertia_from;

/* What <compiler> says. */
typedef struct mjcf_compiler {
  double angle; /* rad of its unit */
  const char *euler_sequence;
  bool auto_limits;
  mjcf_inertia_from inertia_from;
  double groups[2]; /* of geoms that count for inertia */
  double bound_mass;
  double bound_inertia;
  bool balance_inertia;
  double total_mass; /* kg; <= 0: as it comes */
  const char *mesh_folder;
} mjcf_compiler;

/* Of <asset>, in the frame of its file. */
typedef struct mjcf_mesh {
  const xml_element *element;
  const import_mesh *hull; /* NULL: it was left out */
  import_mass mass;        /* of density 1 */
  struct mjcf_mesh *next;
} mjcf_mesh;

/* Likewise. */
typedef struct mjcf_field {
  const xml_element *element;
  const import_field *field; /* NULL: it was left out */
  double size[4];            /* half edges, height, depth of the base */
  struct mjcf_field *next;
} mjcf_field;

typedef struct mjcf {
  import_work *work;
  import_model *model;
  const xml_element *root;
  mjcf_compiler compiler;
  mjcf_class *classes; /* the first is main */
  mjcf_section *sections;
  mjcf_mesh *meshes;
  mjcf_field *fields;
  import_body *last_body;
  size_t bodies;
  size_t things;   /* geoms and joints */
  size_t replicas; /* of <replicate> */
} mjcf;

/* An element with what its class adds. */
typedef struct mjcf_item {
  const xml_element *element;
  const mjcf_class *of; /* NULL: no defaults */
} mjcf_item;

/* ---- mjcf_defaults.c ---- */

HAP_NODISCARD hap_status mjcf_read_defaults(mjcf *m);
/* Of the element's own class or, without one, of childclass. Refused: a class that is not there. */
HAP_NODISCARD hap_status mjcf_item_of(mjcf *m, const xml_element *element,
                                      const mjcf_class *childclass, mjcf_item *out);
HAP_NODISCARD hap_status mjcf_find_class(mjcf *m, const xml_element *element, const char *attribute,
                                         const mjcf_class *otherwise, const mjcf_class **out);
/* NULL: neither the element nor its class has it. */
const char *mjcf_get(const mjcf *m, const mjcf_item *item, const char *name);
/* As xml_numbers; the numbers of the element stand over those of its class. *out_count: of the most
 * that one of them had. */
HAP_NODISCARD hap_status mjcf_numbers(mjcf *m, const mjcf_item *item, const char *name,
                                      xml_span span, double *out, size_t *out_count);
HAP_NODISCARD hap_status mjcf_number(mjcf *m, const mjcf_item *item, const char *name, double *io);
/* A place in a list of words that blanks part; without the attribute *io stays. */
HAP_NODISCARD hap_status mjcf_word(mjcf *m, const mjcf_item *item, const char *name,
                                   const char *words, int *io);

/* ---- mjcf_frames.c ---- */

/* pos and quat, axisangle, xyaxes, zaxis, euler. */
HAP_NODISCARD hap_status mjcf_pose(mjcf *m, const mjcf_item *item, hap_pose *out);
/* Turns z into the direction on the shortest way. */
void mjcf_turn_z(const double direction[3], double out_quat[4]);
void mjcf_turn_euler(const mjcf *m, const double angles[3], double out_quat[4]);

/* ---- mjcf_mesh.c ---- */

/* The mesh that a geom names; refused where there is none. */
HAP_NODISCARD hap_status mjcf_find_mesh(mjcf *m, const mjcf_item *geom, const mjcf_mesh **out);

/* The element of the <asset> section of that name, or of a file of that name. NULL: there is none.
 */
const xml_element *mjcf_asset(const mjcf *m, const char *kind, const char *name);
/* All numbers of an attribute. */
HAP_NODISCARD hap_status mjcf_list(mjcf *m, const xml_element *element, const char *name,
                                   double **out, size_t *out_count);

/* ---- mjcf_field.c ---- */

/* The height field that a geom names; refused where there is none. */
HAP_NODISCARD hap_status mjcf_find_field(mjcf *m, const mjcf_item *geom, const mjcf_field **out);

/* ---- mjcf_geom.c, mjcf_joint.c, mjcf_body.c ---- */

HAP_NODISCARD hap_status mjcf_read_geom(mjcf *m, const mjcf_item *item, const hap_pose *frame,
                                        import_body *body);
HAP_NODISCARD hap_status mjcf_read_joint(mjcf *m, const mjcf_item *item, const hap_pose *frame,
                                         import_body *body);
HAP_NODISCARD hap_status mjcf_read_worldbody(mjcf *m, const xml_element *worldbody);
/* Bounds, total mass, masses from geoms. */
HAP_NODISCARD hap_status mjcf_settle(mjcf *m);

/* ---- mjcf_notes.c ---- */

/* Refused: what would make another scene of it. Noted: what is left out. */
HAP_NODISCARD hap_status mjcf_note_rest(mjcf *m);

#endif
