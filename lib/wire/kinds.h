/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_WIRE_KINDS_H
#define HAPODE_WIRE_KINDS_H

/* What travels, as records of cells. A cell is a whole number of 64 bits, made of a member of a
 * struct of lib/sync; a record is a struct, or a part of one. All else in this folder knows cells
 * only. docs/wire.md lists kinds and cells. */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <hapode/status.h>

#include "sync/messages.h"

/* Values are of the wire. */
typedef enum hapi_wire_kind {
  /* server -> client */
  HAPI_WIRE_MODEL = 0,
  HAPI_WIRE_NEAR = 1,
  HAPI_WIRE_TRIANGLE = 2,
  HAPI_WIRE_BODY = 3,
  HAPI_WIRE_RESPONSE = 4,
  HAPI_WIRE_COURSE = 5,
  HAPI_WIRE_CONTACT = 6,
  HAPI_WIRE_JOINT = 7,
  HAPI_WIRE_MEASURED = 8,
  HAPI_WIRE_FEEL = 9,
  HAPI_WIRE_PLACED = 10, /* a body of the near message */
  HAPI_WIRE_VERTEX = 11,
  HAPI_WIRE_GEOM = 12,
  HAPI_WIRE_PAIR = 13,
  HAPI_WIRE_TOOL = 14,
  HAPI_WIRE_TOOL_PAIR = 15,
  HAPI_WIRE_HAND = 16, /* of another client */
  /* client -> server */
  HAPI_WIRE_STATE = 17,
  HAPI_WIRE_POINTER = 18,
  HAPI_WIRE_HULL = 19,
  HAPI_WIRE_MOVED = 20, /* a body of the state */
  HAPI_WIRE_TOUCH = 21, /* a contact of the state */
  HAPI_WIRE_SPRING = 22,
  HAPI_WIRE_GIVEN = 23, /* a joint of the state */
  HAPI_WIRE_SIDE = 24,
  HAPI_WIRE_KINDS = 25
} hapi_wire_kind;

typedef enum hapi_wire_type {
  HAPI_WIRE_U32,    /* uint32_t, an enum */
  HAPI_WIRE_U64,    /* uint64_t, int64_t, size_t */
  HAPI_WIRE_BOOL,   /* bool */
  HAPI_WIRE_EXACT,  /* double, all bits */
  HAPI_WIRE_OPEN,   /* the same, and it may be infinite */
  HAPI_WIRE_LIKE,   /* as EXACT, told by what differs from the field before: often nothing */
  HAPI_WIRE_SINGLE, /* double, rounded to a float */
  HAPI_WIRE_FIXED,  /* double, in whole steps of 2^-bits */
  HAPI_WIRE_QUAT,   /* double[4]: likewise, a unit quaternion */
  HAPI_WIRE_FREE,   /* the same, or four zeros */
  HAPI_WIRE_TAG,    /* hapi_tag: a number */
  HAPI_WIRE_OWN,    /* hapi_tag of a body: whether there is one */
  HAPI_WIRE_LABEL,  /* uint32_t: index of another record, by its label; bits: hapi_wire_kind */
  HAPI_WIRE_NOT     /* does not travel */
} hapi_wire_type;

#define HAPI_WIRE_POSITION_BITS 20u /* m: steps of 0.95 um */
#define HAPI_WIRE_QUAT_BITS 18u     /* turned by at most 7.6e-6 rad */
#define HAPI_WIRE_UNIT_BITS 24u     /* unit vectors: 6e-8 */
#define HAPI_WIRE_SPEED_BITS 17u    /* m/s, rad/s: steps of 7.6e-6 */
#define HAPI_WIRE_FORCE_BITS 12u    /* N: steps of 0.24 mN */

/* Cells lie beyond this from zero in no record: 2^62. */
#define HAPI_WIRE_FIXED_MOST 4611686018427387904.0

typedef struct hapi_wire_field {
  const char *name;
  uint16_t offset; /* in the struct */
  uint16_t size;   /* bytes there */
  uint16_t count;  /* of cells */
  uint8_t type;    /* hapi_wire_type */
  uint8_t bits;
} hapi_wire_field;

typedef struct hapi_wire_record {
  const char *name;
  const hapi_wire_field *fields;
  uint16_t field_count;
  uint16_t struct_size;
  uint8_t prefix; /* cells before those of the fields, which no struct has */
  bool known;     /* told once, reliably, before it is in a message */
  bool alike;     /* known by what it is, to a nanometre: it has no number of its own */
} hapi_wire_record;

extern const hapi_wire_record hapi_wire_records[HAPI_WIRE_KINDS];

/* Cells of a record of that kind, with its prefix. */
uint32_t hapi_wire_cells(hapi_wire_kind kind);
/* How many records of the kind a message may have. */
uint32_t hapi_wire_most(hapi_wire_kind kind, const hapi_capacity *capacity);

/* No record has more cells. */
#define HAPI_WIRE_CELLS_MOST 224u

/* Which cells change by an exclusive or: those of floating point. out: HAPI_WIRE_CELLS_MOST. */
void hapi_wire_find_xor(hapi_wire_kind kind, bool *out);

/* Numbers for tags, and labels for indices: what a record's cells need besides the struct. */
typedef struct hapi_wire_names {
  void *of;
  uint64_t (*tag)(void *of, hapi_tag tag);
  uint64_t (*label)(void *of, hapi_wire_kind kind, uint32_t index); /* 1 + label; 0: none */
} hapi_wire_names;

/* Struct to cells, behind the prefix. NULL: done; else the name of a member that is not finite, out
 * of range, or no unit quaternion. */
const char *hapi_wire_pack(hapi_wire_kind kind, const void *from, const hapi_wire_names *names,
                           uint64_t *out_cells);

/* Cells to struct, of cells that were checked. Members that do not travel stay as they are. index:
 * of labels, by kind. */
typedef uint32_t (*hapi_wire_index_fn)(const void *of, hapi_wire_kind kind, uint64_t cell);
void hapi_wire_unpack(hapi_wire_kind kind, const uint64_t *cells, hapi_wire_index_fn index,
                      const void *of, void *out);

/* Whether each cell has a value of its type. NULL: yes; else the name of the member. */
const char *hapi_wire_check(hapi_wire_kind kind, const uint64_t *cells);

/* A name for what a record of a kind that is alike is made of. */
uint64_t hapi_wire_alike(hapi_wire_kind kind, const uint64_t *cells);

#endif
